//! Potentials that hide the surface: deep wells at a few vertices, and large constants of either sign.

use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::Shape;

use super::solve;
use super::tests::{count, exact, problem, rough, solved};
use crate::operator::{Boundary, MassKind, OperatorKind, Potential};

#[test]
fn what_lies_above_deep_wells_is_found_at_any_tolerance() {
    let mesh = rough(Shape::Genus(1), 1300);
    let vertices = mesh.positions.len();
    for (wells, depth) in [(1, 1e4), (1, 1e6), (5, 1e6), (15, 1e8)] {
        let mut values = vec![0.0; vertices];
        (0..wells).for_each(|k| values[k * vertices / wells] = -depth * (1.0 + 0.03 * k as f64));
        let operator = OperatorKind::Hamiltonian { potential: Potential::Values(values) };
        let of = problem(&mesh, operator, MassKind::Barycentric, Boundary::Neumann);
        let truth = exact(&of, 60);
        for (pairs, tolerance) in [(wells, 1e-2), (wells + 1, 1e-2), (wells + 9, 1e-2), (40, 1e-2), (40, 1e-6)] {
            let what = format!("{wells} wells of {depth:e}, {pairs} pairs, {tolerance:e}");
            let found = solved(&mesh, &of, &count(pairs, tolerance), &what);
            for (k, (&value, &truth)) in found.values.iter().zip(&truth).enumerate() {
                let error = (value - truth).abs();
                assert!(error <= found.bounds[k] + 1e-13 * depth, "{what}: pair {k} is {value}, not {truth}");
                assert!(error <= tolerance * truth.abs() + 1e-13 * depth, "{what}: pair {k} is {value}, not {truth}");
            }
        }
    }
}

#[test]
fn a_potential_far_below_zero_is_one_about_zero_and_a_constant() {
    let mesh = rough(Shape::Knot, 1500);
    let mut random = SplitMix64::new(5);
    let rest: Vec<f64> = mesh.positions.iter().map(|_| 100.0 * random.unit()).collect();
    let values = |height: f64| {
        let potential = Potential::Values(rest.iter().map(|value| value + height).collect());
        let operator = OperatorKind::Hamiltonian { potential };
        let of = problem(&mesh, operator, MassKind::Barycentric, Boundary::Neumann);
        solve(&mesh, &of, &count(30, 1e-6), false, &Unwatched).unwrap().values
    };
    let plain = values(0.0);
    for height in [-1e7, -1e6, -1e5, 1e6] {
        for (k, (moved, plain)) in values(height).iter().zip(&plain).enumerate() {
            assert!(
                (moved - plain - height).abs() <= 1e-8 * plain.abs() + 1e-14 * height.abs(),
                "pair {k}: {moved} {plain}"
            );
        }
    }
}
