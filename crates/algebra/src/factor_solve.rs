//! Solving with a sparse factor for 32 right-hand sides at once: rows of a panel are contiguous, so every entry of `L` meets whole
//! vector registers. Three to six times faster than solving column after column where it was measured.

use pulp::Simd;

use super::factor::{Factor, FactorNumbers, Node, Pivoting, SymbolicFactor};
use super::product::Scalar;
use super::{PANEL_WIDTH, panels::PanelRow};

/// Columns of a supernode that are eliminated together: their rows of the panel stay in the first-level cache.
const BLOCK: usize = 16;

impl Factor<'_> {
    /// `X ← (A − μB)⁻¹ X` for a panel of 32 columns, row after row.
    ///
    /// # Panics
    /// Where the panel has another number of rows than the matrix.
    pub fn solve_panel(&self, panel: &mut [f64]) {
        let Self { symbolic, values, inverse, pivoting, .. } = self;
        Parts { symbolic, values, inverse, pivoting: pivoting.as_ref() }.solve(panel);
    }
}

impl SymbolicFactor {
    /// The same with the numbers of a factor of this structure.
    ///
    /// # Panics
    /// Where the panel has another number of rows than the matrix, or the numbers came from another structure.
    pub fn solve_panel<T: Scalar>(&self, numbers: &FactorNumbers<T>, panel: &mut [f64]) {
        let FactorNumbers { values, inverse, pivoting, .. } = numbers;
        let found = (values.len(), inverse.len());
        assert_eq!(found, (self.entries(), self.size()), "numbers of a factor of this structure");
        Parts { symbolic: self, values, inverse, pivoting: pivoting.as_ref() }.solve(panel);
    }
}

/// What solving needs of a factor.
#[derive(Clone, Copy)]
struct Parts<'a, T> {
    symbolic: &'a SymbolicFactor,
    values: &'a [T],
    inverse: &'a [f64],
    pivoting: Option<&'a Pivoting>,
}

impl<T: Scalar> Parts<'_, T> {
    fn solve(self, panel: &mut [f64]) {
        assert_eq!(panel.len(), self.symbolic.size() * PANEL_WIDTH, "a row of the panel for each of the matrix");
        let (rows, _) = panel.as_chunks_mut::<PANEL_WIDTH>();
        pulp::Arch::new().dispatch(Solve { factor: self, x: rows });
    }
}

struct Solve<'a, T> {
    factor: Parts<'a, T>,
    x: &'a mut [PanelRow],
}

impl<T: Scalar> pulp::WithSimd for Solve<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many vectors as leave room in the registers: four rows of accumulators, one row of operands, one factor.
        match (S::F64_LANES, S::REGISTER_COUNT) {
            (8, 32) => solve::<T, S, 4, 1>(simd, self.factor, self.x),
            (8, _) => solve::<T, S, 2, 2>(simd, self.factor, self.x),
            (4, _) => solve::<T, S, 2, 4>(simd, self.factor, self.x),
            (2, _) => solve::<T, S, 4, 4>(simd, self.factor, self.x),
            _ => solve::<T, S, 4, 8>(simd, self.factor, self.x),
        }
    }
}

/// `VECTORS` vectors are handled at once, in `GROUPS` groups that make up a row.
#[inline(always)]
fn solve<T: Scalar, S: Simd, const VECTORS: usize, const GROUPS: usize>(
    simd: S,
    factor: Parts<'_, T>,
    x: &mut [PanelRow],
) {
    let symbolic = factor.symbolic;
    let mut scratch: Vec<PanelRow> = Vec::new();
    for node in &symbolic.nodes {
        let part = NodePart::new(factor, node);
        let (head, tail) = x.split_at_mut(node.start + node.columns);
        let top = &mut head[node.start..];
        part.permute(top, &mut scratch, true);
        for group in 0..GROUPS {
            part.forward::<S, VECTORS>(simd, group, top, tail);
        }
    }
    for node in symbolic.nodes.iter().rev() {
        let part = NodePart::new(factor, node);
        let (head, tail) = x.split_at_mut(node.start + node.columns);
        let top = &mut head[node.start..];
        part.divide(top);
        for group in 0..GROUPS {
            part.backward::<S, VECTORS>(simd, group, top, tail);
        }
        part.permute(top, &mut scratch, false);
    }
}

/// One supernode of a factor.
struct NodePart<'a, T> {
    /// Where the rows below its columns begin.
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
    #[inline(always)]
    fn new(factor: Parts<'a, T>, node: &Node) -> Self {
        let (columns, end) = (node.columns, node.start + node.columns);
        let rows = columns + node.pattern.1;
        Self {
            end,
            columns,
            rows,
            values: &factor.values[node.values..node.values + rows * columns],
            below: &factor.symbolic.patterns[node.pattern.0..node.pattern.0 + node.pattern.1],
            inverse: &factor.inverse[node.start..end],
            pivoting: factor
                .pivoting
                .map(|p| (node.start, &p.order[node.start..end], &p.off_diagonal[node.start..end])),
        }
    }

    /// Brings the rows of the supernode into the order of its pivots, or back.
    fn permute(&self, top: &mut [PanelRow], scratch: &mut Vec<PanelRow>, forward: bool) {
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
    fn divide(&self, top: &mut [PanelRow]) {
        if let Some((_, _, off_diagonal)) = self.pivoting {
            let mut k = 0;
            while k < self.columns {
                if off_diagonal[k] == 0.0 || k + 1 == self.columns {
                    top[k].iter_mut().for_each(|x| *x *= self.inverse[k]);
                    k += 1;
                } else {
                    for column in 0..PANEL_WIDTH {
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
    fn forward<S: Simd, const V: usize>(&self, simd: S, group: usize, top: &mut [PanelRow], tail: &mut [PanelRow]) {
        let mut from = 0;
        while from < self.columns {
            let to = (from + BLOCK).min(self.columns);
            let (done, rest) = top[from..].split_at_mut(to - from);
            for row in 1..to - from {
                let (above, this) = done.split_at_mut(row);
                let acc = self.eliminate::<S, V, 1>(simd, group, from, from + row, above, [&this[0]]);
                store::<S, V>(&mut this[0], group, acc[0]);
            }
            let mut row = to;
            let (fours, ones) = rest.as_chunks_mut::<4>();
            for four in fours {
                let acc =
                    self.eliminate::<S, V, 4>(simd, group, from, row, done, [&four[0], &four[1], &four[2], &four[3]]);
                for k in 0..4 {
                    store::<S, V>(&mut four[k], group, acc[k]);
                }
                row += 4;
            }
            for one in ones {
                let acc = self.eliminate::<S, V, 1>(simd, group, from, row, done, [&*one]);
                store::<S, V>(one, group, acc[0]);
                row += 1;
            }
            let (fours, ones) = self.below.as_chunks::<4>();
            for four in fours {
                let at = four.map(|row| row as usize - self.end);
                let acc = self.eliminate::<S, V, 4>(simd, group, from, row, done, at.map(|at| &tail[at]));
                for k in 0..4 {
                    store::<S, V>(&mut tail[at[k]], group, acc[k]);
                }
                row += 4;
            }
            for &one in ones {
                let at = one as usize - self.end;
                let acc = self.eliminate::<S, V, 1>(simd, group, from, row, done, [&tail[at]]);
                store::<S, V>(&mut tail[at], group, acc[0]);
                row += 1;
            }
            from = to;
        }
    }

    /// `targets − L[row.., from..] · done`, one result for each target.
    #[inline(always)]
    fn eliminate<S: Simd, const V: usize, const R: usize>(
        &self,
        simd: S,
        group: usize,
        from: usize,
        row: usize,
        done: &[PanelRow],
        targets: [&PanelRow; R],
    ) -> [[S::f64s; V]; R] {
        let mut acc = targets.map(|target| load::<S, V>(target, group));
        let columns = self.values[from * self.rows..].chunks_exact(self.rows);
        for (x, column) in done.iter().zip(columns) {
            let x = load::<S, V>(x, group);
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
    fn backward<S: Simd, const V: usize>(&self, simd: S, group: usize, top: &mut [PanelRow], tail: &[PanelRow]) {
        let mut to = self.columns;
        while to > 0 {
            let from = to.saturating_sub(4);
            let (above, done) = top.split_at_mut(to);
            let block = &mut above[from..];
            if let [a, b, c, d] = block {
                let acc = self.substitute::<S, V, 4>(simd, group, from, done, tail, [&*a, &*b, &*c, &*d]);
                for (row, acc) in [a, b, c, d].into_iter().zip(acc) {
                    store::<S, V>(row, group, acc);
                }
            } else {
                for (k, row) in block.iter_mut().enumerate() {
                    let acc = self.substitute_one::<S, V>(simd, group, from + k, to, done, tail, row);
                    store::<S, V>(row, group, acc);
                }
            }
            for k in (0..to - from).rev() {
                let (these, after) = block.split_at_mut(k + 1);
                let mut acc = load::<S, V>(&these[k], group);
                for (j, x) in after.iter().enumerate() {
                    let l = simd.splat_f64s(-self.values[(from + k) * self.rows + from + k + 1 + j].wide());
                    let x = load::<S, V>(x, group);
                    for v in 0..V {
                        acc[v] = simd.mul_add_f64s(l, x[v], acc[v]);
                    }
                }
                store::<S, V>(&mut these[k], group, acc);
            }
            to = from;
        }
    }

    /// `targets − L[.., from..from + R]ᵀ X` over the rows from `from + R` on.
    #[inline(always)]
    fn substitute<S: Simd, const V: usize, const R: usize>(
        &self,
        simd: S,
        group: usize,
        from: usize,
        done: &[PanelRow],
        tail: &[PanelRow],
        targets: [&PanelRow; R],
    ) -> [[S::f64s; V]; R] {
        let mut acc = targets.map(|target| load::<S, V>(target, group));
        let columns: [&[T]; R] = std::array::from_fn(|k| {
            let at = (from + k) * self.rows;
            &self.values[at + from + R..at + self.rows]
        });
        let (within, below): ([&[T]; R], [&[T]; R]) =
            (columns.map(|c| &c[..done.len()]), columns.map(|c| &c[done.len()..][..self.below.len()]));
        for (i, x) in done.iter().enumerate() {
            let x = load::<S, V>(x, group);
            for k in 0..R {
                let l = simd.splat_f64s(-within[k][i].wide());
                for v in 0..V {
                    acc[k][v] = simd.mul_add_f64s(l, x[v], acc[k][v]);
                }
            }
        }
        for (i, &row) in self.below.iter().enumerate() {
            let x = load::<S, V>(&tail[row as usize - self.end], group);
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
    fn substitute_one<S: Simd, const V: usize>(
        &self,
        simd: S,
        group: usize,
        column: usize,
        to: usize,
        done: &[PanelRow],
        tail: &[PanelRow],
        target: &PanelRow,
    ) -> [S::f64s; V] {
        let mut acc = load::<S, V>(target, group);
        let values = &self.values[column * self.rows + to..(column + 1) * self.rows];
        let below = self.below.iter().map(|&row| &tail[row as usize - self.end]);
        for (&l, x) in values.iter().zip(done.iter().chain(below)) {
            let (l, x) = (simd.splat_f64s(-l.wide()), load::<S, V>(x, group));
            for v in 0..V {
                acc[v] = simd.mul_add_f64s(l, x[v], acc[v]);
            }
        }
        acc
    }
}

#[inline(always)]
fn load<S: Simd, const V: usize>(row: &PanelRow, group: usize) -> [S::f64s; V] {
    let vectors = S::as_simd_f64s(row).0;
    std::array::from_fn(|v| vectors[group * V + v])
}

#[inline(always)]
fn store<S: Simd, const V: usize>(row: &mut PanelRow, group: usize, values: [S::f64s; V]) {
    let vectors = S::as_mut_simd_f64s(row).0;
    for v in 0..V {
        vectors[group * V + v] = values[v];
    }
}
