//! How a loss changes with the positions of vertices that depends on eigenvalues and eigenfunctions: the adjoint of the
//! eigenproblem.
//!
//! With `∂λ_k = x_kᵀ (∂S − λ_k ∂M) x_k`, what a simple eigenfunction changes by is
//! `∂x_k = −½ x_k (x_kᵀ∂M x_k) − (S − λ_k M)⁺ (∂S − λ_k ∂M) x_k`. Against the derivatives `g_k = ∂L/∂x_k` the
//! pseudo-inverse goes to the other side: within the functions that the basis has it is a sum over pairs of them, and
//! on what is orthogonal to all of them `S − λ_k M` is positive definite, so that conjugate gradients solve there,
//! preconditioned by one factor of `S + σM`. In the end there are two functions for each mode, with
//! `∂L = Σ_k y_kᵀ ∂S x_k − w_kᵀ ∂M x_k`.
//!
//! Of a pair of modes `j`, `k` with `c_jk = x_jᵀ g_k` only `(c_jk − c_kj) / (λ_k − λ_j)` counts and `c_jk + c_kj`. The
//! former has a limit where eigenvalues meet for every loss that does not depend on which functions of their common
//! space stand for them; it is zero where the loss counts their values alike, and elsewhere it can be told from the
//! derivatives until they meet.

use chladni_algebra::{
    DenseMatrix, MassMatrix, Ordering, PANEL_WIDTH, PanelMatrix, SymbolicFactor, Weight, fill_reducing_order,
    inner_products, subtract_combinations,
};
use chladni_base::Monitor;

use super::complement::Complement;
use super::error::{AnalysisError, lowest};
use super::spectrum::kernel_size;
use super::value_gradient::{add_values, check};
use crate::basis::{Basis, Functions};
use crate::operator::derivative::{Elements, FormSums};
use crate::operator::{EigenProblem, MassKind};

/// Eigenvalues that differ by less than this share of them are taken for one.
pub(super) const COINCIDE: f64 = 1e-6;

/// Eigenvalues that differ by less than this share of them do not tell by what a loss changes that mixes their
/// functions: what they differ by is rounding, and so is that of its derivatives.
const UNSURE: f64 = 1e-8;

/// By how much, as a share, weights differ that are not equal.
const UNEQUAL: f64 = 1e-6;

/// What a turn of two functions that share an eigenvalue may change a loss by, as a share of its derivatives.
const TURN: f64 = 1e-4;

/// Rounding of an inner product, as a share of its factors.
const ROUNDING: f64 = 1e-14;

/// The same where the derivatives were rounded to single precision before they came here, as `torch` does by default.
const SINGLE_ROUNDING: f64 = 1e-7;

/// The shift of the preconditioner, as a share of the largest eigenvalue.
const SHIFT: f64 = 1e-3;

/// Modes whose functions are held on all vertices at once.
const AT_ONCE: usize = 8;

/// The derivatives of a loss by what a basis holds.
#[derive(Debug, Clone, Copy)]
pub struct LossDerivatives<'a> {
    /// By eigenvalues, from the first on; those beyond the last do not count.
    pub values: &'a [f64],
    /// By the values of eigenfunctions at the vertices: `n × c`, a column for each of the first `c`.
    pub functions: &'a DenseMatrix,
}

/// The gradient of a loss by the positions of the vertices, three numbers for each, for a loss that depends on them
/// through eigenvalues and eigenfunctions of `problem`, which is assembled of `elements` with `mass`.
///
/// Eigenfunctions are orthonormal for the mass; a loss should depend on neither their signs nor, where eigenvalues
/// coincide, on which functions stand for them. The gradient is as right as the pairs are: an error of the functions
/// counts in proportion to itself over their distance to other eigenvalues.
///
/// # Errors
/// Those of [`value_gradient`](super::value_gradient::value_gradient), and [`AnalysisError::NoDerivative`] for
/// approximate bases, [`AnalysisError::Turned`] where a loss depends on which functions stand for an eigenvalue that is
/// several ones, as where it counts a part of them; [`AnalysisError::Mixed`] where it counts the values of such ones
/// differently; [`AnalysisError::Cut`] where the basis ends among them; [`AnalysisError::Unsolved`], and a
/// factorisation that fails; [`AnalysisError::NotLowest`] for the functions of an interval, and
/// [`AnalysisError::Rough`] where the pairs are too rough for derivatives of functions.
pub fn mode_gradient(
    basis: &Basis,
    problem: &EigenProblem,
    (elements, mass): (Elements<'_>, MassKind),
    loss: LossDerivatives<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<[f64; 3]>, AnalysisError> {
    check(basis, elements, mass)?;
    check_loss(basis, loss)?;
    if loss.functions.columns() > 0 {
        // Of a part of the spectrum, what lies below is no complement.
        lowest(basis)?;
    }
    if matches!(basis.functions, Functions::Compact(_)) {
        return Err(AnalysisError::NoDerivative { of: "the functions of an approximate basis".to_owned() });
    }
    let mut sums = FormSums::new(elements, mass);
    add_values(basis, loss.values, &mut sums, monitor)?;
    if loss.functions.values().iter().all(|value| *value == 0.0) {
        return Ok(sums.gradient(monitor)?);
    }

    monitor.stage("factor");
    let ordering = if problem.size() > 100_000 { Ordering::NestedDissection } else { Ordering::Amd };
    let order = fill_reducing_order(&problem.stiffness, ordering)?;
    monitor.checkpoint()?;
    let (stiffness, masses) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
    let symbolic = SymbolicFactor::new(&stiffness, &masses)?.within(1, monitor)?;
    let values: Vec<f64> = basis.eigenvalues.iter().map(|value| value * problem.area).collect();
    let most = values.iter().fold(0f64, |most, value| most.max(value.abs()));
    let factor = symbolic.factor(&stiffness, &masses, -SHIFT * most.max(1.0))?;

    monitor.stage("solve");
    let places: Vec<u32> = match &problem.unknowns {
        Some(unknowns) => order.iter().map(|&row| unknowns[row as usize]).collect(),
        None => order,
    };
    let functions = functions(basis, &places, problem.area.sqrt())?;
    let derivatives = rows(loss.functions, &places);
    let ones = MassMatrix::Diagonal(vec![1.0; places.len()]);
    let mut products = inner_products(&functions, Weight::Mass(&ones), &derivatives, monitor)?;
    let (stiffness, mass, factor) = (&stiffness, &masses, &factor);
    let complement = Complement { stiffness, mass, factor, functions: &functions, values: &values };
    // −(g − M X Xᵀ g), and then what solves for it.
    let mut beside = derivatives.clone();
    complement.project_dual(&mut beside, &products, monitor)?;
    beside.panels_mut().iter_mut().flatten().for_each(|value| *value = -*value);
    let beside = complement.solve(&beside, monitor)?;

    // From here on in the units of the input.
    let scale = problem.area.sqrt().recip();
    products.values_mut().iter_mut().for_each(|product| *product *= scale);
    let norms = dual_norms(&derivatives, &masses, problem.area);
    let single = loss.functions.values().iter().all(|&value| f64::from(value as f32) == value);
    let rounding = if single { SINGLE_ROUNDING } else { ROUNDING };
    // Where the spectrum has no kernel that can be told, no eigenvalue counts as one that stays zero.
    let kernel = kernel_size(&basis.eigenvalues).unwrap_or(0);
    let (stiff, massive) = combinations((&basis.eigenvalues, loss.values, kernel), &products, (&norms, rounding))?;
    let combined =
        |coefficients: DenseMatrix, of_beside: &dyn Fn(usize) -> f64| -> Result<PanelMatrix, AnalysisError> {
            let mut sum = beside.clone();
            scale_columns(&mut sum, of_beside);
            let mut coefficients = coefficients;
            coefficients.values_mut().iter_mut().for_each(|value| *value *= -scale);
            subtract_combinations(&mut sum, &functions, &coefficients, monitor)?;
            Ok(sum)
        };
    let stiff = combined(stiff, &|_| 1.0)?;
    let massive = combined(massive, &|k| basis.eigenvalues[k])?;

    monitor.stage("gradient");
    let columns = loss.functions.columns();
    for from in (0..columns).step_by(AT_ONCE) {
        let range = from..columns.min(from + AT_ONCE);
        for (others, of_mass) in [(&stiff, false), (&massive, true)] {
            let (columns, weights) = halves((&functions, scale), others, range.clone(), &places, basis.vertices());
            let zeros = vec![0.0; weights.len()];
            match of_mass {
                false => sums.add(&columns, &weights, &zeros, monitor)?,
                true => {
                    let weights: Vec<f64> = weights.iter().map(|weight| -weight).collect();
                    sums.add(&columns, &zeros, &weights, monitor)?;
                }
            }
        }
    }
    Ok(sums.gradient(monitor)?)
}

fn check_loss(basis: &Basis, loss: LossDerivatives<'_>) -> Result<(), AnalysisError> {
    let count = basis.count();
    for (what, found) in [("weights", loss.values.len()), ("derivatives by functions", loss.functions.columns())] {
        if found > count {
            return Err(AnalysisError::Count { what, found, least: 0, most: count });
        }
    }
    let (found, n) = (loss.functions.rows(), basis.vertices());
    if found != n {
        return Err(AnalysisError::Count { what: "values of a derivative", found, least: n, most: n });
    }
    match loss.functions.values().iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(&value) => Err(AnalysisError::Parameter { parameter: "a derivative", value, expected: "a finite number" }),
    }
}

/// The eigenfunctions times `scale` at some vertices, in this order.
fn functions(basis: &Basis, places: &[u32], scale: f64) -> Result<PanelMatrix, AnalysisError> {
    let (n, count) = (basis.vertices(), basis.count());
    let mut panels = PanelMatrix::zeros(places.len(), count);
    for (index, panel) in panels.panels_mut().iter_mut().enumerate() {
        let from = index * PANEL_WIDTH;
        let columns = basis.lift::<f64>(from..count.min(from + PANEL_WIDTH))?;
        fill(panel, &columns, n, places, scale);
    }
    Ok(panels)
}

fn rows(matrix: &DenseMatrix, places: &[u32]) -> PanelMatrix {
    let n = matrix.rows();
    let mut panels = PanelMatrix::zeros(places.len(), matrix.columns());
    for (panel, columns) in panels.panels_mut().iter_mut().zip(matrix.values().chunks((n * PANEL_WIDTH).max(1))) {
        fill(panel, columns, n, places, 1.0);
    }
    panels
}

fn fill(panel: &mut [f64], columns: &[f64], n: usize, places: &[u32], scale: f64) {
    for (row, &place) in panel.chunks_exact_mut(PANEL_WIDTH).zip(places) {
        for (value, column) in row.iter_mut().zip(columns.chunks_exact(n)) {
            *value = scale * column[place as usize];
        }
    }
}

fn scale_columns(matrix: &mut PanelMatrix, scale: &dyn Fn(usize) -> f64) {
    let columns = matrix.columns();
    for (index, panel) in matrix.panels_mut().iter_mut().enumerate() {
        let from = index * PANEL_WIDTH;
        let scales: Vec<f64> = (from..columns.min(from + PANEL_WIDTH)).map(scale).collect();
        for row in panel.chunks_exact_mut(PANEL_WIDTH) {
            row.iter_mut().zip(&scales).for_each(|(value, scale)| *value *= scale);
        }
    }
}

/// `√(gᵀ M⁻¹ g)` of each column, with the lumped mass in the units of the input: by how much a function of unit norm
/// can change the loss.
fn dual_norms(derivatives: &PanelMatrix, mass: &MassMatrix, area: f64) -> Vec<f64> {
    let mut squares = vec![0.0; derivatives.columns()];
    let lumped = mass.lumped();
    for (index, panel) in derivatives.panels().iter().enumerate() {
        for (row, mass) in panel.chunks_exact(PANEL_WIDTH).zip(&lumped).filter(|(_, mass)| **mass > 0.0) {
            let squares = squares.iter_mut().skip(index * PANEL_WIDTH);
            squares.zip(row).for_each(|(square, g)| *square += g * g / (mass * area));
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}

/// What the other functions of the basis have in `y_k` and `w_k`: coefficients for each of them, `m × c`, from `c_jk`
/// of the first `c`.
///
/// Zeros stay zeros whatever moves, and the functions of the kernel constants on their components: what a loss counts
/// their values as does not matter.
fn combinations(
    (values, weights, kernel): (&[f64], &[f64], usize),
    products: &DenseMatrix,
    (norms, rounding): (&[f64], f64),
) -> Result<(DenseMatrix, DenseMatrix), AnalysisError> {
    let (m, c) = (products.rows(), products.columns());
    let (mut stiff, mut massive) = (DenseMatrix::zeros(m, c), DenseMatrix::zeros(m, c));
    let most = values.iter().fold(0f64, |most, value| most.max(value.abs()));
    for k in 0..c {
        massive.column_mut(k)[k] += 0.5 * products.column(k)[k];
        for j in (0..m).filter(|&j| j != k) {
            let other = if j < c { products.column(j)[k] } else { 0.0 };
            let (odd, even) = (products.column(k)[j] - other, products.column(k)[j] + other);
            let size = norms[k] + norms.get(j).copied().unwrap_or(0.0);
            let gap = values[k] - values[j];
            let near = COINCIDE * values[k].abs().max(values[j].abs()).max(1e-6 * most);
            let zeros = j.max(k) < kernel;
            if (zeros || gap.abs() <= near) && odd.abs() > TURN * size {
                return Err(AnalysisError::Turned { first: j.min(k), second: j.max(k) });
            }
            let one = zeros || gap.abs() <= near * (UNSURE / COINCIDE);
            let [own, others] = [k, j].map(|k| weights.get(k).copied().unwrap_or(0.0));
            if one && !zeros && (own - others).abs() > UNEQUAL * (own.abs() + others.abs()) {
                return Err(AnalysisError::Mixed { first: j.min(k), second: j.max(k) });
            }
            // The limit is zero where eigenvalues are one: what is left of the difference there is rounding.
            let quotient = if one || odd.abs() <= rounding * size { 0.0 } else { odd / gap };
            // A pair of the first ones is met twice.
            let share = if j < c { 0.5 } else { 1.0 };
            stiff.column_mut(k)[j] += share * quotient;
            massive.column_mut(k)[j] += share * 0.5 * (quotient * (values[k] + values[j]) + even);
        }
    }
    Ok((stiff, massive))
}

/// `x + ty` and `x − ty` on all `n` vertices for some modes, `x` times `scale`, with the weights in which they are
/// `yᵀAx` for every symmetric `A`.
fn halves(
    (functions, scale): (&PanelMatrix, f64),
    others: &PanelMatrix,
    range: std::ops::Range<usize>,
    places: &[u32],
    n: usize,
) -> (Vec<f64>, Vec<f64>) {
    let mut columns = vec![0.0; 2 * n * range.len()];
    let mut weights = Vec::with_capacity(2 * range.len());
    for (k, both) in range.zip(columns.chunks_exact_mut((2 * n).max(1))) {
        let (x, y) = (functions.column(k), others.column(k));
        let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        let (own, other) = (scale * scale * square(&x), square(&y));
        if own == 0.0 || other == 0.0 {
            weights.extend([0.0; 2]);
            continue;
        }
        let t = (own / other).sqrt();
        let (sum, difference) = both.split_at_mut(n);
        for ((&place, x), y) in places.iter().zip(x).zip(y) {
            sum[place as usize] = scale * x + t * y;
            difference[place as usize] = scale * x - t * y;
        }
        weights.extend([0.25 / t, -0.25 / t]);
    }
    (columns, weights)
}

#[cfg(test)]
#[path = "mode_gradient_tests.rs"]
mod tests;
