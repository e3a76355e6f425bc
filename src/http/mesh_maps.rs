//! Which vertex and face of a file became which of the mesh.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_spectral::formats::npz;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::client::ClientState;
use super::exchange::{Answer, JSON};
use super::extract::{self, QueryOf};
use super::ids::MeshId;
use super::problem::Problem;
use super::problems::problems;
use super::state::AppState;
use chladni_mesh::numbering::Numbering;

const NPY: &str = "application/x-npy";

/// The routes of maps.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(vertex_map)).routes(routes!(face_map))
}

/// What a map has an entry for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Of {
    /// Each vertex or face of the file.
    File,
    /// Each of the mesh.
    Kept,
}

/// How a map is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Format {
    Json,
    Npy,
}

/// Which way, and how written.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct MapQuery {
    /// What there is an entry for: each vertex or face of the file, or each of the mesh.
    #[param(inline)]
    of: Option<Of>,
    /// Takes the place of `Accept`.
    #[param(inline)]
    format: Option<Format>,
}

/// A map between the numbering of a file and that of its mesh.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"of": "file", "file": 5, "kept": 4, "identical": false, "known": true, "map": [0, 1, null, 2, 3]}))]
struct MapAnswer {
    /// What there is an entry for.
    #[schema(inline)]
    of: Of,
    /// How many the file has.
    file: usize,
    /// How many the mesh has; of a solid, the vertices inside too, which follow those of its surface.
    kept: usize,
    /// Whether both numberings are the same.
    identical: bool,
    /// Whether the numbering of the file is known. It is not of a mesh that was stored, and renumbered, before maps
    /// were kept: its own numbering stands for it then; upload the file again to have its map.
    known: bool,
    /// For each the number on the other side, or null where it has none. Several on the other side: the first.
    map: Vec<Option<u32>>,
}

problems!(GetVertexMapProblems: [INVALID_QUERY, UNKNOWN_MESH, NOT_ACCEPTABLE, DAMAGED_CONTENT, BUSY]);

/// Gets the map of vertices
///
/// For each vertex of the uploaded file the vertex of the mesh that it became, in JSON null and in NPY (int32) −1 where
/// it was dropped; with `of=kept`, for each vertex of the mesh the first of the file.
#[utoipa::path(
    get, path = "/v1/meshes/{id}/vertex-map", tag = "meshes", operation_id = "getVertexMap",
    params(MeshId, MapQuery),
    responses(
        (status = 200, description = "The map", content((MapAnswer = "application/json"), (super::docs::Binary = "application/x-npy"))),
        GetVertexMapProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn vertex_map(
    state: ClientState,
    MeshId(id): MeshId,
    QueryOf(query): QueryOf<MapQuery>,
    headers: HeaderMap,
) -> Result<Answer, Problem> {
    let of = query.of.unwrap_or(Of::File);
    answer(&state, &id, query.format, &headers, move |numbering| MapAnswer {
        of,
        file: numbering.file_vertices(),
        kept: numbering.kept_vertices(),
        identical: numbering.same_vertices(),
        known: !numbering.is_assumed(),
        map: match of {
            Of::File => numbering.vertex_map().collect(),
            Of::Kept => numbering.file_vertex_map().collect(),
        },
    })
    .await
}

problems!(GetFaceMapProblems: [INVALID_QUERY, UNKNOWN_MESH, NOT_ACCEPTABLE, DAMAGED_CONTENT, BUSY]);

/// Gets the map of faces
///
/// For each face of the mesh the face of the uploaded file that it is or is a part of, in NPY as int32; with `of=file`,
/// for each face of the file the first of the mesh, in JSON null and in NPY −1 where it was dropped. A polygon is one
/// face of the file. The boundary of a solid has no faces in the file, and its own numbers stand for them.
#[utoipa::path(
    get, path = "/v1/meshes/{id}/face-map", tag = "meshes", operation_id = "getFaceMap",
    params(MeshId, MapQuery),
    responses(
        (status = 200, description = "The map", content((MapAnswer = "application/json"), (super::docs::Binary = "application/x-npy"))),
        GetFaceMapProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn face_map(
    state: ClientState,
    MeshId(id): MeshId,
    QueryOf(query): QueryOf<MapQuery>,
    headers: HeaderMap,
) -> Result<Answer, Problem> {
    let of = query.of.unwrap_or(Of::Kept);
    answer(&state, &id, query.format, &headers, move |numbering| MapAnswer {
        of,
        file: numbering.file_faces(),
        kept: numbering.kept_faces(),
        identical: numbering.same_faces(),
        known: !numbering.is_assumed(),
        map: match of {
            Of::File => numbering.kept_face_map().collect(),
            Of::Kept => numbering.face_map().map(Some).collect(),
        },
    })
    .await
}

async fn answer(
    state: &ClientState,
    id: &str,
    format: Option<Format>,
    headers: &HeaderMap,
    make: impl FnOnce(&Numbering) -> MapAnswer + Send + 'static,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let npy = match format {
        Some(format) => format == Format::Npy,
        None => extract::negotiated(headers, &[JSON, NPY])? == NPY,
    };
    let numbering = state.store.load_numbering(id).await?;
    state
        .solve("map", move |_| {
            let answer = make(&numbering);
            if !npy {
                return Answer::json(&answer, begin);
            }
            let signed = |number: &Option<u32>| number.map_or(Ok(-1), i32::try_from).map_err(Problem::internal);
            let map = answer.map.iter().map(signed).collect::<Result<Vec<i32>, Problem>>()?;
            let bytes: Vec<u8> = map.iter().flat_map(|number| number.to_le_bytes()).collect();
            Ok(Answer::new(npz::npy("<i4", false, &[map.len()], &bytes), NPY, begin))
        })
        .await
}
