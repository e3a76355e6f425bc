//! Signatures first; bodies follow.
#![allow(unused_variables)]

use std::{sync::Arc, time::Duration};

use super::{QueueObserver, Runner};
use crate::store::Store;

/// How the worker pool runs.
#[derive(Debug, Clone)]
pub struct WorkerOptions {
    /// Jobs that run at the same time, at least 1.
    pub workers: usize,
    /// Threads of all jobs together; 0 takes one for each core.
    pub threads: usize,
    /// How long a lease lasts without a heartbeat.
    pub lease: Duration,
    /// How long a job may go without a checkpoint before it counts as stalled.
    pub stall: Duration,
    /// The kinds of job that are claimed; all where it is empty.
    pub kinds: Vec<String>,
}

impl Default for WorkerOptions {
    fn default() -> Self {
        Self {
            workers: 1,
            threads: 0,
            lease: Duration::from_secs(30),
            stall: Duration::from_secs(900),
            kinds: Vec::new(),
        }
    }
}

/// The running worker pool.
#[derive(Debug)]
pub struct WorkerPool {}

impl WorkerPool {
    /// Starts the workers and the reaper on the current tokio runtime.
    pub fn start(
        store: Store,
        options: WorkerOptions,
        runner: Arc<dyn Runner>,
        observer: Arc<dyn QueueObserver>,
    ) -> Self {
        Self {}
    }
    /// Whether every worker can still take jobs.
    pub fn alive(&self) -> bool {
        true
    }
    /// Claims nothing more, lets running jobs go on for `limit`, then gives what still runs back to the queue.
    pub async fn drain(&self, limit: Duration) {}
}
