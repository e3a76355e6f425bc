//! The API against the real server: one binary, one module per resource.

/// What the server allocates with.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[path = "../common/mod.rs"]
mod common;

mod analysis;
mod attributes;
mod auth;
mod bases;
mod bodies;
mod collections;
mod dense;
mod documents;
mod estimates;
mod family;
mod fields;
mod garbage;
#[cfg(feature = "gpu")]
mod gpu;
mod guide;
mod hostile;
mod jobs;
mod journeys;
mod meshes;
mod numbering;
mod pencils;
mod points;
mod quads;
mod samples;
mod schemas;
mod stored;
mod strictness;
mod system;
mod verification;
mod vibration;
