//! Distances along edges.

use super::DistanceWorkspace;
use crate::connectivity::Connectivity;

impl DistanceWorkspace {
    pub(super) fn dijkstra(&mut self, connectivity: &Connectivity, lengths: &[f32], source: u32, radius: f32) {
        self.offer(source, 0.0);
        while let Some((v, distance)) = self.settle() {
            let range = connectivity.edge_range(v);
            for (&w, &length) in connectivity.all_neighbours()[range.clone()].iter().zip(&lengths[range]) {
                let through = distance + length;
                if through <= radius {
                    self.offer(w, through);
                }
            }
        }
    }
}
