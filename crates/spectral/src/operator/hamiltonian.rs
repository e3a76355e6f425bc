//! The Hamiltonian: the Laplacian plus a potential.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, `S + M_V`, `M_V` the mass weighted by the potential `V` |
//! | definiteness | positive semi-definite for `V ≥ 0`, without a kernel where no component has `V = 0` throughout; a negative `V` may give negative eigenvalues, none below its least value (for lumped masses) |
//! | units | `V` and the eigenvalues 1/length² |
//! | mass | lumped: `V_i M_ii`; consistent: the exact integral of `V φ_i φ_j`, all three piecewise linear |
//! | source | thesis, appendix 4.C; Choukroun et al. 2020 |

use chladni_algebra::SparseMatrix;
use chladni_mesh::intrinsic::TriangleShape;

use crate::operator::{EigenProblem, MassMatrix, OperatorError};

/// Values beyond this times the inverse area drown the Laplacian in rounding errors.
pub(super) const LARGEST: f64 = 1e12;

/// A potential in 1/length² of the input as it is on unit area.
///
/// # Errors
/// [`OperatorError::Parameter`] names the first vertex whose value is too large for the size of the mesh.
pub(super) fn scaled(problem: &EigenProblem, potential: &[f64]) -> Result<Vec<f64>, OperatorError> {
    let scaled: Vec<f64> = potential.iter().map(|v| v * problem.area).collect();
    if let Some(vertex) = scaled.iter().position(|v| !(v.abs() <= LARGEST)) {
        return Err(OperatorError::Parameter {
            name: "operator.hamiltonian.potential",
            reason: format!(
                "times the area of the mesh, values may have a magnitude of at most {LARGEST:e}; that of vertex {vertex} has {:e}",
                scaled[vertex].abs()
            ),
        });
    }
    Ok(scaled)
}

/// Adds a potential, one value for each row on unit area, to the stiffness of `problem`.
///
/// `faces` and `shapes` are the triangles that a consistent mass was made of.
pub(super) fn add_potential(
    problem: &EigenProblem,
    faces: &[[u32; 3]],
    shapes: &[TriangleShape],
    scaled: &[f64],
) -> SparseMatrix {
    let stiffness = &problem.stiffness;
    let mut values = stiffness.values().to_vec();
    let place = |row: u32, column: u32| {
        let start = stiffness.offsets()[row as usize];
        stiffness.row(row as usize).0.binary_search(&column).ok().map(|at| start + at)
    };
    match &problem.mass {
        MassMatrix::Diagonal(mass) => {
            for (row, (m, v)) in mass.iter().zip(scaled).enumerate() {
                if let Some(at) = place(row as u32, row as u32) {
                    values[at] += m * v;
                }
            }
        }
        MassMatrix::Sparse(_) | MassMatrix::Weighted(_) => {
            let area: f64 = shapes.iter().map(|shape| shape.area).sum();
            for (face, shape) in faces.iter().zip(shapes).filter(|(_, shape)| shape.area > 0.0) {
                let v = face.map(|i| scaled[i as usize]);
                let unit = shape.area / area / 60.0;
                let sum = v[0] + v[1] + v[2];
                for i in 0..3 {
                    for j in 0..3 {
                        // ∫ φ_i² φ_k is A/10 for k = i and A/30 otherwise; ∫ φ_i φ_j φ_k is A/30 for k = i or j and
                        // A/60 otherwise.
                        let weight = if i == j { 2.0 * sum + 4.0 * v[i] } else { sum + (v[i] + v[j]) };
                        if let Some(at) = place(face[i], face[j]) {
                            values[at] += unit * weight;
                        }
                    }
                }
            }
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
