//! Two servers and their workers, as processes of their own, share a PostgreSQL and a store of objects. Workers are killed at every point.
#![cfg(all(unix, feature = "cluster"))]

#[path = "common/postgres.rs"]
mod postgres;
mod process;

use std::{
    io::{BufRead, BufReader},
    os::unix::process::ExitStatusExt,
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use chladni::store::{
    BasisFilter, JobFilter, JobStatus, PageRequest, SharedPlaces, Store, StoreOptions,
    fault::{FailPoint, Faults},
};
use process::{PATIENCE, Server};
use serde_json::Value;
use tempfile::TempDir;

const SIGKILL: i32 = 9;
const LEASE: Duration = Duration::from_secs(3);

/// Where processes share what they have.
struct Places {
    database: String,
    objects: String,
    folder: TempDir,
}

impl Places {
    /// Fresh ones; `None` where PostgreSQL is not installed, which is said.
    fn new() -> Option<Self> {
        let server = postgres::server()?;
        let folder = tempfile::tempdir().unwrap();
        let objects = format!("file://{}", folder.path().join("objects").display());
        Some(Self { database: server.database_of(folder.path()), objects, folder })
    }

    fn settings(&self) -> [&str; 6] {
        ["--database", &self.database, "--objects", &self.objects, "--lease-seconds", "3"]
    }

    /// A server that leaves jobs to others. A data folder is none of its business.
    fn server(&self) -> Server {
        let nowhere = Path::new("/nonexistent/chladni-data");
        Server::start(nowhere, &[&self.settings()[..], &["--workers", "0"]].concat())
    }

    fn worker(&self, settings: &[&str]) -> Worker {
        Worker::start(&[&self.settings()[..], settings].concat())
    }

    /// Looks at everything that must hold of what is stored.
    async fn check(&self) -> usize {
        let shared = SharedPlaces { database: self.database.clone(), objects: self.objects.clone() };
        let options = StoreOptions { shared: Some(shared), ..StoreOptions::new(self.folder.path()) };
        let store = Store::open(options).await.unwrap();
        let page = PageRequest { limit: PageRequest::MOST, from: None };
        let jobs = store.jobs(&JobFilter::default(), &page).await.unwrap().items;
        let bases = store.bases(&BasisFilter::default(), &page).await.unwrap().items;
        for job in &jobs {
            assert!(job.attempt <= job.max_attempts);
            assert_eq!(job.status == JobStatus::Succeeded, job.basis.is_some(), "{job:?}");
        }
        for basis in &bases {
            let job = jobs.iter().find(|job| job.id == basis.job).unwrap();
            assert_eq!((job.status, job.basis), (JobStatus::Succeeded, Some(basis.id)));
            // Loading verifies the hash.
            assert_eq!(store.load_basis(basis.id).await.unwrap().eigenvalues, basis.eigenvalues);
        }
        assert_eq!(bases.len(), jobs.iter().filter(|job| job.basis.is_some()).count());
        let examined = store.examine(false).await.unwrap();
        assert!(examined.findings.iter().all(|finding| finding.what.contains("nothing refers to it")), "{examined:?}");
        store.close().await;
        jobs.len()
    }
}

/// A worker process.
struct Worker(Child);

impl Worker {
    fn start(settings: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
            .args(["worker", "--threads", "1", "--gpu", "off", "--log-level", "error", "--heartbeat-seconds", "0.2"])
            .args(settings)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, "working\n");
        Self(process)
    }

    /// Waits until the process has ended by itself, and says how.
    fn ended(mut self) -> Option<i32> {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                return status.signal();
            }
            assert!(begun.elapsed() < PATIENCE, "the worker is still alive");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn signal(&self, signal: rustix::process::Signal) {
        rustix::process::kill_process(rustix::process::Pid::from_child(&self.0), signal).unwrap();
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_servers_and_two_workers_are_one_service() {
    let Some(places) = Places::new() else { return };
    let (one, two) = (places.server(), places.server());
    let _workers = [places.worker(&[]), places.worker(&[])];
    let mesh = one.upload().await;
    let mut jobs = Vec::new();
    for count in 4..16 {
        let server = if count % 2 == 0 { &one } else { &two };
        jobs.push(server.submit(&mesh, count).await.unwrap());
    }
    // Equal work is one job, whichever server is asked.
    assert_eq!(two.submit(&mesh, 4).await.as_ref(), Some(&jobs[0]));
    for (place, job) in jobs.iter().enumerate() {
        let other = if place % 2 == 0 { &two } else { &one };
        // A server that hears nothing of the other's jobs answers after a minute with what it saw at first.
        let answer = other.client.get(format!("{}/v1/jobs/{job}?wait=60s", other.url)).send().await.unwrap();
        let answer: Value = answer.json().await.unwrap();
        assert_eq!(answer["status"], "succeeded", "{answer}");
    }
    // The events of a job that one server was asked for, from the other.
    let job = one.submit(&mesh, 20).await.unwrap();
    let events = two.client.get(format!("{}/v1/jobs/{job}/events", two.url)).send().await.unwrap();
    let events = tokio::time::timeout(PATIENCE, events.text()).await.unwrap().unwrap();
    assert!(events.contains("\"status\":\"succeeded\""), "{events}");
    // Content comes from either, byte for byte the same.
    let basis = one.finished(&job).await["basis"].as_str().unwrap().to_owned();
    let mut contents = Vec::new();
    for server in [&one, &two] {
        let answer = server.client.get(format!("{}/v1/bases/{basis}/content", server.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
        contents.push(answer.bytes().await.unwrap());
    }
    assert!(contents[0] == contents[1] && contents[0].starts_with(b"PK"));
    // A job that waits is cancelled by the other server.
    assert_eq!(places.check().await, 13);
    one.stop();
    two.stop();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_job_of_a_killed_worker_is_made_good_by_another() {
    let Some(places) = Places::new() else { return };
    let server = places.server();
    let mesh = server.upload().await;
    let points = FailPoint::ALL.into_iter().filter(|&point| point != FailPoint::AfterEnqueue);
    for (place, point) in points.enumerate() {
        let passes = if point == FailPoint::MidRun { 5 } else { 0 };
        let fault = format!("{}:kill:{passes}", point.name());
        assert!(Faults::parse(&fault).is_ok());
        let doomed = places.worker(&["--fault", &fault]);
        let job = server.submit(&mesh, 6 + place).await.unwrap();
        assert_eq!(doomed.ended(), Some(SIGKILL), "{}", point.name());
        let died = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        let heir = places.worker(&[]);
        let done = server.finished(&job).await;
        assert_eq!(done["status"], "succeeded", "{}: {done}", point.name());
        let attempts = if point == FailPoint::AfterComplete { 1 } else { 2 };
        assert_eq!(done["attempt"], attempts, "{}: {done}", point.name());
        if attempts == 2 {
            let since = done["started_ms"].as_f64().unwrap() / 1e3 - died.as_secs_f64();
            println!("{}: begun again {since:.2} s after the death", point.name());
            assert!(since <= LEASE.as_secs_f64() + 3.0, "{}: {since} s", point.name());
        }
        heir.signal(rustix::process::Signal::TERM);
        assert_eq!(heir.ended(), None);
    }
    assert_eq!(places.check().await, 8);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_was_stopped_for_too_long_changes_nothing() {
    let Some(places) = Places::new() else { return };
    let server = places.server();
    let mesh = server.upload().await;
    // It hangs after the claim, in a process that is stopped before it wakes.
    let zombie = places.worker(&["--fault", "before-chunks:stall"]);
    let job = server.submit(&mesh, 9).await.unwrap();
    let begun = Instant::now();
    while server.job_now(&job).await["status"] != "processing" {
        assert!(begun.elapsed() < PATIENCE);
    }
    zombie.signal(rustix::process::Signal::STOP);
    let _heir = places.worker(&[]);
    let done = server.finished(&job).await;
    assert_eq!((&done["status"], &done["attempt"]), (&"succeeded".into(), &2.into()), "{done}");
    zombie.signal(rustix::process::Signal::CONT);
    // Its heartbeat comes back and finds that the job is another's.
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert_eq!(server.job_now(&job).await, done);
    assert_eq!(places.check().await, 1);
}

#[test]
fn a_worker_says_what_it_needs() {
    let told = |arguments: &[&str]| String::from_utf8(process::chladni(arguments).stderr).unwrap();
    assert!(told(&["worker"]).contains("--database"));
    assert!(told(&["serve", "--workers", "0"]).contains("nobody would run jobs"));
    let unknown = ["worker", "--kinds", "juggling", "--database", "postgres://h/d", "--objects", "file:///tmp/x"];
    assert!(told(&unknown).contains("juggling"));
}
