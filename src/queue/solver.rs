//! The runner of the service: reads a job's parameters and does its work.

use std::sync::Arc;

use chladni_base::Monitor;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::analysis::map_collection::Shape;
use chladni_spectral::spectrum::pencil::Matrices;
use chladni_work::packed::Packed;
use chladni_work::{JobError, JobParameters};

use super::{JobFailure, Outcome, Runner, Watch};
use crate::store::{CollectedShape, JobRecord};

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
        Ok(Outcome { product })
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
        let all: Vec<Shape<'_>> = shapes.iter().map(|shape| Shape { basis: &shape.basis, mesh: &shape.mesh }).collect();
        let mut product = parameters.run_shapes(&all, monitor).map_err(failure)?.product;
        let bases: Vec<String> = shapes.iter().map(|shape| shape.id.to_string()).collect();
        let meshes: Vec<&str> = shapes.iter().map(|shape| shape.mesh_id.as_str()).collect();
        product.describe(serde_json::Map::from_iter([
            ("bases".to_owned(), bases.into()),
            ("meshes".to_owned(), meshes.into()),
        ]));
        Ok(Outcome { product })
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

fn solve(
    job: &JobRecord,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    monitor: &dyn Monitor,
) -> Result<Outcome, JobFailure> {
    let mut product = parameters(job)?.run_body(mesh, solid, monitor).map_err(failure)?.product;
    product.describe(serde_json::Map::from_iter([("mesh".to_owned(), job.mesh.clone().into())]));
    Ok(Outcome { product })
}

/// Numerical work is deterministic: another attempt at the same input would fail in the same way, unless that could not be read.
fn failure(error: JobError) -> JobFailure {
    match error {
        JobError::Cancelled(cancelled) => JobFailure::Cancelled(cancelled),
        other => JobFailure::Failed {
            kind: other.kind().to_owned(),
            detail: other.to_string(),
            retryable: other.is_passing(),
        },
    }
}
