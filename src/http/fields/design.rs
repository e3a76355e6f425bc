//! `POST /bases/{id}/design`: the field of least energy under strokes, constraints and an alignment.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use bytes::Bytes;
use chladni_spectral::field::{Singularity, matched_singularities};
use chladni_work::design::{DesignRequest, Form, MatchedFaces, SingularVertex, written as written_as, written_at};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::octets::Encoding;
use super::solve::{self, LoadedBasis};
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::docs::Binary;
use crate::http::exchange::{self, Answer, OCTETS, answer_type};
use crate::http::extract::{self, QueryOf};
use crate::http::ids::BasisId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::Problem;
use crate::http::problems::problems;
use crate::http::state::AppState;

/// The route of design.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(design))
}

/// What is to be told of a designed field.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct DesignQuery {
    /// Lifts the field to the faces and says how it is written. Without it JSON has the coefficients alone; raw
    /// answers, and those to requests with `faces`, are in `world` form.
    #[param(inline)]
    form: Option<Form>,
    /// Whether to tell the singular vertices. Takes a pass over all vertices.
    #[serde(default)]
    singularities: bool,
    /// How the numbers of a raw answer are written; JSON has them in single precision.
    #[serde(default)]
    #[param(inline, default = "f32")]
    encoding: Encoding,
}

/// A lifted field.
#[derive(Debug, Serialize, ToSchema)]
pub struct LiftedField {
    /// How it is written.
    #[schema(example = "world")]
    pub form: &'static str,
    /// Numbers per face.
    pub columns: usize,
    /// The faces, where the request has `faces`; otherwise all, in their order.
    pub faces: Option<Vec<u32>>,
    /// Values, face after face.
    pub values: Vec<f32>,
}

/// A designed field.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "coefficients": [0.31, -0.02], "harmonic_energy": 4.81, "biharmonic_energy": 122.4, "alignment_energy": null,
    "faces": [17, 4031], "residuals": [0.013, 0.0], "space": "surface", "error": 0.011, "field": null,
    "singularities": [{"vertex": 88, "index": 1.0}, {"vertex": 2101, "index": 1.0}], "index_sum": 2.0, "euler_characteristic": 2, "matching": null
}))]
struct DesignAnswer {
    /// Coefficients in the space.
    coefficients: Vec<f32>,
    /// The harmonic energy of the field, on the surface of unit area.
    harmonic_energy: f64,
    /// The biharmonic energy, on the surface of unit area.
    biharmonic_energy: f64,
    /// The squared deviation from what the field is aligned to, on the surface of unit area.
    alignment_energy: Option<f64>,
    /// The face of each constraint, strokes first.
    faces: Vec<u32>,
    /// For each constraint the length of what is missing, in stored numbers.
    residuals: Vec<f64>,
    /// Which fields the field is the one of least energy of: `surface`, all fields of the surface, or `basis`, those of
    /// the space.
    #[schema(example = "surface")]
    space: &'static str,
    /// How far the field of the coefficients is from that of least energy among all fields of the surface, as a share
    /// of its length (norms by area). Where that field is the answer, this is the distance; else with `error` an
    /// estimate of it, and without null.
    error: Option<f64>,
    /// The field on the faces, where `form` asks for it.
    field: Option<LiftedField>,
    /// The singular vertices inside the surface with their indices, where they are asked for.
    singularities: Option<Vec<SingularVertex>>,
    /// The sum of the indices: the Euler characteristic where the surface is closed.
    index_sum: Option<f64>,
    /// The Euler characteristic of the surface.
    euler_characteristic: Option<i64>,
    /// With `exact` singularities the pairs of neighbouring faces across which the field turns by more than half a
    /// turn; all others match by the least angle.
    matching: Option<Vec<MatchedFaces>>,
}

problems!(DesignFieldProblems: SOLVE BODY JSON [UNKNOWN_FIELD, INVALID_DESIGN, NO_FIELD_SURFACE]);

/// Designs a field
///
/// The field of least energy `w₁ · harmonic + w₂ · biharmonic` in the space that deviates little from strokes and an
/// alignment, by their weights, and meets hard constraints exactly (Schur complement). Strokes and constraints name a
/// face, or a point whose nearest face is meant, and a direction in ℝ³ or in the frame of the face
/// (`GET /meshes/{id}/frames`); a stroke may be a line of points as well. Everything is sent again with each request:
/// what does not change is kept by the server, a moved stroke costs one small solve. Send requests over one kept
/// connection.
///
/// Where the memory that is kept for fields (`--cache-bytes`) holds two sparse factors of the surface the field is the
/// one of least energy among all fields of the surface; energies and residuals are its own, coefficients are those of
/// the field of the space that is nearest to it, and `error` is how far that is. On larger surfaces, and with
/// `"space": "basis"`, it is a field of the space of the basis, which stands for that one: with `error` the answer says
/// how far it is from it, with `refine` that one is the answer, to a tolerance. `space` in the answer says which of
/// both it is.
///
/// With `Accept: application/octet-stream` the answer is the lifted field as little-endian f32, f16 or octahedral
/// directions (`encoding`), face after face, with its shape in `Chladni-Rows` and `Chladni-Columns`, the energies in
/// `Chladni-Energies` (harmonic, biharmonic, alignment), the largest residual of a constraint in `Chladni-Residual`,
/// `space` in `Chladni-Space`, where the request has `error` that in `Chladni-Error`, and with `exact` singularities in
/// `Chladni-Matching` how many pairs of faces `matching` of the JSON answer has: where that is not 0, the numbers alone
/// do not tell where the field is singular. `faces` restricts it to
/// some: 3,000 faces of a sample are 36,000 bytes, half of that in f16, a third as octahedral directions, whatever the
/// surface. Which faces a sample has is in `field.faces` of a JSON answer, and stays the same.
#[utoipa::path(
    post, path = "/v1/bases/{id}/design", tag = "fields", operation_id = "designField",
    params(BasisId, NumberingQuery, DesignQuery),
    request_body(content = DesignRequest, examples(
        ("strokes" = (summary = "Two strokes, one of them a line", value = json!({"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}, {"points": [[0.1, 0.2, 0.9], [0.2, 0.2, 0.9], [0.3, 0.1, 0.9]], "strength": 0.5}]}))),
        ("interpolation" = (summary = "Directions that are met exactly, aligned to curvature elsewhere", value = json!({"constraints": [{"face": 17, "direction": [0.0, 0.0, 1.0]}, {"point": [0.4, 0.0, 0.8], "direction": [1.0, 0.0, 0.0]}], "alignment": {"to": "curvature", "weight": 2.0, "per_face": "anisotropy"}}))),
        ("smoothing" = (summary = "Smoothed curvature tensors: the weights steer how smooth", value = json!({"weights": {"harmonic": 0.01, "biharmonic": 0.0001}, "alignment": {"to": "curvature", "weight": 1.0}}))),
        ("sample" = (summary = "A sample of faces, and how far the design is from that of the whole surface", value = json!({"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}], "faces": {"sample": 3000}, "error": true}))),
        ("refined" = (summary = "The field of a large surface, not only of the basis", value = json!({"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}], "refine": 1e-8}))),
        ("singularities" = (summary = "Singular vertices at will", value = json!({"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}], "singularities": {"at": [{"vertex": 88, "index": 1.0}, {"vertex": 2101, "index": 1.0}], "exact": true}}))),
    )),
    responses(
        (status = 200, description = "The field", content((DesignAnswer = "application/json"), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Chladni-Energies" = String), ("Chladni-Residual" = f64), ("Chladni-Space" = String), ("Chladni-Error" = f64), ("Chladni-Matching" = u64), ("Server-Timing" = String))),
        DesignFieldProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn design(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<DesignQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let raw = answer_type(&headers, false, &[])? == OCTETS;
    let mut request: DesignRequest = read(&state, &headers, content).await?;
    let loaded = LoadedBasis::load(&state, id).await?;
    let to = numbered.on_basis(&state, id, &loaded.fields.metadata).await?;
    let loaded = loaded.numbered(&to);
    request.translate(&to, loaded.kind(), loaded.vertices())?;
    let form = query.form.or((raw || request.faces.is_some()).then_some(Form::World));
    form.filter(|_| raw).map_or(Ok(()), |form| query.encoding.check(loaded.kind(), form))?;
    // Raw answers have no coefficients, and tell how far these are off only where that is asked for.
    let designed = solve::design_with(&state, &loaded, &request, !raw || request.error).await?;
    let some = match &request.faces {
        None => None,
        Some(wanted) => Some(solve::faces(&state, &loaded, wanted).await?),
    };
    state
        .solve("lift", move |_| {
            let (kind, surface) = (loaded.kind(), &loaded.surface.surface);
            let sought = query.singularities && !raw;
            let is_whole = sought || (form.is_some() && some.is_none());
            let field = if is_whole { loaded.lifted(&designed)? } else { Vec::new() };
            let part = some.as_deref().map(|faces| loaded.lifted_at(&designed, faces)).transpose()?;
            let space = if designed.refined.is_some() { "surface" } else { "basis" };
            let design = designed.design;
            let matching = designed.exact.map(|exact| exact.matching);
            let found = match sought {
                false => None,
                true => {
                    let matching = matching.as_deref().unwrap_or_default();
                    Some(matched_singularities(surface, kind, &field, matching).map_err(Problem::internal)?)
                }
            };
            let rows = some.as_deref().map_or(to.faces(surface.faces()), Vec::len);
            let written = |form: Form| match (&some, part) {
                (Some(faces), Some(part)) => written_at(surface.frames(), kind, form, faces, part),
                _ => to.push_faces(&written_as(surface.frames(), kind, form, field), form.columns(kind)),
            };
            if let (true, Some(form)) = (raw, form) {
                let energies = [Some(design.harmonic_energy), Some(design.biharmonic_energy), design.alignment_energy];
                let energies: Vec<String> = energies.iter().flatten().map(f64::to_string).collect();
                let residual = design.residuals.iter().copied().fold(0.0, f64::max);
                let named = |row: usize| some.as_deref().map_or(row as u32, |faces| to.file_face(faces[row]));
                let bytes = query.encoding.bytes(written(form), form.columns(kind), named)?;
                let answer = described(bytes, rows, (form, query.encoding), kind, begin)
                    .with("chladni-energies", energies.join(", "))
                    .with("chladni-residual", residual)
                    .with("chladni-space", space);
                let answer = match matching {
                    Some(matching) => answer.with("chladni-matching", matching.len()),
                    None => answer,
                };
                return Ok(match designed.error {
                    Some(error) => answer.with("chladni-error", error),
                    None => answer,
                });
            }
            Answer::json(
                &DesignAnswer {
                    harmonic_energy: design.harmonic_energy,
                    biharmonic_energy: design.biharmonic_energy,
                    alignment_energy: design.alignment_energy,
                    faces: designed.constraints.iter().map(|constraint| to.file_face(constraint.face)).collect(),
                    residuals: design.residuals,
                    space,
                    error: designed.error,
                    coefficients: design.coefficients,
                    field: form.map(|form| LiftedField {
                        form: form.name(),
                        columns: form.columns(kind),
                        faces: some.as_ref().map(|faces| faces.iter().map(|&face| to.file_face(face)).collect()),
                        values: written(form),
                    }),
                    // A sum of whole numbers: without singular vertices it is 0, not -0.
                    index_sum: found.as_ref().map(|found| {
                        f64::from(found.iter().map(|s| s.numerator).sum::<i32>()) / f64::from(kind.order().max(1))
                    }),
                    euler_characteristic: found.is_some().then(|| surface.dual().euler_characteristic()),
                    matching: matching.map(|matching| MatchedFaces::in_file_faces(&matching, &to)),
                    singularities: found.map(|found| {
                        let told =
                            |s: &Singularity| SingularVertex { vertex: to.file_vertex(s.vertex), index: s.index() };
                        found.iter().map(told).collect()
                    }),
                },
                begin,
            )
        })
        .await
}

/// A raw answer with its shape.
pub fn described(
    bytes: impl Into<Bytes>,
    faces: usize,
    (form, encoding): (Form, Encoding),
    kind: chladni_spectral::operator::transport::FieldKind,
    begin: Instant,
) -> Answer {
    Answer::new(bytes, OCTETS, begin)
        .with("chladni-rows", faces)
        .with("chladni-columns", encoding.columns(form.columns(kind)))
        .with("chladni-dtype", encoding.name())
        .with("chladni-form", form.name())
}

/// Reads a JSON body.
pub async fn read<T: serde::de::DeserializeOwned + Send + 'static>(
    state: &ClientState,
    headers: &HeaderMap,
    content: Body,
) -> Result<T, Problem> {
    extract::require_json(headers)?;
    let body = body::read(state, headers, content, state.config.limits.max_body_bytes).await?;
    exchange::parse(state, body, exchange::BYTES_PER_NUMBER).await
}
