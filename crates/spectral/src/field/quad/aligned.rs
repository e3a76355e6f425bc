//! The smoothest cross field of all fields of a surface that runs along its creases: a harmonic representation with
//! values given at their faces.
//!
//! Card. `Σ_e w_e |u_i − P u_j|²` of the transport Laplacian with `n = 4`, the fourth powers of the directions of
//! creases held on the faces beside them, and where it is wanted `w Σ_f a_f s_f |u_f − κ_f|²` with the principal
//! directions `κ` and how clear they are, `s`. Where nothing is held the field of least energy and length 1 is taken
//! (Knöppel, Crane, Pinkall and Schröder 2013). How it is computed stands in [`super::smoothest`].

use std::collections::HashMap;

use chladni_base::Monitor;
use chladni_mesh::dual::NO_FACE;

use super::super::surface::FieldSurface;
use super::smoothest::smoothest;
use super::{QuadError, creases};
use crate::operator::frames::{Complex64, complex, normalise, parts, power};
use crate::operator::transport::FieldKind;

/// What a cross field is asked to follow.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossParameters {
    /// From how many degrees between the normals of its faces on an edge is a crease; without it none is.
    pub creases: Option<f64>,
    /// Whether boundaries are followed as creases are.
    pub boundary: bool,
    /// The weight of the distance to the principal directions of curvature, on the surface of unit area.
    pub curvature: f64,
    /// Directions that are met exactly, in the frames of faces.
    pub directions: Vec<(u32, [f64; 2])>,
}

impl Default for CrossParameters {
    fn default() -> Self {
        Self { creases: Some(35.0), boundary: true, curvature: 0.0, directions: Vec::new() }
    }
}

/// A cross field, and what it follows.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossField {
    /// Representations of length 1, `2F` numbers: the angle is four times that of the directions.
    pub field: Vec<f32>,
    /// The edges of creases and boundaries that it follows.
    pub creases: Vec<u32>,
    /// By how many degrees it misses them: the mean by length, over both sides, and the most. A face with two creases
    /// that stand at no right angle can follow one of them.
    pub crease_error: [f64; 2],
}

/// Crosses of unit length that differ by less are the same.
const SAME: f64 = 1e-6;

impl CrossField {
    /// Computes the field.
    ///
    /// # Errors
    /// [`QuadError`] names the parameter or the face.
    pub fn aligned(
        surface: &FieldSurface,
        parameters: &CrossParameters,
        monitor: &dyn Monitor,
    ) -> Result<Self, QuadError> {
        surface.dual().oriented()?;
        let faces = surface.faces();
        let CrossParameters { creases: angle, boundary, curvature, .. } = *parameters;
        if let Some(value) = angle.filter(|a| !(*a > 0.0 && *a <= 180.0)) {
            return Err(QuadError::Parameter {
                name: "creases",
                value,
                range: "an angle above 0 and up to 180 degrees",
            });
        }
        if !(curvature >= 0.0 && curvature.is_finite()) {
            let range = "a finite number of at least 0";
            return Err(QuadError::Parameter { name: "curvature", value: curvature, range });
        }
        let edges = creases(surface, angle, boundary);
        let mut held: Vec<Option<Complex64>> = vec![None; faces];
        let mut longest = vec![0.0f64; faces];
        for side in sides(surface, &edges) {
            // Of two creases of one face the longer one is followed.
            if side.length > longest[side.face] {
                longest[side.face] = side.length;
                held[side.face] = Some(power(side.along, 4));
            }
        }
        // Directions that are given go before creases.
        let mut given: HashMap<u32, Complex64> = HashMap::new();
        for (at, &(face, direction)) in parameters.directions.iter().enumerate() {
            let Some(held) = held.get_mut(face as usize) else { return Err(QuadError::Face { at, face, faces }) };
            let direction = complex(direction);
            let length = direction.norm();
            if !(length > 0.0 && length.is_finite()) {
                return Err(QuadError::NoDirection { face: face as usize });
            }
            let cross = power(direction / length, 4);
            if let Some(before) = given.insert(face, cross)
                && (before - cross).norm() > SAME
            {
                return Err(QuadError::Contradiction { face });
            }
            *held = Some(cross);
        }
        monitor.checkpoint()?;
        let field = smoothest(surface, &held, curvature, monitor)?;
        let crease_error = missed(surface, &edges, &field);
        Ok(Self {
            field: field.iter().flat_map(|&value| parts(value)).map(|x| x as f32).collect(),
            creases: edges,
            crease_error,
        })
    }
}

/// The crosses of a field of another kind, as they are stored: of a vector or a line field those that it lies on, of
/// tensors their eigendirections. `None` for n-fields with `n` that does not divide 4.
pub fn crosses_of(kind: FieldKind, field: &[f32]) -> Option<Vec<f32>> {
    let order = kind.order();
    if !matches!(order, 1 | 2 | 4) {
        return None;
    }
    let rows = field.chunks_exact(kind.block()).map(|own| match kind {
        FieldKind::Tensor {} => super::super::reading::tensor_deviator([own[0], own[1], own[2]].map(f64::from)),
        _ => complex([own[0], own[1]].map(f64::from)),
    });
    let unit = |value: Complex64| {
        let length = value.norm();
        if length > 0.0 && length.is_finite() { power(value / length, 4 / order) } else { Complex64::ZERO }
    };
    Some(rows.flat_map(|value| parts(unit(value)).map(|x| x as f32)).collect())
}

/// A face beside a crease.
pub(super) struct Side {
    pub edge: u32,
    pub face: usize,
    /// The slot of the edge in the face.
    pub slot: usize,
    /// The unit direction of the edge in its frame.
    pub along: Complex64,
    pub length: f64,
}

/// Both sides of edges.
pub(super) fn sides<'a>(surface: &'a FieldSurface, edges: &'a [u32]) -> impl Iterator<Item = Side> + 'a {
    let dual = surface.dual();
    let side = move |edge: u32, face: u32| {
        let slot = dual.slot(face, edge);
        let e = surface.frames().edges(face as usize)[slot];
        Side { edge, face: face as usize, slot, along: normalise(e), length: e.norm() }
    };
    edges.iter().flat_map(move |&edge| {
        let both = dual.edge_faces()[edge as usize].into_iter().filter(|&face| face != NO_FACE);
        both.map(move |face| side(edge, face))
    })
}

/// By how many degrees directions of crosses miss an edge.
pub(super) fn off(side: &Side, value: Complex64) -> f64 {
    let turn = value * power(side.along, 4).conj();
    (turn.arg() / 4.0).abs().to_degrees()
}

fn missed(surface: &FieldSurface, edges: &[u32], field: &[Complex64]) -> [f64; 2] {
    let (mut sum, mut total, mut most) = (0.0, 0.0, 0.0f64);
    for side in sides(surface, edges) {
        let error = off(&side, field[side.face]);
        (sum, total, most) = (sum + side.length * error, total + side.length, most.max(error));
    }
    if total > 0.0 { [sum / total, most] } else { [0.0; 2] }
}
