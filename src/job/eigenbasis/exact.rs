//! The methods `hsim` and `sim`: pairs to a tolerance, stored as columns or projected to a compact form.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::request::{HsimVariant, MethodName, Request};
use super::{LARGEST_COUNT, value};
use crate::algebra::{
    DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, orthonormalise, solve_definite, space_times,
    space_transposed_mass_times,
};
use crate::basis::{Basis, Certificate, Compact, DenseFunctions, Functions, Precision, completeness};
use crate::job::{JobError, ParameterError};
use crate::mesh::TriangleMesh;
use crate::monitor::Monitor;
use crate::operator::MeshOperator;
use crate::spectrum::hsim::{self, Eigenpairs, HsimError, HsimParameters, Variant, Wanted};

/// How eigenfunctions are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// Random vectors.
    #[default]
    Random,
    /// Bathe's unit vectors.
    Bathe,
}

/// The pairs delivered where a bound is given and no number: storage has to be planned before the spectrum is known.
const AT_MOST: usize = 1000;

/// What is solved, how well, and how it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Exact {
    /// What the solver is told, but for the seed.
    pub solver: HsimParameters,
    /// How eigenfunctions are stored.
    pub storage: StorageKind,
    /// The type of the numbers of a dense basis.
    pub precision: Precision,
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
            return Err(value("levels", format!("must lie between 1 and 6, not be {levels}")));
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
            wanted: wanted(request, count)?,
            tolerance,
            variant,
            levels: request.levels,
            sigma: request.sigma,
            shift_ratio: request.shift_ratio.unwrap_or(usual.shift_ratio),
            subspace_factor: request.subspace_factor,
            seed: 0,
        };
        Ok(Self { solver, storage, precision: request.precision.unwrap_or_default() })
    }

    /// Writes every member of the method.
    pub fn fill(&self, request: &mut Request) {
        match self.solver.wanted {
            Wanted::Count(count) => request.count = Some(count),
            Wanted::Below { bound, most } => (request.below, request.at_most) = (Some(bound), Some(most)),
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
        request.precision = (self.storage == StorageKind::Dense).then_some(self.precision);
    }

    /// The most pairs that may be delivered.
    pub fn most_pairs(&self) -> usize {
        match self.solver.wanted {
            Wanted::Count(count) => count,
            Wanted::Below { most, .. } => most,
        }
    }

    /// An estimate of the memory that the work needs beside mesh and operator, in bytes.
    ///
    /// The factor of a mesh of `n` vertices has about `4.7 n log₂ n` nonzeros (2.5 million at 41 thousand, 9.7 at 134, 60 at 655), of
    /// which one is held with its indices and the workspace of the factorisation; beside it the columns that are iterated on, in
    /// double precision, the finest space of the hierarchy, and the converted result.
    pub fn memory_bytes(&self, vertices: u64) -> u64 {
        let n = vertices.max(2);
        let p = (self.most_pairs() as u64).min(n);
        let factor = (4.7 * n as f64 * (n as f64).log2()) as u64 * 8 * 3 / 2;
        let q = match self.solver.variant {
            Variant::Sliced => p + p * 15 / 100 + 64,
            Variant::Published | Variant::Random | Variant::Bathe => {
                // The block and what a solve makes of it.
                2 * (self.solver.subspace_factor.unwrap_or(1.5) * p as f64).ceil() as u64 + 64
            }
        };
        let space = n * 25 * 2 * 8;
        let result = match self.storage {
            StorageKind::Dense => n * p * self.precision.bytes() as u64,
            StorageKind::Compact => {
                let d = (6 * p).min(n);
                8 * (2 * d * d + 2 * d * p)
            }
        };
        factor + 8 * n * q.min(2 * n) + space + result
    }

    /// Solves and stores.
    ///
    /// # Errors
    /// [`JobError`]: pairs that do not converge or stay missing, a space that does not hold them, cancellation.
    pub fn run(
        &self,
        mesh: &TriangleMesh,
        operator: &MeshOperator,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let parameters = HsimParameters { seed, ..self.solver };
        let compact = self.storage == StorageKind::Compact;
        let pairs = hsim::solve(mesh, &operator.problem, &parameters, compact, monitor)?;
        let unknowns = operator.problem.unknowns.as_deref();
        let mass = operator.laplacian().mass.scaled(operator.laplacian().area);
        self.basis(pairs, mass, unknowns, monitor)
    }

    /// The basis of what the solver found. `mass` is that of all vertices in the units of the input; `unknowns` are the vertices that the
    /// rows of the solver's space stand for, if not all.
    fn basis(
        &self,
        pairs: Eigenpairs,
        mass: MassMatrix,
        unknowns: Option<&[u32]>,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let mut certificate = Certificate {
            complete: completeness(&pairs.values, &pairs.inertia),
            residuals: pairs.residuals,
            bounds: pairs.bounds,
            orthonormality_defect: pairs.orthonormality_defect,
            inertia: pairs.inertia,
            tolerance: Some(self.solver.tolerance),
            levels: pairs.levels,
            ..Certificate::default()
        };
        let functions = match self.storage {
            StorageKind::Dense => Functions::Dense(DenseFunctions::from_panels(pairs.vectors, self.precision)),
            StorageKind::Compact => {
                let space = pairs.space.ok_or_else(|| {
                    HsimError::Numerical("the hierarchy has no space to store the eigenfunctions in".to_owned())
                })?;
                let space = on_all_vertices(space, unknowns, mass.size());
                monitor.stage("compact");
                let projected = project(&pairs.vectors, space, &mass, monitor)?;
                certificate.orthonormality_defect = projected.defect;
                certificate.largest_projection_error = Some(projected.errors.iter().copied().fold(0.0, f64::max));
                certificate.projection_errors = projected.errors;
                Functions::Compact(projected.compact)
            }
        };
        Ok(Basis { functions, eigenvalues: pairs.values, mass, certificate, metadata: serde_json::json!({}) })
    }
}

fn within(name: &'static str, given: f64, least: f64, most: f64) -> Result<(), ParameterError> {
    if (least..=most).contains(&given) {
        return Ok(());
    }
    Err(value(name, format!("must lie between {least} and {most}, not be {given}")))
}

fn wanted(request: &Request, count: usize) -> Result<Wanted, ParameterError> {
    let Some(bound) = request.below else {
        if request.at_most.is_some() {
            return Err(value("at_most", "belongs to \"below\", the bound on the eigenvalues".to_owned()));
        }
        return Ok(Wanted::Count(count));
    };
    if request.count.is_some() {
        return Err(value("below", "give a count or a bound on the eigenvalues, not both".to_owned()));
    }
    if !bound.is_finite() {
        return Err(value("below", format!("must be a finite number, not {bound}")));
    }
    let most = request.at_most.unwrap_or(AT_MOST);
    if !(1..=LARGEST_COUNT).contains(&most) {
        return Err(value("at_most", format!("must lie between 1 and {LARGEST_COUNT}, not be {most}")));
    }
    Ok(Wanted::Below { bound, most })
}

/// A space with a row for each vertex: vertices that are no unknowns have empty rows.
fn on_all_vertices(space: SparseMatrix<f32>, unknowns: Option<&[u32]>, vertices: usize) -> SparseMatrix<f32> {
    let Some(unknowns) = unknowns.filter(|unknowns| unknowns.len() == space.rows() && space.rows() < vertices) else {
        return space;
    };
    let mut offsets = vec![0; vertices + 1];
    for (row, &vertex) in unknowns.iter().enumerate() {
        offsets[vertex as usize + 1] = space.row(row).0.len();
    }
    for vertex in 0..vertices {
        offsets[vertex + 1] += offsets[vertex];
    }
    let (indices, values) = (space.indices().to_vec(), space.values().to_vec());
    SparseMatrix::from_sorted_parts(vertices, space.columns(), offsets, indices, values)
}

/// Eigenfunctions in a space.
struct Projected {
    compact: Compact,
    /// Per pair `‖x − U c‖_M / ‖x‖_M`.
    errors: Vec<f64>,
    /// The largest entry of `|cᵀM̄c − I|`.
    defect: f64,
}

/// The nearest functions `U c` to the columns `x`, `c = (UᵀMU)⁻¹UᵀMx`, made orthonormal again from the first on, and how far they
/// are.
fn project(
    vectors: &PanelMatrix,
    space: SparseMatrix<f32>,
    mass: &MassMatrix,
    monitor: &dyn Monitor,
) -> Result<Projected, JobError> {
    let numerical = |reason: String| JobError::from(HsimError::Numerical(reason));
    let misfit = || numerical("the space and the eigenfunctions do not fit each other".to_owned());
    let (n, d, m) = (space.rows(), space.columns(), vectors.columns());
    // Only the mass is wanted; a stiffness without entries costs nothing.
    let nothing = SparseMatrix::from_sorted_parts(n, n, vec![0; n + 1], Vec::new(), Vec::new());
    let (_, reduced) = crate::algebra::galerkin(&space, &nothing, mass, monitor).map_err(|error| match error {
        crate::algebra::GalerkinError::Cancelled(cancelled) => cancelled.into(),
        other => numerical(other.to_string()),
    })?;
    let panels = m.div_ceil(PANEL_WIDTH);
    let mut coefficients = DenseMatrix::zeros(d, m);
    for panel in 0..panels {
        monitor.checkpoint()?;
        let columns = panel * PANEL_WIDTH..m.min((panel + 1) * PANEL_WIDTH);
        let x = columns_of(vectors, columns.clone());
        let part = space_transposed_mass_times(&space, mass, &x).ok_or_else(misfit)?;
        for (k, column) in columns.enumerate() {
            coefficients.column_mut(column).copy_from_slice(part.column(k));
        }
        monitor.progress(0.4 * (panel + 1) as f64 / panels as f64);
    }
    let mut matrix = reduced.to_dense();
    for k in 0..d {
        // A function that vanishes takes no part.
        let pivot = &mut matrix.column_mut(k)[k];
        *pivot = if *pivot == 0.0 { 1.0 } else { *pivot };
    }
    solve_definite(matrix, &mut coefficients).map_err(|error| numerical(error.to_string()))?;
    monitor.checkpoint()?;
    let gram = |c: &DenseMatrix| reduced.multiply_dense(c).and_then(|mc| c.transposed_times(&mc)).ok_or_else(misfit);
    let products = gram(&coefficients)?;
    orthonormalise(&mut coefficients, products).map_err(|error| numerical(error.to_string()))?;
    let defect = defect_of(&gram(&coefficients)?);
    let mut errors = Vec::with_capacity(m);
    for panel in 0..panels {
        monitor.checkpoint()?;
        let columns = panel * PANEL_WIDTH..m.min((panel + 1) * PANEL_WIDTH);
        let x = columns_of(vectors, columns.clone());
        let y = space_times(&space, &coefficients.slice_columns(columns.clone())).ok_or_else(misfit)?;
        let found: Option<Vec<f64>> = (0..columns.len())
            .into_par_iter()
            .map(|k| {
                let lost: Vec<f64> = x.column(k).iter().zip(y.column(k)).map(|(x, y)| x - y).collect();
                Some(norm(mass, &lost)? / norm(mass, x.column(k))?.max(f64::MIN_POSITIVE))
            })
            .collect();
        errors.extend(found.ok_or_else(misfit)?);
        monitor.progress(0.6 + 0.4 * (panel + 1) as f64 / panels as f64);
    }
    Ok(Projected { compact: Compact { space, coefficients }, errors, defect })
}

fn columns_of(vectors: &PanelMatrix, range: std::ops::Range<usize>) -> DenseMatrix {
    let mut columns = DenseMatrix::zeros(vectors.rows(), range.len());
    for (k, column) in range.enumerate() {
        columns.column_mut(k).copy_from_slice(&vectors.column(column));
    }
    columns
}

fn norm(mass: &MassMatrix, x: &[f64]) -> Option<f64> {
    let mx = mass.multiply(x)?;
    Some(x.iter().zip(&mx).map(|(x, mx)| x * mx).sum::<f64>().max(0.0).sqrt())
}

fn defect_of(gram: &DenseMatrix) -> f64 {
    let entry = |j: usize, i: usize| (gram.column(j)[i] - if i == j { 1.0 } else { 0.0 }).abs();
    (0..gram.columns())
        .flat_map(|j| (0..gram.rows()).map(move |i| (j, i)))
        .map(|(j, i)| entry(j, i))
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::{CpuSolver, SymmetricDefiniteSolver};
    use crate::basis::{InertiaCount, LevelReport};
    use crate::mesh::shape::{Shape, generate};
    use crate::monitor::Unwatched;
    use crate::operator::{MassKind, OperatorParameters, assemble};

    /// All that a solver would find on a small sphere, by a dense solve, with a space of hat functions that are averaged in twos.
    fn solved(mass: MassKind, count: usize) -> (Eigenpairs, MassMatrix) {
        let mesh = generate(Shape::Sphere, 160).unwrap();
        let parameters = OperatorParameters { mass, ..OperatorParameters::default() };
        let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
        let problem = &operator.problem;
        let n = problem.size();
        let dense_mass = match &problem.mass {
            MassMatrix::Sparse(matrix) => matrix.to_dense(),
            MassMatrix::Diagonal(diagonal) => {
                let mut dense = DenseMatrix::zeros(n, n);
                diagonal.iter().enumerate().for_each(|(k, &m)| dense.column_mut(k)[k] = m);
                dense
            }
        };
        let found = CpuSolver.lowest(problem.stiffness.to_dense(), dense_mass, count, &Unwatched).unwrap();
        let mut vectors = PanelMatrix::zeros(n, count);
        for column in 0..count {
            let panel = &mut vectors.panels_mut()[column / PANEL_WIDTH];
            for (row, value) in found.vectors.column(column).iter().enumerate() {
                panel[row * PANEL_WIDTH + column % PANEL_WIDTH] = value / problem.area.sqrt();
            }
        }
        let values: Vec<f64> = found.values.iter().map(|value| value / problem.area).collect();
        // Each function of the space is the mean of two hats that share an edge of the stiffness.
        let (mut offsets, mut indices, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            for column in [row.saturating_sub(1), row] {
                if column < n - 1
                    && indices.len() < offsets[row] + 2
                    && indices[offsets[row]..].last() != Some(&(column as u32))
                {
                    indices.push(column as u32);
                    weights.push(0.5f32);
                }
            }
            offsets.push(indices.len());
        }
        let space = SparseMatrix::new(n, n - 1, offsets, indices, weights).unwrap();
        let last = values.last().copied().unwrap();
        let pairs = Eigenpairs {
            residuals: vec![1e-9; count],
            bounds: vec![1e-6; count],
            orthonormality_defect: 1e-14,
            inertia: vec![InertiaCount { shift: last + 1.0, below: count }],
            levels: vec![LevelReport { dimension: 40, iterations: 0, shifts: 0 }],
            space: Some(space),
            values,
            vectors,
        };
        (pairs, problem.mass.scaled(problem.area))
    }

    fn exact(storage: StorageKind, precision: Precision) -> Exact {
        Exact { solver: HsimParameters::default(), storage, precision }
    }

    fn defect(basis: &Basis) -> f64 {
        let m = basis.count();
        let modes = DenseMatrix::from_columns(basis.vertices(), m, basis.lift(0..m).unwrap()).unwrap();
        defect_of(&basis.project(&modes).unwrap())
    }

    #[test]
    fn pairs_are_stored_as_columns_of_the_precision_asked_for() {
        for (precision, tolerance) in [(Precision::F32, 1e-6), (Precision::F64, 1e-12)] {
            let (pairs, mass) = solved(MassKind::Barycentric, 40);
            let (values, vectors) = (pairs.values.clone(), pairs.vectors.clone());
            let basis = exact(StorageKind::Dense, precision).basis(pairs, mass, None, &Unwatched).unwrap();
            assert_eq!((&basis.eigenvalues, basis.certificate.complete), (&values, Some(true)));
            let column: Vec<f64> = basis.lift(35..36).unwrap();
            let close = |(a, b): (&f64, &f64)| (a - b).abs() < tolerance;
            assert!(column.iter().zip(&vectors.column(35)).all(close));
            assert!(defect(&basis) < tolerance);
            assert_eq!(basis.certificate.levels.len(), 1);
        }
    }

    #[test]
    fn a_compact_basis_is_orthonormal_and_tells_how_far_it_is() {
        for kind in [MassKind::Barycentric, MassKind::Consistent] {
            let (pairs, mass) = solved(kind, 40);
            let (values, vectors) = (pairs.values.clone(), pairs.vectors.clone());
            let basis =
                exact(StorageKind::Compact, Precision::F32).basis(pairs, mass.clone(), None, &Unwatched).unwrap();
            assert_eq!(basis.eigenvalues, values);
            assert!(basis.certificate.orthonormality_defect < 1e-10 && defect(&basis) < 1e-10);
            let errors = &basis.certificate.projection_errors;
            assert_eq!(errors.len(), 40);
            assert_eq!(basis.certificate.largest_projection_error, errors.iter().copied().reduce(f64::max));
            for (k, &error) in errors.iter().enumerate() {
                let stored: Vec<f64> = basis.lift(k..k + 1).unwrap();
                let exact = vectors.column(k);
                let lost: Vec<f64> = exact.iter().zip(&stored).map(|(a, b)| a - b).collect();
                let measured = norm(&mass, &lost).unwrap() / norm(&mass, &exact).unwrap();
                assert!((measured - error).abs() < 1e-9, "{k}: {measured} {error}");
            }
            assert!(errors[0] < errors[39], "the first are the smoothest: {errors:?}");
        }
    }

    #[test]
    fn the_best_functions_of_the_space_are_taken() {
        // A space that holds all functions loses nothing.
        let (mut pairs, mass) = solved(MassKind::Consistent, 40);
        let n = mass.size();
        let identity = SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0f32; n]).unwrap();
        pairs.space = Some(identity);
        let vectors = pairs.vectors.clone();
        let basis = exact(StorageKind::Compact, Precision::F32).basis(pairs, mass, None, &Unwatched).unwrap();
        assert!(basis.certificate.largest_projection_error < Some(1e-10));
        let stored: Vec<f64> = basis.lift(39..40).unwrap();
        assert!(stored.iter().zip(vectors.column(39)).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn without_a_space_nothing_is_stored_compactly() {
        let (mut pairs, mass) = solved(MassKind::Barycentric, 5);
        pairs.space = None;
        let told = exact(StorageKind::Compact, Precision::F32).basis(pairs, mass, None, &Unwatched).unwrap_err();
        assert_eq!(told.kind(), "eigenproblem-failed");
    }

    #[test]
    fn vertices_that_are_no_unknowns_get_empty_rows() {
        let space = SparseMatrix::new(2, 2, vec![0, 1, 3], vec![1, 0, 1], vec![1.0f32, 2.0, 3.0]).unwrap();
        let all = on_all_vertices(space.clone(), Some(&[1, 3]), 5);
        assert_eq!((all.rows(), all.offsets()), (5, &[0, 0, 1, 1, 3, 3][..]));
        assert_eq!(all.row(3), space.row(1));
        assert_eq!(on_all_vertices(space.clone(), None, 2), space);
    }
}
