//! The records in a PostgreSQL that many processes share: connections, transactions and its clock. Nothing hangs on a session, so that a pooler may
//! stand between; only `LISTEN` does, which has a connection of its own (`hearing.rs`).

use std::{fmt, ops::DerefMut, str::FromStr, time::Duration};

use sqlx::{
    ConnectOptions, Connection, PgConnection, PgPool,
    postgres::{PgConnectOptions, PgListener, PgPoolOptions},
};

use super::{Clock, StoreError, migrations};

/// The oldest version that is tested: `14`.
const LEAST_VERSION: i32 = 140_000;
const LEAST_VERSION_TEXT: &str = "14";
/// Connections of one process.
const CONNECTIONS: u32 = 10;
/// A process that stops within a transaction holds rows for so long at most; then the database ends its connection.
pub(super) const BEGIN: &str =
    "BEGIN; SET LOCAL idle_in_transaction_session_timeout = 10000; SET LOCAL lock_timeout = 15000";

/// A transaction that changes something.
pub(super) struct PostgresTransaction(sqlx::Transaction<'static, sqlx::Postgres>);

/// The database.
pub(super) struct Postgres {
    pool: PgPool,
    /// For connections that hear; boxed, since it is large and rarely needed.
    options: Box<PgConnectOptions>,
}

impl fmt::Debug for Postgres {
    /// Without the options, which hold a password.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Postgres").finish_non_exhaustive()
    }
}

impl Postgres {
    /// Connects, and brings the tables up to date.
    pub async fn open(address: &str, busy_timeout: Duration) -> Result<Self, StoreError> {
        let options = PgConnectOptions::from_str(address)
            .map_err(|error| StoreError::Unavailable { detail: format!("the address of the database: {error}") })?
            .application_name("chladni")
            .disable_statement_logging();
        // A pool says only that no connection came in time; one connection says why.
        let unreachable =
            |detail: String| StoreError::Unavailable { detail: format!("no connection to the database: {detail}") };
        let first = tokio::time::timeout(busy_timeout * 2, options.connect())
            .await
            .map_err(|_| unreachable(format!("no answer within {} s", (busy_timeout * 2).as_secs_f64())))?
            .map_err(|error| unreachable(error.to_string()))?;
        let _ = first.close().await;
        let pool = PgPoolOptions::new()
            .max_connections(CONNECTIONS)
            .acquire_timeout(busy_timeout * 2 + Duration::from_millis(500))
            .connect_with(options.clone())
            .await?;
        let version: String = sqlx::query_scalar("SHOW server_version_num").fetch_one(&pool).await?;
        if version.parse::<i32>().is_ok_and(|version| version < LEAST_VERSION) {
            let found = format!("{}", version.parse::<i32>().unwrap_or_default() / 10_000);
            return Err(StoreError::DatabaseVersion { found, needed: LEAST_VERSION_TEXT });
        }
        migrations::run_postgres(&pool).await?;
        Ok(Self { pool, options: Box::new(options) })
    }

    /// The connections.
    pub fn pool(&self) -> &PgPool {
        &self.pool
    }

    /// Begins a transaction. It sees what others have committed before each of its statements; what must not change meanwhile is locked.
    pub async fn write(&self) -> Result<PostgresTransaction, StoreError> {
        Ok(PostgresTransaction(self.pool.begin_with(BEGIN).await?))
    }

    /// Commits a transaction that changes one row.
    pub async fn check_writable(&self, now_ms: i64) -> Result<(), StoreError> {
        sqlx::query("UPDATE health SET checked_ms = $1 WHERE id = 1").bind(now_ms).execute(&self.pool).await?;
        Ok(())
    }

    /// Sets a clock by that of the database, to half of the time that asking takes.
    pub async fn set(&self, clock: &Clock) -> Result<(), StoreError> {
        let begun = std::time::Instant::now();
        let now_ms: i64 = sqlx::query_scalar("SELECT CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT)")
            .fetch_one(&self.pool)
            .await?;
        clock.set_shared(now_ms + i64::try_from(begun.elapsed().as_millis() / 2).unwrap_or(0));
        Ok(())
    }

    /// A connection of its own that hears what is told on a channel.
    pub async fn listener(&self, channel: &str) -> Result<PgListener, StoreError> {
        let pool = PgPoolOptions::new().max_connections(1).connect_with(PgConnectOptions::clone(&self.options)).await?;
        let mut listener = PgListener::connect_with(&pool).await?;
        listener.listen(channel).await?;
        Ok(listener)
    }

    /// Waits for running statements and closes every connection.
    pub async fn close(&self) {
        self.pool.close().await;
    }
}

impl std::ops::Deref for PostgresTransaction {
    type Target = PgConnection;
    fn deref(&self) -> &PgConnection {
        &self.0
    }
}

impl DerefMut for PostgresTransaction {
    fn deref_mut(&mut self) -> &mut PgConnection {
        &mut self.0
    }
}

impl PostgresTransaction {
    pub async fn commit(self) -> Result<(), sqlx::Error> {
        self.0.commit().await
    }

    pub async fn rollback(self) -> Result<(), sqlx::Error> {
        self.0.rollback().await
    }
}
