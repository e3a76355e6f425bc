//! `serve`: the store, the workers and the API, wired together, and their end in order.

use chladni_algebra::gpu;
use chladni_spectral::basis::ProductKind;

use super::{CliError, memory, private, worker};
use crate::config::{Config, JobsIn};
use crate::http::{self, AppState};
use crate::queue::{QueueObserver, WorkerOptions, WorkerPool};
use crate::store::{JobStatus, Retention, SharedPlaces, Store, StoreOptions, fault::Faults};
use crate::telemetry::{Metrics, start_logs};
use std::io::{self, Write};
use std::net::SocketAddr;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// What the process answers when it is told twice to stop.
const INTERRUPTED: u8 = 130;

/// Runs `chladni serve` until SIGTERM or SIGINT.
pub fn serve(config: Config) -> Result<ExitCode, CliError> {
    start_logs(&config.logs)?;
    runtime()?.block_on(async {
        let signals = Signals::install()?;
        let running = start(config).await?;
        // From here on a crash may be the doing of a job. Where others share the records, its lease runs out instead.
        #[cfg(unix)]
        if !running.store.is_shared()
            && let Err(error) = super::crash_mark::install(&running.store.crash_mark())
        {
            tracing::warn!(%error, "crash detection is unavailable");
        }
        // One line for scripts, which may have asked for a free port; everything else goes to the log.
        writeln!(io::stdout(), "listening on {}", running.url()).map_err(CliError::stdout)?;
        signals.stop_on_first(running).await
    })
}

/// The async runtime of the server. Solves run on rayon pools; this one only moves bytes and waits.
pub(super) fn runtime() -> Result<tokio::runtime::Runtime, CliError> {
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .thread_name("chladni-io")
        .build()
        .map_err(|error| CliError::Service(format!("cannot start the async runtime: {error}")))
}

/// A running server.
pub struct Running {
    /// Where it listens, with the port that was taken where 0 was asked for.
    pub address: SocketAddr,
    /// What it stores.
    pub store: Store,
    /// What it counts.
    pub metrics: Arc<Metrics>,
    state: AppState,
    workers: Arc<WorkerPool>,
    stop: CancellationToken,
    server: JoinHandle<io::Result<()>>,
    drain: Duration,
}

/// Starts a server on the configured address.
///
/// # Errors
/// [`CliError::Config`] for settings that contradict each other, [`CliError::Service`] where the address is taken, the
/// data folder cannot be used, or a server beyond loopback would run without keys.
pub async fn start(config: Config) -> Result<Running, CliError> {
    check(&config)?;
    let listener = bind(config.listen).await?;
    start_on(listener, config).await
}

/// Takes an address.
pub(super) async fn bind(address: SocketAddr) -> Result<TcpListener, CliError> {
    TcpListener::bind(address).await.map_err(|source| CliError::Io {
        action: "listen on",
        target: address.to_string(),
        source,
    })
}

/// Starts a server on a socket that listens already.
///
/// # Errors
/// As [`start`].
pub async fn start_on(listener: TcpListener, mut config: Config) -> Result<Running, CliError> {
    let service = |error: &dyn std::fmt::Display| CliError::Service(error.to_string());
    check(&config)?;
    if let Some(path) = &config.keys_file {
        private::keys_file(path)?;
    }
    let address = listener.local_addr().map_err(|source| CliError::Io {
        action: "listen on",
        target: config.listen.to_string(),
        source,
    })?;
    let keys = config
        .all_keys()?
        .entries()
        .iter()
        .map(|entry| entry.parse())
        .collect::<Result<Vec<http::ApiKey>, http::KeyError>>()
        .map_err(|error| CliError::Usage(error.to_string()))?;
    http::require_keys(address, &keys, config.insecure).map_err(|error| CliError::Usage(error.to_string()))?;

    let accelerator = accelerator(&config.gpu).await?;
    let metrics = Arc::new(Metrics::new()?);
    let memory = memory_for_jobs(&config);
    // What would never fit is refused at once; where others run jobs as well, they may have more.
    if config.database.is_none() {
        config.limits.max_job_bytes = config.limits.max_job_bytes.min(memory);
    }
    // Requests, and what each job needs beside.
    let store = open_store(&config, &accelerator, 10 + config.workers, false).await?;
    let workers = start_workers(&config, &store, &metrics, memory).await?;
    let drain = config.drain_seconds;
    let (solve_threads, threads, jobs_at_once) = (config.reduced_solve_threads(), config.job_threads(), config.workers);
    let data = match &config.objects {
        Some(objects) => objects.clone(),
        None => config.data.display().to_string(),
    };
    let most_job_bytes = config.limits.max_job_bytes;
    let alive = workers.clone();
    let state = AppState::new(store.clone(), config, metrics.clone(), move || alive.alive())
        .map_err(|error| service(&error))?;
    let stop = CancellationToken::new();
    let server = tokio::spawn(http::serve(listener, state.clone(), stop.clone().cancelled_owned()));
    tracing::info!(
        %address,
        data,
        workers = jobs_at_once,
        threads,
        solve_threads,
        job_bytes = most_job_bytes,
        memory_bytes = memory,
        gpu = accelerator.adapter().unwrap_or_else(|| "none".into()),
        keys = keys.len(),
        version = env!("CARGO_PKG_VERSION"),
        "listening"
    );
    Ok(Running { address, store, metrics, state, workers, stop, server, drain })
}

/// Refuses settings that contradict each other, or name what there is not.
fn check(config: &Config) -> Result<(), CliError> {
    config.validate()?;
    match config.kinds.iter().find(|kind| ProductKind::of_name(kind).is_none()) {
        Some(kind) => Err(CliError::Usage(format!("--kinds: {kind:?} is not a kind of job"))),
        None => Ok(()),
    }
}

/// Bytes of memory that jobs of this process may need together.
fn memory_for_jobs(config: &Config) -> u64 {
    match config.memory_bytes {
        0 => memory::available().map_or(u64::MAX, |free| free / 4 * 3),
        bytes => bytes,
    }
}

/// Opens the store that is configured, with so many connections at most where it is shared, for whoever works alone or
/// for whoever answers as well.
async fn open_store(
    config: &Config,
    accelerator: &gpu::Accelerator,
    connections: usize,
    works_alone: bool,
) -> Result<Store, CliError> {
    if config.database.is_none() {
        private::data_folder(&config.data)?;
    }
    let mut options = StoreOptions::new(&config.data);
    options.shared = match (&config.database, &config.objects) {
        (Some(database), Some(objects)) => {
            let direct = config.database_direct.as_ref().map(|direct| direct.reveal().to_owned());
            Some(SharedPlaces { database: database.reveal().to_owned(), direct, objects: objects.clone() })
        }
        _ => None,
    };
    options.hears_of_work_alone = works_alone;
    options.connections = u32::try_from(connections).unwrap_or(u32::MAX);
    options.cache_bytes = config.cache_bytes;
    options.least_free_bytes = config.least_free_bytes;
    options.retention = Retention {
        job_age: config.keep.keep_job_seconds,
        jobs: config.keep.keep_jobs,
        basis_age: config.keep.keep_basis_seconds,
        bases: config.keep.keep_bases,
        mesh_age: config.keep.keep_mesh_seconds,
        meshes: config.keep.keep_meshes,
        bytes: config.keep.keep_bytes,
    };
    options.queued_jobs_limit = Some(config.limits.max_queued_jobs as u64);
    match config.fault.as_deref() {
        Some("gpu-lost") => accelerator.lose_once(),
        // Of jobs, in their processes.
        Some("poison") if config.jobs_in == JobsIn::Processes => {}
        Some(fault) => options.faults = Faults::parse(fault).map_err(|error| CliError::Usage(error.to_string()))?,
        None => {}
    }
    Store::open(options).await.map_err(|error| CliError::Service(error.to_string()))
}

/// Starts what runs the jobs.
async fn start_workers(
    config: &Config,
    store: &Store,
    metrics: &Arc<Metrics>,
    memory: u64,
) -> Result<Arc<WorkerPool>, CliError> {
    let service = |error: &dyn std::fmt::Display| CliError::Service(error.to_string());
    let observer: Arc<dyn QueueObserver> = Arc::new(Counting(Arc::clone(metrics)));
    let runner = {
        let (config, observer) = (config.clone(), observer.clone());
        tokio::task::spawn_blocking(move || worker::runner(&config, observer))
            .await
            .map_err(|error| service(&error))??
    };
    Ok(Arc::new(WorkerPool::start(
        store.clone(),
        WorkerOptions {
            workers: config.workers,
            threads: config.job_threads(),
            lease: config.lease_seconds,
            heartbeat: config.heartbeat_seconds,
            stall: config.stall_seconds,
            kinds: config.kinds.clone(),
            memory,
            isolated: config.jobs_in == JobsIn::Processes,
        },
        runner,
        observer,
    )))
}

/// What tells the metrics of a worker from other lines of its log.
const METRICS: &str = "chladni::metrics";

/// Runs `chladni worker` until SIGTERM or SIGINT.
pub fn work(config: Config) -> Result<ExitCode, CliError> {
    start_logs(&config.logs)?;
    runtime()?.block_on(async {
        let mut signals = Signals::install()?;
        check(&config)?;
        if config.database.is_none() || config.workers == 0 {
            let needed = "a worker needs --database and --objects, and at least one of --workers";
            return Err(CliError::Usage(needed.to_owned()));
        }
        let accelerator = accelerator(&config.gpu).await?;
        let memory = memory_for_jobs(&config);
        // A job's heartbeat and its result, and what looks after leases and other processes.
        let store = open_store(&config, &accelerator, 3 + config.workers, true).await?;
        let metrics = Arc::new(Metrics::new()?);
        let workers = start_workers(&config, &store, &metrics, memory).await?;
        writeln!(io::stdout(), "working").map_err(CliError::stdout)?;
        tracing::info!(
            workers = config.workers,
            threads = config.job_threads(),
            memory_bytes = memory,
            gpu = accelerator.adapter().unwrap_or_else(|| "none".into()),
            version = env!("CARGO_PKG_VERSION"),
            "working"
        );
        let signal = signals.next().await;
        tracing::info!(signal, drain_seconds = config.drain_seconds.as_secs_f64(), "stopping");
        tokio::select! {
            () = workers.drain(config.drain_seconds) => {
                store.close().await;
                // It has no address at which these could be asked for.
                tracing::debug!(target: METRICS, "metrics\n{}", metrics.render());
                tracing::info!("stopped");
                Ok(ExitCode::SUCCESS)
            }
            signal = signals.next() => {
                tracing::warn!(signal, "ended without waiting; running jobs go to other workers when their leases end");
                Ok(ExitCode::from(INTERRUPTED))
            }
        }
    })
}

/// Opens the graphics card that is chosen, before jobs may ask for it.
pub(super) async fn accelerator(choice: &str) -> Result<Arc<gpu::Accelerator>, CliError> {
    let choice: gpu::GpuChoice =
        choice.parse().map_err(|reason| CliError::Usage(format!("--gpu {choice:?}: {reason}")))?;
    let failed = |error: &dyn std::fmt::Display| CliError::Service(error.to_string());
    let accelerator = tokio::task::spawn_blocking(move || {
        let accelerator = gpu::choose(choice);
        accelerator.open();
        accelerator
    })
    .await
    .map_err(|error| failed(&error))?;
    match accelerator.reason() {
        // That there is no card is as usual.
        Some(reason) if *accelerator.choice() == gpu::GpuChoice::Auto => {
            tracing::debug!(%reason, "no GPU is used");
        }
        Some(reason) => tracing::warn!(%reason, "the GPU cannot be used; running on the CPU"),
        None => {}
    }
    Ok(accelerator)
}

impl Running {
    /// The address as the beginning of a URL, without a slash at the end. An unspecified address is given as loopback.
    pub fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(match address {
                SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
            });
        }
        format!("http://{address}")
    }

    /// Reads the keys anew. Where that fails the server goes on with those it has.
    fn reload_keys(&self) {
        let allowed = self.state.config.keys_file.as_deref().map_or(Ok(()), private::keys_file);
        let reloaded = allowed
            .map_err(|error| error.to_string())
            .and_then(|()| self.state.reload_keys().map_err(|error| error.to_string()));
        match reloaded {
            Ok(keys) => tracing::info!(keys, "API keys reloaded"),
            Err(reason) => tracing::error!(reason, "the API keys are unchanged"),
        }
    }

    /// Stops in order: no new requests and jobs; running ones get the drain time; what still runs returns to the queue.
    ///
    /// # Errors
    /// [`CliError::Service`] where the server had ended with an error before.
    pub async fn stop(self) -> Result<(), CliError> {
        // The API goes on answering while jobs end, so that clients see how.
        self.state.begin_drain();
        self.workers.drain(self.drain).await;
        self.stop.cancel();
        let served = self.server.await;
        self.store.close().await;
        let ended = |reason: String| CliError::Service(format!("the server ended early: {reason}"));
        match served {
            Ok(Ok(())) => Ok(()),
            Ok(Err(error)) => Err(ended(error.to_string())),
            Err(error) => Err(ended(error.to_string())),
        }
    }
}

/// The signals that ask a server to stop.
pub(super) struct Signals {
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    #[cfg(unix)]
    interrupt: tokio::signal::unix::Signal,
    #[cfg(unix)]
    hangup: tokio::signal::unix::Signal,
}

impl Signals {
    /// Takes SIGTERM, SIGINT and SIGHUP over from now on.
    #[cfg(unix)]
    pub(super) fn install() -> Result<Self, CliError> {
        use tokio::signal::unix::{SignalKind, signal};
        let listen =
            |kind| signal(kind).map_err(|error| CliError::Service(format!("cannot listen for signals: {error}")));
        Ok(Self {
            terminate: listen(SignalKind::terminate())?,
            interrupt: listen(SignalKind::interrupt())?,
            hangup: listen(SignalKind::hangup())?,
        })
    }

    /// Takes Ctrl-C over from now on.
    #[cfg(not(unix))]
    pub(super) fn install() -> Result<Self, CliError> {
        Ok(Self {})
    }

    /// Waits for the next signal to stop and gives its name.
    #[cfg(unix)]
    pub(super) async fn next(&mut self) -> &'static str {
        tokio::select! {
            _ = self.terminate.recv() => "SIGTERM",
            _ = self.interrupt.recv() => "SIGINT",
        }
    }

    /// Waits for the next Ctrl-C.
    #[cfg(not(unix))]
    pub(super) async fn next(&mut self) -> &'static str {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
        "Ctrl-C"
    }

    /// Waits for the next SIGHUP.
    #[cfg(unix)]
    async fn hung_up(hangup: &mut tokio::signal::unix::Signal) {
        if hangup.recv().await.is_none() {
            std::future::pending::<()>().await;
        }
    }

    /// Waits for the next signal: to stop, which is named, or to read the keys anew.
    #[cfg(unix)]
    async fn next_of_all(&mut self) -> Option<&'static str> {
        tokio::select! {
            _ = self.terminate.recv() => Some("SIGTERM"),
            _ = self.interrupt.recv() => Some("SIGINT"),
            () = Self::hung_up(&mut self.hangup) => None,
        }
    }

    /// Waits for the next Ctrl-C.
    #[cfg(not(unix))]
    async fn next_of_all(&mut self) -> Option<&'static str> {
        Some(self.next().await)
    }

    /// Serves until the first signal to stop, then drains; a second one ends the process without waiting. SIGHUP reads
    /// the keys anew.
    pub(super) async fn stop_on_first(mut self, mut running: Running) -> Result<ExitCode, CliError> {
        loop {
            tokio::select! {
                signal = self.next_of_all() => match signal {
                    Some(signal) => {
                        tracing::info!(signal, drain_seconds = running.drain.as_secs_f64(), "stopping");
                        break;
                    }
                    None => running.reload_keys(),
                },
                ended = &mut running.server => {
                    return Err(CliError::Service(format!("the server ended early: {ended:?}")));
                }
            }
        }
        tokio::select! {
            stopped = running.stop() => {
                stopped?;
                tracing::info!("stopped");
                Ok(ExitCode::SUCCESS)
            }
            signal = self.next() => {
                tracing::warn!(signal, "ended without waiting; running jobs return to the queue when their leases end");
                Ok(ExitCode::from(INTERRUPTED))
            }
        }
    }
}

/// Counts what the queue does.
struct Counting(Arc<Metrics>);

impl QueueObserver for Counting {
    fn claim_took(&self, seconds: f64) {
        self.0.job_claim_seconds.observe(seconds);
    }
    fn claimed(&self, kind: &str, queue_seconds: f64) {
        self.0.job_queue_seconds.with_label_values(&[kind]).observe(queue_seconds);
    }
    fn stage_ended(&self, kind: &str, stage: &str, seconds: f64) {
        self.0.job_run_seconds.with_label_values(&[kind, stage]).observe(seconds);
    }
    fn retried(&self, _kind: &str) {
        self.0.job_retries.inc();
    }
    fn lease_lost(&self, _kind: &str) {
        self.0.leases_lost.inc();
    }
    fn memory(&self, promised: u64, total: u64) {
        self.0.job_memory_promised_bytes.set(i64::try_from(promised).unwrap_or(i64::MAX));
        self.0.job_memory_limit_bytes.set(i64::try_from(total).unwrap_or(i64::MAX));
    }
    fn died(&self, _kind: &str) {
        self.0.job_deaths.inc();
    }
    fn gpu_fell_back(&self, times: u64) {
        self.0.gpu_fallbacks.inc_by(times);
    }
    fn finished(&self, kind: &str, status: JobStatus) {
        tracing::debug!(kind, status = status.as_str(), "job finished");
    }
}
