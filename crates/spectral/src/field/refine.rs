//! Designs in the space of all fields: how far a reduced design is from the field that it stands for, and that field itself.
//!
//! With the numbers `C u` of the constrained faces and what holds them, `W`, the field of least energy is `u = K⁻¹(f + Cᵀ y) + Z c` with
//! `(W⁻¹ + C K⁻¹ Cᵀ) y + C Z c = v − C K⁻¹ f` and `ZᵀCᵀ y = 0`, where `Z` has no energy. Conjugate gradients on the pulls `y` are preconditioned by
//! the compliance that the reduced space has at those faces, as it misses only what is finer than its columns; `K⁻¹` is applied by
//! [`super::refine_response`].

use std::sync::OnceLock;

use chladni_algebra::{BlockMatrix, DefiniteError, DefiniteFactor, DenseMatrix, lowest_symmetric};
use chladni_base::{Cancelled, Monitor, Unwatched};

use super::basis::FieldSurface;
use super::compliance::Compliance;
use super::cycle::Cycles;
use super::design::{Constraint, Design, DesignError, length};
use super::direct::{Direct, USUAL_ROOM};
use super::hierarchy::hierarchy;
use super::idle::dot as small_dot;
use super::kernel::{Kernel, Own};
use super::refine_response::{Response, Whole, add, dot};
use super::weighted::WeightedModel;
use crate::basis::FieldBasis;
use crate::operator::OperatorError;
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::FieldKind;

/// Nodes of the coarsest level.
const COARSEST: usize = 60;

/// Steps on the pulls at most.
const MOST_STEPS: usize = 200;

/// How much closer a response is computed than the pulls are wanted, and how coarsely at most.
const CLOSER: f64 = 0.1;
const COARSEST_RESPONSE: f64 = 1e-2;

/// What the compliance of a face lacks in a reduced space, as a share of it.
const MISSING: f64 = 0.02;

/// Fields without energy that constraints hardly hold: as little of them as possible.
const LOOSE: f64 = 1e-9;

/// Tolerances of [`FullSpace::refine`]: those below are lost to rounding.
const LEAST_TOLERANCE: f64 = 1e-10;

/// What is left of the pulls is rounding below this share of what all constraints ask for.
const ROUNDING: f64 = 1e-12;

/// As many fields without energy as most surfaces have at most: room is counted for them before they are known.
const EXPECTED_IDLE: usize = 8;

/// The tolerance with which [`FullSpace::distance`] judges: a share of the distances that small spaces have.
const JUDGE: f64 = 2e-3;

/// Why a design was not refined.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// The surface has no such operator.
    #[error(transparent)]
    Operator(#[from] OperatorError),
    /// The design itself does not fit.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The tolerance is out of range.
    #[error("the tolerance is {tolerance}; it must be from {LEAST_TOLERANCE:e} to below 1")]
    Tolerance {
        /// What was given.
        tolerance: f64,
    },
    /// Designs that stay close to prescribed singularities are not the minimisers of one energy.
    #[error("a design with prescribed singularities has no field of the whole surface that it stands for")]
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
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// All fields of a surface, with what solves for designs among them. Independent of the weights.
pub struct FullSpace {
    kind: FieldKind,
    pub(super) inner: Inner,
}

pub(super) enum Inner {
    Two(Whole<2>),
    Three(Whole<3>),
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

    /// The same with so many bytes of room for factors, instead of [`USUAL_ROOM`]; where they do not fit there are levels.
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
            2 => Inner::Two(Whole::new(surface, kind, boundary, room, monitor)?),
            _ => Inner::Three(Whole::new(surface, kind, boundary, room, monitor)?),
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
        Self::within(surface, kind, boundary, 0, &Unwatched)
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

    /// The field of least energy among all fields under the constraints of a design of the same model: constraints and alignments have the weights
    /// that the design has given them, but for strengths: where there are factors, these are measured by what all fields resist with,
    /// and both biharmonic energies are `uᵀ S M⁻¹ S u`.
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
        match &self.inner {
            Inner::Two(whole) => whole.refine(weighted, basis, constraints, design, tolerance, monitor),
            Inner::Three(whole) => whole.refine(weighted, basis, constraints, design, tolerance, monitor),
        }
    }

    /// About the bytes of the two factors that designs with one choice of weights take, with what is kept beside them; 0 where there are none.
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

impl<const B: usize> Whole<B> {
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
        self.told(weighted, basis, constraints, coefficients, solve.field, solve.responses)
    }

    /// What there is to say of a field beside coefficients of the reduced space.
    pub(super) fn told(
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
        let (got, wanted) = (coefficients.len(), basis.space.dimension());
        let reduced = basis.space.lift(coefficients);
        let reduced = reduced.ok_or(DesignError::Length { what: "coefficients", got, wanted })?;
        let mut off: Vec<f64> = reduced.iter().map(|&x| f64::from(x)).collect();
        add(&mut off, field, -1.0);
        let norm = |x: &[f64]| self.product(x, x).sqrt();
        Ok(norm(&off) / norm(field).max(f64::MIN_POSITIVE))
    }
}

/// Conjugate gradients on the pulls.
struct Pulls<'a, const B: usize> {
    response: &'a Response<'a, B>,
    compliance: Compliance,
    precondition: DefiniteFactor,
    /// The fields without energy on the components with constraints, and what of them these hold.
    loose: Vec<Own>,
    idle: Vec<Idle>,
    force: Option<Vec<f64>>,
    tolerance: f64,
    monitor: &'a dyn Monitor,
    /// `K⁻¹ (f + Cᵀ y)`, and the rest in the end.
    field: Vec<f64>,
    responses: usize,
}

/// A field without energy at the constrained numbers: those of several, orthonormal in the norm of the inverse of the preconditioner.
struct Idle {
    values: Vec<f64>,
    /// The pulls that answer them.
    pulls: Vec<f64>,
    /// How much of each field it has.
    mixture: Vec<f64>,
}

fn solved(factor: &DefiniteFactor, right: &[f64]) -> Result<Vec<f64>, RefineError> {
    let mut x = DenseMatrix::zeros(right.len(), 1);
    x.column_mut(0).copy_from_slice(right);
    factor.solve(&mut x).map_err(DesignError::Factor)?;
    Ok(x.column(0).to_vec())
}

/// The mixtures that constraints hold, by the eigenpairs of `(CZ)ᵀ P⁻¹ CZ`. Those that they hardly hold are left out: as `Z` is orthonormal by area,
/// the field then has as little of them as possible.
fn held(fields: &[Vec<f64>], precondition: &DefiniteFactor) -> Result<Vec<Idle>, RefineError> {
    let count = fields.len();
    let pulls = fields.iter().map(|field| solved(precondition, field)).collect::<Result<Vec<_>, _>>()?;
    let mut square = DenseMatrix::zeros(count, count);
    for (j, own) in pulls.iter().enumerate() {
        square.column_mut(j).iter_mut().zip(fields).for_each(|(s, field)| *s = small_dot(field, own));
    }
    let pairs = lowest_symmetric(square, count, &Unwatched).map_err(DesignError::Eigen)?;
    let largest = pairs.values.last().copied().unwrap_or(0.0);
    let mut found: Vec<Idle> = Vec::new();
    let kept = pairs.values.iter().enumerate().rev().take_while(|(_, value)| **value > LOOSE * largest);
    for (k, _) in kept {
        let mut mixture = pairs.vectors.column(k).to_vec();
        let mut values = vec![0.0; fields.first().map_or(0, Vec::len)];
        for (field, share) in fields.iter().zip(&mixture) {
            values.iter_mut().zip(field).for_each(|(v, f)| *v += share * f);
        }
        let mut pulls = solved(precondition, &values)?;
        // What is held loosely is orthogonal to what is held firmly only as far as digits go: Gram–Schmidt, twice.
        for _ in 0..2 {
            for other in &found {
                let share = small_dot(&other.values, &pulls);
                values.iter_mut().zip(&other.values).for_each(|(v, o)| *v -= share * o);
                pulls.iter_mut().zip(&other.pulls).for_each(|(p, o)| *p -= share * o);
                mixture.iter_mut().zip(&other.mixture).for_each(|(t, o)| *t -= share * o);
            }
        }
        let size = small_dot(&values, &pulls).sqrt();
        if size > 0.0 {
            [&mut values, &mut pulls, &mut mixture].into_iter().flatten().for_each(|x| *x /= size);
            found.push(Idle { values, pulls, mixture });
        }
    }
    Ok(found)
}

fn factored(matrix: DenseMatrix, faces: &[u32], b: usize) -> Result<DefiniteFactor, RefineError> {
    DefiniteFactor::new(matrix).map_err(|error| match error {
        DefiniteError::NotPositiveDefinite { pivot } => {
            DesignError::Dependent { face: faces[(pivot / b).min(faces.len().max(1) - 1)] }.into()
        }
        other => DesignError::Factor(other).into(),
    })
}

/// `C u`: what a field has on faces.
fn at_faces<const B: usize>(faces: &[u32], field: &[f64]) -> Vec<f64> {
    let own = |&face: &u32| &field[B * face as usize..B * (face as usize + 1)];
    faces.iter().flat_map(own).copied().collect()
}

impl<'a, const B: usize> Pulls<'a, B> {
    fn new(
        whole: &'a Whole<B>,
        response: &'a Response<'a, B>,
        compliance: Compliance,
        force: Option<Vec<f64>>,
        tolerance: f64,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, RefineError> {
        let mut matrix = compliance.moved.clone();
        for (i, slack) in compliance.slacks.iter().enumerate() {
            let own = matrix.column(i)[i];
            matrix.column_mut(i)[i] += slack + MISSING * own;
        }
        let precondition = factored(matrix, &compliance.faces, B)?;
        let k = compliance.slacks.len();
        let loose = response.kernel().map_or_else(Vec::new, |kernel| kernel.at(&compliance.faces));
        let at_faces =
            response.kernel().map_or_else(Vec::new, |kernel| kernel.values_at::<B>(&loose, &compliance.faces));
        let idle = if k > 0 { held(&at_faces, &precondition)? } else { Vec::new() };
        let field = vec![0.0; B * whole.mass.len()];
        Ok(Self { response, compliance, precondition, loose, idle, force, tolerance, monitor, field, responses: 0 })
    }

    /// `K⁻¹ Cᵀ y`.
    fn respond(&mut self, y: &[f64], tolerance: f64) -> Result<Vec<f64>, RefineError> {
        let mut force = vec![0.0; self.field.len()];
        for (&face, y) in self.compliance.faces.iter().zip(y.chunks_exact(B)) {
            force[B * face as usize..B * (face as usize + 1)].iter_mut().zip(y).for_each(|(f, y)| *f += y);
        }
        self.responses += 1;
        self.response.apply(&force, tolerance, self.monitor)
    }

    /// The pulls that the reduced space would answer a miss with. What fields without energy meet of it is taken out, and added to their amounts.
    fn answer(&self, miss: &mut [f64], amounts: &mut [f64]) -> Result<Vec<f64>, RefineError> {
        let mut y = solved(&self.precondition, miss)?;
        for idle in &self.idle {
            let share = small_dot(&idle.values, &y);
            miss.iter_mut().zip(&idle.values).for_each(|(m, b)| *m -= share * b);
            y.iter_mut().zip(&idle.pulls).for_each(|(y, p)| *y -= share * p);
            amounts.iter_mut().zip(&idle.mixture).for_each(|(a, t)| *a += share * t);
        }
        Ok(y)
    }

    fn run(&mut self) -> Result<(), RefineError> {
        let least = CLOSER * self.tolerance;
        if let Some(force) = self.force.take() {
            self.responses += 1;
            self.field = self.response.apply(&force, least, self.monitor)?;
        }
        if self.compliance.faces.is_empty() {
            return Ok(());
        }
        let product = small_dot;
        let mut amounts = vec![0.0; self.loose.len()];
        let reached = at_faces::<B>(&self.compliance.faces, &self.field);
        let mut miss: Vec<f64> = self.compliance.values.iter().zip(&reached).map(|(v, u)| v - u).collect();
        let asked = product(&miss, &solved(&self.precondition, &miss)?);
        let mut scaled = self.answer(&mut miss, &mut amounts)?;
        let mut size = product(&miss, &scaled);
        // Where fields without energy meet all constraints nothing but rounding is left, of either sign.
        let (first, goal) = (size, (size * self.tolerance * self.tolerance).max(asked * ROUNDING * ROUNDING));
        let mut direction = scaled.clone();
        let mut steps = 0;
        while !(size.abs() <= goal) {
            if steps == MOST_STEPS || !(size > 0.0 && size.is_finite()) {
                return Err(RefineError::NotConverged { tolerance: self.tolerance });
            }
            steps += 1;
            // The less there is left to do, the fewer digits of it matter.
            let close = (least * (first / size).sqrt()).clamp(least, COARSEST_RESPONSE);
            let moved = self.respond(&direction, close)?;
            let mut image = at_faces::<B>(&self.compliance.faces, &moved);
            image.iter_mut().zip(&self.compliance.slacks).zip(&direction).for_each(|((q, slack), y)| *q += slack * y);
            let curvature = product(&direction, &image);
            if !(curvature > 0.0) {
                return Err(RefineError::NotConverged { tolerance: self.tolerance });
            }
            let step = size / curvature;
            add(&mut self.field, &moved, step);
            miss.iter_mut().zip(&image).for_each(|(m, q)| *m -= step * q);
            scaled = self.answer(&mut miss, &mut amounts)?;
            let next = product(&miss, &scaled);
            let shared = next + step * product(&image, &scaled);
            let keep = (next - shared) / size;
            size = next;
            direction.iter_mut().zip(&scaled).for_each(|(d, z)| *d = z + keep * *d);
        }
        self.response.kernel().iter().for_each(|own| own.add_to::<B>(&self.loose, &amounts, &mut self.field));
        Ok(())
    }
}
