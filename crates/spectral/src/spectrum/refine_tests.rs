use chladni_algebra::CpuSolver;
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble};
use crate::spectrum::approximate::{Goal, MOST_ROUNDS};
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::{Space, approximate};

fn parameters(count: usize, dimension: usize) -> ApproximationParameters {
    ApproximationParameters {
        count,
        dimension,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: false,
        seed: 0,
    }
}

fn worst(values: &[f64], exact: &[f64]) -> f64 {
    let first = values.len() / 10;
    values[first..].iter().zip(&exact[first..]).map(|(value, exact)| (value / exact - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn every_filter_brings_the_pairs_nearer_and_keeps_them_orthonormal() {
    let mesh = noisy(&generate(Shape::Disk, 1_500).unwrap(), 0.2, 3).unwrap();
    for (operator, mass, boundary) in [
        (OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann),
        (OperatorKind::Robust, MassKind::Consistent, Boundary::Dirichlet),
        (OperatorKind::Extrinsic { t: 0.5 }, MassKind::Voronoi, Boundary::Dirichlet),
    ] {
        let made = assemble(&mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched).unwrap();
        let exact = approximate(&mesh, &made, &parameters(60, 1_200), &Unwatched).unwrap().eigenvalues;
        let plain = approximate(&mesh, &made, &parameters(40, 80), &Unwatched).unwrap();
        let before = worst(&plain.eigenvalues, &exact);
        for (refinement, gain) in [
            (Refinement::InverseIteration, 2.5),
            (Refinement::Chebyshev { degree: 10 }, 1.2),
            (Refinement::Chebyshev { degree: 40 }, 2.5),
        ] {
            let refined = approximate_refined(&mesh, &made, &parameters(40, 80), refinement, &Unwatched);
            if mass == MassKind::Consistent && refinement != Refinement::InverseIteration {
                assert!(matches!(refined, Err(ApproximationError::Parameter { name: "refinement", .. })));
                continue;
            }
            let refined = refined.unwrap().pairs;
            let after = worst(&refined.values, &exact);
            assert!(after * gain < before, "{mass:?} {boundary:?} {refinement:?}: {before} to {after}");
            for (k, (value, exact)) in refined.values.iter().zip(&exact).enumerate() {
                assert!(*value > exact - 1e-8 * exact.abs() - 1e-8, "pair {k}: {value} below {exact}");
            }
            assert!(refined.orthonormality_defect < 1e-10);
            assert_eq!((refined.vectors.rows(), refined.vectors.columns()), (mesh.positions.len(), 40));
            // The stored columns are orthonormal for the mass of the input, and turned as promised.
            let mass = made.laplacian().mass.scaled(made.problem.area);
            for column in [0, 7, 39] {
                let x = refined.vectors.column(column);
                let norm: f64 = mass.multiply(&x).iter().zip(&x).map(|(a, b)| a * b).sum();
                assert!((norm - 1.0).abs() < 1e-10);
                let (low, high) = x.iter().fold((0.0f64, 0.0f64), |(l, h), &x| (l.min(x), h.max(x)));
                assert!(high >= -low);
            }
        }
    }
}

#[test]
fn a_mesh_of_few_vertices_is_refined_too() {
    let mesh = generate(Shape::Sphere, 42).unwrap();
    let made = assemble(&mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    for refinement in [Refinement::InverseIteration, Refinement::Chebyshev { degree: 3 }] {
        for count in [1, 20, 42] {
            let refined =
                approximate_refined(&mesh, &made, &parameters(count, 42), refinement, &Unwatched).unwrap().pairs;
            assert_eq!(refined.values.len(), count);
            assert!(refined.values[0].abs() < 1e-9 && refined.orthonormality_defect < 1e-9);
        }
    }
}

#[test]
fn degrees_out_of_range_are_refused() {
    for degree in [0, Refinement::MOST_DEGREE + 1] {
        assert!(Refinement::Chebyshev { degree }.check(true).is_err());
    }
    assert!(Refinement::Chebyshev { degree: 8 }.check(false).is_err());
    let read: Refinement = serde_json::from_str(r#"{"chebyshev": {"degree": 8}}"#).unwrap();
    assert_eq!(read, Refinement::Chebyshev { degree: 8 });
    assert_eq!(serde_json::to_string(&Refinement::InverseIteration).unwrap(), "\"inverse_iteration\"");
}

/// A strip of `columns × rows` vertices, `width` by `height`, at some place.
fn strip(columns: usize, rows: usize, [width, height]: [f64; 2], at: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..rows {
        for column in 0..columns {
            let place = |k: usize, of: usize, size: f64| size * k as f64 / (of - 1) as f64;
            mesh.positions.push([at + place(column, columns, width), place(row, rows, height), 0.0]);
        }
    }
    let vertex = |column: usize, row: usize| (row * columns + column) as u32;
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let [a, b] = [vertex(column, row), vertex(column + 1, row)];
            let [c, d] = [vertex(column, row + 1), vertex(column + 1, row + 1)];
            mesh.faces.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}

/// The lowest eigenvalues by a dense solve, in the units of the input.
fn dense(made: &MeshOperator, count: usize) -> Vec<f64> {
    let EigenProblem { stiffness, mass, area, .. } = &made.problem;
    let pairs = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), count, &Unwatched).unwrap();
    pairs.values.iter().map(|value| value / area).collect()
}

#[test]
fn a_refined_approximation_is_as_fine_as_its_goal_asks_for_and_says_so() {
    // Triangles of 50:1: the space that is made first is 80 % off.
    let mesh = strip(60, 20, [1.0, 0.01], 0.0);
    let made = assemble(&mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    let exact = dense(&made, 40);
    let goal = Some(Goal { error: 0.01, rounds: MOST_ROUNDS });
    for refinement in [Refinement::InverseIteration, Refinement::Chebyshev { degree: 20 }] {
        let wanted = ApproximationParameters { goal, ..parameters(40, 190) };
        let Refined { pairs, estimates, accuracy } =
            approximate_refined(&mesh, &made, &wanted, refinement, &Unwatched).unwrap();
        let accuracy = accuracy.unwrap();
        assert!(accuracy.reached, "{refinement:?}: {accuracy:?}");
        assert_eq!((pairs.values[0], estimates[0]), (0.0, 0.0));
        for (k, (value, exact)) in pairs.values.iter().zip(&exact).enumerate().skip(1) {
            assert!((value / exact - 1.0).abs() < 0.01, "{refinement:?}, pair {k}: {value}, {exact}");
            let error = value - exact - 1e-9 * exact;
            assert!(error < 4.0 * estimates[k], "{refinement:?}, pair {k}: {error} by an estimate of {}", estimates[k]);
        }
    }
}

#[test]
fn a_filter_never_makes_a_value_larger_or_goes_below_zero() {
    // Parts whose sizes differ by so much that rounding is all that a filter sees of the small one.
    for ratio in [1e-5, 1e-7, 1e-8] {
        let mut mesh = strip(12, 12, [1.0, 1.0], 0.0);
        let other = strip(9, 9, [ratio, ratio], 6.0);
        let first = mesh.positions.len() as u32;
        mesh.faces.extend(other.faces.iter().map(|face| face.map(|vertex| vertex + first)));
        mesh.positions.extend(other.positions);
        let made = assemble(&mesh, &OperatorParameters::default(), &Unwatched).unwrap();
        let wanted = ApproximationParameters { goal: Some(Goal { error: 0.01, rounds: 5 }), ..parameters(22, 172) };
        let plain = approximate(&mesh, &made, &wanted, &Unwatched).unwrap();
        let refined = match approximate_refined(&mesh, &made, &wanted, Refinement::InverseIteration, &Unwatched) {
            Ok(refined) => refined.pairs.values,
            Err(ApproximationError::Parameter { name: "refinement", .. }) => continue,
            Err(error) => panic!("{ratio}: {error}"),
        };
        let last = plain.eigenvalues[21];
        for (k, (new, old)) in refined.iter().zip(&plain.eigenvalues).enumerate() {
            // Rounding is of the size of the small part's largest eigenvalue.
            assert!(*new <= old + 1e-3 * last && *new > -1e-3 * last, "{ratio}, pair {k}: {new} of {old}");
        }
        assert_eq!((refined[0], plain.eigenvalues[0]), (0.0, 0.0), "{ratio}");
    }
}
