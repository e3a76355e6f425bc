//! Making the operator that was chosen: the Laplacian first, then what is made of it, then what is held at the
//! boundary.

use std::borrow::Cow;

use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::{IntrinsicTriangulation, Rim, TriangleShape};
use chladni_mesh::points::COVERS;

use super::curvature::Surface;
use super::laplace::{Measured, Quality};
use super::manifold::ManifoldCheck;
use super::polygon::Refined;
use super::{
    Boundary, EigenProblem, Laplacian, MeshOperator, OperatorError, OperatorKind, OperatorParameters, OperatorRequest,
};
use super::{OperatorReport, Potential, Reason};
use super::{boundary, extrinsic, graph, hamiltonian, laplace, robust, weighted};

/// What the triangles of a mesh are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Triangles {
    /// A surface.
    Surface,
    /// Those around each of some points, which cover a surface [`COVERS`] times.
    Local,
}

/// As [`assemble`](super::assemble), on given triangles.
pub(super) fn assemble_on(
    mesh: &TriangleMesh,
    triangles: Triangles,
    parameters: &OperatorParameters,
    monitor: &dyn Monitor,
) -> Result<MeshOperator, OperatorError> {
    monitor.stage("operator");
    check(parameters, mesh)?;
    if parameters.operator == OperatorKind::Graph {
        return graph::assemble(mesh, parameters);
    }
    let measured = laplace::measure(mesh)?;
    let topology = match triangles {
        Triangles::Surface => ManifoldCheck::new(mesh.positions.len(), &mesh.faces, &measured.corners),
        Triangles::Local => ManifoldCheck::default(),
    };
    monitor.checkpoint()?;
    let refined = match triangles {
        Triangles::Surface => refined(&parameters.operator, mesh)?,
        Triangles::Local => None,
    };
    let (laplacian, reason) = match triangles {
        Triangles::Surface => {
            // What is measured is what the operator would be made of.
            let of_triangles =
                || Quality { faces: mesh.faces.len(), thin: measured.thin_faces, needles: measured.needles };
            let quality = refined.as_ref().map_or_else(of_triangles, Refined::quality);
            choose(&parameters.operator, quality, refined.is_some(), &topology)
        }
        Triangles::Local => choose_local(&parameters.operator, mesh, &measured),
    };
    let mut report = OperatorReport {
        laplacian,
        reason,
        non_manifold_edges: topology.non_manifold_edges,
        non_manifold_vertices: topology.non_manifold_vertices,
        thin_faces: measured.thin_faces,
        zero_area_faces: measured.zero_area_faces,
        ..OperatorReport::default()
    };
    let dirichlet = parameters.boundary == Boundary::Dirichlet && !topology.boundary.is_empty();
    let ground = Ground { mesh, measured: &measured, triangles, parameters, dirichlet };
    let (laplacian, acts_on) = ground.laplacian(refined, &mut report, monitor)?;
    monitor.checkpoint()?;
    let whole = ground.stiffness(&laplacian, &acts_on)?.map(|stiffness| EigenProblem {
        stiffness,
        mass: laplacian.mass.clone(),
        area: laplacian.area,
        unknowns: None,
    });
    let floor = match &parameters.operator {
        OperatorKind::Hamiltonian { potential: Potential::Values(values) } => {
            laplacian.area * values.iter().copied().fold(0.0, f64::min)
        }
        _ => 0.0,
    };
    let asked = Some(OperatorRequest::from(parameters));
    let held = held(parameters, if dirichlet { &topology.boundary } else { &[] });
    if held.is_empty() {
        return Ok(match whole {
            Some(problem) => MeshOperator { problem, base: Some(laplacian), floor, report, asked },
            None => MeshOperator { problem: laplacian, base: None, floor, report, asked },
        });
    }
    report.removed_vertices = held.len();
    let problem = boundary::without(whole.as_ref().unwrap_or(&laplacian), &held)?;
    Ok(MeshOperator { problem, base: Some(laplacian), floor, report, asked })
}

/// Refuses parameters that are out of range, do not fit the mesh, or are of no operator on functions on a surface.
pub(super) fn check(parameters: &OperatorParameters, mesh: &TriangleMesh) -> Result<(), OperatorError> {
    parameters.check()?;
    parameters.check_mesh(mesh.positions.len())?;
    let reason = match &parameters.operator {
        OperatorKind::Weighted(parts) => return parts.check_mesh(mesh.positions.len(), mesh.faces.len()),
        OperatorKind::Hodge => "\"hodge\" acts on tangential fields, not on functions",
        OperatorKind::Volume => "\"volume\" acts on the tetrahedra of a solid, not on a surface",
        _ => return Ok(()),
    };
    Err(OperatorError::Parameter { name: "operator", reason: reason.to_owned() })
}

/// The vertices whose values are held at zero, ascending: those of the boundary that are, and what the parts of an
/// operator fix.
fn held(parameters: &OperatorParameters, boundary: &[u32]) -> Vec<u32> {
    let mut held = boundary.to_vec();
    if let OperatorKind::Weighted(parts) = &parameters.operator {
        held.extend(&parts.fixed);
        held.sort_unstable();
        held.dedup();
    }
    held
}

/// What an operator is made on.
struct Ground<'a> {
    mesh: &'a TriangleMesh,
    measured: &'a Measured,
    triangles: Triangles,
    parameters: &'a OperatorParameters,
    /// Whether there is a boundary that is held.
    dirichlet: bool,
}

/// The triangles that a Laplacian acts on.
enum ActsOn {
    /// Those of the mesh.
    Mesh,
    /// Those of a mesh with a point in the middle of each polygon.
    Polygons(Refined),
    /// Those of an intrinsic triangulation.
    Intrinsic(IntrinsicTriangulation),
}

impl Ground<'_> {
    /// The Laplacian that the report names, with what the report is to tell of it.
    fn laplacian(
        &self,
        refined: Option<Refined>,
        report: &mut OperatorReport,
        monitor: &dyn Monitor,
    ) -> Result<(EigenProblem, ActsOn), OperatorError> {
        let Self { mesh, measured, triangles, parameters, dirichlet } = *self;
        let covers = match triangles {
            Triangles::Surface => 1.0,
            Triangles::Local => COVERS,
        };
        match report.laplacian {
            // The last two act on no triangles, and were made or refused before.
            Laplacian::Cotangent | Laplacian::Volume | Laplacian::Graph => {
                let (problem, massless) = laplace::cotangent(mesh, measured, covers, parameters.mass);
                report.massless_vertices = massless;
                Ok((problem, ActsOn::Mesh))
            }
            Laplacian::Polygon => {
                let refined = refined.ok_or(OperatorError::NoArea)?;
                let (problem, massless) = refined.problem(parameters.mass);
                report.massless_vertices = massless;
                report.polygons = refined.polygons();
                report.thin_faces = refined.quality().thin;
                report.zero_area_faces = refined.measured.zero_area_faces;
                Ok((problem, ActsOn::Polygons(refined)))
            }
            Laplacian::Robust => {
                let rim = if dirichlet { Rim::Fixed } else { Rim::Free };
                let (triangulation, found) = robust::triangulate(mesh, measured, rim, monitor)?;
                let (problem, found) =
                    robust::of_triangulation(mesh, measured, &triangulation, covers, found, parameters.mass)?;
                report.mollification = found.mollification;
                report.flips = found.flips;
                report.delaunay = found.delaunay;
                report.massless_vertices = found.massless_vertices;
                Ok((problem, ActsOn::Intrinsic(triangulation)))
            }
        }
    }

    /// The stiffness of an operator that is more than its Laplacian.
    fn stiffness(&self, laplacian: &EigenProblem, acts_on: &ActsOn) -> Result<Option<SparseMatrix>, OperatorError> {
        let Self { mesh, measured, parameters, .. } = *self;
        let (faces, shapes): (_, &[TriangleShape]) = match acts_on {
            ActsOn::Mesh | ActsOn::Polygons(_) => (&mesh.faces[..], &measured.shapes),
            ActsOn::Intrinsic(triangulation) => (triangulation.faces(), triangulation.shapes()),
        };
        Ok(match &parameters.operator {
            OperatorKind::Auto
            | OperatorKind::Laplace
            | OperatorKind::Polygon
            | OperatorKind::Robust
            | OperatorKind::Hodge
            | OperatorKind::Volume
            | OperatorKind::Graph => None,
            OperatorKind::Weighted(parts) => Some(weighted::stiffness(laplacian, mesh, shapes, measured.scale, parts)),
            OperatorKind::Extrinsic { t } => {
                let normals = match acts_on {
                    ActsOn::Polygons(refined) => refined.normals(),
                    _ => Surface::new(mesh, measured).normals(&measured.corners),
                };
                Some(extrinsic::blend(&laplacian.stiffness, &normals, *t))
            }
            OperatorKind::Hamiltonian { potential } => {
                let scaled = hamiltonian::scaled(laplacian, &self.potential(potential, laplacian.area, acts_on))?;
                Some(match acts_on {
                    ActsOn::Polygons(refined) => refined.with_potential(laplacian, &scaled),
                    _ => hamiltonian::add_potential(laplacian, faces, shapes, &scaled),
                })
            }
        })
    }

    /// The values of a potential at the vertices; `area` is that of the mesh.
    fn potential<'p>(&self, potential: &'p Potential, area: f64, acts_on: &ActsOn) -> Cow<'p, [f64]> {
        let t = match potential {
            Potential::Values(values) => return Cow::Borrowed(values),
            Potential::Curvature { t } => t,
        };
        let squares = match acts_on {
            ActsOn::Polygons(refined) => refined.squared_curvatures(),
            _ => Surface::new(self.mesh, self.measured).curvatures(&self.measured.corners).squares(),
        };
        let most = hamiltonian::LARGEST / area;
        squares.iter().map(|square| (t * square).min(most)).collect()
    }
}

/// The finer mesh that the Laplacian of polygons is made of, where that may be taken and there are any.
pub(super) fn refined(wanted: &OperatorKind, mesh: &TriangleMesh) -> Result<Option<Refined>, OperatorError> {
    // The Hodge–Laplacian and weights are of faces.
    let takes = matches!(
        wanted,
        OperatorKind::Auto | OperatorKind::Polygon | OperatorKind::Extrinsic { .. } | OperatorKind::Hamiltonian { .. }
    );
    if takes { Refined::of(mesh) } else { Ok(None) }
}

/// From this many faces in a thousand on, thin ones call for the robust Laplacian.
const THIN_PER_MILLE: usize = 1;

/// Which Laplacian to take on local triangulations: cotangents, unless the robust one is asked for or some triangles
/// are thin.
fn choose_local(wanted: &OperatorKind, mesh: &TriangleMesh, measured: &Measured) -> (Laplacian, Reason) {
    if *wanted == OperatorKind::Robust {
        return (Laplacian::Robust, Reason::Requested);
    }
    if 1000 * measured.thin_faces > THIN_PER_MILLE * mesh.faces.len() {
        (Laplacian::Robust, Reason::ThinFaces)
    } else if measured.needles > 0 {
        (Laplacian::Robust, Reason::Needle)
    } else {
        (Laplacian::Cotangent, Reason::Points)
    }
}

/// Which Laplacian to take.
pub(super) fn choose(
    wanted: &OperatorKind,
    quality: Quality,
    polygons: bool,
    topology: &ManifoldCheck,
) -> (Laplacian, Reason) {
    match wanted {
        OperatorKind::Polygon if polygons => (Laplacian::Polygon, Reason::Requested),
        OperatorKind::Polygon => (Laplacian::Cotangent, Reason::Requested),
        OperatorKind::Laplace | OperatorKind::Weighted(_) => (Laplacian::Cotangent, Reason::Requested),
        OperatorKind::Robust => (Laplacian::Robust, Reason::Requested),
        OperatorKind::Auto
        | OperatorKind::Extrinsic { .. }
        | OperatorKind::Hamiltonian { .. }
        | OperatorKind::Hodge
        | OperatorKind::Volume
        | OperatorKind::Graph => {
            if topology.non_manifold_edges + topology.non_manifold_vertices > 0 {
                (Laplacian::Robust, Reason::NonManifold)
            } else if 1000 * quality.thin > THIN_PER_MILLE * quality.faces {
                (Laplacian::Robust, Reason::ThinFaces)
            } else if quality.needles > 0 {
                (Laplacian::Robust, Reason::Needle)
            } else if polygons {
                (Laplacian::Polygon, Reason::Polygons)
            } else {
                (Laplacian::Cotangent, Reason::FairMesh)
            }
        }
    }
}
