//! Why an approximation, or what is proven about it, failed.

use chladni_algebra::{EigenError, GalerkinError, MultigridError};
use chladni_base::{Cancelled, stopped};

use super::heat::HeatError;
use super::radial::RadialError;

/// Why pairs were not certified.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CertificateError {
    /// Sizes do not fit each other.
    #[error(
        "{values} Ritz values, coefficients of {rows}×{columns}, a space of {vertices}×{dimension} and a problem of size {size} do \
         not fit"
    )]
    Shape {
        /// Ritz values.
        values: usize,
        /// Rows of the coefficients.
        rows: usize,
        /// Columns of the coefficients.
        columns: usize,
        /// Rows of the space.
        vertices: usize,
        /// Columns of the space.
        dimension: usize,
        /// Size of the problem.
        size: usize,
    },
    /// The hierarchy that residuals are measured with could not be made.
    #[error("the residuals could not be measured: {0}")]
    Hierarchy(String),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(CertificateError: MultigridError => |error: MultigridError| Self::Hierarchy(error.to_string()));

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
         much in size or shape for this operator in a space of smooth functions: take the method hsim, or the robust operator"
    )]
    Rounding {
        /// The lowest value, in 1/length² of the input.
        value: f64,
        /// No eigenvalue lies below this.
        least: f64,
    },
    /// More pairs than unknowns were asked for.
    #[error("{count} eigenpairs are asked for, but there are {unknowns} unknowns")]
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
