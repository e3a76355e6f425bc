use chladni_base::Unwatched;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::field::{Constraint, DesignModel, FieldParameters, Hold, field_basis, matched_singularities};

fn surface(shape: Shape, vertices: usize) -> FieldSurface {
    FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.1, 3).unwrap()).unwrap()
}

/// What a field of single numbers is singular at, as it was prescribed.
fn found(surface: &FieldSurface, field: &PrescribedField) -> Vec<Prescribed> {
    let single: Vec<f32> = field.target(Complex64::new(0.6, 0.8)).iter().map(|&x| x as f32).collect();
    let matching = field.matching(surface, &single);
    let found = matched_singularities(surface, field.kind(), &single, &matching).unwrap();
    found.iter().map(|s| Prescribed { vertex: s.vertex, numerator: s.numerator }).collect()
}

fn check(surface: &FieldSurface, kind: FieldKind, mut prescribed: Vec<Prescribed>) {
    let field = PrescribedField::new(surface, kind, &prescribed, &Unwatched).unwrap();
    prescribed.sort_by_key(|p| p.vertex);
    assert_eq!(found(surface, &field), prescribed, "{kind:?}");
}

fn at(vertex: u32, numerator: i32) -> Prescribed {
    Prescribed { vertex, numerator }
}

#[test]
fn a_field_is_singular_where_it_was_prescribed_and_nowhere_else() {
    let sphere = surface(Shape::Sphere, 642);
    check(&sphere, FieldKind::Vector {}, vec![at(3, 1), at(500, 1)]);
    check(&sphere, FieldKind::Vector {}, vec![at(3, 1), at(500, 1), at(77, 1), at(200, -1)]);
    check(&sphere, FieldKind::NVector { n: 4 }, (0..8).map(|i| at(80 * i, 1)).collect());
    check(&sphere, FieldKind::NVector { n: 2 }, vec![at(100, 2), at(400, 1), at(401, 1)]);
    check(&sphere, FieldKind::Tensor {}, (0..4).map(|i| at(150 * i, 1)).collect());
    let torus = surface(Shape::Torus, 600);
    check(&torus, FieldKind::NVector { n: 4 }, vec![at(10, 1), at(300, -1)]);
    check(&torus, FieldKind::Vector {}, vec![]);
    let double = surface(Shape::Genus(2), 1200);
    check(&double, FieldKind::Vector {}, vec![at(10, -1), at(700, -1)]);
    check(&double, FieldKind::NVector { n: 6 }, (0..12).map(|i| at(90 * i + 5, -1)).collect());
}

#[test]
fn boundaries_take_what_is_missing_and_components_are_counted_one_by_one() {
    let disk = surface(Shape::Disk, 400);
    let inside = (0..).find(|&v| disk.dual().fan(disk.mesh(), v, &mut Vec::new())).unwrap();
    check(&disk, FieldKind::Vector {}, vec![at(inside, -1)]);
    check(&disk, FieldKind::Vector {}, vec![]);
    let mut annulus = generate(Shape::Torus, 600).unwrap();
    let positions = annulus.positions.clone();
    annulus.faces.retain(|f| !f.iter().all(|&v| positions[v as usize][0] > 1.0));
    let annulus = FieldSurface::new(annulus).unwrap();
    let inside = (0..).filter(|&v| annulus.dual().fan(annulus.mesh(), v, &mut Vec::new())).nth(40).unwrap();
    check(&annulus, FieldKind::NVector { n: 2 }, vec![at(inside, 1)]);
    let both = union(&[generate(Shape::Sphere, 162).unwrap(), generate(Shape::Torus, 200).unwrap()]);
    let both = FieldSurface::new(both).unwrap();
    check(&both, FieldKind::Vector {}, vec![at(2, 1), at(100, 1), at(170, 1), at(250, -1)]);
    let error = PrescribedField::new(&both, FieldKind::Vector {}, &[at(2, 1), at(170, 1)], &Unwatched).unwrap_err();
    assert_eq!(error, PrescribedError::Sum { face: 0, sum: 1, order: 1, characteristic: 2 });
}

#[test]
fn what_cannot_be_is_named() {
    let sphere = surface(Shape::Sphere, 162);
    let refuse = |n, prescribed: &[Prescribed]| {
        PrescribedField::new(&sphere, FieldKind::NVector { n }, prescribed, &Unwatched).unwrap_err()
    };
    let error = refuse(4, &[at(1, 4), at(7, 3)]);
    assert_eq!(error, PrescribedError::Sum { face: 0, sum: 7, order: 4, characteristic: 2 });
    assert!(error.to_string().contains("add up to 7/4, but its Euler characteristic is 2"), "{error}");
    assert_eq!(refuse(1, &[at(1, 1), at(162, 1)]), PrescribedError::Vertex { at: 1, vertex: 162, vertices: 162 });
    assert_eq!(refuse(1, &[at(1, 1), at(1, 1)]), PrescribedError::Twice { vertex: 1 });
    assert_eq!(refuse(1, &[at(1, 2), at(2, 0)]), PrescribedError::Zero { at: 1, vertex: 2 });
    let disk = surface(Shape::Disk, 100);
    let rim = (0..).find(|&v| !disk.dual().fan(disk.mesh(), v, &mut Vec::new())).unwrap();
    let error = PrescribedField::new(&disk, FieldKind::Vector {}, &[at(rim, 1)], &Unwatched).unwrap_err();
    assert_eq!(error, PrescribedError::Boundary { at: 0, vertex: rim });
}

/// The index of a vertex from what a field does when it is carried around it, by a way of its own: the turn of each
/// step, with its full turns, and the angles of the corners of the mesh in space.
fn index_around(
    surface: &FieldSurface,
    kind: FieldKind,
    field: &[f32],
    matching: &[Matching],
    vertex: u32,
) -> Option<f64> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    let mut corners = Vec::new();
    if !dual.fan(mesh, vertex, &mut corners) {
        return None;
    }
    let angle = |face: usize| match kind {
        FieldKind::Tensor {} => {
            let [a, b, c] = [0, 1, 2].map(|i| f64::from(field[3 * face + i]));
            (2f64.sqrt() * c).atan2(a - b)
        }
        _ => f64::from(field[2 * face + 1]).atan2(f64::from(field[2 * face])),
    };
    let mut turned = 0.0;
    let mut defect = TAU;
    for (at, &corner) in corners.iter().enumerate() {
        let (face, k) = (corner as usize / 3, corner as usize % 3);
        let next = corners[(at + 1) % corners.len()] as usize / 3;
        let [p, q, r] = std::array::from_fn(|i| mesh.point(mesh.faces[face][(k + i) % 3]));
        let (a, b) = (q - p, r - p);
        defect -= (a.dot(b) / (a.norm_squared() * b.norm_squared()).sqrt()).clamp(-1.0, 1.0).acos();
        let slot = (0..3).find(|&s| dual.neighbours(face)[s] as usize == next && s == (k + 1) % 3)?;
        let carried = turn(kind, dual, frames, face, slot)?;
        let step = angle(next) + carried.by.arg() - angle(face);
        let step = step - TAU * (step / TAU).round();
        let edge = dual.edges(face)[slot];
        let sign = if dual.edge_faces()[edge as usize][0] as usize == face { 1.0 } else { -1.0 };
        let more: i32 = matching.iter().filter(|m| m.edge == edge).map(|m| m.turns).sum();
        turned += step + sign * TAU * f64::from(more);
    }
    Some((turned / f64::from(kind.order()) + defect) / TAU)
}

#[test]
fn exact_fields_have_the_prescribed_singularities_and_no_others_on_any_mesh() {
    // Coarse and noisy meshes, on which the turns of some edges are beyond 180°.
    let double = |genus, vertices, seed| {
        FieldSurface::new(noisy(&generate(genus, vertices).unwrap(), 0.3, seed).unwrap()).unwrap()
    };
    let shapes = [
        double(Shape::Sphere, 162, 1),
        double(Shape::Torus, 300, 2),
        double(Shape::Genus(2), 900, 3),
        double(Shape::Genus(4), 1700, 4),
    ];
    let mut beyond = 0;
    for (which, surface) in shapes.iter().enumerate() {
        let characteristic = surface.dual().euler_characteristic() as i32;
        for n in [1, 2, 4, 6] {
            let kind = FieldKind::NVector { n };
            let vertices = surface.mesh().positions.len() as u32;
            let count = (n as i32 * characteristic).unsigned_abs();
            let mut prescribed: Vec<Prescribed> = (0..count)
                .map(|i| at((i * vertices / count.max(1) + 3 * n) % vertices, characteristic.signum()))
                .collect();
            // And one pair that is sharp: as many turns as the order.
            prescribed.extend([at(vertices / 3 + 1, n as i32), at(vertices / 2 + 2, -(n as i32))]);
            prescribed.sort_by_key(|p| p.vertex);
            prescribed.dedup_by_key(|p| p.vertex);
            let missing = n as i32 * characteristic - prescribed.iter().map(|p| p.numerator).sum::<i32>();
            if missing != 0 {
                let free = (0..vertices).find(|v| prescribed.iter().all(|p| p.vertex != *v)).unwrap();
                prescribed.push(at(free, missing));
                prescribed.sort_by_key(|p| p.vertex);
            }
            check(surface, kind, prescribed.clone());
            let field = PrescribedField::new(surface, kind, &prescribed, &Unwatched).unwrap();
            let single: Vec<f32> = field.target(Complex64::new(0.6, -0.8)).iter().map(|&x| x as f32).collect();
            let matching = field.matching(surface, &single);
            beyond += matching.len();
            for vertex in 0..vertices {
                let wanted = prescribed.iter().find(|p| p.vertex == vertex).map_or(0, |p| p.numerator);
                let index = index_around(surface, kind, &single, &matching, vertex).unwrap();
                assert!((index - f64::from(wanted) / f64::from(n)).abs() < 1e-4, "{which}, n = {n}, {vertex}: {index}");
            }
        }
    }
    assert!(beyond > 0, "no shape needed a matching");
}

#[test]
fn each_component_is_turned_to_fit_its_own_strokes() {
    let both = union(&[generate(Shape::Torus, 300).unwrap(), generate(Shape::Torus, 200).unwrap()]);
    let surface = FieldSurface::new(both).unwrap();
    let kind = FieldKind::NVector { n: 4 };
    let basis = field_basis(&surface, &FieldParameters::new(kind, 80), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let field = PrescribedField::new(&surface, kind, &[], &Unwatched).unwrap();
    let prescription = model.prescription(&basis, &surface, field).unwrap();
    let last = surface.faces() as u32 - 5;
    let one = |face, angle: f64| Constraint { face, value: [angle.cos(), angle.sin(), 0.0], hold: Hold::Strength(1.0) };
    let (field, matching) = prescription.exact(&surface, &[one(4, 0.3), one(last, -2.0)]);
    assert!(matching.is_empty());
    for (face, angle) in [(4, 0.3f32), (last as usize, -2.0)] {
        assert!((field[2 * face] - angle.cos()).abs() < 1e-5 && (field[2 * face + 1] - angle.sin()).abs() < 1e-5);
    }
}
