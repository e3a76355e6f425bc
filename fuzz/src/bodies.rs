//! Request bodies as a server takes them: every operation that has one, in this process, on a mesh, a problem and a
//! basis of each kind.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::{Request, StatusCode, header};
use chladni::config::Config;
use chladni::http::{self, AppState};
use chladni::queue::{Solver, Unobserved, WorkerOptions, WorkerPool};
use chladni::store::{Store, StoreOptions};
use chladni::telemetry::Metrics;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use hyper::service::Service;
use hyper_util::service::TowerToHyperService;
use serde_json::{Map, Value, json};

/// A small server without a socket.
struct Server {
    runtime: tokio::runtime::Runtime,
    router: Router,
    operations: Vec<Operation>,
    names: Names,
}

/// An operation that takes a body.
struct Operation {
    method: String,
    path: String,
    media_types: Vec<String>,
    /// Bodies that the document shows.
    examples: Vec<Value>,
}

/// What there is on the server. Inputs say `@mesh`, `@pencil` and `@0`, `@1` … for bases, since identifiers differ from
/// run to run.
struct Names {
    mesh: String,
    pencil: String,
    field: String,
    bases: Vec<String>,
}

impl Names {
    fn fill(&self, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::with_capacity(bytes.len());
        let mut rest = bytes;
        while let Some((&first, after)) = rest.split_first() {
            let (name, length) = match after {
                _ if first != b'@' => (None, 0),
                [b'm', b'e', b's', b'h', ..] => (Some(&self.mesh), 4),
                [b'p', b'e', b'n', b'c', b'i', b'l', ..] => (Some(&self.pencil), 6),
                [digit, ..] if digit.is_ascii_digit() => {
                    (Some(&self.bases[usize::from(digit - b'0') % self.bases.len()]), 1)
                }
                _ => (None, 0),
            };
            match name {
                Some(name) => out.extend_from_slice(name.as_bytes()),
                None => out.push(first),
            }
            rest = &after[length..];
        }
        out
    }
}

/// The operations of the document that take a body, and those that take a query in its place.
fn operations() -> Vec<Operation> {
    let document: Value = serde_json::from_str(&http::openapi().expect("there is a document")).expect("it is JSON");
    let schemas = &document["components"]["schemas"];
    let mut operations = Vec::new();
    for (path, item) in document["paths"].as_object().into_iter().flatten() {
        for (method, operation) in item.as_object().into_iter().flatten() {
            let Some(content) = operation["requestBody"]["content"].as_object() else { continue };
            let mut examples = Vec::new();
            for media in content.values() {
                let name = media["schema"]["$ref"].as_str().and_then(|path| path.rsplit('/').next());
                examples
                    .extend(media["examples"].as_object().into_iter().flatten().map(|(_, one)| one["value"].clone()));
                examples.push(media["example"].clone());
                examples.push(schemas[name.unwrap_or_default()]["example"].clone());
            }
            examples.retain(|example| !example.is_null());
            operations.push(Operation {
                method: method.to_uppercase(),
                path: path.clone(),
                media_types: content.keys().cloned().collect(),
                examples,
            });
        }
    }
    operations
}

/// Replaces the identifiers of an example by those of what there is, and numbers of vertices by small ones.
fn fitting(example: &Value) -> Value {
    match example {
        Value::String(text) if text.len() == 36 && text.matches('-').count() == 4 => {
            // The examples' two bases are two.
            if text.ends_with("33") { "@1".into() } else { "@0".into() }
        }
        Value::Array(items) => items.iter().map(fitting).collect(),
        Value::Object(members) => members
            .iter()
            .map(|(name, value)| {
                (
                    name.clone(),
                    match name.as_str() {
                        "mesh" => "@mesh".into(),
                        "pencil" => "@pencil".into(),
                        _ => fitting(value),
                    },
                )
            })
            .collect::<Map<_, _>>()
            .into(),
        Value::Number(number) if number.as_u64().is_some_and(|number| number > 20) => {
            (3 + number.as_u64().unwrap_or(0) % 7).into()
        }
        other => other.clone(),
    }
}

/// An input for each example of the document and each kind of basis, and a few for what has none, with names.
pub fn seeds() -> Vec<(String, Vec<u8>)> {
    let mut seeds = Vec::new();
    let mut add = |operation: usize, media: usize, basis: usize, body: &[u8], number: usize| {
        let head = [operation as u8, media as u8, basis as u8, 0];
        seeds.push((format!("{operation}-{media}-{basis}-{number}"), [&head[..], body].concat()));
    };
    for (at, operation) in operations().iter().enumerate() {
        let json = operation.media_types.iter().position(|one| one == "application/json");
        for (number, example) in operation.examples.iter().enumerate() {
            let body = fitting(example).to_string();
            for basis in 0..BASES.len() {
                add(at, json.unwrap_or(0), basis, body.as_bytes(), number);
            }
        }
        for (number, (_, body)) in MORE.iter().enumerate().filter(|(_, (name, _))| operation.path.ends_with(name)) {
            for basis in 0..BASES.len() {
                add(at, json.unwrap_or(0), basis, body.as_bytes(), 50 + number);
            }
        }
        if operation.path.ends_with("hodge-decomposition") {
            let values: Vec<_> = (0..2 * sphere().faces.len()).map(|at| at % 7).collect();
            let body = json!({"field": {"columns": 2, "values": values}}).to_string();
            add(at, json.unwrap_or(0), 0, body.as_bytes(), 98);
        }
        if operation.path.ends_with("meshes/{id}/fields") {
            let body = json!({"columns": 1, "values": vec![0.5; sphere().faces.len()]}).to_string();
            add(at, json.unwrap_or(0), 0, body.as_bytes(), 98);
        }
        if operation.path.ends_with("{id}/surface") {
            let values: Vec<f64> = sphere().positions.iter().flatten().map(|x| 1.5 * x).collect();
            let body = json!({"columns": 3, "values": values}).to_string();
            add(at, json.unwrap_or(0), 0, body.as_bytes(), 98);
        }
        for (media, name) in operation.media_types.iter().enumerate() {
            let body: &[u8] = match name.as_str() {
                "application/x-matrix-market" => PATH.as_bytes(),
                "model/off" => OCTAHEDRON.as_bytes(),
                "application/octet-stream" => &[0; 48],
                "application/json" => b"{}",
                _ => b"?",
            };
            add(at, media, 0, body, 99);
        }
    }
    seeds
}

/// The mesh on the server: 42 vertices, 80 faces.
fn sphere() -> TriangleMesh {
    generate(Shape::Sphere, 60).expect("a sphere")
}

/// Bodies for what the document shows none of that fits.
const MORE: [(&str, &str); 10] = [
    ("project", r#"{"functions": "coordinates", "reconstruct": true}"#),
    ("reconstruct", r#"{"columns": 1, "values": [1, 0, 0, 0, 0, 0, 0, 0, 0, 0.5]}"#),
    ("design", r#"{"constraints": [{"face": 3, "direction": [0, 0, 1]}], "strokes": []}"#),
    ("hatching", r#"{"field": {"eigenfield": 0}, "spacing": 0.2}"#),
    ("meshes/{id}/distances", r#"{"distance": {"kind": "geodesic"}, "sources": [3, 20]}"#),
    ("similar-points", r#"{"count": 5, "signature": {"kind": "wave_kernel", "count": 40}, "vertex": 3}"#),
    ("fur", r#"{"field": {"design": {}}, "length": 0.1, "tilt": 1.0}"#),
    ("shape-comparisons", r#"{"bases": ["@0", "@1"], "count": 5, "dimensions": 1}"#),
    ("jobs", r#"{"kind": "map_collection", "bases": ["@1", "@7"]}"#),
    ("map-collections", r#"{"bases": ["@1", "@7"], "pairs": 8, "start": 5}"#),
];

const OCTAHEDRON: &str = "OFF\n6 8 0\n1 0 0\n-1 0 0\n0 1 0\n0 -1 0\n0 0 1\n0 0 -1\n\
    3 0 2 4\n3 2 1 4\n3 1 3 4\n3 3 0 4\n3 2 0 5\n3 1 2 5\n3 3 1 5\n3 0 3 5\n";
const PATH: &str = "%%MatrixMarket matrix coordinate real symmetric\n5 5 9\n1 1 1\n2 2 2\n3 3 2\n4 4 2\n5 5 1\n\
    2 1 -1\n3 2 -1\n4 3 -1\n5 4 -1\n";

/// The bases there are on the mesh and of the problem; behind them comes one on another mesh.
const BASES: [(&str, &str); 7] = [
    ("eigenbasis", r#"{"count": 10}"#),
    ("eigenbasis", r#"{"count": 12, "method": "hsim", "precision": "f64"}"#),
    ("eigenbasis", r#"{"count": 4, "method": "hsim", "operator": "hodge"}"#),
    ("field_basis", r#"{"dimension": 20}"#),
    ("operator_family", r#"{"dimension": 20}"#),
    ("vibration_basis", r#"{"count": 8, "thickness": 0.01}"#),
    ("pencil_basis", r#"{"count": 3}"#),
];

async fn send(
    router: &Router,
    method: &str,
    path: &str,
    media: &str,
    body: Vec<u8>,
) -> (StatusCode, Option<String>, Vec<u8>) {
    let request = Request::builder().method(method).uri(path).header(header::HOST, "localhost");
    let request = request.header(header::CONTENT_TYPE, media).body(Body::from(body)).expect("a request");
    let answer = TowerToHyperService::new(router.clone()).call(request).await.expect("a router does not fail");
    let (status, headers) = (answer.status(), answer.headers().clone());
    let media = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).map(str::to_owned);
    let bytes = to_bytes(answer.into_body(), usize::MAX).await.expect("answers come whole");
    (status, media, bytes.to_vec())
}

async fn ask(router: &Router, method: &str, path: &str, media: &str, body: Vec<u8>) -> Value {
    let (status, _, answer) = send(router, method, path, media, body).await;
    assert!(status.is_success(), "{method} {path}: {status} {}", String::from_utf8_lossy(&answer));
    serde_json::from_slice(&answer).unwrap_or_default()
}

async fn start() -> (Router, Names) {
    let folder = tempfile::tempdir().expect("a folder").keep();
    let config = Config { data: folder.clone(), least_free_bytes: 0, cache_bytes: 64 << 20, ..Config::default() };
    let store = Store::open(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(&folder) }).await.expect("a store");
    let pool = WorkerPool::start(store.clone(), WorkerOptions::default(), Arc::new(Solver), Arc::new(Unobserved));
    let metrics = Arc::new(Metrics::new().expect("metrics"));
    let router = http::router(AppState::new(store, config, metrics, || true).expect("a state"));
    let mut ply = Vec::new();
    write_ply(&sphere(), None, &mut ply).expect("memory takes all");
    let id = |value: &Value| value["id"].as_str().expect("an identifier").to_owned();
    let mesh = id(&ask(&router, "POST", "/v1/meshes?format=ply", "model/ply", ply).await);
    let mut other = sphere();
    other.positions.iter_mut().for_each(|at| at[2] *= 1.5);
    let mut ply = Vec::new();
    write_ply(&other, None, &mut ply).expect("memory takes all");
    let other = id(&ask(&router, "POST", "/v1/meshes?format=ply", "model/ply", ply).await);
    let pencil = id(&ask(&router, "POST", "/v1/problems", "application/x-matrix-market", PATH.into()).await);
    let field = json!({"columns": 1, "values": vec![0.25; sphere().faces.len()]}).to_string();
    let field = id(&ask(&router, "POST", &format!("/v1/meshes/{mesh}/fields"), "application/json", field.into()).await);
    let mut bases = Vec::new();
    let on_other = ("eigenbasis", r#"{"count": 10}"#, &other);
    let all = BASES.iter().map(|&(kind, parameters)| (kind, parameters, &mesh)).chain([on_other]);
    for (kind, parameters, mesh) in all {
        let parameters: Value = serde_json::from_str(parameters).expect("parameters are JSON");
        let mut job = json!({"kind": kind, "parameters": parameters});
        let (on, name) = if kind == "pencil_basis" { ("pencil", &pencil) } else { ("mesh", mesh) };
        job[on] = name.clone().into();
        let job = id(&ask(&router, "POST", "/v1/jobs", "application/json", job.to_string().into()).await);
        // On a busy machine a job may take longer than a request waits for it.
        let job = loop {
            let shown = ask(&router, "GET", &format!("/v1/jobs/{job}?wait=60s"), "application/json", Vec::new()).await;
            if !matches!(shown["status"].as_str(), Some("enqueued" | "processing")) {
                break shown;
            }
        };
        bases.push(job["basis"].as_str().unwrap_or_else(|| panic!("{job}")).to_owned());
    }
    // From here on jobs are taken and never begun.
    pool.drain(Duration::from_secs(5)).await;
    (router, Names { mesh, pencil, field, bases })
}

fn server() -> &'static Server {
    static SERVER: OnceLock<Server> = OnceLock::new();
    SERVER.get_or_init(|| {
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a runtime");
        let (router, names) = runtime.block_on(start());
        Server { runtime, router, operations: operations(), names }
    })
}

/// Sends a request: bytes for the operation, the media type and the basis, a query, a zero, a body. The answer is no
/// fault of the server's, and what is refused is so in a problem's form. Gives the operation and its status, where a
/// request was made of the bytes.
pub fn send_body(bytes: &[u8]) -> Option<(String, StatusCode)> {
    let [operation, media, basis, rest @ ..] = bytes else { return None };
    let end = rest.iter().position(|&byte| byte == 0)?;
    let server = server();
    let operation = &server.operations[usize::from(*operation) % server.operations.len()];
    let media = &operation.media_types[usize::from(*media) % operation.media_types.len()];
    let own = match operation.path.as_str() {
        path if path.starts_with("/v1/meshes") => &server.names.mesh,
        path if path.starts_with("/v1/problems") => &server.names.pencil,
        path if path.starts_with("/v1/fields") => &server.names.field,
        _ => &server.names.bases[usize::from(*basis) % server.names.bases.len()],
    };
    let mut path = operation.path.replace("{id}", own);
    let query = server.names.fill(&rest[..end]);
    if !query.is_empty() {
        let escaped = query.iter().map(|&byte| match byte {
            b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' | b'=' | b'&' | b'-' | b'.' | b'_' | b'%' => {
                (byte as char).to_string()
            }
            other => format!("%{other:02X}"),
        });
        path = format!("{path}?{}", escaped.collect::<String>());
    }
    let media = match media.as_str() {
        "multipart/form-data" => "multipart/form-data; boundary=x",
        other => other,
    };
    let body = server.names.fill(&rest[end + 1..]);
    let status = server.runtime.block_on(async {
        let (status, kind, answer) = send(&server.router, &operation.method, &path, media, body).await;
        assert!(!status.is_server_error(), "{path}: {status} {}", String::from_utf8_lossy(&answer));
        if !status.is_success() {
            assert_eq!(kind.as_deref(), Some("application/problem+json"), "{path}: {status}");
        }
        // What was stored goes again, so that there is always room for more.
        let made: Value = serde_json::from_slice(&answer).unwrap_or_default();
        let Some(made) =
            made["id"].as_str().filter(|_| status == StatusCode::ACCEPTED || status == StatusCode::CREATED)
        else {
            return status;
        };
        if ["/v1/jobs", "/v1/meshes", "/v1/problems"].contains(&operation.path.as_str()) {
            let path = format!("{}/{made}", operation.path);
            if operation.path == "/v1/jobs" {
                ask(&server.router, "POST", &format!("{path}/cancel"), "application/json", Vec::new()).await;
            }
            ask(&server.router, "DELETE", &path, "application/json", Vec::new()).await;
        }
        if operation.path.ends_with("/fields") || operation.path.ends_with("/designs") {
            ask(&server.router, "DELETE", &format!("/v1/fields/{made}"), "application/json", Vec::new()).await;
        }
        status
    });
    Some((format!("{} {}", operation.method, operation.path), status))
}
