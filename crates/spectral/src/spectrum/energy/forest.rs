//! What a cycle leaves of a residual, from above: by trees.
//!
//! `‖e‖²_{A⁻¹} ≤ ‖e‖²_{B⁻¹}` for every `B ≤ A`. With `B = σM` alone what is left is divided by masses next to nothing,
//! and the finer the mesh, the more cycles it takes until that says something. But `S` is a sum `Σ w (x_i − x_j)²` over
//! edges, and one that keeps the edges of a forest alone is below it: `B = T + σM` is eliminated from the leaves to the
//! roots without fill, in one addition and one product for each row.
//!
//! What is left changes its sign within a few rows, and is told small where these are near each other in a tree as
//! well. So rows are gathered into stars along strong edges, stars into stars of stars, and so on: whatever two rows a
//! tree connects, it does so within a cluster of about their distance.
//!
//! Where an angle is obtuse the weight of an edge may be negative: [`obtuse`](super::obtuse) tells what may be taken of
//! the others then.

use std::ops::Range;

use chladni_base::parallel::*;

use super::obtuse::Obtuse;
use chladni_algebra::gpu::TreeNode;
use chladni_algebra::{Patch, SparseMatrix};

/// Row sums of a stiffness are zero up to so many times the rounding of its entries.
pub(super) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Of a cluster's edges those are strong that weigh this share of its heaviest.
const STRONG: f64 = 0.25;

/// Trees on the rows, each within a patch.
#[derive(Debug)]
pub(super) struct Forest {
    /// Row by row in the order of elimination, patch after patch.
    nodes: Vec<TreeNode>,
}

/// How a row is eliminated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pivot {
    /// The row, numbered within its patch.
    pub(super) row: u32,
    /// The one that gets `share` times what this one has.
    pub(super) parent: u32,
    pub(super) share: f64,
    /// Over the pivot.
    pub(super) inverse: f64,
}

impl Forest {
    /// A forest below `stiffness + floor · mass`. Of the cotangents of a surface `obtuse` tells what edges may be taken
    /// for; of any other matrix that is known where weights are positive and rows sum to zero or more, and else there
    /// is nothing.
    pub(super) fn below(
        stiffness: &SparseMatrix,
        mass: &[f64],
        floor: f64,
        patches: &[Patch],
        obtuse: Option<&Obtuse>,
    ) -> Option<Self> {
        let dominates = |row: usize| {
            let (columns, values) = stiffness.row(row);
            let (sum, size) = values.iter().fold((0.0, 0.0), |(sum, size): (f64, f64), &v| (sum + v, size + v.abs()));
            let is_negative = |(column, value): (&u32, &f64)| *column as usize != row && *value > ROUNDING * size;
            sum + floor * mass[row] >= -ROUNDING * size && !columns.iter().zip(values).any(is_negative)
        };
        if obtuse.is_none() && !(0..stiffness.rows()).into_par_iter().all(dominates) {
            return None;
        }
        let trees: Vec<Vec<TreeNode>> =
            patches.par_iter().map(|patch| nodes(stiffness, obtuse, patch.rows())).collect();
        Some(Self { nodes: trees.into_iter().flatten().collect() })
    }

    /// Row by row in the order of elimination, patch after patch; numbered within the patch.
    pub(super) fn nodes(&self) -> &[TreeNode] {
        &self.nodes
    }

    /// How the rows of a patch are eliminated, with `base` on the diagonal of each. Pivots are divided by `scale`.
    pub(super) fn pivots(&self, rows: Range<usize>, base: impl Fn(usize) -> f64, scale: f64, memory: &mut Pivots) {
        let Pivots { pivots, grounds } = memory;
        // What a row is grounded by: its mass, and that of its children through their edges.
        grounds.clear();
        grounds.extend(rows.clone().map(base));
        pivots.clear();
        pivots.extend(self.nodes[rows].iter().map(|node| {
            let (weight, ground) = (f64::from(node.weight), grounds[node.row as usize]);
            let inverse = 1.0 / (ground + weight);
            let share = weight * inverse;
            grounds[node.parent as usize] += share * ground;
            Pivot { row: node.row, parent: node.parent, share, inverse: scale * inverse }
        }));
    }
}

/// The pivots of a patch in the order of elimination, and memory for finding them.
#[derive(Debug, Default)]
pub(super) struct Pivots {
    pivots: Vec<Pivot>,
    grounds: Vec<f64>,
}

impl Pivots {
    /// The pivots that were found last.
    pub(super) fn all(&self) -> &[Pivot] {
        &self.pivots
    }

    /// Those of a mass alone, which no edges are added to.
    pub(super) fn of_mass(&mut self, mass: &[f64]) {
        let alone = |(row, &mass): (u32, &f64)| Pivot { row, parent: row, share: 0.0, inverse: 1.0 / mass };
        self.pivots.clear();
        self.pivots.extend((0..).zip(mass).map(alone));
    }
}

/// An edge between two rows of a patch.
#[derive(Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    weight: f64,
    /// The clusters that its ends are in.
    clusters: [u32; 2],
}

/// The rows of a patch in the order of elimination.
fn nodes(stiffness: &SparseMatrix, obtuse: Option<&Obtuse>, rows: Range<usize>) -> Vec<TreeNode> {
    let (m, start) = (rows.len(), rows.start as u32);
    let mut edges = Vec::with_capacity(3 * m);
    for row in rows.clone() {
        let (columns, values) = stiffness.row(row);
        let changes = obtuse.map(|obtuse| obtuse.row(row as u32));
        let inside = columns.iter().zip(values).filter(|&(&c, _)| c as usize > row && (c as usize) < rows.end);
        for (&column, &value) in inside {
            let weight = changes.as_ref().map_or(-value, |changes| changes.left(column, -value));
            let ends = [row as u32 - start, column - start];
            edges.push(Edge { ends, weight, clusters: ends });
        }
    }
    // A weight of rounding errors is none.
    edges.retain(|edge| edge.weight > 0.0 && edge.weight as f32 > f32::MIN_POSITIVE);
    let mut kept: Vec<Edge> = Vec::with_capacity(m);
    let mut clusters = m;
    while !edges.is_empty() {
        let star_of = stars(&mut edges, clusters, &mut kept);
        for edge in &mut edges {
            edge.clusters = edge.clusters.map(|cluster| star_of[cluster as usize]);
        }
        edges.retain(|edge| edge.clusters[0] != edge.clusters[1]);
        clusters = star_of.iter().max().map_or(0, |&last| last as usize + 1);
    }
    rooted(m, &kept)
}

/// Gathers clusters into stars along strong edges; the star of each cluster. The edges that hold them together go to
/// `kept`; of several edges between two clusters one is left, the heaviest.
fn stars(edges: &mut Vec<Edge>, clusters: usize, kept: &mut Vec<Edge>) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    edges.iter_mut().for_each(|edge| {
        if edge.clusters[0] > edge.clusters[1] {
            edge.clusters.swap(0, 1);
            edge.ends.swap(0, 1);
        }
    });
    edges.sort_unstable_by(|a, b| {
        a.clusters.cmp(&b.clusters).then(b.weight.total_cmp(&a.weight)).then(a.ends.cmp(&b.ends))
    });
    edges.dedup_by_key(|edge| edge.clusters);
    let mut offsets = vec![0u32; clusters + 1];
    let mut heaviest = vec![0.0f64; clusters];
    for edge in &*edges {
        for cluster in edge.clusters {
            offsets[cluster as usize + 1] += 1;
            heaviest[cluster as usize] = heaviest[cluster as usize].max(edge.weight);
        }
    }
    (0..clusters).for_each(|cluster| offsets[cluster + 1] += offsets[cluster]);
    let mut next = offsets.clone();
    let mut beside = vec![0u32; 2 * edges.len()];
    for (at, edge) in edges.iter().enumerate() {
        for cluster in edge.clusters {
            beside[next[cluster as usize] as usize] = at as u32;
            next[cluster as usize] += 1;
        }
    }
    let edges: &[Edge] = edges;
    let of = |cluster: usize| {
        beside[offsets[cluster] as usize..offsets[cluster + 1] as usize].iter().map(move |&at| {
            let edge = edges[at as usize];
            (edge, if edge.clusters[0] as usize == cluster { edge.clusters[1] } else { edge.clusters[0] } as usize)
        })
    };
    let mut star_of = vec![NONE; clusters];
    let mut count = 0;
    for cluster in 0..clusters {
        let strong = || of(cluster).filter(|(edge, _)| edge.weight >= STRONG * heaviest[cluster]);
        if star_of[cluster] == NONE && strong().all(|(_, other)| star_of[other] == NONE) {
            star_of[cluster] = count;
            for (edge, other) in strong() {
                star_of[other] = count;
                kept.push(edge);
            }
            count += 1;
        }
    }
    // What is left hangs on the star that it is bound to most.
    let centres = star_of.clone();
    for cluster in (0..clusters).filter(|&cluster| centres[cluster] == NONE) {
        let joined =
            of(cluster).filter(|&(_, other)| centres[other] != NONE).max_by(|a, b| a.0.weight.total_cmp(&b.0.weight));
        match joined {
            Some((edge, other)) => {
                star_of[cluster] = centres[other];
                kept.push(edge);
            }
            None => {
                star_of[cluster] = count;
                count += 1;
            }
        }
    }
    star_of
}

/// Trees of so many rows by their edges, children before what they hang on.
fn rooted(m: usize, edges: &[Edge]) -> Vec<TreeNode> {
    let mut offsets = vec![0u32; m + 1];
    edges.iter().flat_map(|edge| edge.ends).for_each(|end| offsets[end as usize + 1] += 1);
    (0..m).for_each(|row| offsets[row + 1] += offsets[row]);
    let mut next = offsets.clone();
    let mut beside = vec![(0u32, 0.0f64); 2 * edges.len()];
    for edge in edges {
        for (from, to) in [(edge.ends[0], edge.ends[1]), (edge.ends[1], edge.ends[0])] {
            beside[next[from as usize] as usize] = (to, edge.weight);
            next[from as usize] += 1;
        }
    }
    let mut nodes: Vec<TreeNode> = Vec::with_capacity(m);
    let mut seen = vec![false; m];
    for root in 0..m {
        if std::mem::replace(&mut seen[root], true) {
            continue;
        }
        let mut at = nodes.len();
        nodes.push(TreeNode { row: root as u32, parent: root as u32, weight: 0.0 });
        while let Some(&TreeNode { row, .. }) = nodes.get(at) {
            for &(child, weight) in &beside[offsets[row as usize] as usize..offsets[row as usize + 1] as usize] {
                if !std::mem::replace(&mut seen[child as usize], true) {
                    // Stored in single precision, it is a little less.
                    nodes.push(TreeNode { row: child, parent: row, weight: (weight * (1.0 - 1e-7)) as f32 });
                }
            }
            at += 1;
        }
    }
    nodes.reverse();
    nodes
}

#[cfg(test)]
#[path = "forest_tests.rs"]
mod tests;
