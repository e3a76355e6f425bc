//! Why something was not computed in a basis.

use chladni_algebra::{DefiniteError, EigenError, FactorError};
use chladni_base::{Cancelled, stopped};

use crate::basis::{Basis, BasisError, ProvenanceError};
use crate::operator::OperatorError;

/// Why something was not computed in a basis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AnalysisError {
    /// A parameter is out of its range.
    #[error("{parameter} must be {expected}, got {value}")]
    Parameter {
        /// Its name.
        parameter: &'static str,
        /// What it is.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// There are too few or too many of something.
    #[error("{}", counted(.what, *.found, *.least, *.most))]
    Count {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// The fewest.
        least: usize,
        /// The most.
        most: usize,
    },
    /// Something refers to a vertex that there is not.
    #[error("{what} {place} is vertex {vertex} of {vertices}")]
    Vertex {
        /// A source, a landmark.
        what: &'static str,
        /// Which of them, from 0.
        place: usize,
        /// The vertex.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// An eigenvalue is below zero, where a distance needs none to be.
    #[error("eigenvalue {index} is {value}; this needs a spectrum without negative values")]
    Negative {
        /// Its number, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A shape has nothing that it could be scaled by.
    #[error("shape {shape} cannot be scaled: its {what} is {value}, which is not positive")]
    NoScale {
        /// Which shape, from 0.
        shape: usize,
        /// What it should be scaled by.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A spectrum without an eigenvalue above its kernel.
    #[error("shape {shape} has no eigenvalue above its kernel, so there is nothing to compare")]
    NothingAbove {
        /// The shape.
        shape: usize,
    },
    /// The lowest pairs are needed, and the basis holds others.
    #[error("the basis holds the pairs of an interval, starting at pair {first}; this needs the lowest pairs")]
    NotLowest {
        /// The index of its first pair.
        first: usize,
    },
    /// All eigenvalues are zero.
    #[error("the basis has no eigenvalue above zero")]
    OnlyKernel,
    /// The basis and the mesh have different numbers of vertices.
    #[error("the basis has {basis} vertices and the mesh {mesh}")]
    Mesh {
        /// Vertices of the basis.
        basis: usize,
        /// Vertices of the mesh.
        mesh: usize,
    },
    /// Something does not change with the positions of vertices in a way that is known here.
    #[error(
        "gradients are not available for {of}; they are for \"laplace\" and \"volume\" with the mass \"barycentric\" or \"consistent\""
    )]
    NoDerivative {
        /// Of what.
        of: String,
    },
    /// The basis does not say what it is of.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
    /// Eigenvalues coincide, and a loss depends on which functions of their common space stand for them.
    #[error(
        "eigenvalues {first} and {second} coincide, and the loss depends on the choice of eigenfunctions in their common space; weight all eigenvalues of a cluster equally"
    )]
    Turned {
        /// The lower one, from 0.
        first: usize,
        /// The higher one.
        second: usize,
    },
    /// Eigenvalues coincide, and a loss of their functions counts their values differently.
    #[error(
        "eigenvalues {first} and {second} coincide but the loss weights them differently, so that its gradient does not follow from these derivatives; give them equal derivatives, or move the vertices by about 1e-5 of an edge to separate them"
    )]
    Mixed {
        /// The lower one, from 0.
        first: usize,
        /// The higher one.
        second: usize,
    },
    /// A basis ends among eigenvalues that coincide, or misses one.
    #[error(
        "eigenvalue {index} belongs to a cluster cut off by the basis; end it in a spectral gap above all eigenvalues that the loss uses"
    )]
    Cut {
        /// Its number, from 0.
        index: usize,
    },
    /// The pairs of a basis are too rough for the gradient of a loss of its functions.
    #[error(
        "the pairs near eigenvalue {index} are too inaccurate for gradients of eigenfunctions; solve by \"hsim\" with a smaller tolerance and the precision \"f64\""
    )]
    Rough {
        /// Its number, from 0.
        index: usize,
    },
    /// An iteration did not come to its end.
    #[error("the equation for eigenfunction {index} did not converge in {steps} steps")]
    Unsolved {
        /// Its number, from 0.
        index: usize,
        /// The steps.
        steps: usize,
    },
    /// The mesh has points without faces.
    #[error("geodesic distances need a surface with faces, and the mesh has only points")]
    NoFaces,
    /// Bytes are no compressed functions, or not those of this basis.
    #[error("compressed functions, byte {at}: {reason}")]
    Stream {
        /// Where it was noticed.
        at: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// The compressor failed, which into memory it does where there is none.
    #[error("{bytes} bytes of rounded coefficients were not compressed: {reason}")]
    Compression {
        /// How many.
        bytes: usize,
        /// What the compressor said.
        reason: String,
    },
    /// A dense eigenproblem failed.
    #[error("a small eigenproblem could not be solved: {0}")]
    Eigen(EigenError),
    /// A least-squares problem failed.
    #[error("a small system could not be solved: {0}")]
    System(#[from] DefiniteError),
    /// A sparse matrix was not factored.
    #[error(transparent)]
    Factor(FactorError),
    /// The operator cannot be made.
    #[error(transparent)]
    Operator(OperatorError),
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The basis cannot be evaluated.
    #[error(transparent)]
    Basis(#[from] BasisError),
}

/// How many there may be, in words. Some names are numbers already, the others are of things that are counted.
fn counted(what: &str, found: usize, least: usize, most: usize) -> String {
    let number = if matches!(what, "bits" | "count" | "start" | "step") { "" } else { "the number of " };
    format!("{number}{what} must be {}, got {found}", allowed(least, most))
}

/// The numbers from `least` to `most` in words, as after *must be*: *at least 2*, *7*, *between 1 and 3*. A bound of
/// `usize::MAX` is none worth telling.
pub fn allowed(least: usize, most: usize) -> String {
    match most {
        usize::MAX => format!("at least {least}"),
        most if most == least => least.to_string(),
        most => format!("between {least} and {most}"),
    }
}

stopped!(
    AnalysisError:
    EigenError => Self::Eigen,
    FactorError => Self::Factor,
    OperatorError => Self::Operator,
);

impl AnalysisError {
    /// Names what kind of vertex it is that a basis does not have.
    pub(super) fn vertices(what: &'static str) -> impl Fn(BasisError) -> Self {
        move |error| match error {
            BasisError::Vertex { place, vertex, vertices } => Self::Vertex { what, place, vertex, vertices },
            other => Self::Basis(other),
        }
    }
}

/// Checks that a parameter is finite and above zero.
pub(super) fn positive(parameter: &'static str, value: f64) -> Result<(), AnalysisError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(AnalysisError::Parameter { parameter, value, expected: "a finite positive number" })
}

/// Refuses a basis that does not begin with the lowest pair: sums over the spectrum are dominated by what it lacks.
pub(super) fn lowest(basis: &Basis) -> Result<(), AnalysisError> {
    match basis.certificate.first {
        0 => Ok(()),
        first => Err(AnalysisError::NotLowest { first }),
    }
}

/// Checks a number of things.
pub(super) fn count(what: &'static str, found: usize, least: usize, most: usize) -> Result<(), AnalysisError> {
    if (least..=most).contains(&found) {
        return Ok(());
    }
    Err(AnalysisError::Count { what, found, least, most })
}
