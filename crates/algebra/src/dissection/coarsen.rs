//! A coarser picture of a graph: pairs of vertices with heavy edges between them become one, or any other clusters.

use chladni_base::parallel::*;

use super::graph::{Graph, mix};

const NONE: u32 = u32::MAX;

/// The graph of pairs, with the coarse vertex that each vertex belongs to; none where it would hardly be smaller. No
/// coarse vertex weighs more than `heaviest` unless a single vertex does.
pub(super) fn coarsened(graph: &Graph, heaviest: u32) -> Option<(Graph, Vec<u32>)> {
    let mate = matched(graph, heaviest);
    let n = graph.len();
    let mut coarse = vec![NONE; n];
    let mut count = 0;
    for v in 0..n {
        if coarse[v] == NONE {
            coarse[v] = count;
            coarse[mate[v] as usize] = count;
            count += 1;
        }
    }
    let count = count as usize;
    if count * 20 > n * 19 {
        return None;
    }
    Some((contracted(graph, &coarse, count), coarse))
}

/// The vertex of a second graph that each vertex belongs to, if it belongs to a vertex of a first one that belongs to
/// it.
pub(super) fn joined(first: &[u32], second: &[u32]) -> Vec<u32> {
    first.iter().map(|&vertex| second[vertex as usize]).collect()
}

/// For each vertex the other one of its pair, or itself.
fn matched(graph: &Graph, heaviest: u32) -> Vec<u32> {
    let n = graph.len();
    let mut mate = vec![NONE; n];
    // Vertices of few neighbours first, since they have the least choice.
    let degree = |v: u32| (graph.neighbours(v).len() as u32).min(15);
    let mut starts = [0u32; 17];
    (0..n as u32).for_each(|v| starts[degree(v) as usize + 1] += 1);
    (0..16).for_each(|d| starts[d + 1] += starts[d]);
    let mut by_degree = vec![0u32; n];
    for v in 0..n as u32 {
        let place = &mut starts[degree(v) as usize];
        by_degree[*place as usize] = v;
        *place += 1;
    }
    let mut left = Vec::new();
    for &v in &by_degree {
        if mate[v as usize] != NONE {
            continue;
        }
        let own = graph.weights[v as usize];
        let mut best = (0, 0, NONE);
        for (u, edge) in graph.edges(v) {
            let weight = graph.weights[u as usize];
            if mate[u as usize] == NONE && own + weight <= heaviest {
                // The heaviest edge; of equal ones the one to the lightest vertex.
                if best.2 == NONE || (edge, u32::MAX - weight) > (best.0, best.1) {
                    best = (edge, u32::MAX - weight, u);
                }
            }
        }
        if best.2 == NONE {
            left.push(v);
        } else {
            mate[v as usize] = best.2;
            mate[best.2 as usize] = v;
        }
    }
    pair_leftovers(graph, heaviest, &mut mate, left);
    mate
}

/// Vertices whose neighbours are all taken, by two that have a neighbour in common: around a hub, and without any
/// neighbour.
fn pair_leftovers(graph: &Graph, heaviest: u32, mate: &mut [u32], left: Vec<u32>) {
    let mut left: Vec<(u32, u32)> = left
        .into_iter()
        .filter(|&v| mate[v as usize] == NONE)
        .map(|v| (graph.edges(v).max_by_key(|&(u, edge)| (edge, mix(u))).map_or(NONE, |(u, _)| u), v))
        .collect();
    left.sort_unstable();
    let mut at = 0;
    while at < left.len() {
        let (hub, v) = left[at];
        match left.get(at + 1) {
            Some(&(same, u)) if same == hub && graph.weights[v as usize] + graph.weights[u as usize] <= heaviest => {
                mate[v as usize] = u;
                mate[u as usize] = v;
                at += 2;
            }
            _ => {
                mate[v as usize] = v;
                at += 1;
            }
        }
    }
}

/// So many coarse vertices are contracted at a time, by one thread.
const RANGE: usize = 1 << 14;

/// The graph of the `count` coarse vertices that the vertices belong to; each has one at least.
pub(super) fn contracted(graph: &Graph, coarse: &[u32], count: usize) -> Graph {
    let members = Members::of(coarse, count);
    if count <= 2 * RANGE {
        return contracted_range(graph, coarse, &members, 0..count, &mut vec![0; count]);
    }
    let ranges: Vec<Graph> = (0..count.div_ceil(RANGE))
        .into_par_iter()
        .map_init(
            || vec![0; count],
            |place, k| contracted_range(graph, coarse, &members, k * RANGE..count.min((k + 1) * RANGE), place),
        )
        .collect();
    let entries = ranges.iter().map(|range| range.neighbours.len()).sum();
    let mut whole = Graph {
        offsets: Vec::with_capacity(count + 1),
        neighbours: Vec::with_capacity(entries),
        edge_weights: Vec::with_capacity(entries),
        weights: Vec::with_capacity(count),
    };
    whole.offsets.push(0);
    for range in ranges {
        let before = whole.neighbours.len() as u32;
        whole.offsets.extend(range.offsets[1..].iter().map(|offset| before + offset));
        whole.neighbours.extend(range.neighbours);
        whole.edge_weights.extend(range.edge_weights);
        whole.weights.extend(range.weights);
    }
    whole
}

/// The vertices of each coarse vertex, ascending.
struct Members {
    starts: Vec<u32>,
    vertices: Vec<u32>,
}

impl Members {
    fn of(coarse: &[u32], count: usize) -> Self {
        let mut starts = vec![0u32; count + 2];
        coarse.iter().for_each(|&c| starts[c as usize + 2] += 1);
        (2..count + 2).for_each(|c| starts[c] += starts[c - 1]);
        let mut vertices = vec![0u32; coarse.len()];
        for (&c, v) in coarse.iter().zip(0..) {
            let next = &mut starts[c as usize + 1];
            vertices[*next as usize] = v;
            *next += 1;
        }
        Self { starts, vertices }
    }

    fn of_one(&self, c: usize) -> &[u32] {
        &self.vertices[self.starts[c] as usize..self.starts[c + 1] as usize]
    }
}

/// Some of the coarse vertices. `place` has an entry for each of all, whatever is in it.
fn contracted_range(
    graph: &Graph,
    coarse: &[u32],
    members: &Members,
    range: std::ops::Range<usize>,
    place: &mut [u32],
) -> Graph {
    let entries = graph.neighbours.len() / 2 * range.len() / place.len().max(1);
    let mut result = Graph {
        offsets: Vec::with_capacity(range.len() + 1),
        neighbours: Vec::with_capacity(entries),
        edge_weights: Vec::with_capacity(entries),
        weights: Vec::with_capacity(range.len()),
    };
    result.offsets.push(0);
    for own in range {
        let begin = result.neighbours.len();
        let mut weight = 0;
        for &member in members.of_one(own) {
            weight += graph.weights[member as usize];
            for (u, edge) in graph.edges(member) {
                let to = coarse[u as usize];
                if to as usize == own {
                    continue;
                }
                // What `place` says of earlier vertices, or of none, does not point at this neighbour among those of
                // this vertex.
                let at = place[to as usize] as usize;
                if at >= begin && result.neighbours.get(at) == Some(&to) {
                    result.edge_weights[at] += edge;
                } else {
                    place[to as usize] = result.neighbours.len() as u32;
                    result.neighbours.push(to);
                    result.edge_weights.push(edge);
                }
            }
        }
        result.offsets.push(result.neighbours.len() as u32);
        result.weights.push(weight);
    }
    result
}
