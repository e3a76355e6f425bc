//! Distances on a surface, computed in a basis of it.

use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::distance::{SpectralDistance, nearest};
use chladni_spectral::analysis::geodesic::geodesic;
use chladni_spectral::analysis::spectrum::kernel_size;
use chladni_spectral::basis::Basis;
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Dtype, Table};
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::problem::Problem;
use super::problems::problems;
use super::state::AppState;

/// The routes of distances.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(distances))
}

/// A distance on the surface.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum DistanceKind {
    /// `d² = Σ e^{−2λt} (φ(x) − φ(y))²`, for each of the times.
    Diffusion {
        /// Times above zero, in length² of the mesh; without them, half the inverse of the first eigenvalue above zero.
        times: Option<Vec<f64>>,
    },
    /// `d² = Σ (φ(x) − φ(y))² / λ²`.
    Biharmonic,
    /// `d² = Σ (φ(x) − φ(y))² / λ`.
    CommuteTime,
    /// Geodesic distance by the heat method, both of its solves in the basis.
    Geodesic {
        /// How long heat flows, in length² of the mesh; without it, for each face the shortest of a ladder of times at which heat reaches it.
        time: Option<f64>,
    },
}

/// Which distances, and between what.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"distance": {"kind": "diffusion", "times": [0.01, 0.1]}, "sources": [17, 2930], "nearest": false}))]
struct DistanceRequest {
    /// The distance.
    distance: DistanceKind,
    /// Vertices that distances of all vertices are measured from; instead of `pairs`.
    #[serde(default)]
    sources: Vec<u32>,
    /// Pairs of vertices that distances are measured between; instead of `sources`.
    #[serde(default)]
    pairs: Vec<[u32; 2]>,
    /// Whether to give the distance to the nearest source alone.
    #[serde(default)]
    nearest: bool,
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
    params(BasisId, DistanceQuery),
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
    QueryOf(query): QueryOf<DistanceQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let fill = |request: &mut DistanceRequest, bytes: &[u8]| {
        if query.pairs {
            request.pairs = binary::decode_tuples(bytes)?;
        } else {
            request.sources = binary::decode_tuples::<1>(bytes)?.into_flattened();
        }
        Ok(())
    };
    let (request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    if request.sources.is_empty() == request.pairs.is_empty() {
        return Err(Problem::new(
            &super::problem::INVALID_REQUEST,
            "Either sources or pairs are needed, and not both.",
        ));
    }
    let mesh = match &request.distance {
        DistanceKind::Geodesic { .. } => {
            let record = state.store.basis(id).await?;
            Some(state.store.load_mesh(&record.mesh).await?)
        }
        _ => None,
    };
    state
        .solve("distances", move |_| {
            let begin = Instant::now();
            let table = compute(&basis, mesh, &request)?;
            Answer::table(&table, raw, query.dtype, begin)
        })
        .await
}

fn compute(
    basis: &Basis,
    mesh: Option<Arc<TriangleMesh>>,
    request: &DistanceRequest,
) -> Result<DenseMatrix, AnalysisError> {
    let spectral = match &request.distance {
        DistanceKind::Diffusion { times: Some(times) } => SpectralDistance::Diffusion { times: times.clone() },
        DistanceKind::Diffusion { times: None } => {
            let first = kernel_size(&basis.eigenvalues)?;
            SpectralDistance::Diffusion { times: vec![0.5 / basis.eigenvalues[first]] }
        }
        DistanceKind::Biharmonic => SpectralDistance::Biharmonic,
        DistanceKind::CommuteTime => SpectralDistance::CommuteTime,
        DistanceKind::Geodesic { time } => {
            let mesh = mesh.ok_or(AnalysisError::Mesh { basis: basis.vertices(), mesh: 0 })?;
            if !request.pairs.is_empty() {
                return between(basis, &mesh, &request.pairs, *time);
            }
            return geodesic(basis, &mesh, &request.sources, request.nearest, *time);
        }
    };
    if !request.pairs.is_empty() {
        return spectral.between(basis, &request.pairs);
    }
    let all = spectral.from_sources(basis, &request.sources)?;
    Ok(if request.nearest { nearest(&all, spectral.columns()) } else { all })
}

/// Geodesic distances of pairs: from each of their first vertices, once.
fn between(
    basis: &Basis,
    mesh: &TriangleMesh,
    pairs: &[[u32; 2]],
    time: Option<f64>,
) -> Result<DenseMatrix, AnalysisError> {
    let mut sources: Vec<u32> = pairs.iter().map(|pair| pair[0]).collect();
    sources.sort_unstable();
    sources.dedup();
    let vertices = basis.vertices();
    for (place, pair) in pairs.iter().enumerate() {
        if let Some(&vertex) = pair.iter().find(|&&vertex| vertex as usize >= vertices) {
            return Err(AnalysisError::Vertex { what: "pair", place, vertex, vertices });
        }
    }
    let all = geodesic(basis, mesh, &sources, false, time)?;
    let mut distances = DenseMatrix::zeros(pairs.len(), 1);
    for (slot, [a, b]) in distances.column_mut(0).iter_mut().zip(pairs) {
        let column = sources.partition_point(|source| source < a);
        *slot = all.column(column)[*b as usize];
    }
    Ok(distances)
}
