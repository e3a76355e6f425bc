//! What designs among all fields of a surface take from a model of a reduced space.

use super::super::alignment::Alignment;
use super::super::compliance::Compliance;
use super::super::constraints::{Condition, check, conditions, without_repetitions};
use super::super::design::{Constraint, DesignError};
use super::super::refine_response::{Sum, add, dot};
use super::WeightedModel;
use crate::basis::{FieldBasis, FieldMisfit};

impl WeightedModel {
    /// Fields of next to no energy, as they are stored; `None` where alignments hold them and the model does not know
    /// them.
    ///
    /// # Errors
    /// [`FieldMisfit`] where the basis is not that of the model.
    pub(in super::super) fn idle_fields(&self, basis: &FieldBasis) -> Result<Option<Vec<Vec<f64>>>, FieldMisfit> {
        let model = &self.model;
        let coefficients: Vec<Vec<f32>> = if model.has_ritz() {
            let least = model.least_value();
            let count = model.values().iter().take_while(|v| **v <= least).count();
            (0..count).map(|k| model.eigenfield(k)).collect()
        } else if self.alignments.is_empty() {
            let Some(idle) = self.idle() else { return Ok(None) };
            idle.iter().map(|one| one.field.iter().map(|&x| x as f32).collect()).collect()
        } else {
            return Ok(None);
        };
        let wide = |field: Vec<f32>| field.into_iter().map(f64::from).collect();
        coefficients.iter().map(|own| basis.space.lift(own).map(wide)).collect::<Result<_, _>>().map(Some)
    }

    /// What the energies add up to on the faces, and what alignments pull with there.
    pub(in super::super) fn whole_sum(&self, numbers: usize) -> (Sum, Option<Vec<f64>>) {
        let mut sum =
            Sum { harmonic: self.weights.harmonic, biharmonic: self.weights.biharmonic, uniform: 0.0, masses: None };
        let mut force = None;
        for (field, weight) in &self.alignments {
            let force = force.get_or_insert_with(|| vec![0.0; numbers]);
            add(force, &field.force, *weight);
            match &field.masses {
                Some(masses) => add(sum.masses.get_or_insert_with(|| vec![0.0; masses.len()]), masses, *weight),
                None => sum.uniform += weight,
            }
        }
        (sum, force)
    }

    /// How far a field on the faces is from those that it is to stay close to.
    pub(in super::super) fn whole_deviation(&self, field: &[f64], areas: &[f64]) -> Option<f64> {
        let b = field.len() / areas.len().max(1);
        let one = |alignment: &Alignment| {
            let masses = alignment.masses.as_ref().map_or(areas, |masses| masses.as_slice());
            let square: f64 = field.iter().enumerate().map(|(i, u)| masses[i / b] * u * u).sum();
            (square - 2.0 * dot(field, &alignment.force) + alignment.constant).max(0.0)
        };
        let all = self.alignments.iter().map(|(alignment, _)| one(alignment));
        (!self.alignments.is_empty()).then(|| all.sum())
    }

    /// The constraints as the conditions that they become.
    ///
    /// # Errors
    /// [`DesignError`] names the constraint that cannot be used.
    pub(in super::super) fn conditions(
        &self,
        basis: &FieldBasis,
        constraints: &[Constraint],
    ) -> Result<Vec<Condition>, DesignError> {
        check(basis, self.model.kind, constraints)?;
        Ok(conditions(&without_repetitions(constraints), constraints))
    }

    /// The coefficients of the field of the space that is nearest to one on the faces, whose image under the masses is
    /// `image`; `None` without Ritz coordinates.
    pub(in super::super) fn nearest(&self, basis: &FieldBasis, image: &[f64]) -> Option<Vec<f32>> {
        let model = &self.model;
        model.has_ritz().then(|| model.expand(&model.project(&basis.space.transposed_times(image))))
    }

    /// The constraints with what the space has them move by.
    pub(in super::super) fn compliance(
        &self,
        basis: &FieldBasis,
        constraints: &[Constraint],
    ) -> Result<Compliance, DesignError> {
        let b = basis.space.block();
        check(basis, self.model.kind, constraints)?;
        let kept = without_repetitions(constraints);
        let conditions = conditions(&kept, constraints);
        let rows = self.rows(basis, &conditions);
        let solved = self.moved_by(&rows, self.free(&conditions))?;
        let moved = rows.transposed_times(&solved);
        Ok(Compliance::new(&conditions, moved, b))
    }
}
