//! Leases, heartbeats, retries and the worker pool.
//!
//! A worker is a tokio task with a rayon pool of its own. It claims a job, runs it on that pool, and meanwhile another
//! task beats for it: it prolongs the lease, writes down the progress, and learns that the job was cancelled, that the
//! lease was lost, or that the work has stalled. The promise: an attempt at least once, a result exactly once.
//!
//! Whether the work is done on that pool or in a process of its own ([`process`]) is the runner's affair: claims,
//! leases and memory are those of the server either way.

mod attempt;
mod divided;
mod memory;
mod monitor;
mod options;
mod pool;
pub mod process;
mod runner;
mod shared;
mod solver;
#[cfg(test)]
mod tests;

pub use crate::store::fault;
pub use options::WorkerOptions;
pub use pool::WorkerPool;
pub use runner::{JobFailure, Outcome, QueueObserver, Runner, Unobserved, Watch};
pub use solver::Solver;

use runner::MEMORY_EXCEEDED;
