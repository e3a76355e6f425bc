//! Solving with a sparse factor for one right-hand side. A panel of 32 columns reads every entry of `L` once for all of
//! them and multiplies 32 times; one column alone is done in the time in which the factor is read, twice, or less where
//! the right-hand side has few entries.

mod tree;

use super::factor::{Node, Pivoting};
use super::factor_solve::{Parts, Stretch};
use super::product::Scalar;
use super::simd::vectorized;

pub use tree::ColumnTree;

/// Columns of a supernode that are eliminated together: what they share of a row is loaded and stored once.
const TOGETHER: usize = 4;

/// Rows that are handled side by side. What lies behind the last row of a column is read with them and counts for
/// nothing: most columns are so short that the rows left over would take longer than all others.
const LANES: usize = 8;

/// Eliminates consecutive supernodes from a column, or substitutes in them in the opposite order. `scratch` is as long
/// as the widest of them, or its rows below in whole lanes.
fn sweep<T: Scalar>(factor: Parts<'_, T>, stretch: Stretch<'_>, forward: bool, x: &mut [f64], scratch: &mut [f64]) {
    let Parts { values, inverse, pivoting, .. } = factor;
    vectorized(
        (x, scratch),
        #[inline(always)]
        |(x, scratch)| {
            if forward {
                for node in stretch.nodes {
                    let part = Part::new(&stretch, values, node);
                    let (head, tail) = x.split_at_mut(part.end);
                    let top = &mut head[part.end - part.columns..];
                    // Below the rows that the right-hand side begins with, only their ancestors in the elimination tree
                    // are reached.
                    if top.iter().all(|&x| x == 0.0) {
                        continue;
                    }
                    permute(pivoting, node, top, scratch, true);
                    part.forward(top, tail, scratch);
                }
            } else {
                for node in stretch.nodes.iter().rev() {
                    let part = Part::new(&stretch, values, node);
                    let (head, tail) = x.split_at_mut(part.end);
                    let top = &mut head[part.end - part.columns..];
                    divide(pivoting, node, &inverse[node.start..node.start + node.columns], top);
                    part.backward(top, tail, scratch);
                    permute(pivoting, node, top, scratch, false);
                }
            }
        },
    );
}

/// One supernode of a factor.
struct Part<'a, T> {
    /// Where the rows after its own begin in the column that is solved for.
    end: usize,
    columns: usize,
    rows: usize,
    /// Its entries, and all that come after them.
    values: &'a [T],
    below: &'a [u32],
}

impl<'a, T: Scalar> Part<'a, T> {
    #[inline(always)]
    fn new(stretch: &Stretch<'a>, values: &'a [T], node: &Node) -> Self {
        Self {
            end: node.start + node.columns - stretch.first_row,
            columns: node.columns,
            rows: node.columns + node.pattern.1,
            values: &values[node.values..],
            below: &stretch.patterns[node.pattern.0 - stretch.first_pattern..][..node.pattern.1],
        }
    }

    /// The entries of one column of `L` within the supernode, from a row on.
    #[inline(always)]
    fn within(&self, column: usize, from: usize) -> &'a [T] {
        &self.values[column * self.rows + from..column * self.rows + self.columns]
    }

    /// The entries of some columns of `L` below the supernode, in lanes: so many rows, or fewer where the factor ends.
    #[inline(always)]
    fn lanes<const C: usize>(&self, column: usize) -> [&'a [[T; LANES]]; C] {
        std::array::from_fn(|k| {
            let from = &self.values[(column + k) * self.rows + self.columns..];
            from[..from.len().min(self.below.len().next_multiple_of(LANES))].as_chunks().0
        })
    }

    /// The rows that are in no lanes there, which are few and only at the end of the factor.
    #[inline(always)]
    fn left_over(&self, lanes: usize) -> std::ops::Range<usize> {
        (LANES * lanes).min(self.below.len())..self.below.len()
    }

    /// `x ← L⁻¹ x` as far as the columns of this supernode act.
    #[inline(always)]
    fn forward(&self, top: &mut [f64], tail: &mut [f64], scratch: &mut [f64]) {
        for j in 0..self.columns {
            let x = top[j];
            top[j + 1..].iter_mut().zip(self.within(j, j + 1)).for_each(|(y, l)| *y -= l.wide() * x);
        }
        let sums = &mut scratch[..self.below.len().next_multiple_of(LANES)];
        sums.fill(0.0);
        let mut j = 0;
        while j + TOGETHER <= self.columns {
            self.eliminate::<TOGETHER>(j, top, sums);
            j += TOGETHER;
        }
        match self.columns - j {
            3 => self.eliminate::<3>(j, top, sums),
            2 => self.eliminate::<2>(j, top, sums),
            1 => self.eliminate::<1>(j, top, sums),
            _ => {}
        }
        for (sum, &row) in sums.iter().zip(self.below) {
            tail[row as usize - self.end] -= sum;
        }
    }

    /// Adds `C` columns of `L` below, times their rows of `x`.
    #[inline(always)]
    fn eliminate<const C: usize>(&self, column: usize, top: &[f64], sums: &mut [f64]) {
        let x: [f64; C] = std::array::from_fn(|k| top[column + k]);
        let columns = self.lanes::<C>(column);
        let lanes = columns[C - 1].len();
        let columns = columns.map(|column| &column[..lanes]);
        for (at, sums) in sums.as_chunks_mut::<LANES>().0[..lanes].iter_mut().enumerate() {
            let l: [&[T; LANES]; C] = std::array::from_fn(|k| &columns[k][at]);
            for (lane, sum) in sums.iter_mut().enumerate() {
                let mut own = 0.0;
                for k in 0..C {
                    own += l[k][lane].wide() * x[k];
                }
                *sum += own;
            }
        }
        for row in self.left_over(lanes) {
            let l = |k: usize| self.values[(column + k) * self.rows + self.columns + row].wide();
            sums[row] += (0..C).map(|k| l(k) * x[k]).sum::<f64>();
        }
    }

    /// `x ← L⁻ᵀ x` for the rows of this supernode.
    #[inline(always)]
    fn backward(&self, top: &mut [f64], tail: &[f64], scratch: &mut [f64]) {
        let gathered = &mut scratch[..self.below.len().next_multiple_of(LANES)];
        for (x, &row) in gathered.iter_mut().zip(self.below) {
            *x = tail[row as usize - self.end];
        }
        gathered[self.below.len()..].fill(0.0);
        let mut j = 0;
        while j + TOGETHER <= self.columns {
            self.substitute::<TOGETHER>(j, top, gathered);
            j += TOGETHER;
        }
        match self.columns - j {
            3 => self.substitute::<3>(j, top, gathered),
            2 => self.substitute::<2>(j, top, gathered),
            1 => self.substitute::<1>(j, top, gathered),
            _ => {}
        }
        for j in (0..self.columns).rev() {
            let (above, done) = top.split_at_mut(j + 1);
            above[j] -= dot(self.within(j, j + 1), done);
        }
    }

    /// Takes the products of `C` columns of `L` below with what was gathered off their rows of `x`.
    #[inline(always)]
    fn substitute<const C: usize>(&self, column: usize, top: &mut [f64], gathered: &[f64]) {
        let columns = self.lanes::<C>(column);
        let lanes = columns[C - 1].len();
        let columns = columns.map(|column| &column[..lanes]);
        let mut sums = [[0.0; LANES]; C];
        for (at, x) in gathered.as_chunks::<LANES>().0[..lanes].iter().enumerate() {
            for k in 0..C {
                for lane in 0..LANES {
                    sums[k][lane] += columns[k][at][lane].wide() * x[lane];
                }
            }
        }
        for k in 0..C {
            let s = &sums[k];
            top[column + k] -= ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
        }
        for row in self.left_over(lanes) {
            for k in 0..C {
                top[column + k] -= self.values[(column + k) * self.rows + self.columns + row].wide() * gathered[row];
            }
        }
    }
}

/// Eight sums at once, which a vector unit holds in one or two registers.
#[inline(always)]
fn dot<T: Scalar>(a: &[T], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for k in 0..8 {
            sums[k] += a[k].wide() * b[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a.wide() * b).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + rest
}

/// Brings the rows of a supernode into the order of its pivots, or back.
#[inline(always)]
fn permute(pivoting: Option<&Pivoting>, node: &Node, top: &mut [f64], scratch: &mut [f64], forward: bool) {
    let Some(pivoting) = pivoting else { return };
    let scratch = &mut scratch[..top.len()];
    scratch.copy_from_slice(top);
    for (k, &row) in pivoting.order[node.start..node.start + node.columns].iter().enumerate() {
        let row = row as usize - node.start;
        if forward {
            top[k] = scratch[row];
        } else {
            top[row] = scratch[k];
        }
    }
}

/// `x ← D⁻¹ x` for the rows of a supernode.
#[inline(always)]
fn divide(pivoting: Option<&Pivoting>, node: &Node, inverse: &[f64], top: &mut [f64]) {
    let Some(pivoting) = pivoting else {
        top.iter_mut().zip(inverse).for_each(|(x, d)| *x *= d);
        return;
    };
    let off_diagonal = &pivoting.off_diagonal[node.start..node.start + node.columns];
    let mut k = 0;
    while k < top.len() {
        if off_diagonal[k] == 0.0 || k + 1 == top.len() {
            top[k] *= inverse[k];
            k += 1;
        } else {
            let (x, y) = (top[k], top[k + 1]);
            top[k] = inverse[k] * x + off_diagonal[k] * y;
            top[k + 1] = off_diagonal[k] * x + inverse[k + 1] * y;
            k += 2;
        }
    }
}
