//! How the storage feels: whether it can be written and reached, and what a result waits for.

use std::{
    sync::PoisonError,
    time::{Duration, Instant},
};

use super::{Store, StoreError, StoreHealth, database::Database, error::SILENT};

/// Where processes share what they have, this is how long its health is waited for.
const HEALTH_PATIENCE: Duration = Duration::from_secs(3);

/// Whatever makes a result wait is tried again more often than this.
const DELAY_KNOWN: Duration = Duration::from_secs(8);

impl Store {
    /// How the storage feels; tries a small write in both databases.
    pub async fn health(&self) -> StoreHealth {
        let now_ms = self.now_ms();
        let write = async {
            self.inner.catalog.check_writable(now_ms).await?;
            match self.inner.blobs.sqlite() {
                Some(blobs) => blobs.check_writable(now_ms).await,
                None => Ok(()),
            }
        };
        // Whoever asks wants to know now: what does not answer for seconds is not ready.
        let silent = |what: &str| StoreError::Unavailable {
            detail: format!("{what} has not answered for {} s", HEALTH_PATIENCE.as_secs()),
        };
        let written = async {
            if !self.is_shared() {
                return write.await;
            }
            tokio::time::timeout(HEALTH_PATIENCE, write).await.unwrap_or_else(|_| Err(silent("the database")))
        };
        let reached = async {
            tokio::time::timeout(HEALTH_PATIENCE, self.inner.blobs.reach())
                .await
                .unwrap_or_else(|_| Err(silent("the object store")))
        };
        let (written, reached) = tokio::join!(written, reached);
        let blob_bytes = if written.is_ok() { self.all_blob_bytes().await.unwrap_or(0) } else { 0 };
        let space = self.check_space(0);
        let full = space.is_err() || matches!(written, Err(StoreError::StorageFull { .. }));
        StoreHealth {
            moved: matches!(written, Err(StoreError::Moved { .. })),
            database: if self.is_shared() { "postgresql" } else { "sqlite" },
            content: self.inner.blobs.kind(),
            database_up: matches!(written, Ok(()) | Err(StoreError::StorageFull { .. })) || !self.is_shared(),
            content_up: reached.is_ok(),
            writable: written.is_ok(),
            reason: written.and(reached).and(space).err().map(|error| error.to_string()),
            full,
            free_bytes: self.free_bytes(),
            least_free_bytes: self.inner.options.least_free_bytes,
            wal_bytes: [self.inner.catalog.sqlite(), self.inner.blobs.sqlite()]
                .into_iter()
                .flatten()
                .map(Database::wal_bytes)
                .sum(),
            database_bytes: ["meta", "blobs"].map(|name| {
                let file = self.inner.folder.as_ref().map(|folder| folder.file(&format!("{name}.db")));
                (name, file.and_then(|file| std::fs::metadata(file).ok()).map_or(0, |file| file.len()))
            }),
            blob_bytes,
        }
    }

    /// Asks whether what keeps the content lets this process in.
    ///
    /// # Errors
    /// [`StoreError::Refused`] where it does not, [`StoreError::Unavailable`] where it does not answer.
    pub async fn reach_content(&self) -> Result<(), StoreError> {
        self.inner.blobs.reach().await
    }

    /// Whether new content would be accepted, as far as free space goes.
    pub fn has_space(&self) -> bool {
        self.check_space(0).is_ok()
    }

    /// Notes why a result waits.
    pub(super) fn note_delay(&self, error: &StoreError) {
        let mut delay = self.inner.delay.lock().unwrap_or_else(PoisonError::into_inner);
        *delay = Some((Instant::now(), error.reason()));
    }

    /// Why a result that takes long to be stored may have to wait: what was met lately, or what the store says that
    /// keeps the content. `None` where both go on.
    pub async fn delay(&self) -> Option<&'static str> {
        let met = *self.inner.delay.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((when, why)) = met
            && when.elapsed() < DELAY_KNOWN
        {
            return Some(why);
        }
        if !self.is_shared() {
            return None;
        }
        match tokio::time::timeout(HEALTH_PATIENCE, self.reach_content()).await {
            Ok(reached) => reached.err().map(|error| error.reason()),
            Err(_) => Some(SILENT),
        }
    }
}
