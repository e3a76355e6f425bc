//! Dense systems with a symmetric positive definite matrix, by Cholesky.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor as cholesky;
use faer::linalg::cholesky::llt::solve;
use faer::linalg::triangular_solve;
use faer::{MatMut, MatRef, Par};

use super::DenseMatrix;

/// Why a definite system was not solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DefiniteError {
    /// Sizes do not fit.
    #[error("a {}×{} matrix does not fit {rows}×{columns} numbers", matrix.0, matrix.1)]
    Shape {
        /// Rows and columns of the matrix.
        matrix: (usize, usize),
        /// Rows of the other side.
        rows: usize,
        /// Columns of the other side.
        columns: usize,
    },
    /// The matrix is not positive definite, as far as rounding lets one tell.
    #[error("the matrix is not positive definite: pivot {pivot} is not positive")]
    NotPositiveDefinite {
        /// The first column where the factorisation failed.
        pivot: usize,
    },
    /// There is not enough memory.
    #[error("could not allocate {bytes} bytes of working memory")]
    Memory {
        /// What was asked for.
        bytes: usize,
    },
}

/// `X ← A⁻¹ X` for a symmetric positive definite `A`, `d × d`, of which the lower triangle is read, and `X`, `d × k`.
/// On the threads of the pool it is called from where that pays.
///
/// # Errors
/// [`DefiniteError`]: sizes that do not fit, a matrix that is not definite; `X` is unchanged then.
pub fn solve_definite(mut matrix: DenseMatrix, rhs: &mut DenseMatrix) -> Result<(), DefiniteError> {
    let (d, k) = (matrix.rows(), rhs.columns());
    check(&matrix, rhs.rows() == d, rhs)?;
    let par = par(d * d * (d + k));
    factor(&mut matrix, par)?;
    let mut nothing = MemBuffer::new(solve::solve_in_place_scratch::<f64>(d, k, par));
    solve::solve_in_place(view(&matrix), view_mut(rhs), par, MemStack::new(&mut nothing));
    Ok(())
}

/// The Cholesky factor of a symmetric positive definite matrix, kept for many right-hand sides.
pub struct DefiniteFactor {
    factor: DenseMatrix,
}

impl DefiniteFactor {
    /// Factors `A`, `d × d`, of which the lower triangle is read.
    ///
    /// # Errors
    /// [`DefiniteError`]: a matrix that is not square or not definite.
    pub fn new(mut matrix: DenseMatrix) -> Result<Self, DefiniteError> {
        let d = matrix.rows();
        check(&matrix, true, &matrix)?;
        factor(&mut matrix, par(d * d * d))?;
        Ok(Self { factor: matrix })
    }

    /// `d`.
    pub fn size(&self) -> usize {
        self.factor.rows()
    }

    /// `X ← A⁻¹ X` for `X`, `d × k`.
    ///
    /// # Errors
    /// [`DefiniteError::Shape`]; `X` is unchanged then.
    pub fn solve(&self, rhs: &mut DenseMatrix) -> Result<(), DefiniteError> {
        let (d, k) = (self.size(), rhs.columns());
        check(&self.factor, rhs.rows() == d, rhs)?;
        let par = par(d * d * k);
        let mut nothing = MemBuffer::new(solve::solve_in_place_scratch::<f64>(d, k, par));
        solve::solve_in_place(view(&self.factor), view_mut(rhs), par, MemStack::new(&mut nothing));
        Ok(())
    }
}

impl DefiniteFactor {
    /// `X ← L⁻¹ X` for `A = L Lᵀ` and `X`, `d × k`: half of [`solve`](Self::solve).
    ///
    /// # Errors
    /// [`DefiniteError::Shape`]; `X` is unchanged then.
    pub fn solve_lower(&self, rhs: &mut DenseMatrix) -> Result<(), DefiniteError> {
        check(&self.factor, rhs.rows() == self.size(), rhs)?;
        let par = par(self.size() * self.size() * rhs.columns());
        triangular_solve::solve_lower_triangular_in_place(view(&self.factor), view_mut(rhs), par);
        Ok(())
    }

    /// `X ← L⁻ᵀ X`: the other half.
    ///
    /// # Errors
    /// [`DefiniteError::Shape`]; `X` is unchanged then.
    pub fn solve_upper(&self, rhs: &mut DenseMatrix) -> Result<(), DefiniteError> {
        check(&self.factor, rhs.rows() == self.size(), rhs)?;
        let par = par(self.size() * self.size() * rhs.columns());
        triangular_solve::solve_upper_triangular_in_place(view(&self.factor).transpose(), view_mut(rhs), par);
        Ok(())
    }
}

/// Makes the columns of `X`, `d × m`, orthonormal for the inner product in which `gram`, `m × m`, holds their products:
/// `X ← X L⁻ᵀ` with `gram = L Lᵀ`, which changes each column by those before it alone.
///
/// # Errors
/// [`DefiniteError`]: sizes that do not fit, dependent columns; `X` is unchanged then.
pub fn orthonormalise(vectors: &mut DenseMatrix, mut gram: DenseMatrix) -> Result<(), DefiniteError> {
    let (d, m) = (vectors.rows(), vectors.columns());
    check(&gram, gram.rows() == m, vectors)?;
    let par = par(m * m * (d + m));
    factor(&mut gram, par)?;
    triangular_solve::solve_lower_triangular_in_place(view(&gram), view_mut(vectors).transpose_mut(), par);
    Ok(())
}

fn check(matrix: &DenseMatrix, fits: bool, other: &DenseMatrix) -> Result<(), DefiniteError> {
    let size = (matrix.rows(), matrix.columns());
    if size.0 != size.1 || !fits {
        return Err(DefiniteError::Shape { matrix: size, rows: other.rows(), columns: other.columns() });
    }
    Ok(())
}

fn factor(matrix: &mut DenseMatrix, par: Par) -> Result<(), DefiniteError> {
    let request = cholesky::cholesky_in_place_scratch::<f64>(matrix.rows(), par, Default::default());
    let mut buffer =
        MemBuffer::try_new(request).map_err(|_| DefiniteError::Memory { bytes: request.unaligned_bytes_required() })?;
    let stack = MemStack::new(&mut buffer);
    match cholesky::cholesky_in_place(view_mut(matrix), Default::default(), par, stack, Default::default()) {
        Ok(_) => Ok(()),
        Err(cholesky::LltError::NonPositivePivot { index }) => Err(DefiniteError::NotPositiveDefinite { pivot: index }),
    }
}

fn par(work: usize) -> Par {
    const LEAST_PARALLEL: usize = 1 << 22;
    if work < LEAST_PARALLEL { Par::Seq } else { Par::rayon(0) }
}

fn view(matrix: &DenseMatrix) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.values(), matrix.rows(), matrix.columns())
}

fn view_mut(matrix: &mut DenseMatrix) -> MatMut<'_, f64> {
    let (rows, columns) = (matrix.rows(), matrix.columns());
    MatMut::from_column_major_slice_mut(matrix.values_mut(), rows, columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(rows: usize, columns: usize, seed: usize) -> DenseMatrix {
        let values = (0..rows * columns).map(|i| (((i * i * 37 + seed * 11) % 1009) as f64 * 0.7).sin()).collect();
        DenseMatrix::from_columns(rows, columns, values)
    }

    fn definite(size: usize) -> DenseMatrix {
        let a = scattered(size, size, 1);
        let mut product = a.transposed_times(&a);
        (0..size).for_each(|k| product.column_mut(k)[k] += 1.0);
        product
    }

    fn distance(a: &DenseMatrix, b: &DenseMatrix) -> f64 {
        a.values().iter().zip(b.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_solution_gives_the_right_hand_side_back() {
        for (d, k) in [(1, 1), (2, 3), (40, 7), (170, 64), (5, 0)] {
            let (matrix, rhs) = (definite(d), scattered(d, k, 2));
            let mut x = rhs.clone();
            solve_definite(matrix.clone(), &mut x).unwrap();
            assert!(distance(&matrix.times(&x), &rhs) < 1e-9, "{d}×{k}");
        }
    }

    #[test]
    fn two_halves_of_a_solution_are_the_whole() {
        let (d, k) = (120, 9);
        let factor = DefiniteFactor::new(definite(d)).unwrap();
        let (mut whole, mut halves) = (scattered(d, k, 2), scattered(d, k, 2));
        factor.solve(&mut whole).unwrap();
        factor.solve_lower(&mut halves).unwrap();
        factor.solve_upper(&mut halves).unwrap();
        assert!(distance(&whole, &halves) < 1e-12);
        assert!(matches!(factor.solve_lower(&mut DenseMatrix::zeros(d + 1, 1)), Err(DefiniteError::Shape { .. })));
    }

    #[test]
    fn columns_become_orthonormal_from_the_first_on() {
        let (d, m) = (60, 25);
        let mass = definite(d);
        let mut x = scattered(d, m, 3);
        let first = x.column(0).to_vec();
        let gram = |x: &DenseMatrix| x.transposed_times(&mass.times(x));
        let before = gram(&x);
        orthonormalise(&mut x, before.clone()).unwrap();
        let after = gram(&x);
        let identity = |j: usize, i: usize| if i == j { 1.0 } else { 0.0 };
        assert!((0..m).all(|j| (0..m).all(|i| (after.column(j)[i] - identity(j, i)).abs() < 1e-9)));
        let scale = before.column(0)[0].sqrt();
        assert!(first.iter().zip(x.column(0)).all(|(a, b)| (a / scale - b).abs() < 1e-12));
    }

    #[test]
    fn what_is_not_definite_or_does_not_fit_is_told_and_changes_nothing() {
        let mut indefinite = definite(4);
        indefinite.column_mut(2)[2] = -1.0;
        let mut rhs = scattered(4, 2, 1);
        let before = rhs.clone();
        assert_eq!(solve_definite(indefinite, &mut rhs), Err(DefiniteError::NotPositiveDefinite { pivot: 2 }));
        assert!(matches!(solve_definite(definite(3), &mut rhs), Err(DefiniteError::Shape { .. })));
        assert!(matches!(
            orthonormalise(&mut rhs, DenseMatrix::zeros(2, 2)),
            Err(DefiniteError::NotPositiveDefinite { .. })
        ));
        assert!(matches!(orthonormalise(&mut rhs, definite(3)), Err(DefiniteError::Shape { .. })));
        assert_eq!(rhs, before);
    }
}
