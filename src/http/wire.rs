//! What goes over the wire, apart from what is stored: conversion stands here alone.
//!
//! Times are milliseconds since 1970-01-01 UTC; lengths are in the units of the uploaded mesh.

use chladni_mesh::check::MeshReport;
use chladni_spectral::basis::ProductKind;
use chladni_work::abbreviate;
use chladni_work::packed::Packed;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use uuid::Uuid;

use super::links::BasisLinks;
use crate::store::{BasisRecord, BasisStorage, JobRecord, JobStatus, MeshRecord, Page};

/// A page of a list, newest first.
#[derive(Debug, Serialize, ToSchema)]
pub struct PageOf<T: ToSchema> {
    /// The items.
    pub items: Vec<T>,
    /// Pass this as `from` to get the next page; null on the last.
    pub next: Option<String>,
}

impl<T: ToSchema> PageOf<T> {
    /// A page of stored records as a page of the wire.
    pub fn of<R>(page: Page<R>, convert: impl FnMut(R) -> T) -> Self {
        Self { items: page.items.into_iter().map(convert).collect(), next: page.next }
    }
}

/// A stored mesh.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "name": "spot", "format": "obj", "source_bytes": 181734,
    "vertices": 2930, "faces": 5856, "bytes": 140592, "created_ms": 1795269600000i64,
    "report": {"vertices": 2930, "faces": 5856, "edges": 8784, "area": 5.49, "bounding_box": [[-0.48, -0.74, -1.0], [0.48, 0.94, 0.99]],
               "euler_characteristic": 2, "components": 1, "boundary_edges": 0, "boundary_loops": 0, "genus": 0, "closed": true, "manifold": true,
               "orientable": true, "defects": [], "repairs": []},
    "links": {"self": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "content": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3/content",
              "fields": "/v1/fields?mesh=0f6d2c4ab1e84cf29be2e3f0b5d1a7c3"}
}))]
pub struct MeshResource {
    /// 32 hexadecimal digits of the BLAKE3 hash of positions and faces: equal content has an equal id.
    pub id: String,
    /// The name it was given.
    pub name: Option<String>,
    /// The format it came in.
    pub format: String,
    /// Bytes it came in as, after decompression.
    pub source_bytes: u64,
    /// Vertices, after repairs.
    pub vertices: u64,
    /// Faces, after repairs.
    pub faces: u64,
    /// Bytes of the stored content.
    pub bytes: u64,
    /// When it was stored.
    pub created_ms: i64,
    /// Area, bounding box, Euler characteristic, genus, components, boundary loops, each kind of defect with a count
    /// and its first offenders, and what was repaired.
    #[schema(value_type = MeshReport)]
    pub report: Value,
    /// Where to go from here.
    pub links: MeshLinks,
}

/// Links of a mesh.
#[derive(Debug, Serialize, ToSchema)]
pub struct MeshLinks {
    /// The mesh itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its content.
    pub content: String,
    /// The fields that are stored on it.
    pub fields: String,
}

impl From<MeshRecord> for MeshResource {
    fn from(record: MeshRecord) -> Self {
        let itself = format!("/v1/meshes/{}", record.id);
        Self {
            links: MeshLinks {
                content: format!("{itself}/content"),
                fields: format!("/v1/fields?mesh={}", record.id),
                itself,
            },
            id: record.id,
            name: record.name,
            format: record.format,
            source_bytes: record.source_bytes,
            vertices: record.vertices,
            faces: record.faces,
            bytes: record.bytes,
            created_ms: record.created_ms,
            report: record.report,
        }
    }
}

/// A job to be done.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "kind": "eigenbasis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
    "parameters": {"method": "approximate", "count": 500}, "priority": 0
}))]
pub struct JobRequest {
    /// The kind of job.
    pub kind: String,
    /// The id of the mesh.
    #[serde(default)]
    pub mesh: Option<String>,
    /// Of the kind `pencil_basis`, in the place of a mesh: the id of the problem.
    #[serde(default)]
    pub pencil: Option<String>,
    /// Of the kind `map_collection`, in the place of a mesh: the ids of the bases, one for each shape.
    #[serde(default)]
    #[schema(min_items = 2, max_items = 32)]
    pub bases: Option<Vec<String>>,
    /// Parameters of the kind; what is absent takes its default. A parameter of another kind or method is refused by
    /// name.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub parameters: Packed,
    /// Higher runs first.
    #[serde(default)]
    #[schema(default = 0, minimum = -100, maximum = 100)]
    pub priority: i32,
}

/// What a job works on, and a basis belongs to.
pub(super) struct Source {
    mesh: Option<String>,
    pencil: Option<String>,
}

impl Source {
    fn of(kind: &str, id: String) -> Self {
        match kind == ProductKind::PencilBasis.name() {
            true => Self { mesh: None, pencil: Some(id) },
            false => Self { mesh: Some(id), pencil: None },
        }
    }

    pub(super) fn mesh_link(&self) -> Option<String> {
        self.mesh.as_ref().map(|id| format!("/v1/meshes/{id}"))
    }

    pub(super) fn pencil_link(&self) -> Option<String> {
        self.pencil.as_ref().map(|id| format!("/v1/problems/{id}"))
    }
}

/// Seconds spent in a stage.
#[derive(Debug, Serialize, ToSchema)]
pub struct StageSeconds {
    /// The name of the stage.
    pub stage: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Parameters without their long lists.
fn abbreviated(mut parameters: Value) -> Value {
    abbreviate(&mut parameters);
    parameters
}

fn stages(seconds: Vec<(String, f64)>) -> Vec<StageSeconds> {
    seconds.into_iter().map(|(stage, seconds)| StageSeconds { stage, seconds }).collect()
}

/// Why a job failed, in the form of RFC 9457.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobProblemResource {
    /// A stable URI.
    #[serde(rename = "type")]
    pub kind: String,
    /// A short summary.
    pub title: String,
    /// A sentence that names the offending element.
    pub detail: String,
}

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Waiting for a worker.
    Enqueued,
    /// Running.
    Processing,
    /// Done: its basis is stored.
    Succeeded,
    /// Given up: its problem says why.
    Failed,
    /// Ended on request.
    Canceled,
}

impl From<JobStatus> for Status {
    fn from(status: JobStatus) -> Self {
        match status {
            JobStatus::Enqueued => Self::Enqueued,
            JobStatus::Processing => Self::Processing,
            JobStatus::Succeeded => Self::Succeeded,
            JobStatus::Failed => Self::Failed,
            JobStatus::Canceled => Self::Canceled,
        }
    }
}

impl From<Status> for JobStatus {
    fn from(status: Status) -> Self {
        match status {
            Status::Enqueued => Self::Enqueued,
            Status::Processing => Self::Processing,
            Status::Succeeded => Self::Succeeded,
            Status::Failed => Self::Failed,
            Status::Canceled => Self::Canceled,
        }
    }
}

/// A job.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2", "kind": "eigenbasis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
    "parameters": {"method": "approximate", "count": 500, "operator": "auto", "mass": "barycentric", "boundary": "neumann",
                   "dimension": 1000, "construction": "heat", "accuracy": "standard", "seed": 0},
    "priority": 0, "status": "processing", "stage": "basis", "progress": 0.4,
    "stage_seconds": [{"stage": "operator", "seconds": 0.031}, {"stage": "sampling", "seconds": 0.022}],
    "detail": null, "memory_bytes": 1283457000, "parts": null, "parent": null,
    "attempt": 1, "max_attempts": 3, "cancel_requested": false, "basis": null, "problem": null, "solver_version": "0.1.0+5",
    "created_ms": 1795269600000i64, "started_ms": 1795269600012i64, "finished_ms": null, "revision": 7,
    "links": {"self": "/v1/jobs/019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2", "events": "/v1/jobs/019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2/events",
              "mesh": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "pencil": null, "basis": null, "parts": null}
}))]
pub struct JobResource {
    /// A time-ordered UUID.
    pub id: String,
    /// The kind of job.
    pub kind: String,
    /// The mesh it works on; null where it works on a problem.
    pub mesh: Option<String>,
    /// The problem it works on, of the kind `pencil_basis` alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pencil: Option<String>,
    /// The bases it works on, of the kind `map_collection` alone; `mesh` is that of the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bases: Option<Vec<String>>,
    /// The parameters, with every default filled in. Of a long list, such as a potential, `numbers` tells the length
    /// and `blake3` the hash.
    #[schema(value_type = Object)]
    pub parameters: Value,
    /// Higher runs first.
    pub priority: i32,
    /// Where it stands.
    pub status: Status,
    /// The stage that runs.
    pub stage: Option<String>,
    /// The fraction of the stage that is done, from 0 to 1.
    pub progress: Option<f64>,
    /// Where it stands within the stage, in words: `level 2 of 3, iteration 1, slice 4 of 8`.
    pub detail: Option<String>,
    /// Seconds spent in each stage of the last attempt, in order.
    pub stage_seconds: Vec<StageSeconds>,
    /// The attempt that runs or ran last; 0 before the first.
    pub attempt: u32,
    /// How often it is tried at most.
    pub max_attempts: u32,
    /// An estimate of the memory it needs: jobs that together need more than the server has do not run at once. It
    /// grows where a job in parts turns out to be done in one piece.
    pub memory_bytes: u64,
    /// Of a job that is divided, how many of its parts are done, of all; null where it is not. It waits for them as
    /// `enqueued`, in the stage `parts`.
    #[schema(inline)]
    pub parts: Option<PartsDone>,
    /// Of a part, the job that it is a part of; null for others.
    pub parent: Option<String>,
    /// Whether it was asked to stop.
    pub cancel_requested: bool,
    /// The id of the basis it made.
    pub basis: Option<String>,
    /// Why it failed, or why its last attempt did.
    pub problem: Option<JobProblemResource>,
    /// The version of the solver.
    pub solver_version: String,
    /// When it was submitted.
    pub created_ms: i64,
    /// When its last attempt began.
    pub started_ms: Option<i64>,
    /// When it ended.
    pub finished_ms: Option<i64>,
    /// Grows with every change.
    pub revision: i64,
    /// Where to go from here.
    pub links: JobLinks,
}

/// How far the parts of a job have come.
#[derive(Debug, Serialize, ToSchema)]
pub struct PartsDone {
    /// How many are done.
    pub done: u32,
    /// Of so many.
    pub of: u32,
}

/// Links of a job.
#[derive(Debug, Serialize, ToSchema)]
pub struct JobLinks {
    /// The job itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its changes, as server-sent events.
    pub events: String,
    /// Its mesh; null where it has none.
    pub mesh: Option<String>,
    /// Its problem, of the kind `pencil_basis`; null for others.
    pub pencil: Option<String>,
    /// Its basis, once there is one.
    pub basis: Option<String>,
    /// The jobs that solve its parts, while it is divided; null where it is not.
    pub parts: Option<String>,
}

impl From<JobRecord> for JobResource {
    fn from(mut record: JobRecord) -> Self {
        // What a part made is no basis, and known to its job alone.
        record.basis = record.basis.filter(|_| !record.is_part());
        let itself = format!("/v1/jobs/{}", record.id);
        let source = Source::of(&record.kind, record.mesh);
        Self {
            links: JobLinks {
                events: format!("{itself}/events"),
                mesh: source.mesh_link(),
                pencil: source.pencil_link(),
                basis: record.basis.map(|basis| format!("/v1/bases/{basis}")),
                parts: (record.parts > 0).then(|| format!("/v1/jobs?parent={}", record.id)),
                itself,
            },
            id: record.id.to_string(),
            kind: record.kind,
            mesh: source.mesh,
            pencil: source.pencil,
            bases: (!record.bases.is_empty()).then(|| record.bases.iter().map(Uuid::to_string).collect()),
            parameters: abbreviated(record.parameters),
            priority: record.priority,
            status: record.status.into(),
            stage: record.stage,
            progress: record.progress,
            detail: record.detail,
            memory_bytes: record.memory_bytes,
            stage_seconds: stages(record.stage_seconds),
            attempt: record.attempt,
            max_attempts: record.max_attempts,
            parts: (record.parts > 0).then_some(PartsDone { done: record.parts_done, of: record.parts }),
            parent: record.parent.map(|parent| parent.to_string()),
            cancel_requested: record.cancel_requested,
            basis: record.basis.map(|basis| basis.to_string()),
            problem: record.problem.map(|problem| JobProblemResource {
                kind: format!("/problems/job/{}", problem.kind),
                title: "The job failed".to_owned(),
                detail: problem.detail,
            }),
            solver_version: record.solver_version,
            created_ms: record.created_ms,
            started_ms: record.started_ms,
            finished_ms: record.finished_ms,
            revision: record.revision,
        }
    }
}

/// A stored basis without its eigenvalues and certificate, as lists have it.
#[derive(Debug, Serialize, ToSchema)]
pub struct BasisSummary {
    /// A time-ordered UUID.
    pub id: String,
    /// The mesh it lives on; null where it is of a problem.
    pub mesh: Option<String>,
    /// The problem it is of, of the kind `pencil_basis` alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pencil: Option<String>,
    /// The job that made it.
    pub job: String,
    /// What kind of basis it is, which is the kind of that job: `eigenbasis` or `field_basis`.
    pub kind: String,
    /// The parameters of that job, with every default filled in.
    #[schema(value_type = Object)]
    pub parameters: Value,
    /// Vertices of the mesh, or rows of the problem, n.
    pub vertices: u64,
    /// Numbers of one function as it is lifted: a value per vertex, or two or three per face.
    pub rows: u64,
    /// `compact`: a sparse factor times a dense one; `dense`: the eigenfunctions as columns.
    pub storage: &'static str,
    /// The type of the numbers of a dense basis, `f32` or `f64`; null for a compact one.
    pub precision: Option<&'static str>,
    /// Columns of the sparse factor, d; null for a dense basis.
    pub dimension: Option<u64>,
    /// Pairs of eigenvalue and eigenfunction that are known, m.
    pub count: u64,
    /// Entries of the sparse factor; null for a dense basis.
    pub nonzeros: Option<u64>,
    /// Bytes of the NPZ file.
    pub bytes: u64,
    /// Bytes that the functions would take as a dense matrix of f64.
    pub dense_bytes: u64,
    /// The version of the solver.
    pub solver_version: String,
    /// When it was stored.
    pub created_ms: i64,
    /// Seconds spent in each stage, in order.
    pub stage_seconds: Vec<StageSeconds>,
    /// Where to go from here.
    pub links: BasisLinks,
}

/// A stored basis.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
    "job": "019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2", "kind": "eigenbasis",
    "parameters": {"method": "hsim", "count": 3, "operator": "auto", "mass": "barycentric", "boundary": "neumann", "tolerance": 0.01,
                   "variant": "sliced", "storage": "dense", "precision": "f32", "seed": 0},
    "vertices": 2930, "rows": 2930, "storage": "dense", "precision": "f32", "dimension": null, "count": 3, "nonzeros": null, "bytes": 62012,
    "dense_bytes": 70344, "solver_version": "0.1.0+5", "created_ms": 1795269601000i64,
    "stage_seconds": [{"stage": "iterate", "seconds": 0.001}],
    "eigenvalues": [0.0, 1.31, 2.08],
    "operator": {"laplacian": "cotangent", "reason": "fair_mesh", "non_manifold_edges": 0, "non_manifold_vertices": 0, "thin_faces": 0,
                 "zero_area_faces": 0, "massless_vertices": 0, "mollification": 0.0, "flips": 0, "delaunay": false, "removed_vertices": 0},
    "certificate": {"residuals": [1e-12, 0.001, 0.002], "bounds": [1e-12, 0.0004, 0.001], "estimates": [], "accuracy": null, "orthonormality_defect": 1e-13,
                    "complete": true, "inertia": [{"shift": 2.4, "below": 3}], "tolerance": 0.01,
                    "levels": [{"dimension": 300, "iterations": 0, "shifts": 0}, {"dimension": 2930, "iterations": 1, "shifts": 1}],
                    "projection_errors": [], "largest_projection_error": null},
    "details": null,
    "links": {"self": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "content": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10/content",
              "modes": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10/modes", "maps": null, "mesh": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "pencil": null,
              "design": null, "designs": null, "eigenfields": null, "fur": null, "hatching": null}
}))]
pub struct BasisResource {
    /// What lists have as well.
    #[serde(flatten)]
    pub summary: BasisSummary,
    /// m eigenvalues, ascending, in 1/length² of the mesh.
    pub eigenvalues: Vec<f64>,
    /// How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
    /// what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
    /// `surface_of_solid`. Null where the kind has no such choice.
    #[schema(value_type = Option<Object>)]
    pub operator: Value,
    /// What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
    /// nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
    /// whether they are as good as is usual, in `accuracy`. Null where nothing is.
    #[schema(value_type = Option<Object>)]
    pub certificate: Value,
    /// What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
    /// `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
    /// `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
    /// graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
    /// `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
    /// `fallbacks`, a list of what and why. Null where there is nothing of this.
    #[schema(value_type = Option<Object>)]
    pub details: Value,
}

impl From<BasisRecord> for BasisSummary {
    fn from(record: BasisRecord) -> Self {
        let source = Source::of(&record.kind, record.mesh);
        let itself = format!("/v1/bases/{}", record.id);
        let compact = record.storage == BasisStorage::Compact;
        Self {
            links: BasisLinks::new(itself, &record.kind, &source),
            id: record.id.to_string(),
            mesh: source.mesh,
            pencil: source.pencil,
            job: record.job.to_string(),
            kind: record.kind,
            parameters: abbreviated(record.parameters),
            vertices: record.vertices,
            rows: record.rows,
            storage: record.storage.name(),
            precision: match &record.storage {
                BasisStorage::Compact => None,
                BasisStorage::Dense(layout) => Some(layout.precision.name()),
            },
            dimension: compact.then_some(record.dimension),
            count: record.count,
            nonzeros: compact.then_some(record.nonzeros),
            bytes: record.bytes,
            dense_bytes: record.dense_bytes,
            solver_version: record.solver_version,
            created_ms: record.created_ms,
            stage_seconds: stages(record.stage_seconds),
        }
    }
}

impl From<BasisRecord> for BasisResource {
    fn from(mut record: BasisRecord) -> Self {
        let eigenvalues = std::mem::take(&mut record.eigenvalues);
        let certificate = std::mem::take(&mut record.certificate);
        let operator = std::mem::take(&mut record.operator);
        let details = std::mem::take(&mut record.details);
        Self { summary: record.into(), eigenvalues, operator, certificate, details }
    }
}
