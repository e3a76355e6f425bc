//! What a job would take, before it is sent.

use serde_json::{Value, json};

use crate::common::{OCTAHEDRON, TestApp, problem, text};

#[tokio::test]
async fn an_estimate_tells_time_and_memory_and_begins_nothing() {
    let app = TestApp::start();
    let sample = app.get("/v1/samples/sphere?vertices=5000").send().await.unwrap().bytes().await.unwrap();
    let mesh: Value = app.post("/v1/meshes").body(sample).send().await.unwrap().json().await.unwrap();
    let estimate = async |parameters: Value| {
        let body = json!({"kind": "eigenbasis", "mesh": text(&mesh["id"]), "parameters": parameters});
        let response = app.post("/v1/job-estimates").json(&body).send().await.unwrap();
        assert_eq!(response.status(), 200);
        response.json::<Value>().await.unwrap()
    };
    let small = estimate(json!({"count": 50})).await;
    let large = estimate(json!({"count": 2000, "method": "hsim", "tolerance": 1e-8})).await;
    let seconds = |estimate: &Value| estimate["seconds"].as_f64().unwrap();
    let memory = |estimate: &Value| estimate["memory_bytes"].as_u64().unwrap();
    assert!((0.01..1.0).contains(&seconds(&small)), "{small}");
    assert!(seconds(&large) > 10.0 * seconds(&small) && memory(&large) > memory(&small), "{large}");
    assert_eq!((&small["fits"], &small["kind"]), (&json!(true), &json!("eigenbasis")));
    let fields = json!({"kind": "field_basis", "mesh": text(&mesh["id"]), "parameters": {"dimension": 200}});
    let fields = app.post("/v1/job-estimates").json(&fields).send().await.unwrap().json::<Value>().await.unwrap();
    assert!(fields["seconds"].is_null() && memory(&fields) > 0, "{fields}");
    let jobs: Value = app.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    assert_eq!(jobs["items"], json!([]));
}

#[tokio::test]
async fn an_estimate_refuses_what_the_job_would_be_refused_for_but_its_size() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_job_bytes = 1 << 20;
    let app = builder.start();
    let mesh: Value = app.post("/v1/meshes?format=off").body(OCTAHEDRON).send().await.unwrap().json().await.unwrap();
    let ask = |body: Value| app.post("/v1/job-estimates").json(&body).send();
    let id = text(&mesh["id"]);
    let body = ask(json!({"kind": "eigenbasis", "mesh": id, "parameters": {"count": 3}})).await.unwrap();
    assert_eq!(body.json::<Value>().await.unwrap()["fits"], false);
    let wrong = json!({"kind": "eigenbasis", "mesh": id, "parameters": {"count": 7}});
    problem(ask(wrong.clone()).await.unwrap(), 422, "invalid-parameter/count").await;
    problem(app.post("/v1/jobs").json(&wrong).send().await.unwrap(), 422, "invalid-parameter/count").await;
    let unknown = json!({"kind": "eigenbasis", "mesh": "00000000000000000000000000000000"});
    problem(ask(unknown).await.unwrap(), 404, "unknown-mesh").await;
}
