//! Maps between the shapes of a collection as a job: made in the queue, kept, found again, and what is deleted and what
//! is not.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use chladni::queue::{JobFailure, Outcome, Runner, Solver, Watch};
use chladni::store::{CollectedShape, JobRecord};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use chladni_spectral::formats::npz;
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

/// Solves, and holds maps of collections until they are cancelled while it is told to.
#[derive(Default)]
struct Holding {
    holds: AtomicBool,
}

impl Runner for Holding {
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        Solver.run(job, mesh, monitor)
    }

    fn run_collection(
        &self,
        job: &JobRecord,
        shapes: Vec<CollectedShape>,
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        monitor.stage("held");
        while self.holds.load(Ordering::Relaxed) {
            monitor.checkpoint()?;
            std::thread::sleep(Duration::from_millis(5));
        }
        Solver.run_collection(job, shapes, monitor)
    }
}

fn holding() -> (TestApp, Arc<Holding>) {
    let runner = Arc::new(Holding::default());
    let mut builder = TestApp::builder();
    builder.runner = runner.clone();
    (builder.start(), runner)
}

/// A shape without symmetries, turned around by `pose`: which vertices correspond is known.
fn pose(pose: usize) -> TriangleMesh {
    let mut mesh = generate(Shape::Sphere, 400).unwrap();
    let (sine, cosine) = (0.7 * pose as f64).sin_cos();
    for at in &mut mesh.positions {
        let [x, y, z] = *at;
        let bump = 1.0 + 0.25 * x + 0.2 * y * z + 0.15 * (x * x - 0.5 * y);
        let [x, y, z] = [1.0 * bump * x, 1.35 * bump * y, 1.8 * bump * z];
        *at = [cosine * x - sine * y, sine * x + cosine * y, z + pose as f64];
    }
    mesh
}

/// Uploads a pose and computes so many pairs of it: its mesh, its basis and the job that made that.
async fn shape(app: &TestApp, number: usize, parameters: Value) -> [String; 3] {
    let mut bytes = Vec::new();
    write_ply(&pose(number), None, &mut bytes).unwrap();
    let mesh = text(&app.upload("ply", bytes).await["id"]);
    let job = app.submit(&mesh, parameters).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    [mesh, text(&job["basis"]), text(&job["id"])]
}

async fn shapes(app: &TestApp, count: usize) -> Vec<[String; 3]> {
    let mut all = Vec::new();
    for number in 0..count {
        all.push(shape(app, number, json!({"method": "hsim", "count": 60, "tolerance": 1e-6})).await);
    }
    all
}

fn request(shapes: &[&[String; 3]], parameters: Value) -> Value {
    let bases: Vec<&String> = shapes.iter().map(|[_, basis, _]| basis).collect();
    json!({"kind": "map_collection", "bases": bases, "parameters": parameters})
}

async fn submit(app: &TestApp, body: &Value) -> Response {
    app.post("/v1/jobs").json(body).send().await.unwrap()
}

async fn accepted(app: &TestApp, body: &Value) -> Value {
    let response = submit(app, body).await;
    let status = response.status();
    let job: Value = response.json().await.unwrap();
    assert_eq!(status, StatusCode::ACCEPTED, "{job}");
    job
}

async fn get(app: &TestApp, path: &str) -> Value {
    let response = app.get(path).send().await.unwrap();
    let status = response.status();
    let value: Value = response.json().await.unwrap();
    assert!(status.is_success(), "{path}: {status}: {value}");
    value
}

/// Parameters by which small shapes are mapped fast.
fn small() -> Value {
    json!({"pairs": 40, "start": 20, "step": 10, "samples": 200})
}

#[tokio::test]
async fn maps_are_made_in_the_queue_kept_and_found_again() {
    let (app, _) = holding();
    let all = shapes(&app, 3).await;
    let body = request(&all.iter().collect::<Vec<_>>(), small());
    let estimate: Value = app.post("/v1/job-estimates").json(&body).send().await.unwrap().json().await.unwrap();
    assert_eq!((&estimate["kind"], &estimate["fits"]), (&json!("map_collection"), &json!(true)), "{estimate}");
    assert!(estimate["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0), "{estimate}");
    let job = accepted(&app, &body).await;
    assert_eq!((&job["bases"], &job["mesh"]), (&body["bases"], &json!(all[0][0])), "{job}");
    assert_eq!(job["memory_bytes"], estimate["memory_bytes"]);
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    let stages: Vec<&str> =
        job["stage_seconds"].as_array().unwrap().iter().map(|own| own["stage"].as_str().unwrap()).collect();
    assert_eq!(stages, ["held", "descriptors", "first_maps", "consistency", "points"], "{job}");
    assert_eq!((&job["parameters"]["pairs"], &job["parameters"]["oriented"]), (&json!(40), &json!(true)));

    let id = text(&job["basis"]);
    let basis = get(&app, &format!("/v1/bases/{id}")).await;
    assert_eq!(
        (&basis["kind"], &basis["dimension"], &basis["count"]),
        (&json!("map_collection"), &json!(40), &json!(0))
    );
    assert_eq!(basis["details"]["bases"], body["bases"], "{basis}");
    assert_eq!(basis["details"]["meshes"], json!(all.iter().map(|[mesh, ..]| mesh).collect::<Vec<_>>()));
    let maps = text(&basis["links"]["maps"]);

    // The request without a job says the same.
    let mut direct = small();
    direct["bases"] = body["bases"].clone();
    let direct: Value = app.post("/v1/map-collections").json(&direct).send().await.unwrap().json().await.unwrap();
    let kept = get(&app, &maps).await;
    assert_eq!(kept, direct);
    assert_eq!(basis["details"]["cycles"], kept["cycles"]);
    // Nearly all vertices are where they belong.
    let right = |map: &Value| {
        let points = map["points"].as_array().unwrap();
        points.iter().enumerate().filter(|(vertex, point)| point.as_u64() == Some(*vertex as u64)).count() as f64
            / points.len() as f64
    };
    assert_eq!(kept["maps"].as_array().unwrap().len(), 6);
    for map in kept["maps"].as_array().unwrap() {
        assert!(right(map) > 0.95, "{} to {}: {}", map["source"], map["target"], right(map));
    }
    let one = get(&app, &format!("{maps}?source=2&target=1&matrices=true")).await;
    let own = kept["maps"].as_array().unwrap().iter().find(|map| map["source"] == 2 && map["target"] == 1).unwrap();
    assert_eq!(one["maps"].as_array().unwrap().len(), 1);
    assert_eq!((&one["maps"][0]["points"], &one["maps"][0]["matrix"]["columns"]), (&own["points"], &json!(40)));
    let refused = problem(app.get(&format!("{maps}?source=3")).send().await.unwrap(), 400, "invalid-query").await;
    assert_eq!(refused["detail"], "source: must be from 0 to 2, not 3.");

    let content = app.get(&format!("/v1/bases/{id}/content")).send().await.unwrap().bytes().await.unwrap();
    let stored = npz::read_maps(&content).unwrap();
    assert_eq!((stored.shapes(), stored.size()), (3, 40));
    assert!(stored.vertex_maps.iter().zip(&stored.vertices).all(|(of_file, &n)| of_file.len() == n));
    assert_eq!(json!(stored.maps[0].points), kept["maps"][0]["points"]);
    assert_eq!(stored.metadata.json()["solver_version"], chladni_work::SOLVER_VERSION);

    // Equal work is found; another order is other work.
    let again = submit(&app, &body).await;
    assert_eq!((again.status(), &again.headers()["chladni-outcome"]), (StatusCode::OK, &"same-work".parse().unwrap()));
    assert_eq!(again.json::<Value>().await.unwrap()["id"], job["id"]);
    let turned = accepted(&app, &request(&[&all[1], &all[0], &all[2]], small())).await;
    assert_ne!(turned["id"], job["id"]);
    assert_eq!(app.finished(&text(&turned["id"])).await["status"], "succeeded");
    let listed = get(&app, "/v1/jobs?kind=map_collection").await;
    assert_eq!(listed["items"].as_array().unwrap().len(), 2);
    assert_eq!(listed["items"][1]["bases"], body["bases"]);

    // It is no basis of functions, and a basis of functions has no maps.
    for path in [format!("/v1/bases/{id}/modes"), format!("/v1/bases/{}/maps", all[0][1])] {
        problem(app.get(&path).send().await.unwrap(), 409, "basis-kind").await;
    }
    problem(app.post(&format!("/v1/bases/{id}/verification")).send().await.unwrap(), 409, "basis-kind").await;
    let other = app.get(&format!("/v1/bases/{id}/content?format=safetensors")).send().await.unwrap();
    problem(other, 406, "not-acceptable").await;
    let onto = request(&[&all[0], &[String::new(), id.clone(), String::new()]], small());
    problem(submit(&app, &onto).await, 409, "basis-kind").await;
}

#[tokio::test]
async fn what_cannot_be_mapped_is_refused_by_name() {
    let (app, _) = holding();
    let all = shapes(&app, 2).await;
    let [one, two] = [&all[0], &all[1]];
    let few = shape(&app, 2, json!({"method": "hsim", "count": 8})).await;
    let graph = shape(&app, 3, json!({"method": "hsim", "count": 30, "operator": "graph"})).await;
    let fields = shape(&app, 3, json!({"method": "hsim", "count": 4, "operator": "hodge"})).await;
    let interval = shape(&app, 3, json!({"method": "hsim", "between": [3.0, 30.0]})).await;
    let other_basis = shape(&app, 0, json!({"method": "hsim", "count": 30})).await;
    let bare = |bases: Value| json!({"kind": "map_collection", "bases": bases});
    let nobody = "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10";
    for (body, status, kind, words) in [
        (bare(json!([one[1]])), 422, "invalid-parameter/bases", "2 to 32"),
        (bare(json!(vec![one[1].clone(); 33])), 422, "invalid-parameter/bases", "not 33"),
        (bare(json!([one[1], nobody])), 404, "unknown-basis", nobody),
        (bare(json!([one[1], "x"])), 404, "unknown-basis", "\"x\""),
        (bare(json!([one[1], two[1], one[1]])), 422, "invalid-parameter/bases", "bases[2] duplicates bases[0]"),
        (request(&[one, two, &other_basis], json!({})), 422, "invalid-parameter/bases", "bases[2]"),
        (request(&[one, &graph], json!({})), 409, "incomparable-bases", graph[1].as_str()),
        (request(&[one, &fields], json!({})), 409, "basis-kind", fields[1].as_str()),
        (request(&[one, &interval], json!({})), 422, "invalid-parameter/bases", interval[1].as_str()),
        (request(&[one, &few], json!({"pairs": 40})), 422, "invalid-parameter/pairs", "bases[1] has"),
        (request(&[one, two], json!({"start": 45, "pairs": 40})), 422, "invalid-parameter/start", "40"),
        (request(&[one, two], json!({"samples": 20})), 422, "invalid-parameter/samples", "120"),
        (request(&[one, two], json!({"step": 0})), 422, "invalid-parameter/step", "step"),
        (request(&[one, two], json!({"magic": 1})), 422, "invalid-parameter/form", "magic"),
        (json!({"kind": "map_collection", "mesh": one[0]}), 422, "invalid-request", "mesh: "),
        (json!({"kind": "map_collection"}), 422, "invalid-request", "bases: "),
        (json!({"kind": "eigenbasis", "mesh": one[0], "bases": [one[1]]}), 422, "invalid-request", "map_collection"),
    ] {
        for route in ["/v1/jobs", "/v1/job-estimates"] {
            let response = app.post(route).json(&body).send().await.unwrap();
            let told = problem(response, status, kind).await;
            assert!(told["detail"].as_str().unwrap().contains(words), "{body}: {told}");
        }
    }
    // A basis of few pairs makes small maps, unless more are asked for.
    let job = accepted(&app, &request(&[one, &few], json!({}))).await;
    assert_eq!((&job["parameters"]["pairs"], &job["parameters"]["start"]), (&json!(8), &json!(8)), "{job}");
    assert_eq!(app.finished(&text(&job["id"])).await["status"], "succeeded");
}

#[tokio::test]
async fn what_a_job_needs_stays_until_it_has_ended() {
    let (app, runner) = holding();
    let all = shapes(&app, 3).await;
    let done = accepted(&app, &request(&all.iter().collect::<Vec<_>>(), small())).await;
    let done = app.finished(&text(&done["id"])).await;
    let kept = format!("/v1/bases/{}", text(&done["basis"]));
    let before = get(&app, &format!("{kept}/maps?numbering=kept")).await;

    runner.holds.store(true, Ordering::Relaxed);
    let job = accepted(&app, &request(&[&all[0], &all[1]], small())).await;
    let id = text(&job["id"]);
    let [mesh, basis, maker] = &all[1];
    for (path, kind) in [
        (format!("/v1/bases/{basis}"), "basis-in-use"),
        (format!("/v1/jobs/{maker}?cascade=true"), "basis-in-use"),
        (format!("/v1/meshes/{mesh}"), "mesh-in-use"),
    ] {
        let told = problem(app.delete(&path).send().await.unwrap(), 409, kind).await;
        assert_eq!(told["job"], json!(id), "{path}: {told}");
        assert!(told["detail"].as_str().unwrap().contains(&id), "{path}: {told}");
    }
    let begun = Instant::now();
    let canceled = app.post(&format!("/v1/jobs/{id}/cancel")).send().await.unwrap();
    assert_eq!(canceled.status(), StatusCode::ACCEPTED);
    assert_eq!(app.finished(&id).await["status"], "canceled");
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());

    // It has ended: the basis goes, and without it the job cannot begin again.
    assert_eq!(app.delete(&format!("/v1/bases/{basis}")).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    let told = problem(app.post(&format!("/v1/jobs/{id}/retry")).send().await.unwrap(), 404, "unknown-basis").await;
    assert!(told["detail"].as_str().unwrap().contains(basis.as_str()), "{told}");
    assert_eq!(get(&app, &format!("/v1/jobs/{id}")).await["bases"], job["bases"]);

    // With a mesh whatever needs it is cancelled.
    let job = accepted(&app, &request(&[&all[0], &all[2]], small())).await;
    let deleted = app.delete(&format!("/v1/meshes/{}?cascade=true", all[2][0])).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    assert_eq!(app.finished(&text(&job["id"])).await["status"], "canceled");

    // Maps outlive the shapes beyond the first, and go with that.
    assert_eq!(get(&app, &format!("{kept}/maps?numbering=kept")).await, before);
    let told = problem(app.get(&format!("{kept}/maps")).send().await.unwrap(), 404, "unknown-mesh").await;
    assert!(told["detail"].as_str().unwrap().contains(&all[2][0]), "{told}");
    let first = format!("/v1/meshes/{}", all[0][0]);
    let told = problem(app.delete(&first).send().await.unwrap(), 409, "mesh-in-use").await;
    assert!(told["detail"].as_str().unwrap().ends_with("is in use by 2 bases."), "{told}");
    let deleted = app.delete(&format!("{first}?cascade=true")).send().await.unwrap();
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    problem(app.get(&kept).send().await.unwrap(), 404, "unknown-basis").await;
}
