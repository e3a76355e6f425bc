//! Between stored numbers and what they mean: directions, roots of n-vectors, eigenvalues of tensors.

use chladni_base::Vector3;

use crate::operator::frames::{Complex64, FaceFrames, ONE, complex, parts, power};
use crate::operator::transport::FieldKind;

/// The representation of `n` vectors of which `direction` is one: the same length, `n` times the angle.
pub fn representation(direction: Complex64, n: u32) -> Complex64 {
    let length = direction.norm();
    if !(length > 0.0 && length.is_finite()) {
        return Complex64::ZERO;
    }
    length * power(direction / length, n)
}

/// The `n` vectors that a representation stands for: its length, the `n`-th part of its angle, and turns by 360°/n from
/// there.
pub fn roots(representation: Complex64, n: u32) -> Vec<Complex64> {
    let (length, angle) = (representation.norm(), representation.arg());
    (0..n.max(1))
        .map(|k| {
            let (sine, cosine) = ((angle + std::f64::consts::TAU * f64::from(k)) / f64::from(n.max(1))).sin_cos();
            length * Complex64::new(cosine, sine)
        })
        .collect()
}

/// A symmetric tensor by its eigenvalues and the unit direction of the first; the second is turned by 90°.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TensorAxes {
    /// The eigenvalues, the larger first.
    pub values: [f64; 2],
    /// The unit eigenvector of the larger one; its sign means nothing.
    pub direction: Complex64,
}

/// Eigenvalues and directions of a tensor stored as `(a₁₁, a₂₂, √2 a₁₂)`.
pub fn tensor_axes(tensor: [f64; 3]) -> TensorAxes {
    let mean = 0.5 * (tensor[0] + tensor[1]);
    let deviator = tensor_deviator(tensor);
    let radius = deviator.norm();
    TensorAxes { values: [mean + radius, mean - radius], direction: normalised(roots(deviator, 2)[0]) }
}

/// The deviator `((a₁₁ − a₂₂)/2, a₁₂)` of a stored tensor: a 2-field.
pub fn tensor_deviator(tensor: [f64; 3]) -> Complex64 {
    Complex64::new(0.5 * (tensor[0] - tensor[1]), tensor[2] * std::f64::consts::FRAC_1_SQRT_2)
}

/// A symmetric tensor in ℝ³ that acts in the plane of a face, stored in its frame.
pub fn tensor_in_frame(frames: &FaceFrames, face: usize, tensor: [[f64; 3]; 3]) -> [f64; 3] {
    let (x, y) = (frames.x_axes()[face], frames.y_axes()[face]);
    let product = |a: Vector3, b: Vector3| -> f64 {
        (0..3).map(|i| (0..3).map(|j| a[i] * tensor[i][j] * b[j]).sum::<f64>()).sum()
    };
    [product(x, x), product(y, y), std::f64::consts::SQRT_2 * 0.5 * (product(x, y) + product(y, x))]
}

/// The numbers to store in a face for a direction in ℝ³; `None` where it has no part in the plane of the face, or the
/// kind of field has no directions.
pub fn direction_in_frame(kind: FieldKind, frames: &FaceFrames, face: usize, direction: [f64; 3]) -> Option<[f64; 3]> {
    let direction = Vector3(direction);
    let planar = frames.from_world(face, direction);
    let (length, size) = (planar.norm(), direction.norm());
    // Also false where something is not a number.
    if !(length > 1e-9 * size && length.is_finite()) {
        return None;
    }
    match kind {
        FieldKind::Vector {} => Some([planar.re, planar.im, 0.0]),
        FieldKind::NVector { n } => {
            let [x, y] = parts(representation(planar, n));
            Some([x, y, 0.0])
        }
        FieldKind::Tensor {} => None,
    }
}

/// A vector field, two numbers per face, in ℝ³.
pub fn to_world(frames: &FaceFrames, field: &[f32]) -> Vec<[f32; 3]> {
    let each =
        |(face, v): (usize, &[f32])| frames.to_world(face, complex([v[0], v[1]].map(f64::from))).map(|x| x as f32);
    field.chunks_exact(2).take(frames.faces()).enumerate().map(each).collect()
}

fn normalised(v: Complex64) -> Complex64 {
    let length = v.norm();
    if length > 0.0 { v / length } else { ONE }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::sphere;

    #[test]
    fn roots_have_the_representation_they_come_from() {
        let z = Complex64::new(0.3, -1.2);
        for n in 1..7 {
            let all = roots(z, n);
            assert_eq!(all.len(), n as usize);
            for root in all {
                let back = representation(root, n);
                assert!((back.re - z.re).abs() < 1e-12 && (back.im - z.im).abs() < 1e-12);
            }
        }
        assert_eq!(representation(Complex64::ZERO, 3), Complex64::ZERO);
    }

    #[test]
    fn tensors_are_put_together_again_from_their_axes() {
        for tensor in [[1.0, -0.5, 0.7], [0.2, 0.9, 0.0], [0.9, 0.2, 0.0], [1.0, 1.0, 0.0]] {
            let TensorAxes { values, direction: Complex64 { re: x, im: y } } = tensor_axes(tensor);
            let rebuilt = [
                values[0] * x * x + values[1] * y * y,
                values[0] * y * y + values[1] * x * x,
                std::f64::consts::SQRT_2 * (values[0] - values[1]) * x * y,
            ];
            assert!((0..3).all(|i| (rebuilt[i] - tensor[i]).abs() < 1e-12), "{tensor:?}");
            assert!(values[0] >= values[1]);
        }
    }

    #[test]
    fn directions_and_tensors_come_into_frames_and_back() {
        let frames = FaceFrames::new(&sphere(4)).unwrap();
        for face in [0, 7, 50] {
            let along = frames.to_world(face, Complex64::new(0.6, 0.8));
            let stored = direction_in_frame(FieldKind::NVector { n: 2 }, &frames, face, along.into()).unwrap();
            assert!((stored[0] - (0.36 - 0.64)).abs() < 1e-12 && (stored[1] - 0.96).abs() < 1e-12);
            assert_eq!(direction_in_frame(FieldKind::Vector {}, &frames, face, frames.normal(face).into()), None);
            assert_eq!(direction_in_frame(FieldKind::Vector {}, &frames, face, [f64::NAN; 3]), None);
            let square = along.map(|x| (x * along).into());
            let axes = tensor_axes(tensor_in_frame(&frames, face, square));
            assert!((axes.values[0] - 1.0).abs() < 1e-12 && axes.values[1].abs() < 1e-12);
            assert!((axes.direction.re * 0.6 + axes.direction.im * 0.8).abs() > 1.0 - 1e-12);
            let world = to_world(&frames, &[0.0; 2]);
            assert_eq!(world.len(), 1);
        }
    }
}
