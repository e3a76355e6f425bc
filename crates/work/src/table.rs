//! Tables of numbers as requests and answers carry them.

use chladni_algebra::DenseMatrix;
use serde::{Deserialize, Serialize};

/// The most functions of one request.
pub const MOST_COLUMNS: usize = 256;

/// A table of numbers.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Functions side by side.
    #[serde(default = "one")]
    pub columns: usize,
    /// Values, row after row; null, or not a number, at vertices and faces of a file that have none.
    #[serde(deserialize_with = "numbers")]
    pub values: Vec<f64>,
}

/// Numbers, in which null stands for none, straight into one array.
pub(crate) fn numbers<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    struct Number(f64);

    impl<'de> Deserialize<'de> for Number {
        fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            Ok(Self(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN)))
        }
    }

    struct Numbers;

    impl<'de> serde::de::Visitor<'de> for Numbers {
        type Value = Vec<f64>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an array of numbers")
        }

        fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
            // A hint beyond this is believed only as numbers come.
            let mut values = Vec::with_capacity(list.size_hint().unwrap_or(0).min(1 << 16));
            while let Some(Number(value)) = list.next_element()? {
                values.push(value);
            }
            Ok(values)
        }
    }

    deserializer.deserialize_seq(Numbers)
}

/// The same where they may be absent.
pub(crate) fn some_numbers<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<f64>>, D::Error> {
    numbers(deserializer).map(Some)
}

fn one() -> usize {
    1
}

/// Why numbers are no functions.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// Their number does not fit.
    #[error("{found} values are given; {rows} rows of {columns} are needed")]
    Length {
        /// Values.
        found: usize,
        /// Rows that are needed.
        rows: usize,
        /// Columns that are announced.
        columns: usize,
    },
    /// They are too many.
    #[error("{columns} functions were given; the limit is {MOST_COLUMNS}")]
    Columns {
        /// Functions.
        columns: usize,
    },
    /// One of them is no number.
    #[error("the value of row {row}, column {column} is not finite")]
    NotFinite {
        /// The row of the first.
        row: usize,
        /// Its column.
        column: usize,
    },
}

impl Table {
    /// The table as a matrix of `rows` rows, whatever its values.
    pub(crate) fn any_matrix(&self, rows: usize) -> Result<DenseMatrix, TableError> {
        if self.columns == 0 || rows.checked_mul(self.columns) != Some(self.values.len()) {
            return Err(TableError::Length { found: self.values.len(), rows, columns: self.columns });
        }
        any_matrix(rows, self.columns, |i| self.values[i])
    }

    /// The table as a matrix of `rows` rows.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn matrix(&self, rows: usize) -> Result<DenseMatrix, TableError> {
        if self.columns == 0 || rows.checked_mul(self.columns) != Some(self.values.len()) {
            return Err(TableError::Length { found: self.values.len(), rows, columns: self.columns });
        }
        matrix(rows, self.columns, |i| self.values[i])
    }
}

/// A matrix from values that are given row after row.
///
/// # Errors
/// [`TableError`]: more than [`MOST_COLUMNS`] columns, or a value that is not finite.
pub fn matrix(rows: usize, columns: usize, value: impl Fn(usize) -> f64) -> Result<DenseMatrix, TableError> {
    let matrix = any_matrix(rows, columns, value)?;
    let odd = |column: usize| Some((matrix.column(column).iter().position(|x| !x.is_finite())?, column));
    match (0..columns).find_map(odd) {
        None => Ok(matrix),
        Some((row, column)) => Err(TableError::NotFinite { row, column }),
    }
}

/// The same, whatever the values: functions on the vertices of a file may have none at some.
///
/// # Errors
/// [`TableError::Columns`].
pub fn any_matrix(rows: usize, columns: usize, value: impl Fn(usize) -> f64) -> Result<DenseMatrix, TableError> {
    if columns > MOST_COLUMNS {
        return Err(TableError::Columns { columns });
    }
    let mut matrix = DenseMatrix::zeros(rows, columns);
    for column in 0..columns {
        matrix.column_mut(column).iter_mut().enumerate().for_each(|(row, slot)| *slot = value(row * columns + column));
    }
    Ok(matrix)
}

impl From<&DenseMatrix> for Table {
    fn from(matrix: &DenseMatrix) -> Self {
        let columns = matrix.columns();
        let mut values = vec![0.0; matrix.values().len()];
        for column in 0..columns {
            matrix.column(column).iter().enumerate().for_each(|(row, &value)| values[row * columns + column] = value);
        }
        Self { columns, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_go_row_after_row_and_what_does_not_fit_is_named() {
        let matrix = DenseMatrix::from_columns(2, 3, vec![1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        let table = Table::from(&matrix);
        assert_eq!(table.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(table.matrix(2).unwrap(), matrix);
        for (columns, values, expected) in [
            (2, vec![0.0; 3], "3 values are given; 2 rows of 2 are needed"),
            (usize::MAX, vec![0.0; 3], "3 values are given"),
            (1, vec![0.0, f64::NAN], "row 1, column 0"),
            (257, vec![0.0; 514], "257 functions"),
        ] {
            let refused = Table { columns, values }.matrix(2).unwrap_err().to_string();
            assert!(refused.starts_with(expected) || refused.contains(expected), "{refused}");
        }
    }
}
