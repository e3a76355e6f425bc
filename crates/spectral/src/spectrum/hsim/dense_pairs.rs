//! Dense solves of a level, block by block: rows that are coupled by neither matrix, those of copies and of pieces, are
//! problems of their own.

use chladni_algebra::{DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix};
use chladni_base::Monitor;

use super::HsimError;
use super::graded::{add_constants, by_inverse, sharpen};
use super::level::{Level, NO_KERNEL};
use super::ritz::ritz;
use super::tuning::TUNING;

/// The lowest `q` pairs of a level beside its kernel, ascending by value, by dense solves.
pub(super) fn dense_pairs(
    level: &Level,
    q: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, PanelMatrix), HsimError> {
    let blocks = blocks(&level.stiffness, &level.mass);
    if blocks.len() <= 1 {
        return whole(level, q, monitor);
    }
    let mut solved: Vec<(Vec<f64>, PanelMatrix)> = Vec::with_capacity(blocks.len());
    for (done, rows) in blocks.iter().enumerate() {
        monitor.progress(done as f64 / blocks.len() as f64);
        solved.push(whole(&level.of_block(rows), q, monitor)?);
    }
    let mut places: Vec<(f64, usize, usize)> = Vec::new();
    for (block, (values, _)) in solved.iter().enumerate() {
        places.extend(values.iter().enumerate().map(|(column, &value)| (value, block, column)));
    }
    // A stable order, by block where values are equal.
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    places.truncate(q);
    let mut vectors = PanelMatrix::zeros(level.size(), places.len());
    for (k, &(_, block, column)) in places.iter().enumerate() {
        let panel = &mut vectors.panels_mut()[k / PANEL_WIDTH];
        let entries = solved[block].1.column(column);
        for (&row, entry) in blocks[block].iter().zip(entries) {
            panel[row as usize * PANEL_WIDTH + k % PANEL_WIDTH] = entry;
        }
    }
    Ok((places.into_iter().map(|place| place.0).collect(), vectors))
}

/// The rows of a problem of one block whose dense solve takes as long as those of all blocks of a pencil.
pub(super) fn dense_rows(stiffness: &SparseMatrix, mass: &MassMatrix) -> usize {
    let work: f64 = blocks(stiffness, mass).iter().map(|rows| (rows.len() as f64).powi(3)).sum();
    work.cbrt().ceil() as usize
}

/// The rows of each block, ascending; blocks by their first row.
fn blocks(stiffness: &SparseMatrix, mass: &MassMatrix) -> Vec<Vec<u32>> {
    let n = stiffness.rows();
    let mut block = vec![usize::MAX; n];
    let mut blocks: Vec<Vec<u32>> = Vec::new();
    let mut open: Vec<u32> = Vec::new();
    for start in 0..n {
        if block[start] != usize::MAX {
            continue;
        }
        let number = blocks.len();
        blocks.push(Vec::new());
        block[start] = number;
        open.push(start as u32);
        while let Some(row) = open.pop() {
            let coupled = mass.sparse().map_or(&[][..], |mass| mass.row(row as usize).0);
            for &column in stiffness.row(row as usize).0.iter().chain(coupled) {
                if block[column as usize] == usize::MAX {
                    block[column as usize] = number;
                    open.push(column);
                }
            }
        }
    }
    block.into_iter().enumerate().for_each(|(row, number)| blocks[number].push(row as u32));
    blocks
}

impl Level {
    /// The rows of a block as a level of their own, without positions.
    fn of_block(&self, rows: &[u32]) -> Self {
        let mut numbers: Vec<u32> = rows.iter().map(|&row| self.component[row as usize]).collect();
        let mut known: Vec<u32> = numbers.iter().copied().filter(|&number| number != NO_KERNEL).collect();
        known.sort_unstable();
        known.dedup();
        // Numbers of components go from zero on.
        for number in numbers.iter_mut().filter(|number| **number != NO_KERNEL) {
            *number = known.partition_point(|known| known < number) as u32;
        }
        Self {
            stiffness: self.stiffness.principal(rows),
            mass: self.mass.principal(rows),
            positions: Vec::new(),
            component: numbers,
        }
    }
}

/// The bytes that such a solve takes for each entry of its largest block: ten matrices were measured.
const REPAIR_BYTES: u64 = 80;

/// The memory that the dense solve takes at most, in bytes, that what an iteration on so many rows did not settle is
/// left to.
pub fn repair_bytes(rows: u64) -> u64 {
    let repaired = if rows <= TUNING.dense.repaired_in_all as u64 { rows.min(TUNING.dense.repaired as u64) } else { 0 };
    REPAIR_BYTES * repaired * repaired
}

/// The pairs beside the kernel that a dense solve gives where an iteration from `columns` columns failed, as
/// [`dense_pairs`]: all there are, or as many as the largest problem of one block that is repaired has rows. `None`
/// where that would take too long.
pub(super) fn instead(
    level: &Level,
    columns: usize,
    kernel: usize,
    monitor: &dyn Monitor,
) -> Result<Option<(Vec<f64>, PanelMatrix)>, HsimError> {
    let n = level.size();
    let most = TUNING.dense.repaired;
    if n > TUNING.dense.repaired_in_all || dense_rows(&level.stiffness, &level.mass) > most {
        return Ok(None);
    }
    monitor.stage("repair");
    dense_pairs(level, (n - kernel).min(columns.max(most)), monitor).map(Some)
}

/// The same for a level that is one block.
fn whole(level: &Level, q: usize, monitor: &dyn Monitor) -> Result<(Vec<f64>, PanelMatrix), HsimError> {
    let (mut stiffness, mass) = dense(level);
    let lumped = level.mass.lumped();
    let mut kernel: Vec<Vec<usize>> = Vec::new();
    for (row, &component) in level.component.iter().enumerate() {
        if component != NO_KERNEL {
            let component = component as usize;
            if kernel.len() <= component {
                kernel.resize(component + 1, Vec::new());
            }
            kernel[component].push(row);
        }
    }
    let count = q.min(level.size() - kernel.len());
    let sum = |row: usize| level.stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>();
    let ratios: Vec<f64> = (0..level.size()).map(|row| sum(row) / lumped[row].abs()).collect();
    if let Some(pairs) = by_inverse(level, (&stiffness, &mass), &kernel, count, ratios.clone(), monitor)? {
        return Ok(pairs);
    }
    // The kernel is moved above all other eigenvalues, where it cannot be taken for one of them.
    let height = 8.0 * ratios.into_iter().fold(0.0, f64::max);
    add_constants(&mut stiffness, &lumped, &kernel, height);
    let (mut values, vectors) = ritz(stiffness, mass, count, monitor)?;
    let mut vectors = PanelMatrix::from_dense(&vectors);
    sharpen(level, &mut vectors, &mut values, monitor)?;
    Ok((values, vectors))
}

/// The pencil of a level as dense matrices.
pub(super) fn dense(level: &Level) -> (DenseMatrix, DenseMatrix) {
    let mass = level.mass.to_dense();
    (level.stiffness.to_dense(), mass)
}

#[cfg(test)]
#[path = "dense_pairs_tests.rs"]
mod tests;
