//! The Laplace–Beltrami operator: cotangent stiffness and the three masses of piecewise linear functions.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, weak form; strong form `M⁻¹S` |
//! | definiteness | `S` positive semi-definite, its kernel the functions constant on each component; `M` positive definite |
//! | units | `S` none; `M` area, scaled here so that it sums to 1; eigenvalues 1/length² |
//! | boundary | natural (Neumann) |
//! | valid for | any triangles, manifold or not; orientation does not matter |
//! | source | Pinkall and Polthier 1993; Meyer et al. 2003 for the Voronoi mass |

use rayon::prelude::*;

use super::{EigenProblem, MassKind, MassMatrix, OperatorError};
use crate::algebra::SparseMatrix;
use crate::mesh::TriangleMesh;

/// The mass of a vertex that no face with an area touches, as a multiple of the mean mass.
///
/// Nothing acts on such a vertex, neither stiffness nor mass, and a zero on the diagonal would make the mass singular. So small a
/// mass keeps it definite, changes no other eigenpair, and lets the vertex take whatever value a subspace gives it.
pub const MASSLESS: f64 = 1e-12;

/// Rows that one task assembles. Fixed, so that results do not depend on the number of threads.
const ROWS_PER_TASK: usize = 4096;

/// Up to this many faces around a vertex its neighbours are found by looking through a list; beyond it they are sorted.
const SHORT_RING: usize = 16;

/// What assembly came across.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AssemblyReport {
    /// Faces whose area cannot be told from zero; they contributed nothing.
    pub zero_area_faces: usize,
    /// Vertices without any face that has an area; they were given [`MASSLESS`].
    pub massless_vertices: usize,
}

/// Assembles stiffness and mass on the mesh scaled to unit area.
///
/// Cotangents come from dot and cross products; no angle is formed. The result does not depend on the number of threads, and `S` is
/// symmetric to the last bit.
///
/// # Errors
/// [`OperatorError`] names a corner out of range or a coordinate that is not finite, or says that the mesh has no area.
pub fn assemble(mesh: &TriangleMesh, mass: MassKind) -> Result<EigenProblem, OperatorError> {
    assemble_with_report(mesh, mass).map(|(problem, _)| problem)
}

/// [`assemble`], and what it came across.
///
/// # Errors
/// As [`assemble`].
pub fn assemble_with_report(
    mesh: &TriangleMesh,
    mass: MassKind,
) -> Result<(EigenProblem, AssemblyReport), OperatorError> {
    let n = mesh.positions.len();
    let scale = power_of_two_scale(&mesh.positions)?;
    let corners = corners_around(mesh)?;
    let (shapes, area, zero_area_faces) = face_shapes(mesh, scale);
    if !(area.is_finite() && area > 0.0) {
        return Err(OperatorError::NoArea);
    }
    let blocks: Vec<Block> = (0..n.div_ceil(ROWS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let rows = task * ROWS_PER_TASK..n.min((task + 1) * ROWS_PER_TASK);
            assemble_rows(mesh, &corners, &shapes, area, mass, rows)
        })
        .collect();
    let massless_vertices = blocks.iter().map(|b| b.massless).sum();
    let (stiffness, mass) = join(n, &blocks, mass);
    let problem = EigenProblem { stiffness, mass, area: area / scale / scale, unknowns: None };
    Ok((problem, AssemblyReport { zero_area_faces, massless_vertices }))
}

/// The power of two that brings the largest extent of the bounding box near 1, so that products neither overflow nor underflow.
fn power_of_two_scale(positions: &[[f64; 3]]) -> Result<f64, OperatorError> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut finite = true;
    for p in positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
            finite &= p[k].is_finite();
        }
    }
    if !finite {
        let vertex = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())).unwrap_or(0);
        return Err(OperatorError::NotFinite { vertex });
    }
    let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    // Outside this range the scale or its inverse would not be a normal number.
    if extent > 1e-150 && extent < 1e150 { Ok((-extent.log2().round()).exp2()) } else { Err(OperatorError::NoArea) }
}

/// For each vertex the corners `3·face + k` that lie on it, ascending.
struct Corners {
    offsets: Vec<u32>,
    corners: Vec<u32>,
}

fn corners_around(mesh: &TriangleMesh) -> Result<Corners, OperatorError> {
    let n = mesh.positions.len();
    if u32::try_from(mesh.faces.len().saturating_mul(3)).is_err() {
        return Err(OperatorError::TooManyFaces { faces: mesh.faces.len() });
    }
    // Counts are kept one place late, so that the running positions below end as the offsets.
    let mut offsets = vec![0u32; n + 2];
    for (face, corners) in mesh.faces.iter().enumerate() {
        for &vertex in corners {
            if vertex as usize >= n {
                return Err(OperatorError::VertexOutOfRange { face, vertex, vertices: n });
            }
            offsets[vertex as usize + 2] += 1;
        }
    }
    for v in 2..n + 2 {
        offsets[v] += offsets[v - 1];
    }
    let mut corners = vec![0u32; 3 * mesh.faces.len()];
    for (corner, &vertex) in mesh.faces.as_flattened().iter().enumerate() {
        let next = &mut offsets[vertex as usize + 1];
        corners[*next as usize] = corner as u32;
        *next += 1;
    }
    offsets.pop();
    Ok(Corners { offsets, corners })
}

/// Half cotangents of a face's three angles and its area, on the mesh scaled by a power of two; zeros where it has no area.
#[derive(Clone, Copy, Default)]
struct FaceShape {
    half_cotangents: [f64; 3],
    area: f64,
}

fn face_shapes(mesh: &TriangleMesh, scale: f64) -> (Vec<FaceShape>, f64, usize) {
    const FACES_PER_TASK: usize = 8192;
    let mut shapes = vec![FaceShape::default(); mesh.faces.len()];
    let sums: Vec<(f64, usize)> = shapes
        .par_chunks_mut(FACES_PER_TASK)
        .zip(mesh.faces.par_chunks(FACES_PER_TASK))
        .map(|(shapes, faces)| {
            let (mut area, mut degenerate) = (0.0, 0);
            for (shape, face) in shapes.iter_mut().zip(faces) {
                *shape = face_shape(face.map(|v| mesh.positions[v as usize].map(|c| c * scale)));
                area += shape.area;
                degenerate += usize::from(shape.area == 0.0);
            }
            (area, degenerate)
        })
        .collect();
    let (area, degenerate) = sums.iter().fold((0.0, 0), |(a, d), &(area, degenerate)| (a + area, d + degenerate));
    (shapes, area, degenerate)
}

fn face_shape(p: [[f64; 3]; 3]) -> FaceShape {
    let between = |a: [f64; 3], b: [f64; 3]| [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    // Edge k is opposite to corner k.
    let e = [between(p[1], p[2]), between(p[2], p[0]), between(p[0], p[1])];
    let (a, b) = (e[1], e[2]);
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let doubled = dot(cross, cross).sqrt();
    let longest = dot(e[0], e[0]).max(dot(a, a)).max(dot(b, b));
    // The cross product carries rounding errors of this size: below it there is no area to speak of.
    if doubled <= 4.0 * f64::EPSILON * longest {
        return FaceShape::default();
    }
    let half_inverse = 0.5 / doubled;
    FaceShape {
        half_cotangents: [
            -dot(e[1], e[2]) * half_inverse,
            -dot(e[2], e[0]) * half_inverse,
            -dot(e[0], e[1]) * half_inverse,
        ],
        area: 0.5 * doubled,
    }
}

/// The part of a mixed Voronoi cell that lies in a face (Meyer et al. 2003, section 3.3), for corner `k`.
fn voronoi_part(shape: &FaceShape, k: usize) -> f64 {
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
    mesh: &TriangleMesh,
    corners: &Corners,
    shapes: &[FaceShape],
    area: f64,
    kind: MassKind,
    rows: std::ops::Range<usize>,
) -> Block {
    let most = rows.len() + 2 * (corners.offsets[rows.end] - corners.offsets[rows.start]) as usize;
    let mut block = Block {
        lengths: Vec::with_capacity(rows.len()),
        indices: Vec::with_capacity(most),
        stiffness: Vec::with_capacity(most),
        mass: Vec::with_capacity(if kind == MassKind::Consistent { most } else { rows.len() }),
        massless: 0,
    };
    let massless = MASSLESS / mesh.positions.len() as f64;
    let per_area = 1.0 / area;
    let mut ring: Vec<Entry> = Vec::new();
    for v in rows {
        let around = &corners.corners[corners.offsets[v] as usize..corners.offsets[v + 1] as usize];
        ring.clear();
        let mut mass = 0.0;
        for &corner in around {
            let (face, k) = ((corner / 3) as usize, (corner % 3) as usize);
            let shape = &shapes[face];
            if shape.area == 0.0 {
                continue;
            }
            mass += match kind {
                MassKind::Consistent => shape.area / 6.0,
                MassKind::Barycentric => shape.area / 3.0,
                MassKind::Voronoi => voronoi_part(shape, k),
            };
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let off_diagonal = shape.area / 12.0;
            for (column, weight) in
                [(mesh.faces[face][i], shape.half_cotangents[j]), (mesh.faces[face][j], shape.half_cotangents[i])]
            {
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
fn join(n: usize, blocks: &[Block], kind: MassKind) -> (SparseMatrix, MassMatrix) {
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
        MassMatrix::Sparse(SparseMatrix::from_sorted_parts(n, n, offsets.clone(), indices.clone(), mass))
    } else {
        MassMatrix::Diagonal(mass)
    };
    (SparseMatrix::from_sorted_parts(n, n, offsets, indices, stiffness), mass)
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

#[cfg(test)]
#[path = "laplace_tests.rs"]
mod tests;
