//! Where a start is looked for if some eigenvalues are negative: some may lie far below all others, as a dense row of a
//! matrix, a term of low rank or deep wells of a potential make them.
//!
//! From a shift among the others, the inverse takes such values for next to nothing: they lie in the middle of its
//! spectrum, where a Krylov space finds them last. From a shift below them, the others are one cluster. So the spectrum
//! is cut where what lies above is narrow beside its distance from what lies below, and each part has a space of its
//! own.

use chladni_algebra::{PanelMatrix, SymbolicFactor};
use chladni_base::Monitor;

use super::HsimError;
use super::cuts::{FEW, Part};
use super::kernel::Kernel;
use super::lanczos::{
    self, KrylovPairs, KrylovRequest, Leave, NUMBERS_FOR_CLUSTERS, for_clusters, most, pairs_or_none,
};
use super::level::Level;
use super::scout::{Scout, Window};
use super::solve::Columns;

/// The wanted pairs of a pencil without a known kernel, and what is known of them: Ritz pairs of one space, or of
/// several, which are orthogonal to each other as far as they have converged. Nothing where a space breaks down or does
/// not hold its part.
pub(super) fn start(
    of: (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    scout: &mut Scout<'_>,
    wanted: KrylovRequest,
    monitor: &dyn Monitor,
) -> Result<Option<(KrylovPairs, Columns)>, HsimError> {
    // A count may lie on an eigenvalue, as a shift may: another start serves then.
    match of_one_or_several(of, kernel, scout, wanted, monitor) {
        Err(HsimError::Numerical(_)) => Ok(None),
        found => found,
    }
}

fn of_one_or_several(
    (level, symbolic): (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    scout: &mut Scout<'_>,
    wanted: KrylovRequest,
    monitor: &dyn Monitor,
) -> Result<Option<(KrylovPairs, Columns)>, HsimError> {
    // What follows tells how far apart the last ones lie.
    let columns = wanted.columns.min(level.size());
    let mut window = None;
    // Of a surface, where the lowest values lie is known about well enough without another factor.
    let single = if !level.positions.is_empty() || scout.is_semidefinite()? {
        lanczos::start(level, symbolic, kernel, wanted, monitor)?
    } else {
        let Window { low, high, .. } = *window.insert(scout.window(columns, None, false, monitor)?);
        let whole = Part { low, high, from: 0, count: wanted.pairs };
        match scout.middle_of(&whole, monitor)? {
            Some(middle) => {
                let found = pairs_or_none(level, symbolic, kernel, &middle, wanted, monitor)?;
                scout.keep_storage(middle.factor);
                found
            }
            None => None,
        }
    };
    // Where factors are dense, what cuts cost is worth it only where nothing else helps.
    if let Some(found) = &single
        && (!scout.is_sparse() || is_spread(&found.values, wanted.pairs))
    {
        return Ok(single.map(|found| (found, Columns::Ritz)));
    }
    let Window { low, high, .. } = match window {
        Some(window) => window,
        None => scout.window(columns, None, false, monitor)?,
    };
    let parts = scout.cut(Part { low, high, from: 0, count: columns }, monitor)?;
    let single = single.map(|found| (found, Columns::Ritz));
    if parts.len() < 2 {
        return Ok(single);
    }
    let single = single.filter(|(found, _)| found.left == 0 && is_small(&found.vectors));
    Ok(of_parts((level, symbolic), kernel, scout, &parts, wanted, monitor)?.or(single))
}

/// Whether values are spread over their range as seen from the upper end: a shift among them tells those apart that lie
/// there. Where not, those are as exact as their distance from the rest allows, and not as they could be.
fn is_spread(values: &[f64], wanted: usize) -> bool {
    // Of a few, what follows tells more.
    let values = &values[..values.len().min(2 * wanted + FEW)];
    let Some(&last) = values.last() else { return true };
    let (mut half, fewest) = (values.len() / 2, if values.len() < 2 * MULTIPLET { FEW } else { MULTIPLET });
    while half >= fewest {
        let [whole, upper] = [2 * half, half].map(|count| last - values[values.len() - count]);
        if upper < CLUSTER * whole {
            return false;
        }
        half /= 2;
    }
    true
}

/// As many values may be one for reasons of symmetry.
const MULTIPLET: usize = 8;

/// Half of the values within this share of the range of all are a cluster that one shift does not serve.
const CLUSTER: f64 = 1.0 / 16.0;

/// So many columns beyond the wanted pairs are enough to go on with.
const GUARDS: usize = 8;

/// Whether columns are so few that every promise of memory has room for as many again.
fn is_small(vectors: &PanelMatrix) -> bool {
    vectors.rows() * vectors.columns() <= NUMBERS_FOR_CLUSTERS
}

/// The pairs of each part from a space of its own; nothing where one does not hold its part.
fn of_parts(
    (level, symbolic): (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    scout: &mut Scout<'_>,
    parts: &[Part],
    wanted: KrylovRequest,
    monitor: &dyn Monitor,
) -> Result<Option<(KrylovPairs, Columns)>, HsimError> {
    let mut all = KrylovPairs { values: Vec::new(), vectors: PanelMatrix::zeros(level.size(), 0), left: 0 };
    for part in parts {
        // Beyond the wanted pairs, a count needs to know what comes next.
        let is_guard = part.from >= wanted.pairs;
        if is_guard && all.values.len() >= wanted.pairs + GUARDS {
            break;
        }
        let pairs = wanted.pairs.saturating_sub(part.from).clamp(1, part.count);
        let is_last = part.from + part.count >= wanted.columns;
        let columns = if is_last { wanted.columns - part.from } else { part.count };
        // Few pairs may be next to thousands of others.
        let most = most(level.size(), pairs).max(for_clusters(level.size()));
        let of = KrylovRequest { from: part.from, pairs, columns, most, leave: Leave::WhenFull, ..wanted };
        let mut found = None;
        // Where the middle is a cluster, its vectors are all that a space holds; from below, all clusters are alike.
        for is_in_the_middle in [true, false] {
            let shift = match is_in_the_middle {
                true => scout.middle_of(part, monitor)?,
                false => scout.shift_at(part.low, part.from)?,
            };
            let Some(shift) = shift else { continue };
            found = pairs_or_none(level, symbolic, kernel, &shift, of, monitor)?;
            scout.keep_storage(shift.factor);
            if found.is_some() {
                break;
            }
        }
        let Some(found) = found else {
            if is_guard {
                break;
            }
            return Ok(None);
        };
        all.vectors.insert(all.values.len(), &found.vectors);
        all.values.extend(found.values);
        all.left += found.left;
    }
    Ok(Some((all, Columns::Solved)))
}
