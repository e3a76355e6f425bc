//! A small mesh for every defect and repair.

use super::*;

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

fn corners() -> Vec<[f64; 3]> {
    vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
}

/// For each vertex of the file its kept one.
fn vertex_map(numbering: &Numbering) -> Vec<u32> {
    numbering.vertex_map().map(|kept| kept.unwrap_or(DROPPED)).collect()
}

fn raw(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> RawMesh {
    RawMesh { positions, faces, ..RawMesh::default() }
}

fn checked(raw: RawMesh) -> CheckedMesh {
    check(raw, &CheckOptions::default()).unwrap()
}

fn refused(raw: RawMesh) -> MeshError {
    let error = check(raw.clone(), &CheckOptions::default()).unwrap_err();
    let (report, again) = inspect(raw, &CheckOptions::default());
    assert_eq!(again.as_ref(), Some(&error));
    assert!(report.area.is_finite() && report.bounding_box.iter().flatten().all(|x| x.is_finite()));
    error
}

#[test]
fn a_clean_mesh_passes_untouched() {
    let CheckedMesh { mesh, report, numbering, .. } = checked(raw(corners(), TETRAHEDRON.to_vec()));
    assert_eq!((mesh.positions, mesh.faces, numbering.is_identity()), (corners(), TETRAHEDRON.to_vec(), true));
    assert!(report.defects.is_empty() && report.repairs.is_empty());
    assert!(report.closed && report.manifold && report.orientable);
    assert_eq!((report.genus, report.euler_characteristic, report.components), (Some(0), 2, 1));
    assert_eq!(report.bounding_box, [[0.0; 3], [1.0; 3]]);
    assert!((report.area - (1.5 + 0.75f64.sqrt())).abs() < 1e-15);
}

#[test]
fn what_carries_no_surface_is_dropped_and_listed_in_the_numbers_of_the_input() {
    let mut positions = corners();
    positions.insert(1, [f64::NAN, 0.0, 0.0]);
    positions.push([5.0; 3]);
    let mut faces: Vec<[u32; 3]> = TETRAHEDRON.iter().map(|f| f.map(|v| v + u32::from(v > 0))).collect();
    faces.insert(0, [2, 2, 3]);
    faces.push([4, 3, 0]);
    faces.push([3, 0, 4]);
    faces.push([0, 2, 0]);
    let CheckedMesh { mesh, report, numbering, .. } = checked(raw(positions, faces));
    assert_eq!((mesh.positions, mesh.faces), (corners(), TETRAHEDRON.to_vec()));
    assert_eq!(vertex_map(&numbering), [0, DROPPED, 1, 2, 3, DROPPED]);
    let examples = |kind| report.defects.iter().find(|d| d.kind == kind).map(|d| d.examples.clone());
    assert_eq!(examples(DefectKind::NonFinite), Some(vec![1]));
    assert_eq!(examples(DefectKind::RepeatedVertex), Some(vec![0, 7]));
    assert_eq!(examples(DefectKind::DuplicateFace), Some(vec![5, 6]));
    assert_eq!(examples(DefectKind::UnreferencedVertex), Some(vec![1, 5]));
    // The copies made their edges non-manifold; without them they are not.
    assert_eq!((report.count(DefectKind::NonManifoldEdge), report.manifold, report.defects.len()), (0, true, 4));
    assert_eq!(report.repaired(RepairKind::DroppedDuplicateFaces), 2);
    assert_eq!(report.repaired(RepairKind::DroppedUnreferencedVertices), 2);
}

#[test]
fn equal_positions_are_merged_where_the_format_splits_them_and_hinted_at_elsewhere() {
    let positions: Vec<[f64; 3]> = TETRAHEDRON.iter().flatten().map(|&v| corners()[v as usize]).collect();
    let split = raw(positions, (0..4).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect());
    let apart = checked(split.clone());
    assert_eq!((apart.report.components, apart.report.count(DefectKind::EqualPosition)), (4, 8));
    assert_eq!((apart.numbering.same_vertices(), apart.report.boundary_loops), (true, 4));
    let merged = checked(RawMesh { splits_vertices: true, ..split.clone() });
    assert_eq!((merged.report.vertices, merged.report.genus), (4, Some(0)));
    assert_eq!(merged.report.repairs, [Repair { kind: RepairKind::MergedVertices, count: 8 }]);
    assert_eq!(vertex_map(&merged.numbering), [0, 1, 2, 0, 2, 3, 2, 1, 3, 1, 0, 3]);
    let options = CheckOptions { merge: Merge::Always, ..CheckOptions::default() };
    assert_eq!(check(split, &options).unwrap().mesh, merged.mesh);
}

#[test]
fn faces_that_collapse_when_vertices_merge_are_dropped() {
    let mut positions = corners();
    positions.push([-0.0, 0.0, 0.0]);
    let mut faces = TETRAHEDRON.to_vec();
    faces.push([0, 4, 1]);
    let options = CheckOptions { merge: Merge::Always, ..CheckOptions::default() };
    let CheckedMesh { mesh, report, .. } = check(raw(positions, faces), &options).unwrap();
    assert_eq!((mesh.faces.as_slice(), report.closed), (&TETRAHEDRON[..], true));
}

#[test]
fn zero_area_faces_stay_and_are_counted() {
    let positions = vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]];
    let CheckedMesh { mesh, report, .. } = checked(raw(positions, vec![[0, 1, 2], [0, 3, 1]]));
    assert_eq!((mesh.faces.len(), report.count(DefectKind::ZeroArea), report.area), (2, 1, 2.0));
}

#[test]
fn turned_faces_are_turned_back() {
    let mut faces = TETRAHEDRON.to_vec();
    faces[1].swap(1, 2);
    let CheckedMesh { mesh, report, .. } = checked(raw(corners(), faces));
    assert_eq!(mesh.faces, TETRAHEDRON);
    assert_eq!(report.count(DefectKind::InconsistentOrientation), 3);
    assert_eq!((report.repaired(RepairKind::FlippedFaces), report.genus), (1, Some(0)));
}

#[test]
fn what_cannot_be_used_is_refused_by_name() {
    let with = |vertex: usize, value: f64| {
        let mut positions = corners();
        positions[vertex][1] = value;
        raw(positions, TETRAHEDRON.to_vec())
    };
    assert_eq!(refused(with(3, f64::NAN)), MeshError::NonFinite { vertex: 3, face: 1 });
    assert_eq!(refused(with(0, f64::NEG_INFINITY)), MeshError::NonFinite { vertex: 0, face: 0 });
    let error = refused(with(2, -1e31));
    assert_eq!(error, MeshError::OutOfRange { vertex: 2, coordinate: -1e31, largest: 1e30, face: 0 });
    let scaled = |s: f64| raw(corners().iter().map(|p| p.map(|x| x * s)).collect(), TETRAHEDRON.to_vec());
    assert_eq!(refused(scaled(1e-31)).kind(), "mesh-too-small");
    assert_eq!(refused(scaled(0.0)), MeshError::NoArea { faces: 4 });
    assert_eq!(refused(scaled(1e300)).kind(), "coordinate-out-of-range");
    for usable in [1e30, 1e-30] {
        let area = checked(scaled(usable)).report.area;
        assert!((area / (usable * usable) - (1.5 + 0.75f64.sqrt())).abs() < 1e-14);
    }
    let stray = raw(corners(), vec![[0, 1, 2], [3, 99, 1]]);
    let error = refused(stray);
    assert_eq!(error, MeshError::IndexOutOfRange { face: 1, vertex: 99, vertices: 4 });
    assert_eq!(error.to_string(), "face 1 refers to vertex 99 of 4");
    assert_eq!(refused(RawMesh::default()).kind(), "no-faces");
    assert_eq!(refused(raw(corners(), vec![[0, 0, 1]])), MeshError::NoFaces { given: 1, vertices: 4 });
    let solid = RawMesh { positions: corners(), tetrahedra: vec![[0, 1, 2, 3]], ..RawMesh::default() };
    assert_eq!(refused(solid), MeshError::OnlyTetrahedra { tetrahedra: 1 });
}

#[test]
fn a_report_travels_as_json() {
    let report = checked(raw(corners(), vec![[0, 1, 2], [0, 1, 2], [3, 2, 1]])).report;
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["defects"][0]["kind"], "duplicate_face");
    assert_eq!(serde_json::from_value::<MeshReport>(json).unwrap(), report);
}

#[test]
fn everything_at_one_place_takes_no_quadratic_time() {
    // A hundred thousand copies of one face, all vertices equal; then as many faces around one edge.
    let n = 100_000u32;
    let copies = raw(vec![[1.0; 3]; 3 * n as usize], (0..n).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect());
    let options = CheckOptions { merge: Merge::Always, ..CheckOptions::default() };
    assert_eq!(check(copies, &options).unwrap_err().kind(), "no-faces");
    let pages = (0..n).map(|i| [f64::from(i).cos(), f64::from(i).sin(), 0.0]);
    let book = raw(
        [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]].into_iter().chain(pages).collect(),
        (0..n).map(|i| [0, 1, i + 2]).collect(),
    );
    let report = checked(book).report;
    assert_eq!((report.count(DefectKind::NonManifoldEdge), report.boundary_edges), (1, 2 * n as usize));
    assert_eq!(report.genus, None);
}

#[test]
fn a_refused_mesh_still_gets_its_topology_reported() {
    let mut positions = corners();
    positions[3][2] = f64::NAN;
    let (report, error) = inspect(raw(positions, TETRAHEDRON.to_vec()), &CheckOptions::default());
    assert_eq!(error, Some(MeshError::NonFinite { vertex: 3, face: 1 }));
    assert_eq!((report.vertices, report.faces, report.genus, report.area), (4, 4, Some(0), 0.5));
    assert_eq!(report.defects.len(), 1);
}

#[test]
fn a_divided_mesh_is_reported_as_if_it_had_been_given_so() {
    let mut positions = corners();
    positions.push([9.0; 3]);
    // A surface with a boundary, a face that is given twice, and a vertex that none uses.
    let faces = vec![[0, 1, 2], [0, 1, 2], [3, 2, 1]];
    let plain = checked(raw(positions.clone(), faces.clone())).report;
    let options = CheckOptions { subdivisions: 2, ..CheckOptions::default() };
    let divided = check(raw(positions.clone(), faces.clone()), &options).unwrap();
    let again = checked(raw(divided.mesh.positions.clone(), divided.mesh.faces.clone())).report;
    assert_eq!((divided.report.faces, divided.report.subdivisions), (32, 2));
    assert_eq!((&divided.report.defects, &divided.report.repairs), (&plain.defects, &plain.repairs));
    let area = divided.report.area;
    let own = MeshReport {
        subdivisions: 0,
        file: None,
        defects: Vec::new(),
        repairs: Vec::new(),
        area: again.area,
        ..divided.report
    };
    assert_eq!(own, again);
    assert!((area - again.area).abs() < 1e-12);
    let few = CheckOptions { most_faces: 31, ..options };
    let error = check(raw(positions, faces), &few).unwrap_err();
    assert_eq!(error, MeshError::TooLarge { elements: "faces", count: 32, most: 31 });
}
