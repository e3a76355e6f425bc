use chladni_base::Unwatched;

use super::*;

/// A path graph's stiffness, and a mass of either kind.
fn path(n: usize, consistent: bool) -> (SparseMatrix, MassMatrix) {
    let (mut offsets, mut indices, mut s, mut m) = (vec![0], Vec::new(), Vec::new(), Vec::new());
    for i in 0..n {
        for j in i.saturating_sub(1)..n.min(i + 2) {
            indices.push(j as u32);
            let ends = f64::from(u8::from(i == 0) + u8::from(i + 1 == n));
            s.push(if i == j { 2.0 - ends } else { -1.0 });
            m.push(if i == j { 4.0 - 2.0 * ends } else { 1.0 } / 6.0);
        }
        offsets.push(indices.len());
    }
    let stiffness = SparseMatrix::new(n, n, offsets.clone(), indices.clone(), s).unwrap();
    let mass = if consistent {
        MassMatrix::Sparse(SparseMatrix::new(n, n, offsets, indices, m).unwrap())
    } else {
        MassMatrix::Diagonal((0..n).map(|i| 1.0 + (i % 3) as f64).collect())
    };
    (stiffness, mass)
}

/// Bumps around `d` places on the path, in a scrambled order; row 5 is left empty.
fn bumps(n: usize, d: usize, reach: usize) -> SparseMatrix<f32> {
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for i in 0..n {
        for c in 0..d {
            let centre = ((c * 7) % d) * n / d;
            if i.abs_diff(centre) <= reach && i != 5 {
                indices.push(c as u32);
                values.push(1.0 / (1.0 + i.abs_diff(centre) as f32));
            }
        }
        offsets.push(indices.len());
    }
    SparseMatrix::new(n, d, offsets, indices, values).unwrap()
}

fn naive(u: &SparseMatrix<f32>, a: &SparseMatrix) -> Vec<f64> {
    let (u, a) = (u.to_dense(), a.to_dense());
    let (n, d) = (u.rows(), u.columns());
    let mut result = vec![0.0; d * d];
    for p in 0..d {
        for q in 0..d {
            for i in 0..n {
                for j in i.saturating_sub(1)..n.min(i + 2) {
                    result[p * d + q] += u.column(p)[i] * a.column(j)[i] * u.column(q)[j];
                }
            }
        }
    }
    result
}

fn diagonal(m: &[f64]) -> SparseMatrix {
    let n = m.len();
    SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), m.to_vec()).unwrap()
}

#[test]
fn both_ways_agree_with_the_definition() {
    for (n, d, reach) in [(40, 9, 4), (700, 10, 60), (60, 59, 0), (30, 12, 30)] {
        for consistent in [false, true] {
            let (s, m) = path(n, consistent);
            let u = bumps(n, d, reach);
            let mass = m.sparse().cloned().unwrap_or_else(|| diagonal(&m.lumped()));
            let expected = [naive(&u, &s), naive(&u, &mass)];
            let ways = [galerkin(&u, &s, &m, &Unwatched).unwrap(), row_wise(&u, &s, &m, &Unwatched).unwrap()];
            for (a, b) in ways {
                for (found, expected) in [a, b].iter().zip(&expected) {
                    SparseMatrix::new(
                        d,
                        d,
                        found.offsets().to_vec(),
                        found.indices().to_vec(),
                        found.values().to_vec(),
                    )
                    .unwrap();
                    let dense = found.to_dense();
                    for p in 0..d {
                        for q in 0..d {
                            assert!((dense.column(q)[p] - expected[p * d + q]).abs() < 1e-10, "{n} {d} {p} {q}");
                            assert_eq!(dense.column(q)[p], dense.column(p)[q]);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_space_of_functions_that_reach_everywhere_takes_the_row_wise_way() {
    let (s, m) = path(300, false);
    let u = bumps(300, 200, 300);
    let cells = Cells::new(&u);
    // 200 cells of 200 × 200 in two matrices are beyond what 60,000 entries explain.
    assert!(cell_products(&u, &s, &m, &cells, &Unwatched).unwrap().is_none());
    let (found, _) = galerkin(&u, &s, &m, &Unwatched).unwrap();
    assert_eq!(found, row_wise(&u, &s, &m, &Unwatched).unwrap().0);
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let (s, m) = path(5000, true);
    let u = bumps(5000, 37, 300);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| galerkin(&u, &s, &m, &Unwatched).unwrap())
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn sizes_that_do_not_fit_are_refused() {
    let (s, m) = path(10, false);
    let found = galerkin(&bumps(9, 3, 2), &s, &m, &Unwatched);
    assert_eq!(found.unwrap_err(), GalerkinError::Shape { space: 9, stiffness: 10, mass: 10 });
}

#[test]
fn cancelling_ends_the_work() {
    struct Cancelling;
    impl Monitor for Cancelling {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }
    let (s, m) = path(40, false);
    let found = galerkin(&bumps(40, 5, 8), &s, &m, &Cancelling);
    assert_eq!(found.unwrap_err(), GalerkinError::Cancelled(Cancelled));
}

#[test]
fn a_stiff_edge_adds_what_functions_differ_by_and_nothing_where_they_do_not() {
    let n = 40;
    let (s, m) = path(n, false);
    let stiff = 1e12;
    let mut values = s.values().to_vec();
    for (row, column, value) in [(10, 11, -stiff), (11, 10, -stiff), (10, 10, stiff), (11, 11, stiff)] {
        values[s.offsets()[row] + s.row(row).0.binary_search(&column).unwrap()] += value;
    }
    let s = SparseMatrix::new(n, n, s.offsets().to_vec(), s.indices().to_vec(), values).unwrap();
    // A constant, and a slope that is small enough at the stiff edge.
    let slope = |i: usize| 0.7 + 1e-6 * i as f32;
    let rows = (0..n).flat_map(|i| [0.7, slope(i)]).collect();
    let u = SparseMatrix::new(n, 2, (0..=n).map(|i| 2 * i).collect(), [0, 1].repeat(n), rows).unwrap();
    let (s_bar, _) = galerkin(&u, &s, &m, &Unwatched).unwrap();
    let difference = |i: usize| f64::from(slope(i + 1)) - f64::from(slope(i));
    let expected: f64 = (0..n - 1).map(|i| difference(i).powi(2) * if i == 10 { 1.0 + stiff } else { 1.0 }).sum();
    let found = s_bar.to_dense();
    assert!((found.column(1)[1] / expected - 1.0).abs() < 1e-8, "{} instead of {expected}", found.column(1)[1]);
    assert!(found.column(0)[0].abs() < 1e-20 && found.column(1)[0].abs() < 1e-8, "{:?}", found.values());
}
