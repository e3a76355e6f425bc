//! How long work may go on, and on how much memory.

use std::sync::atomic::{AtomicU32, Ordering};

use chladni_base::{Cancelled, Monitor};

/// Cancels after so many checkpoints, so that every input ends soon, and holds the job to its promise.
pub struct Patience {
    left: AtomicU32,
    promised: u64,
}

impl Patience {
    /// For so many checkpoints, and so many bytes.
    pub fn new(checkpoints: u32, promised: u64) -> Self {
        Self { left: AtomicU32::new(checkpoints), promised }
    }
}

impl Monitor for Patience {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, fraction: f64) {
        assert!(!fraction.is_nan());
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        let left = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        left.map(|_| ()).map_err(|_| Cancelled)
    }
    fn promised_bytes(&self) -> Option<u64> {
        Some(self.promised)
    }
}
