//! Numbers of fields as bytes.

use bytes::Bytes;
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
}

impl Encoding {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
        }
    }

    /// Numbers as little-endian bytes, `columns` for each of the faces that `face` names by their rows.
    ///
    /// # Errors
    /// `invalid-design/encoding` names the face whose number is beyond half precision.
    pub fn bytes(self, numbers: Vec<f32>, columns: usize, face: impl Fn(usize) -> u32) -> Result<Bytes, Problem> {
        if self == Self::F32 {
            return Ok(to_bytes(numbers));
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
