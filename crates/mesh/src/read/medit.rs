//! MEDIT `.mesh` files (Frey 2001, INRIA RT-0253), ASCII; binary ones are in [`medit_binary`](super::medit_binary).

use super::builder::Builder;
use super::error::{ReadError, shorten};
use super::text::Text;
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads `Vertices`, `Triangles`, `Quadrilaterals` and `Tetrahedra`; other sections and all references are passed over.
/// In dimension 2 the third coordinate is zero. Sections may come in any order, each of the four once.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut text = Text::new(bytes);
    let mut builder = Builder::new(limits);
    header(&mut text)?;
    let mut dimension = None;
    let mut seen: Vec<&'static str> = Vec::new();
    let mut sections = 0usize;
    let mut once = |name: &'static str, text: &Text| {
        if seen.contains(&name) {
            return Err(ReadError::DuplicateElement { location: text.location(), element: name });
        }
        seen.push(name);
        Ok(())
    };
    while text.any() {
        if text.at_number() {
            // The body of a section that is passed over.
            text.token();
            continue;
        }
        sections += 1;
        if sections > limits.groups {
            return Err(ReadError::TooManyGroups { location: text.location(), limit: limits.groups });
        }
        let location = text.location();
        match text.token() {
            b"Dimension" => dimension = Some(read_dimension(&mut text)?),
            b"Vertices" => {
                once("Vertices", &text)?;
                let dimension = dimension.ok_or(ReadError::MissingSection { location, section: "Dimension" })?;
                vertices(&mut text, &mut builder, dimension)?;
            }
            b"Triangles" => {
                once("Triangles", &text)?;
                polygons(&mut text, &mut builder, 3)?;
            }
            b"Quadrilaterals" => {
                once("Quadrilaterals", &text)?;
                polygons(&mut text, &mut builder, 4)?;
            }
            b"Tetrahedra" => {
                once("Tetrahedra", &text)?;
                tetrahedra(&mut text, &mut builder)?;
            }
            b"End" => break,
            word if word[0].is_ascii_alphabetic() => {}
            word => return Err(ReadError::UnexpectedWord { location, token: shorten(word) }),
        }
    }
    builder.finish()
}

fn header(text: &mut Text) -> Result<(), ReadError> {
    let wrong =
        |text: &Text, reason| ReadError::Header { format: MeshFormat::Medit, location: text.location(), reason };
    if !text.any() || text.token() != b"MeshVersionFormatted" {
        return Err(wrong(text, "it does not begin with MeshVersionFormatted"));
    }
    if !text.any() {
        return Err(wrong(text, "the version is missing"));
    }
    match text.integer("a version")? {
        1..=4 => Ok(()),
        _ => Err(wrong(text, "the version is not between 1 and 4")),
    }
}

fn read_dimension(text: &mut Text) -> Result<usize, ReadError> {
    if text.any() {
        match text.integer("a dimension")? {
            2 => return Ok(2),
            3 => return Ok(3),
            _ => {}
        }
    }
    let reason = "the dimension is neither 2 nor 3";
    Err(ReadError::Header { format: MeshFormat::Medit, location: text.location(), reason })
}

/// The count of a section, which may stand on the next line, and how many entries of `width` values the file can hold.
fn section(text: &mut Text, element: &'static str, width: u64) -> Result<(u64, u64), ReadError> {
    if !text.any() {
        return Err(ReadError::MissingValue { location: text.location(), expected: "a count" });
    }
    let declared = text.count(element)?;
    Ok((declared, (text.remaining() as u64).div_ceil(2 * width)))
}

/// Goes past the reference that follows an entry. Some writers leave it out.
fn skip_reference(text: &mut Text) {
    if text.on_line() {
        text.token();
    }
}

fn vertices(text: &mut Text, builder: &mut Builder, dimension: usize) -> Result<(), ReadError> {
    let (declared, possible) = section(text, "vertices", dimension as u64)?;
    builder.expect_vertices(declared, possible)?;
    for number in 0..declared as usize {
        let mut position = [0.0; 3];
        for coordinate in &mut position[..dimension] {
            if !text.any() {
                return Err(ReadError::Truncated { element: "vertex", number, declared: declared as usize });
            }
            *coordinate = text.float("a coordinate")?;
        }
        builder.vertex(position)?;
        skip_reference(text);
    }
    Ok(())
}

fn polygons(text: &mut Text, builder: &mut Builder, corners: usize) -> Result<(), ReadError> {
    let (declared, possible) = section(text, "faces", corners as u64)?;
    builder.expect_faces(declared, possible, possible)?;
    for number in 0..declared as usize {
        for _ in 0..corners {
            if !text.any() {
                return Err(ReadError::Truncated { element: "face", number, declared: declared as usize });
            }
            let location = text.location();
            let index = text.integer("a vertex index")?;
            let vertex = builder.one_based_index(index, MeshFormat::Medit, "face", number, location)?;
            builder.corner(vertex, location)?;
        }
        builder.end_polygon();
        skip_reference(text);
    }
    Ok(())
}

fn tetrahedra(text: &mut Text, builder: &mut Builder) -> Result<(), ReadError> {
    let (declared, possible) = section(text, "tetrahedra", 4)?;
    builder.expect_tetrahedra(declared, possible)?;
    for number in 0..declared as usize {
        let mut corners = [0; 4];
        for corner in &mut corners {
            if !text.any() {
                return Err(ReadError::Truncated { element: "tetrahedron", number, declared: declared as usize });
            }
            let location = text.location();
            let index = text.integer("a vertex index")?;
            *corner = builder.one_based_index(index, MeshFormat::Medit, "tetrahedron", number, location)?;
        }
        builder.tetrahedron(corners)?;
        skip_reference(text);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::error::FileLocation;
    use super::*;

    fn read(text: &str) -> Result<RawMesh, ReadError> {
        super::read(text.as_bytes(), &ReadLimits::default())
    }

    #[test]
    fn sections_are_read_in_any_order_and_others_passed_over() {
        let mesh = read(
            "# by hand\nMeshVersionFormatted 1\nDimension\n3\nTetrahedra 1\n1 2 3 4 0\nRequiredVertices\n2\n1\n2\n\
             Vertices\n5\n0 0 0 0\n1.0D0 0 0 0\n0 1 0\n0 0 1 0\n1 1 0 7\nCorners\n1\n1\nTriangles\n1\n1 3 2 1\n\
             Quadrilaterals 1 1 2 5 3 0\nNormals 1\n-.5 nan 1\nEnd\nTriangles 1",
        )
        .unwrap();
        assert_eq!(mesh.positions[1], [1.0, 0.0, 0.0]);
        assert_eq!(mesh.faces, [[0, 2, 1], [0, 1, 4], [0, 4, 2]]);
        assert_eq!(mesh.tetrahedra, [[0, 1, 2, 3]]);
        assert_eq!(mesh.polygons_triangulated, 1);
    }

    #[test]
    fn plane_meshes_lie_at_height_zero() {
        let mesh =
            read("MeshVersionFormatted 2 Dimension 2 Vertices 3 0 0 0\n1 0 0 0 1 0 Triangles 1 1 2 3 0").unwrap();
        assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    }

    #[test]
    fn refusals_are_typed_and_placed() {
        let start = "MeshVersionFormatted 1\nDimension 3\n";
        let cases = [
            ("MeshVersionUnformatted 1\n", "invalid-header"),
            ("MeshVersionFormatted 9\n", "invalid-header"),
            ("MeshVersionFormatted 1\nDimension 4\n", "invalid-header"),
            ("MeshVersionFormatted 1\nVertices 1\n0 0 0 0\n", "missing-section"),
            (&format!("{start}Vertices"), "missing-value"),
            (&format!("{start}Vertices\n4000000000\n0 0 0 0\n"), "count-exceeds-file"),
            (&format!("{start}Vertices\n-1\n0 0 0 0\n"), "invalid-count"),
            (&format!("{start}Vertices\n2\n0 0 0 0\n0 0 0"), "no error"),
            (&format!("{start}Vertices\n2\n0 0 0 0\n0 0"), "truncated-file"),
            (&format!("{start}Vertices\n1\n0 0 0 0\nTetrahedra\n1\n1 1 1"), "truncated-file"),
            (&format!("{start}Vertices\n1\n0 0 0 0\nTetrahedra\n9\n1 1 1 1 0"), "count-exceeds-file"),
            (&format!("{start}Vertices\n1\n0 0 0 0\nVertices\n1\n0 0 0 0\n"), "duplicate-element"),
            (&format!("{start}Vertices\n1\n0 0 0 0\nTriangles\n1\n1 0 1 0\n"), "index-zero"),
            (&format!("{start}Vertices\n1\n0 0 Triangles 0\n"), "not-a-number"),
            (&format!("{start}\u{1}\u{2}\n"), "unexpected-word"),
        ];
        for (text, kind) in cases {
            assert_eq!(read(text).map_or_else(|error| error.kind(), |_| "no error"), kind, "{text}");
        }
        assert_eq!(
            read(&format!("{start}Vertices\n1\n0 0 0 0\nTetrahedra\n1\n1 1 1 2 0\n")),
            Err(ReadError::IndexOutOfRange {
                element: "tetrahedron",
                number: 0,
                location: FileLocation::Line(8),
                index: 2,
                vertices: 1
            })
        );
    }
}
