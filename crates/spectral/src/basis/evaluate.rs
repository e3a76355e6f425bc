//! Working in a basis: lifting modes, evaluating combinations, projecting functions. A compact basis works through
//! `U (φ̄ v)`, a dense one chunk by chunk of its columns: never with all of `Φ` at once.

use std::ops::Range;

use chladni_algebra::{
    DenseMatrix, LIFT_WIDTH, MassMatrix, RowLifter, row_parts, space_times, space_times_single,
    space_transposed_mass_times,
};
use chladni_base::parallel::*;

use super::dense::{Real, Visit};
use super::{Basis, ColumnError, Compact, DenseFunctions, Functions};

/// Why something cannot be evaluated in a basis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BasisError {
    /// Modes are wanted that the basis does not have.
    #[error("modes {from}..{to} of a basis of {count}")]
    Modes {
        /// The first mode.
        from: usize,
        /// One past the last.
        to: usize,
        /// The number of modes.
        count: usize,
    },
    /// A matrix has the wrong number of rows.
    #[error("each function must have {expected} values, got {found}")]
    Rows {
        /// The rows of the matrix.
        found: usize,
        /// The vertices or the modes of the basis.
        expected: usize,
    },
    /// There is no such vertex.
    #[error("item {place} of the vertices is {vertex}, but there are {vertices} vertices")]
    Vertex {
        /// Where it stands among those asked for.
        place: usize,
        /// What was asked for.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// Some columns cannot be read.
    #[error("chunk {chunk} of the eigenfunctions cannot be read: {error}")]
    Unavailable {
        /// The chunk of columns.
        chunk: usize,
        /// Why.
        error: ColumnError,
    },
    /// The parts of the basis do not fit each other.
    #[error("the parts of the basis do not fit together")]
    Inconsistent,
}

/// Rows that are lifted by one task.
const ROWS_PER_TASK: usize = 1024;

impl Basis {
    /// Modes `range` on the vertices: `n` values for each mode, mode after mode. Of a dense basis, only their chunks
    /// are read.
    ///
    /// # Errors
    /// [`BasisError::Modes`] where the range leaves the basis; [`BasisError::Unavailable`].
    pub fn lift<T: Real>(&self, range: Range<usize>) -> Result<Vec<T>, BasisError> {
        if range.start > range.end || range.end > self.count() {
            return Err(BasisError::Modes { from: range.start, to: range.end, count: self.count() });
        }
        match &self.functions {
            Functions::Compact(compact) => compact.lift(range),
            Functions::Dense(dense) => dense.copy(range),
        }
    }

    /// The same vertex after vertex: for each the values of all of these modes.
    ///
    /// # Errors
    /// As [`lift`](Self::lift).
    pub fn lift_rows<T: Real>(&self, range: Range<usize>) -> Result<Vec<T>, BasisError> {
        match &self.functions {
            Functions::Compact(compact) if range.start <= range.end && range.end <= self.count() => {
                compact.lift_rows(range)
            }
            _ => {
                let (n, k) = (self.vertices(), range.len());
                let modes = self.lift::<T>(range)?;
                let mut rows = vec![T::default(); n * k];
                // Some rows at a time, so that what is written stays in the cache.
                rows.par_chunks_mut((k * ROWS_PER_TASK).max(1)).enumerate().for_each(|(task, rows)| {
                    for column in 0..k {
                        let values = &modes[column * n + task * ROWS_PER_TASK..][..rows.len() / k];
                        rows.iter_mut().skip(column).step_by(k).zip(values).for_each(|(row, value)| *row = *value);
                    }
                });
                Ok(rows)
            }
        }
    }

    /// `Φ v` for coefficients `v`, `m × k`, in the eigenbasis: `n × k`.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `v` has a row for each mode; [`BasisError::Unavailable`].
    pub fn evaluate(&self, v: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        if v.rows() != self.count() {
            return Err(BasisError::Rows { found: v.rows(), expected: self.count() });
        }
        match &self.functions {
            Functions::Compact(compact) => compact.evaluate(v),
            Functions::Dense(dense) => {
                let mut sum = DenseMatrix::zeros(dense.rows(), v.columns());
                dense.each_chunk(|range, chunk| chunk.visit(Add { v, range, sum: &mut sum }))?;
                Ok(sum)
            }
        }
    }

    /// The same, each value rounded to single precision at the end: `k` columns of `n` values, one after the other.
    ///
    /// # Errors
    /// As [`evaluate`](Self::evaluate).
    pub fn evaluate_single(&self, v: &DenseMatrix) -> Result<Vec<f32>, BasisError> {
        match &self.functions {
            Functions::Compact(Compact { space, coefficients, .. }) if v.rows() == self.count() => {
                let reduced = coefficients.times(v);
                Ok(space_times_single(space, &reduced))
            }
            _ => Ok(self.evaluate(v)?.values().iter().map(|&value| value as f32).collect()),
        }
    }

    /// `ΦᵀM x` for functions `x`, `n × k`: the coefficients, `m × k`, of the nearest combinations of modes.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `x` has a row for each vertex; [`BasisError::Unavailable`].
    pub fn project(&self, x: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        self.check_rows(x)?;
        match &self.functions {
            Functions::Compact(compact) => compact.project(&self.mass, x),
            Functions::Dense(dense) => {
                let weighted = self.mass_times(x)?;
                dense.inner_products(&weighted, self.count())
            }
        }
    }

    /// `c = ΦᵀM x`, `m × k`, and `Φ F c`, `n × k`, with a diagonal `F` of `m` factors: as [`project`](Self::project)
    /// and [`evaluate`](Self::evaluate), but a dense basis is read only once.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `x` has a row for each vertex and there is a factor for each mode;
    /// [`BasisError::Unavailable`].
    pub fn apply_diagonal(&self, x: &DenseMatrix, factors: &[f64]) -> Result<(DenseMatrix, DenseMatrix), BasisError> {
        self.check_rows(x)?;
        if factors.len() != self.count() {
            return Err(BasisError::Rows { found: factors.len(), expected: self.count() });
        }
        let scaled = |coefficients: &DenseMatrix, range: Range<usize>| {
            let mut scaled = DenseMatrix::zeros(coefficients.rows(), coefficients.columns());
            for k in 0..coefficients.columns() {
                for row in range.clone() {
                    scaled.column_mut(k)[row] = factors[row] * coefficients.column(k)[row];
                }
            }
            scaled
        };
        match &self.functions {
            Functions::Compact(compact) => {
                let coefficients = compact.project(&self.mass, x)?;
                let applied = compact.evaluate(&scaled(&coefficients, 0..self.count()))?;
                Ok((coefficients, applied))
            }
            Functions::Dense(dense) => {
                let weighted = self.mass_times(x)?;
                let mut coefficients = DenseMatrix::zeros(self.count(), x.columns());
                let mut sum = DenseMatrix::zeros(dense.rows(), x.columns());
                dense.each_chunk(|range, chunk| {
                    chunk.visit(Dot { x: &weighted, range: range.clone(), coefficients: &mut coefficients });
                    let v = scaled(&coefficients, range.clone());
                    chunk.visit(Add { v: &v, range, sum: &mut sum });
                })?;
                Ok((coefficients, sum))
            }
        }
    }

    /// The norm `√(xᵀ M x)` of each of `k` functions, `n × k`.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `x` has a row for each vertex.
    pub fn norms(&self, x: &DenseMatrix) -> Result<Vec<f64>, BasisError> {
        (0..x.columns())
            .map(|column| {
                let x = x.column(column);
                if x.len() != self.mass.size() {
                    return Err(BasisError::Rows { found: x.len(), expected: self.mass.size() });
                }
                let mx = self.mass.multiply(x);
                Ok(x.iter().zip(&mx).map(|(x, mx)| x * mx).sum::<f64>().max(0.0).sqrt())
            })
            .collect()
    }

    fn check_rows(&self, x: &DenseMatrix) -> Result<(), BasisError> {
        if x.rows() != self.vertices() {
            return Err(BasisError::Rows { found: x.rows(), expected: self.vertices() });
        }
        Ok(())
    }

    pub(crate) fn mass_times(&self, x: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        let mut product = DenseMatrix::zeros(x.rows(), x.columns());
        for k in 0..x.columns() {
            let mx = self.mass.multiply(x.column(k));
            product.column_mut(k).copy_from_slice(&mx);
        }
        Ok(product)
    }
}

impl Compact {
    fn lift<T: Real>(&self, range: Range<usize>) -> Result<Vec<T>, BasisError> {
        let n = self.space.rows();
        let wanted = self.coefficients.slice_columns(range);
        let count = wanted.columns();
        let lifter = RowLifter::new(&self.space, &wanted);
        let mut lifted = vec![T::default(); n * count];
        let tasks = row_parts(&mut lifted, n, ROWS_PER_TASK);
        tasks.into_par_iter().enumerate().for_each(|(task, mut modes)| {
            let from = task * ROWS_PER_TASK;
            let rows: Vec<u32> = (from..n.min(from + ROWS_PER_TASK)).map(|row| row as u32).collect();
            let mut panel = vec![[0.0; LIFT_WIDTH]; rows.len()];
            for (group, modes) in modes.chunks_mut(LIFT_WIDTH).enumerate() {
                lifter.lift(&rows, group, &mut panel);
                for (k, mode) in modes.iter_mut().enumerate() {
                    mode.iter_mut().zip(&panel).for_each(|(value, row)| *value = T::narrow(row[k]));
                }
            }
        });
        Ok(lifted)
    }

    fn lift_rows<T: Real>(&self, range: Range<usize>) -> Result<Vec<T>, BasisError> {
        let (n, k) = (self.space.rows(), range.len());
        let wanted = self.coefficients.slice_columns(range);
        let lifter = RowLifter::new(&self.space, &wanted);
        let mut lifted = vec![T::default(); n * k];
        lifted.par_chunks_mut((k * ROWS_PER_TASK).max(1)).enumerate().for_each(|(task, lifted)| {
            let from = task * ROWS_PER_TASK;
            let rows: Vec<u32> = (from..n.min(from + ROWS_PER_TASK)).map(|row| row as u32).collect();
            let mut panel = vec![[0.0; LIFT_WIDTH]; rows.len()];
            for group in 0..k.div_ceil(LIFT_WIDTH) {
                lifter.lift(&rows, group, &mut panel);
                for (row, values) in lifted.chunks_exact_mut(k).zip(&panel) {
                    row[group * LIFT_WIDTH..].iter_mut().zip(values).for_each(|(to, value)| *to = T::narrow(*value));
                }
            }
        });
        Ok(lifted)
    }

    fn evaluate(&self, v: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        let reduced = self.coefficients.times(v);
        Ok(space_times(&self.space, &reduced))
    }

    fn project(&self, mass: &MassMatrix, x: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        let reduced = space_transposed_mass_times(&self.space, mass, x);
        Ok(self.coefficients.transposed_times(&reduced))
    }
}

impl DenseFunctions {
    /// `Φᵀ x` for `x`, `n × k`: `m × k`.
    pub(super) fn inner_products(&self, x: &DenseMatrix, count: usize) -> Result<DenseMatrix, BasisError> {
        let mut coefficients = DenseMatrix::zeros(count, x.columns());
        self.each_chunk(|range, chunk| chunk.visit(Dot { x, range, coefficients: &mut coefficients }))?;
        Ok(coefficients)
    }

    /// Calls a function with each chunk and the range of its columns, in order.
    fn each_chunk(&self, mut act: impl FnMut(Range<usize>, &super::ColumnChunk)) -> Result<(), BasisError> {
        for index in 0..self.chunk_count() {
            let chunk = self.chunk(index)?;
            act(self.chunk_range(index), &chunk);
        }
        Ok(())
    }

    fn copy<T: Real>(&self, range: Range<usize>) -> Result<Vec<T>, BasisError> {
        let n = self.rows();
        let mut copied = vec![T::default(); n * range.len()];
        if range.is_empty() || n == 0 {
            return Ok(copied);
        }
        let mut columns = copied.chunks_mut(n);
        for index in range.start / super::CHUNK_COLUMNS..range.end.div_ceil(super::CHUNK_COLUMNS) {
            let chunk = self.chunk(index)?;
            let there = self.chunk_range(index);
            let wanted = there.start.max(range.start)..there.end.min(range.end);
            for (column, to) in wanted.zip(&mut columns) {
                chunk.copy_column(column - there.start, to);
            }
        }
        Ok(copied)
    }
}

/// Inner products of the columns of a chunk with functions.
struct Dot<'a> {
    x: &'a DenseMatrix,
    range: Range<usize>,
    coefficients: &'a mut DenseMatrix,
}

impl Visit for Dot<'_> {
    type Answer = ();
    fn visit<T: Real>(self, values: &[T], rows: usize) {
        let Self { x, range, coefficients } = self;
        let products: Vec<Vec<f64>> = values
            .par_chunks(rows.max(1))
            .map(|column| {
                (0..x.columns())
                    .map(|k| {
                        // Eight sums at a time, which the compiler keeps in vector registers.
                        let mut sums = [0.0; 8];
                        let (a, b) = (column.as_chunks::<8>(), x.column(k).as_chunks::<8>());
                        for (a, b) in a.0.iter().zip(b.0) {
                            for lane in 0..8 {
                                sums[lane] += a[lane].wide() * b[lane];
                            }
                        }
                        let rest: f64 = a.1.iter().zip(b.1).map(|(a, b)| a.wide() * b).sum();
                        sums.iter().sum::<f64>() + rest
                    })
                    .collect()
            })
            .collect();
        for (row, products) in range.zip(products) {
            for (k, product) in products.into_iter().enumerate() {
                coefficients.column_mut(k)[row] = product;
            }
        }
    }
}

/// Adds a combination of the columns of a chunk.
struct Add<'a> {
    v: &'a DenseMatrix,
    range: Range<usize>,
    sum: &'a mut DenseMatrix,
}

impl Visit for Add<'_> {
    type Answer = ();
    fn visit<T: Real>(self, values: &[T], rows: usize) {
        let Self { v, range, sum } = self;
        for k in 0..v.columns() {
            let weights = &v.column(k)[range.clone()];
            sum.column_mut(k).par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, sum)| {
                let from = task * ROWS_PER_TASK;
                for (column, &weight) in values.chunks(rows.max(1)).zip(weights) {
                    let column = &column[from..from + sum.len()];
                    sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value.wide());
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Precision;
    use crate::basis::tests::{dense_basis, small_basis};

    #[test]
    fn lifting_and_evaluating_agree_with_the_product_of_the_factors() {
        let basis = small_basis(false);
        // Modes are U times (1, 1) and U times (0.1, -1/3).
        let third = 1.0 / 3.0;
        let modes = [[1.0, 1.0, 1.0], [0.1, 0.025 - 0.25, -third]];
        let lifted: Vec<f32> = basis.lift(0..2).unwrap();
        for (value, expected) in lifted.iter().zip(modes.as_flattened()) {
            assert!((f64::from(*value) - expected).abs() < 1e-7);
        }
        assert_eq!(basis.lift::<f32>(1..2).unwrap(), lifted[3..]);
        assert!(basis.lift::<f32>(2..2).unwrap().is_empty());
        let v = DenseMatrix::from_columns(2, 1, vec![2.0, -3.0]);
        let values = basis.evaluate(&v).unwrap();
        for (row, value) in values.column(0).iter().enumerate() {
            assert!((value - 2.0 * modes[0][row] + 3.0 * modes[1][row]).abs() < 1e-15);
        }
    }

    #[test]
    fn rows_of_modes_and_values_in_single_precision_are_the_same_numbers() {
        for basis in [small_basis(false), dense_basis(Precision::F64, 70)] {
            let (n, m) = (basis.vertices(), basis.count());
            let (modes, rows): (Vec<f64>, Vec<f64>) = (basis.lift(1..m).unwrap(), basis.lift_rows(1..m).unwrap());
            assert_eq!(rows.len(), modes.len());
            assert!((0..n).all(|v| (0..m - 1).all(|k| rows[v * (m - 1) + k] == modes[k * n + v])));
            assert!(basis.lift_rows::<f64>(m..m).unwrap().is_empty());
            assert!(basis.lift_rows::<f64>(0..m + 1).is_err());
            let v = DenseMatrix::from_columns(m, 2, (0..2 * m).map(|k| (k as f64).cos()).collect());
            let expected: Vec<f32> = basis.evaluate(&v).unwrap().values().iter().map(|&x| x as f32).collect();
            assert_eq!(basis.evaluate_single(&v).unwrap(), expected);
            assert!(basis.evaluate_single(&DenseMatrix::zeros(m + 1, 1)).is_err());
        }
    }

    #[test]
    fn projecting_takes_inner_products_with_the_mass() {
        for sparse in [false, true] {
            let basis = small_basis(sparse);
            let x = DenseMatrix::from_columns(3, 2, vec![1.0, 2.0, 3.0, 0.0, 0.0, 4.0]);
            let found = basis.project(&x).unwrap();
            let modes = basis.evaluate(&DenseMatrix::from_columns(2, 2, vec![1.0, 0.0, 0.0, 1.0])).unwrap();
            for k in 0..2 {
                let mx = basis.mass.multiply(x.column(k));
                for mode in 0..2 {
                    let expected: f64 = modes.column(mode).iter().zip(&mx).map(|(a, b)| a * b).sum();
                    assert!((found.column(k)[mode] - expected).abs() < 1e-15);
                }
                let square: f64 = x.column(k).iter().zip(&mx).map(|(a, b)| a * b).sum();
                assert!((basis.norms(&x).unwrap()[k] - square.sqrt()).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_named() {
        let basis = small_basis(false);
        assert_eq!(basis.lift::<f32>(1..3).unwrap_err().to_string(), "modes 1..3 of a basis of 2");
        let four = DenseMatrix::zeros(4, 1);
        assert_eq!(basis.evaluate(&four).unwrap_err(), BasisError::Rows { found: 4, expected: 2 });
        assert_eq!(basis.project(&four).unwrap_err(), BasisError::Rows { found: 4, expected: 3 });
        assert_eq!(basis.norms(&four).unwrap_err(), BasisError::Rows { found: 4, expected: 3 });
    }

    /// The product of all columns, one by one.
    fn columns(basis: &Basis) -> Vec<Vec<f64>> {
        basis.lift::<f64>(0..basis.count()).unwrap().chunks(basis.vertices()).map(<[f64]>::to_vec).collect()
    }

    #[test]
    fn a_dense_basis_does_what_its_columns_say() {
        for (precision, tolerance) in [(Precision::F32, 1e-6), (Precision::F64, 1e-14)] {
            let basis = dense_basis(precision, 70);
            let modes = columns(&basis);
            assert_eq!(modes.len(), 72);
            let part: Vec<f64> = basis.lift(30..66).unwrap();
            assert_eq!(part, modes[30..66].concat());
            let x = DenseMatrix::from_columns(3, 2, vec![1.0, 2.0, 3.0, 0.0, 0.5, 4.0]);
            let factors: Vec<f64> = (0..72).map(|k| 1.0 / (1.0 + f64::from(k))).collect();
            let (coefficients, applied) = basis.apply_diagonal(&x, &factors).unwrap();
            let projected = basis.project(&x).unwrap();
            for k in 0..2 {
                let mx = basis.mass.multiply(x.column(k));
                let mut expected = vec![0.0; 3];
                for (mode, column) in modes.iter().enumerate() {
                    let dot: f64 = column.iter().zip(&mx).map(|(a, b)| a * b).sum();
                    assert!((projected.column(k)[mode] - dot).abs() < tolerance);
                    assert_eq!(projected.column(k)[mode], coefficients.column(k)[mode]);
                    expected.iter_mut().zip(column).for_each(|(sum, x)| *sum += factors[mode] * dot * x);
                }
                let close = |(a, b): (&f64, &f64)| (a - b).abs() < 10.0 * tolerance;
                assert!(applied.column(k).iter().zip(&expected).all(close));
                let mut scaled = projected.clone();
                scaled.column_mut(k).iter_mut().zip(&factors).for_each(|(c, f)| *c *= f);
                assert!(basis.evaluate(&scaled).unwrap().column(k).iter().zip(&expected).all(close));
            }
        }
    }

    #[test]
    fn one_pass_over_a_compact_basis_is_a_projection_and_an_evaluation() {
        let basis = small_basis(true);
        let x = DenseMatrix::from_columns(3, 1, vec![1.0, 2.0, 3.0]);
        let (coefficients, applied) = basis.apply_diagonal(&x, &[1.0, 0.5]).unwrap();
        let mut expected = basis.project(&x).unwrap();
        assert_eq!(coefficients, expected);
        expected.column_mut(0)[1] *= 0.5;
        assert_eq!(applied, basis.evaluate(&expected).unwrap());
        assert!(basis.apply_diagonal(&x, &[1.0]).is_err());
    }
}
