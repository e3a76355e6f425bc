//! Jobs as clients see them: enqueue, read, list, cancel, retry, delete.

use chladni_spectral::basis::EIGENBASIS_PART;
use uuid::Uuid;

use super::{
    EnqueueOutcome, Enqueued, JobFilter, JobRecord, JobStatus, NewJob, Page, PageRequest, Store, StoreError,
    catalog::Transaction,
    detached,
    fault::FailPoint,
    fields::{self, Of},
    fleet, from_json, job_bases,
    pagination::Listing,
    parts::{self, PARTS_HAVE_ENDED},
    sources::SourceKind,
    sql::{self, Row},
    to_json,
};

/// So often a request that races with equal ones of other processes is looked at anew.
pub(super) const MOST_RACES: usize = 20;
/// For so long a repeated request with the same idempotency key is answered with the job of the first.
const KEY_LIFE_MS: i64 = 7 * 24 * 3600 * 1000;

/// The columns of a job, with its parameters as they are shown: those in full may be megabytes, and lie elsewhere.
macro_rules! columns {
    () => {
        "jobs.sequence AS sequence, id, kind, mesh, priority, status, stage, progress, detail, stage_seconds, attempt, max_attempts, cancel_requested, basis, problem,
            work_key, solver_version, created_ms, enqueued_ms, not_before_ms, started_ms, finished_ms, memory_bytes, revision, deaths, interruptions, parts,
            (SELECT shown FROM job_parameters WHERE job_parameters.job = jobs.id) AS parameters,
            (SELECT string_agg(basis, ',' ORDER BY place) FROM job_bases WHERE job_bases.job = jobs.id) AS bases,
            CASE WHEN parts = 0 THEN 0 WHEN status = 'succeeded' THEN parts ELSE
                (SELECT COUNT(*) FROM job_parts JOIN jobs AS pieces ON pieces.id = job_parts.part WHERE job_parts.job = jobs.id
                    AND pieces.status = 'succeeded' AND pieces.basis IS NOT NULL) END AS parts_done,
            CASE WHEN kind = 'eigenbasis_part' THEN
                (SELECT MIN(job_parts.job) FROM job_parts WHERE job_parts.part = jobs.id) END AS parent"
    };
}

/// Selects jobs; what follows says which.
macro_rules! select {
    ($which:literal) => {
        concat!("SELECT ", $crate::store::jobs::columns!(), " FROM jobs ", $which)
    };
}

/// A statement that changes jobs and gives them as they are now.
macro_rules! returning {
    ($($change:expr),+) => {
        concat!($($change,)+ " RETURNING ", $crate::store::jobs::columns!())
    };
}

pub(super) use {columns, returning, select};

const ONE: &str = select!("WHERE id = ?");

impl Store {
    /// Enqueues a job once: the same idempotency key gives the job that it gave before, and equal work that waits, runs
    /// or is done gives that job. Where it is done and its basis is damaged, it is done anew, as the same job with the
    /// same basis. It is durable when this returns.
    ///
    /// # Errors
    /// [`StoreError::NotFound`] for an unknown mesh, problem or basis, [`StoreError::IdempotencyConflict`],
    /// [`StoreError::QueueFull`].
    pub async fn enqueue(&self, new: NewJob) -> Result<Enqueued, StoreError> {
        let store = self.clone();
        detached(async move {
            let mut enqueued = store.enqueue_now(new).await?;
            if let Some(basis) = enqueued.record.basis
                && !store.basis_is_whole(basis).await?
            {
                enqueued.record = store.redo_job(enqueued.record.id).await?;
            }
            Ok(enqueued)
        })
        .await
    }

    async fn enqueue_now(&self, new: NewJob) -> Result<Enqueued, StoreError> {
        for _ in 0..MOST_RACES {
            let now_ms = self.now_ms();
            #[cfg(feature = "cluster")]
            if let Some(record) = self.enqueue_at_once(&new, now_ms).await? {
                return Ok(self.created(record));
            }
            let mut transaction = self.inner.catalog.write().await?;
            let enqueued = match self.decide(&mut transaction, &new, now_ms).await {
                Ok(Some(enqueued)) => enqueued,
                Ok(None) => {
                    transaction.rollback().await?;
                    continue;
                }
                Err(refusal) => {
                    transaction.rollback().await?;
                    return Err(refusal);
                }
            };
            transaction.commit().await?;
            if enqueued.outcome == EnqueueOutcome::Created {
                return Ok(self.created(enqueued.record));
            }
            self.use_mesh(&new.mesh);
            self.faults().reach(FailPoint::AfterEnqueue);
            return Ok(enqueued);
        }
        Err(StoreError::Busy { detail: "an equal job keeps being deleted and re-created".to_owned() })
    }

    /// What is due once a job was made.
    fn created(&self, record: JobRecord) -> Enqueued {
        self.use_mesh(&record.mesh);
        self.faults().reach(FailPoint::AfterEnqueue);
        self.announce(&record);
        Enqueued { record, outcome: EnqueueOutcome::Created }
    }

    /// Finds or makes the job of a request, within a transaction. `None` where another process was faster with equal
    /// work or the same key: then what it made is there to be found.
    async fn decide(&self, on: &mut Transaction, new: &NewJob, now_ms: i64) -> Result<Option<Enqueued>, StoreError> {
        if let Some(key) = &new.idempotency {
            let known = sql::query("SELECT request_hash, job FROM idempotency_keys WHERE idempotency_key = ?")
                .bind(&key.key)
                .fetch_optional(on.on())
                .await?;
            if let Some(known) = known {
                let job = uuid_column(&known, "job")?;
                if known.try_get::<&str, _>("request_hash")? != key.request_hash {
                    return Err(StoreError::IdempotencyConflict { key: key.key.clone(), job });
                }
                let record = match read_job(on, job).await {
                    // It was deleted meanwhile, and its key with it.
                    Err(StoreError::NotFound { .. }) => return Ok(None),
                    read => read?,
                };
                return Ok(Some(Enqueued { record, outcome: EnqueueOutcome::Replayed }));
            }
        }
        require_source(on, &new.kind, &new.mesh).await?;
        job_bases::require(on, &new.bases).await?;
        // A job that is asked to stop will not do the work.
        // Kept, lest a key be written down for a job that is deleted meanwhile.
        let same = on.keeping(select!(
            "WHERE work_key = ?
               AND ((status IN ('enqueued', 'processing') AND cancel_requested = 0) OR (status = 'succeeded' AND basis IS NOT NULL))
             ORDER BY sequence DESC LIMIT 1"
        ));
        let same = sql::query(same).bind(&new.work_key).fetch_optional(on.on()).await?;
        let (record, outcome) = match same {
            Some(row) => {
                // Whoever is in more of a hurry moves the work that both wait for.
                let job = job_from_row(&row)?;
                let raised = sql::query(returning!(
                    "UPDATE jobs SET priority = ?1, revision = revision + 1
                     WHERE id = ?2 AND status = 'enqueued' AND priority < ?1"
                ))
                .bind(new.priority)
                .bind(job.id.to_string())
                .fetch_optional(on.on())
                .await?;
                (raised.as_ref().map(job_from_row).transpose()?.unwrap_or(job), EnqueueOutcome::SameWork)
            }
            None => match self.insert_job(on, new, now_ms).await? {
                Some(job) => (job, EnqueueOutcome::Created),
                None => return Ok(None),
            },
        };
        if let Some(key) = &new.idempotency {
            let inserted = sql::query(
                "INSERT INTO idempotency_keys (idempotency_key, request_hash, job, created_ms) VALUES (?, ?, ?, ?)
                 ON CONFLICT (idempotency_key) DO NOTHING",
            )
            .bind(&key.key)
            .bind(&key.request_hash)
            .bind(record.id.to_string())
            .bind(now_ms)
            .execute(on.on())
            .await?;
            if inserted == 0 {
                return Ok(None);
            }
        }
        Ok(Some(Enqueued { record, outcome }))
    }

    /// Makes the job of a request; `None` where equal work has come to be under way.
    async fn insert_job(
        &self,
        on: &mut Transaction,
        new: &NewJob,
        now_ms: i64,
    ) -> Result<Option<JobRecord>, StoreError> {
        if new.memory_bytes > new.most_bytes {
            return Err(StoreError::JobTooLarge { needed: new.memory_bytes, limit: new.most_bytes });
        }
        self.check_queue(on).await?;
        self.insert_row(on, new, now_ms).await
    }

    /// Makes a job that nothing speaks against.
    pub(super) async fn insert_row(
        &self,
        on: &mut Transaction,
        new: &NewJob,
        now_ms: i64,
    ) -> Result<Option<JobRecord>, StoreError> {
        let id = Uuid::now_v7();
        let inserted = sql::query(
            "INSERT INTO jobs (id, kind, mesh, priority, status, max_attempts, work_key, solver_version,
                created_ms, enqueued_ms, not_before_ms, memory_bytes)
             VALUES (?1, ?2, ?3, ?4, 'enqueued', ?5, ?6, ?7, ?8, ?8, ?8, ?9)
             ON CONFLICT (work_key) WHERE status IN ('enqueued', 'processing') AND cancel_requested = 0 DO NOTHING",
        )
        .bind(id.to_string())
        .bind(&new.kind)
        .bind(&new.mesh)
        .bind(new.priority)
        .bind(i64::from(new.max_attempts.max(1)))
        .bind(&new.work_key)
        .bind(&new.solver_version)
        .bind(now_ms)
        .bind(i64::try_from(new.memory_bytes).unwrap_or(i64::MAX))
        .execute(on.on())
        .await?;
        if inserted == 0 {
            return Ok(None);
        }
        let whole = to_json(&new.parameters)?;
        let (shown, whole) = match &new.brief {
            Some(brief) => (to_json(brief)?, Some(whole)),
            None => (whole, None),
        };
        sql::query("INSERT INTO job_parameters (job, shown, whole) VALUES (?, ?, ?)")
            .bind(id.to_string())
            .bind(shown)
            .bind(whole)
            .execute(on.on())
            .await?;
        job_bases::insert(on, id, &new.bases).await?;
        sql::query(ONE).bind(id.to_string()).fetch_one(on.on()).await.map(|row| job_from_row(&row))?.map(Some)
    }

    async fn check_queue(&self, on: &mut Transaction) -> Result<(), StoreError> {
        let Some(limit) = self.inner.options.queued_jobs_limit else { return Ok(()) };
        on.alone_among_those_who_count().await?;
        let waiting: i64 =
            sql::query_scalar("SELECT COUNT(*) FROM jobs WHERE status = 'enqueued'").fetch_one(on.on()).await?;
        if waiting as u64 >= limit { Err(StoreError::QueueFull { waiting: waiting as u64, limit }) } else { Ok(()) }
    }

    /// A job by its identifier.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        sql::query(ONE)
            .bind(id.to_string())
            .fetch_optional(self.inner.catalog.reader())
            .await?
            .map(|row| job_from_row(&row))
            .unwrap_or_else(|| Err(unknown_job(id)))
    }

    /// The parameters of a job in full.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn job_parameters(&self, id: Uuid) -> Result<serde_json::Value, StoreError> {
        let text: Option<String> = sql::query_scalar("SELECT COALESCE(whole, shown) FROM job_parameters WHERE job = ?")
            .bind(id.to_string())
            .fetch_optional(self.inner.catalog.reader())
            .await?;
        text.map_or_else(|| Err(unknown_job(id)), |text| from_json("parameters", &text))
    }

    /// A page of jobs, newest first. Parts of others are among them only where these are asked for.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn jobs(&self, filter: &JobFilter, page: &PageRequest) -> Result<Page<JobRecord>, StoreError> {
        let list = Listing::new(&self.inner.catalog, select!("WHERE sequence < "), page)?;
        let parent = filter.parent.map(|parent| parent.to_string());
        let parts = filter.parent.is_some() || filter.kind.as_deref() == Some(EIGENBASIS_PART);
        list.with("status", filter.status.map(JobStatus::as_str))
            .with("kind", filter.kind.as_deref())
            .with("mesh", filter.mesh.as_deref())
            .among("id", "SELECT part FROM job_parts WHERE job", parent.as_deref())
            .without("kind", (!parts).then_some(EIGENBASIS_PART))
            .read(job_from_row)
            .await
    }

    /// How many jobs there are of each kind in each status; combinations without jobs are left out.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn job_counts(&self) -> Result<Vec<(String, JobStatus, u64)>, StoreError> {
        let rows = sql::query("SELECT kind, status, COUNT(*) AS jobs FROM jobs GROUP BY kind, status")
            .fetch_all(self.inner.catalog.reader())
            .await?;
        rows.iter()
            .map(|row| Ok((row.try_get("kind")?, status_column(row)?, row.try_get::<i64, _>("jobs")? as u64)))
            .collect()
    }

    /// Since when the job waits that waits for longest, of those that may run, in milliseconds since 1970. One that
    /// waits for its parts may not; where workers share the records, one may that any of them takes, or every one while
    /// there are no workers at all.
    ///
    /// # Errors
    /// [`StoreError::Unavailable`] and its kin.
    pub async fn oldest_waiting_ms(&self) -> Result<Option<i64>, StoreError> {
        let text = format!(
            "SELECT MIN(CASE WHEN not_before_ms > enqueued_ms THEN not_before_ms ELSE enqueued_ms END) FROM jobs
             WHERE status = 'enqueued' AND not_before_ms <= ?1 AND {PARTS_HAVE_ENDED}{}",
            fleet::somebody_is_able(self.is_shared())
        );
        let mut since = sql::query_scalar(sqlx::AssertSqlSafe(text)).bind(self.now_ms());
        if self.is_shared() {
            since = since.bind(self.heard_since_ms());
        }
        Ok(since.fetch_one(self.inner.catalog.reader()).await?)
    }

    /// Cancels a job: an enqueued one at once, a running one at its next checkpoint. Asking twice changes nothing.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::JobState`] where it has succeeded or failed, or is a part of another.
    pub async fn cancel_job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        let store = self.clone();
        detached(async move { store.cancel_job_now(id).await }).await
    }

    async fn cancel_job_now(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        let changed = sql::query(returning!(
            "UPDATE jobs SET
                status = CASE status WHEN 'enqueued' THEN 'canceled' ELSE status END,
                finished_ms = CASE status WHEN 'enqueued' THEN ?1 ELSE finished_ms END,
                cancel_requested = CASE status WHEN 'enqueued' THEN 0 ELSE 1 END,
                revision = revision + 1
             WHERE id = ?2 AND kind <> ?3 AND (status = 'enqueued' OR (status = 'processing' AND cancel_requested = 0))"
        ))
        .bind(self.now_ms())
        .bind(id.to_string())
        .bind(EIGENBASIS_PART)
        .fetch_optional(transaction.on())
        .await?;
        transaction.commit().await?;
        if let Some(row) = changed {
            let job = job_from_row(&row)?;
            self.announce(&job);
            return Ok(job);
        }
        let job = self.job(id).await?;
        parts::refuse_part(&job)?;
        match job.status {
            JobStatus::Succeeded | JobStatus::Failed => Err(StoreError::JobState {
                job: id,
                status: job.status,
                reason: "it cannot be cancelled any more".to_owned(),
            }),
            _ => Ok(job),
        }
    }

    /// Enqueues a failed or cancelled job again, with all its attempts, or one whose basis is gone or damaged. One that
    /// waits or runs stays as it is.
    ///
    /// # Errors
    /// [`StoreError::NotFound`], for its mesh, problem or bases too; [`StoreError::JobState`] where it has succeeded,
    /// is asked to stop, or where equal work is under way as another job; [`StoreError::QueueFull`].
    pub async fn retry_job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        let store = self.clone();
        detached(async move {
            let job = store.job(id).await?;
            parts::refuse_part(&job)?;
            let redo = match job.basis {
                Some(basis) => !store.basis_is_whole(basis).await?,
                None => false,
            };
            store.retry_job_now(id, redo).await
        })
        .await
    }

    /// Enqueues a job again whose basis is damaged. The basis stays on record, and gets new content.
    pub(super) async fn redo_job(&self, id: Uuid) -> Result<JobRecord, StoreError> {
        let job = self.retry_job_now(id, true).await?;
        tracing::warn!(job = %id, "the basis of a job is damaged; recomputing it");
        Ok(job)
    }

    async fn retry_job_now(&self, id: Uuid, redo: bool) -> Result<JobRecord, StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        match self.requeue(&mut transaction, id, redo).await {
            Ok((job, changed)) => {
                transaction.commit().await?;
                if changed {
                    self.announce(&job);
                }
                Ok(job)
            }
            Err(refusal) => {
                transaction.rollback().await?;
                Err(refusal)
            }
        }
    }

    async fn requeue(&self, on: &mut Transaction, id: Uuid, redo: bool) -> Result<(JobRecord, bool), StoreError> {
        let job = read_job(on, id).await?;
        let refuse = |reason: String| Err(StoreError::JobState { job: id, status: job.status, reason });
        match job.status {
            JobStatus::Processing if job.cancel_requested => return refuse("it is being cancelled".to_owned()),
            JobStatus::Enqueued | JobStatus::Processing => return Ok((job, false)),
            JobStatus::Succeeded if job.basis.is_some() && !redo => return refuse("its result is stored".to_owned()),
            JobStatus::Succeeded | JobStatus::Failed | JobStatus::Canceled => {}
        }
        let other = sql::query(
            "SELECT id FROM jobs WHERE work_key = ? AND status IN ('enqueued', 'processing') AND cancel_requested = 0",
        )
        .bind(&job.work_key)
        .fetch_optional(on.on())
        .await?;
        if let Some(other) = other {
            let other = uuid_column(&other, "id")?;
            return refuse(format!("equal work is under way as job {other}"));
        }
        require_source(on, &job.kind, &job.mesh).await?;
        job_bases::require(on, &job.bases).await?;
        self.check_queue(on).await?;
        parts::forget_broken(on, id).await?;
        let row = sql::query(returning!(
            "UPDATE jobs SET status = 'enqueued', attempt = 0, cancel_requested = 0, problem = NULL, basis = NULL, deaths = 0,
                interruptions = 0, stage = NULL,
                progress = NULL, detail = NULL, stage_seconds = '[]', enqueued_ms = ?1, not_before_ms = ?1, started_ms = NULL,
                finished_ms = NULL, revision = revision + 1
             WHERE id = ?2"
        ))
        .bind(self.now_ms())
        .bind(id.to_string())
        .fetch_one(on.on())
        .await?;
        Ok((job_from_row(&row)?, true))
    }

    /// Deletes a job that has ended, with the idempotency keys that stand for it; with `cascade` its basis too.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::JobState`] where it waits or runs, or, without `cascade`, where its
    /// basis is stored; [`StoreError::BasisInUse`] where another job needs that basis and has not ended.
    pub async fn delete_job(&self, id: Uuid, cascade: bool) -> Result<(), StoreError> {
        let store = self.clone();
        detached(async move { store.delete_job_now(id, cascade).await }).await
    }

    async fn delete_job_now(&self, id: Uuid, cascade: bool) -> Result<(), StoreError> {
        let _alone = self.inner.blob_use.write().await;
        parts::refuse_part(&self.job(id).await?)?;
        let mut transaction = self.inner.catalog.write().await?;
        let basis = match self.take_job(&mut transaction, id, cascade).await {
            Ok(basis) => basis,
            Err(refusal) => {
                transaction.rollback().await?;
                return Err(refusal);
            }
        };
        transaction.commit().await?;
        self.parts_changed();
        let Some((basis, hashes)) = basis else { return Ok(()) };
        hashes.first().into_iter().for_each(|hash| self.forget_basis(basis, hash));
        self.delete_unreferenced(&hashes).await
    }

    /// Deletes the rows of a job, and gives the basis that went with it: its content, and that of the fields designed
    /// in it.
    pub(super) async fn take_job(
        &self,
        on: &mut Transaction,
        id: Uuid,
        cascade: bool,
    ) -> Result<Option<(Uuid, Vec<String>)>, StoreError> {
        let job = read_job(on, id).await?;
        let refuse = |reason: String| Err(StoreError::JobState { job: id, status: job.status, reason });
        if !job.status.is_finished() {
            return refuse("it has to be cancelled before it is deleted".to_owned());
        }
        let text = on.locking("SELECT id, content_hash FROM bases WHERE job = ?");
        let mut basis = sql::query(text)
            .bind(id.to_string())
            .fetch_optional(on.on())
            .await?
            .map(|row| Ok::<_, StoreError>((uuid_column(&row, "id")?, vec![row.try_get("content_hash")?])))
            .transpose()?;
        if let Some((basis, _)) = &basis
            && !cascade
        {
            return refuse(format!("its basis {basis} is stored; delete that first, or pass cascade=true"));
        }
        if let Some((basis, _)) = &basis {
            job_bases::refuse_needed(on, *basis).await?;
        }
        for sql in [
            "DELETE FROM bases WHERE job = ?",
            "DELETE FROM idempotency_keys WHERE job = ?",
            "DELETE FROM jobs WHERE id = ?",
        ] {
            sql::query(sql).bind(id.to_string()).execute(on.on()).await?;
        }
        if let Some((basis, hashes)) = &mut basis {
            hashes.extend(fields::take(on, Of::Basis, &basis.to_string()).await?);
        }
        Ok(basis)
    }

    /// Forgets idempotency keys that are older than a week.
    pub(super) async fn forget_old_keys(&self) -> Result<(), StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        sql::query("DELETE FROM idempotency_keys WHERE created_ms < ?")
            .bind(self.now_ms().saturating_sub(KEY_LIFE_MS))
            .execute(transaction.on())
            .await?;
        transaction.commit().await
    }
}

/// Refuses a job whose mesh or problem is not there; what is there stays until the transaction ends.
async fn require_source(on: &mut Transaction, kind: &str, id: &str) -> Result<(), StoreError> {
    let text = on.keeping("SELECT sequence FROM meshes WHERE id = ?");
    let found: Option<i64> = sql::query_scalar(text).bind(id).fetch_optional(on.on()).await?;
    found.map(|_| ()).ok_or_else(|| SourceKind::of_job(kind).unknown(id))
}

/// Reads a job within a transaction, in which nobody else changes it.
pub(super) async fn read_job(on: &mut Transaction, id: Uuid) -> Result<JobRecord, StoreError> {
    sql::query(on.locking(select!("WHERE id = ?")))
        .bind(id.to_string())
        .fetch_optional(on.on())
        .await?
        .map(|row| job_from_row(&row))
        .unwrap_or_else(|| Err(unknown_job(id)))
}

fn unknown_job(id: Uuid) -> StoreError {
    StoreError::NotFound { resource: "job", id: id.to_string() }
}

/// A job with its parameters as they are shown.
pub(super) fn job_from_row(row: &Row) -> Result<JobRecord, StoreError> {
    let basis: Option<&str> = row.try_get("basis")?;
    let problem: Option<&str> = row.try_get("problem")?;
    let parent: Option<&str> = row.try_get("parent")?;
    Ok(JobRecord {
        id: uuid_column(row, "id")?,
        kind: row.try_get("kind")?,
        mesh: row.try_get("mesh")?,
        bases: job_bases::of_row(row)?,
        parameters: from_json("parameters", row.try_get("parameters")?)?,
        priority: row.try_get("priority")?,
        status: status_column(row)?,
        stage: row.try_get("stage")?,
        progress: row.try_get("progress")?,
        detail: row.try_get("detail")?,
        stage_seconds: from_json("stage_seconds", row.try_get("stage_seconds")?)?,
        attempt: row.try_get::<i64, _>("attempt")? as u32,
        max_attempts: row.try_get::<i64, _>("max_attempts")? as u32,
        cancel_requested: row.try_get("cancel_requested")?,
        basis: basis.map(|text| uuid(text, "basis")).transpose()?,
        problem: problem.map(|text| from_json("problem", text)).transpose()?,
        work_key: row.try_get("work_key")?,
        solver_version: row.try_get("solver_version")?,
        created_ms: row.try_get("created_ms")?,
        enqueued_ms: row.try_get("enqueued_ms")?,
        not_before_ms: row.try_get("not_before_ms")?,
        started_ms: row.try_get("started_ms")?,
        finished_ms: row.try_get("finished_ms")?,
        memory_bytes: row.try_get::<i64, _>("memory_bytes")? as u64,
        parts: row.try_get::<i64, _>("parts")? as u32,
        parts_done: row.try_get::<i64, _>("parts_done")? as u32,
        parent: parent.map(|text| uuid(text, "parent")).transpose()?,
        revision: row.try_get("revision")?,
    })
}

/// Reads a column that holds a UUID.
pub(super) fn uuid_column(row: &Row, column: &str) -> Result<Uuid, StoreError> {
    uuid(row.try_get(column)?, column)
}

fn uuid(text: &str, column: &str) -> Result<Uuid, StoreError> {
    Uuid::try_parse(text).map_err(|error| StoreError::Corrupt { detail: format!("column {column}: {error}") })
}

pub(super) fn status_column(row: &Row) -> Result<JobStatus, StoreError> {
    row.try_get::<&str, _>("status")?
        .parse()
        .map_err(|error| StoreError::Corrupt { detail: format!("column status: {error}") })
}
