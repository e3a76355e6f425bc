//! Straight-line distances over the part of the ball that is connected to its centre.

use chladni_base::Vector3;

use super::{DistanceGeometry, DistanceWorkspace};

/// A vertex as the flood sees it: one load answers both whether it is new and where it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct FloodVertex {
    /// In multiples of the geometry's unit, relative to the middle of the mesh.
    position: [f32; 3],
    stamp: u32,
}

/// The vertices of a mesh, none of them visited.
pub(super) fn flood_vertices(geometry: &DistanceGeometry) -> Vec<FloodVertex> {
    let positions = geometry.mesh.points();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let middle = 0.5 * Vector3(low) + 0.5 * Vector3(high);
    let scale = 1.0 / geometry.unit;
    let unvisited = |&p: &Vector3| FloodVertex { position: ((p - middle) * scale).map(|x| x as f32), stamp: 0 };
    positions.iter().map(unvisited).collect()
}

impl DistanceWorkspace {
    /// The value does not depend on the path, so the region may be flooded in any order: no queue is needed.
    pub(super) fn euclidean(&mut self, geometry: &DistanceGeometry, source: u32, radius: f32) {
        let connectivity = geometry.connectivity;
        let neighbours = connectivity.all_neighbours();
        if self.flood_vertices.len() != connectivity.vertices() {
            self.flood_vertices = flood_vertices(geometry);
            self.flood = vec![(0, 0.0); connectivity.vertices() + 1];
        }
        let (vertices, flood, stamp) = (&mut self.flood_vertices[..], &mut self.flood[..], self.stamp);
        let centre = vertices[source as usize].position;
        vertices[source as usize].stamp = stamp;
        // Every vertex is written to the end of the list and stays there if it is new and near: a branch on that would
        // be guessed wrong half of the time. One place more than there are vertices takes the last one that does not
        // stay.
        flood[0] = (source, 0.0);
        let (mut next, mut end) = (0, 1);
        let square = radius * radius;
        while next < end {
            let v = flood[next].0;
            next += 1;
            for &w in &neighbours[connectivity.edge_range(v)] {
                let vertex = &mut vertices[w as usize];
                let [x, y, z]: [f32; 3] = std::array::from_fn(|k| vertex.position[k] - centre[k]);
                let distance = x * x + y * y + z * z;
                flood[end] = (w, distance);
                end += usize::from(vertex.stamp != stamp && distance <= square);
                vertex.stamp = stamp;
            }
        }
        self.reached.extend(flood[..end].iter().map(|&(v, square)| (v, square.sqrt())));
    }
}
