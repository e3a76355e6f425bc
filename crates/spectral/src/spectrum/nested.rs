//! HSIM on operators of no surface: solids and graphs.
//!
//! The hierarchy of [`hsim`] takes samples of a surface by area. Here its space comes from the graph of the stiffness
//! with a length for each edge, so that it serves any dimension: functions around well spread rows that fall off with
//! the distance along edges.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, SplitMix64};
use chladni_mesh::TriangleMesh;

use super::hsim::{self, Eigenpairs, HsimError, HsimParameters, Selection, Variant};
use super::local::{self, Search};
use crate::operator::EigenProblem;

/// The support of a function over the radius within which its centre covers its neighbours.
const REACH: f64 = 1.8;

/// Where the rows of an operator lie.
#[derive(Debug, Clone, Copy)]
pub enum RowPositions<'a> {
    /// At these positions, one for each vertex.
    Positions(&'a [[f64; 3]]),
    /// Nowhere: edges have about the same length. What comes out depends on the matrices and the seed alone.
    Nowhere,
}

/// Computes the lowest eigenpairs of an operator whose rows lie in no surface, proven complete. Stages as
/// [`hsim::solve`].
///
/// # Errors
/// [`HsimError`], as [`hsim::solve`]; a variant other than ours, or a bound instead of a count.
pub fn solve(
    problem: &EigenProblem,
    places: RowPositions<'_>,
    vertices: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    let (Selection::Count(count), Variant::Sliced) = (parameters.selection, parameters.variant) else {
        let reason = "needs the variant \"sliced\" and a count".to_owned();
        return Err(HsimError::Parameter { name: "operator", reason });
    };
    // HSIM asks how many vertices there are, and where only for levels that it makes itself.
    let mesh = TriangleMesh { positions: vec![[0.0; 3]; vertices], faces: Vec::new(), ..Default::default() };
    let (n, q) = (problem.size(), hsim::columns(problem.size(), count));
    if count > n || hsim::is_dense_by_blocks(problem, count) {
        return hsim::solve(&mesh, problem, parameters, false, monitor);
    }
    monitor.stage("sampling");
    let graph = Graph::new(problem, places, parameters.seed);
    // No radius makes fewer functions than there are components, and as many constants are taken out of them.
    let components = graph.centres(f32::INFINITY, parameters.seed, monitor)?.len();
    if components == n {
        return hsim::solve(&mesh, problem, parameters, false, monitor);
    }
    let wanted = dimension(q).min(3 * n / 4).max(q + q / 8) + components;
    let space = graph.space(wanted.min(n), components, parameters.seed, monitor)?;
    if space.columns() <= q + components {
        // Where every vertex is near to every other, as on a star, no functions around some tell more than random ones.
        let plain = HsimParameters { variant: Variant::Random, ..*parameters };
        return hsim::solve(&mesh, problem, &plain, false, monitor);
    }
    let mut pairs = hsim::solve_with_space(&mesh, problem, parameters, &space, monitor)?;
    pairs.space = None;
    Ok(pairs)
}

/// Functions of a start for so many columns: so few that they are solved with densely, and no level is sampled below
/// them.
fn dimension(columns: usize) -> usize {
    (3 * columns).max(600).min(columns + 1500)
}

/// The graph of a stiffness, with lengths.
struct Graph<'a> {
    stiffness: &'a SparseMatrix,
    /// A length for each entry.
    lengths: Vec<f32>,
}

impl<'a> Graph<'a> {
    fn new(problem: &'a EigenProblem, places: RowPositions<'_>, seed: u64) -> Self {
        let stiffness = &problem.stiffness;
        let vertex = |row: u32| problem.unknowns.as_ref().map_or(row, |unknowns| unknowns[row as usize]) as usize;
        let length = |row: u32, column: u32| match places {
            RowPositions::Positions(positions) => {
                let (p, q) = (positions[vertex(row)], positions[vertex(column)]);
                (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
            }
            // Lengths that differ a little let the number of samples be chosen; by hops it would jump.
            RowPositions::Nowhere => {
                let (low, high) = (row.min(column), row.max(column));
                let mut random = SplitMix64::new(seed ^ ((u64::from(low) << 32) | u64::from(high)));
                1.0 + 0.5 * random.signed_unit()
            }
        };
        let lengths: Vec<f64> = (0..stiffness.rows() as u32)
            .into_par_iter()
            .flat_map_iter(|row| stiffness.row(row as usize).0.iter().map(move |&column| length(row, column)))
            .collect();
        // In units of their mean, which no scale of the input takes out of single precision.
        let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
        let unit = if mean > 0.0 && mean.is_finite() { mean.recip() } else { 1.0 };
        Self { stiffness, lengths: lengths.into_iter().map(|length| (length * unit) as f32).collect() }
    }

    fn size(&self) -> usize {
        self.stiffness.rows()
    }

    /// About `wanted` functions, rows with sum 1.
    fn space(
        &self,
        wanted: usize,
        components: usize,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<SparseMatrix<f32>, Cancelled> {
        // A radius with too many centres, and one with few enough.
        let (mut low, mut high) = (0.0, (self.size() as f32 / wanted.max(1) as f32).cbrt());
        let mut centres = self.centres(high, seed, monitor)?;
        while centres.len() > wanted.max(components) && high < 1e6 {
            (low, high) = (high, 1.5 * high);
            centres = self.centres(high, seed, monitor)?;
        }
        let mut radius = high;
        for _ in 0..12 {
            if centres.len() * 100 >= 95 * wanted && centres.len() <= wanted {
                break;
            }
            let middle = 0.5 * (low + high);
            let found = self.centres(middle, seed, monitor)?;
            if found.len() > wanted {
                low = middle;
            } else {
                (high, radius, centres) = (middle, middle, found);
            }
        }
        monitor.stage("basis");
        let reach = REACH as f32 * radius;
        local::functions_by(self.size(), || Ball::new(self, reach), &centres, monitor)
    }

    /// Rows such that every row lies within `radius` of one, along edges; ascending.
    fn centres(&self, radius: f32, seed: u64, monitor: &dyn Monitor) -> Result<Vec<u32>, Cancelled> {
        local::cover(self.size(), Ball::new(self, radius), seed, monitor)
    }
}

/// What lies within a distance of a row, along edges.
struct Ball<'a> {
    graph: &'a Graph<'a>,
    radius: f32,
    distance: Vec<f32>,
    /// Rows with their shares of the radius, ascending.
    found: Vec<(u32, f64)>,
    /// Distances are not negative, so their bits are in their order.
    queue: BinaryHeap<Reverse<(u32, u32)>>,
    touched: Vec<u32>,
}

impl<'a> Ball<'a> {
    fn new(graph: &'a Graph<'a>, radius: f32) -> Self {
        let distance = vec![f32::INFINITY; graph.size()];
        Self { graph, radius, distance, found: Vec::new(), queue: BinaryHeap::new(), touched: Vec::new() }
    }
}

impl Search for Ball<'_> {
    fn around(&mut self, centre: u32) -> &[(u32, f64)] {
        let Self { graph, radius, distance, found, queue, touched } = self;
        touched.drain(..).for_each(|row| distance[row as usize] = f32::INFINITY);
        found.clear();
        distance[centre as usize] = 0.0;
        touched.push(centre);
        queue.push(Reverse((0, centre)));
        while let Some(Reverse((bits, row))) = queue.pop() {
            let at = f32::from_bits(bits);
            if at > distance[row as usize] {
                continue;
            }
            found.push((row, f64::from(at / *radius)));
            let start = graph.stiffness.offsets()[row as usize];
            for (k, &other) in graph.stiffness.row(row as usize).0.iter().enumerate() {
                let reached = at + graph.lengths[start + k];
                let known = &mut distance[other as usize];
                if reached < *radius && reached < *known {
                    if *known == f32::INFINITY {
                        touched.push(other);
                    }
                    *known = reached;
                    queue.push(Reverse((reached.to_bits(), other)));
                }
            }
        }
        found
    }
}

#[cfg(test)]
#[path = "nested_tests.rs"]
mod tests;
