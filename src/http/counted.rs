//! Counters of the metrics that follow totals which others keep.

use std::sync::atomic::{AtomicU64, Ordering};

/// What counters were already raised to.
#[derive(Debug, Default)]
pub struct Counted {
    pub hits: AtomicU64,
    pub misses: AtomicU64,
    pub gpu_fallbacks: AtomicU64,
}

/// Raises a counter to a total that someone else keeps; two scrapes at once raise it once.
pub fn catch_up(counted: &AtomicU64, total: u64, raise: impl Fn(u64)) {
    let before = counted.fetch_max(total, Ordering::Relaxed);
    if total > before {
        raise(total - before);
    }
}
