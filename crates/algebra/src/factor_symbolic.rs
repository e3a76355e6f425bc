//! The structure of a factor: its supernodes and the rows below them, for a matrix in a postorder of its elimination
//! tree.
//!
//! One sweep over the columns does. The rows of a column of `L` are those of the matrix and those of its children in
//! the tree, which in a postorder come right before it; a column that brings no row of its own and has one child
//! continues the supernode of that (Liu, Ng and Peyton 1993).

use std::ops::Range;

use chladni_base::parallel::*;

use super::factor::Node;
use super::{FactorError, MassMatrix, SparseMatrix, WeightedMass};

/// Where an entry of the shifted matrix comes from that is in one of the two alone.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Rows of a matrix that one task goes through.
const ROWS: usize = 4096;

/// The lower triangle of `A − μB`, column after column.
#[derive(Debug)]
pub(super) struct Lower {
    pub offsets: Vec<usize>,
    pub rows: Vec<u32>,
    /// For each entry its position in `A` and in `B`.
    pub sources: Vec<(u32, u32)>,
}

impl Lower {
    /// Of matrices of one size.
    pub fn new(a: &SparseMatrix, b: &MassMatrix) -> Result<Self, FactorError> {
        let n = a.rows();
        let mut offsets = vec![0usize; n + 1];
        offsets[1..].par_chunks_mut(ROWS).enumerate().for_each(|(part, counts)| {
            for (k, count) in counts.iter_mut().enumerate() {
                *count = column(a, b, part * ROWS + k).count();
            }
        });
        (0..n).for_each(|row| offsets[row + 1] += offsets[row]);
        let entries = offsets[n];
        let (mut rows, mut sources): (Vec<u32>, Vec<(u32, u32)>) = (Vec::new(), Vec::new());
        let memory = FactorError::Memory { bytes: 12 * entries };
        rows.try_reserve_exact(entries).map_err(|_| memory.clone())?;
        sources.try_reserve_exact(entries).map_err(|_| memory)?;
        rows.par_extend(rayon::iter::repeat_n(0, entries));
        sources.par_extend(rayon::iter::repeat_n((0, 0), entries));
        let (mut rest, mut parts) = ((&mut rows[..], &mut sources[..]), Vec::new());
        for from in (0..n).step_by(ROWS) {
            let to = (from + ROWS).min(n);
            let size = offsets[to] - offsets[from];
            let (own, after) = rest.0.split_at_mut(size);
            let (own_sources, after_sources) = rest.1.split_at_mut(size);
            parts.push((from..to, own, own_sources));
            rest = (after, after_sources);
        }
        parts.into_par_iter().for_each(|(range, rows, sources)| {
            let entries = range.flat_map(|row| column(a, b, row));
            for ((row, in_a, in_b), (into, source)) in entries.zip(rows.iter_mut().zip(sources)) {
                *into = row;
                *source = (in_a, in_b);
            }
        });
        Ok(Self { offsets, rows, sources })
    }

    /// Rows as faer takes them.
    pub fn wide_rows(&self) -> Vec<usize> {
        self.rows.iter().map(|&row| row as usize).collect()
    }

    pub fn column(&self, column: usize) -> &[u32] {
        &self.rows[self.offsets[column]..self.offsets[column + 1]]
    }
}

/// The entries of a column from its diagonal on, which by symmetry are those of the row: the row, and the positions in
/// `A` and in `B`.
fn column<'a>(a: &'a SparseMatrix, b: &'a MassMatrix, row: usize) -> impl Iterator<Item = (u32, u32, u32)> + 'a {
    let from = |matrix: &'a SparseMatrix| {
        let columns = matrix.row(row).0;
        let skipped = columns.partition_point(|&column| (column as usize) < row);
        columns[skipped..].iter().copied().zip((matrix.offsets()[row] + skipped) as u32..)
    };
    let (of_diagonal, of_matrix) = match b {
        MassMatrix::Diagonal(_) => (Some((row as u32, row as u32)), None),
        MassMatrix::Sparse(b) | MassMatrix::Weighted(WeightedMass { matrix: b, .. }) => (None, Some(from(b))),
    };
    let mut first = from(a).peekable();
    let mut second = of_diagonal.into_iter().chain(of_matrix.into_iter().flatten()).peekable();
    std::iter::from_fn(move || {
        let (next, other) = (first.peek().copied(), second.peek().copied());
        let least = match (next, other) {
            (Some(next), Some(other)) => next.0.min(other.0),
            (Some(one), None) | (None, Some(one)) => one.0,
            (None, None) => return None,
        };
        let in_a = first.next_if(|entry| entry.0 == least).map_or(NOWHERE, |entry| entry.1);
        let in_b = second.next_if(|entry| entry.0 == least).map_or(NOWHERE, |entry| entry.1);
        Some((least, in_a, in_b))
    })
}

/// Columns with one pattern below, all of whose entries are those of the factor.
struct Fundamental {
    start: usize,
    columns: usize,
    /// The rows below, in the list of all.
    pattern: Range<usize>,
    /// The first column of the subtree.
    first: usize,
}

/// A supernode takes the one before it if the share of zeros in what they become is no more than this for so many
/// columns: what faer takes as well.
const ZEROS: [(usize, f64); 4] = [(4, 1.0), (16, 0.8), (48, 0.1), (usize::MAX, 0.05)];

/// The supernodes and the rows below each, or nothing where the order is no postorder.
pub(super) fn supernodes(lower: &Lower) -> Option<(Vec<Node>, Vec<u32>)> {
    let (nodes, rows) = fundamental(lower)?;
    Some(relaxed(&nodes, &rows))
}

fn fundamental(lower: &Lower) -> Option<(Vec<Fundamental>, Vec<u32>)> {
    let n = lower.offsets.len() - 1;
    let (mut done, mut rows): (Vec<Fundamental>, Vec<u32>) = (Vec::new(), Vec::new());
    // Supernodes without a parent as yet; the children of a column are the last of them, or it is no postorder.
    let mut waiting: Vec<usize> = Vec::new();
    let mut children = vec![0u32; n];
    // One more than the last column so far that has an entry in a row.
    let mut last = vec![0u32; n];
    // The supernode that is open: how many of its rows were columns of its own.
    let mut open: Option<(Fundamental, usize)> = None;
    let (mut union, mut spare) = (Vec::new(), Vec::new());
    for column in 0..n {
        let mut hangs = false;
        if let Some((node, taken)) = &open {
            hangs = rows.get(node.pattern.start + taken).is_some_and(|&row| row as usize == column);
            children[column] += u32::from(hangs);
        }
        let first = match &open {
            Some((node, _)) if hangs && children[column] == 1 => node.first,
            _ => column,
        };
        let own = lower.column(column);
        let mut brings = false;
        for &row in own.iter().skip_while(|&&row| row as usize <= column) {
            let before = std::mem::replace(&mut last[row as usize], column as u32 + 1);
            brings |= (before as usize) <= first;
        }
        if hangs && children[column] == 1 && !brings {
            if let Some((node, taken)) = &mut open {
                node.columns += 1;
                *taken += 1;
            }
            continue;
        }
        close(open.take(), &mut done, &mut waiting, &mut rows, &mut children, hangs);
        union.clear();
        union.extend(own.iter().filter(|&&row| row as usize > column));
        let mut node = Fundamental { start: column, columns: 1, pattern: 0..0, first: column };
        for _ in 0..children[column] {
            let child = &done[waiting.pop()?];
            let pattern = &rows[child.pattern.clone()];
            if pattern.first().is_none_or(|&row| row as usize != column) {
                return None;
            }
            node.first = child.first;
            merge(&union, &pattern[1..], &mut spare);
            std::mem::swap(&mut union, &mut spare);
        }
        node.pattern = rows.len()..rows.len() + union.len();
        rows.extend_from_slice(&union);
        open = Some((node, 0));
    }
    close(open, &mut done, &mut waiting, &mut rows, &mut children, false);
    waiting.is_empty().then_some((done, rows))
}

/// The supernode that was open has no more columns.
fn close(
    open: Option<(Fundamental, usize)>,
    done: &mut Vec<Fundamental>,
    waiting: &mut Vec<usize>,
    rows: &mut Vec<u32>,
    children: &mut [u32],
    counted: bool,
) {
    let Some((mut node, taken)) = open else { return };
    rows.drain(node.pattern.start..node.pattern.start + taken);
    node.pattern.end -= taken;
    if let Some(&parent) = rows[node.pattern.clone()].first() {
        children[parent as usize] += u32::from(!counted);
        waiting.push(done.len());
    }
    done.push(node);
}

/// The union of ascending rows.
fn merge(first: &[u32], second: &[u32], into: &mut Vec<u32>) {
    into.clear();
    let (mut i, mut j) = (0, 0);
    while let (Some(&a), Some(&b)) = (first.get(i), second.get(j)) {
        into.push(a.min(b));
        i += usize::from(a <= b);
        j += usize::from(b <= a);
    }
    into.extend_from_slice(&first[i..]);
    into.extend_from_slice(&second[j..]);
}

/// The same with small supernodes taken into those above them, for the price of some zeros.
fn relaxed(nodes: &[Fundamental], rows: &[u32]) -> (Vec<Node>, Vec<u32>) {
    let mut columns: Vec<usize> = nodes.iter().map(|node| node.columns).collect();
    let mut zeros = vec![0usize; nodes.len()];
    let mut taken = vec![false; nodes.len()];
    for at in 1..nodes.len() {
        let (child, parent) = (&nodes[at - 1], &nodes[at]);
        let above = rows[child.pattern.clone()].first().map_or(usize::MAX, |&row| row as usize);
        if !(parent.start..parent.start + parent.columns).contains(&above) {
            continue;
        }
        let (below, child_below) = (parent.pattern.len(), child.pattern.len());
        let new = (columns[at] + below - child_below) * columns[at - 1];
        let all = new + zeros[at] + zeros[at - 1];
        let together = columns[at] + columns[at - 1];
        let entries = (together * (together + 1) / 2 + below * together) as f64;
        let few = ZEROS.iter().any(|&(most, share)| most >= together && entries * share >= all as f64);
        if new == 0 || few {
            (columns[at], zeros[at], taken[at - 1]) = (together, all, true);
        }
    }
    let (mut result, mut patterns) = (Vec::new(), Vec::new());
    let (mut start, mut values) = (0, 0);
    for (at, node) in nodes.iter().enumerate().filter(|&(at, _)| !taken[at]) {
        let (columns, below) = (columns[at], node.pattern.len());
        result.push(Node { start, columns, pattern: (patterns.len(), below), values });
        patterns.extend_from_slice(&rows[node.pattern.clone()]);
        start += columns;
        values += (columns + below) * columns;
    }
    (result, patterns)
}
