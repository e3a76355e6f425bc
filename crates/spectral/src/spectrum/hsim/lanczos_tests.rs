//! Krylov spaces against the dense solver.

use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

use super::super::columns::defect as defect_of;
use super::super::tests::{copies, count, exact, laplacian, level_of, rough, solved};
use super::super::{HsimParameters, Selection, solve};
use super::*;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble};

fn agree(values: &[f64], truth: &[f64], share: f64, what: &str) {
    let scale = truth[truth.len() - 1].abs();
    for (k, (value, truth)) in values.iter().zip(truth).enumerate() {
        assert!((value - truth).abs() <= share * scale, "{what}: pair {k} is {value}, not {truth}");
    }
}

#[test]
fn a_krylov_space_holds_the_pairs_of_the_dense_solver() {
    let sphere = generate(Shape::Sphere, 1002).unwrap();
    let disk = generate(Shape::Disk, 1200).unwrap();
    for (what, mesh) in [("multiplets", sphere), ("a boundary", disk), ("three", copies(&rough(Shape::Torus, 500), 3))]
    {
        for mass in [MassKind::Barycentric, MassKind::Consistent] {
            for boundary in [Boundary::Neumann, Boundary::Dirichlet] {
                let parameters = OperatorParameters { operator: OperatorKind::Laplace, mass, boundary };
                let Ok(operator) = assemble(&mesh, &parameters, &Unwatched) else { continue };
                let problem = operator.problem;
                for (pairs, tolerance) in [(12, 1e-2), (41, 1e-9)] {
                    let what = format!("{what}, {mass:?}, {boundary:?}, {pairs} pairs to {tolerance:e}");
                    let found = solved(&mesh, &problem, &count(pairs, tolerance), &what);
                    let share = if tolerance < 1e-6 { 1e-12 } else { 1e-4 };
                    agree(&found.values, &exact(&problem, pairs), share, &what);
                    // The estimate of a residual may be a little too good.
                    assert!(found.levels.len() == 1 && found.levels[0].iterations <= 1, "{what}: {:?}", found.levels);
                }
            }
        }
    }
}

#[test]
fn an_eigenvalue_may_have_more_vectors_than_a_block_has_columns() {
    for (number, pairs) in [(12, 30), (25, 60)] {
        let mesh = copies(&rough(Shape::Torus, 150), number);
        let problem = laplacian(&mesh);
        let what = format!("{number} copies");
        let found = solved(&mesh, &problem, &count(pairs, 1e-6), &what);
        agree(&found.values, &exact(&problem, pairs), 1e-9, &what);
    }
}

#[test]
fn a_shift_may_lie_next_to_an_eigenvalue() {
    let mesh = rough(Shape::Torus, 1200);
    let problem = laplacian(&mesh);
    let level = level_of(&mesh, &problem);
    let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass).unwrap();
    let (kernel, pairs) = (Kernel::new(&level), 40);
    // On unit area, as the level is.
    let truth = CpuSolver.lowest(level.stiffness.to_dense(), level.mass.to_dense(), 60, &Unwatched).unwrap().values;
    let gap = |k: &usize| (truth[k + 1] - truth[*k]).min(truth[*k] - truth[k - 1]);
    let beside = (15..25).max_by(|a, b| gap(a).total_cmp(&gap(b))).unwrap();
    // Rounding errors along this eigenvector grow by a factor of up to 10⁸ with every block.
    for near in [1e-4, 1e-6, 1e-8] {
        let (at, below) = (truth[beside] * (1.0 + near), beside + 1);
        let shift = Scout::new(&level, &symbolic, &Unwatched).shift_at(at, below).unwrap().expect("a shift");
        let shift = Shift { below: below - kernel.dimension(), ..shift };
        let wanted = KrylovRequest::lowest(level.size(), pairs, pairs, 1e-9, 3);
        let found = pairs_or_none(&level, &symbolic, &kernel, &shift, wanted, &Unwatched).unwrap();
        let Some(KrylovPairs { values, vectors, .. }) = found else { panic!("nothing from a shift {near:e} away") };
        agree(&values, &truth[1..], 1e-11, &format!("a shift {near:e} away"));
        let defect = defect_of(&vectors, &level.mass, &Unwatched).unwrap();
        assert!(defect < 1e-11, "a shift {near:e} away: {defect:e} away from orthonormal");
    }
}

#[test]
fn a_hierarchy_and_a_krylov_space_agree() {
    let mesh = rough(Shape::Genus(2), 3000);
    let problem = laplacian(&mesh);
    let by_levels = HsimParameters { levels: Some(3), ..count(60, 1e-8) };
    let (first, second) = (
        solved(&mesh, &problem, &count(60, 1e-8), "a space"),
        solve(&mesh, &problem, &by_levels, false, &Unwatched).unwrap(),
    );
    assert!(first.levels.len() == 1 && second.levels.len() == 3);
    agree(&first.values, &second.values, 1e-12, "levels");
    let bound = 0.5 * (first.values[40] + first.values[41]);
    let below = HsimParameters { selection: Selection::Below { bound, most: 50 }, ..count(1, 1e-8) };
    let below = solved(&mesh, &problem, &below, "below");
    assert_eq!(below.values.len(), 41);
    agree(&below.values, &second.values, 1e-12, "below");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let mesh = rough(Shape::Torus, 4000);
    let problem = laplacian(&mesh);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| solve(&mesh, &problem, &count(20, 1e-8), false, &Unwatched).unwrap())
    };
    let (one, three) = (on(1), on(3));
    for (a, b) in one.values.iter().zip(&three.values) {
        assert!((a - b).abs() <= 1e-13 * one.values[19], "{a} and {b}");
    }
}

#[test]
fn columns_that_depend_on_others_are_named() {
    let mut gram = [[0.0; KRYLOV_WIDTH]; KRYLOV_WIDTH];
    (0..KRYLOV_WIDTH).for_each(|k| gram[k][k] = 4.0);
    // The third is the sum of the first two, and the sixth is nothing.
    (gram[2][2], gram[0][2], gram[2][0], gram[1][2], gram[2][1]) = (8.0, 4.0, 4.0, 4.0, 4.0);
    gram[5][5] = 1e-30;
    let (r, spent) = cholesky(&gram, 1e-9);
    assert_eq!(spent.map(u8::from), [0, 0, 1, 0, 0, 1, 0, 0]);
    let product = times(&transposed(&r), &r);
    for j in 0..KRYLOV_WIDTH {
        for k in 0..KRYLOV_WIDTH {
            assert!((product[j][k] - gram[j][k]).abs() < 1e-12, "{j} {k}");
        }
    }
    let unit = times(&r, &inverse(&r, &spent));
    assert!((0..KRYLOV_WIDTH).all(|k| unit[k][k] == if spent[k] { 0.0 } else { 1.0 }));
}
