//! Approximate eigenfields judged and corrected among all fields of a surface.
//!
//! What an eigenfield `x` of a small space with the value `θ` misses is about `y = (S + σM)⁻¹ r` with
//! `r = S x − θ M x`: one step of inverse iteration, as `x − y` is a multiple of `(S + σM)⁻¹ M x`. With the part of `y`
//! that lies outside all fields at hand, the best multiple of it gains `(yᵀr)² / yᵀ(S − θM)y`, which estimates how far
//! `θ` lies above the exact value. Where that is much of it, the least values in the space of all fields and all
//! corrections take the place of these, as often as it needs; steps of before are kept in that space (Knyazev 2001).
//! Values only fall, and by Courant and Fischer each stays above the exact value of its index.

use chladni_algebra::{DenseMatrix, lowest_symmetric};
use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::design::{DesignError, length};
use super::kernel::Kernel;
use super::refine::{FullSpace, Inner};
use super::refine_error::RefineError;
use super::refine_response::{Factor, Whole, add, dot};
use crate::basis::{FieldAccuracyReport, FieldCertificate};

/// σ, on unit area: eigenfields of low values are told apart best by a shift below them.
const SHIFT: f64 = 1.0;

/// How well corrections are solved for.
const SOLVED: f64 = 0.05;

/// Estimates are good where no more than this share of the value is still to be gained …
const SMALL: f64 = 0.1;

/// … or this share of what was gained.
const KNOWN: f64 = 0.2;

/// Rounds of correction for an estimate, and for fields that are to be right.
const ESTIMATING: usize = 4;
const CORRECTING: usize = 60;

/// What is left of a correction after the fields at hand were taken out is a direction of its own above this share of
/// it.
const OWN: f64 = 1e-7;

/// Corrections of fields of norm 1 below this are rounding.
const ROUNDING: f64 = 1e-11;

/// Shares of a value are of at least this much, on unit area: fields without energy have none.
const FLOOR: f64 = 1e-2;

/// The largest relative error of the lowest eigenvalues that is usual on fair triangles.
const USUAL: f64 = 0.1;

/// Fields of norm 1 with less energy, on unit area, have none that matters: they are kept as they are.
const IDLE: f64 = 1e-4;

/// Numbers of a field that one task handles.
const PIECE: usize = 4096;

/// What eigenfields of the whole surface are computed for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EigenfieldGoal {
    /// To know how far the values are off: corrections end as soon as that is known to a fifth or so.
    Estimate,
    /// To have values that are right to this share of them.
    Tolerance(f64),
}

/// The lowest eigenfields among all fields of a surface, as far as they were corrected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LowestFields {
    /// The wanted fields by ascending value, of unit norm on unit area.
    pub fields: Vec<WholeField>,
    /// How often they were corrected.
    pub rounds: usize,
    /// Whether the goal was reached.
    pub reached: bool,
}

/// An eigenfield of the whole surface, with what is known of its value. All values on unit area.
#[derive(Debug, Clone, PartialEq)]
pub struct WholeField {
    /// `block` numbers for each face.
    pub field: Vec<f64>,
    /// Its value, above the exact one of the same index.
    pub value: f64,
    /// By how much it lies below the value that was to be judged: the error of that one is at least this much.
    pub gained: f64,
    /// About how far it lies above the exact value.
    pub left: f64,
    /// Some exact eigenvalue is nearer to `value` than this, up to rounding; infinite where that is not known.
    pub bound: f64,
}

impl LowestFields {
    /// What they tell of approximate ones of these values, on unit area, of a surface of an area.
    pub fn certificate(&self, values: &[f64], area: f64) -> FieldCertificate {
        self.certificate_above(values, 0, area)
    }

    /// The same where these are those above `idle` fields without energy.
    pub fn certificate_above(&self, values: &[f64], idle: usize, area: f64) -> FieldCertificate {
        let (mut estimates, mut bounds, mut largest) = (Vec::new(), Vec::new(), 0.0f64);
        let nothing = values.iter().take(idle).map(|&value| (value, value, value));
        let above = self.fields.iter().zip(values.iter().skip(idle));
        let above = above.map(|(own, &value)| (value, own.gained + own.left, own.gained + own.bound));
        for (value, estimate, bound) in nothing.chain(above) {
            largest = largest.max(estimate / share_of(value - estimate));
            estimates.push(estimate / area);
            bounds.push(Some(bound / area).filter(|bound| bound.is_finite()));
        }
        let accuracy = FieldAccuracyReport { goal: USUAL, largest_estimate: largest, reached: largest <= USUAL };
        FieldCertificate { estimates, bounds, accuracy }
    }

    /// How many fields are corrected together for so many that are wanted, of so many that there are: some more, which
    /// keep the last from mixing with what lies above them.
    pub fn together(wanted: usize, all: usize) -> usize {
        (wanted + (wanted / 4).max(3)).min(all)
    }

    /// How many of the lowest of these values, on unit area, belong to fields without energy: those cost next to
    /// nothing.
    pub fn idle(values: &[f64]) -> usize {
        values.iter().take_while(|&&value| value < IDLE).count()
    }

    /// About the bytes that so many fields take together, of so many numbers each.
    pub fn bytes(together: usize, numbers: usize) -> u64 {
        // Fields, corrections, the steps of before, and the fields and steps that come out of them.
        40 * together as u64 * numbers as u64
    }
}

impl FullSpace {
    /// Judges and corrects approximate eigenfields: `start`, the lowest of a small space by ascending value, of which
    /// the first `wanted` count. The others keep what lies above away; there should be some, see
    /// [`LowestFields::together`].
    ///
    /// # Errors
    /// [`RefineError`]: a field of another length, fields that depend on each other; cancellation.
    pub fn eigenfields(
        &self,
        start: Vec<Vec<f64>>,
        wanted: usize,
        goal: EigenfieldGoal,
        monitor: &dyn Monitor,
    ) -> Result<LowestFields, RefineError> {
        self.lowest(start, wanted, (goal, false), monitor)
    }

    /// The same of the fields above those without energy, which [`count_idle`](Self::count_idle) has found: they are
    /// not among `start`, and are kept component by component, so that there may be many.
    ///
    /// # Errors
    /// As for [`eigenfields`](Self::eigenfields).
    pub fn eigenfields_above_idle(
        &self,
        start: Vec<Vec<f64>>,
        wanted: usize,
        goal: EigenfieldGoal,
        monitor: &dyn Monitor,
    ) -> Result<LowestFields, RefineError> {
        self.lowest(start, wanted, (goal, true), monitor)
    }

    fn lowest(
        &self,
        start: Vec<Vec<f64>>,
        wanted: usize,
        (goal, above_idle): (EigenfieldGoal, bool),
        monitor: &dyn Monitor,
    ) -> Result<LowestFields, RefineError> {
        let block = match &self.inner {
            Inner::Two(_) => 2,
            Inner::Three(_) => 3,
        };
        for field in &start {
            length("an eigenfield", field.len(), block * self.faces())?;
        }
        if let EigenfieldGoal::Tolerance(tolerance) = goal {
            Self::check_tolerance(tolerance)?;
        }
        let wanted = wanted.min(start.len());
        if wanted == 0 {
            return Ok(LowestFields { reached: true, ..LowestFields::default() });
        }
        match &self.inner {
            Inner::Two(whole) => {
                let kernel = whole.kernel.get().filter(|_| above_idle);
                Lowest::new(whole, kernel, start, wanted, monitor)?.run(goal, monitor)
            }
            Inner::Three(whole) => {
                let kernel = whole.kernel.get().filter(|_| above_idle);
                Lowest::new(whole, kernel, start, wanted, monitor)?.run(goal, monitor)
            }
        }
    }
}

/// Fields on their way to the lowest ones.
struct Lowest<'a, const B: usize> {
    whole: &'a Whole<B>,
    factor: Factor<'a, B>,
    wanted: usize,
    /// Fields without energy that are known beforehand.
    kernel: Option<&'a Kernel>,
    /// Others without energy, orthonormal, with the little that they have. Nothing below them is looked for: no value
    /// is negative.
    idle: Vec<(Vec<f64>, f64)>,
    /// The others, orthonormal, each with its value; `S` is diagonal among them.
    fields: Vec<Vec<f64>>,
    values: Vec<f64>,
    /// The last changes of the fields.
    steps: Vec<Vec<f64>>,
}

/// A correction of a field, and what it tells.
struct Correction {
    field: Vec<f64>,
    gain: f64,
    bound: f64,
}

/// Whether so much of the value, and of what was gained, is left that an estimate is none yet.
fn unknown(value: f64, gained: f64, left: f64) -> bool {
    left > (KNOWN * gained).max(SMALL * share_of(value))
}

fn share_of(value: f64) -> f64 {
    value.max(FLOOR)
}

impl<'a, const B: usize> Lowest<'a, B> {
    fn new(
        whole: &'a Whole<B>,
        kernel: Option<&'a Kernel>,
        start: Vec<Vec<f64>>,
        wanted: usize,
        monitor: &dyn Monitor,
    ) -> Result<Self, RefineError> {
        let factor = whole.factor(SHIFT)?;
        let count = start.len();
        let (idle, fields, values, steps) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut made = Self { whole, factor, wanted, kernel, idle, fields, values, steps };
        // They were stored in single precision: made orthonormal, their values stay what they were to seven digits.
        made.fields = made.orthonormal(Vec::new(), start, monitor)?;
        made.lower(count, monitor)?;
        let idle = LowestFields::idle(&made.values);
        made.idle = made.fields.drain(..idle).zip(made.values.drain(..idle)).collect();
        Ok(made)
    }

    /// `known` and what of `more` lies outside of it, orthonormal.
    fn orthonormal(
        &self,
        known: Vec<Vec<f64>>,
        more: Vec<Vec<f64>>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<f64>>, RefineError> {
        let mut found = known;
        for mut own in more {
            monitor.checkpoint()?;
            let mut size = self.whole.product(&own, &own).sqrt();
            let least = (OWN * size).max(ROUNDING);
            for _ in 0..2 {
                self.without(&found, &mut own);
            }
            size = self.whole.product(&own, &own).sqrt();
            if size > least {
                own.iter_mut().for_each(|x| *x /= size);
                found.push(own);
            }
        }
        Ok(found)
    }

    /// Takes orthonormal fields out of a field.
    fn without(&self, fields: &[Vec<f64>], own: &mut [f64]) {
        self.kernel.iter().for_each(|kernel| kernel.take_out(self.whole, own));
        let mut image = own.to_vec();
        self.whole.weigh(&mut image);
        let known: Vec<&Vec<f64>> = self.idle.iter().map(|own| &own.0).chain(fields).collect();
        let shares: Vec<f64> = known.par_iter().map(|field| dot(field, &image)).collect();
        own.par_chunks_mut(PIECE).enumerate().for_each(|(k, own)| {
            for (field, share) in known.iter().zip(&shares) {
                own.iter_mut().zip(&field[k * PIECE..]).for_each(|(own, x)| *own -= share * x);
            }
        });
    }

    /// The fields of the `count` lowest values in the span of `fields`, which are orthonormal, take their place; what
    /// is not of the first `count` makes the steps.
    fn lower(&mut self, count: usize, monitor: &dyn Monitor) -> Result<(), RefineError> {
        let all = self.fields.len();
        if all == 0 {
            return Ok(());
        }
        let mut matrix = DenseMatrix::zeros(all, all);
        for j in 0..all {
            monitor.checkpoint()?;
            let image = self.whole.stiff(&self.fields[j]);
            let products: Vec<f64> = self.fields[..=j].par_iter().map(|field| dot(field, &image)).collect();
            for (i, product) in products.into_iter().enumerate() {
                matrix.column_mut(j)[i] = product;
                matrix.column_mut(i)[j] = product;
            }
        }
        let kept = count.min(all);
        let pairs = lowest_symmetric(matrix, kept, &chladni_base::Unwatched).map_err(DesignError::Eigen)?;
        let mixed = |k: usize, from: usize| -> Result<Vec<f64>, RefineError> {
            monitor.checkpoint()?;
            let mut sum = vec![0.0; self.fields[0].len()];
            for (field, &share) in self.fields.iter().zip(pairs.vectors.column(k)).skip(from) {
                add(&mut sum, field, share);
            }
            Ok(sum)
        };
        let all_mixed = |from: usize| (0..kept).into_par_iter().map(|k| mixed(k, from)).collect::<Result<_, _>>();
        let steps = if all > count { all_mixed(count)? } else { Vec::new() };
        let fields = all_mixed(0)?;
        self.values = pairs.values;
        self.fields = fields;
        self.steps = steps;
        Ok(())
    }

    /// What a field misses.
    fn correction(&self, k: usize, monitor: &dyn Monitor) -> Result<Correction, RefineError> {
        let (whole, x, value) = (self.whole, &self.fields[k], self.values[k]);
        let mut residual = whole.stiff(x);
        let mut mass = x.clone();
        whole.weigh(&mut mass);
        add(&mut residual, &mass, -value);
        let mut field = self.factor.about(whole, &residual, SOLVED, monitor)?;
        let bound = self.bound(value, &residual, &field);
        for _ in 0..2 {
            self.without(&self.fields, &mut field);
        }
        let along = dot(&field, &residual);
        let curvature = dot(&field, &whole.stiff(&field)) - value * whole.product(&field, &field);
        // A direction that lies below the field gains more than nobody knows; the next round tells.
        let gain = if along == 0.0 {
            0.0
        } else if curvature > 0.0 {
            along * along / curvature
        } else {
            f64::INFINITY
        };
        Ok(Correction { field, gain, bound })
    }

    /// Some exact eigenvalue is nearer than this: `‖r‖` in the norm of `(S + σM)⁻¹` is at most
    /// `2 yᵀr − yᵀ(S + σM)y + ‖r − (S + σM)y‖²_{M⁻¹} / σ`.
    fn bound(&self, value: f64, residual: &[f64], y: &[f64]) -> f64 {
        let whole = self.whole;
        let image = whole.shifted(SHIFT, y);
        let mut rest = residual.to_vec();
        add(&mut rest, &image, -1.0);
        let dual = |r: &[f64]| {
            let mut divided = r.to_vec();
            whole.unweigh(&mut divided);
            dot(r, &divided).max(0.0)
        };
        let square = 2.0 * dot(y, residual) - dot(y, &image) + dual(&rest) / SHIFT;
        let eta = (square.max(0.0) / (value + SHIFT)).sqrt();
        let by_energy = if eta < 1.0 { eta * (value + SHIFT) / (1.0 - eta) } else { f64::INFINITY };
        by_energy.min(dual(residual).sqrt())
    }

    fn run(mut self, goal: EigenfieldGoal, monitor: &dyn Monitor) -> Result<LowestFields, RefineError> {
        let (first, count) = (self.values.clone(), self.fields.len());
        let wanted = self.wanted.saturating_sub(self.idle.len());
        let most = if goal == EigenfieldGoal::Estimate { ESTIMATING } else { CORRECTING };
        let mut rounds = 0;
        loop {
            let corrections =
                (0..self.fields.len()).map(|k| self.correction(k, monitor)).collect::<Result<Vec<_>, _>>()?;
            let open =
                corrections.iter().take(wanted).zip(&self.values).zip(&first).any(
                    |((own, &value), first)| match goal {
                        EigenfieldGoal::Estimate => unknown(value, first - value, own.gain),
                        EigenfieldGoal::Tolerance(tolerance) => own.gain > tolerance * share_of(value),
                    },
                );
            if !open || rounds == most {
                return Ok(self.told(&first, corrections, rounds, !open));
            }
            rounds += 1;
            let fields = std::mem::take(&mut self.fields);
            let steps = std::mem::take(&mut self.steps);
            let corrections = corrections.into_iter().map(|own| own.field).collect();
            let together = self.orthonormal(fields, corrections, monitor)?;
            self.fields = self.orthonormal(together, steps, monitor)?;
            self.lower(count, monitor)?;
        }
    }

    fn told(self, first: &[f64], corrections: Vec<Correction>, rounds: usize, reached: bool) -> LowestFields {
        let idle = self.idle.into_iter().map(|(field, value)| {
            let value = value.max(0.0);
            // What there is lies between zero and the value.
            WholeField { field, value, gained: 0.0, left: value, bound: value }
        });
        let pairs = self.fields.into_iter().zip(self.values).zip(first).zip(corrections);
        let told = |(((field, value), first), own): (((Vec<f64>, f64), &f64), Correction)| WholeField {
            field,
            value,
            gained: (first - value).max(0.0),
            // As far as it could be known.
            left: own.gain.min(value.max(0.0)),
            bound: own.bound,
        };
        LowestFields { fields: idle.chain(pairs.map(told)).take(self.wanted).collect(), rounds, reached }
    }
}

#[cfg(test)]
#[path = "eigenfields_tests.rs"]
mod tests;
