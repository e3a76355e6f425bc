//! Why a command failed, in one sentence, and the exit code that says so to a script.

use chladni_work::{JobError, ParameterError};

use crate::{config::ConfigError, telemetry::TelemetryError};
use std::{io, path::Path, path::PathBuf, process::ExitCode};

/// A command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// A file or a stream cannot be read or written.
    #[error("cannot {action} {target}: {source}")]
    Io {
        /// What was tried: `read`, `write`, …
        action: &'static str,
        /// The file or the stream.
        target: String,
        /// Why it failed.
        source: io::Error,
    },
    /// A mesh file cannot be used.
    #[error("{}: {reason}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Why, in a sentence that names the offending element.
        reason: String,
    },
    /// The arguments parse, but do not make sense.
    #[error("{0}")]
    Usage(String),
    /// Parameters of a job were refused.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The work failed.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A setting cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Logs or metrics cannot be set up.
    #[error(transparent)]
    Telemetry(#[from] TelemetryError),
    /// The server refused a request, or its job failed.
    #[error("{0}")]
    Refused(String),
    /// The server cannot start, or stopped with an error.
    #[error("{0}")]
    Service(String),
}

impl CliError {
    /// The file cannot be read or written.
    pub fn file(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { action, target: path.display().to_string(), source }
    }

    /// Standard output cannot be written.
    pub fn stdout(source: io::Error) -> Self {
        Self::Io { action: "write", target: "standard output".into(), source }
    }

    /// The mesh cannot be used for the given reason.
    pub fn mesh(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self::Mesh { path: path.to_owned(), reason: reason.to_string() }
    }

    /// What the process answers: 1 the mesh or the work failed; 2 wrong usage; 3 a file, the network or the storage
    /// failed.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Job(error) if error.kind() == "invalid-parameters" => 2,
            Self::Mesh { .. } | Self::Job(_) | Self::Refused(_) => 1,
            Self::Usage(_) | Self::Parameters(_) | Self::Config(_) | Self::Telemetry(_) => 2,
            Self::Io { .. } | Self::Service(_) => 3,
        })
    }

    /// Whether the reader of our output went away.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Io { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
    }
}
