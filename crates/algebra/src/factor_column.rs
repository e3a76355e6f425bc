//! Solving with a sparse factor for one right-hand side. A panel of 32 columns reads every entry of `L` once for all of them and multiplies 32 times; one
//! column alone is done in the time in which the factor is read, twice, or less where the right-hand side has few entries.

use super::factor::{FactorNumbers, Node, Pivoting, SymbolicFactor};
use super::product::Scalar;
use super::simd::vectorized;

/// Columns of a supernode that are eliminated together: what they share of a row is loaded and stored once.
const TOGETHER: usize = 4;

impl SymbolicFactor {
    /// `x ← (A − μB)⁻¹ x` with the numbers of a factor of this structure.
    ///
    /// # Panics
    /// Where there are not as many numbers as the matrix has rows, or the factor came from another structure.
    pub fn solve_column<T: Scalar>(&self, numbers: &FactorNumbers<T>, x: &mut [f64]) {
        let FactorNumbers { values, inverse, pivoting, .. } = numbers;
        let found = (values.len(), inverse.len());
        assert_eq!(found, (self.entries(), self.size()), "numbers of a factor of this structure");
        assert_eq!(x.len(), self.size(), "a number for each row of the matrix");
        let widest = self.nodes.iter().map(|node| node.pattern.1.max(node.columns)).max().unwrap_or(0);
        let mut scratch = vec![0.0; widest];
        vectorized(
            (x, &mut scratch[..]),
            #[inline(always)]
            |(x, scratch)| {
                for node in &self.nodes {
                    let part = Part::new(self, values, node);
                    let (head, tail) = x.split_at_mut(part.end);
                    let top = &mut head[node.start..];
                    // Below the rows that the right-hand side begins with, only their ancestors in the elimination tree are reached.
                    if top.iter().all(|&x| x == 0.0) {
                        continue;
                    }
                    permute(pivoting.as_ref(), node, top, scratch, true);
                    part.forward(top, tail, scratch);
                }
                for node in self.nodes.iter().rev() {
                    let part = Part::new(self, values, node);
                    let (head, tail) = x.split_at_mut(part.end);
                    let top = &mut head[node.start..];
                    divide(pivoting.as_ref(), node, &inverse[node.start..part.end], top);
                    part.backward(top, tail, scratch);
                    permute(pivoting.as_ref(), node, top, scratch, false);
                }
            },
        );
    }
}

/// One supernode of a factor.
struct Part<'a, T> {
    /// Where the rows below its columns begin.
    end: usize,
    columns: usize,
    rows: usize,
    values: &'a [T],
    below: &'a [u32],
}

impl<'a, T: Scalar> Part<'a, T> {
    #[inline(always)]
    fn new(symbolic: &'a SymbolicFactor, values: &'a [T], node: &Node) -> Self {
        let rows = node.columns + node.pattern.1;
        Self {
            end: node.start + node.columns,
            columns: node.columns,
            rows,
            values: &values[node.values..node.values + rows * node.columns],
            below: &symbolic.patterns[node.pattern.0..node.pattern.0 + node.pattern.1],
        }
    }

    /// The entries of one column of `L` from a row on.
    #[inline(always)]
    fn column(&self, column: usize, from: usize) -> &'a [T] {
        &self.values[column * self.rows + from..(column + 1) * self.rows]
    }

    /// `x ← L⁻¹ x` as far as the columns of this supernode act.
    #[inline(always)]
    fn forward(&self, top: &mut [f64], tail: &mut [f64], scratch: &mut [f64]) {
        for j in 0..self.columns {
            let x = top[j];
            let column = &self.column(j, j + 1)[..self.columns - j - 1];
            top[j + 1..].iter_mut().zip(column).for_each(|(y, l)| *y -= l.wide() * x);
        }
        let sums = &mut scratch[..self.below.len()];
        sums.fill(0.0);
        let mut j = 0;
        while j + TOGETHER <= self.columns {
            let [a, b, c, d]: [&[T]; TOGETHER] = std::array::from_fn(|k| self.column(j + k, self.columns));
            let [p, q, r, s]: [f64; TOGETHER] = std::array::from_fn(|k| top[j + k]);
            let entries = a.iter().zip(b).zip(c.iter().zip(d));
            for (sum, ((a, b), (c, d))) in sums.iter_mut().zip(entries) {
                *sum += (a.wide() * p + b.wide() * q) + (c.wide() * r + d.wide() * s);
            }
            j += TOGETHER;
        }
        for j in j..self.columns {
            let x = top[j];
            sums.iter_mut().zip(self.column(j, self.columns)).for_each(|(sum, l)| *sum += l.wide() * x);
        }
        for (sum, &row) in sums.iter().zip(self.below) {
            tail[row as usize - self.end] -= sum;
        }
    }

    /// `x ← L⁻ᵀ x` for the rows of this supernode.
    #[inline(always)]
    fn backward(&self, top: &mut [f64], tail: &[f64], scratch: &mut [f64]) {
        let gathered = &mut scratch[..self.below.len()];
        for (x, &row) in gathered.iter_mut().zip(self.below) {
            *x = tail[row as usize - self.end];
        }
        for j in 0..self.columns {
            top[j] -= dot(self.column(j, self.columns), gathered);
        }
        for j in (0..self.columns).rev() {
            let (above, done) = top.split_at_mut(j + 1);
            above[j] -= dot(&self.column(j, j + 1)[..done.len()], done);
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
