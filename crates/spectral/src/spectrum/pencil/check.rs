//! That matrices are what they are taken for.

use chladni_algebra::{MassMatrix, SparseMatrix};

use super::PencilError;

/// Entries on either side of the diagonal may differ by this share of the largest in their rows.
const ROUNDING: f64 = 1e-12;

/// A matrix of `rows × columns` from the arrays of SciPy's `csr_matrix` (or of its transpose by columns): the entries
/// of row `i` are `indptr[i]..indptr[i + 1]`. They may come in any order, and those of one place are added up.
///
/// # Errors
/// [`PencilError::Structure`] names the row whose offsets or columns do not fit.
pub fn csr(
    rows: usize,
    columns: usize,
    indptr: &[usize],
    indices: &[u32],
    values: &[f64],
) -> Result<SparseMatrix, PencilError> {
    SparseMatrix::from_unsorted(rows, columns, indptr, indices, values).map_err(PencilError::Structure)
}

/// Refuses entries all of which are below the least number with all its digits. Zeros are as good as any.
///
/// # Errors
/// [`PencilError::TooSmall`].
pub(super) fn large_enough(matrix: &'static str, values: &[f64]) -> Result<(), PencilError> {
    let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    match largest > 0.0 && largest < f64::MIN_POSITIVE {
        true => Err(PencilError::TooSmall { matrix, largest }),
        false => Ok(()),
    }
}

/// The matrix made symmetric to the last bit, without stored zeros.
pub(super) fn symmetric(name: &'static str, matrix: SparseMatrix) -> Result<SparseMatrix, PencilError> {
    let n = matrix.rows();
    if matrix.columns() != n || u32::try_from(n).is_err() {
        return Err(PencilError::Shape {
            matrix: name,
            rows: n,
            columns: matrix.columns(),
            expected: "square".to_owned(),
        });
    }
    let mut largest = vec![0f64; n];
    for (row, largest) in largest.iter_mut().enumerate() {
        let (columns, values) = matrix.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            if !value.is_finite() {
                return Err(PencilError::NotFinite { matrix: name, row, column: column as usize, value });
            }
            *largest = largest.max(value.abs());
        }
    }
    let mirrored = matrix.transpose();
    let (mut offsets, mut indices) = (Vec::with_capacity(n + 1), Vec::with_capacity(matrix.entries()));
    let mut values = Vec::with_capacity(matrix.entries());
    offsets.push(0);
    for row in 0..n {
        for (column, value, mirrored) in merged(matrix.row(row), mirrored.row(row)) {
            let allowed = ROUNDING * largest[row].max(largest[column as usize]);
            if (value - mirrored).abs() > allowed {
                let column = column as usize;
                return Err(PencilError::NotSymmetric { matrix: name, row, column, value, mirrored });
            }
            // Halves first: a sum may overflow.
            let mean = if value == mirrored { value } else { 0.5 * value + 0.5 * mirrored };
            if mean != 0.0 {
                indices.push(column);
                values.push(mean);
            }
        }
        offsets.push(indices.len());
    }
    Ok(SparseMatrix::from_sorted_parts(n, n, offsets, indices, values))
}

/// The matrix with a place for every entry of the mass and on the diagonal, which holds a zero where it had none.
pub(super) fn with_pattern_of(matrix: &SparseMatrix, mass: &MassMatrix) -> SparseMatrix {
    let n = matrix.rows();
    let (mut offsets, mut indices) = (Vec::with_capacity(n + 1), Vec::with_capacity(matrix.entries() + n));
    let mut values = Vec::with_capacity(matrix.entries() + n);
    offsets.push(0);
    for row in 0..n {
        let (diagonal, one) = ([row as u32], [1.0]);
        let others = mass.sparse().map_or((&diagonal[..], &one[..]), |mass| mass.row(row));
        for (column, value, _) in merged(matrix.row(row), others) {
            indices.push(column);
            values.push(value);
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(n, n, offsets, indices, values)
}

/// The columns of two rows, with the entries of both.
fn merged<'a>(
    (left, left_values): (&'a [u32], &'a [f64]),
    (right, right_values): (&'a [u32], &'a [f64]),
) -> impl Iterator<Item = (u32, f64, f64)> {
    let (mut i, mut j) = (0, 0);
    std::iter::from_fn(move || {
        let column = match (left.get(i), right.get(j)) {
            (Some(&a), Some(&b)) => a.min(b),
            (a, b) => *a.or(b)?,
        };
        let take = |columns: &[u32], values: &[f64], at: &mut usize| {
            if columns.get(*at) == Some(&column) {
                *at += 1;
                values[*at - 1]
            } else {
                0.0
            }
        };
        Some((column, take(left, left_values, &mut i), take(right, right_values, &mut j)))
    })
}
