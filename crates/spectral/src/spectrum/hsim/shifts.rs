//! Shifts for columns by their values, and factors there.

use std::ops::Range;

use chladni_algebra::{Factor, FactorError, PANEL_WIDTH, SymbolicFactor};
use chladni_base::Monitor;

use super::HsimError;
use super::iterate::Plan;
use super::judge::Count;
use super::level::Level;

/// Consecutive panels with one shift.
#[derive(Debug, Clone)]
pub(super) struct Group {
    pub panels: Range<usize>,
    pub shift: f64,
    /// Columns of these panels that lie too far below the shift.
    pub strays: Vec<Strays>,
}

/// Consecutive columns with a shift of their own: values far below all others, which a solve with the shift of the
/// others would turn into what the block lacks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Strays {
    pub columns: Range<usize>,
    pub shift: f64,
}

/// Groups of panels for ascending values. The first panel has a low shift of its own: relative to their eigenvalues,
/// the lowest columns need the most of a solve.
pub(super) fn groups(values: &[f64], plan: &Plan) -> Vec<Group> {
    let panels = values.len().div_ceil(PANEL_WIDTH);
    let top = values.last().copied().unwrap_or_default();
    let group = |panels: Range<usize>, by: usize| {
        let from = panels.start * PANEL_WIDTH;
        let members = &values[from..(panels.end * PANEL_WIDTH).min(values.len())];
        let shift = shift(&members[..by.min(members.len())], top);
        Group { panels, shift, strays: strays(members, shift, top, from) }
    };
    let mut groups = vec![group(0..1.min(panels), LOWEST)];
    let count = (panels - 1).div_ceil(plan.panels_per_shift);
    groups.extend(
        (0..count).map(|k| group(1 + k * (panels - 1) / count..1 + (k + 1) * (panels - 1) / count, usize::MAX)),
    );
    groups
}

/// The shift of the first panel lies near the middle of so many values.
pub(super) const LOWEST: usize = 12;

/// A shift near the middle of ascending values, in the widest gap there; just below them where they are as good as one.
/// The block ends at `top`: values that lie much closer to it than to zero, as beside a large constant, are one where
/// they are so beside that distance.
pub(super) fn shift(values: &[f64], top: f64) -> f64 {
    let values = without_outliers(values);
    let (least, most) = (values[0], values[values.len() - 1]);
    let unit = |value: f64| unit(value, least, top);
    let (middle, reach) = (0.5 * (least + most), 0.12 * (most - least));
    let gap = values
        .windows(2)
        .filter(|pair| (0.5 * (pair[0] + pair[1]) - middle).abs() <= reach)
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    match gap {
        Some(pair) if pair[1] - pair[0] > CLUSTER * unit(middle) => 0.5 * (pair[0] + pair[1]),
        _ if reach > CLUSTER * unit(middle) => middle,
        _ if least == 0.0 => -BELOW_ZERO,
        _ => least - CLUSTER_OFFSET * unit(least),
    }
}

/// What differences of values from `least` on are measured by in a block that ends at `top`: themselves, or how far
/// they are from there, if they lie next to it.
pub(super) fn unit(value: f64, least: f64, top: f64) -> f64 {
    let (reach, size) = (top - least, value.abs());
    if reach > ONE * size && reach < NEXT_TO * size { reach } else { size }
}

/// Ascending values without those at the ends that lie so far out that the middle between the ends is not among the
/// middle half of the values.
fn without_outliers(mut values: &[f64]) -> &[f64] {
    loop {
        let (quarter, last) = (values.len() / 4, values.len() - 1);
        let middle = 0.5 * (values[0] + values[last]);
        if quarter == 0 || values[quarter] <= middle && middle <= values[last - quarter] {
            return values;
        }
        values = &values[quarter..=last - quarter];
    }
}

/// Those of ascending values, the columns from `from` on, that lie too far below the shift of their group, as measured
/// by how far above it the block ends: a solve damps what lies beyond the block by the ratio of the two. They are
/// parted at their widest gaps until their own shifts serve them.
pub(super) fn strays(values: &[f64], shift: f64, top: f64, from: usize) -> Vec<Strays> {
    let count = values.partition_point(|&value| shift - value > FAR_BELOW * (top - shift).abs());
    let mut strays = Vec::new();
    let mut open: Vec<Range<usize>> = std::iter::once(0..count).filter(|range| !range.is_empty()).collect();
    while let Some(range) = open.pop() {
        let part = &values[range.clone()];
        let own = self::shift(part, top);
        let farthest = (part[0] - own).abs().max((part[part.len() - 1] - own).abs());
        let parts = strays.len() + open.len() + 1;
        if part.len() == 1 || farthest <= SERVED * (top - own).abs() || parts >= MOST_PARTS {
            strays.push(Strays { columns: from + range.start..from + range.end, shift: own });
            continue;
        }
        let widest = (1..part.len()).max_by(|&a, &b| (part[a] - part[a - 1]).total_cmp(&(part[b] - part[b - 1])));
        let cut = range.start + widest.unwrap_or(1);
        open.extend([range.start..cut, cut..range.end]);
    }
    strays
}

/// Columns so many times farther below a shift than the end of the block lies above it have another. Columns of the
/// last panel, with their shift in the middle, lie about as far.
const FAR_BELOW: f64 = 2.0;

/// A shift of strays serves them where they lie no farther from it than this share of the way to the end of the block.
const SERVED: f64 = 0.25;

/// The most shifts of the strays of one group.
const MOST_PARTS: usize = 8;

/// Values whose gaps are smaller than this, relative to themselves, are not told apart by a shift.
const CLUSTER: f64 = 1e-3;

/// Values are next to the end of the block that lie at so small a share of themselves from it.
const NEXT_TO: f64 = 0.02;

/// What is closer together than this share is one value, whatever lies around it.
const ONE: f64 = 1e-7;

/// How far below a cluster its shift lies, relative to it.
const CLUSTER_OFFSET: f64 = 3e-3;

/// How far below zero the shift lies where nothing is known of any value: on unit area, the first positive one of the
/// sphere is 25.
const BELOW_ZERO: f64 = 0.5;

/// A factor at the shift, or beside it where it lies on an eigenvalue; and where. `spread` is about the largest
/// eigenvalue.
pub(super) fn factor_near<'a>(
    level: &Level,
    symbolic: &'a SymbolicFactor,
    shift: f64,
    spread: f64,
    mut storage: Vec<f64>,
    monitor: &dyn Monitor,
) -> Result<(f64, Factor<'a>), HsimError> {
    near(shift, spread, |at| {
        symbolic.factor_watched(&level.stiffness, &level.mass, at, std::mem::take(&mut storage), monitor)
    })
}

/// The eigenvalues below the shift, or below one beside it where it lies on an eigenvalue, by a factor that is not
/// kept.
pub(super) fn count_near(
    level: &Level,
    symbolic: &SymbolicFactor,
    shift: f64,
    spread: f64,
    monitor: &dyn Monitor,
) -> Result<Count, HsimError> {
    let (shift, count) = near(shift, spread, |at| symbolic.count_watched(&level.stiffness, &level.mass, at, monitor))?;
    Ok(Count { shift, below: count.below, radius: count.uncertainty })
}

fn near<T>(
    shift: f64,
    spread: f64,
    mut factored: impl FnMut(f64) -> Result<T, FactorError>,
) -> Result<(f64, T), HsimError> {
    let mut attempt = 0;
    loop {
        let beside = shift + f64::from(attempt) * (1e-7 * shift.abs() + 1e-12 * spread);
        match factored(beside) {
            Err(FactorError::Singular { .. }) if attempt < 4 => attempt += 1,
            result => return Ok((beside, result?)),
        }
    }
}
