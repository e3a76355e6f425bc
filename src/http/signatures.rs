//! Signatures of points, and points that are similar to one.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_work::numbered::push;
use chladni_work::signatures::{SignatureRequest, SimilarAnswer, SimilarRequest};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Dtype, Table};
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The routes of signatures.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(signatures)).routes(routes!(similar_points))
}

/// What a raw body does not say.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct SignatureQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// For a raw body, the rest of the request as JSON.
    #[param(example = "{\"signature\": {\"kind\": \"wave_kernel\"}}")]
    request: Option<String>,
}

problems!(SignaturesProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_ANALYSIS]);

/// Computes signatures of points
///
/// The heat kernel, the wave kernel or the global point signature, of chosen vertices or all: a row for each vertex.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is little-endian u32 vertices, or empty
/// for all, and the rest of the request stands in the query. The answer is of the same kind unless `Accept` says
/// otherwise.
#[utoipa::path(
    post, path = "/v1/bases/{id}/signatures", tag = "analysis", operation_id = "signatures",
    params(BasisId, NumberingQuery, SignatureQuery),
    request_body(description = "The vertices", content((SignatureRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The signatures", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        SignaturesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn signatures(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<SignatureQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let fill = |request: &mut SignatureRequest, bytes: &[u8]| {
        if !bytes.is_empty() {
            request.vertices = Some(binary::decode_tuples::<1>(bytes)?.into_flattened());
        }
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    request.translate(&to, basis.vertices())?;
    state
        .solve("signatures", move |_| {
            let begin = Instant::now();
            Answer::table(&request.table(&basis, &to)?, raw, query.dtype, begin)
        })
        .await
}

problems!(SimilarPointsProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_ANALYSIS]);

/// Finds points that are similar to one
///
/// Compares the signature of every vertex with that of one: heat kernels by their distance over all scales (Sun et al.
/// 2009), wave kernels by their relative differences (Aubry et al. 2011), global points by the Euclidean distance.
///
/// JSON gives the most similar points. A raw answer is the difference of every vertex; a raw body is the vertex as one
/// little-endian u32, the rest of the request stands in the query then.
#[utoipa::path(
    post, path = "/v1/bases/{id}/similar-points", tag = "analysis", operation_id = "similarPoints",
    params(BasisId, NumberingQuery, SignatureQuery),
    request_body(description = "The point", content((SimilarRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "Similar points, or the difference of every vertex", content((SimilarAnswer = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        SimilarPointsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn similar_points(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<SignatureQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let fill = |request: &mut SimilarRequest, bytes: &[u8]| {
        let points = binary::decode_tuples::<1>(bytes)?;
        let [[point]] = points[..] else {
            let detail = format!("Exactly one vertex is needed, not {}.", points.len());
            return Err(Problem::new(&problem::INVALID_VERTEX, detail));
        };
        request.vertex = point;
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    request.check()?;
    request.translate(&to, basis.vertices())?;
    state
        .solve("similar_points", move |_| {
            let begin = Instant::now();
            if raw {
                let differences = request.differences(&basis)?;
                let table = DenseMatrix::from_columns(differences.len(), 1, differences);
                return Ok(Answer::raw(&push(&to, table), query.dtype, begin));
            }
            Answer::json(&request.answer(&basis, &to)?, begin)
        })
        .await
}
