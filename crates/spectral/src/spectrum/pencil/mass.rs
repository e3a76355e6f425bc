//! That a mass is positive definite, and how far from singular.

use chladni_algebra::{
    FactorError, MassMatrix, Ordering, SparseMatrix, SymbolicFactor, WeightedMass, fill_reducing_order,
};
use chladni_base::Monitor;

use super::{Mass, PencilError, check};
use crate::spectrum::hsim::HsimError;

/// Shares of the diagonal that are tried to lie below the mass: consistent masses of linear elements hold 1/2 and more,
/// those of a boundary less.
const SHARES: [f64; 8] = [0.45, 0.2, 0.05, 1e-2, 1e-4, 1e-6, 1e-8, 1e-11];

/// The mass of a pencil with `n` rows.
pub(super) fn checked(mass: Mass, n: usize, monitor: &dyn Monitor) -> Result<MassMatrix, PencilError> {
    match symmetric(mass, n)? {
        (Some(matrix), Some(diagonal)) => weighted(matrix, diagonal, monitor).map(MassMatrix::Weighted),
        (_, Some(diagonal)) => Ok(MassMatrix::Diagonal(diagonal)),
        (_, None) => Ok(MassMatrix::Diagonal(vec![1.0; n])),
    }
}

/// The symmetric matrix of a mass that is no diagonal, and its diagonal, which is positive; neither of the identity.
pub(super) fn symmetric(mass: Mass, n: usize) -> Result<(Option<SparseMatrix>, Option<Vec<f64>>), PencilError> {
    let misfit = |rows: usize, columns: usize| PencilError::Shape {
        matrix: "M",
        rows,
        columns,
        expected: format!("{n} × {n}, as S is"),
    };
    let matrix = match mass {
        Mass::Identity => return Ok((None, None)),
        Mass::Diagonal(diagonal) if diagonal.len() != n => return Err(misfit(diagonal.len(), diagonal.len())),
        Mass::Diagonal(diagonal) => return Ok((None, Some(positive(diagonal)?))),
        Mass::Sparse(matrix) if (matrix.rows(), matrix.columns()) != (n, n) => {
            return Err(misfit(matrix.rows(), matrix.columns()));
        }
        Mass::Sparse(matrix) => check::symmetric("M", matrix)?,
    };
    let diagonal: Vec<f64> = (0..n)
        .map(|row| {
            let (columns, values) = matrix.row(row);
            columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at])
        })
        .collect();
    let diagonal = positive(diagonal)?;
    Ok(((matrix.entries() > n).then_some(matrix), Some(diagonal)))
}

fn positive(diagonal: Vec<f64>) -> Result<Vec<f64>, PencilError> {
    for (row, &value) in diagonal.iter().enumerate() {
        if !value.is_finite() {
            return Err(PencilError::NotFinite { matrix: "M", row, column: row, value });
        }
        if value <= 0.0 {
            return Err(PencilError::NotPositive { row, value });
        }
    }
    Ok(diagonal)
}

/// The mass with its diagonal for weights: where no eigenvalue of the pencil `(M, D)` lies below a share, `D` is at
/// most `M` over that.
fn weighted(matrix: SparseMatrix, diagonal: Vec<f64>, monitor: &dyn Monitor) -> Result<WeightedMass, PencilError> {
    let failed = |error: FactorError| PencilError::from(HsimError::from(error));
    let order = fill_reducing_order(&matrix, Ordering::Amd).map_err(failed)?;
    monitor.checkpoint()?;
    let ordered = matrix.reordered(&order);
    let weights = MassMatrix::Diagonal(order.iter().map(|&row| diagonal[row as usize]).collect());
    let symbolic =
        SymbolicFactor::new(&ordered, &weights).and_then(|symbolic| symbolic.within(1, monitor)).map_err(failed)?;
    for share in SHARES {
        monitor.checkpoint()?;
        let factor = match symbolic.factor(&ordered, &weights, share) {
            Err(FactorError::Singular { .. }) => continue,
            factor => factor.map_err(failed)?,
        };
        let least = share - factor.uncertainty(&ordered, &weights, share);
        if factor.eigenvalues_below() == 0 && least > 0.0 {
            return Ok(WeightedMass { matrix, weights: diagonal, ratio: least.recip() });
        }
    }
    let pivot = match symbolic.factor(&ordered, &weights, 0.0) {
        Err(FactorError::Singular { pivot }) => Some(pivot),
        factor => factor.map_err(failed)?.first_below(),
    };
    Err(pivot
        .and_then(|pivot| order.get(pivot))
        .map_or(PencilError::NearlySingular, |&row| PencilError::NotDefinite { row: row as usize }))
}
