//! Whether a database that is shared has no room. That it had none is met by whoever writes much; what a look at its
//! health writes fits into what it has.

use std::sync::atomic::{AtomicBool, Ordering};

/// What PostgreSQL says when its disk is full.
const DISK_FULL: &str = "53100";

/// Whether a write met a full disk, and none of some size has gone well since.
#[derive(Debug, Default)]
pub(super) struct Fullness(AtomicBool);

impl Fullness {
    /// Notes what a statement said.
    pub fn note(&self, error: &sqlx::Error) {
        if let sqlx::Error::Database(said) = error
            && said.code().as_deref() == Some(DISK_FULL)
        {
            self.0.store(true, Ordering::Relaxed);
        }
    }

    pub fn is_full(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// There is room again.
    pub fn clear(&self) {
        self.0.store(false, Ordering::Relaxed);
    }
}
