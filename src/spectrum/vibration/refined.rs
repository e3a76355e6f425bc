//! A refinement of approximate modes: inverse iterations on the mesh, then Ritz pairs of what they give. What stiffens a mode in the space of
//! local functions, stretching where it should bend, are high modes; an inverse iteration damps them by the ratio of eigenvalues.

use super::approximate::{Ritz, threefold};
use super::exact::apart_from_rigid;
use super::{ElasticProblem, Found, FoundFunctions, Monitor, RigidMotions, VibrationError};
use crate::algebra::{DenseMatrix, PanelMatrix, SparseMatrix, SymmetricDefiniteSolver, gpu};
use crate::monitor::Quiet;
use crate::spectrum::refine::inverse_iterations;

/// Columns beyond the wanted ones that are refined with them.
pub(super) fn guards(wanted: usize) -> usize {
    8 + wanted / 4
}

/// The lowest `wanted` modes after so many inverse iterations of those of the space. Dense; nothing proves that none is missing.
pub(super) fn modes(
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    (space, ritz): (&SparseMatrix<f32>, Ritz),
    wanted: usize,
    iterations: usize,
    monitor: &dyn Monitor,
) -> Result<Found, VibrationError> {
    let (values, vectors) = pairs(elastic, rigid, (space, ritz), wanted, iterations, monitor)?;
    Ok(Found {
        rigid: DenseMatrix::zeros(rigid.motions.len(), values.len()),
        values,
        functions: FoundFunctions::Dense(vectors),
        certificate: serde_json::Value::Null,
    })
}

/// The same as values and columns, orthonormal and orthogonal to the rigid motions; at most `wanted`.
pub(super) fn pairs(
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    (space, ritz): (&SparseMatrix<f32>, Ritz),
    wanted: usize,
    iterations: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, PanelMatrix), VibrationError> {
    monitor.stage("refine");
    let problem = &elastic.problem;
    let accelerator = gpu::accelerator();
    let mut vectors = accelerator.lift(&threefold(space), &ritz.coefficients, monitor)?;
    apart_from_rigid(elastic, rigid, &mut vectors, monitor)?;
    if vectors.columns() > 0 {
        vectors = inverse_iterations(problem, vectors, &ritz.values, iterations, monitor)?;
        apart_from_rigid(elastic, rigid, &mut vectors, monitor)?;
    }
    let count = wanted.min(vectors.columns());
    let (stiffness, gram, resident) = accelerator.restrict(&problem.stiffness, &problem.mass, &vectors, monitor)?;
    let pairs = accelerator.lowest(stiffness, gram, count, &Quiet(monitor))?;
    accelerator.rotate(&mut vectors, resident, &pairs.vectors, monitor)?;
    Ok((pairs.values, vectors))
}
