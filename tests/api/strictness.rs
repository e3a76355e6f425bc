//! What is not taken silently: parameters that there are not, members that are given twice or have no effect, bases
//! that do not correspond.

use std::sync::Arc;

use chladni::queue::Solver;
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_mesh::write::write_ply;
use serde_json::{Value, json};

use crate::common::{OCTAHEDRON, TestApp, problem, text};

fn app() -> TestApp {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    builder.start()
}

async fn uploaded(app: &TestApp, shape: Shape, seed: u64) -> String {
    let mut bytes = Vec::new();
    write_ply(&noisy(&generate(shape, 300).unwrap(), 0.1, seed).unwrap(), None, &mut bytes).unwrap();
    text(&app.upload("ply", bytes).await["id"])
}

async fn basis_of(app: &TestApp, kind: &str, mesh: &str, parameters: Value) -> String {
    let body = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
    let job: Value = app.post("/v1/jobs?wait=60s").json(&body).send().await.unwrap().json().await.unwrap();
    assert_eq!(job["status"], "succeeded", "{job}");
    text(&job["basis"])
}

#[tokio::test]
async fn a_query_with_a_parameter_that_there_is_not_is_refused_and_nothing_is_done() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3}});
    for (query, words) in [("foo=1", "Unknown query parameter \"foo\""), ("wait=abc", "wait: "), ("wait=", "wait: ")] {
        let refused = app.post(&format!("/v1/jobs?{query}")).json(&body).send().await.unwrap();
        let refused = problem(refused, 400, "invalid-query").await;
        assert!(refused["detail"].as_str().unwrap().contains(words), "{query}: {refused}");
    }
    let jobs: Value = app.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    assert_eq!(jobs["items"], json!([]));
    let basis = app.basis().await;
    let job: Value = app.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    let job = text(&job["items"][0]["id"]);
    for path in [
        format!("/v1/meshes/{mesh}"),
        format!("/v1/bases/{basis}"),
        format!("/v1/jobs/{job}"),
        format!("/v1/jobs/{job}/events"),
        "/v1/samples".to_owned(),
    ] {
        problem(app.get(&format!("{path}?foo=1")).send().await.unwrap(), 400, "invalid-query").await;
        assert_eq!(app.get(&path).send().await.unwrap().status(), 200, "{path}");
    }
    problem(app.delete(&format!("/v1/bases/{basis}?cascade=true")).send().await.unwrap(), 400, "invalid-query").await;
    assert_eq!(app.get(&format!("/v1/bases/{basis}")).send().await.unwrap().status(), 200);
    // Probes bring what they like.
    assert_eq!(app.get("/healthz?now=1").send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn a_job_can_be_waited_for_where_it_is_submitted() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let body = |seed: u32| json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3, "seed": seed}});
    let response = app.post("/v1/jobs?wait=60s").json(&body(200)).send().await.unwrap();
    assert_eq!(
        (response.status().as_u16(), &response.headers()["chladni-outcome"]),
        (200, &"created".parse().unwrap())
    );
    assert!(response.headers().contains_key("location") && !response.headers().contains_key("retry-after"));
    let job: Value = response.json().await.unwrap();
    assert_eq!(job["status"], "succeeded", "{job}");
    // Too short a wait: as without one.
    let response = app.post("/v1/jobs?wait=1ms").json(&body(1500)).send().await.unwrap();
    assert_eq!(response.status(), 202);
    let job: Value = response.json().await.unwrap();
    assert_eq!(app.finished(&text(&job["id"])).await["status"], "succeeded");
}

#[tokio::test]
async fn a_member_that_is_given_twice_is_refused_by_its_name() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let twice = |members: &str| format!(r#"{{"kind": "eigenbasis", "mesh": "{mesh}", {members}}}"#);
    for (members, name) in [
        (r#""parameters": {"count": 3, "count": 4}"#, "parameters.count is given twice"),
        (r#""parameters": {"count": 3}, "priority": 1, "priority": 2"#, "priority is given twice"),
        (
            r#""parameters": {"operator": {"extrinsic": {"t": 0.1, "t": 0.2}}}"#,
            "parameters.operator.extrinsic.t is given twice",
        ),
    ] {
        let request = app.post("/v1/jobs").header("content-type", "application/json").body(twice(members));
        let refused = problem(request.send().await.unwrap(), 422, "invalid-request").await;
        assert!(refused["detail"].as_str().unwrap().contains(name), "{members}: {refused}");
    }
}

#[tokio::test]
async fn what_is_the_default_anyway_is_equal_work() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let submitted = async |parameters: Value| app.submit(&mesh, parameters).await["id"].clone();
    let exact = |tolerance: f64| json!({"method": "hsim", "count": 3, "tolerance": tolerance});
    let with = |tolerance: f64, precision: &str| json!({"method": "hsim", "count": 3, "tolerance": tolerance, "precision": precision});
    let fine = submitted(exact(1e-5)).await;
    assert_eq!(submitted(with(1e-5, "f64")).await, fine);
    assert_ne!(submitted(with(1e-5, "f32")).await, fine);
    // Here the default is single where that keeps the tolerance.
    let coarse = submitted(exact(1e-2)).await;
    assert_ne!(submitted(with(1e-2, "f64")).await, coarse);
    for job in app.get("/v1/jobs").send().await.unwrap().json::<Value>().await.unwrap()["items"].as_array().unwrap() {
        app.finished(&text(&job["id"])).await;
    }
}

#[tokio::test]
async fn the_report_of_an_upload_is_that_of_the_file_that_was_sent() {
    let app = TestApp::start();
    let corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]];
    let (clean, again) = (json!([[0, 1, 2, 3], [1, 2, 3, 4]]), json!([[0, 1, 2, 3], [1, 2, 3, 4], [0, 1, 2, 3]]));
    let sent = async |tetrahedra: &Value, name: &str| -> Value {
        let body = json!({"vertices": corners, "tetrahedra": tetrahedra});
        app.post(&format!("/v1/meshes?name={name}")).json(&body).send().await.unwrap().json().await.unwrap()
    };
    let (first, second, third) = (sent(&clean, "a").await, sent(&again, "b").await, sent(&clean, "c").await);
    assert_eq!((&first["id"], &first["id"]), (&second["id"], &third["id"]));
    let dropped = |mesh: &Value| mesh["report"]["solid"]["dropped"].clone();
    assert_eq!((dropped(&first), dropped(&second), dropped(&third)), (json!(0), json!(1), json!(0)), "{second}");
    let kept: Value =
        app.get(&format!("/v1/meshes/{}", text(&first["id"]))).send().await.unwrap().json().await.unwrap();
    assert_eq!((dropped(&kept), &kept["name"]), (json!(0), &json!("a")));
    // Another file altogether stays another mesh.
    assert_ne!(app.upload("off", OCTAHEDRON).await["id"], first["id"]);
}

#[tokio::test]
async fn only_bases_that_correspond_are_mapped_with_a_job_or_without() {
    let app = app();
    let [a, b] = [uploaded(&app, Shape::Rectangle, 1).await, uploaded(&app, Shape::Rectangle, 2).await];
    let exact = |more: Value| {
        let mut parameters = json!({"method": "hsim", "count": 30});
        more.as_object().unwrap().iter().for_each(|(name, value)| parameters[name] = value.clone());
        parameters
    };
    let neumann = basis_of(&app, "eigenbasis", &a, exact(json!({}))).await;
    let other = basis_of(&app, "eigenbasis", &b, exact(json!({}))).await;
    let beside = basis_of(&app, "eigenbasis", &a, exact(json!({"seed": 3}))).await;
    let held = basis_of(&app, "eigenbasis", &b, exact(json!({"boundary": "dirichlet"}))).await;
    let potential = json!({"operator": {"hamiltonian": {"potential": {"curvature": {"t": 0.1}}}}});
    let hamiltonian = basis_of(&app, "eigenbasis", &b, exact(potential)).await;
    for (bases, status, kind, words) in [
        ([&neumann, &neumann], 422, "invalid-parameter/bases", "duplicates"),
        ([&neumann, &beside], 422, "invalid-parameter/bases", "of the mesh of bases[0]"),
        ([&neumann, &held], 409, "incomparable-bases", "dirichlet"),
        ([&neumann, &hamiltonian], 409, "incomparable-bases", "hamiltonian"),
    ] {
        let job = json!({"kind": "map_collection", "bases": bases});
        let told = problem(app.post("/v1/jobs").json(&job).send().await.unwrap(), status, kind).await;
        let direct = app.post("/v1/map-collections").json(&json!({"bases": bases})).send().await.unwrap();
        assert_eq!(problem(direct, status, kind).await["detail"], told["detail"]);
        assert!(told["detail"].as_str().unwrap().contains(words), "{told}");
    }
    let map = |target: &str, more: Value| {
        let mut body = json!({"source": neumann, "target": target, "start": 5, "pairs": 10, "landmarks": [[1, 1], [20, 20], [50, 50]]});
        more.as_object().unwrap().iter().for_each(|(name, value)| body[name] = value.clone());
        app.post("/v1/functional-maps").json(&body).send()
    };
    for target in [&held, &hamiltonian] {
        problem(map(target, json!({})).await.unwrap(), 409, "incomparable-bases").await;
    }
    for target in [&other, &neumann, &beside] {
        assert_eq!(map(target, json!({})).await.unwrap().status(), 200);
    }
    let refused = problem(map(&other, json!({"commutativity": 1e308})).await.unwrap(), 422, "invalid-analysis").await;
    assert_eq!(refused["detail"], "commutativity: must be a number from 0 to 1e12, not 1e308.");
}

#[tokio::test]
async fn a_stroke_on_a_mesh_of_two_faces_is_met_however_small_the_space_is() {
    let app = app();
    let square = "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n";
    let mesh = text(&app.upload("off", square).await["id"]);
    let stroke = json!({"strokes": [{"face": 0, "frame_direction": [1.0, 0.0]}]});
    let usual = basis_of(&app, "field_basis", &mesh, json!({"field": "n_vector", "n": 4})).await;
    let met = app.post(&format!("/v1/bases/{usual}/design")).json(&stroke).send().await.unwrap();
    assert_eq!(met.status(), 200);
    let met: Value = met.json().await.unwrap();
    assert!(met["residuals"][0].as_f64().unwrap() < 1e-3 && met["harmonic_energy"].as_f64().unwrap() < 1e-6, "{met}");
    let small = basis_of(&app, "field_basis", &mesh, json!({"field": "n_vector", "n": 4, "dimension": 2})).await;
    let design = |space: &str| {
        let mut asked = stroke.clone();
        asked["space"] = json!(space);
        app.post(&format!("/v1/bases/{small}/design")).json(&asked).send()
    };
    // A field without energy meets it, which any space holds.
    let met: Value = design("basis").await.unwrap().json().await.unwrap();
    assert_eq!(met["space"], "basis");
    assert!(met["residuals"][0].as_f64().unwrap() < 1e-3 && met["harmonic_energy"].as_f64().unwrap() < 1e-6, "{met}");
    let whole: Value = design("auto").await.unwrap().json().await.unwrap();
    assert_eq!(whole["space"], "surface");
    assert!(whole["residuals"][0].as_f64().unwrap() < 1e-3, "{whole}");
}

#[tokio::test]
async fn what_has_no_effect_beside_what_is_asked_for_is_refused() {
    let app = app();
    let mesh = uploaded(&app, Shape::Sphere, 1).await;
    let family = basis_of(&app, "operator_family", &mesh, json!({"dimension": 40})).await;
    let spectrum = |body: Value| app.post(&format!("/v1/bases/{family}/spectrum")).json(&body).send();
    let refused = problem(spectrum(json!({"mode": 3})).await.unwrap(), 422, "invalid-request").await;
    assert!(refused["detail"].as_str().unwrap().starts_with("mode: "), "{refused}");
    assert_eq!(spectrum(json!({"mode": 3, "give": "modes"})).await.unwrap().status(), 200);
    // Nobody said how many, and there are fewer than the usual number.
    let all: Value = spectrum(json!({})).await.unwrap().json().await.unwrap();
    assert!((1..=40).contains(&all["eigenvalues"].as_array().unwrap().len()), "{all}");

    let modes = basis_of(&app, "vibration_basis", &mesh, json!({"count": 12, "thickness": 0.05})).await;
    let simulate = |body: Value| app.post(&format!("/v1/bases/{modes}/simulate")).json(&body).send();
    let sound = json!({"listener": [0.0, 0.0, 5.0], "seconds": 0.01});
    for (name, value) in [("times", json!([0.0, 0.1])), ("vertices", json!([1])), ("give", json!("state"))] {
        let mut body = json!({"sound": sound});
        body[name] = value;
        let refused = problem(simulate(body).await.unwrap(), 422, "invalid-simulation/sound").await;
        assert!(refused["detail"].as_str().unwrap().contains(name), "{refused}");
    }
    assert_eq!(simulate(json!({"sound": sound})).await.unwrap().status(), 200);

    let heat = json!({"distance": {"kind": "geodesic", "time": 1e300}, "sources": [0]});
    let url = format!("/v1/meshes/{mesh}/distances");
    let refused = problem(app.post(&url).json(&heat).send().await.unwrap(), 422, "invalid-analysis").await;
    let told = refused["detail"].as_str().unwrap();
    assert!(told.starts_with("time: must be so short that") && told.ends_with("not 1e300."), "{told}");
}
