//! The last steps of a pair, by itself: ZoomOut with more vertices, from a consistent map on.

use chladni_algebra::DenseMatrix;

use super::{CollectionRequest, Side};
use crate::analysis::error::AnalysisError;
use crate::analysis::functional_map::matching::{Images, Match, Standing, zoom_out};

/// So many vertices stand for a surface, at least.
const SAMPLES: usize = 5000;

/// The share of the consistent map that is kept: what comes last in the latent basis holds the least.
const KEPT: f64 = 0.7;

/// How many vertices stand for a surface, where it has as many.
pub(super) fn samples(request: &CollectionRequest) -> usize {
    request.samples.max(SAMPLES)
}

/// The size of what is kept of a consistent map of `size`.
pub(super) fn polished_size(size: usize) -> usize {
    ((KEPT * size as f64) as usize).max(1)
}

/// The modes of a shape at the vertices that stand for it here.
pub(super) fn standing(side: &Side<'_>, request: &CollectionRequest) -> Result<Standing, AnalysisError> {
    Standing::new(side.at(&side.samples(samples(request)), request.pairs, "sample")?)
}

/// The map from one shape to another, each with what is [`standing`] for it, and for all vertices of that the matches
/// on this one.
pub(super) fn map(
    (source, there): (&Side<'_>, &Standing),
    (target, here): (&Side<'_>, &Standing),
    consistent: &DenseMatrix,
    request: &CollectionRequest,
) -> Result<(DenseMatrix, Vec<Match>), AnalysisError> {
    let size = polished_size(consistent.rows());
    let mut map = DenseMatrix::zeros(size, size);
    for column in 0..size {
        map.column_mut(column).copy_from_slice(&consistent.column(column)[..size]);
    }
    // Twice the step: what is left to be found is little.
    let (map, matches) = zoom_out(there, here, map, request.pairs, request.step.saturating_mul(2))?;
    // Where all vertices stood for both surfaces, their last matches are what they will be matched with, or near it.
    let all = |side: &Side<'_>, own: &Standing| own.modes.rows() == side.masses.len();
    let before = if all(source, there) && all(target, here) { &matches[..] } else { &[] };
    let found = Images::of_all(source, &map)?.nearest_of_all(target, before)?;
    Ok((map, found))
}
