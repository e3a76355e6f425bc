//! A start from random vectors: Ritz pairs of a block Krylov space of the inverse at a shift below all that is wanted.

use chladni_algebra::subtract_combinations;
use chladni_algebra::{
    Factor, PANEL_WIDTH, PanelMatrix, SymbolicFactor, Weight, inner_products, mass_times_panel, restrict, rotate,
};
use chladni_base::parallel::*;
use chladni_base::{Monitor, SplitMix64};

use super::HsimError;
use super::columns::{lengths, normalise};
use super::kernel::Kernel;
use super::level::Level;
use super::ritz::ritz;
use super::scout::Scout;
use super::tuning::TUNING;

/// A column of which orthogonalisation leaves less than this share is not worth more than a random one.
const SPENT: f64 = 1e-8;

/// Pairs to start from where nothing is known of the level but its matrices, or where another start led nowhere: as
/// [`start`], with a shift below the lowest eigenvalue, which counts find.
pub(super) fn start_without_guess(
    (level, symbolic): (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    columns: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, PanelMatrix), HsimError> {
    let known = kernel.dimension();
    let window = Scout::new(level, symbolic, monitor).window(columns + known, None, known > 0, monitor)?;
    let factor = window.factor_below(level, symbolic, monitor)?;
    start(PanelMatrix::zeros(level.size(), 0), level, kernel, &factor, columns, seed, monitor)
}

/// About `columns` Ritz pairs of the level beside the kernel, ascending by value, from a factor at a shift below the
/// wanted eigenvalues. `basis` are orthonormal columns that are known to be among what is wanted, if any are.
///
/// Columns are made orthogonal to all before them, once: the Rayleigh–Ritz in the end takes their Gram matrix. Where
/// the space is exhausted, as it is soon where there are few distinct eigenvalues, random columns go on.
pub(super) fn start(
    mut basis: PanelMatrix,
    level: &Level,
    kernel: &Kernel<'_>,
    factor: &Factor<'_>,
    columns: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, PanelMatrix), HsimError> {
    let (room, known) = (level.size() - kernel.dimension(), basis.columns());
    let (wider, than) = TUNING.iteration.wider;
    let others = columns.saturating_sub(known);
    let least = others + TUNING.iteration.blocks * PANEL_WIDTH;
    let size = (known + (others * wider / than).max(least).next_multiple_of(PANEL_WIDTH)).min(room);
    let mut random = SplitMix64::new(seed ^ 0x9e37_79b9);
    // Random vectors hold every frequency alike; two solves leave the low ones.
    let mut block = random_block(level.size(), PANEL_WIDTH.min(size - known), &mut random);
    solve(level, kernel, factor, &mut block);
    while basis.columns() < size {
        monitor.checkpoint()?;
        monitor.progress(basis.columns() as f64 / size as f64);
        solve(level, kernel, factor, &mut block);
        block = orthonormal(level, &basis, block, monitor)?;
        let missing = PANEL_WIDTH - block.columns();
        if missing > 0 {
            let have = block.columns();
            let mut fresh = random_block(level.size(), missing, &mut random);
            solve(level, kernel, factor, &mut fresh);
            block.widen(PANEL_WIDTH);
            block.assign(&(have..PANEL_WIDTH).collect::<Vec<_>>(), &fresh);
            normalise(&mut block);
            block = orthonormal(level, &basis, block, monitor)?;
        }
        let (have, width) = (basis.columns(), block.columns().min(size - basis.columns()));
        if width == 0 {
            break;
        }
        block.keep_columns(width);
        basis.widen(have + width);
        basis.assign(&(have..have + width).collect::<Vec<_>>(), &block);
    }
    let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &basis, monitor)?;
    let count = columns.min(basis.columns());
    let (values, rotation) = ritz(stiffness, gram, count, monitor)?;
    rotate(&mut basis, &rotation, monitor)?;
    Ok((values, basis))
}

pub(super) fn random_block(rows: usize, columns: usize, random: &mut SplitMix64) -> PanelMatrix {
    let mut block = PanelMatrix::zeros(rows, columns);
    for (k, panel) in block.panels_mut().iter_mut().enumerate() {
        let width = PANEL_WIDTH.min(columns - k * PANEL_WIDTH);
        for row in panel.as_chunks_mut::<PANEL_WIDTH>().0 {
            row[..width].iter_mut().for_each(|x| *x = random.signed_unit());
        }
    }
    block
}

/// `(S − μM)⁻¹ M` times the columns, brought to lengths of about one.
pub(super) fn solve(level: &Level, kernel: &Kernel<'_>, factor: &Factor<'_>, block: &mut PanelMatrix) {
    block.panels_mut().par_iter_mut().for_each(|panel| {
        let mut products = vec![0.0; panel.len()];
        mass_times_panel(&level.mass, panel, &mut products);
        factor.solve_panel(&mut products);
        kernel.remove_from_panel(&mut products);
        *panel = products;
    });
    normalise(block);
}

/// The columns orthogonal to others and to each other; those of which next to nothing is left are dropped.
fn orthonormal(
    level: &Level,
    basis: &PanelMatrix,
    mut block: PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<PanelMatrix, HsimError> {
    let before = lengths(&level.mass, &block);
    if basis.columns() > 0 {
        let products = inner_products(basis, Weight::Mass(&level.mass), &block, monitor)?;
        subtract_combinations(&mut block, basis, &products, monitor)?;
    }
    let after = lengths(&level.mass, &block);
    let kept: Vec<usize> = (0..before.len()).filter(|&k| after[k] > SPENT * before[k]).collect();
    if kept.is_empty() {
        return Ok(PanelMatrix::zeros(level.size(), 0));
    }
    let mut block = block.select(&kept);
    normalise(&mut block);
    let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &block, monitor)?;
    let (_, rotation) = ritz(stiffness, gram, kept.len(), monitor)?;
    rotate(&mut block, &rotation, monitor)?;
    Ok(block)
}
