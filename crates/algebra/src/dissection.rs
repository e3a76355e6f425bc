//! Nested dissection: rows of a symmetric matrix in an order with little fill, by small separators of its graph. What a
//! separator parts is ordered by all threads at once (docs/decisions/0115). After Karypis and Kumar, *A fast and high
//! quality multilevel scheme for partitioning irregular graphs* (1998).

mod clusters;
mod coarsen;
mod graph;
mod halves;
mod leaf;
mod refine;
mod separator;
#[cfg(test)]
#[path = "dissection_tests.rs"]
mod tests;

use super::SparseMatrix;
use chladni_base::Spare;
use clusters::Clusters;
use graph::Graph;
use refine::{SEPARATOR, Scratch};

/// Parts of so few vertices are ordered by minimum degree. With 250 ordering takes a fifth less of the time, and
/// factors have 1.3 % more entries.
const LEAF: usize = 150;

/// So many dissections within each other: neither side weighs more than .7 of the whole unless a single vertex does,
/// and all rows weigh less than 2³².
const DEEPEST: usize = 80;

/// Larger parts that could not be dissected stay as they are: minimum degree takes the square of their memory.
const LARGEST_LEAF: usize = 10_000;

/// The rows of the symmetric `matrix` in an order of elimination that fills in little; the same on any number of
/// threads.
pub(super) fn nested_dissection(matrix: &SparseMatrix) -> Vec<u32> {
    let whole = Graph::of(matrix);
    match whole.compressed() {
        None => ordered(&whole),
        Some((groups, group)) => expanded(&ordered(&groups), &group),
    }
}

/// The members of groups in the order of their groups.
fn expanded(order: &[u32], group: &[u32]) -> Vec<u32> {
    let mut place = vec![0u32; order.len()];
    order.iter().zip(0..).for_each(|(&g, at)| place[g as usize] = at);
    let mut rows: Vec<u32> = (0..group.len() as u32).collect();
    rows.sort_by_key(|&row| place[group[row as usize] as usize]);
    rows
}

fn ordered(graph: &Graph) -> Vec<u32> {
    let mut order = vec![0u32; graph.len()];
    let whole = Whole { graph, scratch: Spare::default() };
    let rows = (0..graph.len() as u32).collect();
    dissect(None, &whole, Part { rows, clusters: Clusters::of(graph) }, &mut order, DEEPEST);
    order
}

/// The graph that is dissected, and memory.
struct Whole<'a> {
    graph: &'a Graph,
    scratch: Spare<Scratch>,
}

/// What is known of the vertices of a part beside their edges.
struct Part {
    /// Their numbers in the whole, ascending.
    rows: Vec<u32>,
    clusters: Clusters,
}

/// Orders the vertices of a part by `deeper` more dissections at most. Its graph is that of the whole where none is
/// given.
fn dissect(graph: Option<Graph>, whole: &Whole<'_>, part: Part, order: &mut [u32], deeper: usize) {
    let own = graph.as_ref().unwrap_or(whole.graph);
    if own.len() <= LEAF || deeper == 0 {
        return eliminate(whole.graph, &part.rows, order);
    }
    let Part { rows, clusters } = part;
    let cut = separator::separator(own, &clusters, &whole.scratch);
    let [left, right] = own.split(&cut.side).map(|(graph, vertices)| {
        let rows = vertices.iter().map(|&v| rows[v as usize]).collect();
        (graph, Part { rows, clusters: clusters.within(&vertices) })
    });
    let between = rows.iter().zip(&cut.side).filter(|&(_, &side)| side == SEPARATOR).map(|(&row, _)| row);
    let last = left.0.len() + right.0.len();
    order[last..].iter_mut().zip(between).for_each(|(to, row)| *to = row);
    drop((graph, rows, clusters, cut));
    let (first, second) = order[..last].split_at_mut(left.0.len());
    rayon::join(
        || dissect(Some(left.0), whole, left.1, first, deeper - 1),
        || dissect(Some(right.0), whole, right.1, second, deeper - 1),
    );
}

/// Minimum degree for a part, whose neighbours in separators come later.
fn eliminate(whole: &Graph, rows: &[u32], order: &mut [u32]) {
    if rows.len() > LARGEST_LEAF {
        return order.copy_from_slice(rows);
    }
    let mut halo: Vec<u32> = Vec::new();
    for &row in rows {
        halo.extend(whole.neighbours(row).iter().filter(|u| rows.binary_search(u).is_err()));
    }
    halo.sort_unstable();
    halo.dedup();
    let mut beside = Vec::new();
    let mut starts = vec![0];
    for &row in rows {
        beside.extend(whole.neighbours(row).iter().map(|u| match rows.binary_search(u) {
            Ok(own) => own as u32,
            Err(_) => (rows.len() + halo.partition_point(|h| h < u)) as u32,
        }));
        starts.push(beside.len());
    }
    let own = leaf::minimum_degree(rows.len(), halo.len(), |i| &beside[starts[i]..starts[i + 1]]);
    order.iter_mut().zip(own).for_each(|(to, i)| *to = rows[i as usize]);
}
