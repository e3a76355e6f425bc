//! Two bases of one surface, compared function by function.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_spectral::analysis::subspace::{Eigenspace, MOST_PAIRS, compare};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Table};
use super::body;
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract;
use super::ids::BasisId;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The most bytes of a request.
const MOST_BYTES: u64 = 1 << 16;

/// The route of comparisons of bases.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(compare_bases))
}

/// Which bases, and how they are compared.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"reference": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "other": "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33", "pairs": 100}))]
struct BasisComparisonRequest {
    /// The id of the basis that the other one is projected on, an exact one for instance; inner products are by its
    /// mass.
    reference: String,
    /// The id of the other basis, on as many vertices.
    other: String,
    /// How many of the first pairs of both; without it, as many as both have, at most 1000.
    pairs: Option<usize>,
    /// Eigenvalues of the reference that follow on each other with at most this relative gap are one cluster.
    #[serde(default = "one_percent")]
    #[schema(default = 0.01)]
    gap: f64,
    /// Whether to give all Fourier coefficients.
    #[serde(default)]
    coefficients: bool,
}

fn one_percent() -> f64 {
    0.01
}

/// A cluster of eigenvalues, and the spaces of its functions.
#[derive(Debug, Serialize, ToSchema)]
struct EigenspaceAnswer {
    /// Its first mode.
    from: usize,
    /// The mode after its last.
    to: usize,
    /// The principal angles between its spaces in the two bases, in radians, ascending.
    angles: Vec<f64>,
    /// The sine of the largest: the distance of the two spaces.
    error: f64,
}

impl From<Eigenspace> for EigenspaceAnswer {
    fn from(Eigenspace { modes, angles }: Eigenspace) -> Self {
        let error = angles.last().copied().unwrap_or(0.0).sin();
        Self { from: modes.start, to: modes.end, angles, error }
    }
}

/// Two bases, compared.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "same_mesh": true, "pairs": 2, "eigenvalue_errors": [0.0, 0.003], "projection_errors": [0.0, 0.01], "angles": [0.0, 0.01],
    "eigenspaces": [{"from": 0, "to": 1, "angles": [0.0], "error": 0.0}, {"from": 1, "to": 2, "angles": [0.01], "error": 0.01}], "coefficients": null
}))]
struct BasisComparisonAnswer {
    /// Whether both bases are of one mesh, or one problem. Where they are not, their vertices are taken for the same by
    /// their numbers alone, as of one shape in two poses.
    same_mesh: bool,
    /// How many pairs were compared.
    pairs: usize,
    /// Per pair the eigenvalue of the other basis less that of the reference, over that.
    eigenvalue_errors: Vec<f64>,
    /// Per function of the other basis, which share of it lies outside of the functions of the reference, in the norm
    /// of the mass.
    projection_errors: Vec<f64>,
    /// The principal angles between the spans of all the functions, in radians, ascending.
    angles: Vec<f64>,
    /// Clusters of eigenvalues, with the angles between their spaces: single functions of one mean nothing.
    eigenspaces: Vec<EigenspaceAnswer>,
    /// Fourier coefficients: a row for each function of the reference, a column for each of the other basis.
    coefficients: Option<Table>,
}

problems!(CompareBasesProblems: BODY JSON [INVALID_QUERY, UNKNOWN_BASIS, NOT_ACCEPTABLE, BASIS_KIND, INCOMPARABLE_BASES, INVALID_ANALYSIS]);

/// Compares two bases of one surface
///
/// Projects the functions of one on those of the other: Fourier coefficients, what is left out, and the principal
/// angles between eigenspaces, eigenvalues that lie close together being taken as one.
#[utoipa::path(
    post, path = "/v1/basis-comparisons", tag = "analysis", operation_id = "compareBases",
    request_body(content = BasisComparisonRequest),
    responses((status = 200, description = "The comparison", body = BasisComparisonAnswer), CompareBasesProblems),
    security(("bearer" = ["read"]))
)]
async fn compare_bases(state: ClientState, headers: HeaderMap, content: Body) -> Result<Answer, Problem> {
    extract::require_json(&headers)?;
    exchange::answer_type(&headers, false, &[])?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    let request: BasisComparisonRequest = exchange::parse(&state, body, exchange::BYTES_PER_NUMBER).await?;
    let ids = [BasisId::parse(&request.reference)?.0, BasisId::parse(&request.other)?.0];
    let reference = on_vertices(&state, ids[0]).await?;
    let other = on_vertices(&state, ids[1]).await?;
    if reference.vertices() != other.vertices() {
        let detail =
            format!("The reference has {} vertices and the other basis {}.", reference.vertices(), other.vertices());
        return Err(
            Problem::new(&problem::INCOMPARABLE_BASES, detail).with("bases", vec![request.reference, request.other])
        );
    }
    let same_mesh = state.store.basis(ids[0]).await?.mesh == state.store.basis(ids[1]).await?.mesh;
    let pairs = request.pairs.unwrap_or(reference.count().min(other.count()).min(MOST_PAIRS));
    state
        .solve("compare_bases", move |monitor| {
            let begin = Instant::now();
            let found = compare(&reference, &other, pairs, request.gap, monitor)?;
            let answer = BasisComparisonAnswer {
                same_mesh,
                pairs,
                eigenvalue_errors: found.eigenvalue_errors,
                projection_errors: found.projection_errors,
                angles: found.angles,
                eigenspaces: found.eigenspaces.into_iter().map(EigenspaceAnswer::from).collect(),
                coefficients: request.coefficients.then(|| binary::to_table(&found.coefficients)),
            };
            Answer::json(&answer, begin)
        })
        .await
}
