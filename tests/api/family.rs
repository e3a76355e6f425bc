use std::sync::Arc;

use chladni::queue::Solver;
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_mesh::write::write_ply;
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

/// A server with a family on a small torus: its address there, and the number of vertices.
async fn family() -> (TestApp, String, usize) {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    // Without the symmetries of a torus, by which functions of different anchors that are exact depend on each other.
    let mesh = noisy(&generate(Shape::Torus, 900).unwrap(), 0.15, 7).unwrap();
    let mut bytes = Vec::new();
    write_ply(&mesh, None, &mut bytes).unwrap();
    let id = text(&app.upload("ply", bytes).await["id"]);
    let body = json!({"kind": "operator_family", "mesh": id, "parameters": {"dimension": 150}});
    let job: Value = app.post("/v1/jobs").json(&body).send().await.unwrap().json().await.unwrap();
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    (app, text(&job["basis"]), mesh.positions.len())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[tokio::test]
async fn spectra_of_a_family_follow_its_parameters() {
    let (app, basis, n) = family().await;
    let shown: Value = app.get(&format!("/v1/bases/{basis}")).send().await.unwrap().json().await.unwrap();
    assert_eq!(shown["kind"], "operator_family");
    // At most as many as were asked for: functions of one anchor may depend on those of the others.
    let dimension = shown["dimension"].as_u64().unwrap() as usize;
    assert!((100..=150).contains(&dimension), "{dimension}");
    let url = format!("/v1/bases/{basis}/spectrum");
    let ask = async |body: Value| -> Value { app.post(&url).json(&body).send().await.unwrap().json().await.unwrap() };
    let laplacian = ask(json!({"count": 20})).await;
    assert!(numbers(&laplacian["eigenvalues"])[0].abs() < 1e-6);
    assert_eq!(laplacian["covered"], 18);
    let both = numbers(&laplacian["eigenvalues"]).into_iter().zip(numbers(&shown["eigenvalues"]));
    assert!(both.into_iter().all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + b)));
    // A potential that is positive raises every eigenvalue, and twice of it raises them more.
    let mut last = numbers(&laplacian["eigenvalues"]);
    for body in [json!({"count": 20, "curvature": 0.5}), json!({"count": 20, "curvature": 1.0})] {
        let values = numbers(&ask(body).await["eigenvalues"]);
        assert!(values.iter().zip(&last).all(|(now, before)| now > before));
        last = values;
    }
    let extrinsic = ask(json!({"extrinsic": 1.0, "count": 5, "give": "modes"})).await;
    assert!(numbers(&extrinsic["eigenvalues"])[0] > 0.1);
    assert_eq!(extrinsic["modes"]["values"].as_array().unwrap().len(), 5 * n);
    let request = app.post(&url).json(&json!({"extrinsic": 1.0, "count": 5, "give": "modes"}));
    let raw = request.header("accept", "application/octet-stream").send().await.unwrap();
    let head = raw.headers().clone();
    assert_eq!(head["chladni-rows"], n.to_string());
    assert_eq!([&head["chladni-columns"], &head["chladni-covered"]], ["5", "5"]);
    let listed: Vec<f64> =
        head["chladni-eigenvalues"].to_str().unwrap().split(' ').map(|value| value.parse().unwrap()).collect();
    assert!((listed[4] / numbers(&extrinsic["eigenvalues"])[4] - 1.0).abs() < 1e-8);
    let bytes = raw.bytes().await.unwrap();
    let first = f32::from_le_bytes(bytes[..4].try_into().unwrap());
    assert!((f64::from(first) - extrinsic["modes"]["values"][0].as_f64().unwrap()).abs() < 1e-5);
    // Equal content is one download.
    let content = app.get(&format!("/v1/bases/{basis}/content")).send().await.unwrap();
    let content = content.bytes().await.unwrap();
    assert_eq!(chladni_spectral::formats::npz::read_family(&content).unwrap().dimension(), dimension);

    for (body, name) in [
        (json!({"extrinsic": 1.5}), "extrinsic"),
        (json!({"curvature": -1.0}), "curvature"),
        (json!({"count": 0}), "count"),
        (json!({"count": dimension + 1}), "count"),
    ] {
        let refused = app.post(&url).json(&body).send().await.unwrap();
        assert_eq!(problem(refused, 422, &format!("invalid-spectrum/{name}")).await["parameter"], name);
    }
    problem(app.post(&url).json(&json!({"t": 1.0})).send().await.unwrap(), 422, "invalid-request").await;
    // Routes for other kinds of basis say so.
    let filter = json!({"functions": "coordinates", "transfer": {"kind": "heat", "time": 1.0}});
    let refused = app.post(&format!("/v1/bases/{basis}/filter")).json(&filter).send().await.unwrap();
    problem(refused, 409, "basis-kind").await;
    let refused = app.post(&format!("/v1/bases/{basis}/simulate")).json(&json!({})).send().await.unwrap();
    problem(refused, 409, "basis-kind").await;
}

#[tokio::test]
async fn parameters_of_a_family_are_checked() {
    let app = TestApp::start();
    let (mesh, _) = app.sphere().await;
    for (parameters, name) in [(json!({"dimension": 3}), "dimension"), (json!({"size": 3}), "form")] {
        let body = json!({"kind": "operator_family", "mesh": mesh, "parameters": parameters});
        let refused = app.post("/v1/jobs").json(&body).send().await.unwrap();
        problem(refused, 422, &format!("invalid-parameter/{name}")).await;
    }
}
