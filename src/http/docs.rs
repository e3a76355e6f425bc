//! The OpenAPI document, a page that shows it, and a page of all problems. The pages load nothing from elsewhere.

use std::fmt::Write;
use std::sync::OnceLock;

use axum::Router;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{Html, IntoResponse, Response};
use serde_json::Value;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{ContentBuilder, Ref, ResponseBuilder};
use utoipa::{Modify, OpenApi, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::details::Details;
use super::extract::PathOf;
use super::problem::{self, KINDS, Problem};
use super::problems::problems;
use super::state::AppState;
use super::web_page;

/// An error, in the form of RFC 9457. Some kinds have further members.
#[derive(ToSchema)]
#[schema(as = Problem, example = json!({
    "type": "/problems/unreadable-mesh/index-out-of-range", "title": "The mesh cannot be read", "status": 422,
    "detail": "Face 17 refers to vertex 99 of 40."
}))]
#[allow(dead_code)]
pub struct ProblemSchema {
    /// A stable URI of the kind of problem; it can be opened on this server.
    #[schema(rename = "type")]
    r#type: String,
    /// A short summary of the kind.
    title: String,
    /// The HTTP status.
    status: u16,
    /// A sentence that names the offending element.
    detail: String,
}

/// Bytes.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[allow(dead_code)]
pub struct Binary(Vec<u8>);

#[derive(OpenApi)]
#[openapi(
    info(
        title = "Chladni",
        description = "Spectral geometry as a service. Upload a mesh, submit a job, get a certified basis of eigenfunctions.\n\nEvery error is `application/problem+json` (RFC 9457); `/problems` lists the kinds. Request bodies may be compressed with gzip or zstd. Lists are keyset pages: pass `next` as `from`.",
    ),
    tags(
        (name = "meshes", description = "Surfaces: uploaded, checked, repaired without loss, stored by content."),
        (name = "problems", description = "Pencils of sparse symmetric matrices that someone else assembled: uploaded, checked, stored by content."),
        (name = "jobs", description = "Eigenproblems, worked on in the background."),
        (name = "bases", description = "Bases of eigenfunctions, compact or dense, and what can be computed with them at once."),
        (name = "analysis", description = "Distances, signatures, comparisons, compression and maps: uses of a basis, computed at once."),
        (name = "fields", description = "Tangential fields on the faces: frames, eigenfields, design by strokes and constraints, fur and hatchings, the Hodge decomposition, vectors carried in parallel. Designs live in bases of the kind `field_basis`."),
        (name = "system", description = "Health, metrics, documentation."),
    ),
    servers((url = "/", description = "This server")),
    components(schemas(ProblemSchema)),
    modifiers(&Bearer)
)]
struct Document;

/// Adds the bearer scheme.
struct Bearer;

impl Modify for Bearer {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let scheme = HttpBuilder::new()
            .scheme(HttpAuthScheme::Bearer)
            .description(Some("An API key with the scope that the operation names: read, submit or operate. A server without keys, on loopback, needs none."))
            .build();
        document.components.get_or_insert_default().add_security_scheme("bearer", SecurityScheme::Http(scheme));
    }
}

/// The document before routes are added to it.
pub fn base() -> utoipa::openapi::OpenApi {
    Document::openapi()
}

/// The OpenAPI document of the API, as pretty JSON with a final newline.
///
/// # Errors
/// None in practice: the document is plain data.
pub fn document() -> Result<String, serde_json::Error> {
    let (_, mut document) = super::routes().split_for_parts();
    add_common_problems(&mut document);
    document.merge(Details::openapi());
    let schemas = &mut document.components.get_or_insert_default().schemas;
    schemas.extend(chladni_work::schema::components());
    let mut document = serde_json::to_value(&document)?;
    super::document::finish(&mut document);
    Ok(serde_json::to_string_pretty(&document)? + "\n")
}

/// Adds what any guarded operation may answer: without a key, without the scope, after a fault.
fn add_common_problems(document: &mut utoipa::openapi::OpenApi) {
    let answers = [
        ("401", "Unauthenticated", "A problem: unauthenticated"),
        ("403", "Forbidden", "A problem: scope-missing or origin-not-allowed"),
        ("500", "InternalError", "A problem: internal-error, with the request id in `X-Request-Id`"),
    ];
    let components = document.components.get_or_insert_default();
    for (_, name, description) in answers {
        let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
        let answer = ResponseBuilder::new().description(description).content(problem::MEDIA_TYPE, content).build();
        components.responses.insert(name.to_owned(), answer.into());
    }
    for path in document.paths.paths.values_mut() {
        for operation in [&mut path.get, &mut path.post, &mut path.patch, &mut path.delete].into_iter().flatten() {
            let guarded = serde_json::to_value(&operation.security).is_ok_and(|value| !value[0]["bearer"].is_null());
            for (status, name, _) in answers {
                if guarded || status == "500" {
                    let answer = Ref::from_response_name(name);
                    operation.responses.responses.insert(status.to_owned(), answer.into());
                }
            }
        }
    }
}

fn cached() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    TEXT.get_or_init(|| document().unwrap_or_default())
}

/// The routes of the documentation.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(openapi))
        .routes(routes!(reference))
        .routes(routes!(problems))
        .routes(routes!(one_problem))
}

/// Pages that stand in no document: the reference without a script, and the addresses of problems within a kind.
pub fn pages() -> Router<AppState> {
    Router::new()
        .route("/docs/plain", axum::routing::get(plain))
        .route("/problems/{kind}/{within}", axum::routing::get(one_problem_within))
}

/// Gives the OpenAPI document
///
/// OpenAPI 3.1, as JSON.
#[utoipa::path(get, path = "/openapi.json", tag = "system", operation_id = "openapi", security(()),
    responses((status = 200, description = "The document", body = Object, example = json!({"openapi": "3.1.0", "info": {"title": "Chladni"}}))))]
async fn openapi() -> Response {
    ([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], cached()).into_response()
}

/// Shows the reference of the API
///
/// A page made from the OpenAPI document: every operation, to be searched and tried. It loads nothing from elsewhere.
/// `/docs/plain` is the same to read, without a script; the manual is at `/docs/guide/`.
#[utoipa::path(get, path = "/docs", tag = "system", operation_id = "docs", security(()),
    responses((status = 200, description = "The page", body = String, content_type = "text/html", example = "<!doctype html>…")))]
async fn reference(headers: HeaderMap) -> Response {
    // A binary without its web page has the plain one.
    match web_page::reference(&headers) {
        Some(page) => page,
        None => plain().await,
    }
}

async fn plain() -> Response {
    static RENDERED: OnceLock<String> = OnceLock::new();
    html(RENDERED.get_or_init(|| render(&serde_json::from_str(cached()).unwrap_or_default())))
}

/// Lists every kind of problem
///
/// A page with the kinds of problems, their statuses and what to do about them.
#[utoipa::path(get, path = "/problems", tag = "system", operation_id = "problems", security(()),
    responses((status = 200, description = "The page", body = String, content_type = "text/html", example = "<!doctype html>…")))]
async fn problems() -> Response {
    html(&render_problems(KINDS))
}

problems!(ProblemProblems: [NOT_FOUND]);

/// Explains a kind of problem
///
/// What the `type` of a problem points to.
#[utoipa::path(get, path = "/problems/{kind}", tag = "system", operation_id = "problem", security(()),
    params(("kind" = String, Path, description = "The kind", example = "job-too-large")),
    responses(
        (status = 200, description = "The page", body = String, content_type = "text/html", example = "<!doctype html>…"),
        ProblemProblems,
    ))]
async fn one_problem(PathOf(kind): PathOf<String>) -> Result<Response, Problem> {
    explain(&kind)
}

async fn one_problem_within(path: PathOf<(String, String)>) -> Result<Response, Problem> {
    explain(&path.0.0)
}

fn explain(id: &str) -> Result<Response, Problem> {
    let kind = KINDS.iter().copied().find(|kind| kind.id == id);
    kind.map(|kind| html(&render_problems(&[kind])))
        .ok_or_else(|| Problem::new(&problem::NOT_FOUND, format!("There is no kind of problem {id:?}.")))
}

fn html(text: &str) -> Response {
    let mut response = Html(text.to_owned()).into_response();
    response.headers_mut().insert(
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static("default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"),
    );
    response
}

const STYLE: &str = "<style>
:root{color-scheme:light dark;--line:#8884;--soft:#8881}
body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}
h2{margin-top:3rem;border-bottom:1px solid var(--line)}
details{border:1px solid var(--line);border-radius:.4rem;margin:.5rem 0}
summary{padding:.5rem .8rem;cursor:pointer}details>div{padding:0 .8rem .8rem}
code,pre{font:13px/1.45 ui-monospace,monospace;background:var(--soft);border-radius:.2rem}
code{padding:.1rem .25rem}pre{padding:.6rem;overflow:auto}
.method{display:inline-block;min-width:4rem;font-weight:700}
table{border-collapse:collapse;width:100%}td,th{border-bottom:1px solid var(--line);text-align:left;padding:.3rem .5rem;vertical-align:top}
</style>";

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Prose with `code` and paragraphs.
fn prose(text: &str) -> String {
    let mut html = String::new();
    for paragraph in text.split("\n\n") {
        html.push_str("<p>");
        for (i, piece) in paragraph.split('`').enumerate() {
            let piece = escape(piece);
            html.push_str(&if i % 2 == 1 { format!("<code>{piece}</code>") } else { piece });
        }
        html.push_str("</p>");
    }
    html
}

fn text<'v>(value: &'v Value, name: &str) -> &'v str {
    value[name].as_str().unwrap_or_default()
}

/// The type of a schema in a few words.
fn type_name(schema: &Value) -> String {
    if let Some(reference) = schema["$ref"].as_str() {
        return reference.rsplit('/').next().unwrap_or_default().to_owned();
    }
    if let Some(choices) = schema["oneOf"].as_array().or(schema["anyOf"].as_array()) {
        return choices.iter().map(type_name).collect::<Vec<_>>().join(" or ");
    }
    if let Some(parts) = schema["allOf"].as_array() {
        let named = parts.iter().filter(|part| !part["$ref"].is_null()).map(type_name);
        return format!("{}, with", named.collect::<Vec<_>>().join(" and "));
    }
    if let Some(values) = schema["enum"].as_array() {
        return values.iter().map(Value::to_string).collect::<Vec<_>>().join(", ");
    }
    match &schema["type"] {
        Value::String(name) if name == "array" => format!("array of {}", type_name(&schema["items"])),
        Value::String(name) => name.clone(),
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" or "),
        _ => String::new(),
    }
}

fn render_content(html: &mut String, content: &Value, schemas: &Value) {
    for (media_type, body) in content.as_object().into_iter().flatten() {
        let name = type_name(&body["schema"]);
        let _ = write!(html, "<p><code>{}</code> {}</p>", escape(media_type), escape(&name));
        let mut show = |example: &Value| {
            let shown = match example {
                Value::String(text) => text.clone(),
                other => serde_json::to_string_pretty(other).unwrap_or_default(),
            };
            let _ = write!(html, "<pre>{}</pre>", escape(&shown));
        };
        if let Some(examples) = body["examples"].as_object() {
            examples.values().for_each(|example| show(&example["value"]));
            continue;
        }
        let example = [&body["example"], &schemas[&name]["example"]].into_iter().find(|e| !e.is_null());
        if let Some(example) = example {
            show(example);
        }
    }
}

fn render_operation(html: &mut String, method: &str, path: &str, operation: &Value, schemas: &Value) {
    let _ = write!(
        html,
        "<details id=\"{}\"><summary><span class=method>{}</span> <code>{}</code> {}</summary><div>{}",
        escape(text(operation, "operationId")),
        method.to_uppercase(),
        escape(path),
        escape(text(operation, "summary")),
        prose(text(operation, "description"))
    );
    let scopes: Vec<&str> = operation["security"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|scheme| scheme["bearer"].as_array())
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    if !scopes.is_empty() {
        let _ = write!(html, "<p>Scope: <code>{}</code></p>", escape(&scopes.join(" ")));
    }
    if let Some(parameters) = operation["parameters"].as_array() {
        html.push_str("<table><tr><th>Parameter<th>In<th>Type<th>Meaning</tr>");
        for parameter in parameters {
            let _ = write!(
                html,
                "<tr><td><code>{}</code><td>{}<td>{}<td>{}</tr>",
                escape(text(parameter, "name")),
                escape(text(parameter, "in")),
                escape(&type_name(&parameter["schema"])),
                prose(text(parameter, "description"))
            );
        }
        html.push_str("</table>");
    }
    if !operation["requestBody"].is_null() {
        html.push_str("<h4>Request</h4>");
        html.push_str(&prose(text(&operation["requestBody"], "description")));
        render_content(html, &operation["requestBody"]["content"], schemas);
    }
    for (status, response) in operation["responses"].as_object().into_iter().flatten() {
        // The same everywhere.
        if !response["$ref"].is_null() {
            continue;
        }
        let _ = write!(html, "<h4>{}</h4>{}", escape(status), prose(text(response, "description")));
        // Problems all look alike; their description names the kinds.
        if response["content"]["application/problem+json"].is_null() {
            render_content(html, &response["content"], schemas);
        }
    }
    html.push_str("</div></details>");
}

fn render(document: &Value) -> String {
    let mut html = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\"><title>Chladni API</title>{STYLE}<h1>Chladni {}</h1>{}<p><a href=\"/docs\">Interactive reference</a> · <a href=\"/docs/guide/\">manual</a> · <a href=\"/openapi.json\">OpenAPI document</a> · <a href=\"/problems\">problems</a></p>",
        escape(text(&document["info"], "version")),
        prose(text(&document["info"], "description")),
    );
    let schemas = &document["components"]["schemas"];
    for tag in document["tags"].as_array().into_iter().flatten() {
        let name = text(tag, "name");
        let _ = write!(html, "<h2>{}</h2>{}", escape(name), prose(text(tag, "description")));
        for (path, methods) in document["paths"].as_object().into_iter().flatten() {
            for (method, operation) in methods.as_object().into_iter().flatten() {
                if operation["tags"][0] == name {
                    render_operation(&mut html, method, path, operation, schemas);
                }
            }
        }
    }
    html.push_str("<h2>Types</h2>");
    for (name, schema) in schemas.as_object().into_iter().flatten() {
        let _ = write!(
            html,
            "<details id=\"{0}\"><summary><code>{0}</code></summary><div>{1}<p>{2}</p><table>",
            escape(name),
            prose(text(schema, "description")),
            if schema["type"] == "object" { String::new() } else { escape(&type_name(schema)) },
        );
        let parts = schema["allOf"].as_array().map_or(vec![schema], |all| all.iter().collect());
        for (member, shape) in parts.iter().filter_map(|part| part["properties"].as_object()).flatten() {
            let _ = write!(
                html,
                "<tr><td><code>{}</code><td>{}<td>{}</tr>",
                escape(member),
                escape(&type_name(shape)),
                prose(text(shape, "description"))
            );
        }
        html.push_str("</table></div></details>");
    }
    html
}

fn render_problems(kinds: &[&problem::Kind]) -> String {
    let mut html = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\"><title>Chladni problems</title>{STYLE}<h1>Problems</h1><p><a href=\"/docs\">API</a> · <a href=\"/problems\">all problems</a></p><table><tr><th>Type<th>Status<th>Meaning</tr>"
    );
    for kind in kinds {
        let _ = write!(
            html,
            "<tr><td><code>/problems/{}</code><td>{}<td><b>{}.</b>{}</tr>",
            escape(kind.id),
            kind.status,
            escape(kind.title),
            prose(kind.meaning)
        );
    }
    html.push_str("</table>");
    html
}
