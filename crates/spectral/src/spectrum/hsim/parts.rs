//! One problem in parts that know nothing of each other, as for several machines: each solves some slices of the
//! spectrum, and a join makes one answer of them and proves it.
//!
//! A plan is arithmetic: indices of pairs are divided evenly. Each slice looks for a shift near its middle, whose count
//! says which pairs its Ritz values are, so that no slice has to wait for the one below. Neighbours overlap by a few
//! pairs, and meet in the widest gap among those, where both have to agree. From there on everything is as in one
//! process (`slices.rs`): a Rayleigh–Ritz between each two shifts, what is left between segments taken off, counts,
//! judgement.
//!
//! Where a slice does not find its pairs, as among eigenvalues of more copies than neighbours share, its part says so,
//! and the join solves the problem in one piece instead.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix};
use chladni_base::notes::FALLBACKS;
use chladni_base::{Monitor, SplitMix64};
use chladni_mesh::TriangleMesh;

use super::super::error::ApproximationError;
use super::certify::Goal;
use super::climb::{self, Climb};
use super::judge::Count;
use super::kernel::Kernel;
use super::lanczos;
use super::level::{Level, inverse};
use super::scout::Scout;
use super::segments::{Assembly, Cuts, DEPENDENT, Sliced};
use super::slices::{self, joint, one_slice, target};
use super::solve::{Aim, Columns, Finest, aim, within};
use super::tuning::TUNING;
use super::{Eigenpairs, HsimError, HsimParameters};
use crate::basis::{Fingerprint, Part, PartCount, PartPlan, PartSlice, SHARED};
use crate::operator::EigenProblem;

/// Fewer pairs to a slice are not worth a space: neighbours share sixteen.
pub const LEAST_PAIRS: usize = 64;

/// Values of two spaces differ by their residuals: relative to themselves, by no more than this.
const SAME_VALUES: f64 = 1e-5;

/// Why there is no part, or nothing becomes of the parts.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The solver failed.
    #[error(transparent)]
    Solver(#[from] HsimError),
    /// The approximation failed.
    #[error(transparent)]
    Approximation(#[from] ApproximationError),
    /// The problem is not solved in parts.
    #[error("this problem is not solved in parts: {reason}")]
    Unsuited {
        /// Why.
        reason: String,
    },
    /// There are fewer parts than that.
    #[error("there is no part {number} of {parts}")]
    NoSuchPart {
        /// The part asked for, from 1.
        number: usize,
        /// How many there are.
        parts: usize,
    },
    /// A part is not there.
    #[error("part {number} of {parts} is missing")]
    Missing {
        /// The part, from 1.
        number: usize,
        /// How many there are.
        parts: usize,
    },
    /// A part was made by another version of the solver.
    #[error("part {number} was made by version {found} of the solver, and this is {version}: compute it again")]
    Version {
        /// The part, from 1.
        number: usize,
        /// The version that made it.
        found: String,
        /// The version that reads it.
        version: String,
    },
    /// A part belongs to something else.
    #[error("part {number} does not belong to the others: {reason}")]
    Foreign {
        /// The part, from 1.
        number: usize,
        /// What is different.
        reason: String,
    },
    /// What a part holds is not what it must be.
    #[error("part {number} is damaged: {reason}")]
    Damaged {
        /// The part, from 1.
        number: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// Parts of a surface do not reach the goal, and there is no room for one piece, which might.
    #[error("functions of parts of the surface miss the goal, and one piece takes more memory than there is")]
    GoalMissed,
}

impl From<chladni_base::Cancelled> for PartError {
    fn from(cancelled: chladni_base::Cancelled) -> Self {
        Self::Solver(cancelled.into())
    }
}

impl PartError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Solver(error) => error.kind(),
            Self::Approximation(error) => error.kind(),
            Self::Unsuited { .. } | Self::NoSuchPart { .. } => "invalid-parameters",
            Self::Missing { .. } => "part-missing",
            Self::Version { .. } => "part-of-another-version",
            Self::Foreign { .. } => "part-of-another-problem",
            Self::Damaged { .. } => "part-damaged",
            Self::GoalMissed => "memory-exceeded",
        }
    }
}

/// A problem and its plan, factored symbolically: what each part and the join begin with.
pub struct Parted<'a> {
    climb: Climb<'a>,
    finest: Finest,
    plan: PartPlan,
    goal: Goal,
    wanted: usize,
}

impl<'a> Parted<'a> {
    /// Divides a problem; into as many parts as there are slices of some 250 pairs where their number is not given.
    /// `version` is that of the solver: parts of another one are refused.
    ///
    /// # Errors
    /// [`PartError::Unsuited`] where the pairs do not come from Krylov spaces, or are too few for so many parts; those
    /// of [`solve`](super::solve).
    pub fn new(
        mesh: &'a TriangleMesh,
        problem: &'a EigenProblem,
        parameters: &'a HsimParameters,
        parts: Option<usize>,
        version: &str,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, PartError> {
        let climb = Climb::plain(mesh, problem, parameters, monitor)?;
        monitor.stage("hierarchy");
        let unsuited = |reason: &str| Err(PartError::Unsuited { reason: reason.to_owned() });
        if !climb.may_take_krylov_space() {
            return unsuited("its pairs do not come from Krylov spaces of slices");
        }
        let finest = climb.finest_alone()?;
        let (goal, wanted) =
            match aim(&finest, parameters.wanted, |bound| climb.bound(bound), climb.known, climb.monitor)? {
                Aim::Nothing(_) => return unsuited("no eigenvalue lies below the bound"),
                Aim::Pairs(goal, wanted) => (goal, wanted),
            };
        // Some beyond the wanted ones, among which there is a gap to count in.
        let pairs = (climb.nontrivial(wanted) + TUNING.slices.beyond).min(climb.columns(wanted));
        let most = pairs / LEAST_PAIRS;
        let of_size = |pairs: usize| ((pairs as f64 / TUNING.slices.pairs as f64).round() as usize).max(1);
        let parts = parts.unwrap_or(of_size(pairs));
        if parts == 0 || parts > most {
            let reason = match most {
                0 => format!("{pairs} pairs are too few: a part takes {LEAST_PAIRS}"),
                _ => format!("{pairs} pairs make at most {most} parts of {LEAST_PAIRS}, not {parts}"),
            };
            return Err(PartError::Unsuited { reason });
        }
        let slices = of_size(pairs / parts);
        if !lanczos::has_room(finest.level.size(), pairs.div_ceil(parts * slices) + 2 * SHARED, parameters.tolerance) {
            return unsuited("so many pairs of so few unknowns are had for less by dense solves");
        }
        let plan = PartPlan {
            version: version.to_owned(),
            problem: fingerprint(problem),
            parts,
            slices,
            pairs,
            kernel: climb.known,
            tolerance: parameters.tolerance,
            seed: parameters.seed,
            columns: None,
        };
        Ok(Self { climb, finest, plan, goal, wanted })
    }

    /// The plan.
    pub fn plan(&self) -> &PartPlan {
        &self.plan
    }

    /// Solves one part, counted from 0. The same problem and plan give the same part, up to rounding where the number
    /// of threads differs.
    ///
    /// # Errors
    /// [`PartError::NoSuchPart`]; cancellation. A slice that does not find its pairs is no error: the part says so.
    pub fn solve(&self, number: usize) -> Result<Part, PartError> {
        let (plan, monitor) = (&self.plan, self.climb.monitor);
        if number >= plan.parts {
            return Err(PartError::NoSuchPart { number: number.saturating_add(1), parts: plan.parts });
        }
        monitor.stage("iterate");
        let kernel = Kernel::new(&self.finest.level);
        let mut scout = Scout::new(&self.finest.level, &self.finest.symbolic, monitor);
        let (mut slices, mut memory) = (Vec::with_capacity(plan.slices), Vec::new());
        for slice in number * plan.slices..(number + 1) * plan.slices {
            match self.slice(slice, &kernel, &mut scout, &mut memory) {
                Ok(Ok(found)) => slices.push(found),
                Ok(Err(reason)) | Err(HsimError::Numerical(reason)) => {
                    monitor.note(FALLBACKS, &format!("part {}: {reason}", number + 1));
                    return Ok(Part { plan: plan.clone(), number, slices: Err(reason), share: None });
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(Part { plan: plan.clone(), number, slices: Ok(slices), share: None })
    }

    /// One slice of all, or why it was not found.
    fn slice<'b>(
        &'b self,
        slice: usize,
        kernel: &Kernel<'_>,
        scout: &mut Scout<'b>,
        memory: &mut Vec<Vec<f64>>,
    ) -> Result<Result<PartSlice, String>, HsimError> {
        let Self { finest: Finest { level, symbolic, order }, plan, climb, .. } = self;
        let (from, pairs) = plan.pairs_of(slice);
        let (begin, end) = (plan.begin(slice), plan.begin(slice + 1));
        let whole = lanczos::Wanted::lowest(level.size(), plan.pairs, plan.pairs, plan.tolerance, plan.seed);
        let target = target(begin, (end - begin) as f64);
        let first = (scout.distance(target.below), whole.least_shift);
        let Some(shift) = scout.shift_below(&target, first, kernel.dimension(), climb.monitor)? else {
            return Ok(Err(slices::no_shift(begin)));
        };
        climb.monitor.detail(&format!("slice of pairs {from} to {} of {}", from + pairs, plan.pairs));
        let wanted = one_slice(level.size(), whole, (from, pairs), slice);
        let found = lanczos::pairs(level, symbolic, kernel, &shift, wanted, memory, climb.monitor)?;
        let Some(lanczos::Found { values, vectors, .. }) = found else {
            return Ok(Err(slices::not_contained(from, pairs)));
        };
        let Count { shift: at, below, radius } = slices::count_at(level, kernel, &shift);
        let vectors = in_order(vectors, level, order);
        scout.keep_storage(shift.factor);
        Ok(Ok(PartSlice { from, values, vectors, count: PartCount { shift: at, below, radius } }))
    }

    /// Joins all parts, which are asked for one after the other, from 0; what comes out has the certificate of a solve
    /// in one piece.
    ///
    /// # Errors
    /// Those of `part`; [`PartError::Version`], [`PartError::Foreign`] and [`PartError::Damaged`] name the part that
    /// cannot be used; those of [`solve`](super::solve).
    pub fn join(self, part: &mut dyn FnMut(usize) -> Result<Part, PartError>) -> Result<Eigenpairs, PartError> {
        let reason = match self.joined(part)? {
            Ok(pairs) => return Ok(pairs),
            Err(reason) => reason,
        };
        let Climb { mesh, problem, parameters, monitor, .. } = self.climb;
        monitor.note(FALLBACKS, &format!("parts of the spectrum: {reason}"));
        drop(self.finest);
        Ok(climb::solve(mesh, problem, parameters, false, monitor)?)
    }

    /// The same, or why the parts do not make one answer.
    fn joined(
        &self,
        part: &mut dyn FnMut(usize) -> Result<Part, PartError>,
    ) -> Result<Result<Eigenpairs, String>, PartError> {
        let Self { climb, finest, plan, .. } = self;
        let kernel = Kernel::new(&finest.level);
        let places = inverse(&finest.order);
        let mut assembly = Assembly::new(&finest.level, &kernel, plan.pairs, climb.monitor);
        // What the slice before has of the next one.
        let mut above = Vec::new();
        climb.monitor.stage("join");
        for number in 0..plan.parts {
            climb.monitor.checkpoint()?;
            climb.monitor.progress(number as f64 / plan.parts as f64);
            let part = part(number)?;
            self.check(&part, number)?;
            let slices = match part.slices {
                Ok(slices) => slices,
                Err(reason) => return Ok(Err(format!("part {}: {reason}", number + 1))),
            };
            for slice in slices {
                let last = slice.from + slice.values.len() == plan.pairs;
                match append(&mut assembly, slice, &above, &places, last) {
                    Ok(next) => above = next,
                    Err(reason) => return Ok(Err(reason)),
                }
            }
        }
        let Some(Sliced { values, vectors, cuts }) = assembly.finish()? else { return Ok(Err(DEPENDENT.to_owned())) };
        self.proven(&kernel, values, vectors, cuts).map(Ok)
    }

    fn proven(
        &self,
        kernel: &Kernel<'_>,
        values: Vec<f64>,
        vectors: PanelMatrix,
        cuts: Cuts,
    ) -> Result<Eigenpairs, PartError> {
        let task = self.climb.task(&self.finest, kernel, self.goal, self.wanted);
        let (mut pairs, report) = task.solve_or_begin_again(vectors, values, None, Columns::Sliced(cuts))?;
        within(&pairs, self.climb.parameters.wanted)?;
        pairs.levels = vec![report];
        Ok(pairs)
    }

    /// That a part is the one that was asked for, and holds what such a part holds.
    fn check(&self, part: &Part, number: usize) -> Result<(), PartError> {
        let (plan, count) = (&self.plan, number + 1);
        check_plan(part, plan, number)?;
        let damaged = |reason: String| Err(PartError::Damaged { number: count, reason });
        let Ok(slices) = &part.slices else { return Ok(()) };
        if slices.len() != plan.slices {
            return damaged(format!("it has {} slices, not {}", slices.len(), plan.slices));
        }
        for (slice, found) in (number * plan.slices..).zip(slices) {
            if let Err(reason) = check_slice(found, plan, slice) {
                return damaged(format!("slice {}: {reason}", slice + 1));
            }
        }
        Ok(())
    }
}

/// That a part is of a plan, and the one that was asked for.
pub(in crate::spectrum) fn check_plan(part: &Part, plan: &PartPlan, number: usize) -> Result<(), PartError> {
    let count = number + 1;
    if part.plan.version != plan.version {
        let (found, version) = (part.plan.version.clone(), plan.version.clone());
        return Err(PartError::Version { number: count, found, version });
    }
    if let Some(reason) = part.plan.difference(plan) {
        return Err(PartError::Foreign { number: count, reason: reason.to_owned() });
    }
    if part.number != number {
        let reason = format!("it says that it is part {}", part.number.saturating_add(1));
        return Err(PartError::Damaged { number: count, reason });
    }
    Ok(())
}

/// That a slice holds finite numbers for the pairs that it is to hold.
fn check_slice(found: &PartSlice, plan: &PartPlan, slice: usize) -> Result<(), String> {
    let (from, pairs) = plan.pairs_of(slice);
    let PartSlice { values, vectors, count, .. } = found;
    if (found.from, values.len()) != (from, pairs) {
        return Err(format!("it has {} pairs from {} on, not {pairs} from {from} on", values.len(), found.from));
    }
    if (vectors.rows(), vectors.columns()) != (plan.problem.unknowns, pairs) {
        return Err(format!("its vectors are {} × {}", vectors.rows(), vectors.columns()));
    }
    let numbers = vectors.panels().iter().flatten();
    if !values.iter().chain([&count.shift, &count.radius]).chain(numbers).all(|number| number.is_finite()) {
        return Err("some of its numbers are not finite".to_owned());
    }
    if !values.is_sorted() || count.radius < 0.0 {
        return Err("its values are not in order".to_owned());
    }
    let below = count.below.checked_sub(plan.kernel + from).filter(|&below| below <= pairs);
    if below != Some(values.partition_point(|&value| value < count.shift)) {
        return Err(format!("{} eigenvalues below {} are not what it has", count.below, count.shift));
    }
    Ok(())
}

/// Takes up what a slice has beyond those before; gives the values that it shares with the next one, or says why it
/// does not fit.
fn append(
    assembly: &mut Assembly<'_>,
    slice: PartSlice,
    above: &[f64],
    places: &[u32],
    is_last: bool,
) -> Result<Vec<f64>, String> {
    let PartSlice { from, values, vectors, count } = slice;
    let reached = assembly.values.len();
    // Slices hold what their plan says, so that each begins where the one before has not ended.
    let known = reached.saturating_sub(from);
    if !agree(&assembly.values[from.min(reached)..], &values) || !agree(above, &values[known.min(values.len())..]) {
        return Err(format!("slices do not agree on the pairs around {reached}"));
    }
    let end = if is_last { values.len() } else { joint(&values, values.len()) };
    let below = count.below - assembly.kernel.dimension();
    if end <= known || below <= reached || from + end <= below {
        return Err(format!("there is no gap between pairs {reached} and {}", from + values.len()));
    }
    let vectors = vectors.select(&(known..end).collect::<Vec<_>>());
    let vectors = vectors.spread(places.len(), places, &vec![1.0; end - known]);
    let PartCount { shift, below, radius } = count;
    assembly.extend(&values[known..end], vectors, Count { shift, below, radius });
    // Enough for a segment: all that was read would be a second copy of the whole.
    assembly.memory.truncate(2 * TUNING.slices.pairs / PANEL_WIDTH);
    Ok(values[end..].to_vec())
}

/// Whether values of two slices are those of the same pairs.
fn agree(some: &[f64], others: &[f64]) -> bool {
    some.len() <= others.len()
        && some.iter().zip(others).all(|(a, b)| (a - b).abs() <= SAME_VALUES * a.abs().max(b.abs()))
}

/// What a problem says about itself.
pub(in crate::spectrum) fn fingerprint(problem: &EigenProblem) -> Fingerprint {
    let n = problem.size();
    let mut products = [0.0; 6];
    for (pair, x) in products.chunks_exact_mut(2).zip(probes(n)) {
        let with_x = |image: Vec<f64>| image.iter().zip(&x).map(|(a, b)| a * b).sum();
        (pair[0], pair[1]) = (with_x(problem.stiffness.multiply(&x)), with_x(problem.mass.multiply(&x)));
    }
    Fingerprint { unknowns: n, entries: problem.stiffness.entries(), products }
}

/// The random vectors that a problem is multiplied with for its fingerprint.
pub(in crate::spectrum) fn probes(n: usize) -> Vec<Vec<f64>> {
    let mut random = SplitMix64::new(0x5eed);
    (0..3).map(|_| (0..n).map(|_| random.signed_unit()).collect()).collect()
}

/// Columns with their rows in the order of the problem.
fn in_order(vectors: PanelMatrix, level: &Level, order: &[u32]) -> PanelMatrix {
    let columns = vectors.columns();
    vectors.spread(level.size(), order, &vec![1.0; columns])
}

#[cfg(test)]
#[path = "parts_tests.rs"]
mod tests;
