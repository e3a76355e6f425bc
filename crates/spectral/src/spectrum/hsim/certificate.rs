//! What is proven about eigenpairs, as it goes with a basis.

use std::mem::take;

use super::{Eigenpairs, HsimError, Selection};
use crate::basis::{Certificate, Interval, completeness};

impl Eigenpairs {
    /// Takes what is known of the pairs out of them: residuals, bounds, counts and levels. `wanted` and `tolerance` are
    /// what the pairs were asked for by, in the units of the values.
    ///
    /// # Errors
    /// [`HsimError::Unproven`] where the counts do not cover the pairs.
    pub fn take_certificate(&mut self, wanted: Selection, tolerance: f64) -> Result<Certificate, HsimError> {
        let complete = completeness(self.first, &self.values, &self.inertia);
        if complete != Some(true) {
            let reason = "the inertia counts do not cover the pairs".to_owned();
            return Err(HsimError::Unproven { reason });
        }
        let bounds = match wanted {
            Selection::Count(_) => None,
            Selection::Below { bound, .. } => Some((None, bound)),
            Selection::Between { from, to, .. } => Some((Some(from), to)),
        };
        Ok(Certificate {
            complete,
            residuals: take(&mut self.residuals),
            bounds: take(&mut self.bounds),
            orthonormality_defect: self.orthonormality_defect,
            inertia: take(&mut self.inertia),
            first: self.first,
            interval: bounds.map(|(from, to)| Interval { from, to, on_bounds: take(&mut self.on_bounds) }),
            cut: self.cut,
            tolerance: Some(tolerance),
            levels: take(&mut self.levels),
            ..Certificate::default()
        })
    }
}
