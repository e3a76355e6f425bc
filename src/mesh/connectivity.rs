//! Who is next to whom: the edge graph with lengths, and the faces around each vertex.

use rayon::prelude::*;

use super::TriangleMesh;

/// The edge graph of a mesh (both directions stored, neighbours ascending) and the faces around each vertex.
#[derive(Debug, Clone, PartialEq)]
pub struct Connectivity {
    vertex_offsets: Vec<u32>,
    neighbours: Vec<u32>,
    lengths: Vec<f64>,
    face_offsets: Vec<u32>,
    faces_around: Vec<u32>,
}

impl Connectivity {
    /// Builds both tables; edge lengths are in the units of `mesh`.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let n = mesh.positions.len();
        let mut face_offsets = vec![0u32; n + 1];
        for face in &mesh.faces {
            for &v in face {
                face_offsets[v as usize + 1] += 1;
            }
        }
        for v in 0..n {
            face_offsets[v + 1] += face_offsets[v];
        }
        let mut next = face_offsets.clone();
        let mut faces_around = vec![0u32; 3 * mesh.faces.len()];
        for (f, face) in mesh.faces.iter().enumerate() {
            for &v in face {
                faces_around[next[v as usize] as usize] = f as u32;
                next[v as usize] += 1;
            }
        }
        let mut vertex_offsets = Vec::with_capacity(n + 1);
        vertex_offsets.push(0u32);
        let mut neighbours = Vec::with_capacity(6 * n);
        let mut lengths = Vec::with_capacity(6 * n);
        let mut ring: Vec<u32> = Vec::new();
        for v in 0..n {
            ring.clear();
            for &f in &faces_around[face_offsets[v] as usize..face_offsets[v + 1] as usize] {
                ring.extend(mesh.faces[f as usize].iter().copied().filter(|&w| w as usize != v));
            }
            ring.sort_unstable();
            ring.dedup();
            for &w in &ring {
                let (p, q) = (mesh.positions[v], mesh.positions[w as usize]);
                neighbours.push(w);
                lengths.push(((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2) + (p[2] - q[2]).powi(2)).sqrt());
            }
            vertex_offsets.push(neighbours.len() as u32);
        }
        Self { vertex_offsets, neighbours, lengths, face_offsets, faces_around }
    }

    /// The number of vertices.
    pub fn vertices(&self) -> usize {
        self.vertex_offsets.len() - 1
    }

    /// The neighbours of a vertex, ascending, and the lengths of the edges to them.
    pub fn neighbours(&self, vertex: u32) -> (&[u32], &[f64]) {
        let range = self.vertex_offsets[vertex as usize] as usize..self.vertex_offsets[vertex as usize + 1] as usize;
        (&self.neighbours[range.clone()], &self.lengths[range])
    }

    /// The faces around a vertex, ascending.
    pub fn faces_around(&self, vertex: u32) -> &[u32] {
        &self.faces_around[self.face_offsets[vertex as usize] as usize..self.face_offsets[vertex as usize + 1] as usize]
    }

    /// Where the edges of a vertex lie in [`all_neighbours`](Self::all_neighbours) and
    /// [`scaled_lengths`](Self::scaled_lengths).
    pub fn edge_range(&self, vertex: u32) -> std::ops::Range<usize> {
        self.vertex_offsets[vertex as usize] as usize..self.vertex_offsets[vertex as usize + 1] as usize
    }

    /// The neighbours of all vertices, one vertex after another.
    pub fn all_neighbours(&self) -> &[u32] {
        &self.neighbours
    }

    /// The lengths of the edges to [`all_neighbours`](Self::all_neighbours), in multiples of `unit`, in single precision. A unit
    /// that is not a positive number counts as 1.
    pub fn scaled_lengths(&self, unit: f64) -> Vec<f32> {
        let scale = if unit > 0.0 && unit.is_finite() { 1.0 / unit } else { 1.0 };
        self.lengths.par_iter().with_min_len(1 << 14).map(|&l| (l * scale) as f32).collect()
    }

    /// Where the faces of a vertex lie in the list of all vertices' faces, which has three entries per face.
    pub fn face_range(&self, vertex: u32) -> std::ops::Range<usize> {
        self.face_offsets[vertex as usize] as usize..self.face_offsets[vertex as usize + 1] as usize
    }

    /// The mean length of edges; 0 without edges.
    pub fn mean_edge(&self) -> f64 {
        // Pieces of a fixed size, so that the sum does not depend on the number of threads.
        let sums: Vec<f64> = self.lengths.par_chunks(1 << 14).map(|piece| piece.iter().sum()).collect();
        sums.iter().sum::<f64>() / self.lengths.len().max(1) as f64
    }

    /// The length of the longest edge; 0 without edges.
    pub fn longest_edge(&self) -> f64 {
        self.lengths.par_iter().with_min_len(1 << 14).copied().reduce(|| 0.0, f64::max)
    }
}
