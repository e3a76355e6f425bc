//! Enclosures against dense solutions of the whole problem.

use super::super::approximate::{ApproximationParameters, Space, ritz};
use super::super::heat::HeatParameters;
use super::*;
use crate::operator::{Boundary, MassKind, MeshOperator, OperatorKind, OperatorParameters, Potential, assemble};
use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate, noisy};

fn operator(mesh: &TriangleMesh, operator: OperatorKind, mass: MassKind, boundary: Boundary) -> MeshOperator {
    assemble(mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched).unwrap()
}

fn dense(matrix: &MassMatrix) -> DenseMatrix {
    matrix.to_dense()
}

/// The exact eigenvalues by a dense solver, on unit area.
fn exact(problem: &EigenProblem, count: usize) -> Vec<f64> {
    let pairs = CpuSolver.lowest(problem.stiffness.to_dense(), dense(&problem.mass), count, &Unwatched);
    pairs.unwrap().values
}

/// Encloses `count` pairs in a space of `dimension` columns, in windows of so many pairs, and holds them against the
/// exact values. The mean and the largest bound, in percent.
fn hold(mesh: &TriangleMesh, operator: &MeshOperator, count: usize, dimension: usize, window: usize) -> (f64, f64) {
    hold_by(mesh, operator, count, dimension, window, false)
}

/// The same with corrections by a factor, if asked.
fn hold_by(
    mesh: &TriangleMesh,
    operator: &MeshOperator,
    count: usize,
    dimension: usize,
    window: usize,
    by_factor: bool,
) -> (f64, f64) {
    let problem = &operator.problem;
    let space = Space::Heat(HeatParameters::default());
    let mut parameters = ApproximationParameters { count, dimension, space, goal: None, certify: true, seed: 3 };
    let computed = (count + guards(count)).min(dimension);
    let ritz = ritz(mesh.into(), operator, &mut parameters, computed, &Unwatched).unwrap();
    let values = &ritz.pairs.values;
    let energy = Energy::new(problem, operator.floor, &Unwatched).unwrap();
    let shift = gaps(values, &vec![0.0; values.len()], count - 1..values.len() - 1)[0];
    let pencil = ShiftedPencil::new(problem, &Unwatched).unwrap();
    let (below, radius) = pencil.count(shift).unwrap();
    let exact = exact(problem, values.len().max(below) + 1);
    assert_eq!(below, exact.partition_point(|&value| value < shift));
    let sigma = SHIFT * (shift + energy.floor());
    let deviation = Deviation::new(problem, &ritz, energy.floor() + sigma, &Unwatched).unwrap();
    let space = energy.in_order(&ritz.space);
    let pole = (shift - radius, below);
    let solver = energy.solver(&pencil, sigma).unwrap();
    let corrections = if by_factor { Corrections::Factor(&solver) } else { Corrections::Cycles(sigma) };
    let lowest = lower_bounds(&energy, &space, &ritz, &deviation, pole, corrections, window, &Unwatched).unwrap();
    let above = deviation.upper_bounds(values, energy.floor() + sigma);
    let scale = exact.last().unwrap().abs();
    // The oracle has rounding errors of its own, as a share of the largest eigenvalue.
    let masses = problem.mass.lumped();
    let row = |k: usize| problem.stiffness.row(k).1.iter().map(|s| s.abs()).sum::<f64>() / masses[k];
    let rounding = 4.0 * f64::EPSILON * (0..problem.size()).map(row).fold(0.0, f64::max);
    let (mut sum, mut largest) = (0.0, 0f64);
    for k in 0..below.min(values.len()) {
        let slack = rounding.max(1e-11 * scale);
        assert!(lowest[k] <= exact[k] + slack, "pair {k}: {} is above {}", lowest[k], exact[k]);
        assert!(above[k] >= exact[k] - slack, "pair {k}: {} is below {}", above[k], exact[k]);
        if k < count && exact[k] > 1e-6 * scale {
            let bound = 100.0 * (above[k] - lowest[k]) / exact[k];
            sum += bound / count as f64;
            largest = largest.max(bound);
        }
    }
    (sum, largest)
}

#[test]
fn every_index_is_enclosed_whatever_the_operator_the_mass_and_the_boundary() {
    let sphere = noisy(&generate(Shape::Sphere, 900).unwrap(), 0.02, 5).unwrap();
    let disk = generate(Shape::Disk, 900).unwrap();
    let well = || OperatorKind::Hamiltonian { potential: Potential::Curvature { t: 0.5 } };
    let cases = [
        (&sphere, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann),
        (&sphere, OperatorKind::Auto, MassKind::Consistent, Boundary::Neumann),
        (&sphere, well(), MassKind::Barycentric, Boundary::Neumann),
        (&disk, OperatorKind::Auto, MassKind::Barycentric, Boundary::Dirichlet),
        (&disk, OperatorKind::Auto, MassKind::Consistent, Boundary::Neumann),
    ];
    for (case, (mesh, kind, mass, boundary)) in cases.into_iter().enumerate() {
        let operator = operator(mesh, kind, mass, boundary);
        let (mean, largest) = hold(mesh, &operator, 40, 120, WINDOW);
        assert!(mean < 6.0 && largest < 20.0, "case {case}: {mean} and {largest} %");
    }
}

#[test]
fn windows_enclose_from_one_pole_to_the_next() {
    let mesh = noisy(&generate(Shape::Torus, 1_200).unwrap(), 0.02, 7).unwrap();
    let operator = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
    let whole = hold(&mesh, &operator, 120, 300, 512);
    let parts = hold(&mesh, &operator, 120, 300, 48);
    assert!(whole.0 < 3.0 && parts.0 < 2.0 * whole.0, "{whole:?} and {parts:?}");
}

#[test]
fn a_factor_encloses_as_closely_as_cycles_and_where_they_fail() {
    let sphere = noisy(&generate(Shape::Sphere, 900).unwrap(), 0.02, 5).unwrap();
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let operator = operator(&sphere, OperatorKind::Auto, mass, Boundary::Neumann);
        let (cycles, factor) =
            (hold(&sphere, &operator, 40, 120, WINDOW), hold_by(&sphere, &operator, 40, 120, WINDOW, true));
        assert!(factor.0 < 1.1 * cycles.0 && factor.1 < 1.1 * cycles.1, "{factor:?} by a factor, {cycles:?} by cycles");
    }
    // A disk whose triangles shrink toward its centre.
    let mut disk = generate(Shape::Disk, 900).unwrap();
    for p in &mut disk.positions {
        let r = p.iter().map(|x| x * x).sum::<f64>().sqrt();
        *p = p.map(|x| x * r.powi(3));
    }
    let operator = operator(&disk, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Neumann);
    let (cycles, factor) = (hold(&disk, &operator, 20, 120, WINDOW), hold_by(&disk, &operator, 20, 120, WINDOW, true));
    assert!(factor.1 < 20.0 && factor.1 < cycles.1, "{factor:?} by a factor, {cycles:?} by cycles");
}

/// Ritz vectors of any quality: the bounds hold for random subspaces too, and say that they are wide.
#[test]
fn bad_pairs_have_wide_bounds_and_none_that_is_wrong() {
    let mesh = generate(Shape::Sphere, 400).unwrap();
    let operator = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
    let problem = &operator.problem;
    let energy = Energy::new(problem, 0.0, &Unwatched).unwrap();
    let exact = exact(problem, 60);
    for seed in 0..4 {
        let mut random = SplitMix64::new(seed);
        // Steps on random cells: the constant is there, and little else.
        let (n, d) = (problem.size(), 60);
        let indices: Vec<u32> =
            (0..n).map(|row| if row < d { row as u32 } else { (random.unit() * d as f64) as u32 }).collect();
        let space = SparseMatrix::new(n, d, (0..=n).collect(), indices, vec![1f32; n]).unwrap();
        let (stiffness, mass) = galerkin(&space, &problem.stiffness, &problem.mass, &Unwatched).unwrap();
        let pairs = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), 30, &Unwatched).unwrap();
        let ritz = Ritz { space, mass, stiffness, pairs };
        let shift = 0.5 * (exact[25] + exact[24]);
        let (below, radius) = ShiftedPencil::new(problem, &Unwatched).unwrap().count(shift).unwrap();
        let sigma = SHIFT * shift;
        let deviation = Deviation::new(problem, &ritz, sigma, &Unwatched).unwrap();
        let space = energy.in_order(&ritz.space);
        let (pole, cycles) = ((shift - radius, below), Corrections::Cycles(sigma));
        let lowest = lower_bounds(&energy, &space, &ritz, &deviation, pole, cycles, WINDOW, &Unwatched).unwrap();
        for (k, (low, exact)) in lowest.iter().zip(&exact).enumerate() {
            assert!(*low <= exact + 1e-9, "seed {seed}, pair {k}: {low} is above {exact}");
        }
        // Far more eigenvalues than Ritz values lie below a shift among these: the indices shift, and the bounds hold.
        let estimates = vec![0.0; ritz.pairs.values.len()];
        let whole = enclose(&energy, problem, &ritz, &estimates, 4, &Unwatched);
        match whole {
            Ok(Enclosed { bounds, .. }) => {
                for (k, (bound, value)) in bounds.iter().zip(&ritz.pairs.values).enumerate() {
                    assert!((value - exact[k]).abs() <= bound * (1.0 + 1e-9) + 1e-9, "seed {seed}, pair {k}");
                }
            }
            Err(error) => assert!(matches!(error, ApproximationError::Unproven { .. }), "{error}"),
        }
    }
}
