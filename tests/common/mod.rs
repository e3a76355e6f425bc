//! A real server on a port of its own, for tests. Dropping it drains the server and checks that no job is left
//! unfinished.
#![allow(dead_code)]

pub mod cryptography;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use chladni::config::Config;
use chladni::http::{self, AppState};
use chladni::queue::{JobFailure, Outcome, Runner, Unobserved, WorkerOptions, WorkerPool};
use chladni::store::{JobRecord, Store, StoreOptions};
use chladni::telemetry::Metrics;
use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use chladni_spectral::basis::{
    Basis, Certificate, Compact, DenseFunctions, Functions, InertiaCount, LevelReport, Precision,
};
use serde_json::{Value, json};
use tokio::sync::oneshot;

/// What a test may change before its server starts.
pub struct Builder {
    pub config: Config,
    pub runner: Arc<dyn Runner>,
    /// Set to make the worker pool look dead.
    pub workers_dead: Arc<AtomicBool>,
}

impl Builder {
    /// Starts the server; its settings, store and port are its own.
    pub fn start(self) -> TestApp {
        self.start_in(tempfile::tempdir().unwrap())
    }

    /// Starts the server in a folder that another one may have used.
    pub fn start_in(mut self, folder: tempfile::TempDir) -> TestApp {
        self.config.data = folder.path().to_owned();
        let (ready, started) = mpsc::channel();
        let (stop, stopped) = oneshot::channel();
        let server = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            runtime.block_on(run(self, ready, stopped))
        });
        let (address, state) = started.recv().expect("the server starts");
        TestApp {
            address,
            state,
            client: cryptography::client(),
            stop: Some(stop),
            server: Some(server),
            folder: Some(folder),
        }
    }
}

async fn run(
    Builder { config, runner, workers_dead }: Builder,
    ready: mpsc::Sender<(SocketAddr, AppState)>,
    stopped: oneshot::Receiver<()>,
) -> Vec<String> {
    let mut options = StoreOptions::new(&config.data);
    options.cache_bytes = config.cache_bytes;
    options.least_free_bytes = config.least_free_bytes;
    options.queued_jobs_limit = Some(config.limits.max_queued_jobs as u64);
    let store = Store::open(options).await.unwrap();
    let workers = WorkerOptions {
        workers: config.workers,
        threads: config.threads,
        lease: config.lease_seconds,
        heartbeat: config.heartbeat_seconds,
        stall: config.stall_seconds,
        memory: if config.memory_bytes == 0 { u64::MAX } else { config.memory_bytes },
        ..WorkerOptions::default()
    };
    let pool = Arc::new(WorkerPool::start(store.clone(), workers, runner, Arc::new(Unobserved)));
    let alive = pool.clone();
    let drain = config.drain_seconds;
    let metrics = Arc::new(Metrics::new().unwrap());
    let alive = move || alive.alive() && !workers_dead.load(Ordering::Relaxed);
    let state = AppState::new(store.clone(), config, metrics, alive).unwrap();
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    ready.send((listener.local_addr().unwrap(), state.clone())).unwrap();
    http::serve(listener, state, async {
        let _ = stopped.await;
    })
    .await
    .unwrap();
    let mut left = Vec::new();
    for (kind, status, count) in store.job_counts().await.unwrap() {
        if count > 0 && !status.is_finished() {
            left.push(format!("{count} jobs of kind {kind} are {status}"));
        }
    }
    pool.drain(drain).await;
    store.close().await;
    left
}

/// A running server and a client for it.
pub struct TestApp {
    pub address: SocketAddr,
    /// What its requests share.
    pub state: AppState,
    pub client: reqwest::Client,
    stop: Option<oneshot::Sender<()>>,
    server: Option<JoinHandle<Vec<String>>>,
    folder: Option<tempfile::TempDir>,
}

impl TestApp {
    /// A server with the settings of a test: small, quick to drain, jobs that do nothing slow unless asked to.
    pub fn builder() -> Builder {
        let config = Config {
            drain_seconds: Duration::from_secs(5),
            heartbeat_seconds: Duration::from_millis(100),
            least_free_bytes: 0,
            cache_bytes: 64 << 20,
            ..Config::default()
        };
        Builder { config, runner: Arc::new(Scripted), workers_dead: Arc::default() }
    }

    pub fn start() -> Self {
        Self::builder().start()
    }

    /// Stops the server and gives its folder.
    pub fn stop(mut self) -> tempfile::TempDir {
        self.folder.take().expect("a server has a folder")
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub fn get(&self, path: &str) -> reqwest::RequestBuilder {
        self.client.get(self.url(path))
    }

    pub fn post(&self, path: &str) -> reqwest::RequestBuilder {
        self.client.post(self.url(path))
    }

    pub fn delete(&self, path: &str) -> reqwest::RequestBuilder {
        self.client.delete(self.url(path))
    }

    /// Uploads a mesh and gives its resource.
    pub async fn upload(&self, format: &str, bytes: impl Into<reqwest::Body>) -> Value {
        let response = self.post(&format!("/v1/meshes?format={format}")).body(bytes).send().await.unwrap();
        let status = response.status();
        let value: Value = response.json().await.unwrap();
        assert!(status.is_success(), "{status}: {value}");
        value
    }

    /// Uploads a small octahedron and gives its id.
    pub async fn octahedron(&self) -> String {
        text(&self.upload("off", OCTAHEDRON).await["id"])
    }

    /// Uploads a sphere of 200 vertices or so, and gives its id and the number of its vertices.
    pub async fn sphere(&self) -> (String, usize) {
        let mesh = generate(Shape::Sphere, 200).unwrap();
        let mut bytes = Vec::new();
        write_ply(&mesh, None, &mut bytes).unwrap();
        (text(&self.upload("ply", bytes).await["id"]), mesh.positions.len())
    }

    /// A dense basis of so many functions on a sphere: its id, and the number of vertices.
    pub async fn dense_basis(&self, count: usize, precision: &str) -> (String, usize) {
        let (mesh, n) = self.sphere().await;
        let parameters = json!({"method": "hsim", "count": count, "precision": precision});
        let job = self.submit(&mesh, parameters).await;
        let job = self.finished(&text(&job["id"])).await;
        assert_eq!(job["status"], "succeeded", "{job}");
        (text(&job["basis"]), n)
    }

    /// Submits a job and gives its resource.
    pub async fn submit(&self, mesh: &str, parameters: Value) -> Value {
        let body = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
        let response = self.post("/v1/jobs").json(&body).send().await.unwrap();
        let status = response.status();
        let value: Value = response.json().await.unwrap();
        assert!(status.is_success(), "{status}: {value}");
        value
    }

    /// Waits until a job has ended.
    pub async fn finished(&self, job: &str) -> Value {
        let begin = Instant::now();
        loop {
            let job: Value = self.get(&format!("/v1/jobs/{job}?wait=20s")).send().await.unwrap().json().await.unwrap();
            if ["succeeded", "failed", "canceled"].contains(&job["status"].as_str().unwrap()) {
                return job;
            }
            assert!(begin.elapsed() < Duration::from_secs(120), "the job does not end: {job}");
        }
    }

    /// A basis on the octahedron: its id.
    pub async fn basis(&self) -> String {
        let mesh = self.octahedron().await;
        let job = self.submit(&mesh, json!({"count": 3})).await;
        let job = self.finished(&text(&job["id"])).await;
        assert_eq!(job["status"], "succeeded", "{job}");
        text(&job["basis"])
    }
}

impl Drop for TestApp {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        let left = self.server.take().map(JoinHandle::join);
        if std::thread::panicking() {
            return;
        }
        let left = left.unwrap().expect("the server ends without a panic");
        assert!(left.is_empty(), "unfinished jobs are left: {left:?}");
    }
}

/// A member that is a string.
pub fn text(value: &Value) -> String {
    value.as_str().unwrap_or_else(|| panic!("{value} is not a string")).to_owned()
}

/// An octahedron with vertices at distance 1, as OFF.
pub const OCTAHEDRON: &str = "OFF\n6 8 0\n1 0 0\n-1 0 0\n0 1 0\n0 -1 0\n0 0 1\n0 0 -1\n\
    3 0 2 4\n3 2 1 4\n3 1 3 4\n3 3 0 4\n3 2 0 5\n3 1 2 5\n3 3 1 5\n3 0 3 5\n";

/// A runner whose jobs do what their seed says, so that tests of the API do not depend on a solver: seeds below 1000
/// succeed at once, 1000 panics, 1001 fails, larger ones run for that many milliseconds. The basis is the constant and
/// two more functions, orthonormal for unit masses.
pub struct Scripted;

/// Panics whenever it runs.
pub const PANICS: u64 = 1000;
/// Fails for good.
pub const FAILS: u64 = 1001;

impl Runner for Scripted {
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        let seed = job.parameters["seed"].as_u64().unwrap();
        monitor.stage("operator");
        match seed {
            PANICS => panic!("a scripted panic"),
            FAILS => {
                return Err(JobFailure::Failed {
                    kind: "scripted".into(),
                    detail: "This job was told to fail.".into(),
                    retryable: false,
                });
            }
            _ => {}
        }
        monitor.stage("basis");
        monitor.detail("level 2 of 3, slice 1 of 4");
        let begin = Instant::now();
        while seed > 1001 && begin.elapsed() < Duration::from_millis(seed) {
            monitor.checkpoint()?;
            monitor.progress(begin.elapsed().as_millis() as f64 / seed as f64);
            std::thread::sleep(Duration::from_millis(5));
        }
        let n = mesh.positions.len();
        let parameters = job.parameters.clone();
        Ok(Outcome::Product(if parameters["storage"] == "dense" {
            unit_basis(n, parameters).into()
        } else {
            plain_basis(n, parameters).into()
        }))
    }
}

/// Three M-orthonormal functions on `n` vertices of mass 1: each U column holds a third of the vertices.
pub fn plain_basis(n: usize, parameters: Value) -> Basis {
    let columns: Vec<u32> = (0..n).map(|v| (v % 3) as u32).collect();
    let sizes = [n.div_ceil(3), (n + 1) / 3, n / 3];
    let mut coefficients = DenseMatrix::zeros(3, 3);
    for (k, size) in sizes.iter().enumerate() {
        coefficients.column_mut(k)[k] = 1.0 / (*size as f64).sqrt();
    }
    Basis {
        functions: Functions::Compact(Compact::new(
            SparseMatrix::new(n, 3, (0..=n).collect(), columns, vec![1.0; n]).unwrap(),
            coefficients,
        )),
        eigenvalues: vec![0.0, 1.0, 2.0],
        mass: MassMatrix::Diagonal(vec![1.0; n]),
        certificate: Certificate {
            residuals: vec![0.0, 0.1, 0.2],
            bounds: vec![0.0, 0.01, 0.02],
            ..Certificate::default()
        },
        metadata: json!({"parameters": parameters, "operator": {"laplacian": "cotangent", "reason": "fair_mesh"}})
            .into(),
    }
}

/// A dense basis: function `k` is 1 at vertex `k` and 0 elsewhere, on `n` vertices of mass 1.
pub fn unit_basis(n: usize, parameters: Value) -> Basis {
    let count = parameters["count"].as_u64().unwrap() as usize;
    let precision = Precision::from_name(parameters["precision"].as_str().unwrap_or("f32")).unwrap();
    let mut columns = DenseMatrix::zeros(n, count);
    (0..count).for_each(|k| columns.column_mut(k)[k] = 1.0);
    Basis {
        functions: Functions::Dense(DenseFunctions::from_columns(&columns, precision)),
        eigenvalues: (0..count).map(|k| k as f64).collect(),
        mass: MassMatrix::Diagonal(vec![1.0; n]),
        certificate: Certificate {
            residuals: vec![1e-3; count],
            bounds: vec![1e-2; count],
            complete: Some(true),
            inertia: vec![InertiaCount { shift: count as f64 - 0.5, below: count }],
            tolerance: parameters["tolerance"].as_f64(),
            levels: vec![
                LevelReport { dimension: 50, iterations: 0, shifts: 0 },
                LevelReport { dimension: n, iterations: 2, shifts: 3 },
            ],
            ..Certificate::default()
        },
        metadata: json!({"parameters": parameters, "operator": {"laplacian": "robust", "reason": "non_manifold"}})
            .into(),
    }
}

/// The folder of the real meshes, where the environment names it.
pub fn meshes() -> Option<PathBuf> {
    let folder = std::env::var_os("CHLADNI_MESHES").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: CHLADNI_MESHES is not set");
    }
    folder
}

/// Checks that an answer is a problem of a kind, and gives it.
pub async fn problem(response: reqwest::Response, status: u16, kind: &str) -> Value {
    let found = response.status();
    let media_type = response.headers().get("content-type").map(|v| v.to_str().unwrap().to_owned());
    let body = response.text().await.unwrap();
    assert_eq!(found.as_u16(), status, "{body}");
    assert_eq!(media_type.as_deref(), Some("application/problem+json"), "{body}");
    let value: Value = serde_json::from_str(&body).unwrap();
    assert_eq!(value["type"], format!("/problems/{kind}"), "{value}");
    assert_eq!(value["status"], status, "{value}");
    assert!(!value["title"].as_str().unwrap().is_empty() && !value["detail"].as_str().unwrap().is_empty(), "{value}");
    value
}
