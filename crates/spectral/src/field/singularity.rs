//! Where a field has no direction: the index of each vertex, from the rotation of the field around it.
//!
//! Between neighbouring faces an n-field turns by the least angle `r_e` that carries the representation of one into
//! that of the other. Around a vertex these angles and `n` times the angle defect `K` add up to a multiple of 360°, and
//! the index is that multiple over `n`. As each `r_e` is computed once and seen from both ends with opposite signs, the
//! indices of a closed surface add up to its Euler characteristic exactly. A mirror image of a field has the same
//! indices, so that they are there, with their signs, where a surface has only one side.

use chladni_base::parallel::*;

use crate::basis::FieldMisfit;
use crate::operator::frames::{Complex64, complex, inner, outer};
use crate::operator::transport::{FieldKind, turn};

use super::reading::tensor_deviator;
use super::surface::FieldSurface;

/// A vertex at which a field is singular.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Singularity {
    /// The vertex.
    pub vertex: u32,
    /// `n` times its index: the index of an n-field is a multiple of `1/n`.
    pub numerator: i32,
    /// `n`; for tensors 2, the eigendirections being a 2-field.
    pub order: u32,
}

impl Singularity {
    /// The index.
    pub fn index(&self) -> f64 {
        f64::from(self.numerator) / f64::from(self.order.max(1))
    }
}

/// What a field consists of, to errors.
const NUMBERS: &str = "numbers of a field";

/// The singular vertices of a field of `block` numbers per face, ascending. Vertices at a boundary have no index.
///
/// # Errors
/// [`FieldMisfit::Numbers`] unless the field has `block` numbers for each face.
pub fn singularities(surface: &FieldSurface, kind: FieldKind, field: &[f32]) -> Result<Vec<Singularity>, FieldMisfit> {
    matched_singularities(surface, kind, field, &[])
}

/// By how many full turns, beyond the least angle, the representation of a field turns across an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Matching {
    /// The edge, as the dual graph counts.
    pub edge: u32,
    /// The lower face of the edge and the upper one.
    pub faces: [u32; 2],
    /// Full turns from the lower face to the upper one, not 0. Of the `n` directions number `k` of the lower face goes
    /// on as the `turns` next one beyond that which is nearest to it.
    pub turns: i32,
}

/// The matching of a field whose representation is a power of another one's, with the matching of that: what turns by
/// more than half a turn between two faces turns by several times that in the power.
///
/// # Errors
/// [`FieldMisfit`]: a field has other than `block` numbers for each face, or the matching is of an edge that is not
/// there.
pub fn matching_of_power(
    surface: &FieldSurface,
    (kind, field, matching): (FieldKind, &[f32], &[Matching]),
    (power, raised): (FieldKind, &[f32]),
) -> Result<Vec<Matching>, FieldMisfit> {
    let angles = matched_angles(surface, kind, field, matching)?;
    let times = f64::from(power.order()) / f64::from(kind.order());
    let least = least_angles(surface, power, raised)?;
    let edges = surface.dual().edge_faces().iter().zip(angles.iter().zip(&least)).enumerate();
    let matched = edges.filter_map(|(edge, (&faces, (angle, least)))| {
        let turns = ((times * angle - least) / std::f64::consts::TAU).round() as i32;
        (turns != 0).then_some(Matching { edge: edge as u32, faces, turns })
    });
    Ok(matched.collect())
}

/// By what a field turns across each edge.
fn matched_angles(
    surface: &FieldSurface,
    kind: FieldKind,
    field: &[f32],
    matching: &[Matching],
) -> Result<Vec<f64>, FieldMisfit> {
    let mut angles = least_angles(surface, kind, field)?;
    let edges = angles.len();
    for (place, &Matching { edge, turns, .. }) in matching.iter().enumerate() {
        let angle = angles.get_mut(edge as usize).ok_or(FieldMisfit::Edge { place, edge, edges })?;
        *angle += std::f64::consts::TAU * f64::from(turns);
    }
    Ok(angles)
}

/// The singular vertices of a field whose faces are matched: without a matching, a turn of more than 180° is read as
/// the smaller one the other way round.
///
/// # Errors
/// [`FieldMisfit`]: the field has other than `block` numbers for each face, or the matching is of an edge that is not
/// there.
pub fn matched_singularities(
    surface: &FieldSurface,
    kind: FieldKind,
    field: &[f32],
    matching: &[Matching],
) -> Result<Vec<Singularity>, FieldMisfit> {
    let (dual, frames, mesh) = (surface.dual(), surface.frames(), surface.mesh());
    let order = kind.order();
    let angles = matched_angles(surface, kind, field, matching)?;
    let (mut corners, mut turned) = (Vec::new(), Vec::new());
    let mut found = Vec::new();
    for vertex in 0..mesh.positions.len() as u32 {
        turned.clear();
        if !dual.sided_fan(mesh, vertex, &mut corners, |side| turned.push(side)) {
            continue;
        }
        let (mut rotation, mut defect) = (0.0, std::f64::consts::TAU);
        for (&corner, &turned) in corners.iter().zip(&turned) {
            let (face, k) = (corner as usize / 3, corner as usize % 3);
            let edges = frames.edges(face);
            let (a, b) = (edges[(k + 2) % 3], edges[(k + 1) % 3]);
            defect -= outer(a, b).abs().atan2(-inner(a, b));
            // Counter-clockwise the next face lies across the edge opposite to corner k + 1.
            let across = (k + if turned { 2 } else { 1 }) % 3;
            let edge = dual.edges(face)[across] as usize;
            // Faces of opposite orientation see the same angle both ways.
            let forward = dual.edge_faces()[edge][0] as usize == face || dual.is_mirrored(face, across);
            rotation += if forward != turned { angles[edge] } else { -angles[edge] };
        }
        let turns = (rotation + f64::from(order) * defect) / std::f64::consts::TAU;
        let numerator = turns.round() as i32;
        if numerator != 0 {
            found.push(Singularity { vertex, numerator, order });
        }
    }
    Ok(found)
}

/// From the lower face of each edge to the upper one, by which angle from −180° to 180° a field turns; 0 at a boundary.
///
/// # Errors
/// [`FieldMisfit::Numbers`] unless the field has `block` numbers for each face.
pub(super) fn least_angles(surface: &FieldSurface, kind: FieldKind, field: &[f32]) -> Result<Vec<f64>, FieldMisfit> {
    let b = kind.block();
    FieldMisfit::check(NUMBERS, field.len(), b * surface.faces())?;
    let (dual, frames) = (surface.dual(), surface.frames());
    let value = |face: usize| -> Complex64 {
        let own = &field[b * face..b * (face + 1)];
        match kind {
            FieldKind::Tensor {} => tensor_deviator([own[0], own[1], own[2]].map(f64::from)),
            _ => complex([own[0], own[1]].map(f64::from)),
        }
    };
    let angles = dual
        .edge_faces()
        .par_iter()
        .enumerate()
        .with_min_len(1 << 12)
        .map(|(edge, &[low, high])| {
            let Some(k) = dual.edges(low as usize).iter().position(|&e| e as usize == edge) else { return 0.0 };
            // The turn carries the upper face's numbers into the lower one.
            let Some(carried) = turn(kind, dual, frames, low as usize, k) else { return 0.0 };
            (carried.of(value(high as usize)) * value(low as usize).conj()).arg()
        })
        .collect();
    Ok(angles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{FieldParameters, field_basis};
    use crate::operator::frames::parts;
    use chladni_base::Unwatched;
    use chladni_base::Vector3;
    use chladni_mesh::shape::{Shape, generate, noisy};

    fn sum(found: &[Singularity]) -> i32 {
        found.iter().map(|s| s.numerator).sum()
    }

    #[test]
    fn indices_add_up_to_the_euler_characteristic_whatever_the_field() {
        for (shape, vertices) in [(Shape::Sphere, 162), (Shape::Torus, 200), (Shape::Genus(2), 1200)] {
            let surface = FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.2, 1).unwrap()).unwrap();
            let characteristic = surface.dual().euler_characteristic() as i32;
            for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}] {
                let b = kind.block();
                let field: Vec<f32> = (0..b * surface.faces()).map(|i| ((i * i) as f32 * 0.37).sin()).collect();
                let found = singularities(&surface, kind, &field).unwrap();
                assert_eq!(sum(&found), kind.order() as i32 * characteristic, "{shape} {kind:?}");
            }
        }
    }

    #[test]
    fn smooth_fields_have_few_singularities() {
        let surface = FieldSurface::new(generate(Shape::Sphere, 2562).unwrap()).unwrap();
        // The field of a rotation about z has two of index 1, at the poles.
        let field: Vec<f32> = (0..surface.faces())
            .flat_map(|f| {
                let centre: Vector3 = surface.mesh().corners(&surface.mesh().faces[f]).into_iter().sum();
                parts(surface.frames().from_world(f, Vector3::new(-centre[1], centre[0], 0.0))).map(|x| x as f32)
            })
            .collect();
        let found = singularities(&surface, FieldKind::Vector {}, &field).unwrap();
        assert!(found.len() == 2 && found.iter().all(|s| s.index() == 1.0), "{found:?}");
        // The smoothest 4-field has the eight of a cube, each of index 1/4.
        let kind = FieldKind::NVector { n: 4 };
        let basis = field_basis(&surface, &FieldParameters::new(kind, 200), &Unwatched).unwrap();
        let model = crate::field::DesignModel::new(&basis, &Unwatched).unwrap();
        let lowest = basis.space.lift(&model.eigenfield(0)).unwrap();
        let found = singularities(&surface, kind, &lowest).unwrap();
        assert_eq!(sum(&found), 8);
        assert!(found.len() <= 12, "{}", found.len());
        let expected = lowest.len();
        let short = FieldMisfit::Numbers { what: NUMBERS, found: expected - 1, expected };
        assert_eq!(singularities(&surface, kind, &lowest[1..]), Err(short));
        let beyond = [Matching { edge: u32::MAX, faces: [0, 1], turns: 1 }];
        let edges = surface.dual().edge_faces().len();
        let off = FieldMisfit::Edge { place: 0, edge: u32::MAX, edges };
        assert_eq!(matched_singularities(&surface, kind, &lowest, &beyond), Err(off));
    }
}
