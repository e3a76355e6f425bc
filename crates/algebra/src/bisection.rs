//! A few of the lowest pairs of a symmetric tridiagonal matrix: values by bisection with Sturm counts, vectors by
//! inverse iteration (as LAPACK's `dstebz` and `dstein`).
//!
//! Divide and conquer makes all vectors, at a cost of order `d³`; where few are wanted this one, of order `d m` and
//! `d m²` for the last orthogonalisation, is several times faster. Its weak spot are clusters. Vectors within one are
//! orthogonalised while they are iterated, all of them once more at the end, and the outcome is checked.

use chladni_base::parallel::*;

use super::{DenseMatrix, dot, orthonormalise, vectorized};

/// Shifts that are counted at once.
const LANES: usize = 32;

/// Halvings of an interval of length 2: what is left is rounding.
const HALVINGS: usize = 54;

/// Neighbours closer than this, relative to the matrix, are iterated together. Vectors of values further apart are
/// orthogonal up to the rounding error over it, which the last orthogonalisation repairs.
const CLUSTER: f64 = 1e-5;

/// Solves for each vector.
const ITERATIONS: usize = 3;

/// The largest residual, relative to the matrix, of a pair that is believed.
const RESIDUAL: f64 = 1e-13;

/// The `count` lowest pairs, ascending and orthonormal, of the matrix with this diagonal and, beside it, the first
/// `d − 1` of these numbers. `None` where the outcome does not hold what it should, or numbers are not finite: then
/// another method is due.
pub(super) fn lowest_few(diagonal: &[f64], off_diagonal: &[f64], count: usize) -> Option<(Vec<f64>, DenseMatrix)> {
    let d = diagonal.len();
    let matrix = Tridiagonal::scaled(diagonal, off_diagonal.get(..d.checked_sub(1)?)?)?;
    let values = matrix.lowest_values(count.min(d));
    let mut clusters: Vec<Vec<f64>> = Vec::new();
    for &value in &values {
        match clusters.last_mut() {
            Some(cluster) if cluster.last().is_some_and(|last| value - last < CLUSTER) => cluster.push(value),
            _ => clusters.push(vec![value]),
        }
    }
    let columns: Vec<Vec<f64>> = clusters.par_iter().map(|cluster| matrix.vectors(cluster)).collect();
    let mut vectors = DenseMatrix::from_columns(d, values.len(), columns.concat());
    let gram = vectors.transposed_times(&vectors);
    let apart = |k: usize| gram.column(k)[..k].iter().all(|product| product.abs() < 1e-3);
    if !(0..values.len()).all(apart) {
        return None;
    }
    orthonormalise(&mut vectors, gram).ok()?;
    let holds = |k: usize| matrix.residual(values[k], vectors.column(k)) < RESIDUAL;
    (0..values.len()).all(holds).then(|| (values.iter().map(|value| value * matrix.norm).collect(), vectors))
}

/// A tridiagonal matrix over its norm.
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// `d − 1` numbers.
    off_diagonal: Vec<f64>,
    /// Zero and their squares: `d` numbers.
    squares: Vec<f64>,
    norm: f64,
}

impl Tridiagonal {
    fn scaled(diagonal: &[f64], off_diagonal: &[f64]) -> Option<Self> {
        let at = |k: usize| off_diagonal.get(k).map_or(0.0, |x| x.abs());
        let row = |k: usize| diagonal[k].abs() + at(k) + if k > 0 { at(k - 1) } else { 0.0 };
        let norm = (0..diagonal.len()).map(row).fold(0.0, f64::max);
        if !(norm > 1e-280 && norm < 1e280) || (0..diagonal.len()).any(|k| !row(k).is_finite()) {
            return None;
        }
        let diagonal = diagonal.iter().map(|x| x / norm).collect();
        let off_diagonal: Vec<f64> = off_diagonal.iter().map(|x| x / norm).collect();
        let squares = std::iter::once(0.0).chain(off_diagonal.iter().map(|x| x * x)).collect();
        Some(Self { diagonal, off_diagonal, squares, norm })
    }

    /// How many eigenvalues lie below each shift: the negative pivots of `T − x`.
    fn below(&self, shifts: &[f64; LANES]) -> [f64; LANES] {
        let mut counts = [0.0; LANES];
        vectorized(
            &mut counts,
            #[inline(always)]
            |counts| {
                let (mut pivots, mut sums) = ([1.0; LANES], [0.0; LANES]);
                for (&own, &square) in self.diagonal.iter().zip(&self.squares) {
                    for lane in 0..LANES {
                        let pivot = own - shifts[lane] - square / pivots[lane];
                        // A pivot of zero is taken for a negative one; the quotient by it stays finite.
                        let pivot = if pivot.abs() < f64::MIN_POSITIVE { -f64::MIN_POSITIVE } else { pivot };
                        sums[lane] += if pivot < 0.0 { 1.0 } else { 0.0 };
                        pivots[lane] = pivot;
                    }
                }
                *counts = sums;
            },
        );
        counts
    }

    /// The lowest eigenvalues, ascending.
    fn lowest_values(&self, count: usize) -> Vec<f64> {
        let mut values = vec![0.0; count];
        values.par_chunks_mut(LANES).enumerate().for_each(|(group, values)| {
            // By Gershgorin none lies outside, up to rounding.
            let (mut low, mut high) = ([-1.0 - 1e-14; LANES], [1.0 + 1e-14; LANES]);
            let mut middle = [0.0; LANES];
            for _ in 0..HALVINGS {
                for lane in 0..LANES {
                    middle[lane] = 0.5 * (low[lane] + high[lane]);
                }
                let below = self.below(&middle);
                for lane in 0..LANES {
                    if below[lane] > (group * LANES + lane) as f64 {
                        high[lane] = middle[lane];
                    } else {
                        low[lane] = middle[lane];
                    }
                }
            }
            values.iter_mut().zip(low.iter().zip(&high)).for_each(|(value, (low, high))| *value = 0.5 * (low + high));
        });
        values.sort_unstable_by(f64::total_cmp);
        values
    }

    /// Unit vectors of the values of a cluster, one after the other.
    fn vectors(&self, cluster: &[f64]) -> Vec<f64> {
        let d = self.diagonal.len();
        let mut vectors: Vec<f64> = Vec::with_capacity(d * cluster.len());
        let mut last = f64::NEG_INFINITY;
        let mut state = 0x9e37_79b9_7f4a_7c15u64;
        for &value in cluster {
            // Equal shifts would give equal vectors.
            last = value.max(last + 10.0 * f64::EPSILON);
            let factor = PivotedFactor::new(self, last);
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            };
            let mut x: Vec<f64> = (0..d).map(|_| random()).collect();
            for _ in 0..ITERATIONS {
                factor.solve(&mut x);
                // Twice is enough.
                for earlier in vectors.chunks_exact(d).chain(vectors.chunks_exact(d)) {
                    let product = dot(earlier, &x);
                    x.iter_mut().zip(earlier).for_each(|(x, y)| *x -= product * y);
                }
                let scale = 1.0 / dot(&x, &x).sqrt();
                x.iter_mut().for_each(|x| *x *= scale);
            }
            vectors.extend_from_slice(&x);
        }
        vectors
    }

    /// `‖T x − λ x‖`; not a number where `x` has some that are none.
    fn residual(&self, value: f64, x: &[f64]) -> f64 {
        let mut square = 0.0;
        for k in 0..x.len() {
            let mut sum = (self.diagonal[k] - value) * x[k];
            if k > 0 {
                sum += self.off_diagonal[k - 1] * x[k - 1];
            }
            if k + 1 < x.len() {
                sum += self.off_diagonal[k] * x[k + 1];
            }
            square += sum * sum;
        }
        square.sqrt()
    }
}

/// `T − x = P L U` by elimination with partial pivoting, as LAPACK's `dgttrf`.
struct PivotedFactor {
    /// What row `k` was multiplied with before it was taken from row `k + 1`, and whether the two were exchanged.
    steps: Vec<(f64, bool)>,
    /// Rows of `U`: one over the diagonal, and two numbers beside it.
    rows: Vec<[f64; 3]>,
}

impl PivotedFactor {
    fn new(matrix: &Tridiagonal, shift: f64) -> Self {
        let d = matrix.diagonal.len();
        let (mut steps, mut rows) = (Vec::with_capacity(d), Vec::with_capacity(d));
        let off_diagonal = |k: usize| matrix.off_diagonal.get(k).copied().unwrap_or(0.0);
        // The row that is being eliminated with.
        let mut row = [matrix.diagonal[0] - shift, off_diagonal(0), 0.0];
        for k in 0..d - 1 {
            let next = [off_diagonal(k), matrix.diagonal[k + 1] - shift, off_diagonal(k + 1)];
            let exchanged = next[0].abs() > row[0].abs();
            let (pivot, other) = if exchanged { (next, row) } else { (row, next) };
            let inverse = inverse(pivot[0]);
            let factor = other[0] * inverse;
            rows.push([inverse, pivot[1], pivot[2]]);
            steps.push((factor, exchanged));
            row = [other[1] - factor * pivot[1], other[2] - factor * pivot[2], 0.0];
        }
        rows.push([inverse(row[0]), 0.0, 0.0]);
        Self { steps, rows }
    }

    fn solve(&self, x: &mut [f64]) {
        let mut current = x[0];
        for (k, &(factor, exchanged)) in self.steps.iter().enumerate() {
            let next = x[k + 1];
            let (pivot, other) = if exchanged { (next, current) } else { (current, next) };
            x[k] = pivot;
            current = other - factor * pivot;
        }
        let end = x.len() - 1;
        x[end] = current;
        let (mut first, mut second) = (0.0, 0.0);
        for (x, row) in x.iter_mut().zip(&self.rows).rev() {
            *x = (*x - row[1] * first - row[2] * second) * row[0];
            (first, second) = (*x, first);
        }
    }
}

/// One over a pivot, which is kept away from zero by a rounding error.
fn inverse(pivot: f64) -> f64 {
    if pivot.abs() < f64::EPSILON { f64::EPSILON.recip().copysign(pivot) } else { pivot.recip() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(diagonal: &[f64], off_diagonal: &[f64], count: usize, expected: impl Fn(usize) -> f64) {
        let (values, vectors) = lowest_few(diagonal, off_diagonal, count).unwrap();
        let norm = diagonal.iter().chain(off_diagonal).fold(0.0f64, |most, x| most.max(x.abs()));
        assert_eq!((values.len(), vectors.rows(), vectors.columns()), (count, diagonal.len(), count));
        for k in 0..count {
            assert!((values[k] - expected(k)).abs() < 1e-14 * norm, "{k}: {} is not {}", values[k], expected(k));
        }
        let gram = vectors.transposed_times(&vectors);
        let one = |i: usize, k: usize| if i == k { 1.0 } else { 0.0 };
        assert!((0..count).all(|k| (0..count).all(|i| (gram.column(k)[i] - one(i, k)).abs() < 1e-13)));
        let matrix = Tridiagonal::scaled(diagonal, &off_diagonal[..diagonal.len() - 1]).unwrap();
        assert!((0..count).all(|k| matrix.residual(values[k] / matrix.norm, vectors.column(k)) < 1e-13));
    }

    #[test]
    fn the_chain_has_its_cosines() {
        for (d, count) in [(1000, 100), (257, 33), (70, 70), (2, 1), (1, 1)] {
            let angle = |k: usize| std::f64::consts::PI * (k + 1) as f64 / (d + 1) as f64;
            check(&vec![2.0; d], &vec![-1.0; d], count, |k| 2.0 - 2.0 * angle(k).cos());
        }
    }

    #[test]
    fn blocks_without_links_have_every_value_as_often_as_there_are_blocks() {
        // Forty chains of ten: the lowest value forty times.
        let (d, blocks) = (400, 40);
        let off_diagonal: Vec<f64> = (0..d).map(|k| if k % 10 == 9 { 0.0 } else { -3.0 }).collect();
        let angle = |k: usize| std::f64::consts::PI * (k / blocks + 1) as f64 / 11.0;
        check(&vec![6.0; d], &off_diagonal, 90, |k| 6.0 - 6.0 * angle(k).cos());
    }

    /// Wilkinson's matrix: its values come in pairs that agree in all digits.
    #[test]
    fn values_that_can_hardly_be_told_apart_have_orthogonal_vectors() {
        let d = 201;
        let diagonal: Vec<f64> = (0..d).map(|k| -(k as f64 - 100.0).abs()).collect();
        let (values, vectors) = lowest_few(&diagonal, &vec![1.0; d], 40).unwrap();
        assert!((0..10).all(|k| values[2 * k + 1] - values[2 * k] < 1e-12));
        let gram = vectors.transposed_times(&vectors);
        assert!((0..40).all(|k| (0..k).all(|i| gram.column(k)[i].abs() < 1e-13)));
    }

    #[test]
    fn what_is_not_finite_or_is_nothing_is_left_to_others() {
        assert!(lowest_few(&[0.0; 5], &[0.0; 5], 2).is_none());
        assert!(lowest_few(&[1.0, f64::NAN, 1.0], &[0.1; 3], 2).is_none());
        assert!(lowest_few(&[1.0, 2.0], &[f64::INFINITY; 2], 1).is_none());
        assert!(lowest_few(&[], &[], 0).is_none());
    }
}
