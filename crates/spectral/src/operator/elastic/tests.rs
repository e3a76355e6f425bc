use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

use super::rigid::RigidMotions;
use super::*;

/// A rectangle of `a × b` in the plane z = 0, with `nx × ny` cells whose diagonals alternate from row to row.
pub(crate) fn plate(a: f64, b: f64, nx: usize, ny: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for j in 0..=ny {
        for i in 0..=nx {
            mesh.positions.push([a * i as f64 / nx as f64, b * j as f64 / ny as f64, 0.0]);
        }
    }
    let at = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    for j in 0..ny {
        for i in 0..nx {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if j % 2 == 0 {
                mesh.faces.extend([[p, q, r], [p, r, s]]);
            } else {
                mesh.faces.extend([[p, q, s], [q, r, s]]);
            }
        }
    }
    mesh
}

/// A box of `cells` cubes, each cut into six tetrahedra around its diagonal.
pub(crate) fn bar(size: [f64; 3], cells: [usize; 3]) -> TetMesh {
    let mut mesh = TetMesh::default();
    for k in 0..=cells[2] {
        for j in 0..=cells[1] {
            for i in 0..=cells[0] {
                let step = |axis: usize, at: usize| size[axis] * at as f64 / cells[axis] as f64;
                mesh.positions.push([step(0, i), step(1, j), step(2, k)]);
            }
        }
    }
    let at = |p: [usize; 3]| ((p[2] * (cells[1] + 1) + p[1]) * (cells[0] + 1) + p[0]) as u32;
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                for (order, turned) in [
                    ([0, 1, 2], false),
                    ([1, 2, 0], false),
                    ([2, 0, 1], false),
                    ([0, 2, 1], true),
                    ([2, 1, 0], true),
                    ([1, 0, 2], true),
                ] {
                    let mut corner = [i, j, k];
                    let mut path = [at(corner); 4];
                    for (step, axis) in order.into_iter().enumerate() {
                        corner[axis] += 1;
                        path[step + 1] = at(corner);
                    }
                    if turned {
                        path.swap(2, 3);
                    }
                    mesh.tetrahedra.push(path);
                }
            }
        }
    }
    mesh
}

fn shell(mesh: &TriangleMesh, thickness: f64, poisson: f64, clamped: &[u32]) -> ElasticProblem {
    let material = Material { young: 1.0, poisson, density: 1.0 };
    assemble(ElasticBody::Shell { mesh, thickness }, &material, &clamped.into(), &Unwatched).unwrap()
}

fn solid(mesh: &TetMesh, poisson: f64, clamped: &[u32]) -> ElasticProblem {
    let material = Material { young: 1.0, poisson, density: 1.0 };
    assemble(ElasticBody::Solid { mesh }, &material, &clamped.into(), &Unwatched).unwrap()
}

/// The lowest eigenvalues, densely; of the rows that `keep` tells.
fn lowest(elastic: &ElasticProblem, count: usize, keep: impl Fn(usize) -> bool) -> Vec<f64> {
    let rows: Vec<usize> = (0..elastic.problem.size()).filter(|&row| keep(row)).collect();
    let mut place = vec![usize::MAX; elastic.problem.size()];
    rows.iter().enumerate().for_each(|(at, &row)| place[row] = at);
    let (mut a, mut b) = (DenseMatrix::zeros(rows.len(), rows.len()), DenseMatrix::zeros(rows.len(), rows.len()));
    let mass = elastic.problem.mass.lumped();
    for (at, &row) in rows.iter().enumerate() {
        b.column_mut(at)[at] = mass[row];
        let (columns, values) = elastic.problem.stiffness.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            if place[column as usize] != usize::MAX {
                a.column_mut(at)[place[column as usize]] = value;
            }
        }
    }
    CpuSolver.lowest(a, b, count, &Unwatched).unwrap().values
}

fn all_rows(_: usize) -> bool {
    true
}

/// Bending only: displacements along z.
fn across(row: usize) -> bool {
    row % 3 == 2
}

/// `ω a² √(ρ h / D)` of a plate of side `a = 1`, whose problem has unit E and ρ.
fn plate_number(elastic: &ElasticProblem, value: f64, thickness: f64, poisson: f64) -> f64 {
    let omega = (value.max(0.0) * elastic.eigenvalue_scale).sqrt();
    let rigidity = thickness.powi(3) / (12.0 * (1.0 - poisson * poisson));
    omega * (thickness / rigidity).sqrt()
}

#[test]
fn a_free_plate_has_the_frequencies_of_leissa() {
    // Leissa 1969, completely free square plate, ν = 0.3.
    let expected = [13.489, 19.789, 24.432, 35.024, 35.024];
    let errors = [12, 20].map(|m| {
        let elastic = shell(&plate(1.0, 1.0, m, m), 0.01, 0.3, &[]);
        let values = lowest(&elastic, 8, across);
        assert!(values[2] < 1e-9 * values[3], "a translation and two rotations: {values:?}");
        let found = values[3..].iter().map(|&value| plate_number(&elastic, value, 0.01, 0.3));
        found.zip(expected).map(|(found, expected)| (found / expected - 1.0).abs()).fold(0.0, f64::max)
    });
    assert!(errors[1] < 0.03 && errors[1] < 0.6 * errors[0], "{errors:?}");
}

#[test]
fn the_bending_of_a_plate_depends_on_poissons_ratio() {
    // The lowest mode of a free square plate, a twist: its energy is that of the shear, (1 − ν) D.
    let twist = |poisson: f64| {
        let elastic = shell(&plate(1.0, 1.0, 16, 16), 0.01, poisson, &[]);
        plate_number(&elastic, lowest(&elastic, 4, across)[3], 0.01, poisson)
    };
    // Leissa's tables give 14.10 for 0.225; Ritz's classical value.
    assert!((twist(0.225) / 14.10 - 1.0).abs() < 0.01, "{}", twist(0.225));
    assert!((twist(0.3) / 13.489 - 1.0).abs() < 0.01);
}

#[test]
fn a_clamped_strip_sounds_like_a_beam() {
    // Two columns of vertices are held, which holds the slope as well.
    let (length, width, m) = (1.0, 0.1, 40);
    let mesh = plate(length, width, m, 4);
    let held = length / m as f64;
    let all = 0..mesh.positions.len() as u32;
    let clamped: Vec<u32> = all.filter(|&v| mesh.positions[v as usize][0] < 1.5 * held).collect();
    let thickness = 0.01;
    let elastic = shell(&mesh, thickness, 0.0, &clamped);
    let omega = (lowest(&elastic, 1, across)[0] * elastic.eigenvalue_scale).sqrt();
    // The clamp is felt half an edge beyond the held vertices.
    let free = length - 0.5 * held;
    let beam = 1.875_104_f64.powi(2) * (thickness * thickness / 12.0).sqrt() / (free * free);
    assert!((omega / beam - 1.0).abs() < 0.04, "{omega} {beam}");
}

/// A square plate all around which vertices are held, as a clamp or by a hinge; the lowest numbers of its bending.
fn held_plate(m: usize, rotations: bool) -> (ElasticProblem, Vec<f64>) {
    let mesh = plate(1.0, 1.0, m, m);
    let border = |p: [f64; 3]| p[..2].iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9);
    let vertices = (0..mesh.positions.len() as u32).filter(|&v| border(mesh.positions[v as usize])).collect();
    let (thickness, material) = (0.01, Material { young: 1.0, poisson: 0.3, density: 1.0 });
    let body = ElasticBody::Shell { mesh: &mesh, thickness };
    let elastic = assemble(body, &material, &Clamps { vertices, rotations }, &Unwatched).unwrap();
    let values = lowest(&elastic, 6, across);
    let numbers = values.iter().map(|&value| plate_number(&elastic, value, thickness, 0.3)).collect();
    (elastic, numbers)
}

#[test]
fn clamps_hold_rotations_and_hinges_do_not() {
    // Leissa 1973: all four edges simply supported, π² (i² + j²), and all four clamped.
    let pi = std::f64::consts::PI;
    let supported = [2.0, 5.0, 5.0, 8.0, 10.0, 10.0].map(|sum| pi * pi * sum);
    let clamped = [35.985, 73.394, 73.394, 108.217, 131.581, 132.205];
    for (rotations, expected) in [(false, supported), (true, clamped)] {
        let errors = [12, 20].map(|m| {
            let (elastic, found) = held_plate(m, rotations);
            assert_eq!(elastic.report.clamped, 4 * m);
            // Diagonals cut two of the corners off.
            assert_eq!(elastic.report.held_edges, if rotations { 4 * m + 2 } else { 0 });
            found.iter().zip(expected).map(|(found, expected)| (found / expected - 1.0).abs()).fold(0.0, f64::max)
        });
        assert!(errors[1] < 0.05 && errors[1] < 0.6 * errors[0], "{rotations}: {errors:?}");
    }
}

#[test]
fn a_strip_clamped_at_its_end_sounds_like_a_cantilever_and_does_not_swing() {
    let (m, thickness) = (40, 0.01);
    let mesh = plate(1.0, 0.1, m, 4);
    let end: Vec<u32> = (0..mesh.positions.len() as u32).filter(|&v| mesh.positions[v as usize][0] == 0.0).collect();
    let material = Material { young: 1.0, poisson: 0.0, density: 1.0 };
    let held = |rotations: bool| {
        let clamps = Clamps { vertices: end.clone(), rotations };
        assemble(ElasticBody::Shell { mesh: &mesh, thickness }, &material, &clamps, &Unwatched).unwrap()
    };
    let clamp = held(true);
    assert_eq!((clamp.report.clamped, clamp.report.held_edges), (5, 4));
    // A hinge leaves the strip free to turn about its end.
    assert_eq!(RigidMotions::new(&held(false)).motions.len(), 1);
    assert!(RigidMotions::new(&clamp).motions.is_empty());
    let values = lowest(&clamp, 2, across);
    for (value, root) in values.iter().zip([1.875_104f64, 4.694_091]) {
        let (omega, beam) =
            ((value * clamp.eigenvalue_scale).sqrt(), root.powi(2) * (thickness * thickness / 12.0).sqrt());
        assert!((omega / beam - 1.0).abs() < 0.02, "{omega} {beam}");
    }
}

#[test]
fn held_rotations_leave_the_matrix_symmetric_and_resist_turning_on_any_surface() {
    // A ring of the sphere is held: what is left, two caps, is symmetric, positive, and apart.
    let sphere = generate(Shape::Sphere, 400).unwrap();
    let vertices: Vec<u32> =
        (0..sphere.positions.len() as u32).filter(|&v| sphere.positions[v as usize][2].abs() < 0.2).collect();
    let body = ElasticBody::Shell { mesh: &sphere, thickness: 0.02 };
    let held = |rotations| {
        let clamps = Clamps { vertices: vertices.clone(), rotations };
        assemble(body, &Material::default(), &clamps, &Unwatched).unwrap()
    };
    let (hinge, clamp) = (held(false), held(true));
    assert!(clamp.report.held_edges > vertices.len() && hinge.report.held_edges == 0);
    let stiffness = &clamp.problem.stiffness;
    for row in 0..stiffness.rows() {
        for (&column, value) in stiffness.row(row).0.iter().zip(stiffness.row(row).1) {
            let (columns, values) = stiffness.row(column as usize);
            assert_eq!(values[columns.binary_search(&(row as u32)).unwrap()], *value);
        }
    }
    let (soft, stiff) = (lowest(&hinge, 4, all_rows), lowest(&clamp, 4, all_rows));
    assert!(soft[0] > 0.0 && stiff.iter().zip(&soft).all(|(a, b)| *a >= b * (1.0 - 1e-9)), "{soft:?} {stiff:?}");
}

#[test]
fn a_solid_cantilever_comes_down_to_the_frequency_of_a_beam() {
    // Linear tetrahedra are too stiff in bending; the error falls with the square of their size.
    let numbers = [1, 2, 3].map(|m| {
        let mesh = bar([10.0, 1.0, 1.0], [10 * m, m, m]);
        let all = 0..mesh.positions.len() as u32;
        let clamped: Vec<u32> = all.filter(|&v| mesh.positions[v as usize][0] == 0.0).collect();
        let elastic = solid(&mesh, 0.0, &clamped);
        assert!(RigidMotions::new(&elastic).motions.is_empty());
        (lowest(&elastic, 1, all_rows)[0] * elastic.eigenvalue_scale).sqrt() * 100.0 * 12f64.sqrt()
    });
    assert!(numbers.is_sorted_by(|a, b| a > b));
    let extrapolated = (9.0 * numbers[2] - 4.0 * numbers[1]) / 5.0;
    assert!((extrapolated / 3.516 - 1.0).abs() < 0.03, "{numbers:?} {extrapolated}");
}

#[test]
fn rigid_motions_are_the_whole_kernel() {
    let sphere = generate(Shape::Sphere, 42).unwrap();
    let moebius = moebius();
    let brick = bar([1.0, 2.0, 3.0], [2, 2, 2]);
    let single = TetMesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        tetrahedra: vec![[0, 1, 2, 3]],
    };
    let flat = plate(1.0, 1.0, 4, 4);
    let problems = [
        shell(&sphere, 0.05, 0.3, &[]),
        shell(&moebius, 0.05, 0.3, &[]),
        shell(&flat, 0.01, 0.3, &[]),
        solid(&brick, 0.3, &[]),
        solid(&single, 0.3, &[]),
    ];
    for (index, elastic) in problems.iter().enumerate() {
        let rigid = RigidMotions::new(elastic);
        assert_eq!((rigid.parts, rigid.motions.len()), (1, 6), "{index}");
        let norm = elastic.problem.stiffness.values().iter().fold(0f64, |most, x| x.abs().max(most));
        for motion in &rigid.motions {
            let image = elastic.problem.stiffness.multiply(&rigid.displacement(elastic, motion));
            assert!(image.iter().all(|x| x.abs() < 1e-12 * norm), "{index}");
        }
        let values = lowest(elastic, 7, all_rows);
        assert!(values[5].abs() < 1e-7 * values[6], "{index}: {values:?}");
        assert_eq!(elastic.problem.stiffness.transpose(), elastic.problem.stiffness, "symmetric to the last bit");
        assert!((elastic.problem.mass.lumped().iter().sum::<f64>() - 3.0).abs() < 1e-12);
    }
}

fn moebius() -> TriangleMesh {
    let (around, mut mesh) = (24u32, TriangleMesh::default());
    for i in 0..around {
        let angle = f64::from(i) / f64::from(around) * std::f64::consts::TAU;
        for s in [-0.3, 0.0, 0.3] {
            let radius = 1.0 + s * (0.5 * angle).cos();
            mesh.positions.push([radius * angle.cos(), radius * angle.sin(), s * (0.5 * angle).sin()]);
        }
    }
    let at = |i: u32, j: u32| if i < around { 3 * i + j } else { 2 - j };
    for i in 0..around {
        for j in 0..2 {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.faces.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh
}

#[test]
fn turning_moving_and_scaling_an_object_does_to_its_frequencies_what_it_must() {
    let (c, s) = (0.6, 0.8);
    let moved = |p: [f64; 3], scale: f64| {
        let [x, y, z] = p;
        [scale * (c * x - s * y) + 100.0, scale * (s * x + c * y) - 7.0, scale * z + 3.0]
    };
    let mesh = generate(Shape::Torus, 120).unwrap();
    let other = TriangleMesh { positions: mesh.positions.iter().map(|&p| moved(p, 2.0)).collect(), ..mesh.clone() };
    let tets = bar([1.0, 2.0, 1.0], [2, 3, 2]);
    let turned = TetMesh { positions: tets.positions.iter().map(|&p| moved(p, 2.0)).collect(), ..tets.clone() };
    for (a, b) in [
        (shell(&mesh, 0.1, 0.3, &[]), shell(&other, 0.2, 0.3, &[])),
        (solid(&tets, 0.3, &[]), solid(&turned, 0.3, &[])),
    ] {
        let (x, y) = (lowest(&a, 20, all_rows), lowest(&b, 20, all_rows));
        for k in 6..20 {
            assert!((x[k] / y[k] - 1.0).abs() < 1e-8);
        }
        assert!((a.eigenvalue_scale / b.eigenvalue_scale - 4.0).abs() < 1e-9);
    }
    // Twice as stiff and half as dense: twice the frequency.
    let material = Material { young: 2.0, poisson: 0.3, density: 0.5 };
    let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.1 };
    let harder = assemble(body, &material, &Clamps::default(), &Unwatched).unwrap();
    assert!((harder.eigenvalue_scale / shell(&mesh, 0.1, 0.3, &[]).eigenvalue_scale - 4.0).abs() < 1e-12);
}

#[test]
fn what_has_no_defined_stiffness_is_left_out_and_told() {
    let mut mesh = plate(1.0, 1.0, 3, 3);
    let end = mesh.positions.len() as u32;
    // A needle beside the plate, and a vertex of no face.
    mesh.positions.extend([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [9.0; 3]]);
    mesh.faces.push([end, end + 1, end + 2]);
    let elastic = shell(&mesh, 0.01, 0.3, &[0, 0]);
    assert_eq!((elastic.report.flat_elements, elastic.report.unattached, elastic.report.clamped), (1, 4, 1));
    assert_eq!(elastic.moving.len(), 15);
    let bad = TetMesh { positions: vec![[0.0; 3]; 4], tetrahedra: vec![[0, 1, 2, 3]] };
    let material = Material::default();
    let error = assemble(ElasticBody::Solid { mesh: &bad }, &material, &Clamps::default(), &Unwatched).unwrap_err();
    assert_eq!(error, OperatorError::NoVolume);
    let bad = TetMesh { tetrahedra: vec![[0, 1, 2, 4]], ..bad };
    let error = assemble(ElasticBody::Solid { mesh: &bad }, &material, &Clamps::default(), &Unwatched).unwrap_err();
    assert_eq!(error.to_string(), "tetrahedron 0 refers to vertex 4 of 4");
    for (material, name) in [
        (Material { young: 0.0, ..material }, "material.young"),
        (Material { poisson: 0.5, ..material }, "material.poisson"),
        (Material { density: f64::NAN, ..material }, "material.density"),
    ] {
        let error = assemble(ElasticBody::Solid { mesh: &bad }, &material, &Clamps::default(), &Unwatched).unwrap_err();
        assert!(matches!(error, OperatorError::Parameter { name: found, .. } if found == name));
    }
}
