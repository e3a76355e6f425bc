//! HSIM on operators of no surface: solids and graphs.
//!
//! The hierarchy of [`hsim`] takes samples of a surface by area. Here its space comes from the graph of the stiffness with a length for each
//! edge, so that it serves any dimension: functions around well spread rows that fall off with the distance along edges.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use chladni_algebra::SparseMatrix;
use chladni_base::{Cancelled, Monitor, SplitMix64};
use chladni_mesh::TriangleMesh;
use rayon::prelude::*;

use super::hsim::{self, Eigenpairs, HsimError, HsimParameters, Variant, Wanted};
use crate::operator::EigenProblem;

/// The support of a function over the radius within which its centre covers its neighbours.
const REACH: f64 = 1.8;

/// Weights at or below this are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// Where the rows of an operator lie.
#[derive(Debug, Clone, Copy)]
pub enum Places<'a> {
    /// At these positions, one for each vertex.
    Positions(&'a [[f64; 3]]),
    /// Nowhere: edges have about the same length. What comes out depends on the matrices and the seed alone.
    Nowhere,
}

/// Computes the lowest eigenpairs of an operator whose rows lie in no surface, proven complete. Stages as [`hsim::solve`].
///
/// # Errors
/// [`HsimError`], as [`hsim::solve`]; a variant other than ours, or a bound instead of a count.
pub fn solve(
    problem: &EigenProblem,
    places: Places<'_>,
    vertices: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    let (Wanted::Count(count), Variant::Sliced) = (parameters.wanted, parameters.variant) else {
        let reason = "takes the variant \"sliced\" and a count".to_owned();
        return Err(HsimError::Parameter { name: "operator", reason });
    };
    // HSIM asks how many vertices there are, and where only for levels that it makes itself.
    let mesh = TriangleMesh { positions: vec![[0.0; 3]; vertices], faces: Vec::new() };
    let (n, q) = (problem.size(), hsim::columns(problem.size(), count));
    if count > n || hsim::is_dense(n, count) {
        return hsim::solve(&mesh, problem, parameters, false, monitor);
    }
    monitor.stage("sampling");
    let graph = Graph::new(problem, places, parameters.seed);
    // No radius makes fewer functions than there are components, and as many constants are taken out of them.
    let components = graph.centres(f32::INFINITY, parameters.seed, monitor)?.len();
    let wanted = dimension(q).min(3 * n / 4).max(q + q / 8) + components;
    let space = graph.space(wanted.min(n), components, parameters.seed, monitor)?;
    if space.columns() <= q + components {
        let reason = format!("the {} functions of the start are too few for {count} pairs", space.columns());
        return Err(HsimError::Numerical(reason));
    }
    let mut pairs = hsim::solve_with_space(&mesh, problem, parameters, &space, monitor)?;
    pairs.space = None;
    Ok(pairs)
}

/// Functions of a start for so many columns: so few that they are solved with densely, and no level is sampled below them.
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
    fn new(problem: &'a EigenProblem, places: Places<'_>, seed: u64) -> Self {
        let stiffness = &problem.stiffness;
        let vertex = |row: u32| problem.unknowns.as_ref().map_or(row, |unknowns| unknowns[row as usize]) as usize;
        let length = |row: u32, column: u32| match places {
            Places::Positions(positions) => {
                let (p, q) = (positions[vertex(row)], positions[vertex(column)]);
                (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
            }
            // Lengths that differ a little let the number of samples be chosen; by hops it would jump.
            Places::Nowhere => {
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
        self.functions(&centres, REACH as f32 * radius, monitor)
    }

    /// Rows such that every row lies within `radius` of one, along edges; ascending.
    fn centres(&self, radius: f32, seed: u64, monitor: &dyn Monitor) -> Result<Vec<u32>, Cancelled> {
        let n = self.size();
        let (mut covered, mut ball, mut centres) = (vec![false; n], Ball::new(n), Vec::new());
        for (k, row) in SplitMix64::new(seed).permutation(n).into_iter().enumerate() {
            if k % 256 == 0 {
                monitor.checkpoint()?;
            }
            if covered[row as usize] {
                continue;
            }
            centres.push(row);
            ball.grow(self, row, radius);
            ball.found.iter().for_each(|&(row, _)| covered[row as usize] = true);
        }
        centres.sort_unstable();
        Ok(centres)
    }

    /// One function for each centre, with a cubic profile over `radius`; rows have the sum 1.
    fn functions(&self, centres: &[u32], radius: f32, monitor: &dyn Monitor) -> Result<SparseMatrix<f32>, Cancelled> {
        let n = self.size();
        let parts: Vec<Vec<(u32, u32, f32)>> = centres
            .par_chunks(16)
            .enumerate()
            .map_init(
                || Ball::new(n),
                |ball, (chunk, part)| {
                    monitor.checkpoint()?;
                    let mut entries = Vec::new();
                    for (k, &centre) in part.iter().enumerate() {
                        ball.grow(self, centre, radius);
                        for &(row, distance) in &ball.found {
                            let x = f64::from(distance / radius);
                            let weight = 1.0 - x * x * (3.0 - 2.0 * x);
                            if weight > LEAST_WEIGHT || row == centre {
                                entries.push((row, (16 * chunk + k) as u32, weight as f32));
                            }
                        }
                    }
                    Ok(entries)
                },
            )
            .collect::<Result<_, Cancelled>>()?;
        let mut entries = parts.concat();
        entries.par_sort_unstable_by_key(|&(row, column, _)| (row, column));
        let mut offsets = vec![0usize; n + 1];
        entries.iter().for_each(|entry| offsets[entry.0 as usize + 1] += 1);
        (0..n).for_each(|row| offsets[row + 1] += offsets[row]);
        let mut values: Vec<f32> = entries.iter().map(|entry| entry.2).collect();
        for row in 0..n {
            let row = &mut values[offsets[row]..offsets[row + 1]];
            let sum: f32 = row.iter().sum();
            row.iter_mut().for_each(|value| *value /= sum);
        }
        let columns = entries.into_iter().map(|entry| entry.1).collect();
        Ok(SparseMatrix::from_sorted_parts(n, centres.len(), offsets, columns, values))
    }
}

/// What lies within a distance of a row, along edges.
struct Ball {
    distance: Vec<f32>,
    /// Rows with their distances, ascending.
    found: Vec<(u32, f32)>,
    /// Distances are not negative, so their bits are in their order.
    queue: BinaryHeap<Reverse<(u32, u32)>>,
    touched: Vec<u32>,
}

impl Ball {
    fn new(n: usize) -> Self {
        Self { distance: vec![f32::INFINITY; n], found: Vec::new(), queue: BinaryHeap::new(), touched: Vec::new() }
    }

    fn grow(&mut self, graph: &Graph<'_>, centre: u32, radius: f32) {
        self.touched.drain(..).for_each(|row| self.distance[row as usize] = f32::INFINITY);
        self.found.clear();
        self.distance[centre as usize] = 0.0;
        self.touched.push(centre);
        self.queue.push(Reverse((0, centre)));
        while let Some(Reverse((bits, row))) = self.queue.pop() {
            let at = f32::from_bits(bits);
            if at > self.distance[row as usize] {
                continue;
            }
            self.found.push((row, at));
            let start = graph.stiffness.offsets()[row as usize];
            for (k, &other) in graph.stiffness.row(row as usize).0.iter().enumerate() {
                let reached = at + graph.lengths[start + k];
                let known = &mut self.distance[other as usize];
                if reached < radius && reached < *known {
                    if *known == f32::INFINITY {
                        self.touched.push(other);
                    }
                    *known = reached;
                    self.queue.push(Reverse((reached.to_bits(), other)));
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "nested_tests.rs"]
mod tests;
