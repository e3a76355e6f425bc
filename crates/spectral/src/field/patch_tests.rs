//! The patch test, and what stands on it: fields without energy are in the space, so that designs, eigenvalues and
//! traces do not depend on how many columns there are.

use std::sync::Arc;

use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::NO_FACE;
use chladni_mesh::sample::farthest_points;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::frames::{Complex64, normalise, parts, power};
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;

const TRANSPORTED: [FieldKind; 4] =
    [FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 2 }, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}];

/// A flat plate of irregular triangles, its vertices moved within the plane, bent to a part of a cylinder, and scaled.
fn plate(vertices: usize, seed: u64, bent: bool, scale: f64) -> FieldSurface {
    let mut mesh = generate(Shape::Rectangle, vertices).unwrap();
    let spacing = 0.2 / (vertices as f64).sqrt();
    let mut random = SplitMix64::new(seed);
    for p in &mut mesh.positions {
        let [x, y] = [p[0] + spacing * random.signed_unit(), p[1] + spacing * random.signed_unit()];
        *p = if bent { [x.sin(), y, x.cos()] } else { [x, y, 0.1 * x] }.map(|x| scale * x);
    }
    FieldSurface::new(mesh).unwrap()
}

fn basis(surface: &FieldSurface, kind: FieldKind, dimension: usize, seed: u64) -> FieldBasis {
    let parameters = FieldParameters { seed, ..FieldParameters::new(kind, dimension) };
    field_basis(surface, &parameters, &Unwatched).unwrap()
}

fn lowest(basis: &FieldBasis) -> f64 {
    CpuSolver.lowest(basis.stiffness.to_dense(), basis.mass.to_dense(), 1, &Unwatched).unwrap().values[0]
}

fn lifted(basis: &FieldBasis, design: &Design) -> Vec<f64> {
    basis.space.lift(&design.coefficients).unwrap().into_iter().map(f64::from).collect()
}

/// `‖a − b‖ / ‖b‖` in the norm of the surface.
fn off(surface: &FieldSurface, block: usize, a: &[f64], b: &[f64]) -> f64 {
    let square = |x: &mut dyn Iterator<Item = f64>| -> f64 {
        x.enumerate().map(|(i, x)| surface.frames().areas()[i / block] * x * x).sum::<f64>()
    };
    (square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())).sqrt()
}

#[test]
fn spaces_on_flat_surfaces_hold_the_parallel_fields() {
    for (seed, bent) in [(1, false), (2, true)] {
        let surface = plate(9000, seed, bent, 1.0);
        for kind in TRANSPORTED {
            for dimension in [60, 400, 1600] {
                let value = lowest(&basis(&surface, kind, dimension, seed));
                assert!(value.abs() < 1e-4, "{kind:?}, {dimension}: {value}");
            }
        }
    }
}

#[test]
fn a_pin_on_a_plate_gives_its_length_everywhere() {
    let surface = plate(6000, 3, false, 1.0);
    for kind in [1, 2, 4].map(|n| FieldKind::NVector { n }) {
        for dimension in [100, 800] {
            let basis = basis(&surface, kind, dimension, 5);
            let model = DesignModel::new(&basis, &Unwatched).unwrap().weighted(EnergyWeights::default(), None).unwrap();
            let pin = Constraint { face: 4321, value: [0.6, 0.8, 0.0], hold: Hold::Exact };
            let field = lifted(&basis, &model.solve(&basis, &[pin]).unwrap());
            let worst = field.chunks_exact(2).map(|u| (u[0].hypot(u[1]) - 1.0).abs()).fold(0.0, f64::max);
            assert!(worst < 0.01, "{kind:?}, {dimension}: {worst}");
        }
    }
}

#[test]
fn smoothing_keeps_the_integral_of_the_trace() {
    for (shape, vertices) in [(Shape::Torus, 2500), (Shape::Genus(2), 3000), (Shape::Sphere, 2562)] {
        let surface = FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.15, 4).unwrap()).unwrap();
        let (areas, tensors) = (surface.frames().areas(), curvature_tensors(&surface).unwrap());
        let trace = |t: &[f64]| t.chunks_exact(3).zip(areas).map(|(t, a)| a * (t[0] + t[1])).sum::<f64>();
        let whole = trace(&tensors);
        for dimension in [120, 600] {
            let basis = basis(&surface, FieldKind::Tensor {}, dimension, 1);
            let model = DesignModel::new(&basis, &Unwatched).unwrap();
            let aligned = Arc::new(model.alignment(&basis, areas, &tensors, None).unwrap());
            for harmonic in [0.1, 1.0, 10.0, 1000.0] {
                let weights = EnergyWeights { harmonic, biharmonic: 0.0 };
                let weighted = model.weighted(weights, Some((aligned.clone(), 1.0))).unwrap();
                let kept = trace(&lifted(&basis, &weighted.solve(&basis, &[]).unwrap())) / whole;
                assert!((kept - 1.0).abs() < 1e-3, "{shape}, {dimension}, {harmonic}: {kept}");
            }
        }
    }
}

/// Directions at places apart from each other: for pins on one face each, for strokes on a face and those beside it.
fn given(surface: &FieldSurface, kind: FieldKind, count: usize, hold: Hold, seed: u64) -> Vec<Constraint> {
    let mut random = SplitMix64::new(seed);
    let centres = farthest_points(&surface.dual().connectivity(), count, seed, &Unwatched).unwrap();
    let mut found = Vec::new();
    for centre in centres {
        let angle = std::f64::consts::TAU * random.unit();
        let along = surface.frames().to_world(centre as usize, Complex64::cis(angle));
        let beside = if hold == Hold::Exact { [NO_FACE; 3] } else { surface.dual().neighbours(centre as usize) };
        for face in std::iter::once(centre).chain(beside).filter(|&face| face != NO_FACE) {
            let planar = surface.frames().from_world(face as usize, along);
            let unit = normalise(planar);
            let value = match kind {
                FieldKind::Tensor {} => [unit.re * unit.re, unit.im * unit.im, 2f64.sqrt() * unit.re * unit.im],
                _ => {
                    let [x, y] = parts(power(unit, kind.order()));
                    [x, y, 0.0]
                }
            };
            found.push(Constraint { face, value, hold });
        }
    }
    found
}

fn shapes() -> Vec<(&'static str, TriangleMesh)> {
    let noise = |shape, vertices, seed| noisy(&generate(shape, vertices).unwrap(), 0.15, seed).unwrap();
    let mut long = noise(Shape::Sphere, 2562, 3);
    long.positions.iter_mut().for_each(|p| *p = [2.5 * p[0], p[1], 0.8 * p[2]]);
    vec![("sphere", noise(Shape::Sphere, 2562, 1)), ("genus 2", noise(Shape::Genus(2), 2600, 2)), ("long", long)]
}

#[test]
fn designs_with_default_weights_do_not_depend_on_the_dimension() {
    for (name, mesh) in shapes() {
        let surface = FieldSurface::new(mesh).unwrap();
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 2 }] {
            let spaces = [500, 1000, 2000].map(|dimension| basis(&surface, kind, dimension, 2));
            let models = spaces.each_ref().map(|basis| DesignModel::new(basis, &Unwatched).unwrap());
            for (what, hold) in [("pins", Hold::Exact), ("strokes", Hold::Strength(1.0))] {
                let constraints = given(&surface, kind, 10, hold, 7);
                let fields: Vec<Vec<f64>> = (spaces.iter().zip(&models))
                    .map(|(basis, model)| {
                        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
                        lifted(basis, &weighted.solve(basis, &constraints).unwrap())
                    })
                    .collect();
                for field in &fields[..2] {
                    let far = off(&surface, 2, field, &fields[2]);
                    assert!(far < 0.05, "{name}, {kind:?}, {what}: {far}");
                }
            }
        }
    }
}

#[test]
fn designs_with_default_weights_are_near_those_of_the_space_of_all_fields() {
    for (name, mesh) in shapes().into_iter().take(2) {
        let surface = FieldSurface::new(mesh).unwrap();
        for kind in [FieldKind::Vector {}, FieldKind::NVector { n: 2 }] {
            let whole = whole_space(&surface, kind, FieldBoundary::default()).unwrap();
            let small = basis(&surface, kind, 1000, 2);
            let constraints = given(&surface, kind, 10, Hold::Exact, 7);
            let [exact, field] =
                [(&whole, DesignModel::sparse(&whole)), (&small, DesignModel::new(&small, &Unwatched).unwrap())].map(
                    |(basis, model)| {
                        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
                        lifted(basis, &weighted.solve(basis, &constraints).unwrap())
                    },
                );
            let far = off(&surface, 2, &field, &exact);
            assert!(far < 0.03, "{name}, {kind:?}: {far}");
        }
    }
}

#[test]
fn a_lone_stroke_of_strength_one_is_met_to_a_percent_whatever_the_surface_and_its_scale() {
    for (name, mesh) in shapes() {
        for scale in [1e-3, 1.0, 1e3] {
            let mut mesh = mesh.clone();
            mesh.positions.iter_mut().flatten().for_each(|x| *x *= scale);
            let surface = FieldSurface::new(mesh).unwrap();
            for n in [1, 4] {
                let basis = basis(&surface, FieldKind::NVector { n }, 300, 1);
                let model = DesignModel::new(&basis, &Unwatched).unwrap();
                for (weights, strength) in
                    [(EnergyWeights::default(), 1.0), (EnergyWeights { harmonic: 1e-4, biharmonic: 3.0 }, 0.1)]
                {
                    // The two numbers of a face are moved about alike, and not exactly so.
                    let share = 1.0 / (1.0 + 100.0 * strength);
                    let one = Constraint { face: 77, value: [3.0, 4.0, 0.0], hold: Hold::Strength(strength) };
                    for model in [model.clone(), DesignModel::sparse(&basis)] {
                        let missed =
                            model.weighted(weights, None).unwrap().solve(&basis, &[one]).unwrap().residuals[0] / 5.0;
                        assert!((missed / share - 1.0).abs() < 0.1, "{name}, {scale}, n = {n}: {missed}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_lone_stroke_is_met_in_any_direction_where_fields_yield_in_one_alone() {
    // Beside a boundary fields run along it, and on a stretched plate hardly across.
    let share = 1.0 / 101.0;
    for (stretch, n) in [(1.0, 1200), (8.0, 600)] {
        let mut mesh = plate(n, 1, false, 1.0).mesh().clone();
        mesh.positions.iter_mut().for_each(|p| p[0] *= stretch);
        let surface = FieldSurface::new(mesh).unwrap();
        let basis = basis(&surface, FieldKind::Vector {}, 200, 1);
        let models = [DesignModel::new(&basis, &Unwatched).unwrap(), DesignModel::sparse(&basis)];
        let models = models.map(|model| model.weighted(EnergyWeights::default(), None).unwrap());
        let mut random = SplitMix64::new(5);
        for face in (0..surface.faces() as u32).step_by(surface.faces() / 30) {
            let (sine, cosine) = (std::f64::consts::TAU * random.unit()).sin_cos();
            let one = Constraint { face, value: [2.0 * cosine, 2.0 * sine, 0.0], hold: Hold::Strength(1.0) };
            for model in &models {
                let missed = model.solve(&basis, &[one]).unwrap().residuals[0] / 2.0;
                assert!(missed < 1.1 * share, "{stretch}, face {face}: {missed}");
            }
        }
    }
}

#[test]
fn strengths_mean_the_same_with_a_sparse_factor_where_fields_have_no_energy() {
    // A torus has two harmonic fields, a plate the parallel ones.
    let torus = FieldSurface::new(generate(Shape::Torus, 1500).unwrap()).unwrap();
    for (surface, kind) in
        [(&torus, FieldKind::Vector {}), (&torus, FieldKind::Tensor {}), (&plate(2000, 1, false, 1.0), TRANSPORTED[2])]
    {
        let basis = basis(surface, kind, 240, 1);
        let constraints = given(surface, kind, 6, Hold::Strength(0.5), 3);
        let fields = [DesignModel::new(&basis, &Unwatched).unwrap(), DesignModel::sparse(&basis)].map(|model| {
            lifted(
                &basis,
                &model.weighted(EnergyWeights::default(), None).unwrap().solve(&basis, &constraints).unwrap(),
            )
        });
        let far = off(surface, kind.block(), &fields[1], &fields[0]);
        assert!(far < 1e-3, "{kind:?}: {far}");
    }
}
