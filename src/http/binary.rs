//! Per-vertex functions and coefficients as numbers on the wire: raw little-endian, row after row, or JSON.

use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::Translation;
use chladni_work::numbered::pull;
use chladni_work::table::{TableError, any_matrix, matrix};
use serde::Deserialize;
use utoipa::ToSchema;

use super::problem::{self, Problem};

pub use chladni_work::table::Table;

/// The type of raw numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dtype {
    /// Single precision.
    #[default]
    F32,
    /// Double precision.
    F64,
}

impl Dtype {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type in the words of NumPy.
    pub fn descriptor(self) -> &'static str {
        match self {
            Self::F32 => "<f4",
            Self::F64 => "<f8",
        }
    }

    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// Reads `rows × k` raw numbers, row after row; `k` follows from the length.
///
/// # Errors
/// `invalid-function` names a length that does not fit or the first value that is not finite.
pub fn decode(bytes: &[u8], dtype: Dtype, rows: usize) -> Result<DenseMatrix, Problem> {
    decode_by(bytes, dtype, rows, |columns, value| matrix(rows, columns, value))
}

/// Reads raw functions with a value for each vertex as a request numbers them, and brings them to the first `rows` kept
/// ones.
///
/// # Errors
/// `invalid-function`, as [`decode`], and where the values do not fit the numbering.
pub fn decode_functions(bytes: &[u8], dtype: Dtype, rows: usize, to: &Translation) -> Result<DenseMatrix, Problem> {
    if to.is_identity() {
        return decode(bytes, dtype, rows);
    }
    let given = to.rows(rows);
    let functions = decode_by(bytes, dtype, given, |columns, value| any_matrix(given, columns, value))?;
    Ok(pull(to, functions, rows)?)
}

fn decode_by(
    bytes: &[u8],
    dtype: Dtype,
    rows: usize,
    make: impl FnOnce(usize, &dyn Fn(usize) -> f64) -> Result<DenseMatrix, TableError>,
) -> Result<DenseMatrix, Problem> {
    let row = rows * dtype.bytes();
    if row == 0 || bytes.is_empty() || !bytes.len().is_multiple_of(row) {
        return Err(Problem::new(
            &problem::INVALID_FUNCTION,
            format!("{} bytes are not a whole number of functions of {rows} values in {}.", bytes.len(), dtype.name()),
        ));
    }
    let columns = bytes.len() / row;
    match dtype {
        Dtype::F32 => {
            let (numbers, _) = bytes.as_chunks::<4>();
            Ok(make(columns, &|i| f64::from(f32::from_le_bytes(numbers[i])))?)
        }
        Dtype::F64 => {
            let (numbers, _) = bytes.as_chunks::<8>();
            Ok(make(columns, &|i| f64::from_le_bytes(numbers[i]))?)
        }
    }
}

/// Reads little-endian u32 in groups of `K`: vertices, or pairs of them.
///
/// # Errors
/// `invalid-vertex` where bytes are left over.
pub fn decode_tuples<const K: usize>(bytes: &[u8]) -> Result<Vec<[u32; K]>, Problem> {
    let (words, rest) = bytes.as_chunks::<4>();
    if !rest.is_empty() || !words.len().is_multiple_of(K) {
        let detail = format!("{} bytes are not a whole number of groups of {K} vertices in u32.", bytes.len());
        return Err(Problem::new(&problem::INVALID_VERTEX, detail));
    }
    let tuple = |words: &[[u8; 4]]| std::array::from_fn(|k| u32::from_le_bytes(words[k]));
    Ok(words.chunks_exact(K).map(tuple).collect())
}

/// Numbers as little-endian u32.
pub fn encode_u32(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Reads a JSON table with `rows` rows.
///
/// # Errors
/// `invalid-function`, as [`decode`].
pub fn from_table(table: &Table, rows: usize) -> Result<DenseMatrix, Problem> {
    Ok(table.matrix(rows)?)
}

impl From<TableError> for Problem {
    fn from(error: TableError) -> Self {
        Self::new(&problem::INVALID_FUNCTION, super::convert::sentence(&error))
    }
}

/// A matrix as raw numbers, row after row.
pub fn encode(matrix: &DenseMatrix, dtype: Dtype) -> Vec<u8> {
    let (rows, columns) = (matrix.rows(), matrix.columns());
    let mut bytes = vec![0; rows * columns * dtype.bytes()];
    for column in 0..columns {
        let values = matrix.column(column).iter().enumerate();
        match dtype {
            Dtype::F32 => {
                let (slots, _) = bytes.as_chunks_mut::<4>();
                values.for_each(|(row, &value)| slots[row * columns + column] = (value as f32).to_le_bytes());
            }
            Dtype::F64 => {
                let (slots, _) = bytes.as_chunks_mut::<8>();
                values.for_each(|(row, &value)| slots[row * columns + column] = value.to_le_bytes());
            }
        }
    }
    bytes
}

/// A matrix as a JSON table.
pub fn to_table(matrix: &DenseMatrix) -> Table {
    matrix.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_work::table::MOST_COLUMNS;

    #[test]
    fn numbers_go_row_after_row_both_ways() {
        let matrix = DenseMatrix::from_columns(2, 3, vec![1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        for dtype in [Dtype::F32, Dtype::F64] {
            let bytes = encode(&matrix, dtype);
            assert_eq!(bytes.len(), 6 * dtype.bytes());
            assert_eq!(decode(&bytes, dtype, 2).unwrap(), matrix);
        }
        assert_eq!(encode(&matrix, Dtype::F32)[4..8], 2f32.to_le_bytes());
        let table = to_table(&matrix);
        assert_eq!(table.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(from_table(&table, 2).unwrap(), matrix);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        assert!(decode(&[0; 10], Dtype::F32, 2).unwrap_err().detail().starts_with("10 bytes"));
        assert!(decode(&[], Dtype::F32, 2).is_err());
        assert!(decode(&[0; 8], Dtype::F64, 0).is_err());
        let odd: Vec<u8> = [0.0f32, 1.0, 2.0, f32::NAN].iter().flat_map(|x| x.to_le_bytes()).collect();
        assert!(decode(&odd, Dtype::F32, 2).unwrap_err().detail().contains("row 1, column 1"));
        assert!(decode(&vec![0; 4 * (MOST_COLUMNS + 1)], Dtype::F32, 1).is_err());
        assert!(from_table(&Table { columns: 2, values: vec![0.0; 3] }, 2).is_err());
        assert!(from_table(&Table { columns: usize::MAX, values: vec![0.0; 3] }, 2).is_err());
    }
}
