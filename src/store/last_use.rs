//! When meshes, bases and fields were last used: noted in memory, written down now and then, so that reading does not
//! write.

use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};

use super::{Store, StoreError, sql};

/// Notes that were not written down yet.
#[derive(Debug, Default)]
pub(super) struct Uses {
    meshes: Mutex<HashMap<String, i64>>,
    bases: Mutex<HashMap<String, i64>>,
    fields: Mutex<HashMap<String, i64>>,
}

impl Store {
    /// Notes the use of a mesh.
    pub(super) fn use_mesh(&self, id: &str) {
        self.inner.uses.meshes.lock().unwrap_or_else(PoisonError::into_inner).insert(id.to_owned(), self.now_ms());
    }

    /// Notes the use of a basis.
    pub(super) fn use_basis(&self, id: uuid::Uuid) {
        self.inner.uses.bases.lock().unwrap_or_else(PoisonError::into_inner).insert(id.to_string(), self.now_ms());
    }

    /// Notes the use of a field.
    pub(super) fn use_field(&self, id: &str) {
        self.inner.uses.fields.lock().unwrap_or_else(PoisonError::into_inner).insert(id.to_owned(), self.now_ms());
    }

    /// Writes the notes down.
    pub(super) async fn write_uses(&self) -> Result<(), StoreError> {
        let take = |notes: &Mutex<HashMap<String, i64>>| {
            std::mem::take(&mut *notes.lock().unwrap_or_else(PoisonError::into_inner))
        };
        let uses = &self.inner.uses;
        let (meshes, bases, fields) = (take(&uses.meshes), take(&uses.bases), take(&uses.fields));
        if meshes.is_empty() && bases.is_empty() && fields.is_empty() {
            return Ok(());
        }
        let mut transaction = self.inner.catalog.write().await?;
        for (sql, notes) in [
            ("UPDATE meshes SET used_ms = ?1 WHERE id = ?2 AND used_ms < ?1", meshes),
            ("UPDATE bases SET used_ms = ?1 WHERE id = ?2 AND used_ms < ?1", bases),
            ("UPDATE fields SET used_ms = ?1 WHERE id = ?2 AND used_ms < ?1", fields),
        ] {
            // In one order: processes that write the same rows would wait for each other in any other.
            let mut notes: Vec<_> = notes.into_iter().collect();
            notes.sort_unstable();
            for (id, used_ms) in notes {
                sql::query(sql).bind(used_ms).bind(id).execute(transaction.on()).await?;
            }
        }
        transaction.commit().await
    }
}
