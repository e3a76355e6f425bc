//! Real meshes: which Laplacian they get, and the robust one against the authors' implementation.

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};

use super::*;

/// Reads a mesh of the folder that `CHLADNI_MESHES` names; `None` where it names none.
pub(crate) fn load(name: &str) -> Option<TriangleMesh> {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        eprintln!("skipped: CHLADNI_MESHES is not set");
        return None;
    };
    let mut bytes = std::fs::read(std::path::Path::new(&folder).join(name)).unwrap();
    let mut plain = name;
    if let Some(inner) = name.strip_suffix(".gz") {
        let mut unpacked = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::MultiGzDecoder::new(bytes.as_slice()), &mut unpacked).unwrap();
        (bytes, plain) = (unpacked, inner);
    }
    let format = MeshFormat::from_extension(plain.rsplit('.').next().unwrap()).unwrap();
    Some(check(read(&bytes, format, &ReadLimits::default()).unwrap(), &CheckOptions::default()).unwrap().mesh)
}

fn report(name: &str) -> Option<OperatorReport> {
    Some(assemble(&load(name)?, &OperatorParameters::default(), &Unwatched).unwrap().report)
}

#[test]
fn regular_scans_and_models_keep_their_cotangents() {
    for name in [
        "igea.ply",
        "armadillo.obj",
        "bunny.obj",
        "rolling-stage.obj",
        "rocker-arm.off",
        "fandisk.obj",
        "nefertiti.obj",
        "horse.ply",
        "face.obj",
        "camelhead.off",
        "fertility.off",
        "bumpy-cube.obj",
    ] {
        let Some(report) = report(name) else { return };
        assert_eq!((report.laplacian, report.reason), (Laplacian::Cotangent, Reason::FairMesh), "{name}");
        assert_eq!((report.zero_area_faces, report.massless_vertices), (0, 0), "{name}");
    }
}

#[test]
fn a_strip_of_quads_keeps_them() {
    let Some(report) = report("moebius.obj") else { return };
    assert_eq!((report.laplacian, report.reason), (Laplacian::Polygon, Reason::Polygons));
    assert_eq!((report.zero_area_faces, report.massless_vertices), (0, 0));
}

#[test]
fn what_is_no_manifold_or_full_of_slivers_gets_the_robust_laplacian() {
    let nonmanifold = [("fan3.obj", 1, 0), ("hourglass_ico.obj", 0, 1), ("camel-gallop/camel-gallop-01.off", 5, 0)];
    for (name, edges, vertices) in nonmanifold {
        let Some(report) = report(name) else { return };
        assert_eq!((report.laplacian, report.reason), (Laplacian::Robust, Reason::NonManifold), "{name}");
        assert_eq!((report.non_manifold_edges, report.non_manifold_vertices), (edges, vertices), "{name}");
        assert!(report.delaunay);
    }
    let Some(dragon) = report("dragon-nonmanifold.ply.gz") else { return };
    assert_eq!((dragon.reason, dragon.delaunay, dragon.massless_vertices), (Reason::NonManifold, true, 0));
    assert!(dragon.non_manifold_edges > 2500 && dragon.flips > 50_000);
    let Some(dragon) = report("dragon.ply.gz") else { return };
    assert_eq!((dragon.reason, dragon.zero_area_faces, dragon.delaunay), (Reason::ThinFaces, 108, true));
}

/// The lowest eigenvalues in the units of the input that the package `robust_laplacian` 1.1.0 (Sharp and Crane's own
/// implementation) gives for the same triangles: `mesh_laplacian(V, F)`, then `scipy.linalg.eigh(L, M)`.
#[test]
fn the_robust_laplacian_is_that_of_its_authors() {
    let references: [(&str, &[f64]); 3] = [
        ("fan3.obj", &[0.1948156355, 0.2362764201, 0.32, 0.4527589588]),
        (
            "hourglass_ico.obj",
            &[0.2793623525, 2.000010645, 2.000031004, 2.000031126, 2.000044756, 2.000044756, 2.751974001, 4.341660244],
        ),
        (
            "moebius.obj",
            &[
                0.004769596598,
                0.004777281394,
                0.01812475871,
                0.01813970865,
                0.03795752098,
                0.03798735645,
                0.04631483102,
                0.04757861926,
                0.05880620735,
                0.05884331805,
                0.06275511385,
            ],
        ),
    ];
    for (name, expected) in references {
        let Some(mesh) = load(name) else { return };
        let parameters = OperatorParameters { operator: OperatorKind::Robust, ..Default::default() };
        let problem = assemble(&mesh, &parameters, &Unwatched).unwrap().problem;
        let found = super::tests::lowest(&problem, expected.len() + 1);
        assert!(found[0].abs() < 1e-12);
        for (value, truth) in found[1..].iter().zip(expected) {
            assert!((value / truth - 1.0).abs() < 2e-9, "{name}: {value} instead of {truth}");
        }
    }
}
