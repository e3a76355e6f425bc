//! GIFTI surfaces (`.surf.gii`): XML with arrays as text, base64, or base64 of a compressed stream.
//!
//! The first array of points and the first of triangles are read as they are stored; matrices that lead to other
//! coordinate systems are not applied.

use std::io::Read;

use flate2::read::{GzDecoder, ZlibDecoder};
use roxmltree::Node;

use super::builder::{Builder, zero_based_index};
use super::error::{FileLocation, ReadError, shorten};
use super::{MeshFormat, RawMesh, ReadLimits, xml};

/// Compressed arrays unfold to at most so many times the bytes of their text; real ones do to less than ten times.
const UNFOLDED: usize = 24;

fn refuse(reason: impl Into<String>) -> ReadError {
    ReadError::Arrays { format: MeshFormat::Gifti, reason: reason.into() }
}

/// Whether an XML text is GIFTI.
pub(super) fn is_xml(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1 << 12)];
    head.windows(6).any(|window| window == b"<GIFTI")
}

/// Reads points, and triangles if there are any.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let text = std::str::from_utf8(bytes).map_err(|_| refuse("the text is not UTF-8"))?;
    let document = xml::parse(text, MeshFormat::Gifti)?;
    let array = |intent: &str| {
        let wanted = |node: &Node<'_, '_>| node.has_tag_name("DataArray") && node.attribute("Intent") == Some(intent);
        document.root_element().children().find(wanted)
    };
    let mut builder = Builder::new(limits);
    let points = array("NIFTI_INTENT_POINTSET").ok_or_else(|| refuse("it has no NIFTI_INTENT_POINTSET"))?;
    let points = Array::of(points, "points")?;
    let possible = points.possible_rows();
    builder.expect_vertices(points.rows, possible)?;
    points.each_row(|_, row| builder.vertex(row))?;
    if let Some(triangles) = array("NIFTI_INTENT_TRIANGLE") {
        let triangles = Array::of(triangles, "triangles")?;
        let possible = triangles.possible_rows();
        builder.expect_faces(triangles.rows, possible, possible)?;
        let vertices = builder.mesh.positions.len();
        triangles.each_row(|number, row| {
            let mut face = [0; 3];
            for (corner, index) in face.iter_mut().zip(row) {
                // Nor is the fraction of an infinite or missing number zero.
                if index.fract() != 0.0 {
                    return Err(refuse(format!("face {number}: {index} is not a whole number")));
                }
                *corner = zero_based_index(index as i64, vertices, "face", number, triangles.location)?;
            }
            builder.triangle(face)
        })?;
    }
    builder.finish()
}

/// An array of `rows × 3` numbers.
struct Array<'a> {
    name: &'static str,
    rows: u64,
    /// The first number is at 0, the second of its row so many further, that of the next row so many.
    by_columns: bool,
    kind: Kind,
    encoding: Encoding,
    big_endian: bool,
    text: &'a str,
    location: FileLocation,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Float32,
    Float64,
    Int32,
    Uint8,
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Base64,
    Compressed,
}

impl Kind {
    fn width(self) -> usize {
        match self {
            Self::Uint8 => 1,
            Self::Float32 | Self::Int32 => 4,
            Self::Float64 => 8,
        }
    }
}

impl<'a> Array<'a> {
    fn of(node: Node<'a, '_>, name: &'static str) -> Result<Self, ReadError> {
        let value_of = |attribute: &str| node.attribute(attribute).unwrap_or_default().trim();
        let unknown = |attribute: &str| {
            refuse(format!("{name}: `{}` is not supported as {attribute}", shorten(value_of(attribute).as_bytes())))
        };
        let size = |attribute| value_of(attribute).parse::<u64>().map_err(|_| unknown(attribute));
        if value_of("Dimensionality") != "2" || size("Dim1")? != 3 {
            return Err(refuse(format!("{name}: an array of n × 3 is needed")));
        }
        let kind = match value_of("DataType") {
            "NIFTI_TYPE_FLOAT32" => Kind::Float32,
            "NIFTI_TYPE_FLOAT64" => Kind::Float64,
            "NIFTI_TYPE_INT32" => Kind::Int32,
            "NIFTI_TYPE_UINT8" => Kind::Uint8,
            _ => return Err(unknown("DataType")),
        };
        let encoding = match value_of("Encoding") {
            "ASCII" => Encoding::Ascii,
            "Base64Binary" => Encoding::Base64,
            "GZipBase64Binary" => Encoding::Compressed,
            other => {
                let encoding = shorten(other.as_bytes());
                return Err(ReadError::UnsupportedEncoding { format: MeshFormat::Gifti, encoding });
            }
        };
        let data = node.children().find(|child| child.has_tag_name("Data"));
        let text = data.and_then(|data| data.text()).unwrap_or_default();
        Ok(Self {
            name,
            rows: size("Dim0")?,
            by_columns: value_of("ArrayIndexingOrder") == "ColumnMajorOrder",
            kind,
            encoding,
            big_endian: value_of("Endian") == "BigEndian",
            text,
            location: FileLocation::Byte(data.map_or(0, |data| data.range().start)),
        })
    }

    /// The most rows that the text can hold.
    fn possible_rows(&self) -> u64 {
        let (text, row) = (self.text.len(), 3 * self.kind.width());
        (match self.encoding {
            Encoding::Ascii => text.div_ceil(6),
            Encoding::Base64 => text / 4 * 3 / row,
            Encoding::Compressed => text.saturating_mul(UNFOLDED) / row,
        }) as u64
    }

    fn each_row(&self, mut take: impl FnMut(usize, [f64; 3]) -> Result<(), ReadError>) -> Result<(), ReadError> {
        let rows = self.rows as usize;
        if self.by_columns {
            let mut columns = Vec::with_capacity(3 * rows);
            self.numbers(3 * rows, |x| {
                columns.push(x);
                Ok(())
            })?;
            return (0..rows).try_for_each(|row| take(row, [0, 1, 2].map(|k| columns[k * rows + row])));
        }
        let (mut row, mut number) = ([0.0; 3], 0);
        self.numbers(3 * rows, |x| {
            row[number % 3] = x;
            number += 1;
            if number % 3 == 0 { take(number / 3 - 1, row) } else { Ok(()) }
        })
    }

    /// Hands so many numbers on.
    fn numbers(&self, count: usize, mut take: impl FnMut(f64) -> Result<(), ReadError>) -> Result<(), ReadError> {
        let short =
            |number: usize| ReadError::Truncated { element: self.name, number: number / 3, declared: count / 3 };
        if self.encoding == Encoding::Ascii {
            let mut words = self.text.split_ascii_whitespace();
            for number in 0..count {
                let word = words.next().ok_or_else(|| short(number))?;
                take(word.parse().map_err(|_| ReadError::NotANumber {
                    location: self.location,
                    token: shorten(word.as_bytes()),
                    expected: self.name,
                })?)?;
            }
            return Ok(());
        }
        let damaged = || refuse(format!("{}: the text is not base64", self.name));
        let bytes = super::base64(self.text.as_bytes()).ok_or_else(damaged)?;
        let mut stream: Box<dyn Read + '_> = match self.encoding {
            Encoding::Compressed if bytes.starts_with(&[0x1f, 0x8b]) => Box::new(GzDecoder::new(&bytes[..])),
            Encoding::Compressed => Box::new(ZlibDecoder::new(&bytes[..])),
            _ => Box::new(&bytes[..]),
        };
        let width = self.kind.width();
        // Whole numbers of every width fit in.
        let mut block = [0u8; 1 << 12];
        let mut number = 0;
        while number < count {
            let wanted = ((count - number) * width).min(block.len());
            stream.read_exact(&mut block[..wanted]).map_err(|_| short(number))?;
            for bytes in block[..wanted].chunks_exact(width) {
                take(self.number(bytes))?;
                number += 1;
            }
        }
        Ok(())
    }

    fn number(&self, bytes: &[u8]) -> f64 {
        let mut own = [0u8; 8];
        own[..bytes.len()].copy_from_slice(bytes);
        if self.big_endian {
            own[..bytes.len()].reverse();
        }
        let four = [own[0], own[1], own[2], own[3]];
        match self.kind {
            Kind::Float32 => f64::from(f32::from_le_bytes(four)),
            Kind::Float64 => f64::from_le_bytes(own),
            Kind::Int32 => f64::from(i32::from_le_bytes(four)),
            Kind::Uint8 => f64::from(own[0]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::xml::{MOST_ATTRIBUTES, MOST_TAGS};

    const ASCII: &str = include_str!("data/ascii.surf.gii");

    #[test]
    fn all_encodings_of_another_library_hold_one_surface() {
        let limits = ReadLimits::default();
        let gzip = read(include_bytes!("data/gzip.surf.gii"), &limits).unwrap();
        assert_eq!((gzip.positions.len(), gzip.faces.len()), (42, 80));
        assert_eq!(read(include_bytes!("data/base64.surf.gii"), &limits).unwrap(), gzip);
        let ascii = read(ASCII.as_bytes(), &limits).unwrap();
        assert_eq!(ascii.faces, gzip.faces);
        for (p, q) in ascii.positions.iter().zip(&gzip.positions) {
            // Six digits are written.
            assert!(p.iter().zip(q).all(|(a, b)| (a - b).abs() < 1e-6));
            assert!((q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn columns_and_high_bytes_first_are_read_as_told() {
        let array = |intent: &str, kind: &str, rest: &str, data: &str| {
            format!(
                "<DataArray Intent=\"NIFTI_INTENT_{intent}\" DataType=\"NIFTI_TYPE_{kind}\" Dimensionality=\"2\" Dim0=\"3\" Dim1=\"3\" {rest}><Data>{data}</Data></DataArray>"
            )
        };
        let rest = "ArrayIndexingOrder=\"ColumnMajorOrder\" Encoding=\"ASCII\"";
        let points = array("POINTSET", "FLOAT64", rest, "0 1 0 0 0 2 0 0 3");
        let rest = "ArrayIndexingOrder=\"RowMajorOrder\" Encoding=\"Base64Binary\" Endian=\"BigEndian\"";
        let triangles = array("TRIANGLE", "INT32", rest, "AAAAAAAAAAEAAAACAAAAAAAAAAEAAAACAAAAAgAAAAEAAAAA");
        let raw = read(format!("<GIFTI>{points}{triangles}</GIFTI>").as_bytes(), &ReadLimits::default()).unwrap();
        assert_eq!(raw.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 3.0]]);
        assert_eq!(raw.faces, [[0, 1, 2], [0, 1, 2], [2, 1, 0]]);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        for (from, to, expected) in [
            ("POINTSET", "SHAPE", "no NIFTI_INTENT_POINTSET"),
            ("Dim0=\"42\"", "Dim0=\"43\"", "points 42 of 43"),
            ("Dim0=\"42\"", "Dim0=\"4000000000\"", "announces 4000000000"),
            ("Dim0=\"42\"", "Dim0=\"41\"", "vertex 41 of 41"),
            ("Dim1=\"3\"", "Dim1=\"2\"", "n × 3"),
            ("NIFTI_TYPE_FLOAT32", "NIFTI_TYPE_COMPLEX64", "NIFTI_TYPE_COMPLEX64"),
            ("Encoding=\"ASCII\"", "Encoding=\"ExternalFileBinary\"", "ExternalFileBinary"),
            ("Encoding=\"ASCII\"", "Encoding=\"Base64Binary\"", "points"),
            ("</GIFTI>", "", "GIFTI"),
            ("<GIFTI", "<!DOCTYPE a [<!ENTITY b \"c\">]><GIFTI", "entities"),
        ] {
            assert!(ASCII.contains(from), "{from}");
            let refused = read(ASCII.replacen(from, to, 1).as_bytes(), &ReadLimits::default()).unwrap_err().to_string();
            assert!(refused.contains(expected), "{from}: {refused}");
        }
        assert!(read(b"\xff\xfe<GIFTI/>", &ReadLimits::default()).unwrap_err().to_string().contains("UTF-8"));
        // Elements in each other, and entities that grow, end in an answer.
        let deep = "<a>".repeat(20_000) + &"</a>".repeat(20_000);
        assert!(read(deep.as_bytes(), &ReadLimits::default()).is_err());
        let mut laughs = String::from("<!DOCTYPE GIFTI [<!ENTITY a0 \"ha\">");
        (1..20).for_each(|k| laughs += &format!("<!ENTITY a{k} \"{}\">", format!("&a{};", k - 1).repeat(10)));
        assert!(read((laughs + "]><GIFTI>&a19;</GIFTI>").as_bytes(), &ReadLimits::default()).is_err());
    }

    #[test]
    fn a_text_that_would_take_far_more_than_its_length_is_refused_before_it_is_parsed() {
        let refused = |text: String| read(text.as_bytes(), &ReadLimits::default()).unwrap_err().to_string();
        // 100 MB of text in 60 kB: no reference is inside of an entity.
        let entity = "x".repeat(10_000);
        let flat = format!("<!DOCTYPE GIFTI [<!ENTITY a \"{entity}\">]><GIFTI>{}</GIFTI>", "&a;".repeat(10_000));
        assert!(refused(flat).contains("entities"));
        let tags = refused(format!("<GIFTI>{}</GIFTI>", "<a/>".repeat(MOST_TAGS)));
        assert!(tags.contains("65538 signs `<`"), "{tags}");
        let attributes: String = (0..=MOST_ATTRIBUTES).map(|k| format!(" a{k}=''")).collect();
        let attributes = refused(format!("<GIFTI{attributes}/>"));
        assert!(attributes.contains("16385 signs `=`"), "{attributes}");
        // As many as are read are parsed.
        let most: String = (0..MOST_ATTRIBUTES).map(|k| format!(" a{k}=''")).collect();
        assert!(refused(format!("<GIFTI{most}/>")).contains("NIFTI_INTENT_POINTSET"));
        let most = refused(format!("<GIFTI>{}</GIFTI>", "<a/>".repeat(MOST_TAGS - 2)));
        assert!(most.contains("NIFTI_INTENT_POINTSET"), "{most}");
    }

    #[test]
    fn an_index_that_is_no_whole_number_is_told() {
        let array = |intent: &str, kind: &str, data: &str| {
            format!(
                "<DataArray Intent=\"NIFTI_INTENT_{intent}\" DataType=\"NIFTI_TYPE_{kind}\" Dimensionality=\"2\" Dim0=\"3\" Dim1=\"3\" Encoding=\"ASCII\"><Data>{data}</Data></DataArray>"
            )
        };
        let points = array("POINTSET", "FLOAT32", "0 0 0 1 0 0 0 1 0");
        for (index, value_of) in [("1.5", "face 1: 1.5 is"), ("nan", "face 1: NaN is"), ("inf", "face 1: inf is")] {
            let triangles = array("TRIANGLE", "FLOAT32", &format!("0 1 2 0 {index} 2 0 1 2"));
            let text = format!("<GIFTI>{points}{triangles}</GIFTI>");
            let refused = read(text.as_bytes(), &ReadLimits::default()).unwrap_err().to_string();
            assert!(refused.contains(value_of), "{refused}");
        }
    }
}
