use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble};
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
            let refined = refined.unwrap();
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
            let refined = approximate_refined(&mesh, &made, &parameters(count, 42), refinement, &Unwatched).unwrap();
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
