//! Reading NPZ files: whole from memory, or a dense basis without its columns.

use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::Arc;

use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_mesh::npy::NpyHeader;
use zip::{CompressionMethod, ZipArchive, result::ZipError};

use super::{DenseLayout, FormatError, wrong};
use crate::basis::{
    Basis, CHUNK_COLUMNS, Certificate, ColumnChunk, ColumnSource, Compact, DenseFunctions, Functions, Precision,
};

// What archives hold, as messages call it.
pub(super) const EIGENBASIS: &str = "an eigenbasis";
pub(super) const MODES: &str = "vibration modes";
pub(super) const FAMILY: &str = "a family of operators";
pub(super) const FIELDS: &str = "a field basis";
pub(super) const MAPS: &str = "the maps of a collection";
pub(super) const DESIGNED: &str = "a designed field";
pub(super) const PART: &str = "a part written by solve --part";

/// One member, as it lies in the file.
pub(super) struct Array<'a> {
    name: &'a str,
    descriptor: String,
    pub fortran: bool,
    pub shape: Vec<usize>,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    fn parse(name: &'a str, bytes: &'a [u8]) -> Result<Self, FormatError> {
        let (NpyHeader { descriptor, fortran, shape }, data) =
            NpyHeader::parse(bytes).map_err(|error| wrong(name, error.to_string()))?;
        Ok(Self { name, descriptor, fortran, shape, data })
    }

    /// The values, as many as the shape says.
    pub fn values<T: bytemuck::AnyBitPattern>(&self, descriptor: &str) -> Result<Vec<T>, FormatError> {
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

    pub fn vector<T: bytemuck::AnyBitPattern>(&self, descriptor: &str, length: usize) -> Result<Vec<T>, FormatError> {
        if self.shape != [length] {
            return Err(wrong(self.name, format!("its shape is {:?}, not ({length},)", self.shape)));
        }
        self.values(descriptor)
    }

    pub fn json(&self) -> Result<serde_json::Value, FormatError> {
        if !self.descriptor.starts_with("|S") || !self.shape.is_empty() {
            return Err(wrong(self.name, "it is not text"));
        }
        serde_json::from_slice(self.data).map_err(|error| wrong(self.name, error.to_string()))
    }
}

/// A file of which only what comes before and after the columns is at hand; zeros stand for them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame<'a> {
    head: &'a [u8],
    tail: &'a [u8],
    /// Bytes between them.
    gap: u64,
    position: u64,
}

impl<'a> Frame<'a> {
    /// A file that is at hand from beginning to end.
    pub fn whole(bytes: &'a [u8]) -> Self {
        Self { head: bytes, tail: &[], gap: 0, position: 0 }
    }

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

/// Refuses an archive that holds another product, which shows by a member that the other alone has.
pub(super) fn expect<R: Read + Seek>(directory: &ZipArchive<R>, expected: &'static str) -> Result<(), FormatError> {
    let alone = [
        ("masses", MODES),
        ("extrinsic", FAMILY),
        ("samples", FIELDS),
        ("disagreements", MAPS),
        ("stored", DESIGNED),
        ("part", PART),
        ("certificate", EIGENBASIS),
    ];
    let has = |member: &str| directory.index_for_name(&format!("{member}.npy")).is_some();
    match alone.into_iter().find(|(member, _)| has(member)) {
        Some((_, found)) if found != expected => Err(FormatError::Other { found, expected }),
        _ => Ok(()),
    }
}

pub(super) struct Archive<'a> {
    frame: Frame<'a>,
    directory: ZipArchive<Frame<'a>>,
}

impl<'a> Archive<'a> {
    pub fn open(frame: Frame<'a>) -> Result<Self, FormatError> {
        Ok(Self { frame, directory: ZipArchive::new(frame)? })
    }

    pub fn has(&self, name: &str) -> bool {
        self.directory.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// Opens an archive that has to hold one product and is refused by name where it holds another.
    pub fn of(bytes: &'a [u8], expected: &'static str) -> Result<Self, FormatError> {
        let archive = Self::open(Frame::whole(bytes))?;
        expect(&archive.directory, expected)?;
        Ok(archive)
    }

    pub fn member(&mut self, name: &'a str) -> Result<Array<'a>, FormatError> {
        let file = self.directory.by_name(&format!("{name}.npy")).map_err(|error| match error {
            ZipError::FileNotFound => wrong(name, "it is missing"),
            error => wrong(name, error.to_string()),
        })?;
        if file.compression() != CompressionMethod::Stored {
            return Err(wrong(name, "it is compressed"));
        }
        let outside = || wrong(name, "it reaches beyond the end of the file");
        let start = file.data_start().ok_or_else(outside)?;
        let end = start.checked_add(file.size()).ok_or_else(outside)?;
        Array::parse(name, self.frame.slice(start..end).ok_or_else(outside)?)
    }

    pub fn sparse<T: bytemuck::AnyBitPattern>(
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
                .ok_or_else(|| wrong("shape", format!("{value} is not a number of rows or columns")))
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
        let coefficients = DenseMatrix::from_columns(d, m, coefficients.values("<f8")?);
        Ok(Compact::new(space, coefficients))
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
        let estimates = if self.has("estimates") { self.member("estimates")?.vector("<f8", m)? } else { Vec::new() };
        let mut certificate = self.member("certificate")?.json()?;
        if let Some(object) = certificate.as_object_mut() {
            object.insert("residuals".to_owned(), Vec::<f64>::new().into());
            object.insert("bounds".to_owned(), Vec::<f64>::new().into());
        }
        let certificate: Certificate =
            serde_json::from_value(certificate).map_err(|error| wrong("certificate", error.to_string()))?;
        let metadata = self.member("metadata")?.json()?.into();
        Ok(Basis {
            functions,
            eigenvalues,
            mass,
            certificate: Certificate { residuals, bounds, estimates, ..certificate },
            metadata,
        })
    }
}

/// Compares every member of an archive with its checksum, which [`read`] does not: it takes the arrays as they lie in
/// memory.
///
/// # Errors
/// [`FormatError::Archive`] where the archive is damaged, [`FormatError::Member`] names a member that differs from its
/// checksum.
pub fn check_sums(bytes: &[u8]) -> Result<(), FormatError> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes))?;
    for index in 0..archive.len() {
        let mut member = archive.by_index(index)?;
        let name = member.name()?.trim_end_matches(".npy").to_owned();
        std::io::copy(&mut member, &mut std::io::sink()).map_err(|error| wrong(&name, error.to_string()))?;
    }
    Ok(())
}

/// Reads a basis from the bytes of an NPZ file that [`write()`](super::write()) made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read(bytes: &[u8]) -> Result<Basis, FormatError> {
    let mut archive = Archive::of(bytes, EIGENBASIS)?;
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
        return Err(wrong("functions", format!("{} bytes do not make {rows}×{columns} numbers", frame.gap)));
    }
    let functions = DenseFunctions::elsewhere(rows, columns, layout.precision, source);
    archive.basis(Functions::Dense(functions), rows)
}

/// Reads what [`write_head()`](super::write_head) wrote, and gives it its eigenfunctions.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the eigenfunctions.
pub fn read_head(bytes: &[u8], functions: DenseFunctions) -> Result<Basis, FormatError> {
    let mut archive = Archive::open(Frame::whole(bytes))?;
    if archive.pairs()? != functions.columns() {
        return Err(wrong("eigenvalues", format!("there are {} eigenfunctions", functions.columns())));
    }
    let rows = functions.rows();
    archive.basis(Functions::Dense(functions), rows)
}
