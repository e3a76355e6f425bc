//! VTK's files in XML: polygonal data (`.vtp`) and unstructured grids (`.vtu`), their pieces one after the other.

use std::borrow::Cow;

use roxmltree::Node;

use super::builder::Builder;
use super::error::{FileLocation, ReadError, shorten};
use super::vtk::{self, Cells};
use super::vtk_arrays::{Appended, Array, Coding, refuse};
use super::{MeshFormat, RawMesh, ReadLimits, xml};

/// What polygons and strips of triangles are among cells.
const POLYGON: i64 = 7;
const STRIP: i64 = 6;

/// Whether an XML text is VTK's.
pub(super) fn is_xml(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1 << 12)];
    !head.starts_with(vtk::SIGNATURE) && head.windows(8).any(|window| window == b"<VTKFile")
}

/// Reads the points, and the cells that a legacy file would be read of. Vertices and lines of polygonal data are passed
/// over, as are data on points and cells.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let (text, appended) = apart(bytes)?;
    let document = xml::parse(&text, MeshFormat::Vtk)?;
    let root = document.root_element();
    let value_of = |attribute: &str| root.attribute(attribute).unwrap_or_default();
    let unsupported = |attribute: &str| ReadError::UnsupportedEncoding {
        format: MeshFormat::Vtk,
        encoding: shorten(value_of(attribute).as_bytes()),
    };
    let data = match value_of("type") {
        "PolyData" | "UnstructuredGrid" => root.children().find(|node| node.has_tag_name(value_of("type"))),
        _ => return Err(unsupported("type")),
    };
    let coding = Coding {
        big_endian: value_of("byte_order") == "BigEndian",
        wide_sizes: value_of("header_type") == "UInt64",
        compressed: match value_of("compressor") {
            "" => false,
            "vtkZLibDataCompressor" => true,
            _ => return Err(unsupported("compressor")),
        },
        appended,
    };
    let mut builder = Builder::new(limits);
    let pieces = data.into_iter().flat_map(|data| data.children().filter(|node| node.has_tag_name("Piece")));
    for piece in pieces {
        let first = builder.mesh.positions.len();
        points(piece, coding, &mut builder)?;
        if value_of("type") == "PolyData" {
            for (element, number, kind) in [("Polys", "NumberOfPolys", POLYGON), ("Strips", "NumberOfStrips", STRIP)] {
                if let Some(cells) = cells(piece, element, number, first, coding)? {
                    cells.each(|number, cell| vtk::add(&mut builder, kind, number, cell))?;
                }
            }
        } else if let Some(cells) = cells(piece, "Cells", "NumberOfCells", first, coding)? {
            let kinds = kinds(piece, cells.ends.len(), coding)?;
            cells.each(|number, cell| vtk::add(&mut builder, i64::from(kinds[number]), number, cell))?;
        }
    }
    builder.finish()
}

/// The text up to what is appended, closed, and what is appended. As they are, bytes are no XML.
fn apart(bytes: &[u8]) -> Result<(Cow<'_, str>, Option<Appended<'_>>), ReadError> {
    const OPENING: &[u8] = b"<AppendedData";
    let utf8 = |bytes| std::str::from_utf8(bytes).map_err(|_| refuse("the text is not UTF-8"));
    let position = |bytes: &[u8], sign: u8| bytes.iter().position(|&byte| byte == sign);
    let opens = |at: &usize| bytes[*at] == b'<' && bytes[*at..].starts_with(OPENING);
    let Some(begin) = (0..bytes.len()).find(opens) else { return Ok((Cow::Borrowed(utf8(bytes)?), None)) };
    let rest = &bytes[begin..];
    let end = position(rest, b'>').ok_or_else(|| refuse("the element `AppendedData` has no end"))?;
    let tag = utf8(&rest[..end])?;
    let base64 = match tag.split(['"', '\'']).nth(1) {
        Some("raw") => false,
        Some("base64") => true,
        _ => return Err(refuse("`AppendedData` is neither raw nor base64")),
    };
    let data = &rest[end + 1..];
    let first = position(data, b'_').ok_or_else(|| refuse("`AppendedData` has no sign `_` before its bytes"))?;
    let mut data = &data[first + 1..];
    if base64 {
        data = &data[..position(data, b'<').unwrap_or(data.len())];
    }
    Ok((Cow::Owned(format!("{}</VTKFile>", utf8(&bytes[..begin])?)), Some(Appended { data, base64 })))
}

/// A number that an attribute holds, zero where there is none.
fn count_attribute(node: Node<'_, '_>, attribute: &str) -> Result<u64, ReadError> {
    let text = node.attribute(attribute).unwrap_or("0").trim();
    text.parse().map_err(|_| refuse(format!("`{}` is not supported as {attribute}", shorten(text.as_bytes()))))
}

fn points<'a>(piece: Node<'a, '_>, coding: Coding<'a>, builder: &mut Builder) -> Result<(), ReadError> {
    let declared = count_attribute(piece, "NumberOfPoints")?;
    let points = piece.children().find(|node| node.has_tag_name("Points"));
    let array = points.and_then(|points| points.children().find(|node| node.has_tag_name("DataArray")));
    let Some(node) = array else {
        return if declared == 0 { Ok(()) } else { Err(refuse("a piece has no array of points")) };
    };
    if node.attribute("NumberOfComponents").unwrap_or("1").trim() != "3" {
        return Err(refuse("points: three components are needed"));
    }
    let array = Array::of(node, coding, "point")?;
    builder.expect_vertices(declared, array.possible() / 3)?;
    let mut point = [0.0; 3];
    array.each_real(3 * declared as usize, 3, |number, coordinate| {
        point[number % 3] = coordinate;
        if number % 3 == 2 { builder.vertex(point) } else { Ok(()) }
    })
}

/// An array by its name, and what messages call its numbers.
fn named<'a>(
    element: Node<'a, '_>,
    (name, one): (&str, &'static str),
    coding: Coding<'a>,
) -> Result<Array<'a>, ReadError> {
    let wanted = |node: &Node<'_, '_>| node.has_tag_name("DataArray") && node.attribute("Name") == Some(name);
    let node = element.children().find(wanted);
    let node = node.ok_or_else(|| refuse(format!("`{}` has no array `{name}`", element.tag_name().name())))?;
    Array::of(node, coding, one)
}

/// The cells of an element of a piece, with vertices counted from `first` on; `None` where there are none.
fn cells(
    piece: Node<'_, '_>,
    element: &str,
    number: &str,
    first: usize,
    coding: Coding<'_>,
) -> Result<Option<Cells>, ReadError> {
    let declared = count_attribute(piece, number)?;
    if declared == 0 {
        return Ok(None);
    }
    let found = piece.children().find(|node| node.has_tag_name(element));
    let found =
        found.ok_or_else(|| refuse(format!("{number} is {declared}, but the piece has no element `{element}`")))?;
    let offsets = named(found, ("offsets", "offset"), coding)?;
    let exceeds = |element: &'static str, declared: u64, array: &Array<'_>| match array.possible() {
        possible if declared > possible => Err(ReadError::CountExceedsFile { element, declared, possible }),
        _ => Ok(()),
    };
    exceeds("cell", declared, &offsets)?;
    let (mut ends, mut last) = (Vec::new(), 0);
    offsets.each_whole(declared as usize, |end| {
        let end = u32::try_from(end).ok().filter(|&end| end >= last);
        let (number, declared) = (ends.len(), declared as usize);
        last = end.ok_or(ReadError::Truncated { element: "cell", number, declared })?;
        ends.push(last);
        Ok(())
    })?;
    let connectivity = named(found, ("connectivity", "corner"), coding)?;
    exceeds("corner", u64::from(last), &connectivity)?;
    let mut corners = Vec::new();
    connectivity.each_whole(last as usize, |corner| {
        // What is less than zero is refused with the cell that has it.
        corners.push(if corner < 0 { corner } else { corner.saturating_add(first as i64) });
        Ok(())
    })?;
    Ok(Some(Cells { ends, corners, location: connectivity.location }))
}

/// What kind of cell each is.
fn kinds(piece: Node<'_, '_>, count: usize, coding: Coding<'_>) -> Result<Vec<u8>, ReadError> {
    let element = piece.children().find(|node| node.has_tag_name("Cells"));
    let element = element
        .ok_or(ReadError::MissingSection { location: FileLocation::Byte(piece.range().start), section: "Cells" })?;
    let mut kinds = Vec::with_capacity(count);
    named(element, ("types", "type"), coding)?.each_whole(count, |kind| {
        // No cell has the last of all numbers for its type.
        kinds.push(u8::try_from(kind).unwrap_or(u8::MAX));
        Ok(())
    })?;
    Ok(kinds)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: &str = include_str!("data/grid-ascii.vtu");

    fn read_all(bytes: &[u8]) -> RawMesh {
        read(bytes, &ReadLimits::default()).unwrap()
    }

    fn refused(text: &str) -> String {
        read(text.as_bytes(), &ReadLimits::default()).unwrap_err().to_string()
    }

    #[test]
    fn all_encodings_of_vtk_hold_one_surface() {
        let mesh = read_all(include_bytes!("data/mixed-zlib.vtp"));
        assert_eq!(mesh.positions.len(), 12);
        assert_eq!(mesh.positions[11], [2.0, 3.0, 1.5]);
        // A quadrilateral, two triangles and a hexagon, then a strip; a vertex and a line are passed over.
        assert_eq!((mesh.faces.len(), mesh.polygons_triangulated), (12, 2));
        assert_eq!(mesh.faces[8..], [[6, 9, 7], [7, 9, 10], [7, 10, 8], [8, 10, 11]]);
        assert_eq!(read_all(include_bytes!("data/mixed-raw.vtp")), mesh);
        assert_eq!(read_all(include_bytes!("data/mixed-base64.vtp")), mesh);
    }

    #[test]
    fn grids_have_their_tetrahedra_and_faces() {
        let mesh = read_all(GRID.as_bytes());
        assert_eq!((mesh.positions.len(), mesh.tetrahedra.len(), mesh.faces.len()), (12, 5, 5));
        assert_eq!((mesh.tetrahedra[0], mesh.faces[0]), ([0, 1, 3, 6], [1, 2, 4]));
        assert_eq!(mesh.positions[11], [2.0, 1.0, 1.25]);
        assert_eq!(read_all(include_bytes!("data/grid-binary.vtu")), mesh);
    }

    fn piece(points: &str, corners: &str) -> String {
        format!(
            "<Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">{points}\
             </DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">{corners}</DataArray><DataArray \
             type=\"Int32\" Name=\"offsets\" format=\"ascii\">3</DataArray></Polys></Piece>"
        )
    }

    #[test]
    fn pieces_count_their_own_vertices() {
        let file = |second: &str| {
            let first = piece("0 0 0 1 0 0 0 1 0", "0 1 2");
            let second = piece("5 0 0 6 0 0 5 1 0", second);
            format!("<?xml version=\"1.0\"?><VTKFile type=\"PolyData\"><PolyData>{first}{second}</PolyData></VTKFile>")
        };
        let mesh = read_all(file("2 1 0").as_bytes());
        assert_eq!((mesh.positions[3], mesh.positions.len()), ([5.0, 0.0, 0.0], 6));
        assert_eq!(mesh.faces, [[0, 1, 2], [5, 4, 3]]);
        // No piece reaches for the vertices of another.
        for other in ["0 1 -1", "0 1 3", "0 1 9223372036854775807"] {
            assert!(refused(&file(other)).contains("refers to vertex"), "{other}");
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        for (from, to, expected) in [
            ("type=\"UnstructuredGrid\"", "type=\"ImageData\"", "ImageData"),
            ("header_type=\"UInt32\"", "compressor=\"vtkLZ4DataCompressor\"", "vtkLZ4DataCompressor"),
            ("NumberOfComponents=\"3\"", "NumberOfComponents=\"2\"", "three components"),
            ("NumberOfPoints=\"12\"", "NumberOfPoints=\"13\"", "point 12 of 13"),
            ("NumberOfPoints=\"12\"", "NumberOfPoints=\"4000000000\"", "announces 4000000000"),
            ("NumberOfCells=\"9\"", "NumberOfCells=\"10\"", "offset 9 of 10"),
            ("NumberOfCells=\"9\"", "NumberOfCells=\"4000000000\"", "announces 4000000000"),
            ("NumberOfCells=\"9\"", "NumberOfCells=\"some\"", "`some` is not supported as NumberOfCells"),
            ("Name=\"connectivity\"", "Name=\"corners\"", "no array `connectivity`"),
            ("type=\"Float32\"", "type=\"Complex\"", "`Complex` is not supported as type"),
            ("format=\"ascii\"", "format=\"binary\"", "announces 12 of"),
            ("format=\"ascii\"", "format=\"appended\"", "`AppendedData` is missing"),
            (
                "type=\"Int64\" Name=\"offsets\"",
                "type=\"Float32\" Name=\"offsets\"",
                "offset: whole numbers are needed",
            ),
            ("NumberOfPoints", "NumberOfPlaces", "refers to vertex"),
            ("</VTKFile>", "", "VTK"),
        ] {
            assert!(GRID.contains(from), "{from}");
            let refused = refused(&GRID.replacen(from, to, 1));
            assert!(refused.contains(expected), "{from}: {refused}");
        }
        assert!(refused(&GRID.replace("Cells>", "Calls>")).contains("no element `Cells`"));
    }

    #[test]
    fn appended_bytes_that_are_cut_or_damaged_are_refused() {
        let whole = include_bytes!("data/mixed-raw.vtp");
        let begin = whole.windows(13).position(|window| window == b"<AppendedData").unwrap();
        for end in begin..whole.len() - 40 {
            assert!(read(&whole[..end], &ReadLimits::default()).is_err(), "{end}");
        }
        let folded = include_str!("data/mixed-zlib.vtp");
        assert!(refused(&folded.replacen("eF5jY", "eF5jZ", 1)).contains("damaged"));
        // A bomb: few bytes that would unfold to very many.
        let bomb = folded.replacen("NumberOfPoints=\"12\"", "NumberOfPoints=\"4000000\"", 1);
        assert!(refused(&bomb).contains("announces 4000000"));
    }
}
