//! Pencils with a part of their own far above all others.

use chladni_algebra::{MassMatrix, SparseMatrix};
use chladni_base::Unwatched;

use super::super::dense_pairs::dense_pairs;
use crate::spectrum::hsim::level::{Level, NO_KERNEL};

/// A path of `n` rows, whose eigenvalues are known, and one more row that a spring of this strength ties to the first,
/// with next to no mass.
fn tied(n: usize, strength: f64, mass: f64) -> (Level, Vec<f64>) {
    let mut entries = vec![vec![0.0; n + 1]; n + 1];
    for k in 0..n {
        entries[k][k] = 2.0;
        if k + 1 < n {
            (entries[k][k + 1], entries[k + 1][k]) = (-1.0, -1.0);
        }
    }
    entries[0][0] += strength;
    (entries[0][n], entries[n][0], entries[n][n]) = (-strength, -strength, strength);
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in &entries {
        for (column, &value) in row.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            indices.push(column as u32);
            values.push(value);
        }
        offsets.push(indices.len());
    }
    let stiffness = SparseMatrix::from_sorted_parts(n + 1, n + 1, offsets, indices, values);
    let mut masses = vec![1.0; n + 1];
    masses[n] = mass;
    let exact = (1..=n).map(|k| 2.0 - 2.0 * (std::f64::consts::PI * k as f64 / (n + 1) as f64).cos()).collect();
    let positions = (0..=n).map(|k| [k as f64, 0.0, 0.0]).collect();
    let component = vec![NO_KERNEL; n + 1];
    (Level { stiffness, mass: MassMatrix::Diagonal(masses), positions, component }, exact)
}

#[test]
fn low_values_keep_their_digits_beside_high_ones() {
    for (strength, mass) in [(1e3, 1e-6), (1e6, 1e-10), (1e8, 1e-12)] {
        let (level, exact) = tied(30, strength, mass);
        for count in [5, 30, 31] {
            let (values, vectors) = dense_pairs(&level, count, &Unwatched).unwrap();
            assert_eq!((values.len(), vectors.columns()), (count, count));
            // Taking the mass and the spring away moves the values by about the mass, and by what rounding of the
            // spring does.
            let allowed = mass + 1e-15 * strength + 1e-12;
            for (k, (value, exact)) in values.iter().zip(&exact).enumerate() {
                assert!((value - exact).abs() <= 10.0 * allowed, "{strength:e}: {k} of {count}: {value}, not {exact}");
            }
            assert!(count < 31 || values[30] > 0.9 * strength / mass);
        }
    }
}
