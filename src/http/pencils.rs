//! Problems, the matrices of pencils: uploaded, listed, shown, renamed, deleted, and given back. (What `problem.rs` has
//! are errors.)

use axum::Json;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::client::ClientState;
use super::content::{Conditional, Immutable};
use super::extract::{self, QueryOf};
use super::ids::ProblemId;
use super::named::{self, RenameRequest};
use super::pencil_upload::{self, SentMatrices};
use super::pencil_wire::ProblemResource;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use super::upload::check_name;
use super::wire::PageOf;
use super::{body, conditional, exchange};

/// The routes of problems.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(upload, list)).routes(routes!(show, rename, delete)).routes(routes!(content))
}

/// How to read an upload.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct UploadQuery {
    /// A name for people, at most 200 characters.
    #[param(example = "bracket, 2 mm", max_length = 200)]
    name: Option<String>,
}

/// Matrices in parts.
#[derive(utoipa::ToSchema)]
#[schema(as = ProblemParts)]
#[allow(dead_code)]
struct PartsSchema {
    /// The matrix S.
    #[schema(value_type = String, format = Binary)]
    stiffness: Vec<u8>,
    /// The mass M: a matrix as S, or its diagonal as NPY or a Matrix Market array of one column; the identity where it
    /// is absent.
    #[schema(value_type = String, format = Binary, required = false)]
    mass: Vec<u8>,
    /// As in the query.
    #[schema(required = false, max_length = 200)]
    name: String,
}

problems!(UploadProblemProblems: BODY WRITE [INVALID_QUERY, INVALID_MULTIPART, UNREADABLE_MATRIX, INVALID_PENCIL, DRAINING]);

/// Uploads a problem
///
/// A problem is a pencil of sparse symmetric matrices, `S x = λ M x`, that someone else assembled; no mesh belongs to
/// it. Jobs of the kind `pencil_basis` compute eigenpairs of it.
///
/// The body is the matrix S, its mass then being the identity, or `multipart/form-data` with the parts `stiffness` and
/// `mass` (and, optionally, `name`). Each is an NPZ file of `scipy.sparse.save_npz` (CSR, CSC, COO, DIA or BSR) or
/// Matrix Market (real, integer or pattern; general or symmetric), told by its first bytes; a mass may also be the
/// diagonal alone. What `GET /v1/problems/{id}/content` gives is taken as well, with its mass. `Content-Encoding` may
/// be gzip or zstd.
///
/// Both have to be finite and symmetric: entries on either side of the diagonal may differ by 1e-12 of the largest of
/// their rows, and their mean is taken. The mass has to be positive definite. The first entry or row that does not fit
/// is named, counted from 0. Where proving the mass definite would take much memory (`mass_proven` is false then), the
/// first job does it, and fails if it is not.
///
/// Equal matrices have the same id, in whichever format they come: sending them again answers 200 with what is stored.
#[utoipa::path(
    post, path = "/v1/problems", tag = "problems", operation_id = "uploadProblem", params(UploadQuery),
    request_body(description = "The matrices", content(
        (super::docs::Binary = "application/x-npz"), (super::docs::Binary = "application/x-matrix-market"),
        (super::docs::Binary = "application/octet-stream"), (PartsSchema = "multipart/form-data"))),
    responses(
        (status = 201, description = "The problem is stored; `Location` names it", body = ProblemResource, headers(("Location" = String), ("ETag" = String))),
        (status = 200, description = "Equal matrices were stored before", body = ProblemResource, headers(("Location" = String))),
        UploadProblemProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn upload(
    state: ClientState,
    QueryOf(query): QueryOf<UploadQuery>,
    request: Request,
) -> Result<Response, Problem> {
    if state.is_draining() {
        return Err(
            Problem::new(&problem::DRAINING, "The server is shutting down and takes no problems.").retry_after(10)
        );
    }
    let (parts, content) = request.into_parts();
    let body = body::read(&state, &parts.headers, content, state.config.limits.max_body_bytes).await?;
    let sent = SentMatrices::of(parts, body.bytes.clone()).await?;
    let name = query.name.or(sent.name.clone()).filter(|name| !name.trim().is_empty());
    check_name(name.as_deref(), &problem::INVALID_QUERY)?;
    let (limits, memory) = (state.config.limits.clone(), state.memory());
    let new = state
        .on_intake_pool(move || {
            let new = pencil_upload::read(sent, name, &limits, memory);
            // The share of the body budget is held until the bytes are gone.
            drop(body);
            new
        })
        .await?;
    let stored = state.store.add_problem(new).await?;
    let record = stored.record;
    tracing::info!(problem = record.id, rows = record.rows, created = stored.created, "problem stored");
    let (address, tag) = (format!("/v1/problems/{}", record.id), named::tag(&record.id, record.name.as_deref())?);
    Ok(named::stored(stored.created, &address, tag, ProblemResource::from(record)))
}

/// Which page.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Items of the page, at most 200.
    #[param(minimum = 1, maximum = 200, default = 50)]
    limit: Option<u32>,
    /// `next` of the page before.
    from: Option<String>,
    /// Only problems whose name contains this, in capital letters or small ones.
    #[param(example = "bracket")]
    name: Option<String>,
}

problems!(ListProblemsProblems: PAGE []);

/// Lists problems
///
/// Newest first. Pages stay stable while new problems arrive.
#[utoipa::path(
    get, path = "/v1/problems", tag = "problems", operation_id = "listProblems", params(ListQuery),
    responses(
        (status = 200, description = "A page of problems", body = PageOf<ProblemResource>),
        ListProblemsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn list(
    state: ClientState,
    QueryOf(query): QueryOf<ListQuery>,
) -> Result<Json<PageOf<ProblemResource>>, Problem> {
    let page = extract::page_request(query.limit, query.from)?;
    let page = state.store.problems_named(query.name.as_deref(), &page).await?;
    Ok(Json(PageOf::of(page, ProblemResource::from)))
}

problems!(ShowProblemProblems: [INVALID_QUERY, UNKNOWN_PROBLEM]);

/// Shows a problem
///
/// With what was found when it was checked.
#[utoipa::path(
    get, path = "/v1/problems/{id}", tag = "problems", operation_id = "showProblem",
    params(ProblemId),
    responses(
        (status = 200, description = "The problem", body = ProblemResource, headers(("ETag" = String))),
        (status = 304, description = "The problem is as `If-None-Match` names it"),
        ShowProblemProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show(state: ClientState, ProblemId(id): ProblemId, headers: HeaderMap) -> Result<Response, Problem> {
    let record = state.store.problem(&id).await?;
    let tag = named::tag(&record.id, record.name.as_deref())?;
    Ok(named::shown(&headers, tag, ProblemResource::from(record)))
}

/// That a problem is in the state that `If-Match` names.
async fn require(state: &ClientState, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    if !conditional::has_condition(headers) {
        return Ok(());
    }
    let record = state.store.problem(id).await?;
    conditional::require(headers, &named::tag(&record.id, record.name.as_deref())?)
}

problems!(RenameProblemProblems: BODY JSON WRITE CONDITION [INVALID_QUERY, UNKNOWN_PROBLEM]);

/// Renames a problem
///
/// The name is for people; the id stays.
#[utoipa::path(
    patch, path = "/v1/problems/{id}", tag = "problems", operation_id = "renameProblem",
    params(ProblemId, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    request_body(content = RenameRequest),
    responses(
        (status = 200, description = "The problem under its new name", body = ProblemResource),
        RenameProblemProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn rename(
    state: ClientState,
    ProblemId(id): ProblemId,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<ProblemResource>, Problem> {
    let name = named::new_name(&state, &headers, body).await?;
    require(&state, &id, &headers).await?;
    let record = state.store.rename_problem(&id, name.as_deref()).await?;
    tracing::info!(problem = record.id, "problem renamed");
    Ok(Json(ProblemResource::from(record)))
}

/// What to do with what refers to the problem.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct DeleteQuery {
    /// Cancels its unfinished jobs and deletes its bases too.
    #[serde(default)]
    #[param(default = false)]
    cascade: bool,
}

problems!(DeleteProblemProblems: WRITE CONDITION [INVALID_QUERY, UNKNOWN_PROBLEM, PROBLEM_IN_USE]);

/// Deletes a problem
///
/// Refused while unfinished jobs or bases refer to it, unless `cascade=true`.
#[utoipa::path(
    delete, path = "/v1/problems/{id}", tag = "problems", operation_id = "deleteProblem",
    params(ProblemId, DeleteQuery, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    responses(
        (status = 204, description = "The problem is gone"),
        DeleteProblemProblems,
    ),
    security(("bearer" = ["operate"]))
)]
async fn delete(
    state: ClientState,
    ProblemId(id): ProblemId,
    QueryOf(query): QueryOf<DeleteQuery>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    require(&state, &id, &headers).await?;
    state.store.delete_problem(&id, query.cascade).await.map_err(pencil_upload::in_use)?;
    tracing::info!(problem = id, cascade = query.cascade, "problem deleted");
    Ok(StatusCode::NO_CONTENT)
}

const NPZ: &str = "application/x-npz";

problems!(GetProblemContentProblems: [INVALID_QUERY, UNKNOWN_PROBLEM, NOT_ACCEPTABLE, RANGE_NOT_SATISFIABLE, DAMAGED_CONTENT]);

/// Gets the matrices of a problem
///
/// As NPZ: `format`, `shape`, `data`, `indices` and `indptr` of S in CSR form, which `scipy.sparse.load_npz` opens; of
/// the mass the diagonal `mass`, or `mass_data`, `mass_indices` and `mass_indptr` in CSR form, or nothing where it is
/// the identity.
#[utoipa::path(
    get, path = "/v1/problems/{id}/content", tag = "problems", operation_id = "getProblemContent",
    params(
        ProblemId,
        ("Range" = Option<String>, Header, description = "One range of bytes", example = "bytes=0-1023"),
    ),
    responses(
        (status = 200, description = "The whole content", content((super::docs::Binary = "application/x-npz"), (super::docs::Binary = "application/zip"), (super::docs::Binary = "application/octet-stream")), headers(("ETag" = String))),
        (status = 206, description = "The bytes that `Range` asks for", content((super::docs::Binary = "application/x-npz"), (super::docs::Binary = "application/zip"), (super::docs::Binary = "application/octet-stream")), headers(("Content-Range" = String))),
        (status = 304, description = "The content is as `If-None-Match` names it"),
        GetProblemContentProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn content(state: ClientState, ProblemId(id): ProblemId, headers: HeaderMap) -> Result<Response, Problem> {
    let media_type = extract::negotiated(&headers, &[NPZ, "application/zip", exchange::OCTETS])?;
    let record = state.store.problem(&id).await?;
    let immutable = Immutable {
        tag: record.content_hash.clone(),
        media_type,
        file_name: format!("problem-{}.npz", record.id),
        length: record.bytes,
    };
    Ok(match immutable.conditional(&headers)? {
        Conditional::Known(response) => response,
        Conditional::Bytes(range, mut response) => {
            state.store.check_content(&record.content_hash, &range).await?;
            *response.body_mut() = Body::from_stream(state.store.blob_stream(&record.content_hash, range));
            response
        }
    })
}
