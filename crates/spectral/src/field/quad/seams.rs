//! How coordinates go on across the cut: from the left side of a seam to the right one by quarter turns and a
//! translation.
//!
//! A seam is a path of cut edges between two nodes, on which its turn and its translation `t` do not change. With
//! `z = u + i v` the coordinates of a corner are `i^p z_v + Σ c_s t_s`: those of its vertex, taken around it over the
//! seams in between. Once around a node that is no boundary this has to be `z_v` again, which is one equation for each.

use std::collections::HashMap;

use super::super::harmonic::rim;
use super::super::loops::ends;
use super::super::surface::FieldSurface;
use super::{Combed, QuadError};

/// A complex number of whole parts.
pub(super) type GaussianInteger = [i32; 2];

/// `i^quarters` times a number.
pub(super) fn quarter_turned([x, y]: GaussianInteger, quarters: i32) -> GaussianInteger {
    match quarters.rem_euclid(4) {
        0 => [x, y],
        1 => [-y, x],
        2 => [-x, -y],
        _ => [y, -x],
    }
}

/// Translations with their factors.
pub(super) type Shifts = Vec<(u32, GaussianInteger)>;

/// The seams of a cut surface.
pub(super) struct Seams {
    /// How many seams there are.
    pub count: usize,
    /// For each corner `3 · face + k` the quarters by which the coordinates of its vertex are turned there.
    pub quarters: Vec<u8>,
    /// For corners where there are any, the translations with their factors.
    pub shifts: HashMap<u32, Shifts>,
    /// For nodes: the factor of the coordinates of the vertex, and those of translations, that add up to zero.
    pub closures: Vec<(u32, GaussianInteger, Shifts)>,
    /// Whether a vertex lies on the cut.
    pub on_cut: Vec<bool>,
}

/// A cut edge as a part of its seam.
#[derive(Clone, Copy)]
struct Part {
    seam: u32,
    /// Where the seam comes from.
    from: u32,
    /// Quarters from the left side to the right one: `z_right = i^quarters z_left + t`.
    quarters: i32,
}

/// Entries that corners beyond seams may give the equations, for each face and beside these. On ordinary fields corners
/// lie beyond two or three seams; where a thousand meet at a vertex, each corner would name all of them.
const ENTRIES_PER_FACE: usize = 64;
const ENTRIES: usize = 1 << 20;

impl Seams {
    /// The seams of a combed field.
    ///
    /// # Errors
    /// [`QuadError::Seams`].
    pub fn new(surface: &FieldSurface, combed: &Combed) -> Result<Self, QuadError> {
        let (mesh, dual) = (surface.mesh(), surface.dual());
        let vertices = mesh.positions.len();
        let (parts, count) = parts(surface, combed);
        let mut seams = Self {
            count,
            quarters: vec![0; 3 * surface.faces()],
            shifts: HashMap::new(),
            closures: Vec::new(),
            on_cut: vec![false; vertices],
        };
        for &edge in parts.keys() {
            ends(surface, edge as usize).into_iter().for_each(|v| seams.on_cut[v as usize] = true);
        }
        let mut corners = Vec::new();
        let mut entries = 0usize;
        for vertex in (0..vertices as u32).filter(|&v| seams.on_cut[v as usize]) {
            let closed = dual.fan(mesh, vertex, &mut corners);
            let mut quarters = 0i32;
            let mut shifts: Vec<(u32, GaussianInteger)> = Vec::new();
            for (at, &corner) in corners.iter().enumerate() {
                seams.quarters[corner as usize] = quarters.rem_euclid(4) as u8;
                if !shifts.is_empty() {
                    // Two rows for each of two edges, of the terms of two corners.
                    entries = entries.saturating_add(16 * (shifts.len() + 1).pow(2));
                    if entries > ENTRIES_PER_FACE * surface.faces() + ENTRIES {
                        return Err(QuadError::Seams { vertex, count: shifts.len() });
                    }
                    seams.shifts.insert(corner, shifts.clone());
                }
                // Counter-clockwise across the edge opposite to corner k + 1: from the right side to the left one, seen
                // from the vertex.
                let (face, k) = (corner as usize / 3, corner as usize % 3);
                let edge = dual.edges(face)[(k + 1) % 3];
                let Some(part) = parts.get(&edge).filter(|_| closed || at + 1 < corners.len()) else { continue };
                if part.from == vertex {
                    add(&mut shifts, part.seam, [-1, 0]);
                    quarters -= part.quarters;
                    shifts.iter_mut().for_each(|shift| shift.1 = quarter_turned(shift.1, -part.quarters));
                } else {
                    quarters += part.quarters;
                    shifts.iter_mut().for_each(|shift| shift.1 = quarter_turned(shift.1, part.quarters));
                    add(&mut shifts, part.seam, [1, 0]);
                }
            }
            let own = quarter_turned([1, 0], quarters);
            if closed && (own != [1, 0] || !shifts.is_empty()) {
                seams.closures.push((vertex, [own[0] - 1, own[1]], shifts));
            }
        }
        Ok(seams)
    }
}

fn add(shifts: &mut Vec<(u32, GaussianInteger)>, seam: u32, factor: GaussianInteger) {
    match shifts.iter_mut().find(|shift| shift.0 == seam) {
        Some(shift) => shift.1 = [shift.1[0] + factor[0], shift.1[1] + factor[1]],
        None => shifts.push((seam, factor)),
    }
    shifts.retain(|shift| shift.1 != [0, 0]);
}

/// The cut edges with their seams, and how many seams there are.
fn parts(surface: &FieldSurface, combed: &Combed) -> (HashMap<u32, Part>, usize) {
    let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
    for edge in (0..combed.cut.len()).filter(|&edge| combed.cut[edge]) {
        ends(surface, edge).into_iter().for_each(|v| around.entry(v).or_default().push(edge as u32));
    }
    let boundary = rim(surface);
    let mut node: HashMap<u32, bool> =
        around.iter().map(|(&v, edges)| (v, edges.len() != 2 || boundary[v as usize])).collect();
    combed.singularities.iter().for_each(|s| {
        node.insert(s.vertex, true);
    });
    let mut vertices: Vec<u32> = around.keys().copied().collect();
    vertices.sort_unstable();
    let mut found: HashMap<u32, Part> = HashMap::new();
    let mut count = 0;
    // Nodes first; then a circle without one begins at any of its vertices.
    for nodes in [true, false] {
        for &start in &vertices {
            if nodes && !node[&start] {
                continue;
            }
            for &first in &around[&start] {
                if found.contains_key(&first) {
                    continue;
                }
                node.insert(start, true);
                let (mut from, mut edge) = (start, first);
                loop {
                    let [a, b] = ends(surface, edge as usize);
                    // The lower face runs along its own edge counter-clockwise: it lies on the left of that direction.
                    let jump = i32::from(combed.jumps[edge as usize]);
                    let quarters = if from == a { -jump } else { jump };
                    found.insert(edge, Part { seam: count as u32, from, quarters });
                    let to = if from == a { b } else { a };
                    if node[&to] {
                        break;
                    }
                    let Some(&next) = around[&to].iter().find(|&&next| next != edge) else { break };
                    (from, edge) = (to, next);
                }
                count += 1;
            }
        }
    }
    (found, count)
}
