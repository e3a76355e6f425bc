//! Why a field cannot be designed, or something made of one.

use chladni_base::{Cancelled, stopped};
use chladni_mesh::dual::OneSided;
use chladni_mesh::numbering::Translation;
use chladni_spectral::field::quad::QuadError;
use chladni_spectral::field::{
    DesignError, FieldError, PoissonError, PrescribedError, RefineError, StreamlineError, SurfaceError, TransportError,
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

    /// What was found on the kept mesh, with its vertices and faces as the request numbers them. Not for what
    /// [`DesignRequest::translate`](super::DesignRequest::translate) refuses, which names those of the request already.
    #[must_use]
    pub fn numbered(self, to: &Translation) -> Self {
        if to.is_identity() {
            return self;
        }
        let names = Names(to);
        match self {
            Self::Request { within, place, reason, face: Some(kept) } => {
                let face = names.face(kept);
                // Reasons that name the face do so in these words.
                let reason = reason.replacen(&format!("face {kept}"), &format!("face {face}"), 1);
                Self::Request { within, place, reason, face: Some(face) }
            }
            Self::Field(FieldError::Surface(SurfaceError::OneSided { what, at })) => {
                Self::Field(FieldError::Surface(SurfaceError::OneSided { what, at: names.one_sided(at) }))
            }
            Self::Design(error) => Self::Design(names.design(error)),
            Self::Refine(RefineError::Design(error)) => Self::Refine(RefineError::Design(names.design(error))),
            Self::Singularities(error) => Self::Singularities(names.prescribed(error)),
            Self::Transport(error) => Self::Transport(names.transport(error)),
            Self::Quads(error) => Self::Quads(names.quads(error)),
            other => other,
        }
    }
}

/// Vertices and faces of the kept mesh as a request numbers them.
struct Names<'a>(&'a Translation);

impl Names<'_> {
    fn vertex(&self, kept: u32) -> u32 {
        known(kept, self.0.file_vertex(kept))
    }

    fn face(&self, kept: u32) -> u32 {
        known(kept, self.0.file_face(kept))
    }

    fn far_face(&self, kept: usize) -> usize {
        u32::try_from(kept).map_or(kept, |kept| self.face(kept) as usize)
    }

    fn one_sided(&self, at: OneSided) -> OneSided {
        OneSided { from: self.vertex(at.from), to: self.vertex(at.to), faces: at.faces.map(|face| self.face(face)) }
    }

    fn poisson(&self, error: PoissonError) -> PoissonError {
        match error {
            PoissonError::OneSided(at) => PoissonError::OneSided(self.one_sided(at)),
            PoissonError::Flat { face, faces } => PoissonError::Flat { face: self.face(face), faces },
            other => other,
        }
    }

    fn design(&self, error: DesignError) -> DesignError {
        match error {
            DesignError::Face { constraint, face, faces } => {
                DesignError::Face { constraint, face: self.face(face), faces }
            }
            DesignError::Direction { constraint, face } => DesignError::Direction { constraint, face: self.face(face) },
            DesignError::Contradiction { face } => DesignError::Contradiction { face: self.face(face) },
            DesignError::Dependent { face } => DesignError::Dependent { face: self.face(face) },
            other => other,
        }
    }

    fn prescribed(&self, error: PrescribedError) -> PrescribedError {
        match error {
            PrescribedError::OneSided(at) => PrescribedError::OneSided(self.one_sided(at)),
            PrescribedError::Vertex { at, vertex, vertices } => {
                PrescribedError::Vertex { at, vertex: self.vertex(vertex), vertices }
            }
            PrescribedError::Boundary { at, vertex } => PrescribedError::Boundary { at, vertex: self.vertex(vertex) },
            PrescribedError::Twice { vertex } => PrescribedError::Twice { vertex: self.vertex(vertex) },
            PrescribedError::Zero { at, vertex } => PrescribedError::Zero { at, vertex: self.vertex(vertex) },
            PrescribedError::Sum { face, sum, order, characteristic } => {
                PrescribedError::Sum { face: self.far_face(face), sum, order, characteristic }
            }
            PrescribedError::Poisson(error) => PrescribedError::Poisson(self.poisson(error)),
            other => other,
        }
    }

    fn transport(&self, error: TransportError) -> TransportError {
        match error {
            TransportError::Heat(error) => TransportError::Heat(self.poisson(error)),
            TransportError::OutOfReach { face } => TransportError::OutOfReach { face: self.far_face(face) },
            TransportError::Cancelling { face } => TransportError::Cancelling { face: self.far_face(face) },
            other => other,
        }
    }

    fn quads(&self, error: QuadError) -> QuadError {
        match error {
            QuadError::OneSided(at) => QuadError::OneSided(self.one_sided(at)),
            QuadError::NoDirection { face } => QuadError::NoDirection { face: self.far_face(face) },
            QuadError::Face { at, face, faces } => QuadError::Face { at, face: self.face(face), faces },
            QuadError::Contradiction { face } => QuadError::Contradiction { face: self.face(face) },
            QuadError::Zero { vertex, index, held } => QuadError::Zero { vertex: self.vertex(vertex), index, held },
            QuadError::Index { vertex, index } => QuadError::Index { vertex: self.vertex(vertex), index },
            QuadError::Seams { vertex, count } => QuadError::Seams { vertex: self.vertex(vertex), count },
            other => other,
        }
    }
}

/// Parts of faces that were split for quads are beyond what the file has: their own numbers are all that there is.
fn known(kept: u32, file: u32) -> u32 {
    if file == u32::MAX { kept } else { file }
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
