//! The first map of a pair: an energy that is quadratic in the entries of `C`, solved at once.

use chladni_algebra::{DenseMatrix, solve_definite};

use super::known::ShapeSignatures;
use crate::analysis::error::AnalysisError;
use crate::analysis::functional_map::matching::transposed;

/// Weights of the terms, each scaled to what it is for maps at random: signatures that are kept, commuting with
/// Laplacians, with products and with oriented derivatives (those of pyFM, which are of Ren et al. 2018 in order).
const SIGNATURES: f64 = 0.1;
const LAPLACIANS: f64 = 1e-3;
const PRODUCTS: f64 = 1.0;
const TURNS: f64 = 1.0;

/// `argmin` of `a ‖C A − B‖² + b ‖M ∘ C‖² + c Σ ‖C X − Y C‖²` over `k × k` matrices, with the resolvent mask `M` of Ren
/// et al. 2019.
pub(super) fn map(
    from: &ShapeSignatures<'_>,
    to: &ShapeSignatures<'_>,
    oriented: bool,
) -> Result<DenseMatrix, AnalysisError> {
    let k = from.signatures.rows();
    let mut system = DenseMatrix::zeros(k * k, k * k);
    // Unknown c k + r is the entry in row r and column c.
    let (a, b) = (&from.signatures, &to.signatures);
    let size: f64 = a.values().iter().map(|x| x * x).sum::<f64>() / k as f64;
    let weight = SIGNATURES / size.max(f64::MIN_POSITIVE);
    let gram = a.times(&transposed(a));
    let mut rhs = DenseMatrix::zeros(k * k, 1);
    let sides = b.times(&transposed(a));
    rhs.column_mut(0).iter_mut().zip(sides.values()).for_each(|(slot, value)| *slot = weight * value);
    for column in 0..k {
        for other in 0..k {
            let value = weight * gram.column(column)[other];
            (0..k).for_each(|row| system.column_mut(column * k + row)[other * k + row] += value);
        }
    }
    let mask = resolvent(&from.side.eigenvalues[..k], &to.side.eigenvalues[..k]);
    let mean = (mask.iter().sum::<f64>() / mask.len() as f64).max(f64::MIN_POSITIVE);
    mask.iter().enumerate().for_each(|(place, value)| system.column_mut(place)[place] += LAPLACIANS * value / mean);
    commuting(&mut system, &from.products, &to.products, PRODUCTS)?;
    if oriented {
        commuting(&mut system, &from.turns, &to.turns, TURNS)?;
    }
    let trace = (0..k * k).map(|i| system.column(i)[i]).sum::<f64>() / (k * k) as f64;
    (0..k * k).for_each(|i| system.column_mut(i)[i] += 1e-9 * trace.max(f64::MIN_POSITIVE));
    solve_definite(system, &mut rhs)?;
    Ok(DenseMatrix::from_columns(k, k, rhs.into_values()))
}

/// `|1/(√μ − i) − 1/(√λ − i)|²` with both spectra over their largest value, entry after entry of `C`.
fn resolvent(lambda: &[f64], mu: &[f64]) -> Vec<f64> {
    let largest = lambda.iter().chain(mu).copied().fold(f64::MIN_POSITIVE, f64::max);
    let parts = |value: f64| {
        let root = (value.max(0.0) / largest).sqrt();
        [root / (1.0 + root * root), 1.0 / (1.0 + root * root)]
    };
    let entry = |&column: &f64, &row: &f64| {
        let ([a, b], [c, d]) = (parts(column), parts(row));
        (a - c).powi(2) + (b - d).powi(2)
    };
    lambda.iter().flat_map(|column| mu.iter().map(move |row| entry(column, row))).collect()
}

/// Adds the matrix of `w Σ ‖C X − Y C‖²`, divided by what the sum is on the average over all entries of `C`.
pub(super) fn commuting(
    system: &mut DenseMatrix,
    xs: &[DenseMatrix],
    ys: &[DenseMatrix],
    weight: f64,
) -> Result<(), AnalysisError> {
    let Some(k) = xs.first().map(DenseMatrix::rows) else { return Ok(()) };
    let (mut left, mut right) = (DenseMatrix::zeros(k, k), DenseMatrix::zeros(k, k));
    let trace = |matrix: &DenseMatrix| (0..k).map(|i| matrix.column(i)[i]).sum::<f64>();
    let mut crossed = 0.0;
    for (x, y) in xs.iter().zip(ys) {
        add(&mut left, &x.times(&transposed(x)));
        add(&mut right, &y.transposed_times(y));
        crossed += trace(x) * trace(y);
    }
    let size = k as f64 * (trace(&left) + trace(&right)) - 2.0 * crossed;
    if !(size > 0.0) {
        return Ok(());
    }
    let weight = weight * (k * k) as f64 / size;
    let turned: Vec<(DenseMatrix, DenseMatrix)> =
        xs.iter().zip(ys).map(|(x, y)| (transposed(x), transposed(y))).collect();
    for s in 0..k {
        for q in 0..k {
            let into = system.column_mut(s * k + q);
            // Where rows agree X Xᵀ, where columns agree Yᵀ Y.
            (0..k).for_each(|c| into[c * k + q] += weight * left.column(s)[c]);
            (0..k).for_each(|r| into[s * k + r] += weight * right.column(q)[r]);
            for ((x, y), (xt, yt)) in xs.iter().zip(ys).zip(&turned) {
                let (down, across) = (y.column(q), yt.column(q));
                for (c, slots) in into.chunks_exact_mut(k).enumerate() {
                    let (one, two) = (weight * x.column(s)[c], weight * xt.column(s)[c]);
                    let terms = slots.iter_mut().zip(down).zip(across);
                    terms.for_each(|((slot, a), b)| *slot -= one * a + two * b);
                }
            }
        }
    }
    Ok(())
}

fn add(sum: &mut DenseMatrix, part: &DenseMatrix) {
    sum.values_mut().iter_mut().zip(part.values()).for_each(|(sum, value)| *sum += value);
}
