//! Distances, signatures, comparisons, compression, maps: each as JSON, as raw numbers, and asked wrongly.
//!
//! On the octahedron the scripted basis has the eigenvalues 0, 1 and 2, and function `k` is `√½` at the vertices `k`
//! and `k + 3`, 0 elsewhere.

mod latencies;
mod refusals;

use reqwest::Response;
use serde_json::{Value, json};

use crate::common::{OCTAHEDRON, TestApp, problem, text};

const OCTETS: &str = "application/octet-stream";

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value}")).iter().map(|x| x.as_f64().unwrap()).collect()
}

fn close(found: &[f64], expected: &[f64]) -> bool {
    found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect()
}

fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A JSON request, a JSON answer.
async fn ask(app: &TestApp, url: &str, body: &Value) -> Value {
    let response = app.post(url).json(body).send().await.unwrap();
    let status = response.status();
    let value: Value = response.json().await.unwrap();
    assert_eq!(status, 200, "{url} {body}: {value}");
    value
}

/// A raw request with the rest in the query, an answer in f64.
async fn raw(app: &TestApp, url: &str, rest: &Value, body: Vec<u8>) -> Response {
    let query = [("dtype", "f64"), ("request", &rest.to_string())];
    app.post(url).query(&query).header("content-type", OCTETS).body(body).send().await.unwrap()
}

/// Requests that are refused with a status, a kind of problem, and a word of its sentence.
async fn refused(app: &TestApp, url: &str, cases: &[(Value, u16, &str, &str)]) {
    for (body, status, kind, word) in cases {
        let answer = problem(app.post(url).json(body).send().await.unwrap(), *status, kind).await;
        assert!(answer["detail"].as_str().unwrap().contains(word), "{body}: {answer}");
    }
}

#[tokio::test]
async fn distances_come_from_sources_and_between_pairs() {
    let app = TestApp::start();
    let url = format!("/v1/bases/{}/distances", app.basis().await);
    let diffusion = json!({"kind": "diffusion", "times": [0.25, 1.0]});
    let body = json!({"distance": diffusion, "sources": [0, 4]});
    let answer = ask(&app, &url, &body).await;
    assert_eq!(answer["columns"], 4);
    // From vertex 0 to vertex 1: half of e^0 + e^{−2t}, whatever lies at the source of the other.
    let d = |t: f64, a: usize, b: usize| {
        let weight = |v: usize| 0.5 * (-2.0 * t * (v % 3) as f64).exp();
        if a % 3 == b % 3 { 0.0 } else { (weight(a) + weight(b)).sqrt() }
    };
    let row = |v: usize| [d(0.25, 0, v), d(1.0, 0, v), d(0.25, 4, v), d(1.0, 4, v)];
    let expected: Vec<f64> = (0..6).flat_map(row).collect();
    assert!(close(&numbers(&answer["values"]), &expected), "{answer}");
    let response = raw(&app, &url, &json!({"distance": diffusion}), words(&[0, 4])).await;
    let head = response.headers().clone();
    assert_eq!(
        (&head["chladni-rows"], &head["chladni-columns"], &head["content-type"]),
        (&6.into(), &4.into(), &OCTETS.parse().unwrap())
    );
    assert!(head["server-timing"].to_str().unwrap().starts_with("solve;dur="));
    assert!(close(&doubles(&response.bytes().await.unwrap()), &expected));
    // The nearest of the sources; pairs; the other kinds.
    let nearest = ask(&app, &url, &json!({"distance": diffusion, "sources": [0, 4], "nearest": true})).await;
    assert_eq!((&nearest["columns"], nearest["values"].as_array().unwrap().len()), (&json!(2), 12));
    let pairs = ask(&app, &url, &json!({"distance": {"kind": "biharmonic"}, "pairs": [[0, 1], [1, 2], [2, 5]]})).await;
    assert!(close(&numbers(&pairs["values"]), &[0.5f64.sqrt(), 0.625f64.sqrt(), 0.0]), "{pairs}");
    let query = [("pairs", "true"), ("dtype", "f64"), ("request", r#"{"distance": {"kind": "commute_time"}}"#)];
    let request = app.post(&url).query(&query).header("content-type", OCTETS).header("accept", "application/json");
    let pairs: Value = request.body(words(&[0, 1, 1, 2])).send().await.unwrap().json().await.unwrap();
    assert!(close(&numbers(&pairs["values"]), &[0.5f64.sqrt(), 0.75f64.sqrt()]), "{pairs}");
    let default = ask(&app, &url, &json!({"distance": {"kind": "diffusion"}, "sources": [0]})).await;
    assert_eq!(default["columns"], 1);
    for sources in [json!({"sources": [0, 1]}), json!({"pairs": [[0, 1], [0, 2]]})] {
        let mut body = sources;
        body["distance"] = json!({"kind": "geodesic", "method": "spectral"});
        let found = numbers(&ask(&app, &url, &body).await["values"]);
        assert!(found.iter().all(|d| d.is_finite() && *d >= 0.0));
    }
}

/// Over the faces of the octahedron from a vertex to the opposite one: twice the height of a face.
#[tokio::test]
async fn geodesic_distances_need_no_basis_and_reach_what_a_path_leads_to() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let mesh = text(&app.upload("off", OCTAHEDRON).await["id"]);
    let (edge, across) = (2f64.sqrt(), 6f64.sqrt());
    let expected = [0.0, across, edge, edge, edge, edge];
    for url in [format!("/v1/meshes/{mesh}/distances"), format!("/v1/bases/{basis}/distances")] {
        let exact = json!({"kind": "geodesic", "method": "exact"});
        let all = ask(&app, &url, &json!({"distance": exact, "sources": [0]})).await;
        assert!(close(&numbers(&all["values"]), &expected), "{url} {all}");
        let pairs = ask(&app, &url, &json!({"distance": exact, "pairs": [[2, 3], [1, 2], [4, 4], [3, 1]]})).await;
        assert!(close(&numbers(&pairs["values"]), &[across, edge, 0.0, edge]), "{pairs}");
        let both = json!({"distance": exact, "sources": [0, 3], "nearest": true});
        let both = ask(&app, &url, &both).await;
        assert!(close(&numbers(&both["values"]), &[0.0, edge, edge, 0.0, edge, edge]), "{both}");
        let heat = ask(&app, &url, &json!({"distance": {"kind": "geodesic"}, "sources": [0]})).await;
        let heat = numbers(&heat["values"]);
        assert!(heat[0] == 0.0 && heat.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.4), "{heat:?}");
        let timed = json!({"kind": "geodesic", "method": "exact", "time": 0.1});
        let cases = [
            (json!({"distance": timed, "sources": [0]}), 422, "invalid-request", "take no time step"),
            (json!({"distance": exact, "sources": [1, 6]}), 422, "invalid-vertex", "Source 1 is vertex 6 of 6"),
            (json!({"distance": exact, "pairs": [[1, 6]]}), 422, "invalid-vertex", "Pair 0 is vertex 6 of 6"),
            (json!({"distance": exact, "sources": vec![0; 257]}), 422, "invalid-analysis", "257"),
            (
                json!({"distance": {"kind": "geodesic", "method": "guess"}, "sources": [0]}),
                422,
                "invalid-request",
                "guess",
            ),
        ];
        refused(&app, &url, &cases).await;
    }
    let url = format!("/v1/meshes/{mesh}/distances");
    let needs = json!({"distance": {"kind": "biharmonic"}, "sources": [0]});
    let spectral = json!({"distance": {"kind": "geodesic", "method": "spectral"}, "sources": [0]});
    for body in [needs, spectral] {
        refused(&app, &url, &[(body, 422, "invalid-request", "without a basis")]).await;
    }
    // Two triangles apart from each other: no path leads over.
    let apart = "OFF\n6 2 0\n0 0 0\n1 0 0\n0 1 0\n5 0 0\n6 0 0\n5 1 0\n3 0 1 2\n3 3 4 5\n";
    let url = format!("/v1/meshes/{}/distances", text(&app.upload("off", apart).await["id"]));
    for method in ["heat", "exact"] {
        let body = json!({"distance": {"kind": "geodesic", "method": method}, "sources": [1]});
        let told = ask(&app, &url, &body).await;
        let values = told["values"].as_array().unwrap();
        assert!(values[..3].iter().all(Value::is_number) && values[3..].iter().all(Value::is_null), "{told}");
        let raw = raw(&app, &url, &json!({"distance": {"kind": "geodesic", "method": method}}), words(&[1])).await;
        // By heat it is told how far distances may be off.
        let error =
            raw.headers().get("chladni-slope-error").map(|error| error.to_str().unwrap().parse::<f64>().unwrap());
        assert!(
            if method == "heat" { error.is_some_and(|e| (0.0..1.0).contains(&e)) } else { error.is_none() },
            "{error:?}"
        );
        assert!(doubles(&raw.bytes().await.unwrap())[3..].iter().all(|d| *d == f64::INFINITY));
    }
    let nowhere = app.post("/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3/distances").json(&json!({})).send().await;
    problem(nowhere.unwrap(), 404, "unknown-mesh").await;
}

#[tokio::test]
async fn signatures_come_for_some_vertices_and_for_all() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let url = format!("/v1/bases/{basis}/signatures");
    let heat = json!({"kind": "heat_kernel", "times": [0.5, 1.0]});
    let some = ask(&app, &url, &json!({"signature": heat, "vertices": [1, 5]})).await;
    let value = |t: f64, v: usize| 0.5 * (-t * (v % 3) as f64).exp();
    let row = |v: usize| [value(0.5, v), value(1.0, v)];
    assert!(close(&numbers(&some["values"]), &[row(1), row(5)].concat()), "{some}");
    let all: Vec<f64> = (0..6).flat_map(row).collect();
    assert!(close(&numbers(&ask(&app, &url, &json!({"signature": heat})).await["values"]), &all));
    let response = raw(&app, &url, &json!({"signature": heat}), Vec::new()).await;
    assert!(close(&doubles(&response.bytes().await.unwrap()), &all));
    let response = raw(&app, &url, &json!({"signature": heat}), words(&[1, 5])).await;
    assert!(close(&doubles(&response.bytes().await.unwrap()), &[row(1), row(5)].concat()));
    let trace = |t: f64| 1.0 + (-t).exp() + (-2.0 * t).exp();
    let normalised = json!({"kind": "heat_kernel", "times": [0.5], "normalised": true});
    let normalised = ask(&app, &url, &json!({"signature": normalised, "vertices": [2]})).await;
    assert!(close(&numbers(&normalised["values"]), &[value(0.5, 2) / trace(0.5)]));
    for (kind, columns) in [
        (json!({"kind": "heat_kernel"}), 16),
        (json!({"kind": "wave_kernel"}), 100),
        (json!({"kind": "global_point", "count": 2}), 2),
    ] {
        assert_eq!(ask(&app, &url, &json!({"signature": kind, "vertices": [0]})).await["columns"], columns);
    }
    refused(
        &app,
        &url,
        &[
            (json!({"signature": heat, "vertices": [0, 6]}), 422, "invalid-vertex", "Point 1 is vertex 6 of 6"),
            (
                json!({"signature": {"kind": "heat_kernel", "times": [0.0]}}),
                422,
                "invalid-analysis",
                "time: must be a finite positive number, not 0",
            ),
            (
                json!({"signature": {"kind": "heat_kernel", "count": 0}}),
                422,
                "invalid-analysis",
                "count: must be between 1 and 256, not 0",
            ),
            (
                json!({"signature": {"kind": "wave_kernel", "count": 3}}),
                422,
                "invalid-analysis",
                "count: must be between",
            ),
            (
                json!({"signature": {"kind": "global_point"}}),
                422,
                "invalid-analysis",
                "count: must be between 1 and 2, not 20",
            ),
            (json!({"signature": {"kind": "magic"}}), 422, "invalid-request", "magic"),
        ],
    )
    .await;
    problem(raw(&app, &url, &json!({"signature": heat}), vec![0; 3]).await, 422, "invalid-vertex").await;
}

#[tokio::test]
async fn similar_points_are_found() {
    let app = TestApp::start();
    let url = format!("/v1/bases/{}/similar-points", app.basis().await);
    let heat = json!({"kind": "heat_kernel", "times": [1.0]});
    let answer = ask(&app, &url, &json!({"vertex": 4, "signature": heat, "count": 3})).await;
    let order: Vec<u64> = answer["vertices"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
    assert!(order[..2] == [1, 4] && [2, 5].contains(&order[2]), "{answer}");
    assert!(close(&numbers(&answer["differences"])[..2], &[0.0, 0.0]));
    let response = raw(&app, &url, &json!({"signature": heat}), words(&[4])).await;
    assert_eq!(response.headers()["chladni-rows"], "6");
    let all = doubles(&response.bytes().await.unwrap());
    assert!(all[1] == 0.0 && all[4] == 0.0 && all[0] == all[3] && all[0] > all[2]);
    refused(
        &app,
        &url,
        &[
            (json!({"vertex": 6, "signature": heat}), 422, "invalid-vertex", "vertex 6 of 6"),
            (json!({"vertex": 0, "signature": heat, "count": 0}), 422, "invalid-analysis", "count"),
            (json!({"vertex": 0}), 422, "invalid-request", "signature"),
        ],
    )
    .await;
    problem(raw(&app, &url, &json!({"signature": heat}), words(&[1, 2])).await, 422, "invalid-vertex").await;
}

#[tokio::test]
async fn filters_and_projections_give_meshes() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let filter = format!("/v1/bases/{basis}/filter");
    let keep = json!({"kind": "curve", "points": [[0.0, 1.0]]});
    let body = json!({"functions": "coordinates", "transfer": keep});
    let response = app.post(&filter).json(&body).header("accept", "model/ply").send().await.unwrap();
    assert_eq!(response.headers()["content-type"], "model/ply");
    let ply = response.bytes().await.unwrap();
    let again = app.upload("ply", ply).await;
    assert_eq!((&again["vertices"], &again["faces"]), (&json!(6), &json!(8)));
    // Nothing was changed.
    assert_eq!(again["id"], app.upload("off", OCTAHEDRON).await["id"]);
    let sharpen = json!({"kind": "sharpen", "cutoff": 1.0, "strength": 1.0});
    let body = json!({"functions": {"values": [1.0, 2.0, 3.0, 3.0, 2.0, 1.0]}, "transfer": sharpen});
    let found = numbers(&ask(&app, &filter, &body).await["values"]);
    // Means of 2 by their factors 1, 1.5 and 5/3, deviations from them by 2.
    assert!(close(&found, &[0.0, 3.0, 16.0 / 3.0, 4.0, 3.0, 4.0 / 3.0]), "{found:?}");
    let project = format!("/v1/bases/{basis}/project");
    let body = json!({"functions": {"values": [1.0, 2.0, 3.0, 3.0, 2.0, 1.0]}, "pairs": 1, "reconstruct": true});
    let answer = ask(&app, &project, &body).await;
    assert!(close(&numbers(&answer["coefficients"]["values"]), &[8f64.sqrt()]));
    assert!(close(&numbers(&answer["reconstruction"]["values"]), &[2.0, 0.0, 0.0, 2.0, 0.0, 0.0]));
    assert!(close(&numbers(&answer["relative_errors"]), &[(20.0f64 / 28.0).sqrt()]), "{answer}");
    let body = json!({"functions": "coordinates", "pairs": 2});
    let response = app.post(&project).json(&body).header("accept", "model/ply").send().await.unwrap();
    assert!(response.bytes().await.unwrap().starts_with(b"ply\n"));
    for pairs in [0, 4] {
        let body = json!({"functions": "coordinates", "pairs": pairs});
        problem(app.post(&project).json(&body).send().await.unwrap(), 422, "invalid-mode-range").await;
    }
    let body = json!({"functions": {"values": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}, "transfer": keep});
    let flat = app.post(&filter).json(&body).header("accept", "model/ply").send().await.unwrap();
    problem(flat, 422, "invalid-function").await;
    for (transfer, word) in [
        (json!({"kind": "curve", "points": [[1.0, 1.0], [0.0, 1.0]]}), "points must be"),
        (json!({"kind": "curve", "points": []}), "Points must not be empty"),
        (json!({"kind": "sharpen", "cutoff": 0.0, "strength": 1.0}), "cutoff must be"),
    ] {
        let body = json!({"functions": "coordinates", "transfer": transfer});
        let answer =
            problem(app.post(&filter).json(&body).send().await.unwrap(), 422, "invalid-transfer-function").await;
        assert!(answer["detail"].as_str().unwrap().contains(word), "{answer}");
    }
}

#[tokio::test]
async fn coordinates_are_compressed_and_come_back() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let (compress, decompress) = (format!("/v1/bases/{basis}/compress"), format!("/v1/bases/{basis}/decompress"));
    let figures = ask(&app, &compress, &json!({"pairs": 3, "bits": 16})).await;
    assert_eq!((&figures["pairs"], &figures["bits"]), (&json!(3), &json!(16)));
    assert_eq!(numbers(&figures["relative_errors"]).len(), 3);
    // Six vertices: whoever decompresses must have the basis.
    let bytes = figures["bytes"].as_f64().unwrap() + figures["basis_bytes"].as_f64().unwrap();
    assert!(figures["basis_bytes"].as_u64() > Some(0));
    assert!(close(&[figures["bits_per_vertex_with_basis"].as_f64().unwrap()], &[8.0 * bytes / 6.0]), "{figures}");
    let response = app.post(&compress).json(&json!({})).header("accept", OCTETS).send().await.unwrap();
    let errors = response.headers()["chladni-relative-error"].to_str().unwrap().to_owned();
    assert_eq!(errors.split(", ").count(), 3);
    let packed = response.bytes().await.unwrap();
    let post = |body: Vec<u8>, accept: &'static str| {
        app.post(&decompress)
            .query(&[("dtype", "f64")])
            .header("content-type", OCTETS)
            .header("accept", accept)
            .body(body)
            .send()
    };
    let unpacked = post(packed.to_vec(), OCTETS).await.unwrap();
    assert_eq!(unpacked.headers()["chladni-columns"], "3");
    let unpacked = doubles(&unpacked.bytes().await.unwrap());
    let table: Value = post(packed.to_vec(), "application/json").await.unwrap().json().await.unwrap();
    assert!(close(&numbers(&table["values"]), &unpacked));
    assert!(post(packed.to_vec(), "model/ply").await.unwrap().bytes().await.unwrap().starts_with(b"ply\n"));
    // One raw function, through and back.
    let x: Vec<u8> = [2.0f64, 3.0, 4.0, 2.0, 3.0, 4.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let response = raw(&app, &compress, &json!({"bits": 20}), x).await;
    let back = doubles(&post(response.bytes().await.unwrap().to_vec(), OCTETS).await.unwrap().bytes().await.unwrap());
    assert!(back.iter().zip([2.0, 3.0, 4.0, 2.0, 3.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-4), "{back:?}");
    problem(
        post(back.iter().flat_map(|x| x.to_le_bytes()).collect(), OCTETS).await.unwrap(),
        422,
        "invalid-compressed-functions",
    )
    .await;
    problem(post(packed[..30].to_vec(), OCTETS).await.unwrap(), 422, "invalid-compressed-functions").await;
    problem(post(Vec::new(), OCTETS).await.unwrap(), 422, "invalid-compressed-functions").await;
    let json = app.post(&decompress).json(&json!({})).send().await.unwrap();
    problem(json, 415, "unsupported-media-type").await;
    refused(
        &app,
        &compress,
        &[
            (json!({"pairs": 4}), 422, "invalid-analysis", "pairs: must be between 1 and 3, not 4"),
            (json!({"bits": 1}), 422, "invalid-analysis", "bits: must be"),
            (json!({"functions": {"values": [1.0]}}), 422, "invalid-function", "1 values"),
        ],
    )
    .await;
}

#[tokio::test]
async fn shapes_are_compared_and_drawn() {
    let app = TestApp::start();
    let (round, _) = app.sphere().await;
    let mut bases = vec![app.basis().await];
    for (mesh, parameters) in [(&round, json!({"count": 3})), (&round, json!({"count": 3, "seed": 7}))] {
        let job = app.submit(mesh, parameters).await;
        bases.push(text(&app.finished(&text(&job["id"])).await["basis"]));
    }
    let url = "/v1/shape-comparisons";
    let body = json!({"bases": bases, "labels": ["octahedron", "sphere", "<sphere>"], "neighbours": 1});
    let answer = ask(&app, url, &body).await;
    assert_eq!((&answer["count"], &answer["neighbours"]), (&json!(2), &json!([[1], [2], [1]])));
    let distances = numbers(&answer["distances"]["values"]);
    assert!(distances[1] > 0.0 && distances[5] == 0.0 && distances[1] == distances[3]);
    // Eigenvalues 0, 1 and 2 times the area, the last divided by its index.
    let area: f64 = 4.0 * 3f64.sqrt();
    assert!(close(&numbers(&answer["descriptors"]["values"])[..1], &[area]), "{answer}");
    assert!((numbers(&answer["held"]).iter().sum::<f64>() - 1.0).abs() < 1e-9);
    let request = app.post(&format!("{url}?dtype=f64")).json(&body).header("accept", OCTETS);
    assert!(close(&doubles(&request.send().await.unwrap().bytes().await.unwrap()), &distances));
    let picture = app.post(url).json(&body).header("accept", "image/svg+xml").send().await.unwrap();
    assert_eq!(picture.headers()["content-type"], "image/svg+xml");
    let picture = picture.text().await.unwrap();
    assert!(
        picture.starts_with("<svg") && picture.contains("&lt;sphere&gt;") && picture.matches("<circle").count() == 3
    );
    let space = json!({"bases": bases, "dimensions": 3, "scale": "first", "weighting": "none"});
    let answer = ask(&app, url, &space).await;
    assert_eq!(answer["places"]["columns"], 3);
    // All spectra are multiples of each other.
    assert!(numbers(&answer["distances"]["values"]).iter().all(|d| d.abs() < 1e-12));
    assert!(text(&answer["labels"][0]).len() == 8);
    let nil = uuid::Uuid::nil().to_string();
    refused(
        &app,
        url,
        &[
            (json!({"bases": [bases[0]]}), 422, "invalid-analysis", "shapes: must be between 2 and 512, not 1"),
            (json!({"bases": bases, "count": 3}), 422, "invalid-analysis", "count: must be between"),
            (json!({"bases": bases, "dimensions": 5}), 422, "invalid-analysis", "dimensions: must be"),
            (json!({"bases": bases, "labels": ["one"]}), 422, "invalid-request", "labels"),
            (json!({"bases": bases, "scale": "magic"}), 422, "invalid-request", "magic"),
            (json!({"bases": [bases[0], nil]}), 404, "unknown-basis", "0000"),
            (json!({"bases": [bases[0], "x"]}), 404, "unknown-basis", "x"),
        ],
    )
    .await;
    let image = app.post(url).json(&body).header("accept", "image/png").send().await.unwrap();
    problem(image, 406, "not-acceptable").await;
    spectra_of_different_operators_are_refused(&app, &round, &bases).await;
}

#[tokio::test]
async fn two_bases_are_compared_function_by_function() {
    let app = TestApp::start();
    let (basis, round) = (app.basis().await, app.sphere().await.0);
    let url = "/v1/basis-comparisons";
    let body = json!({"reference": basis, "other": basis, "coefficients": true});
    let same = ask(&app, url, &body).await;
    assert_eq!((&same["pairs"], same["eigenspaces"].as_array().unwrap().len()), (&json!(3), 3));
    assert_eq!(same["same_mesh"], true);
    assert!(close(&numbers(&same["coefficients"]["values"]), &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]), "{same}");
    for name in ["eigenvalue_errors", "projection_errors", "angles"] {
        assert!(numbers(&same[name]).iter().all(|x| x.abs() < 1e-6), "{same}");
    }
    // With a wide gap the eigenvalues 1 and 2 are one cluster; zero is none of it.
    let wide = ask(&app, url, &json!({"reference": basis, "other": basis, "gap": 0.6, "pairs": 3})).await;
    assert_eq!((&wide["eigenspaces"][1]["from"], &wide["eigenspaces"][1]["to"]), (&json!(1), &json!(3)));
    assert!(wide["coefficients"].is_null() && wide["following"].is_null());
    // Each mode follows itself; those of a cluster do so together.
    let wanted = json!({"reference": basis, "other": basis, "gap": 0.6, "following": true});
    let following = ask(&app, url, &wanted).await["following"].take();
    for (mode, followed) in following["modes"].as_array().unwrap().iter().enumerate() {
        assert_eq!((&followed["mode"], &followed["sign"], &followed["sure"]), (&json!(mode), &json!(1), &json!(true)));
        assert!((followed["overlap"].as_f64().unwrap() - 1.0).abs() < 1e-6, "{followed}");
    }
    let cluster = &following["clusters"][0];
    assert_eq!((&cluster["modes"], &cluster["followers"]), (&json!([1, 2]), &json!([1, 2])));
    assert!(close(&numbers(&cluster["rotation"]["values"]), &[1.0, 0.0, 0.0, 1.0]), "{cluster}");
    // A mesh of as many vertices in another place is another one.
    let moved = "OFF\n6 8 0\n3 0 0\n1 0 0\n2 1 0\n2 -1 0\n2 0 1\n2 0 -1\n3 0 2 4\n3 2 1 4\n3 1 3 4\n3 3 0 4\n3 2 0 5\n3 1 2 5\n3 3 1 5\n3 0 3 5\n";
    let moved = app.submit(&text(&app.upload("off", moved).await["id"]), json!({"count": 3})).await;
    let moved = text(&app.finished(&text(&moved["id"])).await["basis"]);
    assert_eq!(ask(&app, url, &json!({"reference": basis, "other": moved})).await["same_mesh"], false);
    let elsewhere = app.submit(&round, json!({"count": 3})).await;
    let elsewhere = text(&app.finished(&text(&elsewhere["id"])).await["basis"]);
    refused(
        &app,
        url,
        &[
            (json!({"reference": basis, "other": elsewhere}), 409, "incomparable-bases", "6 vertices"),
            (
                json!({"reference": basis, "other": basis, "pairs": 4}),
                422,
                "invalid-analysis",
                "pairs: must be between 1 and 3",
            ),
            (json!({"reference": basis, "other": basis, "gap": -1.0}), 422, "invalid-analysis", "gap: must be"),
            (json!({"reference": basis, "other": "x"}), 404, "unknown-basis", "x"),
            (json!({"reference": basis}), 422, "invalid-request", "other"),
        ],
    )
    .await;
}

async fn spectra_of_different_operators_are_refused(app: &TestApp, round: &str, bases: &[String]) {
    let made = async |parameters: Value| {
        let job = app.submit(round, parameters).await;
        text(&app.finished(&text(&job["id"])).await["basis"])
    };
    let url = "/v1/shape-comparisons";
    let asked = async |others: [&String; 2], mixed: bool| {
        app.post(url).json(&json!({"bases": [&bases[0], others[0], others[1]], "mixed": mixed})).send().await.unwrap()
    };
    // On a closed surface the condition at its boundary means nothing, and the robust Laplacian is a Laplacian.
    let robust = made(json!({"count": 3, "operator": "robust"})).await;
    let fixed = made(json!({"count": 3, "boundary": "dirichlet"})).await;
    assert_eq!(asked([&robust, &fixed], false).await.status(), 200);
    let extrinsic = made(json!({"count": 3, "operator": {"extrinsic": {"t": 0.5}}})).await;
    let refused = problem(asked([&robust, &extrinsic], false).await, 409, "incomparable-bases").await;
    assert_eq!(refused["bases"], json!([bases[0], extrinsic]));
    assert_eq!(refused["spectra"], json!(["laplace", "{\"extrinsic\":{\"t\":0.5}}"]));
    assert_eq!(asked([&robust, &extrinsic], true).await.status(), 200);
    // With a boundary the conditions have to agree.
    let open = text(&app.upload("off", "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 2 1 3\n").await["id"]);
    let mut flat = Vec::new();
    for boundary in ["neumann", "dirichlet"] {
        let job = app.submit(&open, json!({"count": 3, "boundary": boundary})).await;
        flat.push(text(&app.finished(&text(&job["id"])).await["basis"]));
    }
    let refused = problem(asked([&flat[0], &flat[1]], false).await, 409, "incomparable-bases").await;
    assert_eq!(refused["spectra"], json!(["laplace, neumann", "laplace, dirichlet"]));
    assert_eq!(asked([&fixed, &flat[1]], false).await.status(), 200);
}

#[tokio::test]
async fn functions_are_mapped_between_surfaces() {
    let app = TestApp::start();
    let basis = app.basis().await;
    let url = "/v1/functional-maps";
    let body = json!({"source": basis, "target": basis, "landmarks": [[0, 0], [1, 1], [2, 2]], "all_points": true});
    let answer = ask(&app, url, &body).await;
    assert_eq!(answer["matrix"]["columns"], 3);
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let near = |matrix: &[f64]| matrix.iter().zip(identity).all(|(a, b)| (a - b).abs() < 1e-3);
    assert!(near(&numbers(&answer["matrix"]["values"])), "{answer}");
    let points: Vec<u64> = answer["points"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap() % 3).collect();
    assert_eq!(points, [0, 1, 2, 0, 1, 2]);
    assert!(answer["matched"].is_null() && answer["orthogonality_defect"].as_f64().unwrap() < 1e-3);
    assert_eq!(answer["confidences"].as_array().unwrap().len(), 6);
    assert!(answer["inverse"].is_null() && answer["carried"].is_null());
    let mut both = body.clone();
    both["both_ways"] = json!(true);
    both["carry"] = json!({"functions": {"columns": 2, "values": [0, 5, 1, 6, 2, 7, 0, 5, 1, 6, 2, 7]}});
    let both = ask(&app, url, &both).await;
    let back: Vec<u64> =
        both["inverse"]["points"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap() % 3).collect();
    assert_eq!(back, [0, 1, 2, 0, 1, 2]);
    assert!(close(&numbers(&both["carried"]["values"]), &[0.0, 5.0, 1.0, 6.0, 2.0, 7.0, 0.0, 5.0, 1.0, 6.0, 2.0, 7.0]));
    let mut short = body.clone();
    short["carry"] = json!({"functions": {"values": [1.0, 2.0]}, "by": "modes"});
    problem(app.post(url).json(&short).send().await.unwrap(), 422, "invalid-function").await;
    let rest = json!({"source": basis, "target": basis});
    let landmarks = words(&[0, 0, 1, 1, 2, 2]);
    assert!(near(&doubles(&raw(&app, url, &rest, landmarks.clone()).await.bytes().await.unwrap())));
    let response = raw(&app, &format!("{url}?points=true"), &rest, landmarks).await;
    assert_eq!(
        (&response.headers()["chladni-dtype"], &response.headers()["chladni-rows"]),
        (&"u32".parse().unwrap(), &6.into())
    );
    let table = json!({"columns": 3, "values": [1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1]});
    let known = json!({"source": basis, "target": basis, "descriptors": {"source": table, "target": table}});
    assert!(near(&numbers(&ask(&app, url, &known).await["matrix"]["values"])));
    let with = |name: &str, value: Value| {
        let mut changed = body.clone();
        changed[name] = value;
        changed
    };
    let other = json!({"source": table, "target": {"values": [0, 0, 0, 0, 0, 0]}});
    refused(
        &app,
        url,
        &[
            (with("landmarks", json!([[0, 0], [6, 0]])), 422, "invalid-vertex", "Landmark 1 is vertex 6 of 6"),
            (with("landmarks", json!([])), 422, "invalid-analysis", "known functions: must be at least 1, not 0"),
            (with("pairs", json!(4)), 422, "invalid-analysis", "pairs: must be between 1 and 3, not 4"),
            (with("samples", json!(1)), 422, "invalid-analysis", "samples: must be"),
            (with("descriptors", other), 422, "invalid-function", "descriptors"),
            (with("target", json!("x")), 404, "unknown-basis", "x"),
            (with("commutativity", json!(-1.0)), 422, "invalid-analysis", "commutativity: must be"),
        ],
    )
    .await;
    problem(raw(&app, url, &rest, words(&[0, 0, 1])).await, 422, "invalid-vertex").await;
}
