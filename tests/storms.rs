//! Storms over servers, workers, the database and the object store that they share: kills, stops, crashes and refusals,
//! while clients submit without pause. Whatever happens: no job that was acknowledged is lost, none is done twice
//! visibly, nothing is half visible, and what was done is not done again. One job in twelve is divided: its parts are
//! solved by several workers, which die in the middle of them as well.
//!
//! Each storm has a few rounds, a minute together; `CHLADNI_STORMS=1000` has as many as that, and `CHLADNI_SEED=12` has
//! others. `CHLADNI_AWAY=60` keeps the object store away for so many seconds each time.
#![cfg(all(unix, feature = "cluster"))]

#[path = "common/places.rs"]
mod places;
#[path = "common/postgres.rs"]
mod postgres;
mod process;
#[path = "common/storm.rs"]
mod storm;
#[path = "common/weed.rs"]
mod weed;

use std::{
    collections::{HashMap, HashSet},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use chladni::store::fault::FailPoint;
use chladni_s3_server as s3;
use places::{LEASE, Places, Worker};
use process::{PATIENCE, Server};
use rustix::process::Signal;
use serde_json::{Value, json};
use storm::{Dice, rounds, seed};
use weed::Weed;

const WORKERS: usize = 3;

/// One job in so many is an eigenbasis in parts, of this many pairs.
const DIVIDED: u32 = 12;
const PAIRS: usize = 136;
const SERVERS: usize = 2;
/// Nothing is submitted while jobs wait for longer.
const MOST_AGE: Duration = Duration::from_secs(15);

/// What clients know, and where they ask.
struct Clients {
    client: reqwest::Client,
    /// The addresses of the servers that should be there.
    servers: Mutex<Vec<String>>,
    mesh: String,
    /// A mesh that is large enough for bases in parts.
    surface: String,
    /// Jobs that were acknowledged, by their numbers.
    acknowledged: Mutex<HashMap<u32, String>>,
    /// Bases of jobs that were seen to be done.
    seen: Mutex<HashMap<String, String>>,
    next: AtomicU64,
    stop: AtomicBool,
    /// Requests that were answered by an error, or not at all.
    failed: AtomicU64,
}

impl Clients {
    fn server(&self, turn: u64) -> String {
        let servers = self.servers.lock().unwrap();
        servers[turn as usize % servers.len()].clone()
    }

    /// Whether jobs wait for longer than they are worth: storms are to meet jobs at work, and not a queue of an hour.
    async fn is_behind(&self, turn: u64) -> bool {
        let asked = self.client.get(format!("{}/readyz", self.server(turn))).timeout(Duration::from_secs(5));
        let Ok(answer) = asked.send().await else { return false };
        let told = answer.json::<Value>().await.unwrap_or_default();
        told["queue_age_seconds"].as_f64().is_some_and(|age| age > MOST_AGE.as_secs_f64())
    }

    /// Submits jobs one after the other, each until it is acknowledged.
    async fn submit(self: Arc<Self>, mut dice: Dice) {
        while !self.stop.load(Ordering::Relaxed) {
            if self.is_behind(dice.below(8)).await {
                tokio::time::sleep(Duration::from_millis(200)).await;
                continue;
            }
            let number = self.next.fetch_add(1, Ordering::Relaxed) as u32;
            let seconds = dice.below(300) as f64 / 1000.0;
            let request = match number % DIVIDED == 7 {
                true => {
                    // What is asked for with another seed is other work.
                    let parameters =
                        json!({"method": "hsim", "count": PAIRS, "tolerance": 1e-6, "seed": number, "parts": 2});
                    json!({"kind": "eigenbasis", "mesh": self.surface, "parameters": parameters})
                }
                false => {
                    json!({"kind": "idle", "mesh": self.mesh, "parameters": {"seconds": seconds, "number": number}})
                }
            };
            let begun = Instant::now();
            for turn in 0.. {
                assert!(begun.elapsed() < PATIENCE, "job {number} is not taken");
                let asked = self.client.post(format!("{}/v1/jobs", self.server(dice.below(8) + turn)));
                let asked = asked.header("idempotency-key", format!("job {number}")).json(&request);
                let answer = asked.timeout(Duration::from_secs(20)).send().await;
                if let Ok(answer) = answer
                    && answer.status().is_success()
                    && let Ok(job) = answer.json::<Value>().await
                {
                    let id = job["id"].as_str().unwrap().to_owned();
                    self.acknowledged.lock().unwrap().insert(number, id);
                    break;
                }
                self.failed.fetch_add(1, Ordering::Relaxed);
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
            tokio::time::sleep(dice.pause(100, 400)).await;
        }
    }

    /// Looks at jobs at random: what is done stays as it is, and is there as a whole.
    async fn watch(self: Arc<Self>, mut dice: Dice) {
        while !self.stop.load(Ordering::Relaxed) {
            tokio::time::sleep(Duration::from_millis(20)).await;
            let job = {
                let acknowledged = self.acknowledged.lock().unwrap();
                let place = dice.below(acknowledged.len().max(1) as u64) as usize;
                acknowledged.values().nth(place).cloned()
            };
            let Some(job) = job else { continue };
            let Some((200, job)) = self.get(&format!("/v1/jobs/{job}"), &mut dice).await else { continue };
            let job: Value = serde_json::from_slice(&job).unwrap();
            assert!(!["failed", "canceled"].contains(&job["status"].as_str().unwrap()), "{job}");
            if job["status"] != "succeeded" {
                continue;
            }
            let basis = job["basis"].as_str().unwrap_or_else(|| panic!("done without a result: {job}")).to_owned();
            let id = job["id"].as_str().unwrap().to_owned();
            let before = self.seen.lock().unwrap().insert(id, basis.clone());
            assert!(before.is_none_or(|before| before == basis), "done twice: {job}");
            if let Some((status, content)) = self.get(&format!("/v1/bases/{basis}/content"), &mut dice).await {
                assert!(status == 200 && content.starts_with(b"PK"), "{status}: a basis that is seen is there: {job}");
            }
        }
    }

    /// An answer that is no trouble of a server.
    async fn get(&self, path: &str, dice: &mut Dice) -> Option<(u16, Vec<u8>)> {
        let asked = self.client.get(format!("{}{path}", self.server(dice.below(8))));
        let answer = asked.timeout(Duration::from_secs(20)).send().await.ok()?;
        let status = answer.status().as_u16();
        if status >= 500 {
            self.failed.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        // One that is cut in the middle.
        let length = answer.content_length();
        let body = answer.bytes().await.ok()?.to_vec();
        length.is_none_or(|length| length == body.len() as u64).then_some((status, body))
    }

    /// The time until another job is done.
    async fn until_done(&self, server: &Server) -> Duration {
        let begun = Instant::now();
        let number = self.next.fetch_add(1, Ordering::Relaxed) as u32;
        let request = json!({"kind": "idle", "mesh": self.mesh, "priority": 100, "parameters": {"number": number}});
        loop {
            assert!(begun.elapsed() < PATIENCE);
            let asked = self.client.post(format!("{}/v1/jobs", server.url)).json(&request);
            if let Ok(answer) = asked.send().await
                && answer.status().is_success()
                && let Ok(job) = answer.json::<Value>().await
            {
                let id = job["id"].as_str().unwrap().to_owned();
                self.acknowledged.lock().unwrap().insert(number, id.clone());
                if job["status"] == "succeeded" {
                    return begun.elapsed();
                }
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

/// Everything that runs.
struct Scene {
    places: Places,
    weed: Option<Weed>,
    servers: Vec<Server>,
    workers: Vec<Worker>,
    clients: Arc<Clients>,
    tasks: Vec<tokio::task::JoinHandle<()>>,
    dice: Dice,
    done: Done,
}

/// What was done to whom, and how often.
#[derive(Debug, Default)]
struct Done {
    workers_killed: u32,
    workers_killed_at_points: u32,
    servers_killed: u32,
    workers_stopped: u32,
    databases_killed: u32,
    objects_away: u32,
}

/// Storms share the PostgreSQL of this process, which one of them kills: they come one after the other.
static TURNS: tokio::sync::Mutex<()> = tokio::sync::Mutex::const_new(());

const SERVER: &[&str] = &["--workers", "0", "--idle-jobs", "--max-attempts", "1000", "--max-queued-jobs", "1000000"];
const WORKER: &[&str] = &["--jobs-in", "threads", "--workers", "2"];

impl Scene {
    async fn begin(places: Places, weed: Option<Weed>, seed: u64) -> Self {
        let servers: Vec<Server> = (0..SERVERS).map(|_| places.server_with(SERVER)).collect();
        let workers = (0..WORKERS).map(|_| places.worker(WORKER)).collect();
        let (mesh, surface) = (servers[0].upload().await, servers[0].upload_off(process::torus_of(56, 28)).await);
        let clients = Arc::new(Clients {
            client: process::cryptography::client(),
            servers: Mutex::new(servers.iter().map(|server| server.url.clone()).collect()),
            mesh,
            surface,
            acknowledged: Mutex::default(),
            seen: Mutex::default(),
            next: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            failed: AtomicU64::new(0),
        });
        let mut tasks = Vec::new();
        for k in 0..3 {
            tasks.push(tokio::spawn(Arc::clone(&clients).submit(Dice(seed + k))));
            tasks.push(tokio::spawn(Arc::clone(&clients).watch(Dice(seed + 100 + k))));
        }
        Self { places, weed, servers, workers, clients, tasks, dice: Dice(seed), done: Done::default() }
    }

    fn any_worker(&mut self) -> usize {
        self.dice.below(WORKERS as u64) as usize
    }

    fn replace_worker(&mut self, place: usize, settings: &[&str]) {
        self.workers[place] = self.places.worker(&[WORKER, settings].concat());
    }

    /// One worker, or several one after the other, those that have just begun among them. Dropping a worker or a server
    /// kills it.
    fn kill_workers(&mut self) {
        for _ in 0..=self.dice.below(2 * WORKERS as u64 - 1) {
            let place = self.any_worker();
            self.replace_worker(place, &[]);
            self.done.workers_killed += 1;
        }
    }

    /// A worker dies at a point that has a name.
    async fn kill_at_a_point(&mut self) {
        let points: Vec<_> = FailPoint::ALL.into_iter().filter(|&point| point != FailPoint::AfterEnqueue).collect();
        let point = points[self.dice.below(points.len() as u64) as usize];
        let fault = format!("{}:kill:{}", point.name(), self.dice.below(3));
        let place = self.any_worker();
        self.replace_worker(place, &["--fault", &fault]);
        let begun = Instant::now();
        // Not every point is on the way of such jobs.
        while begun.elapsed() < Duration::from_secs(2) && self.workers[place].0.try_wait().unwrap().is_none() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        match self.workers[place].0.try_wait().unwrap() {
            Some(_) => self.done.workers_killed_at_points += 1,
            None => self.done.workers_killed += 1,
        }
        self.replace_worker(place, &[]);
    }

    fn kill_server(&mut self) {
        let place = self.dice.below(SERVERS as u64) as usize;
        let server = self.places.server_with(SERVER);
        self.clients.servers.lock().unwrap()[place] = server.url.clone();
        // The one that it takes the place of is killed in the middle of whatever it does.
        self.servers[place] = server;
        self.done.servers_killed += 1;
    }

    /// Workers, at times all of them, are stopped until their leases have run out, and come back.
    async fn zombies(&mut self) {
        let first = self.any_worker();
        let count = 1 + self.any_worker();
        let places: Vec<usize> = (first..first + count).map(|place| place % WORKERS).collect();
        places.iter().for_each(|&place| self.workers[place].signal(Signal::STOP));
        tokio::time::sleep(LEASE + self.dice.pause(200, 2000)).await;
        places.iter().for_each(|&place| self.workers[place].signal(Signal::CONT));
        self.done.workers_stopped += count as u32;
    }

    /// The database crashes, and is back after a while.
    async fn database_crash(&mut self, away: Duration) -> Duration {
        let database = postgres::server().unwrap();
        database.crash();
        tokio::time::sleep(away).await;
        database.start_anew();
        self.done.databases_killed += 1;
        let back = self.clients.until_done(&self.servers[0]).await;
        println!("  a job was done {:.2} s after the database was back", back.as_secs_f64());
        back
    }

    /// The object store refuses, cuts answers, stops or is killed.
    async fn objects_away(&mut self) {
        let away = seconds_away().unwrap_or_else(|| self.dice.pause(200, 4000));
        self.done.objects_away += 1;
        let Some(weed) = &mut self.weed else {
            let faults = &s3::of_folder(self.places.folder.path(), true).faults;
            faults.cut.store(3, Ordering::Relaxed);
            faults.refuse.store(if self.dice.below(2) == 0 { 10 } else { u64::MAX }, Ordering::Relaxed);
            tokio::time::sleep(away).await;
            faults.refuse.store(0, Ordering::Relaxed);
            faults.cut.store(0, Ordering::Relaxed);
            return;
        };
        if self.dice.below(2) == 0 {
            weed.signal(Signal::STOP);
            tokio::time::sleep(away).await;
            weed.signal(Signal::CONT);
        } else {
            weed.kill();
            tokio::time::sleep(away).await;
            weed.start_anew();
        }
    }

    /// The eigenvalues of a basis.
    async fn values(&self, basis: &str) -> Vec<f64> {
        let answer = self.clients.client.get(format!("{}/v1/bases/{basis}", self.servers[0].url)).send().await.unwrap();
        let basis: Value = answer.json().await.unwrap();
        let values = basis["eigenvalues"].as_array().unwrap_or_else(|| panic!("{basis}"));
        values.iter().map(|value| value.as_f64().unwrap()).collect()
    }

    /// Waits until everything is done, and looks at all of it.
    async fn end(mut self) {
        self.clients.stop.store(true, Ordering::Relaxed);
        for task in self.tasks.drain(..) {
            task.await.unwrap();
        }
        let acknowledged = self.clients.acknowledged.lock().unwrap().clone();
        let begun = Instant::now();
        let (mut done, mut results, mut divided) = (HashMap::new(), HashSet::new(), Vec::new());
        // Those that wait are begun in this order.
        let mut in_order: Vec<_> = acknowledged.iter().collect();
        in_order.sort();
        for (number, id) in in_order {
            let job = self.servers[0].finished(id).await;
            assert_eq!(job["status"], "succeeded", "{job}");
            let basis = job["basis"].as_str().unwrap().to_owned();
            if job["kind"] == "eigenbasis" {
                assert_eq!((&job["parameters"]["seed"], &job["parts"]["done"]), (&json!(number), &json!(2)), "{job}");
                divided.push(self.values(&basis).await);
            } else {
                assert_eq!(job["parameters"]["number"], *number, "{job}");
            }
            if let Some(before) = self.clients.seen.lock().unwrap().get(id) {
                assert_eq!(*before, basis, "done again: {job}");
            }
            assert!(results.insert(basis.clone()), "two jobs with one result: {job}");
            if job["kind"] != "eigenbasis" {
                done.insert(basis, *number);
            }
        }
        // Of one surface, whoever solved which part, and how often one was begun.
        for (values, first) in divided.iter().flat_map(|values| values.iter().zip(&divided[0])) {
            assert!((values - first).abs() <= 1e-7 * first.abs(), "{values} {first}");
        }
        let failed = self.clients.failed.load(Ordering::Relaxed);
        let (all, waited) = (acknowledged.len(), begun.elapsed().as_secs_f64());
        let parents = divided.len();
        println!(
            "{all} jobs acknowledged, {parents} in parts, all done {waited:.1} s after the last; {failed} requests failed"
        );
        println!("{:?}", self.done);
        assert!(all > 20, "only {all} jobs");
        drop(self.workers);
        let jobs = self.places.check_all(&done).await;
        assert_eq!(jobs, all, "a job that nobody asked for, or twice the same");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn kills_stops_and_crashes_lose_nothing_and_do_nothing_twice() {
    let _turn = TURNS.lock().await;
    let Some(places) = Places::over_s3() else { return };
    let mut scene = Scene::begin(places, None, seed(11)).await;
    let begun = Instant::now();
    for round in 0..rounds(8) {
        let pause = scene.dice.pause(50, 800);
        tokio::time::sleep(pause).await;
        match round % 10 {
            0 | 6 => scene.kill_workers(),
            1 | 7 => scene.kill_server(),
            2 => scene.zombies().await,
            3 | 8 => {
                let away = if round % 10 == 3 { Duration::ZERO } else { scene.dice.pause(100, 3000) };
                scene.database_crash(away).await;
            }
            4 | 9 => scene.objects_away().await,
            _ => scene.kill_at_a_point().await,
        }
    }
    println!("{} rounds in {:.0} s", rounds(8), begun.elapsed().as_secs_f64());
    scene.end().await;
}

/// For how long the object store is to be away, where somebody says so.
fn seconds_away() -> Option<Duration> {
    let seconds = std::env::var("CHLADNI_AWAY").ok()?;
    Some(Duration::from_secs(seconds.parse().expect("CHLADNI_AWAY is a number of seconds")))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_real_store_that_is_stopped_and_killed_loses_nothing() {
    let _turn = TURNS.lock().await;
    let Some(mut places) = Places::new() else { return };
    let Some(weed) = Weed::start(places.folder.path()) else { return };
    places.objects = "s3://spectra/lab/one".to_owned();
    let keys = s3::KEYS.map(|(name, value)| (name, value.to_owned()));
    let told = keys.into_iter().chain([("AWS_ENDPOINT", weed.endpoint())]).collect();
    places.s3 = Some((told, weed.objects()));
    let mut scene = Scene::begin(places, Some(weed), seed(12)).await;
    for round in 0..rounds(3) {
        let pause = scene.dice.pause(100, 1500);
        tokio::time::sleep(pause).await;
        match round % 8 {
            5 => scene.kill_workers(),
            7 => scene.zombies().await,
            _ => scene.objects_away().await,
        }
    }
    scene.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_process_that_starts_while_the_database_is_away_waits_for_it() {
    let _turn = TURNS.lock().await;
    let Some(mut places) = Places::new() else { return };
    // Once with the database itself away, and once with a pooler that is there before it.
    for pooled in [false, true] {
        if pooled {
            let Some((pooler, address)) = places::Pooler::before(&places.database, places.folder.path()) else {
                return;
            };
            let direct = std::mem::replace(&mut places.database, address);
            places.pooler = Some((direct, pooler));
        }
        let database = postgres::server().unwrap();
        database.crash();
        let back = tokio::task::spawn_blocking(|| {
            std::thread::sleep(Duration::from_millis(700));
            postgres::server().unwrap().start_anew();
        });
        let server = tokio::task::block_in_place(|| places.server());
        back.await.unwrap();
        let id = server.upload().await;
        let mesh = server.client.get(format!("{}/v1/meshes/{id}", server.url)).send().await.unwrap();
        assert_eq!(mesh.status(), 200, "pooled: {pooled}");
    }
}
