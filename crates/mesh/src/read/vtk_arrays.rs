//! The arrays of VTK's XML files: as text, as base64 in their elements, or behind all elements, as base64 or as they
//! are; in blocks of zlib or not. <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>

use std::io::{self, Cursor, ErrorKind, Read};

use base64::Engine;
// Over what is in memory already, it needs no buffer of its own.
use flate2::bufread::ZlibDecoder;
use roxmltree::Node;

use super::MeshFormat;
use super::error::{FileLocation, ReadError, shorten};

/// Compressed arrays of positions, corners and ends unfold to at most so many times the bytes that are there; real ones
/// do to less than eleven times.
const UNFOLDED: usize = 24;

/// What a file says of all of its arrays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coding<'a> {
    pub big_endian: bool,
    /// Whether sizes before data have eight bytes instead of four.
    pub wide_sizes: bool,
    pub compressed: bool,
    pub appended: Option<Appended<'a>>,
}

/// What lies behind all elements.
#[derive(Debug, Clone, Copy)]
pub(super) struct Appended<'a> {
    pub data: &'a [u8],
    pub base64: bool,
}

pub(super) fn refuse(reason: impl Into<String>) -> ReadError {
    ReadError::Arrays { format: MeshFormat::Vtk, reason: reason.into() }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Signed(usize),
    Unsigned(usize),
    Float32,
    Float64,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Self::Signed(1),
            "Int16" => Self::Signed(2),
            "Int32" => Self::Signed(4),
            "Int64" => Self::Signed(8),
            "UInt8" => Self::Unsigned(1),
            "UInt16" => Self::Unsigned(2),
            "UInt32" => Self::Unsigned(4),
            "UInt64" => Self::Unsigned(8),
            "Float32" => Self::Float32,
            "Float64" => Self::Float64,
            _ => return None,
        })
    }

    fn width(self) -> usize {
        match self {
            Self::Signed(width) | Self::Unsigned(width) => width,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }
}

/// A number of an array.
#[derive(Debug, Clone, Copy)]
enum Number {
    /// One beyond 63 bits is the largest there is.
    Whole(i64),
    Real(f64),
}

#[derive(Debug, Clone, Copy)]
enum Data<'a> {
    Text(&'a str),
    Base64(&'a [u8]),
    Raw(&'a [u8]),
}

/// An array of numbers.
pub(super) struct Array<'a> {
    pub location: FileLocation,
    name: &'static str,
    kind: Kind,
    data: Data<'a>,
    coding: Coding<'a>,
}

impl<'a> Array<'a> {
    /// The array of an element `DataArray`; `name` is what messages call its rows.
    pub fn of(node: Node<'a, '_>, coding: Coding<'a>, name: &'static str) -> Result<Self, ReadError> {
        let value_of = |attribute: &str| node.attribute(attribute).unwrap_or_default().trim();
        let unknown = |attribute: &str| {
            refuse(format!("{name}: `{}` is not supported as {attribute}", shorten(value_of(attribute).as_bytes())))
        };
        let kind = Kind::of(value_of("type")).ok_or_else(|| unknown("type"))?;
        let inside = node.text().unwrap_or_default();
        let data = match value_of("format") {
            "ascii" | "" => Data::Text(inside),
            "binary" => Data::Base64(inside.as_bytes()),
            "appended" => {
                let Appended { data, base64 } =
                    coding.appended.ok_or_else(|| refuse(format!("{name}: `AppendedData` is missing")))?;
                let offset: usize = value_of("offset").parse().map_err(|_| unknown("offset"))?;
                let rest = data.get(offset..).ok_or_else(|| {
                    refuse(format!("{name}: offset {offset} lies behind the {} bytes of `AppendedData`", data.len()))
                })?;
                if base64 { Data::Base64(rest) } else { Data::Raw(rest) }
            }
            _ => return Err(unknown("format")),
        };
        Ok(Self { location: FileLocation::Byte(node.range().start), name, kind, data, coding })
    }

    /// The most numbers that can be there.
    pub fn possible(&self) -> u64 {
        let unfolded = if self.coding.compressed { UNFOLDED } else { 1 };
        (match self.data {
            Data::Text(text) => text.len().div_ceil(2),
            Data::Base64(text) => (text.len() / 4 * 3).saturating_mul(unfolded) / self.kind.width(),
            Data::Raw(bytes) => bytes.len().saturating_mul(unfolded) / self.kind.width(),
        }) as u64
    }

    /// Hands so many numbers on, with their places, in rows of `columns`.
    pub fn each_real(
        &self,
        count: usize,
        columns: usize,
        mut take: impl FnMut(usize, f64) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        self.each(count, columns, |index, number| match number {
            Number::Whole(number) => take(index, number as f64),
            Number::Real(number) => take(index, number),
        })
    }

    /// Hands so many whole numbers on.
    ///
    /// # Errors
    /// [`ReadError::Arrays`] where the array has others.
    pub fn each_whole(
        &self,
        count: usize,
        mut take: impl FnMut(i64) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        self.each(count, 1, |_, number| match number {
            Number::Whole(number) => take(number),
            Number::Real(_) => Err(refuse(format!("{}: whole numbers are needed", self.name))),
        })
    }

    fn each(
        &self,
        count: usize,
        columns: usize,
        mut take: impl FnMut(usize, Number) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        let short = |number: usize| ReadError::Truncated {
            element: self.name,
            number: number / columns,
            declared: count / columns,
        };
        if let Data::Text(text) = self.data {
            let mut words = text.split_ascii_whitespace();
            for number in 0..count {
                let word = words.next().ok_or_else(|| short(number))?;
                take(number, self.parse(word)?)?;
            }
            return Ok(());
        }
        if count == 0 {
            return Ok(());
        }
        let failed = |error: io::Error, number: usize| match error.kind() {
            ErrorKind::UnexpectedEof => short(number),
            _ => refuse(format!("{}: the data are damaged: {error}", self.name)),
        };
        let mut stream = self.stream().map_err(|error| failed(error, 0))?;
        let width = self.kind.width();
        let mut block = [0u8; 1 << 12];
        let mut number = 0;
        while number < count {
            let wanted = ((count - number) * width).min(block.len());
            stream.read_exact(&mut block[..wanted]).map_err(|error| failed(error, number))?;
            for bytes in block[..wanted].chunks_exact(width) {
                take(number, self.number(bytes))?;
                number += 1;
            }
        }
        Ok(())
    }

    fn parse(&self, word: &str) -> Result<Number, ReadError> {
        let number = match self.kind {
            Kind::Signed(_) | Kind::Unsigned(_) => word.parse().ok().map(Number::Whole),
            Kind::Float32 | Kind::Float64 => word.parse().ok().map(Number::Real),
        };
        let unread =
            || ReadError::NotANumber { location: self.location, token: shorten(word.as_bytes()), expected: self.name };
        number.ok_or_else(unread)
    }

    fn number(&self, bytes: &[u8]) -> Number {
        let mut own = [0u8; 8];
        own[..bytes.len()].copy_from_slice(bytes);
        if self.coding.big_endian {
            own[..bytes.len()].reverse();
        }
        let whole = u64::from_le_bytes(own);
        match self.kind {
            Kind::Float32 => Number::Real(f64::from(f32::from_bits(whole as u32))),
            Kind::Float64 => Number::Real(f64::from_bits(whole)),
            Kind::Unsigned(_) => Number::Whole(i64::try_from(whole).unwrap_or(i64::MAX)),
            Kind::Signed(width) => {
                let free = 64 - 8 * width as u32;
                Number::Whole((whole << free) as i64 >> free)
            }
        }
    }

    /// The bytes of the numbers, unfolded. Sizes stand before them.
    fn stream(&self) -> io::Result<Box<dyn Read + 'a>> {
        let mut source: Box<dyn Read + 'a> = match self.data {
            Data::Base64(text) => Box::new(Decoded { text, bytes: Cursor::default() }),
            Data::Raw(bytes) => Box::new(bytes),
            Data::Text(_) => Box::new(io::empty()),
        };
        let first = self.size(&mut source)?;
        if !self.coding.compressed {
            return Ok(Box::new(source.take(first)));
        }
        // How long a block is unfolded, and the last one of another length: it is told by zlib as well.
        let (_block, _last) = (self.size(&mut source)?, self.size(&mut source)?);
        let mut sizes = Vec::new();
        for _ in 0..first {
            sizes.push(self.size(&mut source)?);
        }
        Ok(Box::new(Blocks { source, sizes: sizes.into_iter(), open: None }))
    }

    fn size(&self, source: &mut impl Read) -> io::Result<u64> {
        let mut bytes = [0u8; 8];
        let own = if self.coding.wide_sizes { &mut bytes[..] } else { &mut bytes[..4] };
        source.read_exact(own)?;
        if self.coding.big_endian {
            own.reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}

/// Blocks of zlib, one after the other.
struct Blocks<'a> {
    source: Box<dyn Read + 'a>,
    /// Bytes of those that come, folded.
    sizes: std::vec::IntoIter<u64>,
    open: Option<ZlibDecoder<Cursor<Vec<u8>>>>,
}

impl Read for Blocks<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(open) = &mut self.open {
                let read = open.read(out)?;
                if read > 0 || out.is_empty() {
                    return Ok(read);
                }
            }
            self.open = None;
            let Some(size) = self.sizes.next() else { return Ok(0) };
            let mut block = Vec::new();
            (&mut self.source).take(size).read_to_end(&mut block)?;
            if block.len() as u64 != size {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            self.open = Some(ZlibDecoder::new(Cursor::new(block)));
        }
    }
}

/// What base64 stands for, piece after piece; each piece may end with signs for what is missing of three bytes, as
/// sizes do that are written by themselves.
struct Decoded<'a> {
    text: &'a [u8],
    bytes: Cursor<Vec<u8>>,
}

impl Read for Decoded<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.bytes.read(out)?;
        if read > 0 || out.is_empty() {
            return Ok(read);
        }
        let mut letters = Vec::with_capacity(1 << 12);
        let mut read = 0;
        for &letter in self.text {
            let ended = letters.len() % 4 == 0 && letters.last() == Some(&b'=');
            if ended || letters.len() == 1 << 12 {
                break;
            }
            read += 1;
            if !letter.is_ascii_whitespace() {
                letters.push(letter);
            }
        }
        self.text = &self.text[read..];
        let decoded = base64::engine::general_purpose::STANDARD.decode(&letters);
        self.bytes = Cursor::new(decoded.map_err(|_| io::Error::new(ErrorKind::InvalidData, "it is not base64"))?);
        self.bytes.read(out)
    }
}
