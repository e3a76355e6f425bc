//! Content as it is written: pending until every chunk is verified, then ready under its hash. What a storage that many
//! processes share does not take at once is waited for, where it was computed.

use std::time::Duration;

use bytes::Bytes;
use futures_util::future::BoxFuture;
use tokio::sync::mpsc;
use uuid::Uuid;

#[cfg(feature = "cluster")]
use super::objects::{Objects, Sealed, Upload};
use super::{
    Store, StoreError,
    blobs::{Blobs, CHUNK_BYTES, delete_blob},
    database::Database,
    fault::FailPoint,
    piece_writer::PieceWriter,
};

/// Chunks of one transaction, so that the write-ahead log stays short and other writers get their turn.
const CHUNKS_PER_TRANSACTION: usize = 32;
/// For so long what was computed waits for a storage that does not answer, before it is lost and computed anew.
const PATIENCE: Duration = Duration::from_secs(300);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// The hash of a pending blob whose content is being made.
const UNKNOWN_HASH: &str = "";

/// Content that is being written.
pub(super) enum Writing {
    Chunks {
        id: i64,
        position: i64,
    },
    #[cfg(feature = "cluster")]
    Objects(Upload),
}

impl Store {
    /// Writes content unless it is there already and whole: chunks pending → hash verified → ready. The caller holds
    /// `blob_use` for reading until something refers to the blob.
    pub(super) async fn put_blob(&self, hash: &str, content: &Bytes) -> Result<(), StoreError> {
        #[cfg(feature = "cluster")]
        if let Blobs::Objects(objects) = &self.inner.blobs {
            self.check_space(content.len() as u64)?;
            // What is not there yet, as most content, is begun by the statement that looks for it.
            if let Some(upload) = objects.begin_unless_ready(hash, content.len() as u64, self.now_ms()).await? {
                return self.write_blob(Writing::Objects(upload), hash, content).await;
            }
        }
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
        let writing = self.begin_blob(hash, content.len() as u64).await?;
        self.write_blob(writing, hash, content).await
    }

    /// Writes all of what was begun, or gives it up.
    async fn write_blob(&self, mut writing: Writing, hash: &str, content: &Bytes) -> Result<(), StoreError> {
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

    /// Writes content as it is made, under a hash that is known only at the end. `make` runs on a thread that may block
    /// and gets a writer; what it returns comes back beside the hash and the number of bytes. `expected` is about how
    /// many bytes there will be. `None` where the attempt that holds the lease `token` is not wanted any more, which is
    /// looked after between transactions. The caller holds `blob_use` for reading until something refers to the blob.
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

    /// Tries again for minutes what a storage does not answer that processes share: it may be restarting, and what was
    /// computed is worth some waiting.
    pub(super) async fn patiently<'a, T>(
        &self,
        mut call: impl FnMut() -> BoxFuture<'a, Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        let (begun, mut pause) = (tokio::time::Instant::now(), Duration::from_millis(20));
        loop {
            match call().await {
                Err(error) if self.is_shared() && error.is_retryable() && begun.elapsed() < PATIENCE => {
                    tracing::warn!(%error, "a result waits for the storage");
                    self.note_delay(&error);
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

    /// Makes a blob ready, in the place of a damaged one. Of chunks, what was written is read back before; an object
    /// store has verified each part.
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
        if objects.make_ready_at_once(sealed, hash).await? {
            return Ok(());
        }
        let damaged = match objects.locate(hash).await? {
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
                    tracing::info!(content = hash, "rewriting damaged content");
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
}

/// Why nothing was written: what was begun in one place cannot go on in another.
#[cfg(feature = "cluster")]
fn another_place() -> StoreError {
    StoreError::Unavailable { detail: "content that was begun in one place cannot go on in another".to_owned() }
}
