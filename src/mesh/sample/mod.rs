//! Evenly spread vertices: where the basis functions of a subspace are centred.

mod farthest;
mod lloyd;
mod order;
mod poisson;
mod random;

pub use farthest::{extend_farthest_points, farthest_points};
pub use lloyd::{NO_CELL, lloyd, voronoi_cells};
pub use order::sort_spatially;
pub use poisson::poisson_disk;

use super::connectivity::Connectivity;

/// The mean length of edges, in multiples of the longest.
fn typical_edge(connectivity: &Connectivity) -> f32 {
    (connectivity.mean_edge() / connectivity.longest_edge()) as f32
}

#[cfg(test)]
mod tests;
