//! A limit on the work that is done within a request.

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use chladni_base::{Cancelled, Monitor};
use chladni_work::design::DesignFault;

use crate::http::problem::{self, Problem};

/// The limit of what is drawn, refined and corrected within a request.
pub const USUAL: Duration = Duration::from_secs(60);

/// Work goes on for so many times its limit by the clock, where other work has the processors.
const BUSY: u32 = 10;

/// Between two checkpoints no more than this counts. A thread that waits for its part of a parallel loop takes up what
/// others have to do; checkpoints of its own work are milliseconds apart.
const MOST_AT_ONCE: Duration = Duration::from_secs(2);

/// Ends work that takes too long, or that nobody waits for. What counts is the processor time of the thread that does
/// it, or that leads those who do: what is refused is the same on a busy machine as on an idle one. Waiting for others
/// is no work, and ends after [`BUSY`] times as long.
pub struct Patience<'a> {
    limit: Duration,
    leader: ThreadId,
    begin: Instant,
    /// The processor time of the leader in nanoseconds at its last checkpoint; 0 where the system does not tell.
    last: AtomicU64,
    /// How much of it counts.
    spent: AtomicU64,
    inner: &'a dyn Monitor,
}

impl<'a> Patience<'a> {
    /// Patience for work that begins now, on this thread.
    pub fn new(limit: Duration, inner: &'a dyn Monitor) -> Self {
        let last = AtomicU64::new(processor_nanoseconds().unwrap_or_default());
        let (leader, spent) = (thread::current().id(), AtomicU64::new(0));
        Self { limit, leader, begin: Instant::now(), last, spent, inner }
    }

    /// How much of the limit is used up.
    pub fn spent(&self) -> Duration {
        Duration::from_nanos(self.spent.load(Ordering::Relaxed))
    }

    /// Whether it has passed after a while by the clock, with the processor time of the leader where it is the leader
    /// who asks.
    fn has_passed(&self, waited: Duration, processor: impl FnOnce() -> Option<u64>) -> bool {
        if waited >= BUSY * self.limit {
            return true;
        }
        if thread::current().id() != self.leader {
            // What the leader has done is for the leader to say.
            return false;
        }
        let Some(now) = processor() else { return waited >= self.limit };
        let since = Duration::from_nanos(now.saturating_sub(self.last.swap(now, Ordering::Relaxed)));
        let counted = since.min(MOST_AT_ONCE).as_nanos() as u64;
        let spent = self.spent.fetch_add(counted, Ordering::Relaxed) + counted;
        Duration::from_nanos(spent) >= self.limit
    }
}

impl Monitor for Patience<'_> {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.has_passed(self.begin.elapsed(), processor_nanoseconds) {
            Err(Cancelled)
        } else {
            self.inner.checkpoint()
        }
    }
}

/// The problem of work that ended before it was done: `invalid-design` within a kind, with what was not done, and what
/// to ask for instead.
pub fn too_long(within: &'static str, limit: Duration, undone: &str, instead: &str) -> impl Fn(DesignFault) -> Problem {
    let detail = format!(
        "{undone} within the {} seconds of processor time that a request may take, or the machine was too busy to give it as much in {} minutes. {instead}",
        limit.as_secs(),
        (BUSY * limit).as_secs() / 60
    );
    move |fault| match fault {
        DesignFault::Cancelled(_) => Problem::within(&problem::INVALID_DESIGN, within, detail.as_str()),
        other => other.into(),
    }
}

/// The processor time of this thread; `None` where the system does not tell.
fn processor_nanoseconds() -> Option<u64> {
    #[cfg(any(target_os = "linux", target_vendor = "apple"))]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Duration::try_from(time).ok().map(|time| time.as_nanos() as u64)
    }
    #[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::Unwatched;

    struct Gone;

    impl Monitor for Gone {
        fn stage(&self, _name: &'static str) {}
        fn progress(&self, _fraction: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }

    #[test]
    fn work_ends_when_its_processor_time_has_passed_or_its_client_has_left() {
        let patience = Patience::new(Duration::from_millis(20), &Unwatched);
        while patience.checkpoint().is_ok() {}
        assert!(patience.begin.elapsed() >= Duration::from_millis(20));
        assert_eq!(Patience::new(Duration::from_secs(3600), &Gone).checkpoint(), Err(Cancelled));
    }

    #[test]
    fn what_others_have_the_processor_for_does_not_count() {
        let limit = Duration::from_secs(60);
        let patience = Patience { last: AtomicU64::new(0), ..Patience::new(limit, &Unwatched) };
        let second = 1_000_000_000;
        // Half of the time is this work's.
        for k in 1..60 {
            assert!(!patience.has_passed(Duration::from_secs(2 * k), || Some(k * second)), "{k}");
        }
        assert!(patience.has_passed(Duration::from_secs(120), || Some(60 * second)));
        assert!(patience.has_passed(BUSY * limit, || Some(60 * second)));
    }

    #[test]
    fn what_a_thread_does_for_others_between_two_checkpoints_hardly_counts() {
        let limit = Duration::from_secs(60);
        let patience = Patience { last: AtomicU64::new(0), ..Patience::new(limit, &Unwatched) };
        assert!(!patience.has_passed(Duration::from_secs(90), || Some(90_000_000_000)));
        assert_eq!(patience.spent.load(Ordering::Relaxed), MOST_AT_ONCE.as_nanos() as u64);
        // Whoever is not the leader has nothing to say about it.
        thread::scope(|scope| {
            let other = || patience.has_passed(Duration::from_secs(90), || unreachable!());
            assert!(!scope.spawn(other).join().unwrap());
        });
        // Where the system tells nothing, it is the clock.
        assert!(!patience.has_passed(Duration::from_secs(59), || None));
        assert!(patience.has_passed(limit, || None));
    }

    #[test]
    fn the_problem_says_what_to_do() {
        let problem = too_long("hatching", Duration::from_secs(60), "This was not drawn", "Ask for less.");
        let told = problem(DesignFault::Cancelled(Cancelled)).detail().to_owned();
        assert_eq!(
            told,
            "This was not drawn within the 60 seconds of processor time that a request may take, or the machine was too busy to give it as much in 10 minutes. Ask for less."
        );
    }
}
