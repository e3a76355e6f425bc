use super::super::attempt::Attempt;
use super::*;
use chladni_algebra::{ComputedOn, CpuSolver};
use chladni_base::Unwatched;

/// A pencil with the values 0, 1, …, 29 and one of 10^17, whose column overlaps with all others.
fn pencil() -> (SparseMatrix, SparseMatrix) {
    let d = 31;
    let value = |k: usize| if k + 1 == d { 1e17 } else { k as f64 };
    // `TᵀΛT` and `TᵀT`, where `T` adds shares of the last column to the others.
    let share = |k: usize| if k + 1 == d { 1.0 } else { 0.1 + 0.02 * k as f64 };
    let of = |weight: &(dyn Fn(usize) -> f64 + Sync)| {
        SparseMatrix::from_rows(
            d,
            d,
            || (),
            |(), row, entries| {
                if row + 1 == d {
                    entries.extend((0..d - 1).map(|k| (k as u32, weight(k) * share(k))));
                    let sum: f64 = (0..d - 1).map(|k| weight(k) * share(k) * share(k)).sum();
                    entries.push((row as u32, weight(row) + sum));
                } else {
                    entries.push((row as u32, weight(row)));
                    entries.push((d as u32 - 1, weight(row) * share(row)));
                }
            },
        )
    };
    (of(&value), of(&|_| 1.0))
}

#[test]
fn wanted_values_do_not_drown_in_the_rounding_errors_of_the_largest() {
    let (stiffness, mass) = pencil();
    let direct = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), 20, &Unwatched).unwrap();
    let worst = |values: &[f64]| values.iter().zip(0..).map(|(v, k)| (v - f64::from(k)).abs()).fold(0.0, f64::max);
    assert!(worst(&direct.values) > 1e-3, "the case is no case: {:?}", direct.values);
    assert!(lost_in_rounding(&stiffness, &mass, &direct));
    let found = reversed(&CpuSolver, &stiffness, &mass, &direct, &Unwatched).unwrap();
    assert!(worst(&found.values) < 1e-9, "{:?}", found.values);
    let x = &found.vectors;
    let products = |matrix: &SparseMatrix| x.transposed_times(&matrix.multiply_dense(x));
    let (gram, energy) = (products(&mass), products(&stiffness));
    for i in 0..20 {
        for j in 0..20 {
            let expected = f64::from(u8::from(i == j));
            assert!((gram.column(j)[i] - expected).abs() < 1e-10, "{i} {j}: {}", gram.column(j)[i]);
            assert!((energy.column(j)[i] - expected * i as f64).abs() < 1e-6, "{i} {j}: {}", energy.column(j)[i]);
        }
    }
    // A pencil without such a column is solved as it is.
    let (few, of_few) = (stiffness.select_rows(&[0, 1, 2]), mass.select_rows(&[0, 1, 2]));
    let fair = EigenPairs { values: vec![0.0, 1.0, 2.0], ..found };
    assert!(!lost_in_rounding(&few, &of_few, &fair));
}

#[test]
fn what_drowns_beside_values_far_below_zero_is_solved_for_the_other_way_too() {
    let (stiffness, mass) = pencil();
    // The values are -2000, -1999, …: the lowest lies much farther from zero than the last that is wanted.
    let (shift, wanted) = (2000.0, 20);
    let lowered = SparseMatrix::from_rows(
        31,
        31,
        || (),
        |(), row, entries| {
            let (columns, values) = stiffness.row(row);
            let masses: Vec<f64> = columns
                .iter()
                .map(|column| mass.row(row).0.binary_search(column).map_or(0.0, |at| mass.row(row).1[at]))
                .collect();
            entries.extend(columns.iter().zip(values).zip(masses).map(|((&c, s), m)| (c, s - shift * m)));
        },
    );
    let rough = EigenPairs {
        values: (0..wanted).map(|k| if k == 19 { -3.0 } else { k as f64 - shift }).collect(),
        vectors: chladni_algebra::DenseMatrix::zeros(31, wanted),
        computed_on: ComputedOn::default(),
    };
    let found = reversed(&CpuSolver, &lowered, &mass, &rough, &Unwatched).unwrap();
    for (k, value) in found.values.iter().enumerate() {
        assert!((value - (k as f64 - shift)).abs() < 1e-6, "{k}: {value}");
    }
}

#[test]
fn what_has_drowned_is_no_result_where_it_cannot_be_solved_for_either_way() {
    let diagonal =
        |values: [f64; 3]| SparseMatrix::from_sorted_parts(3, 3, vec![0, 1, 2, 3], vec![0, 1, 2], values.to_vec());
    let pairs = |values: Vec<f64>| {
        let vectors = chladni_algebra::DenseMatrix::zeros(3, values.len());
        EigenPairs { values, vectors, computed_on: ComputedOn::default() }
    };
    // All that is wanted is zero, and one column weighs much.
    let (stiffness, mass) = (diagonal([0.0, 0.0, 1e17]), diagonal([1.0, 2.0, 1.0]));
    let zeros = pairs(vec![3.0, -5.0]);
    assert!(lost_in_rounding(&stiffness, &mass, &pairs(vec![0.0, 0.0])));
    let found = reversed(&CpuSolver, &stiffness, &mass, &zeros, &Unwatched).unwrap();
    assert!(found.values.iter().all(|value| value.abs() < 1e-12), "{:?}", found.values);
    let wrong = diagonal([1.0, -2.0, 1.0]);
    let error = reversed(&CpuSolver, &stiffness, &wrong, &zeros, &Unwatched).unwrap_err();
    assert!(matches!(error, EigenError::NotPositiveDefinite { .. }), "{error}");
}

#[test]
fn a_value_below_all_that_are_possible_is_no_result() {
    let nothing = || SparseMatrix::from_sorted_parts(0, 0, vec![0], Vec::new(), Vec::new());
    let attempt = |values: Vec<f64>| {
        let vectors = chladni_algebra::DenseMatrix::zeros(0, values.len());
        let pairs = EigenPairs { values, vectors, computed_on: ComputedOn::default() };
        let space = SparseMatrix::from_sorted_parts(0, 0, vec![0], Vec::new(), Vec::new());
        let mut attempt = Attempt::new(Ritz { space, mass: nothing(), stiffness: nothing(), pairs }, 2, 2);
        attempt.certificate.estimates = vec![0.01; 2];
        attempt.certificate.bounds = vec![0.1; 2];
        attempt.summarise(0.0, 1.0);
        attempt
    };
    let wrong = attempt(vec![-4.0, 7.0]);
    assert_eq!((wrong.certificate.estimates[0], wrong.certificate.bounds[0]), (f64::INFINITY, 0.1));
    assert_eq!(wrong.largest_estimate, f64::INFINITY);
    let error = wrong.possible(0.0, 2.0).unwrap_err();
    assert_eq!(error.kind(), "restriction-failed");
    assert!(error.to_string().contains("a value of -2.000e0 came out, and none can lie below 0.000e0"), "{error}");
    // What rounding leaves of zero is possible, and so is what a potential allows.
    assert!(attempt(vec![-1e-9, 7.0]).possible(0.0, 1.0).is_ok());
    assert!(attempt(vec![-1e-15, 1e-14]).possible(0.0, 1.0).is_ok());
    assert!(wrong.possible(5.0, 1.0).is_ok());
}
