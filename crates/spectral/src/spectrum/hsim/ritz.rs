//! The small dense eigenproblem of Rayleigh and Ritz.

use chladni_algebra::{CpuSolver, DenseMatrix, EigenError, SymmetricDefiniteSolver, gpu};
use chladni_base::{Monitor, Quiet, Unwatched};

use super::HsimError;

/// Directions whose share of the largest is below this are dependent on the others as far as rounding lets one tell.
const DEPENDENT: f64 = 1e-13;

/// The `count` lowest Ritz pairs of `K z = θ G z`: values ascending and `G`-orthonormal vectors, `q × count`; fewer
/// where the columns that `G` is the Gram matrix of are dependent.
pub(super) fn ritz(
    stiffness: DenseMatrix,
    gram: DenseMatrix,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, DenseMatrix), HsimError> {
    // The stages of the dense solver are no stages of the caller; it still has to stop when it is told to.
    monitor.checkpoint()?;
    match gpu::accelerator().lowest(stiffness.clone(), gram.clone(), count, &Quiet(monitor)) {
        Ok(pairs) => Ok((pairs.values, pairs.vectors)),
        Err(EigenError::NotPositiveDefinite { .. }) => truncated(&stiffness, &gram, count),
        Err(error) => Err(error.into()),
    }
}

/// The same in the span of the directions that are clearly there.
fn truncated(stiffness: &DenseMatrix, gram: &DenseMatrix, count: usize) -> Result<(Vec<f64>, DenseMatrix), HsimError> {
    let q = gram.rows();
    let failed = |error: EigenError| HsimError::Numerical(error.to_string());
    let scales: Vec<f64> =
        (0..q).map(|k| gram.column(k)[k]).map(|g| if g > 0.0 { g.sqrt().recip() } else { 0.0 }).collect();
    let mut scaled = gram.clone();
    for column in 0..q {
        let factor = scales[column];
        scaled.column_mut(column).iter_mut().zip(&scales).for_each(|(g, scale)| *g *= scale * factor);
    }
    let mut identity = DenseMatrix::zeros(q, q);
    (0..q).for_each(|k| identity.column_mut(k)[k] = 1.0);
    let directions = CpuSolver.lowest(scaled, identity, q, &Unwatched).map_err(failed)?;
    let largest = directions.values.last().copied().unwrap_or(0.0);
    let from = directions.values.partition_point(|&value| !(value > DEPENDENT * largest));
    let mut basis = directions.vectors.slice_columns(from..q);
    for (k, value) in directions.values[from..].iter().enumerate() {
        let column = basis.column_mut(k);
        column.iter_mut().zip(&scales).for_each(|(x, scale)| *x *= scale / value.sqrt());
    }
    let within = |matrix: &DenseMatrix| basis.transposed_times(&matrix.times(&basis));
    let (stiffness, gram) = (within(stiffness), within(gram));
    let count = count.min(basis.columns());
    let pairs = CpuSolver.lowest(stiffness, gram, count, &Unwatched).map_err(failed)?;
    Ok((pairs.values, basis.times(&pairs.vectors)))
}
