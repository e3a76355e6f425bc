//! Local functions around centres on any graph: radial, with a cubic profile, in the connected parts of balls in space
//! or by another distance.

use chladni_algebra::SparseMatrix;
use chladni_base::SplitMix64;
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};

/// Weights at or below this are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// Centres of a task.
const CHUNK: usize = 64;

/// Rows that have neighbours and places in space.
pub(super) trait PositionedGraph: Sync {
    /// The number of rows.
    fn size(&self) -> usize;
    /// Where a row lies.
    fn position(&self, row: u32) -> [f64; 3];
    /// The rows next to one; itself may be among them.
    fn neighbours(&self, row: u32) -> &[u32];
}

/// A search for what lies around a row, used for one row after the other.
pub(super) trait Search: Send {
    /// The rows within the radius of `centre`, itself among them, with their distances as shares of it.
    fn around(&mut self, centre: u32) -> &[(u32, f64)];
}

/// Rows such that every row lies within `radius` of one, on the connected part of the ball around it; ascending, so
/// that neighbours have close numbers where those of the graph have.
pub(super) fn centres(
    graph: &impl PositionedGraph,
    radius: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    cover(graph.size(), Ball::new(graph, radius), seed, monitor)
}

/// The same of `n` rows, by any search.
pub(super) fn cover(
    n: usize,
    mut search: impl Search,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let order = SplitMix64::new(seed).permutation(n);
    let mut covered = vec![false; n];
    let mut centres = Vec::new();
    for (k, &row) in order.iter().enumerate() {
        if k % 256 == 0 {
            monitor.checkpoint()?;
        }
        if covered[row as usize] {
            continue;
        }
        centres.push(row);
        for &(row, _) in search.around(row) {
            covered[row as usize] = true;
        }
    }
    centres.sort_unstable();
    Ok(centres)
}

/// One function for each centre, with support in the ball of a radius around it; rows have the sum 1.
pub(super) fn functions(
    graph: &impl PositionedGraph,
    centres: &[u32],
    radius: f64,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    functions_by(graph.size(), || Ball::new(graph, radius), centres, monitor)
}

/// The same on `n` rows, by any search.
pub(super) fn functions_by<S: Search>(
    n: usize,
    search: impl Fn() -> S + Sync + Send,
    centres: &[u32],
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    // Columns in parallel, gathered in the order of the centres.
    let parts: Vec<Vec<(u32, u32, f32)>> = centres
        .par_chunks(CHUNK)
        .enumerate()
        .map_init(search, |search, (chunk, part)| {
            monitor.checkpoint()?;
            let mut entries = Vec::new();
            for (k, &centre) in part.iter().enumerate() {
                for &(row, x) in search.around(centre) {
                    let value = 1.0 - x * x * (3.0 - 2.0 * x);
                    if value > LEAST_WEIGHT || row == centre {
                        entries.push((row, (chunk * CHUNK + k) as u32, value as f32));
                    }
                }
            }
            Ok(entries)
        })
        .collect::<Result<_, Cancelled>>()?;
    let mut offsets = vec![0usize; n + 1];
    for part in &parts {
        for entry in part {
            offsets[entry.0 as usize + 1] += 1;
        }
    }
    for row in 0..n {
        offsets[row + 1] += offsets[row];
    }
    let mut next = offsets.clone();
    let (mut indices, mut values) = (vec![0u32; offsets[n]], vec![0f32; offsets[n]]);
    for (row, column, value) in parts.into_iter().flatten() {
        let at = next[row as usize];
        next[row as usize] += 1;
        (indices[at], values[at]) = (column, value);
    }
    for row in 0..n {
        let row = &mut values[offsets[row]..offsets[row + 1]];
        let sum: f32 = row.iter().sum();
        row.iter_mut().for_each(|value| *value /= sum);
    }
    Ok(SparseMatrix::from_sorted_parts(n, centres.len(), offsets, indices, values))
}

/// The connected part of a ball in space.
struct Ball<'a, G> {
    graph: &'a G,
    radius: f64,
    stamp: Vec<u32>,
    current: u32,
    found: Vec<(u32, f64)>,
}

impl<'a, G: PositionedGraph> Ball<'a, G> {
    fn new(graph: &'a G, radius: f64) -> Self {
        Self { graph, radius, stamp: vec![0; graph.size()], current: 0, found: Vec::new() }
    }
}

impl<G: PositionedGraph> Search for Ball<'_, G> {
    fn around(&mut self, centre: u32) -> &[(u32, f64)] {
        let Self { graph, radius, stamp, current, found } = self;
        *current += 1;
        found.clear();
        found.push((centre, 0.0));
        stamp[centre as usize] = *current;
        let origin = graph.position(centre);
        let limit = *radius * *radius;
        let mut head = 0;
        while head < found.len() {
            let row = found[head].0;
            head += 1;
            for &other in graph.neighbours(row) {
                let stamp = &mut stamp[other as usize];
                if *stamp == *current {
                    continue;
                }
                let position = graph.position(other);
                let square: f64 = (0..3).map(|k| (position[k] - origin[k]).powi(2)).sum();
                if square < limit {
                    *stamp = *current;
                    found.push((other, square.sqrt() / *radius));
                }
            }
        }
        found
    }
}
