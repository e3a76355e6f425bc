//! Vertices as columns of their own, where local functions are too coarse.
//!
//! Smooth columns need some ten vertices in a cell. A tail of long thin triangles has one to three there: columns stay
//! steps, and more of them make it worse. A hat function for each such vertex is exact, has one entry, and costs one
//! column.

use super::domain::Domain;
use crate::operator::EigenProblem;
use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;

/// A vertex becomes a column where the square of its longest edge exceeds this many cells' areas. Measured on animals
/// of 5,000 vertices: with 1 a fifth less error for three times as many columns.
const LONGEST_EDGE: f64 = 2.0;

/// A vertex becomes a column where its entry on the diagonal of the stiffness, which is about 4 on fair triangles,
/// exceeds this: beside a needle functions must follow its sides more exactly than smooth columns can.
pub(super) const STIFFEST: f64 = 1e4;

/// A column that keeps less than this share of its square sum is dropped: what is left of it is nearly dependent on its
/// neighbours.
const KEPT: f64 = 0.1;

/// A row whose entries cancel to less than this share of their size gets a column of its own.
const CANCELLED: f32 = 0.1;

/// The vertices that `dimension` columns are too coarse for, at most `most`, the worst first; one flag for each vertex.
pub(super) fn too_coarse(domain: Domain<'_>, laplacian: &EigenProblem, dimension: usize, most: usize) -> Vec<bool> {
    let n = laplacian.size();
    let cell = laplacian.area * domain.cell(dimension);
    let longest = domain.longest_edges();
    let mut found: Vec<(f64, usize)> = (0..n)
        .into_par_iter()
        .with_min_len(1 << 12)
        .filter_map(|v| {
            let (columns, values) = laplacian.stiffness.row(v);
            let diagonal = columns.binary_search(&(v as u32)).map_or(0.0, |at| values[at]);
            let excess = (longest[v] / (LONGEST_EDGE * cell)).max(diagonal / STIFFEST);
            (excess > 1.0).then_some((excess, v))
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut chosen = vec![false; n];
    found.iter().take(most).for_each(|&(_, v)| chosen[v] = true);
    chosen
}

/// Whether some edge is so long that [`too_coarse`] asks for columns of its ends, on a domain of some area.
pub(super) fn has_long_edges(domain: Domain<'_>, area: f64, dimension: usize) -> bool {
    let cell = area * domain.cell(dimension);
    domain.longest_edges().iter().any(|square| square / (LONGEST_EDGE * cell) > 1.0)
}

/// The rows in which most of a density sits, with their neighbours: enough for all but `left` of it, at most `most`.
/// `None` where so many hold less than half: what is missing is no matter of a few vertices.
pub(super) fn where_it_sits(density: &[f64], graph: &SparseMatrix, left: f64, most: usize) -> Option<Vec<bool>> {
    let total: f64 = density.iter().map(|x| x.max(0.0)).sum();
    let mut order: Vec<usize> = (0..density.len()).filter(|&row| density[row] > 0.0).collect();
    order.sort_by(|&a, &b| density[b].total_cmp(&density[a]).then(a.cmp(&b)));
    let (mut chosen, mut held, mut count) = (vec![false; density.len()], 0.0, 0);
    for row in order {
        if held >= (1.0 - left) * total || count >= most {
            break;
        }
        // A function that ends within one edge of where it is large would pay for that edge.
        for &neighbour in std::iter::once(&(row as u32)).chain(graph.row(row).0) {
            let at = neighbour as usize;
            if !std::mem::replace(&mut chosen[at], true) {
                held += density[at].max(0.0);
                count += 1;
            }
        }
    }
    (total > 0.0 && held >= 0.5 * total).then_some(chosen)
}

/// `space` with a column of its own for each chosen row, after the others; such a row has no other entry. Columns of
/// which hardly anything is left are dropped, and the other rows keep their sums.
pub(super) fn with_hats(space: &SparseMatrix<f32>, chosen: &[bool]) -> SparseMatrix<f32> {
    let (n, d) = (space.rows(), space.columns());
    let (mut whole, mut left) = (vec![0f64; d], vec![0f64; d]);
    for row in 0..n {
        let (columns, values) = space.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            let square = f64::from(value) * f64::from(value);
            whole[column as usize] += square;
            if !chosen[row] {
                left[column as usize] += square;
            }
        }
    }
    let mut next = 0u32;
    let names: Vec<Option<u32>> = (0..d)
        .map(|column| {
            let kept = left[column] > 0.0 && left[column] >= KEPT * whole[column];
            kept.then(|| {
                next += 1;
                next - 1
            })
        })
        .collect();
    let mut offsets = Vec::with_capacity(n + 1);
    let (mut indices, mut values) = (Vec::with_capacity(space.entries()), Vec::with_capacity(space.entries()));
    offsets.push(0);
    for row in 0..n {
        let (columns, entries) = space.row(row);
        let kept: f32 =
            columns.iter().zip(entries).filter(|(c, _)| names[**c as usize].is_some()).map(|(_, x)| x).sum();
        let size: f32 =
            columns.iter().zip(entries).filter(|(c, _)| names[**c as usize].is_some()).map(|(_, x)| x.abs()).sum();
        // In solids entries may be negative, and what is left of a row may cancel.
        if chosen[row] || !(kept > CANCELLED * size) {
            indices.push(next);
            values.push(1.0);
            next += 1;
        } else {
            let scale = entries.iter().sum::<f32>() / kept;
            for (&column, &value) in columns.iter().zip(entries) {
                if let Some(name) = names[column as usize] {
                    indices.push(name);
                    values.push(scale * value);
                }
            }
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(n, next as usize, offsets, indices, values)
}

/// How many columns are hat functions: they have one entry, which is 1 and alone in its row.
pub(super) fn count(space: &SparseMatrix<f32>) -> usize {
    let mut entries = vec![0usize; space.columns()];
    space.indices().iter().for_each(|&column| entries[column as usize] += 1);
    (0..space.rows())
        .filter(|&row| {
            let (columns, _) = space.row(row);
            columns.len() == 1 && entries[columns[0] as usize] == 1
        })
        .count()
}

/// `space` with some of its columns alone, ascending.
pub(super) fn of_columns(space: &SparseMatrix<f32>, kept: &[usize]) -> SparseMatrix<f32> {
    let mut names: Vec<Option<u32>> = vec![None; space.columns()];
    kept.iter().enumerate().for_each(|(name, &column)| names[column] = Some(name as u32));
    let mut offsets = vec![0];
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    for row in 0..space.rows() {
        let (columns, entries) = space.row(row);
        for (&column, &value) in columns.iter().zip(entries) {
            if let Some(name) = names[column as usize] {
                indices.push(name);
                values.push(value);
            }
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(space.rows(), kept.len(), offsets, indices, values)
}

#[cfg(test)]
#[path = "hats_tests.rs"]
mod tests;
