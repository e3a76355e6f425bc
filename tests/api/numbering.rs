//! The user's vertices are the user's: every route answers about a file with unreferenced, duplicate and permuted
//! vertices as it does about the mesh that is left of it, up to the map between the two. That map is found here by
//! positions, not asked for.

mod covered;
mod faces;
mod files;
mod singular;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::Arc;

use chladni::queue::Solver;
use chladni_base::SplitMix64;
use chladni_mesh::TriangleMesh;
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_mesh::shape::{Shape, generate, noisy};
use serde_json::{Value, json};

use crate::common::{TestApp, meshes, problem, text};

const OCTETS: &str = "application/octet-stream";

fn app() -> TestApp {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    builder.start()
}

/// A file that is a surface with accidents, and what became of its vertices and faces.
struct Case {
    dirty: String,
    clean: String,
    /// For each vertex of the file that of the mesh.
    vertices: Vec<Option<usize>>,
    /// For each face of the file that of the mesh.
    faces: Vec<Option<usize>>,
    mesh: TriangleMesh,
}

/// An OBJ of a surface: its vertices in random order, a third of them twice, as many that no face uses, every tenth
/// face twice and a face that repeats a vertex after every twentieth.
fn disturbed(surface: &TriangleMesh, random: &mut SplitMix64) -> String {
    let n = surface.positions.len();
    let mut order: Vec<Option<usize>> = (0..n).map(Some).collect();
    for _ in 0..n / 3 {
        order.extend([Some(random.below(n)), None]);
    }
    for at in (1..order.len()).rev() {
        order.swap(at, random.below(at + 1));
    }
    let mut places = vec![Vec::new(); n];
    let mut out = String::new();
    for (file, own) in order.iter().enumerate() {
        own.iter().for_each(|&own| places[own].push(file + 1));
        let [x, y, z] = own.map_or_else(|| [0; 3].map(|_| 3.0 + random.unit()), |own| surface.positions[own]);
        writeln!(out, "v {x:?} {y:?} {z:?}").unwrap();
    }
    let mut corners = |face: [u32; 3]| face.map(|v| places[v as usize][random.below(places[v as usize].len())]);
    for (f, &face) in surface.faces.iter().enumerate() {
        for _ in 0..1 + usize::from(f % 10 == 0) {
            let [a, b, c] = corners(face);
            writeln!(out, "f {a} {b} {c}").unwrap();
        }
        if f % 20 == 0 {
            writeln!(out, "f 1 1 2").unwrap();
        }
    }
    out
}

impl Case {
    async fn new(app: &TestApp, seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let shape = [Shape::Sphere, Shape::Torus][random.below(2)];
        let surface = noisy(&generate(shape, 150).unwrap(), 0.3, seed).unwrap();
        let file = disturbed(&surface, &mut random);
        let answer: Value = app
            .post("/v1/meshes?format=obj&merge=always")
            .body(file.clone())
            .send()
            .await
            .unwrap()
            .json()
            .await
            .unwrap();
        assert_eq!(answer["report"]["file"]["dropped"], surface.positions.len() / 3, "{answer}");
        let dirty = text(&answer["id"]);
        let content =
            app.get(&format!("/v1/meshes/{dirty}/content?format=ply")).send().await.unwrap().bytes().await.unwrap();
        let clean = text(&app.upload("ply", content.clone()).await["id"]);
        assert_ne!(clean, dirty, "files of other numbering are other meshes");

        let raw = read(file.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
        let kept = read(&content, MeshFormat::Ply, &ReadLimits::default()).unwrap();
        let bits = |p: &[f64; 3]| p.map(|x| (x + 0.0).to_bits());
        let find = |p: &[f64; 3]| kept.positions.iter().position(|q| bits(p) == bits(q));
        let vertices: Vec<Option<usize>> = raw.positions.iter().map(find).collect();
        let sorted = |mut corners: [Option<usize>; 3]| {
            corners.sort_unstable();
            corners
        };
        let own: Vec<_> = kept.faces.iter().map(|face| sorted(face.map(|v| Some(v as usize)))).collect();
        let mut taken = BTreeSet::new();
        let mut faces = Vec::new();
        for face in &raw.faces {
            let corners = sorted(face.map(|v| vertices[v as usize]));
            // Of equal faces the first is kept.
            faces.push(own.iter().position(|own| *own == corners).filter(|&found| taken.insert(found)));
        }
        assert_eq!(taken.len(), kept.faces.len());
        Self {
            dirty,
            clean,
            vertices,
            faces,
            mesh: TriangleMesh { positions: kept.positions, faces: kept.faces, ..Default::default() },
        }
    }

    /// A vertex of the file and the one of the mesh that it is.
    fn vertex(&self, random: &mut SplitMix64) -> (usize, usize) {
        let at = random.below(self.vertices.len());
        self.vertices[at].map_or_else(|| self.vertex(random), |kept| (at, kept))
    }

    fn face(&self, random: &mut SplitMix64) -> (usize, usize) {
        let at = random.below(self.faces.len());
        self.faces[at].map_or_else(|| self.face(random), |kept| (at, kept))
    }

    fn dropped(&self) -> usize {
        self.vertices.iter().position(Option::is_none).unwrap()
    }
}

/// Values of a file, from those of the mesh, `width` each; none where there is none.
fn told(values: &[f64], width: usize, map: &[Option<usize>]) -> Vec<f64> {
    map.iter()
        .flat_map(|kept| (0..width).map(move |k| kept.map_or(f64::NAN, |kept| values[width * kept + k])))
        .collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("{value}"));
    list.iter().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect()
}

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().filter(|x| x.is_finite()).fold(1e-300f64, |most, x| most.max(x.abs()));
    for (at, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-6 * largest, "{what}: {a} is not {b} at {at}");
    }
}

/// A job that has succeeded.
async fn ask_for(app: &TestApp, body: &Value) -> Value {
    let job: Value = app.post("/v1/jobs").json(body).send().await.unwrap().json().await.unwrap();
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    job
}

async fn job(app: &TestApp, kind: &str, mesh: &str, parameters: &Value, query: &str) -> Value {
    let body = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
    // What would be refused for its numbers is refused here as well.
    let estimate = app.post(&format!("/v1/job-estimates{query}")).json(&body).send().await.unwrap();
    assert_eq!(estimate.status(), 200, "{:?}", estimate.text().await);
    let job: Value = app.post(&format!("/v1/jobs{query}")).json(&body).send().await.unwrap().json().await.unwrap();
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap()
}

/// The same job on both meshes: the paths of both bases.
async fn bases(app: &TestApp, case: &Case, kind: &str, parameters: [&Value; 2]) -> [String; 2] {
    let [own, other] =
        [job(app, kind, &case.dirty, parameters[0], "").await, job(app, kind, &case.clean, parameters[1], "").await];
    assert_close(&numbers(&own["eigenvalues"]), &numbers(&other["eigenvalues"]), kind);
    [own, other].map(|basis| text(&basis["links"]["self"]))
}

async fn ask(app: &TestApp, url: &str, body: &Value) -> Value {
    let response = app.post(url).json(body).send().await.unwrap();
    let status = response.status();
    let value: Value = response.json().await.unwrap();
    assert_eq!(status, 200, "{url} {body}: {value}");
    value
}

/// A raw answer as numbers.
async fn raw(request: reqwest::RequestBuilder) -> Vec<f64> {
    let response = request.header("accept", OCTETS).send().await.unwrap();
    assert_eq!(response.status(), 200, "{:?}", response.text().await);
    let rows: usize = response.headers()["chladni-rows"].to_str().unwrap().parse().unwrap();
    let bytes = response.bytes().await.unwrap();
    let numbers: Vec<f64> = bytes.as_chunks::<4>().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect();
    assert_eq!(numbers.len() % rows, 0);
    numbers
}

const EXACT: &str = "hsim";

#[tokio::test]
async fn functions_on_vertices_are_those_of_the_file() {
    let app = app();
    for seed in 0..3 {
        let case = Case::new(&app, seed).await;
        let random = &mut SplitMix64::new(seed);
        let parameters = json!({"method": EXACT, "count": 20, "tolerance": 1e-8});
        let [dirty, clean] = bases(&app, &case, "eigenbasis", [&parameters, &parameters]).await;
        let own: Vec<f64> = (0..case.mesh.positions.len()).map(|_| random.unit()).collect();
        let file = told(&own, 1, &case.vertices);
        let table = |values: &[f64]| json!({"columns": 1, "values": values});

        let transfer = json!({"kind": "heat", "time": 0.01});
        let filtered = |values: &[f64]| json!({"functions": table(values), "transfer": transfer});
        let a = ask(&app, &format!("{dirty}/filter"), &filtered(&file)).await;
        let b = ask(&app, &format!("{clean}/filter"), &filtered(&own)).await;
        assert_close(&numbers(&a["values"]), &told(&numbers(&b["values"]), 1, &case.vertices), "filter");
        let bytes: Vec<u8> = file.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
        let request = app.post(&format!("{dirty}/filter")).query(&[("transfer", transfer.to_string())]);
        let c = raw(request.header("content-type", OCTETS).body(bytes)).await;
        assert_close(&c, &numbers(&a["values"]), "raw filter");

        let a = ask(&app, &format!("{dirty}/project"), &json!({"functions": table(&file), "reconstruct": true})).await;
        let b = ask(&app, &format!("{clean}/project"), &json!({"functions": table(&own), "reconstruct": true})).await;
        let expected = told(&numbers(&b["reconstruction"]["values"]), 1, &case.vertices);
        assert_close(&numbers(&a["reconstruction"]["values"]), &expected, "project");
        let again = ask(&app, &format!("{dirty}/reconstruct"), &a["coefficients"]).await;
        assert_close(&numbers(&again["values"]), &expected, "reconstruct");
        // What came out goes in again, nulls and all.
        let round = ask(&app, &format!("{dirty}/project"), &json!({"functions": a["reconstruction"]})).await;
        assert_close(&numbers(&round["coefficients"]["values"]), &numbers(&a["coefficients"]["values"]), "round");
        let near = ask(&app, &format!("{dirty}/reconstruct?extend=nearest"), &a["coefficients"]).await;
        assert!(near["values"].as_array().unwrap().iter().all(Value::is_number));

        let packed =
            app.post(&format!("{dirty}/compress")).header("accept", OCTETS).json(&json!({"functions": table(&file)}));
        let packed = packed.send().await.unwrap().bytes().await.unwrap();
        let request = app.post(&format!("{dirty}/decompress")).header("content-type", OCTETS).body(packed);
        let unpacked = raw(request).await;
        for (found, expected) in unpacked.iter().zip(&expected) {
            assert!((found.is_nan() && expected.is_nan()) || (found - expected).abs() < 0.01, "decompress");
        }

        let a = raw(app.get(&format!("{dirty}/modes?from=3&to=6"))).await;
        let b = raw(app.get(&format!("{clean}/modes?from=3&to=6"))).await;
        let expected: Vec<f64> =
            b.chunks_exact(case.mesh.positions.len()).flat_map(|mode| told(mode, 1, &case.vertices)).collect();
        assert_close(&a, &expected, "modes");
        assert_close(&raw(app.get(&format!("{dirty}/modes?from=3&to=6&numbering=kept"))).await, &b, "kept modes");
    }
}

#[tokio::test]
async fn gradients_say_what_moving_the_vertices_of_the_file_does() {
    let app = app();
    let weights = [0.0, 1.0, -0.5, 0.25];
    let request = json!({"weights": weights});
    for seed in 6..8 {
        let case = Case::new(&app, seed).await;
        let parameters =
            json!({"method": EXACT, "operator": "laplace", "count": 6, "tolerance": 1e-8, "precision": "f64"});
        let [dirty, clean] = bases(&app, &case, "eigenbasis", [&parameters, &parameters]).await;
        let own = numbers(&ask(&app, &format!("{clean}/value-gradient"), &request).await["values"]);
        let found = ask(&app, &format!("{dirty}/value-gradient"), &request).await;
        assert_eq!((&found["columns"], own.len()), (&json!(3), 3 * case.mesh.positions.len()));
        let mut copies = vec![0.0; case.mesh.positions.len()];
        case.vertices.iter().flatten().for_each(|&kept| copies[kept] += 1.0);
        let shares: Vec<f64> = own.iter().enumerate().map(|(at, g)| g / copies[at / 3]).collect();
        let expected = told(&shares, 3, &case.vertices).into_iter().map(|x| if x.is_nan() { 0.0 } else { x });
        assert_close(&numbers(&found["values"]), &expected.collect::<Vec<_>>(), "gradient");
        let kept = ask(&app, &format!("{dirty}/value-gradient?numbering=kept"), &request).await;
        assert_close(&numbers(&kept["values"]), &own, "kept gradient");

        // Eigenvalues fall with the square of the size.
        let basis: Value = app.get(&clean).send().await.unwrap().json().await.unwrap();
        let grown: f64 = case.mesh.positions.as_flattened().iter().zip(&own).map(|(p, g)| p * g).sum();
        let values = numbers(&basis["eigenvalues"]);
        let expected: f64 = values.iter().zip(weights).map(|(value, weight)| -2.0 * value * weight).sum();
        assert!((grown - expected).abs() < 1e-6 * expected.abs(), "{grown} instead of {expected}");

        let bytes: Vec<u8> = weights.iter().flat_map(|weight: &f64| weight.to_le_bytes()).collect();
        let request = app.post(&format!("{clean}/value-gradient")).header("content-type", OCTETS).body(bytes);
        assert_close(&raw(request).await, &own, "raw gradient");
        for (body, word) in
            [(json!({}), "weights: must be between 1 and 6, not 0"), (json!({"weights": vec![1.0; 7]}), "not 7")]
        {
            let refused = app.post(&format!("{dirty}/value-gradient")).json(&body).send().await.unwrap();
            let refused = problem(refused, 422, "invalid-analysis").await;
            assert!(refused["detail"].as_str().unwrap().to_lowercase().contains(word), "{refused}");
        }
        let odd = app.post(&format!("{clean}/value-gradient")).header("content-type", OCTETS).body(vec![0u8; 7]);
        problem(odd.send().await.unwrap(), 422, "invalid-function").await;
    }
    let case = Case::new(&app, 8).await;
    let parameters = json!({"method": EXACT, "mass": "voronoi", "count": 6});
    let [dirty, _] = bases(&app, &case, "eigenbasis", [&parameters, &parameters]).await;
    let refused = app.post(&format!("{dirty}/value-gradient")).json(&request).send().await.unwrap();
    let refused = problem(refused, 422, "invalid-analysis").await;
    assert!(refused["detail"].as_str().unwrap().contains("Voronoi"), "{refused}");
}

#[tokio::test]
async fn vertices_are_those_of_the_file() {
    let app = app();
    for seed in 3..6 {
        let case = Case::new(&app, seed).await;
        let random = &mut SplitMix64::new(seed);
        let parameters = json!({"method": EXACT, "count": 30, "tolerance": 1e-8});
        let [dirty, clean] = bases(&app, &case, "eigenbasis", [&parameters, &parameters]).await;
        let (p, q) = (case.vertex(random), case.vertex(random));
        for kind in ["biharmonic", "geodesic"] {
            let body = |p: usize, q: usize| json!({"distance": {"kind": kind}, "sources": [p, q]});
            let a = ask(&app, &format!("{dirty}/distances"), &body(p.0, q.0)).await;
            let b = ask(&app, &format!("{clean}/distances"), &body(p.1, q.1)).await;
            assert_close(&numbers(&a["values"]), &told(&numbers(&b["values"]), 2, &case.vertices), kind);
            let body = |p: usize, q: usize| json!({"distance": {"kind": kind}, "pairs": [[p, q]]});
            let a = ask(&app, &format!("{dirty}/distances"), &body(p.0, q.0)).await;
            let b = ask(&app, &format!("{clean}/distances"), &body(p.1, q.1)).await;
            assert_close(&numbers(&a["values"]), &numbers(&b["values"]), kind);
        }
        for method in ["heat", "exact"] {
            let body =
                |p: usize, q: usize| json!({"distance": {"kind": "geodesic", "method": method}, "sources": [p, q]});
            let a = ask(&app, &format!("/v1/meshes/{}/distances", case.dirty), &body(p.0, q.0)).await;
            let b = ask(&app, &format!("/v1/meshes/{}/distances", case.clean), &body(p.1, q.1)).await;
            assert_close(&numbers(&a["values"]), &told(&numbers(&b["values"]), 2, &case.vertices), method);
        }
        let dropped = case.dropped();
        let lost = json!({"distance": {"kind": "biharmonic"}, "sources": [dropped]});
        let refused = app.post(&format!("{dirty}/distances")).json(&lost).send().await.unwrap();
        let refused = problem(refused, 422, "invalid-vertex").await;
        assert_eq!(
            (&refused["vertex"], refused["detail"].as_str().unwrap().contains("was dropped")),
            (&json!(dropped), true)
        );
        ask(&app, &format!("{dirty}/distances?extend=nearest"), &lost).await;

        let signature = json!({"kind": "wave_kernel", "count": 40});
        let body = |p: usize, q: usize| json!({"signature": signature, "vertices": [p, q]});
        let a = ask(&app, &format!("{dirty}/signatures"), &body(p.0, q.0)).await;
        let b = ask(&app, &format!("{clean}/signatures"), &body(p.1, q.1)).await;
        assert_close(&numbers(&a["values"]), &numbers(&b["values"]), "signatures");
        let a = ask(&app, &format!("{dirty}/signatures"), &json!({"signature": signature})).await;
        let b = ask(&app, &format!("{clean}/signatures"), &json!({"signature": signature})).await;
        assert_close(&numbers(&a["values"]), &told(&numbers(&b["values"]), 40, &case.vertices), "all signatures");

        let body = |p: usize| json!({"signature": signature, "vertex": p, "count": 7});
        let a = ask(&app, &format!("{dirty}/similar-points"), &body(p.0)).await;
        let b = ask(&app, &format!("{clean}/similar-points"), &body(p.1)).await;
        let back = |vertex: &Value| case.vertices[vertex.as_u64().unwrap() as usize].unwrap() as u64;
        let found: Vec<u64> = a["vertices"].as_array().unwrap().iter().map(back).collect();
        let expected: Vec<u64> = b["vertices"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
        assert_eq!(found, expected);
        let a = raw(app.post(&format!("{dirty}/similar-points")).json(&body(p.0))).await;
        let b = raw(app.post(&format!("{clean}/similar-points")).json(&body(p.1))).await;
        assert_close(&a, &told(&b, 1, &case.vertices), "all differences");

        let marks: Vec<_> = (0..6).map(|_| (case.vertex(random), case.vertex(random))).collect();
        let id = |path: &str| path.rsplit('/').next().unwrap().to_owned();
        let own: Vec<f64> = (0..case.mesh.positions.len()).map(|_| random.unit()).collect();
        let carried = [told(&own, 1, &case.vertices), own];
        let body = |path: &str, marks: Vec<[usize; 2]>, carried: &[f64]| {
            json!({
                "source": id(path), "target": id(path), "landmarks": marks, "pairs": 20, "start": 10, "all_points": true,
                "both_ways": true, "carry": {"functions": {"columns": 1, "values": carried}}
            })
        };
        let on_file = marks.iter().map(|(p, q)| [p.0, q.0]).collect();
        let on_mesh = marks.iter().map(|(p, q)| [p.1, q.1]).collect();
        let a = ask(&app, "/v1/functional-maps", &body(&dirty, on_file, &carried[0])).await;
        let b = ask(&app, "/v1/functional-maps", &body(&clean, on_mesh, &carried[1])).await;
        assert_close(&numbers(&a["matrix"]["values"]), &numbers(&b["matrix"]["values"]), "map");
        assert_close(
            &numbers(&a["carried"]["values"]),
            &told(&numbers(&b["carried"]["values"]), 1, &case.vertices),
            "carried",
        );
        for (a, b) in [(&a, &b), (&a["inverse"], &b["inverse"])] {
            assert_close(
                &numbers(&a["confidences"]),
                &told(&numbers(&b["confidences"]), 1, &case.vertices),
                "confidences",
            );
            let points = a["points"].as_array().unwrap();
            assert_eq!(points.len(), case.vertices.len());
            for (file, point) in points.iter().enumerate() {
                let expected = case.vertices[file].map(|kept| b["points"][kept].as_u64().unwrap());
                assert_eq!(point.as_u64().map(|_| back(point)), expected);
            }
        }
        let body = json!({"bases": [id(&dirty), id(&clean)], "pairs": 20, "start": 10, "matrices": true});
        let a = ask(&app, "/v1/map-collections", &body).await;
        let b = ask(&app, "/v1/map-collections?numbering=kept", &body).await;
        for map in 0..2 {
            let (a, b) = (&a["maps"][map], &b["maps"][map]);
            assert_close(&numbers(&a["matrix"]["values"]), &numbers(&b["matrix"]["values"]), "map of a collection");
        }
        let onto_file: Vec<u64> = a["maps"][0]["points"].as_array().unwrap().iter().map(back).collect();
        let expected = b["maps"][0]["points"].as_array().unwrap().iter().map(|point| point.as_u64().unwrap());
        assert_eq!(onto_file, expected.collect::<Vec<_>>());
        let from_file = a["maps"][1]["points"].as_array().unwrap();
        assert_eq!(from_file.len(), case.vertices.len());
        for (point, kept) in from_file.iter().zip(&case.vertices) {
            assert_eq!(point.as_u64(), kept.map(|kept| b["maps"][1]["points"][kept].as_u64().unwrap()));
        }
        // Of stored maps each end is numbered as its own file.
        let parameters = json!({"pairs": 20, "start": 10, "samples": 100});
        let job = json!({"kind": "map_collection", "bases": [id(&dirty), id(&clean)], "parameters": parameters});
        let job = ask_for(&app, &job).await;
        let maps = async |query: &str| -> Value {
            let url = format!("{}/maps{query}", job["links"]["basis"].as_str().unwrap());
            app.get(&url).send().await.unwrap().json().await.unwrap()
        };
        let (a, b) = (maps("").await, maps("?numbering=kept").await);
        let points = |maps: &Value, map: usize| maps["maps"][map]["points"].as_array().unwrap().clone();
        let onto_file: Vec<u64> = points(&a, 0).iter().map(back).collect();
        assert_eq!(onto_file, points(&b, 0).iter().map(|point| point.as_u64().unwrap()).collect::<Vec<_>>());
        let from_file = points(&a, 1);
        assert_eq!(from_file.len(), case.vertices.len());
        for (point, kept) in from_file.iter().zip(&case.vertices) {
            assert_eq!(point.as_u64(), kept.map(|kept| b["maps"][1]["points"][kept].as_u64().unwrap()));
        }
        assert_close(
            &numbers(&a["maps"][1]["confidences"]),
            &told(&numbers(&b["maps"][1]["confidences"]), 1, &case.vertices),
            "stored confidences",
        );
    }
}

#[tokio::test]
async fn jobs_and_motions_take_the_vertices_of_the_file() {
    let app = app();
    for seed in 6..8 {
        let case = Case::new(&app, seed).await;
        let random = &mut SplitMix64::new(seed);
        let own: Vec<f64> = (0..case.mesh.positions.len()).map(|_| 5.0 * random.unit()).collect();
        let potential = |values: &[f64]| {
            let operator = json!({"hamiltonian": {"potential": {"values": values}}});
            json!({"method": EXACT, "count": 10, "tolerance": 1e-8, "operator": operator})
        };
        let file = told(&own, 1, &case.vertices);
        bases(&app, &case, "eigenbasis", [&potential(&file), &potential(&own)]).await;

        let held: Vec<_> = (0..4).map(|_| case.vertex(random)).collect();
        let modes =
            |clamped: Vec<usize>| json!({"count": 12, "thickness": 0.01, "tolerance": 1e-6, "clamped": clamped});
        let on_file = modes(held.iter().map(|v| v.0).collect());
        let on_mesh = modes(held.iter().map(|v| v.1).collect());
        let [dirty, clean] = bases(&app, &case, "vibration_basis", [&on_file, &on_mesh]).await;
        let (struck, seen) = (case.vertex(random), case.vertex(random));
        let tap = |vertex: usize, more: Value| {
            let mut body =
                json!({"loads": [{"impulse": {"vertex": vertex, "momentum": [0.1, 0.2, -0.3]}}], "times": [0.1, 0.2]});
            body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            body
        };
        let a = ask(&app, &format!("{dirty}/simulate"), &tap(struck.0, json!({}))).await;
        let b = ask(&app, &format!("{clean}/simulate"), &tap(struck.1, json!({}))).await;
        for time in 0..2 {
            let expected = told(&numbers(&b["displacements"][time]), 3, &case.vertices);
            assert_close(&numbers(&a["displacements"][time]), &expected, "motion");
        }
        let frames = raw(app.post(&format!("{dirty}/simulate")).json(&tap(struck.0, json!({})))).await;
        assert_close(&frames[..3 * case.vertices.len()], &numbers(&a["displacements"][0]), "frames");
        let a = ask(&app, &format!("{dirty}/simulate"), &tap(struck.0, json!({"vertices": [seen.0]}))).await;
        let b = ask(&app, &format!("{clean}/simulate"), &tap(struck.1, json!({"vertices": [seen.1]}))).await;
        assert_close(&numbers(&a["displacements"][1]), &numbers(&b["displacements"][1]), "one vertex");
        let pushed: Vec<f64> = (0..3 * case.mesh.positions.len()).map(|_| random.signed_unit()).collect();
        // What dropped vertices are given does not matter.
        let in_file: Vec<f64> =
            told(&pushed, 3, &case.vertices).iter().map(|x| if x.is_nan() { 7.0 } else { *x }).collect();
        let rows = |vectors: &[f64]| vectors.chunks(3).map(<[f64]>::to_vec).collect::<Vec<_>>();
        let swing = |vectors: &[f64]| json!({"initial": {"vertices": {"velocities": rows(vectors)}}});
        let a = ask(&app, &format!("{dirty}/simulate"), &tap(struck.0, swing(&in_file))).await;
        let b = ask(&app, &format!("{clean}/simulate"), &tap(struck.1, swing(&pushed))).await;
        assert_close(&numbers(&a["state"]["positions"]), &numbers(&b["state"]["positions"]), "begun in motion");
        let lost = app.post(&format!("{dirty}/simulate")).json(&tap(case.dropped(), json!({}))).send().await.unwrap();
        problem(lost, 422, "invalid-simulation/vertex-out-of-range").await;
        let body = json!({"kind": "vibration_basis", "mesh": case.dirty, "parameters": modes(vec![case.dropped()])});
        let refused =
            problem(app.post("/v1/jobs").json(&body).send().await.unwrap(), 422, "invalid-parameter/clamped").await;
        assert!(refused["detail"].as_str().unwrap().contains("was dropped"), "{refused}");

        let family = json!({"dimension": 60});
        let [dirty, clean] = bases(&app, &case, "operator_family", [&family, &family]).await;
        let body = json!({"extrinsic": 0.5, "count": 5, "give": "modes"});
        let a = ask(&app, &format!("{dirty}/spectrum"), &body).await;
        let b = ask(&app, &format!("{clean}/spectrum"), &body).await;
        let expected = told(&numbers(&b["modes"]["values"]), 5, &case.vertices);
        assert_close(&numbers(&a["modes"]["values"]), &expected, "family");
    }
}

#[tokio::test]
async fn maps_are_served_and_stored_with_every_basis() {
    let app = app();
    let case = Case::new(&app, 20).await;
    let url = |map: &str| format!("/v1/meshes/{}/{map}", case.dirty);
    let map: Value = app.get(&url("vertex-map")).send().await.unwrap().json().await.unwrap();
    assert_eq!(
        (&map["known"], &map["identical"], &map["kept"]),
        (&json!(true), &json!(false), &json!(case.mesh.positions.len()))
    );
    let found: Vec<Option<usize>> =
        map["map"].as_array().unwrap().iter().map(|v| v.as_u64().map(|v| v as usize)).collect();
    assert_eq!(found, case.vertices);
    let map: Value = app.get(&url("face-map?of=file")).send().await.unwrap().json().await.unwrap();
    let found: Vec<Option<usize>> =
        map["map"].as_array().unwrap().iter().map(|v| v.as_u64().map(|v| v as usize)).collect();
    assert_eq!(found, case.faces);
    let npy = app.get(&url("face-map?format=npy")).send().await.unwrap().bytes().await.unwrap();
    let (head, data) = npy.split_at(128);
    assert!(
        String::from_utf8_lossy(head)
            .contains(&format!("'<i4', 'fortran_order': False, 'shape': ({},)", case.mesh.faces.len()))
    );
    let data: Vec<usize> = data.as_chunks::<4>().0.iter().map(|&w| i32::from_le_bytes(w) as usize).collect();
    assert!(data.iter().enumerate().all(|(kept, &file)| case.faces[file] == Some(kept)));

    for (kind, parameters) in [
        ("eigenbasis", json!({"method": "hsim", "count": 5})),
        ("eigenbasis", json!({"method": "approximate", "count": 5, "dimension": 40})),
        ("field_basis", json!({"dimension": 40})),
        ("operator_family", json!({"dimension": 40})),
        ("vibration_basis", json!({"count": 8, "thickness": 0.01})),
    ] {
        let basis = job(&app, kind, &case.dirty, &parameters, "").await;
        let file =
            app.get(&format!("{}/content", text(&basis["links"]["self"]))).send().await.unwrap().bytes().await.unwrap();
        let mut archive = zip::ZipArchive::new(std::io::Cursor::new(file)).unwrap();
        for (name, length) in [("vertex_map.npy", case.vertices.len()), ("face_map.npy", case.mesh.faces.len())] {
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut archive.by_name(name).unwrap(), &mut bytes).unwrap();
            assert_eq!(bytes.len(), 128 + 4 * length, "{kind}: {name}");
            if name == "vertex_map.npy" {
                let map = bytes[128..].as_chunks::<4>().0.iter().map(|&w| usize::try_from(i32::from_le_bytes(w)).ok());
                assert_eq!(map.collect::<Vec<_>>(), case.vertices);
            }
        }
    }
    let plain: Value =
        app.get(&format!("/v1/meshes/{}/vertex-map", case.clean)).send().await.unwrap().json().await.unwrap();
    assert_eq!(
        (&plain["identical"], plain["map"].as_array().unwrap().len()),
        (&json!(true), case.mesh.positions.len())
    );
}
