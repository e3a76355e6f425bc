use chladni_base::{Cancelled, Monitor, StageClock, Unwatched};

use super::numbers::Numbers;
use super::tests::{accelerator_of, open};
use super::*;
use crate::{DenseMatrix, MassMatrix, Multigrid, SparseMatrix};

/// Pairs that satisfy nothing, on a grid of `k × k` vertices, spanned by piecewise constant functions.
struct Measured {
    stiffness: SparseMatrix,
    mass: MassMatrix,
    space: SparseMatrix<f32>,
    coefficients: DenseMatrix,
    values: Vec<f64>,
    sigmas: Vec<f64>,
    cycles: usize,
    /// Whether what is left is measured by trees.
    by_trees: bool,
}

impl Measured {
    fn new(k: usize, q: usize, consistent: bool) -> Self {
        let n = k * k;
        let (mut starts, mut columns, mut values, mut masses) = (vec![0], Vec::new(), Vec::new(), Vec::new());
        for row in 0..n {
            let (i, j) = (row / k, row % k);
            let mut neighbours: Vec<(usize, f64)> = vec![(row, 0.0)];
            for (step, there) in [(k, i + 1 < k), (1, j + 1 < k)] {
                neighbours.extend(there.then_some((row + step, -1.0 - 0.1 * (row % 3) as f64)));
            }
            for (step, there) in [(k, i > 0), (1, j > 0)] {
                neighbours.extend(there.then(|| (row - step, -1.0 - 0.1 * ((row - step) % 3) as f64)));
            }
            let sum: f64 = neighbours.iter().map(|entry| entry.1).sum();
            neighbours[0].1 = -sum;
            neighbours.sort_by_key(|entry| entry.0);
            for (column, value) in neighbours {
                columns.push(column as u32);
                values.push(value);
                masses.push(if column == row { 0.6 } else { 0.1 });
            }
            starts.push(columns.len());
        }
        let mass = SparseMatrix::from_sorted_parts(n, n, starts.clone(), columns.clone(), masses);
        let mass = if consistent { MassMatrix::Sparse(mass) } else { MassMatrix::Diagonal(vec![0.8; n]) };
        let d = n.div_ceil(20);
        let (places, ones) = ((0..n).map(|row| (row / 20) as u32).collect(), vec![1.0f32; n]);
        Self {
            stiffness: SparseMatrix::from_sorted_parts(n, n, starts, columns, values),
            mass,
            space: SparseMatrix::from_sorted_parts(n, d, (0..=n).collect(), places, ones),
            coefficients: DenseMatrix::from_columns(d, q, Numbers(q as u64).take(d * q)),
            values: (0..q).map(|pair| 0.01 * pair as f64).collect(),
            sigmas: (0..q).map(|pair| 0.02 + 0.01 * (pair / 16) as f64).collect(),
            cycles: 3,
            by_trees: false,
        }
    }

    fn on(&self, accelerator: &Accelerator, monitor: &dyn Monitor) -> Result<Option<PairSums>, Cancelled> {
        let hierarchy = Multigrid::new(&self.stiffness, &self.mass, 0.0, &Unwatched).unwrap();
        let (lumped, rounding) = (self.mass.lumped(), vec![1e-30; self.stiffness.rows()]);
        // Rows of the grid, each a chain.
        let patches = hierarchy.patches();
        let starts: Vec<u32> =
            patches.iter().map(|patch| patch.rows().start as u32).chain([lumped.len() as u32]).collect();
        let nodes: Vec<TreeNode> = patches.iter().flat_map(|patch| self.chains(patch.rows())).collect();
        let trees = MeasuredTrees { nodes: &nodes, patches: &starts };
        let pencil = MeasuredPencil {
            stiffness: &self.stiffness,
            mass: &self.mass,
            lumped: &lumped,
            rounding: &rounding,
            floor: 0.0,
            hierarchy: &hierarchy,
            trees: self.by_trees.then_some(trees),
        };
        let pairs = MeasuredPairs {
            space: &self.space,
            coefficients: &self.coefficients,
            values: &self.values,
            sigmas: &self.sigmas,
        };
        accelerator.measure(&pencil, &pairs, &Cycles(self.cycles), monitor)
    }

    /// Each row hangs on the next one where an edge joins them.
    fn chains(&self, rows: std::ops::Range<usize>) -> Vec<TreeNode> {
        let node = |row: usize| {
            let own = (row - rows.start) as u32;
            let (columns, values) = self.stiffness.row(row);
            let next = columns.iter().position(|&column| column as usize == row + 1 && row + 1 < rows.end);
            match next {
                Some(at) => TreeNode { row: own, parent: own + 1, weight: (-values[at] * (1.0 - 1e-7)) as f32 },
                None => TreeNode { row: own, parent: own, weight: 0.0 },
            }
        };
        rows.clone().map(node).collect()
    }

    fn residual(&self, pair: usize) -> Vec<f64> {
        let x = self.space.multiply_dense(&self.coefficients).column(pair).to_vec();
        let mx = self.mass.multiply(&x);
        self.stiffness.multiply(&x).iter().zip(mx).map(|(sx, mx)| sx - self.values[pair] * mx).collect()
    }
}

/// So many cycles each, and the density of the first pair.
struct Cycles(usize);

impl Judge for Cycles {
    fn is_close(&self, _: usize, _: &[ResidualSums], _: &[EnclosureSums]) -> bool {
        false
    }

    fn weights(&self, first: usize, residuals: &[ResidualSums], _: &[EnclosureSums]) -> Option<Vec<f64>> {
        (first == 0).then(|| (0..residuals.len()).map(|k| f64::from(u8::from(k == 0))).collect())
    }

    fn most_cycles(&self) -> usize {
        self.0
    }
}

#[test]
fn measured_residuals_are_those_of_the_definition_and_cycles_leave_next_to_nothing_of_them() {
    for (consistent, q) in [(false, 5), (true, 70)] {
        let Some(device) = open() else { return };
        let accelerator = accelerator_of(device);
        let case = Measured::new(57, q, consistent);
        let PairSums { residuals, enclosures, density } = case.on(&accelerator, &Unwatched).unwrap().unwrap();
        assert_eq!((residuals.len(), enclosures.len(), accelerator.fallbacks()), (q, q, 0));
        let lumped = case.mass.lumped();
        for pair in [0, q / 2, q - 1] {
            let r = case.residual(pair);
            let sum = |of: &dyn Fn(usize) -> f64| (0..r.len()).map(of).sum::<f64>();
            let (residual, dual) = (sum(&|k| r[k] * r[k]), sum(&|k| r[k] * r[k] / lumped[k]));
            assert!((residuals[pair].residual - residual).abs() < 1e-11 * residual, "pair {pair}");
            assert!((residuals[pair].dual - dual).abs() < 1e-11 * dual, "pair {pair}");
            // The norm in the inverse of `S + σM`, by a dense factor.
            let mut matrix = case.stiffness.to_dense();
            let mass = case.mass.to_dense();
            let sigma = case.sigmas[pair];
            matrix.values_mut().iter_mut().zip(mass.values()).for_each(|(a, m)| *a += sigma * m);
            let mut solved = DenseMatrix::from_columns(r.len(), 1, r.clone());
            crate::solve_definite(matrix, &mut solved).unwrap();
            let exact: f64 = solved.column(0).iter().zip(&r).map(|(y, r)| y * r).sum();
            let below = enclosures[pair].below;
            assert!(below < exact * (1.0 + 1e-6) && below > 0.999 * exact, "pair {pair}: {below} of {exact}");
            assert!(enclosures[pair].excess < 1e-2 * sigma * below, "pair {pair}: {:?}", enclosures[pair]);
        }
        // The density of one pair sums up to `yᵀr`, which is near its squared norm.
        let density: f64 = density.unwrap().iter().sum();
        assert!((density / enclosures[0].below - 1.0).abs() < 1e-2);
    }
}

#[test]
fn trees_enclose_what_one_cycle_leaves_closer_than_masses_do() {
    for consistent in [false, true] {
        let Some(device) = open() else { return };
        let accelerator = accelerator_of(device);
        let mut case = Measured { cycles: 1, ..Measured::new(57, 70, consistent) };
        let by_mass = case.on(&accelerator, &Unwatched).unwrap().unwrap();
        case.by_trees = true;
        let by_trees = case.on(&accelerator, &Unwatched).unwrap().unwrap();
        assert_eq!((accelerator.fallbacks(), &by_mass.residuals), (0, &by_trees.residuals));
        let ratio = case.mass.lumped_ratio();
        for pair in [0, 35, 69] {
            let (r, sigma) = (case.residual(pair), case.sigmas[pair]);
            let mut matrix = case.stiffness.to_dense();
            let mass = case.mass.to_dense();
            matrix.values_mut().iter_mut().zip(mass.values()).for_each(|(a, m)| *a += sigma * m);
            let mut solved = DenseMatrix::from_columns(r.len(), 1, r.clone());
            crate::solve_definite(matrix, &mut solved).unwrap();
            let exact: f64 = solved.column(0).iter().zip(&r).map(|(y, r)| y * r).sum();
            let above = |sums: &PairSums| sums.enclosures[pair].below + ratio * sums.enclosures[pair].excess / sigma;
            let [mass, trees] = [above(&by_mass), above(&by_trees)];
            assert!(exact < trees * (1.0 + 1e-6), "pair {pair}: {exact} is above {trees}");
            assert!(trees - exact < 0.7 * (mass - exact), "pair {pair}: {exact} {trees} {mass}");
        }
    }
}

#[test]
fn a_card_that_sums_up_wrongly_or_goes_away_measures_nothing() {
    let Some(device) = open() else { return };
    let accelerator = accelerator_of(device);
    let case = Measured { by_trees: true, ..Measured::new(40, 20, false) };
    accelerator.inject(|faults| faults.refuse_memory_after(9));
    assert_eq!(case.on(&accelerator, &Unwatched).unwrap(), None);
    assert_eq!((accelerator.fallbacks(), accelerator.available()), (1, true));
    let clock = StageClock::new(&Unwatched);
    accelerator.inject(|faults| faults.spoil());
    assert_eq!(case.on(&accelerator, &clock).unwrap(), None);
    assert_eq!((accelerator.fallbacks(), accelerator.available()), (2, false));
    let [("measured_on", note)] = &clock.notes()[..] else { panic!("{:?}", clock.notes()) };
    assert!(note.contains("the result of the device is wrong"), "{note}");
}
