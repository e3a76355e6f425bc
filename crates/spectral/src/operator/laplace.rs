//! The Laplace–Beltrami operator: cotangent stiffness and the three masses of piecewise linear functions.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, weak form; strong form `M⁻¹S` |
//! | definiteness | `S` positive semi-definite, its kernel the functions constant on each component; `M` positive definite |
//! | units | `S` none; `M` area, scaled here so that it sums to 1; eigenvalues 1/length² |
//! | boundary | natural (Neumann) |
//! | valid for | any triangles, manifold or not; orientation does not matter |
//! | source | Pinkall and Polthier 1993; Meyer et al. 2003 for the Voronoi mass |

use chladni_base::parallel::*;

use super::corners::Corners;
pub use super::shapes::MASSLESS;
use super::shapes::{self, Triangles};
use super::{EigenProblem, MassKind, OperatorError};
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::TriangleShape;

/// A face is thin when the cotangent of one of its angles is larger than this: 0.06 degrees, or 179.94.
pub(super) const THIN: f64 = 1e3;

/// A face is a needle when its longest edge is so many times its height: by cotangents, its weights are then so large
/// that what rounding leaves of their sums is felt by the lowest eigenpairs, even if there is only one such face.
pub(super) const NEEDLE: f64 = 1e6;

/// What assembly came across.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AssemblyReport {
    /// Faces whose area cannot be told from zero; they contributed nothing.
    pub zero_area_faces: usize,
    /// Vertices without any face that has an area; they were given [`MASSLESS`].
    pub massless_vertices: usize,
}

/// Assembles stiffness and mass on the mesh scaled to unit area.
///
/// Cotangents come from dot and cross products; no angle is formed. The result does not depend on the number of
/// threads, and `S` is symmetric to the last bit.
///
/// # Errors
/// [`OperatorError`] names a corner out of range or a coordinate that is not finite, or says that the mesh has no area.
pub fn assemble(mesh: &TriangleMesh, mass: MassKind) -> Result<EigenProblem, OperatorError> {
    assemble_with_report(mesh, mass).map(|(problem, _)| problem)
}

/// [`assemble`], and what it came across.
///
/// # Errors
/// As [`assemble`].
pub fn assemble_with_report(
    mesh: &TriangleMesh,
    mass: MassKind,
) -> Result<(EigenProblem, AssemblyReport), OperatorError> {
    let measured = measure(mesh)?;
    let (problem, massless_vertices) = cotangent(mesh, &measured, 1.0, mass);
    Ok((problem, AssemblyReport { zero_area_faces: measured.zero_area_faces, massless_vertices }))
}

/// How many faces there are, and how many of them are bad.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quality {
    pub faces: usize,
    pub thin: usize,
    pub needles: usize,
}

/// What is read off the positions once.
pub(super) struct Measured {
    /// The power of two that lengths are multiplied by.
    pub scale: f64,
    pub corners: Corners,
    /// On the scaled mesh.
    pub shapes: Vec<TriangleShape>,
    /// On the scaled mesh.
    pub area: f64,
    pub zero_area_faces: usize,
    /// Those without area included.
    pub thin_faces: usize,
    /// Faces with an area, but next to none.
    pub needles: usize,
}

/// Measures every face.
///
/// # Errors
/// As [`assemble`].
pub(super) fn measure(mesh: &TriangleMesh) -> Result<Measured, OperatorError> {
    let scale = power_of_two_scale(&mesh.positions)?;
    let corners = Corners::new(mesh.positions.len(), &mesh.faces)?;
    let (shapes, sums) = face_shapes(mesh, scale);
    if !(sums.area.is_finite() && sums.area > 0.0) {
        return Err(OperatorError::NoArea);
    }
    let Sums { area, zero_area: zero_area_faces, thin: thin_faces, needles } = sums;
    Ok(Measured { scale, corners, shapes, area, zero_area_faces, thin_faces, needles })
}

/// The problem that follows from the cotangents of the faces as they are, which cover the surface `covers` times, and
/// the number of vertices without mass.
pub(super) fn cotangent(
    mesh: &TriangleMesh,
    measured: &Measured,
    covers: f64,
    mass: MassKind,
) -> (EigenProblem, usize) {
    let Measured { scale, corners, shapes, area, .. } = measured;
    let triangles =
        Triangles { vertices: mesh.positions.len(), rows: None, faces: &mesh.faces, shapes, sheets: covers };
    let assembled = shapes::assemble(&triangles, corners, *area, mass);
    let problem = EigenProblem {
        stiffness: assembled.stiffness,
        mass: assembled.mass,
        area: area / covers / scale / scale,
        unknowns: None,
    };
    (problem, assembled.massless_vertices)
}

/// The power of two that brings the largest extent of the bounding box near 1, so that products neither overflow nor
/// underflow.
pub(crate) fn power_of_two_scale(positions: &[[f64; 3]]) -> Result<f64, OperatorError> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut finite = true;
    for p in positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
            finite &= p[k].is_finite();
        }
    }
    if !finite {
        let vertex = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())).unwrap_or(0);
        return Err(OperatorError::NotFinite { vertex });
    }
    let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    // Outside this range the scale or its inverse would not be a normal number.
    if extent > 1e-150 && extent < 1e150 { Ok((-extent.log2().round()).exp2()) } else { Err(OperatorError::NoArea) }
}

/// What is summed over faces.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    pub area: f64,
    pub zero_area: usize,
    pub thin: usize,
    pub needles: usize,
}

/// Whether a face is thin, or has no area at all.
pub(super) fn is_thin(shape: &TriangleShape) -> bool {
    let steepest = shape.half_cotangents.iter().fold(0.0f64, |most, c| most.max(c.abs()));
    shape.area == 0.0 || steepest > 0.5 * THIN
}

impl Sums {
    fn add(&mut self, shape: &TriangleShape) {
        // The two angles at an edge have cotangents that sum to its length over the height on it.
        let [a, b, c] = shape.half_cotangents;
        let longest = 2.0 * (a + b).max(b + c).max(c + a);
        self.area += shape.area;
        self.zero_area += usize::from(shape.area == 0.0);
        self.thin += usize::from(is_thin(shape));
        self.needles += usize::from(shape.area > 0.0 && longest > NEEDLE);
    }

    fn total(parts: &[Self]) -> Self {
        let mut total = Self::default();
        for part in parts {
            total.area += part.area;
            total.zero_area += part.zero_area;
            total.thin += part.thin;
            total.needles += part.needles;
        }
        total
    }
}

/// Faces that one task measures. Fixed, so that sums do not depend on the number of threads.
const FACES_PER_TASK: usize = 8192;

/// The shape of a face of the scaled mesh.
#[inline]
pub(super) fn shape_of(mesh: &TriangleMesh, face: [u32; 3], scale: f64) -> TriangleShape {
    TriangleShape::of_corners(mesh.corners(&face).map(|p| p * scale))
}

/// The sums that [`measure`] takes, of shapes that nobody keeps.
pub(super) fn sums(mesh: &TriangleMesh, scale: f64) -> Sums {
    let of = |faces: &[[u32; 3]]| {
        let mut sums = Sums::default();
        faces.iter().for_each(|&face| sums.add(&shape_of(mesh, face, scale)));
        sums
    };
    Sums::total(&mesh.faces.par_chunks(FACES_PER_TASK).map(of).collect::<Vec<Sums>>())
}

fn face_shapes(mesh: &TriangleMesh, scale: f64) -> (Vec<TriangleShape>, Sums) {
    let mut shapes = vec![TriangleShape::default(); mesh.faces.len()];
    let parts: Vec<Sums> = shapes
        .par_chunks_mut(FACES_PER_TASK)
        .zip(mesh.faces.par_chunks(FACES_PER_TASK))
        .map(|(shapes, faces)| {
            let mut sums = Sums::default();
            for (shape, &face) in shapes.iter_mut().zip(faces) {
                *shape = shape_of(mesh, face, scale);
                sums.add(shape);
            }
            sums
        })
        .collect();
    (shapes, Sums::total(&parts))
}

#[cfg(test)]
#[path = "laplace_tests.rs"]
mod tests;
