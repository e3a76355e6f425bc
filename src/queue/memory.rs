//! The memory that running jobs may take together, by estimate: what does not fit waits, so that nothing is killed for
//! want of it.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    time::Instant,
};

use super::{QueueObserver, WorkerOptions};
use crate::store::{Claim, Company, Store, StoreError};

/// The memory of running jobs.
pub(super) struct Budget {
    total: u64,
    taken: Mutex<u64>,
    /// Jobs that hold memory.
    running: AtomicUsize,
    /// Whether the one that was claimed last is to run alone.
    alone: AtomicBool,
    /// Held while a job is chosen: two workers must not both see the same memory free.
    turn: tokio::sync::Mutex<()>,
    store: Store,
    observer: Arc<dyn QueueObserver>,
}

impl Budget {
    pub fn new(total: u64, store: Store, observer: Arc<dyn QueueObserver>) -> Self {
        observer.memory(0, total);
        Self {
            total,
            taken: Mutex::new(0),
            running: AtomicUsize::new(0),
            alone: AtomicBool::new(false),
            turn: tokio::sync::Mutex::new(()),
            store,
            observer,
        }
    }

    /// Takes or gives back memory.
    fn change(&self, change: impl FnOnce(u64) -> u64) {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        *taken = change(*taken);
        self.observer.memory(*taken, self.total);
    }

    /// The memory that there is for jobs.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Claims the next job if there is memory for it. A job that would never fit is claimed once nothing runs, so that
    /// it can be told.
    pub async fn claim(
        self: &Arc<Self>,
        worker: &str,
        options: &WorkerOptions,
    ) -> Result<Option<(Claim, Reservation)>, StoreError> {
        let _turn = self.turn.lock().await;
        let running = self.running.load(Ordering::Relaxed);
        if running > 0 && self.alone.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let taken = *self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        let free = if taken == 0 { u64::MAX } else { self.total.saturating_sub(taken) };
        let company = Company {
            others: running > 0,
            isolated: options.isolated,
            total_bytes: self.total,
            solver_version: Some(chladni_work::SOLVER_VERSION),
        };
        let begun = Instant::now();
        let claim = self.store.claim_within(worker, &options.kinds, options.lease, free, company).await?;
        Ok(claim.map(|claim| {
            self.observer.claim_took(begun.elapsed().as_secs_f64());
            // One that is to run alone has all the memory that there is.
            let bytes = if claim.alone { self.total } else { claim.job.memory_bytes.min(self.total) };
            self.change(|taken| taken + bytes);
            self.running.fetch_add(1, Ordering::Relaxed);
            self.alone.store(claim.alone, Ordering::Relaxed);
            (claim, Reservation { budget: Arc::clone(self), bytes })
        }))
    }
}

/// Memory that a job holds until this is dropped.
pub(super) struct Reservation {
    budget: Arc<Budget>,
    bytes: u64,
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.budget.change(|taken| taken.saturating_sub(self.bytes));
        self.budget.running.fetch_sub(1, Ordering::Relaxed);
        // Whoever waits for the memory looks again.
        self.budget.store.work().notify_one();
    }
}
