//! Eigenfunctions in the finest space of a hierarchy: a fraction of the storage, at a measured price.

use chladni_algebra::{
    DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, galerkin, orthonormalise, solve_definite,
    space_times, space_transposed_mass_times,
};
use chladni_base::Monitor;
use chladni_base::parallel::*;
use chladni_spectral::basis::Compact;
use chladni_spectral::spectrum::hsim::HsimError;

use crate::JobError;

/// The largest mesh whose hat functions stand in for a space that a solver did without; the system in them is dense.
const LARGEST_IDENTITY: usize = 5000;

/// The space of all hat functions, which holds every function as it is: for meshes so small that a solver needs no
/// hierarchy.
pub(super) fn all_functions(vertices: usize) -> Option<SparseMatrix<f32>> {
    let (offsets, indices) = ((0..=vertices).collect(), (0..vertices as u32).collect());
    (vertices <= LARGEST_IDENTITY)
        .then(|| SparseMatrix::from_sorted_parts(vertices, vertices, offsets, indices, vec![1.0; vertices]))
}

/// Eigenfunctions in a space.
pub(super) struct Projected {
    pub compact: Compact,
    /// Per pair `‖x − U c‖_M / ‖x‖_M`.
    pub errors: Vec<f64>,
    /// The largest entry of `|cᵀM̄c − I|`.
    pub defect: f64,
}

/// The nearest functions `U c` to the columns `x`, `c = (UᵀMU)⁻¹UᵀMx`, made orthonormal again from the first on, and
/// how far they are.
pub(super) fn project(
    vectors: &PanelMatrix,
    space: SparseMatrix<f32>,
    mass: &MassMatrix,
    monitor: &dyn Monitor,
) -> Result<Projected, JobError> {
    let numerical = |reason: String| JobError::from(HsimError::Numerical(reason));
    let (n, d, m) = (space.rows(), space.columns(), vectors.columns());
    // Only the mass is wanted; a stiffness without entries costs nothing.
    let nothing = SparseMatrix::from_sorted_parts(n, n, vec![0; n + 1], Vec::new(), Vec::new());
    let (_, reduced) = galerkin(&space, &nothing, mass, monitor).map_err(HsimError::from)?;
    let panels = m.div_ceil(PANEL_WIDTH);
    let mut coefficients = DenseMatrix::zeros(d, m);
    for panel in 0..panels {
        monitor.checkpoint()?;
        let columns = panel * PANEL_WIDTH..m.min((panel + 1) * PANEL_WIDTH);
        let x = columns_of(vectors, columns.clone());
        let part = space_transposed_mass_times(&space, mass, &x);
        for (k, column) in columns.enumerate() {
            coefficients.column_mut(column).copy_from_slice(part.column(k));
        }
        monitor.progress(0.4 * (panel + 1) as f64 / panels as f64);
    }
    let mut matrix = reduced.to_dense();
    for k in 0..d {
        // A function that vanishes takes no part.
        let pivot = &mut matrix.column_mut(k)[k];
        *pivot = if *pivot == 0.0 { 1.0 } else { *pivot };
    }
    solve_definite(matrix, &mut coefficients).map_err(|error| numerical(error.to_string()))?;
    monitor.checkpoint()?;
    let gram = |c: &DenseMatrix| c.transposed_times(&reduced.multiply_dense(c));
    let products = gram(&coefficients);
    orthonormalise(&mut coefficients, products).map_err(|error| numerical(error.to_string()))?;
    let defect = defect_of(&gram(&coefficients));
    let mut errors = Vec::with_capacity(m);
    for panel in 0..panels {
        monitor.checkpoint()?;
        let columns = panel * PANEL_WIDTH..m.min((panel + 1) * PANEL_WIDTH);
        let x = columns_of(vectors, columns.clone());
        let y = space_times(&space, &coefficients.slice_columns(columns.clone()));
        errors.par_extend((0..columns.len()).into_par_iter().map(|k| {
            let lost: Vec<f64> = x.column(k).iter().zip(y.column(k)).map(|(x, y)| x - y).collect();
            norm(mass, &lost) / norm(mass, x.column(k)).max(f64::MIN_POSITIVE)
        }));
        monitor.progress(0.6 + 0.4 * (panel + 1) as f64 / panels as f64);
    }
    Ok(Projected { compact: Compact::new(space, coefficients), errors, defect })
}

fn columns_of(vectors: &PanelMatrix, range: std::ops::Range<usize>) -> DenseMatrix {
    let mut columns = DenseMatrix::zeros(vectors.rows(), range.len());
    for (k, column) in range.enumerate() {
        columns.column_mut(k).copy_from_slice(&vectors.column(column));
    }
    columns
}

pub(super) fn norm(mass: &MassMatrix, x: &[f64]) -> f64 {
    let mx = mass.multiply(x);
    x.iter().zip(&mx).map(|(x, mx)| x * mx).sum::<f64>().max(0.0).sqrt()
}

pub(super) fn defect_of(gram: &DenseMatrix) -> f64 {
    let entry = |j: usize, i: usize| (gram.column(j)[i] - if i == j { 1.0 } else { 0.0 }).abs();
    (0..gram.columns())
        .flat_map(|j| (0..gram.rows()).map(move |i| (j, i)))
        .map(|(j, i)| entry(j, i))
        .fold(0.0, f64::max)
}
