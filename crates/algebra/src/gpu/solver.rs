//! The dense symmetric-definite eigenproblem on the device.

use chladni_base::Monitor;

use super::device::Device;
use super::error::GpuError;
use super::matrix::DeviceMatrix;
use super::multiply::transpose;
use super::real::Real;
use super::recorder::Recorder;
use super::triangle::Triangle;
use super::tridiagonal::{WIDE_BLOCK, back, block_factors, reduce};
use crate::DenseMatrix;
use crate::eigen::tridiagonal_lowest;

/// Bytes of eigenvectors that go back at once.
const CHUNK_BYTES: usize = 256 << 20;

/// The `count` lowest pairs of `A x = λ L Lᵀ x`, of which the lower triangles are read: values ascending, and vectors
/// with `xᵀ L Lᵀ x = 1` but for rounding in the precision `T`.
///
/// The products and the reduction run on the device, the small tridiagonal problem on this machine.
///
/// # Errors
/// Whatever the device says, and [`GpuError::Cancelled`].
pub(super) fn lowest<T: Real>(
    device: &Device,
    a: &DenseMatrix,
    l: &DenseMatrix,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, DenseMatrix), GpuError> {
    let d = a.rows();
    let mut recorder = Recorder::new(device, monitor);
    let recorder = &mut recorder;
    let first = DeviceMatrix::<T>::new(device, d, d)?;
    let second = DeviceMatrix::<T>::new(device, d, d)?;
    upload_symmetric(device, &first, a, 1.0)?;
    let triangle = Triangle::<T>::new(device, l)?;
    monitor.checkpoint()?;

    // C = L⁻¹ A L⁻ᵀ, from the left twice.
    triangle.solve(recorder, &second, &first)?;
    transpose(recorder, &first, &second)?;
    triangle.solve(recorder, &second, &first)?;
    recorder.finish()?;
    drop(first);
    monitor.progress(0.15);

    let tridiagonal = reduce(recorder, &second, &|done| monitor.progress(0.15 + 0.45 * done))?;
    let factors = if d > 1 { Some(block_factors(recorder, &second, &tridiagonal.tau)?) } else { None };
    device.trim();
    monitor.checkpoint()?;
    let (values, z) = tridiagonal_lowest(&tridiagonal.diagonal, &tridiagonal.off_diagonal, count)
        .map_err(|error| GpuError::Refused { reason: error.to_string() })?;
    monitor.progress(0.8);
    monitor.checkpoint()?;

    let mut vectors = DenseMatrix::zeros(d, count);
    let chunk = (CHUNK_BYTES / (d * size_of::<T>())).clamp(1, count);
    for start in (0..count).step_by(chunk) {
        let rows = chunk.min(count - start);
        let (chunk_z, chunk_x) = (DeviceMatrix::<T>::new(device, rows, d)?, DeviceMatrix::<T>::new(device, rows, d)?);
        chunk_z.write(device, |row, into| {
            into.iter_mut().zip(z.column(start + row)).for_each(|(into, &x)| *into = T::of(x));
        })?;
        if let Some(factors) = &factors {
            let scratch = || DeviceMatrix::<T>::new(device, rows, WIDE_BLOCK.min(d));
            back(recorder, &second, factors, &chunk_z, &[scratch()?, scratch()?])?;
        }
        triangle.solve_from_right(recorder, &chunk_x, &chunk_z)?;
        recorder.finish()?;
        chunk_x.read(device, 0..rows, |row, from| {
            vectors.column_mut(start + row).iter_mut().zip(from).for_each(|(x, from)| *x = from.value());
        })?;
        monitor.progress(0.8 + 0.18 * (start + rows) as f64 / count as f64);
        monitor.checkpoint()?;
    }
    drop((second, triangle, factors));
    device.trim();
    Ok((values, vectors))
}

/// Writes a multiple of a symmetric matrix of which the lower triangle is given: row by row from squares that fit into
/// the cache.
pub(super) fn upload_symmetric<T: Real>(
    device: &Device,
    into: &DeviceMatrix<T>,
    a: &DenseMatrix,
    scale: f64,
) -> Result<(), GpuError> {
    const SQUARE: usize = 64;
    let d = a.rows();
    // The strip of rows that is at hand: their entries left of the diagonal lie across columns.
    let mut strip = vec![T::of(0.0); SQUARE.min(d) * d];
    into.write(device, |row, values| {
        if row.is_multiple_of(SQUARE) {
            let end = (row + SQUARE).min(d);
            for column in 0..end {
                for (k, &x) in a.column(column)[row.max(column)..end].iter().enumerate() {
                    strip[(row.max(column) - row + k) * d + column] = T::of(scale * x);
                }
            }
        }
        let begin = row % SQUARE * d;
        values[..row].copy_from_slice(&strip[begin..begin + row]);
        values[row..].iter_mut().zip(&a.column(row)[row..]).for_each(|(value, &x)| *value = T::of(scale * x));
    })
}

/// How far pairs are from `A X = L Lᵀ X Λ` and `Xᵀ L Lᵀ X = 1`, by one random combination of all of them: the larger of
/// both norms, relative to the sizes of the matrices. It costs a few passes over the matrices, and no wrong column
/// hides from it.
pub(super) fn probe(a: &DenseMatrix, l: &DenseMatrix, values: &[f64], vectors: &DenseMatrix) -> f64 {
    let mut numbers = super::numbers::Numbers(values.len() as u64);
    let weights: Vec<f64> = numbers.take(values.len());
    let combine = |weights: &dyn Fn(usize) -> f64| {
        let mut sum = vec![0.0; a.rows()];
        for k in 0..values.len() {
            let weight = weights(k);
            sum.iter_mut().zip(vectors.column(k)).for_each(|(sum, x)| *sum += weight * x);
        }
        sum
    };
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (plain, scaled) = (combine(&|k| weights[k]), combine(&|k| weights[k] * values[k]));
    let (left, right) = (symmetric_times(a, &plain), lower_times(l, &transposed_times(l, &scaled)));
    let difference: Vec<f64> = left.iter().zip(&right).map(|(x, y)| x - y).collect();
    let metric = lower_times(l, &transposed_times(l, &plain));
    // |A|, by its action on this vector and on one that looks random: the lowest pairs alone may all belong to zero.
    let any: Vec<f64> = numbers.take(a.rows());
    let action = norm(&symmetric_times(a, &any)) / norm(&any);
    let size = norm(&left).max(action * norm(&plain)).max(f64::MIN_POSITIVE);
    let gram: Vec<f64> = (0..values.len())
        .map(|k| vectors.column(k).iter().zip(&metric).map(|(x, y)| x * y).sum::<f64>() - weights[k])
        .collect();
    let worst = (norm(&difference) / size).max(norm(&gram) / norm(&weights).max(f64::MIN_POSITIVE));
    if worst.is_nan() { f64::INFINITY } else { worst }
}

/// `A x`, from the lower triangle.
fn symmetric_times(a: &DenseMatrix, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for column in 0..x.len() {
        let below = &a.column(column)[column..];
        y[column] += below[0] * x[column];
        let mut sum = 0.0;
        for (k, value) in below.iter().enumerate().skip(1) {
            y[column + k] += value * x[column];
            sum += value * x[column + k];
        }
        y[column] += sum;
    }
    y
}

fn lower_times(l: &DenseMatrix, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for (column, &factor) in x.iter().enumerate() {
        y[column..].iter_mut().zip(&l.column(column)[column..]).for_each(|(y, l)| *y += factor * l);
    }
    y
}

fn transposed_times(l: &DenseMatrix, x: &[f64]) -> Vec<f64> {
    (0..x.len()).map(|column| l.column(column)[column..].iter().zip(&x[column..]).map(|(l, x)| l * x).sum()).collect()
}
