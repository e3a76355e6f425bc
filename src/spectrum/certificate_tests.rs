use super::*;
use crate::algebra::{CpuSolver, SymmetricDefiniteSolver};
use crate::mesh::TriangleMesh;
use crate::monitor::Unwatched;
use crate::operator::{MassKind, laplace};

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
    match &problem.mass {
        MassMatrix::Sparse(m) => m.to_dense(),
        MassMatrix::Diagonal(m) => {
            let mut dense = DenseMatrix::zeros(m.len(), m.len());
            m.iter().enumerate().for_each(|(k, m)| dense.column_mut(k)[k] = *m);
            dense
        }
    }
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

/// Row sums of absolute values of the lifted vectors, column by column.
fn lifted(case: &Case) -> Vec<Vec<f64>> {
    let product = case.space.multiply_dense(&case.coefficients).unwrap();
    (0..product.columns()).map(|k| product.column(k).to_vec()).collect()
}

#[test]
fn residuals_and_bounds_are_those_of_the_definition() {
    for kind in [MassKind::Barycentric, MassKind::Consistent] {
        // More than one block of rows, more than one panel of columns.
        let mut case = case(20, 60, 41, kind);
        let original = case.coefficients.clone();
        let certificate =
            certify(&case.problem, &case.space, &case.mass, &mut case.coefficients, &case.ritz, &Unwatched).unwrap();
        let lumped = case.problem.mass.lumped();
        let factor = if kind == MassKind::Consistent { 2.0 } else { 1.0 };
        for (k, x) in lifted(&case).iter().enumerate() {
            let largest = x.iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
            assert!(largest > 0.0);
            let same = case.coefficients.column(k) == original.column(k);
            assert!(same || case.coefficients.column(k).iter().zip(original.column(k)).all(|(a, b)| *a == -b));
            let sx = case.problem.stiffness.multiply(x).unwrap();
            let mx = case.problem.mass.multiply(x).unwrap();
            let r: Vec<f64> = sx.iter().zip(&mx).map(|(s, m)| s - case.ritz[k] * m).collect();
            let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            if k > 0 {
                assert!((certificate.residuals[k] - norm(&r) / norm(&sx)).abs() < 1e-9);
            } else {
                assert!(certificate.residuals[0] < 1e-6);
            }
            let dual = r.iter().zip(&lumped).map(|(r, m)| r * r / m).sum::<f64>().sqrt();
            assert!((certificate.bounds[k] * case.problem.area / factor - dual).abs() < 1e-7 * dual.max(1.0));
        }
        assert!(certificate.orthonormality_defect < 1e-10);
    }
}

#[test]
fn every_bound_encloses_an_exact_eigenvalue() {
    for kind in [MassKind::Barycentric, MassKind::Consistent, MassKind::Voronoi] {
        let mut case = case(12, 90, 30, kind);
        let n = case.problem.stiffness.rows();
        let exact = CpuSolver
            .lowest(case.problem.stiffness.to_dense(), dense_mass(&case.problem), n, &Unwatched)
            .unwrap()
            .values;
        let certificate =
            certify(&case.problem, &case.space, &case.mass, &mut case.coefficients, &case.ritz, &Unwatched).unwrap();
        for (k, (theta, bound)) in case.ritz.iter().zip(&certificate.bounds).enumerate() {
            let bound = bound * case.problem.area;
            let nearest = exact.iter().map(|e| (e - theta).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= bound + 1e-9, "{kind:?} {k}: {nearest} > {bound}");
            assert!(exact[k] <= theta + 1e-9);
            // A bound that says nothing would pass the test above.
            assert!(bound < 2.5 * theta.max(1.0), "{bound} of {theta}");
        }
    }
}

#[test]
fn exact_pairs_have_no_residual() {
    let problem = laplace::assemble(&torus(9), MassKind::Barycentric).unwrap();
    let n = problem.stiffness.rows();
    let all = SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0f32; n]).unwrap();
    let (s, mass) = problem.restrict(&all, &Unwatched).unwrap();
    let mut pairs = CpuSolver.lowest(s.to_dense(), mass.to_dense(), 20, &Unwatched).unwrap();
    let certificate = certify(&problem, &all, &mass, &mut pairs.vectors, &pairs.values, &Unwatched).unwrap();
    assert!(certificate.residuals.iter().all(|r| *r < 1e-9), "{:?}", certificate.residuals);
    assert!(certificate.bounds.iter().all(|b| *b < 1e-7));
    assert!(certificate.orthonormality_defect < 1e-11);
}

#[test]
fn a_basis_that_is_not_orthonormal_is_found_out() {
    let mut case = case(9, 20, 8, MassKind::Barycentric);
    case.coefficients.column_mut(3).iter_mut().for_each(|x| *x *= 1.5);
    let certificate =
        certify(&case.problem, &case.space, &case.mass, &mut case.coefficients, &case.ritz, &Unwatched).unwrap();
    assert!((certificate.orthonormality_defect - 1.25).abs() < 1e-9);
}

#[test]
fn sizes_that_do_not_fit_are_refused_and_no_pairs_are_certified_at_once() {
    let mut case = case(9, 20, 8, MassKind::Barycentric);
    let found = certify(&case.problem, &case.space, &case.mass, &mut case.coefficients, &case.ritz[1..], &Unwatched);
    assert!(found.unwrap_err().to_string().starts_with("7 Ritz values, coefficients of 18×8"));
    let mut none = DenseMatrix::zeros(case.space.columns(), 0);
    let found = certify(&case.problem, &case.space, &case.mass, &mut none, &[], &Unwatched).unwrap();
    assert_eq!(found, Certificate::default());
}
