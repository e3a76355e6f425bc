//! What a design says of itself: its coefficients, energies, and how far it is from what it is to stay close to.

use chladni_algebra::SparseMatrix;

use super::super::alignment::Alignment;
use super::super::design::{Design, DesignError};
use super::{Inverse, Pull, WeightedModel, times};
use crate::operator::frames::Complex64;

impl WeightedModel {
    /// The design of a field in the coordinates of the inverse; `coefficients` where they are known.
    pub(super) fn finish(
        &self,
        found: Pull,
        turn: Option<Complex64>,
        residuals: Vec<f64>,
        coefficients: Option<Vec<f32>>,
    ) -> Result<Design, DesignError> {
        let (model, own) = (&self.model, &found.field);
        let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let deviation = self.deviation(own, turn);
        let (coefficients, ritz, harmonic_energy, biharmonic_energy) = match &self.inverse {
            Inverse::Ritz(_) => {
                let sum = |power: i32| own.iter().zip(model.values()).map(|(z, v)| v.powi(power) * z * z).sum::<f64>();
                (coefficients.unwrap_or_else(|| model.expand(own)), own.clone(), sum(1), sum(2))
            }
            Inverse::Sparse(inverse) => {
                let misfit = || DesignError::Length { what: "a field", got: own.len(), wanted: model.dimension() };
                let pencil = self.pencil.as_ref().ok_or_else(misfit)?;
                let image = times(&pencil.stiffness, own);
                let ritz = if model.has_ritz() { model.project(&pencil.mass.multiply(own)) } else { Vec::new() };
                let biharmonic = match &pencil.full_biharmonic {
                    Some(full) => product(&full.multiply(own), own),
                    None => match found.laplacian {
                        Some(laplacian) => product(&laplacian, &image),
                        None => inverse.laplacian(&found.force, own, &image).map_or(0.0, |y| product(&y, &image)),
                    },
                };
                (own.iter().map(|&v| v as f32).collect(), ritz, product(&image, own), biharmonic)
            }
        };
        Ok(Design {
            coefficients,
            ritz,
            harmonic_energy,
            biharmonic_energy,
            alignment_energy: deviation,
            residuals,
            turn,
        })
    }

    /// How far a field is from those that it is to stay close to.
    fn deviation(&self, own: &[f64], turn: Option<Complex64>) -> Option<f64> {
        let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let ritz = matches!(self.inverse, Inverse::Ritz(_));
        let target = |field: &Alignment| product(own, if ritz { &field.projected } else { &field.reduced });
        let square = |gram: Option<&SparseMatrix>| match gram {
            None if ritz => product(own, own),
            gram => {
                let mass = gram.or(self.pencil.as_ref().map(|pencil| &pencil.mass));
                mass.map_or(0.0, |mass| product(&mass.multiply(own), own))
            }
        };
        let mut sum = None;
        for (field, _) in &self.alignments {
            let one = square(field.gram.as_deref()) - 2.0 * target(field) + field.constant;
            sum = Some(sum.unwrap_or(0.0) + one.max(0.0));
        }
        if let (Some((p, _)), Some(turn)) = (&self.prescription, turn) {
            let mixed = turn.re * target(&p.along) + turn.im * target(&p.across);
            let one = square(None) - 2.0 * mixed + p.along.constant;
            sum = Some(sum.unwrap_or(0.0) + one.max(0.0));
        }
        sum
    }
}
