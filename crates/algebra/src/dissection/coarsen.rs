//! A coarser picture of a graph: pairs of vertices with heavy edges between them become one.

use chladni_base::parallel::*;

use super::graph::{Graph, mix};

const NONE: u32 = u32::MAX;

/// The graph of pairs, with the coarse vertex that each vertex belongs to; none where it would hardly be smaller. No
/// coarse vertex weighs more than `heaviest` unless a single vertex does.
pub(super) fn coarsened(graph: &Graph, heaviest: u32) -> Option<(Graph, Vec<u32>)> {
    let mate = matched(graph, heaviest);
    let n = graph.len();
    let mut coarse = vec![NONE; n];
    let mut firsts = Vec::with_capacity(n / 2 + n / 8);
    for v in 0..n {
        if coarse[v] == NONE {
            coarse[v] = firsts.len() as u32;
            coarse[mate[v] as usize] = firsts.len() as u32;
            firsts.push(v as u32);
        }
    }
    if firsts.len() * 20 > n * 19 {
        return None;
    }
    Some((contracted(graph, &mate, &coarse, &firsts), coarse))
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

fn contracted(graph: &Graph, mate: &[u32], coarse: &[u32], firsts: &[u32]) -> Graph {
    let n = firsts.len();
    let ranges: Vec<Graph> = if n > 2 * RANGE {
        firsts
            .par_chunks(RANGE)
            .enumerate()
            .map_init(
                || vec![0; n],
                |place, (k, firsts)| contracted_range(graph, mate, coarse, k * RANGE, firsts, place),
            )
            .collect()
    } else {
        return contracted_range(graph, mate, coarse, 0, firsts, &mut vec![0; n]);
    };
    let entries = ranges.iter().map(|range| range.neighbours.len()).sum();
    let mut whole = Graph {
        offsets: Vec::with_capacity(n + 1),
        neighbours: Vec::with_capacity(entries),
        edge_weights: Vec::with_capacity(entries),
        weights: Vec::with_capacity(n),
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

/// The coarse vertices from number `first` on, whose pairs begin with `firsts`. `place` has an entry for each coarse
/// vertex, whatever is in it.
fn contracted_range(
    graph: &Graph,
    mate: &[u32],
    coarse: &[u32],
    first: usize,
    firsts: &[u32],
    place: &mut [u32],
) -> Graph {
    let entries = graph.neighbours.len() * 2 / 3 * firsts.len() / place.len().max(1);
    let mut result = Graph {
        offsets: Vec::with_capacity(firsts.len() + 1),
        neighbours: Vec::with_capacity(entries),
        edge_weights: Vec::with_capacity(entries),
        weights: Vec::with_capacity(firsts.len()),
    };
    result.offsets.push(0);
    for (own, &v) in (first as u32..).zip(firsts) {
        let begin = result.neighbours.len();
        let pair = [v, mate[v as usize]];
        let pair = if pair[0] == pair[1] { &pair[..1] } else { &pair[..] };
        for &member in pair {
            for (u, edge) in graph.edges(member) {
                let to = coarse[u as usize];
                if to == own {
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
        result.weights.push(pair.iter().map(|&member| graph.weights[member as usize]).sum());
    }
    result
}
