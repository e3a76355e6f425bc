//! Bases as they come are confirmed, and none of a thousand that were tampered with.

use super::*;
use crate::basis::{Certificate, DenseFunctions, InertiaCount};
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble};
use crate::spectrum::hsim::{HsimParameters, Selection, solve};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::{Shape, generate};

fn operator(shape: Shape, vertices: usize, mass: MassKind, boundary: Boundary) -> MeshOperator {
    let mesh = generate(shape, vertices).unwrap();
    assemble(&mesh, &OperatorParameters { operator: OperatorKind::Auto, mass, boundary }, &Unwatched).unwrap()
}

fn basis(shape: Shape, operator: &MeshOperator, vertices: usize, selection: Selection, precision: Precision) -> Basis {
    let mesh = generate(shape, vertices).unwrap();
    let tolerance = if precision == Precision::F32 { 1e-3 } else { 1e-8 };
    let parameters = HsimParameters { selection, tolerance, ..HsimParameters::default() };
    let pairs = solve(&mesh, &operator.problem, &parameters, false, &Unwatched).unwrap();
    Basis {
        functions: Functions::Dense(DenseFunctions::from_panels(pairs.vectors, precision)),
        eigenvalues: pairs.values,
        mass: operator.laplacian().mass.scaled(operator.problem.area),
        certificate: Certificate {
            residuals: pairs.residuals,
            bounds: pairs.bounds,
            orthonormality_defect: pairs.orthonormality_defect,
            complete: Some(true),
            inertia: pairs.inertia,
            tolerance: Some(tolerance),
            ..Certificate::default()
        },
        metadata: serde_json::Value::Null.into(),
    }
}

#[test]
fn what_the_solver_delivers_is_confirmed() {
    for (shape, mass, boundary, wanted, precision) in [
        (Shape::Sphere, MassKind::Barycentric, Boundary::Neumann, Selection::Count(50), Precision::F64),
        // 50 cuts a group of equal values, 49 does not.
        (Shape::Sphere, MassKind::Consistent, Boundary::Neumann, Selection::Count(49), Precision::F64),
        (Shape::Disk, MassKind::Barycentric, Boundary::Dirichlet, Selection::Count(30), Precision::F64),
        (Shape::Torus, MassKind::Voronoi, Boundary::Neumann, Selection::Count(40), Precision::F32),
        (
            Shape::Rectangle,
            MassKind::Barycentric,
            Boundary::Neumann,
            Selection::Below { bound: 300.0, most: 200 },
            Precision::F64,
        ),
    ] {
        let operator = operator(shape, 2_000, mass, boundary);
        let basis = basis(shape, &operator, 2_000, wanted, precision);
        let found = verify(&basis, &operator, &Unwatched).unwrap();
        assert_eq!(found.findings, Vec::new(), "{shape} {mass:?} {boundary:?}");
        let proven = found.proven.unwrap();
        assert!(proven + 12 > basis.count(), "{shape}: {proven} of {}", basis.count());
    }
}

#[test]
fn a_bound_below_the_rounding_of_one_operation_is_refuted() {
    let operator = operator(Shape::Knot, 600, MassKind::Barycentric, Boundary::Neumann);
    let mut basis = basis(Shape::Knot, &operator, 600, Selection::Count(20), Precision::F64);
    basis.certificate.bounds.iter_mut().for_each(|bound| *bound = 0.0);
    let findings = verify(&basis, &operator, &Unwatched).unwrap().findings;
    assert!(findings.iter().any(|finding| matches!(finding, Finding::Bound { pair: 19, .. })), "{findings:?}");
}

/// Another file of the same shape: a thousand of them, all with something that is not true.
#[test]
fn none_of_a_thousand_altered_bases_is_confirmed() {
    let operator = operator(Shape::Knot, 600, MassKind::Barycentric, Boundary::Neumann);
    let original = basis(Shape::Knot, &operator, 600, Selection::Count(20), Precision::F64);
    assert_eq!(verify(&original, &operator, &Unwatched).unwrap().findings, Vec::new());
    let columns = original.lift::<f64>(0..20).unwrap();
    let mut random = SplitMix64::new(7);
    for number in 0..1000u32 {
        let mut below = |most: usize| ((0.5 + 0.5 * random.signed_unit()) * most as f64) as usize % most;
        let (mut altered, mut functions) = (original.clone(), columns.clone());
        let (pair, other) = (1 + below(19), below(600));
        let kind = number % 16;
        let what = match kind {
            0 => {
                altered.eigenvalues[pair] *= 1.0 + 1e-6;
                "a value is a millionth larger"
            }
            1 => {
                functions[pair * 600 + other] += 1e-4;
                "a function differs at a vertex"
            }
            2 => {
                let next = 1 + pair % 19;
                let (a, b) = (pair.min(next), pair.max(next));
                if a == b || original.eigenvalues[b] / original.eigenvalues[a] < 1.0 + 1e-6 {
                    continue;
                }
                for row in 0..600 {
                    functions.swap(a * 600 + row, b * 600 + row);
                }
                "two functions are exchanged"
            }
            3 => {
                // A pair is left out, and what follows moves up; the certificate is made to fit. Without the last the
                // others are still the lowest.
                let pair = 1 + (pair - 1) % 18;
                altered.eigenvalues.remove(pair);
                altered.certificate.residuals.remove(pair);
                altered.certificate.bounds.remove(pair);
                functions.drain(pair * 600..(pair + 1) * 600);
                "a pair is missing"
            }
            4 => {
                altered.certificate.inertia.iter_mut().for_each(|count| count.below += 1);
                "the counts are one too high"
            }
            5 => {
                altered.certificate.inertia.clear();
                "there are no counts"
            }
            6 => {
                altered.certificate.residuals[pair] += 1e-6;
                "a residual is another"
            }
            7 => {
                altered.certificate.bounds[pair] = -1.0;
                "a bound is negative"
            }
            8 => {
                if let MassMatrix::Diagonal(mass) = &mut altered.mass {
                    mass[other] *= 1.0 + 1e-6;
                }
                "a mass is a millionth larger"
            }
            9 => {
                functions[pair * 600..(pair + 1) * 600].iter_mut().for_each(|x| *x *= 1.0 + 1e-6);
                "a function is a millionth longer"
            }
            10 => {
                for row in 0..600 {
                    functions[pair * 600 + row] = columns[(pair - 1) * 600 + row];
                }
                "a function is there twice"
            }
            11 => {
                functions[pair * 600 + other] = f64::NAN;
                "a function is no number at a vertex"
            }
            12 => {
                altered.certificate.tolerance = Some(1e-30);
                "the tolerance is one that nothing meets"
            }
            13 => {
                altered.eigenvalues.swap(pair - 1, pair);
                if altered.eigenvalues[pair - 1] <= altered.eigenvalues[pair] {
                    continue;
                }
                "values are not in order"
            }
            14 => {
                // One more than lies below that shift.
                let shift = 0.5 * (original.eigenvalues[18] + original.eigenvalues[19]);
                altered.certificate.inertia = vec![InertiaCount { shift, below: 20 }];
                "a count is invented"
            }
            _ => {
                altered.certificate.bounds.pop();
                "a bound is missing"
            }
        };
        let count = altered.eigenvalues.len();
        let matrix = DenseMatrix::from_columns(600, count, functions);
        altered.functions = Functions::Dense(DenseFunctions::from_columns(&matrix, Precision::F64));
        let found = verify(&altered, &operator, &Unwatched).unwrap();
        assert!(!found.findings.is_empty(), "{number}, pair {pair}: {what}, and nobody noticed");
    }
}

#[test]
fn a_basis_of_another_mesh_or_operator_is_found_out() {
    let of_a_sphere = operator(Shape::Sphere, 800, MassKind::Barycentric, Boundary::Neumann);
    let basis = basis(Shape::Sphere, &of_a_sphere, 800, Selection::Count(10), Precision::F64);
    let larger = operator(Shape::Sphere, 2_000, MassKind::Barycentric, Boundary::Neumann);
    let found = verify(&basis, &larger, &Unwatched).unwrap();
    assert!(matches!(found.findings[0], Finding::Shape(_)), "{:?}", found.findings);
    let consistent = operator(Shape::Sphere, 800, MassKind::Consistent, Boundary::Neumann);
    assert!(!verify(&basis, &consistent, &Unwatched).unwrap().findings.is_empty());
}

/// What counts of the solver lie above is often one eigenvalue more than is delivered. That hides no pair that is
/// missing next to the last.
#[test]
fn no_pair_next_to_the_last_may_be_missing_or_another() {
    let operator = operator(Shape::Knot, 600, MassKind::Barycentric, Boundary::Neumann);
    let of = |count: usize| basis(Shape::Knot, &operator, 600, Selection::Count(count), Precision::F64);
    for count in 1..30 {
        let (original, more) = (of(count), of(count + 2));
        let found = verify(&original, &operator, &Unwatched).unwrap();
        assert_eq!(found.findings, Vec::new(), "{count} pairs");
        let functions = more.lift::<f64>(0..count + 2).unwrap();
        let apart = |a: usize, b: usize| more.eigenvalues[b] > (1.0 + 1e-6) * more.eigenvalues[a].max(1e-3);
        // The pairs that are left, those of values that are told apart.
        let choices = (0..count).rev().take(3).map(|gone| (gone, count)).filter(|&(gone, last)| apart(gone, last));
        for (gone, last) in choices {
            let left: Vec<usize> = (0..=last).filter(|&pair| pair != gone).collect();
            let mut altered = original.clone();
            altered.eigenvalues = left.iter().map(|&pair| more.eigenvalues[pair]).collect();
            altered.certificate.residuals = left.iter().map(|&pair| more.certificate.residuals[pair]).collect();
            altered.certificate.bounds = left.iter().map(|&pair| more.certificate.bounds[pair]).collect();
            let columns = left.iter().flat_map(|&pair| functions[pair * 600..(pair + 1) * 600].to_vec()).collect();
            let matrix = DenseMatrix::from_columns(600, count, columns);
            altered.functions = Functions::Dense(DenseFunctions::from_columns(&matrix, Precision::F64));
            let found = verify(&altered, &operator, &Unwatched).unwrap();
            assert!(!found.findings.is_empty(), "{count} pairs, and {gone} is missing");
        }
    }
}
