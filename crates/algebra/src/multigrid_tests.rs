use chladni_base::Unwatched;

use super::*;
use crate::{DenseMatrix, PATCH_ROWS, compact_order, solve_definite};

/// The result of a cycle on all rows; what patches see on their first ring is what their neighbours have.
fn cycle(multigrid: &Multigrid, sigma: f32, right: &[CycleRow]) -> Vec<CycleRow> {
    cycle_in(multigrid, &mut multigrid.workspace(), sigma, right)
}

fn cycle_in(multigrid: &Multigrid, workspace: &mut CycleWorkspace, sigma: f32, right: &[CycleRow]) -> Vec<CycleRow> {
    let mut found = vec![[f32::NAN; CYCLE_WIDTH]; right.len()];
    let targets = by_patch(multigrid.patches(), &mut found);
    let rings = multigrid.cycle(sigma, right, workspace, targets, |patch, y, found| {
        assert_eq!(y.len(), patch.vertices(1).len());
        found.copy_from_slice(&y[..patch.rows().len()]);
        let ring: Vec<(u32, CycleRow)> = patch.vertices(1).iter().copied().zip(y.iter().copied()).collect();
        ring
    });
    for (vertex, y) in rings.into_iter().flatten() {
        // To the last bit: bounds take it for one vector.
        assert_eq!(found[vertex as usize], y, "{vertex}");
    }
    found
}

/// The five-point stiffness of a `k × k` grid whose edges across are `stretch` times as stiff.
fn grid(k: usize, stretch: f64) -> SparseMatrix {
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in 0..k * k {
        let (x, y) = (row % k, row / k);
        let mut neighbours = Vec::new();
        if y > 0 {
            neighbours.push((row - k, 1.0));
        }
        if x > 0 {
            neighbours.push((row - 1, stretch));
        }
        if x + 1 < k {
            neighbours.push((row + 1, stretch));
        }
        if y + 1 < k {
            neighbours.push((row + k, 1.0));
        }
        let diagonal: f64 = neighbours.iter().map(|n| n.1).sum();
        neighbours.push((row, -diagonal));
        neighbours.sort_unstable_by_key(|n| n.0);
        indices.extend(neighbours.iter().map(|n| n.0 as u32));
        values.extend(neighbours.iter().map(|n| -n.1));
        offsets.push(indices.len());
    }
    SparseMatrix::new(k * k, k * k, offsets, indices, values).unwrap()
}

/// Right-hand sides that differ from lane to lane.
fn right(n: usize) -> Vec<CycleRow> {
    (0..n).map(|row| std::array::from_fn(|k| ((row * (k + 3) + 7 * k) as f32 * 0.37).sin() / n as f32)).collect()
}

#[test]
fn a_cycle_solves_to_a_fraction_of_the_error_on_fair_and_on_stretched_grids() {
    for (stretch, most) in [(1.0, 0.15), (30.0, 0.3)] {
        let k = 40;
        let (n, sigma) = (k * k, 3.0);
        let stiffness = grid(k, stretch);
        let masses = vec![1.0 / n as f64; n];
        let multigrid = Multigrid::new(&stiffness, &MassMatrix::Diagonal(masses), 0.0, &Unwatched).unwrap();
        assert!(multigrid.sizes().len() >= 2 && *multigrid.sizes().last().unwrap() <= COARSEST, "{multigrid:?}");
        let right = right(n);
        let found = cycle(&multigrid, sigma, &right);
        let mut matrix = stiffness.to_dense();
        for row in 0..n {
            matrix.column_mut(row)[row] += f64::from(sigma) / n as f64;
        }
        let columns: Vec<f64> = (0..2).flat_map(|k| right.iter().map(move |r| f64::from(r[k]))).collect();
        let mut exact = DenseMatrix::from_columns(n, 2, columns);
        solve_definite(matrix.clone(), &mut exact).unwrap();
        for lane in 0..2 {
            let error: Vec<f64> = found.iter().zip(exact.column(lane)).map(|(y, x)| f64::from(y[lane]) - x).collect();
            let norm = |x: &[f64]| {
                let vector = DenseMatrix::from_columns(n, 1, x.to_vec());
                let image = matrix.times(&vector);
                image.column(0).iter().zip(x).map(|(a, b)| a * b).sum::<f64>().sqrt()
            };
            let left = norm(&error) / norm(exact.column(lane));
            assert!(left < most, "stretch {stretch}: {left} of the error is left");
        }
    }
}

#[test]
fn the_cycle_is_linear_and_the_same_on_every_patch() {
    // Three patches.
    let k = 80;
    let n = k * k;
    let multigrid =
        Multigrid::new(&grid(k, 2.0), &MassMatrix::Diagonal(vec![1.0 / n as f64; n]), 0.0, &Unwatched).unwrap();
    assert_eq!(multigrid.patches().len(), 3);
    let right = right(n);
    let found = cycle(&multigrid, 5.0, &right);
    // Combinations of right-hand sides have those of their solutions.
    let sums = |rows: &[CycleRow]| -> Vec<CycleRow> {
        rows.iter().map(|row| std::array::from_fn(|k| row[k] - 0.5 * row[(k + 1) % CYCLE_WIDTH])).collect()
    };
    let largest = found.as_flattened().iter().fold(0f32, |most, x| most.max(x.abs()));
    for (sum, of_sum) in sums(&found).iter().zip(cycle(&multigrid, 5.0, &sums(&right))) {
        (0..CYCLE_WIDTH).for_each(|k| assert!((sum[k] - of_sum[k]).abs() < 1e-4 * largest));
    }
    let product: f64 = right.iter().zip(&found).map(|(b, x)| f64::from(b[0]) * f64::from(x[0])).sum();
    assert!(product > 0.0);
}

#[test]
fn rows_without_connections_and_many_components_are_no_obstacle() {
    // Two thousand pairs of vertices, and a vertex that nothing acts on.
    let pairs = 2000;
    let n = 2 * pairs + 1;
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in 0..2 * pairs {
        let first = row - row % 2;
        indices.extend([first as u32, first as u32 + 1]);
        values.extend(if row % 2 == 0 { [1.0, -1.0] } else { [-1.0, 1.0] });
        offsets.push(indices.len());
    }
    offsets.push(indices.len());
    let stiffness = SparseMatrix::new(n, n, offsets, indices, values).unwrap();
    let multigrid = Multigrid::new(&stiffness, &MassMatrix::Diagonal(vec![1.0; n]), 0.0, &Unwatched).unwrap();
    let right = right(n);
    let found = cycle(&multigrid, 1.0, &right);
    assert!(found.as_flattened().iter().all(|x| x.is_finite()));
    // Of what they damp, one smoothing step leaves at most .79, and five .054.
    let left = (found[n - 1][3] - right[n - 1][3]).abs() / right[n - 1][3].abs();
    assert!(left < 0.043, "{left}");
}

#[test]
fn threads_that_share_a_panel_find_what_one_thread_finds() {
    let k = 190;
    let n = k * k;
    let stiffness = grid(k, 3.0);
    let order = compact_order(&stiffness, PATCH_ROWS);
    let mass = MassMatrix::Diagonal(vec![1.0 / n as f64; n]);
    let multigrid = Multigrid::new(&stiffness.reordered(&order), &mass, 0.0, &Unwatched).unwrap();
    assert!(multigrid.patches().len() > 10);
    let right = right(n);
    let expected = cycle(&multigrid, 5.0, &right);
    let largest = expected.as_flattened().iter().fold(0f32, |most, x| most.max(x.abs()));
    let mut workspace = multigrid.shared_workspace();
    let found = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // Twice, so that what a cycle leaves behind is seen.
        pool.install(|| cycle_in(&multigrid, &mut workspace, 5.0, &right));
        pool.install(|| cycle_in(&multigrid, &mut workspace, 5.0, &right))
    });
    assert_eq!(found[0], found[1]);
    for (found, expected) in found[0].as_flattened().iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() < 1e-5 * largest, "{found} instead of {expected}");
    }
}
