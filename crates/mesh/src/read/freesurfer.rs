//! FreeSurfer's triangle surfaces (`lh.pial`, `rh.white`, …), binary.

use super::builder::{Builder, zero_based_index};
use super::error::{FileLocation, ReadError};
use super::{MeshFormat, RawMesh, ReadLimits};

/// The first bytes of a triangle surface. Those of quadrilaterals end in other bytes, and are not read.
pub(super) const MAGIC: &[u8] = b"\xff\xff\xfe";

/// Reads a surface: the magic number, two lines of text, the numbers of vertices and faces, positions in single
/// precision, corners; all numbers have their highest byte first. What follows, the volume's geometry, is passed over.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let wrong = |at: usize, reason| ReadError::Header {
        format: MeshFormat::FreeSurfer,
        location: FileLocation::Byte(at),
        reason,
    };
    let Some(text) = bytes.strip_prefix(MAGIC) else {
        return Err(wrong(0, "it does not begin with the bytes ff ff fe of a triangle surface"));
    };
    let mut lines = text.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1);
    let Some(start) = lines.nth(1) else {
        return Err(wrong(MAGIC.len(), "two lines of text are missing"));
    };
    let head = MAGIC.len() + start;
    let count = |at: usize, element: &'static str| {
        let number = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
        let number: [u8; 4] = number.ok_or(ReadError::Truncated { element: "header", number: 0, declared: 1 })?;
        let count = i64::from(i32::from_be_bytes(number));
        u64::try_from(count).map_err(|_| ReadError::InvalidCount { location: FileLocation::Byte(at), count, element })
    };
    let (vertices, faces) = (count(head, "vertices")?, count(head + 4, "faces")?);
    let body = &bytes[head + 8..];
    let mut builder = Builder::new(limits);
    builder.expect_vertices(vertices, (body.len() / 12) as u64)?;
    let (positions, corners) = body.split_at(12 * vertices as usize);
    for twelve in positions.as_chunks::<12>().0 {
        let number = |k: usize| f32::from_be_bytes([twelve[k], twelve[k + 1], twelve[k + 2], twelve[k + 3]]);
        builder.vertex([0, 4, 8].map(|k| f64::from(number(k))))?;
    }
    let possible = (corners.len() / 12) as u64;
    builder.expect_faces(faces, possible, possible)?;
    let begin = head + 8 + 12 * vertices as usize;
    for (number, twelve) in corners.as_chunks::<12>().0.iter().take(faces as usize).enumerate() {
        let mut face = [0; 3];
        for (corner, four) in face.iter_mut().zip(twelve.as_chunks::<4>().0) {
            let location = FileLocation::Byte(begin + 12 * number);
            let index = i64::from(i32::from_be_bytes(*four));
            *corner = zero_based_index(index, vertices as usize, "face", number, location)?;
        }
        builder.triangle(face)?;
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles.
    fn square(faces: &[[i32; 3]]) -> Vec<u8> {
        let mut bytes = [MAGIC, b"created by hand\n\n"].concat();
        bytes.extend(4i32.to_be_bytes());
        bytes.extend((faces.len() as i32).to_be_bytes());
        for x in [0f32, 0.0, 0.5, 1.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 1.0, 0.5] {
            bytes.extend(x.to_be_bytes());
        }
        faces.iter().flatten().for_each(|v| bytes.extend(v.to_be_bytes()));
        bytes
    }

    #[test]
    fn surfaces_are_read_and_what_follows_is_passed_over() {
        let mut bytes = square(&[[0, 1, 2], [0, 2, 3]]);
        bytes.extend(b"\0\0\0\x02\0\0\0\0\0\0\0\x14volume info");
        let mesh = read(&bytes, &ReadLimits::default()).unwrap();
        assert_eq!(mesh.positions[2], [1.0, 1.0, 0.5]);
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(MeshFormat::sniff(&bytes), Some(MeshFormat::FreeSurfer));
    }

    #[test]
    fn refusals_are_typed_and_placed() {
        let read = |bytes: &[u8]| read(bytes, &ReadLimits::default()).map_err(|error| error.kind());
        let whole = square(&[[0, 1, 2], [0, 2, 3]]);
        assert_eq!(read(b"\xff\xff\xffquads\n\n"), Err("invalid-header"));
        assert_eq!(read(b"\xff\xff\xfecreated"), Err("invalid-header"));
        assert_eq!(read(&whole[..23]), Err("truncated-file"));
        assert_eq!(read(&whole[..40]), Err("count-exceeds-file"));
        assert_eq!(read(&whole[..whole.len() - 1]), Err("count-exceeds-file"));
        let mut negative = whole.clone();
        negative[20] = 0xff;
        assert_eq!(read(&negative), Err("invalid-count"));
        for index in [4, -1] {
            let error = super::read(&square(&[[0, 1, 2], [0, index, 3]]), &ReadLimits::default()).unwrap_err();
            let location = FileLocation::Byte(20 + 8 + 48 + 12);
            let expected =
                ReadError::IndexOutOfRange { element: "face", number: 1, location, index: index.into(), vertices: 4 };
            assert_eq!(error, expected);
        }
    }
}
