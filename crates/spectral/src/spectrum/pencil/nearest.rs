//! The pairs nearest to a number inside the spectrum.
//!
//! With `c` eigenvalues below the shift, the `k` nearest are among the lowest `c + k`: of those, `k` lie at the shift
//! or above, each nearer than whatever comes after. One inertia count tells `c`; the lowest `c + k` pairs are proven
//! complete as always, and enclosures tell which of them are the nearest.

use std::ops::Range;

use chladni_algebra::{FactorError, MassMatrix, SparseMatrix, SymbolicFactor, fill_reducing_order};
use chladni_base::Monitor;

use super::{Pairs, Parameters, Pencil, PencilError, lowest};
use crate::basis::{Around, CutCluster, InertiaCount, NearPair};
use crate::spectrum::hsim::{self, HsimError, Selection};

/// Columns of a typical solve, as far as the order of the factor goes.
const COLUMNS: usize = 128;

/// A gap below the first pair holds a shift for a count if it is wider than this share of its ends.
const LEAST_GAP: f64 = 1e-9;

pub(super) fn solve(
    pencil: &Pencil,
    parameters: &Parameters,
    (shift, count, most): (f64, usize, usize),
    monitor: &dyn Monitor,
) -> Result<Pairs, PencilError> {
    let n = pencil.unknowns();
    if !shift.is_finite() {
        let reason = format!("must be a finite number, not {shift}");
        return Err(HsimError::Parameter { name: "around", reason }.into());
    }
    if count == 0 || count > n {
        return Err(HsimError::Count { wanted: count, most: n }.into());
    }
    monitor.stage("count");
    let counter = Counter::new(pencil, monitor)?;
    let mut computed = counter.below(shift)?.saturating_add(count).min(n);
    loop {
        if computed > most {
            return Err(HsimError::Count { wanted: computed, most }.into());
        }
        let pairs = lowest(pencil, Selection::Count(computed), parameters, monitor)?;
        // What lies next to the shift may have been counted on its other side: only pairs that are surely above it tell
        // that nothing nearer comes after.
        let enclosed = pairs.values.iter().zip(&pairs.certificate.bounds);
        let above = enclosed.filter(|(value, bound)| *value - *bound >= shift).count();
        // Or that as many as are wanted lie on the shift, as far as one can tell, in a cluster that goes on: then
        // nothing is nearer.
        let enclosed = pairs.values.iter().zip(&pairs.certificate.bounds);
        let on_shift = enclosed.filter(|(value, bound)| (*value - shift).abs() <= **bound).count();
        let goes_on = pairs.certificate.cut.is_some_and(|cut| cut.end > computed);
        if above >= count || computed == n || (on_shift >= count && goes_on) {
            return nearest(pairs, shift, count, &counter);
        }
        // A quarter more at least: a cluster on the shift may be all that there is.
        computed = (computed + (count - above).max(computed / 4)).min(n);
    }
}

/// Inertia counts of a pencil.
struct Counter {
    stiffness: SparseMatrix,
    mass: MassMatrix,
    symbolic: SymbolicFactor,
    /// An eigenvalue of the pencil over that of these matrices.
    unit: f64,
}

impl Counter {
    fn new(pencil: &Pencil, monitor: &dyn Monitor) -> Result<Self, HsimError> {
        let problem = &pencil.problem;
        let order = fill_reducing_order(&problem.stiffness, hsim::bare_ordering(&problem.stiffness, COLUMNS))?;
        monitor.checkpoint()?;
        let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
        let symbolic = SymbolicFactor::new(&stiffness, &mass)?.within(1, monitor)?;
        Ok(Self { stiffness, mass, symbolic, unit: pencil.factors.0 })
    }

    /// Eigenvalues below a shift, or next to it where an eigenvalue lies on it.
    fn below(&self, shift: f64) -> Result<usize, HsimError> {
        let shift = shift / self.unit;
        let step = f64::EPSILON * (shift.abs() + self.stiffness.rows() as f64);
        let mut last = None;
        // Down first: what is counted too low is found in another round.
        for times in [0.0, -16.0, -64.0, 1e3, -1e4, 1e6] {
            match self.symbolic.count(&self.stiffness, &self.mass, shift + times * step) {
                Ok(count) => return Ok(count.below),
                Err(error @ FactorError::Singular { .. }) => last = Some(error),
                Err(error) => return Err(error.into()),
            }
        }
        let reason = last.map_or_else(String::new, |error| error.to_string());
        Err(HsimError::Numerical(reason))
    }

    /// Whether a count at a shift, with `room` to the next eigenvalues on either side, proves that so many lie below.
    fn proves(&self, shift: f64, room: f64, below: usize) -> bool {
        let (at, room) = (shift / self.unit, room / self.unit);
        let counted = self.symbolic.count(&self.stiffness, &self.mass, at);
        counted.is_ok_and(|count| count.below == below && count.uncertainty < room)
    }
}

/// The nearest of the lowest pairs, which hold all of them.
fn nearest(mut pairs: Pairs, shift: f64, count: usize, counter: &Counter) -> Result<Pairs, PencilError> {
    let values = &pairs.values;
    let (start, end) = window(values, shift, count);
    let mut ties = ties(values, &pairs.certificate.bounds, shift, start..end);
    if let Some(cut) = pairs.certificate.cut.filter(|_| end == values.len()) {
        ties.extend(copies(cut, start..end, values, &pairs.certificate.bounds));
        ties.sort_unstable_by_key(|tie| tie.index);
        ties.dedup_by_key(|tie| tie.index);
    }
    pairs.certificate.around = Some(Around { shift, ties });
    // Whoever judges the pairs counts what lies below the first, and below the last and it.
    for (at, is_last) in [(start, false), (end, true)] {
        let below = pairs.certificate.first + at;
        let Some((gap, room)) = gap_below(values, &pairs.certificate.bounds, at) else { continue };
        if counter.proves(gap, room, below) {
            let counts = &mut pairs.certificate.inertia;
            counts.retain(|count| !is_last || count.shift < gap);
            let place = counts.partition_point(|count| count.shift < gap);
            counts.insert(place, InertiaCount { shift: gap, below });
        }
    }
    if end < values.len() {
        pairs.certificate.cut = None;
    }
    let keep = |numbers: &mut Vec<f64>| {
        numbers.truncate(end);
        numbers.drain(..start);
    };
    keep(&mut pairs.values);
    keep(&mut pairs.certificate.residuals);
    keep(&mut pairs.certificate.bounds);
    pairs.certificate.first += start;
    pairs.vectors = pairs.vectors.slice_columns(start..end);
    Ok(pairs)
}

/// The `count` of ascending values that are nearest to `shift` are neighbours: from the first of these numbers to
/// before the second. Of two as near, the one with fewer others between.
fn window(values: &[f64], shift: f64, count: usize) -> (usize, usize) {
    let place = values.partition_point(|&value| value < shift);
    let (mut start, mut end) = (place, place);
    while end - start < count.min(values.len()) {
        let below = start.checked_sub(1).map(|at| shift - values[at]);
        let above = values.get(end).map(|value| value - shift);
        let down = match (below, above) {
            (Some(below), Some(above)) if below == above => place - start <= end - place,
            (Some(below), Some(above)) => below < above,
            (below, _) => below.is_some(),
        };
        if down { start -= 1 } else { end += 1 }
    }
    (start, end)
}

/// The pairs, delivered or not, of which enclosures do not let one tell which are nearer.
fn ties(values: &[f64], bounds: &[f64], shift: f64, window: Range<usize>) -> Vec<NearPair> {
    let distance = |k: usize| (values[k] - shift).abs();
    let furthest = window.clone().map(|k| distance(k) + bounds[k]).fold(0.0, f64::max);
    let others = (0..values.len()).filter(|k| !window.contains(k));
    let closest = others.map(|k| distance(k) - bounds[k]).fold(f64::INFINITY, f64::min);
    if closest > furthest {
        return Vec::new();
    }
    let is_tied = |k: &usize| match window.contains(k) {
        true => distance(*k) + bounds[*k] >= closest,
        false => distance(*k) - bounds[*k] <= furthest,
    };
    let tied = (0..values.len()).filter(is_tied);
    tied.map(|index| NearPair {
        index,
        value: values[index],
        within: bounds[index],
        delivered: window.contains(&index),
    })
    .collect()
}

/// The pairs of a cluster that goes on beyond the last of those that were computed, which is delivered: any of its
/// pairs could stand for it.
fn copies(cut: CutCluster, window: Range<usize>, values: &[f64], bounds: &[f64]) -> Vec<NearPair> {
    let Some(last) = values.len().checked_sub(1).filter(|&last| cut.first <= last && cut.end > values.len()) else {
        return Vec::new();
    };
    let copy = |index: usize| NearPair {
        index,
        value: values[index.min(last)],
        within: bounds[index.min(last)],
        delivered: window.contains(&index),
    };
    (cut.first.max(window.start)..cut.end).map(copy).collect()
}

/// A shift between a pair and the one before, where their enclosures leave room for one, and how much room on either
/// side.
fn gap_below(values: &[f64], bounds: &[f64], at: usize) -> Option<(f64, f64)> {
    let before = at.checked_sub(1)?;
    let (low, high) = (values[before] + bounds[before], values.get(at)? - bounds[at]);
    (high - low > LEAST_GAP * low.abs().max(high.abs())).then_some((0.5 * (low + high), 0.5 * (high - low)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_are_neighbours_on_both_sides() {
        let values = [-3.0, -1.0, 0.0, 1.0, 3.0, 10.0];
        assert_eq!(window(&values, 0.25, 1), (2, 3));
        assert_eq!(window(&values, 0.25, 3), (1, 4));
        assert_eq!(window(&values, 100.0, 2), (4, 6));
        assert_eq!(window(&values, -100.0, 2), (0, 2));
        assert_eq!(window(&values, 0.5, 9), (0, 6));
        // As near on either side: by turns, from below first.
        assert_eq!(window(&[-1.0, -1.0, 1.0, 1.0], 0.0, 2), (1, 3));
    }

    #[test]
    fn what_cannot_be_told_apart_is_named() {
        let (values, bounds) = ([-2.0, -1.0, 1.0, 2.0], [1e-12; 4]);
        assert!(ties(&values, &bounds, 0.1, 1..3).is_empty());
        let tied: Vec<_> = ties(&values, &bounds, 0.0, 1..2).iter().map(|pair| (pair.index, pair.delivered)).collect();
        assert_eq!(tied, [(1, true), (2, false)]);
        // A cluster that goes on beyond what was computed.
        let cluster = |first, end| copies(CutCluster { first, end }, 2..4, &values, &bounds);
        let tied: Vec<_> = cluster(3, 6).iter().map(|pair| (pair.index, pair.delivered)).collect();
        assert_eq!(tied, [(3, true), (4, false), (5, false)]);
        assert!(cluster(1, 4).is_empty() && cluster(4, 6).is_empty());
    }
}
