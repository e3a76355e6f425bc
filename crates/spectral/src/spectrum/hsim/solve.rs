//! From a mesh and an operator to certified eigenpairs.

use chladni_algebra::{Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, prolong};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;

use super::certify::{Goal, complete};
use super::deliver::{Delivery, finish, nothing};
use super::dense_pairs::{self, dense_pairs, dense_rows};
use super::hierarchy;
use super::iterate::{Iteration, Plan};
use super::judge::Count;
use super::kernel::Kernel;
use super::krylov;
use super::lanczos;
use super::level::{Level, NO_KERNEL};
use super::offset;
use super::shifts::factor_near;
use super::slices::{self, Cuts};
use super::{Eigenpairs, FALLBACKS, HsimError, HsimParameters, LevelReport, Variant, Wanted, published};
use crate::operator::EigenProblem;
use crate::spectrum::envelope::on_all_vertices;

/// The most Rayleigh–Ritz steps on the mesh.
const MOST_PASSES: usize = 24;

/// From this tolerance on, a replacing step makes two solves instead of one.
const TIGHT: f64 = 1e-4;

/// Computes the lowest eigenpairs of an operator on a mesh, and proves by inertia that none is missing.
///
/// `keep_space` asks for the finest nested space beside the pairs, for compact storage. Stages: `hierarchy`, `iterate`, `certify`, and
/// `repair` where something was missing. The same input and seed give the same answer, up to rounding in the dense eigenproblems
/// where the number of threads differs.
///
/// # Errors
/// [`HsimError`]: parameters out of range, pairs that do not converge or stay missing, cancellation.
pub fn solve(
    mesh: &TriangleMesh,
    problem: &EigenProblem,
    parameters: &HsimParameters,
    keep_space: bool,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    climb_and_solve(mesh, problem, parameters, keep_space, Given::Nothing, monitor)
}

/// The same with a given finest nested space, `n × d` with a row for each unknown, which is kept beside the pairs; the published
/// variant and the baselines make no use of it.
///
/// # Errors
/// As for [`solve`], and a space with the wrong number of rows.
pub fn solve_with_space(
    mesh: &TriangleMesh,
    problem: &EigenProblem,
    parameters: &HsimParameters,
    space: &SparseMatrix<f32>,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    if space.rows() != problem.size() {
        let reason = format!("a space with {} rows is not of a problem with {} unknowns", space.rows(), problem.size());
        return Err(HsimError::Parameter { name: "space", reason });
    }
    climb_and_solve(mesh, problem, parameters, true, Given::Space(space), monitor)
}

/// Whether the lowest `count` pairs of a problem of a size are taken from one dense eigenproblem, without a start.
pub fn is_dense(size: usize, count: usize) -> bool {
    hierarchy::sizes(size, columns(size, count), None).is_empty()
}

/// The same of a problem that may be of many blocks.
pub fn is_dense_by_blocks(problem: &EigenProblem, count: usize) -> bool {
    is_dense(dense_rows(&problem.stiffness, &problem.mass), count)
}

/// The columns that are iterated on for so many pairs of a problem of a size: so many a start should have.
pub fn columns(size: usize, count: usize) -> usize {
    hierarchy::columns(count, size)
}

/// Iterates from given Ritz pairs on the unknowns: `M`-orthonormal columns with their values, ascending. Nothing is taken for a kernel. Meant for
/// operators whose unknowns are no values at vertices, so that no hierarchy can be built on them; the variant must be ours and the pairs be
/// wanted by number.
///
/// # Errors
/// As for [`solve`], and a start that does not fit.
pub fn solve_from(
    mesh: &TriangleMesh,
    problem: &EigenProblem,
    parameters: &HsimParameters,
    (vectors, values): (PanelMatrix, Vec<f64>),
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    let few = matches!(parameters.wanted, Wanted::Count(count) if count > vectors.columns());
    if vectors.rows() != problem.size() || vectors.columns() != values.len() || few {
        let (rows, columns) = (vectors.rows(), vectors.columns());
        let reason = format!("{columns} columns with {rows} rows are no start for these pairs");
        return Err(HsimError::Parameter { name: "start", reason });
    }
    climb_and_solve(mesh, problem, parameters, false, Given::Start(vectors, values), monitor)
}

/// What a caller brings along.
enum Given<'a> {
    Nothing,
    /// The finest nested space.
    Space(&'a SparseMatrix<f32>),
    /// Ritz pairs on the unknowns.
    Start(PanelMatrix, Vec<f64>),
}

fn climb_and_solve(
    mesh: &TriangleMesh,
    problem: &EigenProblem,
    parameters: &HsimParameters,
    keep_space: bool,
    given: Given<'_>,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    parameters.check()?;
    let (mut base, offset) = base_level(mesh, problem, !matches!(given, Given::Start(..)))?;
    let n = base.size();
    let (given, begun) = match given {
        Given::Nothing => (None, None),
        Given::Space(space) => (Some(space), None),
        Given::Start(vectors, values) => {
            base.component.fill(NO_KERNEL);
            (None, Some((vectors, values)))
        }
    };
    if let Wanted::Count(count) = parameters.wanted
        && count > n
    {
        return Err(HsimError::Count { wanted: count, most: n });
    }
    monitor.stage("hierarchy");
    monitor.checkpoint()?;
    let known =
        base.component.iter().filter(|&&component| component != NO_KERNEL).max().map_or(0, |&most| most as usize + 1);
    // One pair above the kernel tells where the kernel ends; where a potential acts on other components, all may lie below it.
    let mixed = base.component.contains(&NO_KERNEL);
    let nontrivial = |wanted: usize| wanted.saturating_sub(if mixed { 0 } else { known }).max(1).min(n - known);
    let sliced = parameters.variant == Variant::Sliced;
    let sigma = parameters.sigma.unwrap_or(hierarchy::SIGMA);
    // Where a Krylov space costs less it takes the place of a hierarchy, unless levels or their space are asked for.
    let krylov = |wanted: usize| {
        let chosen = parameters.levels.is_none() && !keep_space && sliced && begun.is_none() && given.is_none();
        // What is small, or of small pieces, is solved densely.
        let q = hierarchy::columns(nontrivial(wanted), n - known);
        let dense = || hierarchy::sizes(dense_rows(&base.stiffness, &base.mass), q, None).is_empty();
        let (pairs, tolerance) = (nontrivial(wanted), parameters.tolerance);
        let pays = || lanczos::pays(n, pairs, tolerance) || slices::pays(n, pairs, tolerance);
        chosen && (known == 0 || !mixed) && pays() && !dense()
    };
    let climb = |q: usize| {
        let mut sizes = hierarchy::sizes(n, q, parameters.levels);
        // Many small pieces are solved densely, however many there are.
        let rows = || dense_rows(&base.stiffness, &base.mass);
        let pieces = || parameters.levels.is_none() && hierarchy::sizes(rows(), q, None).is_empty();
        if q == 0 || sizes.is_empty() || !sliced || begun.is_some() || given.is_none() && pieces() {
            return Ok(None);
        }
        if let Some(given) = given {
            // Below a given space there is one more level, unless it is small enough to be solved densely.
            sizes.truncate(1);
            if given.columns() <= q {
                return Ok(None);
            } else if given.columns() < 2 * sizes[0] {
                sizes[0] = given.columns();
            } else {
                sizes.push(given.columns());
            }
        }
        hierarchy::start(&base, &sizes, q, sigma, parameters.seed, given, monitor).map(Some)
    };
    // Without a bound, the number of columns is known, and the hierarchy needs no factors of the mesh.
    let (finest, start) = match parameters.wanted {
        Wanted::Count(count) => {
            let q = hierarchy::columns(nontrivial(count), n - known);
            let climb = || if krylov(count) { Ok(None) } else { climb(q) };
            rayon::join(|| Finest::new(&base, q, monitor), climb)
        }
        Wanted::Below { .. } | Wanted::Between { .. } => {
            (Finest::new(&base, hierarchy::columns(100, n), monitor), Ok(None))
        }
    };
    let finest = finest?;
    let (goal, wanted) = match parameters.wanted {
        Wanted::Count(count) => (Goal::Count(count), count),
        Wanted::Below { bound, most } | Wanted::Between { to: bound, most, .. } => {
            let bound = bound * problem.area - offset;
            match estimate(&finest, bound, known)? {
                Estimate::Nothing(count) => return Ok(nothing(mesh, problem, n, count, offset)),
                Estimate::About(wanted) if wanted > most.saturating_add(wanted.min(SLACK)) => {
                    return Err(HsimError::Count { wanted, most });
                }
                Estimate::About(wanted) => (Goal::Below(bound), wanted),
            }
        }
    };
    let kernel = Kernel::new(&finest.level);
    let krylov = krylov(wanted);
    let nontrivial = nontrivial(wanted);
    let task = Task { mesh, problem, parameters, finest: &finest, kernel: &kernel, goal, nontrivial, offset, monitor };
    let found = if krylov { task.krylov_start()? } else { None };
    if let Some(found) = found {
        let (mut pairs, report) = task.solve_or_begin_again(found.vectors, found.values, None, found.columns)?;
        within(&pairs, parameters.wanted)?;
        pairs.levels = vec![report];
        return Ok(pairs);
    }
    let start = match parameters.wanted {
        Wanted::Count(_) if !krylov => start?,
        _ => climb(hierarchy::columns(nontrivial, n - known))?,
    };
    let mut reports = Vec::new();
    let mut space = None;
    let (vectors, values, plain) = match (parameters.variant, start) {
        _ if begun.is_some() => {
            let (vectors, values) = begun.unwrap_or_default();
            let places = super::level::inverse(&finest.order);
            (vectors.spread(n, &places, &vec![1.0; values.len()]), values, None)
        }
        (Variant::Sliced, Some(start)) => {
            reports = start.reports;
            let vectors = prolong(&start.space.select_rows(&finest.order), &start.vectors);
            space = Some(start.space);
            (vectors, start.values, None)
        }
        (Variant::Sliced, None) if known == n => (PanelMatrix::zeros(n, 0), Vec::new(), None),
        (Variant::Sliced, None) => {
            let (values, vectors) = dense_pairs(&finest.level, hierarchy::columns(nontrivial, n - known), monitor)?;
            (vectors, values, None)
        }
        (Variant::Published, _) => {
            let q = published::columns(nontrivial, parameters.subspace_factor, n - known);
            let places = finest.places(mesh.positions.len(), problem);
            let start = published::start(mesh, &finest.level, &places, nontrivial, q, parameters, monitor)?;
            let shift = published::shift(&start.values, nontrivial, parameters.shift_ratio);
            reports = start.reports;
            space = start.space.map(|space| space.select_rows(&super::level::inverse(&finest.order)));
            (start.vectors, start.values, Some(shift))
        }
        (variant @ (Variant::Random | Variant::Bathe), _) => {
            let q = published::columns(nontrivial, parameters.subspace_factor, n - known);
            let (vectors, values) = published::plain(&finest.level, q, variant, parameters.seed);
            (vectors, values, Some(published::shift(&[], nontrivial, 0.0)))
        }
    };
    let space = match (keep_space, given.cloned().or(space)) {
        (false, _) => None,
        (true, space) => {
            let space = space.unwrap_or_else(|| SparseMatrix::identity(n));
            Some(match &problem.unknowns {
                Some(unknowns) => on_all_vertices(space, unknowns, mesh.positions.len()),
                None => space,
            })
        }
    };
    let columns = if reports.is_empty() { Columns::Solved } else { Columns::Rough };
    let (mut pairs, report) = task.solve_or_begin_again(vectors, values, plain, columns)?;
    within(&pairs, parameters.wanted)?;
    reports.push(report);
    (pairs.levels, pairs.space) = (reports, space);
    Ok(pairs)
}

/// Refuses more pairs than an interval may have.
pub(super) fn within(pairs: &Eigenpairs, wanted: Wanted) -> Result<(), HsimError> {
    let found = pairs.first + pairs.values.len();
    match wanted {
        Wanted::Below { most, .. } | Wanted::Between { most, .. } if found > most => {
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
pub(super) const SLACK: usize = 32;

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
    fn krylov_start(&self) -> Result<Option<Begun>, HsimError> {
        let Self { finest: Finest { level, symbolic, .. }, kernel, monitor, parameters, nontrivial, .. } = *self;
        monitor.stage("iterate");
        let columns = hierarchy::columns(nontrivial, level.size() - kernel.dimension());
        let (tolerance, seed) = (parameters.tolerance, parameters.seed);
        let wanted = lanczos::Wanted::lowest(level.size(), nontrivial, columns, tolerance, seed);
        if slices::pays(level.size(), nontrivial, tolerance) {
            // Some beyond the wanted ones, among which there is a gap to count in.
            let pairs = (nontrivial + BEYOND).min(columns);
            let wanted = lanczos::Wanted { pairs, ..wanted };
            let sliced = slices::start(level, symbolic, kernel, wanted, slices::SLICE, monitor)?;
            if let Some(slices::Sliced { values, vectors, cuts }) = sliced {
                return Ok(Some(Begun { values, vectors, columns: Columns::Sliced(cuts) }));
            }
        }
        if !lanczos::pays(level.size(), nontrivial, tolerance) {
            return Ok(None);
        }
        let found = lanczos::start(level, symbolic, kernel, wanted, monitor)?;
        if found.is_none() {
            monitor.note(FALLBACKS, "a single Krylov space: it did not contain the pairs");
        }
        Ok(found.map(|lanczos::Found { values, vectors }| Begun { values, vectors, columns: Columns::Ritz }))
    }

    /// As [`Task::solve`]; where that leads nowhere, from all pairs of a dense solve if the problem is small, else from random vectors. A start whose coarse
    /// levels miss what the mesh has, as those of very thin triangles do, may leave some eigenvectors to several slices and others to none.
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
        if let Some((values, vectors)) = dense_pairs::instead(&finest.level, columns, kernel.dimension(), monitor)? {
            return self.solve(vectors, values, None, Columns::Solved);
        }
        if plain.is_some() {
            // A baseline is what it is.
            return Err(error);
        }
        monitor.stage("repair");
        let of = (&finest.level, &finest.symbolic);
        let (values, vectors) = krylov::afresh(of, kernel, columns, self.parameters.seed.wrapping_add(1), monitor)?;
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
            panels_per_shift: if n < MANY_VERTICES { 1 } else { 2 },
            solves: if parameters.tolerance < TIGHT { 2 } else { 1 },
            most_passes: MOST_PASSES,
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
            from: match parameters.wanted {
                Wanted::Between { from, .. } => Some(from * self.problem.area - self.offset),
                _ => None,
            },
            decide: false,
        };
        let mut attempt = 0;
        loop {
            plan.most_passes = iteration.passes + MOST_PASSES;
            let count = match complete(&mut iteration, self.goal, &plan, parameters.seed) {
                // What was asked beyond the tolerance is as close as it gets.
                Err(HsimError::Floor { .. } | HsimError::NotConverged { .. })
                    if plan.tolerance < parameters.tolerance =>
                {
                    (plan.tolerance, delivery.decide, attempt) = (parameters.tolerance, true, ATTEMPTS);
                    continue;
                }
                count => count?,
            };
            match finish(&mut iteration, count, &delivery, monitor) {
                Ok(Some(pairs)) => {
                    let (iterations, shifts) = (iteration.passes, iteration.inertia.len());
                    return Ok((pairs, LevelReport { dimension: n, iterations, shifts }));
                }
                Ok(None) if attempt < ATTEMPTS => plan.tolerance = (TIGHTER * plan.tolerance).max(TIGHTEST),
                Ok(None) => delivery.decide = true,
                // Columns that came close to the tolerance may lose it when they are made orthonormal; a count needs values clear of its shift.
                Err(error) if attempt < ATTEMPTS && error.is_of_the_iteration() => plan.tolerance *= 0.1,
                Err(error) => return Err(error),
            }
            attempt += 1;
        }
    }
}

/// Pairs beyond the wanted ones that slices have to hold.
const BEYOND: usize = 12;

/// How much closer pairs have to come where it is open on which side of a bound they lie, and how close.
const TIGHTER: f64 = 1e-3;
const TIGHTEST: f64 = 1e-11;

/// How often pairs that were refused by the judgement are improved.
const ATTEMPTS: usize = 4;

/// Above this size factors in an order of minimum degree cost more than it takes to find a better one, even if there are only a few.
pub(super) const LARGE: usize = 1_000_000;

/// Above this size a factor costs more than the solves of a few panels.
const MANY_VERTICES: usize = 60_000;

/// The problem as a level, rows in their own order; and what was taken off its eigenvalues, which is nothing where that is not wanted.
fn base_level(mesh: &TriangleMesh, problem: &EigenProblem, shiftable: bool) -> Result<(Level, f64), HsimError> {
    let n = problem.size();
    let vertices = problem.unknowns.as_ref().map_or(mesh.positions.len(), Vec::len);
    if vertices != n || problem.mass.size() != n {
        return Err(HsimError::Numerical(format!("a problem of size {n} is not of a mesh with {vertices} unknowns")));
    }
    let (origin, scale) = (mesh.positions.first().copied().unwrap_or_default(), problem.area.sqrt().recip());
    let scaled = |vertex: usize| {
        let position = mesh.positions.get(vertex).copied().unwrap_or(origin);
        std::array::from_fn(|k| (position[k] - origin[k]) * scale)
    };
    let positions = match &problem.unknowns {
        None => (0..n).map(scaled).collect(),
        Some(unknowns) => unknowns.iter().map(|&vertex| scaled(vertex as usize)).collect(),
    };
    // Who gives vectors to start from has shifted the problem on purpose, and gives values that belong to it.
    let (mut stiffness, mut offset) =
        if shiftable { offset::taken_off(&problem.stiffness, &problem.mass) } else { (problem.stiffness.clone(), 0.0) };
    let mut component = offset::components(&stiffness, &problem.mass, offset);
    if offset != 0.0 && component.last().is_some_and(|&last| last as usize + 1 == n) {
        // Nothing but a kernel would be left to iterate on.
        (stiffness, offset) = (problem.stiffness.clone(), 0.0);
        component = offset::components(&stiffness, &problem.mass, offset);
    }
    Ok((Level { stiffness, mass: problem.mass.clone(), positions, component }, offset))
}

/// The finest level in the order in which it is factored.
pub(super) struct Finest {
    /// Row `k` is unknown `order[k]`.
    pub order: Vec<u32>,
    pub level: Level,
    pub symbolic: SymbolicFactor,
}

impl Finest {
    fn new(base: &Level, columns: usize, monitor: &dyn Monitor) -> Result<Self, HsimError> {
        monitor.checkpoint()?;
        // Nested dissection takes longer to find and saves a third of every factor and solve.
        let work = base.size() as f64 * columns as f64;
        let ordering = if (columns >= 128 && work > 3e7) || base.size() > LARGE {
            Ordering::NestedDissection
        } else {
            Ordering::Amd
        };
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
    fn places(&self, vertices: usize, problem: &EigenProblem) -> Vec<Option<u32>> {
        let mut places = vec![None; vertices];
        for (row, vertex) in self.vertices(problem).into_iter().enumerate() {
            places[vertex as usize] = Some(row as u32);
        }
        places
    }
}

/// What a factor at a bound says about the eigenvalues below it.
pub(super) enum Estimate {
    /// There are none, as is proven by this count.
    Nothing(Count),
    /// There are about so many, at least one.
    About(usize),
}

/// `kernel` is the dimension of the kernel that is known exactly.
pub(super) fn estimate(finest: &Finest, bound: f64, kernel: usize) -> Result<Estimate, HsimError> {
    let (level, spread) = (&finest.level, finest.level.spread());
    let count = |at: f64| -> Result<Count, HsimError> {
        let (shift, factor) = factor_near(level, &finest.symbolic, at, spread, Vec::new())?;
        let radius = factor.uncertainty(&level.stiffness, &level.mass, shift);
        Ok(Count { shift, below: factor.eigenvalues_below(), radius })
    };
    let at = count(bound)?;
    if at.below == 0 {
        let above = count(bound + 3.0 * at.radius.min(spread))?;
        if above.below == 0 && above.shift - above.radius >= bound {
            return Ok(Estimate::Nothing(above));
        }
    }
    // Next to zero, rounding may count the kernel, which is known to lie at zero and not below a bound that is no higher.
    if bound <= 0.0 && bound >= -3.0 * at.radius {
        let (below, above) = (count(-6.0 * at.radius)?, count(6.0 * at.radius)?);
        if below.below == 0 && above.below == kernel {
            return Ok(Estimate::Nothing(below));
        }
    }
    Ok(Estimate::About(at.below.max(1)))
}
