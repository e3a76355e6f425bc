//! Spectral compression of functions on a mesh.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_spectral::analysis::compression::decompress;
use chladni_work::compression::{CompressionAnswer, CompressionRequest};
use chladni_work::numbered::push;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::Dtype;
use super::binary::Table;
use super::body;
use super::client::ClientState;
use super::exchange::{self, Answer, JSON, OCTETS, Sent, raw_answer, read};
use super::extract::{self, QueryOf};
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::solves::Source;
use super::state::AppState;
use super::surfaces::{SURFACES, Surface};

/// The most bytes of compressed functions.
const MOST_BYTES: u64 = 64 << 20;

/// The routes of compression.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(compress_functions)).routes(routes!(decompress_functions))
}

/// What a raw body does not say.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct CompressionQuery {
    /// The type of the numbers of a raw body.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// For a raw body, the rest of the request as JSON.
    #[param(example = "{\"pairs\": 300, \"bits\": 14}")]
    request: Option<String>,
}

problems!(CompressProblems: SOLVE BODY JSON [INVALID_FUNCTION, INVALID_ANALYSIS]);

/// Compresses functions
///
/// The coefficients of functions, coordinates above all, in the first modes of the basis, rounded and packed (Karni and
/// Gotsman 2000). Whoever has the basis puts them together again with `decompress`; `basis_bytes` says what that is,
/// and the rates are told without and with it.
///
/// JSON answers with rate and distortion; `Accept: application/octet-stream` with the bytes, and the distortion in
/// `Chladni-Relative-Error`. A raw body is the functions, as for `filter`; the rest of the request stands in the query
/// then.
#[utoipa::path(
    post, path = "/v1/bases/{id}/compress", tag = "analysis", operation_id = "compress",
    params(BasisId, NumberingQuery, CompressionQuery),
    request_body(description = "The functions", content((CompressionRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "Rate and distortion, or the bytes", content((CompressionAnswer = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Relative-Error" = String), ("Server-Timing" = String))),
        CompressProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn compress_functions(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<CompressionQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let sent = read::<CompressionRequest>(&state, &headers, content).await?;
    let raw = raw_answer(&headers, matches!(sent, Sent::Raw(_)))?;
    let (source, rate) = match sent {
        Sent::Json(request) => {
            let rate = request.rate(&basis);
            (Source::of(&state, id, request.functions).await?, rate)
        }
        Sent::Raw(body) => {
            let request: CompressionRequest = exchange::rest(Some(query.request.as_deref().unwrap_or("{}")))?;
            (Source::Raw(body, query.dtype), request.rate(&basis))
        }
    };
    state
        .solve("compress", move |_| {
            let begin = Instant::now();
            let functions = source.functions(basis.vertices(), &to)?;
            drop(source);
            let packed = rate.compress(&basis, &functions)?;
            if raw {
                let errors: Vec<String> = packed.relative_errors.iter().map(|error| format!("{error:e}")).collect();
                return Ok(Answer::new(packed.bytes, OCTETS, begin).with("chladni-relative-error", errors.join(", ")));
            }
            Answer::json(&rate.into_answer(&basis, packed)?, begin)
        })
        .await
}

/// The form of the answer.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct DecompressionQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
}

problems!(DecompressProblems: SOLVE BODY [UNSUPPORTED_MEDIA_TYPE, INVALID_STREAM]);

/// Puts compressed functions together again
///
/// The body is what `compress` gave for the same basis. The answer is the functions, a row for each vertex: raw by
/// default, as JSON, or, of three functions, as `model/ply`, the mesh with them as its coordinates.
#[utoipa::path(
    post, path = "/v1/bases/{id}/decompress", tag = "analysis", operation_id = "decompress",
    params(BasisId, NumberingQuery, DecompressionQuery),
    request_body(description = "Compressed functions", content((super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The functions", content((super::docs::Binary = "application/octet-stream"), (Table = "application/json"), (super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"), (super::docs::Binary = "model/gltf-binary")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        DecompressProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn decompress_functions(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<DecompressionQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    if let Some(other) = extract::media_type(&headers).filter(|name| name != OCTETS) {
        let detail = format!("This route reads {OCTETS}, not {:?}.", problem::shorten(other));
        return Err(Problem::new(&problem::UNSUPPORTED_MEDIA_TYPE, detail));
    }
    let media_type = exchange::answer_type(&headers, true, &SURFACES)?;
    let surface = Surface::if_asked(&state, id, media_type).await?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    state
        .solve("decompress", move |_| {
            let begin = Instant::now();
            let functions = decompress(&basis, &body.bytes)?;
            match surface {
                Some(surface) => surface.moved(basis.is_of_solid()?, &functions, begin),
                None => Answer::table(&push(&to, functions), media_type != JSON, query.dtype, begin),
            }
        })
        .await
}
