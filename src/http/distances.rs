//! Distances on a surface, computed in a basis of it.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_work::distances::{DistanceFault, DistanceRequest};
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

/// The routes of distances.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(distances))
}

/// What a raw body does not say.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct DistanceQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// For a raw body, the rest of the request as JSON.
    #[param(example = "{\"distance\": {\"kind\": \"biharmonic\"}}")]
    request: Option<String>,
    /// Whether the numbers of a raw body are pairs, not sources.
    #[serde(default)]
    #[param(default = false)]
    pairs: bool,
}

problems!(DistancesProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_ANALYSIS]);

/// Computes distances
///
/// Diffusion, biharmonic, commute-time and geodesic distances, from one or many sources to all vertices or between pairs. A table with a row
/// for each vertex (or pair) and a column for each source and, within a source, each time; with `nearest`, for each time.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is little-endian u32, sources or with `pairs=true` the
/// vertices of pairs, and the rest of the request stands in the query. The answer is of the same kind unless `Accept` says otherwise.
#[utoipa::path(
    post, path = "/v1/bases/{id}/distances", tag = "analysis", operation_id = "distances",
    params(BasisId, NumberingQuery, DistanceQuery),
    request_body(description = "The sources or pairs", content((DistanceRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The distances", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        DistancesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn distances(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<DistanceQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let fill = |request: &mut DistanceRequest, bytes: &[u8]| {
        if query.pairs {
            request.pairs = binary::decode_tuples(bytes)?;
        } else {
            request.sources = binary::decode_tuples::<1>(bytes)?.into_flattened();
        }
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    request.check()?;
    request.translate(&to, basis.vertices())?;
    let mesh = match request.needs_mesh() {
        true => Some(state.store.load_mesh(&state.store.basis(id).await?.mesh).await?),
        false => None,
    };
    state
        .solve("distances", move |_| {
            let begin = Instant::now();
            let table = request.distances(&basis, mesh.as_deref())?;
            Answer::table(&request.told(&to, table), raw, query.dtype, begin)
        })
        .await
}

impl From<DistanceFault> for Problem {
    fn from(fault: DistanceFault) -> Self {
        match fault {
            DistanceFault::Between => Self::new(&problem::INVALID_REQUEST, super::convert::sentence(&fault)),
            DistanceFault::Analysis(error) => error.into(),
        }
    }
}
