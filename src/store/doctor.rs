//! Looks at every record and every byte, says what is wrong, and does what can be done.

use std::collections::HashSet;

use sqlx::Row;

use super::{
    BasisFilter, BasisStorage, FieldFilter, JobFilter, JobStatus, PageRequest, Store, StoreError,
    blobs::{Blobs, delete_blob},
    database::Database,
    sources::SourceKind,
    sql,
};

/// What was looked at, and what was found.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Examination {
    /// Meshes that were looked at.
    pub meshes: u64,
    /// Problems that were looked at.
    pub problems: u64,
    /// Bases that were looked at.
    pub bases: u64,
    /// Fields that were looked at.
    pub fields: u64,
    /// Jobs that were looked at.
    pub jobs: u64,
    /// Pieces of content that were hashed.
    pub blobs: u64,
    /// Bytes of those.
    pub bytes: u64,
    /// What is wrong; empty where all is well.
    pub findings: Vec<Finding>,
}

/// Something that is wrong.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Finding {
    /// What, in a sentence without a period.
    pub what: String,
    /// What can be done about it.
    pub remedy: String,
    /// Whether that was done.
    pub done: bool,
}

impl Store {
    /// Examines everything. With `repair`, bases whose content is damaged are enqueued to be solved anew, references to
    /// nothing are cleared, and damaged content that nothing refers to is deleted; nothing whole is touched.
    ///
    /// # Errors
    /// Where a database cannot be read at all.
    pub async fn examine(&self, repair: bool) -> Result<Examination, StoreError> {
        let mut found = Examination::default();
        let databases = [("meta.db", self.inner.catalog.sqlite()), ("blobs.db", self.inner.blobs.sqlite())];
        for (name, database) in databases.into_iter().filter_map(|(name, database)| Some((name, database?))) {
            for line in integrity(database).await? {
                found.add(
                    format!("{name}: {line}"),
                    "restore a backup, or copy what can be read with `sqlite3 FILE .recover`",
                    false,
                );
            }
        }
        let damaged = self.examine_blobs(&mut found, repair).await?;
        self.examine_meshes(&mut found, &damaged).await?;
        self.examine_problems(&mut found, &damaged).await?;
        self.examine_bases(&mut found, &damaged, repair).await?;
        self.examine_fields(&mut found, &damaged).await?;
        self.examine_jobs(&mut found, repair).await?;
        Ok(found)
    }

    /// Hashes every blob and gives the hashes of those that are damaged.
    async fn examine_blobs(&self, found: &mut Examination, repair: bool) -> Result<HashSet<String>, StoreError> {
        let mut damaged = HashSet::new();
        for (id, hash, bytes) in self.all_blobs().await? {
            found.blobs += 1;
            found.bytes += bytes;
            let Err(error) = self.verify_blob(&hash).await else { continue };
            damaged.insert(hash.clone());
            // What is referred to is told of as the mesh or basis that it is of.
            if !self.is_referenced(&hash).await? {
                if repair && let Some(blobs) = self.inner.blobs.sqlite() {
                    let mut transaction = blobs.write().await?;
                    delete_blob(&mut transaction, id).await?;
                    transaction.commit().await?;
                }
                found.add(format!("{error}; nothing refers to it"), "it can be deleted", repair);
            }
        }
        Ok(damaged)
    }

    /// Every ready blob: its identifier, its hash and its bytes.
    async fn all_blobs(&self) -> Result<Vec<(i64, String, u64)>, StoreError> {
        let blobs = match &self.inner.blobs {
            Blobs::Chunks(blobs) => blobs,
            #[cfg(feature = "cluster")]
            Blobs::Objects(objects) => return objects.all().await,
        };
        let rows = sqlx::query("SELECT id, hash, bytes FROM blobs WHERE state = 'ready' ORDER BY id")
            .fetch_all(blobs.reader())
            .await?;
        rows.iter()
            .map(|row| Ok((row.try_get("id")?, row.try_get("hash")?, row.try_get::<i64, _>("bytes")? as u64)))
            .collect()
    }

    /// Whether the content of a record is missing or damaged.
    async fn is_dead(&self, hash: &str, damaged: &HashSet<String>) -> Result<bool, StoreError> {
        Ok(damaged.contains(hash) || matches!(self.blob_length(hash).await, Err(StoreError::NotFound { .. })))
    }

    async fn examine_meshes(&self, found: &mut Examination, damaged: &HashSet<String>) -> Result<(), StoreError> {
        let mut page = PageRequest { limit: PageRequest::MOST, from: None };
        loop {
            let meshes = self.meshes(&page).await?;
            for mesh in meshes.items {
                found.meshes += 1;
                if self.is_dead(&mesh.content_hash, damaged).await? {
                    let name = mesh.name.map_or(String::new(), |name| format!(" ({name})"));
                    let what = format!("mesh {}{name}: its content is missing or damaged", mesh.id);
                    found.add(what, "upload the same file again", false);
                } else if let Err(error) = self.load_mesh(&mesh.id).await {
                    found.add(format!("mesh {}: {error}", mesh.id), "upload the same file again", false);
                }
            }
            page.from = meshes.next;
            if page.from.is_none() {
                return Ok(());
            }
        }
    }

    async fn examine_problems(&self, found: &mut Examination, damaged: &HashSet<String>) -> Result<(), StoreError> {
        let mut page = PageRequest { limit: PageRequest::MOST, from: None };
        loop {
            let problems = self.problems_named(None, &page).await?;
            for problem in problems.items {
                found.problems += 1;
                let name = problem.name.map_or(String::new(), |name| format!(" ({name})"));
                let what = if self.is_dead(&problem.content_hash, damaged).await? {
                    "its content is missing or damaged".to_owned()
                } else if let Err(error) = self.load_problem(&problem.id).await {
                    error.to_string()
                } else {
                    continue;
                };
                let what = format!("problem {}{name}: {what}", problem.id);
                found.add(what, "upload the same matrices again", false);
            }
            page.from = problems.next;
            if page.from.is_none() {
                return Ok(());
            }
        }
    }

    async fn examine_bases(
        &self,
        found: &mut Examination,
        damaged: &HashSet<String>,
        repair: bool,
    ) -> Result<(), StoreError> {
        let mut page = PageRequest { limit: PageRequest::MOST, from: None };
        loop {
            let bases = self.bases(&BasisFilter::default(), &page).await?;
            for basis in bases.items {
                found.bases += 1;
                let mut what = None;
                if self.is_dead(&basis.content_hash, damaged).await? {
                    what = Some("its content is missing or damaged".to_owned());
                } else if let BasisStorage::Dense(layout) = &basis.storage
                    && layout.total != basis.bytes
                {
                    what = Some("its layout is not that of its content".to_owned());
                }
                if let Some(what) = what {
                    let what = format!("basis {}: {what}", basis.id);
                    match self.redo(basis.job, repair).await {
                        Ok(()) => found.add(what, "its job can be enqueued to recompute it", repair),
                        Err(refusal) => found.add(what, &format!("submit its job again ({refusal})"), false),
                    }
                }
            }
            page.from = bases.next;
            if page.from.is_none() {
                return Ok(());
            }
        }
    }

    async fn examine_fields(&self, found: &mut Examination, damaged: &HashSet<String>) -> Result<(), StoreError> {
        let mut page = PageRequest { limit: PageRequest::MOST, from: None };
        loop {
            let fields = self.fields(&FieldFilter::default(), &page).await?;
            for field in fields.items {
                found.fields += 1;
                if self.is_dead(&field.content_hash, damaged).await? {
                    let name = field.name.map_or(String::new(), |name| format!(" ({name})"));
                    let what = format!("field {}{name}: its content is missing or damaged", field.id);
                    found.add(what, "upload or design the same field again", false);
                }
            }
            page.from = fields.next;
            if page.from.is_none() {
                return Ok(());
            }
        }
    }

    async fn examine_jobs(&self, found: &mut Examination, repair: bool) -> Result<(), StoreError> {
        let mut page = PageRequest { limit: PageRequest::MOST, from: None };
        loop {
            let jobs = self.jobs(&JobFilter::default(), &page).await?;
            for job in jobs.items {
                found.jobs += 1;
                let Some(basis) = job.basis else { continue };
                if matches!(self.basis(basis).await, Err(StoreError::NotFound { .. })) {
                    if repair {
                        let mut transaction = self.inner.catalog.write().await?;
                        sql::query("UPDATE jobs SET basis = NULL, revision = revision + 1 WHERE id = ?")
                            .bind(job.id.to_string())
                            .execute(transaction.on())
                            .await?;
                        transaction.commit().await?;
                    }
                    let what = format!("job {}: its basis {basis} is not known", job.id);
                    found.add(what, "the reference can be cleared; equal work is done again on request", repair);
                }
            }
            page.from = jobs.next;
            if page.from.is_none() {
                return Ok(());
            }
        }
    }

    /// Enqueues the job of a damaged basis, or sees whether that would be possible.
    async fn redo(&self, job: uuid::Uuid, repair: bool) -> Result<(), StoreError> {
        if repair {
            return self.redo_job(job).await.map(|_| ());
        }
        let job = self.job(job).await?;
        if !self.knows_source(&job.mesh).await? {
            return Err(SourceKind::of_job(&job.kind).unknown(&job.mesh));
        }
        match job.status {
            JobStatus::Succeeded | JobStatus::Enqueued | JobStatus::Processing => Ok(()),
            status => Err(StoreError::JobState { job: job.id, status, reason: "it has to be retried".to_owned() }),
        }
    }
}

impl Examination {
    /// Whether something is wrong that was not put right.
    pub fn is_ill(&self) -> bool {
        self.findings.iter().any(|finding| !finding.done)
    }

    fn add(&mut self, what: String, remedy: &str, done: bool) {
        self.findings.push(Finding { what, remedy: remedy.to_owned(), done });
    }
}

async fn integrity(database: &Database) -> Result<Vec<String>, StoreError> {
    let lines: Vec<String> = sqlx::query_scalar("PRAGMA integrity_check(20)").fetch_all(database.reader()).await?;
    Ok(lines.into_iter().filter(|line| line != "ok").collect())
}
