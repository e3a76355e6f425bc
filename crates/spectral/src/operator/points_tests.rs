use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

use super::super::weighted::Parts;
use super::super::{Laplacian, MassKind, Reason, assemble, laplace};
use super::*;

fn points(mesh: &TriangleMesh) -> TriangleMesh {
    TriangleMesh { positions: mesh.positions.clone(), faces: Vec::new(), ..Default::default() }
}

#[test]
fn on_acute_triangles_that_the_points_bring_about_it_is_the_laplacian_by_cotangents() {
    let mesh = generate(Shape::Sphere, 2562).unwrap();
    for mass in [MassKind::Barycentric, MassKind::Voronoi, MassKind::Consistent] {
        let wanted = laplace::assemble(&mesh, mass).unwrap();
        let cotangent = (OperatorKind::Auto, Laplacian::Cotangent, Reason::Points);
        for (operator, laplacian, reason) in [cotangent, (OperatorKind::Robust, Laplacian::Robust, Reason::Requested)] {
            let parameters = OperatorParameters { operator, mass, ..OperatorParameters::default() };
            let found = assemble(&points(&mesh), &parameters, &Unwatched).unwrap();
            assert_eq!((found.report.laplacian, found.report.reason), (laplacian, reason));
            assert!((found.problem.area / wanted.area - 1.0).abs() < 1e-12);
            let (a, b) = (found.problem.stiffness.to_dense(), wanted.stiffness.to_dense());
            let largest = b.values().iter().fold(0.0f64, |most, x| most.max(x.abs()));
            let apart = a.values().iter().zip(b.values()).fold(0.0f64, |most, (x, y)| most.max((x - y).abs()));
            assert!(apart < 1e-12 * largest, "{apart}");
            for (x, y) in found.problem.mass.lumped().iter().zip(wanted.mass.lumped()) {
                assert!((x / y - 1.0).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn linear_functions_have_a_small_laplacian_inside_of_a_plane() {
    // Every Delaunay triangulation has linear precision, whatever it is; so have sums of them.
    let mut random = chladni_base::SplitMix64::new(6);
    let positions: Vec<[f64; 3]> = (0..900)
        .map(|k| [f64::from(k % 30) + 0.5 * random.unit(), f64::from(k / 30) + 0.5 * random.unit(), 0.0])
        .collect();
    let cloud = TriangleMesh { positions, faces: Vec::new(), ..Default::default() };
    let problem = assemble(&cloud, &OperatorParameters::default(), &Unwatched).unwrap().problem;
    let (mut inside, mut largest) = (0, 0.0f64);
    for (v, p) in cloud.positions.iter().enumerate() {
        if p[..2].iter().any(|&x| !(4.0..25.0).contains(&x)) {
            continue;
        }
        let (columns, values) = problem.stiffness.row(v);
        let sum: f64 = columns.iter().zip(values).map(|(&c, s)| s * (cloud.positions[c as usize][0] - p[0])).sum();
        largest = largest.max(sum.abs());
        inside += 1;
    }
    assert!(inside > 300 && largest < 0.5, "{inside} {largest}");
}

#[test]
fn what_needs_faces_is_refused_by_name() {
    let cloud = points(&generate(Shape::Sphere, 162).unwrap());
    let potential = |potential| OperatorKind::Hamiltonian { potential };
    for (operator, word) in [
        (OperatorKind::Laplace, "laplace"),
        (OperatorKind::Graph, "graph"),
        (OperatorKind::Volume, "volume"),
        (OperatorKind::Hodge, "hodge"),
        (OperatorKind::Extrinsic { t: 0.5 }, "extrinsic"),
        (potential(Potential::Curvature { t: 0.1 }), "curvatures"),
        (OperatorKind::Weighted(Parts::default()), "weighted"),
    ] {
        let parameters = OperatorParameters { operator, ..OperatorParameters::default() };
        let refused = assemble(&cloud, &parameters, &Unwatched).unwrap_err();
        assert_eq!(refused.kind(), "invalid-parameters");
        assert!(refused.to_string().contains(word), "{refused}");
    }
    let dirichlet = OperatorParameters { boundary: Boundary::Dirichlet, ..OperatorParameters::default() };
    assert!(assemble(&cloud, &dirichlet, &Unwatched).unwrap_err().to_string().contains("boundary"));
    let values = OperatorParameters { operator: potential(Potential::Values(vec![1.0; 162])), ..Default::default() };
    assert!(assemble(&cloud, &values, &Unwatched).is_ok());
    let mut wild = cloud;
    wild.positions[5][0] = f64::NAN;
    let refused = assemble(&wild, &OperatorParameters::default(), &Unwatched).unwrap_err();
    assert_eq!(refused, OperatorError::NotFinite { vertex: 5 });
}
