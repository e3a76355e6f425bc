//! Words and numbers of a text file, without an allocation per line.

use super::error::{FileLocation, ReadError, shorten};

/// A position in a text. Lines end with `\n`, `\r\n` or `\r`; `#` at the start of a word begins a comment; a backslash
/// at the end of a line joins it with the next one.
pub(super) struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\n' | b'\r' | 0x0b | 0x0c)
}

impl<'a> Text<'a> {
    /// Begins at the first byte, after a byte-order mark if there is one.
    pub fn new(bytes: &'a [u8]) -> Self {
        let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, at, line: 1 }
    }

    /// Begins at a byte that stands on the given line.
    pub fn resume(bytes: &'a [u8], at: usize, line: usize) -> Self {
        Self { bytes, at, line }
    }

    pub fn location(&self) -> FileLocation {
        FileLocation::Line(self.line)
    }

    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Goes to the next word of this line; false where there is none.
    pub fn on_line(&mut self) -> bool {
        loop {
            match self.bytes.get(self.at) {
                Some(b' ' | b'\t' | 0x0b | 0x0c) => self.at += 1,
                Some(b'\\') if matches!(self.bytes.get(self.at + 1), Some(b'\n' | b'\r')) => {
                    self.at += 1;
                    self.line_break();
                }
                Some(b'\n' | b'\r' | b'#') | None => return false,
                Some(_) => return true,
            }
        }
    }

    /// Goes to the next word of the file; false where there is none.
    pub fn any(&mut self) -> bool {
        while !self.on_line() {
            if self.at == self.bytes.len() {
                return false;
            }
            self.skip_line();
        }
        true
    }

    /// Goes to the start of the next line.
    pub fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        match rest.iter().position(|&byte| byte == b'\n' || byte == b'\r') {
            Some(length) => {
                self.at += length;
                self.line_break();
            }
            None => self.at = self.bytes.len(),
        }
    }

    fn line_break(&mut self) {
        self.at += if self.bytes[self.at..].starts_with(b"\r\n") { 2 } else { 1 };
        self.line += 1;
    }

    /// The word that begins here (after [`on_line`](Self::on_line) or [`any`](Self::any) said true).
    pub fn token(&mut self) -> &'a [u8] {
        let token = self.peek();
        self.at += token.len();
        token
    }

    /// The same without going past it.
    pub fn peek(&self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        &rest[..rest.iter().position(|&byte| is_space(byte)).unwrap_or(rest.len())]
    }

    /// Whether the word that begins here starts like a number, a non-finite one included.
    pub fn at_number(&self) -> bool {
        let token = self.peek();
        let digits = token.strip_prefix(b"-").or_else(|| token.strip_prefix(b"+")).unwrap_or(token);
        match digits.first() {
            Some(b'0'..=b'9' | b'.') => true,
            Some(_) => parse_f64(token).is_some(),
            None => false,
        }
    }

    /// The number that begins here; it may be non-finite.
    pub fn float(&mut self, expected: &'static str) -> Result<f64, ReadError> {
        if let Some((value, end)) = exact_decimal(self.bytes, self.at) {
            self.at = end;
            return Ok(value);
        }
        let token = self.peek();
        let value = parse_f64(token).ok_or_else(|| ReadError::NotANumber {
            location: self.location(),
            token: shorten(token),
            expected,
        })?;
        self.at += token.len();
        Ok(value)
    }

    /// The integer that begins here; `3.0` counts as one.
    pub fn integer(&mut self, expected: &'static str) -> Result<i64, ReadError> {
        let token = self.token();
        self.integer_of(token, expected)
    }

    /// The integer before the first slash of the word that begins here, and what follows it: in a corner `7/1/3` of an
    /// OBJ face the position 7, and `1/3`.
    pub fn integer_before_slash(&mut self, expected: &'static str) -> Result<(i64, &'a [u8]), ReadError> {
        let token = self.token();
        let end = token.iter().position(|&byte| byte == b'/').unwrap_or(token.len());
        Ok((self.integer_of(&token[..end], expected)?, token.get(end + 1..).unwrap_or_default()))
    }

    fn integer_of(&self, token: &[u8], expected: &'static str) -> Result<i64, ReadError> {
        let (negative, digits) = match token {
            [b'-', rest @ ..] => (true, rest),
            [b'+', rest @ ..] => (false, rest),
            _ => (false, token),
        };
        if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
            return match parse_f64(token) {
                Some(value) if value.fract() == 0.0 && value.abs() < 9e15 => Ok(value as i64),
                _ => Err(ReadError::NotANumber { location: self.location(), token: shorten(token), expected }),
            };
        }
        let mut value = 0i64;
        for &digit in digits {
            value = value.checked_mul(10).and_then(|v| v.checked_add(i64::from(digit - b'0'))).ok_or_else(|| {
                ReadError::NumberTooLarge { location: self.location(), token: shorten(token), expected }
            })?;
        }
        Ok(if negative { -value } else { value })
    }

    /// A count that begins on this line, at least zero.
    pub fn count(&mut self, element: &'static str) -> Result<u64, ReadError> {
        if !self.on_line() {
            return Err(ReadError::MissingValue { location: self.location(), expected: "a count" });
        }
        let count = self.integer("a count")?;
        u64::try_from(count).map_err(|_| ReadError::InvalidCount { location: self.location(), count, element })
    }
}

const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The decimal that begins at `at` and where it ends, if both its digits and its power of ten are exact in double
/// precision, so that one division or multiplication rounds correctly (Clinger 1990). Most coordinates in files are.
fn exact_decimal(bytes: &[u8], at: usize) -> Option<(f64, usize)> {
    let mut i = at;
    let negative = match bytes.get(i)? {
        b'-' => {
            i += 1;
            true
        }
        b'+' => {
            i += 1;
            false
        }
        _ => false,
    };
    let mut mantissa = 0u64;
    let mut digits = 0usize;
    while let Some(digit @ b'0'..=b'9') = bytes.get(i) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
        digits += 1;
        i += 1;
    }
    let mut scale = 0i32;
    if bytes.get(i) == Some(&b'.') {
        i += 1;
        let start = i;
        while let Some(digit @ b'0'..=b'9') = bytes.get(i) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
            i += 1;
        }
        digits += i - start;
        scale = -i32::try_from(i - start).ok()?;
    }
    // Nineteen digits cannot have wrapped.
    if digits == 0 || digits > 19 || mantissa > 1 << 53 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(i) {
        i += 1;
        let sign = match bytes.get(i)? {
            b'-' => {
                i += 1;
                -1
            }
            b'+' => {
                i += 1;
                1
            }
            _ => 1,
        };
        let start = i;
        let mut exponent = 0i32;
        while let Some(digit @ b'0'..=b'9') = bytes.get(i) {
            if i - start == 4 {
                return None;
            }
            exponent = exponent * 10 + i32::from(digit - b'0');
            i += 1;
        }
        if i == start {
            return None;
        }
        scale += sign * exponent;
    }
    if bytes.get(i).is_some_and(|&byte| !is_space(byte)) {
        return None;
    }
    let power = *POWERS_OF_TEN.get(scale.unsigned_abs() as usize)?;
    let value = if scale < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
    Some((if negative { -value } else { value }, i))
}

/// Any way in which programs write a double: also `1.0D-3` (Fortran), `nan(ind)` (glibc), `-1.#IND` (old Microsoft).
fn parse_f64(token: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(token).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let (negative, magnitude) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let value = if magnitude.len() >= 4 && magnitude.as_bytes()[..4].eq_ignore_ascii_case(b"nan(") {
        f64::NAN
    } else if let Some(word) = magnitude.strip_prefix("1.#") {
        if word.starts_with("INF") {
            f64::INFINITY
        } else if ["IND", "QNAN", "SNAN"].iter().any(|name| word.starts_with(name)) {
            f64::NAN
        } else {
            return None;
        }
    } else {
        let (mantissa, exponent) = magnitude.split_once(['d', 'D'])?;
        // A Fortran double is short; this bounds the copy.
        if magnitude.len() > 64 || mantissa.is_empty() || !mantissa.bytes().all(|b| b.is_ascii_digit() || b == b'.') {
            return None;
        }
        format!("{mantissa}e{exponent}").parse().ok()?
    };
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn float(token: &str) -> Result<f64, ReadError> {
        Text::new(token.as_bytes()).float("a coordinate")
    }

    #[test]
    fn numbers_are_read_as_programs_write_them() {
        for (token, value) in [
            ("0", 0.0),
            ("-0.5", -0.5),
            ("+.25", 0.25),
            ("7.", 7.0),
            ("1e-7", 1e-7),
            ("6.14986e-005", 6.14986e-5),
            ("0.1", 0.1),
            ("123456789012345678901234567890", 123456789012345678901234567890.0),
            ("0.30000000000000004", 0.1 + 0.2),
            ("1e400", f64::INFINITY),
            ("1e-400", 0.0),
            ("-INF", f64::NEG_INFINITY),
            ("1.#INF00", f64::INFINITY),
            ("1.5D+02", 150.0),
            ("2d-3", 2e-3),
        ] {
            assert_eq!(float(token), Ok(value), "{token}");
        }
        for token in ["nan", "-NaN", "nan(ind)", "-1.#IND00", "1.#QNAN"] {
            assert!(float(token).unwrap().is_nan(), "{token}");
        }
        assert!(float("-0").unwrap().is_sign_negative());
        for token in ["", "-", ".", "1,5", "1.2.3", "0x10", "1e", "e5", "d5", "1d", "--1", "1.#X", "é", "1_000"] {
            assert!(matches!(float(token), Err(ReadError::NotANumber { .. })), "{token}");
        }
    }

    #[test]
    fn integers_know_their_range() {
        let integer = |token: &str| Text::new(token.as_bytes()).integer("an index");
        assert_eq!(integer("-12"), Ok(-12));
        assert_eq!(integer("3.0"), Ok(3));
        assert_eq!(integer("9223372036854775807"), Ok(i64::MAX));
        assert!(matches!(integer("9223372036854775808"), Err(ReadError::NumberTooLarge { .. })));
        assert!(matches!(integer("3.5"), Err(ReadError::NotANumber { .. })));
        assert!(matches!(integer("inf"), Err(ReadError::NotANumber { .. })));
        assert_eq!(Text::new(b"7/1/3").integer_before_slash("an index"), Ok((7, &b"1/3"[..])));
        assert_eq!(Text::new(b"7 1").integer_before_slash("an index"), Ok((7, &b""[..])));
        assert!(Text::new(b"/1").integer_before_slash("an index").is_err());
    }

    #[test]
    fn lines_are_counted_for_every_line_end_and_continuation() {
        for file in ["a\nb\n\n#c\nd", "a\r\nb\r\n\r\n#c\r\nd", "a\rb\r\r#c\rd"] {
            let mut text = Text::new(file.as_bytes());
            let mut seen = Vec::new();
            while text.any() {
                seen.push((text.token().to_vec(), text.location()));
            }
            assert_eq!(
                seen,
                [
                    (b"a".to_vec(), FileLocation::Line(1)),
                    (b"b".to_vec(), FileLocation::Line(2)),
                    (b"d".to_vec(), FileLocation::Line(5))
                ]
            );
        }
        let mut text = Text::new(b"f 1 \\\n2\n3");
        let mut words = 0;
        while text.on_line() {
            text.token();
            words += 1;
        }
        assert_eq!((words, text.location()), (3, FileLocation::Line(2)));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

        #[test]
        fn every_double_comes_back_as_it_was_written(bits: u64) {
            let value = f64::from_bits(bits);
            for token in [format!("{value}"), format!("{value:e}"), format!("{value:?}")] {
                let read = float(&token).unwrap();
                prop_assert!(read.to_bits() == value.to_bits() || (read.is_nan() && value.is_nan()));
            }
        }

        #[test]
        fn short_decimals_agree_with_the_standard_library(mantissa in 0u64..1_000_000_000_000, point in 0usize..12, exponent in -30i32..30) {
            let digits = format!("{mantissa:012}");
            let token = format!("{}.{}e{exponent}", &digits[..point], &digits[point..]);
            prop_assert_eq!(float(&token).unwrap(), token.parse::<f64>().unwrap());
        }
    }
}
