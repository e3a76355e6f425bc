//! The queue of vertices by distance.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Vertices in order of distance; equal distances in order of vertex. Entries that were overtaken stay inside: whoever takes
/// one compares it with the vertex' current distance.
#[derive(Default)]
pub(in crate::mesh) struct Queue {
    heap: BinaryHeap<Reverse<u64>>,
}

impl Queue {
    /// Forgets all entries.
    pub fn clear(&mut self) {
        self.heap.clear();
    }

    /// Queues a vertex at a distance, which must not be negative (the bits of such floats ascend like their values).
    pub fn push(&mut self, distance: f32, vertex: u32) {
        self.heap.push(Reverse(u64::from(distance.to_bits()) << 32 | u64::from(vertex)));
    }

    /// Takes the closest entry.
    pub fn pop(&mut self) -> Option<(f32, u32)> {
        self.heap.pop().map(|Reverse(key)| (f32::from_bits((key >> 32) as u32), key as u32))
    }
}
