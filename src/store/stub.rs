//! Signatures first; bodies follow.
#![allow(unused_variables, missing_docs)]

use std::{ops::Range, path::PathBuf, sync::Arc};

use bytes::Bytes;
use futures_util::{Stream, stream};
use tokio::sync::broadcast;
use uuid::Uuid;

use super::*;
use crate::{basis::Basis, mesh::TriangleMesh};

/// How a store is opened.
#[derive(Debug, Clone)]
pub struct StoreOptions {
    /// The data folder; made where it is missing.
    pub folder: PathBuf,
    /// Bytes of decoded bases and meshes that are kept in memory.
    pub cache_bytes: u64,
    /// New content is refused when fewer bytes than these are free.
    pub least_free_bytes: u64,
    /// The most bytes of the blob database; no limit without one.
    pub blob_bytes_limit: Option<u64>,
    /// How long a statement waits for a lock before it is [`StoreError::Busy`].
    pub busy_timeout: std::time::Duration,
    /// The first pause after a failed attempt; it doubles with each further one, up to a minute.
    pub retry_pause: std::time::Duration,
    /// Faults for tests.
    pub faults: fault::Faults,
}

impl StoreOptions {
    /// The defaults for a folder.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
            cache_bytes: 1 << 30,
            least_free_bytes: 256 << 20,
            blob_bytes_limit: None,
            busy_timeout: std::time::Duration::from_secs(5),
            retry_pause: std::time::Duration::from_secs(1),
            faults: fault::Faults::default(),
        }
    }
}

/// The store: cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    events: broadcast::Sender<JobEvent>,
}

fn unfinished<T>() -> Result<T, StoreError> {
    Err(StoreError::Unavailable { detail: "not built yet".to_owned() })
}

impl Store {
    /// Opens the data folder, making it where it is missing.
    pub async fn open(options: StoreOptions) -> Result<Self, StoreError> {
        Ok(Self { events: broadcast::channel(1024).0 })
    }
    /// Finishes writes and lets the folder go. Later calls are refused.
    pub async fn close(&self) {}
    pub async fn health(&self) -> StoreHealth {
        StoreHealth {
            writable: true,
            reason: None,
            full: false,
            free_bytes: None,
            least_free_bytes: 0,
            wal_bytes: 0,
            blob_bytes: 0,
        }
    }
    pub fn cache_statistics(&self) -> CacheStatistics {
        CacheStatistics::default()
    }

    pub async fn add_mesh(&self, new: NewMesh) -> Result<Stored<MeshRecord>, StoreError> {
        unfinished()
    }
    pub async fn mesh(&self, id: &str) -> Result<MeshRecord, StoreError> {
        unfinished()
    }
    pub async fn meshes(&self, page: &PageRequest) -> Result<Page<MeshRecord>, StoreError> {
        unfinished()
    }
    /// With `cascade`, unfinished jobs on it are cancelled and its bases deleted; without, either is [`StoreError::MeshInUse`].
    pub async fn delete_mesh(&self, id: &str, cascade: bool) -> Result<(), StoreError> {
        unfinished()
    }
    pub async fn load_mesh(&self, id: &str) -> Result<Arc<TriangleMesh>, StoreError> {
        unfinished()
    }

    pub async fn enqueue(&self, new: NewJob) -> Result<Enqueued, StoreError> {
        unfinished()
    }
    pub async fn job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        unfinished()
    }
    pub async fn jobs(&self, filter: &JobFilter, page: &PageRequest) -> Result<Page<JobRecord>, StoreError> {
        unfinished()
    }
    /// How many jobs there are of each kind in each status.
    pub async fn job_counts(&self) -> Result<Vec<(String, JobStatus, u64)>, StoreError> {
        unfinished()
    }
    /// Idempotent: enqueued → cancelled at once, processing → asked to stop, cancelled → unchanged; a job that
    /// succeeded or failed is [`StoreError::JobState`].
    pub async fn cancel_job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        unfinished()
    }
    /// Failed or cancelled → enqueued with attempts reset; unfinished → unchanged; succeeded is [`StoreError::JobState`].
    pub async fn retry_job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        unfinished()
    }
    /// Every change of every job from now on. On `Lagged`, read the job again.
    pub fn watch_jobs(&self) -> broadcast::Receiver<JobEvent> {
        self.events.subscribe()
    }

    pub async fn basis(&self, id: Uuid) -> Result<BasisRecord, StoreError> {
        unfinished()
    }
    pub async fn bases(&self, filter: &BasisFilter, page: &PageRequest) -> Result<Page<BasisRecord>, StoreError> {
        unfinished()
    }
    pub async fn delete_basis(&self, id: Uuid) -> Result<(), StoreError> {
        unfinished()
    }
    /// The decoded basis, from the cache or verified and decoded once however many ask.
    pub async fn load_basis(&self, id: Uuid) -> Result<Arc<Basis>, StoreError> {
        unfinished()
    }

    /// Bytes of a blob, by its hash: `MeshRecord::content_hash`, `BasisRecord::content_hash`.
    pub async fn blob_length(&self, hash: &str) -> Result<u64, StoreError> {
        unfinished()
    }
    /// A range of a blob in one piece.
    pub async fn blob_bytes(&self, hash: &str, range: Range<u64>) -> Result<Bytes, StoreError> {
        unfinished()
    }
    /// A range of a blob, chunk by chunk; no read transaction is open between chunks.
    pub fn blob_stream(
        &self,
        hash: &str,
        range: Range<u64>,
    ) -> impl Stream<Item = Result<Bytes, StoreError>> + Send + 'static {
        stream::empty()
    }
}
