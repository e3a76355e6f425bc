use std::io::Read;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|&number| f32::from_le_bytes(number)).collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|&number| f64::from_le_bytes(number)).collect()
}

/// Functions `range` of the scripted basis: units.
fn units(range: std::ops::Range<usize>, n: usize) -> Vec<f32> {
    range.flat_map(|k| (0..n).map(move |row| if row == k { 1.0 } else { 0.0 })).collect()
}

#[tokio::test]
async fn a_dense_basis_tells_its_storage_and_its_certificate() {
    let app = TestApp::start();
    let (basis, n) = app.dense_basis(100, "f32").await;
    let shown: Value = app.get(&format!("/v1/bases/{basis}")).send().await.unwrap().json().await.unwrap();
    assert_eq!((&shown["storage"], &shown["precision"]), (&json!("dense"), &json!("f32")));
    assert_eq!((&shown["dimension"], &shown["nonzeros"], &shown["count"]), (&Value::Null, &Value::Null, &json!(100)));
    assert!(shown["bytes"].as_u64().unwrap() > 4 * 100 * n as u64);
    let certificate = &shown["certificate"];
    assert_eq!((&certificate["complete"], &certificate["tolerance"]), (&json!(true), &json!(0.01)));
    assert_eq!(certificate["inertia"], json!([{"shift": 99.5, "below": 100}]));
    assert_eq!(certificate["levels"][1], json!({"dimension": n, "iterations": 2, "shifts": 3}));
    let parameters = &shown["parameters"];
    for (name, value) in [("method", "hsim"), ("variant", "sliced"), ("operator", "auto"), ("boundary", "neumann")] {
        assert_eq!(parameters[name], value);
    }
    assert_eq!(shown["operator"], json!({"laplacian": "robust", "reason": "non_manifold"}));
    // A compact one has not been counted.
    let compact = app.basis().await;
    let shown: Value = app.get(&format!("/v1/bases/{compact}")).send().await.unwrap().json().await.unwrap();
    assert_eq!((&shown["storage"], &shown["precision"]), (&json!("compact"), &Value::Null));
    assert_eq!((&shown["certificate"]["complete"], &shown["certificate"]["inertia"]), (&Value::Null, &json!([])));
}

#[tokio::test]
async fn modes_of_a_dense_basis_come_in_any_range_and_type() {
    let app = TestApp::start();
    for precision in ["f32", "f64"] {
        let (basis, n) = app.dense_basis(100, precision).await;
        let url = format!("/v1/bases/{basis}/modes?format=f32");
        for (from, to) in [(0, 100), (31, 33), (64, 65), (99, 100)] {
            let answer = app.get(&format!("{url}&from={from}&to={to}")).send().await.unwrap();
            assert_eq!(answer.headers()["chladni-columns"], (to - from).to_string());
            assert_eq!(floats(&answer.bytes().await.unwrap()), units(from..to, n));
        }
        let wide = app.get(&format!("{url}&from=40&to=42&dtype=f64")).send().await.unwrap();
        assert_eq!(wide.headers()["chladni-dtype"], "f64");
        let expected: Vec<f64> = units(40..42, n).into_iter().map(f64::from).collect();
        assert_eq!(doubles(&wide.bytes().await.unwrap()), expected);
        let npy = app.get(&format!("/v1/bases/{basis}/modes?from=40&to=42&dtype=f64")).send().await.unwrap();
        assert!(String::from_utf8_lossy(&npy.bytes().await.unwrap()).contains("'<f8'"));
        let ply = app.get(&format!("/v1/bases/{basis}/modes?from=50&format=ply")).send().await.unwrap();
        assert_eq!(ply.status(), 200);
        problem(app.get(&format!("{url}&from=100")).send().await.unwrap(), 422, "invalid-mode-range").await;
        problem(app.get(&format!("{url}&dtype=f16")).send().await.unwrap(), 400, "invalid-query").await;
    }
}

#[tokio::test]
async fn functions_are_filtered_and_projected_in_a_dense_basis() {
    let app = TestApp::start();
    let (basis, n) = app.dense_basis(100, "f64").await;
    let x: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let close = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    let body = json!({"functions": {"values": x}, "reconstruct": true});
    let answer = app.post(&format!("/v1/bases/{basis}/project")).json(&body).send().await.unwrap();
    let answer: Value = answer.json().await.unwrap();
    assert!(close(&numbers(&answer["coefficients"]["values"]), &x[..100]));
    let mut kept = x.clone();
    kept[100..].fill(0.0);
    assert!(close(&numbers(&answer["reconstruction"]["values"]), &kept));
    let body = json!({"functions": {"values": x}, "transfer": {"kind": "low_pass", "cutoff": 39.5}});
    let answer = app.post(&format!("/v1/bases/{basis}/filter")).json(&body).send().await.unwrap();
    let answer: Value = answer.json().await.unwrap();
    kept[40..].fill(0.0);
    assert!(close(&numbers(&answer["values"]), &kept), "{answer}");
    let body = json!({"values": vec![1.0; 100]});
    let answer = app.post(&format!("/v1/bases/{basis}/reconstruct")).json(&body).send().await.unwrap();
    let answer: Value = answer.json().await.unwrap();
    let ones: Vec<f64> = (0..n).map(|row| if row < 100 { 1.0 } else { 0.0 }).collect();
    assert!(close(&numbers(&answer["values"]), &ones));
}

#[tokio::test]
async fn a_dense_basis_is_downloaded_in_three_formats() {
    let app = TestApp::start();
    let (basis, n) = app.dense_basis(100, "f64").await;
    let url = format!("/v1/bases/{basis}/content");
    for format in ["npz", "safetensors"] {
        let get = || app.get(&format!("{url}?format={format}"));
        let answer = get().send().await.unwrap();
        let head = answer.headers().clone();
        let whole = answer.bytes().await.unwrap();
        assert_eq!(head["content-length"].to_str().unwrap(), whole.len().to_string());
        let length = whole.len();
        let middle = length - 8 * 100 * n - 100;
        for (from, to) in [(0, 10), (middle, middle + 5000), (length - 3, length), (0, length)] {
            let part = get().header("range", format!("bytes={from}-{}", to - 1)).send().await.unwrap();
            assert_eq!(part.status(), 206, "{format}");
            assert_eq!(part.bytes().await.unwrap(), whole.slice(from..to), "{format} {from}..{to}");
        }
        if format == "npz" {
            let read = chladni_spectral::formats::npz::read(&whole).unwrap();
            assert_eq!(read.lift::<f32>(0..100).unwrap(), units(0..100, n));
        } else {
            let tensors = safetensors::SafeTensors::deserialize(&whole).unwrap();
            let functions = tensors.tensor("functions").unwrap();
            assert_eq!(functions.shape(), [100, n]);
            assert_eq!(doubles(functions.data())[3], 0.0);
        }
    }
    let market = app.get(&format!("{url}?format=matrix_market")).send().await.unwrap();
    assert_eq!((market.status().as_u16(), &market.headers()["accept-ranges"]), (200, &"none".parse().unwrap()));
    let tag = market.headers()["etag"].clone();
    let bytes = market.bytes().await.unwrap();
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(&bytes[..])).unwrap();
    let mut lines = String::new();
    archive.by_name("functions.mtx").unwrap().read_to_string(&mut lines).unwrap();
    assert_eq!(lines.lines().nth(1).unwrap(), format!("{n} 100"));
    let known = app.get(&format!("{url}?format=matrix_market")).header("if-none-match", tag).send().await.unwrap();
    assert_eq!(known.status(), 304);
}

#[tokio::test]
async fn a_deleted_dense_basis_is_gone_with_its_columns() {
    let app = TestApp::start();
    let (basis, _) = app.dense_basis(100, "f32").await;
    let stored = async || -> f64 {
        let text = app.get("/metrics").send().await.unwrap().text().await.unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("chladni_blob_bytes ")).unwrap();
        line.parse().unwrap()
    };
    let held = stored().await;
    assert_eq!(app.get(&format!("/v1/bases/{basis}/modes?from=1&to=2")).send().await.unwrap().status(), 200);
    assert_eq!(app.delete(&format!("/v1/bases/{basis}")).send().await.unwrap().status(), 204);
    for path in ["", "/content", "/content?format=safetensors", "/modes?from=1&to=2"] {
        problem(app.get(&format!("/v1/bases/{basis}{path}")).send().await.unwrap(), 404, "unknown-basis").await;
    }
    // What the metrics know of the store may be half a second old.
    tokio::time::sleep(Duration::from_millis(600)).await;
    assert!(stored().await + 4.0 * 100.0 * 100.0 < held);
}

#[tokio::test]
async fn parameters_of_another_method_are_refused_by_name() {
    let app = TestApp::start();
    let (mesh, n) = app.sphere().await;
    for (parameters, name) in [
        (json!({"method": "approximate", "levels": 3}), "levels"),
        (json!({"dimension": 30, "levels": 3}), "levels"),
        (json!({"method": "hsim", "dimension": 30}), "dimension"),
        (json!({"method": "hsim", "tolerance": 0.9}), "tolerance"),
        (json!({"method": "sim", "variant": "sliced"}), "variant"),
        (json!({"method": "hsim", "count": 3, "below": 1.0}), "below"),
        (json!({"method": "hsim", "below": 1e308}), "below"),
        (json!({"operator": {"extrinsic": {"t": -1.0}}}), "operator.extrinsic.t"),
        (
            json!({"operator": {"hamiltonian": {"potential": {"values": [1.0, 2.0]}}}}),
            "operator.hamiltonian.potential.values",
        ),
    ] {
        let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
        let refused = app.post("/v1/jobs").json(&body).send().await.unwrap();
        let refused = problem(refused, 422, &format!("invalid-parameter/{name}")).await;
        assert_eq!(refused["parameter"], name);
    }
    // A potential is taken by value and told by its hash.
    let values: Vec<f64> = (0..n).map(|i| i as f64).collect();
    let operator = json!({"hamiltonian": {"potential": {"values": values}}});
    let job = app.submit(&mesh, json!({"count": 3, "operator": operator})).await;
    let told = &job["parameters"]["operator"]["hamiltonian"]["potential"]["values"];
    assert_eq!((told["numbers"].as_u64(), told["blake3"].as_str().map(str::len)), (Some(n as u64), Some(64)));
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
}

#[tokio::test]
async fn a_running_job_tells_where_it_stands() {
    let app = TestApp::start();
    let (mesh, _) = app.sphere().await;
    let job = app.submit(&mesh, json!({"method": "hsim", "count": 3, "seed": 60_000})).await;
    let job = text(&job["id"]);
    let begin = Instant::now();
    loop {
        let now: Value = app.get(&format!("/v1/jobs/{job}")).send().await.unwrap().json().await.unwrap();
        if now["detail"] == "level 2 of 3, slice 1 of 4" {
            assert_eq!(now["stage"], "basis");
            break;
        }
        assert!(begin.elapsed() < Duration::from_secs(30), "{now}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
    let ended = app.finished(&job).await;
    assert_eq!(ended["status"], "canceled");
}

#[tokio::test]
async fn what_cannot_fit_is_refused_with_figures() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_job_bytes = 64 << 20;
    let app = builder.start();
    let (mesh, _) = app.sphere().await;
    let body =
        json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"method": "hsim", "below": 1.0, "at_most": 20_000}});
    let refused = problem(app.post("/v1/jobs").json(&body).send().await.unwrap(), 422, "job-too-large").await;
    assert!(refused["estimate"].as_u64().unwrap() > 64 << 20 && refused["limit"] == 64 << 20, "{refused}");
    assert!(refused["detail"].as_str().unwrap().contains(&refused["estimate"].to_string()));
}

#[tokio::test]
async fn jobs_that_do_not_fit_together_run_one_after_the_other() {
    let mut builder = TestApp::builder();
    builder.config.workers = 3;
    builder.config.memory_bytes = 100 << 20;
    let app = builder.start();
    let (mesh, _) = app.sphere().await;
    let mut jobs = Vec::new();
    for seed in 1300..1303u64 {
        jobs.push(text(&app.submit(&mesh, json!({"method": "hsim", "count": 3, "seed": seed})).await["id"]));
    }
    let begin = Instant::now();
    let mut most = 0;
    while begin.elapsed() < Duration::from_millis(2500) {
        let page = app.get("/v1/jobs?status=processing").send().await.unwrap();
        most = most.max(page.json::<Value>().await.unwrap()["items"].as_array().unwrap().len());
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(most, 1, "each needs more than half of the memory");
    for job in jobs {
        let job = app.finished(&job).await;
        assert_eq!(job["status"], "succeeded");
        assert!(job["memory_bytes"].as_u64().unwrap() > 50 << 20);
    }
}
