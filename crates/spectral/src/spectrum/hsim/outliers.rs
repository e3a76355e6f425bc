//! Where a start is looked for if some eigenvalues are negative: a few may lie far below all others, as a dense row of a matrix or a deep well of a
//! potential makes them.
//!
//! From a shift among the others, the inverse takes such values for next to nothing: they lie in the middle of its spectrum, where a Krylov space finds
//! them last. From a shift below them, the others are one cluster. So each part has a space of its own where one does not hold both.

use chladni_algebra::SymbolicFactor;
use chladni_base::Monitor;

use super::HsimError;
use super::kernel::Kernel;
use super::lanczos::{Found, Wanted, most, pairs_or_none};
use super::level::Level;
use super::scout::Scout;
use super::solve::Columns;

/// Values are outliers that lie below the middle of what is wanted by so many times what the upper half takes.
const FAR: f64 = 8.0;

/// At most one of so many wanted pairs is an outlier.
const FEW: usize = 3;

/// The wanted pairs of a pencil without a known kernel, and what is known of them: Ritz pairs of one space, or of two, outliers first, which are orthogonal to
/// each other as far as they have converged. Nothing where a space breaks down or does not hold its part.
pub(super) fn start(
    (level, symbolic): (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    scout: &mut Scout<'_>,
    wanted: Wanted,
    monitor: &dyn Monitor,
) -> Result<Option<(Found, Columns)>, HsimError> {
    let window = scout.window(wanted.pairs, None, false, monitor)?;
    let Some(middle) = scout.middle_of(window, wanted.pairs, monitor)? else { return Ok(None) };
    if let Some(found) = pairs_or_none(level, symbolic, kernel, &middle, wanted, monitor)? {
        return Ok(Some((found, Columns::Ritz)));
    }
    let outliers = scout.count(middle.at - FAR * (window.high - middle.at))?;
    if outliers == 0 || outliers > wanted.pairs / FEW {
        return Ok(None);
    }
    let lowest = window.shift_below(level, symbolic)?;
    let first = Wanted { pairs: outliers, columns: outliers, most: most(level.size(), outliers), ..wanted };
    let Some(mut found) = pairs_or_none(level, symbolic, kernel, &lowest, first, monitor)? else { return Ok(None) };
    let (pairs, columns) = (wanted.pairs - outliers, wanted.columns - outliers);
    let rest = Wanted { from: outliers, pairs, columns, ..wanted };
    let Some(rest) = pairs_or_none(level, symbolic, kernel, &middle, rest, monitor)? else { return Ok(None) };
    found.vectors.insert(outliers, &rest.vectors);
    found.values.extend(rest.values);
    Ok(Some((found, Columns::Solved)))
}
