//! Products with sparse matrices: vectors, panels of vectors, transposes.

use chladni_base::parallel::*;

use super::{DenseMatrix, SparseMatrix, vectorized};

/// Rows that one task handles.
const ROWS_PER_TASK: usize = 2048;

/// Numbers that a sparse matrix may hold; arithmetic is in f64.
pub trait Scalar: Copy + Default + Send + Sync + 'static {
    /// The value in double precision.
    fn wide(self) -> f64;
}

impl Scalar for f64 {
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

/// A panel of `width` vectors stored row after row, so that one row of a sparse matrix meets contiguous numbers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    rows: usize,
    width: usize,
    values: Vec<f64>,
}

impl Panel {
    /// A panel of zeros.
    pub fn zeros(rows: usize, width: usize) -> Self {
        Self { rows, width, values: vec![0.0; rows * width] }
    }

    /// Columns `range` of a dense matrix.
    ///
    /// # Panics
    /// Where the range leaves the matrix.
    pub fn from_columns(matrix: &DenseMatrix, range: std::ops::Range<usize>) -> Self {
        assert!(range.end <= matrix.columns(), "columns {range:?} of a matrix of {}", matrix.columns());
        let mut panel = Self::zeros(matrix.rows(), range.len());
        for (k, column) in range.enumerate() {
            for (row, &value) in matrix.column(column).iter().enumerate() {
                panel.values[row * panel.width + k] = value;
            }
        }
        panel
    }

    /// The same numbers, column after column.
    pub fn to_columns(&self) -> DenseMatrix {
        let mut dense = DenseMatrix::zeros(self.rows, self.width);
        for k in 0..self.width {
            for (row, value) in dense.column_mut(k).iter_mut().enumerate() {
                *value = self.values[row * self.width + k];
            }
        }
        dense
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of vectors.
    pub fn width(&self) -> usize {
        self.width
    }

    /// One row: entry `row` of every vector.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.width..(row + 1) * self.width]
    }

    /// All values, row after row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, row after row, to write to.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }
}

/// `acc += Σ value · row(column)` with rows of exactly `K` numbers, which the compiler keeps in registers.
#[inline(always)]
fn accumulate<const K: usize, T: Scalar>(
    columns: &[u32],
    values: &[T],
    x: &[f64],
    width: usize,
    at: usize,
) -> [f64; K] {
    let mut acc = [0.0; K];
    for (&column, &value) in columns.iter().zip(values) {
        let start = column as usize * width + at;
        let value = value.wide();
        if let Some(row) = x.get(start..start + K) {
            for k in 0..K {
                acc[k] += value * row[k];
            }
        }
    }
    acc
}

/// One row of a product with a panel: `y = Σ value · x[column]`.
#[inline(always)]
pub(crate) fn product_row<T: Scalar>(columns: &[u32], values: &[T], x: &[f64], width: usize, y: &mut [f64]) {
    let mut at = 0;
    while at + 16 <= width {
        y[at..at + 16].copy_from_slice(&accumulate::<16, T>(columns, values, x, width, at));
        at += 16;
    }
    if at + 8 <= width {
        y[at..at + 8].copy_from_slice(&accumulate::<8, T>(columns, values, x, width, at));
        at += 8;
    }
    if at + 4 <= width {
        y[at..at + 4].copy_from_slice(&accumulate::<4, T>(columns, values, x, width, at));
        at += 4;
    }
    while at < width {
        y[at..at + 1].copy_from_slice(&accumulate::<1, T>(columns, values, x, width, at));
        at += 1;
    }
}

impl<T: Scalar> SparseMatrix<T> {
    /// `y = A x`, in parallel.
    ///
    /// # Panics
    /// Unless `x` has as many entries as the matrix columns.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.rows()];
        self.multiply_rows(x, 1, &mut y);
        y
    }

    /// `Y = A X` for a panel, in parallel.
    ///
    /// # Panics
    /// Unless `X` has as many rows as the matrix columns.
    pub fn multiply_panel(&self, x: &Panel) -> Panel {
        let mut y = Panel::zeros(self.rows(), x.width());
        self.multiply_rows(x.values(), x.width(), y.values_mut());
        y
    }

    /// `Y = A X` for a dense matrix, in parallel.
    ///
    /// # Panics
    /// Unless `X` has as many rows as the matrix columns.
    pub fn multiply_dense(&self, x: &DenseMatrix) -> DenseMatrix {
        self.multiply_panel(&Panel::from_columns(x, 0..x.columns())).to_columns()
    }

    fn multiply_rows(&self, x: &[f64], width: usize, y: &mut [f64]) {
        assert_eq!(x.len(), width * self.columns(), "numbers of {width} vectors for {} columns", self.columns());
        if width == 0 {
            return;
        }
        y.par_chunks_mut(ROWS_PER_TASK * width).enumerate().for_each(|(task, y)| {
            vectorized(
                y,
                #[inline(always)]
                |y| {
                    for (k, y) in y.chunks_exact_mut(width).enumerate() {
                        let (columns, values) = self.row(task * ROWS_PER_TASK + k);
                        product_row(columns, values, x, width, y);
                    }
                },
            );
        });
    }

    /// The same matrix with every entry stored.
    pub fn to_dense(&self) -> DenseMatrix {
        let mut dense = DenseMatrix::zeros(self.rows(), self.columns());
        let rows = self.rows();
        for row in 0..rows {
            let (columns, values) = self.row(row);
            for (&column, &value) in columns.iter().zip(values) {
                dense.values_mut()[column as usize * rows + row] = value.wide();
            }
        }
        dense
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix of small pseudo-random numbers, about `per_row` a row.
    fn scattered(rows: usize, columns: usize, per_row: usize) -> SparseMatrix {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for _ in 0..rows {
            let mut row: Vec<u32> = (0..per_row).map(|_| (random() % columns as u64) as u32).collect();
            row.sort_unstable();
            row.dedup();
            values.extend(row.iter().map(|_| (random() % 1000) as f64 / 500.0 - 1.0));
            indices.extend(row);
            offsets.push(indices.len());
        }
        SparseMatrix::new(rows, columns, offsets, indices, values).unwrap()
    }

    #[test]
    fn panels_of_every_width_agree_with_the_dense_product() {
        let a = scattered(37, 23, 5);
        let dense = a.to_dense();
        for width in [0, 1, 3, 8, 13, 16, 29, 32, 40] {
            let mut x = Panel::zeros(23, width);
            x.values_mut().iter_mut().enumerate().for_each(|(i, v)| *v = (i as f64).sin());
            let y = a.multiply_panel(&x);
            for row in 0..37 {
                for k in 0..width {
                    let expected: f64 = (0..23).map(|c| dense.column(c)[row] * x.row(c)[k]).sum();
                    assert!((y.row(row)[k] - expected).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    #[should_panic = "numbers of 4 vectors for 23 columns"]
    fn a_panel_of_another_size_is_a_mistake_of_the_caller() {
        scattered(37, 23, 5).multiply_panel(&Panel::zeros(22, 4));
    }

    #[test]
    fn transposing_twice_changes_nothing_and_once_swaps_indices() {
        let a = scattered(50, 31, 4);
        let t = a.transpose();
        let checked = SparseMatrix::new(31, 50, t.offsets().to_vec(), t.indices().to_vec(), t.values().to_vec());
        assert!(checked.is_ok());
        let (dense, flipped) = (a.to_dense(), t.to_dense());
        assert!((0..50).all(|r| (0..31).all(|c| dense.column(c)[r] == flipped.column(r)[c])));
        assert_eq!(t.transpose(), a);
    }

    #[test]
    fn a_panel_of_columns_holds_those_columns() {
        let dense = DenseMatrix::from_columns(2, 3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let panel = Panel::from_columns(&dense, 1..3);
        assert_eq!((panel.rows(), panel.width(), panel.values()), (2, 2, &[3.0, 5.0, 4.0, 6.0][..]));
    }
}
