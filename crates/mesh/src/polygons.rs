//! Polygons that the triangles of a mesh are parts of.
//!
//! A mesh has triangles, and what needs no more works on these. Which of them were one face of the file is kept beside,
//! so that an operator can be made of the polygons themselves.

use std::ops::Range;

use super::numbering::Numbering;

/// Which polygon each triangle is a part of. Triangles of one polygon follow each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Polygons {
    of_face: Vec<u32>,
}

/// Polygons of more than three corners as loops of vertices.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Loops {
    faces: Vec<Range<u32>>,
    offsets: Vec<u32>,
    corners: Vec<u32>,
}

impl Polygons {
    /// From the number of the polygon that each triangle is a part of; `None` where each is one of its own.
    pub fn new(of_face: Vec<u32>) -> Option<Self> {
        of_face.windows(2).any(|pair| pair[0] == pair[1]).then_some(Self { of_face })
    }

    /// What the numbering of a file tells of them. Faces that were divided are no polygons any more.
    pub fn of(numbering: &Numbering) -> Option<Self> {
        match numbering.subdivisions() == 0 && numbering.divides_faces() {
            true => Self::new(numbering.face_map().collect()),
            false => None,
        }
    }

    /// The number of the polygon that each triangle is a part of.
    pub fn of_face(&self) -> &[u32] {
        &self.of_face
    }

    /// The polygons of more than three corners. Where the triangles of one do not make a disk whose corners all differ,
    /// as after a repair that merged some of them, they are left as they are. None at all where these are not the
    /// polygons of so many faces.
    pub fn loops(&self, faces: &[[u32; 3]]) -> Loops {
        let mut loops = Loops { offsets: vec![0], ..Loops::default() };
        if self.of_face.len() != faces.len() {
            return loops;
        }
        let mut first = 0;
        for group in self.of_face.chunk_by(|a, b| a == b) {
            let range = first..first + group.len();
            first = range.end;
            if group.len() > 1 && outline(&faces[range.clone()], &mut loops.corners) {
                loops.faces.push(range.start as u32..range.end as u32);
                loops.offsets.push(loops.corners.len() as u32);
            }
        }
        loops
    }
}

impl Loops {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.faces.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The triangles that a polygon was cut into.
    pub fn faces(&self, polygon: usize) -> Range<usize> {
        self.faces.get(polygon).map_or(0..0, |range| range.start as usize..range.end as usize)
    }

    /// The vertices of a polygon, counter-clockwise.
    pub fn corners(&self, polygon: usize) -> &[u32] {
        match self.offsets.get(polygon..polygon + 2) {
            Some(&[from, to]) => &self.corners[from as usize..to as usize],
            _ => &[],
        }
    }
}

/// Appends the outline of some triangles, which `t + 2` different vertices have to be; else appends nothing.
fn outline(triangles: &[[u32; 3]], corners: &mut Vec<u32>) -> bool {
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    let next: Vec<[u32; 2]> = edges.iter().copied().filter(|&[a, b]| edges.binary_search(&[b, a]).is_err()).collect();
    let whole = triangles.len() + 2;
    // Sorted by where they begin, so that equal beginnings stand beside each other.
    if next.len() != whole || next.windows(2).any(|pair| pair[0][0] == pair[1][0]) {
        return false;
    }
    let start = corners.len();
    let mut at = triangles[0][0];
    for _ in 0..whole {
        corners.push(at);
        match next.binary_search_by_key(&at, |edge| edge[0]) {
            Ok(place) => at = next[place][1],
            Err(_) => break,
        }
    }
    let round = corners.len() == start + whole && at == triangles[0][0];
    // A shorter loop that is run through twice comes back as well.
    let once = round && !corners[start + 1..].contains(&triangles[0][0]);
    if !once {
        corners.truncate(start);
    }
    once
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loops(of_face: &[u32], faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
        let loops = Polygons::new(of_face.to_vec()).unwrap().loops(faces);
        (0..loops.len()).map(|polygon| loops.corners(polygon).to_vec()).collect()
    }

    #[test]
    fn triangles_of_one_face_make_its_outline() {
        let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [6, 7, 8], [6, 8, 4], [4, 6, 5]];
        assert_eq!(loops(&[7, 7, 8, 9, 9, 10], &faces), [vec![0, 1, 2, 3], vec![6, 7, 8, 4]]);
        let of = Polygons::new(vec![7, 7, 8, 9, 9, 10]).unwrap().loops(&faces);
        assert_eq!((of.faces(0), of.faces(1), of.len()), (0..2, 3..5, 2));
        // Clipped ears of a pentagon, in any order.
        assert_eq!(loops(&[0, 0, 0], &[[1, 2, 3], [0, 1, 3], [0, 3, 4]]), [vec![1, 2, 3, 4, 0]]);
    }

    #[test]
    fn what_is_no_disk_is_left_as_it_is() {
        // Without a common edge, one turned over, two that share all corners, and a bow tie.
        for faces in [[[0, 1, 2], [3, 4, 5]], [[0, 1, 2], [0, 3, 2]], [[0, 1, 2], [0, 2, 1]], [[0, 1, 2], [0, 3, 4]]] {
            assert!(loops(&[0, 0], &faces).is_empty(), "{faces:?}");
        }
        assert_eq!(Polygons::new(vec![0, 1, 2]), None);
        assert!(Polygons::new(vec![0, 0]).unwrap().loops(&[[0, 1, 2]]).is_empty());
    }
}
