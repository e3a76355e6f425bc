//! Local functions around centres on any graph in space: radial, with a cubic profile, in the connected parts of balls.

use chladni_algebra::SparseMatrix;
use chladni_base::SplitMix64;
use chladni_base::{Cancelled, Monitor};
use rayon::prelude::*;

/// Weights at or below this are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// Rows that have neighbours and places in space.
pub(super) trait Places: Sync {
    /// The number of rows.
    fn size(&self) -> usize;
    /// Where a row lies.
    fn position(&self, row: u32) -> [f64; 3];
    /// The rows next to one; itself may be among them.
    fn neighbours(&self, row: u32) -> &[u32];
}

/// Rows such that every row lies within `radius` of one, on the connected part of the ball around it; ascending, so that neighbours have
/// close numbers where those of the graph have.
pub(super) fn centres(
    graph: &impl Places,
    radius: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let n = graph.size();
    let order = SplitMix64::new(seed).permutation(n);
    let mut covered = vec![false; n];
    let mut ball = Ball::new(n);
    let mut centres = Vec::new();
    for (k, &row) in order.iter().enumerate() {
        if k % 1024 == 0 {
            monitor.checkpoint()?;
        }
        if covered[row as usize] {
            continue;
        }
        centres.push(row);
        ball.grow(graph, row, radius);
        for &(row, _) in &ball.found {
            covered[row as usize] = true;
        }
    }
    centres.sort_unstable();
    Ok(centres)
}

/// One function for each centre, with support in the ball of a radius around it; rows have the sum 1.
pub(super) fn functions(
    graph: &impl Places,
    centres: &[u32],
    radius: f64,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    let n = graph.size();
    // Columns in parallel, gathered in the order of the centres.
    let parts: Vec<Vec<(u32, u32, f32)>> = centres
        .par_chunks(64)
        .enumerate()
        .map_init(
            || Ball::new(n),
            |ball, (chunk, part)| {
                monitor.checkpoint()?;
                let mut entries = Vec::new();
                for (k, &centre) in part.iter().enumerate() {
                    ball.grow(graph, centre, radius);
                    for &(row, square) in &ball.found {
                        let x = square.sqrt() / radius;
                        let value = 1.0 - x * x * (3.0 - 2.0 * x);
                        if value > LEAST_WEIGHT || row == centre {
                            entries.push((row, (chunk * 64 + k) as u32, value as f32));
                        }
                    }
                }
                Ok(entries)
            },
        )
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

/// The connected part of a ball.
struct Ball {
    stamp: Vec<u32>,
    current: u32,
    /// Rows with the squares of their distances from the centre.
    found: Vec<(u32, f64)>,
}

impl Ball {
    fn new(n: usize) -> Self {
        Self { stamp: vec![0; n], current: 0, found: Vec::new() }
    }

    fn grow(&mut self, graph: &impl Places, centre: u32, radius: f64) {
        self.current += 1;
        self.found.clear();
        self.found.push((centre, 0.0));
        self.stamp[centre as usize] = self.current;
        let origin = graph.position(centre);
        let limit = radius * radius;
        let mut head = 0;
        while head < self.found.len() {
            let row = self.found[head].0;
            head += 1;
            for &other in graph.neighbours(row) {
                let stamp = &mut self.stamp[other as usize];
                if *stamp == self.current {
                    continue;
                }
                let position = graph.position(other);
                let square: f64 = (0..3).map(|k| (position[k] - origin[k]).powi(2)).sum();
                if square < limit {
                    *stamp = self.current;
                    self.found.push((other, square));
                }
            }
        }
    }
}
