//! Bases for tests.

use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;

use crate::basis::{Basis, Certificate, Compact, DenseFunctions, Functions, Precision, Provenance};
use crate::operator::MeshOperator;
use crate::spectrum::hsim::{HsimParameters, Selection, solve};

/// The lowest pairs of an operator to a tolerance, in double precision, with what it was assembled of.
pub fn solved(operator: &MeshOperator, vertices: usize, count: usize, tolerance: f64) -> Basis {
    let mesh = TriangleMesh { positions: vec![[0.0; 3]; vertices], faces: Vec::new(), ..Default::default() };
    let parameters = HsimParameters { selection: Selection::Count(count), tolerance, ..HsimParameters::default() };
    let pairs = solve(&mesh, &operator.problem, &parameters, false, &Unwatched).unwrap();
    Basis {
        functions: Functions::Dense(DenseFunctions::from_panels(pairs.vectors, Precision::F64)),
        eigenvalues: pairs.values,
        mass: operator.problem.mass.scaled(operator.problem.area),
        certificate: Certificate::default(),
        metadata: Provenance::of_operator(operator),
    }
}

/// The cosine basis of a chain of `n` points with equal masses and unit links.
pub fn chain(n: usize, m: usize) -> Basis {
    let frequency = |k: usize| std::f64::consts::PI * k as f64 / n as f64;
    let mut modes = DenseMatrix::zeros(n, m);
    for k in 0..m {
        let scale = (if k == 0 { 1.0 } else { 2.0 } / n as f64).sqrt();
        let column = modes.column_mut(k).iter_mut().enumerate();
        column.for_each(|(i, x)| *x = scale * (frequency(k) * (i as f64 + 0.5)).cos());
    }
    Basis {
        functions: Functions::Compact(Compact::new(
            SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0; n]).unwrap(),
            modes,
        )),
        eigenvalues: (0..m).map(|k| 2.0 - 2.0 * frequency(k).cos()).collect(),
        mass: MassMatrix::Diagonal(vec![1.0; n]),
        certificate: Certificate::default(),
        metadata: serde_json::Value::Null.into(),
    }
}

/// The same functions as columns.
pub fn dense(basis: &Basis) -> Basis {
    let modes = basis.lift(0..basis.count()).unwrap();
    let modes = DenseMatrix::from_columns(basis.vertices(), basis.count(), modes);
    Basis { functions: Functions::Dense(DenseFunctions::from_columns(&modes, Precision::F64)), ..basis.clone() }
}
