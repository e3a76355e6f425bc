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
use crate::http::problem::Problem;
use crate::http::problems::problems;
use crate::http::state::AppState;
use chladni_work::table::Table;

/// The route of frames.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(frames))
}

problems!(GetFramesProblems: [UNKNOWN_MESH, NOT_ACCEPTABLE, NO_FIELD_SURFACE, BUSY]);

/// Gets the frames of faces
///
/// For each face two orthonormal vectors in its plane, six numbers: x first, then y; their cross product is the normal. Numbers per face of fields
/// refer to them: `a x + b y`. JSON, or with `Accept: application/octet-stream` little-endian f32.
#[utoipa::path(
    get, path = "/v1/meshes/{id}/frames", tag = "fields", operation_id = "getFrames",
    params(MeshId),
    responses(
        (status = 200, description = "The frames: a row for each face", content((Table = "application/json", example = json!({"columns": 6, "values": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]})), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
        GetFramesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn frames(state: ClientState, MeshId(id): MeshId, headers: HeaderMap) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let raw = extract::negotiated(&headers, &[JSON, OCTETS])? == OCTETS;
    let surface = cache::surface(&state, &id).await?;
    state
        .solve("frames", move |_| {
            let frames = surface.surface.frames();
            let both = frames.x_axes().iter().zip(frames.y_axes());
            if !raw {
                let values = both.flat_map(|(x, y)| x.iter().chain(y).copied()).collect();
                return Answer::json(&Table { columns: 6, values }, begin);
            }
            let numbers = both.flat_map(|(x, y)| x.iter().chain(y).map(|&v| v as f32)).collect();
            Ok(Answer::new(octets::to_bytes(numbers), OCTETS, begin)
                .with("chladni-rows", frames.faces())
                .with("chladni-columns", 6)
                .with("chladni-dtype", "f32"))
        })
        .await
}
