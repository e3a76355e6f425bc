//! Jobs that harm the process they run in: whatever they do, the server lives, says what became of them, and goes on with other work.
#![cfg(target_os = "linux")]

mod process;

use std::time::{Duration, Instant};

use process::{PATIENCE, Server, chladni};
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

/// `cargo test --release --test poison -- --ignored --nocapture storm`, with `STORM` jobs, 1,000 unless told otherwise.
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
