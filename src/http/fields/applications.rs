//! What is made of designed fields: fur and hatchings.

use std::time::{Duration, Instant};

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_base::{Cancelled, Monitor};
use chladni_spectral::field::{Camera, HatchingParameters, Streamline, fur, streamlines, svg, tensor_deviator};
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::design::read;
use super::forms;
use super::request::{DesignRequest, refused};
use super::solve::{self, Ready};
use crate::http::binary::Table;
use crate::http::client::ClientState;
use crate::http::docs::Binary;
use crate::http::exchange::{Answer, JSON, OCTETS};
use crate::http::extract;
use crate::http::ids::BasisId;
use crate::http::problem::Problem;
use crate::http::problems::problems;
use crate::http::state::AppState;

/// The routes of applications.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(comb)).routes(routes!(hatch))
}

const SVG: &str = "image/svg+xml";

/// How long lines are laid within a request.
const PATIENCE: Duration = Duration::from_secs(20);

/// Which field: exactly one of the three.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Source {
    /// A field that is designed now.
    Design(DesignRequest),
    /// Coefficients that a design gave.
    Coefficients(Vec<f32>),
    /// An approximate eigenfield, counted from 0.
    Eigenfield(usize),
}

impl Source {
    /// The stored numbers of all faces.
    async fn lifted(self, state: &ClientState, ready: &Ready) -> Result<Vec<f32>, Problem> {
        let coefficients = match self {
            Self::Design(request) => solve::design(state, ready, &request).await?.design.coefficients,
            Self::Coefficients(given) => {
                let (found, wanted) = (given.len(), ready.fields.dimension());
                if found != wanted || !given.iter().all(|x| x.is_finite()) {
                    let reason = format!("{found} numbers are given where {wanted} finite ones are due");
                    return Err(refused("coefficients", "field.coefficients", reason));
                }
                given
            }
            Self::Eigenfield(k) => {
                let model = ready.model()?;
                if k >= model.dimension() {
                    let reason = format!("{k} is not there; the basis has {}", model.dimension());
                    return Err(refused("eigenfield", "field.eigenfield", reason));
                }
                model.eigenfield(k)
            }
        };
        let ready = ready.clone();
        state.solve("lift", move |_| ready.lift(&coefficients)).await
    }
}

/// A coat of fur: one strand for each face.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct FurRequest {
    /// `{"design": …}`, `{"coefficients": […]}` or `{"eigenfield": k}`.
    field: Source,
    /// The length of strands in the units of the mesh.
    length: f64,
    /// A factor of the length for each face.
    #[serde(default)]
    lengths: Option<Vec<f32>>,
    /// How far strands lean at most, in radians from the normal.
    #[serde(default = "one")]
    #[schema(default = 1.0)]
    tilt: f64,
    /// The length of the field at which strands lean that far.
    #[serde(default = "one")]
    #[schema(default = 1.0)]
    full: f64,
}

fn one() -> f64 {
    1.0
}

problems!(CombFurProblems: SOLVE BODY JSON [INVALID_DESIGN, NO_FIELD_SURFACE]);

/// Combs fur
///
/// For each face a strand that leans along a vector field: its root (the barycentre of the face) and its tip relative to the root, six numbers in
/// the units of the mesh, for a renderer. JSON, or with `Accept: application/octet-stream` little-endian f32.
#[utoipa::path(
    post, path = "/v1/bases/{id}/fur", tag = "fields", operation_id = "combFur",
    params(BasisId),
    request_body(content = FurRequest, examples(
        ("strokes" = (summary = "Combed by a stroke", value = json!({"field": {"design": {"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}]}}, "length": 0.05, "tilt": 1.1, "full": 0.5}))),
    )),
    responses(
        (status = 200, description = "The strands: a row for each face", content((Table = "application/json", example = json!({"columns": 6, "values": [0.1, 0.2, 0.3, 0.0, 0.01, 0.04]})), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
        CombFurProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn comb(state: ClientState, BasisId(id): BasisId, headers: HeaderMap, content: Body) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let raw = extract::negotiated(&headers, &[JSON, OCTETS])? == OCTETS;
    let request: FurRequest = read(&state, &headers, content).await?;
    let ready = Ready::load(&state, id).await?;
    if !matches!(ready.kind(), FieldKind::Vector {} | FieldKind::NVector { n: 1 }) {
        return Err(refused("fur", "field", "fur needs a basis of vector fields"));
    }
    let faces = ready.surface.surface.faces();
    if let Some(found) = request.lengths.as_ref().map(Vec::len).filter(|&found| found != faces) {
        return Err(refused("fur", "lengths", format!("{found} factors are given for {faces} faces")));
    }
    let field = request.field.lifted(&state, &ready).await?;
    state
        .solve("fur", move |_| {
            let (length, tilt, full) = (request.length, request.tilt, request.full);
            let strands = fur(&ready.surface.surface, &field, length, tilt, full).ok_or_else(|| {
                refused("fur", "length, tilt, full", "finite numbers are due, and full must be greater than 0")
            })?;
            let factor = |face: usize| request.lengths.as_ref().map_or(1.0, |lengths| f64::from(lengths[face]));
            let rows = strands
                .iter()
                .enumerate()
                .flat_map(|(face, strand)| strand.root.into_iter().chain(strand.tip.map(|x| x * factor(face))));
            if !raw {
                return Answer::json(&Table { columns: 6, values: rows.collect() }, begin);
            }
            Ok(Answer::new(forms::to_bytes(rows.map(|x| x as f32).collect()), OCTETS, begin)
                .with("chladni-rows", strands.len())
                .with("chladni-columns", 6)
                .with("chladni-dtype", "f32"))
        })
        .await
}

/// How lines are laid and drawn.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct HatchingRequest {
    /// `{"design": …}`, `{"coefficients": […]}` or `{"eigenfield": k}`.
    field: Source,
    /// The distance between lines, in units of the square root of the surface's area.
    #[schema(default = 0.01)]
    spacing: Option<f64>,
    /// Shorter lines are left out, in multiples of the spacing.
    #[schema(default = 2.0)]
    least_length: Option<f64>,
    /// Lines at most.
    #[schema(default = 100_000)]
    most_lines: Option<usize>,
    /// Where an SVG is seen from; needed for one.
    #[serde(default)]
    camera: Option<CameraRequest>,
    /// The width of lines of an SVG.
    #[serde(default = "one")]
    #[schema(default = 1.0)]
    stroke: f64,
}

/// Where a drawing is seen from, in the units of the mesh.
#[derive(Debug, Clone, Copy, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct CameraRequest {
    /// The eye.
    eye: [f64; 3],
    /// What it looks at.
    target: [f64; 3],
    /// What is up in the drawing.
    #[serde(default = "upwards")]
    up: [f64; 3],
    /// The vertical angle of view in degrees.
    #[serde(default = "thirty")]
    #[schema(default = 30.0)]
    angle: f64,
    /// Width of the drawing.
    width: u32,
    /// Height of the drawing.
    height: u32,
}

fn upwards() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn thirty() -> f64 {
    30.0
}

/// A hatching.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"lines": [{"points": [[0.1, 0.2, 0.3], [0.11, 0.2, 0.3]], "faces": [17]}]}))]
struct HatchingAnswer {
    /// The lines, in the order in which they were laid.
    lines: Vec<Line>,
}

/// A line on the surface.
#[derive(Debug, Serialize, ToSchema)]
struct Line {
    /// Its points in the units of the mesh: one for each edge that it crosses, and its ends.
    points: Vec<[f64; 3]>,
    /// The face that each piece lies in: one fewer than points.
    faces: Vec<u32>,
}

impl From<Streamline> for Line {
    fn from(line: Streamline) -> Self {
        Self { points: line.points, faces: line.faces }
    }
}

/// Ends work after a while, or when nobody waits for it.
struct Patience<'a>(Instant, &'a dyn Monitor);

impl Monitor for Patience<'_> {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.0.elapsed() < PATIENCE { self.1.checkpoint() } else { Err(Cancelled) }
    }
}

problems!(DrawHatchingProblems: SOLVE BODY JSON [INVALID_DESIGN, NO_FIELD_SURFACE]);

/// Draws a hatching
///
/// Evenly spaced streamlines of a field (Jobard and Lefer 1997): of n-fields they follow any of the n directions, of tensor fields the
/// eigendirections. As polylines on the surface, or with `Accept: image/svg+xml` as a drawing from a camera, without what the surface hides.
#[utoipa::path(
    post, path = "/v1/bases/{id}/hatching", tag = "fields", operation_id = "drawHatching",
    params(BasisId),
    request_body(content = HatchingRequest, examples(
        ("curvature" = (summary = "A 2-field along smoothed principal directions", value = json!({"field": {"design": {"weights": {"harmonic": 0.1}, "alignment": {"to": "curvature", "weight": 1.0, "per_face": "anisotropy"}}}, "spacing": 0.02, "camera": {"eye": [0.0, 0.0, 5.0], "target": [0.0, 0.0, 0.0], "width": 800, "height": 800}}))),
    )),
    responses(
        (status = 200, description = "The lines", content((HatchingAnswer = "application/json"), (String = "image/svg+xml"))),
        DrawHatchingProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn hatch(state: ClientState, BasisId(id): BasisId, headers: HeaderMap, content: Body) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let drawn = extract::negotiated(&headers, &[JSON, SVG])? == SVG;
    let request: HatchingRequest = read(&state, &headers, content).await?;
    if drawn && request.camera.is_none() {
        return Err(refused("camera", "camera", "an SVG needs one"));
    }
    let ready = Ready::load(&state, id).await?;
    let field = request.field.lifted(&state, &ready).await?;
    let usual = HatchingParameters::default();
    let parameters = HatchingParameters {
        spacing: request.spacing.unwrap_or(usual.spacing),
        least_length: request.least_length.unwrap_or(usual.least_length),
        most_lines: request.most_lines.unwrap_or(usual.most_lines),
    };
    let (camera, stroke) = (request.camera, request.stroke);
    state
        .solve("hatching", move |monitor| {
            let surface = &ready.surface.surface;
            let (n, field) = match ready.kind() {
                FieldKind::Tensor {} => (2, deviators(&field)),
                kind => (kind.order(), field),
            };
            let lines = streamlines(surface, n, &field, &parameters, &Patience(begin, monitor))?;
            let Some(camera) = camera.filter(|_| drawn) else {
                return Answer::json(&HatchingAnswer { lines: lines.into_iter().map(Line::from).collect() }, begin);
            };
            let CameraRequest { eye, target, up, angle, width, height } = camera;
            let drawing = svg(surface.mesh(), &lines, &Camera { eye, target, up, angle, width, height }, stroke);
            let nowhere =
                || refused("camera", "camera", "it looks nowhere, or its drawing has no size or is too large");
            Ok(Answer::new(drawing.ok_or_else(nowhere)?.into_bytes(), SVG, begin).with("chladni-lines", lines.len()))
        })
        .await
}

/// The 2-field of the eigendirections of tensors.
fn deviators(tensors: &[f32]) -> Vec<f32> {
    let deviator = |t: &[f32; 3]| tensor_deviator(t.map(f64::from)).map(|x| x as f32);
    tensors.as_chunks::<3>().0.iter().flat_map(deviator).collect()
}
