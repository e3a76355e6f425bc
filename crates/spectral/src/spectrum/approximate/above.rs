//! A potential that is positive everywhere, or far below zero: its least value moves all eigenvalues and changes no
//! eigenfunction.
//!
//! It is taken off before anything is approximated. What pairs miss, and what is asked of them, is then relative to
//! what tells them apart: beside a large constant, every function is an eigenfunction to many digits.

use std::borrow::Cow;

use chladni_algebra::{PANEL_WIDTH, PanelMatrix, prolong, residual_sums};
use chladni_base::{Cancelled, Monitor};

use crate::basis::{Basis, Functions};
use crate::operator::MeshOperator;
use crate::spectrum::certificate::LARGEST_KERNEL_VALUE;
use crate::spectrum::hsim::taken_off;

/// The operator without the largest multiple of the mass that leaves no row with a negative sum, and that multiple, on
/// unit size; itself where that is not taken off.
pub(super) fn without_offset(operator: &MeshOperator) -> (Cow<'_, MeshOperator>, f64) {
    // A Laplacian has rows that sum to zero.
    let found =
        if operator.is_laplacian() { None } else { taken_off(&operator.problem.stiffness, &operator.problem.mass) };
    match found {
        Some((stiffness, offset)) => (Cow::Owned(operator.with_stiffness(stiffness)), offset),
        None => (Cow::Borrowed(operator), 0.0),
    }
}

/// Makes pairs of the operator without the offset those of the operator: values and the shifts of counts move, and
/// residuals are relative to `‖S x‖` again.
///
/// # Errors
/// The monitor asked to stop.
pub(super) fn move_back(
    basis: &mut Basis,
    operator: &MeshOperator,
    offset: f64,
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let problem = &operator.problem;
    let by = offset / problem.area;
    basis.eigenvalues.iter_mut().for_each(|value| *value += by);
    basis.certificate.inertia.iter_mut().for_each(|count| count.shift += by);
    // Entries of the matrix and sums were rounded.
    basis.certificate.bounds.iter_mut().for_each(|bound| *bound += ROUNDINGS * f64::EPSILON * by.abs());
    let Functions::Compact(compact) = &basis.functions else { return Ok(()) };
    let space = match &problem.unknowns {
        Some(unknowns) => Cow::Owned(compact.space.select_rows(unknowns)),
        None => Cow::Borrowed(&compact.space),
    };
    for (first, values) in basis.eigenvalues.chunks(PANEL_WIDTH).enumerate() {
        let from = first * PANEL_WIDTH;
        let coefficients = compact.coefficients.slice_columns(from..from + values.len());
        let block = prolong(&space, &PanelMatrix::from_dense(&coefficients));
        let values: Vec<f64> = values.iter().map(|value| value * problem.area).collect();
        let sums = residual_sums(&problem.stiffness, &problem.mass, &block, &values, monitor)?;
        for ((residual, sums), value) in basis.certificate.residuals[from..].iter_mut().zip(sums).zip(values) {
            if value.abs() > LARGEST_KERNEL_VALUE {
                *residual = if sums.residual == 0.0 { 0.0 } else { (sums.residual / sums.stiffness).sqrt() };
            }
        }
    }
    Ok(())
}

/// How many roundings, relative to the offset, lie between a value of the one operator and that of the other: the
/// product of mass and offset, the difference of entries, and the sum of values, with some to spare.
const ROUNDINGS: f64 = 8.0;

#[cfg(test)]
#[path = "above_tests.rs"]
mod tests;
