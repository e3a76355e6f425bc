//! A basis as an NPZ file: what NumPy and SciPy open, and what the store keeps.
//!
//! One archive without compression holds the CSR members `format, shape, data, indices, indptr` of `U`, which
//! `scipy.sparse.load_npz` reads, next to `coefficients` (`d × m`), `eigenvalues`, `residuals`, `bounds`, the mass (`mass`, or
//! `mass_data, mass_indices, mass_indptr` where it is not diagonal) and the JSON texts `certificate` and `metadata`. A dense basis has one
//! member `functions` (`n × m`, columns first) instead of `U` and `coefficients`; it comes last, is written chunk by chunk, and can be
//! read in parts by the [`DenseLayout`] that writing it gives. Equal bases give equal bytes.

use std::cell::{Cell, RefCell};
use std::io::{Cursor, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use zip::{CompressionMethod, ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::{
    Basis, BasisError, CHUNK_COLUMNS, Certificate, ColumnChunk, ColumnSource, Compact, DenseFunctions, Functions,
    Precision,
};
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
    /// Some columns of a dense basis could not be read.
    #[error(transparent)]
    Functions(#[from] BasisError),
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
        self.begin(name, descriptor, fortran, shape, values.len() as u64)?;
        self.archive.write_all(values)?;
        Ok(())
    }

    /// Begins a member of so many bytes, which follow.
    fn begin(
        &mut self,
        name: &str,
        descriptor: &str,
        fortran: bool,
        shape: &[usize],
        bytes: u64,
    ) -> Result<(), FormatError> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(bytes > u64::from(u32::MAX) - 4096);
        self.archive.start_file(format!("{name}.npy"), options)?;
        self.archive.write_all(&header(descriptor, fortran, shape))?;
        Ok(())
    }

    /// What both kinds of basis have.
    fn common(&mut self, basis: &Basis) -> Result<(), FormatError> {
        self.floats("eigenvalues", &basis.eigenvalues)?;
        self.floats("residuals", &basis.certificate.residuals)?;
        self.floats("bounds", &basis.certificate.bounds)?;
        match &basis.mass {
            MassMatrix::Diagonal(diagonal) => self.floats("mass", diagonal)?,
            MassMatrix::Sparse(matrix) => {
                self.floats("mass_data", matrix.values())?;
                self.pattern("mass_", matrix)?;
            }
        }
        self.text("certificate", &certificate_text(&basis.certificate))?;
        self.text("metadata", &basis.metadata.to_string())
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
/// 2³¹ columns or more, [`FormatError::Functions`] where columns of a dense basis cannot be read.
pub fn write<W: Write + Seek>(basis: &Basis, out: W) -> Result<(), FormatError> {
    let (space, dense) = match &basis.functions {
        Functions::Compact(Compact { space, coefficients }) => (space, coefficients),
        Functions::Dense(dense) => return write_dense(basis, dense.clone(), out).map(|_| ()),
    };
    let mut members = Members { archive: ZipWriter::new(out) };
    members.add("format", "|S3", false, &[], b"csr")?;
    members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&[space.rows() as i64, space.columns() as i64]))?;
    members.add("data", "<f4", false, &[space.entries()], bytemuck::cast_slice(space.values()))?;
    members.pattern("", space)?;
    members.add("coefficients", "<f8", true, &[dense.rows(), dense.columns()], bytemuck::cast_slice(dense.values()))?;
    members.common(basis)?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Where the columns of a dense basis lie in its NPZ file, and what its parts hash to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DenseLayout {
    /// The type of the numbers.
    pub precision: Precision,
    /// The first byte of the columns. They follow each other without gaps.
    pub start: u64,
    /// One past the last byte of the columns.
    pub end: u64,
    /// Bytes of the file.
    pub total: u64,
    /// The BLAKE3 hash of what comes before and after the columns, taken together, in hexadecimal.
    pub frame: String,
    /// The BLAKE3 hash of the bytes of each chunk of [`CHUNK_COLUMNS`] columns, in hexadecimal.
    pub chunks: Vec<String>,
}

impl DenseLayout {
    /// The bytes of a chunk in the file of a basis with `rows` vertices; cut at the end of the columns.
    pub fn chunk_bytes(&self, rows: usize, index: usize) -> Range<u64> {
        let chunk = (rows * self.precision.bytes() * CHUNK_COLUMNS) as u64;
        let at = |index: usize| self.start.saturating_add(chunk.saturating_mul(index as u64)).min(self.end);
        at(index)..at(index + 1)
    }
}

/// Writes a dense basis to where nothing can be changed afterwards. `basis` gives everything but the eigenfunctions; `functions` are
/// given up chunk by chunk.
///
/// # Errors
/// As [`write()`].
pub fn write_dense<W: Write>(basis: &Basis, functions: DenseFunctions, out: W) -> Result<DenseLayout, FormatError> {
    let track = Rc::new(Track::default());
    let tracked = Tracked { inner: out, track: Rc::clone(&track) };
    let mut members = Members { archive: ZipWriter::new_stream(tracked) };
    members.common(basis)?;
    let (precision, shape) = (functions.precision(), [functions.rows(), functions.columns()]);
    members.begin("functions", precision.descriptor(), true, &shape, functions.bytes())?;
    let start = track.position.get();
    track.inside.set(true);
    let mut chunks = Vec::with_capacity(functions.chunk_count());
    for chunk in functions.into_chunks() {
        let chunk = chunk?;
        chunks.push(blake3::hash(chunk.bytes()).to_hex().to_string());
        members.archive.write_all(chunk.bytes())?;
    }
    track.inside.set(false);
    let end = track.position.get();
    members.archive.finish()?.into_inner().flush()?;
    let frame = track.frame.borrow().finalize().to_hex().to_string();
    Ok(DenseLayout { precision, start, end, total: track.position.get(), frame, chunks })
}

/// What a writer counts and hashes on the way.
#[derive(Default)]
struct Track {
    position: Cell<u64>,
    /// Whether columns are being written.
    inside: Cell<bool>,
    frame: RefCell<blake3::Hasher>,
}

struct Tracked<W> {
    inner: W,
    track: Rc<Track>,
}

impl<W: Write> Write for Tracked<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.track.position.set(self.track.position.get() + written as u64);
        if !self.track.inside.get() {
            self.track.frame.borrow_mut().update(&bytes[..written]);
        }
        Ok(written)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}

/// A basis as the bytes of an NPZ file.
///
/// # Errors
/// As [`write()`].
pub fn to_bytes(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let mut out = Cursor::new(Vec::with_capacity(basis.stored_bytes() as usize + (1 << 16)));
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

/// A file of which only what comes before and after the columns is at hand; zeros stand for them.
#[derive(Debug, Clone, Copy)]
struct Frame<'a> {
    head: &'a [u8],
    tail: &'a [u8],
    /// Bytes between them.
    gap: u64,
    position: u64,
}

impl<'a> Frame<'a> {
    fn total(&self) -> u64 {
        self.head.len() as u64 + self.gap + self.tail.len() as u64
    }

    /// Bytes that lie before the columns.
    fn slice(&self, range: Range<u64>) -> Option<&'a [u8]> {
        self.head.get(usize::try_from(range.start).ok()?..usize::try_from(range.end).ok()?)
    }
}

impl Read for Frame<'_> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let tail_at = self.head.len() as u64 + self.gap;
        let there: &[u8] = if self.position < self.head.len() as u64 {
            &self.head[self.position as usize..]
        } else if self.position < tail_at {
            // The directory is searched for from the end on, in steps that may reach into the columns.
            let count = usize::try_from(tail_at - self.position).unwrap_or(usize::MAX).min(to.len());
            to[..count].fill(0);
            self.position += count as u64;
            return Ok(count);
        } else {
            usize::try_from(self.position - tail_at).ok().and_then(|at| self.tail.get(at..)).unwrap_or_default()
        };
        let count = there.len().min(to.len());
        to[..count].copy_from_slice(&there[..count]);
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for Frame<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let position = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.total().checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = position.ok_or_else(|| std::io::Error::from(std::io::ErrorKind::InvalidInput))?;
        Ok(self.position)
    }
}

struct Archive<'a> {
    frame: Frame<'a>,
    directory: ZipArchive<Frame<'a>>,
}

impl<'a> Archive<'a> {
    fn open(frame: Frame<'a>) -> Result<Self, FormatError> {
        Ok(Self { frame, directory: ZipArchive::new(frame)? })
    }

    fn has(&self, name: &str) -> bool {
        self.directory.index_for_name(&format!("{name}.npy")).is_some()
    }

    fn member(&mut self, name: &'a str) -> Result<Array<'a>, FormatError> {
        let file = self.directory.by_name(&format!("{name}.npy")).map_err(|error| wrong(name, error.to_string()))?;
        if file.compression() != CompressionMethod::Stored {
            return Err(wrong(name, "it is compressed"));
        }
        let outside = || wrong(name, "it reaches beyond the end of the file");
        let start = file.data_start().ok_or_else(outside)?;
        let end = start.checked_add(file.size()).ok_or_else(outside)?;
        Array::parse(name, self.frame.slice(start..end).ok_or_else(outside)?)
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

    /// `U` and `φ̄`.
    fn compact(&mut self) -> Result<Compact, FormatError> {
        let shape: Vec<i64> = self.member("shape")?.vector("<i8", 2)?;
        let axis = |value: i64| {
            usize::try_from(value)
                .ok()
                .filter(|&axis| axis < u32::MAX as usize)
                .ok_or_else(|| wrong("shape", format!("{value} is no number of rows or columns")))
        };
        let (n, d) = (axis(shape[0])?, axis(shape[1])?);
        let space = self.sparse(["data", "indices", "indptr"], n, d, "<f4")?;
        let m = self.pairs()?;
        let coefficients = self.member("coefficients")?;
        if coefficients.shape != [d, m] || !coefficients.fortran {
            return Err(wrong(
                "coefficients",
                format!("its shape is {:?}, not ({d}, {m}) in column order", coefficients.shape),
            ));
        }
        let coefficients = DenseMatrix::from_columns(d, m, coefficients.values("<f8")?)
            .ok_or_else(|| wrong("coefficients", "its values do not fill its shape"))?;
        Ok(Compact { space, coefficients })
    }

    fn pairs(&mut self) -> Result<usize, FormatError> {
        Ok(self.member("eigenvalues")?.shape.first().copied().unwrap_or(0))
    }

    /// The basis with the given functions on `n` vertices.
    fn basis(mut self, functions: Functions, n: usize) -> Result<Basis, FormatError> {
        let m = self.pairs()?;
        let eigenvalues: Vec<f64> = self.member("eigenvalues")?.vector("<f8", m)?;
        let mass = if self.has("mass") {
            MassMatrix::Diagonal(self.member("mass")?.vector("<f8", n)?)
        } else {
            MassMatrix::Sparse(self.sparse(["mass_data", "mass_indices", "mass_indptr"], n, n, "<f8")?)
        };
        let residuals: Vec<f64> = self.member("residuals")?.vector("<f8", m)?;
        let bounds: Vec<f64> = self.member("bounds")?.vector("<f8", m)?;
        let mut certificate = self.member("certificate")?.json()?;
        if let Some(object) = certificate.as_object_mut() {
            object.insert("residuals".to_owned(), Vec::<f64>::new().into());
            object.insert("bounds".to_owned(), Vec::<f64>::new().into());
        }
        let certificate: Certificate =
            serde_json::from_value(certificate).map_err(|error| wrong("certificate", error.to_string()))?;
        let metadata = self.member("metadata")?.json()?;
        Ok(Basis {
            functions,
            eigenvalues,
            mass,
            certificate: Certificate { residuals, bounds, ..certificate },
            metadata,
        })
    }
}

/// Reads a basis from the bytes of an NPZ file that [`write()`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read(bytes: &[u8]) -> Result<Basis, FormatError> {
    let mut archive = Archive::open(Frame { head: bytes, tail: &[], gap: 0, position: 0 })?;
    if !archive.has("functions") {
        let compact = archive.compact()?;
        let n = compact.space.rows();
        return archive.basis(Functions::Compact(compact), n);
    }
    let functions = archive.member("functions")?;
    let misfit =
        || wrong("functions", format!("its shape is {:?}, its type {}", functions.shape, functions.descriptor));
    let precision = [Precision::F32, Precision::F64].into_iter().find(|p| p.descriptor() == functions.descriptor);
    let (Some(precision), &[n, m], true) = (precision, &functions.shape[..], functions.fortran) else {
        return Err(misfit());
    };
    let whole = n.checked_mul(m).and_then(|numbers| numbers.checked_mul(precision.bytes()));
    if whole != Some(functions.data.len()) || archive.pairs()? != m {
        return Err(misfit());
    }
    let chunk_bytes = (n * precision.bytes()).saturating_mul(CHUNK_COLUMNS).max(1);
    let chunks: Option<Vec<ColumnChunk>> =
        functions.data.chunks(chunk_bytes).map(|bytes| ColumnChunk::from_bytes(bytes, n, precision)).collect();
    let dense = chunks.and_then(|chunks| DenseFunctions::from_chunks(n, m, precision, chunks)).ok_or_else(misfit)?;
    archive.basis(Functions::Dense(dense), n)
}

/// Reads a dense basis of `rows × columns` whose columns stay where they are.
///
/// `head` and `tail` are the bytes before and after the columns.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_frame(
    head: &[u8],
    tail: &[u8],
    layout: &DenseLayout,
    shape: [usize; 2],
    source: Arc<dyn ColumnSource>,
) -> Result<Basis, FormatError> {
    let [rows, columns] = shape;
    let found = {
        let mut hasher = blake3::Hasher::new();
        hasher.update(head).update(tail);
        hasher.finalize().to_hex()
    };
    if found.as_str() != layout.frame {
        return Err(wrong("functions", "what surrounds the columns hashes to another value"));
    }
    let frame = Frame { head, tail, gap: layout.end.saturating_sub(layout.start), position: 0 };
    let mut archive = Archive::open(frame)?;
    let bytes = rows.checked_mul(columns).and_then(|numbers| numbers.checked_mul(layout.precision.bytes()));
    if archive.pairs()? != columns || bytes.map(|bytes| bytes as u64) != Some(frame.gap) {
        return Err(wrong("functions", format!("{} bytes are no {rows}×{columns} numbers", frame.gap)));
    }
    let functions = DenseFunctions::elsewhere(rows, columns, layout.precision, source);
    archive.basis(Functions::Dense(functions), rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::ColumnError;
    use crate::basis::tests::{dense_basis, small_basis};

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        for sparse_mass in [false, true] {
            let basis = small_basis(sparse_mass);
            let bytes = to_bytes(&basis).unwrap();
            assert_eq!(read(&bytes).unwrap(), basis);
            assert_eq!(bytes, to_bytes(&basis).unwrap());
        }
    }

    #[derive(Debug)]
    struct Bytes(Vec<u8>, DenseLayout, usize);

    impl ColumnSource for Bytes {
        fn chunk(&self, index: usize) -> Result<Arc<ColumnChunk>, ColumnError> {
            let range = self.1.chunk_bytes(self.2, index);
            let bytes = &self.0[range.start as usize..range.end as usize];
            if blake3::hash(bytes).to_hex().as_str() != self.1.chunks[index] {
                return Err(ColumnError::Failed("damaged".to_owned()));
            }
            ColumnChunk::from_bytes(bytes, self.2, self.1.precision).map(Arc::new).ok_or(ColumnError::Gone)
        }
    }

    #[test]
    fn a_dense_basis_is_read_whole_and_by_its_layout() {
        for precision in [Precision::F32, Precision::F64] {
            let basis = dense_basis(precision, 70);
            let mut bytes = Vec::new();
            let Functions::Dense(functions) = basis.functions.clone() else { panic!() };
            let layout = write_dense(&basis, functions, &mut bytes).unwrap();
            assert_eq!(bytes, to_bytes(&basis).unwrap());
            assert_eq!((layout.total, layout.chunks.len()), (bytes.len() as u64, 3));
            assert_eq!(layout.end - layout.start, (3 * 72 * precision.bytes()) as u64);
            assert_eq!(layout.chunk_bytes(3, 2).end, layout.end);
            assert_eq!(read(&bytes).unwrap(), basis);
            let (head, tail) = (bytes[..layout.start as usize].to_vec(), bytes[layout.end as usize..].to_vec());
            let source = Arc::new(Bytes(bytes.clone(), layout.clone(), 3));
            let framed = read_frame(&head, &tail, &layout, [3, 72], source).unwrap();
            assert_eq!(framed, basis);
            // A chunk that is damaged harms its own columns alone.
            let mut damaged = bytes.clone();
            damaged[layout.chunk_bytes(3, 1).start as usize] ^= 1;
            let source = Arc::new(Bytes(damaged, layout.clone(), 3));
            let framed = read_frame(&head, &tail, &layout, [3, 72], source).unwrap();
            assert_eq!(framed.lift::<f64>(0..32).unwrap(), basis.lift::<f64>(0..32).unwrap());
            assert_eq!(framed.lift::<f64>(64..72).unwrap(), basis.lift::<f64>(64..72).unwrap());
            assert_eq!(
                framed.lift::<f64>(31..33).unwrap_err().to_string(),
                "chunk 1 of the eigenfunctions cannot be read: damaged"
            );
            let source = Arc::new(Bytes(Vec::new(), layout.clone(), 3));
            assert!(read_frame(&head, &tail, &layout, [3, 71], source.clone()).is_err());
            assert!(read_frame(&head[1..], &tail, &layout, [3, 72], source).is_err());
        }
    }

    #[test]
    fn damaged_bytes_are_refused_without_a_panic() {
        for basis in [small_basis(true), dense_basis(Precision::F32, 3)] {
            let bytes = to_bytes(&basis).unwrap();
            for cut in 0..bytes.len() {
                assert!(read(&bytes[..cut]).is_err());
            }
            for position in 0..bytes.len() {
                let mut damaged = bytes.clone();
                damaged[position] ^= 0x5a;
                let _ = read(&damaged);
            }
        }
    }

    #[test]
    fn data_begin_at_a_multiple_of_64_bytes_of_the_member() {
        for shape in [vec![], vec![1], vec![123_456, 7]] {
            assert_eq!(header("<f8", false, &shape).len() % 64, 0);
        }
    }
}
