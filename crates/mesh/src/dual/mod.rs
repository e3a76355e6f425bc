//! The dual graph of a surface: faces are its nodes, shared edges its edges.
//!
//! Edge `k` of a face lies opposite to its corner `k` and runs from corner `k + 1` to corner `k + 2`. Two neighbours of
//! one orientation run along their shared edge in opposite directions; on a surface that is not orientable some do not.

mod grow;
#[cfg(test)]
mod tests;

pub use grow::DiskGrower;

use chladni_base::parallel::*;

use super::TriangleMesh;
use super::connectivity::Connectivity;
use super::measure::surface_area;
use super::topology::{EdgeTable, MOST_FACES, half_edge, runs_down};

/// No face: beyond a boundary edge.
pub const NO_FACE: u32 = u32::MAX;

/// Why a mesh has no dual graph that fields can live on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DualError {
    /// There are no faces.
    #[error("the mesh has no faces")]
    Empty,
    /// More faces than can be numbered.
    #[error("{faces} faces are more than can be numbered")]
    TooManyFaces {
        /// How many there are.
        faces: usize,
    },
    /// A corner is out of range, or a face repeats a vertex.
    #[error("face {face} refers to vertex {vertex} of {vertices}, or refers to it twice")]
    Face {
        /// The face.
        face: usize,
        /// The vertex.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// An edge has three or more faces.
    #[error("the edge from vertex {from} to vertex {to} has {faces} faces: a field needs a manifold surface")]
    NonManifoldEdge {
        /// The lower vertex.
        from: u32,
        /// The higher vertex.
        to: u32,
        /// How many faces meet there.
        faces: usize,
    },
    /// The faces around a vertex form more than one fan.
    #[error("the faces around vertex {vertex} form more than one fan: a field needs a manifold surface")]
    NonManifoldVertex {
        /// The vertex.
        vertex: u32,
    },
}

/// Where a surface shows that it has no two sides, or that its faces do not agree about them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("faces {} and {} run along the edge from vertex {from} to vertex {to} in the same direction", faces[0], faces[1])]
pub struct OneSided {
    /// The lower vertex.
    pub from: u32,
    /// The higher vertex.
    pub to: u32,
    /// The two faces.
    pub faces: [u32; 2],
}

/// Who is next to whom among the faces of a manifold surface, with or without boundary. It need not be orientable.
#[derive(Debug, Clone, PartialEq)]
pub struct DualGraph {
    neighbours: Vec<[u32; 3]>,
    edges: Vec<[u32; 3]>,
    edge_faces: Vec<[u32; 2]>,
    lengths: Vec<[f32; 3]>,
    first_corners: Vec<u32>,
    vertices: usize,
    /// Whether the neighbour across an edge has the opposite orientation; empty where all have the same.
    mirrored: Vec<[bool; 3]>,
    one_sided: Option<OneSided>,
}

impl DualGraph {
    /// Builds the graph. Lengths of its edges are those of straight lines between barycentres after unfolding the two
    /// faces into a plane, on the surface scaled to unit area.
    ///
    /// # Errors
    /// [`DualError`] names the edge or the vertex at which the mesh is no manifold.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, DualError> {
        let (n, f) = (mesh.positions.len(), mesh.faces.len());
        if f == 0 {
            return Err(DualError::Empty);
        }
        if f > MOST_FACES {
            return Err(DualError::TooManyFaces { faces: f });
        }
        for (face, &[a, b, c]) in mesh.faces.iter().enumerate() {
            if let Some(vertex) = [a, b, c].into_iter().find(|&v| v as usize >= n) {
                return Err(DualError::Face { face, vertex, vertices: n });
            }
            if a == b || b == c || c == a {
                let vertex = if b == c { b } else { a };
                return Err(DualError::Face { face, vertex, vertices: n });
            }
        }
        let mut graph = Self {
            neighbours: vec![[NO_FACE; 3]; f],
            edges: vec![[0; 3]; f],
            edge_faces: Vec::with_capacity(3 * f / 2 + 64),
            lengths: vec![[0.0; 3]; f],
            first_corners: vec![u32::MAX; n],
            vertices: n,
            mirrored: Vec::new(),
            one_sided: None,
        };
        graph.join_faces(mesh)?;
        graph.find_fans(mesh)?;
        graph.measure(mesh);
        Ok(graph)
    }

    fn join_faces(&mut self, mesh: &TriangleMesh) -> Result<(), DualError> {
        let table = EdgeTable::new(mesh.positions.len(), &mesh.faces);
        let mut error = None;
        // The half-edge from corner c on lies opposite to corner c + 2.
        let place = |h: u32| (h / 3, (h as usize % 3 + 2) % 3);
        table.for_each_edge(|from, to, records| {
            if error.is_some() {
                return;
            }
            let edge = self.edge_faces.len() as u32;
            match *records {
                [one] => {
                    let (face, k) = place(half_edge(one));
                    self.edges[face as usize][k] = edge;
                    self.edge_faces.push([face, NO_FACE]);
                }
                [one, two] => {
                    let ((a, i), (b, j)) = (place(half_edge(one)), place(half_edge(two)));
                    if runs_down(one) == runs_down(two) {
                        self.one_sided.get_or_insert(OneSided { from, to, faces: [a.min(b), a.max(b)] });
                        self.mirrored.resize(self.neighbours.len(), [false; 3]);
                        self.mirrored[a as usize][i] = true;
                        self.mirrored[b as usize][j] = true;
                    }
                    self.edges[a as usize][i] = edge;
                    self.edges[b as usize][j] = edge;
                    self.neighbours[a as usize][i] = b;
                    self.neighbours[b as usize][j] = a;
                    self.edge_faces.push([a.min(b), a.max(b)]);
                }
                _ => error = Some(DualError::NonManifoldEdge { from, to, faces: records.len() }),
            }
        });
        error.map_or(Ok(()), Err)
    }

    /// Finds for each vertex the corner that its fan begins at, and vertices with two fans.
    fn find_fans(&mut self, mesh: &TriangleMesh) -> Result<(), DualError> {
        let mut seen = vec![false; 3 * mesh.faces.len()];
        for corner in 0..3 * mesh.faces.len() {
            if seen[corner] {
                continue;
            }
            let vertex = mesh.faces[corner / 3][corner % 3];
            if self.first_corners[vertex as usize] != u32::MAX {
                return Err(DualError::NonManifoldVertex { vertex });
            }
            // Clockwise to the boundary, or once around.
            let mut first = (corner as u32, false);
            while let Some(before) = self.step(mesh, first, false).filter(|before| before.0 != corner as u32) {
                first = before;
            }
            self.first_corners[vertex as usize] = first.0;
            let mut at = Some((first.0, self.begins_turned(first.0)));
            while let Some(here) = at.filter(|here| !seen[here.0 as usize]) {
                seen[here.0 as usize] = true;
                at = self.step(mesh, here, true);
            }
        }
        Ok(())
    }

    /// Whether the fan that begins at a corner runs clockwise as its face sees it: it has to run away from the
    /// boundary.
    fn begins_turned(&self, corner: u32) -> bool {
        let (own, k) = (self.neighbours[corner as usize / 3], corner as usize % 3);
        own[(k + 1) % 3] == NO_FACE && own[(k + 2) % 3] != NO_FACE
    }

    /// The next corner at the same vertex, counter-clockwise or clockwise, as the first face of the fan sees it;
    /// corners are numbered `3 · face + k`, and with each goes whether its face has the opposite orientation.
    fn step(&self, mesh: &TriangleMesh, (corner, turned): (u32, bool), counter_clockwise: bool) -> Option<(u32, bool)> {
        let (face, k) = (corner as usize / 3, corner as usize % 3);
        let vertex = mesh.faces[face][k];
        let across = (k + if counter_clockwise != turned { 1 } else { 2 }) % 3;
        let next = self.neighbours[face][across];
        let at = mesh.faces.get(next as usize)?.iter().position(|&v| v == vertex)?;
        Some((3 * next + at as u32, turned != self.is_mirrored(face, across)))
    }

    /// The corners `3 · face + k` at a vertex, counter-clockwise, and whether they close a circle.
    pub fn fan(&self, mesh: &TriangleMesh, vertex: u32, corners: &mut Vec<u32>) -> bool {
        self.sided_fan(mesh, vertex, corners, |_| {})
    }

    /// The same, with for each corner whether its face has the orientation opposite to that in which the fan runs
    /// counter-clockwise.
    pub fn sided_fan(
        &self,
        mesh: &TriangleMesh,
        vertex: u32,
        corners: &mut Vec<u32>,
        mut turned: impl FnMut(bool),
    ) -> bool {
        corners.clear();
        let Some(&first) = self.first_corners.get(vertex as usize).filter(|&&c| c != u32::MAX) else { return false };
        let mut at = (first, self.begins_turned(first));
        loop {
            corners.push(at.0);
            turned(at.1);
            match self.step(mesh, at, true) {
                Some((next, _)) if next == first => return true,
                // A fan has at most as many corners as there are faces, whatever mesh is passed in.
                Some(next) if corners.len() <= self.faces() => at = next,
                _ => return false,
            }
        }
    }

    fn measure(&mut self, mesh: &TriangleMesh) {
        let area = surface_area(mesh);
        let unit = if area > 0.0 && area.is_finite() { 1.0 / area.sqrt() } else { 1.0 };
        let (neighbours, edges, mirrored) = (&self.neighbours, &self.edges, &self.mirrored);
        self.lengths.par_iter_mut().with_min_len(1 << 12).enumerate().for_each(|(f, lengths)| {
            for k in 0..3 {
                let g = neighbours[f][k];
                if g == NO_FACE {
                    continue;
                }
                let edge = edges[f][k];
                let Some(j) = edges[g as usize].iter().position(|&e| e == edge) else { continue };
                // Along the edge of the lower face, so that both directions get the same number.
                let lower = if (f as u32) < g { (f, k) } else { (g as usize, j) };
                let upper = if (f as u32) < g { (g as usize, j) } else { (f, k) };
                let (s, h) = barycentre(mesh, lower.0, lower.1);
                let (t, i) = barycentre(mesh, upper.0, upper.1);
                let length = edge_length(mesh, lower.0, lower.1);
                // Two faces of one orientation run along their edge in opposite directions.
                let along = if mirrored.get(f).is_some_and(|own| own[k]) { t } else { length - t };
                let straight = (along - s).hypot(h + i) * unit;
                lengths[k] = if straight.is_finite() { straight as f32 } else { 0.0 };
            }
        });
    }

    /// The number of faces.
    #[inline]
    pub fn faces(&self) -> usize {
        self.neighbours.len()
    }

    /// The number of vertices of the mesh.
    #[inline]
    pub fn vertices(&self) -> usize {
        self.vertices
    }

    /// The number of edges of the mesh.
    pub fn edge_count(&self) -> usize {
        self.edge_faces.len()
    }

    /// The faces across the three edges of a face, [`NO_FACE`] at a boundary.
    #[inline]
    pub fn neighbours(&self, face: usize) -> [u32; 3] {
        self.neighbours[face]
    }

    /// The numbers of the three edges of a face.
    #[inline]
    pub fn edges(&self, face: usize) -> [u32; 3] {
        self.edges[face]
    }

    /// The faces of each edge, ascending; the second is [`NO_FACE`] at a boundary.
    #[inline]
    pub fn edge_faces(&self) -> &[[u32; 2]] {
        &self.edge_faces
    }

    /// The lengths of the dual edges from a face to its neighbours, in units of the square root of the surface's area.
    #[inline]
    pub fn lengths(&self, face: usize) -> [f32; 3] {
        self.lengths[face]
    }

    /// Whether the neighbour across edge `k` of a face has the opposite orientation: both run along that edge in the
    /// same direction.
    #[inline]
    pub fn is_mirrored(&self, face: usize, k: usize) -> bool {
        self.mirrored.get(face).is_some_and(|own| own[k])
    }

    /// Whether all faces agree about the sides of the surface.
    ///
    /// # Errors
    /// [`OneSided`] names the first edge where they do not.
    pub fn oriented(&self) -> Result<(), OneSided> {
        self.one_sided.map_or(Ok(()), Err)
    }

    /// Which edge of `neighbour` is edge `edge` of the mesh.
    pub fn slot(&self, neighbour: u32, edge: u32) -> usize {
        let edges = self.edges[neighbour as usize];
        if edges[0] == edge {
            0
        } else if edges[1] == edge {
            1
        } else {
            2
        }
    }

    /// Whether every edge has two faces.
    pub fn is_closed(&self) -> bool {
        self.edge_faces.iter().all(|f| f[1] != NO_FACE)
    }

    /// `V − E + F`, without vertices that no face uses.
    pub fn euler_characteristic(&self) -> i64 {
        let used = self.first_corners.iter().filter(|&&c| c != u32::MAX).count();
        used as i64 - self.edge_faces.len() as i64 + self.faces() as i64
    }

    /// For each face the number of its component, components numbered by their first face, and how many there are.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut component = vec![u32::MAX; self.faces()];
        let mut stack = Vec::new();
        let mut count = 0;
        for start in 0..self.faces() {
            if component[start] != u32::MAX {
                continue;
            }
            component[start] = count;
            stack.push(start as u32);
            while let Some(face) = stack.pop() {
                for g in self.neighbours[face as usize] {
                    if g != NO_FACE && component[g as usize] == u32::MAX {
                        component[g as usize] = count;
                        stack.push(g);
                    }
                }
            }
            count += 1;
        }
        (component, count as usize)
    }

    /// The same graph with lengths times the mean weight of the two faces: where weights are large, distances are, so
    /// that samples lie denser and disks are smaller (thesis, section 3.4, adaptive subspaces).
    ///
    /// `None` unless there is one positive finite weight for each face.
    pub fn weighted(&self, weights: &[f64]) -> Option<Self> {
        if weights.len() != self.faces() || !weights.iter().all(|w| w.is_finite() && *w > 0.0) {
            return None;
        }
        let mut graph = self.clone();
        for (f, lengths) in graph.lengths.iter_mut().enumerate() {
            for k in 0..3 {
                let g = self.neighbours[f][k];
                if g != NO_FACE {
                    lengths[k] = (f64::from(lengths[k]) * 0.5 * (weights[f] + weights[g as usize])) as f32;
                }
            }
        }
        Some(graph)
    }

    /// The graph as what samplers walk on: its nodes are the faces.
    pub fn connectivity(&self) -> Connectivity {
        let mut offsets = Vec::with_capacity(self.faces() + 1);
        let (mut neighbours, mut lengths) = (Vec::new(), Vec::new());
        offsets.push(0);
        for (own, own_lengths) in self.neighbours.iter().zip(&self.lengths) {
            let mut links: Vec<(u32, f32)> =
                own.iter().copied().zip(own_lengths.iter().copied()).filter(|l| l.0 != NO_FACE).collect();
            links.sort_unstable_by_key(|l| l.0);
            for (neighbour, length) in links {
                neighbours.push(neighbour);
                lengths.push(f64::from(length));
            }
            offsets.push(neighbours.len() as u32);
        }
        Connectivity::from_graph(offsets, neighbours, lengths)
    }
}

/// Where the barycentre of a face lies over its edge `k`: along the edge from its start, and above it.
fn barycentre(mesh: &TriangleMesh, face: usize, k: usize) -> (f64, f64) {
    let [apex, from, to] = std::array::from_fn(|i| mesh.point(mesh.faces[face][(k + i) % 3]));
    let (e, u) = (to - from, apex - from);
    let length = e.norm();
    if !(length > 0.0) {
        return (0.0, u.norm() / 3.0);
    }
    let along = u.dot(e) / length;
    let above = u.cross(e).norm() / length;
    ((along + length) / 3.0, above / 3.0)
}

fn edge_length(mesh: &TriangleMesh, face: usize, k: usize) -> f64 {
    let [from, to] = [1, 2].map(|i| mesh.point(mesh.faces[face][(k + i) % 3]));
    (to - from).norm()
}
