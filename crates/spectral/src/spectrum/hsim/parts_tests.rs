//! Parts and their join against the dense solver and a solve in one piece; parts that are lost, damaged or of something
//! else.

use chladni_base::{SplitMix64, StageClock, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::super::tests::{below, copies, count, exact, laplacian, rough};
use super::super::{Eigenpairs, HsimParameters, Variant, solve};
use super::*;
use crate::operator::{Boundary, EigenProblem, MassKind, OperatorKind, OperatorParameters, assemble};

const VERSION: &str = "7";

/// What is done to a slice, and what is to be said of it.
type Change<'a> = (&'a str, &'a dyn Fn(&mut PartSlice));

fn problem(mesh: &TriangleMesh, mass: MassKind, boundary: Boundary) -> EigenProblem {
    let parameters = OperatorParameters { operator: OperatorKind::Laplace, mass, boundary };
    assemble(mesh, &parameters, &Unwatched).unwrap().problem
}

fn parted<'a>(
    (mesh, problem): (&'a TriangleMesh, &'a EigenProblem),
    parameters: &'a HsimParameters,
    parts: usize,
) -> Parted<'a> {
    Parted::new(mesh, problem, parameters, Some(parts), VERSION, &Unwatched).unwrap()
}

/// Each part by itself, the last one first.
fn solve_parts(of: (&TriangleMesh, &EigenProblem), parameters: &HsimParameters, parts: usize) -> Vec<Part> {
    let mut solved: Vec<Part> =
        (0..parts).rev().map(|number| parted(of, parameters, parts).solve(number).unwrap()).collect();
    solved.reverse();
    solved
}

fn join(
    of: (&TriangleMesh, &EigenProblem),
    parameters: &HsimParameters,
    parts: &[Part],
) -> Result<Eigenpairs, PartError> {
    join_and_tell(of, parameters, parts).map(|(pairs, _)| pairs)
}

/// The same, and whether the problem was solved in one piece after all.
fn join_and_tell(
    of: (&TriangleMesh, &EigenProblem),
    parameters: &HsimParameters,
    parts: &[Part],
) -> Result<(Eigenpairs, bool), PartError> {
    let clock = StageClock::new(&Unwatched);
    let missing = |number: usize| PartError::Missing { number: number + 1, parts: parts.len() };
    let parted = Parted::new(of.0, of.1, parameters, Some(parts.len()), VERSION, &clock)?;
    let pairs = parted.join(&mut |number| parts.get(number).cloned().ok_or_else(|| missing(number)))?;
    Ok((pairs, clock.notes().iter().any(|(name, _)| *name == FALLBACKS)))
}

/// The largest entry of `|XᵀMX − I|` over all pairs of columns, in the units of the input.
fn defect(problem: &EigenProblem, pairs: &Eigenpairs) -> f64 {
    let rows: Vec<usize> = match &problem.unknowns {
        None => (0..problem.size()).collect(),
        Some(unknowns) => unknowns.iter().map(|&vertex| vertex as usize).collect(),
    };
    let column = |k: usize| rows.iter().map(|&row| pairs.vectors.get(row, k)).collect::<Vec<f64>>();
    let columns: Vec<Vec<f64>> = (0..pairs.values.len()).map(column).collect();
    let mut worst = 0f64;
    for (k, own) in columns.iter().enumerate() {
        let inertia = problem.mass.multiply(own);
        for (j, other) in columns.iter().enumerate() {
            let product: f64 = inertia.iter().zip(other).map(|(a, b)| a * b).sum();
            worst = worst.max((product * problem.area - f64::from(u8::from(j == k))).abs());
        }
    }
    worst
}

fn agree(values: &[f64], truth: &[f64], what: &str) {
    let unit = truth.iter().copied().find(|&value| value > 1e-9 * truth[truth.len() - 1]).unwrap();
    for (k, (value, truth)) in values.iter().zip(truth).enumerate() {
        assert!((value - truth).abs() <= 1e-10 * truth.max(unit), "{what}: pair {k} is {value}, not {truth}");
    }
}

#[test]
fn parts_give_the_pairs_of_one_piece() {
    let torus = rough(Shape::Torus, 1300);
    let equal = copies(&generate(Shape::Torus, 450).unwrap(), 3);
    let disk = rough(Shape::Disk, 1300);
    for (what, mesh, boundary) in [
        ("a torus", &torus, Boundary::Neumann),
        ("three copies of a symmetric torus", &equal, Boundary::Neumann),
        ("a fixed boundary", &disk, Boundary::Dirichlet),
    ] {
        for mass in [MassKind::Barycentric, MassKind::Consistent] {
            let problem = problem(mesh, mass, boundary);
            let truth = exact(&problem, problem.size());
            for (pairs, parts) in [(200, 3), (130, 2), (90, 1)] {
                let what = format!("{what}, {mass:?}, {pairs} pairs in {parts} parts");
                let parameters = count(pairs, 1e-6);
                let solved = solve_parts((mesh, &problem), &parameters, parts);
                assert!(solved.iter().all(|part| part.slices.is_ok()), "{what}: a part was given up");
                let (joined, in_one_piece) = join_and_tell((mesh, &problem), &parameters, &solved).unwrap();
                assert!(!in_one_piece, "{what}: the parts were not joined");
                assert_eq!(joined.values.len(), pairs, "{what}");
                agree(&joined.values, &truth, &what);
                let whole = solve(mesh, &problem, &parameters, false, &Unwatched).unwrap();
                agree(&joined.values, &whole.values, &what);
                for (k, (value, bound)) in joined.values.iter().zip(&joined.bounds).enumerate() {
                    assert!((value - truth[k]).abs() <= *bound, "{what}: pair {k} is not within {bound:e}");
                    assert!(*bound <= 1e-6 * truth[k].max(truth[pairs / 8]), "{what}: pair {k} is within {bound:e}");
                }
                assert!(joined.residuals.iter().all(|&residual| residual <= 1e-6), "{what}");
                let defect = defect(&problem, &joined);
                assert!(defect <= 1e-8 && joined.orthonormality_defect <= 1e-8, "{what}: {defect:e}");
                for count in &joined.inertia {
                    let truth = truth.partition_point(|&value| value < count.shift);
                    assert_eq!(truth, count.below, "{what}: below {}", count.shift);
                }
            }
        }
    }
}

#[test]
fn a_bound_on_the_eigenvalues_is_kept_by_parts() {
    let mesh = rough(Shape::Genus(2), 1500);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 220);
    let parameters = below(0.5 * (truth[180] + truth[181]), 400);
    let parts = solve_parts((&mesh, &problem), &parameters, 2);
    let joined = join((&mesh, &problem), &parameters, &parts).unwrap();
    assert_eq!(joined.values.len(), 181);
    agree(&joined.values, &truth[..181], "below a bound");
}

#[test]
fn a_part_may_hold_several_slices() {
    let mesh = rough(Shape::Torus, 4000);
    let problem = laplacian(&mesh);
    let parameters = count(900, 1e-4);
    let whole = parted((&mesh, &problem), &parameters, 2);
    assert_eq!((whole.plan().parts, whole.plan().slices), (2, 2));
    let parts = solve_parts((&mesh, &problem), &parameters, 2);
    assert!(parts.iter().all(|part| part.slices.as_ref().is_ok_and(|slices| slices.len() == 2)));
    let joined = join((&mesh, &problem), &parameters, &parts).unwrap();
    let levels = solve(&mesh, &problem, &count(900, 1e-7), false, &Unwatched).unwrap();
    agree(&joined.values, &levels.values, "two slices to a part");
    assert!(joined.inertia.len() >= 4, "{:?}", joined.inertia);
    let defect = defect(&problem, &joined);
    assert!(defect <= 1e-8, "{defect:e}");
}

#[test]
fn eigenvalues_of_more_copies_than_neighbours_share_are_found_in_one_piece() {
    let mesh = copies(&rough(Shape::Torus, 90), 25);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 200);
    let parameters = count(200, 1e-6);
    let parts = solve_parts((&mesh, &problem), &parameters, 2);
    let (joined, in_one_piece) = join_and_tell((&mesh, &problem), &parameters, &parts).unwrap();
    agree(&joined.values, &truth, "25 copies");
    assert!(in_one_piece);
    // A part that was given up is one too.
    let mesh = rough(Shape::Torus, 1000);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 140);
    let parameters = count(140, 1e-6);
    let mut parts = solve_parts((&mesh, &problem), &parameters, 2);
    parts[1].slices = Err("a shift was not found".to_owned());
    let (joined, in_one_piece) = join_and_tell((&mesh, &problem), &parameters, &parts).unwrap();
    agree(&joined.values, &truth, "a part that was given up");
    assert!(in_one_piece);
}

#[test]
fn numbers_that_a_part_has_wrong_do_not_reach_the_answer() {
    let mesh = rough(Shape::Torus, 1000);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 140);
    let parameters = count(140, 1e-6);
    let parts = solve_parts((&mesh, &problem), &parameters, 2);
    let changed = |change: &dyn Fn(&mut PartSlice)| {
        let mut parts = parts.clone();
        change(&mut parts[1].slices.as_mut().unwrap()[0]);
        join((&mesh, &problem), &parameters, &parts)
    };
    let mut random = SplitMix64::new(5);
    let noise: Vec<f64> = (0..problem.size()).map(|_| random.signed_unit()).collect();
    let values = |slice: &mut PartSlice| slice.values.iter_mut().for_each(|value| *value += 1e-4 * *value);
    let zero = |slice: &mut PartSlice| slice.vectors.assign(&[20], &PanelMatrix::zeros(slice.vectors.rows(), 1));
    let twice = |slice: &mut PartSlice| slice.vectors.assign(&[20], &slice.vectors.select(&[21]));
    let other = |slice: &mut PartSlice| {
        let mut column = PanelMatrix::zeros(noise.len(), 1);
        for (row, x) in column.panels_mut()[0].chunks_exact_mut(32).zip(&noise) {
            row[0] = *x;
        }
        slice.vectors.assign(&[20], &column);
    };
    let changes: [Change<'_>; 4] =
        [("values", &values), ("a column of zeros", &zero), ("one column twice", &twice), ("noise", &other)];
    for (what, change) in changes {
        match changed(change) {
            Ok(pairs) => agree(&pairs.values, &truth, what),
            Err(error) => assert!(matches!(error, PartError::Damaged { number: 2, .. }), "{what}: {error}"),
        }
    }
}

#[test]
fn parts_that_are_lost_damaged_or_of_something_else_are_refused_by_name() {
    let mesh = rough(Shape::Torus, 1000);
    let problem = laplacian(&mesh);
    let of = (&mesh, &problem);
    let parameters = count(140, 1e-6);
    let parts = solve_parts(of, &parameters, 2);
    let refused = |parts: &[Part]| join(of, &parameters, parts).unwrap_err();
    let changed = |change: &dyn Fn(&mut Part)| {
        let mut parts = parts.clone();
        change(&mut parts[1]);
        refused(&parts)
    };
    let lost = parted(of, &parameters, 2).join(&mut |number| match number {
        0 => Ok(parts[0].clone()),
        _ => Err(PartError::Missing { number: number + 1, parts: 2 }),
    });
    assert_eq!(lost.unwrap_err().to_string(), "part 2 of 2 is missing");
    let version = changed(&|part| part.plan.version = "6".to_owned());
    assert_eq!(version.kind(), "part-of-another-version");
    assert!(version.to_string().starts_with("part 2 was made by version 6 of the solver, but this is 7"), "{version}");
    assert_eq!(refused(&[parts[0].clone(), parts[0].clone()]).kind(), "part-damaged");
    let slice = |change: &dyn Fn(&mut PartSlice)| changed(&|part| change(&mut part.slices.as_mut().unwrap()[0]));
    let damages: [Change<'_>; 8] = [
        ("not finite", &|slice| slice.vectors.panels_mut()[1][5] = f64::NAN),
        ("not finite", &|slice| slice.values[3] = f64::INFINITY),
        ("not finite", &|slice| slice.count.radius = f64::NAN),
        ("not in order", &|slice| slice.values.swap(10, 30)),
        ("pairs from", &|slice| slice.values.truncate(20)),
        ("vectors are", &|slice| slice.vectors.keep_columns(20)),
        ("it does not have ", &|slice| slice.count.below += 1),
        ("it does not have ", &|slice| slice.count.shift = slice.values[0]),
    ];
    for (reason, damage) in damages {
        let error = slice(damage);
        assert!(matches!(error, PartError::Damaged { number: 2, .. }), "{reason}: {error}");
        assert!(error.to_string().contains(reason), "{reason}: {error}");
    }
    assert_eq!(changed(&|part| part.slices.as_mut().unwrap().clear()).kind(), "part-damaged");
    let mut moved = mesh.clone();
    moved.positions[500][0] += 1e-3;
    for (what, other, parameters, number) in [
        ("another mesh", &moved, parameters, 2),
        ("its number of pairs differs", &mesh, count(141, 1e-6), 2),
        ("another tolerance", &mesh, count(140, 1e-5), 2),
        ("another seed", &mesh, HsimParameters { seed: 1, ..parameters }, 2),
        ("another number of parts", &mesh, parameters, 1),
    ] {
        let problem = laplacian(other);
        let strange = solve_parts((other, &problem), &parameters, number).pop().unwrap();
        let error = refused(&[parts[0].clone(), strange]);
        assert!(matches!(error, PartError::Foreign { number: 2, .. }), "{what}: {error}");
    }
}

#[test]
fn what_is_not_solved_in_parts_is_refused() {
    let mesh = rough(Shape::Torus, 1000);
    let problem = laplacian(&mesh);
    let refused = |parameters: HsimParameters, parts: Option<usize>| {
        let parted = Parted::new(&mesh, &problem, &parameters, parts, VERSION, &Unwatched);
        parted.map(|parted| parted.plan().clone()).unwrap_err()
    };
    for (what, parameters, parts) in [
        ("too many parts", count(140, 1e-6), Some(3)),
        ("no parts", count(140, 1e-6), Some(0)),
        ("few pairs", count(20, 1e-6), None),
        ("levels", HsimParameters { levels: Some(2), ..count(140, 1e-6) }, Some(2)),
        ("the published variant", HsimParameters { variant: Variant::Published, ..count(140, 1e-6) }, Some(2)),
        ("nearly all pairs", count(900, 1e-6), Some(2)),
        ("nothing below the bound", below(-1.0, 300), Some(1)),
    ] {
        let error = refused(parameters, parts);
        assert!(matches!(error, PartError::Unsuited { .. }), "{what}: {error}");
    }
    assert_eq!(refused(count(2000, 1e-6), Some(2)).kind(), "invalid-parameters");
    let parameters = count(140, 1e-6);
    let error = parted((&mesh, &problem), &parameters, 2).solve(2).unwrap_err();
    assert_eq!(error.to_string(), "there is no part 3 of 2");
}
