//! Stiffness and masses of piecewise linear functions, from the shapes of triangles alone.
//!
//! The triangles may be those of a mesh, or those of an intrinsic triangulation, where a triangle may meet a vertex
//! more than once.

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;
use chladni_mesh::intrinsic::TriangleShape;

use super::corners::Corners;
use super::{MassKind, MassMatrix};

/// The mass of a vertex that no face with an area touches, as a multiple of the mean mass.
///
/// Nothing acts on such a vertex, neither stiffness nor mass, and a zero on the diagonal would make the mass singular.
/// So small a mass keeps it definite, changes no other eigenpair, and lets the vertex take whatever value a subspace
/// gives it.
pub const MASSLESS: f64 = 1e-12;

/// Rows that one task assembles. Fixed, so that results do not depend on the number of threads.
const ROWS_PER_TASK: usize = 4096;

/// Up to this many faces around a vertex its neighbours are found by looking through a list; beyond it they are sorted.
/// Points have each of some six triangles three times.
const SHORT_RING: usize = 48;

/// Entries that a row is given room for beforehand. There are at most two for each corner and one, and half of that on
/// a surface, a sixth of it at points: room that is not needed has to be cleared all the same.
const ENTRIES_OF_ROW: usize = 8;

/// Triangles that cover a surface so many times.
pub(super) struct Triangles<'a> {
    /// The vertices, `n`.
    pub vertices: usize,
    /// The vertices whose rows are made, ascending, where these are not all.
    pub rows: Option<&'a [u32]>,
    /// The corners of each triangle.
    pub faces: &'a [[u32; 3]],
    /// The shape of each triangle.
    pub shapes: &'a [TriangleShape],
    /// How often each point of the surface is covered.
    pub sheets: f64,
}

/// Stiffness and mass of triangles.
pub(super) struct Assembled {
    pub stiffness: SparseMatrix,
    /// Scaled so that its entries sum to 1.
    pub mass: MassMatrix,
    pub massless_vertices: usize,
}

/// Adds up stiffness and mass, row by row; `area` is that of all triangles, and `corners` are those on the vertices of
/// the rows. The result does not depend on the number of threads, and the stiffness is symmetric to the last bit.
pub(super) fn assemble(triangles: &Triangles<'_>, corners: &Corners, area: f64, mass: MassKind) -> Assembled {
    let n = triangles.rows.map_or(triangles.vertices, <[u32]>::len);
    let blocks: Vec<Block> = (0..n.div_ceil(ROWS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let rows = task * ROWS_PER_TASK..n.min((task + 1) * ROWS_PER_TASK);
            assemble_rows(triangles, corners, area, mass, rows)
        })
        .collect();
    let massless_vertices = blocks.iter().map(|b| b.massless).sum();
    let (stiffness, mass) = join(n, triangles.vertices, &blocks, mass);
    Assembled { stiffness, mass, massless_vertices }
}

/// The part of a mixed Voronoi cell that lies in a face (Meyer et al. 2003, section 3.3), for corner `k`.
pub(super) fn voronoi_part(shape: &TriangleShape, k: usize) -> f64 {
    let h = shape.half_cotangents;
    if let Some(obtuse) = h.iter().position(|&c| c < 0.0) {
        return shape.area * if obtuse == k { 0.5 } else { 0.25 };
    }
    // |e_j|² = 2A (cot θ_k + cot θ_i), the two angles that edge j lies between.
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let squared = |a: usize, b: usize| 4.0 * shape.area * (h[a] + h[b]);
    0.25 * (squared(k, i) * h[j] + squared(k, j) * h[i])
}

/// Some consecutive rows of stiffness and mass.
struct Block {
    lengths: Vec<u32>,
    indices: Vec<u32>,
    stiffness: Vec<f64>,
    /// One value a row for a lumped mass, one an entry for the consistent mass.
    mass: Vec<f64>,
    massless: usize,
}

/// One entry of a row while it is being gathered: column, stiffness, consistent mass.
type Entry = (u32, f64, f64);

fn assemble_rows(
    triangles: &Triangles<'_>,
    corners: &Corners,
    area: f64,
    kind: MassKind,
    rows: std::ops::Range<usize>,
) -> Block {
    let most = (rows.len() + 2 * corners.count(&rows)).min(ENTRIES_OF_ROW * rows.len());
    let mut block = Block {
        lengths: Vec::with_capacity(rows.len()),
        indices: Vec::with_capacity(most),
        stiffness: Vec::with_capacity(most),
        mass: Vec::with_capacity(if kind == MassKind::Consistent { most } else { rows.len() }),
        massless: 0,
    };
    let massless = MASSLESS / triangles.vertices as f64;
    let (per_area, per_sheet) = (1.0 / area, 1.0 / triangles.sheets);
    let mut ring: Vec<Entry> = Vec::new();
    for row in rows {
        let around = corners.on(row);
        let v = triangles.rows.map_or(row, |rows| rows[row] as usize);
        ring.clear();
        let mut mass = 0.0;
        for &corner in around {
            let (face, k) = ((corner / 3) as usize, (corner % 3) as usize);
            let shape = &triangles.shapes[face];
            if shape.area == 0.0 {
                continue;
            }
            mass += match kind {
                MassKind::Consistent => shape.area / 6.0,
                MassKind::Barycentric => shape.area / 3.0,
                MassKind::Voronoi => voronoi_part(shape, k),
            };
            // Ascending, so that where a triangle meets a vertex twice, both rows of an entry add its parts in one
            // order.
            let (i, j) = [(1, 2), (0, 2), (0, 1)][k];
            let off_diagonal = shape.area / 12.0;
            for (other, opposite) in [(i, j), (j, i)] {
                let column = triangles.faces[face][other];
                if column as usize == v {
                    // A function does not vary along an edge from a vertex to itself.
                    if kind == MassKind::Consistent {
                        mass += off_diagonal;
                    }
                    continue;
                }
                let weight = per_sheet * shape.half_cotangents[opposite];
                match ring.iter_mut().find(|entry| around.len() <= SHORT_RING && entry.0 == column) {
                    Some(entry) => {
                        entry.1 -= weight;
                        entry.2 += off_diagonal;
                    }
                    None => ring.push((column, -weight, off_diagonal)),
                }
            }
        }
        if around.len() <= SHORT_RING {
            insertion_sort(&mut ring);
        } else {
            // Stable, so that the parts of an entry are added in the order of the faces, as above.
            ring.sort_by_key(|entry| entry.0);
            ring.dedup_by(|later, kept| {
                let same = later.0 == kept.0;
                if same {
                    kept.1 += later.1;
                    kept.2 += later.2;
                }
                same
            });
        }
        let diagonal = -ring.iter().map(|entry| entry.1).sum::<f64>();
        let mut own = mass * per_area;
        if own <= 0.0 {
            own = massless;
            block.massless += 1;
        }
        if kind != MassKind::Consistent {
            block.mass.push(own);
        }
        let mut push = |column: u32, stiffness: f64, mass: f64| {
            block.indices.push(column);
            block.stiffness.push(stiffness);
            if kind == MassKind::Consistent {
                block.mass.push(mass);
            }
        };
        let below = ring.partition_point(|entry| (entry.0 as usize) < v);
        for &(column, stiffness, mass) in &ring[..below] {
            push(column, stiffness, mass * per_area);
        }
        push(v as u32, diagonal, own);
        for &(column, stiffness, mass) in &ring[below..] {
            push(column, stiffness, mass * per_area);
        }
        block.lengths.push(ring.len() as u32 + 1);
    }
    block
}

fn insertion_sort(ring: &mut [Entry]) {
    for end in 1..ring.len() {
        let entry = ring[end];
        let mut at = end;
        while at > 0 && ring[at - 1].0 > entry.0 {
            ring[at] = ring[at - 1];
            at -= 1;
        }
        ring[at] = entry;
    }
}

/// Puts the blocks of rows one after the other.
fn join(n: usize, columns: usize, blocks: &[Block], kind: MassKind) -> (SparseMatrix, MassMatrix) {
    let mut offsets = Vec::with_capacity(n + 1);
    offsets.push(0usize);
    for block in blocks {
        for &length in &block.lengths {
            offsets.push(offsets.last().copied().unwrap_or(0) + length as usize);
        }
    }
    let indices = concatenate(blocks, |b| &b.indices);
    let stiffness = concatenate(blocks, |b| &b.stiffness);
    let mass = concatenate(blocks, |b| &b.mass);
    let mass = if kind == MassKind::Consistent {
        MassMatrix::Sparse(SparseMatrix::from_sorted_parts(n, columns, offsets.clone(), indices.clone(), mass))
    } else {
        MassMatrix::Diagonal(mass)
    };
    (SparseMatrix::from_sorted_parts(n, columns, offsets, indices, stiffness), mass)
}

fn concatenate<T: Copy + Default + Send + Sync>(blocks: &[Block], part: impl Fn(&Block) -> &Vec<T> + Sync) -> Vec<T> {
    let mut all = vec![T::default(); blocks.iter().map(|b| part(b).len()).sum()];
    let mut rest = &mut all[..];
    let mut targets = Vec::with_capacity(blocks.len());
    for block in blocks {
        let (target, after) = rest.split_at_mut(part(block).len());
        targets.push(target);
        rest = after;
    }
    targets.into_par_iter().zip(blocks).for_each(|(target, block)| target.copy_from_slice(part(block)));
    all
}
