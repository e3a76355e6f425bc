//! Fields as resources: uploaded once and named in requests, designed and saved, listed, renamed and deleted, over HTTP
//! with the real solver.

use chladni_mesh::shape::Shape;
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};
use crate::fields::{builder, made, numbers, shape};

async fn posted(app: &TestApp, url: &str, body: &Value) -> Value {
    let response = app.post(url).json(body).send().await.unwrap();
    let status = response.status();
    let value: Value = response.json().await.unwrap();
    assert!(status.is_success(), "{url}: {status} {value}");
    value
}

async fn refused(app: &TestApp, url: &str, body: &Value, status: u16, kind: &str) -> String {
    let response = app.post(url).json(body).send().await.unwrap();
    text(&problem(response, status, kind).await["detail"])
}

async fn got(app: &TestApp, url: &str) -> Value {
    app.get(url).send().await.unwrap().json().await.unwrap()
}

async fn floats(app: &TestApp, url: &str) -> Vec<f32> {
    let response = app.get(url).header("accept", "application/octet-stream").send().await.unwrap();
    assert_eq!(response.status(), 200, "{url}");
    let bytes = response.bytes().await.unwrap();
    bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
}

fn assert_near(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let size = expected.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-5 * size, "{what}: {a} is not {b}");
    }
}

/// A vector for each face that differs from face to face.
fn vectors(faces: usize) -> Vec<f64> {
    (0..3 * faces).map(|i| (f64::from(i as u32) * 0.37).sin()).collect()
}

#[tokio::test]
async fn fields_and_weights_are_uploaded_once_and_named_by_their_ids() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 300).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let basis = made(&app, &mesh, json!({"dimension": 60})).await;
    let design = format!("{}?form=world", text(&basis["links"]["design"]));
    let fields = format!("/v1/meshes/{}/fields", text(&mesh["id"]));
    let (to, weights) = (vectors(faces), (0..faces).map(|f| f64::from(f as u32 % 7)).collect::<Vec<f64>>());
    let table = json!({"columns": 3, "values": to});
    let field = posted(&app, &format!("{fields}?name=waves"), &table).await;
    assert_eq!((&field["name"], &field["columns"], &field["faces"]), (&json!("waves"), &json!(3), &json!(faces)));
    assert_eq!((&field["basis"], &field["design"], &field["field"]), (&Value::Null, &Value::Null, &Value::Null));
    // Equal numbers on the same mesh are the same field, in whichever form they come.
    let bytes: Vec<u8> = to.iter().flat_map(|x| x.to_le_bytes()).collect();
    let again = app.post(&format!("{fields}?columns=3&dtype=f64&name=other"));
    let again = again.header("content-type", "application/octet-stream").body(bytes).send().await.unwrap();
    assert_eq!(again.status(), 200);
    let again: Value = again.json().await.unwrap();
    assert_eq!((&again["id"], &again["name"]), (&field["id"], &json!("waves")));
    let single = posted(&app, &fields, &json!({"values": weights})).await;
    assert_ne!(single["id"], field["id"]);

    let request = |to: Value, per_face: Value| json!({"strokes": [{"face": 5, "frame_direction": [1.0, 0.2]}], "alignment": {"to": to, "weight": 3.0, "per_face": per_face}});
    let (by_value, by_id) =
        (request(table, json!(weights)), request(json!({"stored": field["id"]}), json!({"stored": single["id"]})));
    let [by_value, by_id] = [posted(&app, &design, &by_value).await, posted(&app, &design, &by_id).await];
    assert_near(&numbers(&by_id["field"]["values"]), &numbers(&by_value["field"]["values"]), "design");
    let content = floats(&app, &text(&field["links"]["content"])).await;
    assert!(content.iter().zip(&to).all(|(a, b)| *a == *b as f32), "it comes back as it was");
    let npy = app.get(&text(&field["links"]["content"])).send().await.unwrap();
    assert_eq!(npy.headers()["content-type"], "application/x-npy");
    assert!(npy.bytes().await.unwrap().starts_with(b"\x93NUMPY"));
    let json = app.get(&text(&single["links"]["content"])).header("accept", "application/json").send().await.unwrap();
    assert_eq!(numbers(&json.json::<Value>().await.unwrap()["values"]), weights);

    // Crosses and lines along an upload.
    let quads = format!("/v1/meshes/{}/quads", text(&mesh["id"]));
    let [given, named] = [json!({"table": {"columns": 3, "values": vectors(faces)}}), json!({"stored": field["id"]})]
        .map(|source| json!({"field": source, "spacing": 0.3, "creases": null}));
    let [given, named] = [posted(&app, &quads, &given).await, posted(&app, &quads, &named).await];
    assert_near(&numbers(&named["directions"]["values"]), &numbers(&given["directions"]["values"]), "crosses");
    let hatching = text(&basis["links"]["hatching"]);
    let lines = posted(&app, &hatching, &json!({"field": {"stored": field["id"]}, "spacing": 0.2})).await;
    assert!(!lines["lines"].as_array().unwrap().is_empty());

    for (body, status, kind, words) in [
        (request(json!({"stored": single["id"]}), Value::Null), 422, "invalid-design/alignment", "1 columns"),
        (request(json!("curvature"), json!({"stored": field["id"]})), 422, "invalid-design/alignment", "even n"),
        (
            request(json!({"stored": field["id"]}), json!({"stored": field["id"]})),
            422,
            "invalid-design/stored",
            "weights have one",
        ),
        (request(json!({"stored": "0".repeat(32)}), Value::Null), 404, "unknown-field", "not known"),
        (request(json!({"stored": "../x"}), Value::Null), 404, "unknown-field", "No field has the id"),
        (request(json!({"stored": field["id"], "values": [1]}), Value::Null), 422, "invalid-request", "not by both"),
        (request(json!({}), Value::Null), 422, "invalid-request", "\"stored\""),
    ] {
        let detail = refused(&app, &design, &body, status, kind).await;
        assert!(detail.contains(words), "{detail}");
    }
    let other = shape(&app, Shape::Sphere, 162).await;
    let elsewhere = format!("/v1/meshes/{}/quads", text(&other["id"]));
    let body = json!({"field": {"stored": field["id"]}});
    let detail = refused(&app, &elsewhere, &body, 422, "invalid-design/stored").await;
    assert!(detail.contains("not on this one"), "{detail}");
    for (table, words) in [
        (json!({"columns": 4, "values": vec![1.0; 4 * faces]}), "columns: must be from 1 to 3"),
        (json!({"columns": 3, "values": vec![1.0; faces]}), "rows of 3 are needed"),
        (json!({"columns": 1, "values": vec![1e39; faces]}), "of face 0 is out of range for f32"),
    ] {
        let detail = refused(&app, &fields, &table, 422, "invalid-design/stored").await;
        assert!(detail.contains(words), "{detail}");
    }
    problem(
        app.post(&format!("{fields}?columns=3"))
            .header("content-type", "application/octet-stream")
            .body(vec![0u8; 7])
            .send()
            .await
            .unwrap(),
        422,
        "invalid-design/stored",
    )
    .await;
    let form = app.get(&format!("{}?form=world", text(&field["links"]["content"]))).send().await.unwrap();
    problem(form, 400, "invalid-query").await;
}

#[tokio::test]
async fn a_design_is_saved_named_listed_fetched_and_deleted() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 300).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let basis = made(&app, &mesh, json!({"field": "n_vector", "n": 2, "dimension": 60})).await;
    let designs = text(&basis["links"]["designs"]);
    assert_eq!(designs, format!("{}/designs", text(&basis["links"]["self"])));
    let wanted = json!({"strokes": [{"face": 10, "frame_direction": [1.0, 0.5], "strength": 2.0}], "weights": {"harmonic": 1.0, "biharmonic": 0.1}});
    let saved = app.post(&designs).json(&json!({"name": "two ways", "design": wanted})).send().await.unwrap();
    assert_eq!(saved.status(), 201);
    let address = saved.headers()["location"].to_str().unwrap().to_owned();
    let saved: Value = saved.json().await.unwrap();
    assert_eq!(address, text(&saved["links"]["self"]));
    assert_eq!((&saved["basis"], &saved["mesh"], &saved["columns"]), (&basis["id"], &mesh["id"], &json!(2)));
    assert_eq!(
        (&saved["field"], &saved["links"]["basis"]),
        (&json!({"kind": "n_vector", "n": 2}), &basis["links"]["self"])
    );
    // The request can be sent again as it is, and gives the field that is kept.
    let shown = got(&app, &address).await;
    assert_eq!((&shown["design"]["numbering"], &shown["design"]["field"]), (&json!("file"), &saved["field"]));
    for form in ["world", "frames", "roots", "axes"] {
        let again =
            posted(&app, &format!("{}?form={form}", text(&basis["links"]["design"])), &shown["design"]["request"])
                .await;
        let kept = floats(&app, &format!("{address}/content?form={form}")).await;
        let kept: Vec<f64> = kept.into_iter().map(f64::from).collect();
        assert_near(&kept, &numbers(&again["field"]["values"]), form);
    }
    // It names fields of more directions, and lines.
    let cross = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 60})).await;
    let along = json!({"alignment": {"to": {"stored": saved["id"]}, "weight": 1e4}, "weights": {"harmonic": 1e-3}});
    let crossed = posted(&app, &format!("{}?form=frames", text(&cross["links"]["design"])), &along).await;
    let (lines, crosses) =
        (floats(&app, &format!("{address}/content?form=frames")).await, numbers(&crossed["field"]["values"]));
    // Twice the angle of lines is that of crosses: most faces agree.
    let agree = (0..faces).filter(|&f| {
        let [x, y] = [lines[2 * f], lines[2 * f + 1]].map(f64::from);
        let angle = 2.0 * y.atan2(x) - crosses[2 * f + 1].atan2(crosses[2 * f]);
        angle.cos() > 0.8
    });
    assert!(agree.count() > 3 * faces / 4);
    let three = made(&app, &mesh, json!({"field": "n_vector", "n": 3, "dimension": 60})).await;
    let detail = refused(&app, &text(&three["links"]["design"]), &along, 422, "invalid-design/stored").await;
    assert!(detail.contains("2-vectors cannot be used as one of 3-vectors"), "{detail}");
    posted(&app, &text(&basis["links"]["hatching"]), &json!({"field": {"stored": saved["id"]}, "spacing": 0.2})).await;
    let quads = format!("/v1/meshes/{}/quads", text(&mesh["id"]));
    posted(&app, &quads, &json!({"field": {"stored": saved["id"]}, "spacing": 0.3, "creases": null})).await;

    let renamed = app.client.patch(app.url(&address)).json(&json!({"name": "lines"})).send().await.unwrap();
    assert_eq!(renamed.json::<Value>().await.unwrap()["name"], "lines");
    let ids = async |query: &str| -> Vec<String> {
        let page = got(&app, &format!("/v1/fields?{query}")).await;
        page["items"].as_array().unwrap().iter().map(|item| text(&item["id"])).collect()
    };
    let upload =
        posted(&app, &format!("/v1/meshes/{}/fields", text(&mesh["id"])), &json!({"values": vec![1.0; faces]})).await;
    let (own, other) = (text(&saved["id"]), text(&upload["id"]));
    assert_eq!(ids("").await, [other.clone(), own.clone()], "newest first");
    assert_eq!(ids("name=LINE").await, std::slice::from_ref(&own));
    assert_eq!(ids(&format!("basis={}", text(&basis["id"]))).await, std::slice::from_ref(&own));
    assert_eq!(got(&app, text(&mesh["links"]["fields"]).as_str()).await["items"].as_array().unwrap().len(), 2);
    let first = got(&app, "/v1/fields?limit=1").await;
    assert_eq!(ids(&format!("limit=1&from={}", text(&first["next"]))).await, std::slice::from_ref(&own));

    for (body, kind, words) in [
        (
            json!({"design": {"strokes": [{"face": 1, "frame_direction": [1, 0]}], "faces": {"sample": 3}}}),
            "invalid-design/faces",
            "design.faces",
        ),
        (json!({"design": {}}), "invalid-design/no-data", ""),
        (json!({"name": "x"}), "invalid-request", "design is missing"),
        (json!({"name": "n".repeat(201), "design": wanted}), "invalid-request", "name"),
        (
            json!({"design": {"alignment": {"weight": 1, "to": {"columns": 3, "values": vec![0.123456; 100_000]}}}}),
            "invalid-design/request",
            "upload its tables",
        ),
    ] {
        let detail = refused(&app, &designs, &body, 422, kind).await;
        assert!(detail.contains(words), "{detail}");
    }

    // They outlive the server, keep their mesh, and go with their basis.
    let app = builder().start_in(app.stop());
    let listed = got(&app, &format!("/v1/fields/{own}")).await;
    assert_eq!(listed["name"], "lines");
    let kept = app.delete(&text(&mesh["links"]["self"])).send().await.unwrap();
    assert_eq!(problem(kept, 409, "mesh-in-use").await["fields"], 2);
    assert_eq!(app.delete(&text(&basis["links"]["self"])).send().await.unwrap().status(), 204);
    problem(app.get(&format!("/v1/fields/{own}")).send().await.unwrap(), 404, "unknown-field").await;
    problem(app.get(&format!("/v1/fields/{own}/content")).send().await.unwrap(), 404, "unknown-field").await;
    assert_eq!(app.delete(&format!("/v1/fields/{other}")).send().await.unwrap().status(), 204);
    problem(app.delete(&format!("/v1/fields/{other}")).send().await.unwrap(), 404, "unknown-field").await;
    assert!(got(&app, "/v1/fields").await["items"].as_array().unwrap().is_empty());
    let upload =
        posted(&app, &format!("/v1/meshes/{}/fields", text(&mesh["id"])), &json!({"values": vec![2.0; faces]})).await;
    assert_eq!(
        app.delete(&format!("{}?cascade=true", text(&mesh["links"]["self"]))).send().await.unwrap().status(),
        204
    );
    problem(app.get(&text(&upload["links"]["self"])).send().await.unwrap(), 404, "unknown-field").await;
}
