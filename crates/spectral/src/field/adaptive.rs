//! Weights per face from example fields: columns are small where fields like the examples change fast, and large where
//! nothing happens (thesis, section 3.4, adaptive subspaces).
//!
//! A column of width `h` leaves an error of about `h² |Δu|`. For a given number of columns the error in the mean square
//! is least where `1/h`, the weight, is proportional to `|Δu|^{1/3}`.

use chladni_base::Monitor;
use chladni_mesh::dual::NO_FACE;

use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

use super::basis::FieldError;
use super::surface::FieldSurface;

/// The smallest weight as a share of the largest: columns grow by no more than the inverse.
const LEAST: f64 = 0.1;

/// How often what a face says is averaged with its neighbours: columns that overlap have to agree.
const AVERAGES: usize = 40;

/// Weights for [`super::FieldParameters::weights`], one per face, the largest 1, from one example field or more of
/// `block` numbers per face.
///
/// # Errors
/// [`FieldError::Example`]: no field, one of another length, or numbers that are not finite; [`FieldError::Operator`],
/// cancellation.
pub fn adaptive_weights(
    surface: &FieldSurface,
    kind: FieldKind,
    examples: &[Vec<f64>],
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, FieldError> {
    let wanted = kind.block() * surface.faces();
    for (example, field) in examples.iter().enumerate() {
        if field.len() != wanted || !field.iter().all(|v| v.is_finite()) {
            return Err(FieldError::Example { example, wanted });
        }
    }
    if examples.is_empty() {
        return Err(FieldError::Example { example: 0, wanted });
    }
    let squares = match kind.block() {
        2 => laplacians::<2>(surface, kind, examples, monitor)?,
        _ => laplacians::<3>(surface, kind, examples, monitor)?,
    };
    let squares = averaged(surface, squares);
    let largest = squares.iter().copied().fold(0.0, f64::max);
    if !(largest > 0.0) {
        return Ok(vec![1.0; surface.faces()]);
    }
    // The sixth root of the square is the third root.
    Ok(squares.into_iter().map(|square| (square / largest).powf(1.0 / 6.0).max(LEAST)).collect())
}

/// In each face the sum of `|Δu|²` over the examples, each of unit norm.
fn laplacians<const B: usize>(
    surface: &FieldSurface,
    kind: FieldKind,
    examples: &[Vec<f64>],
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, FieldError> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    let operator = FieldOperator::<B>::assemble(kind, mesh, dual, frames, FieldBoundary::default())?;
    let mut squares = vec![0.0; surface.faces()];
    for field in examples {
        monitor.checkpoint()?;
        let size = operator.norm_squared(field)?;
        let image = operator.stiffness.multiply(field);
        for ((square, own), mass) in squares.iter_mut().zip(image.chunks_exact(B)).zip(&operator.mass) {
            *square += own.iter().map(|v| (v / mass).powi(2)).sum::<f64>() / size.max(f64::MIN_POSITIVE);
        }
    }
    Ok(squares)
}

/// Means over growing neighbourhoods, weighted by area.
fn averaged(surface: &FieldSurface, mut values: Vec<f64>) -> Vec<f64> {
    let (dual, areas) = (surface.dual(), surface.frames().areas());
    for _ in 0..AVERAGES {
        let mean = |face: usize| {
            let around = dual.neighbours(face).into_iter().filter(|&g| g != NO_FACE).map(|g| g as usize);
            let (sum, area) =
                around.chain([face]).fold((0.0, 0.0), |(s, a), g| (s + areas[g] * values[g], a + areas[g]));
            sum / area
        };
        values = (0..values.len()).map(mean).collect();
    }
    values
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::field::{DesignModel, EnergyWeights, FieldParameters, field_basis};
    use crate::operator::frames::parts;
    use chladni_base::Unwatched;
    use chladni_base::Vector3;
    use chladni_mesh::shape::{Shape, generate};

    /// A field that whirls in a cap of the sphere and is still elsewhere.
    fn concentrated(surface: &FieldSurface, shift: f64) -> Vec<f64> {
        let field = (0..surface.faces()).flat_map(|f| {
            let c = surface.mesh().barycentre(&surface.mesh().faces[f]);
            let size = (-(c[0] * c[0] + c[1] * c[1]) / 0.03).exp() * if c[2] > 0.0 { 1.0 } else { 0.0 };
            let phase = 12.0 * (c[0] + 0.5 * c[1]) + shift;
            parts(surface.frames().from_world(f, Vector3::new(size * phase.cos(), size * phase.sin(), 0.0)))
        });
        field.collect()
    }

    #[test]
    fn on_a_concentrated_field_an_adaptive_space_has_a_third_of_the_error() {
        let surface = FieldSurface::new(generate(Shape::Sphere, 10_000).unwrap()).unwrap();
        let kind = FieldKind::NVector { n: 1 };
        // The field is like the examples, and none of them.
        let (examples, field) =
            (vec![concentrated(&surface, 0.0), concentrated(&surface, 1.5)], concentrated(&surface, 0.7));
        let error = |weights: Option<Vec<f64>>| {
            let basis =
                field_basis(&surface, &FieldParameters { weights, ..FieldParameters::new(kind, 300) }, &Unwatched)
                    .unwrap();
            let model = DesignModel::new(&basis, &Unwatched).unwrap();
            let target = model.alignment(&basis, surface.frames().areas(), &field, None).unwrap();
            let nothing = EnergyWeights { harmonic: 0.0, biharmonic: 0.0 };
            let design =
                model.weighted(nothing, Some((Arc::new(target.clone()), 1.0))).unwrap().solve(&basis, &[]).unwrap();
            (design.alignment_energy.unwrap() / target.constant).sqrt()
        };
        let weights = adaptive_weights(&surface, kind, &examples, &Unwatched).unwrap();
        let (uniform, adaptive) = (error(None), error(Some(weights)));
        println!("relative error: uniform {uniform:.4}, adaptive {adaptive:.4}");
        assert!(3.0 * adaptive < uniform, "{uniform} {adaptive}");
    }

    #[test]
    fn examples_that_do_not_fit_are_named() {
        let surface = FieldSurface::new(generate(Shape::Sphere, 42).unwrap()).unwrap();
        let wanted = 2 * surface.faces();
        let kind = FieldKind::Vector {};
        let with = |examples: &[Vec<f64>]| adaptive_weights(&surface, kind, examples, &Unwatched);
        assert_eq!(with(&[]), Err(FieldError::Example { example: 0, wanted }));
        assert_eq!(with(&[vec![1.0; wanted], vec![1.0]]), Err(FieldError::Example { example: 1, wanted }));
        assert_eq!(with(&[vec![f64::NAN; wanted]]), Err(FieldError::Example { example: 0, wanted }));
        assert_eq!(with(&[vec![0.0; wanted]]), Ok(vec![1.0; surface.faces()]));
    }
}
