//! Spectral geometry: eigenbases of surfaces and solids, compact and certified, and what they are good for.

pub mod analysis;
pub mod basis;
pub mod field;
pub mod formats;
pub mod operator;
pub mod spectrum;

pub use chladni_algebra as algebra;
pub use chladni_base::{Cancelled, Monitor, Quiet, StageClock, Unwatched};
pub use chladni_mesh as mesh;
