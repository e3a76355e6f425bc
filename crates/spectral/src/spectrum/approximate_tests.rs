//! The approximation of every operator: against analytic spectra, against exact solves, and on meshes that are no
//! surfaces.

use chladni_algebra::SparseMatrix;
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::fixtures::{grid, placed, union};
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::analysis::spectrum::kernel_size;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, Potential, assemble};

fn operator(mesh: &TriangleMesh, operator: OperatorKind, mass: MassKind, boundary: Boundary) -> MeshOperator {
    assemble(mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched).unwrap()
}

fn solve(mesh: &TriangleMesh, operator: &MeshOperator, count: usize, dimension: usize) -> Basis {
    let parameters = ApproximationParameters {
        count,
        dimension,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: false,
        seed: 0,
    };
    approximate(mesh, operator, &parameters, &Unwatched).unwrap()
}

/// Mean relative error in percent.
fn error(values: &[f64], exact: &[f64]) -> f64 {
    let errors = values.iter().zip(exact).map(|(value, exact)| 100.0 * (value / exact - 1.0).abs());
    errors.sum::<f64>() / values.len() as f64
}

fn curvature(t: f64) -> OperatorKind {
    OperatorKind::Hamiltonian { potential: Potential::Curvature { t } }
}

#[test]
fn clamped_functions_have_their_spectrum_and_vanish_on_the_boundary() {
    let mesh = generate(Shape::Rectangle, 5_000).unwrap();
    let pi = std::f64::consts::PI;
    let mut exact: Vec<f64> = (1..30)
        .flat_map(|a| (1..30).map(move |b| (f64::from(a) * pi / 1.6).powi(2) + (f64::from(b) * pi).powi(2)))
        .collect();
    exact.sort_by(f64::total_cmp);
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let made = operator(&mesh, OperatorKind::Auto, mass, Boundary::Dirichlet);
        let basis = solve(&mesh, &made, 50, 100);
        let mean = error(&basis.eigenvalues, &exact);
        assert!(mean < 1.5, "{mass:?}: {mean} %");
        assert_eq!((basis.vertices(), basis.mass.size()), (mesh.positions.len(), mesh.positions.len()));
        let modes: Vec<f64> = basis.lift(0..50).unwrap();
        let on_the_rim = |p: &[f64; 3]| p[0] * (1.6 - p[0]) * p[1] * (1.0 - p[1]) < 1e-9;
        let rim: Vec<usize> = (0..mesh.positions.len()).filter(|&v| on_the_rim(&mesh.positions[v])).collect();
        assert_eq!(rim.len(), made.report.removed_vertices);
        for k in 0..50 {
            assert!(rim.iter().all(|&v| modes[k * mesh.positions.len() + v] == 0.0));
        }
        assert!(basis.certificate.orthonormality_defect < 1e-10);
    }
}

#[test]
fn ritz_values_of_every_operator_lie_above_exact_ones_and_bounds_enclose_one() {
    let surface = noisy(&generate(Shape::Disk, 1_200).unwrap(), 0.2, 1).unwrap();
    let bent = TriangleMesh {
        positions: surface
            .positions
            .iter()
            .map(|p| [p[0], p[1], 0.3 * (4.0 * p[0]).sin() * (3.0 * p[1]).cos()])
            .collect(),
        faces: surface.faces,
        ..Default::default()
    };
    let wells: Vec<f64> = bent.positions.iter().map(|p| 20.0 * (5.0 * p[0]).sin() - 5.0).collect();
    let values = OperatorKind::Hamiltonian { potential: Potential::Values(wells) };
    let wanted = [OperatorKind::Robust, curvature(0.3), OperatorKind::Extrinsic { t: 0.6 }, values];
    for (kind, mass, boundary) in [
        (0, MassKind::Barycentric, Boundary::Dirichlet),
        (1, MassKind::Consistent, Boundary::Dirichlet),
        (1, MassKind::Barycentric, Boundary::Neumann),
        (2, MassKind::Voronoi, Boundary::Neumann),
        (3, MassKind::Consistent, Boundary::Neumann),
        (3, MassKind::Barycentric, Boundary::Dirichlet),
    ] {
        let made = operator(&bent, wanted[kind].clone(), mass, boundary);
        // A dimension near the number of vertices is the problem itself.
        let exact = solve(&bent, &made, 200, 1_000).eigenvalues;
        let basis = solve(&bent, &made, 40, 100);
        for (k, (&ritz, &bound)) in basis.eigenvalues.iter().zip(&basis.certificate.bounds).enumerate() {
            let name = format!("{:?} {mass:?} {boundary:?}, pair {k}", wanted[kind]);
            assert!(ritz >= exact[k] - 1e-8 * exact[39], "{name}: {ritz} {}", exact[k]);
            let nearest = exact.iter().map(|value| (value - ritz).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= bound + 1e-9, "{name}: {ritz} ± {bound}, nearest at {nearest}");
        }
        let mean = error(&basis.eigenvalues[5..], &exact[5..40]);
        assert!(mean < 2.0, "{:?} {mass:?} {boundary:?}: {mean} %", wanted[kind]);
    }
}

#[test]
fn a_constant_potential_shifts_what_the_laplacian_gives() {
    let mesh = generate(Shape::Genus(2), 3_000).unwrap();
    let plain = solve(&mesh, &operator(&mesh, OperatorKind::Auto, MassKind::default(), Boundary::Neumann), 30, 60);
    for shift in [3.0, -2.0] {
        let potential = Potential::Values(vec![shift; mesh.positions.len()]);
        let kind = OperatorKind::Hamiltonian { potential };
        let basis = solve(&mesh, &operator(&mesh, kind, MassKind::default(), Boundary::Neumann), 30, 60);
        for (value, plain) in basis.eigenvalues.iter().zip(&plain.eigenvalues) {
            assert!((value - plain - shift).abs() < 1e-4 * plain.abs().max(1.0), "{value} {plain} {shift}");
        }
    }
}

#[test]
fn surfaces_that_meet_in_an_edge_or_a_point_have_spectra() {
    // Three squares of 40 × 40 vertices along a common side; two cones at a common tip.
    let side = 40;
    let square = grid(side);
    let mut pages = TriangleMesh::default();
    for page in 0..3u32 {
        let (sine, cosine) = (2.1 * f64::from(page)).sin_cos();
        let base = pages.positions.len() as u32;
        pages.positions.extend(square.positions.iter().map(|p| [p[0] * cosine, p[0] * sine, p[1]]));
        // The side x = 0 is that of the first page.
        let number = |v: u32| if v.is_multiple_of(side as u32) { v } else { base + v };
        pages.faces.extend(square.faces.iter().map(|face| face.map(number)));
    }
    let mut cones = union(&[
        generate(Shape::Sphere, 800).unwrap(),
        placed(generate(Shape::Sphere, 800).unwrap(), 1.0, [2.0, 0.0, 0.0]),
    ]);
    let half = cones.positions.len() as u32 / 2;
    cones.faces.iter_mut().flatten().for_each(|v| {
        if *v == half {
            *v = 0;
        }
    });
    for (mesh, massless) in [(pages, 2 * side), (cones, 1)] {
        let made = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
        assert_eq!(made.report.massless_vertices, massless);
        assert!(made.report.non_manifold_edges + made.report.non_manifold_vertices > 0);
        let basis = solve(&mesh, &made, 60, 150);
        assert!(basis.eigenvalues.is_sorted() && basis.eigenvalues.iter().all(|value| value.is_finite()));
        assert!(basis.certificate.orthonormality_defect < 1e-8);
    }
}

#[test]
fn more_pairs_than_unknowns_are_refused() {
    let mesh = grid(5);
    let made = operator(&mesh, OperatorKind::Auto, MassKind::default(), Boundary::Dirichlet);
    let parameters = ApproximationParameters {
        count: 10,
        dimension: 20,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: false,
        seed: 0,
    };
    let refused = approximate(&mesh, &made, &parameters, &Unwatched);
    assert!(matches!(refused, Err(ApproximationError::Count { count: 10, unknowns: 9 })));
    assert_eq!(solve(&mesh, &made, 9, 20).count(), 9);
}

/// A disk that is stretched on one side and folds on the other: beside the fold triangles have next to no area.
#[test]
fn bounds_are_narrow_and_hold_beside_triangles_of_next_to_no_area() {
    let mut mesh = generate(Shape::Disk, 3_000).unwrap();
    mesh.positions.iter_mut().for_each(|p| *p = p.map(|x| (3.0 + 2.0 * p[0]) * x));
    let made = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
    let basis = solve(&mesh, &made, 40, 150);
    let all = solve(&mesh, &made, 60, mesh.positions.len());
    for (k, (value, bound)) in basis.eigenvalues.iter().zip(&basis.certificate.bounds).enumerate().skip(1) {
        let nearest = all.eigenvalues.iter().map(|exact| (value - exact).abs()).fold(f64::INFINITY, f64::min);
        assert!(nearest <= *bound, "pair {k}: {nearest} from the next exact value, {bound}");
        assert!(*bound <= 0.1 * value, "pair {k}: {value} ± {bound}");
    }
}

/// Twice the same column, but for the last bits of one entry: the difference has a mass and an energy of nothing but
/// rounding errors, and whatever quotient of the two it likes.
#[test]
fn columns_that_all_but_equal_others_add_no_pairs() {
    let mesh = generate(Shape::Sphere, 2_000).unwrap();
    let made = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
    let parameters = ApproximationParameters {
        count: 60,
        dimension: 150,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: false,
        seed: 0,
    };
    let space = subspace(&mesh, &made, &parameters, &Unwatched).unwrap();
    let expected = reduce(&made.problem, space.clone(), 60, &Unwatched).unwrap().pairs.values;
    for (column, units) in (0..24u32).map(|k| (5 * k, 1 + k % 6)) {
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut changed = false;
        for row in 0..space.rows() {
            let (columns, entries) = space.row(row);
            indices.extend_from_slice(columns);
            values.extend_from_slice(entries);
            if let Some(own) = columns.iter().position(|&c| c == column) {
                indices.push(space.columns() as u32);
                let bits = if changed { 0 } else { units };
                values.push(f32::from_bits(entries[own].to_bits() + bits));
                changed = true;
            }
            offsets.push(indices.len());
        }
        let twice = SparseMatrix::from_sorted_parts(space.rows(), space.columns() + 1, offsets, indices, values);
        let found = reduce(&made.problem, twice, 60, &Unwatched).unwrap();
        for (k, (found, expected)) in found.pairs.values.iter().zip(&expected).enumerate() {
            // The difference itself, a hat of one vertex, may take a little off a value.
            assert!(
                (found - expected).abs() < 1e-2 * expected + 1e-8,
                "column {column}, pair {k}: {found}, {expected}"
            );
        }
    }
}

#[test]
fn certified_pairs_enclose_the_exact_ones_index_by_index_or_are_refused() {
    let mesh = generate(Shape::Torus, 3_000).unwrap();
    let made = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
    let parameters = ApproximationParameters {
        count: 40,
        dimension: 190,
        space: Space::Heat(HeatParameters::default()),
        goal: Some(Goal { error: 0.01, rounds: MOST_ROUNDS }),
        certify: true,
        seed: 0,
    };
    let basis = approximate(&mesh, &made, &parameters, &Unwatched).unwrap();
    let finer = ApproximationParameters { dimension: 700, certify: false, ..parameters };
    let finer = approximate(&mesh, &made, &finer, &Unwatched).unwrap();
    let certificate = &basis.certificate;
    assert_eq!((certificate.complete, certificate.inertia.len()), (Some(true), 1));
    assert!(certificate.inertia[0].below >= 40);
    for k in 1..40 {
        let (value, bound) = (basis.eigenvalues[k], certificate.bounds[k]);
        assert!(bound < 0.05 * value, "pair {k}: {bound} of {value}");
        // Another space has its values above the exact ones, too, and nearer.
        assert!(value - finer.eigenvalues[k] <= bound, "pair {k}: {value} and {}", finer.eigenvalues[k]);
    }
    // Triangles whose sizes differ by orders of magnitude leave nothing to enclose with: that is said.
    let graded = chladni_mesh::TriangleMesh {
        positions: mesh
            .positions
            .iter()
            .map(|p| if p[0] > 0.0 { [p[0] * 1e-4, p[1] * 1e-4, p[2] * 1e-4] } else { *p })
            .collect(),
        faces: mesh.faces.clone(),
        ..Default::default()
    };
    let made = operator(&graded, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
    match approximate(&graded, &made, &parameters, &Unwatched) {
        Ok(basis) => {
            let largest = basis.certificate.bounds.iter().zip(&basis.eigenvalues).skip(1);
            assert!(largest.into_iter().all(|(bound, value)| *bound <= 0.5 * value));
        }
        Err(error) => assert_eq!(error.kind(), "unproven", "{error}"),
    }
}

/// Of three eigenvalues 10, 11 and 12 the second is found exactly and the others 1.5 too high: by value it comes first,
/// and is the second.
#[test]
fn distances_are_from_the_eigenvalue_of_the_same_index() {
    let values = [11.0, 11.5, 13.5];
    let mut distances = [0.0, 0.75, 0.75];
    super::by_index(&values, &mut distances, 2.0);
    assert_eq!(distances, [0.5, 0.75, 0.75]);
    let exact = [10.0, 11.0, 12.0];
    for ((value, distance), exact) in values.iter().zip(distances).zip(exact) {
        assert!(value - 2.0 * distance <= exact && exact <= *value);
    }
    let mut endless = [f64::INFINITY, 0.25, 0.25];
    super::by_index(&values, &mut endless, 1.0);
    assert_eq!(endless, [f64::INFINITY, 0.25, 0.25]);
}

/// A share of the edges flipped, by a pattern: thin triangles everywhere.
fn flipped(mesh: &TriangleMesh, every: usize) -> TriangleMesh {
    let mut edges = std::collections::BTreeMap::new();
    for (f, face) in mesh.faces.iter().enumerate() {
        for k in 0..3 {
            edges.insert((face[k], face[(k + 1) % 3]), (f, face[(k + 2) % 3]));
        }
    }
    let (mut faces, mut touched) = (mesh.faces.clone(), vec![false; mesh.faces.len()]);
    for (&(a, b), &(f, c)) in edges.iter().step_by(every) {
        let Some(&(g, d)) = edges.get(&(b, a)) else { continue };
        if !touched[f] && !touched[g] && !edges.contains_key(&(c, d)) && !edges.contains_key(&(d, c)) {
            (faces[f], faces[g]) = ([c, a, d], [d, b, c]);
            (touched[f], touched[g]) = (true, true);
        }
    }
    TriangleMesh { positions: mesh.positions.clone(), faces, ..Default::default() }
}

#[test]
fn columns_of_few_vertices_hold_thin_triangles_and_say_how_far_they_diffused() {
    let mesh = flipped(&noisy(&generate(Shape::Sphere, 2_000).unwrap(), 0.2, 5).unwrap(), 4);
    let made = operator(&mesh, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Neumann);
    let parameters = |heat| ApproximationParameters {
        count: 100,
        dimension: 250,
        space: Space::Heat(heat),
        goal: Some(Goal { error: 0.01, rounds: 0 }),
        certify: false,
        seed: 0,
    };
    let exact = solve(&mesh, &made, 100, 1_400).eigenvalues;
    let mean = |heat| {
        let basis = approximate(&mesh, &made, &parameters(heat), &Unwatched).unwrap();
        (error(&basis.eigenvalues[1..], &exact[1..]), basis.certificate.accuracy.unwrap().heat_steps)
    };
    let (usual, longer) = (HeatParameters::default(), HeatParameters::default().for_few_vertices().unwrap());
    // What somebody chose is left as it is.
    let (chosen, steps) = mean(HeatParameters { tolerance: 0.9 * usual.tolerance, ..usual });
    assert_eq!(steps, Some(usual.steps));
    let (fitted, steps) = mean(usual);
    assert_eq!(steps, Some(longer.steps));
    assert!(fitted < 0.1 && 3.0 * fitted < chosen, "{chosen} % became {fitted} %");
    assert_eq!(longer.for_few_vertices(), None);
}

#[test]
fn zeros_are_exact_and_small_values_beside_them_are_none() {
    // Spheres of very different sizes: the lowest eigenvalues of the large one are less than rounding makes of the
    // largest.
    let sphere = generate(Shape::Sphere, 3_000).unwrap();
    let mesh = union(&[placed(sphere.clone(), 1e5, [0.0; 3]), placed(sphere, 1.0, [3e5, 0.0, 0.0])]);
    let made = operator(&mesh, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Neumann);
    let basis = solve(&mesh, &made, 100, 250);
    assert_eq!(basis.eigenvalues[..2], [0.0, 0.0]);
    assert_eq!(kernel_size(&basis.eigenvalues).unwrap(), 2);
    assert!((basis.eigenvalues[2] * 1e10 / 2.0 - 1.0).abs() < 0.03, "{}", basis.eigenvalues[2]);
}

#[test]
fn a_small_mesh_is_solved_whole_where_columns_do_not_reach_the_goal() {
    let mut mesh = grid(25);
    let longest = mesh.positions.iter().map(|p| p[0]).fold(0.0, f64::max);
    mesh.positions.iter_mut().for_each(|p| *p = [p[0] / longest, p[1] / longest * 0.01, 0.0]);
    let made = operator(&mesh, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Neumann);
    let parameters = ApproximationParameters {
        count: 40,
        dimension: dimension_for(40, 2),
        space: Space::Heat(HeatParameters::default()),
        goal: Some(Goal { error: 0.01, rounds: MOST_ROUNDS }),
        certify: false,
        seed: 0,
    };
    let basis = approximate(&mesh, &made, &parameters, &Unwatched).unwrap();
    let told = basis.certificate.accuracy.unwrap();
    assert!(told.reached && told.rounds > 0, "{told:?}");
}

#[test]
fn pairs_that_are_a_part_of_the_kernel_are_certified() {
    let sphere = generate(Shape::Sphere, 40).unwrap();
    let parts: Vec<TriangleMesh> =
        (0..25).map(|k| placed(sphere.clone(), 1.0, [3.0 * f64::from(k), 0.0, 0.0])).collect();
    let mesh = union(&parts);
    let made = operator(&mesh, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Neumann);
    let parameters = ApproximationParameters {
        count: 10,
        dimension: 200,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: true,
        seed: 0,
    };
    let basis = approximate(&mesh, &made, &parameters, &Unwatched).unwrap();
    assert_eq!(basis.eigenvalues, [0.0; 10]);
    assert!(basis.certificate.complete == Some(true) && basis.certificate.inertia[0].below >= 25);
}
