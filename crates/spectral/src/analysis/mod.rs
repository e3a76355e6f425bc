//! What a basis is good for: shape comparisons, distances, signatures, filters, projections, compression, functional
//! maps, gradients of eigenvalues and eigenfunctions.

mod complement;
pub mod compression;
mod descents;
pub mod distance;
mod error;
pub mod family;
pub mod filter;
pub mod following;
pub mod functional_map;
pub mod geodesic;
pub mod heat;
pub mod map_collection;
pub mod mode_gradient;
pub mod neighbours;
pub mod projection;
pub mod scatter;
pub mod shape_dna;
pub mod signature;
pub mod sound;
pub mod spectrum;
pub mod subspace;
mod unit_gradients;
pub mod value_gradient;
pub mod vibration;

pub use error::{AnalysisError, allowed};

#[cfg(test)]
pub(crate) mod fixtures;
