//! What the JSON bodies of frames say.

use std::num::NonZeroUsize;

use serde::{Deserialize, Serialize};

use crate::{
    queue::{JobFailure, MEMORY_EXCEEDED},
    store::JobRecord,
};

/// A job to be run.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Order {
    /// Grows with every order to a worker.
    pub number: u64,
    pub job: JobRecord,
    /// Threads of the job.
    pub threads: usize,
    /// Bytes that the work may allocate; no limit without one.
    pub memory: Option<u64>,
}

/// Why an order came to nothing.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Failure {
    /// None for work that was cancelled.
    pub reason: Option<Reason>,
    pub taken: Taken,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Reason {
    pub kind: String,
    pub detail: String,
    pub retryable: bool,
    /// The bytes of memory that would do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub needed: Option<u64>,
}

/// What follows in frames of content.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Delivery {
    /// So many bytes of an NPZ file.
    Whole { kind: String, bytes: u64 },
    /// A compact basis: so many bytes of all but its space, then the places of `rows` rows and one more as eight bytes
    /// each, the columns of its entries and their values.
    Compact { head: u64, rows: usize, columns: usize, entries: usize },
    /// No content: the job is to be divided into so many parts, each of which takes so many bytes of memory.
    Parts { parts: NonZeroUsize, memory_bytes: u64 },
    /// A dense basis: so many bytes of all but its columns, then these, in `precision`.
    Columns { head: u64, rows: usize, columns: usize, precision: String },
}

/// What an order took of the worker.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Taken {
    /// Dense problems that fell back from the graphics card to the CPU.
    pub gpu_fallbacks: u64,
    /// Whether the worker holds more memory than it began with, and had better be replaced.
    pub swollen: bool,
}

impl Failure {
    pub fn new(failure: JobFailure, taken: Taken) -> Self {
        let reason = match failure {
            JobFailure::Cancelled(_) => None,
            JobFailure::Failed { kind, detail, retryable } => Some(Reason { kind, detail, retryable, needed: None }),
            JobFailure::NeedsMore { bytes, detail } => {
                Some(Reason { kind: MEMORY_EXCEEDED.to_owned(), detail, retryable: false, needed: Some(bytes) })
            }
            // A worker does not hear of its own death.
            JobFailure::Died { how } => {
                Some(Reason { kind: "worker-lost".to_owned(), detail: how, retryable: true, needed: None })
            }
        };
        Self { reason, taken }
    }
}

impl From<Reason> for JobFailure {
    fn from(Reason { kind, detail, retryable, needed }: Reason) -> Self {
        match needed {
            Some(bytes) => Self::NeedsMore { bytes, detail },
            None => Self::Failed { kind, detail, retryable },
        }
    }
}
