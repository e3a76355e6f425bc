//! Problems: pencils of sparse matrices, known by their content as meshes are.

use std::sync::Arc;

use super::pagination::Listing;
use super::sources::{NewSource, SourceKind, problem_bytes, read_matrices};
use super::sql::{self, Row};
use super::{NewProblem, Page, PageRequest, ProblemRecord, Store, StoreError, Stored, blobs, detached, from_json};
use bytes::Bytes;
use chladni_spectral::spectrum::pencil::Matrices;

impl Store {
    /// Stores a problem, or finds it where equal matrices are known. A name or report of a known problem stays as it
    /// was; content that was damaged is written anew.
    ///
    /// # Errors
    /// [`StoreError::StorageFull`], [`StoreError::Busy`].
    pub async fn add_problem(&self, new: NewProblem) -> Result<Stored<ProblemRecord>, StoreError> {
        let store = self.clone();
        detached(async move {
            let NewProblem { matrices, report, name, source_bytes } = new;
            let rows = matrices.rows();
            let content = blobs::blocking(move || problem_bytes(&matrices)).await?;
            let content = Bytes::from(
                content.map_err(|error| StoreError::Unavailable { detail: format!("a problem: {error}") })?,
            );
            let source = NewSource {
                kind: SourceKind::Problem,
                name,
                format: "matrices".to_owned(),
                source_bytes,
                rows,
                faces: 0,
                report,
            };
            store.stored_source(content, source, |store, id| async move { store.problem(&id).await }).await
        })
        .await
    }

    /// A problem by its identifier.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn problem(&self, id: &str) -> Result<ProblemRecord, StoreError> {
        sql::query("SELECT * FROM meshes WHERE id = ? AND kind = 'problem'")
            .bind(id)
            .fetch_optional(self.inner.catalog.reader())
            .await?
            .map(|row| problem_from_row(&row))
            .unwrap_or_else(|| Err(unknown_problem(id)))
    }

    /// A page of the problems whose name contains a text, newest first. Letters of ASCII are alike in both cases.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn problems_named(
        &self,
        part: Option<&str>,
        page: &PageRequest,
    ) -> Result<Page<ProblemRecord>, StoreError> {
        let list =
            Listing::new(&self.inner.catalog, "SELECT * FROM meshes WHERE kind = 'problem' AND sequence < ", page)?;
        list.named(part).read(problem_from_row).await
    }

    /// Gives a problem another name, or none.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn rename_problem(&self, id: &str, name: Option<&str>) -> Result<ProblemRecord, StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        let row = sql::query("UPDATE meshes SET name = ? WHERE id = ? AND kind = 'problem' RETURNING *")
            .bind(name)
            .bind(id)
            .fetch_optional(transaction.on())
            .await?;
        transaction.commit().await?;
        row.map(|row| problem_from_row(&row)).unwrap_or_else(|| Err(unknown_problem(id)))
    }

    /// Deletes a problem, as [`delete_mesh`](Self::delete_mesh) does a mesh.
    ///
    /// # Errors
    /// As there.
    pub async fn delete_problem(&self, id: &str, cascade: bool) -> Result<(), StoreError> {
        self.problem(id).await?;
        self.delete_source(SourceKind::Problem, id, cascade).await
    }

    /// The matrices of a problem, verified and decoded each time.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::Damaged`] where the content does not verify.
    pub async fn load_problem(&self, id: &str) -> Result<Arc<Matrices>, StoreError> {
        self.use_mesh(id);
        let _in_use = self.inner.blob_use.read().await;
        let record = self.problem(id).await?;
        let content = self.verified_blob(&record.content_hash).await?;
        let read = blobs::blocking(move || read_matrices(&content)).await?;
        read.map(Arc::new).map_err(|error| StoreError::Corrupt { detail: format!("problem {id}: {error}") })
    }
}

fn unknown_problem(id: &str) -> StoreError {
    SourceKind::Problem.unknown(id)
}

fn problem_from_row(row: &Row) -> Result<ProblemRecord, StoreError> {
    Ok(ProblemRecord {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        source_bytes: row.try_get::<i64, _>("source_bytes")? as u64,
        rows: row.try_get::<i64, _>("vertices")? as u64,
        report: from_json("report", row.try_get("report")?)?,
        content_hash: row.try_get("content_hash")?,
        bytes: row.try_get::<i64, _>("bytes")? as u64,
        created_ms: row.try_get("created_ms")?,
    })
}
