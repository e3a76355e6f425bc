//! The iteration on the mesh from whatever start, until what was found is proven.

use chladni_algebra::{Ordering, PanelMatrix, SymbolicFactor};
use chladni_base::Monitor;
use chladni_base::notes::FALLBACKS;
use chladni_mesh::TriangleMesh;

use super::certify::{Goal, complete};
use super::deliver::{Delivery, finish};
use super::dense_pairs;
use super::hierarchy;
use super::iterate::{Iteration, Plan};
use super::judge::Count;
use super::kernel::Kernel;
use super::krylov;
use super::lanczos;
use super::level::Level;
use super::outliers;
use super::scout::Scout;
use super::segments::{Cuts, Sliced};
use super::shifts::count_near;
use super::slices;
use super::tuning::TUNING;
use super::{Eigenpairs, HsimError, HsimParameters, LevelReport, Selection, published};
use crate::operator::EigenProblem;

/// Refuses more pairs than an interval may have.
pub(super) fn within(pairs: &Eigenpairs, wanted: Selection) -> Result<(), HsimError> {
    let found = pairs.first + pairs.values.len();
    match wanted {
        Selection::Below { most, .. } | Selection::Between { most, .. } if found > most => {
            Err(HsimError::Count { wanted: found, most })
        }
        _ => Ok(()),
    }
}

/// What is known of the columns of a start.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Columns {
    /// Nothing: they are no more than a start.
    Rough,
    /// They may have converged.
    Solved,
    /// The same, and they are orthonormal Ritz vectors of their span.
    Ritz,
    /// The same of the columns of each segment; all are orthonormal.
    Sliced(Cuts),
}

/// Ritz pairs to iterate from.
pub(super) struct Begun {
    /// Ascending.
    pub values: Vec<f64>,
    pub vectors: PanelMatrix,
    pub columns: Columns,
}

/// A count below a bound may be off by so many where eigenvalues lie next to it.
const SLACK: usize = 32;

/// What is iterated on, from whatever start.
pub(super) struct Task<'a> {
    pub mesh: &'a TriangleMesh,
    pub problem: &'a EigenProblem,
    pub parameters: &'a HsimParameters,
    pub finest: &'a Finest,
    pub kernel: &'a Kernel<'a>,
    pub goal: Goal,
    /// The pairs to converge, those of the kernel left out.
    pub nontrivial: usize,
    pub offset: f64,
    pub monitor: &'a dyn Monitor,
}

impl Task<'_> {
    /// Pairs of a Krylov space, where it holds them.
    pub fn krylov_start(&self) -> Result<Option<Begun>, HsimError> {
        let Self { finest: Finest { level, symbolic, .. }, kernel, monitor, parameters, nontrivial, .. } = *self;
        monitor.stage("iterate");
        let columns = hierarchy::columns(nontrivial, level.size() - kernel.dimension());
        let (tolerance, seed) = (parameters.tolerance, parameters.seed);
        let wanted = lanczos::KrylovRequest::lowest(level.size(), nontrivial, columns, tolerance, seed);
        if slices::is_cheaper(level.size(), nontrivial, tolerance) {
            // Some beyond the wanted ones, among which there is a gap to count in.
            let pairs = (nontrivial + TUNING.slices.beyond).min(columns);
            let wanted = lanczos::KrylovRequest { pairs, ..wanted };
            let sliced = slices::start(level, symbolic, kernel, wanted, TUNING.slices.pairs, monitor)?;
            if let Some(Sliced { values, vectors, cuts }) = sliced {
                return Ok(Some(Begun { values, vectors, columns: Columns::Sliced(cuts) }));
            }
        }
        if !lanczos::is_cheaper(level.size(), nontrivial, tolerance) {
            return Ok(None);
        }
        let found = if kernel.dimension() == 0 {
            let mut scout = Scout::new(level, symbolic, monitor);
            outliers::start((level, symbolic), kernel, &mut scout, wanted, monitor)?
        } else {
            lanczos::start(level, symbolic, kernel, wanted, monitor)?.map(|found| (found, Columns::Ritz))
        };
        if found.is_none() {
            monitor.note(FALLBACKS, "a single Krylov space: it did not contain the pairs");
        }
        Ok(found.map(|(lanczos::KrylovPairs { values, vectors, .. }, columns)| Begun { values, vectors, columns }))
    }

    /// As [`Task::solve`]; where that leads nowhere, from all pairs of a dense solve if the problem is small, else from
    /// random vectors. A start whose coarse levels miss what the mesh has, as those of very thin triangles do, may
    /// leave some eigenvectors to several slices and others to none.
    pub fn solve_or_begin_again(
        &self,
        vectors: PanelMatrix,
        values: Vec<f64>,
        plain: Option<f64>,
        columns: Columns,
    ) -> Result<(Eigenpairs, LevelReport), HsimError> {
        let Self { finest, kernel, monitor, .. } = *self;
        let error = match self.solve(vectors, values, plain, columns) {
            Err(error) if error.is_of_the_iteration() => error,
            solved => return solved,
        };
        monitor.note(FALLBACKS, &format!("first start: {error}"));
        let columns = hierarchy::columns(self.nontrivial, finest.level.size() - kernel.dimension());
        if let Some((values, vectors)) =
            dense_pairs::dense_fallback(&finest.level, columns, kernel.dimension(), monitor)?
        {
            return self.solve(vectors, values, None, Columns::Solved);
        }
        if plain.is_some() {
            // A baseline is what it is.
            return Err(error);
        }
        monitor.stage("repair");
        let of = (&finest.level, &finest.symbolic);
        // Deep wells of a potential keep levels from what lies above them. A pencil without a surface has begun that
        // way.
        if kernel.dimension() == 0 && !finest.level.positions.is_empty() {
            let HsimParameters { tolerance, seed, .. } = *self.parameters;
            let wanted = lanczos::KrylovRequest::lowest(finest.level.size(), self.nontrivial, columns, tolerance, seed);
            let mut scout = Scout::new(&finest.level, &finest.symbolic, monitor);
            let found = outliers::start(of, kernel, &mut scout, wanted, monitor)?;
            let solved = found.map(|(found, columns)| self.solve(found.vectors, found.values, None, columns));
            match solved {
                Some(Err(error)) if error.is_of_the_iteration() => {
                    monitor.note(FALLBACKS, &format!("spaces of several shifts: {error}"));
                }
                Some(solved) => return solved,
                None => {}
            }
        }
        let (values, vectors) =
            krylov::start_without_guess(of, kernel, columns, self.parameters.seed.wrapping_add(1), monitor)?;
        self.solve(vectors, values, None, Columns::Rough)
    }

    /// Iterates from a start, plainly with the given shift or slice by slice, until what was found is proven.
    pub fn solve(
        &self,
        vectors: PanelMatrix,
        values: Vec<f64>,
        plain: Option<f64>,
        columns: Columns,
    ) -> Result<(Eigenpairs, LevelReport), HsimError> {
        let Self { finest, kernel, monitor, parameters, .. } = *self;
        let n = finest.level.size();
        let mut iteration = Iteration::new(&finest.level, &finest.symbolic, kernel, vectors, values, monitor);
        iteration.offset = self.offset;
        iteration.ritz = matches!(columns, Columns::Ritz | Columns::Sliced(_));
        let mut plan = Plan {
            wanted: self.nontrivial.min(iteration.values.len()),
            tolerance: parameters.tolerance,
            panels_per_shift: if n < TUNING.iteration.many_vertices { 1 } else { 2 },
            solves: if parameters.tolerance < TUNING.iteration.tight { 2 } else { 1 },
            most_passes: TUNING.iteration.most_passes,
        };
        monitor.stage("iterate");
        match plain {
            Some(shift) => {
                published::subspace_iteration(&mut iteration, shift, self.nontrivial, parameters.tolerance)?;
                iteration.require(&plan)?;
            }
            None if columns != Columns::Rough => iteration.measure()?,
            None => {}
        }
        if let Columns::Sliced(cuts) = columns {
            iteration.inertia.extend_from_slice(&cuts.counts);
            iteration.cuts = Some(cuts);
        }
        if plain.is_none() {
            iteration.refuse_below_floor(plan.wanted, parameters.tolerance)?;
        }
        let vertices = finest.vertices(self.problem);
        let mut delivery = Delivery {
            mesh: self.mesh,
            problem: self.problem,
            vertices: &vertices,
            goal: self.goal,
            tolerance: parameters.tolerance,
            offset: self.offset,
            from: match parameters.selection {
                Selection::Between { from, .. } => Some(from * self.problem.area - self.offset),
                _ => None,
            },
            decide: false,
        };
        let mut attempt = 0;
        loop {
            plan.most_passes = iteration.passes + TUNING.iteration.most_passes;
            let count = match complete(&mut iteration, self.goal, &plan, parameters.seed) {
                // What was asked beyond the tolerance is as close as it gets.
                Err(HsimError::Floor { .. } | HsimError::NotConverged { .. })
                    if plan.tolerance < parameters.tolerance =>
                {
                    (plan.tolerance, delivery.decide, attempt) = (parameters.tolerance, true, TUNING.proof.attempts);
                    continue;
                }
                count => count?,
            };
            match finish(&mut iteration, count, &delivery, monitor) {
                Ok(Some(pairs)) => {
                    let (iterations, shifts) = (iteration.passes, iteration.inertia.len());
                    return Ok((pairs, LevelReport { dimension: n, iterations, shifts }));
                }
                Ok(None) if attempt < TUNING.proof.attempts => {
                    plan.tolerance = (TIGHTER * plan.tolerance).max(TIGHTEST)
                }
                Ok(None) => delivery.decide = true,
                // Columns that came close to the tolerance may lose it when they are made orthonormal; a count needs
                // values clear of its shift.
                Err(error) if attempt < TUNING.proof.attempts && error.is_of_the_iteration() => plan.tolerance *= 0.1,
                Err(error) => return Err(error),
            }
            attempt += 1;
        }
    }
}

/// How much closer pairs have to come where it is open on which side of a bound they lie, and how close.
const TIGHTER: f64 = 1e-3;
const TIGHTEST: f64 = 1e-11;

/// The finest level in the order in which it is factored.
pub(super) struct Finest {
    /// Row `k` is unknown `order[k]`.
    pub order: Vec<u32>,
    pub level: Level,
    pub symbolic: SymbolicFactor,
}

impl Finest {
    pub fn new(base: &Level, columns: usize, monitor: &dyn Monitor) -> Result<Self, HsimError> {
        monitor.checkpoint()?;
        let numbers = base.size() as f64 * columns as f64;
        let pays = columns >= TUNING.order.columns && numbers > TUNING.order.numbers;
        let ordering =
            if pays || base.size() > TUNING.order.large { Ordering::NestedDissection } else { Ordering::Amd };
        let order = base.factor_order(ordering)?;
        monitor.checkpoint()?;
        let level = base.in_order(&order);
        let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass)?.within(1, monitor)?;
        Ok(Self { order, level, symbolic })
    }

    /// The vertex of each row.
    fn vertices(&self, problem: &EigenProblem) -> Vec<u32> {
        match &problem.unknowns {
            None => self.order.clone(),
            Some(unknowns) => self.order.iter().map(|&unknown| unknowns[unknown as usize]).collect(),
        }
    }

    /// The row of each vertex, if it is an unknown.
    pub fn places(&self, vertices: usize, problem: &EigenProblem) -> Vec<Option<u32>> {
        let mut places = vec![None; vertices];
        for (row, vertex) in self.vertices(problem).into_iter().enumerate() {
            places[vertex as usize] = Some(row as u32);
        }
        places
    }
}

/// What is to be found.
pub(super) enum Aim {
    /// No eigenvalue lies below the bound, as is proven by this count.
    Nothing(Count),
    /// Pairs, about so many.
    Pairs(Goal, usize),
}

/// What is wanted of a level; `of` turns a bound as it was asked for into one on the eigenvalues of the level, `kernel`
/// is the dimension of the kernel that is known.
///
/// # Errors
/// [`HsimError::Count`], where far more pairs lie below a bound than may be delivered; those of a factor.
pub(super) fn aim(
    finest: &Finest,
    wanted: Selection,
    of: impl Fn(f64) -> f64,
    kernel: usize,
    monitor: &dyn Monitor,
) -> Result<Aim, HsimError> {
    let (bound, most) = match wanted {
        Selection::Count(count) => return Ok(Aim::Pairs(Goal::Count(count), count)),
        Selection::Below { bound, most } | Selection::Between { to: bound, most, .. } => (of(bound), most),
    };
    match estimate(finest, bound, kernel, monitor)? {
        Estimate::Nothing(count) => Ok(Aim::Nothing(count)),
        Estimate::About(wanted) if wanted > most.saturating_add(wanted.min(SLACK)) => {
            Err(HsimError::Count { wanted, most })
        }
        Estimate::About(wanted) => Ok(Aim::Pairs(Goal::Below(bound), wanted)),
    }
}

/// What a factor at a bound says about the eigenvalues below it.
enum Estimate {
    /// There are none, as is proven by this count.
    Nothing(Count),
    /// There are about so many, at least one.
    About(usize),
}

/// `kernel` is the dimension of the kernel that is known exactly.
fn estimate(finest: &Finest, bound: f64, kernel: usize, monitor: &dyn Monitor) -> Result<Estimate, HsimError> {
    let (level, spread) = (&finest.level, finest.level.spread());
    let count = |at: f64| count_near(level, &finest.symbolic, at, spread, monitor);
    let at = count(bound)?;
    if at.below == 0 {
        let above = count(bound + 3.0 * at.radius.min(spread))?;
        if above.below == 0 && above.shift - above.radius >= bound {
            return Ok(Estimate::Nothing(above));
        }
    }
    // Next to zero, rounding may count the kernel, which is known to lie at zero and not below a bound that is no
    // higher.
    if bound <= 0.0 && bound >= -3.0 * at.radius {
        let (below, above) = (count(-6.0 * at.radius)?, count(6.0 * at.radius)?);
        if below.below == 0 && above.below == kernel {
            return Ok(Estimate::Nothing(below));
        }
    }
    Ok(Estimate::About(at.below.max(1)))
}
