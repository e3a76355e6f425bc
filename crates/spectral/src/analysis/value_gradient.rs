//! How eigenvalues change when vertices move.
//!
//! For a simple eigenvalue with `xᵀMx = 1`, `∂λ = xᵀ (∂S − λ ∂M) x` (Hellmann and Feynman; Hadamard). Where eigenvalues
//! coincide, each of them has a derivative only along motions that keep them together, while the sum of all of them has
//! one in every direction, and so has every function in which they count alike.

use chladni_base::{Cancelled, Monitor};

use super::error::AnalysisError;
use crate::basis::{Basis, CHUNK_COLUMNS, Functions, Real, Visit};
use crate::operator::derivative::{Elements, FormSums};
use crate::operator::{Laplacian, MassKind};

/// The gradient of `Σ_k weights_k λ_k` by the positions of the vertices: three numbers for each, in 1/length³ of the
/// input. With `weights_k = ∂L/∂λ_k` it is `∂L/∂p`.
///
/// It is exact for the eigenvalues of the discrete problem, up to their residuals; for Ritz values of a compact basis
/// it is that of the values in a space that stays as it is. The Laplacian is that of the elements as they are, with a
/// consistent mass or equal shares of each element: not that of another triangulation, and without potential. Vertices
/// of a boundary that is held count as all others.
///
/// # Errors
/// [`AnalysisError::Count`] where there are not as many weights as values; [`AnalysisError::Mesh`] where the elements
/// have other vertices; [`AnalysisError::Parameter`] for a weight that is not finite; [`AnalysisError::NoDerivative`]
/// for Voronoi areas and operators that are made of something else; [`AnalysisError::Provenance`] where the basis does
/// not say which operator it is of; functions that cannot be read, cancellation.
pub fn value_gradient(
    basis: &Basis,
    elements: Elements<'_>,
    mass: MassKind,
    weights: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<[f64; 3]>, AnalysisError> {
    check(basis, elements, mass)?;
    if weights.len() != basis.count() {
        let count = basis.count();
        return Err(AnalysisError::Count { what: "weights", found: weights.len(), least: count, most: count });
    }
    let mut sums = FormSums::new(elements, mass);
    add_values(basis, weights, &mut sums, monitor)?;
    Ok(sums.gradient(monitor)?)
}

/// Adds the eigenfunctions with what their eigenvalues count; there may be fewer weights than values.
pub(super) fn add_values(
    basis: &Basis,
    weights: &[f64],
    sums: &mut FormSums<'_>,
    monitor: &dyn Monitor,
) -> Result<(), AnalysisError> {
    if let Some(&value) = weights.iter().find(|weight| !weight.is_finite()) {
        return Err(AnalysisError::Parameter { parameter: "a weight", value, expected: "a finite number" });
    }
    for (index, weights) in weights.chunks(CHUNK_COLUMNS).enumerate() {
        let from = index * CHUNK_COLUMNS;
        monitor.progress(from as f64 / basis.count() as f64);
        // What does not count need not be read.
        let Some(last) = weights.iter().rposition(|weight| *weight != 0.0) else { continue };
        let range = from..from + last + 1;
        let stiffness = &weights[..=last];
        let masses: Vec<f64> = stiffness.iter().zip(&basis.eigenvalues[from..]).map(|(w, value)| -w * value).collect();
        let act = Add { sums: &mut *sums, stiffness, masses: &masses, monitor };
        match &basis.functions {
            Functions::Dense(dense) => dense.chunk(index)?.visit(act)?,
            Functions::Compact(_) => act.visit(&basis.lift::<f64>(range)?, basis.vertices())?,
        }
    }
    Ok(())
}

/// Adds as many columns as there are weights.
struct Add<'a, 'e> {
    sums: &'a mut FormSums<'e>,
    stiffness: &'a [f64],
    masses: &'a [f64],
    monitor: &'a dyn Monitor,
}

impl Visit for Add<'_, '_> {
    type Answer = Result<(), Cancelled>;
    fn visit<T: Real>(self, values: &[T], rows: usize) -> Self::Answer {
        self.sums.add(&values[..rows * self.stiffness.len()], self.stiffness, self.masses, self.monitor)
    }
}

pub(super) fn check(basis: &Basis, elements: Elements<'_>, mass: MassKind) -> Result<(), AnalysisError> {
    if basis.vertices() != elements.vertices() {
        return Err(AnalysisError::Mesh { basis: basis.vertices(), mesh: elements.vertices() });
    }
    let none = |of: &str| Err(AnalysisError::NoDerivative { of: of.to_owned() });
    if mass == MassKind::Voronoi {
        return none("Voronoi areas");
    }
    match (basis.metadata.laplacian()?, elements) {
        (Laplacian::Cotangent, Elements::Triangles(mesh)) if mesh.faces.is_empty() => {
            return none("the Laplacian of points");
        }
        (Laplacian::Cotangent, Elements::Triangles(_)) | (Laplacian::Volume, Elements::Tetrahedra(_)) => {}
        (Laplacian::Robust, _) => return none("the robust Laplacian"),
        (Laplacian::Graph, _) => return none("the Laplacian of a graph"),
        _ => return none("this operator"),
    }
    match basis.metadata.operator()?.beyond_laplacian() {
        Some(kind) => none(&format!("the operator \"{kind}\"")),
        None => Ok(()),
    }
}

#[cfg(test)]
#[path = "value_gradient_tests.rs"]
mod tests;
