//! Distances triangle by triangle.

use chladni_base::parallel::*;

use super::DistanceWorkspace;
use crate::TriangleMesh;
use crate::connectivity::Connectivity;

/// A triangle as seen from one of its corners: its shape without its place in space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    /// The other two vertices.
    vertices: [u32; 2],
    /// The lengths of the edges to them.
    lengths: [f32; 2],
    /// The length of the edge between them.
    opposite: f32,
    /// Twice the area.
    double_area: f32,
}

/// The corners at all vertices, vertex after vertex as [`Connectivity::face_range`] tells; lengths in multiples of
/// `unit`.
///
/// Each triangle is stored three times, so that what a vertex needs lies in one place: 24 bytes for each of 6 corners.
pub(super) fn corners(mesh: &TriangleMesh, connectivity: &Connectivity, unit: f64) -> Vec<Corner> {
    let scale = 1.0 / unit;
    (0..mesh.positions.len() as u32)
        .into_par_iter()
        .with_min_len(1 << 10)
        .flat_map_iter(|v| {
            connectivity.faces_around(v).iter().map(move |&f| {
                let face = mesh.faces[f as usize];
                let i = usize::from(face[1] == v) + 2 * usize::from(face[2] == v);
                let vertices = [face[(i + 1) % 3], face[(i + 2) % 3]];
                let [p, q, r] = mesh.corners(&[v, vertices[0], vertices[1]]);
                let (a, b, c) = ((q - p) * scale, (r - p) * scale, (r - q) * scale);
                Corner {
                    vertices,
                    lengths: [a.norm() as f32, b.norm() as f32],
                    opposite: c.norm() as f32,
                    double_area: a.cross(b).norm() as f32,
                }
            })
        })
        .collect()
}

/// The distance at corner C of a triangle whose corners A and B are at the distances `at_a` and `at_b`; `ab`, `ac`,
/// `bc` are the lengths of its edges.
///
/// A source in the plane of the triangle, on the other side of AB, explains the two distances. If the straight line
/// from there to C passes between A and B, its length is the answer, else the better of the two edges to C is.
/// Coordinates here, with A in the origin and B on the first axis, are multiplied by the length of AB, which saves
/// divisions. Nothing branches before the end: what is no triangle becomes NaN and fails every comparison.
fn through_triangle(at_a: f32, at_b: f32, ab: f32, ac: f32, bc: f32, double_area: f32) -> f32 {
    let along_edge = (at_a + ac).min(at_b + bc);
    let ab2 = ab * ab;
    let source_x = 0.5 * ((at_a - at_b) * (at_a + at_b) + ab2);
    let reach = at_a * ab;
    let source_y = ((reach - source_x) * (reach + source_x)).sqrt();
    let apex_x = 0.5 * ((ac - bc) * (ac + bc) + ab2);
    let height = source_y + double_area;
    let crossing = source_x * double_area + apex_x * source_y;
    let run = apex_x - source_x;
    let straight = ((run * run + height * height) / ab2).sqrt();
    // Never before the corners it comes from: the queue relies on it.
    let valid = (crossing >= 0.0) & (crossing <= ab2 * height) & (straight >= at_a.max(at_b)) & (straight < along_edge);
    if valid { straight } else { along_edge }
}

impl DistanceWorkspace {
    pub(super) fn fast_marching(&mut self, connectivity: &Connectivity, corners: &[Corner], source: u32, radius: f32) {
        self.offer(source, 0.0);
        while let Some((v, distance)) = self.settle() {
            for corner in &corners[connectivity.face_range(v)] {
                let [a, b] = corner.vertices;
                let [to_a, to_b] = corner.lengths;
                match (self.settled_distance(a), self.settled_distance(b)) {
                    (Some(_), Some(_)) => {}
                    (Some(at_a), None) => {
                        let there = through_triangle(distance, at_a, to_a, to_b, corner.opposite, corner.double_area);
                        self.offer_within(b, there, radius);
                    }
                    (None, Some(at_b)) => {
                        let there = through_triangle(distance, at_b, to_b, to_a, corner.opposite, corner.double_area);
                        self.offer_within(a, there, radius);
                    }
                    (None, None) => {
                        self.offer_within(a, distance + to_a, radius);
                        self.offer_within(b, distance + to_b, radius);
                    }
                }
            }
        }
    }
}
