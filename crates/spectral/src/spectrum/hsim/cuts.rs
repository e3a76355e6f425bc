//! Where a spectrum is cut so that one shift serves what lies between two cuts.

use chladni_base::Monitor;

use super::HsimError;
use super::scout::{NARROW, Scout};

/// Consecutive wanted eigenvalues.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    /// The eigenvalues below it, as many as `from` says, lie below this.
    pub low: f64,
    /// All of its own lie below this.
    pub high: f64,
    /// The index of its first eigenvalue.
    pub from: usize,
    /// How many they are.
    pub count: usize,
}

/// Part of an interval in which half of its eigenvalues lie makes those a cluster.
const NARROW_SHARE: f64 = 1.0 / 16.0;

/// A cluster has what lies within so many times its width, from its upper end on.
const AROUND: f64 = 4.0;

/// An interval narrower than this, relative to its distance from zero, is one place: a shift next to it serves all of
/// it.
const POINT: f64 = 1e-6;

/// The same of an interval with one eigenvalue: the next ones need not be known from a place next to it.
const POINT_OF_ONE: f64 = 1e-3;

/// What is closer than this share of the largest eigenvalue is told apart by rounding alone.
const ROUNDING: f64 = 1e-14;

/// Fewer values than this are no cluster: a space has them whatever they are.
pub(super) const FEW: usize = 4;

/// Cuts take no more counts than so many searches of one shift.
const SEARCHES: usize = 8;

/// The most parts.
const MOST_PARTS: usize = 24;

/// An interval and the eigenvalues below its ends.
#[derive(Debug, Clone, Copy)]
struct Interval {
    low: f64,
    high: f64,
    from: usize,
    to: usize,
}

impl Interval {
    fn width(&self) -> f64 {
        self.high - self.low
    }

    /// Whether its ends are worth telling apart, where the largest eigenvalue is about `spread`.
    fn is_wide(&self, spread: f64) -> bool {
        let point = if self.to - self.from > 1 { POINT } else { POINT_OF_ONE };
        self.width() > (point * self.low.abs().max(self.high.abs())).max(ROUNDING * spread)
    }
}

impl Scout<'_> {
    /// Cuts a part that begins at the lowest eigenvalue, ascending. What lies in one part is spread over it, or most of
    /// it is, as seen from its upper end, next to which all the others lie; but for clusters that are narrower than
    /// numbers tell.
    pub fn cut(&mut self, whole: Part, monitor: &dyn Monitor) -> Result<Vec<Part>, HsimError> {
        if !(self.spread() > 0.0 && whole.high > whole.low) {
            return Ok(vec![whole]);
        }
        self.for_cuts = SEARCHES * self.most_counts();
        let (high, to) = self.spend(whole.high, 1e-3 * (whole.high - whole.low))?;
        let mut open = vec![Interval { low: whole.low, high, from: 0, to }];
        let mut parts = Vec::new();
        while let Some(interval) = open.pop() {
            let interval = self.without_ends(interval, monitor)?;
            if parts.len() + open.len() + 1 < MOST_PARTS
                && let Some((lower, upper)) = self.parted(interval, monitor)?
            {
                // Of what lies above all that is wanted nothing is.
                if upper.from < whole.count {
                    open.push(upper);
                }
                open.push(lower);
                continue;
            }
            let Interval { low, high, from, to } = interval;
            parts.push(Part { low, high, from, count: to.min(whole.count) - from });
        }
        Ok(parts)
    }

    /// An interval with eigenvalues next to its ends, as seen from a distance of its width.
    fn without_ends(&mut self, mut interval: Interval, monitor: &dyn Monitor) -> Result<Interval, HsimError> {
        for share in [0.25, NARROW_SHARE] {
            while self.for_cuts > 0 && interval.is_wide(self.spread()) {
                monitor.checkpoint()?;
                let end = share * interval.width();
                let (low, below) = self.spend(interval.low + end, 0.01 * end)?;
                if below == interval.from {
                    interval.low = low;
                    continue;
                }
                let (high, below) = self.spend(interval.high - end, 0.01 * end)?;
                if below == interval.to {
                    interval.high = high;
                    continue;
                }
                break;
            }
        }
        Ok(interval)
    }

    /// An interval cut below the cluster at its upper end, where there is one.
    fn parted(&mut self, whole: Interval, monitor: &dyn Monitor) -> Result<Option<(Interval, Interval)>, HsimError> {
        let Interval { high, to, .. } = whole;
        let (mut width, mut inside) = (whole.width(), to - whole.from);
        let least = (NARROW * high.abs().max(whole.low.abs())).max(ROUNDING * self.spread());
        while self.for_cuts > 0 && inside >= FEW && width > least {
            monitor.checkpoint()?;
            let mut cluster = self.within(&whole, NARROW_SHARE * width)?;
            if 2 * cluster < inside {
                let inside_before = inside;
                while self.for_cuts > 0 && 4 * inside > 3 * inside_before && width > least {
                    monitor.checkpoint()?;
                    width *= 0.7;
                    inside = self.within(&whole, width)?;
                }
                continue;
            }
            // The widest cluster that is spread over its own width.
            let mut narrow = NARROW_SHARE * width;
            while self.for_cuts > 0 && narrow > least {
                let narrower = self.within(&whole, NARROW_SHARE * narrow)?;
                if 2 * narrower < cluster {
                    break;
                }
                (narrow, cluster) = (NARROW_SHARE * narrow, narrower);
            }
            let (at, below) = self.spend(high - AROUND * narrow, 0.01 * narrow)?;
            if below > whole.from && below < to {
                return Ok(Some((
                    Interval { high: at, to: below, ..whole },
                    Interval { low: at, from: below, ..whole },
                )));
            }
            return Ok(None);
        }
        Ok(None)
    }

    /// How many eigenvalues lie within a distance of the upper end.
    fn within(&mut self, of: &Interval, distance: f64) -> Result<usize, HsimError> {
        Ok(of.to.saturating_sub(self.spend(of.high - distance, 0.01 * distance)?.1))
    }

    /// As [`Self::count_beside`], for cuts.
    fn spend(&mut self, shift: f64, step: f64) -> Result<(f64, usize), HsimError> {
        self.for_cuts = self.for_cuts.saturating_sub(1);
        self.count_beside(shift, step)
    }
}
