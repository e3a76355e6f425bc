//! VTK's legacy files, ASCII and binary: polygonal data and unstructured grids. Those in XML: `vtk_xml`.

use super::builder::{Builder, zero_based_index};
use super::error::{FileLocation, ReadError, shorten};
use super::text::Text;
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads the points, and of the cells triangles, strips, polygons, pixels, quadrilaterals and tetrahedra; points and
/// lines are passed over. Of cells of higher order the corners are taken. Data on points and cells are not read.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut file = File::new(bytes)?;
    let mut builder = Builder::new(limits);
    file.dataset()?;
    let mut grid: Option<Cells> = None;
    let mut sections = 0usize;
    while file.text.any() {
        sections += 1;
        if sections > limits.groups {
            return Err(ReadError::TooManyGroups { location: file.text.location(), limit: limits.groups });
        }
        let location = file.text.location();
        match file.text.token() {
            b"POINTS" if !builder.mesh.positions.is_empty() => {
                return Err(ReadError::DuplicateElement { location, element: "POINTS" });
            }
            b"POINTS" => file.points(&mut builder)?,
            b"VERTICES" | b"LINES" => {
                file.cells()?;
            }
            b"POLYGONS" => file.cells()?.each(|number, cell| add(&mut builder, 7, number, cell))?,
            b"TRIANGLE_STRIPS" => file.cells()?.each(|number, cell| add(&mut builder, 6, number, cell))?,
            b"CELLS" if grid.is_some() => return Err(ReadError::DuplicateElement { location, element: "CELLS" }),
            b"CELLS" => grid = Some(file.cells()?),
            b"CELL_TYPES" => {
                let cells = grid.take().ok_or(ReadError::MissingSection { location, section: "CELLS" })?;
                let declared = file.text.count("cell types")?;
                let kinds = file.integers(declared, "int", "cell type")?;
                if kinds.len() != cells.ends.len() {
                    let (declared, possible) = (kinds.len() as u64, cells.ends.len() as u64);
                    return Err(ReadError::CountExceedsFile { element: "cell type", declared, possible });
                }
                cells.each(|number, cell| add(&mut builder, kinds[number], number, cell))?;
            }
            b"METADATA" => file.pass_over_metadata(),
            b"FIELD" => file.pass_over_fields()?,
            b"POINT_DATA" | b"CELL_DATA" => break,
            word => return Err(ReadError::UnexpectedWord { location, token: shorten(word) }),
        }
    }
    if grid.is_some() {
        return Err(ReadError::MissingSection { location: file.text.location(), section: "CELL_TYPES" });
    }
    builder.finish()
}

/// A cell of a type of VTK's.
pub(super) fn add(
    builder: &mut Builder,
    kind: i64,
    number: usize,
    (corners, location): (&[i64], FileLocation),
) -> Result<(), ReadError> {
    let vertices = builder.mesh.positions.len();
    let vertex = |index: i64| zero_based_index(index, vertices, "cell", number, location);
    let least = |count: usize| {
        let short = ReadError::Truncated { element: "cell", number, declared: count };
        if corners.len() < count { Err(short) } else { Ok(()) }
    };
    let polygon = |builder: &mut Builder, order: &mut dyn Iterator<Item = i64>| {
        for index in order {
            builder.corner(vertex(index)?, location)?;
        }
        builder.end_polygon();
        Ok(())
    };
    match kind {
        // Nothing, points and lines.
        0 | 1 | 2 | 3 | 4 | 21 | 35 => Ok(()),
        7 => polygon(builder, &mut corners.iter().copied()),
        5 | 22 => {
            least(3)?;
            polygon(builder, &mut corners[..3].iter().copied())
        }
        9 | 23 | 28 => {
            least(4)?;
            polygon(builder, &mut corners[..4].iter().copied())
        }
        // A pixel counts row by row.
        8 => {
            least(4)?;
            polygon(builder, &mut [0, 1, 3, 2].iter().map(|&k| corners[k]))
        }
        6 => {
            builder.mesh.faces.reserve(corners.len().saturating_sub(2));
            for (k, three) in corners.windows(3).enumerate() {
                let [a, b, c] = [vertex(three[0])?, vertex(three[1])?, vertex(three[2])?];
                builder.triangle(if k % 2 == 0 { [a, b, c] } else { [b, a, c] })?;
            }
            Ok(())
        }
        10 | 24 => {
            least(4)?;
            builder.tetrahedron([vertex(corners[0])?, vertex(corners[1])?, vertex(corners[2])?, vertex(corners[3])?])
        }
        other => {
            let encoding = format!("cells of type {other}");
            Err(ReadError::UnsupportedEncoding { format: MeshFormat::Vtk, encoding })
        }
    }
}

/// Lists of corners, one after the other.
pub(super) struct Cells {
    pub ends: Vec<u32>,
    pub corners: Vec<i64>,
    pub location: FileLocation,
}

impl Cells {
    pub fn each(
        self,
        mut with: impl FnMut(usize, (&[i64], FileLocation)) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        let mut begin = 0;
        for (number, &end) in self.ends.iter().enumerate() {
            with(number, (&self.corners[begin..end as usize], self.location))?;
            begin = end as usize;
        }
        Ok(())
    }
}

struct File<'a> {
    bytes: &'a [u8],
    text: Text<'a>,
    binary: bool,
    /// Whether cells come as offsets and corners, as from version 5 on.
    offsets: bool,
}

impl<'a> File<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, ReadError> {
        let wrong =
            |line, reason| ReadError::Header { format: MeshFormat::Vtk, location: FileLocation::Line(line), reason };
        let mut ends = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1);
        let [Some(first), Some(second)] = [ends.next(), ends.next()] else {
            return Err(wrong(1, "a line with the version and one with a title are missing"));
        };
        let version = bytes[..first].trim_ascii().strip_prefix(SIGNATURE).map(<[u8]>::trim_ascii);
        let Some(major) = version.and_then(|version| version.first()).filter(|digit| digit.is_ascii_digit()) else {
            return Err(wrong(1, "it does not begin with \"# vtk DataFile Version\" and a number"));
        };
        let mut text = Text::resume(bytes, second, 3);
        let binary = match if text.any() { text.token() } else { b"" } {
            b"ASCII" => false,
            b"BINARY" => true,
            _ => return Err(wrong(3, "it is neither ASCII nor BINARY")),
        };
        Ok(Self { bytes, text, binary, offsets: *major >= b'5' })
    }

    fn word(&mut self, expected: &'static str) -> Result<&'a [u8], ReadError> {
        if !self.text.any() {
            return Err(ReadError::MissingValue { location: self.text.location(), expected });
        }
        Ok(self.text.token())
    }

    fn dataset(&mut self) -> Result<(), ReadError> {
        let location = self.text.location();
        if self.word("DATASET")? != b"DATASET" {
            return Err(ReadError::MissingSection { location, section: "DATASET" });
        }
        match self.word("a kind of data")? {
            b"POLYDATA" | b"UNSTRUCTURED_GRID" => Ok(()),
            other => Err(ReadError::UnsupportedEncoding { format: MeshFormat::Vtk, encoding: shorten(other) }),
        }
    }

    fn points(&mut self, builder: &mut Builder) -> Result<(), ReadError> {
        let declared = self.text.count("points")?;
        let location = self.text.location();
        let kind = self.word("a type of number")?;
        if !self.binary {
            self.size(kind, location)?;
            builder.expect_vertices(declared, (self.text.remaining() as u64).div_ceil(6))?;
            for number in 0..declared as usize {
                let mut position = [0.0; 3];
                for coordinate in &mut position {
                    if !self.text.any() {
                        return Err(ReadError::Truncated { element: "point", number, declared: declared as usize });
                    }
                    *coordinate = self.text.float("a coordinate")?;
                }
                builder.vertex(position)?;
            }
            return Ok(());
        }
        let size = self.size(kind, location)?;
        let possible = self.text.remaining() as u64 / (3 * size as u64);
        builder.expect_vertices(declared, possible)?;
        let block = self.block(3 * declared, size, "point")?;
        let number = |bytes: &[u8]| match *bytes {
            [a, b, c, d] => f64::from(f32::from_be_bytes([a, b, c, d])),
            [a, b, c, d, e, f, g, h] => f64::from_be_bytes([a, b, c, d, e, f, g, h]),
            _ => f64::NAN,
        };
        if !matches!(kind, b"float" | b"double") {
            return Err(ReadError::UnknownType { location, name: shorten(kind) });
        }
        for point in block.chunks_exact(3 * size) {
            builder.vertex([0, 1, 2].map(|k| number(&point[k * size..(k + 1) * size])))?;
        }
        Ok(())
    }

    /// The bytes of a number of a type.
    fn size(&self, kind: &[u8], location: FileLocation) -> Result<usize, ReadError> {
        Ok(match kind {
            b"char" | b"unsigned_char" | b"signed_char" => 1,
            b"short" | b"unsigned_short" => 2,
            b"int" | b"unsigned_int" | b"float" | b"vtkIdType" => 4,
            b"long" | b"unsigned_long" | b"double" | b"vtktypeint64" | b"vtktypeuint64" => 8,
            other => return Err(ReadError::UnknownType { location, name: shorten(other) }),
        })
    }

    /// So many binary numbers, which begin on the next line.
    fn block(&mut self, numbers: u64, size: usize, element: &'static str) -> Result<&'a [u8], ReadError> {
        self.text.skip_line();
        let at = self.bytes.len() - self.text.remaining();
        let possible = (self.text.remaining() / size) as u64;
        if numbers > possible {
            return Err(ReadError::CountExceedsFile { element, declared: numbers, possible });
        }
        let end = at + numbers as usize * size;
        let FileLocation::Line(line) = self.text.location() else { return Ok(&[]) };
        self.text = Text::resume(self.bytes, end, line);
        Ok(&self.bytes[at..end])
    }

    /// So many integers of a type.
    fn integers(&mut self, count: u64, kind: &str, element: &'static str) -> Result<Vec<i64>, ReadError> {
        let location = self.text.location();
        let size = self.size(kind.as_bytes(), location)?;
        if self.binary {
            let block = self.block(count, size, element)?;
            let signed = !kind.starts_with("unsigned");
            return Ok(block.chunks_exact(size).map(|bytes| big_endian(bytes, signed)).collect());
        }
        let possible = (self.text.remaining() as u64).div_ceil(2);
        if count > possible {
            return Err(ReadError::CountExceedsFile { element, declared: count, possible });
        }
        let mut numbers = Vec::with_capacity(count as usize);
        for number in 0..count as usize {
            if !self.text.any() {
                return Err(ReadError::Truncated { element, number, declared: count as usize });
            }
            numbers.push(self.text.integer("an index")?);
        }
        Ok(numbers)
    }

    fn cells(&mut self) -> Result<Cells, ReadError> {
        let (declared, size) = (self.text.count("cells")?, self.text.count("numbers")?);
        let location = self.text.location();
        let wrong = |number: usize| ReadError::Truncated { element: "cell", number, declared: declared as usize };
        if self.offsets {
            let offsets = self.named(b"OFFSETS", "OFFSETS", declared)?;
            let corners = self.named(b"CONNECTIVITY", "CONNECTIVITY", size)?;
            // The first offset is 0, each of the others an end.
            if offsets.first().is_some_and(|&first| first != 0) {
                return Err(wrong(0));
            }
            let mut last = 0;
            let mut ends = Vec::with_capacity(offsets.len().saturating_sub(1));
            for (number, &end) in offsets.iter().enumerate().skip(1) {
                if end < last || end as u64 > corners.len() as u64 {
                    return Err(wrong(number - 1));
                }
                last = end;
                ends.push(u32::try_from(end).map_err(|_| wrong(number - 1))?);
            }
            return Ok(Cells { ends, corners, location });
        }
        let mut corners = self.integers(size, "int", "cell")?;
        let (mut ends, mut at, mut kept) = (Vec::new(), 0usize, 0usize);
        for number in 0..declared as usize {
            let own = corners.get(at).and_then(|&own| usize::try_from(own).ok()).ok_or_else(|| wrong(number))?;
            if own > corners.len() - at - 1 {
                return Err(wrong(number));
            }
            // The counts are taken out in place.
            corners.copy_within(at + 1..at + 1 + own, kept);
            (at, kept) = (at + 1 + own, kept + own);
            ends.push(u32::try_from(kept).map_err(|_| wrong(number))?);
        }
        corners.truncate(kept);
        Ok(Cells { ends, corners, location })
    }

    /// An array with its name and type before it.
    fn named(&mut self, name: &[u8], section: &'static str, count: u64) -> Result<Vec<i64>, ReadError> {
        let location = self.text.location();
        if self.word(section)? != name {
            return Err(ReadError::MissingSection { location, section });
        }
        let kind = String::from_utf8_lossy(self.word("a type of number")?).into_owned();
        self.integers(count, &kind, section)
    }

    /// What is said about an array ends with an empty line.
    fn pass_over_metadata(&mut self) {
        self.text.skip_line();
        while self.text.on_line() {
            self.text.skip_line();
        }
    }

    /// Arrays that belong to the whole.
    fn pass_over_fields(&mut self) -> Result<(), ReadError> {
        let _name = self.word("the name of a field")?;
        for _ in 0..self.text.count("arrays")? {
            let _name = self.word("the name of an array")?;
            let (columns, rows) = (self.text.count("components")?, self.text.count("tuples")?);
            let location = self.text.location();
            let kind = self.word("a type of number")?;
            let size = self.size(kind, location)?;
            let numbers = columns.saturating_mul(rows);
            if self.binary {
                self.block(numbers, size, "field")?;
                continue;
            }
            for number in 0..numbers {
                if !self.text.any() {
                    let (number, declared) = (number as usize, numbers as usize);
                    return Err(ReadError::Truncated { element: "field", number, declared });
                }
                self.text.float("a number")?;
            }
        }
        Ok(())
    }
}

/// An integer of one to eight bytes.
fn big_endian(bytes: &[u8], signed: bool) -> i64 {
    let negative = signed && bytes.first().is_some_and(|byte| byte & 0x80 != 0);
    bytes.iter().fold(if negative { -1 } else { 0 }, |number: i64, &byte| (number << 8) | i64::from(byte))
}

/// What every file begins with.
pub(super) const SIGNATURE: &[u8] = b"# vtk DataFile Version";

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<RawMesh, ReadError> {
        super::read(bytes, &ReadLimits::default())
    }

    const POINTS: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, -1.0]];

    const POLYDATA: &str = "# vtk DataFile Version 3.0\na title \\ # of any kind\nASCII\nDATASET POLYDATA\n\
        FIELD FieldData 1\nTIME 1 1 double\n0.5\nPOINTS 5 float\n0 0 0 1 0 0\n1 1 0 0 1 0 0.5 0.5 -1\nMETADATA\nINFORMATION 1\nNAME L2\n\n\
        LINES 1 3\n2 0 1\nPOLYGONS 2 9\n3 0 1 2\n4 0 1 2 3\nTRIANGLE_STRIPS 1 5\n4 0 1 4 2\nPOINT_DATA 5\nSCALARS a float 1\n";

    /// The same in binary, by offsets if `five`.
    fn binary(five: bool) -> Vec<u8> {
        let version = if five { "5.1" } else { "2.0" };
        let mut bytes =
            format!("# vtk DataFile Version {version}\nt\nBINARY\nDATASET POLYDATA\nPOINTS 5 float\n").into_bytes();
        POINTS.iter().flatten().for_each(|x| bytes.extend(x.to_be_bytes()));
        let lists: [(&str, &[&[i32]]); 3] =
            [("LINES", &[&[0, 1]]), ("POLYGONS", &[&[0, 1, 2], &[0, 1, 2, 3]]), ("TRIANGLE_STRIPS", &[&[0, 1, 4, 2]])];
        for (name, cells) in lists {
            let corners: usize = cells.iter().map(|cell| cell.len()).sum();
            if five {
                bytes.extend(format!("\n{name} {} {corners}\nOFFSETS vtktypeint64\n", cells.len() + 1).bytes());
                let mut end = 0i64;
                bytes.extend(end.to_be_bytes());
                for cell in cells {
                    end += cell.len() as i64;
                    bytes.extend(end.to_be_bytes());
                }
                bytes.extend(b"\nCONNECTIVITY vtktypeint64\n");
                cells.iter().flat_map(|cell| cell.iter()).for_each(|&v| bytes.extend(i64::from(v).to_be_bytes()));
            } else {
                bytes.extend(format!("\n{name} {} {}\n", cells.len(), corners + cells.len()).bytes());
                for cell in cells {
                    bytes.extend((cell.len() as i32).to_be_bytes());
                    cell.iter().for_each(|v| bytes.extend(v.to_be_bytes()));
                }
            }
        }
        bytes.extend(b"\nCELL_DATA 4\n");
        bytes
    }

    #[test]
    fn every_encoding_gives_the_same_mesh() {
        let mesh = read(POLYDATA.as_bytes()).unwrap();
        assert_eq!(mesh.positions, POINTS.map(|p| p.map(f64::from)));
        assert_eq!(mesh.faces.len(), 5);
        assert_eq!(mesh.faces[0], [0, 1, 2]);
        assert_eq!(mesh.faces[3..], [[0, 1, 4], [4, 1, 2]]);
        assert_eq!(read(&binary(false)).unwrap(), mesh);
        assert_eq!(read(&binary(true)).unwrap(), mesh);
        assert_eq!(MeshFormat::sniff(POLYDATA.as_bytes()), Some(MeshFormat::Vtk));
    }

    #[test]
    fn grids_have_cells_of_several_types() {
        let text = "# vtk DataFile Version 2.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n0 0 0 1 0 0 1 1 0 0 1 0 .5 .5 -1\n\
                    CELLS 5 19\n1 0\n2 0 1\n3 0 1 2\n4 0 1 3 2\n4 0 1 2 4\nCELL_TYPES 5\n1 3 5 8 10\n";
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!((mesh.faces.len(), mesh.polygons_triangulated), (3, 1));
        assert_eq!(mesh.tetrahedra, [[0, 1, 2, 4]]);
        let kind = |text: String| read(text.as_bytes()).map_err(|error| error.kind());
        assert_eq!(kind(text.replace("5 8 10", "5 8 12")), Err("unsupported-encoding"));
        assert_eq!(kind(text.replace("5 8 10", "5 10 10")).map(|mesh| mesh.tetrahedra.len()), Ok(2));
        assert_eq!(kind(text.replace("1 3 5 8", "1 3 8 5")), Err("truncated-file"));
        assert_eq!(kind(text.replace("CELL_TYPES 5", "CELL_TYPES 4")), Err("count-exceeds-file"));
        assert_eq!(kind(text.replace("CELL_TYPES 5\n1 3 5 8 10\n", "")), Err("missing-section"));
    }

    #[test]
    fn refusals_are_typed() {
        let kind = |from: &str, to: &str| {
            read(POLYDATA.replacen(from, to, 1).as_bytes()).map_or_else(|error| error.kind(), |_| "no error")
        };
        for (from, to, expected) in [
            ("# vtk", "# vkt", "invalid-header"),
            ("ASCII", "UTF8", "invalid-header"),
            ("POLYDATA", "STRUCTURED_GRID", "unsupported-encoding"),
            ("DATASET", "DATA", "missing-section"),
            ("POINTS 5 float", "POINTS 5 quad", "unknown-type"),
            ("POINTS 5", "POINTS 4000000000", "count-exceeds-file"),
            ("POINTS 5", "POINTS -5", "invalid-count"),
            ("POINTS 5", "POINTS 9", "not-a-number"),
            ("POLYGONS 2 9", "POLYGONS 2 4000000000", "count-exceeds-file"),
            ("POLYGONS 2 9", "POLYGONS 3 9", "truncated-file"),
            ("4 0 1 2 3\nTRI", "5 0 1 2 3\nTRI", "truncated-file"),
            ("4 0 1 2 3\nTRI", "4 0 1 2 7\nTRI", "index-out-of-range"),
            ("4 0 1 4 2", "4 0 1 4 -2", "index-out-of-range"),
            ("LINES", "LIENS", "unexpected-word"),
        ] {
            assert_eq!(kind(from, to), expected, "{to}");
        }
        for five in [false, true] {
            let whole = binary(five);
            for cut in [60, 100, 140] {
                assert!(read(&whole[..cut]).is_err(), "{cut}");
            }
        }
        let mut wrong = binary(true);
        let at = wrong.windows(12).position(|word| word == b"vtktypeint64").unwrap() + 13;
        wrong[at + 8] = 0x7f;
        assert_eq!(read(&wrong).map_err(|error| error.kind()), Err("truncated-file"));
    }
}
