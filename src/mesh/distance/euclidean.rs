//! Straight-line distances over the part of the ball that is connected to its centre.

use super::{DistanceGeometry, DistanceWorkspace};

impl DistanceWorkspace {
    /// The value does not depend on the path, so the region may be flooded in any order: no queue is needed.
    pub(super) fn euclidean(&mut self, geometry: &DistanceGeometry, source: u32, radius: f32) {
        let (positions, connectivity) = (&geometry.mesh.positions, geometry.connectivity);
        let centre = positions[source as usize];
        let scale = 1.0 / geometry.unit;
        let seen = self.open(0.0);
        self.state[source as usize] = seen;
        self.reached.push((source, 0.0));
        let mut next = 0;
        while next < self.reached.len() {
            let v = self.reached[next].0;
            next += 1;
            for &w in &connectivity.all_neighbours()[connectivity.edge_range(v)] {
                if self.state[w as usize] == seen {
                    continue;
                }
                self.state[w as usize] = seen;
                let p = positions[w as usize];
                let (x, y, z) = ((p[0] - centre[0]) * scale, (p[1] - centre[1]) * scale, (p[2] - centre[2]) * scale);
                let distance = (x * x + y * y + z * z).sqrt() as f32;
                if distance <= radius {
                    self.reached.push((w, distance));
                }
            }
        }
    }
}
