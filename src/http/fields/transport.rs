//! `POST /meshes/{id}/vector-transport`: vectors carried over a surface.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_base::Monitor;
use chladni_spectral::field::{TransportError, VectorHeat};
use chladni_spectral::operator::transport::FieldKind;
use chladni_work::design::{Form, TransportRequest, carried, written};
use chladni_work::table::Table;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cache;
use super::design::{described, read};
use super::octets::Encoding;
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::docs::Binary;
use crate::http::exchange::{Answer, JSON, OCTETS};
use crate::http::extract::{self, QueryOf};
use crate::http::ids::MeshId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::{self, Problem};
use crate::http::problems::problems;
use crate::http::state::AppState;

/// The route of transport.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(transport))
}

/// How the carried vectors are written.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct TransportQuery {
    /// How the numbers of a face are written.
    #[serde(default)]
    #[param(inline, default = "world")]
    form: Form,
    /// How the numbers of a raw answer are written; JSON has them in single precision.
    #[serde(default)]
    #[param(inline, default = "f32")]
    encoding: Encoding,
}

/// About the bytes of an answer for each face: panels of both heat steps, and the numbers as they are written, told and
/// put into text.
const BYTES_PER_FACE: u64 = 512;

problems!(TransportVectorsProblems: BODY JSON [INVALID_QUERY, UNKNOWN_MESH, DAMAGED_CONTENT, NOT_ACCEPTABLE, NO_FIELD_SURFACE, INVALID_DESIGN]);

/// Carries vectors over a surface
///
/// The vector heat method (Sharp, Soliman and Crane 2019): each face gets the vector of the nearest source, carried
/// there in parallel along a path that is about the shortest: on spheres, away from the point opposite to the source,
/// it is off by about half a degree on average, which falls only slowly as faces shrink, because the directions in
/// which heat crosses edges are not consistent. Both heat steps are factored at the first request about a mesh, and
/// kept. JSON, or with `Accept: application/octet-stream` raw little-endian numbers.
#[utoipa::path(
    post, path = "/v1/meshes/{id}/vector-transport", tag = "fields", operation_id = "transportVectors",
    params(MeshId, NumberingQuery, TransportQuery),
    request_body(content = TransportRequest, examples(
        ("one" = (summary = "One vector", value = json!({"sources": [{"face": 17, "direction": [0.0, 0.0, 1.0]}]}))),
    )),
    responses(
        (status = 200, description = "The vectors: a row for each face", content((Table = "application/json", example = json!({"columns": 3, "values": [0.0, 0.1, 0.99]})), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        TransportVectorsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn transport(
    state: ClientState,
    MeshId(id): MeshId,
    numbered: Numbered,
    QueryOf(query): QueryOf<TransportQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let raw = extract::negotiated(&headers, &[JSON, OCTETS])? == OCTETS;
    let request: TransportRequest = read(&state, &headers, content).await?;
    let surface = cache::surface(&state, &id).await?;
    let to = numbered.on_mesh(&state, &id).await?;
    let sources = request.resolve(&surface, &to)?;
    let own = surface.clone();
    let make = move |monitor: &dyn Monitor| {
        let made = VectorHeat::new(&own.surface, monitor)?;
        let bytes = made.bytes();
        Ok((made, bytes))
    };
    let heat = cache::cached(&state, "vector-heat", &id, make).await?;
    let mut memory = state.memory();
    body::reserve(&mut memory, BYTES_PER_FACE * surface.surface.faces() as u64)?;
    state
        .solve("transport", move |_| {
            let _memory = memory;
            let (kind, form, frames) = (FieldKind::Vector {}, query.form, surface.surface.frames());
            let numbers = written(frames, kind, form, carried(&heat, &sources, &to)?);
            let numbers = to.push_faces(&numbers, form.columns(kind));
            if raw {
                let rows = to.faces(frames.faces());
                let bytes = query.encoding.bytes(numbers, form.columns(kind), |row| row as u32)?;
                return Ok(described(bytes, rows, (form, query.encoding), kind, begin));
            }
            let values = numbers.into_iter().map(f64::from).collect();
            Answer::json(&Table { columns: form.columns(kind), values }, begin)
        })
        .await
}

impl From<TransportError> for Problem {
    fn from(error: TransportError) -> Self {
        let text = crate::http::convert::sentence(&error);
        match error {
            TransportError::Surface(error) => error.into(),
            TransportError::Heat(error) => error.into(),
            TransportError::NoSource => Self::within(&problem::INVALID_DESIGN, "no-data", text),
            TransportError::OutOfReach { face } => {
                Self::within(&problem::INVALID_DESIGN, "reach", text).with("face", face)
            }
            TransportError::Cancelling { face } => {
                Self::within(&problem::INVALID_DESIGN, "sources", text).with("face", face)
            }
        }
    }
}
