//! Failures of the libraries as the exceptions of `chladni._errors`.

use chladni_mesh::check::MeshError;
use chladni_mesh::numbering::NumberingError;
use chladni_mesh::read::ReadError;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::filter::FilterError;
use chladni_spectral::basis::{BasisError, ProvenanceError};
use chladni_spectral::formats::FormatError;
use chladni_spectral::operator::OperatorError;
use chladni_work::basis_comparison::BasisComparisonFault;
use chladni_work::distances::DistanceFault;
use chladni_work::value_gradient::GradientFault;
use chladni_work::{JobError, ParameterError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// The exceptions of `chladni._errors`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A mesh that cannot be used.
    Mesh,
    /// An argument out of its range, of another shape or another type.
    Parameter,
    /// Work that ended without a result.
    Solve,
    /// Pairs that could not be proven complete, or did not converge.
    Unproven,
    /// A file that is not what it must be.
    Format,
    /// Work that was asked to stop.
    Cancelled,
}

impl Kind {
    fn class(self) -> &'static str {
        match self {
            Self::Mesh => "MeshError",
            Self::Parameter => "ParameterError",
            Self::Solve => "SolveError",
            Self::Unproven => "UnprovenError",
            Self::Format => "FormatError",
            Self::Cancelled => "Cancelled",
        }
    }
}

/// Why a call ended without a result.
#[derive(Debug)]
pub enum Failure {
    /// What the library said.
    Told {
        /// Which exception it becomes.
        kind: Kind,
        /// A stable identifier, in kebab case.
        code: String,
        /// A sentence that names the offending element.
        message: String,
    },
    /// What Python said: a signal, or an exception of a callback.
    Python(PyErr),
}

impl Failure {
    /// A failure that the library told.
    pub fn new(kind: Kind, code: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Told { kind, code: code.into(), message: message.into() }
    }

    /// An argument that does not fit.
    pub fn parameter(message: impl Into<String>) -> Self {
        Self::new(Kind::Parameter, "invalid-parameters", message)
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Python(error) => error,
            Failure::Told { kind, code, message } => {
                Python::attach(|py| exception(py, kind, &code, &message).unwrap_or_else(|error| error))
            }
        }
    }
}

fn exception(py: Python<'_>, kind: Kind, code: &str, message: &str) -> PyResult<PyErr> {
    static MODULE: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let module = MODULE.get_or_try_init(py, || py.import("chladni._errors").map(Bound::unbind))?;
    let raised = module.bind(py).getattr(kind.class())?.call1((message,))?;
    raised.setattr("code", code)?;
    Ok(PyErr::from_value(raised))
}

impl From<JobError> for Failure {
    fn from(error: JobError) -> Self {
        let kind = match error.kind() {
            "cancelled" => Kind::Cancelled,
            "invalid-parameters" | "no-field-surface" => Kind::Parameter,
            "not-converged" | "incomplete" | "unproven" | "tolerance-below-rounding" => Kind::Unproven,
            _ => Kind::Solve,
        };
        Self::new(kind, error.kind(), error.to_string())
    }
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::parameter(error.to_string())
    }
}

impl From<MeshError> for Failure {
    fn from(error: MeshError) -> Self {
        Self::new(Kind::Mesh, error.kind(), error.to_string())
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::new(Kind::Format, error.kind(), error.to_string())
    }
}

impl From<FormatError> for Failure {
    fn from(error: FormatError) -> Self {
        Self::new(Kind::Format, "not-a-basis", error.to_string())
    }
}

impl From<OperatorError> for Failure {
    fn from(error: OperatorError) -> Self {
        let kind = match error {
            OperatorError::Cancelled(_) => Kind::Cancelled,
            OperatorError::Parameter { .. } => Kind::Parameter,
            _ => Kind::Mesh,
        };
        Self::new(kind, error.kind(), error.to_string())
    }
}

impl From<NumberingError> for Failure {
    fn from(error: NumberingError) -> Self {
        Self::new(Kind::Parameter, "invalid-vertex", error.to_string())
    }
}

impl From<ProvenanceError> for Failure {
    fn from(error: ProvenanceError) -> Self {
        Self::parameter(error.to_string())
    }
}

impl From<GradientFault> for Failure {
    fn from(fault: GradientFault) -> Self {
        match fault {
            GradientFault::Analysis(error) => error.into(),
            GradientFault::Provenance(error) => error.into(),
            GradientFault::Numbering(error) => error.into(),
            GradientFault::Parameters(error) => error.into(),
            GradientFault::Operator(error) => error.into(),
        }
    }
}

impl From<AnalysisError> for Failure {
    fn from(error: AnalysisError) -> Self {
        match error {
            AnalysisError::Cancelled(cancelled) => Self::new(Kind::Cancelled, "cancelled", cancelled.to_string()),
            other => Self::new(Kind::Parameter, "invalid-analysis", other.to_string()),
        }
    }
}

impl From<BasisComparisonFault> for Failure {
    fn from(fault: BasisComparisonFault) -> Self {
        match fault {
            BasisComparisonFault::Analysis(error) => error.into(),
            BasisComparisonFault::Vertices { .. } => {
                Self::new(Kind::Parameter, "incomparable-bases", fault.to_string())
            }
        }
    }
}

impl From<DistanceFault> for Failure {
    fn from(error: DistanceFault) -> Self {
        match error {
            DistanceFault::Analysis(error) => error.into(),
            other => Self::new(Kind::Parameter, "invalid-analysis", other.to_string()),
        }
    }
}

impl From<FilterError> for Failure {
    fn from(error: FilterError) -> Self {
        Self::new(Kind::Parameter, "invalid-filter", error.to_string())
    }
}

impl From<BasisError> for Failure {
    fn from(error: BasisError) -> Self {
        Self::new(Kind::Parameter, "invalid-function", error.to_string())
    }
}
