//! Spectral compression of functions on a mesh.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_spectral::analysis::compression::{compress, decompress};
use chladni_work::numbered::push;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
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
use super::solves::{Functions, Source};
use super::state::AppState;
use super::surfaces::{SURFACES, Surface};

/// The most bytes of compressed functions.
const MOST_BYTES: u64 = 64 << 20;

/// The routes of compression.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(compress_functions)).routes(routes!(decompress_functions))
}

/// What to compress, and how far.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"functions": "coordinates", "pairs": 300, "bits": 14}))]
struct CompressionRequest {
    /// `coordinates`, or a table with a row for each vertex.
    #[serde(default = "Functions::coordinates")]
    functions: Functions,
    /// How many modes are kept; all by default.
    pairs: Option<usize>,
    /// Bits of the largest coefficient, 2 to 30; 14 by default.
    bits: Option<u32>,
}

/// Rate and distortion.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "pairs": 300, "bits": 14, "bytes": 1123, "bits_per_vertex": 0.067, "basis_bytes": 17400000, "basis_from_faces": false, "bits_per_vertex_with_basis": 2871.0, "step": 0.0021, "nonzeros": 812,
    "relative_errors": [0.004, 0.003, 0.004], "truncation_errors": [0.004, 0.003, 0.004]
}))]
struct CompressionAnswer {
    /// Modes that are kept.
    pairs: usize,
    /// Bits of the largest coefficient.
    bits: u32,
    /// Bytes of the whole, header included.
    bytes: usize,
    /// The same in bits for each vertex, all functions together.
    bits_per_vertex: f64,
    /// Bytes that the functions of the basis take as they are stored: who decompresses must have them, whatever the
    /// number of pairs.
    basis_bytes: u64,
    /// Whether whoever has the faces computes the basis anew, so that it need not be sent: it is of the operator
    /// `graph`.
    basis_from_faces: bool,
    /// Bits for each vertex where the basis has to be sent as well, once.
    bits_per_vertex_with_basis: f64,
    /// The width of a step of the rounding.
    step: f64,
    /// Coefficients that are not zero.
    nonzeros: usize,
    /// Of each function, how much is lost in the norm of the mass, relative to how far it is from its mean.
    relative_errors: Vec<f64>,
    /// How much of that the modes that are left out would lose alone.
    truncation_errors: Vec<f64>,
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
    let (source, pairs, bits) = match sent {
        Sent::Json(request) => (Source::of(&state, id, request.functions).await?, request.pairs, request.bits),
        Sent::Raw(body) => {
            let request: CompressionRequest = exchange::rest(Some(query.request.as_deref().unwrap_or("{}")))?;
            (Source::Raw(body, query.dtype), request.pairs, request.bits)
        }
    };
    state
        .solve("compress", move |_| {
            let begin = Instant::now();
            let functions = source.functions(basis.vertices(), &to)?;
            drop(source);
            let (pairs, bits) = (pairs.unwrap_or(basis.count()), bits.unwrap_or(14));
            let packed = compress(&basis, &functions, pairs, bits)?;
            if raw {
                let errors: Vec<String> = packed.relative_errors.iter().map(|error| format!("{error:e}")).collect();
                return Ok(Answer::new(packed.bytes, OCTETS, begin).with("chladni-relative-error", errors.join(", ")));
            }
            let (bytes, basis_bytes) = (packed.bytes.len(), basis.stored_bytes());
            let per_vertex = |bytes: f64| 8.0 * bytes / basis.vertices().max(1) as f64;
            let answer = CompressionAnswer {
                pairs,
                bits,
                bytes,
                bits_per_vertex: per_vertex(bytes as f64),
                basis_bytes,
                basis_from_faces: basis.is_of_graph()?,
                bits_per_vertex_with_basis: per_vertex(bytes as f64 + basis_bytes as f64),
                step: packed.step,
                nonzeros: packed.nonzeros,
                relative_errors: packed.relative_errors,
                truncation_errors: packed.truncation_errors,
            };
            Answer::json(&answer, begin)
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
