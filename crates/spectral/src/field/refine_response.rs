//! What forces move in the space of all fields of a surface: `K⁻¹ f` for `K = h S + μ S M⁻¹ S + A`, by conjugate
//! gradients with multigrid cycles.
//!
//! With `A = a M` and `(h / μ)² ≥ 4 a / μ` the biharmonic sum is a product, `K = μ (S + αM) M⁻¹ (S + βM)` with
//! `α + β = h / μ` and `αβ = a / μ`, so that it takes two solves of second order, whose condition is the root of that
//! of `K`. Any other `K` is solved with the nearest product as preconditioner.

use std::sync::{Arc, OnceLock};

use chladni_algebra::{BlockMatrix, vectorized};
use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::cycle::{Cycles, Shifted};
use super::design::DesignError;
use super::direct::{Direct, ShiftedFactor};
use super::kernel::{Kernel, orthonormalise};
use super::refine::RefineError;

/// Cycles are for `S + γM` with `γ` at least this, far below the lowest positive eigenvalue of most surfaces of unit
/// area: `S` alone may be singular.
const LEAST_SHIFT: f64 = 0.05;

/// Cycles are in single precision, which has no room for larger shifts.
pub(super) const MOST_SHIFT: f64 = 1e30;

/// Steps of inverse iteration that look for a field without energy.
const INVERSE_STEPS: usize = 12;

/// Steps of conjugate gradients at most.
const MOST_STEPS: usize = 400;

/// How well the product is solved that preconditions another sum.
const PRECONDITION: f64 = 1e-2;

/// Numbers that one task handles. Sums are formed in pieces that do not depend on the number of threads.
const PIECE: usize = 1 << 14;

/// Rows of a product that one task computes.
const ROWS: usize = 2048;

/// The operator of all fields with its levels.
pub(super) struct FullOperator<const B: usize> {
    pub stiffness: BlockMatrix<B>,
    /// The area of each face.
    pub mass: Vec<f64>,
    /// What preconditions solves: cycles, or on small surfaces sparse factors in their place.
    pub cycles: Option<Cycles<B>>,
    pub direct: Option<Direct<B>>,
    /// Fields without energy, once they were needed.
    pub kernel: OnceLock<Kernel>,
}

/// The weights of the energies, and of the squared deviation from a field.
#[derive(Clone)]
pub(super) struct Sum {
    pub harmonic: f64,
    pub biharmonic: f64,
    /// The weight of all faces.
    pub uniform: f64,
    /// What is added for each face, its area included.
    pub masses: Option<Vec<f64>>,
}

/// `K⁻¹` without what has no energy.
pub(super) struct Response<'a, const B: usize> {
    whole: &'a FullOperator<B>,
    sum: Sum,
    product: ShiftedProduct<'a, B>,
    /// Whether the product is `K` itself.
    exact: bool,
    /// Fields without energy.
    kernel: Option<&'a Kernel>,
}

/// The product, or what is left of it without a biharmonic energy, or without any.
enum ShiftedProduct<'a, const B: usize> {
    Two(Factor<'a, B>, Factor<'a, B>),
    One(Factor<'a, B>),
    Mass(f64),
}

/// `S + γM`.
pub(super) struct Factor<'a, const B: usize> {
    gamma: f64,
    solver: Solver<'a, B>,
}

/// What solves with `S + γM`, about or exactly.
enum Solver<'a, const B: usize> {
    Cycles(Shifted<'a, B>),
    Direct(&'a Direct<B>, Arc<ShiftedFactor>),
}

fn piece_dot(a: &[f64], b: &[f64]) -> f64 {
    vectorized(
        (a, b),
        #[inline(always)]
        |(a, b)| chladni_algebra::dot(a, b),
    )
}

/// `aᵀ b`. Sizes that differ are a mistake of this module's callers, here and below.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "an inner product of fields of different sizes");
    let sums: Vec<f64> = a.par_chunks(PIECE).zip(b.par_chunks(PIECE)).map(|(a, b)| piece_dot(a, b)).collect();
    sums.iter().sum()
}

/// `aᵀ M b` with the masses of the faces.
pub(super) fn product<const B: usize>(mass: &[f64], a: &[f64], b: &[f64]) -> f64 {
    assert_eq!((a.len(), b.len()), (B * mass.len(), B * mass.len()), "fields of other sizes than the mass");
    let pieces = a.par_chunks(B * PIECE).zip(b.par_chunks(B * PIECE)).zip(mass.par_chunks(PIECE));
    let sums: Vec<f64> = pieces
        .map(|((a, b), mass)| {
            let faces = a.as_chunks::<B>().0.iter().zip(b.as_chunks::<B>().0).zip(mass);
            faces.map(|((a, b), m)| m * (0..B).map(|i| a[i] * b[i]).sum::<f64>()).sum()
        })
        .collect();
    sums.iter().sum()
}

/// `aᵀ c` and `bᵀ c`.
fn dots(a: &[f64], b: &[f64], c: &[f64]) -> (f64, f64) {
    assert_eq!((a.len(), b.len()), (c.len(), c.len()), "inner products of fields of different sizes");
    let pieces = a.par_chunks(PIECE).zip(b.par_chunks(PIECE)).zip(c.par_chunks(PIECE));
    // A piece of `c` is in the cache when it meets that of `b`.
    let sums: Vec<(f64, f64)> = pieces.map(|((a, b), c)| (piece_dot(a, c), piece_dot(b, c))).collect();
    sums.iter().fold((0.0, 0.0), |all, own| (all.0 + own.0, all.1 + own.1))
}

/// `a += factor · b`.
pub(super) fn add(a: &mut [f64], b: &[f64], factor: f64) {
    assert_eq!(a.len(), b.len(), "a sum of fields of different sizes");
    a.par_chunks_mut(PIECE).zip(b.par_chunks(PIECE)).for_each(|(a, b)| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += factor * b);
    });
}

impl<const B: usize> FullOperator<B> {
    /// `S x`.
    pub fn stiff(&self, x: &[f64]) -> Vec<f64> {
        self.stiffness.multiply(x)
    }

    /// `x ← M x`.
    pub fn weigh(&self, x: &mut [f64]) {
        self.scale(x, |m| m);
    }

    /// `x ← M⁻¹ x`.
    pub fn unweigh(&self, x: &mut [f64]) {
        self.scale(x, |m| 1.0 / m);
    }

    fn scale(&self, x: &mut [f64], factor: impl Fn(f64) -> f64 + Sync) {
        x.par_chunks_mut(B * PIECE).zip(self.mass.par_chunks(PIECE)).for_each(|(x, mass)| {
            for (x, &m) in x.as_chunks_mut::<B>().0.iter_mut().zip(mass) {
                let factor = factor(m);
                x.iter_mut().for_each(|x| *x *= factor);
            }
        });
    }

    /// The mean weight that holds all fields, those without energy too.
    pub fn mean_weight(&self, sum: &Sum) -> f64 {
        let area: f64 = self.mass.iter().sum();
        sum.uniform + sum.masses.as_ref().map_or(0.0, |m| m.iter().sum::<f64>() / area)
    }

    /// `aᵀ M b`.
    pub fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        product::<B>(&self.mass, a, b)
    }

    /// What solves with `S + γM`.
    ///
    /// # Errors
    /// [`RefineError::Weights`]: γ is beyond single precision; what factors answer.
    pub fn factor(&self, gamma: f64) -> Result<Factor<'_, B>, RefineError> {
        if !(gamma <= MOST_SHIFT) {
            return Err(RefineError::Weights { most: MOST_SHIFT });
        }
        let solver = match (&self.direct, &self.cycles) {
            (Some(direct), _) => {
                let factor = direct.factor(&self.stiffness, &self.mass, gamma).map_err(DesignError::Sparse)?;
                Solver::Direct(direct, factor)
            }
            (None, Some(cycles)) => Solver::Cycles(cycles.shifted(gamma.max(LEAST_SHIFT))),
            // One of them is always there.
            (None, None) => return Err(RefineError::Weights { most: 0.0 }),
        };
        Ok(Factor { gamma, solver })
    }

    /// Fields without energy from approximations of them: by inverse iteration, orthonormal. Those that have energy
    /// after all are left out.
    pub fn polished(&self, mut fields: Vec<Vec<f64>>, monitor: &dyn Monitor) -> Result<Vec<Vec<f64>>, RefineError> {
        let factor = self.factor(1.0)?;
        for _ in 0..2 {
            for field in &mut fields {
                self.weigh(field);
                *field = factor.solve(self, field, 1e-12, None, monitor)?;
            }
            orthonormalise::<B>(&self.mass, &mut fields);
        }
        fields.retain(|field| dot(field, &self.stiff(field)) < IDLE);
        Ok(fields)
    }

    /// `γ > 0` only: `(S + γM) x`.
    pub fn shifted(&self, gamma: f64, x: &[f64]) -> Vec<f64> {
        let mut image = vec![0.0; x.len()];
        let x = x.as_chunks::<B>().0;
        image.as_chunks_mut::<B>().0.par_chunks_mut(ROWS).enumerate().for_each(|(task, image)| {
            vectorized(
                image,
                #[inline(always)]
                |image| {
                    for (k, image) in image.iter_mut().enumerate() {
                        let row = task * ROWS + k;
                        let (columns, blocks) = self.stiffness.row(row);
                        let mut sums = [[0.0; B]; B];
                        for (&column, block) in columns.iter().zip(blocks) {
                            let x = &x[column as usize];
                            for i in 0..B {
                                for j in 0..B {
                                    sums[i][j] += block[i][j] * x[j];
                                }
                            }
                        }
                        let mass = gamma * self.mass[row];
                        *image = std::array::from_fn(|i| sums[i].iter().sum::<f64>() + mass * x[row][i]);
                    }
                },
            );
        });
        image
    }
}

/// Fields of norm 1 with less harmonic energy have none.
pub(super) const IDLE: f64 = 1e-7;

impl<const B: usize> Factor<'_, B> {
    /// About `(S + γM)⁻¹ r`; with a factor of no other shift exactly.
    fn apply_inverse(&self, r: &[f64]) -> Vec<f64> {
        match &self.solver {
            Solver::Cycles(cycles) => cycles.cycle(r),
            Solver::Direct(direct, factor) => direct.solve(factor, r),
        }
    }

    /// Whether nothing is left to correct.
    fn is_exact(&self) -> bool {
        matches!(&self.solver, Solver::Direct(_, factor) if factor.gamma == self.gamma)
    }

    /// `(S + γM)⁻¹ f`, `f` without what `kernel` holds where γ is 0.
    fn solve(
        &self,
        whole: &FullOperator<B>,
        f: &[f64],
        tolerance: f64,
        kernel: Option<&Kernel>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f64>, RefineError> {
        if self.is_exact() {
            monitor.checkpoint()?;
            let mut x = self.apply_inverse(f);
            if self.gamma == 0.0 {
                kernel.iter().for_each(|kernel| kernel.take_out(whole, &mut x));
            }
            return Ok(x);
        }
        let kernel = if self.gamma == 0.0 { kernel } else { None };
        let apply = |x: &[f64]| if self.gamma > 0.0 { whole.shifted(self.gamma, x) } else { whole.stiff(x) };
        let precondition = |r: &[f64]| {
            let mut z = self.apply_inverse(r);
            kernel.iter().for_each(|kernel| kernel.take_out(whole, &mut z));
            Ok(z)
        };
        conjugate_gradients(apply, precondition, f, tolerance, monitor)
    }

    /// About `(S + γM)⁻¹ f`, `γ > 0`: to a tolerance, or as far as it came.
    pub fn about(
        &self,
        whole: &FullOperator<B>,
        f: &[f64],
        tolerance: f64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f64>, RefineError> {
        if self.is_exact() {
            monitor.checkpoint()?;
            return Ok(self.apply_inverse(f));
        }
        let apply = |x: &[f64]| whole.shifted(self.gamma, x);
        let precondition = |r: &[f64]| Ok(self.apply_inverse(r));
        Ok(steps(apply, precondition, f, tolerance, monitor)?.0)
    }
}

impl<'a, const B: usize> Response<'a, B> {
    /// The inverse for a sum; `kernel` are the fields without energy that nothing in it holds.
    pub fn new(whole: &'a FullOperator<B>, sum: Sum, kernel: Option<&'a Kernel>) -> Result<Self, RefineError> {
        let mean = whole.mean_weight(&sum);
        let factor = |gamma: f64| match (&whole.direct, kernel.filter(|kernel| gamma == 0.0 && kernel.is_complete())) {
            (Some(direct), Some(kernel)) => {
                let numbers = || kernel.to_ground(&whole.stiffness);
                let grounded = direct.grounded(&whole.stiffness, numbers).map_err(DesignError::Sparse)?;
                Ok(Factor { gamma, solver: Solver::Direct(direct, grounded) })
            }
            _ => whole.factor(gamma),
        };
        let mut exact = sum.masses.is_none();
        let product = if sum.biharmonic > 0.0 {
            let (half, held) = (0.5 * sum.harmonic / sum.biharmonic, mean / sum.biharmonic);
            let square = half * half - held;
            exact &= square >= 0.0;
            // Of complex roots the size: where the product is not the sum, it is at most twice as much.
            let large = if square >= 0.0 { half + square.sqrt() } else { held.sqrt() };
            let small = if large > 0.0 { held / large } else { 0.0 };
            ShiftedProduct::Two(factor(small)?, factor(large)?)
        } else if sum.harmonic > 0.0 {
            ShiftedProduct::One(factor(mean / sum.harmonic)?)
        } else {
            ShiftedProduct::Mass(mean)
        };
        Ok(Self { whole, sum, product, exact, kernel })
    }

    /// Whether the surface has fields without energy that are not known, where these would have to be kept apart:
    /// inverse iteration finds one.
    pub fn lacks_idle_fields(&self, monitor: &dyn Monitor) -> Result<bool, RefineError> {
        let needed = match &self.product {
            ShiftedProduct::Two(small, _) => small.gamma == 0.0,
            ShiftedProduct::One(one) => one.gamma == 0.0,
            ShiftedProduct::Mass(_) => false,
        };
        if !needed {
            return Ok(false);
        }
        let whole = self.whole;
        let factor = whole.factor(1.0)?;
        let mut field: Vec<f64> = (0..B * whole.mass.len()).map(|i| (i as f64 * i as f64 * 0.37).sin()).collect();
        for _ in 0..INVERSE_STEPS {
            whole.weigh(&mut field);
            field = factor.solve(whole, &field, 1e-10, None, monitor)?;
            self.kernel.iter().for_each(|kernel| kernel.take_out(whole, &mut field));
            let size = whole.product(&field, &field).sqrt().max(f64::MIN_POSITIVE);
            field.iter_mut().for_each(|x| *x /= size);
        }
        Ok(dot(&field, &whole.stiff(&field)) < IDLE)
    }

    /// What it is the inverse of.
    pub fn sum(&self) -> &Sum {
        &self.sum
    }

    /// Fields without energy, which are no part of what is moved.
    pub fn kernel(&self) -> Option<&'a Kernel> {
        self.kernel
    }

    /// The mass of each face.
    pub fn masses(&self) -> &'a [f64] {
        &self.whole.mass
    }

    /// `K⁻¹ f`, to a tolerance relative to its size in the norm of the energy.
    pub fn apply(&self, f: &[f64], tolerance: f64, monitor: &dyn Monitor) -> Result<Vec<f64>, RefineError> {
        let mut force = f.to_vec();
        self.kernel.iter().for_each(|kernel| kernel.take_out_of_force(self.whole, &mut force));
        if self.exact {
            return self.by_product(&force, tolerance, monitor);
        }
        let precondition = |r: &[f64]| self.by_product(r, PRECONDITION, monitor);
        conjugate_gradients(|x| self.times(x), precondition, &force, tolerance, monitor)
    }

    fn by_product(&self, f: &[f64], tolerance: f64, monitor: &dyn Monitor) -> Result<Vec<f64>, RefineError> {
        let whole = self.whole;
        let (mut x, scale) = match &self.product {
            ShiftedProduct::Two(small, large) => {
                let mut first = small.solve(whole, f, tolerance, self.kernel, monitor)?;
                whole.weigh(&mut first);
                (large.solve(whole, &first, tolerance, self.kernel, monitor)?, self.sum.biharmonic)
            }
            ShiftedProduct::One(one) => (one.solve(whole, f, tolerance, self.kernel, monitor)?, self.sum.harmonic),
            ShiftedProduct::Mass(weight) => {
                let mut x = f.to_vec();
                whole.unweigh(&mut x);
                (x, *weight)
            }
        };
        x.iter_mut().for_each(|x| *x /= scale);
        Ok(x)
    }

    /// `K x`.
    fn times(&self, x: &[f64]) -> Vec<f64> {
        let (whole, sum) = (self.whole, &self.sum);
        let image = whole.stiff(x);
        let mut total = image.clone();
        total.iter_mut().for_each(|t| *t *= sum.harmonic);
        if sum.biharmonic > 0.0 {
            let mut curved = image;
            whole.unweigh(&mut curved);
            add(&mut total, &whole.stiff(&curved), sum.biharmonic);
        }
        let held = |face: usize| sum.uniform * whole.mass[face] + sum.masses.as_ref().map_or(0.0, |m| m[face]);
        total.iter_mut().zip(x).enumerate().for_each(|(i, (t, x))| *t += held(i / B) * x);
        total
    }
}

/// Conjugate gradients from zero, until the residual is that much smaller in the norm of the preconditioner, which may
/// differ a little from step to step.
pub(super) fn conjugate_gradients(
    apply: impl Fn(&[f64]) -> Vec<f64>,
    precondition: impl Fn(&[f64]) -> Result<Vec<f64>, RefineError>,
    f: &[f64],
    tolerance: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, RefineError> {
    match steps(apply, precondition, f, tolerance, monitor)? {
        (x, true) => Ok(x),
        (_, false) => Err(RefineError::NotConverged { tolerance }),
    }
}

/// The same, with whether the tolerance was reached.
fn steps(
    apply: impl Fn(&[f64]) -> Vec<f64>,
    precondition: impl Fn(&[f64]) -> Result<Vec<f64>, RefineError>,
    f: &[f64],
    tolerance: f64,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, bool), RefineError> {
    let mut x = vec![0.0; f.len()];
    let mut residual = f.to_vec();
    let mut scaled = precondition(&residual)?;
    let mut rz = dot(&residual, &scaled);
    let goal = rz * tolerance * tolerance;
    let mut direction = scaled.clone();
    if rz == 0.0 {
        return Ok((x, true));
    }
    for _ in 0..MOST_STEPS {
        monitor.checkpoint()?;
        if !(rz > 0.0 && rz.is_finite()) {
            break;
        }
        let product = apply(&direction);
        let curvature = dot(&direction, &product);
        if !(curvature > 0.0) {
            break;
        }
        let step = rz / curvature;
        let both = x.par_chunks_mut(PIECE).zip(direction.par_chunks(PIECE));
        both.zip(residual.par_chunks_mut(PIECE).zip(product.par_chunks(PIECE))).for_each(|((x, d), (r, p))| {
            x.iter_mut().zip(d).for_each(|(x, d)| *x += step * d);
            r.iter_mut().zip(p).for_each(|(r, p)| *r -= step * p);
        });
        scaled = precondition(&residual)?;
        let (next, kept) = dots(&residual, &product, &scaled);
        // Rounding has either sign; what is negative beyond it is no residual.
        if next.abs() <= goal {
            return Ok((x, true));
        }
        // What the new residual shares with the last, which is nothing where the preconditioner stays the same, is
        // taken out of the direction.
        let shared = next + step * kept;
        let keep = (next - shared) / rz;
        rz = next;
        direction.par_chunks_mut(PIECE).zip(scaled.par_chunks(PIECE)).for_each(|(d, z)| {
            d.iter_mut().zip(z).for_each(|(d, z)| *d = z + keep * *d);
        });
    }
    Ok((x, false))
}
