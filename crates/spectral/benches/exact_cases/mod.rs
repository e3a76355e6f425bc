//! Random solves on small hard meshes, judged against a dense solve of the same pencil.

pub mod cases;
pub mod record;
pub mod symmetric;

use std::collections::BTreeMap;

use cases::{Case, Question, Request};
use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::completeness;
use chladni_spectral::operator::{EigenProblem, OperatorParameters, assemble};
use chladni_spectral::spectrum::hsim::{Eigenpairs, HsimError, HsimParameters, Selection, solve};
use chladni_spectral::spectrum::nested::{self, RowPositions};
use symmetric::Copies;

/// Questions about each mesh.
pub const QUESTIONS: usize = 4;

/// What came of the solves.
#[derive(Debug, Default)]
pub struct Summary {
    pub solves: usize,
    pub complete: usize,
    /// Answers that are called complete and are not: a wrong number of pairs, a basis that is not orthonormal,
    /// residuals beyond the tolerance.
    pub false_complete: usize,
    /// Answers of which some value lies farther from the true one of its index than its bound.
    pub missed: usize,
    /// Refusals and failures, by their kind.
    pub failures: BTreeMap<String, usize>,
    /// A line for each answer that is wrong, and on request for each failure.
    pub lines: Vec<String>,
}

/// The pencil of a case and all its eigenvalues by a dense solve.
struct Truth {
    problem: EigenProblem,
    /// On unit area, ascending.
    values: Vec<f64>,
    /// How far the dense solve may be off.
    slack: f64,
    /// The largest row sum of magnitudes of the stiffness.
    norm: f64,
    vertices: usize,
}

/// All eigenvalues of a problem by a dense solve, ascending, on unit area.
fn dense_values(problem: &EigenProblem) -> Option<Vec<f64>> {
    let n = problem.size();
    Some(CpuSolver.lowest(problem.stiffness.to_dense(), problem.mass.to_dense(), n, &Unwatched).ok()?.values)
}

impl Truth {
    fn new(case: &Case) -> Option<Self> {
        let parameters =
            OperatorParameters { operator: case.operator.clone(), mass: case.mass, boundary: case.boundary };
        let problem = assemble(&case.mesh, &parameters, &Unwatched).ok()?.problem;
        let values = dense_values(&problem)?;
        Some(Self::of(problem, values, case.mesh.positions.len()))
    }

    /// The eigenvalues of copies are those of one, each so often.
    fn of_copies(case: &Copies) -> Option<Self> {
        let scale = case.all.area / case.one.area;
        let one = dense_values(&case.one)?;
        let values = one.iter().flat_map(|value| std::iter::repeat_n(value * scale, case.count)).collect();
        Some(Self::of(case.all.clone(), values, case.mesh.positions.len()))
    }

    /// `values` are all eigenvalues of the problem, ascending, on unit area.
    fn of(problem: EigenProblem, values: Vec<f64>, vertices: usize) -> Self {
        let n = problem.size();
        let lumped = problem.mass.lumped();
        let sum = |row: usize| problem.stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>();
        let norm = (0..n).map(sum).fold(0.0, f64::max);
        let stretch = problem.mass.lumped_ratio();
        let highest = (0..n).map(|row| sum(row) / lumped[row]).fold(0.0, f64::max);
        Self { problem, values, slack: 20.0 * f64::EPSILON * stretch * highest, norm, vertices }
    }

    /// What is wrong with an answer that is called complete: with the pairs, and with the bounds.
    fn judge(&self, pairs: &Eigenpairs, question: &Question) -> (Option<String>, Option<String>) {
        let (m, area) = (pairs.values.len(), self.problem.area);
        let (least, most) = match question.wanted {
            Request::Count(count) => (count, count),
            Request::Below(bound) => {
                let below = |at: f64| self.values.partition_point(|&value| value < at);
                (below(bound * area - self.slack), below(bound * area + self.slack))
            }
        };
        if m < least || m > most {
            return (Some(format!("{m} pairs instead of {least} to {most}")), None);
        }
        let mut wrong = None;
        let mut missed = None;
        let columns = self.columns(pairs);
        let products: Vec<Vec<f64>> = columns.iter().map(|x| self.problem.mass.multiply(x)).collect();
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let mut defect = 0f64;
        for (i, x) in columns.iter().enumerate() {
            for (j, y) in products.iter().enumerate().take(i + 1) {
                defect = defect.max((dot(x, y) - f64::from(u8::from(i == j))).abs());
            }
        }
        if !(defect <= 1e-7) || !(defect <= 2.0 * pairs.orthonormality_defect + 1e-12) {
            wrong = Some(format!("defect {defect:.1e}, reported {:.1e}", pairs.orthonormality_defect));
        }
        for k in 0..m {
            let value = pairs.values[k] * area;
            let stiff = self.problem.stiffness.multiply(&columns[k]);
            let rest: Vec<f64> = stiff.iter().zip(&products[k]).map(|(s, x)| s - value * x).collect();
            let (part, whole) = (dot(&rest, &rest).sqrt(), dot(&stiff, &stiff).sqrt());
            let floor = 100.0 * f64::EPSILON * self.norm * dot(&columns[k], &columns[k]).sqrt();
            if !(part <= 1.01 * question.tolerance * whole + floor) {
                wrong = Some(format!("pair {k} of {m} has residual {:.1e}", part / whole));
            }
            let error = (value - self.values[k]).abs();
            if !(error <= pairs.bounds[k] * area + self.slack) {
                missed = Some(format!(
                    "value {k} of {m} is {value:e}, not {:e}: {error:.1e} off, bound {:.1e}, dense {:.1e}",
                    self.values[k],
                    pairs.bounds[k] * area,
                    self.slack
                ));
            }
        }
        (wrong, missed)
    }

    /// The columns on the unknowns, orthonormal on unit area.
    fn columns(&self, pairs: &Eigenpairs) -> Vec<Vec<f64>> {
        let scale = self.problem.area.sqrt();
        let whole = |column: usize| pairs.vectors.column(column).iter().map(|x| x * scale).collect::<Vec<f64>>();
        let rows: Vec<usize> = match &self.problem.unknowns {
            Some(unknowns) => unknowns.iter().map(|&vertex| vertex as usize).collect(),
            None => (0..self.vertices).collect(),
        };
        (0..pairs.values.len())
            .map(|k| {
                let whole = whole(k);
                rows.iter().map(|&row| whole[row]).collect()
            })
            .collect()
    }
}

/// What is drawn at random.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Small meshes that are hard on a solver: [`cases`].
    Hard,
    /// Eigenvalues that are multiple, and counts that cut them: [`symmetric`].
    Multiple,
}

/// How a campaign runs.
#[derive(Debug, Clone, Copy)]
pub struct Campaign<'a> {
    pub family: Family,
    pub solves: usize,
    /// The first seed.
    pub first: u64,
    /// Whether failures get a line as well.
    pub verbose: bool,
    /// The folder into which goes what another program needs to judge each answer.
    pub record: Option<&'a std::path::Path>,
}

/// Solves random problems. `watch` is told each line as it is known.
pub fn run(campaign: &Campaign<'_>, mut watch: impl FnMut(&str)) -> Summary {
    let mut summary = Summary::default();
    let mut seed = campaign.first;
    while summary.solves < campaign.solves {
        if let Some(subject) = Subject::new(campaign.family, seed) {
            for index in 0..QUESTIONS.min(campaign.solves - summary.solves) {
                ask(&subject, (seed, index), campaign, &mut summary, &mut watch);
            }
        }
        seed += 1;
    }
    summary
}

/// What questions are asked about.
struct Subject {
    name: String,
    mesh: TriangleMesh,
    truth: Truth,
    family: Family,
    /// Whether its rows lie on no surface.
    graph: bool,
}

impl Subject {
    fn new(family: Family, seed: u64) -> Option<Self> {
        Some(match family {
            Family::Hard => {
                let case = cases::case(seed);
                let truth = Truth::new(&case)?;
                Self { name: case.name, mesh: case.mesh, truth, family, graph: false }
            }
            Family::Multiple => {
                let case = symmetric::case(seed);
                let truth = Truth::of_copies(&case)?;
                Self { name: case.name, mesh: case.mesh, truth, family, graph: case.graph }
            }
        })
    }

    fn question(&self, seed: u64, index: usize) -> Question {
        let area = self.truth.problem.area;
        let in_units: Vec<f64> = self.truth.values.iter().map(|value| value / area).collect();
        match self.family {
            Family::Hard => cases::question(seed, index, &in_units),
            Family::Multiple => symmetric::question(seed, index, &in_units, self.graph),
        }
    }

    fn solve(&self, question: &Question) -> Result<Eigenpairs, HsimError> {
        let selection = match question.wanted {
            Request::Count(count) => Selection::Count(count),
            Request::Below(bound) => Selection::Below { bound, most: self.truth.values.len() },
        };
        let parameters = HsimParameters {
            selection,
            tolerance: question.tolerance,
            variant: question.variant,
            seed: question.seed,
            ..HsimParameters::default()
        };
        let (problem, vertices) = (&self.truth.problem, self.mesh.positions.len());
        if self.graph {
            nested::solve(problem, RowPositions::Nowhere, vertices, &parameters, &Unwatched)
        } else {
            solve(&self.mesh, problem, &parameters, false, &Unwatched)
        }
    }
}

fn ask(
    subject: &Subject,
    (seed, index): (u64, usize),
    campaign: &Campaign<'_>,
    summary: &mut Summary,
    watch: &mut impl FnMut(&str),
) {
    let (truth, verbose) = (&subject.truth, campaign.verbose);
    let question = subject.question(seed, index);
    summary.solves += 1;
    let started = std::time::Instant::now();
    let answer = subject.solve(&question);
    let what = |outcome: String| {
        let seconds = started.elapsed().as_secs_f64();
        format!("{seed}.{index} {} of {}, {question:?}: {outcome} [{seconds:.1} s]", subject.name, truth.values.len())
    };
    let mut tell = |line: String| {
        watch(&line);
        summary.lines.push(line);
    };
    if let Some(folder) = campaign.record {
        let columns = answer.as_ref().map(|pairs| truth.columns(pairs)).unwrap_or_default();
        let path = folder.join(format!("{seed}.{index}"));
        record::write(&path, (&subject.name, &question), &truth.problem, &answer, &columns)
            .expect("the folder takes records");
    }
    match answer {
        Ok(pairs)
            if pairs.values.is_empty() || completeness(pairs.first, &pairs.values, &pairs.inertia) == Some(true) =>
        {
            summary.complete += 1;
            let (wrong, missed) = truth.judge(&pairs, &question);
            summary.false_complete += usize::from(wrong.is_some());
            summary.missed += usize::from(missed.is_some());
            for fault in [wrong.map(|fault| format!("FALSE: {fault}")), missed.map(|fault| format!("MISSED: {fault}"))]
            {
                fault.into_iter().for_each(|fault| tell(what(fault)));
            }
        }
        Ok(_) => {
            *summary.failures.entry("success without a proof".to_owned()).or_default() += 1;
            if verbose {
                tell(what("success without a proof".to_owned()));
            }
        }
        Err(error) => {
            *summary.failures.entry(error.kind().to_owned()).or_default() += 1;
            if verbose {
                tell(what(error.to_string()));
            }
        }
    }
}
