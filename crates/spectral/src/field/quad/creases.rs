//! Edges at which a surface is sharp: the angle between the normals of their faces.

use chladni_mesh::dual::NO_FACE;

use super::super::surface::FieldSurface;

/// The inner edges whose faces turn by at least `angle` degrees from one to the other, and with `boundary` those of one
/// face; edges as the dual graph counts, ascending. Faces without area have no normal, and no sharp edges.
pub fn creases(surface: &FieldSurface, angle: Option<f64>, boundary: bool) -> Vec<u32> {
    let (dual, frames) = (surface.dual(), surface.frames());
    let least = 1e-8 / surface.faces() as f64;
    let flat = |face: u32| frames.areas()[face as usize] < least;
    let cosine = angle.map(|angle| angle.to_radians().cos());
    let sharp = |&[face, other]: &[u32; 2]| {
        if other == NO_FACE {
            return boundary && !flat(face);
        }
        let Some(cosine) = cosine.filter(|_| !flat(face) && !flat(other)) else { return false };
        frames.normal(face as usize).dot(frames.normal(other as usize)) <= cosine
    };
    let edges = dual.edge_faces().iter().enumerate();
    edges.filter(|(_, faces)| sharp(faces)).map(|(edge, _)| edge as u32).collect()
}
