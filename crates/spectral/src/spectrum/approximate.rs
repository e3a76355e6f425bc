//! The fast approximation of eigenproblems (thesis, chapter 2): Ritz pairs in a subspace of locally supported functions.

use super::certificate::{CertificateError, KERNEL, certify};
use super::energy::Energy;
use super::envelope::{envelop, on_all_vertices};
use super::hats;
use super::heat::{self, HeatError, HeatParameters};
use super::hidden;
use super::radial::{self, Profile, RadialError, RadialParameters};
use crate::basis::{AccuracyReport, Basis, Certificate, Compact, Functions};
use crate::operator::{EigenProblem, MeshOperator};
use chladni_algebra::{EigenError, EigenPairs, GalerkinError, SparseMatrix, SymmetricDefiniteSolver, galerkin, gpu};
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::DistanceKind;
use chladni_mesh::sample::well_spread_points;
use rayon::prelude::*;

/// The overlap of supports, `σ`: the thesis takes 7 to 10.
const SIGMA: f64 = 10.0;

/// Moves of the samples toward the centroids of their cells: three of them take 15 % off the error.
const LLOYD_MOVES: usize = 3;

/// Below this many vertices per dimension a mesh is solved exactly, in the space of all its hat functions: local functions of
/// so few vertices would be close to dependent, and the dense problem is hardly larger.
const EXACT_RATIO: f64 = 1.5;

/// How the subspace is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Space {
    /// Heat-smoothed columns.
    Heat(HeatParameters),
    /// Radial columns as they are.
    Radial(RadialParameters),
}

/// What is to be approximated, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproximationParameters {
    /// The number `m` of eigenpairs.
    pub count: usize,
    /// The dimension `d ≥ m` of the subspace. A mesh of fewer than `1.5 d` vertices is solved exactly instead, and a construction
    /// may add a function for a vertex that no other reaches.
    pub dimension: usize,
    /// How the subspace is built.
    pub space: Space,
    /// How accurate the pairs are to be; `None`: the space is taken as it is, and nothing is said.
    pub goal: Option<Goal>,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

/// What is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// The largest relative error of an eigenvalue, as estimated. The mean is to be at most a fifth of it.
    pub error: f64,
    /// How often columns may be added where it is exceeded: [`MOST_ROUNDS`], or 0 to take the space as it is and say whether it will do.
    pub rounds: usize,
}

/// Columns are added to a space at most so often: each round takes as long as the dense eigenproblem and the bounds.
pub const MOST_ROUNDS: usize = 5;

/// Why an approximation failed.
#[derive(Debug, thiserror::Error)]
pub enum ApproximationError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The radial columns could not be made.
    #[error(transparent)]
    Radial(RadialError),
    /// The columns could not be smoothed.
    #[error(transparent)]
    Heat(HeatError),
    /// The problem could not be restricted to the subspace.
    #[error(transparent)]
    Reduce(GalerkinError),
    /// The restricted eigenproblem could not be solved.
    #[error(transparent)]
    Eigen(EigenError),
    /// The pairs could not be certified.
    #[error(transparent)]
    Certificate(CertificateError),
    /// A parameter is out of its range.
    #[error("parameter {name}: {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// The refinement's factorisation failed.
    #[error("{0}")]
    Factor(String),
    /// What a factorisation needs was counted, and is more than was promised.
    #[error("{0}")]
    Memory(String),
    /// More pairs than unknowns were asked for.
    #[error("{count} eigenpairs are asked for, but there are {unknowns} unknowns")]
    Count {
        /// The pairs asked for.
        count: usize,
        /// The vertices that are not held at zero.
        unknowns: usize,
    },
}

/// Each room says `Cancelled` in its own words; here all become one.
macro_rules! cancelled_apart {
    ($($variant:ident($error:ident)),*) => {$(
        impl From<$error> for ApproximationError {
            fn from(error: $error) -> Self {
                match error {
                    $error::Cancelled(cancelled) => Self::Cancelled(cancelled),
                    other => Self::$variant(other),
                }
            }
        }
    )*};
}
cancelled_apart!(
    Radial(RadialError),
    Heat(HeatError),
    Reduce(GalerkinError),
    Eigen(EigenError),
    Certificate(CertificateError)
);

impl ApproximationError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Radial(_) | Self::Heat(_) => "subspace-failed",
            Self::Reduce(_) => "restriction-failed",
            Self::Eigen(_) => "eigenproblem-failed",
            Self::Certificate(_) => "certificate-failed",
            Self::Factor(_) => "factorisation-failed",
            Self::Memory(_) => "memory-exceeded",
            Self::Parameter { .. } | Self::Count { .. } => "invalid-parameters",
        }
    }
}

/// The mean of the estimated errors is to be at most this share of the goal, which is for the largest.
const MEAN_SHARE: f64 = 0.2;

/// Where single vertices as columns gain less than this factor, the space grows instead.
const LEAST_GAIN: f64 = 1.15;

/// So many single vertices may become columns, or as many as there are columns: a limb of a coarse mesh has hundreds.
const MANY_HATS: usize = 1200;

/// A space that is too coarse everywhere grows by this factor.
const GROWTH: f64 = 1.6;

/// A space grows to no more than this share of the unknowns: beyond it columns have too few vertices to be smooth.
const LARGEST_SHARE: f64 = 0.25;

/// Computes the lowest `m` Ritz pairs of an operator in a subspace of `d` locally supported functions.
///
/// Where the estimated error of a pair exceeds the goal, columns are added and the pairs computed again, as often as the goal allows: hat functions
/// where the residuals sit, if that is at few vertices, else a larger `d`. The certificate tells what came of it.
///
/// Stages: `sampling`, `basis`, `reduce`, `eigen`, `bounds`; the last three, or all, once more for each round. Eigenvalues ascend, are upper
/// bounds of the exact ones, and are in 1/length² of the input; eigenfunctions are orthonormal for the mass of the input. The metadata are left
/// empty. The same input and seed give the same answer, up to rounding in the dense eigenproblem where the number of threads differs.
///
/// # Errors
/// [`ApproximationError`]: a mesh without area, more pairs than vertices, a restricted problem that is not definite,
/// cancellation.
pub fn approximate(
    mesh: &TriangleMesh,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<Basis, ApproximationError> {
    let problem = &operator.problem;
    let mut parameters = *parameters;
    let (count, goal) = (parameters.count, parameters.goal.map(|goal| goal.error));
    let columns = (count + guards(count, problem.size() / parameters.dimension.max(1)))
        .min(parameters.dimension.max(count))
        .min(problem.size())
        .max(count);
    let mut attempt = Attempt::new(ritz(mesh, operator, &parameters, columns, monitor)?, count);
    monitor.stage("bounds");
    let energy = Energy::new(problem, operator.floor, monitor).map_err(CertificateError::from)?;
    attempt.judge(&energy, problem, goal, monitor)?;
    attempt.look_for_hidden(operator, goal, monitor)?;
    let mut rounds = 0;
    let mut hats_help = true;
    while let Some(goal) = goal
        && attempt.excess(goal) > 1.0
        && rounds < parameters.goal.map_or(0, |goal| goal.rounds)
    {
        let before = parameters.dimension;
        let finer = attempt.finer_space(mesh, operator, &mut parameters, goal, hats_help, monitor)?;
        // A space that lost more columns than it was given would lose the pairs as well.
        let Some(space) = finer.filter(|space| space.columns() >= count) else { break };
        rounds += 1;
        let columns = columns.min(space.columns());
        let mut next = match reduce(problem, space, columns, monitor) {
            Ok(ritz) => Attempt::new(ritz, count),
            // What was found before is good enough to be judged, and says how good.
            Err(ApproximationError::Eigen(EigenError::NotPositiveDefinite { .. })) => break,
            Err(error) => return Err(error),
        };
        monitor.stage("bounds");
        next.judge(&energy, problem, Some(goal), monitor)?;
        next.look_for_hidden(operator, Some(goal), monitor)?;
        let gained = attempt.excess(goal) / next.excess(goal);
        if gained > 1.0 {
            attempt = next;
        }
        if gained < LEAST_GAIN && parameters.dimension == before {
            // Much the same residuals would ask for much the same columns again.
            hats_help = false;
        }
    }
    let Attempt { ritz: Ritz { space, mut pairs, .. }, mut certificate, largest_estimate, hidden, .. } = attempt;
    pairs.values.truncate(count);
    pairs.vectors = pairs.vectors.slice_columns(0..count);
    for list in [&mut certificate.residuals, &mut certificate.estimates, &mut certificate.bounds] {
        list.truncate(count);
    }
    certificate.accuracy = goal.map(|goal| AccuracyReport {
        goal,
        largest_estimate,
        reached: largest_estimate <= goal && hidden == 0,
        rounds,
        dimension: space.columns(),
        hats: hats::count(&space),
    });

    // From the mesh of unit area back to the units of the input.
    let (value_scale, vector_scale) = (problem.area.recip(), problem.area.sqrt().recip());
    pairs.vectors.values_mut().iter_mut().for_each(|value| *value *= vector_scale);
    let space = match &problem.unknowns {
        Some(unknowns) => on_all_vertices(space, unknowns, mesh.positions.len()),
        None => space,
    };
    Ok(Basis {
        functions: Functions::Compact(Compact::new(space, pairs.vectors)),
        eigenvalues: pairs.values.into_iter().map(|value| value * value_scale).collect(),
        mass: operator.laplacian().mass.scaled(problem.area),
        certificate,
        metadata: serde_json::Value::Object(serde_json::Map::new()),
    })
}

/// Pairs that are computed and judged beyond those that are delivered. An eigenfunction that the space holds badly has its Ritz value among them,
/// and all pairs between lie one place too low. Where columns have few vertices it may lie a third too high: on a limb of needles.
fn guards(count: usize, vertices_per_column: usize) -> usize {
    if vertices_per_column < FEW_VERTICES { count / 3 + 8 } else { count / 10 + 4 }
}

/// Eigenfunctions on the mesh that are farther from orthonormal than this come from a dense problem that rounding has decided.
const LARGEST_DEFECT: f64 = 1e-3;

/// Columns of fewer vertices than this may be too coarse for a limb.
const FEW_VERTICES: usize = 60;

/// Pairs in one space, guards included, and how good they are.
struct Attempt {
    ritz: Ritz,
    /// The pairs without guards.
    count: usize,
    certificate: Certificate,
    /// The largest estimated relative error, the kernel apart; of a guard only where its exact value may lie among those of the pairs.
    largest_estimate: f64,
    /// The mean of them.
    mean_estimate: f64,
    /// Eigenvalues below the last pair's that no pair stands for.
    hidden: usize,
    /// Where the energy sits that the pairs miss whose error is beyond what the mean may be.
    density: Option<Vec<f64>>,
}

impl Attempt {
    fn new(ritz: Ritz, count: usize) -> Self {
        Self {
            ritz,
            count,
            certificate: Certificate::default(),
            largest_estimate: 0.0,
            mean_estimate: 0.0,
            hidden: 0,
            density: None,
        }
    }

    fn judge(
        &mut self,
        energy: &Energy<'_>,
        problem: &EigenProblem,
        goal: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), ApproximationError> {
        let Ritz { space, mass, pairs } = &mut self.ritz;
        let good = goal.map(|goal| MEAN_SHARE * goal);
        (self.certificate, self.density) =
            certify(energy, problem, space, mass, &mut pairs.vectors, &pairs.values, good, monitor)?;
        let last = self.count.checked_sub(1).and_then(|k| pairs.values.get(k)).copied().unwrap_or(f64::NEG_INFINITY);
        let (mut sum, mut summed) = (0.0, 0usize);
        self.largest_estimate = 0.0;
        for (k, (error, &value)) in self.certificate.estimates.iter().zip(&pairs.values).enumerate() {
            let error = error * problem.area;
            let relative = error / value.abs();
            if value.abs() > KERNEL && (k < self.count || value - error < last) {
                self.largest_estimate = self.largest_estimate.max(relative);
            }
            if value.abs() > KERNEL && k < self.count {
                sum += relative;
                summed += 1;
            }
        }
        self.mean_estimate = sum / summed.max(1) as f64;
        if !(self.certificate.orthonormality_defect <= LARGEST_DEFECT) {
            // Estimates are of functions of unit mass; these are not what the dense problem took them for.
            self.largest_estimate = f64::INFINITY;
        }
        Ok(())
    }

    /// Where columns may be too coarse for a limb and all seems well: whether there are eigenfunctions that the space does not know of.
    fn look_for_hidden(
        &mut self,
        operator: &MeshOperator,
        goal: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), ApproximationError> {
        let Ritz { space, mass, pairs } = &self.ritz;
        let problem = &operator.problem;
        let coarse = space.rows() / space.columns().max(1) < FEW_VERTICES;
        if !coarse || goal.is_none_or(|goal| self.excess(goal) > 1.0) {
            return Ok(());
        }
        let errors: Vec<f64> = self.certificate.estimates.iter().map(|error| error * problem.area).collect();
        let of = (problem, operator.floor);
        if let Some(hidden) = hidden::hidden(of, space, mass, (&pairs.values, &errors), self.count, monitor)? {
            self.hidden = hidden.count;
            self.density = hidden.density;
            // The last pairs stand so many places too low.
            let last = self.count.min(pairs.values.len()).saturating_sub(1);
            let (value, lower) = (pairs.values[last], pairs.values[last.saturating_sub(hidden.count)]);
            self.largest_estimate = self.largest_estimate.max((value - lower) / value.abs().max(KERNEL));
        }
        Ok(())
    }

    /// How many times as large as they may be the errors are, as estimated.
    fn excess(&self, goal: f64) -> f64 {
        let estimated = (self.largest_estimate / goal).max(self.mean_estimate / (MEAN_SHARE * goal));
        if self.hidden > 0 { estimated.max(1.0 + self.hidden as f64) } else { estimated }
    }

    /// A space that holds what this one misses; `None` where the mesh has no room for one.
    fn finer_space(
        &self,
        mesh: &TriangleMesh,
        operator: &MeshOperator,
        parameters: &mut ApproximationParameters,
        goal: f64,
        hats_help: bool,
        monitor: &dyn Monitor,
    ) -> Result<Option<SparseMatrix<f32>>, ApproximationError> {
        let problem = &operator.problem;
        let (n, space) = (problem.size(), &self.ritz.space);
        if space.columns() >= n {
            return Ok(None);
        }
        // Errors add up over what is left, here and at other pairs: aim at half of the goal.
        let left = (0.5 / self.excess(goal)).clamp(0.02, 0.3);
        let room = space.columns().max(MANY_HATS.min(n / 4)).min(n / 2);
        if hats_help
            && let Some(density) = &self.density
            && let Some(rows) = hats::where_it_sits(density, &problem.stiffness, left, room)
        {
            return Ok(Some(hats::with_hats(space, &rows)));
        }
        let wanted = (GROWTH * parameters.dimension.max(parameters.count) as f64).ceil();
        if wanted > LARGEST_SHARE * n as f64 {
            return Ok(None);
        }
        parameters.dimension = wanted as usize;
        Ok(Some(initial_space(mesh, operator, parameters, monitor)?))
    }
}

/// Ritz pairs in the space, on unit area.
pub(super) struct Ritz {
    /// `U` on the unknowns.
    pub space: SparseMatrix<f32>,
    /// `UᵀMU`.
    pub mass: SparseMatrix,
    /// Values and coefficients.
    pub pairs: EigenPairs,
}

/// Builds the space and computes the lowest `count` Ritz pairs in it.
pub(super) fn ritz(
    mesh: &TriangleMesh,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    let problem = &operator.problem;
    if count > problem.size() {
        return Err(ApproximationError::Count { count, unknowns: problem.size() });
    }
    let space = initial_space(mesh, operator, parameters, monitor)?;
    // Guards may be more than the space has.
    let count = count.min(space.columns().max(parameters.count));
    reduce(problem, space, count, monitor)
}

/// Where the mass of a space is not definite in double precision, columns this close to a combination of others are dropped, one bound after the other.
const DEPENDENT: [f64; 3] = [1e-5, 1e-4, 1e-3];

/// Rounding may change no Ritz value by more than this share of the largest.
const MOST_ROUNDING: f64 = 1e-6;

/// Whether some Ritz value is nothing but what rounding leaves of a sum of large terms: a combination of columns that all but cancel has next to no mass and
/// next to no energy, and any quotient of the two.
fn lost_to_rounding(stiffness: &SparseMatrix, pairs: &EigenPairs) -> bool {
    let largest = pairs.values.last().map_or(0.0, |value| value.abs());
    (0..pairs.values.len()).into_par_iter().any(|k| {
        let x = pairs.vectors.column(k);
        let terms: f64 = (0..stiffness.rows())
            .map(|row| {
                let (columns, values) = stiffness.row(row);
                let sum: f64 = columns.iter().zip(values).map(|(&column, s)| (s * x[column as usize]).abs()).sum();
                x[row].abs() * sum
            })
            .sum();
        4.0 * f64::EPSILON * terms > MOST_ROUNDING * largest
    })
}

/// The lowest `count` Ritz pairs in a space. Columns that depend on others are dropped.
fn reduce(
    problem: &EigenProblem,
    mut space: SparseMatrix<f32>,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    let mut tries = DEPENDENT.iter();
    loop {
        monitor.stage("reduce");
        let (stiffness, mass) = galerkin(&space, &problem.stiffness, &problem.mass, monitor)?;
        monitor.stage("eigen");
        let solved = gpu::accelerator().lowest(stiffness.to_dense(), mass.to_dense(), count, monitor);
        match &solved {
            Ok(pairs) if !lost_to_rounding(&stiffness, pairs) => {}
            Ok(_) | Err(EigenError::NotPositiveDefinite { .. }) => {
                let smaller = tries.find_map(|&least| {
                    let kept = hats::independent(&space, &mass, least);
                    (kept.columns() < space.columns()).then_some(kept)
                });
                if let Some(smaller) = smaller.filter(|smaller| smaller.columns() >= count) {
                    space = smaller;
                    continue;
                }
            }
            Err(_) => {}
        }
        return Ok(Ritz { space, mass, pairs: solved? });
    }
}

/// The space that the approximation begins with: local functions, and hat functions where those are too coarse.
fn initial_space(
    mesh: &TriangleMesh,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, ApproximationError> {
    let space = subspace(mesh, operator, parameters, monitor)?;
    let n = operator.problem.size();
    if !matches!(parameters.space, Space::Heat(_)) || space.columns() >= n {
        return Ok(space);
    }
    let d = parameters.dimension.max(parameters.count);
    let rows = hats::too_coarse(mesh, operator.laplacian(), d, d);
    let rows = match &operator.problem.unknowns {
        Some(unknowns) => unknowns.iter().map(|&v| rows[v as usize]).collect(),
        None => rows,
    };
    let chosen = rows.iter().filter(|&&chosen| chosen).count();
    if chosen == 0 {
        return Ok(space);
    }
    if (n as f64) < EXACT_RATIO * (d + chosen) as f64 && n <= 2 * d {
        return Ok(identity(n));
    }
    Ok(hats::with_hats(&space, &rows))
}

/// The space `U` of about `dimension` locally supported functions on the unknowns: its rows have the sum 1, or that of the envelope. A mesh of
/// fewer than `1.5 d` unknowns gets all its hat functions.
///
/// # Errors
/// [`ApproximationError`]: a mesh without area, or cancellation.
pub fn subspace(
    mesh: &TriangleMesh,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, ApproximationError> {
    let (n, d) = (operator.problem.size(), parameters.dimension.max(parameters.count));
    if (n as f64) < EXACT_RATIO * d as f64 {
        return Ok(identity(n));
    }
    let space = local_functions(mesh, operator.laplacian(), d, parameters, monitor)?;
    Ok(envelop(space, operator, monitor)?)
}

/// Locally supported functions on all vertices, rows with sum 1. They follow the Laplacian, whatever the operator.
fn local_functions(
    mesh: &TriangleMesh,
    laplacian: &EigenProblem,
    d: usize,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, ApproximationError> {
    monitor.stage("sampling");
    let connectivity = Connectivity::new(mesh);
    monitor.checkpoint()?;
    match &parameters.space {
        Space::Radial(radial) => Ok(radial::space(mesh, &connectivity, d, parameters.seed, radial, monitor)?),
        Space::Heat(heat) => {
            let masses = laplacian.mass.lumped();
            let samples = well_spread_points(mesh, &connectivity, &masses, d, LLOYD_MOVES, parameters.seed, monitor)?;
            monitor.stage("basis");
            // Edge paths are as good a start as fast marching where a support holds many vertices, and cheaper.
            let far = mesh.positions.len() >= DIJKSTRA_SUFFICES * d;
            let distance = if far { DistanceKind::Dijkstra } else { DistanceKind::FastMarching };
            let start = radial::columns(mesh, &connectivity, &samples, distance, Profile::Cubic, SIGMA, monitor)?;
            Ok(heat::smooth(mesh, laplacian, &connectivity, &start, heat, monitor)?)
        }
    }
}

/// From this many vertices per sample on, Dijkstra's distances start the heat steps as well as those of fast marching.
const DIJKSTRA_SUFFICES: usize = 500;

fn identity(n: usize) -> SparseMatrix<f32> {
    SparseMatrix::from_sorted_parts(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0; n])
}

#[cfg(test)]
#[path = "approximate_tests.rs"]
mod tests;
