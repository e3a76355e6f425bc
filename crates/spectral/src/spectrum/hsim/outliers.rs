//! A start where a few values lie far below all others, as a dense row of a matrix or a deep well of a potential makes them.
//!
//! From a shift among the others, the inverse takes such values for next to nothing: they lie in the middle of its spectrum, where a Krylov space finds
//! them last. From a shift below them, the others are one cluster. So each part has a space of its own.

use chladni_algebra::SymbolicFactor;
use chladni_base::Monitor;

use super::HsimError;
use super::kernel::Kernel;
use super::lanczos::{Found, Shift, Wanted, most, pairs_or_none};
use super::level::Level;
use super::scout::{Scout, Window};

/// Values are outliers that lie below the middle of what is wanted by so many times what the upper half takes.
const FAR: f64 = 8.0;

/// At most one of so many wanted pairs is an outlier.
const FEW: usize = 3;

/// The wanted pairs of a pencil without a kernel, outliers first, from a shift in the middle of the others; nothing where there are no outliers or a
/// space breaks down or does not hold its part. The parts are orthogonal to each other as far as they have converged.
pub(super) fn start_beside_outliers(
    (level, symbolic): (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    wanted: Wanted,
    monitor: &dyn Monitor,
) -> Result<Option<Found>, HsimError> {
    let mut scout = Scout::new(level, symbolic);
    let window = scout.window(wanted.pairs, None, false, monitor)?;
    let Some((outliers, middle)) = beside(&mut scout, window, wanted.pairs, monitor)? else { return Ok(None) };
    let lowest = window.shift_below(level, symbolic)?;
    let first = Wanted { pairs: outliers, columns: outliers, most: most(level.size(), outliers), ..wanted };
    let Some(first) = pairs_or_none(level, symbolic, kernel, &lowest, first, monitor)? else { return Ok(None) };
    let (pairs, columns) = (wanted.pairs - outliers, wanted.columns - outliers);
    let rest = Wanted { from: outliers, pairs, columns, ..wanted };
    let Some(mut rest) = pairs_or_none(level, symbolic, kernel, &middle, rest, monitor)? else { return Ok(None) };
    let mut found = first;
    found.values.truncate(outliers);
    found.vectors.keep_columns(outliers);
    found.vectors.insert(outliers, &rest.vectors);
    found.values.append(&mut rest.values);
    Ok(Some(found))
}

/// How many outliers there are, and a shift in the middle of the other wanted values.
fn beside<'a>(
    scout: &mut Scout<'a>,
    window: Window,
    wanted: usize,
    monitor: &dyn Monitor,
) -> Result<Option<(usize, Shift<'a>)>, HsimError> {
    let Some(middle) = scout.middle_of_either_sign(wanted, monitor)? else { return Ok(None) };
    let outliers = scout.count(middle.at - FAR * (window.high - middle.at))?;
    Ok((outliers > 0 && outliers <= wanted / FEW).then_some((outliers, middle)))
}
