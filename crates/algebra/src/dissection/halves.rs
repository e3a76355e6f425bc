//! Two halves of a graph with few edges between them, by Fiduccia and Mattheyses.

use std::collections::BinaryHeap;

use super::graph::Graph;
use super::refine::{Cut, PASSES, SEPARATOR, Scratch, cost, patience};

/// A graph in two sides.
pub(super) struct Halves {
    pub side: Vec<u8>,
    pub weights: [u64; 2],
    /// The weight of the edges between them.
    pub between: u64,
}

impl Halves {
    /// What they cost, as [`Cut::cost`] with edges in place of a separator.
    pub fn cost(&self, most: u64) -> (u64, u64, u64) {
        cost(self.weights, self.between, self.weights[0] + self.weights[1], most)
    }

    /// The cut whose separator are the vertices of `side` with an edge to the other one, and these vertices; `boundary`
    /// are those of both sides.
    pub fn separated(&self, boundary: &[u32], side: u8, graph: &Graph) -> (Cut, Vec<u32>) {
        let separator: Vec<u32> = boundary.iter().copied().filter(|&v| self.side[v as usize] == side).collect();
        let (mut parts, mut weights) = (self.side.clone(), [self.weights[0], self.weights[1], 0]);
        for &v in &separator {
            let weight = u64::from(graph.weights[v as usize]);
            parts[v as usize] = SEPARATOR;
            weights[side as usize] -= weight;
            weights[SEPARATOR as usize] += weight;
        }
        (Cut { side: parts, weights }, separator)
    }
}

/// Side 0 grows from a vertex until it weighs as much as side 1; the vertex that adds least to the edges between them
/// is next.
pub(super) fn grow(graph: &Graph, start: u32) -> Halves {
    let n = graph.len();
    let mut halves = Halves { side: vec![1; n], weights: [0, graph.total_weight()], between: 0 };
    let mut gains: Vec<i64> =
        (0..n as u32).map(|v| -graph.edges(v).map(|(_, edge)| i64::from(edge)).sum::<i64>()).collect();
    let mut queue = BinaryHeap::new();
    let mut next_seed = 0;
    queue.push((gains[start as usize], start));
    while halves.weights[0] < halves.weights[1] {
        let Some((gain, v)) = queue.pop() else {
            let Some(v) = (next_seed..n).find(|&v| halves.side[v] == 1) else { break };
            next_seed = v;
            queue.push((gains[v], v as u32));
            continue;
        };
        if halves.side[v as usize] == 0 || gain != gains[v as usize] {
            continue;
        }
        let weight = u64::from(graph.weights[v as usize]);
        halves.side[v as usize] = 0;
        halves.weights[0] += weight;
        halves.weights[1] -= weight;
        halves.between = halves.between.wrapping_add_signed(-gain);
        for (u, edge) in graph.edges(v) {
            gains[u as usize] += 2 * i64::from(edge);
            if halves.side[u as usize] == 1 {
                queue.push((gains[u as usize], u));
            }
        }
    }
    halves
}

/// What passes keep from one to the next.
struct Work<'a> {
    graph: &'a Graph,
    halves: &'a mut Halves,
    /// Twice of by how much less the edges between the sides weigh after a vertex has moved, and one; zero where none
    /// has asked.
    gains: &'a mut [i64],
    /// Those that were asked for.
    asked: Vec<u32>,
    /// Vertices that have moved in this pass.
    moved: &'a mut [bool],
    /// Vertices of either side by gain; outdated ones among them.
    queues: [BinaryHeap<(i64, u32)>; 2],
}

/// Moves vertices to the other side while the edges between the sides become fewer. `candidates` are all vertices that
/// may have an edge to the other side, ascending. Gives those that have one then.
pub(super) fn refine(
    graph: &Graph,
    halves: &mut Halves,
    candidates: Vec<u32>,
    most: u64,
    scratch: &mut Scratch,
) -> Vec<u32> {
    let queues = [BinaryHeap::new(), BinaryHeap::new()];
    let Scratch { gains, moved, .. } = scratch.of_size(graph.len());
    let mut work = Work { graph, halves, gains, asked: Vec::new(), moved, queues };
    let mut boundary = candidates;
    boundary.retain(|&v| work.is_between(v));
    for _ in 0..PASSES {
        let Some(moves) = work.pass(&boundary, most) else { break };
        // All that may have an edge to the other side now.
        boundary.extend(moves.iter().flat_map(|&v| graph.neighbours(v).iter().copied().chain([v])));
        boundary.sort_unstable();
        boundary.dedup();
        boundary.retain(|&v| work.is_between(v));
    }
    work.asked.iter().for_each(|&v| work.gains[v as usize] = 0);
    boundary
}

impl Work<'_> {
    fn side(&self, v: u32) -> usize {
        self.halves.side[v as usize] as usize
    }

    fn is_between(&self, v: u32) -> bool {
        self.graph.neighbours(v).iter().any(|&u| self.side(u) != self.side(v))
    }

    /// The moves that were worth while, or none.
    fn pass(&mut self, boundary: &[u32], most: u64) -> Option<Vec<u32>> {
        self.queues.iter_mut().for_each(BinaryHeap::clear);
        boundary.iter().for_each(|&v| self.offer(v));
        let before = self.halves.cost(most);
        let (mut best, mut best_at) = (before, 0);
        let mut moves: Vec<u32> = Vec::new();
        while moves.len() - best_at < patience(self.graph.len()) {
            let Some(v) = self.next(most) else { break };
            self.shift(v);
            self.moved[v as usize] = true;
            moves.push(v);
            for &u in self.graph.neighbours(v) {
                if !self.moved[u as usize] {
                    self.offer(u);
                }
            }
            let now = self.halves.cost(most);
            if now < best {
                (best, best_at) = (now, moves.len());
            }
        }
        for &v in moves[best_at..].iter().rev() {
            self.shift(v);
        }
        moves.iter().for_each(|&v| self.moved[v as usize] = false);
        moves.truncate(best_at);
        (best < before).then_some(moves)
    }

    fn offer(&mut self, v: u32) {
        let gain = self.gain(v);
        self.queues[self.side(v)].push((gain, v));
    }

    fn gain(&mut self, v: u32) -> i64 {
        if self.gains[v as usize] == 0 {
            let own = self.side(v);
            let signed = |(u, edge)| if self.side(u) == own { -i64::from(edge) } else { i64::from(edge) };
            self.gains[v as usize] = 2 * self.graph.edges(v).map(signed).sum::<i64>() + 1;
            self.asked.push(v);
        }
        self.gains[v as usize] >> 1
    }

    /// The next vertex to move: the one with the larger gain that keeps the balance, of equal ones from the heavier
    /// side.
    fn next(&mut self, most: u64) -> Option<u32> {
        let tops = [self.top(0, most), self.top(1, most)];
        let from = match tops {
            [Some(a), Some(b)] if a != b => usize::from(b > a),
            [Some(_), Some(_)] => usize::from(self.halves.weights[1] > self.halves.weights[0]),
            [Some(_), None] => 0,
            [None, Some(_)] => 1,
            [None, None] => return None,
        };
        self.queues[from].pop().map(|(_, v)| v)
    }

    fn top(&mut self, from: usize, most: u64) -> Option<i64> {
        while let Some(&(gain, v)) = self.queues[from].peek() {
            if !self.moved[v as usize] && self.side(v) == from && self.gain(v) == gain {
                let after = self.halves.weights[1 - from] + u64::from(self.graph.weights[v as usize]);
                return (after <= most || after <= self.halves.weights[from]).then_some(gain);
            }
            self.queues[from].pop();
        }
        None
    }

    fn shift(&mut self, v: u32) {
        let gain = self.gain(v);
        let from = self.side(v);
        let weight = u64::from(self.graph.weights[v as usize]);
        self.halves.side[v as usize] = 1 - from as u8;
        self.halves.weights[from] -= weight;
        self.halves.weights[1 - from] += weight;
        self.halves.between = self.halves.between.wrapping_add_signed(-gain);
        self.gains[v as usize] = 1 - 2 * gain;
        for (u, edge) in self.graph.edges(v) {
            let own = self.side(u);
            let known = &mut self.gains[u as usize];
            if *known != 0 {
                let change = 4 * i64::from(edge);
                *known += if own == from { change } else { -change };
            }
        }
    }
}
