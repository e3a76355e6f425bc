//! Projecting functions onto a basis and putting them together again.

use chladni_algebra::DenseMatrix;

use crate::basis::{Basis, BasisError};

/// What is left of functions in a basis.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// `ΦᵀM x`, a row for each mode that was used.
    pub coefficients: DenseMatrix,
    /// Per function `‖x − ΦΦᵀM x‖_M / ‖x‖_M`; 0 for the function that is zero.
    pub relative_errors: Vec<f64>,
    /// `ΦΦᵀM x`, `n × k`.
    pub reconstruction: DenseMatrix,
}

/// Projects `k` functions, `n × k`, onto the first `pairs` modes, and measures what was lost.
///
/// # Errors
/// [`BasisError::Modes`] where there are fewer; [`BasisError::Rows`] unless there is a row for each vertex;
/// [`BasisError::Unavailable`].
pub fn project(basis: &Basis, functions: &DenseMatrix, pairs: usize) -> Result<Projection, BasisError> {
    let count = basis.count();
    if !(1..=count).contains(&pairs) {
        return Err(BasisError::Modes { from: 0, to: pairs, count });
    }
    let kept: Vec<f64> = (0..count).map(|mode| if mode < pairs { 1.0 } else { 0.0 }).collect();
    let (coefficients, reconstruction) = basis.apply_diagonal(functions, &kept)?;
    let coefficients = first_rows(coefficients, pairs);
    let mut lost = functions.clone();
    lost.values_mut().iter_mut().zip(reconstruction.values()).for_each(|(x, y)| *x -= y);
    let relative_errors = basis
        .norms(&lost)?
        .iter()
        .zip(basis.norms(functions)?)
        .map(|(lost, whole)| if *lost == 0.0 { 0.0 } else { lost / whole })
        .collect();
    Ok(Projection { coefficients, relative_errors, reconstruction })
}

fn first_rows(matrix: DenseMatrix, rows: usize) -> DenseMatrix {
    if rows == matrix.rows() {
        return matrix;
    }
    let mut first = DenseMatrix::zeros(rows, matrix.columns());
    (0..matrix.columns()).for_each(|column| first.column_mut(column).copy_from_slice(&matrix.column(column)[..rows]));
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::{Certificate, Compact, Functions};
    use chladni_algebra::{MassMatrix, SparseMatrix};

    /// Four points of masses 1 to 4; the first two indicator functions, normalised.
    fn basis() -> Basis {
        Basis {
            functions: Functions::Compact(Compact::new(
                SparseMatrix::new(4, 2, vec![0, 1, 2, 2, 2], vec![0, 1], vec![1.0, 1.0]).unwrap(),
                DenseMatrix::from_columns(2, 2, vec![1.0, 0.0, 0.0, 0.5f64.sqrt()]),
            )),
            eigenvalues: vec![0.0, 1.0],
            mass: MassMatrix::Diagonal(vec![1.0, 2.0, 3.0, 4.0]),
            certificate: Certificate::default(),
            metadata: serde_json::Value::Null.into(),
        }
    }

    #[test]
    fn what_lies_in_the_basis_is_kept_and_the_rest_measured() {
        let functions = vec![3.0, -1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let x = DenseMatrix::from_columns(4, 3, functions);
        let found = project(&basis(), &x, 2).unwrap();
        assert!(found.relative_errors[0] < 1e-15);
        assert!((found.relative_errors[1] - 0.7f64.sqrt()).abs() < 1e-15);
        assert_eq!(found.relative_errors[2], 0.0);
        assert!((found.coefficients.column(0)[1] + 2.0f64.sqrt()).abs() < 1e-15);
        let kept = [[3.0, -1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [0.0; 4]];
        let close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-15;
        assert!(found.reconstruction.values().iter().zip(kept.as_flattened()).all(close));
        assert!(project(&basis(), &DenseMatrix::zeros(3, 1), 2).is_err());
    }
}
