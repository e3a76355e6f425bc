//! One job in parts: a job that waits without a worker until others have solved its parts, and then joins what they
//! made.
//!
//! Who claims a job that asks to be divided gives it back with its parts, in one transaction ([`Store::divide`]). From
//! then on nothing has to be remembered: a claim passes over a job of which a part waits or runs, and what is due
//! beyond that ([`Store::maintain_parts`]) follows from the records as they are. It is done soon after a part or a
//! divided job has changed, and by every process now and then, so that no death of one leaves anything undone.

use std::num::NonZeroUsize;

use chladni_spectral::basis::EIGENBASIS_PART;
use serde_json::Value;
use uuid::Uuid;

use super::{
    JobProblem, JobRecord, JobStatus, Store, StoreError,
    catalog::Transaction,
    detached,
    fault::FailPoint,
    from_json,
    jobs::{self, MOST_RACES, job_from_row, read_job, status_column, uuid_column},
    leases::{finish, leased_job},
    sql::{self, Row},
};

/// What parts of a failed job have made is kept so long, for a retry of it to find.
const KEPT_MS: i64 = 3600 * 1000;
/// The stage of a job that waits for its parts.
const STAGE: &str = "parts";

/// A job is not next while one of its parts waits or runs.
pub(super) const PARTS_HAVE_ENDED: &str = "(parts = 0 OR NOT EXISTS (
    SELECT 1 FROM job_parts JOIN jobs AS pieces ON pieces.id = job_parts.part
    WHERE job_parts.job = jobs.id AND pieces.status IN ('enqueued', 'processing')))";

/// A part to be enqueued. Mesh, priority, attempts and version are those of its job.
#[derive(Debug, Clone, PartialEq)]
pub struct NewPart {
    /// Its parameters.
    pub parameters: Value,
    /// The same with long lists told by their length and hash, where there are any.
    pub brief: Option<Value>,
    /// Equal keys are equal parts.
    pub work_key: String,
    /// An estimate of the memory that it needs while it runs.
    pub memory_bytes: u64,
}

/// What became of a job that was to be divided.
#[derive(Debug, Clone, PartialEq)]
pub enum DivideAnswer {
    /// It waits for its parts.
    Divided(Box<JobRecord>),
    /// It had been asked to stop: it is cancelled, and there are no parts.
    Canceled,
    /// The lease was lost: nothing has changed.
    Lost,
}

/// A part as it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct PartRecord {
    /// Which part, from 1.
    pub place: usize,
    /// The job that solves it.
    pub job: Uuid,
    /// Where that stands.
    pub status: JobStatus,
    /// Why it failed.
    pub problem: Option<JobProblem>,
    /// Seconds spent in each stage of its last attempt, in order.
    pub stage_seconds: Vec<(String, f64)>,
    /// What it made, while that is stored.
    pub made: Option<MadePart>,
}

/// What a part made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MadePart {
    /// The key of its blob.
    pub content_hash: String,
    /// Its bytes.
    pub bytes: u64,
}

impl PartRecord {
    /// Why nothing becomes of the whole, where nothing will become of this part.
    pub fn broken(&self, of: usize) -> Option<JobProblem> {
        let which = format!("part {} of {of}", self.place);
        match (self.status, &self.problem) {
            (JobStatus::Failed, Some(problem)) => {
                let detail = format!("{which}: {}", problem.detail);
                Some(JobProblem { kind: problem.kind.clone(), detail })
            }
            (JobStatus::Failed | JobStatus::Canceled, _) => {
                Some(JobProblem { kind: "part-lost".to_owned(), detail: format!("{which} was given up") })
            }
            _ => None,
        }
    }
}

impl JobRecord {
    /// Whether it solves a part of another job.
    pub fn is_part(&self) -> bool {
        self.kind == EIGENBASIS_PART
    }
}

impl Store {
    /// Enqueues the parts of a job and gives it back to the queue, to wait for them, in one step: the attempt does not
    /// count. Equal parts that wait, run or are done are not enqueued again.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin: nothing has changed and the lease still holds.
    pub async fn divide(&self, token: Uuid, parts: Vec<NewPart>) -> Result<DivideAnswer, StoreError> {
        let store = self.clone();
        detached(async move { store.divide_now(token, &parts).await }).await
    }

    async fn divide_now(&self, token: Uuid, parts: &[NewPart]) -> Result<DivideAnswer, StoreError> {
        for _ in 0..MOST_RACES {
            let now_ms = self.now_ms();
            let mut transaction = self.inner.catalog.write().await?;
            let Some(job) = leased_job(&mut transaction, token).await? else {
                transaction.rollback().await?;
                return Ok(DivideAnswer::Lost);
            };
            if job.cancel_requested {
                let job = finish(&mut transaction, &job, JobStatus::Canceled, None, now_ms).await?;
                transaction.commit().await?;
                self.announce(&job);
                return Ok(DivideAnswer::Canceled);
            }
            let Some(made) = self.insert_parts(&mut transaction, &job, parts, now_ms).await? else {
                transaction.rollback().await?;
                continue;
            };
            let row = sql::query(jobs::returning!(
                "UPDATE jobs SET status = 'enqueued', attempt = ?1, parts = ?2, stage = ?3, progress = 0, detail = ?4, stage_seconds = '[]',
                    enqueued_ms = ?5, not_before_ms = ?5, lease_token = NULL, lease_expires_ms = NULL, revision = revision + 1
                 WHERE id = ?6"
            ))
            .bind(i64::from(job.attempt.saturating_sub(1)))
            .bind(parts.len() as i64)
            .bind(STAGE)
            .bind(words(0, parts.len() as u64))
            .bind(now_ms)
            .bind(job.id.to_string())
            .fetch_one(transaction.on())
            .await?;
            let job = job_from_row(&row)?;
            self.faults().reach(FailPoint::BeforeDivide);
            transaction.commit().await?;
            self.faults().reach(FailPoint::AfterDivide);
            made.iter().for_each(|part| self.announce(part));
            self.announce(&job);
            return Ok(DivideAnswer::Divided(Box::new(job)));
        }
        Err(StoreError::Busy { detail: "equal parts keep being deleted and re-created".to_owned() })
    }

    /// Finds or makes the parts of a job; gives those that are new. `None` where another process was faster with an
    /// equal one.
    async fn insert_parts(
        &self,
        on: &mut Transaction,
        job: &JobRecord,
        parts: &[NewPart],
        now_ms: i64,
    ) -> Result<Option<Vec<JobRecord>>, StoreError> {
        sql::query("DELETE FROM job_parts WHERE job = ?").bind(job.id.to_string()).execute(on.on()).await?;
        let mut made = Vec::new();
        for (place, part) in (1..).zip(parts) {
            let id = match self.same_part(on, job, part).await? {
                Some(id) => id,
                None => {
                    let Some(new) = self.insert_part(on, job, part, now_ms).await? else { return Ok(None) };
                    let id = new.id;
                    made.push(new);
                    id
                }
            };
            sql::query("INSERT INTO job_parts (id, job, place, part) VALUES (?, ?, ?, ?)")
                .bind(format!("{}/{place}", job.id))
                .bind(job.id.to_string())
                .bind(place)
                .bind(id.to_string())
                .execute(on.on())
                .await?;
        }
        Ok(Some(made))
    }

    /// An equal part that waits, runs or is done, which stays until the transaction ends.
    async fn same_part(
        &self,
        on: &mut Transaction,
        job: &JobRecord,
        part: &NewPart,
    ) -> Result<Option<Uuid>, StoreError> {
        let text = on.keeping(
            "SELECT id FROM jobs WHERE work_key = ?
               AND ((status IN ('enqueued', 'processing') AND cancel_requested = 0) OR (status = 'succeeded' AND basis IS NOT NULL))
             ORDER BY sequence DESC LIMIT 1",
        );
        let Some(row) = sql::query(text).bind(&part.work_key).fetch_optional(on.on()).await? else { return Ok(None) };
        let id = uuid_column(&row, "id")?;
        // Whoever is in more of a hurry moves the work that both wait for.
        sql::query("UPDATE jobs SET priority = ?1, revision = revision + 1 WHERE id = ?2 AND status = 'enqueued' AND priority < ?1")
            .bind(job.priority)
            .bind(id.to_string())
            .execute(on.on())
            .await?;
        Ok(Some(id))
    }

    async fn insert_part(
        &self,
        on: &mut Transaction,
        job: &JobRecord,
        part: &NewPart,
        now_ms: i64,
    ) -> Result<Option<JobRecord>, StoreError> {
        let new = super::NewJob {
            kind: EIGENBASIS_PART.to_owned(),
            mesh: job.mesh.clone(),
            bases: Vec::new(),
            parameters: part.parameters.clone(),
            brief: part.brief.clone(),
            priority: job.priority,
            idempotency: None,
            max_attempts: job.max_attempts,
            work_key: part.work_key.clone(),
            solver_version: job.solver_version.clone(),
            memory_bytes: part.memory_bytes,
            most_bytes: u64::MAX,
        };
        self.insert_row(on, &new, now_ms).await
    }

    /// The parts of a job, in their order; none where it is not divided, or has let go of them.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn parts_of(&self, job: Uuid) -> Result<Vec<PartRecord>, StoreError> {
        let rows = sql::query(PARTS_OF).bind(job.to_string()).fetch_all(self.inner.catalog.reader()).await?;
        rows.iter().map(part_from_row).collect()
    }

    /// Does what is due: a job of which a part was given up ends with its reason, one of which another part is done
    /// says so, and parts that no job needs any more are cancelled or deleted, with what they made. Gives the jobs that
    /// ended.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn maintain_parts(&self) -> Result<Vec<JobRecord>, StoreError> {
        let store = self.clone();
        detached(async move {
            let ended = store.maintain_divided().await?;
            store.let_go().await?;
            store.collect_parts().await?;
            Ok(ended)
        })
        .await
    }

    /// Jobs that wait for their parts hear of them.
    async fn maintain_divided(&self) -> Result<Vec<JobRecord>, StoreError> {
        let rows = sql::query(
            "SELECT job_parts.job AS job, MIN(parents.parts) AS parts,
                CAST(SUM(CASE WHEN pieces.status = 'succeeded' AND pieces.basis IS NOT NULL THEN 1 ELSE 0 END) AS BIGINT) AS done,
                CAST(SUM(CASE WHEN pieces.status IN ('failed', 'canceled') THEN 1 ELSE 0 END) AS BIGINT) AS broken
             FROM job_parts JOIN jobs AS parents ON parents.id = job_parts.job JOIN jobs AS pieces ON pieces.id = job_parts.part
             WHERE parents.status = 'enqueued' GROUP BY job_parts.job",
        )
        .fetch_all(self.inner.catalog.reader())
        .await?;
        let mut ended = Vec::new();
        for row in &rows {
            let id = uuid_column(row, "job")?;
            let count = |name: &str| row.try_get::<i64, _>(name);
            match (count("broken")?, NonZeroUsize::new(count("parts")?.max(0) as usize)) {
                (0, Some(parts)) => self.tell_of_parts(id, count("done")?, parts).await?,
                (0, None) => {}
                _ => ended.extend(self.fail_divided(id).await?),
            }
        }
        Ok(ended)
    }

    async fn tell_of_parts(&self, id: Uuid, done: i64, parts: NonZeroUsize) -> Result<(), StoreError> {
        // When the last is done it waits for a worker, from now on.
        let row = self.change_one(
            sql::query(jobs::returning!(
                "UPDATE jobs SET stage = ?1, progress = ?2, detail = ?3, enqueued_ms = CASE WHEN ?4 = parts THEN ?5 ELSE enqueued_ms END,
                    revision = revision + 1
                 WHERE id = ?6 AND status = 'enqueued' AND parts = ?7 AND COALESCE(progress, -1) < ?2"
            ))
            .bind(STAGE)
            .bind(done as f64 / parts.get() as f64)
            .bind(words(done.max(0) as u64, parts.get() as u64))
            .bind(done)
            .bind(self.now_ms())
            .bind(id.to_string())
            .bind(parts.get() as i64),
        );
        if let Some(row) = row.await? {
            self.announce(&job_from_row(&row)?);
        }
        Ok(())
    }

    /// Ends a job of which a part was given up.
    async fn fail_divided(&self, id: Uuid) -> Result<Option<JobRecord>, StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        let job = match read_job(&mut transaction, id).await {
            Ok(job) if job.status == JobStatus::Enqueued => Some(job),
            Ok(_) | Err(StoreError::NotFound { .. }) => None,
            Err(error) => return Err(error),
        };
        let rows = sql::query(PARTS_OF).bind(id.to_string()).fetch_all(transaction.on()).await?;
        let parts = rows.iter().map(part_from_row).collect::<Result<Vec<_>, StoreError>>()?;
        let broken = job.and_then(|job| {
            let problem = parts.iter().find_map(|part| part.broken(job.parts as usize))?;
            Some((job, problem))
        });
        let Some((job, problem)) = broken else {
            transaction.rollback().await?;
            return Ok(None);
        };
        let job = finish(&mut transaction, &job, JobStatus::Failed, Some(&problem), self.now_ms()).await?;
        transaction.commit().await?;
        tracing::warn!(job = %job.id, problem = problem.kind, detail = problem.detail, "a part was given up, and its job with it");
        self.announce(&job);
        Ok(Some(job))
    }

    /// Jobs that have ended let go of their parts; one that failed after an hour, within which a retry finds what was
    /// done.
    async fn let_go(&self) -> Result<(), StoreError> {
        const ENDED: &str = "job IN (SELECT jobs.id FROM job_parts JOIN jobs ON jobs.id = job_parts.job
            WHERE jobs.status IN ('succeeded', 'canceled') OR (jobs.status = 'failed' AND jobs.finished_ms < ?))";
        let before_ms = self.now_ms().saturating_sub(KEPT_MS);
        let text = format!("SELECT COUNT(*) FROM job_parts WHERE {ENDED}");
        let ended: i64 =
            sql::query_scalar(sqlx::AssertSqlSafe(text)).bind(before_ms).fetch_one(self.inner.catalog.reader()).await?;
        if ended > 0 {
            let mut transaction = self.inner.catalog.write().await?;
            let text = format!("DELETE FROM job_parts WHERE {ENDED}");
            sql::query(sqlx::AssertSqlSafe(text)).bind(before_ms).execute(transaction.on()).await?;
            transaction.commit().await?;
        }
        Ok(())
    }

    /// Cancels parts that no unfinished job needs, and deletes those that no job has.
    async fn collect_parts(&self) -> Result<(), StoreError> {
        // What waits is cancelled first, and then deleted.
        for _ in 0..2 {
            let ids: Vec<String> = sql::query_scalar(
                "SELECT id FROM jobs WHERE kind = ?1 AND CASE
                    WHEN status IN ('enqueued', 'processing') THEN cancel_requested = 0 AND NOT EXISTS (
                        SELECT 1 FROM job_parts JOIN jobs AS parents ON parents.id = job_parts.job
                        WHERE job_parts.part = jobs.id AND parents.status IN ('enqueued', 'processing'))
                    ELSE NOT EXISTS (SELECT 1 FROM job_parts WHERE job_parts.part = jobs.id) END
                 ORDER BY sequence",
            )
            .bind(EIGENBASIS_PART)
            .fetch_all(self.inner.catalog.reader())
            .await?;
            if ids.is_empty() {
                return Ok(());
            }
            for id in ids {
                let Ok(id) = Uuid::try_parse(&id) else { continue };
                self.collect_part(id).await?;
            }
        }
        Ok(())
    }

    async fn collect_part(&self, id: Uuid) -> Result<(), StoreError> {
        let _alone = self.inner.blob_use.write().await;
        let mut transaction = self.inner.catalog.write().await?;
        // Whoever takes it for a part keeps the row: from here on nobody does.
        let job = match read_job(&mut transaction, id).await {
            Ok(job) => job,
            Err(StoreError::NotFound { .. }) => return transaction.rollback().await,
            Err(error) => return Err(error),
        };
        let row = sql::query(
            "SELECT COUNT(*) AS jobs, CAST(COALESCE(SUM(CASE WHEN jobs.status IN ('enqueued', 'processing') THEN 1 ELSE 0 END), 0) AS BIGINT) AS unfinished
             FROM job_parts JOIN jobs ON jobs.id = job_parts.job WHERE job_parts.part = ?",
        )
        .bind(id.to_string())
        .fetch_one(transaction.on())
        .await?;
        let (jobs, unfinished): (i64, i64) = (row.try_get("jobs")?, row.try_get("unfinished")?);
        match job.status {
            JobStatus::Enqueued if unfinished == 0 => {
                let job = finish(&mut transaction, &job, JobStatus::Canceled, None, self.now_ms()).await?;
                transaction.commit().await?;
                self.announce(&job);
                Ok(())
            }
            JobStatus::Processing if unfinished == 0 => {
                let text = jobs::returning!(
                    "UPDATE jobs SET cancel_requested = 1, revision = revision + 1 WHERE cancel_requested = 0 AND id = ?"
                );
                let row = sql::query(text).bind(id.to_string()).fetch_optional(transaction.on()).await?;
                transaction.commit().await?;
                row.iter().try_for_each(|row| job_from_row(row).map(|job| self.announce(&job)))
            }
            status if status.is_finished() && jobs == 0 => {
                let taken = self.take_job(&mut transaction, id, true).await?;
                transaction.commit().await?;
                let Some((basis, hashes)) = taken else { return Ok(()) };
                hashes.first().into_iter().for_each(|hash| self.forget_basis(basis, hash));
                self.delete_unreferenced(&hashes).await
            }
            _ => transaction.rollback().await,
        }
    }

    /// Whether what a part made is whole, as far as that is quickly told.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn part_is_whole(&self, made: &MadePart) -> Result<bool, StoreError> {
        let _in_use = self.inner.blob_use.read().await;
        match self.look_at_blob(&made.content_hash).await {
            Ok(()) => Ok(true),
            Err(StoreError::Damaged { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Enqueues a part again whose content is damaged.
    ///
    /// # Errors
    /// As [`retry_job`](Self::retry_job).
    pub async fn redo_part(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        let store = self.clone();
        detached(async move { store.redo_job(id).await }).await
    }
}

const PARTS_OF: &str =
    "SELECT job_parts.place AS place, pieces.id AS id, pieces.status AS status, pieces.problem AS problem,
        pieces.stage_seconds AS stage_seconds, bases.content_hash AS content_hash, bases.bytes AS bytes
     FROM job_parts JOIN jobs AS pieces ON pieces.id = job_parts.part LEFT JOIN bases ON bases.id = pieces.basis
     WHERE job_parts.job = ? ORDER BY job_parts.place";

fn part_from_row(row: &Row) -> Result<PartRecord, StoreError> {
    let problem: Option<&str> = row.try_get("problem")?;
    let (content_hash, bytes): (Option<String>, Option<i64>) = (row.try_get("content_hash")?, row.try_get("bytes")?);
    let status = status_column(row)?;
    let made = content_hash.zip(bytes).filter(|_| status == JobStatus::Succeeded);
    Ok(PartRecord {
        place: row.try_get::<i64, _>("place")? as usize,
        job: uuid_column(row, "id")?,
        status,
        problem: problem.map(|text| from_json("problem", text)).transpose()?,
        stage_seconds: from_json("stage_seconds", row.try_get("stage_seconds")?)?,
        made: made.map(|(content_hash, bytes)| MadePart { content_hash, bytes: bytes as u64 }),
    })
}

/// Refuses what is to be done to a job alone, where that is a part: who needs it decides.
pub(super) fn refuse_part(job: &JobRecord) -> Result<(), StoreError> {
    if !job.is_part() {
        return Ok(());
    }
    let of = job.parent.map_or("a job that has ended".to_owned(), |parent| format!("job {parent}"));
    Err(StoreError::JobState {
        job: job.id,
        status: job.status,
        reason: format!("it is a part of {of}, and goes with it"),
    })
}

/// Forgets those parts of a job that is tried again of which nothing will become; the others are found.
pub(super) async fn forget_broken(on: &mut Transaction, job: Uuid) -> Result<(), StoreError> {
    sql::query(
        "DELETE FROM job_parts WHERE job = ? AND part IN
            (SELECT id FROM jobs WHERE status IN ('failed', 'canceled') OR cancel_requested = 1)",
    )
    .bind(job.to_string())
    .execute(on.on())
    .await?;
    Ok(())
}

fn words(done: u64, parts: u64) -> String {
    format!("{done} of {parts} parts done")
}
