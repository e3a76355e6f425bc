//! Health, readiness and metrics.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::counted::catch_up;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use crate::store::{JobStatus, StoreHealth};

/// The routes for operators and their machines.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz)).routes(routes!(metrics))
}

/// Whether the process answers.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"status": "ok", "version": "0.1.0"}))]
struct Health {
    /// `ok`.
    status: &'static str,
    /// The version of the server.
    version: &'static str,
}

/// Tells that the process answers
///
/// For restarts: it stays 200 while the server drains or its disk is full. See `/readyz` for that.
#[utoipa::path(
    get, path = "/healthz", tag = "system", operation_id = "health",
    responses((status = 200, description = "The process answers", body = Health)), security(())
)]
async fn healthz() -> Json<Health> {
    Json(Health { status: "ok", version: env!("CARGO_PKG_VERSION") })
}

/// Whether the server takes work.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"status": "ready", "database": "postgresql", "content": "s3", "free_bytes": null, "blob_bytes": 73400320, "wal_bytes": 0, "queue_age_seconds": 3, "workers": [{"memory_bytes": 68719476736u64, "kinds": [], "solver_version": "0.1.0+5", "processes": 3, "seats": 12}]}))]
struct Readiness {
    /// `ready`.
    status: &'static str,
    /// What keeps the records: `sqlite`, or `postgresql` where processes share them.
    database: &'static str,
    /// What keeps the content: `sqlite`, or `s3` or `files` where processes share it.
    content: &'static str,
    /// Free bytes on the disk of the data folder, where the system tells.
    free_bytes: Option<u64>,
    /// Bytes of all stored content.
    blob_bytes: u64,
    /// Bytes of the write-ahead logs.
    wal_bytes: u64,
    /// Seconds for which the job has waited that waits for longest and could run; 0 where none waits.
    queue_age_seconds: u64,
    /// The workers that were heard of within a minute, by what they have; empty where this process shares its jobs with
    /// none.
    workers: Vec<WorkerClass>,
}

/// Workers that have the same.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
pub(super) struct WorkerClass {
    /// Bytes of memory that the jobs of one of them may need together.
    pub(super) memory_bytes: u64,
    /// The kinds of job that they take; all where it is empty.
    pub(super) kinds: Vec<String>,
    /// The version of their solver.
    pub(super) solver_version: String,
    /// How many they are.
    pub(super) processes: u64,
    /// Jobs that they run at once, all together.
    pub(super) seats: u64,
}

/// Living workers by what they have; none where they cannot be asked for. Memory in whole GiB: what a worker finds free
/// when it starts is the same to the byte for no two, and a metric of a label for each process is of no use.
fn memory_class(bytes: u64) -> u64 {
    const GIB: u64 = 1 << 30;
    if bytes < GIB { bytes } else { bytes / GIB * GIB }
}

async fn worker_classes(state: &AppState) -> Vec<WorkerClass> {
    let workers = state.store.workers().await.unwrap_or_else(|error| {
        tracing::warn!(%error, "the workers cannot be counted");
        Vec::new()
    });
    let mut classes: Vec<WorkerClass> = Vec::new();
    for worker in workers {
        let memory_bytes = memory_class(worker.memory_bytes);
        let known = classes.iter_mut().find(|class| {
            (class.memory_bytes, &class.kinds, &class.solver_version)
                == (memory_bytes, &worker.kinds, &worker.solver_version)
        });
        match known {
            Some(class) => {
                class.processes += 1;
                class.seats += worker.seats;
            }
            None => classes.push(WorkerClass {
                memory_bytes,
                kinds: worker.kinds,
                solver_version: worker.solver_version,
                processes: 1,
                seats: worker.seats,
            }),
        }
    }
    classes.sort_unstable();
    classes
}

/// Seconds for which the oldest job has waited that could run.
async fn queue_age_seconds(state: &AppState) -> Option<u64> {
    match state.store.oldest_waiting_ms().await {
        Ok(since_ms) => {
            let age_ms = since_ms.map_or(0, |since_ms| state.store.now_ms() - since_ms);
            Some(u64::try_from(age_ms / 1000).unwrap_or(0))
        }
        Err(error) => {
            tracing::warn!(%error, "the age of the queue could not be read");
            None
        }
    }
}

problems!(ReadyProblems: [NOT_READY]);

/// Tells whether the server takes work
///
/// Where it does not, the problem's `reasons` tell a full disk (`storage-full`), databases that were removed or
/// replaced (`storage-replaced`), a store that cannot be written for another cause (`storage-unavailable`: a database
/// that does not answer, where one is shared), an object store that does not answer (`content-unavailable`), dead
/// workers (`workers-dead`) and a server that shuts down (`draining`) apart.
#[utoipa::path(
    get, path = "/readyz", tag = "system", operation_id = "ready",
    responses(
        (status = 200, description = "The server takes work", body = Readiness),
        ReadyProblems,
    ),
    security(())
)]
async fn readyz(State(state): State<AppState>) -> Result<Json<Readiness>, Problem> {
    let health = state.store_health().await;
    let reasons = refusals(&state, &health);
    if !reasons.is_empty() {
        let mut refused = Problem::new(&problem::NOT_READY, format!("Not ready: {}.", reasons.join(", ")))
            .with("reasons", reasons)
            .with("database", health.database)
            .with("content", health.content)
            .with("blob_bytes", health.blob_bytes)
            .retry_after(5);
        if let Some(free) = health.free_bytes {
            refused = refused.with("free_bytes", free).with("least_free_bytes", health.least_free_bytes);
        }
        return Err(refused);
    }
    Ok(Json(Readiness {
        status: "ready",
        database: health.database,
        content: health.content,
        queue_age_seconds: queue_age_seconds(&state).await.unwrap_or(0),
        workers: worker_classes(&state).await,
        free_bytes: health.free_bytes,
        blob_bytes: health.blob_bytes,
        wal_bytes: health.wal_bytes,
    }))
}

/// Why the server does not take work; nothing where it does.
fn refusals(state: &AppState, health: &StoreHealth) -> Vec<&'static str> {
    let mut reasons = Vec::new();
    if health.moved {
        reasons.push("storage-replaced");
    } else if health.full {
        reasons.push("storage-full");
    } else if !health.writable {
        tracing::warn!(reason = health.reason, "the store cannot be written");
        reasons.push("storage-unavailable");
    }
    if !health.content_up {
        tracing::warn!(reason = health.reason, "the object store does not answer");
        reasons.push("content-unavailable");
    }
    if !state.workers_alive() {
        reasons.push("workers-dead");
    }
    if state.is_draining() {
        reasons.push("draining");
    }
    reasons
}

/// Gives the metrics
///
/// In the Prometheus text format, in base units, with the prefix `chladni_`.
#[utoipa::path(
    get, path = "/metrics", tag = "system", operation_id = "metrics",
    responses((status = 200, description = "The metrics", body = String, content_type = "text/plain; version=0.0.4",
        example = "# TYPE chladni_http_requests_total counter\nchladni_http_requests_total{method=\"GET\",route=\"/v1/jobs\",status=\"200\"} 3\n")),
    security(("bearer" = ["operate"]))
)]
async fn metrics(State(state): State<AppState>) -> Result<Response, Problem> {
    let metrics = &state.metrics;
    // The health of the store comes first: where the database does not answer, nothing else is asked of it, and the
    // scrape is back in time to say so.
    let health = state.store_health().await;
    let counts = if health.database_up { Some(state.store.job_counts().await) } else { None };
    match counts {
        None => {}
        Some(Ok(counts)) => {
            let mut kinds: Vec<&str> = chladni_work::KINDS.to_vec();
            kinds.extend(counts.iter().map(|(kind, ..)| kind.as_str()));
            for kind in kinds {
                for status in JobStatus::ALL {
                    let count = counts.iter().find(|(k, s, _)| k == kind && *s == status).map_or(0, |(.., n)| *n);
                    metrics.jobs.with_label_values(&[kind, status.as_str()]).set(count as i64);
                }
            }
        }
        // The other metrics matter most when the store is in trouble.
        Some(Err(error)) => tracing::warn!(%error, "jobs cannot be counted"),
    }
    metrics.blob_bytes.set(health.blob_bytes as i64);
    // Of a database elsewhere nothing is known of files and disks.
    let own = !state.store.is_shared();
    metrics.wal_bytes.set(own.then_some(health.wal_bytes));
    for (database, bytes) in health.database_bytes.into_iter().filter(|_| own) {
        metrics.database_bytes.with_label_values(&[database]).set(bytes as i64);
    }
    metrics.free_bytes.set(health.free_bytes);
    metrics.least_free_bytes.set(health.free_bytes.map(|_| health.least_free_bytes));
    metrics.ready.set(i64::from(refusals(&state, &health).is_empty()));
    metrics.queue_age_seconds.set(if health.database_up { queue_age_seconds(&state).await } else { None });
    metrics.store_info.reset();
    metrics.store_info.with_label_values(&[health.database, health.content]).set(1);
    metrics.database_up.set(i64::from(health.database_up));
    metrics.content_up.set(i64::from(health.content_up));
    // Classes go as their last worker does. They are read before the old ones are dropped, so that no other scrape
    // finds none.
    let classes = if health.database_up { worker_classes(&state).await } else { Vec::new() };
    metrics.workers.reset();
    metrics.worker_seats.reset();
    for class in classes {
        let memory = class.memory_bytes.to_string();
        let kinds = if class.kinds.is_empty() { "all".to_owned() } else { class.kinds.join("+") };
        let labels = [memory.as_str(), kinds.as_str(), class.solver_version.as_str()];
        metrics.workers.with_label_values(&labels).set(class.processes as i64);
        metrics.worker_seats.with_label_values(&labels).set(class.seats as i64);
    }
    metrics.solves_held.set(state.solve_places.held() as i64);
    metrics.request_bytes.set(state.request_memory.held() as i64);
    let cache = state.store.cache_statistics();
    metrics.basis_cache_bytes.set(cache.bytes as i64);
    catch_up(&state.counted.hits, cache.hits, |n| metrics.basis_cache_hits.inc_by(n));
    catch_up(&state.counted.misses, cache.misses, |n| metrics.basis_cache_misses.inc_by(n));
    let accelerator = chladni_algebra::gpu::accelerator();
    metrics.gpu_available.set(i64::from(accelerator.available()));
    catch_up(&state.counted.gpu_fallbacks, accelerator.fallbacks(), |n| metrics.gpu_fallbacks.inc_by(n));
    let text = metrics.render();
    Ok(([(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; version=0.0.4; charset=utf-8"))], text)
        .into_response())
}
