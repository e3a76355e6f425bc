//! Refinement of an approximation: one step of subspace iteration on the mesh, where the compact form is not needed.
//!
//! The approximate eigenfunctions are lifted, a filter damps what they hold of higher eigenfunctions, and a
//! Rayleigh–Ritz over all of them gives the new pairs. The result is dense: `n` numbers for every pair.

use chladni_algebra::{
    DenseMatrix, FactorError, MassMatrix, Ordering, PANEL_WIDTH, PanelMatrix, SparseMatrix, SymbolicFactor,
    SymmetricDefiniteSolver, fill_reducing_order, gpu, mass_times_panel, residual_panel, residual_sums,
};
use chladni_base::notes::FALLBACKS;
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, Quiet};
use serde::{Deserialize, Serialize};

use super::approximate::{ApproximationError, ApproximationParameters, rounding, search};
use super::certificate::KERNEL;
use super::domain::Domain;
use super::hsim::Eigenpairs;
use super::restricted::Ritz;
use crate::basis::AccuracyReport;
use crate::operator::{EigenProblem, MeshOperator};

/// How approximate eigenfunctions are filtered. In JSON: `"inverse_iteration"` or `{"chebyshev": {"degree": 12}}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Refinement {
    /// `(K + σM)⁻¹ M`, by one sparse factorisation.
    InverseIteration,
    /// A Chebyshev polynomial of `M⁻¹K`: products with sparse matrices alone. Needs a lumped mass.
    Chebyshev {
        /// The degree, from 1 to 200.
        #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 200, example = 20))]
        degree: usize,
    },
}

impl Refinement {
    /// The largest degree.
    pub const MOST_DEGREE: usize = 200;

    /// Checks the parameters against their ranges.
    ///
    /// # Errors
    /// [`ApproximationError::Parameter`] names what is outside.
    pub fn check(self, lumped: bool) -> Result<(), ApproximationError> {
        let error = |name, reason| Err(ApproximationError::Parameter { name, reason });
        match self {
            Self::Chebyshev { degree } if !(1..=Self::MOST_DEGREE).contains(&degree) => error(
                "refinement.chebyshev.degree",
                format!("must lie between 1 and {}, not be {degree}", Self::MOST_DEGREE),
            ),
            Self::Chebyshev { .. } if !lumped => {
                error("refinement", "a Chebyshev filter needs a lumped mass".to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// Columns beyond the wanted ones that are refined with them: the last pairs gain least from a filter.
fn guards(count: usize) -> usize {
    8 + count / 10
}

/// The shift of the inverse iteration, as a share of the largest Ritz value: high pairs are damped by (θ + σ)/(λ + σ).
const SHIFT: f64 = 0.01;

/// Of the estimated error of a pair so much is left at least, whatever the refinement took off its value.
const LEFT: f64 = 0.2;

/// A value that refinement makes larger by more than this share of the last one was made worse by it.
const WORSE: f64 = 1e-9;

/// A zero that comes out as less than this share of the last value is one.
const ZERO: f64 = 1e-6;

/// Refined pairs, and what is known of their errors.
#[derive(Debug)]
pub struct Refined {
    /// The pairs.
    pub pairs: Eigenpairs,
    /// About how far each value lies above the exact one of its index, in the units of the values.
    pub estimates: Vec<f64>,
    /// What came of the goal, if there was one.
    pub accuracy: Option<AccuracyReport>,
}

/// Approximates the lowest `count` pairs as [`approximate`](super::approximate) does, as finely as the goal asks for,
/// lifts and refines them. Stages: those of the approximation, then `refine` and `bounds`.
///
/// A Ritz value is an upper bound of the eigenvalue of its index, so that the smaller is the better: where a filter
/// makes one larger, the approximation is kept, and the monitor gets a note.
///
/// Eigenvalues and bounds are in the units of the input, eigenvectors orthonormal for the mass of the input, with zeros
/// at vertices that are no unknowns. Nothing is counted by inertia: no pair proves to be missing or there.
///
/// # Errors
/// [`ApproximationError`], as the approximation; a filter that does not fit, or a factorisation that fails.
pub fn approximate_refined<'a>(
    domain: impl Into<Domain<'a>>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    refinement: Refinement,
    monitor: &dyn Monitor,
) -> Result<Refined, ApproximationError> {
    let domain = domain.into();
    if let Domain::Surface(_) = domain {
        return on_unit_size(domain, operator, parameters, refinement, monitor);
    }
    let unit = operator.on_unit_volume();
    let mut refined = on_unit_size(domain, &unit, parameters, refinement, monitor)?;
    // Values are as in the input now; functions are still over a square, instead of a volume.
    let scale = (unit.problem.area / operator.problem.area).sqrt();
    refined.pairs.vectors.panels_mut().par_iter_mut().flatten().for_each(|x| *x *= scale);
    Ok(refined)
}

/// [`approximate_refined`] on a problem of unit size, whose area is the square of the length that is 1 there.
fn on_unit_size(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    refinement: Refinement,
    monitor: &dyn Monitor,
) -> Result<Refined, ApproximationError> {
    let problem = &operator.problem;
    refinement.check(matches!(problem.mass, MassMatrix::Diagonal(_)))?;
    let count = parameters.count;
    let fitted = parameters.fitted(problem.size());
    let found = search(domain, operator, fitted, guards(count), monitor)?;
    let mut accuracy = parameters.goal.map(|goal| found.report(domain, goal.error));
    let hides_some = found.hides_some();
    let (Ritz { space, pairs, .. }, estimates) = found.into_pairs(problem);

    monitor.stage("refine");
    let lift = || gpu::accelerator().lift(&space, &pairs.vectors, monitor);
    let filtered = match refinement {
        Refinement::InverseIteration => inverse_iterations(problem, lift()?, &pairs.values, 1, monitor)?,
        Refinement::Chebyshev { degree } => chebyshev(problem, lift()?, &pairs.values, degree, monitor)?,
    };
    monitor.checkpoint()?;
    let n = domain.positions().len();
    let slack = rounding(problem, pairs.values.last().map_or(0.0, |last| last.abs()), WORSE);
    let worse = |refined: &Eigenpairs| {
        let values = refined.values.iter().map(|value| value * problem.area);
        // A zero is known, whatever rounding makes of it. NaN is worse than anything.
        values.zip(&pairs.values).position(|(new, &old)| {
            let slack = if old == 0.0 { slack.max(ZERO * pairs.values[pairs.values.len() - 1]) } else { slack };
            !(new <= old + slack && new >= -operator.floor.abs() - slack)
        })
    };
    let mut refined = rayleigh_ritz(operator, filtered, count, n, monitor)?;
    if let Some(pair) = worse(&refined) {
        let reason = format!("refinement: it made the value of pair {pair} worse, and the approximation was kept");
        monitor.note(FALLBACKS, &reason);
        refined = rayleigh_ritz(operator, lift()?, count, n, monitor)?;
        if let Some(pair) = worse(&refined) {
            return Err(ApproximationError::Parameter {
                name: "refinement",
                reason: format!(
                    "rounding decides the value of pair {pair} in double precision; leave it out, or take \"hsim\""
                ),
            });
        }
    }
    // What is exactly zero was known before.
    refined.values.iter_mut().zip(&pairs.values).filter(|(_, old)| **old == 0.0).for_each(|(new, _)| *new = 0.0);
    let left = |((new, old), estimate): ((&f64, &f64), &f64)| {
        let gained = (old - new * problem.area).max(0.0);
        (estimate - gained).max(LEFT * estimate) / problem.area
    };
    let estimates: Vec<f64> = refined.values.iter().zip(&pairs.values).zip(&estimates).map(left).collect();
    if let Some(accuracy) = &mut accuracy {
        let relative = |(estimate, value): (&f64, &f64)| {
            if (value * problem.area).abs() > KERNEL { estimate / value.abs() } else { 0.0 }
        };
        accuracy.largest_estimate = estimates.iter().zip(&refined.values).map(relative).fold(0.0, f64::max);
        accuracy.reached = accuracy.largest_estimate <= accuracy.goal && !hides_some;
    }
    Ok(Refined { pairs: refined, estimates, accuracy })
}

/// `((K + σM)⁻¹ M)ᵏ X` for `k` iterations; `values` are the Ritz values of the columns, ascending.
pub(super) fn inverse_iterations(
    problem: &EigenProblem,
    vectors: PanelMatrix,
    values: &[f64],
    iterations: usize,
    monitor: &dyn Monitor,
) -> Result<PanelMatrix, ApproximationError> {
    let after = |done, vectors, _| Ok((vectors, done >= iterations));
    inverse_iterations_until(problem, vectors, values, monitor, after).map(|(vectors, _)| vectors)
}

/// A problem in a fill-reducing order, with the structure of its factors.
#[derive(Debug)]
pub(super) struct Ordered {
    order: Vec<u32>,
    stiffness: SparseMatrix,
    mass: MassMatrix,
    symbolic: SymbolicFactor,
}

impl Ordered {
    fn new(problem: &EigenProblem, monitor: &dyn Monitor) -> Result<Self, ApproximationError> {
        let ordering = if problem.size() > 100_000 { Ordering::NestedDissection } else { Ordering::Amd };
        let order = fill_reducing_order(&problem.stiffness, ordering).map_err(not_factored)?;
        monitor.checkpoint()?;
        let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
        let symbolic = SymbolicFactor::new(&stiffness, &mass)
            .and_then(|symbolic| symbolic.within(1, monitor))
            .map_err(not_factored)?;
        Ok(Self { order, stiffness, mass, symbolic })
    }

    /// The number of eigenvalues below a shift, with multiplicity (Sylvester): another factor.
    ///
    /// # Errors
    /// [`FactorError`]: a shift on an eigenvalue, or no memory.
    pub fn below(&self, shift: f64) -> Result<usize, FactorError> {
        Ok(self.symbolic.count(&self.stiffness, &self.mass, shift)?.below)
    }
}

fn not_factored(error: FactorError) -> ApproximationError {
    match error {
        FactorError::Promise { .. } => ApproximationError::Memory(error.to_string()),
        other => ApproximationError::Factor(other.to_string()),
    }
}

/// Inverse iterations `X ← (K + σM)⁻¹ M X`, of which there is one at least. After each of them `after` is given their
/// number, the columns, and the shift `σ > 0`; it gives columns to go on with, and whether they are enough. The last
/// columns come with what eigenvalues can be counted by.
pub(super) fn inverse_iterations_until<E: From<ApproximationError> + From<Cancelled> + Send>(
    problem: &EigenProblem,
    mut vectors: PanelMatrix,
    values: &[f64],
    monitor: &dyn Monitor,
    mut after: impl FnMut(usize, PanelMatrix, f64) -> Result<(PanelMatrix, bool), E>,
) -> Result<(PanelMatrix, Ordered), E> {
    let (lowest, highest) = (values[0], values[values.len() - 1]);
    let shift = SHIFT * highest.abs().max(1.0) + (-1.1 * lowest).max(0.0);
    let ordered = Ordered::new(problem, monitor)?;
    let Ordered { order, stiffness, mass, symbolic } = &ordered;
    let factor = symbolic.factor(stiffness, mass, -shift).map_err(not_factored)?;
    monitor.checkpoint()?;
    for iteration in 1.. {
        let total = vectors.panels().len();
        let done = std::sync::atomic::AtomicUsize::new(0);
        vectors.panels_mut().par_iter_mut().try_for_each(|panel| {
            monitor.checkpoint()?;
            let mut own = vec![0.0; panel.len()];
            gather(panel, order, &mut own);
            mass_times_panel(mass, &own, panel);
            factor.solve_panel(panel);
            own.copy_from_slice(panel);
            scatter(&own, order, panel);
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            monitor.progress(done as f64 / total as f64);
            Ok::<(), Cancelled>(())
        })?;
        let (kept, enough) = after(iteration, vectors, shift)?;
        vectors = kept;
        if enough {
            break;
        }
    }
    drop(factor);
    Ok((vectors, ordered))
}

/// Row `k` of `out` becomes row `order[k]` of `panel`.
fn gather(panel: &[f64], order: &[u32], out: &mut [f64]) {
    for (&row, out) in order.iter().zip(out.chunks_exact_mut(PANEL_WIDTH)) {
        let from = row as usize * PANEL_WIDTH;
        out.copy_from_slice(&panel[from..from + PANEL_WIDTH]);
    }
}

/// Row `order[k]` of `out` becomes row `k` of `panel`.
fn scatter(panel: &[f64], order: &[u32], out: &mut [f64]) {
    for (&row, panel) in order.iter().zip(panel.chunks_exact(PANEL_WIDTH)) {
        let to = row as usize * PANEL_WIDTH;
        out[to..to + PANEL_WIDTH].copy_from_slice(panel);
    }
}

/// The largest eigenvalue of the filter, as a multiple of what Gershgorin's theorem makes of the median row.
const STIFFEST: f64 = 4.0;

/// The lumped mass that a filter divides by, and a bound on the eigenvalues then (Gershgorin). The few rows that are
/// far stiffer than the median, at short edges, are given more mass: they would stretch the interval that the
/// polynomial must keep small, ten times and more on real meshes, while on smooth functions they hardly act.
fn filter_mass(problem: &EigenProblem) -> (Vec<f64>, f64) {
    let mut mass = problem.mass.lumped();
    let sums: Vec<f64> = (0..problem.size())
        .into_par_iter()
        .map(|row| problem.stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>())
        .collect();
    let mut ratios: Vec<f64> = sums.iter().zip(&mass).map(|(sum, m)| sum / m).collect();
    let middle = ratios.len() / 2;
    let most = STIFFEST * *ratios.select_nth_unstable_by(middle, f64::total_cmp).1;
    if most > 0.0 {
        mass.iter_mut().zip(&sums).for_each(|(m, sum)| *m = m.max(sum / most));
    }
    (mass, most)
}

/// A Chebyshev polynomial of `M⁻¹K` that is small from the highest Ritz value to the largest eigenvalue and grows below
/// (Zhou and Saad 2007).
fn chebyshev(
    problem: &EigenProblem,
    mut vectors: PanelMatrix,
    values: &[f64],
    degree: usize,
    monitor: &dyn Monitor,
) -> Result<PanelMatrix, ApproximationError> {
    let stiffness = &problem.stiffness;
    let (mass, most) = filter_mass(problem);
    let (lowest, from) = (values[0], values[values.len() - 1]);
    if !(most > from) {
        return Ok(vectors);
    }
    let (half, centre) = (0.5 * (most - from), 0.5 * (most + from));
    let centres = [centre; PANEL_WIDTH];
    let inverse: Vec<f64> = mass.iter().map(|m| m.recip()).collect();
    let lumped = MassMatrix::Diagonal(mass);
    let first = half / (lowest - centre);
    vectors.panels_mut().par_iter_mut().try_for_each(|panel| {
        let (mut now, mut next) = (vec![0.0; panel.len()], vec![0.0; panel.len()]);
        // Scaled so that the lowest eigenfunction keeps its size.
        let mut sigma = first;
        residual_panel(stiffness, &lumped, panel, &centres, &mut now);
        for (row, inverse) in now.chunks_exact_mut(PANEL_WIDTH).zip(&inverse) {
            row.iter_mut().for_each(|y| *y *= inverse * sigma / half);
        }
        for _ in 1..degree {
            monitor.checkpoint()?;
            let turned = (2.0 / first - sigma).recip();
            residual_panel(stiffness, &lumped, &now, &centres, &mut next);
            let rows = next.chunks_exact_mut(PANEL_WIDTH).zip(panel.chunks_exact(PANEL_WIDTH)).zip(&inverse);
            for ((next, before), inverse) in rows {
                let (scale, back) = (2.0 * turned / half * inverse, sigma * turned);
                next.iter_mut().zip(before).for_each(|(y, x)| *y = scale * *y - back * x);
            }
            panel.copy_from_slice(&now);
            std::mem::swap(&mut now, &mut next);
            sigma = turned;
        }
        *panel = now;
        Ok::<(), ApproximationError>(())
    })?;
    Ok(vectors)
}

/// The lowest pairs in the span of the columns, in the units of the input and on all `n` vertices.
fn rayleigh_ritz(
    operator: &MeshOperator,
    mut vectors: PanelMatrix,
    count: usize,
    n: usize,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, ApproximationError> {
    let problem = &operator.problem;
    let accelerator = gpu::accelerator();
    let (stiffness, gram, resident) = accelerator.restrict(&problem.stiffness, &problem.mass, &vectors, monitor)?;
    let pairs = accelerator.lowest(stiffness, gram.clone(), count, &Quiet(monitor))?;
    accelerator.rotate(&mut vectors, resident, &pairs.vectors, monitor)?;

    monitor.stage("bounds");
    let sums = residual_sums(&problem.stiffness, &problem.mass, &vectors, &pairs.values, monitor)?;
    let norm = (0..problem.size())
        .into_par_iter()
        .map(|row| problem.stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>())
        .reduce(|| 0.0, f64::max);
    let factor = problem.mass.lumped_ratio().sqrt();
    let ratio = |part: f64, whole: f64| if part == 0.0 { 0.0 } else { (part / whole).sqrt() };
    let mut defect = 0.0f64;
    let (mut residuals, mut bounds, mut scales) = (Vec::new(), Vec::new(), Vec::new());
    for (sum, &theta) in sums.iter().zip(&pairs.values) {
        residuals.push(if theta.abs() <= KERNEL {
            ratio(sum.stiffness, norm * norm * sum.square)
        } else {
            ratio(sum.residual, sum.stiffness)
        });
        bounds.push(factor * ratio(sum.dual, sum.mass) / problem.area);
        defect = defect.max((sum.mass - 1.0).abs());
        let sign = if sum.lowest < -sum.highest { -1.0 } else { 1.0 };
        scales.push(sign / problem.area.sqrt());
    }
    let orthonormality_defect = defect.max(gram_defect(&gram, &pairs.vectors));
    Ok(Eigenpairs {
        values: pairs.values.iter().map(|value| value / problem.area).collect(),
        vectors: on_all_vertices(vectors, &scales, problem.unknowns.as_deref(), n),
        residuals,
        bounds,
        orthonormality_defect,
        inertia: Vec::new(),
        first: 0,
        on_bounds: Vec::new(),
        cut: None,
        levels: Vec::new(),
        space: None,
    })
}

/// The largest entry of `|ZᵀGZ − I|`.
fn gram_defect(gram: &DenseMatrix, vectors: &DenseMatrix) -> f64 {
    let product = vectors.transposed_times(&gram.times(vectors));
    let entry = |j: usize, (i, value): (usize, &f64)| (value - f64::from(u8::from(i == j))).abs();
    (0..product.columns())
        .flat_map(|j| product.column(j).iter().enumerate().map(move |v| entry(j, v)).collect::<Vec<f64>>())
        .fold(0.0, f64::max)
}

/// The columns times their scales, with rows of zeros for vertices that are no unknowns.
fn on_all_vertices(mut vectors: PanelMatrix, scales: &[f64], unknowns: Option<&[u32]>, n: usize) -> PanelMatrix {
    vectors.panels_mut().par_iter_mut().zip(scales.par_chunks(PANEL_WIDTH)).for_each(|(panel, scales)| {
        for row in panel.chunks_exact_mut(PANEL_WIDTH) {
            row.iter_mut().zip(scales).for_each(|(x, scale)| *x *= scale);
        }
    });
    let Some(unknowns) = unknowns else { return vectors };
    let mut whole = PanelMatrix::zeros(n, vectors.columns());
    for (to, from) in whole.panels_mut().iter_mut().zip(vectors.into_panels()) {
        scatter(&from, unknowns, to);
    }
    whole
}

#[cfg(test)]
#[path = "refine_tests.rs"]
mod tests;
