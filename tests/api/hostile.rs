//! What a hostile client does: pipelines without reading, sends what is no HTTP, hoards connections and streams,
//! inflates.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

/// Sends bytes as they are and gives all that is answered.
fn sent(app: &TestApp, bytes: &[u8]) -> String {
    let mut stream = TcpStream::connect(app.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.write_all(bytes).unwrap();
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

async fn metric(app: &TestApp, name: &str) -> f64 {
    let text = app.get("/metrics").send().await.unwrap().text().await.unwrap();
    let line = text.lines().find(|line| line.strip_prefix(name).is_some_and(|rest| rest.starts_with(' ')));
    line.and_then(|line| line.rsplit(' ').next()?.parse().ok()).unwrap_or(0.0)
}

#[tokio::test(flavor = "multi_thread")]
async fn who_pipelines_and_reads_nothing_is_not_read_either() {
    const MOST: usize = 96 << 20;
    let app = TestApp::start();
    let mut stream = TcpStream::connect(app.address).unwrap();
    // What is not taken within this time is not wanted: the answers lie in the sockets, and the server waits for them
    // to be read.
    stream.set_write_timeout(Some(Duration::from_secs(3))).unwrap();
    let requests = b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(1000);
    let mut written = 0;
    while written < MOST {
        match stream.write(&requests[written % requests.len()..]) {
            Ok(0) | Err(_) => break,
            Ok(more) => written += more,
        }
    }
    assert!(written < MOST, "all {written} bytes of requests were taken, and their answers held");
    assert_eq!(app.get("/healthz").send().await.unwrap().status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn pipelined_answers_come_in_order() {
    let app = TestApp::start();
    let mut requests = b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(50);
    requests.extend_from_slice(b"GET /nowhere HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
    let answers = sent(&app, &requests);
    assert_eq!(answers.matches("HTTP/1.1 200 OK").count(), 50);
    assert!(answers.find("404 Not Found").unwrap() > answers.rfind("200 OK").unwrap(), "{answers}");
}

#[tokio::test(flavor = "multi_thread")]
async fn malformed_requests_are_answered_and_counted() {
    let app = TestApp::start();
    let head = "GET /healthz HTTP/1.1\r\nhost: localhost\r\n";
    let many = format!("{head}{}\r\n", (0..120).map(|i| format!("x-{i}: 1\r\n")).collect::<String>());
    let long = format!("GET /{} HTTP/1.1\r\nhost: localhost\r\n\r\n", "a".repeat(70_000));
    let post = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\n";
    let cases = [
        (many, "431"),
        (long, "414"),
        (format!("{post}content-length: -1\r\n\r\n"), "400"),
        (format!("{post}content-length: 1\r\ncontent-length: 2\r\n\r\n"), "400"),
        (format!("{head}x-nul: a\0b\r\n\r\n"), "400"),
        ("GET /healthz HTTP/9.9\r\n\r\n".to_owned(), "400"),
    ];
    for (request, status) in &cases {
        let answer = sent(&app, request.as_bytes());
        let shown = &request[..80.min(request.len())];
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{shown:?}: {answer:?}");
    }
    let metrics = app.get("/metrics").send().await.unwrap().text().await.unwrap();
    for (status, count) in [("431", 1), ("414", 1), ("400", 4)] {
        let line = format!(
            "chladni_http_requests_total{{method=\"other\",route=\"malformed\",status=\"{status}\"}} {count}\n"
        );
        assert!(metrics.contains(&line), "{line} is missing from {metrics}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_names_one_host() {
    let app = TestApp::start();
    let ask = |head: &str| sent(&app, format!("GET /v1/jobs {head}connection: close\r\n\r\n").as_bytes());
    for head in ["HTTP/1.1\r\n", "HTTP/1.1\r\nhost: localhost\r\nhost: 127.0.0.1\r\n"] {
        let answer = ask(head);
        assert!(
            answer.starts_with("HTTP/1.1 400") && answer.contains("/problems/invalid-header"),
            "{head:?}: {answer}"
        );
    }
    assert!(ask("HTTP/1.1\r\nhost: localhost\r\n").starts_with("HTTP/1.1 200"));
    assert!(ask("HTTP/1.0\r\n").starts_with("HTTP/1.0 200"));
}

#[tokio::test(flavor = "multi_thread")]
async fn hoarded_connections_leave_room_for_a_probe() {
    let mut builder = TestApp::builder();
    builder.config.max_connections = 8;
    // Idle connections stay until the test lets them go.
    builder.config.header_seconds = Duration::from_secs(600);
    let app = builder.start();
    let idle: Vec<TcpStream> = (0..200).map(|_| TcpStream::connect(app.address).unwrap()).collect();
    let fresh = || crate::common::cryptography::builder().pool_max_idle_per_host(0).build().unwrap();
    for path in ["/healthz", "/readyz", "/metrics"] {
        assert_eq!(fresh().get(app.url(path)).send().await.unwrap().status(), 200, "{path}");
    }
    let refused = fresh().get(app.url("/v1/jobs")).send().await.unwrap();
    assert!(refused.headers().contains_key("retry-after"));
    problem(refused, 503, "busy").await;
    drop(idle);
    let begin = Instant::now();
    while fresh().get(app.url("/v1/jobs")).send().await.unwrap().status() != 200 {
        assert!(begin.elapsed() < Duration::from_secs(20), "the places do not come back");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn hoarded_streams_are_bounded_and_their_places_come_back() {
    let mut builder = TestApp::builder();
    builder.config.max_connections = 8;
    let app = builder.start();
    let mesh = app.octahedron().await;
    let job = text(&app.submit(&mesh, json!({"count": 3, "seed": 600_000})).await["id"]);
    let path = format!("/v1/jobs/{job}/events");
    let mut streams = Vec::new();
    for _ in 0..3 {
        let mut stream = app.get(&path).send().await.unwrap();
        assert_eq!(stream.status(), 200);
        assert!(stream.chunk().await.unwrap().is_some());
        streams.push(stream);
    }
    let refused = app.get(&path).send().await.unwrap();
    assert!(refused.headers().contains_key("retry-after"));
    problem(refused, 503, "busy").await;
    problem(app.get(&format!("/v1/jobs/{job}?wait=60s")).send().await.unwrap(), 503, "busy").await;
    assert_eq!(app.get(&format!("/v1/jobs/{job}")).send().await.unwrap().status(), 200, "a look is no stream");
    drop(streams);
    let begin = Instant::now();
    while app.get(&path).send().await.unwrap().status() != 200 {
        assert!(begin.elapsed() < Duration::from_secs(20), "the places do not come back");
    }
    app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
    assert_eq!(app.finished(&job).await["status"], "canceled");
}

/// A table of `numbers` zeros, in two bytes each.
fn zeros(numbers: usize) -> Vec<u8> {
    let mut body = br#"{"functions": {"columns": 1, "values": [0"#.to_vec();
    body.extend(b",0".repeat(numbers - 1));
    body.extend_from_slice(br#"]}, "transfer": {"kind": "heat", "time": 1.0}}"#);
    body
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_are_charged_for_before_they_are_parsed() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_body_bytes = 8 << 20;
    let app = builder.start();
    let basis = app.basis().await;
    let filter = |body: Vec<u8>| {
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        packed.write_all(&body).unwrap();
        app.post(&format!("/v1/bases/{basis}/filter"))
            .header("content-type", "application/json")
            .header("content-encoding", "gzip")
            .body(packed.finish().unwrap())
            .send()
    };
    assert_eq!(filter(zeros(6)).await.unwrap().status(), 200);
    // 7 MB of text in 7 kB, within the limit of a body, but 84 MB as it is parsed.
    let refused = problem(filter(zeros(3_500_000)).await.unwrap(), 413, "body-too-large").await;
    assert!(refused["detail"].as_str().unwrap().contains("memory"), "{refused}");
    problem(filter(zeros(2_000_000)).await.unwrap(), 422, "invalid-function").await;
    assert_eq!(metric(&app, "chladni_request_bytes").await, 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_word_and_no_table_is_told_so() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let ask = |functions: Value| {
        let body = json!({"functions": functions, "transfer": {"kind": "heat", "time": 1.0}});
        app.post(&format!("/v1/bases/{basis}/filter")).json(&body).send()
    };
    let told = json!({"distance": {"kind": "diffusion", "times": "soon"}, "sources": [0]});
    let told = app.post(&format!("/v1/bases/{basis}/distances")).json(&told).send();
    let told = problem(told.await.unwrap(), 422, "invalid-request").await;
    assert_eq!(told["detail"], r#"distance.times must be a list, got the string "soon"."#);
    for (functions, words) in [
        (json!("coordinate"), r#"functions must be "coordinates", got "coordinate""#),
        (json!(7), r#"functions must be the word "coordinates" or a table"#),
        (json!({"columns": 1, "values": [0, "x"]}), "functions.values[1]"),
        (json!({"columns": 1, "value": []}), r#"unknown member functions.value; expected one of "columns", "values""#),
    ] {
        let refused = problem(ask(functions.clone()).await.unwrap(), 422, "invalid-request").await;
        let detail = refused["detail"].as_str().unwrap();
        assert!(detail.contains(words) && !detail.contains("untagged"), "{functions}: {detail}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_subdivision_is_charged_for_before_it_is_made() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_body_bytes = 256 << 10;
    let app = builder.start();
    let upload = |times: u8| {
        app.post(&format!("/v1/meshes?format=off&subdivide={times}")).body(crate::common::OCTAHEDRON).send()
    };
    let refused = problem(upload(6).await.unwrap(), 413, "body-too-large").await;
    assert!(refused["detail"].as_str().unwrap().starts_with("subdivide: "), "{refused}");
    assert_eq!(upload(5).await.unwrap().status(), 201);
    assert_eq!(metric(&app, "chladni_request_bytes").await, 0.0);
}

/// 300 solves that nobody waits for delay an ordinary one by no more than those that had begun.
#[tokio::test(flavor = "multi_thread")]
async fn abandoned_solves_are_skipped() {
    let mut builder = TestApp::builder();
    builder.config.solve_threads = 1;
    let app = builder.start();
    let (basis, n) = app.dense_basis(100, "f32").await;
    let body = vec![0u8; 4 * n * 200];
    let head = format!(
        "POST /v1/bases/{basis}/filter?transfer=%7B%22kind%22%3A%22heat%22%2C%22time%22%3A1.0%7D HTTP/1.1\r\nhost: localhost\r\n\
         content-type: application/octet-stream\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    for _ in 0..60 {
        let mut stream = TcpStream::connect(app.address).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&body).unwrap();
    }
    // The last connections may still be read while those before them are skipped: both have to come to nothing.
    let begin = Instant::now();
    while metric(&app, "chladni_solves").await > 0.0 || metric(&app, "chladni_request_bytes").await > 0.0 {
        assert!(begin.elapsed() < Duration::from_secs(60), "places or bytes are held for nobody");
    }
    let filter =
        app.post(&format!("/v1/bases/{basis}/filter?transfer=%7B%22kind%22%3A%22heat%22%2C%22time%22%3A1.0%7D"));
    let answer = filter.header("content-type", "application/octet-stream").body(vec![0u8; 4 * n]).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(metric(&app, "chladni_request_bytes").await, 0.0);
}
