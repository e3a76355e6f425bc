//! Leases, heartbeats, retries and the worker pool.

mod runner;
mod stub;

pub use crate::store::fault;
pub use runner::{JobFailure, Outcome, QueueObserver, Runner, Unobserved};
pub use stub::{WorkerOptions, WorkerPool};
