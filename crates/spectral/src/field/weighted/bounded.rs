//! What has no energy where a sparse factor does not know it, and is to be no longer than it may.

use chladni_algebra::{DenseMatrix, dot_in_order, solve_definite};

use super::super::alignment::Alignment;
use super::super::compliance::slacks;
use super::super::constraints::Condition;
use super::super::design::DesignError;
use super::super::idle::Idle;
use super::{Inverse, LONGEST_IDLE, MOST_IDLE, Pull, WeightedModel, norm, times};

/// Steps of bisection, and the orders of magnitude that they are over.
const STEPS: usize = 60;
const ORDERS: i32 = 14;

/// The longest value that a field asks for where it has weights per face, its mean length where it has none.
fn asked_by(alignment: &Alignment, b: usize) -> f64 {
    let Some(masses) = &alignment.masses else { return alignment.constant.max(0.0).sqrt() };
    let one = |(force, &mass): (&[f64], &f64)| if mass > 0.0 { norm(force) / mass } else { 0.0 };
    alignment.force.chunks(b.max(1)).zip(masses.iter()).map(one).fold(0.0, f64::max)
}

impl WeightedModel {
    /// Whether something but the energies holds fields.
    pub(super) fn is_held(&self) -> bool {
        self.prescription.is_some() || !self.alignments.is_empty()
    }

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

    /// The Ritz coordinates that have no energy of their own, whatever alignments give them.
    fn idle_coordinates(&self) -> usize {
        let least = self.model.least_value();
        let count = self.model.values().iter().take_while(|value| **value <= least).count();
        if self.is_held() && self.model.has_ritz() && count <= MOST_IDLE { count } else { 0 }
    }

    /// How long what has no energy of its own may be beside alignments, which ask for lengths as constraints do.
    fn most_idle(&self, asked: f64, b: usize) -> f64 {
        let aligned = self.alignments.iter().map(|(one, _)| asked_by(one, b));
        let prescribed = self.prescription.iter().map(|(one, _)| asked_by(&one.along, b));
        LONGEST_IDLE * aligned.chain(prescribed).fold(asked, f64::max)
    }

    /// Whether a design beside alignments is as long as it may be: then it is none of least energy without a bound.
    /// Gives its length in units of `asked`.
    pub(in super::super) fn is_bounded(&self, ritz: &[f64], asked: f64, b: usize) -> Option<f64> {
        let length = norm(&ritz[..self.idle_coordinates().min(ritz.len())]);
        (length > 0.0 && length >= (1.0 - 1e-6) * self.most_idle(asked, b)).then(|| length / asked)
    }

    /// Beside alignments what has no energy of its own is no kernel: where there is more of it in a field than may be,
    /// the least `m` is looked for with which `m |idle part|²` in the energy makes it as long as it may be.
    pub(super) fn shorten(
        &self,
        rows: &DenseMatrix,
        conditions: &[Condition],
        b: usize,
        start: &Pull,
        found: &mut Pull,
    ) -> Result<(), DesignError> {
        let (f, k, d) = (self.idle_coordinates(), rows.columns(), self.model.dimension());
        if f == 0 {
            return Ok(());
        }
        let mut images = DenseMatrix::zeros(d, f);
        for j in 0..f {
            match (&self.inverse, &self.pencil) {
                (Inverse::Sparse(_), Some(pencil)) => {
                    let field: Vec<f64> = (0..d).map(|i| f64::from(self.model.ritz.vectors[d * i + j])).collect();
                    images.column_mut(j).copy_from_slice(&times(&pencil.mass, &field));
                }
                _ => images.column_mut(j)[j] = 1.0,
            }
        }
        let along = |field: &[f64]| -> Vec<f64> { (0..f).map(|j| dot_in_order(images.column(j), field)).collect() };
        let most = self.most_idle(conditions.iter().map(|c| norm(&c.value)).fold(0.0, f64::max), b);
        if norm(&along(&found.field)) <= most {
            return Ok(());
        }
        // What unit pulls at the idle fields move of these, and at constraints.
        let mut moved = images.clone();
        self.inverse.apply(moved.values_mut())?;
        let (own, at) = (images.transposed_times(&moved), moved.transposed_times(rows));
        let mut solved = rows.clone();
        self.inverse.apply(solved.values_mut())?;
        // What constraints move by without idle fields: in Ritz coordinates without cancellation.
        let rest = match &self.inverse {
            Inverse::Ritz(diagonal) => {
                let mut scaled = rows.clone();
                for column in 0..k {
                    let entries = scaled.column_mut(column).iter_mut().zip(diagonal).enumerate();
                    entries.for_each(|(i, (x, d))| *x *= if i < f { 0.0 } else { d.sqrt() });
                }
                scaled.transposed_times(&scaled)
            }
            Inverse::Sparse(_) => {
                let mut answered = at.clone();
                solve_definite(own.clone(), &mut answered).map_err(DesignError::Factor)?;
                let mut rest = rows.transposed_times(&solved);
                let less = at.transposed_times(&answered);
                rest.values_mut().iter_mut().zip(less.values()).for_each(|(x, l)| *x -= l);
                rest
            }
        };
        let slacks = slacks(&rest, conditions, b);
        let (before, square) = (along(&start.field), own.transposed_times(&own));
        let reached: Vec<f64> = (0..k).map(|i| dot_in_order(rows.column(i), &start.field)).collect();
        // The pulls at constraints, those that shorten, and how long what has no energy is.
        let answer = |m: f64| -> Result<(Vec<f64>, Vec<f64>, f64), DesignError> {
            let mut held = own.clone();
            (0..f).for_each(|j| held.column_mut(j)[j] += 1.0 / m);
            let shortened = |amounts: &[f64]| -> Result<Vec<f64>, DesignError> {
                let mut x = DenseMatrix::zeros(f, 1);
                x.column_mut(0).copy_from_slice(amounts);
                solve_definite(held.clone(), &mut x).map_err(DesignError::Factor)?;
                Ok(x.column(0).to_vec())
            };
            let mut both = own.clone();
            both.values_mut().iter_mut().zip(square.values()).for_each(|(x, s)| *x += m * s);
            let mut answered = at.clone();
            solve_definite(both, &mut answered).map_err(DesignError::Factor)?;
            let mut system = at.transposed_times(&answered);
            system.values_mut().iter_mut().zip(rest.values()).for_each(|(x, r)| *x += r);
            let first = shortened(&before)?;
            let mut y = DenseMatrix::zeros(k, 1);
            for i in 0..k {
                system.column_mut(i)[i] += slacks[i];
                let value = conditions[i / b].value[i % b];
                y.column_mut(0)[i] = value - reached[i] + dot_in_order(at.column(i), &first);
            }
            solve_definite(system, &mut y).map_err(DesignError::Factor)?;
            let y = y.column(0).to_vec();
            let mut amounts = before.clone();
            for (i, y) in y.iter().enumerate() {
                amounts.iter_mut().zip(at.column(i)).for_each(|(a, n)| *a += n * y);
            }
            let pulls = shortened(&amounts)?;
            let length = norm(&pulls) / m;
            Ok((y, pulls, length))
        };
        let scale = (0..f).map(|j| own.column(j)[j]).fold(f64::MIN_POSITIVE, f64::max).recip();
        let (mut low, mut high) = (scale * 10f64.powi(-ORDERS), scale * 10f64.powi(ORDERS));
        for _ in 0..STEPS {
            let middle = (low * high).sqrt();
            *(if answer(middle)?.2 > most { &mut low } else { &mut high }) = middle;
        }
        let (y, pulls, _) = answer(high)?;
        *found = start.clone();
        let parts = (0..k).map(|i| (y[i], rows.column(i), solved.column(i)));
        let shorter = (0..f).map(|j| (-pulls[j], images.column(j), moved.column(j)));
        for (amount, force, field) in parts.chain(shorter) {
            found.force.iter_mut().zip(force).for_each(|(x, own)| *x += amount * own);
            found.field.iter_mut().zip(field).for_each(|(x, own)| *x += amount * own);
        }
        Ok(())
    }
}
