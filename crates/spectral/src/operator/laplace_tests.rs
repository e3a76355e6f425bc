use chladni_algebra::SparseMatrix;

use super::*;
use crate::operator::MassMatrix;

fn tetrahedron() -> TriangleMesh {
    TriangleMesh {
        positions: vec![[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.3, 0.2, 0.8]],
        faces: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        ..Default::default()
    }
}

/// A wavy height field, `k × k` vertices, with obtuse faces.
fn sheet(k: u32) -> TriangleMesh {
    let at = |i: u32, j: u32| {
        let (x, y) = (f64::from(i) + 0.7 * f64::from(j), 0.6 * f64::from(j));
        [x, y, (0.9 * x).sin() * (1.3 * y).cos()]
    };
    let mut mesh = TriangleMesh::default();
    for j in 0..k {
        for i in 0..k {
            mesh.positions.push(at(i, j));
            if i + 1 < k && j + 1 < k {
                let v = j * k + i;
                mesh.faces.push([v, v + 1, v + k]);
                mesh.faces.push([v + 1, v + k + 1, v + k]);
            }
        }
    }
    mesh
}

fn entry(matrix: &SparseMatrix, row: usize, column: usize) -> f64 {
    let (indices, values) = matrix.row(row);
    indices.iter().position(|&c| c as usize == column).map_or(0.0, |at| values[at])
}

fn mass_row_sums(mass: &MassMatrix) -> Vec<f64> {
    mass.multiply(&vec![1.0; mass.size()])
}

const KINDS: [MassKind; 3] = [MassKind::Consistent, MassKind::Barycentric, MassKind::Voronoi];

#[test]
fn stiffness_is_symmetric_to_the_last_bit_and_has_constants_in_its_kernel() {
    for mesh in [tetrahedron(), sheet(70)] {
        let s = assemble(&mesh, MassKind::Barycentric).unwrap().stiffness;
        SparseMatrix::new(s.rows(), s.columns(), s.offsets().to_vec(), s.indices().to_vec(), s.values().to_vec())
            .unwrap();
        for row in 0..s.rows() {
            let (columns, values) = s.row(row);
            assert!(values.iter().sum::<f64>().abs() < 1e-12 * entry(&s, row, row));
            for (&column, &value) in columns.iter().zip(values) {
                assert_eq!(value, entry(&s, column as usize, row));
            }
        }
    }
}

#[test]
fn stiffness_agrees_with_the_angles_of_a_known_triangle() {
    // A right isosceles triangle: cotangents 0, 1, 1.
    let mesh = TriangleMesh {
        positions: vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
        faces: vec![[0, 1, 2]],
        ..Default::default()
    };
    let problem = assemble(&mesh, MassKind::Voronoi).unwrap();
    assert!((problem.area - 2.0).abs() < 1e-15);
    let s = &problem.stiffness;
    assert_eq!([entry(s, 0, 1), entry(s, 0, 2), entry(s, 1, 2)], [-0.5, -0.5, 0.0]);
    assert_eq!([entry(s, 0, 0), entry(s, 1, 1), entry(s, 2, 2)], [1.0, 0.5, 0.5]);
    // The circumcentre is the midpoint of the long edge.
    for (mass, expected) in mass_row_sums(&problem.mass).iter().zip([0.5, 0.25, 0.25]) {
        assert!((mass - expected).abs() < 1e-15);
    }
}

#[test]
fn dirichlet_energy_of_a_coordinate_function_on_a_plane_is_the_area() {
    let mut mesh = sheet(9);
    mesh.positions.iter_mut().for_each(|p| p[2] = 0.0);
    let problem = assemble(&mesh, MassKind::Barycentric).unwrap();
    let s = &problem.stiffness;
    let energy: f64 = (0..s.rows())
        .map(|r| {
            let (columns, values) = s.row(r);
            let product: f64 = columns.iter().zip(values).map(|(&c, v)| v * mesh.positions[c as usize][0]).sum();
            mesh.positions[r][0] * product
        })
        .sum();
    assert!((energy - problem.area).abs() < 1e-11 * problem.area);
}

#[test]
fn every_mass_sums_to_one_and_is_positive() {
    for mesh in [tetrahedron(), sheet(30)] {
        for kind in KINDS {
            let sums = mass_row_sums(&assemble(&mesh, kind).unwrap().mass);
            assert!(sums.iter().all(|&m| m > 0.0), "{kind:?}");
            assert!((sums.iter().sum::<f64>() - 1.0).abs() < 1e-13, "{kind:?}");
        }
    }
}

#[test]
fn row_sums_of_the_consistent_mass_are_the_barycentric_mass() {
    let consistent = mass_row_sums(&assemble(&sheet(20), MassKind::Consistent).unwrap().mass);
    let lumped = mass_row_sums(&assemble(&sheet(20), MassKind::Barycentric).unwrap().mass);
    assert!(consistent.iter().zip(&lumped).all(|(a, b)| (a - b).abs() < 1e-16));
}

#[test]
fn scaling_by_any_number_changes_the_area_alone() {
    for kind in KINDS {
        let reference = assemble(&sheet(12), kind).unwrap();
        for scale in [1024.0, 3.7, 1e-120, 1e120] {
            let mut mesh = sheet(12);
            mesh.positions.iter_mut().for_each(|p| *p = p.map(|c| c * scale));
            let scaled = assemble(&mesh, kind).unwrap();
            let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-11);
            assert!(close(scaled.stiffness.values(), reference.stiffness.values()));
            assert!(close(&mass_row_sums(&scaled.mass), &mass_row_sums(&reference.mass)));
            assert!((scaled.area / scale / scale / reference.area - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn zero_area_faces_and_lonely_vertices_leave_the_rest_alone() {
    let clean = assemble(&sheet(8), MassKind::Barycentric).unwrap();
    let mut mesh = sheet(8);
    mesh.positions.push([0.5, 0.5, 0.5]);
    mesh.faces.extend([[0, 0, 5], [7, 7, 7], [1, 64, 64]]);
    let (problem, report) = assemble_with_report(&mesh, MassKind::Barycentric).unwrap();
    assert_eq!(report, AssemblyReport { zero_area_faces: 3, massless_vertices: 1 });
    assert_eq!(problem.stiffness.row(64), (&[64u32][..], &[0.0][..]));
    assert_eq!(problem.stiffness.row(5), clean.stiffness.row(5));
    let MassMatrix::Diagonal(mass) = &problem.mass else { panic!("barycentric mass is lumped") };
    assert!(mass[64] > 0.0 && mass[64] < 1e-12);
    assert_eq!(problem.area, clean.area);
}

#[test]
fn a_fan_of_many_faces_is_assembled_like_any_other_ring() {
    let k = 300u32;
    let mut mesh = TriangleMesh { positions: vec![[0.0, 0.0, 0.4]], ..Default::default() };
    for i in 0..k {
        let t = std::f64::consts::TAU * f64::from(i) / f64::from(k);
        mesh.positions.push([t.cos(), t.sin(), 0.1 * (5.0 * t).sin()]);
        mesh.faces.push([0, 1 + i, 1 + (i + 1) % k]);
    }
    let s = assemble(&mesh, MassKind::Voronoi).unwrap().stiffness;
    assert_eq!(s.row(0).0.len(), 301);
    for row in 1..=k as usize {
        assert_eq!(entry(&s, 0, row), entry(&s, row, 0));
    }
    assert!(s.row(0).1.iter().sum::<f64>().abs() < 1e-11 * entry(&s, 0, 0));
}

#[test]
fn errors_name_the_offending_element() {
    let assemble = |mesh: &TriangleMesh| assemble(mesh, MassKind::Barycentric).unwrap_err();
    let mut mesh = tetrahedron();
    mesh.faces[2][1] = 99;
    assert_eq!(assemble(&mesh).to_string(), "face 2 refers to vertex 99 of 4");
    mesh = tetrahedron();
    mesh.positions[3][1] = f64::NAN;
    assert_eq!(assemble(&mesh), OperatorError::NotFinite { vertex: 3 });
    assert_eq!(assemble(&TriangleMesh::default()), OperatorError::NoArea);
    mesh = tetrahedron();
    mesh.positions.iter_mut().for_each(|p| *p = [p[0], 2.0 * p[0], 0.0]);
    assert_eq!(assemble(&mesh), OperatorError::NoArea);
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let mesh = sheet(150);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| assemble(&mesh, MassKind::Consistent).unwrap())
    };
    assert_eq!(on(1), on(3));
}
