//! Jobs as workers see them. A claim (`claims.rs`) gives a lease; every later write carries its token, so a worker that
//! lost its lease changes nothing.

use std::{
    sync::{Mutex, PoisonError},
    time::Duration,
};

use chladni_spectral::basis::Product;
use uuid::Uuid;

use super::{
    JobEvent, JobProblem, JobRecord, JobStatus, Store, StoreError, StoreOptions,
    bases::WrittenBasis,
    catalog::Transaction,
    detached,
    fault::FailPoint,
    jobs::{self, job_from_row, uuid_column},
    sql, to_json,
};

/// How far an attempt has come.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Progress {
    /// The stage that runs.
    pub stage: Option<String>,
    /// The fraction of it that is done, in `0..=1`.
    pub fraction: Option<f64>,
    /// Where it stands within the stage, in words.
    pub detail: Option<String>,
    /// Seconds spent in each stage so far, in order.
    pub stage_seconds: Vec<(String, f64)>,
}

/// What a heartbeat learns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeartbeatAnswer {
    /// The lease holds.
    Held {
        /// Whether the job was asked to stop.
        cancel_requested: bool,
    },
    /// Someone else has the job, or nobody: the attempt is void.
    Lost,
}

/// What became of a finished attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CompleteAnswer {
    /// The basis is stored and the job succeeded.
    Stored(Uuid),
    /// The job had been asked to stop: it is cancelled, nothing is stored.
    Canceled,
    /// The lease was lost: nothing is stored.
    Lost,
}

/// What became of a failed attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailAnswer {
    /// The job is to be tried again.
    Retried,
    /// The job is finished with this status: failed or cancelled.
    Finished(JobStatus),
    /// The lease was lost: nothing has changed.
    Lost,
}

/// A job whose worker was lost.
#[derive(Debug, Clone, PartialEq)]
pub struct Reaped {
    /// The job, as it stands now: enqueued, failed or cancelled.
    pub job: JobRecord,
}

/// What an earlier try to complete a job has written, if its commit came through: the answer that says so may be lost
/// with the connection.
#[derive(Debug, Default)]
pub(super) struct Tried(Mutex<Option<(Uuid, i64)>>);

impl Tried {
    pub(super) fn note(&self, basis: Uuid, now_ms: i64) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((basis, now_ms));
    }

    /// Whether nothing was tried yet.
    #[cfg(feature = "cluster")]
    pub(super) fn is_new(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// The basis, where it is there.
    async fn found(&self, on: &mut Transaction) -> Result<Option<Uuid>, StoreError> {
        let tried = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((basis, created_ms)) = tried else { return Ok(None) };
        let found: Option<i64> = sql::query_scalar("SELECT sequence FROM bases WHERE id = ? AND created_ms = ?")
            .bind(basis.to_string())
            .bind(created_ms)
            .fetch_optional(on.on())
            .await?;
        Ok(found.map(|_| basis))
    }
}

impl Store {
    /// Runs a statement that is a whole transaction: where many share the records, it goes there and back once instead
    /// of three times.
    pub(super) async fn change_one(&self, query: sql::Query) -> Result<Option<sql::Row>, StoreError> {
        if self.is_shared() {
            return Ok(query.fetch_optional(self.inner.catalog.reader()).await?);
        }
        let mut transaction = self.inner.catalog.write().await?;
        let row = query.fetch_optional(transaction.on()).await?;
        transaction.commit().await?;
        Ok(row)
    }

    /// Prolongs a lease. With `progress`, listeners hear of it.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin; the lease may still hold then.
    pub async fn heartbeat(
        &self,
        token: Uuid,
        progress: Option<&Progress>,
        lease: Duration,
    ) -> Result<HeartbeatAnswer, StoreError> {
        let expires_ms = expiry(self.now_ms(), lease);
        let beaten = match progress {
            None => sql::query(
                "UPDATE jobs SET lease_expires_ms = ? WHERE lease_token = ? AND status = 'processing'
                 RETURNING id, revision, cancel_requested",
            )
            .bind(expires_ms),
            Some(progress) => sql::query(
                "UPDATE jobs SET lease_expires_ms = ?, stage = ?, progress = ?, detail = ?, stage_seconds = ?,
                    revision = revision + 1
                 WHERE lease_token = ? AND status = 'processing' RETURNING id, revision, cancel_requested",
            )
            .bind(expires_ms)
            .bind(&progress.stage)
            .bind(progress.fraction)
            .bind(&progress.detail)
            .bind(to_json(&progress.stage_seconds)?),
        };
        let row = self.change_one(beaten.bind(token.to_string())).await?;
        let Some(row) = row else { return Ok(HeartbeatAnswer::Lost) };
        let cancel_requested = row.try_get("cancel_requested")?;
        if progress.is_some() {
            self.announce_event(JobEvent {
                job: uuid_column(&row, "id")?,
                revision: row.try_get("revision")?,
                status: JobStatus::Processing,
                cancel_requested,
            });
        }
        Ok(HeartbeatAnswer::Held { cancel_requested })
    }

    /// Stores the product of an attempt and marks its job succeeded, in one step that readers see whole or not at all.
    ///
    /// # Errors
    /// [`StoreError::StorageFull`] and its kin: nothing is visible and the lease still holds.
    pub async fn complete(
        &self,
        token: Uuid,
        product: impl Into<Product>,
        stage_seconds: Vec<(String, f64)>,
    ) -> Result<CompleteAnswer, StoreError> {
        let (store, product) = (self.clone(), product.into());
        detached(async move { store.complete_now(token, product, stage_seconds).await }).await
    }

    async fn complete_now(
        &self,
        token: Uuid,
        product: Product,
        stage_seconds: Vec<(String, f64)>,
    ) -> Result<CompleteAnswer, StoreError> {
        self.faults().reach(FailPoint::BeforeChunks);
        // Before the lock, which may not be taken twice.
        let product = self.with_numberings(product).await?;
        let numbering = self.numbering_of(&product).await?;
        let (written, answer) = {
            let _in_use = self.inner.blob_use.read().await;
            let written = self.put_product(token, product, numbering).await?;
            // Nothing is visible where it fails. Where the records are shared, locks are held for a moment and a
            // database that restarts is back soon.
            let tried = Tried::default();
            let answer =
                self.patiently(|| Box::pin(self.make_visible(token, written.as_ref(), &stage_seconds, &tried))).await;
            (written, answer)
        };
        if let Some(written) = written
            && !matches!(answer, Ok(CompleteAnswer::Stored(_)))
        {
            let _alone = self.inner.blob_use.write().await;
            self.delete_unreferenced(std::slice::from_ref(&written.hash)).await?;
        }
        answer
    }

    /// Whether the attempt that holds a lease is still to be finished.
    pub(super) async fn is_wanted(&self, token: Uuid) -> Result<bool, StoreError> {
        let asked: Option<bool> =
            sql::query_scalar("SELECT cancel_requested FROM jobs WHERE lease_token = ? AND status = 'processing'")
                .bind(token.to_string())
                .fetch_optional(self.inner.catalog.reader())
                .await?;
        Ok(asked == Some(false))
    }

    pub(super) async fn make_visible(
        &self,
        token: Uuid,
        written: Option<&WrittenBasis>,
        stage_seconds: &[(String, f64)],
        tried: &Tried,
    ) -> Result<CompleteAnswer, StoreError> {
        #[cfg(feature = "cluster")]
        if let Some(written) = written
            && let Some((id, event)) = self.make_visible_at_once(token, written, stage_seconds, tried).await?
        {
            self.faults().reach(FailPoint::AfterComplete);
            written.remember(self, id);
            self.announce_event(event);
            return Ok(CompleteAnswer::Stored(id));
        }
        let now_ms = self.now_ms();
        let reached = self.content_generation().await?;
        let mut transaction = self.inner.catalog.write().await?;
        let Some(job) = leased_job(&mut transaction, token).await? else {
            let done = tried.found(&mut transaction).await?;
            transaction.rollback().await?;
            return Ok(match (done, written) {
                (Some(id), Some(written)) => {
                    written.remember(self, id);
                    CompleteAnswer::Stored(id)
                }
                _ => CompleteAnswer::Lost,
            });
        };
        transaction.remember(reached).await?;
        if job.cancel_requested {
            let job = finish(&mut transaction, &job, JobStatus::Canceled, None, now_ms).await?;
            transaction.commit().await?;
            self.announce(&job);
            return Ok(CompleteAnswer::Canceled);
        }
        // Without content the lease was found to be lost, and nobody gives it back.
        let Some(written) = written else {
            transaction.rollback().await?;
            return Ok(CompleteAnswer::Lost);
        };
        let id = written.insert(&mut transaction, &job, stage_seconds, now_ms).await?;
        let row = sql::query(jobs::returning!(
            "UPDATE jobs SET status = 'succeeded', basis = ?, stage = NULL, progress = 1, detail = NULL, stage_seconds = ?, problem = NULL,
                lease_token = NULL, lease_expires_ms = NULL, finished_ms = ?, revision = revision + 1
             WHERE id = ?"
        ))
        .bind(id.to_string())
        .bind(to_json(stage_seconds)?)
        .bind(now_ms)
        .bind(job.id.to_string())
        .fetch_one(transaction.on())
        .await?;
        self.faults().reach(FailPoint::BeforeComplete);
        tried.note(id, now_ms);
        transaction.commit().await?;
        self.faults().reach(FailPoint::AfterComplete);
        written.remember(self, id);
        self.announce(&job_from_row(&row)?);
        Ok(CompleteAnswer::Stored(id))
    }

    /// Ends an attempt that failed. The job is tried again after a pause where `retryable` is set and attempts are
    /// left; one that was asked to stop is cancelled.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn fail(&self, token: Uuid, problem: &JobProblem, retryable: bool) -> Result<FailAnswer, StoreError> {
        let (store, problem) = (self.clone(), problem.clone());
        detached(async move {
            let now_ms = store.now_ms();
            let mut transaction = store.inner.catalog.write().await?;
            let Some(job) = leased_job(&mut transaction, token).await? else {
                transaction.rollback().await?;
                return Ok(FailAnswer::Lost);
            };
            // Pauses grow from attempt to attempt.
            let doublings = job.attempt.saturating_sub(1).min(16);
            let pause = retryable
                .then(|| (store.inner.options.retry_pause * (1 << doublings)).min(StoreOptions::LONGEST_PAUSE));
            let job = store.end_attempt(&mut transaction, &job, &problem, pause, now_ms).await?;
            transaction.commit().await?;
            store.announce(&job);
            Ok(if job.status == JobStatus::Enqueued { FailAnswer::Retried } else { FailAnswer::Finished(job.status) })
        })
        .await
    }

    /// Ends an attempt that stopped because it was asked to. False where the lease was lost.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn finish_canceled(&self, token: Uuid) -> Result<bool, StoreError> {
        let store = self.clone();
        detached(async move {
            let mut transaction = store.inner.catalog.write().await?;
            let Some(job) = leased_job(&mut transaction, token).await? else {
                transaction.rollback().await?;
                return Ok(false);
            };
            let job = finish(&mut transaction, &job, JobStatus::Canceled, None, store.now_ms()).await?;
            transaction.commit().await?;
            store.announce(&job);
            Ok(true)
        })
        .await
    }

    /// Gives a job back to the queue unharmed, as a worker does that has to stop: the attempt does not count. One that
    /// was asked to stop is cancelled. False where the lease was lost.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn release(&self, token: Uuid) -> Result<bool, StoreError> {
        self.release_larger(token, 0).await
    }

    /// The same of a job that turned out to need so many bytes of memory, if that is more than it was promised: whoever
    /// has them takes it next.
    ///
    /// # Errors
    /// As [`release`](Self::release).
    pub async fn release_larger(&self, token: Uuid, bytes: u64) -> Result<bool, StoreError> {
        let store = self.clone();
        detached(async move {
            let now_ms = store.now_ms();
            let mut transaction = store.inner.catalog.write().await?;
            let Some(job) = leased_job(&mut transaction, token).await? else {
                transaction.rollback().await?;
                return Ok(false);
            };
            let job = if job.cancel_requested {
                finish(&mut transaction, &job, JobStatus::Canceled, None, now_ms).await?
            } else {
                let problem = job.problem.as_ref();
                if bytes > job.memory_bytes {
                    sql::query("UPDATE jobs SET memory_bytes = ? WHERE id = ?")
                        .bind(i64::try_from(bytes).unwrap_or(i64::MAX))
                        .bind(job.id.to_string())
                        .execute(transaction.on())
                        .await?;
                }
                requeue(&mut transaction, &job, job.attempt.saturating_sub(1), problem, now_ms, now_ms).await?
            };
            transaction.commit().await?;
            store.announce(&job);
            Ok(true)
        })
        .await
    }

    /// Takes jobs from workers whose leases ran out: they are enqueued again after a pause, or failed as `worker-lost`
    /// after their last attempt. Tends the rest of the house too: what is due now and then.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn reap(&self) -> Result<Vec<Reaped>, StoreError> {
        let reaped = self.reap_leases(self.now_ms()).await?;
        // What was reaped is to be heard of, whatever becomes of the rest.
        if let Err(error) = self.maintain().await {
            tracing::warn!(%error, "periodic maintenance failed");
        }
        Ok(reaped)
    }

    /// Reaps leases that ran out before `until_ms`.
    pub(super) async fn reap_leases(&self, until_ms: i64) -> Result<Vec<Reaped>, StoreError> {
        let now_ms = self.now_ms();
        let mut transaction = self.inner.catalog.write().await?;
        let expired = transaction.locking_free(jobs::select!("WHERE status = 'processing' AND lease_expires_ms < ?"));
        let rows = sql::query(expired).bind(until_ms).fetch_all(transaction.on()).await?;
        let mut reaped = Vec::with_capacity(rows.len());
        for row in &rows {
            let job = job_from_row(row)?;
            let stage = job.stage.as_deref().map_or(String::new(), |stage| format!(" at stage {stage}"));
            let problem = JobProblem {
                kind: "worker-lost".to_owned(),
                detail: format!("the worker of attempt {} of {} was lost{stage}", job.attempt, job.max_attempts),
            };
            // Its lease was pause enough: where records are shared, a claim takes such a job without any.
            let pause = self.inner.options.retry_pause.min(StoreOptions::LONGEST_PAUSE);
            let job = self.end_attempt(&mut transaction, &job, &problem, Some(pause), now_ms).await?;
            reaped.push(Reaped { job });
        }
        transaction.commit().await?;
        reaped.iter().for_each(|reaped| self.announce(&reaped.job));
        Ok(reaped)
    }

    /// Cancels, enqueues again or fails a job whose attempt came to nothing. Without a pause nothing is tried again.
    async fn end_attempt(
        &self,
        on: &mut Transaction,
        job: &JobRecord,
        problem: &JobProblem,
        pause: Option<Duration>,
        now_ms: i64,
    ) -> Result<JobRecord, StoreError> {
        if job.cancel_requested {
            return finish(on, job, JobStatus::Canceled, None, now_ms).await;
        }
        if let Some(pause) = pause.filter(|_| job.attempt < job.max_attempts) {
            return requeue(on, job, job.attempt, Some(problem), now_ms, expiry(now_ms, pause)).await;
        }
        finish(on, job, JobStatus::Failed, Some(problem), now_ms).await
    }
}

pub(super) fn expiry(now_ms: i64, lease: Duration) -> i64 {
    now_ms.saturating_add(i64::try_from(lease.as_millis()).unwrap_or(i64::MAX))
}

pub(super) async fn leased_job(on: &mut Transaction, token: Uuid) -> Result<Option<JobRecord>, StoreError> {
    leased_row(on, token).await?.map(|row| job_from_row(&row)).transpose()
}

/// The row of the job that a lease is on, in which nobody else changes it.
pub(super) async fn leased_row(on: &mut Transaction, token: Uuid) -> Result<Option<sql::Row>, StoreError> {
    let held = on.locking(jobs::select!("WHERE lease_token = ? AND status = 'processing'"));
    Ok(sql::query(held).bind(token.to_string()).fetch_optional(on.on()).await?)
}

pub(super) async fn requeue(
    on: &mut Transaction,
    job: &JobRecord,
    attempt: u32,
    problem: Option<&JobProblem>,
    now_ms: i64,
    not_before_ms: i64,
) -> Result<JobRecord, StoreError> {
    let row = sql::query(jobs::returning!(
        "UPDATE jobs SET status = 'enqueued', attempt = ?, problem = ?, stage = NULL, progress = NULL, detail = NULL,
            enqueued_ms = ?, not_before_ms = ?, lease_token = NULL, lease_expires_ms = NULL, revision = revision + 1
         WHERE id = ?"
    ))
    .bind(i64::from(attempt))
    .bind(problem.map(to_json).transpose()?)
    .bind(now_ms)
    .bind(not_before_ms)
    .bind(job.id.to_string())
    .fetch_one(on.on())
    .await?;
    job_from_row(&row)
}

pub(super) async fn finish(
    on: &mut Transaction,
    job: &JobRecord,
    status: JobStatus,
    problem: Option<&JobProblem>,
    now_ms: i64,
) -> Result<JobRecord, StoreError> {
    let row = sql::query(jobs::returning!(
        "UPDATE jobs SET status = ?, problem = ?, cancel_requested = 0, lease_token = NULL, lease_expires_ms = NULL,
            finished_ms = ?, revision = revision + 1
         WHERE id = ?"
    ))
    .bind(status.as_str())
    .bind(problem.map(to_json).transpose()?)
    .bind(now_ms)
    .bind(job.id.to_string())
    .fetch_one(on.on())
    .await?;
    job_from_row(&row)
}
