//! Gradients of eigenvalues, from a basis and what it was computed on.

use chladni_algebra::DenseMatrix;
use chladni_base::Monitor;
use chladni_mesh::numbering::Translation;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::value_gradient::value_gradient;
use chladni_spectral::basis::Basis;
use chladni_spectral::operator::MassKind;
use chladni_spectral::operator::derivative::Elements;
use serde::Deserialize;

use crate::{MeshSize, Provenance, ProvenanceError};

/// Why there is no gradient.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GradientFault {
    /// The basis does not say what its mass is.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    /// It cannot be computed.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
}

/// The bytes that a gradient takes beside the basis: functions vertex after vertex, and what each element gives its corners.
pub fn gradient_bytes(mesh: MeshSize) -> u64 {
    8 * (32 * mesh.vertices.max(mesh.solid_vertices) + 9 * mesh.faces + 12 * mesh.tetrahedra) as u64
}

/// The gradient of `Σ_k weights_k λ_k` by the positions of the vertices, `n × 3`, in the numbering of `to`: `∂L/∂p` of a loss with `weights_k = ∂L/∂λ_k`. Values beyond the weights do
/// not count.
///
/// # Errors
/// [`GradientFault`].
pub fn gradient(
    basis: &Basis,
    (mesh, solid): (&TriangleMesh, Option<&TetMesh>),
    weights: &[f64],
    to: &Translation,
    monitor: &dyn Monitor,
) -> Result<DenseMatrix, GradientFault> {
    let count = basis.count();
    if weights.is_empty() || weights.len() > count {
        return Err(AnalysisError::Count { what: "weights", found: weights.len(), least: 1, most: count }.into());
    }
    let mass = Provenance::read(&basis.metadata)?.parameters.get("mass").map(MassKind::deserialize);
    let mass = mass.and_then(Result::ok).ok_or(ProvenanceError::Parameter { name: "mass" })?;
    let elements = match solid.filter(|_| basis.is_of_solid()) {
        Some(solid) => Elements::Tetrahedra(solid),
        None => Elements::Triangles(mesh),
    };
    let mut all = vec![0.0; count];
    all[..weights.len()].copy_from_slice(weights);
    let gradient = value_gradient(basis, elements, mass, &all, monitor)?;
    let rows = to.pull_adjoint(gradient.as_flattened(), 3);
    let mut table = DenseMatrix::zeros(rows.len() / 3, 3);
    for axis in 0..3 {
        table.column_mut(axis).iter_mut().zip(rows.iter().skip(axis).step_by(3)).for_each(|(into, x)| *into = *x);
    }
    Ok(table)
}
