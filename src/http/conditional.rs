//! Conditional and partial requests: ETag, If-Match, If-None-Match, Range and If-Range (RFC 9110, sections 13 and 14).

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

/// Goes on only where `If-Match`, if there is one, names `tag` or `*`. Tags of resources are weak, as one state of
/// them is written in many ways; who changes a resource means its state, so that they are compared without regard to
/// that, other than RFC 9110 has it for those who change bytes.
///
/// # Errors
/// `precondition-failed`.
pub fn require(headers: &HeaderMap, tag: &ETag) -> Result<(), Problem> {
    let bare = |tag: &str| tag.trim().trim_start_matches("W/").to_owned();
    let mut own = Vec::with_capacity(1);
    tag.encode(&mut own);
    let own = own.first().and_then(|tag| tag.to_str().ok()).map(bare).unwrap_or_default();
    let named = headers.get_all(header::IF_MATCH).iter().map(|line| line.to_str().unwrap_or_default());
    let mut none = true;
    for tag in named.flat_map(|line| line.split(',')).map(bare) {
        if tag == "*" || tag == own {
            return Ok(());
        }
        none = false;
    }
    match none {
        true => Ok(()),
        false => {
            let detail = format!("If-Match names another state than {own}, which is the present one.");
            Err(Problem::new(&problem::PRECONDITION_FAILED, detail))
        }
    }
}

/// Whether a request has a condition that [`require`] looks at.
pub fn has_condition(headers: &HeaderMap) -> bool {
    headers.contains_key(header::IF_MATCH)
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
    fn if_match_names_the_present_state_however_strongly() {
        let tag = weak("tag").unwrap();
        let asked = |lines: &[&str]| {
            let mut headers = HeaderMap::new();
            for line in lines {
                headers.append(header::IF_MATCH, line.parse().unwrap());
            }
            require(&headers, &tag).map_err(|problem| problem.kind().status)
        };
        for holds in [&[][..], &["*"], &["W/\"tag\""], &["\"tag\""], &["\"a\", W/\"tag\""], &["\"a\"", "\"tag\""]] {
            assert_eq!(asked(holds), Ok(()), "{holds:?}");
        }
        for fails in [&["\"other\""][..], &["W/\"tag2\""], &["tag"], &[""]] {
            assert_eq!(asked(fails), Err(412), "{fails:?}");
        }
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
