//! Rows gathered into aggregates, and the smoothed prolongation from these.

use rayon::prelude::*;

use crate::SparseMatrix;

/// Entries below this share of the geometric mean of the two diagonals connect weakly.
const STRENGTH: f64 = 0.08;

/// How far the prolongation is smoothed, in multiples of the diagonal.
const DAMPING: f64 = 0.66;

/// `P = (I − ω D⁻¹ S̃) T` from aggregates to rows: `T` is 1 where a row belongs to an aggregate, `S̃` is `S` with weak connections put
/// on the diagonal.
pub(super) fn prolongation(stiffness: &SparseMatrix) -> SparseMatrix<f32> {
    let n = stiffness.rows();
    let diagonal: Vec<f64> = (0..n)
        .map(|row| {
            let (columns, values) = stiffness.row(row);
            columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at])
        })
        .collect();
    let strong = |row: usize, column: u32, value: f64| {
        let size = diagonal[row] * diagonal[column as usize];
        column as usize != row && value < 0.0 && size > 0.0 && value * value > STRENGTH * STRENGTH * size
    };
    let (aggregates, count) = aggregate(stiffness, &strong);
    let chunks: Vec<(Vec<usize>, Vec<u32>, Vec<f32>)> = (0..n.div_ceil(ROWS))
        .into_par_iter()
        .map(|chunk| {
            let rows = chunk * ROWS..n.min((chunk + 1) * ROWS);
            let (mut ends, mut indices, mut values) = (Vec::with_capacity(ROWS), Vec::new(), Vec::new());
            let mut entries: Vec<(u32, f64)> = Vec::new();
            for row in rows {
                smoothed(row, stiffness, &aggregates, &strong, &mut entries);
                indices.extend(entries.iter().map(|entry| entry.0));
                values.extend(entries.iter().map(|entry| entry.1 as f32));
                ends.push(indices.len());
            }
            (ends, indices, values)
        })
        .collect();
    let mut offsets = Vec::with_capacity(n + 1);
    let (mut indices, mut values) = (Vec::with_capacity(3 * n), Vec::with_capacity(3 * n));
    offsets.push(0);
    for (ends, columns, entries) in chunks {
        let start = indices.len();
        offsets.extend(ends.iter().map(|end| start + end));
        indices.extend(columns);
        values.extend(entries);
    }
    SparseMatrix::from_sorted_parts(n, count, offsets, indices, values)
}

/// Rows that a thread makes at once.
const ROWS: usize = 4096;

/// The entries of a row of the prolongation, by ascending column.
fn smoothed(
    row: usize,
    stiffness: &SparseMatrix,
    aggregates: &[u32],
    strong: &impl Fn(usize, u32, f64) -> bool,
    row_entries: &mut Vec<(u32, f64)>,
) {
    row_entries.clear();
    let own = aggregates[row];
    if own == NONE {
        return;
    }
    row_entries.push((own, 1.0));
    let (columns, entries) = stiffness.row(row);
    let kept: f64 = columns.iter().zip(entries).filter(|&(&c, &v)| strong(row, c, v)).map(|(_, v)| v).sum();
    // Rows of S̃ sum to what rows of S do, nearly zero, so the diagonal is minus the sum of the rest.
    let scale = if kept < 0.0 { DAMPING / -kept } else { 0.0 };
    for (&column, &value) in columns.iter().zip(entries) {
        let other = aggregates[column as usize];
        if strong(row, column, value) && other != own && other != NONE {
            let share = -scale * value;
            row_entries[0].1 -= share;
            match row_entries[1..].iter_mut().find(|entry| entry.0 == other) {
                Some(entry) => entry.1 += share,
                None => row_entries.push((other, share)),
            }
        }
    }
    row_entries.sort_unstable_by_key(|entry| entry.0);
}

/// A row of no aggregate: nothing connects it strongly, and the smoother is all it needs.
const NONE: u32 = u32::MAX;

/// Gathers rows: first around rows that lie apart, then what is left joins the neighbour it is connected to most.
fn aggregate(stiffness: &SparseMatrix, strong: &impl Fn(usize, u32, f64) -> bool) -> (Vec<u32>, usize) {
    let n = stiffness.rows();
    let mut aggregates = vec![NONE; n];
    let mut count = 0u32;
    for row in 0..n {
        let (columns, values) = stiffness.row(row);
        let neighbours = || columns.iter().zip(values).filter(|&(&c, &v)| strong(row, c, v)).map(|(&c, _)| c);
        let free = aggregates[row] == NONE && neighbours().all(|c| aggregates[c as usize] == NONE);
        if free && neighbours().next().is_some() {
            aggregates[row] = count;
            neighbours().for_each(|c| aggregates[c as usize] = count);
            count += 1;
        }
    }
    let roots = aggregates.clone();
    for row in (0..n).filter(|&row| roots[row] == NONE) {
        let (columns, values) = stiffness.row(row);
        let joined = columns
            .iter()
            .zip(values)
            .filter(|&(&c, &v)| strong(row, c, v) && roots[c as usize] != NONE)
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((&column, _)) = joined {
            aggregates[row] = roots[column as usize];
        }
    }
    (aggregates, count as usize)
}
