//! One part of the spectrum: gradients of hat functions, or co-gradients of Crouzeix–Raviart functions, and how well
//! they solve the problem of fields.

use chladni_algebra::MassMatrix;
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::DualGraph;

use super::FieldPart;
use crate::operator::frames::{Complex64, FaceFrames, parts};
use crate::operator::hodge::ScalarProblem;

/// The functions of one part on the faces of a surface.
pub(super) struct Part<'a> {
    pub kind: FieldPart,
    pub scalar: &'a ScalarProblem,
    pub surface: (&'a TriangleMesh, &'a DualGraph, &'a FaceFrames),
}

impl Part<'_> {
    /// The gradient of a function on a face, or that turned by 90°, times the area of the face, on unit area:
    /// `A ∇λ = J e / 2` and `A J ∇ψ = e`.
    pub fn gradient(&self, values: &[f64], face: usize) -> [f64; 2] {
        let (mesh, dual, frames) = self.surface;
        let functions = match self.kind {
            FieldPart::CoGradient => dual.edges(face),
            _ => mesh.faces[face],
        };
        let mut sum = Complex64::ZERO;
        for (e, function) in frames.edges(face).into_iter().zip(functions) {
            let Some(value) = values.get(self.scalar.rows[function as usize] as usize) else { continue };
            sum += *value
                * match self.kind {
                    FieldPart::CoGradient => e,
                    _ => Complex64::new(-0.5 * e.im, 0.5 * e.re),
                };
        }
        parts(sum)
    }

    /// `‖S x − θ M x‖ / ‖S x‖` of the field of a function: with `S = M_F G M⁻¹ Gᵀ M_F` on gradients both are norms of
    /// `M_F G` times functions.
    pub fn residual(&self, u: &[f64], value: f64) -> f64 {
        let problem = &self.scalar.problem;
        let MassMatrix::Diagonal(masses) = &problem.mass else { return f64::INFINITY };
        let applied: Vec<f64> = problem.stiffness.multiply(u).iter().zip(masses).map(|(s, m)| s / m).collect();
        let rest: Vec<f64> = applied.iter().zip(u).map(|(a, u)| a - value * u).collect();
        let norm = |values: &[f64]| -> f64 {
            (0..self.surface.0.faces.len()).map(|f| self.gradient(values, f).map(|x| x * x).iter().sum::<f64>()).sum()
        };
        (norm(&rest) / norm(&applied).max(f64::MIN_POSITIVE)).sqrt()
    }
}
