//! The runner of the service: reads a job's parameters and does its work.

use std::num::NonZeroUsize;
use std::sync::Arc;

use chladni_base::{Monitor, trim};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::analysis::map_collection::CollectionShape;
use chladni_spectral::basis::{PARTS, StoredPart};
use chladni_spectral::formats::{FormatError, npz};
use chladni_spectral::spectrum::hsim::parts::PartError;
use chladni_spectral::spectrum::pencil::Matrices;
use chladni_work::packed::Packed;
use chladni_work::{JobError, JobParameters, PartJob};

use super::{JobFailure, Outcome, Runner, Watch};
use crate::store::{CollectedShape, JobRecord, PartSource};

/// Runs every kind of job that the room `job` knows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Solver;

impl Runner for Solver {
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        solve(job, &mesh, None, monitor)
    }

    fn run_body(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        solve(job, &mesh, solid.as_deref(), monitor)
    }

    fn run_problem(
        &self,
        job: &JobRecord,
        matrices: Arc<Matrices>,
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        let parameters = parameters(job)?;
        let JobParameters::PencilBasis(parameters) = parameters else {
            return Err(misplaced(job, "a mesh"));
        };
        let mut product = parameters.run_problem(&matrices, monitor).map_err(failure)?.product;
        product.describe(serde_json::Map::from_iter([("pencil".to_owned(), job.mesh.clone().into())]));
        Ok(Outcome::Product(product))
    }

    fn run_to_divide(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        (workers, before): (usize, usize),
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        let (parameters, solid) = (parameters(job)?, solid.as_deref());
        let plan = parameters.plan_parts(&mesh, solid, workers, NonZeroUsize::new(before), monitor).map_err(failure)?;
        match plan {
            Ok(Some(division)) => Ok(Outcome::Parts(division)),
            Ok(None) => solve(job, &mesh, solid, monitor),
            Err(reason) => whole(job, &parameters, (&mesh, solid), &reason, monitor),
        }
    }

    fn run_parts(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        parts: Arc<dyn PartSource>,
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        let none = || JobFailure::Failed {
            kind: "invalid-parameters".to_owned(),
            detail: "there are no parts to join".to_owned(),
            retryable: false,
        };
        let count = NonZeroUsize::new(parts.count()).ok_or_else(none)?;
        let (parameters, solid) = (parameters(job)?, solid.as_deref());
        let mut about = Vec::new();
        let mut next = |number: usize| {
            let bytes = parts.bytes(number).map_err(|error| {
                tracing::warn!(%error, "a part could not be read");
                PartError::Missing { number: number + 1, parts: count.get() }
            })?;
            let damaged = |error: FormatError| PartError::Damaged { number: number + 1, reason: error.to_string() };
            let (part, told) = npz::read_part(&bytes).map_err(damaged)?;
            about.push(told);
            // As it was stored, the last part would lie beside the whole.
            drop(bytes);
            trim();
            Ok(part)
        };
        let of = (count, job.solver_version.as_str());
        let joined = parameters.join_parts_as(&mesh, solid, of, &mut next, monitor);
        let mut product = match joined {
            Ok(outcome) => outcome.product,
            // What is stored is what was stored: another attempt would meet the same.
            Err(JobError::Parts(error)) if !matches!(error, PartError::Missing { .. }) => {
                return whole(job, &parameters, (&mesh, solid), &error.to_string(), monitor);
            }
            Err(JobError::Parts(error)) => {
                let (kind, detail) = (error.kind().to_owned(), error.to_string());
                return Err(JobFailure::Failed { kind, detail, retryable: true });
            }
            Err(error) => return Err(failure(error)),
        };
        product.describe(serde_json::Map::from_iter([
            ("mesh".to_owned(), job.mesh.clone().into()),
            (PARTS.to_owned(), about.into()),
        ]));
        Ok(Outcome::Product(product))
    }

    fn run_collection(
        &self,
        job: &JobRecord,
        shapes: Vec<CollectedShape>,
        monitor: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        let JobParameters::MapCollection(parameters) = parameters(job)? else {
            return Err(misplaced(job, "one mesh"));
        };
        let all: Vec<CollectionShape<'_>> =
            shapes.iter().map(|shape| CollectionShape { basis: &shape.basis, mesh: &shape.mesh }).collect();
        let mut product = parameters.run_shapes(&all, monitor).map_err(failure)?.product;
        let bases: Vec<String> = shapes.iter().map(|shape| shape.id.to_string()).collect();
        let meshes: Vec<&str> = shapes.iter().map(|shape| shape.mesh_id.as_str()).collect();
        product.describe(serde_json::Map::from_iter([
            ("bases".to_owned(), bases.into()),
            ("meshes".to_owned(), meshes.into()),
        ]));
        Ok(Outcome::Product(product))
    }
}

/// A job whose kind works on something else than it was given.
fn misplaced(job: &JobRecord, on: &str) -> JobFailure {
    let detail = format!("jobs of the kind {} work on {on}", job.kind);
    JobFailure::Failed { kind: "invalid-parameters".to_owned(), detail, retryable: false }
}

fn parameters(job: &JobRecord) -> Result<JobParameters, JobFailure> {
    // What is in the queue was let in, trials as well.
    JobParameters::read_any(&job.kind, &Packed::from(&job.parameters)).map_err(JobError::from).map_err(failure)
}

/// Does a job in one piece that was to be divided.
fn whole(
    job: &JobRecord,
    parameters: &JobParameters,
    (mesh, solid): (&TriangleMesh, Option<&TetMesh>),
    reason: &str,
    monitor: &dyn Monitor,
) -> Result<Outcome, JobFailure> {
    let mut product = parameters.run_whole(mesh, solid, reason, monitor).map_err(failure)?.product;
    product.describe(serde_json::Map::from_iter([("mesh".to_owned(), job.mesh.clone().into())]));
    Ok(Outcome::Product(product))
}

/// Solves a part of another job.
fn solve_part(
    job: &JobRecord,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    monitor: &dyn Monitor,
) -> Result<Outcome, JobFailure> {
    let PartJob { whole, number, parts } = PartJob::read(&job.parameters).map_err(JobError::from).map_err(failure)?;
    let made = whole.solve_part_as(mesh, solid, (number, parts), &job.solver_version, monitor).map_err(failure)?;
    let slices = made.part.slices.as_deref().unwrap_or_default();
    let about = serde_json::json!({
        "part": number + 1,
        "pairs": slices.iter().map(|slice| slice.values.len()).sum::<usize>(),
        "unknowns": made.part.share.as_ref().map_or(0, |share| share.rows.len()),
        "seconds": made.seconds.iter().map(|(_, seconds)| seconds).sum::<f64>(),
        "threads": rayon::current_num_threads(),
    });
    let unwritten = |error: FormatError| JobFailure::Failed {
        kind: "storage-unavailable".to_owned(),
        detail: format!("the part could not be encoded: {error}"),
        retryable: true,
    };
    monitor.stage("encode");
    Ok(Outcome::Product(StoredPart::new(&made.part, about).map_err(unwritten)?.into()))
}

fn solve(
    job: &JobRecord,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    monitor: &dyn Monitor,
) -> Result<Outcome, JobFailure> {
    if job.is_part() {
        return solve_part(job, mesh, solid, monitor);
    }
    let mut product = parameters(job)?.run_body(mesh, solid, monitor).map_err(failure)?.product;
    product.describe(serde_json::Map::from_iter([("mesh".to_owned(), job.mesh.clone().into())]));
    Ok(Outcome::Product(product))
}

/// Numerical work is deterministic: another attempt at the same input would fail in the same way, unless that could not
/// be read.
fn failure(error: JobError) -> JobFailure {
    match error {
        JobError::Cancelled(cancelled) => JobFailure::Cancelled(cancelled),
        JobError::Memory { needed, .. } => JobFailure::NeedsMore { bytes: needed, detail: error.to_string() },
        other => JobFailure::Failed {
            kind: other.kind().to_owned(),
            detail: other.to_string(),
            retryable: other.is_passing(),
        },
    }
}
