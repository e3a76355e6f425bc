//! How fast pictures of a stroke follow a hand.

use super::*;

/// The targets: on a million faces, 2,000 dimensions, a dragged stroke answers with the field in f32 within 60 ms at
/// the 95th percentile while a job runs, and with a sample of 3,000 faces within 15 ms in the server.
#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
#[ignore = "measures; run it alone: cargo test --release --test api -- --ignored --nocapture drag"]
async fn the_pace_of_a_dragged_stroke_while_a_job_runs() {
    let Some(folder) = meshes() else { return };
    let mut builder = builder();
    (builder.config.workers, builder.config.threads, builder.config.cache_bytes) = (1, 2, 2 << 30);
    let app = builder.start();
    let (file, dimension) = (std::env::var("CHLADNI_DRAG_MESH"), std::env::var("CHLADNI_DRAG_DIMENSION"));
    let bytes = std::fs::read(folder.join(file.as_deref().unwrap_or("igea.ply"))).unwrap();
    let raw_mesh = read(&bytes, MeshFormat::Ply, &ReadLimits::default()).unwrap();
    let coarse = check(raw_mesh, &CheckOptions::default()).unwrap().mesh;
    let mut fine = Vec::new();
    write_ply(&subdivided(&coarse).unwrap(), None, &mut fine).unwrap();
    let mesh = app.upload("ply", fine).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let dimension: usize = dimension.map_or(2000, |text| text.parse().unwrap());
    let begin = Instant::now();
    let basis = made(&app, &mesh, json!({"dimension": dimension})).await;
    println!(
        "{faces} faces, {dimension} dimensions, {} bytes, job {:.1} s",
        basis["bytes"],
        begin.elapsed().as_secs_f64()
    );
    println!("{}", basis["stage_seconds"]);
    let request = |k: usize| {
        let stroke =
            |i: usize| json!({"face": (i * faces / 10 + 97 * k) % faces, "frame_direction": [1.0, 0.1 * k as f64]});
        json!({"weights": {"harmonic": 1.0, "biharmonic": 0.01}, "strokes": (0..10).map(stroke).collect::<Vec<_>>()})
    };
    let mut job = None;
    for name in ["idle", "a job running"] {
        if name != "idle" {
            job = Some(text(&submitted(&app, &mesh, json!({"dimension": dimension, "seed": 1})).await["id"]));
            tokio::time::sleep(Duration::from_secs(2)).await;
        }
        let url = app.url(&format!("{}/design", text(&basis["links"]["self"])));
        let sample = Some(3000.min(faces));
        for (told, sample, query) in
            [("all", None, ""), ("a sample in f32", sample, ""), ("in f16", sample, "?encoding=f16")]
        {
            let url = format!("{url}{query}");
            let (mut whole, mut inside) = (Vec::new(), Vec::new());
            for k in 0..110 {
                let mut body = request(k);
                if let Some(count) = sample {
                    body["faces"] = json!({"sample": count});
                }
                let begin = Instant::now();
                let sent = app.client.post(&url).header("accept", "application/octet-stream").json(&body).send();
                let response = sent.await.unwrap();
                let timing = response.headers()["server-timing"].to_str().unwrap().to_owned();
                let width = if query.is_empty() { 12 } else { 6 };
                assert_eq!(response.bytes().await.unwrap().len(), width * sample.unwrap_or(faces));
                // The first ones make what later ones find in the cache.
                if k >= 10 {
                    whole.push(begin.elapsed().as_secs_f64() * 1e3);
                    inside.push(timing.rsplit('=').next().unwrap().parse::<f64>().unwrap());
                }
            }
            for times in [&mut whole, &mut inside] {
                times.sort_by(f64::total_cmp);
            }
            println!(
                "{name}, {told}: over HTTP p50 {:.1} ms, p95 {:.1} ms, max {:.1} ms; in the server p50 {:.1} ms, p95 {:.1} ms",
                whole[50], whole[95], whole[99], inside[50], inside[95]
            );
        }
    }
    let job = job.unwrap();
    println!("the job was {} at the end", app.state.store.job(job.parse().unwrap()).await.unwrap().status);
    app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap();
    app.finished(&job).await;
}
