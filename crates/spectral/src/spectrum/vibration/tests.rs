use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::operator::elastic::tests::{bar, plate};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
const HSIM: VibrationMethod = VibrationMethod::Hsim { tolerance: 1e-4 };

fn modes(body: ElasticBody<'_>, count: usize, clamped: Vec<u32>, method: VibrationMethod) -> ModalBasis {
    let parameters = VibrationParameters { count, material: MATERIAL, clamped: clamped.into(), method, seed: 0 };
    vibration_modes(body, &parameters, &Unwatched).unwrap()
}

fn local(dimension: usize) -> VibrationMethod {
    refined(dimension, 0)
}

fn refined(dimension: usize, inverse_iterations: usize) -> VibrationMethod {
    let inverse_iterations = Iterations::Exactly(inverse_iterations);
    VibrationMethod::Approximate { dimension, local_coordinates: true, inverse_iterations }
}

/// All modes in columns, and the largest entry of `|ΦᵀMΦ − I|`.
fn defect(basis: &ModalBasis) -> f64 {
    let (n, m) = (basis.vertices(), basis.count());
    let lifter = basis.lifter();
    let columns: Vec<Vec<f32>> = (0..m)
        .map(|mode| {
            let mut lifted = vec![0f32; 3 * n];
            lifter.lift(&(0..m).map(|k| f64::from(u8::from(k == mode))).collect::<Vec<_>>(), &mut lifted).unwrap();
            lifted
        })
        .collect();
    let mut worst = 0f64;
    for i in 0..m {
        for j in 0..=i {
            let products = columns[i].iter().zip(&columns[j]).enumerate();
            let product: f64 =
                products.map(|(row, (a, b))| basis.masses[row / 3] * f64::from(*a) * f64::from(*b)).sum();
            worst = worst.max((product - f64::from(u8::from(i == j))).abs());
        }
    }
    worst
}

#[test]
fn six_modes_of_a_free_object_are_rigid_and_the_others_are_not() {
    let shell = generate(Shape::Torus, 900).unwrap();
    let solid = bar([3.0, 1.0, 0.5], [9, 4, 3]);
    for body in [ElasticBody::Shell { mesh: &shell, thickness: 0.2 }, ElasticBody::Solid { mesh: &solid }] {
        for method in [
            HSIM,
            local(120),
            VibrationMethod::Approximate {
                dimension: 80,
                local_coordinates: false,
                inverse_iterations: Iterations::Exactly(0),
            },
            refined(80, 1),
        ] {
            let basis = modes(body, 20, Vec::new(), method);
            assert_eq!((basis.rigid, &basis.eigenvalues[..6]), (6, &[0.0; 6][..]));
            assert!(basis.eigenvalues[6] > 1e-5, "{:?}", &basis.eigenvalues[..8]);
            assert!(basis.eigenvalues.is_sorted());
            assert!(defect(&basis) < 2e-5, "{method:?}: {}", defect(&basis));
            // Rigid motions keep all distances: the field is affine with an antisymmetric matrix.
            for mode in 0..6 {
                let a: [f64; 12] = std::array::from_fn(|k| basis.affine.column(mode)[k]);
                for i in 0..3 {
                    for j in 0..3 {
                        assert!((a[4 * i + 1 + j] + a[4 * j + 1 + i]).abs() < 1e-12 * (1.0 + a[4 * i + 1 + j].abs()));
                    }
                }
            }
        }
    }
}

#[test]
fn approximate_values_lie_above_those_of_hsim_and_come_down_with_the_dimension() {
    let mesh = generate(Shape::Knot, 1500).unwrap();
    let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.3 };
    let exact = modes(body, 30, Vec::new(), HSIM);
    let mut last = f64::INFINITY;
    for dimension in [150, 400, 900] {
        let basis = modes(body, 30, Vec::new(), local(dimension));
        let excess = basis.eigenvalues[6..].iter().zip(&exact.eigenvalues[6..]).map(|(a, b)| a / b - 1.0);
        let excess: Vec<f64> = excess.collect();
        assert!(excess.iter().all(|&e| e > -1e-6), "Ritz values are upper bounds: {excess:?}");
        let mean = excess.iter().sum::<f64>() / excess.len() as f64;
        assert!(mean < 0.7 * last, "{dimension}: {mean}");
        last = mean;
    }
    assert!(last < 0.01, "{last}");
    assert_eq!(exact.metadata.json()["certificate"]["complete"], true);
    // Inverse iterations bring them down far further, at any dimension.
    let mut last = f64::INFINITY;
    for (iterations, bound) in [(1, 0.1), (2, 0.01), (3, 0.002)] {
        let basis = modes(body, 30, Vec::new(), refined(150, iterations));
        let excess = basis.eigenvalues[6..].iter().zip(&exact.eigenvalues[6..]).map(|(a, b)| a / b - 1.0);
        let worst = excess.map(|e| if e > -1e-6 { e } else { f64::INFINITY }).fold(0.0, f64::max);
        assert!(worst < bound && worst < last, "{iterations}: {worst}");
        last = worst;
    }
    // The bounds hold between the two.
    let basis = modes(body, 30, Vec::new(), local(400));
    for (value, bound) in basis.eigenvalues.iter().zip(&basis.bounds) {
        let nearest = exact.eigenvalues.iter().map(|e| (e - value).abs()).fold(f64::INFINITY, f64::min);
        assert!(nearest <= 1.01 * bound + 1e-9, "{value} ± {bound}");
    }
}

#[test]
fn iterations_go_on_until_the_estimate_allows_the_error_and_the_estimate_can_be_trusted() {
    let mesh = generate(Shape::Knot, 1500).unwrap();
    let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.05 };
    let exact = modes(body, 40, Vec::new(), HSIM).frequencies();
    let mut last = 0;
    for most in [0.05, 0.01, 1e-4] {
        let inverse_iterations = Iterations::Until(most);
        let method = VibrationMethod::Approximate { dimension: 80, local_coordinates: true, inverse_iterations };
        let basis = modes(body, 40, Vec::new(), method);
        let certificate = &basis.metadata.json()["certificate"];
        assert_eq!(certificate["complete"], false);
        assert!(certificate["estimated_error"].as_f64().unwrap() <= most);
        let made = certificate["inverse_iterations"].as_u64().unwrap();
        assert!(made >= last && made <= 10, "{most}: {made}");
        last = made;
        for (k, (found, exact)) in basis.frequencies().iter().zip(&exact).enumerate().skip(6) {
            assert!(found / exact - 1.0 < most, "{most}, {k}: {}", found / exact - 1.0);
        }
    }
    assert!(last > 1);
}

/// More modes than a panel has, some of them rigid, and vertices that do not move.
#[test]
fn the_bound_of_each_mode_is_the_norm_of_its_own_residual() {
    let mesh = generate(Shape::Torus, 600).unwrap();
    let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.1 };
    for clamped in [vec![], vec![3, 4, 5]] {
        let elastic = elastic::assemble(body, &MATERIAL, &clamped.clone().into(), &Unwatched).unwrap();
        let (mass, scale) = (elastic.problem.mass.lumped(), elastic.report.total_mass.sqrt());
        for method in [HSIM, local(100)] {
            let basis = modes(body, 45, clamped.clone(), method);
            assert_eq!(basis.bounds.len(), 45);
            for (mode, &bound) in basis.bounds.iter().enumerate() {
                if mode < basis.rigid {
                    assert_eq!(bound, 0.0);
                    continue;
                }
                let mut q = vec![0.0; 45];
                q[mode] = scale;
                let mut lifted = vec![0f32; 3 * basis.vertices()];
                basis.lifter().lift(&q, &mut lifted).unwrap();
                let moving = elastic.moving.iter().flat_map(|&v| [0, 1, 2].map(|axis| 3 * v as usize + axis));
                let x: Vec<f64> = moving.map(|row| f64::from(lifted[row])).collect();
                let value = basis.eigenvalues[mode] / elastic.eigenvalue_scale;
                let image = elastic.problem.stiffness.multiply(&x);
                let square: f64 =
                    image.iter().zip(&x).zip(&mass).map(|((kx, x), m)| (kx - value * m * x).powi(2) / m).sum();
                let expected = square.sqrt() * elastic.eigenvalue_scale;
                assert!((bound - expected).abs() <= 1e-6 * expected, "{mode}: {bound} is not {expected}");
            }
        }
    }
}

#[test]
fn clamped_vertices_stay_and_take_rigid_motions_away() {
    let mesh = bar([4.0, 1.0, 1.0], [12, 3, 3]);
    let all = 0..mesh.positions.len() as u32;
    let wall: Vec<u32> = all.filter(|&v| mesh.positions[v as usize][0] == 0.0).collect();
    let body = ElasticBody::Solid { mesh: &mesh };
    let exact = modes(body, 12, wall.clone(), HSIM);
    assert!(exact.rigid == 0 && exact.eigenvalues[0] > 0.0);
    let approximate = modes(body, 12, wall.clone(), local(100));
    for basis in [&exact, &approximate] {
        assert!(wall.iter().all(|&v| basis.at(v as usize).unwrap().iter().all(|x| *x == [0.0; 3])));
        assert!(defect(basis) < 2e-5);
    }
    assert!(
        approximate.eigenvalues[0] > exact.eigenvalues[0] && approximate.eigenvalues[0] < 1.6 * exact.eigenvalues[0]
    );
    // Held at one vertex it can still turn about it, at two about the line through them.
    for (clamped, rigid) in [(vec![0], 3), (vec![0, 12], 1), (vec![0, 12, 14], 0)] {
        assert_eq!(modes(body, 8, clamped, HSIM).rigid, rigid);
    }
}

/// The lowest values of the whole problem, by the dense solver.
fn dense_values(body: ElasticBody<'_>, count: usize, clamped: &[u32]) -> Vec<f64> {
    let elastic = elastic::assemble(body, &MATERIAL, &clamped.into(), &Unwatched).unwrap();
    let size = elastic.problem.size();
    let mut mass = DenseMatrix::zeros(size, size);
    elastic.problem.mass.lumped().iter().enumerate().for_each(|(k, &m)| mass.column_mut(k)[k] = m);
    let pairs = CpuSolver.lowest(elastic.problem.stiffness.to_dense(), mass, count, &Unwatched).unwrap();
    pairs.values.into_iter().map(|value| value * elastic.eigenvalue_scale).collect()
}

fn assert_dense(name: &str, body: ElasticBody<'_>, clamped: &[u32], counts: &[usize]) {
    let expected = dense_values(body, *counts.last().unwrap(), clamped);
    for &count in counts {
        let found = modes(body, count, clamped.to_vec(), HSIM);
        assert_eq!(found.eigenvalues.len(), count, "{name}");
        for (k, (value, expected)) in found.eigenvalues.iter().zip(&expected).enumerate() {
            if k < found.rigid {
                assert!(
                    *value == 0.0 && *expected < 1e-6 * found.eigenvalues[found.rigid],
                    "{name}, {count}: {expected}"
                );
            } else {
                assert!((value / expected - 1.0).abs() < 1e-6, "{name}, {count}, {k}: {value} is not {expected}");
            }
        }
    }
}

/// Around the size at which an object is no longer solved densely, with few and with many of its vertices held.
#[test]
fn hsim_has_the_values_of_a_dense_solver_whatever_the_size_and_the_clamps() {
    for (i, j) in [(12, 12), (20, 20), (40, 10), (60, 6), (30, 15), (23, 21)] {
        let mesh = plate(i as f64 / j as f64, 1.0, i, j);
        let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.02 };
        let n = mesh.positions.len() as u32;
        let (row, width) = (i as u32 + 1, i as u32 + 1);
        let left = (0..n).filter(|v| v % width == 0).collect();
        let rim =
            (0..n).filter(|v| [0, i as u32].contains(&(v % width)) || [0, j as u32].contains(&(v / width))).collect();
        let clamps: [(&str, Vec<u32>); 5] = [
            ("free", Vec::new()),
            ("a row", (0..row).collect()),
            ("a column", left),
            ("the rim", rim),
            ("a third", (0..n / 3).collect()),
        ];
        for (name, clamped) in &clamps {
            assert_dense(&format!("{i} × {j}, {name}"), body, clamped, &[20, 60]);
        }
    }
}

#[test]
fn hsim_has_the_values_of_a_dense_solver_for_cantilevers() {
    for cells in [[12, 5, 5], [16, 5, 5], [9, 4, 4], [20, 6, 3]] {
        let mesh = bar(cells.map(|c| c as f64), cells);
        let body = ElasticBody::Solid { mesh: &mesh };
        for held in [0.0, 0.4] {
            let most = held * cells[0] as f64;
            let wall: Vec<u32> =
                (0..mesh.positions.len() as u32).filter(|&v| mesh.positions[v as usize][0] <= most).collect();
            assert_dense(&format!("{cells:?}, {held}"), body, &wall, &[10, 40]);
        }
    }
}

#[test]
fn two_hundred_modes_of_a_plate_are_those_of_a_dense_solver() {
    let mesh = plate(1.0, 1.0, 31, 31);
    let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.02 };
    let rim = (0..1024u32).filter(|v| [0, 31].contains(&(v % 32)) || [0, 31].contains(&(v / 32))).collect::<Vec<_>>();
    assert_dense("the rim", body, &rim, &[200]);
    assert_dense("a row", body, &(0..32).collect::<Vec<_>>(), &[200]);
}

#[test]
fn two_objects_have_twelve_rigid_motions_and_every_frequency_twice() {
    let one = generate(Shape::Sphere, 42).unwrap();
    let mut two = one.clone();
    two.positions.extend(one.positions.iter().map(|p| [p[0] + 5.0, p[1], p[2]]));
    two.faces.extend(one.faces.iter().map(|face| face.map(|v| v + 42)));
    let single = modes(ElasticBody::Shell { mesh: &one, thickness: 0.2 }, 12, Vec::new(), HSIM);
    let double = modes(ElasticBody::Shell { mesh: &two, thickness: 0.2 }, 24, Vec::new(), HSIM);
    assert_eq!(double.rigid, 12);
    for (k, value) in double.eigenvalues.iter().enumerate() {
        let expected = single.eigenvalues[k / 2];
        assert!((value - expected).abs() <= 1e-4 * expected, "{k}: {value} {expected}");
    }
}

#[test]
fn a_mode_at_a_vertex_is_that_of_the_lifted_state_and_products_agree() {
    let mesh = generate(Shape::Torus, 600).unwrap();
    for method in [HSIM, local(100)] {
        let basis = modes(ElasticBody::Shell { mesh: &mesh, thickness: 0.2 }, 15, Vec::new(), method);
        let q: Vec<f64> = (0..15).map(|k| f64::from(k).cos()).collect();
        let mut lifted = vec![0f32; 3 * basis.vertices()];
        basis.lifter().lift(&q, &mut lifted).unwrap();
        let w: Vec<[f64; 3]> = (0..basis.vertices()).map(|v| [0.1, 0.7, -0.3].map(|x| (x * v as f64).sin())).collect();
        let product: f64 = basis.transposed_times(&w).unwrap().iter().zip(&q).map(|(a, b)| a * b).sum();
        let mut expected = 0.0;
        for (v, w) in w.iter().enumerate() {
            let there = basis.at(v).unwrap();
            for axis in 0..3 {
                let direct: f64 = there.iter().zip(&q).map(|(mode, q)| mode[axis] * q).sum();
                assert!((direct - f64::from(lifted[3 * v + axis])).abs() < 1e-5);
                expected += direct * w[axis];
            }
        }
        assert!((product - expected).abs() < 1e-6 * basis.vertices() as f64);
        assert!(basis.at(basis.vertices()).is_err() && basis.transposed_times(&w[1..]).is_err());
    }
}

#[test]
fn what_is_no_object_is_refused_by_name() {
    let mesh = generate(Shape::Sphere, 42).unwrap();
    let ask = |mesh: &TriangleMesh, thickness, count, clamped: Vec<u32>| {
        let parameters =
            VibrationParameters { count, material: MATERIAL, clamped: clamped.into(), method: local(30), seed: 0 };
        vibration_modes(ElasticBody::Shell { mesh, thickness }, &parameters, &Unwatched).unwrap_err().to_string()
    };
    assert!(ask(&mesh, 0.0, 10, vec![]).starts_with("parameter \"thickness\": must be between"));
    assert!(ask(&mesh, f64::NAN, 10, vec![]).starts_with("parameter \"thickness\""));
    assert!(ask(&mesh, 0.1, 10, vec![42]).contains("vertex 42 is not one of the 42"));
    assert!(ask(&mesh, 0.1, 10, (0..42).collect()).contains("no vertex is left that can move"));
    assert_eq!(ask(&mesh, 0.1, 127, vec![]), "127 modes were requested, but only 126 coordinates can move");
    let mut dust = TriangleMesh::default();
    for k in 0..70u32 {
        dust.positions.extend([[0.0, 0.0, f64::from(k)], [1.0, 0.0, f64::from(k)], [0.0, 1.0, f64::from(k)]]);
        dust.faces.push([3 * k, 3 * k + 1, 3 * k + 2]);
    }
    assert!(ask(&dust, 0.1, 10, vec![]).contains("70 parts"));
    let none = TriangleMesh { positions: vec![[0.0; 3]; 3], faces: vec![[0, 1, 2]], ..Default::default() };
    assert_eq!(ask(&none, 0.1, 3, vec![]), "the mesh has no area");
}

/// Around its twelve vertices of valence five a thin icosphere has modes that no local function holds, within a
/// hundredth of others.
#[test]
fn estimates_of_thin_closed_shells_are_true_although_the_space_lacks_modes() {
    let mesh = generate(Shape::Sphere, 642).unwrap();
    for (thickness, count) in [(0.001, 60), (0.003, 60), (0.003, 30)] {
        let body = ElasticBody::Shell { mesh: &mesh, thickness };
        let exact = dense_values(body, count, &[]);
        for (seed, inverse_iterations) in [
            (0, Iterations::Until(0.01)),
            (1, Iterations::Until(0.01)),
            (2, Iterations::Until(0.01)),
            (0, Iterations::Exactly(3)),
        ] {
            let method = VibrationMethod::Approximate { dimension: 120, local_coordinates: true, inverse_iterations };
            let parameters =
                VibrationParameters { count, material: MATERIAL, clamped: Clamps::default(), method, seed };
            let basis = vibration_modes(body, &parameters, &Unwatched).unwrap();
            let certificate = &basis.metadata.json()["certificate"];
            let said = certificate["estimated_error"].as_f64().unwrap();
            let each = certificate["estimated_errors"].as_array().unwrap();
            assert_eq!(each.len(), count - 6);
            let mut worst = 0.0f64;
            for (k, (found, exact)) in basis.eigenvalues.iter().zip(&exact).enumerate().skip(6) {
                let error = (found / exact).sqrt() - 1.0;
                assert!(error > -1e-6, "{k}: {error}");
                assert!(error <= 2.0 * each[k - 6].as_f64().unwrap() + 1e-6, "{thickness}, {seed}, {k}: {error}");
                worst = worst.max(error);
            }
            let context = format!("{thickness}, {count}, {seed}, {inverse_iterations:?}: {said}, {worst}");
            assert!(certificate["lacking"].as_u64().unwrap() > 0, "{context}");
            match inverse_iterations {
                Iterations::Until(most) => assert!(said <= most && certificate["complete"] == true, "{context}"),
                Iterations::Exactly(_) => assert!(said < 3.0 * worst && worst > 0.03, "{context}"),
            }
        }
    }
}

#[test]
fn nothing_is_lacking_where_the_local_functions_hold_all_modes() {
    let (knot, torus) = (generate(Shape::Knot, 1500).unwrap(), generate(Shape::Torus, 900).unwrap());
    let (square, bar) = (plate(1.0, 1.0, 24, 24), bar([4.0, 1.0, 1.0], [16, 4, 4]));
    for (name, body, clamped) in [
        ("knot", ElasticBody::Shell { mesh: &knot, thickness: 0.05 }, vec![]),
        ("torus", ElasticBody::Shell { mesh: &torus, thickness: 0.01 }, vec![]),
        ("plate", ElasticBody::Shell { mesh: &square, thickness: 0.01 }, vec![]),
        ("clamped plate", ElasticBody::Shell { mesh: &square, thickness: 0.01 }, (0..25).collect()),
        ("bar", ElasticBody::Solid { mesh: &bar }, vec![]),
    ] {
        let exact = dense_values(body, 40, &clamped);
        let inverse_iterations = Iterations::Until(0.01);
        let method = VibrationMethod::Approximate { dimension: 80, local_coordinates: true, inverse_iterations };
        let basis = modes(body, 40, clamped, method);
        let certificate = &basis.metadata.json()["certificate"];
        let said = certificate["estimated_error"].as_f64().unwrap();
        let errors = basis.eigenvalues.iter().zip(&exact).skip(basis.rigid).map(|(a, b)| (a / b).sqrt() - 1.0);
        let worst = errors.fold(0.0, f64::max);
        assert!(worst <= 2.0 * said + 1e-9 && said <= 0.01, "{name}: {worst}, {said}");
        assert_eq!((&certificate["complete"], &certificate["lacking"]), (&false.into(), &0.into()), "{name}");
        let counted = &certificate["inertia"][0];
        let below = exact.iter().filter(|&&value| value < counted["shift"].as_f64().unwrap()).count();
        assert_eq!(counted["below"].as_u64(), Some(below as u64), "{name}");
    }
}
