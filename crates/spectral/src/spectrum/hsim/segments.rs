//! The columns of several slices as those of one problem.
//!
//! Spaces know nothing of each other: columns of two slices are orthogonal up to their residuals. Between two shifts
//! lie the upper half of one slice and the lower half of the next, and a Rayleigh–Ritz makes them pairs of one segment.
//! Segments meet at the shifts, where columns of one space are at their most exact; what is left of products between
//! columns of different segments is taken off, from the less exact one of each two.

use std::ops::Range;

use chladni_algebra::{DenseMatrix, PanelMatrix, gram, residual_sums, restrict, rotate, subtract_combinations};
use chladni_base::Monitor;

use super::HsimError;
use super::judge::Count;
use super::kernel::Kernel;
use super::level::Level;
use super::ritz::ritz;
use super::tuning::TUNING;

/// Products between columns of different segments that may stay, those whose squares may, and those that are too large
/// for columns of different eigenvalues.
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

/// Pairs of slices that follow each other, by ascending value, and what they become.
pub(super) struct Assembly<'a> {
    pub level: &'a Level,
    pub kernel: &'a Kernel<'a>,
    pub monitor: &'a dyn Monitor,
    /// The pairs so far, with room for more.
    pub vectors: PanelMatrix,
    pub values: Vec<f64>,
    /// Panels that are not needed any more: fresh memory costs as much as what is done with it.
    pub memory: Vec<Vec<f64>>,
    /// Counts at the shifts so far, one in each slice.
    pub counts: Vec<Count>,
}

impl<'a> Assembly<'a> {
    /// No pairs yet, with room for so many.
    pub fn new(level: &'a Level, kernel: &'a Kernel<'a>, pairs: usize, monitor: &'a dyn Monitor) -> Self {
        Self {
            level,
            kernel,
            monitor,
            vectors: PanelMatrix::zeros(level.size(), pairs),
            values: Vec::new(),
            memory: Vec::new(),
            counts: Vec::new(),
        }
    }

    /// Takes up the pairs that come next, and the count among them.
    pub fn extend(&mut self, values: &[f64], vectors: PanelMatrix, count: Count) {
        let from = self.values.len();
        self.vectors.assign(&(from..from + values.len()).collect::<Vec<_>>(), &vectors);
        self.values.extend_from_slice(values);
        self.memory.extend(vectors.into_panels());
        self.counts.push(count);
    }

    /// Orthonormal pairs of all slices; nothing where they are no columns of different pairs.
    pub fn finish(mut self) -> Result<Option<Sliced>, HsimError> {
        self.keep_certain_counts();
        if !self.join()? {
            return Ok(None);
        }
        self.vectors.keep_columns(self.values.len());
        let Some(defect) = self.separate()? else { return Ok(None) };
        let Self { values, vectors, counts, .. } = self;
        Ok(Some(Sliced { values, vectors, cuts: Cuts { counts, defect } }))
    }

    /// Gives up counts whose shift lies next to a value: they prove nothing there, and the segments on both sides
    /// become one. Of many shifts some happen to lie so.
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

    /// Makes columns of different segments orthogonal; gives a bound on what is left of their products, nothing where
    /// they are no columns of different pairs.
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

    /// Takes the products of columns of different segments off them. From which of two is a matter of their residuals:
    /// what a column has of another is an error of the one that is less exact, and taken off the other it would be one
    /// of that.
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

/// Whether no value lies so near the shift of a count that rounding could have it on the other side; `known` values of
/// the kernel lie below all.
pub(super) fn is_certain(count: &Count, values: &[f64], known: usize) -> bool {
    let below = count.below.saturating_sub(known);
    let beside = [below.checked_sub(1).and_then(|last| values.get(last)), values.get(below)];
    beside.into_iter().flatten().all(|value| (value - count.shift).abs() > CERTAIN * count.radius)
}

/// How many times the uncertainty of a count lies between its shift and the next value, at least: values are uncertain
/// too.
const CERTAIN: f64 = 4.0;

/// Why slices are given up whose columns are not those of different pairs.
pub(super) const DEPENDENT: &str = "neighbouring slices do not hold distinct pairs";

/// Of a product, a part that is not worth being taken off.
const NEGLIGIBLE: f64 = 0.25 * NOTHING;
