//! Functional maps between two surfaces.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_work::functional_map::{FunctionalMapAnswer, FunctionalMapRequest, MapFault, MapSide};
use chladni_work::mappable::check_alike;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::bases::on_vertices;
use super::binary::{self, Dtype};
use super::client::ClientState;
use super::comparisons::spectrum_of;
use super::exchange::{self, Answer, OCTETS};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::shapes;
use super::state::AppState;

/// The route of functional maps.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(map_functions))
}

/// What a raw body does not say.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct MapQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// For a raw body, the rest of the request as JSON.
    request: Option<String>,
    /// Whether a raw answer is the matched points as little-endian u32, not the matrix.
    #[serde(default)]
    #[param(default = false)]
    points: bool,
}

problems!(FunctionalMapProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_FUNCTION, INCOMPARABLE_BASES, INVALID_ANALYSIS]);

/// Maps functions between two surfaces
///
/// A functional map (Ovsjanikov et al. 2012) from landmarks, descriptors or signatures, refined by ZoomOut (Melzi et
/// al. 2019), with the correspondence of points that it makes: for vertices of the target, vertices of the source, and
/// with `both_ways` the other way. With `carry` functions on the source are carried over, colours and texture
/// coordinates among them. Both bases have to be of one operator and one condition at the boundary. Sizes decide how
/// long it takes: a hundred pairs and two thousand samples are a matter of a second, matching all points of large
/// meshes one of many.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is pairs of little-endian u32, the
/// landmarks, and the rest of the request stands in the query. A raw answer is the matrix, row after row, or with
/// `points=true` the points (4294967295 where a vertex has none).
#[utoipa::path(
    post, path = "/v1/functional-maps", tag = "analysis", operation_id = "functionalMap",
    params(NumberingQuery, MapQuery),
    request_body(description = "The surfaces and what is known", content((FunctionalMapRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The map", content((FunctionalMapAnswer = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        FunctionalMapProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn map_functions(
    state: ClientState,
    numbered: Numbered,
    QueryOf(query): QueryOf<MapQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let fill = |request: &mut FunctionalMapRequest, bytes: &[u8]| {
        request.landmarks = binary::decode_tuples(bytes)?;
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    let (source_id, target_id) = (BasisId::parse(&request.source)?.0, BasisId::parse(&request.target)?.0);
    check_alike_bases(&state, [source_id, target_id]).await?;
    let source = on_vertices(&state, source_id).await?;
    let target = on_vertices(&state, target_id).await?;
    let to_source = numbered.on_basis(&state, source_id, &source.metadata).await?;
    let to_target = numbered.on_basis(&state, target_id, &target.metadata).await?;
    let side = |basis, to| MapSide { basis, to };
    request.translate(side(&source, &to_source), side(&target, &to_target))?;
    state
        .solve("functional_map", move |_| {
            let begin = Instant::now();
            let side = |basis, to| MapSide { basis, to };
            let found = request.find(side(&source, &to_source), side(&target, &to_target))?;
            if raw && query.points {
                let points: Vec<u32> = found.forward.points.iter().map(|point| point.unwrap_or(u32::MAX)).collect();
                return Ok(Answer::new(binary::encode_u32(&points), OCTETS, begin)
                    .with("chladni-rows", points.len())
                    .with("chladni-columns", 1)
                    .with("chladni-dtype", "u32"));
            }
            if raw {
                return Ok(Answer::raw(&found.map.matrix, query.dtype, begin));
            }
            Answer::json(&found.into_answer(), begin)
        })
        .await
}

/// Functions of different operators, or of different conditions at a boundary, do not correspond to each other.
async fn check_alike_bases(state: &ClientState, ids: [Uuid; 2]) -> Result<(), Problem> {
    let mut of = Vec::with_capacity(2);
    for id in ids {
        let (basis, mesh) = shapes::find_one(state, id).await?;
        of.push((id.to_string(), spectrum_of(&basis, &mesh)));
    }
    Ok(check_alike(of.iter().map(|(id, of)| (id.as_str(), of)))?)
}

impl From<MapFault> for Problem {
    fn from(fault: MapFault) -> Self {
        match fault {
            MapFault::Function(error) => error.into(),
            MapFault::Descriptors { .. } => Self::new(&problem::INVALID_FUNCTION, format!("{fault}.")),
            MapFault::Basis(error) => error.into(),
            MapFault::Analysis(error) => error.into(),
        }
    }
}
