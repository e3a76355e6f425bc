//! The orthogonal factor of a square matrix.

use faer::dyn_stack::MemStack;
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};

use super::dense::{view, view_mut};
use super::eigen::{check_all_finite, parallelism};
use super::eigen_error::memory;
use super::{DenseMatrix, EigenError};

/// The orthogonal matrix that is closest to a square one, `Q = U Vᵀ` of `A = U Σ Vᵀ`: it has the least `‖A − Q‖` in the
/// Frobenius norm, and `A = Q P` with a `P` that is symmetric and positive semidefinite (the polar decomposition).
/// Where `A` is singular there are several, and one of them is given. On the threads of the pool it is called from.
///
/// # Errors
/// [`EigenError`]: a matrix that is not square or not finite, no convergence, no memory.
pub fn nearest_orthogonal(matrix: &DenseMatrix) -> Result<DenseMatrix, EigenError> {
    let d = matrix.rows();
    if matrix.columns() != d {
        return Err(EigenError::Shape { a: (d, matrix.columns()), b: (d, d) });
    }
    check_all_finite('A', matrix)?;
    let (mut values, mut left, mut right) =
        (faer::diag::Diag::<f64>::zeros(d), DenseMatrix::zeros(d, d), DenseMatrix::zeros(d, d));
    let (par, both) = (parallelism(d), ComputeSvdVectors::Thin);
    let mut buffer = memory(svd_scratch::<f64>(d, d, both, both, par, Default::default()))?;
    svd(
        view(matrix),
        values.as_mut(),
        Some(view_mut(&mut left)),
        Some(view_mut(&mut right)),
        par,
        MemStack::new(&mut buffer),
        Default::default(),
    )
    .map_err(|_| EigenError::NoConvergence)?;
    Ok(left.times(&right.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    fn random(d: usize, seed: u64) -> DenseMatrix {
        let mut random = SplitMix64::new(seed);
        DenseMatrix::from_columns(d, d, (0..d * d).map(|_| random.signed_unit()).collect())
    }

    /// The largest entry of `QᵀQ − I`.
    fn defect(q: &DenseMatrix) -> f64 {
        let gram = q.transposed_times(q);
        let one = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let each = |j: usize| gram.column(j).iter().enumerate().map(move |(i, x)| (x - one(i, j)).abs());
        (0..q.columns()).flat_map(each).fold(0.0, f64::max)
    }

    #[test]
    fn the_other_factor_is_symmetric_and_positive() {
        for d in [1, 2, 3, 10, 64, 300] {
            let a = random(d, d as u64);
            let q = nearest_orthogonal(&a).unwrap();
            assert!(defect(&q) < 1e-12, "{d}");
            let p = q.transposed_times(&a);
            let mirrored = p.transpose();
            assert!(p.values().iter().zip(mirrored.values()).all(|(x, y)| (x - y).abs() < 1e-11), "{d}");
            let values = crate::lowest_symmetric(p, d, &chladni_base::Unwatched).unwrap().values;
            assert!(values[0] > -1e-12 * d as f64, "{d}: {}", values[0]);
        }
    }

    #[test]
    fn an_orthogonal_matrix_is_its_own_and_signs_are_kept() {
        for d in [1, 2, 5, 40, 200] {
            let q = nearest_orthogonal(&random(d, 7)).unwrap();
            let again = nearest_orthogonal(&q).unwrap();
            assert!(q.values().iter().zip(again.values()).all(|(x, y)| (x - y).abs() < 1e-12), "{d}");
        }
        let signs = DenseMatrix::from_columns(2, 2, vec![-3.0, 0.0, 0.0, 1e-9]);
        assert_eq!(
            nearest_orthogonal(&signs).unwrap().values().iter().map(|x| x.round()).collect::<Vec<_>>(),
            [-1.0, 0.0, 0.0, 1.0]
        );
    }

    #[test]
    fn of_a_singular_matrix_one_of_several_is_given() {
        let mut half = random(20, 3);
        (10..20).for_each(|column| half.column_mut(column).fill(0.0));
        for a in [DenseMatrix::zeros(6, 6), half, DenseMatrix::zeros(0, 0)] {
            let q = nearest_orthogonal(&a).unwrap();
            assert_eq!((q.rows(), q.columns()), (a.rows(), a.columns()));
            assert!(defect(&q) < 1e-12);
        }
    }

    #[test]
    fn what_has_none_is_named() {
        assert!(matches!(nearest_orthogonal(&DenseMatrix::zeros(3, 2)), Err(EigenError::Shape { .. })));
        let mut a = DenseMatrix::zeros(3, 3);
        a.column_mut(2)[1] = f64::INFINITY;
        assert_eq!(nearest_orthogonal(&a), Err(EigenError::NotFinite { matrix: 'A', row: 1, column: 2 }));
    }
}
