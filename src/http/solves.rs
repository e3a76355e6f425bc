//! Synchronous solves in a stored basis: filter, project, reconstruct.

use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::Translation;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::analysis::filter::filter;
use chladni_spectral::analysis::projection::project;
use chladni_spectral::basis::Basis;
use chladni_work::numbered::{in_basis, push};
use chladni_work::projection::{
    FilterRequest, Functions, Named, ProjectAnswer, ProjectRequest, coordinates, reconstruct as reconstructed,
};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::binary::{self, Dtype, Table};
use super::body::WholeBody;
use super::client::ClientState;
use super::exchange::{Answer, OCTETS, Sent, answer_type, raw_answer, read};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use super::surfaces::{SURFACES, Surface};

/// The routes of synchronous solves.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(filter_functions))
        .routes(routes!(project_functions))
        .routes(routes!(reconstruct))
}

/// What is done with a raw body.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct RawQuery {
    /// The type of the numbers of a raw body and of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// `coordinates`, instead of a body.
    #[param(inline)]
    function: Option<Named>,
    /// The transfer function as JSON, for a raw body.
    #[param(example = "{\"kind\": \"low_pass\", \"cutoff\": 250.0}")]
    transfer: Option<String>,
    /// Whether to give the projected functions instead of the coefficients.
    reconstruct: Option<bool>,
    /// Onto how many modes functions are projected, for a raw body; all by default.
    pairs: Option<usize>,
}

/// Where the functions of a request come from.
pub enum Source {
    /// The coordinates of a mesh.
    Mesh(Arc<TriangleMesh>),
    /// The coordinates of a solid.
    Solid(Arc<TetMesh>),
    /// A JSON table.
    Table(Table),
    /// Raw numbers.
    Raw(WholeBody, Dtype),
}

impl Source {
    async fn named(state: &ClientState, id: Uuid) -> Result<Self, Problem> {
        let mesh = state.store.basis(id).await?.mesh;
        if state.store.load_basis(id).await?.is_of_solid()?
            && let (_, Some(solid)) = state.store.load_body(&mesh).await?
        {
            return Ok(Self::Solid(solid));
        }
        Ok(Self::Mesh(state.store.load_mesh(&mesh).await?))
    }

    /// What a JSON request names or carries.
    pub async fn of(state: &ClientState, id: Uuid, functions: Functions) -> Result<Self, Problem> {
        match functions {
            Functions::Named(Named::Coordinates) => Self::named(state, id).await,
            Functions::Values(table) => Ok(Self::Table(table)),
        }
    }

    async fn raw(state: &ClientState, id: Uuid, query: &RawQuery, body: WholeBody) -> Result<Self, Problem> {
        match query.function {
            Some(Named::Coordinates) if body.bytes.is_empty() => Self::named(state, id).await,
            Some(_) => Err(Problem::new(
                &problem::INVALID_QUERY,
                "function: takes the place of the body, but there is a body as well.",
            )),
            None => Ok(Self::Raw(body, query.dtype)),
        }
    }

    /// What is given row by row, `rows × k`.
    pub fn matrix(&self, rows: usize) -> Result<DenseMatrix, Problem> {
        match self {
            Self::Mesh(mesh) => Ok(coordinates(&mesh.positions)),
            Self::Solid(solid) => Ok(coordinates(&solid.positions)),
            Self::Table(table) => binary::from_table(table, rows),
            Self::Raw(body, dtype) => binary::decode(&body.bytes, *dtype, rows),
        }
    }

    /// Functions with a value for each vertex, as the request numbers them, on the first `rows` kept vertices.
    pub fn functions(&self, rows: usize, to: &Translation) -> Result<DenseMatrix, Problem> {
        match self {
            Self::Mesh(mesh) => Ok(coordinates(&mesh.positions)),
            Self::Solid(solid) => Ok(coordinates(&solid.positions)),
            Self::Table(table) => Ok(table.functions(rows, to)?),
            Self::Raw(body, dtype) => binary::decode_functions(&body.bytes, *dtype, rows, to),
        }
    }
}

problems!(FilterProblems: SOLVE BODY JSON [INVALID_FUNCTION, INVALID_TRANSFER]);

/// Filters functions by their spectrum
///
/// `x' = Φ F(Λ) ΦᵀM x + F∞ (x − ΦΦᵀM x)` (Vallet and Lévy 2008): each part of a function is multiplied by a factor that
/// depends on its eigenvalue; detail that the basis does not hold is multiplied by F∞, not lost.
///
/// JSON, or raw numbers for speed: with `Content-Type: application/octet-stream` the body is little-endian values,
/// vertex after vertex and, within a vertex, function after function, of the type `dtype`; the transfer function stands
/// in the query. The answer is of the same kind unless `Accept` says otherwise; a raw one has its shape in
/// `Chladni-Rows` and `Chladni-Columns`. A surface (`model/ply`, `model/obj`, `model/gltf-binary`) has the kept
/// vertices in their order, which for points without faces is not that of the file, and the texture coordinates,
/// normals and names that the mesh came with; normals turn with their faces.
#[utoipa::path(
    post, path = "/v1/bases/{id}/filter", tag = "bases", operation_id = "filter",
    params(BasisId, NumberingQuery, RawQuery),
    request_body(description = "The functions", content((FilterRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The filtered functions: a row for each vertex; of three functions, also the mesh with them as its coordinates", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream"), (super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"), (super::docs::Binary = "model/gltf-binary")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        FilterProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn filter_functions(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<RawQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = load(&state, id).await?;
    let to = translation(&state, numbered, id, &basis).await?;
    let sent = read::<FilterRequest>(&state, &headers, body).await?;
    let media_type = answer_type(&headers, matches!(sent, Sent::Raw(_)), &SURFACES)?;
    let surface = Surface::if_asked(&state, id, media_type).await?;
    let (source, transfer) = match sent {
        Sent::Json(request) => (Source::of(&state, id, request.functions).await?, request.transfer),
        Sent::Raw(body) => {
            let text = query.transfer.as_deref().ok_or_else(|| {
                Problem::new(
                    &problem::INVALID_QUERY,
                    "transfer: is missing; a raw body needs it in the query, as JSON.",
                )
            })?;
            let transfer = serde_json::from_str(text)
                .map_err(|error| Problem::new(&problem::INVALID_TRANSFER, format!("transfer: {error}.")))?;
            (Source::raw(&state, id, &query, body).await?, transfer)
        }
    };
    state
        .solve("filter", move |_| {
            let begin = Instant::now();
            let functions = source.functions(basis.vertices(), &to)?;
            drop(source);
            let filtered = filter(&basis, &functions, &transfer)?;
            match surface {
                Some(surface) => surface.moved(basis.is_of_solid()?, &filtered, begin),
                None => Answer::table(&push(&to, filtered), media_type == OCTETS, query.dtype, begin),
            }
        })
        .await
}

/// How functions in a basis are translated: eigenfields are two numbers in the frame of each face.
pub async fn translation(
    state: &ClientState,
    numbered: Numbered,
    id: Uuid,
    basis: &Basis,
) -> Result<Translation, Problem> {
    let to = numbered.on_basis(state, id, &basis.metadata).await?;
    Ok(in_basis(to, basis)?)
}

async fn load(state: &ClientState, id: Uuid) -> Result<Arc<Basis>, Problem> {
    Ok(state.store.load_basis(id).await?)
}

problems!(ProjectProblems: SOLVE BODY JSON [INVALID_FUNCTION, INVALID_ANALYSIS]);

/// Projects functions onto a basis
///
/// `ΦᵀM x`: the coefficients of the nearest combinations of the first `pairs` eigenfunctions, a row for each of them,
/// and how much they do not hold. JSON or raw numbers, as for `filter`; a raw answer is the coefficients, or with
/// `reconstruct=true` the projected functions, and has the relative errors in `Chladni-Relative-Error`.
#[utoipa::path(
    post, path = "/v1/bases/{id}/project", tag = "bases", operation_id = "project",
    params(BasisId, NumberingQuery, RawQuery),
    request_body(description = "The functions", content((ProjectRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The coefficients; of three functions, also the mesh with the projected ones as its coordinates", content((ProjectAnswer = "application/json"), (super::docs::Binary = "application/octet-stream"), (super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"), (super::docs::Binary = "model/gltf-binary")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Chladni-Relative-Error" = String), ("Server-Timing" = String))),
        ProjectProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn project_functions(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<RawQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    no_transfer(&query)?;
    let basis = load(&state, id).await?;
    let to = translation(&state, numbered, id, &basis).await?;
    let sent = read::<ProjectRequest>(&state, &headers, body).await?;
    let media_type = answer_type(&headers, matches!(sent, Sent::Raw(_)), &SURFACES)?;
    let surface = Surface::if_asked(&state, id, media_type).await?;
    let mut whole = query.reconstruct.unwrap_or(false);
    let mut pairs = query.pairs;
    let source = match sent {
        Sent::Json(request) => {
            whole |= request.reconstruct;
            pairs = request.pairs.or(pairs);
            Source::of(&state, id, request.functions).await?
        }
        Sent::Raw(body) => Source::raw(&state, id, &query, body).await?,
    };
    state
        .solve("project", move |_| {
            let begin = Instant::now();
            let functions = source.functions(basis.vertices(), &to)?;
            drop(source);
            let mut projection = project(&basis, &functions, pairs.unwrap_or(basis.count()))?;
            if let Some(surface) = surface {
                return surface.moved(basis.is_of_solid()?, &projection.reconstruction, begin);
            }
            if media_type == OCTETS {
                if whole {
                    projection.reconstruction = push(&to, projection.reconstruction);
                }
                let errors: Vec<String> = projection.relative_errors.iter().map(|error| format!("{error:e}")).collect();
                let wanted = if whole { &projection.reconstruction } else { &projection.coefficients };
                return Ok(Answer::raw(wanted, query.dtype, begin).with("chladni-relative-error", errors.join(", ")));
            }
            Answer::json(&ProjectAnswer::new(projection, whole, &to), begin)
        })
        .await
}

fn no_transfer(query: &RawQuery) -> Result<(), Problem> {
    if query.transfer.is_some() {
        return Err(Problem::new(&problem::INVALID_QUERY, "transfer: only filter takes a transfer function."));
    }
    Ok(())
}

problems!(ReconstructProblems: SOLVE BODY JSON [INVALID_FUNCTION]);

/// Evaluates combinations of eigenfunctions
///
/// `Φ c` for a table of coefficients with a row for each eigenfunction: what `project` gives, changed or not. JSON or
/// raw numbers, as for `filter`; the answer has a row for each vertex.
#[utoipa::path(
    post, path = "/v1/bases/{id}/reconstruct", tag = "bases", operation_id = "reconstruct",
    params(BasisId, NumberingQuery,
        ("dtype" = inline(Option<Dtype>), Query, description = "The type of the numbers of a raw body and of a raw answer")),
    request_body(description = "The coefficients", content((Table = "application/json", example = json!({"columns": 1, "values": [0.49, 0.01, -0.02]})), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The functions: a row for each vertex", content((Table = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        ReconstructProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn reconstruct(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<DtypeQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let basis = load(&state, id).await?;
    let to = translation(&state, numbered, id, &basis).await?;
    let sent = read::<Table>(&state, &headers, body).await?;
    let raw = raw_answer(&headers, matches!(sent, Sent::Raw(_)))?;
    let source = match sent {
        Sent::Json(table) => Source::Table(table),
        Sent::Raw(body) => Source::Raw(body, query.dtype),
    };
    state
        .solve("reconstruct", move |_| {
            let begin = Instant::now();
            let coefficients = source.matrix(basis.count())?;
            drop(source);
            Answer::table(&reconstructed(&basis, &coefficients, &to)?, raw, query.dtype, begin)
        })
        .await
}

/// The type of raw numbers.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct DtypeQuery {
    #[serde(default)]
    dtype: Dtype,
}
