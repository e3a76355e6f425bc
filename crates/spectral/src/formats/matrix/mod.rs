//! Sparse matrices as others write them: SciPy's `save_npz`, NumPy's `save` for a diagonal, and Matrix Market.

mod archive;
mod market;
mod numbers;

use chladni_algebra::{SparseError, SparseMatrix};
use chladni_mesh::npy::NpyHeader;

use numbers::Numbers;

/// What a file may hold at most. Files that unfold to more are refused before they do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MatrixLimits {
    /// Rows, and columns.
    pub rows: usize,
    /// Entries, both triangles counted.
    pub entries: usize,
}

impl Default for MatrixLimits {
    fn default() -> Self {
        Self { rows: 50_000_000, entries: 1_000_000_000 }
    }
}

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum MatrixFile {
    /// A sparse matrix.
    Sparse(SparseMatrix),
    /// A list of numbers, which may stand for a diagonal.
    Vector(Vec<f64>),
}

/// Why bytes are no matrix.
#[derive(Debug, thiserror::Error)]
pub enum MatrixError {
    /// They begin like no format that is read.
    #[error(
        "this is not a matrix: neither an NPZ written by scipy.sparse.save_npz, nor an NPY array, nor Matrix Market"
    )]
    Unknown,
    /// The archive is damaged.
    #[error("the archive is damaged: {0}")]
    Archive(String),
    /// A member of the archive is missing, damaged, or of another form than the others.
    #[error("'{name}': {reason}")]
    Member {
        /// The member.
        name: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// A line of a text does not fit.
    #[error("line {line}: {reason}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// There is more than may be read.
    #[error("{found} {what} exceed the limit of {most}")]
    TooLarge {
        /// Of what there is too much.
        what: &'static str,
        /// How much there is.
        found: u64,
        /// How much is read.
        most: u64,
    },
    /// Rows that do not fit, or entries outside the matrix.
    #[error(transparent)]
    Entries(#[from] SparseError),
}

impl MatrixFile {
    /// Reads a matrix, by what its bytes begin with.
    ///
    /// # Errors
    /// [`MatrixError`] names the member or the line that does not fit.
    pub fn read(bytes: &[u8], limits: &MatrixLimits) -> Result<Self, MatrixError> {
        if bytes.starts_with(b"PK") {
            return archive::read(bytes, limits).map(Self::Sparse);
        }
        if bytes.starts_with(b"%%MatrixMarket") {
            return market::read(bytes, limits);
        }
        if !bytes.starts_with(b"\x93NUMPY") {
            return Err(MatrixError::Unknown);
        }
        let name = "array";
        let refuse = |reason: String| MatrixError::Member { name, reason };
        let (header, data) = NpyHeader::parse(bytes).map_err(|error| refuse(error.to_string()))?;
        let numbers = Numbers::new(name, &header, data)?;
        match header.shape[..] {
            [_] | [_, 1] | [1, _] => Ok(Self::Vector(numbers.floats()?)),
            _ => Err(refuse(format!("its shape is {:?}; a diagonal is a list of numbers", header.shape))),
        }
    }

    /// About the bytes of memory that a matrix takes once it is read, from what its file says of itself; not less than
    /// its bytes.
    pub fn memory_bytes(bytes: &[u8]) -> u64 {
        if bytes.starts_with(b"PK") {
            return archive::unfolded_bytes(bytes).max(bytes.len() as u64);
        }
        if bytes.starts_with(b"%%MatrixMarket") {
            // An entry for each line, or two where the matrix is symmetric, of a place and a number.
            let lines = bytes.iter().filter(|&&byte| byte == b'\n').count() as u64 + 1;
            return (24 * lines).max(bytes.len() as u64);
        }
        bytes.len() as u64
    }

    /// Whether bytes are an archive with an array of one of these names.
    pub fn has_member(bytes: &[u8], names: &[&str]) -> bool {
        bytes.starts_with(b"PK") && archive::has_member(bytes, names)
    }

    /// The matrix, where it is one; a list of numbers is the diagonal of one.
    pub fn into_matrix(self) -> SparseMatrix {
        match self {
            Self::Sparse(matrix) => matrix,
            Self::Vector(diagonal) => {
                let n = diagonal.len();
                SparseMatrix::from_sorted_parts(n, n, (0..=n).collect(), (0..n as u32).collect(), diagonal)
            }
        }
    }
}

impl MatrixLimits {
    fn check(&self, rows: usize, columns: usize, entries: usize) -> Result<(), MatrixError> {
        let rows = rows.max(columns);
        let most_rows = self.rows.min(u32::MAX as usize - 1);
        for (what, found, most) in [("rows", rows, most_rows), ("entries", entries, self.entries)] {
            if found > most {
                return Err(MatrixError::TooLarge { what, found: found as u64, most: most as u64 });
            }
        }
        Ok(())
    }
}

/// A matrix of entries in any order; those of one place are added up.
fn from_triplets(rows: usize, columns: usize, triplets: (&[u32], &[u32], &[f64])) -> Result<SparseMatrix, MatrixError> {
    let (places, indices, values) = triplets;
    let mut indptr = vec![0usize; rows + 1];
    for (&row, &column) in places.iter().zip(indices) {
        let next = indptr[1..].get_mut(row as usize);
        *next.ok_or(SparseError::Column { row: row as usize, column })? += 1;
    }
    for row in 0..rows {
        indptr[row + 1] += indptr[row];
    }
    let mut next = indptr.clone();
    let (mut sorted, mut numbers) = (vec![0u32; indices.len()], vec![0.0; indices.len()]);
    for ((&row, &column), &value) in places.iter().zip(indices).zip(values) {
        let at = next[row as usize];
        next[row as usize] += 1;
        (sorted[at], numbers[at]) = (column, value);
    }
    Ok(SparseMatrix::from_unsorted(rows, columns, &indptr, &sorted, &numbers)?)
}
