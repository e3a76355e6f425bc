//! What heat smoothing promises, on generated surfaces.

use super::*;
use crate::operator::MassKind;
use crate::operator::laplace::assemble;
use crate::spectrum::hsim::{self, HsimParameters, Selection};
use crate::spectrum::radial::{self, Profile};
use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver, galerkin};
use chladni_base::Unwatched;
use chladni_mesh::distance::DistanceKind;
use chladni_mesh::sample::well_spread_points;
use chladni_mesh::shape::{Shape, generate, noisy};

/// A mesh with radial columns on it.
struct Start {
    mesh: TriangleMesh,
    connectivity: Connectivity,
    problem: EigenProblem,
    columns: SparseMatrix<f32>,
}

impl Start {
    fn new(mesh: TriangleMesh, d: usize) -> Self {
        let connectivity = Connectivity::new(&mesh);
        let problem = assemble(&mesh, MassKind::Barycentric).unwrap();
        let masses = problem.mass.lumped();
        let samples = well_spread_points(&mesh, &connectivity, &masses, d, 3, 0, &Unwatched).unwrap();
        let (kind, profile) = (DistanceKind::FastMarching, Profile::Cubic);
        let columns = radial::columns(&mesh, &connectivity, &samples, kind, profile, 10.0, &Unwatched).unwrap();
        Self { mesh, connectivity, problem, columns }
    }

    fn sphere(vertices: usize, d: usize) -> Self {
        Self::new(generate(Shape::Sphere, vertices).unwrap(), d)
    }

    fn smooth(&self, parameters: &HeatParameters) -> Result<SparseMatrix<f32>, HeatError> {
        smooth(&self.mesh, &self.problem, &self.connectivity, &self.columns, parameters, &Unwatched)
    }
}

fn assert_partition_of_unity(space: &SparseMatrix<f32>) {
    let mut filled = vec![false; space.columns()];
    for row in 0..space.rows() {
        let (indices, values) = space.row(row);
        assert!(indices.is_sorted_by(|a, b| a < b), "row {row} is out of order");
        assert!(values.iter().all(|&x| x > 0.0), "row {row} has an entry that is not positive");
        let sum: f32 = values.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "row {row} sums to {sum}");
        indices.iter().for_each(|&column| filled[column as usize] = true);
    }
    assert!(filled.iter().all(|&f| f), "a column is empty");
}

#[test]
fn rows_stay_a_partition_of_unity_with_and_without_coarse_levels() {
    for vertices in [500, 4_000, 30_000] {
        let start = Start::sphere(vertices, 50);
        for parameters in [HeatParameters::default(), HeatParameters::accurate()] {
            let space = start.smooth(&parameters).unwrap();
            assert_eq!((space.rows(), space.columns()), (start.columns.rows(), start.columns.columns()));
            assert_partition_of_unity(&space);
        }
    }
}

#[test]
fn rows_hold_twenty_two_entries_at_most_on_average() {
    let start = Start::new(noisy(&generate(Shape::Genus(3), 20_000).unwrap(), 0.2, 1).unwrap(), 300);
    let space = start.smooth(&HeatParameters::default()).unwrap();
    let mean = space.entries() as f64 / space.rows() as f64;
    assert!((10.0..22.0).contains(&mean), "{mean} entries a row");
}

/// Solves `A x = b` by elimination; `a` is row after row.
fn solve_dense(mut a: Vec<f64>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            if factor != 0.0 {
                (k..n).for_each(|j| a[i * n + j] -= factor * a[k * n + j]);
                b[i] -= factor * b[k];
            }
        }
    }
    for k in (0..n).rev() {
        let rest: f64 = (k + 1..n).map(|j| a[k * n + j] * b[j]).sum();
        b[k] = (b[k] - rest) / a[k * n + k];
    }
    b
}

#[test]
fn heat_steps_agree_with_a_dense_solve() {
    let start = Start::new(noisy(&generate(Shape::Torus, 300).unwrap(), 0.2, 2).unwrap(), 20);
    let (n, time) = (start.mesh.positions.len(), 0.004);
    let level = HeatLevel::finest(&start.problem, &start.connectivity).unwrap();
    let peaks = peaks(&start.columns).unwrap().rows;
    let heat = panel::Heat {
        steps: 2,
        time: time as f32,
        margin: 10.0,
        dropping: DroppingRule::positive(0.0),
        tolerance: 1e-6,
    };
    let spread = panel::diffuse(&level, &start.columns, &peaks, &heat, &Unwatched).unwrap();

    let mass = start.problem.mass.lumped();
    let mut operator = vec![0.0; n * n];
    for row in 0..n {
        let (indices, values) = start.problem.stiffness.row(row);
        indices.iter().zip(values).for_each(|(&column, &x)| operator[row * n + column as usize] = time * x);
        operator[row * n + row] += mass[row];
    }
    for column in [0u32, 7, 19] {
        let entry = |matrix: &SparseMatrix<f32>, row: usize| {
            let (indices, values) = matrix.row(row);
            indices.binary_search(&column).map_or(0.0, |place| f64::from(values[place]))
        };
        let mut x: Vec<f64> = (0..n).map(|row| entry(&start.columns, row)).collect();
        for _ in 0..2 {
            x = solve_dense(operator.clone(), x.iter().zip(&mass).map(|(x, m)| x * m).collect());
        }
        for (row, &expected) in x.iter().enumerate() {
            // Below zero nothing is stored.
            let got = entry(&spread, row);
            assert!((got - expected.max(0.0)).abs() < 2e-5, "column {column}, row {row}: {got} against {expected}");
        }
    }
}

/// The lowest `count` eigenvalues of the mesh itself. Those of the sphere differ by up to .6 % at 10,000 vertices, more
/// than what is tested.
fn exact(start: &Start, count: usize) -> Vec<f64> {
    let parameters = HsimParameters { selection: Selection::Count(count), tolerance: 1e-4, ..Default::default() };
    let pairs = hsim::solve(&start.mesh, &start.problem, &parameters, false, &Unwatched).unwrap();
    pairs.values.iter().map(|value| value * start.problem.area).collect()
}

/// Mean and largest relative error of the Ritz values but the first.
fn errors(space: &SparseMatrix<f32>, problem: &EigenProblem, exact: &[f64]) -> (f64, f64) {
    let (stiffness, mass) = galerkin(space, &problem.stiffness, &problem.mass, &Unwatched).unwrap();
    let pairs = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), exact.len(), &Unwatched).unwrap();
    let errors: Vec<f64> =
        pairs.values[1..].iter().zip(&exact[1..]).map(|(&value, exact)| (value / exact - 1.0).abs()).collect();
    (errors.iter().sum::<f64>() / errors.len() as f64, errors.into_iter().fold(0.0, f64::max))
}

#[test]
fn ritz_values_of_the_sphere_are_within_half_a_percent() {
    // Without coarse levels, with one, and with two.
    for vertices in [10_000, 30_000, 100_000] {
        let start = Start::sphere(vertices, 162);
        let exact = exact(&start, 81);
        let space = start.smooth(&HeatParameters::default()).unwrap();
        let (mean, largest) = errors(&space, &start.problem, &exact);
        assert!(mean < 0.002 && largest < 0.005, "{vertices} vertices: mean {mean}, largest {largest}");
        let (rough, _) = errors(&start.columns, &start.problem, &exact);
        assert!(mean < 0.2 * rough, "{vertices} vertices: smoothed {mean}, radial {rough}");
    }
}

#[test]
fn the_accurate_option_is_more_accurate() {
    let start = Start::sphere(30_000, 243);
    let exact = exact(&start, 81);
    let space = start.smooth(&HeatParameters::accurate()).unwrap();
    let (mean, largest) = errors(&space, &start.problem, &exact);
    assert!(mean < 0.0005 && largest < 0.001, "mean {mean}, largest {largest}");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let start = Start::new(noisy(&generate(Shape::Torus, 20_000).unwrap(), 0.3, 3).unwrap(), 100);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| start.smooth(&HeatParameters::default()).unwrap())
    };
    assert_eq!(on(1), on(3));
}

/// Two surfaces side by side in one mesh.
fn joined(mut left: TriangleMesh, right: &TriangleMesh) -> TriangleMesh {
    let shift = left.positions.len() as u32;
    left.positions.extend(right.positions.iter().map(|p| [p[0] + 10.0, p[1], p[2]]));
    left.faces.extend(right.faces.iter().map(|face| face.map(|v| v + shift)));
    left
}

#[test]
fn heat_does_not_jump_between_components() {
    let (left, right) = (generate(Shape::Sphere, 9_000).unwrap(), generate(Shape::Torus, 4_000).unwrap());
    let border = left.positions.len();
    let start = Start::new(joined(left, &right), 60);
    let space = start.smooth(&HeatParameters::default()).unwrap();
    assert_partition_of_unity(&space);
    let mut side = vec![None; space.columns()];
    for row in 0..space.rows() {
        for &column in space.row(row).0 {
            let here = row < border;
            assert_eq!(*side[column as usize].get_or_insert(here), here, "column {column} is on both components");
        }
    }
}

#[test]
fn needles_specks_and_flat_faces_are_survived() {
    // A sphere squeezed to a thousandth, one with a vertex pulled onto its neighbour, and one beside a speck of dust.
    let mut squeezed = generate(Shape::Sphere, 20_000).unwrap();
    squeezed.positions.iter_mut().for_each(|p| p[2] *= 1e-3);
    let mut pulled = generate(Shape::Sphere, 20_000).unwrap();
    let [a, b, _] = pulled.faces[100];
    pulled.positions[a as usize] = pulled.positions[b as usize];
    let mut speck = generate(Shape::Sphere, 100).unwrap();
    speck.positions.iter_mut().for_each(|p| *p = p.map(|x| 1e-7 * x));
    let dusty = joined(generate(Shape::Sphere, 20_000).unwrap(), &speck);
    for mesh in [squeezed, pulled, dusty] {
        for d in [1, 2, 100] {
            let start = Start::new(mesh.clone(), d);
            assert_partition_of_unity(&start.smooth(&HeatParameters::default()).unwrap());
        }
    }
}

#[test]
fn a_graded_mesh_is_coarsened_where_it_is_fine() {
    // Half the vertices lie within a hundredth of the width.
    let mut mesh = generate(Shape::Rectangle, 30_000).unwrap();
    mesh.positions.iter_mut().for_each(|p| p[0] = (p[0] / 1.6).powi(7) * 1.6);
    let start = Start::new(mesh, 60);
    let space = start.smooth(&HeatParameters::default()).unwrap();
    assert_partition_of_unity(&space);
}

#[test]
fn coarse_levels_keep_mass_and_interpolate_linear_functions() {
    let start = Start::new(generate(Shape::Rectangle, 8_000).unwrap(), 20);
    let level = HeatLevel::finest(&start.problem, &start.connectivity).unwrap();
    let positions: Vec<[f32; 3]> = start.mesh.positions.iter().map(|p| p.map(|x| x as f32)).collect();
    let surface = Surface { positions: &positions, triangles: &start.mesh.faces };
    let coarsening = Coarsening::new(&level, surface, 2, 0.05, &[], &Unwatched).unwrap();
    let coarse = coarsening.level.vertices();
    assert!(coarse * 5 < level.vertices() && coarse * 20 > level.vertices(), "{coarse} of {}", level.vertices());
    let masses = |level: &HeatLevel| level.mass.iter().map(|&m| f64::from(m)).sum::<f64>();
    assert!((masses(&level) - masses(&coarsening.level)).abs() < 1e-4);
    // The energy of x on the rectangle of unit area: |∇x|² = 1 in the units of the mesh.
    let x = |v: usize| f64::from(coarsening.surface().positions[v][0]);
    let energy: f64 = (0..coarse)
        .map(|v| {
            let links = coarsening.level.edges(v);
            let row = links.map(|e| {
                let step = x(v) - x(coarsening.level.neighbours[e] as usize);
                f64::from(coarsening.level.weights[e]) * step * step
            });
            0.5 * row.sum::<f64>()
        })
        .sum();
    assert!((energy / 1.6 - 1.0).abs() < 0.1, "energy {energy}");
    // Inside, linear functions come back; at the boundary a vertex may lie beyond the coarse triangles.
    let mut far = 0;
    for (position, (corners, weights)) in positions.iter().zip(&coarsening.corners) {
        let back: f32 = (0..3).map(|k| weights[k] * coarsening.surface().positions[corners[k] as usize][0]).sum();
        far += usize::from((back - position[0]).abs() > 1e-5);
    }
    assert!(far * 4 < positions.len(), "{far} of {} vertices are off", positions.len());
}

/// The least eigenvalue of a level's stiffness over its largest.
fn least_over_largest(level: &HeatLevel) -> f64 {
    let n = level.vertices();
    let mut matrix = DenseMatrix::zeros(n, n);
    for v in 0..n {
        matrix.column_mut(v)[v] += f64::from(level.diagonal[v]);
        for edge in level.edges(v) {
            matrix.column_mut(v)[level.neighbours[edge] as usize] -= f64::from(level.weights[edge]);
        }
    }
    // Rounded to single precision, row and column may differ in the last bit.
    let mut symmetric = matrix.clone();
    for v in 0..n {
        for w in 0..n {
            symmetric.column_mut(v)[w] = 0.5 * (matrix.column(v)[w] + matrix.column(w)[v]);
        }
    }
    let mut identity = DenseMatrix::zeros(n, n);
    (0..n).for_each(|v| identity.column_mut(v)[v] = 1.0);
    let values = CpuSolver.lowest(symmetric, identity, n, &Unwatched).unwrap().values;
    values[0] / values[n - 1]
}

#[test]
fn weights_of_every_triangle_are_semi_definite() {
    for height in [1.0, 1e-1, 1e-2, 1e-3, 1e-5, 1e-9, 0.0] {
        for foot in [0.5, 0.1, 1e-3, 0.0, -0.7] {
            let [a, b, c] = coarsen::element_weights([[0.0; 3], [1.0, 0.0, 0.0], [foot, height, 0.2 * height]]);
            // Of the matrix with these three weights, the sums of eigenvalues and of their products.
            let (trace, minors) = (2.0 * (a + b + c), 3.0 * (a * b + b * c + c * a));
            assert!(trace > 0.0 && minors > -1e-12 * trace * trace, "{height} {foot}: {a} {b} {c}");
            assert!(a.abs().max(b.abs()).max(c.abs()) <= 25.0 * 3.0, "{height} {foot}: {a} {b} {c}");
        }
    }
}

#[test]
fn every_level_is_semi_definite_on_meshes_of_thin_triangles() {
    for (shape, squeeze) in [(Shape::Sphere, 1.0), (Shape::Torus, 0.02), (Shape::Sphere, 0.005)] {
        let mut mesh = noisy(&generate(shape, 3000).unwrap(), 0.35, 5).unwrap();
        mesh.positions.iter_mut().for_each(|p| p[2] *= squeeze);
        let start = Start::new(mesh, 20);
        let peaks = peaks(&start.columns).unwrap().rows;
        let level = HeatLevel::finest(&start.problem, &start.connectivity).unwrap();
        let unit = 1.0 / start.problem.area.sqrt();
        let positions: Vec<[f32; 3]> = start.mesh.positions.iter().map(|p| p.map(|x| (x * unit) as f32)).collect();
        let surface = Surface { positions: &positions, triangles: &start.mesh.faces };
        let hierarchy = coarsen(&level, surface, &peaks, 20, &Unwatched).unwrap();
        assert!(!hierarchy.is_empty());
        for coarsening in &hierarchy {
            let least = least_over_largest(&coarsening.level);
            assert!(least > -1e-5, "squeezed to {squeeze}: {least}");
        }
    }
}

#[test]
fn diffused_columns_obey_the_maximum_principle_beside_needles() {
    for height in [1e-5, 1e-9, 1e-13] {
        let mut mesh = generate(Shape::Sphere, 2500).unwrap();
        let face = mesh.faces[777];
        let [p, q, r] = face.map(|v| mesh.positions[v as usize]);
        mesh.positions[face[0] as usize] =
            std::array::from_fn(|k| (1.0 - height) * 0.5 * (q[k] + r[k]) + height * p[k]);
        let start = Start::new(mesh, 40);
        let mut level = HeatLevel::finest(&start.problem, &start.connectivity).unwrap();
        if level.is_stiff() {
            let unit = 1.0 / start.problem.area.sqrt();
            let positions: Vec<[f32; 3]> = start.mesh.positions.iter().map(|p| p.map(|x| (x * unit) as f32)).collect();
            level.take_weights(Surface { positions: &positions, triangles: &start.mesh.faces });
        }
        let heat = panel::Heat {
            steps: 4,
            time: 0.05 / 40.0,
            margin: 1.0,
            dropping: DroppingRule::positive(1e-4),
            tolerance: 3e-3,
        };
        let tops = peaks(&start.columns).unwrap().rows;
        let spread = panel::diffuse(&level, &start.columns, &tops, &heat, &Unwatched).unwrap();
        let highest = |columns: &SparseMatrix<f32>| columns.values().iter().copied().fold(0.0, f32::max);
        let (before, after) = (highest(&start.columns), highest(&spread));
        assert!(after <= 1.02 * before, "height {height:e}: {before} became {after}");
    }
}

#[test]
fn unusable_input_is_named() {
    let start = Start::sphere(500, 20);
    let wrong = HeatParameters { tolerance: f64::NAN, ..HeatParameters::default() };
    assert!(matches!(start.smooth(&wrong), Err(HeatError::Parameter { name: "tolerance", .. })));
    let none = HeatParameters { steps: 0, ..HeatParameters::default() };
    assert!(matches!(start.smooth(&none), Err(HeatError::Parameter { name: "steps", .. })));

    let n = start.columns.rows();
    let heat = HeatParameters::default();
    let with = |columns: &SparseMatrix<f32>| {
        smooth(&start.mesh, &start.problem, &start.connectivity, columns, &heat, &Unwatched)
    };
    let short = SparseMatrix::from_sorted_parts(1, 1, vec![0, 1], vec![0], vec![1.0]);
    assert!(matches!(with(&short), Err(HeatError::Shape { columns: 1, .. })));
    let offsets = (0..=n).map(|k| k.min(n - 1)).collect();
    let uncovered = SparseMatrix::from_sorted_parts(n, 1, offsets, vec![0; n - 1], vec![1.0; n - 1]);
    assert_eq!(with(&uncovered), Err(HeatError::Uncovered { vertex: n - 1 }));
    let idle = SparseMatrix::from_sorted_parts(n, 2, (0..=n).collect(), vec![0; n], vec![1.0; n]);
    assert_eq!(with(&idle), Err(HeatError::EmptyColumn { column: 1 }));
    let mut broken = start.problem.clone();
    broken.area = f64::NAN;
    let result = smooth(&start.mesh, &broken, &start.connectivity, &start.columns, &heat, &Unwatched);
    assert_eq!(result, Err(HeatError::NotFinite { row: 0 }));
}

/// Cancels at the checkpoint of a number.
struct Impatient(std::sync::atomic::AtomicIsize);

impl Monitor for Impatient {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, fraction: f64) {
        assert!((0.0..=1.0).contains(&fraction));
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        let left = self.0.fetch_sub(1, std::sync::atomic::Ordering::Relaxed);
        if left > 0 { Ok(()) } else { Err(Cancelled) }
    }
}

#[test]
fn cancelling_ends_the_work_at_any_checkpoint() {
    let start = Start::sphere(20_000, 50);
    let mut patience = 1;
    loop {
        let monitor = Impatient(patience.into());
        let heat = HeatParameters::default();
        match smooth(&start.mesh, &start.problem, &start.connectivity, &start.columns, &heat, &monitor) {
            Err(error) => assert_eq!(error, HeatError::Cancelled(Cancelled)),
            Ok(space) => break assert_partition_of_unity(&space),
        }
        patience *= 3;
    }
    assert!(patience > 10, "only {patience} checkpoints");
}
