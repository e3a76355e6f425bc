//! Right-hand sides of a few entries. Elimination reaches the supernodes above their rows in the elimination tree and
//! no others, of a surface a small share of all; and inner products of solutions take no substitution:
//! `aᵀ K⁻¹ b = (L⁻¹ a)ᵀ D⁻¹ (L⁻¹ b)`.

use std::sync::{Mutex, PoisonError};

use chladni_base::parallel::*;
use pulp::Simd;

use super::super::KRYLOV_WIDTH;
use super::super::factor::{FactorNumbers, SymbolicFactor};
use super::super::product::Scalar;
use super::{NodePart, Parts, Row, Stretch};

/// No supernode lies above.
const ROOT: u32 = u32::MAX;

/// The elimination tree of the supernodes of a structure.
#[derive(Debug)]
pub struct ReachTree {
    parents: Vec<u32>,
    /// Rows that are zero between solves, one for each thread that was at work.
    spare: Mutex<Vec<Vec<Row<KRYLOV_WIDTH>>>>,
}

/// Right-hand sides that belong together: `width` of them, at most eight, and their entries as row, column and value.
#[derive(Debug, Clone, Default)]
pub struct Sides {
    /// How many.
    pub width: usize,
    /// The entries, in any order.
    pub entries: Vec<(u32, u32, f64)>,
}

/// `L⁻¹ C` of some right-hand sides at the rows that they reach: half of a solve.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HalfSolved {
    width: usize,
    /// Ascending.
    rows: Vec<u32>,
    /// `L⁻¹ C`, row after row.
    values: Vec<f64>,
    /// `D⁻¹ L⁻¹ C`.
    divided: Vec<f64>,
}

impl ReachTree {
    /// Of a structure.
    pub fn new(symbolic: &SymbolicFactor) -> Self {
        let nodes = &symbolic.nodes;
        let parent = |(at, node): (usize, &super::Node)| match node.pattern.1 {
            0 => ROOT,
            _ => {
                let row = symbolic.patterns[node.pattern.0] as usize;
                (at + 1 + nodes[at + 1..].partition_point(|node| node.start + node.columns <= row)) as u32
            }
        };
        Self { parents: nodes.iter().enumerate().map(parent).collect(), spare: Mutex::default() }
    }

    /// The supernodes that some rows reach, ascending.
    fn reached(&self, symbolic: &SymbolicFactor, rows: impl Iterator<Item = u32>) -> Vec<u32> {
        let mut found: Vec<u32> = Vec::new();
        let mut begun: Vec<u32> = rows
            .map(|row| symbolic.nodes.partition_point(|node| node.start + node.columns <= row as usize) as u32)
            .collect();
        begun.sort_unstable();
        begun.dedup();
        for mut node in begun {
            // What lies above a supernode that was met is there already, all of it.
            let before = found.len();
            while node != ROOT && found[..before].binary_search(&node).is_err() {
                found.push(node);
                node = self.parents[node as usize];
            }
            found.sort_unstable();
        }
        found
    }

    /// Half of the solves for each of `sides`, on all threads. Rows are those of the matrix in its order; in a factor
    /// with pivots those of each supernode are in their order.
    ///
    /// # Panics
    /// Where the numbers came from another structure, a row is not there, or sides are wider than eight.
    pub fn eliminate<T: Scalar>(
        &self,
        symbolic: &SymbolicFactor,
        numbers: &FactorNumbers<T>,
        sides: &[Sides],
    ) -> Vec<HalfSolved> {
        let parts = Parts::of_numbers(symbolic, numbers);
        let mut panels: Vec<&[Sides]> = Vec::new();
        let mut from = 0;
        while from < sides.len() {
            let mut width = 0;
            let fits = |side: &&Sides| {
                width += side.width;
                width <= KRYLOV_WIDTH
            };
            let count = sides[from..].iter().take_while(fits).count();
            assert!(count > 0, "eight right-hand sides at most belong together");
            panels.push(&sides[from..from + count]);
            from += count;
        }
        panels.into_par_iter().flat_map_iter(|sides| self.panel(symbolic, parts, sides)).collect()
    }

    fn panel<T: Scalar>(&self, symbolic: &SymbolicFactor, parts: Parts<'_, T>, sides: &[Sides]) -> Vec<HalfSolved> {
        let spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut x = spare.unwrap_or_else(|| vec![[0.0; KRYLOV_WIDTH]; symbolic.size()]);
        let rows = |side: &Sides| side.entries.iter().map(|entry| entry.0).collect::<Vec<_>>();
        let nodes = self.reached(symbolic, sides.iter().flat_map(rows));
        let mut first = 0;
        for side in sides {
            for &(row, column, value) in &side.entries {
                x[row as usize][first + column as usize] += value;
            }
            first += side.width;
        }
        pulp::Arch::new().dispatch(Climb { parts, nodes: &nodes, x: &mut x });
        let all = |nodes: &[u32]| -> Vec<u32> {
            let rows = |&node: &u32| {
                let node = &symbolic.nodes[node as usize];
                node.start as u32..(node.start + node.columns) as u32
            };
            nodes.iter().flat_map(rows).collect()
        };
        // The halves first, then what the pivots make of them.
        let mut first = 0;
        let mut found: Vec<HalfSolved> = Vec::with_capacity(sides.len());
        for side in sides {
            let rows = all(&self.reached(symbolic, rows(side).into_iter()));
            let values = rows.iter().flat_map(|&row| x[row as usize][first..first + side.width].to_vec()).collect();
            found.push(HalfSolved { width: side.width, rows, values, divided: Vec::new() });
            first += side.width;
        }
        let stretch = Stretch { nodes: &symbolic.nodes, first_row: 0, patterns: &symbolic.patterns, first_pattern: 0 };
        for &node in &nodes {
            let (part, top, _) = NodePart::new(parts, &stretch, &symbolic.nodes[node as usize], &mut x);
            part.divide(top);
        }
        let mut first = 0;
        for half in &mut found {
            let own = |&row: &u32| x[row as usize][first..first + half.width].to_vec();
            half.divided = half.rows.iter().flat_map(own).collect();
            first += half.width;
        }
        all(&nodes).into_iter().for_each(|row| x[row as usize] = [0.0; KRYLOV_WIDTH]);
        self.spare.lock().unwrap_or_else(PoisonError::into_inner).push(x);
        found
    }
}

/// Elimination on some supernodes, ascending.
struct Climb<'a, 'x, T> {
    parts: Parts<'a, T>,
    nodes: &'a [u32],
    x: &'x mut [Row<KRYLOV_WIDTH>],
}

impl<T: Scalar> pulp::WithSimd for Climb<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F64_LANES {
            8 => self.run::<S, 1, 8>(simd),
            4 => self.run::<S, 2, 4>(simd),
            _ => self.run::<S, 4, 2>(simd),
        }
    }
}

impl<T: Scalar> Climb<'_, '_, T> {
    #[inline(always)]
    fn run<S: Simd, const V: usize, const R: usize>(self, simd: S) {
        let Self { parts, nodes, x } = self;
        let SymbolicFactor { nodes: all, patterns, .. } = parts.symbolic;
        let stretch = Stretch { nodes: all, first_row: 0, patterns, first_pattern: 0 };
        let groups = KRYLOV_WIDTH / (V * S::F64_LANES).max(1);
        let mut scratch = Vec::new();
        for &node in nodes {
            let (part, top, tail) = NodePart::new(parts, &stretch, &all[node as usize], x);
            part.permute(top, &mut scratch, true);
            for group in 0..groups {
                part.forward::<S, V, R, KRYLOV_WIDTH>(simd, group, top, tail);
            }
        }
    }
}

impl HalfSolved {
    /// How many right-hand sides.
    pub fn width(&self) -> usize {
        self.width
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        (4 * self.rows.len() + 16 * self.values.len()) as u64
    }

    /// `Cᵀ K⁻¹ C'` with those of another half of the same factor: `width × other.width`, row after row.
    pub fn product(&self, other: &Self) -> Vec<f64> {
        match (self.width, other.width) {
            (2, 2) => self.product_of::<2, 2>(other),
            (3, 3) => self.product_of::<3, 3>(other),
            _ => self.product_of_any(other),
        }
    }

    fn product_of<const A: usize, const B: usize>(&self, other: &Self) -> Vec<f64> {
        let mut sums = [[0.0; B]; A];
        let (own, theirs) = (self.values.as_chunks::<A>().0, other.divided.as_chunks::<B>().0);
        self.common(other, |i, j| {
            for (sums, a) in sums.iter_mut().zip(&own[i]) {
                sums.iter_mut().zip(&theirs[j]).for_each(|(sum, b)| *sum += a * b);
            }
        });
        sums.into_iter().flatten().collect()
    }

    fn product_of_any(&self, other: &Self) -> Vec<f64> {
        let mut sums = vec![0.0; self.width * other.width];
        self.common(other, |i, j| {
            let own = &self.values[i * self.width..(i + 1) * self.width];
            let theirs = &other.divided[j * other.width..(j + 1) * other.width];
            for (sums, a) in sums.chunks_exact_mut(other.width).zip(own) {
                sums.iter_mut().zip(theirs).for_each(|(sum, b)| *sum += a * b);
            }
        });
        sums
    }

    /// Calls with the positions of all rows that both have.
    fn common(&self, other: &Self, mut act: impl FnMut(usize, usize)) {
        let (mut i, mut j) = (0, 0);
        while i < self.rows.len() && j < other.rows.len() {
            match self.rows[i].cmp(&other.rows[j]) {
                std::cmp::Ordering::Less => i += 1,
                std::cmp::Ordering::Greater => j += 1,
                std::cmp::Ordering::Equal => {
                    act(i, j);
                    i += 1;
                    j += 1;
                }
            }
        }
    }

    /// `Cᵀ K⁻¹ b` from half of the solve for `b`, at all rows: `width` numbers.
    pub fn product_with(&self, half: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.width];
        for (own, &row) in self.divided.chunks_exact(self.width.max(1)).zip(&self.rows) {
            sums.iter_mut().zip(own).for_each(|(sum, d)| *sum += d * half[row as usize]);
        }
        sums
    }

    /// `half += L⁻¹ C y`, at all rows.
    pub fn add_to(&self, y: &[f64], half: &mut [f64]) {
        for (own, &row) in self.values.chunks_exact(self.width.max(1)).zip(&self.rows) {
            half[row as usize] += own.iter().zip(y).map(|(w, y)| w * y).sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use chladni_base::SplitMix64;

    use super::super::super::factor::tests::grid;
    use super::super::super::{ColumnTree, MassMatrix, Ordering, fill_reducing_order};
    use super::*;

    #[test]
    fn halves_of_solves_make_the_products_and_solutions_of_whole_ones() {
        let mut exchanged = 0;
        for side in [1, 2, 9, 40] {
            let matrix = grid(side, side);
            let matrix = matrix.reordered(&fill_reducing_order(&matrix, Ordering::NestedDissection).unwrap());
            let n = matrix.rows();
            let symbolic = SymbolicFactor::new(&matrix, &MassMatrix::Diagonal(vec![1.0; n])).unwrap();
            let (tree, reach) = (ColumnTree::new(&symbolic), ReachTree::new(&symbolic));
            for shift in [-0.3, 4.0 + 1e-7] {
                // An eigenvalue of the grid lies 1e-7 below the second shift: rounding errors grow by 8e7.
                let bound = if shift < 0.0 { 1e-9 } else { 1e-7 };
                let factor = symbolic.factor(&matrix, &MassMatrix::Diagonal(vec![1.0; n]), shift).unwrap();
                exchanged += usize::from(factor.is_pivoted());
                let numbers = factor.into_numbers();
                let mut random = SplitMix64::new(side as u64);
                let sides: Vec<Sides> = [2, 3, 3, 2, 1, 2]
                    .map(|width| Sides {
                        width,
                        entries: (0..7)
                            .map(|k| (random.below(n) as u32, k % width as u32, random.signed_unit()))
                            .collect(),
                    })
                    .to_vec();
                let dense = |side: &Sides, column: usize| {
                    let mut x = vec![0.0; n];
                    for &(row, k, value) in &side.entries {
                        x[row as usize] += if k as usize == column { value } else { 0.0 };
                    }
                    x
                };
                // Twice: what is left of a solve is nothing to the next.
                for _ in 0..2 {
                    let halves = reach.eliminate(&symbolic, &numbers, &sides);
                    for (a, own) in sides.iter().zip(&halves) {
                        for (b, other) in sides.iter().zip(&halves) {
                            let products = own.product(other);
                            for j in 0..b.width {
                                let mut x = dense(b, j);
                                tree.solve(&symbolic, &numbers, &mut x);
                                let size = x.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
                                for i in 0..a.width {
                                    let exact: f64 = dense(a, i).iter().zip(&x).map(|(a, x)| a * x).sum();
                                    assert!(
                                        (products[i * b.width + j] - exact).abs() < bound * size,
                                        "{side}, {shift}"
                                    );
                                }
                                let mut half = vec![0.0; n];
                                let unit: Vec<f64> = (0..b.width).map(|k| f64::from(u8::from(k == j))).collect();
                                other.add_to(&unit, &mut half);
                                let mut eliminated = dense(b, j);
                                tree.eliminate(&symbolic, &numbers, &mut eliminated);
                                assert!(half.iter().zip(&eliminated).all(|(a, b)| (a - b).abs() < bound * size));
                                let with = own.product_with(&half);
                                assert!(
                                    (0..a.width).all(|i| (with[i] - products[i * b.width + j]).abs() < bound * size)
                                );
                                tree.substitute(&symbolic, &numbers, &mut half);
                                assert!(half.iter().zip(&x).all(|(a, b)| (a - b).abs() < bound * size));
                            }
                        }
                    }
                }
            }
        }
        assert!(exchanged > 0, "factors whose rows were exchanged are among them");
    }
}
