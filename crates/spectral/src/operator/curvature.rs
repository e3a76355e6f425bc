//! Normals, shape operators and principal curvatures.
//!
//! The shape operator of a face comes from the normals at the middle of its edges (Grinspun et al. 2006):
//! `T = Σ_k (q_i + q_j − q_k) / (8A²) t_k t_kᵀ` with `q_k = 2 (n_i − n_j) · e_k`, `t_k = e_k × n`, and `n_k` the unit
//! sum of the normals of the two faces at edge `k`; an edge that has not two faces takes the normal of its own. That of
//! a vertex is the mean over its faces, weighted by area, each turned into the plane of the vertex. A sphere with
//! outward normals has positive curvatures.

use chladni_base::Vector3;
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;

use super::corners::Corners;
use super::{OperatorError, laplace};

/// Principal curvatures and directions at every vertex.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curvatures {
    /// Unit normals.
    pub normals: Vec<[f64; 3]>,
    /// The larger principal curvature κ₁, in 1/length.
    pub largest: Vec<f64>,
    /// The smaller one, κ₂.
    pub smallest: Vec<f64>,
    /// The unit direction of κ₁ in the plane of the vertex; κ₂ belongs to `normal × direction`. At an umbilic any.
    pub directions: Vec<[f64; 3]>,
}

impl Curvatures {
    /// `κ₁² + κ₂²` of every vertex, in 1/length².
    pub fn squares(&self) -> Vec<f64> {
        self.largest.iter().zip(&self.smallest).map(|(a, b)| a * a + b * b).collect()
    }
}

/// The curvatures of a mesh. Vertices that no face with an area touches have none.
///
/// # Errors
/// [`OperatorError`] names a corner out of range or a coordinate that is not finite, or says that the mesh has no area.
pub fn curvatures(mesh: &TriangleMesh) -> Result<Curvatures, OperatorError> {
    let measured = laplace::measure(mesh)?;
    Ok(Surface::new(mesh, &measured).curvatures(&measured.corners))
}

/// Unit normals of the vertices: those of the faces around each, added up by area. Where these cancel each other, the
/// normal of the largest face; `[0, 0, 1]` where no face has an area.
///
/// # Errors
/// As [`curvatures`].
pub fn vertex_normals(mesh: &TriangleMesh) -> Result<Vec<[f64; 3]>, OperatorError> {
    let measured = laplace::measure(mesh)?;
    Ok(Surface::new(mesh, &measured).normals(&measured.corners))
}

/// A mesh with the normals and areas of its faces, scaled by a power of two.
pub(super) struct Surface<'a> {
    mesh: &'a TriangleMesh,
    scale: f64,
    /// Unit normal and area; zeros for faces without area.
    faces: Vec<(Vector3, f64)>,
}

impl<'a> Surface<'a> {
    pub fn new(mesh: &'a TriangleMesh, measured: &laplace::Measured) -> Self {
        let scale = measured.scale;
        let faces = mesh
            .faces
            .par_iter()
            .zip(&measured.shapes)
            .map(|(face, shape)| {
                if shape.area == 0.0 {
                    return (Vector3::ZERO, 0.0);
                }
                let [p, q, r] = mesh.corners(face).map(|p| p * scale);
                (q - p).cross(r - p).normalized().map_or((Vector3::ZERO, 0.0), |normal| (normal, shape.area))
            })
            .collect();
        Self { mesh, scale, faces }
    }

    /// As [`vertex_normals`].
    pub fn normals(&self, corners: &Corners) -> Vec<[f64; 3]> {
        (0..self.mesh.positions.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|v| {
                let (mut sum, mut total, mut largest) = (Vector3::ZERO, 0.0, (Vector3::AXES[2], 0.0));
                for &corner in corners.on(v) {
                    let (normal, area) = self.faces[corner as usize / 3];
                    total += area;
                    sum += area * normal;
                    if area > largest.1 {
                        largest = (normal, area);
                    }
                }
                // Less than this is what rounding leaves of normals that cancel.
                let telling = sum.norm() > 1e-9 * total;
                sum.normalized().filter(|_| telling).unwrap_or(largest.0).into()
            })
            .collect()
    }

    /// The shape operator of a face, in units of 1/length of the scaled mesh.
    fn shape_operator(&self, face: usize, corners: &Corners) -> [[f64; 3]; 3] {
        let (n, area) = self.faces[face];
        let mut operator = [[0.0; 3]; 3];
        if area == 0.0 {
            return operator;
        }
        let [a, b, c] = self.mesh.faces[face];
        let [p, q, r] = [a, b, c].map(|v| self.mesh.point(v) * self.scale);
        // Edge k is opposite to corner k.
        let edges = [r - q, p - r, q - p];
        let normals = [
            self.middle_normal(face, b, c, corners),
            self.middle_normal(face, c, a, corners),
            self.middle_normal(face, a, b, corners),
        ];
        let q: [f64; 3] = std::array::from_fn(|k| 2.0 * (normals[(k + 1) % 3] - normals[(k + 2) % 3]).dot(edges[k]));
        for k in 0..3 {
            let t = edges[k].cross(n);
            let weight = (q[(k + 1) % 3] + q[(k + 2) % 3] - q[k]) / (8.0 * area * area);
            for i in 0..3 {
                for j in 0..3 {
                    operator[i][j] += weight * t[i] * t[j];
                }
            }
        }
        operator
    }

    /// The normal at the middle of the edge from `from` to `to` of a face.
    fn middle_normal(&self, face: usize, from: u32, to: u32, corners: &Corners) -> Vector3 {
        let own = self.faces[face].0;
        let mut other = None;
        // Around the end with fewer faces: the hub of a fan would be gone around once for each of them.
        let (mut round, swapped) =
            (corners.on(from as usize), corners.on(to as usize).len() < corners.on(from as usize).len());
        if swapped {
            round = corners.on(to as usize);
        }
        let across = if swapped { from } else { to };
        for &corner in round {
            let f = corner as usize / 3;
            if f != face && self.mesh.faces[f].contains(&across) && self.faces[f].1 > 0.0 {
                if other.is_some() {
                    return own;
                }
                // A neighbour that runs along the edge in the same direction is seen from its back.
                let there = self.mesh.faces[f];
                let k = corner as usize % 3;
                let forth = if swapped { there[(k + 2) % 3] == from } else { there[(k + 1) % 3] == to };
                let sign = if forth { -1.0 } else { 1.0 };
                other = Some(sign * self.faces[f].0);
            }
        }
        let Some(other) = other else { return own };
        (own + other).normalized().unwrap_or(own)
    }

    /// As [`curvatures`].
    pub fn curvatures(&self, corners: &Corners) -> Curvatures {
        let normals = self.normals(corners);
        let operators: Vec<[[f64; 3]; 3]> =
            (0..self.faces.len()).into_par_iter().with_min_len(1024).map(|f| self.shape_operator(f, corners)).collect();
        let rows: Vec<(f64, f64, Vector3)> = normals
            .par_iter()
            .enumerate()
            .with_min_len(1024)
            .map(|(v, &normal)| {
                // Any two unit vectors of the plane.
                let normal = Vector3(normal);
                let axis = if normal[0].abs() < 0.6 { Vector3::AXES[0] } else { Vector3::AXES[1] };
                let x = axis.cross(normal).normalized().unwrap_or(Vector3::AXES[0]);
                let y = normal.cross(x);
                let (mut sum, mut total) = ([0.0; 3], 0.0);
                for &corner in corners.on(v) {
                    let (face_normal, area) = self.faces[corner as usize / 3];
                    if area == 0.0 {
                        continue;
                    }
                    let operator = &operators[corner as usize / 3];
                    // Seen from its front, wherever the normals of a vertex and its face agree.
                    let sign = if face_normal.dot(normal) < 0.0 { -1.0 } else { 1.0 };
                    let along = [x, y].map(|axis| turned(axis, normal, sign * face_normal));
                    let applied = along.map(|a| Vector3(operator.map(|row| Vector3(row).dot(a))));
                    let weight = sign * area;
                    sum[0] += weight * along[0].dot(applied[0]);
                    sum[1] += weight * along[0].dot(applied[1]);
                    sum[2] += weight * along[1].dot(applied[1]);
                    total += area;
                }
                if total == 0.0 {
                    return (0.0, 0.0, x);
                }
                let [xx, xy, yy] = sum.map(|s| s / total * self.scale);
                let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
                let radius = half.hypot(xy);
                // The eigenvector of mean + radius, from whichever row of T − κ₂ is larger.
                let (s, t) = if half >= 0.0 { (half + radius, xy) } else { (xy, radius - half) };
                let direction = (s * x + t * y).normalized().unwrap_or(x);
                (mean + radius, mean - radius, direction)
            })
            .collect();
        Curvatures {
            normals,
            largest: rows.iter().map(|row| row.0).collect(),
            smallest: rows.iter().map(|row| row.1).collect(),
            directions: rows.iter().map(|row| row.2.into()).collect(),
        }
    }
}

/// A vector of the plane with normal `from`, turned with it into `to` by the shortest rotation; the two are not
/// opposite.
fn turned(vector: Vector3, from: Vector3, to: Vector3) -> Vector3 {
    let axis = from.cross(to);
    let cosine = from.dot(to);
    let along = axis.dot(vector) / (1.0 + cosine);
    cosine * vector + axis.cross(vector) + along * axis
}
