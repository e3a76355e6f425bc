//! Evenly spread vertices: where the basis functions of a subspace are centred.

mod farthest;
mod lloyd;
mod poisson;
mod random;

pub use farthest::{extend_farthest_points, farthest_points};
pub use lloyd::{NO_CELL, lloyd, voronoi_cells};
pub use poisson::poisson_disk;

#[cfg(test)]
mod tests;
