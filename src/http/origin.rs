//! By which name a server is called, and from which pages: what browsers send on behalf of others.

use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, Version, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::problem::{self, Problem};
use super::state::AppState;

/// Refuses requests that name another host, several or none, and changes that a page of another origin asks for.
pub async fn guard(State(state): State<AppState>, request: Request, next: Next) -> Response {
    match check(&state, &request) {
        Ok(()) => next.run(request).await,
        Err(refused) => refused.into_response(),
    }
}

fn check(state: &AppState, request: &Request) -> Result<(), Problem> {
    one_host(request)?;
    known_host(called(request), state)?;
    if matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS) {
        return Ok(());
    }
    same_origin(request.headers(), &state.config.cors_origins)
}

/// RFC 9112, section 3.2: a request of HTTP/1.1 names one host. Two would be two meanings, one for a proxy and one for
/// us.
fn one_host(request: &Request) -> Result<(), Problem> {
    let hosts = request.headers().get_all(header::HOST).iter().count();
    let detail = match hosts {
        1 => return Ok(()),
        0 if request.version() < Version::HTTP_11 => return Ok(()),
        0 => "Host: is missing.".to_owned(),
        several => format!("Host: is given {several} times; once is allowed."),
    };
    Err(Problem::new(&problem::INVALID_HEADER, detail))
}

/// What the client calls the server, with the port if it gave one; empty where it gave nothing.
fn called(request: &Request) -> &str {
    let header = || request.headers().get(header::HOST).and_then(|value| value.to_str().ok());
    request.uri().authority().map(|authority| authority.as_str()).or_else(header).unwrap_or_default()
}

/// Refuses names that are not the server's. A page may have its own name resolve to 127.0.0.1, and is then of the same
/// origin as a server there, free to read whatever that answers; only the name in the request gives it away. Addresses
/// cannot be had that way.
fn known_host(called: &str, state: &AppState) -> Result<(), Problem> {
    let config = &state.config;
    let trusting = state.keys().is_empty() && config.listen.ip().to_canonical().is_loopback();
    if (config.hosts.is_empty() && !trusting) || is_known(called, &config.hosts) {
        return Ok(());
    }
    let detail = format!("This server does not answer to the name {called:?}; its names are set with --hosts.");
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

/// Refuses changes that a page of another origin sends from a browser: a server without keys on loopback trusts whoever
/// can reach it, and every page that its user opens can.
fn same_origin(headers: &HeaderMap, allowed: &[String]) -> Result<(), Problem> {
    let Some(origin) = headers.get(header::ORIGIN).and_then(|value| value.to_str().ok()) else { return Ok(()) };
    let host = headers.get(header::HOST).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let same = origin.split_once("://").is_some_and(|(_, authority)| authority.eq_ignore_ascii_case(host));
    if same || allowed.iter().any(|o| o == "*" || o.eq_ignore_ascii_case(origin)) {
        return Ok(());
    }
    Err(Problem::new(
        &problem::ORIGIN_NOT_ALLOWED,
        format!("Pages from {origin:?} may not call this server; trusted origins are set with --cors-origins."),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_request_names_one_host() {
        let request = |hosts: &[&str]| {
            let mut request = Request::new(axum::body::Body::empty());
            hosts.iter().for_each(|host| {
                request.headers_mut().append(header::HOST, host.parse().unwrap());
            });
            request
        };
        assert!(one_host(&request(&["localhost"])).is_ok());
        assert!(one_host(&request(&[])).unwrap_err().detail().contains("missing"));
        assert!(one_host(&request(&["localhost", "example.org"])).unwrap_err().detail().contains("2 times"));
        let mut old = request(&[]);
        *old.version_mut() = Version::HTTP_10;
        assert!(one_host(&old).is_ok());
    }
}
