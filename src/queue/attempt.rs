//! One attempt at a job: from the claim to what becomes of it.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use chladni_spectral::basis::Product;
use chladni_work::{Division, MeshSize};
use tokio::{
    sync::{broadcast, mpsc, oneshot},
    time::{Instant, MissedTickBehavior, interval},
};
use uuid::Uuid;

use super::{
    JobFailure, Outcome, WorkerOptions,
    divided::{self, Next},
    memory::Reservation,
    monitor::AttemptMonitor,
    shared::{Ending, Shared, signalled},
};
use crate::store::{
    Claim, CompleteAnswer, DivideAnswer, FailAnswer, HeartbeatAnswer, JobEvent, JobProblem, JobRecord, JobStatus,
    Progress, Store, StoreError, Subject,
};

/// How often the heartbeat looks whether there is anything to write down.
const LOOK: Duration = Duration::from_millis(100);
/// Work that was asked to stop gets so long until its job is cancelled without it.
const CANCEL_PATIENCE: Duration = Duration::from_millis(300);
/// Pause between two tries to write down what became of an attempt, while the storage refuses.
const STORE_PAUSE: Duration = Duration::from_millis(500);
/// A storage that others share is waited for so long before an attempt begins.
const SUBJECT_PATIENCE: Duration = Duration::from_secs(300);

/// A result that takes longer to be stored may wait for the storage: then that is told.
const DELAY_LOOK: Duration = Duration::from_secs(3);

/// What the heartbeat tells the attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// The job was asked to stop.
    Cancel,
    /// The lease is lost.
    Lost,
    /// The work has not been heard of for too long.
    Stalled,
}

/// Whether the worker's pool of threads is free again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Threads {
    /// The work has ended.
    Free,
    /// The work was left behind and may still run.
    Occupied,
}

/// Runs one attempt to its end. The job is left in a state that tells the truth, or its lease runs out. `memory` is
/// held until the work has ended, left behind or not, and its result is stored; `events` are those since before the
/// claim.
pub(super) async fn run(
    shared: &Arc<Shared>,
    claim: Claim,
    memory: Reservation,
    events: broadcast::Receiver<JobEvent>,
    threads: &rayon::ThreadPool,
) -> Threads {
    let Claim { job, token, .. } = claim;
    let memory = Arc::new(memory);
    let waited_ms = job.started_ms.unwrap_or(job.enqueued_ms) - job.enqueued_ms.max(job.not_before_ms);
    shared.observer.claimed(&job.kind, waited_ms.max(0) as f64 / 1000.0);
    tracing::info!(mesh = job.mesh, "job claimed");

    let monitor = Arc::new(AttemptMonitor::new(shared.store.faults().clone(), job.memory_bytes));
    let (verdicts, mut verdict) = mpsc::channel(4);
    let beating =
        Heartbeat { store: shared.store.clone(), job: job.id, token, monitor: Arc::clone(&monitor), verdicts, events };
    let beating = AbortOnDrop(tokio::spawn(beating.run(shared.options.clone())));

    if let Some(too_large) = too_large(&job, shared.budget.total()) {
        record_ending(shared, &job.kind, Ending::Failed(too_large, false), token).await;
        return Threads::Free;
    }
    let subject = match load_subject(shared, &job, token, &mut verdict).await {
        Ok(Some(subject)) => subject,
        Ok(None) => return Threads::Free,
        Err(error) => {
            // Content that others share may be missing for this process alone, or be written anew meanwhile.
            let retryable =
                error.is_retryable() || (shared.store.is_shared() && matches!(error, StoreError::Damaged { .. }));
            let name = if job.bases.is_empty() { "mesh-unavailable" } else { "basis-unavailable" };
            record_ending(shared, &job.kind, Ending::Failed(problem(name, &error), retryable), token).await;
            return Threads::Free;
        }
    };
    let subject = match divided::next(shared, &job, subject).await {
        Ok(Next::Run(subject)) => subject,
        Ok(Next::Fail(problem)) => {
            record_ending(shared, &job.kind, Ending::Failed(problem, false), token).await;
            return Threads::Free;
        }
        Ok(Next::Wait) => {
            record_ending(shared, &job.kind, Ending::Released, token).await;
            return Threads::Free;
        }
        Err(error) => {
            let retryable = error.is_retryable();
            record_ending(shared, &job.kind, Ending::Failed(problem("parts-unavailable", &error), retryable), token)
                .await;
            return Threads::Free;
        }
    };
    let size = divided::mesh_size(&subject);
    let result = begin(shared, &job, subject, &monitor, &memory, threads);
    let attempt = UnderWay { shared, job: &job, size, token, monitor: &monitor, cancel_deadline: None, settled: false };
    let threads = attempt.wait_for_result(result, verdict).await;
    drop((beating, memory));
    threads
}

/// Why a job that needs more memory than all jobs may use is not begun.
fn too_large(job: &JobRecord, total: u64) -> Option<JobProblem> {
    let needed = job.memory_bytes;
    let detail = format!("the job needs about {needed} bytes of memory; jobs on this server may use {total}");
    (needed > total).then(|| JobProblem { kind: "job-too-large".to_owned(), detail })
}

/// Begins the work on the worker's threads. Its memory is held until it has ended, whether or not anybody waits for it
/// any more.
fn begin(
    shared: &Arc<Shared>,
    job: &JobRecord,
    subject: Subject,
    monitor: &Arc<AttemptMonitor>,
    memory: &Arc<Reservation>,
    threads: &rayon::ThreadPool,
) -> oneshot::Receiver<Worked> {
    let (sender, result) = oneshot::channel();
    let left_behind = LeftBehind::new(Arc::clone(&shared.left_behind));
    let (runner, job) = (Arc::clone(&shared.runner), job.clone());
    let (monitor, memory) = (Arc::clone(monitor), Arc::clone(memory));
    threads.spawn(move || {
        let outcome = catch_unwind(AssertUnwindSafe(|| runner.run_on(&job, subject, monitor.as_ref())));
        // Nobody may be waiting any more; then the result is void.
        let _ = sender.send(outcome);
        drop((left_behind, memory));
    });
    result
}

/// An attempt whose work is under way.
struct UnderWay<'a> {
    shared: &'a Shared,
    job: &'a JobRecord,
    /// Of the mesh that it is on, where it is on one.
    size: MeshSize,
    token: Uuid,
    monitor: &'a AttemptMonitor,
    /// When the job is cancelled without its work, which was asked to stop.
    cancel_deadline: Option<Instant>,
    /// Whether it is written down what became of the attempt, or that is no longer ours to do.
    settled: bool,
}

impl UnderWay<'_> {
    /// Waits for the work, and for all that may make it void.
    async fn wait_for_result(
        mut self,
        mut result: oneshot::Receiver<Worked>,
        mut verdicts: mpsc::Receiver<Verdict>,
    ) -> Threads {
        let mut draining = self.shared.give_back.subscribe();
        loop {
            tokio::select! {
                outcome = &mut result => {
                    if !self.settled {
                        self.record_outcome(outcome).await;
                    }
                    return Threads::Free;
                }
                Some(verdict) = verdicts.recv() => match verdict {
                    Verdict::Cancel => {
                        self.monitor.cancel();
                        self.cancel_deadline.get_or_insert(Instant::now() + CANCEL_PATIENCE);
                    }
                    Verdict::Lost => self.on_lease_lost(),
                    Verdict::Stalled => {
                        self.on_stalled().await;
                        return Threads::Occupied;
                    }
                },
                () = until(self.cancel_deadline) => {
                    // The work stops when it comes to it; the client need not wait for that.
                    self.cancel_deadline = None;
                    self.record_ending(Ending::Canceled).await;
                }
                () = signalled(&mut draining) => {
                    self.monitor.cancel();
                    self.record_ending(Ending::Released).await;
                    return Threads::Occupied;
                }
            }
        }
    }

    /// Somebody else has the job now.
    fn on_lease_lost(&mut self) {
        if std::mem::replace(&mut self.settled, true) {
            return;
        }
        tracing::warn!("lease lost: another worker may have the job, and what this attempt comes to is discarded");
        self.shared.observer.lease_lost(&self.job.kind);
        self.monitor.cancel();
    }

    /// The work is left behind, since nothing is heard of it.
    async fn on_stalled(&mut self) {
        tracing::error!("job stalled");
        self.monitor.cancel();
        let (silent, stage) = (self.monitor.since_last_activity().as_secs_f64(), stage_words(self.monitor));
        let detail = format!("no heartbeat for {silent:.1} s{stage}");
        self.record_ending(Ending::Failed(JobProblem { kind: "worker-stalled".to_owned(), detail }, true)).await;
    }

    /// Writes down how the attempt ended, unless something is written down already.
    async fn record_ending(&mut self, ending: Ending) {
        if !std::mem::replace(&mut self.settled, true) {
            record_ending(self.shared, &self.job.kind, ending, self.token).await;
        }
    }

    /// Writes down what the work came to.
    async fn record_outcome(&self, returned: Returned) {
        let Self { shared, token, monitor, .. } = *self;
        let kind = self.job.kind.as_str();
        let ending = match returned {
            Ok(Ok(Ok(Outcome::Product(product)))) => return store_result(shared, kind, token, monitor, product).await,
            Ok(Ok(Ok(Outcome::Parts(division)))) => return self.divide(division).await,
            Ok(Ok(Err(JobFailure::Cancelled(_)))) => Ending::Canceled,
            Ok(Ok(Err(JobFailure::Failed { kind, detail, retryable }))) => {
                Ending::Failed(JobProblem { kind, detail }, retryable)
            }
            Ok(Ok(Err(JobFailure::NeedsMore { bytes, detail }))) => {
                divided::enlarged(shared, self.job, bytes, detail).await
            }
            Ok(Ok(Err(JobFailure::Died { how }))) => {
                shared.observer.died(kind);
                Ending::Died(how)
            }
            Ok(Err(_)) | Err(_) => {
                let detail = format!("the worker panicked{}", stage_words(monitor));
                Ending::Failed(JobProblem { kind: "worker-panicked".to_owned(), detail }, true)
            }
        };
        record_ending(shared, kind, ending, token).await;
    }

    /// Gives the job back with the parts that it waits for from now on.
    async fn divide(&self, division: Division) {
        let Self { shared, job, token, .. } = *self;
        let new = match divided::part_jobs(shared, job, self.size, division).await {
            Ok(new) => new,
            Err(problem) => return record_ending(shared, &job.kind, Ending::Failed(problem, false), token).await,
        };
        match shared.store.divide(token, new).await {
            Ok(DivideAnswer::Divided(_)) => tracing::info!(parts = division.parts, "job divided"),
            Ok(DivideAnswer::Canceled) => shared.observer.finished(&job.kind, JobStatus::Canceled),
            Ok(DivideAnswer::Lost) => shared.observer.lease_lost(&job.kind),
            Err(error) => {
                record_ending(shared, &job.kind, Ending::Failed(problem("storage-unavailable", &error), true), token)
                    .await;
            }
        }
    }
}

/// Loads what a job is about. A storage that others share and that does not answer is waited for while the lease holds:
/// an attempt that has not begun is not used up. `None` where it has ended meanwhile.
async fn load_subject(
    shared: &Shared,
    job: &JobRecord,
    token: Uuid,
    verdict: &mut mpsc::Receiver<Verdict>,
) -> Result<Option<Subject>, StoreError> {
    let mut draining = shared.give_back.subscribe();
    let begun = Instant::now();
    loop {
        match shared.store.load_subject(job).await {
            Err(error) if shared.store.is_shared() && error.is_retryable() && begun.elapsed() < SUBJECT_PATIENCE => {
                tracing::warn!(%error, "the input of the job cannot be read yet");
            }
            // The job is as good as before, and another worker may be let in.
            Err(error @ StoreError::Refused { .. }) => {
                tracing::error!(%error, "reading the input of the job is forbidden; this process takes no jobs until it is allowed");
                shared.note_refusal();
                record_ending(shared, &job.kind, Ending::Released, token).await;
                return Ok(None);
            }
            loaded => return loaded.map(Some),
        }
        let verdict = tokio::select! {
            () = tokio::time::sleep(STORE_PAUSE) => continue,
            Some(verdict) = verdict.recv() => verdict,
            () = signalled(&mut draining) => {
                record_ending(shared, &job.kind, Ending::Released, token).await;
                return Ok(None);
            }
        };
        match verdict {
            Verdict::Lost => shared.observer.lease_lost(&job.kind),
            Verdict::Cancel => record_ending(shared, &job.kind, Ending::Canceled, token).await,
            // No work has begun that could have stalled.
            Verdict::Stalled => record_ending(shared, &job.kind, Ending::Released, token).await,
        }
        return Ok(None);
    }
}

/// What the work came to, by way of a thread that may have panicked.
type Worked = std::thread::Result<Result<Outcome, JobFailure>>;

/// The same, if it came to anything.
type Returned = Result<Worked, oneshot::error::RecvError>;

async fn store_result(shared: &Shared, kind: &str, token: Uuid, monitor: &AttemptMonitor, product: Product) {
    monitor.begin_storing();
    let mut stage_seconds = monitor.snapshot().stage_seconds;
    stage_seconds.retain(|(stage, _)| stage != "store");
    for (stage, seconds) in &stage_seconds {
        shared.observer.stage_ended(kind, stage, *seconds);
    }
    let begun = Instant::now();
    let completed = {
        let mut completing = std::pin::pin!(shared.store.complete(token, product, stage_seconds));
        loop {
            match tokio::time::timeout(DELAY_LOOK, &mut completing).await {
                Ok(completed) => break completed,
                Err(_) => {
                    if let Some(why) = shared.store.delay().await {
                        chladni_base::Monitor::detail(monitor, &format!("the result waits to be stored: {why}"));
                    }
                }
            }
        }
    };
    match completed {
        Ok(CompleteAnswer::Stored(basis)) => {
            shared.observer.stage_ended(kind, "store", begun.elapsed().as_secs_f64());
            shared.observer.finished(kind, JobStatus::Succeeded);
            tracing::info!(%basis, store_seconds = begun.elapsed().as_secs_f64(), "basis stored");
        }
        Ok(CompleteAnswer::Canceled) => shared.observer.finished(kind, JobStatus::Canceled),
        Ok(CompleteAnswer::Lost) => {
            tracing::warn!(
                "the result is discarded: the lease was lost before it was stored, and another worker may have the job"
            );
            shared.observer.lease_lost(kind);
        }
        Err(error) => {
            let name = match &error {
                StoreError::StorageFull { .. } => "storage-full",
                StoreError::Refused { .. } => {
                    shared.note_refusal();
                    "storage-refused"
                }
                _ => "storage-unavailable",
            };
            record_ending(shared, kind, Ending::Failed(problem(name, &error), true), token).await;
        }
    }
}

/// Writes down how an attempt ended; where the storage refuses for longer than a lease, the reaper will see to it.
async fn record_ending(shared: &Shared, kind: &str, ending: Ending, token: Uuid) {
    let deadline = Instant::now() + shared.options.lease;
    match &ending {
        Ending::Failed(problem, _) => {
            tracing::warn!(problem = problem.kind, detail = problem.detail, "attempt failed")
        }
        Ending::Died(how) => tracing::error!(how, "the process of the job ended"),
        Ending::Enlarged(bytes) => tracing::info!(bytes, "the job needs more memory than it was promised"),
        Ending::Canceled | Ending::Released => {}
    }
    loop {
        let written = match &ending {
            Ending::Failed(problem, retryable) => shared.store.fail(token, problem, *retryable).await,
            Ending::Died(how) => shared.store.die(token, how).await,
            Ending::Canceled => shared
                .store
                .finish_canceled(token)
                .await
                .map(|held| if held { FailAnswer::Finished(JobStatus::Canceled) } else { FailAnswer::Lost }),
            Ending::Released => shared.store.release(token).await.map(given_back),
            Ending::Enlarged(bytes) => shared.store.release_larger(token, *bytes).await.map(given_back),
        };
        match written {
            // A job that was given back unharmed is not tried again but for the first time.
            Ok(FailAnswer::Retried) if matches!(ending, Ending::Released | Ending::Enlarged(_)) => return,
            Ok(FailAnswer::Retried) => return shared.observer.retried(kind),
            Ok(FailAnswer::Finished(status)) => return shared.observer.finished(kind, status),
            Ok(FailAnswer::Lost) => return shared.observer.lease_lost(kind),
            // A server that stops does not wait for a storage that refuses: it looks for such leases when it starts
            // again.
            Err(error) if Instant::now() < deadline && error.is_retryable() && !*shared.give_back.borrow() => {
                tracing::warn!(%error, "the end of an attempt could not be recorded yet");
                tokio::time::sleep(STORE_PAUSE).await;
            }
            Err(error) => {
                tracing::error!(%error, "the end of an attempt could not be recorded; its lease will expire");
                return;
            }
        }
    }
}

fn given_back(held: bool) -> FailAnswer {
    if held { FailAnswer::Retried } else { FailAnswer::Lost }
}

/// The problem that the job shows. Addresses of the storage are for the log alone.
fn problem(kind: &str, error: &StoreError) -> JobProblem {
    let detail = match error {
        StoreError::StorageFull { .. } | StoreError::Busy { .. } | StoreError::Unavailable { .. } => {
            tracing::warn!(%error, "the storage failed the attempt");
            error.reason().to_owned()
        }
        _ => error.to_string(),
    };
    JobProblem { kind: kind.to_owned(), detail }
}

fn stage_words(monitor: &AttemptMonitor) -> String {
    monitor.snapshot().stage.map_or(String::new(), |stage| format!(" at stage {stage}"))
}

async fn until(deadline: Option<Instant>) {
    match deadline {
        Some(deadline) => tokio::time::sleep_until(deadline).await,
        None => std::future::pending().await,
    }
}

/// Ends a task when the attempt ends, whichever way.
struct AbortOnDrop(tokio::task::JoinHandle<()>);

impl Drop for AbortOnDrop {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Counts work that runs, so that what was left behind is known until it ends.
struct LeftBehind(Arc<AtomicUsize>);

impl LeftBehind {
    fn new(count: Arc<AtomicUsize>) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        Self(count)
    }
}

impl Drop for LeftBehind {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Beats for one attempt, on the threads of the runtime and never on those of the work.
struct Heartbeat {
    store: Store,
    job: Uuid,
    token: Uuid,
    monitor: Arc<AttemptMonitor>,
    verdicts: mpsc::Sender<Verdict>,
    /// From before the claim on: a request to stop that came right after it is among them.
    events: broadcast::Receiver<JobEvent>,
}

impl Heartbeat {
    async fn run(mut self, options: WorkerOptions) {
        let mut look = interval(LOOK.min(options.heartbeat));
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut written = Progress::default();
        let mut beaten = Instant::now();
        let mut refused: Option<Instant> = None;
        let mut ask = false;
        let (mut held, mut stalled) = (true, false);
        while !stalled {
            tokio::select! {
                _ = look.tick() => {}
                event = self.events.recv(), if held => match event {
                    Ok(event) if event.job == self.job && event.cancel_requested => ask = true,
                    // Events were missed; perhaps the one that matters.
                    Err(broadcast::error::RecvError::Lagged(_)) => ask = true,
                    _ => continue,
                },
            }
            if self.monitor.since_last_activity() > options.stall {
                stalled = true;
                self.send_verdict(Verdict::Stalled).await;
            }
            let progress = self.monitor.snapshot();
            let moved = (&progress.stage, progress.fraction, &progress.detail)
                != (&written.stage, written.fraction, &written.detail);
            let due = moved && beaten.elapsed() >= options.heartbeat;
            // A lease is prolonged in good time even where nothing moves.
            let wanted = ask || due || beaten.elapsed() >= options.lease / 4;
            // Where the storage refuses, asking it ten times a second does not help.
            let resting = refused.is_some_and(|refused| refused.elapsed() < options.heartbeat);
            if !held || !wanted || resting {
                continue;
            }
            match self.store.heartbeat(self.token, moved.then_some(&progress), options.lease).await {
                Ok(HeartbeatAnswer::Held { cancel_requested }) => {
                    (ask, refused) = (false, None);
                    beaten = Instant::now();
                    written = progress;
                    if cancel_requested {
                        self.send_verdict(Verdict::Cancel).await;
                    }
                }
                Ok(HeartbeatAnswer::Lost) => {
                    // Only whether the work still lives is of interest now.
                    held = false;
                    self.send_verdict(Verdict::Lost).await;
                }
                Err(error) => {
                    tracing::warn!(%error, "heartbeat refused");
                    refused = Some(Instant::now());
                }
            }
        }
    }

    async fn send_verdict(&self, verdict: Verdict) {
        // The attempt may have ended just now.
        let _ = self.verdicts.send(verdict).await;
    }
}
