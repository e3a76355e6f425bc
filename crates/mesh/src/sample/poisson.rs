//! Constrained Poisson-disk sampling on the vertices of a mesh (Corsini, Cignoni and Scopigno 2012).

use chladni_base::SplitMix64;
use chladni_base::{Cancelled, Monitor, Vector3};

use super::clusters::Clusters;
use super::farthest::extend_farthest_points;
use crate::TriangleMesh;
use crate::connectivity::Connectivity;
use crate::measure::vertex_areas;

/// The pool of candidates holds about this many vertices for each sample, as in the paper.
const POOL: f64 = 40.0;

/// Candidates that are compared for one sample.
const CANDIDATES: usize = 10;

/// The area that a sample keeps to itself, in squared disk radii: what best-of-ten throws on a plane arrive at.
const AREA_PER_SAMPLE: f64 = 1.33;

/// A count of samples is good enough from this share of the wanted count on; farthest points fill the rest.
const ENOUGH: f64 = 0.96;

/// Radii that are tried at most.
const ROUNDS: usize = 16;

/// `count` vertices, or all if there are fewer, no two of them closer in space than a radius that is found so that at
/// most 4 % are left to be filled in. Those go where samples along edges are farthest, so that thin parts and small
/// components, which straight-line disks pass over, get theirs.
///
/// # Errors
/// [`Cancelled`] when the monitor asks for it.
pub fn poisson_disk(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    count: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let n = mesh.positions.len();
    if count >= n {
        return Ok((0..n as u32).collect());
    }
    let areas = vertex_areas(mesh);
    let area: f64 = areas.iter().sum();
    let mut best: Vec<u32> = Vec::new();
    if count > 1 && area > 0.0 && area.is_finite() {
        let mut random = SplitMix64::new(seed);
        let pool = pool(&areas, POOL * count as f64 / area, &mut random);
        let (mut low, mut high) = (0.0f64, f64::INFINITY);
        let mut radius = (area / (AREA_PER_SAMPLE * count as f64)).sqrt();
        for _ in 0..ROUNDS {
            monitor.checkpoint()?;
            let samples = throw(mesh, &pool, radius, random.clone(), monitor)?;
            let found = samples.len();
            if found <= count && found > best.len() {
                best = samples;
            }
            if found <= count && found as f64 >= ENOUGH * count as f64 {
                break;
            }
            // Counts fall with the square of the radius; a bracket guards against surfaces where they do not.
            if found > count {
                low = radius
            } else {
                high = radius
            }
            let guess = radius * (found.max(1) as f64 / (0.98 * count as f64)).sqrt();
            radius = if guess > low && guess < high { guess } else { 0.5 * (low + high) };
            if !(radius.is_finite() && high - low > 1e-6 * radius) {
                break;
            }
        }
    }
    if best.is_empty() && count > 0 {
        best.push(SplitMix64::new(seed).below(n) as u32);
    }
    match Clusters::new(mesh, connectivity, &areas, count, seed, monitor)? {
        Some(clusters) => clusters.extend(mesh, best, count, monitor),
        None => extend_farthest_points(connectivity, best, count, monitor),
    }
}

/// Draws vertices with a probability of `per_area` times their area: all where the mesh is coarse, few where it is
/// fine.
fn pool(areas: &[f64], per_area: f64, random: &mut SplitMix64) -> Vec<u32> {
    let drawn = |&v: &u32| random.unit() < areas[v as usize] * per_area;
    (0..areas.len() as u32).filter(drawn).collect()
}

/// Throws disks of one radius until no candidate of the pool is left outside all of them; their centres.
fn throw(
    mesh: &TriangleMesh,
    pool: &[u32],
    radius: f64,
    mut random: SplitMix64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let mut grid = Grid::new(mesh, pool, radius);
    let mut order: Vec<u32> = (0..grid.cells.len() as u32).collect();
    random.shuffle(&mut order);
    let mut samples = Vec::new();
    while !order.is_empty() {
        for (turn, &cell) in order.iter().enumerate() {
            if turn % 256 == 0 {
                monitor.checkpoint()?;
            }
            if let Some(sample) = grid.best(cell, &mut random) {
                samples.push(grid.remove_around(cell, sample));
            }
        }
        order.retain(|&cell| grid.cells[cell as usize].alive > 0);
    }
    Ok(samples)
}

/// Candidates sorted into the cells of a regular grid, wide enough that a disk reaches no farther than the next cells.
struct Grid {
    /// Position in multiples of the disk radius, relative to the corner of the bounding box, and vertex.
    candidates: Vec<([f32; 3], u32)>,
    cells: Vec<Cell>,
    neighbours: Vec<u32>,
}

/// A cell that holds candidates; those still outside all disks come first.
struct Cell {
    begin: usize,
    alive: usize,
    /// Where the cells around it, itself included, lie in the grid's list.
    around: std::ops::Range<usize>,
}

/// The side of a cell in disk radii, as the paper chooses it.
const SIDE: f64 = 1.154_700_538;

impl Grid {
    fn new(mesh: &TriangleMesh, pool: &[u32], radius: f64) -> Self {
        let mut corner = [f64::INFINITY; 3];
        for &v in pool {
            let p = mesh.positions[v as usize];
            (0..3).for_each(|k| corner[k] = corner[k].min(p[k]));
        }
        // 21 bits for each axis: a finer grid than that saturates, which costs time but keeps every answer right,
        // because saturated cells are still next to those they touch.
        const LIMIT: f64 = ((1u64 << 21) - 2) as f64;
        let mut keyed: Vec<(u64, u32)> = pool
            .iter()
            .map(|&v| {
                let p = mesh.positions[v as usize];
                let at = |k: usize| (((p[k] - corner[k]) / (SIDE * radius)).min(LIMIT) as u64) + 1;
                (at(0) << 42 | at(1) << 21 | at(2), v)
            })
            .collect();
        keyed.sort_unstable();
        let mut keys: Vec<u64> = Vec::new();
        let mut cells: Vec<Cell> = Vec::new();
        for (i, &(key, _)) in keyed.iter().enumerate() {
            if keys.last() != Some(&key) {
                keys.push(key);
                cells.push(Cell { begin: i, alive: 0, around: 0..0 });
            }
            if let Some(cell) = cells.last_mut() {
                cell.alive += 1;
            }
        }
        let mut neighbours = Vec::with_capacity(cells.len() * 12);
        for (i, &key) in keys.iter().enumerate() {
            let begin = neighbours.len();
            for x in [-1i64, 0, 1] {
                for y in [-1i64, 0, 1] {
                    // The three cells of a row along the last axis are next to each other in the order of keys.
                    let first = key.wrapping_add_signed((x << 42) + (y << 21) - 1);
                    let from = keys.partition_point(|&k| k < first);
                    neighbours.extend((from..keys.len()).take_while(|&j| keys[j] <= first + 2).map(|j| j as u32));
                }
            }
            cells[i].around = begin..neighbours.len();
        }
        let candidates =
            keyed.iter().map(|&(_, v)| (((mesh.point(v) - Vector3(corner)) / radius).map(|x| x as f32), v)).collect();
        Self { candidates, cells, neighbours }
    }

    /// The candidate of a cell, among ten drawn ones, whose disk holds the fewest others; its place.
    fn best(&self, cell: u32, random: &mut SplitMix64) -> Option<usize> {
        let Cell { begin, alive, .. } = self.cells[cell as usize];
        if alive <= 1 {
            return (alive == 1).then_some(begin);
        }
        let mut best = (usize::MAX, 0);
        for i in 0..alive.min(CANDIDATES) {
            let at = begin + if alive <= CANDIDATES { i } else { random.below(alive) };
            best = best.min((self.count_around(cell, self.candidates[at].0), at));
        }
        Some(best.1)
    }

    fn count_around(&self, cell: u32, centre: [f32; 3]) -> usize {
        let mut count = 0;
        for &other in &self.neighbours[self.cells[cell as usize].around.clone()] {
            let Cell { begin, alive, .. } = self.cells[other as usize];
            count += self.candidates[begin..begin + alive].iter().filter(|(p, _)| within(*p, centre)).count();
        }
        count
    }

    /// Takes everything within the disk around a candidate out of the game, the candidate included; its vertex.
    fn remove_around(&mut self, cell: u32, at: usize) -> u32 {
        let (centre, vertex) = self.candidates[at];
        for &other in &self.neighbours[self.cells[cell as usize].around.clone()] {
            let Cell { begin, alive, .. } = &mut self.cells[other as usize];
            let mut i = *begin;
            while i < *begin + *alive {
                if self.candidates[i].1 == vertex || within(self.candidates[i].0, centre) {
                    *alive -= 1;
                    self.candidates.swap(i, *begin + *alive);
                } else {
                    i += 1;
                }
            }
        }
        vertex
    }
}

fn within(p: [f32; 3], centre: [f32; 3]) -> bool {
    let d = [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < 1.0
}
