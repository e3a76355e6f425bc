//! What cannot be computed is named.

use super::*;

#[tokio::test]
async fn distances_that_cannot_be_are_named() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let url = format!("/v1/bases/{basis}/distances");
    let diffusion = |t: f64| json!({"kind": "diffusion", "times": [t]});
    refused(
        &app,
        &url,
        &[
            (
                json!({"distance": diffusion(1.0), "sources": [0, 6]}),
                422,
                "invalid-vertex",
                "Source 1 is vertex 6 of 6",
            ),
            (
                json!({"distance": {"kind": "geodesic"}, "sources": [9]}),
                422,
                "invalid-vertex",
                "Source 0 is vertex 9 of 6",
            ),
            (json!({"distance": {"kind": "geodesic"}, "pairs": [[0, 1], [0, 9]]}), 422, "invalid-vertex", "Pair 1"),
            (
                json!({"distance": {"kind": "geodesic", "time": 0.0}, "sources": [0]}),
                422,
                "invalid-analysis",
                "time: must be a finite positive number, not 0",
            ),
            (
                json!({"distance": diffusion(0.0), "sources": [0]}),
                422,
                "invalid-analysis",
                "time: must be a finite positive number, not 0",
            ),
            (
                json!({"distance": diffusion(-1.0), "pairs": [[0, 1]]}),
                422,
                "invalid-analysis",
                "time: must be a finite positive number, not -1",
            ),
            (json!({"distance": diffusion(1.0), "sources": vec![0; 257]}), 422, "invalid-analysis", "257"),
            (json!({"distance": diffusion(1.0)}), 422, "invalid-request", "neither was given"),
            (json!({"distance": diffusion(1.0), "sources": [-1]}), 422, "invalid-request", "sources"),
            (json!({"distance": {"kind": "magic"}, "sources": [0]}), 422, "invalid-request", "magic"),
            (json!({"sources": [0]}), 422, "invalid-request", "distance"),
        ],
    )
    .await;
    let rest = json!({"distance": {"kind": "biharmonic"}});
    problem(raw(&app, &url, &rest, vec![0; 7]).await, 422, "invalid-vertex").await;
    problem(raw(&app, &url, &rest, words(&[6])).await, 422, "invalid-vertex").await;
    let bare = app.post(&url).header("content-type", OCTETS).body(words(&[0])).send().await.unwrap();
    problem(bare, 400, "invalid-query").await;
    let odd = app.post(&url).query(&[("request", "{")]).header("content-type", OCTETS).body(words(&[0]));
    problem(odd.send().await.unwrap(), 400, "invalid-query").await;
    problem(
        app.post(&url).header("content-type", "text/csv").body("1").send().await.unwrap(),
        415,
        "unsupported-media-type",
    )
    .await;
    let nowhere = format!("/v1/bases/{}/distances", uuid::Uuid::nil());
    problem(app.post(&nowhere).json(&rest).send().await.unwrap(), 404, "unknown-basis").await;
}

/// `tests/api/numbering.rs` has maps of collections that are made.
#[tokio::test]
async fn collections_that_cannot_be_mapped_are_refused() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let with = |bases: Value, name: &str, value: Value| {
        let mut body = json!({"bases": bases});
        body[name] = value;
        body
    };
    let (sphere, _) = app.sphere().await;
    let job = app.submit(&sphere, json!({"count": 3})).await;
    let other = text(&app.finished(&text(&job["id"])).await["basis"]);
    let two = json!([basis, other]);
    refused(
        &app,
        "/v1/map-collections",
        &[
            (json!({"bases": [basis]}), 422, "invalid-analysis", "shapes: must be between 2 and 32, not 1"),
            (json!({"bases": vec![basis.clone(); 33]}), 422, "invalid-analysis", "at most 32"),
            (json!({"bases": [basis, "x"]}), 404, "unknown-basis", "x"),
            (json!({"bases": [basis, basis]}), 422, "invalid-parameter/bases", "bases[1] duplicates bases[0]"),
            (json!({"bases": two}), 422, "invalid-analysis", "pairs: must be"),
            (with(two.clone(), "step", json!(0)), 422, "invalid-analysis", "must be"),
            (with(two.clone(), "magic", json!(1)), 422, "invalid-request", "magic"),
        ],
    )
    .await;
    let response = app.post("/v1/map-collections").body("x").send().await.unwrap();
    assert!(response.status().is_client_error());
}
