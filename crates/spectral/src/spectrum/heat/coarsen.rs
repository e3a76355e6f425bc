//! From a level to a coarser one: vertices are gathered around seeds that lie a few edges apart.

use std::collections::{HashMap, VecDeque};

use chladni_base::parallel::*;

use super::level::HeatLevel;
use chladni_base::{Cancelled, Monitor, Vector3};

/// A coarse weight is the sum of the fine ones across the boundary of two cells, each times the share of the way
/// between the seeds that its edge makes; edges and paths are not straight, and this factor makes up for the mean of
/// that.
const STRAIGHTENING: f32 = 0.9;

/// Vertices of more triangles or edges than this are hubs: what goes through all of theirs looks whether it is still
/// wanted.
const LARGE_FAN: usize = 512;

/// A surface that a level lives on: positions on unit area, relative to some origin near the surface, and triangles.
#[derive(Clone, Copy)]
pub(super) struct Surface<'a> {
    pub positions: &'a [[f32; 3]],
    pub triangles: &'a [[u32; 3]],
}

/// A coarser level and how the finer one belongs to it.
pub(super) struct Coarsening {
    pub level: HeatLevel,
    /// The coarse vertex of every fine one.
    pub cells: Vec<u32>,
    /// The fine vertex in the middle of every coarse one.
    pub seeds: Vec<u32>,
    /// The radius of a cell, as it was asked for.
    pub reach: f32,
    /// The value at a fine vertex is the weighted mean of those at three coarse ones.
    pub corners: Vec<([u32; 3], [f32; 3])>,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Coarsening {
    /// Gathers vertices within `hops` edges and the length `reach` around seeds; the `forced` vertices are seeds.
    ///
    /// Coarse triangles are those fine ones whose corners lie in three cells, moved to the seeds: the stiffness is that
    /// of linear elements on them, and a fine vertex interpolates linearly on the triangle over it. Where cells touch
    /// without such a triangle (a tube thinner than a cell), a finite-volume weight stands in. Masses add up over
    /// cells.
    pub fn new(
        fine: &HeatLevel,
        surface: Surface,
        hops: usize,
        reach: f32,
        forced: &[u32],
        monitor: &dyn Monitor,
    ) -> Result<Self, Cancelled> {
        let seeds = seeds(fine, hops, reach, forced, monitor)?;
        monitor.checkpoint()?;
        let (cells, distances) = voronoi(fine, &seeds, hops, monitor)?;
        monitor.checkpoint()?;
        let positions: Vec<[f32; 3]> = seeds.iter().map(|&seed| surface.positions[seed as usize]).collect();
        let triangles = triangles(surface.triangles, &cells);
        monitor.checkpoint()?;
        let fans = Fans::new(seeds.len(), &triangles);
        let coarse = Surface { positions: &positions, triangles: &triangles };
        let level = condense(fine, coarse, &fans, &cells, &distances, monitor)?;
        drop(distances);
        // Written where they stay: as a result that may be cut short they would be gathered in lists, and then copied.
        let mut corners = vec![([0; 3], [0.0; 3]); cells.len()];
        let places = corners.par_iter_mut().zip(surface.positions).zip(&cells);
        places.try_for_each(|((corners, &position), &cell)| {
            let fan = fans.around(cell);
            // Around a vertex of many triangles, many look through many.
            if fan.len() > LARGE_FAN {
                monitor.checkpoint()?;
            }
            *corners = interpolate(position, cell, coarse, fan);
            Ok::<(), Cancelled>(())
        })?;
        monitor.checkpoint()?;
        Ok(Self { level, cells, seeds, reach, corners, positions, triangles })
    }

    /// The surface of the coarse level.
    pub fn surface(&self) -> Surface<'_> {
        Surface { positions: &self.positions, triangles: &self.triangles }
    }

    /// Lets go of the coarse level, and of all else but what interpolates.
    pub fn forget_all_but_corners(&mut self) {
        self.level = HeatLevel::empty();
        (self.cells, self.seeds) = (Vec::new(), Vec::new());
        (self.positions, self.triangles) = (Vec::new(), Vec::new());
    }
}

/// The distinct triples of cells that fine triangles join, ascending.
fn triangles(fine: &[[u32; 3]], cells: &[u32]) -> Vec<[u32; 3]> {
    let mut triangles: Vec<[u32; 3]> = fine
        .par_iter()
        .filter_map(|face| {
            let mut triple = face.map(|v| cells[v as usize]);
            triple.sort_unstable();
            (triple[0] != triple[1] && triple[1] != triple[2]).then_some(triple)
        })
        .collect();
    triangles.par_sort_unstable();
    triangles.dedup();
    triangles
}

/// The triangles around each vertex.
struct Fans {
    offsets: Vec<u32>,
    triangles: Vec<u32>,
}

impl Fans {
    fn new(n: usize, triangles: &[[u32; 3]]) -> Self {
        let mut offsets = vec![0u32; n + 1];
        for &v in triangles.as_flattened() {
            offsets[v as usize + 1] += 1;
        }
        for v in 0..n {
            offsets[v + 1] += offsets[v];
        }
        let mut next = offsets.clone();
        let mut around = vec![0u32; 3 * triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for &v in triangle {
                around[next[v as usize] as usize] = t as u32;
                next[v as usize] += 1;
            }
        }
        Self { offsets, triangles: around }
    }

    fn around(&self, vertex: u32) -> &[u32] {
        &self.triangles[self.offsets[vertex as usize] as usize..self.offsets[vertex as usize + 1] as usize]
    }
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Barycentric coordinates in the triangle of the fan around `cell` that holds the projection of `position` best, cut
/// to the triangle; the cell alone where it has no triangle.
fn interpolate(position: [f32; 3], cell: u32, coarse: Surface, fan: &[u32]) -> ([u32; 3], [f32; 3]) {
    let mut best = ([cell; 3], [1.0, 0.0, 0.0]);
    let mut inside = f32::NEG_INFINITY;
    for &t in fan {
        let corners = coarse.triangles[t as usize];
        let [p, q, r] = corners.map(|v| coarse.positions[v as usize]);
        let (u, v, w) = (minus(q, p), minus(r, p), minus(position, p));
        let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
        let square = uu * vv - uv * uv;
        if !(square > 1e-6 * uu * vv) {
            continue;
        }
        let (wu, wv) = (dot(w, u), dot(w, v));
        let (b, c) = ((vv * wu - uv * wv) / square, (uu * wv - uv * wu) / square);
        let coordinates = [1.0 - b - c, b, c];
        let least = coordinates.into_iter().fold(f32::INFINITY, f32::min);
        if least > inside {
            (best, inside) = ((corners, coordinates), least);
        }
        if least >= 0.0 {
            break;
        }
    }
    // Far outside all triangles the cell's own value is the safer one.
    if inside < -0.5 {
        return ([cell; 3], [1.0, 0.0, 0.0]);
    }
    let cut = best.1.map(|x: f32| x.max(0.0));
    let sum: f32 = cut.iter().sum();
    (best.0, cut.map(|x| x / sum))
}

/// A maximal set of vertices of which none lies within `hops` edges and `reach` of another; forced ones may.
fn seeds(
    fine: &HeatLevel,
    hops: usize,
    reach: f32,
    forced: &[u32],
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let n = fine.vertices();
    let mut covered = vec![false; n];
    let mut visited = vec![u32::MAX; n];
    let mut seeds: Vec<u32> = Vec::new();
    let mut queue: VecDeque<(u32, u32, f32)> = VecDeque::new();
    // The fewest edges and the length of the way by which each hub was reached.
    let mut hubs: HashMap<u32, (u32, f32)> = HashMap::new();
    let mut sorted = forced.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let forced = sorted.len();
    for (k, v) in sorted.into_iter().chain(0..n as u32).enumerate() {
        if k % 65536 == 0 {
            monitor.checkpoint()?;
        }
        if k >= forced && covered[v as usize] {
            continue;
        }
        let stamp = seeds.len() as u32;
        seeds.push(v);
        covered[v as usize] = true;
        visited[v as usize] = stamp;
        queue.push_back((v, 0, 0.0));
        while let Some((u, hop, at)) = queue.pop_front() {
            if hop as usize == hops {
                continue;
            }
            let edges = fine.edges(u as usize);
            if edges.len() > LARGE_FAN {
                monitor.checkpoint()?;
                // Whoever came here closer has covered what can be covered from here: else a hub would be gone through
                // for each seed around it.
                let closest = hubs.entry(u).or_insert((u32::MAX, f32::INFINITY));
                if closest.0 <= hop && closest.1 <= at {
                    continue;
                }
                *closest = (hop, at);
            }
            for edge in edges {
                let w = fine.neighbours[edge];
                let there = at + fine.lengths[edge];
                if visited[w as usize] != stamp && there <= reach {
                    visited[w as usize] = stamp;
                    covered[w as usize] = true;
                    queue.push_back((w, hop + 1, there));
                }
            }
        }
    }
    Ok(seeds)
}

/// The nearest seed of every vertex along edges and how far it is. No seed is farther than `hops` edges; paths of one
/// more are tried. Each round looks at the distances of the one before only, so the order of vertices does not matter.
fn voronoi(
    fine: &HeatLevel,
    seeds: &[u32],
    hops: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<u32>, Vec<f32>), Cancelled> {
    let n = fine.vertices();
    let mut nearest = vec![(f32::INFINITY, u32::MAX); n];
    for (cell, &seed) in seeds.iter().enumerate() {
        nearest[seed as usize] = (0.0, cell as u32);
    }
    for _ in 0..=hops {
        monitor.checkpoint()?;
        nearest = (0..n)
            .into_par_iter()
            .with_min_len(4096)
            .map(|v| {
                let mut best = nearest[v];
                if best.0 == 0.0 {
                    return best;
                }
                for edge in fine.edges(v) {
                    let (at, cell) = nearest[fine.neighbours[edge] as usize];
                    let there = at + fine.lengths[edge];
                    if there < best.0 || (there == best.0 && cell < best.1) {
                        best = (there, cell);
                    }
                }
                best
            })
            .collect();
    }
    Ok(nearest.into_iter().map(|(at, cell)| (cell, at)).unzip())
}

/// The coarse level.
fn condense(
    fine: &HeatLevel,
    coarse: Surface,
    fans: &Fans,
    cells: &[u32],
    distances: &[f32],
    monitor: &dyn Monitor,
) -> Result<HeatLevel, Cancelled> {
    let (n, count) = (fine.vertices(), coarse.positions.len());
    let mut begins = vec![0u32; count + 1];
    for &cell in cells {
        begins[cell as usize + 1] += 1;
    }
    for cell in 0..count {
        begins[cell + 1] += begins[cell];
    }
    let mut next = begins.clone();
    let mut members = vec![0u32; n];
    for (v, &cell) in cells.iter().enumerate() {
        members[next[cell as usize] as usize] = v as u32;
        next[cell as usize] += 1;
    }
    let cells_per_chunk = 2048;
    let chunks: Vec<HeatLevel> = (0..count.div_ceil(cells_per_chunk))
        .into_par_iter()
        .map(|chunk| {
            monitor.checkpoint()?;
            let range = chunk * cells_per_chunk..((chunk + 1) * cells_per_chunk).min(count);
            let mut level = HeatLevel::empty();
            let (mut row, mut touching, mut entries): (Vec<Link>, Vec<Link>, usize) = (Vec::new(), Vec::new(), 0);
            for cell in range {
                row.clear();
                for &t in fans.around(cell as u32) {
                    add_triangle(cell as u32, coarse, coarse.triangles[t as usize], &mut row);
                }
                merge(&mut row, |_, _| {});
                let triangulated = row.len();
                let mut mass = 0.0;
                for &v in &members[begins[cell] as usize..begins[cell + 1] as usize] {
                    mass += fine.mass[v as usize];
                    for edge in fine.edges(v as usize) {
                        let w = fine.neighbours[edge] as usize;
                        let length = fine.lengths[edge];
                        let other = cells[w];
                        let known = || row[..triangulated].binary_search_by_key(&other, |link| link.other).is_ok();
                        if other as usize == cell || !length.is_finite() || known() {
                            continue;
                        }
                        let path = distances[v as usize] + length + distances[w];
                        let share = if path > 0.0 { length / path } else { 1.0 };
                        let weight = f64::from((STRAIGHTENING * fine.weights[edge] * share).max(0.0));
                        touching.push(Link { other, weight, length: path });
                    }
                }
                merge(&mut touching, |sum, link| sum.length = sum.length.min(link.length));
                row.append(&mut touching);
                row.sort_unstable_by_key(|link| link.other);
                entries += row.len() + members.len().div_ceil(count);
                if entries >= 1 << 14 {
                    entries = 0;
                    monitor.checkpoint()?;
                }
                let mut diagonal = 0.0;
                for link in &row {
                    diagonal += link.weight;
                    level.neighbours.push(link.other);
                    level.weights.push(link.weight as f32);
                    level.lengths.push(link.length);
                }
                level.offsets.push(level.neighbours.len() as u32);
                level.diagonal.push(diagonal as f32);
                level.mass.push(mass);
            }
            Ok(level)
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(HeatLevel::concatenate(chunks))
}

/// An entry of a row under construction.
struct Link {
    other: u32,
    weight: f64,
    length: f32,
}

/// Adds up the weights of links to one cell, in the order in which they came; `more` joins the rest. Looking each of
/// them up would be quadratic in the valence of a cell.
fn merge(row: &mut Vec<Link>, more: impl Fn(&mut Link, &Link)) {
    row.sort_by_key(|link| link.other);
    row.dedup_by(|later, sum| {
        let same = later.other == sum.other;
        if same {
            sum.weight += later.weight;
            more(sum, later);
        }
        same
    });
}

/// The least area of a triangle, as a share of its longest edge squared. A flatter one acts with this area, so that its
/// weights stay below 25.
const LEAST_AREA: f64 = 0.01;

/// The weights of a linear element, `−e_i · e_j / 4A` for the two edges at each corner: weight `k` belongs to the edge
/// opposite corner `k`.
///
/// One area serves all three, at least [`LEAST_AREA`] of the longest edge squared, so the element matrix is
/// `E Eᵀ / 4A`, `E` the three edges: semi-definite whatever the triangle. Three cotangents that are rounded or cut off
/// one by one are not: heat steps amplify then.
pub(super) fn element_weights(corners: [[f32; 3]; 3]) -> [f64; 3] {
    let [p, q, r] = corners.map(|corner| Vector3(corner.map(f64::from)));
    let edges = [r - q, p - r, q - p];
    let longest = edges.into_iter().map(Vector3::norm_squared).fold(0.0, f64::max);
    if !(longest > 0.0) {
        return [0.0; 3];
    }
    let (uu, uv, vv) = (edges[0].norm_squared(), edges[0].dot(edges[1]), edges[1].norm_squared());
    let area = (0.5 * (uu * vv - uv * uv).max(0.0).sqrt()).max(LEAST_AREA * longest);
    std::array::from_fn(|k| -edges[(k + 1) % 3].dot(edges[(k + 2) % 3]) / (4.0 * area))
}

/// Appends the linear element's weights to the row of `cell`, one of the corners.
fn add_triangle(cell: u32, coarse: Surface, triangle: [u32; 3], row: &mut Vec<Link>) {
    let corners = triangle.map(|v| coarse.positions[v as usize]);
    let weights = element_weights(corners);
    for k in 0..3 {
        let (one, other) = (triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
        let other = if one == cell {
            other
        } else if other == cell {
            one
        } else {
            continue;
        };
        let edge = minus(corners[(k + 1) % 3], corners[(k + 2) % 3]);
        row.push(Link { other, weight: weights[k], length: dot(edge, edge).sqrt() });
    }
}
