//! The header of a PLY file.

use super::super::error::shorten;
use super::super::text::Text;
use super::{FileLocation, MeshFormat, ReadError, ReadLimits};

/// The type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    fn parse(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Type::I8,
            b"uchar" | b"uint8" => Type::U8,
            b"short" | b"int16" => Type::I16,
            b"ushort" | b"uint16" => Type::U16,
            b"int" | b"int32" => Type::I32,
            b"uint" | b"uint32" => Type::U32,
            b"float" | b"float32" => Type::F32,
            b"double" | b"float64" => Type::F64,
            _ => return None,
        })
    }

    /// Bytes of one number.
    pub fn size(self) -> usize {
        match self {
            Type::I8 | Type::U8 => 1,
            Type::I16 | Type::U16 => 2,
            Type::I32 | Type::U32 | Type::F32 => 4,
            Type::F64 => 8,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Scalar(Type),
    List { length: Type, item: Type },
}

impl Kind {
    /// The fewest bytes of one record: a list may be empty.
    pub fn least_size(self) -> usize {
        match self {
            Kind::Scalar(scalar) => scalar.size(),
            Kind::List { length, .. } => length.size(),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    pub name: Vec<u8>,
    pub kind: Kind,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    pub name: Vec<u8>,
    pub count: u64,
    pub properties: Vec<Property>,
    pub location: FileLocation,
}

impl Element {
    pub fn find(&self, wanted: impl Fn(&Property) -> bool) -> Option<usize> {
        self.properties.iter().position(wanted)
    }

    /// Whether every record has the same number of bytes.
    pub fn is_fixed(&self) -> bool {
        self.properties.iter().all(|property| matches!(property.kind, Kind::Scalar(_)))
    }

    /// The fewest bytes of one record; for fixed elements, its bytes.
    pub fn least_size(&self) -> u64 {
        self.properties.iter().map(|property| property.kind.least_size() as u64).sum()
    }

    /// The name in messages.
    pub fn label(&self) -> &'static str {
        match self.name.as_slice() {
            b"vertex" => "vertex",
            b"face" => "face",
            b"tristrips" => "strip",
            _ => "other element",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    Binary { big_endian: bool },
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// The first byte of the body, and its line where the body is text.
    pub body: usize,
    pub body_line: usize,
}

impl Header {
    /// Parses up to the line end after `end_header`. Elements and properties count against the limit on groups.
    pub fn parse(bytes: &[u8], limits: &ReadLimits) -> Result<Self, ReadError> {
        let wrong = |location, reason| ReadError::Header { format: MeshFormat::Ply, location, reason };
        if !bytes.starts_with(b"ply") {
            return Err(wrong(FileLocation::Line(1), "it does not begin with `ply`"));
        }
        let mut lines = Lines::new(bytes);
        if lines.next().map(<[u8]>::trim_ascii) != Some(b"ply") {
            return Err(wrong(FileLocation::Line(1), "it does not begin with `ply`"));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut groups = 0usize;
        loop {
            let Some(line) = lines.next() else {
                return Err(wrong(FileLocation::Line(lines.number), "`end_header` is missing"));
            };
            let location = FileLocation::Line(lines.number);
            let mut words = Words { text: Text::resume(line, 0, lines.number) };
            let keyword = words.next();
            if matches!(keyword, Some(b"element" | b"property")) {
                groups += 1;
                if groups > limits.groups {
                    return Err(ReadError::TooManyGroups { location, limit: limits.groups });
                }
            }
            match keyword {
                None | Some(b"comment" | b"obj_info" | b"ply") => {}
                Some(b"format") => {
                    encoding = Some(match words.next() {
                        Some(b"ascii") => Encoding::Ascii,
                        Some(b"binary_little_endian") => Encoding::Binary { big_endian: false },
                        Some(b"binary_big_endian") => Encoding::Binary { big_endian: true },
                        other => {
                            let encoding = shorten(other.unwrap_or_default());
                            return Err(ReadError::UnsupportedEncoding { format: MeshFormat::Ply, encoding });
                        }
                    });
                }
                Some(b"element") => {
                    let name = words.required(location, "the name of an element")?.to_vec();
                    let count = words.text.count("elements")?;
                    elements.push(Element { name, count, properties: Vec::new(), location });
                }
                Some(b"property") => {
                    let kind = match words.required(location, "a type")? {
                        b"list" => {
                            Kind::List { length: words.number_type(location)?, item: words.number_type(location)? }
                        }
                        name => Kind::Scalar(number_type(name, location)?),
                    };
                    let name = words.required(location, "the name of a property")?.to_vec();
                    let element = elements.last_mut().ok_or(wrong(location, "a property before the first element"))?;
                    element.properties.push(Property { name, kind });
                }
                Some(b"end_header") => break,
                Some(word) => return Err(ReadError::UnexpectedWord { location, token: shorten(word) }),
            }
        }
        let encoding = encoding.ok_or(wrong(FileLocation::Line(lines.number), "the line `format` is missing"))?;
        Ok(Self { encoding, elements, body: lines.at, body_line: lines.number + 1 })
    }
}

fn number_type(name: &[u8], location: FileLocation) -> Result<Type, ReadError> {
    Type::parse(name).ok_or_else(|| ReadError::UnknownType { location, name: shorten(name) })
}

/// The words of one line.
struct Words<'a> {
    text: Text<'a>,
}

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        self.text.on_line().then(|| self.text.token())
    }

    fn required(&mut self, location: FileLocation, expected: &'static str) -> Result<&'a [u8], ReadError> {
        self.next().ok_or(ReadError::MissingValue { location, expected })
    }

    fn number_type(&mut self, location: FileLocation) -> Result<Type, ReadError> {
        number_type(self.required(location, "a type")?, location)
    }
}

/// The lines of the header. The first one settles how lines end, because a byte of the body that happens to be a line
/// feed must not be taken for part of the last line end.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: usize,
    end: Option<&'static [u8]>,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, number: 0, end: None }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        self.number += 1;
        let Some(length) = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
            self.at = self.bytes.len();
            return Some(rest);
        };
        let found: &'static [u8] = if rest[length..].starts_with(b"\r\n") {
            b"\r\n"
        } else if rest[length] == b'\n' {
            b"\n"
        } else {
            b"\r"
        };
        let end = *self.end.get_or_insert(found);
        // Files with mixed line ends exist: only a lone `\r` must not swallow what follows.
        let end = if end == b"\r" && found == b"\r\n" { end } else { found };
        self.at += length + end.len();
        Some(&rest[..length])
    }
}
