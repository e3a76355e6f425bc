//! A small separator of a graph by a hierarchy of coarser graphs.

use chladni_base::Spare;
use chladni_base::parallel::*;

use super::clusters::Clusters;
use super::coarsen::coarsened;
use super::graph::{Graph, mix};
use super::halves::{self, Halves};
use super::refine::{Cut, Scratch, refine};

/// How a separator is looked for; docs/decisions/0115 says what else was tried.
struct Tuning {
    /// Graphs of so few vertices are halved without a coarser one.
    coarsest: usize,
    /// How many halves of the coarsest graph are made, of which the best is taken.
    seeds: u32,
    /// Graphs of so many vertices are halved several times, from the graph of their clusters on.
    large: usize,
    trials: u32,
    /// The share that the larger side may have, in hundredths.
    larger_side: u64,
}

const TUNING: Tuning = Tuning { coarsest: 100, seeds: 5, large: 4_000, trials: 4, larger_side: 70 };

/// A graph with the vertex of it that each vertex of the finer one belongs to.
type CoarserGraph = (Graph, Vec<u32>);

/// The vertices in two sides and a separator. Graphs of one vertex, and complete ones, have nothing on one side.
///
/// Halves with few edges between them are found and followed down the hierarchy, since an edge weighs the same on all
/// levels, while a vertex stands for many that would not all separate. The vertices along the cut on either side
/// separate, and become fewer. The finest levels of the hierarchy are those of the `clusters` of the vertices.
pub(super) fn separator(graph: &Graph, clusters: &Clusters, scratch: &Spare<Scratch>) -> Cut {
    let most = most(graph);
    let levels = clusters.graphs(graph);
    let top = levels.last().map_or(graph, |level| &level.0);
    let first = || scratch.with(Scratch::default, |scratch| from_the_coarsest(top, 0, scratch));
    let halved = if graph.len() >= TUNING.large {
        let others = || {
            let trial = |trial| scratch.with(Scratch::default, |scratch| from_the_coarsest(top, trial, scratch));
            (1..TUNING.trials).into_par_iter().map(trial).collect::<Vec<_>>()
        };
        let (first, others) = rayon::join(first, others);
        cheapest(first, others, |(halves, _)| halves.cost(most))
    } else {
        first()
    };
    scratch.with(Scratch::default, |scratch| {
        let (halves, boundary) = descend(graph, &levels, halved, scratch);
        let mut along = |side| {
            let (mut cut, separator) = halves.separated(&boundary, side, graph);
            refine(graph, &mut cut, separator, most, scratch);
            cut
        };
        let (first, second) = (along(0), along(1));
        cheapest(first, [second], |cut| cut.cost(most))
    })
}

/// The first of least cost, of `one` and the `others`.
fn cheapest<T, C: Ord>(one: T, others: impl IntoIterator<Item = T>, cost: impl Fn(&T) -> C) -> T {
    others.into_iter().fold(one, |best, next| if cost(&next) < cost(&best) { next } else { best })
}

/// Halves of a graph by all of its coarser ones, with the vertices along the cut.
fn from_the_coarsest(graph: &Graph, trial: u32, scratch: &mut Scratch) -> (Halves, Vec<u32>) {
    let heaviest = (3 * graph.total_weight() / (2 * TUNING.coarsest as u64)).clamp(1, u64::from(u32::MAX / 2)) as u32;
    let mut levels: Vec<CoarserGraph> = Vec::new();
    loop {
        let below = levels.last().map_or(graph, |level| &level.0);
        if below.len() <= TUNING.coarsest {
            break;
        }
        match coarsened(below, heaviest) {
            Some(level) => levels.push(level),
            None => break,
        }
    }
    let first = coarsest(levels.last().map_or(graph, |level| &level.0), trial, scratch);
    descend(graph, &levels, first, scratch)
}

fn descend(
    graph: &Graph,
    levels: &[CoarserGraph],
    halved: (Halves, Vec<u32>),
    scratch: &mut Scratch,
) -> (Halves, Vec<u32>) {
    let most = most(graph);
    let (mut halves, mut boundary) = halved;
    for at in (0..levels.len()).rev() {
        let fine = if at == 0 { graph } else { &levels[at - 1].0 };
        let (coarse, belongs) = &levels[at];
        let mut along = vec![false; coarse.len()];
        boundary.iter().for_each(|&v| along[v as usize] = true);
        let candidates = (0..fine.len() as u32).filter(|&v| along[belongs[v as usize] as usize]).collect();
        halves.side = belongs.iter().map(|&v| halves.side[v as usize]).collect();
        boundary = halves::refine(fine, &mut halves, candidates, most, scratch);
    }
    (halves, boundary)
}

fn most(graph: &Graph) -> u64 {
    graph.total_weight() * TUNING.larger_side / 100
}

/// The best of some halves that grow from single vertices, with the vertices along the cut.
fn coarsest(graph: &Graph, trial: u32, scratch: &mut Scratch) -> (Halves, Vec<u32>) {
    let most = most(graph);
    let mut grown = |seed| {
        let start = (mix(seed) % graph.len().max(1) as u64) as u32;
        let mut halves = halves::grow(graph, start);
        let boundary = halves::refine(graph, &mut halves, (0..graph.len() as u32).collect(), most, scratch);
        (halves, boundary)
    };
    let seeds = trial * TUNING.seeds;
    let first = grown(seeds);
    cheapest(first, (seeds + 1..seeds + TUNING.seeds).map(grown), |(halves, _)| halves.cost(most))
}
