//! Farthest-point sampling along edges.

use chladni_base::SplitMix64;
use chladni_base::{Cancelled, Monitor};

use super::typical_edge;
use crate::connectivity::Connectivity;
use crate::distance::Queue;

/// Vertices per block of the search for the farthest one.
const BLOCK: usize = 256;

/// How many vertices are settled between two checkpoints.
const CHECK_EVERY: usize = 1 << 14;

/// `count` vertices, or all if there are fewer, each as far as possible along edges from those before it; the first is
/// drawn by `seed`. Components without a sample come before everything else, so that each has one as soon as there are
/// as many samples as components.
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn farthest_points(
    connectivity: &Connectivity,
    count: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let n = connectivity.vertices();
    let mut samples = Vec::with_capacity(count.min(n));
    if n > 0 && count > 0 {
        samples.push(SplitMix64::new(seed).below(n) as u32);
    }
    extend_farthest_points(connectivity, samples, count, monitor)
}

/// Adds vertices to `samples`, each as far as possible from those before it, until there are `count` or all. Samples
/// that repeat or are no vertices are dropped.
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn extend_farthest_points(
    connectivity: &Connectivity,
    mut samples: Vec<u32>,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let n = connectivity.vertices();
    let count = count.min(n);
    let mut front = Front::new(connectivity);
    samples.retain(|&v| (v as usize) < n && front.seed(v));
    front.advance(monitor)?;
    while samples.len() < count {
        let Some(farthest) = front.farthest() else { break };
        front.seed(farthest);
        front.advance(monitor)?;
        samples.push(farthest);
        if samples.len().is_multiple_of(64) {
            monitor.progress(samples.len() as f64 / count as f64);
        }
    }
    Ok(samples)
}

/// The distance of every vertex to the nearest sample, kept up to date as samples are added: each one only visits the
/// vertices that it is closest to.
pub(super) struct Front<'a> {
    connectivity: &'a Connectivity,
    lengths: Vec<f32>,
    distances: Vec<f32>,
    /// For each block of vertices a number that no distance in it exceeds. Distances only shrink, so an old bound stays
    /// true.
    bounds: Vec<f32>,
    queue: Queue,
    steps: usize,
}

impl<'a> Front<'a> {
    pub fn new(connectivity: &'a Connectivity) -> Self {
        let n = connectivity.vertices();
        Self {
            connectivity,
            lengths: connectivity.scaled_lengths(connectivity.longest_edge()),
            distances: vec![f32::INFINITY; n],
            bounds: vec![f32::INFINITY; n.div_ceil(BLOCK)],
            queue: Queue::new(typical_edge(connectivity), 1.0),
            steps: 0,
        }
    }

    /// Makes a vertex a sample; false if it was one.
    pub fn seed(&mut self, v: u32) -> bool {
        let new = self.distances[v as usize] > -1.0;
        // Below every distance, so that a sample is not chosen again where all others are at distance 0 too.
        self.distances[v as usize] = -1.0;
        if new {
            self.queue.push(0.0, v);
        }
        new
    }

    /// Spreads the distances of new samples.
    pub fn advance(&mut self, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        while let Some((distance, v)) = self.queue.pop() {
            if distance > self.distances[v as usize].max(0.0) {
                continue;
            }
            self.steps += 1;
            if self.steps.is_multiple_of(CHECK_EVERY) {
                monitor.checkpoint()?;
            }
            let range = self.connectivity.edge_range(v);
            for (&w, &length) in self.connectivity.all_neighbours()[range.clone()].iter().zip(&self.lengths[range]) {
                let through = distance + length;
                if through < self.distances[w as usize] {
                    self.distances[w as usize] = through;
                    self.queue.push(through, w);
                }
            }
        }
        Ok(())
    }

    /// The vertex farthest from all samples, the first of several; `None` when every vertex is a sample.
    pub fn farthest(&mut self) -> Option<u32> {
        loop {
            let (block, bound) = first_maximum(&self.bounds)?;
            let begin = block * BLOCK;
            let end = (begin + BLOCK).min(self.distances.len());
            let (offset, distance) = first_maximum(&self.distances[begin..end])?;
            if distance < 0.0 && bound < 0.0 {
                return None;
            }
            self.bounds[block] = distance;
            if distance == bound && distance >= 0.0 {
                return Some((begin + offset) as u32);
            }
        }
    }
}

/// The first of the largest values and where it is.
fn first_maximum(values: &[f32]) -> Option<(usize, f32)> {
    let largest = values.iter().fold(f32::NEG_INFINITY, |a, &b| if b > a { b } else { a });
    values.iter().position(|&x| x == largest).map(|at| (at, largest))
}
