//! The runner that hands jobs to worker processes.

use std::{
    io::{self, Write},
    path::PathBuf,
    process::Command,
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{self, Receiver},
    },
    thread,
    time::{Duration, Instant},
};

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::spectrum::pencil::Matrices;

use super::{
    child::{Heard, Worker},
    delivery,
    frame::{self, Frame, Pieces, Tag},
    messages::{Failure, Order, Taken},
};
use crate::{
    queue::{JobFailure, MEMORY_EXCEEDED, Outcome, QueueObserver, Runner, Watch},
    store::{CollectedShape, JobRecord, PartSource, Subject},
};

/// How often it is looked whether the job was asked to stop.
const LOOK: Duration = Duration::from_millis(20);
/// Work that was asked to stop gets so long until its process is killed.
const CANCEL_PATIENCE: Duration = Duration::from_millis(500);

/// How worker processes are started.
#[derive(Debug, Clone)]
pub struct ProcessOptions {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<String>,
    /// Whether a job may take no more memory than its promise, half of that again and [`ProcessOptions::SLACK`].
    pub limit_memory: bool,
    /// How long a process may take until it is ready.
    pub patience: Duration,
    /// Processes that are kept waiting for work, at most.
    pub idle: usize,
}

impl ProcessOptions {
    /// Bytes that a job may allocate beyond its promise, for what allocators take in advance and the stacks of threads.
    pub const SLACK: u64 = 256 << 20;
}

/// Worker processes.
pub(super) struct Pool {
    options: ProcessOptions,
    observer: Arc<dyn QueueObserver>,
    idle: Mutex<Vec<Worker>>,
}

impl Pool {
    fn start(&self) -> io::Result<Worker> {
        let mut command = Command::new(&self.options.program);
        Worker::start(command.args(&self.options.arguments), self.options.patience)
    }

    /// A process that waits, or a new one.
    fn take(&self) -> io::Result<Worker> {
        loop {
            let waiting = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let Some(mut worker) = waiting else { return self.start() };
            if worker.lives() {
                return Ok(worker);
            }
            // One that was killed while it waited harms nobody.
            tracing::warn!("an idle worker process ended");
        }
    }

    /// Keeps a worker that has done its order, unless it holds too much by now.
    pub fn put_back(&self, worker: Worker, taken: &Taken) {
        if taken.gpu_fallbacks > 0 {
            self.observer.gpu_fell_back(taken.gpu_fallbacks);
        }
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        if !taken.swollen && idle.len() < self.options.idle {
            idle.push(worker);
        }
    }
}

/// Runs each job in a process of its own.
pub struct Processes(Arc<Pool>);

impl std::fmt::Debug for Processes {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Processes").field("options", &self.0.options).finish_non_exhaustive()
    }
}

impl Processes {
    /// Starts the first process, to know that it can be done.
    ///
    /// # Errors
    /// [`io::Error`] where the program cannot be started or is not ready in time.
    pub fn start(options: ProcessOptions, observer: Arc<dyn QueueObserver>) -> io::Result<Self> {
        let pool = Pool { options, observer, idle: Mutex::default() };
        let first = pool.start()?;
        pool.put_back(first, &Taken::default());
        Ok(Self(Arc::new(pool)))
    }

    fn memory(&self, promised: u64) -> Option<u64> {
        let limited = self.0.options.limit_memory && promised > 0;
        limited.then(|| memory_limit(promised))
    }
}

impl Runner for Processes {
    fn run(&self, _job: &JobRecord, _mesh: Arc<TriangleMesh>, _monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        let detail = "jobs in worker processes need a watch".to_owned();
        Err(JobFailure::Failed { kind: "worker-lost".to_owned(), detail, retryable: false })
    }

    fn run_body(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        watch: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        self.hand_out(job, Subject::Mesh(mesh, solid), watch)
    }

    fn run_problem(&self, job: &JobRecord, matrices: Arc<Matrices>, watch: &dyn Watch) -> Result<Outcome, JobFailure> {
        self.hand_out(job, Subject::Problem(matrices), watch)
    }

    fn run_collection(
        &self,
        job: &JobRecord,
        shapes: Vec<CollectedShape>,
        watch: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        self.hand_out(job, Subject::Collection(shapes), watch)
    }

    fn run_to_divide(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        (workers, before): (usize, usize),
        watch: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        self.hand_out(job, Subject::ToDivide { mesh, solid, workers, before }, watch)
    }

    fn run_parts(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        parts: Arc<dyn PartSource>,
        watch: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        self.hand_out(job, Subject::Parts { mesh, solid, parts }, watch)
    }
}

impl Processes {
    fn hand_out(&self, job: &JobRecord, subject: Subject, watch: &dyn Watch) -> Result<Outcome, JobFailure> {
        let lost = |error: io::Error| JobFailure::Failed {
            kind: "worker-lost".to_owned(),
            detail: format!("no process could be started for the job: {error}"),
            retryable: true,
        };
        let mut worker = self.0.take().map_err(lost)?;
        worker.number += 1;
        let order = Order {
            number: worker.number,
            job: job.clone(),
            threads: rayon::current_num_threads(),
            memory: self.memory(job.memory_bytes),
        };
        let unsent = send(&worker, order, subject).map_err(lost)?;
        relay_frames(worker, &unsent, job, watch, &self.0)
    }
}

/// Sends an order from a thread of its own: a worker that does not read must not keep its server from killing it. What
/// the order is about may not be readable; then that is to be received.
fn send(worker: &Worker, order: Order, subject: Subject) -> io::Result<Receiver<io::Error>> {
    let (failed, unsent) = mpsc::channel();
    let orders = Arc::clone(&worker.orders);
    let sending = move || -> io::Result<()> {
        let mut orders = orders.lock().unwrap_or_else(PoisonError::into_inner);
        frame::write_pieces(&mut *orders, Tag::Order, &serde_json::to_vec(&order)?)?;
        let mut pieces = Pieces::new(&mut *orders, Tag::Mesh);
        subject.write(&mut pieces)?;
        pieces.flush()?;
        frame::write(&mut *orders, Tag::Begin, &[])?;
        orders.flush()?;
        // What was sent is not needed here while it is worked on.
        let parts = if let Subject::Parts { parts, .. } = subject { Some(parts) } else { None };
        if let Some(parts) = parts {
            chladni_base::trim();
            for number in 0..parts.count() {
                let mut pieces = Pieces::new(&mut *orders, Tag::Part);
                parts.copy(number, &mut pieces)?;
                pieces.flush()?;
                frame::write(&mut *orders, Tag::PartEnd, &[])?;
                orders.flush()?;
            }
        }
        Ok(())
    };
    thread::Builder::new().name("worker-orders".to_owned()).spawn(move || {
        // Of the end of a worker hears who attends to it, and of the rest by this.
        if let Err(error) = sending() {
            tracing::debug!(%error, "a request did not reach the worker");
            if error.kind() == io::ErrorKind::Other {
                let _gone = failed.send(error);
            }
        }
    })?;
    Ok(unsent)
}

/// Passes on what a worker says of an order, until there is a result, or none.
fn relay_frames(
    mut worker: Worker,
    unsent: &Receiver<io::Error>,
    job: &JobRecord,
    watch: &dyn Watch,
    pool: &Arc<Pool>,
) -> Result<Outcome, JobFailure> {
    let mut killed_at: Option<Instant> = None;
    let mut stage = String::new();
    let died = |how: String| Err(JobFailure::Died { how });
    loop {
        if watch.is_cancelled() {
            let at = *killed_at.get_or_insert_with(|| {
                worker.cancel();
                Instant::now() + CANCEL_PATIENCE
            });
            if Instant::now() >= at {
                tracing::info!(stage, "the work does not stop; its process is killed");
                worker.kill();
                return Err(Cancelled.into());
            }
        }
        if let Ok(error) = unsent.try_recv() {
            // It waits for the rest, and is of no more use.
            worker.kill();
            let detail = format!("the input of the job could not be read: {error}");
            return Err(JobFailure::Failed { kind: "basis-unavailable".to_owned(), detail, retryable: true });
        }
        let Frame { tag, body } = match worker.next_frame(LOOK) {
            Heard::Frame(frame) => frame,
            Heard::Silence => continue,
            Heard::Ended(_) if watch.is_cancelled() => return Err(Cancelled.into()),
            Heard::Ended(_) if worker.lacked_memory() => return Err(too_little(job)),
            Heard::Ended(how) => return died(how),
        };
        // A sign of life, whatever it says. That the job was cancelled is looked at above, whether or not the worker
        // speaks.
        let _cancelled = watch.checkpoint();
        match tag {
            Tag::Accepted | Tag::Beat => {}
            Tag::Stage => {
                stage = String::from_utf8_lossy(&body).into_owned();
                watch.stage_named(&stage);
            }
            Tag::Progress => {
                if let Ok(fraction) = body.try_into() {
                    watch.progress(f64::from_le_bytes(fraction));
                }
            }
            Tag::Detail => watch.detail(&String::from_utf8_lossy(&body)),
            Tag::Product => {
                let taken = delivery::take(worker, &body, job.memory_bytes, &Arc::downgrade(pool));
                return taken.or_else(|what| died(format!("with {what}")));
            }
            Tag::Failed => {
                let Ok(failure) = serde_json::from_slice::<Failure>(&body) else {
                    return died("with a failure report that could not be decoded".to_owned());
                };
                pool.put_back(worker, &failure.taken);
                return Err(match failure.reason {
                    None => Cancelled.into(),
                    Some(mut reason) => {
                        if reason.kind == "worker-panicked" && !stage.is_empty() {
                            reason.detail = format!("{} at stage {stage}", reason.detail);
                        }
                        reason.into()
                    }
                });
            }
            _ => return died(format!("after an unexpected message, {tag:?}")),
        }
    }
}

/// The bytes that a job may allocate.
fn memory_limit(promised: u64) -> u64 {
    promised.saturating_add(promised / 2).saturating_add(ProcessOptions::SLACK)
}

/// Another attempt would need as much.
fn too_little(job: &JobRecord) -> JobFailure {
    let promised = job.memory_bytes;
    let limit = memory_limit(promised);
    let detail = format!("the job was estimated to need {promised} bytes of memory, and exceeded its limit of {limit}");
    JobFailure::Failed { kind: MEMORY_EXCEEDED.to_owned(), detail, retryable: false }
}
