//! Evenly spread vertices: where the basis functions of a subspace are centred.

mod clusters;
mod farthest;
mod lloyd;
mod order;
mod poisson;

use chladni_base::{Cancelled, Monitor};

pub use farthest::{extend_farthest_points, farthest_points};
pub use lloyd::{NO_CELL, lloyd, voronoi_cells};
pub use order::{faces_along_curve, sort_spatially, spatial_order};
pub use poisson::poisson_disk;

use super::TriangleMesh;
use super::connectivity::Connectivity;

/// `count` vertices, or all if there are fewer: farthest points evened out by Lloyd's `moves`, in spatial order.
/// `masses` has `n` entries, such as [`vertex_areas`](super::measure::vertex_areas).
///
/// A mesh of many vertices for each sample is first gathered into clusters, which are spread in place of vertices.
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn well_spread_points(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    masses: &[f64],
    count: usize,
    moves: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let mut samples = match clusters::Clusters::new(mesh, connectivity, masses, count, seed, monitor)? {
        Some(clusters) => clusters.well_spread(mesh, masses, count, moves, seed, monitor)?,
        None => {
            let samples = farthest_points(connectivity, count, seed, monitor)?;
            lloyd(&mesh.positions, connectivity, masses, samples, moves, monitor)?
        }
    };
    sort_spatially(mesh, &mut samples);
    Ok(samples)
}

/// The mean length of edges, in multiples of the longest.
fn typical_edge(connectivity: &Connectivity) -> f32 {
    (connectivity.mean_edge() / connectivity.longest_edge()) as f32
}

#[cfg(test)]
mod tests;
