//! One level of the hierarchy: an eigenproblem in the order in which it is factored, and how a coarser one is made of
//! it.

use chladni_algebra::{FactorError, MassMatrix, Ordering, SparseMatrix, fill_reducing_order, galerkin};
use chladni_base::{Cancelled, Monitor};

use crate::spectrum::local::{self, PositionedGraph};

/// An eigenproblem of the hierarchy; rows are in a fill-reducing order.
#[derive(Debug, Clone)]
pub(super) struct Level {
    /// `n × n`, both triangles.
    pub stiffness: SparseMatrix,
    pub mass: MassMatrix,
    /// Where each row's vertex lies, on the surface scaled to unit area.
    pub positions: Vec<[f64; 3]>,
    /// Per row the number of its component, where constants on it are in the kernel; [`NO_KERNEL`] elsewhere.
    pub component: Vec<u32>,
}

/// The component of a row on whose component constants are not in the kernel.
pub(super) const NO_KERNEL: u32 = u32::MAX;

/// Entry `k` of the result is the place of row `k` in `order`.
pub(in crate::spectrum) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0; order.len()];
    for (place, &row) in order.iter().enumerate() {
        inverse[row as usize] = place as u32;
    }
    inverse
}

impl Level {
    /// The level with its rows in another order: row `k` becomes row `order[k]` of this one.
    pub fn in_order(&self, order: &[u32]) -> Self {
        Self {
            stiffness: self.stiffness.reordered(order),
            mass: self.mass.reordered(order),
            positions: order.iter().map(|&row| self.positions[row as usize]).collect(),
            component: order.iter().map(|&row| self.component[row as usize]).collect(),
        }
    }

    pub fn size(&self) -> usize {
        self.stiffness.rows()
    }

    /// About the largest eigenvalue, or more: the largest row sum of `|S|` over the lumped mass; one where there is
    /// nothing but zeros.
    pub fn spread(&self) -> f64 {
        let most = self.ratios().into_iter().fold(0.0, f64::max);
        if most > 0.0 { most } else { 1.0 }
    }

    /// For each row the sum of `|S|` over the lumped mass.
    pub fn ratios(&self) -> Vec<f64> {
        let sum = |row: usize| self.stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>();
        self.mass.lumped().into_iter().enumerate().map(|(row, mass)| sum(row) / mass).collect()
    }

    pub fn factor_order(&self, ordering: Ordering) -> Result<Vec<u32>, FactorError> {
        fill_reducing_order(&self.stiffness, ordering)
    }
}

/// A space of about `target` local functions on a level, rows with sum 1, and the rows of the level that are their
/// centres (ascending).
pub(super) fn space(
    level: &Level,
    target: usize,
    sigma: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix<f32>, Vec<u32>), Cancelled> {
    let area: f64 = level.mass.lumped().iter().sum();
    let spacing = SPACING * (area / target as f64).sqrt();
    let centres = local::centres(level, spacing, seed, monitor)?;
    let radius = (sigma * area / (std::f64::consts::PI * centres.len().max(1) as f64)).sqrt();
    let (centres, radius) = match centres.len() > MOST_EXCESS * target {
        true => farther_apart(level, target, spacing, centres, (radius, sigma), seed, monitor)?,
        false => (centres, radius),
    };
    Ok((local::functions(level, &centres, radius, monitor)?, centres))
}

/// Areas tell how far apart samples lie where a surface is as wide as it is long. Where there are more samples than
/// this many times the wanted ones, the spacing is searched for.
const MOST_EXCESS: usize = 2;

/// At most so many spacings are tried.
const SPACINGS: usize = 40;

/// Fewer centres than `centres`, about `target` of them, and the radius of their functions.
fn farther_apart(
    level: &Level,
    target: usize,
    spacing: f64,
    centres: Vec<u32>,
    (radius, sigma): (f64, f64),
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(Vec<u32>, f64), Cancelled> {
    // As many as there are components stay, whatever the spacing.
    let least = target.max(local::centres(level, f64::INFINITY, seed, monitor)?.len());
    let enough = least..=least + least / 4;
    let (mut low, mut high) = (spacing, None);
    let mut best = (centres, spacing);
    for _ in 0..SPACINGS {
        // Where the number of samples jumps, no spacing gives what is wanted.
        if high.is_some_and(|high: f64| high < 1.05 * low) {
            break;
        }
        let middle: f64 = high.map_or(2.0 * low, |high: f64| (low * high).sqrt());
        let found = local::centres(level, middle, seed, monitor)?;
        if found.len() < *enough.start() {
            high = Some(middle);
            continue;
        }
        let done = enough.contains(&found.len());
        low = middle;
        best = (found, middle);
        if done {
            break;
        }
    }
    // The ratio of both where area tells.
    let wide = best.1 / SPACING * (sigma / std::f64::consts::PI).sqrt();
    Ok((best.0, radius.max(wide)))
}

impl PositionedGraph for Level {
    fn size(&self) -> usize {
        self.stiffness.rows()
    }

    fn position(&self, row: u32) -> [f64; 3] {
        self.positions[row as usize]
    }

    fn neighbours(&self, row: u32) -> &[u32] {
        self.stiffness.row(row as usize).0
    }
}

/// The radius within which a sample covers its neighbours, over the spacing of as many samples as are wanted. Measured:
/// gives that many within a few percent.
const SPACING: f64 = 0.83;

/// The level restricted to a space, in the order in which the new level is factored; the columns of `space` are
/// renumbered to it.
pub(super) fn coarsened(
    level: &Level,
    space: &SparseMatrix<f32>,
    centres: &[u32],
    ordering: Option<Ordering>,
    monitor: &dyn Monitor,
) -> Result<(Level, SparseMatrix<f32>), super::HsimError> {
    let (stiffness, mass) = galerkin(space, &level.stiffness, &level.mass, monitor)?;
    let positions = centres.iter().map(|&row| level.positions[row as usize]).collect();
    // The support of a function lies in one component.
    let mut component = vec![NO_KERNEL; space.columns()];
    for row in 0..space.rows() {
        space.row(row).0.iter().for_each(|&column| component[column as usize] = level.component[row]);
    }
    let coarse = Level { stiffness, mass: MassMatrix::Sparse(mass), positions, component };
    let Some(ordering) = ordering else {
        return Ok((coarse, space.clone()));
    };
    let order = coarse.factor_order(ordering)?;
    Ok((coarse.in_order(&order), renumbered(space, &inverse(&order))))
}

/// A matrix with its columns renumbered: column `k` becomes column `places[k]`.
pub(super) fn renumbered(matrix: &SparseMatrix<f32>, places: &[u32]) -> SparseMatrix<f32> {
    let (mut indices, mut values) = (Vec::with_capacity(matrix.entries()), Vec::with_capacity(matrix.entries()));
    let mut entries: Vec<(u32, f32)> = Vec::new();
    for row in 0..matrix.rows() {
        let (columns, numbers) = matrix.row(row);
        entries.clear();
        entries.extend(columns.iter().zip(numbers).map(|(&column, &number)| (places[column as usize], number)));
        entries.sort_unstable_by_key(|entry| entry.0);
        indices.extend(entries.iter().map(|entry| entry.0));
        values.extend(entries.iter().map(|entry| entry.1));
    }
    SparseMatrix::from_sorted_parts(matrix.rows(), matrix.columns(), matrix.offsets().to_vec(), indices, values)
}
