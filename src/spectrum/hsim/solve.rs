//! From a mesh and an operator to certified eigenpairs.

use super::certify::{Goal, complete};
use super::hierarchy::{self, dense, densely};
use super::iterate::{Iteration, KERNEL, Plan, factor_near};
use super::kernel::{Kernel, components};
use super::level::{Level, NO_KERNEL};
use super::{Eigenpairs, HsimError, HsimParameters, InertiaCount, LevelReport, Variant, Wanted, published};
use crate::algebra::{MassMatrix, Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, gram, prolong};
use crate::mesh::TriangleMesh;
use crate::monitor::Monitor;
use crate::operator::EigenProblem;
use crate::spectrum::envelope::on_all_vertices;

/// The most Rayleigh–Ritz steps on the mesh.
const MOST_PASSES: usize = 24;

/// From this tolerance on, a replacing step makes two solves instead of one.
const TIGHT: f64 = 1e-4;

/// Columns are made orthonormal again beyond this defect.
const LARGEST_DEFECT: f64 = 1e-9;

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
    let mut base = base_level(mesh, problem)?;
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
    let beside = |wanted: usize| wanted.saturating_sub(if mixed { 0 } else { known }).max(1).min(n - known);
    let sliced = parameters.variant == Variant::Sliced;
    let sigma = parameters.sigma.unwrap_or(hierarchy::SIGMA);
    let climb = |q: usize| {
        let mut sizes = hierarchy::sizes(n, q, parameters.levels);
        if sizes.is_empty() || !sliced || begun.is_some() {
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
            let q = hierarchy::columns(beside(count), n - known);
            rayon::join(|| Finest::new(&base, q, monitor), || climb(q))
        }
        Wanted::Below { .. } => (Finest::new(&base, hierarchy::columns(100, n), monitor), Ok(None)),
    };
    let finest = finest?;
    let (goal, wanted) = goal(&finest, parameters, problem.area)?;
    if wanted == 0 {
        return Ok(nothing(mesh, n, goal, problem.area));
    }
    let kernel = Kernel::new(&finest.level);
    let beside = beside(wanted);
    let goal = match goal {
        Goal::Count(_) => Goal::Count(beside),
        below => below,
    };
    let start = match parameters.wanted {
        Wanted::Count(_) => start?,
        Wanted::Below { .. } => climb(hierarchy::columns(beside, n - known))?,
    };
    let mut reports = Vec::new();
    let mut space = None;
    let columns = |iteration: &mut Iteration<'_>| -> Result<(), HsimError> {
        monitor.stage("iterate");
        iteration.measure()
    };
    let (vectors, values, plain) = match (parameters.variant, start) {
        _ if begun.is_some() => {
            let (vectors, values) = begun.unwrap_or_default();
            let places = super::level::inverse(&finest.order);
            (vectors.spread(n, &places, &vec![1.0; values.len()]), values, None)
        }
        (Variant::Sliced, Some(start)) => {
            reports = start.reports;
            let vectors = prolong(&rows_in_order(&start.space, &finest.order), &start.vectors);
            space = Some(start.space);
            (vectors, start.values, None)
        }
        (Variant::Sliced, None) => {
            let (stiffness, mass) = dense(&finest.level);
            let (values, vectors) = densely(stiffness, mass, known, hierarchy::columns(beside, n - known), monitor)?;
            (vectors, values, None)
        }
        (Variant::Published, _) => {
            let q = published::columns(beside, parameters.subspace_factor, n - known);
            let places = finest.places(mesh.positions.len(), problem);
            let start = published::start(mesh, &finest.level, &places, beside, q, parameters, monitor)?;
            let shift = published::shift(&start.values, beside, parameters.shift_ratio);
            reports = start.reports;
            space = start.space.map(|space| rows_in_order(&space, &super::level::inverse(&finest.order)));
            (start.vectors, start.values, Some(shift))
        }
        (variant @ (Variant::Random | Variant::Bathe), _) => {
            let q = published::columns(beside, parameters.subspace_factor, n - known);
            let (vectors, values) = published::plain(&finest.level, q, variant, parameters.seed);
            (vectors, values, Some(published::shift(&[], beside, 0.0)))
        }
    };
    let small = vectors.columns() == n - known;
    let mut iteration = Iteration::new(&finest.level, &finest.symbolic, &kernel, vectors, values, monitor);
    let plan = Plan {
        wanted: beside,
        tolerance: parameters.tolerance,
        panels_per_shift: if n < MANY_VERTICES { 1 } else { 2 },
        solves: if parameters.tolerance < TIGHT { 2 } else { 1 },
        most_passes: MOST_PASSES,
    };
    monitor.stage("iterate");
    match plain {
        Some(shift) => {
            published::subspace_iteration(&mut iteration, shift, beside, parameters.tolerance)?;
            iteration.require(&plan)?;
        }
        None if reports.is_empty() || small => columns(&mut iteration)?,
        None => {}
    }
    let plan = Plan { most_passes: iteration.passes + MOST_PASSES, ..plan };
    let (shift, below) = complete(&mut iteration, goal, &plan, parameters.seed)?;
    reports.push(LevelReport { dimension: n, iterations: iteration.passes, shifts: iteration.inertia.len() });
    let space = match (keep_space, given.cloned().or(space)) {
        (false, _) => None,
        (true, space) => {
            let space = space.unwrap_or_else(|| identity(n));
            Some(match &problem.unknowns {
                Some(unknowns) => on_all_vertices(space, unknowns, mesh.positions.len()),
                None => space,
            })
        }
    };
    let places = finest.vertices(problem);
    let mut pairs = finish(iteration, mesh.positions.len(), &places, (shift, below), wanted, problem, monitor)?;
    (pairs.levels, pairs.space) = (reports, space);
    Ok(pairs)
}

/// Above this size factors in an order of minimum degree cost more than it takes to find a better one, even if there are only a few.
const LARGE: usize = 1_000_000;

/// Above this size a factor costs more than the solves of a few panels.
const MANY_VERTICES: usize = 60_000;

/// The problem as a level, rows in their own order.
fn base_level(mesh: &TriangleMesh, problem: &EigenProblem) -> Result<Level, HsimError> {
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
    let component = components(&problem.stiffness);
    Ok(Level { stiffness: problem.stiffness.clone(), mass: problem.mass.clone(), positions, component })
}

/// The finest level in the order in which it is factored.
struct Finest {
    /// Row `k` is unknown `order[k]`.
    order: Vec<u32>,
    level: Level,
    symbolic: SymbolicFactor,
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
        let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass)?;
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

/// How many pairs are wanted, and what has to be proven.
fn goal(finest: &Finest, parameters: &HsimParameters, area: f64) -> Result<(Goal, usize), HsimError> {
    match parameters.wanted {
        Wanted::Count(count) => Ok((Goal::Count(count), count)),
        Wanted::Below { bound, most } => {
            let mut bound = bound * area;
            if bound.abs() < KERNEL && finest.level.component.iter().any(|&component| component != NO_KERNEL) {
                // The kernel lies at zero exactly, where nothing can be counted.
                bound = if bound > 0.0 { KERNEL } else { -KERNEL };
            }
            let below = factor_near(&finest.level, &finest.symbolic, bound, Vec::new())?.eigenvalues_below();
            if below > most {
                return Err(HsimError::Count { wanted: below, most });
            }
            Ok((Goal::Below(bound, below), below))
        }
    }
}

/// The answer where no eigenvalue lies below the bound.
fn nothing(mesh: &TriangleMesh, n: usize, goal: Goal, area: f64) -> Eigenpairs {
    let inertia = match goal {
        Goal::Below(bound, below) => vec![InertiaCount { shift: bound / area, below }],
        Goal::Count(_) => Vec::new(),
    };
    Eigenpairs {
        values: Vec::new(),
        vectors: PanelMatrix::zeros(mesh.positions.len(), 0),
        residuals: Vec::new(),
        bounds: Vec::new(),
        orthonormality_defect: 0.0,
        inertia,
        levels: vec![LevelReport { dimension: n, iterations: 0, shifts: 1 }],
        space: None,
    }
}

/// Orders, measures and scales what was found.
fn finish(
    mut iteration: Iteration<'_>,
    vertices: usize,
    places: &[u32],
    (shift, below): (f64, usize),
    wanted: usize,
    problem: &EigenProblem,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    let mut order = iteration.order();
    order.truncate(below);
    iteration.keep(order);
    let mut defect = defect(&iteration, monitor)?;
    if defect > LARGEST_DEFECT {
        iteration.orthonormalise()?;
        defect = self::defect(&iteration, monitor)?;
    }
    let known = if shift > 0.0 { iteration.kernel.dimension() } else { 0 };
    let counts = iteration.counts(shift, below + known);
    prepend_kernel(&mut iteration, wanted)?;
    let factor = match problem.mass {
        MassMatrix::Diagonal(_) => 1.0,
        // On every face the smallest eigenvalue of the consistent mass is a quarter of the lumped one.
        MassMatrix::Sparse(_) => 2.0,
    };
    let plain: Vec<f64> = iteration.sums.iter().map(|sums| factor * (sums.dual / sums.mass).sqrt()).collect();
    let bounds = sharpened(&iteration.values, &plain, shift);
    let count = wanted.min(iteration.values.len());
    let residuals = (0..count).map(|column| iteration.residual(column)).collect();
    let area = problem.area;
    let signs = iteration.sums.iter().map(|sums| if sums.lowest < -sums.highest { -1.0 } else { 1.0 });
    let factors: Vec<f64> = signs.map(|sign| sign / area.sqrt()).take(count).collect();
    let mut vectors = iteration.vectors;
    vectors.keep_columns(count);
    Ok(Eigenpairs {
        values: iteration.values.iter().take(count).map(|value| value / area).collect(),
        vectors: vectors.spread(vertices, places, &factors),
        residuals,
        bounds: bounds.into_iter().take(count).map(|bound| bound / area).collect(),
        orthonormality_defect: defect,
        inertia: counts.into_iter().map(|(shift, below)| InertiaCount { shift: shift / area, below }).collect(),
        levels: Vec::new(),
        space: None,
    })
}

/// Puts the kernel, or as much of it as is wanted, before the columns. Negative eigenvalues, which a potential can have, come before it.
fn prepend_kernel(iteration: &mut Iteration<'_>, wanted: usize) -> Result<(), HsimError> {
    let known = iteration.kernel.dimension().min(wanted);
    if known == 0 {
        return Ok(());
    }
    let columns = iteration.values.len();
    let basis = iteration.kernel.basis(known);
    iteration.append(&basis, &vec![0.0; known])?;
    let negative = iteration.values[..columns].partition_point(|&value| value < 0.0);
    iteration.keep((0..negative).chain(columns..columns + known).chain(negative..columns).collect());
    Ok(())
}

fn defect(iteration: &Iteration<'_>, monitor: &dyn Monitor) -> Result<f64, HsimError> {
    let gram = gram(&iteration.level.mass, &iteration.vectors, monitor)?;
    let mut defect = 0f64;
    for column in 0..gram.columns() {
        for (row, &value) in gram.column(column).iter().enumerate() {
            defect = defect.max((value - f64::from(u8::from(row == column))).abs());
        }
    }
    Ok(defect)
}

/// Bounds by Kato and Temple: since all eigenvalues below `shift` are known to lie each in the interval of its own pair, an interval apart from its
/// neighbours holds exactly one, and its distance from the Ritz value is at most the square of the residual over the gap.
fn sharpened(values: &[f64], bounds: &[f64], shift: f64) -> Vec<f64> {
    let count = values.len();
    (0..count)
        .map(|k| {
            let above = if k + 1 < count { values[k + 1] - bounds[k + 1] } else { shift };
            let under = if k > 0 { values[k - 1] + bounds[k - 1] } else { f64::NEG_INFINITY };
            let gap = (above - values[k]).min(values[k] - under);
            if gap > bounds[k] { bounds[k] * bounds[k] / gap } else { bounds[k] }
        })
        .collect()
}

fn identity(n: usize) -> SparseMatrix<f32> {
    SparseMatrix::from_sorted_parts(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0; n])
}

/// The matrix whose row `k` is row `order[k]` of another.
fn rows_in_order(matrix: &SparseMatrix<f32>, order: &[u32]) -> SparseMatrix<f32> {
    let mut offsets = Vec::with_capacity(order.len() + 1);
    let (mut indices, mut values) = (Vec::with_capacity(matrix.entries()), Vec::with_capacity(matrix.entries()));
    offsets.push(0);
    for &row in order {
        let (columns, entries) = matrix.row(row as usize);
        indices.extend_from_slice(columns);
        values.extend_from_slice(entries);
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(order.len(), matrix.columns(), offsets, indices, values)
}
