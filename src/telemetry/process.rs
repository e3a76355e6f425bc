//! The metrics `process_…` that every Prometheus client has, as Linux tells them under `/proc`; elsewhere there are
//! none.

use std::fs::{read_dir, read_to_string};

use prometheus::core::{Collector, Desc};
use prometheus::proto::MetricFamily;
use prometheus::{IntCounter, IntGauge};

/// Reads the state of this process whenever metrics are asked for.
pub(super) struct ProcessCollector {
    cpu: IntCounter,
    open_files: IntGauge,
    most_files: IntGauge,
    virtual_memory: IntGauge,
    resident_memory: IntGauge,
    start: IntGauge,
    threads: IntGauge,
}

impl ProcessCollector {
    pub(super) fn new() -> Result<Self, prometheus::Error> {
        let gauge = |name, help| IntGauge::new(name, help);
        Ok(Self {
            cpu: IntCounter::new("process_cpu_seconds_total", "Total user and system CPU time spent in seconds.")?,
            open_files: gauge("process_open_fds", "Number of open file descriptors.")?,
            most_files: gauge("process_max_fds", "Maximum number of open file descriptors.")?,
            virtual_memory: gauge("process_virtual_memory_bytes", "Virtual memory size in bytes.")?,
            resident_memory: gauge("process_resident_memory_bytes", "Resident memory size in bytes.")?,
            start: gauge("process_start_time_seconds", "Start time of the process since unix epoch in seconds.")?,
            threads: gauge("process_threads", "Number of OS threads in the process.")?,
        })
    }

    fn members(&self) -> [&dyn Collector; 7] {
        [
            &self.cpu,
            &self.open_files,
            &self.most_files,
            &self.virtual_memory,
            &self.resident_memory,
            &self.start,
            &self.threads,
        ]
    }
}

impl Collector for ProcessCollector {
    fn desc(&self) -> Vec<&Desc> {
        self.members().into_iter().flat_map(Collector::desc).collect()
    }

    fn collect(&self) -> Vec<MetricFamily> {
        let Some(now) = State::read() else { return Vec::new() };
        // Two that collect at once must not count the same seconds twice, let alone backwards.
        self.cpu.inc_by(now.cpu_seconds.saturating_sub(self.cpu.get()));
        self.virtual_memory.set(now.virtual_bytes);
        self.resident_memory.set(now.resident_bytes);
        self.threads.set(now.threads);
        let mut told = vec![true; 7];
        for (place, gauge, value) in [
            (1, &self.open_files, read_dir("/proc/self/fd").ok().map(|files| files.count() as i64)),
            (2, &self.most_files, most_files()),
            (5, &self.start, boot_seconds().map(|boot| boot + now.start_seconds)),
        ] {
            told[place] = value.is_some();
            gauge.set(value.unwrap_or_default());
        }
        self.members()
            .into_iter()
            .zip(told)
            .filter(|(_, told)| *told)
            .flat_map(|(member, _)| member.collect())
            .collect()
    }
}

/// What `/proc/self/stat` says.
#[derive(Debug, PartialEq)]
struct State {
    cpu_seconds: u64,
    threads: i64,
    /// After the machine was started.
    start_seconds: i64,
    virtual_bytes: i64,
    resident_bytes: i64,
}

impl State {
    #[cfg(target_os = "linux")]
    fn read() -> Option<Self> {
        let ticks = rustix::param::clock_ticks_per_second();
        Self::parse(&read_to_string("/proc/self/stat").ok()?, ticks, rustix::param::page_size() as i64)
    }

    #[cfg(not(target_os = "linux"))]
    fn read() -> Option<Self> {
        None
    }

    /// The fields of proc(5), which begin after the name of the program: that stands in parentheses and may hold any
    /// character.
    #[cfg_attr(not(target_os = "linux"), allow(dead_code, reason = "other systems have no /proc"))]
    fn parse(stat: &str, ticks: u64, page: i64) -> Option<Self> {
        let fields: Vec<&str> = stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace().collect();
        // Field 3, the state, is the first of these.
        let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
        Some(Self {
            cpu_seconds: (field(14)? + field(15)?).checked_div(ticks)?,
            threads: field(20)? as i64,
            start_seconds: field(22)?.checked_div(ticks)? as i64,
            virtual_bytes: field(23)? as i64,
            resident_bytes: (field(24)? as i64).checked_mul(page)?,
        })
    }
}

/// When the machine was started, in seconds since 1970.
fn boot_seconds() -> Option<i64> {
    read_to_string("/proc/stat").ok()?.lines().find_map(|line| line.strip_prefix("btime "))?.trim().parse().ok()
}

/// How many files may be open; absent where that is not limited.
fn most_files() -> Option<i64> {
    let limits = read_to_string("/proc/self/limits").ok()?;
    limits.lines().find_map(|line| line.strip_prefix("Max open files"))?.split_ascii_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_behind_any_name() {
        let stat = "42 (a) b) S 1 42 42 0 -1 4194304 9 0 0 0 250 150 0 0 20 0 7 0 90000 4096000 300 184467 1 1";
        let found = State {
            cpu_seconds: 4,
            threads: 7,
            start_seconds: 900,
            virtual_bytes: 4_096_000,
            resident_bytes: 1_228_800,
        };
        assert_eq!(State::parse(stat, 100, 4096), Some(found));
        assert_eq!(State::parse("42 (a) S 1", 100, 4096), None);
        assert_eq!(State::parse("", 100, 4096), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_process_is_told() {
        let collector = ProcessCollector::new().unwrap();
        assert_eq!(collector.desc().len(), 7);
        let value = |name: &str| {
            let families = collector.collect();
            let family = families.iter().find(|family| family.name() == name)?;
            Some(family.get_metric()[0].get_gauge().get_value())
        };
        assert!(value("process_resident_memory_bytes") > Some((1 << 20) as f64));
        assert!(value("process_virtual_memory_bytes") >= value("process_resident_memory_bytes"));
        assert!(value("process_threads") >= Some(1.0) && value("process_open_fds") >= Some(3.0));
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs_f64();
        let age = now - value("process_start_time_seconds").unwrap();
        assert!((-2.0..36_000.0).contains(&age), "{age}");
    }
}
