//! Jobs, meshes, bases, fields and blobs in SQL: the only room that names sqlx.
//!
//! For one process, two SQLite databases lie in the data folder. `meta.db` knows what there is; `blobs.db` holds
//! content by its BLAKE3 hash. Content is written first (chunks pending → hash verified → ready), then one transaction
//! in `meta.db` makes it visible, so what a crash leaves behind is content that nothing refers to; it is collected an
//! hour later.
//!
//! Many processes share the records in a PostgreSQL and the content in an object store. All above `catalog.rs` and
//! `blobs.rs` is the same for both.
//!
//! | file | what |
//! |---|---|
//! | `database.rs`, `folder.rs`, `in_place.rs` | connections, write transactions, the lock of the folder, free space, files that are replaced |
//! | `catalog.rs`, `sql.rs` | where the records are, and statements for either database |
//! | `postgres.rs`, `connections.rs`, `fullness.rs`, `objects.rs`, `object_collection.rs`, `s3.rs` | records and content that many processes share |
//! | `migrate.rs` | a folder copied there |
//! | `hearing.rs`, `watch.rs`, `fleet.rs` | what such processes tell each other: of jobs, and of what workers have |
//! | `pairing.rs`, `object_identity.rs` | whether the two databases, or the database and the object store, belong together |
//! | `blobs.rs`, `blob_writing.rs`, `orphans.rs` | content in chunks, and what becomes of it when nothing refers to it |
//! | `backup.rs`, `restore.rs` | copies of a folder in use, and folders made of them |
//! | `integrity.rs`, `doctor.rs` | whether content is what was stored, and what is done where it is not |
//! | `meshes.rs`, `problems.rs`, `bases.rs`, `fields.rs`, `jobs.rs` | what clients see |
//! | `parts.rs`, `part_source.rs` | one job in parts, which are jobs as well; what they made, for who joins it |
//! | `job_bases.rs` | the bases that a job works on, and that stay for as long |
//! | `sources.rs`, `collection.rs` | what meshes and problems have in common; several shapes of one job |
//! | `health.rs` | how the storage feels |
//! | `last_use.rs`, `retention.rs`, `space.rs` | what is kept, and for how long; room, and how it comes back |
//! | `columns.rs` | dense bases: written as they are computed, read in chunks |
//! | `claims.rs`, `leases.rs`, `deaths.rs` | what workers do: claim, heartbeat, complete, fail, release, reap; and what becomes of a job whose process died |
//! | `shortcuts.rs` | what nearly always happens, in one statement where records are shared |
//! | `fault.rs` | points at which a test makes the process die |

mod backup;
mod bases;
mod blob_writing;
mod blobs;
mod catalog;
mod claims;
mod clock;
mod collection;
mod columns;
#[cfg(feature = "cluster")]
mod connections;
mod database;
mod deaths;
mod doctor;
mod error;
pub mod fault;
mod fields;
mod fleet;
mod folder;
#[cfg(feature = "cluster")]
mod fullness;
mod health;
#[cfg(feature = "cluster")]
mod hearing;
mod in_place;
mod integrity;
mod job_bases;
mod jobs;
mod last_use;
mod leases;
mod meshes;
#[cfg(feature = "cluster")]
mod migrate;
mod migrations;
#[cfg(feature = "cluster")]
mod object_collection;
#[cfg(feature = "cluster")]
mod object_identity;
#[cfg(feature = "cluster")]
mod objects;
mod orphans;
mod pagination;
mod pairing;
mod part_source;
mod parts;
mod piece_writer;
#[cfg(feature = "cluster")]
mod postgres;
mod problems;
mod records;
mod restore;
mod retention;
#[cfg(feature = "cluster")]
mod s3;
#[cfg(feature = "cluster")]
mod shortcuts;
mod sources;
mod space;
mod sql;
#[cfg(test)]
pub(crate) mod tests;
mod watch;

use std::{
    fmt,
    path::PathBuf,
    sync::{
        Arc, Mutex,
        atomic::{AtomicI64, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use quick_cache::{OptionsBuilder, Weighter, sync::Cache};
use tokio::sync::{Notify, RwLock, broadcast};
use uuid::Uuid;

use blobs::Blobs;
use catalog::Catalog;
use chladni_spectral::basis::{ColumnChunk, Product};
use database::{Database, DatabaseSettings};
use folder::DataFolder;

pub use backup::{BackupReport, backup};
pub use claims::{Claim, Company};
pub use clock::Clock;
pub use doctor::{Examination, Finding};
pub use error::{DAMAGE, StoreError, uses};
pub use fleet::Worker;
pub use leases::{CompleteAnswer, FailAnswer, HeartbeatAnswer, Progress, Reaped};
#[cfg(feature = "cluster")]
pub use migrate::{Migrated, MigrationError};
pub use pagination::{Page, PageRequest};
pub use part_source::PartSource;
pub use parts::{DivideAnswer, MadePart, NewPart, PartRecord};
pub use records::{
    BasisFilter, BasisRecord, BasisStorage, CacheStatistics, EnqueueOutcome, Enqueued, FieldFilter, FieldRecord,
    IdempotencyKey, JobEvent, JobFilter, JobProblem, JobRecord, JobStatus, MeshRecord, NewField, NewJob, NewMesh,
    NewProblem, ProblemRecord, StoreHealth, Stored, UnknownStatus,
};
pub use restore::restore;
pub use retention::{Removed, Retention};
pub use sources::{CollectedShape, Subject};
pub use space::Compacted;
pub use watch::JobWatch;

/// Job events that a slow listener may fall behind by.
const EVENTS_KEPT: usize = 1024;

/// An object store that answers nothing is waited for so long at the start.
#[cfg(feature = "cluster")]
const START_PATIENCE: Duration = Duration::from_secs(10);

/// Where records and content are that many processes share.
#[derive(Clone, PartialEq, Eq)]
pub struct SharedPlaces {
    /// The address of a PostgreSQL: `postgres://USER:PASSWORD@HOST/DATABASE`.
    pub database: String,
    /// The same database with no pooler between, where [`database`](Self::database) leads to one that gives connections
    /// out by transaction: for the tables when it is opened, and to hear.
    pub direct: Option<String>,
    /// The address of an object store: `s3://BUCKET/PREFIX?endpoint=…&region=…`, or `file:///FOLDER` for a folder that
    /// every process sees.
    pub objects: String,
}

impl fmt::Debug for SharedPlaces {
    /// Without the address of the database, which may hold a password.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("SharedPlaces").field("objects", &self.objects).finish_non_exhaustive()
    }
}

/// How a store is opened.
#[derive(Debug, Clone)]
pub struct StoreOptions {
    /// The data folder; made where it is missing.
    pub folder: PathBuf,
    /// Where records and content are shared with other processes; then nothing is in the folder.
    pub shared: Option<SharedPlaces>,
    /// The most connections to a database that is shared, beside the one that hears: such a database has a hundred, as
    /// a rule, for all processes.
    pub connections: u32,
    /// Whether nobody asks this process how jobs fare: of what processes tell each other it hears of work alone.
    pub hears_of_work_alone: bool,
    /// Bytes of decoded bases and meshes that are kept in memory: a quarter is for meshes, a quarter for chunks of
    /// dense bases.
    pub cache_bytes: u64,
    /// New content is refused where it would leave fewer bytes than these free.
    pub least_free_bytes: u64,
    /// The most bytes of the blob database; no limit without one.
    pub blob_bytes_limit: Option<u64>,
    /// The most jobs that may wait; no limit without one.
    pub queued_jobs_limit: Option<u64>,
    /// How long a statement waits for a lock before it is [`StoreError::Busy`].
    pub busy_timeout: Duration,
    /// The pause after a first failed attempt; it doubles with each further one, up to [`StoreOptions::LONGEST_PAUSE`].
    pub retry_pause: Duration,
    /// The time.
    pub clock: Clock,
    /// What is kept, and for how long.
    pub retention: Retention,
    /// Pair databases that do not belong together as they are, instead of refusing them.
    pub pair_anyway: bool,
    /// Faults for tests.
    pub faults: fault::Faults,
}

impl StoreOptions {
    /// The longest pause after a failed attempt.
    pub const LONGEST_PAUSE: Duration = Duration::from_secs(60);

    /// The defaults for a folder.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
            shared: None,
            connections: 10,
            hears_of_work_alone: false,
            cache_bytes: 1 << 30,
            least_free_bytes: 256 << 20,
            blob_bytes_limit: None,
            queued_jobs_limit: None,
            busy_timeout: Duration::from_secs(5),
            retry_pause: Duration::from_secs(1),
            clock: Clock::system(),
            retention: Retention::default(),
            pair_anyway: false,
            faults: fault::Faults::default(),
        }
    }
}

/// The store: cheap to clone. Its calls need a tokio runtime and block none of its threads.
#[derive(Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

struct Inner {
    options: StoreOptions,
    catalog: Catalog,
    blobs: Blobs,
    /// Where nothing is shared.
    folder: Option<DataFolder>,
    #[cfg(feature = "cluster")]
    hearing: std::sync::OnceLock<hearing::Hearing>,
    events: broadcast::Sender<JobEvent>,
    work: Notify,
    parts: Notify,
    fleet: fleet::Fleet,
    /// Why a result waited for the storage when it was last tried to be stored, and when that was.
    delay: Mutex<Option<(Instant, &'static str)>>,
    #[cfg(feature = "cluster")]
    room: shortcuts::Room,
    /// Held for reading from the moment a blob is written or found until something refers to it, and for writing while
    /// blobs that nothing refers to are deleted.
    blob_use: RwLock<()>,
    /// When orphans were last looked for.
    orphans_looked_ms: AtomicI64,
    /// When meshes and bases were used.
    uses: last_use::Uses,
    /// Bytes of free pages within the blob database.
    reusable_bytes: AtomicU64,
    /// When retention was last looked after.
    retained_ms: AtomicI64,
    /// Which blobs were seen to be whole or damaged.
    known: integrity::KnownBlobs,
    bases: Cache<Uuid, Weighed<Product>, ByWeight>,
    /// Chunks of dense bases, by the hash of the content and the position.
    chunks: Cache<(String, usize), Weighed<Arc<ColumnChunk>>, ByWeight>,
    meshes: Cache<String, Weighed<meshes::Decoded>, ByWeight>,
    hits: AtomicU64,
    misses: AtomicU64,
}

impl fmt::Debug for Store {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Store").field("options", &self.inner.options).finish_non_exhaustive()
    }
}

/// A cached value, cheap to clone, and the bytes it counts for.
#[derive(Clone)]
struct Weighed<T> {
    value: T,
    bytes: u64,
}

#[derive(Debug, Clone, Copy)]
struct ByWeight;

impl<K, T> Weighter<K, Weighed<T>> for ByWeight {
    fn weight(&self, _key: &K, value: &Weighed<T>) -> u64 {
        value.bytes.max(1)
    }
}

impl Store {
    /// Opens the data folder: makes it where it is missing, locks it, checks the databases and brings them up to date,
    /// gives jobs back to the queue that a dead process was running, and looks for content that nothing refers to. Of
    /// places that are shared, nothing is taken from others.
    ///
    /// # Errors
    /// [`StoreError::FolderInUse`] where another process has it open; [`StoreError::Mismatch`] where its databases do
    /// not belong together, and nothing is changed; [`StoreError::Version`], [`StoreError::DatabaseVersion`],
    /// [`StoreError::Corrupt`], [`StoreError::Folder`] where it cannot be used.
    pub async fn open(options: StoreOptions) -> Result<Self, StoreError> {
        match options.shared.clone() {
            None => Self::open_folder(options).await,
            #[cfg(feature = "cluster")]
            Some(places) => Self::open_shared(options, &places).await,
            #[cfg(not(feature = "cluster"))]
            Some(_) => {
                let detail = "this build has no feature `cluster`, which sharing needs".to_owned();
                Err(StoreError::Unavailable { detail })
            }
        }
    }

    #[cfg(feature = "cluster")]
    async fn open_shared(mut options: StoreOptions, places: &SharedPlaces) -> Result<Self, StoreError> {
        let postgres = postgres::Postgres::open(places, options.connections, options.busy_timeout).await?;
        options.clock = options.clock.shared();
        postgres.set(&options.clock).await?;
        let objects = objects::Objects::open(&places.objects, postgres.clone())?;
        // One that does not answer yet is waited for when it is needed; one that refuses will go on refusing.
        match tokio::time::timeout(START_PATIENCE, objects.check_pairing()).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) if !error.is_retryable() => return Err(error),
            Ok(Err(error)) => tracing::warn!(%error, "the object store does not answer yet"),
            Err(_) => tracing::warn!(
                objects = objects.name(),
                "the object store has not answered for {} s",
                START_PATIENCE.as_secs()
            ),
        }
        tracing::info!(objects = objects.name(), "records and content are shared with other processes");
        let store = Self::new(options, Catalog::Postgres(postgres), Blobs::Objects(objects), None)?;
        let alone = store.inner.options.hears_of_work_alone;
        let hearing = hearing::Hearing::start(Arc::downgrade(&store.inner), alone);
        let _first = store.inner.hearing.set(hearing);
        Ok(store)
    }

    fn new(
        options: StoreOptions,
        catalog: Catalog,
        blobs: Blobs,
        folder: Option<DataFolder>,
    ) -> Result<Self, StoreError> {
        let quarter = options.cache_bytes / 4;
        Ok(Self {
            inner: Arc::new(Inner {
                bases: cache(options.cache_bytes - 2 * quarter)?,
                chunks: cache(quarter)?,
                meshes: cache(quarter)?,
                options,
                catalog,
                blobs,
                folder,
                #[cfg(feature = "cluster")]
                hearing: std::sync::OnceLock::new(),
                events: broadcast::channel(EVENTS_KEPT).0,
                work: Notify::new(),
                parts: Notify::new(),
                fleet: fleet::Fleet::default(),
                delay: Mutex::default(),
                #[cfg(feature = "cluster")]
                room: shortcuts::Room::default(),
                blob_use: RwLock::new(()),
                orphans_looked_ms: AtomicI64::new(0),
                uses: last_use::Uses::default(),
                reusable_bytes: AtomicU64::new(0),
                retained_ms: AtomicI64::new(0),
                known: integrity::KnownBlobs::default(),
                hits: AtomicU64::new(0),
                misses: AtomicU64::new(0),
            }),
        })
    }

    async fn open_folder(options: StoreOptions) -> Result<Self, StoreError> {
        let mut folder = {
            let path = options.folder.clone();
            blobs::blocking(move || DataFolder::open(&path)).await??
        };
        if !options.pair_anyway {
            pairing::check_files(&folder)?;
        }
        folder.lock_database()?;
        let settings = |page_bytes, limit: Option<u64>, readers| DatabaseSettings {
            busy_timeout: options.busy_timeout,
            page_bytes,
            most_pages: limit.map(|bytes| (bytes / u64::from(page_bytes)).max(1)),
            readers,
        };
        let meta = Database::open(&folder.file("meta.db"), settings(4096, None, 4), &migrations::meta()).await?;
        if !options.pair_anyway {
            pairing::check_content(&folder, &meta).await?;
        }
        let blob_settings = settings(blobs::PAGE_BYTES, options.blob_bytes_limit, 4);
        let blobs = Database::open(&folder.file("blobs.db"), blob_settings, &migrations::blobs()).await?;
        pairing::pair(&folder, &meta, &blobs, options.pair_anyway).await?;
        let store = Self::new(options, Catalog::Sqlite(meta), Blobs::Chunks(blobs), Some(folder))?;
        store.count_reusable().await?;
        let reaped = store.recover().await?;
        let unfinished = store.delete_pending().await?;
        let look = store.look_for_orphans().await?;
        if reaped.is_empty() && unfinished + look.condemned + look.deleted == 0 {
            tracing::debug!("opened the store");
        } else {
            tracing::info!(
                jobs_recovered = reaped.len(),
                blobs_unfinished = unfinished,
                blobs_condemned = look.condemned,
                blobs_deleted = look.deleted,
                "opened the store after an early end"
            );
        }
        Ok(store)
    }

    /// Waits for running statements and closes the databases. Later calls are [`StoreError::Unavailable`].
    pub async fn close(&self) {
        let ended = async {
            self.write_uses().await?;
            self.keep_pair().await
        };
        if let Err(error) = ended.await {
            tracing::debug!(%error, "the last notes could not be recorded");
        }
        #[cfg(feature = "cluster")]
        if let Some(hearing) = self.inner.hearing.get() {
            hearing.stop();
        }
        self.inner.catalog.close().await;
        if let Some(blobs) = self.inner.blobs.sqlite() {
            blobs.close().await;
        }
    }

    /// What is due now and then: forgets old idempotency keys, deletes what is not kept, looks for orphans, gives free
    /// pages back, tells each database of the other.
    async fn maintain(&self) -> Result<(), StoreError> {
        self.inner.catalog.set(&self.inner.options.clock).await?;
        self.forget_old_keys().await?;
        self.retain_in_turn().await?;
        self.look_for_orphans_in_turn().await?;
        self.give_back().await?;
        self.keep_pair().await
    }

    /// What the caches did so far.
    pub fn cache_statistics(&self) -> CacheStatistics {
        CacheStatistics {
            hits: self.inner.hits.load(Ordering::Relaxed),
            misses: self.inner.misses.load(Ordering::Relaxed),
            bytes: self.inner.bases.weight() + self.inner.chunks.weight() + self.inner.meshes.weight(),
        }
    }

    /// Every change of every job from now on. A listener that lags misses events and has to read its job again.
    pub fn watch_jobs(&self) -> broadcast::Receiver<JobEvent> {
        self.inner.events.subscribe()
    }

    /// Rings once for each job that becomes ready; a bell that nobody waits for is kept for the next who does.
    pub fn work(&self) -> &Notify {
        &self.inner.work
    }

    /// Rings where a part has changed, or a job that was divided: then [`maintain_parts`](Self::maintain_parts) may
    /// have something to do.
    pub fn parts(&self) -> &Notify {
        &self.inner.parts
    }

    fn parts_changed(&self) {
        self.inner.parts.notify_one();
    }

    /// The faults that a test armed.
    pub fn faults(&self) -> &fault::Faults {
        &self.inner.options.faults
    }

    /// The store's time, in milliseconds since 1970.
    pub fn now_ms(&self) -> i64 {
        self.inner.options.clock.now_ms()
    }

    /// Tells listeners about a job, after the commit.
    fn announce(&self, job: &JobRecord) {
        // Parts that wait or run have nothing to tell.
        if job.parts > 0 || (job.is_part() && job.status.is_finished()) {
            self.parts_changed();
        }
        self.announce_event(JobEvent {
            job: job.id,
            revision: job.revision,
            status: job.status,
            cancel_requested: job.cancel_requested,
        });
    }

    /// Tells listeners about a change of a job, after the commit; those of other processes too, where the records are
    /// shared.
    fn announce_event(&self, event: JobEvent) {
        #[cfg(feature = "cluster")]
        if let Some(hearing) = self.inner.hearing.get() {
            hearing.publish(&event);
        }
        self.tell_here(event, true);
    }

    /// Tells the listeners of this process, and its workers where they are called.
    fn tell_here(&self, event: JobEvent, called: bool) {
        if called && event.status == JobStatus::Enqueued {
            self.inner.work.notify_one();
        }
        // Nobody listening is no trouble.
        let _ = self.inner.events.send(event);
    }

    fn count_hit(&self, hit: bool) {
        let counter = if hit { &self.inner.hits } else { &self.inner.misses };
        counter.fetch_add(1, Ordering::Relaxed);
    }
}

/// A cache of so many bytes. One shard: with more, each would hold its part only, and a large basis would fit in none.
fn cache<K: Eq + std::hash::Hash, T: Clone>(bytes: u64) -> Result<Cache<K, Weighed<T>, ByWeight>, StoreError> {
    let options = OptionsBuilder::new()
        .shards(1)
        .estimated_items_capacity(256)
        .weight_capacity(bytes)
        .build()
        .map_err(|error| StoreError::Unavailable { detail: format!("the cache: {error}") })?;
    Ok(Cache::with_options(options, ByWeight, Default::default(), Default::default()))
}

/// Runs work to its end even if the caller goes away: a client that disconnects leaves nothing half done.
async fn detached<T: Send + 'static>(
    work: impl Future<Output = Result<T, StoreError>> + Send + 'static,
) -> Result<T, StoreError> {
    tokio::spawn(work)
        .await
        .map_err(|error| StoreError::Unavailable { detail: format!("a task ended early: {error}") })?
}

/// Decodes a JSON column.
fn from_json<T: serde::de::DeserializeOwned>(column: &str, text: &str) -> Result<T, StoreError> {
    serde_json::from_str(text).map_err(|error| StoreError::Corrupt { detail: format!("column {column}: {error}") })
}

/// Encodes a JSON column.
fn to_json<T: serde::Serialize + ?Sized>(value: &T) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| StoreError::Unavailable { detail: format!("JSON: {error}") })
}
