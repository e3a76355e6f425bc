//! Room: pages that are free within the database count as much as bytes that are free on the disk, and go back to it
//! after deletions.

use std::sync::atomic::Ordering;

use sqlx::Row;

use super::{Store, StoreError, database::Database, folder::DataFolder};

/// Free pages that are given back in one transaction: 16 MiB of content.
const PAGES_AT_ONCE: i64 = 2048;
/// The fewest, where the disk is full: their log is small.
const PAGES_AT_LEAST: i64 = 16;
/// Transactions of one look, so that writers get their turn.
const TURNS: usize = 16;
/// With fewer free pages than these, and than a tenth of all, they are kept for what comes next.
const PAGES_KEPT: i64 = 256;
/// SQLite's word for a database that gives pages back when it is told to.
const INCREMENTAL: i64 = 2;

/// What a database takes on the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Pages {
    /// Bytes of one.
    bytes: i64,
    /// All of them.
    count: i64,
    /// Those that are free.
    free: i64,
    /// Whether free ones can be given back without writing the whole database anew.
    incremental: bool,
}

impl Pages {
    async fn of(database: &Database) -> Result<Self, StoreError> {
        let row = sqlx::query(
            "SELECT (SELECT page_size FROM pragma_page_size) AS bytes, (SELECT page_count FROM pragma_page_count) AS count,
                    (SELECT freelist_count FROM pragma_freelist_count) AS free, (SELECT auto_vacuum FROM pragma_auto_vacuum) AS mode",
        )
        .fetch_one(database.reader())
        .await?;
        Ok(Self {
            bytes: row.try_get("bytes")?,
            count: row.try_get("count")?,
            free: row.try_get("free")?,
            incremental: row.try_get::<i64, _>("mode")? == INCREMENTAL,
        })
    }

    /// Bytes of the file.
    fn file_bytes(self) -> u64 {
        (self.bytes * self.count) as u64
    }
}

/// What `chladni compact` came to, in bytes of both databases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Compacted {
    /// Before.
    pub before: u64,
    /// After.
    pub after: u64,
}

/// Whether so many more bytes of content leave enough room. What fits into free pages takes nothing from the disk but
/// the log, which is what an eighth of the room is for.
pub(super) fn has_room(bytes: u64, free: u64, reusable: u64, least: u64) -> bool {
    free.saturating_add(reusable).saturating_sub(bytes) >= least && free >= least / 8
}

impl Store {
    /// The databases in the data folder: that of content first.
    fn databases(&self) -> impl Iterator<Item = &Database> {
        [self.inner.blobs.sqlite(), self.inner.catalog.sqlite()].into_iter().flatten()
    }

    /// Refuses content that would leave too little room.
    pub(super) fn check_space(&self, bytes: u64) -> Result<(), StoreError> {
        let least = self.inner.options.least_free_bytes;
        let reusable = self.inner.reusable_bytes.load(Ordering::Relaxed);
        match self.free_bytes() {
            Some(free) if !has_room(bytes, free, reusable, least) => Err(StoreError::StorageFull {
                detail: format!(
                    "{bytes} bytes would leave less than {least} of {free} free bytes and {reusable} reusable ones"
                ),
            }),
            _ => Ok(()),
        }
    }

    /// Bytes that may still be written to the file system of the data folder; `None` where there is none, or the system
    /// does not tell.
    pub(super) fn free_bytes(&self) -> Option<u64> {
        self.inner.folder.as_ref().and_then(DataFolder::free_bytes)
    }

    /// Counts the free pages of the content anew.
    pub(super) async fn count_reusable(&self) -> Result<(), StoreError> {
        let Some(blobs) = self.inner.blobs.sqlite() else { return Ok(()) };
        let pages = Pages::of(blobs).await?;
        self.inner.reusable_bytes.store((pages.bytes * pages.free) as u64, Ordering::Relaxed);
        Ok(())
    }

    /// Gives free pages back to the disk, some at a time.
    pub(super) async fn give_back(&self) -> Result<(), StoreError> {
        for database in self.databases() {
            let mut given = false;
            for _ in 0..TURNS {
                let pages = Pages::of(database).await?;
                if !pages.incremental || pages.free <= PAGES_KEPT.max(pages.count / 10).min(PAGES_KEPT * 16) {
                    break;
                }
                self.give_pages_back(database, pages).await?;
                given = true;
            }
            if given {
                database.truncate_log().await?;
            }
        }
        self.count_reusable().await
    }

    /// Gives some pages back: so many that their log fits well into what the disk has. Where it does not, the log that
    /// is there gives up its own room first: a disk that is full must not stay full because nothing can be written of
    /// what is to be given back.
    async fn give_pages_back(&self, database: &Database, pages: Pages) -> Result<(), StoreError> {
        let room = self.free_bytes().map_or(PAGES_AT_ONCE, |free| (free / 4) as i64 / pages.bytes.max(1));
        let first = room.clamp(PAGES_AT_LEAST, PAGES_AT_ONCE);
        let Err(error) = database.give_back(first).await else { return Ok(()) };
        tracing::debug!(%error, "pages could not be given back: the log is emptied first");
        database.truncate_log().await?;
        database.give_back(PAGES_AT_LEAST).await
    }

    /// Gives all free pages of both databases back to the disk. Databases of earlier versions, which cannot do that,
    /// are written anew once, which takes as much room as they have content; from then on they can.
    ///
    /// # Errors
    /// [`StoreError::StorageFull`] where there is no such room: nothing has changed.
    pub async fn compact(&self) -> Result<Compacted, StoreError> {
        let mut compacted = Compacted { before: 0, after: 0 };
        for database in self.databases() {
            let pages = Pages::of(database).await?;
            compacted.before += pages.file_bytes();
            if pages.incremental {
                let mut free = pages.free;
                while free > 0 {
                    self.give_pages_back(database, pages).await?;
                    let left = Pages::of(database).await?.free;
                    if left >= free {
                        break;
                    }
                    free = left;
                }
            } else {
                database.write_anew().await?;
            }
            database.truncate_log().await?;
            compacted.after += Pages::of(database).await?.file_bytes();
        }
        self.count_reusable().await?;
        Ok(compacted)
    }
}

#[cfg(test)]
#[path = "space_tests.rs"]
mod tests;
