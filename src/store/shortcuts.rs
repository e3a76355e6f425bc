//! What nearly always happens, as one statement where the records are shared: new work is enqueued, and a result comes
//! to be seen. Whatever is out of the ordinary (equal work, a key that is known, a lease that is lost, a job that is to
//! be stopped, a basis that is made anew) changes nothing here, and is left to the transactions of `jobs.rs` and
//! `leases.rs`, which look at it step by step: docs/decisions/0103.
//!
//! A statement by itself is a transaction. Those that it would take instead, one after the other, are some ten, and
//! each goes there and back.

use std::sync::{Mutex, PoisonError};

use uuid::Uuid;

use super::{
    JobEvent, JobRecord, JobStatus, NewJob, Store, StoreError,
    bases::{self, WrittenBasis},
    fault::FailPoint,
    jobs::uuid_column,
    leases::Tried,
    sql, to_json,
};

/// One part of so many of the room in the queue is filled without counting again: so many servers together do not take
/// more than there was.
const PARTS_OF_ROOM: u64 = 16;
/// What was counted is good for so long, in milliseconds.
const ROOM_MS: i64 = 1000;

/// Jobs that this process may still enqueue before those that wait are counted again.
#[derive(Debug, Default)]
pub(super) struct Room(Mutex<Counted>);

#[derive(Debug, Default, Clone, Copy)]
struct Counted {
    at_ms: i64,
    left: u64,
}

impl Room {
    /// Takes one place of what was counted lately, if there is one left.
    fn take(&self, now_ms: i64) -> bool {
        let mut counted = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = (0..ROOM_MS).contains(&(now_ms - counted.at_ms)) && counted.left > 0;
        counted.left -= u64::from(fresh);
        fresh
    }

    fn note(&self, now_ms: i64, left: u64) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Counted { at_ms: now_ms, left };
    }
}

impl Store {
    /// Makes the job of a request where nothing speaks against it. `None` where something does, or the records are not
    /// shared: nothing has changed.
    pub(super) async fn enqueue_at_once(&self, new: &NewJob, now_ms: i64) -> Result<Option<JobRecord>, StoreError> {
        let usual = self.is_shared() && new.bases.is_empty() && new.memory_bytes <= new.most_bytes;
        if !usual || !self.has_room(now_ms).await? {
            return Ok(None);
        }
        let id = Uuid::now_v7();
        let max_attempts = new.max_attempts.max(1);
        let memory_bytes = i64::try_from(new.memory_bytes).unwrap_or(i64::MAX);
        let whole = to_json(&new.parameters)?;
        let (shown, whole) = match &new.brief {
            Some(brief) => (to_json(brief)?, Some(whole)),
            None => (whole, None),
        };
        let key = new.idempotency.as_ref();
        let made = sql::query(
            "WITH source AS (SELECT id FROM meshes WHERE id = ?3 FOR KEY SHARE),
             made AS (
                INSERT INTO jobs (id, kind, mesh, priority, status, max_attempts, work_key, solver_version,
                    created_ms, enqueued_ms, not_before_ms, memory_bytes)
                SELECT ?1, ?2, source.id, ?4, 'enqueued', ?5, ?6, ?7, ?8, ?8, ?8, ?9 FROM source
                WHERE NOT EXISTS (SELECT 1 FROM jobs WHERE work_key = ?6
                    AND ((status IN ('enqueued', 'processing') AND cancel_requested = 0) OR (status = 'succeeded' AND basis IS NOT NULL)))
                  AND NOT EXISTS (SELECT 1 FROM idempotency_keys WHERE idempotency_key = ?12)
                ON CONFLICT (work_key) WHERE status IN ('enqueued', 'processing') AND cancel_requested = 0 DO NOTHING
                RETURNING id),
             told AS (INSERT INTO job_parameters (job, shown, whole) SELECT id, ?10, ?11 FROM made),
             kept AS (
                INSERT INTO idempotency_keys (idempotency_key, request_hash, job, created_ms)
                SELECT ?12, ?13, id, ?8 FROM made WHERE ?12 IS NOT NULL)
             SELECT id FROM made",
        )
        .bind(id.to_string())
        .bind(&new.kind)
        .bind(&new.mesh)
        .bind(new.priority)
        .bind(i64::from(max_attempts))
        .bind(&new.work_key)
        .bind(&new.solver_version)
        .bind(now_ms)
        .bind(memory_bytes)
        .bind(shown)
        .bind(whole)
        .bind(key.map(|key| key.key.clone()))
        .bind(key.map(|key| key.request_hash.clone()))
        .fetch_optional(self.inner.catalog.reader())
        .await;
        match made {
            Ok(Some(_)) => {}
            Ok(None) => return Ok(None),
            // Another process was faster with the same key.
            Err(sqlx::Error::Database(error)) if error.is_unique_violation() => return Ok(None),
            Err(error) => return Err(error.into()),
        }
        Ok(Some(JobRecord {
            id,
            kind: new.kind.clone(),
            mesh: new.mesh.clone(),
            bases: Vec::new(),
            parameters: new.brief.clone().unwrap_or_else(|| new.parameters.clone()),
            priority: new.priority,
            status: JobStatus::Enqueued,
            stage: None,
            progress: None,
            detail: None,
            stage_seconds: Vec::new(),
            attempt: 0,
            max_attempts,
            cancel_requested: false,
            basis: None,
            problem: None,
            work_key: new.work_key.clone(),
            solver_version: new.solver_version.clone(),
            created_ms: now_ms,
            enqueued_ms: now_ms,
            not_before_ms: now_ms,
            started_ms: None,
            finished_ms: None,
            memory_bytes: memory_bytes as u64,
            parts: 0,
            parts_done: 0,
            parent: None,
            revision: 1,
        }))
    }

    /// Whether the queue has room, as far as this process can tell without counting each time: what waits may be many
    /// thousands.
    async fn has_room(&self, now_ms: i64) -> Result<bool, StoreError> {
        let Some(limit) = self.inner.options.queued_jobs_limit else { return Ok(true) };
        if self.inner.room.take(now_ms) {
            return Ok(true);
        }
        let waiting: i64 = sql::query_scalar("SELECT COUNT(*) FROM jobs WHERE status = 'enqueued'")
            .fetch_one(self.inner.catalog.reader())
            .await?;
        let left = limit.saturating_sub(waiting as u64) / PARTS_OF_ROOM;
        self.inner.room.note(now_ms, left);
        // The last places are given by a transaction, one after the other.
        Ok(self.inner.room.take(now_ms))
    }

    /// Marks the job of a lease as succeeded and writes its result down, where the lease holds, nobody has asked the
    /// job to stop, it had no result before, and no other job waits for it or has solved a part of it. `None` where it
    /// is otherwise, or the records are not shared: nothing has changed.
    pub(super) async fn make_visible_at_once(
        &self,
        token: Uuid,
        written: &WrittenBasis,
        stage_seconds: &[(String, f64)],
        tried: &Tried,
    ) -> Result<Option<(Uuid, JobEvent)>, StoreError> {
        // What a first try may have written is looked for by the transaction.
        if !self.is_shared() || !tried.is_new() {
            return Ok(None);
        }
        let (id, now_ms) = (Uuid::now_v7(), self.now_ms());
        // A row that another transaction has locked is waited for, and looked at anew.
        let text = concat!(
            "WITH done AS (
                UPDATE jobs SET status = 'succeeded', basis = ?1, stage = NULL, progress = 1, detail = NULL, stage_seconds = ?2, problem = NULL,
                    lease_token = NULL, lease_expires_ms = NULL, finished_ms = ?3, revision = revision + 1
                WHERE lease_token = ?4 AND status = 'processing' AND cancel_requested = 0 AND parts = 0 AND kind <> 'eigenbasis_part'
                    AND NOT EXISTS (SELECT 1 FROM bases WHERE bases.job = jobs.id)
                RETURNING id, mesh, solver_version, revision),
             stored AS (",
            bases::insert!("done"),
            ") SELECT id, revision FROM done"
        );
        self.faults().reach(FailPoint::BeforeComplete);
        tried.note(id, now_ms);
        let query = written.bind(sql::query(text), id, stage_seconds, now_ms, &token.to_string())?;
        let Some(row) = query.fetch_optional(self.inner.catalog.reader()).await? else { return Ok(None) };
        let event = JobEvent {
            job: uuid_column(&row, "id")?,
            revision: row.try_get("revision")?,
            status: JobStatus::Succeeded,
            cancel_requested: false,
        };
        Ok(Some((id, event)))
    }
}

#[cfg(test)]
mod tests {
    use super::Room;

    #[test]
    fn room_is_counted_again_when_it_is_used_up_or_a_second_has_passed() {
        let room = Room::default();
        assert!(!room.take(5000));
        room.note(5000, 2);
        assert_eq!([5000, 5999, 5999].map(|now_ms| room.take(now_ms)), [true, true, false]);
        room.note(6000, 2);
        assert_eq!([7000, 5999, 6500].map(|now_ms| room.take(now_ms)), [false, false, true]);
    }
}
