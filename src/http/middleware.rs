//! What surrounds every request: an id, a log line, metrics, authentication, and answers for panics and unknown paths.

use std::any::Any;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Instant;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use tracing::Instrument;

use super::auth::{self, Scope};
use super::problem::{self, Problem, ProblemNote};
use super::state::AppState;

/// The header with the id of a request.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Who calls: the name of the API key, or `anonymous` where the server has none.
#[derive(Debug, Clone)]
pub struct Principal(pub String);

/// Gives each request an id, a span and a log line, and counts it.
pub async fn observe(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let begin = Instant::now();
    let id = request_id(request.headers());
    let method = request.method().clone();
    // Only templates become labels: paths would make endless series.
    let route = request.extensions().get::<MatchedPath>().map_or("unmatched", MatchedPath::as_str).to_owned();
    let path = problem::shorten(request.uri().path().to_owned());
    if let Ok(value) = HeaderValue::from_str(&id) {
        request.headers_mut().insert(REQUEST_ID, value);
    }
    let span = tracing::info_span!("request", request = %id, method = %method, route);
    let (request, taken) = watch_body(request);
    let mut response = next.run(request).instrument(span.clone()).await;
    if !taken.load(Ordering::Relaxed) {
        // What is left of the body is not read to its end, so that the connection cannot serve another request.
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    let seconds = begin.elapsed().as_secs_f64();
    let status = response.status();
    span.in_scope(|| match response.extensions().get::<ProblemNote>() {
        Some(note) if status.is_server_error() => {
            tracing::error!(
                path,
                status = status.as_u16(),
                seconds,
                problem = note.kind,
                detail = note.detail,
                "answered"
            )
        }
        Some(note) => {
            tracing::info!(
                path,
                status = status.as_u16(),
                seconds,
                problem = note.kind,
                detail = note.detail,
                "answered"
            )
        }
        None => tracing::info!(path, status = status.as_u16(), seconds, "answered"),
    });
    let known = match method {
        Method::GET | Method::POST | Method::DELETE | Method::HEAD | Method::OPTIONS | Method::PUT | Method::PATCH => {
            method.as_str()
        }
        _ => "other",
    };
    state.metrics.http_requests.with_label_values(&[route.as_str(), known, status.as_str()]).inc();
    state.metrics.http_request_seconds.with_label_values(&[route.as_str(), known]).observe(seconds);
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    response.headers_mut().insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

/// A request whose body tells whether it was read to its end.
fn watch_body(request: Request) -> (Request, Arc<AtomicBool>) {
    let taken = Arc::new(AtomicBool::new(request.body().is_end_stream()));
    let flag = taken.clone();
    let request = request.map(|body| match flag.load(Ordering::Relaxed) {
        true => body,
        false => Body::new(Watched { body, taken: flag }),
    });
    (request, taken)
}

/// A body that notes its end.
struct Watched {
    body: Body,
    taken: Arc<AtomicBool>,
}

impl HttpBody for Watched {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let poll = Pin::new(&mut self.body).poll_frame(cx);
        if matches!(poll, Poll::Ready(None)) {
            self.taken.store(true, Ordering::Relaxed);
        }
        poll
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// The id that the client gave, where it is harmless, or a fresh one.
fn request_id(headers: &HeaderMap) -> String {
    let harmless = |id: &&str| {
        !id.is_empty() && id.len() <= 64 && id.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b))
    };
    match headers.get(REQUEST_ID).and_then(|value| value.to_str().ok()).filter(harmless) {
        Some(id) => id.to_owned(),
        None => uuid::Uuid::now_v7().to_string(),
    }
}

/// The scope that a request needs; `None` where it is open to everyone. What is not known needs the widest scope.
pub fn required_scope(method: &Method, path: &str) -> Option<Scope> {
    let read_only = method == Method::GET || method == Method::HEAD;
    match path {
        "/" | "/icon.svg" | "/healthz" | "/readyz" | "/openapi.json" | "/docs" | "/problems" if read_only => {
            return None;
        }
        _ if read_only && (path.starts_with("/problems/") || path.starts_with("/page/")) => return None,
        "/metrics" => return Some(Scope::Operate),
        _ => {}
    }
    if read_only {
        return Some(Scope::Read);
    }
    if method == Method::POST {
        // A solve changes nothing: it reads a basis and computes.
        let solve = path.starts_with("/v1/bases/") || path == "/v1/shape-comparisons";
        return Some(if solve { Scope::Read } else { Scope::Submit });
    }
    Some(Scope::Operate)
}

/// Lets in who may do what the request asks for.
pub async fn authorise(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    match admit(&state, &request) {
        Ok(principal) => {
            request.extensions_mut().insert(Principal(principal));
            next.run(request).await
        }
        Err(refused) => refused.into_response(),
    }
}

fn admit(state: &AppState, request: &Request) -> Result<String, Problem> {
    let method = request.method();
    known_host(called(request), state)?;
    if !matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS) {
        same_origin(request.headers(), &state.config.cors_origins)?;
    }
    let Some(scope) = required_scope(method, request.uri().path()) else { return Ok("anonymous".to_owned()) };
    if state.keys.is_empty() {
        return Ok("anonymous".to_owned());
    }
    let unauthenticated = |detail: &str, challenge: &'static str| {
        Problem::new(&problem::UNAUTHENTICATED, detail)
            .header(header::WWW_AUTHENTICATE, HeaderValue::from_static(challenge))
    };
    let token =
        request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()).and_then(auth::bearer);
    let Some(token) = token else {
        return Err(unauthenticated("This needs an API key in the header Authorization.", "Bearer realm=\"chladni\""));
    };
    let Some(key) = auth::find(&state.keys, token) else {
        return Err(unauthenticated(
            "The API key is not one of this server.",
            "Bearer realm=\"chladni\", error=\"invalid_token\"",
        ));
    };
    if !key.allows(scope) {
        return Err(Problem::new(
            &problem::FORBIDDEN,
            format!("The API key {:?} lacks the scope {:?}, which this needs.", key.name, scope.name()),
        )
        .with("scope", scope.name()));
    }
    Ok(key.name.clone())
}

/// What the client calls the server, with the port if it gave one; empty where it gave nothing.
fn called(request: &Request) -> &str {
    let header = || request.headers().get(header::HOST).and_then(|value| value.to_str().ok());
    request.uri().authority().map(|authority| authority.as_str()).or_else(header).unwrap_or_default()
}

/// Refuses names that are not the server's. A page may have its own name resolve to 127.0.0.1, and is then of the same origin as a server
/// there, free to read whatever that answers; only the name in the request gives it away. Addresses cannot be had that way.
fn known_host(called: &str, state: &AppState) -> Result<(), Problem> {
    let config = &state.config;
    let trusting = state.keys.is_empty() && config.listen.ip().to_canonical().is_loopback();
    if (config.hosts.is_empty() && !trusting) || is_known(called, &config.hosts) {
        return Ok(());
    }
    let detail = format!("This server is not called {called:?}; its names are set with --hosts.");
    Err(Problem::new(&problem::HOST_NOT_KNOWN, detail))
}

fn is_known(called: &str, hosts: &[String]) -> bool {
    let port = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let name = match called.rsplit_once(':') {
        Some((name, digits)) if port(digits) => name,
        _ => called,
    };
    let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    let name = name.strip_suffix('.').unwrap_or(name);
    name.is_empty()
        || bare.parse::<std::net::IpAddr>().is_ok()
        || name.eq_ignore_ascii_case("localhost")
        || hosts.iter().any(|host| host == "*" || host.eq_ignore_ascii_case(name))
}

/// Refuses changes that a page of another origin sends from a browser: a server without keys on loopback trusts whoever can
/// reach it, and every page that its user opens can.
fn same_origin(headers: &HeaderMap, allowed: &[String]) -> Result<(), Problem> {
    let Some(origin) = headers.get(header::ORIGIN).and_then(|value| value.to_str().ok()) else { return Ok(()) };
    let host = headers.get(header::HOST).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let same = origin.split_once("://").is_some_and(|(_, authority)| authority.eq_ignore_ascii_case(host));
    if same || allowed.iter().any(|o| o == "*" || o.eq_ignore_ascii_case(origin)) {
        return Ok(());
    }
    Err(Problem::new(&problem::ORIGIN_NOT_ALLOWED, format!("Pages of {origin:?} may not call this server.")))
}

/// The answer for a handler that panicked.
pub fn panicked(cause: Box<dyn Any + Send + 'static>) -> Response {
    let text = cause.downcast_ref::<String>().map(String::as_str).or(cause.downcast_ref::<&str>().copied());
    Problem::internal(text.unwrap_or("a panic without a message")).into_response()
}

/// The answer for an unknown path.
pub async fn not_found(uri: Uri) -> Problem {
    Problem::new(&problem::NOT_FOUND, format!("There is no route {:?}.", uri.path()))
}

/// The answer for a known path with a method that it does not have.
pub async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::new(&problem::METHOD_NOT_ALLOWED, format!("{:?} does not have the method {method}.", uri.path()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scopes_follow_method_and_path() {
        let scope = |method: Method, path: &str| required_scope(&method, path);
        assert_eq!(scope(Method::GET, "/healthz"), None);
        assert_eq!(scope(Method::GET, "/problems/not-found"), None);
        assert_eq!(scope(Method::GET, "/page/index.js"), None);
        assert_eq!(scope(Method::GET, "/metrics"), Some(Scope::Operate));
        assert_eq!(scope(Method::GET, "/v1/jobs"), Some(Scope::Read));
        assert_eq!(scope(Method::HEAD, "/v1/bases/1/content"), Some(Scope::Read));
        assert_eq!(scope(Method::POST, "/v1/bases/1/filter"), Some(Scope::Read));
        assert_eq!(scope(Method::POST, "/v1/jobs"), Some(Scope::Submit));
        assert_eq!(scope(Method::POST, "/v1/jobs/1/cancel"), Some(Scope::Submit));
        assert_eq!(scope(Method::DELETE, "/v1/meshes/1"), Some(Scope::Operate));
        assert_eq!(scope(Method::PUT, "/healthz"), Some(Scope::Operate));
        assert_eq!(scope(Method::POST, "/healthz"), Some(Scope::Submit));
    }

    #[test]
    fn pages_of_other_origins_may_not_change_anything() {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, "127.0.0.1:8080".parse().unwrap());
        assert!(same_origin(&headers, &[]).is_ok());
        headers.insert(header::ORIGIN, "http://127.0.0.1:8080".parse().unwrap());
        assert!(same_origin(&headers, &[]).is_ok());
        headers.insert(header::ORIGIN, "https://example.org".parse().unwrap());
        assert!(same_origin(&headers, &[]).is_err());
        assert!(same_origin(&headers, &["https://example.org".into()]).is_ok());
        headers.insert(header::ORIGIN, "null".parse().unwrap());
        assert!(same_origin(&headers, &[]).is_err());
    }

    #[test]
    fn only_names_of_the_server_are_known() {
        for known in
            ["", "localhost", "LocalHost:8080", "localhost.", "127.0.0.1:80", "[::1]:8080", "[::1]", "192.168.0.7"]
        {
            assert!(is_known(known, &[]), "{known}");
        }
        for strange in [
            "example.org",
            "example.org:8080",
            "localhost.example.org",
            "127.0.0.1.example.org:80",
            "[::1].example.org",
        ] {
            assert!(!is_known(strange, &[]), "{strange}");
        }
        let hosts = ["chladni.example".to_owned()];
        assert!(is_known("Chladni.example:443", &hosts) && !is_known("other.example", &hosts));
        assert!(is_known("other.example", &["*".to_owned()]));
    }

    #[test]
    fn a_panic_becomes_a_problem_that_does_not_show_it() {
        let answer = panicked(Box::new("index 17 out of range".to_owned()));
        assert_eq!(answer.status(), 500);
        assert!(!answer.extensions().get::<ProblemNote>().unwrap().detail.contains("17"));
    }

    #[test]
    fn request_ids_of_clients_are_kept_where_harmless() {
        let mut headers = HeaderMap::new();
        headers.insert(REQUEST_ID, "abc-123".parse().unwrap());
        assert_eq!(request_id(&headers), "abc-123");
        for odd in ["a b", &"x".repeat(65), "", "a\"b"] {
            headers.insert(REQUEST_ID, odd.parse().unwrap());
            assert_ne!(request_id(&headers), odd);
        }
    }
}
