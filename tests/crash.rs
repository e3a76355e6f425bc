//! The real server is killed at named points while jobs run, and started again. Whatever happens: no acknowledged job
//! is lost, no basis is half visible, content verifies, attempts are bounded.
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
    let http = process::cryptography::client();
    for k in 0.. {
        let mesh = process::torus().replacen("2.7 0 0", &format!("2.7 {round}.{client} 0.{k}"), 1);
        let Ok(answer) = http.post(format!("{url}/v1/meshes?format=off")).body(mesh).send().await else { return };
        let status = answer.status();
        let Ok(mesh) = answer.json::<Value>().await else { return };
        // A server that is being killed, or has no room, may still refuse; it may not lose what it took.
        assert!(status.is_success() || [503, 507].contains(&status.as_u16()), "{status}: {mesh}");
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

/// `STORM=1000 cargo test --release --test crash -- --ignored --nocapture --exact storm_of_kills`: so many kills at
/// random points, 100 unless told otherwise, with six clients.
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

/// The databases and their logs as they are at one instant: nothing runs while they are copied.
fn frozen(server: &Server, folder: &Path) -> HashMap<&'static str, Vec<u8>> {
    use rustix::process::{Pid, Signal, kill_process};
    let pid = Pid::from_child(&server.process);
    kill_process(pid, Signal::STOP).unwrap();
    let stopped = || {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", server.process.id())).unwrap();
        tasks.flatten().all(|task| std::fs::read_to_string(task.path().join("stat")).is_ok_and(|s| s.contains(") T ")))
    };
    while !stopped() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let read = |name| std::fs::read(folder.join(name)).ok().map(|bytes| (name, bytes));
    let files = ["meta.db", "meta.db-wal", "blobs.db", "blobs.db-wal"].into_iter().filter_map(read).collect();
    kill_process(pid, Signal::CONT).unwrap();
    files
}

/// Of two instants of a file the first, with some of the sectors that were written until the second: what a disk may
/// hold that lost power between them.
fn torn(first: &[u8], second: &[u8], random: &mut chladni_base::SplitMix64) -> (Vec<u8>, usize) {
    let mut bytes = first.to_vec();
    // A log does not shrink while it goes on.
    let Some(grown) = second.len().checked_sub(first.len()) else { return (bytes, 0) };
    bytes.resize(first.len() + random.below(grown + 1), 0);
    let mut written = 0;
    for at in (0..bytes.len()).step_by(512) {
        let end = (at + 512).min(bytes.len());
        if bytes[at..end] != second[at..end] && random.below(2) == 0 {
            bytes[at..end].copy_from_slice(&second[at..end]);
            written += 1;
        }
    }
    (bytes, written)
}

/// `STORM=100 cargo test --release --test crash -- --ignored --nocapture power_cuts`: so many losses of power of a
/// loaded server. Its files are copied at two instants some milliseconds apart while it stands still; the disk then has
/// the first, and a random half of the sectors written after it, which were not synced when the first was taken. A file
/// whose log began anew in between is taken as it was at the first.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes: the figures of docs/reliability.md"]
async fn storm_of_power_cuts() {
    let cuts: usize = std::env::var("STORM").map_or(100, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let settings = ["--workers", "2", "--gpu", "off", "--max-queued-jobs", "1000000"];
    let told = Arc::new(std::sync::Mutex::new(Acknowledged::default()));
    let mut random = chladni_base::SplitMix64::new(23);
    let mut server = Server::start(folder.path(), &settings);
    let (mut meshes, mut jobs, mut bases, mut sectors) = (0, 0, 0, 0);
    let mut clients: Vec<tokio::task::JoinHandle<()>> = Vec::new();
    for cut in 0..cuts {
        if cut % 8 == 0 {
            // A fresh folder now and then keeps the copies small.
            server.kill();
            for client in clients.drain(..) {
                client.await.unwrap();
            }
            std::fs::read_dir(folder.path())
                .unwrap()
                .flatten()
                .for_each(|file| std::fs::remove_file(file.path()).unwrap());
            *told.lock().unwrap() = Acknowledged::default();
            server = Server::start(folder.path(), &settings);
            clients.extend(
                (0..6).map(|client| tokio::spawn(storm_client(server.url.clone(), cut, client, Arc::clone(&told)))),
            );
        }
        tokio::time::sleep(Duration::from_millis(random.below(300) as u64)).await;
        let (known_meshes, known_jobs) = {
            let told = told.lock().unwrap();
            (told.meshes.clone(), told.jobs.clone())
        };
        let first = frozen(&server, folder.path());
        tokio::time::sleep(Duration::from_millis(random.below(30) as u64)).await;
        let second = frozen(&server, folder.path());
        let disk = tempfile::tempdir().unwrap();
        for database in ["meta.db", "blobs.db"] {
            let log = if database == "meta.db" { "meta.db-wal" } else { "blobs.db-wal" };
            // The salts of a log change when it begins anew, which follows a checkpoint: what was written then was
            // ordered by syncs.
            let salts =
                |files: &HashMap<&str, Vec<u8>>| files.get(log).and_then(|bytes| bytes.get(..32).map(<[u8]>::to_vec));
            let same = first.get(database) == second.get(database) && salts(&first) == salts(&second);
            std::fs::write(disk.path().join(database), &first[database]).unwrap();
            if let Some(before) = first.get(log) {
                let (bytes, written) = match second.get(log).filter(|_| same) {
                    Some(after) => torn(before, after, &mut random),
                    None => (before.clone(), 0),
                };
                std::fs::write(disk.path().join(log), bytes).unwrap();
                sectors += written;
            }
        }
        let store = Store::open(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(disk.path()) }).await;
        let store = store.unwrap_or_else(|error| panic!("cut {cut}: {error}"));
        let found = store.examine(false).await.unwrap();
        assert!(!found.is_ill(), "cut {cut}: {found:?}");
        for mesh in &known_meshes {
            store.load_mesh(mesh).await.unwrap_or_else(|error| panic!("cut {cut}: mesh {mesh} is lost: {error}"));
        }
        for job in &known_jobs {
            let job = store.job(job.parse().unwrap()).await;
            let job = job.unwrap_or_else(|error| panic!("cut {cut}: a job is lost: {error}"));
            if let Some(basis) = job.basis {
                store.load_basis(basis).await.unwrap();
                bases += 1;
            }
        }
        (meshes, jobs) = (meshes + known_meshes.len(), jobs + known_jobs.len());
        store.close().await;
    }
    server.kill();
    println!(
        "{cuts} losses of power, {sectors} sectors of logs written in part: {meshes} meshes, {jobs} jobs, {bases} bases looked up, none lost"
    );
    assert!(meshes > cuts && jobs > cuts);
}

/// `STORM=100 cargo test --release --test crash -- --ignored --nocapture full_disks`, as root: so many times a file
/// takes all room of the server's disk, while six clients go on, and gives it back.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "mounts a file system and takes minutes: the figures of docs/reliability.md"]
async fn storm_of_full_disks() {
    let times: usize = std::env::var("STORM").map_or(100, |text| text.parse().unwrap());
    let disk = tempfile::tempdir().unwrap();
    let mut mount = std::process::Command::new("mount");
    let mounted = mount.args(["-t", "tmpfs", "-o", "size=256m", "tmpfs"]).arg(disk.path()).status().unwrap();
    assert!(mounted.success(), "a file system cannot be mounted here");
    let folder = disk.path().join("data");
    let settings = ["--workers", "2", "--gpu", "off", "--max-queued-jobs", "1000000", "--max-attempts", "1000"];
    let mut random = chladni_base::SplitMix64::new(29);
    let told = Arc::new(std::sync::Mutex::new(Acknowledged::default()));
    let server = Server::start(&folder, &settings);
    let clients: Vec<_> =
        (0..3).map(|client| tokio::spawn(storm_client(server.url.clone(), 0, client, Arc::clone(&told)))).collect();
    let (mut slowest, mut refusals) = (Duration::ZERO, 0);
    for time in 0..times {
        tokio::time::sleep(Duration::from_millis(random.below(200) as u64)).await;
        let ballast = disk.path().join("ballast");
        let mut file = std::fs::File::create(&ballast).unwrap();
        while std::io::Write::write_all(&mut file, &[1; 1 << 16]).is_ok() {}
        while std::io::Write::write_all(&mut file, &[1; 512]).is_ok() {}
        drop(file);
        tokio::time::sleep(Duration::from_millis(100 + random.below(300) as u64)).await;
        let full = server.client.post(format!("{}/v1/meshes?format=off", server.url)).body(process::torus().replacen(
            "2.7 0 0",
            &format!("2.7 9 {time}"),
            1,
        ));
        refusals += usize::from(full.send().await.unwrap().status().as_u16() == 507);
        std::fs::remove_file(&ballast).unwrap();
        let begun = Instant::now();
        for k in 0.. {
            let mesh = process::torus().replacen("2.7 0 0", &format!("2.7 8.{k} {time}"), 1);
            let answer =
                server.client.post(format!("{}/v1/meshes?format=off", server.url)).body(mesh).send().await.unwrap();
            if answer.status().is_success() {
                let id = answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned();
                told.lock().unwrap().meshes.push(id);
                break;
            }
            assert!(begun.elapsed() < PATIENCE, "time {time}: {}", answer.text().await.unwrap());
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        slowest = slowest.max(begun.elapsed());
    }
    server.kill();
    for client in clients {
        client.await.unwrap();
    }
    let store = Store::open(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(&folder) }).await.unwrap();
    let found = store.examine(false).await.unwrap();
    let told = Arc::into_inner(told).unwrap().into_inner().unwrap();
    let mut lost = 0;
    for mesh in &told.meshes {
        lost += usize::from(store.load_mesh(mesh).await.is_err());
    }
    let mut ends: HashMap<&str, usize> = HashMap::new();
    for job in &told.jobs {
        match store.job(job.parse().unwrap()).await {
            Ok(job) => *ends.entry(job.status.as_str()).or_default() += 1,
            Err(_) => lost += 1,
        }
    }
    store.close().await;
    drop(store);
    let unmounted = std::process::Command::new("umount").arg(disk.path()).status().unwrap();
    assert!(!found.is_ill() && lost == 0, "{lost} lost, {found:?}");
    println!(
        "{times} times full, {refusals} uploads refused meanwhile: {} meshes and {} jobs ({ends:?}), none lost; stored again after {:.2} s at most; {unmounted}",
        told.meshes.len(),
        told.jobs.len(),
        slowest.as_secs_f64()
    );
}
