//! Whether a mesh can be used, what is wrong with it, and the repairs that lose nothing.
//!
//! A mesh that is not manifold is usable: the cotangent stiffness adds up face by face. It is reported, and so is everything
//! else that a client may want to mend. What cannot be used is refused with a [`MeshError`].

use super::TriangleMesh;
use super::read::RawMesh;
pub use super::repair::DROPPED;
use super::repair::{Faces, compact, equal_positions};
use super::report::Tally;
pub use super::report::{Defect, DefectKind, EXAMPLES, Element, MeshReport, Repair, RepairKind};
use super::topology::{EdgeTable, MOST_FACES, Topology};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Whether vertices at exactly equal positions become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Merge {
    /// Where the format repeats positions by design, as STL does.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// What a check may do and what it takes for usable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckOptions {
    /// Whether vertices at exactly equal positions become one.
    pub merge: Merge,
    /// The largest magnitude of a coordinate. The default, 1e30, also keeps positions finite in single precision.
    pub largest_coordinate: f64,
    /// The smallest usable extent: the longest side of the bounding box. Default 1e-30.
    pub smallest_extent: f64,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self { merge: Merge::Auto, largest_coordinate: 1e30, smallest_extent: 1e-30 }
    }
}

/// Why a mesh cannot be used. Vertices and faces are numbered from 0 as in the input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There are more vertices or faces than 32-bit tables can number.
    #[error("the mesh has {count} {elements}; at most {most} can be numbered")]
    TooLarge {
        /// `vertices` or `faces`.
        elements: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// A face refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex} of {vertices}")]
    IndexOutOfRange {
        /// The first such face.
        face: u64,
        /// The vertex it refers to.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// A face uses a vertex with a NaN or infinite coordinate.
    #[error("vertex {vertex} is not finite, and face {face} uses it")]
    NonFinite {
        /// The vertex.
        vertex: u32,
        /// The first face that uses such a vertex.
        face: u64,
    },
    /// A face uses a vertex too far out for areas to have a meaning.
    #[error("vertex {vertex} has a coordinate of {coordinate:e}, beyond {largest:e}, and face {face} uses it")]
    OutOfRange {
        /// The vertex.
        vertex: u32,
        /// Its coordinate of largest magnitude.
        coordinate: f64,
        /// The largest magnitude allowed.
        largest: f64,
        /// The first face that uses such a vertex.
        face: u64,
    },
    /// No face is left.
    #[error("the mesh has no faces with three different vertices ({given} faces and {vertices} vertices were given)")]
    NoFaces {
        /// Faces in the input.
        given: usize,
        /// Vertices in the input.
        vertices: usize,
    },
    /// The file holds a solid only.
    #[error("the mesh has {tetrahedra} tetrahedra and no triangles")]
    OnlyTetrahedra {
        /// Tetrahedra in the input.
        tetrahedra: usize,
    },
    /// Every face has zero area.
    #[error("all {faces} faces of the mesh have zero area")]
    NoArea {
        /// The number of faces.
        faces: usize,
    },
    /// The mesh is so small that areas underflow.
    #[error("the mesh measures {extent:e} along its longest side, less than {smallest:e}")]
    TooSmall {
        /// The longest side of the bounding box.
        extent: f64,
        /// The smallest allowed.
        smallest: f64,
    },
}

impl MeshError {
    /// A stable identifier for this kind of refusal.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::TooLarge { .. } => "mesh-too-large",
            Self::IndexOutOfRange { .. } => "index-out-of-range",
            Self::NonFinite { .. } => "non-finite-coordinate",
            Self::OutOfRange { .. } => "coordinate-out-of-range",
            Self::NoFaces { .. } => "no-faces",
            Self::OnlyTetrahedra { .. } => "no-triangles",
            Self::NoArea { .. } => "no-area",
            Self::TooSmall { .. } => "mesh-too-small",
        }
    }
}

/// A mesh that can be used.
///
/// Every index is in range, every coordinate finite and in range, no face repeats a vertex or another face, every vertex has
/// a face, the total area is positive, and faces agree in orientation wherever that is possible.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedMesh {
    /// The repaired mesh. Vertices and faces keep their order.
    pub mesh: TriangleMesh,
    /// What was found and done.
    pub report: MeshReport,
    /// For each vertex of the input its number in `mesh`, or [`DROPPED`]; `None` where they are the same.
    pub vertex_map: Option<Vec<u32>>,
}

/// Checks a mesh and repairs what can be repaired without loss.
///
/// Done are, in this order: merging vertices at equal positions (see [`Merge`]), dropping faces that repeat a vertex, dropping
/// faces equal to an earlier one, turning faces over so that neighbours agree, dropping vertices that no face uses. Linear in
/// the size of the mesh up to sorting; runs on the current rayon pool.
///
/// # Errors
/// [`MeshError`] names the first element that makes the mesh unusable.
pub fn check(raw: RawMesh, options: &CheckOptions) -> Result<CheckedMesh, MeshError> {
    let Examined { mesh, report, vertex_map, error } = examine(raw, options);
    match error {
        Some(error) => Err(error),
        None => Ok(CheckedMesh { mesh, report, vertex_map }),
    }
}

/// The report of any mesh, usable or not, and why it would be refused.
pub fn inspect(raw: RawMesh, options: &CheckOptions) -> (MeshReport, Option<MeshError>) {
    let Examined { report, error, .. } = examine(raw, options);
    (report, error)
}

struct Examined {
    mesh: TriangleMesh,
    report: MeshReport,
    vertex_map: Option<Vec<u32>>,
    /// The first reason to refuse the mesh; the rest is then about what is left without the offenders.
    error: Option<MeshError>,
}

fn examine(raw: RawMesh, options: &CheckOptions) -> Examined {
    let RawMesh { mut positions, faces, tetrahedra, splits_vertices, .. } = raw;
    let given = [positions.len(), faces.len()];
    let mut report = MeshReport { vertices: given[0], faces: given[1], ..MeshReport::default() };
    for (elements, count, most) in [("vertices", given[0], DROPPED as usize - 1), ("faces", given[1], MOST_FACES)] {
        if count > most {
            let error = Some(MeshError::TooLarge { elements, count, most });
            return Examined { mesh: TriangleMesh::default(), report, vertex_map: None, error };
        }
    }
    let mut found = Found::default();
    let mut faces = Faces::new(faces);

    let stray = faces.select(|face| face.iter().any(|&v| v as usize >= given[0]));
    if let Some(&face) = stray.first() {
        let vertex = faces.corners[face as usize].into_iter().find(|&v| v as usize >= given[0]).unwrap_or_default();
        found.refuse(MeshError::IndexOutOfRange { face: u64::from(face), vertex, vertices: given[0] });
        found.defects.extend(tally(&stray).into_defect(DefectKind::IndexOutOfRange, |f| f));
        faces.drop_faces(&stray);
    }

    refuse_bad_coordinates(&positions, &mut faces, options, &mut found);

    let equal = equal_positions(&positions);
    let merges = match options.merge {
        Merge::Always => true,
        Merge::Auto => splits_vertices,
        Merge::Never => false,
    };
    if merges && !equal.is_empty() {
        let mut first: Vec<u32> = (0..given[0] as u32).collect();
        equal.iter().for_each(|&(vertex, earlier)| first[vertex as usize] = earlier);
        faces.corners.par_iter_mut().for_each(|face| *face = face.map(|v| first[v as usize]));
        found.repair(RepairKind::MergedVertices, equal.len());
    } else {
        let vertices: Vec<u32> = equal.iter().map(|pair| pair.0).collect();
        found.defects.extend(tally(&vertices).into_defect(DefectKind::EqualPosition, |v| v));
    }

    let repeating = faces.select(|&[a, b, c]| a == b || b == c || c == a);
    found.defects.extend(tally(&repeating).into_defect(DefectKind::RepeatedVertex, |f| faces.origin(f)));
    found.repair(RepairKind::DroppedRepeatedVertexFaces, repeating.len());
    faces.drop_faces(&repeating);

    let mut table = EdgeTable::new(given[0], &faces.corners);
    let duplicates = table.duplicate_faces(&faces.corners);
    if !duplicates.is_empty() {
        found.defects.extend(tally(&duplicates).into_defect(DefectKind::DuplicateFace, |f| faces.origin(f)));
        found.repair(RepairKind::DroppedDuplicateFaces, duplicates.len());
        faces.drop_faces(&duplicates);
        table = EdgeTable::new(given[0], &faces.corners);
    }

    let topology = Topology::new(&table, &faces.corners);
    drop(table);
    let flat = faces.select(|&face| doubled_area(&positions, face) == 0.0);
    found.defects.extend(tally(&flat).into_defect(DefectKind::ZeroArea, |f| faces.origin(f)));
    let (flipped, orientable) = topology.orient(&mut faces.corners);
    found.repair(RepairKind::FlippedFaces, flipped);

    // Merged vertices have no faces either; they are listed already.
    let mut unreferenced = Tally::default();
    let mut merged = equal.iter().take_while(|_| merges).map(|pair| pair.0).peekable();
    for (v, &valence) in topology.valences.iter().enumerate() {
        if merged.next_if_eq(&(v as u32)).is_none() && valence == 0 {
            unreferenced.add(v as u64);
        }
    }
    found.repair(RepairKind::DroppedUnreferencedVertices, unreferenced.count);
    let all_used = unreferenced.count == 0 && !(merges && !equal.is_empty());
    let vertex_map = (!all_used).then(|| {
        let mut numbers = compact(&mut positions, &mut faces.corners, |v| topology.valences[v] > 0);
        if merges {
            equal.iter().for_each(|&(vertex, earlier)| numbers[vertex as usize] = numbers[earlier as usize]);
        }
        numbers
    });

    report.vertices = positions.len();
    report.faces = faces.corners.len();
    report.edges = topology.edges;
    report.area = total_area(&positions, &faces.corners);
    report.bounding_box = bounding_box(&positions);
    report.euler_characteristic = report.vertices as i64 - report.edges as i64 + report.faces as i64;
    report.components = topology.components;
    report.boundary_edges = topology.boundary_edges;
    report.boundary_loops = topology.boundary_loops;
    report.closed = report.faces > 0 && report.boundary_edges == 0;
    report.manifold = topology.non_manifold_edges.count == 0 && topology.non_manifold_vertices.count == 0;
    report.orientable = orientable;
    report.genus = (report.manifold && orientable)
        .then(|| report.components as i64 - (report.euler_characteristic + report.boundary_loops as i64) / 2);

    if report.faces == 0 {
        found.refuse(match tetrahedra.len() {
            0 => MeshError::NoFaces { given: given[1], vertices: given[0] },
            tetrahedra => MeshError::OnlyTetrahedra { tetrahedra },
        });
    } else {
        let [low, high] = report.bounding_box;
        let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        if extent > 0.0 && extent < options.smallest_extent {
            found.refuse(MeshError::TooSmall { extent, smallest: options.smallest_extent });
        } else if report.area <= 0.0 {
            found.refuse(MeshError::NoArea { faces: report.faces });
        }
    }

    for (kind, tally) in [
        (DefectKind::NonManifoldEdge, topology.non_manifold_edges),
        (DefectKind::NonManifoldVertex, topology.non_manifold_vertices),
        (DefectKind::InconsistentOrientation, topology.inconsistent_edges),
        (DefectKind::UnreferencedVertex, unreferenced),
    ] {
        let origin = |i| if kind.element() == Element::Face { faces.origin(i) } else { i };
        found.defects.extend(tally.into_defect(kind, origin));
    }
    found.defects.sort_by_key(|defect| defect.kind);
    report.defects = found.defects;
    report.repairs = found.repairs;
    let mesh = TriangleMesh { positions, faces: faces.corners };
    Examined { mesh, report, vertex_map, error: found.error }
}

#[derive(Default)]
struct Found {
    defects: Vec<Defect>,
    repairs: Vec<Repair>,
    error: Option<MeshError>,
}

impl Found {
    fn refuse(&mut self, error: MeshError) {
        self.error.get_or_insert(error);
    }

    fn repair(&mut self, kind: RepairKind, count: usize) {
        if count > 0 {
            self.repairs.push(Repair { kind, count });
        }
    }
}

/// Counts vertices that are not finite or out of range, and refuses the mesh if a face uses one; such faces go.
fn refuse_bad_coordinates(positions: &[[f64; 3]], faces: &mut Faces, options: &CheckOptions, found: &mut Found) {
    let largest = options.largest_coordinate;
    // The comparison is false for NaN.
    let bad = |v: usize| !positions[v].iter().all(|x| x.abs() <= largest);
    if !(0..positions.len()).into_par_iter().any(bad) {
        return;
    }
    let (mut non_finite, mut out_of_range) = (Tally::default(), Tally::default());
    for v in (0..positions.len()).filter(|&v| bad(v)) {
        if positions[v].iter().all(|x| x.is_finite()) { out_of_range.add(v as u64) } else { non_finite.add(v as u64) }
    }
    found.defects.extend(non_finite.into_defect(DefectKind::NonFinite, |v| v));
    found.defects.extend(out_of_range.into_defect(DefectKind::OutOfRange, |v| v));
    let users = faces.select(|face| face.iter().any(|&v| bad(v as usize)));
    if let Some(&user) = users.first() {
        let vertex = faces.corners[user as usize].into_iter().find(|&v| bad(v as usize)).unwrap_or_default();
        let face = faces.origin(u64::from(user));
        found.refuse(if positions[vertex as usize].iter().all(|x| x.is_finite()) {
            let coordinate = positions[vertex as usize].into_iter().find(|x| x.abs() > largest).unwrap_or_default();
            MeshError::OutOfRange { vertex, coordinate, largest, face }
        } else {
            MeshError::NonFinite { vertex, face }
        });
        faces.drop_faces(&users);
    }
}

fn tally(indices: &[u32]) -> Tally {
    let mut tally = Tally::default();
    indices.iter().for_each(|&index| tally.add(u64::from(index)));
    tally
}

/// Twice the area of a face.
fn doubled_area(positions: &[[f64; 3]], face: [u32; 3]) -> f64 {
    let [p, q, r] = face.map(|v| positions[v as usize]);
    let (e, f): ([f64; 3], [f64; 3]) = (std::array::from_fn(|i| q[i] - p[i]), std::array::from_fn(|i| r[i] - p[i]));
    let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    (normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]).sqrt()
}

/// The total area, added up in an order that does not depend on the number of threads.
fn total_area(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
    let chunks = faces.par_chunks(1 << 14);
    let sums: Vec<f64> = chunks.map(|chunk| chunk.iter().map(|&face| doubled_area(positions, face)).sum()).collect();
    sums.into_iter().sum::<f64>() / 2.0
}

/// The least and greatest coordinates of the finite positions; zeros where there are none.
fn bounding_box(positions: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let mut corners = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for position in positions.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
        for axis in 0..3 {
            corners[0][axis] = corners[0][axis].min(position[axis]);
            corners[1][axis] = corners[1][axis].max(position[axis]);
        }
    }
    if corners[0][0] > corners[1][0] { [[0.0; 3]; 2] } else { corners }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    fn corners() -> Vec<[f64; 3]> {
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
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
        let CheckedMesh { mesh, report, vertex_map } = checked(raw(corners(), TETRAHEDRON.to_vec()));
        assert_eq!((mesh.positions, mesh.faces, vertex_map), (corners(), TETRAHEDRON.to_vec(), None));
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
        let CheckedMesh { mesh, report, vertex_map } = checked(raw(positions, faces));
        assert_eq!((mesh.positions, mesh.faces), (corners(), TETRAHEDRON.to_vec()));
        assert_eq!(vertex_map, Some(vec![0, DROPPED, 1, 2, 3, DROPPED]));
        let examples = |kind| report.defects.iter().find(|d| d.kind == kind).map(|d| d.examples.clone());
        assert_eq!(examples(DefectKind::NonFinite), Some(vec![1]));
        assert_eq!(examples(DefectKind::RepeatedVertex), Some(vec![0, 7]));
        assert_eq!(examples(DefectKind::DuplicateFace), Some(vec![5, 6]));
        assert_eq!(examples(DefectKind::UnreferencedVertex), Some(vec![1, 5]));
        assert_eq!(report.defects.len(), 4);
        assert_eq!(report.repaired(RepairKind::DroppedDuplicateFaces), 2);
        assert_eq!(report.repaired(RepairKind::DroppedUnreferencedVertices), 2);
    }

    #[test]
    fn equal_positions_are_merged_where_the_format_splits_them_and_hinted_at_elsewhere() {
        let positions: Vec<[f64; 3]> = TETRAHEDRON.iter().flatten().map(|&v| corners()[v as usize]).collect();
        let split = raw(positions, (0..4).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect());
        let apart = checked(split.clone());
        assert_eq!((apart.report.components, apart.report.count(DefectKind::EqualPosition)), (4, 8));
        assert_eq!((apart.vertex_map, apart.report.boundary_loops), (None, 4));
        let merged = checked(RawMesh { splits_vertices: true, ..split.clone() });
        assert_eq!((merged.report.vertices, merged.report.genus), (4, Some(0)));
        assert_eq!(merged.report.repairs, [Repair { kind: RepairKind::MergedVertices, count: 8 }]);
        assert_eq!(merged.vertex_map, Some(vec![0, 1, 2, 0, 2, 3, 2, 1, 3, 1, 0, 3]));
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
}
