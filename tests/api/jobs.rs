use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{FAILS, PANICS, TestApp, problem, text};

#[tokio::test]
async fn a_job_runs_to_its_basis() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3, "method": "approximate"}});
    let response = app.post("/v1/jobs").json(&body).send().await.unwrap();
    assert_eq!(response.status(), 202);
    assert_eq!(response.headers()["chladni-outcome"], "created");
    assert!(response.headers().contains_key("retry-after"));
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let job: Value = response.json().await.unwrap();
    assert_eq!(job["links"]["self"], location);
    // Defaults are filled in.
    assert_eq!(job["parameters"]["dimension"], 153);
    assert_eq!(job["parameters"]["construction"], "heat");
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded");
    assert_eq!(job["attempt"], 1);
    assert!(job["stage_seconds"].as_array().unwrap().iter().any(|s| s["stage"] == "operator"), "{job}");
    assert!(job["finished_ms"].as_i64() >= job["started_ms"].as_i64());
    let basis = app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap();
    assert_eq!(basis.status(), 200);
    // The same again is not done again.
    let again = app.post("/v1/jobs").json(&body).send().await.unwrap();
    assert_eq!(again.status(), 200);
    assert_eq!(again.headers()["chladni-outcome"], "same-work");
    let again: Value = again.json().await.unwrap();
    assert_eq!((&again["id"], &again["basis"]), (&job["id"], &job["basis"]));
}

#[tokio::test]
async fn an_idempotency_key_makes_one_job_and_stands_for_one_request() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let send = |key: &'static str, count: u32| {
        let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": count}});
        app.post("/v1/jobs").header("idempotency-key", key).json(&body).send()
    };
    let first: Value = send("key-1", 3).await.unwrap().json().await.unwrap();
    let second = send("key-1", 3).await.unwrap();
    assert_eq!(second.headers()["chladni-outcome"], "replayed");
    let second: Value = second.json().await.unwrap();
    assert_eq!(first["id"], second["id"]);
    let refused = problem(send("key-1", 4).await.unwrap(), 409, "idempotency-conflict").await;
    assert_eq!(refused["job"], first["id"]);
    problem(send("", 3).await.unwrap(), 400, "invalid-header").await;
    app.finished(&text(&first["id"])).await;
}

#[tokio::test]
async fn what_does_not_fit_is_refused_by_name() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let send = |body: Value| app.post("/v1/jobs").json(&body).send();
    let job = |parameters: Value| json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
    let cases = [
        (json!({"kind": "eigenbasis"}), 422, "invalid-request", "mesh"),
        (json!({"kind": "eigenbasis", "mesh": mesh, "colour": 1}), 422, "invalid-request", "colour"),
        (json!({"kind": "eigenbasis", "mesh": 7}), 422, "invalid-request", "mesh"),
        (json!([]), 422, "invalid-request", "the request must be an object, got a list"),
        (json!({"kind": "eigenbasis", "mesh": mesh, "priority": 1000}), 422, "invalid-request", "priority"),
        (json!({"kind": "eigenbasis", "mesh": "x".repeat(3000)}), 404, "unknown-mesh", "xxx"),
        (json!({"kind": "magic", "mesh": mesh}), 422, "invalid-parameter/kind", "magic"),
        (job(json!({"cuont": 3})), 422, "invalid-parameter/form", "cuont"),
        (job(json!({"count": 0})), 422, "invalid-parameter/count", "count"),
        (job(json!({"count": 7})), 422, "invalid-parameter/count", "6 vertices"),
    ];
    for (body, status, kind, word) in cases {
        let refused = problem(send(body.clone()).await.unwrap(), status, kind).await;
        assert!(refused["detail"].as_str().unwrap().contains(word), "{body}: {refused}");
    }
    let raw = |media_type: &'static str, body: &'static str| {
        app.post("/v1/jobs").header("content-type", media_type).body(body).send()
    };
    problem(raw("application/json", "{\"kind\": ").await.unwrap(), 400, "invalid-json").await;
    problem(raw("text/plain", "{}").await.unwrap(), 415, "unsupported-media-type").await;
    let huge = format!("{{\"kind\": \"{}\"}}", "x".repeat(17 << 20));
    let refused = app.post("/v1/jobs").header("content-type", "application/json").body(huge).send().await.unwrap();
    problem(refused, 413, "body-too-large").await;
    let deep = format!("{{\"kind\": \"eigenbasis\", \"mesh\": \"m\", \"parameters\": {}", "[".repeat(500_000));
    let deep = app.post("/v1/jobs").header("content-type", "application/json").body(deep);
    problem(deep.send().await.unwrap(), 400, "invalid-json").await;
}

#[tokio::test]
async fn a_job_that_needs_too_much_memory_is_not_admitted() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_job_bytes = 1 << 20;
    let app = builder.start();
    let mesh = app.octahedron().await;
    let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3}});
    let refused = problem(app.post("/v1/jobs").json(&body).send().await.unwrap(), 422, "job-too-large").await;
    assert!(refused["estimate"].as_u64() > refused["limit"].as_u64());
}

#[tokio::test]
async fn a_full_queue_refuses_with_a_time_to_come_back() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_queued_jobs = 2;
    let app = builder.start();
    let mesh = app.octahedron().await;
    let mut refused = None;
    let mut ids = Vec::new();
    for seed in 3000..3010u64 {
        let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3, "seed": seed}});
        let response = app.post("/v1/jobs").json(&body).send().await.unwrap();
        if response.status() == 429 {
            assert!(response.headers().contains_key("retry-after"));
            refused = Some(problem(response, 429, "queue-full").await);
            break;
        }
        ids.push(text(&response.json::<Value>().await.unwrap()["id"]));
    }
    assert!(refused.is_some(), "the queue never filled");
    for id in ids {
        app.post(&format!("/v1/jobs/{id}/cancel")).send().await.unwrap();
        app.finished(&id).await;
    }
}

#[tokio::test]
async fn a_running_job_is_cancelled_within_a_second_and_can_be_retried() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let job = text(&app.submit(&mesh, json!({"count": 3, "seed": 60_000})).await["id"]);
    loop {
        let now: Value = app.get(&format!("/v1/jobs/{job}")).send().await.unwrap().json().await.unwrap();
        if now["status"] == "processing" {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let begin = Instant::now();
    for _ in 0..2 {
        let response = app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
        assert_eq!(response.status(), 202);
    }
    let ended = app.finished(&job).await;
    assert_eq!(ended["status"], "canceled");
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    let retried = app.post(&format!("/v1/jobs/{job}/retry")).send().await.unwrap();
    assert_eq!(retried.status(), 202);
    let retried: Value = retried.json().await.unwrap();
    assert!(["enqueued", "processing"].contains(&retried["status"].as_str().unwrap()), "{retried}");
    app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
    app.finished(&job).await;
}

#[tokio::test]
async fn failures_and_panics_are_told_as_problems() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let failed = app.submit(&mesh, json!({"count": 3, "seed": FAILS})).await;
    let failed = app.finished(&text(&failed["id"])).await;
    assert_eq!(failed["status"], "failed");
    assert_eq!(failed["problem"]["type"], "/problems/job/scripted");
    assert_eq!(failed["problem"]["detail"], "This job was told to fail.");
    let page = app.get("/problems/job/scripted").send().await.unwrap();
    assert_eq!(page.status(), 200);
    let done = app.submit(&mesh, json!({"count": 3})).await;
    let done = text(&app.finished(&text(&done["id"])).await["id"]);
    let refused = app.post(&format!("/v1/jobs/{done}/retry")).send().await.unwrap();
    problem(refused, 409, "state-conflict").await;
    let refused = app.post(&format!("/v1/jobs/{done}/cancel")).send().await.unwrap();
    problem(refused, 409, "state-conflict").await;
}

#[tokio::test]
async fn a_panicking_worker_is_retried_boundedly() {
    let mut builder = TestApp::builder();
    builder.config.max_attempts = 2;
    let app = builder.start();
    let mesh = app.octahedron().await;
    let job = app.submit(&mesh, json!({"count": 3, "seed": PANICS})).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!((&job["status"], &job["attempt"]), (&json!("failed"), &json!(2)));
    assert_eq!(job["problem"]["type"], "/problems/job/worker-panicked");
    assert_eq!(app.get("/readyz").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn a_long_poll_wakes_at_the_end_and_on_changes() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let job = text(&app.submit(&mesh, json!({"count": 3, "seed": 1500})).await["id"]);
    // With a tag: the next change.
    let first = app.get(&format!("/v1/jobs/{job}")).send().await.unwrap();
    let tag = first.headers()["etag"].clone();
    let changed = app.get(&format!("/v1/jobs/{job}?wait=20s")).header("if-none-match", &tag).send().await.unwrap();
    assert_eq!(changed.status(), 200);
    assert_ne!(changed.headers()["etag"], tag);
    // Too short a wait: the present state.
    let begin = Instant::now();
    let still: Value = app.get(&format!("/v1/jobs/{job}?wait=50ms")).send().await.unwrap().json().await.unwrap();
    assert!(still["status"] == "processing" && begin.elapsed() < Duration::from_secs(1), "{still}");
    let ended = app.get(&format!("/v1/jobs/{job}?wait=20s")).send().await.unwrap();
    let tag = ended.headers()["etag"].clone();
    assert!(!ended.headers().contains_key("retry-after"));
    assert_eq!(ended.json::<Value>().await.unwrap()["status"], "succeeded");
    let known = app.get(&format!("/v1/jobs/{job}?wait=20s")).header("if-none-match", tag).send().await.unwrap();
    assert_eq!(known.status(), 304);
    problem(app.get(&format!("/v1/jobs/{job}?wait=soon")).send().await.unwrap(), 400, "invalid-query").await;
    problem(app.get(&format!("/v1/jobs/{job}?wiat=1s")).send().await.unwrap(), 400, "invalid-query").await;
    problem(app.get("/v1/jobs/none").send().await.unwrap(), 404, "unknown-job").await;
}

#[tokio::test]
async fn events_tell_every_status_and_end_with_the_job() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let job = text(&app.submit(&mesh, json!({"count": 3, "seed": 1500})).await["id"]);
    let response = app.get(&format!("/v1/jobs/{job}/events")).send().await.unwrap();
    assert_eq!(response.headers()["content-type"], "text/event-stream");
    let stream = response.text().await.unwrap();
    let events: Vec<Value> = stream
        .lines()
        .filter_map(|line| line.strip_prefix("data:"))
        .map(|data| serde_json::from_str(data.trim()).unwrap())
        .collect();
    assert!(events.len() >= 2 && stream.contains("event: job"), "{stream}");
    assert!(events.windows(2).all(|pair| pair[0]["revision"].as_i64() < pair[1]["revision"].as_i64()));
    assert!(events.iter().any(|job| job["progress"].as_f64().is_some_and(|p| p > 0.0)), "no progress in {stream}");
    assert_eq!(events.last().unwrap()["status"], "succeeded");
    let last = events.last().unwrap()["revision"].to_string();
    let again = app.get(&format!("/v1/jobs/{job}/events")).header("last-event-id", last).send().await.unwrap();
    assert_eq!(again.status(), 204);
    let missed = app.get(&format!("/v1/jobs/{job}/events")).header("last-event-id", "1").send().await.unwrap();
    assert!(missed.text().await.unwrap().contains("succeeded"));
}

#[tokio::test]
async fn lists_are_filtered_and_paged() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let mut made = Vec::new();
    for seed in 0..7 {
        made.push(text(&app.submit(&mesh, json!({"count": 3, "seed": seed})).await["id"]));
    }
    for job in &made {
        app.finished(job).await;
    }
    made.reverse();
    let mut seen = Vec::new();
    let mut next = String::new();
    loop {
        let url = format!("/v1/jobs?limit=3&status=succeeded&kind=eigenbasis&mesh={mesh}{next}");
        let page: Value = app.get(&url).send().await.unwrap().json().await.unwrap();
        seen.extend(page["items"].as_array().unwrap().iter().map(|job| text(&job["id"])));
        match page["next"].as_str() {
            Some(cursor) => next = format!("&from={cursor}"),
            None => break,
        }
    }
    assert_eq!(seen, made);
    let none: Value = app.get("/v1/jobs?status=failed").send().await.unwrap().json().await.unwrap();
    assert_eq!(none["items"], json!([]));
    for query in ["limit=0", "limit=201", "limit=x", "status=done", "order=up"] {
        problem(app.get(&format!("/v1/jobs?{query}")).send().await.unwrap(), 400, "invalid-query").await;
    }
    problem(app.get("/v1/jobs?from=nonsense").send().await.unwrap(), 400, "invalid-cursor").await;
}

#[tokio::test]
async fn a_job_that_has_ended_can_be_deleted() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let job = text(&app.submit(&mesh, json!({"count": 3})).await["id"]);
    let basis = text(&app.finished(&job).await["basis"]);
    let path = format!("/v1/jobs/{job}");
    let refused = problem(app.delete(&path).send().await.unwrap(), 409, "state-conflict").await;
    assert!(text(&refused["detail"]).contains(&basis), "{refused}");
    assert_eq!(app.delete(&format!("{path}?cascade=true")).send().await.unwrap().status(), 204);
    problem(app.get(&path).send().await.unwrap(), 404, "unknown-job").await;
    problem(app.get(&format!("/v1/bases/{basis}")).send().await.unwrap(), 404, "unknown-basis").await;
    problem(app.delete(&path).send().await.unwrap(), 404, "unknown-job").await;
    // One that runs is cancelled first.
    let job = text(&app.submit(&mesh, json!({"count": 3, "seed": 60_000})).await["id"]);
    let path = format!("/v1/jobs/{job}");
    problem(app.delete(&path).send().await.unwrap(), 409, "state-conflict").await;
    app.post(&format!("{path}/cancel")).send().await.unwrap();
    app.finished(&job).await;
    assert_eq!(app.delete(&path).send().await.unwrap().status(), 204);
    // With its basis gone, a job goes without a word more.
    let job = text(&app.submit(&mesh, json!({"count": 2})).await["id"]);
    let basis = text(&app.finished(&job).await["basis"]);
    assert_eq!(app.delete(&format!("/v1/bases/{basis}")).send().await.unwrap().status(), 204);
    assert_eq!(app.delete(&format!("/v1/jobs/{job}")).send().await.unwrap().status(), 204);
}
