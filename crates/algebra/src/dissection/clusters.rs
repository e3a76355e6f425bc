//! Clusters of a graph, and clusters of those: found once for the whole graph, and handed down to all of its parts,
//! which would spend most of their time on finding their own.

use super::coarsen::{coarsened, contracted, joined};
use super::graph::Graph;

/// How often vertices are paired for a cluster: eight vertices in each. With two or four, and more levels, factors have
/// as many entries within 2 %, and orders take as long or longer.
const PAIRINGS: u32 = 3;

/// Clusters within each other.
const LEVELS: u32 = 2;

/// Graphs of so few vertices are halved without clusters.
const FEW: usize = 100;

/// For each vertex of a graph its cluster, for each cluster that of the next level, and so on. Every cluster has a
/// member.
pub(super) struct Clusters {
    levels: Vec<Level>,
}

struct Level {
    /// The cluster of each member.
    of: Vec<u32>,
    count: usize,
}

impl Clusters {
    /// Those of a graph: neighbours along heavy edges, of about equal weight.
    pub fn of(graph: &Graph) -> Self {
        let mut levels: Vec<Level> = Vec::new();
        let mut held: Option<Graph> = None;
        for level in 1..=LEVELS {
            let heaviest = 2 << (level * PAIRINGS);
            let mut found: Option<Level> = None;
            for _ in 0..PAIRINGS {
                let below = held.as_ref().unwrap_or(graph);
                let (false, Some((coarse, pairs))) = (below.len() <= 2 * FEW, coarsened(below, heaviest)) else {
                    break;
                };
                let of = match found {
                    Some(Level { of, .. }) => joined(&of, &pairs),
                    None => pairs,
                };
                found = Some(Level { of, count: coarse.len() });
                held = Some(coarse);
            }
            match found {
                Some(found) => levels.push(found),
                None => break,
            }
        }
        Self { levels }
    }

    /// Those of some vertices alone, in their order; each level is numbered anew.
    pub fn within(&self, vertices: &[u32]) -> Self {
        let mut levels = Vec::new();
        let mut members = vertices.to_vec();
        for level in &self.levels {
            let mut renamed = vec![u32::MAX; level.count];
            let mut kept = Vec::new();
            let number = |&member: &u32| {
                let cluster = level.of[member as usize];
                let new = &mut renamed[cluster as usize];
                if *new == u32::MAX {
                    *new = kept.len() as u32;
                    kept.push(cluster);
                }
                *new
            };
            let of = members.iter().map(number).collect();
            levels.push(Level { of, count: kept.len() });
            members = kept;
        }
        Self { levels }
    }

    /// The graphs of clusters, each with the cluster of each vertex of the one before; none of a graph that is small
    /// enough.
    pub fn graphs(&self, graph: &Graph) -> Vec<(Graph, Vec<u32>)> {
        let mut graphs: Vec<(Graph, Vec<u32>)> = Vec::new();
        for level in &self.levels {
            let below = graphs.last().map_or(graph, |level| &level.0);
            if below.len() <= FEW {
                break;
            }
            graphs.push((contracted(below, &level.of, level.count), level.of.clone()));
        }
        graphs
    }
}
