//! Stored maps between the shapes of a collection: what the job `map_collection` left.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_mesh::numbering::Translation;
use chladni_spectral::analysis::functional_map::PointMap;
use chladni_spectral::basis::StoredMap;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body;
use super::client::ClientState;
use super::exchange::Answer;
use super::extract::{self, QueryOf};
use super::ids::BasisId;
use super::map_collections::{MapCollectionAnswer, One};
use super::numbering::{Numbered, NumberingName, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// Bytes that a point of an answer and its confidence take, as numbers and as text.
const POINT_BYTES: u64 = 64;

/// The route of stored maps.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(show_maps))
}

/// Which maps.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct MapsQuery {
    /// Only the maps from this shape, by its place among the bases of the job.
    #[param(example = 0)]
    source: Option<usize>,
    /// Only the maps to this shape.
    #[param(example = 1)]
    target: Option<usize>,
    /// Whether the answer has the matrices beside the points.
    #[serde(default)]
    #[param(default = false)]
    matrices: bool,
}

problems!(GetMapsProblems: [INVALID_QUERY, UNKNOWN_BASIS, UNKNOWN_MESH, BASIS_KIND, NOT_ACCEPTABLE, BODY_TOO_LARGE, DAMAGED_CONTENT, BUSY]);

/// Gets the maps between shapes
///
/// What a job of the kind `map_collection` found, in the form of `POST /v1/map-collections`: for each vertex of a
/// target the vertex of the source that corresponds to it. Vertices are those of the uploaded files, for which their
/// meshes have to be there, or with `numbering=kept` those of the meshes. The NPZ of `/content` has all of it as
/// arrays, with the numbering of each file.
#[utoipa::path(
    get, path = "/v1/bases/{id}/maps", tag = "analysis", operation_id = "getMaps",
    params(BasisId, NumberingQuery, MapsQuery),
    responses(
        (status = 200, description = "The maps", body = MapCollectionAnswer, headers(("Server-Timing" = String))),
        GetMapsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show_maps(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<MapsQuery>,
    headers: HeaderMap,
) -> Result<Answer, Problem> {
    extract::negotiated(&headers, &["application/json"])?;
    let maps = state.store.load_maps(id).await?;
    let shapes = maps.shapes();
    for (name, place) in [("source", query.source), ("target", query.target)] {
        if let Some(place) = place.filter(|&place| place >= shapes) {
            let detail = format!("{name}: must be from 0 to {}, not {place}.", shapes - 1);
            return Err(Problem::new(&problem::INVALID_QUERY, detail));
        }
    }
    let wanted = move |of: &((usize, usize), &StoredMap)| {
        let (source, target) = of.0;
        query.source.is_none_or(|own| own == source) && query.target.is_none_or(|own| own == target)
    };
    let mut memory = state.memory();
    let points: usize = maps.each().filter(wanted).map(|(_, map)| map.points.len()).sum();
    body::reserve(&mut memory, POINT_BYTES * points as u64)?;
    let mut numberings = vec![Translation::default(); shapes];
    if numbered.0.numbering == NumberingName::File {
        for (numbering, mesh) in numberings.iter_mut().zip(maps.meshes()?) {
            *numbering = numbered.on_mesh(&state, mesh).await?;
        }
    }
    state
        .solve("maps", move |monitor| {
            let (begin, _memory) = (Instant::now(), memory);
            let mut told = Vec::new();
            for (pair, map) in maps.each().filter(wanted) {
                monitor.checkpoint()?;
                let points =
                    PointMap { matched: None, points: map.points.clone(), confidences: map.confidences.clone() };
                let matrix = query.matrices.then_some(&map.matrix);
                told.push(One::in_file_numbering(pair, points, map.disagreement, matrix, &numberings));
            }
            Answer::json(&MapCollectionAnswer { maps: told, cycles: maps.cycles.into() }, begin)
        })
        .await
}
