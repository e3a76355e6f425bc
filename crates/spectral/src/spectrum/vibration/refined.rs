//! A refinement of approximate modes: inverse iterations on the mesh, each followed by Ritz pairs of what it gives.
//! What stiffens a mode in the space of local functions, stretching where it should bend, are high modes; an inverse
//! iteration damps them by the ratio of eigenvalues.
//!
//! How far a frequency still is from that of the mesh is estimated from its last change. An iteration multiplies what a
//! mode holds of others by `(λ + σ) / (μ + σ)` at most, where `μ` is the highest value that the columns hold, and so
//! the error of its eigenvalue by the square `ρ` of that: after a change of `δ` about `δ ρ / (1 − ρ)` is left. The
//! highest guards are far too high themselves, so `μ` is taken from the middle of the guards. A change does not see
//! what no column holds: eigenvalues are counted for that, in [`super::lacking`].

use chladni_algebra::{DenseMatrix, PanelMatrix, SparseMatrix, SymmetricDefiniteSolver, gpu};
use chladni_base::Quiet;
use chladni_base::SplitMix64;

use super::approximate::{Ritz, threefold};
use super::exact::apart_from_rigid;
use super::{ElasticProblem, FoundFunctions, Iterations, Monitor, NonrigidModes, RigidMotions, VibrationError};
use crate::spectrum::refine::{Ordered, inverse_iterations_until};

/// Columns beyond the wanted ones that are refined with them.
pub(super) fn guards(wanted: usize) -> usize {
    8 + wanted / 2
}

/// Random columns beside those of the space: a mode that the space lacks altogether is in them.
const RANDOM: usize = 8;

/// The fewest and the most iterations where an error has to be reached: what only the random columns hold takes three
/// to show in the values.
const FEWEST_ITERATIONS: usize = 3;
const MOST_ITERATIONS: usize = 10;

/// An iteration counts as damping an error by this factor at best: what its columns lack altogether, no ratio of their
/// values tells of.
const LEAST_DAMPING: f64 = 0.2;

/// Modes, and how far they may be from those of the mesh.
#[derive(Default)]
pub(super) struct Refined {
    /// Ascending.
    pub values: Vec<f64>,
    /// Orthonormal, and orthogonal to the rigid motions.
    pub vectors: PanelMatrix,
    /// The estimated relative error of each frequency.
    pub errors: Vec<f64>,
    /// Iterations that were made.
    pub iterations: usize,
    /// The value and the estimated error of the first guard.
    pub beyond: Option<(f64, f64)>,
    /// What eigenvalues are counted by.
    pub counter: Option<Ordered>,
}

impl Refined {
    /// The largest estimated error.
    pub fn largest_error(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }

    /// With what is known of the errors; nothing proves that no mode is missing.
    pub fn into_found(self, rigid: &RigidMotions) -> NonrigidModes {
        let certificate = serde_json::json!({
            "complete": false,
            "inertia": [],
            "lacking": 0,
            "inverse_iterations": self.iterations,
            "estimated_error": self.largest_error(),
            "estimated_errors": self.errors,
        });
        NonrigidModes {
            rigid: DenseMatrix::zeros(rigid.motions.len(), self.values.len()),
            values: self.values,
            functions: FoundFunctions::Dense(self.vectors),
            certificate,
        }
    }
}

/// The lowest `wanted` modes after inverse iterations of those of the space, at most as many as there are.
pub(super) fn modes(
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    (space, ritz): (&SparseMatrix<f32>, Ritz),
    wanted: usize,
    iterations: Iterations,
    monitor: &dyn Monitor,
) -> Result<Refined, VibrationError> {
    monitor.stage("refine");
    let problem = &elastic.problem;
    let accelerator = gpu::accelerator();
    let mut vectors = accelerator.lift(&threefold(space), &ritz.coefficients, monitor)?;
    let count = wanted.min(vectors.columns());
    if count > 0 && count + RANDOM <= problem.size() / 2 {
        add_random(&mut vectors);
    }
    apart_from_rigid(elastic, rigid, &mut vectors, monitor)?;
    let mut refined = Refined { values: ritz.values, ..Refined::default() };
    if count > 0 {
        let start = refined.values.clone();
        let ordered;
        (vectors, ordered) =
            inverse_iterations_until(problem, vectors, &start, monitor, |done, mut vectors, shift| {
                apart_from_rigid(elastic, rigid, &mut vectors, monitor)?;
                let (stiffness, gram, resident) =
                    accelerator.restrict(&problem.stiffness, &problem.mass, &vectors, monitor)?;
                let columns = vectors.columns();
                let pairs = accelerator.lowest(stiffness, gram, columns, &Quiet(monitor))?;
                accelerator.rotate(&mut vectors, resident, &pairs.vectors, monitor)?;
                let highest = pairs.values[(count + columns - 1 - RANDOM.min(columns - count)) / 2] + shift;
                let error = |k: usize| {
                    let damping = ((pairs.values[k] + shift) / highest).powi(2).max(LEAST_DAMPING);
                    let change = (refined.values[k] - pairs.values[k]).max(0.0);
                    // Of a frequency, half of that of its square.
                    0.5 * change / pairs.values[k].max(f64::MIN_POSITIVE) * damping / (1.0 - damping).max(1e-3)
                };
                refined.errors = (0..count).map(error).collect();
                refined.beyond = (count < columns - RANDOM.min(columns)).then(|| (pairs.values[count], error(count)));
                (refined.values, refined.iterations) = (pairs.values, done);
                let enough = match iterations {
                    Iterations::Exactly(most) => done >= most,
                    Iterations::Until(most) => {
                        done == MOST_ITERATIONS
                            || done >= FEWEST_ITERATIONS && refined.errors.iter().all(|&error| error <= most)
                    }
                };
                Ok::<_, VibrationError>((vectors, enough))
            })?;
        refined.counter = Some(ordered);
    }
    vectors.keep_columns(count);
    refined.values.truncate(count);
    refined.vectors = vectors;
    Ok(refined)
}

/// Appends [`RANDOM`] columns of random numbers.
fn add_random(vectors: &mut PanelMatrix) {
    let (mut random, first) = (SplitMix64::new(0x5eed), vectors.columns());
    vectors.widen(first + RANDOM);
    let mut columns = DenseMatrix::zeros(vectors.rows(), RANDOM);
    columns.values_mut().iter_mut().for_each(|x| *x = random.signed_unit());
    vectors.assign(&(first..first + RANDOM).collect::<Vec<_>>(), &PanelMatrix::from_dense(&columns));
}
