//! Solving for eight right-hand sides on all threads. Subtrees of the elimination tree have nothing in common but rows
//! above them: each is eliminated by itself, with a copy of these rows, and what they share comes after.

use chladni_base::parallel::*;

use super::super::KRYLOV_WIDTH;
use super::super::factor::{Factor, Node, SymbolicFactor};
use super::{Parts, Row, Stretch, Sweep};

/// A subtree holds this share of all entries at most, so that there are some to share out among the threads.
const LARGEST_SHARE: usize = 8;

/// One that holds less than this share is not worth a task.
const SMALLEST_SHARE: usize = 512;

/// How the elimination tree of a structure is shared out among threads. The parts depend on the structure alone, and so
/// do the results.
pub struct SolveTree<'a> {
    symbolic: &'a SymbolicFactor,
    subtrees: Vec<Subtree<'a>>,
    /// The other supernodes, in stretches.
    rest: Vec<&'a [Node]>,
}

/// Rows that a solve works on, for the next one.
#[derive(Debug, Default)]
pub struct SolveScratch(Vec<Vec<Row<KRYLOV_WIDTH>>>);

/// Supernodes that form a subtree.
struct Subtree<'a> {
    nodes: &'a [Node],
    /// Their first row and the one after their last.
    rows: std::ops::Range<usize>,
    /// The rows above that they act on, ascending.
    above: &'a [u32],
    /// The patterns of the supernodes with the rows above right behind their own.
    patterns: Vec<u32>,
}

impl<'a> SolveTree<'a> {
    /// Shares out a structure.
    pub fn new(symbolic: &'a SymbolicFactor) -> Self {
        let SymbolicFactor { nodes, patterns, .. } = symbolic;
        let end = |node: &Node| node.start + node.columns;
        let entries = |node: &Node| node.columns * (node.columns + node.pattern.1);
        let total: usize = nodes.iter().map(entries).sum();
        // The first node, the number of nodes and the entries of the subtree below each node.
        let mut below: Vec<(usize, usize, usize)> =
            nodes.iter().enumerate().map(|(at, node)| (at, 1, entries(node))).collect();
        let mut parent = vec![usize::MAX; nodes.len()];
        for (at, node) in nodes.iter().enumerate() {
            if node.pattern.1 > 0 {
                let row = patterns[node.pattern.0] as usize;
                let above = at + 1 + nodes[at + 1..].partition_point(|node| end(node) <= row);
                let (first, count, sum) = below[at];
                let into = &mut below[above];
                *into = (into.0.min(first), into.1 + count, into.2 + sum);
                parent[at] = above;
            }
        }
        let fits = |at: usize| {
            let (first, count, sum) = below[at];
            at + 1 - first == count && LARGEST_SHARE * sum <= total
        };
        // Whether a node lies inside a subtree, which in an order that is no postorder may be that of an ancestor
        // farther up.
        let mut inside = vec![false; nodes.len()];
        for at in (0..nodes.len()).rev().filter(|&at| parent[at] != usize::MAX) {
            inside[at] = inside[parent[at]] || fits(parent[at]);
        }
        let mut subtrees: Vec<Subtree<'a>> = Vec::new();
        for at in (0..nodes.len()).filter(|&at| fits(at)) {
            if !inside[at] && SMALLEST_SHARE * below[at].2 >= total {
                subtrees.push(Subtree::new(&nodes[below[at].0..=at], patterns));
            }
        }
        let (mut rest, mut from) = (Vec::new(), 0);
        for subtree in &subtrees {
            let to = nodes.partition_point(|node| node.start < subtree.rows.start);
            rest.push(&nodes[from..to]);
            from = to + subtree.nodes.len();
        }
        rest.push(&nodes[from..]);
        rest.retain(|nodes| !nodes.is_empty());
        Self { symbolic, subtrees, rest }
    }

    /// `X ← (A − μB)⁻¹ X` for eight columns, row after row, with a factor of the structure. The memory of `scratch` is
    /// used again by the next solve.
    ///
    /// # Panics
    /// Where there are not as many rows as those of the matrix, or the factor is of another structure.
    pub fn solve(&self, factor: &Factor<'_>, x: &mut [Row<KRYLOV_WIDTH>], scratch: &mut SolveScratch) {
        assert!(std::ptr::eq(factor.symbolic, self.symbolic), "a factor of the structure that was shared out");
        assert_eq!(x.len(), self.symbolic.size(), "a row for each of the matrix");
        let parts = Parts::of(factor);
        let SolveScratch(rows) = scratch;
        rows.resize_with(self.subtrees.len(), Vec::new);
        let above = &*x;
        self.subtrees.par_iter().zip(&mut *rows).for_each(|(subtree, rows)| {
            rows.resize(subtree.rows.len() + subtree.above.len(), [0.0; KRYLOV_WIDTH]);
            let (own, shared) = rows.split_at_mut(subtree.rows.len());
            own.copy_from_slice(&above[subtree.rows.clone()]);
            shared.fill([0.0; KRYLOV_WIDTH]);
            subtree.sweep(parts, true, rows);
        });
        for (subtree, rows) in self.subtrees.iter().zip(&*rows) {
            for (&row, part) in subtree.above.iter().zip(&rows[subtree.rows.len()..]) {
                x[row as usize].iter_mut().zip(part).for_each(|(x, part)| *x += part);
            }
        }
        self.sweep(parts, true, x);
        self.sweep(parts, false, x);
        let above = &*x;
        self.subtrees.par_iter().zip(&mut *rows).for_each(|(subtree, rows)| {
            for (&row, part) in subtree.above.iter().zip(&mut rows[subtree.rows.len()..]) {
                *part = above[row as usize];
            }
            subtree.sweep(parts, false, rows);
        });
        for (subtree, rows) in self.subtrees.iter().zip(&*rows) {
            x[subtree.rows.clone()].copy_from_slice(&rows[..subtree.rows.len()]);
        }
    }

    /// What is in no subtree.
    fn sweep(&self, factor: Parts<'_, f64>, forward: bool, x: &mut [Row<KRYLOV_WIDTH>]) {
        let sweep = |nodes: &[Node], x: &mut [Row<KRYLOV_WIDTH>]| {
            let stretch = Stretch { nodes, first_row: 0, patterns: &self.symbolic.patterns, first_pattern: 0 };
            pulp::Arch::new().dispatch(Sweep { factor, stretch, forward, x });
        };
        if forward {
            self.rest.iter().for_each(|nodes| sweep(nodes, x));
        } else {
            self.rest.iter().rev().for_each(|nodes| sweep(nodes, x));
        }
    }
}

impl<'a> Subtree<'a> {
    fn new(nodes: &'a [Node], patterns: &'a [u32]) -> Self {
        let (first, last) = (&nodes[0], &nodes[nodes.len() - 1]);
        let rows = first.start..last.start + last.columns;
        let above = &patterns[last.pattern.0..last.pattern.0 + last.pattern.1];
        let local = |&row: &u32| {
            if (row as usize) < rows.end {
                return row - rows.start as u32;
            }
            let at = above.partition_point(|&other| other < row);
            assert_eq!(
                above.get(at),
                Some(&row),
                "a subtree acts on the rows above that its topmost supernode acts on"
            );
            (rows.len() + at) as u32
        };
        let patterns = patterns[first.pattern.0..last.pattern.0 + last.pattern.1].iter().map(local).collect();
        Self { nodes, rows, above, patterns }
    }

    fn sweep(&self, factor: Parts<'_, f64>, forward: bool, x: &mut [Row<KRYLOV_WIDTH>]) {
        let Self { nodes, rows, patterns, .. } = self;
        let stretch = Stretch { nodes, first_row: rows.start, patterns, first_pattern: nodes[0].pattern.0 };
        pulp::Arch::new().dispatch(Sweep { factor, stretch, forward, x });
    }
}

#[cfg(test)]
mod tests {
    use chladni_base::SplitMix64;

    use super::super::super::{MassMatrix, Ordering, SparseMatrix, fill_reducing_order};
    use super::*;

    /// The five-point Laplacian of a grid, in an order.
    fn grid(side: usize, ordering: Option<Ordering>) -> SparseMatrix {
        let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for at in 0..side * side {
            let (i, j) = (at / side, at % side);
            let mut entry = |there: bool, column: usize, value: f64| {
                if there {
                    columns.push(column as u32);
                    values.push(value);
                }
            };
            entry(i > 0, at.wrapping_sub(side), -1.0);
            entry(j > 0, at.wrapping_sub(1), -1.0);
            entry(true, at, 4.0);
            entry(j + 1 < side, at + 1, -1.0);
            entry(i + 1 < side, at + side, -1.0);
            offsets.push(columns.len());
        }
        let matrix = SparseMatrix::from_sorted_parts(side * side, side * side, offsets, columns, values);
        match ordering {
            Some(ordering) => matrix.reordered(&fill_reducing_order(&matrix, ordering).unwrap()),
            None => matrix,
        }
    }

    #[test]
    fn eight_columns_on_subtrees_are_those_of_a_panel() {
        let mut exchanged = 0;
        for (side, ordering) in [
            (1, None),
            (2, Some(Ordering::Amd)),
            (20, None),
            (60, Some(Ordering::Amd)),
            (60, Some(Ordering::NestedDissection)),
        ] {
            let matrix = grid(side, ordering);
            let n = matrix.rows();
            let mass = MassMatrix::Diagonal(vec![1.0; n]);
            let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
            let tree = SolveTree::new(&symbolic);
            assert!(side < 60 || tree.subtrees.len() > 4, "{} subtrees", tree.subtrees.len());
            let held: usize = tree.rest.iter().map(|nodes| nodes.len()).sum();
            let in_subtrees: usize = tree.subtrees.iter().map(|subtree| subtree.nodes.len()).sum();
            assert_eq!(held + in_subtrees, symbolic.nodes.len(), "each supernode once");
            // An indefinite shift, and one next to the diagonal, so that rows are exchanged; it lies next to an
            // eigenvalue, too.
            for (shift, tolerance) in [(0.37, 1e-11), (4.0 + 1e-7, 1e-6)] {
                let factor = symbolic.factor(&matrix, &mass, shift).unwrap();
                exchanged += usize::from(factor.is_pivoted());
                let mut random = SplitMix64::new(7);
                let mut block: Vec<Row<KRYLOV_WIDTH>> =
                    (0..n).map(|_| std::array::from_fn(|_| random.signed_unit())).collect();
                let mut panel: Vec<f64> =
                    block.iter().flat_map(|row| (0..32).map(|k| row.get(k).copied().unwrap_or(0.0))).collect();
                factor.solve_panel(&mut panel);
                tree.solve(&factor, &mut block, &mut SolveScratch::default());
                let largest = panel.iter().fold(0f64, |most, x| most.max(x.abs()));
                for (row, panel) in block.iter().zip(panel.chunks_exact(32)) {
                    for k in 0..KRYLOV_WIDTH {
                        assert!((row[k] - panel[k]).abs() <= tolerance * largest, "{} and {}", row[k], panel[k]);
                    }
                }
            }
        }
        assert!(exchanged > 0, "factors whose rows were exchanged are among them");
    }
}
