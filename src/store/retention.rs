//! What is kept, and for how long: the least recently used goes first, and never what a job in the queue needs.

use std::{sync::atomic::Ordering, time::Duration};

use uuid::Uuid;

use super::{Store, StoreError, sources::SourceKind, sql};

/// Bounds on what is kept; everything is kept for ever where there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Retention {
    /// Ended jobs without a stored basis are deleted so long after their end.
    pub job_age: Option<Duration>,
    /// The most ended jobs without a stored basis.
    pub jobs: Option<u64>,
    /// Bases and fields are deleted so long after their last use; fields that were designed in a basis go with it.
    pub basis_age: Option<Duration>,
    /// The most bases.
    pub bases: Option<u64>,
    /// Meshes without bases, fields and unfinished jobs are deleted so long after their last use.
    pub mesh_age: Option<Duration>,
    /// The most meshes and problems together; those with bases, fields or unfinished jobs stay.
    pub meshes: Option<u64>,
    /// The most bytes of content: fields, bases and meshes without either go, whichever was not used for longest.
    pub bytes: Option<u64>,
}

/// What was deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Removed {
    /// Ended jobs.
    pub jobs: u64,
    /// Bases.
    pub bases: u64,
    /// Meshes.
    pub meshes: u64,
    /// Fields, but for those that went with their basis.
    pub fields: u64,
}

/// How often a running store looks.
const LOOK_MS: i64 = 60 * 1000;
/// Deletions of one look and one bound, so that writers get their turn.
const AT_ONCE: i64 = 100;
/// Looks of one turn: expired leases and other duties wait meanwhile, and the next turn goes on.
const MOST_LOOKS: usize = 4;

/// Bases that no unfinished job makes anew or needs. What parts make goes with the jobs that they are parts of.
const FREE_BASES: &str = "FROM bases WHERE bases.kind <> 'eigenbasis_part' AND NOT EXISTS
    (SELECT 1 FROM jobs WHERE jobs.id = bases.job AND jobs.status IN ('enqueued', 'processing'))
    AND NOT EXISTS (SELECT 1 FROM job_bases JOIN jobs ON jobs.id = job_bases.job
        WHERE job_bases.basis = bases.id AND jobs.status IN ('enqueued', 'processing'))";
/// Fields: nothing needs them.
const FREE_FIELDS: &str = "FROM fields WHERE 1 = 1";
/// Meshes and problems that nothing needs.
const FREE_MESHES: &str = "FROM meshes WHERE NOT EXISTS (SELECT 1 FROM bases WHERE bases.mesh = meshes.id)
    AND NOT EXISTS (SELECT 1 FROM fields WHERE fields.mesh = meshes.id)
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.mesh = meshes.id AND jobs.status IN ('enqueued', 'processing'))";
/// Ended jobs without a basis.
const FREE_JOBS: &str =
    "FROM jobs WHERE status IN ('succeeded', 'failed', 'canceled') AND jobs.kind <> 'eigenbasis_part'
    AND NOT EXISTS (SELECT 1 FROM bases WHERE bases.job = jobs.id)";

impl Store {
    /// Looks at what is kept once a minute, and from turn to turn until nothing is beyond the bounds.
    pub(super) async fn retain_in_turn(&self) -> Result<(), StoreError> {
        let now_ms = self.now_ms();
        if (now_ms - self.inner.retained_ms.load(Ordering::Relaxed)).abs() < LOOK_MS {
            return Ok(());
        }
        self.inner.retained_ms.store(now_ms, Ordering::Relaxed);
        self.write_uses().await?;
        let retention = self.inner.options.retention;
        if retention == Retention::default() {
            return Ok(());
        }
        for _ in 0..MOST_LOOKS {
            if self.retain(&retention).await? == Removed::default() {
                return Ok(());
            }
        }
        // There is more: the next turn goes on.
        self.inner.retained_ms.store(now_ms.saturating_sub(LOOK_MS), Ordering::Relaxed);
        Ok(())
    }

    /// Deletes what is beyond the bounds, up to a hundred of each kind for each bound.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn retain(&self, bounds: &Retention) -> Result<Removed, StoreError> {
        self.write_uses().await?;
        let mut removed = Removed::default();
        let before = |age: Duration| self.now_ms().saturating_sub(i64::try_from(age.as_millis()).unwrap_or(i64::MAX));
        // Fields and bases first: without them meshes and jobs are free.
        if let Some(age) = bounds.basis_age {
            let ids = self.older("id", FREE_FIELDS, "used_ms", before(age)).await?;
            self.remove_fields(&ids, &mut removed).await?;
            let ids = self.older("id", FREE_BASES, "used_ms", before(age)).await?;
            self.remove_bases(&ids, &mut removed).await?;
        }
        if let Some(most) = bounds.bases {
            let ids = self.beyond("bases", FREE_BASES, "used_ms", most).await?;
            self.remove_bases(&ids, &mut removed).await?;
        }
        if let Some(age) = bounds.mesh_age {
            let ids = self.older("id", FREE_MESHES, "used_ms", before(age)).await?;
            self.remove_meshes(&ids, &mut removed).await?;
        }
        if let Some(most) = bounds.meshes {
            let ids = self.beyond("meshes", FREE_MESHES, "used_ms", most).await?;
            self.remove_meshes(&ids, &mut removed).await?;
        }
        if let Some(most) = bounds.bytes {
            self.keep_bytes(most, &mut removed).await?;
        }
        if let Some(age) = bounds.job_age {
            let ids = self.older("id", FREE_JOBS, "finished_ms", before(age)).await?;
            self.remove_jobs(&ids, &mut removed).await?;
        }
        if let Some(most) = bounds.jobs {
            let ids = self.beyond("free", FREE_JOBS, "finished_ms", most).await?;
            self.remove_jobs(&ids, &mut removed).await?;
        }
        if removed != Removed::default() {
            tracing::info!(
                jobs = removed.jobs,
                bases = removed.bases,
                meshes = removed.meshes,
                fields = removed.fields,
                "deleted what is no longer kept"
            );
        }
        Ok(removed)
    }

    async fn older(&self, id: &str, of: &str, time: &str, before_ms: i64) -> Result<Vec<String>, StoreError> {
        let sql = format!("SELECT {id} {of} AND {time} < ? ORDER BY {time} LIMIT {AT_ONCE}");
        Ok(sql::query_scalar(sqlx::AssertSqlSafe(sql)).bind(before_ms).fetch_all(self.inner.catalog.reader()).await?)
    }

    /// The least recently used of those that may go, as many as there are more than `most`. `all` is what is counted.
    async fn beyond(&self, all: &str, of: &str, time: &str, most: u64) -> Result<Vec<String>, StoreError> {
        let count = if all == "free" { format!("SELECT COUNT(*) {of}") } else { format!("SELECT COUNT(*) FROM {all}") };
        let count: i64 = sql::query_scalar(sqlx::AssertSqlSafe(count)).fetch_one(self.inner.catalog.reader()).await?;
        let excess = count.saturating_sub(i64::try_from(most).unwrap_or(i64::MAX)).clamp(0, AT_ONCE);
        let sql = format!("SELECT id {of} ORDER BY {time} LIMIT ?");
        Ok(sql::query_scalar(sqlx::AssertSqlSafe(sql)).bind(excess).fetch_all(self.inner.catalog.reader()).await?)
    }

    async fn keep_bytes(&self, most: u64, removed: &mut Removed) -> Result<(), StoreError> {
        let mut excess = self.all_blob_bytes().await?.saturating_sub(most);
        if excess == 0 {
            return Ok(());
        }
        let sql = format!(
            "SELECT 'basis' AS kind, id, bytes, used_ms {FREE_BASES} UNION ALL SELECT 'mesh', id, bytes, used_ms {FREE_MESHES}
             UNION ALL SELECT 'field', id, bytes, used_ms {FREE_FIELDS} ORDER BY used_ms LIMIT {AT_ONCE}"
        );
        let rows = sql::query(sqlx::AssertSqlSafe(sql)).fetch_all(self.inner.catalog.reader()).await?;
        for row in rows {
            if excess == 0 {
                break;
            }
            let id: String = row.try_get("id")?;
            match row.try_get::<&str, _>("kind")? {
                "basis" => self.remove_bases(&[id], removed).await?,
                "field" => self.remove_fields(&[id], removed).await?,
                _ => self.remove_meshes(&[id], removed).await?,
            }
            excess = excess.saturating_sub(row.try_get::<i64, _>("bytes")? as u64);
        }
        Ok(())
    }

    async fn remove_bases(&self, ids: &[String], removed: &mut Removed) -> Result<(), StoreError> {
        for id in ids {
            let Ok(id) = Uuid::try_parse(id) else { continue };
            removed.bases += gone(self.delete_basis(id).await)?;
        }
        Ok(())
    }

    async fn remove_meshes(&self, ids: &[String], removed: &mut Removed) -> Result<(), StoreError> {
        for id in ids {
            // Problems are among them; one that is gone already is not told of.
            removed.meshes += gone(self.delete_source(SourceKind::Mesh, id, false).await)?;
        }
        Ok(())
    }

    async fn remove_fields(&self, ids: &[String], removed: &mut Removed) -> Result<(), StoreError> {
        for id in ids {
            removed.fields += gone(self.delete_field(id).await)?;
        }
        Ok(())
    }

    async fn remove_jobs(&self, ids: &[String], removed: &mut Removed) -> Result<(), StoreError> {
        for id in ids {
            let Ok(id) = Uuid::try_parse(id) else { continue };
            removed.jobs += gone(self.delete_job(id, false).await)?;
        }
        Ok(())
    }
}

/// Counts a deletion. What is gone or in use by now is left alone.
fn gone(deleted: Result<(), StoreError>) -> Result<u64, StoreError> {
    match deleted {
        Ok(()) => Ok(1),
        Err(
            StoreError::NotFound { .. }
            | StoreError::MeshInUse { .. }
            | StoreError::BasisInUse { .. }
            | StoreError::JobState { .. },
        ) => Ok(0),
        Err(error) => Err(error),
    }
}
