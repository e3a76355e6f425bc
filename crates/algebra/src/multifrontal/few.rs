//! The elimination of a front of few columns: most fronts of a sparse matrix are so small that the whole of one stays
//! in the first-level cache.

use pulp::Simd;

use super::plan::stride;

/// A pivot is zero or not finite.
#[derive(Debug)]
pub struct NoPivot;

/// Columns of the update that are computed together, and vectors of rows.
const WIDE: usize = 4;
const HIGH: usize = 2;

/// What [`eliminate`](super::dense::eliminate) is given, and memory.
pub struct Few<'a> {
    pub values: &'a mut [f64],
    pub rows: usize,
    pub columns: usize,
    pub update: &'a mut [f64],
    pub scaled: &'a mut Vec<f64>,
    pub lower: &'a mut Vec<f64>,
}

impl pulp::WithSimd for Few<'_> {
    type Output = Result<(), NoPivot>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { values, rows, columns, update, scaled, lower } = self;
        let below = rows - columns;
        let stride = stride(below);
        let size = columns * stride;
        if scaled.len() < size {
            scaled.resize(size, 0.0);
        }
        if lower.len() < size {
            lower.resize(size, 0.0);
        }
        let (scaled, lower) = (&mut scaled[..size], &mut lower[..size]);
        for column in 0..columns {
            let (left, right) = values.split_at_mut((column + 1) * rows);
            let pivots = &mut left[column * rows..];
            let d = pivots[column];
            if !(d.is_finite() && d != 0.0) {
                return Err(NoPivot);
            }
            let inverse = d.recip();
            for (other, target) in right.chunks_exact_mut(rows).enumerate() {
                let other = column + 1 + other;
                let factor = simd.splat_f64s(-inverse * pivots[other]);
                add::<S>(simd, &mut target[other..], &pivots[other..], factor);
            }
            if below > 0 {
                let (scaled, lower) =
                    (&mut scaled[column * stride..][..stride], &mut lower[column * stride..][..stride]);
                scaled[below..].fill(0.0);
                lower[below..].fill(0.0);
                scaled[..below].copy_from_slice(&pivots[columns..]);
                for (l, &w) in lower.iter_mut().zip(&scaled[..below]) {
                    *l = w * inverse;
                }
                pivots[columns..].copy_from_slice(&lower[..below]);
            }
            for l in &mut pivots[column + 1..columns] {
                *l *= inverse;
            }
        }
        // Two more columns of tiles than whole ones are harmless: the update is a square of whole strides.
        let lanes = S::F64_LANES;
        for column in (0..below).step_by(WIDE) {
            let mut row = column / lanes * lanes;
            while row + HIGH * lanes <= stride {
                tile::<S, HIGH>(simd, update, (scaled, lower), (stride, row, column));
                row += HIGH * lanes;
            }
            while row < stride {
                tile::<S, 1>(simd, update, (scaled, lower), (stride, row, column));
                row += lanes;
            }
        }
        Ok(())
    }
}

/// `target + factor · source`.
#[inline(always)]
fn add<S: Simd>(simd: S, target: &mut [f64], source: &[f64], factor: S::f64s) {
    let (target, last) = S::as_mut_simd_f64s(target);
    let (source, last_source) = S::as_simd_f64s(source);
    for (target, source) in target.iter_mut().zip(source) {
        *target = simd.mul_add_f64s(factor, *source, *target);
    }
    if !last.is_empty() {
        let sum = simd.mul_add_f64s(factor, simd.partial_load_f64s(last_source), simd.partial_load_f64s(last));
        simd.partial_store_f64s(last, sum);
    }
}

/// `−L Sᵀ` for some vectors of rows and four columns.
#[inline(always)]
fn tile<S: Simd, const V: usize>(
    simd: S,
    update: &mut [f64],
    (scaled, lower): (&[f64], &[f64]),
    (stride, row, column): (usize, usize, usize),
) {
    let mut sums = [[simd.splat_f64s(0.0); V]; WIDE];
    for (scaled, lower) in scaled.chunks_exact(stride).zip(lower.chunks_exact(stride)) {
        let (lower, _) = S::as_simd_f64s(&lower[row..row + V * S::F64_LANES]);
        let factors = &scaled[column..column + WIDE];
        for k in 0..WIDE {
            let factor = simd.splat_f64s(-factors[k]);
            for v in 0..V {
                sums[k][v] = simd.mul_add_f64s(factor, lower[v], sums[k][v]);
            }
        }
    }
    for (k, sums) in sums.into_iter().enumerate() {
        let (target, _) = S::as_mut_simd_f64s(&mut update[(column + k) * stride + row..][..V * S::F64_LANES]);
        target.copy_from_slice(&sums);
    }
}
