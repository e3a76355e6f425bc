//! The manual: the files of `docs/` as pages, made by the build script and embedded.

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::embedded::{ASKED_EACH_TIME, Files};
use super::problem::{self, Problem};
use super::state::AppState;
use super::web_page;

static FILES: Files = Files::new(include!(concat!(env!("OUT_DIR"), "/guide.rs")));

/// For a picture that is opened by itself: those of SVG have styles of their own.
const PICTURE: &str = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'";

/// The routes of the manual. They are no part of the API and stand in no document.
pub fn routes() -> Router<AppState> {
    Router::new()
        // Relative, as all links of the manual are: it works under any address.
        .route("/docs/", get(async || elsewhere("../docs")))
        .route("/docs/guide", get(async || elsewhere("guide/")))
        .route("/docs/guide/", get(async |headers: HeaderMap| file("", &headers)))
        .route("/docs/guide/{*name}", get(async |Path(name): Path<String>, headers: HeaderMap| file(&name, &headers)))
}

fn elsewhere(to: &'static str) -> Response {
    (StatusCode::TEMPORARY_REDIRECT, [(header::LOCATION, HeaderValue::from_static(to))]).into_response()
}

fn file(name: &str, headers: &HeaderMap) -> Result<Response, Problem> {
    let policy = if name.starts_with("pictures/") { PICTURE } else { web_page::POLICY };
    FILES.answer(name, headers, ASKED_EACH_TIME, policy)?.ok_or_else(|| {
        Problem::new(&problem::NOT_FOUND, format!("The manual has no page {:?}.", problem::shorten(name.to_owned())))
    })
}
