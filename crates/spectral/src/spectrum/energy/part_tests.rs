use super::*;
use crate::operator::{MassKind, OperatorParameters, assemble};
use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver, solve_definite};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::{Shape, generate};

fn halves(mesh: &TriangleMesh, rows: &[u32], parts: usize) -> Vec<u32> {
    // Stripes: every part has two neighbours at most, and cuts go through triangles of every kind.
    let x = |row: &u32| mesh.positions[*row as usize][0];
    let (low, high) = rows.iter().map(x).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    rows.iter().map(|row| (((x(row) - low) / (high - low) * parts as f64) as u32).min(parts as u32 - 1)).collect()
}

/// A surface with creases between random heights, so that many angles are obtuse.
fn rough(n: usize) -> TriangleMesh {
    let mut mesh = generate(Shape::Torus, n).unwrap();
    let mut random = SplitMix64::new(3);
    mesh.positions.iter_mut().flatten().for_each(|x| *x += 0.02 * random.signed_unit());
    mesh
}

#[test]
fn what_is_left_of_the_matrix_lies_below_it_and_falls_apart() {
    let mesh = rough(400);
    let operator = assemble(&mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    let problem = &operator.problem;
    let n = problem.size();
    let part_of = halves(&mesh, &(0..n as u32).collect::<Vec<_>>(), 3);
    let mut left = problem.stiffness.to_dense();
    for part in 0..3 {
        let Loose { rows, own, coupled, stiffness } = Loose::new(&mesh, problem, &part_of, part);
        assert_eq!(own, part_of.iter().filter(|&&of| of == part).count());
        for (at, &row) in rows[..own].iter().enumerate() {
            let (columns, values) = coupled.row(at);
            let back: std::collections::BTreeMap<u32, f64> =
                columns.iter().map(|&c| rows[c as usize]).zip(values.iter().copied()).collect();
            let (columns, values) = problem.stiffness.row(row as usize);
            assert_eq!(back, columns.iter().copied().zip(values.iter().copied()).collect());
            let (columns, values) = stiffness.row(at);
            for (&column, &value) in columns.iter().zip(values) {
                let other = rows[column as usize];
                assert!(part_of[other as usize] == part || value == 0.0, "{row} and {other} are coupled by {value}");
                left.column_mut(other as usize)[row as usize] -= value;
            }
        }
    }
    // What was taken away has no negative eigenvalue: with a little mass it can be factored.
    for at in 0..n {
        left.column_mut(at)[at] += 1e-9;
    }
    let mut nothing = DenseMatrix::zeros(n, 1);
    solve_definite(left, &mut nothing).unwrap();
}

#[test]
fn shares_of_parts_bound_the_norm_and_those_of_one_part_are_the_whole() {
    let mesh = rough(700);
    for mass in [MassKind::Barycentric, MassKind::Voronoi] {
        let parameters = OperatorParameters { mass, ..OperatorParameters::default() };
        let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
        let problem = &operator.problem;
        let n = problem.size();
        let exact =
            CpuSolver.lowest(problem.stiffness.to_dense(), diagonal(&problem.mass.lumped()), n, &Unwatched).unwrap();
        // Pairs that miss something: exact ones, disturbed a little.
        let (mut random, mut coefficients) = (SplitMix64::new(9), exact.vectors.slice_columns(0..40));
        for k in 1..40 {
            let disturbance = exact.vectors.slice_columns(60 + k..61 + k);
            let size = 0.02 + 0.02 * random.unit();
            coefficients.column_mut(k).iter_mut().zip(disturbance.column(0)).for_each(|(x, y)| *x += size * y);
        }
        let ritz: Vec<f64> = (0..40)
            .map(|k| {
                let x = coefficients.column(k);
                let dot = |y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
                dot(&problem.stiffness.multiply(x)) / dot(&problem.mass.multiply(x))
            })
            .collect();
        let mut identity = SparseMatrix::<f32>::identity(n);
        let whole = Energy::new(problem, 0.0, &Unwatched).unwrap();
        let (expected, _) = whole.measure(&mut identity, &coefficients, &ritz, 1e-6, None, &Unwatched).unwrap();
        let rows: Vec<u32> = (0..n as u32).collect();
        for parts in [1, 2, 3, 5] {
            let part_of = halves(&mesh, &rows, parts);
            let mut sums = vec![PairShare::default(); 40];
            for part in 0..parts as u32 {
                let energy = Energy::of_part(&mesh, problem, &part_of, part, &Unwatched).unwrap();
                let shares =
                    energy.shares(&energy.in_order(&identity), &coefficients, &ritz, 1e-6, &Unwatched).unwrap();
                sums.iter_mut().zip(&shares).for_each(|(sum, share)| sum.add(share));
            }
            let found = measures(&sums, &ritz, 1e-6);
            for (k, (found, expected)) in found.iter().zip(&expected).enumerate().skip(1) {
                let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
                assert!(near(found.sums.residual, expected.sums.residual), "{parts} {k}: {found:?}, {expected:?}");
                assert!(near(found.sums.energy, expected.sums.energy), "{parts} {k}: {found:?}, {expected:?}");
                assert!(near(found.sums.mass, expected.sums.mass), "{parts} {k}: {found:?}, {expected:?}");
                assert!(near(found.sums.highest, expected.sums.highest), "{parts} {k}: {found:?}, {expected:?}");
                // So small a mesh is measured by a factor where a bound is wide, with another σ.
                let other = found.sigma != expected.sigma;
                assert!(other || found.above >= expected.below, "{parts} {k}: {found:?}, {expected:?}");
                let nearest = exact.values.iter().map(|value| (value - ritz[k]).abs()).fold(f64::INFINITY, f64::min);
                assert!(nearest <= found.bound, "{parts} {k}: {nearest} > {}", found.bound);
                assert!(found.bound <= 10.0 * expected.bound, "{parts} {k}: {} and {}", found.bound, expected.bound);
            }
        }
    }
}

fn diagonal(values: &[f64]) -> DenseMatrix {
    let mut matrix = DenseMatrix::zeros(values.len(), values.len());
    values.iter().enumerate().for_each(|(at, &value)| matrix.column_mut(at)[at] = value);
    matrix
}
