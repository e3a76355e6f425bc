//! Content by hash, in chunks: pending while it is written, ready once every chunk is verified. It lies in a database of SQLite in the data folder
//! or, where many processes share it, in an object store.

use std::{ops::Range, time::Duration};

use bytes::{Bytes, BytesMut};
use futures_util::{Stream, future::BoxFuture, stream};
use sqlx::Row;
use tokio::sync::mpsc;
use uuid::Uuid;

#[cfg(feature = "cluster")]
use super::objects::{Objects, Sealed, Upload};
use super::{
    Store, StoreError,
    database::{Database, WriteTransaction},
    fault::FailPoint,
    piece_writer::PieceWriter,
    sql,
};

/// Measured on this page size: 49 ms to write 16 MiB, against 109 ms as one value with pages of 4 KiB.
pub(super) const PAGE_BYTES: u32 = 8 << 10;
pub(super) const CHUNK_BYTES: usize = 256 << 10;
/// Chunks of one transaction, so that the write-ahead log stays short and other writers get their turn.
const CHUNKS_PER_TRANSACTION: usize = 32;
/// Chunks that one verifying statement reads.
pub(super) const CHUNKS_PER_READ: i64 = 8;
/// For so long what was computed waits for a storage that does not answer, before it is lost and computed anew.
const PATIENCE: Duration = Duration::from_secs(300);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// The hash of a pending blob whose content is being made.
const UNKNOWN_HASH: &str = "";

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
            Self::Objects(objects) => objects.reach().await,
        }
    }
}

/// Content that is being written.
pub(super) enum Writing {
    Chunks {
        id: i64,
        position: i64,
    },
    #[cfg(feature = "cluster")]
    Objects(Upload),
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
    pub async fn blob_bytes(&self, hash: &str, range: Range<u64>) -> Result<Bytes, StoreError> {
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
    }

    /// A range of a blob, chunk by chunk. No read transaction is open between chunks, so a slow reader holds nothing; a blob
    /// that is deleted meanwhile ends the stream with an error.
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

    /// An address that gives a whole blob to whoever has it, for some minutes, straight from the object store; `None` where there is none that signs
    /// addresses. The media type and the name of the file are those of the answer.
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
    pub(super) async fn verified_blob(&self, hash: &str) -> Result<Bytes, StoreError> {
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
    }

    /// Writes content unless it is there already and whole: chunks pending → hash verified → ready. The caller holds
    /// `blob_use` for reading until something refers to the blob.
    pub(super) async fn put_blob(&self, hash: &str, content: &Bytes) -> Result<(), StoreError> {
        match self.blob_place(hash).await {
            Ok(_) => match self.keep_blob(hash).await {
                Ok(true) => return Ok(()),
                Ok(false) => {}
                // It is written anew.
                Err(StoreError::Damaged { .. }) => {}
                Err(error) => return Err(error),
            },
            Err(StoreError::NotFound { .. } | StoreError::Damaged { .. }) => {}
            Err(error) => return Err(error),
        }
        let mut writing = self.begin_blob(hash, content.len() as u64).await?;
        let written = self.fill_blob(&mut writing, hash, content).await;
        if written.is_err() {
            self.abandon_blob(writing).await;
        }
        written
    }

    /// Whether content is known or seen to be damaged. A store that does not answer has damaged nothing.
    #[cfg(feature = "cluster")]
    async fn is_damaged(&self, hash: &str) -> Result<bool, StoreError> {
        match self.look_at_blob(hash).await {
            Ok(()) => Ok(false),
            Err(StoreError::Damaged { .. }) => Ok(true),
            Err(error) => Err(error),
        }
    }

    /// Keeps content that is there for whoever is about to refer to it. False where it has gone meanwhile.
    async fn keep_blob(&self, hash: &str) -> Result<bool, StoreError> {
        match &self.inner.blobs {
            Blobs::Chunks(_) => self.verify_blob(hash).await.map(|()| true),
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => Ok(objects.pardon(hash).await? && !self.is_damaged(hash).await?),
        }
    }

    /// Writes content as it is made, under a hash that is known only at the end. `make` runs on a thread that may block and gets a
    /// writer; what it returns comes back beside the hash and the number of bytes. `expected` is about how many bytes there will be.
    /// `None` where the attempt that holds the lease `token` is not wanted any more, which is looked after between transactions. The
    /// caller holds `blob_use` for reading until something refers to the blob.
    pub(super) async fn put_made<T: Send + 'static>(
        &self,
        expected: u64,
        token: Uuid,
        make: impl FnOnce(&mut PieceWriter) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<Option<(T, String, u64)>, StoreError> {
        let mut writing = self.patiently(|| Box::pin(self.begin_blob(UNKNOWN_HASH, expected))).await?;
        let made = self.fill_made(&mut writing, token, make).await;
        if !matches!(made, Ok(Some(_))) {
            self.abandon_blob(writing).await;
        }
        made
    }

    async fn fill_made<T: Send + 'static>(
        &self,
        writing: &mut Writing,
        token: Uuid,
        make: impl FnOnce(&mut PieceWriter) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<Option<(T, String, u64)>, StoreError> {
        let (sender, mut pieces) = mpsc::channel(CHUNKS_PER_TRANSACTION);
        let making = tokio::task::spawn_blocking(move || {
            let mut writer = PieceWriter::new(sender);
            let made = make(&mut writer)?;
            let hasher = writer.end().map_err(|error| StoreError::Unavailable { detail: error.to_string() })?;
            Ok::<_, StoreError>((made, hasher))
        });
        let mut batch = Vec::with_capacity(CHUNKS_PER_TRANSACTION);
        while pieces.recv_many(&mut batch, CHUNKS_PER_TRANSACTION).await > 0 {
            if !self.patiently(|| Box::pin(self.is_wanted(token))).await? {
                return Ok(None);
            }
            self.write_chunks(writing, &batch).await?;
            batch.clear();
        }
        // Where this ended early, the writer finds nobody to give pieces to and ends as well.
        let (made, hasher) = making
            .await
            .map_err(|error| StoreError::Unavailable { detail: format!("a thread ended early: {error}") })??;
        let (hash, bytes) = (hasher.finalize().to_hex().to_string(), hasher.count());
        self.finish_blob(writing, &hash, bytes).await?;
        Ok(Some((made, hash, bytes)))
    }

    /// Tries again for minutes what a storage does not answer that processes share: it may be restarting, and what was computed is worth some waiting.
    pub(super) async fn patiently<'a, T>(
        &self,
        mut call: impl FnMut() -> BoxFuture<'a, Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        let (begun, mut pause) = (tokio::time::Instant::now(), Duration::from_millis(20));
        loop {
            match call().await {
                Err(error) if self.is_shared() && error.is_retryable() && begun.elapsed() < PATIENCE => {
                    tracing::warn!(%error, "a result waits for the storage");
                    tokio::time::sleep(pause).await;
                    pause = (pause * 3).min(LONGEST_PAUSE);
                }
                answer => return answer,
            }
        }
    }

    /// Begins a pending blob.
    pub(super) async fn begin_blob(&self, hash: &str, bytes: u64) -> Result<Writing, StoreError> {
        self.check_space(bytes)?;
        let blobs = match &self.inner.blobs {
            Blobs::Chunks(blobs) => blobs,
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => {
                // Content that is made is made once.
                let patient = hash == UNKNOWN_HASH;
                return Ok(Writing::Objects(objects.begin(hash, bytes, patient, self.now_ms()).await?));
            }
        };
        let mut transaction = blobs.write().await?;
        let id = sqlx::query_scalar(
            "INSERT INTO blobs (hash, bytes, chunk_bytes, state, created_ms) VALUES (?, ?, ?, 'pending', ?) RETURNING id",
        )
        .bind(hash)
        .bind(bytes as i64)
        .bind(CHUNK_BYTES as i64)
        .bind(self.now_ms())
        .fetch_one(transaction.on())
        .await?;
        transaction.commit().await?;
        Ok(Writing::Chunks { id, position: 0 })
    }

    /// Deletes a pending blob. What cannot be cleared now is collected when the store is opened next.
    pub(super) async fn abandon_blob(&self, writing: Writing) {
        match (&self.inner.blobs, writing) {
            (Blobs::Chunks(blobs), Writing::Chunks { id, .. }) => {
                if let Ok(mut transaction) = blobs.write().await
                    && delete_blob(&mut transaction, id).await.is_ok()
                {
                    let _ = transaction.commit().await;
                    let _ = self.count_reusable().await;
                }
            }
            #[cfg(feature = "cluster")]
            (Blobs::Objects(objects), Writing::Objects(mut upload)) => objects.abandon(&mut upload).await,
            #[cfg(feature = "cluster")]
            _ => {}
        }
    }

    async fn fill_blob(&self, writing: &mut Writing, hash: &str, content: &Bytes) -> Result<(), StoreError> {
        let mut rest = content.clone();
        while !rest.is_empty() {
            let pieces: Vec<Bytes> = (0..CHUNKS_PER_TRANSACTION)
                .map(|_| rest.split_to(rest.len().min(CHUNK_BYTES)))
                .take_while(|piece| !piece.is_empty())
                .collect();
            self.write_chunks(writing, &pieces).await?;
        }
        self.finish_blob(writing, hash, content.len() as u64).await
    }

    /// Writes the next chunks, in one transaction where they are rows.
    pub(super) async fn write_chunks(&self, writing: &mut Writing, chunks: &[Bytes]) -> Result<(), StoreError> {
        match (&self.inner.blobs, writing) {
            (Blobs::Chunks(blobs), Writing::Chunks { id, position }) => {
                let mut transaction = blobs.write().await?;
                for (position, data) in (*position..).zip(chunks) {
                    sqlx::query("INSERT INTO chunks (blob, position, hash, data) VALUES (?, ?, ?, ?)")
                        .bind(*id)
                        .bind(position)
                        .bind(blake3::hash(data).as_bytes().to_vec())
                        .bind(data.to_vec())
                        .execute(transaction.on())
                        .await?;
                }
                transaction.commit().await?;
                *position += chunks.len() as i64;
            }
            #[cfg(feature = "cluster")]
            (Blobs::Objects(objects), Writing::Objects(upload)) => {
                objects.write(upload, chunks, self.now_ms()).await?;
            }
            #[cfg(feature = "cluster")]
            _ => return Err(another_place()),
        }
        self.faults().reach(FailPoint::MidChunks);
        Ok(())
    }

    /// Makes a blob ready, in the place of a damaged one. Of chunks, what was written is read back before; an object store has verified each part.
    pub(super) async fn finish_blob(&self, writing: &mut Writing, hash: &str, bytes: u64) -> Result<(), StoreError> {
        match (&self.inner.blobs, writing) {
            (Blobs::Chunks(blobs), Writing::Chunks { id, .. }) => self.finish_chunks(blobs, *id, hash, bytes).await?,
            #[cfg(feature = "cluster")]
            (Blobs::Objects(objects), Writing::Objects(upload)) => {
                let sealed = objects.seal(upload, bytes).await?;
                self.faults().reach(FailPoint::BeforeBlobReady);
                // What was made is there as a whole: a database that is away is no reason to make it again.
                match upload.patient {
                    true => self.patiently(|| Box::pin(self.make_ready(objects, &sealed, hash))).await?,
                    false => self.make_ready(objects, &sealed, hash).await?,
                }
            }
            #[cfg(feature = "cluster")]
            _ => return Err(another_place()),
        }
        self.inner.known.whole(hash);
        self.count_reusable().await?;
        self.faults().reach(FailPoint::AfterBlobReady);
        Ok(())
    }

    /// Makes an object ready that is there as a whole.
    #[cfg(feature = "cluster")]
    pub(super) async fn make_ready(&self, objects: &Objects, sealed: &Sealed, hash: &str) -> Result<(), StoreError> {
        let damaged = match objects.place(hash).await? {
            Some(place) if place.id != sealed.id && self.is_damaged(hash).await? => Some(place.id),
            _ => None,
        };
        objects.make_ready(sealed, hash, damaged, self.now_ms()).await
    }

    /// Verifies the chunks that were written and makes their blob ready.
    async fn finish_chunks(&self, blobs: &Database, id: i64, hash: &str, bytes: u64) -> Result<(), StoreError> {
        let (found, found_bytes, _) = self.hash_chunks(blobs, id).await?;
        if found_bytes != bytes || found != hash {
            return Err(self.inner.known.damage(hash, "what was read back is not what was written"));
        }
        self.faults().reach(FailPoint::BeforeBlobReady);
        let other = match self.blob_place(hash).await {
            Ok(other) => Some((other.id, self.verify_blob(hash).await.is_ok())),
            Err(_) => None,
        };
        let records = self.record_generation().await?;
        let mut transaction = blobs.write().await?;
        transaction.remember(records).await?;
        let present: Option<i64> = sqlx::query_scalar("SELECT id FROM blobs WHERE hash = ? AND state = 'ready'")
            .bind(hash)
            .fetch_optional(transaction.on())
            .await?;
        let is_damaged = |present| other == Some((present, false));
        match present {
            // Someone else wrote the same content meanwhile.
            Some(present) if !is_damaged(present) => delete_blob(&mut transaction, id).await?,
            present => {
                if let Some(damaged) = present {
                    delete_blob(&mut transaction, damaged).await?;
                    tracing::info!(content = hash, "damaged content is written anew");
                }
                // The hash and the bytes of content that was made are known only now.
                sqlx::query("UPDATE blobs SET state = 'ready', hash = ?, bytes = ? WHERE id = ?")
                    .bind(hash)
                    .bind(bytes as i64)
                    .bind(id)
                    .execute(transaction.on())
                    .await?;
            }
        }
        transaction.commit().await
    }

    pub(super) async fn blob_place(&self, hash: &str) -> Result<BlobPlace, StoreError> {
        let unknown = || StoreError::NotFound { resource: "blob", id: hash.to_owned() };
        let place = match &self.inner.blobs {
            Blobs::Chunks(blobs) => {
                let row = sqlx::query("SELECT id, bytes, chunk_bytes FROM blobs WHERE hash = ? AND state = 'ready'")
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
            Blobs::Objects(objects) => objects.place(hash).await?.ok_or_else(unknown)?,
        };
        if place.chunk_bytes == 0 { Err(self.inner.known.damage(hash, "its chunks have no size")) } else { Ok(place) }
    }

    /// The rest of the chunk that holds byte `at`, verified and cut at `end`; never empty.
    pub(super) async fn blob_piece(
        &self,
        hash: &str,
        place: BlobPlace,
        at: u64,
        end: u64,
    ) -> Result<Bytes, StoreError> {
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
    }

    /// A stream that goes on while its blob is deleted or written anew has met no damage.
    async fn why_missing(&self, hash: &str, place: BlobPlace, position: u64) -> StoreError {
        match self.blob_place(hash).await {
            Ok(now) if now == place => self.inner.known.damage(hash, &format!("chunk {position} is missing")),
            Ok(_) => StoreError::Unavailable { detail: format!("content {hash} was written anew meanwhile") },
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

    /// Deletes blobs that nothing refers to, of those given; where others may be about to refer to them, they are condemned and deleted later. The
    /// caller holds `blob_use` for writing.
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

/// Why nothing was written: what was begun in one place cannot go on in another.
#[cfg(feature = "cluster")]
fn another_place() -> StoreError {
    StoreError::Unavailable { detail: "content that was begun in one place cannot go on in another".to_owned() }
}
