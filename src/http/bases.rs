//! Bases: listed, shown and deleted.

use std::sync::Arc;

use axum::Json;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use chladni_spectral::basis::{Basis, ProductKind};
use headers::ETag;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::client::ClientState;
use super::conditional;
use super::extract::{self, QueryOf};
use super::ids::BasisId;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use super::wire::{BasisResource, BasisSummary, PageOf};
use crate::store::{BasisFilter, BasisRecord, StoreError};

/// The routes of bases as resources.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(show, delete))
}

/// Which bases, and which page of them.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Only bases on this mesh, or of this problem.
    mesh: Option<String>,
    /// Only bases of this kind.
    #[param(example = "eigenbasis")]
    kind: Option<String>,
    /// Items of the page, at most 200.
    #[param(minimum = 1, maximum = 200, default = 50)]
    limit: Option<u32>,
    /// `next` of the page before.
    from: Option<String>,
}

problems!(ListBasesProblems: PAGE []);

/// Lists bases
///
/// Newest first, without eigenvalues and certificates.
#[utoipa::path(
    get, path = "/v1/bases", tag = "bases", operation_id = "listBases", params(ListQuery),
    responses(
        (status = 200, description = "A page of bases", body = PageOf<BasisSummary>),
        ListBasesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn list(state: ClientState, QueryOf(query): QueryOf<ListQuery>) -> Result<Json<PageOf<BasisSummary>>, Problem> {
    extract::known_kind(query.kind.as_deref())?;
    let filter = BasisFilter { mesh: query.mesh, kind: query.kind };
    let page = state.store.bases(&filter, &super::extract::page_request(query.limit, query.from)?).await?;
    Ok(Json(PageOf::of(page, BasisSummary::from)))
}

/// The record of a basis, if it is of the kind that a route serves.
pub async fn find_kind(state: &ClientState, id: Uuid, wanted: ProductKind) -> Result<BasisRecord, Problem> {
    let record = state.store.basis(id).await?;
    match ProductKind::of_name(&record.kind) {
        Some(kind) if kind == wanted => Ok(record),
        Some(kind) => Err(StoreError::BasisKind { basis: record.id, kind, wanted }.into()),
        None => Err(Problem::internal(format!("basis {} is of the kind {:?}", record.id, record.kind))),
    }
}

/// The basis, if it is one of functions on vertices: eigenfields of the Hodge–Laplacian have two numbers for each face.
pub async fn on_vertices(state: &ClientState, id: Uuid) -> Result<Arc<Basis>, Problem> {
    let basis = state.store.load_basis(id).await?;
    match basis.is_of_fields()? {
        false => Ok(basis),
        true => Err(of_fields(id)),
    }
}

/// That a basis is one of eigenfields, where functions on vertices are due.
pub fn of_fields(id: Uuid) -> Problem {
    Problem::new(
        &problem::BASIS_KIND,
        format!("Basis {id} holds eigenfields, two numbers for each face; this route serves functions on vertices."),
    )
    .with("kind", "eigenbasis of fields")
    .with("kinds", vec![ProductKind::Eigenbasis.name()])
}

problems!(ShowBasisProblems: [INVALID_QUERY, UNKNOWN_BASIS]);

/// Shows a basis
///
/// With its eigenvalues (1/length² of the mesh) and its certificate: per pair the relative residual ‖Sx − θMx‖ / ‖Sx‖
/// and a bound within which an exact eigenvalue lies, and the defect of orthonormality.
#[utoipa::path(
    get, path = "/v1/bases/{id}", tag = "bases", operation_id = "showBasis",
    params(BasisId),
    responses(
        (status = 200, description = "The basis", body = BasisResource, headers(("ETag" = String))),
        (status = 304, description = "The basis is as `If-None-Match` names it"),
        ShowBasisProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show(state: ClientState, BasisId(id): BasisId, headers: HeaderMap) -> Result<Response, Problem> {
    let record = state.store.basis(id).await?;
    let tag = tag_of(&record)?;
    let make = || Json(BasisResource::from(record)).into_response();
    let mut response = conditional::unless_known(&headers, tag, make);
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    Ok(response)
}

/// The entity tag of a basis.
fn tag_of(record: &BasisRecord) -> Result<ETag, Problem> {
    let hash = record.content_hash.get(..16).unwrap_or(&record.content_hash);
    conditional::weak(&format!("{}-{hash}", record.id))
}

problems!(DeleteBasisProblems: WRITE CONDITION [INVALID_QUERY, UNKNOWN_BASIS, BASIS_IN_USE]);

/// Deletes a basis
///
/// Its content goes with it. An equal job that is submitted later computes it anew. Refused while a job needs it that
/// waits or runs.
#[utoipa::path(
    delete, path = "/v1/bases/{id}", tag = "bases", operation_id = "deleteBasis",
    params(BasisId, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    responses(
        (status = 204, description = "The basis is gone"),
        DeleteBasisProblems,
    ),
    security(("bearer" = ["operate"]))
)]
async fn delete(state: ClientState, BasisId(id): BasisId, headers: HeaderMap) -> Result<StatusCode, Problem> {
    if conditional::has_condition(&headers) {
        conditional::require(&headers, &tag_of(&state.store.basis(id).await?)?)?;
    }
    state.store.delete_basis(id).await?;
    tracing::info!(basis = %id, "basis deleted");
    Ok(StatusCode::NO_CONTENT)
}
