//! Products of columns and a vector, several columns at once: what the reduction to tridiagonal form spends half its
//! operations and most of its time on. The memory bounds them, so that every number of the matrix is read once.

use std::ops::Range;

use pulp::Simd;

/// Columns that are handled at once: as many as leave room in the registers for a factor and a sum each.
const WIDE: usize = 8;
const NARROW: usize = 4;

/// Adds to `y` what some columns of a symmetric matrix contribute to its product with `x`: `matrix` holds the lower
/// triangle, column after column of `y.len()` numbers.
pub(super) fn add_symmetric(matrix: &[f64], columns: Range<usize>, x: &[f64], y: &mut [f64]) {
    pulp::Arch::new().dispatch(Symmetric { matrix, columns, x, y });
}

struct Symmetric<'a> {
    matrix: &'a [f64],
    columns: Range<usize>,
    x: &'a [f64],
    y: &'a mut [f64],
}

impl pulp::WithSimd for Symmetric<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { matrix, columns, x, y } = self;
        let mut at = columns.start;
        if S::REGISTER_COUNT >= 32 {
            at = symmetric::<S, WIDE>(simd, matrix, at..columns.end, x, y);
        }
        at = symmetric::<S, NARROW>(simd, matrix, at..columns.end, x, y);
        symmetric::<S, 1>(simd, matrix, at..columns.end, x, y);
    }
}

/// As many whole groups of `C` columns as there are; gives the first column that is left.
#[inline(always)]
fn symmetric<S: Simd, const C: usize>(
    simd: S,
    matrix: &[f64],
    columns: Range<usize>,
    x: &[f64],
    y: &mut [f64],
) -> usize {
    let d = y.len();
    let mut first = columns.start;
    while first + C <= columns.end {
        let group: [&[f64]; C] = std::array::from_fn(|k| &matrix[(first + k) * d..(first + k + 1) * d]);
        for k in 0..C {
            let column = first + k;
            y[column] += group[k][column] * x[column];
            for row in column + 1..first + C {
                y[row] += group[k][row] * x[column];
                y[column] += group[k][row] * x[row];
            }
        }
        let below = first + C;
        let factors: [f64; C] = std::array::from_fn(|k| x[first + k]);
        let sums = both::<S, C>(simd, group.map(|column| &column[below..]), factors, &x[below..], &mut y[below..]);
        for k in 0..C {
            y[first + k] += sums[k];
        }
        first = below;
    }
    first
}

/// `y ← y + Σ fₖ aₖ`, and the products `aₖᵀx`.
#[inline(always)]
fn both<S: Simd, const C: usize>(
    simd: S,
    columns: [&[f64]; C],
    factors: [f64; C],
    x: &[f64],
    y: &mut [f64],
) -> [f64; C] {
    let n = y.len();
    let columns = columns.map(|column| S::as_simd_f64s(&column[..n]));
    let (x, x_rest) = S::as_simd_f64s(&x[..n]);
    let (y, y_rest) = S::as_mut_simd_f64s(y);
    let wide = factors.map(|factor| simd.splat_f64s(factor));
    let mut sums = [simd.splat_f64s(0.0); C];
    for i in 0..y.len() {
        let mut sum = y[i];
        for k in 0..C {
            let value = columns[k].0[i];
            sum = simd.mul_add_f64s(value, wide[k], sum);
            sums[k] = simd.mul_add_f64s(value, x[i], sums[k]);
        }
        y[i] = sum;
    }
    let mut sums = sums.map(|sum| simd.reduce_sum_f64s(sum));
    for i in 0..y_rest.len() {
        for k in 0..C {
            let value = columns[k].1[i];
            y_rest[i] += value * factors[k];
            sums[k] += value * x_rest[i];
        }
    }
    sums
}

/// `y ← y + Σ fₖ aₖ`, where column `k` of `matrix`, each of `y.len()` numbers, from row `from` on is `aₖ`.
pub(super) fn add_combination(matrix: &[f64], factors: &[f64], from: usize, y: &mut [f64]) {
    pulp::Arch::new().dispatch(Combination { matrix, factors, from, y });
}

struct Combination<'a> {
    matrix: &'a [f64],
    factors: &'a [f64],
    from: usize,
    y: &'a mut [f64],
}

impl pulp::WithSimd for Combination<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { matrix, factors, from, y } = self;
        let mut at = combinations::<S, WIDE>(simd, matrix, factors, 0, from, y);
        at = combinations::<S, 4>(simd, matrix, factors, at, from, y);
        at = combinations::<S, 2>(simd, matrix, factors, at, from, y);
        combinations::<S, 1>(simd, matrix, factors, at, from, y);
    }
}

/// As many whole groups of `C` columns, from column `at` on, as there are; gives the first that is left.
#[inline(always)]
fn combinations<S: Simd, const C: usize>(
    simd: S,
    matrix: &[f64],
    factors: &[f64],
    mut at: usize,
    from: usize,
    y: &mut [f64],
) -> usize {
    let d = y.len();
    for factors in factors[at..].as_chunks::<C>().0 {
        let columns = std::array::from_fn(|k| &matrix[(at + k) * d + from..(at + k + 1) * d]);
        combine::<S, C>(simd, columns, *factors, &mut y[from..]);
        at += C;
    }
    at
}

#[inline(always)]
fn combine<S: Simd, const C: usize>(simd: S, columns: [&[f64]; C], factors: [f64; C], y: &mut [f64]) {
    let n = y.len();
    let columns = columns.map(|column| S::as_simd_f64s(&column[..n]));
    let (y, y_rest) = S::as_mut_simd_f64s(y);
    let wide = factors.map(|factor| simd.splat_f64s(factor));
    for i in 0..y.len() {
        let mut sum = y[i];
        for k in 0..C {
            sum = simd.mul_add_f64s(columns[k].0[i], wide[k], sum);
        }
        y[i] = sum;
    }
    for i in 0..y_rest.len() {
        for k in 0..C {
            y_rest[i] += columns[k].1[i] * factors[k];
        }
    }
}

/// The products `aₖᵀx` with the columns of `matrix`, each of `x.len()` numbers, from row `from` on.
pub(super) fn dot_products(matrix: &[f64], x: &[f64], from: usize, into: &mut [f64]) {
    pulp::Arch::new().dispatch(Dots { matrix, x, from, into });
}

struct Dots<'a> {
    matrix: &'a [f64],
    x: &'a [f64],
    from: usize,
    into: &'a mut [f64],
}

impl pulp::WithSimd for Dots<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { matrix, x, from, into } = self;
        let mut at = products::<S, WIDE>(simd, matrix, x, 0, from, into);
        at = products::<S, 4>(simd, matrix, x, at, from, into);
        at = products::<S, 2>(simd, matrix, x, at, from, into);
        products::<S, 1>(simd, matrix, x, at, from, into);
    }
}

/// As many whole groups of `C` columns, from column `at` on, as there are; gives the first that is left.
#[inline(always)]
fn products<S: Simd, const C: usize>(
    simd: S,
    matrix: &[f64],
    x: &[f64],
    mut at: usize,
    from: usize,
    into: &mut [f64],
) -> usize {
    let d = x.len();
    for into in into[at..].as_chunks_mut::<C>().0 {
        let columns = std::array::from_fn(|k| &matrix[(at + k) * d + from..(at + k + 1) * d]);
        *into = dots::<S, C>(simd, columns, &x[from..]);
        at += C;
    }
    at
}

#[inline(always)]
fn dots<S: Simd, const C: usize>(simd: S, columns: [&[f64]; C], x: &[f64]) -> [f64; C] {
    let n = x.len();
    let columns = columns.map(|column| S::as_simd_f64s(&column[..n]));
    let (x, x_rest) = S::as_simd_f64s(x);
    let mut sums = [simd.splat_f64s(0.0); C];
    for i in 0..x.len() {
        for k in 0..C {
            sums[k] = simd.mul_add_f64s(columns[k].0[i], x[i], sums[k]);
        }
    }
    let mut sums = sums.map(|sum| simd.reduce_sum_f64s(sum));
    for i in 0..x_rest.len() {
        for k in 0..C {
            sums[k] += columns[k].1[i] * x_rest[i];
        }
    }
    sums
}
