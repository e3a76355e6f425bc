//! Fields with a row for each face of a mesh: uploaded tables, and fields that were designed; known by their content,
//! each stored once.

use std::sync::Arc;

use bytes::Bytes;
use chladni_spectral::formats::npz;

use super::catalog::Transaction;
use super::sources::{ID_DIGITS, SourceKind};
use super::{
    FieldFilter, FieldRecord, NewField, Page, PageRequest, Store, StoreError, Stored, blobs, detached, from_json,
    pagination::Listing,
    sql::{self, Row},
    to_json,
};

/// What fields go with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    Mesh,
    Basis,
}

/// Deletes the rows of all fields of a mesh or a basis, and gives the hashes of their content.
pub(super) async fn take(on: &mut Transaction, of: Of, id: &str) -> Result<Vec<String>, StoreError> {
    let text = match of {
        Of::Mesh => "DELETE FROM fields WHERE mesh = ? RETURNING content_hash",
        Of::Basis => "DELETE FROM fields WHERE basis = ? RETURNING content_hash",
    };
    let rows = sql::query(text).bind(id).fetch_all(on.on()).await?;
    rows.iter().map(|row| Ok(row.try_get("content_hash")?)).collect()
}

impl Store {
    /// Stores a field, or finds it where an equal one is known. The name of a known one stays as it was; content that
    /// was damaged is written anew.
    ///
    /// # Errors
    /// [`StoreError::NotFound`] where the mesh or the basis is not there; [`StoreError::StorageFull`],
    /// [`StoreError::Busy`].
    pub async fn add_field(&self, new: NewField) -> Result<Stored<FieldRecord>, StoreError> {
        let store = self.clone();
        detached(async move { store.add_field_now(new).await }).await
    }

    async fn add_field_now(&self, new: NewField) -> Result<Stored<FieldRecord>, StoreError> {
        let NewField { mesh, basis, name, width, values, design } = new;
        let (design, basis) = (to_json(&design)?, basis.map(|basis| basis.to_string()));
        let faces = values.len().checked_div(width).unwrap_or(0);
        let content = blobs::blocking(move || encode(&values, [faces, width])).await?;
        let bytes = content.len() as i64;
        let hash = blobs::hash_of(&content).await?;
        let id = identifier(&mesh, basis.as_deref(), &design, &hash);
        let _in_use = self.inner.blob_use.read().await;
        self.put_blob(&hash, &content).await?;
        let reached = self.content_generation().await?;
        let mut transaction = self.inner.catalog.write().await?;
        transaction.remember(reached).await?;
        if let Err(missing) = require(&mut transaction, &mesh, basis.as_deref()).await {
            transaction.rollback().await?;
            // Where nothing else has this content, it goes as every orphan does.
            return Err(missing);
        }
        let inserted = sql::query(
            "INSERT INTO fields (id, mesh, basis, name, width, faces, design, content_hash, bytes, created_ms, used_ms)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?10) ON CONFLICT (id) DO NOTHING",
        )
        .bind(&id)
        .bind(&mesh)
        .bind(&basis)
        .bind(&name)
        .bind(width as i64)
        .bind(faces as i64)
        .bind(design)
        .bind(&hash)
        .bind(bytes)
        .bind(self.now_ms())
        .execute(transaction.on())
        .await?;
        transaction.commit().await?;
        self.use_field(&id);
        Ok(Stored { record: self.field(&id).await?, created: inserted > 0 })
    }

    /// A field by its identifier.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn field(&self, id: &str) -> Result<FieldRecord, StoreError> {
        sql::query("SELECT * FROM fields WHERE id = ?")
            .bind(id)
            .fetch_optional(self.inner.catalog.reader())
            .await?
            .map(|row| field_from_row(&row))
            .unwrap_or_else(|| Err(unknown_field(id)))
    }

    /// A page of fields, newest first.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn fields(&self, filter: &FieldFilter, page: &PageRequest) -> Result<Page<FieldRecord>, StoreError> {
        let list = Listing::new(&self.inner.catalog, "SELECT * FROM fields WHERE sequence < ", page)?;
        list.with("mesh", filter.mesh.as_deref())
            .with("basis", filter.basis.as_deref())
            .named(filter.name.as_deref())
            .read(field_from_row)
            .await
    }

    /// Gives a field another name, or none.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn rename_field(&self, id: &str, name: Option<&str>) -> Result<FieldRecord, StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        let row = sql::query("UPDATE fields SET name = ? WHERE id = ? RETURNING *")
            .bind(name)
            .bind(id)
            .fetch_optional(transaction.on())
            .await?;
        transaction.commit().await?;
        row.map(|row| field_from_row(&row)).unwrap_or_else(|| Err(unknown_field(id)))
    }

    /// Deletes a field.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn delete_field(&self, id: &str) -> Result<(), StoreError> {
        let (store, id) = (self.clone(), id.to_owned());
        detached(async move { store.delete_field_now(&id).await }).await
    }

    async fn delete_field_now(&self, id: &str) -> Result<(), StoreError> {
        let _alone = self.inner.blob_use.write().await;
        let mut transaction = self.inner.catalog.write().await?;
        let hash: Option<String> = sql::query_scalar("DELETE FROM fields WHERE id = ? RETURNING content_hash")
            .bind(id)
            .fetch_optional(transaction.on())
            .await?;
        transaction.commit().await?;
        let hash = hash.ok_or_else(|| unknown_field(id))?;
        self.delete_unreferenced(&[hash]).await
    }

    /// The numbers of a field, face after face, verified and decoded each time.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::Damaged`] where the content does not verify.
    pub async fn load_field(&self, record: &FieldRecord) -> Result<Arc<Vec<f32>>, StoreError> {
        self.use_field(&record.id);
        record.basis.into_iter().for_each(|basis| self.use_basis(basis));
        let _in_use = self.inner.blob_use.read().await;
        // It may have been deleted since.
        self.field(&record.id).await?;
        let content = self.verified_blob(&record.content_hash).await?;
        let numbers = record.width.saturating_mul(record.faces) as usize;
        let values = blobs::blocking(move || decode(&content, numbers)).await?;
        values.map(Arc::new).ok_or_else(|| StoreError::Corrupt {
            detail: format!("field {}: its content is not of {numbers} numbers", record.id),
        })
    }
}

/// Refuses a field whose mesh or basis is not there; what is there stays until the transaction ends.
async fn require(on: &mut Transaction, mesh: &str, basis: Option<&str>) -> Result<(), StoreError> {
    let text = on.keeping("SELECT sequence FROM meshes WHERE id = ? AND kind = 'mesh'");
    let found: Option<i64> = sql::query_scalar(text).bind(mesh).fetch_optional(on.on()).await?;
    found.ok_or_else(|| SourceKind::Mesh.unknown(mesh))?;
    let Some(basis) = basis else { return Ok(()) };
    let text = on.keeping("SELECT sequence FROM bases WHERE id = ?");
    let found: Option<i64> = sql::query_scalar(text).bind(basis).fetch_optional(on.on()).await?;
    found.map(|_| ()).ok_or_else(|| StoreError::NotFound { resource: "basis", id: basis.to_owned() })
}

/// A hash of all that tells a field from others: its name does not.
fn identifier(mesh: &str, basis: Option<&str>, design: &str, content: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in [mesh, basis.unwrap_or_default(), design, content] {
        hasher.update(&(part.len() as u64).to_le_bytes()).update(part.as_bytes());
    }
    hasher.finalize().to_hex()[..ID_DIGITS].to_owned()
}

/// The content of a field: an NPY file of faces × numbers.
fn encode(values: &[f32], shape: [usize; 2]) -> Bytes {
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    npz::npy("<f4", false, &shape, &values).into()
}

/// The numbers behind the head of what [`encode`] made; `None` where there are fewer.
fn decode(content: &[u8], numbers: usize) -> Option<Vec<f32>> {
    let head = content.len().checked_sub(numbers.checked_mul(4)?)?;
    Some(content[head..].as_chunks::<4>().0.iter().map(|&word| f32::from_le_bytes(word)).collect())
}

fn unknown_field(id: &str) -> StoreError {
    StoreError::NotFound { resource: "field", id: id.chars().take(64).collect() }
}

fn field_from_row(row: &Row) -> Result<FieldRecord, StoreError> {
    let basis: Option<String> = row.try_get("basis")?;
    let basis = basis.map(|text| {
        uuid::Uuid::try_parse(&text).map_err(|error| StoreError::Corrupt { detail: format!("column basis: {error}") })
    });
    Ok(FieldRecord {
        id: row.try_get("id")?,
        mesh: row.try_get("mesh")?,
        basis: basis.transpose()?,
        name: row.try_get("name")?,
        width: row.try_get::<i64, _>("width")? as u64,
        faces: row.try_get::<i64, _>("faces")? as u64,
        design: from_json("design", row.try_get("design")?)?,
        content_hash: row.try_get("content_hash")?,
        bytes: row.try_get::<i64, _>("bytes")? as u64,
        created_ms: row.try_get("created_ms")?,
    })
}
