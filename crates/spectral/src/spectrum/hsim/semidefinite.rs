//! Pairs of a semidefinite pencil of whose kernel only the dimension is known, such as the rigid motions of an elastic
//! object, from a Krylov space.
//!
//! The space needs nothing to start from, and takes a solve for each of its columns where inverse iterations take
//! several. Residuals (4.6) are relative to `‖S x‖`, which tells nothing next to zero: what is measured and judged is
//! the pencil `S / σ + M`, where `σ` is the lowest eigenvalue that is not zero.

use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;

use super::bare::{in_order, plus_mass};
use super::certify::Goal;
use super::hierarchy;
use super::kernel::Kernel;
use super::lanczos;
use super::level::NO_KERNEL;
use super::solve::{Columns, Finest, Task};
use super::tuning::TUNING;
use super::{Eigenpairs, HsimError, HsimParameters, Selection};
use crate::operator::EigenProblem;

/// The least shift, as a share of the largest eigenvalue: a single triangle that is thin makes that of an elastic
/// object so large that modes lie at `1e-12` of it. What rounding lets one count is judged at the end.
const LEAST_SHIFT: f64 = 1e-13;

/// So many pairs are looked for at least: more than half of fewer may be those of the kernel, with no shift in their
/// middle.
const FEWEST: usize = 16;

/// The pairs that a space has to hold where so many are wanted.
fn looked_for(count: usize) -> usize {
    (count + TUNING.krylov.beyond_modes).max(FEWEST)
}

/// Eigenpairs of `S / σ + M`, those of the kernel included, whose values are about one.
#[derive(Debug)]
pub(in crate::spectrum) struct AboveKernel {
    pub pairs: Eigenpairs,
    /// `σ`.
    pub unit: f64,
}

/// The most columns of the Krylov space in which so many modes of an object with so many unknowns are looked for;
/// `None` where there is no room for one. They take most of the memory.
pub fn krylov_columns(unknowns: usize, count: usize, tolerance: f64) -> Option<usize> {
    let pairs = looked_for(count);
    lanczos::has_room(unknowns, pairs, tolerance).then(|| lanczos::most_sparing(unknowns, pairs, tolerance))
}

/// Computes the lowest eigenpairs of a pencil whose rows are all unknowns, in its own units; `area` has to be 1.
/// Nothing where a Krylov space does not hold them, as where eigenvalues have far more eigenvectors than its blocks
/// have columns. Stages: `hierarchy`, `iterate`, `certify`.
///
/// # Errors
/// [`HsimError`], as [`solve`](super::solve).
pub(in crate::spectrum) fn above_kernel(
    problem: &EigenProblem,
    kernel: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<Option<AboveKernel>, HsimError> {
    parameters.check()?;
    let (n, HsimParameters { tolerance, seed, .. }) = (problem.size(), *parameters);
    let Selection::Count(count) = parameters.selection else { return Ok(None) };
    let Some(most) = krylov_columns(n, count, tolerance).filter(|_| kernel < count) else { return Ok(None) };
    let pairs = looked_for(count);
    monitor.stage("hierarchy");
    monitor.checkpoint()?;
    let mut finest = in_order(problem, parameters.selection, monitor)?;
    // Translations along all axes at once would be taken for constants.
    finest.level.component.fill(NO_KERNEL);
    monitor.stage("iterate");
    let wanted = lanczos::KrylovRequest::lowest(n, pairs, hierarchy::columns(pairs, n), tolerance, seed);
    let (leave, zeros) = (lanczos::Leave::WhenFull, Some(kernel));
    let wanted = lanczos::KrylovRequest { most, least_shift: LEAST_SHIFT, leave, zeros, ..wanted };
    let found = {
        let Finest { level, symbolic, .. } = &finest;
        lanczos::start(level, symbolic, &Kernel::new(level), wanted, monitor)?
    };
    let Some(lanczos::KrylovPairs { values, vectors, .. }) = found else { return Ok(None) };
    let Some(&unit) = values.get(kernel).filter(|value| **value > 0.0 && value.is_finite()) else { return Ok(None) };
    let stiffness = &finest.level.stiffness;
    let divided = SparseMatrix::from_sorted_parts(
        n,
        n,
        stiffness.offsets().to_vec(),
        stiffness.indices().to_vec(),
        stiffness.values().iter().map(|value| value / unit).collect(),
    );
    finest.level.stiffness = plus_mass(&divided, &finest.level.mass, 1.0);
    drop(divided);
    let task = Task {
        // Asked for the number of rows alone.
        mesh: &TriangleMesh { positions: vec![[0.0; 3]; n], faces: Vec::new(), ..Default::default() },
        problem,
        parameters,
        finest: &finest,
        kernel: &Kernel::new(&finest.level),
        goal: Goal::Count(count),
        nontrivial: count,
        offset: 0.0,
        monitor,
    };
    let values = values.into_iter().map(|value| 1.0 + value / unit).collect();
    let (mut pairs, report) = task.solve_or_begin_again(vectors, values, None, Columns::Ritz)?;
    pairs.levels = vec![report];
    Ok(Some(AboveKernel { pairs, unit }))
}

#[cfg(test)]
mod tests {
    use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};

    use super::*;
    use crate::operator::elastic::{self, ElasticBody, Material};

    const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

    fn shell(vertices: usize) -> EigenProblem {
        let mesh = generate(Shape::Torus, vertices).unwrap();
        let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.05 };
        elastic::assemble(body, &MATERIAL, &Vec::new().into(), &Unwatched).unwrap().problem
    }

    fn parameters(count: usize, tolerance: f64) -> HsimParameters {
        HsimParameters { selection: Selection::Count(count), tolerance, ..HsimParameters::default() }
    }

    #[test]
    fn a_krylov_space_holds_rigid_motions_and_modes_as_the_dense_solver_has_them() {
        let problem = shell(400);
        let n = problem.size();
        let mut mass = DenseMatrix::zeros(n, n);
        problem.mass.lumped().iter().enumerate().for_each(|(k, &m)| mass.column_mut(k)[k] = m);
        let exact = CpuSolver.lowest(problem.stiffness.to_dense(), mass, 60, &Unwatched).unwrap().values;
        for (count, tolerance) in [(60, 1e-6), (40, 1e-3), (7, 1e-3)] {
            let found = above_kernel(&problem, 6, &parameters(count, tolerance), &Unwatched).unwrap();
            let AboveKernel { pairs, unit } = found.expect("a space that holds them");
            assert!((unit / exact[6] - 1.0).abs() < 10.0 * tolerance, "{unit} is not {}", exact[6]);
            assert_eq!(pairs.values.len(), count);
            assert!(!pairs.inertia.is_empty() && pairs.residuals.iter().all(|residual| *residual <= tolerance));
            for (k, value) in pairs.values.iter().enumerate() {
                let (value, exact) = ((value - 1.0) * unit, exact[k].max(0.0));
                assert!((value - exact).abs() <= tolerance * (exact + unit), "{count}, {k}: {value} is not {exact}");
            }
        }
    }

    #[test]
    fn what_there_is_no_room_for_is_left_to_others() {
        let problem = shell(400);
        assert!(krylov_columns(problem.size(), 400, 1e-3).is_none());
        for (kernel, count) in [(6, 400), (6, 6), (6, 3)] {
            assert!(above_kernel(&problem, kernel, &parameters(count, 1e-3), &Unwatched).unwrap().is_none());
        }
        // The more of them there are and the closer they are to be, the more columns.
        let columns = |count, tolerance| krylov_columns(100_000, count, tolerance).unwrap();
        assert!(columns(100, 1e-3) < columns(200, 1e-3) && columns(100, 1e-3) < columns(100, 1e-6));
        assert!(columns(500, 1e-3) < 1050);
    }
}
