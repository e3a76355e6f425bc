//! The web page: built from `web/`, embedded in the binary, and a client of the public routes like any other.

use axum::Router;
use axum::extract::Path;
use axum::http::HeaderMap;
use axum::response::Response;
use axum::routing::get;

use super::embedded::{ASKED_EACH_TIME, Files, NEVER_CHANGES};
use super::problem::{self, Problem};
use super::state::AppState;

/// Every file of the page.
static FILES: Files = Files::new(chladni_page::FILES);

/// Nothing from elsewhere, no inline script or style, no frame.
pub const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
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

/// The page of the API reference, where the page was built.
pub fn reference(headers: &HeaderMap) -> Option<Response> {
    file("reference.html", headers).ok()
}

fn file(name: &str, headers: &HeaderMap) -> Result<Response, Problem> {
    // Files under page/ carry a hash of their content in their names; what names them is asked for each time.
    let caching = if name.starts_with("page/") { NEVER_CHANGES } else { ASKED_EACH_TIME };
    FILES.answer(name, headers, caching, POLICY)?.ok_or_else(|| {
        Problem::new(&problem::NOT_FOUND, format!("The page has no file {:?}.", problem::shorten(name.to_owned())))
    })
}

#[cfg(test)]
mod tests {
    use axum::http::header;

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
        for (name, _) in FILES.table().iter().filter(|(name, _)| name.starts_with("page/")) {
            let answer = file(name, &HeaderMap::new()).unwrap();
            assert!(answer.headers()[header::CACHE_CONTROL].to_str().unwrap().contains("immutable"), "{name}");
            assert_ne!(answer.headers()[header::CONTENT_TYPE], "application/octet-stream", "{name}");
        }
    }

    #[test]
    fn nothing_of_the_page_comes_from_elsewhere_or_stands_inline() {
        for (name, content) in FILES.table().iter().filter(|(name, _)| name.ends_with(".html")) {
            let html = String::from_utf8_lossy(content);
            for odd in ["src=\"http", "href=\"http", "<style", "onclick", "style=\"", "<script>"] {
                assert!(!html.contains(odd), "{odd} in {name}");
            }
        }
    }

    #[test]
    fn an_unknown_file_is_a_problem() {
        assert_eq!(
            file("page/../secret", &HeaderMap::new()).unwrap_err().detail(),
            "The page has no file \"page/../secret\"."
        );
    }
}
