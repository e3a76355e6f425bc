//! Who is next to whom: the edge graph with lengths, and the faces around each vertex.

use std::sync::atomic::{AtomicU32, Ordering};

use chladni_base::Vector3;
use chladni_base::parallel::*;

use super::{TetMesh, TriangleMesh};

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
    /// Builds both tables, in parallel; edge lengths are in the units of `mesh`.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let (face_offsets, faces_around) = faces_around(mesh);
        // Blocks of vertices find their neighbours independently; then everyone knows where to write.
        let n = mesh.positions.len();
        let blocks: Vec<Block> = (0..n.div_ceil(BLOCK))
            .into_par_iter()
            .map(|b| Block::new(mesh, b * BLOCK..((b + 1) * BLOCK).min(n), &face_offsets, &faces_around))
            .collect();
        let edges = blocks.iter().map(|b| b.neighbours.len()).sum();
        let mut vertex_offsets = Vec::with_capacity(n + 1);
        vertex_offsets.push(0u32);
        let (mut neighbours, mut lengths) = (vec![0u32; edges], vec![0f64; edges]);
        let (mut rest, mut rest_lengths) = (&mut neighbours[..], &mut lengths[..]);
        let mut parts = Vec::with_capacity(blocks.len());
        let mut base = 0;
        for block in &blocks {
            vertex_offsets.extend(block.ends.iter().map(|end| base + end));
            base += block.neighbours.len() as u32;
            let (part, tail) = rest.split_at_mut(block.neighbours.len());
            let (part_lengths, tail_lengths) = rest_lengths.split_at_mut(block.neighbours.len());
            parts.push((block, part, part_lengths));
            (rest, rest_lengths) = (tail, tail_lengths);
        }
        parts.into_par_iter().for_each(|(block, part, part_lengths)| {
            part.copy_from_slice(&block.neighbours);
            part_lengths.copy_from_slice(&block.lengths);
        });
        Self { vertex_offsets, neighbours, lengths, face_offsets, faces_around }
    }

    /// Forgets which faces lie around each vertex: distances along edges do not ask, and of millions of vertices they
    /// are a quarter of it all.
    pub fn forget_faces(&mut self) {
        self.face_offsets = vec![0; self.vertex_offsets.len()];
        self.faces_around = Vec::new();
    }

    /// The edges alone: where those of each vertex begin and end, their other ends, ascending, and their lengths.
    pub fn into_edges(self) -> (Vec<u32>, Vec<u32>, Vec<f64>) {
        (self.vertex_offsets, self.neighbours, self.lengths)
    }

    /// The edges of a solid. There are no faces.
    pub fn of_solid(solid: &TetMesh) -> Self {
        let mut pairs: Vec<u64> = Vec::with_capacity(12 * solid.tetrahedra.len());
        for corners in &solid.tetrahedra {
            for &a in corners {
                pairs.extend(corners.iter().filter(|&&b| b != a).map(|&b| u64::from(a) << 32 | u64::from(b)));
            }
        }
        pairs.par_sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0u32; solid.positions.len() + 1];
        pairs.iter().for_each(|&pair| offsets[(pair >> 32) as usize + 1] += 1);
        for v in 0..solid.positions.len() {
            offsets[v + 1] += offsets[v];
        }
        let length = |&pair: &u64| {
            let [p, q] = [(pair >> 32) as usize, pair as u32 as usize].map(|v| Vector3(solid.positions[v]));
            (p - q).norm()
        };
        let lengths = pairs.par_iter().map(length).collect();
        Self::from_graph(offsets, pairs.iter().map(|&pair| pair as u32).collect(), lengths)
    }

    /// A graph without faces. `offsets` are where the edges of each vertex begin and end.
    pub(super) fn from_graph(offsets: Vec<u32>, neighbours: Vec<u32>, lengths: Vec<f64>) -> Self {
        let face_offsets = vec![0; offsets.len()];
        Self { vertex_offsets: offsets, neighbours, lengths, face_offsets, faces_around: Vec::new() }
    }

    /// The number of vertices.
    #[inline]
    pub fn vertices(&self) -> usize {
        self.vertex_offsets.len() - 1
    }

    /// The neighbours of a vertex, ascending, and the lengths of the edges to them.
    #[inline]
    pub fn neighbours(&self, vertex: u32) -> (&[u32], &[f64]) {
        let range = self.vertex_offsets[vertex as usize] as usize..self.vertex_offsets[vertex as usize + 1] as usize;
        (&self.neighbours[range.clone()], &self.lengths[range])
    }

    /// The faces around a vertex, ascending.
    #[inline]
    pub fn faces_around(&self, vertex: u32) -> &[u32] {
        &self.faces_around[self.face_offsets[vertex as usize] as usize..self.face_offsets[vertex as usize + 1] as usize]
    }

    /// Where the edges of a vertex lie in [`all_neighbours`](Self::all_neighbours) and
    /// [`scaled_lengths`](Self::scaled_lengths).
    #[inline]
    pub fn edge_range(&self, vertex: u32) -> std::ops::Range<usize> {
        self.vertex_offsets[vertex as usize] as usize..self.vertex_offsets[vertex as usize + 1] as usize
    }

    /// The neighbours of all vertices, one vertex after another.
    #[inline]
    pub fn all_neighbours(&self) -> &[u32] {
        &self.neighbours
    }

    /// The lengths of the edges to [`all_neighbours`](Self::all_neighbours), in multiples of `unit`, in single
    /// precision. A unit that is not a positive number counts as 1.
    pub fn scaled_lengths(&self, unit: f64) -> Vec<f32> {
        let scale = if unit > 0.0 && unit.is_finite() { 1.0 / unit } else { 1.0 };
        self.lengths.par_iter().with_min_len(1 << 14).map(|&l| (l * scale) as f32).collect()
    }

    /// Where the faces of a vertex lie in the list of all vertices' faces, which has three entries per face.
    #[inline]
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

/// Vertices that find their neighbours at a time.
const BLOCK: usize = 1 << 12;

/// Ranges of faces that are counted at once, at most: each takes a count per vertex.
const RANGES_MAX: usize = 8;

/// Where the faces around each vertex begin and end, and these faces, ascending.
fn faces_around(mesh: &TriangleMesh) -> (Vec<u32>, Vec<u32>) {
    let n = mesh.positions.len();
    let ranges = rayon::current_num_threads().min(RANGES_MAX);
    let length = mesh.faces.len().div_ceil(ranges).max(1);
    let mut places: Vec<Vec<u32>> = mesh
        .faces
        .par_chunks(length)
        .map(|faces| {
            let mut counts = vec![0u32; n];
            faces.iter().flatten().for_each(|&v| counts[v as usize] += 1);
            counts
        })
        .collect();
    let mut offsets = Vec::with_capacity(n + 1);
    let mut total = 0;
    offsets.push(0u32);
    for v in 0..n {
        for counts in &mut places {
            let count = std::mem::replace(&mut counts[v], total);
            total += count;
        }
        offsets.push(total);
    }
    // Ranges write to different places around the same vertices; atomic cells allow that, and relaxed stores cost
    // nothing.
    let around: Vec<AtomicU32> = (0..3 * mesh.faces.len()).map(|_| AtomicU32::new(0)).collect();
    mesh.faces.par_chunks(length).zip(&mut places).enumerate().for_each(|(range, (faces, places))| {
        for (f, face) in faces.iter().enumerate() {
            for &v in face {
                let place = &mut places[v as usize];
                around[*place as usize].store((range * length + f) as u32, Ordering::Relaxed);
                *place += 1;
            }
        }
    });
    (offsets, around.into_iter().map(AtomicU32::into_inner).collect())
}

/// The neighbours of a range of vertices.
struct Block {
    /// Where the neighbours of each vertex end.
    ends: Vec<u32>,
    neighbours: Vec<u32>,
    lengths: Vec<f64>,
}

impl Block {
    fn new(mesh: &TriangleMesh, vertices: std::ops::Range<usize>, face_offsets: &[u32], faces_around: &[u32]) -> Self {
        let mut ends = Vec::with_capacity(vertices.len());
        let mut neighbours = Vec::with_capacity(7 * vertices.len());
        let mut lengths = Vec::with_capacity(7 * vertices.len());
        let mut ring: Vec<u32> = Vec::new();
        for v in vertices {
            ring.clear();
            for &f in &faces_around[face_offsets[v] as usize..face_offsets[v + 1] as usize] {
                ring.extend(mesh.faces[f as usize].iter().copied().filter(|&w| w as usize != v));
            }
            ring.sort_unstable();
            ring.dedup();
            let p = mesh.positions[v];
            for &w in &ring {
                let q = mesh.positions[w as usize];
                neighbours.push(w);
                lengths.push(((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2) + (p[2] - q[2]).powi(2)).sqrt());
            }
            ends.push(neighbours.len() as u32);
        }
        Self { ends, neighbours, lengths }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{grid, sphere};

    #[test]
    fn edges_and_faces_are_those_of_the_mesh() {
        let mesh = sphere(30);
        let connectivity = Connectivity::new(&mesh);
        assert_eq!(connectivity.vertices(), mesh.positions.len());
        let mut edges = std::collections::BTreeSet::new();
        for (f, face) in mesh.faces.iter().enumerate() {
            for i in 0..3 {
                let (a, b) = (face[i], face[(i + 1) % 3]);
                edges.extend([(a, b), (b, a)]);
                assert!(connectivity.faces_around(a).contains(&(f as u32)));
            }
        }
        let mut found = Vec::new();
        for v in 0..connectivity.vertices() as u32 {
            let (neighbours, lengths) = connectivity.neighbours(v);
            for (&w, &length) in neighbours.iter().zip(lengths) {
                let straight = (mesh.point(v) - mesh.point(w)).norm();
                assert!((length - straight).abs() < 1e-15);
                found.push((v, w));
            }
            assert!(connectivity.faces_around(v).is_sorted());
        }
        assert!(found.iter().eq(&edges), "ascending, each direction once");
        assert_eq!(
            (0..connectivity.vertices() as u32).map(|v| connectivity.face_range(v).len()).sum::<usize>(),
            3 * mesh.faces.len()
        );
    }

    #[test]
    fn edges_of_a_solid_are_those_of_its_tetrahedra() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0], [1.0, 1.0, 1.0], [9.0; 3]];
        let solid = TetMesh { positions, tetrahedra: vec![[0, 1, 2, 3], [4, 3, 2, 1]] };
        let graph = Connectivity::of_solid(&solid);
        assert_eq!((graph.vertices(), graph.neighbours(5).0.len()), (6, 0));
        assert_eq!(graph.neighbours(0), (&[1, 2, 3][..], &[1.0, 2.0, 3.0][..]));
        assert_eq!(graph.neighbours(2).0, [0, 1, 3, 4]);
        assert_eq!(graph.neighbours(4).0, [1, 2, 3]);
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let mesh = grid(80);
        let expected = Connectivity::new(&mesh);
        for threads in [1, 2, 3, 16] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(|| Connectivity::new(&mesh)), expected);
        }
    }

    #[test]
    fn nothing_and_lone_vertices_have_no_neighbours() {
        assert_eq!(Connectivity::new(&TriangleMesh::default()).vertices(), 0);
        let lone =
            Connectivity::new(&TriangleMesh { positions: vec![[0.0; 3]; 3], faces: vec![], ..Default::default() });
        assert_eq!((lone.vertices(), lone.neighbours(1).0.len(), lone.faces_around(2).len()), (3, 0, 0));
        assert_eq!((lone.mean_edge(), lone.longest_edge()), (0.0, 0.0));
    }
}
