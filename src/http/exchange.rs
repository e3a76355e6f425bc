//! What synchronous operations take and give: JSON or raw little-endian numbers, both ways.

use std::time::Instant;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use chladni_algebra::DenseMatrix;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::binary::{self, Dtype};
use super::body::{self, WholeBody};
use super::client::ClientState;
use super::extract;
use super::problem::{self, Problem};
use super::shares::Share;

/// The media type of raw numbers.
pub const OCTETS: &str = "application/octet-stream";
/// The media type of JSON.
pub const JSON: &str = "application/json";

/// What a request carries: JSON, or raw numbers.
pub enum Sent<T> {
    /// JSON, parsed.
    Json(T),
    /// Raw numbers.
    Raw(WholeBody),
}

/// Reads the body as its Content-Type says.
///
/// # Errors
/// `unsupported-media-type`, and what reading bodies and parsing JSON answer.
pub async fn read<T: DeserializeOwned + Send + 'static>(
    state: &ClientState,
    headers: &HeaderMap,
    content: Body,
) -> Result<Sent<T>, Problem> {
    let media_type = extract::media_type(headers);
    let json = match media_type.as_deref() {
        Some(JSON) => true,
        Some(OCTETS) | None => false,
        Some(other) => {
            let other = problem::shorten(other.to_owned());
            let detail = format!("This route reads {JSON} and {OCTETS}, not {other:?}.");
            return Err(Problem::new(&problem::UNSUPPORTED_MEDIA_TYPE, detail));
        }
    };
    let body = body::read(state, headers, content, state.config.limits.max_body_bytes).await?;
    if !json {
        return Ok(Sent::Raw(body));
    }
    parse(state, body, BYTES_PER_NUMBER).await.map(Sent::Json)
}

/// The memory that a number of a JSON body takes at most while it is parsed straight into an array: the array doubles
/// as it grows, and the old one lies beside the new one.
pub const BYTES_PER_NUMBER: u64 = 24;

/// Bodies that are parsed at once: what takes longer leaves the event loop to others.
const PARSED_AT_ONCE: usize = 1 << 14;

/// Parses a JSON body. The memory for it, `bytes_per_number` for each number that it may hold, is the client's to
/// answer for until its request and the work that it began have ended.
///
/// # Errors
/// `invalid-json`, `invalid-request`, and those of [`body::reserve`].
pub async fn parse<T: DeserializeOwned + Send + 'static>(
    state: &ClientState,
    body: WholeBody,
    bytes_per_number: u64,
) -> Result<T, Problem> {
    let small = body.bytes.len() <= PARSED_AT_ONCE;
    let work = move || parsed(body, bytes_per_number);
    let (value, share) = match small {
        true => work()?,
        false => tokio::task::spawn_blocking(work).await.map_err(Problem::internal)??,
    };
    state.hold(share);
    Ok(value)
}

fn parsed<T: DeserializeOwned>(mut body: WholeBody, bytes_per_number: u64) -> Result<(T, Share), Problem> {
    // Two numbers stand apart by a comma.
    let most_numbers = 1 + body.bytes.iter().filter(|&&byte| byte == b',').count() as u64;
    let memory = most_numbers.saturating_mul(bytes_per_number);
    body.charge(memory)?;
    let value = extract::parse_json(&body.bytes)?;
    Ok((value, body.spent(memory)))
}

/// What a raw body does not say: the query's `request`, as JSON.
///
/// # Errors
/// `invalid-query` where it is missing or is no JSON, `invalid-request` where it does not fit.
pub fn rest<T: DeserializeOwned>(request: Option<&str>) -> Result<T, Problem> {
    let text = request.ok_or_else(|| {
        Problem::new(
            &problem::INVALID_QUERY,
            "request: is missing; a raw body needs the rest of the request in the query.",
        )
    })?;
    extract::parse_json(text.as_bytes()).map_err(|refused| match refused.kind() == &problem::INVALID_JSON {
        true => Problem::new(&problem::INVALID_QUERY, format!("request: {}", refused.detail())),
        false => refused,
    })
}

/// A request that is JSON, or raw numbers which `fill` puts into what the query's `request` tells of the rest; and
/// whether the answer is raw.
///
/// # Errors
/// Those of [`read`], [`raw_answer`], [`rest`] and `fill`.
pub async fn request<T: DeserializeOwned + Send + 'static>(
    state: &ClientState,
    headers: &HeaderMap,
    content: Body,
    query: Option<&str>,
    fill: impl FnOnce(&mut T, &[u8]) -> Result<(), Problem>,
) -> Result<(T, bool), Problem> {
    let sent = read::<T>(state, headers, content).await?;
    let raw = raw_answer(headers, matches!(sent, Sent::Raw(_)))?;
    match sent {
        Sent::Json(request) => Ok((request, raw)),
        Sent::Raw(body) => {
            let mut request = rest(query)?;
            fill(&mut request, &body.bytes)?;
            Ok((request, raw))
        }
    }
}

/// Whether the answer is raw: as `Accept` says, else as the request was.
///
/// # Errors
/// `not-acceptable`.
pub fn raw_answer(headers: &HeaderMap, raw_request: bool) -> Result<bool, Problem> {
    Ok(answer_type(headers, raw_request, &[])? == OCTETS)
}

/// The media type of the answer: as `Accept` says, else JSON or raw numbers as the request was; `others` may be asked
/// for as well.
///
/// # Errors
/// `not-acceptable`.
pub fn answer_type<'o>(headers: &HeaderMap, raw_request: bool, others: &[&'o str]) -> Result<&'o str, Problem> {
    let mut offered = if raw_request { vec![OCTETS, JSON] } else { vec![JSON, OCTETS] };
    offered.extend(others);
    extract::negotiated(headers, &offered)
}

/// An answer's bytes with what describes them.
pub struct Answer {
    bytes: Bytes,
    media_type: &'static str,
    headers: Vec<(&'static str, String)>,
    seconds: f64,
}

impl Answer {
    /// Bytes of any media type; `begin` is when the work began.
    pub fn new(bytes: impl Into<Bytes>, media_type: &'static str, begin: Instant) -> Self {
        let bytes = bytes.into();
        Self { bytes, media_type, headers: Vec::new(), seconds: begin.elapsed().as_secs_f64() }
    }

    /// A matrix as raw numbers, row after row, with its shape in the headers.
    pub fn raw(matrix: &DenseMatrix, dtype: Dtype, begin: Instant) -> Self {
        Self::new(binary::encode(matrix, dtype), OCTETS, begin)
            .with("chladni-rows", matrix.rows())
            .with("chladni-columns", matrix.columns())
            .with("chladni-dtype", dtype.name())
    }

    /// A value as JSON.
    ///
    /// # Errors
    /// None in practice.
    pub fn json(value: &impl Serialize, begin: Instant) -> Result<Self, Problem> {
        let seconds = begin.elapsed().as_secs_f64();
        let bytes = serde_json::to_vec(value).map_err(Problem::internal)?.into();
        Ok(Self { bytes, media_type: JSON, headers: Vec::new(), seconds })
    }

    /// A matrix, raw or as a JSON table.
    ///
    /// # Errors
    /// None in practice.
    pub fn table(matrix: &DenseMatrix, raw: bool, dtype: Dtype, begin: Instant) -> Result<Self, Problem> {
        if raw { Ok(Self::raw(matrix, dtype, begin)) } else { Self::json(&binary::to_table(matrix), begin) }
    }

    /// Adds a response header; its name is lower case.
    pub fn with(mut self, name: &'static str, value: impl ToString) -> Self {
        self.headers.push((name, value.to_string()));
        self
    }
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        let mut response = self.bytes.into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        for (name, value) in self.headers {
            if let Ok(value) = HeaderValue::from_str(&value) {
                headers.insert(HeaderName::from_static(name), value);
            }
        }
        if let Ok(value) = HeaderValue::from_str(&format!("solve;dur={:.3}", 1e3 * self.seconds)) {
            headers.insert("server-timing", value);
        }
        response
    }
}
