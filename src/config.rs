//! Every setting of the service, with its flag, its environment variable and its default.
//!
//! A flag wins over its environment variable, which wins over the default. Sizes are bytes (`268435456` or `256MiB`),
//! times are seconds (`30` or `0.5`); both carry their unit in the name.

mod secrets;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

pub use secrets::{Keys, Secret};

/// One kibibyte, in bytes.
const KIB: u64 = 1 << 10;
/// One mebibyte, in bytes.
const MIB: u64 = 1 << 20;
/// One gibibyte, in bytes.
const GIB: u64 = 1 << 30;
/// One tebibyte, in bytes.
const TIB: u64 = 1 << 40;

/// The settings of a server: `chladni serve` and `chladni demo` take them all.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub struct Config {
    /// Where the server listens, as address and port; port 0 takes a free one
    #[arg(
        long,
        value_name = "ADDRESS",
        env = "CHLADNI_LISTEN",
        default_value = "127.0.0.1:8080",
        help_heading = "Network"
    )]
    pub listen: SocketAddr,

    /// Let a server listen beyond this machine without API keys
    #[arg(long, env = "CHLADNI_INSECURE", help_heading = "Network", value_parser = clap::builder::BoolishValueParser::new())]
    pub insecure: bool,

    /// API keys as NAME:SCOPES:SECRET, separated by commas; scopes are read, submit and operate, joined by +
    #[arg(
        long,
        value_name = "KEYS",
        env = "CHLADNI_KEYS",
        default_value = "",
        hide_default_value = true,
        hide_env_values = true,
        help_heading = "Network"
    )]
    pub keys: Keys,

    /// A file with one API key per line, in the form of --keys; lines that begin with # are comments
    #[arg(long, value_name = "FILE", env = "CHLADNI_KEYS_FILE", help_heading = "Network")]
    pub keys_file: Option<PathBuf>,

    /// Origins whose pages may call the API from a browser, separated by commas; * for any
    #[arg(long, value_name = "ORIGINS", env = "CHLADNI_CORS_ORIGINS", value_delimiter = ',', help_heading = "Network")]
    pub cors_origins: Vec<String>,

    /// Names that the server is called by, separated by commas, beside localhost and its addresses; * for any
    ///
    /// A server on loopback without keys answers to no other name, lest a web page reach it by one of its own. Any
    /// other server checks names only where they are given.
    #[arg(long, value_name = "NAMES", env = "CHLADNI_HOSTS", value_delimiter = ',', help_heading = "Network")]
    pub hosts: Vec<String>,

    /// Connections served at once, three quarters of them at most for one client; beyond, only health and metrics are
    /// answered
    #[arg(long, value_name = "N", env = "CHLADNI_MAX_CONNECTIONS", default_value_t = 512, value_parser = at_least_one, help_heading = "Network")]
    pub max_connections: usize,

    /// Seconds a client has to send the header of a request
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_HEADER_SECONDS", default_value = "10", value_parser = seconds, help_heading = "Network")]
    pub header_seconds: Duration,

    /// Seconds a client may pause while it sends a body or takes an answer
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_BODY_SECONDS", default_value = "30", value_parser = seconds, help_heading = "Network")]
    pub body_seconds: Duration,

    /// Folder of the databases; made where it is missing
    #[arg(long, value_name = "FOLDER", env = "CHLADNI_DATA", default_value = "chladni-data", help_heading = "Storage")]
    pub data: PathBuf,

    /// Records in a PostgreSQL that servers and workers share, as postgres://USER:PASSWORD@HOST/DATABASE; goes with
    /// --objects
    #[arg(
        long,
        value_name = "ADDRESS",
        env = "CHLADNI_DATABASE",
        requires = "objects",
        hide_env_values = true,
        help_heading = "Storage"
    )]
    pub database: Option<Secret>,

    /// The same database with no pooler between, where --database leads to one that gives connections out by
    /// transaction, as PgBouncer does
    #[arg(
        long,
        value_name = "ADDRESS",
        env = "CHLADNI_DATABASE_DIRECT",
        requires = "database",
        hide_env_values = true,
        help_heading = "Storage"
    )]
    pub database_direct: Option<Secret>,

    /// Content in an object store that servers and workers share, as s3://BUCKET/PREFIX?endpoint=ADDRESS, or
    /// file:///FOLDER that all of them see; goes with --database
    #[arg(long, value_name = "ADDRESS", env = "CHLADNI_OBJECTS", requires = "database", help_heading = "Storage")]
    pub objects: Option<String>,

    /// Bytes of decoded bases kept in memory for synchronous solves, and as many of surfaces and factors that fields
    /// are designed with
    #[arg(long, value_name = "BYTES", env = "CHLADNI_CACHE_BYTES", default_value = "1GiB", value_parser = bytes, help_heading = "Storage")]
    pub cache_bytes: u64,

    /// Bytes that stay free on the disk of the data folder; below, writes are refused
    #[arg(long, value_name = "BYTES", env = "CHLADNI_LEAST_FREE_BYTES", default_value = "256MiB", value_parser = bytes, help_heading = "Storage")]
    pub least_free_bytes: u64,

    /// What is kept, and for how long.
    #[command(flatten)]
    pub keep: Keep,

    /// Jobs that run at once; 0 with --database, to leave them to other processes
    #[arg(long, value_name = "N", env = "CHLADNI_WORKERS", default_value_t = 1, help_heading = "Work")]
    pub workers: usize,

    /// Kinds of job that are taken, separated by commas; every kind without it
    #[arg(long, value_name = "KINDS", env = "CHLADNI_KINDS", value_delimiter = ',', help_heading = "Work")]
    pub kinds: Vec<String>,

    /// Where jobs run: processes of their own, or threads of the server
    ///
    /// A job in a process of its own takes no server with it when it crashes, may take no more memory than was
    /// promised, and is killed where it does not stop when it is cancelled.
    #[arg(
        long,
        value_name = "WHERE",
        env = "CHLADNI_JOBS_IN",
        default_value = "processes",
        hide_possible_values = true,
        help_heading = "Work"
    )]
    pub jobs_in: JobsIn,

    /// Threads that all jobs share; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0, help_heading = "Work")]
    pub threads: usize,

    /// Threads of their own for synchronous solves, which go before those of jobs; 0 for half of the cores, at least
    /// two
    #[arg(long, value_name = "N", env = "CHLADNI_SOLVE_THREADS", default_value_t = 0, help_heading = "Work")]
    pub solve_threads: usize,

    /// Graphics card for large dense problems: off; auto for the first one that is no software, where it is faster than
    /// the CPU; or its number or a part of its name
    #[arg(long, value_name = "CARD", env = "CHLADNI_GPU", default_value = "auto", help_heading = "Work")]
    pub gpu: String,

    /// Bytes of memory that running jobs may need together, by estimate; 0 for three quarters of what is free at the
    /// start
    #[arg(long, value_name = "BYTES", env = "CHLADNI_MEMORY_BYTES", default_value = "0", value_parser = bytes, help_heading = "Work")]
    pub memory_bytes: u64,

    /// Seconds for which a worker owns a job without a heartbeat
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_LEASE_SECONDS", default_value = "30", value_parser = seconds, help_heading = "Work")]
    pub lease_seconds: Duration,

    /// Seconds between two heartbeats of a worker
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_HEARTBEAT_SECONDS", default_value = "0.5", value_parser = seconds, help_heading = "Work")]
    pub heartbeat_seconds: Duration,

    /// Seconds without a checkpoint after which a job counts as stalled
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_STALL_SECONDS", default_value = "900", value_parser = seconds, help_heading = "Work")]
    pub stall_seconds: Duration,

    /// Seconds that running jobs get to end when the server stops; then they return to the queue
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_DRAIN_SECONDS", default_value = "30", value_parser = seconds, help_heading = "Work")]
    pub drain_seconds: Duration,

    /// Times that a job is tried before it has failed for good
    #[arg(long, value_name = "N", env = "CHLADNI_MAX_ATTEMPTS", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Work")]
    pub max_attempts: u32,

    /// A fault for tests, as POINT:ACTION or POINT:ACTION:PASSES; see the faults of the store. Or gpu-lost: the
    /// graphics card is lost when a problem first reaches it
    #[arg(long, value_name = "FAULT", env = "CHLADNI_FAULT", hide = true)]
    pub fault: Option<String>,

    /// Take jobs of the kind `idle` as well, which wait for `seconds`: for trials of what is around them
    #[arg(long, env = "CHLADNI_IDLE_JOBS", hide = true)]
    pub idle_jobs: bool,

    /// What a request may ask for.
    #[command(flatten)]
    pub limits: Limits,

    /// What is logged, and how.
    #[command(flatten)]
    pub logs: LogSettings,
}

/// What is kept, and for how long; everything for ever unless told otherwise. What a job in the queue needs is always
/// kept.
#[derive(Debug, Clone, PartialEq, Eq, Default, clap::Args)]
pub struct Keep {
    /// Seconds after their end for which jobs without a stored basis are kept
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_KEEP_JOB_SECONDS", value_parser = seconds, help_heading = "Retention")]
    pub keep_job_seconds: Option<Duration>,

    /// Ended jobs without a stored basis that are kept, the latest ones
    #[arg(long, value_name = "N", env = "CHLADNI_KEEP_JOBS", help_heading = "Retention")]
    pub keep_jobs: Option<u64>,

    /// Seconds after their last use for which bases and fields are kept
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_KEEP_BASIS_SECONDS", value_parser = seconds, help_heading = "Retention")]
    pub keep_basis_seconds: Option<Duration>,

    /// Bases that are kept, the last used ones; fields that were designed in one go with it
    #[arg(long, value_name = "N", env = "CHLADNI_KEEP_BASES", help_heading = "Retention")]
    pub keep_bases: Option<u64>,

    /// Seconds after their last use for which meshes without bases and fields are kept
    #[arg(long, value_name = "SECONDS", env = "CHLADNI_KEEP_MESH_SECONDS", value_parser = seconds, help_heading = "Retention")]
    pub keep_mesh_seconds: Option<Duration>,

    /// Meshes that are kept, the last used ones; those with bases or fields stay
    #[arg(long, value_name = "N", env = "CHLADNI_KEEP_MESHES", help_heading = "Retention")]
    pub keep_meshes: Option<u64>,

    /// Bytes of content that are kept: beyond, what was not used for longest goes, fields, bases and meshes without
    /// either
    #[arg(long, value_name = "BYTES", env = "CHLADNI_KEEP_BYTES", value_parser = bytes, help_heading = "Retention")]
    pub keep_bytes: Option<u64>,
}

/// What one request may ask for; beyond, it is refused with a problem of its own type.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub struct Limits {
    /// Bytes of a request body, after decompression
    #[arg(long, value_name = "BYTES", env = "CHLADNI_MAX_BODY_BYTES", default_value = "1GiB", value_parser = bytes, help_heading = "Limits")]
    pub max_body_bytes: u64,

    /// Vertices of a mesh
    #[arg(long, value_name = "N", env = "CHLADNI_MAX_VERTICES", default_value_t = 20_000_000, value_parser = at_least_one, help_heading = "Limits")]
    pub max_vertices: usize,

    /// Faces of a mesh, after polygons are triangulated
    #[arg(long, value_name = "N", env = "CHLADNI_MAX_FACES", default_value_t = 40_000_000, value_parser = at_least_one, help_heading = "Limits")]
    pub max_faces: usize,

    /// Bytes of memory that one job may need, by estimate; never more than --memory-bytes
    #[arg(long, value_name = "BYTES", env = "CHLADNI_MAX_JOB_BYTES", default_value = "8GiB", value_parser = bytes, help_heading = "Limits")]
    pub max_job_bytes: u64,

    /// Jobs that may wait in the queue
    #[arg(long, value_name = "N", env = "CHLADNI_MAX_QUEUED_JOBS", default_value_t = 10_000, value_parser = at_least_one, help_heading = "Limits")]
    pub max_queued_jobs: usize,
}

/// What is logged, and how.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub struct LogSettings {
    /// Form of the log lines on standard error: human, or json for one object per line
    #[arg(
        long,
        value_name = "FORMAT",
        env = "CHLADNI_LOG_FORMAT",
        default_value = "human",
        hide_possible_values = true,
        help_heading = "Logs"
    )]
    pub log_format: LogFormat,

    /// What is logged: error, warn, info, debug, trace, or directives such as info,chladni::queue=debug
    #[arg(long, value_name = "LEVEL", env = "CHLADNI_LOG_LEVEL", default_value = "info", help_heading = "Logs")]
    pub log_level: String,
}

/// Where jobs run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum JobsIn {
    /// Each in a process of its own.
    Processes,
    /// On threads of the server.
    Threads,
}

/// The form of a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines to read.
    Human,
    /// One JSON object per line, for collectors.
    Json,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The key file is missing or unreadable.
    #[error("cannot read the key file {}: {source}", path.display())]
    KeyFile {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Two settings contradict each other.
    #[error("{0}")]
    Contradiction(String),
}

impl Config {
    /// All configured keys: those of `keys`, then those of `keys_file`.
    pub fn all_keys(&self) -> Result<Keys, ConfigError> {
        let mut all = self.keys.clone();
        if let Some(path) = &self.keys_file {
            let text =
                std::fs::read_to_string(path).map_err(|source| ConfigError::KeyFile { path: path.clone(), source })?;
            let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
            all.extend(lines.map(String::from));
        }
        Ok(all)
    }

    /// Threads of the job pool: what was asked for, or one per core.
    pub fn job_threads(&self) -> usize {
        if self.threads > 0 { self.threads } else { cores() }
    }

    /// Threads of the pool of synchronous solves: what was asked for, or half of the cores, at least two where there
    /// are two.
    pub fn reduced_solve_threads(&self) -> usize {
        if self.solve_threads > 0 { self.solve_threads } else { (cores() / 2).max(2.min(cores())) }
    }

    /// Refuses settings that contradict each other, in a sentence.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if self.workers == 0 && self.database.is_none() {
            return Err(ConfigError::Contradiction(
                "nobody would run jobs: --workers 0 is for servers that share their records with workers, by --database and --objects".into(),
            ));
        }
        if self.database.is_some() != self.objects.is_some() {
            return Err(ConfigError::Contradiction("--database and --objects go together".into()));
        }
        if !self.kinds.is_empty() && self.database.is_none() {
            return Err(ConfigError::Contradiction(
                "nobody would run jobs of other kinds: --kinds is for processes that share their records, by --database and --objects".into(),
            ));
        }
        if self.heartbeat_seconds * 2 > self.lease_seconds {
            return Err(ConfigError::Contradiction(format!(
                "a heartbeat every {} s cannot hold a lease of {} s: make the lease at least twice as long",
                self.heartbeat_seconds.as_secs_f64(),
                self.lease_seconds.as_secs_f64()
            )));
        }
        Ok(())
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)),
            insecure: false,
            keys: Keys::default(),
            keys_file: None,
            cors_origins: Vec::new(),
            hosts: Vec::new(),
            max_connections: 512,
            header_seconds: Duration::from_secs(10),
            body_seconds: Duration::from_secs(30),
            data: PathBuf::from("chladni-data"),
            database: None,
            database_direct: None,
            objects: None,
            cache_bytes: GIB,
            least_free_bytes: 256 * MIB,
            keep: Keep::default(),
            workers: 1,
            kinds: Vec::new(),
            jobs_in: JobsIn::Processes,
            threads: 0,
            solve_threads: 0,
            gpu: "auto".into(),
            memory_bytes: 0,
            lease_seconds: Duration::from_secs(30),
            heartbeat_seconds: Duration::from_millis(500),
            stall_seconds: Duration::from_secs(900),
            drain_seconds: Duration::from_secs(30),
            max_attempts: 3,
            fault: None,
            idle_jobs: false,
            limits: Limits::default(),
            logs: LogSettings::default(),
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_body_bytes: GIB,
            max_vertices: 20_000_000,
            max_faces: 40_000_000,
            max_job_bytes: 8 * GIB,
            max_queued_jobs: 10_000,
        }
    }
}

impl Default for LogSettings {
    fn default() -> Self {
        Self { log_format: LogFormat::Human, log_level: "info".into() }
    }
}

/// Cores of the machine, as far as this process may use them.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// A size in bytes: `1048576`, `1024KiB` or `1MiB`.
pub fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let unit = match text[digits..].trim() {
        "" | "B" => 1,
        "KiB" => KIB,
        "MiB" => MIB,
        "GiB" => GIB,
        "TiB" => TIB,
        other => return Err(format!("the unit {other:?} is not one of B, KiB, MiB, GiB, TiB")),
    };
    let number: u64 =
        text[..digits].parse().map_err(|_| "a size is a whole number, with or without a unit such as MiB")?;
    number.checked_mul(unit).ok_or_else(|| "the size is too large".into())
}

/// A time in seconds, above zero: `30` or `0.25`.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let number: f64 = text.trim().parse().map_err(|_| "a time is a number of seconds")?;
    match Duration::try_from_secs_f64(number) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err("a time is a number of seconds above 0".into()),
    }
}

/// A whole number of at least one.
fn at_least_one(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) | Err(_) => Err("a whole number of at least 1".into()),
        Ok(number) => Ok(number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Args, FromArgMatches};

    /// Parses without the environment, so that the test does not depend on it.
    fn parsed(arguments: &[&str]) -> Result<Config, clap::Error> {
        let command = Config::augment_args(clap::Command::new("chladni")).mut_args(|arg| arg.env(None::<&str>));
        let matches = command.no_binary_name(true).try_get_matches_from(arguments)?;
        Config::from_arg_matches(&matches)
    }

    #[test]
    fn an_empty_command_line_gives_the_documented_defaults() {
        assert_eq!(parsed(&[]).unwrap(), Config::default());
    }

    #[test]
    fn every_setting_has_an_environment_variable_named_after_its_flag() {
        let command = Config::augment_args(clap::Command::new("chladni"));
        for arg in command.get_arguments() {
            let flag = arg.get_long().unwrap();
            let expected = format!("CHLADNI_{}", flag.replace('-', "_").to_uppercase());
            assert_eq!(arg.get_env().and_then(|name| name.to_str()), Some(expected.as_str()), "of --{flag}");
            assert!(arg.get_help().is_some(), "--{flag} has no help");
        }
    }

    #[test]
    fn sizes_and_times_are_read_with_their_units() {
        assert_eq!(bytes("12"), Ok(12));
        assert_eq!(bytes("3 MiB"), Ok(3 << 20));
        assert_eq!(bytes("2TiB"), Ok(2 << 40));
        for wrong in ["", "MiB", "-1", "1.5GiB", "1MB", "99999999999999999999", "18446744073709551615TiB", "1é"] {
            assert!(bytes(wrong).is_err(), "{wrong}");
        }
        assert_eq!(seconds("0.25"), Ok(Duration::from_millis(250)));
        for wrong in ["0", "-1", "nan", "inf", "1e300", "soon", ""] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn flags_reach_their_settings() {
        let config = parsed(&[
            "--listen",
            "0.0.0.0:9",
            "--insecure",
            "--keys",
            "a:read:x, b:read+submit:y",
            "--max-body-bytes",
            "1MiB",
            "--cors-origins",
            "https://a.example,https://b.example",
            "--lease-seconds",
            "2",
            "--log-format",
            "json",
        ])
        .unwrap();
        assert!(config.insecure);
        assert_eq!(config.keys.entries(), ["a:read:x", "b:read+submit:y"]);
        assert_eq!(config.limits.max_body_bytes, 1 << 20);
        assert_eq!(config.cors_origins.len(), 2);
        assert_eq!(config.lease_seconds, Duration::from_secs(2));
        assert_eq!(config.logs.log_format, LogFormat::Json);
    }

    #[test]
    fn a_server_without_workers_shares_its_records_with_some() {
        let alone = parsed(&["--workers", "0"]).unwrap();
        assert!(alone.validate().unwrap_err().to_string().contains("nobody"));
        let shared = ["--workers", "0", "--database", "postgres://u:topsecret@h/d", "--objects", "s3://b/p"];
        let shared = parsed(&shared).unwrap();
        assert!(shared.validate().is_ok());
        assert!(!format!("{shared:?}").contains("topsecret"));
        // Records and content are shared together.
        assert!(parsed(&["--database", "postgres://h/d"]).is_err() && parsed(&["--objects", "s3://b"]).is_err());
    }

    #[test]
    fn secrets_do_not_show_in_debug_output() {
        let config = parsed(&["--keys", "a:read:topsecret"]).unwrap();
        assert!(!format!("{config:?}").contains("topsecret"));
    }

    #[test]
    fn keys_of_the_file_follow_those_of_the_flag() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("keys");
        std::fs::write(&path, "# who may do what\n\n b:read:2 \n").unwrap();
        let config = Config { keys: "a:read:1".parse().unwrap(), keys_file: Some(path.clone()), ..Config::default() };
        assert_eq!(config.all_keys().unwrap().entries(), ["a:read:1", "b:read:2"]);
        let missing = Config { keys_file: Some(folder.path().join("none")), ..Config::default() };
        assert!(missing.all_keys().unwrap_err().to_string().contains("none"));
    }

    #[test]
    fn a_lease_shorter_than_two_heartbeats_is_refused() {
        let config = Config { lease_seconds: Duration::from_millis(600), ..Config::default() };
        assert!(config.validate().unwrap_err().to_string().contains("twice"));
        assert!(Config::default().validate().is_ok());
    }
}
