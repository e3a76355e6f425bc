//! How long requests take on a large surface.

use super::*;

/// Milliseconds of processor time that this process, server and client, has used.
fn processor_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |k: usize| fields.get(k).and_then(|field| field.parse::<f64>().ok()).unwrap_or(0.0);
    10.0 * (ticks(11) + ticks(12))
}

/// The target: within 50 ms on igea with 500 pairs, where the size of the result allows it.
#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
#[ignore = "measures; run it alone: cargo test --release --test api -- --ignored --nocapture latencies"]
async fn the_latencies_of_analysis_on_igea() {
    let Some(folder) = crate::common::meshes() else { return };
    let mut builder = TestApp::builder();
    builder.config.cache_bytes = 2 << 30;
    builder.config.threads = 2;
    builder.runner = std::sync::Arc::new(chladni::queue::Solver);
    let app = builder.start();
    let mesh = text(&app.upload("ply", std::fs::read(folder.join("igea.ply")).unwrap()).await["id"]);
    let job = app.submit(&mesh, json!({"count": 500})).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    let basis = text(&job["basis"]);
    let shown: Value = app.get(&format!("/v1/bases/{basis}")).send().await.unwrap().json().await.unwrap();
    let value = |k: usize| shown["eigenvalues"][k].as_f64().unwrap();
    let at = |name: &str| format!("/v1/bases/{basis}/{name}");
    let (distances, signatures, similar) = (at("distances"), at("signatures"), at("similar-points"));
    let times = json!([0.1 / value(1), 1.0 / value(1), 10.0 / value(1)]);
    let landmarks: Vec<[u32; 2]> = (0..10).map(|k| [13_000 * k, 13_000 * k]).collect();
    let cases = [
        ("diffusion, one source", &distances, json!({"distance": {"kind": "diffusion"}, "sources": [1000]})),
        (
            "diffusion, three times",
            &distances,
            json!({"distance": {"kind": "diffusion", "times": times}, "sources": [1000]}),
        ),
        (
            "biharmonic, ten sources",
            &distances,
            json!({"distance": {"kind": "biharmonic"}, "sources": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}),
        ),
        ("commute time, one source", &distances, json!({"distance": {"kind": "commute_time"}, "sources": [1000]})),
        ("geodesic, one source", &distances, json!({"distance": {"kind": "geodesic"}, "sources": [1000]})),
        (
            "geodesic, to the nearest of ten",
            &distances,
            json!({"distance": {"kind": "geodesic"}, "sources": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10], "nearest": true}),
        ),
        (
            "diffusion, a thousand pairs",
            &distances,
            json!({"distance": {"kind": "diffusion"}, "pairs": (0..1000).map(|k| [k, 130_000 - k]).collect::<Vec<_>>()}),
        ),
        (
            "heat kernel, one time, everywhere",
            &signatures,
            json!({"signature": {"kind": "heat_kernel", "times": [0.1 / value(1)]}}),
        ),
        ("heat kernel, 16 times, everywhere", &signatures, json!({"signature": {"kind": "heat_kernel"}})),
        (
            "wave kernel, 100 energies, 1000 vertices",
            &signatures,
            json!({"signature": {"kind": "wave_kernel"}, "vertices": (0..1000).collect::<Vec<_>>()}),
        ),
        ("global point, 20 modes, everywhere", &signatures, json!({"signature": {"kind": "global_point"}})),
        (
            "similar points by heat kernel, 8 times",
            &similar,
            json!({"vertex": 1000, "signature": {"kind": "heat_kernel", "count": 8}}),
        ),
        (
            "low pass of the coordinates",
            &at("filter"),
            json!({"functions": "coordinates", "transfer": {"kind": "low_pass", "cutoff": value(250)}}),
        ),
        (
            "coordinates in 100 modes",
            &at("project"),
            json!({"functions": "coordinates", "pairs": 100, "reconstruct": true}),
        ),
        ("compression of the coordinates", &at("compress"), json!({"bits": 14})),
        ("Shape-DNA of twice the same", &"/v1/shape-comparisons".to_owned(), json!({"bases": [basis, basis]})),
        (
            "map to itself, 100 pairs, 2000 samples",
            &"/v1/functional-maps".to_owned(),
            json!({"source": basis, "target": basis, "landmarks": landmarks}),
        ),
    ];
    println!(
        "| | answer, kB | over HTTP, ms: median, 95th percentile | solve, ms: median | processor, ms |\n|---|---|---|---|---|"
    );
    for (name, url, body) in cases {
        let repeats = if url.contains("functional") { 5 } else { 40 };
        let (mut whole, mut inside, mut bytes, mut used) = (Vec::new(), Vec::new(), 0, 0.0);
        for round in 0..=repeats {
            let before = processor_ms();
            let begin = std::time::Instant::now();
            let response = app.post(url).json(&body).header("accept", OCTETS).send().await.unwrap();
            let timing = response.headers()["server-timing"].to_str().unwrap().to_owned();
            assert_eq!(response.status(), 200, "{name}");
            bytes = response.bytes().await.unwrap().len();
            // The first one fills caches.
            if round > 0 {
                whole.push(begin.elapsed().as_secs_f64() * 1e3);
                inside.push(timing.rsplit('=').next().unwrap().parse::<f64>().unwrap());
                used += processor_ms() - before;
            }
        }
        whole.sort_by(f64::total_cmp);
        inside.sort_by(f64::total_cmp);
        let (middle, late) = (repeats / 2, (repeats * 19 / 20).min(repeats - 1));
        println!(
            "| {name} | {} | {:.1}, {:.1} | {:.1} | {:.1} |",
            bytes / 1000,
            whole[middle],
            whole[late],
            inside[middle],
            used / repeats as f64
        );
    }
}
