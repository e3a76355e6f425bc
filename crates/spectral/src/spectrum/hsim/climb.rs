//! From a mesh and an operator to certified eigenpairs: what is known beforehand, which start that calls for, and the
//! start itself.

use chladni_algebra::{PanelMatrix, SparseMatrix, prolong};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;

use super::certify::Goal;
use super::deliver::nothing;
use super::dense_pairs::{dense_pairs, dense_rows};
use super::hierarchy::{self, Start};
use super::kernel::Kernel;
use super::lanczos;
use super::level::{Level, NO_KERNEL, inverse};
use super::offset;
use super::slices;
use super::solve::{Aim, Begun, Columns, Finest, Task, aim, within};
use super::tuning::TUNING;
use super::{Eigenpairs, HsimError, HsimParameters, LevelReport, Selection, Variant, published};
use crate::operator::EigenProblem;
use crate::spectrum::envelope::on_all_vertices;

/// Computes the lowest eigenpairs of an operator on a mesh, and proves by inertia that none is missing.
///
/// `keep_space` asks for the finest nested space beside the pairs, for compact storage. Stages: `hierarchy`, `iterate`,
/// `certify`, and `repair` where something was missing. The same input and seed give the same answer, up to rounding in
/// the dense eigenproblems where the number of threads differs.
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
    Climb::new(mesh, problem, parameters, InitialData::Nothing, keep_space, monitor)?.solve()
}

/// The same with a given finest nested space, `n × d` with a row for each unknown, which is kept beside the pairs; the
/// published variant and the baselines make no use of it.
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
    Climb::new(mesh, problem, parameters, InitialData::Space(space), true, monitor)?.solve()
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

/// Iterates from given Ritz pairs on the unknowns: `M`-orthonormal columns with their values, ascending. Nothing is
/// taken for a kernel. Meant for operators whose unknowns are no values at vertices, so that no hierarchy can be built
/// on them; the variant must be ours and the pairs be wanted by number.
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
    let few = matches!(parameters.selection, Selection::Count(count) if count > vectors.columns());
    if vectors.rows() != problem.size() || vectors.columns() != values.len() || few {
        let (rows, columns) = (vectors.rows(), vectors.columns());
        let reason = format!("{columns} columns with {rows} rows are not a valid start for these pairs");
        return Err(HsimError::Parameter { name: "start", reason });
    }
    Climb::new(mesh, problem, parameters, InitialData::Start(vectors, values), false, monitor)?.solve()
}

/// What a caller brings along.
enum InitialData<'a> {
    Nothing,
    /// The finest nested space.
    Space(&'a SparseMatrix<f32>),
    /// Ritz pairs on the unknowns.
    Start(PanelMatrix, Vec<f64>),
}

/// What is to be solved, and what is known of it before anything is factored.
pub(super) struct Climb<'a> {
    pub mesh: &'a TriangleMesh,
    pub problem: &'a EigenProblem,
    pub parameters: &'a HsimParameters,
    /// The finest nested space, where the caller has one.
    space: Option<&'a SparseMatrix<f32>>,
    /// Ritz pairs on the unknowns, where the caller has some.
    begun: Option<(PanelMatrix, Vec<f64>)>,
    /// Whether the finest nested space is kept beside the pairs.
    keep_space: bool,
    /// The problem, rows in their own order.
    base: Level,
    /// What was taken off its eigenvalues.
    offset: f64,
    /// The dimension of the kernel that is known.
    pub known: usize,
    pub monitor: &'a dyn Monitor,
}

/// The levels above the mesh.
enum Above {
    /// Solved, or there is no use for any.
    Climbed(Option<Start>),
    /// Left until they are known to be needed, and how many columns are.
    Left,
}

/// Columns that the iteration on the mesh starts from, and how they came about.
struct Beginning {
    values: Vec<f64>,
    vectors: PanelMatrix,
    /// The shift of plain subspace iteration, which baselines go on with.
    plain: Option<f64>,
    /// The levels that were solved on the way.
    reports: Vec<LevelReport>,
    /// The finest nested space, rows in their own order.
    space: Option<SparseMatrix<f32>>,
}

impl Beginning {
    /// Without levels above the mesh.
    fn at_once((values, vectors): (Vec<f64>, PanelMatrix)) -> Self {
        Self { values, vectors, plain: None, reports: Vec::new(), space: None }
    }
}

impl<'a> Climb<'a> {
    fn new(
        mesh: &'a TriangleMesh,
        problem: &'a EigenProblem,
        parameters: &'a HsimParameters,
        initial: InitialData<'a>,
        keep_space: bool,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, HsimError> {
        parameters.check()?;
        let (mut base, offset) = base_level(mesh, problem, !matches!(initial, InitialData::Start(..)))?;
        let (space, begun) = match initial {
            InitialData::Nothing => (None, None),
            InitialData::Space(space) => (Some(space), None),
            InitialData::Start(vectors, values) => {
                base.component.fill(NO_KERNEL);
                (None, Some((vectors, values)))
            }
        };
        match parameters.selection {
            Selection::Count(count) if count > base.size() => {
                return Err(HsimError::Count { wanted: count, most: base.size() });
            }
            _ => {}
        }
        let components = base.component.iter().filter(|&&component| component != NO_KERNEL);
        let known = components.max().map_or(0, |&most| most as usize + 1);
        Ok(Self { mesh, problem, parameters, space, begun, keep_space, base, offset, known, monitor })
    }

    /// With nothing brought along.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn plain(
        mesh: &'a TriangleMesh,
        problem: &'a EigenProblem,
        parameters: &'a HsimParameters,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, HsimError> {
        Self::new(mesh, problem, parameters, InitialData::Nothing, false, monitor)
    }

    fn solve(mut self) -> Result<Eigenpairs, HsimError> {
        self.monitor.stage("hierarchy");
        self.monitor.checkpoint()?;
        let (finest, above) = self.finest()?;
        let (goal, wanted) =
            match aim(&finest, self.parameters.selection, |bound| self.bound(bound), self.known, self.monitor)? {
                Aim::Nothing(count) => {
                    return Ok(nothing(self.mesh, self.problem, self.base.size(), count, self.offset));
                }
                Aim::Pairs(goal, wanted) => (goal, wanted),
            };
        let kernel = Kernel::new(&finest.level);
        let task = self.task(&finest, &kernel, goal, wanted);
        if self.takes_krylov_space(wanted)
            && let Some(Begun { values, vectors, columns }) = task.krylov_start()?
        {
            let (mut pairs, report) = task.solve_or_begin_again(vectors, values, None, columns)?;
            within(&pairs, self.parameters.selection)?;
            pairs.levels = vec![report];
            return Ok(pairs);
        }
        let start = match above {
            Above::Climbed(start) => start,
            Above::Left => self.climb(self.columns(wanted))?,
        };
        let Beginning { values, vectors, plain, mut reports, space } = self.beginning(&finest, wanted, start)?;
        let space = self.kept_space(space);
        let columns = if reports.is_empty() { Columns::Solved } else { Columns::Rough };
        let (mut pairs, report) = task.solve_or_begin_again(vectors, values, plain, columns)?;
        within(&pairs, self.parameters.selection)?;
        reports.push(report);
        (pairs.levels, pairs.space) = (reports, space);
        Ok(pairs)
    }

    /// What is iterated on, of so many wanted pairs.
    pub fn task<'b>(&self, finest: &'b Finest, kernel: &'b Kernel<'b>, goal: Goal, wanted: usize) -> Task<'b>
    where
        'a: 'b,
    {
        Task {
            mesh: self.mesh,
            problem: self.problem,
            parameters: self.parameters,
            finest,
            kernel,
            goal,
            nontrivial: self.nontrivial(wanted),
            offset: self.offset,
            monitor: self.monitor,
        }
    }

    /// A bound as it was asked for, on the eigenvalues of the level.
    pub fn bound(&self, bound: f64) -> f64 {
        bound * self.problem.area - self.offset
    }

    /// Pairs to converge, those of the kernel left out. One above it tells where it ends; where a potential acts on
    /// other components, all may lie below it.
    pub fn nontrivial(&self, wanted: usize) -> usize {
        let mixed = self.base.component.contains(&NO_KERNEL);
        wanted.saturating_sub(if mixed { 0 } else { self.known }).max(1).min(self.base.size() - self.known)
    }

    /// Columns to iterate on for so many pairs.
    pub fn columns(&self, wanted: usize) -> usize {
        hierarchy::columns(self.nontrivial(wanted), self.base.size() - self.known)
    }

    fn is_sliced(&self) -> bool {
        self.parameters.variant == Variant::Sliced
    }

    /// The mesh in the order in which it is factored, and the levels above it. Without a bound the number of columns is
    /// known, and levels need no factor of the mesh.
    fn finest(&self) -> Result<(Finest, Above), HsimError> {
        let n = self.base.size();
        let Selection::Count(count) = self.parameters.selection else {
            return Ok((Finest::new(&self.base, hierarchy::columns(100, n), self.monitor)?, Above::Left));
        };
        let q = self.columns(count);
        let climb = || {
            if self.takes_krylov_space(count) { Ok(Above::Left) } else { self.climb(q).map(Above::Climbed) }
        };
        let (finest, above) = rayon::join(|| Finest::new(&self.base, q, self.monitor), climb);
        Ok((finest?, above?))
    }

    /// The mesh in the order in which it is factored, without levels above it.
    pub fn finest_alone(&self) -> Result<Finest, HsimError> {
        let columns = match self.parameters.selection {
            Selection::Count(count) => self.columns(count),
            _ => hierarchy::columns(100, self.base.size()),
        };
        Finest::new(&self.base, columns, self.monitor)
    }

    /// Whether Krylov spaces may take the place of a hierarchy, as levels or their space are not asked for.
    pub fn may_take_krylov_space(&self) -> bool {
        let free = self.parameters.levels.is_none() && !self.keep_space;
        let chosen = free && self.is_sliced() && self.begun.is_none() && self.space.is_none();
        chosen && (self.known == 0 || !self.base.component.contains(&NO_KERNEL))
    }

    /// Whether they do, as where they cost less. What is small, or of small pieces, is solved densely.
    fn takes_krylov_space(&self, wanted: usize) -> bool {
        let base = &self.base;
        let dense = || hierarchy::sizes(dense_rows(&base.stiffness, &base.mass), self.columns(wanted), None).is_empty();
        let (n, pairs, tolerance) = (base.size(), self.nontrivial(wanted), self.parameters.tolerance);
        let is_cheaper = || lanczos::is_cheaper(n, pairs, tolerance) || slices::is_cheaper(n, pairs, tolerance);
        self.may_take_krylov_space() && is_cheaper() && !dense()
    }

    /// Solves `q` columns on the levels above the mesh; nothing where there are to be none.
    fn climb(&self, q: usize) -> Result<Option<Start>, HsimError> {
        let Self { base, parameters, space, .. } = self;
        let mut sizes = hierarchy::sizes(base.size(), q, parameters.levels);
        // Many small pieces are solved densely, however many there are.
        let rows = || dense_rows(&base.stiffness, &base.mass);
        let pieces = || parameters.levels.is_none() && hierarchy::sizes(rows(), q, None).is_empty();
        if q == 0 || sizes.is_empty() || !self.is_sliced() || self.begun.is_some() || space.is_none() && pieces() {
            return Ok(None);
        }
        if let Some(space) = space {
            // Below a given space there is one more level, unless it is small enough to be solved densely.
            sizes.truncate(1);
            if space.columns() <= q {
                return Ok(None);
            } else if space.columns() < 2 * sizes[0] {
                sizes[0] = space.columns();
            } else {
                sizes.push(space.columns());
            }
        }
        let sigma = parameters.sigma.unwrap_or(TUNING.hierarchy.sigma);
        hierarchy::start(base, &sizes, q, sigma, parameters.seed, *space, self.monitor).map(Some)
    }

    /// Columns on the mesh: those of the caller, prolonged ones, or by whatever way the variant begins without levels.
    fn beginning(&mut self, finest: &Finest, wanted: usize, start: Option<Start>) -> Result<Beginning, HsimError> {
        let n = self.base.size();
        if let Some((vectors, values)) = self.begun.take() {
            let vectors = vectors.spread(n, &inverse(&finest.order), &vec![1.0; values.len()]);
            return Ok(Beginning::at_once((values, vectors)));
        }
        match (self.parameters.variant, start) {
            (Variant::Sliced, Some(Start { space, vectors, values, reports })) => {
                let vectors = prolong(&space.select_rows(&finest.order), &vectors);
                Ok(Beginning { values, vectors, plain: None, reports, space: Some(space) })
            }
            (Variant::Sliced, None) if self.known == n => {
                Ok(Beginning::at_once((Vec::new(), PanelMatrix::zeros(n, 0))))
            }
            (Variant::Sliced, None) => {
                dense_pairs(&finest.level, self.columns(wanted), self.monitor).map(Beginning::at_once)
            }
            (Variant::Published, _) => self.published(finest, wanted),
            (variant @ (Variant::Random | Variant::Bathe), _) => {
                let nontrivial = self.nontrivial(wanted);
                let q = published::columns(nontrivial, self.parameters.subspace_factor, n - self.known);
                let (vectors, values) = published::plain(&finest.level, q, variant, self.parameters.seed);
                let plain = Some(published::shift(&[], nontrivial, 0.0));
                Ok(Beginning { plain, ..Beginning::at_once((values, vectors)) })
            }
        }
    }

    /// The levels of the thesis.
    fn published(&self, finest: &Finest, wanted: usize) -> Result<Beginning, HsimError> {
        let Self { mesh, parameters, .. } = *self;
        let nontrivial = self.nontrivial(wanted);
        let q = published::columns(nontrivial, parameters.subspace_factor, self.base.size() - self.known);
        let places = finest.places(mesh.positions.len(), self.problem);
        let start = published::start(mesh, &finest.level, &places, nontrivial, q, parameters, self.monitor)?;
        let plain = Some(published::shift(&start.values, nontrivial, parameters.shift_ratio));
        let space = start.space.map(|space| space.select_rows(&inverse(&finest.order)));
        Ok(Beginning { values: start.values, vectors: start.vectors, plain, reports: start.reports, space })
    }

    /// The finest nested space with a row for each vertex, where it is to be kept: that of the caller, or the one that
    /// was made, or all functions there are.
    fn kept_space(&self, made: Option<SparseMatrix<f32>>) -> Option<SparseMatrix<f32>> {
        if !self.keep_space {
            return None;
        }
        let space = self.space.cloned().or(made).unwrap_or_else(|| SparseMatrix::identity(self.base.size()));
        Some(match &self.problem.unknowns {
            Some(unknowns) => on_all_vertices(space, unknowns, self.mesh.positions.len()),
            None => space,
        })
    }
}

/// The problem as a level, rows in their own order; and what was taken off its eigenvalues, which is nothing where that
/// is not wanted.
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
    let off = if shiftable { offset::taken_off(&problem.stiffness, &problem.mass) } else { None };
    let (mut stiffness, mut offset) = off.unwrap_or_else(|| (problem.stiffness.clone(), 0.0));
    let mut component = offset::components(&stiffness, &problem.mass, offset);
    if offset != 0.0 && component.last().is_some_and(|&last| last as usize + 1 == n) {
        // Nothing but a kernel would be left to iterate on.
        (stiffness, offset) = (problem.stiffness.clone(), 0.0);
        component = offset::components(&stiffness, &problem.mass, offset);
    }
    Ok((Level { stiffness, mass: problem.mass.clone(), positions, component }, offset))
}
