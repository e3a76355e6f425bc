//! Where the records are kept: a database of SQLite in the data folder, or a PostgreSQL that many processes share. What
//! is done with them is written once, in statements that both read; where the two differ, it is asked of this:
//! docs/decisions/0072.

#[cfg(feature = "cluster")]
use sqlx::AssertSqlSafe;
use sqlx::{SqlSafeStr, SqlStr};

#[cfg(feature = "cluster")]
use super::postgres::{Postgres, PostgresTransaction};
use super::{
    Clock, StoreError,
    database::{Database, WriteTransaction},
    sql::{self, On},
};

/// Where the records are kept.
#[derive(Debug)]
pub(super) enum Catalog {
    /// This process alone.
    Sqlite(Database),
    /// With others.
    #[cfg(feature = "cluster")]
    Postgres(Postgres),
}

impl Catalog {
    /// The database in the data folder, if that is where the records are.
    pub fn sqlite(&self) -> Option<&Database> {
        match self {
            Self::Sqlite(database) => Some(database),
            #[cfg(feature = "cluster")]
            Self::Postgres(_) => None,
        }
    }

    /// The database that is shared, if that is where the records are.
    #[cfg(feature = "cluster")]
    pub fn postgres(&self) -> Option<&Postgres> {
        match self {
            Self::Sqlite(_) => None,
            Self::Postgres(postgres) => Some(postgres),
        }
    }

    /// Sets a clock by that of the database, where that is shared.
    pub async fn set(&self, clock: &Clock) -> Result<(), StoreError> {
        #[cfg(feature = "cluster")]
        if let Self::Postgres(postgres) = self {
            return postgres.set(clock).await;
        }
        let _ = clock;
        Ok(())
    }

    /// Whether other processes may use the records as well.
    pub fn is_shared(&self) -> bool {
        self.sqlite().is_none()
    }

    /// For statements that only read, or are a transaction by themselves.
    pub fn reader(&self) -> On<'_> {
        match self {
            Self::Sqlite(database) => On::SqliteReader(database.reader()),
            #[cfg(feature = "cluster")]
            Self::Postgres(postgres) => postgres.on(),
        }
    }

    /// Begins a write transaction. In SQLite it is alone among writers; in PostgreSQL rows have to be locked.
    pub async fn write(&self) -> Result<Transaction, StoreError> {
        Ok(match self {
            Self::Sqlite(database) => Transaction::Sqlite(database.write().await?),
            #[cfg(feature = "cluster")]
            Self::Postgres(postgres) => Transaction::Postgres(postgres.write().await?),
        })
    }

    /// A condition that is true where `column` contains a text. Letters of ASCII are alike in both cases.
    pub fn contains(&self, column: &str) -> [String; 2] {
        match self {
            Self::Sqlite(_) => [format!("instr(lower({column}), lower("), ")) > 0".to_owned()],
            #[cfg(feature = "cluster")]
            Self::Postgres(_) => {
                [format!("strpos(lower({column} COLLATE \"C\"), lower("), " COLLATE \"C\")) > 0".to_owned()]
            }
        }
    }

    /// Commits a transaction that changes one row.
    pub async fn check_writable(&self, now_ms: i64) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(database) => database.check_writable(now_ms).await,
            #[cfg(feature = "cluster")]
            Self::Postgres(postgres) => postgres.check_writable(now_ms).await,
        }
    }

    /// Waits for running statements and closes every connection.
    pub async fn close(&self) {
        match self {
            Self::Sqlite(database) => database.close().await,
            #[cfg(feature = "cluster")]
            Self::Postgres(postgres) => postgres.close().await,
        }
    }
}

/// A write transaction. Dropped before [`commit`](Self::commit), it is rolled back.
pub(super) enum Transaction {
    Sqlite(WriteTransaction),
    #[cfg(feature = "cluster")]
    Postgres(PostgresTransaction),
}

impl Transaction {
    /// The connection, to run a statement on.
    pub fn on(&mut self) -> On<'_> {
        match self {
            Self::Sqlite(transaction) => On::Sqlite(transaction.on()),
            #[cfg(feature = "cluster")]
            Self::Postgres(transaction) => transaction.on(),
        }
    }

    /// Makes everything durable and visible at once.
    pub async fn commit(self) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(transaction) => transaction.commit().await,
            #[cfg(feature = "cluster")]
            Self::Postgres(transaction) => Ok(transaction.commit().await?),
        }
    }

    /// Gives up: for refusals, which are no trouble of the database.
    pub async fn rollback(self) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(transaction) => transaction.rollback().await,
            #[cfg(feature = "cluster")]
            Self::Postgres(transaction) => Ok(transaction.rollback().await?),
        }
    }

    /// A statement that reads rows which stay as they are until the transaction ends.
    pub fn locking(&self, text: &'static str) -> SqlStr {
        self.with_lock(text, " FOR UPDATE")
    }

    /// A statement that reads rows which are not deleted until the transaction ends.
    pub fn keeping(&self, text: &'static str) -> SqlStr {
        self.with_lock(text, " FOR KEY SHARE")
    }

    /// A statement that reads rows which stay as they are until the transaction ends, without those that others hold.
    pub fn locking_free(&self, text: &'static str) -> SqlStr {
        self.with_lock(text, " FOR UPDATE SKIP LOCKED")
    }

    /// Has others who count what waits wait for the end of this transaction, lest several take the last place. Alone in
    /// SQLite anyway.
    pub async fn alone_among_those_who_count(&mut self) -> Result<(), StoreError> {
        #[cfg(feature = "cluster")]
        if let Self::Postgres(transaction) = self {
            let lock = sql::query("SELECT 1 FROM (SELECT pg_advisory_xact_lock(7018348714)) AS held");
            lock.fetch_one(transaction.on()).await?;
        }
        Ok(())
    }

    fn with_lock(&self, text: &'static str, lock: &str) -> SqlStr {
        match self {
            // It has the whole database to itself.
            Self::Sqlite(_) => {
                let _ = lock;
                text.into_sql_str()
            }
            #[cfg(feature = "cluster")]
            Self::Postgres(_) => AssertSqlSafe(format!("{text}{lock}")).into_sql_str(),
        }
    }

    /// Writes down how far the database of content has come, where the two are a pair.
    pub async fn remember(&mut self, other_generation: i64) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(transaction) => transaction.remember(other_generation).await,
            #[cfg(feature = "cluster")]
            Self::Postgres(_) => Ok(()),
        }
    }
}
