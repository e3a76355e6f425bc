//! Every face in four, by the midpoints of its edges.

use std::collections::HashMap;

use super::TriangleMesh;

/// How often a mesh may be divided: 4096 faces for each.
pub const MOST_SUBDIVISIONS: u8 = 6;

/// The same surface with four times the faces: the midpoint of each edge becomes a vertex, numbered after those that
/// are there. `None` where there are too many vertices or faces to be numbered, or a face refers to a vertex that is
/// not there.
pub fn subdivided(mesh: &TriangleMesh) -> Option<TriangleMesh> {
    u32::try_from(mesh.faces.len().checked_mul(4)?).ok()?;
    let points = mesh.points();
    let mut positions = mesh.positions.clone();
    let mut midpoints: HashMap<[u32; 2], u32> = HashMap::with_capacity(mesh.faces.len() * 3 / 2);
    let mut faces = Vec::with_capacity(4 * mesh.faces.len());
    for &[a, b, c] in &mesh.faces {
        let mut middle = |p: u32, q: u32| -> Option<u32> {
            let (from, to) = (*points.get(p as usize)?, *points.get(q as usize)?);
            let fresh = u32::try_from(positions.len()).ok()?;
            let found = *midpoints.entry([p.min(q), p.max(q)]).or_insert(fresh);
            if found == fresh {
                positions.push((0.5 * (from + to)).into());
            }
            Some(found)
        };
        let [ab, bc, ca] = [middle(a, b)?, middle(b, c)?, middle(c, a)?];
        faces.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    Some(TriangleMesh { positions, faces, ..Default::default() })
}

/// The ends of the edge that each vertex made by [`subdivided`] halves, in the order of these vertices, told from the
/// faces of a mesh that was divided so many times: four follow each other, the corner of the whole first in three of
/// them.
pub(crate) fn midpoints(faces: &[[u32; 3]], times: u8) -> Vec<[u32; 2]> {
    let mut found: Vec<(u32, [u32; 2])> = Vec::new();
    let mut level = faces.to_vec();
    for _ in 0..times {
        let (groups, _) = level.as_chunks::<4>();
        found.extend(
            groups.iter().flat_map(|[a, b, c, _]| [(a[1], [a[0], b[0]]), (b[1], [b[0], c[0]]), (c[1], [c[0], a[0]])]),
        );
        level = groups.iter().map(|[a, b, c, _]| [a[0], b[0], c[0]]).collect();
    }
    found.sort_unstable_by_key(|&(middle, [a, b])| (middle, a.min(b)));
    found.dedup_by_key(|&mut (middle, _)| middle);
    found.into_iter().map(|(_, ends)| ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::surface_area;
    use crate::shape::{Shape, generate};

    #[test]
    fn a_subdivided_surface_is_the_same_surface() {
        let mesh = generate(Shape::Torus, 300).unwrap();
        let fine = subdivided(&mesh).unwrap();
        let edges = mesh.faces.len() * 3 / 2;
        assert_eq!((fine.faces.len(), fine.positions.len()), (4 * mesh.faces.len(), mesh.positions.len() + edges));
        assert!((surface_area(&fine) / surface_area(&mesh) - 1.0).abs() < 1e-12);
        let bad = TriangleMesh { positions: vec![[0.0; 3]; 2], faces: vec![[0, 1, 2]], ..Default::default() };
        assert_eq!(subdivided(&bad), None);
    }
}
