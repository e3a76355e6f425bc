//! How eigenvalues change when vertices move.
//!
//! For a simple eigenvalue with `xᵀMx = 1`, `∂λ = xᵀ (∂S − λ ∂M) x` (Hellmann and Feynman; Hadamard). Where eigenvalues coincide, each of them has a derivative only along motions that keep them
//! together, while the sum of all of them has one in every direction, and so has every function in which they count alike.

use chladni_base::Monitor;

use super::error::AnalysisError;
use crate::basis::Basis;
use crate::operator::MassKind;
use crate::operator::derivative::{Elements, Forms, add_gradient};

/// Functions that are held, vertex after vertex, at once.
const AT_ONCE: usize = 32;

/// The gradient of `Σ_k weights_k λ_k` by the positions of the vertices: three numbers for each, in 1/length³ of the input. With `weights_k = ∂L/∂λ_k` it is
/// `∂L/∂p`.
///
/// It is exact for the eigenvalues of the discrete problem, up to their residuals; for Ritz values of a compact basis it is that of the values in a space that stays as it is. The Laplacian is that of the
/// elements as they are, with a consistent mass or equal shares of each element: not that of another triangulation, and without potential. Vertices of a boundary that is held count as all others.
///
/// # Errors
/// [`AnalysisError::Count`] where there are not as many weights as values; [`AnalysisError::Mesh`] where the elements have other vertices; [`AnalysisError::Parameter`] for a
/// weight that is not finite; [`AnalysisError::NoDerivative`] for Voronoi areas and operators that are made of something else; functions that cannot be read, cancellation.
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
    if let Some(&value) = weights.iter().find(|weight| !weight.is_finite()) {
        return Err(AnalysisError::Parameter { parameter: "a weight", value, expected: "a finite number" });
    }
    let mut gradient = vec![[0.0; 3]; basis.vertices()];
    // Values that do not count need not be read.
    let counted = weights.iter().rposition(|weight| *weight != 0.0).map_or(0, |last| last + 1);
    for from in (0..counted).step_by(AT_ONCE) {
        monitor.progress(from as f64 / counted as f64);
        let range = from..counted.min(from + AT_ONCE);
        let rows = basis.lift_rows::<f64>(range.clone())?;
        let stiffness = &weights[range.clone()];
        let mass_weights: Vec<f64> = range.map(|k| -weights[k] * basis.eigenvalues[k]).collect();
        add_gradient(elements, mass, &Forms { rows: &rows, stiffness, mass: &mass_weights }, &mut gradient, monitor)?;
    }
    Ok(gradient)
}

fn check(basis: &Basis, elements: Elements<'_>, mass: MassKind) -> Result<(), AnalysisError> {
    if basis.vertices() != elements.vertices() {
        return Err(AnalysisError::Mesh { basis: basis.vertices(), mesh: elements.vertices() });
    }
    let none = |of: &str| Err(AnalysisError::NoDerivative { of: of.to_owned() });
    if mass == MassKind::Voronoi {
        return none("Voronoi areas");
    }
    // Operators that are more than a Laplacian are objects.
    if let Some(kind) = basis.metadata["parameters"]["operator"].as_object().and_then(|operator| operator.keys().next())
    {
        return none(&format!("the operator \"{kind}\""));
    }
    match (basis.metadata["operator"]["laplacian"].as_str(), elements) {
        (Some("cotangent"), Elements::Triangles(mesh)) if mesh.faces.is_empty() => none("the Laplacian of points"),
        (Some("cotangent"), Elements::Triangles(_)) | (Some("volume"), Elements::Tetrahedra(_)) => Ok(()),
        (Some("robust"), _) => none("the robust Laplacian"),
        (Some("graph"), _) => none("the Laplacian of a graph"),
        _ => none("this operator"),
    }
}

#[cfg(test)]
#[path = "value_gradient_tests.rs"]
mod tests;
