//! The method as published (thesis, Algorithms 1 to 3), and plain subspace iteration as a baseline.
//!
//! One reading differs: (4.9) takes the `T`-th root for the growth between `T` levels, of which there are `T − 1`
//! steps; the `(T − 1)`-th root makes the finest level the mesh.

use chladni_algebra::{DenseMatrix, Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, prolong};
use chladni_base::Monitor;
use chladni_base::SplitMix64;
use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::DistanceKind;
use chladni_mesh::sample::farthest_points;

use super::dense_pairs::dense_pairs;
use super::iterate::Iteration;
use super::kernel::Kernel;
use super::level::{Level, NO_KERNEL, coarsened};
use super::{HsimError, HsimParameters, LevelReport, Variant};
use crate::spectrum::radial::{self, Profile};

/// The supports of prolongation functions overlap so many times (4.10).
const SIGMA: f64 = 7.0;

/// The most iterations on a level.
const MOST_ITERATIONS: usize = 60;

/// Columns to iterate on (4.14), or as many as the factor asks for.
pub(super) fn columns(wanted: usize, factor: Option<f64>, size: usize) -> usize {
    let least = (1.5 * wanted as f64).ceil() as usize;
    factor.map_or(least.max(wanted + 8), |factor| (factor * wanted as f64).ceil() as usize).clamp(wanted, size)
}

/// Columns for the iteration on the finest level, from the levels above it.
pub(super) struct Start {
    pub vectors: PanelMatrix,
    pub values: Vec<f64>,
    pub space: Option<SparseMatrix<f32>>,
    pub reports: Vec<LevelReport>,
}

/// Algorithm 3 down to the level above the mesh. `places` is the row of `fine` that each vertex has, if it is an
/// unknown.
pub(super) fn start(
    mesh: &TriangleMesh,
    fine: &Level,
    places: &[Option<u32>],
    wanted: usize,
    q: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<Start, HsimError> {
    let n = fine.size();
    let levels = parameters.levels.unwrap_or(if wanted <= 200 { 2 } else { 3 });
    let coarsest = ((1.5 * wanted as f64).ceil() as usize).max(1000).max(q);
    if levels < 2 || n < 2 * coarsest {
        return Err(HsimError::Parameter {
            name: if parameters.levels.is_some() { "levels" } else { "variant" },
            reason: format!("a mesh of {n} unknowns is too small for a coarsest level of {coarsest}"),
        });
    }
    let growth = (n as f64 / coarsest as f64).powf(1.0 / (levels - 1) as f64);
    // Finest first: n¹ … n^(T−1).
    let sizes: Vec<usize> = (0..levels - 1).rev().map(|k| (coarsest as f64 * growth.powi(k as i32)) as usize).collect();
    let connectivity = Connectivity::new(mesh);
    let samples = farthest_points(&connectivity, sizes[0], parameters.seed, monitor)?;
    let sigma = parameters.sigma.unwrap_or(SIGMA);
    let mut levels: Vec<Level> = Vec::new();
    let mut spaces: Vec<SparseMatrix<f32>> = Vec::new();
    // The vertex of each row of the level in hand.
    let mut vertices: Vec<u32> = vec![0; n];
    for (vertex, place) in places.iter().enumerate() {
        if let Some(place) = place {
            vertices[*place as usize] = vertex as u32;
        }
    }
    for (k, &size) in sizes.iter().enumerate() {
        let part = &samples[..size.min(samples.len())];
        let all = radial::columns(mesh, &connectivity, part, DistanceKind::Dijkstra, Profile::Linear, sigma, monitor)?;
        let (space, kept) = rows_with_all_columns(&all, &vertices);
        let level = levels.last().unwrap_or(fine);
        // The vertex that a column belongs to: the first ones are samples, others were added where no sample reached.
        let owners = owners(&all, part);
        let centres: Vec<u32> = kept.iter().map(|&column| owners[column as usize]).collect();
        let positions = vec![0; centres.len()];
        let last = k + 1 == sizes.len();
        let (coarse, space, order) = reorder(level, &space, &positions, (!last).then_some(Ordering::Amd), monitor)?;
        vertices = order.iter().map(|&at| centres[at as usize]).collect();
        levels.push(coarse);
        spaces.push(space);
    }
    let count = levels.len();
    let (mut values, mut vectors, mut reports) = (Vec::new(), PanelMatrix::default(), Vec::new());
    for (k, level) in levels.iter().enumerate().rev() {
        monitor.detail(&format!("level {} of {}, dimension {}", count - k, count + 1, level.size()));
        if k + 1 == count {
            (values, vectors) = dense_pairs(level, q, monitor)?;
            reports.push(LevelReport { dimension: level.size(), iterations: 0, shifts: 0 });
            continue;
        }
        let kernel = Kernel::new(level);
        let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass)?.within(1, monitor)?;
        let shift = shift(&values, wanted, parameters.shift_ratio);
        let mut iteration =
            Iteration::new(level, &symbolic, &kernel, prolong(&spaces[k + 1], &vectors), values, monitor);
        subspace_iteration(&mut iteration, shift, wanted, parameters.tolerance)?;
        reports.push(LevelReport { dimension: level.size(), iterations: iteration.passes, shifts: 1 });
        (values, vectors) = (iteration.values, iteration.vectors);
    }
    let vectors = prolong(&spaces[0], &vectors);
    Ok(Start { vectors, values, space: Some(spaces.swap_remove(0)), reports })
}

/// Algorithm 1: two inverse iterations, one Rayleigh–Ritz, until the wanted pairs pass (4.6). The first vectors stop
/// once all of them are ten times better than they have to be.
pub(super) fn subspace_iteration(
    iteration: &mut Iteration<'_>,
    shift: f64,
    wanted: usize,
    tolerance: f64,
) -> Result<(), HsimError> {
    let mut done = 0;
    for pass in 0..MOST_ITERATIONS {
        iteration.monitor.detail(&format!("dimension {}, iteration {}", iteration.level.size(), pass + 1));
        iteration.monitor.progress(pass as f64 / MOST_ITERATIONS as f64);
        iteration.step(shift, done, 2)?;
        iteration.passes += 1;
        let residuals: Vec<f64> = (0..wanted.min(iteration.values.len())).map(|k| iteration.residual(k)).collect();
        if residuals.iter().all(|&residual| residual <= tolerance) {
            return Ok(());
        }
        done = residuals.iter().position(|&residual| !(residual <= 0.1 * tolerance)).unwrap_or(residuals.len());
    }
    Ok(())
}

/// The shift of Algorithm 3, line 12: midway between two Ritz values that are clearly apart, near the index that the
/// ratio says; just below zero for index 0.
pub(super) fn shift(values: &[f64], wanted: usize, ratio: f64) -> f64 {
    let at = (ratio * wanted as f64) as usize;
    let clear = |k: usize| values[k] - values[k - 1] > 1e-3 * values[k].abs();
    (1..=at.min(values.len().saturating_sub(1)))
        .rev()
        .find(|&k| values[k - 1] > 0.0 && clear(k))
        .map_or(BELOW_ZERO, |k| 0.5 * (values[k - 1] + values[k]))
}

/// On the surface of unit area, where the first positive eigenvalue is about 10.
const BELOW_ZERO: f64 = -0.01;

/// The start of plain subspace iteration.
pub(super) fn plain(level: &Level, q: usize, variant: Variant, seed: u64) -> (PanelMatrix, Vec<f64>) {
    let n = level.size();
    let mut random = SplitMix64::new(seed);
    let mut start = DenseMatrix::zeros(n, q);
    let masses = level.mass.lumped();
    // Constants are of no use where they are known to be in the kernel.
    let known = level.component.iter().all(|&component| component != NO_KERNEL);
    if variant == Variant::Bathe {
        // Bathe and Wilson: the masses, unit vectors where stiffness over mass is least, and one random vector.
        let ratio = |row: usize| {
            let (columns, values) = level.stiffness.row(row);
            let diagonal = columns.iter().position(|&column| column as usize == row).map_or(0.0, |at| values[at]);
            diagonal / masses[row]
        };
        let mut rows: Vec<usize> = (0..n).collect();
        rows.sort_by(|&a, &b| ratio(a).total_cmp(&ratio(b)));
        for (k, &row) in rows.iter().take(q.saturating_sub(2)).enumerate() {
            start.column_mut(k + 1)[row] = 1.0;
        }
        for column in [0, q - 1] {
            start.column_mut(column).iter_mut().for_each(|x| *x = random.signed_unit());
        }
        if !known {
            start.column_mut(0).fill(1.0);
        }
    } else {
        start.values_mut().iter_mut().for_each(|x| *x = random.signed_unit());
        if !known {
            start.column_mut(0).fill(1.0);
        }
    }
    (PanelMatrix::from_dense(&start), vec![0.0; q])
}

/// Some rows of a space, without the columns that are empty on them; and which columns those are that remain.
fn rows_with_all_columns(space: &SparseMatrix<f32>, rows: &[u32]) -> (SparseMatrix<f32>, Vec<u32>) {
    let mut used = vec![false; space.columns()];
    for &row in rows {
        space.row(row as usize).0.iter().for_each(|&column| used[column as usize] = true);
    }
    let kept: Vec<u32> = (0..space.columns() as u32).filter(|&column| used[column as usize]).collect();
    let mut number = vec![0u32; space.columns()];
    kept.iter().enumerate().for_each(|(k, &column)| number[column as usize] = k as u32);
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for &row in rows {
        let (columns, entries) = space.row(row as usize);
        indices.extend(columns.iter().map(|&column| number[column as usize]));
        values.extend_from_slice(entries);
        offsets.push(indices.len());
    }
    (SparseMatrix::from_sorted_parts(rows.len(), kept.len(), offsets, indices, values), kept)
}

/// The vertex of each column: its sample, or where it is largest.
fn owners(space: &SparseMatrix<f32>, samples: &[u32]) -> Vec<u32> {
    let mut owners = samples.to_vec();
    owners.resize(space.columns(), 0);
    let mut height = vec![0f32; space.columns()];
    for row in 0..space.rows() {
        let (columns, values) = space.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            let column = column as usize;
            if column >= samples.len() && value > height[column] {
                (height[column], owners[column]) = (value, row as u32);
            }
        }
    }
    owners
}

/// The level restricted to a space and ordered; entry `k` of the order is the column of the space that became row `k`.
fn reorder(
    level: &Level,
    space: &SparseMatrix<f32>,
    centres: &[u32],
    ordering: Option<Ordering>,
    monitor: &dyn Monitor,
) -> Result<(Level, SparseMatrix<f32>, Vec<u32>), HsimError> {
    let (coarse, _) = coarsened(level, space, centres, None, monitor)?;
    let Some(ordering) = ordering else {
        let order = (0..coarse.size() as u32).collect();
        return Ok((coarse, space.clone(), order));
    };
    let order = coarse.factor_order(ordering)?;
    let renumbered = super::level::renumbered(space, &super::level::inverse(&order));
    Ok((coarse.in_order(&order), renumbered, order))
}
