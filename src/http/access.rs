//! Who may call which operation. The scope of an operation is the one that its own declaration names
//! (`security(("bearer" = ["read"]))`), read off the document: what is documented and what is enforced cannot differ.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use headers::authorization::Bearer;
use headers::{Authorization, HeaderMapExt};
use utoipa::openapi::path::Operation;
use utoipa::openapi::{OpenApi, PathItem};

use super::auth::{self, Scope};
use super::client::{SolvePlace, client_name};
use super::problem::{self, Problem};
use super::slots::Turn;
use super::state::AppState;

/// How long the answer to a wrong key is held back, so that guessing is slow.
const WRONG_KEY_PAUSE: Duration = Duration::from_millis(200);

/// Who calls: the name of the API key, or `anonymous` where the server has none.
#[derive(Debug, Clone)]
pub struct Principal(pub Arc<str>);

impl Default for Principal {
    fn default() -> Self {
        Self("anonymous".into())
    }
}

/// What a request needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Need {
    /// Nothing: it is open to everyone.
    Nothing,
    /// Any key: there is no such operation, and only those who may call some are told so.
    Key,
    /// A key with a scope.
    Scope(Scope),
}

/// What every operation of the document needs.
#[derive(Debug)]
pub struct Access(HashMap<String, Vec<(Method, Need)>>);

impl Access {
    /// Reads the declarations off the document. What declares nothing that is understood needs the widest scope.
    pub fn of(document: &OpenApi) -> Self {
        Self(document.paths.paths.iter().map(|(path, item)| (path.clone(), needs(item))).collect())
    }

    fn need(&self, path: Option<&str>, method: &Method) -> Need {
        // Where there is a GET there is a HEAD.
        let method = if method == Method::HEAD { &Method::GET } else { method };
        let operations = path.and_then(|path| self.0.get(path)).map(Vec::as_slice).unwrap_or_default();
        operations.iter().find(|(known, _)| known == method).map_or(Need::Key, |(_, need)| *need)
    }
}

fn needs(item: &PathItem) -> Vec<(Method, Need)> {
    operations(item).map(|(method, operation)| (method, need(operation))).collect()
}

/// The operations of a path.
pub(super) fn operations(item: &PathItem) -> impl Iterator<Item = (Method, &Operation)> {
    let operations = [
        (Method::GET, &item.get),
        (Method::POST, &item.post),
        (Method::PUT, &item.put),
        (Method::PATCH, &item.patch),
        (Method::DELETE, &item.delete),
    ];
    operations.into_iter().filter_map(|(method, operation)| Some((method, operation.as_ref()?)))
}

fn need(operation: &Operation) -> Need {
    let declared = serde_json::to_value(&operation.security).unwrap_or_default();
    match declared.as_array().map(Vec::as_slice) {
        Some([open]) if open.as_object().is_some_and(serde_json::Map::is_empty) => Need::Nothing,
        Some([scheme]) => {
            let name = scheme["bearer"][0].as_str();
            Need::Scope(name.and_then(Scope::named).unwrap_or(Scope::Operate))
        }
        _ => Need::Scope(Scope::Operate),
    }
}

/// Lets in who may do what the request asks for.
pub async fn authorise(
    State((state, access)): State<(AppState, Arc<Access>)>,
    mut request: Request,
    next: Next,
) -> Response {
    let path = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    let need = access.need(path, request.method());
    match admit(&state, request.headers(), need) {
        Ok(principal) => {
            let turn = match need {
                // What writes waits for other writes, and must not keep readers waiting meanwhile.
                Need::Scope(Scope::Read) => {
                    let client = client_name(&state, request.extensions(), &principal.0);
                    // What only reads and has a body is a solve.
                    if request.method() == Method::POST {
                        match SolvePlace::of(&state, &client) {
                            Ok(place) => request.extensions_mut().insert(place),
                            Err(refused) => {
                                let mut response = refused.into_response();
                                response.extensions_mut().insert(principal);
                                return response;
                            }
                        };
                    }
                    Turn::of(&state.slots, &client).await
                }
                _ => Turn::default(),
            };
            request.extensions_mut().insert(principal.clone());
            request.extensions_mut().insert(turn.clone());
            let mut response = next.run(request).await;
            turn.step_aside();
            response.extensions_mut().insert(principal);
            response
        }
        Err(Refusal::WrongKey(refused)) => {
            state.metrics.keys_refused.inc();
            tokio::time::sleep(WRONG_KEY_PAUSE).await;
            refused.into_response()
        }
        Err(Refusal::Lacking(principal, refused)) => {
            let mut response = refused.into_response();
            response.extensions_mut().insert(principal);
            response
        }
        Err(Refusal::NoKey(refused)) => refused.into_response(),
    }
}

/// Why a request is not let in.
enum Refusal {
    NoKey(Problem),
    WrongKey(Problem),
    Lacking(Principal, Problem),
}

fn admit(state: &AppState, headers: &HeaderMap, need: Need) -> Result<Principal, Refusal> {
    let keys = state.keys();
    if need == Need::Nothing || keys.is_empty() {
        return Ok(Principal::default());
    }
    let unauthenticated = |detail: &str, challenge: &'static str| {
        Problem::new(&problem::UNAUTHENTICATED, detail)
            .header(header::WWW_AUTHENTICATE, HeaderValue::from_static(challenge))
    };
    let Some(Authorization(token)) = headers.typed_get::<Authorization<Bearer>>() else {
        return Err(Refusal::NoKey(unauthenticated(
            "An API key is needed: send the header Authorization: Bearer KEY.",
            "Bearer realm=\"chladni\"",
        )));
    };
    let Some(key) = auth::find(&keys, token.token().trim()) else {
        return Err(Refusal::WrongKey(unauthenticated(
            "This server does not know the API key.",
            "Bearer realm=\"chladni\", error=\"invalid_token\"",
        )));
    };
    let principal = Principal(key.name.as_str().into());
    match need {
        Need::Scope(scope) if !key.allows(scope) => {
            let detail = format!("The API key {:?} lacks the scope {:?}.", key.name, scope.name());
            Err(Refusal::Lacking(principal, Problem::new(&problem::FORBIDDEN, detail).with("scope", scope.name())))
        }
        _ => Ok(principal),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scopes_are_those_of_the_document() {
        let access = Access::of(&super::super::routes().split_for_parts().1);
        let need = |method: Method, path: &str| access.need(Some(path), &method);
        assert_eq!(need(Method::GET, "/healthz"), Need::Nothing);
        assert_eq!(need(Method::GET, "/metrics"), Need::Scope(Scope::Operate));
        assert_eq!(need(Method::HEAD, "/v1/bases/{id}/content"), Need::Scope(Scope::Read));
        assert_eq!(need(Method::POST, "/v1/functional-maps"), Need::Scope(Scope::Read));
        assert_eq!(need(Method::POST, "/v1/jobs"), Need::Scope(Scope::Submit));
        assert_eq!(need(Method::DELETE, "/v1/meshes/{id}"), Need::Scope(Scope::Operate));
        assert_eq!(need(Method::PUT, "/healthz"), Need::Key);
        assert_eq!(access.need(None, &Method::GET), Need::Key);
    }

    #[test]
    fn what_declares_nothing_needs_the_widest_scope() {
        use utoipa::openapi::security::SecurityRequirement;
        assert_eq!(need(&Operation::new()), Need::Scope(Scope::Operate));
        let mut operation = Operation::new();
        operation.security = Some(vec![SecurityRequirement::new("bearer", ["everything"])]);
        assert_eq!(need(&operation), Need::Scope(Scope::Operate));
        operation.security = Some(vec![SecurityRequirement::new("bearer", ["read"])]);
        assert_eq!(need(&operation), Need::Scope(Scope::Read));
    }
}
