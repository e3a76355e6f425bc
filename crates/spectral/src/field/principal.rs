//! Curvature as fields: the shape operator of each face as a stored tensor, and its directions as something to align
//! to.

use crate::operator::OperatorError;
use crate::operator::curvature::curvatures;
use crate::operator::frames::{Planar, power};

use super::basis::FieldSurface;
use super::drawing::outward;
use super::reading::{tensor_deviator, tensor_in_frame};

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
            let (n, d) = (at_vertices.normals[v], at_vertices.directions[v]);
            let other = [n[1] * d[2] - n[2] * d[1], n[2] * d[0] - n[0] * d[2], n[0] * d[1] - n[1] * d[0]];
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
/// n-field. `None` unless `n` is even and the tensors are three numbers a face.
pub fn principal_directions(tensors: &[f64], n: u32) -> Option<DirectionField> {
    if n == 0 || !n.is_multiple_of(2) || !tensors.len().is_multiple_of(3) {
        return None;
    }
    let faces = tensors.len() / 3;
    let mut field = DirectionField { target: Vec::with_capacity(2 * faces), weights: Vec::with_capacity(faces) };
    for tensor in tensors.chunks_exact(3) {
        let deviator: Planar = tensor_deviator([tensor[0], tensor[1], tensor[2]]);
        let (anisotropy, mean) = (deviator[0].hypot(deviator[1]), 0.5 * (tensor[0] + tensor[1]).abs());
        let sound = anisotropy > 1e-12 * mean && anisotropy.is_finite();
        let unit = if sound { [deviator[0] / anisotropy, deviator[1] / anisotropy] } else { [1.0, 0.0] };
        field.target.extend(power(unit, n / 2));
        field.weights.push(if sound { anisotropy / (anisotropy + mean) } else { 0.0 });
    }
    Some(field)
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
/// radians, which it reaches where the field is as long as `full` or longer. `None` unless the field fits and the
/// numbers are finite. Closed surfaces that are inside out have it on their outside too.
pub fn fur(surface: &FieldSurface, field: &[f32], length: f64, tilt: f64, full: f64) -> Option<Vec<Strand>> {
    let sound = length.is_finite() && tilt.is_finite() && full > 0.0;
    if field.len() != 2 * surface.faces() || !sound {
        return None;
    }
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let outwards = outward(surface);
    let strands = field.chunks_exact(2).enumerate().map(|(f, u)| {
        let [x, y] = [f64::from(u[0]), f64::from(u[1])];
        let size = x.hypot(y);
        let (sine, cosine) = (tilt * (size / full).min(1.0)).sin_cos();
        let along = if size > 0.0 { frames.to_world(f, [x / size, y / size]) } else { [0.0; 3] };
        let normal = frames.normal(f).map(|x| outwards[f] * x);
        let root = [0, 1, 2].map(|i| mesh.faces[f].iter().map(|&v| mesh.positions[v as usize][i]).sum::<f64>() / 3.0);
        Strand { root, tip: [0, 1, 2].map(|i| length * (cosine * normal[i] + sine * along[i])) }
    });
    Some(strands.collect())
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
            let c = [0, 1, 2].map(|i| {
                surface.mesh().faces[f].iter().map(|&v| surface.mesh().positions[v as usize][i]).sum::<f64>() / 3.0
            });
            let around = surface.frames().from_world(f, [-c[1], c[0], 0.0]);
            let size = around[0].hypot(around[1]);
            let unit = power([around[0] / size, around[1] / size], 2);
            // Across the long way around: the representations are opposite.
            worst = worst.min(-(unit[0] * field.target[2 * f] + unit[1] * field.target[2 * f + 1]));
            let trace = tensors[3 * f] + tensors[3 * f + 1];
            let radius = c[0].hypot(c[1]);
            let expected = 1.0 / TORUS_MINOR_RADIUS + (radius - TORUS_MAJOR_RADIUS) / TORUS_MINOR_RADIUS / radius;
            assert!((trace / expected - 1.0).abs() < 0.1, "{trace} {expected}");
        }
        assert!(worst > 0.9, "{worst}");
        assert!(field.weights.iter().all(|w| (0.0..=1.0).contains(w)));
        assert!(principal_directions(&tensors, 3).is_none() && principal_directions(&tensors[1..], 2).is_none());
    }

    #[test]
    fn strands_stand_up_where_the_field_is_zero_and_lean_along_it_elsewhere() {
        let surface = FieldSurface::new(generate(Shape::Rectangle, 30).unwrap()).unwrap();
        let mut field = vec![0f32; 2 * surface.faces()];
        field[2..4].copy_from_slice(&surface.frames().from_world(1, [5.0, 0.0, 0.0]).map(|x| x as f32));
        let strands = fur(&surface, &field, 0.5, 1.0, 1.0).unwrap();
        assert!((strands[0].tip[2] - 0.5).abs() < 1e-12);
        assert!(
            (strands[1].tip[2] - 0.5 * 1f64.cos()).abs() < 1e-6 && (strands[1].tip[0] - 0.5 * 1f64.sin()).abs() < 1e-6
        );
        assert!(fur(&surface, &field[1..], 0.5, 1.0, 1.0).is_none() && fur(&surface, &field, 0.5, 1.0, 0.0).is_none());
    }
}
