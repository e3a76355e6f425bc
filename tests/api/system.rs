use serde_json::{Value, json};

use crate::common::{TestApp, problem};

#[tokio::test]
async fn health_and_readiness_answer() {
    let app = TestApp::start();
    let health: Value = app.get("/healthz").send().await.unwrap().json().await.unwrap();
    assert_eq!(health["status"], "ok");
    let ready: Value = app.get("/readyz").send().await.unwrap().json().await.unwrap();
    assert_eq!(ready["status"], "ready");
}

#[tokio::test]
async fn a_full_disk_is_told_and_reading_goes_on() {
    let mut builder = TestApp::builder();
    builder.config.least_free_bytes = u64::MAX / 2;
    let app = builder.start();
    let refused = problem(app.get("/readyz").send().await.unwrap(), 503, "not-ready").await;
    assert_eq!(refused["reasons"], json!(["storage-full"]));
    let upload = app.post("/v1/meshes?format=off").body(crate::common::OCTAHEDRON).send().await.unwrap();
    problem(upload, 507, "storage-full").await;
    assert_eq!(app.get("/v1/meshes").send().await.unwrap().status(), 200);
    assert_eq!(app.get("/healthz").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn metrics_count_requests_by_route_template() {
    let app = TestApp::start();
    for _ in 0..3 {
        app.get(&format!("/v1/jobs/{}", uuid::Uuid::now_v7())).send().await.unwrap();
    }
    app.get("/nowhere/1").send().await.unwrap();
    let response = app.get("/metrics").send().await.unwrap();
    assert!(response.headers()["content-type"].to_str().unwrap().starts_with("text/plain; version=0.0.4"));
    let text = response.text().await.unwrap();
    for line in [
        r#"chladni_http_requests_total{method="GET",route="/v1/jobs/{id}",status="404"} 3"#,
        r#"chladni_http_requests_total{method="GET",route="unmatched",status="404"} 1"#,
        r#"chladni_jobs{kind="eigenbasis",status="enqueued"} 0"#,
    ] {
        assert!(text.lines().any(|l| l == line), "{line} is missing from\n{text}");
    }
    assert!(text.contains("process_resident_memory_bytes"));
}

#[tokio::test]
async fn unknown_paths_and_methods_are_problems_with_a_request_id() {
    let app = TestApp::start();
    let response = app.get("/nowhere").header("x-request-id", "my-id-1").send().await.unwrap();
    assert_eq!(response.headers()["x-request-id"], "my-id-1");
    assert_eq!(response.headers()["x-content-type-options"], "nosniff");
    problem(response, 404, "not-found").await;
    let response = app.delete("/v1/jobs").send().await.unwrap();
    assert_eq!(response.headers()["allow"], "POST,GET,HEAD");
    assert_eq!(response.headers()["x-request-id"].len(), 36);
    problem(response, 405, "method-not-allowed").await;
    let head = app.client.head(app.url("/v1/jobs")).send().await.unwrap();
    assert_eq!(head.status(), 200);
    assert_eq!(head.text().await.unwrap(), "");
    let long = format!("/{}", "é".repeat(5000));
    let refused = problem(app.get(&long).send().await.unwrap(), 404, "not-found").await;
    assert!(refused["detail"].as_str().unwrap().chars().count() < 600);
}

#[tokio::test]
async fn dead_workers_are_told_apart() {
    let builder = TestApp::builder();
    let dead = builder.workers_dead.clone();
    let app = builder.start();
    assert_eq!(app.get("/readyz").send().await.unwrap().status(), 200);
    dead.store(true, std::sync::atomic::Ordering::Relaxed);
    let refused = problem(app.get("/readyz").send().await.unwrap(), 503, "not-ready").await;
    assert_eq!(refused["reasons"], json!(["workers-dead"]));
}

#[tokio::test]
async fn a_draining_server_takes_nothing_new_and_still_tells_how_jobs_end() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let job = app.submit(&mesh, json!({"count": 3, "seed": 1500})).await;
    app.state.begin_drain();
    let refused = problem(app.get("/readyz").send().await.unwrap(), 503, "not-ready").await;
    assert_eq!(refused["reasons"], json!(["draining"]));
    let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3}});
    problem(app.post("/v1/jobs").json(&body).send().await.unwrap(), 503, "draining").await;
    let upload = app.post("/v1/meshes?format=off").body(crate::common::OCTAHEDRON).send().await.unwrap();
    problem(upload, 503, "draining").await;
    assert_eq!(app.finished(job["id"].as_str().unwrap()).await["status"], "succeeded");
}

#[tokio::test]
async fn text_is_compressed_where_the_client_takes_it() {
    let app = TestApp::start();
    for (accept, expected) in [("gzip", Some("gzip")), ("zstd", Some("zstd")), ("", None)] {
        let response = app.get("/openapi.json").header("accept-encoding", accept).send().await.unwrap();
        let encoding = response.headers().get("content-encoding").map(|value| value.to_str().unwrap().to_owned());
        assert_eq!(encoding.as_deref(), expected, "{accept}");
    }
    let mesh = app.octahedron().await;
    let exact = app.get(&format!("/v1/meshes/{mesh}/content")).header("accept-encoding", "gzip").send().await.unwrap();
    assert!(!exact.headers().contains_key("content-encoding"));
}

#[tokio::test]
async fn a_server_without_keys_answers_to_its_own_names_only() {
    let app = TestApp::start();
    let call = |host: &'static str| app.get("/v1/meshes").header("host", host).send();
    problem(call("rebound.example:8080").await.unwrap(), 421, "host-not-known").await;
    assert_eq!(call("localhost:8080").await.unwrap().status(), 200);
    let mut builder = TestApp::builder();
    builder.config.hosts = vec!["chladni.example".into()];
    let app = builder.start();
    let answer = app.get("/v1/meshes").header("host", "chladni.example").send().await.unwrap();
    assert_eq!(answer.status(), 200);
}
