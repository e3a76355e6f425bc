//! The Laplacian on points without faces.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, weak form, on the points |
//! | definiteness | `S` positive semi-definite, with no positive entry off the diagonal where it is robust; `M` positive definite |
//! | units | as the Laplacian by cotangents |
//! | boundary | natural (Neumann), at the rim of the points |
//! | valid for | points on or near a surface that is flat across 30 neighbours |
//! | source | Sharp and Crane 2020, *A Laplacian for Nonmanifold Triangle Meshes*, section 5.7 |
//!
//! It is a third of a Laplacian of the [local triangulations](chladni_mesh::points), which cover the surface three
//! times: of that by cotangents, or, where it is asked for or triangles are thin, of the [robust](super::robust) one,
//! as published. Both are the Laplacian of the surface by cotangents where triangles are acute and all points agree on
//! them. Where they are obtuse, the cover of the robust one flips copies of a triangle that lie on each other, and
//! eigenvalues come out lower: by 5 % on random points of a sphere, where cotangents lose .8 % (`docs/decisions/0063`).

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::points::triangulated;

use super::assembly::{Triangles, assemble_on};
use super::{Boundary, MeshOperator, OperatorError, OperatorKind, OperatorParameters, Potential};

impl OperatorParameters {
    /// Checks that the operator needs no faces.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] names what does.
    pub fn check_points(&self) -> Result<(), OperatorError> {
        let needs = match &self.operator {
            OperatorKind::Auto
            | OperatorKind::Robust
            | OperatorKind::Hamiltonian { potential: Potential::Values(_) } => None,
            OperatorKind::Polygon => Some("\"polygon\" needs faces"),
            OperatorKind::Laplace => Some("\"laplace\" needs faces as they are"),
            OperatorKind::Extrinsic { .. } => Some("\"extrinsic\" needs the normals of faces"),
            OperatorKind::Hamiltonian { potential: Potential::Curvature { .. } } => {
                Some("a potential of curvatures needs faces")
            }
            OperatorKind::Volume => Some("\"volume\" needs tetrahedra"),
            OperatorKind::Graph => Some("\"graph\" needs the edges of faces"),
            OperatorKind::Hodge => Some("\"hodge\" acts on fields of faces"),
            OperatorKind::Weighted(_) => Some("\"weighted\" has weights of faces"),
        };
        if let Some(needs) = needs {
            let reason =
                format!("{needs}, but the mesh has only points; they support \"auto\" and potentials of values");
            return Err(OperatorError::Parameter { name: "operator", reason });
        }
        if self.boundary == Boundary::Dirichlet {
            let reason = "the boundary of points without faces is not known; \"neumann\" needs none".to_owned();
            return Err(OperatorError::Parameter { name: "boundary", reason });
        }
        Ok(())
    }
}

/// The points with the triangles around each. Announces the stage `triangles`.
///
/// # Errors
/// [`OperatorError::NotFinite`] names the first point that is not; cancellation.
pub fn local_triangles(points: &TriangleMesh, monitor: &dyn Monitor) -> Result<TriangleMesh, OperatorError> {
    monitor.stage("triangles");
    if let Some(vertex) = points.positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(OperatorError::NotFinite { vertex });
    }
    triangulated(points, monitor).map_err(|cancelled: Cancelled| cancelled.into())
}

/// The operator on points with [their triangles](local_triangles). Announces the stage `operator`.
///
/// # Errors
/// [`OperatorError`]: an operator that needs faces, parameters out of range, triangles without area, cancellation.
pub fn assemble_local(
    triangles: &TriangleMesh,
    parameters: &OperatorParameters,
    monitor: &dyn Monitor,
) -> Result<MeshOperator, OperatorError> {
    parameters.check_points()?;
    assemble_on(triangles, Triangles::Local, parameters, monitor)
}

#[cfg(test)]
#[path = "points_tests.rs"]
mod tests;
