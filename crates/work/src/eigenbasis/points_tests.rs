//! Eigenpairs of points without faces, against analytic values and against the mesh that the points came from.

use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::check::CheckOptions;
use chladni_mesh::points::are_points;
use chladni_mesh::read::RawMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::solid::check_body;
use serde_json::json;

use super::*;
use crate::JobParameters;

fn point_mesh(positions: Vec<[f64; 3]>) -> TriangleMesh {
    let raw = RawMesh { positions, ..RawMesh::default() };
    check_body(raw, &CheckOptions::default()).unwrap().surface.mesh
}

fn values(mesh: &TriangleMesh, parameters: &Value) -> Vec<f64> {
    let parameters = EigenbasisParameters::parse(parameters).unwrap();
    parameters.run(mesh, &Unwatched).unwrap().eigenvalues
}

/// Evenly spread, each moved by up to so much of the distance to the next.
fn sphere(n: usize, shake: f64) -> Vec<[f64; 3]> {
    let mut random = SplitMix64::new(n as u64);
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..n)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / n as f64;
            let (r, angle) = ((1.0 - z * z).sqrt(), golden * k as f64);
            let p: [f64; 3] = [r * angle.cos(), r * angle.sin(), z];
            let moved = p.map(|x| x + shake * (random.unit() - 0.5) * (12.6 / n as f64).sqrt());
            let length = moved.iter().map(|x| x * x).sum::<f64>().sqrt();
            moved.map(|x| x / length)
        })
        .collect()
}

#[test]
fn a_sphere_of_points_has_the_eigenvalues_of_the_sphere() {
    for shake in [0.0, 1.0] {
        let mesh = point_mesh(sphere(4000, shake));
        assert!(are_points(&mesh));
        let found = values(&mesh, &json!({"method": "hsim", "count": 36, "tolerance": 1e-8}));
        for (k, value) in found.iter().enumerate() {
            let degree = (k as f64).sqrt().floor();
            let wanted = degree * (degree + 1.0);
            // As on a mesh, the error is of second order: a share of the value that grows with the value times the area
            // of a point.
            let most = 0.2 * wanted * wanted * 4.0 * std::f64::consts::PI / 4000.0 + 1e-9;
            assert!((value - wanted).abs() <= most, "shake {shake}, pair {k}: {value} for {wanted}");
        }
    }
}

#[test]
fn points_of_a_mesh_have_its_eigenvalues_in_any_order_by_both_methods() {
    let mesh = generate(Shape::Torus, 6000).unwrap();
    let exact = json!({"method": "hsim", "count": 60, "tolerance": 1e-8});
    let wanted = values(&mesh, &exact);
    let found = values(&point_mesh(mesh.positions.clone()), &exact);
    for (found, wanted) in found.iter().zip(&wanted).skip(1) {
        assert!((found / wanted - 1.0).abs() < 0.02, "{found} for {wanted}");
    }
    let mut turned = mesh.positions;
    let mut random = SplitMix64::new(1);
    (1..turned.len()).rev().for_each(|k| turned.swap(k, (random.unit() * (k + 1) as f64) as usize));
    let turned = point_mesh(turned);
    for (a, b) in values(&turned, &exact).iter().zip(&found).skip(1) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }
    let fast = values(&turned, &json!({"method": "approximate", "count": 60, "dimension": 400}));
    for (fast, exact) in fast.iter().zip(&found).skip(1) {
        assert!((-1e-9..0.01).contains(&(fast / exact - 1.0)), "{fast} for {exact}");
    }
    let compact = json!({"method": "hsim", "count": 30, "storage": "compact"});
    let published = json!({"method": "hsim", "count": 30, "variant": "published"});
    for parameters in [compact, published] {
        for (other, exact) in values(&turned, &parameters).iter().zip(&found).skip(1) {
            assert!((other / exact - 1.0).abs() < 1e-3, "{parameters}: {other} for {exact}");
        }
    }
}

#[test]
fn jobs_that_need_faces_are_refused_and_memory_is_promised() {
    let mesh = point_mesh(sphere(500, 0.5));
    let size = MeshSize::from(&mesh);
    for (kind, parameters) in
        [("field_basis", json!({})), ("operator_family", json!({})), ("vibration_basis", json!({"thickness": 0.01}))]
    {
        let refused = JobParameters::parse(kind, &parameters).unwrap().check_mesh(size).unwrap_err();
        assert_eq!(refused, ParameterError::NoFaces { kind: JobParameters::parse(kind, &parameters).unwrap().kind() });
    }
    for operator in [json!("graph"), json!("laplace"), json!("hodge"), json!({"extrinsic": {"t": 0.5}})] {
        let parameters = json!({"operator": operator, "method": "hsim", "count": 10});
        let refused = JobParameters::parse("eigenbasis", &parameters).unwrap().check_mesh(size).unwrap_err();
        assert!(refused.to_string().contains("only points"), "{refused}");
    }
    let job = JobParameters::parse("eigenbasis", &json!({"count": 10})).unwrap();
    let closed = MeshSize { faces: 2 * size.vertices, ..size };
    assert!(job.check_mesh(size).is_ok() && job.memory_bytes(size) > job.memory_bytes(closed));
}
