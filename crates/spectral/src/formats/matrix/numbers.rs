//! Arrays of any type of number.

use chladni_mesh::npy::NpyHeader;

use super::MatrixError;

/// An array as it lies in memory.
pub(super) struct Numbers<'a> {
    name: &'static str,
    descriptor: &'a str,
    data: &'a [u8],
    width: usize,
}

impl<'a> Numbers<'a> {
    pub fn new(name: &'static str, header: &'a NpyHeader, data: &'a [u8]) -> Result<Self, MatrixError> {
        let refuse = |reason: String| MatrixError::Member { name, reason };
        let width: usize = match header.descriptor.as_str() {
            "|b1" | "|u1" | "|i1" => 1,
            "<u2" | "<i2" => 2,
            "<f4" | "<i4" | "<u4" => 4,
            "<f8" | "<i8" | "<u8" => 8,
            other => {
                let shown: String = other.chars().take(20).collect();
                return Err(refuse(format!("numbers of type `{shown}` are not supported")));
            }
        };
        let needed = header.shape.iter().try_fold(width, |total, &axis| total.checked_mul(axis));
        if needed != Some(data.len()) {
            return Err(refuse(format!("{} bytes do not fill its shape {:?}", data.len(), header.shape)));
        }
        Ok(Self { name, descriptor: &header.descriptor, data, width })
    }

    /// As floating-point numbers, in the order of memory.
    pub fn floats(&self) -> Result<Vec<f64>, MatrixError> {
        let entries = self.data.chunks_exact(self.width);
        match self.descriptor {
            "<f4" => Ok(entries.map(|e| f64::from(f32::from_le_bytes(std::array::from_fn(|k| e[k])))).collect()),
            "<f8" => Ok(entries.map(|e| f64::from_le_bytes(std::array::from_fn(|k| e[k]))).collect()),
            _ => Ok(self.integers()?.map(|x| x as f64).collect()),
        }
    }

    /// As numbers that count something.
    pub fn counts<T: TryFrom<i128>>(&self) -> Result<Vec<T>, MatrixError> {
        let name = self.name;
        let refuse =
            |x: i128| MatrixError::Member { name, reason: format!("{x} is not the number of a row, column or entry") };
        self.integers()?.map(|x| T::try_from(x).map_err(|_| refuse(x))).collect()
    }

    fn integers(&self) -> Result<impl Iterator<Item = i128>, MatrixError> {
        let signed = match self.descriptor.as_bytes().get(1) {
            Some(b'i') => true,
            Some(b'u' | b'b') => false,
            _ => {
                let reason = format!("it must hold whole numbers, not {}", self.descriptor);
                return Err(MatrixError::Member { name: self.name, reason });
            }
        };
        Ok(self.data.chunks_exact(self.width).map(move |entry| {
            let mut wide = [0u8; 16];
            wide[..entry.len()].copy_from_slice(entry);
            let unsigned = i128::from_le_bytes(wide);
            let unused = 128 - 8 * entry.len() as u32;
            if signed { (unsigned << unused) >> unused } else { unsigned }
        }))
    }
}
