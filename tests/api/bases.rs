use serde_json::{Value, json};

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
    // An NPZ is a ZIP archive and octets as well, and comes under the name that it was asked for by.
    for media_type in ["application/zip", "application/octet-stream"] {
        let response = app.get(&url).header("accept", media_type).send().await.unwrap();
        assert_eq!(response.headers()["content-type"], media_type);
    }
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
    let read = chladni_spectral::formats::npz::read(&npz).unwrap();
    assert_eq!(read.eigenvalues, [0.0, 1.0, 2.0]);
}

/// On the octahedron, the scripted basis holds functions that are equal on vertices 0 and 3, 1 and 4, 2 and 5.
const X: [f64; 6] = [1.0, 2.0, 3.0, 3.0, 2.0, 1.0];
const MEANS: [f64; 6] = [2.0, 2.0, 2.0, 2.0, 2.0, 2.0];

fn close(found: &[f64], expected: &[f64]) -> bool {
    found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f64> {
    bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect()
}

#[tokio::test]
async fn functions_are_filtered_as_json_and_as_raw_numbers() {
    let app = TestApp::start();
    let url = format!("/v1/bases/{}/filter", app.basis().await);
    let all = json!({"kind": "low_pass", "cutoff": 10.0});
    let body = json!({"functions": {"values": X}, "transfer": all});
    let answer: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
    assert!(close(&numbers(&answer["values"]), &MEANS), "{answer}");
    assert_eq!(answer["columns"], 1);
    // Keeping all there is, and all beyond, changes nothing.
    let body = json!({"functions": "coordinates", "transfer": {"kind": "heat", "time": 0.0}});
    let answer: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
    assert_eq!(answer["columns"], 3);
    assert!(close(&numbers(&answer["values"])[..6], &[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]), "{answer}");
    for (dtype, raw) in [
        ("f32", X.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect::<Vec<u8>>()),
        ("f64", X.iter().flat_map(|x| x.to_le_bytes()).collect()),
    ] {
        let request = app
            .post(&url)
            .query(&[("dtype", dtype), ("transfer", &all.to_string())])
            .header("content-type", "application/octet-stream");
        let response = request.body(raw.clone()).send().await.unwrap();
        let head = response.headers().clone();
        let bytes = response.bytes().await.unwrap();
        assert_eq!(head["content-type"], "application/octet-stream", "{bytes:?}");
        assert_eq!(
            (&head["chladni-rows"], &head["chladni-columns"], &head["chladni-dtype"]),
            (&6.into(), &1.into(), &dtype.parse().unwrap())
        );
        assert!(head["server-timing"].to_str().unwrap().starts_with("solve;dur="));
        assert_eq!(bytes.len(), raw.len());
        if dtype == "f32" {
            assert!(close(&floats(&bytes), &MEANS));
        }
    }
    // Raw in, JSON out; no body, but the coordinates.
    let request = app
        .post(&url)
        .query(&[("function", "coordinates"), ("transfer", &all.to_string())])
        .header("content-type", "application/octet-stream")
        .header("accept", "application/json");
    let answer: Value = request.send().await.unwrap().json().await.unwrap();
    assert_eq!(answer["columns"], 3, "{answer}");
}

#[tokio::test]
async fn functions_are_projected_and_put_together_again() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let project = format!("/v1/bases/{basis}/project");
    let body = json!({"functions": {"values": X}, "reconstruct": true});
    let answer: Value = app.post(&project).json(&body).send().await.unwrap().json().await.unwrap();
    assert!(close(&numbers(&answer["coefficients"]["values"]), &[8f64.sqrt(); 3]), "{answer}");
    assert!(close(&numbers(&answer["reconstruction"]["values"]), &MEANS));
    assert!(close(&numbers(&answer["relative_errors"]), &[(4.0f64 / 28.0).sqrt()]));
    let raw: Vec<u8> = X.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    let response =
        app.post(&project).header("content-type", "application/octet-stream").body(raw).send().await.unwrap();
    let error: f64 = response.headers()["chladni-relative-error"].to_str().unwrap().parse().unwrap();
    assert!((error - (4.0f64 / 28.0).sqrt()).abs() < 1e-6);
    let coefficients = response.bytes().await.unwrap();
    assert!(close(&floats(&coefficients), &[8f64.sqrt(); 3]));
    let response = app
        .post(&format!("/v1/bases/{basis}/reconstruct"))
        .header("content-type", "application/octet-stream")
        .body(coefficients);
    assert!(close(&floats(&response.send().await.unwrap().bytes().await.unwrap()), &MEANS));
}

#[tokio::test]
async fn functions_and_transfers_that_do_not_fit_are_named() {
    let app = TestApp::start();
    let url = format!("/v1/bases/{}/filter", app.basis().await);
    let send = |body: Value| app.post(&url).json(&body).send();
    let pass = json!({"kind": "low_pass", "cutoff": 1.0});
    for (body, kind, word) in [
        (json!({"functions": {"values": [1.0, 2.0]}, "transfer": pass}), "invalid-function", "2 values"),
        (json!({"functions": "colours", "transfer": pass}), "invalid-request", "functions"),
        (json!({"functions": "coordinates"}), "invalid-request", "transfer"),
        (json!({"functions": "coordinates", "transfer": {"kind": "magic"}}), "invalid-request", "magic"),
        (
            json!({"functions": "coordinates", "transfer": {"kind": "low_pass", "cutoff": -1.0}}),
            "invalid-transfer-function",
            "-1",
        ),
        (
            json!({"functions": "coordinates", "transfer": {"kind": "samples", "values": [1.0], "beyond": 0.0}}),
            "invalid-transfer-function",
            "3 samples, one for each eigenvalue, got 1",
        ),
    ] {
        let refused = problem(send(body.clone()).await.unwrap(), 422, kind).await;
        assert!(refused["detail"].as_str().unwrap().contains(word), "{body}: {refused}");
    }
    let raw = |query: &'static str, body: Vec<u8>| {
        app.post(&format!("{url}?{query}")).header("content-type", "application/octet-stream").body(body).send()
    };
    const PASS: &str = "transfer=%7B%22kind%22%3A%22low_pass%22%2C%22cutoff%22%3A1.0%7D";
    problem(raw(PASS, vec![0; 23]).await.unwrap(), 422, "invalid-function").await;
    problem(raw(PASS, vec![]).await.unwrap(), 422, "invalid-function").await;
    problem(raw(PASS, [0xff; 24].to_vec()).await.unwrap(), 422, "invalid-function").await;
    problem(raw("", vec![0; 24]).await.unwrap(), 400, "invalid-query").await;
    problem(raw("transfer=x", vec![0; 24]).await.unwrap(), 422, "invalid-transfer-function").await;
    problem(raw("dtype=f16", vec![0; 24]).await.unwrap(), 400, "invalid-query").await;
    let text = app.post(&url).header("content-type", "text/csv").body("1,2,3").send().await.unwrap();
    problem(text, 415, "unsupported-media-type").await;
}

#[tokio::test]
async fn modes_come_as_npy_as_numbers_and_as_colours() {
    let app = TestApp::start();
    let url = format!("/v1/bases/{}/modes", app.basis().await);
    let h = 0.5f64.sqrt();
    let npy = app.get(&format!("{url}?from=1&to=3")).send().await.unwrap();
    assert_eq!(npy.headers()["content-type"], "application/x-npy");
    let tag = npy.headers()["etag"].clone();
    let npy = npy.bytes().await.unwrap();
    assert!(npy.starts_with(b"\x93NUMPY\x01\x00"));
    assert_eq!(npy.len() % 64, 48);
    let raw = app.get(&format!("{url}?from=1&to=3")).header("accept", "application/octet-stream").send().await.unwrap();
    assert_eq!(raw.headers()["content-length"], "48");
    let raw = raw.bytes().await.unwrap();
    assert!(npy.ends_with(&raw));
    assert!(close(&floats(&raw), &[0.0, h, 0.0, 0.0, h, 0.0, 0.0, 0.0, h, 0.0, 0.0, h]));
    let known = app.get(&format!("{url}?from=1&to=3")).header("if-none-match", tag).send().await.unwrap();
    assert_eq!(known.status(), 304);
    let all = app.get(&format!("{url}?format=f32")).send().await.unwrap();
    assert_eq!(all.headers()["chladni-columns"], "3");
    let ply = app.get(&format!("{url}?from=2&format=ply")).send().await.unwrap();
    assert_eq!(ply.headers()["content-type"], "model/ply");
    assert!(String::from_utf8_lossy(&ply.bytes().await.unwrap()).contains("property uchar red"));
    for (query, kind) in [
        ("from=3", "invalid-mode-range"),
        ("from=2&to=2", "invalid-mode-range"),
        ("to=4", "invalid-mode-range"),
        ("to=2&format=ply", "invalid-mode-range"),
    ] {
        problem(app.get(&format!("{url}?{query}")).send().await.unwrap(), 422, kind).await;
    }
    problem(app.get(&format!("{url}?from=-1")).send().await.unwrap(), 400, "invalid-query").await;
}

#[tokio::test]
async fn kinds_that_do_not_exist_are_refused_in_lists() {
    let app = TestApp::start();
    for list in ["bases", "jobs"] {
        let refused = app.get(&format!("/v1/{list}?kind=foo")).send().await.unwrap();
        let told = problem(refused, 400, "invalid-query").await;
        let detail = text(&told["detail"]);
        assert!(detail.contains("\"foo\"") && detail.contains("field_basis"), "{detail}");
        let known = app.get(&format!("/v1/{list}?kind=field_basis")).send().await.unwrap();
        assert_eq!(known.status(), 200);
    }
}

#[tokio::test]
async fn queries_are_refused_in_words() {
    let app = TestApp::start();
    let basis = app.basis().await;
    for (query, words) in [
        ("from=-1", r#"The query is invalid: from must be a whole number of at least 0, not "-1"."#),
        (
            "from=99999999999999999999999",
            r#"The query is invalid: from must be a smaller whole number, not "99999999999999999999999"."#,
        ),
        ("dtype=f16", r#"The query is invalid: dtype must be "f32" or "f64", got "f16"."#),
        ("numbering=mine", r#"The query is invalid: numbering must be "file" or "kept", got "mine"."#),
        (
            "foo=1",
            r#"Unknown query parameter "foo"; expected one of "numbering", "extend", "from", "to", "format", "dtype"."#,
        ),
    ] {
        let refused = app.get(&format!("/v1/bases/{basis}/modes?{query}")).send().await.unwrap();
        let told = problem(refused, 400, "invalid-query").await;
        assert_eq!(text(&told["detail"]), words);
    }
}
