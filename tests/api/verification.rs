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
async fn what_cannot_be_judged_is_refused_with_the_reason() {
    let app = app();
    let (mesh, n) = app.sphere().await;
    let operator = json!({"hamiltonian": {"potential": {"values": vec![1.0; n]}}});
    let id = basis(&app, &mesh, json!({"method": "hsim", "count": 4, "operator": operator})).await;
    let url = |id: &str| format!("/v1/bases/{id}/verification");
    let refused = problem(app.post(&url(&id)).send().await.unwrap(), 422, "invalid-analysis").await;
    assert!(text(&refused["detail"]).contains("operator"), "{refused}");
    let fields = basis(&app, &mesh, json!({"operator": "hodge", "method": "hsim", "count": 4})).await;
    problem(app.post(&url(&fields)).send().await.unwrap(), 409, "basis-kind").await;
    problem(app.post(&url(&"0".repeat(32))).send().await.unwrap(), 404, "unknown-basis").await;
}
