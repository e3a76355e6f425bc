//! Geomview OFF after the word `BINARY`: the same as in its text, in numbers of four bytes, the first byte the highest.

use super::builder::{Builder, zero_based_index};
use super::error::{FileLocation, ReadError};
use super::off_keyword::Variant;
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads what follows the line of the keyword, from the byte `at` on. Normals, colours and texture coordinates of
/// vertices, in this order, and colours of faces are passed over.
pub(super) fn read(bytes: &[u8], at: usize, variant: Variant, limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut source = Source { bytes, at };
    let mut builder = Builder::new(limits);
    let header = |at, reason| ReadError::Header { format: MeshFormat::Off, location: FileLocation::Byte(at), reason };
    if variant.dimension && source.integer() != Some(3) {
        return Err(header(at, "the dimension is not 3"));
    }
    let mut count = |element: &'static str| {
        let location = FileLocation::Byte(source.at);
        let count = i64::from(source.integer().ok_or_else(|| header(source.at, "the counts are cut short"))?);
        u64::try_from(count).map_err(|_| ReadError::InvalidCount { location, count, element })
    };
    let (declared_vertices, declared_faces, _) = (count("vertices")?, count("faces")?, count("edges")?);
    let (coordinates, width) = (if variant.homogeneous { 4 } else { 3 }, variant.vertex_numbers());
    builder.expect_vertices(declared_vertices, (source.remaining() / (4 * width)) as u64)?;
    for number in 0..declared_vertices as usize {
        let truncated = ReadError::Truncated { element: "vertex", number, declared: declared_vertices as usize };
        let mut position = [0.0; 4];
        for coordinate in &mut position[..coordinates] {
            *coordinate = source.float().ok_or_else(|| truncated.clone())?;
        }
        source.pass(width - coordinates).ok_or(truncated)?;
        let [x, y, z, w] = position;
        builder.vertex(if variant.homogeneous { [x / w, y / w, z / w] } else { [x, y, z] })?;
    }
    // A face has at least its number of corners and that of its colours; one that is kept, three corners more.
    let left = source.remaining() as u64;
    builder.expect_faces(declared_faces, left / 8, left / 20)?;
    let vertices = builder.mesh.positions.len();
    for number in 0..declared_faces as usize {
        let truncated = || ReadError::Truncated { element: "face", number, declared: declared_faces as usize };
        let location = FileLocation::Byte(source.at);
        let corners = source.integer().ok_or_else(truncated)?;
        if corners < 0 {
            return Err(ReadError::InvalidCount { location, count: corners.into(), element: "corners" });
        }
        for _ in 0..corners {
            let location = FileLocation::Byte(source.at);
            let index = source.integer().ok_or_else(truncated)?;
            builder.corner(zero_based_index(index.into(), vertices, "face", number, location)?, location)?;
        }
        builder.end_polygon();
        let location = FileLocation::Byte(source.at);
        let colours = source.integer().ok_or_else(truncated)?;
        let passed = usize::try_from(colours).map_err(|_| ReadError::InvalidCount {
            location,
            count: colours.into(),
            element: "colours",
        })?;
        source.pass(passed).ok_or_else(truncated)?;
    }
    builder.finish()
}

struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Source<'_> {
    fn remaining(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    fn word(&mut self) -> Option<[u8; 4]> {
        let word = *self.bytes.get(self.at..)?.first_chunk::<4>()?;
        self.at += 4;
        Some(word)
    }

    fn integer(&mut self) -> Option<i32> {
        self.word().map(i32::from_be_bytes)
    }

    fn float(&mut self) -> Option<f64> {
        self.word().map(|word| f32::from_be_bytes(word).into())
    }

    /// Goes past so many numbers; nothing where the file ends before.
    fn pass(&mut self, numbers: usize) -> Option<()> {
        let end = numbers.checked_mul(4)?.checked_add(self.at)?;
        (end <= self.bytes.len()).then(|| self.at = end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::MeshFormat;

    fn whole(numbers: &[i32]) -> Vec<u8> {
        numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
    }

    fn single(numbers: &[f32]) -> Vec<u8> {
        numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
    }

    fn read(bytes: &[u8]) -> Result<RawMesh, ReadError> {
        crate::read::read(bytes, MeshFormat::Off, &ReadLimits::default())
    }

    /// A square as one face, and half of it, which has a colour.
    fn square(keyword: &str, vertex: impl Fn(f32, f32) -> Vec<f32>) -> Vec<u8> {
        let vertices = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| single(&vertex(x, y))).concat();
        let half = [whole(&[3, 0, 1, 2, 4]), single(&[0.5; 4])].concat();
        [keyword.as_bytes(), &whole(&[4, 2, 0]), &vertices, &whole(&[4, 0, 1, 2, 3, 0]), &half].concat()
    }

    #[test]
    fn binary_files_are_the_mesh_of_their_text() {
        let text = read(b"OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n").unwrap();
        for bytes in [
            square("OFF BINARY\n", |x, y| vec![x, y, 0.0]),
            square("# made\nOFF BINARY\r\n", |x, y| vec![x, y, 0.0]),
            square("CNOFF BINARY\n", |x, y| vec![x, y, 0.0, 9.0, 9.0, 9.0, 1.0, 1.0, 1.0, 1.0]),
            square("STOFF BINARY\n", |x, y| vec![x, y, 0.0, 0.25, 0.75]),
            square("4OFF BINARY\n", |x, y| vec![2.0 * x, 2.0 * y, 0.0, 2.0]),
        ] {
            assert_eq!(MeshFormat::sniff(&bytes), Some(MeshFormat::Off));
            assert_eq!(read(&bytes).unwrap(), text);
        }
    }

    #[test]
    fn whatever_is_cut_or_wrong_is_refused_by_name() {
        let bytes = square("OFF BINARY\n", |x, y| vec![x, y, 0.0]);
        for length in 11..bytes.len() {
            let kind = read(&bytes[..length]).unwrap_err().kind();
            assert!(["invalid-header", "truncated-file", "count-exceeds-file"].contains(&kind), "{length}: {kind}");
        }
        let with = |numbers: &[i32]| read(&[b"OFF BINARY\n", whole(numbers).as_slice()].concat()).unwrap_err().kind();
        for (numbers, kind) in [
            (&[-1, 0, 0][..], "invalid-count"),
            (&[i32::MAX, 0, 0], "count-exceeds-file"),
            (&[1, i32::MAX, 0, 0, 0, 0], "count-exceeds-file"),
            (&[1, 1, 0, 0, 0, 0, -1, 0], "invalid-count"),
            (&[1, 1, 0, 0, 0, 0, 1, 1, 0], "index-out-of-range"),
            (&[1, 1, 0, 0, 0, 0, 1, 0, -1], "invalid-count"),
            (&[1, 1, 0, 0, 0, 0, 1, 0, 7], "truncated-file"),
        ] {
            assert_eq!(with(numbers), kind, "{numbers:?}");
        }
    }
}
