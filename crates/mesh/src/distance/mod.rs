//! Distances from one vertex to those around it, out to a radius.
//!
//! A [`DistanceGeometry`] holds what one kind of distance needs of a mesh and is shared between threads; a
//! [`DistanceWorkspace`] holds what one thread writes to, and is used again for source after source without being
//! cleared.

mod dijkstra;
mod euclidean;
mod exact;
mod fast_marching;
mod queue;
mod stvd;

use super::TriangleMesh;
use super::connectivity::Connectivity;

pub use exact::ExactGeodesics;
pub(super) use queue::Queue;

/// How the distance from a source to the vertices around it is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = StepDistance))]
#[serde(rename_all = "snake_case")]
pub enum DistanceKind {
    /// Along edges: 4 to 8 % too long, by a different amount in each direction.
    Dijkstra,
    /// In a straight line through space, over the vertices that edges connect to the source within the ball: the
    /// thesis' choice (Nasikun et al. 2018, section 4).
    #[default]
    Euclidean,
    /// Short-term vector Dijkstra (Campen et al. 2013): the last `window` edges of a path are unfolded into the plane
    /// and replaced by the straight line between their ends. A window of 1 is Dijkstra.
    Stvd {
        /// How many edges are unfolded at most; 3 and 6 in the thesis. At most [`STVD_WINDOW_MAX`] are used.
        #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 64, example = 6))]
        window: u32,
    },
    /// Triangle by triangle from the virtual source in the plane (Novotni and Klein 2002), in order of distance: the
    /// most exact of the four.
    FastMarching,
}

/// The longest useful window of [`DistanceKind::Stvd`].
pub const STVD_WINDOW_MAX: u32 = 64;

/// What one kind of distance needs of a mesh, in single precision relative to a unit of length, so that meshes of any
/// scale are treated alike.
pub struct DistanceGeometry<'a> {
    mesh: &'a TriangleMesh,
    connectivity: &'a Connectivity,
    unit: f64,
    /// The mean and the largest edge length, in multiples of the unit.
    edges: (f32, f32),
    prepared: Prepared,
}

enum Prepared {
    Dijkstra { lengths: Vec<f32> },
    Euclidean,
    Stvd { lengths: Vec<f32>, normals: Vec<[f32; 3]>, window: u32 },
    FastMarching { corners: Vec<fast_marching::Corner> },
}

impl<'a> DistanceGeometry<'a> {
    /// Prepares a mesh for distances of one kind, all of them measured in multiples of `unit`: a positive length in the
    /// units of the mesh, best of the order of the radii that will be asked for.
    pub fn new(mesh: &'a TriangleMesh, connectivity: &'a Connectivity, kind: DistanceKind, unit: f64) -> Self {
        let prepared = match kind {
            DistanceKind::Dijkstra => Prepared::Dijkstra { lengths: connectivity.scaled_lengths(unit) },
            DistanceKind::Euclidean => Prepared::Euclidean,
            DistanceKind::Stvd { window } => Prepared::Stvd {
                lengths: connectivity.scaled_lengths(unit),
                normals: stvd::vertex_normals(mesh, connectivity),
                window: window.clamp(1, STVD_WINDOW_MAX),
            },
            DistanceKind::FastMarching => {
                Prepared::FastMarching { corners: fast_marching::corners(mesh, connectivity, unit) }
            }
        };
        let edges = ((connectivity.mean_edge() / unit) as f32, (connectivity.longest_edge() / unit) as f32);
        Self { mesh, connectivity, unit, edges, prepared }
    }

    /// The length that distances are multiples of.
    pub fn unit(&self) -> f64 {
        self.unit
    }
}

/// What one thread writes to while it measures distances: `O(n)` memory, never cleared between sources.
pub struct DistanceWorkspace {
    /// Per vertex `stamp · 2³² + bits of the distance`. Stamps fall from run to run, so an entry of this run is smaller
    /// than one of an earlier run, and a shorter distance smaller than a longer one: one comparison answers "is this
    /// better than what is there".
    state: Vec<u64>,
    stamp: u32,
    queue: Queue,
    paths: Vec<stvd::Step>,
    flood_vertices: Vec<euclidean::FloodVertex>,
    flood: Vec<(u32, f32)>,
    reached: Vec<(u32, f32)>,
}

impl DistanceWorkspace {
    /// A workspace for the mesh of a geometry, and for all other geometries of that mesh with the same unit.
    pub fn new(geometry: &DistanceGeometry) -> Self {
        Self {
            state: vec![u64::MAX; geometry.connectivity.vertices()],
            stamp: u32::MAX,
            queue: Queue::new(geometry.edges.0, geometry.edges.1),
            paths: Vec::new(),
            flood_vertices: Vec::new(),
            flood: Vec::new(),
            reached: Vec::new(),
        }
    }

    /// The vertices within `radius` of `source` and their distances, both in multiples of the geometry's unit. The
    /// source comes first, at distance 0; otherwise the order is that in which vertices were reached, which is
    /// ascending but for [`DistanceKind::Euclidean`].
    ///
    /// A source that is not a vertex of the mesh reaches nothing.
    pub fn local_distances(&mut self, geometry: &DistanceGeometry, source: u32, radius: f32) -> &[(u32, f32)] {
        self.reached.clear();
        let n = geometry.connectivity.vertices();
        if (source as usize) < n {
            self.begin(n);
            match &geometry.prepared {
                Prepared::Dijkstra { lengths } => self.dijkstra(geometry.connectivity, lengths, source, radius),
                Prepared::Euclidean => self.euclidean(geometry, source, radius),
                Prepared::Stvd { lengths, normals, window } => {
                    self.stvd(geometry, lengths, normals, *window, source, radius);
                }
                Prepared::FastMarching { corners } => {
                    self.fast_marching(geometry.connectivity, corners, source, radius);
                }
            }
        }
        &self.reached
    }

    /// Opens a run: everything written so far counts as unreached.
    fn begin(&mut self, vertices: usize) {
        if self.state.len() < vertices || self.stamp < 4 {
            self.state.clear();
            self.state.resize(vertices, u64::MAX);
            self.flood_vertices.clear();
            self.stamp = u32::MAX;
        }
        self.stamp -= 2;
        self.queue.clear();
    }

    /// The state of a vertex that this run reached at `distance` but may still come closer to.
    fn open(&self, distance: f32) -> u64 {
        u64::from(self.stamp) << 32 | u64::from(distance.to_bits())
    }

    /// The state of a vertex whose distance is final: smaller than any open state of this run, so that nothing replaces
    /// it.
    fn settled(&self, distance: f32) -> u64 {
        u64::from(self.stamp - 1) << 32 | u64::from(distance.to_bits())
    }

    /// The final distance of a vertex, if it has one.
    fn settled_distance(&self, vertex: u32) -> Option<f32> {
        let state = self.state[vertex as usize];
        ((state >> 32) as u32 == self.stamp - 1).then(|| f32::from_bits(state as u32))
    }

    /// Offers `distance` to a vertex; queues the vertex if that is closer than what it had.
    fn offer(&mut self, vertex: u32, distance: f32) -> bool {
        let state = self.open(distance);
        let better = state < self.state[vertex as usize];
        if better {
            self.state[vertex as usize] = state;
            self.queue.push(distance, vertex);
        }
        better
    }

    /// Offers a distance unless it exceeds `radius`.
    fn offer_within(&mut self, vertex: u32, distance: f32, radius: f32) {
        if distance <= radius {
            self.offer(vertex, distance);
        }
    }

    /// Takes the closest queued vertex and makes its distance final.
    fn settle(&mut self) -> Option<(u32, f32)> {
        while let Some((distance, vertex)) = self.queue.pop() {
            if self.state[vertex as usize] == self.open(distance) {
                self.state[vertex as usize] = self.settled(distance);
                self.reached.push((vertex, distance));
                return Some((vertex, distance));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
