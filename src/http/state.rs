//! What every request shares: the store, the settings, the metrics and the pools.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::{Mutex, Semaphore, oneshot};
use tokio_util::sync::CancellationToken;

use super::auth::{ApiKey, KeyError};
use super::body::BUDGET_UNIT;
use super::fields::FieldCache;
use super::problem::{self, Problem};
use crate::config::{Config, ConfigError};
use crate::store::{Store, StoreHealth};
use crate::telemetry::Metrics;

/// Solves that may wait for each thread of the solve pool; further ones are told to come back.
const SOLVES_PER_THREAD: usize = 64;

/// For how long the health of the store is remembered: looking at it writes.
const HEALTH_AGE: Duration = Duration::from_millis(500);

/// Why a server could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// A key is malformed.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// The keys could not be read.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A thread pool could not be started.
    #[error("the threads for {purpose} could not be started: {source}")]
    Threads {
        /// What the threads are for.
        purpose: &'static str,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
    /// An origin is no header value.
    #[error("the CORS origin {0:?} is not an origin such as https://example.org")]
    Origin(String),
}

/// What every request shares; cheap to clone.
#[derive(Clone)]
pub struct AppState(Arc<Shared>);

/// The contents of [`AppState`].
pub struct Shared {
    /// Meshes, jobs and bases.
    pub store: Store,
    /// Every setting.
    pub config: Config,
    /// What is counted.
    pub metrics: Arc<Metrics>,
    /// Who may call; empty: everyone.
    pub keys: Vec<ApiKey>,
    /// Bytes of request bodies that are held at once, in units of [`BUDGET_UNIT`].
    pub(super) body_budget: Arc<Semaphore>,
    /// Ends when connections are to end: long polls and event streams stop then.
    pub(super) closing: CancellationToken,
    /// Surfaces, alignments and models that outlive a request.
    pub(super) fields: FieldCache,
    solves: rayon::ThreadPool,
    solve_places: Arc<Semaphore>,
    intake: rayon::ThreadPool,
    workers_alive: Box<dyn Fn() -> bool + Send + Sync>,
    refuse: AtomicBool,
    health: Mutex<Option<(Instant, StoreHealth)>>,
    /// What cache counters were already raised to.
    pub(super) counted: super::system::Counted,
}

impl std::ops::Deref for AppState {
    type Target = Shared;
    fn deref(&self) -> &Shared {
        &self.0
    }
}

impl std::fmt::Debug for AppState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AppState").finish_non_exhaustive()
    }
}

impl AppState {
    /// Shares what requests need; `workers_alive` tells whether the worker pool can still run jobs.
    ///
    /// # Errors
    /// [`StateError`] where a key or an origin is malformed or threads cannot be started.
    pub fn new(
        store: Store,
        config: Config,
        metrics: Arc<Metrics>,
        workers_alive: impl Fn() -> bool + Send + Sync + 'static,
    ) -> Result<Self, StateError> {
        let keys =
            config.all_keys()?.entries().iter().map(|entry| entry.parse()).collect::<Result<Vec<_>, KeyError>>()?;
        for origin in &config.cors_origins {
            if axum::http::HeaderValue::from_str(origin).is_err() || origin.is_empty() {
                return Err(StateError::Origin(origin.clone()));
            }
        }
        let threads = config.reduced_solve_threads();
        let pool = |purpose: &'static str, prefix: &'static str| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .thread_name(move |i| format!("{prefix}-{i}"))
                .build()
                .map_err(|source| StateError::Threads { purpose, source })
        };
        // Two bodies of the largest size, or many small ones.
        let budget = (2 * config.limits.max_body_bytes).div_ceil(BUDGET_UNIT) + 1024;
        let budget = usize::try_from(budget).unwrap_or(usize::MAX).min(Semaphore::MAX_PERMITS);
        Ok(Self(Arc::new(Shared {
            store,
            metrics,
            keys,
            body_budget: Arc::new(Semaphore::new(budget)),
            closing: CancellationToken::new(),
            fields: FieldCache::new(config.cache_bytes / 2),
            solves: pool("synchronous solves", "solve")?,
            solve_places: Arc::new(Semaphore::new(threads * SOLVES_PER_THREAD)),
            intake: pool("reading meshes", "intake")?,
            workers_alive: Box::new(workers_alive),
            refuse: AtomicBool::new(false),
            health: Mutex::new(None),
            counted: super::system::Counted::default(),
            config,
        })))
    }

    /// Begins to drain: `readyz` says so and nothing new is accepted, while everything that can be read still can, so that
    /// clients see their running jobs end. [`serve`](super::serve) closes connections once it is told to stop.
    pub fn begin_drain(&self) {
        self.refuse.store(true, Ordering::Relaxed);
    }

    /// Whether the server drains.
    pub fn is_draining(&self) -> bool {
        self.refuse.load(Ordering::Relaxed)
    }

    /// Whether the worker pool can still run jobs.
    pub fn workers_alive(&self) -> bool {
        (self.workers_alive)()
    }

    /// The health of the store, at most half a second old.
    pub async fn store_health(&self) -> StoreHealth {
        let mut known = self.health.lock().await;
        if let Some((when, health)) = known.as_ref()
            && when.elapsed() < HEALTH_AGE
        {
            return health.clone();
        }
        let health = self.store.health().await;
        *known = Some((Instant::now(), health.clone()));
        health
    }

    /// Runs a synchronous solve on its own small pool, so that neither jobs nor uploads starve it.
    ///
    /// # Errors
    /// `busy` where too many solves wait, and whatever `work` answers.
    pub async fn solve<T: Send + 'static>(
        &self,
        operation: &'static str,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let place = self
            .solve_places
            .clone()
            .try_acquire_owned()
            .map_err(|_| Problem::new(&problem::BUSY, "Too many solves are waiting.").retry_after(1))?;
        let begin = Instant::now();
        let result = on_pool(&self.solves, work).await;
        drop(place);
        self.metrics.reduced_solve_seconds.with_label_values(&[operation]).observe(begin.elapsed().as_secs_f64());
        result
    }

    /// Runs the reading and checking of an upload on a pool of its own.
    ///
    /// # Errors
    /// Whatever `work` answers.
    pub async fn take_in<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        on_pool(&self.intake, work).await
    }
}

async fn on_pool<T: Send + 'static>(
    pool: &rayon::ThreadPool,
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let (sender, receiver) = oneshot::channel();
    pool.spawn(move || {
        // A panic that left the closure would end the process.
        let result =
            catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(Problem::internal("the work panicked")));
        let _receiver_is_gone = sender.send(result);
    });
    receiver.await.map_err(|_| Problem::internal("the pool dropped the work"))?
}
