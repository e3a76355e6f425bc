//! Which parts of a factor are computed as one task: subtrees of the supernode tree of about equal work, and the chains
//! of large supernodes above them. The parts depend on the structure alone, and so do the bits of the result, whatever
//! the number of threads.

use std::ops::Range;

use super::super::factor::Node;
use super::NONE;

/// A subtree with less than this share of all work is one task.
const SMALLEST_SHARE: u64 = 128;

/// So much work, about a fifth of a millisecond, is not worth sharing out.
const SMALLEST_WORK: u64 = 4_000_000;

/// The supernode tree, shared out.
#[derive(Debug)]
pub struct Plan {
    /// The supernode that each hangs on, or [`NONE`].
    pub parent: Vec<u32>,
    /// Whether a supernode lies at an odd depth.
    pub odd: Vec<bool>,
    /// Of everything; it has no supernodes of its own where there are several trees or one small one.
    pub root: Chain,
    /// The pieces that values are split into, ascending and without gaps: a whole subtree, or one supernode of a chain.
    pub pieces: Vec<Range<usize>>,
    /// The most entries that are held at a time beside the factor, if all tasks ran at once.
    pub held: u64,
}

/// Supernodes each of which is the only large child of the next, after all that hangs on them.
#[derive(Debug, Default)]
pub struct Chain {
    /// The large supernodes and their pieces, ascending.
    pub nodes: Vec<(usize, usize)>,
    /// What forks below the first of them.
    pub below: Vec<Chain>,
    /// Subtrees that hang on the supernodes, ascending, a few to a task.
    pub tasks: Vec<Task>,
}

/// Small subtrees that are computed one after the other, by their pieces.
#[derive(Debug, Default)]
pub struct Task {
    pub pieces: Vec<usize>,
    work: u64,
}

impl Plan {
    /// Nothing where the supernodes are not in a postorder of their tree.
    pub fn new(nodes: &[Node], patterns: &[u32]) -> Option<Self> {
        let parent = parents(nodes, patterns);
        let mut size = vec![1u32; nodes.len()];
        let mut work: Vec<u64> = nodes.iter().map(own_work).collect();
        let mut odd = vec![false; nodes.len()];
        let mut total = 0;
        for at in 0..nodes.len() {
            match parent[at] {
                NONE => total += work[at],
                above => {
                    size[above as usize] += size[at];
                    work[above as usize] += work[at];
                }
            }
        }
        for at in (0..nodes.len()).rev().filter(|&at| parent[at] != NONE) {
            odd[at] = !odd[parent[at] as usize];
        }
        let starts = |at: usize| at + 1 - size[at] as usize;
        if !contiguous(&parent, starts) {
            return None;
        }
        let least = (total / SMALLEST_SHARE).max(SMALLEST_WORK);
        let large = |at: usize| work[at] >= least;
        let mut plan = Self { parent, odd, root: Chain::default(), pieces: Vec::new(), held: 0 };
        // Chains by their last supernodes, and subtrees by their tops with their pieces, that hang on nothing as yet.
        let mut chains: Vec<(usize, Chain)> = Vec::new();
        let mut lights: Vec<(usize, usize)> = Vec::new();
        for at in 0..nodes.len() {
            let above = plan.parent[at];
            if !large(at) {
                if above == NONE || large(above as usize) {
                    lights.push((at, plan.pieces.len()));
                    plan.pieces.push(starts(at)..at + 1);
                }
                continue;
            }
            let hangs = |&(child, _): &(usize, Chain)| plan.parent[child] as usize == at;
            let from = chains.iter().rposition(|child| !hangs(child)).map_or(0, |last| last + 1);
            let mut below: Vec<Chain> = chains.drain(from..).map(|(_, chain)| chain).collect();
            let mut chain = match below.len() {
                1 => below.pop().unwrap_or_default(),
                _ => Chain { below, ..Chain::default() },
            };
            let from = lights.iter().rposition(|&(child, _)| plan.parent[child] as usize != at);
            for (child, piece) in lights.drain(from.map_or(0, |last| last + 1)..) {
                chain.take(piece, work[child], least);
            }
            chain.nodes.push((at, plan.pieces.len()));
            plan.pieces.push(at..at + 1);
            chains.push((at, chain));
        }
        if lights.is_empty() && chains.len() == 1 {
            chains.into_iter().for_each(|(_, chain)| plan.root = chain);
        } else {
            plan.root.below.extend(chains.into_iter().map(|(_, chain)| chain));
            lights.into_iter().for_each(|(child, piece)| plan.root.take(piece, work[child], least));
        }
        plan.held = plan.entries_held(nodes);
        Some(plan)
    }

    /// What the update matrices take that wait for another task, and the most that are on the stack of one.
    fn entries_held(&self, nodes: &[Node]) -> u64 {
        let square = |at: usize| (stride(nodes[at].pattern.1) as u64).pow(2);
        let (mut waiting, mut deepest) = (0u64, 0u64);
        let mut children = vec![0u64; nodes.len()];
        for at in 0..nodes.len() {
            if self.parent[at] != NONE {
                children[self.parent[at] as usize] += square(at);
            }
        }
        for piece in &self.pieces {
            let top = piece.end - 1;
            waiting += square(top) / 2;
            let mut stack = 0;
            for at in piece.clone() {
                stack += square(at);
                deepest = deepest.max(stack);
                stack = stack.saturating_sub(if piece.len() > 1 { children[at] } else { 0 });
            }
        }
        waiting + deepest
    }
}

impl Chain {
    fn take(&mut self, piece: usize, work: u64, least: u64) {
        match self.tasks.last_mut() {
            Some(task) if task.work + work <= least => {
                task.pieces.push(piece);
                task.work += work;
            }
            _ => self.tasks.push(Task { pieces: vec![piece], work }),
        }
    }
}

/// The column stride of an update matrix of so many rows: whole cache lines.
pub fn stride(rows: usize) -> usize {
    rows.next_multiple_of(8)
}

/// The products of a supernode, and what comes with any.
pub fn own_work(node: &Node) -> u64 {
    let (columns, rows) = (node.columns as u64, (node.columns + node.pattern.1) as u64);
    columns * rows * rows + 4 * rows * rows + 1000
}

fn parents(nodes: &[Node], patterns: &[u32]) -> Vec<u32> {
    let rows = nodes.last().map_or(0, |node| node.start + node.columns);
    let mut holder = vec![0u32; rows];
    for (at, node) in nodes.iter().enumerate() {
        holder[node.start..node.start + node.columns].fill(at as u32);
    }
    let above = |node: &Node| match node.pattern.1 {
        0 => NONE,
        _ => holder[patterns[node.pattern.0] as usize],
    };
    nodes.iter().map(above).collect()
}

/// Whether each subtree is what comes right before its top: children are met from the last to the first.
fn contiguous(parent: &[u32], starts: impl Fn(usize) -> usize) -> bool {
    let mut next: Vec<usize> = (0..parent.len()).collect();
    (0..parent.len()).rev().all(|at| match parent[at] {
        NONE => true,
        above => {
            let fits = next[above as usize] == at + 1;
            next[above as usize] = starts(at);
            fits
        }
    })
}
