//! Bases: records, decoded bases by way of the cache, and how a new one is written down.

use std::sync::Arc;

use bytes::Bytes;
use sqlx::{QueryBuilder, Row, sqlite::SqliteRow};
use uuid::Uuid;

use super::{
    BasisFilter, BasisRecord, BasisStorage, JobRecord, Page, PageRequest, Store, StoreError, Weighed, blobs,
    database::WriteTransaction,
    detached, from_json,
    jobs::{job_from_row, uuid_column},
    meshes::push_filter,
    to_json,
};
use crate::basis::{Basis, Functions, npz};

impl Store {
    /// A basis by its identifier.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn basis(&self, id: Uuid) -> Result<BasisRecord, StoreError> {
        sqlx::query("SELECT * FROM bases WHERE id = ?")
            .bind(id.to_string())
            .fetch_optional(self.inner.meta.reader())
            .await?
            .map(|row| basis_from_row(&row))
            .unwrap_or_else(|| Err(unknown_basis(id)))
    }

    /// A page of bases, newest first.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn bases(&self, filter: &BasisFilter, page: &PageRequest) -> Result<Page<BasisRecord>, StoreError> {
        let mut query = QueryBuilder::new("SELECT * FROM bases WHERE sequence < ");
        query.push_bind(page.below()?);
        push_filter(&mut query, "mesh", filter.mesh.as_deref());
        push_filter(&mut query, "kind", filter.kind.as_deref());
        query.push(" ORDER BY sequence DESC LIMIT ").push_bind(page.look_ahead());
        let rows = query.build().fetch_all(self.inner.meta.reader()).await?;
        let rows = rows.iter().map(|row| Ok((row.try_get("sequence")?, basis_from_row(row)?)));
        Ok(Page::from_rows(rows.collect::<Result<_, StoreError>>()?, page))
    }

    /// Deletes a basis. The job that made it stays on record without it; equal work is done anew when it is asked for.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn delete_basis(&self, id: Uuid) -> Result<(), StoreError> {
        let store = self.clone();
        detached(async move { store.delete_basis_now(id).await }).await
    }

    /// Takes a basis out of the caches.
    pub(super) fn forget_basis(&self, id: Uuid, hash: &str) {
        self.inner.bases.remove(&id);
        self.inner.chunks.retain(|(content, _), _| content != hash);
    }

    async fn delete_basis_now(&self, id: Uuid) -> Result<(), StoreError> {
        let _alone = self.inner.blob_use.write().await;
        let mut transaction = self.inner.meta.write().await?;
        let jobs = sqlx::query("UPDATE jobs SET basis = NULL, revision = revision + 1 WHERE basis = ? RETURNING *")
            .bind(id.to_string())
            .fetch_all(transaction.on())
            .await?;
        let hash: Option<String> = sqlx::query_scalar("DELETE FROM bases WHERE id = ? RETURNING content_hash")
            .bind(id.to_string())
            .fetch_optional(transaction.on())
            .await?;
        let Some(hash) = hash else {
            transaction.rollback().await?;
            return Err(unknown_basis(id));
        };
        let jobs = jobs.iter().map(job_from_row).collect::<Result<Vec<JobRecord>, StoreError>>()?;
        transaction.commit().await?;
        self.forget_basis(id, &hash);
        jobs.iter().for_each(|job| self.announce(job));
        self.delete_unreferenced(&[hash]).await
    }

    /// A decoded basis, from the cache or verified and decoded once however many ask. Of a dense one everything but its eigenfunctions,
    /// which are read and verified chunk by chunk when they are needed, on threads that may block.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::Corrupt`] where the content does not verify.
    pub async fn load_basis(&self, id: Uuid) -> Result<Arc<Basis>, StoreError> {
        if let Some(found) = self.inner.bases.get(&id) {
            self.count_hit(true);
            return Ok(found.value);
        }
        // Held until the value is in the cache, so that a deletion comes before or after, not between.
        let _in_use = self.inner.blob_use.read().await;
        let loaded = self.inner.bases.get_or_insert_async(&id, async {
            self.count_hit(false);
            let record = self.basis(id).await?;
            let (basis, bytes) = match &record.storage {
                BasisStorage::Compact => {
                    let content = self.verified_blob(&record.content_hash).await?;
                    let bytes = content.len() as u64;
                    (blobs::blocking(move || decode(&content)).await??, bytes)
                }
                BasisStorage::Dense(layout) => self.read_dense(&record, layout).await?,
            };
            Ok::<_, StoreError>(Weighed { value: Arc::new(basis), bytes })
        });
        Ok(loaded.await?.value)
    }
}

/// A basis whose content is stored, and what its record will say.
pub(super) struct WrittenBasis {
    /// The basis as it is read from the store: eigenfunctions of a dense one stay there.
    pub basis: Arc<Basis>,
    pub storage: BasisStorage,
    pub hash: String,
    pub bytes: u64,
    certificate: String,
}

impl Store {
    /// Writes the content of a basis. Deterministic, so that equal bases have equal hashes. `None` where the attempt that holds the lease
    /// `token` is not wanted any more. The caller holds `blob_use` for reading until something refers to the content.
    pub(super) async fn put_basis(&self, token: Uuid, basis: Basis) -> Result<Option<WrittenBasis>, StoreError> {
        let certificate = to_json(&basis.certificate)?;
        if let Functions::Dense(_) = &basis.functions {
            return Ok(self.put_dense(token, basis).await?.map(|dense| WrittenBasis {
                basis: Arc::new(dense.basis),
                storage: BasisStorage::Dense(dense.layout),
                hash: dense.hash,
                bytes: dense.bytes,
                certificate,
            }));
        }
        let basis = Arc::new(basis);
        let shared = Arc::clone(&basis);
        let content = blobs::blocking(move || encode(&shared).map(Bytes::from)).await??;
        let hash = blobs::hash_of(&content).await?;
        self.put_blob(&hash, &content).await?;
        let bytes = content.len() as u64;
        Ok(Some(WrittenBasis { basis, storage: BasisStorage::Compact, hash, bytes, certificate }))
    }
}

impl WrittenBasis {
    /// Writes the record down as the result of a job.
    pub async fn insert(
        &self,
        transaction: &mut WriteTransaction,
        job: &JobRecord,
        stage_seconds: &[(String, f64)],
        now_ms: i64,
    ) -> Result<Uuid, StoreError> {
        let id = Uuid::now_v7();
        let basis = &self.basis;
        let eigenvalues: Vec<u8> = basis.eigenvalues.iter().flat_map(|value| value.to_le_bytes()).collect();
        sqlx::query(
            "INSERT INTO bases (id, mesh, job, kind, parameters, vertices, dimension, pairs, nonzeros, eigenvalues,
                certificate, bytes, dense_bytes, content_hash, solver_version, stage_seconds, created_ms, storage, layout,
                operator)
             VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        )
        .bind(id.to_string())
        .bind(&job.mesh)
        .bind(job.id.to_string())
        .bind(&job.kind)
        .bind(to_json(&job.parameters)?)
        .bind(basis.vertices() as i64)
        .bind(basis.dimension().unwrap_or(0) as i64)
        .bind(basis.count() as i64)
        .bind(basis.compact().map_or(0, |compact| compact.space.entries()) as i64)
        .bind(eigenvalues)
        .bind(&self.certificate)
        .bind(self.bytes as i64)
        .bind(basis.dense_bytes() as i64)
        .bind(&self.hash)
        .bind(&job.solver_version)
        .bind(to_json(stage_seconds)?)
        .bind(now_ms)
        .bind(self.storage.name())
        .bind(match &self.storage {
            BasisStorage::Compact => None,
            BasisStorage::Dense(layout) => Some(to_json(layout.as_ref())?),
        })
        .bind(to_json(&basis.metadata["operator"])?)
        .execute(transaction.on())
        .await?;
        Ok(id)
    }

    /// Puts the basis into the cache: whoever waited for the job asks for it next.
    pub fn remember(&self, store: &Store, id: Uuid) {
        let bytes = match &self.storage {
            BasisStorage::Compact => self.bytes,
            BasisStorage::Dense(layout) => self.bytes - (layout.end - layout.start),
        };
        store.inner.bases.insert(id, Weighed { value: Arc::clone(&self.basis), bytes });
    }
}

fn unknown_basis(id: Uuid) -> StoreError {
    StoreError::NotFound { resource: "basis", id: id.to_string() }
}

fn basis_from_row(row: &SqliteRow) -> Result<BasisRecord, StoreError> {
    let layout: Option<&str> = row.try_get("layout")?;
    let storage = match (row.try_get::<&str, _>("storage")?, layout) {
        ("compact", _) => BasisStorage::Compact,
        ("dense", Some(layout)) => BasisStorage::Dense(Arc::new(from_json("layout", layout)?)),
        (other, _) => {
            return Err(StoreError::Corrupt { detail: format!("column storage: {other:?} without a layout") });
        }
    };
    let eigenvalues: &[u8] = row.try_get("eigenvalues")?;
    Ok(BasisRecord {
        id: uuid_column(row, "id")?,
        mesh: row.try_get("mesh")?,
        job: uuid_column(row, "job")?,
        kind: row.try_get("kind")?,
        parameters: from_json("parameters", row.try_get("parameters")?)?,
        vertices: row.try_get::<i64, _>("vertices")? as u64,
        storage,
        dimension: row.try_get::<i64, _>("dimension")? as u64,
        count: row.try_get::<i64, _>("pairs")? as u64,
        nonzeros: row.try_get::<i64, _>("nonzeros")? as u64,
        eigenvalues: eigenvalues.as_chunks::<8>().0.iter().map(|&word| f64::from_le_bytes(word)).collect(),
        certificate: from_json("certificate", row.try_get("certificate")?)?,
        operator: from_json("operator", row.try_get("operator")?)?,
        bytes: row.try_get::<i64, _>("bytes")? as u64,
        dense_bytes: row.try_get::<i64, _>("dense_bytes")? as u64,
        content_hash: row.try_get("content_hash")?,
        solver_version: row.try_get("solver_version")?,
        created_ms: row.try_get("created_ms")?,
        stage_seconds: from_json("stage_seconds", row.try_get("stage_seconds")?)?,
    })
}

fn encode(basis: &Basis) -> Result<Vec<u8>, StoreError> {
    npz::to_bytes(basis).map_err(|error| StoreError::Unavailable { detail: format!("the basis: {error}") })
}

fn decode(content: &[u8]) -> Result<Basis, StoreError> {
    npz::read(content).map_err(|error| StoreError::Corrupt { detail: format!("the basis: {error}") })
}
