//! What the queue asks of the work itself, and what it tells an observer.

use std::sync::Arc;

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::Product;
use chladni_spectral::spectrum::pencil::Matrices;
use chladni_work::Division;

use crate::store::{CollectedShape, JobRecord, JobStatus, PartSource, Subject};

/// Does the work of a job: a pure function of the job and its mesh.
pub trait Runner: Send + Sync + 'static {
    /// Runs one attempt on the rayon pool of jobs. A panic counts as a failed attempt.
    ///
    /// # Errors
    /// [`JobFailure`] says whether another attempt may help.
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure>;

    /// The same for a mesh that may be the surface of a solid.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_body(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        _solid: Option<Arc<TetMesh>>,
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        self.run(job, mesh, monitor)
    }

    /// Runs one attempt at a job that works on the matrices of a problem.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_problem(
        &self,
        job: &JobRecord,
        _matrices: Arc<Matrices>,
        _monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        Err(not_run(job))
    }

    /// Runs one attempt at a job that works on the shapes of a collection.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_collection(
        &self,
        job: &JobRecord,
        _shapes: Vec<CollectedShape>,
        _monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        Err(not_run(job))
    }

    /// Makes the plan of a job that asks to be divided, where so many parts may be solved at once, or does it in one
    /// piece where it is not to be.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_to_divide(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        _workers_and_before: (usize, usize),
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        self.run_body(job, mesh, solid, monitor)
    }

    /// Joins the parts of a job.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_parts(
        &self,
        job: &JobRecord,
        _mesh: Arc<TriangleMesh>,
        _solid: Option<Arc<TetMesh>>,
        _parts: Arc<dyn PartSource>,
        _monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        Err(not_run(job))
    }

    /// Runs one attempt at a job, whatever it works on.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_on(&self, job: &JobRecord, subject: Subject, monitor: &dyn Watch) -> Result<Outcome, JobFailure> {
        match subject {
            Subject::Mesh(mesh, solid) => self.run_body(job, mesh, solid, monitor),
            Subject::Problem(matrices) => self.run_problem(job, matrices, monitor),
            Subject::Collection(shapes) => self.run_collection(job, shapes, monitor),
            Subject::ToDivide { mesh, solid, workers, before } => {
                self.run_to_divide(job, mesh, solid, (workers, before), monitor)
            }
            Subject::Parts { mesh, solid, parts } => self.run_parts(job, mesh, solid, parts, monitor),
        }
    }
}

fn not_run(job: &JobRecord) -> JobFailure {
    let detail = format!("jobs of the kind {} are not run here", job.kind);
    JobFailure::Failed { kind: "invalid-parameters".to_owned(), detail, retryable: false }
}

/// A monitor that also tells whoever passes on what others say: whether the work is cancelled, which is no sign of
/// life, and stages whose names come from elsewhere.
pub trait Watch: Monitor {
    /// Whether the work was asked to stop.
    fn is_cancelled(&self) -> bool;
    /// A stage begins, as [`Monitor::stage`] has it.
    fn stage_named(&self, name: &str);
}

/// What an attempt made.
#[derive(Debug, Clone)]
pub enum Outcome {
    /// What is to be stored.
    Product(Product),
    /// Parts that are to be solved first.
    Parts(Division),
}

/// The kind of problem of a job that needs more memory than it was promised.
pub(super) const MEMORY_EXCEEDED: &str = "memory-exceeded";

/// Why an attempt made nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JobFailure {
    /// It was asked to stop and did.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The work cannot be done, or could not be done this time.
    #[error("{kind}: {detail}")]
    Failed {
        /// A stable identifier such as `mass-not-positive`.
        kind: String,
        /// A sentence that names the offending element.
        detail: String,
        /// Whether another attempt may help.
        retryable: bool,
    },
    /// It needs more memory than it was promised, as was found before any was taken.
    #[error("memory-exceeded: {detail}")]
    NeedsMore {
        /// About how many bytes.
        bytes: u64,
        /// A sentence about it.
        detail: String,
    },
    /// The process that did the work ended by itself.
    #[error("the process of the job ended: {how}")]
    Died {
        /// How, such as `by signal 11 (SIGSEGV)`.
        how: String,
    },
}

/// Hears what the queue does: the seam for metrics. Called from worker tasks; must return quickly.
pub trait QueueObserver: Send + Sync + 'static {
    /// A claim that gave a job took so many seconds.
    fn claim_took(&self, _seconds: f64) {}
    /// A job was claimed after so many seconds in the queue.
    fn claimed(&self, _kind: &str, _queue_seconds: f64) {}
    /// A stage of a job ended.
    fn stage_ended(&self, _kind: &str, _stage: &str, _seconds: f64) {}
    /// An attempt ended and the job is to be tried again.
    fn retried(&self, _kind: &str) {}
    /// A worker found that its lease was lost.
    fn lease_lost(&self, _kind: &str) {}
    /// Running jobs hold so many bytes of the memory that there is for them, by their promises.
    fn memory(&self, _promised: u64, _total: u64) {}
    /// The process of a job ended by itself.
    fn died(&self, _kind: &str) {}
    /// So many dense problems of a job fell back from the graphics card to the CPU, in another process.
    fn gpu_fell_back(&self, _times: u64) {}
    /// A job is finished.
    fn finished(&self, _kind: &str, _status: JobStatus) {}
}

/// Hears nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl QueueObserver for Unobserved {}
