//! Sparse matrices on the device.

use super::device::{Buffer, Device};
use super::error::GpuError;
use super::kernel::{KernelName, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, upload};
use super::real::Real;
use super::recorder::Recorder;

/// A sparse matrix in compressed rows, cut along its columns as the matrix that it multiplies is along its rows.
pub(super) struct DeviceSparse<T> {
    rows: usize,
    columns: usize,
    entries: usize,
    panels: Vec<SparsePanel<T>>,
}

/// The columns that meet one panel of the other matrix.
struct SparsePanel<T> {
    starts: Buffer<u32>,
    columns: Buffer<u32>,
    values: Buffer<T>,
}

impl<T: Real> DeviceSparse<T> {
    /// Brings a matrix of `columns` columns to the device, for products with matrices cut as `like` is. Row `r` has the
    /// entries `starts[r]..starts[r + 1]`.
    pub(super) fn new(
        device: &Device,
        columns: usize,
        starts: &[u32],
        places: &[u32],
        values: &[T],
        like: &DeviceMatrix<T>,
    ) -> Result<Self, GpuError> {
        let rows = starts.len().saturating_sub(1);
        let one = like.panels().count() == 1;
        let mut panels = Vec::new();
        for (first, height, _) in like.panels() {
            if one {
                panels.push(SparsePanel::new(device, starts, places, values)?);
                continue;
            }
            let (mut cut_starts, mut cut_places, mut cut_values) = (vec![0u32], Vec::new(), Vec::new());
            for row in 0..rows {
                for k in starts[row] as usize..starts[row + 1] as usize {
                    let column = places[k] as usize;
                    if (first..first + height).contains(&column) {
                        cut_places.push((column - first) as u32);
                        cut_values.push(values[k]);
                    }
                }
                cut_starts.push(cut_places.len() as u32);
            }
            panels.push(SparsePanel::new(device, &cut_starts, &cut_places, &cut_values)?);
        }
        Ok(Self { rows, columns, entries: values.len(), panels })
    }

    /// `C ← α S A + β C`.
    pub(super) fn times(
        &self,
        recorder: &mut Recorder<'_>,
        c: &DeviceMatrix<T>,
        a: &DeviceMatrix<T>,
        (alpha, beta): (f32, f32),
    ) -> Result<(), GpuError> {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct Uniforms {
            rows: u32,
            n: u32,
            a_pitch: u32,
            c_at: u32,
            c_pitch: u32,
            first: u32,
            across: u32,
            alpha: f32,
            beta: f32,
        }
        if a.rows() != self.columns || c.rows() != self.rows || a.columns() != c.columns() {
            let reason = format!("a sparse product of {}×{} and {}×{}", self.rows, self.columns, a.rows(), a.columns());
            return Err(GpuError::Refused { reason });
        }
        let device = recorder.device();
        let kernel = device.kernel::<T>(KernelName::Sparse)?;
        let n = a.columns();
        let across = n.next_power_of_two().clamp(1, VECTOR_THREADS as usize);
        let rows_of_group = VECTOR_THREADS as usize / across;
        // Each term is two operations, but fetches what the arithmetic waits for.
        let row_seconds = 16.0 * (self.entries as f64 / self.rows.max(1) as f64 + 1.0) * n as f64 / device.rate::<T>();
        let at_once = recorder.rows_at_once(row_seconds, rows_of_group);
        for (place, (panel, (_, _, a_buffer))) in self.panels.iter().zip(a.panels()).enumerate() {
            let beta = if place == 0 { beta } else { 1.0 };
            for (c_first, c_rows, c_buffer) in c.panels() {
                let group = kernel.bind(
                    &device.device,
                    &[
                        panel.starts.binding(),
                        panel.columns.binding(),
                        panel.values.binding(),
                        a_buffer.binding(),
                        c_buffer.binding(),
                    ],
                );
                for first in (0..c_rows).step_by(at_once) {
                    let count = at_once.min(c_rows - first);
                    let uniforms = Uniforms {
                        rows: (c_first + first + count) as u32,
                        n: n as u32,
                        a_pitch: n as u32,
                        // The kernel counts rows of the whole matrix; places wrap around to those of the panel.
                        c_at: ((c_first * n) as u32).wrapping_neg(),
                        c_pitch: n as u32,
                        first: (c_first + first) as u32,
                        across: across as u32,
                        alpha,
                        beta,
                    };
                    let groups = (count.div_ceil(rows_of_group) as u32, 1, 1);
                    let seconds = row_seconds * count as f64;
                    recorder.dispatch(&kernel, &group, bytemuck::bytes_of(&uniforms), groups, seconds)?;
                }
            }
        }
        Ok(())
    }
}

impl<T: Real> SparsePanel<T> {
    fn new(device: &Device, starts: &[u32], places: &[u32], values: &[T]) -> Result<Self, GpuError> {
        Ok(Self { starts: upload(device, starts)?, columns: upload(device, places)?, values: upload(device, values)? })
    }
}
