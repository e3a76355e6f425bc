//! A job that somebody waits for. Where the records are shared, it is looked at often for as long: docs/decisions/0103.

use std::sync::{Arc, Weak};

use tokio::sync::broadcast::{Receiver, error::RecvError};
use uuid::Uuid;

use super::{Inner, JobEvent, Store};

/// Hears of the changes of one job, from the moment it was made.
pub struct JobWatch {
    job: Uuid,
    changes: Receiver<JobEvent>,
    #[cfg_attr(not(feature = "cluster"), expect(dead_code, reason = "nobody else changes the records"))]
    store: Weak<Inner>,
}

impl Store {
    /// Watches a job, whether or not there is one.
    pub fn watch_job(&self, job: Uuid) -> JobWatch {
        #[cfg(feature = "cluster")]
        if let Some(hearing) = self.inner.hearing.get() {
            hearing.watch(job);
        }
        JobWatch { job, changes: self.watch_jobs(), store: Arc::downgrade(&self.inner) }
    }
}

impl JobWatch {
    /// Waits until the job may have changed; false when nothing will be heard of any more.
    pub async fn changed(&mut self) -> bool {
        loop {
            match self.changes.recv().await {
                Ok(event) if event.job == self.job => return true,
                Ok(_) => {}
                Err(RecvError::Lagged(_)) => return true,
                Err(RecvError::Closed) => return false,
            }
        }
    }
}

impl Drop for JobWatch {
    fn drop(&mut self) {
        #[cfg(feature = "cluster")]
        if let Some(inner) = self.store.upgrade()
            && let Some(hearing) = inner.hearing.get()
        {
            hearing.unwatch(self.job);
        }
    }
}
