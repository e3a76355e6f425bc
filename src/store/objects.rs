//! Content in an object store that many processes share: docs/decisions/0074.
//!
//! Every piece of content is an object of its own, under a key that nobody else uses and that is never written again.
//! The row in the shared database says which object holds what, and whether it is to be seen: an object of a worker
//! that lost its lease, or of an upload that was cut, never is.

use std::{fmt, ops::Range, sync::Arc, time::Duration};

use bytes::{Bytes, BytesMut};
use futures_util::future::BoxFuture;
use object_store::{
    MultipartUpload, ObjectStore, ObjectStoreExt, PutPayload,
    aws::AmazonS3,
    local::LocalFileSystem,
    path::Path,
    prefix::PrefixStore,
    signer::{SignedUrlOptions, Signer},
};
use tokio::task::{JoinError, JoinSet};
use uuid::Uuid;

use super::{
    StoreError,
    blobs::{BlobPlace, CHUNK_BYTES},
    object_identity::Pair,
    postgres::Postgres,
    s3::{S3, failure, is_missing},
    sql,
};

/// Bytes of one part of an upload; S3 wants 5 MiB at least.
const PART_BYTES: usize = 8 << 20;
/// Parts of one upload that are on their way at once: with the one that is filled and what waits for it, 56 MiB of
/// memory.
const PARTS_AT_ONCE: usize = 4;
/// Chunks that are read at once: bytes of one request.
const CHUNKS_AT_ONCE: u64 = 32;
/// For how long a signed address is good.
const SIGNED_FOR: Duration = Duration::from_secs(300);
/// Bytes of a BLAKE3 hash.
const HASH_BYTES: u64 = 32;
/// The objects, and the rows that know them.
pub(super) struct Objects {
    pub(super) store: Arc<dyn ObjectStore>,
    /// The same store, tried for minutes.
    patient: Arc<dyn ObjectStore>,
    /// What signs addresses, and the folder within its bucket.
    signer: Option<(AmazonS3, String)>,
    pub(super) records: Postgres,
    /// Whether the two belong together.
    pub(super) pair: Pair,
    /// The address, without what it sets.
    name: String,
}

impl fmt::Debug for Objects {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Objects({})", self.name)
    }
}

/// An object that is being written.
pub(super) struct Upload {
    id: i64,
    path: Path,
    /// Whether a store that does not answer is waited for.
    pub(super) patient: bool,
    /// Where there is more than one part.
    parts: Option<Box<dyn MultipartUpload>>,
    /// Parts that are on their way.
    flying: JoinSet<Result<(), object_store::Error>>,
    piece: BytesMut,
    hashes: Vec<u8>,
    bytes: u64,
}

/// An object that is there as a whole, and seen by nobody yet.
#[derive(Debug)]
pub(super) struct Sealed {
    /// Of its row.
    pub id: i64,
    hashes: Vec<u8>,
    bytes: u64,
}

/// What came of finishing an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Finished {
    Ready,
    /// Equal content became ready meanwhile.
    Raced,
}

impl Objects {
    /// Opens the store at an address: `s3://BUCKET/PREFIX?endpoint=…&region=…`, with keys and all that the address does
    /// not say from the usual variables `AWS_…`, or `file:///FOLDER`, a folder that every process sees.
    pub fn open(address: &str, records: Postgres) -> Result<Self, StoreError> {
        let refuse =
            |detail: String| StoreError::Unavailable { detail: format!("the object store {address}: {detail}") };
        let name = address.split('?').next().unwrap_or_default().to_owned();
        let pair = Pair::default();
        if let Some(folder) = address.strip_prefix("file://") {
            // Each process would look for it from where it was started.
            if !std::path::Path::new(folder).is_absolute() {
                return Err(refuse(format!("{folder:?} is no folder from the root on: file:///FOLDER")));
            }
            std::fs::create_dir_all(folder).map_err(|source| StoreError::Folder { path: folder.to_owned(), source })?;
            let local = LocalFileSystem::new_with_prefix(folder).map_err(|error| refuse(error.to_string()))?;
            let store: Arc<dyn ObjectStore> = Arc::new(local.with_fsync(true));
            return Ok(Self { patient: Arc::clone(&store), store, signer: None, records, pair, name });
        }
        let Some(place) = address.strip_prefix("s3://") else {
            return Err(refuse("the URL must begin with s3:// or file://".to_owned()));
        };
        let S3 { hasty, patient, prefix } = S3::open(place).map_err(refuse)?;
        let within = |store: AmazonS3| -> Arc<dyn ObjectStore> {
            if prefix.is_empty() { Arc::new(store) } else { Arc::new(PrefixStore::new(store, prefix.as_str())) }
        };
        let signer = Some((hasty.clone(), prefix.clone()));
        Ok(Self { store: within(hasty), patient: within(patient), signer, records, pair, name })
    }

    /// What the store is, in a word.
    pub fn kind(&self) -> &'static str {
        if self.signer.is_some() { "s3" } else { "files" }
    }

    /// An address of an object that the store honours for minutes; `None` where it cannot be signed.
    pub async fn signed_address(
        &self,
        place: BlobPlace,
        media_type: &str,
        file_name: &str,
    ) -> Result<Option<String>, StoreError> {
        let Some((signer, prefix)) = &self.signer else { return Ok(None) };
        self.ensure_paired().await?;
        let path = self.path(place.id).await?;
        let path = if prefix.is_empty() { path } else { Path::from(format!("{prefix}/{path}")) };
        let disposition = format!("attachment; filename=\"{file_name}\"");
        let options = SignedUrlOptions::default()
            .with_query([("response-content-type", media_type), ("response-content-disposition", &disposition)]);
        match signer.signed_url_opts(reqwest::Method::GET, &path, SIGNED_FOR, &options).await {
            Ok(address) => Ok(Some(address.into())),
            Err(error) => {
                tracing::debug!(%error, "an address cannot be signed");
                Ok(None)
            }
        }
    }

    /// Where ready content lies.
    pub async fn locate(&self, hash: &str) -> Result<Option<BlobPlace>, StoreError> {
        let row = sql::query("SELECT id, bytes, chunk_bytes FROM blobs WHERE hash = ?1 AND state = 'ready'")
            .bind(hash)
            .fetch_optional(self.records.on())
            .await?;
        row.map(|row| {
            Ok(BlobPlace {
                id: row.try_get("id")?,
                bytes: row.try_get::<i64, _>("bytes")? as u64,
                chunk_bytes: row.try_get::<i64, _>("chunk_bytes")? as u64,
            })
        })
        .transpose()
    }

    /// Bytes from `at` on, up to `end`, of one request at most: at least one, and verified. Where they are not what was
    /// written, that is said in words; `None` where the content is not there any more.
    pub async fn piece(
        &self,
        place: BlobPlace,
        at: u64,
        end: u64,
    ) -> Result<Option<Result<Bytes, String>>, StoreError> {
        let chunk = place.chunk_bytes;
        let first = at / chunk;
        let last = (end.max(at + 1) - 1).div_euclid(chunk).min(first + CHUNKS_AT_ONCE - 1);
        let row = sql::query(
            "SELECT object, substring(chunk_hashes FROM CAST(?2 AS INTEGER) FOR CAST(?3 AS INTEGER)) AS hashes FROM blobs WHERE id = ?1 AND state = 'ready'",
        )
        .bind(place.id)
        .bind((first * HASH_BYTES) as i64 + 1)
        .bind(((last - first + 1) * HASH_BYTES) as i64)
        .fetch_optional(self.records.on())
        .await?;
        let Some(row) = row else { return Ok(None) };
        let (path, hashes): (String, Vec<u8>) = (row.try_get("object")?, row.try_get("hashes")?);
        let range = first * chunk..((last + 1) * chunk).min(place.bytes);
        let path = Path::from(path);
        let mut found = self.range(&path, range.clone(), chunk, &hashes).await?;
        if found.is_err() {
            // What was damaged on its way is not damaged where it lies.
            found = self.range(&path, range.clone(), chunk, &hashes).await?;
        }
        let cut = (at - range.start) as usize..(end.min(range.end) - range.start) as usize;
        Ok(Some(found.map(|bytes| bytes.slice(cut))))
    }

    /// Bytes of whole chunks, which have the hashes given; or how they do not.
    fn range<'a>(
        &'a self,
        path: &'a Path,
        range: Range<u64>,
        chunk: u64,
        hashes: &'a [u8],
    ) -> BoxFuture<'a, Result<Result<Bytes, String>, StoreError>> {
        Box::pin(async move {
            self.ensure_paired().await?;
            let bytes = match self.store.get_range(path, range.clone()).await {
                Ok(bytes) => bytes,
                Err(error) if is_missing(&error) => return Ok(Err("is missing".to_owned())),
                Err(error) => return Err(self.failed(&error)),
            };
            if bytes.len() as u64 != range.end - range.start {
                return Ok(Err(format!("has {} of {} bytes", bytes.len(), range.end - range.start)));
            }
            let (whole, hashes) = (bytes.clone(), hashes.to_vec());
            let right = super::blobs::blocking(move || {
                let mut chunks = whole.chunks(chunk as usize).zip(hashes.as_chunks::<32>().0);
                hashes.len() == HASH_BYTES as usize * whole.len().div_ceil(chunk as usize)
                    && chunks.all(|(chunk, hash)| blake3::hash(chunk).as_bytes() == hash)
            })
            .await?;
            Ok(if right { Ok(bytes) } else { Err("hashes to another value".to_owned()) })
        })
    }

    /// The hash of an object and its bytes, read from beginning to end.
    pub async fn hash(&self, id: i64) -> Result<(String, u64), StoreError> {
        self.ensure_paired().await?;
        let path = self.path(id).await?;
        let missing = |error: object_store::Error| match is_missing(&error) {
            true => StoreError::Corrupt { detail: "its object is missing".to_owned() },
            false => self.failed(&error),
        };
        // In pieces: a request has its time, and an object may take longer.
        let size = self.patient.head(&path).await.map_err(missing)?.size;
        let (mut hasher, mut at) = (blake3::Hasher::new(), 0);
        while at < size {
            let bytes = self.patient.get_range(&path, at..(at + PART_BYTES as u64).min(size)).await.map_err(missing)?;
            at += bytes.len() as u64;
            hasher = super::blobs::blocking(move || {
                hasher.update(&bytes);
                hasher
            })
            .await?;
        }
        Ok((hasher.finalize().to_hex().to_string(), hasher.count()))
    }

    /// Whether an object is there and has so many bytes. The store has verified each of its parts when it took them.
    pub async fn is_there(&self, place: BlobPlace) -> Result<bool, StoreError> {
        self.ensure_paired().await?;
        match self.store.head(&self.path(place.id).await?).await {
            Ok(found) => Ok(found.size == place.bytes),
            Err(error) if is_missing(&error) => Ok(false),
            Err(error) => Err(self.failed(&error)),
        }
    }

    async fn path(&self, id: i64) -> Result<Path, StoreError> {
        let object: Option<String> = sql::query_scalar("SELECT object FROM blobs WHERE id = ?1")
            .bind(id)
            .fetch_optional(self.records.on())
            .await?;
        object.map(Path::from).ok_or_else(|| StoreError::Corrupt { detail: "its row is gone".to_owned() })
    }

    /// Begins an upload. Its row comes first, so that what a crash leaves is known. A `patient` one waits for minutes
    /// for a store that does not answer.
    pub async fn begin(&self, hash: &str, bytes: u64, patient: bool, now_ms: i64) -> Result<Upload, StoreError> {
        let begun = self.begin_where(hash, bytes, patient, now_ms, true).await?;
        begun.ok_or_else(|| StoreError::Unavailable { detail: "no upload could be begun".to_owned() })
    }

    /// Begins an upload in a hurry, unless content of this hash is ready.
    pub async fn begin_unless_ready(&self, hash: &str, bytes: u64, now_ms: i64) -> Result<Option<Upload>, StoreError> {
        self.begin_where(hash, bytes, false, now_ms, false).await
    }

    async fn begin_where(
        &self,
        hash: &str,
        bytes: u64,
        patient: bool,
        now_ms: i64,
        even_if_ready: bool,
    ) -> Result<Option<Upload>, StoreError> {
        self.ensure_paired().await?;
        let object = format!("b/{}", Uuid::now_v7());
        let id = sql::query_scalar(
            "INSERT INTO blobs (hash, bytes, chunk_bytes, state, created_ms, touched_ms, object)
             SELECT ?1, ?2, ?3, 'pending', ?4, ?4, ?5
             WHERE ?6 <> 0 OR NOT EXISTS (SELECT 1 FROM blobs WHERE hash = ?1 AND state = 'ready') RETURNING id",
        )
        .bind(hash)
        .bind(bytes as i64)
        .bind(CHUNK_BYTES as i64)
        .bind(now_ms)
        .bind(&object)
        .bind(i64::from(even_if_ready))
        .fetch_optional(self.records.on())
        .await?;
        Ok(id.map(|id| Upload {
            id,
            path: Path::from(object),
            patient,
            parts: None,
            flying: JoinSet::new(),
            piece: BytesMut::new(),
            hashes: Vec::new(),
            bytes: 0,
        }))
    }

    /// Writes chunks, all but the last of the content of the full size.
    pub async fn write(&self, upload: &mut Upload, chunks: &[Bytes], now_ms: i64) -> Result<(), StoreError> {
        for chunk in chunks {
            upload.hashes.extend_from_slice(blake3::hash(chunk).as_bytes());
            upload.piece.extend_from_slice(chunk);
            upload.bytes += chunk.len() as u64;
            // The last part is written at the end: where it is the only one, it is an object by itself.
            if upload.piece.len() >= PART_BYTES {
                self.write_part(upload).await?;
                let touched = sql::query("UPDATE blobs SET touched_ms = ?1 WHERE id = ?2 AND state = 'pending'")
                    .bind(now_ms)
                    .bind(upload.id)
                    .execute(self.records.on())
                    .await;
                match touched {
                    Ok(touched) if touched > 0 => {}
                    Ok(_) => {
                        return Err(StoreError::Unavailable {
                            detail: "the upload took too long and was given up".to_owned(),
                        });
                    }
                    // It is told again with the next part, and an hour may pass until then.
                    Err(error) if upload.patient => {
                        tracing::warn!(%error, "recording the upload in the database was deferred")
                    }
                    Err(error) => return Err(error.into()),
                }
            }
        }
        Ok(())
    }

    fn for_upload(&self, patient: bool) -> &dyn ObjectStore {
        if patient { &*self.patient } else { &*self.store }
    }

    async fn write_part(&self, upload: &mut Upload) -> Result<(), StoreError> {
        let parts = match &mut upload.parts {
            Some(parts) => parts,
            None => {
                let parts = self
                    .for_upload(upload.patient)
                    .put_multipart(&upload.path)
                    .await
                    .map_err(|error| self.failed(&error))?;
                upload.parts.insert(parts)
            }
        };
        while upload.flying.len() >= PARTS_AT_ONCE
            && let Some(part) = upload.flying.join_next().await
        {
            landed(part)?;
        }
        upload.flying.spawn(parts.put_part(PutPayload::from_bytes(upload.piece.split().freeze())));
        Ok(())
    }

    /// Ends the writing of an upload: its object is there from then on, and seen by nobody.
    pub async fn seal(&self, upload: &mut Upload, bytes: u64) -> Result<Sealed, StoreError> {
        if upload.bytes != bytes {
            return Err(StoreError::Corrupt { detail: format!("{} of {bytes} bytes were written", upload.bytes) });
        }
        if upload.parts.is_some() {
            if !upload.piece.is_empty() {
                self.write_part(upload).await?;
            }
            while let Some(part) = upload.flying.join_next().await {
                landed(part)?;
            }
            if let Some(parts) = &mut upload.parts
                && let Err(error) = parts.complete().await
            {
                // Where only the answer was lost, a second try finds that there is no such upload any more; the object
                // is there.
                let there = self.for_upload(upload.patient).head(&upload.path).await;
                if !there.is_ok_and(|found| found.size == bytes) {
                    return Err(self.failed(&error));
                }
            }
        } else {
            let whole = PutPayload::from_bytes(upload.piece.split().freeze());
            self.for_upload(upload.patient).put(&upload.path, whole).await.map_err(|error| self.failed(&error))?;
        }
        upload.parts = None;
        let found = self.for_upload(upload.patient).head(&upload.path).await.map_err(|error| self.failed(&error))?.size;
        if found != bytes {
            return Err(StoreError::Corrupt { detail: format!("the object has {found} of {bytes} bytes") });
        }
        Ok(Sealed { id: upload.id, hashes: std::mem::take(&mut upload.hashes), bytes })
    }

    /// Makes what was sealed ready under its hash, where no other content is. False where there is some, or the upload
    /// is no longer known: nothing has changed.
    pub async fn make_ready_at_once(&self, sealed: &Sealed, hash: &str) -> Result<bool, StoreError> {
        let made = sql::query(
            "UPDATE blobs SET state = 'ready', hash = ?2, bytes = ?3, chunk_hashes = ?4
             WHERE id = ?1 AND state = 'pending' AND NOT EXISTS (SELECT 1 FROM blobs WHERE hash = ?2 AND state = 'ready')",
        )
        .bind(sealed.id)
        .bind(hash)
        .bind(sealed.bytes as i64)
        .bind(sealed.hashes.clone())
        .execute(self.records.on())
        .await;
        match made {
            Ok(made) => Ok(made > 0),
            // Someone else wrote the same content meanwhile.
            Err(sqlx::Error::Database(error)) if error.is_unique_violation() => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Makes what was sealed ready under its hash, in the place of a damaged one. Where the answer of the database was
    /// lost, it may be asked again.
    pub async fn make_ready(
        &self,
        sealed: &Sealed,
        hash: &str,
        damaged: Option<i64>,
        now_ms: i64,
    ) -> Result<(), StoreError> {
        for _ in 0..3 {
            if self.try_ready(sealed, hash, damaged, now_ms).await? == Finished::Ready {
                return Ok(());
            }
        }
        Err(StoreError::Busy { detail: format!("content {hash} keeps being deleted and re-created") })
    }

    async fn try_ready(
        &self,
        sealed: &Sealed,
        hash: &str,
        damaged: Option<i64>,
        now_ms: i64,
    ) -> Result<Finished, StoreError> {
        let mut transaction = self.records.write().await?;
        if let Some(damaged) = damaged {
            sql::query("UPDATE blobs SET state = 'gone', touched_ms = ?2 WHERE id = ?1")
                .bind(damaged)
                .bind(now_ms)
                .execute(transaction.on())
                .await?;
        }
        let other: Option<i64> =
            sql::query_scalar("UPDATE blobs SET condemned_ms = NULL WHERE hash = ?1 AND state = 'ready' RETURNING id")
                .bind(hash)
                .fetch_optional(transaction.on())
                .await?;
        if other == Some(sealed.id) {
            // It was made ready before, and the answer that said so was lost.
            transaction.commit().await?;
            return Ok(Finished::Ready);
        }
        let made = sql::query(match other {
            // Someone else wrote the same content meanwhile.
            Some(_) => {
                "UPDATE blobs SET state = 'gone', hash = ?2, bytes = ?3, chunk_hashes = ?4 WHERE id = ?1 AND state = 'pending'"
            }
            None => {
                "UPDATE blobs SET state = 'ready', hash = ?2, bytes = ?3, chunk_hashes = ?4 WHERE id = ?1 AND state = 'pending'"
            }
        })
        .bind(sealed.id)
        .bind(hash)
        .bind(sealed.bytes as i64)
        .bind(sealed.hashes.clone())
        .execute(transaction.on())
        .await;
        match made {
            Ok(0) if other.is_none() => {
                Err(StoreError::Unavailable { detail: "the upload took too long and was given up".to_owned() })
            }
            Ok(_) => {
                transaction.commit().await?;
                Ok(Finished::Ready)
            }
            Err(sqlx::Error::Database(error)) if error.is_unique_violation() => Ok(Finished::Raced),
            Err(error) => Err(error.into()),
        }
    }

    /// Gives an upload up.
    pub async fn abandon(&self, upload: &mut Upload) {
        upload.flying.shutdown().await;
        if let Some(mut parts) = upload.parts.take() {
            let _ = parts.abort().await;
        }
        // The row first: where it is no longer pending, its object is in use, though the answer that said so was lost.
        // What cannot be cleared now is collected later.
        let given_up = sql::query("UPDATE blobs SET state = 'gone' WHERE id = ?1 AND state = 'pending'")
            .bind(upload.id)
            .execute(self.records.on())
            .await;
        if given_up.is_ok_and(|rows| rows > 0) {
            let _ = self.store.delete(&upload.path).await;
        }
    }

    /// Bytes of all ready content but what is condemned.
    pub async fn all_bytes(&self) -> Result<u64, StoreError> {
        let bytes: i64 = sql::query_scalar(
            "SELECT CAST(COALESCE(SUM(bytes), 0) AS BIGINT) FROM blobs WHERE state = 'ready' AND condemned_ms IS NULL",
        )
        .fetch_one(self.records.on())
        .await?;
        Ok(bytes as u64)
    }

    /// Every ready piece of content: its identifier, its hash and its bytes.
    pub async fn all(&self) -> Result<Vec<(i64, String, u64)>, StoreError> {
        let rows = sql::query("SELECT id, hash, bytes FROM blobs WHERE state = 'ready' ORDER BY id")
            .fetch_all(self.records.on())
            .await?;
        rows.iter()
            .map(|row| Ok((row.try_get("id")?, row.try_get("hash")?, row.try_get::<i64, _>("bytes")? as u64)))
            .collect()
    }

    /// Where the objects are, for people; without keys.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What went wrong. Of a store that has not answered it is not known whether it comes back as the same.
    fn failed(&self, error: &object_store::Error) -> StoreError {
        let failed = failure(error);
        if matches!(failed, StoreError::Unavailable { .. }) {
            self.pair.forget();
        }
        failed
    }
}

/// What became of a part that was on its way.
fn landed(part: Result<Result<(), object_store::Error>, JoinError>) -> Result<(), StoreError> {
    match part {
        Ok(sent) => sent.map_err(|error| failure(&error)),
        Err(error) => Err(StoreError::Unavailable { detail: format!("a task ended early: {error}") }),
    }
}
