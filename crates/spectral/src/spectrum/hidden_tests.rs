use super::*;
use chladni_algebra::{CpuSolver, MassMatrix, SymmetricDefiniteSolver, galerkin};
use chladni_base::Unwatched;

const BODY_ROWS: usize = 400;
const LIMB: usize = 40;

/// A path of unit springs and masses, with a second one that begins at its first vertex.
fn body_with_limb() -> EigenProblem {
    let n = BODY_ROWS + LIMB;
    let mut rows = vec![vec![]; n];
    let mut connect = |a: usize, b: usize| {
        rows[a].extend([(a as u32, 1.0), (b as u32, -1.0)]);
        rows[b].extend([(b as u32, 1.0), (a as u32, -1.0)]);
    };
    (1..BODY_ROWS).for_each(|k| connect(k - 1, k));
    connect(0, BODY_ROWS);
    (BODY_ROWS + 1..n).for_each(|k| connect(k - 1, k));
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for (row, entries) in rows.iter_mut().enumerate() {
        let diagonal: f64 = entries.iter().filter(|entry| entry.0 as usize == row).map(|entry| entry.1).sum();
        entries.retain(|entry| entry.0 as usize != row);
        entries.push((row as u32, diagonal));
        entries.sort_by_key(|entry| entry.0);
        indices.extend(entries.iter().map(|entry| entry.0));
        values.extend(entries.iter().map(|entry| entry.1));
        offsets.push(indices.len());
    }
    EigenProblem {
        stiffness: SparseMatrix::new(n, n, offsets, indices, values).unwrap(),
        mass: MassMatrix::Diagonal(vec![1.0; n]),
        area: 1.0,
        unknowns: None,
    }
}

/// What a space that holds every function of the body, and those of the limb that are constant on runs of `run`
/// vertices, lacks below the `count`-th of its Ritz values.
fn lacked(run: usize, count: usize) -> Option<Hidden> {
    let problem = body_with_limb();
    let n = problem.size();
    let column = |row: usize| if row < BODY_ROWS { row } else { BODY_ROWS + (row - BODY_ROWS) / run };
    let columns = column(n - 1) + 1;
    let indices = (0..n).map(|row| column(row) as u32).collect();
    let space = SparseMatrix::new(n, columns, (0..=n).collect(), indices, vec![1f32; n]).unwrap();
    let (stiffness, mass) = galerkin(&space, &problem.stiffness, &problem.mass, &Unwatched).unwrap();
    let pairs = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), count + 10, &Unwatched).unwrap();
    let errors = vec![0.0; pairs.values.len()];
    hidden((&problem, 0.0), &space, &mass, (&pairs.values, &errors), count, &Unwatched).unwrap()
}

#[test]
fn a_limb_that_the_space_is_too_coarse_for_is_counted_and_found() {
    let found = lacked(LIMB, 40).expect("modes of the limb lie below the fortieth value");
    // Half waves of the limb alone: (k − ½) π / 40 below 40 π / 400.
    assert!((3..=5).contains(&found.count), "{}", found.count);
    let density = found.density.expect("a mass that is definite");
    // The vertex that the limb begins at shares the energy of the edge between.
    let (body, limb) = density.split_at(BODY_ROWS);
    let (elsewhere, limb) = (body[1..].iter().sum::<f64>(), limb.iter().sum::<f64>());
    assert!(limb > 1e6 * elsewhere, "{limb} on the limb, {elsewhere} elsewhere");
}

#[test]
fn nothing_is_hidden_from_a_space_that_holds_everything() {
    assert!(lacked(1, 40).is_none());
    assert!(lacked(1, 0).is_none());
}
