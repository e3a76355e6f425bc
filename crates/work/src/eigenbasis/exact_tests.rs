//! With a stand-in for the solver: a dense solve of a small sphere.

use chladni_algebra::{CpuSolver, DenseMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::basis::{InertiaCount, LevelReport};
use chladni_spectral::operator::{MassKind, OperatorParameters, assemble};

use super::super::compact::{defect_of, norm};
use super::*;

/// All that a solver would find on a small sphere, by a dense solve, with a space of hat functions that are averaged in
/// twos.
fn solved(mass: MassKind, count: usize) -> (Eigenpairs, MassMatrix) {
    let mesh = generate(Shape::Sphere, 160).unwrap();
    let parameters = OperatorParameters { mass, ..OperatorParameters::default() };
    let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
    let problem = &operator.problem;
    let n = problem.size();
    let dense_mass = problem.mass.to_dense();
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
        first: 0,
        on_bounds: Vec::new(),
        cut: None,
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

fn exact(storage: StorageKind) -> Exact {
    Exact { solver: HsimParameters::default(), storage, precision: None }
}

fn defect(basis: &Basis) -> f64 {
    let m = basis.count();
    let modes = DenseMatrix::from_columns(basis.vertices(), m, basis.lift(0..m).unwrap());
    defect_of(&basis.project(&modes).unwrap())
}

#[test]
fn pairs_are_stored_as_columns_of_the_precision_asked_for() {
    for (precision, tolerance) in [(Precision::F32, 1e-6), (Precision::F64, 1e-12)] {
        let (pairs, mass) = solved(MassKind::Barycentric, 40);
        let (values, vectors) = (pairs.values.clone(), pairs.vectors.clone());
        let basis = exact(StorageKind::Dense).basis(pairs, mass, precision, &Unwatched).unwrap();
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
        let basis = exact(StorageKind::Compact).basis(pairs, mass.clone(), Precision::F64, &Unwatched).unwrap();
        assert_eq!(basis.eigenvalues, values);
        assert!(basis.certificate.orthonormality_defect < 1e-10 && defect(&basis) < 1e-10);
        let errors = &basis.certificate.projection_errors;
        assert_eq!(errors.len(), 40);
        assert_eq!(basis.certificate.largest_projection_error, errors.iter().copied().reduce(f64::max));
        for (k, &error) in errors.iter().enumerate() {
            let stored: Vec<f64> = basis.lift(k..k + 1).unwrap();
            let exact = vectors.column(k);
            let lost: Vec<f64> = exact.iter().zip(&stored).map(|(a, b)| a - b).collect();
            let measured = norm(&mass, &lost) / norm(&mass, &exact);
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
    let basis = exact(StorageKind::Compact).basis(pairs, mass, Precision::F64, &Unwatched).unwrap();
    assert!(basis.certificate.largest_projection_error < Some(1e-10));
    let stored: Vec<f64> = basis.lift(39..40).unwrap();
    assert!(stored.iter().zip(vectors.column(39)).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn without_a_hierarchy_all_functions_are_the_space() {
    let (mut pairs, mass) = solved(MassKind::Barycentric, 5);
    pairs.space = None;
    let basis = exact(StorageKind::Compact).basis(pairs, mass.clone(), Precision::F64, &Unwatched).unwrap();
    assert_eq!(basis.dimension(), Some(mass.size()));
    assert!(basis.certificate.largest_projection_error < Some(1e-10));
    assert!(all_functions(6000).is_none());
}
