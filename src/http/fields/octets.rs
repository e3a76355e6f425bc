//! Numbers of fields as bytes.

use bytes::Bytes;
use half::f16;
use serde::Deserialize;

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

    /// Numbers as little-endian bytes.
    pub fn bytes(self, numbers: Vec<f32>) -> Bytes {
        match self {
            Self::F32 => to_bytes(numbers),
            Self::F16 => numbers.into_iter().flat_map(|x| f16::from_f32(x).to_le_bytes()).collect(),
        }
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
