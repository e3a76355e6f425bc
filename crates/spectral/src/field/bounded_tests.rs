//! Fields without energy that are small where constraints are: they would meet these with any length.

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;

use super::{
    Constraint, Design, DesignModel, EnergyWeights, FieldBasis, FieldParameters, FieldSurface, FullSpace, Hold,
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

#[test]
fn beside_an_alignment_fields_without_energy_are_bounded_and_small_weights_tend_to_none() {
    let s = set_up();
    let weights = EnergyWeights::default();
    let target = vec![0.0; 2 * s.surface.faces()];
    let alignment =
        std::sync::Arc::new(s.model.alignment(&s.basis, s.surface.frames().areas(), &target, None).unwrap());
    for hold in [Hold::Strength(1.0), Hold::Exact, Hold::Weight(50.0)] {
        let constraints = [stroke(s.far, [1.0, 0.3], hold)];
        let without = s.model.weighted(weights, None).unwrap().solve(&s.basis, &constraints).unwrap();
        for weight in [1e-6, 1e-3, 1.0] {
            let weighted = s.model.weighted(weights, Some((alignment.clone(), weight))).unwrap();
            let design = weighted.solve(&s.basis, &constraints).unwrap();
            assert!(length_of_idle(&s, &design) < 1.0001 * MOST * 1f64.hypot(0.3), "{hold:?} {weight}");
            if weight == 1e-6 {
                let size = without.ritz.iter().map(|z| z * z).sum::<f64>().sqrt();
                let off = without.ritz.iter().zip(&design.ritz).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                assert!(off < 1e-3 * size, "{hold:?} {off} of {size}");
            }
        }
    }
}
