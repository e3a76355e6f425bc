//! Evenly spread vertices: where the basis functions of a subspace are centred.

mod farthest;
mod lloyd;
mod random;

pub use farthest::{extend_farthest_points, farthest_points};
pub use lloyd::{lloyd, voronoi_cells};
