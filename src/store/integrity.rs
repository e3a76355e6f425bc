//! Whether stored content is what was stored: every chunk is verified when it is read, whole blobs where a client
//! relies on them.
//!
//! Damage that is met is noted, so that the next request hears of it before the first byte. An upload or a solve of the
//! same content writes it anew: see `put_blob` and `enqueue`.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use futures_util::future::BoxFuture;
use uuid::Uuid;

use super::{
    Store, StoreError,
    blobs::{BlobPlace, Blobs, CHUNKS_PER_READ, blocking},
    database::Database,
};

/// A blob that was verified so recently is not read again before its job is answered with it.
const FRESH: Duration = Duration::from_secs(600);
/// Blobs that are remembered as verified.
const MOST_REMEMBERED: usize = 10_000;
/// So many bytes of a stream are verified before its first byte is sent, so that damage in them is a problem and not a
/// broken connection.
const LOOK_AHEAD: u64 = 64 << 20;

/// What is known of blobs, by their hashes.
#[derive(Debug, Default)]
pub(super) struct KnownBlobs {
    damaged: Mutex<HashSet<String>>,
    verified: Mutex<HashMap<String, Instant>>,
}

impl KnownBlobs {
    /// Notes that a blob is damaged, and gives the error that says so.
    pub fn damage(&self, hash: &str, how: &str) -> StoreError {
        let mut damaged = self.damaged.lock().unwrap_or_else(PoisonError::into_inner);
        if damaged.insert(hash.to_owned()) {
            tracing::error!(content = hash, how, "stored content is damaged");
        }
        drop(damaged);
        self.verified.lock().unwrap_or_else(PoisonError::into_inner).remove(hash);
        StoreError::Damaged { hash: hash.to_owned(), how: how.to_owned() }
    }

    /// Notes that a blob is whole, or written anew.
    pub fn whole(&self, hash: &str) {
        self.damaged.lock().unwrap_or_else(PoisonError::into_inner).remove(hash);
        let mut verified = self.verified.lock().unwrap_or_else(PoisonError::into_inner);
        if verified.len() >= MOST_REMEMBERED {
            verified.clear();
        }
        verified.insert(hash.to_owned(), Instant::now());
    }

    fn is_damaged(&self, hash: &str) -> bool {
        self.damaged.lock().unwrap_or_else(PoisonError::into_inner).contains(hash)
    }

    fn is_fresh(&self, hash: &str) -> bool {
        let verified = self.verified.lock().unwrap_or_else(PoisonError::into_inner);
        verified.get(hash).is_some_and(|when| when.elapsed() < FRESH)
    }
}

impl Store {
    /// Reads a whole blob and compares its hash. Chunks from before hashes of their own get them.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], also where it is missing.
    pub(super) fn verify_blob<'a>(&'a self, hash: &'a str) -> BoxFuture<'a, Result<(), StoreError>> {
        Box::pin(async move {
            let damage = |how: &str| self.inner.known.damage(hash, how);
            let place = match self.blob_place(hash).await {
                Ok(place) => place,
                Err(StoreError::NotFound { .. }) => return Err(damage("it is missing")),
                Err(error) => return Err(error),
            };
            let hashed = match &self.inner.blobs {
                Blobs::Chunks(blobs) => self.hash_chunks(blobs, place.id).await,
                #[cfg(feature = "cluster")]
                Blobs::Objects(objects) => objects.hash(place.id).await.map(|(hash, bytes)| (hash, bytes, Vec::new())),
            };
            let (found, bytes, hashes) = match hashed {
                Ok(found) => found,
                Err(StoreError::Corrupt { detail }) => return Err(damage(&detail)),
                Err(error) => return Err(error),
            };
            if bytes != place.bytes || found != hash {
                return Err(damage("its bytes hash to another value"));
            }
            self.write_missing_hashes(place, &hashes).await?;
            self.inner.known.whole(hash);
            Ok(())
        })
    }

    /// Looks whether a blob is whole as far as that is quickly told: chunks are read and hashed, of objects it is
    /// enough that the store has them, unless damage was met.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], also where it is missing.
    pub(super) async fn look_at_blob(&self, hash: &str) -> Result<(), StoreError> {
        #[cfg(feature = "cluster")]
        if let Blobs::Objects(objects) = &self.inner.blobs
            && !self.inner.known.is_damaged(hash)
        {
            let there = match self.blob_place(hash).await {
                Ok(place) => objects.is_there(place).await?,
                Err(StoreError::NotFound { .. }) => false,
                Err(error) => return Err(error),
            };
            if there {
                self.inner.known.whole(hash);
                return Ok(());
            }
            return Err(self.inner.known.damage(hash, "it is missing"));
        }
        self.verify_blob(hash).await
    }

    /// Hashes the chunks of a blob: all together, how many bytes they are, and each alone.
    pub(super) async fn hash_chunks(
        &self,
        blobs: &Database,
        id: i64,
    ) -> Result<(String, u64, Vec<blake3::Hash>), StoreError> {
        let (mut hasher, mut hashes) = (blake3::Hasher::new(), Vec::new());
        let mut position = 0i64;
        loop {
            let rows: Vec<Vec<u8>> = sqlx::query_scalar(
                "SELECT data FROM chunks WHERE blob = ? AND position >= ? AND position < ? ORDER BY position",
            )
            .bind(id)
            .bind(position)
            .bind(position + CHUNKS_PER_READ)
            .fetch_all(blobs.reader())
            .await?;
            if rows.is_empty() {
                break;
            }
            position += CHUNKS_PER_READ;
            (hasher, hashes) = blocking(move || {
                for row in &rows {
                    hasher.update(row);
                    hashes.push(blake3::hash(row));
                }
                (hasher, hashes)
            })
            .await?;
        }
        Ok((hasher.finalize().to_hex().to_string(), hasher.count(), hashes))
    }

    async fn write_missing_hashes(&self, place: BlobPlace, hashes: &[blake3::Hash]) -> Result<(), StoreError> {
        let Some(blobs) = self.inner.blobs.sqlite() else { return Ok(()) };
        let missing: Vec<i64> =
            sqlx::query_scalar("SELECT position FROM chunks WHERE blob = ? AND hash IS NULL ORDER BY position")
                .bind(place.id)
                .fetch_all(blobs.reader())
                .await?;
        if missing.is_empty() {
            return Ok(());
        }
        let mut transaction = blobs.write().await?;
        for position in missing {
            let Some(hash) = usize::try_from(position).ok().and_then(|position| hashes.get(position)) else { continue };
            sqlx::query("UPDATE chunks SET hash = ? WHERE blob = ? AND position = ?")
                .bind(hash.as_bytes().to_vec())
                .bind(place.id)
                .bind(position)
                .execute(transaction.on())
                .await?;
        }
        transaction.commit().await
    }

    /// Whether the content of a stored basis is whole; looked at once in a while.
    pub(super) async fn basis_is_whole(&self, basis: Uuid) -> Result<bool, StoreError> {
        let _in_use = self.inner.blob_use.read().await;
        let record = match self.basis(basis).await {
            Ok(record) => record,
            Err(StoreError::NotFound { .. }) => return Ok(false),
            Err(error) => return Err(error),
        };
        if self.inner.known.is_fresh(&record.content_hash) {
            return Ok(true);
        }
        match self.look_at_blob(&record.content_hash).await {
            Ok(()) => Ok(true),
            Err(StoreError::Damaged { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Refuses content that was found damaged, before a client is sent to where it lies. Of damage that nobody has met
    /// nothing is known.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub async fn refuse_damaged(&self, hash: &str) -> Result<(), StoreError> {
        if !self.inner.known.is_damaged(hash) {
            return Ok(());
        }
        let _in_use = self.inner.blob_use.read().await;
        self.verify_blob(hash).await
    }

    /// Looks at content before it is streamed, so that damage is told instead of a first byte: at all of it up to 64
    /// MiB, else at the beginning. The rest is verified as it is streamed.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; [`StoreError::NotFound`] where nothing refers to it any more;
    /// [`StoreError::InvalidRange`].
    pub async fn check_content(&self, hash: &str, range: &Range<u64>) -> Result<(), StoreError> {
        let _in_use = self.inner.blob_use.read().await;
        if self.inner.known.is_damaged(hash) {
            // It may have been a passing trouble of the disk.
            self.verify_blob(hash).await?;
        }
        let place = match self.blob_place(hash).await {
            Err(StoreError::NotFound { .. }) if self.is_referenced(hash).await? => {
                return Err(self.inner.known.damage(hash, "it is missing"));
            }
            found => found?,
        };
        place.check(range)?;
        let (mut at, end) = (range.start, range.end.min(range.start.saturating_add(LOOK_AHEAD)));
        while at < end {
            at += self.blob_piece(hash, place, at, end).await?.len() as u64;
        }
        Ok(())
    }
}
