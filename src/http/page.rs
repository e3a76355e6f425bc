//! The web page: built from `web/`, embedded in the binary, and a client of the public routes like any other.

use std::sync::OnceLock;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::conditional;
use super::problem::{self, Problem};
use super::state::AppState;

/// Name and content of every file of the page, from the build script.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// Nothing from elsewhere, no inline script or style, no frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
     connect-src 'self'; media-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The routes of the page. They are no part of the API and stand in no document.
pub fn routes() -> Router<AppState> {
    Router::new()
        .route("/", get(async |headers: HeaderMap| file("index.html", &headers)))
        .route("/icon.svg", get(async |headers: HeaderMap| file("icon.svg", &headers)))
        .route(
            "/page/{name}",
            get(async |Path(name): Path<String>, headers: HeaderMap| file(&format!("page/{name}"), &headers)),
        )
}

fn file(name: &str, headers: &HeaderMap) -> Result<Response, Problem> {
    let found = FILES.iter().position(|(known, _)| *known == name);
    let Some(index) = found else {
        return Err(Problem::new(
            &problem::NOT_FOUND,
            format!("The page has no file {:?}.", problem::shorten(name.to_owned())),
        ));
    };
    let content = FILES[index].1;
    static TAGS: OnceLock<Vec<String>> = OnceLock::new();
    let tags =
        TAGS.get_or_init(|| FILES.iter().map(|(_, content)| blake3::hash(content).to_hex()[..32].to_owned()).collect());
    // Weak, since what is sent may be compressed.
    let tag = conditional::weak(&tags[index])?;
    let mut response = conditional::unless_known(headers, tag, || content.into_response());
    let head = response.headers_mut();
    head.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type(name)));
    // Files under page/ carry a hash of their content in their names; what names them is asked for each time.
    let caching = if name.starts_with("page/") { "public, max-age=31536000, immutable" } else { "no-cache" };
    head.insert(header::CACHE_CONTROL, HeaderValue::from_static(caching));
    head.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    head.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    Ok(response)
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_comes_with_a_policy_and_is_asked_for_each_time() {
        let answer = file("index.html", &HeaderMap::new()).unwrap();
        assert_eq!(answer.status(), 200);
        let head = answer.headers();
        assert_eq!(head[header::CONTENT_TYPE], "text/html; charset=utf-8");
        assert_eq!(head[header::CACHE_CONTROL], "no-cache");
        let policy = head[header::CONTENT_SECURITY_POLICY].to_str().unwrap();
        assert!(policy.starts_with("default-src 'none'") && !policy.contains("unsafe"));
        let mut again = HeaderMap::new();
        again.insert(header::IF_NONE_MATCH, head[header::ETAG].clone());
        assert_eq!(file("index.html", &again).unwrap().status(), 304);
    }

    #[test]
    fn files_named_by_their_content_never_change() {
        for (name, _) in FILES.iter().filter(|(name, _)| name.starts_with("page/")) {
            let answer = file(name, &HeaderMap::new()).unwrap();
            assert!(answer.headers()[header::CACHE_CONTROL].to_str().unwrap().contains("immutable"), "{name}");
            assert_ne!(answer.headers()[header::CONTENT_TYPE], "application/octet-stream", "{name}");
        }
    }

    #[test]
    fn nothing_of_the_page_comes_from_elsewhere_or_stands_inline() {
        let html = String::from_utf8_lossy(FILES.iter().find(|(name, _)| *name == "index.html").unwrap().1);
        for odd in ["src=\"http", "href=\"http", "<style", "onclick", "style=\""] {
            assert!(!html.contains(odd), "{odd} in the page");
        }
        assert!(!html.contains("<script>"));
    }

    #[test]
    fn an_unknown_file_is_a_problem() {
        assert_eq!(
            file("page/../secret", &HeaderMap::new()).unwrap_err().detail(),
            "The page has no file \"page/../secret\"."
        );
    }
}
