//! The robust Laplacian: cotangents of the intrinsic Delaunay triangulation of the mollified tufted cover.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, weak form, on the vertices of the mesh |
//! | definiteness | `S` positive semi-definite with no positive entry off the diagonal; `M` positive definite |
//! | units | as the Laplacian by cotangents |
//! | boundary | natural (Neumann) |
//! | valid for | any triangles: non-manifold, of mixed orientation, without area |
//! | source | Sharp and Crane 2020, *A Laplacian for Nonmanifold Triangle Meshes* |
//!
//! On a closed manifold mesh that is Delaunay already it equals the Laplacian by cotangents.

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::{CoverError, IntrinsicTriangulation, Rim};

use super::corners::Corners;
use super::laplace::Measured;
use super::shapes::{self, Triangles};
use super::{EigenProblem, MassKind, OperatorError};

/// What was done to the triangles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RobustReport {
    /// What was added to the length of every edge, as a share of their mean.
    pub mollification: f64,
    /// Flips, on both sheets together.
    pub flips: usize,
    /// Whether the flips came to an end.
    pub delaunay: bool,
    /// Vertices that no proper face names.
    pub massless_vertices: usize,
}

/// Assembles the robust Laplacian on the mesh scaled to unit area. With a fixed `rim` boundary edges are not flipped.
///
/// # Errors
/// [`OperatorError`]: as the Laplacian by cotangents, and cancellation.
pub fn assemble(
    mesh: &TriangleMesh,
    mass: MassKind,
    rim: Rim,
    monitor: &dyn Monitor,
) -> Result<(EigenProblem, RobustReport), OperatorError> {
    let measured = super::laplace::measure(mesh)?;
    let (triangulation, report) = triangulate(mesh, &measured, rim, monitor)?;
    of_triangulation(mesh, &measured, &triangulation, 1.0, report, mass)
}

/// The robust Laplacian with barycentric masses, and the triangulation that it was made of, in a unit of length of its
/// own.
///
/// # Errors
/// As [`assemble`].
pub fn triangulated(
    mesh: &TriangleMesh,
    monitor: &dyn Monitor,
) -> Result<(EigenProblem, IntrinsicTriangulation), OperatorError> {
    let measured = super::laplace::measure(mesh)?;
    let (triangulation, report) = triangulate(mesh, &measured, Rim::Free, monitor)?;
    let (problem, _) = of_triangulation(mesh, &measured, &triangulation, 1.0, report, MassKind::Barycentric)?;
    Ok((problem, triangulation))
}

/// The intrinsic Delaunay triangulation, in the scaled units of `measured`.
pub(super) fn triangulate(
    mesh: &TriangleMesh,
    measured: &Measured,
    rim: Rim,
    monitor: &dyn Monitor,
) -> Result<(IntrinsicTriangulation, RobustReport), OperatorError> {
    let mut triangulation =
        IntrinsicTriangulation::tufted_cover(mesh, measured.scale, rim).map_err(|error| match error {
            CoverError::Empty => OperatorError::NoArea,
            CoverError::TooManyFaces { faces } => OperatorError::TooManyFaces { faces },
        })?;
    monitor.checkpoint()?;
    let flips = triangulation.flip_to_delaunay(monitor)?;
    let report = RobustReport {
        mollification: triangulation.mollification(),
        flips: flips.count,
        delaunay: flips.delaunay,
        massless_vertices: 0,
    };
    Ok((triangulation, report))
}

/// The problem on a triangulation in the scaled units of `measured`, of triangles that cover the surface `covers`
/// times.
pub(super) fn of_triangulation(
    mesh: &TriangleMesh,
    measured: &Measured,
    triangulation: &IntrinsicTriangulation,
    covers: f64,
    mut report: RobustReport,
    mass: MassKind,
) -> Result<(EigenProblem, RobustReport), OperatorError> {
    let vertices = mesh.positions.len();
    let corners = Corners::new(vertices, triangulation.faces())?;
    let sheets = triangulation.sheets() as f64 * covers;
    let area: f64 = triangulation.shapes().iter().map(|shape| shape.area).sum();
    let triangles =
        Triangles { vertices, rows: None, faces: triangulation.faces(), shapes: triangulation.shapes(), sheets };
    let assembled = shapes::assemble(&triangles, &corners, area, mass);
    report.massless_vertices = assembled.massless_vertices;
    let problem = EigenProblem {
        stiffness: assembled.stiffness,
        mass: assembled.mass,
        area: area / sheets / measured.scale / measured.scale,
        unknowns: None,
    };
    Ok((problem, report))
}
