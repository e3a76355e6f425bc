//! The memory that this process may take, as the system tells it.

use std::fs::read_to_string;

/// Bytes that can be had without pushing anything else out: what the kernel calls available, and no more than the
/// control group leaves. `None` where the system does not tell.
pub fn available() -> Option<u64> {
    let machine = read_to_string("/proc/meminfo").ok().and_then(|text| field(&text, "MemAvailable:"));
    let group =
        group(read_to_string("/sys/fs/cgroup/memory.max").ok(), read_to_string("/sys/fs/cgroup/memory.current").ok());
    [machine, group].into_iter().flatten().min()
}

/// Bytes that this process has in memory. `None` where the system does not tell.
pub fn resident() -> Option<u64> {
    field(&read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// A field of a file such as `/proc/meminfo`, in bytes.
pub fn field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

/// What a control group leaves; one without a limit says `max`.
fn group(limit: Option<String>, taken: Option<String>) -> Option<u64> {
    let limit: u64 = limit?.trim().parse().ok()?;
    let taken: u64 = taken?.trim().parse().ok()?;
    Some(limit.saturating_sub(taken))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_s_words_are_understood() {
        let text = "MemTotal:       16000 kB\nMemAvailable:    2000 kB\n";
        assert_eq!((field(text, "MemAvailable:"), field(text, "MemFree:")), (Some(2000 * 1024), None));
        let some = |text: &str| Some(text.to_owned());
        assert_eq!(group(some("1000\n"), some("300\n")), Some(700));
        assert_eq!(group(some("max\n"), some("300\n")), None);
        assert_eq!(group(some("100\n"), some("300\n")), Some(0));
        assert!(!cfg!(target_os = "linux") || available().is_some_and(|bytes| bytes > 0));
    }
}
