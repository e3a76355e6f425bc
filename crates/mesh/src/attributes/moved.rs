//! Normals of a surface whose vertices have moved.

use std::borrow::Cow;

use chladni_base::Vector3;
use chladni_base::parallel::*;

use super::{Attributes, Layer, NONE};
use crate::TriangleMesh;

impl Attributes {
    /// The attributes of a surface whose vertices have moved. Normals follow it: at each vertex, what one normal of the
    /// file was to the faces that share it, its successor is to these faces as they lie now, so that smooth places stay
    /// smooth, creases sharp, and normals that stood a little off their surface do so again. All else stays as it is.
    ///
    /// A face turns its normals as the inverse transpose of its deformation does, with its thickness kept; faces that
    /// share a normal at a vertex give the mean, weighted by their areas now. A normal all of whose faces are flat,
    /// before or after, stays.
    ///
    /// # Panics
    /// Where the positions are not as many as those of the mesh, or the mesh has other faces than the attributes are
    /// of.
    pub fn moved(&self, from: &TriangleMesh, to: &[[f64; 3]]) -> Cow<'_, Self> {
        assert_eq!(from.positions.len(), to.len(), "a position for each vertex");
        let Some(normals) = &self.normals else { return Cow::Borrowed(self) };
        if from.positions == to {
            return Cow::Borrowed(self);
        }
        assert_eq!(from.faces.len(), normals.corners.len(), "normals of the faces of this mesh");
        Cow::Owned(Self { normals: Some(follow(normals, from, to)), ..self.clone() })
    }
}

fn follow(normals: &Layer<3>, from: &TriangleMesh, to: &[[f64; 3]]) -> Layer<3> {
    // Corners by vertex and normal.
    let mut corners: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * from.faces.len());
    for (f, (face, own)) in from.faces.iter().zip(&normals.corners).enumerate() {
        let here = (0..3).filter(|&i| own[i] != NONE).map(|i| (face[i], own[i], (3 * f + i) as u32));
        corners.extend(here);
    }
    corners.par_sort_unstable();
    let groups: Vec<&[(u32, u32, u32)]> = corners.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
    let values: Vec<[f64; 3]> = groups
        .par_iter()
        .map(|group| {
            let normal = normals.values[group[0].1 as usize];
            let turned = group.iter().filter_map(|corner| turned(from, to, corner.2 / 3, normal.into()));
            turned.sum::<Vector3>().normalized().map_or(normal, Vector3::into)
        })
        .collect();
    let mut moved = vec![[NONE; 3]; from.faces.len()];
    for (value, group) in groups.iter().enumerate() {
        group.iter().for_each(|&(_, _, corner)| moved[corner as usize / 3][corner as usize % 3] = value as u32);
    }
    Layer { values, corners: moved }
}

/// The normal as this face has turned it, as long as twice the area of the face; `None` where the face is flat, before
/// or after.
fn turned(from: &TriangleMesh, to: &[[f64; 3]], face: u32, normal: Vector3) -> Option<Vector3> {
    let corners = from.faces[face as usize].map(|v| v as usize);
    let edges = |positions: &[[f64; 3]]| {
        let [p, q, r] = corners.map(|v| Vector3(positions[v]));
        (q - p, r - p)
    };
    let ((e, f), (g, h)) = (edges(&from.positions), edges(to));
    let (before, upright) = (e.cross(f), g.cross(h));
    let (before, now) = (before.normalized()?, upright.normalized()?);
    let area = upright.norm();
    // The new normal has the same products with the new edges and the new upright as the old one with the old.
    let (along_e, along_f, up) = (normal.dot(e), normal.dot(f), normal.dot(before));
    let turned = (along_e * h.cross(now) + along_f * now.cross(g)) / area + up * now;
    turned.normalized().map(|turned| area * turned)
}
