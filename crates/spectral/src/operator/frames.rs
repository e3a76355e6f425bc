//! A frame in every face, and what it takes to compare numbers of neighbouring faces.
//!
//! The frame of a face: `x` its normalised first edge, from corner 0 to corner 1, and `y = n × x` (thesis, appendix
//! 3.A). In it a vector is a complex number, `x + i y`, and `J`, which turns by +90°, the product with `i`. A vector
//! field is two numbers per face, a symmetric tensor field three.

use chladni_base::Vector3;
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::{DualGraph, NO_FACE};

use super::OperatorError;

pub use num_complex::Complex64;

/// The number 1.
pub const ONE: Complex64 = Complex64::new(1.0, 0.0);

/// Faces below this share of the mean area count as having no area: they get this much.
const LEAST_AREA: f64 = 1e-9;

/// A complex number divided by its magnitude; 1 where it has none.
#[inline(always)]
pub fn normalise(a: Complex64) -> Complex64 {
    let length = a.norm();
    if length > 1e-300 && length.is_finite() { a / length } else { ONE }
}

/// A natural power of a complex number, by squares: the same products in the same order for every `n`.
pub fn power(a: Complex64, n: u32) -> Complex64 {
    let (mut result, mut square, mut rest) = (ONE, a, n);
    while rest > 0 {
        if rest & 1 == 1 {
            result *= square;
        }
        square *= square;
        rest >>= 1;
    }
    result
}

/// The two coordinates of a number, as they are stored in flat arrays.
#[inline(always)]
pub const fn parts(z: Complex64) -> [f64; 2] {
    [z.re, z.im]
}

/// The number of two coordinates as they are stored in flat arrays.
#[inline(always)]
pub const fn complex([x, y]: [f64; 2]) -> Complex64 {
    Complex64::new(x, y)
}

/// `a · b` of two vectors of a frame: the real part of `ā b`.
#[inline(always)]
pub fn inner(a: Complex64, b: Complex64) -> f64 {
    a.re * b.re + a.im * b.im
}

/// `a × b` of two vectors of a frame: the imaginary part of `ā b`.
#[inline(always)]
pub fn outer(a: Complex64, b: Complex64) -> f64 {
    a.re * b.im - a.im * b.re
}

/// What carries numbers from one face into another one: `z ↦ by · z`, and between faces of opposite orientation
/// `z ↦ by · z̄`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// A unit number.
    pub by: Complex64,
    /// Whether the orientations are opposite.
    pub mirrored: bool,
}

impl Turn {
    /// What leaves everything as it is.
    pub const NONE: Self = Self { by: ONE, mirrored: false };

    /// What becomes of a number.
    #[inline(always)]
    pub fn of(self, z: Complex64) -> Complex64 {
        self.by * if self.mirrored { z.conj() } else { z }
    }

    /// This one after another one.
    #[inline(always)]
    pub fn after(self, other: Self) -> Self {
        Self { by: self.of(other.by), mirrored: self.mirrored != other.mirrored }
    }

    /// The way back.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        Self { by: if self.mirrored { self.by } else { self.by.conj() }, ..self }
    }

    /// What carries the `n`-th powers of numbers.
    pub fn power(self, n: u32) -> Self {
        Self { by: power(self.by, n), ..self }
    }

    /// The mean of several with weights; those of the orientation that has less weight do not count, since there is
    /// nothing between the two.
    pub fn mean(all: impl IntoIterator<Item = (f64, Self)>) -> Self {
        let (mut sums, mut weights) = ([Complex64::ZERO; 2], [0.0; 2]);
        for (weight, Self { by, mirrored }) in all {
            sums[usize::from(mirrored)] += weight * by;
            weights[usize::from(mirrored)] += weight;
        }
        let mirrored = weights[1] > weights[0];
        Self { by: normalise(sums[usize::from(mirrored)]), mirrored }
    }
}

/// The frames of all faces, their edges in them, and areas; edges and areas on the surface scaled to unit area.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceFrames {
    x: Vec<Vector3>,
    y: Vec<Vector3>,
    edges: Vec<[Complex64; 3]>,
    areas: Vec<f64>,
    area: f64,
    degenerate: usize,
}

impl FaceFrames {
    /// Frames of a mesh whose faces refer to vertices that are there.
    ///
    /// A face without area takes the frame of its longest edge and any normal; its area counts as a billionth of the
    /// mean.
    ///
    /// # Errors
    /// [`OperatorError`] names a corner out of range or a coordinate that is not finite, or says that the mesh has no
    /// area.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, OperatorError> {
        let n = mesh.positions.len();
        for (face, corners) in mesh.faces.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= n) {
                return Err(OperatorError::VertexOutOfRange { face, vertex, vertices: n });
            }
        }
        if let Some(vertex) = mesh.positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(OperatorError::NotFinite { vertex });
        }
        let area = chladni_mesh::measure::surface_area(mesh);
        if !(area > 0.0 && area.is_finite()) {
            return Err(OperatorError::NoArea);
        }
        let unit = 1.0 / area.sqrt();
        let least = LEAST_AREA / mesh.faces.len() as f64;
        let per_face: Vec<Face> =
            mesh.faces.par_iter().with_min_len(1 << 12).map(|face| Face::new(mesh, face, unit)).collect();
        let mut frames = Self {
            x: per_face.par_iter().with_min_len(1 << 14).map(|f| f.x).collect(),
            y: per_face.par_iter().with_min_len(1 << 14).map(|f| f.y).collect(),
            edges: per_face.par_iter().with_min_len(1 << 14).map(|f| f.edges).collect(),
            areas: per_face.par_iter().with_min_len(1 << 14).map(|f| f.area).collect(),
            area,
            degenerate: 0,
        };
        for a in &mut frames.areas {
            if *a < least {
                *a = least;
                frames.degenerate += 1;
            }
        }
        Ok(frames)
    }

    /// The number of faces.
    pub fn faces(&self) -> usize {
        self.areas.len()
    }

    /// The first axes of all faces, unit vectors in ℝ³.
    pub fn x_axes(&self) -> &[Vector3] {
        &self.x
    }

    /// The second axes of all faces, unit vectors in ℝ³.
    pub fn y_axes(&self) -> &[Vector3] {
        &self.y
    }

    /// The unit normal of a face.
    pub fn normal(&self, face: usize) -> Vector3 {
        self.x[face].cross(self.y[face])
    }

    /// The areas of the faces; they add up to 1.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// The area of the mesh in the units of the input.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// How many faces have no area to speak of.
    pub fn degenerate_faces(&self) -> usize {
        self.degenerate
    }

    /// The edges of a face in its frame, counter-clockwise, edge `k` opposite to corner `k`; unit area.
    pub fn edges(&self, face: usize) -> [Complex64; 3] {
        self.edges[face]
    }

    /// What carries vectors of the neighbour across edge `k` into the frame of `face`: both see the shared edge, in
    /// opposite directions, or in the same one where their orientations are opposite. `None` at a boundary.
    pub fn carry(&self, dual: &DualGraph, face: usize, k: usize) -> Option<Turn> {
        let neighbour = dual.neighbours(face)[k];
        if neighbour == NO_FACE {
            return None;
        }
        let j = dual.slot(neighbour, dual.edges(face)[k]);
        let (own, other) = (self.edges[face][k], self.edges[neighbour as usize][j]);
        let mirrored = dual.is_mirrored(face, k);
        let by = if mirrored { own * other } else { -own * other.conj() };
        Some(Turn { by: normalise(by), mirrored })
    }

    /// A vector of a frame in ℝ³.
    pub fn to_world(&self, face: usize, v: Complex64) -> Vector3 {
        v.re * self.x[face] + v.im * self.y[face]
    }

    /// A vector in ℝ³ in a frame; its normal part is lost.
    pub fn from_world(&self, face: usize, v: Vector3) -> Complex64 {
        Complex64::new(v.dot(self.x[face]), v.dot(self.y[face]))
    }

    /// The same frames, each turned by its own angle, given as unit numbers: what was `v` in the old frame is
    /// `v / turn` in the new one. Nothing that matters may depend on the choice of frames.
    ///
    /// # Panics
    /// Unless there is a turn for each face.
    pub fn turned(&self, turns: &[Complex64]) -> Self {
        assert_eq!(turns.len(), self.faces(), "turns, faces");
        let mut turned = self.clone();
        for (face, &turn) in turns.iter().enumerate() {
            let turn = normalise(turn);
            turned.x[face] = self.to_world(face, turn);
            turned.y[face] = self.to_world(face, Complex64::new(-turn.im, turn.re));
            turned.edges[face] = self.edges[face].map(|e| e * turn.conj());
        }
        turned
    }
}

struct Face {
    x: Vector3,
    y: Vector3,
    edges: [Complex64; 3],
    area: f64,
}

impl Face {
    fn new(mesh: &TriangleMesh, face: &[u32; 3], unit: f64) -> Self {
        let [p, q, r] = mesh.corners(face);
        let e = [(r - q) * unit, (p - r) * unit, (q - p) * unit];
        let normal = e[2].cross(e[0]);
        let doubled = normal.norm();
        // The first edge, unless it has no length.
        let first = [e[2], e[0], e[1]].into_iter().find(|e| e.norm_squared() > 1e-60).unwrap_or(Vector3::AXES[0]);
        let x = unit_vector(first);
        let longest = e.iter().map(|e| e.norm_squared()).fold(0.0, f64::max);
        let y = if doubled > 4.0 * f64::EPSILON * longest {
            unit_vector((normal / doubled).cross(x))
        } else {
            let least = (0..3).min_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs())).unwrap_or(0);
            unit_vector(Vector3::AXES[least].cross(x))
        };
        Self { x, y, edges: e.map(|e| Complex64::new(e.dot(x), e.dot(y))), area: 0.5 * doubled }
    }
}

pub(crate) fn unit_vector(a: Vector3) -> Vector3 {
    a.normalized().unwrap_or(Vector3::AXES[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::sphere;

    #[test]
    fn frames_are_right_handed_and_hold_the_edges() {
        let mesh = sphere(7);
        let frames = FaceFrames::new(&mesh).unwrap();
        let scale = 1.0 / frames.area().sqrt();
        assert!((frames.areas().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (f, face) in mesh.faces.iter().enumerate() {
            let p = mesh.corners(face);
            let n = frames.normal(f);
            assert!(n.dot(p[0]) > 0.9, "outwards");
            for k in 0..3 {
                let e = frames.to_world(f, frames.edges(f)[k]);
                let expected = (p[(k + 2) % 3] - p[(k + 1) % 3]) * scale;
                assert!((0..3).all(|i| (e[i] - expected[i]).abs() < 1e-14));
                let back = frames.from_world(f, e);
                assert!((back.re - frames.edges(f)[k].re).abs() < 1e-14);
            }
            assert!(frames.edges(f)[2].im.abs() < 1e-14 && frames.edges(f)[2].re > 0.0, "x is the first edge");
        }
    }

    #[test]
    fn carrying_there_and_back_changes_nothing() {
        let mesh = sphere(5);
        let dual = DualGraph::new(&mesh).unwrap();
        let frames = FaceFrames::new(&mesh).unwrap();
        for f in 0..frames.faces() {
            for k in 0..3 {
                let g = dual.neighbours(f)[k];
                let there = frames.carry(&dual, f, k).unwrap().by;
                let back = frames.carry(&dual, g as usize, dual.slot(g, dual.edges(f)[k])).unwrap().by;
                let both = there * back;
                assert!((both.re - 1.0).abs() < 1e-13 && both.im.abs() < 1e-13);
            }
        }
    }

    #[test]
    fn faces_without_area_are_counted_and_get_a_frame() {
        let mut mesh = sphere(3);
        let at = mesh.positions[mesh.faces[0][0] as usize];
        mesh.positions.push([at[0] * 2.0, 0.0, 0.0]);
        mesh.positions.push([at[0] * 3.0, 0.0, 0.0]);
        mesh.positions.push([at[0] * 4.0, 0.0, 0.0]);
        let n = mesh.positions.len() as u32;
        mesh.faces.push([n - 3, n - 2, n - 1]);
        let frames = FaceFrames::new(&mesh).unwrap();
        assert_eq!(frames.degenerate_faces(), 1);
        let last = frames.faces() - 1;
        assert!((frames.normal(last).norm_squared() - 1.0).abs() < 1e-12);
        assert!(frames.areas().iter().all(|a| *a > 0.0));
    }

    #[test]
    fn powers_are_repeated_products() {
        let z = normalise(Complex64::new(0.3, -0.8));
        let mut product = ONE;
        for n in 0..9 {
            let p = power(z, n);
            assert!((p.re - product.re).abs() < 1e-14 && (p.im - product.im).abs() < 1e-14);
            product *= z;
        }
        assert_eq!(normalise(Complex64::ZERO), ONE);
    }
}
