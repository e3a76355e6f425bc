//! Problems, matrices without a mesh: uploaded, checked, solved, judged, and refused where a mesh is needed.

use std::f64::consts::PI;
use std::io::{Cursor, Write};
use std::sync::Arc;

use chladni::queue::Solver;
use chladni_spectral::basis::{Functions, Precision};
use chladni_spectral::formats::npz;
use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

fn app() -> TestApp {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    builder.start()
}

/// A path of `n` vertices in Matrix Market, the lower triangle of a symmetric matrix: its eigenvalues are 2 − 2
/// cos(πk/n).
fn path(n: usize) -> String {
    let mut lines = format!("%%MatrixMarket matrix coordinate real symmetric\n% a path\n{n} {n} {}\n", 2 * n - 1);
    for row in 1..=n {
        let degree = u8::from(row > 1) + u8::from(row < n);
        lines += &format!("{row} {row} {degree}\n");
        if row > 1 {
            lines += &format!("{row} {} -1.0\n", row - 1);
        }
    }
    lines
}

fn on_path(k: usize, n: usize) -> f64 {
    2.0 - 2.0 * (PI * k as f64 / n as f64).cos()
}

/// The consistent mass of linear elements on that path, both triangles stored.
fn path_mass(n: usize) -> String {
    let mut lines = format!("%%MatrixMarket matrix coordinate real general\n{n} {n} {}\n", 3 * n - 2);
    for row in 1..=n {
        let elements = u8::from(row > 1) + u8::from(row < n);
        lines += &format!("{row} {row} {}\n", f64::from(elements) / 3.0);
        if row > 1 {
            lines += &format!("{row} {0} {1}\n{0} {row} {1}\n", row - 1, 1.0 / 6.0);
        }
    }
    lines
}

/// A header of NPY, as NumPy writes it, before its numbers.
fn npy(descriptor: &str, shape: &str, numbers: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{descriptor}', 'fortran_order': False, 'shape': {shape}, }}");
    header += &" ".repeat(63 - (10 + header.len()) % 64);
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(numbers);
    out
}

fn numbers<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

/// A ZIP archive of arrays without compression.
fn archive(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, bytes) in members {
        zip.start_file(format!("{name}.npy"), options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// The path as `scipy.sparse.save_npz(csr_matrix)` writes it, uncompressed.
fn path_npz(n: usize) -> Vec<u8> {
    let (mut indptr, mut indices, mut data) = (vec![0i32], Vec::<i32>::new(), Vec::<f64>::new());
    for row in 0..n {
        for (column, value) in [(row.wrapping_sub(1), -1.0), (row, 0.0), (row + 1, -1.0)] {
            if column < n {
                indices.push(column as i32);
                let degree = f64::from(u8::from(row > 0) + u8::from(row + 1 < n));
                data.push(if column == row { degree } else { value });
            }
        }
        indptr.push(indices.len() as i32);
    }
    let entries = data.len();
    archive(&[
        ("indices", npy("<i4", &format!("({entries},)"), &numbers(&indices))),
        ("indptr", npy("<i4", &format!("({},)", n + 1), &numbers(&indptr))),
        ("format", npy("|S3", "()", b"csr")),
        ("shape", npy("<i8", "(2,)", &numbers(&[n as i64, n as i64]))),
        ("data", npy("<f8", &format!("({entries},)"), &numbers(&data))),
    ])
}

const BOUNDARY: &str = "chladni-boundary";

fn part(name: &str, content: &[u8]) -> Vec<u8> {
    let head = format!("--{BOUNDARY}\r\nContent-Disposition: form-data; name=\"{name}\"; filename=\"{name}\"\r\n\r\n");
    [head.as_bytes(), content, b"\r\n"].concat()
}

async fn send(app: &TestApp, parts: &[(&str, &[u8])]) -> reqwest::Response {
    let mut body: Vec<u8> = parts.iter().flat_map(|(name, content)| part(name, content)).collect();
    body.extend(format!("--{BOUNDARY}--\r\n").as_bytes());
    let kind = format!("multipart/form-data; boundary={BOUNDARY}");
    app.post("/v1/problems").header("content-type", kind).body(body).send().await.unwrap()
}

async fn upload(app: &TestApp, parts: &[(&str, &[u8])]) -> Value {
    let response = send(app, parts).await;
    let status = response.status();
    let value: Value = response.json().await.unwrap();
    assert!(status.is_success(), "{status}: {value}");
    value
}

fn request(id: &Value, parameters: Value) -> Value {
    json!({"kind": "pencil_basis", "pencil": id, "parameters": parameters})
}

/// Solves and gives the basis as a resource.
async fn solved(app: &TestApp, id: &Value, parameters: Value) -> Value {
    let job: Value = app.post("/v1/jobs").json(&request(id, parameters)).send().await.unwrap().json().await.unwrap();
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    assert_eq!((&job["pencil"], &job["mesh"]), (id, &Value::Null), "{job}");
    app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap()
}

fn values(basis: &Value) -> Vec<f64> {
    basis["eigenvalues"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

async fn verdict(app: &TestApp, basis: &Value) -> Value {
    let url = format!("/v1/bases/{}/verification", text(&basis["id"]));
    let answer = app.post(&url).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    answer.json().await.unwrap()
}

#[tokio::test]
async fn equal_matrices_are_one_problem_in_whatever_format_they_come() {
    let app = app();
    let first = send(&app, &[("stiffness", path(40).as_bytes()), ("name", b"a path")]).await;
    assert_eq!(first.status(), 201);
    let location = first.headers()["location"].to_str().unwrap().to_owned();
    let first: Value = first.json().await.unwrap();
    assert_eq!(location, format!("/v1/problems/{}", text(&first["id"])));
    assert_eq!(
        (&first["rows"], &first["name"], &first["report"]["entries"]),
        (&json!(40), &json!("a path"), &json!(118))
    );
    assert_eq!((&first["report"]["mass"], &first["report"]["mass_proven"]), (&json!("identity"), &json!(true)));
    // The body itself; NPZ; ones for a mass; what the server gives back.
    let content = app.get(first["links"]["content"].as_str().unwrap()).send().await.unwrap().bytes().await.unwrap();
    let ones = npy("<f8", "(40,)", &numbers(&[1.0; 40]));
    let bodies: [Vec<u8>; 3] = [path(40).into_bytes(), path_npz(40), content.to_vec()];
    for body in bodies {
        let again = app.post("/v1/problems?name=other").body(body).send().await.unwrap();
        assert_eq!(again.status(), 200);
        assert_eq!(again.json::<Value>().await.unwrap()["id"], first["id"]);
    }
    assert_eq!(upload(&app, &[("stiffness", &path_npz(40)), ("mass", &ones)]).await["id"], first["id"]);
    let heavy = upload(&app, &[("stiffness", &path_npz(40)), ("mass", path_mass(40).as_bytes())]).await;
    assert_ne!(heavy["id"], first["id"]);
    let content = app.get(heavy["links"]["content"].as_str().unwrap()).send().await.unwrap().bytes().await.unwrap();
    let again: Value = app.post("/v1/problems").body(content).send().await.unwrap().json().await.unwrap();
    assert_eq!((&again["id"], &again["report"]["mass"]), (&heavy["id"], &json!("sparse")));

    let listed: Value = app.get("/v1/problems?name=PATH").send().await.unwrap().json().await.unwrap();
    assert_eq!((listed["items"].as_array().unwrap().len(), &listed["items"][0]["id"]), (1, &first["id"]));
    let url = format!("/v1/problems/{}", text(&first["id"]));
    let tag = app.get(&url).send().await.unwrap().headers()["etag"].clone();
    let renamed = app.client.patch(app.url(&url)).json(&json!({"name": "forty"})).send().await.unwrap();
    assert_eq!(renamed.json::<Value>().await.unwrap()["name"], "forty");
    let shown = app.get(&url).header("if-none-match", tag).send().await.unwrap();
    assert_eq!(shown.json::<Value>().await.unwrap()["name"], "forty");
    // Meshes and problems do not stand for each other.
    let meshes: Value = app.get("/v1/meshes").send().await.unwrap().json().await.unwrap();
    assert_eq!(meshes["items"], json!([]));
    problem(app.get(&url.replace("problems", "meshes")).send().await.unwrap(), 404, "unknown-mesh").await;
    problem(app.delete(&url.replace("problems", "meshes")).send().await.unwrap(), 404, "unknown-mesh").await;
    let mesh = app.octahedron().await;
    problem(app.get(&format!("/v1/problems/{mesh}")).send().await.unwrap(), 404, "unknown-problem").await;
    problem(app.delete(&format!("/v1/problems/{mesh}")).send().await.unwrap(), 404, "unknown-problem").await;
    assert_eq!(app.delete(&url).send().await.unwrap().status(), 204);
    problem(app.get(&url).send().await.unwrap(), 404, "unknown-problem").await;
}

#[tokio::test]
async fn pairs_are_those_of_the_matrices_and_are_confirmed() {
    let app = app();
    let n = 900;
    let id = upload(&app, &[("stiffness", path(n).as_bytes())]).await["id"].clone();
    for (parameters, indices) in [
        (json!({"count": 8}), 0..8),
        (json!({"below": on_path(6, n) + 1e-7}), 0..7),
        (json!({"between": [on_path(3, n) - 1e-7, on_path(6, n) + 1e-7]}), 3..7),
        (json!({"around": on_path(40, n) + 1e-7, "count": 5}), 38..43),
        (json!({"around": on_path(40, n) + 1e-7, "count": 1}), 40..41),
        (json!({"count": 8, "precision": "f32", "tolerance": 0.1}), 0..8),
    ] {
        let basis = solved(&app, &id, parameters.clone()).await;
        let found = values(&basis);
        assert_eq!(found.len(), indices.len(), "{parameters}: {found:?}");
        let certificate = &basis["certificate"];
        assert_eq!(certificate["complete"], true, "{basis}");
        assert_eq!(certificate["first"].as_u64().unwrap_or(0), indices.start as u64, "{parameters}");
        for (k, (value, index)) in found.iter().zip(indices).enumerate() {
            let bound = certificate["bounds"][k].as_f64().unwrap();
            assert!((value - on_path(index, n)).abs() <= bound + 1e-15, "{parameters}: {k}: {value}, {bound}");
            assert!(bound < 1e-3, "{bound}");
        }
        if parameters["around"].is_f64() {
            assert_eq!(certificate["around"]["ties"], json!([]), "{certificate}");
        }
        assert_eq!((&basis["pencil"], &basis["mesh"], &basis["rows"]), (&id, &Value::Null, &json!(n)));
        let receipt = verdict(&app, &basis).await;
        assert_eq!((&receipt["verdict"], &receipt["findings"]), (&json!("confirmed"), &json!([])), "{parameters}");
        assert_eq!((&receipt["hashes"]["problem"], &receipt["mass"]), (&id, &json!("identity")));
        let proven = receipt["proven_complete"].as_u64().unwrap() as usize;
        // Counts on either side of what is near a shift leave no other pair open.
        assert!(if parameters["around"].is_f64() { proven == found.len() } else { proven > 0 }, "{receipt}");
    }
}

#[tokio::test]
async fn fixed_rows_a_mass_and_content_are_what_a_dense_solve_says() {
    let app = app();
    let n = 30;
    let id = upload(&app, &[("stiffness", path(n).as_bytes()), ("mass", path_mass(n).as_bytes())]).await["id"].clone();
    // More rows than records show in full.
    let fixed: Vec<u32> = (0..20).rev().collect();
    let basis = solved(&app, &id, json!({"count": 4, "fixed": fixed, "tolerance": 1e-6})).await;
    assert_eq!((&basis["details"]["unknowns"], &basis["parameters"]["fixed"]["numbers"]), (&json!(10), &json!(20)));
    // Linear elements on an interval of ten of them, held at one end: λ = 6 (1 − c) / (2 + c) with c = cos((k + 1/2) π
    // / 10).
    for (k, value) in values(&basis).into_iter().enumerate() {
        let c = (PI * (k as f64 + 0.5) / 10.0).cos();
        assert!((value - 6.0 * (1.0 - c) / (2.0 + c)).abs() < 1e-10, "{k}: {value}");
    }
    let receipt = verdict(&app, &basis).await;
    assert_eq!(receipt["verdict"], "confirmed", "{receipt}");
    let url = format!("/v1/bases/{}", text(&basis["id"]));
    let content = app.get(&format!("{url}/content")).send().await.unwrap().bytes().await.unwrap();
    let read = npz::read(&content).unwrap();
    assert_eq!(read.metadata.json()["pencil"], id);
    assert!(matches!(&read.functions, Functions::Dense(dense) if dense.precision() == Precision::F64));
    let vectors: Vec<f64> = read.lift(0..4).unwrap();
    assert!(vectors[..20].iter().all(|&x| x == 0.0) && vectors[20] != 0.0);
    let modes = app.get(&format!("{url}/modes?format=f32&dtype=f64&to=4")).send().await.unwrap();
    assert_eq!(modes.headers()["chladni-rows"], "30");
    assert_eq!(modes.bytes().await.unwrap(), numbers(&vectors));
    for format in ["safetensors", "matrix_market"] {
        let response = app.get(&format!("{url}/content?format={format}")).send().await.unwrap();
        assert_eq!(response.status(), 200, "{format}");
    }
}

#[tokio::test]
async fn what_needs_a_mesh_refuses_a_basis_of_a_problem_and_says_why() {
    let app = app();
    let id = upload(&app, &[("stiffness", path(50).as_bytes())]).await["id"].clone();
    let basis = text(&solved(&app, &id, json!({"count": 5})).await["id"]);
    let url = |what: &str| format!("/v1/bases/{basis}/{what}");
    let function = json!({"functions": vec![vec![1.0]; 50]});
    for (what, body) in [
        ("filter", json!({"functions": function["functions"], "transfer": {"kind": "low_pass", "cutoff": 1.0}})),
        ("project", function.clone()),
        ("signatures", json!({"signature": {"kind": "heat_kernel"}})),
        ("distances", json!({"sources": [0]})),
        ("compress", function),
    ] {
        let refused = problem(app.post(&url(what)).json(&body).send().await.unwrap(), 409, "basis-without-mesh").await;
        assert_eq!((&refused["kind"], &refused["kinds"]), (&json!("pencil_basis"), &json!(["eigenbasis"])), "{what}");
        assert!(text(&refused["detail"]).contains("without a mesh"), "{refused}");
    }
    problem(app.get(&url("modes?format=ply&from=1")).send().await.unwrap(), 409, "basis-without-mesh").await;
    // And the other way: kinds that need a mesh take no problem.
    for (body, status, kind) in [
        (json!({"kind": "eigenbasis", "pencil": id}), 422, "invalid-request"),
        (json!({"kind": "eigenbasis", "mesh": id}), 404, "unknown-mesh"),
        (json!({"kind": "eigenbasis"}), 422, "invalid-request"),
        (json!({"kind": "pencil_basis", "mesh": id}), 422, "invalid-request"),
        (json!({"kind": "pencil_basis"}), 422, "invalid-request"),
        (json!({"kind": "pencil_basis", "pencil": "0".repeat(32)}), 404, "unknown-problem"),
        (json!({"kind": "pencil", "pencil": id}), 422, "invalid-parameter/kind"),
        (request(&id, json!({"count": 51})), 422, "invalid-parameter/count"),
        (request(&id, json!({"count": 50, "fixed": [7]})), 422, "invalid-parameter/count"),
        (request(&id, json!({"fixed": [50]})), 422, "invalid-parameter/fixed"),
        (request(&id, json!({"operator": "laplace"})), 422, "invalid-parameter/form"),
        (request(&id, json!({"around": 1.0, "below": 2.0})), 422, "invalid-parameter/around"),
    ] {
        for route in ["/v1/jobs", "/v1/job-estimates"] {
            problem(app.post(route).json(&body).send().await.unwrap(), status, kind).await;
        }
    }
}

#[tokio::test]
async fn a_job_is_estimated_by_its_factor_and_a_problem_in_use_stays() {
    let app = app();
    let id = upload(&app, &[("stiffness", path(900).as_bytes())]).await["id"].clone();
    let estimate = |parameters: Value| {
        let sent = app.post("/v1/job-estimates").json(&request(&id, parameters)).send();
        async { sent.await.unwrap().json::<Value>().await.unwrap() }
    };
    let (few, many) = (estimate(json!({"count": 5})).await, estimate(json!({"count": 500})).await);
    assert_eq!((&few["kind"], &few["fits"], &few["seconds"]), (&json!("pencil_basis"), &json!(true), &Value::Null));
    assert!(many["memory_bytes"].as_u64() > few["memory_bytes"].as_u64(), "{few} {many}");
    let basis = solved(&app, &id, json!({"count": 5})).await;
    // Equal work is one job.
    let again = app.post("/v1/jobs").json(&request(&id, json!({"count": 5, "fixed": []}))).send().await.unwrap();
    assert_eq!(again.status(), 200);
    let url = format!("/v1/problems/{}", text(&id));
    let refused = problem(app.delete(&url).send().await.unwrap(), 409, "problem-in-use").await;
    assert_eq!(refused["bases"], 1);
    let found: Value = app.get(&format!("/v1/jobs?mesh={}", text(&id))).send().await.unwrap().json().await.unwrap();
    assert_eq!(found["items"][0]["links"]["pencil"], json!(url));
    assert_eq!(app.delete(&format!("{url}?cascade=true")).send().await.unwrap().status(), 204);
    let gone = app.get(&format!("/v1/bases/{}", text(&basis["id"]))).send().await.unwrap();
    problem(gone, 404, "unknown-basis").await;
}

#[tokio::test]
async fn what_is_no_pencil_is_named_by_its_first_place() {
    let app = app();
    let market = |field: &str, symmetry: &str, lines: &str| {
        format!("%%MatrixMarket matrix coordinate {field} {symmetry}\n{lines}")
    };
    let whole = market("real", "symmetric", "2 2 2\n1 1 1\n2 2 1\n");
    for (stiffness, mass, kind, member) in [
        (
            market("real", "general", "3 3 3\n1 1 1\n2 3 5\n3 3 1\n"),
            None,
            "invalid-pencil/not-symmetric",
            json!([1, 2]),
        ),
        (market("real", "symmetric", "2 2 2\n1 1 1\n2 1 nan\n"), None, "invalid-pencil/not-finite", json!([0, 1])),
        (market("real", "symmetric", "2 2 2\n1 1 inf\n2 2 1\n"), None, "invalid-pencil/not-finite", json!([0, 0])),
        (market("real", "general", "2 3 1\n1 1 1\n"), None, "invalid-pencil/not-square", Value::Null),
        (market("real", "general", "0 0 0\n"), None, "invalid-pencil/empty", Value::Null),
        (market("complex", "symmetric", "1 1 1\n1 1 1 0\n"), None, "unreadable-matrix/line", Value::Null),
        (market("real", "skew-symmetric", "2 2 1\n2 1 1\n"), None, "unreadable-matrix/line", Value::Null),
        (
            market("real", "symmetric", "1000000000 1000000000 1\n1 1 1\n"),
            None,
            "unreadable-matrix/too-large",
            Value::Null,
        ),
        (market("real", "symmetric", "2 2 1000000000\n1 1 1\n"), None, "unreadable-matrix/too-large", Value::Null),
        (market("real", "symmetric", "2 2 9\n1 1 1\n"), None, "unreadable-matrix/line", Value::Null),
        ("hello".to_owned(), None, "unreadable-matrix/unknown-format", Value::Null),
        (String::new(), None, "unreadable-matrix/unknown-format", Value::Null),
        (whole.clone(), Some(market("real", "symmetric", "2 2 1\n1 1 1\n")), "invalid-pencil/not-definite", json!([1])),
        (
            whole.clone(),
            Some(market("real", "symmetric", "2 2 3\n1 1 1\n2 1 2\n2 2 1\n")),
            "invalid-pencil/not-definite",
            Value::Null,
        ),
        (
            whole.clone(),
            Some(market("real", "symmetric", "3 3 3\n1 1 1\n2 2 1\n3 3 1\n")),
            "invalid-pencil/not-square",
            Value::Null,
        ),
        (
            whole.clone(),
            Some("%%MatrixMarket matrix array real general\n2 1\n1\n-1\n".to_owned()),
            "invalid-pencil/not-definite",
            json!([1]),
        ),
    ] {
        let mut parts = vec![("stiffness", stiffness.as_bytes())];
        parts.extend(mass.as_ref().map(|mass| ("mass", mass.as_bytes())));
        let refused = problem(send(&app, &parts).await, 422, kind).await;
        if let Some(place) = member.as_array() {
            assert_eq!(refused["row"], place[0], "{refused}");
            assert_eq!(place.get(1).unwrap_or(&Value::Null), &refused["column"], "{refused}");
        }
    }
    // A pattern has ones for entries.
    let pattern = market("pattern", "symmetric", "2 2 2\n1 1\n2 2\n");
    assert_eq!(upload(&app, &[("stiffness", pattern.as_bytes())]).await["rows"], 2);

    // Archives that are cut short anywhere, that lie about their size, or hold objects.
    let good = path_npz(5);
    for cut in (4..good.len()).step_by(37) {
        let refused = send(&app, &[("stiffness", &good[..cut])]).await;
        assert_eq!(refused.status(), 422, "{cut}");
    }
    let pickled = archive(&[
        ("format", npy("|S3", "()", b"csr")),
        ("shape", npy("<i8", "(2,)", &numbers(&[1i64, 1]))),
        ("indptr", npy("<i4", "(2,)", &numbers(&[0i32, 1]))),
        ("indices", npy("<i4", "(1,)", &numbers(&[0i32]))),
        ("data", npy("|O", "(1,)", b"\x80\x04K\x01.")),
    ]);
    let vast = archive(&[
        ("format", npy("|S3", "()", b"csr")),
        ("shape", npy("<i8", "(2,)", &numbers(&[1_000_000_000i64, 1_000_000_000]))),
        ("indptr", npy("<i8", "(1000000001,)", &[])),
        ("indices", npy("<i4", "(0,)", &[])),
        ("data", npy("<f8", "(0,)", &[])),
    ]);
    for bytes in [pickled, vast] {
        let refused = send(&app, &[("stiffness", &bytes)]).await;
        assert_eq!(refused.status(), 422, "{}", refused.text().await.unwrap());
    }
    problem(send(&app, &[("mass", whole.as_bytes())]).await, 400, "invalid-multipart").await;
    problem(send(&app, &[("stiffness", b"x"), ("stiffness", b"x")]).await, 400, "invalid-multipart").await;
    problem(send(&app, &[("stiffness", whole.as_bytes()), ("colour", b"x")]).await, 400, "invalid-multipart").await;
}

#[tokio::test]
async fn parts_of_an_operator_come_with_a_job_on_a_mesh() {
    let app = app();
    let (mesh, n) = app.sphere().await;
    let shown: Value = app.get(&format!("/v1/meshes/{mesh}")).send().await.unwrap().json().await.unwrap();
    let faces = shown["faces"].as_u64().unwrap() as usize;
    let solve = |operator: Value| {
        let parameters = json!({"method": "hsim", "count": 6, "tolerance": 1e-6, "operator": operator});
        let app = &app;
        let mesh = &mesh;
        async move {
            let job = app.submit(mesh, parameters).await;
            let job = app.finished(&text(&job["id"])).await;
            assert_eq!(job["status"], "succeeded", "{job}");
            let basis: Value =
                app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap();
            values(&basis)
        }
    };
    let plain = solve(json!("laplace")).await;
    let tripled = solve(json!({"weighted": {"scalars": vec![3.0; faces]}})).await;
    let tensors = [3.0, 0.0, 3.0].repeat(faces);
    let turned = solve(json!({"weighted": {"tensors": tensors}})).await;
    for k in 0..6 {
        assert!((tripled[k] - 3.0 * plain[k]).abs() < 1e-9 * (1.0 + plain[k]), "{tripled:?} {plain:?}");
        assert!((turned[k] - 3.0 * plain[k]).abs() < 1e-9 * (1.0 + plain[k]), "{turned:?} {plain:?}");
    }
    let held = solve(json!({"weighted": {"fixed": [0, 5]}})).await;
    assert!(held[0] > 1e-3 && held[0] < plain[1], "{held:?}");
    for (operator, name) in [
        (json!({"weighted": {"scalars": [1.0, 2.0]}}), "operator.weighted.scalars"),
        (json!({"weighted": {"scalars": vec![0.0; faces]}}), "operator.weighted.scalars"),
        (json!({"weighted": {"fixed": [n]}}), "operator.weighted.fixed"),
    ] {
        let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 3, "operator": operator}});
        let refused = app.post("/v1/jobs").json(&body).send().await.unwrap();
        problem(refused, 422, &format!("invalid-parameter/{name}")).await;
    }
}
