use chladni_base::{Cancelled, Monitor, Unwatched};

use super::*;
use crate::TriangleMesh;
use crate::connectivity::Connectivity;
use crate::fixtures::{grid, placed, sphere, union};
use crate::measure::{surface_area, vertex_areas};

type Sampler = fn(&TriangleMesh, &Connectivity, usize, u64, &dyn Monitor) -> Result<Vec<u32>, Cancelled>;

fn farthest(
    _: &TriangleMesh,
    connectivity: &Connectivity,
    count: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    farthest_points(connectivity, count, seed, monitor)
}

fn well_spread(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    count: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Vec<u32>, Cancelled> {
    well_spread_points(mesh, connectivity, &vertex_areas(mesh), count, 3, seed, monitor)
}

const SAMPLERS: [Sampler; 3] = [farthest, poisson_disk, well_spread];

fn sample(sampler: Sampler, mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<u32> {
    sampler(mesh, &Connectivity::new(mesh), count, seed, &Unwatched).expect("nobody cancels")
}

fn straight(mesh: &TriangleMesh, a: u32, b: u32) -> f64 {
    (mesh.point(a) - mesh.point(b)).norm()
}

fn least_spacing(mesh: &TriangleMesh, samples: &[u32]) -> f64 {
    let pairs = samples.iter().enumerate().flat_map(|(i, &a)| samples[..i].iter().map(move |&b| (a, b)));
    pairs.map(|(a, b)| straight(mesh, a, b)).fold(f64::INFINITY, f64::min)
}

/// The largest distance of a vertex to the nearest sample.
fn covering_radius(mesh: &TriangleMesh, samples: &[u32]) -> f64 {
    (0..mesh.positions.len() as u32)
        .map(|v| samples.iter().map(|&s| straight(mesh, v, s)).fold(f64::INFINITY, f64::min))
        .fold(0.0, f64::max)
}

#[test]
fn there_are_as_many_distinct_samples_as_asked_for() {
    let mesh = sphere(24);
    let n = mesh.positions.len();
    for sampler in SAMPLERS {
        for count in [0, 1, 2, 3, 9, 100, 333, n - 1, n, n + 1, usize::MAX] {
            let mut samples = sample(sampler, &mesh, count, 1);
            assert_eq!(samples.len(), count.min(n), "of {count}");
            samples.sort_unstable();
            samples.dedup();
            assert_eq!(samples.len(), count.min(n), "{count} distinct");
            assert!(samples.iter().all(|&v| (v as usize) < n));
        }
    }
}

#[test]
fn samples_keep_apart_and_leave_no_hole() {
    for (k, count) in [(48, 200), (96, 200)] {
        samples_of_a_sphere_are_even(k, count);
    }
}

fn samples_of_a_sphere_are_even(k: usize, count: usize) {
    let mesh = sphere(k);
    let share = (surface_area(&mesh) / count as f64).sqrt();
    for sampler in SAMPLERS {
        let samples = sample(sampler, &mesh, count, 3);
        let (apart, hole) = (least_spacing(&mesh, &samples), covering_radius(&mesh, &samples));
        assert!(apart > 0.6 * share, "apart {apart}, share {share}");
        assert!(hole < 1.1 * share, "hole {hole}, share {share}");
    }
}

#[test]
fn a_seed_decides_the_samples() {
    let mesh = sphere(24);
    for sampler in SAMPLERS {
        assert_eq!(sample(sampler, &mesh, 60, 5), sample(sampler, &mesh, 60, 5));
        assert_ne!(sample(sampler, &mesh, 60, 5), sample(sampler, &mesh, 60, 6));
    }
}

#[test]
fn components_get_samples_in_proportion_to_their_area_and_at_least_one() {
    let mesh = union(&[
        sphere(40),
        placed(sphere(40), 0.5, [0.0, 0.0, 0.0]),
        placed(sphere(3), 0.001, [3.0, 0.0, 0.0]),
        TriangleMesh { positions: vec![[9.0; 3]], faces: vec![], ..Default::default() },
    ]);
    let ends = [sphere(40).positions.len(), 2 * sphere(40).positions.len()];
    for sampler in SAMPLERS {
        let samples = sample(sampler, &mesh, 252, 0);
        let large = samples.iter().filter(|&&v| (v as usize) < ends[0]).count();
        let small = samples.iter().filter(|&&v| (ends[0]..ends[1]).contains(&(v as usize))).count();
        assert!((185..=215).contains(&large) && large + small == 250, "{large} and {small}");
    }
}

#[test]
fn meshes_that_are_hardly_one_are_sampled() {
    let lone = TriangleMesh { positions: vec![[1.0, 2.0, 3.0]; 5], faces: vec![], ..Default::default() };
    let flat = TriangleMesh {
        positions: vec![[0.0; 3]; 6],
        faces: vec![[0, 1, 2], [3, 4, 5], [1, 2, 3]],
        ..Default::default()
    };
    for sampler in SAMPLERS {
        assert!(sample(sampler, &TriangleMesh::default(), 3, 0).is_empty());
        assert_eq!(sample(sampler, &lone, 3, 0).len(), 3);
        assert_eq!(sample(sampler, &flat, 4, 0).len(), 4);
        assert_eq!(sample(sampler, &grid(2), 3, 0).len(), 3);
    }
}

#[test]
fn farthest_points_agree_with_the_definition() {
    let mesh = sphere(7);
    let connectivity = Connectivity::new(&mesh);
    let n = mesh.positions.len();
    // All distances along edges, by Floyd and Warshall.
    let mut along = vec![vec![f64::INFINITY; n]; n];
    for v in 0..n {
        along[v][v] = 0.0;
        let (neighbours, lengths) = connectivity.neighbours(v as u32);
        neighbours.iter().zip(lengths).for_each(|(&w, &l)| along[v][w as usize] = l);
    }
    for k in 0..n {
        for i in 0..n {
            for j in 0..n {
                along[i][j] = along[i][j].min(along[i][k] + along[k][j]);
            }
        }
    }
    let samples = farthest_points(&connectivity, 40, 0, &Unwatched).expect("nobody cancels");
    for (k, &next) in samples.iter().enumerate().skip(1) {
        let nearest = |v: usize| samples[..k].iter().map(|&s| along[s as usize][v]).fold(f64::INFINITY, f64::min);
        let farthest = (0..n).map(nearest).fold(0.0, f64::max);
        assert!((nearest(next as usize) - farthest).abs() < 1e-5, "sample {k}");
    }
}

#[test]
fn adding_samples_keeps_those_there_are() {
    let connectivity = Connectivity::new(&sphere(10));
    let samples = extend_farthest_points(&connectivity, vec![4, 9, 4, 1_000_000, 30], 20, &Unwatched).expect("fine");
    assert_eq!(samples[..3], [4, 9, 30]);
    assert_eq!(samples.len(), 20);
}

#[test]
fn lloyd_moves_even_the_cells_and_keep_each_sample_on_its_component() {
    let mesh = union(&[sphere(30), placed(sphere(30), 1.0, [0.5, 0.0, 0.0])]);
    let half = (mesh.positions.len() / 2) as u32;
    let connectivity = Connectivity::new(&mesh);
    let areas = vertex_areas(&mesh);
    let spread = |samples: &[u32]| {
        let cells = voronoi_cells(&connectivity, samples, &Unwatched).expect("nobody cancels");
        let energy = cells
            .iter()
            .enumerate()
            .map(|(v, &cell)| areas[v] * straight(&mesh, v as u32, samples[cell as usize]).powi(2));
        energy.sum::<f64>()
    };
    let before = sample(poisson_disk, &mesh, 150, 2);
    let after = lloyd(&mesh.positions, &connectivity, &areas, before.clone(), 3, &Unwatched).expect("nobody cancels");
    assert!(spread(&after) < 0.95 * spread(&before), "{} to {}", spread(&before), spread(&after));
    let mut distinct = after.clone();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), 150);
    assert!(before.iter().zip(&after).all(|(&a, &b)| (a < half) == (b < half)));
}

#[test]
fn every_sampler_stops_when_cancelled() {
    struct Stop;
    impl Monitor for Stop {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }
    let mesh = sphere(80);
    let connectivity = Connectivity::new(&mesh);
    for sampler in SAMPLERS {
        assert_eq!(sampler(&mesh, &connectivity, 2000, 0, &Stop), Err(Cancelled));
    }
    for sampler in SAMPLERS {
        assert_eq!(sampler(&mesh, &connectivity, 20, 0, &Stop), Err(Cancelled), "through clusters");
    }
    assert_eq!(voronoi_cells(&connectivity, &[0], &Stop), Err(Cancelled));
}
