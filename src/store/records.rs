//! What the store keeps, as plain types: meshes, jobs, bases and fields.

use std::{fmt, str::FromStr, sync::Arc};

use chladni_mesh::attributes::Attributes;
use chladni_mesh::numbering::Numbering;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::formats::DenseLayout;
use chladni_spectral::spectrum::pencil::Matrices;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use uuid::Uuid;

/// A mesh to be stored.
#[derive(Debug, Clone)]
pub struct NewMesh {
    /// The checked mesh.
    pub mesh: Arc<TriangleMesh>,
    /// The solid whose surface it is, if it is one: the vertices of the surface come first.
    pub solid: Option<Arc<TetMesh>>,
    /// Where the vertices and faces of the file went.
    pub numbering: Arc<Numbering>,
    /// Texture coordinates, normals and names that the file had.
    pub attributes: Option<Arc<Attributes>>,
    /// The report of the check, a JSON object.
    pub report: Value,
    /// A name for people.
    pub name: Option<String>,
    /// The format that it came in, such as `ply`.
    pub format: String,
    /// How many bytes it came in as.
    pub source_bytes: u64,
}

/// A stored mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeshRecord {
    /// The first 32 hexadecimal digits of the BLAKE3 hash of the canonical content.
    pub id: String,
    /// A name for people.
    pub name: Option<String>,
    /// The format that it came in.
    pub format: String,
    /// How many bytes it came in as.
    pub source_bytes: u64,
    /// Vertices.
    pub vertices: u64,
    /// Faces.
    pub faces: u64,
    /// The report of the check, a JSON object.
    pub report: Value,
    /// The BLAKE3 hash of the canonical content, 64 hexadecimal digits: the key of its blob.
    pub content_hash: String,
    /// Bytes of the canonical content.
    pub bytes: u64,
    /// When it was stored, in milliseconds since 1970.
    pub created_ms: i64,
}

impl MeshRecord {
    /// Whether the mesh is the surface of a solid.
    pub fn is_solid(&self) -> bool {
        self.report["solid"].is_object()
    }

    /// Whether repairs have renumbered vertices or faces, so that a numbering which is not stored is not known.
    pub fn is_renumbered(&self) -> bool {
        let kept = ["flipped_faces"];
        let kinds =
            self.report["repairs"].as_array().into_iter().flatten().filter_map(|repair| repair["kind"].as_str());
        self.is_solid()
            || self.report["subdivisions"].as_u64().is_some_and(|times| times > 0)
            || !kinds.clone().all(|kind| kept.contains(&kind))
    }

    /// How many faces the check turned over.
    pub fn turned_faces(&self) -> usize {
        let mut repairs = self.report["repairs"].as_array().into_iter().flatten();
        let turned = repairs.find(|repair| repair["kind"] == "flipped_faces");
        turned.and_then(|repair| repair["count"].as_u64()).map_or(0, |count| count as usize)
    }

    /// The vertices and tetrahedra of the solid; zeros where there is none.
    pub fn solid_size(&self) -> (u64, u64) {
        let count = |name: &str| self.report["solid"][name].as_u64().unwrap_or(0);
        (count("vertices"), count("tetrahedra"))
    }
}

/// A problem to be stored.
#[derive(Debug, Clone)]
pub struct NewProblem {
    /// The checked matrices.
    pub matrices: Arc<Matrices>,
    /// What was found when they were checked, a JSON object.
    pub report: Value,
    /// A name for people.
    pub name: Option<String>,
    /// How many bytes they came in as.
    pub source_bytes: u64,
}

/// A stored problem: the matrices of a pencil.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProblemRecord {
    /// The first 32 hexadecimal digits of the BLAKE3 hash of the content.
    pub id: String,
    /// A name for people.
    pub name: Option<String>,
    /// How many bytes it came in as.
    pub source_bytes: u64,
    /// Rows of both matrices.
    pub rows: u64,
    /// What was found when they were checked, a JSON object.
    pub report: Value,
    /// The BLAKE3 hash of the content, 64 hexadecimal digits: the key of its blob.
    pub content_hash: String,
    /// Bytes of the content, an NPZ file.
    pub bytes: u64,
    /// When it was stored, in milliseconds since 1970.
    pub created_ms: i64,
}

/// A field to be stored: a row of numbers for each face of a mesh.
#[derive(Debug, Clone)]
pub struct NewField {
    /// The mesh.
    pub mesh: String,
    /// The basis that it was designed in.
    pub basis: Option<Uuid>,
    /// A name for people.
    pub name: Option<String>,
    /// Numbers for each face.
    pub width: usize,
    /// The numbers, face after face.
    pub values: Vec<f32>,
    /// Of a designed one what it is and what it was asked for with, a JSON object; null of others.
    pub design: Value,
}

/// A stored field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldRecord {
    /// The first 32 hexadecimal digits of the BLAKE3 hash of all but the name.
    pub id: String,
    /// The mesh.
    pub mesh: String,
    /// The basis that it was designed in.
    pub basis: Option<Uuid>,
    /// A name for people.
    pub name: Option<String>,
    /// Numbers for each face.
    pub width: u64,
    /// Faces.
    pub faces: u64,
    /// Of a designed one what it is and what it was asked for with, a JSON object; null of others.
    pub design: Value,
    /// The BLAKE3 hash of the content, 64 hexadecimal digits: the key of its blob.
    pub content_hash: String,
    /// Bytes of the content.
    pub bytes: u64,
    /// When it was stored, in milliseconds since 1970.
    pub created_ms: i64,
}

/// Which fields a list holds; `None` does not filter.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FieldFilter {
    /// Only those on this mesh.
    pub mesh: Option<String>,
    /// Only those that were designed in this basis.
    pub basis: Option<String>,
    /// Only those whose name contains this. Letters of ASCII are alike in both cases.
    pub name: Option<String>,
}

/// A record, and whether this call made it.
#[derive(Debug, Clone, PartialEq)]
pub struct Stored<T> {
    /// The record.
    pub record: T,
    /// False where the same content was known before.
    pub created: bool,
}

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobStatus {
    /// Waiting for a worker, or for its next attempt.
    Enqueued,
    /// A worker holds its lease.
    Processing,
    /// Done; its basis is stored, unless that was deleted since.
    Succeeded,
    /// Given up; its problem says why.
    Failed,
    /// Ended on request.
    Canceled,
}

impl JobStatus {
    /// Every status.
    pub const ALL: [Self; 5] = [Self::Enqueued, Self::Processing, Self::Succeeded, Self::Failed, Self::Canceled];

    /// The name on the wire and in the table.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Enqueued => "enqueued",
            Self::Processing => "processing",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Canceled => "canceled",
        }
    }

    /// Whether nothing more will happen unless someone asks for a retry.
    pub fn is_finished(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Canceled)
    }
}

impl fmt::Display for JobStatus {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

/// A word that is not a job status.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not a job status")]
pub struct UnknownStatus(pub String);

impl FromStr for JobStatus {
    type Err = UnknownStatus;
    fn from_str(word: &str) -> Result<Self, UnknownStatus> {
        Self::ALL.into_iter().find(|status| status.as_str() == word).ok_or_else(|| UnknownStatus(word.to_owned()))
    }
}

/// A job to be enqueued.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// The kind of job, such as `eigenbasis`.
    pub kind: String,
    /// The mesh or the problem that it works on.
    pub mesh: String,
    /// The bases that it works on, where these are several; the mesh is that of the first.
    pub bases: Vec<Uuid>,
    /// Canonical parameters, with defaults filled in.
    pub parameters: Value,
    /// The same with long lists told by their length and hash, where there are any: what records show, but for the
    /// claim of a worker.
    pub brief: Option<Value>,
    /// Higher runs first; 0 is usual.
    pub priority: i32,
    /// The client's key, if it gave one.
    pub idempotency: Option<IdempotencyKey>,
    /// How often it may be tried, at least 1.
    pub max_attempts: u32,
    /// A hash of mesh, kind, canonical parameters and solver version: equal keys are equal work.
    pub work_key: String,
    /// The version of the solver that will do it.
    pub solver_version: String,
    /// An estimate of the memory that it needs while it runs.
    pub memory_bytes: u64,
    /// The most memory that a new job may need. What is there already, whoever can or cannot do it anew, is found all
    /// the same.
    pub most_bytes: u64,
}

/// A client's promise that requests with the same key are the same request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IdempotencyKey {
    /// The key, made unique for each principal by the caller.
    pub key: String,
    /// A hash of the request, to catch a key that comes back with another body.
    pub request_hash: String,
}

/// A job as it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobRecord {
    /// A time-ordered UUID.
    pub id: Uuid,
    /// The kind of job.
    pub kind: String,
    /// The mesh or, of the kind `pencil_basis`, the problem that it works on.
    pub mesh: String,
    /// The bases that it works on, where these are several, as of the kind `map_collection`; the mesh is that of the
    /// first.
    #[serde(default)]
    pub bases: Vec<Uuid>,
    /// Canonical parameters, with defaults filled in; in full in a [`Claim`](super::Claim), else with long lists told
    /// by their length and hash.
    pub parameters: Value,
    /// Higher runs first.
    pub priority: i32,
    /// Where it stands.
    pub status: JobStatus,
    /// The stage that runs.
    pub stage: Option<String>,
    /// The fraction of the stage that is done, in `0..=1`.
    pub progress: Option<f64>,
    /// Where it stands within the stage, in words.
    pub detail: Option<String>,
    /// Seconds spent in each stage of the last attempt, in order.
    pub stage_seconds: Vec<(String, f64)>,
    /// The attempt that runs or ran last; 0 before the first.
    pub attempt: u32,
    /// How often it may be tried.
    pub max_attempts: u32,
    /// Whether a running job was asked to stop.
    pub cancel_requested: bool,
    /// The basis it made, while that is stored.
    pub basis: Option<Uuid>,
    /// Why it failed, or why its last attempt did.
    pub problem: Option<JobProblem>,
    /// Equal keys are equal work.
    pub work_key: String,
    /// The version of the solver.
    pub solver_version: String,
    /// When it was first enqueued, in milliseconds since 1970.
    pub created_ms: i64,
    /// When it was last enqueued.
    pub enqueued_ms: i64,
    /// It is not claimed before this time: a backoff after a failed attempt.
    pub not_before_ms: i64,
    /// When its last attempt began.
    pub started_ms: Option<i64>,
    /// When it succeeded, failed or was cancelled.
    pub finished_ms: Option<i64>,
    /// An estimate of the memory that it needs while it runs.
    pub memory_bytes: u64,
    /// Into how many parts it is divided, or was; 0 where it is not.
    #[serde(default)]
    pub parts: u32,
    /// How many of these are done.
    #[serde(default)]
    pub parts_done: u32,
    /// Of a part, the job that it is a part of: the first, where there are several.
    #[serde(default)]
    pub parent: Option<Uuid>,
    /// Grows with every change of the job.
    pub revision: i64,
}

/// Why a job or one of its attempts failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobProblem {
    /// A stable identifier such as `worker-lost`.
    pub kind: String,
    /// A sentence that names the offending element.
    pub detail: String,
}

/// An enqueued job, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Enqueued {
    /// The job.
    pub record: JobRecord,
    /// How it came about.
    pub outcome: EnqueueOutcome,
}

/// How an enqueued job came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EnqueueOutcome {
    /// It is new.
    Created,
    /// Equal work was waiting, running or done: this is that job.
    SameWork,
    /// The idempotency key was known with this very request: this is the job that it made.
    Replayed,
}

/// Which jobs a list holds; `None` does not filter.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JobFilter {
    /// Only those with this status.
    pub status: Option<JobStatus>,
    /// Only those of this kind.
    pub kind: Option<String>,
    /// Only those on this mesh.
    pub mesh: Option<String>,
    /// Only the parts of this job.
    pub parent: Option<Uuid>,
}

/// Which bases a list holds; `None` does not filter.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BasisFilter {
    /// Only those of this mesh.
    pub mesh: Option<String>,
    /// Only those of this kind.
    pub kind: Option<String>,
}

/// A job changed: what long polls and event streams wake on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobEvent {
    /// The job.
    pub job: Uuid,
    /// Its revision after the change.
    pub revision: i64,
    /// Its status after the change.
    pub status: JobStatus,
    /// Whether it is asked to stop.
    pub cancel_requested: bool,
}

/// A stored basis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BasisRecord {
    /// A time-ordered UUID.
    pub id: Uuid,
    /// The mesh that it lives on or, of the kind `pencil_basis`, the problem.
    pub mesh: String,
    /// The job that made it.
    pub job: Uuid,
    /// The kind of product, which is that of the job.
    pub kind: String,
    /// The parameters of that job, with defaults filled in.
    pub parameters: Value,
    /// Vertices of the mesh, or rows of the problem.
    pub vertices: u64,
    /// Numbers of one lifted function: a value per vertex, or two or three per face.
    pub rows: u64,
    /// Whether the eigenfunctions are stored as factors or as columns.
    pub storage: BasisStorage,
    /// Columns of the sparse factor, `d`; 0 for a dense basis.
    pub dimension: u64,
    /// Pairs that are known, `m`.
    pub count: u64,
    /// Entries of the sparse factor; 0 for a dense basis.
    pub nonzeros: u64,
    /// `m` eigenvalues, ascending, in 1/length² of the input.
    pub eigenvalues: Vec<f64>,
    /// What is proven about each pair and about the whole; null where nothing is.
    pub certificate: Value,
    /// How the operator was made, and why; null where nothing was told.
    pub operator: Value,
    /// What only its kind has, as a JSON object; null where there is nothing.
    pub details: Value,
    /// Bytes of the stored content, an NPZ file.
    pub bytes: u64,
    /// Bytes that the functions would take as a dense matrix of f64.
    pub dense_bytes: u64,
    /// The BLAKE3 hash of the content, 64 hexadecimal digits: the key of its blob and its entity tag.
    pub content_hash: String,
    /// The version of the solver that made it.
    pub solver_version: String,
    /// When it was stored, in milliseconds since 1970.
    pub created_ms: i64,
    /// Seconds spent in each stage, in order.
    pub stage_seconds: Vec<(String, f64)>,
}

/// How the eigenfunctions of a basis are stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BasisStorage {
    /// As a sparse factor times a dense one.
    Compact,
    /// As columns, which are read in chunks.
    Dense(Arc<DenseLayout>),
}

impl BasisStorage {
    /// The name on the wire and in the table.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Compact => "compact",
            Self::Dense(_) => "dense",
        }
    }
}

/// How the storage feels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StoreHealth {
    /// Whether a small transaction could be committed in both databases just now.
    pub writable: bool,
    /// Why not.
    pub reason: Option<String>,
    /// What keeps the records: `sqlite` or `postgresql`.
    pub database: &'static str,
    /// What keeps the content: `sqlite`, `s3` or `files`.
    pub content: &'static str,
    /// Whether the database answers.
    pub database_up: bool,
    /// Whether what keeps the content answers.
    pub content_up: bool,
    /// Whether a database was removed or replaced while it was in use.
    pub moved: bool,
    /// Whether new content is refused for want of space.
    pub full: bool,
    /// Free bytes of the file system, where the system tells.
    pub free_bytes: Option<u64>,
    /// Content is refused when fewer bytes than these are free.
    pub least_free_bytes: u64,
    /// Bytes of both write-ahead logs.
    pub wal_bytes: u64,
    /// Bytes of each database file, without its log.
    pub database_bytes: [(&'static str, u64); 2],
    /// Bytes of all stored content.
    pub blob_bytes: u64,
}

/// What the caches of decoded bases and meshes did so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct CacheStatistics {
    /// Requests answered from memory.
    pub hits: u64,
    /// Requests that read the database.
    pub misses: u64,
    /// Bytes held.
    pub bytes: u64,
}
