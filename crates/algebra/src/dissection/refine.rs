//! A separator that becomes smaller, vertex by vertex, after Fiduccia and Mattheyses as Ashcraft and Liu do it for
//! vertices.

use std::collections::BinaryHeap;

use super::graph::Graph;

/// The side of vertices that separate.
pub(super) const SEPARATOR: u8 = 2;

/// How many passes there are at most.
pub(super) const PASSES: usize = 6;

/// How many moves without a gain a pass goes on for. Of small graphs, which most are, as many as of large ones would
/// move most of the vertices back and forth, for half of the time and 1 % of the entries.
pub(super) fn patience(vertices: usize) -> usize {
    (vertices / 50).clamp(10, 60)
}

/// Memory for refining, one for each thread, used again since memory that is new costs more than the work on a small
/// graph.
#[derive(Default)]
pub(super) struct Scratch {
    /// Zeros.
    pub gains: Vec<i64>,
    /// Whether a vertex has moved: none has.
    pub moved: Vec<bool>,
    /// Whatever was there.
    pub beside: Vec<[u32; 2]>,
}

impl Scratch {
    /// For a graph of so many vertices.
    pub fn of_size(&mut self, vertices: usize) -> &mut Self {
        if self.moved.len() < vertices {
            self.gains.resize(vertices, 0);
            self.moved.resize(vertices, false);
            self.beside.resize(vertices, [0; 2]);
        }
        self
    }
}

/// A graph in two sides without an edge between them, and the vertices that separate them.
pub(super) struct Cut {
    /// For each vertex 0, 1 or [`SEPARATOR`].
    pub side: Vec<u8>,
    /// The weights of the two sides and of the separator.
    pub weights: [u64; 3],
}

impl Cut {
    /// What it costs, to compare it with other cuts of the same graph: first what a side weighs beyond `most`, then the
    /// separator and the imbalance.
    pub fn cost(&self, most: u64) -> (u64, u64, u64) {
        let [a, b, between] = self.weights;
        cost([a, b], between, a + b + between, most)
    }
}

/// The cost of two sides with something `between` them.
pub(super) fn cost(sides: [u64; 2], between: u64, total: u64, most: u64) -> (u64, u64, u64) {
    let larger = sides[0].max(sides[1]);
    // Halves need 1 - H(p) less levels than parts of p and 1 - p, of which each costs about twice its separator; H is
    // the binary entropy. In thousandths, 1 - H(1/2 + d) is about 2.9 d².
    let off = (1000 * larger / total.max(1)).saturating_sub(500);
    (larger.saturating_sub(most), between.saturating_mul(1_000_000 + 3 * off * off / 2), larger)
}

/// What passes keep from one to the next.
struct Work<'a> {
    graph: &'a Graph,
    cut: &'a mut Cut,
    /// For each vertex of the separator the weight of its neighbours on either side.
    beside: &'a mut [[u32; 2]],
    separator: Vec<u32>,
    /// Vertices that have left the separator, or entered it, in this pass.
    moved: &'a mut [bool],
    /// Moves of vertices out of the separator, by gain; outdated ones among them.
    queues: [BinaryHeap<(i64, u32)>; 2],
}

/// Moves vertices of the separator to one side, and their neighbours on the other side into the separator, while that
/// makes it weigh less; no side becomes heavier than `most` unless it is. `separator` are its vertices.
pub(super) fn refine(graph: &Graph, cut: &mut Cut, separator: Vec<u32>, most: u64, scratch: &mut Scratch) {
    let Scratch { beside, moved, .. } = scratch.of_size(graph.len());
    let mut work = Work { graph, cut, beside, separator, moved, queues: [BinaryHeap::new(), BinaryHeap::new()] };
    for _ in 0..PASSES {
        if !work.pass(most) {
            break;
        }
    }
}

impl Work<'_> {
    /// Whether the cut has become better.
    fn pass(&mut self, most: u64) -> bool {
        self.begin();
        let before = self.cut.cost(most);
        let (mut best, mut best_at) = (before, 0);
        // Vertices in the order of their changes, with the side where they were; ends of moves.
        let mut changes: Vec<(u32, u8)> = Vec::new();
        let mut since = 0;
        while since < patience(self.graph.len()) {
            let Some((v, to)) = self.next(most) else { break };
            self.apply(v, to, &mut changes);
            since += 1;
            let now = self.cut.cost(most);
            if now < best {
                (best, best_at, since) = (now, changes.len(), 0);
            }
        }
        for &(v, was) in changes[best_at..].iter().rev() {
            self.move_to(v, was);
        }
        for &(v, _) in &changes {
            self.moved[v as usize] = false;
        }
        let side = &self.cut.side;
        self.separator.extend(changes.iter().map(|&(v, _)| v));
        self.separator.retain(|&v| side[v as usize] == SEPARATOR);
        self.separator.sort_unstable();
        self.separator.dedup();
        best < before
    }

    fn begin(&mut self) {
        self.queues.iter_mut().for_each(BinaryHeap::clear);
        for i in 0..self.separator.len() {
            let v = self.separator[i];
            self.look(v);
            self.offer(v, 0);
            self.offer(v, 1);
        }
    }

    /// Sums up the neighbours of a vertex of the separator.
    fn look(&mut self, v: u32) {
        let mut beside = [0; 2];
        for &u in self.graph.neighbours(v) {
            if let Some(sum) = beside.get_mut(self.cut.side[u as usize] as usize) {
                *sum += self.graph.weights[u as usize];
            }
        }
        self.beside[v as usize] = beside;
    }

    /// By how much less the separator weighs after vertex `v` has moved to side `to`.
    fn gain(&self, v: u32, to: usize) -> i64 {
        i64::from(self.graph.weights[v as usize]) - i64::from(self.beside[v as usize][1 - to])
    }

    fn offer(&mut self, v: u32, to: usize) {
        let gain = self.gain(v, to);
        self.queues[to].push((gain, v));
    }

    /// The next move: the one with the larger gain that keeps the balance, of equal ones to the lighter side.
    fn next(&mut self, most: u64) -> Option<(u32, usize)> {
        let tops = [0, 1].map(|to| self.top(to));
        let allowed = |to: usize| {
            let (gain, v) = tops[to]?;
            let after = self.cut.weights[to] + u64::from(self.graph.weights[v as usize]);
            (after <= most || after <= self.cut.weights[1 - to]).then_some((gain, v))
        };
        let to = match (allowed(0), allowed(1)) {
            (Some(a), Some(b)) if a.0 != b.0 => usize::from(b.0 > a.0),
            (Some(_), Some(_)) => usize::from(self.cut.weights[1] < self.cut.weights[0]),
            (Some(_), None) => 0,
            (None, Some(_)) => 1,
            (None, None) => return None,
        };
        self.queues[to].pop().map(|(_, v)| (v, to))
    }

    fn top(&mut self, to: usize) -> Option<(i64, u32)> {
        while let Some(&(gain, v)) = self.queues[to].peek() {
            let valid = self.cut.side[v as usize] == SEPARATOR && !self.moved[v as usize] && gain == self.gain(v, to);
            if valid {
                return Some((gain, v));
            }
            self.queues[to].pop();
        }
        None
    }

    fn apply(&mut self, v: u32, to: usize, changes: &mut Vec<(u32, u8)>) {
        let other = 1 - to;
        self.moved[v as usize] = true;
        changes.push((v, SEPARATOR));
        self.move_to(v, to as u8);
        let own = self.graph.weights[v as usize];
        let graph = self.graph;
        for &u in graph.neighbours(v) {
            match self.cut.side[u as usize] {
                SEPARATOR => {
                    self.beside[u as usize][to] += own;
                    if !self.moved[u as usize] {
                        self.offer(u, other);
                    }
                }
                side if side as usize == other => {
                    changes.push((u, side));
                    self.move_to(u, SEPARATOR);
                    self.look(u);
                    let weight = graph.weights[u as usize];
                    for &w in graph.neighbours(u) {
                        if self.cut.side[w as usize] == SEPARATOR {
                            // Of a pattern that is not symmetric a row may not have counted this one.
                            let beside = &mut self.beside[w as usize][other];
                            *beside = beside.saturating_sub(weight);
                            if !self.moved[w as usize] {
                                self.offer(w, to);
                            }
                        }
                    }
                    if !self.moved[u as usize] {
                        self.offer(u, 0);
                        self.offer(u, 1);
                    }
                }
                _ => {}
            }
        }
    }

    fn move_to(&mut self, v: u32, side: u8) {
        let weight = u64::from(self.graph.weights[v as usize]);
        let was = std::mem::replace(&mut self.cut.side[v as usize], side);
        self.cut.weights[was as usize] -= weight;
        self.cut.weights[side as usize] += weight;
    }
}
