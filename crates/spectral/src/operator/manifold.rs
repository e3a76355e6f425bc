//! Whether the faces around each vertex and edge make a surface, and where that surface ends.

use chladni_base::parallel::*;

use super::corners::Corners;

/// Vertices that one task looks at.
const VERTICES_PER_TASK: usize = 8192;

/// What is not a manifold, and the boundary.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct ManifoldCheck {
    /// Edges with three or more faces.
    pub non_manifold_edges: usize,
    /// Vertices whose faces form several fans, though none of their edges has three or more faces.
    pub non_manifold_vertices: usize,
    /// The vertices on edges with one face, ascending.
    pub boundary: Vec<u32>,
}

impl ManifoldCheck {
    /// Looks at the link of every vertex. Faces that repeat a vertex are left out: they are no part of a surface.
    pub fn new(vertices: usize, faces: &[[u32; 3]], corners: &Corners) -> Self {
        let parts: Vec<Self> = (0..vertices.div_ceil(VERTICES_PER_TASK))
            .into_par_iter()
            .map(|task| {
                let mut part = Self::default();
                let mut link = Link::default();
                for v in task * VERTICES_PER_TASK..vertices.min((task + 1) * VERTICES_PER_TASK) {
                    let around = corners.on(v);
                    if !is_closed_fan(faces, around) {
                        link.read(faces, around, v as u32);
                        link.judge(v as u32, &mut part);
                    }
                }
                part
            })
            .collect();
        let mut all = Self::default();
        for part in parts {
            all.non_manifold_edges += part.non_manifold_edges;
            all.non_manifold_vertices += part.non_manifold_vertices;
            all.boundary.extend(part.boundary);
        }
        all
    }
}

/// The two other vertices of a corner's face, in the order of the face.
fn others(faces: &[[u32; 3]], corner: u32) -> (u32, u32) {
    let (face, k) = (faces[corner as usize / 3], corner as usize % 3);
    (face[(k + 1) % 3], face[(k + 2) % 3])
}

/// Whether the faces form one closed fan, all of one orientation: so it is at nearly every vertex, and that is soon
/// seen.
fn is_closed_fan(faces: &[[u32; 3]], around: &[u32]) -> bool {
    const LONGEST: usize = 12;
    if around.is_empty() || around.len() > LONGEST {
        return false;
    }
    let mut ends = [(0, 0); LONGEST];
    for (end, &corner) in ends.iter_mut().zip(around) {
        *end = others(faces, corner);
    }
    let ends = &ends[..around.len()];
    let mut at = ends[0].1;
    for _ in 1..ends.len() {
        if at == ends[0].0 {
            return false;
        }
        match ends.iter().find(|end| end.0 == at) {
            Some(next) => at = next.1,
            None => return false,
        }
    }
    at == ends[0].0
}

/// The link of a vertex: a graph of its neighbours, with an edge for each face.
#[derive(Default)]
struct Link {
    neighbours: Vec<u32>,
    edges: Vec<(u32, u32)>,
    /// Faces at the edge to each neighbour.
    degrees: Vec<u32>,
    parents: Vec<u32>,
}

impl Link {
    fn read(&mut self, faces: &[[u32; 3]], around: &[u32], vertex: u32) {
        self.edges.clear();
        let pairs = around.iter().map(|&corner| others(faces, corner));
        self.edges.extend(pairs.filter(|&(a, b)| a != b && a != vertex && b != vertex));
        self.neighbours.clear();
        self.neighbours.extend(self.edges.iter().flat_map(|&(a, b)| [a, b]));
        self.neighbours.sort_unstable();
        self.neighbours.dedup();
        self.degrees.clear();
        self.degrees.resize(self.neighbours.len(), 0);
        self.parents.clear();
        self.parents.extend(0..self.neighbours.len() as u32);
    }

    fn root(&mut self, mut member: u32) -> u32 {
        while self.parents[member as usize] != member {
            let grandparent = self.parents[self.parents[member as usize] as usize];
            self.parents[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    fn judge(&mut self, vertex: u32, found: &mut ManifoldCheck) {
        let mut fans = self.neighbours.len();
        for e in 0..self.edges.len() {
            let place = |v| self.neighbours.binary_search(&v).unwrap_or(0) as u32;
            let (a, b) = (place(self.edges[e].0), place(self.edges[e].1));
            self.degrees[a as usize] += 1;
            self.degrees[b as usize] += 1;
            let (a, b) = (self.root(a), self.root(b));
            if a != b {
                self.parents[a.max(b) as usize] = a.min(b);
                fans -= 1;
            }
        }
        let mut crowded = false;
        for (&neighbour, &degree) in self.neighbours.iter().zip(&self.degrees) {
            crowded |= degree > 2;
            // Each edge is seen from both its ends.
            found.non_manifold_edges += usize::from(degree > 2 && vertex < neighbour);
        }
        found.non_manifold_vertices += usize::from(!crowded && fans > 1);
        if self.degrees.contains(&1) {
            found.boundary.push(vertex);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::{grid, sphere};

    fn topology(vertices: usize, faces: &[[u32; 3]]) -> ManifoldCheck {
        ManifoldCheck::new(vertices, faces, &Corners::new(vertices, faces).unwrap())
    }

    #[test]
    fn a_sphere_is_a_manifold_without_boundary() {
        let mesh = sphere(20);
        assert_eq!(topology(mesh.positions.len(), &mesh.faces), ManifoldCheck::default());
        // Orientation does not matter.
        let mut turned = mesh.faces;
        turned.iter_mut().step_by(3).for_each(|face| face.swap(0, 2));
        assert_eq!(topology(mesh.positions.len(), &turned), ManifoldCheck::default());
    }

    #[test]
    fn the_boundary_of_a_square_is_its_rim() {
        let mesh = grid(6);
        let found = topology(36, &mesh.faces);
        let rim = |v: &u32| [0, 5].contains(&(v % 6)) || [0, 5].contains(&(v / 6));
        assert_eq!(found.boundary, (0..36).filter(rim).collect::<Vec<u32>>());
        assert_eq!((found.non_manifold_edges, found.non_manifold_vertices), (0, 0));
    }

    #[test]
    fn pages_of_a_book_and_cones_that_touch_are_found() {
        let book = topology(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert_eq!((book.non_manifold_edges, book.non_manifold_vertices), (1, 0));
        assert_eq!(book.boundary, [0, 1, 2, 3, 4]);
        let cones = topology(7, &[[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 4, 5], [0, 5, 6], [0, 6, 4]]);
        assert_eq!((cones.non_manifold_edges, cones.non_manifold_vertices), (0, 1));
        assert_eq!(cones.boundary, [1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn repeated_vertices_duplicates_and_lone_vertices_are_judged_as_they_are() {
        let found = topology(8, &[[0, 1, 2], [0, 0, 5], [6, 6, 6]]);
        assert_eq!(found, ManifoldCheck { boundary: vec![0, 1, 2], ..ManifoldCheck::default() });
        // A pillow: closed.
        assert_eq!(topology(3, &[[0, 1, 2], [0, 2, 1]]), ManifoldCheck::default());
        assert_eq!(topology(3, &[[0, 1, 2], [0, 1, 2], [0, 1, 2]]).non_manifold_edges, 3);
    }
}
