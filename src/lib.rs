//! Chladni: spectral geometry as a service.
//!
//! A mesh comes in, an eigenproblem is solved on it, and a compact, certified basis goes out. The numerics are crates
//! of their own, which know nothing of this one:
//!
//! ```text
//! chladni_base ← chladni_mesh, chladni_algebra ← chladni_spectral ← chladni_work ← chladni
//! ```
//!
//! The rooms here: [`store`] keeps meshes, jobs and bases, [`queue`] runs jobs, [`http`] is the API, [`cli`] the
//! command line.

pub mod cli;
pub mod config;
pub mod http;
pub mod queue;
pub mod store;
pub mod telemetry;
