//! Content that nothing refers to: condemned when it is first seen, deleted when it is seen again an hour later and
//! still nothing does.
//!
//! A crash leaves little of it. A database that was lost or replaced makes an orphan of everything, and an hour is what
//! there is to notice.

use std::{collections::HashSet, sync::atomic::Ordering};

use sqlx::Row;

use super::{
    Store, StoreError,
    blobs::{Blobs, delete_blob},
    sql,
};

/// For so long content that nothing refers to is kept.
pub(super) const REPRIEVE_MS: i64 = 3600 * 1000;
/// How often a running store looks for it.
const LOOK_MS: i64 = 10 * 60 * 1000;

/// What a look came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Look {
    /// Blobs that nothing refers to, seen for the first time.
    pub condemned: u64,
    /// Blobs that were condemned an hour ago or more, and are gone.
    pub deleted: u64,
}

impl Look {
    /// Says what it came to, with the bytes that were condemned where they are known.
    fn log(self, bytes: Option<i64>) {
        if self.condemned > 0 {
            tracing::warn!(
                blobs = self.condemned,
                bytes,
                "content that nothing refers to is condemned; it is deleted in an hour if still nothing does"
            );
        }
        if self.deleted > 0 {
            let what = match bytes {
                Some(_) => "content that nothing has referred to for an hour is deleted",
                // Beside that, uploads that were given up and objects that were written twice, which nobody has seen.
                None => "objects that nothing refers to are deleted",
            };
            tracing::info!(blobs = self.deleted, "{what}");
        }
    }
}

impl Store {
    /// Deletes what was being written when a process died: nobody has ever read it. Nothing else may run.
    pub(super) async fn delete_pending(&self) -> Result<u64, StoreError> {
        let Some(blobs) = self.inner.blobs.sqlite() else { return Ok(0) };
        let ids: Vec<i64> =
            sqlx::query_scalar("SELECT id FROM blobs WHERE state = 'pending'").fetch_all(blobs.reader()).await?;
        for &id in &ids {
            let mut transaction = blobs.write().await?;
            delete_blob(&mut transaction, id).await?;
            transaction.commit().await?;
        }
        Ok(ids.len() as u64)
    }

    /// Looks for orphans now and then; not while content is being written, which must not wait.
    pub(super) async fn look_for_orphans_in_turn(&self) -> Result<(), StoreError> {
        let now_ms = self.now_ms();
        if (now_ms - self.inner.orphans_looked_ms.load(Ordering::Relaxed)).abs() < LOOK_MS {
            return Ok(());
        }
        let Ok(_alone) = self.inner.blob_use.try_write() else { return Ok(()) };
        self.look_for_orphans().await.map(|_| ())
    }

    /// Condemns orphans that are seen for the first time, pardons what is referred to again, and deletes what was
    /// condemned an hour ago. The caller holds `blob_use` for writing, or is alone.
    pub(super) async fn look_for_orphans(&self) -> Result<Look, StoreError> {
        let now_ms = self.now_ms();
        self.inner.orphans_looked_ms.store(now_ms, Ordering::Relaxed);
        let blobs = match &self.inner.blobs {
            Blobs::Chunks(blobs) => blobs,
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => {
                let look = objects.look(now_ms).await?;
                look.log(None);
                return Ok(look);
            }
        };
        let referenced: Vec<String> = sql::query_scalar(
            "SELECT content_hash FROM meshes UNION SELECT content_hash FROM bases UNION SELECT content_hash FROM fields",
        )
        .fetch_all(self.inner.catalog.reader())
        .await?;
        let referenced: HashSet<String> = referenced.into_iter().collect();
        let rows = sqlx::query("SELECT id, hash, bytes, condemned_ms FROM blobs WHERE state = 'ready'")
            .fetch_all(blobs.reader())
            .await?;
        let mut look = Look::default();
        let mut bytes = 0;
        for row in rows {
            let (id, hash) = (row.try_get::<i64, _>("id")?, row.try_get::<String, _>("hash")?);
            let condemned_ms: Option<i64> = row.try_get("condemned_ms")?;
            let mark = match (referenced.contains(&hash), condemned_ms) {
                (true, None) => continue,
                (true, Some(_)) => None,
                // A clock that went back does not make it wait longer than an hour from now.
                (false, Some(since)) if since <= now_ms && now_ms - since < REPRIEVE_MS => continue,
                (false, Some(since)) if since <= now_ms => {
                    let mut transaction = blobs.write().await?;
                    delete_blob(&mut transaction, id).await?;
                    transaction.commit().await?;
                    look.deleted += 1;
                    continue;
                }
                (false, _) => {
                    look.condemned += 1;
                    bytes += row.try_get::<i64, _>("bytes")?;
                    Some(now_ms)
                }
            };
            let mut transaction = blobs.write().await?;
            sqlx::query("UPDATE blobs SET condemned_ms = ? WHERE id = ?")
                .bind(mark)
                .bind(id)
                .execute(transaction.on())
                .await?;
            transaction.commit().await?;
        }
        look.log(Some(bytes));
        Ok(look)
    }
}
