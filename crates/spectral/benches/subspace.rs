//! Connectivity, samples and radial columns: a sphere of igea's size, 1000 samples. `cargo bench --bench subspace`

use std::sync::LazyLock;

use chladni_base::Unwatched;
use chladni_mesh::{
    TriangleMesh,
    connectivity::Connectivity,
    distance::DistanceKind,
    measure::vertex_areas,
    sample::{farthest_points, poisson_disk, well_spread_points},
    shape::{Shape, generate, noisy},
};
use chladni_spectral::spectrum::radial::{Profile, columns};
use divan::Bencher;

fn main() {
    divan::main();
}

const DIMENSION: usize = 1000;

/// A sphere with triangles of all shapes, its connectivity and areas, and samples on it.
struct Surface {
    mesh: TriangleMesh,
    connectivity: Connectivity,
    areas: Vec<f64>,
    samples: Vec<u32>,
}

static SURFACE: LazyLock<Surface> = LazyLock::new(|| {
    let mesh = noisy(&generate(Shape::Sphere, 134_000).unwrap(), 0.2, 0).unwrap();
    let connectivity = Connectivity::new(&mesh);
    let areas = vertex_areas(&mesh);
    let samples = well_spread_points(&mesh, &connectivity, &areas, DIMENSION, 3, 0, &Unwatched).unwrap();
    Surface { mesh, connectivity, areas, samples }
});

#[divan::bench]
fn connectivity(bencher: Bencher) {
    let surface = &*SURFACE;
    bencher.bench(|| Connectivity::new(&surface.mesh));
}

#[divan::bench]
fn sample_poisson_disk(bencher: Bencher) {
    let surface = &*SURFACE;
    bencher.bench(|| poisson_disk(&surface.mesh, &surface.connectivity, DIMENSION, 0, &Unwatched));
}

#[divan::bench]
fn sample_farthest_points(bencher: Bencher) {
    let surface = &*SURFACE;
    bencher.bench(|| farthest_points(&surface.connectivity, DIMENSION, 0, &Unwatched));
}

#[divan::bench]
fn sample_well_spread(bencher: Bencher) {
    let Surface { mesh, connectivity, areas, .. } = &*SURFACE;
    bencher.bench(|| well_spread_points(mesh, connectivity, areas, DIMENSION, 3, 0, &Unwatched));
}

#[divan::bench(args = [
    DistanceKind::Euclidean,
    DistanceKind::Dijkstra,
    DistanceKind::Stvd { window: 3 },
    DistanceKind::Stvd { window: 6 },
    DistanceKind::FastMarching,
])]
fn radial_columns(bencher: Bencher, distance: DistanceKind) {
    let Surface { mesh, connectivity, samples, .. } = &*SURFACE;
    bencher.bench(|| columns(mesh, connectivity, samples, distance, Profile::Cubic, 10.0, &Unwatched));
}
