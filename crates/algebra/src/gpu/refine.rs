//! The lowest pairs on a device that knows f32 alone: all pairs roughly there, then those that are wanted refined in
//! f64.
//!
//! The device reduces `C = L⁻¹AL⁻ᵀ` in f32 and holds its `d` rough vectors, the wanted ones `X` and the others `W`. A
//! step takes the residual `R = CX − XΘ` in f64, removes from `X` what it says about the others (`W (Λ − θ)⁻¹ Wᵀ R`: a
//! step of Jacobi's correction with the rough pairs in place of the true ones, two products on the device), and solves
//! the problem restricted to `X` in f64. Clusters and multiple values among the wanted ones need nothing special, since
//! that last problem is dense.

use chladni_base::{Monitor, Quiet, stopped};

use super::device::Device;
use super::error::GpuError;
use super::matrix::DeviceMatrix;
use super::multiply::{Form, multiply};
use super::recorder::Recorder;
use super::solver::upload_symmetric;
use super::tridiagonal::{WIDE_BLOCK, back, block_factors, reduce};
use crate::eigen::{CpuSolver, SymmetricDefiniteSolver, from_standard, to_standard, tridiagonal_lowest};
use crate::{DenseMatrix, EigenError, dot_in_order};

/// The relative residual at which refinement ends.
const GOAL: f64 = 1e-13;

/// The largest relative residual that a result may have where further steps gain nothing.
const ENOUGH: f64 = 1e-11;

/// Steps, at most. Two are the rule.
const MOST_STEPS: usize = 6;

/// Differences of eigenvalues, relative to the largest one, that rough values cannot tell apart.
const BLUR: f64 = 1e-6;

/// Pairs beside the wanted ones that are refined along, at least.
const GUARD: usize = 4;

/// Whether so many pairs are few enough: with more the last problem in f64 is nearly the first one.
pub(super) fn refinement_pays(d: usize, count: usize) -> bool {
    3 * count <= 2 * d
}

/// The `count` lowest pairs of `A x = λ L Lᵀ x`, of which the lower triangles are read, as [`super::solver::lowest`]
/// gives them.
///
/// # Errors
/// Whatever the device says, [`GpuError::NotRefined`] and [`GpuError::Cancelled`].
pub(super) fn lowest(
    device: &Device,
    a: &DenseMatrix,
    l: &DenseMatrix,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, DenseMatrix), GpuError> {
    let mut c = a.clone();
    to_standard(&mut c, l)?;
    mirror(&mut c);
    monitor.progress(0.1);
    monitor.checkpoint()?;
    let rough = Rough::new(device, &c, monitor)?;
    let (values, mut vectors) = refine(&c, &rough, count, monitor)?;
    drop(rough);
    device.trim();
    from_standard(l, &mut vectors);
    Ok((values, vectors))
}

// What the CPU's part did not do was not refined.
stopped!(GpuError: EigenError => |_| Self::NotRefined { residual: f64::INFINITY });

/// Copies the lower triangle to the upper one.
fn mirror(c: &mut DenseMatrix) {
    const SQUARE: usize = 64;
    let d = c.rows();
    let values = c.values_mut();
    for block in (0..d).step_by(SQUARE) {
        for row in block..d {
            for column in block..(block + SQUARE).min(row) {
                values[row * d + column] = values[column * d + row];
            }
        }
    }
}

/// All pairs of a symmetric matrix as f32 gives them.
struct Rough<'a> {
    device: &'a Device,
    /// Ascending.
    values: Vec<f64>,
    /// A vector in each row.
    vectors: DeviceMatrix<f32>,
}

impl<'a> Rough<'a> {
    fn new(device: &'a Device, c: &DenseMatrix, monitor: &dyn Monitor) -> Result<Self, GpuError> {
        let d = c.rows();
        let mut recorder = Recorder::new(device, monitor);
        let recorder = &mut recorder;
        // Magnitudes near one, for squares in f32.
        let largest = c.values().iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let scale = if largest > 0.0 { (-largest.log2().round()).exp2() } else { 1.0 };
        let reflectors = DeviceMatrix::<f32>::new(device, d, d)?;
        upload_symmetric(device, &reflectors, c, scale)?;
        let tridiagonal = reduce(recorder, &reflectors, &|done| monitor.progress(0.1 + 0.3 * done))?;
        let factors = if d > 1 { Some(block_factors(recorder, &reflectors, &tridiagonal.tau)?) } else { None };
        monitor.checkpoint()?;
        let (mut values, z) = tridiagonal_lowest(&tridiagonal.diagonal, &tridiagonal.off_diagonal, d)?;
        values.iter_mut().for_each(|value| *value /= scale);
        monitor.progress(0.6);
        monitor.checkpoint()?;
        let vectors = DeviceMatrix::<f32>::new(device, d, d)?;
        vectors.write(device, |row, into| {
            into.iter_mut().zip(z.column(row)).for_each(|(into, &x)| *into = x as f32);
        })?;
        drop(z);
        if let Some(factors) = &factors {
            let scratch = || DeviceMatrix::<f32>::new(device, d, WIDE_BLOCK.min(d));
            back(recorder, &reflectors, factors, &vectors, &[scratch()?, scratch()?])?;
        }
        recorder.finish()?;
        Ok(Self { device, values, vectors })
    }

    /// The first vectors.
    fn lowest(&self, count: usize) -> Result<DenseMatrix, GpuError> {
        let mut x = DenseMatrix::zeros(self.values.len(), count);
        self.vectors.read(self.device, 0..count, |row, from| {
            x.column_mut(row).iter_mut().zip(from).for_each(|(x, &from)| *x = f64::from(from));
        })?;
        Ok(x)
    }

    /// The largest magnitude of an eigenvalue.
    fn norm(&self) -> f64 {
        self.values.iter().fold(0.0, |most, value| most.max(value.abs()))
    }

    /// Where to end the pairs that are refined: at the widest gap a little above the wanted ones.
    fn cut(&self, count: usize) -> usize {
        let d = self.values.len();
        let first = (count + GUARD).min(d);
        let last = (first + (count / 8).max(16)).min(d - 1);
        let gap = |end: usize| if end < d { self.values[end] - self.values[end - 1] } else { 0.0 };
        (first..=last).fold(first, |best, end| if gap(end) > gap(best) { end } else { best })
    }

    /// `X ← X − W (Λ − θ)⁻¹ Wᵀ R` with all vectors from the `x.columns()`-th on as `W`.
    fn correct(
        &self,
        x: &mut DenseMatrix,
        residuals: &DenseMatrix,
        theta: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<(), GpuError> {
        let (d, kept) = (x.rows(), x.columns());
        let device = self.device;
        let blur = BLUR * self.norm().max(f64::MIN_POSITIVE);
        let norms: Vec<f64> = (0..kept).map(|k| norm(residuals.column(k))).collect();
        let others = self.vectors.part(kept, d - kept, 0, d);
        let rows = DeviceMatrix::<f32>::new(device, kept, d)?;
        let along = DeviceMatrix::<f32>::new(device, kept, d - kept)?;
        rows.write(device, |k, into| {
            let factor = if norms[k] > 0.0 { 1.0 / norms[k] } else { 0.0 };
            into.iter_mut().zip(residuals.column(k)).for_each(|(into, x)| *into = (x * factor) as f32);
        })?;
        let mut recorder = Recorder::new(device, monitor);
        multiply(&mut recorder, Form::Second, along.all(), rows.all(), others, (1.0, 0.0))?;
        recorder.finish()?;
        let mut shares = vec![0.0f32; kept * (d - kept)];
        along.read(device, 0..kept, |k, from| {
            let shares = &mut shares[k * (d - kept)..(k + 1) * (d - kept)];
            for ((share, &from), value) in shares.iter_mut().zip(from).zip(&self.values[kept..]) {
                *share = (f64::from(from) * blur / (value - theta[k]).max(blur)) as f32;
            }
        })?;
        along.write(device, |k, into| into.copy_from_slice(&shares[k * (d - kept)..(k + 1) * (d - kept)]))?;
        multiply(&mut recorder, Form::Plain, rows.all(), along.all(), others, (1.0, 0.0))?;
        recorder.finish()?;
        rows.read(device, 0..kept, |k, from| {
            let factor = norms[k] / blur;
            x.column_mut(k).iter_mut().zip(from).for_each(|(x, &from)| *x -= factor * f64::from(from));
        })
    }
}

/// The lowest pairs of `C`, symmetric and full, from rough ones.
fn refine(
    c: &DenseMatrix,
    rough: &Rough<'_>,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, DenseMatrix), GpuError> {
    let kept = rough.cut(count);
    let mut x = rough.lowest(kept)?;
    // The rough vectors mix those of near values, which the restricted problem mends: only what leaves their space has
    // to go before.
    let mut y = c.times(&x);
    let mut theta: Vec<f64> =
        (0..kept).map(|k| dot_in_order(x.column(k), y.column(k)) / dot_in_order(x.column(k), x.column(k))).collect();
    let mut worst = f64::INFINITY;
    for step in 0..MOST_STEPS {
        monitor.detail(&format!("refinement, step {step}"));
        subtract_scaled(&mut y, &x, &theta);
        if step > 0 {
            let before = worst;
            let size = rough.norm().max(f64::MIN_POSITIVE);
            worst = (0..count).map(|k| norm(y.column(k)) / size).fold(0.0, f64::max);
            let stuck = !(worst < 0.25 * before);
            if worst <= GOAL || (stuck && worst <= ENOUGH) || (stuck && step > 2) {
                break;
            }
        }
        rough.correct(&mut x, &y, &theta, monitor)?;
        monitor.checkpoint()?;
        y = c.times(&x);
        let stiffness = x.transposed_times(&y);
        let mass = x.transposed_times(&x);
        let pairs = CpuSolver.lowest(stiffness, mass, kept, &Quiet(monitor))?;
        x = x.times(&pairs.vectors);
        y = y.times(&pairs.vectors);
        theta = pairs.values;
        monitor.progress(0.9 - 0.25 / (step + 1) as f64);
    }
    if !(worst <= ENOUGH) {
        return Err(GpuError::NotRefined { residual: worst });
    }
    theta.truncate(count);
    x.keep_columns(count);
    Ok((theta, x))
}

/// `Y ← Y − X Θ`.
fn subtract_scaled(y: &mut DenseMatrix, x: &DenseMatrix, theta: &[f64]) {
    for (k, theta) in theta.iter().enumerate() {
        y.column_mut(k).iter_mut().zip(x.column(k)).for_each(|(y, x)| *y -= theta * x);
    }
}

fn norm(x: &[f64]) -> f64 {
    dot_in_order(x, x).sqrt()
}
