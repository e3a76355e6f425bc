//! Factors by fronts against faer's left-looking ones, and against themselves on other numbers of threads.

use std::collections::BTreeMap;

use chladni_base::SplitMix64;

use super::super::factor::tests::sparse;
use super::super::{FactorError, MassMatrix, Ordering, PANEL_WIDTH, SparseMatrix, SymbolicFactor, fill_reducing_order};

/// The Laplacian of a triangulated rectangle with random weights.
fn triangles(width: usize, height: usize, seed: u64) -> SparseMatrix {
    let mut random = SplitMix64::new(seed);
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); width * height];
    for y in 0..height {
        for x in 0..width {
            let at = y * width + x;
            for (right, down) in [(1, 0), (0, 1), (1, 1)] {
                if x + right < width && y + down < height {
                    let to = at + down * width + right;
                    let weight = 1.0 + 0.7 * random.signed_unit();
                    for (a, b) in [(at, to), (to, at)] {
                        rows[a].push((b as u32, -weight));
                    }
                }
            }
        }
    }
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for (at, mut row) in rows.into_iter().enumerate() {
        row.push((at as u32, -row.iter().map(|entry| entry.1).sum::<f64>()));
        row.sort_by_key(|entry| entry.0);
        indices.extend(row.iter().map(|entry| entry.0));
        values.extend(row.iter().map(|entry| entry.1));
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(width * height, width * height, offsets, indices, values)
}

fn ordered(matrix: &SparseMatrix, ordering: Ordering) -> SparseMatrix {
    matrix.reordered(&fill_reducing_order(matrix, ordering).unwrap())
}

/// A symmetric matrix with these couplings and a diagonal.
fn coupled(n: usize, couplings: impl Iterator<Item = (usize, usize)>, seed: u64) -> SparseMatrix {
    let mut random = SplitMix64::new(seed);
    let mut entries: BTreeMap<(u32, u32), f64> =
        (0..n as u32).map(|row| ((row, row), 3.0 * random.signed_unit())).collect();
    for (a, b) in couplings.filter(|(a, b)| a != b) {
        let value = random.signed_unit();
        entries.insert((a as u32, b as u32), value);
        entries.insert((b as u32, a as u32), value);
    }
    sparse(n, &entries)
}

fn cube(side: usize, seed: u64) -> SparseMatrix {
    let at = |x: usize, y: usize, z: usize| (z * side + y) * side + x;
    let mut couplings = Vec::new();
    for z in 0..side {
        for y in 0..side {
            for x in 0..side {
                let next = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
                let inside = next.into_iter().filter(|&(x, y, z)| x.max(y).max(z) < side);
                couplings.extend(inside.map(|(p, q, r)| (at(x, y, z), at(p, q, r))));
            }
        }
    }
    coupled(side.pow(3), couplings.into_iter(), seed)
}

/// Matrices in an order, each with a mass.
fn cases() -> Vec<(&'static str, SparseMatrix, MassMatrix)> {
    let diagonal = |n: usize| MassMatrix::Diagonal((0..n).map(|k| 1.0 + 0.1 * (k % 5) as f64).collect());
    let mut random = SplitMix64::new(3);
    let pairs: Vec<(usize, usize)> = (0..900).map(|_| (random.below(500), random.below(500))).collect();
    let islands =
        |k: usize| (k % 40 != 39).then_some((k, k + 1)).into_iter().chain(k.is_multiple_of(40).then_some((k, k + 20)));
    let dense = |n: usize| (0..n).flat_map(move |a| (0..a).map(move |b| (a, b)));
    let unordered = [
        ("one row", coupled(1, std::iter::empty(), 1)),
        ("two rows", coupled(2, [(0, 1)].into_iter(), 2)),
        ("a diagonal", coupled(50, std::iter::empty(), 3)),
        ("a path", coupled(6000, (1..6000).map(|k| (k - 1, k)), 4)),
        ("an arrow", coupled(400, (0..399).map(|k| (k, 399)), 5)),
        (
            "a thick arrow",
            coupled(
                400,
                (0..360)
                    .flat_map(|k| (360..400).map(move |top| (k, top)))
                    .chain(dense(400).filter(|pair| pair.1 >= 360)),
                6,
            ),
        ),
        ("all entries", coupled(300, dense(300), 7)),
        ("islands", coupled(400, (0..399).flat_map(islands), 8)),
        ("at random", coupled(500, pairs.into_iter(), 9)),
        ("triangles", triangles(90, 80, 10)),
        ("more triangles", triangles(200, 150, 11)),
        ("a cube", cube(16, 12)),
    ];
    let mut cases = Vec::new();
    for (name, matrix) in unordered {
        for ordering in [Ordering::Amd, Ordering::NestedDissection] {
            let matrix = ordered(&matrix, ordering);
            let mass = diagonal(matrix.rows());
            cases.push((name, matrix, mass));
        }
    }
    let matrix = ordered(&triangles(60, 50, 13), Ordering::Amd);
    let values = matrix.values().iter().map(|value| if *value > 0.0 { 2.0 } else { 0.1 }).collect();
    let n = matrix.rows();
    let mass = SparseMatrix::from_sorted_parts(n, n, matrix.offsets().to_vec(), matrix.indices().to_vec(), values);
    cases.push(("a consistent mass", matrix, MassMatrix::Sparse(mass)));
    cases
}

fn on<T: Send>(threads: usize, what: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(what)
}

#[test]
fn supernodes_are_those_of_the_other_analysis() {
    for (name, matrix, mass) in cases() {
        let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
        assert!(symbolic.other().is_ok(), "{name}, {} rows: {} supernodes", matrix.rows(), symbolic.nodes.len());
    }
    // Orders that are no postorder are those of the other analysis alone.
    let matrix = triangles(30, 30, 1);
    let mut random = SplitMix64::new(5);
    let mut order: Vec<u32> = (0..900).collect();
    (1..900).for_each(|k| order.swap(k, random.below(k + 1)));
    let (matrix, mass) = (matrix.reordered(&order), MassMatrix::Diagonal(vec![1.0; 900]));
    let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
    assert!(symbolic.plan.is_none() && symbolic.other().is_ok());
    let below = symbolic.factor(&matrix, &mass, 1.0).unwrap().eigenvalues_below();
    assert_eq!(symbolic.count(&matrix, &mass, 1.0).unwrap().below, below);
}

#[test]
fn factors_by_fronts_count_and_solve_as_those_column_after_column() {
    let mut by_fronts = 0;
    for (name, matrix, mass) in cases() {
        let n = matrix.rows();
        let fronts = SymbolicFactor::new(&matrix, &mass).unwrap();
        let mut columns = SymbolicFactor::new(&matrix, &mass).unwrap();
        columns.plan = None;
        by_fronts += usize::from(fronts.plan.is_some());
        let mut random = SplitMix64::new(17);
        let panel: Vec<f64> = (0..n * PANEL_WIDTH).map(|_| random.signed_unit()).collect();
        for round in 0..50 {
            let shift = 4.0 * random.signed_unit();
            let what = format!("{name}, {n} rows, shift {shift}");
            let one = fronts.factor(&matrix, &mass, shift).unwrap();
            let other = columns.factor(&matrix, &mass, shift).unwrap();
            assert_eq!(one.eigenvalues_below(), other.eigenvalues_below(), "{what}");
            assert_eq!(one.first_below(), other.first_below(), "{what}");
            assert_eq!(one.is_pivoted(), other.is_pivoted(), "{what}");
            let (growth, expected) = (one.growth(), other.growth());
            // Entries that are large since a pivot is small have few digits in common.
            assert!((growth - expected).abs() <= 1e-3 * expected + 1e-12, "{what}: {growth} {expected}");
            let (error, expected) = (one.uncertainty(&matrix, &mass, shift), other.uncertainty(&matrix, &mass, shift));
            assert!((error - expected).abs() <= 1e-3 * expected, "{what}: {error:e} {expected:e}");
            let count = fronts.count(&matrix, &mass, shift).unwrap();
            assert_eq!(count.below, one.eigenvalues_below(), "{what}");
            assert!((count.uncertainty - error).abs() <= 1e-9 * error, "{what}: {} {error}", count.uncertainty);
            if round < 3 {
                let mut x = panel.clone();
                one.solve_panel(&mut x);
                for column in [0, 13, 31] {
                    let part =
                        |all: &[f64]| all.iter().skip(column).step_by(PANEL_WIDTH).copied().collect::<Vec<f64>>();
                    let (x, rhs) = (part(&x), part(&panel));
                    let (ax, bx) = (matrix.multiply(&x), mass.multiply(&x));
                    let largest = x.iter().fold(1.0f64, |most, x| most.max(x.abs()));
                    for row in 0..n {
                        let error = (ax[row] - shift * bx[row] - rhs[row]).abs();
                        // Relative to the terms of the sum, and to the growth of the factor, as far as it is accepted.
                        assert!(error <= 1e-12 * largest * one.growth().max(10.0), "{what}, row {row}: {error:e}");
                    }
                }
            }
        }
    }
    assert!(by_fronts > 16, "{by_fronts}");
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    for (name, matrix, mass) in cases().into_iter().chain([(
        "many triangles",
        ordered(&triangles(420, 400, 2), Ordering::NestedDissection),
        MassMatrix::Diagonal(vec![1.0; 420 * 400]),
    )]) {
        let symbolic = on(1, || SymbolicFactor::new(&matrix, &mass)).unwrap();
        assert_eq!(on(3, || SymbolicFactor::new(&matrix, &mass)).unwrap().lower.rows, symbolic.lower.rows, "{name}");
        let numbers = |threads| on(threads, || symbolic.factor(&matrix, &mass, 0.41).unwrap().numbers());
        let count = |threads| on(threads, || symbolic.count(&matrix, &mass, 0.41).unwrap());
        let (alone, counted) = (numbers(1), count(1));
        for threads in [2, 4] {
            let together = numbers(threads);
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<u64>>();
            assert!(bits(&together.values) == bits(&alone.values), "{name} on {threads} threads");
            assert!(bits(&together.inverse) == bits(&alone.inverse), "{name} on {threads} threads");
            assert_eq!(count(threads), counted, "{name} on {threads} threads");
        }
    }
}

#[test]
fn what_storage_held_before_does_not_matter() {
    let matrix = ordered(&triangles(90, 80, 10), Ordering::NestedDissection);
    let mass = MassMatrix::Diagonal(vec![1.0; matrix.rows()]);
    let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
    let fresh = symbolic.factor(&matrix, &mass, 0.2).unwrap().into_numbers().values;
    for storage in [vec![f64::NAN; fresh.len()], vec![7.0; 3], vec![f64::INFINITY; 2 * fresh.len()]] {
        assert_eq!(symbolic.factor_in(&matrix, &mass, 0.2, storage).unwrap().into_numbers().values, fresh);
    }
}

#[test]
fn a_pivot_that_is_zero_is_seen_wherever_it_is() {
    let grid = triangles(120, 110, 4);
    for ordering in [Ordering::Amd, Ordering::NestedDissection] {
        let matrix = ordered(&grid, ordering);
        let n = matrix.rows();
        for row in [0, n / 3, n / 2, n - 1] {
            // Nothing but zeros, or something that is no number, in one row and column.
            for poison in [0.0, f64::NAN, f64::INFINITY] {
                let mut values = matrix.values().to_vec();
                for other in 0..n {
                    let (from, columns) = (matrix.offsets()[other], matrix.row(other).0);
                    for (k, &column) in columns.iter().enumerate() {
                        if other == row || column as usize == row {
                            values[from + k] = poison;
                        }
                    }
                }
                let (offsets, indices) = (matrix.offsets().to_vec(), matrix.indices().to_vec());
                let poisoned = SparseMatrix::from_sorted_parts(n, n, offsets, indices, values);
                let mass = MassMatrix::Diagonal((0..n).map(|k| if k == row { 0.0 } else { 1.0 }).collect());
                let symbolic = SymbolicFactor::new(&poisoned, &mass).unwrap();
                assert!(symbolic.plan.is_some());
                let found = symbolic.factor(&poisoned, &mass, -0.5);
                assert!(
                    matches!(found, Err(FactorError::Singular { .. })),
                    "{ordering:?}, row {row}, {poison}: {found:?}"
                );
                let found = symbolic.count(&poisoned, &mass, -0.5);
                assert!(
                    matches!(found, Err(FactorError::Singular { .. })),
                    "{ordering:?}, row {row}, {poison}: {found:?}"
                );
            }
        }
    }
}

#[test]
fn where_update_matrices_would_take_more_than_the_factor_there_are_none() {
    // Leaves below a dense block: each update would be as large as the block.
    let (leaves, block) = (3000, 60);
    let below = (0..leaves).flat_map(|k| (0..block).map(move |top| (k, leaves + top)));
    let matrix = coupled(leaves + block, below, 1);
    let mass = MassMatrix::Diagonal(vec![1.0; leaves + block]);
    let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
    assert!(symbolic.plan.is_none());
    let count = symbolic.count(&matrix, &mass, 0.1).unwrap();
    assert_eq!(count.below, symbolic.factor(&matrix, &mass, 0.1).unwrap().eigenvalues_below());
}

/// Asks to stop from the checkpoint of some number on.
struct StopsAt(std::sync::atomic::AtomicIsize);

impl chladni_base::Monitor for StopsAt {
    fn stage(&self, _: &'static str) {}
    fn progress(&self, _: f64) {}
    fn checkpoint(&self) -> Result<(), chladni_base::Cancelled> {
        match self.0.fetch_sub(1, std::sync::atomic::Ordering::Relaxed) <= 0 {
            true => Err(chladni_base::Cancelled),
            false => Ok(()),
        }
    }
}

#[test]
fn a_factor_is_given_up_where_that_is_asked_for() {
    let matrix = ordered(&triangles(160, 150, 4), Ordering::NestedDissection);
    let mass = MassMatrix::Diagonal(vec![1.0; matrix.rows()]);
    let symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
    let stops_at = |checkpoint| StopsAt(std::sync::atomic::AtomicIsize::new(checkpoint));
    for checkpoint in [0, 1, 5, 20] {
        let counted = symbolic.count_watched(&matrix, &mass, 0.41, &stops_at(checkpoint));
        assert!(matches!(counted, Err(FactorError::Cancelled(_))), "{checkpoint}: {counted:?}");
        let factor = symbolic.factor_watched(&matrix, &mass, 0.41, Vec::new(), &stops_at(checkpoint));
        assert!(matches!(factor, Err(FactorError::Cancelled(_))), "{checkpoint}");
    }
    let never = stops_at(isize::MAX);
    let counted = symbolic.count_watched(&matrix, &mass, 0.41, &never).unwrap();
    assert_eq!(counted, symbolic.count(&matrix, &mass, 0.41).unwrap());
    let asked = isize::MAX - never.0.into_inner();
    assert!(asked > 20, "{asked} checkpoints");
}
