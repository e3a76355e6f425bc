//! What every request shares: the store, the settings, the metrics and the pools.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};

use tokio::sync::{Mutex, oneshot};
use tokio_util::sync::CancellationToken;

use super::auth::{ApiKey, KeyError};
use super::counted::Counted;
use super::field_cache::FieldCache;
use super::problem::Problem;
use super::shares::Shares;
use super::slots::Slots;
use super::turns::Turns;
use crate::config::{Config, ConfigError, cores};
use crate::store::{Store, StoreError, StoreHealth};
use crate::telemetry::Metrics;

/// Solves that may wait for each thread of the solve pool; further ones are told to come back.
const SOLVES_PER_THREAD: usize = 64;

/// Requests that are worked on at once for each core: enough that none is idle while some wait for the store, and so
/// few that whoever comes next waits for a millisecond or two.
const SLOTS_PER_CORE: usize = 4;

/// The memory for requests beside two bodies of the largest size, in bytes.
const SMALL_REQUESTS: u64 = 64 << 20;

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
    /// All keys would be gone, and the server open to everyone.
    #[error("the keys file has no keys left; a server that has keys does not go on without")]
    NoKeysLeft,
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
    keys: RwLock<Arc<[ApiKey]>>,
    /// Bytes that requests hold: their bodies, as they come and decompressed, and what is parsed of them.
    pub(super) request_memory: Shares,
    /// Event streams and long polls that are open at once.
    pub(super) watchers: Shares,
    /// Ends when connections are to end: long polls and event streams stop then.
    pub(super) closing: CancellationToken,
    /// Surfaces, alignments and models that outlive a request.
    pub(super) fields: FieldCache,
    pub(super) solves: rayon::ThreadPool,
    /// Requests that are worked on at once, of those that only read.
    pub(super) slots: Slots,
    /// Whose solve is next.
    pub(super) solve_turns: Turns,
    /// Synchronous solves that wait or run.
    pub(super) solve_places: Shares,
    intake: rayon::ThreadPool,
    workers_alive: Box<dyn Fn() -> bool + Send + Sync>,
    refuse: AtomicBool,
    health: Mutex<Option<(Instant, StoreHealth)>>,
    /// What cache counters were already raised to.
    pub(super) counted: Counted,
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
        let keys = configured_keys(&config)?;
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
        Ok(Self(Arc::new(Shared {
            store,
            metrics,
            keys: RwLock::new(keys),
            // Two bodies of the largest size, or many small ones.
            request_memory: Shares::new(config.limits.max_body_bytes.saturating_mul(2).saturating_add(SMALL_REQUESTS)),
            watchers: Shares::new((config.max_connections / 2).max(1) as u64),
            closing: CancellationToken::new(),
            fields: FieldCache::new(config.cache_bytes),
            solves: pool("synchronous solves", "solve")?,
            solve_turns: Turns::default(),
            slots: Slots::new(SLOTS_PER_CORE * cores()),
            solve_places: Shares::new((threads * SOLVES_PER_THREAD) as u64),
            intake: pool("reading meshes", "intake")?,
            workers_alive: Box::new(workers_alive),
            refuse: AtomicBool::new(false),
            health: Mutex::new(None),
            counted: Counted::default(),
            config,
        })))
    }

    /// Begins to drain: `readyz` says so and nothing new is accepted, while everything that can be read still can, so
    /// that clients see their running jobs end. [`serve`](super::serve) closes connections once it is told to stop.
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

    /// Who may call; empty: everyone.
    pub fn keys(&self) -> Arc<[ApiKey]> {
        self.keys.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Reads the keys anew from the file of keys. Requests that run go on as they were admitted.
    ///
    /// # Errors
    /// [`StateError`]: the file cannot be read, a key is malformed, or a server that had keys would be left without
    /// any. The keys stay as they were then.
    pub fn reload_keys(&self) -> Result<usize, StateError> {
        let keys = configured_keys(&self.config)?;
        if keys.is_empty() && !self.keys().is_empty() {
            return Err(StateError::NoKeysLeft);
        }
        let count = keys.len();
        *self.keys.write().unwrap_or_else(PoisonError::into_inner) = keys;
        Ok(count)
    }

    /// Runs a query of the store whose rows hold large texts, such as the parameters of jobs: they are parsed on a
    /// thread where that delays nobody else.
    ///
    /// # Errors
    /// Whatever `query` answers.
    pub async fn off_loop<T: Send + 'static>(
        &self,
        query: impl Future<Output = Result<T, StoreError>> + Send + 'static,
    ) -> Result<T, Problem> {
        let runtime = tokio::runtime::Handle::current();
        let answered = tokio::task::spawn_blocking(move || runtime.block_on(query)).await;
        Ok(answered.map_err(Problem::internal)??)
    }

    /// Runs the reading and checking of an upload on a pool of its own.
    ///
    /// # Errors
    /// Whatever `work` answers.
    pub async fn on_intake_pool<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        on_pool(&self.intake, work).await
    }
}

fn configured_keys(config: &Config) -> Result<Arc<[ApiKey]>, StateError> {
    let keys: Vec<ApiKey> =
        config.all_keys()?.entries().iter().map(|entry| entry.parse()).collect::<Result<_, KeyError>>()?;
    Ok(keys.into())
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
