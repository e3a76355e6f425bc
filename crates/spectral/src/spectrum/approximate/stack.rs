//! Rows that come in pieces of a matrix, put together.
//!
//! Columns are put in order first, then values, so that there are never two of both. Pieces that are let go of bit by
//! bit while the whole is written take more, not less: the allocator keeps small blocks for itself, where large ones
//! serve for what is asked for next (docs/decisions/0127).

use chladni_algebra::SparseMatrix;
use chladni_base::trim;

use crate::operator::spread_rows;

/// Of so many entries on what pieces leave behind is given back as they go: two copies of both would be more than all
/// else.
const MANY: usize = 1 << 24;

/// Pieces of a matrix, each of some of its rows.
pub(super) struct Stack<T> {
    rows: usize,
    columns: usize,
    pieces: Vec<(Vec<u32>, SparseMatrix<T>)>,
}

impl<T: Copy + Default + Send + Sync> Stack<T> {
    /// Without any piece yet.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, pieces: Vec::new() }
    }

    /// Takes a piece, and where its rows lie. No row lies in two pieces.
    pub fn push(&mut self, rows: Vec<u32>, piece: SparseMatrix<T>) {
        self.pieces.push((rows, piece));
    }

    /// All rows; those of no piece are empty.
    pub fn finish(self) -> SparseMatrix<T> {
        let Self { rows: n, columns, mut pieces } = self;
        if pieces.len() > 1 {
            return scattered(n, columns, pieces);
        }
        match pieces.pop() {
            Some((rows, piece)) if rows.is_sorted() => spread_rows(piece, &rows, n),
            Some(piece) => scattered(n, columns, vec![piece]),
            None => SparseMatrix::from_sorted_parts(n, columns, vec![0; n + 1], Vec::new(), Vec::new()),
        }
    }
}

fn scattered<T: Copy + Default + Send + Sync>(
    n: usize,
    d: usize,
    parts: Vec<(Vec<u32>, SparseMatrix<T>)>,
) -> SparseMatrix<T> {
    let mut offsets = vec![0usize; n + 1];
    for (rows, part) in &parts {
        rows.iter().enumerate().for_each(|(at, &row)| offsets[row as usize + 1] = part.row(at).0.len());
    }
    for row in 0..n {
        offsets[row + 1] += offsets[row];
    }
    let (mut of_indices, mut of_values) = (Vec::new(), Vec::new());
    for (rows, part) in parts {
        let (begins, indices, values) = part.into_parts();
        of_values.push((rows, begins, values));
        of_indices.push(indices);
    }
    let mut indices = vec![0u32; offsets[n]];
    let let_go = || {
        if offsets[n] >= MANY {
            trim();
        }
    };
    for ((rows, begins, _), part) in of_values.iter().zip(of_indices) {
        scatter(&offsets, rows, begins, &part, &mut indices);
        drop(part);
        let_go();
    }
    let mut values = vec![T::default(); offsets[n]];
    for (rows, begins, part) in of_values {
        scatter(&offsets, &rows, &begins, &part, &mut values);
        drop((rows, begins, part));
        let_go();
    }
    SparseMatrix::from_sorted_parts(n, d, offsets, indices, values)
}

fn scatter<T: Copy>(offsets: &[usize], rows: &[u32], begins: &[usize], from: &[T], to: &mut [T]) {
    for (&row, range) in rows.iter().zip(begins.windows(2)) {
        to[offsets[row as usize]..offsets[row as usize + 1]].copy_from_slice(&from[range[0]..range[1]]);
    }
}

#[cfg(test)]
#[path = "stack_tests.rs"]
mod tests;
