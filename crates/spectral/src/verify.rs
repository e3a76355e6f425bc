//! An eigenbasis judged again from its mesh, by whoever received it.
//!
//! Nothing of a solver takes part: the operator is assembled anew, residuals and inner products are summed column by
//! column from the functions as they are stored, and eigenvalues are counted by another factorisation
//! ([`eigenvalues_below`]). For each pair some exact eigenvalue lies within `‖Sx − θMx‖_{M⁻¹} / ‖x‖_M` of its value;
//! where the count below a shift in a gap between these intervals is the number of values below it, none is missing
//! there.

mod finding;
mod kinds;

use chladni_base::parallel::*;
use serde::Serialize;

pub use finding::Finding;
pub use kinds::{verify_fields, verify_modes};

use crate::basis::{Basis, BasisError, Functions, Precision, ProvenanceError};
use crate::operator::MeshOperator;
use chladni_algebra::{DenseMatrix, FactorError, MassMatrix, SparseMatrix, eigenvalues_below};
use chladni_base::{Cancelled, Monitor};

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verification {
    /// Per pair the residual (4.6) of the function as it is stored; for the kernel `‖S x‖ / (‖S‖ ‖x‖)`.
    pub residuals: Vec<f64>,
    /// Per pair: some exact eigenvalue lies within this of the value, in 1/length² of the input.
    pub distances: Vec<f64>,
    /// The largest entry of `|ΦᵀMΦ − I|`.
    pub orthonormality_defect: f64,
    /// The counts that were made.
    pub counts: Vec<Recount>,
    /// The lowest so many pairs are the lowest eigenvalues, and none is missing among them; `None` where the basis
    /// claims no such thing.
    pub proven: Option<usize>,
    /// What is wrong. Empty where everything is as the basis says.
    pub findings: Vec<Finding>,
}

impl Verification {
    /// Nothing was measured yet.
    fn unmeasured() -> Self {
        Self {
            residuals: Vec::new(),
            distances: Vec::new(),
            orthonormality_defect: f64::NAN,
            counts: Vec::new(),
            proven: None,
            findings: Vec::new(),
        }
    }

    /// `confirmed` where everything is as the basis says, `refuted` where something is not, `unconfirmed` where nothing
    /// is wrong and something could not be judged.
    pub fn verdict(&self) -> &'static str {
        if self.findings.is_empty() {
            "confirmed"
        } else if self.findings.iter().all(|finding| matches!(finding, Finding::Unconfirmed { .. })) {
            "unconfirmed"
        } else {
            "refuted"
        }
    }
}

/// Eigenvalues counted below a shift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Recount {
    /// The shift, in 1/length² of the input.
    pub shift: f64,
    /// How many there are.
    pub below: usize,
    /// How many the certificate says there are, where it counted at this shift.
    pub claimed: Option<usize>,
    /// How many values of the basis lie below.
    pub values_below: usize,
}

/// Why a basis was not judged at all.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// Its functions could not be read.
    #[error(transparent)]
    Functions(#[from] BasisError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// It does not say what it claims, or what it is of.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
}

/// Values of approximations up to this, on unit area, count as zero.
const LARGEST_ZERO_VALUE: f64 = 1e-6;

/// Relative differences of residuals that are summed in another order.
const SAME: f64 = 1e-2;

/// A residual this small is one of rounding, and no other computation has the same.
const ROUNDING: f64 = 1e-10;

/// Columns whose products with the mass are held at once.
const BLOCK: usize = 64;

/// A shift next to an interval is this share of the way to the next away from it.
const NEXT_TO: f64 = 1e-3;

/// Gaps of less than this share of the value hold no shift.
const LEAST_GAP: f64 = 1e-9;

/// Judges `basis` by the `operator` of the mesh that it is said to be of. Stages: `residuals`, `orthonormality`,
/// `count`.
///
/// The whole basis is held in double precision: `8 n m` bytes.
///
/// # Errors
/// [`VerifyError`]: functions that cannot be read, or cancellation. Whatever is wrong with the basis itself is a
/// [`Finding`].
pub fn verify(basis: &Basis, operator: &MeshOperator, monitor: &dyn Monitor) -> Result<Verification, VerifyError> {
    verify_claims(basis, operator, Claims::of(basis), monitor)
}

/// What is known of a basis beside its certificate.
struct Claims {
    /// Whether its certificate has the residuals.
    residuals: bool,
    /// Whether its certificate has counts, where it claims to be complete.
    counts: bool,
    /// Where the functions are gradients, and the values the Rayleigh quotients of what they are the gradients of: the
    /// lowest value above zero, on unit area.
    gradients_of: Option<f64>,
    /// Half a unit in the last place of what is stored.
    unit: f64,
}

impl Claims {
    fn of(basis: &Basis) -> Self {
        Self { residuals: true, counts: true, gradients_of: None, unit: storage_unit(basis) }
    }
}

fn verify_claims(
    basis: &Basis,
    operator: &MeshOperator,
    claims: Claims,
    monitor: &dyn Monitor,
) -> Result<Verification, VerifyError> {
    let mut verification =
        Verification { findings: shape_findings(basis, operator, &claims), ..Verification::unmeasured() };
    if !verification.findings.is_empty() {
        return Ok(verification);
    }
    let problem = &operator.problem;
    let row_sum = |row| problem.stiffness.row(row).1.iter().map(|value| value.abs()).sum();
    let subject = Subject {
        basis,
        operator,
        claims,
        lumped: problem.mass.lumped(),
        norm: (0..problem.size()).map(row_sum).fold(0.0, f64::max),
        longest: (0..problem.size()).map(|row| problem.stiffness.row(row).0.len()).max().unwrap_or(0) as f64 + 4.0,
    };
    verification.findings.extend(subject.mass_findings());
    monitor.stage("residuals");
    let (functions, outside) = subject.functions()?;
    verification.findings.extend(outside);
    let judged: Vec<Judged> = (0..basis.count())
        .into_par_iter()
        .map(|pair| {
            monitor.checkpoint()?;
            Ok(subject.judge(pair, functions.column(pair)))
        })
        .collect::<Result<_, Cancelled>>()?;
    for judged in judged {
        verification.residuals.push(judged.residual);
        verification.distances.push(judged.distance);
        verification.findings.extend(judged.findings);
    }
    monitor.stage("orthonormality");
    verification.orthonormality_defect = subject.defect(&functions, monitor)?;
    let claimed = basis.certificate.orthonormality_defect;
    // What is stored in fewer digits is less orthonormal than what was certified.
    let allowed = 1.1 * claimed + 8.0 * subject.claims.unit + 1e-11;
    if !(verification.orthonormality_defect <= allowed) {
        verification.findings.push(Finding::Orthonormality { found: verification.orthonormality_defect, claimed });
    }
    monitor.stage("count");
    if basis.certificate.complete == Some(true) {
        subject.count(&mut verification, monitor)?;
    }
    Ok(verification)
}

/// Half a unit in the last place of what is stored.
fn storage_unit(basis: &Basis) -> f64 {
    match &basis.functions {
        Functions::Dense(dense) if dense.precision() == Precision::F32 => f64::from(f32::EPSILON) / 2.0,
        _ => f64::EPSILON / 2.0,
    }
}

fn shape_findings(basis: &Basis, operator: &MeshOperator, claims: &Claims) -> Vec<Finding> {
    let (count, certificate) = (basis.count(), &basis.certificate);
    let vertices = operator.laplacian().size();
    let mut findings = Vec::new();
    let mut differ = |what: &str, found: usize, expected: usize| {
        if found != expected {
            findings.push(Finding::Shape(format!("{found} {what} instead of {expected}")));
        }
    };
    differ("rows of functions", basis.vertices(), vertices);
    differ("rows of the mass matrix", basis.mass.size(), vertices);
    if claims.residuals {
        differ("residuals", certificate.residuals.len(), count);
    }
    differ("bounds", certificate.bounds.len(), count);
    if !certificate.estimates.is_empty() {
        differ("estimates", certificate.estimates.len(), count);
    }
    let mut before = f64::NEG_INFINITY;
    for (pair, &value) in basis.eigenvalues.iter().enumerate() {
        if !(value.is_finite() && value >= before) {
            findings.push(Finding::Order { pair, value, before });
        }
        before = value;
    }
    findings
}

/// What is judged.
struct Subject<'a> {
    basis: &'a Basis,
    operator: &'a MeshOperator,
    claims: Claims,
    /// The lumped mass of the problem.
    lumped: Vec<f64>,
    /// The largest row sum of `|S|`.
    norm: f64,
    /// About the most entries of a row of `S`.
    longest: f64,
}

/// One pair.
struct Judged {
    residual: f64,
    distance: f64,
    findings: Vec<Finding>,
}

impl Subject<'_> {
    fn mass_findings(&self) -> Option<Finding> {
        let expected = self.operator.laplacian().mass.scaled(self.operator.problem.area);
        let same_kind = matches!(
            (&self.basis.mass, &expected),
            (MassMatrix::Diagonal(_), MassMatrix::Diagonal(_))
                | (MassMatrix::Sparse(_), MassMatrix::Sparse(_) | MassMatrix::Weighted(_))
        );
        let ones = vec![1.0; expected.size()];
        let ramp: Vec<f64> = (0..ones.len()).map(|k| 1.0 + (k % 7) as f64).collect();
        let largest = expected.lumped().iter().fold(0.0, |most: f64, mass| most.max(mass.abs()));
        let is_square = self.basis.mass.sparse().is_none_or(|matrix| matrix.columns() == matrix.rows());
        if !is_square || self.basis.mass.size() != expected.size() {
            return Some(Finding::Shape("the mass matrix is not square, or of another size".to_owned()));
        }
        for vector in [&ones, &ramp] {
            let (found, expected) = (self.basis.mass.multiply(vector), expected.multiply(vector));
            let differs = |(a, b): (&f64, &f64)| !((a - b).abs() <= 1e-9 * b.abs() + 1e-14 * largest);
            if let Some(row) = found.iter().zip(&expected).position(differs) {
                return Some(Finding::Mass { row, found: found[row], expected: expected[row] });
            }
        }
        (!same_kind).then(|| Finding::Shape("the mass matrix is of another kind than that of the mesh".to_owned()))
    }

    /// The functions on the unknowns, for unit area; and the first that does not vanish elsewhere.
    fn functions(&self) -> Result<(DenseMatrix, Option<Finding>), VerifyError> {
        let (vertices, count) = (self.basis.vertices(), self.basis.count());
        let scale = self.operator.problem.area.sqrt();
        let mut all = self.basis.lift::<f64>(0..count)?;
        all.par_iter_mut().for_each(|x| *x *= scale);
        let Some(unknowns) = &self.operator.problem.unknowns else {
            let functions = DenseMatrix::from_columns(vertices, count, all);
            return Ok((functions, None));
        };
        let mut is_unknown = vec![false; vertices];
        unknowns.iter().for_each(|&vertex| is_unknown[vertex as usize] = true);
        let mut functions = DenseMatrix::zeros(unknowns.len(), count);
        let mut outside = None;
        for (pair, column) in all.chunks_exact(vertices.max(1)).enumerate() {
            let own = functions.column_mut(pair);
            unknowns.iter().zip(own).for_each(|(&vertex, to)| *to = column[vertex as usize]);
            let held = (0..vertices).find(|&vertex| !is_unknown[vertex] && column[vertex] != 0.0);
            outside = outside.or(held.map(|vertex| Finding::Boundary { pair, vertex, value: column[vertex] / scale }));
        }
        Ok((functions, outside))
    }

    fn judge(&self, pair: usize, x: &[f64]) -> Judged {
        let problem = &self.operator.problem;
        let (basis, certificate, area) = (self.basis, &self.basis.certificate, problem.area);
        let value = basis.eigenvalues[pair];
        let theta = value * area;
        let mut findings = Vec::new();
        let (sx, magnitudes) = products(&problem.stiffness, x);
        let mx = self.mass_times(x);
        let norm = self.norm;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let r: Vec<f64> = sx.iter().zip(&mx).map(|(s, m)| s - theta * m).collect();
        let (mass, energy) = (dot(x, &mx), dot(x, &sx));
        let length = |v: &[f64]| dot(v, v).sqrt();
        // As the solvers have it: those to a tolerance know a kernel by what rounding leaves of ‖S x‖, approximations
        // by its value.
        let rounded = f64::EPSILON * self.longest * length(&magnitudes);
        // What is known to be in it, as rigid motions and harmonic fields are, has the value zero; of that, storing
        // leaves some digits.
        let stored_kernel = theta == 0.0 && length(&sx) <= 4.0 * self.claims.unit * norm * length(x);
        let is_kernel = if certificate.accuracy.is_some() {
            theta.abs() <= LARGEST_ZERO_VALUE
        } else {
            stored_kernel || length(&sx) <= (64.0 * f64::EPSILON * norm * length(x)).max(2.0 * rounded)
        };
        let residual = if is_kernel { length(&sx) / (norm * length(x)) } else { length(&r) / length(&sx) };
        let factor = problem.mass.lumped_ratio().sqrt();
        let rounding = |row: usize| 16.0 * f64::EPSILON * (magnitudes[row] + (theta * mx[row]).abs());
        let dual: f64 =
            r.iter().zip(&self.lumped).enumerate().map(|(row, (r, m))| (r.abs() + rounding(row)).powi(2) / m).sum();
        let distance = factor * dual.sqrt() / mass.sqrt();
        if !(residual.is_finite() && distance.is_finite()) {
            findings.push(Finding::NotFinite { pair, what: "the function" });
        }
        let claimed = if self.claims.residuals { certificate.residuals[pair] } else { residual };
        // Two ways to compute one residual differ by their rounding errors.
        let summed = (0..r.len()).map(|row| rounding(row).powi(2)).sum::<f64>().sqrt();
        let digits = (self.claims.unit * norm * length(x) + summed) / length(&sx);
        if !(is_kernel || (residual - claimed).abs() <= SAME * claimed + ROUNDING + digits) {
            findings.push(Finding::Residual { pair, found: residual, claimed });
        }
        if let Some(tolerance) = certificate.tolerance
            && !(residual <= tolerance * (1.0 + 1e-6))
        {
            findings.push(Finding::Tolerance { pair, found: residual, tolerance });
        }
        let quotient = energy / mass;
        let terms: f64 = x.iter().zip(&magnitudes).map(|(x, s)| x.abs() * s).sum::<f64>() / mass;
        // What storing the function changes of its quotient, to first and to second order.
        let stored = 4.0 * self.claims.unit * length(&r) * length(x) / mass + 4.0 * self.claims.unit.powi(2) * terms;
        let allowed = 1e-9 * theta.abs() + stored + 64.0 * f64::EPSILON * terms;
        let projected = !certificate.projection_errors.is_empty();
        let excess = quotient - theta;
        let is_quotient = match self.claims.gradients_of {
            None => excess.abs() <= allowed.min(distance),
            // The quotient of the gradient of a function is above that of the function, by less than this.
            Some(lowest) => (-allowed..=allowed + 2.0 * distance.powi(2) / lowest).contains(&excess),
        };
        if !(projected || is_quotient) {
            findings.push(Finding::Quotient { pair, value, quotient: quotient / area });
        }
        let bound = certificate.bounds[pair];
        let is_judged = !projected && self.claims.gradients_of.is_none();
        // No value is known to less than the rounding of one operation.
        let is_unreachable = is_judged && !is_kernel && bound * area < f64::EPSILON / 4.0 * theta.abs();
        if !(bound >= 0.0) || is_unreachable || (is_judged && excess.abs() > bound * area + allowed) {
            findings.push(Finding::Bound { pair, claimed: bound });
        }
        Judged { residual, distance: distance / area, findings }
    }

    /// `M x`.
    ///
    /// # Panics
    /// Where `x` has another size than the problem.
    fn mass_times(&self, x: &[f64]) -> Vec<f64> {
        self.operator.problem.mass.multiply(x)
    }

    /// The largest entry of `|XᵀMX − I|`.
    fn defect(&self, functions: &DenseMatrix, monitor: &dyn Monitor) -> Result<f64, Cancelled> {
        let (n, count) = (functions.rows(), functions.columns());
        let mut defect = 0f64;
        for from in (0..count).step_by(BLOCK) {
            monitor.checkpoint()?;
            let to = count.min(from + BLOCK);
            let columns: Vec<Vec<f64>> =
                (from..to).into_par_iter().map(|pair| self.mass_times(functions.column(pair))).collect();
            let images = DenseMatrix::from_columns(n, to - from, columns.concat());
            let gram = functions.transposed_times(&images);
            for column in 0..to - from {
                for (row, &entry) in gram.column(column).iter().enumerate() {
                    let off = (entry - f64::from(u8::from(row == from + column))).abs();
                    // Anything that is not a number counts as well.
                    defect = if off <= defect { defect } else { off };
                }
            }
        }
        Ok(defect)
    }

    /// Counts at the highest shift of the certificate, and where that does not settle it in the highest gap between the
    /// values. Residuals of approximate pairs leave no gap; that they are the lowest, index by index, rests on bounds
    /// that are not derived again, so that nothing is said beyond the count.
    fn count(&self, verification: &mut Verification, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let (values, first) = (&self.basis.eigenvalues, self.basis.certificate.first);
        let last = first + values.len();
        let ends: Vec<(f64, f64)> =
            values.iter().zip(&verification.distances).map(|(value, reach)| (value - reach, value + reach)).collect();
        let highest = |k: usize| ends[..k].iter().map(|end| end.1).fold(f64::NEG_INFINITY, f64::max);
        let lowest = |k: usize| ends[k..].iter().map(|end| end.0).fold(f64::INFINITY, f64::min);
        let claimed = self.basis.certificate.inertia.iter().max_by(|a, b| a.shift.total_cmp(&b.shift));
        if claimed.is_none() && self.claims.counts {
            let reason = "its certificate has no inertia count".to_owned();
            verification.findings.push(Finding::Unconfirmed { reason });
        }
        if let Some(claim) = claimed {
            monitor.checkpoint()?;
            let values_below = first + values.partition_point(|&value| value < claim.shift);
            match self.below(claim.shift, monitor) {
                Ok(below) => {
                    let recount = Recount { shift: claim.shift, below, claimed: Some(claim.below), values_below };
                    verification.counts.push(recount);
                    if below != claim.below {
                        let (shift, claimed) = (claim.shift, claim.below);
                        verification.findings.push(Finding::Count { shift, found: below, claimed });
                    }
                    if values_below == last && below == last && highest(values.len()) < claim.shift {
                        verification.proven = Some(values.len());
                    }
                }
                Err(error) => verification.findings.push(Finding::Unconfirmed { reason: error.to_string() }),
            }
        }
        let approximate = self.basis.certificate.accuracy.is_some();
        if let Some(count) = verification.counts.last().filter(|count| approximate && count.values_below > count.below)
        {
            // Ritz values lie above the eigenvalues of their index.
            let Recount { shift, below, values_below, .. } = *count;
            verification.findings.push(Finding::Missing { shift, found: below, values: values_below });
        }
        if approximate || values.is_empty() {
            return Ok(());
        }
        if first > 0 {
            // Nothing of the interval is proven unless what lies below it is what was left out.
            monitor.checkpoint()?;
            if !self.first_is_counted(lowest(0), verification, monitor) {
                verification.proven = None;
                return Ok(());
            }
        }
        if verification.proven.is_some() {
            return Ok(());
        }
        // Just above the last pair, where nothing else is there; behind it there may be others of its cluster, which
        // nobody asked for.
        let end = highest(values.len());
        let beyond = claimed.map_or(0.0, |claim| (claim.shift - end) * NEXT_TO).max(2.0 * LEAST_GAP * end.abs());
        if beyond > 0.0 && end.is_finite() {
            monitor.checkpoint()?;
            let shift = end + beyond;
            if let Ok(below) = self.below(shift, monitor)
                && below == last
            {
                verification.counts.push(Recount { shift, below, claimed: None, values_below: last });
                verification.proven = Some(values.len());
                return Ok(());
            }
        }
        let gap = |k: usize| (highest(k), lowest(k));
        let wide = |(from, to): (f64, f64)| to - from > LEAST_GAP * from.abs().max(to.abs());
        let Some(k) = (1..values.len()).rev().find(|&k| wide(gap(k))) else {
            let reason = "the intervals of the pairs leave no gap to count in".to_owned();
            verification.findings.push(Finding::Unconfirmed { reason });
            return Ok(());
        };
        let (from, to) = gap(k);
        let next_to = to - ((to - from) * NEXT_TO).max(0.5 * LEAST_GAP * from.abs().max(to.abs()));
        // A count in the middle is the surest; one next to the cluster says that nothing is missing below it.
        for shift in [0.5 * (from + to), next_to] {
            monitor.checkpoint()?;
            match self.below(shift, monitor) {
                Ok(below) => {
                    verification.counts.push(Recount { shift, below, claimed: None, values_below: first + k });
                    if below != first + k {
                        verification.proven = None;
                        verification.findings.push(Finding::Missing { shift, found: below, values: first + k });
                        break;
                    }
                    verification.proven = Some(k);
                }
                Err(error) => {
                    verification.proven = None;
                    verification.findings.push(Finding::Unconfirmed { reason: error.to_string() });
                    break;
                }
            }
        }
        Ok(())
    }

    /// Whether as many eigenvalues lie below the first pair as its index says, counted again at the highest shift of
    /// the certificate below `least`, which is the lower end of all intervals.
    fn first_is_counted(&self, least: f64, verification: &mut Verification, monitor: &dyn Monitor) -> bool {
        let first = self.basis.certificate.first;
        let claims = self.basis.certificate.inertia.iter().filter(|claim| claim.shift < least);
        let Some(claim) = claims.max_by(|a, b| a.shift.total_cmp(&b.shift)) else {
            let reason = format!("no count below pair {first}, its first, is clear of it");
            verification.findings.push(Finding::Unconfirmed { reason });
            return false;
        };
        match self.below(claim.shift, monitor) {
            Ok(below) => {
                let (shift, claimed) = (claim.shift, Some(claim.below));
                verification.counts.push(Recount { shift, below, claimed, values_below: first });
                if below != first {
                    verification.findings.push(Finding::Missing { shift, found: below, values: first });
                }
                below == first
            }
            Err(error) => {
                verification.findings.push(Finding::Unconfirmed { reason: error.to_string() });
                false
            }
        }
    }

    fn below(&self, shift: f64, monitor: &dyn Monitor) -> Result<usize, FactorError> {
        let problem = &self.operator.problem;
        eigenvalues_below(&problem.stiffness, &problem.mass, shift * problem.area, monitor)
    }
}

/// `S x`, and the sums of the magnitudes of its terms.
fn products(stiffness: &SparseMatrix, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let sums = (0..stiffness.rows()).map(|row| {
        let (columns, values) = stiffness.row(row);
        let terms = columns.iter().zip(values).map(|(&column, value)| value * x[column as usize]);
        terms.fold((0.0, 0.0), |(sum, magnitude), term: f64| (sum + term, magnitude + term.abs()))
    });
    sums.unzip()
}

#[cfg(test)]
#[path = "verify_tests.rs"]
mod tests;
