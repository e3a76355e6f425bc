//! What a child takes off is added to the front of its parent.

use super::plan::stride;

/// The update matrix of a supernode, for the one above.
pub struct Update {
    pub node: usize,
    /// Its rows.
    pub below: usize,
    /// Column after column, and the sums of its rows where these are kept.
    pub values: Vec<f64>,
    /// Whether columns hold what is below the diagonal alone.
    pub packed: bool,
}

/// The same, borrowed.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub values: &'a [f64],
    pub below: usize,
    pub packed: bool,
    pub sums: &'a [f64],
}

/// With fewer columns than this a matrix is not shared out among threads.
const FEWEST_COLUMNS: usize = 64;

impl Update {
    /// A copy of the lower triangle of a matrix on a stack, without the memory above its diagonal: it waits longer than
    /// those there.
    pub fn packed(node: usize, below: usize, from: &[f64], sums: bool) -> Self {
        let stride = stride(below);
        let mut values = Vec::with_capacity(below * (below + 1) / 2 + if sums { below } else { 0 });
        for column in 0..below {
            values.extend_from_slice(&from[column * stride + column..column * stride + below]);
        }
        if sums {
            values.extend_from_slice(&from[stride * stride..][..below]);
        }
        Self { node, below, values, packed: true }
    }

    pub fn view(&self) -> View<'_> {
        let Self { below, packed, .. } = *self;
        let size = if packed { below * (below + 1) / 2 } else { stride(below).pow(2) };
        let (values, sums) = self.values.split_at(size);
        View { values, below, packed, sums: &sums[..below.min(sums.len())] }
    }
}

impl View<'_> {
    /// A column from its diagonal on.
    fn column(&self, column: usize) -> &[f64] {
        let (from, length) = if self.packed {
            (column * self.below - column * column.saturating_sub(1) / 2, self.below - column)
        } else {
            (column * stride(self.below) + column, self.below - column)
        };
        &self.values[from..from + length]
    }

    /// Adds the columns that are among those of the parent, which are `rows` long and `columns` many.
    pub fn add_to_columns(&self, places: &[u32], (target, rows, columns): (&mut [f64], usize, usize), parallel: bool) {
        let own = places.partition_point(|&place| (place as usize) < columns);
        self.add(0..own, places, Target { values: target, first: 0, length: rows, offset: 0 }, parallel);
    }

    /// Adds the others to its update matrix of `below` rows.
    pub fn add_to_update(&self, places: &[u32], (target, below, columns): (&mut [f64], usize, usize), parallel: bool) {
        let own = places.partition_point(|&place| (place as usize) < columns);
        let target = Target { values: target, first: 0, length: stride(below), offset: columns };
        self.add(own..self.below, places, target, parallel);
    }

    fn add(&self, range: std::ops::Range<usize>, places: &[u32], target: Target<'_>, parallel: bool) {
        if parallel && range.len() > FEWEST_COLUMNS {
            let middle = range.start + range.len() / 2;
            let (left, right) = target.split(places[middle] as usize);
            rayon::join(
                || self.add(range.start..middle, places, left, true),
                || self.add(middle..range.end, places, right, true),
            );
            return;
        }
        let Target { values, first, length, offset } = target;
        for column in range {
            let from = (places[column] as usize - offset - first) * length;
            let target = &mut values[from..from + length];
            for (value, &place) in self.column(column).iter().zip(&places[column..]) {
                target[place as usize - offset] += value;
            }
        }
    }
}

/// Columns that are added to.
struct Target<'a> {
    values: &'a mut [f64],
    /// The first of them.
    first: usize,
    length: usize,
    /// The place of the first row and column.
    offset: usize,
}

impl Target<'_> {
    /// The columns before a place and those from there on.
    fn split(self, place: usize) -> (Self, Self) {
        let Self { values, first, length, offset } = self;
        let at = place - offset;
        let (left, right) = values.split_at_mut((at - first) * length);
        (Self { values: left, first, length, offset }, Self { values: right, first: at, length, offset })
    }
}

/// Where ascending rows are in a front with the columns `(start, columns)` and a pattern below.
pub fn places(rows: &[u32], (start, columns): (usize, usize), pattern: &[u32], into: &mut Vec<u32>) {
    into.clear();
    let own = rows.partition_point(|&row| (row as usize) < start + columns);
    into.extend(rows[..own].iter().map(|&row| row - start as u32));
    let mut at = 0;
    for &row in &rows[own..] {
        // The pattern of the parent holds every row below the child that is not its own.
        while pattern[at] < row {
            at += 1;
        }
        into.push((columns + at) as u32);
    }
}
