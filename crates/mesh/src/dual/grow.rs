//! Disks of faces grown over the dual graph.

use super::super::distance::Queue;
use super::{DualGraph, NO_FACE};

/// Grows disks around faces by Dijkstra's algorithm; scratch memory is kept from one disk to the next.
pub struct DiskGrower {
    distances: Vec<f32>,
    /// The disk that a face was reached in last, and its place there, or `u32::MAX` before it is settled.
    reached_in: Vec<u32>,
    places: Vec<u32>,
    disk: u32,
    queue: Queue,
    settled: Vec<(u32, f32)>,
}

impl DiskGrower {
    /// Scratch for the graph.
    pub fn new(graph: &DualGraph) -> Self {
        let (mut sum, mut count, mut longest) = (0.0, 0usize, 0.0f32);
        for lengths in &graph.lengths {
            for &length in lengths {
                sum += f64::from(length);
                count += usize::from(length > 0.0);
                longest = longest.max(length);
            }
        }
        let typical = (sum / count.max(1) as f64) as f32;
        Self {
            distances: vec![0.0; graph.faces()],
            reached_in: vec![0; graph.faces()],
            places: vec![u32::MAX; graph.faces()],
            disk: 0,
            queue: Queue::new(typical, longest),
            settled: Vec::new(),
        }
    }

    /// The faces within `radius` of `source` and their distances, nearest first. The graph must be the one that this
    /// was made for; a source that is no face gives an empty disk.
    pub fn grow(&mut self, graph: &DualGraph, source: u32, radius: f32) -> &[(u32, f32)] {
        self.disk = self.disk.wrapping_add(1);
        if self.disk == 0 {
            self.reached_in.fill(0);
            self.disk = 1;
        }
        self.settled.clear();
        self.queue.clear();
        if source as usize >= graph.faces() {
            return &self.settled;
        }
        self.reach(source, 0.0);
        self.settle(graph, radius);
        &self.settled
    }

    fn settle(&mut self, graph: &DualGraph, radius: f32) {
        while let Some((distance, face)) = self.queue.pop() {
            let f = face as usize;
            if self.places[f] != u32::MAX || distance > self.distances[f] {
                continue;
            }
            self.places[f] = self.settled.len() as u32;
            self.settled.push((face, distance));
            let lengths = graph.lengths[f];
            for (k, g) in graph.neighbours[f].into_iter().enumerate() {
                if g == NO_FACE {
                    continue;
                }
                let through = distance + lengths[k];
                if through <= radius
                    && (self.reached_in[g as usize] != self.disk || through < self.distances[g as usize])
                {
                    self.reach(g, through);
                }
            }
        }
    }

    fn reach(&mut self, face: u32, distance: f32) {
        let f = face as usize;
        if self.reached_in[f] != self.disk {
            self.reached_in[f] = self.disk;
            self.places[f] = u32::MAX;
        }
        self.distances[f] = distance;
        self.queue.push(distance, face);
    }

    /// The largest distance of a face to the nearest of some sources; faces that none reaches do not count.
    pub fn farthest_distance(&mut self, graph: &DualGraph, sources: &[u32]) -> f32 {
        self.grow(graph, NO_FACE, 0.0);
        sources.iter().filter(|&&s| (s as usize) < graph.faces()).for_each(|&s| self.reach(s, 0.0));
        self.settle(graph, f32::INFINITY);
        self.settled.last().map_or(0.0, |f| f.1)
    }

    /// The faces of the last disk and their distances, nearest first.
    #[inline]
    pub fn disk(&self) -> &[(u32, f32)] {
        &self.settled
    }

    /// The place of a face in the last disk.
    #[inline]
    pub fn index_of(&self, face: u32) -> Option<usize> {
        let f = face as usize;
        (self.reached_in.get(f) == Some(&self.disk) && self.places[f] != u32::MAX).then(|| self.places[f] as usize)
    }
}
