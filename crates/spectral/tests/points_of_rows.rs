//! Points in rows, as scanners and grids give them, have the eigenvalues of the surface that they came from.

use std::f64::consts::{PI, TAU};

use chladni_spectral::Unwatched;
use chladni_spectral::mesh::TriangleMesh;
use chladni_spectral::operator::{OperatorParameters, assemble};
use chladni_spectral::spectrum::hsim::{HsimParameters, Wanted, solve};

const COUNT: usize = 12;

fn eigenvalues(mesh: &TriangleMesh) -> (Vec<f64>, f64) {
    let operator = assemble(mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    let parameters = HsimParameters { wanted: Wanted::Count(COUNT), tolerance: 1e-8, ..HsimParameters::default() };
    let pairs = solve(mesh, &operator.problem, &parameters, false, &Unwatched).unwrap();
    (pairs.values, operator.problem.area)
}

fn of_points(positions: Vec<[f64; 3]>) -> (Vec<f64>, f64) {
    eigenvalues(&TriangleMesh { positions, ..Default::default() })
}

#[test]
fn points_of_a_torus_by_rows_have_the_eigenvalues_of_the_mesh() {
    for (across, along) in [(60, 20), (90, 41)] {
        let at = |k: usize| {
            let (u, v) = (TAU * (k % across) as f64 / across as f64, TAU * (k / across) as f64 / along as f64);
            let r = 1.0 + 0.3 * v.cos();
            [r * u.cos(), r * u.sin(), 0.3 * v.sin()]
        };
        let positions: Vec<[f64; 3]> = (0..across * along).map(at).collect();
        let faces = (0..across * along).flat_map(|k| {
            let (i, j) = (k % across, k / across);
            let corner = |i: usize, j: usize| (j % along * across + i % across) as u32;
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        let mesh = TriangleMesh { positions: positions.clone(), faces: faces.collect(), ..Default::default() };
        let ((wanted, whole), (found, area)) = (eigenvalues(&mesh), of_points(positions));
        // Diagonals differ, and with them the triangles in space.
        assert!((area / whole - 1.0).abs() < 1e-3, "{across} x {along}: {area} {whole}");
        for (x, y) in found.iter().zip(&wanted).skip(1) {
            assert!((x / y - 1.0).abs() < 1e-3, "{across} x {along}: {x} {y}");
        }
    }
}

#[test]
fn points_of_an_open_cylinder_have_its_analytic_eigenvalues_and_nearer_the_more_they_are() {
    let mut exact: Vec<f64> =
        (-9..=9).flat_map(|m| (0..9).map(move |k| f64::from(m * m) + (PI * f64::from(k) / 3.0).powi(2))).collect();
    exact.sort_by(f64::total_cmp);
    for shift in [0.0, 0.25, 0.5] {
        for (across, along, within) in [(40, 30, 2e-2), (80, 60, 5e-3)] {
            let at = |k: usize| {
                let (i, j) = ((k % across) as f64, (k / across) as f64);
                let angle = TAU * (i + shift * j) / across as f64;
                [angle.cos(), angle.sin(), 3.0 * j / (along - 1) as f64]
            };
            let (found, area) = of_points((0..across * along).map(at).collect());
            assert!((area / (6.0 * PI) - 1.0).abs() < within, "{area}");
            for (x, y) in found.iter().zip(&exact).skip(1) {
                assert!((x / y - 1.0).abs() < within, "{across} x {along}, {shift}: {x} {y}");
            }
        }
    }
}
