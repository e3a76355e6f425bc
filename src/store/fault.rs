//! Named points at which a test makes the process die, stop or fail. Nothing happens unless a test arms a point.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU32, Ordering},
};

/// A named point in the life of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FailPoint {
    /// A job was enqueued and committed; the caller does not know yet.
    AfterEnqueue,
    /// A worker holds a lease and has done nothing.
    AfterClaim,
    /// The job's solver runs: met at every checkpoint.
    MidRun,
    /// The basis is computed; none of its content is written.
    BeforeChunks,
    /// Some chunks of the content are committed, not all.
    MidChunks,
    /// Every chunk is committed and verified; the blob is still pending.
    BeforeBlobReady,
    /// The blob is ready; nothing refers to it.
    AfterBlobReady,
    /// The transaction that makes the basis visible is written, not committed.
    BeforeComplete,
    /// The basis is visible and the job succeeded.
    AfterComplete,
    /// The transaction that divides a job into parts is written, not committed.
    BeforeDivide,
    /// The job waits for its parts; nobody has heard of them.
    AfterDivide,
}

impl FailPoint {
    /// Every point that any job meets.
    pub const ALL: [Self; 9] = [
        Self::AfterEnqueue,
        Self::AfterClaim,
        Self::MidRun,
        Self::BeforeChunks,
        Self::MidChunks,
        Self::BeforeBlobReady,
        Self::AfterBlobReady,
        Self::BeforeComplete,
        Self::AfterComplete,
    ];
    /// Those that jobs meet which are divided.
    pub const OF_DIVISION: [Self; 2] = [Self::BeforeDivide, Self::AfterDivide];

    /// The name that a specification uses.
    pub fn name(self) -> &'static str {
        match self {
            Self::AfterEnqueue => "after-enqueue",
            Self::AfterClaim => "after-claim",
            Self::MidRun => "mid-run",
            Self::BeforeChunks => "before-chunks",
            Self::MidChunks => "mid-chunks",
            Self::BeforeBlobReady => "before-blob-ready",
            Self::AfterBlobReady => "after-blob-ready",
            Self::BeforeComplete => "before-complete",
            Self::AfterComplete => "after-complete",
            Self::BeforeDivide => "before-divide",
            Self::AfterDivide => "after-divide",
        }
    }
}

/// What happens at an armed point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultAction {
    /// The process kills itself with SIGKILL: nothing is flushed, no destructor runs.
    Kill,
    /// The process aborts, as it does where it crashes by itself: the fault is marked.
    Abort,
    /// The thread panics.
    Panic,
    /// The thread sleeps for an hour: a worker that hangs.
    Stall,
}

/// A specification of a fault that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not POINT:ACTION[:TIMES_PASSED]")]
pub struct InvalidFault(pub String);

#[derive(Debug)]
struct Armed {
    point: FailPoint,
    action: FaultAction,
    /// How many more times the point is passed unharmed.
    passes: AtomicU32,
    /// Whether only one meeting does harm.
    once: bool,
    met: AtomicBool,
}

/// The faults of one store: none by default.
#[derive(Debug, Clone, Default)]
pub struct Faults(Option<Arc<Armed>>);

impl Faults {
    /// A fault at every meeting with a point but the first so many.
    pub fn armed(point: FailPoint, action: FaultAction, passes: u32) -> Self {
        Self::new(point, action, passes, false)
    }

    /// A fault at one meeting with a point, after the first so many.
    pub fn armed_once(point: FailPoint, action: FaultAction, passes: u32) -> Self {
        Self::new(point, action, passes, true)
    }

    fn new(point: FailPoint, action: FaultAction, passes: u32, once: bool) -> Self {
        let (passes, met) = (AtomicU32::new(passes), AtomicBool::new(false));
        Self(Some(Arc::new(Armed { point, action, passes, once, met })))
    }

    /// Reads `POINT:ACTION[:PASSES]`, such as `before-blob-ready:kill` or `mid-run:panic:100`.
    ///
    /// # Errors
    /// [`InvalidFault`] where a word is not known.
    pub fn parse(specification: &str) -> Result<Self, InvalidFault> {
        let invalid = || InvalidFault(specification.to_owned());
        let mut words = specification.split(':');
        let point = words.next().unwrap_or_default();
        let point =
            FailPoint::ALL.into_iter().chain(FailPoint::OF_DIVISION).find(|p| p.name() == point).ok_or_else(invalid)?;
        let action = match words.next() {
            Some("kill") => FaultAction::Kill,
            Some("abort") => FaultAction::Abort,
            Some("panic") => FaultAction::Panic,
            Some("stall") => FaultAction::Stall,
            _ => return Err(invalid()),
        };
        let passes = words.next().map_or(Ok(0), |word| word.parse().map_err(|_| invalid()))?;
        if words.next().is_some() {
            return Err(invalid());
        }
        Ok(Self::armed(point, action, passes))
    }

    /// Reaches a point. Does nothing unless it is armed.
    pub fn reach(&self, point: FailPoint) {
        let Some(armed) = &self.0 else { return };
        if armed.point != point {
            return;
        }
        let left = armed.passes.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        if left.is_err() && !(armed.met.swap(true, Ordering::Relaxed) && armed.once) {
            armed.action.happen(point);
        }
    }
}

impl FaultAction {
    // The one place outside tests that may panic: it was armed to.
    #[allow(clippy::panic)]
    fn happen(self, point: FailPoint) {
        match self {
            Self::Kill => {
                #[cfg(unix)]
                let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
                std::process::abort();
            }
            Self::Abort => std::process::abort(),
            Self::Panic => panic!("fault injected at {}", point.name()),
            Self::Stall => std::thread::sleep(std::time::Duration::from_secs(3600)),
        }
    }
}
