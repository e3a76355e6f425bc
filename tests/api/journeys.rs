//! From upload to result with the real solver.

use std::sync::Arc;
use std::time::{Duration, Instant};

use chladni::queue::{JobFailure, Outcome, Runner, Solver};
use chladni::store::JobRecord;
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use serde_json::{Value, json};

use crate::common::{Scripted, TestApp, meshes, text};

const LOW_PASS: &str = r#"{"kind":"low_pass","cutoff":6.9}"#;

fn ply(shape: Shape, vertices: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_ply(&generate(shape, vertices).unwrap(), None, &mut bytes).unwrap();
    bytes
}

async fn solved(app: &TestApp, mesh: &str, parameters: Value) -> Value {
    let job = app.submit(mesh, parameters).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap()
}

#[tokio::test]
async fn a_sphere_sounds_as_it_should() {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    let mesh = app.upload("ply", ply(Shape::Sphere, 2500)).await;
    let basis = solved(&app, &text(&mesh["id"]), json!({"count": 16})).await;
    let values: Vec<f64> = basis["eigenvalues"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    // l (l + 1), 2 l + 1 times.
    let exact = [0.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0, 12.0, 12.0, 12.0, 12.0, 12.0, 12.0, 12.0];
    for (value, exact) in values.iter().zip(exact) {
        assert!((value - exact).abs() <= 0.03 * exact + 1e-9, "{value} {exact}");
    }
    // The coordinates are eigenfunctions of the eigenvalue 2: a low pass keeps them.
    let url = format!("{}/filter", text(&basis["links"]["self"]));
    let request = app
        .post(&url)
        .query(&[("function", "coordinates"), ("transfer", LOW_PASS), ("dtype", "f64")])
        .header("content-type", "application/octet-stream");
    let filtered = request.send().await.unwrap().bytes().await.unwrap();
    let positions = generate(Shape::Sphere, 2500).unwrap().positions;
    let worst = filtered
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
        .zip(positions.iter().flatten())
        .map(|(y, x)| (x - y).abs())
        .fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst}");
    let npz = app.get(&text(&basis["links"]["content"])).send().await.unwrap().bytes().await.unwrap();
    let read = chladni_spectral::formats::npz::read(&npz).unwrap();
    // Reading a number from JSON may miss its last digit.
    let agree = |(one, other): (&f64, &f64)| (one - other).abs() <= 4.0 * f64::EPSILON * one.abs();
    assert!(read.eigenvalues.len() == values.len() && read.eigenvalues.iter().zip(&values).all(agree));
    assert_eq!(read.metadata.json()["mesh"], mesh["id"]);
}

#[tokio::test]
async fn real_meshes_go_through_the_api_to_a_stored_basis() {
    let Some(folder) = meshes() else { return };
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    for (file, encoding, vertices) in [
        ("igea.ply", "identity", 134_345),
        ("dragon.ply.gz", "gzip", 0),
        ("bunny.obj", "identity", 0),
        ("rocker-arm.off", "identity", 0),
        ("spot-uv-seams.obj", "identity", 2930),
    ] {
        let format = file.trim_end_matches(".gz").rsplit('.').next().unwrap();
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let url = format!("/v1/meshes?format={format}&name={file}");
        let response = app.post(&url).header("content-encoding", encoding).body(bytes).send().await.unwrap();
        assert_eq!(response.status(), 201, "{file}");
        let mesh: Value = response.json().await.unwrap();
        assert!(vertices == 0 || mesh["vertices"] == vertices, "{file}: {mesh}");
        let basis = solved(&app, &text(&mesh["id"]), json!({"count": 30})).await;
        assert_eq!((&basis["count"], &basis["vertices"]), (&json!(30), &mesh["vertices"]), "{file}");
        assert!(basis["bytes"].as_u64().unwrap() > 0, "{file}");
    }
}

/// Jobs that keep every thread of the job pool busy for 300 ms.
struct Busy;

impl Runner for Busy {
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        rayon::broadcast(|_| {
            let begin = Instant::now();
            while begin.elapsed() < Duration::from_millis(300) {
                std::hint::spin_loop();
            }
        });
        monitor.checkpoint()?;
        Scripted.run(job, mesh, monitor)
    }
}

#[tokio::test]
async fn a_flooded_queue_leaves_solves_unharmed() {
    let mut builder = TestApp::builder();
    builder.config.workers = 2;
    builder.runner = Arc::new(Busy);
    let app = builder.start();
    let url = format!("/v1/bases/{}/filter", app.basis().await);
    let mesh = app.octahedron().await;
    let mut jobs = Vec::new();
    for seed in 1..40 {
        jobs.push(text(&app.submit(&mesh, json!({"count": 3, "seed": seed})).await["id"]));
    }
    for _ in 0..50 {
        let request = app
            .post(&url)
            .query(&[("function", "coordinates"), ("transfer", LOW_PASS)])
            .header("content-type", "application/octet-stream");
        let begin = Instant::now();
        assert_eq!(request.send().await.unwrap().status(), 200);
        // Far above what it takes, far below what waiting for the queue would.
        assert!(begin.elapsed() < Duration::from_secs(3), "{:?}", begin.elapsed());
    }
    for job in jobs {
        let response = app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
        assert!([202, 409].contains(&response.status().as_u16()));
        app.finished(&job).await;
    }
}

/// The target: with two jobs running, a filter on a basis of igea with 500 pairs answers within 50 ms at the 95th
/// percentile, over HTTP with a binary body.
#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
#[ignore = "measures; run it alone: cargo test --release --test api -- --ignored --nocapture pace"]
async fn the_pace_of_filters_while_two_jobs_run() {
    let Some(folder) = meshes() else { return };
    let mut builder = TestApp::builder();
    builder.config.workers = 2;
    builder.config.threads = 2;
    builder.config.cache_bytes = 1 << 30;
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    let bytes = std::fs::read(folder.join("igea.ply")).unwrap();
    let mesh = text(&app.upload("ply", bytes).await["id"]);
    let basis = solved(&app, &mesh, json!({"count": 500})).await;
    let url = format!("{}/filter", text(&basis["links"]["self"]));
    let content =
        app.get(&format!("/v1/meshes/{mesh}/content?format=buffers")).send().await.unwrap().bytes().await.unwrap();
    let positions = content.slice(8..8 + 12 * 134_345);
    let cutoff = basis["eigenvalues"][250].as_f64().unwrap();
    let transfer = json!({"kind": "low_pass", "cutoff": cutoff}).to_string();
    let mut jobs = Vec::new();
    for (name, wanted) in [("idle", 0), ("two jobs running", 2)] {
        for seed in 1..=wanted {
            jobs.push(text(&app.submit(&mesh, json!({"count": 2000, "seed": seed})).await["id"]));
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
        let (mut whole, mut inside) = (Vec::new(), Vec::new());
        for _ in 0..200 {
            let begin = Instant::now();
            let response = app
                .post(&url)
                .query(&[("transfer", &transfer)])
                .header("content-type", "application/octet-stream")
                .body(positions.clone())
                .send()
                .await
                .unwrap();
            let timing = response.headers()["server-timing"].to_str().unwrap().to_owned();
            assert_eq!(response.bytes().await.unwrap().len(), positions.len());
            whole.push(begin.elapsed().as_secs_f64() * 1e3);
            inside.push(timing.rsplit('=').next().unwrap().parse::<f64>().unwrap());
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        let mut running = 0;
        for job in &jobs {
            let job: Value = app.get(&format!("/v1/jobs/{job}")).send().await.unwrap().json().await.unwrap();
            running += usize::from(job["status"] == "processing");
        }
        for times in [&mut whole, &mut inside] {
            times.sort_by(f64::total_cmp);
        }
        println!(
            "{name} ({running} still running at the end): over HTTP p50 {:.1} ms, p95 {:.1} ms, max {:.1} ms; solve p50 {:.1} ms, p95 {:.1} ms",
            whole[100], whole[190], whole[199], inside[100], inside[190]
        );
    }
    for job in jobs {
        app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
        app.finished(&job).await;
    }
}
