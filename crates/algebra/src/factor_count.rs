//! Counting eigenvalues below a shift by a factor that is not kept.

use super::factor::{FactorError, LARGEST_GROWTH, SymbolicFactor};
use super::factor_error::{enclosed, row_error};
use super::multifrontal::{self, RowErrors};
use super::{MassMatrix, SparseMatrix};
use chladni_base::{Monitor, Unwatched};

/// How many eigenvalues lie below a shift, and how far that can be trusted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EigenvalueCount {
    /// [`Factor::eigenvalues_below`](super::Factor::eigenvalues_below).
    pub below: usize,
    /// [`Factor::uncertainty`](super::Factor::uncertainty), in the units of the shift.
    pub uncertainty: f64,
}

impl SymbolicFactor {
    /// What the [factor](Self::factor) of `a − shift · b` says about eigenvalues, without keeping it: each of its
    /// columns is dropped once it was eliminated, so that this takes a small part of the memory. Where pivots are
    /// needed it takes all of that of a factor.
    ///
    /// # Errors
    /// As for [`factor`](Self::factor).
    pub fn count(&self, a: &SparseMatrix, b: &MassMatrix, shift: f64) -> Result<EigenvalueCount, FactorError> {
        self.count_watched(a, b, shift, &Unwatched)
    }

    /// The same, given up within a supernode where the monitor asks for it, unless pivots are needed.
    ///
    /// # Errors
    /// As for [`factor_watched`](Self::factor_watched).
    pub fn count_watched(
        &self,
        a: &SparseMatrix,
        b: &MassMatrix,
        shift: f64,
        monitor: &dyn Monitor,
    ) -> Result<EigenvalueCount, FactorError> {
        if let Some(plan) = &self.plan {
            let (shifted, largest) = self.shifted(a, b, shift);
            let ratio = row_error(a, b, shift);
            let errors = RowErrors { terms: self.terms(), ratio: &ratio };
            let found = multifrontal::count(self, plan, &shifted, &errors, monitor);
            monitor.checkpoint()?;
            if let Some(found) = found.ok().filter(|found| found.growth <= LARGEST_GROWTH * largest) {
                return Ok(EigenvalueCount { below: found.below, uncertainty: enclosed(b, found.error) });
            }
        }
        let factor = self.factor_watched(a, b, shift, Vec::new(), monitor)?;
        Ok(EigenvalueCount { below: factor.eigenvalues_below(), uncertainty: factor.uncertainty(a, b, shift) })
    }

    /// How many entries each row of `L` has.
    pub(super) fn terms(&self) -> &[u32] {
        self.terms.get_or_init(|| {
            let mut terms = vec![0u32; self.size()];
            for node in &self.nodes {
                let own = terms[node.start..node.start + node.columns].iter_mut();
                own.enumerate().for_each(|(k, terms)| *terms += k as u32 + 1);
                let below = &self.patterns[node.pattern.0..node.pattern.0 + node.pattern.1];
                below.iter().for_each(|&row| terms[row as usize] += node.columns as u32);
            }
            terms
        })
    }
}
