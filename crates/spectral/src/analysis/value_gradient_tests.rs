use super::*;
use crate::analysis::fixtures::solved;
use crate::operator::elastic::tests::bar;
use crate::operator::{Boundary, MeshOperator, OperatorKind, OperatorParameters, assemble, volume};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_mesh::{TetMesh, TriangleMesh};

const MASSES: [MassKind; 2] = [MassKind::Barycentric, MassKind::Consistent];

fn basis(operator: &MeshOperator, vertices: usize, count: usize) -> Basis {
    solved(operator, vertices, count, 1e-9)
}

fn on_surface(mesh: &TriangleMesh, mass: MassKind, boundary: Boundary, count: usize) -> Basis {
    let parameters = OperatorParameters { operator: OperatorKind::Laplace, mass, boundary };
    basis(&assemble(mesh, &parameters, &Unwatched).unwrap(), mesh.positions.len(), count)
}

fn in_solid(solid: &TetMesh, mass: MassKind, count: usize) -> Basis {
    basis(&volume::assemble(solid, mass, Boundary::Neumann, &Unwatched).unwrap(), solid.positions.len(), count)
}

/// Compares the gradient with differences along random motions.
fn agrees(positions: &[[f64; 3]], weights: &[f64], gradient: &[[f64; 3]], values: impl Fn(Vec<[f64; 3]>) -> Vec<f64>) {
    let mut random = SplitMix64::new(7);
    for _ in 0..3 {
        let motion: Vec<[f64; 3]> = positions.iter().map(|_| [0; 3].map(|_| random.signed_unit())).collect();
        let at = |step: f64| -> f64 {
            let moved = positions.iter().zip(&motion).map(|(p, v)| [0, 1, 2].map(|k| p[k] + step * v[k])).collect();
            values(moved).iter().zip(weights).map(|(value, weight)| value * weight).sum()
        };
        // Two central differences, whose errors of second order cancel.
        let central = |step: f64| (at(step) - at(-step)) / (2.0 * step);
        let step = 2e-4;
        let measured = (4.0 * central(step) - central(2.0 * step)) / 3.0;
        let found: f64 = gradient.as_flattened().iter().zip(motion.as_flattened()).map(|(g, v)| g * v).sum();
        let size: f64 = gradient.as_flattened().iter().zip(motion.as_flattened()).map(|(g, v)| (g * v).abs()).sum();
        assert!((found - measured).abs() < 1e-6 * size, "{found} by the gradient, {measured} by differences");
    }
}

fn weights(count: usize) -> Vec<f64> {
    (0..count).map(|k| 1.0 / (1.0 + k as f64) - 0.1).collect()
}

#[test]
fn gradients_are_what_differences_say_on_surfaces_with_and_without_boundary() {
    let closed = noisy(&generate(Shape::Torus, 150).unwrap(), 0.2, 3).unwrap();
    let open = noisy(&generate(Shape::Disk, 150).unwrap(), 0.2, 3).unwrap();
    for (mesh, boundary) in [(&closed, Boundary::Neumann), (&open, Boundary::Neumann), (&open, Boundary::Dirichlet)] {
        for mass in MASSES {
            let found = on_surface(mesh, mass, boundary, 8);
            let weights = weights(8);
            let gradient = value_gradient(&found, Elements::Triangles(mesh), mass, &weights, &Unwatched).unwrap();
            agrees(&mesh.positions, &weights, &gradient, |positions| {
                on_surface(
                    &TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() },
                    mass,
                    boundary,
                    8,
                )
                .eigenvalues
            });
        }
    }
}

#[test]
fn gradients_are_what_differences_say_in_solids() {
    let mut solid = bar([1.0, 1.3, 1.7], [3, 3, 4]);
    let mut random = SplitMix64::new(5);
    solid.positions.as_flattened_mut().iter_mut().for_each(|x| *x += 0.05 * random.signed_unit());
    for mass in MASSES {
        let found = in_solid(&solid, mass, 6);
        let weights = weights(6);
        let gradient = value_gradient(&found, Elements::Tetrahedra(&solid), mass, &weights, &Unwatched).unwrap();
        agrees(&solid.positions, &weights, &gradient, |positions| {
            in_solid(&TetMesh { positions, tetrahedra: solid.tetrahedra.clone() }, mass, 6).eigenvalues
        });
    }
}

#[test]
fn moving_and_turning_change_no_value_and_scaling_changes_it_by_its_degree() {
    let mesh = noisy(&generate(Shape::Sphere, 700).unwrap(), 0.1, 1).unwrap();
    let found = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann, 140);
    // More functions than are held at once.
    let weights = weights(140);
    let gradient =
        value_gradient(&found, Elements::Triangles(&mesh), MassKind::Barycentric, &weights, &Unwatched).unwrap();
    let size: f64 = gradient.as_flattened().iter().map(|x| x.abs()).sum();
    for axis in 0..3 {
        let moved: f64 = gradient.iter().map(|g| g[axis]).sum();
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let turned: f64 = gradient.iter().zip(&mesh.positions).map(|(g, p)| p[a] * g[b] - p[b] * g[a]).sum();
        assert!(moved.abs() < 1e-12 * size && turned.abs() < 1e-12 * size, "{moved} {turned}");
    }
    let grown: f64 = gradient.as_flattened().iter().zip(mesh.positions.as_flattened()).map(|(g, p)| g * p).sum();
    let expected: f64 = found.eigenvalues.iter().zip(&weights).map(|(value, weight)| -2.0 * value * weight).sum();
    assert!((grown - expected).abs() < 1e-8 * expected.abs(), "{grown} instead of {expected}");
}

#[test]
fn the_sum_of_a_multiplet_has_a_gradient() {
    let mesh = generate(Shape::Sphere, 160).unwrap();
    let found = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann, 6);
    let weights = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0];
    let gradient =
        value_gradient(&found, Elements::Triangles(&mesh), MassKind::Barycentric, &weights, &Unwatched).unwrap();
    agrees(&mesh.positions, &weights, &gradient, |positions| {
        let mesh = TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() };
        on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann, 6).eigenvalues
    });
}

#[test]
fn what_the_operator_takes_for_flat_has_no_part() {
    let mesh = noisy(&generate(Shape::Torus, 150).unwrap(), 0.2, 3).unwrap();
    let found = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann, 6);
    let weights = weights(6);
    let of = |mesh: &TriangleMesh| {
        value_gradient(&found, Elements::Triangles(mesh), MassKind::Barycentric, &weights, &Unwatched).unwrap()
    };
    let mut flat = mesh.clone();
    // Three vertices, the last one all but in the middle of the others.
    let [p, q] = [0, 40].map(|v: usize| flat.positions[v]);
    flat.positions[80] = [0, 1, 2].map(|k| 0.5 * (p[k] + q[k]) + 1e-17);
    let without = of(&flat);
    flat.faces.push([0, 40, 80]);
    assert_eq!(of(&flat), without);
    let mut solid = bar([1.0, 1.0, 1.0], [2, 2, 2]);
    let found = in_solid(&solid, MassKind::Consistent, 4);
    let of = |solid: &TetMesh| {
        value_gradient(&found, Elements::Tetrahedra(solid), MassKind::Consistent, &[1.0; 4], &Unwatched).unwrap()
    };
    let without = of(&solid);
    let [a, b, c, _] = solid.tetrahedra[0];
    solid.tetrahedra.push([a, b, c, a]);
    assert_eq!(of(&solid), without);
}

#[test]
fn what_has_no_gradient_is_refused_by_name() {
    let mesh = generate(Shape::Sphere, 60).unwrap();
    let mut found = on_surface(&mesh, MassKind::Barycentric, Boundary::Neumann, 4);
    let surface = Elements::Triangles(&mesh);
    let of = |basis: &Basis, mass, weights: &[f64]| {
        value_gradient(basis, surface, mass, weights, &Unwatched).unwrap_err().to_string()
    };
    assert_eq!(of(&found, MassKind::Barycentric, &[1.0]), "the number of weights must be 4, got 1");
    let refused = of(&found, MassKind::Barycentric, &[1.0, f64::NAN, 0.0, 0.0]);
    assert_eq!(refused, "a weight must be a finite number, got NaN");
    assert!(of(&found, MassKind::Voronoi, &[1.0; 4]).starts_with("gradients are not available for Voronoi areas"));
    for (laplacian, name) in
        [("robust", "the robust Laplacian"), ("graph", "the Laplacian of a graph"), ("volume", "this operator")]
    {
        found.metadata = serde_json::json!({"operator": {"laplacian": laplacian}}).into();
        assert!(of(&found, MassKind::Barycentric, &[1.0; 4]).contains(name));
    }
    found.metadata = serde_json::json!({"operator": {"laplacian": "cotangent"}, "parameters": {"operator": {"extrinsic": {"t": 0.5}}}}).into();
    assert!(of(&found, MassKind::Barycentric, &[1.0; 4]).contains("the operator \"extrinsic\""));
    found.metadata = serde_json::json!({"operator": {"laplacian": "cotangent", "reason": "points"}}).into();
    let points = TriangleMesh { positions: mesh.positions.clone(), faces: Vec::new(), ..Default::default() };
    let refused = value_gradient(&found, Elements::Triangles(&points), MassKind::Barycentric, &[1.0; 4], &Unwatched);
    assert!(refused.unwrap_err().to_string().contains("the Laplacian of points"));
    found.metadata = serde_json::json!({}).into();
    assert!(of(&found, MassKind::Barycentric, &[1.0; 4]).contains("does not say with which Laplacian"));
    found.metadata = serde_json::json!({"operator": {"laplacian": "cotangent"}}).into();
    assert!(of(&found, MassKind::Barycentric, &[1.0; 4]).contains("does not say with which operator"));
    let other = generate(Shape::Sphere, 200).unwrap();
    let refused = value_gradient(&found, Elements::Triangles(&other), MassKind::Barycentric, &[1.0; 4], &Unwatched);
    assert!(matches!(refused, Err(AnalysisError::Mesh { .. })));
}
