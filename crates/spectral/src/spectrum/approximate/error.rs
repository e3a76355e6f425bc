//! Why an approximation failed.

use super::super::certificate::CertificateError;
use super::super::heat::HeatError;
use super::super::radial::RadialError;
use chladni_algebra::{EigenError, GalerkinError};
use chladni_base::{Cancelled, stopped};

/// Why an approximation failed.
#[derive(Debug, thiserror::Error)]
pub enum ApproximationError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The radial columns could not be made.
    #[error(transparent)]
    Radial(RadialError),
    /// The columns could not be smoothed.
    #[error(transparent)]
    Heat(HeatError),
    /// The problem could not be restricted to the subspace.
    #[error(transparent)]
    Reduce(GalerkinError),
    /// The restricted eigenproblem could not be solved.
    #[error(transparent)]
    Eigen(EigenError),
    /// The pairs could not be certified.
    #[error(transparent)]
    Certificate(CertificateError),
    /// A parameter is out of its range.
    #[error("parameter {name}: {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// The refinement's factorisation failed.
    #[error("{0}")]
    Factor(String),
    /// What a factorisation needs was counted, and is more than was promised.
    #[error("{0}")]
    Memory(String),
    /// The pairs could not be enclosed.
    #[error("the pairs could not be certified: {reason}")]
    Unproven {
        /// Why.
        reason: String,
    },
    /// Rounding has decided the restricted problem.
    #[error(
        "rounding errors decide the restricted problem: a value of {value:.3e} came out, and none can lie below {least:.3e}; triangles differ too \
         much in size or shape for this operator in a space of smooth functions: use the method hsim, or the robust operator"
    )]
    Rounding {
        /// The lowest value, in 1/length² of the input.
        value: f64,
        /// No eigenvalue lies below this.
        least: f64,
    },
    /// More pairs than unknowns were asked for.
    #[error("{count} eigenpairs were requested, but there are {unknowns} unknowns")]
    Count {
        /// The pairs asked for.
        count: usize,
        /// The vertices that are not held at zero.
        unknowns: usize,
    },
}

stopped!(
    ApproximationError:
    RadialError => Self::Radial,
    HeatError => Self::Heat,
    GalerkinError => Self::Reduce,
    EigenError => Self::Eigen,
    CertificateError => Self::Certificate,
);

impl ApproximationError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Radial(_) | Self::Heat(_) => "subspace-failed",
            Self::Reduce(_) | Self::Rounding { .. } => "restriction-failed",
            Self::Eigen(_) => "eigenproblem-failed",
            Self::Certificate(_) => "certificate-failed",
            Self::Factor(_) => "factorisation-failed",
            Self::Memory(_) => "memory-exceeded",
            Self::Unproven { .. } => "unproven",
            Self::Parameter { .. } | Self::Count { .. } => "invalid-parameters",
        }
    }
}
