//! The records in a PostgreSQL that many processes share: connections, transactions and its clock. Nothing hangs on a
//! session, so that a pooler may stand between; only `LISTEN` does, which has a connection of its own (`hearing.rs`).

use std::{
    fmt,
    str::FromStr,
    sync::Arc,
    time::{Duration, Instant},
};

use sqlx::{
    AssertSqlSafe, ConnectOptions, Connection,
    postgres::{PgConnectOptions, PgListener, PgPoolOptions},
};

use super::{
    Clock, SharedPlaces, StoreError,
    connections::Connections,
    fullness::Fullness,
    migrations,
    sql::{self, On, Pooler},
};

/// A database that has room for so many bytes is not full.
const ROOM_BYTES: usize = 1 << 20;
/// The oldest version that is tested: `14`.
const LEAST_VERSION: i32 = 140_000;
const LEAST_VERSION_TEXT: &str = "14";
/// A process that stops within a transaction holds rows for so long at most; then the database ends its connection.
const BEGIN: &str = "BEGIN; SET LOCAL idle_in_transaction_session_timeout = 10000; SET LOCAL lock_timeout = 15000";

/// A transaction that changes something.
pub(super) struct PostgresTransaction(sqlx::Transaction<'static, sqlx::Postgres>, Pooler, Arc<Fullness>);

/// The database; cheap to clone.
#[derive(Clone)]
pub(super) struct Postgres {
    connections: Connections,
    pooler: Pooler,
    /// For connections that hear, with no pooler between.
    direct: Arc<PgConnectOptions>,
}

impl fmt::Debug for Postgres {
    /// Without the options, which hold a password.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Postgres").finish_non_exhaustive()
    }
}

impl Postgres {
    /// Connects, by `most` connections and one to hear, and brings the tables up to date. A database that is not there
    /// is waited for, as one is that is being started; one that refuses is not.
    pub async fn open(places: &SharedPlaces, most: u32, busy_timeout: Duration) -> Result<Self, StoreError> {
        let options = |address: &str| {
            if address.is_empty() {
                let detail = "the address of the database is empty: --database postgres://USER:PASSWORD@HOST/DATABASE";
                return Err(StoreError::Unavailable { detail: detail.to_owned() });
            }
            if let Some((scheme, _)) = address.split_once("://")
                && !["postgres", "postgresql"].contains(&scheme)
            {
                let detail = format!("{scheme}:// is no PostgreSQL: --database postgres://USER:PASSWORD@HOST/DATABASE");
                return Err(StoreError::Unavailable { detail });
            }
            PgConnectOptions::from_str(address)
                .map(|options| options.application_name("chladni").disable_statement_logging())
                .map_err(|error| StoreError::Unavailable { detail: format!("the address of the database: {error}") })
        };
        let shared = options(&places.database)?;
        let (pooler, direct, shared) = match &places.direct {
            // The same few statements come again and again, and their plans do not depend on the values. Left to
            // itself, the database plans some of them each time, which takes longer than they do.
            None => (Pooler::Absent, shared.clone(), shared.options([("plan_cache_mode", "force_generic_plan")])),
            // What a session is set to when it begins is a pooler's business, and not needed.
            Some(direct) => {
                (Pooler::ByTransaction, options(direct)?, shared.statement_cache_capacity(0).extra_float_digits(None))
            }
        };
        let begun = Instant::now();
        let mut told = false;
        loop {
            // PgBouncer by itself asks a database that was away again after 15 s.
            let patience = busy_timeout * 6;
            match Self::connect([&shared, &direct], pooler, most, busy_timeout).await {
                Err(error) if error.is_retryable() && begun.elapsed() < patience => {
                    if !std::mem::replace(&mut told, true) {
                        tracing::warn!(%error, "waiting for the database, {} s at most", patience.as_secs_f64());
                    }
                    tokio::time::sleep(Duration::from_millis(250)).await;
                }
                ended => return ended,
            }
        }
    }

    async fn connect(
        [shared, direct]: [&PgConnectOptions; 2],
        pooler: Pooler,
        most: u32,
        busy_timeout: Duration,
    ) -> Result<Self, StoreError> {
        // A pool says only that no connection came in time; one connection says why.
        for options in [shared, direct].into_iter().skip(usize::from(pooler == Pooler::Absent)) {
            let unreachable =
                |detail: String| StoreError::Unavailable { detail: format!("no connection to the database: {detail}") };
            let first = tokio::time::timeout(busy_timeout * 2, options.connect())
                .await
                .map_err(|_| unreachable(format!("no answer within {} s", (busy_timeout * 2).as_secs_f64())))?
                .map_err(|error| match StoreError::from(error) {
                    StoreError::Refused { detail } => StoreError::Refused { detail: format!("the database: {detail}") },
                    StoreError::Unavailable { detail } | StoreError::Busy { detail } => unreachable(detail),
                    other => unreachable(other.to_string()),
                })?;
            let _ = first.close().await;
        }
        let connections = |most: u32| {
            PgPoolOptions::new().max_connections(most).acquire_timeout(busy_timeout * 2 + Duration::from_millis(500))
        };
        let first = connections(1).connect_with(direct.clone()).await?;
        let version: String = sqlx::query_scalar("SHOW server_version_num").fetch_one(&first).await?;
        if version.parse::<i32>().is_ok_and(|version| version < LEAST_VERSION) {
            let found = format!("{}", version.parse::<i32>().unwrap_or_default() / 10_000);
            return Err(StoreError::DatabaseVersion { found, needed: LEAST_VERSION_TEXT });
        }
        migrations::run_postgres(&first).await?;
        first.close().await;
        let pool = connections(most.max(1)).connect_with(shared.clone()).await?;
        Ok(Self { connections: Connections::new(pool), pooler, direct: Arc::new(direct.clone()) })
    }

    /// Where it is, for people; without a password.
    pub fn name(&self) -> String {
        format!("{} at {}", self.direct.get_database().unwrap_or("of no name"), self.direct.get_host())
    }

    /// For statements that are a transaction by themselves.
    pub fn on(&self) -> On<'_> {
        On::PostgresPool(&self.connections, self.pooler)
    }

    /// Begins a transaction. It sees what others have committed before each of its statements; what must not change
    /// meanwhile is locked.
    pub async fn write(&self) -> Result<PostgresTransaction, StoreError> {
        let begun = self.connections.begin(BEGIN).await?;
        Ok(PostgresTransaction(begun, self.pooler, Arc::clone(self.connections.fullness())))
    }

    /// Commits a transaction that changes one row; where the disk was full lately, looks whether it still is.
    pub async fn check_writable(&self, now_ms: i64) -> Result<(), StoreError> {
        if self.connections.fullness().is_full() {
            match self.try_room().await {
                Err(error @ StoreError::StorageFull { .. }) => return Err(error),
                Err(error) => tracing::warn!(%error, "whether the database has room again cannot be told"),
                Ok(()) => {}
            }
            self.connections.fullness().clear();
        }
        sql::query("UPDATE health SET checked_ms = ? WHERE id = 1").bind(now_ms).execute(self.on()).await?;
        Ok(())
    }

    /// Writes so much that room has to be found for it, and takes it back: a table of its own has no free pages.
    async fn try_room(&self) -> Result<(), StoreError> {
        let table = format!("chladni_room_{}", uuid::Uuid::now_v7().simple());
        let mut transaction = self.write().await?;
        // Not compressed.
        for text in [
            format!("CREATE TABLE {table} (bytes BYTEA)"),
            format!("ALTER TABLE {table} ALTER COLUMN bytes SET STORAGE EXTERNAL"),
        ] {
            sql::query(AssertSqlSafe(text)).execute(transaction.on()).await?;
        }
        sql::query(AssertSqlSafe(format!("INSERT INTO {table} (bytes) VALUES (?)")))
            .bind(vec![0; ROOM_BYTES])
            .execute(transaction.on())
            .await?;
        Ok(transaction.rollback().await?)
    }

    /// Sets a clock by that of the database, to half of the time that asking takes.
    pub async fn set(&self, clock: &Clock) -> Result<(), StoreError> {
        let begun = std::time::Instant::now();
        let now_ms: i64 = sql::query_scalar("SELECT CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT)")
            .fetch_one(self.on())
            .await?;
        clock.set_shared(now_ms + i64::try_from(begun.elapsed().as_millis() / 2).unwrap_or(0));
        Ok(())
    }

    /// A connection of its own that hears what is told on some channels.
    pub async fn listener(&self, channels: &[&str]) -> Result<PgListener, StoreError> {
        let pool = PgPoolOptions::new().max_connections(1).connect_with(PgConnectOptions::clone(&self.direct)).await?;
        let mut listener = PgListener::connect_with(&pool).await?;
        listener.listen_all(channels.iter().copied()).await?;
        Ok(listener)
    }

    /// Waits for running statements and closes every connection.
    pub async fn close(&self) {
        self.connections.close().await;
    }
}

impl PostgresTransaction {
    /// For statements of this transaction.
    pub fn on(&mut self) -> On<'_> {
        On::Postgres(&mut self.0, self.1, &self.2)
    }

    pub async fn commit(self) -> Result<(), sqlx::Error> {
        let Self(transaction, _, fullness) = self;
        transaction.commit().await.inspect_err(|error| fullness.note(error))
    }

    pub async fn rollback(self) -> Result<(), sqlx::Error> {
        self.0.rollback().await
    }
}
