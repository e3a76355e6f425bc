//! Connections to PostgreSQL that have just been used, kept at hand for the next statement. The pool asks a connection
//! whether it lives before it hands it out and again when it gets it back, and opens another for whoever comes
//! meanwhile: statements that follow each other would go there and back three times each, by several connections in
//! turn.

use std::{
    fmt,
    ops::DerefMut,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use sqlx::{ConnectOptions, Connection, PgConnection, PgPool, Postgres, pool::PoolConnection};

use super::{StoreError, fullness::Fullness};

/// A connection that was used so lately is taken to live.
const FRESH: Duration = Duration::from_secs(1);
/// Who has waited so long for a connection asks whether there is a database to connect to. The pool does not say: while
/// connections are refused it tries again, until nobody would wait any more.
const DOUBT: Duration = Duration::from_secs(1);
/// A database that does not let anybody in within so long is away.
const SILENCE: Duration = Duration::from_secs(3);
/// What was found of it is good for so long.
const KNOWN: Duration = Duration::from_millis(500);

/// When a database was asked, and why it could not be connected to, if so.
type ConnectionAttempt = Option<(Instant, Option<String>)>;

/// Connections of a pool, and those of them that are at hand; cheap to clone.
#[derive(Clone)]
pub(super) struct Connections {
    pool: PgPool,
    idle: Arc<Mutex<IdleConnections>>,
    /// Who waits for the pool: then nothing is kept from it.
    waiting: Arc<AtomicUsize>,
    /// When it was last asked whether the database is there, and why it is not, if so.
    asked: Arc<tokio::sync::Mutex<ConnectionAttempt>>,
    fullness: Arc<Fullness>,
}

/// Connections and when each was used.
#[derive(Default)]
struct IdleConnections(Vec<(PoolConnection<Postgres>, Instant)>);

impl Drop for IdleConnections {
    /// The pool would take them back in a task, which there may be nothing to run any more.
    fn drop(&mut self) {
        self.0.drain(..).for_each(|(connection, _)| drop(connection.detach()));
    }
}

impl fmt::Debug for Connections {
    /// Without the options, which hold a password.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Connections").finish_non_exhaustive()
    }
}

/// One who waits for the pool, until this is dropped.
struct Waiting<'c>(&'c AtomicUsize);

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

impl Connections {
    pub fn new(pool: PgPool) -> Self {
        Self { pool, idle: Arc::default(), waiting: Arc::default(), asked: Arc::default(), fullness: Arc::default() }
    }

    /// Whether the database has room.
    pub fn fullness(&self) -> &Arc<Fullness> {
        &self.fullness
    }

    /// A connection of the pool, which asks the database first whether it lives. Where all are in use one is waited
    /// for; where the database is away, that is said within a second or two.
    async fn acquire(&self) -> Result<PoolConnection<Postgres>, sqlx::Error> {
        if let Ok(asked) = self.asked.try_lock()
            && let Some((when, Some(why))) = &*asked
            && when.elapsed() < KNOWN
        {
            return Err(database_unavailable(why));
        }
        let mut acquired = std::pin::pin!(self.pool.acquire());
        loop {
            match tokio::time::timeout(DOUBT, &mut acquired).await {
                Ok(acquired) => return acquired,
                Err(_) => {
                    if let Some(why) = self.absence().await {
                        return Err(database_unavailable(&why));
                    }
                }
            }
        }
    }

    /// Why the database cannot be connected to; `None` where it can. One asks for all who want to know.
    async fn absence(&self) -> Option<String> {
        let mut asked = self.asked.lock().await;
        if let Some((when, found)) = &*asked
            && when.elapsed() < KNOWN
        {
            return found.clone();
        }
        let options = self.pool.connect_options();
        let found = match tokio::time::timeout(SILENCE, options.connect()).await {
            Ok(Ok(connection)) => {
                let _ = connection.close().await;
                None
            }
            Ok(Err(error)) => {
                let said = error.to_string();
                // It has as many connections as it may: that is no absence.
                (!matches!(StoreError::from(error), StoreError::Busy { .. })).then_some(said)
            }
            Err(_) => Some(format!("it has let nobody in for {} s", SILENCE.as_secs())),
        };
        *asked = Some((Instant::now(), found.clone()));
        found
    }

    fn at_hand(&self) -> Option<(PoolConnection<Postgres>, Instant)> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).0.pop()
    }

    /// A connection that lives, as far as is known.
    pub async fn take(&self) -> Result<PoolConnection<Postgres>, sqlx::Error> {
        loop {
            let Some((mut connection, since)) = self.at_hand() else { break };
            // One that does not live is closed by the pool.
            if since.elapsed() < FRESH || connection.ping().await.is_ok() {
                return Ok(connection);
            }
        }
        self.waiting.fetch_add(1, Ordering::SeqCst);
        let _waiting = Waiting(&self.waiting);
        // One that was kept in between, when nobody seemed to wait.
        match self.at_hand() {
            Some((connection, since)) if since.elapsed() < FRESH => Ok(connection),
            _ => self.acquire().await,
        }
    }

    /// Keeps a connection at hand whose last statement has ended.
    pub fn keep(&self, connection: PoolConnection<Postgres>) {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).0.push((connection, Instant::now()));
        if self.waiting.load(Ordering::SeqCst) > 0 || self.pool.is_closed() {
            drop(self.at_hand());
        }
    }

    /// Runs a statement by itself. What it was sent by is kept where the statement has come to its end, well or badly.
    pub async fn run<T>(
        &self,
        statement: impl AsyncFnOnce(&mut PgConnection) -> Result<T, sqlx::Error>,
    ) -> Result<T, sqlx::Error> {
        let mut connection = self.take().await?;
        let answer = statement(connection.deref_mut()).await;
        if matches!(answer, Ok(_) | Err(sqlx::Error::RowNotFound)) {
            self.keep(connection);
        }
        answer
    }

    /// Begins a transaction by a statement.
    pub async fn begin(&self, statement: &'static str) -> Result<sqlx::Transaction<'static, Postgres>, sqlx::Error> {
        sqlx::Transaction::begin(self.take().await?, Some(sqlx::SqlSafeStr::into_sql_str(statement))).await
    }

    /// Begins a transaction on a connection of which the database was asked first.
    pub async fn begin_asked(&self) -> Result<sqlx::Transaction<'static, Postgres>, sqlx::Error> {
        sqlx::Transaction::begin(self.acquire().await?, None).await
    }

    /// Waits for running statements and closes every connection.
    pub async fn close(&self) {
        // It is closed from here on, and what is kept later comes back to it at once.
        let closed = self.pool.close();
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).0.clear();
        closed.await;
    }
}

/// That the database is away.
fn database_unavailable(why: &str) -> sqlx::Error {
    sqlx::Error::Io(std::io::Error::new(std::io::ErrorKind::NotConnected, format!("no connection: {why}")))
}
