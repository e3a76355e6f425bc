//! Rows that come in pieces of a matrix, put together without a second copy of them.
//!
//! The columns of a surface of millions of vertices are more than all else that is held while they are put together, so that two copies are too many.
//! Pieces are cut into runs of rows; the rows of the whole are written one after the other, which uses up the runs of each piece from the first on, and
//! each is let go of when it is used up. Memory that is reserved for the whole and not yet written takes no room.

use std::mem;
use std::vec::IntoIter;

use chladni_algebra::SparseMatrix;

use crate::operator::spread_rows;

/// Entries of a run: what is let go of at once.
const ENTRIES_OF_RUN: usize = 1 << 20;

/// Rows of a matrix that are not in any piece.
const NONE: u32 = u32::MAX;

/// Pieces of a matrix, each of some of its rows.
pub(super) struct Stack<T> {
    rows: usize,
    columns: usize,
    entries_of_run: usize,
    /// The first piece, as long as it is the only one.
    alone: Option<(Vec<u32>, SparseMatrix<T>)>,
    pieces: Vec<(Vec<u32>, Vec<Run<T>>)>,
}

/// Rows that follow each other in a piece.
struct Run<T> {
    /// The entries of each row.
    counts: Vec<u32>,
    indices: Vec<u32>,
    values: Vec<T>,
}

impl<T: Copy + Default + Send + Sync> Stack<T> {
    /// Without any piece yet.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries_of_run: ENTRIES_OF_RUN, alone: None, pieces: Vec::new() }
    }

    /// Takes a piece, and where its rows lie. No row lies in two pieces.
    pub fn push(&mut self, rows: Vec<u32>, piece: SparseMatrix<T>) {
        let (rows, piece) = ascending(rows, piece);
        if self.pieces.is_empty() && self.alone.is_none() {
            self.alone = Some((rows, piece));
            return;
        }
        for (rows, piece) in self.alone.take().into_iter().chain([(rows, piece)]) {
            self.pieces.push((rows, runs(piece, self.entries_of_run)));
        }
    }

    /// All rows; those of no piece are empty.
    pub fn finish(self) -> SparseMatrix<T> {
        let Self { rows: n, columns, alone, pieces, .. } = self;
        if let Some((rows, piece)) = alone {
            return spread_rows(piece, &rows, n);
        }
        let mut piece_of = vec![NONE; n];
        let mut entries = 0;
        let mut left: Vec<Left<T>> = Vec::with_capacity(pieces.len());
        for (number, (rows, runs)) in (0..).zip(pieces) {
            rows.iter().for_each(|&row| piece_of[row as usize] = number);
            entries += runs.iter().map(|run| run.indices.len()).sum::<usize>();
            left.push(Left::of(runs));
        }
        let mut offsets = Vec::with_capacity(n + 1);
        let (mut indices, mut values) = (Vec::with_capacity(entries), Vec::with_capacity(entries));
        offsets.push(0);
        for number in piece_of {
            if let Some(left) = left.get_mut(number as usize) {
                left.next(&mut indices, &mut values);
            }
            offsets.push(indices.len());
        }
        SparseMatrix::from_sorted_parts(n, columns, offsets, indices, values)
    }
}

/// What is not yet written of a piece.
struct Left<T> {
    runs: IntoIter<Run<T>>,
    run: Option<Run<T>>,
    /// Rows and entries of the run that are written.
    row: usize,
    entry: usize,
}

impl<T: Copy> Left<T> {
    fn of(runs: Vec<Run<T>>) -> Self {
        let mut runs = runs.into_iter();
        Self { run: runs.next(), runs, row: 0, entry: 0 }
    }

    /// Writes the next row.
    fn next(&mut self, indices: &mut Vec<u32>, values: &mut Vec<T>) {
        let Some(run) = &self.run else { return };
        let Some(&count) = run.counts.get(self.row) else { return };
        let range = self.entry..self.entry + count as usize;
        indices.extend_from_slice(&run.indices[range.clone()]);
        values.extend_from_slice(&run.values[range.clone()]);
        (self.row, self.entry) = (self.row + 1, range.end);
        if self.row == run.counts.len() {
            (self.run, self.row, self.entry) = (self.runs.next(), 0, 0);
        }
    }
}

/// The same rows, ascending.
fn ascending<T: Copy + Default + Send + Sync>(rows: Vec<u32>, piece: SparseMatrix<T>) -> (Vec<u32>, SparseMatrix<T>) {
    if rows.is_sorted() {
        return (rows, piece);
    }
    let mut order: Vec<u32> = (0..rows.len() as u32).collect();
    order.sort_unstable_by_key(|&at| rows[at as usize]);
    (order.iter().map(|&at| rows[at as usize]).collect(), piece.select_rows(&order))
}

/// Cuts a matrix into runs of rows with about so many entries each. Of indices and values there are two copies one after the other, not at once.
fn runs<T: Copy>(matrix: SparseMatrix<T>, entries_of_run: usize) -> Vec<Run<T>> {
    let (offsets, indices, values) = matrix.into_parts();
    let mut ends = Vec::new();
    let mut counts = Vec::new();
    let mut own = Vec::new();
    let mut begin = 0;
    for range in offsets.windows(2) {
        own.push((range[1] - range[0]) as u32);
        if range[1] - begin >= entries_of_run {
            begin = range[1];
            ends.push(begin);
            counts.push(mem::take(&mut own));
        }
    }
    if !own.is_empty() {
        ends.push(offsets.last().copied().unwrap_or(0));
        counts.push(own);
    }
    drop(offsets);
    let (indices, values) = (cut(indices, &ends), cut(values, &ends));
    let runs = counts.into_iter().zip(indices.into_iter().zip(values));
    runs.map(|(counts, (indices, values))| Run { counts, indices, values }).collect()
}

/// The pieces of a list that end at some places.
fn cut<T: Copy>(list: Vec<T>, ends: &[usize]) -> Vec<Vec<T>> {
    if ends.len() == 1 {
        return vec![list];
    }
    let begins = std::iter::once(0).chain(ends.iter().copied());
    begins.zip(ends).map(|(begin, &end)| list[begin..end].to_vec()).collect()
}

#[cfg(test)]
#[path = "stack_tests.rs"]
mod tests;
