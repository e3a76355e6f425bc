//! What a job needs is counted where an estimate by size cannot know it, and the job ends there instead of taking what
//! it was not promised.

use chladni_base::{Cancelled, Monitor, SplitMix64};
use chladni_mesh::TriangleMesh;
use chladni_work::{JobError, JobParameters, MeshSize};
use serde_json::{Value, json};

/// A monitor that holds a job to its promise.
struct Promise(u64);

impl Monitor for Promise {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
    fn promised_bytes(&self) -> Option<u64> {
        Some(self.0)
    }
}

/// Runs a job as the queue does: with the memory of its estimate.
fn run(kind: &str, parameters: Value, mesh: &TriangleMesh) -> Result<(), JobError> {
    let parameters = JobParameters::parse(kind, &parameters).unwrap();
    let promise = Promise(parameters.memory_bytes(MeshSize::from(mesh)));
    parameters.run(mesh, &promise).map(drop)
}

/// Triangles between vertices at random: a graph without small separators, as no surface is.
fn soup(vertices: usize, triangles: usize, seed: u64) -> TriangleMesh {
    let mut random = SplitMix64::new(seed);
    let mut faces = Vec::with_capacity(triangles);
    while faces.len() < triangles {
        let face = [0; 3].map(|_| random.below(vertices) as u32);
        if face[0] != face[1] && face[1] != face[2] && face[2] != face[0] {
            faces.push(face);
        }
    }
    // Vertices that no triangle has are left out, as the readers of files do.
    let mut names = vec![u32::MAX; vertices];
    let mut positions = Vec::with_capacity(vertices);
    for corner in faces.as_flattened_mut() {
        let name = &mut names[*corner as usize];
        if *name == u32::MAX {
            *name = positions.len() as u32;
            positions.push([0; 3].map(|_| random.signed_unit()));
        }
        *corner = *name;
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

/// A vertex with so many triangles around it, closed to a cone.
fn fan(valence: u32) -> TriangleMesh {
    let angle = |k: u32| f64::from(k) * std::f64::consts::TAU / f64::from(valence);
    let rim = (0..valence).map(|k| [angle(k).cos(), angle(k).sin(), 0.0]);
    TriangleMesh {
        positions: std::iter::once([0.0, 0.0, 0.1]).chain(rim).collect(),
        faces: (0..valence).map(|k| [0, 1 + k, 1 + (k + 1) % valence]).collect(),
        ..Default::default()
    }
}

#[test]
fn triangles_at_random_end_where_their_factors_are_counted() {
    for seed in 0..2 {
        // Of fewer vertices the factors fit into what is promised for functions that reach far.
        let mesh = soup(20_000, 40_000, seed);
        let error = run("eigenbasis", json!({"method": "hsim", "count": 10}), &mesh).unwrap_err();
        assert_eq!(error.kind(), "memory-exceeded", "{error}");
        assert!(error.to_string().contains("promised"), "{error}");
    }
}

#[test]
fn surfaces_stay_within_their_promises() {
    use chladni_mesh::shape::{Shape, generate};
    let torus = generate(Shape::Torus, 3000).unwrap();
    for parameters in [json!({"method": "hsim", "count": 20}), json!({"count": 100, "method": "approximate"})] {
        run("eigenbasis", parameters.clone(), &torus).unwrap_or_else(|error| panic!("{parameters}: {error}"));
    }
    run("vibration_basis", json!({"thickness": 0.01, "count": 10}), &torus).unwrap();
    run("field_basis", json!({}), &torus).unwrap();
}

#[test]
fn a_fan_of_very_many_triangles_is_told_that_its_fields_do_not_fit() {
    let error = run("field_basis", json!({}), &fan(100_000)).unwrap_err();
    assert_eq!(error.kind(), "memory-exceeded", "{error}");
    // One of a few hundred is small enough.
    run("field_basis", json!({"dimension": 20}), &fan(300)).unwrap();
}
