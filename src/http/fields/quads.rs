//! `POST /meshes/{id}/quads`: a seamless parametrisation along a cross field.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::FactorError;
use chladni_base::Monitor;
use chladni_spectral::field::quad::{QuadError, VertexOrder};
use chladni_work::design::{
    BasisField, CrossSource, Crosses, DesignFault, Quads, QuadsAnswer, QuadsFormat, QuadsRequest,
};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::cache;
use super::design::read;
use super::patience::{self, Patience};
use super::solve::{self, LoadedBasis};
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::convert::sentence;
use crate::http::exchange::{Answer, JSON};
use crate::http::extract::{self, QueryOf};
use crate::http::ids::MeshId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::{self, Problem};
use crate::http::problems::problems;
use crate::http::state::AppState;

/// The route of parametrisations.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(parametrise))
}

/// How long a field and its coordinates are computed within a request.
const PATIENCE: Duration = Duration::from_secs(120);

/// About the bytes of each face: the factors of the field and of the coordinates one after the other, panels of
/// columns, and the answer as numbers and as text.
const BYTES_PER_FACE: u64 = 3000;

const OBJ: &str = "model/obj";
const TEXT: &str = "text/plain";

/// How a parametrisation is written.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct QuadsQuery {
    /// The whole answer as JSON, or one file, of the mesh as it is kept: OBJ with texture coordinates, legacy VTK, or
    /// the field as Directional reads it.
    #[serde(default)]
    #[param(inline, default = "json")]
    format: QuadsFormat,
}

problems!(ParametriseQuadsProblems: SOLVE BODY JSON [UNKNOWN_MESH, UNKNOWN_FIELD, DAMAGED_CONTENT, NO_FIELD_SURFACE, INVALID_DESIGN]);

/// Parametrises a surface along a cross field
///
/// A cross field that runs along creases and boundaries, or one of a basis, or a table, is combed and cut open at its
/// singular vertices, and integrated: coordinates whose gradients are nearest to its directions, and which go on across
/// the cut by quarter turns and translations. With `integers` the lines of whole numbers meet there, so that they are
/// the edges of quads, for a program that takes them out, such as libQEx. The order in which vertices are eliminated is
/// found at the first request about a mesh, and kept.
#[utoipa::path(
    post, path = "/v1/meshes/{id}/quads", tag = "fields", operation_id = "parametriseQuads",
    params(MeshId, NumberingQuery, QuadsQuery),
    request_body(content = QuadsRequest, examples(
        ("creases" = (summary = "Along creases of 35 degrees, with grid lines that meet", value = json!({"field": {"aligned": {"creases": 35.0}}, "spacing": 0.05, "integers": true}))),
        ("seamless" = (summary = "Seamless, along the curvature", value = json!({"field": {"aligned": {"creases": null, "curvature": 100.0}}, "creases": null}))),
    )),
    responses(
        (status = 200, description = "The coordinates", content((QuadsAnswer = "application/json"), (String = "model/obj"), (String = "text/plain")), headers(("Server-Timing" = String))),
        ParametriseQuadsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn parametrise(
    state: ClientState,
    MeshId(id): MeshId,
    numbered: Numbered,
    QueryOf(query): QueryOf<QuadsQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let media_type = match query.format {
        QuadsFormat::Json => JSON,
        QuadsFormat::Obj => OBJ,
        _ => TEXT,
    };
    extract::negotiated(&headers, &[media_type])?;
    let mut request: QuadsRequest = read(&state, &headers, content).await?;
    let surface = cache::surface(&state, &id).await?;
    let to = numbered.on_frames(&state, &id).await?;
    request.field.translate(&to, surface.surface.mesh().positions.len())?;
    if query.format == QuadsFormat::Json {
        Quads::in_numbering_of(&to)?;
    }
    let mut memory = state.memory();
    body::reserve(&mut memory, BYTES_PER_FACE * surface.surface.faces() as u64)?;
    // Positions are made anew where faces are split, and the order with them.
    let (own, asked) = (surface.clone(), request.clone());
    let parts = state.solve("split", move |_| Ok(asked.split(&own.surface)?)).await?;
    let (surface, key, split) = match parts {
        None => (surface, id.clone(), Vec::new()),
        Some(parts) => {
            let key = format!("{id} split {}", blake3::hash(bytemuck::cast_slice(&parts.faces)).to_hex());
            (Arc::new(parts.surface), key, parts.faces)
        }
    };
    let (crosses, spent) = match &request.field {
        CrossSource::Basis(wanted) => (of_basis(&state, &id, numbered, wanted).await?, Duration::ZERO),
        CrossSource::Stored(field) => {
            let (kept, own) = (cache::stored_on(&state, field, &id, "field.stored").await?, surface.clone());
            let names = to.clone();
            let make = move |_: &dyn Monitor| Ok(kept.crosses(&own.surface).map_err(|fault| fault.numbered(&names))?);
            (state.solve("cross", make).await?, Duration::ZERO)
        }
        _ => {
            let (own, field, names) = (surface.clone(), request.field.clone(), to.clone());
            let make = move |monitor: &dyn Monitor| {
                let patient = Patience::new(PATIENCE, monitor);
                let found = field.crosses(&own, &patient).map_err(|fault| too_long(fault.numbered(&names)))?;
                let found = found.ok_or_else(|| Problem::internal("a field of a basis"))?;
                Ok((found, patient.spent()))
            };
            state.solve("cross", make).await?
        }
    };
    let own = surface.clone();
    let make = move |_: &dyn Monitor| {
        let order = VertexOrder::new(&own.surface)?;
        let bytes = order.bytes();
        Ok((order, bytes))
    };
    let order = cache::cached(&state, "order", &key, make).await?;
    state
        .solve("quads", move |monitor| {
            let _memory = memory;
            // One limit for both.
            let patient = Patience::new(PATIENCE.saturating_sub(spent), monitor);
            let quads = request.quads(&surface.surface, crosses, &order, &patient);
            let quads = quads.map_err(|fault| too_long(fault.numbered(&to)))?;
            let quads = Quads { split, ..quads };
            if query.format == QuadsFormat::Json {
                return Answer::json(&quads.answer(&surface.surface, &to)?, begin);
            }
            let mut out = Vec::new();
            quads.write(&surface.surface, query.format, &mut out).map_err(Problem::internal)?;
            Ok(Answer::new(out, media_type, begin))
        })
        .await
}

/// The crosses of a field of a basis on the same mesh.
async fn of_basis(
    state: &ClientState,
    mesh: &str,
    numbered: Numbered,
    wanted: &BasisField,
) -> Result<Crosses, Problem> {
    let refused = |place: &str, reason: String| {
        Problem::within(&problem::INVALID_DESIGN, "basis", format!("field.basis.{place}: {reason}."))
    };
    let id =
        Uuid::parse_str(&wanted.id).map_err(|_| refused("id", format!("{:?} is not the id of a basis", wanted.id)))?;
    let loaded = LoadedBasis::load(state, id).await?;
    let own = state.store.basis(id).await?.mesh;
    if own != mesh {
        return Err(refused("id", format!("the basis lives on the mesh {own}, not on this one")));
    }
    let mut field = wanted.field.clone();
    let to = numbered.on_basis(state, id, &loaded.fields.metadata).await?;
    let loaded = loaded.numbered(&to);
    field.translate(&to, loaded.kind(), loaded.vertices())?;
    let lifted = solve::lifted_with_matching(state, &loaded, &field).await?;
    let crosses = move |_: &dyn Monitor| Ok(lifted.crosses(&loaded.surface.surface));
    let crosses = state.solve("cross", crosses).await?.map_err(|misfit| refused("id", misfit.to_string()))?;
    crosses.ok_or_else(|| {
        refused(
            "id",
            "the fields of the basis do not define crosses: it must be of vectors, n-vectors with n 1, 2 or 4, or tensors"
                .to_owned(),
        )
    })
}

/// What is not computed in time.
fn too_long(fault: DesignFault) -> Problem {
    let undone = "The field and its coordinates were not found";
    let instead = "Ask without integers or for less stiffening, or give the field.";
    patience::too_long("quads", PATIENCE, undone, instead)(fault)
}

impl From<QuadError> for Problem {
    fn from(error: QuadError) -> Self {
        let text = sentence(&error);
        match error {
            QuadError::OneSided(_) => Self::new(&problem::NO_FIELD_SURFACE, text),
            QuadError::NoDirection { face } => {
                Self::within(&problem::INVALID_DESIGN, "direction", text).with("face", face)
            }
            QuadError::Contradiction { face } => {
                Self::within(&problem::INVALID_DESIGN, "contradiction", text).with("face", face)
            }
            QuadError::Face { face, .. } => Self::within(&problem::INVALID_DESIGN, "face", text).with("face", face),
            QuadError::Parameter { name, .. } => {
                Self::within(&problem::INVALID_DESIGN, "quads", text).with("parameter", name)
            }
            QuadError::Zero { .. } | QuadError::Index { .. } | QuadError::Rounding { .. } | QuadError::Seams { .. } => {
                Self::within(&problem::INVALID_DESIGN, "quads", text)
            }
            QuadError::Factor(FactorError::Promise { .. }) => Self::within(&problem::INVALID_DESIGN, "memory", text),
            QuadError::Factor(FactorError::Singular { .. }) => super::singular(&text),
            QuadError::Field { .. } | QuadError::Factor(_) => Self::internal(error),
            QuadError::Cancelled(cancelled) => cancelled.into(),
        }
    }
}
