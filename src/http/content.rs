//! Content with an immutable tag: whole or in ranges, from memory or streamed from the store.

use std::ops::Range;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use chladni_spectral::basis::{Basis, ProductKind};
use chladni_spectral::formats::{self, FormatError};
use futures_util::{StreamExt, stream};
use headers::{ContentRange, ETag, HeaderMapExt};
use serde::Deserialize;
use tokio::sync::mpsc;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::client::ClientState;
use super::conditional;
use super::extract::{self, QueryOf};
use super::ids::BasisId;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;
use crate::store::{BasisRecord, BasisStorage};

/// The routes of content of bases.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(basis_content))
}

/// What does not change as long as its tag does not.
pub struct Immutable {
    /// The entity tag without quotes.
    pub tag: String,
    /// The media type.
    pub media_type: &'static str,
    /// The name of the file when it is saved.
    pub file_name: String,
    /// The length of the whole, in bytes.
    pub length: u64,
}

/// What the conditions and the range of a request come to.
pub enum Conditional {
    /// It has it already: the answer is there.
    Known(Response),
    /// These bytes, under this head.
    Bytes(Range<u64>, Response),
}

impl Immutable {
    /// Looks at the conditions and the range of a request.
    ///
    /// # Errors
    /// `range-not-satisfiable`.
    pub fn conditional(&self, headers: &HeaderMap) -> Result<Conditional, Problem> {
        let tag = conditional::strong(&self.tag)?;
        if conditional::matches(headers, &tag) {
            let mut response = StatusCode::NOT_MODIFIED.into_response();
            self.describe(&mut response, tag);
            return Ok(Conditional::Known(response));
        }
        let range = conditional::range(headers, self.length, &tag)?;
        let status = if range.is_some() { StatusCode::PARTIAL_CONTENT } else { StatusCode::OK };
        let mut response = status.into_response();
        self.describe(&mut response, tag);
        let head = response.headers_mut();
        head.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type));
        if let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{}\"", self.file_name)) {
            head.insert(header::CONTENT_DISPOSITION, value);
        }
        if let Some(range) = range.clone() {
            head.typed_insert(ContentRange::bytes(range, self.length).map_err(Problem::internal)?);
        }
        let range = range.unwrap_or(0..self.length);
        head.insert(header::CONTENT_LENGTH, HeaderValue::from(range.end - range.start));
        Ok(Conditional::Bytes(range, response))
    }

    fn describe(&self, response: &mut Response, tag: ETag) {
        let head = response.headers_mut();
        head.typed_insert(tag);
        head.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        head.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, max-age=31536000, immutable"));
        head.insert(header::VARY, HeaderValue::from_static("accept"));
    }

    /// Answers from memory.
    ///
    /// # Errors
    /// `range-not-satisfiable`.
    pub fn answer(self, headers: &HeaderMap, bytes: Bytes) -> Result<Response, Problem> {
        match self.conditional(headers)? {
            Conditional::Known(response) => Ok(response),
            Conditional::Bytes(range, mut response) => {
                *response.body_mut() = Body::from(bytes.slice(range.start as usize..range.end as usize));
                Ok(response)
            }
        }
    }
}

impl From<FormatError> for Problem {
    fn from(error: FormatError) -> Self {
        Self::internal(error)
    }
}

/// How the factors of a basis are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum Format {
    Npz,
    Safetensors,
    MatrixMarket,
}

const NPZ: &str = "application/x-npz";
const SAFETENSORS: &str = "application/x-safetensors";
const MATRIX_MARKET: &str = "application/x-matrix-market+zip";

impl Format {
    fn media_type(self) -> &'static str {
        match self {
            Self::Npz => NPZ,
            Self::Safetensors => SAFETENSORS,
            Self::MatrixMarket => MATRIX_MARKET,
        }
    }

    /// The format that `Accept` asks for, and the media type that it knows it by.
    fn negotiated(headers: &HeaderMap) -> Result<(Self, &'static str), Problem> {
        // An NPZ is a ZIP archive and a stream of octets as well.
        let offered = [NPZ, SAFETENSORS, MATRIX_MARKET, "application/zip", "application/octet-stream"];
        Ok(match extract::negotiated(headers, &offered)? {
            SAFETENSORS => (Self::Safetensors, SAFETENSORS),
            MATRIX_MARKET => (Self::MatrixMarket, MATRIX_MARKET),
            npz => (Self::Npz, npz),
        })
    }
}

/// How to write the content.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ContentQuery {
    /// Takes the place of `Accept`.
    #[param(inline)]
    format: Option<Format>,
}

problems!(GetBasisContentProblems: [INVALID_QUERY, UNKNOWN_BASIS, NOT_ACCEPTABLE, RANGE_NOT_SATISFIABLE, DAMAGED_CONTENT]);

/// Gets a basis as a file
///
/// The eigenfunctions of a compact basis are the columns of `U φ̄`, with the sparse `U` (n × d, f32) and the dense `φ̄`
/// (d × m, f64); those of a dense basis are the columns of `functions` (n × m, f32 or f64).
///
/// As NPZ (the default): the members `format`, `shape`, `data`, `indices`, `indptr` of U in CSR form and
/// `coefficients`, or `functions`, beside `eigenvalues`, the mass, `residuals`, `bounds`, `certificate` and `metadata`;
/// it opens with `numpy.load` (everything) and `scipy.sparse.load_npz` (U). As safetensors and as a ZIP archive of
/// MatrixMarket files: the same under the same names (the rows of safetensors' `functions` are the eigenfunctions).
/// Dense bases are streamed; their MatrixMarket form has no ranges.
///
/// A field basis comes as NPZ alone: `format`, `shape`, `data`, `indices`, `indptr` of the locally supported columns in
/// BSR form, a block row for each face, for `scipy.sparse.load_npz`; `dense` columns for harmonic fields; `stiffness`
/// and `mass` of the space in CSR form; `ritz_values` and `ritz_vectors`; `samples`, `area`, `kind` and `metadata`.
#[utoipa::path(
    get, path = "/v1/bases/{id}/content", tag = "bases", operation_id = "getBasisContent",
    params(
        BasisId,
        ContentQuery,
        ("Range" = Option<String>, Header, description = "One range of bytes", example = "bytes=0-1023"),
        ("Prefer" = Option<String>, Header, description = "`redirect`: an NPZ is rather fetched from the object store, where the server keeps content in one", example = "redirect"),
    ),
    responses(
        (status = 200, description = "The whole content", content(
            (super::docs::Binary = "application/x-npz"), (super::docs::Binary = "application/x-safetensors"), (super::docs::Binary = "application/x-matrix-market+zip"),
            (super::docs::Binary = "application/zip"), (super::docs::Binary = "application/octet-stream")),
            headers(("ETag" = String))),
        (status = 206, description = "The bytes that `Range` asks for", content((super::docs::Binary = "application/x-npz"), (super::docs::Binary = "application/x-safetensors"), (super::docs::Binary = "application/x-matrix-market+zip"), (super::docs::Binary = "application/zip"), (super::docs::Binary = "application/octet-stream")), headers(("Content-Range" = String))),
        (status = 304, description = "The content is as `If-None-Match` names it"),
        (status = 307, description = "With `Prefer: redirect`: where the NPZ lies, for five minutes. Whoever has this address needs no key; `ETag` is the BLAKE3 hash of what it gives", headers(("Location" = String), ("ETag" = String))),
        GetBasisContentProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn basis_content(
    state: ClientState,
    BasisId(id): BasisId,
    QueryOf(query): QueryOf<ContentQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (format, media_type) = match query.format {
        Some(format) => (format, format.media_type()),
        None => Format::negotiated(&headers)?,
    };
    let record = state.store.basis(id).await?;
    let immutable = |suffix: &str, extension: &str, length: u64| Immutable {
        tag: format!("{}{suffix}", record.content_hash),
        media_type,
        file_name: format!("basis-{}.{extension}", record.id),
        length,
    };
    let written: fn(&Basis) -> Result<Vec<u8>, FormatError> = match format {
        Format::Npz => {
            return match immutable("", "npz", record.bytes).conditional(&headers)? {
                Conditional::Known(response) => Ok(response),
                Conditional::Bytes(range, mut response) => {
                    if prefers_redirect(&headers)
                        && let Some(elsewhere) = elsewhere(&state, &record, media_type).await?
                    {
                        return Ok(elsewhere);
                    }
                    state.store.check_content(&record.content_hash, &range).await?;
                    *response.body_mut() = Body::from_stream(state.store.blob_stream(&record.content_hash, range));
                    Ok(response)
                }
            };
        }
        Format::Safetensors => formats::safetensors::to_bytes,
        Format::MatrixMarket => formats::matrix_market::to_bytes,
    };
    if ![ProductKind::Eigenbasis, ProductKind::PencilBasis].iter().any(|kind| kind.name() == record.kind) {
        let detail = format!("A basis of the kind {} comes as {NPZ}.", record.kind);
        return Err(Problem::new(&problem::NOT_ACCEPTABLE, detail));
    }
    let basis = state.store.load_eigenvectors(record.id).await?;
    if let BasisStorage::Dense(layout) = &record.storage {
        let (hash, columns) = (&record.content_hash, layout.start..layout.end);
        if format == Format::Safetensors {
            let head = state.on_intake_pool(move || Ok(Bytes::from(formats::safetensors::dense_head(&basis)?))).await?;
            let length = head.len() as u64 + (columns.end - columns.start);
            let whole = immutable("-safetensors", "safetensors", length);
            return Ok(match whole.conditional(&headers)? {
                Conditional::Known(response) => response,
                Conditional::Bytes(range, mut response) => {
                    state.store.check_content(hash, &columns).await?;
                    *response.body_mut() = head_and_blob(&state, hash, head, columns, range);
                    response
                }
            });
        }
        return matrix_market_stream(&immutable("-mtx", "mtx.zip", 0), &headers, basis);
    }
    let bytes = state.on_intake_pool(move || Ok(Bytes::from(written(&basis)?))).await?;
    let (suffix, extension) =
        if format == Format::Safetensors { ("-safetensors", "safetensors") } else { ("-mtx", "mtx.zip") };
    immutable(suffix, extension, bytes.len() as u64).answer(&headers, bytes)
}

/// Whether a client would rather be sent to where the content lies.
fn prefers_redirect(headers: &HeaderMap) -> bool {
    let preferences = headers.get_all("prefer").iter().filter_map(|value| value.to_str().ok());
    preferences.flat_map(|value| value.split(',')).any(|preference| preference.trim().eq_ignore_ascii_case("redirect"))
}

/// Sends a client to where the content lies, if that is an object store. The tag is the BLAKE3 hash of what it gets
/// there.
async fn elsewhere(state: &ClientState, record: &BasisRecord, media_type: &str) -> Result<Option<Response>, Problem> {
    let file_name = format!("basis-{}.npz", record.id);
    state.store.refuse_damaged(&record.content_hash).await?;
    let Some(address) = state.store.signed_address(&record.content_hash, media_type, &file_name).await? else {
        return Ok(None);
    };
    let mut response = StatusCode::TEMPORARY_REDIRECT.into_response();
    let head = response.headers_mut();
    head.typed_insert(conditional::strong(&record.content_hash)?);
    head.insert(header::LOCATION, HeaderValue::try_from(address).map_err(Problem::internal)?);
    head.insert("preference-applied", HeaderValue::from_static("redirect"));
    // The address is good for some minutes, and whoever has it needs no key.
    head.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    head.insert(header::VARY, HeaderValue::from_static("accept, prefer"));
    Ok(Some(response))
}

/// A range of what begins with `head` and goes on with some bytes of a blob.
fn head_and_blob(state: &ClientState, hash: &str, head: Bytes, blob: Range<u64>, range: Range<u64>) -> Body {
    let length = head.len() as u64;
    let first = head.slice(range.start.min(length) as usize..range.end.min(length) as usize);
    let rest = blob.start + range.start.saturating_sub(length)..blob.start + range.end.saturating_sub(length);
    let first = stream::iter((!first.is_empty()).then_some(Ok(first)));
    Body::from_stream(first.chain(state.store.blob_stream(hash, rest)))
}

/// Pieces of a streamed file that wait for the client.
const PIECES: usize = 4;

/// The MatrixMarket form of a dense basis, written while it is sent: nobody knows its length before.
fn matrix_market_stream(
    immutable: &Immutable,
    headers: &HeaderMap,
    basis: std::sync::Arc<Basis>,
) -> Result<Response, Problem> {
    let tag = conditional::strong(&immutable.tag)?;
    let known = conditional::matches(headers, &tag);
    let mut response = if known { StatusCode::NOT_MODIFIED } else { StatusCode::OK }.into_response();
    immutable.describe(&mut response, tag);
    let head = response.headers_mut();
    head.insert(header::ACCEPT_RANGES, HeaderValue::from_static("none"));
    if known {
        return Ok(response);
    }
    head.insert(header::CONTENT_TYPE, HeaderValue::from_static(immutable.media_type));
    if let Ok(value) = HeaderValue::from_str(&format!("attachment; filename=\"{}\"", immutable.file_name)) {
        head.insert(header::CONTENT_DISPOSITION, value);
    }
    let (sender, mut pieces) = mpsc::channel(PIECES);
    tokio::task::spawn_blocking(move || {
        let mut out = Pieces(sender.clone());
        if let Err(error) = formats::matrix_market::write(&basis, &mut out) {
            // A client that went away hears nothing; any other sees the answer end early.
            let _gone = sender.blocking_send(Err(std::io::Error::other(error)));
        }
    });
    *response.body_mut() = Body::from_stream(stream::poll_fn(move |context| pieces.poll_recv(context)));
    Ok(response)
}

/// Hands bytes on to an answer.
struct Pieces(mpsc::Sender<std::io::Result<Bytes>>);

impl std::io::Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let piece = Ok(Bytes::copy_from_slice(bytes));
        self.0.blocking_send(piece).map_err(|_| std::io::Error::from(std::io::ErrorKind::BrokenPipe))?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
