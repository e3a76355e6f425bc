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

#[tokio::test]
async fn each_scope_opens_its_routes_and_no_others() {
    let app = guarded();
    let none = uuid::Uuid::nil();
    // method, path, scope that opens it
    let routes = [
        ("GET", "/v1/meshes".to_owned(), "read"),
        ("GET", "/v1/jobs".to_owned(), "read"),
        ("GET", format!("/v1/jobs/{none}"), "read"),
        ("GET", format!("/v1/jobs/{none}/events"), "read"),
        ("GET", "/v1/bases".to_owned(), "read"),
        ("GET", format!("/v1/bases/{none}/content"), "read"),
        ("POST", format!("/v1/bases/{none}/filter"), "read"),
        ("POST", format!("/v1/bases/{none}/project"), "read"),
        ("POST", "/v1/meshes".to_owned(), "submit"),
        ("POST", "/v1/jobs".to_owned(), "submit"),
        ("POST", format!("/v1/jobs/{none}/cancel"), "submit"),
        ("POST", format!("/v1/jobs/{none}/retry"), "submit"),
        ("DELETE", "/v1/meshes/none".to_owned(), "operate"),
        ("PATCH", "/v1/meshes/none".to_owned(), "operate"),
        ("DELETE", format!("/v1/jobs/{none}"), "operate"),
        ("DELETE", format!("/v1/bases/{none}"), "operate"),
        ("GET", "/metrics".to_owned(), "operate"),
    ];
    for (method, path, scope) in &routes {
        let request = || app.client.request(method.parse().unwrap(), app.url(path));
        let refused = request().send().await.unwrap();
        assert!(refused.headers().contains_key("www-authenticate"), "{method} {path}");
        problem(refused, 401, "unauthenticated").await;
        problem(request().bearer_auth("wrong-secret-0123456789").send().await.unwrap(), 401, "unauthenticated").await;
        for (secret, scopes) in [(READER, "read"), (SUBMITTER, "read submit"), (OPERATOR, "operate")] {
            let answer = request().bearer_auth(secret).send().await.unwrap();
            if scopes.contains(scope) {
                assert!(![401, 403].contains(&answer.status().as_u16()), "{method} {path} {scopes}");
            } else {
                let refused = problem(answer, 403, "scope-missing").await;
                assert_eq!(refused["scope"], *scope, "{method} {path}");
            }
        }
    }
    for open in ["/healthz", "/readyz", "/openapi.json", "/docs", "/problems", "/problems/not-found"] {
        assert_eq!(app.get(open).send().await.unwrap().status(), 200, "{open}");
    }
    let unknown: Value = problem(app.get("/nowhere").send().await.unwrap(), 401, "unauthenticated").await;
    assert!(!unknown.to_string().contains(READER));
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
