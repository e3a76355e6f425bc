//! Clusters of vertices: a large mesh seen from afar, where samples are spread at a fraction of the cost.

use chladni_base::SplitMix64;
use chladni_base::{Cancelled, Monitor, Vector3};

use super::farthest::{Front, farthest_points};
use super::lloyd::{NO_CELL, lloyd};
use crate::TriangleMesh;
use crate::connectivity::Connectivity;

/// Clusters for each sample: enough that a cell of samples is round.
const PER_SAMPLE: usize = 32;

/// A mesh of fewer vertices than this for each sample is not worth clustering.
const WORTHWHILE: usize = 64;

/// Vertices that are visited between two checkpoints.
const CHECK_EVERY: usize = 1 << 15;

/// The vertices of a mesh in connected clusters of about equal area.
pub(super) struct Clusters {
    /// The cluster of each vertex.
    of: Vec<u32>,
    /// The centre of mass of each cluster, and the mass.
    centres: Vec<Vector3>,
    masses: Vec<f64>,
    /// Which clusters touch; lengths are the distances of their centres.
    graph: Connectivity,
}

impl Clusters {
    /// Clusters for `count` samples; `None` where the mesh has too few vertices for clusters to pay.
    pub fn new(
        mesh: &TriangleMesh,
        connectivity: &Connectivity,
        masses: &[f64],
        count: usize,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        let n = connectivity.vertices();
        let total: f64 = masses.iter().sum();
        if n / WORTHWHILE < count || count == 0 || !(total > 0.0 && total.is_finite()) {
            return Ok(None);
        }
        let (of, clusters) = grow(connectivity, masses, (PER_SAMPLE * count) as f64 / total, seed, monitor)?;
        if clusters < 4 * count {
            return Ok(None);
        }
        let mut sums = vec![(Vector3::ZERO, 0.0f64, Vector3::ZERO); clusters];
        for ((&cluster, &p), &mass) in of.iter().zip(mesh.points()).zip(masses) {
            let (sum, total, any) = &mut sums[cluster as usize];
            *sum += mass * p;
            *total += mass;
            *any = p;
        }
        let centres: Vec<Vector3> =
            sums.iter().map(|&(sum, total, any)| if total > 0.0 { sum / total } else { any }).collect();
        let graph = cluster_adjacency(connectivity, &of, &centres);
        Ok(Some(Self { of, centres, masses: sums.iter().map(|s| s.1).collect(), graph }))
    }

    /// Farthest points among the clusters, evened out by Lloyd's moves, then put on the vertices nearest the centres of
    /// mass of the cells.
    pub fn well_spread(
        &self,
        mesh: &TriangleMesh,
        masses: &[f64],
        count: usize,
        moves: usize,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<u32>, Cancelled> {
        let samples = farthest_points(&self.graph, count, seed, monitor)?;
        let samples = lloyd(Vector3::arrays(&self.centres), &self.graph, &self.masses, samples, moves, monitor)?;
        let cells = super::voronoi_cells(&self.graph, &samples, monitor)?;
        let mut sums = vec![(Vector3::ZERO, 0.0f64); samples.len()];
        for ((&cluster, &p), &mass) in self.of.iter().zip(mesh.points()).zip(masses) {
            if let Some((sum, total)) = sums.get_mut(cells[cluster as usize] as usize) {
                *sum += mass * p;
                *total += mass;
            }
        }
        let goals: Vec<Vector3> = sums
            .iter()
            .zip(&samples)
            .map(|(&(sum, total), &s)| if total > 0.0 { sum / total } else { self.centres[s as usize] })
            .collect();
        Ok(nearest(mesh, |v| cells[self.of[v] as usize], &goals))
    }

    /// Adds vertices to `samples`, in the middle of clusters as far as possible from all samples, until there are
    /// `count`.
    pub fn extend(
        &self,
        mesh: &TriangleMesh,
        mut samples: Vec<u32>,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<Vec<u32>, Cancelled> {
        let mut front = Front::new(&self.graph);
        for &v in &samples {
            front.seed(self.of[v as usize]);
        }
        front.advance(monitor)?;
        let mut added = vec![NO_CELL; self.centres.len()];
        let mut goals = Vec::new();
        while samples.len() + goals.len() < count {
            let Some(farthest) = front.farthest() else { break };
            front.seed(farthest);
            front.advance(monitor)?;
            added[farthest as usize] = goals.len() as u32;
            goals.push(self.centres[farthest as usize]);
        }
        samples.extend(nearest(mesh, |v| added[self.of[v] as usize], &goals));
        Ok(samples)
    }
}

/// For each group the vertex of it that is nearest to the goal of the group. No group is empty.
fn nearest(mesh: &TriangleMesh, group: impl Fn(usize) -> u32, goals: &[Vector3]) -> Vec<u32> {
    let mut best = vec![(f64::INFINITY, 0u32); goals.len()];
    for (v, &p) in mesh.points().iter().enumerate() {
        let group = group(v) as usize;
        if let (Some(&goal), Some(best)) = (goals.get(group), best.get_mut(group)) {
            let square = (p - goal).norm_squared();
            if square < best.0 {
                *best = (square, v as u32);
            }
        }
    }
    best.into_iter().map(|(_, v)| v).collect()
}

/// Grows clusters from vertices that are drawn with a probability of `per_mass` times their mass, ring after ring;
/// whatever they don't reach grows from its first vertex. The cluster of each vertex and the number of clusters.
fn grow(
    connectivity: &Connectivity,
    masses: &[f64],
    per_mass: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(Vec<u32>, usize), Cancelled> {
    let n = connectivity.vertices();
    let mut of = vec![NO_CELL; n];
    let mut clusters = 0;
    let mut queue: Vec<u32> = Vec::with_capacity(n);
    let mut random = SplitMix64::new(seed);
    for (v, &mass) in masses.iter().enumerate() {
        if random.unit() < mass * per_mass {
            of[v] = clusters;
            clusters += 1;
            queue.push(v as u32);
        }
    }
    let (mut next, mut first) = (0, 0);
    loop {
        while let Some(&v) = queue.get(next) {
            if next.is_multiple_of(CHECK_EVERY) {
                monitor.checkpoint()?;
            }
            next += 1;
            let cluster = of[v as usize];
            for &w in &connectivity.all_neighbours()[connectivity.edge_range(v)] {
                if of[w as usize] == NO_CELL {
                    of[w as usize] = cluster;
                    queue.push(w);
                }
            }
        }
        let Some(lone) = (first..n).find(|&v| of[v] == NO_CELL) else { break };
        of[lone] = clusters;
        clusters += 1;
        queue.push(lone as u32);
        first = lone;
    }
    Ok((of, clusters as usize))
}

/// The graph of clusters that share an edge of the mesh.
fn cluster_adjacency(connectivity: &Connectivity, of: &[u32], centres: &[Vector3]) -> Connectivity {
    let mut pairs: Vec<u64> = Vec::new();
    let mut last = 0;
    for v in 0..of.len() as u32 {
        let a = of[v as usize];
        for &w in &connectivity.all_neighbours()[connectivity.edge_range(v)] {
            let b = of[w as usize];
            let pair = u64::from(a) << 32 | u64::from(b);
            // Both directions are met, and the same pair often several times in a row.
            if a != b && pair != last {
                pairs.push(pair);
                last = pair;
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    let mut offsets = vec![0u32; centres.len() + 1];
    for &pair in &pairs {
        offsets[(pair >> 32) as usize + 1] += 1;
    }
    for i in 0..centres.len() {
        offsets[i + 1] += offsets[i];
    }
    let length = |&pair: &u64| {
        let (p, q) = (centres[(pair >> 32) as usize], centres[pair as u32 as usize]);
        (p - q).norm()
    };
    let lengths = pairs.iter().map(length).collect();
    Connectivity::from_graph(offsets, pairs.iter().map(|&pair| pair as u32).collect(), lengths)
}
