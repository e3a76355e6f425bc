//! Bases: records, decoded products by way of the cache, and how a new one is written down.

use std::{io::Cursor, sync::Arc};

use bytes::Bytes;
use chladni_mesh::numbering::Numbering;
use chladni_spectral::basis::family::FamilyBasis;
use chladni_spectral::basis::modal::ModalBasis;
use chladni_spectral::basis::{
    Basis, EIGENBASIS_PART, Product, ProductKind, StoredFields, StoredMaps, StoredPart, Summary,
};
use chladni_spectral::formats::{FormatError, npz};
use futures_util::future::BoxFuture;
use uuid::Uuid;

use super::{
    BasisFilter, BasisRecord, BasisStorage, JobRecord, Page, PageRequest, Store, StoreError, Weighed, blobs,
    catalog::Transaction,
    detached,
    fields::{self, Of},
    from_json, job_bases,
    jobs::{self, job_from_row, uuid_column},
    pagination::Listing,
    piece_writer::PieceWriter,
    sql::{self, Query, Row},
    to_json,
};

/// A compact basis of so many bytes is written as it is encoded. A smaller one is encoded first: then it is known
/// whether it is there already.
const STREAMED_FROM: u64 = 256 << 20;

impl Store {
    /// A basis by its identifier. What a part of another job made is none.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn basis(&self, id: Uuid) -> Result<BasisRecord, StoreError> {
        sql::query("SELECT * FROM bases WHERE id = ? AND kind <> 'eigenbasis_part'")
            .bind(id.to_string())
            .fetch_optional(self.inner.catalog.reader())
            .await?
            .map(|row| basis_from_row(&row))
            .unwrap_or_else(|| Err(unknown_basis(id)))
    }

    /// A page of bases, newest first.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn bases(&self, filter: &BasisFilter, page: &PageRequest) -> Result<Page<BasisRecord>, StoreError> {
        let list = Listing::new(&self.inner.catalog, "SELECT * FROM bases WHERE sequence < ", page)?;
        list.with("mesh", filter.mesh.as_deref())
            .with("kind", filter.kind.as_deref())
            .without("kind", Some(EIGENBASIS_PART))
            .read(basis_from_row)
            .await
    }

    /// Deletes a basis, and the fields that were designed in it. The job that made it stays on record without it; equal
    /// work is done anew when it is asked for.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::BasisInUse`] where a job needs it that waits or runs.
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
        let mut transaction = self.inner.catalog.write().await?;
        let jobs =
            sql::query(jobs::returning!("UPDATE jobs SET basis = NULL, revision = revision + 1 WHERE basis = ?"))
                .bind(id.to_string())
                .fetch_all(transaction.on())
                .await?;
        // After the job, as whoever stores a result goes.
        let known = transaction.locking("SELECT sequence FROM bases WHERE id = ?");
        let known: Option<i64> = sql::query_scalar(known).bind(id.to_string()).fetch_optional(transaction.on()).await?;
        let free = match known {
            Some(_) => job_bases::refuse_needed(&mut transaction, id).await,
            None => Err(unknown_basis(id)),
        };
        if let Err(refusal) = free {
            transaction.rollback().await?;
            return Err(refusal);
        }
        let hash: String = sql::query_scalar("DELETE FROM bases WHERE id = ? RETURNING content_hash")
            .bind(id.to_string())
            .fetch_one(transaction.on())
            .await?;
        let mut hashes = fields::take(&mut transaction, Of::Basis, &id.to_string()).await?;
        let jobs = jobs.iter().map(job_from_row).collect::<Result<Vec<JobRecord>, StoreError>>()?;
        transaction.commit().await?;
        self.forget_basis(id, &hash);
        jobs.iter().for_each(|job| self.announce(job));
        hashes.push(hash);
        self.delete_unreferenced(&hashes).await
    }

    /// A decoded product, from the cache or verified and decoded once however many ask. Of a dense eigenbasis
    /// everything but its eigenfunctions, which are read and verified chunk by chunk when they are needed, on threads
    /// that may block.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::Damaged`] where the content does not verify.
    pub fn load_product(&self, id: Uuid) -> BoxFuture<'_, Result<Product, StoreError>> {
        Box::pin(async move {
            self.use_basis(id);
            if let Some(found) = self.inner.bases.get(&id) {
                self.count_hit(true);
                if self.is_shared() {
                    // Another process may have deleted it.
                    self.basis(id).await.inspect_err(|_| {
                        self.inner.bases.remove(&id);
                    })?;
                }
                return Ok(found.value);
            }
            // Held until the value is in the cache, so that a deletion comes before or after, not between.
            let _in_use = self.inner.blob_use.read().await;
            let loaded = self.inner.bases.get_or_insert_async(&id, async {
                self.count_hit(false);
                let record = self.basis(id).await?;
                let (product, bytes) = match &record.storage {
                    BasisStorage::Compact => {
                        let kind = ProductKind::of_name(&record.kind).ok_or_else(|| StoreError::Corrupt {
                            detail: format!("column kind: {:?} is not a kind of basis", record.kind),
                        })?;
                        let content = self.verified_blob(&record.content_hash).await?;
                        let bytes = content.len() as u64;
                        (blobs::blocking(move || Product::read_npz(kind, &content)).await?.map_err(damaged)?, bytes)
                    }
                    BasisStorage::Dense(layout) => {
                        let (basis, bytes) = self.read_dense(&record, layout).await?;
                        (basis.into(), bytes)
                    }
                };
                let bytes = bytes + product.derived_bytes();
                Ok::<_, StoreError>(Weighed { value: product, bytes })
            });
            Ok(loaded.await?.value)
        })
    }

    /// A decoded eigenbasis, as [`load_product`](Self::load_product) gives it.
    ///
    /// # Errors
    /// [`StoreError::BasisKind`] where the basis is of another kind, and those of [`load_product`](Self::load_product).
    pub async fn load_basis(&self, id: Uuid) -> Result<Arc<Basis>, StoreError> {
        match self.load_product(id).await? {
            Product::Eigenbasis(basis) => Ok(basis),
            other => Err(wrong_kind(id, &other, ProductKind::Eigenbasis)),
        }
    }

    /// Decoded eigenvectors, of an operator on a mesh or of a problem: what does not need the mesh works with both.
    ///
    /// # Errors
    /// As [`load_basis`](Self::load_basis).
    pub async fn load_eigenvectors(&self, id: Uuid) -> Result<Arc<Basis>, StoreError> {
        match self.load_product(id).await? {
            Product::Eigenbasis(basis) | Product::PencilBasis(basis) => Ok(basis),
            other => Err(wrong_kind(id, &other, ProductKind::Eigenbasis)),
        }
    }

    /// A decoded family of operators, as [`load_product`](Self::load_product) gives it.
    ///
    /// # Errors
    /// [`StoreError::BasisKind`] where the basis is of another kind, and those of [`load_product`](Self::load_product).
    pub async fn load_family(&self, id: Uuid) -> Result<Arc<FamilyBasis>, StoreError> {
        match self.load_product(id).await? {
            Product::OperatorFamily(family) => Ok(family),
            other => Err(wrong_kind(id, &other, ProductKind::OperatorFamily)),
        }
    }

    /// Decoded vibration modes, as [`load_product`](Self::load_product) gives them.
    ///
    /// # Errors
    /// [`StoreError::BasisKind`] where the basis is of another kind, and those of [`load_product`](Self::load_product).
    pub async fn load_modes(&self, id: Uuid) -> Result<Arc<ModalBasis>, StoreError> {
        match self.load_product(id).await? {
            Product::VibrationBasis(modes) => Ok(modes),
            other => Err(wrong_kind(id, &other, ProductKind::VibrationBasis)),
        }
    }

    /// A decoded field basis, as [`load_product`](Self::load_product) gives it.
    ///
    /// # Errors
    /// [`StoreError::BasisKind`] where the basis is of another kind, and those of [`load_product`](Self::load_product).
    pub async fn load_fields(&self, id: Uuid) -> Result<Arc<StoredFields>, StoreError> {
        match self.load_product(id).await? {
            Product::FieldBasis(fields) => Ok(fields),
            other => Err(wrong_kind(id, &other, ProductKind::FieldBasis)),
        }
    }

    /// Decoded maps between shapes, as [`load_product`](Self::load_product) gives them.
    ///
    /// # Errors
    /// [`StoreError::BasisKind`] where the basis is of another kind, and those of [`load_product`](Self::load_product).
    pub async fn load_maps(&self, id: Uuid) -> Result<Arc<StoredMaps>, StoreError> {
        match self.load_product(id).await? {
            Product::MapCollection(maps) => Ok(maps),
            other => Err(wrong_kind(id, &other, ProductKind::MapCollection)),
        }
    }
}

/// Inserts the record of a basis for each row of a job, of a table or what stands in its place. The values are those of
/// [`WrittenBasis::bind`].
macro_rules! insert {
    ($job:literal) => {
        concat!(
            "INSERT INTO bases (id, mesh, job, kind, parameters, vertices, dimension, pairs, nonzeros, eigenvalues,
                certificate, bytes, dense_bytes, content_hash, solver_version, stage_seconds, created_ms, storage, layout,
                operator, row_count, details, used_ms)
             SELECT ?1, ", $job, ".mesh, ", $job, ".id, ?5,
                (SELECT shown FROM job_parameters WHERE job_parameters.job = ", $job, ".id),
                (SELECT vertices FROM meshes WHERE meshes.id = ", $job, ".mesh), ?6, ?7, ?8, ?9,
                ?10, ?11, ?12, ?13, ", $job, ".solver_version, ?2, ?3, ?14, ?15, ?16, ?17, ?18, ?3 FROM ", $job
        )
    };
}

pub(super) use insert;

/// A basis whose content is stored, and what its record will say.
pub(super) struct WrittenBasis {
    /// The product as it is read from the store: columns of a dense basis stay there.
    product: Product,
    summary: Summary,
    pub storage: BasisStorage,
    pub hash: String,
    pub bytes: u64,
}

impl Store {
    /// Writes the content of a product. Deterministic, so that equal ones have equal hashes. `None` where the attempt
    /// that holds the lease `token` is not wanted any more. The caller holds `blob_use` for reading until something
    /// refers to the content.
    pub(super) async fn put_product(
        &self,
        token: Uuid,
        product: Product,
        numbering: Option<Arc<Numbering>>,
    ) -> Result<Option<WrittenBasis>, StoreError> {
        let unwritten_summary = |error| StoreError::Unavailable { detail: format!("JSON: {error}") };
        let summary = product.summary().map_err(unwritten_summary)?;
        let product = match product.in_columns() {
            Ok(basis) => {
                return Ok(self.put_dense(token, basis, numbering).await?.map(|dense| WrittenBasis {
                    product: dense.basis.into(),
                    summary,
                    storage: BasisStorage::Dense(dense.layout),
                    hash: dense.hash,
                    bytes: dense.bytes,
                }));
            }
            Err(other) => other,
        };
        if let Product::Eigenbasis(basis) = &product
            && basis.stored_bytes() >= STREAMED_FROM
        {
            let basis = Arc::clone(basis);
            let make =
                move |out: &mut PieceWriter| npz::write_stream(&basis, numbering.as_deref(), out).map_err(unwritten);
            // A little more than the columns, for all that a basis has beside them.
            let expected = product.stored_bytes() + product.stored_bytes() / 8;
            let Some(((), hash, bytes)) = self.put_made(expected, token, make).await? else { return Ok(None) };
            return Ok(Some(WrittenBasis { product, summary, storage: BasisStorage::Compact, hash, bytes }));
        }
        let shared = product.clone();
        let content = match shared {
            // It is encoded already.
            Product::EigenbasisPart(part) => Bytes::from_owner(PartContent(part)),
            shared => blobs::blocking(move || encode(&shared, numbering.as_deref())).await??,
        };
        let hash = blobs::hash_of(&content).await?;
        self.patiently(|| Box::pin(self.put_blob(&hash, &content))).await?;
        let bytes = content.len() as u64;
        Ok(Some(WrittenBasis { product, summary, storage: BasisStorage::Compact, hash, bytes }))
    }
}

impl WrittenBasis {
    /// Writes the record down as the result of a job. A job that was done anew, because its basis was damaged, gives
    /// the basis its old identifier.
    pub async fn insert(
        &self,
        transaction: &mut Transaction,
        job: &JobRecord,
        stage_seconds: &[(String, f64)],
        now_ms: i64,
    ) -> Result<Uuid, StoreError> {
        let before: Option<String> = sql::query_scalar("DELETE FROM bases WHERE job = ? RETURNING id")
            .bind(job.id.to_string())
            .fetch_optional(transaction.on())
            .await?;
        let id = before.and_then(|id| Uuid::try_parse(&id).ok()).unwrap_or_else(Uuid::now_v7);
        let query = sql::query(concat!(insert!("jobs"), " WHERE jobs.id = ?4"));
        self.bind(query, id, stage_seconds, now_ms, &job.id.to_string())?.execute(transaction.on()).await?;
        Ok(id)
    }

    /// Gives a statement around [`insert!`] its values; `key` is the fourth.
    pub fn bind(
        &self,
        query: Query,
        id: Uuid,
        stage_seconds: &[(String, f64)],
        now_ms: i64,
        key: &str,
    ) -> Result<Query, StoreError> {
        let summary = &self.summary;
        let eigenvalues: Vec<u8> = summary.eigenvalues.iter().flat_map(|value| value.to_le_bytes()).collect();
        let layout = match &self.storage {
            BasisStorage::Compact => None,
            BasisStorage::Dense(layout) => Some(to_json(layout.as_ref())?),
        };
        Ok(query
            .bind(id.to_string())
            .bind(to_json(stage_seconds)?)
            .bind(now_ms)
            .bind(key)
            .bind(self.product.kind().name())
            .bind(summary.dimension.unwrap_or(0) as i64)
            .bind(summary.count as i64)
            .bind(summary.nonzeros.unwrap_or(0) as i64)
            .bind(eigenvalues)
            .bind(to_json(&summary.certificate)?)
            .bind(self.bytes as i64)
            .bind(summary.dense_bytes as i64)
            .bind(&self.hash)
            .bind(self.storage.name())
            .bind(layout)
            .bind(to_json(&summary.operator)?)
            .bind(summary.rows as i64)
            .bind(to_json(&summary.details)?))
    }

    /// Puts the basis into the cache: whoever waited for the job asks for it next.
    pub fn remember(&self, store: &Store, id: Uuid) {
        // A part is read once, by who joins it.
        if matches!(self.product, Product::EigenbasisPart(_)) {
            return;
        }
        let bytes = match &self.storage {
            BasisStorage::Compact => self.bytes,
            BasisStorage::Dense(layout) => self.bytes - (layout.end - layout.start),
        };
        let bytes = bytes + self.product.derived_bytes();
        store.inner.bases.insert(id, Weighed { value: self.product.clone(), bytes });
    }
}

fn unknown_basis(id: Uuid) -> StoreError {
    StoreError::NotFound { resource: "basis", id: id.to_string() }
}

fn basis_from_row(row: &Row) -> Result<BasisRecord, StoreError> {
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
        rows: row.try_get::<i64, _>("row_count")? as u64,
        storage,
        dimension: row.try_get::<i64, _>("dimension")? as u64,
        count: row.try_get::<i64, _>("pairs")? as u64,
        nonzeros: row.try_get::<i64, _>("nonzeros")? as u64,
        eigenvalues: eigenvalues.as_chunks::<8>().0.iter().map(|&word| f64::from_le_bytes(word)).collect(),
        certificate: from_json("certificate", row.try_get("certificate")?)?,
        operator: from_json("operator", row.try_get("operator")?)?,
        details: from_json("details", row.try_get("details")?)?,
        bytes: row.try_get::<i64, _>("bytes")? as u64,
        dense_bytes: row.try_get::<i64, _>("dense_bytes")? as u64,
        content_hash: row.try_get("content_hash")?,
        solver_version: row.try_get("solver_version")?,
        created_ms: row.try_get("created_ms")?,
        stage_seconds: from_json("stage_seconds", row.try_get("stage_seconds")?)?,
    })
}

/// The bytes of a part, without a copy.
struct PartContent(Arc<StoredPart>);

impl AsRef<[u8]> for PartContent {
    fn as_ref(&self) -> &[u8] {
        self.0.content()
    }
}

fn encode(product: &Product, numbering: Option<&Numbering>) -> Result<Bytes, StoreError> {
    let maps = numbering.map_or(0, |numbering| 4 * (numbering.file_vertices() + numbering.kept_faces()));
    let mut out = Cursor::new(Vec::with_capacity(product.stored_bytes() as usize + maps + (1 << 16)));
    product.write_npz_numbered(numbering, &mut out).map_err(unwritten)?;
    Ok(out.into_inner().into())
}

fn unwritten(error: FormatError) -> StoreError {
    StoreError::Unavailable { detail: format!("the basis: {error}") }
}

fn damaged(error: FormatError) -> StoreError {
    StoreError::Corrupt { detail: format!("the basis: {error}") }
}

fn wrong_kind(id: Uuid, product: &Product, wanted: ProductKind) -> StoreError {
    StoreError::BasisKind { basis: id, kind: product.kind(), wanted }
}
