//! Figures of the queue where records are shared: jobs from their submission to their results by many worker processes.
//! All workers are there before the first job.
//!
//! `CHLADNI_JOBS` jobs (1000) that sleep for `CHLADNI_SLEEP` seconds (0), by `CHLADNI_WORKER_PROCESSES` workers (16).
#![cfg(all(target_os = "linux", feature = "cluster"))]

#[path = "common/places.rs"]
mod places;
#[path = "common/postgres.rs"]
mod postgres;
mod process;

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufRead, BufReader},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use places::{Places, Worker};
use process::Server;
use rustix::process::Signal;
use serde_json::{Value, json};

const SERVER: &[&str] = &["--workers", "0", "--idle-jobs", "--max-attempts", "1000", "--max-queued-jobs", "1000000"];
/// Clients that submit, each one job after the other.
const CLIENTS: usize = 8;
/// Microseconds of one tick of the times in /proc.
const TICK_US: u64 = 10_000;

/// A worker as an operator would start it, whose metrics are in its log when it has ended.
fn worker(places: &Places, number: usize) -> Worker {
    let log = File::create(log_of(places, number)).unwrap();
    let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
        .args(["worker", "--threads", "1", "--gpu", "off", "--jobs-in", "threads"])
        .args(["--log-level", "error,chladni::metrics=debug"])
        .args(places.settings())
        .envs(places.environment())
        .stdout(Stdio::piped())
        .stderr(log)
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(line, "working\n");
    Worker(process)
}

fn log_of(places: &Places, number: usize) -> std::path::PathBuf {
    places.folder.path().join(format!("worker-{number}.log"))
}

/// Ticks of processor time of a process and its children: those that have ended, and those that live.
fn ticks(pid: u32) -> u64 {
    let fields = |pid: &str| -> Option<(u32, Vec<u64>)> {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        let fields: Vec<&str> = stat.rsplit_once(") ")?.1.split(' ').collect();
        Some((fields[1].parse().ok()?, fields[11..15].iter().filter_map(|ticks| ticks.parse().ok()).collect()))
    };
    let own: u64 = fields(&pid.to_string()).map_or(0, |(_, ticks)| ticks.iter().sum());
    let all = std::fs::read_dir("/proc").unwrap().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let children = all.filter_map(|entry| fields(&entry)).filter(|(parent, _)| *parent == pid);
    own + children.map(|(_, ticks)| ticks[..2].iter().sum::<u64>()).sum::<u64>()
}

/// Where processor time goes.
fn spent(server: &Server, workers: &[Worker]) -> [u64; 4] {
    let own = ticks_of_this();
    let database = postgres::server().and_then(postgres::Server::process).map_or(0, ticks);
    [database, workers.iter().map(|worker| ticks(worker.0.id())).sum(), ticks(server.process.id()), own]
}

fn ticks_of_this() -> u64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split(' ').collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<u64>().unwrap()).sum()
}

/// Claims by the bound of seconds that they took at most, of the logs of workers that have ended.
fn claims(places: &Places, workers: usize) -> BTreeMap<u64, u64> {
    let mut claims = BTreeMap::new();
    for number in 0..workers {
        let log = std::fs::read_to_string(log_of(places, number)).unwrap();
        for line in log.lines().filter_map(|line| line.strip_prefix("chladni_job_claim_seconds_bucket{le=\"")) {
            let (bound, count) = line.split_once("\"} ").unwrap();
            let bound = if bound == "+Inf" { f64::MAX } else { bound.parse().unwrap() };
            *claims.entry(bound.to_bits()).or_default() += count.parse::<u64>().unwrap();
        }
    }
    claims
}

/// Every job, when all are done.
async fn finished(server: &Server) -> Vec<Value> {
    loop {
        let path = format!("{}/v1/jobs?limit=200", server.url);
        let (mut jobs, mut url) = (Vec::new(), path.clone());
        loop {
            let mut page: Value = server.client.get(&url).send().await.unwrap().json().await.unwrap();
            jobs.append(page["items"].as_array_mut().unwrap());
            if jobs.iter().any(|job| job["status"] != "succeeded") {
                break;
            }
            match page["next"].as_str() {
                Some(next) => url = format!("{path}&from={next}"),
                None => return jobs,
            }
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "figures, minutes"]
async fn throughput() {
    let number = |name: &str, usual: f64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (workers, seconds) = (number("CHLADNI_WORKER_PROCESSES", 16.0) as usize, number("CHLADNI_SLEEP", 0.0));
    let jobs = number("CHLADNI_JOBS", 1000.0) as usize;
    let Some(mut places) = Places::new() else { return };
    places.lease = "30";
    let server = places.server_with(SERVER);
    let mesh = server.upload().await;
    let running: Vec<Worker> = (0..workers).map(|number| worker(&places, number)).collect();
    // What processes do when they start is not to be counted.
    tokio::time::sleep(Duration::from_secs(1)).await;
    let before = spent(&server, &running);
    let begun = Instant::now();
    let clients = (0..CLIENTS).map(|client| {
        let (http, url, mesh) = (server.client.clone(), server.url.clone(), mesh.clone());
        tokio::spawn(async move {
            for number in (client..jobs).step_by(CLIENTS) {
                let parameters = json!({"seconds": seconds, "number": number});
                let request = json!({"kind": "idle", "mesh": mesh, "parameters": parameters});
                let answer = http.post(format!("{url}/v1/jobs")).json(&request).send().await.unwrap();
                assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
            }
        })
    });
    for client in clients.collect::<Vec<_>>() {
        client.await.unwrap();
    }
    println!("{jobs} jobs submitted in {:.2} s", begun.elapsed().as_secs_f64());
    let all = finished(&server).await;
    let after = spent(&server, &running);
    assert_eq!(all.len(), jobs);
    let ms = |name: &'static str| all.iter().map(move |job| job[name].as_f64().unwrap());
    let mut took: Vec<f64> =
        ms("finished_ms").zip(ms("started_ms")).map(|(finished, started)| finished - started).collect();
    took.sort_by(f64::total_cmp);
    let first = ms(if seconds > 0.0 { "started_ms" } else { "created_ms" }).fold(f64::MAX, f64::min);
    let whole = (ms("finished_ms").fold(0.0, f64::max) - first) / 1000.0;
    println!(
        "{workers} workers, {jobs} jobs: {whole:.2} s, {:.0} jobs/s, efficiency {:.3}; from claim to result {} ms (median), {} ms (p99)",
        jobs as f64 / whole,
        jobs as f64 * seconds / workers as f64 / whole,
        took[jobs / 2],
        took[jobs * 99 / 100],
    );
    let each: Vec<String> = ["database", "workers", "server", "client"]
        .into_iter()
        .zip(before.iter().zip(after))
        .map(|(who, (before, after))| {
            format!("{who} {:.2}", (after - before) as f64 * TICK_US as f64 / 1000.0 / jobs as f64)
        })
        .collect();
    println!("milliseconds of processor time of each job: {}", each.join(", "));
    for worker in &running {
        worker.signal(Signal::TERM);
    }
    for worker in running {
        assert_eq!(worker.ended(), None);
    }
    let claims = claims(&places, workers);
    for (bound, count) in &claims {
        println!("{count} of {jobs} claims took {} s at most", f64::from_bits(*bound));
        if *count == jobs as u64 {
            break;
        }
    }
    server.stop();
}
