//! The start of the iteration on the mesh: approximate eigenvectors from smaller and smaller spaces of local functions.

use chladni_algebra::{Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, prolong};
use chladni_base::Monitor;

use super::dense_pairs::dense_pairs;
use super::iterate::{Iteration, Plan};
use super::kernel::Kernel;
use super::level::{Level, coarsened, space};
use super::tuning::TUNING;
use super::{HsimError, LevelReport};
use crate::spectrum::peaks::{NO_PEAK, Peaks};

/// Where to start from.
pub(super) struct Start {
    /// The finest space, `n × d`, rows in the order of the level that it was made of.
    pub space: SparseMatrix<f32>,
    /// Columns in that space, `d × q`.
    pub vectors: PanelMatrix,
    /// Their Ritz values, ascending.
    pub values: Vec<f64>,
    /// The levels that were solved on the way, the coarsest first.
    pub reports: Vec<LevelReport>,
}

/// Columns to iterate on for so many wanted pairs: guards, and whole panels.
pub(super) fn columns(wanted: usize, size: usize) -> usize {
    let (share, least) = TUNING.hierarchy.guards;
    let guards = (wanted / share).max(least);
    (wanted + guards).next_multiple_of(chladni_algebra::PANEL_WIDTH).min(size)
}

/// The sizes of the levels above the mesh, the coarsest first, chosen by measurement: the coarsest is as large as a
/// dense problem may be without being felt, the middle one so large that one step on the mesh suffices for most
/// columns. None where the mesh itself is small enough to be solved densely.
pub(super) fn sizes(n: usize, q: usize, levels: Option<usize>) -> Vec<usize> {
    let coarsest = (4 * q).clamp(400, 1000).max(q + q.min(1000) * 4 / 5);
    let middle = (1500 + 10 * q).max(2000);
    if n < 2 * coarsest && (n < TUNING.hierarchy.small || 5 * n < 6 * coarsest) {
        return Vec::new();
    }
    match levels {
        None if n < TUNING.hierarchy.few.max(4 * coarsest) => vec![coarsest],
        None if n < 6 * middle => vec![coarsest, ((n as f64 * coarsest as f64).sqrt() as usize).max(coarsest * 3 / 2)],
        None => vec![coarsest, middle],
        Some(levels) => {
            let above = levels.saturating_sub(1);
            let growth = (n as f64 / coarsest as f64).powf(1.0 / above.max(1) as f64);
            (0..above).map(|k| (coarsest as f64 * growth.powi(k as i32)) as usize).collect()
        }
    }
}

/// Solves on the levels above the mesh; `sizes` are theirs, the coarsest first and at least one. The finest may be
/// `given`.
pub(super) fn start(
    fine: &Level,
    sizes: &[usize],
    q: usize,
    sigma: f64,
    seed: u64,
    given: Option<&SparseMatrix<f32>>,
    monitor: &dyn Monitor,
) -> Result<Start, HsimError> {
    let mut levels: Vec<Level> = Vec::new();
    let mut spaces: Vec<SparseMatrix<f32>> = Vec::new();
    for (k, &size) in sizes.iter().enumerate().rev() {
        let level = levels.last().unwrap_or(fine);
        let (functions, centres) = match given.filter(|_| levels.is_empty()) {
            Some(given) => {
                // A column of zeros belongs anywhere.
                let at = |&row: &u32| if row == NO_PEAK { 0 } else { row };
                (given.clone(), Peaks::of(given).rows.iter().map(at).collect())
            }
            None => space(level, size, sigma, seed.wrapping_add(k as u64), monitor)?,
        };
        let ordering = (k > 0).then_some(Ordering::Amd);
        let (coarse, functions) = coarsened(level, &functions, &centres, ordering, monitor)?;
        levels.push(coarse);
        spaces.push(functions);
    }
    let (mut reports, mut values, mut vectors) = (Vec::new(), Vec::new(), PanelMatrix::default());
    let count = levels.len();
    for (k, level) in levels.iter().enumerate().rev() {
        monitor.detail(&format!("level {} of {}, dimension {}", count - k, count + 1, level.size()));
        if k + 1 == count {
            (values, vectors) = dense_pairs(level, q, monitor)?;
            reports.push(LevelReport { dimension: level.size(), iterations: 0, shifts: 0 });
            continue;
        }
        let kernel = Kernel::new(level);
        let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass)?.within(1, monitor)?;
        let vectors_here = prolong(&spaces[k + 1], &vectors);
        let mut iteration = Iteration::new(level, &symbolic, &kernel, vectors_here, values, monitor);
        let wanted = q - (q / 8).min(16);
        let tolerance = TUNING.hierarchy.middle_tolerance;
        iteration.run(&Plan { wanted, tolerance, panels_per_shift: 2, solves: 2, most_passes: 4 })?;
        let mut order = iteration.order();
        order.truncate(q);
        reports.push(LevelReport {
            dimension: level.size(),
            iterations: iteration.passes,
            shifts: iteration.inertia.len(),
        });
        values = order.iter().map(|&column| iteration.values[column]).collect();
        vectors = iteration.vectors.select(&order);
    }
    let space = spaces.swap_remove(0);
    Ok(Start { space, vectors, values, reports })
}
