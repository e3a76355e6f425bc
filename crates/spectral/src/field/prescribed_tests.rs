use chladni_base::Unwatched;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::field::singularities;

fn surface(shape: Shape, vertices: usize) -> FieldSurface {
    FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), 0.1, 3).unwrap()).unwrap()
}

/// What a field of single numbers is singular at, as it was prescribed.
fn found(surface: &FieldSurface, field: &PrescribedField) -> Vec<Prescribed> {
    let single: Vec<f32> = field.target([0.6, 0.8]).iter().map(|&x| x as f32).collect();
    let found = singularities(surface, field.kind(), &single).unwrap();
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
    assert!(matches!(refuse(4, &[at(3, 8)]), PrescribedError::TooSharp { vertex: 3, .. }));
    let disk = surface(Shape::Disk, 100);
    let rim = (0..).find(|&v| !disk.dual().fan(disk.mesh(), v, &mut Vec::new())).unwrap();
    let error = PrescribedField::new(&disk, FieldKind::Vector {}, &[at(rim, 1)], &Unwatched).unwrap_err();
    assert_eq!(error, PrescribedError::Boundary { at: 0, vertex: rim });
}
