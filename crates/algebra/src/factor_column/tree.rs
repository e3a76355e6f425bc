//! One right-hand side on all threads. The elimination tree is cut where it forks into large subtrees: these have
//! nothing in common but rows above them, so that each is eliminated by itself, with a copy of these rows, and what
//! they share comes after.

use std::ops::Range;

use chladni_base::parallel::*;

use super::super::factor::{FactorNumbers, Node, SymbolicFactor};
use super::super::factor_solve::{Parts, Stretch};
use super::super::product::Scalar;
use super::{LANES, sweep};

/// A subtree that holds less than this share of all entries is not worth a task.
const SMALLEST_SHARE: usize = 64;

/// How a solve with factors of one structure is shared out among threads. The parts depend on the structure alone, and
/// so do the results.
#[derive(Debug)]
pub struct ColumnTree {
    root: Branch,
    /// The size of the matrix and the entries of the factor.
    shape: (usize, usize),
}

/// The supernodes of a subtree that are in no large subtree of it. Their rows come first, then those above that they
/// act on.
#[derive(Debug)]
struct Branch {
    children: Vec<Child>,
    stretches: Vec<Piece>,
    own: usize,
    above: usize,
    /// The patterns of the supernodes in that numbering.
    patterns: Vec<u32>,
    /// The most columns of a supernode or rows below them, in whole lanes.
    widest: usize,
}

/// A large subtree, and where the rows above it are in the branch that it hangs on.
#[derive(Debug)]
struct Child {
    branch: Branch,
    places: Vec<u32>,
}

/// Consecutive supernodes of a branch.
#[derive(Debug)]
struct Piece {
    nodes: Range<usize>,
    /// Their rows of the matrix.
    rows: Range<usize>,
    /// Their first row in the branch.
    at: usize,
    /// The first of their patterns in the branch.
    pattern: usize,
}

/// The rows of a branch while they are solved for.
struct Work {
    x: Vec<f64>,
    children: Vec<Work>,
}

impl ColumnTree {
    /// Shares out a structure.
    pub fn new(symbolic: &SymbolicFactor) -> Self {
        let nodes = &symbolic.nodes;
        let mut done: Vec<(Range<usize>, Branch)> = Vec::new();
        for tree in forks(symbolic) {
            let from = done.partition_point(|(range, _)| range.start < tree.start);
            let children = done.split_off(from);
            let top = nodes[tree.end - 1].pattern;
            let above = &symbolic.patterns[top.0..top.0 + top.1];
            done.push((tree.clone(), Branch::new(symbolic, tree, above, children)));
        }
        let root = Branch::new(symbolic, 0..nodes.len(), &[], done);
        Self { root, shape: (symbolic.size(), symbolic.entries()) }
    }

    /// `x ← (A − μB)⁻¹ x` with the numbers of a factor of the structure that was shared out.
    ///
    /// # Panics
    /// Where there are not as many numbers as the matrix has rows, or the structure or the factor is one of another
    /// size.
    pub fn solve<T: Scalar>(&self, symbolic: &SymbolicFactor, numbers: &FactorNumbers<T>, x: &mut [f64]) {
        assert_eq!(self.shape, (symbolic.size(), symbolic.entries()), "the structure that was shared out");
        assert_eq!(x.len(), symbolic.size(), "a number for each row of the matrix");
        let parts = Parts::of_numbers(symbolic, numbers);
        let mut work = self.root.forward(parts, x);
        self.root.backward(parts, &mut work);
        self.root.scatter(&work, x);
    }

    /// The first half of it, `x ← L⁻¹ x`: see [`crate::HalfSolved`].
    ///
    /// # Panics
    /// As for [`solve`](Self::solve).
    pub fn eliminate<T: Scalar>(&self, symbolic: &SymbolicFactor, numbers: &FactorNumbers<T>, x: &mut [f64]) {
        assert_eq!(self.shape, (symbolic.size(), symbolic.entries()), "the structure that was shared out");
        assert_eq!(x.len(), symbolic.size(), "a number for each row of the matrix");
        let work = self.root.forward(Parts::of_numbers(symbolic, numbers), x);
        self.root.scatter(&work, x);
    }

    /// The second half, `x ← L⁻ᵀ D⁻¹ x`.
    ///
    /// # Panics
    /// As for [`solve`](Self::solve).
    pub fn substitute<T: Scalar>(&self, symbolic: &SymbolicFactor, numbers: &FactorNumbers<T>, x: &mut [f64]) {
        assert_eq!(self.shape, (symbolic.size(), symbolic.entries()), "the structure that was shared out");
        assert_eq!(x.len(), symbolic.size(), "a number for each row of the matrix");
        let mut work = self.root.gather(x);
        self.root.backward(Parts::of_numbers(symbolic, numbers), &mut work);
        self.root.scatter(&work, x);
    }
}

/// The subtrees that are worth a task and have another such beside them, as ranges of supernodes, each after those
/// within it.
fn forks(symbolic: &SymbolicFactor) -> Vec<Range<usize>> {
    let SymbolicFactor { nodes, patterns, .. } = symbolic;
    let entries = |node: &Node| node.columns * (node.columns + node.pattern.1);
    let total: usize = nodes.iter().map(entries).sum();
    // The first node, the number of nodes and the entries of the subtree below each node.
    let mut below: Vec<(usize, usize, usize)> =
        nodes.iter().enumerate().map(|(at, node)| (at, 1, entries(node))).collect();
    let mut parent = vec![nodes.len(); nodes.len()];
    for (at, node) in nodes.iter().enumerate() {
        if node.pattern.1 > 0 {
            let row = patterns[node.pattern.0] as usize;
            let above = at + 1 + nodes[at + 1..].partition_point(|node| node.start + node.columns <= row);
            let (first, count, sum) = below[at];
            let into = &mut below[above];
            *into = (into.0.min(first), into.1 + count, into.2 + sum);
            parent[at] = above;
        }
    }
    let large = |&at: &usize| {
        let (first, count, sum) = below[at];
        at + 1 - first == count && SMALLEST_SHARE * sum >= total
    };
    let mut beside = vec![0; nodes.len() + 1];
    (0..nodes.len()).filter(large).for_each(|at| beside[parent[at]] += 1);
    (0..nodes.len()).filter(large).filter(|&at| beside[parent[at]] > 1).map(|at| below[at].0..at + 1).collect()
}

impl Branch {
    fn new(
        symbolic: &SymbolicFactor,
        tree: Range<usize>,
        above: &[u32],
        children: Vec<(Range<usize>, Branch)>,
    ) -> Self {
        let nodes = &symbolic.nodes;
        let (mut stretches, mut own, mut pattern): (Vec<Piece>, usize, usize) = (Vec::new(), 0, 0);
        let mut from = tree.start;
        for gap in children.iter().map(|(range, _)| range.clone()).chain(std::iter::once(tree.end..tree.end)) {
            if let (Some(first), Some(last)) = (nodes[from..gap.start].first(), nodes[from..gap.start].last()) {
                let rows = first.start..last.start + last.columns;
                let (at, length) = (own, rows.len());
                stretches.push(Piece { nodes: from..gap.start, rows, at, pattern });
                own += length;
                pattern += last.pattern.0 + last.pattern.1 - first.pattern.0;
            }
            from = gap.end;
        }
        let local = |row: u32| {
            let after = stretches.partition_point(|piece| piece.rows.start <= row as usize);
            if let Some(piece) = stretches[..after].last().filter(|piece| (row as usize) < piece.rows.end) {
                return (piece.at + row as usize - piece.rows.start) as u32;
            }
            let at = above.partition_point(|&other| other < row);
            assert_eq!(
                above.get(at),
                Some(&row),
                "a subtree acts on the rows above that its topmost supernode acts on"
            );
            (own + at) as u32
        };
        let all = |node: &Node| symbolic.patterns[node.pattern.0..node.pattern.0 + node.pattern.1].iter().copied();
        let own_nodes = || stretches.iter().flat_map(|piece| &nodes[piece.nodes.clone()]);
        let patterns = own_nodes().flat_map(all).map(local).collect();
        let widest = own_nodes().map(|node| node.pattern.1.max(node.columns)).max().unwrap_or(0);
        let widest = widest.next_multiple_of(LANES);
        let child = |(range, branch): (Range<usize>, Self)| Child {
            places: all(&nodes[range.end - 1]).map(local).collect(),
            branch,
        };
        let children = children.into_iter().map(child).collect();
        Self { children, own, above: above.len(), patterns, widest, stretches }
    }

    /// Elimination.
    fn forward<T: Scalar>(&self, factor: Parts<'_, T>, right: &[f64]) -> Work {
        let children: Vec<Work> = self.children.par_iter().map(|child| child.branch.forward(factor, right)).collect();
        let mut x = vec![0.0; self.own + self.above];
        for piece in &self.stretches {
            x[piece.at..piece.at + piece.rows.len()].copy_from_slice(&right[piece.rows.clone()]);
        }
        for (child, work) in self.children.iter().zip(&children) {
            for (&row, part) in child.places.iter().zip(&work.x[child.branch.own..]) {
                x[row as usize] += part;
            }
        }
        self.sweep(factor, true, &mut x);
        Work { x, children }
    }

    /// Substitution, where the rows above have their values.
    fn backward<T: Scalar>(&self, factor: Parts<'_, T>, work: &mut Work) {
        self.sweep(factor, false, &mut work.x);
        let Work { x, children } = work;
        self.children.par_iter().zip(children).for_each(|(child, work)| {
            for (&row, part) in child.places.iter().zip(&mut work.x[child.branch.own..]) {
                *part = x[row as usize];
            }
            child.branch.backward(factor, work);
        });
    }

    fn sweep<T: Scalar>(&self, factor: Parts<'_, T>, forward: bool, x: &mut [f64]) {
        let mut scratch = vec![0.0; self.widest];
        let stretch = |piece: &Piece| {
            let nodes = &factor.symbolic.nodes[piece.nodes.clone()];
            Stretch {
                nodes,
                first_row: piece.rows.start - piece.at,
                patterns: &self.patterns,
                first_pattern: nodes[0].pattern.0 - piece.pattern,
            }
        };
        if forward {
            self.stretches.iter().for_each(|piece| sweep(factor, stretch(piece), true, x, &mut scratch));
        } else {
            self.stretches.iter().rev().for_each(|piece| sweep(factor, stretch(piece), false, x, &mut scratch));
        }
    }

    /// The rows of the branch from those of the matrix.
    fn gather(&self, from: &[f64]) -> Work {
        let children = self.children.par_iter().map(|child| child.branch.gather(from)).collect();
        let mut x = vec![0.0; self.own + self.above];
        for piece in &self.stretches {
            x[piece.at..piece.at + piece.rows.len()].copy_from_slice(&from[piece.rows.clone()]);
        }
        Work { x, children }
    }

    /// Copies the solution to its rows of the matrix.
    fn scatter(&self, work: &Work, x: &mut [f64]) {
        for piece in &self.stretches {
            x[piece.rows.clone()].copy_from_slice(&work.x[piece.at..piece.at + piece.rows.len()]);
        }
        self.children.iter().zip(&work.children).for_each(|(child, work)| child.branch.scatter(work, x));
    }
}

#[cfg(test)]
mod tests {
    use chladni_base::SplitMix64;

    use super::super::super::factor::tests::grid;
    use super::super::super::{MassMatrix, Ordering, PANEL_WIDTH, SparseMatrix, fill_reducing_order};
    use super::*;

    /// Two grids with nothing between them, in an order.
    fn grids(sides: [usize; 2], ordering: Ordering) -> SparseMatrix {
        let parts = sides.map(|side| grid(side, side));
        let rows = parts.iter().map(SparseMatrix::rows).sum();
        let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for (part, first) in parts.iter().zip([0, parts[0].rows() as u32]) {
            for row in 0..part.rows() {
                columns.extend(part.row(row).0.iter().map(|column| column + first));
                values.extend_from_slice(part.row(row).1);
                offsets.push(columns.len());
            }
        }
        let matrix = SparseMatrix::from_sorted_parts(rows, rows, offsets, columns, values);
        matrix.reordered(&fill_reducing_order(&matrix, ordering).unwrap())
    }

    fn count(branch: &Branch) -> (usize, usize) {
        let nodes = branch.stretches.iter().map(|piece| piece.nodes.len()).sum();
        let below = branch.children.iter().map(|child| count(&child.branch));
        below.fold((1, nodes), |(branches, nodes), (more, held)| (branches + more, nodes + held))
    }

    #[test]
    fn a_column_on_branches_is_that_of_a_panel_whatever_the_number_of_threads() {
        let mut exchanged = 0;
        for (sides, ordering, least) in [
            ([1, 1], Ordering::Amd, 1),
            ([2, 5], Ordering::Amd, 1),
            ([60, 1], Ordering::NestedDissection, 8),
            ([60, 50], Ordering::NestedDissection, 8),
            ([60, 50], Ordering::Amd, 8),
        ] {
            let matrix = grids(sides, ordering);
            let n = matrix.rows();
            let mass = MassMatrix::Diagonal(vec![1.0; n]);
            let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
            let tree = ColumnTree::new(&symbolic);
            let (branches, nodes) = count(&tree.root);
            assert!(
                branches >= least && nodes == symbolic.nodes.len(),
                "{sides:?}: {branches} branches, {nodes} nodes"
            );
            // An indefinite shift, and one next to the diagonal, so that rows are exchanged; it lies next to an
            // eigenvalue, too.
            for (shift, tolerance) in [(0.37, 1e-11), (4.0 + 1e-7, 1e-6)] {
                let factor = symbolic.factor(&matrix, &mass, shift).unwrap();
                exchanged += usize::from(factor.is_pivoted());
                let mut random = SplitMix64::new(7);
                let all: Vec<f64> = (0..n).map(|_| random.signed_unit()).collect();
                let mut one = vec![0.0; n];
                one[n / 3] = 1.0;
                for right in [all, one] {
                    let mut panel: Vec<f64> = right.iter().flat_map(|&x| [x; PANEL_WIDTH]).collect();
                    factor.solve_panel(&mut panel);
                    let solved = |threads| {
                        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                        let mut x = right.clone();
                        pool.install(|| tree.solve(&symbolic, &factor.numbers(), &mut x));
                        x
                    };
                    let x = solved(1);
                    assert_eq!(x, solved(3));
                    let largest = panel.iter().fold(0f64, |most, x| most.max(x.abs()));
                    for (x, panel) in x.iter().zip(panel.iter().step_by(PANEL_WIDTH)) {
                        assert!((x - panel).abs() <= tolerance * largest, "{sides:?} {shift}: {x} and {panel}");
                    }
                }
            }
        }
        assert!(exchanged > 0, "factors whose rows were exchanged are among them");
    }
}
