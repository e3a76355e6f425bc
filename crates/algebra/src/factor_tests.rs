//! Orders, factors and their inertia against the dense solver.

use std::collections::BTreeMap;

use chladni_base::SplitMix64;
use chladni_base::Unwatched;

use crate::{
    ColumnTree, CpuSolver, DenseMatrix, FactorError, MassMatrix, Ordering, PANEL_WIDTH, SparseMatrix, SymbolicFactor,
    SymmetricDefiniteSolver, fill_reducing_order,
};

pub(crate) fn sparse(n: usize, entries: &BTreeMap<(u32, u32), f64>) -> SparseMatrix {
    let mut offsets = vec![0; n + 1];
    entries.keys().for_each(|&(row, _)| offsets[row as usize + 1] += 1);
    (0..n).for_each(|row| offsets[row + 1] += offsets[row]);
    let (indices, values) = entries.iter().map(|(&(_, column), &value)| (column, value)).unzip();
    SparseMatrix::new(n, n, offsets, indices, values).unwrap()
}

/// Random entries at random places of both triangles, about `degree` a row, beside a diagonal.
fn random(n: usize, degree: usize, diagonal: impl Fn(&mut SplitMix64) -> f64, seed: u64) -> SparseMatrix {
    let mut random = SplitMix64::new(seed);
    let mut entries = BTreeMap::new();
    for row in 0..n as u32 {
        entries.insert((row, row), diagonal(&mut random));
    }
    for _ in 0..n * degree / 2 {
        let (row, column) = (random.below(n) as u32, random.below(n) as u32);
        if row != column {
            let value = random.signed_unit();
            entries.insert((row, column), value);
            entries.insert((column, row), value);
        }
    }
    sparse(n, &entries)
}

/// Diagonally dominant, hence definite.
fn definite(n: usize, degree: usize, seed: u64) -> SparseMatrix {
    let loose = random(n, degree, |_| 0.0, seed);
    let mut entries = BTreeMap::new();
    for row in 0..n {
        let (columns, values) = loose.row(row);
        let sum: f64 = values.iter().map(|value| value.abs()).sum();
        for (&column, &value) in columns.iter().zip(values) {
            entries.insert((row as u32, column), if column as usize == row { 1.0 + sum } else { value });
        }
    }
    sparse(n, &entries)
}

/// The graph Laplacian of a grid.
pub(crate) fn grid(width: usize, height: usize) -> SparseMatrix {
    let mut entries = BTreeMap::new();
    let mut couple = |a: usize, b: usize| {
        let (a, b) = (a as u32, b as u32);
        for (row, column, value) in [(a, b, -1.0), (b, a, -1.0), (a, a, 1.0), (b, b, 1.0)] {
            *entries.entry((row, column)).or_insert(0.0) += value;
        }
    };
    for y in 0..height {
        for x in 0..width {
            if x + 1 < width {
                couple(y * width + x, y * width + x + 1);
            }
            if y + 1 < height {
                couple(y * width + x, (y + 1) * width + x);
            }
        }
    }
    sparse(width * height, &entries)
}

/// Copies of a matrix down the diagonal: every eigenvalue is repeated.
fn copies(matrix: &SparseMatrix, count: usize) -> SparseMatrix {
    let n = matrix.rows();
    let mut entries = BTreeMap::new();
    for copy in 0..count {
        for row in 0..n {
            let (columns, values) = matrix.row(row);
            for (&column, &value) in columns.iter().zip(values) {
                entries.insert(((copy * n + row) as u32, (copy * n) as u32 + column), value);
            }
        }
    }
    sparse(n * count, &entries)
}

fn reordered(matrix: &SparseMatrix, order: &[u32]) -> SparseMatrix {
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, &row)| place[row as usize] = k as u32);
    let mut entries = BTreeMap::new();
    for row in 0..matrix.rows() {
        let (columns, values) = matrix.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            entries.insert((place[row], place[column as usize]), value);
        }
    }
    sparse(matrix.rows(), &entries)
}

fn dense(mass: &MassMatrix) -> DenseMatrix {
    mass.to_dense()
}

/// The largest `|(A − μB)X − R|` over the largest term of its sums, for random `R` and `X` from the factor.
fn solve_error(a: &SparseMatrix, b: &MassMatrix, shift: f64, factor: &crate::Factor<'_>) -> f64 {
    let n = a.rows();
    let mut random = SplitMix64::new(9);
    let rhs: Vec<f64> = (0..n * PANEL_WIDTH).map(|_| random.signed_unit()).collect();
    let mut x = rhs.clone();
    factor.solve_panel(&mut x);
    // Alone, a column is what it is in the panel; one that is zero but for some rows as well.
    let (symbolic, numbers) = (factor.symbolic, factor.numbers());
    let tree = ColumnTree::new(symbolic);
    for (column, few) in [(5, n), (9, 1), (31, 3)] {
        let mut right: Vec<f64> = rhs.iter().skip(column).step_by(PANEL_WIDTH).copied().collect();
        right.iter_mut().enumerate().filter(|(row, _)| row % (n / few).max(1) != 0).for_each(|(_, x)| *x = 0.0);
        let mut panel: Vec<f64> = right.iter().flat_map(|&x| [x; PANEL_WIDTH]).collect();
        factor.solve_panel(&mut panel);
        tree.solve(symbolic, &numbers, &mut right);
        let largest = right.iter().fold(1e-300, |most: f64, x| most.max(x.abs()));
        for (alone, beside) in right.iter().zip(panel.iter().step_by(PANEL_WIDTH)) {
            assert!((alone - beside).abs() <= 1e-9 * largest, "{alone} {beside} of {largest}");
        }
    }
    let mut worst = 0f64;
    for column in [0, 1, 17, 31] {
        let part = |values: &[f64]| -> Vec<f64> { values.iter().skip(column).step_by(PANEL_WIDTH).copied().collect() };
        let (x, rhs) = (part(&x), part(&rhs));
        let bx = b.multiply(&x);
        let largest = x.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
        for row in 0..n {
            let (columns, values) = a.row(row);
            let ax: f64 = columns.iter().zip(values).map(|(&c, v)| v * x[c as usize]).sum();
            worst = worst.max((ax - shift * bx[row] - rhs[row]).abs() / (largest * (1.0 + shift.abs())));
        }
    }
    worst
}

#[test]
fn an_order_is_a_permutation_and_the_same_every_time() {
    let diagonal = random(5, 0, |_| 1.0, 1);
    let empty = SparseMatrix::new(4, 4, vec![0; 5], vec![], vec![]).unwrap();
    let nothing = SparseMatrix::new(0, 0, vec![0], vec![], vec![]).unwrap();
    let cases = [
        ("nothing", nothing),
        ("one row", random(1, 0, |_| 1.0, 1)),
        ("no entries", empty),
        ("diagonal", diagonal),
        ("disconnected", copies(&grid(7, 5), 4)),
        ("grid", grid(23, 17)),
        ("full", random(40, 400, |_| 1.0, 2)),
        ("random", random(300, 4, |_| 1.0, 3)),
    ];
    for (name, matrix) in &cases {
        for ordering in [Ordering::Amd, Ordering::NestedDissection] {
            let order = fill_reducing_order(matrix, ordering).unwrap();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.iter().copied().eq(0..matrix.rows() as u32), "{name}, {ordering:?}: {order:?}");
            assert_eq!(order, fill_reducing_order(matrix, ordering).unwrap(), "{name}, {ordering:?}");
        }
    }
}

#[test]
fn orders_reduce_fill() {
    let matrix = grid(60, 50);
    let mass = MassMatrix::Diagonal(vec![1.0; 3000]);
    let entries = |matrix: &SparseMatrix| SymbolicFactor::new(matrix, &mass).unwrap().entries();
    let natural = entries(&matrix);
    for ordering in [Ordering::Amd, Ordering::NestedDissection] {
        let ordered = entries(&reordered(&matrix, &fill_reducing_order(&matrix, ordering).unwrap()));
        assert!(2 * ordered < natural, "{ordering:?}: {ordered} of {natural}");
    }
}

#[test]
fn matrices_that_are_no_pencil_are_refused_by_their_sizes() {
    let wide = SparseMatrix::new(2, 3, vec![0, 1, 2], vec![0, 2], vec![1.0, 1.0]).unwrap();
    let shape = FactorError::Shape { rows: 2, columns: 3, mass: 2 };
    assert_eq!(fill_reducing_order(&wide, Ordering::Amd).unwrap_err(), shape);
    assert_eq!(SymbolicFactor::new(&wide, &MassMatrix::Diagonal(vec![1.0; 2])).unwrap_err(), shape);
    let square = grid(2, 2);
    let error = SymbolicFactor::new(&square, &MassMatrix::Diagonal(vec![1.0; 5])).unwrap_err();
    assert_eq!(error, FactorError::Shape { rows: 4, columns: 4, mass: 5 });
}

#[test]
fn the_empty_pencil_has_a_factor_without_eigenvalues() {
    let nothing = SparseMatrix::new(0, 0, vec![0], vec![], vec![]).unwrap();
    let mass = MassMatrix::Diagonal(vec![]);
    let symbolic = SymbolicFactor::new(&nothing, &mass).unwrap();
    let factor = symbolic.factor(&nothing, &mass, 1.0).unwrap();
    assert_eq!((symbolic.size(), factor.eigenvalues_below()), (0, 0));
    factor.solve_panel(&mut []);
}

#[test]
fn inertia_counts_the_eigenvalues_below_every_shift_and_solves_are_exact() {
    for n in [1, 2, 3, 4, 7, 16, 33, 64, 100, 150] {
        let loose = |seed| random(n, 5, |random| 3.0 * random.signed_unit(), seed);
        let block = random(n.div_ceil(3), 4, |random| random.signed_unit(), 5);
        let masses: Vec<f64> = (0..n).map(|k| 0.5 + (k % 7) as f64).collect();
        let cases = [
            ("diagonal mass", loose(1), MassMatrix::Diagonal(masses)),
            ("sparse mass of another pattern", loose(2), MassMatrix::Sparse(definite(n, 6, 3))),
            (
                "sparse mass, diagonal matrix",
                random(n, 0, |r| r.signed_unit(), 4),
                MassMatrix::Sparse(definite(n, 3, 8)),
            ),
            ("multiplets", copies(&block, 3), MassMatrix::Diagonal(vec![2.0; 3 * n.div_ceil(3)])),
            ("Laplacian", grid(n, 2), MassMatrix::Sparse(definite(2 * n, 2, 6))),
        ];
        for (name, a, b) in &cases {
            let order = fill_reducing_order(a, Ordering::Amd).unwrap();
            let b = &b.reordered(&order);
            let a = &reordered(a, &order);
            let size = a.rows();
            let values = CpuSolver.lowest(a.to_dense(), dense(b), size, &Unwatched).unwrap().values;
            let symbolic = SymbolicFactor::new(a, b).unwrap();
            let gaps = values.windows(2).filter(|pair| pair[1] - pair[0] > 1e-6);
            let mut shifts: Vec<f64> = gaps.map(|pair| 0.5 * (pair[0] + pair[1])).collect();
            shifts.extend([values[0] - 0.3, values[size - 1] + 0.3]);
            for shift in shifts {
                let factor = symbolic.factor(a, b, shift).unwrap();
                let below = values.partition_point(|&value| value < shift);
                assert_eq!(factor.eigenvalues_below(), below, "{name}, n = {n}, shift {shift}: {factor:?}");
                let error = solve_error(a, b, shift, &factor);
                assert!(error < 1e-10, "{name}, n = {n}, shift {shift}: {error:e}, {factor:?}");
            }
        }
    }
}

#[test]
fn a_zero_diagonal_is_pivoted_or_called_singular_and_never_wrong() {
    let mut pivoted = 0;
    for n in [2, 4, 10, 60] {
        for degree in [1, 3, 2 * n] {
            let mut a = random(n, degree, |_| 0.0, n as u64);
            if n == 2 {
                a = SparseMatrix::new(2, 2, vec![0, 2, 4], vec![0, 1, 0, 1], vec![0.0, 1.0, 1.0, 0.0]).unwrap();
            }
            let b = MassMatrix::Diagonal(vec![1.0; n]);
            let values = CpuSolver.lowest(a.to_dense(), dense(&b), n, &Unwatched).unwrap().values;
            let symbolic = SymbolicFactor::new(&a, &b).unwrap();
            match symbolic.factor(&a, &b, 0.0) {
                Ok(factor) => {
                    let clear = values.iter().all(|value| value.abs() > 1e-9);
                    let below = values.partition_point(|&value| value < 0.0);
                    assert!(!clear || factor.eigenvalues_below() == below, "n = {n}, degree {degree}: {factor:?}");
                    let error = solve_error(&a, &b, 0.0, &factor);
                    assert!(!clear || error < 1e-10, "n = {n}, degree {degree}: {error:e}, {factor:?}");
                    pivoted += usize::from(factor.is_pivoted());
                }
                Err(error) => assert!(matches!(error, FactorError::Singular { .. }), "n = {n}: {error}"),
            }
        }
    }
    assert!(pivoted > 0);
}

#[test]
fn singular_matrices_are_called_so() {
    let zero = SparseMatrix::new(3, 3, vec![0; 4], vec![], vec![]).unwrap();
    let unit = |n| MassMatrix::Diagonal(vec![1.0; n]);
    let identity = random(6, 0, |_| 1.0, 1);
    let poisoned = random(6, 3, |_| f64::NAN, 1);
    for (name, a, shift) in [("zero", &zero, 0.0), ("identity", &identity, 1.0), ("not a number", &poisoned, 0.0)] {
        let mass = unit(a.rows());
        let symbolic = SymbolicFactor::new(a, &mass).unwrap();
        let error = symbolic.factor(a, &mass, shift).unwrap_err();
        assert!(matches!(error, FactorError::Singular { .. }), "{name}: {error}");
    }
    // Where rounding hides that a matrix is singular, the doubtful eigenvalue may be counted or not.
    for n in [4, 40, 300] {
        let path = grid(n, 1);
        let symbolic = SymbolicFactor::new(&path, &unit(n)).unwrap();
        match symbolic.factor(&path, &unit(n), 0.0) {
            Ok(factor) => assert!(factor.eigenvalues_below() <= 1, "{factor:?}"),
            Err(error) => assert!(matches!(error, FactorError::Singular { .. }), "{error}"),
        }
    }
}

#[test]
fn a_shift_close_to_an_eigenvalue_still_counts() {
    // The eigenvalues of a path are 4 sin²(kπ / 2n).
    let n = 40;
    let (path, mass) = (grid(n, 1), MassMatrix::Diagonal(vec![1.0; n]));
    let symbolic = SymbolicFactor::new(&path, &mass).unwrap();
    for k in 1..n {
        let value = 4.0 * (k as f64 * std::f64::consts::PI / (2 * n) as f64).sin().powi(2);
        for (shift, below) in [(value - 1e-10, k), (value + 1e-10, k + 1)] {
            assert_eq!(symbolic.factor(&path, &mass, shift).unwrap().eigenvalues_below(), below, "{k}");
        }
    }
}

#[test]
fn a_panel_of_another_size_is_refused() {
    let (a, mass) = (grid(5, 5), MassMatrix::Diagonal(vec![1.0; 25]));
    let symbolic = SymbolicFactor::new(&a, &mass).unwrap();
    let factor = symbolic.factor(&a, &mass, 0.5).unwrap();
    for size in [0, 24 * PANEL_WIDTH, 25 * PANEL_WIDTH - 1, 26 * PANEL_WIDTH] {
        let solve = std::panic::AssertUnwindSafe(|| factor.solve_panel(&mut vec![1.0; size]));
        assert!(std::panic::catch_unwind(solve).is_err(), "{size} numbers");
    }
}

#[test]
fn numbers_solve_beside_their_structure_and_no_other() {
    let (a, mass) = (grid(5, 5), MassMatrix::Diagonal(vec![1.0; 25]));
    let symbolic = SymbolicFactor::new(&a, &mass).unwrap();
    let factor = symbolic.factor(&a, &mass, 0.5).unwrap();
    let right: Vec<f64> = (0..25 * PANEL_WIDTH).map(|k| (k % 17) as f64 - 8.0).collect();
    let (mut by_factor, mut by_numbers) = (right.clone(), right);
    factor.solve_panel(&mut by_factor);
    let numbers = factor.into_numbers();
    symbolic.solve_panel(&numbers, &mut by_numbers);
    assert_eq!(by_factor, by_numbers);
    let other = SymbolicFactor::new(&grid(4, 4), &MassMatrix::Diagonal(vec![1.0; 16])).unwrap();
    let solve = std::panic::AssertUnwindSafe(|| other.solve_panel(&numbers, &mut vec![1.0; 16 * PANEL_WIDTH]));
    assert!(std::panic::catch_unwind(solve).is_err());
    let tree = ColumnTree::new(&symbolic);
    let solve = std::panic::AssertUnwindSafe(|| tree.solve(&other, &numbers, &mut [1.0; 16]));
    assert!(std::panic::catch_unwind(solve).is_err());
    for size in [0, 24, 26] {
        let solve = std::panic::AssertUnwindSafe(|| tree.solve(&symbolic, &numbers, &mut vec![1.0; size]));
        assert!(std::panic::catch_unwind(solve).is_err(), "{size}");
    }
}

#[test]
fn a_count_is_off_by_no_more_than_its_uncertainty_lets_it() {
    // A grid that is clamped around it: with a shift next to four, every diagonal entry nearly vanishes.
    let (width, height) = (20, 21);
    let mut entries = BTreeMap::new();
    for at in 0..width * height {
        entries.insert((at as u32, at as u32), 4.0);
        for (inside, other) in [((at + 1) % width != 0, at + 1), (at + width < width * height, at + width)] {
            if inside {
                entries.insert((at as u32, other as u32), -1.0);
                entries.insert((other as u32, at as u32), -1.0);
            }
        }
    }
    let a = sparse(width * height, &entries);
    let order = fill_reducing_order(&a, Ordering::Amd).unwrap();
    let (a, mass) = (reordered(&a, &order), MassMatrix::Diagonal(vec![1.0; width * height]));
    let wave = |k: usize, n: usize| 2.0 * (k as f64 * std::f64::consts::PI / (n + 1) as f64).cos();
    let mut values: Vec<f64> =
        (1..=width).flat_map(|i| (1..=height).map(move |j| 4.0 - wave(i, width) - wave(j, height))).collect();
    values.sort_by(f64::total_cmp);
    let below = |at: f64| values.partition_point(|&value| value < at);
    let symbolic = SymbolicFactor::new(&a, &mass).unwrap();
    let mut certain = 0;
    let shifts = (0..64).map(|k| 4.0 + 1e-9 * (f64::from(k) - 31.5) / 32.0).chain((1..80).map(|k| 0.1 * f64::from(k)));
    for shift in shifts {
        let Ok(factor) = symbolic.factor(&a, &mass, shift) else { continue };
        let (count, radius) = (factor.eigenvalues_below(), factor.uncertainty(&a, &mass, shift));
        assert!(below(shift - radius) <= count && count <= below(shift + radius), "{shift}: {count} ± {radius:e}");
        certain += usize::from(radius < 1e-8);
        let Ok(pivoted) = symbolic.pivoted_factor(&a, &mass, shift, factor.into_storage()) else { continue };
        let (count, closer) = (pivoted.eigenvalues_below(), pivoted.uncertainty(&a, &mass, shift));
        assert!(below(shift - closer) <= count && count <= below(shift + closer), "{shift}: {count} ± {closer:e}");
    }
    assert!(certain > 60, "{certain}");
}

#[test]
fn pivots_that_are_chosen_leave_less_uncertain_than_small_ones() {
    // One supernode; the first pivot is a hundred thousandth of the entries beside it.
    let n = 30;
    let entry = |i: usize, j: usize| if i + j == 0 { 1e-5 } else { ((i * j + i + j) as f64).sin() };
    let entries: BTreeMap<(u32, u32), f64> =
        (0..n).flat_map(|i| (0..n).map(move |j| ((i as u32, j as u32), entry(i, j)))).collect();
    let (a, mass) = (sparse(n, &entries), MassMatrix::Diagonal(vec![1.0; n]));
    let symbolic = SymbolicFactor::new(&a, &mass).unwrap();
    let plain = symbolic.factor(&a, &mass, 0.0).unwrap();
    let (below, radius) = (plain.eigenvalues_below(), plain.uncertainty(&a, &mass, 0.0));
    let pivoted = symbolic.pivoted_factor(&a, &mass, 0.0, plain.into_storage()).unwrap();
    assert_eq!(pivoted.eigenvalues_below(), below);
    let closer = pivoted.uncertainty(&a, &mass, 0.0);
    assert!(closer < 1e-3 * radius, "{closer:e}, {radius:e}");
    // With masses of 1 the uncertainty is that of the worst row.
    assert_eq!(pivoted.row_errors(&a, &mass, 0.0).into_iter().fold(0.0, f64::max), closer);
}
