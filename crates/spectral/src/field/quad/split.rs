//! Faces with creases that no cross runs along together, split so that each part has one of them.

use chladni_mesh::TriangleMesh;

use super::super::surface::FieldSurface;
use super::aligned::{off, sides};
use crate::operator::frames::power;

/// Creases of a face that are at less than this from right angles or from one direction are followed together, in
/// degrees.
const TOGETHER: f64 = 0.5;

/// The faces with creases of which no cross can follow all, ascending; `edges` are the creases.
pub fn crowded(surface: &FieldSurface, edges: &[u32]) -> Vec<u32> {
    let mut first = vec![None; surface.faces()];
    let mut found = Vec::new();
    for side in sides(surface, edges) {
        match first[side.face] {
            None => first[side.face] = Some(power(side.along, 4)),
            Some(cross) if off(&side, cross) > TOGETHER => found.push(side.face as u32),
            Some(_) => {}
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// The mesh with some faces split in three at their barycentres. Of face number `k` in the list the vertex is number
/// `V + k`; the part on its first edge, from corner 0 to corner 1, has the place of the face, those on the other two
/// are faces `F + 2k` and `F + 2k + 1`.
///
/// # Panics
/// Where the list names a face that is not there.
pub fn split(mesh: &TriangleMesh, list: &[u32]) -> TriangleMesh {
    let (mut positions, mut faces) = (mesh.positions.clone(), mesh.faces.clone());
    for &face in list {
        let [a, b, c] = mesh.faces[face as usize];
        let [p, q, r] = [a, b, c].map(|v| mesh.positions[v as usize]);
        let middle = positions.len() as u32;
        positions.push([0, 1, 2].map(|i| (p[i] + q[i] + r[i]) / 3.0));
        faces[face as usize] = [a, b, middle];
        faces.extend([[b, c, middle], [c, a, middle]]);
    }
    TriangleMesh { positions, faces, ..TriangleMesh::default() }
}

#[cfg(test)]
mod tests {
    use super::super::{CrossField, CrossParameters, creases};
    use super::*;
    use chladni_base::Unwatched;

    /// A pyramid over a triangle: every edge is a crease, so that every face has three.
    fn pyramid() -> FieldSurface {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.9, 0.0], [0.4, 0.3, 0.8]];
        let faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        FieldSurface::new(TriangleMesh { positions, faces, ..TriangleMesh::default() }).unwrap()
    }

    #[test]
    fn split_faces_follow_every_crease() {
        let surface = pyramid();
        let parameters = CrossParameters::default();
        let before = CrossField::aligned(&surface, &parameters, &Unwatched).unwrap();
        assert!(before.crease_error[1] > 5.0, "{:?}", before.crease_error);
        let list = crowded(&surface, &creases(&surface, Some(35.0), true));
        assert_eq!(list, [0, 1, 2, 3]);
        let parts = split(surface.mesh(), &list);
        assert_eq!((parts.positions.len(), parts.faces.len()), (8, 12));
        let parts = FieldSurface::new(parts).unwrap();
        let edges = creases(&parts, Some(35.0), true);
        assert_eq!((edges.len(), crowded(&parts, &edges)), (6, Vec::new()));
        assert!((parts.frames().area() / surface.frames().area() - 1.0).abs() < 1e-12);
        let after = CrossField::aligned(&parts, &parameters, &Unwatched).unwrap();
        assert!(after.crease_error[1] < 1e-3, "{:?}", after.crease_error);
    }

    #[test]
    fn a_face_with_a_right_angle_stays_whole() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let surface =
            FieldSurface::new(TriangleMesh { positions, faces: vec![[0, 1, 2]], ..TriangleMesh::default() }).unwrap();
        assert!(crowded(&surface, &creases(&surface, None, true)) == [0], "three sides are too many");
        let length = |side: &super::super::aligned::Side| side.length;
        let shortest = sides(&surface, &[0, 1, 2]).map(|side| length(&side)).fold(f64::INFINITY, f64::min);
        let legs = sides(&surface, &[0, 1, 2]).filter(|side| length(side) < 1.1 * shortest).map(|side| side.edge);
        let legs: Vec<u32> = legs.collect();
        assert_eq!((legs.len(), crowded(&surface, &legs)), (2, Vec::new()));
    }
}
