//! HSIM on a pencil of which nothing is known but its matrices: no mesh, no positions, no sign.
//!
//! Residuals (4.6) are relative to `‖S x‖`, which tells nothing where an eigenvalue is next to zero. Constants are
//! known to be in the kernel of a Laplacian, and are kept out of the iteration. What else lies next to zero, or below,
//! is moved: the pencil `S + cM` has the same vectors, and its eigenvalues are positive. With `c` about the distance of
//! the lowest eigenvalue from the next, residuals are those of a Laplacian with the constants taken out.

use chladni_algebra::{MassMatrix, Ordering, PanelMatrix, SparseMatrix, SymbolicFactor, fill_reducing_order};
use chladni_base::Monitor;
use chladni_base::notes::FALLBACKS;
use chladni_mesh::TriangleMesh;

use super::certify::Goal;
use super::deliver::nothing;
use super::dense_pairs::dense_pairs;
use super::hierarchy;
use super::kernel::Kernel;
use super::krylov;
use super::lanczos;
use super::level::{Level, NO_KERNEL};
use super::null_space;
use super::offset;
use super::outliers;
use super::scout::{NEGLIGIBLE, Scout, fills_in};
use super::solve::{Aim, Begun, Columns, Finest, Task, aim, within};
use super::tuning::TUNING;
use super::{Eigenpairs, HsimError, HsimParameters, Selection};
use crate::operator::EigenProblem;

/// Values that differ by less than this share of the width of all are taken for one, such as those of rigid motions.
const CLUSTERED: f64 = 1e-4;

/// Eigenpairs, and the multiple `c` of the mass with which their residuals are relative to `‖(S + cM) x‖`.
#[derive(Debug)]
pub(in crate::spectrum) struct Bare {
    pub pairs: Eigenpairs,
    pub moved: f64,
}

/// Computes the lowest eigenpairs of a pencil whose rows are all unknowns, in its own units; `area` has to be 1. Stages
/// as [`solve`](super::solve).
///
/// # Errors
/// [`HsimError`], as [`solve`](super::solve).
pub(in crate::spectrum) fn solve(
    problem: &EigenProblem,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<Bare, HsimError> {
    parameters.check()?;
    let n = problem.size();
    if let Selection::Count(count) = parameters.selection
        && count > n
    {
        return Err(HsimError::Count { wanted: count, most: n });
    }
    monitor.stage("hierarchy");
    monitor.checkpoint()?;
    let finest = in_order(problem, parameters.selection, monitor)?;
    Bench {
        problem,
        parameters,
        monitor,
        mesh: TriangleMesh { positions: vec![[0.0; 3]; n], faces: Vec::new(), ..Default::default() },
    }
    .solve_or_begin_again(finest)
}

/// What the columns begin from where the pencil is not solved densely.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Start {
    /// Krylov spaces from shifts among the eigenvalues, where they hold what is wanted.
    Spaces,
    /// One from a shift below all eigenvalues.
    Below,
}

/// What stays the same in every attempt.
struct Bench<'a> {
    problem: &'a EigenProblem,
    parameters: &'a HsimParameters,
    monitor: &'a dyn Monitor,
    /// HSIM asks how many rows there are.
    mesh: TriangleMesh,
}

impl Begun {
    /// The same with the vectors of the kernel, which come first: where one is known, no eigenvalue lies below zero.
    fn with_kernel(self, kernel: &Kernel<'_>) -> Self {
        let known = kernel.dimension();
        let mut vectors = kernel.basis(known);
        vectors.widen(known + self.values.len());
        vectors.assign(&(known..known + self.values.len()).collect::<Vec<_>>(), &self.vectors);
        let values = std::iter::repeat_n(0.0, known).chain(self.values).collect();
        Self { values, vectors, columns: self.columns }
    }
}

impl Bench<'_> {
    /// As [`Self::solve`]; where a start from spaces of several shifts leads nowhere, from one below all eigenvalues.
    fn solve_or_begin_again(&self, finest: Finest) -> Result<Bare, HsimError> {
        match self.solve(finest, Start::Spaces) {
            Err(error) if error.is_of_the_iteration() => {
                self.monitor.note(FALLBACKS, &format!("spaces of several shifts: {error}"));
                self.monitor.stage("repair");
                let finest = in_order(self.problem, self.parameters.selection, self.monitor)?;
                // What is told of the first start is worth more than that the second leads nowhere either.
                self.solve(finest, Start::Below)
                    .map_err(|again| if again.is_of_the_iteration() { error } else { again })
            }
            solved => solved,
        }
    }

    fn solve(&self, mut finest: Finest, start: Start) -> Result<Bare, HsimError> {
        let n = finest.level.size();
        let (goal, wanted) =
            match aim(&finest, self.parameters.selection, |bound| bound, known(&finest.level), self.monitor)? {
                Aim::Nothing(count) => {
                    let pairs = nothing(&self.mesh, self.problem, n, count, 0.0);
                    return Ok(Bare { pairs, moved: 0.0 });
                }
                Aim::Pairs(goal, wanted) => (goal, wanted),
            };
        let mut begun = self.begin(&mut finest, (goal, wanted), start)?;
        let mut moved = self.distance(&finest, &begun, wanted);
        if moved != 0.0 && known(&finest.level) > 0 {
            // Zero is no end of what is wanted then: its vectors are columns like others.
            begun = begun.with_kernel(&Kernel::new(&finest.level));
            finest.level.component.fill(NO_KERNEL);
            moved = self.distance(&finest, &begun, wanted);
        }
        if moved != 0.0 {
            finest.level.stiffness = plus_mass(&finest.level.stiffness, &finest.level.mass, moved);
        }
        self.iterate(&finest, begun, wanted, moved)
    }

    /// Ritz pairs beside the kernel, which is given up where it does not lie at the lower end.
    fn begin(&self, finest: &mut Finest, (goal, wanted): (Goal, usize), start: Start) -> Result<Begun, HsimError> {
        let n = finest.level.size();
        loop {
            let kernel = known(&finest.level);
            let q = hierarchy::columns(nontrivial(wanted, kernel, n), n - kernel);
            if n <= TUNING.dense.small || TUNING.dense.most_share * q >= n {
                let most = TUNING.dense.most;
                if n > most {
                    let reason =
                        format!("{wanted} of {n} eigenpairs take a dense solve; one of at most {most} rows is made");
                    return Err(HsimError::Memory(reason));
                }
                let (values, vectors) = dense_pairs(&finest.level, q, self.monitor)?;
                if kernel > 0 && values.first().is_some_and(|&value| value < 0.0) {
                    finest.level.component.fill(NO_KERNEL);
                    continue;
                }
                return Ok(Begun { values, vectors, columns: Columns::Solved });
            }
            let mut scout = Scout::new(&finest.level, &finest.symbolic, self.monitor);
            let bound = match goal {
                Goal::Below(bound) => Some(bound),
                Goal::Count(_) => None,
            };
            let HsimParameters { tolerance, seed, .. } = *self.parameters;
            let pairs = nontrivial(wanted, kernel, n);
            let (of, known) = ((&finest.level, &finest.symbolic), Kernel::new(&finest.level));
            if start == Start::Spaces
                && let Some((values, vectors)) = null_space::start(of, &known, &mut scout, q, seed, self.monitor)?
            {
                return Ok(Begun { values, vectors, columns: Columns::Solved });
            }
            if start == Start::Spaces && lanczos::has_room(n, pairs, tolerance) {
                let wanted = lanczos::KrylovRequest::lowest(n, pairs, q, tolerance, seed);
                let found = if kernel == 0 {
                    outliers::start(of, &known, &mut scout, wanted, self.monitor)?
                } else {
                    let found = lanczos::start(of.0, of.1, &known, wanted, self.monitor)?;
                    found.map(|found| (found, Columns::Ritz))
                };
                if let Some((lanczos::KrylovPairs { values, vectors, .. }, columns)) = found {
                    if kernel > 0 && values.first().is_some_and(|&value| value < -NEGLIGIBLE * scout.spread()) {
                        finest.level.component.fill(NO_KERNEL);
                        continue;
                    }
                    return Ok(Begun { values, vectors, columns });
                }
            }
            let window = scout.window(q + kernel, bound, kernel > 0, self.monitor)?;
            if kernel > 0 && !window.semidefinite {
                finest.level.component.fill(NO_KERNEL);
                continue;
            }
            let factor = window.factor_below(&finest.level, &finest.symbolic, self.monitor)?;
            let kernel = Kernel::new(&finest.level);
            let (values, vectors) =
                krylov::start(PanelMatrix::zeros(n, 0), &finest.level, &kernel, &factor, q, seed, self.monitor)?;
            return Ok(Begun { values, vectors, columns: Columns::Rough });
        }
    }

    /// The multiple of the mass that has to be added for residuals to tell something: nothing for a Laplacian with its
    /// constants, or where the lowest eigenvalue is as far from zero as from the others.
    fn distance(&self, finest: &Finest, begun: &Begun, wanted: usize) -> f64 {
        let values = &begun.values;
        let (Some(&first), Some(&last)) = (values.first(), values.get(wanted.min(values.len()).saturating_sub(1)))
        else {
            return 0.0;
        };
        let longest = (0..finest.level.size()).map(|row| finest.level.stiffness.row(row).0.len()).max().unwrap_or(0);
        let spread = largest_terms(&finest.level, &begun.vectors, wanted).min(finest.level.spread());
        // What a residual of the tolerance can be told from.
        let rounding = 64.0 * f64::EPSILON * (longest as f64 + 4.0) * spread / self.parameters.tolerance;
        // Beside a kernel that is known, the lowest value is as good as any.
        let width = if known(&finest.level) > 0 { 0.0 } else { (last - first).max(0.0) };
        let next = values.iter().map(|value| value - first).find(|&gap| gap > CLUSTERED * width).unwrap_or(width);
        let mut least = (0.25 * next).clamp(1e-3 * width, width).max(rounding).max(1e-3 * first.abs());
        if least == 0.0 {
            // There is nothing but zeros.
            least = 1.0;
        }
        if first >= least { 0.0 } else { few_digits(least - first) }
    }

    fn iterate(&self, finest: &Finest, begun: Begun, wanted: usize, moved: f64) -> Result<Bare, HsimError> {
        let (n, kernel) = (finest.level.size(), Kernel::new(&finest.level));
        let up = |bound: f64| bound + moved;
        let selection = match self.parameters.selection {
            Selection::Count(count) => Selection::Count(count),
            Selection::Below { bound, most } => Selection::Below { bound: up(bound), most },
            Selection::Between { from, to, most } => Selection::Between { from: up(from), to: up(to), most },
        };
        let parameters = HsimParameters { selection, ..*self.parameters };
        let goal = match selection {
            Selection::Count(count) => Goal::Count(count),
            Selection::Below { bound, .. } | Selection::Between { to: bound, .. } => Goal::Below(bound),
        };
        let task = Task {
            mesh: &self.mesh,
            problem: self.problem,
            parameters: &parameters,
            finest,
            kernel: &kernel,
            goal,
            nontrivial: nontrivial(wanted, kernel.dimension(), n),
            offset: 0.0,
            monitor: self.monitor,
        };
        let values: Vec<f64> = begun.values.iter().map(|&value| up(value)).collect();
        let solved = task.solve_or_begin_again(begun.vectors, values, None, begun.columns);
        let (mut pairs, report) = solved.map_err(|error| down(error, moved))?;
        within(&pairs, parameters.selection)?;
        pairs.levels = vec![report];
        move_back(&mut pairs, &finest.level.mass, moved);
        Ok(Bare { pairs, moved })
    }
}

/// The largest of `‖|S| |x|‖ / ‖M x‖` of some of the wanted columns: products with them are rounded by units of that,
/// which is far less than the largest eigenvalue where rows of large entries, such as penalties on fixed unknowns, are
/// next to zero in all of them.
fn largest_terms(level: &Level, vectors: &PanelMatrix, wanted: usize) -> f64 {
    let wanted = wanted.min(vectors.columns());
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let terms = |column: usize| {
        let x = vectors.column(column);
        let of_row = |row: usize| {
            let (columns, entries) = level.stiffness.row(row);
            columns.iter().zip(entries).map(|(&column, entry)| (entry * x[column as usize]).abs()).sum::<f64>()
        };
        norm(&mut (0..x.len()).map(of_row)) / norm(&mut level.mass.multiply(&x).into_iter())
    };
    (0..wanted).step_by(wanted.div_ceil(SAMPLED).max(1)).map(terms).fold(0.0, f64::max)
}

/// Of about so many columns terms are measured.
const SAMPLED: usize = 32;

/// The pairs to converge, those of the kernel left out: one above it tells where it ends.
fn nontrivial(wanted: usize, kernel: usize, n: usize) -> usize {
    wanted.saturating_sub(kernel).max(1).min(n - kernel)
}

/// The dimension of the kernel that is known.
fn known(level: &Level) -> usize {
    level.component.iter().filter(|&&component| component != NO_KERNEL).max().map_or(0, |&most| most as usize + 1)
}

/// The problem in a fill-reducing order, and the components on which constants are in its kernel. Those are told by row
/// sums; with a mass that is not diagonal they are left to the iteration, since it may couple components.
pub(super) fn in_order(problem: &EigenProblem, wanted: Selection, monitor: &dyn Monitor) -> Result<Finest, HsimError> {
    let n = problem.size();
    let columns = match wanted {
        Selection::Count(count) => hierarchy::columns(count, n),
        Selection::Below { .. } | Selection::Between { .. } => 128,
    };
    let order = fill_reducing_order(&problem.stiffness, ordering(&problem.stiffness, columns))?;
    monitor.checkpoint()?;
    let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
    let mut component = match mass {
        MassMatrix::Diagonal(_) => offset::components(&stiffness, &mass, 0.0),
        _ => vec![NO_KERNEL; n],
    };
    if component.iter().max().is_some_and(|&most| most != NO_KERNEL && most as usize + 1 == n) {
        // Nothing but a kernel would be left to iterate on.
        component.fill(NO_KERNEL);
    }
    let level = Level { stiffness, mass, positions: Vec::new(), component };
    let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass)?.within(1, monitor)?;
    Ok(Finest { order, level, symbolic })
}

/// The order in which a matrix fills in least, where so many columns are solved for.
pub(in crate::spectrum) fn ordering(stiffness: &SparseMatrix, columns: usize) -> Ordering {
    let (n, order) = (stiffness.rows(), TUNING.order);
    let pays = columns >= order.columns && n as f64 * columns as f64 > order.numbers;
    let dissect = n > order.large || if fills_in(stiffness) { n > order.many_rows } else { pays };
    if dissect { Ordering::NestedDissection } else { Ordering::Amd }
}

/// A number no less than the given one, with so few digits that products with it are hardly rounded.
fn few_digits(number: f64) -> f64 {
    if !(number > 0.0 && number.is_finite()) {
        return 0.0;
    }
    let unit = (number.log2().floor() - 4.0).exp2();
    (number / unit).ceil() * unit
}

/// `S + cM`; the pattern of `S` holds that of `M`.
pub(in crate::spectrum) fn plus_mass(stiffness: &SparseMatrix, mass: &MassMatrix, factor: f64) -> SparseMatrix {
    let mut values = stiffness.values().to_vec();
    let mut add = |row: usize, column: u32, part: f64| {
        if let Ok(at) = stiffness.row(row).0.binary_search(&column) {
            values[stiffness.offsets()[row] + at] += factor * part;
        }
    };
    for row in 0..stiffness.rows() {
        match mass {
            MassMatrix::Diagonal(mass) => add(row, row as u32, mass[row]),
            mass => {
                if let Some((columns, parts)) = mass.sparse().map(|mass| mass.row(row)) {
                    columns.iter().zip(parts).for_each(|(&column, &part)| add(row, column, part));
                }
            }
        }
    }
    let (offsets, indices) = (stiffness.offsets().to_vec(), stiffness.indices().to_vec());
    SparseMatrix::from_sorted_parts(stiffness.rows(), stiffness.columns(), offsets, indices, values)
}

/// Everything in the units of the pencil as it was given.
fn move_back(pairs: &mut Eigenpairs, mass: &MassMatrix, moved: f64) {
    if moved == 0.0 {
        return;
    }
    pairs.values.iter_mut().for_each(|value| *value -= moved);
    // Entries of the mass times the factor were rounded, and so were the differences.
    let rounding = f64::EPSILON * (1.0 + mass.terms() * mass.lumped_ratio()) * moved;
    pairs.bounds.iter_mut().for_each(|bound| *bound += rounding);
    pairs.inertia.iter_mut().for_each(|count| count.shift -= moved);
    for pair in &mut pairs.on_bounds {
        pair.value -= moved;
        pair.bound -= moved;
        pair.within += rounding;
    }
}

/// An error in the same units.
fn down(error: HsimError, moved: f64) -> HsimError {
    match error {
        HsimError::Incomplete { missing, shift } => HsimError::Incomplete { missing, shift: shift - moved },
        other => other,
    }
}
