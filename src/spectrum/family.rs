//! Restricting a family of operators to one subspace.

use rayon::prelude::*;

use super::{ApproximationError, ApproximationParameters, subspace};
use crate::algebra::{CpuSolver, DenseMatrix, MassMatrix, SparseMatrix, SymmetricDefiniteSolver, galerkin};
use crate::basis::family::FamilyBasis;
use crate::mesh::TriangleMesh;
use crate::monitor::Monitor;
use crate::operator::{FamilyOperators, MeshOperator};

/// Restricts the Laplacian, the extrinsic operator and the curvature potential to a space of local functions of the Laplacian; `count` of
/// the parameters means nothing. The metadata are left empty.
///
/// Stages: `sampling`, `basis`, `reduce`, `eigen`.
///
/// # Errors
/// [`ApproximationError`], as [`approximate`](super::approximate).
pub fn restrict_family(
    mesh: &TriangleMesh,
    operators: &FamilyOperators,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<FamilyBasis, ApproximationError> {
    let laplacian: &MeshOperator = &operators.laplacian;
    let problem = &laplacian.problem;
    let space = subspace(mesh, laplacian, parameters, monitor)?;
    monitor.stage("reduce");
    let (stiffness, mass) = galerkin(&space, &problem.stiffness, &problem.mass, monitor)?;
    monitor.progress(0.5);
    // Both further operators at once: the potential takes the place of the mass.
    let (extrinsic, curvature) = galerkin(&space, &operators.extrinsic, &operators.curvature, monitor)?;
    monitor.stage("eigen");
    let d = space.columns();
    let pairs = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), d, monitor)?;
    let scale = problem.area.recip();
    let turned = |matrix: &SparseMatrix| -> DenseMatrix {
        let image = matrix.multiply_dense(&pairs.vectors).and_then(|image| pairs.vectors.transposed_times(&image));
        let mut turned = image.unwrap_or_else(|| DenseMatrix::zeros(d, d));
        turned.values_mut().par_iter_mut().for_each(|x| *x *= scale);
        symmetrised(turned)
    };
    let (extrinsic, curvature) = (turned(&extrinsic), turned(&curvature));
    monitor.checkpoint()?;
    let mut coefficients = pairs.vectors;
    let length = problem.area.sqrt().recip();
    coefficients.values_mut().iter_mut().for_each(|value| *value *= length);
    Ok(FamilyBasis {
        space,
        coefficients,
        eigenvalues: pairs.values.into_iter().map(|value| value * scale).collect(),
        extrinsic,
        curvature,
        mass: MassMatrix::Diagonal(problem.mass.scaled(problem.area).lumped()),
        metadata: serde_json::Value::Object(serde_json::Map::new()),
    })
}

fn symmetrised(mut matrix: DenseMatrix) -> DenseMatrix {
    for column in 0..matrix.columns() {
        for row in column + 1..matrix.rows() {
            let mean = 0.5 * (matrix.column(column)[row] + matrix.column(row)[column]);
            matrix.column_mut(column)[row] = mean;
            matrix.column_mut(row)[column] = mean;
        }
    }
    matrix
}
