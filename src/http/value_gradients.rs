//! How eigenvalues change when vertices move.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_work::MeshSize;
use chladni_work::value_gradient::{GradientFault, ValueGradientRequest, gradient, gradient_bytes};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Dtype, Table};
use super::body;
use super::client::ClientState;
use super::convert::sentence;
use super::exchange::{self, Answer};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The route of gradients.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(value_gradient))
}

/// The form of the answer.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ValueGradientQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
}

problems!(ValueGradientProblems: SOLVE BODY JSON [INVALID_FUNCTION, INVALID_ANALYSIS]);

/// Computes the gradient of eigenvalues
///
/// The derivatives of a weighted sum of eigenvalues by the positions of the vertices: a row of three numbers for each
/// vertex, in 1/length³ of the mesh. With the derivatives of a loss by the eigenvalues as weights they are those of the
/// loss, which is what backpropagation asks for.
///
/// The Laplacian is to be that of the triangles as they are (`laplace`, or `auto` where it chose that) or of a solid
/// (`volume`), the mass `barycentric` or `consistent`. Eigenvalues that coincide have no derivatives of their own, but
/// their sum has: give them equal weights. Of an approximate basis it is the derivative of its values in the space that
/// it has.
///
/// In the numbering of the file, merged vertices share what the vertex has that was kept of them, dropped ones have
/// zero, and what belongs to vertices that `subdivide` made goes to the ends of their edges, so that moving the file's
/// vertices by a small `v` changes the sum by the inner product of `v` with the answer.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is the weights as little-endian f64.
/// The answer is of the same kind unless `Accept` says otherwise.
#[utoipa::path(
    post, path = "/v1/bases/{id}/value-gradient", tag = "analysis", operation_id = "valueGradient",
    params(BasisId, NumberingQuery, ValueGradientQuery),
    request_body(description = "The weights", content((ValueGradientRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The gradient", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        ValueGradientProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn value_gradient(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<ValueGradientQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Answer, Problem> {
    let basis = on_vertices(&state, id).await?;
    let to = numbered.on_basis(&state, id, &basis.metadata).await?;
    let fill = |request: &mut ValueGradientRequest, bytes: &[u8]| {
        request.weights = binary::decode(bytes, Dtype::F64, bytes.len() / Dtype::F64.bytes())?.column(0).to_vec();
        Ok(())
    };
    // A raw body says all there is.
    let (request, raw) = exchange::request(&state, &headers, content, Some("{}"), fill).await?;
    let (mesh, solid) = state.store.load_body(&state.store.basis(id).await?.mesh).await?;
    let mut memory = state.memory();
    body::reserve(&mut memory, gradient_bytes(MeshSize::of_body(&mesh, solid.as_deref())))?;
    state
        .solve("value_gradient", move |monitor| {
            let (begin, _memory) = (Instant::now(), memory);
            let table = gradient(&basis, (&mesh, solid.as_deref()), &request.weights, &to, monitor)?;
            Answer::table(&table, raw, query.dtype, begin)
        })
        .await
}

impl From<GradientFault> for Problem {
    fn from(fault: GradientFault) -> Self {
        match fault {
            GradientFault::Analysis(error) => error.into(),
            GradientFault::Provenance(error) => error.into(),
            GradientFault::Numbering(_) | GradientFault::Parameters(_) | GradientFault::Operator(_) => {
                Self::new(&problem::INVALID_ANALYSIS, sentence(&fault))
            }
        }
    }
}
