//! The pulls that meet constraints among all fields of a surface, by conjugate gradients.
//!
//! They are preconditioned by the compliance that the reduced space has at the constrained faces. It misses what is
//! finer than its columns, which does not reach far: as a share of what a face yields, a number for each, that a first,
//! coarse response of the surface tells.

use chladni_algebra::{DefiniteError, DefiniteFactor, DenseMatrix, dot_in_order, lowest_symmetric};
use chladni_base::{Monitor, Unwatched};

use super::compliance::Compliance;
use super::design::DesignError;
use super::kernel::Own;
use super::refine::RefineError;
use super::refine_response::{FullOperator, Response, add};
use super::weighted::LONGEST_IDLE;

/// Steps on the pulls at most.
const MOST_STEPS: usize = 200;

/// How much closer a response is computed than the pulls are wanted, and how coarsely at most.
const CLOSER: f64 = 0.1;
const COARSEST_RESPONSE: f64 = 1e-2;

/// What the compliance of a face lacks in a reduced space, as a share of it.
const MISSING: f64 = 0.02;

/// How closely the response is computed that tells how much it lacks. A face that lacks a percent of what it yields has
/// to be told from one that lacks nothing.
const PROBE: f64 = 1e-3;

/// From this tolerance on that spares more than it costs.
const LEARNING_PAYS: f64 = 1e-5;

/// The shares that a face may be found to lack, at least and at most.
const LEAST_MISSING: f64 = 1e-3;
const MOST_MISSING: f64 = 1.0;

/// Fields without energy that constraints hardly hold: as little of them as possible.
const LOOSE: f64 = 1e-9;

/// What is left of the pulls is rounding below this share of what all constraints ask for.
const ROUNDING: f64 = 1e-12;

/// Conjugate gradients on the pulls.
pub(super) struct Pulls<'a, const B: usize> {
    response: &'a Response<'a, B>,
    compliance: Compliance,
    precondition: DefiniteFactor,
    /// Whether that is improved by what a first response tells.
    learns: bool,
    /// The fields without energy on the components with constraints, and what of them these hold.
    loose: Vec<Own>,
    idle: Vec<Idle>,
    force: Option<Vec<f64>>,
    tolerance: f64,
    monitor: &'a dyn Monitor,
    /// `K⁻¹ (f + Cᵀ y)`, and the rest in the end.
    pub field: Vec<f64>,
    pub responses: usize,
}

/// A field without energy at the constrained numbers: those of several, orthonormal in the norm of the inverse of the
/// preconditioner.
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

/// The mixtures that constraints hold, by the eigenpairs of `(CZ)ᵀ P⁻¹ CZ`. Those that they hardly hold are left out:
/// as `Z` is orthonormal by area, the field then has as little of them as possible.
fn held(fields: &[Vec<f64>], precondition: &DefiniteFactor) -> Result<Vec<Idle>, RefineError> {
    let count = fields.len();
    let pulls = fields.iter().map(|field| solved(precondition, field)).collect::<Result<Vec<_>, _>>()?;
    let mut square = DenseMatrix::zeros(count, count);
    for (j, own) in pulls.iter().enumerate() {
        square.column_mut(j).iter_mut().zip(fields).for_each(|(s, field)| *s = dot_in_order(field, own));
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
                let share = dot_in_order(&other.values, &pulls);
                values.iter_mut().zip(&other.values).for_each(|(v, o)| *v -= share * o);
                pulls.iter_mut().zip(&other.pulls).for_each(|(p, o)| *p -= share * o);
                mixture.iter_mut().zip(&other.mixture).for_each(|(t, o)| *t -= share * o);
            }
        }
        let size = dot_in_order(&values, &pulls).sqrt();
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

/// The factor of what the reduced space has constraints move by and give way, with what it lacks at each face as a
/// share.
fn preconditioner<const B: usize>(
    compliance: &Compliance,
    missing: impl Fn(usize) -> f64,
) -> Result<DefiniteFactor, RefineError> {
    let mut matrix = compliance.moved.clone();
    for (i, slack) in compliance.slacks.iter().enumerate() {
        let own = matrix.column(i)[i];
        matrix.column_mut(i)[i] += slack + missing(i / B) * own;
    }
    factored(matrix, &compliance.faces, B)
}

/// The mixtures of fields without energy that constraints hold.
fn idle<const B: usize>(
    response: &Response<'_, B>,
    compliance: &Compliance,
    loose: &[Own],
    precondition: &DefiniteFactor,
) -> Result<Vec<Idle>, RefineError> {
    match response.kernel() {
        Some(kernel) if !compliance.faces.is_empty() => {
            held(&kernel.values_at::<B>(loose, &compliance.faces), precondition)
        }
        _ => Ok(Vec::new()),
    }
}

/// `C u`: what a field has on faces.
fn at_faces<const B: usize>(faces: &[u32], field: &[f64]) -> Vec<f64> {
    let own = |&face: &u32| &field[B * face as usize..B * (face as usize + 1)];
    faces.iter().flat_map(own).copied().collect()
}

impl<'a, const B: usize> Pulls<'a, B> {
    /// Ready to find them to a tolerance, where alignments pull with `force`.
    ///
    /// # Errors
    /// [`RefineError::Design`]: constraints that the reduced space cannot tell apart.
    pub fn new(
        whole: &'a FullOperator<B>,
        response: &'a Response<'a, B>,
        compliance: Compliance,
        force: Option<Vec<f64>>,
        tolerance: f64,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, RefineError> {
        let precondition = preconditioner::<B>(&compliance, |_| MISSING)?;
        let loose = response.kernel().map_or_else(Vec::new, |kernel| kernel.at(&compliance.faces));
        let idle = idle::<B>(response, &compliance, &loose, &precondition)?;
        // By factors a coarse response costs as much as a close one.
        let learns = tolerance < LEARNING_PAYS && whole.direct.is_none() && compliance.faces.len() > 1;
        let field = vec![0.0; B * whole.mass.len()];
        Ok(Self {
            response,
            compliance,
            precondition,
            learns,
            loose,
            idle,
            force,
            tolerance,
            monitor,
            field,
            responses: 0,
        })
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

    /// The pulls that the reduced space would answer a miss with. What fields without energy meet of it is taken out,
    /// and added to their amounts.
    fn answer(&self, miss: &mut [f64], amounts: &mut [f64]) -> Result<Vec<f64>, RefineError> {
        let mut y = solved(&self.precondition, miss)?;
        for idle in &self.idle {
            let share = dot_in_order(&idle.values, &y);
            miss.iter_mut().zip(&idle.values).for_each(|(m, b)| *m -= share * b);
            y.iter_mut().zip(&idle.pulls).for_each(|(y, p)| *y -= share * p);
            amounts.iter_mut().zip(&idle.mixture).for_each(|(a, t)| *a += share * t);
        }
        Ok(y)
    }

    /// Learns from one coarse response what the reduced space lacks at each face, which spares steps that are computed
    /// closely.
    fn absorb_coarse_response(&mut self, pulls: &[f64]) -> Result<(), RefineError> {
        let moved = self.respond(pulls, PROBE)?;
        let moved = at_faces::<B>(&self.compliance.faces, &moved);
        let missing = self.missing(pulls, &moved);
        self.precondition = preconditioner::<B>(&self.compliance, |face| missing[face])?;
        self.idle = idle::<B>(self.response, &self.compliance, &self.loose, &self.precondition)?;
        Ok(())
    }

    /// What the reduced space lacks at each face, as a share of what it has a pull move there: what pulls did not move
    /// as it has it is put down to the face itself, since what is finer than columns does not reach far.
    fn missing(&self, pulls: &[f64], moved: &[f64]) -> Vec<f64> {
        let reduced = &self.compliance.moved;
        let one = |face: usize| {
            let own = B * face..B * (face + 1);
            let work = |i: usize| (moved[i] - dot_in_order(reduced.column(i), pulls)) * pulls[i];
            let more: f64 = own.clone().map(work).sum();
            let size: f64 = own.map(|i| reduced.column(i)[i] * pulls[i] * pulls[i]).sum();
            let share = more / size;
            if share.is_finite() { share.clamp(LEAST_MISSING, MOST_MISSING) } else { MISSING }
        };
        (0..self.compliance.faces.len()).map(one).collect()
    }

    /// Finds them, and the field.
    ///
    /// # Errors
    /// [`RefineError`]: the iteration ended before its goal, or was cancelled.
    pub fn run(&mut self) -> Result<(), RefineError> {
        let least = (CLOSER * self.tolerance).min(COARSEST_RESPONSE);
        if let Some(force) = self.force.take() {
            self.responses += 1;
            self.field = self.response.apply(&force, least, self.monitor)?;
        }
        if self.compliance.faces.is_empty() {
            return Ok(());
        }
        let product = dot_in_order;
        let mut amounts = vec![0.0; self.loose.len()];
        let reached = at_faces::<B>(&self.compliance.faces, &self.field);
        let mut miss: Vec<f64> = self.compliance.values.iter().zip(&reached).map(|(v, u)| v - u).collect();
        let asked = product(&miss, &solved(&self.precondition, &miss)?);
        let mut scaled = self.answer(&mut miss, &mut amounts)?;
        let mut size = product(&miss, &scaled);
        if self.learns && size > asked * ROUNDING * ROUNDING {
            self.absorb_coarse_response(&scaled)?;
            scaled = self.answer(&mut miss, &mut amounts)?;
            size = product(&miss, &scaled);
        }
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
        if let Some(kernel) = self.response.kernel() {
            let parts = kernel.parts(&self.loose, self.response.masses(), &self.compliance.faces);
            let times = parts.times_asked(&amounts, &self.compliance.values, B);
            if times > LONGEST_IDLE {
                return Err(RefineError::Unbounded { times });
            }
            kernel.add_to::<B>(&self.loose, &amounts, &mut self.field);
        }
        Ok(())
    }
}
