//! Surfaces as files, with the texture coordinates, normals and names that their meshes came with.

use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_mesh::TriangleMesh;
use chladni_mesh::attributes::Attributes;
use chladni_mesh::write::{PlyPrecision, SurfaceFormat};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::binary::{self, Dtype, Table};
use super::client::ClientState;
use super::exchange::{Answer, Sent, read};
use super::extract::{self, QueryOf};
use super::ids::MeshId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The media types of surfaces, the one that is the default first.
pub const SURFACES: [&str; 3] = ["model/ply", "model/obj", "model/gltf-binary"];

/// The format of a media type, where it is one of [`SURFACES`].
fn format_of(media_type: &str) -> Option<SurfaceFormat> {
    let formats = [SurfaceFormat::Ply, SurfaceFormat::Obj, SurfaceFormat::Glb];
    SURFACES.iter().position(|&name| name == media_type).map(|at| formats[at])
}

/// The surface of a mesh that an answer shall be, and how it is written.
pub struct Surface {
    mesh: Arc<TriangleMesh>,
    attributes: Option<Arc<Attributes>>,
    format: SurfaceFormat,
    media_type: &'static str,
}

impl Surface {
    /// The surface of the mesh of a basis, where the answer is to be one.
    ///
    /// # Errors
    /// Those of loading a mesh.
    pub async fn if_asked(state: &ClientState, basis: Uuid, media_type: &'static str) -> Result<Option<Self>, Problem> {
        match format_of(media_type) {
            None => Ok(None),
            Some(_) => Self::of(state, &state.store.basis(basis).await?.mesh, media_type).await,
        }
    }

    /// The same of a mesh.
    ///
    /// # Errors
    /// Those of loading a mesh.
    pub async fn of(state: &ClientState, mesh: &str, media_type: &'static str) -> Result<Option<Self>, Problem> {
        let Some(format) = format_of(media_type) else { return Ok(None) };
        let attributes = state.store.load_attributes(mesh).await?;
        Ok(Some(Self { mesh: state.store.load_mesh(mesh).await?, attributes, format, media_type }))
    }

    /// Its vertices.
    pub fn vertices(&self) -> usize {
        self.mesh.positions.len()
    }

    /// The surface with three functions as its coordinates. Of functions on a solid the rows of its surface are taken,
    /// which come first.
    ///
    /// # Errors
    /// `invalid-function` unless there are three.
    pub fn moved(&self, of_solid: bool, functions: &DenseMatrix, begin: Instant) -> Result<Answer, Problem> {
        let media_type = self.media_type;
        if functions.columns() != 3 {
            let found = functions.columns();
            let detail = format!("A {media_type} needs exactly three functions as its coordinates, not {found}.");
            return Err(Problem::new(&problem::INVALID_FUNCTION, detail));
        }
        let (rows, vertices) = (functions.rows(), self.vertices());
        if rows != vertices && !(of_solid && rows > vertices) {
            let detail = format!("A {media_type} needs a row for each of {vertices} vertices, not {rows}.");
            return Err(Problem::new(&problem::INVALID_FUNCTION, detail));
        }
        let position = |row: usize| std::array::from_fn(|axis| functions.column(axis)[row]);
        let positions: Vec<[f64; 3]> = (0..vertices).map(position).collect();
        // Files that hold single precision would hold infinities.
        if !matches!(self.format, SurfaceFormat::Obj)
            && let Some(vertex) = positions.iter().position(|p| p.iter().any(|x| x.abs() > f64::from(f32::MAX)))
        {
            let detail = format!(
                "The position of vertex {vertex} does not fit into single precision, which a {media_type} holds."
            );
            return Err(Problem::new(&problem::INVALID_FUNCTION, detail));
        }
        let attributes = self.attributes.as_ref().map(|attributes| attributes.moved(&self.mesh, &positions));
        let moved = TriangleMesh { positions, faces: self.mesh.faces.clone(), ..Default::default() };
        let mut bytes = Vec::new();
        self.format
            .write(&moved, attributes.as_deref(), PlyPrecision::of(&moved.positions), &mut bytes)
            .map_err(Problem::internal)?;
        Ok(Answer::new(bytes, media_type, begin))
    }
}

/// The routes of surfaces.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(moved_surface))
}

/// How a surface is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum MovedFormat {
    Ply,
    Obj,
    Glb,
}

/// How positions come, and how the surface is written.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct MovedQuery {
    /// Takes the place of `Accept`.
    #[param(inline)]
    format: Option<MovedFormat>,
    /// The type of the numbers of a raw body.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
}

problems!(WriteMovedSurfaceProblems: BODY JSON [INVALID_QUERY, UNKNOWN_MESH, NOT_ACCEPTABLE, INVALID_FUNCTION]);

/// Writes a mesh whose vertices have moved
///
/// The faces of the mesh with other positions (a mode that swings, a simulation, whatever a client computes), with all
/// else that its file had: texture coordinates, names of groups, objects and materials, and normals, which turn with
/// their faces. By `Accept` or `format`: PLY (the default), OBJ or binary glTF.
///
/// The body is a JSON table of three columns with a row for each vertex, or, with
/// `Content-Type: application/octet-stream`, little-endian numbers of the type `dtype`, vertex after vertex. The
/// surface that is answered has the kept vertices in their order.
#[utoipa::path(
    post, path = "/v1/meshes/{id}/surface", tag = "meshes", operation_id = "writeMovedSurface",
    params(MeshId, NumberingQuery, MovedQuery),
    request_body(description = "The positions", content((Table = "application/json", example = json!({"columns": 3, "values": [0.0, 0.0, 0.5, 1.0, 0.0, 0.5, 0.0, 1.0, 0.5]})), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The surface", content((super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"), (super::docs::Binary = "model/gltf-binary")), headers(("Server-Timing" = String))),
        WriteMovedSurfaceProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn moved_surface(
    state: ClientState,
    MeshId(id): MeshId,
    numbered: Numbered,
    QueryOf(query): QueryOf<MovedQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let media_type = match query.format {
        Some(MovedFormat::Ply) => SURFACES[0],
        Some(MovedFormat::Obj) => SURFACES[1],
        Some(MovedFormat::Glb) => SURFACES[2],
        None => extract::negotiated(&headers, &SURFACES)?,
    };
    let record = state.store.mesh(&id).await?;
    let to = numbered.on_mesh(&state, &record.id).await?;
    let surface = Surface::of(&state, &record.id, media_type).await?;
    let surface = surface.ok_or_else(|| Problem::internal("a media type of surfaces"))?;
    let sent = read::<Table>(&state, &headers, body).await?;
    state
        .on_intake_pool(move || {
            let begin = Instant::now();
            let rows = surface.vertices();
            let positions = match sent {
                Sent::Json(table) => table.functions(rows, &to)?,
                Sent::Raw(body) => binary::decode_functions(&body.bytes, query.dtype, rows, &to)?,
            };
            surface.moved(false, &positions, begin)
        })
        .await
}
