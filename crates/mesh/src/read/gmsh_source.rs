//! The numbers of an MSH file, whether they are words or bytes.

use super::MeshFormat;
use super::error::{FileLocation, ReadError};
use super::text::Text;

/// How wide a whole number is where it is bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum IntegerWidth {
    /// Four bytes.
    Int,
    /// A count or a tag: as many bytes as the header says, unsigned.
    Size,
}

/// What a header says of numbers that are bytes.
#[derive(Debug, Clone, Copy)]
struct Bytes {
    big_endian: bool,
    size: usize,
}

pub(super) struct Source<'a> {
    all: &'a [u8],
    pub text: Text<'a>,
    binary: Option<Bytes>,
    /// What the section that is read ends with.
    pub section: &'static str,
}

impl<'a> Source<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { all: bytes, text: Text::new(bytes), binary: None, section: "$EndMeshFormat" }
    }

    /// From here on numbers are bytes of this width; a one stands next, which tells their order.
    ///
    /// # Errors
    /// [`ReadError::Header`] where it is no one, and for widths of counts other than four and eight bytes.
    pub fn begin_binary(&mut self, size: i64) -> Result<(), ReadError> {
        let location = self.text.location();
        let wrong = |reason| ReadError::Header { format: MeshFormat::Gmsh, location, reason };
        let size = match size {
            4 => 4,
            8 => 8,
            _ => return Err(wrong("counts are neither four nor eight bytes wide")),
        };
        self.text.skip_line();
        self.binary = Some(Bytes { big_endian: false, size });
        let big_endian = match self.bytes::<4>()? {
            [1, 0, 0, 0] => false,
            [0, 0, 0, 1] => true,
            _ => return Err(wrong("the number 1, which tells the order of bytes, is missing")),
        };
        self.binary = Some(Bytes { big_endian, size });
        Ok(())
    }

    /// Goes to where the numbers of a section begin, behind its name or its count.
    pub fn begin(&mut self, section: &'static str) {
        self.section = section;
        if self.binary.is_some() {
            self.text.skip_line();
        }
    }

    /// Where the next number stands.
    pub fn location(&self) -> FileLocation {
        match self.binary {
            None => self.text.location(),
            Some(_) => FileLocation::Byte(self.at()),
        }
    }

    /// The most numbers of some bytes that can follow; as words they have two at least.
    pub fn possible(&self, words: u64, bytes: u64) -> u64 {
        let left = self.text.remaining() as u64;
        if self.binary.is_some() { left / bytes } else { left.div_ceil(2 * words) }
    }

    /// The bytes of a whole number.
    pub fn width(&self, whole: IntegerWidth) -> u64 {
        match (whole, self.binary) {
            (IntegerWidth::Size, Some(Bytes { size, .. })) => size as u64,
            _ => 4,
        }
    }

    /// Whether numbers are bytes.
    pub fn is_binary(&self) -> bool {
        self.binary.is_some()
    }

    /// Whether anything follows.
    pub fn any(&mut self) -> bool {
        if self.binary.is_some() { self.text.remaining() > 0 } else { self.text.any() }
    }

    pub fn integer(&mut self, whole: IntegerWidth, expected: &'static str) -> Result<i64, ReadError> {
        let Some(binary) = self.binary else {
            if !self.text.any() {
                return Err(ReadError::MissingValue { location: self.text.location(), expected });
            }
            return self.text.integer(expected);
        };
        if self.width(whole) == 4 {
            let bytes = self.bytes()?;
            let number = if binary.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) };
            return Ok(if whole == IntegerWidth::Size { i64::from(number) } else { i64::from(number.cast_signed()) });
        }
        let bytes = self.bytes()?;
        let number = if binary.big_endian { u64::from_be_bytes(bytes) } else { u64::from_le_bytes(bytes) };
        // Nothing has as many.
        Ok(i64::try_from(number).unwrap_or(i64::MAX))
    }

    pub fn float(&mut self, expected: &'static str) -> Result<f64, ReadError> {
        let Some(binary) = self.binary else {
            if !self.text.any() {
                return Err(ReadError::MissingValue { location: self.text.location(), expected });
            }
            return self.text.float(expected);
        };
        let bytes = self.bytes()?;
        Ok(if binary.big_endian { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) })
    }

    pub fn count(&mut self, whole: IntegerWidth, element: &'static str) -> Result<u64, ReadError> {
        let count = self.integer(whole, "a count")?;
        u64::try_from(count).map_err(|_| ReadError::InvalidCount { location: self.location(), count, element })
    }

    /// Goes past the end of a section that is not read.
    pub fn pass_over(&mut self, section: &[u8]) {
        if self.binary.is_none() {
            while self.text.any() {
                if self.text.token().starts_with(b"$End") {
                    return;
                }
                self.text.skip_line();
            }
            return;
        }
        // Any bytes may stand in it.
        let end = [b"$End", section.strip_prefix(b"$").unwrap_or(section)].concat();
        let rest = &self.all[self.at()..];
        let found = rest.windows(end.len()).position(|window| window == end);
        self.go_to(found.map_or(self.all.len(), |at| self.at() + at + end.len()));
    }

    fn at(&self) -> usize {
        self.all.len() - self.text.remaining()
    }

    fn go_to(&mut self, at: usize) {
        let line = if let FileLocation::Line(line) = self.text.location() { line } else { 1 };
        self.text = Text::resume(self.all, at, line);
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let at = self.at();
        let bytes = self.all.get(at..).and_then(|rest| rest.first_chunk());
        let &bytes =
            bytes.ok_or(ReadError::MissingSection { location: FileLocation::Byte(at), section: self.section })?;
        self.go_to(at + N);
        Ok(bytes)
    }
}
