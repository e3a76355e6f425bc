//! Storms over the parts of approximations: whoever plans, solves a part or joins is killed at random, and at points
//! that have names. Whatever happens: what was acknowledged is done, to the same digits as undisturbed; a part that is
//! done is not computed again.
//!
//! A storm has a few rounds; `CHLADNI_STORMS=1000` has as many as that, and `CHLADNI_SEED=12` has others.
#![cfg(unix)]

#[cfg(feature = "cluster")]
#[path = "common/places.rs"]
mod places;
#[cfg(feature = "cluster")]
#[path = "common/postgres.rs"]
mod postgres;
mod process;
#[cfg(feature = "cluster")]
#[path = "common/storm.rs"]
mod storm;

use std::{
    collections::{HashMap, HashSet},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use chladni::store::fault::FailPoint;
use process::{PATIENCE, Server};
use serde_json::{Value, json};
use storm::{Dice, rounds, seed};

const PARTS: usize = 3;
/// After so long it is said what is waited for.
const LONG: Duration = Duration::from_secs(5);
/// So many jobs wait or run while there are rounds to come.
const JOBS_AT_ONCE: usize = 3;

/// A point at which a process dies, when it comes to it for the first time or a later one; or none, in one case of
/// three.
fn fault(dice: &mut Dice) -> Option<String> {
    let points: Vec<FailPoint> =
        FailPoint::ALL.into_iter().chain(FailPoint::OF_DIVISION).filter(|&at| at != FailPoint::AfterEnqueue).collect();
    let point = points[dice.below(points.len() as u64) as usize];
    // Work comes to checkpoints by the hundred.
    let times = dice.below(if point == FailPoint::MidRun { 300 } else { 3 });
    (dice.below(3) > 0).then(|| format!("{}:kill:{times}", point.name()))
}

/// Enough vertices for columns that are made a piece at a time.
fn surface() -> String {
    process::torus_of(112, 56)
}

/// What is asked for with another seed is other work.
fn wanted(seed: usize) -> Value {
    json!({"method": "approximate", "count": 12, "dimension": 40, "accuracy": {"goal": 0.2}, "seed": seed, "parts": PARTS})
}

/// What is asked for, and what is known of it.
struct Watch {
    client: reqwest::Client,
    /// The address of the server, where there is one.
    url: Mutex<Option<String>>,
    /// Jobs that were acknowledged, by their seeds.
    jobs: Mutex<HashMap<usize, String>>,
    /// Jobs that are done.
    done: Mutex<HashSet<String>>,
    stop: AtomicBool,
}

impl Watch {
    fn new(url: Option<String>) -> Arc<Self> {
        Arc::new(Self {
            client: process::cryptography::client(),
            url: Mutex::new(url),
            jobs: Mutex::default(),
            done: Mutex::default(),
            stop: AtomicBool::new(false),
        })
    }

    /// What the server answers, unless it dies meanwhile.
    async fn get(&self, path: &str) -> Option<Value> {
        let url = self.url.lock().unwrap().clone()?;
        let answer = self.client.get(format!("{url}{path}")).timeout(Duration::from_secs(20)).send().await.ok()?;
        let status = answer.status();
        let answer: Value = answer.json().await.ok()?;
        assert!(status.is_success() || status.is_server_error(), "{path}: {answer}");
        status.is_success().then_some(answer)
    }

    fn unfinished(&self) -> usize {
        self.jobs.lock().unwrap().len() - self.done.lock().unwrap().len()
    }

    /// Asks for the next job, and tells whether it was acknowledged. Whoever asks twice gets the same.
    async fn submit(&self, mesh: &str) -> bool {
        let Some(url) = self.url.lock().unwrap().clone() else { return false };
        let seed = self.jobs.lock().unwrap().len() + 1;
        let request = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": wanted(seed)});
        let asked = self.client.post(format!("{url}/v1/jobs")).json(&request).timeout(Duration::from_secs(20));
        let Ok(answer) = asked.send().await else { return false };
        let is_success = answer.status().is_success();
        let Ok(job) = answer.json::<Value>().await else { return false };
        assert!(is_success, "{job}");
        self.jobs.lock().unwrap().insert(seed, job["id"].as_str().unwrap().to_owned());
        true
    }

    /// Looks at jobs and their parts without pause: a part that is done stays as it is.
    async fn look(self: Arc<Self>) -> usize {
        let mut parts: HashMap<String, HashMap<String, Option<Value>>> = HashMap::new();
        let mut seen = 0;
        while !self.stop.load(Ordering::Relaxed) {
            let jobs: Vec<String> = self.jobs.lock().unwrap().values().cloned().collect();
            for job in jobs {
                if self.done.lock().unwrap().contains(&job) {
                    continue;
                }
                let Some(record) = self.get(&format!("/v1/jobs/{job}")).await else { continue };
                assert!(!["failed", "canceled"].contains(&record["status"].as_str().unwrap()), "{record}");
                if record["status"] == "succeeded" {
                    self.done.lock().unwrap().insert(job);
                    continue;
                }
                let Some(list) = self.get(&format!("/v1/jobs?parent={job}")).await else { continue };
                let known = parts.entry(job).or_default();
                for part in list["items"].as_array().unwrap() {
                    let id = part["id"].as_str().unwrap().to_owned();
                    let as_done = json!([part["status"], part["attempt"], part["finished_ms"]]);
                    let before = known.insert(id, (part["status"] == "succeeded").then(|| as_done.clone()));
                    if let Some(Some(before)) = before {
                        assert_eq!(before, as_done, "a part that was done is begun again: {part}");
                        seen += 1;
                    }
                }
                assert!(known.len() <= PARTS, "one part twice: {list}");
            }
            tokio::time::sleep(Duration::from_millis(15)).await;
        }
        seen
    }

    /// Says what jobs, and parts of them, wait for that are not done yet.
    async fn tell_what_is_waited_for(&self, since: Duration) {
        println!("{:.1} s after the last round:", since.as_secs_f64());
        let jobs: Vec<String> = self.jobs.lock().unwrap().values().cloned().collect();
        for job in jobs.into_iter().filter(|job| !self.done.lock().unwrap().contains(job)) {
            let records = [format!("/v1/jobs/{job}"), format!("/v1/jobs?parent={job}")];
            let mut all = Vec::new();
            for path in &records {
                all.extend(self.get(path).await);
            }
            let parts: Vec<Value> =
                all.get(1).and_then(|list| list["items"].as_array()).into_iter().flatten().cloned().collect();
            for record in all.iter().take(1).chain(&parts) {
                let of = |names: &[&str]| -> Vec<String> {
                    names.iter().map(|name| format!("{name} {}", record[name])).collect()
                };
                println!(
                    "  {}",
                    of(&["id", "kind", "status", "attempt", "stage", "progress", "parts", "problem", "started_ms"])
                        .join(", ")
                );
            }
        }
    }

    /// Waits until all is done, and gives what each seed came to; and how often a part was seen done while its job was
    /// not.
    async fn end(self: Arc<Self>, looking: tokio::task::JoinHandle<usize>) -> HashMap<usize, Value> {
        let begun = Instant::now();
        let mut told = Instant::now();
        while self.unfinished() > 0 {
            assert!(!looking.is_finished(), "what was seen is wrong");
            assert!(begun.elapsed() < PATIENCE, "{} jobs are not done", self.unfinished());
            if told.elapsed() > LONG {
                told = Instant::now();
                self.tell_what_is_waited_for(begun.elapsed()).await;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        self.stop.store(true, Ordering::Relaxed);
        let seen = looking.await.unwrap();
        println!(
            "{} jobs, all done {:.1} s after the last round; parts seen done {seen} times",
            self.jobs.lock().unwrap().len(),
            begun.elapsed().as_secs_f64()
        );
        let jobs = self.jobs.lock().unwrap().clone();
        let mut bases = HashMap::new();
        for (seed, id) in &jobs {
            let job = self.get(&format!("/v1/jobs/{id}")).await.unwrap();
            assert_eq!(job["parts"], json!({"done": PARTS, "of": PARTS}), "{job}");
            let basis = self.get(&format!("/v1/bases/{}", job["basis"].as_str().unwrap())).await.unwrap();
            let told = basis["details"]["parts"].as_array().unwrap_or_else(|| panic!("{}", basis["details"]));
            assert_eq!(told.len(), PARTS);
            assert!(basis["details"]["fallbacks"].is_null(), "{}", basis["details"]);
            bases.insert(*seed, basis);
        }
        // Parts go with their jobs, and nobody asked for more than these.
        loop {
            let listed = |list: Value| list["items"].as_array().unwrap().len();
            let parts = listed(self.get("/v1/jobs?kind=eigenbasis_part").await.unwrap());
            if parts == 0 {
                assert_eq!(listed(self.get("/v1/jobs?limit=200").await.unwrap()), jobs.len().min(200));
                return bases;
            }
            assert!(begun.elapsed() < PATIENCE, "{parts} parts are left");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

/// That what was made in a storm is what a server makes that nobody disturbs.
async fn compare(made: HashMap<usize, Value>) {
    let folder = tempfile::tempdir().unwrap();
    let quiet = Server::start(folder.path(), &["--workers", "2", "--jobs-in", "threads"]);
    let mesh = quiet.upload_off(surface()).await;
    let mut jobs = Vec::new();
    for seed in made.keys() {
        jobs.push((seed, quiet.submit_with(&mesh, wanted(*seed)).await.unwrap()));
    }
    let watch = Watch::new(Some(quiet.url.clone()));
    for (seed, job) in jobs {
        let job = quiet.finished(&job).await;
        let known = watch.get(&format!("/v1/bases/{}", job["basis"].as_str().unwrap_or_else(|| panic!("{job}")))).await;
        let (known, found) = (known.unwrap(), &made[seed]);
        assert_eq!(found["eigenvalues"], known["eigenvalues"], "seed {seed}");
        assert_eq!(found["certificate"], known["certificate"], "seed {seed}");
        assert_eq!(found["eigenvalues"].as_array().unwrap().len(), 12);
    }
    quiet.stop();
}

/// A server with its own workers, over SQLite: it is killed with all of them, and started again.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_is_killed_over_and_over_joins_what_it_would_have_undisturbed() {
    let folder = tempfile::tempdir().unwrap();
    let start = |fault: Option<&str>| {
        let settings = ["--workers", "2", "--jobs-in", "threads", "--max-attempts", "1000"];
        let fault: Vec<&str> = fault.into_iter().flat_map(|fault| ["--fault", fault]).collect();
        Server::begin(folder.path(), &[&settings[..], &fault[..]].concat(), &[])
    };
    let mut server = start(None).unwrap();
    let mesh = server.upload_off(surface()).await;
    let watch = Watch::new(Some(server.url.clone()));
    let looking = tokio::spawn(Arc::clone(&watch).look());
    let mut dice = Dice(seed(21));
    let (mut at_points, begun) = (0, Instant::now());
    for _ in 0..rounds(10) {
        while watch.unfinished() < JOBS_AT_ONCE && watch.submit(&mesh).await {}
        let until = Instant::now() + dice.pause(30, 500);
        while Instant::now() < until && server.process.try_wait().unwrap().is_none() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        at_points += usize::from(server.process.try_wait().unwrap().is_some());
        *watch.url.lock().unwrap() = None;
        server.kill();
        let fault = fault(&mut dice);
        server = start(fault.as_deref()).or_else(|_| start(None)).unwrap();
        *watch.url.lock().unwrap() = Some(server.url.clone());
    }
    *watch.url.lock().unwrap() = None;
    server.kill();
    println!(
        "{} rounds in {:.1} s, {at_points} deaths at points that have names",
        rounds(10),
        begun.elapsed().as_secs_f64()
    );
    server = start(None).unwrap();
    *watch.url.lock().unwrap() = Some(server.url.clone());
    // One may have been taken up by a server that did not live to say so.
    assert!(watch.submit(&mesh).await);
    let made = Arc::clone(&watch).end(looking).await;
    server.stop();
    let examined = process::chladni(&["doctor", "--data", folder.path().to_str().unwrap()]);
    assert!(examined.status.success(), "{examined:?}");
    compare(made).await;
}

/// Workers that share a PostgreSQL and a store of objects with a server.
#[cfg(feature = "cluster")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_that_are_killed_over_and_over_join_what_they_would_have_undisturbed() {
    const WORKERS: usize = 3;
    let Some(places) = places::Places::over_s3() else { return };
    let server = places.server_with(&["--workers", "0", "--max-attempts", "1000"]);
    let mesh = server.upload_off(surface()).await;
    let start = |fault: Option<&str>| {
        let fault: Vec<&str> = fault.into_iter().flat_map(|fault| ["--fault", fault]).collect();
        places.worker(&[&["--jobs-in", "threads"][..], &fault[..]].concat())
    };
    let watch = Watch::new(Some(server.url.clone()));
    let looking = tokio::spawn(Arc::clone(&watch).look());
    let mut dice = Dice(seed(22));
    let mut workers: Vec<places::Worker> = (0..WORKERS).map(|_| start(None)).collect();
    let (mut at_points, begun) = (0, Instant::now());
    for _ in 0..rounds(8) {
        while watch.unfinished() < JOBS_AT_ONCE {
            assert!(watch.submit(&mesh).await);
        }
        tokio::time::sleep(dice.pause(30, 500)).await;
        // Those that died of themselves, and one more. Dropping a worker kills it.
        let doomed = dice.below(WORKERS as u64) as usize;
        for (place, worker) in workers.iter_mut().enumerate() {
            let is_dead = worker.0.try_wait().unwrap().is_some();
            at_points += usize::from(is_dead);
            if is_dead || place == doomed {
                *worker = start(fault(&mut dice).as_deref());
            }
        }
    }
    println!(
        "{} rounds in {:.1} s, {at_points} deaths at points that have names",
        rounds(8),
        begun.elapsed().as_secs_f64()
    );
    workers.clear();
    workers.extend((0..WORKERS).map(|_| start(None)));
    let made = Arc::clone(&watch).end(looking).await;
    let jobs = made.len();
    assert_eq!(places.check().await, jobs, "a job that nobody asked for");
    drop(workers);
    server.stop();
    compare(made).await;
}
