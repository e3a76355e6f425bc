//! Routes, wire types, problems and the OpenAPI document: the only room that names axum.
//!
//! [`AppState`] holds what requests share, [`router`] answers them, [`serve`] accepts connections.
//!
//! | file | what it does |
//! |---|---|
//! | `serve`, `connection`, `seats` | connections: accept loop, timeouts, drain; who gets one |
//! | `middleware` | what surrounds every request: id, log, metrics |
//! | `access`, `auth`, `origin`, `cors` | who may call what, API keys and scopes, hosts and origins |
//! | `client`, `shares` | what one client may use of what all share |
//! | `problem`, `problems`, `convert` | every error as RFC 9457, and which ones a route has |
//! | `parameters` | which parameters queries may have |
//! | `body`, `extract`, `ids`, `binary`, `conditional` | reading requests: limits, JSON, numbers, queries, ids, negotiation, ranges |
//! | `named` | ids that stay and names that change, of meshes and problems |
//! | `exchange` | JSON or raw numbers, both ways: what synchronous operations take and give |
//! | `numbering` | whose numbering of vertices and faces they are in |
//! | `wire`, `pencil_wire`, `details` | what goes over the wire |
//! | `document`, `kinds`, `variants` | the OpenAPI document, made of what the types say |
//! | `meshes`, `mesh_maps`, `upload`, `pencils`, `pencil_upload`, `jobs`, `events`, `bases`, `content`, `modes`, `solves`, `distances`, `signatures`, `compressions`, `comparisons`, `verification`, `subspaces`, `value_gradients`, `maps`, `fields`, `family`, `vibration`, `system`, `docs` | the routes |
//! | `web_page`, `guide`, `embedded` | the web page and the manual, embedded |

mod access;
mod auth;
mod bases;
mod binary;
mod body;
mod client;
mod comparisons;
mod compressions;
mod conditional;
mod connection;
mod content;
mod convert;
mod cors;
mod counted;
mod details;
mod distances;
mod docs;
mod document;
mod embedded;
mod estimates;
mod events;
mod exchange;
mod extract;
mod family;
mod field_cache;
mod fields;
mod guide;
mod ids;
mod jobs;
mod kinds;
mod links;
mod map_collections;
mod maps;
mod mesh_maps;
mod meshes;
mod middleware;
mod modes;
mod named;
mod numbering;
mod origin;
mod parameters;
mod pencil_upload;
mod pencil_wire;
mod pencils;
mod problem;
mod problems;
mod samples;
mod seats;
mod serve;
mod shapes;
mod shares;
mod signatures;
mod slots;
mod solves;
mod state;
mod stored_maps;
mod subspaces;
mod surfaces;
mod system;
mod turns;
mod upload;
mod value_gradients;
mod variants;
mod verification;
mod vibration;
mod web_page;
mod wire;

pub use auth::{ApiKey, KeyError, KeysNeeded, Scope, require_keys};
pub use docs::document as openapi;
pub use links::BasisLinks;
pub use pencil_wire::{ProblemLinks, ProblemResource};
pub use problem::{Kind, Problem};
pub use serve::serve;
pub use state::{AppState, Shared, StateError};
pub use wire::{
    BasisResource, BasisSummary, JobLinks, JobProblemResource, JobRequest, JobResource, MeshLinks, MeshResource,
    PageOf, StageSeconds, Status,
};

use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::header;
use axum::middleware::{from_fn, from_fn_with_state, map_request};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{Predicate, SizeAbove};
use tower_http::request_id::{PropagateRequestIdLayer, SetRequestIdLayer};
use utoipa_axum::router::OpenApiRouter;

use access::Access;
use parameters::Parameters;

/// Every route with its documentation.
fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::with_openapi(docs::base())
        .merge(meshes::routes())
        .merge(samples::routes())
        .merge(pencils::routes())
        .merge(jobs::routes())
        .merge(estimates::routes())
        .merge(bases::routes())
        .merge(content::routes())
        .merge(modes::routes())
        .merge(solves::routes())
        .merge(surfaces::routes())
        .merge(distances::routes())
        .merge(signatures::routes())
        .merge(compressions::routes())
        .merge(comparisons::routes())
        .merge(verification::routes())
        .merge(subspaces::routes())
        .merge(value_gradients::routes())
        .merge(maps::routes())
        .merge(map_collections::routes())
        .merge(stored_maps::routes())
        .merge(fields::routes())
        .merge(family::routes())
        .merge(vibration::routes())
        .merge(system::routes())
        .merge(docs::routes())
}

/// The whole API as a service.
pub fn router(state: AppState) -> Router {
    let (router, document) = routes().split_for_parts();
    let access = Arc::new(Access::of(&document));
    let parameters = Arc::new(Parameters::of(&document));
    let compression = CompressionLayer::new().gzip(true).zstd(true).compress_when(SizeAbove::new(1024).and(Text));
    router
        .fallback(middleware::not_found)
        .method_not_allowed_fallback(middleware::method_not_allowed)
        .layer(from_fn_with_state(parameters, parameters::check))
        .layer(from_fn_with_state((state.clone(), access), access::authorise))
        // What follows is no part of the API, stands in no document, and is open to everyone.
        .merge(
            web_page::routes()
                .merge(guide::routes())
                .merge(docs::pages())
                .method_not_allowed_fallback(middleware::method_not_allowed),
        )
        // Limits are applied where bodies are read, with problems of their own.
        .layer(DefaultBodyLimit::disable())
        .layer(compression)
        .layer(from_fn_with_state(state.clone(), origin::guard))
        .layer(from_fn(seats::guard))
        .layer(cors::layer(&state.config.cors_origins))
        .layer(CatchPanicLayer::custom(middleware::panicked))
        .layer(from_fn_with_state(state.clone(), middleware::observe))
        .layer(PropagateRequestIdLayer::new(middleware::REQUEST_ID))
        .layer(SetRequestIdLayer::new(middleware::REQUEST_ID, middleware::FreshId))
        .layer(map_request(middleware::harmless_id))
        .with_state(state)
}

/// Only text is worth compressing: factors and positions are close to random, and a strong tag names exact bytes.
#[derive(Debug, Clone, Copy)]
struct Text;

impl Predicate for Text {
    fn should_compress<B: http_body_util::BodyExt + axum::body::HttpBody>(
        &self,
        response: &axum::http::Response<B>,
    ) -> bool {
        let headers = response.headers();
        let exact = headers.contains_key(header::ACCEPT_RANGES);
        let kind = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
        let text = kind.contains("json") || kind.starts_with("text/") && !kind.starts_with("text/event-stream");
        text && !exact
    }
}
