//! Eigenfields on tiny triangles.
//!
//! A gradient on a needle is a difference of nearly equal numbers over a height of next to nothing: of functions in double precision it keeps few digits
//! there, which weigh nothing in the field and everything in its residual. As a field it has all of them: one inverse iteration with the matrix of the
//! fields, whose factor errs by rounding entry by entry, finds them.

use chladni_algebra::{
    DenseMatrix, FactorError, MassMatrix, Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, apply_mass,
    fill_reducing_order,
};
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::DualGraph;
use rayon::prelude::*;

use super::{FieldPart, HodgeSpectrum};
use crate::operator::frames::FaceFrames;
use crate::operator::hodge::{FieldBoundary, hodge_problem};
use crate::spectrum::hsim::HsimError;

/// The most faces of which the matrix of the fields is factored: a row has some 26 entries.
const MOST_FACES: usize = 100_000;

/// Solves: one leaves of what is not in a field's eigenspace about what its shift is away, which on needles is nothing.
const SOLVES: usize = 2;

/// Where the surface is small enough, takes residuals of the fields as they are, and improves those that are above `tolerance` and the harmonic fields.
/// Fields that it does not improve stay as they are.
///
/// # Errors
/// [`HsimError::Cancelled`]. A matrix that cannot be factored leaves everything as it is.
pub(super) fn settle(
    spectrum: &mut HodgeSpectrum,
    (mesh, dual, frames): (&TriangleMesh, &DualGraph, &FaceFrames),
    boundary: FieldBoundary,
    tolerance: f64,
    monitor: &dyn Monitor,
) -> Result<(), HsimError> {
    let count = spectrum.values.len();
    if mesh.faces.len() > MOST_FACES || count == 0 {
        return Ok(());
    }
    monitor.stage("fields");
    let problem = hodge_problem(mesh, dual, frames, boundary);
    let masses = problem.mass.lumped();
    let values: Vec<f64> = spectrum.values.iter().map(|value| value * problem.area).collect();
    let residual = |x: &[f64], k: usize| residual(&problem.stiffness, &masses, x, values[k]);
    let measured = |k: usize| {
        monitor.checkpoint()?;
        Ok(if spectrum.parts[k] == FieldPart::Harmonic { 0.0 } else { residual(&spectrum.fields.column(k), k) })
    };
    spectrum.residuals = (0..count).into_par_iter().map(measured).collect::<Result<_, Cancelled>>()?;
    let is_open = |k: &usize| spectrum.parts[*k] == FieldPart::Harmonic || !(spectrum.residuals[*k] <= tolerance);
    let open: Vec<usize> = (0..count).filter(is_open).collect();
    let positive: Vec<f64> = values.iter().copied().filter(|&value| value > 0.0).collect();
    // Below all eigenvalues, by about as much as they are wide apart.
    let shift = -positive.get(positive.len() / 2).copied().unwrap_or(1.0);
    if open.is_empty() {
        return Ok(());
    }
    let given = spectrum.fields.select(&open);
    let Some(found) = solved((&problem.stiffness, &problem.mass), shift, &given, monitor)? else {
        return Ok(());
    };
    for (place, &k) in open.iter().enumerate() {
        monitor.checkpoint()?;
        let (before, mut after) = (given.column(place), found.column(place));
        let product = |x: &[f64], y: &[f64]| x.iter().zip(y).zip(&masses).map(|((x, y), m)| x * y * m).sum::<f64>();
        let length = (product(&before, &before) / product(&after, &after)).sqrt();
        let factor = length.copysign(product(&before, &after));
        after.iter_mut().for_each(|x| *x *= factor);
        let left = residual(&after, k);
        if left < residual(&before, k) {
            let column = PanelMatrix::from_dense(&DenseMatrix::from_columns(after.len(), 1, after));
            spectrum.fields.assign(&[k], &column);
            if spectrum.parts[k] != FieldPart::Harmonic {
                spectrum.residuals[k] = left;
            }
        }
    }
    Ok(())
}

/// Inverse iterations from some columns; nothing where the matrix cannot be factored, or takes more memory than was promised.
fn solved(
    (stiffness, mass): (&SparseMatrix, &MassMatrix),
    shift: f64,
    columns: &PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<Option<PanelMatrix>, Cancelled> {
    let n = stiffness.rows();
    let attempt = || -> Result<Option<PanelMatrix>, FactorError> {
        let order = fill_reducing_order(stiffness, Ordering::NestedDissection)?;
        let mut places = vec![0; n];
        order.iter().enumerate().for_each(|(row, &unknown)| places[unknown as usize] = row as u32);
        let (stiffness, mass) = (stiffness.reordered(&order), mass.reordered(&order));
        let symbolic = SymbolicFactor::new(&stiffness, &mass)?.within(1, monitor)?;
        let factor = symbolic.factor(&stiffness, &mass, shift)?;
        let factors = vec![1.0; columns.columns()];
        let mut solved = columns.clone().spread(n, &places, &factors);
        let done = solved.panels_mut().par_iter_mut().try_for_each_init(Vec::new, |scratch, panel| {
            for _ in 0..SOLVES {
                monitor.checkpoint()?;
                apply_mass(&mass, panel, scratch);
                factor.solve_panel(panel);
            }
            Ok::<(), Cancelled>(())
        });
        Ok(done.is_ok().then(|| solved.spread(n, &order, &factors)))
    };
    let solved = attempt().unwrap_or_default();
    monitor.checkpoint()?;
    Ok(solved)
}

/// `‖S x − θ M x‖ / ‖S x‖`; for an eigenvalue 0, `‖S x‖` over that of a vector of length one.
fn residual(stiffness: &SparseMatrix, mass: &[f64], x: &[f64], value: f64) -> f64 {
    let image = stiffness.multiply(x);
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let rest = norm(&mut image.iter().zip(x).zip(mass).map(|((s, x), m)| s - value * m * x));
    let whole = if value > 0.0 { norm(&mut image.iter().copied()) } else { norm(&mut x.iter().copied()) };
    rest / whole.max(f64::MIN_POSITIVE)
}
