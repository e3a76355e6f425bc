//! What meshes and problems have in common over the wire: an id that stays, and a name that people change.

use axum::Json;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use headers::{ETag, HeaderMapExt};
use serde::{Deserialize, Serialize};

use super::client::ClientState;
use super::problem::{self, Problem};
use super::upload::check_name;
use super::{body, conditional, exchange, extract};

/// The largest body with a name.
const NAME_BYTES: u64 = 16 << 10;

/// A new name.
#[derive(Debug, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "bunny, scanned in March"}))]
pub struct RenameRequest {
    /// A name for people, at most 200 characters; null or nothing but blanks takes it away.
    name: Option<String>,
}

/// The name that a request gives.
///
/// # Errors
/// `invalid-request`, and what reading a body may end in.
pub async fn new_name(state: &ClientState, headers: &HeaderMap, body: Body) -> Result<Option<String>, Problem> {
    extract::require_json(headers)?;
    let body = body::read(state, headers, body, NAME_BYTES).await?;
    let request: RenameRequest = exchange::parse(state, body, exchange::BYTES_PER_NUMBER).await?;
    let name = request.name.filter(|name| !name.trim().is_empty());
    check_name(name.as_deref(), &problem::INVALID_REQUEST)?;
    Ok(name)
}

/// The entity tag of a resource by its id and its name.
///
/// # Errors
/// As [`conditional::weak`].
pub fn tag(id: &str, name: Option<&str>) -> Result<ETag, Problem> {
    match name {
        None => conditional::weak(id),
        Some(name) => conditional::weak(&format!("{id}-{}", &blake3::hash(name.as_bytes()).to_hex()[..16])),
    }
}

/// The answer to an upload: 201 where it made something new, 200 where that was there.
pub fn stored(created: bool, address: &str, tag: ETag, resource: impl Serialize) -> Response {
    let status = if created { StatusCode::CREATED } else { StatusCode::OK };
    let mut response = (status, Json(resource)).into_response();
    if let Ok(address) = HeaderValue::from_str(address) {
        response.headers_mut().insert(header::LOCATION, address);
    }
    response.headers_mut().typed_insert(tag);
    response
}

/// The resource, or 304 where the client has it already.
pub fn shown(headers: &HeaderMap, tag: ETag, resource: impl Serialize) -> Response {
    let mut response = conditional::unless_known(headers, tag, || Json(resource).into_response());
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    response
}
