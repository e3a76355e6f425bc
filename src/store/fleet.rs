//! Who takes jobs, where many processes share the records: each tells what it has, and is known for as long as it is
//! heard of.

use std::sync::{Mutex, PoisonError};

use chladni_spectral::basis::{EIGENBASIS_PART, ProductKind};

use super::{JobRecord, JobStatus, Store, StoreError, sql};

/// One that has not been heard of for so long, in milliseconds, is taken for gone.
const SILENCE_MS: i64 = 60_000;

/// What is known of a fleet is good for so long, in milliseconds.
const KNOWN_MS: i64 = 1000;

/// Whether a job can be done by a worker that was heard of since `?2`, or there is none: as a claim looks at it
/// (`claims.rs`).
const SOMEBODY_IS_ABLE: &str = " AND (NOT EXISTS (SELECT 1 FROM workers WHERE seen_ms >= ?2) OR EXISTS (
    SELECT 1 FROM workers WHERE seen_ms >= ?2 AND workers.memory_bytes >= jobs.memory_bytes
        AND (kinds = '[]' OR strpos(kinds, '\"' || CASE kind WHEN 'eigenbasis_part' THEN 'eigenbasis' ELSE kind END || '\"') > 0
            OR strpos(kinds, '\"' || kind || '\"') > 0)
        AND (jobs.solver_version = workers.solver_version
            OR CASE WHEN jobs.solver_version ~ '^[0-9]+([.+][0-9]+)*$' AND workers.solver_version ~ '^[0-9]+([.+][0-9]+)*$'
                THEN CAST(string_to_array(translate(jobs.solver_version, '+', '.'), '.') AS INTEGER[])
                    <= CAST(string_to_array(translate(workers.solver_version, '+', '.'), '.') AS INTEGER[])
                ELSE FALSE END)))";

/// The processes that took jobs when they were last asked for, and when that was.
#[derive(Debug, Default)]
pub(super) struct Fleet(Mutex<(i64, Vec<Worker>)>);

impl Fleet {
    /// What is known of the fleet, if that is fresh.
    fn known(&self, now_ms: i64, what: impl FnOnce(&[Worker]) -> Option<u64>) -> Option<u64> {
        let (at_ms, workers) = &*self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if (0..KNOWN_MS).contains(&(now_ms - at_ms)) { what(workers) } else { None }
    }

    /// The fleet, if what is known of it is fresh.
    fn all(&self, now_ms: i64) -> Option<Vec<Worker>> {
        let (at_ms, workers) = &*self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (0..KNOWN_MS).contains(&(now_ms - at_ms)).then(|| workers.clone())
    }

    /// Has it asked for anew.
    #[cfg(test)]
    pub fn forget(&self) {
        self.note(i64::MIN, Vec::new());
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

/// The condition, where workers share the records.
pub(super) fn somebody_is_able(shared: bool) -> &'static str {
    if shared { SOMEBODY_IS_ABLE } else { "" }
}

impl Worker {
    fn takes(&self, kind: &str) -> bool {
        // Who solves eigenproblems solves their parts.
        let own = if kind == EIGENBASIS_PART { ProductKind::Eigenbasis.name() } else { kind };
        self.kinds.is_empty() || self.kinds.iter().any(|taken| taken == kind || taken == own)
    }

    /// Whether it may do jobs of a version: those of a newer solver it leaves to others.
    fn may_do(&self, version: &str) -> bool {
        let numbers =
            |text: &str| -> Option<Vec<u64>> { text.split(['.', '+']).map(|number| number.parse().ok()).collect() };
        let older = || Some(numbers(version)? <= numbers(&self.solver_version)?);
        self.solver_version == version || older().unwrap_or(false)
    }
}

/// Why none of these takes a job; `None` where one does.
fn why_nobody(job: &JobRecord, workers: &[Worker]) -> Option<String> {
    if workers.is_empty() {
        return Some("waits for a worker: none has been heard of for a minute".to_owned());
    }
    let of_kind: Vec<&Worker> = workers.iter().filter(|worker| worker.takes(&job.kind)).collect();
    if of_kind.is_empty() {
        return Some(format!("waits for a worker that takes jobs of the kind {}", job.kind));
    }
    let of_version: Vec<&Worker> = of_kind.into_iter().filter(|worker| worker.may_do(&job.solver_version)).collect();
    if of_version.is_empty() {
        return Some(format!("waits for a worker whose solver is {} or newer", job.solver_version));
    }
    let most = of_version.iter().map(|worker| worker.memory_bytes).max().unwrap_or(0);
    (most < job.memory_bytes).then(|| {
        format!("waits for a worker with {} bytes of memory for jobs; the largest has {most}", job.memory_bytes)
    })
}

impl Store {
    /// Workers that were heard of before are taken for gone.
    pub(super) fn heard_since_ms(&self) -> i64 {
        self.now_ms() - SILENCE_MS
    }

    /// Why each of some jobs waits for which no living worker is there that may do it; `None` for all others, and where
    /// this process is alone. An answer of the last second will do.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn why_nobody_takes(&self, jobs: &[JobRecord]) -> Result<Vec<Option<String>>, StoreError> {
        let waits = |job: &JobRecord| job.status == JobStatus::Enqueued;
        if !self.is_shared() || !jobs.iter().any(waits) {
            return Ok(vec![None; jobs.len()]);
        }
        let now_ms = self.now_ms();
        let workers = match self.inner.fleet.all(now_ms) {
            Some(workers) => workers,
            None => {
                let workers = self.workers().await?;
                self.inner.fleet.note(now_ms, workers.clone());
                workers
            }
        };
        Ok(jobs.iter().map(|job| if waits(job) { why_nobody(job, &workers) } else { None }).collect())
    }

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
            workers.iter().filter(|worker| worker.takes(kind)).map(|worker| worker.memory_bytes).max()
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
            .bind(self.heard_since_ms())
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
