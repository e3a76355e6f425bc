//! What the workers and their attempts share.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use tokio::sync::watch;

use super::{QueueObserver, Runner, memory::Budget, options::WorkerOptions};
use crate::store::{JobProblem, Store, Worker};

/// A process whom the storage refuses asks this often whether it is let in, and takes no jobs until then.
const REFUSED_PAUSE: Duration = Duration::from_secs(5);

/// What workers and attempts share.
pub(super) struct Shared {
    pub store: Store,
    pub options: WorkerOptions,
    pub runner: Arc<dyn Runner>,
    pub observer: Arc<dyn QueueObserver>,
    /// Attempts whose work runs, whether or not anyone waits for it.
    pub left_behind: Arc<AtomicUsize>,
    pub budget: Arc<Budget>,
    /// True from when running jobs go back to the queue.
    pub give_back: watch::Sender<bool>,
    /// Since when the storage has refused this process, where it did.
    pub refused: Mutex<Option<Instant>>,
    /// What this process has for jobs, under a name that no other has.
    pub own: Worker,
    pub stopping: watch::Sender<bool>,
}

impl Shared {
    /// Remembers that the storage refused this process.
    pub fn note_refusal(&self) {
        *self.refused.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// Whether the storage lets this process in, as far as is known: after a refusal it is asked, now and then.
    pub async fn is_let_in(&self) -> bool {
        let refused = *self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(since) = refused else { return true };
        if since.elapsed() < REFUSED_PAUSE {
            return false;
        }
        if let Err(error) = self.store.reach_content().await {
            tracing::error!(%error, "the content store refuses access; this process takes no jobs");
            self.note_refusal();
            return false;
        }
        *self.refused.lock().unwrap_or_else(PoisonError::into_inner) = None;
        true
    }

    pub fn stopping(&self) -> bool {
        *self.stopping.borrow()
    }

    /// Work that runs beyond the one of each worker.
    pub fn hanging(&self) -> usize {
        self.left_behind.load(Ordering::Relaxed).saturating_sub(self.options.workers.max(1))
    }
}

/// How an attempt without a result ends.
#[derive(Debug)]
pub(super) enum Ending {
    Failed(JobProblem, bool),
    Died(String),
    Canceled,
    Released,
    /// Given back, to whoever has so many bytes of memory for it.
    Enlarged(u64),
}

/// Waits until a flag is raised.
pub(super) async fn signalled(flag: &mut watch::Receiver<bool>) {
    // An error means that whoever might raise it is gone: that counts too.
    let _ = flag.wait_for(|&raised| raised).await;
}
