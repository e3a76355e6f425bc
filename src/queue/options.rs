//! What a worker pool is told when it starts.

use std::time::Duration;

/// How the worker pool runs.
#[derive(Debug, Clone)]
pub struct WorkerOptions {
    /// Jobs that run at the same time. With 0 none is claimed; leases that ran out are looked after all the same.
    pub workers: usize,
    /// Threads of all jobs together; 0 takes one for each core. Each worker gets its share, and one at least.
    pub threads: usize,
    /// How long a lease lasts without a heartbeat.
    pub lease: Duration,
    /// The least time between two records of a job's progress.
    pub heartbeat: Duration,
    /// How long a job may go without a checkpoint before it counts as stalled.
    pub stall: Duration,
    /// The kinds of job that are claimed; all where it is empty.
    pub kinds: Vec<String>,
    /// Bytes of memory that running jobs may need together, by their estimates. A job that does not fit beside those
    /// that run waits, and so do those behind it.
    pub memory: u64,
    /// Whether the runner does each job in a process of its own.
    pub isolated: bool,
}

impl Default for WorkerOptions {
    fn default() -> Self {
        Self {
            workers: 1,
            threads: 0,
            lease: Duration::from_secs(30),
            heartbeat: Duration::from_millis(500),
            stall: Duration::from_secs(900),
            kinds: Vec::new(),
            memory: u64::MAX,
            isolated: false,
        }
    }
}
