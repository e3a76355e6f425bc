//! Points without faces: what can be done with them, and what says that it cannot.

use std::sync::Arc;

use chladni::queue::Solver;
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

/// Points of a sphere, evenly spread, as `v` lines alone; point 0 comes a second time at the end.
fn file(n: usize) -> String {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let line = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / n as f64;
        let (r, angle) = ((1.0 - z * z).sqrt(), golden * k as f64);
        format!("v {} {} {z}\n", r * angle.cos(), r * angle.sin())
    };
    (0..n).chain([0]).map(line).collect()
}

#[tokio::test]
async fn points_have_bases_in_the_numbering_of_their_file_and_no_faces() {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    let mesh = app.upload("obj", file(1000)).await;
    let (id, report) = (text(&mesh["id"]), &mesh["report"]);
    assert_eq!((&mesh["vertices"], &mesh["faces"], &report["points"]), (&json!(1000), &json!(0), &json!(true)));
    assert_eq!((&report["file"]["vertices"], &report["file"]["merged"]), (&json!(1001), &json!(1)));
    assert!((report["area"].as_f64().unwrap() / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.02, "{report}");
    for format in ["ply", "obj"] {
        let content = app.get(&format!("/v1/meshes/{id}/content?format={format}")).send().await.unwrap();
        let content = content.bytes().await.unwrap();
        // What follows the header of a PLY are numbers, whose bytes may be anything.
        let head = String::from_utf8_lossy(&content[..200.min(content.len())]).into_owned();
        let faces = if format == "ply" {
            head.contains("face")
        } else {
            String::from_utf8_lossy(&content).lines().any(|line| line.starts_with("f "))
        };
        assert!(!faces && content.len() > 20_000, "{format}: {} bytes, {head}", content.len());
    }

    let job = app.submit(&id, json!({"method": "hsim", "count": 9})).await;
    let job = app.finished(&text(&job["id"])).await;
    let basis = text(&job["basis"]);
    let shown: Value = app.get(&format!("/v1/bases/{basis}")).send().await.unwrap().json().await.unwrap();
    assert_eq!(shown["operator"]["reason"], "points", "{shown}");
    let answer = app.post(&format!("/v1/bases/{basis}/distances"));
    let request = json!({"distance": {"kind": "biharmonic"}, "sources": [0]});
    let table: Value = answer.json(&request).send().await.unwrap().json().await.unwrap();
    let column = table["values"].as_array().unwrap();
    let value = |row: usize| column[row].as_f64().or_else(|| column[row][0].as_f64()).unwrap();
    assert_eq!(column.len(), 1001);
    // Point 0 is the source, and so is the one that became one with it; the last but one is opposite.
    let farthest = (0..1001).map(value).fold(0.0, f64::max);
    assert!(value(0) < 1e-5 && value(1000) == value(0), "{table}");
    assert!(value(999) > 0.95 * farthest && value(20) < 0.5 * farthest, "{table}");
}

#[tokio::test]
async fn what_needs_faces_is_refused_by_name() {
    let app = TestApp::start();
    let id = text(&app.upload("obj", file(300)).await["id"]);
    for (kind, parameters, refused) in [
        ("field_basis", json!({}), "no-faces"),
        ("operator_family", json!({}), "no-faces"),
        ("vibration_basis", json!({"thickness": 0.01}), "no-faces"),
        ("eigenbasis", json!({"operator": "graph", "method": "hsim"}), "operator"),
        ("eigenbasis", json!({"operator": {"extrinsic": {"t": 0.5}}}), "operator"),
        ("eigenbasis", json!({"boundary": "dirichlet"}), "boundary"),
    ] {
        let request = json!({"kind": kind, "mesh": id, "parameters": parameters});
        let response = app.post("/v1/jobs").json(&request).send().await.unwrap();
        problem(response, 422, &format!("invalid-parameter/{refused}")).await;
    }
    for method in ["heat", "exact"] {
        let request = json!({"distance": {"kind": "geodesic", "method": method}, "sources": [0]});
        let response = app.post(&format!("/v1/meshes/{id}/distances")).json(&request).send().await.unwrap();
        let refused = problem(response, 422, "invalid-analysis").await;
        assert!(text(&refused["detail"]).contains("only points"), "{refused}");
    }
    for (body, refused) in [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "too-few-points"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 0 0\n", "no-area"),
        ("v 0 0 0\nv 1 0 0\nv nan 0 0\nv 3 0 1\nv 4 2 0\n", "non-finite-coordinate"),
    ] {
        let response = app.post("/v1/meshes?format=obj").body(body).send().await.unwrap();
        problem(response, 422, &format!("unusable-mesh/{refused}")).await;
    }
}
