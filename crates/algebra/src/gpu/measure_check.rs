//! One column of what a device has measured, computed anew on the CPU: a card that sums up wrongly must not prove
//! anything.

use chladni_base::parallel::*;

use super::error::GpuError;
use super::pair_sums::{EnclosureSums, MeasuredPairs, MeasuredPencil, MeasuredTrees, ResidualSums};
use crate::{MassMatrix, SparseMatrix, WeightedMass};

/// The largest difference, as a share of the sum of magnitudes.
const LARGEST_DIFFERENCE: f64 = 1e-9;

/// What rounding may change in a row of a product, as a share of the magnitudes of its terms.
const ROUNDING: f64 = 1e-14;

const SUMS: usize = ResidualSums::COUNT;
const ALL: usize = SUMS + EnclosureSums::COUNT;

/// Where what is left is among the sums.
const EXCESS: usize = SUMS + 2;

/// Where the least and the greatest entry are among the sums.
const LEAST: usize = 7;
const GREATEST: usize = 8;

/// Sums, and how far others of the same terms may be from them.
#[derive(Clone, Copy)]
struct Sums {
    values: [f64; ALL],
    slack: [f64; ALL],
}

impl Sums {
    const NONE: Self = Self { values: [0.0; ALL], slack: [0.0; ALL] };

    fn added(mut self, other: Self) -> Self {
        for k in 0..ALL {
            self.values[k] = match k {
                LEAST => self.values[k].min(other.values[k]),
                GREATEST => self.values[k].max(other.values[k]),
                _ => self.values[k] + other.values[k],
            };
            self.slack[k] = match k {
                LEAST | GREATEST => self.slack[k].max(other.slack[k]),
                _ => self.slack[k] + other.slack[k],
            };
        }
        self
    }
}

/// Compares the sums of pair `pair` with those of the CPU; the device holds its residual and its correction in `held`.
///
/// # Errors
/// [`GpuError::Wrong`] where they differ.
pub(super) fn check(
    pencil: &MeasuredPencil<'_>,
    pairs: &MeasuredPairs<'_>,
    pair: usize,
    [right, y]: &[Vec<f64>; 2],
    (residual, enclosure): (&ResidualSums, &EnclosureSums),
) -> Result<(), GpuError> {
    let coefficients = pairs.coefficients.column(pair);
    let lift = |row: usize| {
        let (columns, values) = pairs.space.row(row);
        columns.iter().zip(values).map(|(&column, &value)| f64::from(value) * coefficients[column as usize]).sum()
    };
    let x: Vec<f64> = (0..y.len()).into_par_iter().map(lift).collect();
    let (theta, shift) = (pairs.values[pair], pairs.sigmas[pair] + pencil.floor);
    let left = |row: usize| {
        let ((ay, ay_size), (my, my_size)) = (row_of(pencil.stiffness, row, y), mass_row(pencil.mass, row, y));
        let given = right[row];
        (given - ay - shift * my, ROUNDING * (ay_size + shift * my_size + given.abs()))
    };
    let row = |row: usize| {
        let (inverse, weight) = (1.0 / pencil.lumped[row], pencil.rounding[row]);
        let ((sx, sx_size), (mx, mx_size)) = (row_of(pencil.stiffness, row, &x), mass_row(pencil.mass, row, &x));
        let (own, r, noise) = (x[row], sx - theta * mx, ROUNDING * (sx_size + theta.abs() * mx_size));
        let (my, my_size) = mass_row(pencil.mass, row, y);
        let (given, own_y) = (right[row], y[row]);
        let (left, noise_y) = left(row);
        let terms: [(f64, f64); ALL] = [
            squared(r, noise),
            scaled(squared(r, noise), inverse),
            squared(sx, noise),
            squared(own, 0.0),
            (own * mx, own.abs() * ROUNDING * mx_size),
            (own * sx, own.abs() * noise),
            scaled(squared(own, 0.0), weight),
            (own, own.abs()),
            (own, own.abs()),
            (own_y * (given + left), own_y.abs() * noise_y),
            ((own_y * given).abs() + (own_y * left).abs(), own_y.abs() * noise_y),
            scaled(squared(left, noise_y), inverse),
            scaled(squared(own_y, 0.0), weight),
            (own_y * my, own_y.abs() * ROUNDING * my_size),
        ];
        Sums {
            values: terms.map(|(value, _)| value),
            slack: terms.map(|(value, noise)| LARGEST_DIFFERENCE * value.abs() + noise),
        }
    };
    let mut expected = (0..y.len()).into_par_iter().map(row).reduce(|| Sums::NONE, Sums::added);
    if let Some(trees) = &pencil.trees {
        let base = pairs.sigmas[pair] / pencil.mass.lumped_ratio();
        let (value, noise) = by_trees(trees, |row| base * pencil.lumped[row], base, left);
        (expected.values[EXCESS], expected.slack[EXCESS]) = (value, LARGEST_DIFFERENCE * value + noise);
    }
    let found = residual.all().into_iter().chain(enclosure.all());
    let mut worst = 0.0f64;
    for ((found, expected), slack) in found.zip(expected.values).zip(expected.slack) {
        let difference = (found - expected).abs();
        // NaN is a difference too.
        if !(difference <= slack) {
            worst = if difference.is_nan() { f64::INFINITY } else { worst.max(difference / expected.abs()) };
        }
    }
    if worst > 0.0 { Err(GpuError::Wrong { residual: worst }) } else { Ok(()) }
}

fn squared(value: f64, noise: f64) -> (f64, f64) {
    (value * value, noise * (2.0 * value.abs() + noise))
}

fn scaled((value, noise): (f64, f64), by: f64) -> (f64, f64) {
    (by * value, by * noise)
}

/// What is `left` of each row, gathered from the leaves of the trees to their roots: the sum of the squares over the
/// pivots, and what rounding may change of it. Rows are grounded by `ground`, and the sum is multiplied by `scale`.
fn by_trees(
    trees: &MeasuredTrees<'_>,
    ground: impl Fn(usize) -> f64 + Sync,
    scale: f64,
    left: impl Fn(usize) -> (f64, f64) + Sync,
) -> (f64, f64) {
    let patch = |ends: &[u32]| {
        let rows = ends[0] as usize..ends[1] as usize;
        let mut grounds: Vec<f64> = rows.clone().map(&ground).collect();
        let mut gathered: Vec<(f64, f64)> = rows.clone().map(&left).collect();
        let mut sum = (0.0, 0.0);
        for node in &trees.nodes[rows] {
            let (row, parent, weight) = (node.row as usize, node.parent as usize, f64::from(node.weight));
            let (value, noise) = gathered[row];
            let pivot = grounds[row] + weight;
            let term = scaled(squared(value, noise), scale / pivot);
            sum = (sum.0 + term.0, sum.1 + term.1);
            if parent != row {
                let share = weight / pivot;
                grounds[parent] += share * grounds[row];
                gathered[parent].0 += share * value;
                gathered[parent].1 += share * (noise + ROUNDING * value.abs());
            }
        }
        sum
    };
    (1..trees.patches.len())
        .into_par_iter()
        .map(|end| patch(&trees.patches[end - 1..=end]))
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
}

/// A row of a product, and the sum of the magnitudes of its terms.
fn row_of(matrix: &SparseMatrix, row: usize, x: &[f64]) -> (f64, f64) {
    let (columns, values) = matrix.row(row);
    columns.iter().zip(values).fold((0.0, 0.0), |(sum, size), (&column, value)| {
        let term = value * x[column as usize];
        (sum + term, size + term.abs())
    })
}

fn mass_row(mass: &MassMatrix, row: usize, x: &[f64]) -> (f64, f64) {
    match mass {
        MassMatrix::Diagonal(mass) => (mass[row] * x[row], (mass[row] * x[row]).abs()),
        MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => row_of(mass, row, x),
    }
}
