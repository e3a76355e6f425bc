//! The real server is killed at named points while jobs run, and started again. Whatever happens: no acknowledged job is
//! lost, no basis is half visible, content verifies, attempts are bounded.
#![cfg(unix)]

mod process;

use std::{
    collections::HashMap,
    os::unix::process::ExitStatusExt,
    path::Path,
    sync::{Arc, atomic::AtomicI64},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use chladni::store::{
    BasisFilter, Clock, JobFilter, JobRecord, JobStatus, PageRequest, Store, StoreOptions,
    fault::{FailPoint, Faults},
};
use process::{PATIENCE, Server};
use serde_json::{Value, json};

const SIGABRT: i32 = 6;
const SIGKILL: i32 = 9;

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
async fn a_job_that_crashes_its_server_twice_is_quarantined() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    let mesh = server.upload().await;
    server.kill();
    let settings = ["--fault", "mid-run:abort"];
    let server = Server::start(folder.path(), &settings);
    // The server may be gone before its answer arrives; the job is on record all the same.
    server.submit(&mesh, 6).await;
    assert_eq!(server.ended().signal(), Some(SIGABRT));
    let server = Server::start(folder.path(), &settings);
    assert_eq!(server.ended().signal(), Some(SIGABRT), "it took the job up again");
    let server = Server::start(folder.path(), &[]);
    let jobs =
        server.client.get(format!("{}/v1/jobs", server.url)).send().await.unwrap().json::<Value>().await.unwrap();
    let id = jobs["items"][0]["id"].as_str().unwrap();
    let job = server.finished(id).await;
    assert_eq!((job["status"].as_str(), job["attempt"].as_u64()), (Some("failed"), Some(1)), "{job}");
    assert!(job["problem"].to_string().contains("quarantined"), "{job}");
    // Whoever mends the cause has it tried again.
    let retried = server.client.post(format!("{}/v1/jobs/{id}/retry", server.url)).send().await.unwrap();
    assert!(retried.status().is_success());
    assert_eq!(server.finished(id).await["status"], "succeeded");
    server.kill();
    check(folder.path()).await;
}

#[tokio::test]
async fn a_job_survives_more_kills_of_its_server_than_it_has_attempts() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    let mesh = server.upload().await;
    server.kill();
    // It is at its first checkpoint, and stays there.
    let settings = ["--fault", "mid-run:stall", "--max-attempts", "1"];
    for round in 0..5 {
        let server = Server::start(folder.path(), &settings);
        server.submit(&mesh, 6).await.unwrap();
        let begun = Instant::now();
        loop {
            let jobs = server.client.get(format!("{}/v1/jobs", server.url)).send().await.unwrap();
            let jobs = jobs.json::<Value>().await.unwrap();
            assert_eq!(jobs["items"].as_array().unwrap().len(), 1, "round {round}");
            if jobs["items"][0]["status"] == "processing" {
                break;
            }
            assert!(begun.elapsed() < PATIENCE, "round {round}: {jobs}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        server.kill();
    }
    let jobs = check(folder.path()).await;
    assert_eq!((jobs[0].status, jobs[0].attempt), (JobStatus::Enqueued, 0));
    let server = Server::start(folder.path(), &["--max-attempts", "1"]);
    let job = server.finished(&jobs[0].id.to_string()).await;
    assert_eq!((job["status"].as_str(), job["attempt"].as_u64()), (Some("succeeded"), Some(1)), "{job}");
    server.kill();
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

/// What a storm's clients were told is stored.
#[derive(Default)]
struct Acknowledged {
    meshes: Vec<String>,
    jobs: Vec<String>,
}

/// A client that uploads meshes that are like no others and submits jobs on them, until the server is gone.
async fn storm_client(url: String, round: usize, client: usize, told: Arc<std::sync::Mutex<Acknowledged>>) {
    let http = reqwest::Client::new();
    for k in 0.. {
        let mesh = process::torus().replacen("2.7 0 0", &format!("2.7 {round}.{client} 0.{k}"), 1);
        let Ok(answer) = http.post(format!("{url}/v1/meshes?format=off")).body(mesh).send().await else { return };
        let status = answer.status();
        let Ok(mesh) = answer.json::<Value>().await else { return };
        // A server that is being killed may still refuse; it may not lose what it took.
        assert!(status.is_success() || status.as_u16() == 503, "{status}: {mesh}");
        let Some(mesh) = mesh["id"].as_str() else { continue };
        told.lock().unwrap().meshes.push(mesh.to_owned());
        for count in [6, 9] {
            let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": count}});
            let Ok(answer) = http.post(format!("{url}/v1/jobs")).json(&request).send().await else { return };
            let Ok(job) = answer.json::<Value>().await else { return };
            if let Some(job) = job["id"].as_str() {
                told.lock().unwrap().jobs.push(job.to_owned());
            }
        }
    }
}

/// `STORM=1000 cargo test --release --test crash -- --ignored --nocapture storm`: so many kills at random points, 100 unless told otherwise, with six
/// clients.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes: the figures of docs/reliability.md"]
async fn storm_of_kills() {
    let kills: usize = std::env::var("STORM").map_or(100, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let settings = ["--workers", "2", "--gpu", "off", "--max-queued-jobs", "1000000"];
    let told = Arc::new(std::sync::Mutex::new(Acknowledged::default()));
    let mut random = chladni_base::SplitMix64::new(17);
    for round in 0..kills {
        let server = Server::start(folder.path(), &settings);
        let clients: Vec<_> = (0..6)
            .map(|client| tokio::spawn(storm_client(server.url.clone(), round, client, Arc::clone(&told))))
            .collect();
        tokio::time::sleep(Duration::from_millis(random.below(600) as u64)).await;
        server.kill();
        for client in clients {
            client.await.unwrap();
        }
    }
    let store = Store::open(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(folder.path()) }).await.unwrap();
    let found = store.examine(false).await.unwrap();
    assert!(!found.is_ill(), "{found:?}");
    let told = Arc::into_inner(told).unwrap().into_inner().unwrap();
    for mesh in &told.meshes {
        store.load_mesh(mesh).await.unwrap_or_else(|error| panic!("mesh {mesh} is lost: {error}"));
    }
    let mut bases = 0;
    for job in &told.jobs {
        let job = store.job(job.parse().unwrap()).await.unwrap_or_else(|error| panic!("job {job} is lost: {error}"));
        assert_eq!(job.status == JobStatus::Succeeded, job.basis.is_some());
        assert_ne!(job.status, JobStatus::Failed, "{job:?}");
        if let Some(basis) = job.basis {
            store.load_basis(basis).await.unwrap();
            bases += 1;
        }
    }
    store.close().await;
    println!("{kills} kills: {} meshes, {} jobs and {bases} bases, none lost", told.meshes.len(), told.jobs.len());
    assert!(told.meshes.len() > kills && told.jobs.len() > kills);
}
