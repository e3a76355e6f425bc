use std::f64::consts::PI;

use super::*;
use crate::basis::{CutCluster, completeness};
use crate::operator::elastic::tests::bar;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble, volume};
use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::TetMesh;
use chladni_mesh::shape::{Shape, generate};

fn lowest(solid: &TetMesh, mass: MassKind, boundary: Boundary, count: usize) -> Vec<f64> {
    let problem = volume::assemble(solid, mass, boundary, &Unwatched).unwrap().problem;
    let parameters =
        HsimParameters { selection: Selection::Count(count), tolerance: 1e-8, ..HsimParameters::default() };
    let places = RowPositions::Positions(&solid.positions);
    let pairs = solve(&problem, places, solid.positions.len(), &parameters, &Unwatched).unwrap();
    assert!(pairs.orthonormality_defect < 1e-10);
    pairs.values
}

/// A cube brought to the unit ball, every square shell to a sphere.
fn ball(cells: usize) -> TetMesh {
    let mut solid = bar([2.0; 3], [cells; 3]);
    for p in &mut solid.positions {
        *p = p.map(|c| c - 1.0);
        let (most, length) = (p.iter().fold(0f64, |most, c| most.max(c.abs())), p.iter().map(|c| c * c).sum::<f64>());
        if most > 0.0 {
            *p = p.map(|c| c * most / length.sqrt());
        }
    }
    solid
}

/// The errors of the lowest eigenvalues against exact ones, in two resolutions: they fall with the square of the edges.
fn converges(solids: [TetMesh; 2], mass: MassKind, boundary: Boundary, exact: &[f64], orders: std::ops::Range<f64>) {
    let [coarse, fine] = solids.map(|solid| lowest(&solid, mass, boundary, exact.len()));
    for ((coarse, fine), exact) in coarse.iter().zip(&fine).zip(exact) {
        if *exact == 0.0 {
            assert_eq!((*coarse, *fine), (0.0, 0.0));
            continue;
        }
        let (before, after) = ((coarse - exact).abs() / exact, (fine - exact).abs() / exact);
        let order = (before / after).log2();
        assert!(after < 0.05, "{mass:?} {boundary:?}: {fine} is not {exact}");
        assert!(orders.contains(&order), "{mass:?} {boundary:?}: of order {order} at {exact}: {before}, {after}");
    }
}

#[test]
fn cubes_have_the_eigenvalues_of_cosines_and_sines_to_second_order() {
    let square = |k: usize| (k * k) as f64;
    let mut neumann: Vec<f64> =
        (0..27).map(|k| PI * PI * (square(k % 3) + square(k / 3 % 3) + square(k / 9))).collect();
    neumann.sort_by(f64::total_cmp);
    neumann.truncate(8);
    let cubes = || [bar([1.0; 3], [8; 3]), bar([1.0; 3], [16; 3])];
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        converges(cubes(), mass, Boundary::Neumann, &neumann, 1.7..2.3);
        converges(cubes(), mass, Boundary::Dirichlet, &[3.0, 6.0, 6.0, 6.0].map(|x| x * PI * PI), 1.7..2.3);
    }
}

#[test]
fn balls_have_the_zeros_of_spherical_bessel_functions() {
    // Zeros of j₁′, j₂′ and of j₀, j₁.
    let (first, second) = (2.081_575_977_818_101f64.powi(2), 3.342_093_657_365_695f64.powi(2));
    let neumann = [0.0, first, first, first, second, second, second, second, second];
    let balls = || [ball(8), ball(16)];
    converges(balls(), MassKind::Consistent, Boundary::Neumann, &neumann, 1.4..2.6);
    let dirichlet = [PI.powi(2), 4.493_409_457_909_064f64.powi(2), 4.493_409_457_909_064f64.powi(2)];
    converges(balls(), MassKind::Consistent, Boundary::Dirichlet, &dirichlet, 1.4..2.6);
}

#[test]
fn a_hierarchy_finds_what_a_dense_solve_finds_at_any_scale() {
    let solid = bar([1.0, 1.3, 1.7], [12, 12, 14]);
    let problem = volume::assemble(&solid, MassKind::Barycentric, Boundary::Neumann, &Unwatched).unwrap().problem;
    assert!(!hsim::is_dense(problem.size(), 40), "the test is of the hierarchy");
    let mass = {
        let mut dense = chladni_algebra::DenseMatrix::zeros(problem.size(), problem.size());
        problem.mass.lumped().iter().enumerate().for_each(|(k, m)| dense.column_mut(k)[k] = *m);
        dense
    };
    let exact = CpuSolver.lowest(problem.stiffness.to_dense(), mass, 40, &Unwatched).unwrap();
    for scale in [1.0, 1e-3, 1e9] {
        let scaled =
            TetMesh { positions: solid.positions.iter().map(|p| p.map(|c| scale * c)).collect(), ..solid.clone() };
        let values = lowest(&scaled, MassKind::Barycentric, Boundary::Neumann, 40);
        for (found, exact) in values.iter().zip(&exact.values).skip(1) {
            let exact = exact / problem.area;
            assert!((found * scale * scale - exact).abs() < 1e-9 * exact, "{scale}: {found} is not {exact}");
        }
    }
}

#[test]
fn graphs_need_no_positions_and_agree_with_the_formula_of_a_torus() {
    // A grid of squares with one diagonal each, closed in both directions: characters are eigenvectors.
    let (m, n) = (48usize, 40usize);
    let vertex = |i: usize, j: usize| ((i % m) * n + j % n) as u32;
    let faces = (0..m * n).flat_map(|k| {
        let (i, j) = (k / n, k % n);
        let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let mesh = TriangleMesh { positions: vec![[0.0; 3]; m * n], faces: faces.collect(), ..Default::default() };
    let parameters = OperatorParameters { operator: OperatorKind::Graph, ..OperatorParameters::default() };
    let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
    let mut exact: Vec<f64> = (0..m * n)
        .map(|k| {
            let (x, y) = (2.0 * PI * (k / n) as f64 / m as f64, 2.0 * PI * (k % n) as f64 / n as f64);
            6.0 - 2.0 * (x.cos() + y.cos() + (x + y).cos())
        })
        .collect();
    exact.sort_by(f64::total_cmp);
    let wanted = HsimParameters { selection: Selection::Count(60), tolerance: 1e-8, ..HsimParameters::default() };
    assert!(!hsim::is_dense(m * n, 60), "the test is of the hierarchy");
    let solved = || solve(&operator.problem, RowPositions::Nowhere, m * n, &wanted, &Unwatched).unwrap();
    let pairs = solved();
    for (found, exact) in pairs.values.iter().zip(&exact) {
        assert!((found - exact).abs() < 1e-9, "{found} is not {exact}");
    }
    // Who computes them again has the same.
    assert_eq!(solved().vectors, pairs.vectors);
}

#[test]
fn components_have_a_constant_each_and_a_bound_is_refused() {
    let mut mesh = generate(Shape::Sphere, 4000).unwrap();
    let n = mesh.positions.len() as u32;
    mesh.faces.extend(mesh.faces.clone().into_iter().map(|face| face.map(|v| v + n)));
    mesh.positions.extend(mesh.positions.clone());
    let parameters = OperatorParameters { operator: OperatorKind::Graph, ..OperatorParameters::default() };
    let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
    let wanted = HsimParameters { selection: Selection::Count(30), tolerance: 1e-6, ..HsimParameters::default() };
    let solved = |wanted: &HsimParameters| {
        solve(&operator.problem, RowPositions::Nowhere, mesh.positions.len(), wanted, &Unwatched)
    };
    let values = solved(&wanted).unwrap().values;
    assert_eq!(values[..2], [0.0, 0.0]);
    assert!(values[2] > 0.0);
    for pair in values.chunks_exact(2) {
        assert!((pair[0] - pair[1]).abs() <= 1e-9 * pair[1], "{pair:?}");
    }
    let bound = HsimParameters { selection: Selection::Below { bound: 1.0, most: 10 }, ..wanted };
    assert!(matches!(solved(&bound), Err(HsimError::Parameter { name: "operator", .. })));
}

#[test]
fn a_count_that_cuts_the_cluster_of_identical_copies_is_met_and_says_so() {
    let one = generate(Shape::Sphere, 250).unwrap();
    let copies = 8;
    let mut mesh = TriangleMesh { positions: Vec::new(), faces: Vec::new(), ..Default::default() };
    for copy in 0..copies {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(one.positions.iter().map(|p| [p[0] + 3.0 * f64::from(copy), p[1], p[2]]));
        mesh.faces.extend(one.faces.iter().map(|face| face.map(|vertex| vertex + first)));
    }
    let parameters = OperatorParameters { operator: OperatorKind::Graph, ..OperatorParameters::default() };
    let whole = assemble(&mesh, &parameters, &Unwatched).unwrap().problem;
    let single = assemble(&one, &parameters, &Unwatched).unwrap().problem;
    let mut mass = DenseMatrix::zeros(single.size(), single.size());
    single.mass.lumped().iter().enumerate().for_each(|(k, &m)| mass.column_mut(k)[k] = m);
    let dense = CpuSolver.lowest(single.stiffness.to_dense(), mass, 5, &Unwatched).unwrap().values;
    // Triplets of the sphere, eight times; and its fifth value, which belongs to others.
    assert!(dense[3] - dense[1] < 1e-9 * dense[1] && dense[4] > 1.1 * dense[3]);
    for (count, cut) in [(14, true), (9, true), (31, true), (32, false), (8, false), (3, true)] {
        let wanted =
            HsimParameters { selection: Selection::Count(count), tolerance: 1e-8, ..HsimParameters::default() };
        let found = solve(&whole, RowPositions::Nowhere, mesh.positions.len(), &wanted, &Unwatched).unwrap();
        assert_eq!(completeness(0, &found.values, &found.inertia), Some(true), "{count}: {:?}", found.inertia);
        let cluster = if count < 8 { CutCluster { first: 0, end: 8 } } else { CutCluster { first: 8, end: 32 } };
        assert_eq!(found.cut, cut.then_some(cluster), "{count} pairs");
        for (k, (value, bound)) in found.values.iter().zip(&found.bounds).enumerate() {
            // In the units of the graph, as the dense solve has its own over the number of vertices.
            let expected = if k < copies as usize { 0.0 } else { dense[1] / single.area };
            assert!((value - expected).abs() < 1e-7 * dense[1] / single.area, "pair {k}: {value} is not {expected}");
            assert!((value - expected).abs() <= bound + 1e-12, "pair {k}: {value} is beyond {bound} of {expected}");
        }
    }
}
