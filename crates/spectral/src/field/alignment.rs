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
        let resistance = self.resistance(basis, &along)?;
        Ok(Prescription { field, along, across, resistance })
    }

    /// The harmonic and the biharmonic energy of the field of the space that is closest to another one, for each square
    /// of its length.
    fn resistance(&self, basis: &FieldBasis, field: &Alignment) -> Result<[f64; 2], DesignError> {
        let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let full = self.pencil.as_ref().and_then(|pencil| pencil.full_biharmonic.as_ref());
        if let (true, None) = (self.has_ritz(), full) {
            let of = |power: i32| {
                let squares = field.projected.iter().zip(self.values()).map(|(z, v)| v.powi(power) * z * z);
                squares.sum::<f64>()
            };
            let size = of(0).max(f64::MIN_POSITIVE);
            return Ok([of(1) / size, of(2) / size]);
        }
        let own = by_mass(&basis.mass, &field.reduced);
        let image = basis.stiffness.multiply(&own);
        let size = product(&field.reduced, &own).max(f64::MIN_POSITIVE);
        let bending = match full {
            Some(full) => product(&full.multiply(&own), &own),
            None => product(&by_mass(&basis.mass, &image), &image),
        };
        Ok([product(&image, &own) / size, bending / size])
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
    /// The energies of what the space has of it, for each square of its length.
    resistance: [f64; 2],
}

/// What a field resists with at least, where no energy has a weight.
const LEAST_RESISTANCE: f64 = 1e-6;

/// Steps and goal of the solves by which energies are measured: to a percent they would do.
const STEPS: usize = 300;
const CLOSE: f64 = 1e-6;

/// `M̄⁻¹ f`, by conjugate gradients.
fn by_mass(mass: &SparseMatrix, force: &[f64]) -> Vec<f64> {
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let diagonal: Vec<f64> = (0..mass.rows())
        .map(|row| {
            let (columns, values) = mass.row(row);
            let own = columns.iter().zip(values).find(|(column, _)| **column as usize == row);
            own.map_or(1.0, |own| own.1.max(f64::MIN_POSITIVE))
        })
        .collect();
    let scaled = |rest: &[f64]| -> Vec<f64> { rest.iter().zip(&diagonal).map(|(r, d)| r / d).collect() };
    let (mut own, mut rest) = (vec![0.0; force.len()], force.to_vec());
    let mut direction = scaled(&rest);
    let mut size = product(&rest, &direction);
    let goal = CLOSE * CLOSE * size;
    for _ in 0..STEPS {
        if !(size > goal) {
            break;
        }
        let image = mass.multiply(&direction);
        let step = size / product(&direction, &image);
        own.iter_mut().zip(&direction).for_each(|(x, d)| *x += step * d);
        rest.iter_mut().zip(&image).for_each(|(r, q)| *r -= step * q);
        let better = scaled(&rest);
        let next = product(&rest, &better);
        direction.iter_mut().zip(&better).for_each(|(d, b)| *d = b + next / size * *d);
        size = next;
    }
    own
}

impl Prescription {
    /// The weight by which designs miss it by about a percent: a hundred times what it resists with, its energy for
    /// each square of its length in the space. As the energies of a field of length 1 grow with what a space resolves
    /// around its singularities, no number would do for all spaces.
    pub fn one_percent_weight(&self, weights: EnergyWeights) -> f64 {
        let resistance = weights.harmonic * self.resistance[0] + weights.biharmonic * self.resistance[1];
        // A field without energy gives way to nothing.
        FIRM * resistance.max(weights.harmonic.max(weights.biharmonic)).max(LEAST_RESISTANCE)
    }

    /// The field.
    pub fn field(&self) -> &PrescribedField {
        &self.field
    }

    /// The field itself, of unit length with the prescribed singularities and no others, on each component turned to
    /// fit the constraints there, and where there are none what it is aligned to, each by its weight; as it is stored,
    /// with the matching that goes with it.
    pub fn exact(
        &self,
        surface: &FieldSurface,
        constraints: &[Constraint],
        alignments: &[(Arc<Alignment>, f64)],
    ) -> (Vec<f32>, Vec<Matching>) {
        let (components, count) = surface.dual().components();
        let mut along = vec![Complex64::ZERO; count];
        for face in 0..self.field.faces() {
            self.pull_along(alignments, face, &mut along[components[face] as usize]);
        }
        let turn = |(component, along): (usize, Complex64)| {
            let own = || constraints.iter().filter(|c| components[c.face as usize] as usize == component);
            normalise(if own().next().is_some() { self.pull_of(own()) } else { along })
        };
        let turns: Vec<Complex64> = along.into_iter().enumerate().map(turn).collect();
        let b = self.field.kind().block();
        let values = (0..self.field.faces()).flat_map(|face| {
            let value = self.field.value(face, turns[components[face] as usize]);
            value.into_iter().take(b).map(|x| x as f32).collect::<Vec<f32>>()
        });
        let field: Vec<f32> = values.collect();
        let matching = self.field.matching(surface, &field);
        (field, matching)
    }

    /// The turn that brings the field closest to constraints, and where there are none to what it is aligned to.
    pub(super) fn turn(&self, constraints: &[Constraint], alignments: &[(Arc<Alignment>, f64)]) -> Complex64 {
        if !constraints.is_empty() {
            return normalise(self.pull_of(constraints.iter()));
        }
        let mut sum = Complex64::ZERO;
        (0..self.field.faces()).for_each(|face| self.pull_along(alignments, face, &mut sum));
        normalise(sum)
    }

    fn pull_of<'a>(&self, constraints: impl Iterator<Item = &'a Constraint>) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for c in constraints {
            let weight = match c.hold {
                Hold::Strength(strength) => FIRM * strength,
                Hold::Weight(weight) => weight,
                Hold::Exact => 1e6,
            };
            self.add(&mut sum, c.face as usize, c.value, weight);
        }
        sum
    }

    /// Adds what fields to stay close to pull with on a face.
    fn pull_along(&self, alignments: &[(Arc<Alignment>, f64)], face: usize, sum: &mut Complex64) {
        let b = self.field.kind().block();
        for (alignment, weight) in alignments {
            let mut force = [0.0; 3];
            force.iter_mut().zip(&alignment.force[b * face..b * (face + 1)]).for_each(|(to, f)| *to = *f);
            self.add(sum, face, force, *weight);
        }
    }

    /// Adds how a value on a face is turned against the field there, with a weight.
    fn add(&self, sum: &mut Complex64, face: usize, value: [f64; 3], weight: f64) {
        let planar = |value: [f64; 3]| match self.field.kind() {
            FieldKind::Tensor {} => tensor_deviator(value),
            _ => complex([value[0], value[1]]),
        };
        let (wanted, own) = (planar(value), planar(self.field.value(face, ONE)));
        *sum += weight * Complex64::new(inner(wanted, own), outer(own, wanted));
    }
}
