//! Rows gathered into aggregates, and the smoothed prolongation from these.

use crate::SparseMatrix;

/// Entries below this share of the geometric mean of the two diagonals connect weakly.
const STRENGTH: f64 = 0.08;

/// How far the prolongation is smoothed, in multiples of the diagonal.
const DAMPING: f64 = 0.66;

/// `P = (I − ω D⁻¹ S̃) T` from aggregates to rows: `T` is 1 where a row belongs to an aggregate, `S̃` is `S` with weak
/// connections put on the diagonal.
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
    SparseMatrix::from_rows(n, count, Vec::new, |sums, row, entries| {
        smoothed(row, stiffness, &aggregates, &strong, sums);
        entries.extend(sums.iter().map(|&(aggregate, share)| (aggregate, share as f32)));
    })
}

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
