//! Eigenfunctions lifted to the vertices, streamed panel by panel.

use std::ops::Range;
use std::sync::Arc;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use chladni_mesh::numbering::{Missing, Translation};
use chladni_mesh::read::MeshFormat;
use chladni_mesh::write::{PlyPrecision, write_ply, write_ply_attributed};
use chladni_spectral::basis::{Basis, ProductKind};
use chladni_spectral::formats::npz;
use futures_util::{StreamExt, stream};
use headers::HeaderMapExt;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::{find_kind, on_vertices};
use super::binary::Dtype;
use super::client::ClientState;
use super::conditional;
use super::content::Immutable;
use super::extract::{self, QueryOf};
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::solves::translation;
use super::state::AppState;
use crate::store::BasisRecord;

/// Bytes of one panel of a streamed answer: large enough to be worth a task, small enough to hold many.
const PANEL_BYTES: usize = 4 << 20;

const NPY: &str = "application/x-npy";
const OCTETS: &str = "application/octet-stream";

/// The route of lifted modes.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(modes))
}

/// How modes are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum Format {
    Npy,
    F32,
    Ply,
}

/// Which modes, and how to write them.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ModesQuery {
    /// The first mode, counted from 0.
    #[serde(default)]
    #[param(default = 0, example = 1)]
    from: usize,
    /// One past the last mode; without it, all from `from` on (for PLY, that one).
    #[param(example = 11)]
    to: Option<usize>,
    /// Takes the place of `Accept`.
    #[param(inline)]
    format: Option<Format>,
    /// The type of the numbers.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
}

problems!(GetModesProblems: [INVALID_QUERY, UNKNOWN_BASIS, NOT_ACCEPTABLE, RANGE_NOT_SATISFIABLE, BASIS_KIND, BASIS_WITHOUT_MESH, INVALID_RANGE_OF_MODES, BUSY]);

/// Gets eigenfunctions on the vertices
///
/// Or the eigenvectors of a problem, a row for each of its rows.
///
/// By `Accept` or `format`: `application/x-npy` (the default), an n × k array in Fortran order for `numpy.load`;
/// `application/octet-stream`, the same little-endian numbers, mode after mode, without a header; `model/ply`, the mesh
/// with the values of one mode as colours, from blue over white at zero to red; it has the kept vertices in their
/// order, which for points without faces is not that of the file. Numbers are f32 unless `dtype` says f64. Answers are
/// streamed: nothing is computed before it is sent, and of a dense basis only the chunks of 32 columns that hold these
/// modes are read.
#[utoipa::path(
    get, path = "/v1/bases/{id}/modes", tag = "bases", operation_id = "getModes",
    params(BasisId, NumberingQuery, ModesQuery),
    responses(
        (status = 200, description = "The modes", content((super::docs::Binary = "application/x-npy"), (super::docs::Binary = "application/octet-stream"), (super::docs::Binary = "model/ply")),
            headers(("ETag" = String), ("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
        (status = 304, description = "The modes are as `If-None-Match` names them"),
        GetModesProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn modes(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<ModesQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = query.format.map_or_else(|| negotiated(&headers), Ok)?;
    let record = match state.store.basis(id).await? {
        record if record.kind == ProductKind::PencilBasis.name() && format != Format::Ply => record,
        _ => find_kind(&state, id, ProductKind::Eigenbasis).await?,
    };
    let range = range_of(&query, format, record.count as usize)?;
    let dtype = query.dtype;
    let (which, hash) = (numbered.tag(), &record.content_hash);
    let tag = format!("{hash}-modes-{}-{}-{format:?}-{}{which}", range.start, range.end, dtype.name());
    if format == Format::Ply {
        return on_surface(&state, &record, range.start, tag, &headers).await;
    }
    let basis = state.store.load_eigenvectors(record.id).await?;
    let tag = conditional::strong(&tag)?;
    let known = conditional::matches(&headers, &tag);
    let to = match record.kind == ProductKind::PencilBasis.name() {
        // Rows of a problem have the numbers that it came with.
        true => Translation::default(),
        false => translation(&state, numbered, id, &basis).await?,
    };
    let mut response = if known { StatusCode::NOT_MODIFIED.into_response() } else { StatusCode::OK.into_response() };
    let head = response.headers_mut();
    head.typed_insert(tag);
    head.insert(header::VARY, HeaderValue::from_static("accept"));
    head.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=31536000, immutable"));
    if known {
        return Ok(response);
    }
    let (n, k) = (to.rows(basis.vertices()), range.len());
    let prefix = if format == Format::Npy { npz::npy(dtype.descriptor(), true, &[n, k], &[]) } else { Vec::new() };
    head.insert(header::CONTENT_TYPE, HeaderValue::from_static(if format == Format::Npy { NPY } else { OCTETS }));
    head.insert(header::CONTENT_LENGTH, HeaderValue::from((prefix.len() + dtype.bytes() * n * k) as u64));
    head.insert("chladni-rows", HeaderValue::from(n));
    head.insert("chladni-columns", HeaderValue::from(k));
    head.insert("chladni-dtype", HeaderValue::from_static(dtype.name()));
    *response.body_mut() = streamed(state, basis, to, range, dtype, prefix).await?;
    Ok(response)
}

/// The format that a client takes, by `Accept`.
fn negotiated(headers: &HeaderMap) -> Result<Format, Problem> {
    let ply = MeshFormat::Ply.media_type();
    Ok(match extract::negotiated(headers, &[NPY, OCTETS, ply])? {
        name if name == ply => Format::Ply,
        NPY => Format::Npy,
        _ => Format::F32,
    })
}

/// The modes that are asked for, of so many.
fn range_of(query: &ModesQuery, format: Format, count: usize) -> Result<Range<usize>, Problem> {
    let last = if format == Format::Ply { query.from.saturating_add(1) } else { count };
    let range = query.from..query.to.unwrap_or(last);
    if range.is_empty() || range.end > count {
        let detail = format!("Modes {}..{} were requested, but the basis has {count}.", range.start, range.end);
        return Err(Problem::new(&problem::INVALID_RANGE_OF_MODES, detail).with("count", count));
    }
    if format == Format::Ply && range.len() != 1 {
        let detail = format!("A PLY shows one mode, not {}.", range.len());
        return Err(Problem::new(&problem::INVALID_RANGE_OF_MODES, detail));
    }
    Ok(range)
}

/// The mesh with the values of one mode as colours.
async fn on_surface(
    state: &ClientState,
    record: &BasisRecord,
    mode: usize,
    tag: String,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let basis = on_vertices(state, record.id).await?;
    let mesh = state.store.load_mesh(&record.mesh).await?;
    let attributes = state.store.load_attributes(&record.mesh).await?;
    let bytes = state
        .solve("modes", move |_| {
            let mut colours = colours(&basis.lift::<f32>(mode..mode + 1)?);
            // Of a solid, its surface, whose vertices come first.
            colours.truncate(mesh.positions.len());
            let mut bytes = Vec::new();
            match attributes {
                None => write_ply(&mesh, Some(&colours), &mut bytes),
                Some(own) => write_ply_attributed(&mesh, Some(&colours), &own, PlyPrecision::Double, &mut bytes),
            }
            .map_err(Problem::internal)?;
            Ok(Bytes::from(bytes))
        })
        .await?;
    let (media_type, length) = (MeshFormat::Ply.media_type(), bytes.len() as u64);
    let file_name = format!("mode-{mode}-{}.ply", record.id);
    Immutable { tag, media_type, file_name, length }.answer(headers, bytes)
}

/// Modes panel after panel behind a prefix. The first panel is computed at once, so that a failure is a problem and not
/// a cut answer.
async fn streamed(
    state: ClientState,
    basis: Arc<Basis>,
    to: Translation,
    range: Range<usize>,
    dtype: Dtype,
    prefix: Vec<u8>,
) -> Result<Body, Problem> {
    let n = to.rows(basis.vertices());
    let panel = (PANEL_BYTES / (dtype.bytes() * n).max(1)).clamp(1, 64);
    let first = range.start..range.end.min(range.start + panel);
    let rest = first.end..range.end;
    let begin = lifted(&state, &basis, &to, first, dtype).await?;
    let parts = stream::iter([Ok(Bytes::from(prefix)), Ok(begin)]).chain(stream::try_unfold(rest, move |rest| {
        let (state, basis, to) = (state.clone(), basis.clone(), to.clone());
        async move {
            if rest.is_empty() {
                return Ok::<_, std::io::Error>(None);
            }
            let now = rest.start..rest.end.min(rest.start + panel);
            let after = now.end..rest.end;
            // A slow client holds no thread: the next panel is computed when the last one is taken.
            let bytes = lifted(&state, &basis, &to, now, dtype)
                .await
                .map_err(|refused| std::io::Error::other(refused.detail().to_owned()))?;
            Ok(Some((bytes, after)))
        }
    }));
    Ok(Body::from_stream(parts))
}

/// Some modes as little-endian numbers, mode after mode.
async fn lifted(
    state: &ClientState,
    basis: &Arc<Basis>,
    to: &Translation,
    range: Range<usize>,
    dtype: Dtype,
) -> Result<Bytes, Problem> {
    let (basis, to) = (basis.clone(), to.clone());
    state
        .solve("modes", move |_| {
            Ok(match dtype {
                Dtype::F32 => bytes_of(&basis.lift::<f32>(range)?, basis.vertices(), &to),
                Dtype::F64 => bytes_of(&basis.lift::<f64>(range)?, basis.vertices(), &to),
            })
        })
        .await
}

/// Columns of `rows` numbers as the request numbers vertices.
fn bytes_of<T: Missing + bytemuck::NoUninit>(columns: &[T], rows: usize, to: &Translation) -> Bytes {
    if to.is_identity() || rows == 0 {
        return bytemuck::cast_slice(columns).to_vec().into();
    }
    let pushed: Vec<T> = columns.chunks_exact(rows).flat_map(|column| to.push(column, 1)).collect();
    bytemuck::cast_slice(&pushed).to_vec().into()
}

/// Blue for the least value, white for zero, red for the largest; the scale is the same on both sides.
fn colours(values: &[f32]) -> Vec<[u8; 3]> {
    let largest = values.iter().fold(0f32, |largest, value| largest.max(value.abs()));
    let scale = if largest > 0.0 { 1.0 / largest } else { 0.0 };
    let ends = [[33.0, 76.0, 178.0], [247.0, 247.0, 247.0], [178.0, 24.0, 43.0]];
    let mix = |value: f32| {
        let t = value * scale;
        let end = if t < 0.0 { ends[0] } else { ends[2] };
        std::array::from_fn(|c| (ends[1][c] + t.abs() * (end[c] - ends[1][c])).round() as u8)
    };
    values.iter().map(|&value| mix(value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_symmetric_about_zero() {
        assert_eq!(colours(&[-2.0, 0.0, 2.0]), [[33, 76, 178], [247, 247, 247], [178, 24, 43]]);
        assert_eq!(colours(&[0.0, 0.0]), [[247; 3]; 2]);
    }
}
