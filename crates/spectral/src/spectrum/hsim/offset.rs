//! What of an operator is known before anything is computed: the constant part of its potential, and the components on
//! which constants are in its kernel.

use chladni_algebra::{MassMatrix, SparseMatrix, WeightedMass};

use super::level::NO_KERNEL;

/// Sums of a row are off by at most this for each entry, relative to the magnitudes that they sum.
const UNIT: f64 = 2.0 * f64::EPSILON;

/// A matrix so small beside the multiple that was taken off it is what the roundings of the assembly left. The
/// Laplacian of a surface is a hundred times as large even beside a constant potential of 1e12 on unit area.
const ROUNDINGS: f64 = 1e-12;

/// A potential below this is far below zero: on unit size, tens of thousands of eigenvalues lie below its magnitude
/// without it.
const FAR_BELOW: f64 = -5e5;

/// A potential that varies by no more than this share of its distance from zero is a constant and something beside it.
const NEARLY_CONSTANT: f64 = 0.01;

/// The stiffness without the largest multiple of the mass that leaves no row with a negative sum, and that multiple:
/// for the Laplacian plus a potential it is the least value of the potential, and no eigenvalue of what is left is
/// negative. Iterations and gaps are relative to that. Nothing where the multiple is not positive, unless all of the
/// potential is far below zero: elsewhere some eigenvalues may be about zero, and what is asked of them is relative to
/// themselves.
pub(in crate::spectrum) fn taken_off(stiffness: &SparseMatrix, mass: &MassMatrix) -> Option<(SparseMatrix, f64)> {
    let lumped = mass.lumped();
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for (row, mass) in lumped.iter().enumerate() {
        let (sum, error) = sum(stiffness, row);
        // What rounding makes of a sum of zero is no potential.
        let potential = if sum.abs() > error { sum / mass } else { 0.0 };
        (least, most) = (least.min(potential), most.max(potential));
    }
    let far_below = most < FAR_BELOW && most - least < NEARLY_CONSTANT * most.abs();
    let offset = least;
    if !(offset.is_finite() && (offset > 0.0 || far_below)) {
        return None;
    }
    let mut values = stiffness.values().to_vec();
    let mut left = 0.0f64;
    for row in 0..stiffness.rows() {
        let (columns, start) = (stiffness.row(row).0, stiffness.offsets()[row]);
        let mut take = |column: u32, part: f64| {
            let at = columns.binary_search(&column).ok()?;
            values[start + at] -= offset * part;
            Some(())
        };
        let taken = match mass {
            MassMatrix::Diagonal(mass) => take(row as u32, mass[row]),
            MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
                let (columns, parts) = mass.row(row);
                columns.iter().zip(parts).try_for_each(|(&column, &part)| take(column, part))
            }
        };
        taken?;
        let rest: f64 = values[start..start + columns.len()].iter().map(|value| value.abs()).sum();
        left = left.max(rest / lumped[row]);
    }
    // All eigenvalues are one: what is left are the roundings of the assembly, whose order and gaps say nothing.
    if left <= ROUNDINGS * offset.abs() {
        return None;
    }
    let (rows, columns) = (stiffness.rows(), stiffness.columns());
    let (offsets, indices) = (stiffness.offsets().to_vec(), stiffness.indices().to_vec());
    Some((SparseMatrix::from_sorted_parts(rows, columns, offsets, indices, values), offset))
}

/// The sum of a row, and how far rounding may have moved it.
fn sum(matrix: &SparseMatrix, row: usize) -> (f64, f64) {
    let values = matrix.row(row).1;
    let size: f64 = values.iter().map(|value| value.abs()).sum();
    (values.iter().sum(), UNIT * values.len() as f64 * size)
}

/// Whether a row sums to zero, as far as rounding lets one tell.
pub(in crate::spectrum) fn is_balanced(stiffness: &SparseMatrix, row: usize) -> bool {
    let (sum, error) = sum(stiffness, row);
    sum.abs() <= error
}

/// On how many components constants are in the kernel of the stiffness, as far as rounding lets one tell.
pub(in crate::spectrum) fn constants_in_kernel(stiffness: &SparseMatrix, mass: &MassMatrix) -> usize {
    let component = components(stiffness, mass, 0.0);
    component.into_iter().filter(|&number| number != NO_KERNEL).max().map_or(0, |last| last as usize + 1)
}

/// Per row the number of its component in the graph of the matrix, if all rows of the component sum to zero as far as
/// rounding lets one tell; [`NO_KERNEL`] if not. `offset` is the multiple of the mass that was taken off the matrix.
pub(super) fn components(stiffness: &SparseMatrix, mass: &MassMatrix, offset: f64) -> Vec<u32> {
    let n = stiffness.rows();
    let lumped = mass.lumped();
    let mut component = vec![NO_KERNEL; n];
    let mut seen = vec![false; n];
    let mut found: Vec<u32> = Vec::new();
    let mut number = 0;
    for start in 0..n {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        found.clear();
        found.push(start as u32);
        let (mut head, mut balanced) = (0, true);
        while head < found.len() {
            let row = found[head] as usize;
            head += 1;
            let (sum, error) = sum(stiffness, row);
            let entries = stiffness.row(row).0;
            for &column in entries {
                if !seen[column as usize] {
                    seen[column as usize] = true;
                    found.push(column);
                }
            }
            balanced &= sum.abs() <= error + UNIT * entries.len() as f64 * (offset * lumped[row]).abs();
        }
        if balanced {
            found.iter().for_each(|&row| component[row as usize] = number);
            number += 1;
        }
    }
    component
}
