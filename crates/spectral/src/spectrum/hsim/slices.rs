//! Many pairs slice by slice: each slice of the spectrum has a shift in its middle and a Krylov space of its own.
//!
//! What a space costs beside its solves grows with the square of its columns, so that a few spaces side by side are cheaper than one, and take less
//! memory. Counts at the shifts give every Ritz value its index, so that a slice begins where the one before it ends.
//!
//! Spaces know nothing of each other: columns of two slices are orthogonal up to their residuals. Between two shifts lie the upper half of one slice
//! and the lower half of the next, and a Rayleigh–Ritz makes them pairs of one segment. Segments meet at the shifts, where columns of one space are
//! at their most exact; what is left of products between columns of different segments is taken off, from the less exact one of each two.

use std::ops::Range;

use chladni_algebra::{
    DenseMatrix, PANEL_WIDTH, PanelMatrix, SymbolicFactor, gram, residual_sums, restrict, rotate, subtract_combinations,
};
use chladni_base::Monitor;
use chladni_base::notes::FALLBACKS;

use super::HsimError;
use super::judge::Count;
use super::kernel::Kernel;
use super::lanczos::{self, Leave, Wanted};
use super::level::Level;
use super::ritz::ritz;
use super::scout::{Scout, Target};
use super::tuning::TUNING;

/// A joint between slices lies in the widest gap among so many pairs to either side.
const JOINT: usize = 8;

/// A relative gap that is wide enough for a joint.
const LEAST_GAP: f64 = 1e-7;

/// How far from its target a count may be, as a share of the slice, at first and at last.
const NEAR: f64 = 0.12;
const NEAR_ENOUGH: f64 = 0.25;

/// Products between columns of different segments that may stay, those whose squares may, and those that are too large for columns of different
/// eigenvalues.
const NOTHING: f64 = 1e-10;
const SMALL: f64 = 2e-6;
const LARGE: f64 = 1e-2;
const MOST_TIMES: usize = 3;

/// Pairs of all slices.
#[derive(Debug)]
pub(super) struct Sliced {
    /// Ascending.
    pub values: Vec<f64>,
    pub vectors: PanelMatrix,
    pub cuts: Cuts,
}

/// Where the spectrum is cut into segments, each with columns that are orthonormal Ritz vectors of their span.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cuts {
    /// At the shifts, ascending.
    pub counts: Vec<Count>,
    /// No entry of `XᵀMX` for columns of two segments is larger.
    pub defect: f64,
}

/// Whether so many pairs of a level of a size are had for less in slices than in one space.
pub(super) fn pays(size: usize, pairs: usize, tolerance: f64) -> bool {
    pairs >= TUNING.slices.fewest && lanczos::has_room(size, TUNING.slices.pairs, tolerance)
}

/// The lowest pairs beside the kernel, in slices of about so many; nothing where counts and spaces do not find them so.
pub(super) fn start(
    level: &Level,
    symbolic: &SymbolicFactor,
    kernel: &Kernel<'_>,
    wanted: Wanted,
    slice: usize,
    monitor: &dyn Monitor,
) -> Result<Option<Sliced>, HsimError> {
    let slices = Slices {
        level,
        symbolic,
        kernel,
        wanted,
        slice,
        monitor,
        vectors: PanelMatrix::zeros(level.size(), wanted.pairs),
        values: Vec::new(),
        memory: Vec::new(),
        counts: Vec::new(),
    };
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

struct Slices<'a> {
    level: &'a Level,
    symbolic: &'a SymbolicFactor,
    kernel: &'a Kernel<'a>,
    wanted: Wanted,
    slice: usize,
    monitor: &'a dyn Monitor,
    /// The pairs so far.
    vectors: PanelMatrix,
    values: Vec<f64>,
    /// Panels that are not needed any more: fresh memory costs as much as what is done with it.
    memory: Vec<Vec<f64>>,
    /// Counts at the shifts so far.
    counts: Vec<Count>,
}

impl Slices<'_> {
    fn run(mut self) -> Result<Option<Sliced>, HsimError> {
        let Self { level, symbolic, kernel, monitor, .. } = self;
        let mut scout = Scout::new(level, symbolic);
        let total = self.wanted.pairs;
        while self.values.len() < total {
            let (from, left) = (self.values.len(), total - self.values.len());
            let size = left as f64 / ((left as f64 / self.slice as f64).round().max(1.0));
            let Some(shift) = scout.shift_below(
                &target(from, size),
                (self.guess(&scout, from, size), self.wanted.least_shift),
                kernel.dimension(),
                monitor,
            )?
            else {
                return given_up(monitor, &format!("no shift was found for the slice from pair {from} on"));
            };
            // As far above the shift as below it.
            let end = (2 * shift.below - from).max(from + 1);
            let last = end + size as usize / 4 >= total;
            let pairs = if last { total - from } else { (end + JOINT).min(total) - from };
            let (n, more) = (level.size(), pairs / 2 + PANEL_WIDTH);
            let close = TUNING.slices.close * (TUNING.slices.close_up_to as f64 / (from + pairs) as f64).min(1.0);
            let tolerance = self.wanted.tolerance.min(close);
            let wanted = Wanted {
                from,
                // A slice with others on both sides takes more for each pair, and is one of several.
                most: lanczos::most(n, pairs).saturating_add(more).min(n / TUNING.krylov.largest_share),
                least_shift: self.wanted.least_shift,
                pairs,
                columns: pairs,
                tolerance,
                seed: self.wanted.seed.wrapping_add(self.counts.len() as u64),
                leave: Leave::Nothing,
                zeros: None,
                loosely: tolerance >= TUNING.slices.loose,
            };
            monitor.detail(&format!("slice of pairs {from} to {} of {total}", from + pairs));
            let Some(mut found) = lanczos::pairs(level, symbolic, kernel, &shift, wanted, &mut self.memory, monitor)?
            else {
                return given_up(monitor, &format!("a Krylov space did not contain the {pairs} pairs from {from} on"));
            };
            let taken = if last { found.values.len() } else { joint(&found.values, pairs) };
            // Each slice reaches beyond its shift.
            if taken == 0 || from + taken < shift.below {
                let reached = from + taken;
                let reason =
                    format!("the slice from pair {from} on ends at {reached}, below its own shift at {}", shift.below);
                return given_up(monitor, &reason);
            }
            self.memory.extend(found.vectors.split_off(taken));
            self.vectors.assign(&(from..from + taken).collect::<Vec<_>>(), &found.vectors);
            self.values.extend_from_slice(&found.values[..taken]);
            self.memory.extend(found.vectors.into_panels());
            // Those of the kernel lie below the shift as well.
            let below = shift.below + self.kernel.dimension();
            self.counts.push(Count { below, ..Count::of(level, shift.at, &shift.factor) });
            scout.keep_storage(shift.factor);
        }
        self.keep_certain_counts();
        if !self.join()? {
            return given_up(monitor, DEPENDENT);
        }
        self.vectors.keep_columns(self.values.len());
        let Some(defect) = self.separate()? else { return given_up(monitor, DEPENDENT) };
        let Self { values, vectors, counts, .. } = self;
        Ok(Some(Sliced { values, vectors, cuts: Cuts { counts, defect } }))
    }

    /// A guess where the middle of a slice lies that begins with an index.
    fn guess(&self, scout: &Scout<'_>, from: usize, size: f64) -> f64 {
        let step = self.values.len().min(self.slice / 2);
        if step < 2 {
            return scout.distance(0.5 * size);
        }
        let last = self.values[from - 1];
        last + 0.5 * size * (last - self.values[from - step]) / (step - 1) as f64
    }

    /// Gives up counts whose shift lies next to a value: they prove nothing there, and the segments on both sides become one. Of many shifts some
    /// happen to lie so.
    fn keep_certain_counts(&mut self) {
        let (known, values) = (self.kernel.dimension(), &self.values);
        self.counts.retain(|count| is_certain(count, values, known));
    }

    /// The columns between each two shifts, those below the first and those above the last.
    fn segments(&self) -> Vec<Range<usize>> {
        let known = self.kernel.dimension();
        let mut start = 0;
        let ends = self.counts.iter().map(|count| count.below - known).chain([self.values.len()]);
        ends.map(|end| std::mem::replace(&mut start, end)..end).collect()
    }

    /// Makes the columns of each segment Ritz vectors of their span; says whether they were independent.
    fn join(&mut self) -> Result<bool, HsimError> {
        let Self { level, monitor, .. } = *self;
        for segment in self.segments() {
            let range: Vec<usize> = segment.clone().collect();
            let mut columns = self.vectors.select_into(&range, &mut self.memory);
            let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &columns, monitor)?;
            let (values, rotation) = ritz(stiffness, gram, range.len(), monitor)?;
            if values.len() < range.len() {
                return Ok(false);
            }
            rotate(&mut columns, &rotation, monitor)?;
            self.vectors.assign(&range, &columns);
            self.memory.extend(columns.into_panels());
            self.values[segment].copy_from_slice(&values);
        }
        Ok(self.values.is_sorted())
    }

    /// Makes columns of different segments orthogonal; gives a bound on what is left of their products, nothing where they are no columns of
    /// different pairs.
    fn separate(&mut self) -> Result<Option<f64>, HsimError> {
        let Self { level, monitor, .. } = *self;
        for _ in 0..MOST_TIMES {
            let mut products = gram(&level.mass, &self.vectors, monitor)?;
            let (mut worst, mut longest) = (0f64, 0f64);
            for segment in self.segments() {
                for column in segment.clone() {
                    let entries = products.column_mut(column);
                    entries[segment.clone()].fill(0.0);
                    worst = entries.iter().fold(worst, |worst, x| worst.max(x.abs()));
                    longest = longest.max(entries.iter().map(|x| x * x).sum());
                }
            }
            monitor.detail(&format!("products between segments: {worst:e}"));
            if worst <= NOTHING {
                return Ok(Some(worst));
            }
            if !(longest <= LARGE * LARGE) {
                return Ok(None);
            }
            self.take_off(&products)?;
            if longest <= SMALL * SMALL {
                // Products of two products are left, and rounding errors.
                return Ok(Some(4.0 * longest + NOTHING));
            }
            // Those that are left within segments are no smaller.
            if !self.join()? {
                return Ok(None);
            }
        }
        Ok(None)
    }

    /// Takes the products of columns of different segments off them. From which of two is a matter of their residuals: what a column has of another
    /// is an error of the one that is less exact, and taken off the other it would be one of that.
    fn take_off(&mut self, products: &DenseMatrix) -> Result<(), HsimError> {
        let sums = residual_sums(&self.level.stiffness, &self.level.mass, &self.vectors, &self.values, self.monitor)?;
        let share = |of: usize, other: usize| {
            let (own, other) = (sums[of].residual, sums[other].residual);
            if own + other > 0.0 { own / (own + other) } else { 0.5 }
        };
        for segment in self.segments() {
            let part = |row: usize, column: usize| share(column, row) * products.column(column)[row];
            let large = |row: &usize| segment.clone().any(|column| part(*row, column).abs() > NEGLIGIBLE);
            let others: Vec<usize> = (0..products.rows()).filter(large).collect();
            let range: Vec<usize> = segment.clone().collect();
            if others.is_empty() {
                continue;
            }
            self.monitor.detail(&format!("{} columns take off {}", range.len(), others.len()));
            let mut columns = self.vectors.select_into(&range, &mut self.memory);
            // Some at a time: a copy of all would be one of the whole.
            for others in others.chunks(TUNING.slices.pairs) {
                let mut parts = DenseMatrix::zeros(others.len(), range.len());
                for (to, &column) in range.iter().enumerate() {
                    let entries = parts.column_mut(to).iter_mut();
                    entries.zip(others).for_each(|(entry, &row)| *entry = part(row, column));
                }
                let others = self.vectors.select_into(others, &mut self.memory);
                subtract_combinations(&mut columns, &others, &parts, self.monitor)?;
                self.memory.extend(others.into_panels());
            }
            self.vectors.assign(&range, &columns);
            self.memory.extend(columns.into_panels());
        }
        Ok(())
    }
}

/// Whether no value lies so near the shift of a count that rounding could have it on the other side; `known` values of the kernel lie below all.
fn is_certain(count: &Count, values: &[f64], known: usize) -> bool {
    let below = count.below.saturating_sub(known);
    let beside = [below.checked_sub(1).and_then(|last| values.get(last)), values.get(below)];
    beside.into_iter().flatten().all(|value| (value - count.shift).abs() > CERTAIN * count.radius)
}

/// How many times the uncertainty of a count lies between its shift and the next value, at least: values are uncertain too.
const CERTAIN: f64 = 4.0;

/// Why slices are given up whose columns are not those of different pairs.
const DEPENDENT: &str = "neighbouring slices do not hold distinct pairs";

/// Of a product, a part that is not worth being taken off.
const NEGLIGIBLE: f64 = 0.25 * NOTHING;

/// How many eigenvalues lie below the middle of a slice.
fn target(from: usize, size: f64) -> Target {
    let below = from as f64 + 0.5 * size;
    let within = |share: f64| below - share * size..=below + share * size;
    Target { below, enough: within(NEAR), at_last: within(NEAR_ENOUGH) }
}

/// How many of ascending values are taken before the widest gap at their end; none where there is no gap.
fn joint(values: &[f64], pairs: usize) -> usize {
    let gap = |k: usize| (values[k] - values[k - 1]) / values[k].abs();
    let places = pairs.saturating_sub(2 * JOINT).max(1)..pairs;
    places.max_by(|&a, &b| gap(a).total_cmp(&gap(b))).filter(|&k| gap(k) > LEAST_GAP).unwrap_or(0)
}

#[cfg(test)]
#[path = "slices_tests.rs"]
mod tests;
