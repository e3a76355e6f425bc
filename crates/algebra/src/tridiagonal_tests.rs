use super::*;

/// A symmetric matrix from its entries on and below the diagonal.
fn symmetric(d: usize, entry: impl Fn(usize, usize) -> f64) -> DenseMatrix {
    let values = (0..d * d).map(|k| entry((k / d).max(k % d), (k / d).min(k % d))).collect();
    DenseMatrix::from_columns(d, d, values)
}

fn random(row: usize, column: usize) -> f64 {
    let mut state = (row * 65_537 + column) as u64 + 1;
    for _ in 0..3 {
        state = (state ^ (state >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn identity(d: usize) -> DenseMatrix {
    symmetric(d, |row, column| f64::from(u8::from(row == column)))
}

fn norm(values: &[f64]) -> f64 {
    let most = values.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if most == 0.0 { 0.0 } else { most * values.iter().map(|x| (x / most).powi(2)).sum::<f64>().sqrt() }
}

/// `A Q = Q T` and `QᵀQ = 1`, each relative to the size of what is on its sides.
fn check(a: &DenseMatrix, reduced: &Tridiagonal, case: &str) {
    let d = a.rows();
    let mut q = identity(d);
    reduced.back(&mut q, Par::Seq).unwrap();
    let t = symmetric(d, |row, column| match row - column {
        0 => reduced.diagonal[row],
        1 => reduced.off_diagonal[column],
        _ => 0.0,
    });
    let (mut left, right) = (a.times(&q), q.times(&t));
    left.values_mut().iter_mut().zip(right.values()).for_each(|(x, y)| *x -= y);
    let residual = norm(left.values()) / norm(a.values()).max(f64::MIN_POSITIVE);
    assert!(residual < 1e-13, "{case} of size {d}: residual {residual:e}");
    let mut gram = q.transposed_times(&q);
    (0..d).for_each(|k| gram.column_mut(k)[k] -= 1.0);
    assert!(gram.values().iter().all(|x| x.abs() < 1e-13), "{case} of size {d}: not orthogonal");
}

fn unwatched(_: f64) -> Result<(), Cancelled> {
    Ok(())
}

#[test]
fn both_ways_are_backward_stable_at_all_sizes() {
    for d in (0..=70).chain([95, 96, 97, 128, 203, 300]) {
        let a = symmetric(d, random);
        check(&a, &by_panels(a.clone(), &unwatched).unwrap(), "by panels");
        check(&a, &by_columns(a.clone()).unwrap(), "by columns");
    }
    let d = LEAST_BLOCKED + 19;
    let a = symmetric(d, random);
    check(&a, &tridiagonalise(a.clone(), &unwatched).unwrap(), "large");
}

#[test]
fn multiple_clustered_graded_and_extreme_matrices_are_reduced_as_stably() {
    type Case<'a> = (&'a str, &'a dyn Fn(usize, usize) -> f64);
    let d = 131;
    // A reflection has the eigenvalues one and minus one alone; a power of it adds clusters.
    let direction = |k: usize| random(k, 7) / 7.0;
    let length: f64 = (0..d).map(|k| direction(k).powi(2)).sum();
    let equal = |row: usize, column: usize| f64::from(u8::from(row == column));
    let mirror = |row: usize, column: usize| equal(row, column) - 2.0 * direction(row) * direction(column) / length;
    let cases: [Case<'_>; 14] = [
        ("zero", &|_, _| 0.0),
        ("identity", &equal),
        ("ones", &|_, _| 1.0),
        ("diagonal", &|row, column| random(row, row) * equal(row, column)),
        ("tridiagonal", &|row, column| if row - column < 2 { random(row, column) } else { 0.0 }),
        ("arrow", &|row, column| if column == 0 || row == column { random(row, column) } else { 0.0 }),
        ("last row", &|row, _| if row == d - 1 { 1.0 } else { 0.0 }),
        ("reflection", &mirror),
        ("cluster", &|row, column| mirror(row, column) + 1e-9 * random(row, column)),
        ("blocks", &|row, column| if row / 9 == column / 9 { random(row % 9, column % 9) } else { 0.0 }),
        ("graded down", &|row, column| random(row, column) * 10f64.powi(-((row + column) as i32))),
        ("graded up", &|row, column| random(row, column) * 10f64.powi((row + column) as i32 - 260)),
        ("tiny", &|row, column| 1e-170 * random(row, column)),
        ("huge", &|row, column| 1e170 * random(row, column)),
    ];
    for (name, entry) in cases {
        let a = symmetric(d, entry);
        check(&a, &by_panels(a.clone(), &unwatched).unwrap(), name);
    }
}

#[test]
fn only_the_lower_triangle_is_read() {
    let d = 150;
    let mut a = symmetric(d, random);
    let whole = by_panels(a.clone(), &unwatched).unwrap();
    for column in 0..d {
        a.column_mut(column)[..column].fill(f64::NAN);
    }
    let lower = by_panels(a, &unwatched).unwrap();
    assert_eq!((whole.diagonal, whole.off_diagonal), (lower.diagonal, lower.off_diagonal));
    assert_eq!(whole.factors, lower.factors);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let d = 1100;
    let a = symmetric(d, random);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| by_panels(a.clone(), &unwatched).unwrap())
    };
    let (one, three) = (on(1), on(3));
    assert_eq!((one.diagonal, one.off_diagonal), (three.diagonal, three.off_diagonal));
    assert!(one.factors == three.factors && one.reflectors == three.reflectors);
}

#[test]
fn work_ends_when_it_is_told_to() {
    let stop = |done| if done > 0.5 { Err(Cancelled) } else { Ok(()) };
    assert!(matches!(by_panels(symmetric(200, random), &stop), Err(EigenError::Cancelled(_))));
}

/// `cargo test --release --lib tridiagonal -- --ignored --nocapture`, in a pool of one thread and one of all; not a
/// promise but a measurement, on which `LEAST_BLOCKED` and docs/decisions/0021 stand.
#[test]
#[ignore = "measures"]
fn seconds_of_both_ways() {
    let least = |run: &dyn Fn()| {
        let seconds = (0..3).map(|_| {
            let began = std::time::Instant::now();
            run();
            began.elapsed().as_secs_f64()
        });
        seconds.fold(f64::INFINITY, f64::min)
    };
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for d in [216, 350, 500, 700, 1000, 2000, 5000] {
            let a = symmetric(d, random);
            let par = if threads == 1 { Par::Seq } else { Par::rayon(threads) };
            let panels = least(&|| drop(pool.install(|| by_panels(a.clone(), &unwatched))));
            let columns = least(&|| drop(pool.install(|| by_columns_on(a.clone(), par))));
            println!("{threads} threads, d = {d}: panels {panels:.4} s, faer's {columns:.4} s");
        }
    }
}
