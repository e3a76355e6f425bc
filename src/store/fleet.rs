//! Who takes jobs, where many processes share the records: each tells what it has, and is known for as long as it is
//! heard of.

use std::sync::{Mutex, PoisonError};

use super::{Store, StoreError, sql};

/// One that has not been heard of for so long, in milliseconds, is taken for gone.
const SILENCE_MS: i64 = 60_000;

/// What is known of a fleet is good for so long, in milliseconds.
const KNOWN_MS: i64 = 1000;

/// The processes that took jobs when they were last asked for, and when that was.
#[derive(Debug, Default)]
pub(super) struct Fleet(Mutex<(i64, Vec<Worker>)>);

impl Fleet {
    /// What is known of the fleet, if that is fresh.
    fn known(&self, now_ms: i64, what: impl FnOnce(&[Worker]) -> Option<u64>) -> Option<u64> {
        let (at_ms, workers) = &*self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if (0..KNOWN_MS).contains(&(now_ms - at_ms)) { what(workers) } else { None }
    }

    fn note(&self, now_ms: i64, workers: Vec<Worker>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = (now_ms, workers);
    }
}

/// What a process has for jobs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Worker {
    /// A name that no other process has.
    pub id: String,
    /// The version of its solver.
    pub solver_version: String,
    /// Jobs that it runs at once.
    pub seats: u64,
    /// Threads that they share.
    pub threads: u64,
    /// Bytes of memory that they share.
    pub memory_bytes: u64,
    /// The kinds of job that it takes; all where it is empty.
    pub kinds: Vec<String>,
}

impl Store {
    /// Whether other processes use the same records.
    pub fn is_shared(&self) -> bool {
        self.inner.catalog.is_shared()
    }

    /// Says that a process takes jobs; nothing is said where it is alone. To be said again well within a minute.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn announce_worker(&self, worker: &Worker) -> Result<(), StoreError> {
        if !self.is_shared() {
            return Ok(());
        }
        let now_ms = self.now_ms();
        sql::query(
            "INSERT INTO workers (id, solver_version, seats, threads, memory_bytes, kinds, seen_ms) VALUES (?, ?, ?, ?, ?, ?, ?)
             ON CONFLICT (id) DO UPDATE SET seen_ms = EXCLUDED.seen_ms",
        )
        .bind(&worker.id)
        .bind(&worker.solver_version)
        .bind(i64::try_from(worker.seats).unwrap_or(i64::MAX))
        .bind(i64::try_from(worker.threads).unwrap_or(i64::MAX))
        .bind(i64::try_from(worker.memory_bytes).unwrap_or(i64::MAX))
        .bind(super::to_json(&worker.kinds)?)
        .bind(now_ms)
        .execute(self.inner.catalog.reader())
        .await?;
        sql::query("DELETE FROM workers WHERE seen_ms < ?")
            .bind(now_ms - SILENCE_MS)
            .execute(self.inner.catalog.reader())
            .await?;
        #[cfg(feature = "cluster")]
        if let Some(hearing) = self.inner.hearing.get() {
            let workers: i64 =
                sql::query_scalar("SELECT COUNT(*) FROM workers").fetch_one(self.inner.catalog.reader()).await?;
            hearing.count_workers(workers as u64);
        }
        Ok(())
    }

    /// Says that a process takes no more jobs.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn dismiss_worker(&self, id: &str) -> Result<(), StoreError> {
        if self.is_shared() {
            sql::query("DELETE FROM workers WHERE id = ?").bind(id).execute(self.inner.catalog.reader()).await?;
        }
        Ok(())
    }

    /// The most memory that any process has that takes jobs of a kind, in bytes; `None` where this one is alone, or no
    /// such process is known. An answer of the last second will do where it has room for `needed` bytes.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn most_memory_for(&self, kind: &str, needed: u64) -> Result<Option<u64>, StoreError> {
        let most = |workers: &[Worker]| {
            let able =
                workers.iter().filter(|worker| worker.kinds.is_empty() || worker.kinds.iter().any(|own| own == kind));
            able.map(|worker| worker.memory_bytes).max()
        };
        let now_ms = self.now_ms();
        if let Some(most) = self.inner.fleet.known(now_ms, most).filter(|&most| most >= needed) {
            return Ok(Some(most));
        }
        let workers = self.workers().await?;
        let found = most(&workers);
        self.inner.fleet.note(now_ms, workers);
        Ok(found)
    }

    /// The processes that take jobs, by their names; none where this one is alone.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn workers(&self) -> Result<Vec<Worker>, StoreError> {
        if !self.is_shared() {
            return Ok(Vec::new());
        }
        let rows = sql::query("SELECT * FROM workers WHERE seen_ms >= ? ORDER BY id")
            .bind(self.now_ms() - SILENCE_MS)
            .fetch_all(self.inner.catalog.reader())
            .await?;
        rows.iter()
            .map(|row| {
                Ok(Worker {
                    id: row.try_get("id")?,
                    solver_version: row.try_get("solver_version")?,
                    seats: row.try_get::<i64, _>("seats")? as u64,
                    threads: row.try_get::<i64, _>("threads")? as u64,
                    memory_bytes: row.try_get::<i64, _>("memory_bytes")? as u64,
                    kinds: super::from_json("kinds", row.try_get("kinds")?)?,
                })
            })
            .collect()
    }
}
