//! Gram matrices of columns in single precision, kept as the cycles leave them: sixteen columns to a block. Sums are in
//! double precision, and in an order that does not depend on the number of threads.

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, MatMut, MatRef, Par};

use super::dense::sum_of_lower;
use super::{CYCLE_WIDTH, CycleRow, DenseMatrix};

/// Rows that are multiplied at once.
const ROWS: usize = 256;

/// `½(XᵀZ + ZᵀX)`, symmetric to the last bit. `x` and `z` are blocks of [`CYCLE_WIDTH`] columns with equal numbers of
/// rows.
///
/// # Errors
/// The monitor asked to stop.
///
/// # Panics
/// Where `x` and `z` have different shapes.
pub fn symmetric_product(
    x: &[Vec<CycleRow>],
    z: &[Vec<CycleRow>],
    monitor: &dyn Monitor,
) -> Result<DenseMatrix, Cancelled> {
    assert_eq!(x.len(), z.len(), "as many blocks");
    products(&[(x, z), (z, x)], 0.5, None, monitor)
}

/// `XᵀWX` with a positive diagonal matrix `W`.
///
/// # Errors
/// The monitor asked to stop.
///
/// # Panics
/// Unless there is a weight for each row.
pub fn weighted_gram(x: &[Vec<CycleRow>], weights: &[f64], monitor: &dyn Monitor) -> Result<DenseMatrix, Cancelled> {
    products(&[(x, x)], 1.0, Some(weights), monitor)
}

/// Columns in blocks of [`CYCLE_WIDTH`], each row after row.
type Blocks<'a> = &'a [Vec<CycleRow>];

/// The sum of `factor · AᵀWB` over some pairs of blocks, which is symmetric.
fn products(
    pairs: &[(Blocks<'_>, Blocks<'_>)],
    factor: f64,
    weights: Option<&[f64]>,
    monitor: &dyn Monitor,
) -> Result<DenseMatrix, Cancelled> {
    let blocks = pairs.first().map_or(0, |(a, _)| a.len());
    let n = pairs.first().and_then(|(a, _)| a.first()).map_or(0, Vec::len);
    let shapes = pairs.iter().flat_map(|(a, b)| a.iter().chain(b.iter())).all(|block| block.len() == n);
    assert!(shapes && weights.is_none_or(|weights| weights.len() == n), "blocks and weights of {n} rows");
    let width = blocks * CYCLE_WIDTH;
    let segments = (n / (8 * ROWS)).clamp(1, 8);
    let segment = n.div_ceil(segments).next_multiple_of(ROWS);
    let parts: Vec<DenseMatrix> = (0..segments)
        .into_par_iter()
        .map(|s| {
            let mut sums = DenseMatrix::zeros(width, width);
            let (mut left, mut right) = (vec![0.0; ROWS * width], vec![0.0; ROWS * width]);
            let (mut from, end) = ((s * segment).min(n), n.min((s + 1) * segment));
            while from < end {
                monitor.checkpoint()?;
                let rows = from..end.min(from + ROWS);
                for (a, b) in pairs {
                    widen(a, rows.clone(), None, &mut left, width);
                    widen(b, rows.clone(), weights, &mut right, width);
                    triangular::matmul(
                        MatMut::from_column_major_slice_mut(sums.values_mut(), width, width),
                        BlockStructure::TriangularLower,
                        Accum::Add,
                        MatRef::from_column_major_slice(&left[..rows.len() * width], width, rows.len()),
                        BlockStructure::Rectangular,
                        MatRef::from_row_major_slice(&right[..rows.len() * width], rows.len(), width),
                        BlockStructure::Rectangular,
                        factor,
                        Par::Seq,
                    );
                }
                from = rows.end;
            }
            Ok(sums)
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(sum_of_lower(&parts, width))
}

/// Some rows of all blocks in double precision, one row after the other, each times its weight.
fn widen(
    blocks: &[Vec<CycleRow>],
    rows: std::ops::Range<usize>,
    weights: Option<&[f64]>,
    into: &mut [f64],
    width: usize,
) {
    for (k, block) in blocks.iter().enumerate() {
        for ((row, into), values) in rows.clone().zip(into.chunks_exact_mut(width)).zip(&block[rows.clone()]) {
            let weight = weights.map_or(1.0, |weights| weights[row]);
            let into = &mut into[k * CYCLE_WIDTH..(k + 1) * CYCLE_WIDTH];
            into.iter_mut().zip(values).for_each(|(into, &value)| *into = weight * f64::from(value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::{SplitMix64, Unwatched};

    fn random(n: usize, blocks: usize, seed: u64) -> Vec<Vec<CycleRow>> {
        let mut random = SplitMix64::new(seed);
        (0..blocks).map(|_| (0..n).map(|_| std::array::from_fn(|_| random.signed_unit() as f32)).collect()).collect()
    }

    fn entry(x: &[Vec<CycleRow>], row: usize, column: usize) -> f64 {
        f64::from(x[column / CYCLE_WIDTH][row][column % CYCLE_WIDTH])
    }

    #[test]
    fn products_are_those_of_the_columns_one_by_one() {
        let (n, blocks) = (5000, 3);
        let (x, z) = (random(n, blocks, 1), random(n, blocks, 2));
        let weights: Vec<f64> = (0..n).map(|row| 0.5 + (row % 7) as f64).collect();
        let mixed = symmetric_product(&x, &z, &Unwatched).unwrap();
        let gram = weighted_gram(&x, &weights, &Unwatched).unwrap();
        for (i, j) in [(0, 0), (3, 20), (47, 16), (20, 3), (31, 32)] {
            let sum = |f: &dyn Fn(usize) -> f64| (0..n).map(f).sum::<f64>();
            let expected = sum(&|row| entry(&x, row, i) * entry(&z, row, j) + entry(&z, row, i) * entry(&x, row, j));
            assert!((mixed.column(j)[i] - 0.5 * expected).abs() < 1e-9, "({i}, {j})");
            let expected = sum(&|row| weights[row] * entry(&x, row, i) * entry(&x, row, j));
            assert!((gram.column(j)[i] - expected).abs() < 1e-9 * n as f64, "({i}, {j})");
        }
    }
}
