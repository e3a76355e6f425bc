//! An approximation in parts of the surface that know nothing of each other, as for several machines.
//!
//! Columns and their dense eigenproblem are a small part of the work, and every part makes them anew: they are
//! functions of mesh and parameters alone, so that all have the same pairs, however many parts there are. It holds a
//! piece of them at a time, and the rows of the operator that belong to it (`by_rows.rs`). What is most of the work,
//! and grows with the mesh, is to say how right the pairs are. That is a sum over vertices, and each part has its own:
//! it measures what the pairs miss there (`energy/part.rs`), and keeps its rows of the subspace. The join puts rows one
//! below the other, adds up, and concludes as for a whole.
//!
//! Whether a goal is reached is known at the join alone. Where it is not, the join begins again in one piece, which may
//! add columns.

use std::borrow::Cow;

use chladni_base::parallel::*;

use super::super::certificate::{KERNEL, certificate_of, gram_defect, infinity_norm_of};
use super::super::domain::Domain;
use super::super::energy::{Cotangents, Energy, PairShare, measures};
use super::super::hsim::is_balanced;
use super::super::hsim::parts::{PartError, check_plan, fingerprint, probes};
use super::super::restricted::Ritz;
use super::attempt::Attempt;
pub use super::by_rows::ROWS_OF_PIECE;
use super::by_rows::{self, Survey, with_neighbours};
use super::reduce::{reduce_by, solve_restricted};
use super::space::initial_space;
use super::stack::Stack;
use super::{ApproximationError, ApproximationParameters, FEW_VERTICES, approximate};
use super::{CertificateError, delivered, most_columns, pairs_beside, pairs_with_guards, report};
use crate::basis::{Basis, Fingerprint, NUMBERS_OF_SHARE, Part, PartPlan, PartShare};
use crate::operator::{EigenProblem, Laplacian, LaplacianByRows, MassMatrix, MeshOperator, Reason};
use chladni_algebra::{
    ComputedOn, CpuSolver, DenseMatrix, EigenError, EigenPairs, SparseMatrix, SymmetricDefiniteSolver,
};
use chladni_base::notes::FALLBACKS;
use chladni_base::{Monitor, Portion, Quiet, trim};
use chladni_mesh::TriangleMesh;

/// The most parts: numbers of more are taken for a slip.
pub const MOST_PARTS: usize = 4096;

/// Vertices that are worth a part where their number is not given.
const NATURAL: usize = 500_000;

/// Unknowns that a part measures at a time: what a panel and its hierarchy take, some 900 bytes an unknown, is more
/// than all else that it holds.
pub const ROWS_AT_ONCE: usize = 1_100_000;

/// Values of two machines differ by rounding: relative to themselves, by no more than this.
const SAME_VALUES: f64 = 1e-9;

/// The same of the entries of coefficients, relative to the largest of all.
const SAME_COEFFICIENTS: f64 = 1e-7;

/// From so many unknowns on a goal that parts miss is told, and not reached in one piece: who divides as much has no
/// room for one.
pub const TOLD_FROM: usize = super::MEASURED_IN_PARTS_FROM;

/// An approximation and its plan.
pub struct Parted<'a> {
    mesh: &'a TriangleMesh,
    source: Source<'a>,
    parameters: ApproximationParameters,
    kernel: usize,
    plan: PartPlan,
    monitor: &'a dyn Monitor,
}

/// Where the matrices come from.
enum Source<'a> {
    /// All of them are there.
    Whole(&'a MeshOperator),
    /// Rows are made where they are asked for; and the largest sum of magnitudes in a row over its mass.
    ByRows(&'a LaplacianByRows<'a>, f64),
}

/// A problem with at least some rows of its stiffness.
type WithRows<'f, 'p> = dyn Fn(&[u32]) -> Cow<'p, EigenProblem> + 'f;

impl<'a> Parted<'a> {
    /// Divides an approximation; into parts of half a million vertices where their number is not given. `version` is
    /// that of the solver.
    ///
    /// # Errors
    /// [`PartError::Unsuited`] where it is not of the Laplacian by cotangents with a lumped mass, columns have few
    /// vertices, pairs are to be enclosed, or there are not as many vertices.
    pub fn new(
        mesh: &'a TriangleMesh,
        operator: &'a MeshOperator,
        parameters: &ApproximationParameters,
        parts: Option<usize>,
        version: &str,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, PartError> {
        if let Err(reason) = has_parts(operator) {
            return Err(PartError::Unsuited { reason: reason.to_owned() });
        }
        let problem = &operator.problem;
        let (n, d) = (problem.size(), parameters.dimension.max(parameters.count));
        let parts = checked(n, parameters, parts)?;
        let parameters = parameters.fitted(n);
        let (kernel, pairs) = pairs_with_guards(problem, &parameters, 0);
        let of = (fingerprint(problem), kernel, pairs);
        let plan = plan_of(version, of, (parts, d), &parameters);
        Ok(Self { mesh, source: Source::Whole(operator), parameters, kernel, plan, monitor })
    }

    /// The same of a Laplacian without its matrix: nobody holds all rows of anything but the surface.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn by_rows(
        problem: &'a LaplacianByRows<'a>,
        parameters: &ApproximationParameters,
        parts: Option<usize>,
        version: &str,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, PartError> {
        let (n, d) = (problem.size(), parameters.dimension.max(parameters.count));
        let parts = checked(n, parameters, parts)?;
        let parameters = parameters.fitted(n);
        let balanced = |rows: &SparseMatrix, row: usize| is_balanced(rows, row);
        let survey = Survey::new(problem, &probes(n), balanced, monitor)?;
        let products = std::array::from_fn(|k| survey.products[k]);
        let found = Fingerprint { unknowns: n, entries: survey.entries, products };
        let pairs = pairs_beside(n, survey.kernel, &parameters, 0);
        let plan = plan_of(version, (found, survey.kernel, pairs), (parts, d), &parameters);
        let source = Source::ByRows(problem, survey.largest);
        Ok(Self { mesh: problem.mesh(), source, parameters, kernel: survey.kernel, plan, monitor })
    }

    /// How many parts [`by_rows`](Self::by_rows) makes, which says nothing else.
    ///
    /// # Errors
    /// [`PartError::Unsuited`], as [`new`](Self::new).
    pub fn number(
        problem: &LaplacianByRows<'_>,
        parameters: &ApproximationParameters,
        parts: Option<usize>,
    ) -> Result<usize, PartError> {
        checked(problem.size(), parameters, parts)
    }

    /// Whether [`solve`](Self::solve) makes its columns a piece of the surface at a time, which takes far less memory
    /// than all of them: so it is where no vertex becomes a column by itself.
    pub fn is_by_pieces(problem: &LaplacianByRows<'_>, parameters: &ApproximationParameters) -> bool {
        by_rows::are_made(problem, &parameters.fitted(problem.size()))
    }

    /// The plan. Its `columns` are those that were asked for.
    pub fn plan(&self) -> &PartPlan {
        &self.plan
    }

    /// Makes one part, counted from 0. The same mesh, parameters and plan give the same part, up to rounding.
    ///
    /// # Errors
    /// [`PartError::NoSuchPart`]; those of [`approximate`](super::approximate()).
    pub fn solve(&self, number: usize) -> Result<Part, PartError> {
        let plan = &self.plan;
        if number >= plan.parts {
            return Err(PartError::NoSuchPart { number: number.saturating_add(1), parts: plan.parts });
        }
        match &self.source {
            Source::Whole(operator) => self.solve_whole(operator, number),
            Source::ByRows(problem, largest) => {
                self.solve_by_rows((problem, *largest), number, (ROWS_OF_PIECE, ROWS_AT_ONCE))
            }
        }
    }

    /// The vertex of each row, where some are held.
    fn unknowns(&self) -> Option<&[u32]> {
        match &self.source {
            Source::Whole(operator) => operator.problem.unknowns.as_deref(),
            Source::ByRows(..) => None,
        }
    }

    fn solve_whole(&self, operator: &MeshOperator, number: usize) -> Result<Part, PartError> {
        let (plan, monitor, problem) = (&self.plan, self.monitor, &operator.problem);
        let mut parameters = self.parameters;
        let space = initial_space(Domain::Surface(self.mesh), operator, &mut parameters, monitor)?;
        let pairs = plan.pairs.min(space.columns().max(parameters.count));
        let ritz = reduce_by(&OneThread, problem, space, pairs, monitor)?.with_zeros(problem, self.kernel);
        let part_of = divided(self.mesh, (problem.size(), problem.unknowns.as_deref()), plan.parts);
        self.measured(ritz, rows_of(&part_of, number), number, (usize::MAX, &|_| Cow::Borrowed(problem)))
    }

    /// A part of the surface for which columns are made a piece of so many rows at a time, and that is measured on so
    /// many at a time.
    fn solve_by_rows(
        &self,
        (problem, largest): (&LaplacianByRows<'_>, f64),
        number: usize,
        (rows_of_piece, rows_at_once): (usize, usize),
    ) -> Result<Part, PartError> {
        let (plan, monitor) = (&self.plan, self.monitor);
        let mut parameters = self.parameters;
        let Some(columns) = by_rows::columns(problem, &mut parameters, monitor)? else {
            let whole = problem.whole();
            return self.solve_whole(&whole, number);
        };
        let part_of = divided(self.mesh, (problem.size(), None), plan.parts);
        let kept = with_neighbours(self.mesh, |v| part_of[v as usize] == number as u32);
        let found = by_rows::restricted(problem, &columns, rows_of_piece, &kept, monitor)?;
        drop((columns, kept));
        let pairs = plan.pairs.min(found.space.columns().max(parameters.count));
        let ritz = solve_restricted(&OneThread, found, pairs, monitor)?.with_zeros_by(largest, self.kernel);
        let rows = rows_of(&part_of, number);
        drop(part_of);
        self.measured(ritz, rows, number, (rows_at_once, &|rows| Cow::Owned(problem.problem_with(rows, false))))
    }

    /// What pairs miss on the rows of a part, so many of them at a time. `problem` has at least some rows of the
    /// stiffness, and the space has all of these and those next to them.
    fn measured<'p>(
        &self,
        ritz: Ritz,
        rows: Vec<u32>,
        number: usize,
        (rows_at_once, problem): (usize, &WithRows<'_, 'p>),
    ) -> Result<Part, PartError> {
        let monitor = self.monitor;
        monitor.stage("bounds");
        let Ritz { space, mass, pairs, .. } = ritz;
        let EigenPairs { values, vectors: coefficients, .. } = pairs;
        let orthonormality_defect = gram_defect(&mass, &coefficients);
        drop(mass);
        let pieces = rows.len().div_ceil(rows_at_once).max(1);
        let mut piece_of = vec![u32::MAX; space.rows()];
        let unknowns = self.unknowns();
        halved(self.mesh, unknowns, &mut rows.clone(), pieces, &mut piece_of);
        let (mut sums, mut stiffness_norm) = (vec![PairShare::default(); values.len()], 0f64);
        for piece in 0..pieces {
            if pieces > 1 {
                monitor.detail(&format!("piece {} of {pieces}", piece + 1));
            }
            let own: Vec<u32> = rows.iter().copied().filter(|&row| piece_of[row as usize] == piece as u32).collect();
            let problem = problem(&own);
            let energy = Energy::of_part(self.mesh, &problem, &piece_of, piece as u32, &Quiet(monitor))
                .map_err(|error| ApproximationError::from(CertificateError::from(error)))?;
            let with_neighbours = energy.in_order(&space);
            let portion = Portion { whole: monitor, step: (piece, pieces) };
            let shares = energy.shares(&with_neighbours, &coefficients, &values, KERNEL, &portion)?;
            match piece {
                0 => sums = shares,
                _ => sums.iter_mut().zip(&shares).for_each(|(sum, share)| sum.add(share)),
            }
            stiffness_norm = stiffness_norm.max(infinity_norm_of(&problem.stiffness, own.par_iter().copied()));
        }
        let own = space.select_rows(&rows);
        drop(space);
        let share = PartShare {
            space: own,
            values,
            coefficients,
            sums: sums.iter().flat_map(PairShare::numbers).collect(),
            stiffness_norm,
            orthonormality_defect,
            rows,
        };
        // What the columns came to is part of what parts have to agree on.
        let plan = PartPlan { columns: Some(share.space.columns()), ..self.plan.clone() };
        Ok(Part { plan, number, slices: Ok(Vec::new()), share: Some(share) })
    }

    /// Joins all parts, which are asked for one after the other, from 0; what comes out is judged as an approximation
    /// in one piece. Where the goal is missed it is made in one piece, and noted; of [`TOLD_FROM`] unknowns and more
    /// the report says that it is missed.
    ///
    /// # Errors
    /// Those of `part`; [`PartError::Version`], [`PartError::Foreign`] and [`PartError::Damaged`] name the part that
    /// cannot be used; those of [`approximate`](super::approximate()).
    pub fn join(self, part: &mut dyn FnMut(usize) -> Result<Part, PartError>) -> Result<Basis, PartError> {
        self.join_within(part, true)
    }

    /// The same, and where the goal is missed nothing is made in one piece unless there is room for it.
    ///
    /// # Errors
    /// As [`join`](Self::join); [`PartError::GoalMissed`].
    pub fn join_within(
        self,
        part: &mut dyn FnMut(usize) -> Result<Part, PartError>,
        room_for_one_piece: bool,
    ) -> Result<Basis, PartError> {
        let without_rows;
        let operator = match &self.source {
            Source::Whole(operator) => *operator,
            Source::ByRows(problem, _) => {
                without_rows = problem.without_rows();
                &without_rows
            }
        };
        let (domain, problem) = (Domain::Surface(self.mesh), &operator.problem);
        self.monitor.stage("join");
        let mut gathered = Gathered::new(problem.size());
        let mut plan: Option<PartPlan> = None;
        for number in 0..self.plan.parts {
            self.monitor.checkpoint()?;
            self.monitor.progress(number as f64 / self.plan.parts as f64);
            // What the plan took, or a part as it was stored, is as much as a part itself.
            trim();
            let found = part(number)?;
            // The first part tells how many columns there are; all else is known.
            let plan = plan.get_or_insert_with(|| PartPlan { columns: found.plan.columns, ..self.plan.clone() });
            check_plan(&found, plan, number)?;
            gathered.take(found)?;
        }
        let Whole { space, mut pairs, sums, norm, defect } = gathered.whole(self.plan.parts)?;
        let measures = measures(&sums, &pairs.values, KERNEL);
        let certificate = certificate_of(&measures, (norm, defect, problem.area), &mut pairs.vectors, &pairs.values);
        let nothing = || SparseMatrix::from_sorted_parts(0, 0, vec![0], Vec::new(), Vec::new());
        let ritz = Ritz { space, mass: nothing(), stiffness: nothing(), pairs };
        let count = self.parameters.count;
        let most = most_columns(problem.size(), self.parameters.dimension.max(count));
        let mut attempt = Attempt::new(ritz, count, most);
        attempt.certificate = certificate;
        attempt.conclude((-operator.floor).max(0.0), problem.area);
        if let Some(goal) = self.parameters.goal
            && goal.rounds > 0
            && attempt.excess(goal.error) > 1.0
            && problem.size() < TOLD_FROM
        {
            drop(attempt);
            if !room_for_one_piece {
                return Err(PartError::GoalMissed);
            }
            self.monitor.note(
                FALLBACKS,
                "parts of the surface: their functions miss the goal, and more were made in one piece",
            );
            return Ok(match &self.source {
                Source::Whole(operator) => approximate(self.mesh, operator, &self.parameters, self.monitor)?,
                Source::ByRows(problem, _) => approximate(self.mesh, &problem.whole(), &self.parameters, self.monitor)?,
            });
        }
        attempt.possible((-operator.floor).max(0.0), problem.area)?;
        let accuracy = self.parameters.goal.map(|goal| report(domain, &attempt, self.parameters.space, 0, goal.error));
        Ok(delivered(domain, operator, attempt, accuracy, None))
    }
}

/// Into how many parts so many unknowns are divided, where that is asked for or left open.
fn checked(n: usize, parameters: &ApproximationParameters, parts: Option<usize>) -> Result<usize, PartError> {
    let unsuited = |reason: String| Err(PartError::Unsuited { reason });
    if parameters.certify {
        return unsuited("\"certify\" counts eigenvalues of the whole".to_owned());
    }
    let d = parameters.dimension.max(parameters.count);
    if n < FEW_VERTICES * d {
        return unsuited(format!("{n} unknowns are few for {d} functions: {} are needed", FEW_VERTICES * d));
    }
    let parts = parts.unwrap_or((n / NATURAL).max(1));
    if parts == 0 || parts > n.min(MOST_PARTS) {
        return unsuited(format!("{n} unknowns make at most {} parts, not {parts}", n.min(MOST_PARTS)));
    }
    Ok(parts)
}

/// The plan of so many parts and columns.
fn plan_of(
    version: &str,
    (problem, kernel, pairs): (Fingerprint, usize, usize),
    (parts, columns): (usize, usize),
    parameters: &ApproximationParameters,
) -> PartPlan {
    PartPlan {
        version: version.to_owned(),
        problem,
        parts,
        slices: 0,
        pairs,
        kernel,
        tolerance: parameters.goal.map_or(0.0, |goal| goal.error),
        seed: parameters.seed,
        columns: Some(columns),
    }
}

/// The rows of a part, ascending.
fn rows_of(part_of: &[u32], number: usize) -> Vec<u32> {
    (0..part_of.len() as u32).filter(|&row| part_of[row as usize] == number as u32).collect()
}

/// Whether a stiffness is that of the cotangents of the mesh, but for rows of vertices that are held.
pub(super) fn has_cotangents(operator: &MeshOperator) -> bool {
    operator.report.reason != Reason::Points && is_of_cotangents(operator)
}

fn is_of_cotangents(operator: &MeshOperator) -> bool {
    operator.report.laplacian == Laplacian::Cotangent && operator.is_laplacian_but_for_the_held()
}

/// The triangles whose cotangents a stiffness is the sum of, where it is one and they are known.
pub(super) fn cotangents<'a>(domain: Domain<'a>, operator: &MeshOperator) -> Option<Cotangents<'a>> {
    let Domain::Surface(mesh) = domain else { return None };
    if operator.report.reason != Reason::Points {
        return has_cotangents(operator).then_some(Cotangents::Surface(mesh));
    }
    let positions = mesh.positions.as_slice();
    let faces = mesh.local.of(positions).filter(|_| is_of_cotangents(operator))?;
    Some(Cotangents::Local { positions, faces })
}

/// Whether an operator is a sum over triangles that falls apart into parts, or why it is not.
pub(super) fn has_parts(operator: &MeshOperator) -> Result<(), &'static str> {
    if !has_cotangents(operator) {
        return Err("parts are made of the triangles of the Laplacian by cotangents, and of no other operator");
    }
    match operator.problem.mass {
        MassMatrix::Diagonal(_) => Ok(()),
        _ => Err("its mass is consistent; take a lumped one, barycentric or voronoi"),
    }
}

/// Dense problems on one thread: on more, the last digits depend on how many there are, and parts would not fit each
/// other.
struct OneThread;

impl SymmetricDefiniteSolver for OneThread {
    fn name(&self) -> &'static str {
        CpuSolver.name()
    }

    fn lowest(
        &self,
        a: DenseMatrix,
        b: DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<EigenPairs, EigenError> {
        match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
            Ok(pool) => pool.install(|| CpuSolver.lowest(a, b, count, monitor)),
            Err(_) => CpuSolver.lowest(a, b, count, monitor),
        }
    }
}

/// The part of each unknown: the surface is halved across its longest extent, and so on, to as many parts of about one
/// size.
pub(super) fn divided(mesh: &TriangleMesh, (n, unknowns): (usize, Option<&[u32]>), parts: usize) -> Vec<u32> {
    let mut part_of = vec![0u32; n];
    halved(mesh, unknowns, &mut (0..n as u32).collect::<Vec<u32>>(), parts, &mut part_of);
    part_of
}

/// Divides some rows in the same way, and puts down the part of each.
fn halved(mesh: &TriangleMesh, unknowns: Option<&[u32]>, rows: &mut [u32], parts: usize, part_of: &mut [u32]) {
    let vertex = |row: u32| unknowns.map_or(row, |unknowns| unknowns[row as usize]);
    let mut left: Vec<(&mut [u32], u32, usize)> = vec![(rows, 0, parts)];
    while let Some((rows, first, parts)) = left.pop() {
        if parts < 2 || rows.is_empty() {
            rows.iter().for_each(|&row| part_of[row as usize] = first);
            continue;
        }
        let position = |row: u32| mesh.positions[vertex(row) as usize];
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &row in &*rows {
            let p = position(row);
            (0..3).for_each(|k| (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k])));
        }
        let axis =
            (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b])).then(b.cmp(&a))).unwrap_or(0);
        let half = parts / 2;
        let middle = rows.len() * half / parts;
        // By number where places are equal, so that there is one answer.
        let order = |a: &u32, b: &u32| position(*a)[axis].total_cmp(&position(*b)[axis]).then(a.cmp(b));
        if middle < rows.len() {
            rows.select_nth_unstable_by(middle, order);
        }
        let (lower, upper) = rows.split_at_mut(middle);
        left.push((lower, first, half));
        left.push((upper, first + half as u32, parts - half));
    }
}

/// What parts bring along, until all are there.
struct Gathered {
    /// Whether some part has a row.
    seen: Vec<bool>,
    /// The rows of each part, once it is known how many columns there are.
    space: Option<Stack<f32>>,
    pairs: Option<EigenPairs>,
    sums: Vec<PairShare>,
    norm: f64,
    defect: f64,
}

/// All parts together.
struct Whole {
    space: SparseMatrix<f32>,
    pairs: EigenPairs,
    sums: Vec<PairShare>,
    norm: f64,
    defect: f64,
}

impl Gathered {
    fn new(n: usize) -> Self {
        Self { seen: vec![false; n], space: None, pairs: None, sums: Vec::new(), norm: 0.0, defect: 0.0 }
    }

    fn take(&mut self, part: Part) -> Result<(), PartError> {
        let count = part.number + 1;
        let damaged = |reason: &str| PartError::Damaged { number: count, reason: reason.to_owned() };
        let share = part.share.ok_or_else(|| damaged("it has no share of an approximation"))?;
        let PartShare { rows, space, values, coefficients, sums, stiffness_norm, orthonormality_defect } = share;
        let (m, d) = (values.len(), space.columns());
        let fits = space.rows() == rows.len()
            && (coefficients.rows(), coefficients.columns()) == (d, m)
            && sums.len() == m * NUMBERS_OF_SHARE
            && m <= part.plan.pairs;
        if !fits {
            return Err(damaged("its arrays do not fit each other"));
        }
        let numbers = values.iter().chain(&sums).chain(coefficients.values());
        let defects = [stiffness_norm, orthonormality_defect];
        if !numbers.chain(&defects).all(|x| x.is_finite()) || !space.values().iter().all(|x| x.is_finite()) {
            return Err(damaged("some of its numbers are not finite"));
        }
        if !values.is_sorted() {
            return Err(damaged("its values are not in order"));
        }
        for &row in &rows {
            match self.seen.get_mut(row as usize) {
                Some(seen) if !*seen => *seen = true,
                Some(_) => return Err(damaged(&format!("unknown {row} is also in a part before"))),
                None => return Err(damaged(&format!("there is no unknown {row}"))),
            }
        }
        let n = self.seen.len();
        self.space.get_or_insert_with(|| Stack::new(n, d)).push(rows, space);
        let groups = sums.as_chunks::<NUMBERS_OF_SHARE>().0;
        let found: Vec<PairShare> = groups.iter().map(PairShare::of_numbers).collect();
        match &self.pairs {
            None => {
                self.pairs = Some(EigenPairs { values, vectors: coefficients, computed_on: ComputedOn::default() });
                self.sums = found;
            }
            Some(first) => {
                if !same_pairs(first, &values, &coefficients) {
                    let reason = "its pairs are not those of part 1, as where processors differ: compute both on machines of one kind";
                    return Err(PartError::Foreign { number: count, reason: reason.to_owned() });
                }
                self.sums.iter_mut().zip(&found).for_each(|(sum, found)| sum.add(found));
            }
        }
        self.norm = self.norm.max(stiffness_norm);
        self.defect = self.defect.max(orthonormality_defect);
        Ok(())
    }

    /// All of so many parts together.
    fn whole(self, parts: usize) -> Result<Whole, PartError> {
        let Self { seen, space, pairs, sums, norm, defect } = self;
        let missing = |reason: String| PartError::Damaged { number: parts, reason };
        if let Some(row) = seen.iter().position(|seen| !seen) {
            return Err(missing(format!("no part has unknown {row}")));
        }
        let pairs = pairs.ok_or_else(|| missing("it has no pairs".to_owned()))?;
        let space = space.unwrap_or_else(|| Stack::new(seen.len(), 0));
        drop(seen);
        let space = space.finish();
        Ok(Whole { space, pairs, sums, norm, defect })
    }
}

/// Whether pairs are the same, but for rounding: sums over rows of several parts are of nothing otherwise.
fn same_pairs(first: &EigenPairs, values: &[f64], coefficients: &DenseMatrix) -> bool {
    let largest = first.values.last().map_or(0.0, |value| value.abs());
    let near = |a: f64, b: f64, size: f64, share: f64| (a - b).abs() <= share * size;
    let scale = first.vectors.values().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    first.values.len() == values.len()
        && first.vectors.rows() == coefficients.rows()
        && first
            .values
            .iter()
            .zip(values)
            .all(|(&a, &b)| near(a, b, largest.min(a.abs()).max(1e-3 * largest), SAME_VALUES))
        && first.vectors.values().iter().zip(coefficients.values()).all(|(&a, &b)| near(a, b, scale, SAME_COEFFICIENTS))
}

#[cfg(test)]
#[path = "parts_tests.rs"]
mod tests;
