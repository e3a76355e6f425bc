//! Columns as they grew, before they are put in rows: of millions of vertices those would be as much again, and whoever
//! coarsens the mesh needs few.

use super::Column;
use chladni_algebra::SparseMatrix;

/// Columns of a partition of unity, `n × d`.
pub(in crate::spectrum) struct Grown {
    /// In the order of the columns; weights are not over the sums yet.
    columns: Vec<Column>,
    /// The sum of the weights at each vertex.
    sums: Vec<f32>,
}

impl Grown {
    pub(super) fn new(n: usize, columns: Vec<Column>) -> Self {
        let mut sums = vec![0f32; n];
        // Column by column, so that the sum of a row is that of its entries in their order.
        columns.iter().flatten().for_each(|&(v, weight)| sums[v as usize] += weight);
        Self { columns, sums }
    }

    /// The number `n` of vertices.
    pub(in crate::spectrum) fn rows(&self) -> usize {
        self.sums.len()
    }

    /// The number `d` of columns.
    pub(in crate::spectrum) fn columns(&self) -> usize {
        self.columns.len()
    }

    /// The number of stored entries.
    pub(in crate::spectrum) fn entries(&self) -> usize {
        self.columns.iter().map(Vec::len).sum()
    }

    /// The first vertex that lies in no column.
    pub(in crate::spectrum) fn uncovered(&self) -> Option<usize> {
        self.sums.iter().position(|&sum| !(sum > 0.0 && sum.is_finite()))
    }

    /// The largest entry of a column and its vertex, the first of equals; `None` where it has none.
    pub(in crate::spectrum) fn peak(&self, column: usize) -> Option<(f32, u32)> {
        let mut best: Option<(f32, u32)> = None;
        for &(v, weight) in &self.columns[column] {
            let value = weight * (1.0 / self.sums[v as usize]);
            let better = |&(most, at): &(f32, u32)| value > most || (value == most && v < at);
            if value > 0.0 && best.as_ref().is_none_or(better) {
                best = Some((value, v));
            }
        }
        best
    }

    /// The rows of some vertices, each once, in their order.
    pub(in crate::spectrum) fn select_rows(&self, vertices: &[u32]) -> SparseMatrix<f32> {
        let mut places = vec![u32::MAX; self.sums.len()];
        vertices.iter().zip(0..).for_each(|(&v, place)| places[v as usize] = place);
        let mut offsets = vec![0usize; vertices.len() + 1];
        let placed = |column: &Column, each: &mut dyn FnMut(usize, f32)| {
            for &(v, weight) in column {
                let place = places[v as usize];
                if place != u32::MAX {
                    each(place as usize, weight * (1.0 / self.sums[v as usize]));
                }
            }
        };
        self.columns.iter().for_each(|column| placed(column, &mut |place, _| offsets[place + 1] += 1));
        for row in 0..vertices.len() {
            offsets[row + 1] += offsets[row];
        }
        let (mut indices, mut values) = (vec![0u32; offsets[vertices.len()]], vec![0f32; offsets[vertices.len()]]);
        let mut next = offsets.clone();
        for (name, column) in self.columns.iter().enumerate() {
            placed(column, &mut |place, value| {
                (indices[next[place]], values[next[place]]) = (name as u32, value);
                next[place] += 1;
            });
        }
        SparseMatrix::from_sorted_parts(vertices.len(), self.columns.len(), offsets, indices, values)
    }
}
