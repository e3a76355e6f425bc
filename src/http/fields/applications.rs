//! What is made of designed fields: fur and hatchings.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_work::design::{FurRequest, HatchingAnswer, HatchingRequest, Line};
use chladni_work::table::Table;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::design::read;
use super::octets;
use super::patience::{self, Patience};
use super::solve::{self, LoadedBasis};
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::docs::Binary;
use crate::http::exchange::{Answer, JSON, OCTETS};
use crate::http::extract;
use crate::http::ids::BasisId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::Problem;
use crate::http::problems::problems;
use crate::http::state::AppState;

/// The routes of applications.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(comb)).routes(routes!(hatch))
}

const SVG: &str = "image/svg+xml";
const PNG: &str = "image/png";

/// What to do where a picture takes too long.
const FUR: &str =
    "Ask for fewer strands, fewer points or a smaller picture, or paint it without a server: chladni fur.";
const HATCHING: &str = "Ask for a larger spacing, fewer lines, fewer levels or a smaller picture, or draw it without a server: chladni hatching.";

problems!(CombFurProblems: SOLVE BODY JSON [UNKNOWN_FIELD, INVALID_DESIGN, NO_FIELD_SURFACE]);

/// Combs fur
///
/// For each face a strand that leans along a vector field: its root (the barycentre of the face) and its tip relative
/// to the root, six numbers in the units of the mesh, for a renderer. With `strands` so many, spread by area, that
/// bend, fall and gather in tufts: three numbers for each of their points, the root first. JSON, or with
/// `Accept: application/octet-stream` little-endian f32; with `Accept: image/png` a picture of them.
#[utoipa::path(
    post, path = "/v1/bases/{id}/fur", tag = "fields", operation_id = "combFur",
    params(BasisId, NumberingQuery),
    request_body(content = FurRequest, examples(
        ("by area" = (summary = "Strands by area that fall", value = json!({"field": {"eigenfield": 0}, "length": 0.05, "strands": 2000, "points": 6, "gravity": 0.3}))),
        ("strokes" = (summary = "Combed by a stroke", value = json!({"field": {"design": {"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}]}}, "length": 0.05, "tilt": 1.1, "full": 0.5}))),
    )),
    responses(
        (status = 200, description = "The strands: a row for each face, or for each of `strands`", content((Table = "application/json", example = json!({"columns": 6, "values": [0.1, 0.2, 0.3, 0.0, 0.01, 0.04]})), (Binary = "application/octet-stream"), (Binary = "image/png")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
        CombFurProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn comb(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let accepted = extract::negotiated(&headers, &[JSON, OCTETS, PNG])?;
    let (raw, painted) = (accepted == OCTETS, accepted == PNG);
    let mut request: FurRequest = read(&state, &headers, content).await?;
    if !painted {
        request.check_numbers()?;
    }
    let loaded = LoadedBasis::load(&state, id).await?;
    let to = numbered.on_basis(&state, id, &loaded.fields.metadata).await?;
    let loaded = loaded.numbered(&to);
    request.translate(&to, loaded.kind(), loaded.vertices())?;
    request.check(&loaded)?;
    let field = solve::lifted(&state, &loaded, &request.field).await?;
    let by_area = painted || request.strands.is_some();
    let mut memory = state.memory();
    if by_area {
        body::reserve(&mut memory, request.bytes(painted))?;
    }
    state
        .solve("fur", move |monitor| {
            let _memory = memory;
            if by_area {
                let monitor = Patience::new(patience::USUAL, monitor);
                let too_long = patience::too_long("fur", patience::USUAL, "The fur was not grown and painted", FUR);
                let coat = request.coat(&loaded, &field, &monitor).map_err(&too_long)?;
                if painted {
                    let picture = request.picture(&loaded, &coat, &monitor).map_err(&too_long)?;
                    return Ok(Answer::new(picture, PNG, begin).with("chladni-strands", coat.faces.len()));
                }
                let (rows, columns) = (coat.positions.concat(), 3 * coat.points);
                return strands_answer(rows, columns, raw, begin);
            }
            let strands = request.strands(&loaded, &field)?;
            let rows: Vec<f64> = strands.iter().flat_map(|strand| strand.root.into_iter().chain(strand.tip)).collect();
            strands_answer(to.push_faces(&rows, 6), 6, raw, begin)
        })
        .await
}

/// A row for each strand, as JSON or raw.
fn strands_answer(rows: Vec<f64>, columns: usize, raw: bool, begin: Instant) -> Result<Answer, Problem> {
    if !raw {
        return Answer::json(&Table { columns, values: rows }, begin);
    }
    let strands = rows.len() / columns.max(1);
    Ok(Answer::new(octets::to_bytes(rows.into_iter().map(|x| x as f32).collect()), OCTETS, begin)
        .with("chladni-rows", strands)
        .with("chladni-columns", columns)
        .with("chladni-dtype", "f32"))
}

problems!(DrawHatchingProblems: SOLVE BODY JSON [UNKNOWN_FIELD, INVALID_DESIGN, NO_FIELD_SURFACE]);

/// Draws a hatching
///
/// Evenly spaced streamlines of a field (Jobard and Lefer 1997): of n-fields they follow any of the n directions, of
/// tensor fields the eigendirections. As polylines on the surface, or with `Accept: image/svg+xml` or `image/png` as a
/// drawing from a camera, without what the surface hides: with more lines where it is darker, crossed ones only in
/// shadows, and with silhouettes.
#[utoipa::path(
    post, path = "/v1/bases/{id}/hatching", tag = "fields", operation_id = "drawHatching",
    params(BasisId, NumberingQuery),
    request_body(content = HatchingRequest, examples(
        ("curvature" = (summary = "A 2-field along smoothed principal directions", value = json!({"field": {"design": {"weights": {"harmonic": 0.1}, "alignment": {"to": "curvature", "weight": 1.0, "per_face": "anisotropy"}}}, "spacing": 0.02, "camera": {"eye": [0.0, 0.0, 5.0], "target": [0.0, 0.0, 0.0], "width": 800, "height": 800}}))),
    )),
    responses(
        (status = 200, description = "The lines", content((HatchingAnswer = "application/json"), (String = "image/svg+xml"), (Binary = "image/png"))),
        DrawHatchingProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn hatch(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let accepted = extract::negotiated(&headers, &[JSON, SVG, PNG])?;
    let drawn = accepted != JSON;
    let mut request: HatchingRequest = read(&state, &headers, content).await?;
    let mut memory = state.memory();
    request.check(accepted == PNG)?;
    if drawn {
        body::reserve(&mut memory, request.bytes())?;
    }
    let loaded = LoadedBasis::load(&state, id).await?;
    let to = numbered.on_basis(&state, id, &loaded.fields.metadata).await?;
    let loaded = loaded.numbered(&to);
    request.field.translate(&to, loaded.kind(), loaded.vertices())?;
    let field = solve::lifted(&state, &loaded, &request.field).await?;
    state
        .solve("hatching", move |monitor| {
            let _memory = memory;
            let monitor = Patience::new(patience::USUAL, monitor);
            let too_long =
                patience::too_long("hatching", patience::USUAL, "The lines were not laid and drawn", HATCHING);
            if !drawn {
                let lines = request.lines(&loaded, field, &monitor).map_err(&too_long)?;
                let mut lines: Vec<Line> = lines.into_iter().map(Line::from).collect();
                lines.iter_mut().flat_map(|line| &mut line.faces).for_each(|face| *face = to.file_face(*face));
                return Answer::json(&HatchingAnswer { lines }, begin);
            }
            let (drawing, lines) = request.drawing(&loaded, field, &monitor).map_err(&too_long)?;
            let bytes = match accepted {
                PNG => drawing.png().ok_or_else(|| Problem::internal("a drawing without a size"))?,
                _ => drawing.svg().into_bytes(),
            };
            Ok(Answer::new(bytes, accepted, begin).with("chladni-lines", lines))
        })
        .await
}
