//! Dense matrices.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// A dense `rows × columns` matrix of f64, stored column after column.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DenseMatrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl DenseMatrix {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, values: vec![0.0; rows * columns] }
    }

    /// A matrix from its values, column after column.
    ///
    /// # Panics
    /// Unless there are `rows · columns` values. Sizes that come from outside are checked before.
    pub fn from_columns(rows: usize, columns: usize, values: Vec<f64>) -> Self {
        assert_eq!(
            rows.checked_mul(columns),
            Some(values.len()),
            "values of a matrix of {rows} rows and {columns} columns"
        );
        Self { rows, columns, values }
    }

    /// The number of rows.
    #[inline]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    #[inline]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// One column.
    #[inline]
    pub fn column(&self, column: usize) -> &[f64] {
        &self.values[column * self.rows..(column + 1) * self.rows]
    }

    /// One column, to write to.
    #[inline]
    pub fn column_mut(&mut self, column: usize) -> &mut [f64] {
        &mut self.values[column * self.rows..(column + 1) * self.rows]
    }

    /// All values, column after column.
    #[inline]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, column after column, without a copy.
    #[inline]
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// All values, column after column, to write to.
    #[inline]
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Drops all columns from `columns` on, and the memory they took.
    pub fn keep_columns(&mut self, columns: usize) {
        self.columns = self.columns.min(columns);
        self.values.truncate(self.rows * self.columns);
        self.values.shrink_to_fit();
    }

    /// A copy of some columns; a range that leaves the matrix is cut off.
    pub fn slice_columns(&self, range: std::ops::Range<usize>) -> Self {
        let end = range.end.min(self.columns);
        let start = range.start.min(end);
        Self { rows: self.rows, columns: end - start, values: self.values[start * self.rows..end * self.rows].to_vec() }
    }

    /// `self · other`, on the threads of the pool it is called from where that pays.
    ///
    /// # Panics
    /// Unless `other` has as many rows as `self` columns.
    pub fn times(&self, other: &Self) -> Self {
        assert_eq!(self.columns, other.rows, "columns of the left factor, rows of the right one");
        product(self.view(), other.view())
    }

    /// `selfᵀ · other`, on the threads of the pool it is called from where that pays.
    ///
    /// # Panics
    /// Unless both have as many rows.
    pub fn transposed_times(&self, other: &Self) -> Self {
        assert_eq!(self.rows, other.rows, "rows of the two factors");
        product(self.view().transpose(), other.view())
    }

    /// The rows as columns.
    pub fn transpose(&self) -> Self {
        let mut transposed = Self::zeros(self.columns, self.rows);
        for column in 0..self.columns {
            for (row, &value) in self.column(column).iter().enumerate() {
                transposed.values[row * self.columns + column] = value;
            }
        }
        transposed
    }

    fn view(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.rows, self.columns)
    }
}

fn product(left: MatRef<'_, f64>, right: MatRef<'_, f64>) -> DenseMatrix {
    const LEAST_PARALLEL: usize = 1 << 22;
    let work = left.nrows() * left.ncols() * right.ncols();
    let par = if work < LEAST_PARALLEL { Par::Seq } else { Par::rayon(0) };
    let mut product = DenseMatrix::zeros(left.nrows(), right.ncols());
    let (rows, columns) = (product.rows, product.columns);
    let into = MatMut::from_column_major_slice_mut(&mut product.values, rows, columns);
    matmul(into, Accum::Replace, left, right, 1.0, par);
    product
}

/// The sum of symmetric matrices of which the lower triangles are set, `q × q`, always in the order in which they are
/// given; symmetric to the last bit.
pub(super) fn sum_of_lower(parts: &[DenseMatrix], q: usize) -> DenseMatrix {
    let mut sum = DenseMatrix::zeros(q, q);
    for column in 0..q {
        for row in column..q {
            let value = parts.iter().map(|part| part.column(column)[row]).sum();
            sum.column_mut(column)[row] = value;
            sum.column_mut(row)[column] = value;
        }
    }
    sum
}

/// The columns of a matrix of so many rows, cut into parts of `each` rows: for each part its piece of every column.
/// What tasks write that own some rows.
pub fn row_parts<T>(values: &mut [T], rows: usize, each: usize) -> Vec<Vec<&mut [T]>> {
    let columns = values.len() / rows.max(1);
    let mut parts: Vec<Vec<&mut [T]>> = (0..rows.div_ceil(each)).map(|_| Vec::with_capacity(columns)).collect();
    for column in values.chunks_mut(rows.max(1)) {
        for (part, piece) in parts.iter_mut().zip(column.chunks_mut(each)) {
            part.push(piece);
        }
    }
    parts
}

/// A matrix as `faer` sees it.
pub(super) fn view(matrix: &DenseMatrix) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.values(), matrix.rows(), matrix.columns())
}

/// The same, to write to.
pub(super) fn view_mut(matrix: &mut DenseMatrix) -> MatMut<'_, f64> {
    let (rows, columns) = (matrix.rows(), matrix.columns());
    MatMut::from_column_major_slice_mut(matrix.values_mut(), rows, columns)
}
