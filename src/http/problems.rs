//! The problems of a route as one list, for its documentation: statuses, texts and schemas follow from the kinds.

use std::collections::BTreeMap;

use utoipa::openapi::response::Response;
use utoipa::openapi::{ContentBuilder, Ref, RefOr, ResponseBuilder};

use super::problem::{self, Kind, MEDIA_TYPE};

/// A list of kinds that several routes share.
pub type List = &'static [&'static Kind];

/// What reading a body may answer.
pub const BODY: List = &[
    &problem::UNSUPPORTED_ENCODING,
    &problem::DAMAGED_ENCODING,
    &problem::BODY_TOO_LARGE,
    &problem::BODY_INCOMPLETE,
    &problem::BODY_TOO_SLOW,
    &problem::BUSY,
];

/// What parsing a JSON body may answer.
pub const JSON: List = &[&problem::UNSUPPORTED_MEDIA_TYPE, &problem::INVALID_JSON, &problem::INVALID_REQUEST];

/// What a synchronous solve in a stored basis may answer, whatever it computes.
pub const SOLVE: List = &[
    &problem::INVALID_QUERY,
    &problem::UNKNOWN_BASIS,
    &problem::NOT_ACCEPTABLE,
    &problem::BASIS_KIND,
    &problem::BASIS_WITHOUT_MESH,
    &problem::BUSY,
];

/// What a list of resources may answer.
pub const PAGE: List = &[&problem::INVALID_QUERY, &problem::INVALID_CURSOR];

/// What whatever writes to the store may answer.
pub const WRITE: List = &[&problem::STORAGE_FULL, &problem::STORAGE_BUSY, &problem::STORAGE_UNAVAILABLE];

/// What a change under `If-Match` may answer.
pub const CONDITION: List = &[&problem::PRECONDITION_FAILED];

/// The responses of a route for the kinds in `lists`: one for each status.
pub fn responses(lists: &[&[&'static Kind]]) -> BTreeMap<String, RefOr<Response>> {
    let mut by_status: BTreeMap<u16, Vec<&str>> = BTreeMap::new();
    for kind in lists.iter().copied().flatten() {
        let ids = by_status.entry(kind.status).or_default();
        if !ids.contains(&kind.id) {
            ids.push(kind.id);
        }
    }
    by_status.into_iter().map(|(status, ids)| (status.to_string(), response(&ids).into())).collect()
}

fn response(ids: &[&str]) -> Response {
    let listed = match ids {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => ids.concat(),
    };
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    ResponseBuilder::new().description(format!("A problem: {listed}")).content(MEDIA_TYPE, content).build()
}

/// Declares the problems of a route as a type, which the route's `responses(…)` names: shared lists first, then kinds
/// of its own.
macro_rules! problems {
    ($name:ident: $($list:ident)* [$($kind:ident),* $(,)?]) => {
        struct $name;

        impl utoipa::IntoResponses for $name {
            fn responses()
            -> std::collections::BTreeMap<String, utoipa::openapi::RefOr<utoipa::openapi::response::Response>> {
                $crate::http::problems::responses(&[
                    $($crate::http::problems::$list,)*
                    &[$(&$crate::http::problem::$kind),*],
                ])
            }
        }
    };
}

pub(super) use problems;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_gathered_by_status_and_named_once() {
        let found = responses(&[&[&problem::UNKNOWN_BASIS, &problem::BUSY], SOLVE]);
        let described = |status: &str| match &found[status] {
            RefOr::T(response) => response.description.clone(),
            RefOr::Ref(_) => panic!("a reference"),
        };
        assert_eq!(described("404"), "A problem: unknown-basis");
        assert_eq!(described("503"), "A problem: busy");
        let lists = responses(&[BODY]);
        let RefOr::T(malformed) = &lists["400"] else { panic!("a reference") };
        assert_eq!(malformed.description, "A problem: damaged-content-encoding or body-incomplete");
    }
}
