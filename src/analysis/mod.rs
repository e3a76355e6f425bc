//! What a basis is good for: shape comparisons, distances, signatures, filters, projections, compression, functional maps.

pub mod family;
pub mod compression;
pub mod distance;
mod error;
pub mod filter;
pub mod functional_map;
pub mod geodesic;
pub mod kd_tree;
pub mod projection;
pub mod sound;
pub mod vibration;
pub mod scatter;
pub mod shape_dna;
pub mod signature;
pub mod spectrum;

pub use error::AnalysisError;

#[cfg(test)]
pub(crate) mod fixtures;
#[cfg(test)]
mod real_meshes;
