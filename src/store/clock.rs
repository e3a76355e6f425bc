//! The time, as a setting: tests turn the hands themselves, and processes that share a database go by its clock.

use std::{
    fmt,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicI64, Ordering},
    },
    time::{Instant, SystemTime, UNIX_EPOCH},
};

/// Gives milliseconds since 1970.
#[derive(Clone, Default)]
pub struct Clock(Hands);

#[derive(Clone, Default)]
enum Hands {
    #[default]
    System,
    Manual(Arc<AtomicI64>),
    /// What is added to the milliseconds since the process first asked, which no setting of the machine's clock
    /// changes.
    Shared(Arc<AtomicI64>),
}

impl Clock {
    /// The clock of the system.
    pub fn system() -> Self {
        Self::default()
    }

    /// A clock that stands still until the holder of `hands` moves it.
    pub fn manual(hands: Arc<AtomicI64>) -> Self {
        Self(Hands::Manual(hands))
    }

    /// A clock that goes by another one, which it is set by now and then. A manual one stays what it is.
    #[cfg(feature = "cluster")]
    pub(super) fn shared(self) -> Self {
        match self.0 {
            Hands::System => Self(Hands::Shared(Arc::new(AtomicI64::new(system_ms() - running_ms())))),
            hands => Self(hands),
        }
    }

    /// Sets a shared clock.
    #[cfg(feature = "cluster")]
    pub(super) fn set_shared(&self, now_ms: i64) {
        if let Hands::Shared(added) = &self.0 {
            added.store(now_ms - running_ms(), Ordering::Relaxed);
        }
    }

    /// Milliseconds since 1970.
    pub fn now_ms(&self) -> i64 {
        match &self.0 {
            Hands::System => system_ms(),
            Hands::Manual(hands) => hands.load(Ordering::Relaxed),
            Hands::Shared(added) => added.load(Ordering::Relaxed) + running_ms(),
        }
    }
}

fn system_ms() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |elapsed| i64::try_from(elapsed.as_millis()).unwrap_or(i64::MAX))
}

/// Milliseconds since this was first called.
fn running_ms() -> i64 {
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    i64::try_from(BEGUN.get_or_init(Instant::now).elapsed().as_millis()).unwrap_or(i64::MAX)
}

impl fmt::Debug for Clock {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self.0 {
            Hands::System => "Clock(system)",
            Hands::Manual(_) => "Clock(manual)",
            Hands::Shared(_) => "Clock(shared)",
        })
    }
}
