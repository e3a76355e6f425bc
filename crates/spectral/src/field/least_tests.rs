//! Designs by sparse factors of the whole surface, against conjugate gradients with cycles and dense factors.

use std::sync::Arc;

use chladni_base::Unwatched;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::direct::expected_bytes;
use super::*;
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;

struct Problem {
    surface: FieldSurface,
    basis: FieldBasis,
    model: DesignModel,
    factored: FullSpace,
    cycled: FullSpace,
}

fn problem(surface: FieldSurface, kind: FieldKind, dimension: usize) -> Problem {
    let basis = field_basis(&surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let boundary = FieldBoundary::default();
    let factored = FullSpace::new(&surface, kind, boundary, &Unwatched).unwrap();
    assert!(factored.is_factored());
    let cycled = FullSpace::by_cycles(&surface, kind, boundary).unwrap();
    assert!(!cycled.is_factored());
    Problem { surface, basis, model, factored, cycled }
}

impl Problem {
    fn least(&self, weighted: &WeightedModel, constraints: &[Constraint]) -> (Design, Option<Refined>) {
        let design = weighted.solve(&self.basis, constraints).unwrap();
        let found = self.factored.least(weighted, &self.basis, constraints, &design, &Unwatched).unwrap();
        (design, found)
    }

    fn off(&self, a: &[f64], b: &[f64]) -> f64 {
        let block = self.basis.space.block();
        let areas = self.surface.frames().areas();
        let square =
            |x: &mut dyn Iterator<Item = f64>| -> f64 { x.enumerate().map(|(i, x)| areas[i / block] * x * x).sum() };
        let apart = square(&mut a.iter().zip(b).map(|(a, b)| a - b));
        (apart / square(&mut b.iter().copied())).sqrt()
    }
}

fn spread(faces: usize, count: usize, hold: impl Fn(usize) -> Hold) -> Vec<Constraint> {
    let one = |i: usize| Constraint {
        face: ((i * faces) / count + i * i % 7) as u32,
        value: [(1.3 * i as f64).cos(), (0.7 * i as f64).sin(), 0.4],
        hold: hold(i),
    };
    (0..count).map(one).collect()
}

const KINDS: [FieldKind; 4] =
    [FieldKind::Vector {}, FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}];

#[test]
fn designs_by_factors_are_those_of_cycles() {
    for shape in [Shape::Sphere, Shape::Torus, Shape::Rectangle] {
        for kind in KINDS {
            let mesh = noisy(&generate(shape, 400).unwrap(), 0.2, 1).unwrap();
            let p = problem(FieldSurface::new(mesh).unwrap(), kind, 120);
            for (harmonic, biharmonic) in [(1.0, 0.05), (2.0, 0.001), (1.0, 0.0)] {
                let weighted = p.model.weighted(EnergyWeights { harmonic, biharmonic }, None).unwrap();
                let hold = |i: usize| if i.is_multiple_of(2) { Hold::Exact } else { Hold::Weight(30.0) };
                let constraints = spread(p.surface.faces(), 7, hold);
                let (design, found) = p.least(&weighted, &constraints);
                let found = found.unwrap();
                let cycled = p.cycled.refine(&weighted, &p.basis, &constraints, &design, 1e-10, &Unwatched).unwrap();
                let off = p.off(&found.field, &cycled.field);
                println!("{shape:?} {kind:?} {harmonic} {biharmonic}: {off:.1e}");
                assert!(off < 1e-6, "{shape:?} {kind:?} {harmonic} {biharmonic}: {off}");
                assert!(
                    (found.harmonic_energy - cycled.harmonic_energy).abs() < 1e-5 * cycled.harmonic_energy.max(1e-3)
                );
                // As exactly as fields without energy are told from others.
                assert!(found.residuals.iter().step_by(2).all(|missed| *missed < 1e-6), "{:?}", found.residuals);
                // Its coefficients are those of the field of the space that is nearest: none is nearer, that of the
                // design neither.
                assert!(found.distance <= cycled.distance * (1.0 + 1e-5), "{} {}", found.distance, cycled.distance);
                // The same factors serve conjugate gradients.
                let again = p.factored.refine(&weighted, &p.basis, &constraints, &design, 1e-10, &Unwatched).unwrap();
                let off = p.off(&again.field, &cycled.field);
                assert!(off < 1e-6, "{shape:?} {kind:?} {harmonic} {biharmonic}, by steps: {off}");
            }
        }
    }
}

/// On surfaces with fields without energy, with weights that take most digits from the difference of two inverses.
#[test]
fn exact_constraints_are_met_whatever_the_weights_and_the_surface() {
    let plate = |length: f64, width: f64| {
        let mut mesh = noisy(&generate(Shape::Rectangle, 400).unwrap(), 0.15, 2).unwrap();
        mesh.positions.iter_mut().for_each(|p| (p[0], p[1]) = (length * p[0], width * p[1]));
        mesh
    };
    let genus = generate(Shape::Genus(2), 900).unwrap();
    let cases = [
        (genus, FieldKind::Vector {}),
        (plate(1.0, 1.0), FieldKind::NVector { n: 4 }),
        (plate(1.0, 0.02), FieldKind::NVector { n: 1 }),
        (plate(1.0, 0.3), FieldKind::Tensor {}),
    ];
    for (mesh, kind) in cases {
        let p = problem(FieldSurface::new(mesh).unwrap(), kind, 120);
        for (harmonic, biharmonic) in
            [(1.0, 0.05), (1.0, 1.0), (1.0, 30.0), (1.0, 1000.0), (1.0, 1e5), (0.0, 1.0), (1.0, 0.0)]
        {
            let weighted = p.model.weighted(EnergyWeights { harmonic, biharmonic }, None).unwrap();
            let constraints = spread(p.surface.faces(), 5, |_| Hold::Exact);
            let (design, found) = p.least(&weighted, &constraints);
            let by_steps = found.is_none();
            let found = found.unwrap_or_else(|| {
                p.factored.refine(&weighted, &p.basis, &constraints, &design, 1e-10, &Unwatched).unwrap()
            });
            let worst = found.residuals.iter().fold(0.0f64, |most, missed| most.max(*missed));
            let energy = |a: f64, b: f64| harmonic * a + biharmonic * b;
            let (least, reduced) = (
                energy(found.harmonic_energy, found.biharmonic_energy),
                energy(design.harmonic_energy, design.biharmonic_energy),
            );
            println!(
                "{kind:?} {harmonic}:{biharmonic} steps {by_steps} missed {worst:.1e} energy {least:.6} of {reduced:.6}"
            );
            assert!(worst < 1e-7, "{kind:?} {harmonic}:{biharmonic}: {worst:e}");
            assert!(least <= reduced * (1.0 + 1e-6), "{kind:?} {harmonic}:{biharmonic}: {least} {reduced}");
        }
    }
}

#[test]
fn a_lone_stroke_misses_its_share_on_the_whole_surface_and_no_basis_changes_the_field() {
    for kind in KINDS {
        let surface = FieldSurface::new(generate(Shape::Torus, 500).unwrap()).unwrap();
        let [small, large] = [60, 240].map(|dimension| problem(surface.clone(), kind, dimension));
        for (face, strength) in [(3, 1.0), (400, 0.1)] {
            let value = [0.6, 0.8, 0.3];
            let constraints = [Constraint { face, value, hold: Hold::Strength(strength) }];
            let of = |p: &Problem| {
                let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
                p.least(&weighted, &constraints).1.unwrap()
            };
            let (a, b) = (of(&small), of(&large));
            assert!(small.off(&a.field, &b.field) < 1e-8, "{kind:?}: {}", small.off(&a.field, &b.field));
            if small.factored.idle() == 0 {
                let length = value[..kind.block()].iter().map(|v| v * v).sum::<f64>().sqrt();
                let missed = a.residuals[0] / length * (1.0 + 100.0 * strength);
                assert!((missed - 1.0).abs() < 1e-4, "{kind:?}: {missed}");
            }
        }
    }
}

#[test]
fn alignments_that_do_not_outweigh_the_energies_are_met_by_factors_and_others_are_left_to_steps() {
    let surface = FieldSurface::new(generate(Shape::Torus, 400).unwrap()).unwrap();
    let p = problem(surface, FieldKind::NVector { n: 4 }, 120);
    let faces = p.surface.faces();
    let target: Vec<f64> = (0..2 * faces).map(|i| (i as f64 * 0.37).sin()).collect();
    let shares: Vec<f64> = (0..faces).map(|f| 0.5 + (f as f64 * 0.11).cos() * 0.5).collect();
    for (weight, per_face, direct) in [(2.0, None, true), (50.0, None, false), (2.0, Some(shares.as_slice()), false)] {
        let areas = p.surface.frames().areas();
        let alignment = Arc::new(p.model.alignment(&p.basis, areas, &target, per_face).unwrap());
        let weighted = p.model.weighted(EnergyWeights::default(), Some((alignment, weight))).unwrap();
        for constraints in [Vec::new(), spread(faces, 3, |_| Hold::Exact)] {
            let (design, found) = p.least(&weighted, &constraints);
            assert_eq!(found.is_some(), direct, "{weight}");
            let by_steps = |full: &FullSpace| {
                full.refine(&weighted, &p.basis, &constraints, &design, 1e-10, &Unwatched).unwrap().field
            };
            let cycled = by_steps(&p.cycled);
            for field in [found.map(|found| found.field), Some(by_steps(&p.factored))].into_iter().flatten() {
                assert!(p.off(&field, &cycled) < 1e-7, "{weight}: {}", p.off(&field, &cycled));
            }
        }
    }
}

/// One stroke fixes two of the four numbers of fields without energy on two plates. The least field that meets it is
/// zero on the other plate.
#[test]
fn fields_without_energy_that_no_constraint_holds_are_as_small_as_possible_by_factors_too() {
    let plates = [260, 300].map(|vertices| generate(Shape::Rectangle, vertices).unwrap());
    let first = plates[0].faces.len();
    let p = problem(FieldSurface::new(union(&plates)).unwrap(), FieldKind::NVector { n: 4 }, 120);
    let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
    for face in [17, first as u32 + 40] {
        let constraints = [Constraint { face, value: [0.6, -1.1, 0.0], hold: Hold::Strength(1.0) }];
        let found = p.least(&weighted, &constraints).1.unwrap();
        assert_eq!(p.factored.idle(), 4);
        for (at, u) in found.field.as_chunks::<2>().0.iter().enumerate() {
            let wanted = if (at < first) == ((face as usize) < first) { 0.6f64.hypot(1.1) } else { 0.0 };
            assert!((u[0].hypot(u[1]) - wanted).abs() < 1e-6, "stroke on face {face}, face {at}: {u:?}");
        }
    }
}

#[test]
fn designs_on_a_real_surface_with_fingers_are_those_of_cycles_where_the_space_is_far_off() {
    let Some(surface) = real_meshes::surface("homer-remeshed-4531.off") else { return };
    let p = problem(surface, FieldKind::NVector { n: 4 }, 1000);
    let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
    let constraints = spread(p.surface.faces(), 5, |_| Hold::Exact);
    let (design, found) = p.least(&weighted, &constraints);
    let found = found.unwrap();
    let cycled = p.cycled.refine(&weighted, &p.basis, &constraints, &design, 1e-9, &Unwatched).unwrap();
    println!("homer: reduced off by {:.3}, nearest by {:.3}", cycled.distance, found.distance);
    assert!(p.off(&found.field, &cycled.field) < 1e-7, "{}", p.off(&found.field, &cycled.field));
}

#[test]
fn the_field_alone_is_the_same_field() {
    let surface = FieldSurface::new(generate(Shape::Torus, 400).unwrap()).unwrap();
    for kind in KINDS {
        let p = problem(surface.clone(), kind, 60);
        let weighted = p.model.weighted(EnergyWeights::default(), None).unwrap();
        let constraints = spread(p.surface.faces(), 5, |_| Hold::Exact);
        let whole = p.least(&weighted, &constraints).1.unwrap();
        let alone = p.factored.least_field(&weighted, &p.basis, &constraints, &Unwatched).unwrap().unwrap();
        assert!(alone.field == whole.field && alone.residuals == whole.residuals);
        assert_eq!((alone.harmonic_energy, alone.biharmonic_energy), (whole.harmonic_energy, whole.biharmonic_energy));
        assert!(alone.coefficients.is_empty() && alone.distance.is_nan() && whole.distance > 0.0);
        // Without coefficients the space refuses what it refuses with them.
        let brief = p.model.weighted(EnergyWeights::default(), None).unwrap();
        let twice = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|value| Constraint { face: 3, value, hold: Hold::Exact });
        let [with, without] =
            [WeightedModel::solve, WeightedModel::solve_briefly].map(|solve| solve(&brief, &p.basis, &twice));
        assert!(with.is_err() && without == with, "{kind:?}");
    }
}

#[test]
fn factors_take_no_more_room_than_there_is_and_are_the_same_whatever_is_kept() {
    let surface = FieldSurface::new(generate(Shape::Torus, 2000).unwrap()).unwrap();
    let kind = FieldKind::NVector { n: 4 };
    let p = problem(surface, kind, 60);
    let (two, boundary) = (p.factored.bytes_of_factors(), FieldBoundary::default());
    let within = |room: u64| FullSpace::within(&p.surface, kind, boundary, room, &Unwatched).unwrap();
    // What is expected before anything is known of a surface is at least what this one takes.
    let expected = (0..300).map(|k| two * (100 + k) / 100).find(|&room| within(room).is_factored());
    let expected = expected.expect("at most four times what factors take");
    assert!(most_factored_faces(kind, expected) >= p.surface.faces());
    assert!(!within(two - 1).is_factored() && !within(0).is_factored());
    let narrow = within(expected);
    assert!(narrow.bytes() <= p.factored.bytes());
    let constraints = spread(p.surface.faces(), 5, |_| Hold::Exact);
    // More choices of weights than there is room for, one after another and back.
    for biharmonic in [0.05, 0.01, 0.2, 0.05] {
        let weighted = p.model.weighted(EnergyWeights { harmonic: 1.0, biharmonic }, None).unwrap();
        let own = narrow.least_field(&weighted, &p.basis, &constraints, &Unwatched).unwrap().unwrap();
        assert!(own.field == p.least(&weighted, &constraints).1.unwrap().field);
    }
}

#[test]
fn what_is_expected_of_factors_is_the_least_that_scans_take() {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else { return };
    let mut shares = Vec::new();
    for name in ["bumpy-cube.obj", "armadillo.obj", "igea.ply"] {
        let bytes = std::fs::read(std::path::Path::new(&folder).join(name)).unwrap();
        let format = chladni_mesh::read::MeshFormat::from_extension(name.rsplit('.').next().unwrap()).unwrap();
        let raw = chladni_mesh::read::read(&bytes, format, &Default::default()).unwrap();
        let mesh = chladni_mesh::check::check(raw, &Default::default()).unwrap().mesh;
        let surface = FieldSurface::new(mesh).unwrap();
        for kind in [FieldKind::NVector { n: 4 }, FieldKind::Tensor {}, FieldKind::Vector {}] {
            if kind != (FieldKind::NVector { n: 4 }) && surface.faces() > 100_000 {
                continue;
            }
            let full = FullSpace::within(&surface, kind, FieldBoundary::default(), u64::MAX, &Unwatched).unwrap();
            let beside = full.bytes_beside_factors();
            let (two, making) = (full.bytes_of_factors() + beside, full.bytes_of_making());
            let share = two as f64 / expected_bytes(kind, surface.faces());
            println!(
                "{name} {kind:?}: {} faces, {two} bytes, {beside} of them beside, {making} more, {:.1e} operations; {share}",
                surface.faces(),
                full.operations_of_making()
            );
            shares.push(share);
        }
    }
    assert!(shares.iter().all(|share| (0.9..2.5).contains(share)), "{shares:?}");
}
