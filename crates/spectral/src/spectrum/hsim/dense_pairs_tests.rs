//! Blocks are told, and solved as the whole is.

use chladni_algebra::{MassMatrix, SparseMatrix, Weight, inner_products};
use chladni_base::Unwatched;

use super::{blocks, dense_pairs, dense_rows, whole};
use crate::spectrum::hsim::level::{Level, NO_KERNEL};
use crate::spectrum::hsim::offset;

/// Paths of so many vertices, each with its own mass, their rows interleaved.
fn paths(lengths: &[usize], fixed: bool) -> Level {
    let mut rows: Vec<(usize, usize)> = Vec::new();
    for (path, &length) in lengths.iter().enumerate() {
        rows.extend((0..length).map(|place| (place, path)));
    }
    rows.sort_unstable();
    let row_of = |path: usize, place: usize| rows.iter().position(|&row| row == (place, path)).unwrap();
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for &(place, path) in &rows {
        let mut entries: Vec<(u32, f64)> = Vec::new();
        let mut degree = if fixed { 0.25 } else { 0.0 };
        for other in [place.wrapping_sub(1), place + 1] {
            if other < lengths[path] {
                entries.push((row_of(path, other) as u32, -1.0));
                degree += 1.0;
            }
        }
        entries.push((row_of(path, place) as u32, degree));
        entries.sort_unstable_by_key(|entry| entry.0);
        indices.extend(entries.iter().map(|entry| entry.0));
        values.extend(entries.iter().map(|entry| entry.1));
        offsets.push(indices.len());
    }
    let n = rows.len();
    let stiffness = SparseMatrix::from_sorted_parts(n, n, offsets, indices, values);
    let mass = MassMatrix::Diagonal(rows.iter().map(|&(_, path)| 1.0 + path as f64).collect());
    let component = offset::components(&stiffness, &mass, 0.0);
    Level { stiffness, mass, positions: Vec::new(), component }
}

#[test]
fn rows_that_nothing_couples_are_blocks() {
    let level = paths(&[3, 5, 4], false);
    let found = blocks(&level.stiffness, &level.mass);
    assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [3, 5, 4]);
    assert!(found.iter().all(|rows| rows.is_sorted()));
    assert_eq!(dense_rows(&level.stiffness, &level.mass), (216f64).cbrt().ceil() as usize);
    // A mass couples as well.
    let n = level.size();
    let parts: [(usize, u32, f64); 4] = [(0, 0, 2.0), (0, 1, 0.5), (1, 0, 0.5), (1, 1, 2.0)];
    let (mut offsets, mut indices, mut values) = (vec![0usize], Vec::new(), Vec::new());
    for row in 0..n {
        for &(_, column, value) in parts.iter().filter(|part| part.0 == row) {
            indices.push(column);
            values.push(value);
        }
        if row > 1 {
            indices.push(row as u32);
            values.push(2.0);
        }
        offsets.push(indices.len());
    }
    let coupled = SparseMatrix::from_sorted_parts(n, n, offsets, indices, values);
    assert_eq!(blocks(&level.stiffness, &MassMatrix::Sparse(coupled)).len(), 2);
}

#[test]
fn pairs_of_blocks_are_those_of_the_whole() {
    for (lengths, fixed) in [(&[7, 12, 7, 1][..], false), (&[9, 9, 4][..], true)] {
        let level = paths(lengths, fixed);
        assert_eq!(level.component.contains(&NO_KERNEL), fixed);
        for count in [1, 10, 18] {
            let (together, _) = whole(&level, count, &Unwatched).unwrap();
            let (values, vectors) = dense_pairs(&level, count, &Unwatched).unwrap();
            assert_eq!(values.len(), count);
            for (value, other) in values.iter().zip(&together) {
                assert!((value - other).abs() < 1e-12, "{values:?} {together:?}");
            }
            let gram = inner_products(&vectors, Weight::Mass(&level.mass), &vectors, &Unwatched).unwrap();
            let product = inner_products(&vectors, Weight::Stiffness(&level.stiffness), &vectors, &Unwatched).unwrap();
            for i in 0..count {
                for j in 0..count {
                    let one = f64::from(u8::from(i == j));
                    assert!((gram.column(j)[i] - one).abs() < 1e-12);
                    assert!((product.column(j)[i] - one * values[i]).abs() < 1e-11);
                }
            }
        }
    }
}
