use super::*;
use crate::operator::points::{assemble_local, local_triangles};
use crate::operator::{
    Boundary, EigenProblem, Laplacian, MassKind, MeshOperator, OperatorKind, OperatorParameters, assemble,
};
use crate::spectrum::energy::{Cotangents, Energy};
use chladni_algebra::{CpuSolver, DenseMatrix, PATCH_ROWS, SymmetricDefiniteSolver, solve_definite};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::points::once_each;
use chladni_mesh::shape::{Shape, generate, noisy};

fn operator_of(mesh: &TriangleMesh, boundary: Boundary) -> MeshOperator {
    let parameters = OperatorParameters { operator: OperatorKind::Laplace, boundary, mass: MassKind::Barycentric };
    assemble(mesh, &parameters, &Unwatched).unwrap()
}

/// Surfaces with obtuse triangles: a crumpled sphere, a plate ten times as long as wide, one that is sheared as much,
/// and a crumpled torus.
fn surfaces() -> Vec<TriangleMesh> {
    let plate = generate(Shape::Rectangle, 500).unwrap();
    let mut long = noisy(&plate, 0.3, 3).unwrap();
    long.positions.iter_mut().for_each(|p| p[0] *= 10.0);
    let mut sheared = plate;
    sheared.positions.iter_mut().for_each(|p| p[0] += 4.0 * p[1]);
    vec![
        noisy(&generate(Shape::Sphere, 600).unwrap(), 0.35, 1).unwrap(),
        long,
        sheared,
        noisy(&generate(Shape::Torus, 600).unwrap(), 0.3, 2).unwrap(),
    ]
}

/// The matrix of the trees, in the order of the patches.
fn dense(forest: &Forest, patches: &[Patch], n: usize) -> DenseMatrix {
    let mut matrix = DenseMatrix::zeros(n, n);
    for patch in patches {
        let start = patch.rows().start;
        for node in &forest.nodes[patch.rows()] {
            let (i, j, weight) = (start + node.row as usize, start + node.parent as usize, f64::from(node.weight));
            if i != j {
                matrix.column_mut(i)[i] += weight;
                matrix.column_mut(j)[j] += weight;
                matrix.column_mut(i)[j] -= weight;
                matrix.column_mut(j)[i] -= weight;
            }
        }
    }
    matrix
}

/// The lowest eigenvalue of what a forest leaves of a stiffness.
fn lowest_without(forest: &Forest, energy: &Energy<'_>, problem: &EigenProblem) -> f64 {
    let n = problem.size();
    let trees = dense(forest, energy.hierarchy.patches(), n);
    let mut left = problem.stiffness.reordered(&energy.order).to_dense();
    left.values_mut().iter_mut().zip(trees.values()).for_each(|(s, t)| *s -= t);
    let identity = SparseMatrix::<f64>::identity(n).to_dense();
    CpuSolver.lowest(left, identity, 1, &Unwatched).unwrap().values[0]
}

#[test]
fn points_have_a_forest_below_their_stiffness_too() {
    let mut random = SplitMix64::new(8);
    let plate: Vec<[f64; 3]> = (0..700).map(|_| [8.0 * random.unit(), random.unit(), 0.0]).collect();
    let crumpled = |shape, seed| noisy(&generate(shape, 600).unwrap(), 0.7, seed).unwrap().positions;
    // On a plane all points agree on a Delaunay triangulation, which has negative weights at the rim alone; where noise
    // is nearly as large as points are apart they dispute some of it.
    for (positions, negative) in [(plate, false), (crumpled(Shape::Sphere, 1), true), (crumpled(Shape::Torus, 2), true)]
    {
        let points = TriangleMesh { positions, ..TriangleMesh::default() };
        let triangles = local_triangles(&points, &Unwatched).unwrap();
        let operator = assemble_local(&triangles, &OperatorParameters::default(), &Unwatched).unwrap();
        assert_eq!(operator.report.laplacian, Laplacian::Cotangent);
        let problem = operator.problem;
        assert!(!negative || Energy::new(&problem, 0.0, &Unwatched).unwrap().forest.is_none());
        let once = once_each(&triangles);
        let (positions, faces) = (once.positions.as_slice(), once.local.of(&once.positions).unwrap());
        assert_eq!(faces.len(), triangles.faces.len(), "copies count");
        let energy = Energy::on(Some(Cotangents::Local { positions, faces }), &problem, 0.0, &Unwatched).unwrap();
        let forest = energy.forest.as_ref().unwrap();
        let lowest = lowest_without(forest, &energy, &problem);
        assert!(lowest > -1e-11, "{lowest}");
        let roots = forest.nodes.iter().filter(|node| node.row == node.parent).count();
        assert!(roots < problem.size() / 10, "{roots} roots of {} rows", problem.size());
    }
}

#[test]
fn a_forest_is_below_the_stiffness_whatever_the_triangles_are_and_holds_nearly_all_rows() {
    for boundary in [Boundary::Neumann, Boundary::Dirichlet] {
        for mesh in surfaces() {
            let operator = operator_of(&mesh, boundary);
            let problem = &operator.problem;
            let n = problem.size();
            assert!(problem.stiffness.values().iter().zip(0..).any(|(&v, _)| v < 0.0));
            let energy = Energy::on(Some((&mesh).into()), problem, 0.0, &Unwatched).unwrap();
            let forest = energy.forest.as_ref().unwrap();
            let lowest = lowest_without(forest, &energy, problem);
            assert!(lowest > -1e-11, "{boundary:?}: {lowest}");
            let roots = forest.nodes.iter().filter(|node| node.row == node.parent).count();
            assert!(roots < n / 10, "{roots} roots of {n} rows");
        }
    }
}

#[test]
fn eliminating_a_forest_gives_the_norm_of_its_inverse() {
    let mesh = &surfaces()[0];
    let operator = operator_of(mesh, Boundary::Neumann);
    let problem = &operator.problem;
    let n = problem.size();
    let energy = Energy::on(Some(mesh.into()), problem, 0.0, &Unwatched).unwrap();
    let (forest, patches) = (energy.forest.as_ref().unwrap(), energy.hierarchy.patches());
    assert!(n < PATCH_ROWS && patches.len() == 1);
    let mut random = SplitMix64::new(4);
    let e: Vec<f64> = (0..n).map(|_| random.unit() - 0.5).collect();
    for sigma in [1e-3, 1.0, 1e4] {
        let mut memory = Pivots::default();
        forest.pivots(0..n, |row| sigma * energy.lumped[row], 1.0, &mut memory);
        let (mut carried, mut found) = (e.clone(), 0.0);
        for &Pivot { row, parent, share, inverse } in memory.all() {
            let value = carried[row as usize];
            found += value * value * inverse;
            if parent != row {
                carried[parent as usize] += share * value;
            }
        }
        let mut matrix = dense(forest, patches, n);
        (0..n).for_each(|row| matrix.column_mut(row)[row] += sigma * energy.lumped[row]);
        let mut x = DenseMatrix::zeros(n, 1);
        x.column_mut(0).copy_from_slice(&e);
        solve_definite(matrix, &mut x).unwrap();
        let expected: f64 = x.column(0).iter().zip(&e).map(|(x, e)| x * e).sum();
        assert!((found / expected - 1.0).abs() < 1e-6, "{sigma}: {found} instead of {expected}");
    }
}

#[test]
fn negative_weights_that_nothing_is_known_of_have_no_forest() {
    let mesh = &surfaces()[1];
    let operator = operator_of(mesh, Boundary::Neumann);
    assert!(Energy::new(&operator.problem, 0.0, &Unwatched).unwrap().forest.is_none());
    // A row that sums to less than nothing is no sum over edges either, but where a multiple of the mass makes up for
    // it.
    let fair = operator_of(&generate(Shape::Rectangle, 400).unwrap(), Boundary::Neumann).problem;
    assert!(Energy::new(&fair, 0.0, &Unwatched).unwrap().forest.is_some());
    let mut values = fair.stiffness.values().to_vec();
    let at = fair.stiffness.offsets()[7] + fair.stiffness.row(7).0.binary_search(&7).unwrap();
    values[at] -= fair.mass.lumped()[7];
    let s = &fair.stiffness;
    let stiffness =
        SparseMatrix::from_sorted_parts(s.rows(), s.columns(), s.offsets().to_vec(), s.indices().to_vec(), values);
    let well = EigenProblem { stiffness, ..fair };
    assert!(Energy::new(&well, 0.0, &Unwatched).unwrap().forest.is_none());
    assert!(Energy::new(&well, -1.0, &Unwatched).unwrap().forest.is_some());
}

#[test]
fn bounds_by_trees_are_closer_than_those_by_the_mass_alone() {
    let mesh = noisy(&generate(Shape::Sphere, 20_000).unwrap(), 0.2, 5).unwrap();
    let operator = operator_of(&mesh, Boundary::Neumann);
    let problem = &operator.problem;
    let n = problem.size();
    let mut energy = Energy::on(Some((&mesh).into()), problem, 0.0, &Unwatched).unwrap();
    // Residuals that are rough: what sixteen smooth functions miss that are known at every fourth vertex alone.
    let values: Vec<f64> = (0..16).map(|k| 20.0 + k as f64).collect();
    let mut random = SplitMix64::new(6);
    let mut coefficients = DenseMatrix::zeros(n, 16);
    for k in 0..16 {
        let column = coefficients.column_mut(k);
        for (x, p) in column.iter_mut().zip(&mesh.positions) {
            *x = (2.0 * p[k % 3] + k as f64).sin() + 1e-3 * (random.unit() - 0.5);
        }
    }
    let mut identity = SparseMatrix::<f32>::identity(n);
    let mut measure =
        |energy: &Energy<'_>| energy.measure(&mut identity, &coefficients, &values, 1e-6, None, &Unwatched).unwrap().0;
    let by_trees = measure(&energy);
    energy.forest = None;
    let by_mass = measure(&energy);
    for (trees, mass) in by_trees.iter().zip(&by_mass) {
        // Cycles more may have been taken by mass.
        assert!(trees.above >= mass.below && mass.above >= trees.below, "{trees:?} {mass:?}");
    }
    let sum = |all: &[crate::spectrum::energy::Measure]| all.iter().map(|m| m.above / m.below).sum::<f64>();
    assert!(sum(&by_trees) < sum(&by_mass), "{} {}", sum(&by_trees), sum(&by_mass));
}
