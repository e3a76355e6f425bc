use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::fixtures::union;
use chladni_mesh::shape::{Shape, generate};

use super::*;

fn surface(shape: Shape, vertices: usize) -> FieldSurface {
    FieldSurface::new(generate(shape, vertices).unwrap()).unwrap()
}

fn basis(surface: &FieldSurface, field: FieldKind, dimension: usize) -> FieldBasis {
    field_basis(surface, &FieldParameters::new(field, dimension), &Unwatched).unwrap()
}

fn lowest(basis: &FieldBasis, count: usize) -> Vec<f64> {
    let values = CpuSolver.lowest(basis.stiffness.to_dense(), basis.mass.to_dense(), count, &Unwatched).unwrap().values;
    values.into_iter().map(|v| v / basis.area).collect()
}

const KINDS: [FieldKind; 4] =
    [FieldKind::Vector {}, FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 4 }, FieldKind::Tensor {}];

#[test]
fn every_face_is_covered_and_rows_are_short() {
    for field in KINDS {
        let surface = surface(Shape::Sphere, 2562);
        let basis = basis(&surface, field, 120);
        assert_eq!(basis.space.dimension(), 120);
        assert_eq!(basis.space.uncovered(), None);
        assert!(basis.space.per_row() < 20.0 * field.block() as f64, "{field:?}: {}", basis.space.per_row());
        assert_eq!(basis.samples.len(), 120 / field.block());
    }
}

#[test]
fn low_fields_on_the_sphere_come_close_to_the_analytic_values() {
    let surface = surface(Shape::Sphere, 2562);
    // Value and multiplicity of the lowest level, in the weights of the operators (see their cards).
    let expected = [(2.0, 6), (2.0, 6), (8.0, 18), (4.0, 10)];
    for (field, (value, multiplicity)) in KINDS.into_iter().zip(expected) {
        let values = lowest(&basis(&surface, field, 240), multiplicity + 4);
        // Tensors have the scalar levels of the trace besides: 0, and 2 · 2 three times.
        let from = usize::from(field == FieldKind::Tensor {});
        let level = &values[from..from + multiplicity];
        assert!(level.iter().all(|v| (v / value - 1.0).abs() < 0.03), "{field:?}: {values:?}");
    }
}

#[test]
fn coarse_levels_change_the_work_and_not_the_space() {
    // Eight samples on ten thousand faces take multigrid cycles.
    let surface = surface(Shape::Sphere, 5292);
    let few = lowest(&basis(&surface, FieldKind::Vector {}, 24), 6);
    assert!(few.iter().all(|v| (v / 2.0 - 1.0).abs() < 0.25), "{few:?}");
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let surface = surface(Shape::Torus, 1200);
    let expected = basis(&surface, FieldKind::NVector { n: 2 }, 60);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| basis(&surface, FieldKind::NVector { n: 2 }, 60)), expected);
    }
}

#[test]
fn components_and_boundaries_are_handled() {
    let meshes = [
        union(&[generate(Shape::Sphere, 162).unwrap(), generate(Shape::Disk, 200).unwrap()]),
        generate(Shape::Rectangle, 300).unwrap(),
    ];
    for mesh in meshes {
        let surface = FieldSurface::new(mesh).unwrap();
        for field in KINDS {
            assert_eq!(basis(&surface, field, 30).space.uncovered(), None);
        }
    }
    let twins = union(&[generate(Shape::Sphere, 12).unwrap(), generate(Shape::Sphere, 12).unwrap()]);
    let error =
        field_basis(&FieldSurface::new(twins).unwrap(), &FieldParameters::new(FieldKind::Vector {}, 2), &Unwatched);
    assert_eq!(error, Err(FieldError::Components { components: 2, groups: 1 }));
}

#[test]
fn weights_move_the_samples() {
    let surface = surface(Shape::Sphere, 2562);
    let above =
        |f: u32| surface.mesh().faces[f as usize].iter().all(|&v| surface.mesh().positions[v as usize][2] > 0.0);
    let weights: Vec<f64> = (0..surface.faces() as u32).map(|f| if above(f) { 3.0 } else { 1.0 }).collect();
    let mut parameters = FieldParameters::new(FieldKind::Vector {}, 200);
    parameters.weights = Some(weights.clone());
    let basis = field_basis(&surface, &parameters, &Unwatched).unwrap();
    assert!(basis.samples.iter().filter(|&&f| above(f)).count() > 75);
    assert_eq!(basis.space.uncovered(), None);
    parameters.weights = Some(weights[1..].to_vec());
    let faces = surface.faces();
    assert_eq!(field_basis(&surface, &parameters, &Unwatched), Err(FieldError::Weights { faces, at: faces - 1 }));
    let mut negative = weights;
    negative[7] = -1.0;
    parameters.weights = Some(negative);
    assert_eq!(field_basis(&surface, &parameters, &Unwatched), Err(FieldError::Weights { faces, at: 7 }));
}

#[test]
fn parameters_out_of_range_and_cancelled_work_are_reported() {
    let surface = surface(Shape::Sphere, 42);
    let with = |change: fn(&mut FieldParameters)| {
        let mut parameters = FieldParameters::new(FieldKind::Vector {}, 20);
        change(&mut parameters);
        field_basis(&surface, &parameters, &Unwatched)
    };
    assert!(matches!(with(|p| p.dimension = 1), Err(FieldError::Parameter { name: "dimension", .. })));
    assert!(matches!(with(|p| p.dimension = 161), Err(FieldError::Parameter { name: "dimension", .. })));
    assert!(with(|p| p.dimension = 160).is_ok(), "as many columns as there are numbers");
    assert!(matches!(with(|p| p.field = FieldKind::NVector { n: 0 }), Err(FieldError::Operator(_))));
    let bad = FieldHeat { time: Some(f64::NAN), ..FieldHeat::default() };
    let mut parameters = FieldParameters::new(FieldKind::Vector {}, 20);
    parameters.construction = Construction::Heat(bad);
    assert!(matches!(field_basis(&surface, &parameters, &Unwatched), Err(FieldError::Parameter { name: "time", .. })));
    struct Never;
    impl Monitor for Never {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }
    let parameters = FieldParameters::new(FieldKind::Vector {}, 20);
    assert_eq!(field_basis(&surface, &parameters, &Never), Err(FieldError::Cancelled(Cancelled)));
}

#[test]
fn vector_fields_name_where_a_surface_has_no_sides() {
    let mesh = TriangleMesh {
        positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        faces: vec![[0, 1, 2], [0, 1, 3]],
        ..Default::default()
    };
    let surface = FieldSurface::new(mesh).unwrap();
    let error = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, 4), &Unwatched).unwrap_err();
    assert!(error.to_string().contains("from vertex 0 to vertex 1"), "{error}");
}

#[test]
fn harmonic_fields_of_closed_surfaces_are_in_the_space() {
    for (shape, vertices, zeros) in [(Shape::Torus, 1200, 2), (Shape::Genus(2), 2000, 4)] {
        let surface = surface(shape, vertices);
        let basis = basis(&surface, FieldKind::Vector {}, 60);
        assert_eq!(basis.space.dimension(), 60 + zeros);
        let values = lowest(&basis, zeros + 1);
        assert!(values[..zeros].iter().all(|v| v.abs() < 1e-5), "{values:?}");
        assert!(values[zeros] > 0.01, "{values:?}");
    }
}

#[test]
fn local_eigenfields_are_those_of_the_thesis() {
    let surface = surface(Shape::Sphere, 2562);
    for (field, value) in [(FieldKind::Vector {}, 2.0), (FieldKind::NVector { n: 4 }, 8.0), (FieldKind::Tensor {}, 4.0)]
    {
        let mut parameters = FieldParameters::new(field, 120);
        parameters.construction = Construction::LocalEigenfields(LocalEigenfields::default());
        let basis = field_basis(&surface, &parameters, &Unwatched).unwrap();
        assert_eq!(basis.space.uncovered(), None);
        // Columns of a disk are orthonormal, and their values are those of a disk with the field held at zero outside.
        let (s, m) = (basis.stiffness.to_dense(), basis.mass.to_dense());
        let b = field.block();
        let weight = if field == (FieldKind::Vector {}) { 1.0 } else { 2.0 };
        let disk = weight * 5.78 / (40.0 / (std::f64::consts::PI * 120.0));
        for at in 0..120 {
            assert!((m.column(at)[at] - 1.0).abs() < 1e-3);
            if at % b > 0 {
                assert!(m.column(at)[at - 1].abs() < 1e-3);
            }
            let ratio = s.column(at)[at] / disk;
            assert!((0.7..1.8).contains(&ratio), "{field:?}: {ratio}");
        }
        let from = usize::from(b == 3);
        let lowest = lowest(&basis, 8)[from];
        assert!((lowest / value - 1.0).abs() < 0.25, "{field:?}: {lowest}");
    }
}
