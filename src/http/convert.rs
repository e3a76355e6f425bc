//! Errors of other rooms as problems.

use chladni_mesh::check::MeshError;
use chladni_mesh::read::ReadError;
use chladni_spectral::analysis::family::FamilyError;
use chladni_spectral::analysis::filter::FilterError;
use chladni_spectral::analysis::vibration::SimulationError;
use chladni_spectral::analysis::{AnalysisError, allowed};
use chladni_spectral::basis::{BasisError, ColumnError, ProductKind, ProvenanceError};
use chladni_work::ParameterError;

use super::problem::{self, Problem};
use crate::store::{DAMAGE, StoreError};

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        let text = sentence(&error);
        match error {
            StoreError::NotFound { resource, .. } => match resource {
                "mesh" => Self::new(&problem::UNKNOWN_MESH, text),
                "problem" => Self::new(&problem::UNKNOWN_PROBLEM, text),
                "job" => Self::new(&problem::UNKNOWN_JOB, text),
                "basis" => Self::new(&problem::UNKNOWN_BASIS, text),
                "field" => Self::new(&problem::UNKNOWN_FIELD, text),
                _ => Self::new(&problem::NOT_FOUND, "The content was deleted."),
            },
            StoreError::MeshInUse { unfinished_jobs, job, bases, fields, .. } => Self::new(&problem::MESH_IN_USE, text)
                .with("unfinished_jobs", unfinished_jobs)
                .with("job", job.map(|job| job.to_string()))
                .with("bases", bases)
                .with("fields", fields),
            StoreError::BasisInUse { job, .. } => Self::new(&problem::BASIS_IN_USE, text).with("job", job.to_string()),
            StoreError::BasisKind { basis, kind: ProductKind::PencilBasis, wanted } => Self::new(
                &problem::BASIS_WITHOUT_MESH,
                format!(
                    "Basis {basis} is of matrices that came without a mesh; this route needs one of the kind {}.",
                    wanted.name()
                ),
            )
            .with("kind", ProductKind::PencilBasis.name())
            .with("kinds", vec![wanted.name()]),
            StoreError::BasisKind { kind, wanted, .. } => {
                Self::new(&problem::BASIS_KIND, text).with("kind", kind.name()).with("kinds", vec![wanted.name()])
            }
            StoreError::IdempotencyConflict { job, .. } => {
                Self::new(&problem::IDEMPOTENCY_CONFLICT, text).with("job", job.to_string())
            }
            StoreError::JobState { status, .. } => {
                Self::new(&problem::STATE_CONFLICT, text).with("job_status", status.as_str())
            }
            StoreError::InvalidCursor { .. } => Self::new(&problem::INVALID_CURSOR, text),
            StoreError::InvalidRange { .. } => Self::new(&problem::RANGE_NOT_SATISFIABLE, text),
            StoreError::QueueFull { limit, .. } => {
                Self::new(&problem::QUEUE_FULL, text).with("limit", limit).retry_after(10)
            }
            StoreError::JobTooLarge { needed, limit } => {
                Self::new(&problem::JOB_TOO_LARGE, text).with("estimate", needed).with("limit", limit)
            }
            StoreError::StorageFull { detail } => {
                tracing::warn!(detail, "storage full");
                Self::new(&problem::STORAGE_FULL, "The storage is full. Nothing was stored.").retry_after(60)
            }
            StoreError::Busy { detail } => {
                tracing::warn!(detail, "storage busy");
                Self::new(&problem::STORAGE_BUSY, "The storage is busy. Nothing was stored; try again.").retry_after(1)
            }
            StoreError::Unavailable { detail } => {
                tracing::warn!(detail, "storage unavailable");
                Self::new(&problem::STORAGE_UNAVAILABLE, "The storage does not answer. Try again.").retry_after(5)
            }
            StoreError::Moved { .. } => Self::new(&problem::STORAGE_REPLACED, text),
            StoreError::Damaged { hash, how } => {
                tracing::error!(content = hash, how, "damaged content was requested");
                Self::damaged()
            }
            other => Self::internal(other),
        }
    }
}

impl Problem {
    /// Content that is not what was stored. It is not served, and nobody keeps this answer.
    fn damaged() -> Self {
        Self::new(
            &problem::DAMAGED_CONTENT,
            "The stored content is damaged or missing. It is repaired by uploading the same mesh again, or by submitting the same job again.",
        )
    }
}

impl From<ParameterError> for Problem {
    fn from(error: ParameterError) -> Self {
        let text = sentence(&error);
        match error {
            ParameterError::UnknownKind { .. } => Self::within(&problem::INVALID_PARAMETER, "kind", text),
            ParameterError::NoFaces { .. } => Self::within(&problem::INVALID_PARAMETER, "no-faces", text),
            ParameterError::Form { .. } => Self::within(&problem::INVALID_PARAMETER, "form", text),
            ParameterError::Value { name, .. } => {
                Self::within(&problem::INVALID_PARAMETER, name, text).with("parameter", name)
            }
        }
    }
}

impl From<ReadError> for Problem {
    fn from(error: ReadError) -> Self {
        Self::within(&problem::UNREADABLE_MESH, error.kind(), sentence(&error))
    }
}

impl From<MeshError> for Problem {
    fn from(error: MeshError) -> Self {
        Self::within(&problem::UNUSABLE_MESH, error.kind(), sentence(&error))
    }
}

impl From<BasisError> for Problem {
    fn from(error: BasisError) -> Self {
        match error {
            BasisError::Modes { from, to, count } => Self::new(
                &problem::INVALID_RANGE_OF_MODES,
                format!("Modes {from}..{to} were requested, but the basis has {count}."),
            )
            .with("count", count),
            BasisError::Rows { found, expected } => {
                Self::new(&problem::INVALID_FUNCTION, format!("A function has {found} values; {expected} are needed."))
            }
            BasisError::Vertex { .. } => Self::new(&problem::INVALID_VERTEX, sentence(&error)),
            BasisError::Unavailable { error: ColumnError::Gone, .. } => {
                Self::new(&problem::UNKNOWN_BASIS, "The basis was deleted meanwhile.")
            }
            BasisError::Unavailable { error: ColumnError::Failed(text), .. } if text.starts_with(DAMAGE) => {
                Self::damaged()
            }
            BasisError::Unavailable { .. } | BasisError::Inconsistent => Self::internal(error),
        }
    }
}

impl From<ProvenanceError> for Problem {
    /// What is stored was made here, and says how.
    fn from(error: ProvenanceError) -> Self {
        Self::internal(error)
    }
}

impl From<FamilyError> for Problem {
    fn from(error: FamilyError) -> Self {
        match error {
            FamilyError::Parameter { name, .. } => {
                Self::within(&problem::INVALID_SPECTRUM, name, sentence(&error)).with("parameter", name)
            }
            FamilyError::Eigen(error) => Self::internal(error),
            FamilyError::Provenance(error) => error.into(),
        }
    }
}

impl From<SimulationError> for Problem {
    fn from(error: SimulationError) -> Self {
        let within = match error {
            SimulationError::Vertex { .. } => "vertex-out-of-range",
            SimulationError::Load { .. } => "loads",
            SimulationError::Damping { .. } => "damping",
            SimulationError::Time { .. } | SimulationError::Overflow { .. } => "times",
            SimulationError::Sound { .. } => "sound",
            SimulationError::Initial(_) => "initial",
            SimulationError::Basis(error) => return error.into(),
        };
        Self::within(&problem::INVALID_SIMULATION, within, sentence(&error))
    }
}

impl From<FilterError> for Problem {
    fn from(error: FilterError) -> Self {
        match error {
            FilterError::Basis(error) => error.into(),
            FilterError::Parameter { parameter, value, expected } => Self::new(
                &problem::INVALID_TRANSFER,
                format!("transfer: {parameter} must be {expected}, not {}.", short(value)),
            ),
            other => Self::new(&problem::INVALID_TRANSFER, format!("transfer: {}", sentence(&other))),
        }
    }
}

impl From<AnalysisError> for Problem {
    fn from(error: AnalysisError) -> Self {
        let text = sentence(&error);
        match error {
            AnalysisError::Vertex { what, vertex, vertices, .. } => Self::new(&problem::INVALID_VERTEX, text)
                .with("what", what)
                .with("vertex", vertex)
                .with("vertices", vertices),
            AnalysisError::Parameter { parameter, value, expected } => {
                Self::new(&problem::INVALID_ANALYSIS, format!("{parameter}: must be {expected}, not {}.", short(value)))
            }
            AnalysisError::Count { what, found, least, most } => {
                Self::new(&problem::INVALID_ANALYSIS, format!("{what}: must be {}, not {found}.", allowed(least, most)))
            }
            AnalysisError::Stream { at, .. } => Self::new(&problem::INVALID_STREAM, text).with("at", at),
            AnalysisError::Basis(error) => error.into(),
            AnalysisError::Cancelled(cancelled) => cancelled.into(),
            AnalysisError::Provenance(error) => error.into(),
            AnalysisError::Eigen(_) | AnalysisError::Factor(_) | AnalysisError::Compression { .. } => {
                Self::internal(error)
            }
            _ => Self::new(&problem::INVALID_ANALYSIS, text),
        }
    }
}

/// A number as one would write it: with an exponent, where it had dozens of digits without one.
fn short(value: f64) -> String {
    match value.abs() {
        size if size >= 1e16 && size.is_finite() || size > 0.0 && size < 1e-6 => format!("{value:e}"),
        _ => value.to_string(),
    }
}

/// An error message as a sentence.
pub(super) fn sentence(error: &dyn std::error::Error) -> String {
    let text = error.to_string();
    let mut letters = text.chars();
    let Some(first) = letters.next() else { return text };
    let end = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    format!("{}{}{end}", first.to_uppercase(), letters.as_str())
}
