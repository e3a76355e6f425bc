//! Modes that refined columns do not hold: found by counting, and then computed.
//!
//! Every Ritz value lies above the eigenvalue of its number. So no more Ritz values than eigenvalues lie below a shift,
//! and if there are as many, then no eigenvalue below it is lacking. The inertia of one factor tells (Sylvester). What
//! is lacking no inverse iteration brings soon: a thin shell has many modes with nearly the same frequency, and those
//! that the local functions lack altogether come slowly. A Krylov space finds them.

use chladni_algebra::PanelMatrix;

use super::refined::Refined;
use super::{ElasticBody, ElasticProblem, Iterations, Monitor, NonrigidModes, RigidMotions, VibrationError, exact};
use crate::spectrum::refine::Ordered;

/// A value may lie above its eigenvalue by this many times its estimated error, as a share of the eigenvalue: twice
/// because of the square, and twice because it is an estimate.
const SAFETY: f64 = 4.0;

/// A gap is at least so wide.
const GAP: f64 = 1e-4;

/// Residuals of a Krylov space that stands in.
const TOLERANCE: f64 = 1e-3;

/// Refined modes of more bytes are given up before exact ones are computed instead: there would be no room for both.
pub const KEPT_BYTES: usize = 64 << 20;

/// More counts, where all that is left is to say how far off the values are.
const MORE_COUNTS: usize = 4;

/// What is asked of the modes.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModesRequest {
    pub iterations: Iterations,
    pub seed: u64,
}

/// Where eigenvalues are to be counted, and how many values are below.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CountingShift {
    shift: f64,
    values: usize,
}

/// The refined modes with what a count tells of them. Where the error had to be made small and is not, or modes are
/// lacking, modes of a Krylov space stand in for them.
pub(super) fn modes(
    body: ElasticBody<'_>,
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    mut refined: Refined,
    asked: ModesRequest,
    monitor: &dyn Monitor,
) -> Result<NonrigidModes, VibrationError> {
    let mut counter = refined.counter.take();
    let Some(counting) = counting_shift(&refined).filter(|_| counter.is_some()) else {
        return Ok(refined.into_found(rigid));
    };
    monitor.stage("certify");
    let free = rigid.motions.len();
    // A factor that fails says nothing about the modes.
    let count = |counter: &Option<Ordered>, shift: f64| {
        counter.as_ref().and_then(|counter| counter.below(shift).ok()).map(|below| below.saturating_sub(free))
    };
    let below = count(&counter, counting.shift);
    monitor.checkpoint()?;
    let lacking = below.map_or(0, |below| below.saturating_sub(counting.values));
    let iterations = refined.iterations;
    if let Iterations::Until(most) = asked.iterations
        && (lacking > 0 || refined.largest_error() > most)
    {
        let kept = 8 * elastic.problem.size() * refined.values.len() <= KEPT_BYTES;
        if !kept {
            (refined.vectors, counter) = (PanelMatrix::default(), None);
        }
        match exact::modes(body, elastic, rigid, refined.values.len(), TOLERANCE.min(most), asked.seed, monitor) {
            Ok(found) => return Ok(standing_in(found, iterations, lacking)),
            Err(VibrationError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) if !kept => return Err(error),
            Err(_) => {}
        }
    }
    if lacking > 0 {
        let last = refined.values.len() - 1;
        let above = lower(refined.values[0], counting.shift, last, |shift| count(&counter, shift), monitor)?;
        let error = (refined.values[last] / above).sqrt() - 1.0;
        refined.errors.iter_mut().for_each(|own| *own = own.max(error));
    }
    let mut found = refined.into_found(rigid);
    if let Some(below) = below {
        found.certificate["inertia"] =
            serde_json::json!([{"shift": counting.shift * elastic.eigenvalue_scale, "below": free + below}]);
        found.certificate["lacking"] = lacking.into();
    }
    Ok(found)
}

/// Modes of a Krylov space with what approximate ones say of themselves.
fn standing_in(mut found: NonrigidModes, iterations: usize, lacking: usize) -> NonrigidModes {
    // Of a frequency, half of that of its square.
    let error = found.certificate["largest_residual"].as_f64().map_or(TOLERANCE, |residual| 0.5 * residual);
    found.certificate = serde_json::json!({
        "complete": true,
        "inertia": found.certificate["inertia"],
        "lacking": lacking,
        "inverse_iterations": iterations,
        "estimated_error": error,
        "estimated_errors": vec![error; found.values.len()],
    });
    found
}

/// The highest gap between values that is wide enough for their errors, or else the widest; among the upper half, and
/// that above the last.
fn counting_shift(refined: &Refined) -> Option<CountingShift> {
    let (values, errors) = (&refined.values, &refined.errors);
    let gap = |values_below: usize| {
        let low = values[values_below - 1];
        let (high, error) = match values.get(values_below) {
            Some(&value) => (value, errors[values_below]),
            None => refined.beyond?,
        };
        let reached = high * (1.0 - SAFETY * error);
        let shift = 0.5 * (low + if reached > low { reached } else { high });
        Some((CountingShift { shift, values: values_below }, reached / low, high / low))
    };
    let gaps =
        || (1 + values.len() / 2..=values.len()).rev().filter_map(gap).filter(|(counting, ..)| counting.shift > 0.0);
    let first = gaps().find(|(_, reached, _)| *reached > 1.0 + GAP);
    first.or_else(|| gaps().max_by(|a, b| a.2.total_cmp(&b.2))).map(|(counting, ..)| counting)
}

/// A value below which no more than `index` eigenvalues lie, so that the one of that number, from 0, is above: nearly
/// the highest.
fn lower(
    mut low: f64,
    mut high: f64,
    index: usize,
    count: impl Fn(f64) -> Option<usize>,
    monitor: &dyn Monitor,
) -> Result<f64, VibrationError> {
    for _ in 0..MORE_COUNTS {
        monitor.checkpoint()?;
        let middle = (low * high).sqrt();
        match count(middle) {
            Some(below) if below <= index => low = middle,
            Some(_) => high = middle,
            None => break,
        }
    }
    Ok(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(values: &[f64], errors: &[f64], beyond: Option<(f64, f64)>) -> Refined {
        Refined { values: values.to_vec(), errors: errors.to_vec(), beyond, ..Refined::default() }
    }

    #[test]
    fn eigenvalues_are_counted_in_the_highest_gap_that_errors_leave_open() {
        let values = [1.0, 2.0, 3.0, 4.0];
        let found = |errors: [f64; 4], beyond| counting_shift(&with(&values, &errors, beyond)).unwrap().values;
        assert_eq!(found([0.0; 4], Some((4.4, 0.0))), 4);
        assert_eq!(found([0.0; 4], Some((4.4, 0.05))), 3, "the guard may be a copy of the last");
        assert_eq!(found([0.0; 4], None), 3);
        assert_eq!(found([0.0; 4], Some((4.0, 0.0))), 3);
        let counting = counting_shift(&with(&values, &[0.0, 0.0, 0.0, 0.01], None)).unwrap();
        assert!((counting.shift - 0.5 * (3.0 + 4.0 * 0.96)).abs() < 1e-12);
        // Nothing is left open: the widest.
        assert_eq!(found([0.5; 4], Some((8.0, 0.5))), 4);
    }
}
