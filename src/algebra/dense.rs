//! Dense matrices.

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

    /// A matrix from its values, column after column; `None` unless there are `rows · columns` of them.
    pub fn from_columns(rows: usize, columns: usize, values: Vec<f64>) -> Option<Self> {
        (rows.checked_mul(columns) == Some(values.len())).then_some(Self { rows, columns, values })
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// One column.
    pub fn column(&self, column: usize) -> &[f64] {
        &self.values[column * self.rows..(column + 1) * self.rows]
    }

    /// One column, to write to.
    pub fn column_mut(&mut self, column: usize) -> &mut [f64] {
        &mut self.values[column * self.rows..(column + 1) * self.rows]
    }

    /// All values, column after column.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, column after column, to write to.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Drops all columns from `columns` on, and the memory they took.
    pub fn keep_columns(&mut self, columns: usize) {
        self.columns = self.columns.min(columns);
        self.values.truncate(self.rows * self.columns);
        self.values.shrink_to_fit();
    }

    /// `selfᵀ · other`, on the threads of the pool it is called from; `None` unless both have the same number of rows.
    pub fn transposed_times(&self, other: &Self) -> Option<Self> {
        if self.rows != other.rows {
            return None;
        }
        let mut product = Self::zeros(self.columns, other.columns);
        faer::linalg::matmul::matmul(
            faer::MatMut::from_column_major_slice_mut(&mut product.values, self.columns, other.columns),
            faer::Accum::Replace,
            faer::MatRef::from_column_major_slice(&self.values, self.rows, self.columns).transpose(),
            faer::MatRef::from_column_major_slice(&other.values, other.rows, other.columns),
            1.0,
            faer::Par::rayon(0),
        );
        Some(product)
    }
}
