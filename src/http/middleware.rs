//! What surrounds every request: an id, a log line, metrics, and answers for panics and unknown paths.

use std::any::Any;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Instant;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use tower_http::request_id::{MakeRequestId, RequestId};
use tracing::Instrument;

use super::access::Principal;
use super::problem::{self, Problem, ProblemNote};
use super::serve::Peer;
use super::state::AppState;

/// The header with the id of a request.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Gives an id to requests that come without one: time-ordered, as all ids of the service are.
#[derive(Debug, Clone, Copy, Default)]
pub struct FreshId;

impl MakeRequestId for FreshId {
    fn make_request_id<B>(&mut self, _request: &axum::http::Request<B>) -> Option<RequestId> {
        HeaderValue::from_str(&uuid::Uuid::now_v7().to_string()).ok().map(RequestId::new)
    }
}

/// Drops the id that a client gave where it could do harm in a log.
pub async fn harmless_id(mut request: Request) -> Request {
    let harmless = |id: &str| {
        !id.is_empty() && id.len() <= 64 && id.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b))
    };
    if request.headers().get(REQUEST_ID).is_some_and(|id| !id.to_str().is_ok_and(harmless)) {
        request.headers_mut().remove(REQUEST_ID);
    }
    request
}

/// Routes that machines ask every few seconds: their successes are no news.
const POLLED: [&str; 3] = ["/healthz", "/readyz", "/metrics"];

/// Gives each request a span and a log line, and counts it.
pub async fn observe(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let begin = Instant::now();
    let id = request.headers().get(REQUEST_ID).and_then(|id| id.to_str().ok()).unwrap_or_default().to_owned();
    let method = request.method().clone();
    // Only templates become labels: paths would make endless series.
    let route = request.extensions().get::<MatchedPath>().map_or("unmatched", MatchedPath::as_str).to_owned();
    let path = problem::shorten(request.uri().path().to_owned());
    let peer = request.extensions().get::<Peer>().map(|peer| peer.address.to_string());
    let span = tracing::info_span!("request", request = %id, method = %method, route);
    let (request, taken) = watch_body(request);
    let mut response = next.run(request).instrument(span.clone()).await;
    if !taken.load(Ordering::Relaxed) {
        // What is left of the body is not read to its end, so that the connection cannot serve another request.
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    let seconds = begin.elapsed().as_secs_f64();
    let status = response.status();
    let note = response.extensions().get::<ProblemNote>();
    let (problem, detail) = (note.map(|note| note.kind.as_str()), note.map(|note| note.detail.as_str()));
    let key = response.extensions().get::<Principal>().map(|principal| principal.0.to_string());
    let status_code = status.as_u16();
    span.in_scope(|| {
        macro_rules! answered {
            ($level:ident) => {
                tracing::$level!(path, status = status_code, seconds, key, peer, problem, detail, "answered")
            };
        }
        // A full disk is the operator's to see to, and what is refused under load is what limits are for: neither is a
        // fault of the server.
        if matches!(status, StatusCode::INSUFFICIENT_STORAGE | StatusCode::SERVICE_UNAVAILABLE) {
            answered!(warn)
        } else if status.is_server_error() {
            answered!(error)
        } else if status.is_success() && POLLED.contains(&route.as_str()) {
            answered!(debug)
        } else {
            answered!(info)
        }
    });
    count(&state, &route, &method, status, seconds);
    response.headers_mut().insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

fn count(state: &AppState, route: &str, method: &Method, status: StatusCode, seconds: f64) {
    let known = match *method {
        Method::GET | Method::POST | Method::DELETE | Method::HEAD | Method::OPTIONS | Method::PUT | Method::PATCH => {
            method.as_str()
        }
        _ => "other",
    };
    state.metrics.http_requests.with_label_values(&[route, known, status.as_str()]).inc();
    state.metrics.http_request_seconds.with_label_values(&[route, known]).observe(seconds);
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
    Problem::new(&problem::METHOD_NOT_ALLOWED, format!("{:?} does not support the method {method}.", uri.path()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_problem_that_does_not_show_it() {
        let answer = panicked(Box::new("index 17 out of range".to_owned()));
        assert_eq!(answer.status(), 500);
        assert!(!answer.extensions().get::<ProblemNote>().unwrap().detail.contains("17"));
    }

    #[tokio::test]
    async fn request_ids_of_clients_are_kept_where_harmless() {
        let request = |id: &str| {
            let mut request = Request::new(Body::empty());
            request.headers_mut().insert(REQUEST_ID, id.parse().unwrap());
            request
        };
        assert_eq!(harmless_id(request("abc-123")).await.headers()[REQUEST_ID], "abc-123");
        for odd in ["a b", &"x".repeat(65), "", "a\"b"] {
            assert!(!harmless_id(request(odd)).await.headers().contains_key(REQUEST_ID), "{odd}");
        }
        let fresh = |mut make: FreshId| make.make_request_id(&Request::new(Body::empty())).unwrap();
        assert_ne!(fresh(FreshId).header_value(), fresh(FreshId).header_value());
    }
}
