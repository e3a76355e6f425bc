//! Dense matrices on the device: rows behind each other, cut into panels of whole rows, each in a buffer that one
//! binding can show.

use std::sync::mpsc;

use chladni_base::Unwatched;

use super::device::{Buffer, Device};
use super::error::GpuError;
use super::real::Real;
use super::recorder::Recorder;

/// Bytes that travel at once between the device and this machine.
const TRANSFER_BYTES: usize = 32 << 20;

/// A dense row-major matrix on the device.
pub(super) struct DeviceMatrix<T> {
    rows: usize,
    columns: usize,
    panel_rows: usize,
    panels: Vec<Buffer<T>>,
}

/// A part of a matrix: some rows and columns.
#[derive(Clone, Copy)]
pub(super) struct View<'a, T> {
    pub(super) matrix: &'a DeviceMatrix<T>,
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

impl<T: Real> DeviceMatrix<T> {
    /// Room for a matrix. Its content is arbitrary.
    ///
    /// # Errors
    /// [`GpuError::Memory`], also where not even one row fits into a binding.
    pub(super) fn new(device: &Device, rows: usize, columns: usize) -> Result<Self, GpuError> {
        let row_bytes = (columns.max(1) * size_of::<T>()) as u64;
        let limits = device.limits();
        // A binding of at most 2 GiB keeps every place below 2^32.
        let panel_rows = (limits.binding_bytes.min(limits.buffer_bytes & !0xff) / row_bytes) as usize;
        if panel_rows == 0 {
            return Err(GpuError::Memory { bytes: row_bytes });
        }
        let panel_rows = panel_rows.min(rows.max(1));
        let panels = (0..rows)
            .step_by(panel_rows)
            .map(|first| device.buffer((panel_rows.min(rows - first) * columns) as u64))
            .collect::<Result<_, _>>()?;
        Ok(Self { rows, columns, panel_rows, panels })
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Panels in order: the first row, the number of rows, the buffer.
    pub(super) fn panels(&self) -> impl Iterator<Item = (usize, usize, &Buffer<T>)> {
        let first = (0..self.rows).step_by(self.panel_rows);
        self.panels.iter().zip(first).map(|(buffer, first)| (first, self.panel_rows.min(self.rows - first), buffer))
    }

    /// The buffer of a matrix that is not cut.
    ///
    /// # Errors
    /// [`GpuError::Memory`] where it is.
    pub(super) fn only(&self) -> Result<&Buffer<T>, GpuError> {
        match &self.panels[..] {
            [only] => Ok(only),
            _ => Err(GpuError::Memory { bytes: (self.rows * self.columns * size_of::<T>()) as u64 }),
        }
    }

    /// The panel that holds a row: its first row, and its buffer.
    pub(super) fn panel_of(&self, row: usize) -> Option<(usize, &Buffer<T>)> {
        let panel = row / self.panel_rows;
        self.panels.get(panel).map(|buffer| (panel * self.panel_rows, buffer))
    }

    /// The first row behind the panel of a row.
    pub(super) fn panel_end(&self, row: usize) -> usize {
        ((row / self.panel_rows + 1) * self.panel_rows).min(self.rows)
    }

    /// All of it.
    pub(super) fn all(&self) -> View<'_, T> {
        self.part(0, self.rows, 0, self.columns)
    }

    /// Rows from `row` on and columns from `column` on.
    pub(super) fn part(&self, row: usize, rows: usize, column: usize, columns: usize) -> View<'_, T> {
        View { matrix: self, row, column, rows, columns }
    }

    /// Fills the matrix: `row` writes one row into the slice it is given.
    pub(super) fn write(&self, device: &Device, mut row: impl FnMut(usize, &mut [T])) -> Result<(), GpuError> {
        let at_once = (TRANSFER_BYTES / (self.columns.max(1) * size_of::<T>())).max(1);
        let mut values = Vec::new();
        for (first, rows, buffer) in self.panels() {
            for start in (0..rows).step_by(at_once) {
                let count = at_once.min(rows - start);
                values.resize(count * self.columns, T::of(0.0));
                for k in 0..count {
                    row(first + start + k, &mut values[k * self.columns..(k + 1) * self.columns]);
                }
                write_values(device, buffer, (start * self.columns) as u64, &values)?;
            }
        }
        Ok(())
    }

    /// Reads some rows: `take` gets the number of each and its values.
    pub(super) fn read(
        &self,
        device: &Device,
        range: std::ops::Range<usize>,
        mut take: impl FnMut(usize, &[T]),
    ) -> Result<(), GpuError> {
        let row_bytes = self.columns * size_of::<T>();
        let at_once = (TRANSFER_BYTES / row_bytes.max(1)).max(1);
        let mut row = range.start;
        while row < range.end.min(self.rows) {
            let Some((first, buffer)) = self.panel_of(row) else { break };
            let end = self.panel_end(row).min(range.end).min(row + at_once);
            let values =
                read_values(device, buffer, ((row - first) * self.columns) as u64, (end - row) * self.columns)?;
            for (k, values) in values.chunks_exact(self.columns.max(1)).enumerate() {
                take(row + k, values);
            }
            row = end;
        }
        Ok(())
    }
}

/// Writes numbers into a buffer, from place `at` on.
pub(super) fn write_values<T: Real>(
    device: &Device,
    buffer: &Buffer<T>,
    at: u64,
    values: &[T],
) -> Result<(), GpuError> {
    write_bytes(device, buffer.raw(), at * size_of::<T>() as u64, bytemuck::cast_slice(values))
}

/// A buffer with these numbers.
pub(super) fn upload<T: bytemuck::Pod>(device: &Device, numbers: &[T]) -> Result<Buffer<T>, GpuError> {
    let buffer = device.buffer::<T>(numbers.len() as u64)?;
    write_bytes(device, buffer.raw(), 0, bytemuck::cast_slice(numbers)).map(|()| buffer)
}

/// Writes bytes into a buffer, a portion at a time, so that not all of them wait in staging memory.
pub(super) fn write_bytes(device: &Device, buffer: &wgpu::Buffer, at: u64, bytes: &[u8]) -> Result<(), GpuError> {
    for (k, part) in bytes.chunks(TRANSFER_BYTES).enumerate() {
        device.queue.write_buffer(buffer, at + (k * TRANSFER_BYTES) as u64, part);
        if part.len() >= TRANSFER_BYTES / 2 {
            let submission = device.queue.submit([]);
            device.wait(Some(submission))?;
        }
    }
    device.check()
}

/// Reads numbers from a buffer, from place `at` on.
pub(super) fn read_values<T: Real>(
    device: &Device,
    buffer: &Buffer<T>,
    at: u64,
    count: usize,
) -> Result<Vec<T>, GpuError> {
    let bytes = (count * size_of::<T>()) as u64;
    if bytes == 0 {
        return Ok(Vec::new());
    }
    let staging = device.new_buffer(bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)?;
    let mut recorder = Recorder::new(device, &Unwatched);
    recorder.copy(buffer.raw(), at * size_of::<T>() as u64, &staging, 0, bytes);
    recorder.submit()?;
    let (tell, told) = mpsc::channel();
    staging.slice(..).map_async(wgpu::MapMode::Read, move |mapped| {
        // The receiver is gone only where nobody asks any more.
        let _ = tell.send(mapped);
    });
    device.wait(None)?;
    let refused = |reason: String| GpuError::Refused { reason };
    match told.try_recv() {
        Ok(Ok(())) => {}
        Ok(Err(error)) => return Err(refused(error.to_string())),
        Err(_) => return Err(refused("a buffer was not mapped".into())),
    }
    let view = staging.slice(..).get_mapped_range().map_err(|error| refused(error.to_string()))?;
    let values = bytemuck::pod_collect_to_vec(&view[..]);
    drop(view);
    staging.unmap();
    Ok(values)
}
