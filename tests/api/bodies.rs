//! Bodies that are large, cut, slow or bombs, and clients that misbehave.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common::{TestApp, problem};

fn small() -> TestApp {
    let mut builder = TestApp::builder();
    builder.config.limits.max_body_bytes = 1 << 20;
    builder.config.body_seconds = Duration::from_millis(500);
    builder.config.header_seconds = Duration::from_millis(500);
    builder.start()
}

#[tokio::test]
async fn a_body_beyond_the_limit_is_refused_announced_or_not() {
    let app = small();
    let large = vec![b' '; (1 << 20) + 1];
    let refused = app.post("/v1/meshes?format=obj").body(large.clone()).send().await.unwrap();
    assert_eq!(problem(refused, 413, "body-too-large").await["limit"], 1 << 20);
    let pieces: Vec<Result<Vec<u8>, std::io::Error>> = large.chunks(100_000).map(|c| Ok(c.to_vec())).collect();
    let stream = reqwest::Body::wrap_stream(futures_util::stream::iter(pieces));
    problem(app.post("/v1/meshes?format=obj").body(stream).send().await.unwrap(), 413, "body-too-large").await;
}

#[tokio::test]
async fn a_bomb_stops_at_the_limit() {
    let app = small();
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gzip.write_all(&vec![b' '; 200 << 20]).unwrap();
    let bombs = [("gzip", gzip.finish().unwrap()), ("zstd", zstd::encode_all(&vec![b' '; 200 << 20][..], 3).unwrap())];
    for (encoding, bomb) in bombs {
        assert!(bomb.len() < 1 << 20, "{encoding}: {}", bomb.len());
        let response = app.post("/v1/meshes?format=obj").header("content-encoding", encoding).body(bomb);
        problem(response.send().await.unwrap(), 413, "body-too-large").await;
    }
}

#[tokio::test]
async fn damaged_and_unknown_encodings_are_named() {
    let app = small();
    let send = |encoding: &'static str| {
        app.post("/v1/meshes?format=obj").header("content-encoding", encoding).body("v 0 0 0").send()
    };
    problem(send("gzip").await.unwrap(), 400, "damaged-content-encoding").await;
    problem(send("zstd").await.unwrap(), 400, "damaged-content-encoding").await;
    let refused = send("br").await.unwrap();
    assert_eq!(refused.headers()["accept-encoding"], "gzip, zstd, identity");
    problem(refused, 415, "unsupported-content-encoding").await;
    problem(send("gzip, gzip").await.unwrap(), 415, "unsupported-content-encoding").await;
}

/// Sends bytes as they are and gives the answer's first line and body.
fn raw(app: &TestApp, pieces: &[(&[u8], Duration)], shut: bool) -> String {
    let mut stream = TcpStream::connect(app.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    for (bytes, pause) in pieces {
        if stream.write_all(bytes).is_err() {
            break;
        }
        std::thread::sleep(*pause);
    }
    if shut {
        stream.shutdown(std::net::Shutdown::Write).unwrap();
    }
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

const HEAD: &[u8] = b"POST /v1/meshes?format=obj HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000\r\n\r\n";

#[tokio::test(flavor = "multi_thread")]
async fn a_header_that_never_ends_is_cut_off() {
    let app = small();
    let begin = Instant::now();
    let answer = raw(&app, &[(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n", Duration::ZERO)], false);
    assert!(answer.is_empty() || answer.contains("408"), "{answer}");
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_pauses_is_refused() {
    let app = small();
    let begin = Instant::now();
    let answer = raw(&app, &[(HEAD, Duration::ZERO), (b"v 0 0 0\n", Duration::ZERO)], false);
    assert!(answer.starts_with("HTTP/1.1 408") && answer.contains("/problems/body-too-slow"), "{answer}");
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_trickles_is_refused() {
    let app = small();
    let begin = Instant::now();
    let mut pieces = vec![(HEAD, Duration::ZERO)];
    pieces.extend(std::iter::repeat_n((&b"v"[..], Duration::from_millis(100)), 100));
    let answer = raw(&app, &pieces[..30], false);
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    assert!(begin.elapsed() < Duration::from_secs(8), "{:?}", begin.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cut_upload_leaves_nothing_behind() {
    let app = small();
    drop(raw(&app, &[(HEAD, Duration::ZERO), (b"v 0 0 0\n", Duration::from_millis(50))], true));
    let page: Value = app.get("/v1/meshes").send().await.unwrap().json().await.unwrap();
    assert_eq!(page["items"].as_array().unwrap().len(), 0);
    assert_eq!(app.get("/healthz").send().await.unwrap().status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn nonsense_on_the_wire_does_no_harm() {
    let app = small();
    for bytes in [
        &b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"[..],
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /healthz\r\n\r\n",
        b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-length: -1\r\n\r\n",
        b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ntransfer-encoding: chunked\r\n\r\nzz\r\n",
    ] {
        raw(&app, &[(bytes, Duration::ZERO)], true);
    }
    let mut huge = b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-long: ".to_vec();
    huge.resize(300_000, b'x');
    let answer = raw(&app, &[(&huge, Duration::ZERO)], false);
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{}", &answer[..100.min(answer.len())]);
    assert_eq!(app.get("/healthz").send().await.unwrap().status(), 200);
}

/// Waits until an ordinary place is free: without one there is health alone, and 503 for the rest.
async fn served_again(app: &TestApp) {
    let client = crate::common::cryptography::builder().pool_max_idle_per_host(0).build().unwrap();
    let begin = Instant::now();
    while client.get(app.url("/v1/jobs")).send().await.unwrap().status() != 200 {
        assert!(begin.elapsed() < Duration::from_secs(20), "no place becomes free");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn many_idle_connections_do_not_lock_others_out_for_long() {
    let mut builder = TestApp::builder();
    builder.config.max_connections = 4;
    builder.config.header_seconds = Duration::from_millis(300);
    let app = builder.start();
    let idle: Vec<TcpStream> = (0..8).map(|_| TcpStream::connect(app.address).unwrap()).collect();
    served_again(&app).await;
    drop(idle);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_takes_no_answer_is_let_go() {
    let mut builder = TestApp::builder();
    builder.config.max_connections = 1;
    builder.config.body_seconds = Duration::from_millis(500);
    let app = builder.start();
    let sphere = chladni_mesh::shape::generate(chladni_mesh::shape::Shape::Sphere, 300_000).unwrap();
    let mut ply = Vec::new();
    chladni_mesh::write::write_ply(&sphere, None, &mut ply).unwrap();
    let client = crate::common::cryptography::builder().pool_max_idle_per_host(0).build().unwrap();
    let upload = client.post(app.url("/v1/meshes?format=ply")).body(ply).send().await.unwrap();
    let mesh = crate::common::text(&upload.json::<Value>().await.unwrap()["id"]);
    // The place of the upload may not be free yet.
    let deaf = loop {
        served_again(&app).await;
        let mut deaf = TcpStream::connect(app.address).unwrap();
        write!(deaf, "GET /v1/meshes/{mesh}/content HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
        let mut first = [0; 15];
        deaf.read_exact(&mut first).unwrap();
        if &first == b"HTTP/1.1 200 OK" {
            break deaf;
        }
    };
    served_again(&app).await;
    drop(deaf);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_kept_connection_that_idles_is_let_go() {
    let mut builder = TestApp::builder();
    builder.config.max_connections = 1;
    builder.config.header_seconds = Duration::from_millis(500);
    let app = builder.start();
    let mut kept = TcpStream::connect(app.address).unwrap();
    kept.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
    let mut first = [0; 15];
    kept.read_exact(&mut first).unwrap();
    assert_eq!(&first, b"HTTP/1.1 200 OK");
    served_again(&app).await;
    drop(kept);
}
