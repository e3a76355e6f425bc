//! A symmetric matrix to tridiagonal form on the device, and vectors back (LAPACK's dsytrd and dormtr, with a full
//! matrix instead of a triangle: every row is read as a whole).

use super::device::Buffer;
use super::error::GpuError;
use super::kernel::{KernelName, ROWS_AT_ONCE, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, read_values};
use super::multiply::{Form, multiply};
use super::real::Real;
use super::recorder::Recorder;

/// Columns whose updates are gathered before the matrix takes them.
pub(super) const BLOCK: usize = 32;

/// Reflectors that are applied to vectors at once.
pub(super) const WIDE_BLOCK: usize = 128;

/// The parameters of the three kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Step {
    pub(super) d: u32,
    pub(super) j: u32,
    pub(super) l: u32,
    pub(super) nb: u32,
    pub(super) first_row: u32,
    pub(super) rows: u32,
    pub(super) parts: u32,
    pub(super) groups: u32,
    pub(super) flush: u32,
    pub(super) dot_groups: u32,
}

impl Step {
    /// Parameters that do not change, for an order `d`.
    pub(super) fn of(d: usize) -> Self {
        let parts = (d as u32).div_ceil(VECTOR_THREADS);
        Self { d: d as u32, nb: BLOCK as u32, parts, ..Self::default() }
    }

    /// The numbers in the work space.
    pub(super) fn work(&self) -> usize {
        self.at_diagonal() + 3 * self.d as usize
    }

    /// Where the diagonal lies in it; what is beside it and the factors τ follow, `d` numbers each.
    pub(super) fn at_diagonal(&self) -> usize {
        3 * self.d as usize + 2 * self.nb as usize + 2 * self.parts as usize
    }

    pub(super) fn at_column(mut self, j: usize, l: usize) -> Self {
        self.j = j as u32;
        self.l = l as u32;
        self.groups = (self.d - self.j).div_ceil(VECTOR_THREADS);
        self
    }

    pub(super) fn for_panel(mut self, first: usize, rows: usize, with_dots: bool) -> Self {
        self.first_row = first as u32;
        self.rows = rows as u32;
        self.dot_groups = if with_dots { (2 * self.l).div_ceil(ROWS_AT_ONCE) } else { 0 };
        self
    }

    /// Groups of the product with the reflector, for the rows of this panel.
    pub(super) fn reflect_groups(&self) -> u32 {
        let top = (self.j + 1).max(self.first_row);
        (self.first_row + self.rows).saturating_sub(top).div_ceil(ROWS_AT_ONCE) + self.dot_groups
    }
}

/// `A = Q T Qᵀ` with a tridiagonal `T`.
pub(super) struct Tridiagonal {
    /// `d` numbers.
    pub(super) diagonal: Vec<f64>,
    /// `d` numbers, of which the last is zero.
    pub(super) off_diagonal: Vec<f64>,
    /// The factors of the reflectors, `d` numbers.
    pub(super) tau: Vec<f64>,
}

/// Reduces `a`, symmetric and full, and leaves the reflectors in its rows: row `j` holds the `j`-th, with zeros up to
/// its place `j`. `progress` hears the fraction of columns done.
pub(super) fn reduce<T: Real>(
    recorder: &mut Recorder<'_>,
    a: &DeviceMatrix<T>,
    progress: &dyn Fn(f64),
) -> Result<Tridiagonal, GpuError> {
    let device = recorder.device();
    let d = a.rows();
    let constant = Step::of(d);
    let vectors = DeviceMatrix::<T>::new(device, 2 * BLOCK, d)?;
    let Some((_, vectors_buffer)) = vectors.panel_of(0).filter(|_| vectors.panels().count() == 1) else {
        return Err(GpuError::Memory { bytes: (2 * BLOCK * d * size_of::<T>()) as u64 });
    };
    let work: Buffer<T> = device.buffer(constant.work() as u64)?;
    let kernels = [KernelName::Column, KernelName::Reflect, KernelName::Combine];
    let [column, reflect, combine] = kernels.map(|name| device.kernel::<T>(name));
    let (column, reflect, combine) = (column?, reflect?, combine?);
    let panels: Vec<_> = a
        .panels()
        .map(|(first, rows, buffer)| {
            let bind = |kernel: &super::kernel::Kernel| {
                kernel.bind(&device.device, &[buffer.binding(), vectors_buffer.binding(), work.binding()])
            };
            (first, rows, bind(&column), bind(&reflect), bind(&combine))
        })
        .collect();
    let panel_of = |row: usize| panels.iter().rposition(|panel| panel.0 <= row).unwrap_or(0);
    let rate = device.rate::<T>();

    for start in (0..d).step_by(BLOCK) {
        let end = (start + BLOCK).min(d);
        for j in start..end {
            let l = j - start;
            let step = constant.at_column(j, l);
            let active = (d - j) as f64;
            let seconds = |numbers: f64| 2.0 * numbers / rate;
            let (first, rows, bound, _, bound_combine) = &panels[panel_of(j)];
            let here = step.for_panel(*first, *rows, false);
            let both = seconds(active * (2 * l + 1) as f64);
            recorder.dispatch(&column, bound, bytemuck::bytes_of(&here), (step.groups, 1, 1), both)?;
            if j + 1 == d {
                break;
            }
            let mut with_dots = true;
            for (first, rows, _, bound, _) in panels.iter().filter(|panel| panel.0 + panel.1 > j + 1) {
                let here = step.for_panel(*first, *rows, with_dots);
                with_dots = false;
                let time = seconds(active * (*rows as f64).min(active));
                recorder.dispatch(&reflect, bound, bytemuck::bytes_of(&here), (here.reflect_groups(), 1, 1), time)?;
            }
            let groups = (step.d - step.j - 1).div_ceil(VECTOR_THREADS);
            recorder.dispatch(&combine, bound_combine, bytemuck::bytes_of(&here), (groups, 1, 1), both)?;
        }
        // The reflectors take the rows that are done. Of the last block, none is used beyond the last column but one.
        let size = size_of::<T>() as u64;
        if end < d {
            let mut flush = constant.at_column(end, end - start);
            flush.flush = 1;
            let (.., bound, _, _) = &panels[0];
            recorder.dispatch(&column, bound, bytemuck::bytes_of(&flush), (flush.groups, 1, 1), 0.0)?;
            let rest = a.part(end, d - end, end, d - end);
            let (v, w) = (vectors.part(0, end - start, end, d - end), vectors.part(BLOCK, end - start, end, d - end));
            multiply(recorder, Form::First, rest, v, w, (-1.0, 1.0))?;
            multiply(recorder, Form::First, rest, w, v, (-1.0, 1.0))?;
        }
        for row in start..end.min(d - 1) {
            if let Some((first, buffer)) = a.panel_of(row) {
                let (from, to) = ((row - start) as u64 * d as u64 * size, (row - first) as u64 * d as u64 * size);
                recorder.copy(vectors_buffer.raw(), from, buffer.raw(), to, d as u64 * size);
            }
        }
        progress(end as f64 / d as f64);
        // A product of a matrix and a vector takes as long as the memory does, not the arithmetic: hand over block by
        // block.
        recorder.submit()?;
    }
    recorder.finish()?;
    let numbers = read_values(device, &work, constant.at_diagonal() as u64, 3 * d)?;
    let part = |k: usize| -> Vec<f64> { numbers[k * d..(k + 1) * d].iter().map(|x| x.value()).collect() };
    let (diagonal, mut off_diagonal, mut tau) = (part(0), part(1), part(2));
    // The last column has no reflector, so that its places were never written.
    off_diagonal[d - 1] = 0.0;
    tau[d - 1] = 0.0;
    Ok(Tridiagonal { diagonal, off_diagonal, tau })
}

/// The triangular factors of the blocks of reflectors, `WIDE_BLOCK` of them each: `H₁H₂⋯ = I − V T Vᵀ` (Schreiber and
/// Van Loan 1989). The matrix holds the factors below each other, each transposed of how it is applied to rows.
pub(super) fn block_factors<T: Real>(
    recorder: &mut Recorder<'_>,
    reflectors: &DeviceMatrix<T>,
    tau: &[f64],
) -> Result<DeviceMatrix<T>, GpuError> {
    let device = recorder.device();
    let d = reflectors.rows();
    let count = d - 1;
    let factors = DeviceMatrix::<T>::new(device, count, WIDE_BLOCK.min(count))?;
    for start in (0..count).step_by(WIDE_BLOCK) {
        let width = WIDE_BLOCK.min(count - start);
        let block = reflectors.part(start, width, start, d - start);
        let gram = factors.part(start, width, 0, width);
        // Both factors are the same part: it is only read.
        multiply(recorder, Form::Second, gram, block, block, (1.0, 0.0))?;
    }
    recorder.finish()?;
    let mut grams = vec![0.0; count * factors.columns()];
    let pitch = factors.columns();
    factors.read(device, 0..count, |row, values| {
        grams[row * pitch..(row + 1) * pitch].iter_mut().zip(values).for_each(|(g, value)| *g = value.value());
    })?;
    for start in (0..count).step_by(WIDE_BLOCK) {
        let width = WIDE_BLOCK.min(count - start);
        triangular_factor(&mut grams[start * pitch..(start + width) * pitch], pitch, width, &tau[start..start + width]);
    }
    factors.write(device, |row, values| {
        values.iter_mut().zip(&grams[row * pitch..]).for_each(|(value, &g)| *value = T::of(g));
    })?;
    Ok(factors)
}

/// Overwrites `VᵀV` with the upper triangular `T` of `H₁⋯H_w = I − V T Vᵀ`, row-major with the given pitch.
fn triangular_factor(gram: &mut [f64], pitch: usize, width: usize, tau: &[f64]) {
    let mut t = vec![0.0; width * width];
    for j in 0..width {
        t[j * width + j] = tau[j];
        for i in 0..j {
            let sum: f64 = (i..j).map(|k| t[i * width + k] * gram[k * pitch + j]).sum();
            t[i * width + j] = -tau[j] * sum;
        }
    }
    for i in 0..width {
        gram[i * pitch..i * pitch + width].copy_from_slice(&t[i * width..(i + 1) * width]);
    }
}

/// `Z ← Z Qᵀ`: every row of `z`, a vector in the basis of the tridiagonal matrix, goes back to that of the matrix.
pub(super) fn back<T: Real>(
    recorder: &mut Recorder<'_>,
    reflectors: &DeviceMatrix<T>,
    factors: &DeviceMatrix<T>,
    z: &DeviceMatrix<T>,
    scratch: &[DeviceMatrix<T>; 2],
) -> Result<(), GpuError> {
    let d = reflectors.rows();
    let count = d - 1;
    let starts: Vec<usize> = (0..count).step_by(WIDE_BLOCK).collect();
    for &start in starts.iter().rev() {
        let width = WIDE_BLOCK.min(count - start);
        let block = reflectors.part(start, width, start, d - start);
        let rows = z.part(0, z.rows(), start, d - start);
        let [first, second] = scratch;
        let (first, second) = (first.part(0, z.rows(), 0, width), second.part(0, z.rows(), 0, width));
        multiply(recorder, Form::Second, first, rows, block, (1.0, 0.0))?;
        multiply(recorder, Form::Second, second, first, factors.part(start, width, 0, width), (1.0, 0.0))?;
        multiply(recorder, Form::Plain, rows, second, block, (-1.0, 1.0))?;
    }
    Ok(())
}
