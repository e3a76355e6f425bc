//! Systems with a triangular matrix on the device: by halves, so that nearly all of the work is products.

use super::device::Device;
use super::error::GpuError;
use super::matrix::DeviceMatrix;
use super::multiply::{Form, multiply};
use super::real::Real;
use super::recorder::Recorder;
use crate::DenseMatrix;

/// Below this size the inverse is at hand.
const SMALL: usize = 64;

/// A lower triangular matrix `L` on the device: transposed, since its columns lie behind each other, and with the
/// inverses of the blocks on its diagonal.
pub(super) struct Triangle<T> {
    transposed: DeviceMatrix<T>,
    inverses: DeviceMatrix<T>,
}

impl<T: Real> Triangle<T> {
    /// Brings `L` to the device: the lower triangle of `l`, column after column.
    pub(super) fn new(device: &Device, l: &DenseMatrix) -> Result<Self, GpuError> {
        let d = l.rows();
        let transposed = DeviceMatrix::new(device, d, d)?;
        transposed.write(device, |row, values| {
            values[..row].fill(T::of(0.0));
            values[row..].iter_mut().zip(&l.column(row)[row..]).for_each(|(value, &x)| *value = T::of(x));
        })?;
        let inverses = DeviceMatrix::new(device, d, SMALL.min(d))?;
        let mut block = Vec::new();
        let mut begins = None;
        inverses.write(device, |row, values| {
            let (start, size) = leaf_of(row, d);
            if begins != Some(start) {
                begins = Some(start);
                block = inverse(l, start, size);
            }
            values.fill(T::of(0.0));
            let line = &block[(row - start) * size..(row - start + 1) * size];
            values.iter_mut().zip(line).for_each(|(value, &x)| *value = T::of(x));
        })?;
        Ok(Self { transposed, inverses })
    }

    /// `X = L⁻¹ A`; what is left in `a` is of no use.
    pub(super) fn solve(
        &self,
        recorder: &mut Recorder<'_>,
        x: &DeviceMatrix<T>,
        a: &DeviceMatrix<T>,
    ) -> Result<(), GpuError> {
        self.solve_rows(recorder, x, a, 0, a.rows())
    }

    fn solve_rows(
        &self,
        recorder: &mut Recorder<'_>,
        x: &DeviceMatrix<T>,
        a: &DeviceMatrix<T>,
        start: usize,
        size: usize,
    ) -> Result<(), GpuError> {
        let n = a.columns();
        if size <= SMALL {
            let inverse = self.inverses.part(start, size, 0, size);
            return multiply(
                recorder,
                Form::Plain,
                x.part(start, size, 0, n),
                inverse,
                a.part(start, size, 0, n),
                (1.0, 0.0),
            );
        }
        let half = half_of(size);
        let (middle, rest) = (start + half, size - half);
        self.solve_rows(recorder, x, a, start, half)?;
        let below = self.transposed.part(start, half, middle, rest);
        let (from, to) = (x.part(start, half, 0, n), a.part(middle, rest, 0, n));
        multiply(recorder, Form::First, to, below, from, (-1.0, 1.0))?;
        self.solve_rows(recorder, x, a, middle, rest)
    }

    /// `X = Z L⁻¹`: every row of `x` is `L⁻ᵀ` times that of `z`, whose content is of no use afterwards.
    pub(super) fn solve_from_right(
        &self,
        recorder: &mut Recorder<'_>,
        x: &DeviceMatrix<T>,
        z: &DeviceMatrix<T>,
    ) -> Result<(), GpuError> {
        self.solve_columns(recorder, x, z, 0, z.columns())
    }

    fn solve_columns(
        &self,
        recorder: &mut Recorder<'_>,
        x: &DeviceMatrix<T>,
        z: &DeviceMatrix<T>,
        start: usize,
        size: usize,
    ) -> Result<(), GpuError> {
        let m = z.rows();
        if size <= SMALL {
            let inverse = self.inverses.part(start, size, 0, size);
            let (to, from) = (x.part(0, m, start, size), z.part(0, m, start, size));
            return multiply(recorder, Form::Plain, to, from, inverse, (1.0, 0.0));
        }
        let half = half_of(size);
        let (middle, rest) = (start + half, size - half);
        self.solve_columns(recorder, x, z, middle, rest)?;
        let below = self.transposed.part(start, half, middle, rest);
        let (from, to) = (x.part(0, m, middle, rest), z.part(0, m, start, half));
        multiply(recorder, Form::Second, to, from, below, (-1.0, 1.0))?;
        self.solve_columns(recorder, x, z, start, half)
    }
}

fn half_of(size: usize) -> usize {
    (size / 2).next_multiple_of(8)
}

/// The block on the diagonal that a row belongs to: its first row and its size.
fn leaf_of(row: usize, d: usize) -> (usize, usize) {
    let (mut start, mut size) = (0, d);
    while size > SMALL {
        let half = half_of(size);
        if row < start + half {
            size = half;
        } else {
            start += half;
            size -= half;
        }
    }
    (start, size)
}

/// The inverse of a block on the diagonal of a lower triangular matrix, row-major.
fn inverse(l: &DenseMatrix, start: usize, size: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; size * size];
    for column in 0..size {
        for row in column..size {
            let right = if row == column { 1.0 } else { 0.0 };
            let sum: f64 = (column..row).map(|k| l.column(start + k)[start + row] * inverse[k * size + column]).sum();
            inverse[row * size + column] = (right - sum) / l.column(start + row)[start + row];
        }
    }
    inverse
}
