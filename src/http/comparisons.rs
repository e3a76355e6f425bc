//! Shapes compared by their spectra.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_spectral::analysis::scatter;
use chladni_spectral::analysis::shape_dna::{Comparison, MOST_SHAPES, Scale, Spectrum, Weighting, compare, kernel_of};
use chladni_spectral::analysis::signature::nearest_items;
use chladni_spectral::basis::ProductKind;
use chladni_work::mappable::{SpectrumOf, Unlike, check_alike};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::find_kind;
use super::binary::{self, Dtype, Table};
use super::body;
use super::client::ClientState;
use super::convert::sentence;
use super::exchange::{self, Answer, OCTETS};
use super::extract::{self, QueryOf};
use super::ids::BasisId;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use crate::store::{BasisRecord, MeshRecord};

const SVG: &str = "image/svg+xml";

/// The most bytes of a request: some hundred ids and labels.
const MOST_BYTES: u64 = 1 << 20;

/// The route of comparisons.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(compare_shapes))
}

/// What makes spectra of shapes of any size comparable.
#[derive(Debug, Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum ScaleName {
    /// Times the area of the surface.
    #[default]
    Area,
    /// Divided by the first eigenvalue above the kernel, which has to be above zero.
    First,
    /// As they are: size matters.
    None,
}

/// How much each eigenvalue counts.
#[derive(Debug, Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum WeightingName {
    /// Divided by its index, so that all count about the same.
    #[default]
    Index,
    /// As they are.
    None,
}

/// Which shapes, and how they are compared.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"bases": ["019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33"], "count": 100, "dimensions": 2}))]
struct ComparisonRequest {
    /// The ids of their bases.
    bases: Vec<String>,
    /// Names for the picture; without them, those of the meshes.
    labels: Option<Vec<String>>,
    /// Eigenvalues above the kernel of the operator; without it, 100, or as many as all bases have. The kernel is one
    /// zero for each part of the mesh that is not held and on which no potential acts: it says nothing of the shape,
    /// and is left out.
    count: Option<usize>,
    /// What makes them comparable.
    #[serde(default)]
    scale: ScaleName,
    /// How much each counts.
    #[serde(default)]
    weighting: WeightingName,
    /// Dimensions of the places: 2 or 3.
    #[serde(default = "two")]
    #[schema(default = 2)]
    dimensions: usize,
    /// Nearest neighbours of each shape that are listed.
    #[serde(default = "three")]
    #[schema(default = 3)]
    neighbours: usize,
    /// Whether bases of different operators or conditions at a boundary are compared all the same.
    #[serde(default)]
    mixed: bool,
}

fn two() -> usize {
    2
}

fn three() -> usize {
    3
}

/// Shapes, compared.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "labels": ["camel-gallop-01", "horse"], "count": 100, "distances": {"columns": 2, "values": [0.0, 3.1, 3.1, 0.0]},
    "places": {"columns": 2, "values": [1.55, 0.0, -1.55, 0.0]}, "held": [1.0, 0.0], "neighbours": [[1], [0]],
    "descriptors": {"columns": 2, "values": [4.1, 5.0]}
}))]
struct ComparisonAnswer {
    /// The names of the shapes, in order.
    labels: Vec<String>,
    /// How many eigenvalues were compared.
    count: usize,
    /// Distances between the shapes: a row and a column for each.
    distances: Table,
    /// Places in the plane or in space, a row for each shape, whose distances are near to those (classical
    /// multidimensional scaling).
    places: Table,
    /// How much of the variation each dimension of the places holds, of 1.
    held: Vec<f64>,
    /// For each shape the numbers of its nearest neighbours, nearest first.
    neighbours: Vec<Vec<u32>>,
    /// The normalised spectra: a column for each shape.
    descriptors: Table,
}

/// What the spectrum of a stored basis is of.
pub(super) fn spectrum_of(basis: &BasisRecord, mesh: &MeshRecord) -> SpectrumOf {
    SpectrumOf::new(&basis.parameters, mesh.report["closed"] == true)
}

impl From<Unlike> for Problem {
    fn from(unlike: Unlike) -> Self {
        Self::new(&problem::INCOMPARABLE_BASES, sentence(&unlike))
            .with("bases", unlike.bases.to_vec())
            .with("spectra", unlike.spectra.to_vec())
    }
}

/// What makes the eigenvalues of a shape free of its size: the area of a surface, of a solid the square of the edge of
/// a cube with its volume, of a graph the number of its vertices.
fn measure(parameters: &Value, report: &Value) -> f64 {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    match parameters["operator"].as_str() {
        Some("volume") => number(&report["solid"]["volume"]).powf(2.0 / 3.0),
        Some("graph") => number(&report["vertices"]),
        _ => number(&report["area"]),
    }
}

/// The form of a raw answer.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ComparisonQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
}

problems!(CompareShapesProblems: BODY JSON [INVALID_QUERY, UNKNOWN_BASIS, NOT_ACCEPTABLE, BASIS_KIND, INCOMPARABLE_BASES, INVALID_ANALYSIS]);

/// Compares shapes by their spectra
///
/// Shape-DNA (Reuter et al. 2006): the Euclidean distances between normalised spectra, which depend neither on the pose
/// of a shape nor on how it is meshed. By `Accept`: JSON; raw numbers, the matrix of distances; or `image/svg+xml`, the
/// places as a picture.
#[utoipa::path(
    post, path = "/v1/shape-comparisons", tag = "analysis", operation_id = "compareShapes",
    params(ComparisonQuery),
    request_body(content = ComparisonRequest),
    responses(
        (status = 200, description = "The comparison", content((ComparisonAnswer = "application/json"), (super::docs::Binary = "application/octet-stream"), (super::docs::Binary = "image/svg+xml")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        CompareShapesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn compare_shapes(
    state: ClientState,
    QueryOf(query): QueryOf<ComparisonQuery>,
    headers: HeaderMap,
    content: axum::body::Body,
) -> Result<Answer, Problem> {
    extract::require_json(&headers)?;
    let media_type = exchange::answer_type(&headers, false, &[SVG])?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    let request: ComparisonRequest = exchange::parse(&state, body, exchange::BYTES_PER_NUMBER).await?;
    if request.bases.len() > MOST_SHAPES {
        let detail = format!("bases: {} were given; at most {MOST_SHAPES} can be compared.", request.bases.len());
        return Err(Problem::new(&problem::INVALID_ANALYSIS, detail));
    }
    if request.labels.as_ref().is_some_and(|labels| labels.len() != request.bases.len()) {
        return Err(Problem::new(&problem::INVALID_REQUEST, "labels: there must be one for each basis."));
    }
    let (mut spectra, mut labels) = (Vec::new(), Vec::new());
    let mut seen = Vec::new();
    for (place, id) in request.bases.iter().enumerate() {
        let record = find_kind(&state, BasisId::parse(id)?.0, ProductKind::Eigenbasis).await?;
        let mesh = state.store.mesh(&record.mesh).await?;
        let first = record.certificate["first"].as_u64().unwrap_or(0);
        if first > 0 {
            let detail = format!(
                "Basis {} holds the pairs of an interval, starting at pair {first}; shapes are compared by their lowest eigenvalues.",
                record.id
            );
            return Err(Problem::new(&problem::INVALID_ANALYSIS, detail));
        }
        // Eigenvalues stand in the record, so no eigenfunction is read.
        let area = measure(&record.parameters, &mesh.report);
        seen.push((record.id.to_string(), spectrum_of(&record, &mesh)));
        let components = mesh.report["components"].as_u64().unwrap_or(1) as usize;
        let kernel = kernel_of(&record.eigenvalues, components);
        spectra.push(Spectrum { eigenvalues: record.eigenvalues, kernel, area });
        labels.push(match &request.labels {
            Some(labels) => problem::shorten(labels[place].clone()),
            None => mesh.name.unwrap_or_else(|| record.mesh.chars().take(8).collect()),
        });
    }
    if !request.mixed {
        check_alike(seen.iter().map(|(id, of)| (id.as_str(), of)))?;
    }
    let shortest = spectra.iter().map(Spectrum::count).min().unwrap_or(0);
    let how = Comparison {
        count: request.count.unwrap_or(100.min(shortest)),
        scale: match request.scale {
            ScaleName::Area => Scale::Area,
            ScaleName::First => Scale::First,
            ScaleName::None => Scale::None,
        },
        weighting: match request.weighting {
            WeightingName::Index => Weighting::Index,
            WeightingName::None => Weighting::None,
        },
        dimensions: request.dimensions,
    };
    state
        .solve("compare", move |_| {
            let begin = Instant::now();
            let found = compare(&spectra, &how)?;
            match media_type {
                OCTETS => Ok(Answer::raw(&found.distances, query.dtype, begin)),
                SVG => {
                    let drawing = scatter::svg(&found.places, &labels, &found.held);
                    Ok(Answer::new(drawing.into_bytes(), SVG, begin))
                }
                _ => {
                    let neighbours = (0..labels.len())
                        .map(|shape| {
                            let mut others =
                                nearest_items(found.distances.column(shape), request.neighbours.saturating_add(1));
                            others.retain(|&other| other as usize != shape);
                            others.truncate(request.neighbours);
                            others
                        })
                        .collect();
                    let answer = ComparisonAnswer {
                        labels,
                        count: how.count,
                        distances: binary::to_table(&found.distances),
                        places: binary::to_table(&found.places),
                        held: found.held,
                        neighbours,
                        descriptors: binary::to_table(&found.descriptors),
                    };
                    Answer::json(&answer, begin)
                }
            }
        })
        .await
}
