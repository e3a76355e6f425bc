//! Whether the object store is the one that the database belongs to: docs/decisions/0026. A process with the address of
//! another one would find no content, fail jobs for want of it, and write its own where nobody looks for it.
//!
//! Both hold the same identity: the database in a row, the store in an object beside the content. It is made once, by
//! whoever inserts the row first, and compared before a process uses the store, and again after the store was away.

use std::sync::{
    OnceLock,
    atomic::{AtomicBool, Ordering},
};

use object_store::{ObjectStoreExt, path::Path};
use uuid::Uuid;

use super::{
    StoreError,
    objects::Objects,
    s3::{failure, is_missing, said},
    sql,
};

/// The object that holds the identity.
const NAME: &str = "identity";
/// A longer one is none of ours.
const MOST_BYTES: u64 = 200;
/// Of so many pieces of content that came last, one has to be there where it is in doubt whether the store is the
/// right one.
const LOOKED_FOR: i64 = 3;
/// So often processes that start at once are looked at anew.
const MOST_RACES: usize = 5;

/// What is known of the pair.
#[derive(Debug, Default)]
pub(super) struct Pair {
    /// The identity of the database, once the two were found to belong together.
    known: OnceLock<String>,
    /// Whether the store is the one that it was when it was last compared.
    paired: AtomicBool,
}

impl Pair {
    /// The store has not answered: what answers next may be another one.
    pub fn forget(&self) {
        self.paired.store(false, Ordering::Relaxed);
    }

    fn confirm(&self, identity: &str) {
        let _known = self.known.set(identity.to_owned());
        self.paired.store(true, Ordering::Relaxed);
    }
}

impl Objects {
    /// Sees to it that the store is the one that the database belongs to; asked of the store only where that is not
    /// known.
    ///
    /// # Errors
    /// [`StoreError::Refused`] where they do not belong together.
    pub async fn ensure_paired(&self) -> Result<(), StoreError> {
        if self.pair.paired.load(Ordering::Relaxed) { Ok(()) } else { Box::pin(self.check_pairing()).await }
    }

    /// Asks the store for its identity, and compares it.
    ///
    /// # Errors
    /// [`StoreError::Refused`] where it lets nobody in, or does not belong to the database;
    /// [`StoreError::Unavailable`] where it does not answer.
    pub async fn check_pairing(&self) -> Result<(), StoreError> {
        let placed = self.placed_identity().await?;
        match (self.pair.known.get(), placed) {
            (Some(own), Some(placed)) if *own == placed => self.pair.confirm(own),
            (_, placed) => {
                self.pair.forget();
                let own = self.compare(placed).await?;
                self.pair.confirm(&own);
            }
        }
        Ok(())
    }

    /// The identity that the store has.
    async fn placed_identity(&self) -> Result<Option<String>, StoreError> {
        // Not the head of an object: an answer without a body does not say whether a bucket is missing or an object.
        match self.store.get_range(&Path::from(NAME), 0..MOST_BYTES).await {
            Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).trim().to_owned())),
            Err(error) if is_missing(&error) => Ok(None),
            // Who may not list a bucket is told that it may not see an object that is not there.
            Err(error) if said(&error).contains("AccessDenied") => Ok(None),
            Err(error) => {
                self.pair.forget();
                Err(failure(&error))
            }
        }
    }

    /// Compares the identity of the store with that of the database, and gives both one where they have none.
    async fn compare(&self, placed: Option<String>) -> Result<String, StoreError> {
        let mut placed = placed;
        for _ in 0..MOST_RACES {
            let row = sql::query("SELECT identity, placed FROM identity").fetch_optional(self.records.on()).await?;
            let own: Option<(String, bool)> =
                row.map(|row| Ok::<_, sqlx::Error>((row.try_get("identity")?, row.try_get("placed")?))).transpose()?;
            match (own, &placed) {
                (Some((own, _)), Some(placed)) if own == *placed => {
                    self.note_placed().await?;
                    return Ok(own);
                }
                (Some((own, _)), Some(placed)) => return Err(self.pairing_error(Some(&own), Some(placed))),
                (Some((own, true)), None) => {
                    // Only the object of the identity may have been deleted.
                    if self.newest_are_there().await? != Some(true) {
                        return Err(self.pairing_error(Some(&own), None));
                    }
                    self.write_identity(&own).await?;
                    return Ok(own);
                }
                (Some((own, false)), None) => {
                    if self.newest_are_there().await? == Some(false) {
                        return Err(self.pairing_error(None, None));
                    }
                    self.place_first(&own).await?;
                    placed = self.placed_identity().await?;
                }
                // A database of an earlier version, or a backup of one.
                (None, Some(placed)) if self.newest_are_there().await? == Some(true) => {
                    self.adopt(placed, true).await?;
                }
                (None, Some(placed)) => return Err(self.pairing_error(None, Some(placed))),
                (None, None) if self.newest_are_there().await? == Some(false) => {
                    return Err(self.pairing_error(None, None));
                }
                (None, None) => self.adopt(&Uuid::now_v7().to_string(), false).await?,
            }
        }
        Err(StoreError::Busy { detail: "other processes pair the database and the object store".to_owned() })
    }

    /// Gives the database an identity, unless another process has.
    async fn adopt(&self, identity: &str, placed: bool) -> Result<(), StoreError> {
        sql::query("INSERT INTO identity (id, identity, placed) VALUES (1, ?, ?) ON CONFLICT (id) DO NOTHING")
            .bind(identity)
            .bind(i64::from(placed))
            .execute(self.records.on())
            .await?;
        Ok(())
    }

    /// Writes the identity of a database to a store that has none, alone: one that starts meanwhile with the address of
    /// another store waits, and is refused.
    async fn place_first(&self, identity: &str) -> Result<(), StoreError> {
        let mut transaction = self.records.write().await?;
        let waits: Option<i64> = sql::query_scalar("SELECT id FROM identity WHERE placed = 0 FOR UPDATE")
            .fetch_optional(transaction.on())
            .await?;
        if waits.is_some() {
            self.write_identity(identity).await?;
            sql::query("UPDATE identity SET placed = 1").execute(transaction.on()).await?;
        }
        Ok(transaction.commit().await?)
    }

    async fn write_identity(&self, identity: &str) -> Result<(), StoreError> {
        let bytes = identity.to_owned().into_bytes();
        self.store.put(&Path::from(NAME), bytes.into()).await.map_err(|error| failure(&error))?;
        Ok(())
    }

    async fn note_placed(&self) -> Result<(), StoreError> {
        sql::query("UPDATE identity SET placed = 1 WHERE placed = 0").execute(self.records.on()).await?;
        Ok(())
    }

    /// Whether any of the content that came last is in the store; `None` where the database knows none.
    async fn newest_are_there(&self) -> Result<Option<bool>, StoreError> {
        let objects: Vec<String> =
            sql::query_scalar("SELECT object FROM blobs WHERE state = 'ready' ORDER BY id DESC LIMIT ?")
                .bind(LOOKED_FOR)
                .fetch_all(self.records.on())
                .await?;
        if objects.is_empty() {
            return Ok(None);
        }
        for object in objects {
            match self.store.head(&Path::from(object)).await {
                Ok(_) => return Ok(Some(true)),
                Err(error) if is_missing(&error) => {}
                Err(error) => return Err(failure(&error)),
            }
        }
        Ok(Some(false))
    }

    /// Why the two are not used together.
    fn pairing_error(&self, own: Option<&str>, placed: Option<&str>) -> StoreError {
        let how = match (own, placed) {
            (Some(own), Some(placed)) => {
                format!("the one has the identity {own}, the other {placed}; look at --database and --objects")
            }
            (Some(own), None) => format!(
                "the database has the identity {own}, and the store has none; look at bucket and prefix of --objects, \
                 or, where they are right, write an object {NAME:?} there that holds {own}"
            ),
            (None, Some(placed)) => format!(
                "the store has the identity {placed} of another database, and the database has none; \
                 give the database a prefix of its own"
            ),
            (None, None) => {
                "the content that the database knows is not there; look at bucket and prefix of --objects".to_owned()
            }
        };
        let (database, store) = (self.records.name(), self.name());
        StoreError::Refused {
            detail: format!("the database {database} and the object store {store} do not belong together: {how}"),
        }
    }
}
