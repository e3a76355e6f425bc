//! Dense bases: written as they come, with no second copy in memory, and read in chunks of columns, each verified by
//! its own hash.

use std::sync::{Arc, Weak};

use chladni_mesh::numbering::Numbering;
use chladni_spectral::basis::{
    Basis, CHUNK_COLUMNS, ColumnChunk, ColumnError, ColumnSource, DenseFunctions, Functions,
};
use chladni_spectral::formats::{DenseLayout, npz};
use tokio::runtime::Handle;
use uuid::Uuid;

use super::piece_writer::PieceWriter;
use super::{BasisRecord, Inner, Store, StoreError, Weighed, blobs};

/// A dense basis whose content is stored.
pub(super) struct WrittenDense {
    /// The basis, with eigenfunctions that lie in the store.
    pub basis: Basis,
    pub layout: Arc<DenseLayout>,
    pub hash: String,
    pub bytes: u64,
}

/// Columns in the store. Held by the store's own cache, so it must not keep the store alive.
#[derive(Debug)]
struct StoredColumns {
    store: Weak<Inner>,
    runtime: Handle,
    hash: String,
    rows: usize,
    layout: Arc<DenseLayout>,
}

impl ColumnSource for StoredColumns {
    fn chunk(&self, index: usize) -> Result<Arc<ColumnChunk>, ColumnError> {
        let inner = self.store.upgrade().ok_or(ColumnError::Gone)?;
        let store = Store { inner };
        // Solves run on threads of their own, which may wait.
        let read = self.runtime.block_on(store.load_chunk(&self.hash, self.rows, &self.layout, index));
        read.map_err(|error| match error {
            StoreError::NotFound { .. } => ColumnError::Gone,
            other => ColumnError::Failed(other.to_string()),
        })
    }
}

impl Store {
    /// Writes the content of a dense basis. Its chunks are given up one by one, so that memory falls while the disk
    /// fills. `None` where the attempt that holds the lease `token` is not wanted any more.
    pub(super) async fn put_dense(
        &self,
        token: Uuid,
        basis: Basis,
        numbering: Option<Arc<Numbering>>,
    ) -> Result<Option<WrittenDense>, StoreError> {
        let (rows, columns) = (basis.vertices(), basis.count());
        let maps = numbering.as_ref().map_or(0, |numbering| 4 * (numbering.file_vertices() + numbering.kept_faces()));
        let expected = basis.stored_bytes() + 8 * rows as u64 + maps as u64;
        let make = move |out: &mut PieceWriter| {
            let Basis { functions, eigenvalues, mass, certificate, metadata } = basis;
            let Functions::Dense(dense) = functions else {
                return Err(StoreError::Unavailable { detail: "the basis is not dense".to_owned() });
            };
            let precision = dense.precision();
            // Nobody reads these until the columns are where the layout says.
            let nowhere = Arc::new(Nowhere);
            let functions = Functions::Dense(DenseFunctions::elsewhere(rows, columns, precision, nowhere));
            let head = Basis { functions, eigenvalues, mass, certificate, metadata };
            let layout = npz::write_dense(&head, dense, numbering.as_deref(), out)
                .map_err(|error| StoreError::Unavailable { detail: format!("the basis: {error}") })?;
            Ok((head, layout))
        };
        let Some(((mut basis, layout), hash, bytes)) = self.put_made(expected, token, make).await? else {
            return Ok(None);
        };
        let layout = Arc::new(layout);
        basis.functions = Functions::Dense(self.stored_functions(&hash, [rows, columns], &layout));
        Ok(Some(WrittenDense { basis, layout, hash, bytes }))
    }

    /// Reads everything of a dense basis but its columns; gives the bytes that were read, too.
    pub(super) async fn read_dense(
        &self,
        record: &BasisRecord,
        layout: &Arc<DenseLayout>,
    ) -> Result<(Basis, u64), StoreError> {
        let hash = &record.content_hash;
        if matches!(self.blob_place(hash).await, Err(StoreError::NotFound { .. })) {
            return Err(self.inner.known.damage(hash, "it is missing"));
        }
        let head = self.blob_bytes(hash, 0..layout.start).await?;
        let tail = self.blob_bytes(hash, layout.end..layout.total).await?;
        let bytes = (head.len() + tail.len()) as u64;
        let shape = [record.rows as usize, record.count as usize];
        let source = self.stored_columns(hash, shape[0], layout);
        let layout = Arc::clone(layout);
        let basis = blobs::blocking(move || npz::read_frame(&head, &tail, &layout, shape, source)).await?;
        Ok((basis.map_err(|error| StoreError::Corrupt { detail: format!("the basis: {error}") })?, bytes))
    }

    fn stored_columns(&self, hash: &str, rows: usize, layout: &Arc<DenseLayout>) -> Arc<StoredColumns> {
        Arc::new(StoredColumns {
            store: Arc::downgrade(&self.inner),
            runtime: Handle::current(),
            hash: hash.to_owned(),
            rows,
            layout: Arc::clone(layout),
        })
    }

    fn stored_functions(&self, hash: &str, [rows, columns]: [usize; 2], layout: &Arc<DenseLayout>) -> DenseFunctions {
        DenseFunctions::elsewhere(rows, columns, layout.precision, self.stored_columns(hash, rows, layout))
    }

    /// One chunk of columns, from the cache or read and verified.
    async fn load_chunk(
        &self,
        hash: &str,
        rows: usize,
        layout: &DenseLayout,
        index: usize,
    ) -> Result<Arc<ColumnChunk>, StoreError> {
        let key = (hash.to_owned(), index);
        if let Some(found) = self.inner.chunks.get(&key) {
            self.count_hit(true);
            return Ok(found.value);
        }
        // A deletion comes before or after, not between two pieces.
        let _in_use = self.inner.blob_use.read().await;
        let loaded = self.inner.chunks.get_or_insert_async(&key, async {
            self.count_hit(false);
            let damaged =
                |how: &str| self.inner.known.damage(hash, &format!("columns from {} on {how}", index * CHUNK_COLUMNS));
            let expected = layout.chunks.get(index).cloned().ok_or_else(|| damaged("are not in its layout"))?;
            let content = self.blob_bytes(hash, layout.chunk_bytes(rows, index)).await?;
            let bytes = content.len() as u64;
            let precision = layout.precision;
            let chunk = blobs::blocking(move || {
                let right = blake3::hash(&content).to_hex().as_str() == expected;
                right.then(|| ColumnChunk::from_bytes(&content, rows, precision)).flatten()
            });
            let chunk = chunk.await?.ok_or_else(|| damaged("hash to another value"))?;
            Ok::<_, StoreError>(Weighed { value: Arc::new(chunk), bytes })
        });
        Ok(loaded.await?.value)
    }
}

/// No columns at all.
#[derive(Debug)]
struct Nowhere;

impl ColumnSource for Nowhere {
    fn chunk(&self, _index: usize) -> Result<Arc<ColumnChunk>, ColumnError> {
        Err(ColumnError::Gone)
    }
}

#[cfg(test)]
#[path = "columns_tests.rs"]
mod tests;
