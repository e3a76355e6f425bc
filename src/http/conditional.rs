//! Conditional and partial requests: ETag, If-None-Match, Range and If-Range (RFC 9110, sections 13 and 14).

use std::ops::Range;

use axum::http::{HeaderMap, HeaderValue, header};

use super::problem::{self, Problem};

/// The header value of an entity tag, or `None` where `tag` has characters that a tag cannot have.
pub fn etag(tag: &str, weak: bool) -> Option<HeaderValue> {
    let value = if weak { format!("W/\"{tag}\"") } else { format!("\"{tag}\"") };
    HeaderValue::from_str(&value).ok()
}

/// Whether `If-None-Match` names `tag` (weak comparison), so that the answer is 304.
pub fn matches(headers: &HeaderMap, tag: &HeaderValue) -> bool {
    let Ok(tag) = tag.to_str() else { return false };
    let opaque = |t: &str| t.trim().trim_start_matches("W/").to_owned();
    headers
        .get_all(header::IF_NONE_MATCH)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .any(|candidate| candidate.trim() == "*" || opaque(candidate) == opaque(tag))
}

/// The byte range a request asks for of a representation of `length` bytes; `None` for the whole of it.
///
/// Several ranges are answered with the whole, as RFC 9110 allows, and so is a malformed `Range` or one whose `If-Range`
/// does not name the current `tag`.
///
/// # Errors
/// `range-not-satisfiable` where the range begins beyond the end.
pub fn range(headers: &HeaderMap, length: u64, tag: &HeaderValue) -> Result<Option<Range<u64>>, Problem> {
    let Some(text) = headers.get(header::RANGE).and_then(|value| value.to_str().ok()) else { return Ok(None) };
    if let Some(condition) = headers.get(header::IF_RANGE) {
        // If-Range needs a strong match.
        if condition != tag || tag.as_bytes().starts_with(b"W/") {
            return Ok(None);
        }
    }
    let Some((unit, spec)) = text.split_once('=') else { return Ok(None) };
    if !unit.trim().eq_ignore_ascii_case("bytes") {
        return Ok(None);
    }
    let spec = spec.trim();
    let Some((first, last)) = spec.split_once('-').filter(|_| !spec.contains(',')) else { return Ok(None) };
    let (first, last) = (first.trim(), last.trim());
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    // A number beyond u64 is a number beyond the end.
    let number = |text: &str| text.parse::<u64>().unwrap_or(u64::MAX);
    let wanted = match (digits(first), digits(last)) {
        (true, true) if number(first) <= number(last) => number(first)..number(last).saturating_add(1).min(length),
        (true, false) if last.is_empty() => number(first)..length,
        (false, true) if first.is_empty() => length.saturating_sub(number(last))..length,
        _ => return Ok(None),
    };
    if wanted.start >= length || wanted.is_empty() {
        let mut refused =
            Problem::new(&problem::RANGE_NOT_SATISFIABLE, format!("The range {text} lies beyond the {length} bytes."));
        if let Ok(value) = HeaderValue::from_str(&format!("bytes */{length}")) {
            refused = refused.header(header::CONTENT_RANGE, value);
        }
        return Err(refused);
    }
    Ok(Some(wanted))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(text: &str) -> Result<Option<Range<u64>>, Problem> {
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, text.parse().unwrap());
        range(&headers, 100, &etag("tag", false).unwrap())
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
        let tag = etag("tag", false).unwrap();
        let mut headers = HeaderMap::new();
        headers.insert(header::RANGE, "bytes=0-9".parse().unwrap());
        headers.insert(header::IF_RANGE, "\"other\"".parse().unwrap());
        assert_eq!(range(&headers, 100, &tag).unwrap(), None);
        headers.insert(header::IF_RANGE, "\"tag\"".parse().unwrap());
        assert_eq!(range(&headers, 100, &tag).unwrap(), Some(0..10));
    }

    #[test]
    fn if_none_match_compares_weakly() {
        let mut headers = HeaderMap::new();
        headers.insert(header::IF_NONE_MATCH, "\"a\", W/\"b\"".parse().unwrap());
        assert!(matches(&headers, &etag("b", false).unwrap()));
        assert!(matches(&headers, &etag("a", true).unwrap()));
        assert!(!matches(&headers, &etag("c", false).unwrap()));
        headers.insert(header::IF_NONE_MATCH, "*".parse().unwrap());
        assert!(matches(&headers, &etag("c", false).unwrap()));
    }
}
