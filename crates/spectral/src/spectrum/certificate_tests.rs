use chladni_algebra::gpu::{Accelerator, GpuChoice};
use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver, compact_order, solve_definite};
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble, laplace};
use crate::spectrum::approximate::{ApproximationParameters, Space, ritz};
use crate::spectrum::domain::Domain;
use crate::spectrum::energy::KernelAndGoal;
use crate::spectrum::heat::HeatParameters;

/// A bumpy torus of `k × 2k` vertices.
fn torus(k: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let (rows, columns) = (2 * k, k);
    for i in 0..rows {
        for j in 0..columns {
            let (s, t) = (f64::from(i) / f64::from(rows), f64::from(j) / f64::from(columns));
            let (s, t) = (s * std::f64::consts::TAU, t * std::f64::consts::TAU);
            let r = 0.4 + 0.05 * (3.0 * s).sin();
            mesh.positions.push([(1.0 + r * t.cos()) * s.cos(), (1.0 + r * t.cos()) * s.sin(), r * t.sin()]);
            let v = |i: u32, j: u32| (i % rows) * columns + j % columns;
            mesh.faces.push([v(i, j), v(i + 1, j), v(i + 1, j + 1)]);
            mesh.faces.push([v(i, j), v(i + 1, j + 1), v(i, j + 1)]);
        }
    }
    mesh
}

/// Piecewise constants on patches, smoothed twice by averaging: crude local functions, at most `d` of them.
fn space(problem: &EigenProblem, d: usize) -> SparseMatrix<f32> {
    let s = &problem.stiffness;
    let n = s.rows();
    let size = n.div_ceil(d);
    let d = n.div_ceil(size);
    let mut rows: Vec<Vec<f64>> = vec![vec![0.0; d]; n];
    for (patch, members) in compact_order(s, size).chunks(size).enumerate() {
        members.iter().for_each(|&row| rows[row as usize][patch] = 1.0);
    }
    for _ in 0..2 {
        rows = (0..n)
            .map(|row| {
                let neighbours = s.row(row).0;
                (0..d)
                    .map(|c| neighbours.iter().map(|&v| rows[v as usize][c]).sum::<f64>() / neighbours.len() as f64)
                    .collect()
            })
            .collect();
    }
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in &rows {
        for (column, &value) in row.iter().enumerate().filter(|(_, v)| **v > 0.0) {
            indices.push(column as u32);
            values.push(value as f32);
        }
        offsets.push(indices.len());
    }
    SparseMatrix::new(n, d, offsets, indices, values).unwrap()
}

fn dense_mass(problem: &EigenProblem) -> DenseMatrix {
    problem.mass.to_dense()
}

struct Case {
    problem: EigenProblem,
    space: SparseMatrix<f32>,
    mass: SparseMatrix,
    ritz: Vec<f64>,
    coefficients: DenseMatrix,
}

fn case(k: u32, d: usize, count: usize, kind: MassKind) -> Case {
    let problem = laplace::assemble(&torus(k), kind).unwrap();
    let space = space(&problem, d);
    let (s, mass) = problem.restrict(&space, &Unwatched).unwrap();
    let pairs = CpuSolver.lowest(s.to_dense(), mass.to_dense(), count, &Unwatched).unwrap();
    Case { problem, space, mass, ritz: pairs.values, coefficients: pairs.vectors }
}

impl Case {
    fn certify(&mut self) -> Certificate {
        let Self { problem, space, mass, ritz, coefficients } = self;
        let energy = Energy::new(problem, 0.0, &Unwatched).unwrap();
        certify(&energy, problem, space, mass, coefficients, ritz, None, &Unwatched).unwrap().0
    }

    /// All eigenvalues, by a dense solve.
    fn exact(&self) -> Vec<f64> {
        let n = self.problem.size();
        CpuSolver.lowest(self.problem.stiffness.to_dense(), dense_mass(&self.problem), n, &Unwatched).unwrap().values
    }
}

/// Row sums of absolute values of the lifted vectors, column by column.
fn lifted(case: &Case) -> Vec<Vec<f64>> {
    let product = case.space.multiply_dense(&case.coefficients);
    (0..product.columns()).map(|k| product.column(k).to_vec()).collect()
}

/// `‖r‖_{A⁻¹}` of a column, by a dense Cholesky factor.
fn inverse_norm(problem: &EigenProblem, sigma: f64, r: &[f64]) -> f64 {
    let mut matrix = problem.stiffness.to_dense();
    let mass = dense_mass(problem);
    matrix.values_mut().iter_mut().zip(mass.values()).for_each(|(a, m)| *a += sigma * m);
    let mut solved = DenseMatrix::from_columns(r.len(), 1, r.to_vec());
    solve_definite(matrix, &mut solved).unwrap();
    solved.column(0).iter().zip(r).map(|(y, r)| y * r).sum::<f64>().sqrt()
}

#[test]
fn residuals_are_those_of_the_definition_and_their_norms_are_enclosed() {
    for kind in [MassKind::Barycentric, MassKind::Consistent] {
        // More than one block of rows, more than one panel of columns.
        let mut case = case(20, 60, 41, kind);
        let original = case.coefficients.clone();
        let certificate = case.certify();
        let energy = Energy::new(&case.problem, 0.0, &Unwatched).unwrap();
        let (measures, _) = energy
            .measure(&mut case.space, &case.coefficients, &case.ritz, LARGEST_KERNEL_VALUE, None, &Unwatched)
            .unwrap();
        for (k, x) in lifted(&case).iter().enumerate() {
            let largest = x.iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
            assert!(largest > 0.0);
            let same = case.coefficients.column(k) == original.column(k);
            assert!(same || case.coefficients.column(k).iter().zip(original.column(k)).all(|(a, b)| *a == -b));
            let sx = case.problem.stiffness.multiply(x);
            let mx = case.problem.mass.multiply(x);
            let r: Vec<f64> = sx.iter().zip(&mx).map(|(s, m)| s - case.ritz[k] * m).collect();
            let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            if k == 0 {
                assert!(certificate.residuals[0] < 1e-6);
                continue;
            }
            assert!((certificate.residuals[k] - norm(&r) / norm(&sx)).abs() < 1e-9);
            let exact = inverse_norm(&case.problem, measures[k].sigma, &r);
            let (below, above) = (measures[k].below, measures[k].above);
            // Residuals are stored in single precision, which only the upper end accounts for.
            assert!(below <= exact * (1.0 + 1e-7) && exact <= above, "{kind:?} {k}: {below} {exact} {above}");
            // An enclosure that says nothing would pass the test above.
            assert!(below > 0.7 * exact && above < 3.0 * exact, "{kind:?} {k}: {below} {exact} {above}");
        }
        assert!(certificate.orthonormality_defect < 1e-10);
    }
}

/// The software device that tests run on; `None` where there is none and none is required.
fn accelerator() -> Option<Accelerator> {
    let wanted = std::env::var("CHLADNI_TEST_GPU").unwrap_or_default();
    let name = if matches!(wanted.as_str(), "" | "required") { "llvmpipe" } else { &wanted };
    let accelerator = Accelerator::new(GpuChoice::Name(name.into()));
    accelerator.open();
    match accelerator.reason() {
        None => Some(accelerator),
        Some(reason) if wanted.is_empty() => {
            println!("skipped: {reason}");
            None
        }
        Some(reason) => panic!("{reason}"),
    }
}

#[test]
fn a_graphics_card_measures_what_the_cpu_measures() {
    let Some(accelerator) = accelerator() else { return };
    for (kind, floor) in [(MassKind::Barycentric, 0.0), (MassKind::Consistent, -3.0)] {
        let mut case = case(20, 60, 41, kind);
        let energy = Energy::new(&case.problem, floor, &Unwatched).unwrap();
        let (expected, density) = energy
            .measure(&mut case.space, &case.coefficients, &case.ritz, LARGEST_KERNEL_VALUE, Some(1e-3), &Unwatched)
            .unwrap();
        let limits = KernelAndGoal { kernel: LARGEST_KERNEL_VALUE, goal: Some(1e-3) };
        let space = energy.in_order(&case.space);
        let (found, found_density) = energy
            .measure_on_device(&accelerator, &space, &case.coefficients, &case.ritz, limits, &Unwatched)
            .unwrap()
            .unwrap();
        assert_eq!((found.len(), accelerator.fallbacks()), (41, 0));
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found.sigma, expected.sigma);
            // Of the constant, all energies are rounding.
            let near = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * b.abs() + 1e-11;
            let same = near(found.sums.residual, expected.sums.residual, 1e-9)
                && near(found.sums.dual, expected.sums.dual, 1e-9)
                && near(found.sums.stiffness, expected.sums.stiffness, 1e-9)
                && near(found.sums.mass, expected.sums.mass, 1e-12)
                && near(found.sums.energy, expected.sums.energy, 1e-9)
                && near(found.sums.lowest, expected.sums.lowest, 1e-12)
                && near(found.sums.highest, expected.sums.highest, 1e-12);
            assert!(same, "{kind:?} {k}: {found:?} instead of {expected:?}");
            // Cycles are in single precision. On so small a mesh the CPU solves by a factor where a bound is wide, and
            // has the norm itself.
            assert!(found.below > 0.95 * expected.below, "{kind:?} {k}: {found:?} instead of {expected:?}");
            assert!(found.above >= expected.below, "{kind:?} {k}: {found:?} instead of {expected:?}");
            let close = found.above < 4.5 * found.below || found.bound < 0.1 * (case.ritz[k] - floor);
            assert!(close, "{kind:?} {k}: {found:?} instead of {expected:?}");
        }
        let total = |density: &Option<Vec<f64>>| density.as_ref().unwrap().iter().sum::<f64>();
        let (found, expected) = (total(&found_density), total(&density));
        assert!((found / expected - 1.0).abs() < 0.05, "{found} instead of {expected}");
    }
}

#[test]
fn a_graphics_card_encloses_pairs_as_closely_as_the_cpu_by_the_same_trees() {
    let Some(accelerator) = accelerator() else { return };
    // Obtuse triangles, several patches and levels.
    let mesh = noisy(&generate(Shape::Torus, 7_000).unwrap(), 0.25, 3).unwrap();
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let parameters = OperatorParameters { operator: OperatorKind::Auto, mass, boundary: Boundary::Neumann };
        let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
        let mut wanted = ApproximationParameters {
            count: 40,
            dimension: 120,
            space: Space::Heat(HeatParameters::default()),
            goal: None,
            certify: false,
            seed: 0,
        };
        let mut ritz = ritz(Domain::from(&mesh), &operator, &mut wanted, 40, &Unwatched).unwrap();
        let (problem, pairs) = (&operator.problem, &ritz.pairs);
        let energy = Energy::on(Some((&mesh).into()), problem, 0.0, &Unwatched).unwrap();
        let (expected, _) = energy
            .measure(&mut ritz.space, &pairs.vectors, &pairs.values, LARGEST_KERNEL_VALUE, None, &Unwatched)
            .unwrap();
        let limits = KernelAndGoal { kernel: LARGEST_KERNEL_VALUE, goal: None };
        let space = energy.in_order(&ritz.space);
        let (found, _) = energy
            .measure_on_device(&accelerator, &space, &pairs.vectors, &pairs.values, limits, &Unwatched)
            .unwrap()
            .unwrap();
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate().skip(1) {
            let [own, other] = [found, expected].map(|measure| measure.above / measure.below);
            assert!(other < 2.0 && (own / other - 1.0).abs() < 1e-3, "{mass:?} {k}: {found:?} instead of {expected:?}");
        }
    }
}

#[test]
fn every_bound_encloses_an_exact_eigenvalue() {
    for kind in [MassKind::Barycentric, MassKind::Consistent, MassKind::Voronoi] {
        let mut case = case(12, 90, 30, kind);
        let exact = case.exact();
        let certificate = case.certify();
        for (k, (theta, bound)) in case.ritz.iter().zip(&certificate.bounds).enumerate() {
            let bound = bound * case.problem.area;
            let nearest = exact.iter().map(|e| (e - theta).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= bound, "{kind:?} {k}: {nearest} > {bound}");
            assert!(exact[k] <= theta + 1e-9);
            assert!(bound < 2.5 * theta.max(1.0), "{bound} of {theta}");
        }
    }
}

#[test]
fn estimates_are_within_a_factor_of_three_of_the_errors() {
    let mut case = case(16, 120, 40, MassKind::Barycentric);
    let exact = case.exact();
    let certificate = case.certify();
    let ratios = (1..40).map(|k| certificate.estimates[k] * case.problem.area / (case.ritz[k] - exact[k]));
    let good = ratios.filter(|ratio| (1.0 / 3.0..3.0).contains(ratio)).count();
    assert!(good >= 37, "{good} of 39");
}

#[test]
fn bounds_hold_for_what_are_no_ritz_pairs_and_for_negative_potentials() {
    let mut case = case(10, 60, 12, MassKind::Barycentric);
    // A well of depth 30 on half of the vertices, and vectors that do not belong to it.
    let depth = 30.0;
    let mut values = case.problem.stiffness.values().to_vec();
    let mass = case.problem.mass.lumped();
    for row in (0..mass.len()).step_by(2) {
        let at = case.problem.stiffness.row(row).0.binary_search(&(row as u32)).unwrap();
        values[case.problem.stiffness.offsets()[row] + at] -= depth * mass[row];
    }
    let s = &case.problem.stiffness;
    case.problem.stiffness =
        SparseMatrix::from_sorted_parts(s.rows(), s.columns(), s.offsets().to_vec(), s.indices().to_vec(), values);
    case.ritz.iter_mut().for_each(|theta| *theta -= 0.5 * depth);
    let exact = case.exact();
    let Case { problem, space, mass, ritz, coefficients } = &mut case;
    let energy = Energy::new(problem, -depth, &Unwatched).unwrap();
    let certificate = certify(&energy, problem, space, mass, coefficients, ritz, None, &Unwatched).unwrap().0;
    for (theta, bound) in ritz.iter().zip(&certificate.bounds) {
        let nearest = exact.iter().map(|e| (e - *theta).abs()).fold(f64::INFINITY, f64::min);
        assert!(nearest <= bound * problem.area, "{nearest} > {bound}");
    }
}

#[test]
fn exact_pairs_have_no_residual() {
    let problem = laplace::assemble(&torus(9), MassKind::Barycentric).unwrap();
    let n = problem.stiffness.rows();
    let mut all = SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0f32; n]).unwrap();
    let (s, mass) = problem.restrict(&all, &Unwatched).unwrap();
    let mut pairs = CpuSolver.lowest(s.to_dense(), mass.to_dense(), 20, &Unwatched).unwrap();
    let energy = Energy::new(&problem, 0.0, &Unwatched).unwrap();
    let values = &pairs.values;
    let certificate =
        certify(&energy, &problem, &mut all, &mass, &mut pairs.vectors, values, None, &Unwatched).unwrap().0;
    assert!(certificate.residuals.iter().all(|r| *r < 1e-9), "{:?}", certificate.residuals);
    assert!(certificate.bounds.iter().all(|b| *b < 1e-7));
    assert!(certificate.orthonormality_defect < 1e-11);
}

#[test]
fn a_basis_that_is_not_orthonormal_is_found_out() {
    let mut case = case(9, 20, 8, MassKind::Barycentric);
    case.coefficients.column_mut(3).iter_mut().for_each(|x| *x *= 1.5);
    let certificate = case.certify();
    assert!((certificate.orthonormality_defect - 1.25).abs() < 1e-9);
}

#[test]
fn sizes_that_do_not_fit_are_refused_and_no_pairs_are_certified_at_once() {
    let mut case = case(9, 20, 8, MassKind::Barycentric);
    let Case { problem, space, mass, ritz, coefficients } = &mut case;
    let energy = Energy::new(problem, 0.0, &Unwatched).unwrap();
    let found = certify(&energy, problem, space, mass, coefficients, &ritz[1..], None, &Unwatched);
    assert!(found.unwrap_err().to_string().starts_with("7 Ritz values, coefficients of 18×8"));
    let mut none = DenseMatrix::zeros(space.columns(), 0);
    let (found, _) = certify(&energy, problem, space, mass, &mut none, &[], None, &Unwatched).unwrap();
    assert_eq!(found, Certificate::default());
}
