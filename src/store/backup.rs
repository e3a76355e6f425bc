//! Backups of a folder that may be in use: docs/decisions/0027.
//!
//! A backup is a data folder itself, with both databases and nothing beside them. Content that it has already is not
//! copied again. Most content is copied without holding anything; then one moment of both databases is held, the
//! records are copied from it with the content that is still missing, and the new records take the place of the old
//! ones in one step. Whenever this ends, the folder holds a whole backup: this one or the one before.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use sqlx::{
    AssertSqlSafe, ConnectOptions, Connection, Row, SqliteConnection,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous},
};

use super::{
    StoreError,
    blobs::{CHUNK_BYTES, CHUNKS_PER_READ, PAGE_BYTES},
    folder::{DataFolder, require_file, sync_folder},
    migrations,
};

/// How often one moment of both databases is tried for while content comes and goes.
const MOST_TRIES: usize = 1000;
const RECORDS: &str = "meta.db";
const CONTENT: &str = "blobs.db";
/// The records while they are copied.
const NEW_RECORDS: &str = "meta.db.new";

/// What a backup holds, and what was done for it.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct BackupReport {
    /// Meshes in it.
    pub meshes: u64,
    /// Bases in it.
    pub bases: u64,
    /// Jobs in it.
    pub jobs: u64,
    /// Pieces of content in it.
    pub blobs: u64,
    /// Pieces of content that were copied; the others were in it.
    pub copied_blobs: u64,
    /// Bytes of those.
    pub copied_bytes: u64,
    /// Content, by its hash, that is damaged or missing where it was copied from.
    pub damaged: Vec<String>,
}

/// Copies the databases of a data folder, in use or not, into a folder of backups.
///
/// # Errors
/// [`StoreError::Folder`] where there is no data folder; [`StoreError::FolderInUse`] where another backup runs into the
/// same folder, or a server on it; [`StoreError::Mismatch`] where it holds the backup of another data folder.
pub async fn backup(data: &Path, target: &Path) -> Result<BackupReport, StoreError> {
    for name in [RECORDS, CONTENT] {
        require_file(&data.join(name))?;
    }
    let folder = DataFolder::open(target)?;
    if std::fs::canonicalize(data).ok() == std::fs::canonicalize(target).ok() {
        return Err(StoreError::Unavailable { detail: "a data folder cannot hold its own backup".to_owned() });
    }
    let mut report = BackupReport::default();
    let mut content = connect(&folder.file(CONTENT), true).await?;
    migrations::blobs().run(&mut content).await.map_err(|error| unavailable(&folder.file(CONTENT), &error))?;
    check_target(data, &folder, &mut content).await?;
    let mut known = known(&mut content, "main").await?;

    // Most of it, while nothing is held.
    let mut source = connect(&data.join(CONTENT), false).await?;
    let ready = self::known(&mut source, "main").await?;
    for hash in ready.difference(&known.clone()) {
        if let Copied::Whole(bytes) = copy_blob(&mut source, "main", &mut content, hash).await? {
            (report.copied_blobs, report.copied_bytes) = (report.copied_blobs + 1, report.copied_bytes + bytes);
            known.insert(hash.clone());
        }
    }
    source.close().await?;

    // One moment of both.
    let new = folder.file(NEW_RECORDS);
    if new.exists() {
        std::fs::remove_file(&new).map_err(|source| StoreError::Folder { path: new.display().to_string(), source })?;
    }
    let mut moment = connect(&new, true).await?;
    attach(&mut moment, &data.join(RECORDS), "records").await?;
    attach(&mut moment, &data.join(CONTENT), "content").await?;
    let identity = hold(&mut moment, data).await?;
    copy_records(&mut moment).await?;
    let wanted: Vec<String> =
        sqlx::query_scalar("SELECT content_hash FROM main.meshes UNION SELECT content_hash FROM main.bases")
            .fetch_all(&mut moment)
            .await?;
    for hash in &wanted {
        if known.contains(hash) {
            continue;
        }
        match copy_blob(&mut moment, "content", &mut content, hash).await? {
            Copied::Whole(bytes) => {
                (report.copied_blobs, report.copied_bytes) = (report.copied_blobs + 1, report.copied_bytes + bytes);
            }
            Copied::Damaged => report.damaged.push(hash.clone()),
        }
    }
    for (count, sql) in [
        (&mut report.meshes, "SELECT COUNT(*) FROM main.meshes"),
        (&mut report.bases, "SELECT COUNT(*) FROM main.bases"),
        (&mut report.jobs, "SELECT COUNT(*) FROM main.jobs"),
    ] {
        *count = sqlx::query_scalar::<_, i64>(sql).fetch_one(&mut moment).await? as u64;
    }
    sqlx::query("COMMIT").execute(&mut moment).await?;
    moment.close().await?;

    // The content fits the records that are there and those that come, whichever a death leaves.
    sqlx::query(
        "INSERT INTO identity (id, identity, generation, other_generation) VALUES (1, ?1, ?2, 0)
         ON CONFLICT (id) DO UPDATE SET generation = MAX(generation, ?2)",
    )
    .bind(&identity.identity)
    .bind(identity.content)
    .execute(&mut content)
    .await?;
    let records = folder.file(RECORDS);
    std::fs::rename(&new, &records)
        .map_err(|source| StoreError::Folder { path: records.display().to_string(), source })?;
    sync_folder(target)?;
    sqlx::query("UPDATE identity SET other_generation = ?").bind(identity.records).execute(&mut content).await?;
    let wanted: HashSet<String> = wanted.into_iter().collect();
    for hash in self::known(&mut content, "main").await?.difference(&wanted) {
        sqlx::query("DELETE FROM chunks WHERE blob IN (SELECT id FROM blobs WHERE hash = ?)")
            .bind(hash)
            .execute(&mut content)
            .await?;
        sqlx::query("DELETE FROM blobs WHERE hash = ?").bind(hash).execute(&mut content).await?;
    }
    report.blobs = self::known(&mut content, "main").await?.len() as u64;
    content.close().await?;
    Ok(report)
}

/// A connection that leaves one file behind and no log.
async fn connect(path: &Path, create: bool) -> Result<SqliteConnection, StoreError> {
    let mut options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(create)
        // Records are copied table by table.
        .foreign_keys(false)
        .synchronous(SqliteSynchronous::Full)
        .busy_timeout(std::time::Duration::from_secs(30))
        .disable_statement_logging();
    if create {
        options = options.journal_mode(SqliteJournalMode::Delete);
        options = if path.ends_with(CONTENT) { options.page_size(PAGE_BYTES) } else { options };
    }
    Ok(SqliteConnection::connect_with(&options).await?)
}

async fn attach(connection: &mut SqliteConnection, path: &Path, name: &'static str) -> Result<(), StoreError> {
    sqlx::query(AssertSqlSafe(format!("ATTACH DATABASE ? AS {name}")))
        .bind(path.display().to_string())
        .execute(connection)
        .await?;
    Ok(())
}

/// What was backed up here before must be of the same folder.
async fn check_target(data: &Path, folder: &DataFolder, content: &mut SqliteConnection) -> Result<(), StoreError> {
    let before: Option<String> =
        sqlx::query_scalar("SELECT identity FROM identity").fetch_optional(&mut *content).await?;
    let mut source = connect(&data.join(RECORDS), false).await?;
    let now: Option<String> = sqlx::query_scalar("SELECT identity FROM identity").fetch_optional(&mut source).await?;
    source.close().await?;
    if before.is_some() && before != now {
        return Err(StoreError::Mismatch {
            meta: data.join(RECORDS).display().to_string(),
            blobs: folder.file(CONTENT).display().to_string(),
            detail: "the backup is of another data folder, or from before a restore".to_owned(),
        });
    }
    Ok(())
}

/// The hashes of ready blobs.
async fn known(connection: &mut SqliteConnection, schema: &'static str) -> Result<HashSet<String>, StoreError> {
    let sql = format!("SELECT hash FROM {schema}.blobs WHERE state = 'ready'");
    let hashes: Vec<String> = sqlx::query_scalar(AssertSqlSafe(sql)).fetch_all(connection).await?;
    Ok(hashes.into_iter().collect())
}

/// What became of a blob.
enum Copied {
    /// It is there, with so many bytes.
    Whole(u64),
    /// Its bytes are not what its hash says, or it is gone.
    Damaged,
}

/// Copies a blob and verifies it on the way; all of it or nothing.
async fn copy_blob(
    from: &mut SqliteConnection,
    schema: &'static str,
    to: &mut SqliteConnection,
    hash: &str,
) -> Result<Copied, StoreError> {
    let sql = format!("SELECT id, bytes, created_ms FROM {schema}.blobs WHERE hash = ? AND state = 'ready'");
    let Some(row) = sqlx::query(AssertSqlSafe(sql)).bind(hash).fetch_optional(&mut *from).await? else {
        return Ok(Copied::Damaged);
    };
    let (id, bytes): (i64, i64) = (row.try_get("id")?, row.try_get("bytes")?);
    let mut transaction = to.begin().await?;
    let new: i64 = sqlx::query_scalar(
        "INSERT INTO blobs (hash, bytes, chunk_bytes, state, created_ms) VALUES (?, ?, ?, 'ready', ?) RETURNING id",
    )
    .bind(hash)
    .bind(bytes)
    .bind(CHUNK_BYTES as i64)
    .bind(row.try_get::<i64, _>("created_ms")?)
    .fetch_one(&mut *transaction)
    .await?;
    let sql =
        format!("SELECT data FROM {schema}.chunks WHERE blob = ? AND position >= ? AND position < ? ORDER BY position");
    let (mut hasher, mut position) = (blake3::Hasher::new(), 0i64);
    loop {
        let rows: Vec<Vec<u8>> = sqlx::query_scalar(AssertSqlSafe(sql.clone()))
            .bind(id)
            .bind(position)
            .bind(position + CHUNKS_PER_READ)
            .fetch_all(&mut *from)
            .await?;
        if rows.is_empty() {
            break;
        }
        for data in rows {
            hasher.update(&data);
            sqlx::query("INSERT INTO chunks (blob, position, hash, data) VALUES (?, ?, ?, ?)")
                .bind(new)
                .bind(position)
                .bind(blake3::hash(&data).as_bytes().to_vec())
                .bind(data)
                .execute(&mut *transaction)
                .await?;
            position += 1;
        }
    }
    if hasher.count() != bytes as u64 || hasher.finalize().to_hex().as_str() != hash {
        transaction.rollback().await?;
        return Ok(Copied::Damaged);
    }
    transaction.commit().await?;
    Ok(Copied::Whole(bytes as u64))
}

/// How far the databases had come in the moment that is held.
struct Moment {
    identity: String,
    records: i64,
    content: i64,
}

/// Begins a transaction that sees both databases at one moment: nothing came or went between the looks at one and at
/// the other.
async fn hold(moment: &mut SqliteConnection, data: &Path) -> Result<Moment, StoreError> {
    let mut outside = connect(&data.join(RECORDS), false).await?;
    for _ in 0..MOST_TRIES {
        sqlx::query("BEGIN").execute(&mut *moment).await?;
        // The first look at each database is the moment that is held of it.
        let records = sqlx::query("SELECT identity, generation, other_generation FROM records.identity")
            .fetch_one(&mut *moment)
            .await?;
        let content = sqlx::query("SELECT identity, generation, other_generation FROM content.identity")
            .fetch_one(&mut *moment)
            .await?;
        let held: i64 = records.try_get("generation")?;
        let now: i64 = sqlx::query_scalar("SELECT generation FROM identity").fetch_one(&mut outside).await?;
        if held == now {
            outside.close().await?;
            let (identity, other): (String, String) = (records.try_get("identity")?, content.try_get("identity")?);
            if identity != other {
                return Err(StoreError::Mismatch {
                    meta: data.join(RECORDS).display().to_string(),
                    blobs: data.join(CONTENT).display().to_string(),
                    detail: "each was paired with another database".to_owned(),
                });
            }
            return Ok(Moment { identity, records: held, content: content.try_get("generation")? });
        }
        sqlx::query("ROLLBACK").execute(&mut *moment).await?;
    }
    Err(StoreError::Busy { detail: "content kept changing at every attempt".to_owned() })
}

/// Copies tables, then rows, then indices and triggers, so that no trigger counts what is copied.
async fn copy_records(moment: &mut SqliteConnection) -> Result<(), StoreError> {
    let objects = sqlx::query("SELECT type, name, sql FROM records.sqlite_master WHERE sql IS NOT NULL")
        .fetch_all(&mut *moment)
        .await?;
    let mut objects = objects
        .iter()
        .map(|row| Ok((row.try_get("type")?, row.try_get("name")?, row.try_get("sql")?)))
        .collect::<Result<Vec<(String, String, String)>, StoreError>>()?;
    objects.retain(|(_, name, _)| !name.starts_with("sqlite_"));
    let is_table = |object: &&(String, String, String)| object.0 == "table";
    for (_, _, sql) in objects.iter().filter(is_table) {
        sqlx::query(AssertSqlSafe(sql.clone())).execute(&mut *moment).await?;
    }
    let mut tables: Vec<&str> = objects.iter().filter(is_table).map(|(_, name, _)| name.as_str()).collect();
    // It comes into being with the first table that counts.
    tables.push("sqlite_sequence");
    for name in tables {
        let sql = format!("DELETE FROM main.\"{name}\"");
        sqlx::query(AssertSqlSafe(sql)).execute(&mut *moment).await?;
        let sql = format!("INSERT INTO main.\"{name}\" SELECT * FROM records.\"{name}\"");
        sqlx::query(AssertSqlSafe(sql)).execute(&mut *moment).await?;
    }
    for (_, _, sql) in objects.iter().filter(|object| !is_table(object)) {
        sqlx::query(AssertSqlSafe(sql.clone())).execute(&mut *moment).await?;
    }
    Ok(())
}

fn unavailable(path: &Path, error: &dyn std::fmt::Display) -> StoreError {
    StoreError::Unavailable { detail: format!("{}: {error}", path.display()) }
}

/// The files of a backup or a data folder.
pub(super) fn files(folder: &Path) -> [PathBuf; 2] {
    [folder.join(CONTENT), folder.join(RECORDS)]
}
