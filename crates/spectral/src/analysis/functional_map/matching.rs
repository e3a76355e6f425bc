//! From a map to a correspondence of points, and back.
//!
//! A map `C` and a vertex `p` of the target make the vertex `q` of the source whose image is nearest to it: `argmin_q ‖Φ_target(p) − C Φ_source(q)‖`
//! (Melzi et al. 2019, eq. 1). Both are deltas, in coefficients of the target: `C` acts on the one that lies on the source, so that the search runs over
//! the rows of `Φ_source Cᵀ`. (The other way round, `Φ_target C` against `Φ_source`, pulls back what `C` cannot reach as well.)

use chladni_algebra::{DenseMatrix, solve_definite};
use rayon::prelude::*;

use super::side::Side;
use crate::analysis::error::AnalysisError;
use crate::analysis::kd_tree::KdTree;
use crate::basis::BasisError;

/// Rows that one task handles.
const ROWS_AT_ONCE: usize = 1024;

/// Vertices whose modes are held at once.
const AT_ONCE: usize = 16 * ROWS_AT_ONCE;

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

/// Rows of `Φ_source Cᵀ`, and a tree over them.
pub(in crate::analysis) struct Images {
    points: Vec<f32>,
    dimensions: usize,
    tree: KdTree,
}

impl Images {
    /// Of some vertices, whose modes are given.
    pub fn of(modes: &DenseMatrix, map: &DenseMatrix) -> Result<Self, AnalysisError> {
        Self::new(images(modes, &transposed(map))?, map.rows())
    }

    /// Of all vertices of the source.
    pub fn of_all(source: &Side, map: &DenseMatrix) -> Result<Self, AnalysisError> {
        let turned = transposed(map);
        let vertices: Vec<u32> = (0..source.masses.len() as u32).collect();
        let mut points = Vec::with_capacity(vertices.len() * map.rows());
        for block in vertices.chunks(AT_ONCE) {
            points.extend(images(&source.at(block, map.columns(), "sample")?, &turned)?);
        }
        Self::new(points, map.rows())
    }

    fn new(points: Vec<f32>, dimensions: usize) -> Result<Self, AnalysisError> {
        let tree = KdTree::new(dimensions, &points).ok_or(BasisError::Inconsistent)?;
        Ok(Self { points, dimensions, tree })
    }

    fn point(&self, item: u32) -> &[f32] {
        &self.points[item as usize * self.dimensions..][..self.dimensions]
    }

    /// For each row of `here`, the modes of the target at some vertices, the nearest image. `before`: for the first rows, what they were matched with by
    /// a map that was not much different.
    pub fn nearest(&self, here: &DenseMatrix, before: &[Match]) -> Vec<Match> {
        self.nearest_to(&rows(here, self.dimensions), before)
    }

    /// As [`nearest`](Self::nearest), of rows one after the other.
    fn nearest_to(&self, queries: &[f32], before: &[Match]) -> Vec<Match> {
        let dimensions = self.dimensions;
        let search = |(task, queries): (usize, &[f32])| {
            let mut last: Option<u32> = None;
            let mut found = Vec::with_capacity(queries.len() / dimensions);
            for (row, query) in queries.chunks_exact(dimensions).enumerate() {
                let measured = |item: u32| {
                    let square = self.point(item).iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
                    (item, square)
                };
                // Vertices with neighbouring numbers often lie next to each other, and so do their matches.
                let beside = last.map(measured);
                let before = before.get(task * ROWS_AT_ONCE + row).map(|one| measured(one.point));
                let guess = beside.into_iter().chain(before).min_by(|a, b| a.1.total_cmp(&b.1));
                let (point, square) = self.tree.nearest(query, guess);
                last = Some(point);
                let whole = squared(query) + squared(self.point(point));
                let confidence = if whole > 0.0 { (1.0 - square / whole).clamp(0.0, 1.0) } else { 0.0 };
                found.push(Match { point, square, confidence });
            }
            found
        };
        queries.par_chunks(ROWS_AT_ONCE * dimensions).enumerate().flat_map_iter(search).collect()
    }

    /// The nearest image of every vertex of the target.
    pub fn nearest_of_all(&self, target: &Side) -> Result<Vec<Match>, AnalysisError> {
        let vertices: Vec<u32> = (0..target.masses.len() as u32).collect();
        let mut found = Vec::with_capacity(vertices.len());
        // Blocks bound what is held at once.
        for block in vertices.chunks(AT_ONCE) {
            found.extend(self.nearest(&target.at(block, self.dimensions, "sample")?, &[]));
        }
        Ok(found)
    }
}

/// Points of a surface in a space that several surfaces have in common, and a tree over them.
pub(in crate::analysis) struct Embedded(Images);

impl Embedded {
    /// Of some vertices, whose modes are given: their first columns times `embedding`.
    pub fn new(modes: &DenseMatrix, embedding: &DenseMatrix) -> Result<Self, AnalysisError> {
        Ok(Self(Images::new(images(modes, embedding)?, embedding.columns())?))
    }

    /// Of all vertices.
    pub fn of_all(side: &Side, embedding: &DenseMatrix) -> Result<Self, AnalysisError> {
        // The image under a map is the same product.
        Ok(Self(Images::of_all(side, &transposed(embedding))?))
    }

    /// For each point of another surface the nearest of this one.
    pub fn nearest(&self, other: &Self, before: &[Match]) -> Vec<Match> {
        self.0.nearest_to(&other.0.points, before)
    }
}

/// ZoomOut: lets a map grow to `size`, by `step` at once. `there` and `here` hold the modes of the source and of the target at samples. Gives the matches of
/// the last map but one as well; none where the map has its size already.
pub(in crate::analysis) fn zoom_out(
    there: &DenseMatrix,
    here: &DenseMatrix,
    mut map: DenseMatrix,
    size: usize,
    step: usize,
) -> Result<(DenseMatrix, Vec<Match>), AnalysisError> {
    let mut matches: Vec<Match> = Vec::new();
    while map.rows() < size {
        matches = Images::of(there, &map)?.nearest(here, &matches);
        map = map_of_points(there, here, &matches, size.min(map.rows() + step))?;
    }
    Ok((map, matches))
}

/// `argmin ‖Φ_target C − Φ_source(T)‖` over matched samples: the map of size `k` that their matches `T` make. `there` and `here` hold the modes of the
/// source and of the target at the samples.
pub(in crate::analysis) fn map_of_points(
    there: &DenseMatrix,
    here: &DenseMatrix,
    matches: &[Match],
    k: usize,
) -> Result<DenseMatrix, AnalysisError> {
    let here = here.slice_columns(0..k);
    let mut pulled = DenseMatrix::zeros(here.rows(), k);
    for column in 0..k {
        let values = there.column(column);
        let slots = pulled.column_mut(column).iter_mut().zip(matches);
        slots.for_each(|(slot, one)| *slot = values[one.point as usize]);
    }
    let mut gram = here.transposed_times(&here);
    let mean = (0..k).map(|i| gram.column(i)[i]).sum::<f64>() / k as f64;
    (0..k).for_each(|i| gram.column_mut(i)[i] += 1e-9 * mean);
    let mut map = here.transposed_times(&pulled);
    solve_definite(gram, &mut map)?;
    Ok(map)
}

/// The first columns of `modes` times `turned`, row after row.
fn images(modes: &DenseMatrix, turned: &DenseMatrix) -> Result<Vec<f32>, AnalysisError> {
    let product = modes.slice_columns(0..turned.rows()).times(turned);
    Ok(rows(&product, turned.columns()))
}

/// The rows of the first `k` columns, one after the other.
fn rows(modes: &DenseMatrix, k: usize) -> Vec<f32> {
    let mut points = vec![0.0; modes.rows() * k];
    for column in 0..k {
        modes.column(column).iter().enumerate().for_each(|(row, &value)| points[row * k + column] = value as f32);
    }
    points
}

fn squared(point: &[f32]) -> f32 {
    point.iter().map(|x| x * x).sum()
}

pub(in crate::analysis) fn transposed(matrix: &DenseMatrix) -> DenseMatrix {
    let mut turned = DenseMatrix::zeros(matrix.columns(), matrix.rows());
    for column in 0..matrix.columns() {
        matrix.column(column).iter().enumerate().for_each(|(row, &value)| turned.column_mut(row)[column] = value);
    }
    turned
}
