//! Compression in a basis of the combinatorial Laplacian: the receiver computes it from the faces, without a position.

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::algebra::DenseMatrix;
use chladni_spectral::analysis::compression::{compress, decompress};
use chladni_work::EigenbasisParameters;
use serde_json::json;

#[test]
fn who_has_the_faces_puts_the_positions_together_again() {
    let mesh = generate(Shape::Torus, 3000).unwrap();
    let parameters =
        EigenbasisParameters::parse(&json!({"operator": "graph", "count": 120, "tolerance": 1e-6})).unwrap();
    let sender = parameters.run(&mesh, &Unwatched).unwrap();
    let faces_alone = TriangleMesh {
        positions: vec![[0.0; 3]; mesh.positions.len()],
        faces: mesh.faces.clone(),
        ..Default::default()
    };
    let receiver = parameters.run(&faces_alone, &Unwatched).unwrap();
    let mut positions = DenseMatrix::zeros(mesh.positions.len(), 3);
    for axis in 0..3 {
        positions.column_mut(axis).iter_mut().zip(&mesh.positions).for_each(|(x, p)| *x = p[axis]);
    }
    let packed = compress(&sender, &positions, 120, 16).unwrap();
    assert!(packed.relative_errors.iter().all(|error| *error < 0.05), "{:?}", packed.relative_errors);
    let found = decompress(&receiver, &packed.bytes).unwrap();
    for (found, sent) in found.values().iter().zip(packed.reconstruction.values()) {
        assert!((found - sent).abs() < 1e-9, "{found} is not {sent}");
    }
}
