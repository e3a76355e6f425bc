//! Claims: which job is next for a worker, and the statement that gives it, with a lease on it.

use std::time::Duration;

use chladni_spectral::basis::{EIGENBASIS_PART, ProductKind};
use uuid::Uuid;

use super::{
    JobRecord, Store, StoreError, StoreOptions,
    deaths::SUSPICIOUS_INTERRUPTIONS,
    fault::FailPoint,
    from_json,
    jobs::{self, job_from_row},
    leases::expiry,
    parts::PARTS_HAVE_ENDED,
    sql::QueryBuilder,
};

/// The numbers of a version such as `0.1.0+5`, which PostgreSQL compares one after the other.
const VERSION_NUMBERS: [&str; 2] = ["CAST(string_to_array(translate(", ", '+', '.'), '.') AS INTEGER[])"];

/// A job and the lease on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// The job, as it stands after the claim.
    pub job: JobRecord,
    /// What every later write of this attempt carries.
    pub token: Uuid,
    /// Whether nothing else may run beside it, since it may have crashed a process.
    pub alone: bool,
}

/// What runs while a job is claimed, and where the job will.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Company {
    /// Other jobs run.
    pub others: bool,
    /// Each job has a process of its own, and takes no other with it when it crashes.
    pub isolated: bool,
    /// The most memory that the worker has for jobs when nothing runs. Where workers share the records, a job that
    /// needs more is left to a larger one.
    pub total_bytes: u64,
    /// The version of the worker's solver. Where workers share the records, jobs of a newer one are left to others: a
    /// result is known by the version that was asked for.
    pub solver_version: Option<&'static str>,
}

impl Default for Company {
    fn default() -> Self {
        Self { others: false, isolated: false, total_bytes: u64::MAX, solver_version: None }
    }
}

impl Store {
    /// Claims the ready job of the highest priority, the oldest among equals; `None` where none is ready. Each job is
    /// claimed by one worker only. An empty `kinds` claims every kind.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn claim(&self, worker: &str, kinds: &[String], lease: Duration) -> Result<Option<Claim>, StoreError> {
        self.claim_within(worker, kinds, lease, u64::MAX, Company::default()).await
    }

    /// Claims the job that [`claim`](Self::claim) would, if it needs no more memory than `most_bytes`, and, where the
    /// worker is beside others, if it is not under suspicion of having crashed a process that they share. One that does
    /// not fit is waited for: none behind it is taken in its stead, or a stream of small jobs would keep a large one
    /// waiting for ever.
    ///
    /// # Errors
    /// [`StoreError::Busy`] and its kin.
    pub async fn claim_within(
        &self,
        worker: &str,
        kinds: &[String],
        lease: Duration,
        most_bytes: u64,
        company: Company,
    ) -> Result<Option<Claim>, StoreError> {
        let token = Uuid::now_v7();
        let query = self.claiming(worker, kinds, lease, most_bytes, company, token);
        let Some(row) = self.change_one(query.build()).await? else { return Ok(None) };
        let mut job = job_from_row(&row)?;
        if let Some(whole) = row.try_get::<Option<&str>, _>("whole")? {
            job.parameters = from_json("whole", whole)?;
        }
        let (deaths, interruptions): (i64, i64) = (row.try_get("deaths")?, row.try_get("interruptions")?);
        let alone = (deaths > 0 && !company.isolated) || interruptions >= SUSPICIOUS_INTERRUPTIONS;
        self.announce(&job);
        self.faults().reach(FailPoint::AfterClaim);
        Ok(Some(Claim { job, token, alone }))
    }

    /// The statement that claims a job.
    fn claiming(
        &self,
        worker: &str,
        kinds: &[String],
        lease: Duration,
        most_bytes: u64,
        company: Company,
        token: Uuid,
    ) -> QueryBuilder {
        let now_ms = self.now_ms();
        let shared = self.inner.catalog.is_shared();
        // Rows that another claim holds are passed over, and the one that is chosen stays locked: of a choice in a
        // plain subquery, two claims that wait for each other would both take the same row.
        let mut query = QueryBuilder::new(if shared { "WITH next AS MATERIALIZED (" } else { "" });
        if shared {
            push_next(&mut query, kinds, now_ms, Some(company));
            query.push(" FOR UPDATE SKIP LOCKED) ");
        }
        query.push(
            "UPDATE jobs SET status = 'processing', attempt = attempt + 1, stage = NULL, progress = NULL, detail = NULL,
                stage_seconds = '[]', revision = revision + 1, started_ms = ",
        );
        query.push_bind(now_ms).push(", worker = ").push_bind(worker);
        query.push(", lease_token = ").push_bind(token.to_string());
        query.push(", lease_expires_ms = ").push_bind(expiry(now_ms, lease));
        if shared {
            query.push(" FROM next WHERE jobs.sequence = next.sequence");
        } else {
            query.push(" WHERE sequence = (");
            push_next(&mut query, kinds, now_ms, None);
            query.push(")");
        }
        query.push(" AND memory_bytes <= ").push_bind(i64::try_from(most_bytes).unwrap_or(i64::MAX));
        if company.others {
            query.push(" AND interruptions < ").push_bind(SUSPICIOUS_INTERRUPTIONS);
            if !company.isolated {
                query.push(" AND deaths = 0");
            }
        }
        // Whoever does the job needs its parameters in full.
        query.push(concat!(
            " RETURNING ",
            jobs::columns!(),
            ", (SELECT whole FROM job_parameters WHERE job_parameters.job = jobs.id) AS whole"
        ));
        query
    }
}

/// The job that is next, for a worker of these kinds. One who shares the records with others is given only what it can
/// ever do, and takes over from workers whose leases ran out, as long as attempts are left; the rest of those is for
/// the reaper.
fn push_next(query: &mut QueryBuilder, kinds: &[String], now_ms: i64, shared: Option<Company>) {
    query.push("SELECT sequence FROM jobs WHERE ");
    let waits = |query: &mut QueryBuilder| {
        query.push("status = 'enqueued' AND (not_before_ms <= ").push_bind(now_ms);
        // Nothing waits longer than the longest pause: a clock that went back must not hold it.
        query.push(" OR not_before_ms > ").push_bind(expiry(now_ms, StoreOptions::LONGEST_PAUSE)).push(")");
    };
    match shared {
        None => waits(query),
        Some(Company { total_bytes, solver_version, .. }) => {
            query.push("status IN ('enqueued', 'processing') AND ((");
            waits(query);
            query.push(") OR (status = 'processing' AND cancel_requested = 0 AND attempt < max_attempts AND lease_expires_ms < ");
            query.push_bind(now_ms).push(")) AND memory_bytes <= ");
            query.push_bind(i64::try_from(total_bytes).unwrap_or(i64::MAX));
            if let Some(version) = solver_version {
                query.push(" AND (solver_version = ").push_bind(version);
                query.push(" OR CASE WHEN solver_version ~ '^[0-9]+([.+][0-9]+)*$' THEN ").push(VERSION_NUMBERS[0]);
                query.push("solver_version").push(VERSION_NUMBERS[1]).push(" <= ").push(VERSION_NUMBERS[0]);
                query.push_bind(version).push(VERSION_NUMBERS[1]).push(" ELSE FALSE END)");
            }
        }
    }
    query.push(" AND ").push(PARTS_HAVE_ENDED);
    if !kinds.is_empty() {
        query.push(" AND kind IN (");
        // Who solves eigenproblems solves their parts.
        let parts = kinds.iter().any(|kind| kind == ProductKind::Eigenbasis.name()).then_some(EIGENBASIS_PART);
        for (place, kind) in kinds.iter().map(String::as_str).chain(parts).enumerate() {
            query.push(if place == 0 { "" } else { ", " }).push_bind(kind);
        }
        query.push(")");
    }
    query.push(" ORDER BY priority DESC, sequence LIMIT 1");
}
