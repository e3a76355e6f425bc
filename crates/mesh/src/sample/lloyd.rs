//! Lloyd's moves: samples go to the middle of the vertices that they are closest to.

use chladni_base::{Cancelled, Monitor, Vector3};

use super::typical_edge;
use crate::connectivity::Connectivity;
use crate::distance::Queue;

/// The cell of a vertex that no sample reaches.
pub const NO_CELL: u32 = u32::MAX;

/// For each of the `n` vertices the index in `samples` of the sample nearest along edges, or [`NO_CELL`].
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn voronoi_cells(
    connectivity: &Connectivity,
    samples: &[u32],
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let lengths = connectivity.scaled_lengths(connectivity.longest_edge());
    cells(connectivity, &lengths, samples, monitor)
}

fn cells(
    connectivity: &Connectivity,
    lengths: &[f32],
    samples: &[u32],
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let n = connectivity.vertices();
    let mut distances = vec![f32::INFINITY; n];
    let mut cells = vec![NO_CELL; n];
    let mut queue = Queue::new(typical_edge(connectivity), 1.0);
    for (cell, &v) in samples.iter().enumerate() {
        if (v as usize) < n && distances[v as usize] > 0.0 {
            distances[v as usize] = 0.0;
            cells[v as usize] = cell as u32;
            queue.push(0.0, v);
        }
    }
    let mut steps = 0usize;
    while let Some((distance, v)) = queue.pop() {
        if distance > distances[v as usize] {
            continue;
        }
        steps += 1;
        if steps.is_multiple_of(1 << 14) {
            monitor.checkpoint()?;
        }
        let range = connectivity.edge_range(v);
        for (&w, &length) in connectivity.all_neighbours()[range.clone()].iter().zip(&lengths[range]) {
            let through = distance + length;
            if through < distances[w as usize] {
                distances[w as usize] = through;
                cells[w as usize] = cells[v as usize];
                queue.push(through, w);
            }
        }
    }
    Ok(cells)
}

/// Moves each sample to the vertex of its cell that is nearest to the cell's centre of mass, `moves` times. The number
/// of samples, their order, and which component each lies on do not change. `positions` and `masses` have `n` entries;
/// masses may be [`vertex_areas`](crate::measure::vertex_areas).
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn lloyd(
    positions: &[[f64; 3]],
    connectivity: &Connectivity,
    masses: &[f64],
    mut samples: Vec<u32>,
    moves: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let points = Vector3::slice(positions);
    let lengths = connectivity.scaled_lengths(connectivity.longest_edge());
    for _ in 0..moves {
        let cells = cells(connectivity, &lengths, &samples, monitor)?;
        let mut centres = vec![(Vector3::ZERO, 0.0f64); samples.len()];
        for ((&cell, &p), &mass) in cells.iter().zip(points).zip(masses) {
            if let Some((sum, total)) = centres.get_mut(cell as usize) {
                *sum += mass * p;
                *total += mass;
            }
        }
        let mut nearest = vec![f64::INFINITY; samples.len()];
        for (v, (&cell, &p)) in cells.iter().zip(points).enumerate() {
            let Some(&(sum, total)) = centres.get(cell as usize) else { continue };
            // A cell without mass keeps its sample.
            if total > 0.0 {
                let square = (p - sum / total).norm_squared();
                if square < nearest[cell as usize] {
                    nearest[cell as usize] = square;
                    samples[cell as usize] = v as u32;
                }
            }
        }
    }
    Ok(samples)
}
