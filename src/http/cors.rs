//! What pages of other origins may send, and what they may read of the answers.

use axum::http::{HeaderName, HeaderValue, Method, header};
use tower_http::cors::{AllowOrigin, Any, CorsLayer};

use super::middleware::REQUEST_ID;

/// How long a browser remembers what it may do.
const REMEMBERED: std::time::Duration = std::time::Duration::from_secs(3600);

/// The headers of ours that answers have. A browser shows a page of another origin only those that are exposed.
const OWN: [&str; 21] = [
    "chladni-columns",
    "chladni-covered",
    "chladni-dtype",
    "chladni-eigenvalues",
    "chladni-energies",
    "chladni-error",
    "chladni-estimates",
    "chladni-form",
    "chladni-held-loads",
    "chladni-lines",
    "chladni-matching",
    "chladni-modes",
    "chladni-modes-too-high",
    "chladni-outcome",
    "chladni-peak",
    "chladni-relative-error",
    "chladni-residual",
    "chladni-rows",
    "chladni-slope-error",
    "chladni-space",
    "chladni-strands",
];

/// Lets pages of `origins` call the API; `*` stands for all.
pub fn layer(origins: &[String]) -> CorsLayer {
    let known = [
        header::ACCEPT_RANGES,
        header::CONTENT_DISPOSITION,
        header::CONTENT_RANGE,
        header::ETAG,
        header::LOCATION,
        header::RETRY_AFTER,
        header::WWW_AUTHENTICATE,
        HeaderName::from_static("server-timing"),
        REQUEST_ID,
    ];
    let exposed: Vec<HeaderName> = OWN.map(HeaderName::from_static).into_iter().chain(known).collect();
    let layer = CorsLayer::new()
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PATCH, Method::DELETE])
        .allow_headers([
            header::ACCEPT,
            header::AUTHORIZATION,
            header::CONTENT_ENCODING,
            header::CONTENT_TYPE,
            header::IF_MATCH,
            header::IF_NONE_MATCH,
            header::IF_RANGE,
            header::RANGE,
            HeaderName::from_static("idempotency-key"),
            HeaderName::from_static("last-event-id"),
            REQUEST_ID,
        ])
        .expose_headers(exposed)
        .max_age(REMEMBERED);
    if origins.iter().any(|origin| origin == "*") {
        return layer.allow_origin(Any);
    }
    layer.allow_origin(AllowOrigin::list(origins.iter().filter_map(|origin| HeaderValue::from_str(origin).ok())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The names of our headers in the sources of a folder, this file left out.
    fn named(folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                named(&path, found);
            } else if path.file_name().is_some_and(|name| name != "cors.rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                let names = text.split('"').filter(|word| word.starts_with("chladni-"));
                let plain = |name: &&str| name.bytes().all(|b| b.is_ascii_lowercase() || b == b'-');
                found.extend(names.filter(plain).map(str::to_owned));
            }
        }
    }

    #[test]
    fn every_header_of_ours_is_exposed() {
        let mut found = Vec::new();
        named(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/http"), &mut found);
        found.sort_unstable();
        found.dedup();
        assert_eq!(found, OWN);
    }

    #[test]
    fn every_header_that_the_document_tells_of_is_exposed() {
        let document: serde_json::Value = serde_json::from_str(&super::super::openapi().unwrap()).unwrap();
        let exposed = format!("{:?}", layer(&[])).to_lowercase();
        let operations =
            document["paths"].as_object().unwrap().values().flat_map(|path| path.as_object().unwrap().values());
        let responses = operations.flat_map(|operation| operation["responses"].as_object().unwrap().values());
        let headers: Vec<&String> = responses.filter_map(|r| r["headers"].as_object()).flat_map(|h| h.keys()).collect();
        assert!(headers.len() > 20, "{headers:?}");
        for header in headers {
            assert!(exposed.contains(&header.to_lowercase()), "{header}");
        }
    }
}
