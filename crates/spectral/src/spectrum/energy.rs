//! Residuals in the norm that belongs to them: that of the inverse operator.
//!
//! `K = S + cM` is positive semi-definite (`c` is 0 but for negative potentials), `A = K + σM`, `r = S x − θ M x`. With `z = A^½ x` and `B = A^-½ M A^-½`,
//! `A^-½ r = (1 − (θ + c + σ) B) z`, so some exact eigenvalue λ has
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
//! and `y` comes from a multigrid cycle or two. The lower end, which the square of the distance to the eigenspace enters,
//! estimates the error of a Ritz value. Rounding is part of the upper end: row by row, what the sums in double precision may err by, and
//! what storing `r` in single precision changes.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::operator::EigenProblem;
use chladni_algebra::{
    CYCLE_WIDTH, CycleRow, CycleWorkspace, LIFT_WIDTH, MassMatrix, Multigrid, MultigridError, RowLifter, SparseMatrix,
    compact_order, vectorized,
};
use chladni_base::{Cancelled, Monitor};

/// σ as a share of the lowest value of a panel that is not zero. A smaller one makes the bound closer by up to a tenth and `y` harder to find.
const SHIFT: f64 = 0.3;

/// The square of the upper end may exceed that of the lower one by so many times before another cycle is taken; cycles at most. Measured on
/// armadillo: 0.35 takes 1.7 times as long as 4 and brings bounds of 4.1 % of the value down to 2.7 %.
const SLACK: f64 = 3.0;
const MOST_STEPS: usize = 4;

/// Rows of a compact block: neighbours in the mesh lie close to each other in memory.
const ROWS_PER_BLOCK: usize = 512;

/// `A⁻¹` takes the place of `(S − λM)⁻¹` in the estimate; on what the space does not hold the two differ by at most about this.
const MOST_AMPLIFIED: f64 = 2.0;

/// Relative rounding error of a product with the mass matrix: a consistent one has a few dozen entries in its longest rows.
const MASS_ROUNDING: f64 = 100.0 * f64::EPSILON;

/// Relative rounding error of storing a number in single precision.
const SINGLE: f64 = 1.0 / 16_777_216.0;

/// What is known of one pair on the mesh, on unit area.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Measure {
    /// `‖S x − θ M x‖²`.
    pub residual: f64,
    /// The same in the inverse lumped mass.
    pub dual: f64,
    /// `‖S x‖²`
    pub stiffness: f64,
    /// `‖x‖²`
    pub square: f64,
    /// `xᵀ M x`
    pub mass: f64,
    /// `xᵀ S x`
    pub energy: f64,
    /// The least entry of `x`.
    pub lowest: f64,
    /// The greatest entry of `x`.
    pub highest: f64,
    /// σ.
    pub sigma: f64,
    /// `‖r‖_{A⁻¹}` from below.
    pub below: f64,
    /// `‖r‖_{A⁻¹}` from above.
    pub above: f64,
    /// `‖r‖_{M⁻¹}` from above.
    pub above_dual: f64,
    /// Some exact eigenvalue is nearer to the Ritz value than this.
    pub bound: f64,
    /// About how far the Ritz value lies above the exact one.
    pub estimate: f64,
}

/// What is asked of a measurement.
#[derive(Clone, Copy)]
struct Wanted {
    /// Values up to this count as zero.
    kernel: f64,
    /// About the first value that the space does not hold.
    cutoff: f64,
    /// The largest relative error that is good enough.
    goal: Option<f64>,
}

/// Where the energy that the pairs miss sits: one number a row, or nothing where no pair misses enough.
pub type Density = Option<Vec<f64>>;

/// A pencil prepared for measuring: rows in a compact order, and the hierarchy.
pub struct Energy {
    order: Vec<u32>,
    stiffness: SparseMatrix,
    mass: MassMatrix,
    lumped: Vec<f64>,
    /// `Σ_j weights[j] x_j²` bounds the square of what rounding changes in `S x`, in the inverse lumped mass.
    rounding: Vec<f64>,
    /// `c`.
    floor: f64,
    hierarchy: Multigrid,
}

impl Energy {
    /// Prepares the pencil of `problem`; `floor` is a lower bound on its eigenvalues, on unit area.
    ///
    /// # Errors
    /// [`MultigridError`]: a vertex without mass, or cancellation.
    pub fn new(problem: &EigenProblem, floor: f64, monitor: &dyn Monitor) -> Result<Self, MultigridError> {
        let order = compact_order(&problem.stiffness, ROWS_PER_BLOCK);
        let stiffness = problem.stiffness.reordered(&order);
        let mass = match &problem.mass {
            MassMatrix::Diagonal(mass) => MassMatrix::Diagonal(order.iter().map(|&row| mass[row as usize]).collect()),
            MassMatrix::Sparse(mass) => MassMatrix::Sparse(mass.reordered(&order)),
        };
        let lumped = mass.lumped();
        let floor = (-floor).max(0.0);
        let hierarchy = if floor > 0.0 {
            Multigrid::new(&plus_mass(&stiffness, &lumped, floor), &lumped, monitor)?
        } else {
            Multigrid::new(&stiffness, &lumped, monitor)?
        };
        let rounding = rounding_weights(&stiffness, &lumped);
        Ok(Self { order, stiffness, mass, lumped, rounding, floor, hierarchy })
    }

    /// Measures the pairs with Ritz values `ritz`, ascending, whose vectors `lifter` lifts from a space of dimension `dimension`. With a
    /// `goal`, also where pairs miss energy whose estimated relative error exceeds it. Values up to `kernel` count as zero.
    ///
    /// # Errors
    /// [`Cancelled`], when asked to stop.
    pub fn measure(
        &self,
        lifter: &RowLifter<'_>,
        ritz: &[f64],
        dimension: usize,
        kernel: f64,
        goal: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<Measure>, Density), Cancelled> {
        let n = self.order.len();
        // By Weyl's law.
        let highest = ritz.last().map_or(0.0, |theta| theta + self.floor);
        let cutoff = highest * (dimension as f64 / ritz.len().max(1) as f64);
        let wanted = Wanted { kernel, cutoff, goal };
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
                lifter.lift(&self.order, panel, &mut workspace.x);
                let mut measures = Vec::with_capacity(LIFT_WIDTH);
                let mut density = None;
                for half in 0..LIFT_WIDTH / CYCLE_WIDTH {
                    let from = panel * LIFT_WIDTH + half * CYCLE_WIDTH;
                    if from < ritz.len() {
                        monitor.checkpoint()?;
                        let theta = &ritz[from..ritz.len().min(from + CYCLE_WIDTH)];
                        measures.extend(self.half(workspace, half, theta, wanted, &mut density));
                    }
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
        Ok((measures, density))
    }

    /// The number of unknowns.
    pub fn size(&self) -> usize {
        self.order.len()
    }

    /// Sixteen columns of a panel.
    fn half(
        &self,
        workspace: &mut Workspace,
        half: usize,
        ritz: &[f64],
        wanted: Wanted,
        density: &mut Density,
    ) -> Vec<Measure> {
        let Wanted { kernel, cutoff, goal } = wanted;
        let mut theta = [0.0; CYCLE_WIDTH];
        theta[..ritz.len()].copy_from_slice(ritz);
        let positive = ritz.iter().map(|theta| theta + self.floor).find(|&theta| theta > kernel);
        let sigma = SHIFT * positive.unwrap_or(1.0);
        let residuals = self.residuals(workspace, half, &theta);
        let mut enclosed = Enclosure::default();
        for step in 0..MOST_STEPS {
            let Workspace { right, y, rest, cycle, .. } = workspace;
            if step == 0 {
                y.copy_from_slice(self.hierarchy.cycle(sigma as f32, right, cycle));
            } else {
                let correction = self.hierarchy.cycle(sigma as f32, rest, cycle);
                y.as_flattened_mut().iter_mut().zip(correction.as_flattened()).for_each(|(y, c)| *y += c);
            }
            enclosed = self.enclose(workspace, sigma);
            if (0..ritz.len()).all(|k| enclosed.excess[k] <= SLACK * sigma * enclosed.below[k]) {
                break;
            }
        }
        let mut measures = Vec::with_capacity(ritz.len());
        let mut weights = [0.0; CYCLE_WIDTH];
        for k in 0..ritz.len() {
            let Residuals { sums, rounding, .. } = &residuals;
            let below = enclosed.below[k].max(0.0);
            // A consistent mass is at least a quarter of the lumped one.
            let factor = if matches!(self.mass, MassMatrix::Diagonal(_)) { 1.0 } else { 2.0 };
            let of_y =
                enclosed.rounding[k].sqrt() + MASS_ROUNDING * (sigma + self.floor) * enclosed.mass[k].max(0.0).sqrt();
            let excess =
                factor * ((1.0 + MASS_ROUNDING) * enclosed.excess[k].sqrt() + of_y + rounding[k]) / sigma.sqrt();
            let above = (below + 1e-12 * enclosed.size[k] + excess * excess).sqrt();
            let above_dual = factor * (sums[k].dual.sqrt() + rounding[k]);
            let mut measure = Measure { sigma, below: below.sqrt(), above, above_dual, ..sums[k] };
            let value = ritz[k] + self.floor;
            measure.bound = measure.distance(ritz[k], self.floor);
            measure.estimate = measure.error(value, cutoff).min(measure.bound);
            if let Some(goal) = goal
                && value > kernel
                && measure.estimate > goal * value
            {
                weights[k] = 1.0 / value;
            }
            measures.push(measure);
        }
        if weights.iter().any(|&w| w > 0.0) {
            let density = density.get_or_insert_with(|| vec![0.0; self.order.len()]);
            for ((sum, y), r) in density.iter_mut().zip(&workspace.y).zip(&workspace.right) {
                let share: f64 = (0..CYCLE_WIDTH).map(|k| weights[k] * f64::from(y[k]) * f64::from(r[k])).sum();
                *sum += share;
            }
        }
        measures
    }

    /// `r = S x − θ M x` into `right`, in single precision, with the sums that it enters.
    fn residuals(&self, workspace: &mut Workspace, half: usize, theta: &[f64; CYCLE_WIDTH]) -> Residuals {
        let mut found = Residuals::default();
        let x = &workspace.x;
        let lanes = half * CYCLE_WIDTH..(half + 1) * CYCLE_WIDTH;
        vectorized(
            (&mut found, &mut workspace.right),
            #[inline(always)]
            |(found, right)| {
                let mut totals = [[0.0; CYCLE_WIDTH]; 7];
                for (row, right) in right.iter_mut().enumerate() {
                    let own = lanes_of(&x[row], lanes.start);
                    let (columns, values) = self.stiffness.row(row);
                    let mut sx = [0.0; CYCLE_WIDTH];
                    for (&column, &value) in columns.iter().zip(values) {
                        let x = lanes_of(&x[column as usize], lanes.start);
                        for k in 0..CYCLE_WIDTH {
                            sx[k] = value.mul_add(x[k], sx[k]);
                        }
                    }
                    let mut mx = [0.0; CYCLE_WIDTH];
                    match &self.mass {
                        MassMatrix::Diagonal(mass) => {
                            for k in 0..CYCLE_WIDTH {
                                mx[k] = mass[row] * own[k];
                            }
                        }
                        MassMatrix::Sparse(mass) => {
                            let (columns, values) = mass.row(row);
                            for (&column, &value) in columns.iter().zip(values) {
                                let x = lanes_of(&x[column as usize], lanes.start);
                                for k in 0..CYCLE_WIDTH {
                                    mx[k] = value.mul_add(x[k], mx[k]);
                                }
                            }
                        }
                    }
                    let (inverse, weight) = (1.0 / self.lumped[row], self.rounding[row]);
                    for k in 0..CYCLE_WIDTH {
                        let r = sx[k] - theta[k] * mx[k];
                        right[k] = r as f32;
                        totals[0][k] += r * r;
                        totals[1][k] += r * r * inverse;
                        totals[2][k] += sx[k] * sx[k];
                        totals[3][k] += own[k] * own[k];
                        totals[4][k] += own[k] * mx[k];
                        totals[5][k] += own[k] * sx[k];
                        totals[6][k] += weight * own[k] * own[k];
                        found.lowest[k] = if own[k] < found.lowest[k] { own[k] } else { found.lowest[k] };
                        found.highest[k] = if own[k] > found.highest[k] { own[k] } else { found.highest[k] };
                    }
                }
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
                        + MASS_ROUNDING * theta[k].abs() * totals[4][k].sqrt()
                        + SINGLE * totals[1][k].sqrt();
                }
            },
        );
        found
    }

    /// The terms of the enclosure for the `y` that was found, in double precision.
    fn enclose(&self, workspace: &mut Workspace, sigma: f64) -> Enclosure {
        let Workspace { right, y, rest: rests, .. } = workspace;
        let (right, y) = (&*right, &*y);
        let shift = sigma + self.floor;
        let mut found = Enclosure::default();
        vectorized(
            (&mut found, rests),
            #[inline(always)]
            |(found, rests)| {
                for (row, ((r, own), rests)) in right.iter().zip(y).zip(rests.iter_mut()).enumerate() {
                    let (columns, values) = self.stiffness.row(row);
                    let mut ay = [0.0; CYCLE_WIDTH];
                    for (&column, &value) in columns.iter().zip(values) {
                        let y = &y[column as usize];
                        for k in 0..CYCLE_WIDTH {
                            ay[k] = value.mul_add(f64::from(y[k]), ay[k]);
                        }
                    }
                    let mut mass_y = [0.0; CYCLE_WIDTH];
                    match &self.mass {
                        MassMatrix::Diagonal(mass) => {
                            for k in 0..CYCLE_WIDTH {
                                mass_y[k] = mass[row] * f64::from(own[k]);
                            }
                        }
                        MassMatrix::Sparse(mass) => {
                            let (columns, values) = mass.row(row);
                            for (&column, &value) in columns.iter().zip(values) {
                                let y = &y[column as usize];
                                for k in 0..CYCLE_WIDTH {
                                    mass_y[k] = value.mul_add(f64::from(y[k]), mass_y[k]);
                                }
                            }
                        }
                    }
                    let (inverse, weight) = (1.0 / self.lumped[row], self.rounding[row]);
                    for k in 0..CYCLE_WIDTH {
                        let (r, y) = (f64::from(r[k]), f64::from(own[k]));
                        let rest = r - ay[k] - shift * mass_y[k];
                        rests[k] = rest as f32;
                        found.below[k] += y * (r + rest);
                        found.size[k] += (y * r).abs() + (y * rest).abs();
                        found.excess[k] += rest * rest * inverse;
                        found.rounding[k] += weight * y * y;
                        found.mass[k] += y * mass_y[k];
                    }
                }
            },
        );
        found
    }
}

impl Measure {
    /// Some exact eigenvalue is nearer to the Ritz value than this, on unit area: `η (θ + c + σ) / (1 − η)`, or `‖r‖_{M⁻¹} / ‖x‖_M` where that is
    /// less.
    fn distance(&self, theta: f64, floor: f64) -> f64 {
        let shifted = theta + floor + self.sigma;
        // Sums of squares err by far less than this.
        let exact = 1.0 - 1e-10;
        let norm = (exact * (self.energy + (floor + self.sigma) * self.mass)).max(0.0).sqrt();
        let eta = self.above / norm;
        let energy = if eta < 1.0 { eta * shifted / (1.0 - eta) } else { f64::INFINITY };
        let dual = self.above_dual / (exact * self.mass).max(0.0).sqrt();
        // NaN, from a vector of zeros, bounds nothing.
        if energy <= dual {
            energy
        } else if dual >= 0.0 {
            dual
        } else {
            f64::INFINITY
        }
    }

    /// About how far the Ritz value lies above the exact one, on unit area. `cutoff` is about the first value that the space does not hold.
    fn error(&self, theta: f64, cutoff: f64) -> f64 {
        let amplified =
            if cutoff > theta { (cutoff / (cutoff - theta)).clamp(1.0, MOST_AMPLIFIED) } else { MOST_AMPLIFIED };
        amplified * self.below * self.below / self.mass.max(f64::MIN_POSITIVE)
    }
}

#[inline(always)]
fn lanes_of(row: &[f64; LIFT_WIDTH], from: usize) -> &[f64; CYCLE_WIDTH] {
    let (halves, _) = row.as_chunks::<CYCLE_WIDTH>();
    &halves[from / CYCLE_WIDTH]
}

/// For each `j` the weight `w_j` with `Σ_i γ_i² (Σ_j |S_ij| |x_j|)² / m_i ≤ Σ_j w_j x_j²`, by Cauchy and Schwarz row by row: γ_i bounds the
/// rounding errors of a sum as long as row `i`.
fn rounding_weights(stiffness: &SparseMatrix, lumped: &[f64]) -> Vec<f64> {
    let mut weights = vec![0.0; lumped.len()];
    for (row, mass) in lumped.iter().enumerate() {
        let (columns, values) = stiffness.row(row);
        let unit = (columns.len() + 4) as f64 * f64::EPSILON;
        let share = unit * unit * values.iter().map(|value| value.abs()).sum::<f64>() / mass;
        for (&column, value) in columns.iter().zip(values) {
            weights[column as usize] += share * value.abs();
        }
    }
    weights
}

/// `S + cM`, `M` lumped.
fn plus_mass(stiffness: &SparseMatrix, lumped: &[f64], shift: f64) -> SparseMatrix {
    let mut values = stiffness.values().to_vec();
    for (row, mass) in lumped.iter().enumerate() {
        let start = stiffness.offsets()[row];
        if let Ok(at) = stiffness.row(row).0.binary_search(&(row as u32)) {
            values[start + at] += shift * mass;
        }
    }
    SparseMatrix::from_sorted_parts(
        stiffness.rows(),
        stiffness.columns(),
        stiffness.offsets().to_vec(),
        stiffness.indices().to_vec(),
        values,
    )
}

/// What one thread needs for a panel.
struct Workspace {
    x: Vec<[f64; LIFT_WIDTH]>,
    right: Vec<CycleRow>,
    y: Vec<CycleRow>,
    rest: Vec<CycleRow>,
    cycle: CycleWorkspace,
}

impl Workspace {
    fn new(n: usize, hierarchy: &Multigrid) -> Self {
        let zeros = || vec![[0.0; CYCLE_WIDTH]; n];
        Self { x: vec![[0.0; LIFT_WIDTH]; n], right: zeros(), y: zeros(), rest: zeros(), cycle: hierarchy.workspace() }
    }
}

/// Sums over the residuals of sixteen pairs.
#[derive(Default)]
struct Residuals {
    sums: [Measure; CYCLE_WIDTH],
    /// `‖δ‖²` in the inverse lumped mass, δ a bound on the rounding errors of each row.
    rounding: [f64; CYCLE_WIDTH],
    lowest: [f64; CYCLE_WIDTH],
    highest: [f64; CYCLE_WIDTH],
}

/// The terms of the enclosure; those of `r − Ay` are in the inverse lumped mass.
#[derive(Default)]
struct Enclosure {
    /// `2 yᵀr − yᵀAy`
    below: [f64; CYCLE_WIDTH],
    /// The sum of the magnitudes of its terms.
    size: [f64; CYCLE_WIDTH],
    /// `‖r − Ay‖²`
    excess: [f64; CYCLE_WIDTH],
    /// A bound on the square of `‖δ‖`, δ the rounding error of `S y`.
    rounding: [f64; CYCLE_WIDTH],
    /// `yᵀMy`
    mass: [f64; CYCLE_WIDTH],
}
