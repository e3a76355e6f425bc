//! Which parameters the query of an operation has: those that its own declaration names, read off the document. So a
//! typing error is refused wherever it is made, on routes too that read no query at all.

use std::collections::HashMap;
use std::sync::Arc;

use axum::extract::{MatchedPath, Query, Request, State};
use axum::http::{Method, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use utoipa::openapi::OpenApi;
use utoipa::openapi::path::Operation;

use super::access::operations;
use super::problem::{self, Problem};

/// Where the API begins. Probes and pages are asked by machines of all kinds, some of which add parameters of their
/// own.
const API: &str = "/v1/";

/// The names of the parameters that the query of every operation may have.
#[derive(Debug)]
pub struct Parameters(HashMap<String, Vec<(Method, Vec<String>)>>);

impl Parameters {
    /// Reads the declarations off the document.
    pub fn of(document: &OpenApi) -> Self {
        let paths = document.paths.paths.iter().filter(|(path, _)| path.starts_with(API));
        Self(
            paths
                .map(|(path, item)| {
                    let named = operations(item).map(|(method, operation)| (method, names(operation)));
                    (path.clone(), named.collect())
                })
                .collect(),
        )
    }

    /// The problem of a query with a parameter that its operation has not.
    fn refusal(&self, path: &str, method: &Method, uri: &Uri) -> Option<Problem> {
        uri.query()?;
        // Where there is a GET there is a HEAD.
        let method = if method == Method::HEAD { &Method::GET } else { method };
        let (_, known) = self.0.get(path)?.iter().find(|(own, _)| own == method)?;
        // What is no query at all is told by the route that reads it.
        let Query(given) = Query::<Vec<(String, String)>>::try_from_uri(uri).ok()?;
        let (name, _) = given.into_iter().find(|(name, _)| !known.contains(name))?;
        Some(unknown(&name, known))
    }
}

/// The names of the parameters of a query, as an operation declares them.
fn names(operation: &Operation) -> Vec<String> {
    let declared = serde_json::to_value(&operation.parameters).unwrap_or_default();
    let listed = declared.as_array().map(Vec::as_slice).unwrap_or_default();
    let of_query = listed.iter().filter(|parameter| parameter["in"] == "query");
    of_query.filter_map(|parameter| Some(parameter["name"].as_str()?.to_owned())).collect()
}

fn unknown(name: &str, known: &[String]) -> Problem {
    let name = problem::shorten(name.to_owned());
    let quoted: Vec<String> = known.iter().map(|name| format!("{name:?}")).collect();
    let expected = match quoted.as_slice() {
        [] => "this route takes none".to_owned(),
        [only] => format!("expected {only}"),
        several => format!("expected one of {}", several.join(", ")),
    };
    Problem::new(&problem::INVALID_QUERY, format!("Unknown query parameter {name:?}; {expected}."))
}

/// Refuses queries with parameters that their operations do not have.
pub async fn check(State(parameters): State<Arc<Parameters>>, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    match path.and_then(|path| parameters.refusal(path, request.method(), request.uri())) {
        Some(refused) => refused.into_response(),
        None => next.run(request).await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal_detail(method: Method, path: &str, query: &str) -> Option<String> {
        let parameters = Parameters::of(&super::super::routes().split_for_parts().1);
        let uri = format!("{path}?{query}").parse().unwrap();
        parameters.refusal(path, &method, &uri).map(|refused| refused.detail().to_owned())
    }

    #[test]
    fn queries_have_the_parameters_that_the_document_names() {
        let told = |method, path, query| refusal_detail(method, path, query).unwrap_or_default();
        assert_eq!(
            told(Method::GET, "/v1/meshes/{id}", "foo=1"),
            r#"Unknown query parameter "foo"; this route takes none."#
        );
        assert_eq!(
            told(Method::HEAD, "/v1/jobs/{id}", "wait=1s&wiat=2s"),
            r#"Unknown query parameter "wiat"; expected "wait"."#
        );
        assert!(told(Method::POST, "/v1/jobs", "f%6Fo").contains(r#"Unknown query parameter "foo"; expected one of "#));
        for (method, path, query) in [
            (Method::POST, "/v1/jobs", "wait=1s&numbering=kept&extend=nearest"),
            (Method::POST, "/v1/jobs", ""),
            (Method::DELETE, "/v1/meshes/{id}", "cascade=true"),
            // What a probe or a cache adds.
            (Method::GET, "/healthz", "t=17"),
            (Method::PUT, "/v1/meshes/{id}", "foo=1"),
        ] {
            assert_eq!(told(method, path, query), "", "{path}?{query}");
        }
    }

    #[test]
    fn every_operation_says_that_it_refuses_such_a_query() {
        let (_, document) = super::super::routes().split_for_parts();
        for (path, item) in document.paths.paths.iter().filter(|(path, _)| path.starts_with(API)) {
            for (method, operation) in operations(item) {
                let answers = serde_json::to_value(&operation.responses).unwrap();
                let told = answers["400"]["description"].as_str().unwrap_or_default().to_owned();
                assert!(told.contains(problem::INVALID_QUERY.id), "{method} {path}: {told}");
            }
        }
    }
}
