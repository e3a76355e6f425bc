//! Two bases of one surface, compared function by function.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_work::basis_comparison::{BasisComparisonAnswer, BasisComparisonFault, BasisComparisonRequest};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::body;
use super::client::ClientState;
use super::convert::sentence;
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

problems!(CompareBasesProblems: BODY JSON [INVALID_QUERY, UNKNOWN_BASIS, NOT_ACCEPTABLE, BASIS_KIND, INCOMPARABLE_BASES, INVALID_ANALYSIS]);

/// Compares two bases of one surface
///
/// Projects the functions of one on those of the other: Fourier coefficients, what is left out, and the principal
/// angles between eigenspaces, eigenvalues that lie close together being taken as one. With `following`, which mode of
/// one is which of the other, as in two frames of an animation whose eigenvalues cross.
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
    BasisComparisonRequest::check(&reference, &other)
        .map_err(|fault| Problem::from(fault).with("bases", vec![request.reference.clone(), request.other.clone()]))?;
    let same_mesh = state.store.basis(ids[0]).await?.mesh == state.store.basis(ids[1]).await?.mesh;
    state
        .solve("compare_bases", move |monitor| {
            let begin = Instant::now();
            Answer::json(&request.answer(&reference, &other, Some(same_mesh), monitor)?, begin)
        })
        .await
}

impl From<BasisComparisonFault> for Problem {
    fn from(fault: BasisComparisonFault) -> Self {
        match fault {
            BasisComparisonFault::Vertices { .. } => Self::new(&problem::INCOMPARABLE_BASES, sentence(&fault)),
            BasisComparisonFault::Analysis(error) => error.into(),
        }
    }
}
