//! Working in a basis: lifting modes, evaluating combinations, projecting functions. Always through `U (φ̄ v)`, never through all of `Φ`.

use rayon::prelude::*;

use super::Basis;
use crate::algebra::{DenseMatrix, LIFT_WIDTH, RowLifter, space_times, space_transposed_mass_times};

/// Why something cannot be evaluated in a basis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
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
    #[error("{found} values a function where {expected} are due")]
    Rows {
        /// The rows of the matrix.
        found: usize,
        /// The vertices or the modes of the basis.
        expected: usize,
    },
    /// The parts of the basis do not fit each other.
    #[error("the factors of the basis do not fit each other")]
    Inconsistent,
}

/// Rows that are lifted by one task.
const ROWS_PER_TASK: usize = 1024;

impl Basis {
    /// Modes `range` lifted to the vertices: `n` values for each mode, mode after mode.
    ///
    /// # Errors
    /// [`BasisError::Modes`] where the range leaves the basis.
    pub fn lift(&self, range: std::ops::Range<usize>) -> Result<Vec<f32>, BasisError> {
        let n = self.vertices();
        if range.start > range.end || range.end > self.coefficients.columns() {
            let count = self.coefficients.columns();
            return Err(BasisError::Modes { from: range.start, to: range.end, count });
        }
        let wanted = self.coefficients.slice_columns(range);
        let count = wanted.columns();
        let lifter = RowLifter::new(&self.space, &wanted).ok_or(BasisError::Inconsistent)?;
        let mut lifted = vec![0f32; n * count];
        // Each task owns some rows of every mode.
        let mut tasks: Vec<Vec<&mut [f32]>> =
            (0..n.div_ceil(ROWS_PER_TASK)).map(|_| Vec::with_capacity(count)).collect();
        for mode in lifted.chunks_mut(n.max(1)) {
            for (task, part) in tasks.iter_mut().zip(mode.chunks_mut(ROWS_PER_TASK)) {
                task.push(part);
            }
        }
        tasks.into_par_iter().enumerate().for_each(|(task, mut modes)| {
            let from = task * ROWS_PER_TASK;
            let rows: Vec<u32> = (from..n.min(from + ROWS_PER_TASK)).map(|row| row as u32).collect();
            let mut panel = vec![[0.0; LIFT_WIDTH]; rows.len()];
            for (group, modes) in modes.chunks_mut(LIFT_WIDTH).enumerate() {
                lifter.lift(&rows, group, &mut panel);
                for (k, mode) in modes.iter_mut().enumerate() {
                    mode.iter_mut().zip(&panel).for_each(|(value, row)| *value = row[k] as f32);
                }
            }
        });
        Ok(lifted)
    }

    /// `Φ v` for coefficients `v`, `m × k`, in the eigenbasis: `n × k`.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `v` has a row for each mode.
    pub fn evaluate(&self, v: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        let reduced = self
            .coefficients
            .times(v)
            .ok_or(BasisError::Rows { found: v.rows(), expected: self.coefficients.columns() })?;
        space_times(&self.space, &reduced).ok_or(BasisError::Inconsistent)
    }

    /// `ΦᵀM x` for functions `x`, `n × k`: the coefficients, `m × k`, of the nearest combinations of modes.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `x` has a row for each vertex.
    pub fn project(&self, x: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        if x.rows() != self.vertices() {
            return Err(BasisError::Rows { found: x.rows(), expected: self.vertices() });
        }
        let reduced = space_transposed_mass_times(&self.space, &self.mass, x).ok_or(BasisError::Inconsistent)?;
        self.coefficients.transposed_times(&reduced).ok_or(BasisError::Inconsistent)
    }

    /// The norm `√(xᵀ M x)` of each of `k` functions, `n × k`.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `x` has a row for each vertex.
    pub fn norms(&self, x: &DenseMatrix) -> Result<Vec<f64>, BasisError> {
        (0..x.columns())
            .map(|column| {
                let x = x.column(column);
                let mx = self.mass.multiply(x);
                let mx = mx.ok_or(BasisError::Rows { found: x.len(), expected: self.mass.size() })?;
                Ok(x.iter().zip(&mx).map(|(x, mx)| x * mx).sum::<f64>().max(0.0).sqrt())
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::tests::small_basis;

    #[test]
    fn lifting_and_evaluating_agree_with_the_product_of_the_factors() {
        let basis = small_basis(false);
        // Modes are U times (1, 1) and U times (0.1, -1/3).
        let third = 1.0 / 3.0;
        let modes = [[1.0, 1.0, 1.0], [0.1, 0.025 - 0.25, -third]];
        let lifted = basis.lift(0..2).unwrap();
        for (value, expected) in lifted.iter().zip(modes.as_flattened()) {
            assert!((f64::from(*value) - expected).abs() < 1e-7);
        }
        assert_eq!(basis.lift(1..2).unwrap(), lifted[3..]);
        assert!(basis.lift(2..2).unwrap().is_empty());
        let v = DenseMatrix::from_columns(2, 1, vec![2.0, -3.0]).unwrap();
        let values = basis.evaluate(&v).unwrap();
        for (row, value) in values.column(0).iter().enumerate() {
            assert!((value - 2.0 * modes[0][row] + 3.0 * modes[1][row]).abs() < 1e-15);
        }
    }

    #[test]
    fn projecting_takes_inner_products_with_the_mass() {
        for sparse in [false, true] {
            let basis = small_basis(sparse);
            let x = DenseMatrix::from_columns(3, 2, vec![1.0, 2.0, 3.0, 0.0, 0.0, 4.0]).unwrap();
            let found = basis.project(&x).unwrap();
            let modes = basis.evaluate(&DenseMatrix::from_columns(2, 2, vec![1.0, 0.0, 0.0, 1.0]).unwrap()).unwrap();
            for k in 0..2 {
                let mx = basis.mass.multiply(x.column(k)).unwrap();
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
        assert_eq!(basis.lift(1..3).unwrap_err().to_string(), "modes 1..3 of a basis of 2");
        let four = DenseMatrix::zeros(4, 1);
        assert_eq!(basis.evaluate(&four).unwrap_err(), BasisError::Rows { found: 4, expected: 2 });
        assert_eq!(basis.project(&four).unwrap_err(), BasisError::Rows { found: 4, expected: 3 });
        assert_eq!(basis.norms(&four).unwrap_err(), BasisError::Rows { found: 4, expected: 3 });
    }
}
