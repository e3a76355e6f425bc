//! Fields on surfaces with one side: what is made of them, and what is refused in words.

use chladni_mesh::fixtures::moebius;

use super::*;

#[tokio::test]
async fn lines_live_on_a_moebius_strip_and_what_takes_two_sides_is_refused() {
    let app = builder().start();
    let mut bytes = Vec::new();
    write_ply(&moebius(60, 6), None, &mut bytes).unwrap();
    let mesh = app.upload("ply", bytes).await;
    assert_eq!(mesh["report"]["orientable"], false);
    let basis = made(&app, &mesh, json!({"field": "n_vector", "n": 2, "dimension": 150})).await;
    let pin = |face: u32| json!({"face": face, "frame_direction": [1.0, 0.5]});
    let designed =
        designed(&app, &basis, "form=frames&singularities=true", json!({"constraints": [pin(30), pin(500)]})).await;
    assert!(numbers(&designed["residuals"]).iter().all(|missed| *missed < 1e-4), "{designed}");
    assert_eq!((&designed["space"], &designed["euler_characteristic"]), (&json!("surface"), &json!(0)));
    let field = json!({"coefficients": designed["coefficients"]});
    let (status, lines) = post(&app, &basis, "hatching", &json!({"field": field, "spacing": 0.1})).await;
    assert!(status == 200 && !lines["lines"].as_array().unwrap().is_empty(), "{lines}");
    let curvature = json!({"alignment": {"to": "curvature", "weight": 1.0}});
    let drawing = json!({"field": field, "camera": {"from": [0, 0, 1]}});
    let vectors = made(&app, &mesh, json!({"field": "n_vector", "n": 1, "dimension": 100})).await;
    for strands in [Value::Null, json!(100)] {
        let (status, refused) =
            post(&app, &vectors, "fur", &json!({"field": {"eigenfield": 0}, "length": 0.1, "strands": strands})).await;
        assert_eq!((status.as_u16(), &refused["type"]), (422, &json!("/problems/no-field-surface")), "{refused}");
    }
    for (route, accept, body) in [
        ("hatching", "image/svg+xml", drawing),
        ("design", "application/json", curvature),
        ("design", "application/json", json!({"strokes": [pin(3)], "singularities": {"at": [], "exact": true}})),
    ] {
        let url = format!("{}/{route}", text(&basis["links"]["self"]));
        let refused = app.post(&url).header("accept", accept).json(&body).send().await.unwrap();
        let refused = problem(refused, 422, "no-field-surface").await;
        assert!(text(&refused["detail"]).contains("in the same direction"), "{route}: {refused}");
    }
    let id = text(&mesh["id"]);
    let table = json!({"field": {"columns": 2, "values": vec![0.5; 2 * 720]}});
    for (route, body) in [("quads", json!({})), ("hodge-decomposition", table)] {
        let refused = app.post(&format!("/v1/meshes/{id}/{route}")).json(&body).send().await.unwrap();
        let refused = problem(refused, 422, "no-field-surface").await;
        assert!(text(&refused["detail"]).contains("in the same direction"), "{route}: {refused}");
    }
    // Vectors are carried along all the same.
    let carried = app
        .post(&format!("/v1/meshes/{id}/vector-transport"))
        .json(&json!({"sources": [{"face": 3, "direction": [0, 0, 1]}]}));
    assert_eq!(carried.send().await.unwrap().status(), 200);
    let job = submitted(&app, &mesh, json!({"field": "vector", "dimension": 50})).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["problem"]["type"], "/problems/job/no-field-surface", "{job}");
    assert!(text(&job["problem"]["detail"]).contains("n_vector"), "{job}");
}
