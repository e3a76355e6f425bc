//! The judgement of pairs in segments between counts: each is judged by the counts at its ends, from its own columns.

use chladni_base::Monitor;

use super::HsimError;
use super::columns::defect;
use super::judge::{Candidates, LARGEST_DELIVERED_DEFECT, Verdict, certify};
use super::segments::Cuts;

/// As [`certify`], segment by segment: with as many columns between two counts as eigenvalues, each is enclosed with
/// its index.
///
/// # Errors
/// As for [`certify`].
pub(super) fn certify_segments(
    found: &Candidates<'_>,
    cuts: &Cuts,
    monitor: &dyn Monitor,
) -> Result<Verdict, HsimError> {
    let unproven = |reason: String| Err(HsimError::Unproven { reason });
    if !(cuts.defect <= LARGEST_DELIVERED_DEFECT) {
        return unproven(format!("columns of different segments are {:e} away from orthogonal", cuts.defect));
    }
    // What the bound is of is looked at as well, in some random directions.
    let measured = defect(found.vectors, &found.level.mass, monitor)?;
    if !(measured <= LARGEST_DELIVERED_DEFECT * found.values.len() as f64) {
        return unproven(format!("all columns together are {measured:e} away from orthonormal"));
    }
    let mut whole = Verdict {
        residuals: Vec::new(),
        bounds: Vec::new(),
        errors: Vec::new(),
        defect: cuts.defect,
        sums: Vec::new(),
    };
    // Of a cluster that is cut, nothing is counted that lies inside.
    let top = found.below_cluster.map_or(found.count.shift, |low| low.shift);
    let counts = cuts.counts.iter().copied().filter(|count| count.shift < top);
    let (mut start, mut floor, mut memory) = (0, None, Vec::new());
    for count in counts.chain([found.count]) {
        let end = if count == found.count { found.values.len() } else { count.below.min(found.values.len()) };
        if end < start {
            return unproven(format!("the count at {} is below the one before it", count.shift));
        }
        let segment = found.vectors.select_into(&(start..end).collect::<Vec<_>>(), &mut memory);
        let inside = |at: usize| at.clamp(start, end) - start;
        let part = Candidates {
            vectors: &segment,
            values: &found.values[start..end],
            kernel: &(inside(found.kernel.start)..inside(found.kernel.end)),
            count,
            floor,
            below_cluster: found.below_cluster.filter(|_| count == found.count),
            wanted: inside(found.wanted),
            ..*found
        };
        let verdict = certify(&part, monitor)?;
        whole.residuals.extend(verdict.residuals);
        whole.bounds.extend(verdict.bounds);
        whole.errors.extend(verdict.errors);
        whole.sums.extend(verdict.sums);
        whole.defect = whole.defect.max(verdict.defect);
        memory.extend(segment.into_panels());
        (start, floor) = (end, Some(count));
    }
    Ok(whole)
}
