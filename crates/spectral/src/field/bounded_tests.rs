//! Fields without energy that are small where constraints are: they would meet these with any length.

use std::sync::Arc;

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::{
    Constraint, Design, DesignModel, EnergyWeights, FaceComponents, FieldBasis, FieldParameters, FieldSurface,
    FullSpace, Hold,
};
use super::{RefineError, field_basis};
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;

/// How many times the longest value fields without energy may be as long.
const MOST: f64 = 3.0;

/// A plate of unit length with two small holes in one half.
fn plate(steps: usize) -> TriangleMesh {
    let at = |i: usize, j: usize| (i * (steps + 1) + j) as u32;
    let side = |i: usize| i as f64 / steps as f64;
    let positions: Vec<[f64; 3]> =
        (0..=steps).flat_map(|i| (0..=steps).map(move |j| [side(i), side(j), 0.0])).collect();
    let inside = |face: &[u32; 3]| {
        let middle = [0, 1].map(|k| face.iter().map(|&v| positions[v as usize][k]).sum::<f64>() / 3.0);
        [[0.2, 0.3], [0.2, 0.7]].iter().all(|hole| (middle[0] - hole[0]).hypot(middle[1] - hole[1]) > 0.07)
    };
    let squares = (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j)));
    let halves = |(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    let faces: Vec<[u32; 3]> = squares.flat_map(halves).filter(inside).collect();
    let mut named = vec![u32::MAX; positions.len()];
    let mut own = TriangleMesh::default();
    for face in faces {
        own.faces.push(face.map(|v| {
            if named[v as usize] == u32::MAX {
                named[v as usize] = own.positions.len() as u32;
                own.positions.push(positions[v as usize]);
            }
            named[v as usize]
        }));
    }
    own
}

struct Setup {
    surface: FieldSurface,
    basis: FieldBasis,
    model: DesignModel,
    /// A face in the corner that is far from both holes.
    far: u32,
    /// One between them.
    near: u32,
}

fn set_up() -> Setup {
    let surface = FieldSurface::new(plate(30)).unwrap();
    let basis = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, 200), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let middle = |face: usize| {
        [0, 1].map(|k| surface.mesh().faces[face].iter().map(|&v| surface.mesh().positions[v as usize][k]).sum::<f64>())
    };
    let closest = |x: f64, y: f64| {
        let distance = |face: &usize| (middle(*face)[0] / 3.0 - x).hypot(middle(*face)[1] / 3.0 - y);
        (0..surface.faces()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap() as u32
    };
    let (far, near) = (closest(0.95, 0.97), closest(0.2, 0.5));
    Setup { surface, basis, model, far, near }
}

fn stroke(face: u32, value: [f64; 2], hold: Hold) -> Constraint {
    Constraint { face, value: [value[0], value[1], 0.0], hold }
}

/// The numbers of a constraint in Ritz coordinates.
fn rows(s: &Setup, face: u32) -> [Vec<f64>; 2] {
    let d = s.model.dimension();
    let mut rows = [vec![0.0; d], vec![0.0; d]];
    s.basis.space.row_entries(face as usize, |column, u| {
        for (row, u) in rows.iter_mut().zip(u) {
            let ritz = &s.model.ritz().vectors[d * column..d * (column + 1)];
            row.iter_mut().zip(ritz).for_each(|(r, x)| *r += u * f64::from(*x));
        }
    });
    rows
}

fn idle(s: &Setup) -> usize {
    s.model.values().iter().take_while(|value| **value < 1e-6).count()
}

fn length_of_idle(s: &Setup, design: &Design) -> f64 {
    design.ritz[..idle(s)].iter().map(|z| z * z).sum::<f64>().sqrt()
}

#[test]
fn a_stroke_far_from_holes_is_answered_with_the_least_energy_of_all_fields_of_bounded_length() {
    let s = set_up();
    assert_eq!(idle(&s), 2, "one field for each hole");
    let weights = EnergyWeights::default();
    let weighted = s.model.weighted(weights, None).unwrap();
    for (value, weight) in [([1.0, 0.0], 50.0), ([0.6, 0.8], 3000.0), ([-2.0, 5.0], 1e5)] {
        let asked: [f64; 2] = value;
        let design = weighted.solve(&s.basis, &[stroke(s.far, asked, Hold::Weight(weight))]).unwrap();
        let most = MOST * asked[0].hypot(asked[1]);
        assert!((length_of_idle(&s, &design) / most - 1.0).abs() < 1e-6, "{}", length_of_idle(&s, &design));
        // The gradient of energy and deviation is nothing but the pull of the bound, inwards: the problem is convex,
        // so that this is its minimiser.
        let z = &design.ritz;
        let own = rows(&s, s.far);
        let missed = [0, 1].map(|i| own[i].iter().zip(z).map(|(r, z)| r * z).sum::<f64>() - asked[i]);
        let force = |k: usize| weight * (missed[0] * own[0][k] + missed[1] * own[1][k]);
        let largest = (0..z.len()).map(|k| force(k).abs()).fold(0.0, f64::max);
        let pull = -force(0) / z[0];
        assert!(pull > 0.0);
        for k in 0..z.len() {
            let value = if k < 2 { 0.0 } else { s.model.values()[k] };
            let energy = (weights.harmonic * value + weights.biharmonic * value * value) * z[k];
            let rest = energy + force(k) + if k < 2 { pull * z[k] } else { 0.0 };
            assert!(rest.abs() < 1e-6 * largest, "{k}: {rest} of {largest}");
        }
        assert!((design.residuals[0] - missed[0].hypot(missed[1])).abs() < 1e-6);
    }
}

#[test]
fn exact_directions_far_from_holes_are_met_by_fields_of_bounded_length_and_strokes_beside_holes_cost_nothing() {
    let s = set_up();
    let weighted = s.model.weighted(EnergyWeights::default(), None).unwrap();
    let exact = weighted.solve(&s.basis, &[stroke(s.far, [0.6, 0.8], Hold::Exact)]).unwrap();
    assert!(exact.residuals[0] < 1e-5 && (length_of_idle(&s, &exact) - MOST).abs() < 1e-5, "{:?}", exact.residuals);
    let lifted = s.basis.space.lift(&exact.coefficients).unwrap();
    let longest = lifted.chunks(2).map(|u| u[0].hypot(u[1])).fold(0.0, f32::max);
    assert!(longest < 40.0, "{longest}");
    // Where harmonic fields are long there is no need of a bound.
    let near = weighted.solve(&s.basis, &[stroke(s.near, [0.6, 0.8], Hold::Strength(1.0))]).unwrap();
    assert!(near.harmonic_energy < 1e-6 && length_of_idle(&s, &near) < MOST, "{}", near.harmonic_energy);
}

#[test]
fn fields_of_the_whole_surface_have_the_bound_of_those_of_the_space() {
    let s = set_up();
    let full =
        FullSpace::within(&s.surface, FieldKind::Vector {}, FieldBoundary::Tangential, 1 << 30, &Unwatched).unwrap();
    let weighted = s.model.weighted(EnergyWeights::default(), None).unwrap();
    for hold in [Hold::Strength(1.0), Hold::Exact] {
        let constraints = [stroke(s.far, [1.0, 0.3], hold)];
        let design = weighted.solve(&s.basis, &constraints).unwrap();
        let least = full.least(&weighted, &s.basis, &constraints, &design, &Unwatched).unwrap().unwrap();
        let square: f64 = (least.field.chunks(2).zip(s.surface.frames().areas()))
            .map(|(u, area)| area * (u[0] * u[0] + u[1] * u[1]))
            .sum();
        assert!(square.sqrt() < 2.0 * MOST, "{}", square.sqrt());
        assert!(least.harmonic_energy > 0.0 && least.distance < 0.2, "{hold:?} {}", least.distance);
        assert!(least.residuals[0] < if hold == Hold::Exact { 1e-6 } else { 0.05 }, "{:?}", least.residuals);
    }
    // Iterations have no such bound, and say so.
    let cycles = FullSpace::within(&s.surface, FieldKind::Vector {}, FieldBoundary::Tangential, 0, &Unwatched).unwrap();
    let constraints = [stroke(s.far, [1.0, 0.3], Hold::Strength(1.0))];
    let design = weighted.solve(&s.basis, &constraints).unwrap();
    let refused = cycles.refine(&weighted, &s.basis, &constraints, &design, 1e-4, &Unwatched);
    assert!(matches!(refused, Err(RefineError::Unbounded { times }) if times > MOST));
}

#[test]
fn sparse_factors_of_the_space_give_the_same_field() {
    let s = set_up();
    let weights = EnergyWeights::default();
    let sparse = DesignModel::sparse(&s.basis).weighted(weights, None).unwrap();
    let dense = s.model.weighted(weights, None).unwrap();
    for hold in [Hold::Strength(1.0), Hold::Exact] {
        let constraints = [stroke(s.far, [1.0, 0.3], hold), stroke(s.far + 3, [1.0, 0.3], hold)];
        let [a, b] = [&sparse, &dense].map(|model| model.solve(&s.basis, &constraints).unwrap());
        let [a, b] = [a, b].map(|design| s.basis.space.lift(&design.coefficients).unwrap());
        let size = b.iter().map(|x| x * x).sum::<f32>().sqrt();
        let off = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
        assert!(off < 2e-3 * size, "{hold:?} {off} of {size}");
    }
}

/// The field of a design, its numbers times the roots of areas.
fn weighed(s: &Setup, design: &Design) -> Vec<f64> {
    let lifted = s.basis.space.lift(&design.coefficients).unwrap();
    lifted.iter().enumerate().map(|(i, &x)| f64::from(x) * s.surface.frames().areas()[i / 2].sqrt()).collect()
}

fn size(field: &[f64]) -> f64 {
    field.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    size(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>())
}

#[test]
fn beside_an_alignment_fields_without_energy_are_bounded_and_small_weights_tend_to_none() {
    let s = set_up();
    let weights = EnergyWeights::default();
    let areas = s.surface.frames().areas();
    let target = vec![0.0; 2 * s.surface.faces()];
    let everywhere = Arc::new(s.model.alignment(&s.basis, areas, &target, None).unwrap());
    // A corner of the plate, that of the stroke or another one.
    let corner = |x: f64| -> Vec<f64> {
        let middle = |f: &[u32; 3]| f.iter().map(|&v| s.surface.mesh().positions[v as usize][0]).sum::<f64>() / 3.0;
        s.surface.mesh().faces.iter().map(|f| f64::from(u8::from((middle(f) - x).abs() < 0.04))).collect()
    };
    let some = |x: f64| Arc::new(s.model.alignment(&s.basis, areas, &target, Some(&corner(x))).unwrap());
    let most = MOST * 1f64.hypot(0.3);
    for (name, alignment) in [("everywhere", everywhere), ("near", some(1.0)), ("far", some(0.5))] {
        for hold in [Hold::Strength(1.0), Hold::Exact, Hold::Weight(50.0)] {
            let constraints = [stroke(s.far, [1.0, 0.3], hold)];
            let without = s.model.weighted(weights, None).unwrap().solve(&s.basis, &constraints).unwrap();
            for weight in [1e-9, 1e-6, 1e-3, 1.0] {
                let weighted = s.model.weighted(weights, Some((alignment.clone(), weight))).unwrap();
                let design = weighted.solve(&s.basis, &constraints).unwrap();
                let length = length_of_idle(&s, &design);
                assert!(length < 1.0001 * most, "{name} {hold:?} {weight}: {length}");
                assert!(hold != Hold::Exact || design.residuals[0] < 1e-5, "{name} {weight}: {:?}", design.residuals);
                if weight <= 1e-6 {
                    let (own, other) = (weighed(&s, &design), weighed(&s, &without));
                    let off = apart(&own, &other) / size(&other);
                    assert!(off < 2e-3, "{name} {hold:?} {weight}: {off}");
                }
            }
        }
    }
}

/// The gradient of all that is to be small is nothing but the pull of the bound, inwards.
#[test]
fn beside_an_alignment_designs_of_bounded_length_have_the_least_energy_of_all_of_that_length() {
    let s = set_up();
    let (weights, firm) = (EnergyWeights::default(), 50.0);
    let target: Vec<f64> = (0..2 * s.surface.faces()).map(|i| if i % 2 == 0 { 0.2 } else { -0.1 }).collect();
    let alignment = Arc::new(s.model.alignment(&s.basis, s.surface.frames().areas(), &target, None).unwrap());
    for weight in [1e-8, 1e-5, 1e-3] {
        let weighted = s.model.weighted(weights, Some((alignment.clone(), weight))).unwrap();
        let asked = [1.0, 0.3];
        let design = weighted.solve(&s.basis, &[stroke(s.far, asked, Hold::Weight(firm))]).unwrap();
        assert!((length_of_idle(&s, &design) / (MOST * asked[0].hypot(asked[1])) - 1.0).abs() < 1e-6);
        let (z, own) = (&design.ritz, rows(&s, s.far));
        let missed = [0, 1].map(|i| own[i].iter().zip(z).map(|(r, z)| r * z).sum::<f64>() - asked[i]);
        let force = |k: usize| firm * (missed[0] * own[0][k] + missed[1] * own[1][k]);
        let largest = (0..z.len()).map(|k| force(k).abs()).fold(0.0, f64::max);
        let gradient = |k: usize| {
            let value = s.model.values()[k];
            let energy = weights.harmonic * value + weights.biharmonic * value * value;
            energy * z[k] + weight * (z[k] - alignment.projected[k]) + force(k)
        };
        let pull = -gradient(0) / z[0];
        assert!(pull > 0.0);
        for k in 0..z.len() {
            let rest = gradient(k) + if k < 2 { pull * z[k] } else { 0.0 };
            assert!(rest.abs() < 1e-6 * largest, "{weight} {k}: {rest} of {largest}");
        }
    }
}

#[test]
fn spaces_without_ritz_coordinates_have_the_bound_beside_alignments() {
    let s = set_up();
    let weights = EnergyWeights::default();
    let target = vec![0.0; 2 * s.surface.faces()];
    let areas = s.surface.frames().areas();
    let few: Vec<f64> = (0..s.surface.faces()).map(|f| f64::from(u8::from(f % 50 == 0))).collect();
    for per_face in [None, Some(few.as_slice())] {
        for hold in [Hold::Strength(1.0), Hold::Exact] {
            let constraints = [stroke(s.far, [1.0, 0.3], hold)];
            let [a, b] = [DesignModel::sparse(&s.basis), s.model.clone()].map(|model| {
                let alignment = Arc::new(model.alignment(&s.basis, areas, &target, per_face).unwrap());
                let design = model.weighted(weights, Some((alignment, 1e-6))).unwrap();
                weighed(&s, &design.solve(&s.basis, &constraints).unwrap())
            });
            assert!(size(&b) < 8.0 && apart(&a, &b) < 2e-3 * size(&b), "{hold:?} {} {}", apart(&a, &b), size(&b));
        }
    }
}

/// The plate beside a sphere that has twelve times its area.
fn beside_a_sphere() -> FieldSurface {
    let mut mesh = plate(30);
    let (sphere, first) = (generate(Shape::Sphere, 400).unwrap(), mesh.positions.len() as u32);
    mesh.positions.extend(sphere.positions.iter().map(|p| [p[0] + 3.0, p[1], p[2]]));
    mesh.faces.extend(sphere.faces.iter().map(|face| face.map(|v| v + first)));
    FieldSurface::new(mesh).unwrap()
}

#[test]
fn what_is_asked_for_on_one_component_is_no_bound_for_others_and_a_large_one_lets_no_small_one_grow() {
    let s = set_up();
    let surface = beside_a_sphere();
    let basis = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, 800), &Unwatched).unwrap();
    let components = Arc::new(FaceComponents::new(&surface));
    let plate = s.surface.faces();
    let areas = surface.frames().areas();
    let share: f64 = areas[..plate].iter().sum();
    let of_plate = |field: &[f32]| -> f64 {
        let square = |(u, area): (&[f32], &f64)| area * u.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>();
        (field[..2 * plate].chunks(2).zip(areas).map(square).sum::<f64>() / share).sqrt()
    };
    let (weights, target) = (EnergyWeights::default(), vec![0.0; 2 * surface.faces()]);
    for model in [DesignModel::new(&basis, &Unwatched).unwrap(), DesignModel::sparse(&basis)] {
        let model = model.with_components(components.clone());
        let alignment = Arc::new(model.alignment(&basis, areas, &target, None).unwrap());
        for alignment in [None, Some((alignment, 1e-6))] {
            for hold in [Hold::Strength(1.0), Hold::Exact] {
                // A stroke of another length on the sphere is no reason for long fields on the plate.
                let constraints = [stroke(s.far, [1.0, 0.3], hold), stroke(plate as u32 + 7, [20.0, 0.0], hold)];
                let weighted = model.weighted(weights, alignment.clone()).unwrap();
                let design = weighted.solve(&basis, &constraints).unwrap();
                let length = of_plate(&basis.space.lift(&design.coefficients).unwrap());
                assert!(length < 1.5 * MOST * 1f64.hypot(0.3), "{hold:?} {}: {length}", alignment.is_some());
                assert!(length > 1.0, "{length}");
            }
        }
    }
}

/// Lengths and weights are those of a surface of unit area: on one of which the plate is a share, its biharmonic energy
/// is so much larger.
#[test]
fn among_all_fields_of_a_surface_a_component_has_the_design_that_it_has_alone() {
    let s = set_up();
    let surface = beside_a_sphere();
    let plate = s.surface.faces();
    let share: f64 = surface.frames().areas()[..plate].iter().sum();
    let design = |surface: &FieldSurface, basis: &FieldBasis, biharmonic: f64| -> Vec<f64> {
        let components = Arc::new(FaceComponents::new(surface));
        let model = DesignModel::new(basis, &Unwatched).unwrap().with_components(components);
        let weighted = model.weighted(EnergyWeights { harmonic: 1.0, biharmonic }, None).unwrap();
        let constraints = [stroke(s.far, [1.0, 0.3], Hold::Exact)];
        let design = weighted.solve(basis, &constraints).unwrap();
        let full = FullSpace::within(surface, FieldKind::Vector {}, FieldBoundary::Tangential, 1 << 30, &Unwatched);
        let least = full.unwrap().least(&weighted, basis, &constraints, &design, &Unwatched).unwrap().unwrap();
        least.field[..2 * plate].to_vec()
    };
    let basis = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, 300), &Unwatched).unwrap();
    let (alone, beside) = (design(&s.surface, &s.basis, 0.05), design(&surface, &basis, 0.05 * share));
    assert!(apart(&alone, &beside) < 1e-5 * size(&alone), "{} of {}", apart(&alone, &beside), size(&alone));
}
