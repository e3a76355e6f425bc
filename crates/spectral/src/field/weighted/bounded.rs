//! What has no energy where a sparse factor does not know it, and is to be no longer than it may.

use chladni_algebra::dot_in_order;

use super::super::constraints::Condition;
use super::super::idle::Idle;
use super::{LONGEST_IDLE, WeightedModel, norm, times};

impl WeightedModel {
    /// The fields of next to no energy, where a sparse factor was solved with that does not know them, and where there
    /// is more of them in a field than conditions may ask for. They are looked for where the field is as long as that.
    pub(super) fn too_long(&self, conditions: &[Condition], field: &[f64]) -> Option<&[Idle]> {
        let pencil = self.pencil.as_ref()?;
        let most = LONGEST_IDLE * conditions.iter().map(|c| norm(&c.value)).fold(0.0, f64::max);
        let square: f64 = times(&pencil.mass, field).iter().zip(field).map(|(a, b)| a * b).sum();
        if square <= most * most {
            return None;
        }
        let idle = self.idle()?;
        let amounts: Vec<f64> = idle.iter().map(|one| dot_in_order(&one.image, field)).collect();
        (norm(&amounts) > most).then_some(idle)
    }
}
