//! The fast approximation of eigenproblems (thesis, chapter 2): Ritz pairs in a subspace of locally supported
//! functions.

mod above;
mod attempt;
mod by_rows;
pub mod parts;
mod reduce;
mod space;
mod stack;

use super::certificate::CertificateError;
use super::domain::Domain;
use super::energy::Energy;
use super::envelope::on_all_vertices;
use super::hats;
use super::heat::HeatParameters;
use super::hsim;
use super::lehmann::{self, Enclosed};
use super::radial::RadialParameters;
use super::restricted::Ritz;
use crate::basis::{AccuracyReport, Basis, Compact, Functions, InertiaCount};
use crate::operator::{EigenProblem, MeshOperator};
use chladni_algebra::{EigenError, gpu};
use chladni_base::Monitor;

pub use super::error::ApproximationError;
use above::{move_back, without_offset};
use attempt::{Attempt, Remedies};
pub use attempt::{MOST_COUNTED_IN_SOLID, most_columns};
use reduce::reduce;
pub(super) use reduce::{ritz, rounding};
pub use space::{most_initial_columns, subspace};

/// How the subspace is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Space {
    /// Heat-smoothed columns.
    Heat(HeatParameters),
    /// Radial columns as they are.
    Radial(RadialParameters),
}

impl Space {
    /// [`HeatParameters::for_few_vertices`], where that is how the space is built.
    fn for_few_vertices(self) -> Option<Self> {
        match self {
            Self::Heat(heat) => heat.for_few_vertices().map(Self::Heat),
            Self::Radial(_) => None,
        }
    }
}

/// What is to be approximated, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproximationParameters {
    /// The number `m` of eigenpairs.
    pub count: usize,
    /// The dimension `d ≥ m` of the subspace. A mesh of fewer than `1.5 d` vertices is solved exactly instead, and a
    /// construction may add a function for a vertex that no other reaches.
    pub dimension: usize,
    /// How the subspace is built.
    pub space: Space,
    /// How accurate the pairs are to be; `None`: the space is taken as it is, and nothing is said.
    pub goal: Option<Goal>,
    /// Whether eigenvalues are counted, so that each pair has an enclosure with its index.
    pub certify: bool,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

impl ApproximationParameters {
    /// With columns that diffuse for longer, where each has few of the `unknowns` and nobody chose otherwise.
    pub(super) fn fitted(mut self, unknowns: usize) -> Self {
        if unknowns < FEW_VERTICES_FOR_HEAT * self.dimension.max(1) {
            self.space = self.space.for_few_vertices().unwrap_or(self.space);
        }
        self
    }
}

/// A space of fewer columns than the pairs and this is too coarse for the lowest of them; more cost next to nothing.
const LEAST_EXTRA: usize = 150;

/// The dimension of a subspace for `count` pairs with so many columns for each; few pairs get more.
pub fn dimension_for(count: usize, columns_per_pair: usize) -> usize {
    count.saturating_mul(columns_per_pair).max(count.saturating_add(LEAST_EXTRA))
}

/// What is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// The largest relative error of an eigenvalue, as estimated. The mean is to be at most a fifth of it.
    pub error: f64,
    /// How often columns may be added where it is exceeded: [`MOST_ROUNDS`], or 0 to take the space as it is and say
    /// whether it will do.
    pub rounds: usize,
}

/// Columns are added to a space at most so often: each round takes as long as the dense eigenproblem and the bounds.
pub const MOST_ROUNDS: usize = 5;

/// Where single vertices as columns gain less than this factor, the space grows instead.
const LEAST_GAIN: f64 = 1.15;

/// Columns of fewer vertices than this may be too coarse for a limb, and are smoothed for longer where a goal is
/// missed.
pub const FEW_VERTICES: usize = 60;

/// Columns of fewer vertices than this diffuse for longer from the beginning.
const FEW_VERTICES_FOR_HEAT: usize = 20;

/// Computes the lowest `m` Ritz pairs of an operator on a surface, or of the Laplacian in a solid, in a subspace of `d`
/// locally supported functions.
///
/// Where the estimated error of a pair exceeds the goal, the space is made finer and the pairs computed again, as often
/// as the goal allows: by columns that diffuse for longer, where they have few vertices; by hat functions where the
/// residuals sit, if that is at few vertices; else by a larger `d`. The certificate tells what came of it.
///
/// Stages: `sampling`, `basis`, `reduce`, `eigen`, `bounds`; the last three, or all, once more for each round;
/// `certify`. Eigenvalues ascend, are upper bounds of the exact ones, and are in 1/length² of the input; eigenfunctions
/// are orthonormal for the mass of the input. The metadata are left empty. The same input and seed give the same
/// answer, up to rounding in the dense eigenproblem where the number of threads differs.
///
/// # Errors
/// [`ApproximationError`]: a mesh without area, radial functions in a solid, more pairs than vertices, a restricted
/// problem that is not definite, cancellation.
pub fn approximate<'a>(
    domain: impl Into<Domain<'a>>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<Basis, ApproximationError> {
    let domain = domain.into();
    if let Domain::Surface(_) = domain {
        return above_offset(domain, operator, parameters, monitor);
    }
    let unit = operator.on_unit_volume();
    let mut basis = above_offset(domain, &unit, parameters, monitor)?;
    // Values are as in the input now; masses and functions are still over a square, instead of a volume.
    let laplacian = operator.laplacian();
    basis.mass = laplacian.mass.scaled(laplacian.area);
    let scale = (unit.problem.area / laplacian.area).sqrt();
    if let Functions::Compact(compact) = &mut basis.functions {
        compact.coefficients.values_mut().iter_mut().for_each(|value| *value *= scale);
    }
    Ok(basis)
}

/// A space that was made as fine as the goal asks for, or as the mesh allows, and its pairs, judged.
pub(super) struct Found<'a> {
    attempt: Attempt,
    /// What pairs are measured with, where they were measured in one piece.
    energy: Option<Energy<'a>>,
    /// How its functions were made.
    built: Space,
    /// How often it was made finer.
    rounds: usize,
}

impl Found<'_> {
    /// The pairs, guards included, and their estimated errors, on unit size.
    pub(super) fn into_pairs(self, problem: &EigenProblem) -> (Ritz, Vec<f64>) {
        let Attempt { ritz, certificate, .. } = self.attempt;
        let mut estimates = certificate.estimates;
        by_index(&ritz.pairs.values, &mut estimates, problem.area);
        estimates.iter_mut().for_each(|estimate| *estimate *= problem.area);
        (ritz, estimates)
    }

    /// What came of the goal.
    pub(super) fn report(&self, domain: Domain<'_>, goal: f64) -> AccuracyReport {
        report(domain, &self.attempt, self.built, self.rounds, goal)
    }

    /// Whether there are eigenvalues below the last pair's that no pair stands for.
    pub(super) fn hides_some(&self) -> bool {
        self.attempt.hidden > 0
    }
}

/// What came of a goal.
fn report(domain: Domain<'_>, attempt: &Attempt, built: Space, rounds: usize, goal: f64) -> AccuracyReport {
    AccuracyReport {
        goal,
        largest_estimate: attempt.largest_estimate,
        reached: attempt.largest_estimate <= goal && attempt.hidden == 0,
        rounds,
        dimension: attempt.ritz.space.columns(),
        hats: hats::count(&attempt.ritz.space),
        heat_steps: match built {
            Space::Heat(heat) => Some(domain.heat(heat).steps),
            Space::Radial(_) => None,
        },
    }
}

/// Pairs and at least `guards` beyond them in a space that is made finer as often as the goal allows, on a problem of
/// unit size.
pub(super) fn search<'a>(
    domain: Domain<'_>,
    operator: &'a MeshOperator,
    mut parameters: ApproximationParameters,
    guards: usize,
    monitor: &dyn Monitor,
) -> Result<Found<'a>, ApproximationError> {
    let problem = &operator.problem;
    let (count, goal) = (parameters.count, parameters.goal.map(|goal| goal.error));
    let (kernel, columns) = pairs_with_guards(problem, &parameters, guards);
    let most = most_columns(problem.size(), parameters.dimension.max(count));
    let mut attempt = Attempt::new(
        ritz(domain, operator, &mut parameters, columns, monitor)?.with_zeros(problem, kernel),
        count,
        most,
    );
    let mut built = parameters.space;
    monitor.stage("bounds");
    let energy = match measured_in_parts(domain, operator, &parameters, &attempt) {
        true => None,
        false => {
            let triangles = parts::cotangents(domain, operator);
            Some(Energy::on(triangles, problem, operator.floor, monitor).map_err(CertificateError::from)?)
        }
    };
    let judge = |attempt: &mut Attempt| match &energy {
        Some(energy) => attempt.judge(energy, problem, goal, monitor),
        None => attempt.judge_in_parts(domain, operator, problem.size().div_ceil(ROWS_OF_PART), monitor),
    };
    judge(&mut attempt)?;
    attempt.look_for_hidden(domain, operator, goal, monitor)?;
    let mut rounds = 0;
    let mut remedies = Remedies { hats: true, longer: true };
    while let Some(goal) = goal
        && attempt.excess(goal) > 1.0
        && rounds < parameters.goal.map_or(0, |goal| goal.rounds)
    {
        let (before, construction) = (parameters.dimension, parameters.space);
        let finer = attempt.finer_space(domain, operator, &mut parameters, goal, &mut remedies, monitor)?;
        // A space that lost more columns than it was given would lose the pairs as well.
        let Some(space) = finer.filter(|space| space.columns() >= count) else { break };
        rounds += 1;
        let columns = columns.min(space.columns());
        let mut next = match reduce(problem, space, columns, monitor) {
            Ok(ritz) => Attempt::new(ritz.with_zeros(problem, kernel), count, most),
            // What was found before is good enough to be judged, and says how good.
            Err(ApproximationError::Eigen(EigenError::NotPositiveDefinite { .. })) => break,
            Err(error) => return Err(error),
        };
        monitor.stage("bounds");
        judge(&mut next)?;
        next.look_for_hidden(domain, operator, Some(goal), monitor)?;
        let gained = attempt.excess(goal) / next.excess(goal);
        if gained > 1.0 {
            (attempt, built) = (next, parameters.space);
        }
        if gained < LEAST_GAIN && parameters.dimension == before && parameters.space == construction {
            // Much the same residuals would ask for much the same columns again.
            remedies.hats = false;
        }
    }
    attempt.possible((-operator.floor).max(0.0), problem.area)?;
    Ok(Found { attempt, energy, built, rounds })
}

/// From so many unknowns on pairs are measured in parts of the surface, one after the other: what a panel and its
/// hierarchy take, some 900 bytes an unknown, is most of the memory. Bounds are a little wider beside cuts, and where a
/// goal is missed columns are added everywhere: where energy is missing is known of the whole alone.
pub const MEASURED_IN_PARTS_FROM: usize = 4_000_000;

/// The unknowns of such a part.
pub const ROWS_OF_PART: usize = 2_000_000;

/// Whether pairs are measured in parts.
fn measured_in_parts(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    attempt: &Attempt,
) -> bool {
    let (n, space) = (operator.problem.size(), &attempt.ritz.space);
    let on_card = || gpu::accelerator().would_measure(n, space.entries(), attempt.ritz.pairs.values.len());
    n >= MEASURED_IN_PARTS_FROM
        && !parameters.certify
        && matches!(domain, Domain::Surface(_))
        && n >= FEW_VERTICES * space.columns()
        && parts::has_parts(operator).is_ok()
        && !on_card()
}

/// The dimension of the kernel, and the pairs that are computed, at least `guards` beyond the wanted ones among them.
fn pairs_with_guards(problem: &EigenProblem, parameters: &ApproximationParameters, guards: usize) -> (usize, usize) {
    let kernel = hsim::constants_in_kernel(&problem.stiffness, &problem.mass);
    (kernel, pairs_beside(problem.size(), kernel, parameters, guards))
}

/// The pairs that are computed of a problem of so many unknowns with a kernel of some dimension.
fn pairs_beside(unknowns: usize, kernel: usize, parameters: &ApproximationParameters, guards: usize) -> usize {
    let count = parameters.count;
    let mut guards = self::guards(count, unknowns / parameters.dimension.max(1)).max(guards);
    if parameters.certify {
        guards = guards.max(lehmann::guards(count));
    }
    // Eigenvalues are counted above the kernel, even if only a part of that is wanted.
    let pairs = if parameters.certify { count.max(kernel) } else { count };
    (pairs + guards).min(parameters.dimension.max(pairs)).min(unknowns).max(count)
}

/// [`approximate`] on a problem of unit size, relative to what a potential is at least.
fn above_offset(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<Basis, ApproximationError> {
    let (own, offset) = without_offset(operator);
    let mut basis = on_unit_size(domain, &own, parameters, monitor)?;
    if offset != 0.0 {
        move_back(&mut basis, operator, offset, monitor)?;
    }
    Ok(basis)
}

/// [`approximate`] on a problem of unit size, whose area is the square of the length that is 1 there.
fn on_unit_size(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<Basis, ApproximationError> {
    let problem = &operator.problem;
    let parameters = parameters.fitted(problem.size());
    let found = search(domain, operator, parameters, 0, monitor)?;
    let accuracy = parameters.goal.map(|goal| found.report(domain, goal.error));
    let Found { attempt, energy, .. } = found;
    let enclosed = match &energy {
        Some(energy) if parameters.certify => Some(attempt.enclose(energy, problem, monitor)?),
        _ => None,
    };
    drop(energy);
    Ok(delivered(domain, operator, attempt, accuracy, enclosed))
}

/// The basis of pairs that are judged, in the units of the input.
fn delivered(
    domain: Domain<'_>,
    operator: &MeshOperator,
    attempt: Attempt,
    accuracy: Option<AccuracyReport>,
    enclosed: Option<Enclosed>,
) -> Basis {
    let problem = &operator.problem;
    let count = attempt.count;
    let Attempt { ritz: Ritz { space, mut pairs, .. }, mut certificate, .. } = attempt;
    for distances in [&mut certificate.estimates, &mut certificate.bounds] {
        by_index(&pairs.values, distances, problem.area);
    }
    pairs.values.truncate(count);
    pairs.vectors = pairs.vectors.slice_columns(0..count);
    for list in [&mut certificate.residuals, &mut certificate.estimates, &mut certificate.bounds] {
        list.truncate(count);
    }
    certificate.accuracy = accuracy;

    if let Some(Enclosed { shift, below, bounds }) = enclosed {
        certificate.bounds = bounds.into_iter().map(|bound| bound / problem.area).collect();
        certificate.complete = Some(true);
        certificate.inertia = vec![InertiaCount { shift: shift / problem.area, below }];
    }

    // From the mesh of unit area back to the units of the input.
    let (value_scale, vector_scale) = (problem.area.recip(), problem.area.sqrt().recip());
    pairs.vectors.values_mut().iter_mut().for_each(|value| *value *= vector_scale);
    let space = match &problem.unknowns {
        Some(unknowns) => on_all_vertices(space, unknowns, domain.positions().len()),
        None => space,
    };
    Basis {
        functions: Functions::Compact(Compact::new(space, pairs.vectors)),
        eigenvalues: pairs.values.into_iter().map(|value| value * value_scale).collect(),
        mass: operator.laplacian().mass.scaled(problem.area),
        certificate,
        metadata: serde_json::Value::Object(serde_json::Map::new()),
    }
}

/// Makes distances of values, ascending, from some eigenvalue those from the eigenvalue of the same index, if no two
/// values belong to one eigenvalue: a pair that is closer than its neighbours stands one place too low where an
/// eigenvalue below it has its value above. No distance gets smaller; they are in units of the values over `unit`.
fn by_index(values: &[f64], distances: &mut [f64], unit: f64) {
    let mut lower: Vec<f64> = values
        .iter()
        .zip(&*distances)
        // What is anywhere says nothing of the others.
        .map(|(value, distance)| if distance.is_finite() { value - distance * unit } else { *value })
        .collect();
    lower.sort_by(f64::total_cmp);
    for ((value, lower), distance) in values.iter().zip(lower).zip(distances) {
        *distance = distance.max((value - lower) / unit);
    }
}

/// Pairs that are computed and judged beyond those that are delivered. An eigenfunction that the space holds badly has
/// its Ritz value among them, and all pairs between lie one place too low. Where columns have few vertices it may lie a
/// third too high: on a limb of needles.
fn guards(count: usize, vertices_per_column: usize) -> usize {
    if vertices_per_column < FEW_VERTICES { count / 3 + 8 } else { count / 10 + 4 }
}

#[cfg(test)]
#[path = "approximate_tests.rs"]
mod tests;
