//! `POST /meshes/{id}/hodge-decomposition`: the parts of a field.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::FactorError;
use chladni_base::Monitor;
use chladni_spectral::field::{HodgeDecomposition, PoissonError};
use chladni_work::design::{DecompositionAnswer, DecompositionRequest};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cache;
use super::design::read;
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::convert::sentence;
use crate::http::exchange::{Answer, JSON};
use crate::http::extract;
use crate::http::ids::MeshId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::{self, Problem};
use crate::http::problems::problems;
use crate::http::state::AppState;

/// The route of decompositions.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(decompose))
}

/// About the bytes of an answer for each number of the field: its parts in frames, as they are written and as they are
/// told, and their text.
const BYTES_PER_NUMBER: u64 = 160;

problems!(DecomposeFieldProblems: BODY JSON [INVALID_QUERY, UNKNOWN_MESH, DAMAGED_CONTENT, NOT_ACCEPTABLE, NO_FIELD_SURFACE, INVALID_DESIGN]);

/// Decomposes a vector field
///
/// The Hodge decomposition of a field that is given on the faces: a gradient, a co-gradient and a harmonic field,
/// orthogonal to each other, by area, to rounding. Gradients are those of functions that are linear on faces,
/// co-gradients those of functions on edges that are not conforming, turned by 90°. Both Laplacians are factored at the
/// first request about a mesh, and kept.
#[utoipa::path(
    post, path = "/v1/meshes/{id}/hodge-decomposition", tag = "fields", operation_id = "decomposeField",
    params(MeshId, NumberingQuery),
    request_body(content = DecompositionRequest, examples(
        ("world" = (summary = "A vector in ℝ³ for each of two faces", value = json!({"field": {"columns": 3, "values": [0.4, 0.3, 0.0, 0.4, 0.3, 0.0]}}))),
    )),
    responses(
        (status = 200, description = "The parts", content((DecompositionAnswer = "application/json")), headers(("Server-Timing" = String))),
        DecomposeFieldProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn decompose(
    state: ClientState,
    MeshId(id): MeshId,
    numbered: Numbered,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    extract::negotiated(&headers, &[JSON])?;
    let mut request: DecompositionRequest = read(&state, &headers, content).await?;
    let surface = cache::surface(&state, &id).await?;
    let to = numbered.on_frames(&state, &id).await?;
    request.translate(&to)?;
    let mut memory = state.memory();
    body::reserve(&mut memory, BYTES_PER_NUMBER * (request.field.columns * surface.surface.faces()) as u64)?;
    let own = surface.clone();
    let boundary = request.boundary;
    let make = move |monitor: &dyn Monitor| {
        let made = HodgeDecomposition::new(&own.surface, boundary, monitor)?;
        let bytes = made.bytes();
        Ok((made, bytes))
    };
    let decomposition = cache::cached(&state, "hodge", &format!("{id} {boundary:?}"), make).await?;
    state
        .solve("decompose", move |monitor| {
            let _memory = memory;
            let answer = request.decompose(&surface.surface, &decomposition)?;
            monitor.checkpoint()?;
            Answer::json(&answer.translated(&to), begin)
        })
        .await
}

impl From<PoissonError> for Problem {
    fn from(error: PoissonError) -> Self {
        match error {
            PoissonError::Cancelled(cancelled) => cancelled.into(),
            PoissonError::Factor(FactorError::Promise { .. }) => {
                Self::within(&problem::INVALID_DESIGN, "memory", sentence(&error))
            }
            PoissonError::OneSided(_) => Self::new(&problem::NO_FIELD_SURFACE, sentence(&error)),
            PoissonError::Flat { face, .. } => {
                Self::new(&problem::NO_FIELD_SURFACE, sentence(&error)).with("face", face)
            }
            PoissonError::Factor(FactorError::Singular { .. }) => super::singular(&sentence(&error)),
            PoissonError::Factor(_) => Self::internal(error),
        }
    }
}
