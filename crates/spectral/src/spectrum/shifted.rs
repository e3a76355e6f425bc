//! A pencil in a fill-reducing order, ready to be factored at any shift.

use super::error::ApproximationError;
use crate::operator::EigenProblem;
use chladni_algebra::{Factor, FactorError, MassMatrix, Ordering, SparseMatrix, SymbolicFactor, fill_reducing_order};
use chladni_base::Monitor;

/// See the module.
pub(super) struct ShiftedPencil {
    /// Which row of the problem each row is.
    pub order: Vec<u32>,
    /// `S` in that order.
    pub stiffness: SparseMatrix,
    /// `M` in that order.
    pub mass: MassMatrix,
    symbolic: SymbolicFactor,
}

impl ShiftedPencil {
    /// Orders the pencil of `problem` and analyses it.
    ///
    /// # Errors
    /// [`ApproximationError::Memory`] where a factor would take more than was promised, [`ApproximationError::Factor`],
    /// [`ApproximationError::Cancelled`].
    pub fn new(problem: &EigenProblem, monitor: &dyn Monitor) -> Result<Self, ApproximationError> {
        let order = fill_reducing_order(&problem.stiffness, Ordering::Amd).map_err(failed)?;
        monitor.checkpoint()?;
        let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
        monitor.checkpoint()?;
        let symbolic =
            SymbolicFactor::new(&stiffness, &mass).and_then(|symbolic| symbolic.within(1, monitor)).map_err(failed)?;
        Ok(Self { order, stiffness, mass, symbolic })
    }

    /// Factors `S − shift · M`.
    ///
    /// # Errors
    /// [`ApproximationError::Factor`], [`ApproximationError::Memory`].
    pub fn factor(&self, shift: f64) -> Result<Factor<'_>, ApproximationError> {
        self.symbolic.factor(&self.stiffness, &self.mass, shift).map_err(failed)
    }

    /// How many eigenvalues were counted below a shift, and how far from it an eigenvalue may lie that rounding has put
    /// on the other side.
    ///
    /// # Errors
    /// As [`factor`](Self::factor).
    pub fn count(&self, shift: f64) -> Result<(usize, f64), ApproximationError> {
        let factor = self.factor(shift)?;
        Ok((factor.eigenvalues_below(), factor.uncertainty(&self.stiffness, &self.mass, shift)))
    }
}

fn failed(error: FactorError) -> ApproximationError {
    match error {
        FactorError::Promise { .. } => ApproximationError::Memory(error.to_string()),
        other => ApproximationError::Factor(other.to_string()),
    }
}
