//! The lowest pairs of one dense symmetric matrix: the eigenproblem without a second matrix.

use chladni_base::Monitor;

use super::eigen::{check_finite, make_largest_positive, parallelism, standard_lowest};
use super::{ComputedOn, DenseMatrix, EigenError, EigenPairs};

/// The `count` lowest pairs of a symmetric matrix, `d × d`, of which the lower triangle is read. Against a pencil with
/// the identity this saves a Cholesky factor, the reduction by it and the way back, about half of the time where few
/// pairs are wanted. On the threads of the pool it is called from.
///
/// # Errors
/// [`EigenError`]: a matrix that is not square or not finite, more pairs than it has, no convergence, cancellation.
pub fn lowest_symmetric(matrix: DenseMatrix, count: usize, monitor: &dyn Monitor) -> Result<EigenPairs, EigenError> {
    let d = matrix.rows();
    if matrix.columns() != d {
        return Err(EigenError::Shape { a: (d, matrix.columns()), b: (d, d) });
    }
    if count > d {
        return Err(EigenError::Count { count, size: d });
    }
    check_finite('A', &matrix)?;
    if count == 0 {
        let vectors = DenseMatrix::zeros(d, 0);
        return Ok(EigenPairs { values: Vec::new(), vectors, computed_on: ComputedOn::Cpu });
    }
    let (values, mut vectors) = standard_lowest(matrix, count, parallelism(d), monitor)?;
    (0..vectors.columns()).for_each(|column| make_largest_positive(vectors.column_mut(column)));
    Ok(EigenPairs { values, vectors, computed_on: ComputedOn::Cpu })
}

#[cfg(test)]
mod tests {
    use super::super::{CpuSolver, SymmetricDefiniteSolver};
    use super::*;
    use chladni_base::Unwatched;

    /// A symmetric matrix with every eigenvalue `k / 3` (integer division): all three times.
    fn with_triples(d: usize) -> DenseMatrix {
        let mut matrix = DenseMatrix::zeros(d, d);
        (0..d).for_each(|k| matrix.column_mut(k)[k] = (k / 3) as f64);
        // Reflections I − 2 v vᵀ keep eigenvalues and fill the matrix.
        for turn in 0..3 {
            let v: Vec<f64> = (0..d).map(|i| ((i * i + 7 * turn + 3) as f64 * 0.37).sin()).collect();
            let square: f64 = v.iter().map(|x| x * x).sum();
            let w: Vec<f64> = (0..d).map(|i| (0..d).map(|j| matrix.column(j)[i] * v[j]).sum()).collect();
            let middle: f64 = v.iter().zip(&w).map(|(a, b)| a * b).sum();
            for j in 0..d {
                for i in 0..d {
                    let change =
                        -2.0 * (v[i] * w[j] + w[i] * v[j]) / square + 4.0 * middle * v[i] * v[j] / (square * square);
                    matrix.column_mut(j)[i] += change;
                }
            }
        }
        matrix
    }

    #[test]
    fn pairs_are_those_of_the_pencil_with_the_identity_multiplets_included() {
        for (d, count) in [(1, 1), (2, 2), (40, 7), (300, 50), (300, 300), (9, 0)] {
            let matrix = with_triples(d);
            let mut identity = DenseMatrix::zeros(d, d);
            (0..d).for_each(|k| identity.column_mut(k)[k] = 1.0);
            let expected = CpuSolver.lowest(matrix.clone(), identity, count, &Unwatched).unwrap();
            let found = lowest_symmetric(matrix.clone(), count, &Unwatched).unwrap();
            assert_eq!((found.vectors.rows(), found.vectors.columns()), (d, count));
            for k in 0..count {
                assert!((found.values[k] - (k / 3) as f64).abs() < 1e-11 * d as f64, "{k} of {d}");
                assert!((found.values[k] - expected.values[k]).abs() < 1e-11 * d as f64);
            }
            let image = matrix.times(&found.vectors);
            let gram = found.vectors.transposed_times(&found.vectors);
            for k in 0..count {
                let pairs = image.column(k).iter().zip(found.vectors.column(k));
                assert!(pairs.map(|(a, x)| (a - found.values[k] * x).abs()).fold(0.0, f64::max) < 1e-11 * d as f64);
                let one = |j: usize| if j == k { 1.0 } else { 0.0 };
                assert!((0..count).all(|j| (gram.column(k)[j] - one(j)).abs() < 1e-12));
            }
        }
    }

    #[test]
    fn what_has_no_such_pairs_is_named() {
        let error = |matrix: DenseMatrix, count| lowest_symmetric(matrix, count, &Unwatched).unwrap_err();
        assert!(matches!(error(DenseMatrix::zeros(3, 2), 1), EigenError::Shape { .. }));
        assert_eq!(error(DenseMatrix::zeros(3, 3), 4), EigenError::Count { count: 4, size: 3 });
        let mut matrix = DenseMatrix::zeros(3, 3);
        matrix.column_mut(1)[2] = f64::NAN;
        assert_eq!(error(matrix, 1), EigenError::NotFinite { matrix: 'A', row: 2, column: 1 });
    }
}
