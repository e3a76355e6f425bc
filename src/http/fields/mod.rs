//! Tangential fields: frames of faces, eigenfields, design, and what is made of designed fields.
//!
//! The requests themselves, and what they mean, are those of `chladni_work::design`.
//!
//! | file | what |
//! |---|---|
//! | `cache` | surfaces, alignments and models that outlive a request |
//! | `solve` | from a request to coefficients |
//! | `octets` | numbers as bytes |
//! | `design`, `eigenfields`, `frames`, `applications`, `decomposition`, `transport`, `quads` | the routes |
//! | `stored`, `stored_wire` | fields as resources |

mod applications;
mod cache;
mod decomposition;
mod design;
mod eigenfields;
mod frames;
mod octets;
mod patience;
mod quads;
mod solve;
mod stored;
mod stored_wire;
mod transport;

pub use cache::cached;

use chladni_spectral::field::{DesignError, FieldError, PrescribedError, RefineError, StreamlineError};
use chladni_work::design::DesignFault;
use utoipa_axum::router::OpenApiRouter;

use super::problem::{self, Problem};
use super::state::AppState;

/// The routes of fields.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .merge(frames::routes())
        .merge(eigenfields::routes())
        .merge(design::routes())
        .merge(applications::routes())
        .merge(decomposition::routes())
        .merge(transport::routes())
        .merge(quads::routes())
        .merge(stored::routes())
}

impl From<FieldError> for Problem {
    fn from(error: FieldError) -> Self {
        let text = super::convert::sentence(&error);
        match error {
            FieldError::Surface(_) | FieldError::Operator(_) => Self::new(&problem::NO_FIELD_SURFACE, text),
            other => Self::internal(other),
        }
    }
}

impl From<DesignError> for Problem {
    fn from(error: DesignError) -> Self {
        let text = super::convert::sentence(&error);
        let within = match &error {
            DesignError::Dimension { .. } => "dimension",
            DesignError::Weight { .. } => "weight",
            DesignError::NoEnergy => "no-energy",
            DesignError::NoData => "no-data",
            DesignError::Face { .. } => "face",
            DesignError::Direction { .. } => "direction",
            DesignError::Contradiction { .. } => "contradiction",
            DesignError::Dependent { .. } => "dependent",
            DesignError::Length { .. } | DesignError::Misfit(_) => "length",
            _ => return Self::internal(error),
        };
        let face = match error {
            DesignError::Contradiction { face } | DesignError::Dependent { face } => Some(face),
            _ => None,
        };
        let refused = Self::within(&problem::INVALID_DESIGN, within, text);
        if let Some(face) = face { refused.with("face", face) } else { refused }
    }
}

impl From<DesignFault> for Problem {
    fn from(fault: DesignFault) -> Self {
        let text = super::convert::sentence(&fault);
        match fault {
            // Members of a request are named as they are written.
            DesignFault::Request { within, face, place, reason } => {
                let refused = Self::within(&problem::INVALID_DESIGN, within, format!("{place}: {reason}."));
                if let Some(face) = face { refused.with("face", face) } else { refused }
            }
            DesignFault::Surface { .. } => Self::internal(fault),
            DesignFault::Curvature(_) => Self::new(&problem::NO_FIELD_SURFACE, text),
            DesignFault::Field(error) => error.into(),
            DesignFault::Design(error) => error.into(),
            DesignFault::Refine(error) => error.into(),
            DesignFault::Transport(error) => error.into(),
            DesignFault::Singularities(error) => error.into(),
            DesignFault::Lines(error) => error.into(),
            DesignFault::Quads(error) => error.into(),
            DesignFault::Cancelled(cancelled) => cancelled.into(),
        }
    }
}

impl From<RefineError> for Problem {
    fn from(error: RefineError) -> Self {
        let text = super::convert::sentence(&error);
        match error {
            RefineError::Operator(_) => Self::new(&problem::NO_FIELD_SURFACE, text),
            RefineError::Design(error) => error.into(),
            RefineError::Cancelled(cancelled) => cancelled.into(),
            RefineError::Tolerance { .. }
            | RefineError::Prescribed
            | RefineError::Weights { .. }
            | RefineError::Incomplete
            | RefineError::Unbounded { .. }
            | RefineError::NotConverged { .. } => Self::within(&problem::INVALID_DESIGN, "refine", text),
        }
    }
}

impl From<PrescribedError> for Problem {
    fn from(error: PrescribedError) -> Self {
        let text = super::convert::sentence(&error);
        match error {
            PrescribedError::OneSided(_) => Self::new(&problem::NO_FIELD_SURFACE, text),
            PrescribedError::Poisson(error) => error.into(),
            PrescribedError::Periods(_) => Self::internal(error),
            _ => Self::within(&problem::INVALID_DESIGN, "singularities", text),
        }
    }
}

impl From<StreamlineError> for Problem {
    fn from(error: StreamlineError) -> Self {
        let text = super::convert::sentence(&error);
        match error {
            StreamlineError::Parameter { name, .. } => {
                Self::within(&problem::INVALID_DESIGN, "hatching", text).with("parameter", name)
            }
            StreamlineError::Length { .. } => Self::internal(error),
            StreamlineError::Cancelled(cancelled) => cancelled.into(),
        }
    }
}

/// The equations of a surface are singular in double precision, which is the mesh's doing.
fn singular(text: &str) -> Problem {
    let why = "Some of its triangles are without area, or so thin that nothing is left of them in double precision.";
    Problem::new(&problem::NO_FIELD_SURFACE, format!("{text} {why}"))
}
