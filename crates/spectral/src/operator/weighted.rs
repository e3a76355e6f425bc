//! The Laplacian in parts: weights on the faces, and vertices that are held at zero.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, `S_ij = Σ A ∇φ_i · D ∇φ_j` over the faces with area `A` and tensor `D` |
//! | definiteness | positive semi-definite; the kernel holds the constants of components without a vertex at zero |
//! | units | `D` has none; eigenvalues 1/length² |
//! | mass | that of the Laplacian: weights do not change it |
//! | frames | a tensor is `xx, xy, yy` in the frame of its face: `x` along the edge from corner 0 to corner 1, `y = n × x`, as [`frames`](super::frames) has them |
//! | source | linear finite elements; Andreux et al. 2014 for anisotropy on surfaces |
//!
//! It is made by the triangles as they are: an intrinsic Delaunay triangulation has other faces than those that have
//! weights.

use chladni_algebra::SparseMatrix;
use chladni_base::Vector3;
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::TriangleShape;
use serde::{Deserialize, Serialize};

use super::{EigenProblem, OperatorError};

/// What a client says of the parts: at most one kind of weights, and vertices that are no unknowns.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = OperatorParts, example = json!({"scalars": [1.0, 1.0, 0.25, 4.0], "fixed": [0, 7]})))]
#[serde(default, deny_unknown_fields)]
pub struct Parts {
    /// A positive number for each face, which multiplies its share of the stiffness. Ones, unless they or tensors are
    /// given.
    #[cfg_attr(feature = "schema", schema(required = false))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scalars: Vec<f64>,
    /// Three numbers for each face, one after the other: `xx`, `xy` and `yy` of a positive definite tensor in the frame
    /// of the face, whose `x` runs along the edge from its first corner to its second, and `y` to the side of the
    /// third.
    #[cfg_attr(feature = "schema", schema(required = false))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tensors: Vec<f64>,
    /// Vertices at which functions are zero (Dirichlet), in any order.
    #[cfg_attr(feature = "schema", schema(required = false))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<u32>,
}

/// Weights and entries of tensors lie between this and its inverse.
const LEAST: f64 = 1e-100;

/// The member that a message is about.
const SCALARS: &str = "operator.weighted.scalars";
const TENSORS: &str = "operator.weighted.tensors";
const FIXED: &str = "operator.weighted.fixed";

fn refused<T>(name: &'static str, reason: String) -> Result<T, OperatorError> {
    Err(OperatorError::Parameter { name, reason })
}

impl Parts {
    /// Checks what can be checked without a mesh.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] names the first face whose weight is not positive, or not definite.
    pub fn check(&self) -> Result<(), OperatorError> {
        if !self.scalars.is_empty() && !self.tensors.is_empty() {
            return refused(TENSORS, "give either these or scalars".to_owned());
        }
        let inside = |x: f64| (LEAST..=1.0 / LEAST).contains(&x);
        if let Some(face) = self.scalars.iter().position(|&weight| !inside(weight)) {
            let weight = self.scalars[face];
            let reason =
                format!("the weight of face {face} must be between {LEAST:e} and {:e}, not {weight}", 1.0 / LEAST);
            return refused(SCALARS, reason);
        }
        let (tensors, rest) = self.tensors.as_chunks::<3>();
        if !rest.is_empty() {
            return refused(
                TENSORS,
                format!("expected three numbers for each face, got {} in all", self.tensors.len()),
            );
        }
        let definite = |&[xx, xy, yy]: &[f64; 3]| {
            // The determinant over both entries of the diagonal: it does not overflow.
            let share = (xy / xx) * (xy / yy);
            inside(xx) && inside(yy) && share < 1.0
        };
        if let Some(face) = tensors.iter().position(|tensor| !definite(tensor)) {
            let [xx, xy, yy] = tensors[face];
            let reason = format!("the tensor of face {face}, {xx}, {xy}, {yy}, is not positive definite");
            return refused(TENSORS, reason);
        }
        Ok(())
    }

    /// Checks the parts against the size of a mesh.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] where there are other numbers of weights than of faces, a vertex is not there, or
    /// none is left.
    pub fn check_mesh(&self, vertices: usize, faces: usize) -> Result<(), OperatorError> {
        for (name, found, needed) in [(SCALARS, self.scalars.len(), faces), (TENSORS, self.tensors.len(), 3 * faces)] {
            if found > 0 && found != needed {
                return refused(name, format!("{faces} faces need {needed} numbers, got {found}"));
            }
        }
        match self.fixed.iter().find(|&&vertex| vertex as usize >= vertices) {
            Some(vertex) => {
                refused(FIXED, format!("fixed vertex {vertex} is out of range (the mesh has {vertices} vertices)"))
            }
            None => Ok(()),
        }
    }

    fn tensor(&self, face: usize) -> [f64; 3] {
        match (self.tensors.as_chunks::<3>().0.get(face), self.scalars.get(face)) {
            (Some(&tensor), _) => tensor,
            (None, Some(&weight)) => [weight, 0.0, weight],
            (None, None) => [1.0, 0.0, 1.0],
        }
    }
}

/// The stiffness with the weights of the faces, in the pattern of that of `laplacian`, which was made of the same
/// faces; `shapes` are theirs. Faces without area contribute nothing.
pub(super) fn stiffness(
    laplacian: &EigenProblem,
    mesh: &TriangleMesh,
    shapes: &[TriangleShape],
    scale: f64,
    parts: &Parts,
) -> SparseMatrix {
    let pattern = &laplacian.stiffness;
    let mut values = vec![0.0; pattern.entries()];
    let mut add = |row: u32, column: u32, value: f64| {
        if let Ok(at) = pattern.row(row as usize).0.binary_search(&column) {
            values[pattern.offsets()[row as usize] + at] += value;
        }
    };
    for (face, (corners, shape)) in mesh.faces.iter().zip(shapes).enumerate().filter(|(_, (_, s))| s.area > 0.0) {
        let positions = mesh.corners(corners).map(|p| p * scale);
        let sides = sides(positions, shape.area);
        let [xx, xy, yy] = parts.tensor(face);
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let ([ax, ay], [bx, by]) = (sides[i], sides[j]);
            // Gradients are these sides turned by a right angle, over twice the area.
            let product = xx * ay * by - xy * (ax * by + ay * bx) + yy * ax * bx;
            let entry = product / (4.0 * shape.area);
            let (a, b) = (corners[i], corners[j]);
            add(a, b, entry);
            add(b, a, entry);
            add(a, a, -entry);
            add(b, b, -entry);
        }
    }
    let (offsets, indices) = (pattern.offsets().to_vec(), pattern.indices().to_vec());
    SparseMatrix::from_sorted_parts(pattern.rows(), pattern.columns(), offsets, indices, values)
}

/// The sides of a triangle in its own frame, each opposite the corner of its number.
fn sides([a, b, c]: [Vector3; 3], area: f64) -> [[f64; 2]; 3] {
    let (first, other) = (b - a, c - a);
    let length = first.norm();
    // Corner 0 is the origin, corner 1 lies on the first axis, corner 2 above it.
    let second = [length, 0.0];
    let third = [first.dot(other) / length, 2.0 * area / length];
    [[third[0] - second[0], third[1]], [-third[0], -third[1]], second]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble};
    use chladni_base::{SplitMix64, Unwatched};
    use chladni_mesh::shape::{Shape, generate};

    fn made(mesh: &TriangleMesh, operator: OperatorKind) -> Result<EigenProblem, OperatorError> {
        let (mass, boundary) = (MassKind::default(), Boundary::default());
        Ok(assemble(mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched)?.problem)
    }

    /// A sheared grid over the unit square, bent into space.
    fn sheet() -> TriangleMesh {
        let mut mesh = TriangleMesh { positions: Vec::new(), faces: Vec::new(), ..Default::default() };
        for j in 0..8u32 {
            for i in 0..8u32 {
                let (x, y) = (f64::from(i) / 7.0, f64::from(j) / 7.0);
                mesh.positions.push([x + 0.3 * y, y, (2.0 * x).sin() * 0.4 * y]);
                if i < 7 && j < 7 {
                    let at = 8 * j + i;
                    mesh.faces.push([at, at + 1, at + 9]);
                    // Another corner first: frames are those of each face.
                    mesh.faces.push([at + 9, at + 8, at]);
                }
            }
        }
        mesh
    }

    #[test]
    fn ones_are_the_laplacian_and_numbers_are_multiples_of_it() {
        for mesh in [sheet(), generate(Shape::Torus, 300).unwrap()] {
            let plain = made(&mesh, OperatorKind::Laplace).unwrap().stiffness.to_dense();
            let largest = plain.values().iter().fold(0.0f64, |most, x| most.max(x.abs()));
            for (parts, factor) in [
                (Parts::default(), 1.0),
                (Parts { scalars: vec![2.5; mesh.faces.len()], ..Parts::default() }, 2.5),
                (Parts { tensors: [3.0, 0.0, 3.0].repeat(mesh.faces.len()), ..Parts::default() }, 3.0),
            ] {
                let weighted = made(&mesh, OperatorKind::Weighted(parts)).unwrap().stiffness.to_dense();
                for (a, b) in weighted.values().iter().zip(plain.values()) {
                    assert!((a - factor * b).abs() < 1e-12 * largest, "{a} {b}");
                }
            }
        }
    }

    /// The energy of a linear function on a flat sheet, `A g·D g`, with `D` the same in space whatever the frames of
    /// the faces.
    #[test]
    fn a_tensor_measures_gradients_in_the_frame_of_its_face() {
        let mut mesh = sheet();
        mesh.positions.iter_mut().for_each(|p| p[2] = 0.0);
        let (a, b, c) = (2.0, 0.7, 0.9);
        let tensors = mesh.faces.iter().flat_map(|face| {
            let [p, q] = [face[0], face[1]].map(|vertex| mesh.positions[vertex as usize]);
            let length = (q[0] - p[0]).hypot(q[1] - p[1]);
            let (x, y) = ((q[0] - p[0]) / length, (q[1] - p[1]) / length);
            let in_frame = |u: [f64; 2], v: [f64; 2]| u[0] * (a * v[0] + b * v[1]) + u[1] * (b * v[0] + c * v[1]);
            [in_frame([x, y], [x, y]), in_frame([x, y], [-y, x]), in_frame([-y, x], [-y, x])]
        });
        let parts = Parts { tensors: tensors.collect(), ..Parts::default() };
        let stiffness = made(&mesh, OperatorKind::Weighted(parts)).unwrap().stiffness;
        for g in [[1.0, 0.0], [0.0, 1.0], [0.6, -1.1]] {
            let f: Vec<f64> = mesh.positions.iter().map(|p| g[0] * p[0] + g[1] * p[1]).collect();
            let energy: f64 = stiffness.multiply(&f).iter().zip(&f).map(|(a, b)| a * b).sum();
            // The sheet is a sheared unit square.
            let exact = g[0] * (a * g[0] + b * g[1]) + g[1] * (b * g[0] + c * g[1]);
            assert!((energy - exact).abs() < 1e-12, "{energy} {exact}");
        }
    }

    /// Against a sum over faces with the gradients of hat functions in space.
    #[test]
    fn entries_are_those_of_linear_elements_in_space() {
        let mesh = sheet();
        let mut random = SplitMix64::new(5);
        let scalars: Vec<f64> = mesh.faces.iter().map(|_| 0.1 + 3.0 * random.unit()).collect();
        let mut dense = vec![0.0; 64 * 64];
        for (face, weight) in mesh.faces.iter().zip(&scalars) {
            let p = mesh.corners(face);
            let (u, v) = (p[1] - p[0], p[2] - p[0]);
            let area = 0.5 * (u.norm_squared() * v.norm_squared() - u.dot(v).powi(2)).sqrt();
            let side = |k: usize| p[(k + 2) % 3] - p[(k + 1) % 3];
            for i in 0..3 {
                for j in 0..3 {
                    let at = face[i] as usize * 64 + face[j] as usize;
                    dense[at] += weight * side(i).dot(side(j)) / (4.0 * area);
                }
            }
        }
        let stiffness = made(&mesh, OperatorKind::Weighted(Parts { scalars, ..Parts::default() })).unwrap().stiffness;
        for (a, b) in stiffness.to_dense().values().iter().zip(&dense) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let mesh = sheet();
        let f = mesh.faces.len();
        let mut tensors = [1.0, 0.0, 1.0].repeat(f);
        tensors[3 * 7 + 1] = 1.0;
        let mut scalars = vec![1.0; f];
        scalars[5] = -1.0;
        for (parts, expected) in [
            (Parts { scalars: vec![1.0; f], tensors: vec![1.0; 3 * f], fixed: vec![] }, "scalars"),
            (Parts { scalars, ..Parts::default() }, "face 5"),
            (Parts { scalars: vec![f64::NAN; f], ..Parts::default() }, "face 0"),
            (Parts { scalars: vec![1.0; f - 1], ..Parts::default() }, "98 numbers, got 97"),
            (Parts { tensors, ..Parts::default() }, "face 7"),
            (Parts { tensors: vec![1.0; 4], ..Parts::default() }, "three numbers for each"),
            (Parts { fixed: vec![3, 64], ..Parts::default() }, "vertex 64"),
        ] {
            let refused = made(&mesh, OperatorKind::Weighted(parts)).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
        }
        let all = Parts { fixed: (0..64).collect(), ..Parts::default() };
        assert!(matches!(made(&mesh, OperatorKind::Weighted(all)), Err(OperatorError::NoUnknowns { .. })));
        let some = Parts { fixed: vec![9, 3, 9], ..Parts::default() };
        let problem = made(&mesh, OperatorKind::Weighted(some)).unwrap();
        assert_eq!((problem.size(), problem.unknowns.unwrap()[3]), (62, 4));
    }
}
