//! `scipy.sparse.save_npz`: CSR, CSC, COO, BSR and DIA, compressed as it does by default or not.

use std::io::{Cursor, Read};

use chladni_algebra::SparseMatrix;
use chladni_mesh::npy::NpyHeader;
use flate2::read::DeflateDecoder;
use zip::{CompressionMethod, ZipArchive};

use super::numbers::Numbers;
use super::{MatrixError, MatrixLimits, from_triplets};

/// Bytes of an entry, at most, and of a header.
const ENTRY: u64 = 8;
const HEADER: u64 = 65_536;

fn refuse(name: &'static str, reason: impl Into<String>) -> MatrixError {
    MatrixError::Member { name, reason: reason.into() }
}

/// One array of the archive, unfolded.
struct Member {
    name: &'static str,
    header: NpyHeader,
    data: Vec<u8>,
}

impl Member {
    fn numbers(&self) -> Result<Numbers<'_>, MatrixError> {
        Numbers::new(self.name, &self.header, &self.data)
    }
}

struct Archive<'a> {
    bytes: &'a [u8],
    directory: ZipArchive<Cursor<&'a [u8]>>,
    limits: MatrixLimits,
}

/// The bytes of all arrays together, as the archive tells them; what unfolds to more is refused when it is read.
pub(super) fn unfolded_bytes(bytes: &[u8]) -> u64 {
    let Ok(mut directory) = ZipArchive::new(Cursor::new(bytes)) else { return 0 };
    let sizes = (0..directory.len()).filter_map(|at| directory.by_index_raw(at).ok().map(|file| file.size()));
    sizes.fold(0, u64::saturating_add)
}

/// Whether an archive has an array of one of these names.
pub(super) fn has_member(bytes: &[u8], names: &[&str]) -> bool {
    let Ok(directory) = ZipArchive::new(Cursor::new(bytes)) else { return false };
    names.iter().any(|name| directory.index_for_name(&format!("{name}.npy")).is_some())
}

pub(super) fn read(bytes: &[u8], limits: &MatrixLimits) -> Result<SparseMatrix, MatrixError> {
    let directory = ZipArchive::new(Cursor::new(bytes)).map_err(|error| MatrixError::Archive(error.to_string()))?;
    let mut archive = Archive { bytes, directory, limits: *limits };
    let format = archive.format()?;
    let (rows, columns) = archive.shape()?;
    match format.as_str() {
        "csr" => archive.compressed(rows, columns),
        // By columns: the rows of the transpose. What is solved is symmetric, and what is not is told by its entries as
        // they stand.
        "csc" => archive.compressed(columns, rows).map(|matrix| matrix.transpose()),
        "coo" => archive.coordinates(rows, columns),
        "dia" => archive.diagonals(rows, columns),
        "bsr" => archive.blocks(rows, columns),
        other => Err(refuse("format", format!("matrices of the format \"{other}\" are not supported"))),
    }
}

impl Archive<'_> {
    fn member(&mut self, name: &'static str) -> Result<Member, MatrixError> {
        self.find(name)?.ok_or_else(|| refuse(name, "it is missing: scipy.sparse.save_npz writes it"))
    }

    fn find(&mut self, name: &'static str) -> Result<Option<Member>, MatrixError> {
        let Some(index) = self.directory.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
        let damaged = |error: zip::result::ZipError| refuse(name, format!("it is damaged: {error}"));
        let file = self.directory.by_index_raw(index).map_err(damaged)?;
        let short = || refuse(name, "it is cut short");
        let start = file.data_start().and_then(|start| usize::try_from(start).ok()).ok_or_else(short)?;
        let length = usize::try_from(file.compressed_size()).map_err(|_| short())?;
        let stored = start.checked_add(length).and_then(|end| self.bytes.get(start..end)).ok_or_else(short)?;
        // Not even a file that claims less unfolds to more than the limits allow.
        let most = (self.limits.entries.max(self.limits.rows + 1) as u64).saturating_mul(ENTRY).saturating_add(HEADER);
        let said = file.size();
        let mut bytes = Vec::new();
        match (file.compression(), file.encrypted()) {
            (CompressionMethod::Stored, false) => bytes.extend_from_slice(stored),
            (CompressionMethod::DEFLATE, false) => {
                let damaged = |error: std::io::Error| refuse(name, format!("it is damaged: {error}"));
                DeflateDecoder::new(stored).take(most.min(said) + 1).read_to_end(&mut bytes).map_err(damaged)?;
                if bytes.len() as u64 > said && said <= most {
                    return Err(refuse(
                        name,
                        format!("it decompresses to more than the {said} bytes that it declares"),
                    ));
                }
            }
            _ => return Err(refuse(name, "it is encrypted, or not compressed by deflate")),
        }
        let mut sum = flate2::Crc::new();
        sum.update(&bytes);
        if bytes.len() as u64 <= most && sum.sum() != file.crc32() {
            return Err(refuse(name, "it is damaged: its checksum does not match"));
        }
        if bytes.len() as u64 > most {
            return Err(MatrixError::TooLarge { what: "bytes of an array", found: bytes.len() as u64, most });
        }
        let (header, data) = NpyHeader::parse(&bytes).map_err(|error| refuse(name, error.to_string()))?;
        let at = bytes.len() - data.len();
        bytes.drain(..at);
        Ok(Some(Member { name, header, data: bytes }))
    }

    /// A text of one to four bytes a letter, as NumPy has it.
    fn format(&mut self) -> Result<String, MatrixError> {
        let member = self.member("format")?;
        let kind = member.header.descriptor.as_bytes().get(1).copied();
        let text: Vec<u8> = match kind {
            Some(b'S') => member.data,
            Some(b'U') => member.data.into_iter().step_by(4).collect(),
            _ => return Err(refuse("format", "it is not text")),
        };
        let text = String::from_utf8_lossy(&text);
        Ok(text.trim_end_matches('\0').chars().take(20).collect())
    }

    fn shape(&mut self) -> Result<(usize, usize), MatrixError> {
        let axes: Vec<usize> = self.member("shape")?.numbers()?.counts()?;
        let [rows, columns] = axes[..] else {
            return Err(refuse("shape", format!("{axes:?} is not that of a matrix")));
        };
        self.limits.check(rows, columns, 0)?;
        Ok((rows, columns))
    }

    fn compressed(&mut self, rows: usize, columns: usize) -> Result<SparseMatrix, MatrixError> {
        let indptr: Vec<usize> = self.member("indptr")?.numbers()?.counts()?;
        let indices: Vec<u32> = self.member("indices")?.numbers()?.counts()?;
        let values = self.member("data")?.numbers()?.floats()?;
        self.limits.check(rows, columns, indices.len())?;
        Ok(SparseMatrix::from_unsorted(rows, columns, &indptr, &indices, &values)?)
    }

    fn coordinates(&mut self, rows: usize, columns: usize) -> Result<SparseMatrix, MatrixError> {
        let values = self.member("data")?.numbers()?.floats()?;
        let (places, indices): (Vec<u32>, Vec<u32>) = match self.find("coords")? {
            // Newer versions stack the coordinates.
            Some(coords) => {
                let all: Vec<u32> = coords.numbers()?.counts()?;
                if coords.header.shape != [2, values.len()] || coords.header.fortran {
                    return Err(refuse("coords", format!("its shape is {:?}", coords.header.shape)));
                }
                (all[..values.len()].to_vec(), all[values.len()..].to_vec())
            }
            None => (self.member("row")?.numbers()?.counts()?, self.member("col")?.numbers()?.counts()?),
        };
        if places.len() != values.len() || indices.len() != values.len() {
            let (a, b, c) = (places.len(), indices.len(), values.len());
            return Err(refuse("row", format!("there are {a} rows, {b} columns and {c} entries")));
        }
        self.limits.check(rows, columns, values.len())?;
        from_triplets(rows, columns, (&places, &indices, &values))
    }

    fn diagonals(&mut self, rows: usize, columns: usize) -> Result<SparseMatrix, MatrixError> {
        let offsets: Vec<i64> = self.member("offsets")?.numbers()?.counts()?;
        let member = self.member("data")?;
        let (values, shape, fortran) = (member.numbers()?.floats()?, &member.header.shape, member.header.fortran);
        let &[count, length] = &shape[..] else { return Err(refuse("data", format!("its shape is {shape:?}"))) };
        if count != offsets.len() {
            return Err(refuse("offsets", format!("there are {} for {count} diagonals", offsets.len())));
        }
        self.limits.check(rows, columns, values.len())?;
        let (mut places, mut indices, mut entries) = (Vec::new(), Vec::new(), Vec::new());
        for (k, offset) in offsets.iter().enumerate() {
            for column in 0..length.min(columns) {
                let value = values[if fortran { column * count + k } else { k * length + column }];
                let row = i64::try_from(column).ok().and_then(|column| column.checked_sub(*offset));
                let row = row.and_then(|row| usize::try_from(row).ok()).filter(|&row| row < rows);
                if let (Some(row), true) = (row, value != 0.0) {
                    places.push(row as u32);
                    indices.push(column as u32);
                    entries.push(value);
                }
            }
        }
        from_triplets(rows, columns, (&places, &indices, &entries))
    }

    fn blocks(&mut self, rows: usize, columns: usize) -> Result<SparseMatrix, MatrixError> {
        let indptr: Vec<usize> = self.member("indptr")?.numbers()?.counts()?;
        let indices: Vec<u32> = self.member("indices")?.numbers()?.counts()?;
        let member = self.member("data")?;
        let (values, shape) = (member.numbers()?.floats()?, &member.header.shape);
        let &[count, high, wide] = &shape[..] else { return Err(refuse("data", format!("its shape is {shape:?}"))) };
        if count != indices.len() || high == 0 || wide == 0 || !rows.is_multiple_of(high) || member.header.fortran {
            return Err(refuse("data", format!("blocks of the shape {shape:?} are not those of {rows} rows")));
        }
        self.limits.check(rows, columns, values.len())?;
        // As a matrix of blocks it is checked as others are.
        let ones = vec![1.0; count];
        SparseMatrix::from_unsorted(rows / high, columns / wide, &indptr, &indices, &ones)?;
        let (mut places, mut across) = (Vec::with_capacity(values.len()), Vec::with_capacity(values.len()));
        for (row, range) in indptr.windows(2).enumerate() {
            for &column in &indices[range[0]..range[1]] {
                for at in 0..high * wide {
                    places.push((row * high + at / wide) as u32);
                    across.push((column as usize * wide + at % wide) as u32);
                }
            }
        }
        from_triplets(rows, columns, (&places, &across, &values))
    }
}
