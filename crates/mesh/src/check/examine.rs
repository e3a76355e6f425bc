//! The examination of a mesh, step by step: what is wrong with it, what is mended, and what the report says.

use std::sync::Arc;

use chladni_base::Vector3;
use chladni_base::parallel::*;

use super::extent::{bounding_box, total_area};
use super::{CheckOptions, Merge, MeshError};
use crate::TriangleMesh;
use crate::attributes::Attributes;
use crate::intrinsic::TriangleShape;
use crate::numbering::{self, Numbering, nearest_vertices};
use crate::read::{Polygons, RawMesh};
use crate::repair::{DROPPED, Faces, compact, equal_positions};
use crate::report::{Defect, DefectKind, Element, FileSize, MeshReport, Repair, RepairKind, Tally};
use crate::subdivide::subdivided;
use crate::topology::{EdgeTable, MOST_FACES, Topology};

/// What an examination comes to.
pub(super) struct Examined {
    pub mesh: TriangleMesh,
    pub report: MeshReport,
    pub numbering: Numbering,
    pub attributes: Option<Attributes>,
    /// The first reason to refuse the mesh; the mesh is then not to be used, but the report still tells what it can.
    pub error: Option<MeshError>,
}

/// Goes through a mesh, mends what can be mended without loss, and says the first reason to refuse it.
pub(super) fn examine(raw: RawMesh, options: &CheckOptions) -> Examined {
    let given = [raw.positions.len(), raw.faces.len()];
    let mut report = MeshReport { vertices: given[0], faces: given[1], ..MeshReport::default() };
    if let Some(error) = too_large(given) {
        let (mesh, numbering) = (TriangleMesh::default(), Numbering::default());
        return Examined { mesh, report, numbering, attributes: None, error: Some(error) };
    }
    // Corners are found again by their vertices.
    let with_corners = raw.attributes.map(|own| (own, raw.faces.clone()));
    let mut at = Examination {
        given,
        positions: raw.positions,
        faces: Faces::new(raw.faces),
        found: Findings::default(),
        vertex_map: None,
        unused: Vec::new(),
    };
    at.found.repair(RepairKind::TriangulatedPolygons, raw.polygons_triangulated);
    at.found.repair(RepairKind::DroppedShortFaces, raw.short_faces_dropped);
    at.drop_stray_faces();
    refuse_bad_coordinates(&at.positions, &at.faces, options, &mut at.found);
    let merged = at.merge_vertices(match options.merge {
        Merge::Always => true,
        Merge::Auto => raw.splits_vertices,
        Merge::Never => false,
    });
    at.drop_repeating_faces();
    let topology = at.drop_duplicate_faces();
    let orientable = at.orient(&topology);
    let unreferenced = at.drop_unreferenced_vertices(&topology, &merged);
    at.measure(&mut report, &topology, orientable);
    at.refuse_without_area(&report, raw.tetrahedra.len(), options.smallest_extent);
    at.tell_defects(topology, unreferenced);
    report.defects = std::mem::take(&mut at.found.defects);
    report.repairs = std::mem::take(&mut at.found.repairs);
    let attributes = with_corners.map(|(own, given_faces)| {
        report.attributes = Some(own.attributes.report(own.missing));
        let origin = |face: u32| at.faces.origin(u64::from(face)) as u32;
        own.attributes.repaired(&given_faces, at.vertex_map.as_deref(), &at.faces.corners, origin)
    });
    at.finish(report, raw.polygons, attributes, options)
}

/// Why so many vertices and faces are not even looked at.
fn too_large([vertices, faces]: [usize; 2]) -> Option<MeshError> {
    let of = |elements, count, most| (count > most).then_some(MeshError::TooLarge { elements, count, most });
    of("vertices", vertices, DROPPED as usize - 1).or_else(|| of("faces", faces, MOST_FACES))
}

/// A mesh, mended as far as it was gone through.
struct Examination {
    /// Vertices and faces of the input.
    given: [usize; 2],
    positions: Vec<[f64; 3]>,
    faces: Faces,
    found: Findings,
    /// Where each vertex of the input went, unless all are where they were.
    vertex_map: Option<Vec<u32>>,
    /// The positions of vertices of the input that no face uses, by ascending number, and these.
    unused: Vec<(u32, [f64; 3])>,
}

impl Examination {
    /// Faces of vertices that there are not.
    fn drop_stray_faces(&mut self) {
        let vertices = self.given[0];
        let stray = self.faces.select(|face| face.iter().any(|&v| v as usize >= vertices));
        let Some(&face) = stray.first() else { return };
        let corners = self.faces.corners[face as usize];
        let vertex = corners.into_iter().find(|&v| v as usize >= vertices).unwrap_or_default();
        self.found.refuse(MeshError::IndexOutOfRange { face: u64::from(face), vertex, vertices });
        self.found.defects.extend(tally(&stray).into_defect(DefectKind::IndexOutOfRange, |f| f));
        self.faces.drop_faces(&stray);
    }

    /// Makes one of vertices at equal positions if that is wanted: gives each that was merged, ascending, with the one
    /// that it became a part of.
    fn merge_vertices(&mut self, wanted: bool) -> Vec<(u32, u32)> {
        let equal = equal_positions(&self.positions);
        if !wanted {
            let vertices: Vec<u32> = equal.iter().map(|pair| pair.0).collect();
            self.found.defects.extend(tally(&vertices).into_defect(DefectKind::EqualPosition, |v| v));
            return Vec::new();
        }
        if !equal.is_empty() {
            let mut first: Vec<u32> = (0..self.given[0] as u32).collect();
            equal.iter().for_each(|&(vertex, earlier)| first[vertex as usize] = earlier);
            self.faces.corners.par_iter_mut().for_each(|face| *face = face.map(|v| first[v as usize]));
            self.found.repair(RepairKind::MergedVertices, equal.len());
        }
        equal
    }

    fn drop_repeating_faces(&mut self) {
        let repeating = self.faces.select(|&[a, b, c]| a == b || b == c || c == a);
        let defect = tally(&repeating).into_defect(DefectKind::RepeatedVertex, |f| self.faces.origin(f));
        self.found.defects.extend(defect);
        self.found.repair(RepairKind::DroppedRepeatedVertexFaces, repeating.len());
        self.faces.drop_faces(&repeating);
    }

    /// Gives the topology of what is left: edges that are manifold without the copies of faces are no defects.
    fn drop_duplicate_faces(&mut self) -> Topology {
        let table = EdgeTable::new(self.given[0], &self.faces.corners);
        let duplicates = table.duplicate_faces(&self.faces.corners);
        if duplicates.is_empty() {
            return Topology::new(&table, &self.faces.corners);
        }
        let origin = |f| self.faces.origin(f);
        self.found.defects.extend(tally(&duplicates).into_defect(DefectKind::DuplicateFace, origin));
        self.found.repair(RepairKind::DroppedDuplicateFaces, duplicates.len());
        drop(table);
        self.faces.drop_faces(&duplicates);
        let table = EdgeTable::new(self.given[0], &self.faces.corners);
        Topology::new(&table, &self.faces.corners)
    }

    /// Turns faces over so that neighbours agree, and says whether all do.
    fn orient(&mut self, topology: &Topology) -> bool {
        // What operators take for one without area: next to the longest edges nothing is left of it in double
        // precision.
        let corners = |face: [u32; 3]| face.map(|vertex| Vector3(self.positions[vertex as usize]));
        let flat = self.faces.select(|&face| TriangleShape::of_corners(corners(face)).area == 0.0);
        let defect = tally(&flat).into_defect(DefectKind::ZeroArea, |f| self.faces.origin(f));
        self.found.defects.extend(defect);
        let (flipped, orientable) = topology.orient(&mut self.faces.corners);
        self.found.repair(RepairKind::FlippedFaces, flipped);
        orientable
    }

    /// Drops what no face uses. Merged vertices have no faces either; they are listed already.
    fn drop_unreferenced_vertices(&mut self, topology: &Topology, merged: &[(u32, u32)]) -> Tally {
        let mut unreferenced = Tally::default();
        let mut listed = merged.iter().map(|pair| pair.0).peekable();
        for (v, &valence) in topology.valences.iter().enumerate() {
            if listed.next_if_eq(&(v as u32)).is_none() && valence == 0 {
                unreferenced.add(v as u64);
            }
        }
        self.found.repair(RepairKind::DroppedUnreferencedVertices, unreferenced.count);
        if unreferenced.count > 0 {
            let gone = (0..self.given[0]).filter(|&v| topology.valences[v] == 0);
            self.unused = gone.map(|v| (v as u32, self.positions[v])).collect();
        }
        if unreferenced.count > 0 || !merged.is_empty() {
            let mut map = compact(&mut self.positions, &mut self.faces.corners, |v| topology.valences[v] > 0);
            merged.iter().for_each(|&(vertex, earlier)| map[vertex as usize] = map[earlier as usize]);
            self.vertex_map = Some(map);
        }
        unreferenced
    }

    /// Counts and sizes of what is left.
    fn measure(&self, report: &mut MeshReport, topology: &Topology, orientable: bool) {
        report.vertices = self.positions.len();
        report.faces = self.faces.corners.len();
        report.edges = topology.edges;
        report.area = total_area(&self.positions, &self.faces.corners).min(f64::MAX);
        report.bounding_box = bounding_box(&self.positions);
        report.euler_characteristic = report.vertices as i64 - report.edges as i64 + report.faces as i64;
        report.components = topology.components;
        report.boundary_edges = topology.boundary_edges;
        report.boundary_loops = topology.boundary_loops;
        report.closed = report.faces > 0 && report.boundary_edges == 0;
        report.manifold = topology.non_manifold_edges.count == 0 && topology.non_manifold_vertices.count == 0;
        report.orientable = orientable;
        report.genus = (report.manifold && orientable && report.faces > 0)
            .then(|| report.components as i64 - (report.euler_characteristic + report.boundary_loops as i64) / 2);
    }

    /// Refuses what has no surface, or too small a one.
    fn refuse_without_area(&mut self, report: &MeshReport, tetrahedra: usize, smallest: f64) {
        if report.faces == 0 {
            let [vertices, given] = self.given;
            self.found.refuse(match tetrahedra {
                0 => MeshError::NoFaces { given, vertices },
                tetrahedra => MeshError::OnlyTetrahedra { tetrahedra },
            });
            return;
        }
        let [low, high] = report.bounding_box;
        let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        if extent > 0.0 && extent < smallest {
            self.found.refuse(MeshError::TooSmall { extent, smallest });
        } else if report.area <= 0.0 {
            self.found.refuse(MeshError::NoArea { faces: report.faces });
        }
    }

    /// The defects that nothing mends, those found before among them, in the order of their kinds.
    fn tell_defects(&mut self, topology: Topology, unreferenced: Tally) {
        let Self { faces, found, .. } = self;
        let edges = topology.non_manifold_edges;
        found.defects.extend(edges.into_defect(DefectKind::NonManifoldEdge, |f| faces.origin(f)));
        for (kind, tally) in [
            (DefectKind::NonManifoldVertex, topology.non_manifold_vertices),
            (DefectKind::InconsistentOrientation, topology.inconsistent_edges),
            (DefectKind::UnreferencedVertex, unreferenced),
        ] {
            let origin = |i| if kind.element() == Element::Face { faces.origin(i) } else { i };
            found.defects.extend(tally.into_defect(kind, origin));
        }
        found.defects.sort_by_key(|defect| defect.kind);
    }

    /// For each vertex that no face uses, the nearest that is left.
    fn nearest_left(&self) -> Vec<u32> {
        let Some(map) = &self.vertex_map else { return Vec::new() };
        if self.found.error.is_some() || self.unused.is_empty() {
            return Vec::new();
        }
        // Merged vertices without faces are dropped only where the one that they merged with is.
        let positions: Vec<[f64; 3]> = self.unused.iter().map(|unused| unused.1).collect();
        let left = self.unused.iter().zip(nearest_vertices(&self.positions, &positions));
        left.filter(|((v, _), _)| map[*v as usize] == DROPPED).map(|(_, near)| near).collect()
    }

    /// The mesh, divided as often as asked, with what goes with it.
    fn finish(
        self,
        mut report: MeshReport,
        polygons: Option<Polygons>,
        mut attributes: Option<Attributes>,
        options: &CheckOptions,
    ) -> Examined {
        let nearest = self.nearest_left();
        let Self { given, positions, faces, vertex_map, found: Findings { mut error, .. }, .. } = self;
        let numbered = numbering::MeshNumbering {
            file: [given[0], polygons.as_ref().map_or(given[1], |polygons| polygons.count)],
            vertices: vertex_map,
            faces: face_origins(&faces, polygons),
            nearest,
            inner: 0,
        };
        let mut mesh = TriangleMesh { positions, faces: faces.corners, ..Default::default() };
        let mut numbering = Numbering::found(numbered, [mesh.positions.len(), mesh.faces.len()]);
        if error.is_none() {
            error = subdivide(&mut mesh, &mut report, options).err();
            if error.is_none() {
                numbering = numbering.divided(&mesh, options.subdivisions);
                for _ in 0..options.subdivisions {
                    attributes = attributes.map(Attributes::divided);
                }
            }
        }
        report.file = FileSize::of(&numbering);
        mesh.polygons = crate::polygons::Polygons::of(&numbering).map(Arc::new);
        report.polygons = mesh.polygons.as_ref().map_or(0, |polygons| polygons.loops(&mesh.faces).len());
        let attributes = attributes.filter(|attributes| !attributes.is_empty());
        Examined { mesh, report, numbering, attributes, error }
    }
}

/// The face of the file that each face left is or is a part of; `None` where they are the same.
fn face_origins(faces: &Faces, polygons: Option<Polygons>) -> Option<Vec<u32>> {
    match (faces.origins(), polygons) {
        (None, None) => None,
        (Some(origins), None) => Some(origins.to_vec()),
        (None, Some(polygons)) => Some(polygons.of_triangle),
        (Some(origins), Some(polygons)) => {
            Some(origins.iter().map(|&triangle| polygons.of_triangle[triangle as usize]).collect())
        }
    }
}

/// Divides every face into four, as often as asked, and brings the counts up to date. What defects name keeps its
/// number in the input.
fn subdivide(mesh: &mut TriangleMesh, report: &mut MeshReport, options: &CheckOptions) -> Result<(), MeshError> {
    let factor = 4usize.checked_pow(u32::from(options.subdivisions)).unwrap_or(usize::MAX);
    let (count, most) = (mesh.faces.len().saturating_mul(factor), options.most_faces.min(MOST_FACES));
    // A mesh as it was given is measured against its own limits.
    if options.subdivisions > 0 && count > most {
        return Err(MeshError::TooLarge { elements: "faces", count, most });
    }
    for _ in 0..options.subdivisions {
        *mesh = subdivided(mesh).ok_or(MeshError::TooLarge { elements: "faces", count, most })?;
        report.edges = 2 * report.edges + 3 * report.faces;
        report.boundary_edges *= 2;
        report.vertices = mesh.positions.len();
        report.faces = mesh.faces.len();
    }
    report.subdivisions = options.subdivisions;
    Ok(())
}

/// What was found and mended so far.
#[derive(Default)]
pub(super) struct Findings {
    pub defects: Vec<Defect>,
    pub repairs: Vec<Repair>,
    /// The first reason to refuse the mesh.
    pub error: Option<MeshError>,
}

impl Findings {
    pub fn refuse(&mut self, error: MeshError) {
        self.error.get_or_insert(error);
    }

    pub fn repair(&mut self, kind: RepairKind, count: usize) {
        if count > 0 {
            self.repairs.push(Repair { kind, count });
        }
    }
}

/// Counts vertices that are not finite or out of range, and refuses the mesh if a face uses one.
fn refuse_bad_coordinates(positions: &[[f64; 3]], faces: &Faces, options: &CheckOptions, found: &mut Findings) {
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
    }
}

pub(super) fn tally(indices: &[u32]) -> Tally {
    let mut tally = Tally::default();
    indices.iter().for_each(|&index| tally.add(u64::from(index)));
    tally
}
