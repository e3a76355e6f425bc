//! The pencil of a coarse level: its restriction to a prolongation of a few entries a row.

use chladni_base::parallel::*;

use crate::SparseMatrix;

/// Coarse rows whose mass a thread sums up at once.
const ROWS: usize = 512;

/// `PᵀSP` and the diagonal of the lumped `PᵀMP`: `prolongation` is `P`, `n × d`, `stiffness` is `S`, symmetric, and
/// `masses` hold the diagonal of `M`.
///
/// Row by row of the result, each sum in the order of the rows of `P`, so that it does not depend on the number of
/// threads. [`galerkin`](crate::galerkin), with its small dense products, is for functions of many rows; these have
/// about eight.
pub(super) fn restricted(
    prolongation: &SparseMatrix<f32>,
    stiffness: &SparseMatrix,
    masses: &[f64],
) -> (SparseMatrix, Vec<f64>) {
    assert_eq!((stiffness.rows(), masses.len()), (prolongation.rows(), prolongation.rows()), "a row for each row");
    let d = prolongation.columns();
    let members = prolongation.transpose();
    let coarse = SparseMatrix::from_rows(
        d,
        d,
        || vec![0.0; d],
        |sums, row, entries| {
            sum_up(members.row(row), prolongation, stiffness, sums, entries);
        },
    );
    let weight = |row: usize| prolongation.row(row).1.iter().map(|&weight| f64::from(weight)).sum::<f64>();
    let lumped = |row: usize| {
        let (members, own) = members.row(row);
        let parts = members.iter().zip(own).map(|(&member, &own)| (member as usize, f64::from(own)));
        parts.fold(0.0, |sum, (member, own)| sum + own * masses[member] * weight(member))
    };
    (coarse, (0..d).into_par_iter().with_min_len(ROWS).map(lumped).collect())
}

/// Sums up the row whose column of `P` has these rows and entries, into `entries`; `sums` are zeros, and are so again.
fn sum_up(
    (members, own): (&[u32], &[f32]),
    prolongation: &SparseMatrix<f32>,
    stiffness: &SparseMatrix,
    sums: &mut [f64],
    entries: &mut Vec<(u32, f64)>,
) {
    for (&member, &weight) in members.iter().zip(own) {
        let (others, values) = stiffness.row(member as usize);
        for (&other, &value) in others.iter().zip(values) {
            let (columns, weights) = prolongation.row(other as usize);
            for (&column, &other) in columns.iter().zip(weights) {
                let sum = &mut sums[column as usize];
                // A sum that comes back to zero lists its column again: that is mended below.
                if *sum == 0.0 {
                    entries.push((column, 0.0));
                }
                *sum += f64::from(weight) * value * f64::from(other);
            }
        }
    }
    entries.sort_unstable_by_key(|entry| entry.0);
    entries.dedup_by_key(|entry| entry.0);
    entries.iter_mut().for_each(|(column, value)| *value = std::mem::take(&mut sums[*column as usize]));
    entries.retain(|entry| entry.1 != 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MassMatrix, galerkin};
    use chladni_base::{SplitMix64, Unwatched};

    #[test]
    fn a_coarse_pencil_is_that_of_the_general_product() {
        let mut random = SplitMix64::new(5);
        let (n, d) = (2000, 700);
        let mut number = || random.unit() - 0.3;
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            for offset in [n - 90, n - 1, 0, 1, 90] {
                indices.push(((row + offset) % n) as u32);
                values.push(if offset == 0 { 4.0 + number() } else { -1.0 });
            }
            offsets.push(indices.len());
        }
        let stiffness = SparseMatrix::from_unsorted(n, n, &offsets, &indices, &values).unwrap();
        let masses: Vec<f64> = (0..n).map(|_| 1.0 + number()).collect();
        let (mut offsets, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            // Every tenth row belongs to nothing.
            let count = if row % 10 == 9 { 0 } else { 1 + row % 3 };
            for k in 0..count {
                columns.push(((row / 3 + 17 * k) % d) as u32);
                weights.push(number());
            }
            offsets.push(columns.len());
        }
        let prolongation = SparseMatrix::from_unsorted(n, d, &offsets, &columns, &weights).unwrap();
        let values = prolongation.values().iter().map(|&x| x as f32).collect();
        let prolongation = SparseMatrix::from_sorted_parts(
            n,
            d,
            prolongation.offsets().to_vec(),
            prolongation.indices().to_vec(),
            values,
        );
        let (found, lumped) = restricted(&prolongation, &stiffness, &masses);
        let (expected, mass) = galerkin(&prolongation, &stiffness, &MassMatrix::Diagonal(masses), &Unwatched).unwrap();
        let mass = MassMatrix::Sparse(mass).lumped();
        for row in 0..d {
            let (columns, values) = found.row(row);
            let (others, expected) = expected.row(row);
            assert_eq!(columns, others, "row {row}");
            values.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-12, "row {row}: {a}, {b}"));
            assert!((lumped[row] - mass[row]).abs() < 1e-12, "row {row}");
        }
    }
}
