//! The job `pencil_basis`: eigenpairs of matrices that someone else assembled.

use chladni_base::{Monitor, StageClock, stopped};
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{PENCIL, Precision, Product};
use chladni_spectral::spectrum::hsim;
use chladni_spectral::spectrum::pencil::{Matrices, Parameters, PencilError, PencilSelection, solve};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{JobError, MeshSize, Outcome, ParameterError, SOLVER_VERSION, Work, abbreviate, add_notes};
use crate::eigenbasis::{AT_MOST, LARGEST_COUNT, within};
use crate::packed::Packed;

/// The pairs of a job that does not say how many.
const COUNT: usize = 10;

/// The largest residual of a job that does not name one.
const TOLERANCE: f64 = 1e-8;

/// The most rows that may be fixed by a job: they come with it.
pub const MOST_FIXED: usize = 1_000_000;

/// What is to be computed. Every default is filled in.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PencilBasisParameters {
    /// How many pairs: the lowest, or with `around` the nearest. 10, unless it is given or bounds take its place.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 20000, example = 50))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// All pairs below this eigenvalue instead of a count.
    #[cfg_attr(feature = "schema", schema(example = 0.5))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
    /// `[from, to]`: all pairs of an interval, `from` included and `to` not, instead of a count. All below `to` are
    /// computed.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2, example = json!([-0.1, 0.1])))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between: Option<[f64; 2]>,
    /// With a count: not the lowest pairs, but those whose eigenvalues are nearest to this number. All below it are
    /// computed as well.
    #[cfg_attr(feature = "schema", schema(example = 1.5))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around: Option<f64>,
    /// With `below`, `between` or `around`: the most pairs that may be computed, 1000 unless it is given.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 20000, example = 400))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<usize>,
    /// Rows whose entries are zero in every vector (Dirichlet), from 0, up to a million: they and their columns are
    /// left out. In ascending order, each once, in answers.
    #[cfg_attr(feature = "schema", schema(example = json!([0, 1, 2])))]
    pub fixed: Vec<u32>,
    /// The largest residual ‖Sx − λMx‖ / ‖(S + cM)x‖ of a pair, 1e-8 unless it is given; eigenvalues are as exact as
    /// its square.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-10, maximum = 0.5, example = 1e-6))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// The type of the numbers of vectors; `f64`, unless it is given. In `f32`, residuals are those of what is stored,
    /// which the tolerance need not hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<Precision>,
    /// Seeds everything that is drawn at random.
    #[cfg_attr(feature = "schema", schema(example = 0))]
    pub seed: u64,
}

/// The size of a problem, as far as it tells what a solve takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ProblemSize {
    /// Rows of both matrices.
    pub rows: usize,
    /// Entries of `S`.
    pub entries: usize,
    /// Entries of `M` that are stored.
    pub mass_entries: usize,
    /// Entries of a factor, where they were counted.
    pub factor_entries: Option<u64>,
}

impl ProblemSize {
    /// The size of so many rows with what is stored of the check of a problem.
    pub fn of_report(rows: usize, report: &Value) -> Self {
        let count = |name: &str| report[name].as_u64();
        let number = |name: &str| count(name).and_then(|count| usize::try_from(count).ok()).unwrap_or(0);
        Self {
            rows,
            entries: number("entries"),
            mass_entries: number("mass_entries"),
            factor_entries: count("factor_entries"),
        }
    }

    /// Entries of a factor, as they were counted or, where they were not, those of a solid, and no fewer than the
    /// matrix has.
    fn factor(self) -> u64 {
        let of_solid = || (40.0 * (self.rows.max(2) as f64).powf(4.0 / 3.0)) as u64;
        self.factor_entries.unwrap_or_else(|| of_solid().max(self.entries as u64))
    }

    /// The bytes of both matrices, with one index for each entry.
    fn matrices(self) -> u64 {
        12 * (self.entries as u64 + self.mass_entries as u64) + 16 * self.rows as u64
    }

    /// The memory that judging `count` vectors takes, in bytes: the vectors, once more where rows are fixed, some of
    /// their products, the matrices, with and without the multiple of the mass, and a factor.
    pub fn judging_bytes(self, count: usize) -> u64 {
        let (n, m) = (self.rows as u64, count as u64);
        16 * n * m + 16 * n * m.min(64) + 6 * self.matrices() + 12 * self.factor()
    }
}

fn value(name: &'static str, reason: impl Into<String>) -> ParameterError {
    ParameterError::Value { name, reason: reason.into() }
}

impl PencilBasisParameters {
    /// Reads and checks parameters; `null` stands for all defaults, which are filled in.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let mut read: Self = super::read_parameters(PENCIL, parameters)?;
        read.check_wanted()?;
        within("tolerance", *read.tolerance.get_or_insert(TOLERANCE), 1e-10, 0.5)?;
        // Of stiff matrices single precision keeps no tolerance.
        read.precision.get_or_insert(Precision::F64);
        if read.fixed.len() > MOST_FIXED {
            let reason = format!("{} rows exceed the limit of {MOST_FIXED}", read.fixed.len());
            return Err(value("fixed", reason));
        }
        read.fixed.sort_unstable();
        read.fixed.dedup();
        Ok(read)
    }

    /// That pairs are told in one way alone, with what belongs to it.
    fn check_wanted(&mut self) -> Result<(), ParameterError> {
        let finite = |name, number: Option<f64>| match number.filter(|number| !number.is_finite()) {
            Some(number) => Err(value(name, format!("must be a finite number, not {number}"))),
            None => Ok(()),
        };
        finite("below", self.below)?;
        finite("around", self.around)?;
        if let Some([from, to]) = self.between
            && !(from < to && from.is_finite() && to.is_finite())
        {
            let reason = format!("must be two finite numbers, the lower one first, not {from} and {to}");
            return Err(value("between", reason));
        }
        let bounds: Vec<&'static str> =
            [("below", self.below.is_some()), ("between", self.between.is_some()), ("around", self.around.is_some())]
                .into_iter()
                .filter_map(|(name, given)| given.then_some(name))
                .collect();
        if let [first, second, ..] = bounds[..] {
            return Err(value(second, format!("give either this or \"{first}\"")));
        }
        let by_count = self.below.is_none() && self.between.is_none();
        match self.count {
            Some(_) if !by_count => {
                return Err(value(bounds[0], "give a count or bounds on the eigenvalues, not both"));
            }
            Some(count) if !(1..=LARGEST_COUNT).contains(&count) => {
                return Err(value("count", format!("must be between 1 and {LARGEST_COUNT}, not {count}")));
            }
            None if by_count => self.count = Some(COUNT),
            _ => {}
        }
        match self.at_most {
            Some(_) if bounds.is_empty() => {
                return Err(value("at_most", "belongs to \"below\", \"between\" and \"around\""));
            }
            Some(most) if !(1..=LARGEST_COUNT).contains(&most) => {
                return Err(value("at_most", format!("must be between 1 and {LARGEST_COUNT}, not {most}")));
            }
            None if !bounds.is_empty() => self.at_most = Some(AT_MOST),
            _ => {}
        }
        if let (Some(_), Some(count), Some(most)) = (self.around, self.count, self.at_most)
            && count > most
        {
            return Err(value("at_most", format!("must be at least the count, {count}, not {most}")));
        }
        Ok(())
    }

    /// The most pairs that may be computed.
    pub fn most_pairs(&self) -> usize {
        self.at_most.or(self.count).unwrap_or(COUNT)
    }

    /// What the solver is told.
    fn solver(&self) -> Parameters {
        let (most, count) = (self.at_most.unwrap_or(AT_MOST), self.count.unwrap_or(COUNT));
        let selection = match (self.below, self.between, self.around) {
            (Some(bound), _, _) => PencilSelection::Below { bound, most },
            (_, Some([from, to]), _) => PencilSelection::Between { from, to, most },
            (_, _, Some(shift)) => PencilSelection::Around { shift, count, most },
            _ => PencilSelection::Count(count),
        };
        Parameters { selection, tolerance: self.tolerance.unwrap_or(TOLERANCE), seed: self.seed }
    }

    fn precision(&self) -> Precision {
        self.precision.unwrap_or(Precision::F64)
    }

    /// Checks the parameters against the size of a problem.
    ///
    /// # Errors
    /// [`ParameterError::Value`] where they fix rows that are not there, or ask for more pairs than there are.
    pub fn check_problem(&self, size: ProblemSize) -> Result<(), ParameterError> {
        if let Some(row) = self.fixed.iter().find(|&&row| row as usize >= size.rows) {
            return Err(value("fixed", format!("fixed row {row} is out of range (the matrix has {} rows)", size.rows)));
        }
        let unknowns = size.rows - self.fixed.len();
        if unknowns == 0 {
            return Err(value("fixed", format!("all {} rows are fixed: nothing is left to solve for", size.rows)));
        }
        match self.count {
            Some(count) if count > unknowns => {
                let reason = format!(
                    "{count} eigenpairs were requested, but the problem has {unknowns} rows that are not fixed"
                );
                Err(value("count", reason))
            }
            _ => Ok(()),
        }
    }

    /// An estimate of the memory that the job needs beside the server itself, in bytes.
    ///
    /// The matrices are held four times, as they are kept, ordered and moved, with one index for each entry. Two
    /// factors are held at once, of the entries that were counted when the problem came, ten bytes each; where they
    /// were not, those of a solid. Of the `q` columns that are iterated on, the start holds three halves, and three
    /// copies were measured; the result is there twice while it is turned. What the iteration did not settle is solved
    /// densely where that is small.
    pub fn problem_memory_bytes(&self, size: ProblemSize) -> u64 {
        let n = size.rows.max(2) as u64;
        let p = (self.most_pairs() as u64).min(n);
        let q = (p + p * 15 / 100 + 64).min(n);
        let columns = 8 * n * (3 * q + q / 2) + 64 * q * q;
        let result = n * p * (8 + self.precision().bytes() as u64);
        4 * size.matrices() + 20 * size.factor() + columns + result + hsim::repair_bytes(n) + (64 << 20)
    }

    /// Solves the problem of the id `problem`, on the rayon pool of the calling thread.
    ///
    /// # Errors
    /// [`JobError`]; in particular [`JobError::Cancelled`] soon after the monitor's checkpoint asks for it.
    pub fn run_problem(&self, matrices: &Matrices, monitor: &dyn Monitor) -> Result<Outcome, JobError> {
        let clock = StageClock::new(monitor);
        clock.stage("pencil");
        let pencil = matrices.pencil(&self.fixed, &clock)?;
        let pairs = solve(&pencil, &self.solver(), &clock)?;
        let mut parameters = self.canonical();
        abbreviate(&mut parameters);
        let about = [
            ("kind", json!(PENCIL)),
            ("method", json!("hsim")),
            ("parameters", parameters),
            ("solver_version", json!(SOLVER_VERSION)),
            ("rows", json!(pencil.rows())),
            ("unknowns", json!(pencil.unknowns())),
        ];
        let mut about: Map<String, Value> = about.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        add_notes(&mut about, clock.notes());
        let product = pairs.into_basis(&pencil, self.precision(), about, &clock)?.into();
        Ok(Outcome { product, seconds: clock.finish() })
    }
}

/// It is not about meshes.
fn no_mesh() -> ParameterError {
    value("kind", "\"pencil_basis\" works on a problem of matrices, not on a mesh")
}

impl Work for PencilBasisParameters {
    fn canonical(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    fn check_mesh(&self, _mesh: MeshSize) -> Result<(), ParameterError> {
        Err(no_mesh())
    }

    fn memory_bytes(&self, _mesh: MeshSize) -> u64 {
        0
    }

    fn run(&self, _mesh: &TriangleMesh, _monitor: &dyn Monitor) -> Result<Product, JobError> {
        Err(no_mesh().into())
    }
}

stopped!(JobError: PencilError => |error: PencilError| match error {
    PencilError::Solve(error) => error.into(),
    other => Self::Pencil(other),
});

#[cfg(test)]
mod tests {
    use chladni_algebra::SparseMatrix;
    use chladni_base::Unwatched;
    use chladni_spectral::spectrum::pencil::Mass;

    use super::*;
    use crate::verification::judge_pencil;

    fn read(parameters: Value) -> Result<PencilBasisParameters, ParameterError> {
        PencilBasisParameters::read(&Packed::from(&parameters))
    }

    /// A path of `n` vertices.
    fn path(n: usize) -> Matrices {
        let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            let ends = f64::from(u8::from(row > 0)) + f64::from(u8::from(row + 1 < n));
            for (column, value) in [(row.wrapping_sub(1), -1.0), (row, ends), (row + 1, -1.0)] {
                if column < n {
                    columns.push(column as u32);
                    values.push(value);
                }
            }
            offsets.push(columns.len());
        }
        Matrices::new(SparseMatrix::new(n, n, offsets, columns, values).unwrap(), Mass::Identity).unwrap()
    }

    #[test]
    fn canonical_parameters_read_back_as_themselves() {
        for parameters in [
            json!(null),
            json!({"count": 7, "fixed": [3, 1, 3]}),
            json!({"below": 0.5}),
            json!({"between": [-1.0, 0.5], "at_most": 9, "tolerance": 0.01}),
            json!({"around": 0.25, "count": 3, "precision": "f32", "seed": 4}),
        ] {
            let first = read(parameters.clone()).unwrap();
            assert_eq!(read(first.canonical()).unwrap(), first, "{parameters}");
        }
        assert_eq!(read(json!({"fixed": [3, 1, 3]})).unwrap().fixed, [1, 3]);
    }

    #[test]
    fn what_contradicts_itself_is_refused_by_name() {
        for (parameters, name) in [
            (json!({"count": 0}), "count"),
            (json!({"count": 3, "below": 1.0}), "below"),
            (json!({"below": 1.0, "around": 1.0}), "around"),
            (json!({"between": [2.0, 1.0]}), "between"),
            (json!({"at_most": 3}), "at_most"),
            (json!({"around": 1.0, "count": 9, "at_most": 3}), "at_most"),
            (json!({"tolerance": 1e-12}), "tolerance"),
        ] {
            let refused = read(parameters.clone()).unwrap_err();
            assert!(
                matches!(refused, ParameterError::Value { name: own, .. } if own == name),
                "{parameters}: {refused}"
            );
        }
        let size = ProblemSize { rows: 4, ..ProblemSize::default() };
        for (parameters, name) in [
            (json!({"count": 5}), "count"),
            (json!({"count": 4, "fixed": [0]}), "count"),
            (json!({"count": 1, "fixed": [4]}), "fixed"),
            (json!({"below": 1.0, "fixed": [0, 1, 2, 3]}), "fixed"),
        ] {
            let refused = read(parameters.clone()).unwrap().check_problem(size).unwrap_err();
            assert!(
                matches!(refused, ParameterError::Value { name: own, .. } if own == name),
                "{parameters}: {refused}"
            );
        }
    }

    #[test]
    fn a_factor_that_was_not_counted_has_the_entries_of_the_matrix_at_least() {
        let full = ProblemSize { rows: 10_000, entries: 100_000_000, ..ProblemSize::default() };
        assert_eq!(full.factor(), 100_000_000);
        let thin = ProblemSize { entries: 10_000, ..full };
        assert!(thin.factor() > 8_000_000, "{}", thin.factor());
        assert_eq!(ProblemSize { factor_entries: Some(7), ..full }.factor(), 7);
    }

    #[test]
    fn pairs_in_either_precision_are_confirmed_and_altered_ones_are_refuted() {
        let matrices = path(1200);
        let exact = |k: usize| 2.0 - 2.0 * (std::f64::consts::PI * k as f64 / 1200.0).cos();
        for parameters in [
            json!({"count": 12}),
            json!({"count": 12, "precision": "f32", "tolerance": 0.1}),
            json!({"count": 12, "fixed": [0, 600]}),
            json!({"around": exact(20) + 1e-6, "count": 5}),
        ] {
            let parameters = read(parameters).unwrap();
            let product = parameters.run_problem(&matrices, &Unwatched).unwrap().product;
            let Product::PencilBasis(basis) = product else { panic!("another kind") };
            let verdict = |basis: &chladni_spectral::basis::Basis| {
                judge_pencil(basis, &matrices, &parameters.fixed, &Unwatched).unwrap()
            };
            let found = verdict(&basis);
            assert_eq!(found.verdict(), "confirmed", "{:?}", found.findings);
            assert!(found.proven.is_some_and(|proven| proven > 0), "{found:?}");
            let mut altered = (*basis).clone();
            altered.eigenvalues[3] *= 1.0 + 1e-3;
            assert_eq!(verdict(&altered).verdict(), "refuted");
            if parameters.around.is_some() {
                assert_eq!(basis.certificate.first, 18);
                assert!(basis.certificate.around.as_ref().is_some_and(|around| around.ties.is_empty()));
            }
        }
    }
}
