//! Pairs in one space, judged, and the space that would hold what they miss.

use super::super::certificate::{CertificateError, KERNEL, certificate_of, certify, gram_defect, infinity_norm};
use super::super::domain::Domain;
use super::super::energy::{Energy, PairShare, measures};
use super::super::lehmann::{self, Enclosed};
use super::super::restricted::Ritz;
use super::super::{hats, hidden};
use super::parts::divided;
use super::reduce::MOST_ROUNDING;
use super::space::{FEW_ENTRIES, initial_space};
use super::{ApproximationError, ApproximationParameters, FEW_VERTICES};
use crate::basis::Certificate;
use crate::operator::{EigenProblem, MeshOperator};
use chladni_algebra::SparseMatrix;
use chladni_base::{Monitor, Portion, Quiet};

/// The mean of the estimated errors is to be at most this share of the goal, which is for the largest.
const MEAN_SHARE: f64 = 0.2;

/// So many single vertices may become columns, or as many as there are columns: a limb of a coarse mesh has hundreds.
const MANY_HATS: usize = 1200;

/// A space that is too coarse everywhere grows by this factor.
const GROWTH: f64 = 1.6;

/// A space grows to no more than this share of the unknowns: beyond it columns have too few vertices to be smooth.
const LARGEST_SHARE: f64 = 0.25;

/// The columns that the space of a mesh of `n` vertices may grow to from a dimension, by hat functions or by a larger
/// dimension: dense problems grow with it, and whoever promises memory has to know how far.
pub fn most_columns(n: usize, dimension: usize) -> usize {
    let most = if n <= SMALL { n } else { n / 2 };
    (dimension + dimension.max(MANY_HATS)).min(most).max(dimension)
}

/// A mesh of so few unknowns is solved as a whole where nothing else reaches a goal.
const SMALL: usize = 1500;

/// Eigenfunctions on the mesh that are farther from orthonormal than this come from a dense problem that rounding has
/// decided.
const LARGEST_DEFECT: f64 = 1e-3;

/// In a solid of more unknowns than this nobody looks for hidden eigenfunctions unasked: the factor takes longer than
/// everything else.
pub const MOST_COUNTED_IN_SOLID: usize = 20_000;

/// The least that a Ritz value may be, up to rounding, where no eigenvalue lies below `−floor`. On unit area 1 is
/// little, and all may be zero.
fn possible_from(floor: f64, values: &[f64]) -> f64 {
    -floor - MOST_ROUNDING * values.last().map_or(1.0, |value| value.abs().max(1.0))
}

/// About the quotient of energy and mass of the functions that a space of so many columns misses, by the values in it:
/// on a surface they grow with their number.
fn level_of_missing(columns: usize, values: &[f64]) -> f64 {
    match values.last() {
        Some(&last) if last > 0.0 => last * columns as f64 / values.len() as f64,
        _ => 4.0 * std::f64::consts::PI * columns as f64,
    }
}

/// By how much an estimate of a pair is too small where no eigenvalue lies below `−floor`, far below the pair, as
/// beside a deep well at a few vertices: what is missing is measured by the pencil moved by the floor, in which its
/// level is that much higher than above the pair.
fn understated(value: f64, floor: f64, missing: f64) -> f64 {
    if floor > 0.0 { (missing + floor) / (missing + (-value).clamp(0.0, floor)) } else { 1.0 }
}

/// What may still help.
pub(super) struct Remedies {
    /// Hat functions of single vertices.
    pub(super) hats: bool,
    /// Functions that diffuse for longer.
    pub(super) longer: bool,
}

/// Pairs in one space, guards included, and how good they are.
pub(super) struct Attempt {
    pub(super) ritz: Ritz,
    /// The pairs without guards.
    pub(super) count: usize,
    /// The columns that a space may grow to.
    most: usize,
    pub(super) certificate: Certificate,
    /// The largest estimated relative error, the kernel apart; of a guard only where its exact value may lie among
    /// those of the pairs.
    pub(super) largest_estimate: f64,
    /// The mean of them.
    mean_estimate: f64,
    /// Eigenvalues below the last pair's that no pair stands for.
    pub(super) hidden: usize,
    /// Where the energy sits that the pairs miss whose error is beyond what the mean may be.
    density: Option<Vec<f64>>,
}

impl Attempt {
    pub(super) fn new(ritz: Ritz, count: usize, most: usize) -> Self {
        Self {
            ritz,
            count,
            most,
            certificate: Certificate::default(),
            largest_estimate: 0.0,
            mean_estimate: 0.0,
            hidden: 0,
            density: None,
        }
    }

    pub(super) fn judge(
        &mut self,
        energy: &Energy<'_>,
        problem: &EigenProblem,
        goal: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), ApproximationError> {
        let Ritz { space, mass, pairs, .. } = &mut self.ritz;
        let good = goal.map(|goal| MEAN_SHARE * goal);
        (self.certificate, self.density) =
            certify(energy, problem, space, mass, &mut pairs.vectors, &pairs.values, good, monitor)?;
        self.conclude(energy.floor(), problem.area);
        Ok(())
    }

    /// [`judge`](Self::judge) in so many parts of the surface, one after the other; where energy is missing is not
    /// told.
    pub(super) fn judge_in_parts(
        &mut self,
        domain: Domain<'_>,
        operator: &MeshOperator,
        parts: usize,
        monitor: &dyn Monitor,
    ) -> Result<(), ApproximationError> {
        let Domain::Surface(mesh) = domain else { return Ok(()) };
        let (problem, Ritz { space, mass, pairs, .. }) = (&operator.problem, &mut self.ritz);
        let part_of = divided(mesh, (problem.size(), problem.unknowns.as_deref()), parts);
        let mut sums = vec![PairShare::default(); pairs.values.len()];
        for part in 0..parts {
            monitor.detail(&format!("part {} of {parts}", part + 1));
            let energy = Energy::of_part(mesh, problem, &part_of, part as u32, &Quiet(monitor))
                .map_err(CertificateError::from)?;
            let own = energy.in_order(space);
            // Parts are steps of one stage.
            let portion = Portion { whole: monitor, step: (part, parts) };
            let shares = energy.shares(&own, &pairs.vectors, &pairs.values, KERNEL, &portion)?;
            sums.iter_mut().zip(&shares).for_each(|(sum, share)| sum.add(share));
        }
        let defect = gram_defect(mass, &pairs.vectors);
        let of = (infinity_norm(&problem.stiffness), defect, problem.area);
        let measures = measures(&sums, &pairs.values, KERNEL);
        self.certificate = certificate_of(&measures, of, &mut pairs.vectors, &pairs.values);
        self.density = None;
        self.conclude(0.0, problem.area);
        Ok(())
    }

    /// What the certificate says of all pairs together; no eigenvalue lies below `−floor`.
    pub(super) fn conclude(&mut self, floor: f64, area: f64) {
        let pairs = &self.ritz.pairs;
        // No eigenvalue lies below the floor, and none of index `k` above the value of pair `k`, which is a Ritz value
        // unless rounding has decided it. A value that is exactly zero is known.
        let possible = possible_from(floor, &pairs.values);
        let missing = level_of_missing(self.ritz.space.columns(), &pairs.values);
        let Certificate { estimates, bounds, .. } = &mut self.certificate;
        for ((estimate, bound), &value) in estimates.iter_mut().zip(bounds.iter()).zip(&pairs.values) {
            *estimate = (*estimate * understated(value, floor, missing)).min(*bound);
        }
        for (list, unknown) in [(estimates, f64::INFINITY), (bounds, 0.0)] {
            for (distance, value) in list.iter_mut().zip(&pairs.values) {
                *distance = match *value >= possible {
                    true => distance.min((value + floor).max(0.0) / area),
                    false => distance.max(unknown),
                };
            }
        }
        let last = self.count.checked_sub(1).and_then(|k| pairs.values.get(k)).copied().unwrap_or(f64::NEG_INFINITY);
        let (mut sum, mut summed) = (0.0, 0usize);
        self.largest_estimate = 0.0;
        for (k, (error, &value)) in self.certificate.estimates.iter().zip(&pairs.values).enumerate() {
            let error = error * area;
            let relative = error / value.abs();
            if value.abs() > KERNEL && (k < self.count || value - error < last) {
                self.largest_estimate = self.largest_estimate.max(relative);
            }
            if value.abs() > KERNEL && k < self.count {
                sum += relative;
                summed += 1;
            }
        }
        self.mean_estimate = sum / summed.max(1) as f64;
        if !(self.certificate.orthonormality_defect <= LARGEST_DEFECT) {
            // Estimates are of functions of unit mass; these are not what the dense problem took them for.
            self.largest_estimate = f64::INFINITY;
        }
    }

    /// The values of the pairs, unless one of them is below all that are possible: then it is no Ritz value, and
    /// rounding has decided the others as well.
    ///
    /// # Errors
    /// [`ApproximationError::Rounding`].
    pub(super) fn possible(&self, floor: f64, area: f64) -> Result<(), ApproximationError> {
        let values = &self.ritz.pairs.values;
        match values.first() {
            Some(&lowest) if !(lowest >= possible_from(floor, values)) => {
                Err(ApproximationError::Rounding { value: lowest / area, least: 0.0 - floor / area })
            }
            _ => Ok(()),
        }
    }

    /// Where columns may be too coarse for a limb and all seems well: whether there are eigenfunctions that the space
    /// does not know of.
    pub(super) fn look_for_hidden(
        &mut self,
        domain: Domain<'_>,
        operator: &MeshOperator,
        goal: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), ApproximationError> {
        let Ritz { space, mass, pairs, .. } = &self.ritz;
        let problem = &operator.problem;
        let costly = matches!(domain, Domain::Solid(_)) && space.rows() > MOST_COUNTED_IN_SOLID;
        let coarse = !costly && space.rows() / space.columns().max(1) < FEW_VERTICES;
        if !coarse || goal.is_none_or(|goal| self.excess(goal) > 1.0) {
            return Ok(());
        }
        let errors: Vec<f64> = self.certificate.estimates.iter().map(|error| error * problem.area).collect();
        let of = (problem, operator.floor);
        if let Some(hidden) = hidden::hidden(of, space, mass, (&pairs.values, &errors), self.count, monitor)? {
            self.hidden = hidden.count;
            self.density = hidden.density;
            // The last pairs stand so many places too low.
            let last = self.count.min(pairs.values.len()).saturating_sub(1);
            let (value, lower) = (pairs.values[last], pairs.values[last.saturating_sub(hidden.count)]);
            self.largest_estimate = self.largest_estimate.max((value - lower) / value.abs().max(KERNEL));
        }
        Ok(())
    }

    /// Encloses the pairs, index by index.
    pub(super) fn enclose(
        &self,
        energy: &Energy<'_>,
        problem: &EigenProblem,
        monitor: &dyn Monitor,
    ) -> Result<Enclosed, ApproximationError> {
        monitor.stage("certify");
        let estimates: Vec<f64> = self.certificate.estimates.iter().map(|error| error * problem.area).collect();
        lehmann::enclose(energy, problem, &self.ritz, &estimates, self.count, monitor)
    }

    /// How many times as large as they may be the errors are, as estimated.
    pub(super) fn excess(&self, goal: f64) -> f64 {
        let estimated = (self.largest_estimate / goal).max(self.mean_estimate / (MEAN_SHARE * goal));
        if self.hidden > 0 { estimated.max(1.0 + self.hidden as f64) } else { estimated }
    }

    /// The columns that a space may grow to. Five dense matrices are promised memory; where functions reach far, the
    /// sparse ones of this space and the next are not much smaller.
    fn most_beside_entries(&self) -> usize {
        let d = self.ritz.space.columns().max(1) as f64;
        let filled = self.ritz.mass.entries() as f64 / (d * d);
        (self.most as f64 * (40.0 / (40.0 + 48.0 * filled)).sqrt()) as usize
    }

    /// A space that holds what this one misses; `None` where the mesh has no room for one.
    pub(super) fn finer_space(
        &self,
        domain: Domain<'_>,
        operator: &MeshOperator,
        parameters: &mut ApproximationParameters,
        goal: f64,
        remedies: &mut Remedies,
        monitor: &dyn Monitor,
    ) -> Result<Option<SparseMatrix<f32>>, ApproximationError> {
        let problem = &operator.problem;
        let (n, space) = (problem.size(), &self.ritz.space);
        if space.columns() >= n {
            return Ok(None);
        }
        // Smoother columns of the same number take less room than more of them, and the dense problem does not grow.
        let far = matches!(domain, Domain::Surface(_)) && space.entries() > FEW_ENTRIES * n;
        let few = n < FEW_VERTICES * parameters.dimension.max(1) && !far;
        if few
            && self.hidden == 0
            && std::mem::take(&mut remedies.longer)
            && let Some(longer) = parameters.space.for_few_vertices()
        {
            parameters.space = longer;
            let finer = initial_space(domain, operator, parameters, monitor)?;
            if parameters.space == longer && finer.columns() <= self.most {
                return Ok(Some(finer));
            }
        }
        // Errors add up over what is left, here and at other pairs: aim at half of the goal.
        let left = (0.5 / self.excess(goal)).clamp(0.02, 0.3);
        let most = self.most_beside_entries();
        let room = space.columns().max(MANY_HATS.min(n / 4)).min(n / 2);
        let mut room = room.min(most.saturating_sub(space.columns()));
        if remedies.hats
            && let Some(density) = &self.density
        {
            // What hats leave of other columns may ask for more of them.
            while room > 0
                && let Some(rows) = hats::where_it_sits(density, &problem.stiffness, left, room)
            {
                let finer = hats::with_hats(space, &rows);
                if finer.columns() <= most {
                    return Ok(Some(finer));
                }
                room = room * 3 / 4;
            }
        }
        let wanted = (GROWTH * parameters.dimension.max(parameters.count) as f64).ceil();
        if wanted > (LARGEST_SHARE * n as f64).min(most as f64) {
            return Ok((n <= SMALL.min(self.most)).then(|| SparseMatrix::identity(n)));
        }
        parameters.dimension = wanted as usize;
        let finer = initial_space(domain, operator, parameters, monitor)?;
        // Vertices that no function reaches, and those of long edges, are columns beyond the dimension.
        Ok(Some(finer).filter(|finer| finer.columns() <= self.most))
    }
}
