//! MEDIT `.meshb` files: the sections of [`medit`](super::medit) as bytes, each with the place of the next (GMF,
//! Maréchal's libMeshb).

use super::builder::Builder;
use super::error::{Place, ReadError};
use super::{MeshFormat, RawMesh, ReadLimits};

/// The number of each section that is read.
const DIMENSION: i64 = 3;
const VERTICES: i64 = 4;
const TRIANGLES: i64 = 6;
const QUADRILATERALS: i64 = 7;
const TETRAHEDRA: i64 = 8;
const END: i64 = 54;

/// Whether a file begins as a binary one: with a one of four bytes, in either order.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    bytes.starts_with(&[1, 0, 0, 0]) || bytes.starts_with(&[0, 0, 0, 1])
}

/// Reads the same sections as the text is read for; all others, and all references, are passed over. Versions 1 to 4,
/// either order of bytes.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut source = Source { bytes, at: 4, big_endian: bytes.starts_with(&[0, 0, 0, 1]), version: 1, sections: 0 };
    source.version = match source.integer(4)? {
        version @ 1..=4 => version,
        _ => return Err(wrong(4, "the version is none of 1 to 4")),
    };
    let mut builder = Builder::new(limits);
    let mut dimension = None;
    let mut seen: Vec<&'static str> = Vec::new();
    while source.at < bytes.len() {
        source.sections += 1;
        if source.sections > limits.groups {
            return Err(ReadError::TooManyGroups { place: source.place(), limit: limits.groups });
        }
        let start = source.at;
        let section = source.integer(4)?;
        if section == END {
            break;
        }
        let next = source.integer(source.place_bytes())?;
        let name = match section {
            DIMENSION => "Dimension",
            VERTICES => "Vertices",
            TRIANGLES => "Triangles",
            QUADRILATERALS => "Quadrilaterals",
            TETRAHEDRA => "Tetrahedra",
            _ => "",
        };
        if !name.is_empty() {
            if seen.contains(&name) {
                return Err(ReadError::DuplicateElement { place: Place::Byte(start), element: name });
            }
            seen.push(name);
        }
        match section {
            DIMENSION => dimension = Some(source.dimension()?),
            VERTICES => {
                let missing = ReadError::MissingSection { place: Place::Byte(start), section: "Dimension" };
                source.vertices(&mut builder, dimension.ok_or(missing)?)?;
            }
            TRIANGLES => source.polygons(&mut builder, 3)?,
            QUADRILATERALS => source.polygons(&mut builder, 4)?,
            TETRAHEDRA => source.tetrahedra(&mut builder)?,
            _ => {}
        }
        if next == 0 {
            break;
        }
        source.at = match usize::try_from(next) {
            Ok(next) if next >= source.at && next <= bytes.len() => next,
            _ => {
                return Err(wrong(start, "the next section begins within this one or beyond the end of the file"));
            }
        };
    }
    builder.finish()
}

fn wrong(at: usize, reason: &'static str) -> ReadError {
    ReadError::Header { format: MeshFormat::Medit, place: Place::Byte(at), reason }
}

struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    version: i64,
    /// Sections that were begun.
    sections: usize,
}

impl Source<'_> {
    fn place(&self) -> Place {
        Place::Byte(self.at)
    }

    /// Bytes of a place in the file.
    fn place_bytes(&self) -> usize {
        if self.version >= 3 { 8 } else { 4 }
    }

    /// Bytes of a coordinate.
    fn coordinate_bytes(&self) -> usize {
        if self.version >= 2 { 8 } else { 4 }
    }

    /// Bytes of a count, an index and a reference.
    fn index_bytes(&self) -> usize {
        if self.version >= 4 { 8 } else { 4 }
    }

    /// The next bytes as a number without a sign.
    fn word(&mut self, bytes: usize) -> Option<u64> {
        let word = self.bytes.get(self.at..)?.get(..bytes)?;
        self.at += bytes;
        let push = |number: u64, &byte: &u8| number << 8 | u64::from(byte);
        Some(if self.big_endian { word.iter().fold(0, push) } else { word.iter().rev().fold(0, push) })
    }

    fn integer(&mut self, bytes: usize) -> Result<i64, ReadError> {
        let number = self.sections.saturating_sub(1);
        let ends = ReadError::Truncated { element: "section", number, declared: self.sections.max(1) };
        Ok(signed(self.word(bytes).ok_or(ends)?, bytes))
    }

    fn dimension(&mut self) -> Result<usize, ReadError> {
        let at = self.at;
        match self.integer(4)? {
            2 => Ok(2),
            3 => Ok(3),
            _ => Err(wrong(at, "the dimension is neither 2 nor 3")),
        }
    }

    /// The count of a section, and how many entries of so many bytes can follow.
    fn count(&mut self, element: &'static str, entry: usize) -> Result<(u64, u64), ReadError> {
        let place = self.place();
        let count = self.integer(self.index_bytes())?;
        let declared = u64::try_from(count).map_err(|_| ReadError::InvalidCount { place, count, element })?;
        Ok((declared, ((self.bytes.len() - self.at) / entry) as u64))
    }

    fn vertices(&mut self, builder: &mut Builder, dimension: usize) -> Result<(), ReadError> {
        let width = self.coordinate_bytes();
        let (declared, possible) = self.count("vertices", dimension * width + self.index_bytes())?;
        builder.expect_vertices(declared, possible)?;
        for number in 0..declared as usize {
            let mut position = [0.0; 3];
            for coordinate in &mut position[..dimension] {
                let truncated = ReadError::Truncated { element: "vertex", number, declared: declared as usize };
                let word = self.word(width).ok_or(truncated)?;
                *coordinate = if width == 4 { f64::from(f32::from_bits(word as u32)) } else { f64::from_bits(word) };
            }
            builder.vertex(position)?;
            self.at += self.index_bytes();
        }
        Ok(())
    }

    fn polygons(&mut self, builder: &mut Builder, corners: usize) -> Result<(), ReadError> {
        let (declared, possible) = self.count("faces", (corners + 1) * self.index_bytes())?;
        builder.expect_faces(declared, possible, 2 * possible)?;
        for number in 0..declared as usize {
            for _ in 0..corners {
                let place = self.place();
                let vertex = self.vertex(builder, "face", number, declared)?;
                builder.corner(vertex, place)?;
            }
            builder.end_polygon();
            self.at += self.index_bytes();
        }
        Ok(())
    }

    fn tetrahedra(&mut self, builder: &mut Builder) -> Result<(), ReadError> {
        let (declared, possible) = self.count("tetrahedra", 5 * self.index_bytes())?;
        builder.expect_tetrahedra(declared, possible)?;
        for number in 0..declared as usize {
            let mut corners = [0; 4];
            for corner in &mut corners {
                *corner = self.vertex(builder, "tetrahedron", number, declared)?;
            }
            builder.tetrahedron(corners)?;
            self.at += self.index_bytes();
        }
        Ok(())
    }

    /// A corner of the element with this number.
    fn vertex(
        &mut self,
        builder: &mut Builder,
        element: &'static str,
        number: usize,
        declared: u64,
    ) -> Result<u32, ReadError> {
        let place = self.place();
        let bytes = self.index_bytes();
        let word = self.word(bytes).ok_or(ReadError::Truncated { element, number, declared: declared as usize })?;
        builder.one_based_index(signed(word, bytes), MeshFormat::Medit, element, number, place)
    }
}

/// A number of four or eight bytes with its sign.
fn signed(word: u64, bytes: usize) -> i64 {
    if bytes == 4 { i64::from((word as u32).cast_signed()) } else { word.cast_signed() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of a version, in an order of bytes.
    struct File {
        bytes: Vec<u8>,
        version: u32,
        big: bool,
    }

    impl File {
        fn new(version: u32, big: bool) -> Self {
            let mut file = Self { bytes: Vec::new(), version, big };
            file.int(1, 4);
            file.int(version.into(), 4);
            file
        }

        fn int(&mut self, number: i64, bytes: usize) {
            let all = number.to_le_bytes();
            let mut word = all[..bytes].to_vec();
            if self.big {
                word.reverse();
            }
            self.bytes.extend(word);
        }

        fn index(&mut self, number: i64) {
            self.int(number, if self.version >= 4 { 8 } else { 4 });
        }

        fn coordinate(&mut self, number: f64) {
            match self.version {
                1 => self.int((number as f32).to_bits().into(), 4),
                _ => self.int(number.to_bits().cast_signed(), 8),
            }
        }

        /// A section, with the place of the next filled in behind it.
        fn section(&mut self, number: i64, body: impl FnOnce(&mut Self)) -> &mut Self {
            self.int(number, 4);
            let (at, width) = (self.bytes.len(), if self.version >= 3 { 8 } else { 4 });
            self.int(0, width);
            body(self);
            let end = self.bytes.len();
            let tail = self.bytes.split_off(at + width);
            self.bytes.truncate(at);
            self.int(end as i64, width);
            self.bytes.extend(tail);
            self
        }

        fn indices(&mut self, count: i64, indices: &[i64]) {
            self.index(count);
            indices.iter().for_each(|&index| self.index(index));
        }

        fn vertices(&mut self, count: i64, positions: &[[f64; 3]]) {
            self.index(count);
            for position in positions {
                position.iter().for_each(|&number| self.coordinate(number));
                self.index(7);
            }
        }
    }

    const CORNERS: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.5], [1.0, 1.0, 0.0]];

    fn whole(version: u32, big: bool) -> Vec<u8> {
        let mut file = File::new(version, big);
        file.section(DIMENSION, |file| file.int(3, 4))
            .section(TETRAHEDRA, |file| file.indices(1, &[1, 2, 3, 4, 9]))
            .section(VERTICES, |file| file.vertices(5, &CORNERS))
            // Edges.
            .section(5, |file| file.indices(1, &[1, 2, 0]))
            .section(TRIANGLES, |file| file.indices(1, &[1, 3, 2, 0]))
            .section(QUADRILATERALS, |file| file.indices(1, &[1, 2, 5, 3, 0]));
        file.int(END, 4);
        file.int(0, if version >= 3 { 8 } else { 4 });
        file.bytes
    }

    #[test]
    fn all_versions_in_both_orders_of_bytes_are_the_same_mesh() {
        for version in 1..=4 {
            for big in [false, true] {
                let bytes = whole(version, big);
                let mesh = super::super::read(&bytes, MeshFormat::Medit, &ReadLimits::default()).unwrap();
                assert_eq!(mesh.positions, CORNERS, "version {version}");
                assert_eq!(mesh.faces, [[0, 2, 1], [0, 1, 4], [0, 4, 2]]);
                assert_eq!(mesh.tetrahedra, [[0, 1, 2, 3]]);
                assert_eq!(mesh.polygons_triangulated, 1);
            }
        }
    }

    #[test]
    fn a_file_that_is_cut_anywhere_is_refused_or_lacks_whole_sections() {
        let bytes = whole(2, false);
        let all = read(&bytes, &ReadLimits::default()).unwrap();
        for length in 8..bytes.len() - 8 {
            match read(&bytes[..length], &ReadLimits::default()) {
                Ok(part) => assert!(part.faces.len() < all.faces.len(), "{length}"),
                Err(error) => assert!(
                    ["invalid-header", "truncated-file", "count-exceeds-file", "index-out-of-range"]
                        .contains(&error.kind()),
                    "{length}: {error}"
                ),
            }
        }
    }

    #[test]
    fn a_file_of_another_writer_is_read() {
        // Of meshio 5.3: version 4, little-endian, with a line between.
        let bytes = include_bytes!("data/mixed.meshb");
        assert_eq!(MeshFormat::sniff(bytes), Some(MeshFormat::Medit));
        let mesh = read(bytes, &ReadLimits::default()).unwrap();
        assert_eq!((mesh.positions.len(), mesh.faces.len(), mesh.polygons_triangulated), (6, 3, 1));
        assert!(mesh.faces.contains(&[3, 4, 5]), "{:?}", mesh.faces);
    }

    #[test]
    fn refusals_are_typed_and_placed() {
        let planar = |file: &mut File| {
            file.section(DIMENSION, |file| file.int(3, 4)).section(VERTICES, |file| file.vertices(1, &CORNERS[..1]));
        };
        type Case = (fn(&mut File), &'static str);
        let cases: [Case; 9] = [
            (|file| file.bytes[4] = 9, "invalid-header"),
            (|file| _ = file.section(DIMENSION, |file| file.int(4, 4)), "invalid-header"),
            (|file| _ = file.section(VERTICES, |file| file.vertices(0, &[])), "missing-section"),
            (|file| _ = file.section(TRIANGLES, |file| file.indices(-1, &[])), "invalid-count"),
            (|file| _ = file.section(TRIANGLES, |file| file.indices(2, &[1, 1, 1, 0])), "count-exceeds-file"),
            (|file| _ = file.section(TRIANGLES, |file| file.indices(1, &[0, 1, 1, 0])), "index-zero"),
            (|file| _ = file.section(TRIANGLES, |file| file.indices(1, &[1, 1, 2, 0])), "index-out-of-range"),
            (|file| _ = file.section(TETRAHEDRA, |file| file.indices(1, &[1, 1, 1, -3, 0])), "index-out-of-range"),
            (|file| _ = file.section(VERTICES, |file| file.vertices(0, &[])), "duplicate-element"),
        ];
        for (number, (body, kind)) in cases.into_iter().enumerate() {
            let mut file = File::new(2, false);
            if number > 2 {
                planar(&mut file);
            }
            body(&mut file);
            let got = read(&file.bytes, &ReadLimits::default()).map_or_else(|error| error.kind(), |_| "no error");
            assert_eq!(got, kind, "case {number}");
        }
        // The next section would begin within the one before it, for ever.
        let mut back = File::new(2, false);
        back.section(DIMENSION, |file| file.int(3, 4));
        back.bytes[12] = 8;
        assert_eq!(read(&back.bytes, &ReadLimits::default()).unwrap_err().kind(), "invalid-header");
    }
}
