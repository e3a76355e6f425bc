//! Numbers of fields as bytes.

use bytes::Bytes;
use chladni_spectral::operator::transport::FieldKind;
use chladni_work::design::Form;
use half::f16;
use serde::Deserialize;

use crate::http::problem::{self, Problem};

/// How raw numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Single precision, four bytes.
    #[default]
    F32,
    /// Half precision, two bytes: three digits, numbers up to 65,504.
    F16,
    /// Directions alone, of vectors in ℝ³ (`world` and `roots` of vectors and n-vectors): two i16 for each, to a
    /// hundredth of a degree. Divided by 32,767 they are `a`, `b` on an octahedron, `c = 1 − |a| − |b|`; where `c` is
    /// below 0, `a` and `b` become `(1 − |b|) sign a` and `(1 − |a|) sign b`; the direction is that of (a, b, c). Where
    /// there is none, both are −32,768.
    Octahedral,
}

impl Encoding {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::Octahedral => "octahedral",
        }
    }

    /// Numbers for each face, of so many.
    pub fn columns(self, columns: usize) -> usize {
        if self == Self::Octahedral { columns / 3 * 2 } else { columns }
    }

    /// Refuses a form that is no list of vectors in ℝ³ where their directions are wanted.
    ///
    /// # Errors
    /// `invalid-design/encoding`.
    pub fn check(self, kind: FieldKind, form: Form) -> Result<(), Problem> {
        let vectors = matches!(form, Form::World | Form::Roots) && kind != FieldKind::Tensor {};
        if self != Self::Octahedral || vectors {
            return Ok(());
        }
        let detail =
            "encoding: octahedral is for vectors in ℝ³: for the forms world and roots of vectors and n-vectors.";
        Err(Problem::within(&problem::INVALID_DESIGN, "encoding", detail))
    }

    /// Numbers as little-endian bytes, `columns` for each of the faces that `face` names by their rows.
    ///
    /// # Errors
    /// `invalid-design/encoding` names the face whose number is beyond half precision.
    pub fn bytes(self, numbers: Vec<f32>, columns: usize, face: impl Fn(usize) -> u32) -> Result<Bytes, Problem> {
        match self {
            Self::F32 => return Ok(to_bytes(numbers)),
            Self::Octahedral => {
                let words = numbers.as_chunks::<3>().0.iter().flat_map(|&vector| octahedral(vector));
                return Ok(words.flat_map(i16::to_le_bytes).collect());
            }
            Self::F16 => {}
        }
        if let Some(at) = numbers.iter().position(|&x| x.is_finite() && !f16::from_f32(x).is_finite()) {
            let (face, most) = (face(at / columns.max(1)), f16::MAX);
            let detail = format!(
                "The number {:e} on face {face} is beyond f16, which ends at {most}; ask for f32.",
                numbers[at]
            );
            return Err(Problem::within(&problem::INVALID_DESIGN, "encoding", detail).with("face", face));
        }
        Ok(numbers.into_iter().flat_map(|x| f16::from_f32(x).to_le_bytes()).collect())
    }
}

/// A direction on an octahedron that is unfolded to a square (Meyer, Süßmuth, Sußner, Stamminger and Greiner 2010).
fn octahedral([x, y, z]: [f32; 3]) -> [i16; 2] {
    let size = x.abs() + y.abs() + z.abs();
    if !(size > 0.0 && size.is_finite()) {
        return [i16::MIN; 2];
    }
    let [a, b] = [x / size, y / size];
    let folded = if z < 0.0 { [(1.0 - b.abs()).copysign(a), (1.0 - a.abs()).copysign(b)] } else { [a, b] };
    folded.map(|x| (x * 32767.0).round() as i16)
}

/// Single-precision numbers as little-endian bytes, not copied where the machine stores them so.
pub fn to_bytes(numbers: Vec<f32>) -> Bytes {
    struct Numbers(Vec<f32>);

    impl AsRef<[u8]> for Numbers {
        fn as_ref(&self) -> &[u8] {
            bytemuck::cast_slice(&self.0)
        }
    }

    if cfg!(target_endian = "little") {
        return Bytes::from_owner(Numbers(numbers));
    }
    numbers.into_iter().flat_map(f32::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    /// As the document tells it.
    fn direction([a, b]: [i16; 2]) -> [f64; 3] {
        let [a, b] = [a, b].map(|x| f64::from(x) / 32767.0);
        let c = 1.0 - a.abs() - b.abs();
        let sign = |x: f64| if x < 0.0 { -1.0 } else { 1.0 };
        let [a, b] = if c < 0.0 { [(1.0 - b.abs()) * sign(a), (1.0 - a.abs()) * sign(b)] } else { [a, b] };
        let length = (a * a + b * b + c * c).sqrt();
        [a, b, c].map(|x| x / length)
    }

    #[test]
    fn octahedral_directions_come_back_to_a_hundredth_of_a_degree() {
        let mut random = SplitMix64::new(5);
        let mut vectors: Vec<[f64; 3]> = (0..2000).map(|_| [0; 3].map(|_| random.signed_unit())).collect();
        vectors.extend([[0.0, 0.0, -2.0], [0.0, 0.0, 1e-20], [-3.0, 0.0, 0.0], [0.0, 1e20, -0.0], [1.0, 1.0, -1.0]]);
        for v in vectors {
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            let back = direction(octahedral(v.map(|x| x as f32)));
            let off = (0..3).map(|i| (back[i] - v[i] / length).powi(2)).sum::<f64>().sqrt();
            assert!(off.to_degrees() < 0.01, "{v:?}: {back:?}");
        }
        assert_eq!([octahedral([0.0; 3]), octahedral([f32::NAN, 0.0, 1.0])], [[i16::MIN; 2]; 2]);
    }
}
