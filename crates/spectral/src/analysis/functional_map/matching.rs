//! From a map to a correspondence of points, and back.
//!
//! A map `C` and a vertex `p` of the target make the vertex `q` of the source whose image is nearest to it:
//! `argmin_q ‖Φ_target(p) − C Φ_source(q)‖` (Melzi et al. 2019, eq. 1). Both are deltas, in coefficients of the target:
//! `C` acts on the one that lies on the source, so that the search runs over the rows of `Φ_source Cᵀ`. (The other way
//! round, `Φ_target C` against `Φ_source`, pulls back what `C` cannot reach as well.)

use chladni_algebra::{DenseMatrix, solve_definite};

use super::side::Side;
use crate::analysis::error::AnalysisError;
use crate::analysis::neighbours::{Neighbour, Neighbours, Rows};
use crate::basis::BasisError;

/// Vertices whose modes are held at once.
const AT_ONCE: usize = 16 * 1024;

/// What a vertex was matched with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::analysis) struct Match {
    /// Which of the points that were searched.
    pub point: u32,
    /// `‖Φ_target(p) − C Φ_source(q)‖²`.
    pub square: f32,
    /// `1 − ‖x − y‖² / (‖x‖² + ‖y‖²)` for these two, at least 0.
    pub confidence: f32,
}

impl From<Neighbour> for Match {
    fn from(found: Neighbour) -> Self {
        Self { point: found.point, square: found.square, confidence: (1.0 - found.share).clamp(0.0, 1.0) }
    }
}

/// Rows of `Φ_source Cᵀ`, arranged for a search.
pub(in crate::analysis) struct Images {
    dimensions: usize,
    points: Neighbours,
}

impl Images {
    /// Of some vertices, whose modes are given.
    pub fn of(modes: &DenseMatrix, map: &DenseMatrix) -> Result<Self, AnalysisError> {
        Self::new(&images(modes, &transposed(map))?, map.rows())
    }

    /// Of all vertices of the source.
    pub fn of_all(source: &Side, map: &DenseMatrix) -> Result<Self, AnalysisError> {
        Self::new(&images_of_all(source, &transposed(map))?, map.rows())
    }

    fn new(points: &Rows, dimensions: usize) -> Result<Self, AnalysisError> {
        Ok(Self { dimensions, points: Neighbours::new(points).ok_or(BasisError::Inconsistent)? })
    }

    /// For each row of `here`, the modes of the target at some vertices, the nearest image. `before`: for the first
    /// rows, what they were matched with by a map that was not much different.
    pub fn nearest(&self, here: &DenseMatrix, before: &[Match]) -> Vec<Match> {
        self.nearest_to(&Rows::of(here, self.dimensions), before)
    }

    fn nearest_to(&self, queries: &Rows, before: &[Match]) -> Vec<Match> {
        let before: Vec<u32> = before.iter().map(|one| one.point).collect();
        self.points.nearest(queries, &before).into_iter().map(Match::from).collect()
    }

    /// The nearest image of every vertex of the target. `before`: as for [`nearest`](Self::nearest), for the first
    /// vertices.
    pub fn nearest_of_all(&self, target: &Side, before: &[Match]) -> Result<Vec<Match>, AnalysisError> {
        let vertices: Vec<u32> = (0..target.masses.len() as u32).collect();
        let mut found = Vec::with_capacity(vertices.len());
        // Blocks bound what is held at once.
        for block in vertices.chunks(AT_ONCE) {
            let before = before.get(found.len()..).unwrap_or_default();
            found.extend(self.nearest(&target.at(block, self.dimensions, "sample")?, before));
        }
        Ok(found)
    }
}

/// Points of a surface in a space that several surfaces have in common.
pub(in crate::analysis) struct Embedded {
    points: Rows,
    arranged: Images,
}

impl Embedded {
    /// Of some vertices, whose modes are given: their first columns times `embedding`.
    pub fn new(modes: &DenseMatrix, embedding: &DenseMatrix) -> Result<Self, AnalysisError> {
        Self::of_rows(images(modes, embedding)?, embedding.columns())
    }

    /// Of all vertices.
    pub fn of_all(side: &Side, embedding: &DenseMatrix) -> Result<Self, AnalysisError> {
        Self::of_rows(images_of_all(side, embedding)?, embedding.columns())
    }

    fn of_rows(points: Rows, dimensions: usize) -> Result<Self, AnalysisError> {
        Ok(Self { arranged: Images::new(&points, dimensions)?, points })
    }

    /// For each point of another surface the nearest of this one.
    pub fn nearest(&self, other: &Self, before: &[Match]) -> Vec<Match> {
        self.arranged.nearest_to(&other.points, before)
    }
}

/// The modes of a surface at the vertices that stand for it, at unit area, and their products over these.
pub(in crate::analysis) struct Standing {
    pub modes: DenseMatrix,
    gram: DenseMatrix,
}

impl Standing {
    /// From modes at some vertices, a row each.
    pub fn new(modes: DenseMatrix) -> Result<Self, AnalysisError> {
        let gram = modes.transposed_times(&modes);
        Ok(Self { modes, gram })
    }
}

/// ZoomOut: lets a map from `there` to `here` grow to `size`, by `step` at once. Gives the matches of the last map but
/// one as well; none where the map has its size already.
pub(in crate::analysis) fn zoom_out(
    there: &Standing,
    here: &Standing,
    mut map: DenseMatrix,
    size: usize,
    step: usize,
) -> Result<(DenseMatrix, Vec<Match>), AnalysisError> {
    let mut matches: Vec<Match> = Vec::new();
    while map.rows() < size {
        matches = Images::of(&there.modes, &map)?.nearest(&here.modes, &matches);
        map = map_of_points(there, here, &matches, size.min(map.rows() + step))?;
    }
    Ok((map, matches))
}

/// `argmin ‖Φ_target C − Φ_source(T)‖` over matched samples: the map of size `k` that their matches `T` make.
pub(in crate::analysis) fn map_of_points(
    there: &Standing,
    here: &Standing,
    matches: &[Match],
    k: usize,
) -> Result<DenseMatrix, AnalysisError> {
    let mut pulled = DenseMatrix::zeros(here.modes.rows(), k);
    for column in 0..k {
        let values = there.modes.column(column);
        let slots = pulled.column_mut(column).iter_mut().zip(matches);
        slots.for_each(|(slot, one)| *slot = values[one.point as usize]);
    }
    let mut gram = DenseMatrix::zeros(k, k);
    (0..k).for_each(|column| gram.column_mut(column).copy_from_slice(&here.gram.column(column)[..k]));
    let mean = (0..k).map(|i| gram.column(i)[i]).sum::<f64>() / k as f64;
    (0..k).for_each(|i| gram.column_mut(i)[i] += 1e-9 * mean);
    let mut map = here.modes.slice_columns(0..k).transposed_times(&pulled);
    solve_definite(gram, &mut map)?;
    Ok(map)
}

/// The first columns of `modes` times `turned`.
fn images(modes: &DenseMatrix, turned: &DenseMatrix) -> Result<Rows, AnalysisError> {
    let product = modes.slice_columns(0..turned.rows()).times(turned);
    Ok(Rows::of(&product, turned.columns()))
}

/// The same of all vertices of a surface.
fn images_of_all(side: &Side, turned: &DenseMatrix) -> Result<Rows, AnalysisError> {
    let vertices: Vec<u32> = (0..side.masses.len() as u32).collect();
    let mut points = Rows::with_capacity(vertices.len(), turned.columns());
    for block in vertices.chunks(AT_ONCE) {
        let modes = side.at(block, turned.rows(), "sample")?;
        points.extend(&modes.times(turned));
    }
    Ok(points)
}

pub(in crate::analysis) fn transposed(matrix: &DenseMatrix) -> DenseMatrix {
    let mut turned = DenseMatrix::zeros(matrix.columns(), matrix.rows());
    for column in 0..matrix.columns() {
        matrix.column(column).iter().enumerate().for_each(|(row, &value)| turned.column_mut(row)[column] = value);
    }
    turned
}
