//! Products as NPZ files: what NumPy and SciPy open, and what the store keeps.
//!
//! Of an eigenbasis one archive without compression holds the CSR members `format, shape, data, indices, indptr` of
//! `U`, which `scipy.sparse.load_npz` reads, next to `coefficients` (`d × m`), `eigenvalues`, `residuals`, `bounds`,
//! the mass (`mass`, or `mass_data, mass_indices, mass_indptr` where it is not diagonal) and the JSON texts
//! `certificate` and `metadata`. A dense basis has one member `functions` (`n × m`, columns first) instead of `U` and
//! `coefficients`; it comes last, is written chunk by chunk, and can be read in parts by the [`DenseLayout`] that
//! writing it gives. Equal bases give equal bytes.
//!
//! Every product on one mesh has the members `vertex_map` and `face_map` as well, where the numbering of the file is
//! known that the mesh came from.

mod collection;
mod designed;
mod family;
mod fields;
mod learning;
mod maps;
mod modal;
mod part;
mod problem;
mod read;

use std::cell::{Cell, RefCell};
use std::io::{Cursor, Seek, Write};
use std::ops::Range;
use std::rc::Rc;

use chladni_algebra::{MassMatrix, SparseMatrix, WeightedMass};
use chladni_mesh::numbering::Numbering;
use serde::{Deserialize, Serialize};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use crate::basis::{
    Basis, BasisError, CHUNK_COLUMNS, Certificate, Compact, DenseFunctions, Functions, Precision, ProvenanceError,
};

pub use collection::{read_maps, write_maps};
pub use designed::{DesignedField, fingerprint, read_designed, write_designed};
pub use family::{read_family, write_family};
pub use fields::{fields_to_bytes, read_fields, write_fields};
pub use learning::{SurfaceOperators, operators_within, write_operators};
pub use maps::maps;
pub use modal::{read_modes, write_modes};
pub use part::{read_part, read_part_head, write_part};
pub use problem::{ProblemParts, read_problem, write_problem};
pub use read::{check_sums, read, read_frame, read_head};

/// Why bytes are not a basis, or a basis could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The destination failed.
    #[error("the basis could not be written: {0}")]
    Write(#[from] std::io::Error),
    /// It is not an archive, or the archive is damaged.
    #[error("{}", unreadable(.0))]
    Archive(#[from] zip::result::ZipError),
    /// A member is missing or is not what it must be.
    #[error("member \"{member}\": {reason}")]
    Member {
        /// The member.
        member: String,
        /// What is wrong with it.
        reason: String,
    },
    /// It is another product, that has its own reader.
    #[error("the file holds {found}; expected {expected}")]
    Other {
        /// What it holds.
        found: &'static str,
        /// What this reader reads.
        expected: &'static str,
    },
    /// Some columns of a dense basis could not be read.
    #[error(transparent)]
    Functions(#[from] BasisError),
    /// It does not say what its rows are.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    /// A matrix is too large for the format.
    #[error("{what} is too large for this format")]
    TooLarge {
        /// The part that is too large.
        what: &'static str,
    },
}

/// What an archive that cannot be read says to someone who never heard of ZIP.
fn unreadable(error: &zip::result::ZipError) -> String {
    match error {
        zip::result::ZipError::InvalidArchive(_) => "not an NPZ file, or cut short".to_owned(),
        error => format!("the archive is damaged: {error}"),
    }
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
        if !basis.certificate.estimates.is_empty() {
            self.floats("estimates", &basis.certificate.estimates)?;
        }
        match &basis.mass {
            MassMatrix::Diagonal(diagonal) => self.floats("mass", diagonal)?,
            MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => {
                self.floats("mass_data", matrix.values())?;
                self.pattern("mass_", matrix)?;
            }
        }
        self.text("certificate", &certificate_value(&basis.certificate)?.to_string())?;
        self.text("metadata", &basis.metadata.json().to_string())
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
/// [`FormatError::Write`] or [`FormatError::Archive`] where the destination fails, [`FormatError::TooLarge`] where the
/// basis has 2³¹ columns or more, [`FormatError::Functions`] where columns of a dense basis cannot be read.
pub fn write<W: Write + Seek>(basis: &Basis, out: W) -> Result<(), FormatError> {
    write_numbered(basis, None, out)
}

/// Writes a basis with the numbering of the file that its mesh came from.
///
/// # Errors
/// As [`write()`], and [`FormatError::TooLarge`] where a map has 2³¹ entries.
pub fn write_numbered<W: Write + Seek>(
    basis: &Basis,
    numbering: Option<&Numbering>,
    out: W,
) -> Result<(), FormatError> {
    match &basis.functions {
        Functions::Compact(compact) => write_compact(basis, compact, numbering, ZipWriter::new(out)),
        Functions::Dense(dense) => write_dense(basis, dense.clone(), numbering, out).map(|_| ()),
    }
}

/// The same to where nothing can be changed afterwards: lengths and checksums come after their members.
///
/// # Errors
/// As [`write_numbered()`].
pub fn write_stream<W: Write>(basis: &Basis, numbering: Option<&Numbering>, out: W) -> Result<(), FormatError> {
    match &basis.functions {
        Functions::Compact(compact) => write_compact(basis, compact, numbering, ZipWriter::new_stream(out)),
        Functions::Dense(dense) => write_dense(basis, dense.clone(), numbering, out).map(|_| ()),
    }
}

fn write_compact<W: Write + Seek>(
    basis: &Basis,
    Compact { space, coefficients: dense, .. }: &Compact,
    numbering: Option<&Numbering>,
    archive: ZipWriter<W>,
) -> Result<(), FormatError> {
    let mut members = Members { archive };
    members.add("format", "|S3", false, &[], b"csr")?;
    members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&[space.rows() as i64, space.columns() as i64]))?;
    members.add("data", "<f4", false, &[space.entries()], bytemuck::cast_slice(space.values()))?;
    members.pattern("", space)?;
    members.add("coefficients", "<f8", true, &[dense.rows(), dense.columns()], bytemuck::cast_slice(dense.values()))?;
    members.common(basis)?;
    members.maps(numbering)?;
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

/// Writes a dense basis to where nothing can be changed afterwards. `basis` gives everything but the eigenfunctions;
/// `functions` are given up chunk by chunk. `numbering` is that of the file that the mesh came from.
///
/// # Errors
/// As [`write()`].
pub fn write_dense<W: Write>(
    basis: &Basis,
    functions: DenseFunctions,
    numbering: Option<&Numbering>,
    out: W,
) -> Result<DenseLayout, FormatError> {
    let track = Rc::new(Track::default());
    let tracked = Tracked { inner: out, track: Rc::clone(&track) };
    let mut members = Members { archive: ZipWriter::new_stream(tracked) };
    members.common(basis)?;
    members.maps(numbering)?;
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

/// Writes everything of a basis but its eigenfunctions, for whoever passes those on by themselves.
///
/// # Errors
/// As [`write()`].
pub fn write_head<W: Write + Seek>(basis: &Basis, out: W) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    members.common(basis)?;
    members.archive.finish()?.flush()?;
    Ok(())
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
pub(super) fn certificate_value(certificate: &Certificate) -> std::io::Result<serde_json::Value> {
    let mut value = serde_json::to_value(certificate)?;
    if let Some(object) = value.as_object_mut() {
        object.remove("residuals");
        object.remove("bounds");
        object.remove("estimates");
    }
    Ok(value)
}

#[cfg(test)]
mod tests;
