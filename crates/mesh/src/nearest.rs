//! The face nearest to a point: a tree of boxes over faces in the order of a space-filling curve.

use chladni_base::Vector3;

use super::TriangleMesh;
use super::sample::faces_along_curve;

/// Faces of one leaf.
const LEAF: usize = 8;

/// Boxes over the faces of a mesh, from the leaves up. Takes about 12 bytes a face.
#[derive(Debug, Clone)]
pub struct FaceHierarchy {
    /// Faces along a space-filling curve; each run of [`LEAF`] is a leaf.
    order: Vec<u32>,
    /// For each level the boxes of its nodes, leaves first; two nodes of a level make one of the next.
    levels: Vec<Vec<[[f32; 3]; 2]>>,
}

impl FaceHierarchy {
    /// Builds the tree in `O(f log f)`.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let order = faces_along_curve(mesh);
        let mut boxes: Vec<[[f32; 3]; 2]> = order
            .chunks(LEAF)
            .map(|faces| {
                let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
                for corner in faces.iter().flat_map(|&f| mesh.faces[f as usize]) {
                    for (i, &x) in mesh.positions[corner as usize].iter().enumerate() {
                        // Rounded outwards.
                        let x32 = x as f32;
                        bounds[0][i] = bounds[0][i].min(x32.next_down());
                        bounds[1][i] = bounds[1][i].max(x32.next_up());
                    }
                }
                bounds
            })
            .collect();
        let mut levels = Vec::new();
        while boxes.len() > 1 {
            let above = boxes.chunks(2).map(|pair| pair[1..].iter().fold(pair[0], union)).collect();
            levels.push(std::mem::replace(&mut boxes, above));
        }
        levels.push(boxes);
        Self { order, levels }
    }

    /// The face nearest to a point, the lowest among equals of its leaf, and its distance. `None` where there are no
    /// faces or the point is not finite.
    ///
    /// `mesh` is the one that the tree was built for.
    pub fn nearest(&self, mesh: &TriangleMesh, point: [f64; 3]) -> Option<(u32, f64)> {
        if !point.iter().all(|x| x.is_finite()) {
            return None;
        }
        let place = Vector3(point);
        let mut best: Option<(u32, f64)> = None;
        let mut stack = vec![(self.levels.len() - 1, 0usize)];
        while let Some((level, node)) = stack.pop() {
            let Some(bounds) = self.levels[level].get(node) else { continue };
            if best.is_some_and(|(_, square)| box_distance(bounds, point) > square) {
                continue;
            }
            if level == 0 {
                let faces = self.order.iter().skip(node * LEAF).take(LEAF);
                for &face in faces {
                    let square = triangle_distance(mesh.corners(&mesh.faces[face as usize]), place);
                    if best.is_none_or(|(_, least)| square < least) {
                        best = Some((face, square));
                    }
                }
                continue;
            }
            let below = &self.levels[level - 1];
            let distance = |n: usize| below.get(n).map_or(f64::INFINITY, |bounds| box_distance(bounds, point));
            let (a, b) = (2 * node, 2 * node + 1);
            // The nearer one is looked at first.
            stack.extend(if distance(a) <= distance(b) {
                [(level - 1, b), (level - 1, a)]
            } else {
                [(level - 1, a), (level - 1, b)]
            });
        }
        best.map(|(face, square)| (face, square.sqrt()))
    }

    /// Bytes of the tree.
    pub fn bytes(&self) -> u64 {
        (4 * self.order.len() + 24 * self.levels.iter().map(Vec::len).sum::<usize>()) as u64
    }
}

fn union(a: [[f32; 3]; 2], b: &[[f32; 3]; 2]) -> [[f32; 3]; 2] {
    let each = |k: usize, function: fn(f32, f32) -> f32| std::array::from_fn(|i| function(a[k][i], b[k][i]));
    [each(0, f32::min), each(1, f32::max)]
}

/// The squared distance of a point from a box.
fn box_distance(bounds: &[[f32; 3]; 2], point: [f64; 3]) -> f64 {
    (0..3).map(|i| (f64::from(bounds[0][i]) - point[i]).max(point[i] - f64::from(bounds[1][i])).max(0.0).powi(2)).sum()
}

/// The squared distance of a point from a triangle, by the region of the plane that it projects to (Ericson 2005,
/// section 5.1.5).
fn triangle_distance([a, b, c]: [Vector3; 3], p: Vector3) -> f64 {
    let (ab, ac) = (b - a, c - a);
    let (ap, bp, cp) = (p - a, p - b, p - c);
    let (d1, d2, d3, d4, d5, d6) = (ab.dot(ap), ac.dot(ap), ab.dot(bp), ac.dot(bp), ab.dot(cp), ac.dot(cp));
    let along = |from: Vector3, s: f64, u: Vector3, t: f64, v: Vector3| (p - (from + s * u + t * v)).norm_squared();
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.norm_squared();
    }
    if d3 >= 0.0 && d4 <= d3 {
        return bp.norm_squared();
    }
    if d6 >= 0.0 && d5 <= d6 {
        return cp.norm_squared();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return along(a, d1 / (d1 - d3), ab, 0.0, ac);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return along(a, 0.0, ab, d2 / (d2 - d6), ac);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return along(b, t, c - b, 0.0, ac);
    }
    let sum = va + vb + vc;
    if !(sum > 0.0) {
        // No area: one of its corners is as near as it gets, to rounding.
        return ap.norm_squared().min(bp.norm_squared()).min(cp.norm_squared());
    }
    along(a, vb / sum, ab, vc / sum, ac)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Shape, generate};
    use chladni_base::SplitMix64;

    #[test]
    fn the_nearest_face_is_that_of_an_exhaustive_search() {
        let mesh = generate(Shape::Torus, 700).unwrap();
        let tree = FaceHierarchy::new(&mesh);
        let mut random = SplitMix64::new(3);
        for _ in 0..200 {
            let point = [(); 3].map(|()| 6.0 * random.unit() - 3.0);
            let (_, distance) = tree.nearest(&mesh, point).unwrap();
            let least = mesh
                .faces
                .iter()
                .map(|f| triangle_distance(mesh.corners(f), point.into()))
                .fold(f64::INFINITY, f64::min);
            assert!((distance - least.sqrt()).abs() < 1e-12);
        }
        for (face, corners) in mesh.faces.iter().enumerate().step_by(50) {
            assert_eq!(tree.nearest(&mesh, mesh.barycentre(corners).into()).unwrap().0, face as u32);
        }
    }

    #[test]
    fn nothing_is_near_where_there_is_nothing() {
        let none = TriangleMesh::default();
        assert_eq!(FaceHierarchy::new(&none).nearest(&none, [0.0; 3]), None);
        let mesh = generate(Shape::Sphere, 42).unwrap();
        assert_eq!(FaceHierarchy::new(&mesh).nearest(&mesh, [f64::NAN, 0.0, 0.0]), None);
        assert!(FaceHierarchy::new(&mesh).nearest(&mesh, [1e9, 0.0, 0.0]).is_some());
    }

    #[test]
    fn distances_to_each_part_of_a_triangle() {
        let triangle = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]].map(Vector3);
        for (point, square) in [
            ([-1.0, -1.0, 0.0], 2.0),
            ([3.0, 0.0, 0.0], 1.0),
            ([0.0, 4.0, 0.0], 4.0),
            ([1.0, -1.0, 0.0], 1.0),
            ([-1.0, 1.0, 0.0], 1.0),
            ([2.0, 2.0, 0.0], 2.0),
            ([0.5, 0.5, 3.0], 9.0),
        ] {
            assert!((triangle_distance(triangle, point.into()) - square).abs() < 1e-12, "{point:?}");
        }
        assert_eq!(triangle_distance([Vector3::ZERO; 3], Vector3::new(0.0, 1.0, 0.0)), 1.0);
    }
}
