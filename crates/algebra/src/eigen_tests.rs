use chladni_base::Unwatched;

use super::*;

fn random_matrix(n: usize, seed: u64) -> DenseMatrix {
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    DenseMatrix::from_columns(n, n, (0..n * n).map(|_| random()).collect())
}

fn product(a: &DenseMatrix, b: &DenseMatrix) -> DenseMatrix {
    let mut c = DenseMatrix::zeros(a.rows(), b.columns());
    for j in 0..b.columns() {
        for (k, &factor) in b.column(j).iter().enumerate() {
            c.column_mut(j).iter_mut().zip(a.column(k)).for_each(|(c, a)| *c += factor * a);
        }
    }
    c
}

fn transpose(a: &DenseMatrix) -> DenseMatrix {
    let values = (0..a.rows()).flat_map(|r| (0..a.columns()).map(move |c| a.column(c)[r])).collect();
    DenseMatrix::from_columns(a.columns(), a.rows(), values)
}

fn symmetric(n: usize, seed: u64) -> DenseMatrix {
    let mut a = random_matrix(n, seed);
    let t = transpose(&a);
    a.values_mut().iter_mut().zip(t.values()).for_each(|(a, t)| *a += t);
    a
}

fn definite(n: usize, seed: u64) -> DenseMatrix {
    let r = random_matrix(n, seed);
    let mut b = product(&transpose(&r), &r);
    (0..n).for_each(|k| b.column_mut(k)[k] += 0.5 + k as f64);
    b
}

fn check(a: &DenseMatrix, b: &DenseMatrix, count: usize, tolerance: f64) -> EigenPairs {
    let pairs = CpuSolver.lowest(a.clone(), b.clone(), count, &Unwatched).unwrap();
    let x = &pairs.vectors;
    assert_eq!((pairs.values.len(), x.rows(), x.columns()), (count, a.rows(), count));
    assert!(pairs.values.windows(2).all(|w| w[0] <= w[1]));
    let (ax, bx) = (product(a, x), product(b, x));
    let scale = a.values().iter().fold(1e-300, |m: f64, v| m.max(v.abs()));
    for k in 0..count {
        for (ax, bx) in ax.column(k).iter().zip(bx.column(k)) {
            assert!((ax - pairs.values[k] * bx).abs() < tolerance * scale);
        }
        let largest = x.column(k).iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
        assert!(largest > 0.0);
    }
    let gram = product(&transpose(x), &bx);
    for i in 0..count {
        for j in 0..count {
            assert!((gram.column(j)[i] - f64::from(u8::from(i == j))).abs() < tolerance);
        }
    }
    pairs
}

#[test]
fn pairs_of_random_pencils_of_many_sizes_satisfy_the_definition() {
    for n in [1, 2, 3, 4, 5, 8, 16, 31, 63, 64, 65, 100, 150, 300] {
        let (a, b) = (symmetric(n, n as u64), definite(n, 1000 + n as u64));
        for count in [1, n / 2, n] {
            check(&a, &b, count.max(1), 1e-10);
        }
    }
}

#[test]
fn only_the_lower_triangles_are_read() {
    let (mut a, mut b) = (symmetric(90, 1), definite(90, 2));
    let reference = CpuSolver.lowest(a.clone(), b.clone(), 40, &Unwatched).unwrap();
    for column in 0..90 {
        a.column_mut(column)[..column].fill(f64::NAN);
        b.column_mut(column)[..column].fill(f64::NAN);
    }
    assert_eq!(CpuSolver.lowest(a, b, 40, &Unwatched).unwrap(), reference);
}

#[test]
fn a_chain_of_springs_has_its_analytic_frequencies() {
    let n = 200;
    let (mut a, mut b) = (DenseMatrix::zeros(n, n), DenseMatrix::zeros(n, n));
    for k in 0..n {
        a.column_mut(k)[k] = 2.0;
        b.column_mut(k)[k] = 3.0;
        if k + 1 < n {
            a.column_mut(k)[k + 1] = -1.0;
            a.column_mut(k + 1)[k] = -1.0;
        }
    }
    let pairs = check(&a, &b, 100, 1e-12);
    for (k, value) in pairs.values.iter().enumerate() {
        let half = std::f64::consts::PI * (k + 1) as f64 / (2.0 * (n + 1) as f64);
        assert!((value - 4.0 * half.sin().powi(2) / 3.0).abs() < 1e-13);
    }
}

#[test]
fn clustered_and_equal_eigenvalues_get_orthonormal_vectors() {
    for n in [7, 140] {
        let zero = DenseMatrix::zeros(n, n);
        let pairs = check(&zero, &definite(n, 3), n, 1e-12);
        assert!(pairs.values.iter().all(|v| v.abs() < 1e-14));
        // The pencil (B, B) has the eigenvalue one alone.
        let b = definite(n, 4);
        let pairs = check(&b, &b, n / 2, 1e-11);
        assert!(pairs.values.iter().all(|v| (v - 1.0).abs() < 1e-11));
    }
}

#[test]
fn magnitudes_far_from_one_do_no_harm() {
    for scale in [1e-200, 1e-30, 1e30, 1e200] {
        let (mut a, b) = (symmetric(40, 5), definite(40, 6));
        let reference = CpuSolver.lowest(a.clone(), b.clone(), 20, &Unwatched).unwrap();
        a.values_mut().iter_mut().for_each(|x| *x *= scale);
        let scaled = CpuSolver.lowest(a, b, 20, &Unwatched).unwrap();
        for (x, y) in scaled.values.iter().zip(&reference.values) {
            assert!((x / scale - y).abs() < 1e-12);
        }
    }
}

#[test]
fn errors_name_what_is_wrong() {
    let solve = |a, b, count| CpuSolver.lowest(a, b, count, &Unwatched).unwrap_err();
    let (a, b) = (symmetric(6, 7), definite(6, 8));
    assert_eq!(solve(a.clone(), definite(5, 8), 1), EigenError::Shape { a: (6, 6), b: (5, 5) });
    assert_eq!(solve(a.clone(), b.clone(), 7), EigenError::Count { count: 7, size: 6 });
    let mut bad = a.clone();
    bad.column_mut(2)[4] = f64::NAN;
    assert_eq!(solve(bad, b.clone(), 2).to_string(), "entry (4, 2) of A is not finite");
    let mut bad = b.clone();
    bad.column_mut(3)[3] = 0.0;
    assert_eq!(solve(a.clone(), bad, 2), EigenError::NotPositiveDefinite { pivot: 3 });
    // Two equal rows: indefinite by rounding at most, and by construction below.
    let mut bad = b;
    for k in 0..6 {
        let value = bad.column(0)[k];
        bad.column_mut(1)[k] = value;
        bad.column_mut(k)[1] = value;
    }
    bad.column_mut(1)[1] = 0.5 * bad.column(0)[0];
    assert_eq!(solve(a, bad, 2), EigenError::NotPositiveDefinite { pivot: 1 });
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    for n in [300, 701] {
        let (a, b) = (symmetric(n, 9), diagonal_dominant(n));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| CpuSolver.lowest(a.clone(), b.clone(), n / 2, &Unwatched).unwrap())
        };
        let one = on(1);
        for threads in [2, 3] {
            let more = on(threads);
            assert_eq!(one.values, more.values, "size {n}, {threads} threads");
            assert!(one.vectors == more.vectors, "size {n}, {threads} threads");
        }
    }
}

fn diagonal_dominant(n: usize) -> DenseMatrix {
    let mut b = symmetric(n, 10);
    (0..n).for_each(|k| b.column_mut(k)[k] += 2.0 * n as f64);
    b
}
