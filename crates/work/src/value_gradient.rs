//! Gradients of eigenvalues and eigenfunctions, from a basis and what it was computed on.

use chladni_algebra::DenseMatrix;
use chladni_base::Monitor;
use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::mode_gradient::{LossDerivatives, mode_gradient};
use chladni_spectral::analysis::value_gradient::value_gradient;
use chladni_spectral::basis::{Basis, ProvenanceError};
use chladni_spectral::operator::MassKind;
use chladni_spectral::operator::derivative::Elements;
use serde::Deserialize;

use crate::verification::problem_of;
use crate::{JobError, MeshSize, ParameterError};

/// Which function of the eigenvalues.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"weights": [0.0, 1.0, 0.5]})))]
pub struct ValueGradientRequest {
    /// What each eigenvalue counts, from the first on: the derivatives of a loss by the eigenvalues. Those beyond the
    /// last do not count.
    #[serde(default)]
    pub weights: Vec<f64>,
}

/// Why there is no gradient.
#[derive(Debug, thiserror::Error)]
pub enum GradientFault {
    /// The basis does not say what its mass or its rows are.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    /// It cannot be computed.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    /// Derivatives do not fit the vertices.
    #[error(transparent)]
    Numbering(#[from] NumberingError),
    /// The basis does not say which operator it is of.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The operator cannot be assembled again, or the work was cancelled.
    #[error(transparent)]
    Operator(#[from] JobError),
}

/// The bytes that a gradient takes beside the basis: functions vertex after vertex, and what each element gives its
/// corners.
pub fn gradient_bytes(mesh: MeshSize) -> u64 {
    8 * (32 * mesh.vertices.max(mesh.solid_vertices) + 9 * mesh.faces + 12 * mesh.tetrahedra) as u64
}

/// The gradient of `Σ_k weights_k λ_k` by the positions of the vertices, `n × 3`, in the numbering of `to`: `∂L/∂p` of
/// a loss with `weights_k = ∂L/∂λ_k`. Values beyond the weights do not count.
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
    let (elements, mass) = made_of(basis, (mesh, solid))?;
    let mut all = vec![0.0; count];
    all[..weights.len()].copy_from_slice(weights);
    let gradient = value_gradient(basis, elements, mass, &all, monitor)?;
    Ok(translated(&gradient, to))
}

/// The gradient of a loss by the positions of the vertices, `n × 3`, in the numbering of `to`: `weights` are its
/// derivatives by the eigenvalues, from the first on, and `functions`, in the same numbering, those by the values of
/// the first eigenfunctions, a column for each.
///
/// # Errors
/// [`GradientFault`].
pub fn loss_gradient(
    basis: &Basis,
    (mesh, solid): (&TriangleMesh, Option<&TetMesh>),
    (weights, functions): (&[f64], &DenseMatrix),
    to: &Translation,
    monitor: &dyn Monitor,
) -> Result<DenseMatrix, GradientFault> {
    let of = made_of(basis, (mesh, solid))?;
    let (n, columns) = (basis.vertices(), functions.columns());
    let mut derivatives = Vec::with_capacity(n * columns);
    for column in 0..columns {
        derivatives.extend(to.push_adjoint(functions.column(column), n)?);
    }
    // Where nothing is translated, the rows may be others; that is told below.
    let rows = if to.is_identity() { functions.rows() } else { n };
    if derivatives.len() != rows * columns {
        return Err(AnalysisError::Count { what: "values of a derivative", found: rows, least: n, most: n }.into());
    }
    let derivatives = DenseMatrix::from_columns(rows, columns, derivatives);
    let problem = problem_of(basis, None)?.assemble(mesh, solid, monitor)?.problem;
    let loss = LossDerivatives { values: weights, functions: &derivatives };
    Ok(translated(&mode_gradient(basis, &problem, of, loss, monitor)?, to))
}

/// What the operator of a basis was assembled of.
fn made_of<'a>(
    basis: &Basis,
    (mesh, solid): (&'a TriangleMesh, Option<&'a TetMesh>),
) -> Result<(Elements<'a>, MassKind), GradientFault> {
    let elements = match solid {
        Some(solid) if basis.is_of_solid()? => Elements::Tetrahedra(solid),
        _ => Elements::Triangles(mesh),
    };
    Ok((elements, basis.metadata.mass()?))
}

/// A gradient as those see it who number vertices otherwise.
fn translated(gradient: &[[f64; 3]], to: &Translation) -> DenseMatrix {
    let rows = to.pull_adjoint(gradient.as_flattened(), 3);
    let mut table = DenseMatrix::zeros(rows.len() / 3, 3);
    for axis in 0..3 {
        table.column_mut(axis).iter_mut().zip(rows.iter().skip(axis).step_by(3)).for_each(|(into, x)| *into = *x);
    }
    table
}
