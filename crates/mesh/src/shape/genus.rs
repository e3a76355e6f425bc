//! A chain of smoothly joined rings: the zero set of a distance-like function, extracted by surface nets (Gibson 1998).

use super::{TORUS_MAJOR_RADIUS, TORUS_MINOR_RADIUS};
use crate::TriangleMesh;
use crate::topology::{EdgeTable, Topology};
use chladni_base::Vector3;
use chladni_base::parallel::*;

/// How far apart two surfaces are where they begin to blend.
const BLEND: f64 = 0.35;
/// The area of the surface, for each ring, roughly.
const AREA: f64 = 13.5;
/// Vertices of surface nets in a square of one cell, averaged over directions of the surface; roughly.
const VERTICES_PER_CELL: f64 = 1.5;
/// Cells along the side of a block; blocks away from the surface are skipped whole.
const BLOCK: usize = 8;
/// Rounds of smoothing before and after quadrilaterals are cut in two.
const ROUNDS: [usize; 2] = [6, 6];
/// How many grids are tried for a number of vertices.
const ATTEMPTS: u32 = 24;
/// Shifts between attempts, as fractions of a cell, that fill the unit interval evenly.
const GOLDEN_SHIFT: f64 = 0.618_033_988_749_895;

/// A surface of genus `genus ≥ 1` with about `vertices` vertices, or `None` where so few give no manifold of that
/// genus.
pub(super) fn chain(genus: u32, vertices: usize) -> Option<TriangleMesh> {
    let rings = Rings { count: genus };
    // The number of vertices follows the cell size as 1/h², but for noise of some percent on coarse grids. Coarse
    // attempts find the constant; more of them, each on a grid shifted otherwise, come near the number.
    let coarse = vertices.min(20_000.max(1000 * genus as usize));
    let mut constant = f64::from(genus) * AREA * VERTICES_PER_CELL;
    let mut goal = coarse;
    let mut best: Option<(usize, TriangleMesh)> = None;
    for attempt in 0..ATTEMPTS {
        let cell = (constant / goal as f64).sqrt();
        let net = Net::new(&rings, cell, (GOLDEN_SHIFT * f64::from(attempt)).fract());
        let miss = net.positions.len().abs_diff(vertices);
        let weight = 1.0 / f64::from(attempt / 2 + 1);
        constant += weight * (net.positions.len() as f64 * cell * cell - constant);
        if goal < vertices {
            goal = vertices;
            continue;
        }
        if best.as_ref().is_none_or(|best| miss < best.0)
            && let Some(mesh) = finish(&rings, net)
        {
            best = Some((miss, mesh));
        }
        if best.as_ref().is_some_and(|best| best.0 * 200 <= vertices) {
            break;
        }
    }
    best.map(|(_, mesh)| mesh)
}

/// Smooths a net, cuts it into triangles, and hands it out if it is what it should be.
fn finish(rings: &Rings, net: Net) -> Option<TriangleMesh> {
    let Net { mut positions, quads } = net;
    project(rings, &mut positions);
    for _ in 0..ROUNDS[0] {
        smooth(rings, &mut positions, &quads);
    }
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|&quad| cut(&positions, quad)).collect();
    let topology = Topology::new(&EdgeTable::new(positions.len(), &faces), &faces);
    let characteristic = positions.len() as i64 - topology.edges as i64 + faces.len() as i64;
    let right = topology.non_manifold_edges.count == 0
        && topology.non_manifold_vertices.count == 0
        && topology.boundary_edges == 0
        && topology.components == 1
        && characteristic == 2 - 2 * i64::from(rings.count);
    for _ in 0..ROUNDS[1] {
        smooth(rings, &mut positions, &faces);
    }
    right.then_some(TriangleMesh { positions, faces, ..Default::default() })
}

/// Rings side by side along x, touching, blended where they meet.
struct Rings {
    count: u32,
}

impl Rings {
    /// A function that is negative inside and changes no faster than distance, and its gradient.
    fn value(&self, p: [f64; 3]) -> (f64, Vector3) {
        let spacing = 2.0 * TORUS_MAJOR_RADIUS;
        let last = f64::from(self.count - 1);
        let nearest = (p[0] / spacing + last / 2.0).round().clamp(0.0, last);
        // Of the others, none but its two neighbours is ever near enough to blend with the nearest.
        let ring = |i: f64| ring([p[0] - (i - last / 2.0) * spacing, p[1], p[2]]);
        let mut value = ring(nearest);
        for other in [nearest - 1.0, nearest + 1.0] {
            if (0.0..=last).contains(&other) {
                value = union(value, ring(other));
            }
        }
        value
    }
}

/// The distance to a torus around the z axis and its gradient.
fn ring([x, y, z]: [f64; 3]) -> (f64, Vector3) {
    let around = (x * x + y * y).sqrt().max(1e-12);
    let out = around - TORUS_MAJOR_RADIUS;
    let distance = (out * out + z * z).sqrt().max(1e-12);
    let gradient = Vector3::new(out / distance * x / around, out / distance * y / around, z / distance);
    (distance - TORUS_MINOR_RADIUS, gradient)
}

/// The union of two solids, rounded with continuous curvature where they meet (Quilez's cubic smooth minimum).
fn union(a: (f64, Vector3), b: (f64, Vector3)) -> (f64, Vector3) {
    let (near, far) = if a.0 < b.0 { (a, b) } else { (b, a) };
    let overlap = ((BLEND - (far.0 - near.0)) / BLEND).max(0.0);
    let share = overlap * overlap / 2.0;
    let gradient = near.1 + share * (far.1 - near.1);
    (near.0 - overlap.powi(3) * BLEND / 6.0, gradient)
}

/// Moves positions near the surface onto it.
fn project(rings: &Rings, positions: &mut [[f64; 3]]) {
    positions.par_iter_mut().with_min_len(1 << 12).for_each(|p| {
        for _ in 0..3 {
            let (value, gradient) = rings.value(*p);
            let square = gradient.norm_squared();
            *p = (Vector3(*p) - value * gradient / square.max(1e-3)).into();
        }
    });
}

/// Moves every vertex of a closed mesh along the surface towards the mean of its neighbours.
fn smooth<const CORNERS: usize>(rings: &Rings, positions: &mut Vec<[f64; 3]>, faces: &[[u32; CORNERS]]) {
    // On a closed mesh each neighbour is met as often as every other: twice.
    let mut sums = vec![[0.0; 4]; positions.len()];
    for face in faces {
        for c in 0..CORNERS {
            let (v, w) = (face[c] as usize, face[(c + 1) % CORNERS] as usize);
            for x in 0..3 {
                sums[v][x] += positions[w][x];
                sums[w][x] += positions[v][x];
            }
            sums[v][3] += 1.0;
            sums[w][3] += 1.0;
        }
    }
    positions.par_iter_mut().zip(&sums).with_min_len(1 << 12).for_each(|(p, sum)| {
        let (_, gradient) = rings.value(*p);
        let square = gradient.norm_squared();
        let (at, [x, y, z, count]) = (Vector3(*p), *sum);
        let pull = 0.6 * (Vector3::new(x, y, z) / count.max(1.0) - at);
        let off = pull.dot(gradient) / square.max(1e-3);
        *p = (at + pull - off * gradient).into();
    });
    project(rings, positions);
}

/// Two triangles for a quadrilateral, cut along the shorter diagonal.
fn cut(positions: &[[f64; 3]], [a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    let square = |v: u32, w: u32| (Vector3(positions[v as usize]) - Vector3(positions[w as usize])).norm_squared();
    if square(a, c) <= square(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// A quadrilateral mesh: a vertex for every cell that the surface passes through, a face for every edge it crosses.
#[derive(Default)]
struct Net {
    positions: Vec<[f64; 3]>,
    quads: Vec<[u32; 4]>,
}

/// The vertices of one block: for each of its cells a number within the block, or `NONE`.
struct BlockCells {
    block: usize,
    cells: Vec<u16>,
    positions: Vec<[f64; 3]>,
    /// Edges that begin at the lower corner of a cell of the block and cross the surface: cell, axis, whether it leaves
    /// the solid.
    crossings: Vec<([u16; 3], u8, bool)>,
}

const NONE: u16 = u16::MAX;

impl Net {
    /// Extracts the surface on a grid of the given cell size, shifted by a fraction of a cell.
    fn new(rings: &Rings, cell: f64, shift: f64) -> Self {
        let reach = TORUS_MAJOR_RADIUS + TORUS_MINOR_RADIUS + 0.1;
        let half = [f64::from(rings.count - 1) * TORUS_MAJOR_RADIUS + reach, reach, TORUS_MINOR_RADIUS + 0.1];
        // A cell of air all around; unequal shifts keep the symmetry planes of the surface off the grid.
        let shifts = [0.37, 0.61, 0.83].map(|s| (s + shift).fract());
        let origin: [f64; 3] = std::array::from_fn(|x| -half[x] - (1.0 + shifts[x]) * cell);
        let blocks = half.map(|h| ((2.0 * h / cell + 4.0) / BLOCK as f64).ceil() as usize);
        let total = blocks[0] * blocks[1] * blocks[2];
        let place = |block: usize| {
            [block % blocks[0], block / blocks[0] % blocks[1], block / blocks[0] / blocks[1]].map(|b| b * BLOCK)
        };

        let found: Vec<BlockCells> = (0..total)
            .into_par_iter()
            .with_min_len(16)
            .filter_map(|block| {
                let base = place(block);
                let middle = std::array::from_fn(|x| origin[x] + (base[x] as f64 + BLOCK as f64 / 2.0) * cell);
                let radius = cell * BLOCK as f64 * 0.5 * 3f64.sqrt();
                (rings.value(middle).0.abs() <= 1.001 * radius)
                    .then(|| BlockCells::new(rings, block, base, origin, cell))
                    .filter(|cells| !cells.positions.is_empty())
            })
            .collect();

        let mut index_of = vec![u32::MAX; total];
        let mut offsets = Vec::with_capacity(found.len());
        let mut count = 0u32;
        for (index, cells) in found.iter().enumerate() {
            index_of[cells.block] = index as u32;
            offsets.push(count);
            count += cells.positions.len() as u32;
        }
        let number = |at: [usize; 3]| -> Option<u32> {
            let [b, c] = [at.map(|x| x / BLOCK), at.map(|x| x % BLOCK)];
            let index = *index_of.get(b[0] + blocks[0] * (b[1] + blocks[1] * b[2]))? as usize;
            let local = *found.get(index)?.cells.get(c[0] + BLOCK * (c[1] + BLOCK * c[2]))?;
            (local != NONE).then(|| offsets[index] + u32::from(local))
        };
        let quads = found.par_iter().map(|cells| {
            let base = place(cells.block);
            let quads = cells.crossings.iter().filter_map(|&(corner, axis, leaves)| {
                let at: [usize; 3] = std::array::from_fn(|x| base[x] + usize::from(corner[x]));
                // The four cells around the edge, counter-clockwise as seen from its far end.
                let (u, v) = ((usize::from(axis) + 1) % 3, (usize::from(axis) + 2) % 3);
                let around = |du: usize, dv: usize| {
                    let mut beside = at;
                    beside[u] = beside[u].checked_sub(du)?;
                    beside[v] = beside[v].checked_sub(dv)?;
                    number(beside)
                };
                let quad = [around(1, 1)?, around(0, 1)?, around(0, 0)?, around(1, 0)?];
                Some(if leaves { quad } else { [quad[3], quad[2], quad[1], quad[0]] })
            });
            quads.collect::<Vec<_>>()
        });
        let quads = quads.collect::<Vec<_>>().concat();
        let positions = found.into_iter().flat_map(|cells| cells.positions).collect();
        Self { positions, quads }
    }
}

impl BlockCells {
    fn new(rings: &Rings, block: usize, base: [usize; 3], origin: [f64; 3], cell: f64) -> Self {
        const SIDE: usize = BLOCK + 1;
        let point = |i: usize| [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        let at = |corner: [usize; 3]| std::array::from_fn(|x| origin[x] + (base[x] + corner[x]) as f64 * cell);
        let values: Vec<f64> = (0..SIDE * SIDE * SIDE).map(|i| rings.value(at(point(i))).0).collect();
        const STEP: [usize; 3] = [1, SIDE, SIDE * SIDE];
        let mut cells = vec![NONE; BLOCK * BLOCK * BLOCK];
        let (mut positions, mut crossings) = (Vec::new(), Vec::new());
        for (number, slot) in cells.iter_mut().enumerate() {
            let corner = [number % BLOCK, number / BLOCK % BLOCK, number / BLOCK / BLOCK];
            let first = corner[0] + SIDE * (corner[1] + SIDE * corner[2]);
            let inside = |i: usize| values[i] < 0.0;
            for (axis, step) in (0..).zip(STEP) {
                if inside(first) != inside(first + step) {
                    crossings.push((corner.map(|x| x as u16), axis, inside(first)));
                }
            }
            let (mut sum, mut crossed) = ([0.0; 3], 0.0);
            for axis in 0..3 {
                let (u, v) = (STEP[(axis + 1) % 3], STEP[(axis + 2) % 3]);
                for start in [first, first + u, first + v, first + u + v] {
                    let (low, high) = (values[start], values[start + STEP[axis]]);
                    if (low < 0.0) != (high < 0.0) {
                        let mut hit: [f64; 3] = at(point(start));
                        hit[axis] += cell * low / (low - high);
                        (0..3).for_each(|x| sum[x] += hit[x]);
                        crossed += 1.0;
                    }
                }
            }
            if crossed > 0.0 {
                *slot = positions.len() as u16;
                positions.push(sum.map(|x: f64| x / crossed));
            }
        }
        Self { block, cells, positions, crossings }
    }
}
