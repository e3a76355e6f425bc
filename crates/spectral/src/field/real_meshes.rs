//! Real surfaces: kernels of the right dimension, singularities that add up, and the accuracy of design.

use chladni_base::Unwatched;
use chladni_mesh::check::check;
use chladni_mesh::read::{MeshFormat, read};

use super::*;
use crate::operator::transport::FieldKind;

pub(super) fn surface(name: &str) -> Option<FieldSurface> {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        println!("skipped: CHLADNI_MESHES is not set");
        return None;
    };
    let bytes = std::fs::read(std::path::Path::new(&folder).join(name)).unwrap();
    let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap()).unwrap();
    let mesh = check(read(&bytes, format, &Default::default()).unwrap(), &Default::default()).unwrap().mesh;
    Some(FieldSurface::new(mesh).unwrap())
}

#[test]
fn kernels_have_two_dimensions_for_each_handle_and_indices_add_up() {
    for (name, zeros) in [("rocker-arm.off", 2), ("3holes.off", 6), ("fertility.off", 8)] {
        let Some(surface) = surface(name) else { return };
        let basis = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, 200), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        assert_eq!(model.values().iter().take_while(|v| **v < 1e-6).count(), zeros, "{name}");
        assert!(model.values()[zeros] > 1.0, "{name}");
        let weights = EnergyWeights { harmonic: 1.0, biharmonic: 0.01 };
        let constraints: Vec<Constraint> = (0..12)
            .map(|i| Constraint {
                face: (i * surface.faces() / 12) as u32,
                value: [(i as f64).cos(), (i as f64).sin(), 0.0],
                hold: Hold::Exact,
            })
            .collect();
        let design = model.weighted(weights, None).unwrap().solve(&basis, &constraints).unwrap();
        assert!(design.residuals.iter().all(|r| *r < 1e-4), "{name}: {:?}", design.residuals);
        let field = basis.space.lift(&design.coefficients).unwrap();
        let found = singularities(&surface, basis.kind, &field).unwrap();
        let sum: i32 = found.iter().map(|s| s.numerator).sum();
        assert_eq!(i64::from(sum), surface.dual().euler_characteristic(), "{name}");
    }
}

#[test]
fn designs_have_the_singularities_that_are_prescribed() {
    for (name, kind, count, numerator) in [
        ("fertility.off", FieldKind::Vector {}, 6, -1),
        ("fertility.off", FieldKind::NVector { n: 4 }, 24, -1),
        ("armadillo.obj", FieldKind::NVector { n: 2 }, 4, 1),
    ] {
        let Some(surface) = surface(name) else { return };
        let basis = field_basis(&surface, &FieldParameters::new(kind, 300), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        let vertices = surface.mesh().positions.len() as u32;
        let at = |i: u32| Prescribed { vertex: i * vertices / count + 17, numerator };
        let prescribed: Vec<Prescribed> = (0..count).map(at).collect();
        let field = PrescribedField::new(&surface, kind, &prescribed, &Unwatched).unwrap();
        let prescription = model.prescription(&basis, &surface, field).unwrap();
        let weights = EnergyWeights { harmonic: 1.0, biharmonic: 0.0 };
        let weighted =
            model.weighted_with(weights, Vec::new(), Some((std::sync::Arc::new(prescription), 300.0))).unwrap();
        let stroke = Constraint { face: 100, value: [1.0, 0.0, 0.0], hold: Hold::Weight(10.0) };
        for constraints in [&[][..], &[stroke]] {
            let design = weighted.solve(&basis, constraints).unwrap();
            let found = singularities(&surface, kind, &basis.space.lift(&design.coefficients).unwrap()).unwrap();
            let found: Vec<Prescribed> =
                found.iter().map(|s| Prescribed { vertex: s.vertex, numerator: s.numerator }).collect();
            println!("{name}, {kind:?}: {} singularities besides {count} prescribed", found.len() - prescribed.len());
            assert!(prescribed.iter().all(|p| found.contains(p)), "{name} {kind:?}");
        }
    }
}

#[test]
fn no_column_vanishes_where_a_sample_lies_on_a_small_tip() {
    for (n, dimension, seed) in [(2, 800, 1), (2, 1000, 0), (2, 1200, 2), (2, 1500, 0), (4, 1000, 0)] {
        let Some(surface) = surface("camelhead.off") else { return };
        let parameters = FieldParameters { seed, ..FieldParameters::new(FieldKind::NVector { n }, dimension) };
        let basis = field_basis(&surface, &parameters, &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        assert_eq!(model.values().len(), dimension, "n = {n}, seed {seed}");
        assert!(model.values().iter().all(|value| value.is_finite() && *value > -1e-6), "n = {n}, seed {seed}");
    }
}

#[test]
fn surfaces_that_are_none_are_refused_by_name() {
    for name in ["fan3.obj", "hourglass_ico.obj"] {
        let Some(folder) = std::env::var_os("CHLADNI_MESHES") else { return };
        let bytes = std::fs::read(std::path::Path::new(&folder).join(name)).unwrap();
        let raw = read(&bytes, MeshFormat::Obj, &Default::default()).unwrap();
        let mesh = check(raw, &Default::default()).unwrap().mesh;
        let error = FieldSurface::new(mesh).unwrap_err().to_string();
        assert!(error.contains("manifold"), "{name}: {error}");
    }
}
