use serde_json::Value;

use crate::common::{TestApp, problem};

const READER: &str = "reader-secret-0123456789";
const SUBMITTER: &str = "submitter-secret-0123456789";
const OPERATOR: &str = "operator-secret-0123456789";

fn guarded() -> TestApp {
    let mut builder = TestApp::builder();
    let hash = blake3::hash(OPERATOR.as_bytes());
    builder.config.keys = format!("r:read:{READER},s:read+submit:{SUBMITTER},o:operate:blake3:{hash}").parse().unwrap();
    builder.start()
}

/// An operation of the OpenAPI document: method, path with its examples filled in, the scope that it declares, and the
/// statuses that it tells of.
struct Operation {
    method: reqwest::Method,
    path: String,
    scope: Option<String>,
    statuses: Vec<String>,
}

fn operations() -> Vec<Operation> {
    let document: Value = serde_json::from_str(&chladni::http::openapi().unwrap()).unwrap();
    let mut found = Vec::new();
    for (template, methods) in document["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            let name = format!("{method} {template}");
            let mut path = template.clone();
            for parameter in operation["parameters"].as_array().into_iter().flatten().filter(|p| p["in"] == "path") {
                let place = format!("{{{}}}", parameter["name"].as_str().unwrap());
                path = path.replace(&place, parameter["example"].as_str().unwrap());
            }
            assert!(!path.contains('{'), "{name}: a parameter has no example");
            let declared = operation["security"].as_array().unwrap();
            assert_eq!(declared.len(), 1, "{name} declares one way in");
            let scope = declared[0]["bearer"][0].as_str().map(str::to_owned);
            let open = declared[0].as_object().unwrap().is_empty();
            assert!(open || ["read", "submit", "operate"].contains(&scope.as_deref().unwrap()), "{name}: {scope:?}");
            let statuses: Vec<String> = operation["responses"].as_object().unwrap().keys().cloned().collect();
            if method == "get" {
                let (path, scope, statuses) = (path.clone(), scope.clone(), statuses.clone());
                found.push(Operation { method: reqwest::Method::HEAD, path, scope, statuses });
            }
            let method = method.to_uppercase().parse().unwrap();
            found.push(Operation { method, path, scope, statuses });
        }
    }
    assert!(found.len() > 50, "{}", found.len());
    found
}

#[tokio::test]
async fn every_operation_of_the_document_opens_to_the_scope_that_it_declares_and_to_no_other() {
    let app = guarded();
    let keys = [("read", READER), ("read submit", SUBMITTER), ("operate", OPERATOR)];
    for Operation { method, path, scope, statuses } in operations() {
        let name = format!("{method} {path}");
        let request = || app.client.request(method.clone(), app.url(&path));
        let without = request().send().await.unwrap();
        let told = |status: reqwest::StatusCode| statuses.iter().any(|known| known == status.as_str());
        assert_eq!(without.status() == 401, scope.is_some(), "{name}");
        assert_eq!(without.headers().contains_key("www-authenticate"), scope.is_some(), "{name}");
        assert!(told(without.status()), "{name} answers {}, which the document does not tell of", without.status());
        for (scopes, secret) in keys {
            let answer = request().bearer_auth(secret).send().await.unwrap();
            let status = answer.status();
            assert!(told(status), "{name} with {scopes} answers {status}, which the document does not tell of");
            let allowed = scope.as_deref().is_none_or(|scope| scopes.split(' ').any(|own| own == scope));
            assert_eq!(status == 403, !allowed, "{name} with {scopes}: {status}");
            assert!(status != 401 && status != 500, "{name} with {scopes}: {status}");
            if !allowed && method != reqwest::Method::HEAD {
                assert_eq!(problem(answer, 403, "scope-missing").await["scope"], *scope.as_ref().unwrap(), "{name}");
            }
        }
    }
}

#[tokio::test]
async fn a_wrong_key_opens_nothing_is_counted_and_does_not_show() {
    let app = guarded();
    let wrong = "wrong-secret-0123456789";
    for (method, path) in
        [("GET", "/v1/jobs"), ("POST", "/v1/functional-maps"), ("GET", "/metrics"), ("GET", "/nowhere")]
    {
        let request = app.client.request(method.parse().unwrap(), app.url(path));
        let refused = problem(request.bearer_auth(wrong).send().await.unwrap(), 401, "unauthenticated").await;
        assert!(!refused.to_string().contains(wrong), "{path}");
    }
    assert_eq!(app.get("/healthz").bearer_auth(wrong).send().await.unwrap().status(), 200, "open to everyone");
    problem(app.get("/nowhere").send().await.unwrap(), 401, "unauthenticated").await;
    problem(app.get("/nowhere").bearer_auth(READER).send().await.unwrap(), 404, "not-found").await;
    let metrics = app.get("/metrics").bearer_auth(OPERATOR).send().await.unwrap().text().await.unwrap();
    assert!(metrics.contains("chladni_refused_keys_total 4"), "{metrics}");
}

#[tokio::test]
async fn pages_of_trusted_origins_may_call_and_others_may_not() {
    let mut builder = TestApp::builder();
    builder.config.cors_origins = vec!["https://viewer.example".into()];
    let app = builder.start();
    let preflight = |origin: &'static str| {
        app.client
            .request(reqwest::Method::OPTIONS, app.url("/v1/jobs"))
            .header("origin", origin)
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "content-type,idempotency-key")
            .send()
    };
    let allowed = preflight("https://viewer.example").await.unwrap();
    assert_eq!(allowed.headers()["access-control-allow-origin"], "https://viewer.example");
    assert!(!preflight("https://evil.example").await.unwrap().headers().contains_key("access-control-allow-origin"));
    let cancel = |origin: &'static str| {
        app.post(&format!("/v1/jobs/{}/cancel", uuid::Uuid::nil())).header("origin", origin).send()
    };
    problem(cancel("https://evil.example").await.unwrap(), 403, "origin-not-allowed").await;
    problem(cancel("https://viewer.example").await.unwrap(), 404, "unknown-job").await;
}
