use std::fmt::Write;
use std::sync::Arc;

use chladni::queue::Solver;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

fn app() -> TestApp {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    builder.start()
}

async fn sphere(app: &TestApp) -> (String, usize) {
    let mesh = generate(Shape::Sphere, 400).unwrap();
    let mut bytes = Vec::new();
    write_ply(&mesh, None, &mut bytes).unwrap();
    (text(&app.upload("ply", bytes).await["id"]), mesh.positions.len())
}

async fn modes(app: &TestApp, mesh: &str, parameters: Value) -> Value {
    let body = json!({"kind": "vibration_basis", "mesh": mesh, "parameters": parameters});
    let job: Value = app.post("/v1/jobs").json(&body).send().await.unwrap().json().await.unwrap();
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap()
}

/// A bar of `4 × 2 × 2` cubes in MEDIT's format, each cut into six tetrahedra, its vertices in the order of the grid.
fn bar() -> String {
    let at = |p: [usize; 3]| (p[2] * 3 + p[1]) * 5 + p[0] + 1;
    let mut out = "MeshVersionFormatted 1\nDimension 3\nVertices\n45\n".to_owned();
    for (z, y, x) in (0..3).flat_map(|z| (0..3).flat_map(move |y| (0..5).map(move |x| (z, y, x)))) {
        writeln!(out, "{x} {y} {z} 0").unwrap();
    }
    out.push_str("Tetrahedra\n96\n");
    for (k, j, i) in (0..2).flat_map(|k| (0..2).flat_map(move |j| (0..4).map(move |i| (k, j, i)))) {
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut corner = [i, j, k];
            write!(out, "{} ", at(corner)).unwrap();
            for axis in order {
                corner[axis] += 1;
                write!(out, "{} ", at(corner)).unwrap();
            }
            out.push_str("0\n");
        }
    }
    out + "End\n"
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|&number| f32::from_le_bytes(number)).collect()
}

#[tokio::test]
async fn a_shell_vibrates_is_struck_and_heard() {
    let app = app();
    let (mesh, n) = sphere(&app).await;
    let shown =
        modes(&app, &mesh, json!({"count": 20, "thickness": 0.05, "method": "approximate", "dimension": 60})).await;
    assert_eq!((&shown["kind"], &shown["count"]), (&json!("vibration_basis"), &json!(20)));
    assert_eq!(shown["details"]["rigid_motions"], 6);
    let values: Vec<f64> = shown["eigenvalues"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(values[..6].iter().all(|&value| value == 0.0) && values[6] > 0.0);
    assert!(shown["operator"]["total_mass"].as_f64().unwrap() > 0.0);
    let url = format!("{}/simulate", text(&shown["links"]["self"]));
    let tap = json!([{"impulse": {"vertex": 3, "momentum": [0.0, 0.0, 1.0]}}]);
    let body = json!({"loads": tap, "times": [0.0, 0.001, 0.5], "vertices": [3, 0]});
    let told: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
    let energies: Vec<f64> = told["energies"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).collect();
    assert!(energies[0] > 0.0 && energies.iter().all(|e| (e / energies[0] - 1.0).abs() < 1e-9), "{energies:?}");
    assert_eq!(told["displacements"][0], json!([0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert!(told["displacements"][1][2].as_f64().unwrap() > 0.0);
    // All vertices as raw numbers agree with the chosen ones.
    let body = json!({"loads": tap, "times": [0.001, 0.5]});
    let request = app.post(&url).json(&body).header("accept", "application/octet-stream");
    let raw = request.send().await.unwrap();
    assert_eq!(raw.headers()["chladni-rows"], "2");
    assert_eq!(raw.headers()["chladni-columns"], (3 * n).to_string());
    let frames = floats(&raw.bytes().await.unwrap());
    assert_eq!(frames.len(), 6 * n);
    assert!((f64::from(frames[11]) - told["displacements"][1][2].as_f64().unwrap()).abs() < 1e-12);
    let body = json!({"loads": tap, "times": [0.001], "give": "state"});
    let state: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
    assert_eq!(state["positions"][0].as_array().unwrap().len(), 20);
    let body = json!({"loads": tap, "damping": {"alpha": 3.0, "beta": 1e-8}, "sound": {"listener": [0.0, 0.0, 4.0], "sample_rate": 8000, "seconds": 0.25}});
    let wav = app.post(&url).json(&body).send().await.unwrap();
    assert_eq!(wav.headers()["content-type"], "audio/wav");
    let wav = wav.bytes().await.unwrap();
    assert_eq!((&wav[..4], wav.len()), (&b"RIFF"[..], 44 + 4000));
    let content = app.get(&text(&shown["links"]["content"])).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(chladni_spectral::formats::npz::read_modes(&content).unwrap().count(), 20);

    // What a request gives back another one goes on from: two halves of a motion are the whole.
    let fall = json!([{"body": {"acceleration": [0.0, 0.0, -9.81]}}]);
    let asked = async |body: Value| -> Value { app.post(&url).json(&body).send().await.unwrap().json().await.unwrap() };
    let whole = asked(json!({"loads": fall, "times": [0.002, 0.005], "vertices": [3]})).await;
    let first = asked(json!({"loads": fall, "times": [0.002], "vertices": [3]})).await;
    let second = asked(json!({"initial": {"state": first["state"]}, "loads": fall, "times": [0.003], "vertices": [3]}));
    let second = second.await;
    for k in 0..3 {
        let [a, b] = [&whole["displacements"][1][k], &second["displacements"][0][k]].map(|x| x.as_f64().unwrap());
        assert!((a - b).abs() < 1e-9, "{whole} {second}");
    }
    let thrown = json!({"vertices": {"velocities": vec![[0.0, 2.0, 0.0]; n]}});
    let thrown = asked(json!({"initial": thrown, "times": [0.5], "vertices": [3]})).await;
    assert!((thrown["displacements"][0][1].as_f64().unwrap() - 1.0).abs() < 1e-3, "{thrown}");
    assert!(thrown["left_out"].as_f64().unwrap() < 1e-3);

    for (body, within) in [
        (json!({"initial": {"state": {"positions": [0.0], "velocities": [0.0]}}}), "initial"),
        (json!({"initial": {"state": {"positions": [0.0], "velocities": []}}}), "initial"),
        (json!({"initial": {"vertices": {"displacements": [[0.0, 0.0, 1.0]]}}}), "initial"),
        (json!({"loads": [{"body": {"from": 1.0, "to": 0.5, "acceleration": [0, 0, 1]}}]}), "loads"),
        (json!({"loads": [{"impulse": {"vertex": n, "momentum": [0, 0, 1]}}]}), "vertex-out-of-range"),
        (json!({"vertices": [n], "times": [0.0]}), "vertex-out-of-range"),
        (json!({"times": [1.0, 0.5]}), "times"),
        (json!({"times": [-1.0]}), "times"),
        (json!({"damping": {"alpha": -1.0}}), "damping"),
        (json!({"loads": [{"force": {"vertex": 0, "from": 1.0, "to": 0.5, "force": [0, 0, 1]}}]}), "loads"),
        (json!({"sound": {"listener": [0, 0, 1], "sample_rate": 5}}), "sound"),
        (json!({"times": vec![0.0; 4000]}), "times"),
        (json!({"times": [1e308], "loads": fall}), "times"),
        (json!({"times": [0.1], "loads": [{"impulse": {"vertex": 3, "momentum": [1e308, 0, 0]}}]}), "times"),
        (
            json!({"sound": {"listener": [0, 0, 4], "seconds": 0.01}, "loads": [{"impulse": {"vertex": 3, "momentum": [1e308, 0, 0]}}]}),
            "times",
        ),
    ] {
        let refused = app.post(&url).json(&body).send().await.unwrap();
        problem(refused, 422, &format!("invalid-simulation/{within}")).await;
    }
    for (body, words) in [
        (json!({"loads": [{"push": {}}]}), "push"),
        (json!({"loads": [null]}), "loads[0] must be a word or an object, got null"),
        (json!({"damping": [1.0, 0.001]}), "damping must be an object, got a list"),
    ] {
        let refused = problem(app.post(&url).json(&body).send().await.unwrap(), 422, "invalid-request").await;
        assert!(refused["detail"].as_str().unwrap().contains(words), "{refused}");
    }
}

#[tokio::test]
async fn a_solid_is_uploaded_with_its_tetrahedra_and_vibrates() {
    let app = app();
    let stored = app.upload("medit", bar()).await;
    let report = &stored["report"];
    assert_eq!(stored["vertices"], 42, "the surface");
    assert_eq!(report["solid"]["vertices"], 45);
    assert_eq!((&report["solid"]["tetrahedra"], &report["closed"]), (&json!(96), &json!(true)));
    assert!((report["solid"]["volume"].as_f64().unwrap() - 16.0).abs() < 1e-12);
    assert_eq!(report["solid"]["inverted"], 48);
    let divided = app.post("/v1/meshes?format=medit&subdivide=1").body(bar()).send().await.unwrap();
    problem(divided, 422, "unusable-mesh/subdivided-solid").await;
    let mesh = text(&stored["id"]);
    let again: Value = app.get(&format!("/v1/meshes/{mesh}")).send().await.unwrap().json().await.unwrap();
    assert_eq!(again["report"]["solid"], report["solid"]);
    for method in ["approximate", "hsim"] {
        let shown = modes(&app, &mesh, json!({"count": 12, "method": method})).await;
        assert_eq!(shown["details"]["vertices"], 45);
        assert_eq!(shown["details"]["rigid_motions"], 6);
        let url = format!("{}/simulate", text(&shown["links"]["self"]));
        let tap = json!([{"impulse": {"vertex": 44, "momentum": [0.0, 0.0, 1.0]}}]);
        let body = json!({"loads": tap, "sound": {"listener": [0, 0, 9], "sample_rate": 8000, "seconds": 0.05}});
        assert_eq!(app.post(&url).json(&body).send().await.unwrap().status(), 200);
    }
    // The surface of a solid is a mesh like others.
    let job = app.submit(&mesh, json!({"count": 5})).await;
    assert_eq!(app.finished(&text(&job["id"])).await["status"], "succeeded");
    // Tetrahedra that do not exist, or have no volume.
    let start = "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n1 1 0 0\n";
    for (end, kind) in [
        ("Tetrahedra\n1\n1 2 3 4 0\n", "unusable-mesh/no-volume"),
        ("Tetrahedra\n1\n1 2 3 9 0\n", "unreadable-mesh/index-out-of-range"),
        ("Tetrahedra\n4000000000\n1 2 3 4 0\n", "unreadable-mesh/count-exceeds-file"),
    ] {
        let refused = app.post("/v1/meshes?format=medit").body(format!("{start}{end}")).send().await.unwrap();
        problem(refused, 422, kind).await;
    }
}

#[tokio::test]
async fn what_cannot_vibrate_is_refused_by_name() {
    let app = TestApp::start();
    let (mesh, n) = app.sphere().await;
    for (parameters, name) in [
        (json!({"count": 10}), "thickness"),
        (json!({"thickness": 0.0}), "thickness"),
        (json!({"thickness": 0.1, "clamped": [n]}), "clamped"),
        (json!({"thickness": 0.1, "count": 4, "clamped": (0..n).collect::<Vec<_>>()}), "clamped"),
        (json!({"thickness": 0.1, "count": 3 * n + 1}), "count"),
        (json!({"thickness": 0.1, "material": {"poisson": 0.7}}), "material.poisson"),
        (json!({"thickness": 0.1, "method": "hsim", "dimension": 100}), "dimension"),
    ] {
        let body = json!({"kind": "vibration_basis", "mesh": mesh, "parameters": parameters});
        let refused = app.post("/v1/jobs").json(&body).send().await.unwrap();
        problem(refused, 422, &format!("invalid-parameter/{name}")).await;
    }
}

/// A sphere whose file has two vertices that no face uses, two of its own held.
#[tokio::test]
async fn what_an_answer_has_goes_in_again_and_held_vertices_count() {
    let app = app();
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let n = mesh.positions.len();
    let mut file = "v 7 7 7\n".to_owned();
    mesh.positions.iter().for_each(|[x, y, z]| writeln!(file, "v {x:?} {y:?} {z:?}").unwrap());
    file.push_str("v 8 8 8\n");
    mesh.faces.iter().for_each(|[a, b, c]| writeln!(file, "f {} {} {}", a + 2, b + 2, c + 2).unwrap());
    let id = text(&app.upload("obj", file).await["id"]);
    let shown = modes(&app, &id, json!({"count": 12, "thickness": 0.05, "clamped": [3, 9]})).await;
    let url = format!("{}/simulate", text(&shown["links"]["self"]));
    let ask = async |body: Value| -> Value {
        let answer = app.post(&url).json(&body).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{body}");
        answer.json().await.unwrap()
    };
    let taps = json!([
        {"impulse": {"vertex": 20, "momentum": [0.0, 0.0, 1.0]}}, {"impulse": {"vertex": 9, "momentum": [0.0, 0.0, 1.0]}},
        {"body": {"acceleration": [0, 0, -1], "to": 1.0}}, {"force": {"vertex": 3, "from": 0.0, "to": 1.0, "force": [1, 0, 0]}}
    ]);
    let first = ask(json!({"loads": taps, "times": [0.001]})).await;
    assert_eq!((&first["held_loads"], &first["left_out"]), (&json!([1, 3]), &json!(0.0)));
    let raw =
        app.post(&url).json(&json!({"loads": taps, "times": [0.001]})).header("accept", "application/octet-stream");
    assert_eq!(raw.send().await.unwrap().headers()["chladni-held-loads"], "2");
    let frame = first["displacements"][0].as_array().unwrap();
    assert_eq!((frame.len(), &frame[0], &frame[3 * n + 5]), (3 * (n + 2), &Value::Null, &Value::Null));
    // Three numbers of each vertex in a row, null where the file has no vertex; and the same with null for the row.
    let rows: Vec<Value> = frame.chunks(3).map(|row| json!(row)).collect();
    let whole: Vec<Value> = rows.iter().map(|row| if row[0].is_null() { Value::Null } else { row.clone() }).collect();
    let mut back = Vec::new();
    for displacements in [rows.clone(), whole] {
        back.push(ask(json!({"initial": {"vertices": {"displacements": displacements}}, "times": [0.0]})).await);
    }
    assert_eq!(back[0], back[1]);
    assert!(back[0]["left_out"].as_f64().unwrap() < 1e-2, "{}", back[0]["left_out"]);
    // Where the file has a vertex, there must be a number.
    let mut gap = rows.clone();
    gap[5] = json!([0.0, null, 0.0]);
    let body = json!({"initial": {"vertices": {"displacements": gap}}, "times": [0.0]});
    let refused = app.post(&url).json(&body).send().await.unwrap();
    assert_eq!(refused.status(), 422);
    assert!(refused.text().await.unwrap().contains("vertex 5"));
    let mut held: Vec<Value> = vec![json!([0.0, 0.0, 0.0]); n + 2];
    held[9] = json!([0.0, 0.0, 1.0]);
    let told = ask(json!({"initial": {"vertices": {"displacements": held}}, "times": [0.0]})).await;
    assert_eq!(told["left_out"], 1.0);
}
