//! Content by hash, in chunks: pending while it is written, ready once every chunk is verified. It lies in a database
//! of SQLite in the data folder or, where many processes share it, in an object store.

use std::ops::Range;

use bytes::{Bytes, BytesMut};
use futures_util::future::BoxFuture;
use futures_util::{Stream, stream};
use sqlx::Row;

#[cfg(feature = "cluster")]
use super::objects::Objects;
use super::{
    Store, StoreError,
    database::{Database, WriteTransaction},
    sql,
};

/// Measured on this page size: 49 ms to write 16 MiB, against 109 ms as one value with pages of 4 KiB.
pub(super) const PAGE_BYTES: u32 = 8 << 10;
pub(super) const CHUNK_BYTES: usize = 256 << 10;
/// Chunks that one verifying statement reads.
pub(super) const CHUNKS_PER_READ: i64 = 8;

/// Where content is kept.
#[derive(Debug)]
pub(super) enum Blobs {
    /// In chunks, as rows of a database of this process alone.
    Chunks(Database),
    /// In objects, with others.
    #[cfg(feature = "cluster")]
    Objects(Objects),
}

impl Blobs {
    /// The database in the data folder, if that is where the content is.
    pub fn sqlite(&self) -> Option<&Database> {
        match self {
            Self::Chunks(database) => Some(database),
            #[cfg(feature = "cluster")]
            Self::Objects(_) => None,
        }
    }

    /// What keeps the content, in a word.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Chunks(_) => "sqlite",
            #[cfg(feature = "cluster")]
            Self::Objects(objects) => objects.kind(),
        }
    }

    /// Asks whether an object store answers; a database is asked otherwise.
    pub async fn reach(&self) -> Result<(), StoreError> {
        match self {
            Self::Chunks(_) => Ok(()),
            #[cfg(feature = "cluster")]
            Self::Objects(objects) => objects.check_pairing().await,
        }
    }
}

/// Where a ready blob lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BlobPlace {
    pub id: i64,
    pub bytes: u64,
    pub chunk_bytes: u64,
}

impl Store {
    /// How many bytes a blob has.
    ///
    /// # Errors
    /// [`StoreError::NotFound`] where no ready blob has this hash.
    pub async fn blob_length(&self, hash: &str) -> Result<u64, StoreError> {
        Ok(self.blob_place(hash).await?.bytes)
    }

    /// A range of a blob in one piece.
    ///
    /// # Errors
    /// [`StoreError::NotFound`], [`StoreError::InvalidRange`], and [`StoreError::Corrupt`] where a chunk is missing.
    pub fn blob_bytes<'a>(&'a self, hash: &'a str, range: Range<u64>) -> BoxFuture<'a, Result<Bytes, StoreError>> {
        Box::pin(async move {
            let place = self.blob_place(hash).await?;
            place.check(&range)?;
            let mut bytes = BytesMut::with_capacity((range.end - range.start) as usize);
            let mut at = range.start;
            while at < range.end {
                let piece = self.blob_piece(hash, place, at, range.end).await?;
                at += piece.len() as u64;
                bytes.extend_from_slice(&piece);
            }
            Ok(bytes.freeze())
        })
    }

    /// A range of a blob, chunk by chunk. No read transaction is open between chunks, so a slow reader holds nothing; a
    /// blob that is deleted meanwhile ends the stream with an error.
    pub fn blob_stream(
        &self,
        hash: &str,
        range: Range<u64>,
    ) -> impl Stream<Item = Result<Bytes, StoreError>> + Send + 'static {
        struct State {
            store: Store,
            hash: String,
            range: Range<u64>,
            place: Option<BlobPlace>,
        }
        let state = State { store: self.clone(), hash: hash.to_owned(), range, place: None };
        stream::try_unfold(state, |mut state| async move {
            let place = match state.place {
                Some(place) => place,
                None => {
                    let place = state.store.blob_place(&state.hash).await?;
                    place.check(&state.range)?;
                    *state.place.insert(place)
                }
            };
            if state.range.is_empty() {
                return Ok(None);
            }
            let piece = state.store.blob_piece(&state.hash, place, state.range.start, state.range.end).await?;
            state.range.start += piece.len() as u64;
            Ok(Some((piece, state)))
        })
    }

    /// An address that gives a whole blob to whoever has it, for some minutes, straight from the object store; `None`
    /// where there is none that signs addresses. The media type and the name of the file are those of the answer.
    ///
    /// # Errors
    /// [`StoreError::NotFound`] where no ready blob has this hash.
    pub async fn signed_address(
        &self,
        hash: &str,
        media_type: &str,
        file_name: &str,
    ) -> Result<Option<String>, StoreError> {
        match &self.inner.blobs {
            Blobs::Chunks(_) => {
                let _ = (hash, media_type, file_name);
                Ok(None)
            }
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => {
                objects.signed_address(self.blob_place(hash).await?, media_type, file_name).await
            }
        }
    }

    /// The whole of a blob that a record refers to, with its hash verified.
    pub(super) fn verified_blob<'a>(&'a self, hash: &'a str) -> BoxFuture<'a, Result<Bytes, StoreError>> {
        Box::pin(async move {
            let place = match self.blob_place(hash).await {
                Err(StoreError::NotFound { .. }) => return Err(self.inner.known.damage(hash, "it is missing")),
                found => found?,
            };
            let bytes = self.blob_bytes(hash, 0..place.bytes).await?;
            let (bytes, found) = blocking(move || {
                let found = blake3::hash(&bytes).to_hex();
                (bytes, found)
            })
            .await?;
            if found.as_str() != hash {
                return Err(self.inner.known.damage(hash, "its bytes hash to another value"));
            }
            self.inner.known.whole(hash);
            Ok(bytes)
        })
    }

    pub(super) fn blob_place<'a>(&'a self, hash: &'a str) -> BoxFuture<'a, Result<BlobPlace, StoreError>> {
        Box::pin(async move {
            let unknown = || StoreError::NotFound { resource: "blob", id: hash.to_owned() };
            let place = match &self.inner.blobs {
                Blobs::Chunks(blobs) => {
                    let row =
                        sqlx::query("SELECT id, bytes, chunk_bytes FROM blobs WHERE hash = ? AND state = 'ready'")
                            .bind(hash)
                            .fetch_optional(blobs.reader())
                            .await?
                            .ok_or_else(unknown)?;
                    BlobPlace {
                        id: row.try_get("id")?,
                        bytes: row.try_get::<i64, _>("bytes")? as u64,
                        chunk_bytes: row.try_get::<i64, _>("chunk_bytes")? as u64,
                    }
                }
                #[cfg(feature = "cluster")]
                Blobs::Objects(objects) => objects.locate(hash).await?.ok_or_else(unknown)?,
            };
            if place.chunk_bytes == 0 {
                Err(self.inner.known.damage(hash, "its chunks have no size"))
            } else {
                Ok(place)
            }
        })
    }

    /// The rest of the chunk that holds byte `at`, verified and cut at `end`; never empty.
    pub(super) fn blob_piece<'a>(
        &'a self,
        hash: &'a str,
        place: BlobPlace,
        at: u64,
        end: u64,
    ) -> BoxFuture<'a, Result<Bytes, StoreError>> {
        Box::pin(async move {
            let position = at / place.chunk_bytes;
            let damage = |how: &str| self.inner.known.damage(hash, &format!("chunk {position} {how}"));
            let blobs = match &self.inner.blobs {
                Blobs::Chunks(blobs) => blobs,
                #[cfg(feature = "cluster")]
                Blobs::Objects(objects) => {
                    return match objects.piece(place, at, end).await? {
                        Some(piece) => piece.map_err(|how| damage(&how)),
                        None => Err(self.why_missing(hash, place, position).await),
                    };
                }
            };
            let row = sqlx::query("SELECT data, hash FROM chunks WHERE blob = ? AND position = ?")
                .bind(place.id)
                .bind(position as i64)
                .fetch_optional(blobs.reader())
                .await;
            let row = match row.map_err(StoreError::from) {
                Err(StoreError::Corrupt { detail }) => return Err(damage(&format!("cannot be read: {detail}"))),
                row => row?,
            };
            let Some(row) = row else { return Err(self.why_missing(hash, place, position).await) };
            let (data, expected): (Vec<u8>, Option<Vec<u8>>) = (row.try_get("data")?, row.try_get("hash")?);
            match expected {
                // A quarter of a megabyte takes a tenth of a millisecond.
                Some(expected) if *blake3::hash(&data).as_bytes() != *expected => {
                    return Err(damage("hashes to another value"));
                }
                Some(_) => {}
                // From before chunks had hashes: the whole is verified, which gives them theirs.
                None => self.verify_blob(hash).await?,
            }
            let chunk_start = position * place.chunk_bytes;
            let length = place.chunk_bytes.min(place.bytes - chunk_start);
            if data.len() as u64 != length {
                return Err(damage("is short or long"));
            }
            Ok(Bytes::from(data).slice((at - chunk_start) as usize..(end - chunk_start).min(length) as usize))
        })
    }

    /// A stream that goes on while its blob is deleted or written anew has met no damage.
    async fn why_missing(&self, hash: &str, place: BlobPlace, position: u64) -> StoreError {
        match self.blob_place(hash).await {
            Ok(now) if now == place => self.inner.known.damage(hash, &format!("chunk {position} is missing")),
            Ok(_) => StoreError::Unavailable { detail: format!("content {hash} was rewritten in the meantime") },
            Err(error) => error,
        }
    }

    /// Whether a mesh, a basis or a field has this content.
    pub(super) async fn is_referenced(&self, hash: &str) -> Result<bool, StoreError> {
        let references: i64 = sql::query_scalar(
            "SELECT (SELECT COUNT(*) FROM meshes WHERE content_hash = ?1) + (SELECT COUNT(*) FROM bases WHERE content_hash = ?1)
                + (SELECT COUNT(*) FROM fields WHERE content_hash = ?1)",
        )
        .bind(hash)
        .fetch_one(self.inner.catalog.reader())
        .await?;
        Ok(references > 0)
    }

    /// Deletes blobs that nothing refers to, of those given; where others may be about to refer to them, they are
    /// condemned and deleted later. The caller holds `blob_use` for writing.
    pub(super) async fn delete_unreferenced(&self, hashes: &[String]) -> Result<(), StoreError> {
        let blobs = match &self.inner.blobs {
            Blobs::Chunks(blobs) => blobs,
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => return objects.condemn(hashes, self.now_ms()).await,
        };
        for hash in hashes {
            if self.is_referenced(hash).await? {
                continue;
            }
            let records = self.record_generation().await?;
            let mut transaction = blobs.write().await?;
            transaction.remember(records).await?;
            let ids: Vec<i64> = sqlx::query_scalar("SELECT id FROM blobs WHERE hash = ? AND state = 'ready'")
                .bind(hash)
                .fetch_all(transaction.on())
                .await?;
            for id in ids {
                delete_blob(&mut transaction, id).await?;
            }
            transaction.commit().await?;
        }
        self.count_reusable().await
    }

    /// Bytes of all ready blobs, but of those that many processes share and nothing refers to any more.
    pub(super) async fn all_blob_bytes(&self) -> Result<u64, StoreError> {
        let blobs = match &self.inner.blobs {
            Blobs::Chunks(blobs) => blobs,
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => return objects.all_bytes().await,
        };
        let bytes: i64 = sqlx::query_scalar("SELECT COALESCE(SUM(bytes), 0) FROM blobs WHERE state = 'ready'")
            .fetch_one(blobs.reader())
            .await?;
        Ok(bytes as u64)
    }
}

impl BlobPlace {
    pub fn check(&self, range: &Range<u64>) -> Result<(), StoreError> {
        if range.start > range.end || range.end > self.bytes {
            return Err(StoreError::InvalidRange { start: range.start, end: range.end, bytes: self.bytes });
        }
        Ok(())
    }
}

pub(super) async fn delete_blob(transaction: &mut WriteTransaction, id: i64) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM chunks WHERE blob = ?").bind(id).execute(transaction.on()).await?;
    sqlx::query("DELETE FROM blobs WHERE id = ?").bind(id).execute(transaction.on()).await?;
    Ok(())
}

/// The hash of content, computed off the threads of the runtime.
pub(super) async fn hash_of(content: &Bytes) -> Result<String, StoreError> {
    let content = content.clone();
    blocking(move || blake3::hash(&content).to_hex().to_string()).await
}

/// Runs work that takes more than a millisecond where it blocks nobody.
pub(super) async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, StoreError> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|error| StoreError::Unavailable { detail: format!("a thread ended early: {error}") })
}
