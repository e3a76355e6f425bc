//! One level of the hierarchy: an eigenproblem in the order in which it is factored, and how a coarser one is made of it.

use rayon::prelude::*;

use crate::algebra::{FactorError, GalerkinError, MassMatrix, Ordering, SparseMatrix, fill_reducing_order, galerkin};
use crate::mesh::random::SplitMix64;
use crate::monitor::{Cancelled, Monitor};

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
pub(super) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0; order.len()];
    for (place, &row) in order.iter().enumerate() {
        inverse[row as usize] = place as u32;
    }
    inverse
}

impl Level {
    /// The level with its rows in another order: row `k` becomes row `order[k]` of this one.
    pub fn in_order(&self, order: &[u32]) -> Self {
        let mass = match &self.mass {
            MassMatrix::Diagonal(mass) => MassMatrix::Diagonal(order.iter().map(|&row| mass[row as usize]).collect()),
            MassMatrix::Sparse(mass) => MassMatrix::Sparse(mass.reordered(order)),
        };
        Self {
            stiffness: self.stiffness.reordered(order),
            mass,
            positions: order.iter().map(|&row| self.positions[row as usize]).collect(),
            component: order.iter().map(|&row| self.component[row as usize]).collect(),
        }
    }

    pub fn size(&self) -> usize {
        self.stiffness.rows()
    }

    pub fn factor_order(&self, ordering: Ordering) -> Result<Vec<u32>, FactorError> {
        fill_reducing_order(&self.stiffness, ordering)
    }
}

/// A space of about `target` local functions on a level, rows with sum 1, and the rows of the level that are their centres (ascending).
pub(super) fn space(
    level: &Level,
    target: usize,
    sigma: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix<f32>, Vec<u32>), Cancelled> {
    let n = level.size();
    let area: f64 = level.mass.lumped().iter().sum();
    let centres = centres(level, SPACING * (area / target as f64).sqrt(), seed, monitor)?;
    let radius = (sigma * area / (std::f64::consts::PI * centres.len().max(1) as f64)).sqrt();
    // Columns in parallel, gathered in the order of the centres.
    let parts: Vec<Vec<(u32, u32, f32)>> = centres
        .par_chunks(64)
        .enumerate()
        .map_init(
            || Ball::new(n),
            |ball, (chunk, part)| {
                monitor.checkpoint()?;
                let mut entries = Vec::new();
                for (k, &centre) in part.iter().enumerate() {
                    ball.grow(level, centre, radius);
                    for &(row, square) in &ball.found {
                        let x = square.sqrt() / radius;
                        let value = 1.0 - x * x * (3.0 - 2.0 * x);
                        if value > LEAST_WEIGHT || row == centre {
                            entries.push((row, (chunk * 64 + k) as u32, value as f32));
                        }
                    }
                }
                Ok(entries)
            },
        )
        .collect::<Result<_, Cancelled>>()?;
    let mut offsets = vec![0usize; n + 1];
    for part in &parts {
        for entry in part {
            offsets[entry.0 as usize + 1] += 1;
        }
    }
    for row in 0..n {
        offsets[row + 1] += offsets[row];
    }
    let mut next = offsets.clone();
    let (mut indices, mut values) = (vec![0u32; offsets[n]], vec![0f32; offsets[n]]);
    for (row, column, value) in parts.into_iter().flatten() {
        let at = next[row as usize];
        next[row as usize] += 1;
        (indices[at], values[at]) = (column, value);
    }
    for row in 0..n {
        let row = &mut values[offsets[row]..offsets[row + 1]];
        let sum: f32 = row.iter().sum();
        row.iter_mut().for_each(|value| *value /= sum);
    }
    Ok((SparseMatrix::from_sorted_parts(n, centres.len(), offsets, indices, values), centres))
}

/// The radius within which a sample covers its neighbours, over the spacing of as many samples as are wanted. Measured: gives
/// that many within a few percent.
const SPACING: f64 = 0.83;

/// Weights at or below this are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// Rows such that every row lies within `radius` of one, on the connected part of the ball around it.
fn centres(level: &Level, radius: f64, seed: u64, monitor: &dyn Monitor) -> Result<Vec<u32>, Cancelled> {
    let n = level.size();
    let order = SplitMix64::new(seed).permutation(n);
    let mut covered = vec![false; n];
    let mut ball = Ball::new(n);
    let mut centres = Vec::new();
    for (k, &row) in order.iter().enumerate() {
        if k % 1024 == 0 {
            monitor.checkpoint()?;
        }
        if covered[row as usize] {
            continue;
        }
        centres.push(row);
        ball.grow(level, row, radius);
        for &(row, _) in &ball.found {
            covered[row as usize] = true;
        }
    }
    // In the order of the level, neighbours have close numbers.
    centres.sort_unstable();
    Ok(centres)
}

/// The connected part of a ball.
struct Ball {
    stamp: Vec<u32>,
    current: u32,
    /// Rows with the squares of their distances from the centre.
    found: Vec<(u32, f64)>,
}

impl Ball {
    fn new(n: usize) -> Self {
        Self { stamp: vec![0; n], current: 0, found: Vec::new() }
    }

    fn grow(&mut self, level: &Level, centre: u32, radius: f64) {
        self.current += 1;
        self.found.clear();
        self.found.push((centre, 0.0));
        self.stamp[centre as usize] = self.current;
        let origin = level.positions[centre as usize];
        let limit = radius * radius;
        let mut head = 0;
        while head < self.found.len() {
            let row = self.found[head].0;
            head += 1;
            for &column in level.stiffness.row(row as usize).0 {
                let stamp = &mut self.stamp[column as usize];
                if *stamp == self.current {
                    continue;
                }
                let position = level.positions[column as usize];
                let square: f64 = (0..3).map(|k| (position[k] - origin[k]).powi(2)).sum();
                if square < limit {
                    *stamp = self.current;
                    self.found.push((column, square));
                }
            }
        }
    }
}

/// The level restricted to a space, in the order in which the new level is factored; the columns of `space` are renumbered to it.
pub(super) fn coarsened(
    level: &Level,
    space: &SparseMatrix<f32>,
    centres: &[u32],
    ordering: Option<Ordering>,
    monitor: &dyn Monitor,
) -> Result<(Level, SparseMatrix<f32>), super::HsimError> {
    let (stiffness, mass) = galerkin(space, &level.stiffness, &level.mass, monitor).map_err(|error| match error {
        GalerkinError::Cancelled(cancelled) => super::HsimError::Cancelled(cancelled),
        other => super::HsimError::Numerical(other.to_string()),
    })?;
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
