//! Leases, heartbeats, retries and the worker pool.

mod runner;
mod solver;
mod stub;

pub use crate::store::fault;
pub use runner::{JobFailure, Outcome, QueueObserver, Runner, Unobserved};
pub use solver::Solver;
pub use stub::{WorkerOptions, WorkerPool};
