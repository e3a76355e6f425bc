//! Distances triangle by triangle.

use rayon::prelude::*;

use super::DistanceWorkspace;
use crate::mesh::TriangleMesh;
use crate::mesh::connectivity::Connectivity;

/// A face as fast marching needs it: its shape without its place in space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    vertices: [u32; 3],
    /// The length of the edge opposite to each corner.
    opposite: [f32; 3],
    /// Twice the area.
    double_area: f32,
}

/// The triangles of a mesh, lengths in multiples of `unit`.
pub(super) fn triangles(mesh: &TriangleMesh, unit: f64) -> Vec<Triangle> {
    let scale = 1.0 / unit;
    mesh.faces
        .par_iter()
        .map(|&vertices| {
            let p = vertices.map(|v| mesh.positions[v as usize]);
            let edge = |i: usize, j: usize| [0, 1, 2].map(|k| (p[j][k] - p[i][k]) * scale);
            let length = |e: [f64; 3]| (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sqrt();
            let (a, b, c) = (edge(1, 2), edge(2, 0), edge(0, 1));
            let normal = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
            Triangle {
                vertices,
                opposite: [length(a) as f32, length(b) as f32, length(c) as f32],
                double_area: length(normal) as f32,
            }
        })
        .collect()
}

/// The distance at corner C of a triangle whose corners A and B are at the distances `at_a` and `at_b`; `ab`, `ac`, `bc` are the
/// lengths of its edges.
///
/// A source in the plane of the triangle, on the other side of AB, explains the two distances. If the straight line from there
/// to C passes between A and B, its length is the answer, else the better of the two edges to C is. Coordinates here are
/// multiplied by the length of AB, which saves its division.
fn through_triangle(at_a: f32, at_b: f32, ab: f32, ac: f32, bc: f32, double_area: f32) -> f32 {
    let along_edge = (at_a + ac).min(at_b + bc);
    let (at_a, at_b) = (f64::from(at_a), f64::from(at_b));
    let (a2, b2, ab2) = (at_a * at_a, at_b * at_b, f64::from(ab) * f64::from(ab));
    let source_x = 0.5 * (a2 - b2 + ab2);
    let source_y2 = a2 * ab2 - source_x * source_x;
    // Not a triangle: rounding, or a source on the line through A and B.
    if !(source_y2 >= 0.0 && ab2 > 0.0) {
        return along_edge;
    }
    let source_y = source_y2.sqrt();
    let apex_x = 0.5 * (f64::from(ac) * f64::from(ac) - f64::from(bc) * f64::from(bc) + ab2);
    let apex_y = f64::from(double_area);
    let height = source_y + apex_y;
    let crossing = source_x * apex_y + apex_x * source_y;
    if !(crossing >= 0.0 && crossing <= ab2 * height) {
        return along_edge;
    }
    let run = apex_x - source_x;
    let straight = ((run * run + height * height) / ab2).sqrt() as f32;
    // Never before the corners it comes from: the queue relies on it.
    if straight >= at_a.max(at_b) as f32 && straight < along_edge { straight } else { along_edge }
}

impl DistanceWorkspace {
    pub(super) fn fast_marching(
        &mut self,
        connectivity: &Connectivity,
        triangles: &[Triangle],
        source: u32,
        radius: f32,
    ) {
        self.offer(source, 0.0);
        while let Some((v, distance)) = self.settle() {
            for &f in connectivity.faces_around(v) {
                let triangle = &triangles[f as usize];
                let i = triangle.vertices.iter().position(|&w| w == v).unwrap_or(0);
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let (a, b) = (triangle.vertices[j], triangle.vertices[k]);
                let opposite = triangle.opposite;
                let area = triangle.double_area;
                match (self.settled_distance(a), self.settled_distance(b)) {
                    (Some(_), Some(_)) => {}
                    (Some(at_a), None) => {
                        let there = through_triangle(distance, at_a, opposite[k], opposite[j], opposite[i], area);
                        if there <= radius {
                            self.offer(b, there);
                        }
                    }
                    (None, Some(at_b)) => {
                        let there = through_triangle(distance, at_b, opposite[j], opposite[k], opposite[i], area);
                        if there <= radius {
                            self.offer(a, there);
                        }
                    }
                    (None, None) => {
                        for (w, length) in [(a, opposite[k]), (b, opposite[j])] {
                            let there = distance + length;
                            if there <= radius {
                                self.offer(w, there);
                            }
                        }
                    }
                }
            }
        }
    }
}
