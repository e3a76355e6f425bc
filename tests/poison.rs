//! Jobs that harm the process they run in: whatever they do, the server lives, says what became of them, and goes on
//! with other work.
#![cfg(target_os = "linux")]

mod process;

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use process::{PATIENCE, Server, chladni, fan};
use serde_json::{Value, json};

/// What a priority asks a poisonous server for.
const MEMORY: i32 = -91;
const ABORT: i32 = -92;
const DEAF: i32 = -93;
const FAULT: i32 = -94;
const KILL: i32 = -95;
const PANIC: i32 = -96;
const EXIT: i32 = -97;
const STACK: i32 = -98;
const SLEEP: i32 = -99;

const SETTINGS: [&str; 6] = ["--fault", "poison", "--gpu", "off", "--max-attempts", "1"];

/// Submits a job that is like no other, of so high a priority.
async fn submit(server: &Server, mesh: &str, priority: i32, seed: usize) -> String {
    let request =
        json!({"kind": "eigenbasis", "mesh": mesh, "priority": priority, "parameters": {"count": 6, "seed": seed}});
    let answer = server.client.post(format!("{}/v1/jobs", server.url)).json(&request).send().await.unwrap();
    assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
    answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned()
}

async fn until_running(server: &Server, job: &str) {
    let begun = Instant::now();
    while server.job_now(job).await["stage"] != "poison" {
        assert!(begun.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

async fn cancel(server: &Server, job: &str) -> Duration {
    let asked = Instant::now();
    let answer = server.client.post(format!("{}/v1/jobs/{job}/cancel", server.url)).send().await.unwrap();
    assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
    assert_eq!(server.finished(job).await["status"], "canceled");
    asked.elapsed()
}

fn problem(job: &Value) -> (&str, &str) {
    let word = |name: &str| job["problem"][name].as_str().unwrap_or_default();
    (word("type").rsplit('/').next().unwrap_or_default(), word("detail"))
}

/// Processes that the server started and that live.
fn children(server: &Server) -> Vec<u32> {
    let path = format!("/proc/{0}/task/{0}/children", server.process.id());
    // Threads start processes too; each lists its own.
    let tasks = std::fs::read_dir(format!("/proc/{}/task", server.process.id())).unwrap();
    let lists = tasks.map(|task| std::fs::read_to_string(task.unwrap().path().join("children")).unwrap_or_default());
    let all = lists.collect::<Vec<String>>().join(" ") + " " + &std::fs::read_to_string(path).unwrap_or_default();
    let mut found: Vec<u32> = all.split_ascii_whitespace().map(|pid| pid.parse().unwrap()).collect();
    found.sort_unstable();
    found.dedup();
    found
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn poison_of_every_kind_ends_its_job_and_not_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = Server::start(folder.path(), &SETTINGS);
    let mesh = server.upload().await;
    for (kind, expected, words) in [
        (MEMORY, "memory-exceeded", "exceeded its limit"),
        (ABORT, "quarantined", "signal 6 (SIGABRT)"),
        (FAULT, "quarantined", "signal 11 (SIGSEGV)"),
        (KILL, "quarantined", "signal 9 (SIGKILL)"),
        (PANIC, "worker-panicked", "at stage poison"),
        (EXIT, "quarantined", "exit code 0"),
        (STACK, "quarantined", "signal 6 (SIGABRT)"),
    ] {
        let job = submit(&server, &mesh, kind, 1).await;
        let job = server.finished(&job).await;
        let (found, detail) = problem(&job);
        assert_eq!((job["status"].as_str(), found), (Some("failed"), expected), "{job}");
        assert!(detail.contains(words), "{job}");
        // The same mesh, the same server, work that does no harm.
        let good = submit(&server, &mesh, 0, 1000 + kind.unsigned_abs() as usize).await;
        assert_eq!(server.finished(&good).await["status"], "succeeded");
        assert!(server.process.try_wait().unwrap().is_none(), "the server has ended");
    }
    server.stop();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn work_that_does_not_stop_is_killed_within_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &SETTINGS);
    let mesh = server.upload().await;
    for (seed, kind) in [DEAF, SLEEP, DEAF].into_iter().enumerate() {
        let job = submit(&server, &mesh, kind, seed).await;
        until_running(&server, &job).await;
        let running = children(&server);
        let took = cancel(&server, &job).await;
        assert!(took < Duration::from_secs(1), "{took:?}");
        // The process is gone, not left behind.
        let begun = Instant::now();
        while children(&server).iter().any(|child| running.contains(child)) {
            assert!(begun.elapsed() < Duration::from_secs(1), "its process goes on");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
    let good = submit(&server, &mesh, 0, 9).await;
    assert_eq!(server.finished(&good).await["status"], "succeeded");
    server.stop();
}

/// On threads nothing can be killed, so each kind of job has to look for itself whether it is still wanted.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_around_a_vertex_of_very_many_triangles_stop_by_themselves() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &["--jobs-in", "threads", "--gpu", "off", "--max-attempts", "1"]);
    let (wide, narrow) = (server.upload_off(fan(60_000)).await, server.upload_off(fan(1_000)).await);
    for (kind, mesh, parameters, expected) in [
        ("eigenbasis", &wide, json!({"method": "approximate", "count": 200}), "canceled"),
        ("eigenbasis", &wide, json!({"method": "hsim", "count": 100}), "canceled"),
        ("operator_family", &wide, json!({"dimension": 200}), "canceled"),
        ("vibration_basis", &wide, json!({"count": 40, "thickness": 0.01}), "canceled"),
        ("field_basis", &narrow, json!({"dimension": 400}), "canceled"),
        // What does not fit is told at once.
        ("field_basis", &wide, json!({}), "failed"),
    ] {
        let request = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
        let answer = server.client.post(format!("{}/v1/jobs", server.url)).json(&request).send().await.unwrap();
        let job = answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned();
        let begun = Instant::now();
        while server.job_now(&job).await["status"] == "enqueued" {
            assert!(begun.elapsed() < PATIENCE);
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        if expected == "failed" {
            let job = server.finished(&job).await;
            assert_eq!(problem(&job).0, "memory-exceeded", "{job}");
            continue;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
        let took = cancel(&server, &job).await;
        // A second on a machine of its own; a share of that where many tests run beside it.
        assert!(took < Duration::from_secs(5), "{kind} {parameters}: {took:?}");
    }
    server.stop();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn processes_end_with_their_server() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &SETTINGS);
    let mesh = server.upload().await;
    let job = submit(&server, &mesh, DEAF, 0).await;
    until_running(&server, &job).await;
    let running = children(&server);
    assert!(!running.is_empty());
    server.kill();
    let lives = |pid: &u32| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        // One that nobody has waited for yet is dead as well.
        !stat.is_empty() && !stat.contains(") Z ")
    };
    let begun = Instant::now();
    while running.iter().any(lives) {
        assert!(begun.elapsed() < Duration::from_secs(5), "{running:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_is_killed_while_it_waits_harms_no_job() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &SETTINGS);
    let mesh = server.upload().await;
    for seed in 0..3 {
        for child in children(&server) {
            let child = rustix::process::Pid::from_raw(child as i32).unwrap();
            rustix::process::kill_process(child, rustix::process::Signal::KILL).unwrap();
        }
        let job = submit(&server, &mesh, 0, seed).await;
        let job = server.finished(&job).await;
        assert_eq!((job["status"].as_str(), job["attempt"].as_u64()), (Some("succeeded"), Some(1)), "{job}");
    }
    server.stop();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn threads_and_processes_give_the_same_bytes() {
    let mut contents = Vec::new();
    for place in ["threads", "processes"] {
        let folder = tempfile::tempdir().unwrap();
        let server = Server::start(folder.path(), &["--jobs-in", place, "--gpu", "off"]);
        let mesh = server.upload().await;
        let mut all = Vec::new();
        for (kind, parameters) in [
            ("eigenbasis", json!({"count": 30})),
            ("eigenbasis", json!({"method": "hsim", "count": 70, "precision": "f64"})),
            ("eigenbasis", json!({"method": "hsim", "count": 5, "storage": "dense"})),
            ("field_basis", json!({"dimension": 40})),
            ("operator_family", json!({"dimension": 20})),
            ("vibration_basis", json!({"count": 12, "thickness": 0.01})),
        ] {
            let request = json!({"kind": kind, "mesh": mesh, "parameters": parameters});
            let answer = server.client.post(format!("{}/v1/jobs", server.url)).json(&request).send().await.unwrap();
            let job = answer.json::<Value>().await.unwrap();
            let job = server.finished(job["id"].as_str().unwrap_or_else(|| panic!("{job}"))).await;
            assert_eq!(job["status"], "succeeded", "{job}");
            assert!(job["stage_seconds"].as_array().unwrap().len() > 1, "{job}");
            let path = format!("{}/v1/bases/{}/content", server.url, job["basis"].as_str().unwrap());
            all.push(server.client.get(path).send().await.unwrap().bytes().await.unwrap());
        }
        server.stop();
        contents.push(all);
    }
    assert!(contents[0] == contents[1], "a basis depends on where it was computed");
}

#[test]
fn poison_is_refused_where_jobs_run_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    let refused =
        chladni(&["serve", "--listen", "127.0.0.1:0", "--jobs-in", "threads", "--fault", "poison", "--data", data]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}

/// `cargo test --release --test poison -- --ignored --nocapture --exact storm`, with `STORM` jobs, 1,000 unless told
/// otherwise.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes: the figures of docs/reliability.md"]
async fn storm() {
    let jobs: usize = std::env::var("STORM").map_or(1000, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut settings = SETTINGS.to_vec();
    settings.extend(["--workers", "2"]);
    let mut server = Server::start(folder.path(), &settings);
    let mesh = server.upload().await;
    let begun = Instant::now();
    let (mut deaf, mut others, mut slowest) = (0, Vec::new(), Duration::ZERO);
    for seed in 0..jobs {
        match [MEMORY, ABORT, FAULT, KILL, DEAF, EXIT, STACK, SLEEP, 0][seed % 9] {
            kind @ (DEAF | SLEEP) => {
                // It is next, since what waits has been waited for.
                for job in others.drain(..) {
                    check(&server, job).await;
                }
                let job = submit(&server, &mesh, kind, seed).await;
                until_running(&server, &job).await;
                slowest = slowest.max(cancel(&server, &job).await);
                deaf += 1;
            }
            kind => others.push((submit(&server, &mesh, kind, seed).await, kind)),
        }
    }
    for job in others {
        check(&server, job).await;
    }
    assert!(server.process.try_wait().unwrap().is_none(), "the server has ended");
    let good = submit(&server, &mesh, 0, jobs + 1).await;
    assert_eq!(server.finished(&good).await["status"], "succeeded");
    println!(
        "{jobs} jobs in {:.0} s: 0 exits of the server; {deaf} cancelled, the slowest in {:.3} s",
        begun.elapsed().as_secs_f64(),
        slowest.as_secs_f64()
    );
    assert!(slowest < Duration::from_secs(1));
    server.stop();
}

async fn check(server: &Server, (job, kind): (String, i32)) {
    let job = server.finished(&job).await;
    let expected = match kind {
        0 => "succeeded",
        _ => "failed",
    };
    assert_eq!(job["status"], expected, "{job}");
    let found = problem(&job).0;
    assert!(kind == 0 || found == if kind == MEMORY { "memory-exceeded" } else { "quarantined" }, "{job}");
}

/// `cargo test --release --test poison -- --ignored --nocapture cancels`, with `STORM` jobs, 10,000 unless told
/// otherwise: work around a hub of 20,000 triangles is cancelled at random moments of its first 200 milliseconds, for
/// five minutes at most.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes: the figures of docs/reliability.md"]
async fn storm_of_cancels() {
    let jobs: usize = std::env::var("STORM").map_or(10_000, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &["--gpu", "off", "--workers", "2"]);
    let mesh = server.upload_off(fan(20_000)).await;
    let mut random = chladni_base::SplitMix64::new(31);
    let (begun, mut took, mut ended) = (Instant::now(), Vec::new(), 0);
    while took.len() < jobs && begun.elapsed() < Duration::from_secs(300) {
        let method = ["approximate", "hsim"][random.below(2)];
        let parameters = json!({"method": method, "count": 100, "seed": took.len()});
        let job = server.submit_with(&mesh, parameters).await.unwrap();
        while server.job_now(&job).await["status"] == "enqueued" {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        tokio::time::sleep(Duration::from_millis(random.below(200) as u64)).await;
        let asked = Instant::now();
        server.client.post(format!("{}/v1/jobs/{job}/cancel", server.url)).send().await.unwrap();
        match server.finished(&job).await["status"].as_str() {
            Some("canceled") => took.push(asked.elapsed()),
            _ => ended += 1,
        }
    }
    took.sort_unstable();
    let at = |share: f64| took[((took.len() - 1) as f64 * share) as usize].as_secs_f64();
    println!(
        "{} cancelled in {:.0} s, {ended} had ended; after {:.3} s (median), 99th percentile {:.3} s, {:.3} s at most",
        took.len(),
        begun.elapsed().as_secs_f64(),
        at(0.5),
        at(0.99),
        at(1.0)
    );
    server.stop();
}

/// A solve that costs little to send and to answer, so that one machine can send ten times what it can do.
fn compression() -> Value {
    json!({"pairs": 100, "bits": 12})
}

/// Milliseconds that synchronous solves of one client take, one after the other for so long, in ascending order; and
/// how many were refused.
async fn solves(url: &str, client: &reqwest::Client, time: Duration) -> (Vec<f64>, usize) {
    let (mut took, mut refused, since) = (Vec::new(), 0, Instant::now());
    while since.elapsed() < time {
        let begun = Instant::now();
        let answer = client.post(url).json(&compression()).send().await.unwrap();
        let (status, text) = (answer.status(), answer.bytes().await.unwrap());
        match status.as_u16() {
            200 => took.push(1e3 * begun.elapsed().as_secs_f64()),
            503 | 429 => refused += 1,
            _ => panic!("{status}: {}", String::from_utf8_lossy(&text)),
        }
    }
    took.sort_by(f64::total_cmp);
    (took, refused)
}

/// `cargo test --release --test poison -- --ignored --nocapture flood`: synchronous solves of one client while another
/// sends ten times what the server can do. On loopback, where each address counts as a client. `CHLADNI_FLOOD_ACROSS`
/// is the square root of half the vertices, 100 by default.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes half a minute and the whole machine: the figures of docs/reliability.md"]
async fn flood() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &["--gpu", "off"]);
    let across = std::env::var("CHLADNI_FLOOD_ACROSS").map_or(100, |given| given.parse().unwrap());
    let mesh = server.upload_off(process::torus_of(2 * across, across)).await;
    let job = server.submit(&mesh, 100).await.unwrap();
    let basis = server.finished(&job).await["basis"].as_str().unwrap().to_owned();
    let url = format!("{}/v1/bases/{basis}/compress", server.url);
    let of = |address: [u8; 4]| {
        process::cryptography::builder().local_address(std::net::IpAddr::from(address)).build().unwrap()
    };
    let good = of([127, 0, 0, 2]);
    let time = Duration::from_secs(5);
    let (idle, _) = solves(&url, &good, time).await;
    // What the server can do, by as many at once as it takes.
    let begun = Instant::now();
    let all: Vec<_> = (0..8)
        .map(|_| {
            let (url, client) = (url.clone(), of([127, 0, 0, 3]));
            tokio::spawn(async move { solves(&url, &client, time).await })
        })
        .collect();
    let mut done = 0;
    for one in all {
        done += one.await.unwrap().0.len();
    }
    let capacity = done as f64 / begun.elapsed().as_secs_f64();
    let stop = Arc::new(AtomicBool::new(false));
    let sent = Arc::new(AtomicUsize::new(0));
    // On threads of its own, so that the one client is not kept waiting by its neighbour in this process; what has not
    // been answered is bounded.
    let flood = std::thread::spawn({
        let (url, stop, sent) = (url.clone(), Arc::clone(&stop), Arc::clone(&sent));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        move || {
            runtime.block_on(async {
                let client = process::cryptography::builder()
                    .local_address(std::net::IpAddr::from([127, 0, 0, 4]))
                    .build()
                    .unwrap();
                let (begun, open) = (Instant::now(), Arc::new(tokio::sync::Semaphore::new(1000)));
                while !stop.load(Ordering::Relaxed) {
                    let due = (10.0 * capacity * begun.elapsed().as_secs_f64()) as usize;
                    if sent.load(Ordering::Relaxed) >= due {
                        tokio::time::sleep(Duration::from_millis(1)).await;
                        continue;
                    }
                    let (url, client, place) =
                        (url.clone(), client.clone(), Arc::clone(&open).acquire_owned().await.unwrap());
                    sent.fetch_add(1, Ordering::Relaxed);
                    tokio::spawn(async move {
                        let _place = place;
                        if let Ok(answer) = client.post(url).json(&compression()).send().await {
                            let _ = answer.bytes().await;
                        }
                    });
                }
            });
        }
    });
    tokio::time::sleep(Duration::from_secs(1)).await;
    let begun = Instant::now();
    let (flooded, refused) = solves(&url, &good, 2 * time).await;
    let seconds = begun.elapsed().as_secs_f64();
    stop.store(true, Ordering::Relaxed);
    flood.join().unwrap();
    let at = |took: &[f64], share: f64| took[((took.len() - 1) as f64 * share) as usize];
    println!(
        "idle: {:.2} ms (median), p99 {:.2}; the server does {capacity:.0} a second; beside {} requests, {:.1} times that in {seconds:.0} s: {:.2} ms, p99 {:.2}, {refused} refused",
        at(&idle, 0.5),
        at(&idle, 0.99),
        sent.load(Ordering::Relaxed),
        sent.load(Ordering::Relaxed) as f64 / (seconds + 1.0) / capacity,
        at(&flooded, 0.5),
        at(&flooded, 0.99),
    );
    server.stop();
}
