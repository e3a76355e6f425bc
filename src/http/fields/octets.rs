//! Numbers of fields as bytes.

use bytes::Bytes;

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
