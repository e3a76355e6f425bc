//! Shapes compared by their spectra.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_spectral::analysis::scatter;
use chladni_spectral::basis::ProductKind;
use chladni_work::mappable::{SpectrumOf, Unlike};
use chladni_work::shape_comparison::{ComparedShape, ComparisonAnswer, ComparisonFault, ComparisonRequest};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::find_kind;
use super::binary::Dtype;
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
    request.check()?;
    let (mut shapes, mut labels) = (Vec::new(), Vec::new());
    for (place, id) in request.bases.iter().enumerate() {
        // Eigenvalues stand in the record, so no eigenfunction is read.
        let record = find_kind(&state, BasisId::parse(id)?.0, ProductKind::Eigenbasis).await?;
        let mesh = state.store.mesh(&record.mesh).await?;
        let first = record.certificate["first"].as_u64().unwrap_or(0);
        let values = (record.eigenvalues, first);
        shapes.push(ComparedShape::new(record.id.to_string(), values, &record.parameters, &mesh.report)?);
        labels.push(match &request.labels {
            Some(labels) => problem::shorten(labels[place].clone()),
            None => mesh.name.unwrap_or_else(|| record.mesh.chars().take(8).collect()),
        });
    }
    request.check_shapes(&shapes)?;
    state
        .solve("compare", move |_| {
            let begin = Instant::now();
            let found = request.compare(shapes)?;
            match media_type {
                OCTETS => Ok(Answer::raw(&found.distances, query.dtype, begin)),
                SVG => {
                    let drawing = scatter::svg(&found.places, &labels, &found.held);
                    Ok(Answer::new(drawing.into_bytes(), SVG, begin))
                }
                _ => Answer::json(&request.answer(labels, found), begin),
            }
        })
        .await
}

impl From<ComparisonFault> for Problem {
    fn from(fault: ComparisonFault) -> Self {
        match fault {
            ComparisonFault::Interval { .. } => Self::new(&problem::INVALID_ANALYSIS, sentence(&fault)),
            ComparisonFault::TooMany(_) => Self::new(&problem::INVALID_ANALYSIS, format!("{fault}.")),
            ComparisonFault::Labels => Self::new(&problem::INVALID_REQUEST, format!("{fault}.")),
            ComparisonFault::Unlike(unlike) => unlike.into(),
            ComparisonFault::Analysis(error) => error.into(),
        }
    }
}
