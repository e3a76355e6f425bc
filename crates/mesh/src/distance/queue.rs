//! The queue of vertices by distance.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Buckets per typical edge: so few entries share a bucket that sorting them costs less than a heap of all.
const PER_EDGE: f32 = 12.0;

/// Buckets at most, whatever the ratio of the longest edge to the typical one.
const BUCKETS_MAX: f32 = 8192.0;

/// Vertices in order of distance; equal distances in order of vertex. Entries that were overtaken stay inside: whoever
/// takes one compares it with the vertex' current distance.
///
/// A growing front never holds distances that differ by more than the longest edge. They are dropped into a ring of
/// buckets that spans a little more than that, and a bucket is sorted when its turn comes (Denardo and Fox 1979). What
/// arrives in the bucket at hand, from edges shorter than a bucket is wide, goes through a heap, so that the order is
/// exact and a mesh with edges of all sizes costs no more than with a plain heap.
pub(crate) struct Queue {
    per_distance: f32,
    buckets: Vec<Vec<u64>>,
    /// One bit per bucket: does it hold anything?
    occupied: Vec<u64>,
    /// The bucket at hand, descending.
    current: Vec<u64>,
    late: BinaryHeap<Reverse<u64>>,
    /// The number of the bucket at hand; its place in the ring is this modulo the number of buckets.
    cursor: u64,
    waiting: usize,
}

fn key(distance: f32, vertex: u32) -> u64 {
    // The bits of floats that are not negative ascend like their values.
    u64::from(distance.to_bits()) << 32 | u64::from(vertex)
}

fn entry(key: u64) -> (f32, u32) {
    (f32::from_bits((key >> 32) as u32), key as u32)
}

impl Queue {
    /// A queue for a front that grows along edges of about the `typical` length, none of them longer than `longest`.
    pub fn new(typical: f32, longest: f32) -> Self {
        let width = (typical / PER_EDGE).max(longest / (BUCKETS_MAX - 4.0));
        let per_distance = if width > 0.0 && width.is_finite() { 1.0 / width } else { 0.0 };
        let span = (longest * per_distance).min(BUCKETS_MAX - 4.0);
        let buckets = (span as usize + 4).next_power_of_two().max(64);
        Self {
            per_distance: if per_distance.is_finite() { per_distance } else { 0.0 },
            buckets: vec![Vec::new(); buckets],
            occupied: vec![0; buckets / 64],
            current: Vec::new(),
            late: BinaryHeap::new(),
            cursor: 0,
            waiting: 0,
        }
    }

    /// Forgets all entries.
    pub fn clear(&mut self) {
        if self.waiting > 0 {
            self.buckets.iter_mut().for_each(Vec::clear);
            self.occupied.fill(0);
            self.waiting = 0;
        }
        self.current.clear();
        self.late.clear();
        self.cursor = 0;
    }

    /// Queues a vertex at a distance that is not negative, not less than that of the last entry taken, and not more
    /// than the longest edge beyond it.
    pub fn push(&mut self, distance: f32, vertex: u32) {
        let bucket = (distance * self.per_distance) as u64;
        if bucket <= self.cursor {
            self.late.push(Reverse(key(distance, vertex)));
        } else {
            // Rounding may carry a distance past the span of the ring: the last bucket takes it, before its time or
            // not, and nothing is lost.
            let ahead = (bucket - self.cursor).min(self.buckets.len() as u64 - 1);
            let place = (self.cursor + ahead) as usize & (self.buckets.len() - 1);
            self.buckets[place].push(key(distance, vertex));
            self.occupied[place / 64] |= 1 << (place % 64);
            self.waiting += 1;
        }
    }

    /// Takes the closest entry.
    pub fn pop(&mut self) -> Option<(f32, u32)> {
        loop {
            match (self.current.last(), self.late.peek()) {
                (None, None) => self.turn()?,
                (Some(&next), late) if late.is_none_or(|&Reverse(late)| next <= late) => {
                    self.current.pop();
                    return Some(entry(next));
                }
                _ => return self.late.pop().map(|Reverse(next)| entry(next)),
            }
        }
    }

    /// Opens the next bucket that holds anything.
    fn turn(&mut self) -> Option<()> {
        if self.waiting == 0 {
            return None;
        }
        let mask = self.buckets.len() - 1;
        let start = (self.cursor as usize + 1) & mask;
        let words = self.occupied.len();
        // The first word is looked at twice: from the start on, and at the end of the round up to it.
        let place = (0..=words).find_map(|i| {
            let at = (start / 64 + i) % words;
            let word = match i {
                0 => self.occupied[at] & (u64::MAX << (start % 64)),
                _ => self.occupied[at],
            };
            (word != 0).then(|| at * 64 + word.trailing_zeros() as usize)
        })?;
        self.cursor += ((place + self.buckets.len() - start) & mask) as u64 + 1;
        std::mem::swap(&mut self.current, &mut self.buckets[place]);
        self.occupied[place / 64] &= !(1 << (place % 64));
        self.waiting -= self.current.len();
        self.current.sort_unstable_by(|a, b| b.cmp(a));
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pushes and pops as a front does and compares with a plain heap.
    fn agrees_with_a_heap(typical: f32, longest: f32, lengths: impl Fn(u64) -> f32) {
        let mut queue = Queue::new(typical, longest);
        for round in 0..3 {
            queue.clear();
            let mut heap = BinaryHeap::new();
            let mut noise = 7u64 + round;
            for v in 0..5 {
                queue.push(0.0, v);
                heap.push(Reverse(key(0.0, v)));
            }
            for step in 0..20_000u32 {
                let expected = heap.pop().map(|Reverse(k)| entry(k));
                assert_eq!(queue.pop(), expected, "step {step}");
                let Some((distance, _)) = expected else { break };
                for _ in 0..if step < 4000 { 3 } else { 1 } {
                    noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    let further = distance + lengths(noise >> 33);
                    queue.push(further, step);
                    heap.push(Reverse(key(further, step)));
                }
            }
        }
    }

    #[test]
    fn the_order_is_that_of_a_heap() {
        agrees_with_a_heap(0.1, 0.3, |x| 0.01 + 0.29 * (x % 1000) as f32 / 1000.0);
        agrees_with_a_heap(0.1, 0.1, |x| 0.1 * (x % 3) as f32 * 0.5);
        agrees_with_a_heap(1e-6, 1.0, |x| if x % 100 == 0 { 1.0 } else { 1e-6 * (x % 10) as f32 });
        agrees_with_a_heap(0.0, 0.0, |_| 0.0);
    }
}
