//! Fields as resources: tables uploaded once and named in requests, and designs that are saved; listed, shown, renamed,
//! deleted, and given back.

use std::time::Instant;

use axum::Json;
use axum::body::Body;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use bytes::Bytes;
use chladni_mesh::numbering::Translation;
use chladni_spectral::formats::npz;
use chladni_spectral::operator::transport::FieldKind;
use chladni_work::design::{DesignRequest, Form, MatchedFaces, written as written_as};
use chladni_work::table::Table;
use serde::Deserialize;
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cache;
use super::design::read;
use super::octets;
use super::solve::{self, LoadedBasis};
use super::stored_wire::{FieldResource, FieldSummary, SavedDesign};
use crate::http::binary::Dtype;
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::conditional;
use crate::http::docs::Binary;
use crate::http::exchange::{self, Answer, JSON, OCTETS, Sent};
use crate::http::extract::{self, QueryOf};
use crate::http::ids::{BasisId, FieldId, MeshId};
use crate::http::named::{self, RenameRequest};
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::{self, Problem};
use crate::http::problems::problems;
use crate::http::state::AppState;
use crate::http::upload::check_name;
use crate::http::wire::PageOf;
use crate::store::{FieldFilter, FieldRecord, NewField, Stored};

/// The routes of fields as resources.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(upload))
        .routes(routes!(save))
        .routes(routes!(list))
        .routes(routes!(show, rename, delete))
        .routes(routes!(content))
}

const NPY: &str = "application/x-npy";

/// The most columns of an upload.
const MOST_COLUMNS: usize = 3;

/// The longest request that is kept with its field, in bytes of JSON: longer ones hold tables, which can be uploaded.
const LONGEST_REQUEST: usize = 256 << 10;

/// What is uploaded.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct UploadQuery {
    /// A name for people, at most 200 characters.
    #[param(example = "combed by hand", max_length = 200)]
    name: Option<String>,
    /// Of raw numbers, how many each face has.
    #[param(minimum = 1, maximum = 3, default = 1)]
    columns: Option<usize>,
    /// The type of raw numbers. They are kept in single precision.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
}

problems!(UploadFieldProblems: BODY JSON WRITE [INVALID_QUERY, UNKNOWN_MESH, DAMAGED_CONTENT, INVALID_DESIGN, DRAINING]);

/// Uploads a field
///
/// A table with a row for each face, which requests name by its id from then on, as `{"stored": id}`: a field to align
/// a design to (`alignment.to`: three columns are vectors in ℝ³, or the numbers of tensors where the basis is of
/// tensors; two are numbers in the frames of faces), weights of faces (`alignment.per_face`: one column), crosses
/// (`field` of a parametrisation), a field for fur or a hatching.
///
/// JSON, or with `Content-Type: application/octet-stream` little-endian numbers, face after face. An equal field on the
/// same mesh has the same id. It is deleted with its mesh.
#[utoipa::path(
    post, path = "/v1/meshes/{id}/fields", tag = "fields", operation_id = "uploadField",
    params(MeshId, NumberingQuery, UploadQuery),
    request_body(description = "The numbers", content((Table = "application/json", example = json!({"columns": 3, "values": [0.4, 0.3, 0.0]})), (Binary = "application/octet-stream"))),
    responses(
        (status = 201, description = "The field is stored; `Location` names it", body = FieldResource, headers(("Location" = String), ("ETag" = String))),
        (status = 200, description = "An equal field was stored before", body = FieldResource, headers(("Location" = String))),
        UploadFieldProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn upload(
    state: ClientState,
    MeshId(mesh): MeshId,
    numbered: Numbered,
    QueryOf(query): QueryOf<UploadQuery>,
    headers: HeaderMap,
    content: Body,
) -> Result<Response, Problem> {
    refuse_when_draining(&state)?;
    let name = query.name.filter(|name| !name.trim().is_empty());
    check_name(name.as_deref(), &problem::INVALID_QUERY)?;
    let faces = state.store.mesh(&mesh).await?.faces as usize;
    let to = numbered.on_frames(&state, &mesh).await?;
    let sent = exchange::read::<Table>(&state, &headers, content).await?;
    let (columns, dtype, mut memory) = (query.columns.unwrap_or(1), query.dtype, state.memory());
    body::reserve(&mut memory, 24 * (MOST_COLUMNS * to.faces(faces)) as u64)?;
    let make = move || {
        let _memory = memory;
        let table = match sent {
            Sent::Json(table) => table,
            Sent::Raw(body) => Table { columns, values: numbers(&body.bytes, dtype, columns)? },
        };
        let values = kept_rows(&table, &to, faces)?;
        Ok((table.columns, values))
    };
    let (width, values) = state.on_intake_pool(make).await?;
    let new = NewField { mesh, basis: None, name, width, values, design: Value::Null };
    answer(state.store.add_field(new).await?, &Translation::default())
}

fn refuse_when_draining(state: &ClientState) -> Result<(), Problem> {
    if state.is_draining() {
        let draining = Problem::new(&problem::DRAINING, "The server is shutting down and takes no fields.");
        return Err(draining.retry_after(10));
    }
    Ok(())
}

fn refused(detail: impl Into<String>) -> Problem {
    Problem::within(&problem::INVALID_DESIGN, "stored", detail)
}

/// Raw numbers.
fn numbers(bytes: &Bytes, dtype: Dtype, columns: usize) -> Result<Vec<f64>, Problem> {
    if bytes.is_empty() || !bytes.len().is_multiple_of(dtype.bytes() * columns.clamp(1, MOST_COLUMNS)) {
        let detail = format!(
            "The length of {} bytes is not a multiple of the row size, {columns} numbers in {}.",
            bytes.len(),
            dtype.name()
        );
        return Err(refused(detail));
    }
    Ok(match dtype {
        Dtype::F32 => bytes.as_chunks::<4>().0.iter().map(|&word| f64::from(f32::from_le_bytes(word))).collect(),
        Dtype::F64 => bytes.as_chunks::<8>().0.iter().map(|&word| f64::from_le_bytes(word)).collect(),
    })
}

/// The rows of the faces of the kept mesh.
fn kept_rows(table: &Table, to: &Translation, faces: usize) -> Result<Vec<f32>, Problem> {
    let columns = table.columns;
    if !(1..=MOST_COLUMNS).contains(&columns) {
        return Err(refused(format!("columns: must be from 1 to {MOST_COLUMNS}, not {columns}.")));
    }
    if table.values.len() != columns * to.faces(faces) {
        let (found, rows) = (table.values.len(), to.faces(faces));
        return Err(refused(format!(
            "values: {found} numbers are given; {rows} rows of {columns} are needed, one for each face."
        )));
    }
    if columns == 2
        && let Some(error) = to.refuses_frames()
    {
        return Err(refused(format!("values: {error}.")));
    }
    let pulled = to.pull_faces(&table.values, columns)?;
    let values: Vec<f32> = pulled.iter().map(|&x| x as f32).collect();
    match values.iter().position(|x| !x.is_finite()) {
        Some(at) => {
            let face = to.file_face((at / columns) as u32);
            let detail = format!("values: the number {:e} of face {face} is out of range for f32.", pulled[at]);
            Err(refused(detail).with("face", face))
        }
        None => Ok(values),
    }
}

fn answer(stored: Stored<FieldRecord>, to: &Translation) -> Result<Response, Problem> {
    let record = stored.record;
    tracing::info!(field = record.id, mesh = record.mesh, created = stored.created, "field stored");
    let (address, tag) = (format!("/v1/fields/{}", record.id), named::tag(&record.id, record.name.as_deref())?);
    Ok(named::stored(stored.created, &address, tag, FieldResource::numbered(record, to)?))
}

/// A stored field as a request numbers faces.
async fn resource(state: &ClientState, numbered: Numbered, record: FieldRecord) -> Result<FieldResource, Problem> {
    let to = match record.design["matching"].is_null() {
        true => Translation::default(),
        false => numbered.on_mesh(state, &record.mesh).await?,
    };
    FieldResource::numbered(record, &to)
}

/// A design that is to be saved.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "combed back", "design": {"strokes": [{"face": 17, "direction": [0.0, 0.0, 1.0]}]}}))]
struct SaveDesignRequest {
    /// A name for people, at most 200 characters.
    #[schema(max_length = 200)]
    name: Option<String>,
    /// What is asked for, as of `POST /v1/bases/{id}/design`, but for `faces` and `error`. Up to 256 KiB; tables are
    /// better uploaded and named by their ids.
    design: DesignRequest,
}

problems!(SaveDesignProblems: SOLVE BODY JSON WRITE [UNKNOWN_FIELD, INVALID_DESIGN, NO_FIELD_SURFACE, DRAINING]);

/// Saves a design
///
/// Designs a field and keeps it, with the request that made it: other requests name it by its id as they do uploads,
/// and its numbers can be fetched in every form. It is on the mesh of the basis, and is deleted with either.
#[utoipa::path(
    post, path = "/v1/bases/{id}/designs", tag = "fields", operation_id = "saveDesign",
    params(BasisId, NumberingQuery),
    request_body(content = SaveDesignRequest),
    responses(
        (status = 201, description = "The field is stored; `Location` names it", body = FieldResource, headers(("Location" = String), ("ETag" = String))),
        (status = 200, description = "An equal field was stored before", body = FieldResource, headers(("Location" = String))),
        SaveDesignProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn save(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    headers: HeaderMap,
    content: Body,
) -> Result<Response, Problem> {
    refuse_when_draining(&state)?;
    let SaveDesignRequest { name, mut design } = read(&state, &headers, content).await?;
    let name = name.filter(|name| !name.trim().is_empty());
    check_name(name.as_deref(), &problem::INVALID_REQUEST)?;
    design.of_all_faces("design")?;
    let request = without_nulls(serde_json::to_value(&design).map_err(Problem::internal)?);
    let length = request.to_string().len();
    if length > LONGEST_REQUEST {
        let detail = format!(
            "design: a request of {length} bytes is too long to be kept; the limit is {LONGEST_REQUEST}: upload its tables (POST /v1/meshes/{{id}}/fields) and name them by their ids."
        );
        return Err(Problem::within(&problem::INVALID_DESIGN, "request", detail));
    }
    let loaded = LoadedBasis::load(&state, id).await?;
    let to = numbered.on_basis(&state, id, &loaded.fields.metadata).await?;
    let loaded = loaded.numbered(&to);
    design.translate(&to, loaded.kind(), loaded.vertices())?;
    let designed = solve::design(&state, &loaded, &design).await?;
    let (kind, mesh) = (loaded.kind(), loaded.mesh.clone());
    let saved = SavedDesign {
        field: kind,
        request,
        numbering: numbered.0.numbering,
        harmonic_energy: designed.design.harmonic_energy,
        biharmonic_energy: designed.design.biharmonic_energy,
        alignment_energy: designed.design.alignment_energy,
        error: designed.error,
        matching: designed.exact.as_ref().map(|exact| MatchedFaces::in_mesh_faces(&exact.matching)),
    };
    let values = state.solve("lift", move |_| Ok(loaded.lifted(&designed)?)).await?;
    let design = serde_json::to_value(&saved).map_err(Problem::internal)?;
    let new = NewField { mesh, basis: Some(id), name, width: kind.block(), values, design };
    answer(state.store.add_field(new).await?, &to)
}

/// A request as it could have been sent: without members that are absent.
fn without_nulls(value: Value) -> Value {
    match value {
        Value::Object(members) => {
            let given = members.into_iter().filter(|(_, value)| !value.is_null());
            Value::Object(given.map(|(name, value)| (name, without_nulls(value))).collect())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(without_nulls).collect()),
        other => other,
    }
}

/// Which fields, and which page of them.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Only fields on this mesh.
    mesh: Option<String>,
    /// Only fields that were designed in this basis.
    basis: Option<String>,
    /// Only fields whose name contains this, in capital letters or small ones.
    #[param(example = "combed")]
    name: Option<String>,
    /// Items of the page, at most 200.
    #[param(minimum = 1, maximum = 200, default = 50)]
    limit: Option<u32>,
    /// `next` of the page before.
    from: Option<String>,
}

problems!(ListFieldsProblems: PAGE []);

/// Lists stored fields
///
/// Newest first, without the requests of designs.
#[utoipa::path(
    get, path = "/v1/fields", tag = "fields", operation_id = "listFields", params(ListQuery),
    responses(
        (status = 200, description = "A page of fields", body = PageOf<FieldSummary>),
        ListFieldsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn list(state: ClientState, QueryOf(query): QueryOf<ListQuery>) -> Result<Json<PageOf<FieldSummary>>, Problem> {
    let filter = FieldFilter { mesh: query.mesh, basis: query.basis, name: query.name };
    let page = state.store.fields(&filter, &extract::page_request(query.limit, query.from)?).await?;
    Ok(Json(PageOf::of(page, |record| FieldResource::from(record).summary)))
}

problems!(ShowFieldProblems: [INVALID_QUERY, UNKNOWN_FIELD]);

/// Shows a stored field
///
/// Of a design with the request that made it, in the numbering in which it was sent.
#[utoipa::path(
    get, path = "/v1/fields/{id}", tag = "fields", operation_id = "showField",
    params(FieldId, NumberingQuery),
    responses(
        (status = 200, description = "The field", body = FieldResource, headers(("ETag" = String))),
        (status = 304, description = "The field is as `If-None-Match` names it"),
        ShowFieldProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show(
    state: ClientState,
    FieldId(id): FieldId,
    numbered: Numbered,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let record = state.store.field(&id).await?;
    let tag = named::tag(&record.id, record.name.as_deref())?;
    Ok(named::shown(&headers, tag, resource(&state, numbered, record).await?))
}

/// That a field is in the state that `If-Match` names.
async fn require(state: &ClientState, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    if !conditional::has_condition(headers) {
        return Ok(());
    }
    let record = state.store.field(id).await?;
    conditional::require(headers, &named::tag(&record.id, record.name.as_deref())?)
}

problems!(RenameFieldProblems: BODY JSON WRITE CONDITION [INVALID_QUERY, UNKNOWN_FIELD]);

/// Renames a stored field
///
/// The name is for people; the id stays.
#[utoipa::path(
    patch, path = "/v1/fields/{id}", tag = "fields", operation_id = "renameField",
    params(FieldId, NumberingQuery, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    request_body(content = RenameRequest),
    responses(
        (status = 200, description = "The field under its new name", body = FieldResource),
        RenameFieldProblems,
    ),
    security(("bearer" = ["submit"]))
)]
async fn rename(
    state: ClientState,
    FieldId(id): FieldId,
    numbered: Numbered,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<FieldResource>, Problem> {
    let name = named::new_name(&state, &headers, body).await?;
    require(&state, &id, &headers).await?;
    let record = state.store.rename_field(&id, name.as_deref()).await?;
    tracing::info!(field = record.id, "field renamed");
    Ok(Json(resource(&state, numbered, record).await?))
}

problems!(DeleteFieldProblems: WRITE CONDITION [INVALID_QUERY, UNKNOWN_FIELD]);

/// Deletes a stored field
///
/// Requests that name it are refused from then on.
#[utoipa::path(
    delete, path = "/v1/fields/{id}", tag = "fields", operation_id = "deleteField",
    params(FieldId, ("If-Match" = Option<String>, Header, description = "Only where this is the `ETag` of the present state", example = "W/\"0f6d2c4ab1e84cf2\"")),
    responses(
        (status = 204, description = "The field is gone"),
        DeleteFieldProblems,
    ),
    security(("bearer" = ["operate"]))
)]
async fn delete(state: ClientState, FieldId(id): FieldId, headers: HeaderMap) -> Result<StatusCode, Problem> {
    require(&state, &id, &headers).await?;
    state.store.delete_field(&id).await?;
    tracing::info!(field = id, "field deleted");
    Ok(StatusCode::NO_CONTENT)
}

/// How numbers are written.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ContentQuery {
    /// How the numbers of a face of a design are written, `world` where it is left out. Uploads are given back as they
    /// are.
    #[param(inline)]
    form: Option<Form>,
}

problems!(GetFieldContentProblems: [INVALID_QUERY, UNKNOWN_FIELD, UNKNOWN_MESH, NOT_ACCEPTABLE, NO_FIELD_SURFACE, DAMAGED_CONTENT, BUSY]);

/// Gets the numbers of a stored field
///
/// By `Accept`: `application/x-npy` (the default), an array of faces × numbers for `numpy.load`;
/// `application/octet-stream`, the same little-endian f32 without a header; JSON.
#[utoipa::path(
    get, path = "/v1/fields/{id}/content", tag = "fields", operation_id = "getFieldContent",
    params(FieldId, NumberingQuery, ContentQuery),
    responses(
        (status = 200, description = "The numbers", content((Binary = "application/x-npy"), (Binary = "application/octet-stream"), (Table = "application/json", example = json!({"columns": 3, "values": [0.4, 0.3, 0.0]}))),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
        GetFieldContentProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn content(
    state: ClientState,
    FieldId(id): FieldId,
    numbered: Numbered,
    QueryOf(query): QueryOf<ContentQuery>,
    headers: HeaderMap,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let accepted = extract::negotiated(&headers, &[NPY, OCTETS, JSON])?;
    let record = state.store.field(&id).await?;
    let kept = cache::stored(&state, &record).await?;
    let form = match (kept.kind, query.form) {
        (Some(kind), form) => Some((kind, form.unwrap_or_default())),
        (None, None) => None,
        (None, Some(_)) => {
            return Err(Problem::new(
                &problem::INVALID_QUERY,
                "form: an uploaded field has none; it is given back as it is.",
            ));
        }
    };
    let to = numbered.on_mesh(&state, &record.mesh).await?;
    let surface = match form {
        Some((_, form)) if form != Form::Frames => Some(cache::surface(&state, &record.mesh).await?),
        _ => None,
    };
    state
        .solve("content", move |_| {
            let columns = form.map_or(kept.columns, |(kind, form): (FieldKind, Form)| form.columns(kind));
            let own = kept.values.to_vec();
            let values = match (&surface, form) {
                (Some(surface), Some((kind, form))) => written_as(surface.surface.frames(), kind, form, own),
                _ => own,
            };
            let values = to.push_faces(&values, columns);
            let faces = values.len() / columns.max(1);
            if accepted == JSON {
                return Answer::json(&Table { columns, values: values.iter().map(|&x| f64::from(x)).collect() }, begin);
            }
            let numbers = octets::to_bytes(values);
            let bytes = match accepted {
                NPY => npz::npy("<f4", false, &[faces, columns], &numbers).into(),
                _ => numbers,
            };
            Ok(Answer::new(bytes, accepted, begin)
                .with("chladni-rows", faces)
                .with("chladni-columns", columns)
                .with("chladni-dtype", "f32"))
        })
        .await
}
