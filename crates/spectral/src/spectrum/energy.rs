//! Residuals in the norm that belongs to them: that of the inverse operator.
//!
//! `K = S + cM` is positive semi-definite (`c` is 0 but for negative potentials), `A = K + σM`, `r = S x − θ M x`. With
//! `z = A^½ x` and `B = A^-½ M A^-½`, `A^-½ r = (1 − (θ + c + σ) B) z`, so some exact eigenvalue λ has
//!
//! ```text
//! |λ − θ| ≤ η (λ + c + σ),   η = ‖r‖_{A⁻¹} / ‖x‖_A.
//! ```
//!
//! Nothing is assumed of `x` and θ. The norm is enclosed without a factor of `A`: for every `y`
//!
//! ```text
//! 2 yᵀr − yᵀAy  ≤  ‖r‖²_{A⁻¹}  ≤  2 yᵀr − yᵀAy + (r − Ay)ᵀ B⁻¹ (r − Ay),
//! ```
//!
//! and `y` comes from a multigrid cycle or two. `B` is below `A` and easily inverted: `σM`, and what of `S` makes a
//! forest. What the best multiple of `y` would take off the Ritz value, `(yᵀr)² / yᵀ(S − θM)y`, estimates its error.
//! Rounding is part of the upper end: row by row, what the sums in double precision may err by, and what storing `r` in
//! single precision changes.

mod corrections;
mod direct;
mod forest;
mod measure;
mod obtuse;
mod on_device;
mod part;
mod rows;

use chladni_base::parallel::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

pub(super) use corrections::Corrections;
pub use direct::{FACTOR_BYTES, MOST_FACTORED};
use forest::Forest;
pub use measure::Measure;
pub use obtuse::Cotangents;
use obtuse::Obtuse;
pub(super) use part::{PairShare, measures};
use rows::{Enclosed, Enclosure, PairResidual, Residuals, Trees, rounding_weights_of_symmetric};

use crate::operator::EigenProblem;
use chladni_algebra::gpu::{self, EnclosureSums, ResidualSums};
use chladni_algebra::{
    CYCLE_WIDTH, CycleRow, CycleWorkspace, DenseMatrix, LIFT_WIDTH, MassMatrix, Multigrid, MultigridError, PATCH_ROWS,
    Patch, RowLifter, SparseMatrix, by_patch, compact_order, zeros_by_all,
};
use chladni_base::{Cancelled, Monitor, Spare};

/// σ as a share of the lowest value of a panel that is not zero. Measured on igea, armadillo and rolling-stage with 500
/// pairs: 0.7 takes 40, 85 and 131 cycles (the last two in three rounds) where 0.3 takes 56, 104 and 152, for bounds of
/// the same width, and estimates are closer; with 2 estimates fall below the errors.
const SHIFT: f64 = 0.7;

/// Another cycle is taken where the square of the upper end exceeds that of the lower one by more than `SLACK` times
/// and the bound is above `CLOSE` of the value; cycles at most.
const SLACK: f64 = 3.0;
const CLOSE: f64 = 0.08;
const MOST_STEPS: usize = 4;

/// Halves of a panel that is lifted.
const HALVES: usize = LIFT_WIDTH / CYCLE_WIDTH;

/// Relative rounding error of a product with the mass matrix: a consistent one has a few dozen entries in its longest
/// rows.
const MASS_ROUNDING: f64 = 100.0 * f64::EPSILON;

/// Relative rounding error of storing a number in single precision.
const SINGLE: f64 = 1.0 / 16_777_216.0;

/// What is asked of a measurement.
#[derive(Clone, Copy)]
pub(super) struct KernelAndGoal {
    /// Values up to this count as zero.
    pub(super) kernel: f64,
    /// The largest relative error that is good enough.
    pub(super) goal: Option<f64>,
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
    /// What is below `S`, if it is known.
    forest: Option<Forest>,
    /// `S` with its rows in that order, for devices alone: patches have their own rows of it.
    ordered: OnceLock<SparseMatrix>,
    /// The rows that are measured: all, or those of one part, the first.
    own: usize,
    /// Of a part the stiffness that residuals are made of; patches have that of which `y` comes.
    coupled: Option<SparseMatrix>,
}

impl<'a> Energy<'a> {
    /// Prepares the pencil of `problem`; `floor` is a lower bound on its eigenvalues, on unit area.
    ///
    /// # Errors
    /// [`MultigridError`]: a vertex without mass, or cancellation.
    pub fn new(problem: &'a EigenProblem, floor: f64, monitor: &dyn Monitor) -> Result<Self, MultigridError> {
        Self::on(None, problem, floor, monitor)
    }

    /// The same where the stiffness is that of the cotangents of some triangles: bounds are closer where these are
    /// known.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn on(
        triangles: Option<Cotangents<'_>>,
        problem: &'a EigenProblem,
        floor: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, MultigridError> {
        let order = compact_order(&problem.stiffness, PATCH_ROWS);
        let stiffness = problem.stiffness.reordered(&order);
        let mass = problem.mass.reordered(&order);
        let lumped = mass.lumped();
        let floor = (-floor).max(0.0);
        let hierarchy = Multigrid::new(&stiffness, &mass, floor, monitor)?;
        let rounding = rounding_weights_of_symmetric(&stiffness, &lumped);
        let obtuse = triangles.map(|triangles| Obtuse::of(triangles, problem, &order));
        let forest = Forest::below(&stiffness, &lumped, floor, hierarchy.patches(), obtuse.as_ref());
        let (own, ordered) = (order.len(), OnceLock::new());
        if gpu::accelerator().available() {
            // A device that is open will be asked, and would have it made again.
            let _ = ordered.set(stiffness);
        }
        Ok(Self { problem, order, mass, lumped, rounding, floor, hierarchy, forest, ordered, own, coupled: None })
    }

    /// Measures the pairs with Ritz values `ritz`, ascending, and vectors `space · coefficients`. With a `goal`, also
    /// where pairs miss energy whose estimated relative error exceeds it. Values up to `kernel` count as zero. The rows
    /// of `space` are in another order meanwhile.
    ///
    /// # Errors
    /// [`Cancelled`], when asked to stop.
    ///
    /// # Panics
    /// Where sizes do not fit: `space` is `n × d`, `coefficients` `d × m`, and there are `m` Ritz values.
    pub fn measure(
        &self,
        space: &mut SparseMatrix<f32>,
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
        // In the order of the patches: rows all over the memory take three times as long to lift. There is one space at
        // a time: of millions of rows it is as large as the pencil.
        *space = self.in_order(space);
        let found = self.measure_in_order(space, coefficients, ritz, KernelAndGoal { kernel, goal }, monitor);
        let mut places = vec![0u32; n];
        self.order.iter().zip(0..).for_each(|(&row, place)| places[row as usize] = place);
        *space = space.select_rows(&places);
        found
    }

    /// The same with the rows of `space` in the order of the patches.
    fn measure_in_order(
        &self,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        ritz: &[f64],
        limits: KernelAndGoal,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<Measure>, Density), Cancelled> {
        let n = self.order.len();
        let lifter = RowLifter::new(space, coefficients);
        if let Some((mut measures, density)) =
            self.measure_on_device(&gpu::accelerator(), space, coefficients, ritz, limits, monitor)?
        {
            self.narrow(&lifter, ritz, &mut measures, limits, monitor)?;
            return Ok((measures, density));
        }
        let panels = ritz.len().div_ceil(LIFT_WIDTH);
        let done = AtomicUsize::new(0);
        // Where panels come one after the other, one density is enough.
        let shared: Mutex<Density> = Mutex::new(None);
        let parts: Vec<(Vec<Measure>, Density)> = over_panels(self, panels, |panel, workspace| {
            monitor.checkpoint()?;
            let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
            let residuals = self.residuals(&lifter, panel, theta, workspace);
            let mut measures = Vec::with_capacity(LIFT_WIDTH);
            let mut density = None;
            if workspace.shared {
                density = shared.lock().unwrap_or_else(PoisonError::into_inner).take();
            }
            for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
                monitor.checkpoint()?;
                measures.extend(self.half(workspace, half, theta, &residuals[half], limits, &mut density));
            }
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            monitor.progress(done as f64 / panels as f64);
            if workspace.shared {
                *shared.lock().unwrap_or_else(PoisonError::into_inner) = density.take();
            }
            Ok((measures, density))
        })?;
        let mut measures = Vec::with_capacity(ritz.len());
        let mut density: Density = None;
        let shared = (Vec::new(), shared.into_inner().unwrap_or_else(PoisonError::into_inner));
        for (part, own) in parts.into_iter().chain([shared]) {
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
        let sigma = self.sigma(ritz, limits);
        let (enclosed, mut kept) = self.enclosed(workspace, half, ritz, residuals, sigma);
        let measure_of = |k: usize| self.measure_of(&residuals.pairs[k], &enclosed.of(k), ritz[k], sigma);
        let measures: Vec<Measure> = (0..ritz.len()).map(measure_of).collect();
        let mut weights = [0.0; CYCLE_WIDTH];
        for ((weight, measure), theta) in weights.iter_mut().zip(&measures).zip(ritz) {
            *weight = self.weight(measure, *theta, limits);
        }
        if weights.iter().any(|&w| w > 0.0) {
            // Those of higher pairs will be wanted too.
            workspace.keep = workspace.keep.max(CycleOutput::Answer);
            self.keep(workspace, half, sigma, &mut kept, CycleOutput::Answer);
            let density = density.get_or_insert_with(|| vec![0.0; self.order.len()]);
            let rows = density.par_iter_mut().zip(&workspace.y).zip(&workspace.right[half]);
            rows.with_min_len(PATCH_ROWS).for_each(|((sum, y), r)| {
                let share: f64 = (0..CYCLE_WIDTH).map(|k| weights[k] * f64::from(y[k]) * f64::from(r[k])).sum();
                *sum += share;
            });
        }
        measures
    }

    /// Cycles for sixteen residuals, until what they say is close enough, and what they left behind.
    fn enclosed(
        &self,
        workspace: &mut Workspace,
        half: usize,
        ritz: &[f64],
        residuals: &Residuals,
        sigma: f64,
    ) -> (Enclosure, CycleOutput) {
        let mut kept = workspace.keep;
        let mut enclosed = self.step(workspace, half, sigma, Step { first: true, keep: kept, by_trees: true });
        let mut steps = 1;
        let close = |enclosed: &Enclosure| {
            (0..ritz.len()).all(|k| self.is_close(&residuals.pairs[k], &enclosed.of(k), ritz[k], sigma))
        };
        while steps < MOST_STEPS && !close(&enclosed) {
            self.keep(workspace, half, sigma, &mut kept, CycleOutput::Both);
            enclosed =
                self.step(workspace, half, sigma, Step { first: false, keep: CycleOutput::Both, by_trees: true });
            steps += 1;
        }
        // The next panel has much the same needs.
        workspace.keep = if steps > 1 { CycleOutput::Both } else { CycleOutput::Nothing };
        (enclosed, kept)
    }

    /// Takes the first cycle again where less was kept than is asked for.
    fn keep(&self, workspace: &mut Workspace, half: usize, sigma: f64, kept: &mut CycleOutput, least: CycleOutput) {
        if *kept < least {
            self.step(workspace, half, sigma, Step { first: true, keep: least, by_trees: true });
            *kept = least;
        }
    }

    /// σ for some pairs.
    fn sigma(&self, ritz: &[f64], limits: KernelAndGoal) -> f64 {
        sigma(ritz, self.floor, limits)
    }

    /// Whether a pair needs no other cycle.
    fn is_close(&self, residual: &PairResidual, enclosed: &EnclosureSums, ritz: f64, sigma: f64) -> bool {
        enclosed.excess <= SLACK * sigma * enclosed.below
            || self.measure_of(residual, enclosed, ritz, sigma).bound <= CLOSE * (ritz + self.floor)
    }

    /// The weight of a pair in the density: nothing where it misses little.
    fn weight(&self, measure: &Measure, ritz: f64, limits: KernelAndGoal) -> f64 {
        let value = ritz + self.floor;
        let misses = limits.goal.is_some_and(|goal| value > limits.kernel && measure.estimate > goal * value);
        if misses { 1.0 / value } else { 0.0 }
    }

    /// What the enclosure says of a pair.
    fn measure_of(&self, residual: &PairResidual, enclosed: &EnclosureSums, ritz: f64, sigma: f64) -> Measure {
        measure_of(residual, enclosed, ritz, sigma, (self.floor, self.mass.lumped_ratio()))
    }

    /// `r = S x − θ M x` of the panel into `right`, in single precision, with the sums that it enters. `x` is lifted
    /// patch by patch and never stored.
    fn residuals(
        &self,
        lifter: &RowLifter<'_>,
        panel: usize,
        ritz: &[f64],
        workspace: &mut Workspace,
    ) -> [Residuals; HALVES] {
        let mut theta = [0.0; LIFT_WIDTH];
        theta[..ritz.len()].copy_from_slice(ritz);
        let patches = self.hierarchy.patches();
        let Workspace { lifted, right: [first, second], shared, .. } = workspace;
        let rights: Vec<_> = by_patch(patches, first).into_iter().zip(by_patch(patches, second)).collect();
        let one = |(patch, (first, second)): (&Patch, (&mut [CycleRow], &mut [CycleRow]))| {
            lifted.with(Vec::new, |x| {
                let vertices = patch.vertices(1);
                x.resize(vertices.len(), [0.0; LIFT_WIDTH]);
                lifter.lift(vertices, panel, x);
                let mut totals: Totals = Default::default();
                for (half, right) in [first, second].into_iter().enumerate().take(ritz.len().div_ceil(CYCLE_WIDTH)) {
                    let theta: [f64; CYCLE_WIDTH] = std::array::from_fn(|k| theta[half * CYCLE_WIDTH + k]);
                    self.patch_residuals(patch, x, half, &theta, &mut totals[half], right);
                }
                totals
            })
        };
        let parts: Vec<Totals> = match shared {
            true => patches.par_iter().zip(rights).map(one).collect(),
            false => patches.iter().zip(rights).map(one).collect(),
        };
        let totals = parts.iter().fold(Totals::default(), |mut totals, part| {
            totals.iter_mut().zip(part).for_each(|(totals, part)| rows::add_totals(totals, part));
            totals
        });
        std::array::from_fn(|half| Residuals {
            pairs: std::array::from_fn(|k| {
                let [residual, dual, stiffness, square, mass, energy, rounding, lowest, highest] =
                    totals[half].map(|sums| sums[k]);
                let sums = ResidualSums { residual, dual, stiffness, square, mass, energy, rounding, lowest, highest };
                PairResidual::new(&sums, theta[half * CYCLE_WIDTH + k])
            }),
        })
    }

    /// A cycle from zero, or one that improves the `y` that was kept, and the terms of the enclosure for the `y` found.
    /// Keeps `y`, or that and `r − Ay`, if asked to.
    fn step(&self, workspace: &mut Workspace, half: usize, sigma: f64, step: Step) -> Enclosure {
        let Workspace { right, y, rest, next_y, next_rest, cycle, trees, .. } = workspace;
        let (trees, forest) = (&*trees, self.forest.as_ref().filter(|_| step.by_trees));
        let right = &right[half];
        // A first cycle looks at nothing that was kept before, and puts what it finds in its place.
        let (to_y, to_rest) = if step.first { (&mut *y, &mut *rest) } else { (&mut *next_y, &mut *next_rest) };
        let (mut new_y, mut new_rest) = (std::mem::take(to_y), std::mem::take(to_rest));
        let (before, source): (&[CycleRow], &[CycleRow]) = if step.first { (&[], right) } else { (y, rest) };
        let patches = self.hierarchy.patches();
        let kept_y = places(patches, &mut new_y, right.len(), step.keep >= CycleOutput::Answer);
        let kept_rest = places(patches, &mut new_rest, right.len(), step.keep >= CycleOutput::Both);
        let kept = kept_y.into_iter().zip(kept_rest).collect();
        let parts = self.hierarchy.cycle(sigma as f32, source, cycle, kept, |patch, improved, (kept, rest)| {
            if !step.first {
                for (correction, &vertex) in improved.iter_mut().zip(patch.vertices(1)) {
                    correction.iter_mut().zip(&before[vertex as usize]).for_each(|(correction, y)| *correction += y);
                }
            }
            kept.copy_from_slice(&improved[..kept.len()]);
            let mut found = Enclosure::default();
            trees.with(Trees::default, |trees| {
                let of = Enclosed { patch, right: &right[patch.rows()], sigma, forest };
                self.enclose(of, improved, &mut found, rest, trees);
            });
            found
        });
        if !step.first {
            (*next_y, *next_rest) = (std::mem::take(y), std::mem::take(rest));
        }
        (*y, *rest) = (new_y, new_rest);
        parts.iter().fold(Enclosure::default(), |mut found, part| {
            found.add(part);
            found
        })
    }
}

/// σ for some pairs of an operator whose eigenvalues are no less than `−floor`.
fn sigma(ritz: &[f64], floor: f64, limits: KernelAndGoal) -> f64 {
    let positive = ritz.iter().map(|theta| theta + floor).find(|&theta| theta > limits.kernel);
    SHIFT * positive.unwrap_or(1.0)
}

/// What the enclosure says of a pair, where the lumped mass is at most so many times the mass.
fn measure_of(
    residual: &PairResidual,
    enclosed: &EnclosureSums,
    ritz: f64,
    sigma: f64,
    (floor, lumped_ratio): (f64, f64),
) -> Measure {
    let PairResidual { sums, rounding } = *residual;
    let below = enclosed.below.max(0.0);
    let factor = lumped_ratio.sqrt();
    let mass_of_y = enclosed.mass.max(0.0).sqrt();
    let of_y = enclosed.rounding.sqrt() + MASS_ROUNDING * (sigma + floor) * mass_of_y;
    let excess = factor * ((1.0 + MASS_ROUNDING) * enclosed.excess.sqrt() + of_y) / sigma.sqrt();
    // Sums in double precision, and what the rounding errors of `Ay` do to `yᵀAy`.
    let summed = 1e-12 * enclosed.size + factor * mass_of_y * of_y;
    // By the triangle inequality: what was measured is `r` as it is stored.
    let stored = factor * rounding / sigma.sqrt();
    let above = (below + summed + excess * excess).sqrt() + stored;
    let above_dual = factor * (sums.dual.sqrt() + rounding);
    let mut measure = Measure { sums, sigma, below: below.sqrt(), above, above_dual, ..Measure::default() };
    measure.bound = measure.distance(ritz, floor);
    measure.estimate = measure.error(ritz + floor, mass_of_y * mass_of_y).min(measure.bound);
    measure
}

/// How a cycle is taken.
#[derive(Clone, Copy)]
struct Step {
    first: bool,
    keep: CycleOutput,
    /// Whether what is left is measured by the forest, and not by the mass alone.
    by_trees: bool,
}

/// What a cycle leaves behind.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum CycleOutput {
    /// Sums alone.
    Nothing,
    /// `y`.
    Answer,
    /// `y` and `r − Ay`, which another cycle begins with.
    Both,
}

/// Where each patch puts its rows of what is kept, with memory for so many; empty where nothing is.
fn places<'a>(patches: &[Patch], rows: &'a mut Vec<CycleRow>, count: usize, wanted: bool) -> Vec<&'a mut [CycleRow]> {
    if !wanted {
        return patches.iter().map(|_| &mut [][..]).collect();
    }
    if rows.len() != count {
        *rows = zeros_by_all(count);
    }
    by_patch(patches, rows)
}

/// Nine sums of sixteen pairs, for each half of a panel.
type Totals = [[[f64; CYCLE_WIDTH]; 9]; HALVES];

/// From so many unknowns on, all threads work on a panel together: a panel for each thread takes 660 bytes a row and
/// thread, and threads idle where there are fewer panels. A factor, which is for fewer unknowns, has its panels of
/// solutions on each thread.
pub const SHARED_FROM: usize = MOST_FACTORED + 1;

/// What is needed for a panel.
struct Workspace {
    /// Whether all threads work on it together.
    shared: bool,
    /// The panel on a patch and its first ring, one for each thread.
    lifted: Spare<Vec<[f64; LIFT_WIDTH]>>,
    right: [Vec<CycleRow>; HALVES],
    /// What the first cycle keeps.
    keep: CycleOutput,
    y: Vec<CycleRow>,
    rest: Vec<CycleRow>,
    next_y: Vec<CycleRow>,
    next_rest: Vec<CycleRow>,
    cycle: CycleWorkspace,
    trees: Spare<Trees>,
}

impl Workspace {
    fn new(n: usize, hierarchy: &Multigrid) -> Self {
        let shared = n >= SHARED_FROM;
        Self {
            shared,
            lifted: Spare::default(),
            right: std::array::from_fn(|_| if shared { zeros_by_all(n) } else { vec![[0.0; CYCLE_WIDTH]; n] }),
            keep: CycleOutput::Nothing,
            y: Vec::new(),
            rest: Vec::new(),
            next_y: Vec::new(),
            next_rest: Vec::new(),
            trees: Spare::default(),
            cycle: if shared { hierarchy.shared_workspace() } else { hierarchy.workspace() },
        }
    }
}

/// Calls `work` for each panel of so many, with memory for it: one after the other where threads share each, at once
/// where each has its own.
fn over_panels<T: Send>(
    energy: &Energy<'_>,
    panels: usize,
    work: impl Fn(usize, &mut Workspace) -> Result<T, Cancelled> + Sync,
) -> Result<Vec<T>, Cancelled> {
    let spare = Spare::default();
    let make = || Workspace::new(energy.size(), &energy.hierarchy);
    let one = |panel: usize| spare.with(make, |workspace| work(panel, workspace));
    if energy.size() >= SHARED_FROM {
        (0..panels).map(one).collect()
    } else {
        (0..panels).into_par_iter().map(one).collect()
    }
}
