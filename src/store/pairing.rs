//! Which two databases belong together, and whether one of them has gone back in time: docs/decisions/0026.
//!
//! Each counts what comes and goes in it, and writes down how far the other had come. A count that is lower than what
//! the other remembers is that of an older copy; what the newer one refers to, or is referred to by, would be lost.
//! Then the store does not open.

use sqlx::Row;
use uuid::Uuid;

use super::{
    Store, StoreError,
    database::{Database, WriteTransaction},
    folder::DataFolder,
};

/// What a database knows of itself and of the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Identity {
    /// The same in both.
    pub identity: String,
    /// How much has come and gone.
    pub generation: i64,
    /// How far the other had come when this one last heard of it.
    pub other_generation: i64,
}

impl Identity {
    /// The identity of a database; `None` before it was paired.
    pub async fn of(database: &Database) -> Result<Option<Self>, StoreError> {
        let row = sqlx::query("SELECT identity, generation, other_generation FROM identity")
            .fetch_optional(database.reader())
            .await?;
        row.map(|row| {
            Ok(Self {
                identity: row.try_get("identity")?,
                generation: row.try_get("generation")?,
                other_generation: row.try_get("other_generation")?,
            })
        })
        .transpose()
    }

    async fn write(&self, database: &Database) -> Result<(), StoreError> {
        let mut transaction = database.write().await?;
        sqlx::query("INSERT OR REPLACE INTO identity (id, identity, generation, other_generation) VALUES (1, ?, ?, ?)")
            .bind(&self.identity)
            .bind(self.generation)
            .bind(self.other_generation)
            .execute(transaction.on())
            .await?;
        transaction.commit().await
    }
}

/// Refuses a folder from which one of the databases is missing, before a new one is made in its place.
pub(super) fn check_files(folder: &DataFolder) -> Result<(), StoreError> {
    let missing = |name: &str| std::fs::metadata(folder.file(name)).map_or(true, |file| file.len() == 0);
    if missing("meta.db") && !missing("blobs.db") {
        return Err(mismatch(folder, "meta.db is missing or empty, and blobs.db is not"));
    }
    Ok(())
}

/// Refuses to make a new blobs.db where meta.db refers to the content of one.
pub(super) async fn check_content(folder: &DataFolder, meta: &Database) -> Result<(), StoreError> {
    if std::fs::metadata(folder.file("blobs.db")).is_ok_and(|file| file.len() > 0) {
        return Ok(());
    }
    let meshes: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM meshes").fetch_one(meta.reader()).await?;
    if meshes == 0 {
        return Ok(());
    }
    Err(mismatch(folder, &format!("blobs.db is missing or empty, and meta.db refers to {meshes} meshes")))
}

/// Compares the databases, pairs those that never were, and writes down that they were opened together. With `anyway`
/// they are paired as they are.
pub(super) async fn pair(
    folder: &DataFolder,
    meta: &Database,
    blobs: &Database,
    anyway: bool,
) -> Result<(), StoreError> {
    let (known, content) = (Identity::of(meta).await?, Identity::of(blobs).await?);
    let newest = |of: fn(&Identity) -> i64| known.iter().chain(&content).map(of).max().unwrap_or(0);
    let (identity, last) = match (&known, &content) {
        _ if anyway => (Uuid::now_v7().to_string(), newest(|known| known.generation.max(known.other_generation))),
        (None, None) => (Uuid::now_v7().to_string(), 0),
        // The process died between the two halves of a first pairing.
        (Some(known), None) if known.other_generation == 0 => (known.identity.clone(), known.generation),
        (None, Some(_)) => return Err(mismatch(folder, "blobs.db was paired with another meta.db")),
        (Some(_), None) => return Err(mismatch(folder, "meta.db was paired with another blobs.db")),
        (Some(known), Some(content)) => {
            if known.identity != content.identity {
                return Err(mismatch(folder, "each was paired with another database"));
            }
            if content.other_generation > known.generation {
                return Err(mismatch(folder, "meta.db is older than blobs.db"));
            }
            if known.other_generation > content.generation {
                return Err(mismatch(folder, "blobs.db is older than meta.db"));
            }
            (known.identity.clone(), known.generation.max(content.generation))
        }
    };
    // Every start counts, so that a copy from before it is known to be one. In meta.db first: see the half pairing
    // above.
    let first_half =
        Identity { identity, generation: last + 1, other_generation: content.map_or(0, |it| it.generation) };
    let first_half = if anyway { Identity { other_generation: 0, ..first_half } } else { first_half };
    first_half.write(meta).await?;
    let whole = Identity { other_generation: last + 1, ..first_half };
    whole.write(blobs).await?;
    whole.write(meta).await
}

fn mismatch(folder: &DataFolder, detail: &str) -> StoreError {
    StoreError::Mismatch {
        meta: folder.file("meta.db").display().to_string(),
        blobs: folder.file("blobs.db").display().to_string(),
        detail: detail.to_owned(),
    }
}

/// How far a database has come.
pub(super) async fn generation(database: &Database) -> Result<i64, StoreError> {
    Ok(sqlx::query_scalar("SELECT generation FROM identity").fetch_one(database.reader()).await?)
}

impl WriteTransaction {
    /// Writes down how far the other database has come.
    pub async fn remember(&mut self, other_generation: i64) -> Result<(), StoreError> {
        sqlx::query("UPDATE identity SET other_generation = MAX(other_generation, ?)")
            .bind(other_generation)
            .execute(self.on())
            .await?;
        Ok(())
    }
}

impl Store {
    /// How far the records have come; nothing to tell where they are shared.
    pub(super) async fn record_generation(&self) -> Result<i64, StoreError> {
        match self.inner.catalog.sqlite() {
            Some(meta) => generation(meta).await,
            None => Ok(0),
        }
    }

    /// How far the content has come; nothing to tell where it is shared.
    pub(super) async fn content_generation(&self) -> Result<i64, StoreError> {
        match self.inner.blobs.sqlite() {
            Some(blobs) => generation(blobs).await,
            None => Ok(0),
        }
    }

    /// Tells each database how far the other has come, where that is news.
    pub(super) async fn keep_pair(&self) -> Result<(), StoreError> {
        let (Some(meta), Some(blobs)) = (self.inner.catalog.sqlite(), self.inner.blobs.sqlite()) else { return Ok(()) };
        for (database, other) in [(meta, blobs), (blobs, meta)] {
            let reached = generation(other).await?;
            let heard: i64 =
                sqlx::query_scalar("SELECT other_generation FROM identity").fetch_one(database.reader()).await?;
            if heard < reached {
                let mut transaction = database.write().await?;
                transaction.remember(reached).await?;
                transaction.commit().await?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "pairing_tests.rs"]
mod tests;
