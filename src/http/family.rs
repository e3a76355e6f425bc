//! Spectra of a stored family of operators.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_work::family_spectrum::{SpectrumAnswer, SpectrumFault, SpectrumRequest};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::binary::Dtype;
use super::body;
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The routes of families.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(family_spectrum))
}

/// The most bytes of such a request.
const MOST_BYTES: u64 = 1 << 16;

problems!(FamilySpectrumProblems: SOLVE BODY JSON [INVALID_SPECTRUM]);

/// Computes the spectrum of an operator of a family
///
/// The lowest pairs of `(1 − t) S + t A + v V` in the space of a basis of the kind `operator_family` (thesis, section
/// 2.6): `S` is the Laplacian, `A` also follows how the normal turns, `V` is the curvature potential. Meant to be asked
/// again and again while somebody moves a slider: 100 pairs in a space of 780 functions take some tens of milliseconds.
///
/// With `Accept: application/octet-stream` the answer is what `give` names, as raw little-endian f32, row after row,
/// and the eigenvalues stand in `Chladni-Eigenvalues`; `Chladni-Covered` is `covered`.
#[utoipa::path(
    post, path = "/v1/bases/{id}/spectrum", tag = "bases", operation_id = "familySpectrum",
    params(BasisId, NumberingQuery),
    request_body = SpectrumRequest,
    responses(
        (status = 200, description = "The pairs", content((SpectrumAnswer = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Eigenvalues" = String), ("Chladni-Covered" = u64), ("Server-Timing" = String))),
        FamilySpectrumProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn family_spectrum(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    extract::require_json(&headers)?;
    let raw = exchange::raw_answer(&headers, false)?;
    let family = state.store.load_family(id).await?;
    let to = numbered.on_basis(&state, id, &family.metadata).await?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    let request: SpectrumRequest = exchange::parse(&state, body, exchange::BYTES_PER_NUMBER).await?;
    request.check()?;
    state
        .solve("spectrum", move |_| {
            let begin = Instant::now();
            let found = request.find(&family, &to)?;
            if raw {
                let listed: Vec<String> = found.eigenvalues.iter().map(|value| format!("{value:.9e}")).collect();
                let values = DenseMatrix::from_columns(found.eigenvalues.len(), 1, found.eigenvalues);
                let matrix = found.matrix.unwrap_or(values);
                let covered = found.covered.to_string();
                let answer = Answer::raw(&matrix, Dtype::F32, begin);
                return Ok(answer.with("chladni-eigenvalues", listed.join(" ")).with("chladni-covered", covered));
            }
            Answer::json(&request.answer(found), begin)
        })
        .await
}

impl From<SpectrumFault> for Problem {
    fn from(fault: SpectrumFault) -> Self {
        match fault {
            SpectrumFault::ModeOfValues => Self::new(&problem::INVALID_REQUEST, format!("{fault}.")),
            SpectrumFault::Mode { .. } => Self::new(&problem::INVALID_RANGE_OF_MODES, format!("{fault}.")),
            SpectrumFault::Family(error) => error.into(),
        }
    }
}
