//! Extractors that answer with problems: paths, queries and JSON.

use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{FromRequestParts, Path, Query};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use chladni_work::KINDS;
use chladni_work::packed::Packed;
use chladni_work::plain;
use serde::de::DeserializeOwned;

use super::problem::{self, Problem};
use crate::store::PageRequest;

/// Path parameters.
#[derive(Debug)]
pub struct PathOf<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for PathOf<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match Path::<T>::from_request_parts(parts, state).await {
            Ok(Path(value)) => Ok(Self(value)),
            Err(PathRejection::FailedToDeserializePathParams(error)) => {
                Err(Problem::new(&problem::NOT_FOUND, format!("The path is invalid: {}.", error.body_text())))
            }
            Err(other) => Err(Problem::internal(other)),
        }
    }
}

/// Query parameters. Types that they are read into refuse unknown parameters, so that a typing error is not ignored.
#[derive(Debug)]
pub struct QueryOf<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for QueryOf<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let text = parts.uri.query().unwrap_or_default();
        if let Some((name, _)) = form_urlencoded::parse(text.as_bytes()).find(|(_, value)| value.contains('\0')) {
            return Err(invalid_query(&format!("{name}: must not contain the character U+0000"), text));
        }
        match Query::<T>::from_request_parts(parts, state).await {
            Ok(Query(value)) => Ok(Self(value)),
            Err(QueryRejection::FailedToDeserializeQueryString(error)) => {
                Err(invalid_query(&error.body_text(), parts.uri.query().unwrap_or_default()))
            }
            Err(other) => Err(Problem::internal(other)),
        }
    }
}

/// What is wrong with a query, in words. Parameters that there are not were refused before it was read
/// ([`super::parameters`]).
pub fn invalid_query(said: &str, query: &str) -> Problem {
    let said = said.strip_prefix("Failed to deserialize query string: ").unwrap_or(said);
    // The parameter, and what is wrong with it.
    let named = said.split_once(": ").filter(|(name, _)| name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_'));
    let (name, reason) = named.unwrap_or((".", said));
    let pairs = || form_urlencoded::parse(query.as_bytes());
    let given = || pairs().find(|(own, _)| own == name).map_or(String::new(), |(_, value)| format!(", not {value:?}"));
    let wanted = match reason {
        "invalid digit found in string" | "cannot parse integer from empty string" => "a whole number of at least 0",
        "number too large to fit in target type" => "a smaller whole number",
        "invalid float literal" | "cannot parse float from empty string" => "a number",
        "provided string was not `true` or `false`" => "true or false",
        _ => "",
    };
    let told =
        if !wanted.is_empty() { format!("{name} must be {wanted}{}", given()) } else { plain::explain(name, reason) };
    Problem::new(&problem::INVALID_QUERY, format!("The query is invalid: {told}."))
}

/// A page request from query parameters.
///
/// # Errors
/// `invalid-query` where the limit is zero.
pub fn page_request(limit: Option<u32>, from: Option<String>) -> Result<PageRequest, Problem> {
    let limit = limit.unwrap_or(PageRequest::default().limit);
    if !(1..=PageRequest::MOST).contains(&limit) {
        return Err(Problem::new(
            &problem::INVALID_QUERY,
            format!("limit: must be between 1 and {}, not {limit}.", PageRequest::MOST),
        ));
    }
    Ok(PageRequest { limit, from })
}

/// Refuses a kind of job that there is not.
///
/// # Errors
/// `invalid-query`.
pub fn known_kind(kind: Option<&str>) -> Result<(), Problem> {
    match kind {
        Some(kind) if !KINDS.contains(&kind) => Err(Problem::new(
            &problem::INVALID_QUERY,
            format!("kind: must be one of {}, not {kind:?}.", KINDS.join(", ")),
        )),
        _ => Ok(()),
    }
}

/// The media type of a request body, lower case and without parameters.
pub fn media_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().ok()?;
    let essence = value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    (!essence.is_empty()).then_some(essence)
}

/// Requires a JSON body. A browser cannot send one across origins without asking first.
///
/// # Errors
/// `unsupported-media-type`.
pub fn require_json(headers: &HeaderMap) -> Result<(), Problem> {
    let found = media_type(headers);
    match found.as_deref() {
        Some(name) if name == "application/json" || name.ends_with("+json") => Ok(()),
        other => Err(Problem::new(
            &problem::UNSUPPORTED_MEDIA_TYPE,
            match other {
                Some(name) => format!("This route reads application/json, not {name:?}."),
                None => "This route reads application/json; Content-Type is missing.".to_owned(),
            },
        )),
    }
}

/// Bodies of so many bytes are read once more, to refuse lists where objects are wanted: those of longer ones are
/// numbers.
const MOST_READ_AGAIN: usize = 1 << 16;

/// Parses JSON. Nesting is limited to 128 levels.
///
/// # Errors
/// `invalid-json` where the text is no JSON, `invalid-request` where it does not fit; both say where.
pub fn parse_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value: T = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        // Where an enumeration is wanted, the parser takes `null` for a mistake of grammar.
        let read = serde_json::from_slice::<Packed>(bytes);
        let told = match (&read, error.inner().is_data()) {
            (Ok(value), true) => plain::explain_within(value, error.path(), &error.inner().to_string()),
            (Err(_), true) => plain::explain(&error.path().to_string(), &error.inner().to_string()),
            (Ok(value), false) if let Err(told) = plain::read::<T>(value) => told,
            _ => return Problem::new(&problem::INVALID_JSON, format!("{}", error.inner())),
        };
        let end = if told.ends_with('.') { "" } else { "." };
        Problem::new(&problem::INVALID_REQUEST, format!("{told}{end}"))
    })?;
    deserializer.end().map_err(|error| Problem::new(&problem::INVALID_JSON, format!("{error}")))?;
    if bytes.len() <= MOST_READ_AGAIN
        && let Ok(packed) = serde_json::from_slice::<Packed>(bytes)
    {
        plain::read::<T>(&packed).map_err(|told| Problem::new(&problem::INVALID_REQUEST, format!("{told}.")))?;
    }
    Ok(value)
}

/// What `Accept` prefers among `offered` media types, the first being the default; `None` where it admits none of them.
///
/// Quality values and wildcards count as in RFC 9110, section 12.5.1; among equals the order of `offered` decides.
pub fn negotiate<'o>(headers: &HeaderMap, offered: &[&'o str]) -> Option<&'o str> {
    let accepted: Vec<(String, f32)> = headers
        .get_all(header::ACCEPT)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .filter_map(|range| {
            let mut parts = range.split(';');
            let name = parts.next()?.trim().to_ascii_lowercase();
            let quality = parts.find_map(|p| p.trim().strip_prefix("q=").and_then(|q| q.trim().parse().ok()));
            (!name.is_empty()).then_some((name, quality.unwrap_or(1.0)))
        })
        .collect();
    if accepted.is_empty() {
        return offered.first().copied();
    }
    let quality = |offer: &str| {
        let family = offer.split('/').next().unwrap_or_default();
        let specific = |name: &str| match name {
            "*/*" => Some(0),
            name if name.strip_suffix("/*") == Some(family) => Some(1),
            name if name == offer => Some(2),
            _ => None,
        };
        let best = accepted.iter().filter_map(|(name, q)| specific(name).map(|s| (s, *q))).max_by_key(|(s, _)| *s);
        best.map_or(0.0, |(_, q)| q)
    };
    let mut best: Option<(&str, f32)> = None;
    for &offer in offered {
        let q = quality(offer);
        if q > 0.0 && best.is_none_or(|(_, highest)| q > highest) {
            best = Some((offer, q));
        }
    }
    best.map(|(offer, _)| offer)
}

/// As [`negotiate`], or the problem that lists what is offered.
pub fn negotiated<'o>(headers: &HeaderMap, offered: &[&'o str]) -> Result<&'o str, Problem> {
    negotiate(headers, offered).ok_or_else(|| {
        Problem::new(&problem::NOT_ACCEPTABLE, format!("The available media types are {}.", offered.join(", ")))
    })
}

/// A time such as `20s`, `1500ms`, `2m`, or seconds without a unit.
pub fn duration(text: &str) -> Option<std::time::Duration> {
    let text = text.trim();
    let (number, unit) = if let Some(number) = text.strip_suffix("ms") {
        (number, 0.001)
    } else if let Some(number) = text.strip_suffix('s') {
        (number, 1.0)
    } else if let Some(number) = text.strip_suffix('m') {
        (number, 60.0)
    } else {
        (text, 1.0)
    };
    std::time::Duration::try_from_secs_f64(number.trim().parse::<f64>().ok()? * unit).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Inner {
        #[allow(dead_code)]
        count: u32,
    }
    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        #[allow(dead_code)]
        parameters: Inner,
    }

    #[test]
    fn json_errors_name_the_place() {
        let refused = parse_json::<Outer>(br#"{"parameters": {"count": "x"}}"#).unwrap_err();
        assert_eq!(refused.kind(), &problem::INVALID_REQUEST);
        assert!(refused.detail().starts_with("parameters.count must be a whole number"), "{}", refused.detail());
        let refused = parse_json::<Outer>(br#"{"parameters": {"count": 1}, "more": 1}"#).unwrap_err();
        assert!(refused.detail().contains("more"), "{}", refused.detail());
        for text in ["", "{", "nonsense", r#"{"parameters": {"count": 1}} x"#] {
            assert_eq!(parse_json::<Outer>(text.as_bytes()).unwrap_err().kind(), &problem::INVALID_JSON, "{text}");
        }
        let deep = "[".repeat(100_000);
        assert_eq!(parse_json::<serde_json::Value>(deep.as_bytes()).unwrap_err().kind(), &problem::INVALID_JSON);
    }

    fn accepting(text: &str) -> Option<&'static str> {
        let mut headers = HeaderMap::new();
        if !text.is_empty() {
            headers.insert(header::ACCEPT, text.parse().unwrap());
        }
        negotiate(&headers, &["application/json", "application/octet-stream", "text/plain"])
    }

    #[test]
    fn accept_is_honoured() {
        assert_eq!(accepting(""), Some("application/json"));
        assert_eq!(accepting("*/*"), Some("application/json"));
        assert_eq!(accepting("application/octet-stream"), Some("application/octet-stream"));
        assert_eq!(accepting("application/*;q=0.1, text/*"), Some("text/plain"));
        assert_eq!(accepting("*/*, application/json;q=0"), Some("application/octet-stream"));
        assert_eq!(accepting("image/png"), None);
    }

    #[test]
    fn durations_have_units() {
        use std::time::Duration;
        assert_eq!(duration("20s"), Some(Duration::from_secs(20)));
        assert_eq!(duration("1500ms"), Some(Duration::from_millis(1500)));
        assert_eq!(duration("2m"), Some(Duration::from_secs(120)));
        assert_eq!(duration("0.5"), Some(Duration::from_millis(500)));
        for wrong in ["", "s", "-1s", "nan", "1e99m", "soon"] {
            assert_eq!(duration(wrong), None, "{wrong}");
        }
    }
}
