//! Fewer entries for little error: shrink small ones smoothly to zero and restore the partition of unity.

use chladni_algebra::SparseMatrix;

/// Drops entries below `least`, normalises rows, takes every remaining `x` to `(x − threshold)²/x` where it exceeds the
/// threshold and to nothing elsewhere, and normalises again. A row never becomes empty: its largest entry stays.
pub(super) fn shrink(spread: &SparseMatrix<f32>, least: f32, threshold: f32) -> SparseMatrix<f32> {
    SparseMatrix::from_rows(spread.rows(), spread.columns(), Default::default, |(indices, values), row, entries| {
        let (indices, values): (&mut Vec<u32>, &mut Vec<f32>) = (indices, values);
        indices.clear();
        values.clear();
        let (columns, row) = spread.row(row);
        push_row(columns, row, least, threshold, indices, values);
        entries.extend(indices.iter().copied().zip(values.iter().copied()));
    })
}

/// Puts runs of rows (counts, indices, values) together.
pub(super) fn assemble(n: usize, d: usize, chunks: Vec<(Vec<u32>, Vec<u32>, Vec<f32>)>) -> SparseMatrix<f32> {
    let entries = chunks.iter().map(|chunk| chunk.1.len()).sum();
    let mut offsets = Vec::with_capacity(n + 1);
    let mut indices = Vec::with_capacity(entries);
    let mut values = Vec::with_capacity(entries);
    let mut end = 0;
    offsets.push(end);
    for (counts, i, v) in chunks {
        for count in counts {
            end += count as usize;
            offsets.push(end);
        }
        indices.extend_from_slice(&i);
        values.extend_from_slice(&v);
    }
    SparseMatrix::from_sorted_parts(n, d, offsets, indices, values)
}

/// Appends one shrunk row.
pub(super) fn push_row(
    columns: &[u32],
    row: &[f32],
    least: f32,
    threshold: f32,
    indices: &mut Vec<u32>,
    values: &mut Vec<f32>,
) {
    let begin = indices.len();
    let kept: f32 = row.iter().filter(|&&x| x >= least).sum();
    let scale = if kept > 0.0 { 1.0 / kept } else { 1.0 };
    let mut sum = 0.0;
    for (&column, &x) in columns.iter().zip(row) {
        let y = x * scale;
        if x >= least && y > threshold {
            let shrunk = (y - threshold) * (y - threshold) / y;
            indices.push(column);
            values.push(shrunk);
            sum += shrunk;
        }
    }
    if !(sum > 0.0) {
        indices.truncate(begin);
        values.truncate(begin);
        let mut best: Option<(u32, f32)> = None;
        for (&column, &x) in columns.iter().zip(row) {
            if best.is_none_or(|(_, y)| x > y) {
                best = Some((column, x));
            }
        }
        if let Some((column, _)) = best {
            indices.push(column);
            values.push(1.0);
        }
        return;
    }
    let scale = 1.0 / sum;
    for value in &mut values[begin..] {
        *value *= scale;
    }
}

/// Gives every column that lost all entries its largest one in `spread` back.
pub(super) fn refill_columns(result: &mut SparseMatrix<f32>, spread: &SparseMatrix<f32>, d: usize) {
    let filled = filled(result, d);
    if filled.iter().all(|&f| f) {
        return;
    }
    let mut best = vec![(0f32, usize::MAX); d];
    for row in 0..spread.rows() {
        let (indices, values) = spread.row(row);
        for (&column, &value) in indices.iter().zip(values) {
            if !filled[column as usize] && (best[column as usize].1 == usize::MAX || value > best[column as usize].0) {
                best[column as usize] = (value, row);
            }
        }
    }
    refill(result, d, (0..d).filter(|&c| !filled[c] && best[c].1 != usize::MAX).map(|c| (c, best[c])).collect());
}

/// The same, where `peak` tells the largest entry of a column, and its row.
pub(super) fn refill_from(result: &mut SparseMatrix<f32>, d: usize, peak: impl Fn(usize) -> (f32, usize)) {
    let filled = filled(result, d);
    if !filled.iter().all(|&f| f) {
        refill(result, d, (0..d).filter(|&c| !filled[c]).map(|c| (c, peak(c))).collect());
    }
}

/// Which columns have an entry.
fn filled(result: &SparseMatrix<f32>, d: usize) -> Vec<bool> {
    let mut filled = vec![false; d];
    for &column in result.indices() {
        filled[column as usize] = true;
    }
    filled
}

/// Puts entries, each with its column and row, into rows that still sum to 1.
pub(super) fn refill(result: &mut SparseMatrix<f32>, d: usize, missing: Vec<(usize, (f32, usize))>) {
    let given = |(column, (value, row)): (usize, (f32, usize))| (row, column as u32, value.max(f32::MIN_POSITIVE));
    let mut extra: Vec<(usize, u32, f32)> = missing.into_iter().map(given).collect();
    extra.sort_unstable_by_key(|&(row, column, _)| (row, column));
    let mut next = extra.iter().peekable();
    let (mut counts, mut indices, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..result.rows() {
        let before = indices.len();
        let (old, x) = result.row(row);
        let mut entries: Vec<(u32, f32)> = old.iter().copied().zip(x.iter().copied()).collect();
        while let Some(&&(_, column, value)) = next.peek().filter(|e| e.0 == row) {
            entries.push((column, value));
            next.next();
        }
        entries.sort_unstable_by_key(|e| e.0);
        let sum: f32 = entries.iter().map(|e| e.1).sum();
        indices.extend(entries.iter().map(|e| e.0));
        values.extend(entries.iter().map(|e| e.1 / sum));
        counts.push((indices.len() - before) as u32);
    }
    *result = assemble(result.rows(), d, vec![(counts, indices, values)]);
}
