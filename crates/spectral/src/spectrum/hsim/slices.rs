//! Many pairs slice by slice: each slice of the spectrum has a shift in its middle and a Krylov space of its own.
//!
//! What a space costs beside its solves grows with the square of its columns, so that a few spaces side by side are
//! cheaper than one, and take less memory. Counts at the shifts give every Ritz value its index, so that a slice begins
//! where the one before it ends.
//!
//! What becomes one of them is told in `segments.rs`. Slices that are solved elsewhere are the business of `parts.rs`.

use chladni_algebra::{PANEL_WIDTH, SymbolicFactor};
use chladni_base::Monitor;
use chladni_base::notes::FALLBACKS;

use super::HsimError;
use super::judge::Count;
use super::kernel::Kernel;
use super::lanczos::{self, KrylovRequest, Leave, Shift};
use super::level::Level;
use super::scout::{Scout, Target};
use super::segments::{Assembly, DEPENDENT, Sliced};
use super::tuning::TUNING;
use crate::basis::SHARED;

/// A joint between slices lies in the widest gap among so many pairs to either side.
const JOINT: usize = SHARED;

/// A relative gap that is wide enough for a joint.
const LEAST_GAP: f64 = 1e-7;

/// How far from its target a count may be, as a share of the slice, at first and at last.
const NEAR: f64 = 0.12;
const NEAR_ENOUGH: f64 = 0.25;

/// Whether so many pairs of a level of a size are had for less in slices than in one space.
pub(super) fn is_cheaper(size: usize, pairs: usize, tolerance: f64) -> bool {
    pairs >= TUNING.slices.fewest && lanczos::has_room(size, TUNING.slices.pairs, tolerance)
}

/// The lowest pairs beside the kernel, in slices of about so many; nothing where counts and spaces do not find them so.
pub(super) fn start(
    level: &Level,
    symbolic: &SymbolicFactor,
    kernel: &Kernel<'_>,
    wanted: KrylovRequest,
    slice: usize,
    monitor: &dyn Monitor,
) -> Result<Option<Sliced>, HsimError> {
    let assembly = Assembly::new(level, kernel, wanted.pairs, monitor);
    let slices = Slices { symbolic, wanted, slice, assembly };
    match slices.run() {
        // Another start may serve where this one breaks down.
        Err(HsimError::Numerical(error)) => given_up(monitor, &error.to_string()),
        found => found,
    }
}

/// No pairs, and why.
fn given_up(monitor: &dyn Monitor, reason: &str) -> Result<Option<Sliced>, HsimError> {
    monitor.note(FALLBACKS, &format!("slices of the spectrum: {reason}"));
    Ok(None)
}
/// What a space is asked for that holds so many pairs of all that are wanted, from an index on: those of one slice.
pub(super) fn one_slice(
    size: usize,
    whole: KrylovRequest,
    (from, pairs): (usize, usize),
    number: usize,
) -> KrylovRequest {
    let close = TUNING.slices.close * (TUNING.slices.close_up_to as f64 / (from + pairs) as f64).min(1.0);
    let (tolerance, more) = (whole.tolerance.min(close), pairs / 2 + PANEL_WIDTH);
    KrylovRequest {
        from,
        // A slice with others on both sides takes more for each pair, and is one of several.
        most: lanczos::most(size, pairs).saturating_add(more).min(size / TUNING.krylov.largest_share),
        least_shift: whole.least_shift,
        pairs,
        columns: pairs,
        tolerance,
        seed: whole.seed.wrapping_add(number as u64),
        leave: Leave::Nothing,
        zeros: None,
    }
}

struct Slices<'a> {
    symbolic: &'a SymbolicFactor,
    wanted: KrylovRequest,
    slice: usize,
    /// The pairs so far.
    assembly: Assembly<'a>,
}

impl Slices<'_> {
    fn run(mut self) -> Result<Option<Sliced>, HsimError> {
        let (symbolic, total) = (self.symbolic, self.wanted.pairs);
        let Assembly { level, kernel, monitor, .. } = self.assembly;
        let mut scout = Scout::new(level, symbolic, monitor);
        while self.assembly.values.len() < total {
            let (from, left) = (self.assembly.values.len(), total - self.assembly.values.len());
            let size = left as f64 / ((left as f64 / self.slice as f64).round().max(1.0));
            let Some(shift) = scout.shift_below(
                &target(from, size),
                (self.guess(&scout, from, size), self.wanted.least_shift),
                kernel.dimension(),
                monitor,
            )?
            else {
                return given_up(monitor, &no_shift(from));
            };
            // As far above the shift as below it.
            let end = (2 * shift.below - from).max(from + 1);
            let last = end + size as usize / 4 >= total;
            let pairs = if last { total - from } else { (end + JOINT).min(total) - from };
            let wanted = one_slice(level.size(), self.wanted, (from, pairs), self.assembly.counts.len());
            monitor.detail(&format!("slice of pairs {from} to {} of {total}", from + pairs));
            let memory = &mut self.assembly.memory;
            let Some(mut found) = lanczos::pairs(level, symbolic, kernel, &shift, wanted, memory, monitor)? else {
                return given_up(monitor, &not_contained(from, pairs));
            };
            let taken = if last { found.values.len() } else { joint(&found.values, pairs) };
            // Each slice reaches beyond its shift.
            if taken == 0 || from + taken < shift.below {
                let reached = from + taken;
                let reason =
                    format!("the slice from pair {from} on ends at {reached}, below its own shift at {}", shift.below);
                return given_up(monitor, &reason);
            }
            self.assembly.memory.extend(found.vectors.split_off(taken));
            let count = count_at(level, kernel, &shift);
            self.assembly.extend(&found.values[..taken], found.vectors, count);
            scout.keep_storage(shift.factor);
        }
        match self.assembly.finish()? {
            None => given_up(monitor, DEPENDENT),
            found => Ok(found),
        }
    }

    /// A guess where the middle of a slice lies that begins with an index.
    fn guess(&self, scout: &Scout<'_>, from: usize, size: f64) -> f64 {
        let values = &self.assembly.values;
        let step = values.len().min(self.slice / 2);
        if step < 2 {
            return scout.distance(0.5 * size);
        }
        let last = values[from - 1];
        last + 0.5 * size * (last - values[from - step]) / (step - 1) as f64
    }
}

/// The count that a shift was made for, with the kernel, which lies below it as well.
pub(super) fn count_at(level: &Level, kernel: &Kernel<'_>, shift: &Shift<'_>) -> Count {
    let below = shift.below + kernel.dimension();
    Count { below, ..Count::of(level, shift.at, &shift.factor) }
}

/// Why slices are given up: no shift lies in the one that begins with an index, or its space does not hold its pairs.
pub(super) fn no_shift(from: usize) -> String {
    format!("no shift was found for the slice from pair {from} on")
}

pub(super) fn not_contained(from: usize, pairs: usize) -> String {
    format!("a Krylov space did not contain the {pairs} pairs from {from} on")
}

/// How many eigenvalues lie below the middle of a slice.
pub(super) fn target(from: usize, size: f64) -> Target {
    let below = from as f64 + 0.5 * size;
    let within = |share: f64| below - share * size..=below + share * size;
    Target { below, enough: within(NEAR), at_last: within(NEAR_ENOUGH) }
}

/// How many of ascending values are taken before the widest gap at their end; none where there is no gap.
pub(super) fn joint(values: &[f64], pairs: usize) -> usize {
    let gap = |k: usize| (values[k] - values[k - 1]) / values[k].abs();
    let places = pairs.saturating_sub(2 * JOINT).max(1)..pairs;
    places.max_by(|&a, &b| gap(a).total_cmp(&gap(b))).filter(|&k| gap(k) > LEAST_GAP).unwrap_or(0)
}

#[cfg(test)]
#[path = "slices_tests.rs"]
mod tests;
