//! Residuals in the norm that belongs to them: that of the inverse operator.
//!
//! `K = S + cM` is positive semi-definite (`c` is 0 but for negative potentials), `A = K + σM`, `r = S x − θ M x`. With `z = A^½ x` and
//! `B = A^-½ M A^-½`, `A^-½ r = (1 − (θ + c + σ) B) z`, so some exact eigenvalue λ has
//!
//! ```text
//! |λ − θ| ≤ η (λ + c + σ),   η = ‖r‖_{A⁻¹} / ‖x‖_A.
//! ```
//!
//! Nothing is assumed of `x` and θ. The norm is enclosed without a factor of `A`: for every `y`
//!
//! ```text
//! 2 yᵀr − yᵀAy  ≤  ‖r‖²_{A⁻¹}  ≤  2 yᵀr − yᵀAy + (r − Ay)ᵀ (σM)⁻¹ (r − Ay),
//! ```
//!
//! and `y` comes from a multigrid cycle or two. What the best multiple of `y` would take off the Ritz value,
//! `(yᵀr)² / yᵀ(S − θM)y`, estimates its error. Rounding is part of the upper end: row by row, what the sums in double precision may err by, and
//! what storing `r` in single precision changes.

mod corrections;
mod direct;
mod measure;
mod rows;

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

pub(super) use corrections::Corrections;
pub use direct::{FACTOR_BYTES, MOST_FACTORED};
pub use measure::Measure;
use rows::{Enclosure, Residuals, rounding_weights};

use crate::operator::EigenProblem;
use chladni_algebra::{
    CYCLE_WIDTH, CycleRow, CycleWorkspace, DenseMatrix, LIFT_WIDTH, MassMatrix, Multigrid, MultigridError, PATCH_ROWS,
    RowLifter, SparseMatrix, compact_order,
};
use chladni_base::{Cancelled, Monitor};

/// σ as a share of the lowest value of a panel that is not zero. Measured on igea, armadillo and rolling-stage with 500 pairs: 0.7 takes 40, 85 and
/// 131 cycles (the last two in three rounds) where 0.3 takes 56, 104 and 152, for bounds of the same width, and estimates are closer; with 2
/// estimates fall below the errors.
const SHIFT: f64 = 0.7;

/// Another cycle is taken where the square of the upper end exceeds that of the lower one by more than `SLACK` times and the bound is above `CLOSE`
/// of the value; cycles at most.
const SLACK: f64 = 3.0;
const CLOSE: f64 = 0.08;
const MOST_STEPS: usize = 4;

/// Halves of a panel that is lifted.
const HALVES: usize = LIFT_WIDTH / CYCLE_WIDTH;

/// Relative rounding error of a product with the mass matrix: a consistent one has a few dozen entries in its longest rows.
const MASS_ROUNDING: f64 = 100.0 * f64::EPSILON;

/// Relative rounding error of storing a number in single precision.
const SINGLE: f64 = 1.0 / 16_777_216.0;

/// What is asked of a measurement.
#[derive(Clone, Copy)]
struct KernelAndGoal {
    /// Values up to this count as zero.
    kernel: f64,
    /// The largest relative error that is good enough.
    goal: Option<f64>,
}

/// Where the energy that the pairs miss sits: one number a row, or nothing where no pair misses enough.
pub type Density = Option<Vec<f64>>;

/// A pencil prepared for measuring: rows in a compact order, and the hierarchy.
pub struct Energy<'a> {
    problem: &'a EigenProblem,
    order: Vec<u32>,
    mass: MassMatrix,
    lumped: Vec<f64>,
    /// `Σ_j weights[j] x_j²` bounds the square of what rounding changes in `S x`, in the inverse lumped mass.
    rounding: Vec<f64>,
    /// `c`.
    floor: f64,
    hierarchy: Multigrid,
}

impl<'a> Energy<'a> {
    /// Prepares the pencil of `problem`; `floor` is a lower bound on its eigenvalues, on unit area.
    ///
    /// # Errors
    /// [`MultigridError`]: a vertex without mass, or cancellation.
    pub fn new(problem: &'a EigenProblem, floor: f64, monitor: &dyn Monitor) -> Result<Self, MultigridError> {
        let order = compact_order(&problem.stiffness, PATCH_ROWS);
        let stiffness = problem.stiffness.reordered(&order);
        let mass = problem.mass.reordered(&order);
        let lumped = mass.lumped();
        let floor = (-floor).max(0.0);
        let hierarchy = Multigrid::new(&stiffness, &mass, floor, monitor)?;
        let rounding = rounding_weights(&stiffness, &lumped);
        Ok(Self { problem, order, mass, lumped, rounding, floor, hierarchy })
    }

    /// Measures the pairs with Ritz values `ritz`, ascending, and vectors `space · coefficients`. With a `goal`, also where pairs miss energy whose
    /// estimated relative error exceeds it. Values up to `kernel` count as zero.
    ///
    /// # Errors
    /// [`Cancelled`], when asked to stop.
    ///
    /// # Panics
    /// Where sizes do not fit: `space` is `n × d`, `coefficients` `d × m`, and there are `m` Ritz values.
    pub fn measure(
        &self,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        ritz: &[f64],
        kernel: f64,
        goal: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<Measure>, Density), Cancelled> {
        let n = self.order.len();
        assert_eq!(
            (space.rows(), coefficients.columns()),
            (n, ritz.len()),
            "a row for each unknown, a column for each value"
        );
        // In the order of the patches: rows all over the memory take three times as long to lift.
        let space = self.in_order(space);
        let lifter = RowLifter::new(&space, coefficients);
        let limits = KernelAndGoal { kernel, goal };
        let panels = ritz.len().div_ceil(LIFT_WIDTH);
        let done = AtomicUsize::new(0);
        // A thread takes a workspace that another panel left: fresh memory costs as much as a cycle.
        let idle: Mutex<Vec<Workspace>> = Mutex::new(Vec::new());
        let parts: Vec<(Vec<Measure>, Density)> = (0..panels)
            .into_par_iter()
            .map(|panel| {
                monitor.checkpoint()?;
                let left = idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
                let mut own = left.unwrap_or_else(|| Workspace::new(n, &self.hierarchy));
                let workspace = &mut own;
                let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
                let residuals = self.residuals(&lifter, panel, theta, workspace);
                let mut measures = Vec::with_capacity(LIFT_WIDTH);
                let mut density = None;
                for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
                    monitor.checkpoint()?;
                    measures.extend(self.half(workspace, half, theta, &residuals[half], limits, &mut density));
                }
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                monitor.progress(done as f64 / panels as f64);
                idle.lock().unwrap_or_else(PoisonError::into_inner).push(own);
                Ok((measures, density))
            })
            .collect::<Result<_, Cancelled>>()?;
        let mut measures = Vec::with_capacity(ritz.len());
        let mut density: Density = None;
        for (part, own) in parts {
            measures.extend(part);
            if let Some(own) = own {
                let sum = density.get_or_insert_with(|| vec![0.0; n]);
                self.order.iter().zip(own).for_each(|(&row, value)| sum[row as usize] += value);
            }
        }
        self.narrow(&lifter, ritz, &mut measures, limits, monitor)?;
        Ok((measures, density))
    }

    /// The rows of a space in the order of the patches.
    pub(super) fn in_order(&self, space: &SparseMatrix<f32>) -> SparseMatrix<f32> {
        space.select_rows(&self.order)
    }

    /// `c`: `S + cM` is positive semi-definite.
    pub(super) fn floor(&self) -> f64 {
        self.floor
    }

    /// The number of unknowns.
    pub fn size(&self) -> usize {
        self.order.len()
    }

    /// Sixteen columns of a panel, whose residuals are known.
    fn half(
        &self,
        workspace: &mut Workspace,
        half: usize,
        ritz: &[f64],
        residuals: &Residuals,
        limits: KernelAndGoal,
        density: &mut Density,
    ) -> Vec<Measure> {
        let KernelAndGoal { kernel, goal } = limits;
        let positive = ritz.iter().map(|theta| theta + self.floor).find(|&theta| theta > kernel);
        let sigma = SHIFT * positive.unwrap_or(1.0);
        let mut enclosed = self.step(workspace, half, sigma, Step { first: true, keep: workspace.keep });
        let mut kept = workspace.keep;
        let keep = |workspace: &mut Workspace, kept: &mut bool| {
            if !*kept {
                self.step(workspace, half, sigma, Step { first: true, keep: true });
            }
            *kept = true;
        };
        let mut steps = 1;
        let close = |enclosed: &Enclosure| {
            (0..ritz.len()).all(|k| {
                enclosed.excess[k] <= SLACK * sigma * enclosed.below[k]
                    || self.conclude(residuals, enclosed, k, ritz[k], sigma).bound <= CLOSE * (ritz[k] + self.floor)
            })
        };
        while steps < MOST_STEPS && !close(&enclosed) {
            keep(workspace, &mut kept);
            enclosed = self.step(workspace, half, sigma, Step { first: false, keep: true });
            steps += 1;
        }
        // The next panel has much the same needs.
        workspace.keep = steps > 1;
        let conclude = |k: usize| self.conclude(residuals, &enclosed, k, ritz[k], sigma);
        let measures: Vec<Measure> = (0..ritz.len()).map(conclude).collect();
        let Some(goal) = goal else { return measures };
        let mut weights = [0.0; CYCLE_WIDTH];
        for ((weight, measure), theta) in weights.iter_mut().zip(&measures).zip(ritz) {
            let value = theta + self.floor;
            if value > kernel && measure.estimate > goal * value {
                *weight = 1.0 / value;
            }
        }
        if weights.iter().any(|&w| w > 0.0) {
            keep(workspace, &mut kept);
            let density = density.get_or_insert_with(|| vec![0.0; self.order.len()]);
            for ((sum, y), r) in density.iter_mut().zip(&workspace.y).zip(&workspace.right[half]) {
                let share: f64 = (0..CYCLE_WIDTH).map(|k| weights[k] * f64::from(y[k]) * f64::from(r[k])).sum();
                *sum += share;
            }
        }
        measures
    }

    /// What the enclosure says of pair `k` of a half.
    fn conclude(&self, residuals: &Residuals, enclosed: &Enclosure, k: usize, ritz: f64, sigma: f64) -> Measure {
        let Residuals { sums, rounding, .. } = residuals;
        let below = enclosed.below[k].max(0.0);
        let factor = self.mass.lumped_ratio().sqrt();
        let mass_of_y = enclosed.mass[k].max(0.0).sqrt();
        let of_y = enclosed.rounding[k].sqrt() + MASS_ROUNDING * (sigma + self.floor) * mass_of_y;
        let excess = factor * ((1.0 + MASS_ROUNDING) * enclosed.excess[k].sqrt() + of_y) / sigma.sqrt();
        // Sums in double precision, and what the rounding errors of `Ay` do to `yᵀAy`.
        let summed = 1e-12 * enclosed.size[k] + factor * mass_of_y * of_y;
        // By the triangle inequality: what was measured is `r` as it is stored.
        let stored = factor * rounding[k] / sigma.sqrt();
        let above = (below + summed + excess * excess).sqrt() + stored;
        let above_dual = factor * (sums[k].dual.sqrt() + rounding[k]);
        let mut measure = Measure { sigma, below: below.sqrt(), above, above_dual, ..sums[k] };
        measure.bound = measure.distance(ritz, self.floor);
        measure.estimate = measure.error(ritz + self.floor, mass_of_y * mass_of_y).min(measure.bound);
        measure
    }

    /// `r = S x − θ M x` of the panel into `right`, in single precision, with the sums that it enters. `x` is lifted patch by patch and never
    /// stored.
    fn residuals(
        &self,
        lifter: &RowLifter<'_>,
        panel: usize,
        ritz: &[f64],
        workspace: &mut Workspace,
    ) -> [Residuals; HALVES] {
        let mut theta = [0.0; LIFT_WIDTH];
        theta[..ritz.len()].copy_from_slice(ritz);
        let Workspace { x, right, .. } = workspace;
        let mut totals = [[[0.0; CYCLE_WIDTH]; 7]; HALVES];
        let mut found: [Residuals; HALVES] = Default::default();
        for patch in self.hierarchy.patches() {
            let vertices = patch.vertices(1);
            x.resize(vertices.len(), [0.0; LIFT_WIDTH]);
            lifter.lift(vertices, panel, x);
            for half in 0..ritz.len().div_ceil(CYCLE_WIDTH) {
                let theta: [f64; CYCLE_WIDTH] = std::array::from_fn(|k| theta[half * CYCLE_WIDTH + k]);
                let (totals, right) = (&mut totals[half], &mut right[half][patch.rows()]);
                self.patch_residuals(patch, x, half, &theta, totals, &mut found[half], right);
            }
        }
        for (half, (found, totals)) in found.iter_mut().zip(&totals).enumerate() {
            for k in 0..CYCLE_WIDTH {
                found.sums[k] = Measure {
                    residual: totals[0][k],
                    dual: totals[1][k],
                    stiffness: totals[2][k],
                    square: totals[3][k],
                    mass: totals[4][k],
                    energy: totals[5][k],
                    lowest: found.lowest[k],
                    highest: found.highest[k],
                    ..Measure::default()
                };
                found.rounding[k] = totals[6][k].sqrt()
                    + MASS_ROUNDING * theta[half * CYCLE_WIDTH + k].abs() * totals[4][k].sqrt()
                    + SINGLE * totals[1][k].sqrt();
            }
        }
        found
    }

    /// A cycle from zero, or one that improves the `y` that was kept, and the terms of the enclosure for the `y` found. Keeps `y` and `r − Ay`
    /// if asked to.
    fn step(&self, workspace: &mut Workspace, half: usize, sigma: f64, step: Step) -> Enclosure {
        let Workspace { right, y, rest, next_y, next_rest, total, cycle, .. } = workspace;
        let right = &right[half];
        let mut found = Enclosure::default();
        if step.keep {
            next_y.resize(right.len(), [0.0; CYCLE_WIDTH]);
            next_rest.resize(right.len(), [0.0; CYCLE_WIDTH]);
        }
        let source: &[CycleRow] = if step.first { right } else { rest };
        self.hierarchy.cycle(sigma as f32, source, cycle, |patch, correction| {
            let rows = patch.rows();
            let improved = if step.first {
                correction
            } else {
                total.clear();
                total.extend(correction.iter().zip(patch.vertices(1)).map(|(correction, &vertex)| {
                    let y = &y[vertex as usize];
                    std::array::from_fn(|k| y[k] + correction[k])
                }));
                &*total
            };
            let kept = if step.keep {
                next_y[rows.clone()].copy_from_slice(&improved[..rows.len()]);
                &mut next_rest[rows]
            } else {
                &mut []
            };
            self.enclose(patch, improved, &right[patch.rows()], sigma, &mut found, kept);
        });
        if step.keep {
            std::mem::swap(y, next_y);
            std::mem::swap(rest, next_rest);
        }
        found
    }
}

/// How a cycle is taken.
#[derive(Clone, Copy)]
struct Step {
    first: bool,
    keep: bool,
}

/// What one thread needs for a panel.
struct Workspace {
    /// The panel on a patch and its first ring.
    x: Vec<[f64; LIFT_WIDTH]>,
    right: [Vec<CycleRow>; HALVES],
    /// Whether the first cycle keeps what a second one begins with.
    keep: bool,
    y: Vec<CycleRow>,
    rest: Vec<CycleRow>,
    next_y: Vec<CycleRow>,
    next_rest: Vec<CycleRow>,
    /// `y` on a patch and its first ring.
    total: Vec<CycleRow>,
    cycle: CycleWorkspace,
}

impl Workspace {
    fn new(n: usize, hierarchy: &Multigrid) -> Self {
        Self {
            x: Vec::new(),
            right: std::array::from_fn(|_| vec![[0.0; CYCLE_WIDTH]; n]),
            keep: false,
            y: Vec::new(),
            rest: Vec::new(),
            next_y: Vec::new(),
            next_rest: Vec::new(),
            total: Vec::new(),
            cycle: hierarchy.workspace(),
        }
    }
}
