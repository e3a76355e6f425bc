//! Two servers and their workers, as processes of their own, share a PostgreSQL and a store of objects. Workers are
//! killed at every point.
#![cfg(all(unix, feature = "cluster"))]

#[path = "common/places.rs"]
mod places;
#[path = "common/postgres.rs"]
mod postgres;
mod process;

use std::{
    os::unix::process::ExitStatusExt,
    process::Command,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use chladni::store::fault::{FailPoint, Faults};
use chladni_spectral::formats::npz;
use places::{LEASE, Places, Pooler};
use process::{PATIENCE, Server};
use serde_json::{Value, json};

const SIGKILL: i32 = 9;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_servers_and_two_workers_are_one_service() {
    let Some(places) = Places::over_s3() else { return };
    let (one, two) = (places.server(), places.server());
    // Of one class, however much memory is free when they start.
    let memory = ["--memory-bytes", "4GiB"];
    let _workers = [places.worker(&memory), places.worker(&memory)];
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
    // Or straight from where it lies, for whoever has the address.
    let client = process::cryptography::builder().redirect(reqwest::redirect::Policy::none()).build().unwrap();
    let asked = client.get(format!("{}/v1/bases/{basis}/content", two.url)).header("prefer", "redirect");
    let sent = asked.send().await.unwrap();
    assert_eq!(
        (sent.status(), &sent.headers()["preference-applied"]),
        (307.try_into().unwrap(), &"redirect".parse().unwrap())
    );
    let place = sent.headers()["location"].to_str().unwrap();
    assert!(place.starts_with("http://127.0.0.1:") && place.contains("/lab/one/b/"), "{place}");
    let fetched = client.get(place).send().await.unwrap();
    assert_eq!(
        (fetched.status().as_u16(), &fetched.headers()["content-type"]),
        (200, &"application/x-npz".parse().unwrap())
    );
    let fetched = fetched.bytes().await.unwrap();
    assert!(fetched == contents[0]);
    assert_eq!(sent.headers()["etag"].to_str().unwrap(), format!("\"{}\"", blake3::hash(&fetched)));
    // Without a signature it gives nothing.
    assert_eq!(client.get(place.split_once('?').unwrap().0).send().await.unwrap().status(), 403);
    // Who works, and on what, is said.
    let get = async |path: &str| two.client.get(format!("{}{path}", two.url)).send().await.unwrap();
    let ready: Value = get("/readyz").await.json().await.unwrap();
    assert_eq!((&ready["database"], &ready["content"]), (&"postgresql".into(), &"s3".into()), "{ready}");
    assert_eq!(
        (ready["workers"].as_array().unwrap().len(), &ready["workers"][0]["processes"]),
        (1, &2.into()),
        "{ready}"
    );
    let metrics = get("/metrics").await.text().await.unwrap();
    for line in
        ["chladni_content_up 1", "chladni_database_up 1", r#"chladni_store_info{content="s3",database="postgresql"} 1"#]
    {
        assert!(metrics.lines().any(|own| own == line), "{line} is missing from\n{metrics}");
    }
    // What is known of a data folder alone is left out, and alarms nobody.
    for name in ["free_bytes", "least_free_bytes", "database_bytes", "wal_bytes"] {
        assert!(!metrics.contains(&format!("\nchladni_{name}")), "{name} is told in\n{metrics}");
    }
    let class = metrics.lines().find(|line| line.starts_with("chladni_workers{")).unwrap();
    assert!(class.contains(r#"kinds="all""#) && class.ends_with(" 2"), "{class}");
    assert_eq!(places.check().await, 13);
    one.stop();
    two.stop();
}

/// Shapes and their bases come from shared places, go to a process, and the maps come back: the files' bytes are those
/// of a server by itself.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn maps_of_a_collection_are_the_same_where_records_are_shared() {
    let Some(places) = Places::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (shared, alone) = (places.server(), Server::start(folder.path(), &[]));
    let worker = places.worker(&[]);
    let (mut contents, mut jobs) = (Vec::new(), Vec::new());
    for server in [&shared, &alone] {
        let mut bases = Vec::new();
        for across in [9, 10, 11] {
            let mesh = server.upload_off(process::torus_of(24, across)).await;
            let parameters = json!({"method": "hsim", "count": 30, "precision": "f64"});
            let job = server.submit_with(&mesh, parameters).await.unwrap();
            bases.push(server.finished(&job).await["basis"].clone());
        }
        let request = json!({"kind": "map_collection", "bases": bases, "parameters": {"samples": 200}});
        let submit = async || {
            let answer = server.client.post(format!("{}/v1/jobs", server.url)).json(&request).send().await.unwrap();
            answer.json::<Value>().await.unwrap()
        };
        let job = submit().await;
        let done = server.finished(job["id"].as_str().unwrap()).await;
        assert_eq!((&done["status"], &done["bases"]), (&"succeeded".into(), &Value::from(bases.clone())), "{done}");
        assert_eq!(submit().await["id"], job["id"]);
        let url = format!("{}/v1/bases/{}", server.url, done["basis"].as_str().unwrap());
        let maps = server.client.get(format!("{url}/maps")).send().await.unwrap().json::<Value>().await.unwrap();
        assert_eq!(maps["maps"].as_array().unwrap().len(), 6, "{maps}");
        let content = server.client.get(format!("{url}/content")).send().await.unwrap().bytes().await.unwrap();
        contents.push(npz::read_maps(&content).unwrap());
        jobs.push(done);
    }
    let [a, b] = &mut contents[..] else { panic!() };
    // Identifiers are all that differs.
    b.metadata = a.metadata.clone();
    assert!(a == b && a.vertex_maps.iter().all(|of_file| !of_file.is_empty()));
    assert_eq!(places.check().await, 4);
    worker.signal(rustix::process::Signal::TERM);
    assert_eq!(worker.ended(), None);
    shared.stop();
    alone.stop();
    // A folder that is moved takes what a job works on along.
    let Some(elsewhere) = Places::new() else { return };
    let [data, to, objects] =
        [folder.path().to_str().unwrap(), &elsewhere.database, &elsewhere.objects].map(str::to_owned);
    let arguments = ["migrate", "--data", &data, "--to", &to, "--objects", &objects];
    let moved = process::chladni(&arguments);
    assert!(moved.status.success(), "{moved:?}");
    let server = elsewhere.server();
    assert_eq!(server.job_now(jobs[1]["id"].as_str().unwrap()).await, jobs[1]);
    server.stop();
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_pooler_that_gives_connections_out_by_transaction_serves() {
    let Some(mut places) = Places::new() else { return };
    let Some((pooler, address)) = Pooler::before(&places.database, places.folder.path()) else { return };
    places.pooler = Some((std::mem::replace(&mut places.database, address), pooler));
    let server = places.server();
    let _workers = [places.worker(&[]), places.worker(&[])];
    let mesh = server.upload().await;
    let mut jobs = Vec::new();
    for count in 4..10 {
        jobs.push(server.submit(&mesh, count).await.unwrap());
    }
    for job in &jobs {
        let done = server.finished(job).await;
        assert_eq!((&done["status"], &done["attempt"]), (&"succeeded".into(), &1.into()), "{done}");
    }
    assert_eq!(places.check().await, 6);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_is_refused_by_the_largest_worker_and_left_to_it() {
    let Some(places) = Places::new() else { return };
    let server = places.server();
    let mesh = server.upload().await;
    let request = serde_json::json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"count": 6}});
    let post =
        async |path: &str| server.client.post(format!("{}{path}", server.url)).json(&request).send().await.unwrap();
    let estimate: Value = post("/v1/job-estimates").await.json().await.unwrap();
    let needed = estimate["memory_bytes"].as_u64().unwrap();
    let small = places.worker(&["--memory-bytes", &(needed - 1).to_string()]);
    // One that is large enough, for other jobs.
    let _other = places.worker(&["--memory-bytes", &(4 * needed).to_string(), "--kinds", "field_basis"]);
    let begun = Instant::now();
    let refused: Value = loop {
        let workers: Value =
            server.client.get(format!("{}/readyz", server.url)).send().await.unwrap().json().await.unwrap();
        if workers["workers"].as_array().unwrap().len() == 2 {
            let refused = post("/v1/jobs").await;
            assert_eq!(refused.status(), 422);
            break refused.json().await.unwrap();
        }
        assert!(begun.elapsed() < PATIENCE, "{workers}");
    };
    assert_eq!(
        (&refused["type"], &refused["limit"]),
        (&"/problems/job-too-large".into(), &(needed - 1).into()),
        "{refused}"
    );
    // It was asked for while a larger one lived, which has gone.
    let large = places.worker(&["--memory-bytes", &needed.to_string(), "--fault", "after-claim:kill:0"]);
    let job = loop {
        let answer = post("/v1/jobs").await;
        if answer.status().is_success() {
            break answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned();
        }
        assert!(begun.elapsed() < PATIENCE);
    };
    assert_eq!(large.ended(), Some(SIGKILL));
    // The lease runs out, and the small one, which is idle, leaves the job alone.
    tokio::time::sleep(LEASE + Duration::from_secs(1)).await;
    let waiting = server.job_now(&job).await;
    assert_eq!((waiting["status"] != "failed", &waiting["attempt"]), (true, &1.into()), "{waiting}");
    let _heir = places.worker(&["--memory-bytes", &needed.to_string()]);
    let done = server.finished(&job).await;
    assert_eq!((&done["status"], &done["attempt"]), (&"succeeded".into(), &2.into()), "{done}");
    drop(small);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_folder_is_moved_where_many_share_it_however_often_that_is_killed() {
    let Some(places) = Places::over_s3() else { return };
    let folder = places.folder.path().join("data");
    let server = Server::start(&folder, &[]);
    let mesh = server.upload().await;
    let mut bases = Vec::new();
    for parameters in
        [serde_json::json!({"count": 6}), serde_json::json!({"count": 8, "storage": "dense", "method": "hsim"})]
    {
        let job = server.submit_with(&mesh, parameters).await.unwrap();
        let done = server.finished(&job).await;
        bases.push((job, done["basis"].as_str().unwrap_or_else(|| panic!("{done}")).to_owned()));
    }
    let content = async |server: &Server, basis: &str| {
        let answer = server.client.get(format!("{}/v1/bases/{basis}/content", server.url)).send().await.unwrap();
        assert!(answer.status().is_success());
        answer.bytes().await.unwrap()
    };
    let record = async |server: &Server, path: &str| -> Value {
        server.client.get(format!("{}{path}", server.url)).send().await.unwrap().json().await.unwrap()
    };
    let mut before = Vec::new();
    for (job, basis) in &bases {
        let records =
            [record(&server, &format!("/v1/jobs/{job}")).await, record(&server, &format!("/v1/bases/{basis}")).await];
        before.push((content(&server, basis).await, records));
    }
    server.stop();
    let migrate = |fault: &[&str]| {
        let arguments = [
            "migrate",
            "--json",
            "--data",
            folder.to_str().unwrap(),
            "--to",
            &places.database,
            "--objects",
            &places.objects,
        ];
        Command::new(env!("CARGO_BIN_EXE_chladni"))
            .args(arguments)
            .args(fault)
            .envs(places.environment())
            .output()
            .unwrap()
    };
    // Before the first object is written, between a piece of content and its record, and in the third piece.
    for fault in ["mid-chunks:kill:0", "after-blob-ready:kill:0", "before-blob-ready:kill:1"] {
        let killed = migrate(&["--fault", fault]);
        assert_eq!(killed.status.signal(), Some(SIGKILL), "{fault}: {killed:?}");
    }
    let done = migrate(&[]);
    assert!(done.status.success(), "{done:?}");
    let done: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!((&done["meshes"], &done["jobs"], &done["bases"]), (&1.into(), &2.into(), &2.into()), "{done}");
    assert!(done["written"].as_u64().unwrap() < 3, "what was there was copied again: {done}");
    // Another time there is nothing to do.
    let again = migrate(&[]);
    assert_eq!(serde_json::from_slice::<Value>(&again.stdout).unwrap()["written"], 0, "{again:?}");
    // Every object is damaged, one altogether. The next copy mends what is referred to: a mesh and two bases.
    let objects = std::fs::read_dir(places.folder.path().join("s3/spectra/lab/one/b")).unwrap();
    let objects: Vec<_> = objects.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    for object in &objects {
        let mut bytes = std::fs::read(object).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(object, bytes).unwrap();
    }
    let largest = objects.iter().max_by_key(|path| path.metadata().unwrap().len()).unwrap();
    std::fs::remove_file(largest).unwrap();
    let mended = migrate(&[]);
    assert_eq!(serde_json::from_slice::<Value>(&mended.stdout).unwrap()["written"], 3, "{mended:?}");
    assert_eq!(serde_json::from_slice::<Value>(&migrate(&[]).stdout).unwrap()["written"], 0);
    let server = places.server();
    for ((job, basis), (bytes, records)) in bases.iter().zip(&before) {
        assert!(content(&server, basis).await == *bytes);
        assert_eq!(record(&server, &format!("/v1/jobs/{job}")).await, records[0]);
        assert_eq!(record(&server, &format!("/v1/bases/{basis}")).await, records[1]);
    }
    // New work goes on behind it.
    let _worker = places.worker(&[]);
    let job = server.submit(&mesh, 5).await.unwrap();
    assert_eq!(server.finished(&job).await["status"], "succeeded");
    assert_eq!(places.check().await, 3);
    // What others have written there is nobody's copy.
    let refused = migrate(&[]);
    assert!(
        !refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("nothing else"),
        "{refused:?}"
    );
}

/// Content that is missing may be put back, and is missing for this worker alone perhaps: no job has failed for good
/// with its first attempt.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_whose_mesh_is_missing_is_tried_again() {
    let Some(places) = Places::new() else { return };
    let server = places.server();
    let mesh = server.upload().await;
    let content = places.folder.path().join("objects/b");
    let file = std::fs::read_dir(&content).unwrap().next().unwrap().unwrap().path();
    let aside = places.folder.path().join("aside");
    std::fs::rename(&file, &aside).unwrap();
    let job = server.submit(&mesh, 4).await.unwrap();
    let _worker = places.worker(&[]);
    let begun = Instant::now();
    let mut seen = Value::Null;
    while seen["problem"].is_null() {
        assert!(begun.elapsed() < PATIENCE, "{seen}");
        tokio::time::sleep(Duration::from_millis(20)).await;
        seen = server.client.get(format!("{}/v1/jobs/{job}", server.url)).send().await.unwrap().json().await.unwrap();
    }
    assert_ne!(seen["status"], "failed", "{seen}");
    std::fs::rename(&aside, &file).unwrap();
    let done = server.finished(&job).await;
    assert_eq!(done["status"], "succeeded", "{done}");
}

#[test]
fn a_worker_of_another_store_is_refused_and_names_both() {
    let Some(places) = Places::new() else { return };
    let _server = places.server();
    let mut settings = places.settings();
    let other = format!("{}-2", places.objects);
    settings[3] = &other;
    settings.extend(["--threads", "1", "--gpu", "off", "--log-level", "error"]);
    let refused = Command::new(env!("CARGO_BIN_EXE_chladni")).arg("worker").args(settings).output().unwrap();
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && told.contains("do not belong together"), "{refused:?}");
}

#[test]
fn a_worker_with_wrong_keys_says_so_at_once() {
    let Some(places) = Places::over_s3() else { return };
    let mut environment = places.environment();
    environment.push(("AWS_SECRET_ACCESS_KEY", "a guess"));
    let begun = Instant::now();
    let mut settings = places.settings();
    settings.extend(["--threads", "1", "--gpu", "off", "--log-level", "error"]);
    let refused =
        Command::new(env!("CARGO_BIN_EXE_chladni")).arg("worker").args(settings).envs(environment).output().unwrap();
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && told.contains("the storage refuses"), "{refused:?}");
    assert!(begun.elapsed() < PATIENCE / 4);
}

#[test]
fn a_worker_says_what_it_needs() {
    let told = |arguments: &[&str]| String::from_utf8(process::chladni(arguments).stderr).unwrap();
    assert!(told(&["worker"]).contains("--database"));
    assert!(told(&["serve", "--workers", "0"]).contains("no jobs would run"));
    let unknown = ["worker", "--kinds", "juggling", "--database", "postgres://h/d", "--objects", "file:///tmp/x"];
    assert!(told(&unknown).contains("juggling"));
}
