//! Surfaces of many components, and strengths that no basis changes.

use std::sync::Arc;

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;

const CROSS: FieldKind = FieldKind::NVector { n: 4 };

fn full(surface: &FieldSurface, kind: FieldKind) -> FullSpace {
    let full = FullSpace::new(surface, kind, FieldBoundary::default(), &Unwatched).unwrap();
    assert!(full.is_factored());
    full
}

fn norm(x: impl Iterator<Item = f64>) -> f64 {
    x.map(|x| x * x).sum::<f64>().sqrt()
}

/// Each plate has its own fields without energy: the parallel ones. With one constraint that is what it is filled with;
/// without any it stays empty.
#[test]
fn each_of_many_plates_is_filled_with_what_its_own_constraint_asks_for() {
    let plates = 90;
    let one = generate(Shape::Rectangle, 20).unwrap();
    let each = one.faces.len();
    let surface = FieldSurface::new(union(&vec![one; plates])).unwrap();
    for (kind, idle) in [(CROSS, 2), (FieldKind::Tensor {}, 3)] {
        let b = kind.block();
        let basis = field_basis(&surface, &FieldParameters::new(kind, 2 * b * plates), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        let full = full(&surface, kind);
        assert_eq!(full.count_idle(&Unwatched), Ok(Some(idle * plates)), "{kind:?}");
        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
        let value = |plate: usize| [(plate as f64).cos(), (0.3 * plate as f64).sin() + 1.5, 0.4];
        let constraint = |plate: usize| Constraint {
            face: (each * plate + 7 * plate % each) as u32,
            value: value(plate),
            hold: if plate.is_multiple_of(2) { Hold::Exact } else { Hold::Strength(1.0) },
        };
        let constraints: Vec<Constraint> = (0..plates).filter(|plate| plate % 3 != 1).map(constraint).collect();
        let design = weighted.solve(&basis, &constraints).unwrap();
        let found = full.least(&weighted, &basis, &constraints, &design, &Unwatched).unwrap().unwrap();
        let steps = full.refine(&weighted, &basis, &constraints, &design, 1e-9, &Unwatched).unwrap();
        for (way, found) in [("factors", found), ("steps", steps)] {
            // Parallel, of the length that is asked for, and as it is asked for on the face.
            let most = found.residuals.iter().fold(0.0f64, |most, missed| most.max(*missed));
            assert!(found.harmonic_energy < 1e-12 && most < 1e-6, "{kind:?}, {way}: {most:e}");
            for (face, own) in found.field.chunks_exact(b).enumerate() {
                let plate = face / each;
                let wanted = if plate % 3 == 1 { 0.0 } else { norm(value(plate).into_iter().take(b)) };
                let own = norm(own.iter().copied());
                assert!((own - wanted).abs() < 1e-6, "{kind:?}, {way}, plate {plate}: {own} and not {wanted}");
            }
        }
    }
}

/// Plates of which the space has the parallel fields alone, beside others of which it has more: on neither takes what
/// is asked for energy.
#[test]
fn plates_with_one_column_and_with_several_are_filled_with_what_is_asked_for_on_each() {
    let plates = 60;
    let one = generate(Shape::Rectangle, 20).unwrap();
    let each = one.faces.len();
    let surface = FieldSurface::new(union(&vec![one; plates])).unwrap();
    for kind in [CROSS, FieldKind::Tensor {}] {
        let b = kind.block();
        // From one group of columns for each plate on.
        for groups in [plates, plates + 1, plates + 15, 2 * plates] {
            let basis = field_basis(&surface, &FieldParameters::new(kind, groups * b), &Unwatched).unwrap();
            let value = |plate: usize| [(plate as f64).cos(), (0.3 * plate as f64).sin() + 1.5, 0.4];
            let constraint = |plate: usize, hold: Hold| {
                let face = (each * plate + 7 * plate % each) as u32;
                Constraint { face, value: value(plate), hold }
            };
            // Few enough that they are not put into the matrix of the energies, and then more.
            for (step, soft) in [(5, false), (5, true), (1, false)] {
                let held = |plate: usize| if soft && plate % 2 == 1 { Hold::Strength(1.0) } else { Hold::Exact };
                let constraints: Vec<Constraint> =
                    (0..plates).step_by(step).map(|plate| constraint(plate, held(plate))).collect();
                for model in [DesignModel::new(&basis, &Unwatched).unwrap(), DesignModel::sparse(&basis)] {
                    let sparse = model.pencil.is_some();
                    // Without Ritz coordinates no more than two dozen fields without energy are told apart from what
                    // yields to strokes.
                    if sparse && soft {
                        continue;
                    }
                    let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
                    let design = weighted.solve(&basis, &constraints).unwrap();
                    let most = design.residuals.iter().fold(0.0f64, |most, missed| most.max(*missed));
                    let said = format!("{kind:?}, {groups} groups, every {step}, soft {soft}, sparse {sparse}");
                    assert!(design.harmonic_energy < 1e-5 && most < 1e-4, "{said}: {} {most}", design.harmonic_energy);
                    let field = basis.space.lift(&design.coefficients).unwrap();
                    for (face, own) in field.chunks_exact(b).enumerate() {
                        let plate = face / each;
                        let wanted =
                            if plate.is_multiple_of(step) { norm(value(plate).into_iter().take(b)) } else { 0.0 };
                        let own = norm(own.iter().map(|&x| f64::from(x)));
                        assert!((own - wanted).abs() < 1e-3, "{said}, plate {plate}: {own} and not {wanted}");
                    }
                }
            }
        }
    }
}

/// What cannot be met is missed, and by so much, where the fault is, and nowhere else.
#[test]
fn two_exact_values_on_a_plate_with_one_column_are_missed_there_and_met_elsewhere() {
    let plates = 40;
    let one = generate(Shape::Rectangle, 20).unwrap();
    let each = one.faces.len() as u32;
    let surface = FieldSurface::new(union(&vec![one; plates])).unwrap();
    let basis = field_basis(&surface, &FieldParameters::new(CROSS, 2 * plates + 10), &Unwatched).unwrap();
    // The samples tell which plates have one group of columns.
    let of = |plate: u32| basis.samples.iter().filter(|&&face| face / each == plate).count();
    let lone = (1..plates as u32).find(|&plate| of(plate) == 1).unwrap();
    let exact = |face: u32, x: f64| Constraint { face, value: [x, 1.0, 0.0], hold: Hold::Exact };
    for model in [DesignModel::new(&basis, &Unwatched).unwrap(), DesignModel::sparse(&basis)] {
        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
        let wanted = [exact(1, 0.3), exact(lone * each + 2, 0.5), exact(lone * each + 9, -0.5)];
        match weighted.solve(&basis, &wanted) {
            Err(refused) => {
                assert!(matches!(refused, DesignError::Dependent { face } if face / each == lone), "{refused:?}");
            }
            Ok(design) => {
                let missed = &design.residuals;
                assert!(missed[0] < 1e-6 && missed[1].max(missed[2]) > 0.4, "{missed:?}");
            }
        }
    }
}

/// Faces that are components of their own have fields without energy alone, on the whole surface too.
#[test]
fn separate_triangles_among_plates_carry_what_they_are_given() {
    let plate = generate(Shape::Rectangle, 60).unwrap();
    let corners = plate.faces[0].map(|v| plate.positions[v as usize]);
    let triangle = TriangleMesh { positions: corners.to_vec(), faces: vec![[0, 1, 2]], ..TriangleMesh::default() };
    let parts: Vec<TriangleMesh> = (0..40).map(|i| if i % 4 == 0 { plate.clone() } else { triangle.clone() }).collect();
    let surface = FieldSurface::new(union(&parts)).unwrap();
    for kind in [CROSS, FieldKind::Tensor {}] {
        let b = kind.block();
        let basis = field_basis(&surface, &FieldParameters::new(kind, 60 * b), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        let full = full(&surface, kind);
        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
        let mut constraints = Vec::new();
        let mut at = 0;
        for (i, part) in parts.iter().enumerate() {
            let value = [(i as f64).cos(), (0.3 * i as f64).sin() + 1.5, 0.4];
            constraints.push(Constraint { face: at, value, hold: Hold::Exact });
            at += part.faces.len() as u32;
        }
        for some in [&constraints[..], &constraints[1..4]] {
            let design = weighted.solve(&basis, some).unwrap();
            let found = full.least(&weighted, &basis, some, &design, &Unwatched).unwrap().unwrap();
            let most = found.residuals.iter().fold(0.0f64, |most, missed| most.max(*missed));
            assert!(found.harmonic_energy < 1e-9 && most < 1e-6, "{kind:?}: {} {most}", found.harmonic_energy);
        }
    }
}

/// Components with and without fields that have no energy, and of different numbers of them.
#[test]
fn components_of_all_kinds_are_designed_as_if_they_were_alone() {
    let parts = [
        generate(Shape::Rectangle, 60).unwrap(),
        generate(Shape::Sphere, 92).unwrap(),
        noisy(&generate(Shape::Torus, 200).unwrap(), 0.2, 1).unwrap(),
        generate(Shape::Disk, 12).unwrap(),
    ];
    for kind in [FieldKind::Vector {}, CROSS, FieldKind::Tensor {}] {
        let together = FieldSurface::new(union(&parts)).unwrap();
        let areas = together.frames().areas();
        let b = kind.block();
        let made = |surface: &FieldSurface, scale: f64, constraints: &[Constraint]| -> Vec<f64> {
            let dimension = (200 * b).min(b * surface.faces());
            let basis = field_basis(surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
            let model = DesignModel::new(&basis, &Unwatched).unwrap();
            // On unit area eigenvalues of a part are those of the whole by its share of the area.
            let weights = EnergyWeights { harmonic: scale, biharmonic: 0.05 * scale * scale };
            let weighted = model.weighted(weights, None).unwrap();
            let design = weighted.solve(&basis, constraints).unwrap();
            full(surface, kind).least(&weighted, &basis, constraints, &design, &Unwatched).unwrap().unwrap().field
        };
        let (mut first, mut all, mut alone) = (0, Vec::new(), Vec::new());
        for part in &parts {
            let surface = FieldSurface::new(part.clone()).unwrap();
            let count = surface.faces();
            let own = |k: usize| Constraint {
                face: (k * count / 3) as u32,
                value: [1.0, (k as f64).sin(), 0.3 * k as f64],
                hold: Hold::Exact,
            };
            let own: Vec<Constraint> = (0..3).map(own).collect();
            let share: f64 = areas[first as usize..first as usize + count].iter().sum();
            alone.extend(made(&surface, 1.0 / share, &own));
            all.extend(own.iter().map(|c| Constraint { face: c.face + first, ..*c }));
            first += count as u32;
        }
        let found = made(&together, 1.0, &all);
        let off = norm(found.iter().zip(&alone).map(|(a, b)| a - b)) / norm(alone.iter().copied());
        assert!(off < 1e-6, "{kind:?}: {off}");
    }
}

/// What a stroke means is measured by the surface, however many there are, and beside alignments of any kind.
#[test]
fn no_basis_changes_what_many_strokes_and_strokes_beside_alignments_ask_for() {
    let surface = FieldSurface::new(generate(Shape::Torus, 400).unwrap()).unwrap();
    let (faces, areas) = (surface.faces(), surface.frames().areas());
    let full = full(&surface, CROSS);
    let target: Vec<f64> = (0..2 * faces).map(|i| (i as f64 * 0.37).sin()).collect();
    let shares: Vec<f64> = (0..faces).map(|f| 0.5 + (f as f64 * 0.11).cos() * 0.5).collect();
    let cases = [(300, None), (3, Some((1000.0, None))), (3, Some((100.0, Some(shares.as_slice()))))];
    for (count, aligned) in cases {
        let stroke = |i: usize| Constraint {
            face: (i * faces / count) as u32,
            value: [(1.3 * i as f64).cos(), (0.7 * i as f64).sin(), 0.0],
            hold: Hold::Strength(1.0),
        };
        let strokes: Vec<Constraint> = (0..count).map(stroke).collect();
        let field = |dimension: usize| {
            let basis = field_basis(&surface, &FieldParameters::new(CROSS, dimension), &Unwatched).unwrap();
            let model = DesignModel::new(&basis, &Unwatched).unwrap();
            let aligned = aligned.map(|(weight, per_face)| {
                (Arc::new(model.alignment(&basis, areas, &target, per_face).unwrap()), weight)
            });
            let weighted = model.weighted(EnergyWeights::default(), aligned).unwrap();
            let design = weighted.solve(&basis, &strokes).unwrap();
            assert!(full.least(&weighted, &basis, &strokes, &design, &Unwatched).unwrap().is_none());
            full.refine(&weighted, &basis, &strokes, &design, 1e-9, &Unwatched).unwrap().field
        };
        let (a, b) = (field(60), field(300));
        let off = norm(a.iter().zip(&b).map(|(a, b)| a - b)) / norm(b.iter().copied());
        assert!(off < 1e-6, "{count} strokes: {off}");
    }
}

/// Beside an alignment to nothing that outweighs the energies.
#[test]
fn a_lone_stroke_beside_a_heavy_alignment_misses_its_share() {
    let surface = FieldSurface::new(generate(Shape::Sphere, 252).unwrap()).unwrap();
    let (faces, areas) = (surface.faces(), surface.frames().areas());
    let basis = field_basis(&surface, &FieldParameters::new(CROSS, 60), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let alignment = Arc::new(model.alignment(&basis, areas, &vec![0.0; 2 * faces], None).unwrap());
    let weighted = model.weighted(EnergyWeights::default(), Some((alignment, 300.0))).unwrap();
    let full = full(&surface, CROSS);
    for strength in [1.0, 0.1] {
        let stroke = [Constraint { face: 17, value: [0.6, 0.8, 0.0], hold: Hold::Strength(strength) }];
        let design = weighted.solve(&basis, &stroke).unwrap();
        let found = full.refine(&weighted, &basis, &stroke, &design, 1e-9, &Unwatched).unwrap();
        let missed = found.residuals[0] * (1.0 + 100.0 * strength);
        assert!((missed - 1.0).abs() < 1e-3, "{strength}: {missed}");
    }
}

#[test]
fn what_factors_take_is_known_before_they_are_made_and_nothing_afterwards() {
    let surface = FieldSurface::new(generate(Shape::Torus, 500).unwrap()).unwrap();
    let basis = field_basis(&surface, &FieldParameters::new(CROSS, 60), &Unwatched).unwrap();
    let weighted = DesignModel::new(&basis, &Unwatched).unwrap().weighted(EnergyWeights::default(), None).unwrap();
    let full = full(&surface, CROSS);
    // At least the square of the mean number of rows below each, at most the cube of all.
    let size = 2.0 * surface.faces() as f64;
    let expected = full.operations_of_making();
    assert!(expected > 10.0 * size && expected < size.powi(3) / 3.0, "{expected}");
    let constraints = [Constraint { face: 3, value: [1.0, 0.0, 0.0], hold: Hold::Exact }];
    full.least_field(&weighted, &basis, &constraints, &Unwatched).unwrap().unwrap();
    assert_eq!(full.operations_of_making(), 0.0);
    let cycled = FullSpace::by_cycles(&surface, CROSS, FieldBoundary::default()).unwrap();
    assert_eq!((cycled.operations_of_making(), cycled.count_idle(&Unwatched)), (0.0, Ok(None)));
}

#[test]
fn many_plates_are_judged_as_exactly_as_one() {
    let one = generate(Shape::Rectangle, 60).unwrap();
    let certificate = |plates: usize, above: bool| {
        let surface = FieldSurface::new(union(&vec![one.clone(); plates])).unwrap();
        let basis = field_basis(&surface, &FieldParameters::new(CROSS, 20 * plates), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        let (full, idle) = (full(&surface, CROSS), 2 * plates);
        let lifted = |k: usize| basis.space.lift(&model.eigenfield(k)).unwrap().into_iter().map(f64::from).collect();
        let goal = EigenfieldGoal::Estimate;
        if !above {
            let start = (0..idle + 5).map(lifted).collect();
            let found = full.eigenfields(start, idle + 2, goal, &Unwatched).unwrap();
            return (found.certificate(model.values(), basis.area), idle);
        }
        assert_eq!(full.count_idle(&Unwatched), Ok(Some(idle)));
        let start = (idle..idle + 5).map(lifted).collect();
        let found = full.eigenfields_above_idle(start, 2, goal, &Unwatched).unwrap();
        (found.certificate_above(model.values(), idle, basis.area), idle)
    };
    for plates in [1, 3] {
        let ((a, idle), (b, _)) = (certificate(plates, false), certificate(plates, true));
        assert_eq!((a.estimates.len(), b.estimates.len(), a.bounds.len(), b.bounds.len()), {
            let all = idle + 2;
            (all, all, all, all)
        });
        assert!(b.estimates[..idle].iter().all(|own| *own < 1e-4), "{:?}", b.estimates);
        for (a, b) in a.estimates[idle..].iter().zip(&b.estimates[idle..]) {
            assert!((a - b).abs() < 1e-3 * a.abs(), "{plates} plates: {a} and {b}");
        }
        assert_eq!(a.accuracy.reached, b.accuracy.reached);
    }
}

/// Needles a billion times as long as wide, among others.
#[test]
fn plates_that_are_graded_beyond_single_precision_have_a_basis() {
    for power in [4, 8, 12] {
        let mut mesh = noisy(&generate(Shape::Rectangle, 500).unwrap(), 0.2, 3).unwrap();
        mesh.positions.iter_mut().for_each(|p| p[0] = (p[0] / 1.6).max(1e-3).powi(power));
        let Ok(surface) = FieldSurface::new(mesh) else { continue };
        for kind in [FieldKind::NVector { n: 1 }, CROSS, FieldKind::Tensor {}] {
            let basis = field_basis(&surface, &FieldParameters::new(kind, 120), &Unwatched).unwrap();
            assert_eq!(basis.space.uncovered(), None);
            assert!(basis.space.values().iter().all(|x| x.is_finite()), "{kind:?}");
            assert!(basis.stiffness.values().iter().chain(basis.mass.values()).all(|x| x.is_finite()), "{kind:?}");
        }
    }
}
