//! Frames and gradients at vertices, as networks that diffuse features on surfaces take them (Sharp et al. 2022,
//! DiffusionNet).
//!
//! The gradient at a vertex is the tangent vector `g` that explains the differences along its edges best: least squares
//! of `eⱼ·g = f(j) − f(i)` over its neighbours `j`, `eⱼ` being the edge in the frame of the vertex, with `ε|g|²` added
//! so that a single edge suffices.

use chladni_base::Vector3;
use chladni_base::parallel::*;

use super::OperatorError;

/// Added to lengths before they divide, as the published frames have it.
const TINY: f64 = 1e-6;

/// Frames, and both components of the gradient as two matrices of one pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct VertexGradients {
    /// At each vertex two tangents and the normal.
    pub frames: Vec<[[f64; 3]; 3]>,
    /// Where each row begins in `indices` and `values`; one more than there are vertices.
    pub offsets: Vec<usize>,
    /// The columns of each row, ascending: the neighbours of the vertex, and itself.
    pub indices: Vec<u32>,
    /// Along the first and the second tangent.
    pub values: Vec<[f64; 2]>,
}

impl VertexGradients {
    /// Of positions and faces as they are: vertices that no face uses have a frame, and rows of zero.
    ///
    /// # Errors
    /// [`OperatorError::VertexOutOfRange`]; [`OperatorError::Parameter`] where `epsilon` is not above zero.
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]], epsilon: f64) -> Result<Self, OperatorError> {
        let n = positions.len();
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= n) {
                return Err(OperatorError::VertexOutOfRange { face, vertex, vertices: n });
            }
        }
        if !(epsilon > 0.0) {
            let reason = format!("must be positive, got {epsilon}");
            return Err(OperatorError::Parameter { name: "regularisation", reason });
        }
        let positions = Vector3::slice(positions);
        let frames = frames(positions, faces);
        let (offsets, indices) = neighbours(n, faces);
        let row = |vertex: usize| {
            gradient(positions, &frames[vertex], vertex, &indices[offsets[vertex]..offsets[vertex + 1]], epsilon)
        };
        let values = (0..n).into_par_iter().flat_map_iter(row).collect();
        let frames = frames.into_iter().map(|frame| frame.map(Vector3::into)).collect();
        Ok(Self { frames, offsets, indices, values })
    }
}

/// The frame of each vertex: two tangents and the normal, which is the mean of the unit normals of its faces.
fn frames(positions: &[Vector3], faces: &[[u32; 3]]) -> Vec<[Vector3; 3]> {
    let mut normals = vec![Vector3::ZERO; positions.len()];
    for face in faces {
        let [a, b, c] = face.map(|vertex| positions[vertex as usize]);
        let normal = (b - a).cross(c - a);
        let normal = normal * (1.0 / (normal.norm() + TINY));
        face.iter().for_each(|&vertex| normals[vertex as usize] += normal);
    }
    let [x, y, z] = Vector3::AXES;
    let frame = |&sum: &Vector3| {
        let length = sum.norm();
        // Of a vertex without faces, or between two that lie on each other, any direction will do.
        let normal = if length > 0.0 { sum * (1.0 / length) } else { z };
        let along = if normal[0].abs() < 0.9 { x } else { y };
        let tangent = along - normal * along.dot(normal);
        let tangent = tangent * (1.0 / (tangent.norm() + TINY));
        [tangent, normal.cross(tangent), normal]
    };
    normals.par_iter().map(frame).collect()
}

/// Offsets and neighbours of all vertices, each list ascending and with the vertex itself.
fn neighbours(vertices: usize, faces: &[[u32; 3]]) -> (Vec<usize>, Vec<u32>) {
    let mut pairs: Vec<u64> = Vec::with_capacity(6 * faces.len() + vertices);
    let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    for &[a, b, c] in faces {
        pairs.extend([pair(a, b), pair(b, a), pair(b, c), pair(c, b), pair(c, a), pair(a, c)]);
    }
    pairs.extend((0..vertices as u64).map(|vertex| vertex << 32 | vertex));
    pairs.par_sort_unstable();
    pairs.dedup();
    let mut offsets = vec![0; vertices + 1];
    pairs.iter().for_each(|pair| offsets[(pair >> 32) as usize + 1] += 1);
    (0..vertices).for_each(|vertex| offsets[vertex + 1] += offsets[vertex]);
    (offsets, pairs.into_iter().map(|pair| pair as u32).collect())
}

/// The rows of both gradient matrices at a vertex.
fn gradient(positions: &[Vector3], frame: &[Vector3; 3], vertex: usize, ring: &[u32], epsilon: f64) -> Vec<[f64; 2]> {
    let edge = |&other: &u32| {
        let along = positions[other as usize] - positions[vertex];
        [along.dot(frame[0]), along.dot(frame[1])]
    };
    let edges: Vec<[f64; 2]> = ring.iter().map(edge).collect();
    let [mut xx, mut xy, mut yy] = [epsilon, 0.0, epsilon];
    for [x, y] in &edges {
        (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
    }
    let determinant = xx * yy - xy * xy;
    let mut rows: Vec<[f64; 2]> =
        edges.iter().map(|[x, y]| [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant]).collect();
    let own = rows.iter().fold([0.0; 2], |sum, row| [sum[0] - row[0], sum[1] - row[1]]);
    // The vertex's own edge is zero, and so is its row until here.
    if let Some(slot) = ring.iter().position(|&other| other as usize == vertex).and_then(|at| rows.get_mut(at)) {
        *slot = own;
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::shape::{Shape, generate};

    #[test]
    fn gradients_of_linear_functions_on_a_plane_are_their_slopes() {
        let mesh = generate(Shape::Rectangle, 400).unwrap();
        let made = VertexGradients::new(&mesh.positions, &mesh.faces, 1e-12).unwrap();
        let slope = Vector3::new(0.3, -0.7, 0.0);
        for vertex in 0..mesh.positions.len() {
            let mut found = [0.0; 2];
            for at in made.offsets[vertex]..made.offsets[vertex + 1] {
                let value = slope.dot(mesh.point(made.indices[at]));
                found.iter_mut().zip(made.values[at]).for_each(|(sum, weight)| *sum += weight * value);
            }
            for axis in 0..2 {
                let expected = slope.dot(made.frames[vertex][axis].into());
                assert!((found[axis] - expected).abs() < 1e-5, "vertex {vertex}: {} and {expected}", found[axis]);
            }
        }
    }

    #[test]
    fn bad_faces_and_numbers_are_named() {
        let positions = [[0.0; 3]; 3];
        let wrong = VertexGradients::new(&positions, &[[0, 1, 2], [0, 1, 7]], 1e-5).unwrap_err();
        assert_eq!(wrong.to_string(), "face 1 refers to vertex 7 of 3");
        let wrong = VertexGradients::new(&positions, &[[0, 1, 2]], 0.0).unwrap_err();
        assert!(wrong.to_string().contains("regularisation"), "{wrong}");
        // A vertex that no face uses has a frame and a row of zero.
        let made = VertexGradients::new(&positions, &[], 1e-5).unwrap();
        assert_eq!((made.offsets, made.values), (vec![0, 1, 2, 3], vec![[0.0; 2]; 3]));
        assert_eq!(made.frames[0][2], [0.0, 0.0, 1.0]);
    }
}
