//! Bases judged again by the server, and pairs asked for by an interval.

use std::sync::Arc;

use chladni::queue::Solver;
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

fn app() -> TestApp {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    builder.start()
}

async fn basis(app: &TestApp, mesh: &str, parameters: Value) -> String {
    let job = app.submit(mesh, parameters).await;
    text(&app.finished(&text(&job["id"])).await["basis"])
}

#[tokio::test]
async fn a_basis_is_confirmed_with_a_receipt_of_what_was_judged() {
    let app = app();
    let mesh = app.sphere().await.0;
    for parameters in [
        json!({"method": "hsim", "count": 12, "tolerance": 1e-6}),
        json!({"method": "approximate", "count": 6}),
        json!({"between": [4.0, 20.0], "tolerance": 1e-6}),
    ] {
        let id = basis(&app, &mesh, parameters.clone()).await;
        let shown: Value = app.get(&format!("/v1/bases/{id}")).send().await.unwrap().json().await.unwrap();
        let answer = app.post(&format!("/v1/bases/{id}/verification")).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{parameters}");
        let receipt: Value = answer.json().await.unwrap();
        assert_eq!((&receipt["verdict"], &receipt["findings"]), (&json!("confirmed"), &json!([])), "{receipt}");
        assert_eq!((&receipt["pairs"], &receipt["hashes"]["mesh"]), (&shown["count"], &json!(mesh)));
        let content = app.get(&format!("/v1/bases/{id}/content")).send().await.unwrap();
        let tag = text(&json!(content.headers()["etag"].to_str().unwrap()));
        assert!(tag.contains(receipt["hashes"]["basis"].as_str().unwrap()), "{tag} {receipt}");
        if parameters["between"].is_array() {
            // The kernel and the three of l = 1 lie below 4 on the unit sphere.
            assert_eq!((&receipt["first"], &shown["certificate"]["first"]), (&json!(4), &json!(4)), "{receipt}");
            assert_eq!(receipt["proven_complete"], receipt["pairs"]);
        }
    }
}

#[tokio::test]
async fn what_came_with_the_job_eigenfields_and_modes_are_judged_too() {
    let app = app();
    let (mesh, n) = app.sphere().await;
    let potential: Vec<f64> = (0..n).map(|vertex| (vertex % 5) as f64).collect();
    let operator = json!({"hamiltonian": {"potential": {"values": potential}}});
    let verification = |id: &str| app.post(&format!("/v1/bases/{id}/verification"));
    for (kind, parameters, judged) in [
        ("eigenbasis", json!({"method": "hsim", "count": 4, "tolerance": 1e-6, "operator": operator}), "hamiltonian"),
        ("eigenbasis", json!({"operator": "hodge", "method": "hsim", "count": 16, "tolerance": 1e-6}), "hodge"),
        (
            "vibration_basis",
            json!({"thickness": 0.05, "count": 20, "clamped": [0, 1, 2], "tolerance": 1e-6}),
            "elastic",
        ),
    ] {
        let job = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
        let job: Value = app.post("/v1/jobs").json(&job).send().await.unwrap().json().await.unwrap();
        let id = text(&app.finished(&text(&job["id"])).await["basis"]);
        let receipt: Value = verification(&id).send().await.unwrap().json().await.unwrap();
        assert_eq!((&receipt["verdict"], &receipt["findings"]), (&json!("confirmed"), &json!([])), "{receipt}");
        assert!(receipt["proven_complete"].as_u64().is_some_and(|proven| proven > 2), "{receipt}");
        assert!(receipt["operator"].to_string().contains(judged), "{receipt}");
    }
}

#[tokio::test]
async fn what_cannot_be_judged_is_refused_with_the_reason() {
    let app = app();
    let (mesh, _) = app.sphere().await;
    let job = json!({"kind": "field_basis", "mesh": mesh, "parameters": {"dimension": 40}});
    let job: Value = app.post("/v1/jobs").json(&job).send().await.unwrap().json().await.unwrap();
    let id = text(&app.finished(&text(&job["id"])).await["basis"]);
    let url = |id: &str| format!("/v1/bases/{id}/verification");
    problem(app.post(&url(&id)).send().await.unwrap(), 409, "basis-kind").await;
    problem(app.post(&url(&"0".repeat(32))).send().await.unwrap(), 404, "unknown-basis").await;
}
