use std::sync::Arc;

use chladni_algebra::{DenseMatrix, solve_definite};
use chladni_base::{Unwatched, Vector3};
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::field::{
    FieldParameters, FieldSurface, Prescribed, PrescribedField, field_basis, full_biharmonic, singularities,
};
use crate::operator::frames::{complex, parts};
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;

struct Setup {
    surface: FieldSurface,
    basis: FieldBasis,
    model: DesignModel,
}

fn set_up(shape: Shape, vertices: usize, field: FieldKind, dimension: usize) -> Setup {
    let surface = FieldSurface::new(generate(shape, vertices).unwrap()).unwrap();
    let basis = field_basis(&surface, &FieldParameters::new(field, dimension), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    Setup { surface, basis, model }
}

const HARMONIC: EnergyWeights = EnergyWeights { harmonic: 1.0, biharmonic: 0.0 };
const MIXED: EnergyWeights = EnergyWeights { harmonic: 1.0, biharmonic: 0.01 };

fn soft(face: u32, x: f64, y: f64, weight: f64) -> Constraint {
    Constraint { face, value: [x, y, 0.0], hold: Hold::Weight(weight) }
}

fn hard(face: u32, x: f64, y: f64) -> Constraint {
    Constraint { face, value: [x, y, 0.0], hold: Hold::Exact }
}

/// The dense system of the same problem, assembled and solved directly.
fn directly(r: &Setup, weights: EnergyWeights, constraints: &[Constraint]) -> Vec<f64> {
    let d = r.model.dimension();
    let (s, m) = (r.basis.stiffness.to_dense(), r.basis.mass.to_dense());
    let mut inverse = s.clone();
    solve_definite(m, &mut inverse).unwrap();
    let biharmonic = s.times(&inverse);
    let mut matrix = DenseMatrix::zeros(d, d);
    for j in 0..d {
        for i in 0..d {
            matrix.column_mut(j)[i] = weights.harmonic * s.column(j)[i] + weights.biharmonic * biharmonic.column(j)[i];
        }
    }
    let mut rhs = DenseMatrix::zeros(d, 1);
    for c in constraints {
        let mut rows: Vec<(usize, [f64; 2])> = Vec::new();
        r.basis.space.row_entries(c.face as usize, |column, u| rows.push((column, [u[0], u[1]])));
        let Hold::Weight(w) = c.hold else { unreachable!() };
        for &(i, u) in &rows {
            rhs.column_mut(0)[i] += w * (u[0] * c.value[0] + u[1] * c.value[1]);
            for &(j, v) in &rows {
                matrix.column_mut(i)[j] += w * (u[0] * v[0] + u[1] * v[1]);
            }
        }
    }
    solve_definite(matrix, &mut rhs).unwrap();
    rhs.column(0).to_vec()
}

#[test]
fn soft_constraints_give_what_the_assembled_system_gives() {
    let r = set_up(Shape::Sphere, 642, FieldKind::Vector {}, 80);
    let constraints = [soft(5, 1.0, 0.0, 100.0), soft(400, 0.0, 2.0, 1.0), soft(5, 0.0, 1.0, 3.0)];
    for weights in [HARMONIC, MIXED, EnergyWeights { harmonic: 0.0, biharmonic: 1.0 }] {
        let design = r.model.weighted(weights, None).unwrap().solve(&r.basis, &constraints).unwrap();
        let expected = directly(&r, weights, &constraints);
        let scale = expected.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let worst =
            design.coefficients.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-4 * scale, "{worst} of {scale}");
        // Energies are those of the coefficients.
        let image = r.basis.stiffness.multiply(&expected);
        let energy: f64 = image.iter().zip(&expected).map(|(a, b)| a * b).sum();
        assert!((design.harmonic_energy / energy - 1.0).abs() < 1e-3);
    }
}

#[test]
fn hard_constraints_are_met_and_are_the_limit_of_soft_ones() {
    for field in [FieldKind::Vector {}, FieldKind::NVector { n: 4 }] {
        let r = set_up(Shape::Sphere, 642, field, 120);
        let faces = [3u32, 200, 611, 900];
        let constraints: Vec<Constraint> = faces.iter().map(|&f| hard(f, 0.6, -0.8)).collect();
        let model = r.model.weighted(MIXED, None).unwrap();
        let design = model.solve(&r.basis, &constraints).unwrap();
        assert!(design.residuals.iter().all(|x| *x < 1e-5), "{:?}", design.residuals);
        let lifted = r.basis.space.lift(&design.coefficients).unwrap();
        for &f in &faces {
            assert!((lifted[2 * f as usize] - 0.6).abs() < 1e-4 && (lifted[2 * f as usize + 1] + 0.8).abs() < 1e-4);
        }
        let strong: Vec<Constraint> = faces.iter().map(|&f| soft(f, 0.6, -0.8, 1e8)).collect();
        let limit = model.solve(&r.basis, &strong).unwrap();
        let scale = limit.coefficients.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        assert!(design.coefficients.iter().zip(&limit.coefficients).all(|(a, b)| (a - b).abs() < 1e-3 * scale));
    }
}

/// Strokes over many faces: as many numbers as the space has, or more.
fn strokes(r: &Setup, count: usize, turn: f64, hold: Hold) -> Vec<Constraint> {
    let faces = r.surface.faces();
    (0..count)
        .map(|k| {
            let angle = turn + 0.01 * k as f64;
            Constraint { face: ((37 * k) % faces) as u32, value: [angle.cos(), angle.sin(), 0.0], hold }
        })
        .collect()
}

fn distance(a: &Design, b: &[f64]) -> f64 {
    let scale = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    a.coefficients.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max) / scale
}

#[test]
fn many_constraints_give_what_the_assembled_system_gives_whatever_was_asked_before() {
    let r = set_up(Shape::Sphere, 642, FieldKind::Vector {}, 120);
    for weights in [HARMONIC, MIXED] {
        let model = r.model.weighted(weights, None).unwrap();
        let mut constraints = strokes(&r, 150, 0.3, Hold::Weight(20.0));
        // A stroke is drawn, dragged over other faces, turned, made firmer, and mostly taken away.
        for frame in 0..8 {
            match frame {
                1..=3 => (140..150).for_each(|k| constraints[k].face = (700 + 13 * k + 31 * frame) as u32 % 1280),
                4 => constraints.iter_mut().for_each(|c| c.value = [-c.value[1], c.value[0], 0.0]),
                5 => constraints.iter_mut().for_each(|c| c.hold = Hold::Weight(50.0)),
                6 => constraints.truncate(70),
                7 => constraints.push(soft(constraints[3].face, 1.0, 1.0, 5.0)),
                _ => {}
            }
            let design = model.solve(&r.basis, &constraints).unwrap();
            let off = distance(&design, &directly(&r, weights, &constraints));
            assert!(off < 1e-5, "frame {frame}: {off}");
            let residual = |k: usize| {
                let lifted = r.basis.space.lift(&design.coefficients).unwrap();
                let face = constraints[k].face as usize;
                let own = [lifted[2 * face], lifted[2 * face + 1]].map(f64::from);
                ((own[0] - constraints[k].value[0]).powi(2) + (own[1] - constraints[k].value[1]).powi(2)).sqrt()
            };
            assert!([0, 20, 60].iter().all(|&k| (residual(k) - design.residuals[k]).abs() < 1e-4), "frame {frame}");
        }
    }
}

/// Strengths depend on what all constrained faces yield on average, which changes with every face that moves.
#[test]
fn strokes_of_a_strength_that_stay_are_factored_once_while_another_is_dragged() {
    let r = set_up(Shape::Sphere, 1500, FieldKind::NVector { n: 4 }, 300);
    let model = r.model.weighted(MIXED, None).unwrap();
    let mut constraints = strokes(&r, 200, 0.3, Hold::Strength(1.0));
    let mut factors = Vec::new();
    for frame in 0..8 {
        // Faces that no other stroke is on.
        let beside = (1003..).filter(|face| constraints[6..].iter().all(|c| c.face != *face));
        let faces: Vec<u32> = beside.skip(5 * frame).take(6).collect();
        constraints.iter_mut().zip(faces).for_each(|(c, face)| c.face = face);
        model.solve(&r.basis, &constraints).unwrap();
        factors.push(model.last_factor_of_many());
    }
    assert!(factors[1].0 >= 185 && factors[2..].iter().all(|factor| *factor == factors[1]), "{factors:?}");
}

#[test]
fn what_is_dragged_among_few_columns_gives_what_the_assembled_system_gives() {
    let r = set_up(Shape::Sphere, 1500, FieldKind::NVector { n: 4 }, 600);
    let model = r.model.weighted(MIXED, None).unwrap();
    let mut constraints = strokes(&r, 300, 0.3, Hold::Weight(20.0));
    for frame in 0..6 {
        // Three faces next to each other, which come back to where they were.
        (0..3).for_each(|k| constraints[k].face = (1000 + 2 * k + 4 * (frame % 3)) as u32);
        let design = model.solve(&r.basis, &constraints).unwrap();
        let off = distance(&design, &directly(&r, MIXED, &constraints));
        assert!(off < 1e-5, "frame {frame}: {off}");
    }
    // Beside one that is met exactly.
    for frame in 0..3 {
        constraints[0] = hard(1000 + frame, 0.6, -0.8);
        let design = model.solve(&r.basis, &constraints).unwrap();
        assert!(design.residuals[0] < 1e-5, "{}", design.residuals[0]);
        let mut firm = constraints.clone();
        firm[0].hold = Hold::Weight(1e7);
        let off = distance(&design, &directly(&r, MIXED, &firm));
        assert!(off < 1e-3, "frame {frame}: {off}");
    }
}

#[test]
fn few_and_many_constraints_are_held_by_the_same_strengths_and_hard_ones_exactly() {
    let r = set_up(Shape::Torus, 600, FieldKind::NVector { n: 2 }, 150);
    let model = r.model.weighted(MIXED, None).unwrap();
    // Eighteen constraints are few, nineteen many: the nineteenth hardly pulls.
    let mut constraints = strokes(&r, 17, 0.0, Hold::Strength(1.0));
    constraints.push(hard(500, 0.6, -0.8));
    let few = model.solve(&r.basis, &constraints).unwrap();
    for k in 0..4 {
        constraints.push(Constraint { face: 900 + k, value: [1.0, 0.0, 0.0], hold: Hold::Strength(1e-9) });
    }
    let many = model.solve(&r.basis, &constraints).unwrap();
    let expected: Vec<f64> = few.coefficients.iter().map(|&x| f64::from(x)).collect();
    assert!(distance(&many, &expected) < 1e-4, "{}", distance(&many, &expected));
    assert!(many.residuals[17] < 1e-5, "{}", many.residuals[17]);
    assert!((many.harmonic_energy / few.harmonic_energy - 1.0).abs() < 1e-3);
}

#[test]
fn many_constraints_on_a_flat_sheet_leave_a_parallel_field_as_it_is() {
    let r = set_up(Shape::Rectangle, 500, FieldKind::NVector { n: 1 }, 60);
    let faces = r.surface.faces();
    let direction = |face: usize| {
        let own = r.surface.frames().from_world(face, Vector3::new(0.6, 0.8, 0.0));
        [own.re, own.im, 0.0]
    };
    for hold in [Hold::Exact, Hold::Weight(10.0), Hold::Strength(1.0)] {
        let model = r.model.weighted(MIXED, None).unwrap();
        for shift in [0, 5, 11] {
            let constraints: Vec<Constraint> = (0..12)
                .map(|k| (k * faces / 12 + shift) % faces)
                .map(|face| Constraint { face: face as u32, value: direction(face), hold })
                .collect();
            let design = model.solve(&r.basis, &constraints).unwrap();
            let lifted = r.basis.space.lift(&design.coefficients).unwrap();
            for face in 0..faces {
                let expected = direction(face);
                let off = (0..2).map(|i| (f64::from(lifted[2 * face + i]) - expected[i]).abs()).fold(0.0, f64::max);
                assert!(off < 2e-3, "{hold:?}, face {face}: {off}");
            }
        }
    }
}

#[test]
fn a_designed_field_has_less_energy_than_others_that_meet_the_constraints() {
    let r = set_up(Shape::Torus, 600, FieldKind::NVector { n: 2 }, 100);
    let constraints = [hard(10, 1.0, 0.0), hard(500, 0.0, 1.0)];
    let first = r.model.weighted(HARMONIC, None).unwrap().solve(&r.basis, &constraints).unwrap();
    let other =
        r.model.weighted(EnergyWeights { harmonic: 0.0, biharmonic: 1.0 }, None).unwrap().solve(&r.basis, &constraints);
    let other = other.unwrap();
    assert!(first.harmonic_energy <= other.harmonic_energy * (1.0 + 1e-9));
    assert!(other.biharmonic_energy <= first.biharmonic_energy * (1.0 + 1e-9));
}

#[test]
fn alignment_pulls_towards_the_field_and_weights_per_face_say_where() {
    let r = set_up(Shape::Sphere, 642, FieldKind::Vector {}, 200);
    let areas = r.surface.frames().areas();
    let target: Vec<f64> = (0..r.surface.faces())
        .flat_map(|f| {
            let c = r.surface.mesh().positions[r.surface.mesh().faces[f][0] as usize];
            parts(r.surface.frames().from_world(f, Vector3::new(-c[1], c[0], 0.0)))
        })
        .collect();
    let ones = vec![1.0; r.surface.faces()];
    let plain = Arc::new(r.model.alignment(&r.basis, areas, &target, None).unwrap());
    let same = Arc::new(r.model.alignment(&r.basis, areas, &target, Some(&ones)).unwrap());
    let mut last = f64::INFINITY;
    for weight in [1.0, 100.0, 10_000.0] {
        let a = r.model.weighted(HARMONIC, Some((plain.clone(), weight))).unwrap().solve(&r.basis, &[]).unwrap();
        let b = r.model.weighted(HARMONIC, Some((same.clone(), weight))).unwrap().solve(&r.basis, &[]).unwrap();
        assert!(a.ritz.iter().zip(&b.ritz).all(|(x, y)| (x - y).abs() < 1e-4), "uniform weights change nothing");
        let misfit = a.alignment_energy.unwrap();
        assert!(misfit < last);
        last = misfit;
    }
    assert!(last < 0.01, "{last}");
    let half: Vec<f64> = target.chunks_exact(2).enumerate().map(|(f, _)| if f % 2 == 0 { 1.0 } else { 0.0 }).collect();
    let some = Arc::new(r.model.alignment(&r.basis, areas, &target, Some(&half)).unwrap());
    let model = r.model.weighted(HARMONIC, Some((some.clone(), 10.0))).unwrap();
    assert!(model.solve(&r.basis, &[hard(3, 1.0, 0.0)]).unwrap().residuals[0] < 1e-5);
}

#[test]
fn a_slider_goes_on_with_the_factor_and_gives_what_a_factor_of_its_own_gives() {
    let r = set_up(Shape::Torus, 700, FieldKind::NVector { n: 4 }, 160);
    let areas = r.surface.frames().areas();
    let faces = r.surface.faces();
    let target: Vec<f64> = (0..2 * faces).map(|i| (i as f64 * 0.37).sin()).collect();
    let per_face: Vec<f64> = (0..faces).map(|f| 0.5 + 0.5 * (f as f64 * 0.11).cos()).collect();
    let new = || Arc::new(r.model.alignment(&r.basis, areas, &target, Some(&per_face)).unwrap());
    let constraints = [soft(3, 1.0, 0.0, 5.0), hard(300, 0.0, 1.0)];
    let kept = new();
    let energies = |harmonic: f64| EnergyWeights { harmonic, biharmonic: 0.05 * harmonic };
    let first = r.model.weighted(energies(1.0), Some((kept.clone(), 2.0))).unwrap();
    let mut now = first;
    for (harmonic, weight) in [(1.0, 2.0), (3.0, 6.0), (1.0, 1.1), (0.4, 2.2), (1.0, 5.5), (1.0, 50.0), (1e-3, 0.06)] {
        let next = r.model.weighted(energies(harmonic), Some((kept.clone(), weight))).unwrap();
        let own = r.model.weighted(energies(harmonic), Some((new(), weight))).unwrap();
        assert_eq!(next.shares_its_factor(&now), weight != 50.0, "{harmonic} {weight}");
        for constraints in [&constraints[..], &[]] {
            let (a, b) = (next.solve(&r.basis, constraints).unwrap(), own.solve(&r.basis, constraints).unwrap());
            let largest = b.ritz.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            let apart = a.ritz.iter().zip(&b.ritz).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-6 * largest, "{harmonic} {weight}: {apart} of {largest}");
            let near = |x: f64, y: f64| (x - y).abs() < 1e-6 * y.abs();
            assert!(near(a.harmonic_energy, b.harmonic_energy) && near(a.biharmonic_energy, b.biharmonic_energy));
        }
        now = next;
    }
}

#[test]
fn what_cannot_be_designed_is_named() {
    let r = set_up(Shape::Sphere, 162, FieldKind::Vector {}, 20);
    let solve = |constraints: &[Constraint]| r.model.weighted(HARMONIC, None).unwrap().solve(&r.basis, constraints);
    assert_eq!(solve(&[]), Err(DesignError::NoData));
    let faces = r.surface.faces();
    assert_eq!(
        solve(&[soft(1, 1.0, 0.0, 1.0), hard(9999, 1.0, 0.0)]),
        Err(DesignError::Face { constraint: 1, face: 9999, faces })
    );
    assert_eq!(solve(&[hard(4, 0.0, 0.0)]), Err(DesignError::Direction { constraint: 0, face: 4 }));
    assert_eq!(solve(&[hard(4, f64::NAN, 0.0)]), Err(DesignError::Direction { constraint: 0, face: 4 }));
    assert_eq!(
        solve(&[hard(7, 1.0, 0.0), hard(8, 1.0, 0.0), hard(7, 0.0, 1.0)]),
        Err(DesignError::Contradiction { face: 7 })
    );
    assert!(solve(&[hard(7, 1.0, 0.0), hard(7, 1.0, 0.0)]).unwrap().residuals.iter().all(|x| *x < 1e-5));
    assert!(matches!(solve(&[soft(7, 1.0, 0.0, -1.0)]), Err(DesignError::Weight { name: "constraint", .. })));
    let many: Vec<Constraint> = (0..60).map(|f| hard(f, f64::from(f).sin(), 1.0)).collect();
    // More than the space has dimensions: an error, or a fit that says how far off it is.
    match solve(&many) {
        Err(error) => assert!(matches!(error, DesignError::Dependent { .. }), "{error}"),
        Ok(design) => assert!(design.residuals.iter().any(|x| *x > 1e-3)),
    }
    let none = EnergyWeights { harmonic: 0.0, biharmonic: 0.0 };
    assert!(matches!(r.model.weighted(none, None), Err(DesignError::NoEnergy)));
    let negative = EnergyWeights { harmonic: -1.0, biharmonic: 0.0 };
    assert!(matches!(r.model.weighted(negative, None), Err(DesignError::Weight { name: "harmonic", .. })));
    assert!(r.model.alignment(&r.basis, r.surface.frames().areas(), &[0.0], None).is_err());
}

#[test]
fn fields_without_energy_are_free() {
    // Parallel fields on a flat sheet have no transport energy: two kernel dimensions.
    let r = set_up(Shape::Rectangle, 400, FieldKind::NVector { n: 1 }, 60);
    let f = 100usize;
    let along = r.surface.frames().from_world(f, Vector3::AXES[0]);
    let design =
        r.model.weighted(HARMONIC, None).unwrap().solve(&r.basis, &[hard(f as u32, along.re, along.im)]).unwrap();
    let lifted = r.basis.space.lift(&design.coefficients).unwrap();
    let mean: f64 = (0..r.surface.faces())
        .map(|g| {
            let own = complex([lifted[2 * g], lifted[2 * g + 1]].map(f64::from));
            let v = r.surface.frames().to_world(g, own);
            v[0] / r.surface.faces() as f64
        })
        .sum();
    assert!((mean - 1.0).abs() < 0.05, "{mean}");
}

#[test]
fn sparse_factors_give_what_ritz_coordinates_give() {
    let r = set_up(Shape::Torus, 800, FieldKind::Vector {}, 150);
    let sparse = DesignModel::sparse(&r.basis);
    assert!(sparse.values().is_empty() && sparse.dimension() == 152);
    let constraints = [hard(10, 1.0, 0.0), soft(500, 0.0, 1.0, 50.0), hard(900, 0.3, 0.2)];
    let target = vec![0.25; 2 * r.surface.faces()];
    let areas = r.surface.frames().areas();
    for weights in [HARMONIC, MIXED, EnergyWeights { harmonic: 0.0, biharmonic: 1.0 }] {
        for amount in [0.0, 3.0] {
            let solve = |model: &DesignModel| {
                let alignment = model.alignment(&r.basis, areas, &target, None).unwrap();
                model
                    .weighted(weights, Some((Arc::new(alignment), amount)))
                    .unwrap()
                    .solve(&r.basis, &constraints)
                    .unwrap()
            };
            let (expected, design) = (solve(&r.model), solve(&sparse));
            let largest = expected.coefficients.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            let pairs = expected.coefficients.iter().zip(&design.coefficients);
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-3 * largest, "{weights:?} {amount}: {worst} of {largest}");
            assert!((design.harmonic_energy / expected.harmonic_energy - 1.0).abs() < 1e-3);
            assert!((design.biharmonic_energy / expected.biharmonic_energy - 1.0).abs() < 1e-3);
            assert!(design.residuals[0] < 1e-4 && design.residuals[2] < 1e-4, "{:?}", design.residuals);
        }
    }
}

#[test]
fn the_full_biharmonic_energy_is_larger_and_pulls_designs_away() {
    let r = set_up(Shape::Sphere, 1500, FieldKind::NVector { n: 4 }, 200);
    let energy = full_biharmonic(&r.surface, &r.basis, FieldBoundary::Tangential, &Unwatched).unwrap();
    let full = r.model.clone().with_biharmonic(&r.basis, energy).unwrap();
    let constraints: Vec<Constraint> = (0..10).map(|i| hard(250 * i, f64::from(i).cos(), f64::from(i).sin())).collect();
    let weights = EnergyWeights { harmonic: 0.0, biharmonic: 1.0 };
    let design = full.weighted(weights, None).unwrap().solve(&r.basis, &constraints).unwrap();
    assert!(design.residuals.iter().all(|x| *x < 1e-4), "{:?}", design.residuals);
    // Of the lifted field, assembled on the mesh.
    let operator = FieldOperator::<2>::assemble(
        r.basis.kind,
        r.surface.mesh(),
        r.surface.dual(),
        r.surface.frames(),
        FieldBoundary::Tangential,
    )
    .unwrap();
    let lifted: Vec<f64> = r.basis.space.lift(&design.coefficients).unwrap().iter().map(|&x| f64::from(x)).collect();
    let expected = operator.biharmonic_energy(&lifted).unwrap();
    assert!((design.biharmonic_energy / expected - 1.0).abs() < 1e-2, "{} {expected}", design.biharmonic_energy);
    let projected = r.model.weighted(weights, None).unwrap().solve(&r.basis, &constraints).unwrap();
    assert!(projected.biharmonic_energy < design.biharmonic_energy);
    assert!(
        r.model
            .clone()
            .with_biharmonic(&r.basis, SparseMatrix::from_sorted_parts(0, 0, vec![0], vec![], vec![]))
            .is_err()
    );
}

/// The singularities of a design with some prescribed, as they were prescribed.
fn designed(r: &Setup, prescribed: &[Prescribed], constraints: &[Constraint]) -> Vec<Prescribed> {
    let field = PrescribedField::new(&r.surface, r.basis.kind, prescribed, &Unwatched).unwrap();
    let prescription = r.model.prescription(&r.basis, &r.surface, field).unwrap();
    let model = r.model.weighted_with(MIXED, Vec::new(), Some((Arc::new(prescription), 100.0))).unwrap();
    let design = model.solve(&r.basis, constraints).unwrap();
    let lifted = r.basis.space.lift(&design.coefficients).unwrap();
    let found = singularities(&r.surface, r.basis.kind, &lifted).unwrap();
    found.iter().map(|s| Prescribed { vertex: s.vertex, numerator: s.numerator }).collect()
}

#[test]
fn designed_fields_have_their_prescribed_singularities() {
    let at = |vertex, numerator| Prescribed { vertex, numerator };
    let r = set_up(Shape::Sphere, 2562, FieldKind::Vector {}, 200);
    for prescribed in [vec![at(7, 1), at(2000, 1)], vec![at(7, 1), at(900, 1), at(1500, 1), at(2200, -1)]] {
        for constraints in [vec![], vec![soft(100, 1.0, 0.0, 10.0)], vec![hard(3000, 0.2, 0.5)]] {
            let found = designed(&r, &prescribed, &constraints);
            assert!(prescribed.iter().all(|p| found.contains(p)), "{prescribed:?} {found:?}");
        }
    }
    let r = set_up(Shape::Sphere, 2562, FieldKind::NVector { n: 4 }, 200);
    let prescribed: Vec<Prescribed> = (0..8).map(|i| at(310 * i + 11, 1)).collect();
    let found = designed(&r, &prescribed, &[]);
    assert!(prescribed.iter().all(|p| found.contains(p)), "{prescribed:?} {found:?}");
    let r = set_up(Shape::Genus(2), 3000, FieldKind::Vector {}, 200);
    let prescribed = [at(50, -1), at(2500, -1)];
    let found = designed(&r, &prescribed, &[soft(100, 1.0, 0.0, 10.0)]);
    assert!(prescribed.iter().all(|p| found.contains(p)), "{prescribed:?} {found:?}");
}

#[test]
fn the_firm_weight_meets_prescribed_singularities_in_spaces_of_all_dimensions() {
    let at = |vertex, numerator| Prescribed { vertex, numerator };
    for (n, prescribed) in [(1, vec![at(7, 1), at(2000, 1)]), (4, (0..8).map(|i| at(310 * i + 11, 1)).collect())] {
        for dimension in [200, 800] {
            let r = set_up(Shape::Sphere, 2562, FieldKind::NVector { n }, dimension);
            let field = PrescribedField::new(&r.surface, r.basis.kind, &prescribed, &Unwatched).unwrap();
            let prescription = Arc::new(r.model.prescription(&r.basis, &r.surface, field.clone()).unwrap());
            for weights in [EnergyWeights::default(), EnergyWeights { harmonic: 7.0, biharmonic: 0.0 }] {
                let firm = prescription.one_percent_weight(weights);
                let model = r.model.weighted_with(weights, Vec::new(), Some((prescription.clone(), firm))).unwrap();
                let design = model.solve(&r.basis, &[]).unwrap();
                let lifted = r.basis.space.lift(&design.coefficients).unwrap();
                let mut lengths: Vec<f32> = lifted.chunks(2).map(|u| u[0].hypot(u[1])).collect();
                lengths.sort_by(f32::total_cmp);
                let (low, middle) = (lengths[lengths.len() / 20], lengths[lengths.len() / 2]);
                assert!((middle - 1.0).abs() < 0.05 && low > 0.4, "{n} {dimension} {weights:?}: {low} {middle}");
                let found = singularities(&r.surface, r.basis.kind, &lifted).unwrap();
                let found: Vec<_> = found.iter().map(|s| at(s.vertex, s.numerator)).collect();
                assert!(prescribed.iter().all(|p| found.contains(p)), "{n} {dimension}: {found:?}");
            }
            // A space without eigenpairs measures the same; those are kept in single precision.
            let sparse = DesignModel::sparse(&r.basis).prescription(&r.basis, &r.surface, field).unwrap();
            let [a, b] = [&sparse, &*prescription].map(|p| p.one_percent_weight(EnergyWeights::default()));
            assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
        }
    }
}
