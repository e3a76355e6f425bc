//! One SQLite database: a single writing connection, a few reading ones, migrations and checks.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use futures_util::future::BoxFuture;
use sqlx::{
    AssertSqlSafe, ConnectOptions, SqliteConnection, SqlitePool,
    migrate::Migrator,
    pool::PoolConnection,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous},
};

use super::{StoreError, in_place::InPlace};

/// Older ones can corrupt a database when the write-ahead log is reset: <https://www.sqlite.org/wal.html#walresetbug>.
const LEAST_SQLITE: (u32, u32, u32) = (3, 51, 3);
const LEAST_SQLITE_TEXT: &str = "3.51.3";
/// The write-ahead log is cut back to this size at a checkpoint.
const WAL_BYTES_KEPT: u32 = 64 << 20;
/// A file up to this size is checked page by page when it is opened.
const QUICK_CHECK_BYTES: u64 = 64 << 20;

/// How a database is opened.
pub(super) struct DatabaseSettings {
    pub busy_timeout: Duration,
    pub page_bytes: u32,
    pub most_pages: Option<u64>,
    pub readers: u32,
}

/// One database. SQLite has one writer at a time: writers queue for its connection in memory, fairly, and not for a
/// file lock with sleeps.
#[derive(Debug)]
pub(super) struct Database {
    writer: SqlitePool,
    reader: SqlitePool,
    path: PathBuf,
    place: Arc<InPlace>,
}

impl Database {
    /// Opens a database, making it where it is missing, and brings its tables up to date.
    pub async fn open(path: &Path, settings: DatabaseSettings, migrator: &Migrator) -> Result<Self, StoreError> {
        let mut options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .page_size(settings.page_bytes)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(settings.busy_timeout)
            .pragma("journal_size_limit", WAL_BYTES_KEPT.to_string())
            .disable_statement_logging();
        let reading = options.clone().pragma("query_only", "true");
        if let Some(pages) = settings.most_pages {
            options = options.pragma("max_page_count", pages.to_string());
        }
        // A writer may wait behind several others, each of which may wait for a lock.
        let patience = settings.busy_timeout * 4 + Duration::from_millis(500);
        let pool = || {
            SqlitePoolOptions::new()
                .acquire_timeout(patience)
                .idle_timeout(None)
                .max_lifetime(None)
                // Connections do not go away by themselves, and each test is a round trip to a thread.
                .test_before_acquire(false)
        };
        let writer = pool().max_connections(1).connect_with(options).await?;
        check_version(&writer).await?;
        if std::fs::metadata(path).is_ok_and(|file| file.len() <= QUICK_CHECK_BYTES) {
            check_integrity(&writer, path).await?;
        }
        make_incremental(&writer).await?;
        migrator.run(&writer).await.map_err(|error| match error {
            sqlx::migrate::MigrateError::Execute(error) | sqlx::migrate::MigrateError::ExecuteMigration(error, _) => {
                StoreError::from(error)
            }
            other => StoreError::Unavailable { detail: format!("{}: {other}", path.display()) },
        })?;
        let reader = pool().max_connections(settings.readers.max(1)).connect_with(reading).await?;
        let place = Arc::new(InPlace::remember(path));
        Ok(Self { writer, reader, path: path.to_owned(), place })
    }

    /// The connections for statements that only read.
    pub fn reader(&self) -> &SqlitePool {
        &self.reader
    }

    /// Begins a write transaction, alone among writers from its first statement on.
    ///
    /// # Errors
    /// [`StoreError::Moved`] where the files are not those that were opened.
    pub fn write(&self) -> BoxFuture<'_, Result<WriteTransaction, StoreError>> {
        Box::pin(async move {
            self.place.check()?;
            let place = Arc::clone(&self.place);
            let mut transaction = WriteTransaction { connection: self.writer.acquire().await?, finished: false, place };
            sqlx::query("BEGIN IMMEDIATE").execute(transaction.on()).await?;
            Ok(transaction)
        })
    }

    /// Bytes of the write-ahead log.
    pub fn wal_bytes(&self) -> u64 {
        let mut name = self.path.clone().into_os_string();
        name.push("-wal");
        std::fs::metadata(name).map_or(0, |file| file.len())
    }

    /// Commits a transaction that changes one row.
    pub async fn check_writable(&self, now_ms: i64) -> Result<(), StoreError> {
        let mut transaction = self.write().await?;
        sqlx::query("UPDATE health SET checked_ms = ? WHERE id = 1").bind(now_ms).execute(transaction.on()).await?;
        transaction.commit().await
    }

    /// Gives up to so many free pages back to the disk, in a transaction.
    pub async fn give_back(&self, pages: i64) -> Result<(), StoreError> {
        self.place.check()?;
        let sql = format!("PRAGMA incremental_vacuum({pages})");
        // Each step gives one page back; all rows are to be fetched.
        sqlx::query(AssertSqlSafe(sql)).fetch_all(&mut *self.writer.acquire().await?).await?;
        Ok(())
    }

    /// Writes the database anew, without free pages and so that later ones can be given back.
    pub async fn write_anew(&self) -> Result<(), StoreError> {
        self.place.check()?;
        let mut connection = self.writer.acquire().await?;
        sqlx::query("PRAGMA auto_vacuum = INCREMENTAL").execute(&mut *connection).await?;
        sqlx::query("VACUUM").execute(&mut *connection).await?;
        Ok(())
    }

    /// Moves what is in the log to the database and cuts the log to nothing, as far as no reader needs it.
    pub async fn truncate_log(&self) -> Result<(), StoreError> {
        self.place.check()?;
        sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").fetch_all(&mut *self.writer.acquire().await?).await?;
        Ok(())
    }

    /// Waits for running statements and closes every connection.
    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }
}

/// A write transaction. Dropped before [`commit`](Self::commit), it closes its connection, which rolls back.
///
/// Own statements instead of sqlx's `Transaction`: where SQLite itself rolls back (a full disk does that), the
/// `ROLLBACK` that sqlx sends afterwards fails, its count of open transactions stays at one, and the connection can
/// never begin another. With a single writing connection that would end all writing.
pub(super) struct WriteTransaction {
    connection: PoolConnection<sqlx::Sqlite>,
    finished: bool,
    place: Arc<InPlace>,
}

impl WriteTransaction {
    /// The connection, to run a statement on.
    pub fn on(&mut self) -> &mut SqliteConnection {
        &mut self.connection
    }

    /// Makes everything durable and visible at once.
    ///
    /// # Errors
    /// [`StoreError::Moved`] where the files went away meanwhile: what was written went with them.
    pub async fn commit(mut self) -> Result<(), StoreError> {
        sqlx::query("COMMIT").execute(self.on()).await?;
        self.finished = true;
        self.place.check()
    }

    /// Gives up without closing the connection: for refusals, which are no trouble of the database.
    pub async fn rollback(mut self) -> Result<(), StoreError> {
        sqlx::query("ROLLBACK").execute(self.on()).await?;
        self.finished = true;
        Ok(())
    }
}

impl Drop for WriteTransaction {
    fn drop(&mut self) {
        if !self.finished {
            self.connection.close_on_drop();
        }
    }
}

async fn check_version(pool: &SqlitePool) -> Result<(), StoreError> {
    let found: String = sqlx::query_scalar("SELECT sqlite_version()").fetch_one(pool).await?;
    let mut numbers = found.split('.').map(|word| word.parse::<u32>().unwrap_or(0));
    let mut next = || numbers.next().unwrap_or(0);
    if (next(), next(), next()) < LEAST_SQLITE {
        return Err(StoreError::Version { found, needed: LEAST_SQLITE_TEXT });
    }
    Ok(())
}

/// Lets a database that is made just now give pages back; one that has tables would have to be written anew.
async fn make_incremental(pool: &SqlitePool) -> Result<(), StoreError> {
    let objects: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM sqlite_master").fetch_one(pool).await?;
    if objects == 0 {
        let mut connection = pool.acquire().await?;
        sqlx::query("PRAGMA auto_vacuum = INCREMENTAL").execute(&mut *connection).await?;
        sqlx::query("VACUUM").execute(&mut *connection).await?;
    }
    Ok(())
}

async fn check_integrity(pool: &SqlitePool, path: &Path) -> Result<(), StoreError> {
    let answer: String = sqlx::query_scalar("PRAGMA quick_check(1)").fetch_one(pool).await?;
    if answer != "ok" {
        return Err(StoreError::Corrupt { detail: format!("{}: {answer}", path.display()) });
    }
    Ok(())
}
