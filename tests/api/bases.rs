use serde_json::Value;

use crate::common::{TestApp, problem, text};

#[tokio::test]
async fn a_basis_is_listed_shown_and_deleted() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let page: Value = app.get("/v1/bases?kind=eigenbasis").send().await.unwrap().json().await.unwrap();
    assert_eq!(page["items"][0]["id"], *basis);
    assert!(page["items"][0].get("eigenvalues").is_none());
    let shown = app.get(&format!("/v1/bases/{basis}")).send().await.unwrap();
    let tag = shown.headers()["etag"].clone();
    let shown: Value = shown.json().await.unwrap();
    assert_eq!(shown["eigenvalues"], serde_json::json!([0.0, 1.0, 2.0]));
    assert_eq!((&shown["vertices"], &shown["dimension"], &shown["count"]), (&6.into(), &3.into(), &3.into()));
    assert_eq!(shown["certificate"]["bounds"][1], 0.01);
    let known = app.get(&format!("/v1/bases/{basis}")).header("if-none-match", tag).send().await.unwrap();
    assert_eq!(known.status(), 304);
    assert_eq!(app.delete(&format!("/v1/bases/{basis}")).send().await.unwrap().status(), 204);
    problem(app.get(&format!("/v1/bases/{basis}")).send().await.unwrap(), 404, "unknown-basis").await;
    problem(app.get(&format!("/v1/bases/{basis}/content")).send().await.unwrap(), 404, "unknown-basis").await;
    problem(app.get("/v1/bases/none").send().await.unwrap(), 404, "unknown-basis").await;
    // The work is not "done already" any more.
    let mesh = text(&shown["mesh"]);
    let job = app.submit(&mesh, serde_json::json!({"count": 3})).await;
    assert_eq!(app.finished(&text(&job["id"])).await["status"], "succeeded");
}

#[tokio::test]
async fn content_is_immutable_and_comes_in_three_formats_and_in_ranges() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let url = format!("/v1/bases/{basis}/content");
    for (format, media_type, magic) in [
        ("npz", "application/x-npz", &b"PK\x03\x04"[..]),
        ("safetensors", "application/x-safetensors", &b""[..]),
        ("matrix_market", "application/x-matrix-market+zip", &b"PK\x03\x04"[..]),
    ] {
        let response = app.get(&format!("{url}?format={format}")).send().await.unwrap();
        assert_eq!(response.status(), 200, "{format}");
        let head = response.headers().clone();
        assert_eq!(head["content-type"], media_type);
        assert_eq!(head["accept-ranges"], "bytes");
        assert!(head["cache-control"].to_str().unwrap().contains("immutable"));
        assert!(!head.contains_key("content-encoding"));
        let whole = response.bytes().await.unwrap();
        assert_eq!(head["content-length"].to_str().unwrap(), whole.len().to_string());
        assert!(whole.starts_with(magic), "{format}");
        let get = || app.get(&url).header("accept", media_type);
        assert_eq!(get().send().await.unwrap().bytes().await.unwrap(), whole);
        let part = get().header("range", "bytes=-100").header("if-range", &head["etag"]).send().await.unwrap();
        assert_eq!(part.status(), 206);
        assert_eq!(part.bytes().await.unwrap(), whole.slice(whole.len() - 100..));
        let changed = get().header("range", "bytes=0-9").header("if-range", "\"other\"").send().await.unwrap();
        assert_eq!(changed.status(), 200);
        assert_eq!(get().header("if-none-match", &head["etag"]).send().await.unwrap().status(), 304);
        problem(get().header("range", "bytes=99999999-").send().await.unwrap(), 416, "range-not-satisfiable").await;
        let head_only = app.client.head(app.url(&format!("{url}?format={format}"))).send().await.unwrap();
        assert_eq!(head_only.headers()["etag"], head["etag"]);
    }
    problem(app.get(&url).header("accept", "image/png").send().await.unwrap(), 406, "not-acceptable").await;
    let npz = app.get(&url).send().await.unwrap().bytes().await.unwrap();
    let read = chladni::basis::npz::read(&npz).unwrap();
    assert_eq!(read.eigenvalues, [0.0, 1.0, 2.0]);
}
