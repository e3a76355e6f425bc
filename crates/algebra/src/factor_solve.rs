//! Solving with a sparse factor for several right-hand sides at once: rows of a panel are contiguous, so every entry of
//! `L` meets whole vector registers. For 32 of them three to six times faster than solving column after column where it
//! was measured.

mod reach;
mod tree;

use pulp::Simd;

use super::PANEL_WIDTH;
use super::factor::{Factor, FactorNumbers, Node, Pivoting, SymbolicFactor};
use super::product::Scalar;

pub use reach::{HalfSolved, ReachTree, Sides};
pub use tree::{SolveScratch, SolveTree};

/// Columns of a supernode that are eliminated together: their rows of the panel stay in the first-level cache.
const BLOCK: usize = 16;

/// One row of `W` right-hand sides.
type Row<const W: usize> = [f64; W];

impl Factor<'_> {
    /// `X ← (A − μB)⁻¹ X` for a panel of 32 columns, row after row.
    ///
    /// # Panics
    /// Where the panel has another number of rows than the matrix.
    pub fn solve_panel(&self, panel: &mut [f64]) {
        Parts::of(self).solve(panel);
    }
}

impl SymbolicFactor {
    /// The same with the numbers of a factor of this structure.
    ///
    /// # Panics
    /// Where the panel has another number of rows than the matrix, or the numbers came from another structure.
    pub fn solve_panel<T: Scalar>(&self, numbers: &FactorNumbers<T>, panel: &mut [f64]) {
        Parts::of_numbers(self, numbers).solve(panel);
    }
}

/// What solving needs of a factor.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a, T> {
    pub symbolic: &'a SymbolicFactor,
    pub values: &'a [T],
    pub inverse: &'a [f64],
    pub pivoting: Option<&'a Pivoting>,
}

impl<'a> Parts<'a, f64> {
    fn of(factor: &'a Factor<'_>) -> Self {
        let Factor { symbolic, values, inverse, pivoting, .. } = factor;
        Self { symbolic, values, inverse, pivoting: pivoting.as_ref() }
    }
}

impl<'a, T> Parts<'a, T> {
    /// # Panics
    /// Where the numbers came from another structure.
    pub fn of_numbers(symbolic: &'a SymbolicFactor, numbers: &'a FactorNumbers<T>) -> Self {
        let FactorNumbers { values, inverse, pivoting, .. } = numbers;
        let found = (values.len(), inverse.len());
        assert_eq!(found, (symbolic.entries(), symbolic.size()), "numbers of a factor of this structure");
        Self { symbolic, values, inverse, pivoting: pivoting.as_ref() }
    }
}

impl<T: Scalar> Parts<'_, T> {
    fn solve(self, panel: &mut [f64]) {
        assert_eq!(panel.len(), self.symbolic.size() * PANEL_WIDTH, "a row of the panel for each of the matrix");
        let (rows, _) = panel.as_chunks_mut::<PANEL_WIDTH>();
        let SymbolicFactor { nodes, patterns, .. } = self.symbolic;
        let stretch = Stretch { nodes, first_row: 0, patterns, first_pattern: 0 };
        pulp::Arch::new().dispatch(Sweep { factor: self, stretch, forward: true, x: &mut *rows });
        pulp::Arch::new().dispatch(Sweep { factor: self, stretch, forward: false, x: rows });
    }
}

/// Consecutive supernodes, and the rows below them in the numbering of the panel that is solved for.
#[derive(Clone, Copy)]
pub(super) struct Stretch<'a> {
    pub nodes: &'a [Node],
    /// The row of the matrix that comes first in the panel.
    pub first_row: usize,
    /// The patterns of the supernodes, one after the other.
    pub patterns: &'a [u32],
    /// Where they begin among those of all.
    pub first_pattern: usize,
}

/// Elimination in the order of the supernodes, or substitution in the opposite one.
struct Sweep<'a, 'x, T, const W: usize> {
    factor: Parts<'a, T>,
    stretch: Stretch<'a>,
    forward: bool,
    x: &'x mut [Row<W>],
}

impl<T: Scalar, const W: usize> pulp::WithSimd for Sweep<'_, '_, T, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many vectors as leave room in the registers: `R` rows of accumulators, one row of operands, one factor.
        match (W, S::F64_LANES, S::REGISTER_COUNT) {
            (8, 8, _) => self.run::<S, 1, 8>(simd),
            (8, 4, _) => self.run::<S, 2, 4>(simd),
            (8, 2, _) => self.run::<S, 4, 2>(simd),
            (8, _, _) => self.run::<S, 4, 2>(simd),
            (_, 8, 32) => self.run::<S, 4, 4>(simd),
            (_, 8, _) => self.run::<S, 2, 4>(simd),
            (_, 4, _) => self.run::<S, 2, 4>(simd),
            _ => self.run::<S, 4, 4>(simd),
        }
    }
}

impl<T: Scalar, const W: usize> Sweep<'_, '_, T, W> {
    /// `V` vectors of each row are handled at once, `R` rows together.
    #[inline(always)]
    fn run<S: Simd, const V: usize, const R: usize>(self, simd: S) {
        let Self { factor, stretch, forward, x } = self;
        let groups = W / (V * S::F64_LANES);
        let mut scratch: Vec<Row<W>> = Vec::new();
        if forward {
            for node in stretch.nodes {
                let (part, top, tail) = NodePart::new(factor, &stretch, node, x);
                part.permute(top, &mut scratch, true);
                for group in 0..groups {
                    part.forward::<S, V, R, W>(simd, group, top, tail);
                }
            }
        } else {
            for node in stretch.nodes.iter().rev() {
                let (part, top, tail) = NodePart::new(factor, &stretch, node, x);
                part.divide(top);
                for group in 0..groups {
                    part.backward::<S, V, R, W>(simd, group, top, tail);
                }
                part.permute(top, &mut scratch, false);
            }
        }
    }
}

/// One supernode of a factor.
struct NodePart<'a, T> {
    /// Where the rows of the panel after its own begin.
    end: usize,
    columns: usize,
    rows: usize,
    values: &'a [T],
    below: &'a [u32],
    inverse: &'a [f64],
    /// The first column, the order of the rows and the entries of `D⁻¹` beside its diagonal.
    pivoting: Option<(usize, &'a [u32], &'a [f64])>,
}

impl<'a, T: Scalar> NodePart<'a, T> {
    /// The supernode, its rows of `x` and those after them.
    #[inline(always)]
    fn new<'x, const W: usize>(
        factor: Parts<'a, T>,
        stretch: &Stretch<'a>,
        node: &Node,
        x: &'x mut [Row<W>],
    ) -> (Self, &'x mut [Row<W>], &'x mut [Row<W>]) {
        let (columns, end) = (node.columns, node.start + node.columns);
        let rows = columns + node.pattern.1;
        let (head, tail) = x.split_at_mut(end - stretch.first_row);
        let part = Self {
            end: end - stretch.first_row,
            columns,
            rows,
            values: &factor.values[node.values..node.values + rows * columns],
            below: &stretch.patterns[node.pattern.0 - stretch.first_pattern..][..node.pattern.1],
            inverse: &factor.inverse[node.start..end],
            pivoting: factor
                .pivoting
                .map(|p| (node.start, &p.order[node.start..end], &p.off_diagonal[node.start..end])),
        };
        (part, &mut head[node.start - stretch.first_row..], tail)
    }

    /// Brings the rows of the supernode into the order of its pivots, or back.
    fn permute<const W: usize>(&self, top: &mut [Row<W>], scratch: &mut Vec<Row<W>>, forward: bool) {
        let Some((start, order, _)) = self.pivoting else { return };
        if order.iter().enumerate().all(|(k, &row)| row as usize == start + k) {
            return;
        }
        scratch.clear();
        scratch.extend_from_slice(top);
        for (k, &row) in order.iter().enumerate() {
            let row = row as usize - start;
            if forward {
                top[k] = scratch[row];
            } else {
                top[row] = scratch[k];
            }
        }
    }

    /// `X ← D⁻¹ X` for the rows of the supernode.
    #[inline(always)]
    fn divide<const W: usize>(&self, top: &mut [Row<W>]) {
        if let Some((_, _, off_diagonal)) = self.pivoting {
            let mut k = 0;
            while k < self.columns {
                if off_diagonal[k] == 0.0 || k + 1 == self.columns {
                    top[k].iter_mut().for_each(|x| *x *= self.inverse[k]);
                    k += 1;
                } else {
                    for column in 0..W {
                        let (x, y) = (top[k][column], top[k + 1][column]);
                        top[k][column] = self.inverse[k] * x + off_diagonal[k] * y;
                        top[k + 1][column] = off_diagonal[k] * x + self.inverse[k + 1] * y;
                    }
                    k += 2;
                }
            }
        } else {
            for (row, d) in top.iter_mut().zip(self.inverse) {
                row.iter_mut().for_each(|x| *x *= d);
            }
        }
    }

    /// `X ← L⁻¹ X` as far as the columns of this supernode act.
    #[inline(always)]
    fn forward<S: Simd, const V: usize, const R: usize, const W: usize>(
        &self,
        simd: S,
        group: usize,
        top: &mut [Row<W>],
        tail: &mut [Row<W>],
    ) {
        let mut from = 0;
        while from < self.columns {
            let to = (from + BLOCK).min(self.columns);
            let (done, rest) = top[from..].split_at_mut(to - from);
            for row in 1..to - from {
                let (above, this) = done.split_at_mut(row);
                let acc = self.eliminate::<S, V, 1, W>(simd, group, from, from + row, above, [&this[0]]);
                store::<S, V, W>(&mut this[0], group, acc[0]);
            }
            let mut row = to;
            let (several, ones) = rest.as_chunks_mut::<R>();
            for several in several {
                let acc = self.eliminate::<S, V, R, W>(simd, group, from, row, done, several.each_ref());
                for k in 0..R {
                    store::<S, V, W>(&mut several[k], group, acc[k]);
                }
                row += R;
            }
            for one in ones {
                let acc = self.eliminate::<S, V, 1, W>(simd, group, from, row, done, [&*one]);
                store::<S, V, W>(one, group, acc[0]);
                row += 1;
            }
            let (several, ones) = self.below.as_chunks::<R>();
            for several in several {
                let at = several.map(|row| row as usize - self.end);
                let acc = self.eliminate::<S, V, R, W>(simd, group, from, row, done, at.map(|at| &tail[at]));
                for k in 0..R {
                    store::<S, V, W>(&mut tail[at[k]], group, acc[k]);
                }
                row += R;
            }
            for &one in ones {
                let at = one as usize - self.end;
                let acc = self.eliminate::<S, V, 1, W>(simd, group, from, row, done, [&tail[at]]);
                store::<S, V, W>(&mut tail[at], group, acc[0]);
                row += 1;
            }
            from = to;
        }
    }

    /// `targets − L[row.., from..] · done`, one result for each target.
    #[inline(always)]
    fn eliminate<S: Simd, const V: usize, const R: usize, const W: usize>(
        &self,
        simd: S,
        group: usize,
        from: usize,
        row: usize,
        done: &[Row<W>],
        targets: [&Row<W>; R],
    ) -> [[S::f64s; V]; R] {
        let mut acc = targets.map(|target| load::<S, V, W>(target, group));
        let columns = self.values[from * self.rows..].chunks_exact(self.rows);
        for (x, column) in done.iter().zip(columns) {
            let x = load::<S, V, W>(x, group);
            if let Some(factors) = column.get(row..row + R) {
                for k in 0..R {
                    let l = simd.splat_f64s(-factors[k].wide());
                    for v in 0..V {
                        acc[k][v] = simd.mul_add_f64s(l, x[v], acc[k][v]);
                    }
                }
            }
        }
        acc
    }

    /// `X ← L⁻ᵀ X` for the rows of this supernode.
    #[inline(always)]
    fn backward<S: Simd, const V: usize, const R: usize, const W: usize>(
        &self,
        simd: S,
        group: usize,
        top: &mut [Row<W>],
        tail: &[Row<W>],
    ) {
        let mut to = self.columns;
        while to > 0 {
            let from = to.saturating_sub(R);
            let (above, done) = top.split_at_mut(to);
            let block = &mut above[from..];
            if let Ok(several) = <&mut [Row<W>; R]>::try_from(&mut *block) {
                let acc = self.substitute::<S, V, R, W>(simd, group, from, done, tail, several.each_ref());
                for (row, acc) in several.iter_mut().zip(acc) {
                    store::<S, V, W>(row, group, acc);
                }
            } else {
                for (k, row) in block.iter_mut().enumerate() {
                    let acc = self.substitute_one::<S, V, W>(simd, group, from + k, to, done, tail, row);
                    store::<S, V, W>(row, group, acc);
                }
            }
            for k in (0..to - from).rev() {
                let (these, after) = block.split_at_mut(k + 1);
                let mut acc = load::<S, V, W>(&these[k], group);
                for (j, x) in after.iter().enumerate() {
                    let l = simd.splat_f64s(-self.values[(from + k) * self.rows + from + k + 1 + j].wide());
                    let x = load::<S, V, W>(x, group);
                    for v in 0..V {
                        acc[v] = simd.mul_add_f64s(l, x[v], acc[v]);
                    }
                }
                store::<S, V, W>(&mut these[k], group, acc);
            }
            to = from;
        }
    }

    /// `targets − L[.., from..from + R]ᵀ X` over the rows from `from + R` on.
    #[inline(always)]
    fn substitute<S: Simd, const V: usize, const R: usize, const W: usize>(
        &self,
        simd: S,
        group: usize,
        from: usize,
        done: &[Row<W>],
        tail: &[Row<W>],
        targets: [&Row<W>; R],
    ) -> [[S::f64s; V]; R] {
        let mut acc = targets.map(|target| load::<S, V, W>(target, group));
        let columns: [&[T]; R] = std::array::from_fn(|k| {
            let at = (from + k) * self.rows;
            &self.values[at + from + R..at + self.rows]
        });
        let (within, below): ([&[T]; R], [&[T]; R]) =
            (columns.map(|c| &c[..done.len()]), columns.map(|c| &c[done.len()..][..self.below.len()]));
        for (i, x) in done.iter().enumerate() {
            let x = load::<S, V, W>(x, group);
            for k in 0..R {
                let l = simd.splat_f64s(-within[k][i].wide());
                for v in 0..V {
                    acc[k][v] = simd.mul_add_f64s(l, x[v], acc[k][v]);
                }
            }
        }
        for (i, &row) in self.below.iter().enumerate() {
            let x = load::<S, V, W>(&tail[row as usize - self.end], group);
            for k in 0..R {
                let l = simd.splat_f64s(-below[k][i].wide());
                for v in 0..V {
                    acc[k][v] = simd.mul_add_f64s(l, x[v], acc[k][v]);
                }
            }
        }
        acc
    }

    /// The same for one column, over the rows from `to` on.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn substitute_one<S: Simd, const V: usize, const W: usize>(
        &self,
        simd: S,
        group: usize,
        column: usize,
        to: usize,
        done: &[Row<W>],
        tail: &[Row<W>],
        target: &Row<W>,
    ) -> [S::f64s; V] {
        let mut acc = load::<S, V, W>(target, group);
        let values = &self.values[column * self.rows + to..(column + 1) * self.rows];
        let below = self.below.iter().map(|&row| &tail[row as usize - self.end]);
        for (&l, x) in values.iter().zip(done.iter().chain(below)) {
            let (l, x) = (simd.splat_f64s(-l.wide()), load::<S, V, W>(x, group));
            for v in 0..V {
                acc[v] = simd.mul_add_f64s(l, x[v], acc[v]);
            }
        }
        acc
    }
}

#[inline(always)]
fn load<S: Simd, const V: usize, const W: usize>(row: &Row<W>, group: usize) -> [S::f64s; V] {
    let vectors = S::as_simd_f64s(row).0;
    std::array::from_fn(|v| vectors[group * V + v])
}

#[inline(always)]
fn store<S: Simd, const V: usize, const W: usize>(row: &mut Row<W>, group: usize, values: [S::f64s; V]) {
    let vectors = S::as_mut_simd_f64s(row).0;
    for v in 0..V {
        vectors[group * V + v] = values[v];
    }
}
