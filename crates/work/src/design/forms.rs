//! Stored numbers of a field as a user reads them, face after face.

use chladni_base::Vector3;
use chladni_base::parallel::*;
use chladni_spectral::field::{roots, tensor_axes};
use chladni_spectral::operator::frames::{Complex64, FaceFrames, complex};
use chladni_spectral::operator::transport::FieldKind;
use serde::Deserialize;

/// How a field is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// In ℝ³. A vector: x, y, z. n-vectors: the first of them. A tensor: xx, yy, zz, xy, xz, yz.
    #[default]
    World,
    /// As it is stored: two numbers in the frame of the face (of n-vectors the representation, whose angle is n times
    /// theirs), or a₁₁, a₂₂, √2 a₁₂ of a tensor.
    Frames,
    /// All n vectors in ℝ³, one after the other; of a tensor the two unit eigendirections, of the larger eigenvalue
    /// first, each times its eigenvalue.
    Roots,
    /// Of a tensor both eigenvalues, the larger first, and the unit direction of the larger in ℝ³: five numbers. Of
    /// vectors and n-vectors their length and the unit direction of the first: four numbers.
    Axes,
}

impl Form {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::World => "world",
            Self::Frames => "frames",
            Self::Roots => "roots",
            Self::Axes => "axes",
        }
    }

    /// Numbers per face.
    pub fn columns(self, kind: FieldKind) -> usize {
        match (self, kind) {
            (Self::World, FieldKind::Tensor {}) | (Self::Roots, FieldKind::Tensor {}) => 6,
            (Self::World, _) | (Self::Roots, FieldKind::Vector {}) => 3,
            (Self::Frames, kind) => kind.block(),
            (Self::Roots, FieldKind::NVector { n }) => 3 * n as usize,
            (Self::Axes, FieldKind::Tensor {}) => 5,
            (Self::Axes, _) => 4,
        }
    }
}

/// The numbers of all faces in a form.
pub fn written(frames: &FaceFrames, kind: FieldKind, form: Form, field: Vec<f32>) -> Vec<f32> {
    put_all(frames, kind, form, field, |at| at)
}

/// The numbers of some faces in a form, from those that are stored there.
pub fn written_at(frames: &FaceFrames, kind: FieldKind, form: Form, faces: &[u32], field: Vec<f32>) -> Vec<f32> {
    put_all(frames, kind, form, field, |at| faces.get(at).map_or(0, |&face| face as usize))
}

/// The same; `face` tells the faces in their order.
fn put_all(
    frames: &FaceFrames,
    kind: FieldKind,
    form: Form,
    field: Vec<f32>,
    face: impl Fn(usize) -> usize + Sync,
) -> Vec<f32> {
    if form == Form::Frames {
        return field;
    }
    let (columns, block) = (form.columns(kind), kind.block());
    let mut out = vec![0f32; columns * (field.len() / block)];
    out.par_chunks_exact_mut(columns).with_min_len(4096).zip(field.par_chunks_exact(block)).enumerate().for_each(
        |(at, (out, own))| match (kind, face(at)) {
            (FieldKind::Tensor {}, face) => tensor(frames, face, form, [own[0], own[1], own[2]].map(f64::from), out),
            (FieldKind::Vector {} | FieldKind::NVector { n: 1 }, face) => {
                vector(frames, face, form, complex([own[0], own[1]].map(f64::from)), out);
            }
            (FieldKind::NVector { n }, face) => {
                let representation = complex([own[0], own[1]].map(f64::from));
                if form == Form::Roots {
                    for (out, root) in out.chunks_exact_mut(3).zip(roots(representation, n)) {
                        put(out, frames.to_world(face, root));
                    }
                } else {
                    vector(frames, face, form, first_root(representation, n), out);
                }
            }
        },
    );
    out
}

/// The root whose angle is an n-th of the representation's.
fn first_root(representation: Complex64, n: u32) -> Complex64 {
    let (sine, cosine) = (representation.arg() / f64::from(n.max(1))).sin_cos();
    representation.norm() * Complex64::new(cosine, sine)
}

fn put(out: &mut [f32], v: Vector3) {
    out.iter_mut().zip(v.0).for_each(|(out, x)| *out = x as f32);
}

fn vector(frames: &FaceFrames, face: usize, form: Form, v: Complex64, out: &mut [f32]) {
    if form != Form::Axes {
        return put(out, frames.to_world(face, v));
    }
    let length = v.norm();
    let unit = if length > 0.0 { v / length } else { Complex64::ZERO };
    out[0] = length as f32;
    put(&mut out[1..], frames.to_world(face, unit));
}

fn tensor(frames: &FaceFrames, face: usize, form: Form, t: [f64; 3], out: &mut [f32]) {
    let axes = tensor_axes(t);
    let Complex64 { re: x, im: y } = axes.direction;
    let (along, across) = (frames.to_world(face, axes.direction), frames.to_world(face, Complex64::new(-y, x)));
    match form {
        Form::Roots => {
            put(&mut out[..3], along * axes.values[0]);
            put(&mut out[3..], across * axes.values[1]);
        }
        Form::Axes => {
            (out[0], out[1]) = (axes.values[0] as f32, axes.values[1] as f32);
            put(&mut out[2..], along);
        }
        Form::World | Form::Frames => {
            let entry =
                |i: usize, j: usize| axes.values[0] * along[i] * along[j] + axes.values[1] * across[i] * across[j];
            let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
            out.iter_mut().zip(pairs).for_each(|(out, (i, j))| *out = entry(i, j) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::shape::{Shape, generate};

    #[test]
    fn every_form_of_every_kind_has_its_numbers() {
        let frames = FaceFrames::new(&generate(Shape::Sphere, 42).unwrap()).unwrap();
        for kind in
            [FieldKind::Vector {}, FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}]
        {
            let field: Vec<f32> = (0..kind.block() * frames.faces()).map(|i| (i as f32 * 0.7).sin()).collect();
            for form in [Form::World, Form::Frames, Form::Roots, Form::Axes] {
                let out = written(&frames, kind, form, field.clone());
                assert_eq!(out.len(), form.columns(kind) * frames.faces(), "{kind:?} {form:?}");
                assert!(out.iter().all(|x| x.is_finite()));
            }
        }
    }

    #[test]
    fn forms_say_the_same() {
        let frames = FaceFrames::new(&generate(Shape::Sphere, 42).unwrap()).unwrap();
        let vector = FieldKind::NVector { n: 4 };
        let field: Vec<f32> = (0..2 * frames.faces()).map(|i| (i as f32 * 0.7).sin()).collect();
        let world = written(&frames, vector, Form::World, field.clone());
        let all = written(&frames, vector, Form::Roots, field.clone());
        let axes = written(&frames, vector, Form::Axes, field.clone());
        for face in 0..frames.faces() {
            let length = field[2 * face].hypot(field[2 * face + 1]);
            let size = world[3 * face..3 * face + 3].iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!((size - length).abs() < 1e-5 && (axes[4 * face] - length).abs() < 1e-5);
            assert!((0..3).all(|i| (all[12 * face + i] - world[3 * face + i]).abs() < 1e-5));
            assert!((0..3).all(|i| (all[12 * face + i] + all[12 * face + 6 + i]).abs() < 1e-5), "opposite roots");
        }
        let tensors: Vec<f32> = (0..3 * frames.faces()).map(|i| (i as f32 * 0.7).cos()).collect();
        let world = written(&frames, FieldKind::Tensor {}, Form::World, tensors.clone());
        let axes = written(&frames, FieldKind::Tensor {}, Form::Axes, tensors.clone());
        for face in 0..frames.faces() {
            let trace = tensors[3 * face] + tensors[3 * face + 1];
            assert!((world[6 * face..6 * face + 3].iter().sum::<f32>() - trace).abs() < 1e-4);
            assert!((axes[5 * face] + axes[5 * face + 1] - trace).abs() < 1e-4);
        }
    }
}
