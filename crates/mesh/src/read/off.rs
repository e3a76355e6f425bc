//! Geomview OFF: ASCII here, binary files in [`off_binary`](super::off_binary).

use super::builder::{Builder, zero_based_index};
use super::error::{ReadError, shorten};
use super::off_keyword::Variant;
use super::text::Text;
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads an OFF file. The keyword may be missing, the counts may stand beside it, the number of edges may be left out.
/// What follows the coordinates of a vertex or the corners of a face on its line (colours, normals) is ignored.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut text = Text::new(bytes);
    let mut builder = Builder::new(limits);
    let header = |text: &Text, reason| ReadError::Header { format: MeshFormat::Off, location: text.location(), reason };
    if !text.any() {
        return Err(header(&text, "the keyword OFF is missing"));
    }
    let mut variant = Variant::default();
    // `4OFF` begins like a number.
    if !text.at_number() || Variant::from_keyword(text.peek()).is_some() {
        let word = text.token();
        variant = Variant::from_keyword(word).ok_or_else(|| header(&text, "the keyword OFF is missing"))?;
        if !text.any() {
            return Err(header(&text, "the counts are missing"));
        }
        if !text.at_number() {
            return match text.token() {
                b"BINARY" => {
                    text.skip_line();
                    super::off_binary::read(bytes, bytes.len() - text.remaining(), variant, limits)
                }
                word => Err(ReadError::UnsupportedEncoding { format: MeshFormat::Off, encoding: shorten(word) }),
            };
        }
    }
    if variant.dimension {
        if text.count("dimensions")? != 3 {
            return Err(header(&text, "the dimension is not 3"));
        }
        if !text.any() {
            return Err(header(&text, "the counts are missing"));
        }
    }
    let declared_vertices = text.count("vertices")?;
    let declared_faces = text.count("faces")?;
    text.skip_line();
    // A coordinate takes two bytes, of which the last may lack its blank; so does the count of a face.
    let width = if variant.homogeneous { 4 } else { 3 };
    let possible = (text.remaining() as u64).div_ceil(2 * width);
    builder.expect_vertices(declared_vertices, possible)?;
    for number in 0..declared_vertices as usize {
        let mut position = [0.0; 4];
        for coordinate in &mut position[..width as usize] {
            if !text.any() {
                return Err(ReadError::Truncated { element: "vertex", number, declared: declared_vertices as usize });
            }
            *coordinate = text.float("a coordinate")?;
        }
        let [x, y, z, w] = position;
        builder.vertex(if variant.homogeneous { [x / w, y / w, z / w] } else { [x, y, z] })?;
        text.skip_line();
    }
    let left = text.remaining() as u64;
    builder.expect_faces(declared_faces, left.div_ceil(2), left.div_ceil(8))?;
    let vertices = builder.mesh.positions.len();
    for number in 0..declared_faces as usize {
        let truncated = ReadError::Truncated { element: "face", number, declared: declared_faces as usize };
        if !text.any() {
            return Err(truncated);
        }
        let corners = text.count("corners")?;
        for _ in 0..corners {
            if !text.any() {
                return Err(truncated);
            }
            let location = text.location();
            let index = text.integer("a vertex index")?;
            builder.corner(zero_based_index(index, vertices, "face", number, location)?, location)?;
        }
        builder.end_polygon();
        text.skip_line();
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::super::error::FileLocation;
    use super::*;

    fn read(text: &str) -> Result<RawMesh, ReadError> {
        super::read(text.as_bytes(), &ReadLimits::default())
    }

    #[test]
    fn the_variants_of_the_header_give_the_same_mesh() {
        let plain = read("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n").unwrap();
        assert_eq!(plain.faces, [[0, 1, 2], [0, 2, 3]]);
        for text in [
            "OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 0.5 0.5 0.5\n",
            "# made\nOFF # beside\n\n4 1\n\n0 0 0\n# between\n1 0 0\n1 1 0\n0 1 0\n4 0 1\n2 3",
            "4 1 4\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n4 0 1 2 3\r\n",
            "COFF\n4 1 0\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n1 1 0 1 1 1 1\n0 1 0 1 1 1 1\n4 0 1 2 3\n",
            "STCN4OFF\n4 1 0\n0 0 0 1 9\n2 0 0 2 9\n1 1 0 1 9\n0 .5 0 .5 9\n4 0 1 2 3\n",
            "4OFF\n4 1 0\n0 0 0 1\n2 0 0 2\n1 1 0 1\n0 .5 0 .5\n4 0 1 2 3\n",
            "nOFF 3\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
        ] {
            let mesh = read(text).unwrap();
            assert_eq!((&mesh.positions, &mesh.faces), (&plain.positions, &plain.faces), "{text}");
        }
    }

    #[test]
    fn refusals_are_typed_and_placed() {
        let cases = [
            ("PLY\n", "invalid-header"),
            ("OFF", "invalid-header"),
            ("OFF PACKED\n\0\0\0\x03", "unsupported-encoding"),
            ("OFF BINARY\n\0\0\0\x03", "invalid-header"),
            ("nOFF\n4\n1 0 0\n", "invalid-header"),
            ("OFF\n3\n", "missing-value"),
            ("OFF\n-3 1 0\n0 0 0\n", "invalid-count"),
            ("OFF\n4000000000 1 0\n0 0 0\n", "count-exceeds-file"),
            ("OFF\n1 4000000000 0\n0 0 0\n3 0 0 0\n", "count-exceeds-file"),
            ("OFF\n99999999999999999999 1 0\n", "number-too-large"),
            ("OFF\n2 0 0\n0 0 0\n0 0\n", "truncated-file"),
            ("OFF\n1 2 0\n0 0 0\n3 0 0 0\n", "truncated-file"),
            ("OFF\n1 1 0\n0 0 0\n3 0 0\n", "truncated-file"),
            ("OFF\n1 1 0\n0 0 0\n-1 0 0\n", "invalid-count"),
            ("OFF\n1 1 0\n0 0 0\n3 0 0 zero\n", "not-a-number"),
        ];
        for (text, kind) in cases {
            assert_eq!(read(text).map_err(|error| error.kind()), Err(kind), "{text}");
        }
        assert_eq!(
            read("OFF\n1 1 0\n0 0 0\n3 0 0 1\n"),
            Err(ReadError::IndexOutOfRange {
                element: "face",
                number: 0,
                location: FileLocation::Line(4),
                index: 1,
                vertices: 1
            })
        );
        assert!(matches!(read("OFF\n1 1 0\n0 0 0\n3 0 0 -1\n"), Err(ReadError::IndexOutOfRange { index: -1, .. })));
    }
}
