//! `GET /meshes/{id}/frames`: the frame of each face.

use std::time::Instant;

use axum::http::HeaderMap;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cache;
use super::octets;
use crate::http::client::ClientState;
use crate::http::docs::Binary;
use crate::http::exchange::{Answer, JSON, OCTETS};
use crate::http::extract;
use crate::http::ids::MeshId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::Problem;
use crate::http::problems::problems;
use crate::http::state::AppState;
use chladni_work::table::Table;

/// The route of frames.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(frames))
}

problems!(GetFramesProblems: [INVALID_QUERY, UNKNOWN_MESH, DAMAGED_CONTENT, NOT_ACCEPTABLE, NO_FIELD_SURFACE, BUSY]);

/// Gets the frames of faces
///
/// For each face two orthonormal vectors in its plane, six numbers: x first, then y; their cross product is the normal.
/// Numbers per face of fields refer to them: `a x + b y`. JSON, or with `Accept: application/octet-stream`
/// little-endian f32.
#[utoipa::path(
    get, path = "/v1/meshes/{id}/frames", tag = "fields", operation_id = "getFrames",
    params(MeshId, NumberingQuery),
    responses(
        (status = 200, description = "The frames: a row for each face", content((Table = "application/json", example = json!({"columns": 6, "values": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]})), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
        GetFramesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn frames(
    state: ClientState,
    MeshId(id): MeshId,
    numbered: Numbered,
    headers: HeaderMap,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let raw = extract::negotiated(&headers, &[JSON, OCTETS])? == OCTETS;
    let surface = cache::surface(&state, &id).await?;
    let to = numbered.on_mesh(&state, &id).await?;
    state
        .solve("frames", move |_| {
            let frames = surface.surface.frames();
            let both = frames.x_axes().iter().zip(frames.y_axes());
            let values: Vec<f64> = both.flat_map(|(x, y)| x.0.into_iter().chain(y.0)).collect();
            let values = to.push_faces(&values, 6);
            if !raw {
                return Answer::json(&Table { columns: 6, values }, begin);
            }
            let numbers = values.iter().map(|&x| x as f32).collect();
            Ok(Answer::new(octets::to_bytes(numbers), OCTETS, begin)
                .with("chladni-rows", to.faces(frames.faces()))
                .with("chladni-columns", 6)
                .with("chladni-dtype", "f32"))
        })
        .await
}
