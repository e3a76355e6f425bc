//! Exact geodesic distances on the polyhedral surface: windows are propagated over the unfolded faces, nearest first.
//!
//! A shortest path on a polyhedron is straight in the plane that the faces it crosses are unfolded into, and turns at
//! vertices alone: those whose angles exceed 2π, and those on a boundary (Sharir and Schorr 1986; Mitchell, Mount and
//! Papadimitriou 1987). So all shortest paths through an edge come in windows, intervals of the edge whose paths share
//! the last vertex that they turned at. Windows are propagated in order of distance, as Xin and Wang (2009) do. What
//! keeps their number small:
//! - Each is cut down to the part of its edge where it is shorter than the ways through the ends of the edge. As one
//!   moves away from an end the way through that end grows at least as fast as the window's, so that part is an
//!   interval, and nothing that is cut away can be part of a shortest path.
//! - One that left a face by two of its sides is dropped where the way through the corner between them to its far end
//!   is as short: every path of the window crosses that way (Xin and Wang's third condition).
//! - Of all windows that enter a face by one edge, the one that reaches the opposite corner first owns it. The path of
//!   the owner to the corner bars the face: what another window sends across it could as well follow the owner up to
//!   the crossing. So that window goes on beyond the owner's path only by places of the edge that already lie beyond it
//!   (after "one angle, one split" of Chen and Han 1990, which needs an order of faces; this does not).
//!
//! Nothing is assumed of the mesh: an edge may have any number of faces, with any orientation, and faces may lack area.

mod edges;
#[cfg(test)]
mod tests;
mod window;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use chladni_base::{Cancelled, Monitor};

use self::edges::Edges;
use self::window::{Reached, Window};
use crate::TriangleMesh;

/// Events between two checkpoints.
const BETWEEN_CHECKPOINTS: usize = 1 << 14;

/// What exact distances need of a mesh; shared between threads and sources.
#[derive(Debug)]
pub struct ExactGeodesics {
    edges: Edges,
}

/// Something that happens at a distance from the source.
struct Event {
    distance: f64,
    what: What,
}

enum What {
    Vertex(u32),
    Window(Window),
}

impl PartialEq for Event {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Event {}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Event {
    /// The nearest is the greatest, as a heap wants it.
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.total_cmp(&self.distance)
    }
}

impl ExactGeodesics {
    /// Measures the edges and the faces of a mesh.
    ///
    /// # Panics
    /// If a face refers to a vertex that is not there.
    pub fn new(mesh: &TriangleMesh) -> Self {
        Self { edges: Edges::new(mesh) }
    }

    /// The number of vertices, `n`.
    pub fn vertices(&self) -> usize {
        self.edges.vertices()
    }

    /// The distance of every vertex to the nearest of some sources, in the units of the mesh: `n` numbers, infinite
    /// where no path leads. Sources that are no vertices are left out.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn from_nearest(&self, sources: &[u32], monitor: &dyn Monitor) -> Result<Vec<f64>, Cancelled> {
        let mut front = Front {
            edges: &self.edges,
            distances: vec![f64::INFINITY; self.vertices()],
            owners: vec![(f64::INFINITY, 0.0); self.edges.halves()],
            heap: BinaryHeap::new(),
        };
        for &source in sources.iter().filter(|&&source| (source as usize) < self.vertices()) {
            front.reach(source, 0.0);
        }
        let mut events = 0usize;
        while let Some(Event { distance, what }) = front.heap.pop() {
            if events.is_multiple_of(BETWEEN_CHECKPOINTS) {
                monitor.checkpoint()?;
            }
            events += 1;
            match what {
                // One that was reached on a shorter way meanwhile has had its turn.
                What::Vertex(vertex) if distance == front.distances[vertex as usize] => front.turn(vertex, distance),
                What::Vertex(_) => {}
                What::Window(window) => front.propagate(window),
            }
        }
        let unit = self.edges.unit();
        Ok(front.distances.into_iter().map(|distance| unit * distance).collect())
    }
}

/// Distances as they are known, and what is still to happen.
struct Front<'a> {
    edges: &'a Edges,
    distances: Vec<f64>,
    /// For each half-edge the least distance at which a window through it reached the opposite corner, and where its
    /// path to there crosses the edge.
    owners: Vec<(f64, f64)>,
    heap: BinaryHeap<Event>,
}

impl Front<'_> {
    /// A way to a vertex.
    fn reach(&mut self, vertex: u32, distance: f64) {
        if distance < self.distances[vertex as usize] {
            self.distances[vertex as usize] = distance;
            self.heap.push(Event { distance, what: What::Vertex(vertex) });
        }
    }

    /// The distance of a vertex is final: ways go on along its edges, and, where paths may turn there or begin, through
    /// its faces.
    fn turn(&mut self, vertex: u32, distance: f64) {
        let edges = self.edges;
        for &opposite in edges.opposite(vertex) {
            let [next, previous] = edges.sides(opposite);
            self.reach(edges.origin(opposite), distance + edges.length(previous));
            self.reach(edges.origin(next), distance + edges.length(next));
            if distance == 0.0 || edges.turns(vertex) {
                let (along, behind) = edges.apex(opposite);
                let length = edges.length(opposite);
                let window = Window { edge: opposite, from: 0.0, to: length, along, behind, before: distance };
                self.pass(&window, opposite, false, None);
            }
        }
    }

    /// Follows a window through the face in front of its edge.
    fn propagate(&mut self, window: Window) {
        let edges = self.edges;
        let Some(window) = self.useful(window) else { return };
        let (apex, length) = (edges.apex(window.edge), edges.length(window.edge));
        let (mut before, mut beyond) = (window, window);
        // A corner in line with a vertex that was passed lies on the rim of the windows on both sides of it, and for
        // rounding in neither. No path turns at an ordinary vertex, so that its own way would not be found again; one
        // that turns by a rounding error at the rim is as short.
        let Reached { distance, place, seen } = window.reaches(apex);
        self.reach(edges.third(window.edge), distance);
        if seen {
            let owner = &mut self.owners[window.edge as usize];
            if distance < owner.0 {
                *owner = (distance, place);
            } else if place < owner.1 {
                beyond.from = beyond.from.max(owner.1);
            } else if place > owner.1 {
                before.to = before.to.min(owner.1);
            }
        }
        let [next, previous] = edges.sides(window.edge);
        // Both sides are measured from the ends of the edge: the second one in a mirror.
        if let Some(child) = before.through(apex, edges.length(previous)) {
            self.pass(&child, previous, true, Some(edges.end(window.edge)));
        }
        let mirrored = beyond.mirrored(length);
        if let Some(child) = mirrored.through((length - apex.0, apex.1), edges.length(next)) {
            self.pass(&child, next, false, Some(edges.origin(window.edge)));
        }
    }

    /// A window that leaves a face by one of its edges, for each face on the other side. Its places are measured from
    /// the origin of that edge, or from its end if `from_end`; `passed` is the corner opposite to the edge where it
    /// came in by another side.
    fn pass(&mut self, window: &Window, edge: u32, from_end: bool, passed: Option<u32>) {
        let edges = self.edges;
        if let Some(corner) = passed {
            // The near end of the window is the far one from the corner.
            let (along, above) = edges.apex(edge);
            let along = if from_end { edges.length(edge) - along } else { along };
            if window.is_beaten_by(self.distances[corner as usize], (along, above)) {
                return;
            }
        }
        let begin = if from_end { edges.end(edge) } else { edges.origin(edge) };
        for &other in edges.same_edge(edge).iter().filter(|&&other| other != edge) {
            let there = if edges.origin(other) == begin { *window } else { window.mirrored(edges.length(edge)) };
            if let Some(useful) = self.useful(Window { edge: other, ..there }) {
                self.heap.push(Event { distance: useful.nearest(), what: What::Window(useful) });
            }
        }
    }

    /// The part of a window where it is shorter than the ways through the ends of its edge.
    fn useful(&self, window: Window) -> Option<Window> {
        let edges = self.edges;
        let [begin, end] = [edges.origin(window.edge), edges.end(window.edge)].map(|v| self.distances[v as usize]);
        let length = edges.length(window.edge);
        window.beyond(begin)?.mirrored(length).beyond(end).map(|window| window.mirrored(length))
    }
}
