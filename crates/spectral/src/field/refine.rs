//! Designs in the space of all fields: how far a reduced design is from the field that it stands for, and that field
//! itself.
//!
//! With the numbers `C u` of the constrained faces and what holds them, `W`, the field of least energy is
//! `u = K⁻¹(f + Cᵀ y) + Z c` with `(W⁻¹ + C K⁻¹ Cᵀ) y + C Z c = v − C K⁻¹ f` and `ZᵀCᵀ y = 0`, where `Z` has no energy.
//! The pulls `y` are found by [`super::refine_pulls`]; `K⁻¹` is applied by [`super::refine_response`].

use std::sync::OnceLock;

use chladni_algebra::BlockMatrix;
use chladni_base::{Cancelled, Monitor, stopped};

use super::cycle::Cycles;
use super::design::{Constraint, Design, DesignError, length};
use super::direct::{Direct, USUAL_ROOM};
use super::hierarchy::hierarchy;
use super::kernel::Kernel;
use super::refine_pulls::Pulls;
use super::refine_response::{FullOperator, Response, add, dot};
use super::surface::FieldSurface;
use super::weighted::WeightedModel;
use crate::basis::FieldBasis;
use crate::operator::OperatorError;
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

/// Nodes of the coarsest level.
const COARSEST: usize = 60;

/// Tolerances of [`FullSpace::refine`]: those below are lost to rounding.
const LEAST_TOLERANCE: f64 = 1e-10;

/// As many fields without energy as most surfaces have at most: room is counted for them before they are known.
const EXPECTED_IDLE: usize = 8;

/// The tolerance with which [`FullSpace::distance`] judges: a share of the distances that small spaces have.
const JUDGE: f64 = 2e-3;

/// Why a design was not refined.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// The surface has no such operator.
    #[error(transparent)]
    Operator(OperatorError),
    /// The design itself does not fit.
    #[error(transparent)]
    Design(DesignError),
    /// The tolerance is out of range.
    #[error("the tolerance is {tolerance}; it must be from {LEAST_TOLERANCE:e} to below 1")]
    Tolerance {
        /// What was given.
        tolerance: f64,
    },
    /// Designs that stay close to prescribed singularities are not the minimisers of one energy.
    #[error("a design with prescribed singularities does not approximate a field of the whole surface")]
    Prescribed,
    /// The iteration ended before its goal.
    #[error("the field of the whole surface was not found to a tolerance of {tolerance:e}")]
    NotConverged {
        /// The goal.
        tolerance: f64,
    },
    /// One energy outweighs another by more than single precision has room for.
    #[error(
        "the weights of the energies and of the alignment are too far apart to refine a design: their ratio is beyond {most:e}"
    )]
    Weights {
        /// The largest ratio.
        most: f64,
    },
    /// The reduced space does not have all fields without energy.
    #[error(
        "the space of this basis lacks fields without energy that the surface has: designs in it cannot be compared with the whole surface"
    )]
    Incomplete,
    /// Fields without energy, small where constraints are, would have to be so long.
    #[error(
        "harmonic fields meet these constraints at no cost only where they are {times:.0} times as long elsewhere; designs in the space of the basis bound that length, those on the whole surface only without alignment and where its factors fit into memory"
    )]
    Unbounded {
        /// Their mean length in units of the longest constraint.
        times: f64,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(RefineError: OperatorError => Self::Operator, DesignError => Self::Design);

/// All fields of a surface, with what solves for designs among them. Independent of the weights.
pub struct FullSpace {
    kind: FieldKind,
    pub(super) inner: Inner,
}

pub(super) enum Inner {
    Two(FullOperator<2>),
    Three(FullOperator<3>),
}

/// The field of the whole surface that a design stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// `block` numbers for each face.
    pub field: Vec<f64>,
    /// `uᵀ S u`, on the surface of unit area.
    pub harmonic_energy: f64,
    /// `uᵀ S M⁻¹ S u`, on the surface of unit area.
    pub biharmonic_energy: f64,
    /// The deviation from the fields to stay close to, where there are any.
    pub alignment_energy: Option<f64>,
    /// For each constraint the length of `u − value`.
    pub residuals: Vec<f64>,
    /// How far the reduced design is from it: `‖U x − u‖ / ‖u‖`, norms by area.
    pub distance: f64,
    /// Responses of the whole surface that were computed.
    pub responses: usize,
    /// What that distance is of: coefficients of the reduced space.
    pub coefficients: Vec<f32>,
}

impl FullSpace {
    /// Assembles the operator, and analyses it for factors or makes levels of it.
    ///
    /// # Errors
    /// [`RefineError::Operator`]: the kind is out of range; cancellation.
    pub fn new(
        surface: &FieldSurface,
        kind: FieldKind,
        boundary: FieldBoundary,
        monitor: &dyn Monitor,
    ) -> Result<Self, RefineError> {
        Self::within(surface, kind, boundary, USUAL_ROOM, monitor)
    }

    /// The same with so many bytes of room for factors, instead of [`USUAL_ROOM`]; where they do not fit there are
    /// levels.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn within(
        surface: &FieldSurface,
        kind: FieldKind,
        boundary: FieldBoundary,
        room: u64,
        monitor: &dyn Monitor,
    ) -> Result<Self, RefineError> {
        monitor.stage("levels");
        let inner = match kind.block() {
            2 => Inner::Two(FullOperator::new(surface, kind, boundary, room, monitor)?),
            _ => Inner::Three(FullOperator::new(surface, kind, boundary, room, monitor)?),
        };
        Ok(Self { kind, inner })
    }

    /// The same by cycles, as on surfaces that are too large for factors.
    #[cfg(test)]
    pub(super) fn by_cycles(
        surface: &FieldSurface,
        kind: FieldKind,
        boundary: FieldBoundary,
    ) -> Result<Self, RefineError> {
        Self::within(surface, kind, boundary, 0, &chladni_base::Unwatched)
    }

    /// Whether there is room for sparse factors, by which a design takes two substitutions.
    pub fn is_factored(&self) -> bool {
        match &self.inner {
            Inner::Two(whole) => whole.direct.is_some(),
            Inner::Three(whole) => whole.direct.is_some(),
        }
    }

    /// How many fields without energy are known.
    #[cfg(test)]
    pub(super) fn idle(&self) -> usize {
        match &self.inner {
            Inner::Two(whole) => whole.kernel.get().map_or(0, Kernel::len),
            Inner::Three(whole) => whole.kernel.get().map_or(0, Kernel::len),
        }
    }

    /// That a design is one of this surface.
    pub(super) fn check(&self, weighted: &WeightedModel, basis: &FieldBasis) -> Result<(), RefineError> {
        length("the space", basis.space.faces(), self.faces())?;
        if basis.kind != self.kind {
            return Err(DesignError::Kind.into());
        }
        match weighted.is_prescribed() {
            true => Err(RefineError::Prescribed),
            false => Ok(()),
        }
    }

    /// Checks a tolerance of [`refine`](Self::refine).
    ///
    /// # Errors
    /// [`RefineError::Tolerance`] where it is out of range.
    pub fn check_tolerance(tolerance: f64) -> Result<(), RefineError> {
        match (LEAST_TOLERANCE..1.0).contains(&tolerance) {
            true => Ok(()),
            false => Err(RefineError::Tolerance { tolerance }),
        }
    }

    /// About the bytes that it takes, with the fields without energy that are found later.
    pub fn bytes(&self) -> u64 {
        match &self.inner {
            Inner::Two(whole) => whole.bytes(),
            Inner::Three(whole) => whole.bytes(),
        }
    }

    /// The field of least energy among all fields under the constraints of a design of the same model: constraints and
    /// alignments have the weights that the design has given them, but for strengths: where there are factors, these
    /// are measured by what all fields resist with, and both biharmonic energies are `uᵀ S M⁻¹ S u`.
    ///
    /// `tolerance` is relative: 1e-8 leaves about that share of the field.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn refine(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: &Design,
        tolerance: f64,
        monitor: &dyn Monitor,
    ) -> Result<Refined, RefineError> {
        Self::check_tolerance(tolerance)?;
        self.check(weighted, basis)?;
        Self::check_bound(weighted, basis, constraints, design)?;
        match &self.inner {
            Inner::Two(whole) => whole.refine(weighted, basis, constraints, design, tolerance, monitor),
            Inner::Three(whole) => whole.refine(weighted, basis, constraints, design, tolerance, monitor),
        }
    }

    /// Beside alignments the whole surface does not know what has no energy of its own.
    pub(super) fn check_bound(
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: &Design,
    ) -> Result<(), RefineError> {
        match weighted.is_bounded(basis, &weighted.conditions(basis, constraints)?, design) {
            Some(times) => Err(RefineError::Unbounded { times }),
            None => Ok(()),
        }
    }

    /// About the bytes of the two factors that designs with one choice of weights take, with what is kept beside them;
    /// 0 where there are none.
    pub fn bytes_of_factors(&self) -> u64 {
        match &self.inner {
            Inner::Two(whole) => whole.direct.as_ref().map_or(0, Direct::bytes_of_two),
            Inner::Three(whole) => whole.direct.as_ref().map_or(0, Direct::bytes_of_two),
        }
    }

    /// About the bytes that are taken beside factors and levels.
    #[cfg(test)]
    pub(super) fn bytes_beside_factors(&self) -> u64 {
        match &self.inner {
            Inner::Two(whole) => bytes_beside(&whole.stiffness, EXPECTED_IDLE),
            Inner::Three(whole) => bytes_beside(&whole.stiffness, EXPECTED_IDLE),
        }
    }

    /// About the bytes that are held only while the first factors are made; 0 where there are none to make.
    pub fn bytes_of_making(&self) -> u64 {
        match &self.inner {
            Inner::Two(whole) => whole.direct.as_ref().map_or(0, Direct::bytes_of_making),
            Inner::Three(whole) => whole.direct.as_ref().map_or(0, Direct::bytes_of_making),
        }
    }

    /// An estimate of [`Refined::distance`], at a fraction of the cost.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn distance(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: &Design,
        monitor: &dyn Monitor,
    ) -> Result<f64, RefineError> {
        Ok(self.refine(weighted, basis, constraints, design, JUDGE, monitor)?.distance)
    }

    pub(super) fn faces(&self) -> usize {
        match &self.inner {
            Inner::Two(whole) => whole.mass.len(),
            Inner::Three(whole) => whole.mass.len(),
        }
    }
}

/// The bytes of an operator with its masses, and of some fields without energy.
fn bytes_beside<const B: usize>(stiffness: &BlockMatrix<B>, idle: usize) -> u64 {
    let entry = size_of::<[[f64; B]; B]>() + 4;
    (entry * stiffness.entries() + (16 + 8 * B * idle) * stiffness.rows()) as u64
}

impl<const B: usize> FullOperator<B> {
    fn new(
        surface: &FieldSurface,
        kind: FieldKind,
        boundary: FieldBoundary,
        room: u64,
        monitor: &dyn Monitor,
    ) -> Result<Self, RefineError> {
        let operator = FieldOperator::<B>::assemble(kind, surface.mesh(), surface.dual(), surface.frames(), boundary)?;
        let direct = Direct::new(kind, &operator.stiffness, bytes_beside(&operator.stiffness, EXPECTED_IDLE), room);
        let cycles = match direct {
            Some(_) => None,
            None => {
                let levels = hierarchy(&operator, surface.dual(), surface.frames(), COARSEST, monitor)?;
                Some(Cycles::new(&levels, monitor)?)
            }
        };
        Ok(Self { stiffness: operator.stiffness, mass: operator.mass, cycles, direct, kernel: OnceLock::new() })
    }

    fn bytes(&self) -> u64 {
        let known = self.kernel.get().map_or(EXPECTED_IDLE, Kernel::slots).max(EXPECTED_IDLE);
        bytes_beside(&self.stiffness, known)
            + self.cycles.as_ref().map_or(0, Cycles::bytes)
            + self.direct.as_ref().map_or(0, Direct::bytes)
    }

    fn refine(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        design: &Design,
        tolerance: f64,
        monitor: &dyn Monitor,
    ) -> Result<Refined, RefineError> {
        let mut compliance = weighted.compliance(basis, constraints)?;
        let (sum, force) = weighted.whole_sum(B * self.mass.len());
        let kernel = self.kernel(&sum, weighted, basis, monitor)?;
        let response = Response::new(self, sum, kernel)?;
        compliance.measure(B, |faces| self.yields(&response, faces, monitor))?;
        let mut solve = Pulls::new(self, &response, compliance, force, tolerance, monitor)?;
        match solve.run() {
            // Whichever solve it was, what was asked for was not reached.
            Err(RefineError::NotConverged { .. }) if response.lacks_idle_fields(monitor)? => {
                return Err(RefineError::Incomplete);
            }
            Err(RefineError::NotConverged { .. }) => return Err(RefineError::NotConverged { tolerance }),
            other => other?,
        }
        let coefficients = Some(design.coefficients.clone());
        self.measured(weighted, basis, constraints, coefficients, solve.field, solve.responses)
    }

    /// What there is to say of a field beside coefficients of the reduced space.
    pub(super) fn measured(
        &self,
        weighted: &WeightedModel,
        basis: &FieldBasis,
        constraints: &[Constraint],
        coefficients: Option<Vec<f32>>,
        field: Vec<f64>,
        responses: usize,
    ) -> Result<Refined, RefineError> {
        let distance = coefficients.as_ref().map_or(Ok(f64::NAN), |own| self.apart(basis, own, &field))?;
        let image = self.stiff(&field);
        let harmonic_energy = dot(&image, &field);
        let mut curved = image.clone();
        self.unweigh(&mut curved);
        let biharmonic_energy = dot(&image, &curved);
        let missing = |c: &Constraint| {
            let own = &field[B * c.face as usize..B * (c.face as usize + 1)];
            own.iter().zip(c.value).map(|(u, v)| (u - v).powi(2)).sum::<f64>().sqrt()
        };
        Ok(Refined {
            residuals: constraints.iter().map(missing).collect(),
            alignment_energy: weighted.whole_deviation(&field, &self.mass),
            field,
            harmonic_energy,
            biharmonic_energy,
            distance,
            responses,
            coefficients: coefficients.unwrap_or_default(),
        })
    }

    /// How far the field of coefficients is from another one, as a share of the length of that.
    pub(super) fn apart(&self, basis: &FieldBasis, coefficients: &[f32], field: &[f64]) -> Result<f64, DesignError> {
        let reduced = basis.space.lift(coefficients)?;
        let mut off: Vec<f64> = reduced.iter().map(|&x| f64::from(x)).collect();
        add(&mut off, field, -1.0);
        let norm = |x: &[f64]| self.product(x, x).sqrt();
        Ok(norm(&off) / norm(field).max(f64::MIN_POSITIVE))
    }
}
