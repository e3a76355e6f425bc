//! The Laplacian on the tetrahedra of a solid: linear elements.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, weak form; strong form `M⁻¹S` |
//! | definiteness | `S` positive semi-definite, its kernel the functions constant on each component; `M` positive definite |
//! | units | `S` length, as in the input; `M` volume, over the whole volume here; eigenvalues 1/length² |
//! | boundary | natural (Neumann) on the triangles that one tetrahedron has alone; Dirichlet takes their vertices out |
//! | valid for | any tetrahedra, in either orientation; flat ones contribute nothing |
//! | source | linear finite elements: for the edge `ij` of a tetrahedron `−(1/6) l cot θ`, with the length `l` of the opposite edge and the dihedral angle `θ` at it |

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;
use chladni_base::{Monitor, Vector3};
use chladni_mesh::TetMesh;
use chladni_mesh::solid::surface;

use super::choice::{Laplacian, OperatorReport, Reason};
use super::laplace::{MASSLESS, power_of_two_scale};
use super::{Boundary, EigenProblem, MassKind, MassMatrix, MeshOperator, OperatorError, OperatorKind, OperatorRequest};

/// A tetrahedron whose volume is at most this share of that of a cube over its longest edge is flat.
const FLAT: f64 = 1e-9;

/// Rows that one task assembles. Fixed, so that results do not depend on the number of threads.
const ROWS_PER_TASK: usize = 2048;

/// Assembles the operator of a solid; its rows are all vertices, those on the boundary first where the solid was
/// checked. Announces the stage `operator`.
///
/// # Errors
/// [`OperatorError`]: a Voronoi mass, a vertex out of range or not finite, a solid without volume or unknowns,
/// cancellation.
pub fn assemble(
    solid: &TetMesh,
    mass: MassKind,
    boundary: Boundary,
    monitor: &dyn Monitor,
) -> Result<MeshOperator, OperatorError> {
    monitor.stage("operator");
    if mass == MassKind::Voronoi {
        let reason = "the operator \"volume\" supports the masses \"barycentric\" and \"consistent\"".to_owned();
        return Err(OperatorError::Parameter { name: "mass", reason });
    }
    let n = solid.positions.len();
    for (tetrahedron, corners) in solid.tetrahedra.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= n) {
            return Err(OperatorError::TetrahedronOutOfRange { tetrahedron, vertex, vertices: n });
        }
    }
    let elements = Elements::new(solid)?;
    monitor.checkpoint()?;
    let (problem, massless_vertices) = elements.problem(n, mass);
    monitor.checkpoint()?;
    let report = OperatorReport {
        laplacian: Laplacian::Volume,
        reason: Reason::Requested,
        massless_vertices,
        flat_tetrahedra: elements.flat,
        ..OperatorReport::default()
    };
    let outside = (boundary == Boundary::Dirichlet).then(|| outside(solid));
    let asked = OperatorRequest { operator: Some(OperatorKind::Volume), mass, boundary };
    MeshOperator::of_problem(problem, outside.as_deref(), report, Some(asked))
}

/// The vertices on the boundary, ascending.
fn outside(solid: &TetMesh) -> Vec<u32> {
    let mut vertices: Vec<u32> = surface(solid).faces.into_flattened();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// The tetrahedra on a scaled solid.
struct Elements<'a> {
    tetrahedra: &'a [[u32; 4]],
    /// The power of two that lengths are multiplied by.
    scale: f64,
    /// Six volumes, and the gradients of the hat functions times that; no volume where it is flat.
    shapes: Vec<(f64, [Vector3; 4])>,
    volume: f64,
    flat: usize,
    /// Where the corners of each vertex begin in `corners`.
    offsets: Vec<usize>,
    /// `4 · tetrahedron + place`, ascending for each vertex.
    corners: Vec<u64>,
}

impl<'a> Elements<'a> {
    fn new(solid: &'a TetMesh) -> Result<Self, OperatorError> {
        let scale = match power_of_two_scale(&solid.positions) {
            Err(OperatorError::NoArea) => return Err(OperatorError::NoVolume),
            scale => scale?,
        };
        let at = |v: u32| Vector3(solid.positions[v as usize]) * scale;
        let shapes: Vec<(f64, [Vector3; 4])> =
            solid.tetrahedra.par_iter().map(|corners| shape(corners.map(at))).collect();
        let volume = shapes.iter().map(|shape| shape.0).sum::<f64>() / 6.0;
        let in_input = volume / scale / scale / scale;
        if !(volume > 0.0 && in_input.is_normal()) {
            return Err(OperatorError::NoVolume);
        }
        let n = solid.positions.len();
        // Counts are kept one place late, so that the running positions end as the offsets.
        let mut offsets = vec![0usize; n + 2];
        solid.tetrahedra.as_flattened().iter().for_each(|&v| offsets[v as usize + 2] += 1);
        for v in 2..n + 2 {
            offsets[v] += offsets[v - 1];
        }
        let mut corners = vec![0u64; 4 * solid.tetrahedra.len()];
        for (corner, &v) in solid.tetrahedra.as_flattened().iter().enumerate() {
            let next = &mut offsets[v as usize + 1];
            corners[*next] = corner as u64;
            *next += 1;
        }
        offsets.pop();
        let flat = shapes.iter().filter(|shape| shape.0 == 0.0).count();
        Ok(Self { tetrahedra: &solid.tetrahedra, scale, shapes, volume, flat, offsets, corners })
    }

    /// The eigenproblem on `n` vertices, and how many of them have no mass.
    fn problem(&self, n: usize, kind: MassKind) -> (EigenProblem, usize) {
        let parts: Vec<Rows> = (0..n.div_ceil(ROWS_PER_TASK))
            .into_par_iter()
            .map(|task| self.rows(task * ROWS_PER_TASK..((task + 1) * ROWS_PER_TASK).min(n), kind, n))
            .collect();
        let mut rows = Rows::default();
        let mut offsets = vec![0];
        for part in parts {
            let last = rows.indices.len();
            offsets.extend(part.ends.iter().map(|end| last + end));
            rows.indices.extend(part.indices);
            rows.stiffness.extend(part.stiffness);
            rows.mass.extend(part.mass);
            rows.massless += part.massless;
        }
        let mass = match kind {
            MassKind::Consistent => MassMatrix::Sparse(SparseMatrix::from_sorted_parts(
                n,
                n,
                offsets.clone(),
                rows.indices.clone(),
                rows.mass,
            )),
            MassKind::Barycentric | MassKind::Voronoi => MassMatrix::Diagonal(rows.mass),
        };
        let stiffness = SparseMatrix::from_sorted_parts(n, n, offsets, rows.indices, rows.stiffness);
        let area = self.volume / self.scale / self.scale / self.scale;
        (EigenProblem { stiffness, mass, area, unknowns: None }, rows.massless)
    }

    /// A run of rows. The diagonal is the negative sum of the rest, so that constants are in the kernel as far as
    /// rounding lets them.
    fn rows(&self, range: std::ops::Range<usize>, kind: MassKind, n: usize) -> Rows {
        let mut rows = Rows::default();
        let mut ring: Vec<(u32, f64, f64)> = Vec::new();
        for v in range {
            ring.clear();
            let mut own = 0.0;
            for &corner in &self.corners[self.offsets[v]..self.offsets[v + 1]] {
                let (tetrahedron, place) = ((corner / 4) as usize, (corner % 4) as usize);
                let (six, gradients) = &self.shapes[tetrahedron];
                own += six;
                for (k, &other) in self.tetrahedra[tetrahedron].iter().enumerate().filter(|(k, _)| *k != place) {
                    if other == v as u32 {
                        // A corner that is there twice: the tetrahedron is flat.
                        continue;
                    }
                    let entry = if *six > 0.0 { gradients[place].dot(gradients[k]) / (6.0 * six) } else { 0.0 };
                    ring.push((other, entry, *six));
                }
            }
            // Stable, so that both entries of an edge are summed in the same order.
            ring.sort_by_key(|entry| entry.0);
            ring.dedup_by(|later, first| {
                let same = later.0 == first.0;
                if same {
                    (first.1, first.2) = (first.1 + later.1, first.2 + later.2);
                }
                same
            });
            let diagonal = (v as u32, -ring.iter().map(|entry| entry.1).sum::<f64>(), 2.0 * own);
            let at = ring.partition_point(|entry| entry.0 < v as u32);
            ring.insert(at, diagonal);
            // Back to the units of the input: a stiffness is a length.
            rows.indices.extend(ring.iter().map(|entry| entry.0));
            rows.stiffness.extend(ring.iter().map(|entry| entry.1 / self.scale));
            let total = 6.0 * self.volume;
            let massless = if own > 0.0 { 0.0 } else { MASSLESS / n as f64 };
            rows.massless += usize::from(massless > 0.0);
            match kind {
                // A twentieth of a volume off the diagonal, a tenth on it.
                MassKind::Consistent => {
                    rows.mass.extend(ring.iter().map(|&(other, _, sixes)| {
                        sixes / (20.0 * total) + if other == v as u32 { massless } else { 0.0 }
                    }))
                }
                MassKind::Barycentric | MassKind::Voronoi => rows.mass.push(own / (4.0 * total) + massless),
            }
            rows.ends.push(rows.indices.len());
        }
        rows
    }
}

/// Consecutive rows of stiffness and mass.
#[derive(Default)]
struct Rows {
    ends: Vec<usize>,
    indices: Vec<u32>,
    stiffness: Vec<f64>,
    mass: Vec<f64>,
    massless: usize,
}

/// Six times the volume and, over that, the gradients of the hat functions; zeros where it is flat.
pub(super) fn shape([a, b, c, d]: [Vector3; 4]) -> (f64, [Vector3; 4]) {
    let (u, v, w) = (b - a, c - a, d - a);
    let six = u.dot(v.cross(w));
    let edges = [u, v, w, c - b, d - b, d - c];
    let longest = edges.into_iter().map(Vector3::norm_squared).fold(0.0, f64::max);
    if !(six.abs() > 6.0 * FLAT * longest * longest.sqrt()) {
        return (0.0, [Vector3::ZERO; 4]);
    }
    let (p, q, r) = (v.cross(w), w.cross(u), u.cross(v));
    (six.abs(), [-p - q - r, p, q, r])
}

#[cfg(test)]
#[path = "volume_tests.rs"]
mod tests;
