//! Vectors carried over a surface from where they are given, along shortest paths: the vector heat method (Sharp,
//! Soliman and Crane 2019).
//!
//! Card. `(M + tS) Y = Σ x_i δ_i` with the connection Laplacian of [`crate::operator::transport`] has the directions;
//! `(M + tL)` with the Laplacian of numbers on faces, of the same weights, has the lengths: `Y / |Y| · u / φ` with
//! right-hand sides `|x_i|` and 1. Where sources compete, the nearest wins. On planes it is exact; on a sphere the mean
//! angle to what great circles carry is .011, .007 and .006 with 1,280, 5,120 and 20,480 faces: it does not vanish with
//! their size, as differences across edges are not consistent and heat takes ways that are a little longer than the
//! shortest.

use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;

use super::basis::FieldError;
use super::poisson::{Factor, PoissonError};
use super::surface::FieldSurface;
use crate::operator::frames::Complex64;
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

/// Heat decays by a factor of e over `√t`. Beyond so many of them double precision has nothing left, with a margin for
/// ways that are longer than a box.
const FARTHEST: f64 = 120.0;

/// The time of the heat steps for each length of an edge, both on the surface of unit area.
const SPREAD: f64 = 0.1;

/// Both heat steps, factored.
pub struct VectorHeat {
    vectors: Factor,
    numbers: Factor,
}

/// A vector in the frame of a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VectorSource {
    /// The face.
    pub face: u32,
    /// The vector.
    pub vector: [f64; 2],
}

/// Why vectors cannot be carried over a surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransportError {
    /// The surface has no such operator.
    #[error(transparent)]
    Surface(#[from] FieldError),
    /// A heat step was not factored.
    #[error(transparent)]
    Heat(#[from] PoissonError),
    /// There is no source.
    #[error("there are no vectors to carry")]
    NoSource,
    /// Too little heat arrives somewhere.
    #[error(
        "face {face} is out of reach of the sources: it is on another component, or too far for the size of the faces"
    )]
    OutOfReach {
        /// The face.
        face: usize,
    },
    /// Heat arrives, but that of the vectors adds up to zero.
    #[error("the vectors of the sources cancel each other on face {face}: none of them is nearest there")]
    Cancelling {
        /// The face.
        face: usize,
    },
}

/// Less heat than this is as good as none: what it carries may be lost already.
const LEAST_HEAT: f64 = 1e-290;

impl VectorHeat {
    /// Factors both heat steps, of a time in proportion to the mean length of edges; longer where the surface is so
    /// large that no heat would arrive.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn new(surface: &FieldSurface, monitor: &dyn Monitor) -> Result<Self, TransportError> {
        let (mesh, frames) = (surface.mesh(), surface.frames());
        let kind = FieldKind::NVector { n: 1 };
        let boundary = FieldBoundary::default();
        let operator = FieldOperator::<2>::assemble(kind, mesh, surface.dual(), frames, boundary);
        let operator = operator.map_err(FieldError::Operator)?;
        let sum: f64 = (0..surface.faces()).flat_map(|f| frames.edges(f)).map(Complex64::norm).sum();
        let mean = sum / (3 * surface.faces()).max(1) as f64;
        let extent = |i: usize| {
            let along = mesh.faces.iter().flatten().map(|&v| mesh.positions[v as usize][i]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        let size = (0..3).map(|i| extent(i).powi(2)).sum::<f64>().sqrt() / frames.area().sqrt();
        // Over less than a few faces heat follows the graph of the faces, not the surface: √t shrinks more slowly than
        // they do.
        let time = (mean * SPREAD).max(mean.powi(2)).max((size / FARTHEST).powi(2));
        let stiffness = operator.stiffness.to_sparse();
        let vectors = heated(&stiffness, |row| operator.mass[row / 2], time);
        let mut entries = Vec::with_capacity(operator.stiffness.entries());
        for row in 0..operator.stiffness.rows() {
            let (columns, blocks) = operator.stiffness.row(row);
            for (&column, block) in columns.iter().zip(blocks) {
                // A turn times a weight; the diagonal is the sum of the weights.
                let weight = block[0][0].hypot(block[1][0]);
                entries.push((row as u32, column, if column as usize == row { weight } else { -weight }));
            }
        }
        let numbers = heated(&SparseMatrix::summed(surface.faces(), entries), |row| operator.mass[row], time);
        Ok(Self { vectors: Factor::new(&vectors, monitor)?, numbers: Factor::new(&numbers, monitor)? })
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        self.vectors.bytes() + self.numbers.bytes()
    }

    /// A vector for each face, in its frame: those of the sources, carried there.
    ///
    /// # Errors
    /// [`TransportError`] names the first face where no heat arrives, or where the vectors cancel each other.
    ///
    /// # Panics
    /// Where a source is on no face.
    pub fn carried(&self, sources: &[VectorSource]) -> Result<Vec<f64>, TransportError> {
        if sources.is_empty() {
            return Err(TransportError::NoSource);
        }
        let (mut y, mut u) = (vec![0.0; self.vectors.size()], vec![0.0; self.numbers.size()]);
        let mut phi = u.clone();
        for source in sources {
            let face = source.face as usize;
            y[2 * face] += source.vector[0];
            y[2 * face + 1] += source.vector[1];
            u[face] += source.vector[0].hypot(source.vector[1]);
            phi[face] += 1.0;
        }
        let mut right = [y];
        self.vectors.solve(&mut right);
        let mut lengths = [u, phi];
        self.numbers.solve(&mut lengths);
        let [mut y] = right;
        for (face, v) in y.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            let (own, length) = (v[0].hypot(v[1]), lengths[0][face] / lengths[1][face]);
            if !(own > f64::MIN_POSITIVE && length.is_finite()) {
                let arrives = length.is_finite() && lengths.iter().all(|heat| heat[face] > LEAST_HEAT);
                return Err(if arrives && own.is_finite() {
                    TransportError::Cancelling { face }
                } else {
                    TransportError::OutOfReach { face }
                });
            }
            *v = v.map(|x| x / own * length);
        }
        Ok(y)
    }
}

/// `M + tA`.
fn heated(matrix: &SparseMatrix, mass: impl Fn(usize) -> f64, time: f64) -> SparseMatrix {
    let mut entries = Vec::with_capacity(matrix.entries() + matrix.rows());
    for row in 0..matrix.rows() {
        let (columns, values) = matrix.row(row);
        entries.extend(columns.iter().zip(values).map(|(&column, value)| (row as u32, column, time * value)));
        entries.push((row as u32, row as u32, mass(row)));
    }
    SparseMatrix::summed(matrix.rows(), entries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::frames::{complex, parts};
    use chladni_base::Unwatched;
    use chladni_base::Vector3;
    use chladni_mesh::fixtures::union;
    use chladni_mesh::shape::{Shape, generate};

    fn surface(shape: Shape, vertices: usize) -> FieldSurface {
        FieldSurface::new(generate(shape, vertices).unwrap()).unwrap()
    }

    #[test]
    fn on_a_plane_a_vector_stays_as_it_is() {
        let surface = surface(Shape::Violin, 800);
        let given = Vector3::new(0.6, -1.1, 0.0);
        let source = VectorSource { face: 40, vector: parts(surface.frames().from_world(40, given)) };
        let field = VectorHeat::new(&surface, &Unwatched).unwrap().carried(&[source]).unwrap();
        for (face, v) in field.as_chunks::<2>().0.iter().enumerate() {
            let own = surface.frames().to_world(face, complex(*v));
            assert!((0..3).all(|i| (own[i] - given[i]).abs() < 1e-9), "{face}: {own:?}");
        }
    }

    #[test]
    fn the_nearest_source_gives_the_length() {
        let surface = surface(Shape::Rectangle, 900);
        let last = surface.faces() as u32 - 1;
        let sources = [(0, 1.0), (last, 5.0)]
            .map(|(face, s)| (face, surface.frames().from_world(face as usize, Vector3::new(s, 0.0, 0.0))))
            .map(|(face, vector)| VectorSource { face, vector: parts(vector) });
        let field = VectorHeat::new(&surface, &Unwatched).unwrap().carried(&sources).unwrap();
        let lengths: Vec<f64> = field.as_chunks::<2>().0.iter().map(|v| v[0].hypot(v[1])).collect();
        assert!((lengths[0] - 1.0).abs() < 1e-3 && (lengths[last as usize] - 5.0).abs() < 1e-3);
        assert!(lengths.iter().all(|l| (0.999..5.001).contains(l)));
    }

    /// The mean angle between carried vectors and those that great circles carry, but for a cap around the opposite
    /// point.
    fn off(vertices: usize) -> f64 {
        let surface = surface(Shape::Sphere, vertices);
        let mesh = surface.mesh();
        let centre = |face: usize| {
            let sum: Vector3 = mesh.corners(&mesh.faces[face]).into_iter().sum();
            sum.normalized().unwrap()
        };
        let (from, source) = (centre(0), VectorSource { face: 0, vector: [1.0, 0.0] });
        let given = surface.frames().to_world(0, complex(source.vector));
        let field = VectorHeat::new(&surface, &Unwatched).unwrap().carried(&[source]).unwrap();
        let (mut sum, mut count) = (0.0, 0.0);
        for (face, v) in field.as_chunks::<2>().0.iter().enumerate() {
            let to = centre(face);
            let cosine = from.dot(to);
            if cosine < -0.8 {
                continue;
            }
            // The turn that takes one point to the other: v − (q·v)(p + q) / (1 + p·q).
            let share = to.dot(given) / (1.0 + cosine);
            let exact = given - share * (from + to);
            let own = surface.frames().to_world(face, complex(*v));
            assert!((own.norm() - 1.0).abs() < 1e-6);
            sum += (own.dot(exact) / (own.norm_squared() * exact.norm_squared()).sqrt()).clamp(-1.0, 1.0).acos();
            count += 1.0;
        }
        sum / count
    }

    #[test]
    fn on_a_sphere_vectors_are_those_that_great_circles_carry_to_a_degree() {
        let errors = [off(642), off(2562), off(10_242)];
        println!("{errors:?}");
        assert!(errors.is_sorted_by(|a, b| a > b) && errors[0] < 0.0175, "{errors:?}");
    }

    #[test]
    fn what_is_out_of_reach_is_named() {
        let pieces = [Shape::Sphere, Shape::Torus].map(|shape| generate(shape, 200).unwrap());
        let first = pieces[0].faces.len();
        let surface = FieldSurface::new(union(&pieces)).unwrap();
        let heat = VectorHeat::new(&surface, &Unwatched).unwrap();
        let refused = heat.carried(&[VectorSource { face: 0, vector: [1.0, 0.0] }]);
        assert_eq!(refused, Err(TransportError::OutOfReach { face: first }));
        assert_eq!(heat.carried(&[]), Err(TransportError::NoSource));
        // Both vectors of each pair on one face: not even the right-hand side is left of them.
        let pair = |face: u32| [[1.0, 0.0], [-1.0, 0.0]].map(|vector| VectorSource { face, vector });
        let refused = heat.carried(&[pair(0), pair(first as u32)].concat());
        assert_eq!(refused, Err(TransportError::Cancelling { face: 0 }));
    }
}
