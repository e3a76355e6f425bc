//! What a job would take, before it is sent.

use axum::Json;
use axum::body::Body;
use axum::http::HeaderMap;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::client::ClientState;
use super::extract;
use super::jobs::{self, Planned};
use super::numbering::{Numbered, NumberingQuery};
use super::problem::Problem;
use super::problems::problems;
use super::state::AppState;
use super::wire::JobRequest;

/// The routes of estimates.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(estimate))
}

/// What a job would take.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"kind": "eigenbasis", "seconds": 4.2, "threads": 2, "memory_bytes": 1210056704u64, "memory_limit_bytes": 8589934592u64, "fits": true}))]
struct JobEstimate {
    /// The kind of job.
    kind: &'static str,
    /// About how many seconds of one core, right to a factor of two on a recent processor; `null` for what nobody has
    /// fitted, as pairs by a bound. Waiting in the queue comes on top, and more threads shorten it.
    seconds: Option<f64>,
    /// The threads that work on it.
    threads: usize,
    /// About how much memory it needs, in bytes: an upper estimate for surfaces, and for problems, whose factor was
    /// counted. Pairs by a bound count as `at_most`. Of an approximation in parts, what it takes to plan and join them,
    /// or what one of them takes.
    memory_bytes: u64,
    /// What this server allows for one job, in bytes.
    memory_limit_bytes: u64,
    /// Whether it is allowed so much; a job that is not is refused.
    fits: bool,
}

problems!(EstimateJobProblems: BODY JSON [INVALID_QUERY, UNKNOWN_MESH, UNKNOWN_PROBLEM, UNKNOWN_BASIS, BASIS_KIND, INCOMPARABLE_BASES, INVALID_PARAMETER]);

/// Estimates a job
///
/// Takes what `POST /v1/jobs` takes, checks it as that does, and does nothing.
#[utoipa::path(
    post, path = "/v1/job-estimates", tag = "jobs", operation_id = "estimateJob", params(NumberingQuery),
    request_body(content = JobRequest),
    responses((status = 200, description = "What it would take", body = JobEstimate), EstimateJobProblems),
    security(("bearer" = ["read"]))
)]
async fn estimate(
    state: ClientState,
    numbered: Numbered,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<JobEstimate>, Problem> {
    extract::require_json(&headers)?;
    let mut request = jobs::read(&state, &headers, body).await?;
    let Planned { parameters, estimate, limit, seconds, .. } = jobs::plan(&state, &numbered, &mut request).await?;
    Ok(Json(JobEstimate {
        kind: parameters.kind(),
        seconds,
        threads: state.config.job_threads(),
        memory_bytes: estimate,
        memory_limit_bytes: limit,
        fits: estimate <= limit,
    }))
}
