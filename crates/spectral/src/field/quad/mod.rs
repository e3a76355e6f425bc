//! The way from cross fields to quads: a field that follows creases and boundaries, the surface cut open at its
//! singular vertices, and a seamless parametrisation whose grid lines run along it.
//!
//! | file | what |
//! |---|---|
//! | `creases` | edges at which the surface is sharp |
//! | `split` | faces with several of them, split so that each part has one |
//! | `aligned` | the smoothest cross field of all that follow them |
//! | `smoothest` | its equations, by a factor or by multigrid cycles |
//! | `simple` | its zeros of higher order, split |
//! | `combing` | directions that go on from face to face, the matching, and the cut |
//! | `seams` | how coordinates go on across the cut |
//! | `dissection` | the order in which vertices of large surfaces are eliminated |
//! | `system` | the equations of the coordinates |
//! | `integrate` | their solution |
//! | `untangle` | faces turned back, one vertex at a time |
//! | `relax` | and together with the faces around them |
//! | `winding` | vertices around which coordinates wind too often, or not often enough |
//! | `rounding` | quarter turns and whole translations: grid lines that meet across the cut |
//! | `files` | OBJ, VTK, and the files of Directional |

mod aligned;
mod combing;
mod creases;
mod dissection;
mod files;
mod integrate;
mod relax;
mod rounding;
mod seams;
mod simple;
mod smoothest;
mod split;
mod system;
mod untangle;
mod winding;

pub use aligned::{CrossField, CrossParameters, crosses_of};
pub use combing::{Combed, comb};
pub use creases::creases;
pub use files::{write_matching, write_obj, write_raw_field, write_singularities, write_vtk};
pub use integrate::{Parametrisation, ParametrisationParameters, VertexOrder, parametrise};
pub use split::{crowded, split};

use chladni_algebra::FactorError;
use chladni_base::{Cancelled, stopped};
use chladni_mesh::dual::OneSided;

use super::poisson::PoissonError;

/// The most coordinates that are rounded: each takes a solve, and a row of a dense matrix.
pub const MOST_ROUNDED: usize = 4096;

/// What helps against a zero around which no quads can meet.
fn remedy(held: bool) -> &'static str {
    match held {
        true => {
            "all faces around it lie at creases or boundaries, whose directions leave no other. Take a mesh with a ring of vertices between, creases of a larger angle that leave these out, or a field whose singular vertices are prescribed, of a basis of 4-vectors"
        }
        false => {
            "give directions on faces around it that have less, or a field whose singular vertices are prescribed, of a basis of 4-vectors"
        }
    }
}

/// Why there is no cross field, or no parametrisation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum QuadError {
    /// The surface has one side, or its faces do not agree about two.
    #[error("coordinates with quads between their lines need an oriented surface: {0}")]
    OneSided(#[from] OneSided),
    /// A field is given for another surface.
    #[error("the field has {found} numbers; {wanted} are needed, two for each face")]
    Field {
        /// Numbers of the field.
        found: usize,
        /// Two for each face.
        wanted: usize,
    },
    /// The field has no direction in a face.
    #[error("the field has no direction on face {face}")]
    NoDirection {
        /// The face.
        face: usize,
    },
    /// A parameter is out of its range.
    #[error("{name} is {value}: {range}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// A direction that is to be met exactly lies on a face that is not there.
    #[error("direction {at} is given on face {face} of {faces}")]
    Face {
        /// Which direction.
        at: usize,
        /// Its face.
        face: u32,
        /// How many faces there are.
        faces: usize,
    },
    /// Two directions that are to be met exactly on one face make different crosses.
    #[error("two directions on face {face} must be met exactly, but make different crosses")]
    Contradiction {
        /// The face.
        face: u32,
    },
    /// The smoothest field has a zero of so high an order that no quads meet there.
    #[error(
        "around vertex {vertex} the smoothest field has the index {index}, where no quads can meet, and no field near it has less: {}",
        remedy(*held)
    )]
    Zero {
        /// The vertex.
        vertex: u32,
        /// The index.
        index: f64,
        /// Whether the directions of all faces around it are held.
        held: bool,
    },
    /// A field that is given has an index around which no quads can meet.
    #[error(
        "around vertex {vertex} the field has the index {index}, where no quads can meet: use a field with other singular vertices, as they are prescribed to a design of 4-vectors, or directions of other faces around it"
    )]
    Index {
        /// The vertex.
        vertex: u32,
        /// The index.
        index: f64,
    },
    /// Too many coordinates would have to be rounded.
    #[error(
        "{count} coordinates would have to be rounded, more than {MOST_ROUNDED}: use a smoother field, with fewer singular vertices, or leave grid lines apart at the cut"
    )]
    Rounding {
        /// How many.
        count: usize,
    },
    /// So many seams meet at vertices that the equations would not fit.
    #[error("{count} seams and more cross around vertex {vertex}: use a smoother field, with fewer singular vertices")]
    Seams {
        /// A vertex where they meet.
        vertex: u32,
        /// How many of them, at least.
        count: usize,
    },
    /// Equations were not solved.
    #[error("the equations on the surface could not be solved: {0}")]
    Factor(FactorError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(QuadError: FactorError => Self::Factor);

impl From<PoissonError> for QuadError {
    fn from(error: PoissonError) -> Self {
        match error {
            PoissonError::OneSided(at) => Self::OneSided(at),
            PoissonError::Factor(error) => Self::Factor(error),
            // Its matrices have no such functions.
            PoissonError::Flat { face, .. } => Self::Factor(FactorError::Singular { pivot: face as usize }),
            PoissonError::Cancelled(cancelled) => Self::Cancelled(cancelled),
        }
    }
}
