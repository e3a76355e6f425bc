use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::operator::family::family;
use crate::operator::{OperatorKind, OperatorParameters, Potential, assemble};
use crate::spectrum::family::restrict_family;
use crate::spectrum::hsim::{self, HsimParameters, Selection};

fn restricted(mesh: &TriangleMesh, dimension: usize) -> FamilyBasis {
    restrict_family(mesh, &family(mesh, &Unwatched).unwrap(), dimension, 0, &Unwatched).unwrap()
}

/// The Laplacian, which is not solved for, fits its neighbours.
#[test]
fn the_values_of_every_member_are_the_lowest_there_are() {
    let basis = restricted(&generate(Shape::Knot, 3000).unwrap(), 400);
    let count = 40;
    for (t, v) in [(0.0, 0.0), (1e-9, 0.0), (0.01, 0.0), (0.7, 0.0), (1.0, 0.0), (0.0, 0.3), (0.4, 2.0)] {
        let matrix = basis.combined(1.0 - t, t, v);
        let d = basis.dimension();
        let mut identity = DenseMatrix::zeros(d, d);
        (0..d).for_each(|k| identity.column_mut(k)[k] = 1.0);
        let dense = CpuSolver.lowest(matrix, identity, d, &Unwatched).unwrap();
        let found = spectrum(&basis, Member { extrinsic: t, curvature: v }, count).unwrap();
        let largest = dense.values[d - 1];
        for (a, b) in found.eigenvalues.iter().zip(&dense.values) {
            assert!((a - b).abs() < 1e-12 * largest, "t {t}, v {v}: {a} is not {b}");
        }
    }
}

#[test]
fn a_member_is_the_operator_that_is_assembled_for_it() {
    let mesh = generate(Shape::Torus, 700).unwrap();
    // As many functions as vertices: no approximation is left.
    let basis = restricted(&mesh, 600);
    assert_eq!(basis.dimension(), mesh.positions.len());
    let cases = [
        (Member { extrinsic: 0.6, curvature: 0.0 }, OperatorKind::Extrinsic { t: 0.6 }),
        (
            Member { extrinsic: 0.0, curvature: 0.5 },
            OperatorKind::Hamiltonian { potential: Potential::Curvature { t: 0.5 } },
        ),
    ];
    for (member, operator) in cases {
        let found = spectrum(&basis, member, 30).unwrap();
        let direct =
            assemble(&mesh, &OperatorParameters { operator, ..Default::default() }, &Unwatched).unwrap().problem;
        let mut mass = DenseMatrix::zeros(direct.size(), direct.size());
        direct.mass.lumped().iter().enumerate().for_each(|(k, &m)| mass.column_mut(k)[k] = m);
        let expected = CpuSolver.lowest(direct.stiffness.to_dense(), mass, 30, &Unwatched).unwrap();
        for (a, b) in found.eigenvalues.iter().zip(&expected.values) {
            assert!((a * direct.area - b).abs() < 1e-8 * expected.values[29], "{a} {b}");
        }
    }
}

/// The pairs of members that were not in the construction, against those of the operators themselves.
#[test]
fn members_between_the_anchors_have_the_values_of_their_operators() {
    for shape in [Shape::Knot, Shape::Torus] {
        let mesh = generate(shape, 1500).unwrap();
        let basis = restricted(&mesh, 400);
        let extrinsic =
            [0.03, 0.15, 0.6].map(|t| (Member { extrinsic: t, curvature: 0.0 }, OperatorKind::Extrinsic { t }));
        let curvature = [0.3, 8.0].map(|t| {
            let potential = Potential::Curvature { t };
            (Member { extrinsic: 0.0, curvature: t }, OperatorKind::Hamiltonian { potential })
        });
        for (member, operator) in extrinsic.into_iter().chain(curvature) {
            let found = spectrum(&basis, member, 50).unwrap();
            let direct =
                assemble(&mesh, &OperatorParameters { operator, ..Default::default() }, &Unwatched).unwrap().problem;
            let wanted =
                HsimParameters { selection: Selection::Count(50), tolerance: 1e-6, ..HsimParameters::default() };
            let exact = hsim::solve(&mesh, &direct, &wanted, false, &Unwatched).unwrap();
            for (a, b) in found.eigenvalues.iter().zip(&exact.values).skip(1) {
                assert!(*a > b * (1.0 - 1e-6) && *a < 1.005 * b, "{shape:?}, {member:?}: {a} {b}");
            }
        }
    }
}

/// Beyond the last anchor values are far off: the answer says that it does not cover them.
#[test]
fn members_that_the_space_was_not_made_for_are_said_not_to_be_covered() {
    let mesh = generate(Shape::Knot, 1500).unwrap();
    let basis = restricted(&mesh, 400);
    let covered = |t, v, count| spectrum(&basis, Member { extrinsic: t, curvature: v }, count).unwrap().covered;
    // A sixth of the dimension and a tenth more for each anchor, and two thirds of that.
    assert_eq!([covered(0.3, 0.0, 40), covered(0.3, 20.0, 200), covered(0.0, 20.1, 40)], [40, 49, 0]);
    // All functions there are: every value is exact.
    let whole = restricted(&generate(Shape::Torus, 300).unwrap(), 400);
    let found = spectrum(&whole, Member { extrinsic: 0.2, curvature: 1e4 }, 60).unwrap();
    assert_eq!(found.covered, 60);
}

#[test]
fn eigenfunctions_are_orthonormal_and_the_approximation_is_close_to_a_finer_one() {
    let mesh = generate(Shape::Knot, 3000).unwrap();
    let (coarse, fine) = (restricted(&mesh, 200), restricted(&mesh, 800));
    let member = Member { extrinsic: 0.5, curvature: 0.1 };
    let (low, high) = (spectrum(&coarse, member, 40).unwrap(), spectrum(&fine, member, 40).unwrap());
    for (a, b) in low.eigenvalues.iter().zip(&high.eigenvalues) {
        assert!(*a > 0.999 * b && *a < 1.02 * b, "{a} {b}");
    }
    let lifted = coarse.lift(&low.coefficients);
    let weighted: Vec<Vec<f64>> = (0..40).map(|k| coarse.mass.multiply(lifted.column(k))).collect();
    for i in 0..40 {
        for j in 0..40 {
            let product: f64 = lifted.column(i).iter().zip(&weighted[j]).map(|(a, b)| a * b).sum();
            assert!((product - f64::from(u8::from(i == j))).abs() < 1e-5);
        }
    }
}

#[test]
fn what_is_out_of_range_is_named() {
    let basis = restricted(&generate(Shape::Sphere, 162).unwrap(), 40);
    for (member, count, name) in [
        (Member { extrinsic: 1.5, curvature: 0.0 }, 3, "extrinsic"),
        (Member { extrinsic: f64::NAN, curvature: 0.0 }, 3, "extrinsic"),
        (Member { extrinsic: 0.5, curvature: -1.0 }, 3, "curvature"),
        (Member::default(), 0, "count"),
        (Member::default(), 1000, "count"),
    ] {
        let error = spectrum(&basis, member, count).unwrap_err();
        assert!(matches!(error, FamilyError::Parameter { name: found, .. } if found == name), "{error}");
    }
}
