//! Undirected graphs with weights, as matrices and their coarser pictures have them.

use chladni_base::parallel::*;

use crate::SparseMatrix;

/// Vertices with weights and their neighbours with weights of edges; no vertex is its own neighbour, and every edge is
/// stored from both ends.
pub(super) struct Graph {
    /// Where the neighbours of each vertex begin, and where the last ones end: `vertices + 1` entries.
    pub offsets: Vec<u32>,
    pub neighbours: Vec<u32>,
    /// The weight of the edge to each neighbour: how many edges of the finest graph it stands for.
    pub edge_weights: Vec<u32>,
    /// The weight of each vertex: how many rows of the matrix it stands for.
    pub weights: Vec<u32>,
}

impl Graph {
    /// The rows of a symmetric matrix, each beside those that it has entries for.
    ///
    /// # Panics
    /// Where there are more entries than 32 bits count.
    pub fn of(matrix: &SparseMatrix) -> Self {
        assert!(u32::try_from(matrix.entries()).is_ok(), "{} entries of a graph", matrix.entries());
        let n = matrix.rows();
        let (mut offsets, mut neighbours) = (Vec::with_capacity(n + 1), Vec::with_capacity(matrix.entries()));
        offsets.push(0);
        for row in 0..n {
            neighbours.extend(matrix.row(row).0.iter().filter(|&&column| column as usize != row));
            offsets.push(neighbours.len() as u32);
        }
        let edge_weights = vec![1; neighbours.len()];
        Self { offsets, neighbours, edge_weights, weights: vec![1; n] }
    }

    pub fn len(&self) -> usize {
        self.weights.len()
    }

    pub fn neighbours(&self, vertex: u32) -> &[u32] {
        &self.neighbours[self.range(vertex)]
    }

    /// The neighbours with the weights of the edges to them.
    pub fn edges(&self, vertex: u32) -> impl Iterator<Item = (u32, u32)> {
        let range = self.range(vertex);
        self.neighbours[range.clone()].iter().copied().zip(self.edge_weights[range].iter().copied())
    }

    fn range(&self, vertex: u32) -> std::ops::Range<usize> {
        self.offsets[vertex as usize] as usize..self.offsets[vertex as usize + 1] as usize
    }

    pub fn total_weight(&self) -> u64 {
        self.weights.iter().map(|&w| u64::from(w)).sum()
    }

    /// The subgraphs of the vertices on side 0 and on side 1, with the numbers of their vertices here, ascending. Edges
    /// to other vertices are left out.
    pub fn split(&self, side: &[u8]) -> [(Self, Vec<u32>); 2] {
        let mut local = vec![0u32; self.len()];
        let mut kept = [Vec::new(), Vec::new()];
        let mut entries = [0, 0];
        for (v, &s) in side.iter().enumerate() {
            if let Some(kept) = kept.get_mut(s as usize) {
                local[v] = kept.len() as u32;
                kept.push(v as u32);
                entries[s as usize] += self.neighbours(v as u32).len();
            }
        }
        [0, 1].map(|s| {
            let vertices = std::mem::take(&mut kept[s]);
            let mut graph = Self {
                offsets: Vec::with_capacity(vertices.len() + 1),
                neighbours: Vec::with_capacity(entries[s]),
                edge_weights: Vec::with_capacity(entries[s]),
                weights: vertices.iter().map(|&v| self.weights[v as usize]).collect(),
            };
            graph.offsets.push(0);
            for &v in &vertices {
                for (u, weight) in self.edges(v).filter(|&(u, _)| side[u as usize] == s as u8) {
                    graph.neighbours.push(local[u as usize]);
                    graph.edge_weights.push(weight);
                }
                graph.offsets.push(graph.neighbours.len() as u32);
            }
            (graph, vertices)
        })
    }

    /// Vertices that have the same neighbours and each other, such as the components of a displacement, as one: the
    /// smaller graph with the group of each vertex, where that is smaller by a seventh at least.
    pub fn compressed(&self) -> Option<(Self, Vec<u32>)> {
        let n = self.len();
        // Equal for equal sets of vertices, whatever their order.
        let mut keys: Vec<(u64, u32)> = (0..n as u32)
            .into_par_iter()
            .map(|v| (self.neighbours(v).iter().fold(mix(v), |sum, &u| sum.wrapping_add(mix(u))), v))
            .collect();
        keys.par_sort_unstable();
        let (mut group, mut first) = (vec![u32::MAX; n], Vec::new());
        let mut mark = vec![u32::MAX; n];
        for run in keys.chunk_by(|a, b| a.0 == b.0) {
            for (i, &(_, v)) in run.iter().enumerate() {
                if group[v as usize] != u32::MAX {
                    continue;
                }
                group[v as usize] = first.len() as u32;
                if run.len() > i + 1 {
                    mark[v as usize] = v;
                    self.neighbours(v).iter().for_each(|&u| mark[u as usize] = v);
                    for &(_, u) in &run[i + 1..] {
                        let same = mark[u as usize] == v
                            && self.neighbours(u).len() == self.neighbours(v).len()
                            && self.neighbours(u).iter().all(|&w| mark[w as usize] == v);
                        if same && group[u as usize] == u32::MAX {
                            group[u as usize] = first.len() as u32;
                        }
                    }
                }
                first.push(v);
            }
        }
        if first.len() * 7 > n * 6 {
            return None;
        }
        // Groups in the order of their first vertices.
        let mut by_vertex: Vec<u32> = (0..first.len() as u32).collect();
        by_vertex.sort_unstable_by_key(|&g| first[g as usize]);
        let mut renamed = vec![0u32; first.len()];
        by_vertex.iter().enumerate().for_each(|(new, &g)| renamed[g as usize] = new as u32);
        group.iter_mut().for_each(|g| *g = renamed[*g as usize]);
        let mut weights = vec![0u32; first.len()];
        group.iter().for_each(|&g| weights[g as usize] += 1);
        let mut graph = Self { offsets: vec![0], neighbours: Vec::new(), edge_weights: Vec::new(), weights };
        let mut seen = vec![u32::MAX; first.len()];
        for (g, &old) in by_vertex.iter().enumerate() {
            seen[g] = g as u32;
            for &u in self.neighbours(first[old as usize]) {
                let other = group[u as usize] as usize;
                if std::mem::replace(&mut seen[other], g as u32) != g as u32 {
                    graph.neighbours.push(other as u32);
                    graph.edge_weights.push(1);
                }
            }
            graph.offsets.push(graph.neighbours.len() as u32);
        }
        Some((graph, group))
    }
}

/// A number that looks random, always the same for the same vertex.
pub(super) fn mix(vertex: u32) -> u64 {
    let mut z = u64::from(vertex).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
