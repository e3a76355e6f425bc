//! Curvature as fields: the shape operator of each face as a stored tensor, and its directions as something to align
//! to.

use chladni_base::Vector3;

use crate::basis::FieldMisfit;
use crate::operator::OperatorError;
use crate::operator::curvature::curvatures;
use crate::operator::frames::{ONE, complex, parts, power};

use super::drawing::outward;
use super::reading::{tensor_deviator, tensor_in_frame};
use super::surface::FieldSurface;

/// The shape operator in every face, `3F` numbers `(a₁₁, a₂₂, √2 a₁₂)` in the frames, in 1/length of the input: the
/// mean of those of its corners.
///
/// # Errors
/// [`OperatorError`], as for any mesh without curvature.
pub fn curvature_tensors(surface: &FieldSurface) -> Result<Vec<f64>, OperatorError> {
    let at_vertices = curvatures(surface.mesh())?;
    let mut tensors = Vec::with_capacity(3 * surface.faces());
    for (f, face) in surface.mesh().faces.iter().enumerate() {
        let mut sum = [[0.0; 3]; 3];
        for &v in face {
            let v = v as usize;
            let (n, d) = (Vector3(at_vertices.normals[v]), Vector3(at_vertices.directions[v]));
            let other = n.cross(d);
            for i in 0..3 {
                for j in 0..3 {
                    sum[i][j] +=
                        (at_vertices.largest[v] * d[i] * d[j] + at_vertices.smallest[v] * other[i] * other[j]) / 3.0;
                }
            }
        }
        tensors.extend(tensor_in_frame(surface.frames(), f, sum));
    }
    Ok(tensors)
}

/// A field of directions to align to, and how much they mean in each face.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionField {
    /// Representation vectors of unit length, `2F` numbers.
    pub target: Vec<f64>,
    /// From 0, where all directions are alike, to 1.
    pub weights: Vec<f64>,
}

/// The eigendirections of stored tensors, of the larger eigenvalue for `n = 2`, of both for `n = 4` and so on, as an
/// n-field.
///
/// # Errors
/// [`FieldMisfit::Directions`] unless `n` is even, [`FieldMisfit::Numbers`] unless the tensors are three numbers a
/// face.
pub fn principal_directions(tensors: &[f64], n: u32) -> Result<DirectionField, FieldMisfit> {
    if n == 0 || !n.is_multiple_of(2) {
        return Err(FieldMisfit::Directions { n });
    }
    FieldMisfit::check("numbers of tensors", tensors.len(), 3 * tensors.len().div_ceil(3))?;
    let faces = tensors.len() / 3;
    let mut field = DirectionField { target: Vec::with_capacity(2 * faces), weights: Vec::with_capacity(faces) };
    for tensor in tensors.chunks_exact(3) {
        let deviator = tensor_deviator([tensor[0], tensor[1], tensor[2]]);
        let (anisotropy, mean) = (deviator.norm(), 0.5 * (tensor[0] + tensor[1]).abs());
        let sound = anisotropy > 1e-12 * mean && anisotropy.is_finite();
        let unit = if sound { deviator / anisotropy } else { ONE };
        field.target.extend(parts(power(unit, n / 2)));
        field.weights.push(if sound { anisotropy / (anisotropy + mean) } else { 0.0 });
    }
    Ok(field)
}

/// A strand of fur in a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strand {
    /// Where it grows: the barycentre of the face, in the units of the input.
    pub root: [f64; 3],
    /// From root to tip.
    pub tip: [f64; 3],
}

/// A combed coat: one strand per face, that leans towards a vector field of two numbers per face by at most `tilt`
/// radians, which it reaches where the field is as long as `full` or longer. Closed surfaces that are inside out have
/// it on their outside too.
///
/// # Errors
/// [`FieldMisfit::Numbers`] unless the field has two numbers for each face, [`FieldMisfit::Strands`] unless `length`
/// and `tilt` are finite and `full` is above zero.
pub fn fur(
    surface: &FieldSurface,
    field: &[f32],
    length: f64,
    tilt: f64,
    full: f64,
) -> Result<Vec<Strand>, FieldMisfit> {
    FieldMisfit::check("numbers of a field", field.len(), 2 * surface.faces())?;
    if !(length.is_finite() && tilt.is_finite() && full > 0.0) {
        return Err(FieldMisfit::Strands);
    }
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let outwards = outward(surface);
    let strands = field.chunks_exact(2).enumerate().map(|(f, u)| {
        let [x, y] = [f64::from(u[0]), f64::from(u[1])];
        let size = x.hypot(y);
        let (sine, cosine) = (tilt * (size / full).min(1.0)).sin_cos();
        let along = if size > 0.0 { frames.to_world(f, complex([x / size, y / size])) } else { Vector3::ZERO };
        let normal = outwards[f] * frames.normal(f);
        let root = mesh.barycentre(&mesh.faces[f]);
        Strand { root: root.into(), tip: (length * (cosine * normal + sine * along)).into() }
    });
    Ok(strands.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::shape::{Shape, TORUS_MAJOR_RADIUS, TORUS_MINOR_RADIUS, generate};

    #[test]
    fn a_torus_bends_most_around_its_tube() {
        let surface = FieldSurface::new(generate(Shape::Torus, 6000).unwrap()).unwrap();
        let tensors = curvature_tensors(&surface).unwrap();
        let field = principal_directions(&tensors, 2).unwrap();
        let mut worst = 1.0f64;
        for f in 0..surface.faces() {
            let c = surface.mesh().barycentre(&surface.mesh().faces[f]);
            let around = surface.frames().from_world(f, Vector3::new(-c[1], c[0], 0.0));
            let unit = power(around / around.norm(), 2);
            // Across the long way around: the representations are opposite.
            worst = worst.min(-(unit.re * field.target[2 * f] + unit.im * field.target[2 * f + 1]));
            let trace = tensors[3 * f] + tensors[3 * f + 1];
            let radius = c[0].hypot(c[1]);
            let expected = 1.0 / TORUS_MINOR_RADIUS + (radius - TORUS_MAJOR_RADIUS) / TORUS_MINOR_RADIUS / radius;
            assert!((trace / expected - 1.0).abs() < 0.1, "{trace} {expected}");
        }
        assert!(worst > 0.9, "{worst}");
        assert!(field.weights.iter().all(|w| (0.0..=1.0).contains(w)));
        assert_eq!(principal_directions(&tensors, 3), Err(FieldMisfit::Directions { n: 3 }));
        let (found, expected) = (tensors.len() - 1, tensors.len());
        let short = FieldMisfit::Numbers { what: "numbers of tensors", found, expected };
        assert_eq!(principal_directions(&tensors[1..], 2), Err(short));
    }

    #[test]
    fn strands_stand_up_where_the_field_is_zero_and_lean_along_it_elsewhere() {
        let surface = FieldSurface::new(generate(Shape::Rectangle, 30).unwrap()).unwrap();
        let mut field = vec![0f32; 2 * surface.faces()];
        field[2..4]
            .copy_from_slice(&parts(surface.frames().from_world(1, Vector3::new(5.0, 0.0, 0.0))).map(|x| x as f32));
        let strands = fur(&surface, &field, 0.5, 1.0, 1.0).unwrap();
        assert!((strands[0].tip[2] - 0.5).abs() < 1e-12);
        assert!(
            (strands[1].tip[2] - 0.5 * 1f64.cos()).abs() < 1e-6 && (strands[1].tip[0] - 0.5 * 1f64.sin()).abs() < 1e-6
        );
        let (found, expected) = (field.len() - 1, field.len());
        let short = FieldMisfit::Numbers { what: "numbers of a field", found, expected };
        assert_eq!(fur(&surface, &field[1..], 0.5, 1.0, 1.0), Err(short));
        assert_eq!(fur(&surface, &field, 0.5, 1.0, 0.0), Err(FieldMisfit::Strands));
    }
}
