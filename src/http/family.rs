//! Spectra of a stored family of operators.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_spectral::analysis::family::{Member, spectrum};
use chladni_work::numbered::push;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::binary::{self, Dtype, Table};
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

/// What is wanted of the pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum SpectrumDetail {
    /// Eigenvalues alone.
    #[default]
    Eigenvalues,
    /// The coefficients of the eigenfunctions in the space of the family too: a row for each of its functions.
    Coefficients,
    /// Eigenfunctions too: a row for each vertex.
    Modes,
}

/// An operator of the family.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"extrinsic": 0.5, "curvature": 0.0, "count": 100, "give": "eigenvalues"}))]
struct SpectrumRequest {
    /// `t`, 0 to 1, in `(1 − t) S + t A`.
    #[serde(default)]
    extrinsic: f64,
    /// `v`, 0 to 1e6, in `+ v V`, where the potential is `κ₁² + κ₂²`.
    #[serde(default)]
    curvature: f64,
    /// Pairs, at most the dimension of the family; without it 100, or as many as that dimension where it is less.
    count: Option<usize>,
    /// What is wanted of them.
    #[serde(default)]
    #[schema(inline)]
    give: SpectrumDetail,
    /// With `modes` or `coefficients`: this pair alone, counted from 0, in one column. What shows one function needs no
    /// others.
    mode: Option<usize>,
}

/// Pairs, unless their number is given.
const COUNT: usize = 100;

/// The lowest pairs of an operator of the family.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"eigenvalues": [0.0, 1.9, 2.1], "covered": 3, "coefficients": null, "modes": null}))]
struct SpectrumAnswer {
    /// Ascending, in 1/length² of the mesh.
    eigenvalues: Vec<f64>,
    /// How many of them, from the lowest, the space of the family was made for; those beyond can be many times too
    /// large. None where `curvature` is above 20, all where the space has every function of the mesh.
    covered: usize,
    /// A row for each function of the space, where they were asked for.
    coefficients: Option<Table>,
    /// A row for each vertex, where they were asked for; orthonormal for the mass of the mesh.
    modes: Option<Table>,
}

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
    if request.mode.is_some() && request.give == SpectrumDetail::Eigenvalues {
        let detail = "mode: belongs to requests with `give`, \"modes\" or \"coefficients\".";
        return Err(Problem::new(&problem::INVALID_REQUEST, detail));
    }
    state
        .solve("spectrum", move |_| {
            let begin = Instant::now();
            let member = Member { extrinsic: request.extrinsic, curvature: request.curvature };
            let mut found = spectrum(&family, member, request.count.unwrap_or(COUNT.min(family.dimension())))?;
            if let Some(mode) = request.mode {
                if mode >= found.coefficients.columns() {
                    let detail = format!(
                        "mode: there is no mode {mode}; {} pairs were requested.",
                        found.coefficients.columns()
                    );
                    return Err(Problem::new(&problem::INVALID_RANGE_OF_MODES, detail));
                }
                let column = found.coefficients.column(mode).to_vec();
                found.coefficients = DenseMatrix::from_columns(column.len(), 1, column);
            }
            let matrix = match request.give {
                SpectrumDetail::Eigenvalues => None,
                SpectrumDetail::Coefficients => Some(found.coefficients),
                SpectrumDetail::Modes => Some(push(&to, family.lift(&found.coefficients))),
            };
            if raw {
                let listed: Vec<String> = found.eigenvalues.iter().map(|value| format!("{value:.9e}")).collect();
                let values = DenseMatrix::from_columns(found.eigenvalues.len(), 1, found.eigenvalues);
                let matrix = matrix.unwrap_or(values);
                let covered = found.covered.to_string();
                let answer = Answer::raw(&matrix, Dtype::F32, begin);
                return Ok(answer.with("chladni-eigenvalues", listed.join(" ")).with("chladni-covered", covered));
            }
            let table = |wanted| matrix.as_ref().filter(|_| request.give == wanted).map(binary::to_table);
            let answer = SpectrumAnswer {
                coefficients: table(SpectrumDetail::Coefficients),
                modes: table(SpectrumDetail::Modes),
                eigenvalues: found.eigenvalues,
                covered: found.covered,
            };
            Answer::json(&answer, begin)
        })
        .await
}
