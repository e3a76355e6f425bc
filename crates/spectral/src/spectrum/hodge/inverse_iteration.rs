//! Eigenfields on tiny triangles.
//!
//! A gradient on a needle is a difference of nearly equal numbers over a height of next to nothing: of functions in
//! double precision it keeps few digits there, which weigh nothing in the field and everything in its residual. As a
//! field it has all of them: one inverse iteration with the matrix of the fields, whose factor errs by rounding entry
//! by entry, finds them.

use chladni_algebra::{
    ColumnSums, FactorError, MassMatrix, Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, apply_mass,
    fill_reducing_order, residual_sums,
};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::DualGraph;

use super::{FieldPart, HodgeSpectrum};
use crate::operator::frames::FaceFrames;
use crate::operator::hodge::{FieldBoundary, hodge_problem};
use crate::spectrum::hsim::{HsimError, inverse};

/// The most faces of which the matrix of the fields is factored: a row has some 26 entries.
const MOST_FACES: usize = 100_000;

/// The matrix of the fields, as it is assembled and in the order of its factor, in bytes a face.
const BYTES_PER_FACE: u64 = 1_700;

/// The memory that the iteration takes on so many faces, in bytes, beside a factor: that is made where what the work
/// was promised has room for it.
pub fn inverse_iteration_bytes(faces: u64) -> u64 {
    if faces > MOST_FACES as u64 { 0 } else { BYTES_PER_FACE * faces }
}

/// Solves: one leaves of what is not in a field's eigenspace about what its shift is away, which on needles is nothing.
const SOLVES: usize = 2;

/// Where the surface is small enough, takes residuals of the fields as they are, and improves those that are above
/// `tolerance` and the harmonic fields. Fields that it does not improve stay as they are.
///
/// # Errors
/// [`HsimError`]: memory that was promised cannot be had; cancellation. A matrix that has no factor, or one that fills
/// in more than was promised, leaves everything as it is.
pub(super) fn inverse_iteration(
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
    let (stiffness, mass) = (&problem.stiffness, &problem.mass);
    let values: Vec<f64> = spectrum.values.iter().map(|value| value * problem.area).collect();
    let residual_of =
        |part: FieldPart, sums: &ColumnSums| if part == FieldPart::Harmonic { 0.0 } else { residual(sums, 1.0) };
    let sums = residual_sums(stiffness, mass, &spectrum.fields, &values, monitor)?;
    spectrum.residuals = sums.iter().zip(&spectrum.parts).map(|(sums, &part)| residual_of(part, sums)).collect();
    let is_open = |k: &usize| spectrum.parts[*k] == FieldPart::Harmonic || !(spectrum.residuals[*k] <= tolerance);
    let open: Vec<usize> = (0..count).filter(is_open).collect();
    if open.is_empty() {
        return Ok(());
    }
    let positive: Vec<f64> = values.iter().copied().filter(|&value| value > 0.0).collect();
    // Below all eigenvalues, by about as much as they are wide apart.
    let shift = -positive.get(positive.len() / 2).copied().unwrap_or(1.0);
    let given = spectrum.fields.select(&open);
    let Some(found) = solved((stiffness, mass), shift, &given, monitor)? else {
        return Ok(());
    };
    let values: Vec<f64> = open.iter().map(|&k| values[k]).collect();
    let after = residual_sums(stiffness, mass, &found, &values, monitor)?;
    let better = |&place: &usize| residual(&after[place], values[place]) < residual(&sums[open[place]], values[place]);
    let better: Vec<usize> = (0..open.len()).filter(better).collect();
    let masses = mass.lumped();
    let factor = |&place: &usize| {
        let (x, y) = (given.column(place), found.column(place));
        let product: f64 = x.iter().zip(&y).zip(&masses).map(|((x, y), m)| x * y * m).sum();
        (sums[open[place]].mass / after[place].mass).sqrt().copysign(product)
    };
    let factors: Vec<f64> = better.iter().map(factor).collect();
    let places: Vec<usize> = better.iter().map(|&place| open[place]).collect();
    let rows: Vec<u32> = (0..stiffness.rows() as u32).collect();
    // Of the lengths and the signs that they had.
    spectrum.fields.assign(&places, &found.select(&better).spread(rows.len(), &rows, &factors));
    for (place, k) in better.into_iter().zip(places) {
        spectrum.residuals[k] = residual_of(spectrum.parts[k], &after[place]);
    }
    Ok(())
}

/// Inverse iterations from some columns; nothing where no factor of the matrix exists or its factor takes more memory
/// than was promised.
///
/// # Errors
/// [`HsimError`]: memory that was promised cannot be had; cancellation.
fn solved(
    (stiffness, mass): (&SparseMatrix, &MassMatrix),
    shift: f64,
    columns: &PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<Option<PanelMatrix>, HsimError> {
    let n = stiffness.rows();
    let attempt = || -> Result<PanelMatrix, FactorError> {
        let order = fill_reducing_order(stiffness, Ordering::NestedDissection)?;
        let (stiffness, mass) = (stiffness.reordered(&order), mass.reordered(&order));
        let symbolic = SymbolicFactor::new(&stiffness, &mass)?.within(1, monitor)?;
        let factor = symbolic.factor(&stiffness, &mass, shift)?;
        let factors = vec![1.0; columns.columns()];
        let mut solved = columns.clone().spread(n, &inverse(&order), &factors);
        solved.panels_mut().par_iter_mut().try_for_each_init(Vec::new, |scratch, panel| {
            for _ in 0..SOLVES {
                monitor.checkpoint()?;
                apply_mass(&mass, panel, scratch);
                factor.solve_panel(panel);
            }
            Ok::<(), Cancelled>(())
        })?;
        Ok(solved.spread(n, &order, &factors))
    };
    let solved = match attempt() {
        Ok(solved) => Some(solved),
        // The fields are as they were found, and their residuals say so.
        Err(
            FactorError::Singular { .. }
            | FactorError::Promise { .. }
            | FactorError::Ordering { .. }
            | FactorError::TooLarge { .. },
        ) => None,
        Err(error @ (FactorError::Memory { .. } | FactorError::Shape { .. } | FactorError::Cancelled(_))) => {
            return Err(error.into());
        }
    };
    monitor.checkpoint()?;
    Ok(solved)
}

/// `‖S x − θ M x‖ / ‖S x‖`; for an eigenvalue 0, `‖S x‖` over that of a vector of length one.
fn residual(sums: &ColumnSums, value: f64) -> f64 {
    let (rest, whole) = if value > 0.0 { (sums.residual, sums.stiffness) } else { (sums.stiffness, sums.square) };
    if rest == 0.0 { 0.0 } else { (rest / whole).sqrt() }
}
