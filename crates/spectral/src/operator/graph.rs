//! The combinatorial Laplacian: vertices joined by edges of weight 1, wherever they lie.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, `D − A` with the degrees `D` and the adjacency `A`; the mass is the identity |
//! | definiteness | positive semi-definite, its kernel the functions constant on each component |
//! | units | none |
//! | boundary | none to speak of |
//! | valid for | any faces; who has the connectivity, but no positions, computes the same |
//! | source | Taubin 1995; Karni and Gotsman 2000 for compression |

use chladni_algebra::SparseMatrix;
use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;

use super::choice::{Laplacian, OperatorParameters, OperatorReport, Reason};
use super::corners::Corners;
use super::{Boundary, EigenProblem, MassKind, MassMatrix, MeshOperator, OperatorError, OperatorRequest};

/// Assembles the operator. Positions are not looked at.
///
/// # Errors
/// [`OperatorError::Parameter`] for a mass or boundary condition that a graph does not have.
pub(super) fn assemble(mesh: &TriangleMesh, parameters: &OperatorParameters) -> Result<MeshOperator, OperatorError> {
    check(parameters)?;
    // For its errors: faces that refer to vertices that are not there.
    Corners::new(mesh.positions.len(), &mesh.faces)?;
    let connectivity = Connectivity::new(mesh);
    let n = mesh.positions.len();
    let mut offsets = Vec::with_capacity(n + 1);
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    offsets.push(0);
    for v in 0..n as u32 {
        // A face that repeats a vertex joins it to itself.
        let ring: Vec<u32> = connectivity.neighbours(v).0.iter().copied().filter(|&other| other != v).collect();
        let before = ring.partition_point(|&other| other < v);
        indices.extend_from_slice(&ring[..before]);
        indices.push(v);
        indices.extend_from_slice(&ring[before..]);
        values.extend((0..=ring.len()).map(|at| if at == before { ring.len() as f64 } else { -1.0 }));
        offsets.push(indices.len());
    }
    let problem = EigenProblem {
        stiffness: SparseMatrix::from_sorted_parts(n, n, offsets, indices, values),
        mass: MassMatrix::Diagonal(vec![1.0 / n as f64; n]),
        area: n as f64,
        unknowns: None,
    };
    let report = OperatorReport { laplacian: Laplacian::Graph, reason: Reason::Requested, ..OperatorReport::default() };
    let asked = OperatorRequest::from(parameters);
    MeshOperator::of_problem(problem, None, report, Some(asked))
}

/// Refuses what a graph does not have.
///
/// # Errors
/// [`OperatorError::Parameter`] names the mass or the boundary condition.
pub fn check(parameters: &OperatorParameters) -> Result<(), OperatorError> {
    let refused = |name, reason: &str| Err(OperatorError::Parameter { name, reason: reason.to_owned() });
    if parameters.mass != MassKind::Barycentric {
        return refused("mass", "the operator \"graph\" weighs every vertex alike");
    }
    if parameters.boundary != Boundary::Neumann {
        return refused("boundary", "the operator \"graph\" knows no boundary");
    }
    Ok(())
}
