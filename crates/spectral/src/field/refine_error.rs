//! Why designs among all fields of a surface fail.

use chladni_base::{Cancelled, stopped};

use super::design::DesignError;
use crate::operator::OperatorError;

/// Tolerances of [`FullSpace::refine`](super::FullSpace::refine): those below are lost to rounding.
pub(super) const LEAST_TOLERANCE: f64 = 1e-10;

/// Why a design was not refined.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// The surface has no such operator.
    #[error(transparent)]
    Operator(OperatorError),
    /// The design itself does not fit.
    #[error(transparent)]
    Design(DesignError),
    /// The tolerance is out of range.
    #[error("the tolerance is {tolerance}; it must be from {LEAST_TOLERANCE:e} to below 1")]
    Tolerance {
        /// What was given.
        tolerance: f64,
    },
    /// Designs that stay close to prescribed singularities are not the minimisers of one energy.
    #[error("a design with prescribed singularities has no field of the whole surface that it stands for")]
    Prescribed,
    /// The iteration ended before its goal.
    #[error("the field of the whole surface was not found to a tolerance of {tolerance:e}")]
    NotConverged {
        /// The goal.
        tolerance: f64,
    },
    /// One energy outweighs another by more than single precision has room for.
    #[error(
        "the weights of the energies and of the alignment are too far apart to refine a design: their ratio is beyond {most:e}"
    )]
    Weights {
        /// The largest ratio.
        most: f64,
    },
    /// The reduced space does not have all fields without energy.
    #[error(
        "the space of this basis lacks fields without energy that the surface has: designs in it cannot be compared with the whole surface"
    )]
    Incomplete,
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(RefineError: OperatorError => Self::Operator, DesignError => Self::Design);
