//! Fields that a design is to stay close to, and fields with prescribed singularities, projected to a space once.

use std::sync::Arc;

use chladni_algebra::{FactorError, SparseMatrix};
use chladni_base::Unwatched;

use crate::basis::FieldBasis;
use crate::operator::frames::{Complex64, ONE, complex, inner, normalise, outer};
use crate::operator::transport::FieldKind;

use super::basis::restricted;
use super::design::{Constraint, DesignError, DesignModel, EnergyWeights, FIRM, Hold, length};
use super::nearby::{LastFactor, Nearby};
use super::pencil::Pencil;
use super::prescribed::PrescribedField;
use super::reading::tensor_deviator;
use super::singularity::Matching;
use super::surface::FieldSurface;

/// A field to stay close to, projected once: `Σ_f a_f w_f |u_f − target_f|²` with areas `a` and weights `w` per face.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// `Uᵀ M W target`.
    pub(super) reduced: Vec<f64>,
    /// `Xᵀ Uᵀ M W target`; empty in spaces without Ritz coordinates.
    pub(super) projected: Vec<f64>,
    /// `Uᵀ M W U` where there are weights per face, `M̄` where there are none.
    pub(super) gram: Option<Arc<SparseMatrix>>,
    /// The restricted matrices, which go with it in the sum.
    pub(super) pencil: Option<Arc<Pencil>>,
    /// What was factored last of the sums that it is part of.
    last: LastFactor,
    /// `targetᵀ M W target`.
    pub(super) constant: f64,
    /// `M W target` on the faces.
    pub(super) force: Arc<Vec<f64>>,
    /// The diagonal of `M W`, where there are weights per face.
    pub(super) masses: Option<Arc<Vec<f64>>>,
}

impl Alignment {
    /// The inverse of both energies with so much of it, on the factor of a sum nearby where there is one; `None`
    /// without weights per face.
    ///
    /// # Errors
    /// [`FactorError`].
    pub(super) fn inverse(&self, weights: EnergyWeights, weight: f64) -> Result<Option<Nearby>, FactorError> {
        let (Some(pencil), Some(gram)) = (&self.pencil, &self.gram) else { return Ok(None) };
        self.last.inverse(pencil, gram, [weights.harmonic, weights.biharmonic, weight]).map(Some)
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let matrices = |m: &SparseMatrix| 12 * m.entries() as u64;
        let pencil = self.pencil.as_ref().map_or(0, |p| matrices(&p.stiffness) + matrices(&p.mass));
        let faces = self.force.len() + self.masses.as_ref().map_or(0, |m| m.len());
        8 * (self.reduced.len() + self.projected.len() + faces) as u64
            + self.gram.as_deref().map_or(0, matrices)
            + pencil
    }
}

impl DesignModel {
    /// A field to stay close to: `block` numbers per face in the frames, and optionally a weight per face.
    ///
    /// `areas` are those of the faces, on unit area, as [`crate::operator::frames::FaceFrames::areas`] gives them.
    /// Without weights this is one pass over the space; with weights per face it forms `UᵀMWU`, sparse like `M̄`, once,
    /// and every choice of weights after it takes a sparse factorisation, since the sum is not diagonal in Ritz
    /// coordinates.
    ///
    /// # Errors
    /// [`DesignError`]: lengths that do not fit, numbers that are not finite, negative weights.
    pub fn alignment(
        &self,
        basis: &FieldBasis,
        areas: &[f64],
        target: &[f64],
        weights: Option<&[f64]>,
    ) -> Result<Alignment, DesignError> {
        let (b, faces) = (basis.space.block(), basis.space.faces());
        length("the space", basis.space.dimension(), self.dimension())?;
        length("areas", areas.len(), faces)?;
        length("the field to align to", target.len(), b * faces)?;
        length("weights per face", weights.map_or(faces, <[f64]>::len), faces)?;
        if let Some(&value) = target.iter().find(|v| !v.is_finite()) {
            return Err(DesignError::Weight { name: "alignment field", value });
        }
        if let Some(&value) = weights.and_then(|w| w.iter().find(|w| !(**w >= 0.0 && w.is_finite()))) {
            return Err(DesignError::Weight { name: "alignment per face", value });
        }
        let weight = |face: usize| areas[face] * weights.map_or(1.0, |w| w[face]);
        let weighted: Vec<f64> = target.iter().enumerate().map(|(i, v)| weight(i / b) * v).collect();
        let constant = weighted.iter().zip(target).map(|(a, b)| a * b).sum();
        let reduced = basis.space.transposed_times(&weighted);
        let masses = weights.map(|_| Arc::new((0..faces).map(weight).collect::<Vec<f64>>()));
        let gram = match &masses {
            Some(masses) => Some(Arc::new(restricted(&basis.space, masses, &Unwatched)?)),
            None => None,
        };
        let new = || Arc::new(Pencil::new(basis));
        let pencil = gram.is_some().then(|| self.pencil.clone().unwrap_or_else(new));
        let projected = if self.has_ritz() { self.project(&reduced) } else { Vec::new() };
        let last = LastFactor::default();
        Ok(Alignment { reduced, projected, gram, pencil, last, constant, force: Arc::new(weighted), masses })
    }

    /// A field with prescribed singularities, to be designed with.
    ///
    /// # Errors
    /// [`DesignError`]: the field is of another kind or on other faces than the space.
    pub fn prescription(
        &self,
        basis: &FieldBasis,
        surface: &FieldSurface,
        field: PrescribedField,
    ) -> Result<Prescription, DesignError> {
        if field.kind().block() != basis.space.block() || field.kind().order() != basis.kind.order() {
            return Err(DesignError::Kind);
        }
        length("the prescribed field", field.faces(), basis.space.faces())?;
        let areas = surface.frames().areas();
        let along = self.alignment(basis, areas, &field.target(ONE), None)?;
        let across = self.alignment(basis, areas, &field.target(Complex64::I), None)?;
        Ok(Prescription { field, along, across })
    }
}

/// A [`PrescribedField`] projected to a space: the part of a design that gives it its singularities. Turned as a whole
/// to fit the constraints.
#[derive(Debug, Clone, PartialEq)]
pub struct Prescription {
    pub(super) field: PrescribedField,
    /// The field, and the field turned by 90° as stored numbers turn.
    pub(super) along: Alignment,
    pub(super) across: Alignment,
}

impl Prescription {
    /// The field.
    pub fn field(&self) -> &PrescribedField {
        &self.field
    }

    /// The field itself, of unit length with the prescribed singularities and no others, on each component turned to
    /// fit the constraints there; as it is stored, with the matching that goes with it.
    pub fn exact(&self, surface: &FieldSurface, constraints: &[Constraint]) -> (Vec<f32>, Vec<Matching>) {
        let (components, count) = surface.dual().components();
        let turns: Vec<Complex64> = (0..count as u32)
            .map(|component| self.turn_of(constraints.iter().filter(|c| components[c.face as usize] == component)))
            .collect();
        let b = self.field.kind().block();
        let values = (0..self.field.faces()).flat_map(|face| {
            let value = self.field.value(face, turns[components[face] as usize]);
            value.into_iter().take(b).map(|x| x as f32).collect::<Vec<f32>>()
        });
        let field: Vec<f32> = values.collect();
        let matching = self.field.matching(surface, &field);
        (field, matching)
    }

    /// The turn that brings the field closest to constraints.
    pub(super) fn turn(&self, constraints: &[Constraint]) -> Complex64 {
        self.turn_of(constraints.iter())
    }

    fn turn_of<'a>(&self, constraints: impl Iterator<Item = &'a Constraint>) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for c in constraints {
            let planar = |value: [f64; 3]| match self.field.kind() {
                FieldKind::Tensor {} => tensor_deviator(value),
                _ => complex([value[0], value[1]]),
            };
            let (wanted, own) = (planar(c.value), planar(self.field.value(c.face as usize, ONE)));
            let weight = match c.hold {
                Hold::Strength(strength) => FIRM * strength,
                Hold::Weight(weight) => weight,
                Hold::Exact => 1e6,
            };
            sum += weight * Complex64::new(inner(wanted, own), outer(own, wanted));
        }
        normalise(sum)
    }
}
