//! Conditional and partial requests: ETag, If-None-Match, Range and If-Range (RFC 9110, sections 13 and 14).

use std::ops::Range;

use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use headers::{ContentRange, ETag, Header, HeaderMapExt, IfNoneMatch, IfRange};
use http_range_header::{RangeUnsatisfiableError, parse_range_header};

use super::problem::{self, Problem};

/// An entity tag that names exact bytes.
///
/// # Errors
/// `internal-error` where `tag` has characters that a tag cannot have.
pub fn strong(tag: &str) -> Result<ETag, Problem> {
    format!("\"{tag}\"").parse().map_err(|_| Problem::internal(format!("{tag:?} cannot be an entity tag")))
}

/// An entity tag that names a state, however it is written or compressed.
///
/// # Errors
/// As [`strong`].
pub fn weak(tag: &str) -> Result<ETag, Problem> {
    format!("W/\"{tag}\"").parse().map_err(|_| Problem::internal(format!("{tag:?} cannot be an entity tag")))
}

/// Whether `If-None-Match` names `tag` (weak comparison), so that the answer is 304.
pub fn matches(headers: &HeaderMap, tag: &ETag) -> bool {
    headers.typed_get::<IfNoneMatch>().is_some_and(|condition| !condition.precondition_passes(tag))
}

/// The answer that `make` gives, or 304 where the client has it already; tagged in either case.
pub fn unless_known(headers: &HeaderMap, tag: ETag, make: impl FnOnce() -> Response) -> Response {
    let mut response = match matches(headers, &tag) {
        true => StatusCode::NOT_MODIFIED.into_response(),
        false => make(),
    };
    response.headers_mut().typed_insert(tag);
    response
}

/// The byte range a request asks for of a representation of `length` bytes; `None` for the whole of it.
///
/// Several ranges are answered with the whole, as RFC 9110 allows, and so is a malformed `Range` or one whose
/// `If-Range` does not name the current `tag`.
///
/// # Errors
/// `range-not-satisfiable` where the range begins beyond the end.
pub fn range(headers: &HeaderMap, length: u64, tag: &ETag) -> Result<Option<Range<u64>>, Problem> {
    let Some(text) = headers.get(header::RANGE).and_then(|value| value.to_str().ok()) else { return Ok(None) };
    if headers.contains_key(header::IF_RANGE)
        && headers.typed_get::<IfRange>().is_none_or(|condition| condition.is_modified(Some(tag), None))
    {
        return Ok(None);
    }
    let wanted = parse_range_header(text).and_then(|parsed| parsed.validate(length));
    match wanted.as_deref() {
        Ok([wanted]) => Ok(Some(*wanted.start()..wanted.end() + 1)),
        Err(RangeUnsatisfiableError::Unsatisfiable) => {
            let detail = format!("The range {text} lies beyond the {length} bytes.");
            let mut values = Vec::with_capacity(1);
            ContentRange::unsatisfied_bytes(length).encode(&mut values);
            let refused = Problem::new(&problem::RANGE_NOT_SATISFIABLE, detail);
            Err(values.into_iter().fold(refused, |refused, value| refused.header(header::CONTENT_RANGE, value)))
        }
        _ => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(text: &str) -> Result<Option<Range<u64>>, Problem> {
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, text.parse().unwrap());
        range(&headers, 100, &strong("tag").unwrap())
    }

    #[test]
    fn ranges_follow_rfc_9110() {
        assert_eq!(asked("bytes=0-9").unwrap(), Some(0..10));
        assert_eq!(asked("bytes=90-").unwrap(), Some(90..100));
        assert_eq!(asked("bytes=-10").unwrap(), Some(90..100));
        assert_eq!(asked("bytes=-1000").unwrap(), Some(0..100));
        assert_eq!(asked("bytes=50-1000").unwrap(), Some(50..100));
        assert_eq!(asked("bytes=0-99999999999999999999999").unwrap(), Some(0..100));
        for whole in ["bytes=9-0", "bytes=a-b", "bytes=", "bytes=-", "items=0-9", "bytes=0-1,5-6", "nonsense"] {
            assert_eq!(asked(whole).unwrap(), None, "{whole}");
        }
        for refused in ["bytes=100-", "bytes=100-200", "bytes=-0", "bytes=99999999999999999999999-"] {
            assert_eq!(asked(refused).unwrap_err().kind().status, 416, "{refused}");
        }
    }

    #[test]
    fn if_range_must_name_the_current_tag() {
        let tag = strong("tag").unwrap();
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, "bytes=0-9".parse().unwrap());
        for stale in ["\"other\"", "W/\"tag\"", "nonsense"] {
            headers.insert(header::IF_RANGE, stale.parse().unwrap());
            assert_eq!(range(&headers, 100, &tag).unwrap(), None, "{stale}");
        }
        headers.insert(header::IF_RANGE, "\"tag\"".parse().unwrap());
        assert_eq!(range(&headers, 100, &tag).unwrap(), Some(0..10));
    }

    #[test]
    fn if_none_match_compares_weakly() {
        let mut headers = HeaderMap::new();
        headers.insert(header::IF_NONE_MATCH, "\"a\", W/\"b\"".parse().unwrap());
        assert!(matches(&headers, &strong("b").unwrap()));
        assert!(matches(&headers, &weak("a").unwrap()));
        assert!(!matches(&headers, &strong("c").unwrap()));
        headers.insert(header::IF_NONE_MATCH, "*".parse().unwrap());
        assert!(matches(&headers, &strong("c").unwrap()));
    }
}
