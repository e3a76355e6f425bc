//! The header of NPY arrays, versions 1 to 3 of the format: type, order and shape.

/// What the header of an array says of the bytes that follow.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// The type of an entry as NumPy writes it, such as `<f8`.
    pub descriptor: String,
    /// Whether the first index runs fastest.
    pub fortran: bool,
    /// The length of each axis; none for a single entry.
    pub shape: Vec<usize>,
}

/// Why bytes are no NPY array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NpyError {
    /// They do not begin as one.
    #[error("it is not an NPY array")]
    Magic,
    /// They end within the header.
    #[error("the NPY header is cut short")]
    Short,
    /// The header is not UTF-8.
    #[error("the NPY header is not text")]
    Text,
    /// A member of the header is missing.
    #[error("the NPY header lacks '{0}'")]
    Missing(&'static str),
    /// Entries of several parts, or of none.
    #[error("'descr' is not a plain type")]
    Descriptor,
    /// The shape is not a list of lengths.
    #[error("'shape' is not a tuple of numbers")]
    Shape,
}

impl NpyHeader {
    /// Reads the header, and gives what follows it.
    ///
    /// # Errors
    /// [`NpyError`].
    pub fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), NpyError> {
        let (magic, rest) = bytes.split_first_chunk::<8>().ok_or(NpyError::Short)?;
        let (length, rest) = match magic {
            b"\x93NUMPY\x01\x00" => {
                let (length, rest) = rest.split_first_chunk::<2>().ok_or(NpyError::Short)?;
                (u16::from_le_bytes(*length) as usize, rest)
            }
            b"\x93NUMPY\x02\x00" | b"\x93NUMPY\x03\x00" => {
                let (length, rest) = rest.split_first_chunk::<4>().ok_or(NpyError::Short)?;
                (u32::from_le_bytes(*length) as usize, rest)
            }
            _ => return Err(NpyError::Magic),
        };
        let (header, data) = rest.split_at_checked(length).ok_or(NpyError::Short)?;
        let text = std::str::from_utf8(header).map_err(|_| NpyError::Text)?;
        let after = |key: &'static str| {
            let found = text.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
            found.ok_or(NpyError::Missing(key))
        };
        let quoted = after("descr")?.strip_prefix('\'').and_then(|rest| rest.split_once('\''));
        let descriptor = quoted.ok_or(NpyError::Descriptor)?.0.to_owned();
        let fortran = after("fortran_order")?.starts_with("True");
        let tuple = after("shape")?.strip_prefix('(').and_then(|rest| rest.split_once(')'));
        let axes = tuple.ok_or(NpyError::Shape)?.0.split(',').map(str::trim).filter(|axis| !axis.is_empty());
        let shape = axes.map(|axis| axis.parse().map_err(|_| NpyError::Shape)).collect::<Result<_, _>>()?;
        Ok((Self { descriptor, fortran, shape }, data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(header: &str) -> Vec<u8> {
        let length = u16::try_from(header.len()).unwrap().to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), b"data"].concat()
    }

    #[test]
    fn headers_are_read_and_each_fault_is_named() {
        let bytes = array("{'descr': '<f8', 'fortran_order': True, 'shape': (3, 2), }");
        let (header, data) = NpyHeader::parse(&bytes).unwrap();
        assert_eq!(
            (&header.descriptor[..], header.fortran, &header.shape[..], data),
            ("<f8", true, &[3, 2][..], &b"data"[..])
        );
        for (header, expected) in [
            ("{'fortran_order': True, 'shape': ()}", NpyError::Missing("descr")),
            ("{'descr': [('a', '<f8')], 'fortran_order': True, 'shape': ()}", NpyError::Descriptor),
            ("{'descr': '<f8', 'fortran_order': True, 'shape': 3}", NpyError::Shape),
            ("{'descr': '<f8', 'fortran_order': True, 'shape': (x,)}", NpyError::Shape),
        ] {
            assert_eq!(NpyHeader::parse(&array(header)), Err(expected));
        }
        assert_eq!(NpyHeader::parse(b"\x93NUMPY\x09\x00 "), Err(NpyError::Magic));
        for cut in 0..bytes.len() - 4 {
            assert_eq!(NpyHeader::parse(&bytes[..cut]), Err(NpyError::Short), "{cut} bytes");
        }
    }
}
