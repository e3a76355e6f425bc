use std::path::Path;

use serde_json::Value;

use crate::common::TestApp;

#[test]
fn the_openapi_document_is_the_one_in_the_repository() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/openapi.json");
    let now = chladni::http::openapi().unwrap();
    if std::fs::read_to_string(&golden).unwrap_or_default() != now {
        let found = Path::new(env!("CARGO_TARGET_TMPDIR")).join("openapi.json");
        std::fs::write(&found, &now).unwrap();
        panic!(
            "openapi/openapi.json is out of date: compare it with {} and, if the change is meant, run `cargo run --release -- openapi > openapi/openapi.json`",
            found.display()
        );
    }
}

#[test]
fn every_route_has_a_summary_a_description_and_an_example() {
    let document: Value = serde_json::from_str(&chladni::http::openapi().unwrap()).unwrap();
    let schemas = &document["components"]["schemas"];
    let mut operations = 0;
    for (path, methods) in document["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            operations += 1;
            let name = format!("{method} {path}");
            for member in ["summary", "description", "operationId"] {
                assert!(!operation[member].as_str().unwrap_or_default().is_empty(), "{name} has no {member}");
            }
            assert!(!operation["tags"][0].is_null(), "{name} has no tag");
            assert!(!operation["security"].is_null(), "{name} does not say who may call it");
            let guarded = !operation["security"][0]["bearer"].is_null();
            assert_eq!(guarded, !operation["responses"]["401"].is_null(), "{name}");
            let mut found = operation["parameters"].as_array().into_iter().flatten().any(|p| !p["example"].is_null());
            let bodies = operation["responses"].as_object().unwrap().values().chain([&operation["requestBody"]]);
            for content in bodies.filter_map(|body| body["content"].as_object()).flat_map(|content| content.values()) {
                let schema = content["schema"]["$ref"].as_str().and_then(|r| r.rsplit('/').next()).unwrap_or_default();
                found |= !content["example"].is_null() || !schemas[schema]["example"].is_null();
            }
            assert!(found, "{name} has no example");
        }
    }
    assert!(operations >= 20, "{operations}");
}

#[tokio::test]
async fn documentation_loads_nothing_from_elsewhere() {
    let app = TestApp::start();
    for path in ["/docs/plain", "/problems", "/problems/job-too-large", "/problems/unreadable-mesh/no-vertices"] {
        let response = app.get(path).send().await.unwrap();
        assert_eq!(response.status(), 200, "{path}");
        assert!(response.headers()["content-security-policy"].to_str().unwrap().contains("default-src 'none'"));
        let page = response.text().await.unwrap();
        assert!(!page.contains("src=") && !page.contains("http://") && !page.contains("https://"), "{path}");
    }
    let page = app.get("/docs/plain").send().await.unwrap().text().await.unwrap();
    for word in ["uploadMesh", "/v1/jobs/{id}/events", "Idempotency-Key", "JobResource"] {
        assert!(page.contains(word), "{word}");
    }
    // The reference that can be searched and tried, or the plain one where the page was left out: either keeps to this
    // server.
    let reference = app.get("/docs").send().await.unwrap();
    assert_eq!(reference.status(), 200);
    assert!(reference.headers()["content-security-policy"].to_str().unwrap().starts_with("default-src 'none'"));
    let reference = reference.text().await.unwrap();
    assert!(reference.contains("/docs/plain") || reference.contains("uploadMesh"));
    assert!(!reference.contains("http://") && !reference.contains("https://"));
    let home = app.get("/").send().await.unwrap();
    assert_eq!(home.status(), 200);
    assert!(home.headers()["content-security-policy"].to_str().unwrap().starts_with("default-src 'none'"));
    assert_eq!(app.get("/problems/nonsense").send().await.unwrap().status(), 404);
    let text = app.get("/openapi.json").send().await.unwrap().text().await.unwrap();
    assert_eq!(text, chladni::http::openapi().unwrap());
}
