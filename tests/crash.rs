//! The real server is killed at named points while jobs run, and started again. Whatever happens: no acknowledged job is
//! lost, no basis is half visible, content verifies, attempts are bounded.
#![cfg(unix)]

use std::{
    collections::HashMap,
    fmt::Write as _,
    io::{BufRead, BufReader},
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{Child, Command, ExitStatus, Stdio},
    sync::{Arc, atomic::AtomicI64},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use chladni::store::{
    BasisFilter, Clock, JobFilter, JobRecord, JobStatus, PageRequest, Store, StoreOptions,
    fault::{FailPoint, Faults},
};
use serde_json::{Value, json};

const SIGKILL: i32 = 9;
const PATIENCE: Duration = Duration::from_secs(120);

/// A server process of its own.
struct Server {
    process: Child,
    url: String,
    client: reqwest::Client,
}

impl Server {
    fn start(folder: &Path, settings: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
            .args([
                "serve",
                "--listen",
                "127.0.0.1:0",
                "--threads",
                "1",
                "--least-free-bytes",
                "0",
                "--log-level",
                "error",
            ])
            .arg("--data")
            .arg(folder)
            .args(settings)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line:?}")).to_owned();
        Self { process, url, client: reqwest::Client::new() }
    }

    async fn upload(&self) -> String {
        let answer = self.client.post(format!("{}/v1/meshes?format=off", self.url)).body(torus()).send().await.unwrap();
        assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
        answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned()
    }

    /// Asks for a basis of so many functions; the job's identifier if the server lived to acknowledge it.
    async fn submit(&self, mesh: &str, count: usize) -> Option<String> {
        self.submit_with(mesh, json!({"count": count})).await
    }

    async fn submit_with(&self, mesh: &str, parameters: Value) -> Option<String> {
        let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": parameters});
        let answer = self.client.post(format!("{}/v1/jobs", self.url)).json(&request).send().await.ok()?;
        let status = answer.status();
        let job = answer.json::<Value>().await.ok()?;
        assert!(status.is_success(), "{status}: {job}");
        Some(job["id"].as_str().unwrap().to_owned())
    }

    async fn job(&self, id: &str) -> Value {
        let answer = self.client.get(format!("{}/v1/jobs/{id}?wait=5s", self.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "job {id} was acknowledged and is lost");
        answer.json().await.unwrap()
    }

    /// Waits until a job is finished.
    async fn finished(&self, id: &str) -> Value {
        let begun = Instant::now();
        loop {
            let job = self.job(id).await;
            if ["succeeded", "failed", "canceled"].contains(&job["status"].as_str().unwrap()) {
                return job;
            }
            assert!(begun.elapsed() < PATIENCE, "{job}");
        }
    }

    /// Waits until the process has ended by itself.
    fn ended(mut self) -> ExitStatus {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().unwrap() {
                return status;
            }
            assert!(begun.elapsed() < PATIENCE, "the server is still alive");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // A test that failed leaves no server behind; one that has ended already is no trouble.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A torus of 24 × 12 vertices as OFF.
fn torus() -> String {
    let (around, across) = (24, 12);
    let mut text = format!("OFF\n{} {} 0\n", around * across, 2 * around * across);
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (std::f64::consts::TAU * i as f64 / 24.0, std::f64::consts::TAU * j as f64 / 12.0);
            let radius = 2.0 + 0.7 * v.cos();
            writeln!(text, "{} {} {}", radius * u.cos(), radius * u.sin(), 0.7 * v.sin()).unwrap();
        }
    }
    let vertex = |i: usize, j: usize| (i % around) * across + j % across;
    for i in 0..around {
        for j in 0..across {
            let (a, b, c, d) = (vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1));
            writeln!(text, "3 {a} {b} {c}\n3 {a} {c} {d}").unwrap();
        }
    }
    text
}

/// Opens the folder after the server is gone and checks everything that must hold of what is stored.
async fn check(folder: &Path) -> Vec<JobRecord> {
    let store = Store::open(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(folder) }).await.unwrap();
    let page = PageRequest { limit: PageRequest::MOST, from: None };
    let jobs = store.jobs(&JobFilter::default(), &page).await.unwrap().items;
    let bases = store.bases(&BasisFilter::default(), &page).await.unwrap().items;
    let mut content = HashMap::new();
    for mesh in store.meshes(&page).await.unwrap().items {
        store.load_mesh(&mesh.id).await.unwrap();
        content.insert(mesh.content_hash, mesh.bytes);
    }
    for job in &jobs {
        assert!(job.attempt <= job.max_attempts);
        assert_eq!(job.status == JobStatus::Succeeded, job.basis.is_some(), "{job:?}");
        assert_ne!(job.status, JobStatus::Processing, "nobody works on it any more");
    }
    for basis in bases {
        let job = jobs.iter().find(|job| job.id == basis.job).unwrap();
        assert_eq!((job.status, job.basis), (JobStatus::Succeeded, Some(basis.id)));
        // Loading verifies the hash.
        let loaded = store.load_basis(basis.id).await.unwrap();
        assert_eq!((loaded.count() as u64, loaded.vertices() as u64), (basis.count, basis.vertices));
        assert_eq!(loaded.eigenvalues, basis.eigenvalues);
        // Columns of a dense basis are verified when they are read.
        let whole = tokio::task::spawn_blocking(move || loaded.lift::<f32>(0..loaded.count())).await.unwrap();
        assert!(whole.unwrap().iter().all(|value| value.is_finite()));
        content.insert(basis.content_hash, basis.bytes);
    }
    assert!(store.health().await.writable);
    store.close().await;
    drop(store);
    // Content that nothing refers to is gone an hour after it was first seen.
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap() + Duration::from_secs(3601);
    let later = Clock::manual(Arc::new(AtomicI64::new(now.as_millis() as i64)));
    let store =
        Store::open(StoreOptions { least_free_bytes: 0, clock: later, ..StoreOptions::new(folder) }).await.unwrap();
    let health = store.health().await;
    assert_eq!(health.blob_bytes, content.values().sum::<u64>(), "content that nothing refers to is gone");
    store.close().await;
    jobs
}

#[tokio::test]
async fn a_kill_at_any_point_loses_nothing() {
    for point in FailPoint::ALL {
        let folder = tempfile::tempdir().unwrap();
        let server = Server::start(folder.path(), &[]);
        let mesh = server.upload().await;
        server.kill();

        let passes = if point == FailPoint::MidRun { 5 } else { 0 };
        let fault = format!("{}:kill:{passes}", point.name());
        assert!(Faults::parse(&fault).is_ok());
        let server = Server::start(folder.path(), &["--fault", &fault]);
        let mut acknowledged = Vec::new();
        for count in [6, 8, 10] {
            acknowledged.extend(server.submit(&mesh, count).await);
        }
        let status = server.ended();
        assert_eq!(status.signal(), Some(SIGKILL), "{}: {status}", point.name());

        let after = check(folder.path()).await;
        for id in &acknowledged {
            assert!(after.iter().any(|job| job.id.to_string() == *id), "{}: job {id} is lost", point.name());
        }
        let succeeded = after.iter().filter(|job| job.status == JobStatus::Succeeded).count();
        assert_eq!(succeeded, usize::from(point == FailPoint::AfterComplete), "{}", point.name());
        assert!(after.iter().all(|job| job.attempt <= 1));

        let server = Server::start(folder.path(), &[]);
        for job in &after {
            let job = server.finished(&job.id.to_string()).await;
            assert_eq!(job["status"], "succeeded", "{}: {job}", point.name());
            assert!(job["attempt"].as_u64().unwrap() <= 2, "{}: {job}", point.name());
        }
        server.kill();
        let end = check(folder.path()).await;
        assert_eq!(end.len(), after.len(), "{}", point.name());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_kill_while_columns_are_written_leaves_no_half_of_them() {
    for point in [FailPoint::BeforeChunks, FailPoint::MidChunks, FailPoint::BeforeBlobReady, FailPoint::BeforeComplete]
    {
        let folder = tempfile::tempdir().unwrap();
        let server = Server::start(folder.path(), &[]);
        let mesh = server.upload().await;
        server.kill();
        let fault = format!("{}:kill", point.name());
        let server = Server::start(folder.path(), &["--fault", &fault]);
        let parameters = json!({"method": "hsim", "count": 40, "precision": "f64"});
        let acknowledged = server.submit_with(&mesh, parameters).await;
        assert_eq!(server.ended().signal(), Some(SIGKILL), "{}", point.name());
        let after = check(folder.path()).await;
        assert_eq!((after.len(), after[0].status), (1, JobStatus::Enqueued), "{}", point.name());
        assert!(acknowledged.is_none_or(|id| id == after[0].id.to_string()));
        let server = Server::start(folder.path(), &[]);
        let job = server.finished(&after[0].id.to_string()).await;
        assert_eq!(job["status"], "succeeded", "{}: {job}", point.name());
        server.kill();
        let end = check(folder.path()).await;
        assert_eq!(end[0].status, JobStatus::Succeeded);
    }
}

#[tokio::test]
async fn a_job_that_kills_every_server_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    let mesh = server.upload().await;
    server.kill();
    let settings = ["--fault", "mid-run:kill", "--max-attempts", "2"];
    let server = Server::start(folder.path(), &settings);
    // The server may be gone before its answer arrives; the job is on record all the same.
    server.submit(&mesh, 6).await;
    assert_eq!(server.ended().signal(), Some(SIGKILL));
    let server = Server::start(folder.path(), &settings);
    assert_eq!(server.ended().signal(), Some(SIGKILL), "it took the job up again");
    let server = Server::start(folder.path(), &settings);
    let jobs =
        server.client.get(format!("{}/v1/jobs", server.url)).send().await.unwrap().json::<Value>().await.unwrap();
    let job = server.finished(jobs["items"][0]["id"].as_str().unwrap()).await;
    assert_eq!((job["status"].as_str(), job["attempt"].as_u64()), (Some("failed"), Some(2)), "{job}");
    assert!(job["problem"].to_string().contains("worker-lost"), "{job}");
    server.kill();
    check(folder.path()).await;
}

#[tokio::test]
async fn kills_at_any_time_lose_no_acknowledged_job() {
    let folder = tempfile::tempdir().unwrap();
    let settings = ["--max-attempts", "20", "--workers", "2"];
    let mut acknowledged = Vec::new();
    let mut mesh = None;
    for round in 0..5u64 {
        let server = Server::start(folder.path(), &settings);
        let known = match &mesh {
            Some(known) => String::clone(known),
            None => mesh.insert(server.upload().await).clone(),
        };
        for count in 0..4 {
            acknowledged.extend(server.submit(&known, 6 + 4 * round as usize + count).await);
        }
        tokio::time::sleep(Duration::from_millis(7 * round * round)).await;
        server.kill();
    }
    let jobs = check(folder.path()).await;
    for id in &acknowledged {
        assert!(jobs.iter().any(|job| job.id.to_string() == *id), "job {id} is lost");
    }
    let server = Server::start(folder.path(), &settings);
    for id in &acknowledged {
        assert_eq!(server.finished(id).await["status"], "succeeded");
    }
    server.kill();
    assert_eq!(check(folder.path()).await.len(), 20);
}

#[tokio::test]
async fn a_server_that_is_told_to_stop_gives_a_hanging_job_back() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &["--fault", "mid-run:stall", "--drain-seconds", "0.5"]);
    let mesh = server.upload().await;
    let id = server.submit(&mesh, 6).await.unwrap();
    let begun = Instant::now();
    while server.job(&id).await["status"] != "processing" {
        assert!(begun.elapsed() < PATIENCE);
    }
    let process = rustix::process::Pid::from_child(&server.process);
    rustix::process::kill_process(process, rustix::process::Signal::TERM).unwrap();
    let status = server.ended();
    assert!(status.success(), "{status}");
    let jobs = check(folder.path()).await;
    assert_eq!((jobs[0].status, jobs[0].attempt), (JobStatus::Enqueued, 0));
}
