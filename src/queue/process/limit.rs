//! The memory of this process: how much it has allocated, and a limit on it.

/// Bytes of private memory that may be written: what `RLIMIT_DATA` counts. `None` where the system does not tell.
pub(super) fn allocated() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmData:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Lets the process allocate so many bytes beyond what it has, until [`lift`]. What goes beyond finds no memory and
/// aborts.
#[cfg(target_os = "linux")]
pub(super) fn allow(bytes: u64) {
    if let Some(now) = allocated() {
        set(Some(now.saturating_add(bytes)));
    }
}

/// Takes the limit away.
#[cfg(target_os = "linux")]
pub(super) fn lift() {
    set(None);
}

#[cfg(target_os = "linux")]
fn set(bytes: Option<u64>) {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let maximum = getrlimit(Resource::Data).maximum;
    let current = match (bytes, maximum) {
        (Some(bytes), Some(maximum)) => Some(bytes.min(maximum)),
        (bytes, maximum) => bytes.or(maximum),
    };
    if let Err(error) = setrlimit(Resource::Data, Rlimit { current, maximum }) {
        tracing::warn!(%error, "could not limit the memory of the worker");
    }
}

#[cfg(not(target_os = "linux"))]
pub(super) fn allow(_bytes: u64) {}

#[cfg(not(target_os = "linux"))]
pub(super) fn lift() {}

/// Asks the kernel to end this process before others where memory runs out.
pub(super) fn go_first() {
    if let Err(error) = std::fs::write("/proc/self/oom_score_adj", "500") {
        tracing::debug!(%error, "could not set the OOM score of the worker");
    }
}
