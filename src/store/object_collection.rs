//! Objects that nothing refers to any more: condemned, pardoned where somebody refers to them again, and deleted an
//! hour later.

use object_store::{ObjectStoreExt, path::Path};

use super::{
    StoreError,
    objects::Objects,
    orphans::{Look, REPRIEVE_MS},
    s3::is_missing,
    sql,
};

/// Objects that are deleted in one look.
const DELETED_AT_ONCE: i64 = 1000;
/// Whether a mesh, a basis or a field has the content of a row of `blobs`.
const REFERENCED: &str = "(EXISTS (SELECT 1 FROM meshes WHERE meshes.content_hash = blobs.hash)
    OR EXISTS (SELECT 1 FROM bases WHERE bases.content_hash = blobs.hash)
    OR EXISTS (SELECT 1 FROM fields WHERE fields.content_hash = blobs.hash))";

impl Objects {
    /// Keeps content that is about to be referred to. False where it is not there.
    pub async fn pardon(&self, hash: &str) -> Result<bool, StoreError> {
        let pardoned = sql::query("UPDATE blobs SET condemned_ms = NULL WHERE hash = ?1 AND state = 'ready'")
            .bind(hash)
            .execute(self.records.on())
            .await?;
        Ok(pardoned > 0)
    }

    /// Condemns content that nothing refers to any more, of that given.
    pub async fn condemn(&self, hashes: &[String], now_ms: i64) -> Result<(), StoreError> {
        for hash in hashes {
            let condemn = format!(
                "UPDATE blobs SET condemned_ms = ?1
                 WHERE hash = ?2 AND state = 'ready' AND condemned_ms IS NULL AND NOT {REFERENCED}"
            );
            sql::query(sqlx::AssertSqlSafe(condemn)).bind(now_ms).bind(hash).execute(self.records.on()).await?;
        }
        Ok(())
    }

    /// Condemns what nothing refers to, pardons what is referred to again, gives up uploads that have not moved for an
    /// hour, and deletes objects that were condemned an hour ago and still have nothing that refers to them. Several
    /// processes may look at once: each statement decides by itself, and content that is put again is pardoned under
    /// the lock of its row, so that it is either kept or written anew.
    pub async fn look(&self, now_ms: i64) -> Result<Look, StoreError> {
        let before_ms = now_ms - REPRIEVE_MS;
        let pardon = format!("UPDATE blobs SET condemned_ms = NULL WHERE condemned_ms IS NOT NULL AND {REFERENCED}");
        sql::query(sqlx::AssertSqlSafe(pardon)).execute(self.records.on()).await?;
        let condemn = format!(
            "UPDATE blobs SET condemned_ms = ?1
             WHERE state = 'ready' AND (condemned_ms IS NULL OR condemned_ms > ?1) AND NOT {REFERENCED}"
        );
        let condemned = sql::query(sqlx::AssertSqlSafe(condemn)).bind(now_ms).execute(self.records.on()).await?;
        let delete = format!(
            "UPDATE blobs SET state = 'gone', touched_ms = ?1
             WHERE (state = 'ready' AND condemned_ms <= ?2 AND NOT {REFERENCED}) OR (state = 'pending' AND touched_ms <= ?2)"
        );
        sql::query(sqlx::AssertSqlSafe(delete)).bind(now_ms).bind(before_ms).execute(self.records.on()).await?;
        Ok(Look { condemned, deleted: self.delete_gone().await? })
    }

    async fn delete_gone(&self) -> Result<u64, StoreError> {
        let rows = sql::query("SELECT id, object FROM blobs WHERE state = 'gone' ORDER BY touched_ms LIMIT ?1")
            .bind(DELETED_AT_ONCE)
            .fetch_all(self.records.on())
            .await?;
        if !rows.is_empty() {
            // Of an object that is missing elsewhere the row would go, and the object stay.
            self.ensure_paired().await?;
        }
        let mut deleted = 0;
        for row in rows {
            let (id, object): (i64, String) = (row.try_get("id")?, row.try_get("object")?);
            match self.store.delete(&Path::from(object)).await {
                Ok(()) => {}
                Err(error) if is_missing(&error) => {}
                Err(error) => {
                    // One that cannot be deleted now must not keep those behind it.
                    tracing::warn!(%error, "an object that nothing refers to cannot be deleted");
                    continue;
                }
            }
            sql::query("DELETE FROM blobs WHERE id = ?1 AND state = 'gone'")
                .bind(id)
                .execute(self.records.on())
                .await?;
            deleted += 1;
        }
        Ok(deleted)
    }
}
