//! A start from columns near the wanted ones changes the work, not the answer.

use chladni_algebra::PanelMatrix;
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use crate::operator::{Boundary, MeshOperator, OperatorParameters, assemble};
use crate::spectrum::hsim::{Eigenpairs, HsimError, HsimParameters, Variant, Wanted, solve, solve_near};

fn operator(mesh: &TriangleMesh, boundary: Boundary) -> MeshOperator {
    assemble(mesh, &OperatorParameters { boundary, ..OperatorParameters::default() }, &Unwatched).unwrap()
}

fn parameters(count: usize, tolerance: f64) -> HsimParameters {
    HsimParameters { wanted: Wanted::Count(count), tolerance, ..HsimParameters::default() }
}

/// The mesh bent along its first axis, as a pose of it.
fn bent(mesh: &TriangleMesh, by: f64) -> TriangleMesh {
    let positions = mesh.positions.iter().map(|&[x, y, z]| [x, y + by * x * x, z + 0.5 * by * x * y]).collect();
    TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() }
}

fn agree(near: &Eigenpairs, plain: &Eigenpairs) {
    assert_eq!(near.values.len(), plain.values.len());
    for (k, (a, b)) in near.values.iter().zip(&plain.values).enumerate() {
        let reach = near.bounds[k] + plain.bounds[k];
        assert!((a - b).abs() <= reach, "{k}: {a} and {b} are farther apart than {reach}");
        assert!(reach <= 1e-9 * b.abs().max(1.0), "{k}: {reach}");
    }
    assert!(near.orthonormality_defect <= 1e-9);
    assert!(near.inertia.last().unwrap().below >= near.values.len());
}

#[test]
fn another_pose_is_solved_from_this_one_without_a_hierarchy() {
    for (shape, boundary, count) in [
        (Shape::Knot, Boundary::Neumann, 40),
        (Shape::Disk, Boundary::Dirichlet, 30),
        (Shape::Torus, Boundary::Neumann, 97),
    ] {
        let mesh = generate(shape, 4000).unwrap();
        let first = operator(&mesh, boundary);
        let start = solve(&mesh, &first.problem, &parameters(count, 1e-2), false, &Unwatched).unwrap();
        let pose = bent(&mesh, 0.1);
        let second = operator(&pose, boundary);
        let asked = parameters(count, 1e-7);
        let near = solve_near(&pose, &second.problem, &asked, &start.vectors, &Unwatched).unwrap();
        let plain = solve(&pose, &second.problem, &asked, false, &Unwatched).unwrap();
        agree(&near, &plain);
        assert_eq!(near.levels.len(), 1);
        assert!(near.levels[0].iterations <= plain.levels.last().unwrap().iterations, "{shape:?}");
    }
}

#[test]
fn fewer_or_more_columns_than_are_wanted_will_do() {
    let mesh = generate(Shape::Knot, 4000).unwrap();
    let first = operator(&mesh, Boundary::Neumann);
    let start = solve(&mesh, &first.problem, &parameters(50, 1e-3), false, &Unwatched).unwrap();
    let pose = bent(&mesh, 0.05);
    let second = operator(&pose, Boundary::Neumann);
    for count in [1, 2, 20, 120] {
        let asked = parameters(count, 1e-7);
        let near = solve_near(&pose, &second.problem, &asked, &start.vectors, &Unwatched).unwrap();
        agree(&near, &solve(&pose, &second.problem, &asked, false, &Unwatched).unwrap());
    }
}

#[test]
fn a_start_that_is_near_nothing_is_made_good() {
    let mesh = generate(Shape::Torus, 3500).unwrap();
    let problem = operator(&mesh, Boundary::Neumann).problem;
    let asked = parameters(30, 1e-7);
    let plain = solve(&mesh, &problem, &asked, false, &Unwatched).unwrap();
    let mut random = SplitMix64::new(7);
    let mut noise = PanelMatrix::zeros(mesh.positions.len(), 30);
    for row in noise.panels_mut()[0].as_chunks_mut::<32>().0 {
        row[..30].iter_mut().for_each(|x| *x = random.signed_unit());
    }
    agree(&solve_near(&mesh, &problem, &asked, &noise, &Unwatched).unwrap(), &plain);
    // One column thirty times spans next to nothing.
    let one: Vec<usize> = vec![7; 30];
    agree(&solve_near(&mesh, &problem, &asked, &plain.vectors.select(&one), &Unwatched).unwrap(), &plain);
    // The baselines take no notice of it.
    let sim = HsimParameters { variant: Variant::Random, ..asked };
    let baseline = solve_near(&mesh, &problem, &sim, &noise, &Unwatched).unwrap();
    assert_eq!(baseline.values, solve(&mesh, &problem, &sim, false, &Unwatched).unwrap().values);
}

#[test]
fn a_start_that_cannot_be_one_is_refused() {
    let mesh = generate(Shape::Torus, 3500).unwrap();
    let (n, problem) = (mesh.positions.len(), operator(&mesh, Boundary::Neumann).problem);
    let refused = |near: &PanelMatrix| match solve_near(&mesh, &problem, &parameters(10, 1e-4), near, &Unwatched) {
        Err(HsimError::Parameter { name: "start", reason }) => reason,
        other => panic!("{other:?}"),
    };
    assert!(refused(&PanelMatrix::zeros(n - 1, 4)).contains(&n.to_string()));
    assert!(refused(&PanelMatrix::zeros(n, 0)).contains("not 0"));
    let mut constants = PanelMatrix::zeros(n, 4);
    constants.panels_mut()[0].as_chunks_mut::<32>().0.iter_mut().for_each(|row| row[..4].fill(2.5));
    assert!(refused(&constants).contains("kernel"));
    assert!(refused(&PanelMatrix::zeros(n, 4)).contains("kernel"));
    constants.panels_mut()[0][0] = f64::NAN;
    refused(&constants);
}
