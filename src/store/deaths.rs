//! What becomes of jobs whose process died: docs/decisions/0028.
//!
//! A process that is killed, or loses power, is no fault of the job: the attempt does not count. A process that
//! crashed, as its mark tells, may well be the job's doing: such a job runs alone from then on, and when it crashes a
//! process again, it is quarantined. Where jobs have processes of their own, a death is known to be the job's, and
//! nothing has to run alone.

use std::path::PathBuf;

use uuid::Uuid;

use super::{
    FailAnswer, JobProblem, JobRecord, JobStatus, Reaped, Store, StoreError, StoreOptions,
    catalog::Transaction,
    detached,
    jobs::{self, job_from_row},
    leases::{expiry, finish, leased_row, requeue},
    sql,
};

/// A job that crashed its process so often is given up.
const MOST_DEATHS: i64 = 2;
/// A job whose process went away so often without a word is given up as well: one that takes all memory has its server
/// killed each time.
const MOST_INTERRUPTIONS: i64 = 20;
/// From so many on it runs alone, after a pause.
pub(super) const SUSPICIOUS_INTERRUPTIONS: i64 = 3;
/// Where a crash is marked.
const MARK: &str = "crashed";

impl Store {
    /// The file that a process writes the number of a fatal signal to while it crashes.
    pub fn crash_mark(&self) -> PathBuf {
        self.inner.options.folder.join(MARK)
    }

    /// Takes jobs from processes that are dead. The folder is ours alone, so whoever holds a lease is.
    pub(super) async fn recover(&self) -> Result<Vec<Reaped>, StoreError> {
        let mark = self.crash_mark();
        let signal =
            std::fs::read_to_string(&mark).ok().map(|text| text.trim().to_owned()).filter(|text| !text.is_empty());
        let now_ms = self.now_ms();
        let mut transaction = self.inner.catalog.write().await?;
        let rows = sql::query(jobs::select!("WHERE status = 'processing'")).fetch_all(transaction.on()).await?;
        let mut reaped = Vec::with_capacity(rows.len());
        for row in &rows {
            let job = job_from_row(row)?;
            let (deaths, interruptions): (i64, i64) = (row.try_get("deaths")?, row.try_get("interruptions")?);
            let counts = match signal {
                Some(_) => (deaths + 1, interruptions),
                None => (deaths, interruptions + 1),
            };
            let job = self.end_with_its_process(&mut transaction, &job, signal.as_deref(), counts, now_ms).await?;
            reaped.push(Reaped { job });
        }
        transaction.commit().await?;
        // Counted once: a death between the commit and this counts it twice, which only makes the job run alone.
        if signal.is_some()
            && let Err(error) = std::fs::write(&mark, "")
        {
            tracing::warn!(%error, "the mark of a crash could not be cleared");
        }
        reaped.iter().for_each(|reaped| self.announce(&reaped.job));
        Ok(reaped)
    }

    /// Ends an attempt whose own process died, while the server lives. It is no attempt; the job is tried again after a
    /// pause, and quarantined when that happens for the second time.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn die(&self, token: Uuid, how: &str) -> Result<FailAnswer, StoreError> {
        let (store, how) = (self.clone(), how.to_owned());
        detached(async move {
            let now_ms = store.now_ms();
            let mut transaction = store.inner.catalog.write().await?;
            let Some(row) = leased_row(&mut transaction, token).await? else {
                transaction.rollback().await?;
                return Ok(FailAnswer::Lost);
            };
            let (job, deaths) = (job_from_row(&row)?, row.try_get::<i64, _>("deaths")? + 1);
            let job = store.end_alone(&mut transaction, &job, &how, deaths, now_ms).await?;
            transaction.commit().await?;
            store.announce(&job);
            Ok(if job.status == JobStatus::Enqueued { FailAnswer::Retried } else { FailAnswer::Finished(job.status) })
        })
        .await
    }

    async fn end_alone(
        &self,
        on: &mut Transaction,
        job: &JobRecord,
        how: &str,
        deaths: i64,
        now_ms: i64,
    ) -> Result<JobRecord, StoreError> {
        if job.cancel_requested {
            return finish(on, job, JobStatus::Canceled, None, now_ms).await;
        }
        sql::query("UPDATE jobs SET deaths = ? WHERE id = ?")
            .bind(deaths)
            .bind(job.id.to_string())
            .execute(on.on())
            .await?;
        let stage = job.stage.as_deref().map_or(String::new(), |stage| format!(" at stage {stage}"));
        if deaths >= MOST_DEATHS {
            let detail = format!("the process of the job ended {deaths} times while it ran, last {how}{stage}");
            tracing::error!(job = %job.id, detail, "a job is quarantined");
            let problem = JobProblem { kind: "quarantined".to_owned(), detail };
            return finish(on, job, JobStatus::Failed, Some(&problem), now_ms).await;
        }
        let detail = format!("the process of the job ended {how}{stage}; this does not count as an attempt");
        let problem = JobProblem { kind: "worker-lost".to_owned(), detail };
        let pause = self.inner.options.retry_pause.min(StoreOptions::LONGEST_PAUSE);
        requeue(on, job, job.attempt.saturating_sub(1), Some(&problem), now_ms, expiry(now_ms, pause)).await
    }

    async fn end_with_its_process(
        &self,
        on: &mut Transaction,
        job: &JobRecord,
        signal: Option<&str>,
        (deaths, interruptions): (i64, i64),
        now_ms: i64,
    ) -> Result<JobRecord, StoreError> {
        if job.cancel_requested {
            return finish(on, job, JobStatus::Canceled, None, now_ms).await;
        }
        sql::query("UPDATE jobs SET deaths = ?, interruptions = ? WHERE id = ?")
            .bind(deaths)
            .bind(interruptions)
            .bind(job.id.to_string())
            .execute(on.on())
            .await?;
        let stage = job.stage.as_deref().map_or(String::new(), |stage| format!(" at stage {stage}"));
        if deaths >= MOST_DEATHS || interruptions >= MOST_INTERRUPTIONS {
            let detail = match signal {
                Some(signal) => {
                    format!("the server crashed {deaths} times while the job ran, last by signal {signal}{stage}")
                }
                None => format!("the server was killed {interruptions} times while the job ran, last{stage}"),
            };
            tracing::error!(job = %job.id, detail, "a job is quarantined");
            let problem = JobProblem { kind: "quarantined".to_owned(), detail };
            return finish(on, job, JobStatus::Failed, Some(&problem), now_ms).await;
        }
        let how = match signal {
            Some(signal) => format!("the server crashed by signal {signal}"),
            None => "the server was killed, or lost power,".to_owned(),
        };
        // One that may have been the cause leaves the server some time to do other things.
        let suspicious = deaths > 0 || interruptions >= SUSPICIOUS_INTERRUPTIONS;
        let doublings = deaths.max(interruptions - SUSPICIOUS_INTERRUPTIONS).clamp(0, 16) as u32;
        let pause = (self.inner.options.retry_pause * (1 << doublings)).min(StoreOptions::LONGEST_PAUSE);
        let mut detail = format!("{how} while the job ran{stage}; this does not count as an attempt");
        if suspicious {
            let (times, seconds) = (deaths.max(interruptions), pause.as_secs_f64().ceil());
            detail +=
                &format!(". After {times} such ends the job may be the cause; it is tried again in {seconds} s, alone");
        }
        let problem = JobProblem { kind: "worker-lost".to_owned(), detail };
        let not_before_ms = if suspicious { expiry(now_ms, pause) } else { now_ms };
        requeue(on, job, job.attempt.saturating_sub(1), Some(&problem), now_ms, not_before_ms).await
    }
}
