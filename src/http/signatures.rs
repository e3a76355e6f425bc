//! Signatures of points, and points that are similar to one.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::signature::{Signature, nearest_items};
use chladni_spectral::basis::Basis;
use chladni_work::numbered::push;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Dtype, Table};
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The most points of a list of similar ones.
const MOST_SIMILAR: usize = 100_000;

/// The routes of signatures.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(signatures)).routes(routes!(similar_points))
}

/// A signature of points.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum SignatureKind {
    /// The heat kernel signature, `Σ e^{−λt} φ(x)²` for each time.
    HeatKernel {
        /// Times above zero, in length² of the mesh.
        times: Option<Vec<f64>>,
        /// Without times, how many, log-spaced in `[4 ln 10 / λ_max, 4 ln 10 / λ_1]`; 16 by default.
        count: Option<usize>,
        /// Whether to divide by the trace `Σ e^{−λt}`.
        #[serde(default)]
        normalised: bool,
    },
    /// The wave kernel signature.
    WaveKernel {
        /// How many energies, at least 32; 100 by default.
        count: Option<usize>,
    },
    /// The global point signature, `φ_k(x)/√λ_k`.
    GlobalPoint {
        /// How many modes; 20 by default.
        count: Option<usize>,
    },
}

impl SignatureKind {
    fn signature(self, basis: &Basis) -> Result<Signature, AnalysisError> {
        Ok(match self {
            Self::HeatKernel { times: Some(times), normalised, .. } => Signature::HeatKernel { times, normalised },
            Self::HeatKernel { times: None, count, normalised } => {
                Signature::heat_kernel(&basis.eigenvalues, count.unwrap_or(16), normalised)?
            }
            Self::WaveKernel { count } => Signature::WaveKernel { count: count.unwrap_or(100) },
            Self::GlobalPoint { count } => Signature::GlobalPoint { count: count.unwrap_or(20) },
        })
    }
}

/// Which signature, and where.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"signature": {"kind": "heat_kernel", "count": 16}, "vertices": [17, 2930]}))]
struct SignatureRequest {
    /// The signature.
    signature: SignatureKind,
    /// Vertices; without them, all.
    vertices: Option<Vec<u32>>,
}

/// A point, and what makes others similar to it.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"vertex": 17, "signature": {"kind": "wave_kernel", "count": 100}, "count": 20}))]
struct SimilarRequest {
    /// The point.
    #[serde(default)]
    vertex: u32,
    /// By what they are compared.
    signature: SignatureKind,
    /// How many points.
    #[serde(default = "ten")]
    #[schema(default = 10)]
    count: usize,
}

fn ten() -> usize {
    10
}

/// Similar points, the most similar first.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"vertices": [17, 2930], "differences": [0.0, 0.0013]}))]
struct SimilarAnswer {
    /// Their numbers; the first is the point itself, or one that cannot be told from it.
    vertices: Vec<u32>,
    /// How different their signatures are from that of the point.
    differences: Vec<f64>,
}

/// What a raw body does not say.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct SignatureQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// For a raw body, the rest of the request as JSON.
    #[param(example = "{\"signature\": {\"kind\": \"wave_kernel\"}}")]
    request: Option<String>,
}

problems!(SignaturesProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_ANALYSIS]);

/// Computes signatures of points
///
/// The heat kernel, the wave kernel or the global point signature, of chosen vertices or all: a row for each vertex.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is little-endian u32 vertices, or empty
/// for all, and the rest of the request stands in the query. The answer is of the same kind unless `Accept` says
/// otherwise.
#[utoipa::path(
    post, path = "/v1/bases/{id}/signatures", tag = "analysis", operation_id = "signatures",
    params(BasisId, NumberingQuery, SignatureQuery),
    request_body(description = "The vertices", content((SignatureRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The signatures", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        SignaturesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn signatures(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<SignatureQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let fill = |request: &mut SignatureRequest, bytes: &[u8]| {
        if !bytes.is_empty() {
            request.vertices = Some(binary::decode_tuples::<1>(bytes)?.into_flattened());
        }
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    request.vertices.iter_mut().try_for_each(|vertices| to.vertices(vertices, basis.vertices()))?;
    state
        .solve("signatures", move |_| {
            let begin = Instant::now();
            let signature = request.signature.signature(&basis)?;
            let table = match &request.vertices {
                Some(vertices) => signature.at(&basis, vertices)?,
                None => push(&to, signature.everywhere(&basis)?),
            };
            Answer::table(&table, raw, query.dtype, begin)
        })
        .await
}

problems!(SimilarPointsProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_ANALYSIS]);

/// Finds points that are similar to one
///
/// Compares the signature of every vertex with that of one: heat kernels by their distance over all scales (Sun et al.
/// 2009), wave kernels by their relative differences (Aubry et al. 2011), global points by the Euclidean distance.
///
/// JSON gives the most similar points. A raw answer is the difference of every vertex; a raw body is the vertex as one
/// little-endian u32, the rest of the request stands in the query then.
#[utoipa::path(
    post, path = "/v1/bases/{id}/similar-points", tag = "analysis", operation_id = "similarPoints",
    params(BasisId, NumberingQuery, SignatureQuery),
    request_body(description = "The point", content((SimilarRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "Similar points, or the difference of every vertex", content((SimilarAnswer = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        SimilarPointsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn similar_points(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<SignatureQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let fill = |request: &mut SimilarRequest, bytes: &[u8]| {
        let points = binary::decode_tuples::<1>(bytes)?;
        let [[point]] = points[..] else {
            let detail = format!("Exactly one vertex is needed, not {}.", points.len());
            return Err(Problem::new(&problem::INVALID_VERTEX, detail));
        };
        request.vertex = point;
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    if !(1..=MOST_SIMILAR).contains(&request.count) {
        let detail = format!("count: must be between 1 and {MOST_SIMILAR}, not {}.", request.count);
        return Err(Problem::new(&problem::INVALID_ANALYSIS, detail));
    }
    request.vertex = to.vertex(request.vertex.into(), basis.vertices())?;
    state
        .solve("similar_points", move |_| {
            let begin = Instant::now();
            let signature = request.signature.signature(&basis)?;
            let mut differences = signature.similarity(&basis, request.vertex)?;
            if raw {
                let table = DenseMatrix::from_columns(differences.len(), 1, differences);
                return Ok(Answer::raw(&push(&to, table), query.dtype, begin));
            }
            // What subdivision made is no vertex of the file.
            let mut told = 0;
            for (vertex, difference) in differences.iter_mut().enumerate() {
                match to.is_told(vertex as u32) {
                    true => told += 1,
                    false => *difference = f64::INFINITY,
                }
            }
            let vertices = nearest_items(&differences, request.count.min(told));
            let differences = vertices.iter().map(|&vertex| differences[vertex as usize]).collect();
            let vertices = vertices.into_iter().map(|vertex| to.file_vertex(vertex)).collect();
            Answer::json(&SimilarAnswer { vertices, differences }, begin)
        })
        .await
}
