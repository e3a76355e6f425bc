//! Meshes: uploaded, listed, shown, renamed, deleted, and given back in other formats.

use std::sync::Arc;

use axum::Json;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use bytes::Bytes;
use chladni_mesh::TriangleMesh;
use chladni_mesh::attributes::Attributes;
use chladni_mesh::check::points::has_points_alone;
use chladni_mesh::check::{CheckOptions, MOST_SUBDIVISIONS, Merge, SurfaceOf};
use chladni_mesh::read::{MeshFormat, RawMesh, ReadLimits, read};
use chladni_mesh::solid::check_body;
use chladni_mesh::write::{PlyPrecision, SurfaceFormat};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::client::ClientState;
use super::content::Immutable;
use super::extract::{self, QueryOf};
use super::ids::MeshId;
use super::named::{self, RenameRequest};
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use super::upload::{Sent, check_name};
use super::wire::{MeshResource, PageOf};
use super::{body, conditional, exchange};
use crate::store::{MeshRecord, NewMesh};

/// About the bytes that the triangles around a point take while points without faces are checked.
const POINT_BYTES: u64 = 300;

/// The media type of positions and indices for web clients.
const BUFFERS: &str = "application/vnd.chladni.mesh";

/// The routes of meshes.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(upload, list))
        .routes(routes!(show, rename, delete))
        .routes(routes!(content))
        .merge(super::mesh_maps::routes())
}

/// How to read an upload.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct UploadQuery {
    /// The format: `obj`, `ply`, `off`, `stl`, `medit`, `vtk`, `gmsh`, `freesurfer`, `gltf`, `gifti`, `npz` or `json`.
    /// Takes the place of `Content-Type`.
    #[param(example = "ply")]
    format: Option<String>,
    /// Whether vertices at exactly equal positions become one: `auto` (where the format repeats positions by design, as
    /// STL does), `always` or `never`.
    #[param(inline, example = "auto")]
    merge: Option<Merge>,
    /// Which surface is meant where a file has triangles and tetrahedra: `boundary`, where its tetrahedra have no
    /// neighbour (that is closed, and the solid's own), or `given`, its triangles, without an inside. By what the two
    /// differ is told among the defects.
    #[param(inline, example = "boundary")]
    surface: Option<SurfaceOf>,
    /// How often every face is divided into four before the mesh is stored, 0 to 6. Eigenvalues of the finer mesh are
    /// nearer to those of the surface.
    #[param(minimum = 0, maximum = 6, example = 0)]
    subdivide: Option<u8>,
    /// A name for people, at most 200 characters.
    #[param(example = "igea", max_length = 200)]
    name: Option<String>,
}

/// A mesh as arrays; vertices are counted from 0.
#[derive(utoipa::ToSchema)]
#[schema(as = MeshArrays, example = json!({"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}))]
#[allow(dead_code)]
struct ArraysSchema {
    /// Positions: x, y and z of each vertex.
    vertices: Vec<Vec<f64>>,
    /// Faces: the vertices of each, three or more.
    #[schema(required = false)]
    faces: Vec<Vec<u32>>,
    /// Tetrahedra: four vertices of each.
    #[schema(required = false)]
    tetrahedra: Vec<Vec<u32>>,
}

/// A mesh in parts; all but the first may stand in the query instead, which decides where both say something.
#[derive(utoipa::ToSchema)]
#[schema(as = MeshParts)]
#[allow(dead_code)]
struct PartsSchema {
    /// The file.
    #[schema(value_type = String, format = Binary)]
    mesh: Vec<u8>,
    /// As in the query.
    #[schema(required = false)]
    format: String,
    /// As in the query.
    #[schema(required = false, inline)]
    merge: Merge,
    /// As in the query.
    #[schema(required = false, inline)]
    surface: SurfaceOf,
    /// As in the query.
    #[schema(required = false, minimum = 0, maximum = 6)]
    subdivide: u8,
    /// As in the query.
    #[schema(required = false, max_length = 200)]
    name: String,
}

problems!(UploadMeshProblems: BODY WRITE [INVALID_QUERY, INVALID_MULTIPART, UNKNOWN_FORMAT, UNREADABLE_MESH, UNUSABLE_MESH, DRAINING]);

/// Uploads a mesh
///
/// The body is the file itself, or `multipart/form-data` with the file in a part named `mesh` (and, optionally, parts
/// `format`, `merge`, `surface`, `subdivide` and `name`). The format comes from `format`, from `Content-Type` or the
/// file name, or, for general types such as `application/octet-stream`, from the first bytes. `Content-Encoding` may be
/// gzip or zstd; a file that is gzip itself is unpacked as well.
///
/// Arrays come as NPZ (`numpy.savez`: `vertices`, n × 3; `faces`, f × k; `tetrahedra`, t × 4) or JSON
/// (`{"vertices": [[x, y, z], …], "faces": [[0, 1, 2], …]}`), vertices counted from 0.
///
/// A file with tetrahedra is a solid: the mesh is then the surface of its tetrahedra, unless `surface=given`, the
/// report has the member `solid`, and the vertices of the surface are the first of the solid, both in the order of the
/// file.
///
/// A file without faces has points: bases are then computed from triangles around each of them, the report has
/// `points: true`, and what needs a surface with faces is refused. Points at equal positions become one, unless
/// `merge=never`, and points at which no triangle can be made are left out. The points are kept in the order of a curve
/// through space: meshes that are answered (the content of the mesh, PLY of filtered functions and of modes) have them
/// in this order, and `GET /v1/meshes/{id}/vertex-map` tells which they are.
///
/// Where repairs renumber vertices or faces, the report has the member `file`, and all other routes take and give the
/// numbering of the file unless they are asked for `numbering=kept`; so two files with the same surface and other
/// numbers are two meshes.
///
/// Texture coordinates, normals and the names of groups, objects and materials of an OBJ are kept, each corner's own,
/// so that seams split no vertex; the report counts them in its member `attributes`, and whatever surface goes out has
/// them. They are part of the mesh: with others it is another one.
///
/// The mesh is checked; repairs that lose nothing are done and listed in the report. The same content has the same id:
/// sending it again answers 200 with what is stored, under the name that it has. The report of this answer is always
/// that of the file that was sent; that of the first file with this mesh is the one that is kept.
#[utoipa::path(
    post, path = "/v1/meshes", tag = "meshes", operation_id = "uploadMesh", params(UploadQuery),
    request_body(description = "The mesh", content(
        (super::docs::Binary = "model/obj", example = json!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")),
        (super::docs::Binary = "model/ply"), (super::docs::Binary = "model/off"), (super::docs::Binary = "model/stl"), (super::docs::Binary = "model/x-medit"), (super::docs::Binary = "model/x-vtk"), (super::docs::Binary = "model/x-gmsh"), (super::docs::Binary = "model/x-freesurfer"), (super::docs::Binary = "model/gltf-binary"), (super::docs::Binary = "model/x-gifti"),
        (super::docs::Binary = "application/x-npz"), (ArraysSchema = "application/json"),
        (super::docs::Binary = "application/octet-stream"), (PartsSchema = "multipart/form-data"))),
    responses(
        (status = 201, description = "The mesh is stored; `Location` names it", body = MeshResource, headers(("Location" = String), ("ETag" = String))),
        (status = 200, description = "The same content was stored before", body = MeshResource, headers(("Location" = String))),
        UploadMeshProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn upload(
    state: ClientState,
    QueryOf(query): QueryOf<UploadQuery>,
    request: Request,
) -> Result<Response, Problem> {
    if state.is_draining() {
        return Err(
            Problem::new(&problem::DRAINING, "The server is shutting down and takes no meshes.").retry_after(10)
        );
    }
    let (parts, content) = request.into_parts();
    let body = body::read(&state, &parts.headers, content, state.config.limits.max_body_bytes).await?;
    let limit = state.config.limits.max_body_bytes;
    let mut sent = if extract::media_type(&parts.headers).as_deref() == Some("multipart/form-data") {
        Sent::from_multipart(parts, body.bytes.clone()).await?
    } else {
        Sent { bytes: body.bytes.clone(), media_type: extract::media_type(&parts.headers), ..Sent::default() }
    };
    let body = body.gunzipped(std::mem::take(&mut sent.bytes), limit).await?;
    sent.bytes = body.bytes.clone();
    let name = query.name.or(sent.name.take()).filter(|name| !name.trim().is_empty());
    check_name(name.as_deref(), &problem::INVALID_QUERY)?;
    let format = sent.format(query.format.as_deref())?;
    let subdivisions = query.subdivide.or(sent.subdivide).unwrap_or_default();
    if subdivisions > MOST_SUBDIVISIONS {
        let detail = format!("subdivide: must be between 0 and {MOST_SUBDIVISIONS}, not {subdivisions}.");
        return Err(Problem::new(&problem::INVALID_QUERY, detail));
    }
    let options = CheckOptions {
        merge: query.merge.or(sent.merge).unwrap_or_default(),
        surface: query.surface.or(sent.surface).unwrap_or_default(),
        subdivisions,
        most_faces: state.config.limits.max_faces,
        ..CheckOptions::default()
    };
    let limits = ReadLimits {
        vertices: state.config.limits.max_vertices,
        faces: state.config.limits.max_faces,
        ..ReadLimits::default()
    };
    let bytes = sent.bytes;
    let (most_bytes, mut memory) = (state.config.limits.max_body_bytes, state.memory());
    let new = state
        .on_intake_pool(move || {
            let source_bytes = bytes.len() as u64;
            let raw = read(&bytes, format, &limits)?;
            let made = subdivided_bytes(&raw, subdivisions);
            if subdivisions > 0 && made > most_bytes {
                let detail = format!(
                    "subdivide: the mesh would take about {made} bytes subdivided {subdivisions} times; the limit is {most_bytes}."
                );
                return Err(Problem::new(&problem::BODY_TOO_LARGE, detail).with("limit", most_bytes));
            }
            drop(bytes);
            // The share of the body budget is held until the bytes are gone.
            drop(body);
            if subdivisions > 0 {
                body::reserve(&mut memory, made)?;
            } else if has_points_alone(&raw) {
                // However many they are, a client may send them; beyond its part they are checked one upload after the
                // other.
                body::reserve(&mut memory, (POINT_BYTES * raw.positions.len() as u64).min(most_bytes))?;
            }
            let body = check_body(raw, &options)?;
            let report = serde_json::to_value(&body.surface.report).map_err(Problem::internal)?;
            let (mesh, solid) = (Arc::new(body.surface.mesh), body.solid.map(Arc::new));
            let numbering = Arc::new(body.surface.numbering);
            let (attributes, format) = (body.surface.attributes.map(Arc::new), format.name().to_owned());
            Ok(NewMesh { mesh, solid, numbering, attributes, report, name, format, source_bytes })
        })
        .await?;
    let report = new.report.clone();
    let stored = state.store.add_mesh(new).await?;
    // What was stored first may have been another file with the same mesh in it: its report tells of other repairs.
    let record = MeshRecord { report, ..stored.record };
    tracing::info!(
        mesh = record.id,
        vertices = record.vertices,
        faces = record.faces,
        created = stored.created,
        "mesh stored"
    );
    let (address, tag) = (format!("/v1/meshes/{}", record.id), named::tag(&record.id, record.name.as_deref())?);
    Ok(named::stored(stored.created, &address, tag, MeshResource::from(record)))
}

/// About the bytes of positions, faces and what goes with them when every face has been divided into four so many
/// times.
fn subdivided_bytes(raw: &RawMesh, times: u8) -> u64 {
    let attributes = raw.attributes.as_ref().map_or(0, |own| own.attributes.bytes());
    let once = 24 * raw.positions.len() as u64 + 12 * raw.faces.len() as u64 + attributes;
    once.saturating_mul(4u64.saturating_pow(times.into()))
}

/// Which page.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Items of the page, at most 200.
    #[param(minimum = 1, maximum = 200, default = 50)]
    limit: Option<u32>,
    /// `next` of the page before.
    from: Option<String>,
    /// Only meshes whose name contains this, in capital letters or small ones.
    #[param(example = "bunny")]
    name: Option<String>,
}

problems!(ListMeshesProblems: PAGE []);

/// Lists meshes
///
/// Newest first. Pages stay stable while new meshes arrive.
#[utoipa::path(
    get, path = "/v1/meshes", tag = "meshes", operation_id = "listMeshes", params(ListQuery),
    responses(
        (status = 200, description = "A page of meshes", body = PageOf<MeshResource>),
        ListMeshesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn list(state: ClientState, QueryOf(query): QueryOf<ListQuery>) -> Result<Json<PageOf<MeshResource>>, Problem> {
    let page = super::extract::page_request(query.limit, query.from)?;
    let page = state.store.meshes_named(query.name.as_deref(), &page).await?;
    Ok(Json(PageOf::of(page, MeshResource::from)))
}

problems!(ShowMeshProblems: [INVALID_QUERY, UNKNOWN_MESH]);

/// Shows a mesh
///
/// With the report of the check that it went through.
#[utoipa::path(
    get, path = "/v1/meshes/{id}", tag = "meshes", operation_id = "showMesh",
    params(MeshId),
    responses(
        (status = 200, description = "The mesh", body = MeshResource, headers(("ETag" = String))),
        (status = 304, description = "The mesh is as `If-None-Match` names it"),
        ShowMeshProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show(state: ClientState, MeshId(id): MeshId, headers: HeaderMap) -> Result<Response, Problem> {
    let record = state.store.mesh(&id).await?;
    let tag = named::tag(&record.id, record.name.as_deref())?;
    Ok(named::shown(&headers, tag, MeshResource::from(record)))
}

/// That a mesh is in the state that `If-Match` names.
async fn require(state: &ClientState, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    if !conditional::has_condition(headers) {
        return Ok(());
    }
    let record = state.store.mesh(id).await?;
    conditional::require(headers, &named::tag(&record.id, record.name.as_deref())?)
}

problems!(RenameMeshProblems: BODY JSON WRITE CONDITION [INVALID_QUERY, UNKNOWN_MESH]);

/// Renames a mesh
///
/// The name is for people; the id stays.
#[utoipa::path(
    patch, path = "/v1/meshes/{id}", tag = "meshes", operation_id = "renameMesh",
    params(MeshId, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    request_body(content = RenameRequest),
    responses(
        (status = 200, description = "The mesh under its new name", body = MeshResource),
        RenameMeshProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn rename(
    state: ClientState,
    MeshId(id): MeshId,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<MeshResource>, Problem> {
    let name = named::new_name(&state, &headers, body).await?;
    require(&state, &id, &headers).await?;
    let record = state.store.rename_mesh(&id, name.as_deref()).await?;
    tracing::info!(mesh = record.id, "mesh renamed");
    Ok(Json(MeshResource::from(record)))
}

/// What to do with what refers to the mesh.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct DeleteQuery {
    /// Cancels its unfinished jobs and deletes its bases too.
    #[serde(default)]
    #[param(default = false)]
    cascade: bool,
}

problems!(DeleteMeshProblems: WRITE CONDITION [INVALID_QUERY, UNKNOWN_MESH, MESH_IN_USE]);

/// Deletes a mesh
///
/// Refused while unfinished jobs or bases refer to it, unless `cascade=true`.
#[utoipa::path(
    delete, path = "/v1/meshes/{id}", tag = "meshes", operation_id = "deleteMesh",
    params(MeshId, DeleteQuery, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    responses(
        (status = 204, description = "The mesh is gone"),
        DeleteMeshProblems,
    ),
    security(("bearer" = ["operate"]))
)]
async fn delete(
    state: ClientState,
    MeshId(id): MeshId,
    QueryOf(query): QueryOf<DeleteQuery>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    require(&state, &id, &headers).await?;
    state.store.delete_mesh(&id, query.cascade).await?;
    tracing::info!(mesh = id, cascade = query.cascade, "mesh deleted");
    Ok(StatusCode::NO_CONTENT)
}

/// How a mesh is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum Written {
    Ply,
    Obj,
    Glb,
    Buffers,
}

/// How to write the content.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ContentQuery {
    /// Takes the place of `Accept`.
    #[param(inline)]
    format: Option<Written>,
}

problems!(GetMeshContentProblems: [INVALID_QUERY, UNKNOWN_MESH, NOT_ACCEPTABLE, RANGE_NOT_SATISFIABLE, DAMAGED_CONTENT]);

/// Gets the content of a mesh
///
/// By `Accept` or `format`: PLY (the default; binary, little-endian), OBJ, binary glTF, or buffers for web clients
/// (`application/vnd.chladni.mesh`): all little-endian and aligned to four bytes, the number of vertices n and of faces
/// f as u32, then 3n positions as f32, then 3f vertex indices as u32. Of a surface far from the origin, as in
/// geographic coordinates, single precision keeps little of the shape: PLY and OBJ hold double, and glTF positions from
/// the middle, where its nodes are moved to.
///
/// Texture coordinates, normals and names that the file had come back in all of them but buffers.
#[utoipa::path(
    get, path = "/v1/meshes/{id}/content", tag = "meshes", operation_id = "getMeshContent",
    params(
        MeshId,
        ContentQuery,
        ("Range" = Option<String>, Header, description = "One range of bytes", example = "bytes=0-1023"),
    ),
    responses(
        (status = 200, description = "The whole content", content((super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"), (super::docs::Binary = "model/gltf-binary"), (super::docs::Binary = "application/vnd.chladni.mesh"), (super::docs::Binary = "application/octet-stream")), headers(("ETag" = String))),
        (status = 206, description = "The bytes that `Range` asks for", content((super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"), (super::docs::Binary = "model/gltf-binary"), (super::docs::Binary = "application/vnd.chladni.mesh"), (super::docs::Binary = "application/octet-stream")), headers(("Content-Range" = String))),
        (status = 304, description = "The content is as `If-None-Match` names it"),
        GetMeshContentProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn content(
    state: ClientState,
    MeshId(id): MeshId,
    QueryOf(query): QueryOf<ContentQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (ply, obj, glb) = (MeshFormat::Ply.media_type(), MeshFormat::Obj.media_type(), MeshFormat::Gltf.media_type());
    let (format, asked) = match query.format {
        Some(format) => (format, None),
        None => match extract::negotiated(&headers, &[ply, obj, glb, BUFFERS, exchange::OCTETS])? {
            name if name == obj => (Written::Obj, None),
            name if name == ply => (Written::Ply, None),
            name if name == glb => (Written::Glb, None),
            name => (Written::Buffers, Some(name)),
        },
    };
    let record = state.store.mesh(&id).await?;
    let mesh = state.store.load_mesh(&record.id).await?;
    let attributes = state.store.load_attributes(&record.id).await?;
    let work = move || Ok(Bytes::from(written(&mesh, attributes.as_deref(), format).map_err(Problem::internal)?));
    let bytes = state.on_intake_pool(work).await?;
    let (media_type, extension) = match format {
        Written::Ply => (ply, "ply"),
        Written::Obj => (obj, "obj"),
        Written::Glb => (glb, "glb"),
        Written::Buffers => (asked.unwrap_or(BUFFERS), "bin"),
    };
    let length = bytes.len() as u64;
    let file_name = format!("mesh-{}.{extension}", record.id);
    Immutable { tag: format!("{}-{extension}", record.id), media_type, file_name, length }.answer(&headers, bytes)
}

fn written(mesh: &TriangleMesh, attributes: Option<&Attributes>, format: Written) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut surface = |format: SurfaceFormat| format.write(mesh, attributes, PlyPrecision::Double, &mut out);
    match format {
        Written::Ply => surface(SurfaceFormat::Ply)?,
        Written::Obj => surface(SurfaceFormat::Obj)?,
        Written::Glb => surface(SurfaceFormat::Glb)?,
        Written::Buffers => {
            out.reserve_exact(8 + 12 * (mesh.positions.len() + mesh.faces.len()));
            out.extend_from_slice(&(mesh.positions.len() as u32).to_le_bytes());
            out.extend_from_slice(&(mesh.faces.len() as u32).to_le_bytes());
            out.extend(mesh.positions.iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()));
            out.extend(mesh.faces.iter().flatten().flat_map(|index| index.to_le_bytes()));
        }
    }
    Ok(out)
}
