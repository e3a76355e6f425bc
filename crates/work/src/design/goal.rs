//! What a design is drawn to as a whole.

use std::sync::Arc;

use chladni_spectral::field::{Alignment, Prescription};

use super::DesignRequest;

/// What a field is drawn to as a whole: by which weight, and to what.
#[derive(Debug, Clone, Default)]
pub struct Goal {
    /// Another field.
    pub alignment: Option<(Arc<Alignment>, f64)>,
    /// The smoothest field of prescribed singularities; without a weight, by the one that it is met to a percent with.
    pub prescription: Option<(Arc<Prescription>, Option<f64>)>,
}

impl Goal {
    /// The prescription whose field itself a request asks for.
    pub fn exact(&self, request: &DesignRequest) -> Option<ExactGoal> {
        let wanted = request.singularities.as_ref().is_some_and(|wanted| wanted.exact);
        let (prescription, _) = self.prescription.as_ref().filter(|_| wanted)?;
        let alignment = self.alignment.iter().filter(|alignment| alignment.1 > 0.0).cloned().collect();
        Some(ExactGoal { prescription: prescription.clone(), alignment })
    }
}

/// A field of exactly the prescribed singularities, and what it is turned to where no stroke says so.
#[derive(Debug, Clone)]
pub struct ExactGoal {
    pub(super) prescription: Arc<Prescription>,
    pub(super) alignment: Vec<(Arc<Alignment>, f64)>,
}
