//! Geodesic distance by the heat method (Crane, Weischedel and Wardetzky 2013) on the mesh, with two sparse factors
//! that serve every source.
//!
//! Heat that starts at the sources flows for a short time, `(M + t S) u = δ`; of its gradients the directions are kept,
//! `X = −∇u / |∇u|`, and of all functions the one whose gradient is nearest to `X` solves `S φ = ∇·X`. Both systems are
//! those of the robust Laplacian (Sharp and Crane 2020), and gradients are taken on its intrinsic Delaunay
//! triangulation: no weight is negative, so that heat is positive everywhere and is known to full relative precision
//! however small. Both factors are in single precision: a single source takes the time in which they are read, and
//! distances change by a millionth of the largest (`docs/decisions/0097-neighbours-in-many-dimensions.md`). Where that
//! is not enough they are in double precision: single precision has no number for what little heat gets from one
//! separator to the next on a surface that is many times as long as heat flows, and few digits for the potential of one
//! that is long and thin. Both show in the residuals of two sources. Threads share a source
//! (`docs/decisions/0085-one-source-on-all-threads.md`).
//!
//! Nothing but half cotangents `h` and the area `A` is needed of a triangle: with `w_k = h_k (u_i − u_j)` the flux
//! `∫ ∇u · ∇λ_i` of corner `i` is `w_k − w_j`, and `A |∇u|² = Σ h_k (u_i − u_j)²`.

mod probe;

use chladni_algebra::{
    ColumnTree, DenseMatrix, FactorNumbers, Ordering, PANEL_WIDTH, SymbolicFactor, fill_reducing_order,
};
use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::connected::components;
use chladni_mesh::intrinsic::IntrinsicTriangulation;

use self::probe::Probe;
use super::descents::Slopes;
use super::error::{self, AnalysisError};
use super::unit_gradients::UnitGradients;
use crate::operator::robust;

/// Heat flows at least so long, as a share of the diagonal of the mesh: else it would be below the least number on the
/// far side.
const SHORTEST: f64 = 1.0 / 200.0;

/// From so many sources on a panel takes less time than as many columns, one after the other.
const FEW: usize = 8;

/// Both factors of a mesh, and what gradients need of it.
pub struct HeatGeodesics {
    gradients: UnitGradients,
    /// The unit of length of the triangulation, in units of the mesh.
    unit: f64,
    /// Which component each vertex belongs to; vertices of no face are ones of their own.
    component: Vec<u32>,
    /// Where each vertex is in the order of the factors.
    place: Vec<u32>,
    /// The component at each of these places.
    component_at: Vec<u32>,
    symbolic: SymbolicFactor,
    tree: ColumnTree,
    heat: Numbers,
    poisson: Numbers,
}

/// Distances by heat.
#[derive(Debug, Clone)]
pub struct HeatDistances {
    /// `n × groups`, in units of the mesh.
    pub distances: DenseMatrix,
    /// For each group, by how much the slope of its distances, which is one, differs from one: on average over the area
    /// of its components, or along paths from there to the sources, whichever is more; nothing where these have no
    /// area. Distances are off by about as much or less, relative to themselves in the norm of L²
    /// (`docs/distances.md`).
    pub slope_errors: Vec<Option<f64>>,
}

/// The numbers of a factor.
enum Numbers {
    Single(FactorNumbers<f32>),
    Double(FactorNumbers<f64>),
}

impl Numbers {
    /// Solves in place for columns row after row, 32 of them or one.
    fn solve(&self, symbolic: &SymbolicFactor, tree: &ColumnTree, columns: &mut [f64], width: usize) {
        match (self, width) {
            (Self::Single(numbers), 1) => tree.solve(symbolic, numbers, columns),
            (Self::Double(numbers), 1) => tree.solve(symbolic, numbers, columns),
            (Self::Single(numbers), _) => symbolic.solve_panel(numbers, columns),
            (Self::Double(numbers), _) => symbolic.solve_panel(numbers, columns),
        }
    }

    /// Bytes of each entry.
    fn bytes(&self) -> usize {
        match self {
            Self::Single(_) => 4,
            Self::Double(_) => 8,
        }
    }
}

impl std::fmt::Debug for HeatGeodesics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HeatGeodesics").field("vertices", &self.vertices()).finish_non_exhaustive()
    }
}

impl HeatGeodesics {
    /// Factors both systems. `time` is how long heat flows, in length² of the mesh; without it, in each component the
    /// square of its mean edge.
    ///
    /// # Errors
    /// [`AnalysisError`]: a time that is not above zero, a mesh without area or with corners or coordinates that cannot
    /// be, a matrix that cannot be factored, cancellation.
    pub fn new(mesh: &TriangleMesh, time: Option<f64>, monitor: &dyn Monitor) -> Result<Self, AnalysisError> {
        if let Some(time) = time {
            error::positive("time", time)?;
        }
        let (problem, triangulation) = robust::triangulated(mesh, monitor)?;
        let order = fill_reducing_order(&problem.stiffness, Ordering::NestedDissection)?;
        monitor.checkpoint()?;
        let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
        let area: f64 =
            triangulation.shapes().iter().map(|shape| shape.area).sum::<f64>() / triangulation.sheets() as f64;
        let unit = (problem.area / area).sqrt();
        let symbolic = SymbolicFactor::new(&stiffness, &mass)?;
        let mut place = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&vertex, at)| place[vertex as usize] = at);
        let component = components(mesh.positions.len(), &mesh.faces);
        let component_at = order.iter().map(|&vertex| component[vertex as usize]).collect();
        let tree = ColumnTree::new(&symbolic);
        let gradients = UnitGradients::new(&triangulation, &place);
        let probe = Probe {
            stiffness: &stiffness,
            mass: &mass,
            symbolic: &symbolic,
            tree: &tree,
            component: &component,
            place: &place,
        };
        let usual = default_times(&triangulation, mesh, &component, unit);
        let (heat, flowed) = probe.heat_for(time, &usual, problem.area, monitor)?;
        let poisson = probe.poisson_for(&gradients, &flowed, monitor)?;
        Ok(Self { component, component_at, unit, place, symbolic, tree, heat, poisson, gradients })
    }

    /// The number of vertices, `n`.
    pub fn vertices(&self) -> usize {
        self.place.len()
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let entry = 2 + self.heat.bytes() + self.poisson.bytes();
        (entry * self.symbolic.entries() + 400 * self.vertices() + 72 * self.gradients.faces()) as u64
    }

    /// Distances in the units of the mesh of all vertices from the nearest vertex of each of some groups, infinite in
    /// components without one; and how far they may be off.
    ///
    /// # Errors
    /// [`AnalysisError::Vertex`] names a source that is no vertex; cancellation.
    pub fn from_nearest(&self, groups: &[&[u32]], monitor: &dyn Monitor) -> Result<HeatDistances, AnalysisError> {
        let n = self.vertices();
        for (place, &vertex) in groups.iter().flat_map(|group| group.iter()).enumerate() {
            if vertex as usize >= n {
                return Err(AnalysisError::Vertex { what: "source", place, vertex, vertices: n });
            }
        }
        let mut distances = DenseMatrix::zeros(n, groups.len());
        let mut slope_errors = Vec::with_capacity(groups.len());
        let mut from = 0;
        while from < groups.len() {
            // Few are solved one by one.
            let left = groups.len() - from;
            let (count, width) = if left >= FEW { (left.min(PANEL_WIDTH), PANEL_WIDTH) } else { (1, 1) };
            let groups = &groups[from..from + count];
            monitor.checkpoint()?;
            let mut columns = vec![0.0; n * width];
            for (column, group) in groups.iter().enumerate() {
                group.iter().for_each(|&source| columns[self.place[source as usize] as usize * width + column] = 1.0);
            }
            self.heat.solve(&self.symbolic, &self.tree, &mut columns, width);
            let mut columns = self.gradients.divergence(&columns, count, width);
            monitor.checkpoint()?;
            self.poisson.solve(&self.symbolic, &self.tree, &mut columns, width);
            for (column, group) in groups.iter().enumerate() {
                self.finish(&columns[column..], width, group, distances.column_mut(from + column));
                slope_errors.push(self.slope_error(&columns[column..], width, group));
            }
            from += count;
        }
        Ok(HeatDistances { distances, slope_errors })
    }

    /// By how much slopes of the column that `potential` begins with differ from one where its sources lead to: on
    /// average over the surface, or along paths from all over it to its sources, whichever is more.
    fn slope_error(&self, potential: &[f64], width: usize, sources: &[u32]) -> Option<f64> {
        let value = |place: u32| potential[place as usize * width];
        let (bases, mut is_source) = (self.bases(potential, width, sources), vec![false; self.vertices()]);
        sources.iter().for_each(|&source| is_source[self.place[source as usize] as usize] = true);
        let base = |place: u32| bases[self.component_at[place as usize] as usize];
        let is_reached = |place: u32| base(place) < f64::INFINITY;
        let everywhere = self.gradients.slope_error(value, is_reached);
        let distance = |place: u32| value(place) - base(place);
        let slopes = Slopes { triangles: &self.gradients, distance, is_source: |place: u32| is_source[place as usize] };
        let along = slopes.error(is_reached);
        everywhere.into_iter().chain(along).reduce(f64::max)
    }

    /// The least value of the column that `potential` begins with at the sources in each component; infinite where
    /// there is none.
    fn bases(&self, potential: &[f64], width: usize, sources: &[u32]) -> Vec<f64> {
        let mut bases = vec![f64::INFINITY; self.vertices()];
        for &source in sources {
            let base = &mut bases[self.component[source as usize] as usize];
            *base = base.min(potential[self.place[source as usize] as usize * width]);
        }
        bases
    }

    /// Distances of the column that `potential` begins with, zero at its sources.
    fn finish(&self, potential: &[f64], width: usize, sources: &[u32], distances: &mut [f64]) {
        let value = |vertex: u32| potential[self.place[vertex as usize] as usize * width];
        let bases = self.bases(potential, width, sources);
        for (vertex, distance) in distances.iter_mut().enumerate() {
            let base = bases[self.component[vertex] as usize];
            let known = base < f64::INFINITY;
            *distance = if known { ((value(vertex as u32) - base) * self.unit).max(0.0) } else { f64::INFINITY };
        }
        sources.iter().for_each(|&source| distances[source as usize] = 0.0);
    }
}

/// The square of the mean edge of each component of the triangulation, but no time in which heat would not get across
/// it; in length² of the mesh, by the number of the component. A component that is small beside others is a surface of
/// its own: its distances are what they would be without the others.
fn default_times(
    triangulation: &IntrinsicTriangulation,
    mesh: &TriangleMesh,
    component: &[u32],
    unit: f64,
) -> Vec<f64> {
    let n = component.len();
    let mut edges = vec![(0.0, 0usize); n];
    for (face, shape) in triangulation.faces().iter().zip(triangulation.shapes()) {
        let [a, b, c] = shape.half_cotangents;
        let (sum, count) = &mut edges[component[face[0] as usize] as usize];
        // |e_k|² = 4 A (h_i + h_j)
        *sum += [a + b, b + c, c + a].iter().map(|h| (4.0 * shape.area * h).max(0.0).sqrt()).sum::<f64>();
        *count += 3;
    }
    let mut boxes = vec![([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]); n];
    for (position, &component) in mesh.positions.iter().zip(component) {
        let (low, high) = &mut boxes[component as usize];
        for k in 0..3 {
            (low[k], high[k]) = (low[k].min(position[k]), high[k].max(position[k]));
        }
    }
    let time = |component: usize| {
        let ((sum, count), (low, high)) = (edges[component], boxes[component]);
        let diagonal = (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f64>().sqrt();
        let time = (unit * sum / count.max(1) as f64).max(SHORTEST * diagonal).powi(2);
        // A vertex alone, to which nothing flows.
        if count > 0 && time > 0.0 { time } else { unit * unit }
    };
    (0..n).map(time).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::real_meshes::load;
    use chladni_algebra::solve_definite;
    use chladni_base::{SplitMix64, Unwatched};
    use chladni_mesh::distance::ExactGeodesics;
    use chladni_mesh::measure::face_area;
    use chladni_mesh::shape::{Shape, generate};

    /// The error in the norm of L², relative, over vertices.
    fn error(found: &[f64], expected: &[f64]) -> f64 {
        let lost: f64 = found.iter().zip(expected).map(|(a, b)| (a - b) * (a - b)).sum();
        (lost / expected.iter().map(|b| b * b).sum::<f64>()).sqrt()
    }

    fn square(side: usize, height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
        let at = |i: usize| i as f64 / (side - 1) as f64;
        let place = |k: usize| [at(k % side), at(k / side), height(at(k % side), at(k / side))];
        let corner = |i: usize, j: usize| (j * side + i) as u32;
        let cells = (0..side - 1).flat_map(|j| (0..side - 1).map(move |i| (i, j)));
        let faces = cells.flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        TriangleMesh { positions: (0..side * side).map(place).collect(), faces: faces.collect(), ..Default::default() }
    }

    #[test]
    fn distances_are_near_to_exact_ones_and_nearer_on_finer_meshes() {
        let bumpy = |x: f64, y: f64| 0.1 * (7.0 * x).sin() * (5.0 * y).cos();
        let errors = [20, 40, 80].map(|side| {
            let mesh = square(side, bumpy);
            let source = (side / 3 * side + side / 4) as u32;
            let exact = ExactGeodesics::new(&mesh).from_nearest(&[source], &Unwatched).unwrap();
            let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
            let found = heat.from_nearest(&[&[source]], &Unwatched).unwrap();
            assert_eq!(found.distances.column(0)[source as usize], 0.0);
            error(found.distances.column(0), &exact)
        });
        assert!(errors[2] < 0.015 && errors[1] < 0.75 * errors[0] && errors[2] < errors[1], "{errors:?}");
    }

    #[test]
    fn on_the_sphere_distances_are_angles_whatever_the_unit() {
        for scale in [1e-20, 1.0, 1e15] {
            let mut mesh = generate(Shape::Sphere, 4000).unwrap();
            mesh.positions.iter_mut().for_each(|p| *p = p.map(|x| x * scale));
            let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
            let sources: Vec<u32> = (0..40).map(|k| 97 * k).collect();
            let groups: Vec<&[u32]> = sources.chunks(1).collect();
            let found = heat.from_nearest(&groups, &Unwatched).unwrap();
            for (column, &source) in sources.iter().enumerate() {
                let angle = |p: &[f64; 3]| {
                    let from = mesh.positions[source as usize];
                    let cosine: f64 = (0..3).map(|k| p[k] / scale * (from[k] / scale)).sum();
                    scale * cosine.clamp(-1.0, 1.0).acos()
                };
                let expected: Vec<f64> = mesh.positions.iter().map(angle).collect();
                let error = error(found.distances.column(column), &expected);
                assert!(error < 0.02, "{scale} {source}: {error}");
            }
        }
    }

    /// The same in double precision, with dense systems: the potential of least squares, without a vertex where it is
    /// zero.
    #[test]
    fn single_precision_of_the_factors_does_not_show() {
        let mesh = generate(Shape::Torus, 1200).unwrap();
        let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
        let n = heat.vertices();
        let (problem, triangulation) = robust::triangulated(&mesh, &Unwatched).unwrap();
        let time = default_times(&triangulation, &mesh, &heat.component, heat.unit)[0] / problem.area;
        let mass = problem.mass.lumped();
        let system = |entry: &dyn Fn(usize, usize) -> f64| {
            let mut full = DenseMatrix::zeros(n, n);
            for row in 0..n {
                (0..n).for_each(|column| full.column_mut(column)[row] = entry(row, column));
                let (columns, values) = problem.stiffness.row(row);
                columns.iter().zip(values).for_each(|(&column, value)| full.column_mut(column as usize)[row] += value);
            }
            full
        };
        for source in [0, 700] {
            let mut u = DenseMatrix::zeros(n, 1);
            u.column_mut(0)[source] = 1.0;
            let diagonal = |i: usize, j: usize| if i == j { mass[i] / time } else { 0.0 };
            solve_definite(system(&diagonal), &mut u).unwrap();
            // Where vertices are in the order of the factors.
            let at = |v: usize| heat.place[v] as usize;
            let mut ordered = vec![0.0; n];
            (0..n).for_each(|v| ordered[at(v)] = u.column(0)[v]);
            let divergence = heat.gradients.divergence(&ordered, 1, 1);
            let mut potential = DenseMatrix::zeros(n, 1);
            (0..n).for_each(|v| potential.column_mut(0)[v] = divergence[at(v)]);
            solve_definite(system(&|_, _| 1.0 / n as f64), &mut potential).unwrap();
            let base = potential.column(0)[source];
            let expected: Vec<f64> = potential.column(0).iter().map(|p| ((p - base) * heat.unit).max(0.0)).collect();
            let found = heat.from_nearest(&[&[source as u32]], &Unwatched).unwrap();
            let largest = expected.iter().copied().fold(0.0, f64::max);
            let worst = found.distances.column(0).iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-5 * largest, "{source}: {worst} of {largest}");
        }
    }

    #[test]
    fn a_source_alone_is_what_it_is_among_many() {
        let mesh = generate(Shape::Torus, 2000).unwrap();
        let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
        let sources: Vec<[u32; 2]> = (0..FEW as u32 + 35).map(|k| [37 * k, 1999 - k]).collect();
        let groups: Vec<&[u32]> = sources.iter().map(|own| &own[..]).collect();
        let all = heat.from_nearest(&groups, &Unwatched).unwrap();
        for count in [1, 3] {
            let some = heat.from_nearest(&groups[..count], &Unwatched).unwrap();
            for column in 0..count {
                let error = error(some.distances.column(column), all.distances.column(column));
                assert!(error < 1e-7, "{error}");
            }
        }
    }

    /// `CHLADNI_MESHES=… cargo test --release -p chladni-spectral --lib -- --ignored --nocapture
    /// seconds_of_a_source`, with `RAYON_NUM_THREADS=2`
    #[test]
    #[ignore = "measures; run it alone"]
    fn seconds_of_a_source() {
        let made = [
            ("torus", generate(Shape::Torus, 100_000).unwrap()),
            ("grid", square(316, |x, y| 0.1 * (7.0 * x).sin() * (5.0 * y).cos())),
        ];
        let scans = ["igea.ply", "armadillo.obj"].into_iter().filter_map(|name| Some((name, load(name)?)));
        for (name, mesh) in made.into_iter().chain(scans) {
            let begin = std::time::Instant::now();
            let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
            let made = begin.elapsed().as_secs_f64();
            let entries = heat.symbolic.entries();
            let sources: Vec<u32> = (0..32).map(|k| 1301 * k).collect();
            let groups: Vec<&[u32]> = sources.chunks(1).collect();
            let least = |work: &dyn Fn()| {
                let once = |_| {
                    let begin = std::time::Instant::now();
                    work();
                    1e3 * begin.elapsed().as_secs_f64()
                };
                (0..15).map(once).fold(f64::INFINITY, f64::min)
            };
            let one = least(&|| drop(heat.from_nearest(&groups[..1], &Unwatched).unwrap()));
            let all = least(&|| drop(heat.from_nearest(&groups, &Unwatched).unwrap()));
            let mut column = vec![0.0; heat.vertices()];
            let solve = least(&|| {
                let mut column = column.clone();
                column[heat.vertices() / 2] = 1.0;
                heat.heat.solve(&heat.symbolic, &heat.tree, &mut column, 1);
            });
            column.fill(1.0);
            let whole = least(&|| heat.poisson.solve(&heat.symbolic, &heat.tree, &mut column.clone(), 1));
            let gradients = least(&|| drop(heat.gradients.divergence(&column, 1, 1)));
            println!(
                "{name}: {} vertices, {entries:?} entries, made in {made:.2} s, one source {one:.2} ms (heat {solve:.2}, divergence {gradients:.2}, potential {whole:.2}), 32 sources {all:.1} ms",
                heat.vertices()
            );
        }
    }

    #[test]
    fn other_components_are_out_of_reach_and_each_has_its_nearest_source() {
        let mut mesh = square(30, |_, _| 0.0);
        let other = square(20, |_, _| 2.0);
        mesh.faces.extend(other.faces.iter().map(|f| f.map(|v| v + 900)));
        mesh.positions.extend(&other.positions);
        mesh.positions.push([5.0; 3]);
        let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
        let found = heat.from_nearest(&[&[0], &[950], &[0, 899, 950], &[1300]], &Unwatched).unwrap();
        assert!(found.distances.column(0)[900..].iter().all(|d| *d == f64::INFINITY));
        assert!(
            found.distances.column(1)[..900].iter().all(|d| *d == f64::INFINITY)
                && found.distances.column(1)[1300] == f64::INFINITY
        );
        assert!(
            found.distances.column(3)[..1300].iter().all(|d| *d == f64::INFINITY)
                && found.distances.column(3)[1300] == 0.0
        );
        for vertex in 0..900 {
            let [x, y, _] = mesh.positions[vertex];
            let expected = x.hypot(y).min((1.0 - x).hypot(1.0 - y));
            let found = found.distances.column(2)[vertex];
            assert!((found - expected).abs() < 0.06, "{x} {y}: {found} {expected}");
        }
        assert!(error(&found.distances.column(2)[900..1300], &found.distances.column(1)[900..1300]) < 1e-6);
    }

    #[test]
    fn long_thin_surfaces_have_distances_along_them() {
        // A tube that is closed to a ring: how far it is around is known.
        let (along, around, large, small) = (400, 12, 20.0, 0.05);
        let turn = |k: usize, of: usize| 2.0 * std::f64::consts::PI * k as f64 / of as f64;
        let place = |k: usize| {
            let ((s, c), (t, d)) = (turn(k / around, along).sin_cos(), turn(k % around, around).sin_cos());
            [(large + small * d) * c, (large + small * d) * s, small * t]
        };
        let corner = |i: usize, j: usize| ((i % along) * around + j % around) as u32;
        let faces = (0..along * around).flat_map(|k| {
            let (i, j) = (k / around, k % around);
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        let positions = (0..along * around).map(place).collect();
        let mesh = TriangleMesh { positions, faces: faces.collect(), ..Default::default() };
        let exact = ExactGeodesics::new(&mesh).from_nearest(&[0], &Unwatched).unwrap();
        let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
        assert_eq!(heat.heat.bytes(), 8);
        let found = heat.from_nearest(&[&[0]], &Unwatched).unwrap();
        let error = error(found.distances.column(0), &exact);
        assert!(error < 0.02, "{error}");
        for shape in [Shape::Sphere, Shape::Torus] {
            let heat = HeatGeodesics::new(&generate(shape, 4000).unwrap(), None, &Unwatched).unwrap();
            assert_eq!((heat.heat.bytes(), heat.poisson.bytes()), (4, 4), "{shape:?}");
        }
    }

    #[test]
    fn needles_holes_and_pages_do_no_harm() {
        let mut random = SplitMix64::new(4);
        let mut mesh = square(40, |_, _| 0.0);
        // Squeezed to needles along one axis, with a third page on one side, and holes.
        mesh.positions.iter_mut().for_each(|p| p[0] = p[0].powi(4));
        mesh.faces.retain(|_| random.unit() < 0.98);
        let exact = ExactGeodesics::new(&mesh).from_nearest(&[820], &Unwatched).unwrap();
        let heat = HeatGeodesics::new(&mesh, None, &Unwatched).unwrap();
        let found = heat.from_nearest(&[&[820]], &Unwatched).unwrap();
        for (d, e) in found.distances.column(0).iter().zip(&exact) {
            assert_eq!(d.is_finite(), e.is_finite());
        }
        let reached = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(&exact).filter(|(_, e)| e.is_finite()).map(|(v, _)| *v).collect()
        };
        let error = error(&reached(found.distances.column(0)), &reached(&exact));
        assert!(error < 0.1, "{error}");
    }

    /// Squares and rings of triangles whose size and shape vary, a sphere, a surface that is squeezed: nothing that the
    /// method was tuned on.
    #[test]
    fn the_error_of_slopes_is_that_of_distances_or_up_to_five_times_as_large() {
        let graded = |power: i32| {
            let mut mesh = square(40, |x, y| 0.1 * (5.0 * x).sin() * (4.0 * y).cos());
            mesh.positions.iter_mut().for_each(|p| (p[0], p[1]) = (p[0].powi(power), p[1].powi(power)));
            mesh
        };
        let squeezed = |by: f64| {
            let mut mesh = generate(Shape::Sphere, 2000).unwrap();
            mesh.positions.iter_mut().for_each(|p| p[1] /= by);
            mesh
        };
        let cases = [graded(1), graded(2), graded(4), graded(7), squeezed(1.0), squeezed(4.0), squeezed(30.0)];
        let mut worst = 0.0f64;
        for (case, mesh) in cases.iter().enumerate() {
            let heat = HeatGeodesics::new(mesh, None, &Unwatched).unwrap();
            let mut mass = vec![0.0; heat.vertices()];
            for face in &mesh.faces {
                face.iter().for_each(|&v| mass[v as usize] += face_area(mesh, face));
            }
            for source in [0, 777, 1503] {
                let found = heat.from_nearest(&[&[source]], &Unwatched).unwrap();
                let exact = ExactGeodesics::new(mesh).from_nearest(&[source], &Unwatched).unwrap();
                let square =
                    |values: &dyn Fn(usize) -> f64| (0..mass.len()).map(|v| mass[v] * values(v).powi(2)).sum::<f64>();
                let column = found.distances.column(0);
                let error = (square(&|v| column[v] - exact[v]) / square(&|v| exact[v])).sqrt();
                let told = found.slope_errors[0].unwrap();
                assert!(error < told && told < 5.0 * error, "{case} {source}: {error} {told}");
                worst = worst.max(error);
            }
        }
        assert!(worst > 0.05, "none of these meshes is hard: {worst}");
    }

    #[test]
    fn a_component_that_is_small_beside_others_has_the_distances_that_it_has_alone() {
        let own = |scale: f64| {
            let mut mesh = generate(Shape::Torus, 600).unwrap();
            mesh.positions.iter_mut().for_each(|p| *p = p.map(|x| 3.0 + scale * x));
            mesh
        };
        for scale in [1.0, 1e-3, 1e-6] {
            let (small, mut both) = (own(scale), generate(Shape::Sphere, 1000).unwrap());
            let first = both.positions.len() as u32;
            both.positions.extend(&small.positions);
            both.faces.extend(small.faces.iter().map(|face| face.map(|v| first + v)));
            let sources: [&[u32]; 2] = [&[first + 17], &[first + 17, 5]];
            let together =
                HeatGeodesics::new(&both, None, &Unwatched).unwrap().from_nearest(&sources, &Unwatched).unwrap();
            let alone =
                HeatGeodesics::new(&small, None, &Unwatched).unwrap().from_nearest(&[&[17]], &Unwatched).unwrap();
            for column in 0..2 {
                let found = &together.distances.column(column)[first as usize..];
                assert!(error(found, alone.distances.column(0)) < 1e-5, "{scale}");
            }
            let [here, everywhere] = [0, 1].map(|column| together.slope_errors[column].unwrap());
            let expected = alone.slope_errors[0].unwrap();
            assert!((here - expected).abs() < 1e-4 * expected && everywhere < 0.1, "{here} {everywhere} {expected}");
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let mesh = square(5, |_, _| 0.0);
        let heat = HeatGeodesics::new(&mesh, Some(0.01), &Unwatched).unwrap();
        let told = heat.from_nearest(&[&[3], &[4, 25]], &Unwatched).unwrap_err().to_string();
        assert_eq!(told, "source 2 is vertex 25 of 25");
        for time in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let told = HeatGeodesics::new(&mesh, Some(time), &Unwatched).unwrap_err().to_string();
            assert!(told.starts_with("time must be a finite positive number, got "), "{told}");
        }
        let flat = TriangleMesh { positions: vec![[0.0; 3]; 3], faces: vec![[0, 1, 2]], ..Default::default() };
        assert!(HeatGeodesics::new(&flat, None, &Unwatched).is_err());
    }
}
