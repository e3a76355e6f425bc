//! Shifts for columns by their values, and factors there.

use chladni_algebra::{Factor, FactorError, PANEL_WIDTH, SymbolicFactor};

use super::HsimError;
use super::iterate::Plan;
use super::judge::Count;
use super::level::Level;

/// Consecutive panels with one shift.
#[derive(Debug, Clone)]
pub(super) struct Group {
    pub panels: std::ops::Range<usize>,
    pub shift: f64,
}

/// Groups of panels for ascending values. The first panel has a low shift of its own: relative to their eigenvalues, the lowest
/// columns need the most of a solve.
pub(super) fn groups(values: &[f64], plan: &Plan) -> Vec<Group> {
    let panels = values.len().div_ceil(PANEL_WIDTH);
    let lowest = shift(&values[..values.len().min(LOWEST)]);
    let mut groups = vec![Group { panels: 0..1.min(panels), shift: lowest }];
    let count = (panels - 1).div_ceil(plan.panels_per_shift);
    groups.extend((0..count).map(|k| {
        let range = 1 + k * (panels - 1) / count..1 + (k + 1) * (panels - 1) / count;
        let (from, to) = (range.start * PANEL_WIDTH, (range.end * PANEL_WIDTH).min(values.len()));
        Group { panels: range, shift: shift(&values[from..to]) }
    }));
    groups
}

/// The shift of the first panel lies near the middle of so many values.
pub(super) const LOWEST: usize = 12;

/// A shift near the middle of ascending values, in the widest gap there; just below them where they are as good as one.
pub(super) fn shift(values: &[f64]) -> f64 {
    let (least, most) = (values[0], values[values.len() - 1]);
    let (middle, reach) = (0.5 * (least + most), 0.12 * (most - least));
    let gap = values
        .windows(2)
        .filter(|pair| (0.5 * (pair[0] + pair[1]) - middle).abs() <= reach)
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    match gap {
        Some(pair) if pair[1] - pair[0] > CLUSTER * middle.abs() => 0.5 * (pair[0] + pair[1]),
        _ if reach > CLUSTER * middle.abs() => middle,
        _ if least == 0.0 => -BELOW_ZERO,
        _ => least - BESIDE * least.abs(),
    }
}

/// Values whose gaps are smaller than this, relative to themselves, are not told apart by a shift.
const CLUSTER: f64 = 1e-3;

/// How far below a cluster its shift lies, relative to it.
const BESIDE: f64 = 3e-3;

/// How far below zero the shift lies where nothing is known of any value: on unit area, the first positive one of the sphere is 25.
const BELOW_ZERO: f64 = 0.5;

/// A factor at the shift, or beside it where it lies on an eigenvalue; and where. `spread` is about the largest eigenvalue.
pub(super) fn factor_near<'a>(
    level: &Level,
    symbolic: &'a SymbolicFactor,
    shift: f64,
    spread: f64,
    mut storage: Vec<f64>,
) -> Result<(f64, Factor<'a>), HsimError> {
    near(shift, spread, |at| symbolic.factor_in(&level.stiffness, &level.mass, at, std::mem::take(&mut storage)))
}

/// The eigenvalues below the shift, or below one beside it where it lies on an eigenvalue, by a factor that is not kept.
pub(super) fn count_near(
    level: &Level,
    symbolic: &SymbolicFactor,
    shift: f64,
    spread: f64,
) -> Result<Count, HsimError> {
    let (shift, count) = near(shift, spread, |at| symbolic.count(&level.stiffness, &level.mass, at))?;
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
