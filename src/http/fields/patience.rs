//! A limit on the time that work takes within a request.

use std::time::{Duration, Instant};

use chladni_base::{Cancelled, Monitor};

/// Ends work after a while, or when nobody waits for it.
pub struct Patience<'a> {
    begin: Instant,
    limit: Duration,
    inner: &'a dyn Monitor,
}

impl<'a> Patience<'a> {
    /// Patience of so long from `begin`.
    pub fn new(begin: Instant, limit: Duration, inner: &'a dyn Monitor) -> Self {
        Self { begin, limit, inner }
    }
}

impl Monitor for Patience<'_> {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.begin.elapsed() < self.limit { self.inner.checkpoint() } else { Err(Cancelled) }
    }
}
