//! A basis as an NPZ file: what NumPy and SciPy open, and what the store keeps.
//!
//! One archive without compression holds the CSR members `format, shape, data, indices, indptr` of `U`, which
//! `scipy.sparse.load_npz` reads, next to `coefficients` (`d × m`), `eigenvalues`, `residuals`, `bounds`, the mass (`mass`, or
//! `mass_data, mass_indices, mass_indptr` where it is not diagonal) and the JSON texts `certificate` and `metadata`. Equal bases
//! give equal bytes.

use std::io::{Cursor, Seek, Write};

use zip::{CompressionMethod, ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::{Basis, Certificate};
use crate::algebra::{DenseMatrix, MassMatrix, SparseMatrix};

/// Why bytes are not a basis, or a basis could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The destination failed.
    #[error("the basis could not be written: {0}")]
    Write(#[from] std::io::Error),
    /// The archive is damaged.
    #[error("the archive is damaged: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// A member is missing or is not what it must be.
    #[error("member \"{member}\": {reason}")]
    Member {
        /// The member.
        member: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A matrix is too large for the format.
    #[error("{what} is too large for this format")]
    TooLarge {
        /// The part that is too large.
        what: &'static str,
    },
}

fn wrong(member: &str, reason: impl Into<String>) -> FormatError {
    FormatError::Member { member: member.to_owned(), reason: reason.into() }
}

/// The header of an NPY member: version 1.0, padded so that the data begin at a multiple of 64 bytes.
fn header(descriptor: &str, fortran: bool, shape: &[usize]) -> Vec<u8> {
    let axes: Vec<String> = shape.iter().map(usize::to_string).collect();
    let tuple = match axes.as_slice() {
        [] => "()".to_owned(),
        [one] => format!("({one},)"),
        many => format!("({})", many.join(", ")),
    };
    let fortran = if fortran { "True" } else { "False" };
    let mut text = format!("{{'descr': '{descriptor}', 'fortran_order': {fortran}, 'shape': {tuple}, }}");
    let padding = 63 - (10 + text.len()) % 64;
    text.extend(std::iter::repeat_n(' ', padding));
    text.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((text.len() as u16).to_le_bytes());
    out.extend(text.as_bytes());
    out
}

/// A dense array as one NPY file: what `numpy.load` reads.
///
/// `values` are little-endian bytes of `descriptor` (`<f4`, `<f8`, …), in the order that `fortran` says.
pub fn npy(descriptor: &str, fortran: bool, shape: &[usize], values: &[u8]) -> Vec<u8> {
    let mut out = header(descriptor, fortran, shape);
    out.extend_from_slice(values);
    out
}

struct Members<W: Write + Seek> {
    archive: ZipWriter<W>,
}

impl<W: Write + Seek> Members<W> {
    fn add(
        &mut self,
        name: &str,
        descriptor: &str,
        fortran: bool,
        shape: &[usize],
        values: &[u8],
    ) -> Result<(), FormatError> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(values.len() as u64 > u64::from(u32::MAX) - 4096);
        self.archive.start_file(format!("{name}.npy"), options)?;
        self.archive.write_all(&header(descriptor, fortran, shape))?;
        self.archive.write_all(values)?;
        Ok(())
    }

    fn floats(&mut self, name: &str, values: &[f64]) -> Result<(), FormatError> {
        self.add(name, "<f8", false, &[values.len()], bytemuck::cast_slice(values))
    }

    fn text(&mut self, name: &str, text: &str) -> Result<(), FormatError> {
        // NumPy has no byte string of length 0.
        let text = if text.is_empty() { " " } else { text };
        self.add(name, &format!("|S{}", text.len()), false, &[], text.as_bytes())
    }

    fn pattern<T>(&mut self, prefix: &str, matrix: &SparseMatrix<T>) -> Result<(), FormatError> {
        if i32::try_from(matrix.columns()).is_err() {
            return Err(FormatError::TooLarge { what: "the number of columns of a sparse factor" });
        }
        let indices = format!("{prefix}indices");
        self.add(&indices, "<i4", false, &[matrix.entries()], bytemuck::cast_slice(matrix.indices()))?;
        let name = format!("{prefix}indptr");
        let shape = [matrix.rows() + 1];
        // SciPy keeps one integer type for both arrays; four bytes wherever they suffice spare it a copy.
        match i32::try_from(matrix.entries()) {
            Ok(_) => {
                let offsets: Vec<i32> = matrix.offsets().iter().map(|&offset| offset as i32).collect();
                self.add(&name, "<i4", false, &shape, bytemuck::cast_slice(&offsets))
            }
            Err(_) => {
                let offsets: Vec<i64> = matrix.offsets().iter().map(|&offset| offset as i64).collect();
                self.add(&name, "<i8", false, &shape, bytemuck::cast_slice(&offsets))
            }
        }
    }
}

/// Writes a basis.
///
/// # Errors
/// [`FormatError::Write`] or [`FormatError::Archive`] where the destination fails, [`FormatError::TooLarge`] where the basis has
/// 2³¹ columns or more.
pub fn write<W: Write + Seek>(basis: &Basis, out: W) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    let space = &basis.space;
    members.add("format", "|S3", false, &[], b"csr")?;
    members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&[space.rows() as i64, space.columns() as i64]))?;
    members.add("data", "<f4", false, &[space.entries()], bytemuck::cast_slice(space.values()))?;
    members.pattern("", space)?;
    let dense = &basis.coefficients;
    members.add("coefficients", "<f8", true, &[dense.rows(), dense.columns()], bytemuck::cast_slice(dense.values()))?;
    members.floats("eigenvalues", &basis.eigenvalues)?;
    members.floats("residuals", &basis.certificate.residuals)?;
    members.floats("bounds", &basis.certificate.bounds)?;
    match &basis.mass {
        MassMatrix::Diagonal(diagonal) => members.floats("mass", diagonal)?,
        MassMatrix::Sparse(matrix) => {
            members.floats("mass_data", matrix.values())?;
            members.pattern("mass_", matrix)?;
        }
    }
    members.text("certificate", &certificate_text(&basis.certificate))?;
    members.text("metadata", &basis.metadata.to_string())?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// A basis as the bytes of an NPZ file.
///
/// # Errors
/// [`FormatError::TooLarge`] where the basis has 2³¹ columns or more.
pub fn to_bytes(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let mut out = Cursor::new(Vec::with_capacity(basis.compact_bytes() as usize + (1 << 16)));
    write(basis, &mut out)?;
    Ok(out.into_inner())
}

/// The certificate without what has members of its own.
pub(super) fn certificate_text(certificate: &Certificate) -> String {
    let mut value = serde_json::to_value(certificate).unwrap_or_default();
    if let Some(object) = value.as_object_mut() {
        object.remove("residuals");
        object.remove("bounds");
    }
    value.to_string()
}

/// One member, as it lies in the file.
struct Array<'a> {
    name: &'a str,
    descriptor: String,
    fortran: bool,
    shape: Vec<usize>,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    fn parse(name: &'a str, bytes: &'a [u8]) -> Result<Self, FormatError> {
        let short = || wrong(name, "the NPY header is cut short");
        let (magic, rest) = bytes.split_first_chunk::<8>().ok_or_else(short)?;
        let (length, rest) = match magic {
            b"\x93NUMPY\x01\x00" => {
                let (length, rest) = rest.split_first_chunk::<2>().ok_or_else(short)?;
                (u16::from_le_bytes(*length) as usize, rest)
            }
            b"\x93NUMPY\x02\x00" | b"\x93NUMPY\x03\x00" => {
                let (length, rest) = rest.split_first_chunk::<4>().ok_or_else(short)?;
                (u32::from_le_bytes(*length) as usize, rest)
            }
            _ => return Err(wrong(name, "it is not an NPY array")),
        };
        let (header, data) = rest.split_at_checked(length).ok_or_else(short)?;
        let text = std::str::from_utf8(header).map_err(|_| wrong(name, "the NPY header is not text"))?;
        let after = |key: &str| {
            text.split_once(&format!("'{key}':"))
                .map(|(_, rest)| rest.trim_start())
                .ok_or_else(|| wrong(name, format!("the NPY header lacks '{key}'")))
        };
        let descriptor = after("descr")?
            .strip_prefix('\'')
            .and_then(|rest| rest.split_once('\''))
            .ok_or_else(|| wrong(name, "'descr' is not a plain type"))?
            .0
            .to_owned();
        let fortran = after("fortran_order")?.starts_with("True");
        let tuple = after("shape")?
            .strip_prefix('(')
            .and_then(|rest| rest.split_once(')'))
            .ok_or_else(|| wrong(name, "'shape' is not a tuple"))?
            .0;
        let shape = tuple
            .split(',')
            .map(str::trim)
            .filter(|axis| !axis.is_empty())
            .map(|axis| axis.parse::<usize>().map_err(|_| wrong(name, "'shape' holds something else than numbers")))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self { name, descriptor, fortran, shape, data })
    }

    /// The values, as many as the shape says.
    fn values<T: bytemuck::AnyBitPattern>(&self, descriptor: &str) -> Result<Vec<T>, FormatError> {
        if self.descriptor != descriptor {
            return Err(wrong(self.name, format!("it holds {}, not {descriptor}", self.descriptor)));
        }
        let bytes = self
            .shape
            .iter()
            .try_fold(size_of::<T>(), |total, &axis| total.checked_mul(axis))
            .filter(|&bytes| bytes == self.data.len())
            .ok_or_else(|| wrong(self.name, format!("{} bytes do not fill its shape", self.data.len())))?;
        Ok(self.data[..bytes].chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }

    fn vector<T: bytemuck::AnyBitPattern>(&self, descriptor: &str, length: usize) -> Result<Vec<T>, FormatError> {
        if self.shape != [length] {
            return Err(wrong(self.name, format!("its shape is {:?}, not ({length},)", self.shape)));
        }
        self.values(descriptor)
    }

    fn json(&self) -> Result<serde_json::Value, FormatError> {
        if !self.descriptor.starts_with("|S") || !self.shape.is_empty() {
            return Err(wrong(self.name, "it is not a text"));
        }
        serde_json::from_slice(self.data).map_err(|error| wrong(self.name, error.to_string()))
    }
}

struct Archive<'a> {
    bytes: &'a [u8],
    directory: ZipArchive<Cursor<&'a [u8]>>,
}

impl<'a> Archive<'a> {
    fn member(&mut self, name: &'a str) -> Result<Array<'a>, FormatError> {
        let file = self.directory.by_name(&format!("{name}.npy")).map_err(|error| wrong(name, error.to_string()))?;
        if file.compression() != CompressionMethod::Stored {
            return Err(wrong(name, "it is compressed"));
        }
        let outside = || wrong(name, "it reaches beyond the end of the file");
        let start = file.data_start().ok_or_else(outside)?;
        let end = start.checked_add(file.size()).ok_or_else(outside)?;
        let range = usize::try_from(start).map_err(|_| outside())?..usize::try_from(end).map_err(|_| outside())?;
        Array::parse(name, self.bytes.get(range).ok_or_else(outside)?)
    }

    fn sparse<T: bytemuck::AnyBitPattern>(
        &mut self,
        names: [&'a str; 3],
        rows: usize,
        columns: usize,
        descriptor: &str,
    ) -> Result<SparseMatrix<T>, FormatError> {
        let [data, indices, indptr] = names;
        let pointers = self.member(indptr)?;
        let offsets: Vec<usize> = if pointers.descriptor == "<i4" {
            let narrow: Vec<i32> = pointers.vector("<i4", rows + 1)?;
            narrow.into_iter().map(|offset| usize::try_from(offset).unwrap_or(usize::MAX)).collect()
        } else {
            let wide: Vec<i64> = pointers.vector("<i8", rows + 1)?;
            wide.into_iter().map(|offset| usize::try_from(offset).unwrap_or(usize::MAX)).collect()
        };
        let columns_of: Vec<u32> = self.member(indices)?.values("<i4")?;
        let values = self.member(data)?.values(descriptor)?;
        SparseMatrix::new(rows, columns, offsets, columns_of, values).map_err(|error| wrong(indptr, error.to_string()))
    }
}

/// Reads a basis from the bytes of an NPZ file that [`write()`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read(bytes: &[u8]) -> Result<Basis, FormatError> {
    let mut archive = Archive { bytes, directory: ZipArchive::new(Cursor::new(bytes))? };
    let shape: Vec<i64> = archive.member("shape")?.vector("<i8", 2)?;
    let axis = |value: i64| {
        usize::try_from(value)
            .ok()
            .filter(|&axis| axis < u32::MAX as usize)
            .ok_or_else(|| wrong("shape", format!("{value} is no number of rows or columns")))
    };
    let (n, d) = (axis(shape[0])?, axis(shape[1])?);
    let space = archive.sparse(["data", "indices", "indptr"], n, d, "<f4")?;
    let eigenvalues = archive.member("eigenvalues")?;
    let m = eigenvalues.shape.first().copied().unwrap_or(0);
    let eigenvalues: Vec<f64> = eigenvalues.vector("<f8", m)?;
    let coefficients = archive.member("coefficients")?;
    if coefficients.shape != [d, m] || !coefficients.fortran {
        return Err(wrong(
            "coefficients",
            format!("its shape is {:?}, not ({d}, {m}) in column order", coefficients.shape),
        ));
    }
    let coefficients = DenseMatrix::from_columns(d, m, coefficients.values("<f8")?)
        .ok_or_else(|| wrong("coefficients", "its values do not fill its shape"))?;
    let mass = if archive.directory.index_for_name("mass.npy").is_some() {
        MassMatrix::Diagonal(archive.member("mass")?.vector("<f8", n)?)
    } else {
        MassMatrix::Sparse(archive.sparse(["mass_data", "mass_indices", "mass_indptr"], n, n, "<f8")?)
    };
    let residuals: Vec<f64> = archive.member("residuals")?.vector("<f8", m)?;
    let bounds: Vec<f64> = archive.member("bounds")?.vector("<f8", m)?;
    let mut certificate = archive.member("certificate")?.json()?;
    if let Some(object) = certificate.as_object_mut() {
        object.insert("residuals".to_owned(), Vec::<f64>::new().into());
        object.insert("bounds".to_owned(), Vec::<f64>::new().into());
    }
    let certificate: Certificate =
        serde_json::from_value(certificate).map_err(|error| wrong("certificate", error.to_string()))?;
    let metadata = archive.member("metadata")?.json()?;
    Ok(Basis {
        space,
        coefficients,
        eigenvalues,
        mass,
        certificate: Certificate { residuals, bounds, ..certificate },
        metadata,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::tests::small_basis;

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        for sparse_mass in [false, true] {
            let basis = small_basis(sparse_mass);
            let bytes = to_bytes(&basis).unwrap();
            assert_eq!(read(&bytes).unwrap(), basis);
            assert_eq!(bytes, to_bytes(&basis).unwrap());
        }
    }

    #[test]
    fn damaged_bytes_are_refused_without_a_panic() {
        let bytes = to_bytes(&small_basis(true)).unwrap();
        for cut in 0..bytes.len() {
            assert!(read(&bytes[..cut]).is_err());
        }
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x5a;
            let _ = read(&damaged);
        }
    }

    #[test]
    fn data_begin_at_a_multiple_of_64_bytes_of_the_member() {
        for shape in [vec![], vec![1], vec![123_456, 7]] {
            assert_eq!(header("<f8", false, &shape).len() % 64, 0);
        }
    }
}
