//! Jobs: submitted, listed, watched, cancelled, retried and deleted.

use std::time::{Duration, Instant};

use axum::Json;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use chladni_spectral::basis::{EIGENBASIS_PART, MAP_COLLECTION, ProductKind};
use chladni_work::numbered::translate_parameters;
use chladni_work::packed::Packed;
use chladni_work::{JobParameters, MeshSize, ProblemSize, SOLVER_VERSION};
use headers::HeaderMapExt;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::client::ClientState;
use super::events::{self, look};
use super::extract::{self, QueryOf};
use super::ids::JobId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use super::wire::{JobRequest, JobResource, PageOf, Status};
use super::{body, conditional, exchange, shapes};
use crate::store::{EnqueueOutcome, IdempotencyKey, JobFilter, JobRecord, JobStatus, NewJob, Store, StoreError};

/// The largest body of a job: a potential comes with it.
const JSON_BYTES: u64 = 16 << 20;

/// The memory that a number of such a body takes: as packed JSON, as a parameter, and as what is stored.
const BYTES_PER_NUMBER: u64 = 128;

/// The longest a long poll waits.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// How the job of an answer came about: `created`, `same-work` or `replayed`.
const OUTCOME: HeaderName = HeaderName::from_static("chladni-outcome");

/// The routes of jobs.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(submit, list))
        .routes(routes!(show, delete))
        .merge(events::routes())
        .routes(routes!(cancel))
        .routes(routes!(retry))
}

problems!(SubmitJobProblems: BODY JSON WRITE [INVALID_QUERY, INVALID_HEADER, UNKNOWN_MESH, UNKNOWN_PROBLEM, UNKNOWN_BASIS, BASIS_KIND, INCOMPARABLE_BASES, INVALID_PARAMETER, JOB_TOO_LARGE, IDEMPOTENCY_CONFLICT, QUEUE_FULL, DRAINING]);

/// Whether to wait for what was submitted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct SubmitQuery {
    /// Answer only when the job has ended, or after this time (`20s`, `1500ms`; at most a minute).
    #[param(example = "20s")]
    wait: Option<String>,
}

/// Submits a job
///
/// Vertices and faces that parameters name, and functions among them, are those of the uploaded file, unless
/// `numbering=kept`; the job shows them as the mesh numbers them.
///
/// The same mesh, kind and parameters are worked on once: where an equal job waits, runs or is done, that job is the
/// answer. With an `Idempotency-Key` a request that is sent twice makes one job, whatever happened to the first answer.
/// With `wait` the answer comes when the job has ended or the time is over, whichever is first, as from
/// `GET /v1/jobs/{id}`.
#[utoipa::path(
    post, path = "/v1/jobs", tag = "jobs", operation_id = "submitJob",
    params(NumberingQuery, SubmitQuery, ("Idempotency-Key" = Option<String>, Header, description = "1 to 200 visible ASCII characters that stand for this request", example = "8f14e45f")),
    request_body(content = JobRequest, examples(
        ("approximate" = (summary = "500 pairs, fast", value = json!({"kind": "eigenbasis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"count": 500}}))),
        ("hsim" = (summary = "250 pairs to 1e-6, proven complete, as columns in double precision", value = json!({"kind": "eigenbasis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"method": "hsim", "count": 250, "tolerance": 1e-6, "precision": "f64"}}))),
        ("below" = (summary = "All pairs below an eigenvalue, at most 400, stored compactly", value = json!({"kind": "eigenbasis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"method": "hsim", "below": 900.0, "at_most": 400, "storage": "compact"}}))),
        ("fields" = (summary = "A space of 4-fields of 2,000 dimensions", value = json!({"kind": "field_basis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"field": "n_vector", "n": 4, "dimension": 2000}}))),
        ("vibration" = (summary = "60 vibration modes of a steel shell of a millimetre, in metres", value = json!({"kind": "vibration_basis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"count": 60, "thickness": 0.001}}))),
        ("family" = (summary = "A family of operators", value = json!({"kind": "operator_family", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"dimension": 780}}))),
        ("maps" = (summary = "Maps between all of three shapes", value = json!({"kind": "map_collection", "bases": ["019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33", "019aa5d1-4e7f-7b60-8c15-2d90b7f4a6c8"], "parameters": {"pairs": 60}}))),
        ("pencil" = (summary = "The 20 pairs of a problem nearest to 1.5, with three rows at zero", value = json!({"kind": "pencil_basis", "pencil": "7be0a1d25c9f4e3388d1c6f2904ab57e", "parameters": {"count": 20, "around": 1.5, "fixed": [0, 1, 2]}}))),
        ("operator" = (summary = "A Hamiltonian with functions that vanish on the boundary", value = json!({"kind": "eigenbasis", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", "parameters": {"count": 100, "operator": {"hamiltonian": {"potential": {"curvature": {"t": 0.1}}}}, "boundary": "dirichlet"}}))),
    )),
    responses(
        (status = 202, description = "The job is stored; `Location` names it and `Retry-After` says when to look", body = JobResource,
            headers(("Location" = String), ("Retry-After" = u64), ("Chladni-Outcome" = String, description = "created, same-work or replayed"))),
        (status = 200, description = "Equal work was already done, or the job ended during the wait: the job, with its basis or the reason why there is none", body = JobResource, headers(("Location" = String))),
        SubmitJobProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn submit(
    state: ClientState,
    numbered: Numbered,
    QueryOf(query): QueryOf<SubmitQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Problem> {
    if state.is_draining() {
        return Err(Problem::new(&problem::DRAINING, "The server is shutting down and takes no jobs.").retry_after(10));
    }
    extract::require_json(&headers)?;
    let key = idempotency_key(&headers)?;
    let wait = time_to_wait(query.wait.as_deref())?;
    // Taken before anything is stored, so that whoever is refused a place has no job either.
    let _place = if wait.is_zero() { None } else { Some(state.watch()?) };
    let mut request = read(&state, &headers, body).await?;
    let planned = plan(&state, &numbered, &mut request).await?;
    let on = planned.on();
    let Planned { source, bases, parameters, estimate, limit, .. } = planned;
    let canonical = parameters.canonical();
    let brief = chladni_work::abbreviated(&canonical);
    let idempotency = key.map(|key| IdempotencyKey {
        key: format!("{}:{key}", state.principal),
        request_hash: chladni_work::hash_of(&(&request.kind, &on, &canonical, request.priority)),
    });
    let enqueued = state
        .store
        .enqueue(NewJob {
            kind: parameters.kind().to_owned(),
            work_key: parameters.work_key_of(&on, &canonical),
            mesh: source,
            bases,
            brief: (brief != canonical).then_some(brief),
            parameters: canonical,
            priority: request.priority,
            idempotency,
            max_attempts: state.config.max_attempts,
            solver_version: SOLVER_VERSION.to_owned(),
            memory_bytes: estimate,
            most_bytes: limit,
        })
        .await?;
    let (mut record, outcome) = (enqueued.record, enqueued.outcome);
    tracing::info!(job = %record.id, mesh = record.mesh, kind = record.kind, outcome = outcome_name(outcome), "job submitted");
    if !wait.is_zero() && !record.status.is_finished() {
        record = awaited(&state, record.id, wait, |record| record.status.is_finished()).await?;
        say_why_they_wait(&state.store, std::slice::from_mut(&mut record)).await?;
    }
    let ended = !wait.is_zero() && record.status.is_finished();
    let done = ended || record.status == JobStatus::Succeeded;
    let mut response = resource(record, if done { StatusCode::OK } else { StatusCode::ACCEPTED })?;
    response.headers_mut().insert(OUTCOME, HeaderValue::from_static(outcome_name(outcome)));
    Ok(response)
}

/// Reads the body that asks for a job.
pub(super) async fn read(state: &ClientState, headers: &HeaderMap, body: Body) -> Result<JobRequest, Problem> {
    let body = body::read(state, headers, body, JSON_BYTES).await?;
    exchange::parse(state, body, BYTES_PER_NUMBER).await
}

/// A job as it would be enqueued.
pub(super) struct Planned {
    /// The mesh or the problem that it is on.
    pub source: String,
    /// The bases that it is on, where these are several.
    pub bases: Vec<Uuid>,
    pub parameters: JobParameters,
    /// Of the memory that it needs, in bytes.
    pub estimate: u64,
    /// What the server allows for one job, in bytes.
    pub limit: u64,
    /// Seconds of one core, where they can be told.
    pub seconds: Option<f64>,
}

impl Planned {
    /// All that it is on, as one text: what tells equal work.
    fn on(&self) -> String {
        match self.bases.is_empty() {
            true => self.source.clone(),
            false => self.bases.iter().map(Uuid::to_string).collect::<Vec<_>>().join(","),
        }
    }
}

/// Bytes of memory that one job of a kind may need: what the server allows, and no more than the largest worker has
/// that takes such jobs.
pub(super) async fn most_bytes(state: &ClientState, kind: &str, needed: u64) -> Result<u64, Problem> {
    let allowed = state.config.limits.max_job_bytes;
    Ok(state.store.most_memory_for(kind, needed).await?.map_or(allowed, |most| most.min(allowed)))
}

/// Reads what a request asks for, and checks it against its mesh. Its parameters are taken out of it.
pub(super) async fn plan(
    state: &ClientState,
    numbered: &Numbered,
    request: &mut JobRequest,
) -> Result<Planned, Problem> {
    if !(-100..=100).contains(&request.priority) {
        return Err(Problem::new(
            &problem::INVALID_REQUEST,
            format!("priority: must be between -100 and 100, not {}.", request.priority),
        ));
    }
    if request.kind == MAP_COLLECTION {
        return shapes::plan(state, request).await;
    }
    if request.bases.is_some() {
        let detail = format!("bases: belongs to jobs of the kind \"{MAP_COLLECTION}\".");
        return Err(Problem::new(&problem::INVALID_REQUEST, detail));
    }
    if request.kind == ProductKind::PencilBasis.name() {
        return plan_on_problem(state, request).await;
    }
    let given = mesh_of(state, request)?;
    let found = state.store.mesh(&given).await;
    if found.is_err() {
        // What can be told without a mesh is told first.
        parameters_of(state, request)?;
    }
    let mesh = found.map_err(|error| match error {
        StoreError::NotFound { .. } => Problem::new(
            &problem::UNKNOWN_MESH,
            format!("mesh: no mesh has the id {:?}.", problem::shorten(given.clone())),
        ),
        other => other.into(),
    })?;
    let (solid_vertices, tetrahedra) = mesh.solid_size();
    let size = MeshSize {
        vertices: mesh.vertices as usize,
        faces: mesh.faces as usize,
        solid_vertices: solid_vertices as usize,
        tetrahedra: tetrahedra as usize,
    };
    let to = numbered.on_mesh(state, &mesh.id).await?.turning(mesh.turned_faces());
    translate_parameters(&mut request.parameters, &to, size)?;
    let parameters = parameters_of(state, request)?;
    request.parameters = Packed::Null;
    parameters.check_mesh(size)?;
    let whole = parameters.memory_bytes(size);
    let limit = most_bytes(state, &request.kind, whole).await?;
    Ok(Planned {
        // What leaves it to the server whether it is divided has to be where there is no room for one piece.
        estimate: if whole > limit { parameters.memory_bytes_in_parts(size) } else { whole },
        limit,
        seconds: parameters.seconds(size),
        source: mesh.id,
        bases: Vec::new(),
        parameters,
    })
}

/// What a request asks for.
fn parameters_of(state: &ClientState, request: &JobRequest) -> Result<JobParameters, Problem> {
    let read = if state.config.idle_jobs { JobParameters::read_any } else { JobParameters::read };
    Ok(read(&request.kind, &request.parameters)?)
}

/// The mesh that a request names.
fn mesh_of(state: &ClientState, request: &JobRequest) -> Result<String, Problem> {
    let refused = |reason: &str| Err(Problem::new(&problem::INVALID_REQUEST, reason));
    if !chladni_work::KINDS.contains(&request.kind.as_str()) {
        parameters_of(state, request)?;
    }
    match (&request.mesh, &request.pencil) {
        (_, Some(_)) => refused("pencil: belongs to jobs of the kind \"pencil_basis\"."),
        (None, None) => refused("mesh: the id of a mesh is missing."),
        (Some(mesh), None) => Ok(mesh.clone()),
    }
}

/// The same for a job on the matrices of a problem.
async fn plan_on_problem(state: &ClientState, request: &mut JobRequest) -> Result<Planned, Problem> {
    let refused = |reason: &str| Err(Problem::new(&problem::INVALID_REQUEST, reason));
    let JobParameters::PencilBasis(parameters) = JobParameters::read(&request.kind, &request.parameters)? else {
        return Err(Problem::internal("parameters of another kind were read"));
    };
    request.parameters = Packed::Null;
    let given = match (&request.pencil, &request.mesh) {
        (_, Some(_)) => {
            return refused("mesh: a job of the kind \"pencil_basis\" works on a problem, named by `pencil`.");
        }
        (None, None) => return refused("pencil: the id of a problem is missing."),
        (Some(given), None) => given.clone(),
    };
    let problem = state.store.problem(&given).await.map_err(|error| match error {
        StoreError::NotFound { .. } => Problem::new(
            &problem::UNKNOWN_PROBLEM,
            format!("pencil: no problem has the id {:?}.", problem::shorten(given)),
        ),
        other => other.into(),
    })?;
    let size = ProblemSize::of_report(problem.rows as usize, &problem.report);
    parameters.check_problem(size)?;
    let estimate = parameters.problem_memory_bytes(size);
    Ok(Planned {
        estimate,
        limit: most_bytes(state, &request.kind, estimate).await?,
        seconds: None,
        source: problem.id,
        bases: Vec::new(),
        parameters: JobParameters::PencilBasis(parameters),
    })
}

fn outcome_name(outcome: EnqueueOutcome) -> &'static str {
    match outcome {
        EnqueueOutcome::Created => "created",
        EnqueueOutcome::SameWork => "same-work",
        EnqueueOutcome::Replayed => "replayed",
    }
}

fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    let fits = |key: &&str| (1..=200).contains(&key.len()) && key.bytes().all(|b| b.is_ascii_graphic() || b == b' ');
    value.to_str().ok().map(str::trim).filter(fits).map(|key| Some(key.to_owned())).ok_or_else(|| {
        Problem::new(&problem::INVALID_HEADER, "Idempotency-Key: must be 1 to 200 visible ASCII characters.")
    })
}

/// A job as an answer.
fn resource(record: JobRecord, status: StatusCode) -> Result<Response, Problem> {
    let tag = conditional::weak(&record.revision.to_string())?;
    let location = HeaderValue::from_str(&format!("/v1/jobs/{}", record.id)).ok();
    let finished = record.status.is_finished();
    let mut response = (status, Json(JobResource::from(record))).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    headers.typed_insert(tag);
    if !finished {
        headers.insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    }
    if let Some(location) = location {
        headers.insert(header::LOCATION, location);
    }
    Ok(response)
}

/// Jobs are not begun while the storage is full, since their results could not be stored; nor where nobody is there who
/// may do them.
async fn say_why_they_wait(store: &Store, jobs: &mut [JobRecord]) -> Result<(), StoreError> {
    let nobody = store.why_nobody_takes(jobs).await?;
    let has_space = store.has_space();
    for (job, nobody) in jobs.iter_mut().zip(nobody).filter(|(job, _)| job.status == JobStatus::Enqueued) {
        let full = || (!has_space).then(|| "waits until the storage has room for its result".to_owned());
        job.detail = full().or(nobody).or_else(|| job.detail.take());
    }
    Ok(())
}

/// Which jobs, and which page of them.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Only jobs with this status.
    #[param(inline)]
    status: Option<Status>,
    /// Only jobs of this kind.
    #[param(example = "eigenbasis")]
    kind: Option<String>,
    /// Only jobs on this mesh, or on the problem that has this id.
    mesh: Option<String>,
    /// Only the parts of this job, while it is divided: no other list has them, but that of the kind `eigenbasis_part`.
    parent: Option<String>,
    /// Items of the page, at most 200.
    #[param(minimum = 1, maximum = 200, default = 50)]
    limit: Option<u32>,
    /// `next` of the page before.
    from: Option<String>,
}

problems!(ListJobsProblems: PAGE []);

/// Lists jobs
///
/// Newest first. Pages stay stable while new jobs arrive. Jobs that solve parts of others are listed with `parent`.
#[utoipa::path(
    get, path = "/v1/jobs", tag = "jobs", operation_id = "listJobs", params(ListQuery),
    responses(
        (status = 200, description = "A page of jobs", body = PageOf<JobResource>),
        ListJobsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn list(state: ClientState, QueryOf(query): QueryOf<ListQuery>) -> Result<Json<PageOf<JobResource>>, Problem> {
    if query.kind.as_deref() != Some(EIGENBASIS_PART) {
        extract::known_kind(query.kind.as_deref())?;
    }
    let no_id = |_| Problem::new(&problem::INVALID_QUERY, "parent: must be the id of a job.");
    let parent = query.parent.as_deref().map(|parent| Uuid::try_parse(parent).map_err(no_id)).transpose()?;
    let filter = JobFilter { status: query.status.map(Into::into), kind: query.kind, mesh: query.mesh, parent };
    let (page, store) = (extract::page_request(query.limit, query.from)?, state.store.clone());
    let resources = async move {
        let mut page = store.jobs(&filter, &page).await?;
        say_why_they_wait(&store, &mut page.items).await?;
        Ok(PageOf::of(page, JobResource::from))
    };
    Ok(Json(state.off_loop(resources).await?))
}

/// Whether to wait.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ShowQuery {
    /// Answer only when the job has ended, or after this time (`20s`, `1500ms`; at most a minute). With
    /// `If-None-Match`: when it has changed.
    #[param(example = "20s")]
    wait: Option<String>,
}

problems!(ShowJobProblems: [INVALID_QUERY, UNKNOWN_JOB, BUSY]);

/// Shows a job
///
/// With `wait`, a long poll: the answer comes when the job has ended or the time is over, whichever is first; with
/// `If-None-Match` beside it, as soon as the job differs from what the tag names.
#[utoipa::path(
    get, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "showJob",
    params(JobId, ShowQuery),
    responses(
        (status = 200, description = "The job", body = JobResource, headers(("ETag" = String))),
        (status = 304, description = "The job is as `If-None-Match` names it"),
        ShowJobProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show(
    state: ClientState,
    JobId(id): JobId,
    QueryOf(query): QueryOf<ShowQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let wait = time_to_wait(query.wait.as_deref())?;
    let conditional_on = headers.contains_key(header::IF_NONE_MATCH);
    let known = |record: &JobRecord| {
        conditional::weak(&record.revision.to_string()).is_ok_and(|tag| conditional::matches(&headers, &tag))
    };
    let _place = if wait.is_zero() { None } else { Some(state.watch()?) };
    let news = |record: &JobRecord| if conditional_on { !known(record) } else { record.status.is_finished() };
    let mut record = awaited(&state, id, wait, news).await?;
    if conditional_on && known(&record) {
        return Ok(StatusCode::NOT_MODIFIED.into_response());
    }
    say_why_they_wait(&state.store, std::slice::from_mut(&mut record)).await?;
    let mut response = resource(record, StatusCode::OK)?;
    response.headers_mut().remove(header::LOCATION);
    Ok(response)
}

/// How long a request wants to wait; not at all, unless it says so.
fn time_to_wait(given: Option<&str>) -> Result<Duration, Problem> {
    let Some(text) = given else { return Ok(Duration::ZERO) };
    extract::duration(text).map(|wait| wait.min(LONGEST_WAIT)).ok_or_else(|| {
        let text = problem::shorten(text.to_owned());
        Problem::new(&problem::INVALID_QUERY, format!("wait: {text:?} is not a time such as 20s."))
    })
}

/// A job once there is news of it, or when the time is over.
async fn awaited(
    state: &ClientState,
    id: Uuid,
    wait: Duration,
    news: impl Fn(&JobRecord) -> bool,
) -> Result<JobRecord, Problem> {
    // Watching begins before the first look, so that no change falls between.
    let mut changes = state.store.watch_job(id);
    let deadline = Instant::now() + wait;
    loop {
        let record = look(state, id).await?;
        // A finished job does not change: waiting longer is of no use.
        if news(&record) || wait.is_zero() || record.status.is_finished() {
            return Ok(record);
        }
        tokio::select! {
            changed = changes.changed() => if !changed { return Ok(record) },
            () = tokio::time::sleep_until(deadline.into()) => return Ok(record),
            () = state.closing.cancelled() => return Ok(record),
        }
    }
}

problems!(CancelJobProblems: WRITE [INVALID_QUERY, UNKNOWN_JOB, STATE_CONFLICT]);

/// Cancels a job
///
/// A waiting job is canceled at once; a running one is asked to stop and does within a second. Cancelling twice is no
/// error.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/cancel", tag = "jobs", operation_id = "cancelJob",
    params(JobId),
    responses(
        (status = 202, description = "The job, canceled or asked to stop", body = JobResource),
        CancelJobProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn cancel(state: ClientState, JobId(id): JobId) -> Result<Response, Problem> {
    let record = state.store.cancel_job(id).await?;
    tracing::info!(job = %record.id, status = record.status.as_str(), "job cancelled");
    resource(record, StatusCode::ACCEPTED)
}

problems!(RetryJobProblems: WRITE [INVALID_QUERY, UNKNOWN_JOB, UNKNOWN_MESH, UNKNOWN_PROBLEM, UNKNOWN_BASIS, STATE_CONFLICT, DRAINING]);

/// Retries a job
///
/// A failed or canceled job waits again, with all its attempts. Retrying a job that waits or runs changes nothing.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/retry", tag = "jobs", operation_id = "retryJob",
    params(JobId),
    responses(
        (status = 202, description = "The job, waiting again", body = JobResource),
        RetryJobProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn retry(state: ClientState, JobId(id): JobId) -> Result<Response, Problem> {
    if state.is_draining() {
        return Err(Problem::new(&problem::DRAINING, "The server is shutting down and takes no jobs.").retry_after(10));
    }
    let record = state.store.retry_job(id).await?;
    tracing::info!(job = %record.id, status = record.status.as_str(), "job retried");
    resource(record, StatusCode::ACCEPTED)
}

/// What to do with what the job made.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct DeleteQuery {
    /// Deletes its basis too.
    #[serde(default)]
    #[param(default = false)]
    cascade: bool,
}

problems!(DeleteJobProblems: WRITE CONDITION [INVALID_QUERY, UNKNOWN_JOB, STATE_CONFLICT, BASIS_IN_USE]);

/// Deletes a job
///
/// One that has ended: cancel it first where it waits or runs. Refused while its basis is stored, unless
/// `cascade=true`.
#[utoipa::path(
    delete, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "deleteJob",
    params(JobId, DeleteQuery, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    responses(
        (status = 204, description = "The job is gone"),
        DeleteJobProblems,
    ),
    security(("bearer" = ["operate"]))
)]
async fn delete(
    state: ClientState,
    JobId(id): JobId,
    QueryOf(query): QueryOf<DeleteQuery>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    if conditional::has_condition(&headers) {
        conditional::require(&headers, &conditional::weak(&state.store.job(id).await?.revision.to_string())?)?;
    }
    state.store.delete_job(id, query.cascade).await?;
    tracing::info!(job = %id, cascade = query.cascade, "job deleted");
    Ok(StatusCode::NO_CONTENT)
}
