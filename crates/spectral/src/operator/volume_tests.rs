use super::*;
use crate::operator::OperatorParameters;
use crate::operator::elastic::tests::bar;
use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

fn problem(solid: &TetMesh, mass: MassKind, boundary: Boundary) -> EigenProblem {
    assemble(solid, mass, boundary, &Unwatched).unwrap().problem
}

/// A bar whose inner vertices are moved, so that no two tetrahedra are alike.
fn bent() -> TetMesh {
    let mut solid = bar([1.0, 1.5, 2.0], [4, 5, 6]);
    for (k, p) in solid.positions.iter_mut().enumerate() {
        let t = k as f64;
        *p = [p[0] + 0.03 * (1.7 * t).sin(), p[1] + 0.03 * (2.3 * t).cos(), p[2] + 0.03 * (3.1 * t).sin()];
    }
    solid
}

fn volume(solid: &TetMesh) -> f64 {
    let edge = |a: u32, b: u32| Vector3(solid.positions[b as usize]) - Vector3(solid.positions[a as usize]);
    solid.tetrahedra.iter().map(|&[a, b, c, d]| edge(a, b).dot(edge(a, c).cross(edge(a, d))).abs() / 6.0).sum()
}

#[test]
fn linear_functions_have_the_energy_and_the_integrals_of_their_formulas() {
    let solid = bent();
    let size = volume(&solid);
    let gradient = Vector3::new(0.3, -1.1, 0.7);
    let u: Vec<f64> = solid.positions.iter().map(|&p| gradient.dot(p.into()) + 0.25).collect();
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let problem = problem(&solid, mass, Boundary::Neumann);
        assert!((problem.area - size).abs() < 1e-13 * size);
        let su = problem.stiffness.multiply(&u);
        let energy: f64 = u.iter().zip(&su).map(|(u, su)| u * su).sum();
        assert!((energy - gradient.norm_squared() * size).abs() < 1e-12 * energy);
        let mu = problem.mass.multiply(&u);
        // Both masses integrate linear functions exactly, the consistent one their products too.
        let centroid = |corners: &[u32; 4]| corners.iter().map(|&v| u[v as usize]).sum::<f64>() / 4.0;
        let six = |c: &[u32; 4]| shape(c.map(|v| Vector3(solid.positions[v as usize]))).0;
        let exact: f64 = solid.tetrahedra.iter().map(|corners| six(corners) / 6.0 * centroid(corners)).sum();
        assert!((mu.iter().sum::<f64>() * problem.area - exact).abs() < 1e-12 * exact.abs());
        if mass == MassKind::Consistent {
            let product = |c: &[u32; 4]| {
                let squares: f64 = c.iter().map(|&v| u[v as usize].powi(2)).sum();
                six(c) / 6.0 * (squares + 16.0 * centroid(c).powi(2)) / 20.0
            };
            let exact: f64 = solid.tetrahedra.iter().map(product).sum();
            let found: f64 = u.iter().zip(&mu).map(|(u, mu)| u * mu).sum::<f64>() * problem.area;
            assert!((found - exact).abs() < 1e-12 * exact);
        }
    }
}

#[test]
fn the_lumped_mass_exceeds_the_consistent_one_by_no_more_than_bounds_take_it_to() {
    let flat = generate(Shape::Sphere, 200).unwrap();
    let parameters = OperatorParameters { mass: MassKind::Consistent, ..OperatorParameters::default() };
    let surface = crate::operator::assemble(&flat, &parameters, &Unwatched).unwrap().problem.mass;
    // One tetrahedron attains a fifth.
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let single = TetMesh { positions: corners.to_vec(), tetrahedra: vec![[0, 1, 2, 3]] };
    let solid = |solid: &TetMesh| problem(solid, MassKind::Consistent, Boundary::Neumann).mass;
    let least = |mass: &MassMatrix| {
        let (MassMatrix::Sparse(consistent), lumped) = (mass, mass.lumped()) else { panic!("a diagonal mass") };
        let mut diagonal = DenseMatrix::zeros(lumped.len(), lumped.len());
        lumped.iter().enumerate().for_each(|(k, &m)| diagonal.column_mut(k)[k] = m);
        let pairs = CpuSolver.lowest(consistent.to_dense(), diagonal, 1, &Unwatched).unwrap();
        mass.lumped_ratio() * pairs.values[0]
    };
    assert!((least(&solid(&single)) - 1.0).abs() < 1e-12);
    assert!(least(&solid(&bent())) >= 1.0 - 1e-12 && least(&surface) >= 1.0 - 1e-12);
}

#[test]
fn off_the_diagonal_stand_cotangents_of_dihedral_angles() {
    let corners = [[0.1, 0.0, 0.0], [1.2, 0.1, -0.1], [0.3, 0.9, 0.2], [0.2, 0.3, 1.1]];
    let solid = TetMesh { positions: corners.to_vec(), tetrahedra: vec![[0, 1, 2, 3]] };
    let stiffness = problem(&solid, MassKind::Barycentric, Boundary::Neumann).stiffness;
    for i in 0..4 {
        for j in 0..4 {
            if i == j {
                continue;
            }
            let [k, l]: [usize; 2] = (0..4).filter(|v| *v != i && *v != j).collect::<Vec<_>>().try_into().unwrap();
            let p = corners.map(Vector3);
            let axis = p[l] - p[k];
            let (a, b) = (axis.cross(p[i] - p[k]), axis.cross(p[j] - p[k]));
            let angle = (a.dot(b) / (a.norm_squared() * b.norm_squared()).sqrt()).acos();
            let expected = -axis.norm() / angle.tan() / 6.0;
            let (columns, values) = stiffness.row(i);
            let found = values[columns.binary_search(&(j as u32)).unwrap()];
            assert!((found - expected).abs() < 1e-14, "{i} {j}: {found} is not {expected}");
        }
    }
}

#[test]
fn the_matrices_are_symmetric_to_the_last_bit_and_rows_sum_to_zero() {
    let problem = problem(&bent(), MassKind::Consistent, Boundary::Neumann);
    let MassMatrix::Sparse(mass) = &problem.mass else { panic!("a consistent mass is sparse") };
    for matrix in [&problem.stiffness, mass] {
        for row in 0..matrix.rows() {
            let (columns, values) = matrix.row(row);
            for (&column, value) in columns.iter().zip(values) {
                let (others, entries) = matrix.row(column as usize);
                assert_eq!(entries[others.binary_search(&(row as u32)).unwrap()], *value);
            }
        }
    }
    for row in 0..problem.size() {
        let values = problem.stiffness.row(row).1;
        let size: f64 = values.iter().map(|value| value.abs()).sum();
        assert!(values.iter().sum::<f64>().abs() < 1e-15 * size);
    }
}

#[test]
fn orientation_scale_and_flat_tetrahedra_change_nothing() {
    let solid = bent();
    let here = problem(&solid, MassKind::Barycentric, Boundary::Neumann);
    let mut turned = solid.clone();
    turned.tetrahedra.iter_mut().step_by(3).for_each(|corners| corners.swap(1, 2));
    let other = problem(&turned, MassKind::Barycentric, Boundary::Neumann);
    for (a, b) in here.stiffness.values().iter().zip(other.stiffness.values()) {
        assert!((a - b).abs() < 1e-14);
    }
    // By a power of two, to the last bit.
    let mut large = solid.clone();
    large.positions.iter_mut().for_each(|p| *p = p.map(|c| 1024.0 * c));
    let other = problem(&large, MassKind::Barycentric, Boundary::Neumann);
    assert_eq!(other.mass, here.mass);
    assert_eq!(other.area, 1024f64.powi(3) * here.area);
    assert!(here.stiffness.values().iter().zip(other.stiffness.values()).all(|(a, b)| 1024.0 * a == *b));
    // Four corners in a plane, one of them of no other tetrahedron.
    let mut flat = solid.clone();
    let [a, b, c, _] = flat.tetrahedra[0];
    let middle = |k: usize| [a, b, c].iter().map(|&v| flat.positions[v as usize][k]).sum::<f64>() / 3.0;
    let middle = [0, 1, 2].map(middle);
    flat.positions.push(middle);
    flat.tetrahedra.push([a, b, c, flat.positions.len() as u32 - 1]);
    let operator = assemble(&flat, MassKind::Barycentric, Boundary::Neumann, &Unwatched).unwrap();
    assert_eq!((operator.report.flat_tetrahedra, operator.report.massless_vertices), (1, 1));
    assert!(operator.problem.mass.lumped().iter().all(|&m| m > 0.0));
    assert!((operator.problem.area - here.area).abs() < 1e-14);
}

#[test]
fn dirichlet_takes_out_the_vertices_of_the_boundary() {
    let solid = bar([1.0, 1.0, 1.0], [4, 4, 4]);
    let operator = assemble(&solid, MassKind::Barycentric, Boundary::Dirichlet, &Unwatched).unwrap();
    assert_eq!((operator.problem.size(), operator.report.removed_vertices), (27, 125 - 27));
    let inside = |p: &[f64; 3]| p.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9);
    let unknowns = operator.problem.unknowns.as_ref().unwrap();
    assert!(unknowns.iter().all(|&v| inside(&solid.positions[v as usize])));
    assert_eq!(operator.laplacian().size(), 125);
    let single = bar([1.0, 1.0, 1.0], [1, 1, 1]);
    let error = assemble(&single, MassKind::Barycentric, Boundary::Dirichlet, &Unwatched).unwrap_err();
    assert_eq!(error, OperatorError::NoUnknowns { vertices: 8 });
}

#[test]
fn what_is_no_solid_is_refused_by_name() {
    let error = |solid: &TetMesh, mass| assemble(solid, mass, Boundary::Neumann, &Unwatched).unwrap_err();
    let good = bar([1.0, 1.0, 1.0], [2, 2, 2]);
    assert!(matches!(error(&good, MassKind::Voronoi), OperatorError::Parameter { name: "mass", .. }));
    let mut wrong = good.clone();
    wrong.tetrahedra[7][2] = 99;
    assert_eq!(
        error(&wrong, MassKind::Barycentric),
        OperatorError::TetrahedronOutOfRange { tetrahedron: 7, vertex: 99, vertices: 27 }
    );
    let mut wrong = good.clone();
    wrong.positions[5][1] = f64::INFINITY;
    assert_eq!(error(&wrong, MassKind::Barycentric), OperatorError::NotFinite { vertex: 5 });
    for factor in [0.0, 1e-120, 1e120] {
        let mut wrong = good.clone();
        wrong.positions.iter_mut().for_each(|p| *p = p.map(|c| factor * c));
        assert_eq!(error(&wrong, MassKind::Barycentric), OperatorError::NoVolume, "{factor}");
    }
    let none = TetMesh { tetrahedra: Vec::new(), ..good };
    assert_eq!(error(&none, MassKind::Barycentric), OperatorError::NoVolume);
}
