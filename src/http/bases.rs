//! Bases: listed, shown and deleted.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use chladni_spectral::basis::{Basis, ProductKind};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::conditional;
use super::extract::{PathOf, QueryOf};
use super::problem::{self, Problem};
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
    /// Only bases on this mesh.
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

/// Lists bases
///
/// Newest first, without eigenvalues and certificates.
#[utoipa::path(
    get, path = "/v1/bases", tag = "bases", operation_id = "listBases", params(ListQuery),
    responses(
        (status = 200, description = "A page of bases", body = PageOf<BasisSummary>),
        (status = 400, description = "A problem: invalid-query or invalid-cursor", body = super::docs::ProblemSchema, content_type = "application/problem+json"),
    ),
    security(("bearer" = ["read"]))
)]
async fn list(
    State(state): State<AppState>,
    QueryOf(query): QueryOf<ListQuery>,
) -> Result<Json<PageOf<BasisSummary>>, Problem> {
    let filter = BasisFilter { mesh: query.mesh, kind: query.kind };
    let page = state.store.bases(&filter, &super::page(query.limit, query.from)?).await?;
    Ok(Json(PageOf::of(page, BasisSummary::from)))
}

/// The id of a basis in a path.
pub fn basis_id(text: &str) -> Result<Uuid, Problem> {
    text.parse().map_err(|_| {
        Problem::new(&problem::UNKNOWN_BASIS, format!("No basis has the id {:?}.", problem::shorten(text.to_owned())))
    })
}

/// The record of a basis in a path.
pub async fn find(state: &AppState, id: &str) -> Result<BasisRecord, Problem> {
    Ok(state.store.basis(basis_id(id)?).await?)
}

/// The record of a basis in a path, if it is of the kind that a route serves.
pub async fn find_kind(state: &AppState, id: &str, wanted: ProductKind) -> Result<BasisRecord, Problem> {
    let record = find(state, id).await?;
    match ProductKind::of_name(&record.kind) {
        Some(kind) if kind == wanted => Ok(record),
        Some(kind) => Err(StoreError::BasisKind { basis: record.id, kind, wanted }.into()),
        None => Err(Problem::internal(format!("basis {} is of the kind {:?}", record.id, record.kind))),
    }
}

/// The basis in a path, if it is one of functions on vertices: eigenfields of the Hodge–Laplacian have two numbers for each face.
pub async fn on_vertices(state: &AppState, id: &str) -> Result<Arc<Basis>, Problem> {
    let basis = state.store.load_basis(basis_id(id)?).await?;
    match is_of_fields(&basis) {
        false => Ok(basis),
        true => Err(Problem::new(
            &problem::BASIS_KIND,
            format!(
                "Basis {id} holds eigenfields, two numbers for each face; this route serves functions on vertices."
            ),
        )
        .with("kind", "eigenbasis of fields")
        .with("kinds", vec![ProductKind::Eigenbasis.name()])),
    }
}

/// Whether the rows of an eigenbasis are numbers of faces.
pub fn is_of_fields(basis: &Basis) -> bool {
    basis.metadata["operator"].get("hodge").is_some()
}

/// Shows a basis
///
/// With its eigenvalues (1/length² of the mesh) and its certificate: per pair the relative residual ‖Sx − θMx‖ / ‖Sx‖ and a
/// bound within which an exact eigenvalue lies, and the defect of orthonormality.
#[utoipa::path(
    get, path = "/v1/bases/{id}", tag = "bases", operation_id = "showBasis",
    params(("id" = String, Path, description = "The id of the basis", example = "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10")),
    responses(
        (status = 200, description = "The basis", body = BasisResource, headers(("ETag" = String))),
        (status = 304, description = "The basis is as `If-None-Match` names it"),
        (status = 404, description = "A problem: unknown-basis", body = super::docs::ProblemSchema, content_type = "application/problem+json"),
    ),
    security(("bearer" = ["read"]))
)]
async fn show(
    State(state): State<AppState>,
    PathOf(id): PathOf<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let record = find(&state, &id).await?;
    let tag = conditional::etag(
        &format!("{}-{}", record.id, &record.content_hash[..16.min(record.content_hash.len())]),
        true,
    );
    let mut response = match &tag {
        Some(tag) if conditional::matches(&headers, tag) => StatusCode::NOT_MODIFIED.into_response(),
        _ => Json(BasisResource::from(record)).into_response(),
    };
    if let Some(tag) = tag {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    Ok(response)
}

/// Deletes a basis
///
/// Its content goes with it. An equal job that is submitted later computes it anew.
#[utoipa::path(
    delete, path = "/v1/bases/{id}", tag = "bases", operation_id = "deleteBasis",
    params(("id" = String, Path, description = "The id of the basis", example = "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10")),
    responses(
        (status = 204, description = "The basis is gone"),
        (status = 404, description = "A problem: unknown-basis", body = super::docs::ProblemSchema, content_type = "application/problem+json"),
    ),
    security(("bearer" = ["operate"]))
)]
async fn delete(State(state): State<AppState>, PathOf(id): PathOf<String>) -> Result<StatusCode, Problem> {
    let id = basis_id(&id)?;
    state.store.delete_basis(id).await?;
    tracing::info!(basis = %id, "basis deleted");
    Ok(StatusCode::NO_CONTENT)
}
