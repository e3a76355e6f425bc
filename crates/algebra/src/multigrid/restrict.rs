//! The pencil of a coarse level: its restriction to a prolongation of a few entries a row.

use rayon::prelude::*;

use crate::SparseMatrix;

/// Coarse rows that a thread makes at once.
const ROWS: usize = 512;

/// `PᵀSP` and the diagonal of the lumped `PᵀMP`: `prolongation` is `P`, `n × d`, `stiffness` is `S`, symmetric, and `masses` hold the diagonal of `M`.
///
/// Row by row of the result, each sum in the order of the rows of `P`, so that it does not depend on the number of threads.
/// [`galerkin`](crate::galerkin), with its small dense products, is for functions of many rows; these have about eight.
pub(super) fn restricted(
    prolongation: &SparseMatrix<f32>,
    stiffness: &SparseMatrix,
    masses: &[f64],
) -> (SparseMatrix, Vec<f64>) {
    assert_eq!((stiffness.rows(), masses.len()), (prolongation.rows(), prolongation.rows()), "a row for each row");
    let d = prolongation.columns();
    let members = prolongation.transpose();
    let chunks: Vec<Rows> = (0..d.div_ceil(ROWS))
        .into_par_iter()
        .map_init(
            || vec![0.0; d],
            |sums, chunk| {
                let mut rows = Rows::default();
                for row in chunk * ROWS..d.min((chunk + 1) * ROWS) {
                    rows.add(members.row(row), prolongation, stiffness, masses, sums);
                }
                rows
            },
        )
        .collect();
    let entries = chunks.iter().map(|rows| rows.indices.len()).sum();
    let (mut offsets, mut indices, mut values) =
        (Vec::with_capacity(d + 1), Vec::with_capacity(entries), Vec::with_capacity(entries));
    offsets.push(0);
    let mut lumped = Vec::with_capacity(d);
    for rows in chunks {
        let start = indices.len();
        offsets.extend(rows.ends.iter().map(|end| start + end));
        indices.extend(rows.indices);
        values.extend(rows.values);
        lumped.extend(rows.masses);
    }
    (SparseMatrix::from_sorted_parts(d, d, offsets, indices, values), lumped)
}

/// Some rows of the result, one after the other.
#[derive(Default)]
struct Rows {
    ends: Vec<usize>,
    indices: Vec<u32>,
    values: Vec<f64>,
    masses: Vec<f64>,
}

impl Rows {
    /// Adds the row whose column of `P` has these rows and entries; `sums` are zeros, and are so again.
    fn add(
        &mut self,
        (members, own): (&[u32], &[f32]),
        prolongation: &SparseMatrix<f32>,
        stiffness: &SparseMatrix,
        masses: &[f64],
        sums: &mut [f64],
    ) {
        let (start, mut lumped) = (self.indices.len(), 0.0);
        for (&member, &weight) in members.iter().zip(own) {
            let (member, weight) = (member as usize, f64::from(weight));
            let (others, values) = stiffness.row(member);
            for (&other, &value) in others.iter().zip(values) {
                let (columns, weights) = prolongation.row(other as usize);
                for (&column, &other) in columns.iter().zip(weights) {
                    let sum = &mut sums[column as usize];
                    // A sum that comes back to zero lists its column again: that is mended below.
                    if *sum == 0.0 {
                        self.indices.push(column);
                    }
                    *sum += weight * value * f64::from(other);
                }
            }
            lumped += weight * masses[member] * prolongation.row(member).1.iter().map(|&w| f64::from(w)).sum::<f64>();
        }
        let mut columns = self.indices.split_off(start);
        columns.sort_unstable();
        columns.dedup();
        for column in columns {
            let value = std::mem::take(&mut sums[column as usize]);
            if value != 0.0 {
                self.indices.push(column);
                self.values.push(value);
            }
        }
        self.ends.push(self.indices.len());
        self.masses.push(lumped);
    }
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
