//! The Laplacian by cotangents without its matrix: rows are made where they are asked for, and let go of.
//!
//! The matrix of a surface of millions of vertices, and what it is assembled from, take several times what the surface
//! itself does. Whoever works on one part of the surface after the other needs no more of it than the rows of that
//! part. They are those of [`assemble`](super::assemble()) to the last bit.

use chladni_base::parallel::*;

use super::assembly::{check, choose, refined};
use super::corners::Corners;
use super::laplace::{Quality, power_of_two_scale, shape_of, sums};
use super::manifold::ManifoldCheck;
use super::shapes::{self, MASSLESS, Triangles, voronoi_part};
use super::{Boundary, EigenProblem, Laplacian, MassKind, MassMatrix, MeshOperator, OperatorRequest};
use super::{OperatorError, OperatorKind, OperatorParameters, OperatorReport};
use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::TriangleShape;
use chladni_mesh::points::are_points;

/// The Laplacian by cotangents on all vertices of a surface, with a lumped mass.
#[derive(Debug, Clone)]
pub struct LaplacianByRows<'a> {
    mesh: &'a TriangleMesh,
    /// The power of two that lengths are multiplied by, and the area of the mesh then.
    scale: f64,
    scaled_area: f64,
    masses: Vec<f64>,
    report: OperatorReport,
    asked: OperatorRequest,
}

impl<'a> LaplacianByRows<'a> {
    /// What [`assemble`](super::assemble()) would make of the mesh, where that is the Laplacian by cotangents of its
    /// triangles with a lumped mass and no vertex held; `None` where it is something else. Announces the stage
    /// `operator`.
    ///
    /// # Errors
    /// [`OperatorError`], as of [`assemble`](super::assemble()).
    pub fn new(
        mesh: &'a TriangleMesh,
        parameters: &OperatorParameters,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, OperatorError> {
        let of_triangles =
            matches!(parameters.operator, OperatorKind::Auto | OperatorKind::Laplace | OperatorKind::Polygon);
        if are_points(mesh) || !of_triangles || parameters.mass == MassKind::Consistent {
            return Ok(None);
        }
        monitor.stage("operator");
        check(parameters, mesh)?;
        let scale = power_of_two_scale(&mesh.positions)?;
        let corners = Corners::new(mesh.positions.len(), &mesh.faces)?;
        let found = sums(mesh, scale);
        if !(found.area.is_finite() && found.area > 0.0) {
            return Err(OperatorError::NoArea);
        }
        monitor.checkpoint()?;
        let topology = ManifoldCheck::new(mesh.positions.len(), &mesh.faces, &corners);
        drop(corners);
        monitor.checkpoint()?;
        let polygons = refined(&parameters.operator, mesh)?.is_some();
        let quality = Quality { faces: mesh.faces.len(), thin: found.thin, needles: found.needles };
        let (laplacian, reason) = choose(&parameters.operator, quality, polygons, &topology);
        let held = parameters.boundary == Boundary::Dirichlet && !topology.boundary.is_empty();
        if laplacian != Laplacian::Cotangent || polygons || held {
            return Ok(None);
        }
        let (masses, massless_vertices) = masses(mesh, scale, found.area, parameters.mass);
        let report = OperatorReport {
            laplacian,
            reason,
            non_manifold_edges: topology.non_manifold_edges,
            non_manifold_vertices: topology.non_manifold_vertices,
            thin_faces: found.thin,
            zero_area_faces: found.zero_area,
            massless_vertices,
            ..OperatorReport::default()
        };
        Ok(Some(Self { mesh, scale, scaled_area: found.area, masses, report, asked: parameters.into() }))
    }

    /// The surface.
    pub fn mesh(&self) -> &'a TriangleMesh {
        self.mesh
    }

    /// The number `n` of unknowns: all vertices.
    pub fn size(&self) -> usize {
        self.masses.len()
    }

    /// The area of the mesh in the units of the input.
    pub fn area(&self) -> f64 {
        self.scaled_area / self.scale / self.scale
    }

    /// The lumped mass of each vertex over the area.
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// The largest entry on the diagonal of the stiffness, up to rounding.
    pub fn stiffest(&self) -> f64 {
        let mut diagonal = vec![0f64; self.size()];
        for &face in &self.mesh.faces {
            let [a, b, c] = shape_of(self.mesh, face, self.scale).half_cotangents;
            let of_corners = [b + c, c + a, a + b];
            face.iter().zip(of_corners).for_each(|(&v, entry)| diagonal[v as usize] += entry);
        }
        diagonal.into_iter().fold(0.0, f64::max)
    }

    /// Some rows of the stiffness, `rows.len() × n`; `rows` ascend.
    pub fn rows(&self, rows: &[u32]) -> SparseMatrix {
        const NONE: u32 = u32::MAX;
        let mesh = self.mesh;
        let mut places = vec![NONE; self.size()];
        rows.iter().zip(0..).for_each(|(&row, place)| places[row as usize] = place);
        let touches = |face: &[u32; 3]| face.iter().any(|&v| places[v as usize] != NONE);
        let faces: Vec<[u32; 3]> = mesh.faces.par_iter().copied().filter(touches).collect();
        let shapes: Vec<TriangleShape> = faces.par_iter().map(|&face| shape_of(mesh, face, self.scale)).collect();
        let place = |v: u32| Some(places[v as usize]).filter(|&place| place != NONE);
        let corners = Corners::on_some(place, rows.len(), &faces);
        let triangles =
            Triangles { vertices: self.size(), rows: Some(rows), faces: &faces, shapes: &shapes, sheets: 1.0 };
        shapes::assemble(&triangles, &corners, self.scaled_area, MassKind::Barycentric).stiffness
    }

    /// The eigenproblem with some rows of the stiffness, ascending; all other rows of it are empty, and have no mass
    /// where `with_their_masses`.
    pub fn problem_with(&self, rows: &[u32], with_their_masses: bool) -> EigenProblem {
        let masses = match with_their_masses {
            true => {
                let mut masses = vec![0.0; self.size()];
                rows.iter().for_each(|&row| masses[row as usize] = self.masses[row as usize]);
                masses
            }
            false => self.masses.clone(),
        };
        EigenProblem {
            stiffness: spread_rows(self.rows(rows), rows, self.size()),
            mass: MassMatrix::Diagonal(masses),
            area: self.area(),
            unknowns: None,
        }
    }

    /// The operator without its matrix: all rows of the stiffness are empty.
    pub fn without_rows(&self) -> MeshOperator {
        let operator = MeshOperator::whole(self.problem_with(&[], false));
        MeshOperator { report: self.report.clone(), asked: Some(self.asked.clone()), ..operator }
    }

    /// The whole operator, as [`assemble`](super::assemble()) makes it.
    pub fn whole(&self) -> MeshOperator {
        let rows: Vec<u32> = (0..self.size() as u32).collect();
        let operator = MeshOperator::whole(self.problem_with(&rows, false));
        MeshOperator { report: self.report.clone(), asked: Some(self.asked.clone()), ..operator }
    }
}

/// A matrix with `n` rows, of which some are given, ascending, and the others empty.
pub(crate) fn spread_rows<T>(matrix: SparseMatrix<T>, rows: &[u32], n: usize) -> SparseMatrix<T> {
    let columns = matrix.columns();
    let (short, indices, values) = matrix.into_parts();
    let mut offsets = Vec::with_capacity(n + 1);
    offsets.push(0);
    for (&row, &end) in rows.iter().zip(&short[1..]) {
        offsets.resize(row as usize + 1, offsets.last().copied().unwrap_or(0));
        offsets.push(end);
    }
    offsets.resize(n + 1, offsets.last().copied().unwrap_or(0));
    SparseMatrix::from_sorted_parts(n, columns, offsets, indices, values)
}

/// The lumped masses over the area, and how many vertices have none: added up in the order of the faces, as row by row.
fn masses(mesh: &TriangleMesh, scale: f64, area: f64, kind: MassKind) -> (Vec<f64>, usize) {
    let n = mesh.positions.len();
    let mut masses = vec![0.0; n];
    for &face in &mesh.faces {
        let shape = shape_of(mesh, face, scale);
        if shape.area == 0.0 {
            continue;
        }
        for (k, &v) in face.iter().enumerate() {
            masses[v as usize] += match kind {
                MassKind::Voronoi => voronoi_part(&shape, k),
                _ => shape.area / 3.0,
            };
        }
    }
    let (per_area, least) = (1.0 / area, MASSLESS / n as f64);
    let mut massless = 0;
    for mass in &mut masses {
        *mass *= per_area;
        if *mass <= 0.0 {
            *mass = least;
            massless += 1;
        }
    }
    (masses, massless)
}

#[cfg(test)]
#[path = "by_rows_tests.rs"]
mod tests;
