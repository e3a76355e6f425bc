//! Reports of real meshes, whose counts are known.

use super::*;
use crate::read::{MeshFormat, ReadLimits, read};
use std::io::Read;
use std::path::Path;

/// Reads a mesh of the folder that `CHLADNI_MESHES` names; `None` where it names none.
fn load(name: &str) -> Option<RawMesh> {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        eprintln!("skipped: CHLADNI_MESHES is not set");
        return None;
    };
    let mut bytes = std::fs::read(Path::new(&folder).join(name)).unwrap();
    let mut plain = name;
    if let Some(inner) = name.strip_suffix(".gz") {
        let mut unpacked = Vec::new();
        flate2::read::GzDecoder::new(bytes.as_slice()).read_to_end(&mut unpacked).unwrap();
        (bytes, plain) = (unpacked, inner);
    }
    let format = MeshFormat::from_extension(plain.rsplit('.').next().unwrap()).unwrap();
    Some(read(&bytes, format, &ReadLimits::default()).unwrap())
}

fn report(name: &str) -> Option<MeshReport> {
    Some(check(load(name)?, &CheckOptions::default()).unwrap().report)
}

#[test]
fn closed_surfaces_have_their_genus_and_no_defects() {
    for (name, vertices, genus) in [
        ("igea.ply", 134_345, 0),
        ("spot-uv-seams.obj", 2930, 0),
        ("kitten.obj", 14_472, 1),
        ("rolling-stage.obj", 49_988, 7),
        ("nefertiti.obj", 49_971, 0),
        ("horse.ply", 48_485, 0),
        ("armadillo.obj", 43_243, 0),
        ("fertility-14k.obj", 13_971, 4),
        ("bumpy-cube.obj", 19_970, 0),
        ("rocker-arm.off", 10_044, 1),
        ("fertility.off", 4494, 4),
        ("3holes.off", 3596, 3),
    ] {
        let Some(report) = report(name) else { return };
        assert_eq!((report.vertices, report.genus, report.components), (vertices, Some(genus), 1), "{name}");
        assert!(report.closed && report.manifold && report.orientable && report.repairs.is_empty(), "{name}");
        let telling: Vec<&Defect> = report.defects.iter().filter(|d| d.kind != DefectKind::ZeroArea).collect();
        assert!(telling.is_empty(), "{name}: {telling:?}");
    }
}

#[test]
fn boundaries_are_counted_edge_by_edge_and_loop_by_loop() {
    for (name, edges, loops, genus) in [("bunny.obj", 223, 5, 0), ("face.obj", 96, 1, 0), ("camelhead.off", 56, 1, 0)] {
        let Some(report) = report(name) else { return };
        assert_eq!((report.boundary_edges, report.boundary_loops, report.genus), (edges, loops, Some(genus)), "{name}");
        assert!(!report.closed && report.manifold && report.orientable, "{name}");
    }
}

#[test]
fn the_dragon_comes_in_151_pieces() {
    let Some(report) = report("dragon.ply.gz") else { return };
    assert_eq!((report.vertices, report.faces, report.components), (437_645, 871_414, 151));
    assert_eq!((report.boundary_edges, report.count(DefectKind::ZeroArea)), (4270, 108));
    assert!(report.repairs.is_empty());
}

#[test]
fn what_is_not_manifold_is_usable_and_reported() {
    let Some(dragon) = report("dragon-nonmanifold.ply.gz") else { return };
    // Seven more are made by copies of faces, which are dropped.
    assert_eq!(dragon.count(DefectKind::NonManifoldEdge), 2527);
    assert_eq!(dragon.repaired(RepairKind::DroppedUnreferencedVertices), 43);
    assert_eq!((dragon.vertices, dragon.genus, dragon.manifold), (100_207, None, false));

    let fan = report("fan3.obj").unwrap();
    assert_eq!((fan.count(DefectKind::NonManifoldEdge), fan.count(DefectKind::NonManifoldVertex)), (1, 0));
    let hourglass = report("hourglass_ico.obj").unwrap();
    assert_eq!((hourglass.count(DefectKind::NonManifoldEdge), hourglass.components), (0, 1));
    assert_eq!((hourglass.count(DefectKind::NonManifoldVertex), hourglass.closed), (1, true));
    let moebius = report("moebius.obj").unwrap();
    assert!(moebius.manifold && !moebius.orientable && !moebius.closed);
    assert_eq!((moebius.boundary_loops, moebius.genus, moebius.euler_characteristic), (1, None, 0));
    assert!(moebius.count(DefectKind::InconsistentOrientation) > 0);
    // Its 224 faces are quadrilaterals.
    assert_eq!(moebius.repairs, [Repair { kind: RepairKind::TriangulatedPolygons, count: 224 }]);
}

#[test]
fn positions_that_a_file_splits_join_where_asked() {
    let Some(mut raw) = load("kitten.obj") else { return };
    // As a viewer would hold it: three vertices of its own for each face.
    raw.positions = raw.faces.iter().flatten().map(|&v| raw.positions[v as usize]).collect();
    raw.faces = (0..raw.faces.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let options = CheckOptions { merge: Merge::Always, ..CheckOptions::default() };
    let joined = check(raw, &options).unwrap();
    assert_eq!((joined.report.vertices, joined.report.genus, joined.report.closed), (14_472, Some(1), true));
    assert_eq!(joined.numbering.file_vertices(), 3 * 28_944);
}

#[test]
fn every_pose_of_the_camel_can_be_used() {
    for pose in 1..=10 {
        let Some(report) = report(&format!("camel-gallop/camel-gallop-{pose:02}.off")) else { return };
        assert_eq!(report.faces + report.repaired(RepairKind::DroppedDuplicateFaces), 10_000);
        assert!(report.vertices <= 5002 && report.area > 0.0);
    }
}
