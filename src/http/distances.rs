//! Distances on a surface, computed in a basis of it.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_mesh::numbering::Translation;
use chladni_work::distances::{DistanceFault, DistanceRequest, Distances, GeodesicMethod, MeshDistances};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Dtype, Table};
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract::QueryOf;
use super::fields::cached;
use super::ids::{BasisId, MeshId};
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The routes of distances.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(distances)).routes(routes!(mesh_distances))
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
/// Diffusion, biharmonic, commute-time and geodesic distances, from one or many sources to all vertices or between
/// pairs. A table with a row for each vertex (or pair) and a column for each source and, within a source, each time;
/// with `nearest`, for each time.
///
/// Geodesic distances by `heat` and `exact` ones are computed on the mesh of the basis; what they prepare of it is kept
/// for further requests. An infinite distance is `null` in JSON. `Chladni-Slope-Error` tells how far those by `heat`
/// may be off: by how much their slope, which is one, differs from one, on average over the surface or along paths to
/// the sources. They are off by about this share of themselves or less, by a quarter of it as a rule.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is little-endian u32, sources or with
/// `pairs=true` the vertices of pairs, and the rest of the request stands in the query. The answer is of the same kind
/// unless `Accept` says otherwise.
#[utoipa::path(
    post, path = "/v1/bases/{id}/distances", tag = "analysis", operation_id = "distances",
    params(BasisId, NumberingQuery, DistanceQuery),
    request_body(description = "The sources or pairs", content((DistanceRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The distances", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Chladni-Slope-Error" = f64), ("Server-Timing" = String))),
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
    let fill = filled(query.pairs);
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    request.check()?;
    request.check_basis(&basis)?;
    if request.on_mesh().is_some() {
        let mesh = state.store.basis(id).await?.mesh;
        return on_mesh(&state, &mesh, request, to, raw, query.dtype).await;
    }
    request.translate(&to, basis.vertices())?;
    let mesh = match request.needs_mesh() {
        true => Some(state.store.load_mesh(&state.store.basis(id).await?.mesh).await?),
        false => None,
    };
    state
        .solve("distances", move |monitor| {
            let begin = Instant::now();
            let found = request.distances(&basis, mesh.as_deref(), monitor)?;
            Answer::table(&request.translated(&to, found.table), raw, query.dtype, begin)
        })
        .await
}

problems!(MeshDistancesProblems: BODY JSON [INVALID_QUERY, UNKNOWN_MESH, NOT_ACCEPTABLE, INVALID_VERTEX, INVALID_ANALYSIS]);

/// Computes geodesic distances on a mesh
///
/// As the route of a basis, for geodesic distances by `heat` and `exact` ones: no basis is needed.
#[utoipa::path(
    post, path = "/v1/meshes/{id}/distances", tag = "analysis", operation_id = "meshDistances",
    params(MeshId, NumberingQuery, DistanceQuery),
    request_body(description = "The sources or pairs", content((DistanceRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The distances", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Chladni-Slope-Error" = f64), ("Server-Timing" = String))),
        MeshDistancesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn mesh_distances(
    state: ClientState,
    MeshId(id): MeshId,
    numbered: Numbered,
    QueryOf(query): QueryOf<DistanceQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let to = numbered.on_mesh(&state, &id).await?;
    let fill = filled(query.pairs);
    let (request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    request.check()?;
    on_mesh(&state, &id, request, to, raw, query.dtype).await
}

/// Geodesic distances on a mesh, with what was prepared of it at an earlier request or is now.
async fn on_mesh(
    state: &ClientState,
    mesh: &str,
    mut request: DistanceRequest,
    to: Translation,
    raw: bool,
    dtype: Dtype,
) -> Result<Answer, Problem> {
    let (method, time) = request.on_mesh().ok_or(DistanceFault::NeedsBasis)?;
    let content = state.store.load_mesh(mesh).await?;
    request.translate(&to, content.positions.len())?;
    let (stage, key) = match method {
        GeodesicMethod::Heat => ("heat_factor", format!("{mesh} {time:?}")),
        _ => ("unfolding", mesh.to_owned()),
    };
    let prepared = cached(state, stage, &key, move |monitor| {
        let made = MeshDistances::new(&content, method, time, monitor)?.ok_or(DistanceFault::NeedsBasis)?;
        let bytes = made.bytes();
        Ok((made, bytes))
    });
    let prepared = prepared.await?;
    state
        .solve("distances", move |monitor| {
            let begin = Instant::now();
            let Distances { table, slope_error } = request.geodesics(&prepared, monitor)?;
            let answer = Answer::table(&request.translated(&to, table), raw, dtype, begin)?;
            Ok(match slope_error {
                Some(error) => answer.with("chladni-slope-error", format!("{error:.4}")),
                None => answer,
            })
        })
        .await
}

/// Puts the vertices of a raw body into a request.
fn filled(pairs: bool) -> impl FnOnce(&mut DistanceRequest, &[u8]) -> Result<(), Problem> {
    move |request, bytes| {
        if pairs {
            request.pairs = binary::decode_tuples(bytes)?;
        } else {
            request.sources = binary::decode_tuples::<1>(bytes)?.into_flattened();
        }
        Ok(())
    }
}

impl From<DistanceFault> for Problem {
    fn from(fault: DistanceFault) -> Self {
        match fault {
            DistanceFault::Between
            | DistanceFault::Nowhere
            | DistanceFault::Nearest
            | DistanceFault::Time
            | DistanceFault::NeedsBasis
            | DistanceFault::Inside
            | DistanceFault::Unitless => Self::new(&problem::INVALID_REQUEST, super::convert::sentence(&fault)),
            DistanceFault::Analysis(error) => error.into(),
            DistanceFault::Provenance(error) => error.into(),
        }
    }
}
