//! The methods `hsim` and `sim`: pairs to a tolerance, stored as columns or projected to a compact form.

use chladni_algebra::{MassMatrix, PANEL_WIDTH, PanelMatrix, residual_sums};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Basis, DenseFunctions, Functions, Interval, Precision, Provenance};
use chladni_spectral::operator::{EigenProblem, MeshOperator};
use chladni_spectral::spectrum::heat::HeatParameters;
use chladni_spectral::spectrum::hsim::{self, Eigenpairs, HsimError, HsimParameters, Selection, Variant};
use chladni_spectral::spectrum::nested::{self, RowPositions};
use chladni_spectral::spectrum::{ApproximationParameters, Space, subspace};
use serde::{Deserialize, Serialize};

use super::compact::{all_functions, project};
use super::request::{HsimVariant, MethodName, Request};
use super::{LARGEST_COUNT, value};
use crate::{JobError, ParameterError};

/// How eigenfunctions are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum StorageKind {
    /// As columns.
    #[default]
    Dense,
    /// As a sparse factor times a dense one: a fraction of the storage, at the price of a projection.
    Compact,
}

/// Where plain subspace iteration starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// Random vectors.
    #[default]
    Random,
    /// Bathe's unit vectors.
    Bathe,
}

/// The pairs delivered where a bound is given and no number: storage has to be planned before the spectrum is known.
pub(crate) const AT_MOST: usize = 1000;

/// To a smaller tolerance than this single precision is not tried: on no mesh worth the name would it keep it.
const SINGLE: f64 = 1e-4;

/// The most rows whose functions may all reach so far that the products of their cells fill what they are allowed.
const FAR_REACHING: u64 = 20_000;

/// What is solved, how well, and how it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Exact {
    /// What the solver is told, but for the seed.
    pub solver: HsimParameters,
    /// How eigenfunctions are stored.
    pub storage: StorageKind,
    /// The type of the numbers of a dense basis, if one was asked for; else single where it keeps the tolerance.
    pub precision: Option<Precision>,
}

impl Exact {
    /// Takes the members of the method, with defaults for what is absent.
    ///
    /// # Errors
    /// [`ParameterError::Value`] names the first that is out of its range or contradicts another.
    pub fn from_request(request: &Request, count: usize) -> Result<Self, ParameterError> {
        let usual = HsimParameters::default();
        let variant = match (request.method, request.start.unwrap_or_default()) {
            (MethodName::Sim, Start::Random) => Variant::Random,
            (MethodName::Sim, Start::Bathe) => Variant::Bathe,
            _ => match request.variant.unwrap_or_default() {
                HsimVariant::Sliced => Variant::Sliced,
                HsimVariant::Published => Variant::Published,
            },
        };
        let tolerance = request.tolerance.unwrap_or(usual.tolerance);
        within("tolerance", tolerance, 1e-10, 0.5)?;
        for (name, given, least, most) in [
            ("sigma", request.sigma, 1.0, 100.0),
            ("shift_ratio", request.shift_ratio, 0.0, 1.0),
            ("subspace_factor", request.subspace_factor, 1.0, 4.0),
        ] {
            given.map_or(Ok(()), |given| within(name, given, least, most))?;
        }
        if let Some(levels) = request.levels
            && !(1..=6).contains(&levels)
        {
            return Err(value("levels", format!("must be between 1 and 6, not {levels}")));
        }
        if request.shift_ratio.is_some() && variant != Variant::Published {
            return Err(value("shift_ratio", "belongs to the variant \"published\"".to_owned()));
        }
        let storage = request.storage.unwrap_or_default();
        if storage == StorageKind::Compact {
            if request.method == MethodName::Sim || request.levels == Some(1) {
                let reason = "\"compact\" needs a hierarchy, whose finest space takes the eigenfunctions up";
                return Err(value("storage", reason.to_owned()));
            }
            if request.precision.is_some() {
                return Err(value("precision", "belongs to the storage \"dense\"".to_owned()));
            }
        }
        let solver = HsimParameters {
            selection: selection(request, count)?,
            tolerance,
            variant,
            levels: request.levels,
            sigma: request.sigma,
            shift_ratio: request.shift_ratio.unwrap_or(usual.shift_ratio),
            subspace_factor: request.subspace_factor,
            seed: 0,
        };
        // What is the default anyway is equal work, whether it is said or not.
        let is_default = tolerance < SINGLE && request.precision == Some(Precision::F64);
        Ok(Self { solver, storage, precision: request.precision.filter(|_| !is_default) })
    }

    /// Writes every member of the method.
    pub fn fill(&self, request: &mut Request) {
        match self.solver.selection {
            Selection::Count(count) => request.count = Some(count),
            Selection::Below { bound, most } => (request.below, request.at_most) = (Some(bound), Some(most)),
            Selection::Between { from, to, most } => {
                (request.between, request.at_most) = (Some([from, to]), Some(most));
            }
        }
        request.tolerance = Some(self.solver.tolerance);
        match self.solver.variant {
            Variant::Sliced => request.variant = Some(HsimVariant::Sliced),
            Variant::Published => request.variant = Some(HsimVariant::Published),
            Variant::Random => request.start = Some(Start::Random),
            Variant::Bathe => request.start = Some(Start::Bathe),
        }
        request.levels = self.solver.levels;
        request.sigma = self.solver.sigma;
        request.shift_ratio = (self.solver.variant == Variant::Published).then_some(self.solver.shift_ratio);
        request.subspace_factor = self.solver.subspace_factor;
        request.storage = Some(self.storage);
        request.precision = self.precision;
    }

    /// The most pairs that may be computed.
    pub fn most_pairs(&self) -> usize {
        match self.solver.selection {
            Selection::Count(count) => count,
            Selection::Below { most, .. } | Selection::Between { most, .. } => most,
        }
    }

    /// An estimate of the memory that the work needs beside mesh and operator, in bytes.
    ///
    /// The factor of a mesh of `n` vertices has about `4.7 n log₂ n` nonzeros (2.5 million at 41 thousand, 9.7 at 134,
    /// 60 at 655), of which two are held, with their indices, where two threads work at two shifts. Of the `q` columns
    /// that are iterated on, in double precision, two and a half copies were measured, beside a few `q × q` matrices,
    /// the finest space of the hierarchy, and the result. What an iteration does not settle is left to a dense solve,
    /// where that is small.
    pub fn memory_bytes(&self, vertices: u64) -> u64 {
        let n = vertices.max(2);
        let p = (self.most_pairs() as u64).min(n);
        let factors = (4.7 * n as f64 * (n as f64).log2()) as u64 * 20;
        let q = match self.solver.variant {
            Variant::Sliced => p + p * 15 / 100 + 64,
            Variant::Published | Variant::Random | Variant::Bathe => {
                (self.solver.subspace_factor.unwrap_or(1.5) * p as f64).ceil() as u64 + 64
            }
        };
        let q = q.min(n);
        let columns = 20 * n * q + 48 * q * q;
        // With products of its cells, which are a fixed number at least, and more where functions reach far.
        let space = n * 25 * 2 * 8 + (8 << 22) + n.min(FAR_REACHING) * 24 * 24 * 8;
        let result = match self.storage {
            StorageKind::Dense => n * p * self.precision.unwrap_or(Precision::F64).bytes() as u64,
            StorageKind::Compact => {
                let d = (6 * p).min(n);
                8 * (2 * d * d + 2 * d * p)
            }
        };
        factors + columns + space + result + hsim::repair_bytes(n)
    }

    /// Solves and stores.
    ///
    /// # Errors
    /// [`JobError`]: pairs that do not converge, stay missing or cannot be proven, a space that does not hold them,
    /// cancellation.
    pub fn run(
        &self,
        mesh: &TriangleMesh,
        operator: &MeshOperator,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let parameters = HsimParameters { seed, ..self.solver };
        let compact = self.storage == StorageKind::Compact;
        let problem = &operator.problem;
        let pairs = match (compact, parameters.selection, parameters.variant) {
            (true, Selection::Count(count), Variant::Sliced) => {
                // Smoothed functions hold eigenfunctions four times as well as those that only have to start an
                // iteration.
                let functions = ApproximationParameters {
                    count: count.min(problem.size()),
                    dimension: compact_dimension(count, problem.size()),
                    space: Space::Heat(HeatParameters::default()),
                    goal: None,
                    certify: false,
                    seed,
                };
                let space = subspace(mesh, operator, &functions, monitor)?;
                hsim::solve_with_space(mesh, problem, &parameters, &space, monitor)?
            }
            _ => hsim::solve(mesh, problem, &parameters, compact, monitor)?,
        };
        self.stored(pairs, operator, monitor)
    }

    /// The same for an operator on something else than a surface, with so many vertices.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_nested(
        &self,
        operator: &MeshOperator,
        places: RowPositions<'_>,
        vertices: usize,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let parameters = HsimParameters { seed, ..self.solver };
        let pairs = nested::solve(&operator.problem, places, vertices, &parameters, monitor)?;
        self.stored(pairs, operator, monitor)
    }

    /// What was found as it is stored, with its residuals as they are then. Where nobody asked for single precision, it
    /// has to keep the tolerance.
    pub(super) fn stored(
        &self,
        pairs: Eigenpairs,
        operator: &MeshOperator,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let (problem, tolerance) = (&operator.problem, self.solver.tolerance);
        let mass = operator.laplacian().mass.scaled(operator.laplacian().area);
        let single = match (self.storage, self.precision) {
            (StorageKind::Compact, _) | (_, Some(Precision::F64)) => None,
            (_, None) if tolerance < SINGLE => None,
            _ => Some(residuals_as_stored((&pairs.vectors, &pairs.values, &pairs.residuals), problem, monitor)?),
        };
        let met = single.as_ref().map_or(0.0, |residuals| residuals.iter().copied().fold(0.0, f64::max));
        let single = single.filter(|_| self.precision.is_some() || met <= tolerance);
        let precision = if single.is_some() { Precision::F32 } else { Precision::F64 };
        let mut basis = self.basis(pairs, mass, precision, monitor)?;
        basis.metadata = Provenance::of_operator(operator);
        if let Some(Interval { from, to, on_bounds }) = &basis.certificate.interval {
            let first = basis.certificate.first;
            let interval = serde_json::json!({"from": from, "to": to, "first": first, "on_bounds": on_bounds});
            basis.metadata.set("interval", interval);
        }
        if let Some(residuals) = single {
            basis.certificate.residuals = residuals;
            // Whoever asks for single precision gets it, and is told what it keeps.
            basis.certificate.tolerance = Some(tolerance.max(met));
        }
        Ok(basis)
    }

    /// The basis of what the solver found. `mass` is that of all vertices in the units of the input.
    fn basis(
        &self,
        mut pairs: Eigenpairs,
        mass: MassMatrix,
        precision: Precision,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let mut certificate = pairs.take_certificate(self.solver.selection, self.solver.tolerance)?;
        let functions = match self.storage {
            StorageKind::Dense => Functions::Dense(DenseFunctions::from_panels(pairs.vectors, precision)),
            StorageKind::Compact => {
                let space = pairs.space.or_else(|| all_functions(mass.size())).ok_or_else(|| {
                    HsimError::Numerical("the hierarchy has no space to store the eigenfunctions in".to_owned())
                })?;
                monitor.stage("compact");
                let projected = project(&pairs.vectors, space, &mass, monitor)?;
                certificate.orthonormality_defect = projected.defect;
                certificate.largest_projection_error = Some(projected.errors.iter().copied().fold(0.0, f64::max));
                certificate.projection_errors = projected.errors;
                Functions::Compact(projected.compact)
            }
        };
        Ok(Basis { functions, eigenvalues: pairs.values, mass, certificate, metadata: Provenance::default() })
    }
}

/// The residuals (4.6) of columns that are rounded to single precision; those of a kernel remain what they are in
/// double precision. Values are in the units of the input.
pub(super) fn residuals_as_stored(
    (vectors, values, residuals): (&PanelMatrix, &[f64], &[f64]),
    problem: &EigenProblem,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, JobError> {
    let m = values.len();
    let mut residuals = residuals.to_vec();
    let values: Vec<f64> = values.iter().map(|value| value * problem.area).collect();
    for start in (0..m).step_by(PANEL_WIDTH) {
        let width = PANEL_WIDTH.min(m - start);
        let Some(panel) = vectors.panels().get(start / PANEL_WIDTH) else { break };
        let rounded =
            |row: usize| panel[row * PANEL_WIDTH..(row + 1) * PANEL_WIDTH].iter().map(|&x| f64::from(x as f32));
        let mut block = PanelMatrix::zeros(problem.size(), width);
        if let Some(into) = block.panels_mut().first_mut() {
            for (row, into) in into.as_chunks_mut::<PANEL_WIDTH>().0.iter_mut().enumerate() {
                let vertex = problem.unknowns.as_ref().map_or(row, |unknowns| unknowns[row] as usize);
                into.iter_mut().zip(rounded(vertex)).for_each(|(into, x)| *into = x);
            }
        }
        let values = &values[start..start + width];
        let sums =
            residual_sums(&problem.stiffness, &problem.mass, &block, values, monitor).map_err(HsimError::from)?;
        for ((residual, sums), &value) in residuals[start..].iter_mut().zip(&sums).zip(values) {
            if value != 0.0 && sums.residual > 0.0 {
                *residual = (sums.residual / sums.stiffness).sqrt();
            }
        }
    }
    Ok(residuals)
}

/// The dimension of the space that eigenfunctions are stored in: six for each, as long as there are some vertices to a
/// dimension.
fn compact_dimension(count: usize, unknowns: usize) -> usize {
    (6 * count).min(unknowns / 4).max(2 * count)
}

pub(crate) fn within(name: &'static str, given: f64, least: f64, most: f64) -> Result<(), ParameterError> {
    if (least..=most).contains(&given) {
        return Ok(());
    }
    Err(value(name, format!("must be between {least} and {most}, not {given}")))
}

fn selection(request: &Request, count: usize) -> Result<Selection, ParameterError> {
    let most = request.at_most.unwrap_or(AT_MOST);
    let selection = match (request.below, request.between) {
        (None, None) if request.at_most.is_some() => {
            let reason = "belongs to \"below\" and \"between\", the bounds on the eigenvalues";
            return Err(value("at_most", reason.to_owned()));
        }
        (None, None) => return Ok(Selection::Count(count)),
        (Some(_), Some(_)) => {
            return Err(value("between", "give one bound on the eigenvalues, or an interval, not both".to_owned()));
        }
        (Some(bound), None) if !(bound.abs() <= MOST_BOUND) => {
            return Err(value("below", format!("must be a number from -1e300 to 1e300, not {bound}")));
        }
        (Some(bound), None) => Selection::Below { bound, most },
        (None, Some([from, to])) if !(from < to && from.abs() <= MOST_BOUND && to.abs() <= MOST_BOUND) => {
            let reason = format!("must be two numbers from -1e300 to 1e300, the lower one first, not {from} and {to}");
            return Err(value("between", reason));
        }
        (None, Some([from, to])) => Selection::Between { from, to, most },
    };
    if request.count.is_some() {
        let name = if request.below.is_some() { "below" } else { "between" };
        return Err(value(name, "give a count or bounds on the eigenvalues, not both".to_owned()));
    }
    if !(1..=LARGEST_COUNT).contains(&most) {
        return Err(value("at_most", format!("must be between 1 and {LARGEST_COUNT}, not {most}")));
    }
    Ok(selection)
}

/// Matrices are shifted by bounds, and must stay finite.
const MOST_BOUND: f64 = 1e300;

#[cfg(test)]
#[path = "exact_tests.rs"]
mod tests;
