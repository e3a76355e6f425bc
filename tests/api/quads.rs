//! Parametrisations along cross fields, over HTTP.

use chladni_mesh::shape::{Shape, generate};
use serde_json::{Value, json};

use crate::common::{problem, text};
use crate::fields::{builder, made, numbers, shape};

#[tokio::test]
async fn a_surface_is_parametrised_along_fields_of_three_sources() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 600).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let url = format!("/v1/meshes/{}/quads", text(&mesh["id"]));
    let ask = async |query: &str, body: Value| {
        let answer = app.post(&format!("{url}{query}")).json(&body).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{body}");
        answer
    };
    let plain: Value = ask("", json!({"creases": null})).await.json().await.unwrap();
    assert_eq!(numbers(&plain["coordinates"]["values"]).len(), 6 * faces);
    assert_eq!(plain["misfit"], Value::Null);
    // Along given directions: those around the axis, which are smooth, so that nothing is singular and the cut is that
    // of the handle.
    let torus = generate(Shape::Torus, 600).unwrap();
    let around = |face: &[u32; 3]| {
        let p = [0, 1].map(|i| face.iter().map(|&v| torus.positions[v as usize][i]).sum::<f64>());
        [-p[1], p[0], 0.0]
    };
    let around: Vec<f64> = torus.faces.iter().flat_map(around).collect();
    let table = json!({"table": {"columns": 3, "values": around}});
    let around: Value = ask("", json!({"field": table, "creases": null, "integers": true})).await.json().await.unwrap();
    assert_eq!(around["singularities"], json!([]));
    assert!(around["misfit"].as_f64().unwrap() < 1e-6 && around["inverted"] == json!([]), "{}", around["misfit"]);
    for edge in around["cut"].as_array().unwrap() {
        assert_eq!(edge["quarters"], 0, "{edge}");
    }
    let basis = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 60})).await;
    let of = json!({"basis": {"id": basis["id"], "field": {"eigenfield": 0}}});
    let from_basis: Value = ask("", json!({"field": of})).await.json().await.unwrap();
    assert_eq!(numbers(&from_basis["directions"]["values"]).len(), 3 * faces);
    for (format, start) in
        [("obj", "v "), ("vtk", "# vtk"), ("rawfield", "4 "), ("matching", "4 "), ("singularities", "4 0\n")]
    {
        let answer = ask(&format!("?format={format}"), json!({"field": table})).await;
        let content = answer.text().await.unwrap();
        assert!(content.starts_with(start), "{format}: {}", &content[..20.min(content.len())]);
    }
    let other = shape(&app, Shape::Sphere, 162).await;
    let elsewhere = format!("/v1/meshes/{}/quads", text(&other["id"]));
    let refused = app.post(&elsewhere).json(&json!({"field": of})).send().await.unwrap();
    let refused = problem(refused, 422, "invalid-design/basis").await;
    assert!(text(&refused["detail"]).contains("lives on the mesh"), "{refused}");
    let pin = |face: usize, direction: Value| json!({"field": {"aligned": {"constraints": [{"face": face, "direction": direction}]}}});
    for (body, kind, words) in [
        (json!({"spacing": 0.0}), "quads", "spacing is 0"),
        (json!({"stiffening": 51}), "quads", "stiffening is 51"),
        (json!({"creases": 0.0}), "creases", "creases"),
        (json!({"field": {"aligned": {"creases": 181.0}}}), "quads", "creases is 181"),
        (json!({"field": {"table": {"columns": 3, "values": [1.0, 0.0, 0.0]}}}), "field", "rows, one for each face"),
        (json!({"field": {"table": {"columns": 2, "values": vec![0.0; 2 * faces]}}}), "field", "the row of face 0"),
        (pin(faces, json!([1.0, 0.0, 0.0])), "face", "field.aligned.constraints[0]"),
        (pin(3, json!([0.0, 0.0, 0.0])), "direction", "field.aligned.constraints[0]"),
        (json!({"field": {"basis": {"id": "none", "field": {"eigenfield": 0}}}}), "basis", "is not the id of a basis"),
    ] {
        let refused = app.post(&url).json(&body).send().await.unwrap();
        let refused = problem(refused, 422, &format!("invalid-design/{kind}")).await;
        // A sentence begins with a capital.
        assert!(text(&refused["detail"]).to_lowercase().contains(&words.to_lowercase()), "{refused}");
    }
}
