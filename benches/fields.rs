//! Field bases and design on a sphere of 82,000 faces, 1,000 dimensions. `cargo bench --bench fields`

use std::sync::LazyLock;

use chladni::{
    field::{
        Constraint, Construction, DesignModel, EnergyWeights, FieldBasis, FieldParameters, FieldSurface,
        LocalEigenfields, field_basis, singularities,
    },
    mesh::shape::{Shape, generate, noisy},
    monitor::Unwatched,
    operator::transport::FieldKind,
};
use divan::Bencher;

fn main() {
    divan::main();
}

const DIMENSION: usize = 1000;

/// A sphere with triangles of all shapes, and a basis ready for design.
struct Ready {
    surface: FieldSurface,
    basis: FieldBasis,
    model: DesignModel,
}

static READY: LazyLock<Ready> = LazyLock::new(|| {
    let mesh = noisy(&generate(Shape::Sphere, 41_000).unwrap(), 0.2, 0).unwrap();
    let surface = FieldSurface::new(mesh).unwrap();
    let basis = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, DIMENSION), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    Ready { surface, basis, model }
});

const WEIGHTS: EnergyWeights = EnergyWeights { harmonic: 1.0, biharmonic: 0.01 };

fn constraints(count: usize) -> Vec<Constraint> {
    let faces = READY.surface.faces();
    let at = |i: usize| Constraint {
        face: (i * faces / count) as u32,
        value: [(i as f64).cos(), (i as f64).sin(), 0.0],
        weight: None,
    };
    (0..count).map(at).collect()
}

#[divan::bench(args = ["vector", "n_vector", "tensor"], sample_count = 3)]
fn heat_basis(bencher: Bencher, kind: &str) {
    let field = match kind {
        "vector" => FieldKind::Vector {},
        "tensor" => FieldKind::Tensor {},
        _ => FieldKind::NVector { n: 4 },
    };
    let surface = &READY.surface;
    bencher.bench(|| field_basis(surface, &FieldParameters::new(field, DIMENSION), &Unwatched));
}

#[divan::bench(sample_count = 3)]
fn local_eigenfields(bencher: Bencher) {
    let mut parameters = FieldParameters::new(FieldKind::Vector {}, DIMENSION);
    parameters.construction = Construction::LocalEigenfields(LocalEigenfields::default());
    let surface = &READY.surface;
    bencher.bench(|| field_basis(surface, &parameters, &Unwatched));
}

#[divan::bench(sample_count = 3)]
fn set_up_design(bencher: Bencher) {
    let basis = &READY.basis;
    bencher.bench(|| DesignModel::new(basis, &Unwatched));
}

#[divan::bench(args = [1, 10, 100])]
fn solve(bencher: Bencher, count: usize) {
    let Ready { basis, model, .. } = &*READY;
    let (model, constraints) = (model.weighted(WEIGHTS, None).unwrap(), constraints(count));
    bencher.bench(|| model.solve(basis, &constraints));
}

#[divan::bench]
fn lift(bencher: Bencher) {
    let Ready { basis, model, .. } = &*READY;
    let design = model.weighted(WEIGHTS, None).unwrap().solve(basis, &constraints(10)).unwrap();
    bencher.bench(|| basis.space.lift(&design.coefficients));
}

#[divan::bench]
fn singular_vertices(bencher: Bencher) {
    let Ready { surface, basis, model } = &*READY;
    let design = model.weighted(WEIGHTS, None).unwrap().solve(basis, &constraints(10)).unwrap();
    let field = basis.space.lift(&design.coefficients).unwrap();
    bencher.bench(|| singularities(surface, basis.kind, &field));
}
