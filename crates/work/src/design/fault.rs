//! Why a field cannot be designed, or something made of one.

use chladni_base::{Cancelled, stopped};
use chladni_spectral::field::quad::QuadError;
use chladni_spectral::field::{
    DesignError, FieldError, PrescribedError, RefineError, StreamlineError, SurfaceError, TransportError,
};

/// Why a request about a field cannot be answered.
#[derive(Debug, thiserror::Error)]
pub enum DesignFault {
    /// A member of the request does not fit.
    #[error("{place}: {reason}")]
    Request {
        /// What kind of thing is wrong: `face`, `direction`, `weight`, …
        within: &'static str,
        /// The member.
        place: String,
        /// Why.
        reason: String,
        /// The face that it is about.
        face: Option<u32>,
    },
    /// The basis does not belong to the surface.
    #[error("the basis has {basis} faces and the surface {surface}")]
    Surface {
        /// Faces of the basis.
        basis: usize,
        /// Faces of the surface.
        surface: usize,
    },
    /// The surface has no curvature tensors.
    #[error("{0}")]
    Curvature(String),
    /// The surface or the space is none for fields.
    #[error(transparent)]
    Field(FieldError),
    /// The design failed.
    #[error(transparent)]
    Design(DesignError),
    /// The singularities cannot be had.
    #[error(transparent)]
    Singularities(#[from] PrescribedError),
    /// The design was not refined.
    #[error(transparent)]
    Refine(RefineError),
    /// Vectors could not be carried.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// No lines could be laid.
    #[error(transparent)]
    Lines(StreamlineError),
    /// There is no cross field, or no parametrisation.
    #[error(transparent)]
    Quads(QuadError),
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl DesignFault {
    /// Whether the space of a basis has too few dimensions for what it has to be, which a field of the whole surface
    /// may be.
    pub fn lacks_freedom(&self) -> bool {
        matches!(self, Self::Design(DesignError::Dependent { .. }) | Self::Request { within: "dependent", .. })
    }
}

stopped!(
    DesignFault:
    FieldError => Self::Field,
    DesignError => Self::Design,
    RefineError => Self::Refine,
    StreamlineError => Self::Lines,
    QuadError => Self::Quads,
);

impl From<SurfaceError> for DesignFault {
    fn from(error: SurfaceError) -> Self {
        FieldError::from(error).into()
    }
}

/// A refusal that names a member of the request.
pub fn refused(within: &'static str, place: &str, reason: impl std::fmt::Display) -> DesignFault {
    DesignFault::Request { within, place: place.to_owned(), reason: reason.to_string(), face: None }
}

/// The same, about a face.
pub(super) fn refused_at(face: u32, within: &'static str, place: &str, reason: impl std::fmt::Display) -> DesignFault {
    DesignFault::Request { within, place: place.to_owned(), reason: reason.to_string(), face: Some(face) }
}
