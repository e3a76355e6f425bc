//! One part of the spectrum: gradients of hat functions, or co-gradients of Crouzeix–Raviart functions, and how well they solve the problem of fields.

use chladni_algebra::{
    MassMatrix, Ordering, PanelMatrix, SymbolicFactor, apply_mass, fill_reducing_order, restrict, rotate,
};
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::DualGraph;
use rayon::prelude::*;

use super::FieldPart;
use crate::operator::frames::FaceFrames;
use crate::operator::hodge::ScalarProblem;
use crate::spectrum::hsim::{Eigenpairs, HsimError, ritz};

/// From so many unknowns on, an order by nested dissection saves more than it costs.
const LARGE: usize = 60_000;

/// The functions of one part on the faces of a surface.
pub(super) struct Part<'a> {
    pub kind: FieldPart,
    pub scalar: &'a ScalarProblem,
    pub surface: (&'a TriangleMesh, &'a DualGraph, &'a FaceFrames),
}

impl Part<'_> {
    /// The gradient of a function on a face, or that turned by 90°, times the area of the face, on unit area: `A ∇λ = J e / 2` and `A J ∇ψ = e`.
    pub fn gradient(&self, values: &[f64], face: usize) -> [f64; 2] {
        let (mesh, dual, frames) = self.surface;
        let functions = match self.kind {
            FieldPart::CoGradient => dual.edges(face),
            _ => mesh.faces[face],
        };
        let mut sum = [0.0; 2];
        for (e, function) in frames.edges(face).into_iter().zip(functions) {
            let Some(value) = values.get(self.scalar.rows[function as usize] as usize) else { continue };
            let [x, y] = match self.kind {
                FieldPart::CoGradient => e,
                _ => [-0.5 * e[1], 0.5 * e[0]],
            };
            sum = [sum[0] + x * value, sum[1] + y * value];
        }
        sum
    }

    /// `‖S x − θ M x‖ / ‖S x‖` of the field of a function: with `S = M_F G M⁻¹ Gᵀ M_F` on gradients both are norms of `M_F G` times functions.
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

    /// The functions beyond the kernel whose fields meet a tolerance, or come nearer to it; `area` is that of the surface.
    ///
    /// A field weighs what is left of its function by frequency, on the tiny triangles of a graded mesh by 10^10 and more. Where that shows, one inverse
    /// iteration at a shift below all eigenvalues takes it off, and a Rayleigh–Ritz over all columns gives back what the shift mixes.
    ///
    /// # Errors
    /// [`HsimError`]: a matrix that cannot be factored, cancellation.
    pub fn functions(
        &self,
        pairs: &Eigenpairs,
        (area, tolerance): (f64, f64),
        monitor: &dyn Monitor,
    ) -> Result<PanelMatrix, HsimError> {
        let kernel = self.scalar.kernel.min(pairs.values.len());
        let values: Vec<f64> = pairs.values[kernel..].iter().map(|value| value * area).collect();
        let given = pairs.vectors.select(&(kernel..pairs.values.len()).collect::<Vec<_>>());
        let worst = |functions: &PanelMatrix| -> Result<f64, HsimError> {
            let residual = |(k, &value): (usize, &f64)| {
                monitor.checkpoint()?;
                Ok(self.residual(&functions.column(k), value))
            };
            let residuals: Vec<f64> = values.par_iter().enumerate().map(residual).collect::<Result<_, Cancelled>>()?;
            Ok(residuals.into_iter().fold(0.0, f64::max))
        };
        let before = worst(&given)?;
        if before <= tolerance {
            return Ok(given);
        }
        Ok(match self.smoothed(&given, &values, monitor)? {
            Some(smooth) if worst(&smooth)? < before => smooth,
            _ => given,
        })
    }

    /// Functions after an inverse iteration and a Rayleigh–Ritz, of the same lengths and signs; nothing where they have become dependent.
    fn smoothed(
        &self,
        given: &PanelMatrix,
        values: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<Option<PanelMatrix>, HsimError> {
        let problem = &self.scalar.problem;
        let (n, count) = (problem.size(), values.len());
        let shift = -values[count / 2].abs().max(f64::MIN_POSITIVE);
        let order = fill_reducing_order(
            &problem.stiffness,
            if n > LARGE { Ordering::NestedDissection } else { Ordering::Amd },
        )?;
        let mut places = vec![0; n];
        order.iter().enumerate().for_each(|(row, &unknown)| places[unknown as usize] = row as u32);
        let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
        let symbolic = SymbolicFactor::new(&stiffness, &mass)?.within(1, monitor)?;
        let factor = symbolic.factor(&stiffness, &mass, shift)?;
        let start = given.clone().spread(n, &places, &vec![1.0; count]);
        let mut inertia = start.clone();
        inertia.panels_mut().par_iter_mut().for_each(|panel| apply_mass(&mass, panel, &mut Vec::new()));
        let mut smooth = inertia.clone();
        smooth.panels_mut().par_iter_mut().try_for_each(|panel| {
            monitor.checkpoint()?;
            factor.solve_panel(panel);
            Ok::<(), Cancelled>(())
        })?;
        // Columns of about unit length.
        let lengths: Vec<f64> = values.iter().map(|value| value - shift).collect();
        smooth = smooth.spread(n, &(0..n as u32).collect::<Vec<_>>(), &lengths);
        let (small, gram) = restrict(&stiffness, &mass, &smooth, monitor)?;
        let (found, rotation) = ritz(small, gram, count, monitor)?;
        if found.len() < count {
            return Ok(None);
        }
        rotate(&mut smooth, &rotation, monitor)?;
        // Of the length and the sign that it had.
        let factor = |k: usize| {
            let inertia = inertia.column(k);
            let times = |x: Vec<f64>| x.iter().zip(&inertia).map(|(x, y)| x * y).sum::<f64>();
            times(start.column(k)).sqrt().copysign(times(smooth.column(k)))
        };
        let factors: Vec<f64> = (0..count).map(factor).collect();
        Ok(Some(smooth.spread(n, &order, &factors)))
    }
}
