//! Directions of a cross field that go on from face to face, everywhere but across a cut.
//!
//! A tree of shortest paths joins the singular vertices and the boundaries; a tree of faces that crosses none of them
//! leaves the edges of handles beside (Eppstein 2003). Along the tree of faces the first direction of a face is the one
//! that the first of its parent goes on as. What hangs free among the edges that are not crossed is taken off again:
//! around an ordinary vertex with one edge left, directions go on across that too.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::f64::consts::{FRAC_PI_2, TAU};

use chladni_base::parallel::*;
use chladni_mesh::dual::NO_FACE;

use super::super::harmonic::rim;
use super::super::loops::{Sets, ends};
use super::super::singularity::{Matching, Singularity, least_angles};
use super::super::surface::FieldSurface;
use super::{KIND, QuadError};
use crate::operator::frames::{Planar, Turn, multiply, power};

/// A cross field on the surface cut open.
#[derive(Debug, Clone, PartialEq)]
pub struct Combed {
    /// One of the four directions of each face, of length 1 in its frame: inside the cut it goes on from face to face.
    pub directions: Vec<Planar>,
    /// For each edge, from its lower face to the upper one: direction `k` of four, counted counter-clockwise from the
    /// one with the least angle from 0 to 90 degrees in the frame, goes on as direction `k + matching`.
    pub matching: Vec<u8>,
    /// For each edge: the direction of the upper face is that of the lower one, turned by so many quarters; 0 but on
    /// the cut.
    pub jumps: Vec<u8>,
    /// Whether an edge is cut. What is left is, on each component, a disk or ends at the boundary, and no singular
    /// vertex lies inside.
    pub cut: Vec<bool>,
    /// The singular vertices.
    pub singularities: Vec<Singularity>,
}

/// What one task handles.
const PIECE: usize = 1 << 12;

/// Combs a cross field of representations, `2F` numbers of any length. `matching` has full turns of the representation
/// beyond the least angle.
///
/// # Errors
/// [`QuadError`]: a field of another size, or a face without a direction.
pub fn comb(surface: &FieldSurface, field: &[f32], matching: &[Matching]) -> Result<Combed, QuadError> {
    surface.dual().oriented()?;
    let faces = surface.faces();
    let Ok(mut angles) = least_angles(surface, KIND, field) else {
        return Err(QuadError::Field { found: field.len(), wanted: 2 * faces });
    };
    for matched in matching {
        if let Some(angle) = angles.get_mut(matched.edge as usize) {
            *angle += TAU * f64::from(matched.turns);
        }
    }
    let direction = |value: &[f32; 2]| {
        let [x, y] = value.map(f64::from);
        let sound = x.hypot(y) > 0.0 && x.is_finite() && y.is_finite();
        if sound { y.atan2(x).rem_euclid(TAU) / 4.0 } else { f64::NAN }
    };
    let first: Vec<f64> = field.as_chunks::<2>().0.par_iter().with_min_len(PIECE).map(direction).collect();
    if let Some(face) = first.iter().position(|angle| angle.is_nan()) {
        return Err(QuadError::NoDirection { face });
    }
    let matching = matched(surface, &first, &angles);
    let singularities = singular_vertices(surface, &angles, &matching);
    let mut singular = vec![false; surface.mesh().positions.len()];
    singularities.iter().for_each(|s| singular[s.vertex as usize] = true);
    let boundary = rim(surface);
    let paths = joined(surface, &singular, &boundary);
    let (turns, mut cut) = spanned(surface, &paths, &matching);
    prune(surface, &mut cut, |v| singular[v as usize] || boundary[v as usize]);
    let edge_faces = surface.dual().edge_faces();
    let jump = |(edge, &[low, high]): (usize, &[u32; 2])| match high {
        NO_FACE => 0,
        _ => (turns[high as usize] + 8 - turns[low as usize] - matching[edge]) % 4,
    };
    let jumps: Vec<u8> = edge_faces.iter().enumerate().map(jump).collect();
    let directions = first.par_iter().zip(&turns).with_min_len(PIECE).map(|(angle, &turn)| {
        let (sine, cosine) = angle.sin_cos();
        multiply([cosine, sine], power([0.0, 1.0], u32::from(turn)))
    });
    Ok(Combed { directions: directions.collect(), matching, jumps, cut, singularities })
}

/// Across each edge, by how many quarters the numbers of directions go on.
fn matched(surface: &FieldSurface, first: &[f64], angles: &[f64]) -> Vec<u8> {
    let (dual, frames) = (surface.dual(), surface.frames());
    let edges = dual.edge_faces().par_iter().zip(angles).enumerate();
    edges
        .with_min_len(PIECE)
        .map(|(edge, (&[low, high], angle))| {
            let carried = frames.carry(dual, low as usize, dual.slot(low, edge as u32));
            let Some(Turn { by: carried, .. }) = carried.filter(|_| high != NO_FACE) else { return 0 };
            // The first direction of the lower face, turned as the field turns, against the first one of the upper
            // face; whole quarters but for rounding.
            let there = first[high as usize] + carried[1].atan2(carried[0]);
            ((first[low as usize] + angle / 4.0 - there) / FRAC_PI_2).round().rem_euclid(4.0) as u8
        })
        .collect()
}

/// Vertices inside around which the field has an index, or directions do not come back.
fn singular_vertices(surface: &FieldSurface, angles: &[f64], matching: &[u8]) -> Vec<Singularity> {
    let (dual, frames, mesh) = (surface.dual(), surface.frames(), surface.mesh());
    let one = |corners: &mut Vec<u32>, vertex: u32| {
        if !dual.fan(mesh, vertex, corners) {
            return None;
        }
        let (mut rotation, mut defect, mut quarters) = (0.0, TAU, 0i32);
        for &corner in corners.iter() {
            let (face, k) = (corner as usize / 3, corner as usize % 3);
            let edges = frames.edges(face);
            let (a, b) = (edges[(k + 2) % 3], edges[(k + 1) % 3]);
            defect -= (a[0] * b[1] - a[1] * b[0]).abs().atan2(-(a[0] * b[0] + a[1] * b[1]));
            let edge = dual.edges(face)[(k + 1) % 3] as usize;
            let sign = if dual.edge_faces()[edge][0] as usize == face { 1 } else { -1 };
            rotation += f64::from(sign) * angles[edge];
            quarters += sign * i32::from(matching[edge]);
        }
        let numerator = ((rotation + 4.0 * defect) / TAU).round() as i32;
        (numerator != 0 || quarters % 4 != 0).then_some(Singularity { vertex, numerator, order: 4 })
    };
    let vertices = (0..mesh.positions.len() as u32).into_par_iter().with_min_len(PIECE);
    vertices.map_init(Vec::new, one).flatten_iter().collect()
}

/// The edges of paths that join singular vertices and boundaries, on each component: of the shortest ways between those
/// that are next to each other as many as make a tree.
fn joined(surface: &FieldSurface, singular: &[bool], boundary: &[bool]) -> Vec<bool> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let vertices = mesh.positions.len();
    let length = |[a, b]: [u32; 2]| {
        let (p, q) = (mesh.positions[a as usize], mesh.positions[b as usize]);
        (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt()
    };
    let edges = dual.edge_faces().len();
    let mut offsets = vec![0u32; vertices + 1];
    let both: Vec<[u32; 2]> = (0..edges).into_par_iter().with_min_len(PIECE).map(|edge| ends(surface, edge)).collect();
    both.iter().flatten().for_each(|&v| offsets[v as usize + 1] += 1);
    for v in 0..vertices {
        offsets[v + 1] += offsets[v];
    }
    let mut around = vec![0u32; 2 * edges];
    let mut next = offsets.clone();
    for (edge, ends) in both.iter().enumerate() {
        for &v in ends {
            around[next[v as usize] as usize] = edge as u32;
            next[v as usize] += 1;
        }
    }
    let mut distance = vec![f64::INFINITY; vertices];
    let mut through = vec![u32::MAX; vertices];
    let mut source: Vec<u32> = (0..vertices as u32).collect();
    let mut heap = BinaryHeap::new();
    for v in (0..vertices).filter(|&v| singular[v] || boundary[v]) {
        distance[v] = 0.0;
        heap.push((Reverse(Ordered(0.0)), v as u32));
    }
    while let Some((Reverse(Ordered(reached)), v)) = heap.pop() {
        if reached > distance[v as usize] {
            continue;
        }
        for &edge in &around[offsets[v as usize] as usize..offsets[v as usize + 1] as usize] {
            let [a, b] = both[edge as usize];
            let other = if a == v { b } else { a };
            let there = reached + length([a, b]);
            if there < distance[other as usize] {
                distance[other as usize] = there;
                through[other as usize] = edge;
                source[other as usize] = source[v as usize];
                heap.push((Reverse(Ordered(there)), other));
            }
        }
    }
    // A boundary is one thing to be joined.
    let mut sets = Sets::new(vertices);
    for (edge, faces) in dual.edge_faces().iter().enumerate() {
        if faces[1] == NO_FACE {
            sets.join(both[edge]);
        }
    }
    let mut bridges: Vec<(f64, u32)> = Vec::new();
    for (edge, &[a, b]) in both.iter().enumerate() {
        if source[a as usize] != source[b as usize]
            && distance[a as usize].is_finite()
            && distance[b as usize].is_finite()
        {
            bridges.push((distance[a as usize] + length([a, b]) + distance[b as usize], edge as u32));
        }
    }
    bridges.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut paths = vec![false; edges];
    for (_, edge) in bridges {
        let [a, b] = both[edge as usize];
        if !sets.join([source[a as usize], source[b as usize]]) {
            continue;
        }
        paths[edge as usize] = true;
        for end in [a, b] {
            let mut v = end;
            while through[v as usize] != u32::MAX {
                let edge = through[v as usize];
                paths[edge as usize] = true;
                let [p, q] = both[edge as usize];
                v = if p == v { q } else { p };
            }
        }
    }
    paths
}

/// Lengths in a heap.
#[derive(PartialEq)]
struct Ordered(f64);

impl Eq for Ordered {}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// Walks a tree of faces that crosses no path: which of its directions goes on from its parent's, and the inner edges
/// that are not crossed.
fn spanned(surface: &FieldSurface, paths: &[bool], matching: &[u8]) -> (Vec<u8>, Vec<bool>) {
    let dual = surface.dual();
    let (mut turns, mut seen) = (vec![0u8; surface.faces()], vec![false; surface.faces()]);
    let mut cut: Vec<bool> = dual.edge_faces().iter().map(|faces| faces[1] != NO_FACE).collect();
    let mut queue = VecDeque::new();
    for root in 0..surface.faces() {
        if std::mem::replace(&mut seen[root], true) {
            continue;
        }
        queue.push_back(root as u32);
        while let Some(face) = queue.pop_front() {
            for (k, other) in dual.neighbours(face as usize).into_iter().enumerate() {
                let edge = dual.edges(face as usize)[k] as usize;
                if other == NO_FACE || paths[edge] || std::mem::replace(&mut seen[other as usize], true) {
                    continue;
                }
                cut[edge] = false;
                let own = turns[face as usize];
                let forward = dual.edge_faces()[edge][0] == face;
                turns[other as usize] = (if forward { own + matching[edge] } else { own + 4 - matching[edge] }) % 4;
                queue.push_back(other);
            }
        }
    }
    (turns, cut)
}

/// Takes edges off that end at a vertex which need not be reached.
fn prune(surface: &FieldSurface, cut: &mut [bool], reached: impl Fn(u32) -> bool) {
    let vertices = surface.mesh().positions.len();
    // Of each vertex how many edges are left, and their exclusive or: with one left, that one.
    let (mut degree, mut mixed) = (vec![0u32; vertices], vec![0u32; vertices]);
    for edge in (0..cut.len()).filter(|&edge| cut[edge]) {
        for v in ends(surface, edge) {
            degree[v as usize] += 1;
            mixed[v as usize] ^= edge as u32;
        }
    }
    let mut loose: Vec<u32> = (0..vertices as u32).filter(|&v| degree[v as usize] == 1 && !reached(v)).collect();
    while let Some(v) = loose.pop() {
        if degree[v as usize] != 1 {
            continue;
        }
        let edge = mixed[v as usize];
        cut[edge as usize] = false;
        for end in ends(surface, edge as usize) {
            degree[end as usize] -= 1;
            mixed[end as usize] ^= edge;
            if degree[end as usize] == 1 && !reached(end) {
                loose.push(end);
            }
        }
    }
}
