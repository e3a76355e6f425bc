use super::super::{Goal, Space};
use super::*;
use crate::basis::Functions;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, Potential, assemble};
use crate::spectrum::heat::HeatParameters;
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

fn parameters() -> ApproximationParameters {
    ApproximationParameters {
        count: 12,
        dimension: 40,
        space: Space::Heat(HeatParameters::default()),
        goal: Some(Goal { error: 0.2, rounds: 3 }),
        certify: false,
        seed: 4,
    }
}

fn two(one: TriangleMesh, mut other: TriangleMesh) -> TriangleMesh {
    let mut mesh = one;
    let first = mesh.positions.len() as u32;
    other.positions.iter_mut().for_each(|p| p[0] += 7.0);
    mesh.positions.extend(other.positions);
    mesh.faces.extend(other.faces.iter().map(|face| face.map(|v| v + first)));
    mesh
}

fn cases() -> Vec<(&'static str, TriangleMesh, OperatorParameters)> {
    let dirichlet = OperatorParameters { boundary: Boundary::Dirichlet, ..OperatorParameters::default() };
    let voronoi = OperatorParameters { mass: MassKind::Voronoi, ..OperatorParameters::default() };
    let genus = || generate(Shape::Genus(2), 2600).unwrap();
    vec![
        ("closed", genus(), OperatorParameters::default()),
        ("voronoi", genus(), voronoi),
        ("bordered", generate(Shape::Disk, 2800).unwrap(), OperatorParameters::default()),
        ("held", generate(Shape::Disk, 2800).unwrap(), dirichlet),
        (
            "two",
            two(generate(Shape::Torus, 1500).unwrap(), generate(Shape::Sphere, 1500).unwrap()),
            OperatorParameters::default(),
        ),
    ]
}

fn made(parted: &Parted<'_>) -> Vec<Part> {
    (0..parted.plan().parts).map(|number| parted.solve(number).unwrap()).collect()
}

fn compact(basis: &Basis) -> &crate::basis::Compact {
    match &basis.functions {
        Functions::Compact(compact) => compact,
        Functions::Dense(_) => panic!("a compact basis"),
    }
}

#[test]
fn parts_make_the_pairs_of_the_whole_whatever_their_number() {
    for (name, mesh, of) in cases() {
        let operator = assemble(&mesh, &of, &Unwatched).unwrap();
        let whole = approximate(&mesh, &operator, &parameters(), &Unwatched).unwrap();
        for parts in [1, 2, 3, 5, 8] {
            let parted = Parted::new(&mesh, &operator, &parameters(), Some(parts), "1", &Unwatched).unwrap();
            let made = made(&parted);
            let joined = parted.join(&mut |number| Ok(made[number].clone())).unwrap();
            assert_eq!(compact(&joined).space, compact(&whole).space, "{name} {parts}");
            for (a, b) in joined.eigenvalues.iter().zip(&whole.eigenvalues) {
                assert!((a - b).abs() <= 1e-9 * whole.eigenvalues[1].max(b.abs()), "{name} {parts}: {a} and {b}");
            }
            let (found, expected) = (&joined.certificate, &whole.certificate);
            let kernel = whole.eigenvalues.iter().filter(|value| **value == 0.0).count();
            for k in kernel..12 {
                let ratio = |a: &[f64], b: &[f64]| a[k] / b[k];
                assert!((ratio(&found.residuals, &expected.residuals) - 1.0).abs() < 1e-6, "{name} {parts} {k}");
                let bounds = ratio(&found.bounds, &expected.bounds);
                assert!((0.3..6.0).contains(&bounds), "{name} {parts} {k}: bounds {bounds}");
                let estimates = ratio(&found.estimates, &expected.estimates);
                // With a handful of columns in a part what cuts add is most of it.
                let most = if parts <= 2 { 10.0 } else { 100.0 };
                assert!((0.3..most).contains(&estimates), "{name} {parts} {k}: estimates {estimates}");
            }
            assert!(found.orthonormality_defect < 1e-8, "{name} {parts}: {}", found.orthonormality_defect);
            let accuracy = found.accuracy.as_ref().unwrap();
            assert!(accuracy.reached && accuracy.rounds == 0, "{name} {parts}: {accuracy:?}");
        }
    }
}

#[test]
fn parts_by_rows_have_the_pairs_of_the_whole_and_bounds_beside_its_own_whatever_their_pieces() {
    let mesh = generate(Shape::Genus(2), 4000).unwrap();
    let of = OperatorParameters::default();
    let operator = assemble(&mesh, &of, &Unwatched).unwrap();
    let whole = approximate(&mesh, &operator, &parameters(), &Unwatched).unwrap();
    let problem = LaplacianByRows::new(&mesh, &of, &Unwatched).unwrap().unwrap();
    for (parts, pieces) in [(1, (4000, 4000)), (3, (900, 2000)), (2, (1500, 700))] {
        let parted = Parted::by_rows(&problem, &parameters(), Some(parts), "1", &Unwatched).unwrap();
        let of_whole = Parted::new(&mesh, &operator, &parameters(), Some(parts), "1", &Unwatched).unwrap();
        assert_eq!(parted.plan().difference(of_whole.plan()), None, "{parts}");
        let Source::ByRows(_, largest) = parted.source else { panic!("by rows") };
        let made: Vec<Part> =
            (0..parts).map(|number| parted.solve_by_rows((&problem, largest), number, pieces).unwrap()).collect();
        let joined = parted.join(&mut |number| Ok(made[number].clone())).unwrap();
        assert_eq!(compact(&joined).space, compact(&whole).space, "{parts}");
        assert_eq!((&joined.mass, joined.eigenvalues[0]), (&whole.mass, 0.0), "{parts}");
        for (k, (a, b)) in joined.eigenvalues.iter().zip(&whole.eigenvalues).enumerate().skip(1) {
            assert!((a - b).abs() <= 1e-9 * b, "{parts}, pair {k}: {a} and {b}");
            let ratio = joined.certificate.bounds[k] / whole.certificate.bounds[k];
            assert!((0.3..6.0).contains(&ratio), "{parts}, pair {k}: bounds {ratio}");
        }
        assert!(joined.certificate.accuracy.as_ref().unwrap().reached, "{parts}");
    }
}

#[test]
fn every_unknown_is_in_one_part_and_parts_are_of_one_size() {
    for (name, mesh, of) in cases() {
        let problem = assemble(&mesh, &of, &Unwatched).unwrap().problem;
        for parts in [1, 2, 3, 5, 7, 8, 64] {
            let part_of = divided(&mesh, (problem.size(), problem.unknowns.as_deref()), parts);
            let mut counts = vec![0usize; parts];
            part_of.iter().for_each(|&part| counts[part as usize] += 1);
            let mean = problem.size() / parts;
            assert!(counts.iter().all(|count| count.abs_diff(mean) <= 7), "{name} {parts}: {counts:?}");
        }
    }
}

#[test]
fn a_goal_that_parts_miss_is_reached_in_one_piece() {
    let mesh = generate(Shape::Genus(2), 2600).unwrap();
    let operator = assemble(&mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    let parameters = ApproximationParameters { goal: Some(Goal { error: 4e-4, rounds: 3 }), ..parameters() };
    let whole = approximate(&mesh, &operator, &parameters, &Unwatched).unwrap();
    assert!(whole.certificate.accuracy.as_ref().unwrap().rounds > 0, "{:?}", whole.certificate.accuracy);
    let parted = Parted::new(&mesh, &operator, &parameters, Some(2), "1", &Unwatched).unwrap();
    let made = made(&parted);
    let joined = parted.join(&mut |number| Ok(made[number].clone())).unwrap();
    assert_eq!(joined.eigenvalues, whole.eigenvalues);
    assert_eq!(joined.certificate.accuracy, whole.certificate.accuracy);
}

/// What is done to a part.
type Change<'a> = Box<dyn Fn(&mut Part) + 'a>;

#[test]
fn what_does_not_belong_is_refused_by_the_number_of_the_part() {
    let mesh = generate(Shape::Genus(2), 2600).unwrap();
    let operator = assemble(&mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    let parted = |parts: usize| Parted::new(&mesh, &operator, &parameters(), Some(parts), "1", &Unwatched).unwrap();
    let good = made(&parted(3));
    let refused = |change: &dyn Fn(&mut Part)| {
        let mut parts = good.clone();
        change(&mut parts[1]);
        parted(3).join(&mut |number| Ok(parts[number].clone())).unwrap_err()
    };
    let share = |part: &mut Part, change: &dyn Fn(&mut PartShare)| change(part.share.as_mut().unwrap());
    let other = made(&parted(2));
    let changes: Vec<(&str, &str, Change<'_>)> = vec![
        (
            "part-of-another-version",
            "part 2 was made by version 0",
            Box::new(|part| part.plan.version = "0".to_owned()),
        ),
        ("part-of-another-problem", "divided differently", Box::new(|part| *part = other[1].clone())),
        ("part-of-another-problem", "its seed differs", Box::new(|part| part.plan.seed = 5)),
        ("part-of-another-problem", "another problem", Box::new(|part| part.plan.problem.products[1] *= 1.001)),
        ("part-damaged", "it claims to be part 1", Box::new(|part| *part = good[0].clone())),
        ("part-damaged", "no share", Box::new(|part| part.share = None)),
        (
            "part-damaged",
            "is also in a part before",
            Box::new(|part| {
                share(part, &|of| of.rows = good[0].share.as_ref().unwrap().rows[..of.rows.len()].to_vec())
            }),
        ),
        ("part-damaged", "do not fit", Box::new(|part| share(part, &|of| of.sums.truncate(20)))),
        ("part-damaged", "not finite", Box::new(|part| share(part, &|of| of.sums[7] = f64::NAN))),
        ("part-damaged", "not in order", Box::new(|part| share(part, &|of| of.values.swap(3, 9)))),
        (
            "part-of-another-problem",
            "not those of part 1",
            Box::new(|part| share(part, &|of| of.values[5] *= 1.0 + 1e-6)),
        ),
        (
            "part-of-another-problem",
            "not those of part 1",
            Box::new(|part| share(part, &|of| of.coefficients.values_mut()[70] += 1e-3)),
        ),
    ];
    for (kind, words, change) in changes {
        let error = refused(&change);
        assert_eq!(error.kind(), kind, "{error}");
        assert!(error.to_string().contains(words) && error.to_string().contains("part 2"), "{words}: {error}");
    }
    let error = parted(3).solve(3).unwrap_err();
    assert_eq!(error.to_string(), "there is no part 4 of 3");
    let missing = parted(3).join(&mut |number| Err(PartError::Missing { number: number + 1, parts: 3 })).unwrap_err();
    assert_eq!(missing.to_string(), "part 1 of 3 is missing");
}

#[test]
fn what_is_not_divided_says_why() {
    let mesh = generate(Shape::Genus(2), 2600).unwrap();
    let refused = |of: &OperatorParameters, parameters: &ApproximationParameters, parts: usize| {
        let operator = assemble(&mesh, of, &Unwatched).unwrap();
        match Parted::new(&mesh, &operator, parameters, Some(parts), "1", &Unwatched) {
            Ok(_) => panic!("{of:?} was divided"),
            Err(error) => error.to_string(),
        }
    };
    let plain = OperatorParameters::default();
    let robust = OperatorParameters { operator: OperatorKind::Robust, ..plain.clone() };
    let well = Potential::Values(vec![2.0; mesh.positions.len()]);
    let hamiltonian = OperatorParameters { operator: OperatorKind::Hamiltonian { potential: well }, ..plain.clone() };
    let consistent = OperatorParameters { mass: MassKind::Consistent, ..plain.clone() };
    for (of, words) in [(robust, "cotangent"), (hamiltonian, "cotangent"), (consistent, "consistent")] {
        let error = refused(&of, &parameters(), 2);
        assert!(error.contains(words), "{error}");
    }
    let error = refused(&plain, &ApproximationParameters { certify: true, ..parameters() }, 2);
    assert!(error.contains("certify"), "{error}");
    let error = refused(&plain, &ApproximationParameters { dimension: 60, ..parameters() }, 2);
    assert!(error.contains("3600 are needed"), "{error}");
    let error = refused(&plain, &parameters(), 5000);
    assert!(error.contains("not 5000"), "{error}");
}
