//! Logs and metrics.
//!
//! Log lines are structured: identifiers are fields (`job`, `mesh`, `basis`, `request`), and a field that measures
//! something carries its unit in its name (`run_seconds`, `basis_bytes`). Metrics are in base units and begin with
//! `chladni_`.

mod process;

use crate::config::{LogFormat, LogSettings};
use prometheus::{
    Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge, IntGaugeVec, Opts, Registry,
    TextEncoder, core::Collector,
};

/// Logs or metrics could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The level is neither a level nor a list of directives.
    #[error("the log level {level:?} is not understood: {reason}")]
    Level {
        /// What was given.
        level: String,
        /// Why it was refused.
        reason: String,
    },
    /// A metric was refused by the registry.
    #[error("a metric cannot be registered: {0}")]
    Metric(#[from] prometheus::Error),
}

/// What the libraries of the graphics card say is not for the operator of a server: on a machine without a card they
/// call that an error. What matters of it, the accelerator tells. Directives of the operator come behind these and win.
const GPU_LIBRARIES: &str = "wgpu_core=off,wgpu_hal=off,naga=off";

/// Sends log lines to standard error from now on. A second call in one process changes nothing.
pub fn start_logs(settings: &LogSettings) -> Result<(), TelemetryError> {
    use std::io::{IsTerminal, stderr};
    use tracing_subscriber::{filter::Targets, fmt, layer::SubscriberExt, util::SubscriberInitExt};
    if settings.log_level.contains(['[', '{']) {
        let reason = "directives are by target and level, as in info,sqlx=warn".to_owned();
        return Err(TelemetryError::Level { level: settings.log_level.clone(), reason });
    }
    let filter: Targets = format!("{GPU_LIBRARIES},{}", settings.log_level).trim_end_matches(',').parse().map_err(
        |error: tracing_subscriber::filter::ParseError| TelemetryError::Level {
            level: settings.log_level.clone(),
            reason: error.to_string(),
        },
    )?;
    let (registry, lines) = (tracing_subscriber::registry().with(filter), fmt::layer().with_writer(stderr));
    // The only failure is that another subscriber is installed, as when two servers live in one test process.
    let _installed = match settings.log_format {
        LogFormat::Human => registry.with(lines.with_ansi(stderr().is_terminal())).try_init(),
        LogFormat::Json => {
            registry.with(lines.json().flatten_event(true).with_current_span(true).with_span_list(false)).try_init()
        }
    };
    Ok(())
}

/// The metrics of one server. Cheap to share through an `Arc`; every member may be used from any thread.
pub struct Metrics {
    registry: Registry,
    /// Requests answered, by route template, method and status.
    pub http_requests: IntCounterVec,
    /// Seconds from the request's header to the end of the answer's header, by route template and method.
    pub http_request_seconds: HistogramVec,
    /// Jobs in the store, by kind and status.
    pub jobs: IntGaugeVec,
    /// Seconds that a job waited before it was claimed, by kind.
    pub job_queue_seconds: HistogramVec,
    /// Seconds that a claim took that gave a job.
    pub job_claim_seconds: Histogram,
    /// Seconds that each stage of a job took, by kind and stage; the stage `total` is the whole run.
    pub job_run_seconds: HistogramVec,
    /// Attempts after the first one.
    pub job_retries: IntCounter,
    /// Processes of jobs that ended by themselves.
    pub job_deaths: IntCounter,
    /// Leases that expired without a report from their worker.
    pub leases_lost: IntCounter,
    /// Seconds of a synchronous solve, by operation (`filter`, `project`, …).
    pub reduced_solve_seconds: HistogramVec,
    /// Synchronous solves that wait or run.
    pub solves_held: IntGauge,
    /// Bytes that requests hold, bodies and what is parsed of them.
    pub request_bytes: IntGauge,
    /// Synchronous solves whose client went away before they ended.
    pub solves_abandoned: IntCounter,
    /// Requests with a key that is not one of the server's.
    pub keys_refused: IntCounter,
    /// Bases found decoded in the cache.
    pub basis_cache_hits: IntCounter,
    /// Bases that had to be loaded.
    pub basis_cache_misses: IntCounter,
    /// Bytes of decoded bases in the cache.
    pub basis_cache_bytes: IntGauge,
    /// Bytes of the blob database.
    pub blob_bytes: IntGauge,
    /// Bytes of the write-ahead logs.
    pub wal_bytes: Perhaps,
    /// Bytes of each database file.
    pub database_bytes: IntGaugeVec,
    /// Bytes that are free on the disk of the data folder.
    pub free_bytes: Perhaps,
    /// Bytes that must stay free there.
    pub least_free_bytes: Perhaps,
    /// 1 where the server takes work, else 0.
    pub ready: IntGauge,
    /// 1, labelled with what keeps records and content.
    pub store_info: IntGaugeVec,
    /// 1 where the database answers, else 0.
    pub database_up: IntGauge,
    /// 1 where what keeps the content answers, else 0.
    pub content_up: IntGauge,
    /// Living workers that share the records, by what they have.
    pub workers: IntGaugeVec,
    /// Jobs that they run at once.
    pub worker_seats: IntGaugeVec,
    /// Seconds for which the job has waited that waits for longest and could run.
    pub queue_age_seconds: Perhaps,
    /// Bytes of memory that running jobs were promised.
    pub job_memory_promised_bytes: IntGauge,
    /// Bytes of memory that jobs may be promised together.
    pub job_memory_limit_bytes: IntGauge,
    /// 1 where a GPU takes part in solves, else 0.
    pub gpu_available: IntGauge,
    /// Solves that fell back from the GPU to the CPU.
    pub gpu_fallbacks: IntCounter,
}

/// A gauge that is left out where there is nothing to tell: a zero would be an answer, and an alarm.
pub struct Perhaps(IntGaugeVec);

impl Perhaps {
    /// Sets it, or has it left out.
    pub fn set(&self, value: Option<u64>) {
        match value {
            Some(value) => self.0.with_label_values::<&str>(&[]).set(i64::try_from(value).unwrap_or(i64::MAX)),
            None => self.0.reset(),
        }
    }
}

/// What makes workers alike.
const WORKER_LABELS: &[&str] = &["memory", "kinds", "solver_version"];

/// Bounds for what a user waits for: 0.5 ms to 30 s.
const REQUEST_BUCKETS: &[f64] =
    &[0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0];
/// Bounds for what runs in the background: 5 ms to an hour.
const JOB_BUCKETS: &[f64] =
    &[0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 180.0, 600.0, 1800.0, 3600.0];

impl Metrics {
    /// Fresh metrics in a registry of their own, with the metrics of the process beside them.
    pub fn new() -> Result<Self, TelemetryError> {
        let registry = Registry::new();
        let kept = Keeper(&registry);
        registry.register(Box::new(process::ProcessCollector::new()?))?;
        let build = IntGaugeVec::new(Opts::new("chladni_build_info", "1, labelled with the version"), &["version"])?;
        build.with_label_values(&[env!("CARGO_PKG_VERSION")]).set(1);
        kept.keep(build)?;
        Ok(Self {
            http_requests: kept.keep(IntCounterVec::new(
                Opts::new("chladni_http_requests_total", "Requests answered"),
                &["route", "method", "status"],
            )?)?,
            http_request_seconds: kept.histogram(
                "chladni_http_request_duration_seconds",
                "Seconds until the header of the answer",
                REQUEST_BUCKETS,
                &["route", "method"],
            )?,
            jobs: kept.keep(IntGaugeVec::new(Opts::new("chladni_jobs", "Jobs in the store"), &["kind", "status"])?)?,
            job_queue_seconds: kept.histogram(
                "chladni_job_queue_seconds",
                "Seconds that a job waited before it was claimed",
                JOB_BUCKETS,
                &["kind"],
            )?,
            job_claim_seconds: kept.keep(Histogram::with_opts(
                HistogramOpts::new("chladni_job_claim_seconds", "Seconds that a claim took that gave a job")
                    .buckets(REQUEST_BUCKETS.to_vec()),
            )?)?,
            job_run_seconds: kept.histogram(
                "chladni_job_run_seconds",
                "Seconds of each stage of a job; the stage total is the whole run",
                JOB_BUCKETS,
                &["kind", "stage"],
            )?,
            job_retries: kept.counter("chladni_job_retries_total", "Attempts after the first one")?,
            job_deaths: kept.counter("chladni_job_deaths_total", "Processes of jobs that ended by themselves")?,
            leases_lost: kept.counter("chladni_leases_lost_total", "Leases that expired without a report")?,
            reduced_solve_seconds: kept.histogram(
                "chladni_reduced_solve_seconds",
                "Seconds of a synchronous solve",
                REQUEST_BUCKETS,
                &["operation"],
            )?,
            solves_held: kept.gauge("chladni_solves", "Synchronous solves that wait or run")?,
            request_bytes: kept.gauge("chladni_request_bytes", "Bytes of memory that requests hold")?,
            solves_abandoned: kept.counter(
                "chladni_abandoned_solves_total",
                "Synchronous solves whose client went away before they ended",
            )?,
            keys_refused: kept.counter("chladni_refused_keys_total", "Requests with an unknown API key")?,
            basis_cache_hits: kept.counter("chladni_basis_cache_hits_total", "Bases found decoded in the cache")?,
            basis_cache_misses: kept.counter("chladni_basis_cache_misses_total", "Bases that had to be loaded")?,
            basis_cache_bytes: kept.gauge("chladni_basis_cache_bytes", "Bytes of decoded bases in the cache")?,
            blob_bytes: kept.gauge("chladni_blob_bytes", "Bytes of the blob database")?,
            wal_bytes: kept.perhaps("chladni_wal_bytes", "Bytes of the write-ahead logs")?,
            database_bytes: kept.keep(IntGaugeVec::new(
                Opts::new("chladni_database_bytes", "Bytes of each database file"),
                &["database"],
            )?)?,
            free_bytes: kept.perhaps("chladni_free_bytes", "Bytes that are free on the disk of the data folder")?,
            least_free_bytes: kept.perhaps("chladni_least_free_bytes", "Bytes that must stay free on that disk")?,
            ready: kept.gauge("chladni_ready", "1 where the server takes work, else 0")?,
            store_info: kept.keep(IntGaugeVec::new(
                Opts::new("chladni_store_info", "1, labelled with what keeps records and content"),
                &["database", "content"],
            )?)?,
            database_up: kept.gauge("chladni_database_up", "1 where the database answers, else 0")?,
            content_up: kept.gauge("chladni_content_up", "1 where what keeps the content answers, else 0")?,
            workers: kept.keep(IntGaugeVec::new(
                Opts::new(
                    "chladni_workers",
                    "Living workers that share the records, by bytes of memory, kinds and solver",
                ),
                WORKER_LABELS,
            )?)?,
            worker_seats: kept.keep(IntGaugeVec::new(
                Opts::new("chladni_worker_seats", "Jobs that living workers run at once"),
                WORKER_LABELS,
            )?)?,
            queue_age_seconds: kept
                .perhaps("chladni_queue_age_seconds", "Seconds for which the oldest job has waited that could run")?,
            job_memory_promised_bytes: kept
                .gauge("chladni_job_memory_promised_bytes", "Bytes of memory that running jobs were promised")?,
            job_memory_limit_bytes: kept
                .gauge("chladni_job_memory_limit_bytes", "Bytes of memory that jobs may be promised together")?,
            gpu_available: kept.gauge("chladni_gpu_available", "1 where a GPU takes part in solves")?,
            gpu_fallbacks: kept.counter("chladni_gpu_fallbacks_total", "Solves that fell back to the CPU")?,
            registry,
        })
    }

    /// All metrics in the Prometheus text format.
    pub fn render(&self) -> String {
        let mut text = String::new();
        if let Err(error) = TextEncoder::new().encode_utf8(&self.registry.gather(), &mut text) {
            tracing::error!(%error, "metrics cannot be written");
        }
        text
    }
}

impl std::fmt::Debug for Metrics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Metrics").finish_non_exhaustive()
    }
}

/// Registers what it makes.
struct Keeper<'a>(&'a Registry);

impl Keeper<'_> {
    fn keep<C: Collector + Clone + 'static>(&self, collector: C) -> Result<C, prometheus::Error> {
        self.0.register(Box::new(collector.clone()))?;
        Ok(collector)
    }
    fn histogram(
        &self,
        name: &str,
        help: &str,
        buckets: &[f64],
        labels: &[&str],
    ) -> Result<HistogramVec, prometheus::Error> {
        self.keep(HistogramVec::new(HistogramOpts::new(name, help).buckets(buckets.to_vec()), labels)?)
    }
    fn counter(&self, name: &str, help: &str) -> Result<IntCounter, prometheus::Error> {
        self.keep(IntCounter::new(name, help)?)
    }
    fn gauge(&self, name: &str, help: &str) -> Result<IntGauge, prometheus::Error> {
        self.keep(IntGauge::new(name, help)?)
    }
    fn perhaps(&self, name: &str, help: &str) -> Result<Perhaps, prometheus::Error> {
        Ok(Perhaps(self.keep(IntGaugeVec::new(Opts::new(name, help), &[])?)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What has labels, or may be absent, is told of once it has a value.
    fn with_a_value_of_each() -> Metrics {
        let metrics = Metrics::new().unwrap();
        metrics.http_requests.with_label_values(&["/", "GET", "200"]).inc();
        metrics.http_request_seconds.with_label_values(&["/", "GET"]).observe(1.0);
        metrics.jobs.with_label_values(&["eigenbasis", "failed"]).set(1);
        metrics.job_queue_seconds.with_label_values(&["eigenbasis"]).observe(1.0);
        metrics.job_run_seconds.with_label_values(&["eigenbasis", "eigen"]).observe(1.0);
        metrics.reduced_solve_seconds.with_label_values(&["filter"]).observe(1.0);
        metrics.database_bytes.with_label_values(&["meta"]).set(1);
        for own in [&metrics.wal_bytes, &metrics.free_bytes, &metrics.least_free_bytes, &metrics.queue_age_seconds] {
            own.set(Some(1));
        }
        metrics.store_info.with_label_values(&["sqlite", "sqlite"]).set(1);
        metrics.workers.with_label_values(&["1", "all", "0.1.0+5"]).set(1);
        metrics.worker_seats.with_label_values(&["1", "all", "0.1.0+5"]).set(1);
        metrics
    }

    #[test]
    fn every_metric_is_rendered_with_its_prefix() {
        let metrics = Metrics::new().unwrap();
        metrics.http_requests.with_label_values(&["/v1/meshes", "POST", "201"]).inc();
        metrics.job_run_seconds.with_label_values(&["eigenbasis", "eigen"]).observe(0.2);
        metrics.leases_lost.inc();
        metrics.job_retries.inc();
        metrics.free_bytes.set(Some(7));
        metrics.free_bytes.set(None);
        assert!(!metrics.render().contains("chladni_free_bytes"));
        metrics.wal_bytes.set(Some(0));
        let text = metrics.render();
        for line in [
            r#"chladni_http_requests_total{method="POST",route="/v1/meshes",status="201"} 1"#,
            r#"chladni_job_run_seconds_count{kind="eigenbasis",stage="eigen"} 1"#,
            "chladni_leases_lost_total 1",
            "chladni_job_retries_total 1",
            "chladni_gpu_available 0",
            "chladni_wal_bytes 0",
        ] {
            assert!(text.lines().any(|l| l == line), "{line} is missing from\n{text}");
        }
        assert!(
            text.lines()
                .filter(|l| !l.starts_with('#'))
                .all(|l| l.starts_with("chladni_") || l.starts_with("process_"))
        );
    }

    /// The rules of `promtool check metrics`, and those of <https://prometheus.io/docs/practices/naming/> that it does
    /// not know.
    #[test]
    fn metrics_are_named_as_prometheus_would_have_them() {
        let metrics = with_a_value_of_each();
        let families = metrics.registry.gather();
        assert!(families.len() > 30, "{}", families.len());
        for family in families {
            let (name, help) = (family.name(), family.help());
            let kind = format!("{:?}", family.get_field_type()).to_lowercase();
            assert!(!help.trim().is_empty(), "{name} has no help");
            assert!(name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_'), "{name}");
            assert_eq!(name.ends_with("_total"), kind == "counter", "{name} is a {kind}");
            for reserved in ["_count", "_sum", "_bucket", "_info"] {
                assert!(
                    !name.ends_with(reserved) || ["chladni_build_info", "chladni_store_info"].contains(&name),
                    "{name}"
                );
            }
            let words: Vec<&str> = name.split('_').collect();
            for wrong in [
                "counter",
                "gauge",
                "histogram",
                "ms",
                "milliseconds",
                "minutes",
                "hours",
                "kilobytes",
                "megabytes",
                "mib",
                "gib",
                "percent",
            ] {
                assert!(!words.contains(&wrong), "{name}: {wrong}");
            }
            // A unit stands at the end, before `total` alone.
            for unit in ["seconds", "bytes"] {
                if let Some(at) = words.iter().position(|word| *word == unit) {
                    assert!(words[at + 1..].iter().all(|word| *word == "total"), "{name}");
                }
            }
            for label in family.get_metric().iter().flat_map(|metric| metric.get_label()) {
                assert!(!["le", "quantile", "job", "instance"].contains(&label.name()), "{name}: {}", label.name());
            }
        }
    }

    /// What the board and the alerts ask for is what the server has.
    #[test]
    fn boards_and_alerts_name_metrics_that_there_are() {
        let metrics = with_a_value_of_each();
        let known: Vec<String> = metrics.registry.gather().iter().map(|family| family.name().to_owned()).collect();
        let mut asked = 0;
        for text in [include_str!("../deploy/alerts.yml"), include_str!("../deploy/grafana/dashboards/chladni.json")] {
            for word in text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')) {
                let suffix = ["_bucket", "_sum", "_count"].into_iter().find_map(|suffix| word.strip_suffix(suffix));
                if word.starts_with("chladni_") || word.starts_with("process_") {
                    assert!(known.iter().any(|name| name == suffix.unwrap_or(word)), "{word}");
                    asked += 1;
                }
            }
        }
        assert!(asked > 30, "{asked}");
    }

    #[test]
    fn two_servers_in_one_process_have_metrics_of_their_own() {
        let (one, other) = (Metrics::new().unwrap(), Metrics::new().unwrap());
        one.job_retries.inc();
        assert_eq!(other.job_retries.get(), 0);
    }

    #[test]
    fn a_log_level_that_is_not_understood_is_named() {
        let settings = LogSettings { log_level: "chladni=loudly".into(), ..LogSettings::default() };
        assert!(start_logs(&settings).unwrap_err().to_string().contains("chladni=loudly"));
    }
}
