//! Where the lowest eigenvalues of a pencil lie, by inertia counts at a few shifts: what a start without geometry needs
//! to know of it.

use chladni_algebra::{Factor, SparseMatrix, SymbolicFactor};
use chladni_base::Monitor;

use super::HsimError;
use super::cuts::Part;
use super::lanczos::Shift;
use super::level::Level;
use super::shifts::{self, factor_near};

/// Eigenvalues above this share of the largest below zero are taken for zero.
pub(super) const NEGLIGIBLE: f64 = 1e-10;

/// Shifts that are tried on the way up.
const MOST: usize = 8;

/// The same for one shift among eigenvalues where factors are sparse, of so many entries a row at most: clusters a
/// hundred-thousandth of their distance from zero wide, as of a graph with a hub, take so many halvings. Without a
/// shift among them a space does not tell them apart.
const MOST_SPARSE: usize = 30;
const MOST_STRICTLY: usize = 60;
const SPARSE: usize = 100;

/// What is closer together is one eigenvalue of many vectors.
pub(super) const NARROW: f64 = 1e-9;

/// How far below one eigenvalue of many vectors a shift lies, relative to it.
const BELOW_ONE: f64 = 1e-6;

/// So many times the wanted number of eigenvalues are aimed at.
const ABUNDANT: f64 = 1.6;

/// What lies below a shift in the middle, as shares of all that is wanted: aimed at, good enough, and good enough after
/// some shifts, as among multiplets.
const MIDDLE: f64 = 0.48;
const MIDDLE_ENOUGH: std::ops::RangeInclusive<f64> = 0.42..=0.56;
const MIDDLE_AT_LAST: std::ops::RangeInclusive<f64> = 0.1..=0.85;
const SOME: usize = 4;

/// The window is good that holds between the wanted number of eigenvalues and this many times as many.
const ENOUGH: usize = 3;

/// Rows with more entries than this on average are those of solids, or of anything else that fills in more than
/// surfaces do.
const ENTRIES_OF_SURFACE: usize = 10;

/// The median of the diagonal of a Laplacian of cotangents, on triangles of the usual quality; 2√3 where all are
/// equilateral.
const DIAGONAL: f64 = 3.8;

/// Whether a matrix fills in more than those of surfaces.
pub(super) fn fills_in(matrix: &SparseMatrix) -> bool {
    matrix.entries() > ENTRIES_OF_SURFACE * matrix.rows()
}

/// Shifts between which the lowest eigenvalues lie.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    /// No eigenvalue lies below.
    pub low: f64,
    /// About as many as are wanted lie below, or more.
    pub high: f64,
    /// Whether no eigenvalue lies below zero, up to rounding.
    pub semidefinite: bool,
}

impl Window {
    /// A factor at a shift below all eigenvalues, by a little of the window's width.
    pub fn factor_below<'a>(
        &self,
        level: &Level,
        symbolic: &'a SymbolicFactor,
        monitor: &dyn Monitor,
    ) -> Result<Factor<'a>, HsimError> {
        Ok(self.shift_below(level, symbolic, monitor)?.factor)
    }

    /// The same with its shift.
    pub fn shift_below<'a>(
        &self,
        level: &Level,
        symbolic: &'a SymbolicFactor,
        monitor: &dyn Monitor,
    ) -> Result<Shift<'a>, HsimError> {
        let below = self.low - (self.high - self.low).abs() / 16.0;
        let (at, factor) = factor_near(level, symbolic, below, level.spread(), Vec::new(), monitor)?;
        Ok(Shift { at, factor, below: 0 })
    }
}

/// A distance that was tried, and the eigenvalues counted within it.
type CountedDistance = Option<(f64, usize)>;

/// How many eigenvalues are to lie below a shift: aimed at, good enough, and good enough after some shifts.
#[derive(Debug, Clone)]
pub(super) struct Target {
    pub below: f64,
    pub enough: std::ops::RangeInclusive<f64>,
    pub at_last: std::ops::RangeInclusive<f64>,
}

/// What counts are made with.
pub(super) struct Scout<'a> {
    pub level: &'a Level,
    pub symbolic: &'a SymbolicFactor,
    monitor: &'a dyn Monitor,
    spread: f64,
    storage: Vec<f64>,
    /// What the count below zero said, once it was made.
    semidefinite: Option<bool>,
    /// Counts that may still be made to find cuts.
    pub for_cuts: usize,
}

impl<'a> Scout<'a> {
    pub fn new(level: &'a Level, symbolic: &'a SymbolicFactor, monitor: &'a dyn Monitor) -> Self {
        let (spread, storage) = (level.spread(), Vec::new());
        Self { level, symbolic, monitor, spread, storage, semidefinite: None, for_cuts: 0 }
    }

    /// About the largest eigenvalue, or more.
    pub fn spread(&self) -> f64 {
        self.spread
    }

    /// The eigenvalues below a shift.
    pub fn count(&mut self, shift: f64) -> Result<usize, HsimError> {
        Ok(shifts::count_near(self.level, self.symbolic, shift, self.spread(), self.monitor)?.below)
    }

    /// Whether no eigenvalue lies below zero, up to rounding.
    pub fn is_semidefinite(&mut self) -> Result<bool, HsimError> {
        if let Some(known) = self.semidefinite {
            return Ok(known);
        }
        let semidefinite = self.count(-NEGLIGIBLE * self.spread())? == 0;
        self.semidefinite = Some(semidefinite);
        Ok(semidefinite)
    }

    /// A window that holds the lowest `wanted` eigenvalues, or those below `bound`. With a `kernel`, zero is an
    /// eigenvalue.
    pub fn window(
        &mut self,
        wanted: usize,
        bound: Option<f64>,
        kernel: bool,
        monitor: &dyn Monitor,
    ) -> Result<Window, HsimError> {
        let spread = self.spread();
        let zero = NEGLIGIBLE * spread;
        let semidefinite = self.is_semidefinite()?;
        let base = if semidefinite { -zero } else { self.floor(zero, monitor)? };
        if let Some(bound) = bound {
            return self.tighten(base, bound, kernel && semidefinite, semidefinite);
        }
        if !semidefinite {
            let high = self.end_of_lowest(wanted, base, monitor)?;
            return self.tighten(base, high, false, semidefinite);
        }
        let mut at = self.distance(wanted as f64).max(zero).min(spread);
        let (mut few, mut many): (CountedDistance, CountedDistance) = (None, None);
        for _ in 0..MOST {
            monitor.checkpoint()?;
            let found = self.count(base + at)?;
            if found < wanted {
                few = Some((at, found));
            } else {
                many = Some((at, found));
                if found <= ENOUGH * wanted {
                    break;
                }
            }
            at = next(few, many, ABUNDANT * wanted as f64).min(spread - base);
        }
        let high = base + many.or(few).map_or(spread, |(at, _)| at);
        let low = few.filter(|&(_, found)| found == 0).map_or(base, |(at, _)| base + at);
        self.tighten(low, high, kernel && semidefinite, semidefinite)
    }

    /// A shift with the lowest `wanted` eigenvalues below and not many more, where some are negative and none lies
    /// below `floor`. No law tells how far apart they lie, and a few may lie far below all others: it is halves that
    /// find it.
    fn end_of_lowest(&mut self, wanted: usize, floor: f64, monitor: &dyn Monitor) -> Result<f64, HsimError> {
        let (spread, most) = (self.spread(), self.most_counts());
        let (mut few, first) = (floor, -floor / 64.0);
        let (mut many, mut found) = self.count_beside(first, first / 32.0)?;
        while found < wanted && many < spread {
            monitor.checkpoint()?;
            few = many;
            (many, found) = self.count_beside((16.0 * many).min(spread), many / 32.0)?;
        }
        for _ in 0..most {
            let width = many - few;
            if found <= ENOUGH * wanted || width <= NARROW * many.abs().max(few.abs()) {
                break;
            }
            monitor.checkpoint()?;
            let (middle, below) = self.count_beside(few + 0.5 * width, width / 32.0)?;
            if below < wanted {
                few = middle;
            } else {
                (many, found) = (middle, below);
            }
        }
        Ok(many)
    }

    /// The eigenvalues below a shift, or a little beside it where no factor is found there: zero is an eigenvalue of
    /// many a matrix, and a diagonal of zeros hides what lies next to it. And where they were counted.
    pub fn count_beside(&mut self, shift: f64, step: f64) -> Result<(f64, usize), HsimError> {
        match self.count(shift) {
            Err(HsimError::Numerical(_)) => Ok((shift + step, self.count(shift + step)?)),
            found => Ok((shift, found?)),
        }
    }

    /// How many counts a search may take.
    pub fn most_counts(&self) -> usize {
        if self.is_sparse() { MOST_SPARSE } else { MOST }
    }

    /// Whether factors are so sparse that many counts cost little.
    pub fn is_sparse(&self) -> bool {
        self.symbolic.entries() <= SPARSE * self.level.size()
    }

    /// A positive shift with about half of the lowest `wanted` eigenvalues below that are not those of the kernel;
    /// nothing where none is found, as among eigenvalues of high multiplicity or many negative ones, or below the
    /// `least` share of the spread.
    pub fn middle(
        &mut self,
        (wanted, kernel): (usize, usize),
        least: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Shift<'a>>, HsimError> {
        // One at least: from a shift below all that is wanted a cluster far above it is a cluster.
        let at_last = shares(MIDDLE_AT_LAST, wanted);
        let at_last = at_last.start().max(1.0)..=*at_last.end();
        let target = Target { below: MIDDLE * wanted as f64, enough: shares(MIDDLE_ENOUGH, wanted), at_last };
        let first = self.distance(target.below);
        self.shift_below(&target, (first, least), kernel, monitor)
    }

    /// As [`Self::middle`] with a shift that is no less in the middle after many tries than after few, or else above
    /// all that is wanted, where factors are sparse: of two values and a cluster above them, a shift between these is
    /// among the wanted values, and no space tells the cluster apart from there.
    pub fn strict_middle(
        &mut self,
        (wanted, kernel): (usize, usize),
        least: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Shift<'a>>, HsimError> {
        if !self.is_sparse() {
            return Ok(None);
        }
        let count = wanted as f64;
        let middle = (MIDDLE_ENOUGH.start() * count).ceil()..=(MIDDLE_ENOUGH.end() * count).floor();
        let above = count..=(1.5 * count + 8.0);
        for (below, enough) in [(MIDDLE * count, middle), (1.2 * count + 2.0, above)] {
            let first = self.distance(below);
            let target = Target { below, at_last: enough.clone(), enough };
            let found = self.shift_below(&target, (first, least), kernel, monitor)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// A positive shift with about so many eigenvalues below that are not those of the kernel, looked for from a first
    /// guess; nothing where none is found that is at least some share of the spread.
    pub fn shift_below(
        &mut self,
        target: &Target,
        (first, least): (f64, f64),
        kernel: usize,
        monitor: &dyn Monitor,
    ) -> Result<Option<Shift<'a>>, HsimError> {
        let spread = self.spread();
        let mut at = first.clamp(least * spread, spread);
        let (mut few, mut many): (CountedDistance, CountedDistance) = (None, None);
        let most = match (self.is_sparse(), target.enough == target.at_last) {
            (true, true) => MOST_STRICTLY,
            (true, false) => MOST_SPARSE,
            (false, _) => MOST,
        };
        for attempt in 0..most {
            monitor.checkpoint()?;
            if let (true, Some((low, _)), Some((high, _))) = (attempt >= MOST, few, many)
                && high - low <= NARROW * high
            {
                break;
            }
            let enough = if attempt < SOME { &target.enough } else { &target.at_last };
            let storage = std::mem::take(&mut self.storage);
            let (shift, factor) = match factor_near(self.level, self.symbolic, at, spread, storage, self.monitor) {
                // On an eigenvalue of many vectors, such as the zero of an operator that is not semidefinite.
                Err(HsimError::Numerical(_)) => return Ok(None),
                factored => factored?,
            };
            let below = factor.eigenvalues_below().saturating_sub(kernel);
            if enough.contains(&(below as f64)) {
                return Ok(Some(Shift { at: shift, factor, below }));
            }
            self.storage = factor.into_storage();
            if (below as f64) < target.below {
                few = Some((at, below));
            } else {
                // Where nothing is known of the pencil, these may lie below zero for the most part.
                if many.is_none() && self.level.positions.is_empty() && !self.is_semidefinite()? {
                    return Ok(None);
                }
                many = Some((at, below));
            }
            at = match (few, many) {
                // Where a law does not hold, halves do.
                (Some((low, _)), Some((high, _))) if attempt >= SOME && attempt % 2 == 0 => 0.5 * (low + high),
                _ => next(few, many, target.below),
            };
            at = at.clamp(least * spread, spread);
        }
        // Nothing lies between one eigenvalue of many vectors and nothing: of a few that are wanted a shift below will
        // do.
        let Some((at, 0)) = few.filter(|_| *target.at_last.start() <= 1.0) else { return Ok(None) };
        let (at, factor) =
            factor_near(self.level, self.symbolic, at, spread, std::mem::take(&mut self.storage), self.monitor)?;
        let below = factor.eigenvalues_below().saturating_sub(kernel);
        Ok(Some(Shift { at, factor, below }))
    }

    /// As [`Self::middle`] where some eigenvalues are negative: a shift of either sign, inside a part of the spectrum.
    /// A few values may lie far below all others.
    pub fn middle_of(&mut self, part: &Part, monitor: &dyn Monitor) -> Result<Option<Shift<'a>>, HsimError> {
        let (from, wanted) = (part.from, part.count);
        let (target, spread) = (MIDDLE * wanted as f64, self.spread());
        let (enough, at_last) = (shares(MIDDLE_ENOUGH, wanted), shares(MIDDLE_AT_LAST, wanted));
        let most = 2 * self.most_counts();
        let (mut few, mut many) = ((part.low, 0), (part.high, None));
        for attempt in 0..most {
            monitor.checkpoint()?;
            let width = many.0 - few.0;
            if !(width > NARROW * many.0.abs().max(few.0.abs())) {
                break;
            }
            let share = match many.1 {
                Some(above) if attempt % 2 == 1 => ((target - few.1 as f64) / (above - few.1) as f64).clamp(0.05, 0.95),
                _ => 0.5,
            };
            let storage = std::mem::take(&mut self.storage);
            let factored = factor_near(self.level, self.symbolic, few.0 + share * width, spread, storage, self.monitor);
            let (at, factor) = match factored {
                Err(HsimError::Numerical(_)) => return Ok(None),
                factored => factored?,
            };
            let below = factor.eigenvalues_below().saturating_sub(from);
            if (if attempt < most / 2 { &enough } else { &at_last }).contains(&(below as f64)) {
                return Ok(Some(Shift { at, below: from + below, factor }));
            }
            self.storage = factor.into_storage();
            if (below as f64) < target {
                few = (at, below);
            } else {
                many = (at, Some(below));
            }
        }
        if few.1 > 0 {
            return Ok(None);
        }
        // Most of it is in one place.
        self.shift_at(few.0 - (1e-3 * (part.high - part.low)).max(BELOW_ONE * few.0.abs()), from)
    }

    /// A shift that is given, if so many eigenvalues lie below.
    pub fn shift_at(&mut self, at: f64, below: usize) -> Result<Option<Shift<'a>>, HsimError> {
        let storage = std::mem::take(&mut self.storage);
        let (at, factor) = factor_near(self.level, self.symbolic, at, self.spread(), storage, self.monitor)?;
        Ok((factor.eigenvalues_below() == below).then_some(Shift { at, factor, below }))
    }

    /// Memory of a factor that is not needed any more, for the next one.
    pub fn keep_storage(&mut self, factor: Factor<'_>) {
        self.storage = factor.into_storage();
    }

    /// How far above zero so many eigenvalues reach, roughly: by Weyl's law in two dimensions or in three. Where there
    /// are positions, the mass is area.
    pub fn distance(&self, wanted: f64) -> f64 {
        let (n, fills_in) = (self.level.size(), fills_in(&self.level.stiffness));
        if !fills_in && !self.level.positions.is_empty() {
            let area: f64 = self.level.mass.lumped().iter().sum();
            return 4.0 * std::f64::consts::PI * wanted / area;
        }
        let median = |mut numbers: Vec<f64>| *numbers.select_nth_unstable_by(n / 2, f64::total_cmp).1;
        if fills_in {
            return median(self.level.ratios()) * (wanted / n as f64).powf(2.0 / 3.0);
        }
        // In two dimensions the energy has no length in it: its diagonal tells the factor by which someone may have
        // scaled it.
        let own = |row: usize| {
            let (columns, entries) = self.level.stiffness.row(row);
            columns.binary_search(&(row as u32)).map_or(0.0, |at| entries[at])
        };
        let energy = median((0..n).map(own).collect());
        let mass: f64 = self.level.mass.lumped().iter().sum();
        4.0 * std::f64::consts::PI * (energy / DIAGONAL) * wanted / mass
    }

    /// A shift with no eigenvalue below, where some are negative.
    fn floor(&mut self, zero: f64, monitor: &dyn Monitor) -> Result<f64, HsimError> {
        let (mut inside, mut outside) = (zero, 2.0 * self.level.mass.lumped_ratio() * self.spread());
        while outside > 2.0 * inside {
            monitor.checkpoint()?;
            let middle = (inside * outside).sqrt();
            if self.count(-middle)? > 0 {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        Ok(-outside)
    }

    /// The window with its lower end raised, where the lowest eigenvalue lies well above it.
    fn tighten(&mut self, low: f64, high: f64, has_zero: bool, semidefinite: bool) -> Result<Window, HsimError> {
        let quarter = low + 0.25 * (high - low);
        let raised = !has_zero && high > low && self.count(quarter)? == 0;
        Ok(Window { low: if raised { quarter } else { low }, high, semidefinite })
    }
}

/// Shares of so many pairs: of a few, a whole number has to do.
fn shares(shares: std::ops::RangeInclusive<f64>, wanted: usize) -> std::ops::RangeInclusive<f64> {
    (shares.start() * wanted as f64).floor()..=(shares.end() * wanted as f64).ceil()
}

/// The next distance to try for a number of eigenvalues, from one with too few and one with too many.
fn next(few: CountedDistance, many: CountedDistance, target: f64) -> f64 {
    match (few, many) {
        (Some((low, below)), Some((high, above))) if below > 0 => {
            // A power law through both, kept inside.
            let power = (high / low).ln() / (above as f64 / below as f64).ln();
            let at = low * (target / below as f64).powf(power);
            at.clamp(low * (high / low).powf(0.1), low * (high / low).powf(0.9))
        }
        (Some((low, _)), Some((high, _))) => (low * high).sqrt(),
        (Some((low, 0)), None) => 8.0 * low,
        (Some((low, below)), None) => low * (target / below as f64).powf(1.2).min(64.0),
        (None, Some((high, above))) => high * (target / above as f64).powf(1.5).max(1e-6),
        (None, None) => 1.0,
    }
}
