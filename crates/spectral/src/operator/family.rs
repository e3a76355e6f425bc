//! The members of a family of operators: the Laplacian `S`, its extrinsic kin `A` and the curvature potential `V`
//! (thesis, eq. 2.13 and appendix 4.C). Every operator `(1 − t) S + t A + v V` is one of them.

use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;

use super::curvature::curvatures;
use super::polygon::Refined;
use super::{Laplacian, MassMatrix, MeshOperator, OperatorError, OperatorParameters, assemble, extrinsic};

/// What a family is made of, on the mesh scaled to unit area, natural boundary, lumped mass.
#[derive(Debug, Clone, PartialEq)]
pub struct FamilyOperators {
    /// `S` and `M`.
    pub laplacian: MeshOperator,
    /// `A`, with `A_ij = ⟨N_i, N_j⟩ S_ij`.
    pub extrinsic: SparseMatrix,
    /// `V`: the mass weighted by `κ₁² + κ₂²`.
    pub curvature: MassMatrix,
}

/// The largest curvature potential over the inverse area, as for a single Hamiltonian.
const LARGEST: f64 = 1e12;

/// Makes the members of the family of a mesh. Announces the stage `operator`.
///
/// # Errors
/// [`OperatorError`], as [`assemble`].
pub fn family(mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<FamilyOperators, OperatorError> {
    let laplacian = assemble(mesh, &OperatorParameters::default(), monitor)?;
    let refined = if laplacian.report.laplacian == Laplacian::Polygon { Refined::of(mesh)? } else { None };
    let (normals, squares) = match refined {
        Some(refined) => (refined.normals(), refined.squared_curvatures()),
        None => {
            let surface = curvatures(mesh)?;
            let squares = surface.squares();
            (surface.normals, squares)
        }
    };
    monitor.checkpoint()?;
    let problem = &laplacian.problem;
    let extrinsic = extrinsic::blend(&problem.stiffness, &normals, 1.0);
    let mass = problem.mass.lumped();
    let weighted = squares.iter().zip(&mass).map(|(square, m)| (square * problem.area).min(LARGEST) * m);
    let curvature = MassMatrix::Diagonal(weighted.collect());
    Ok(FamilyOperators { laplacian, extrinsic, curvature })
}
