//! Tangential fields: frames of faces, eigenfields, design, and what is made of designed fields.
//!
//! | file | what |
//! |---|---|
//! | `cache` | surfaces and alignments that outlive a request |
//! | `request` | what a design is asked for with |
//! | `solve` | from a request to coefficients |
//! | `forms` | stored numbers as a client reads them |
//! | `design`, `eigenfields`, `frames`, `applications` | the routes |

mod applications;
mod cache;
mod design;
mod eigenfields;
mod forms;
mod frames;
mod request;
mod solve;

pub use cache::FieldCache;

use chladni_spectral::field::{DesignError, FieldError, PrescribedError, StreamlineError};
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
            DesignError::Length { .. } => "length",
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

impl From<PrescribedError> for Problem {
    fn from(error: PrescribedError) -> Self {
        let text = super::convert::sentence(&error);
        match error {
            PrescribedError::Poisson(_) | PrescribedError::Periods(_) => Self::internal(error),
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
            StreamlineError::Cancelled(_) => Self::within(
                &problem::INVALID_DESIGN,
                "hatching",
                "The lines were not laid within the time of a request; ask for a larger spacing or fewer lines.",
            ),
        }
    }
}
