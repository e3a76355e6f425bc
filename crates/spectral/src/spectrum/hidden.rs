//! Eigenfunctions that a space does not know of at all.
//!
//! One that lives on a limb which the columns are too coarse for may have its Ritz value a third too high, beyond all
//! pairs that are computed: every estimate is small, and every pair above it is one place too low. An inertia count
//! says so. Where such functions live is seen from random functions, damped above the shift: what the space does not
//! hold of them is little but where it lacks an eigenfunction.

use super::error::ApproximationError;
use super::shifted::ShiftedPencil;
use crate::operator::EigenProblem;
use chladni_algebra::{
    DenseMatrix, PANEL_WIDTH, SparseMatrix, mass_times_panel, solve_definite, space_times, space_transposed_mass_times,
};
use chladni_base::{Monitor, SplitMix64};

/// Estimates may be wrong by this factor before they make a count ambiguous.
const DOUBT: f64 = 3.0;

/// Random functions are multiplied by `(μ / (λ + μ))` so often, μ the shift: 64 times less at the shift, 2,000 at two
/// and a half times that.
const DAMPINGS: usize = 6;

/// What a space lacks.
#[derive(Debug, Clone, Default)]
pub(super) struct Hidden {
    /// Exact eigenvalues below the shift, less the Ritz values that stand for one.
    pub count: usize,
    /// Where their energy sits that the space does not hold, one number a row; nothing where that could not be
    /// computed.
    pub density: Option<Vec<f64>>,
}

/// Where to count: the shift, and how many eigenvalues may lie below it if none is hidden. `ritz` ascends, `errors` are
/// estimates, the last of `count` pairs is to lie below the shift.
fn place(ritz: &[f64], errors: &[f64], count: usize) -> Option<(f64, usize)> {
    let last = count.checked_sub(1)?;
    let most = ritz.len().min(errors.len()).checked_sub(1)?;
    // Behind the last pair, the widest gap that no exact value is likely to lie in.
    let gap = |k: &usize| ritz[*k + 1] - DOUBT * errors[*k + 1] - ritz[*k];
    let width = (count / 10).max(4);
    let place = (last..most.min(last + width)).max_by(|a, b| gap(a).total_cmp(&gap(b)))?;
    let shift = if gap(&place) > 0.0 { ritz[place] + 0.5 * gap(&place) } else { ritz[place] * (1.0 + 1e-9) };
    let expected = ritz.iter().zip(errors).filter(|&(value, error)| value - DOUBT * error <= shift).count();
    Some((shift, expected))
}

/// Counts the eigenvalues below about the last of `count` pairs. Nothing where no more are there than the Ritz values
/// `ritz` with their estimated `errors` stand for, or where no count can be trusted; else what `space`, whose
/// restricted mass matrix is `reduced`, lacks. `floor` is a lower bound on the eigenvalues.
///
/// # Errors
/// [`ApproximationError::Cancelled`]. A matrix that cannot be factored gives no count: the pairs are no worse for it.
pub(super) fn hidden(
    (problem, floor): (&EigenProblem, f64),
    space: &SparseMatrix<f32>,
    reduced: &SparseMatrix,
    (ritz, errors): (&[f64], &[f64]),
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Option<Hidden>, ApproximationError> {
    let Some((shift, expected)) = place(ritz, errors, count) else { return Ok(None) };
    let pencil = match ShiftedPencil::new(problem, monitor) {
        Ok(pencil) => pencil,
        Err(ApproximationError::Cancelled(cancelled)) => return Err(cancelled.into()),
        Err(_) => return Ok(None),
    };
    let Ok((found, radius)) = pencil.count(shift) else { return Ok(None) };
    // A count whose rounding errors reach the next values says nothing.
    if found <= expected || !(radius < 1e-3 * shift.abs()) {
        return Ok(None);
    }
    monitor.checkpoint()?;
    let damping = (shift - floor.min(0.0)).abs().max(f64::MIN_POSITIVE);
    // What was counted stands, whether or not it can be said where.
    let nowhere = Ok(Some(Hidden { count: found - expected, density: None }));
    let Ok(factor) = pencil.factor(-damping + floor.min(0.0)) else { return nowhere };
    let n = problem.size();
    let mut random = SplitMix64::new(1);
    let mut panel: Vec<f64> = (0..n * PANEL_WIDTH).map(|_| random.signed_unit()).collect();
    let mut image = vec![0.0; panel.len()];
    for _ in 0..DAMPINGS {
        mass_times_panel(&pencil.mass, &panel, &mut image);
        panel.iter_mut().zip(&image).for_each(|(x, image)| *x = damping * image);
        factor.solve_panel(&mut panel);
        monitor.checkpoint()?;
    }
    let mut functions = DenseMatrix::zeros(n, PANEL_WIDTH);
    for column in 0..PANEL_WIDTH {
        let to = functions.column_mut(column);
        pencil
            .order
            .iter()
            .enumerate()
            .for_each(|(row, &place)| to[place as usize] = panel[row * PANEL_WIDTH + column]);
    }
    let mut projection = space_transposed_mass_times(space, &problem.mass, &functions);
    if solve_definite(reduced.to_dense(), &mut projection).is_err() {
        return nowhere;
    }
    let held = space_times(space, &projection);
    functions.values_mut().iter_mut().zip(held.values()).for_each(|(x, held)| *x -= held);
    let density = (0..n)
        .map(|row| {
            let (columns, values) = problem.stiffness.row(row);
            let energy = |function: &[f64]| -> f64 {
                let differences = columns.iter().map(|&column| function[row] - function[column as usize]);
                differences.zip(values).map(|(d, value)| 0.5 * value.abs() * d * d).sum()
            };
            (0..PANEL_WIDTH).map(|column| energy(functions.column(column))).sum()
        })
        .collect();
    Ok(Some(Hidden { count: found - expected, density: Some(density) }))
}

#[cfg(test)]
#[path = "hidden_tests.rs"]
mod tests;
