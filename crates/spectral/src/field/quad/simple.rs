//! Zeros of higher order, split into simple ones.
//!
//! On a surface with the symmetry of a disk that is cut into regular triangles, the smoothest field has one zero of
//! order four in the middle, like `z⁴`: around it a cross turns once, and no quads meet at a vertex of index 1. Nearly
//! every other surface has four zeros of order one there, since `z⁴ + ε` has four. So a small field that has no zero
//! there is added, `ε v` with `v` the response to a push at the faces around the vertex: it is as smooth as the field,
//! and nothing where values are held.

use std::f64::consts::TAU;

use chladni_base::parallel::*;

use super::super::singularity::least_angles;
use super::super::surface::FieldSurface;
use super::{KIND, QuadError};
use crate::operator::frames::{Planar, Turn, normalise, power};
use crate::operator::transport::turn;

/// Beyond the curvature of its vertex a simple zero turns a representation by one full turn, up to rounding to whole
/// turns.
const SIMPLE: f64 = 1.5 * TAU;

/// The size of what is added at the vertex, as a share of the largest value of the field. In a disk of radius 1 the
/// zeros of `z⁴ + ε` lie at `ε^¼`, more than half way to the rim for the first of these.
const SHARES: [f64; 4] = [0.1, 0.03, 0.3, 0.01];

/// A quad at least has to meet at a vertex: this many quarters are all that a cross can turn.
const NO_QUADS: i32 = 4;

/// A vertex at which a field has a zero of higher order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Zero {
    vertex: u32,
    /// Four times its index.
    numerator: i32,
}

/// The field with its zeros of higher order split, unit values of which are what is wanted: the field itself where it
/// has none, bit for bit. `response` gives the smoothest field that answers a push, with zeros where values are held.
///
/// # Errors
/// [`QuadError::Zero`] names a vertex of index 1 or more that could not be split, and whatever `response` fails with.
pub(super) fn split_zeros(
    surface: &FieldSurface,
    held: &[Option<Planar>],
    field: Vec<Planar>,
    response: impl FnOnce(Vec<f64>) -> Result<Vec<Planar>, QuadError>,
) -> Result<Vec<Planar>, QuadError> {
    let zeros = zeros(surface, held, &field);
    if zeros.is_empty() {
        return Ok(field);
    }
    let (push, pushed) = push(surface, held, &zeros);
    let mut least = (impossible(&zeros), field.clone());
    if pushed {
        let mut added = response(push)?;
        let scales = scales(surface, &field, &added, &zeros);
        added.iter_mut().zip(&scales).for_each(|(v, scale)| *v = v.map(|x| x * scale));
        for share in SHARES {
            let sum = |(u, v): (&Planar, &Planar)| [0, 1].map(|i| u[i] + share * v[i]);
            let split: Vec<Planar> = field.iter().zip(&added).map(sum).collect();
            let left = self::zeros(surface, held, &split);
            if left.is_empty() {
                return Ok(split);
            }
            if least.0.is_some() && impossible(&left).is_none() {
                least = (None, split);
            }
        }
    }
    match least {
        (None, field) => Ok(field),
        (Some(Zero { vertex, numerator }), _) => Err(QuadError::Zero { vertex, index: f64::from(numerator) / 4.0 }),
    }
}

/// The first at which no quads can meet.
fn impossible(zeros: &[Zero]) -> Option<Zero> {
    zeros.iter().find(|zero| zero.numerator >= NO_QUADS).copied()
}

/// Vertices around which a field turns by more than a simple zero does.
fn zeros(surface: &FieldSurface, held: &[Option<Planar>], field: &[Planar]) -> Vec<Zero> {
    let (dual, frames, mesh) = (surface.dual(), surface.frames(), surface.mesh());
    let unit = |(value, held): (&Planar, &Option<Planar>)| held.unwrap_or_else(|| normalise(*value)).map(|x| x as f32);
    let stored: Vec<f32> = field.iter().zip(held).flat_map(unit).collect();
    // Sizes fit: every face of the surface has put its numbers there.
    let Ok(angles) = least_angles(surface, KIND, &stored) else { return Vec::new() };
    let one = |corners: &mut Vec<u32>, vertex: u32| {
        if !dual.fan(mesh, vertex, corners) {
            return None;
        }
        let (mut rotation, mut defect) = (0.0, TAU);
        for &corner in corners.iter() {
            let (face, k) = (corner as usize / 3, corner as usize % 3);
            let edges = frames.edges(face);
            let (a, b) = (edges[(k + 2) % 3], edges[(k + 1) % 3]);
            defect -= (a[0] * b[1] - a[1] * b[0]).abs().atan2(-(a[0] * b[0] + a[1] * b[1]));
            let edge = dual.edges(face)[(k + 1) % 3] as usize;
            rotation += if dual.edge_faces()[edge][0] as usize == face { angles[edge] } else { -angles[edge] };
        }
        (rotation.abs() >= SIMPLE).then(|| Zero { vertex, numerator: ((rotation + 4.0 * defect) / TAU).round() as i32 })
    };
    let vertices = (0..mesh.positions.len() as u32).into_par_iter().with_min_len(1 << 12);
    vertices.map_init(Vec::new, one).flatten_iter().collect()
}

/// One direction carried around each of these vertices, times the areas of the faces that are free; and whether there
/// are such.
fn push(surface: &FieldSurface, held: &[Option<Planar>], zeros: &[Zero]) -> (Vec<f64>, bool) {
    let (dual, frames, mesh) = (surface.dual(), surface.frames(), surface.mesh());
    let (mut right, mut corners, mut any) = (vec![0.0; 2 * surface.faces()], Vec::new(), false);
    for zero in zeros {
        if !dual.fan(mesh, zero.vertex, &mut corners) {
            continue;
        }
        let mut value: Option<Planar> = None;
        for &corner in &corners {
            let (face, k) = (corner as usize / 3, corner as usize % 3);
            // Along the first edge from the vertex.
            let own = value.unwrap_or_else(|| power(normalise(frames.edges(face)[(k + 2) % 3]), 4));
            if held[face].is_none() {
                any = true;
                (0..2).for_each(|i| right[2 * face + i] += frames.areas()[face] * own[i]);
            }
            // What is carried from the next face into this one, the other way round.
            let across = turn(KIND, dual, frames, face, (k + 1) % 3).unwrap_or(Turn::NONE);
            value = Some(across.inverse().of(own));
        }
    }
    (right, any)
}

/// For each face what makes the response as large as the largest value of the field: of its component, and at its own
/// vertices.
fn scales(surface: &FieldSurface, field: &[Planar], added: &[Planar], zeros: &[Zero]) -> Vec<f64> {
    let (components, count) = surface.dual().components();
    let size = |value: &Planar| value[0].hypot(value[1]);
    let (mut largest, mut around) = (vec![0.0f64; count], vec![f64::INFINITY; count]);
    for (value, &c) in field.iter().zip(&components) {
        largest[c as usize] = largest[c as usize].max(size(value));
    }
    let mut corners = Vec::new();
    for zero in zeros {
        surface.dual().fan(surface.mesh(), zero.vertex, &mut corners);
        let most = corners.iter().map(|&corner| size(&added[corner as usize / 3])).fold(0.0, f64::max);
        if let Some(&corner) = corners.first().filter(|_| most > 0.0) {
            let c = components[corner as usize / 3] as usize;
            around[c] = around[c].min(most);
        }
    }
    components.iter().map(|&c| largest[c as usize] / around[c as usize]).collect()
}
