//! What the queue promises, with runners that behave and runners that do not.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use tempfile::TempDir;
use uuid::Uuid;

use super::{
    fault::{FailPoint, FaultAction, Faults},
    *,
};
use crate::store::{
    JobRecord, JobStatus, Store, StoreOptions,
    tests::{basis, mesh, new_job, options},
};

/// A runner made of a function.
struct Does<F>(F);

impl<F> Runner for Does<F>
where
    F: Fn(&JobRecord, &dyn Monitor) -> Result<Outcome, JobFailure> + Send + Sync + 'static,
{
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        assert_eq!(mesh.positions.len(), 9);
        self.0(job, monitor)
    }
}

fn outcome() -> Outcome {
    Outcome::Product(basis(2.0, 40).into())
}

/// Goes through two stages with checkpoints.
fn steady(monitor: &dyn Monitor, steps: usize, pause: Duration) -> Result<Outcome, JobFailure> {
    for stage in ["basis", "eigen"] {
        monitor.stage(stage);
        for step in 0..steps {
            monitor.progress(step as f64 / steps as f64);
            monitor.checkpoint()?;
            std::thread::sleep(pause);
        }
    }
    Ok(outcome())
}

/// What an observer heard.
#[derive(Default)]
struct Ears(Mutex<Vec<String>>);

impl Ears {
    fn heard(&self) -> Vec<String> {
        self.0.lock().unwrap().clone()
    }
    fn note(&self, text: String) {
        self.0.lock().unwrap().push(text);
    }
}

impl QueueObserver for Ears {
    fn claimed(&self, kind: &str, queue_seconds: f64) {
        assert!(kind == "eigenbasis" && (0.0..60.0).contains(&queue_seconds));
        self.note("claimed".to_owned());
    }
    fn stage_ended(&self, _kind: &str, stage: &str, seconds: f64) {
        assert!(seconds >= 0.0);
        self.note(format!("stage {stage}"));
    }
    fn retried(&self, _kind: &str) {
        self.note("retried".to_owned());
    }
    fn lease_lost(&self, _kind: &str) {
        self.note("lost".to_owned());
    }
    fn finished(&self, _kind: &str, status: JobStatus) {
        self.note(status.to_string());
    }
}

struct Bench {
    store: Store,
    mesh: String,
    pool: WorkerPool,
    ears: Arc<Ears>,
    _folder: TempDir,
}

impl Bench {
    async fn start<F>(settings: WorkerOptions, faults: Faults, runner: F) -> Self
    where
        F: Fn(&JobRecord, &dyn Monitor) -> Result<Outcome, JobFailure> + Send + Sync + 'static,
    {
        let folder = tempfile::tempdir().unwrap();
        let retry_pause = Duration::from_millis(10);
        let store = Store::open(StoreOptions { retry_pause, faults, ..options(&folder) }).await.unwrap();
        let id = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
        let ears = Arc::new(Ears::default());
        let observer = Arc::clone(&ears) as Arc<dyn QueueObserver>;
        let pool = WorkerPool::start(store.clone(), settings, Arc::new(Does(runner)), observer);
        Self { store, mesh: id, pool, ears, _folder: folder }
    }

    async fn enqueue(&self, work: &str) -> Uuid {
        self.store.enqueue(new_job(&self.mesh, work)).await.unwrap().record.id
    }

    /// Waits until a job is as described, by its events.
    async fn until(&self, id: Uuid, holds: impl Fn(&JobRecord) -> bool) -> JobRecord {
        let mut events = self.store.watch_jobs();
        tokio::time::timeout(Duration::from_secs(60), async {
            loop {
                let job = self.store.job(id).await.unwrap();
                if holds(&job) {
                    return job;
                }
                let _ = events.recv().await;
            }
        })
        .await
        .unwrap()
    }

    async fn finished(&self, id: Uuid) -> JobRecord {
        self.until(id, |job| job.status.is_finished()).await
    }
}

fn quick(workers: usize) -> WorkerOptions {
    WorkerOptions { workers, threads: 2, heartbeat: Duration::from_millis(50), ..WorkerOptions::default() }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_runs_through_its_stages_to_its_basis() {
    let bench =
        Bench::start(quick(1), Faults::default(), |_, monitor| steady(monitor, 10, Duration::from_millis(20))).await;
    let id = bench.enqueue("a").await;
    let running = bench.until(id, |job| job.stage.as_deref() == Some("eigen") && job.progress > Some(0.0)).await;
    assert_eq!((running.status, running.stage_seconds.len()), (JobStatus::Processing, 2));
    let job = bench.finished(id).await;
    assert_eq!((job.status, job.attempt, job.problem), (JobStatus::Succeeded, 1, None));
    let stages: Vec<&str> = job.stage_seconds.iter().map(|(stage, _)| stage.as_str()).collect();
    assert_eq!(stages, ["basis", "eigen"]);
    assert!(job.stage_seconds.iter().all(|(_, seconds)| *seconds >= 0.2));
    assert_eq!(*bench.store.load_basis(job.basis.unwrap()).await.unwrap(), basis(2.0, 40));
    assert!(bench.pool.alive());
    bench.pool.drain(Duration::from_secs(5)).await;
    assert!(!bench.pool.alive());
    assert_eq!(bench.ears.heard(), ["claimed", "stage basis", "stage eigen", "stage store", "succeeded"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn many_jobs_on_several_workers_run_once_each() {
    let runs = Arc::new(AtomicUsize::new(0));
    let bench = Bench::start(quick(4), Faults::default(), {
        let runs = Arc::clone(&runs);
        move |_, monitor| {
            runs.fetch_add(1, Ordering::Relaxed);
            steady(monitor, 1, Duration::from_millis(1))
        }
    })
    .await;
    let mut ids = Vec::new();
    for job in 0..40 {
        ids.push(bench.enqueue(&format!("{job}")).await);
    }
    for id in ids {
        assert_eq!(bench.finished(id).await.status, JobStatus::Succeeded);
    }
    assert_eq!(runs.load(Ordering::Relaxed), 40);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn poison_is_tried_so_often_and_no_more() {
    let runs = Arc::new(AtomicUsize::new(0));
    let bench = Bench::start(quick(1), Faults::default(), {
        let runs = Arc::clone(&runs);
        move |job, monitor| {
            monitor.stage("eigen");
            if job.work_key == "poison" {
                runs.fetch_add(1, Ordering::Relaxed);
                panic!("poison");
            }
            Ok(outcome())
        }
    })
    .await;
    let poison = bench.enqueue("poison").await;
    let good = bench.enqueue("good").await;
    let failed = bench.finished(poison).await;
    assert_eq!((failed.status, failed.attempt), (JobStatus::Failed, 3));
    let problem = failed.problem.unwrap();
    assert_eq!(problem.kind, "worker-panicked");
    assert!(problem.detail.contains("at stage eigen"), "{}", problem.detail);
    assert_eq!(bench.finished(good).await.status, JobStatus::Succeeded);
    assert_eq!(runs.load(Ordering::Relaxed), 3);
    assert!(bench.pool.alive());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_cannot_be_done_is_not_tried_again() {
    let bench = Bench::start(quick(1), Faults::default(), |_, _| {
        Err(JobFailure::Failed { kind: "no-such-thing".to_owned(), detail: "face 3".to_owned(), retryable: false })
    })
    .await;
    let failed = bench.enqueue("a").await;
    let failed = bench.finished(failed).await;
    assert_eq!((failed.status, failed.attempt), (JobStatus::Failed, 1));
    assert_eq!(failed.problem.unwrap().kind, "no-such-thing");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_running_job_is_cancelled_within_a_second() {
    let bench =
        Bench::start(quick(1), Faults::default(), |_, monitor| steady(monitor, 100_000, Duration::from_millis(5)))
            .await;
    let id = bench.enqueue("a").await;
    bench.until(id, |job| job.stage.is_some()).await;
    let asked = Instant::now();
    bench.store.cancel_job(id).await.unwrap();
    let job = bench.finished(id).await;
    assert_eq!((job.status, job.basis), (JobStatus::Canceled, None));
    assert!(asked.elapsed() < Duration::from_secs(1), "{:?}", asked.elapsed());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_that_does_not_listen_is_cancelled_all_the_same() {
    let bench = Bench::start(quick(1), Faults::default(), |job, monitor| {
        monitor.stage("eigen");
        if job.work_key == "deaf" {
            std::thread::sleep(Duration::from_secs(2));
        }
        Ok(outcome())
    })
    .await;
    let deaf = bench.enqueue("deaf").await;
    bench.until(deaf, |job| job.stage.is_some()).await;
    let asked = Instant::now();
    bench.store.cancel_job(deaf).await.unwrap();
    assert_eq!(bench.finished(deaf).await.status, JobStatus::Canceled);
    assert!(asked.elapsed() < Duration::from_secs(1), "{:?}", asked.elapsed());
    // Its result, when it comes, is void; the worker goes on.
    let next = bench.enqueue("next").await;
    assert_eq!(bench.finished(next).await.status, JobStatus::Succeeded);
    assert_eq!(bench.store.job(deaf).await.unwrap().basis, None);
    bench.pool.drain(Duration::from_secs(5)).await;
    assert_eq!(bench.ears.heard().iter().filter(|word| *word == "succeeded").count(), 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stalled_job_is_left_behind_and_tried_again() {
    let settings = WorkerOptions { stall: Duration::from_millis(300), ..quick(1) };
    let release = Arc::new(AtomicUsize::new(0));
    let bench = Bench::start(settings, Faults::default(), {
        let release = Arc::clone(&release);
        move |job, monitor| {
            monitor.stage("eigen");
            if job.attempt == 1 {
                while release.load(Ordering::Relaxed) == 0 {
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
            Ok(outcome())
        }
    })
    .await;
    let id = bench.enqueue("a").await;
    let waiting = bench.until(id, |job| job.problem.is_some()).await;
    assert_eq!(waiting.problem.unwrap().kind, "worker-stalled");
    let job = bench.finished(id).await;
    assert_eq!((job.status, job.attempt), (JobStatus::Succeeded, 2));
    // The first attempt wakes up and comes to a result that nobody wants.
    release.store(1, Ordering::Relaxed);
    bench.pool.drain(Duration::from_secs(5)).await;
    assert_eq!(bench.store.job(id).await.unwrap(), job);
    assert_eq!(bench.ears.heard().iter().filter(|word| *word == "succeeded").count(), 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_pool_with_too_much_hanging_work_says_so_and_recovers() {
    let settings = WorkerOptions { stall: Duration::from_millis(50), ..quick(1) };
    let release = Arc::new(AtomicUsize::new(0));
    let bench = Bench::start(settings, Faults::default(), {
        let release = Arc::clone(&release);
        move |_, monitor| {
            monitor.stage("eigen");
            while release.load(Ordering::Relaxed) == 0 {
                std::thread::sleep(Duration::from_millis(10));
            }
            Ok(outcome())
        }
    })
    .await;
    // Two jobs of three attempts each, of which five may hang.
    let (first, second) = (bench.enqueue("a").await, bench.enqueue("b").await);
    let begun = Instant::now();
    while bench.pool.alive() {
        assert!(begun.elapsed() < Duration::from_secs(30));
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    bench.until(second, |job| job.status == JobStatus::Enqueued && job.problem.is_some()).await;
    release.store(1, Ordering::Relaxed);
    assert!(bench.finished(first).await.attempt <= 3);
    assert_eq!(bench.finished(second).await.status, JobStatus::Succeeded);
    assert!(bench.pool.alive());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drain_lets_short_jobs_end_and_gives_long_ones_back() {
    let bench = Bench::start(quick(2), Faults::default(), |job, monitor| {
        let steps = if job.work_key == "long" { 1_000_000 } else { 10 };
        steady(monitor, steps, Duration::from_millis(10))
    })
    .await;
    let (long, short) = (bench.enqueue("long").await, bench.enqueue("short").await);
    for id in [long, short] {
        bench.until(id, |job| job.stage.is_some()).await;
    }
    let begun = Instant::now();
    bench.pool.drain(Duration::from_secs(2)).await;
    assert!(begun.elapsed() < Duration::from_secs(10));
    assert_eq!(bench.store.job(short).await.unwrap().status, JobStatus::Succeeded);
    let long = bench.store.job(long).await.unwrap();
    assert_eq!((long.status, long.attempt, long.problem), (JobStatus::Enqueued, 0, None));
    let later = bench.enqueue("later").await;
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert_eq!(bench.store.job(later).await.unwrap().status, JobStatus::Enqueued, "nothing is claimed any more");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panic_wherever_it_strikes_costs_one_attempt() {
    use FailPoint::*;
    for point in [AfterClaim, MidRun, BeforeChunks, MidChunks, BeforeBlobReady, AfterBlobReady, BeforeComplete] {
        // The mesh passes the points of content once, before any job does.
        let passes = u32::from(matches!(point, MidChunks | BeforeBlobReady | AfterBlobReady));
        let faults = Faults::armed_once(point, FaultAction::Panic, passes);
        let settings = WorkerOptions { lease: Duration::from_millis(400), ..quick(1) };
        let bench = Bench::start(settings, faults, |_, monitor| steady(monitor, 2, Duration::from_millis(1))).await;
        let id = bench.enqueue("a").await;
        let job = bench.finished(id).await;
        assert_eq!((job.status, job.attempt), (JobStatus::Succeeded, 2), "{point:?}");
        assert_eq!(*bench.store.load_basis(job.basis.unwrap()).await.unwrap(), basis(2.0, 40));
        assert!(bench.pool.alive());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_run_at_once_only_where_their_memory_suffices() {
    let running = Arc::new(AtomicUsize::new(0));
    let most = Arc::new(AtomicUsize::new(0));
    let (now, peak) = (Arc::clone(&running), Arc::clone(&most));
    let settings = WorkerOptions { memory: 100, ..quick(4) };
    let bench = Bench::start(settings, Faults::default(), move |job, monitor| {
        let bytes = job.memory_bytes as usize;
        let taken = now.fetch_add(bytes, Ordering::SeqCst) + bytes;
        peak.fetch_max(taken, Ordering::SeqCst);
        let done = steady(monitor, 5, Duration::from_millis(5));
        now.fetch_sub(bytes, Ordering::SeqCst);
        done
    })
    .await;
    let mut jobs = Vec::new();
    for (k, memory_bytes) in [60, 30, 80, 10, 50, 50, 100, 20].into_iter().enumerate() {
        let new = crate::store::NewJob { memory_bytes, ..new_job(&bench.mesh, &format!("{k}")) };
        jobs.push(bench.store.enqueue(new).await.unwrap().record.id);
    }
    for job in jobs {
        assert_eq!(bench.finished(job).await.status, JobStatus::Succeeded);
    }
    let most = most.load(Ordering::SeqCst);
    assert!((90..=100).contains(&most), "{most}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_that_can_never_fit_is_told() {
    let settings = WorkerOptions { memory: 100, ..quick(2) };
    let bench =
        Bench::start(settings, Faults::default(), |_, monitor| steady(monitor, 1, Duration::from_millis(1))).await;
    let new = crate::store::NewJob { memory_bytes: 101, ..new_job(&bench.mesh, "large") };
    let large = bench.store.enqueue(new).await.unwrap().record.id;
    let small = bench.enqueue("small").await;
    let large = bench.finished(large).await;
    let problem = large.problem.unwrap();
    assert_eq!((large.status, problem.kind.as_str()), (JobStatus::Failed, "job-too-large"));
    assert!(problem.detail.contains("101") && problem.detail.contains("100"), "{problem:?}");
    assert_eq!(bench.finished(small).await.status, JobStatus::Succeeded);
}
