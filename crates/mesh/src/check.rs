//! Whether a mesh can be used, what is wrong with it, and the repairs that lose nothing.
//!
//! A mesh that is not manifold is usable: the cotangent stiffness adds up face by face. It is reported, and so is everything
//! else that a client may want to mend. What cannot be used is refused with a [`MeshError`].

use self::extent::{bounding_box, doubled_area, total_area};
use super::TriangleMesh;
use super::attributes::Attributes;
use super::numbering::{self, Numbering, nearest_vertices};
use super::read::{Polygons, RawMesh, ReadLimits};
pub use super::repair::DROPPED;
use super::repair::{Faces, compact, equal_positions};
use super::report::Tally;
pub use super::report::{Defect, DefectKind, EXAMPLES, Element, FileSize, MeshReport, Repair, RepairKind};
use super::subdivide::subdivided;
use super::topology::{EdgeTable, MOST_FACES, Topology};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How often a mesh may be divided: 4096 faces for each.
pub const MOST_SUBDIVISIONS: u8 = 6;

/// Whether vertices at exactly equal positions become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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

/// Which surface a mesh with tetrahedra stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum SurfaceOf {
    /// Where its tetrahedra have no neighbour. The default: that surface is closed and the solid's own, whereas the triangles of such files may be any
    /// part of it, sheets inside it, or another surface altogether.
    #[default]
    Boundary,
    /// The triangles that the file gives. The tetrahedra are left out.
    Given,
}

/// What a check may do and what it takes for usable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckOptions {
    /// Whether vertices at exactly equal positions become one.
    pub merge: Merge,
    /// Which surface is meant where there are tetrahedra.
    pub surface: SurfaceOf,
    /// The largest magnitude of a coordinate. The default, 1e30, also keeps positions finite in single precision.
    pub largest_coordinate: f64,
    /// The smallest usable extent: the longest side of the bounding box. Default 1e-30.
    pub smallest_extent: f64,
    /// How often every face is divided into four, after the repairs. Eigenvalues of the finer mesh are nearer to those of the surface: what
    /// piecewise linear functions lose falls to a quarter each time.
    pub subdivisions: u8,
    /// The most faces that a mesh may have after it was divided; by default as many as a file may hold.
    pub most_faces: usize,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self {
            merge: Merge::Auto,
            surface: SurfaceOf::default(),
            largest_coordinate: 1e30,
            smallest_extent: 1e-30,
            subdivisions: 0,
            most_faces: ReadLimits::default().faces,
        }
    }
}

/// Why a mesh cannot be used. Vertices and faces are numbered from 0 as in the input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There are more vertices or faces than 32-bit tables can number, or than a divided mesh may have.
    #[error("the mesh has {count} {elements}; at most {most} are allowed")]
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
    /// A tetrahedron refers to a vertex that does not exist.
    #[error("tetrahedron {tetrahedron} refers to vertex {vertex} of {vertices}")]
    TetrahedronOutOfRange {
        /// The first such tetrahedron.
        tetrahedron: usize,
        /// The vertex it refers to.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// A tetrahedron uses a vertex that is not finite, or too far out for volumes to have a meaning.
    #[error(
        "vertex {vertex} has a coordinate that is not finite or beyond {largest:e}, and tetrahedron {tetrahedron} uses it"
    )]
    TetrahedronFar {
        /// The first such tetrahedron.
        tetrahedron: usize,
        /// The vertex.
        vertex: u32,
        /// The largest magnitude allowed.
        largest: f64,
    },
    /// Every tetrahedron is flat.
    #[error("none of the {tetrahedra} tetrahedra has a volume")]
    NoVolume {
        /// The number of tetrahedra.
        tetrahedra: usize,
    },
    /// Every face has zero area.
    #[error("all {faces} faces of the mesh have zero area")]
    NoArea {
        /// The number of faces.
        faces: usize,
    },
    /// The faces of a solid cannot be divided without its tetrahedra.
    #[error("a solid cannot be subdivided ({tetrahedra} tetrahedra)")]
    SubdividedSolid {
        /// Tetrahedra in the input.
        tetrahedra: usize,
    },
    /// Points without faces have nothing to divide.
    #[error("points without faces cannot be subdivided ({points} points)")]
    SubdividedPoints {
        /// Points in the input.
        points: usize,
    },
    /// Of points without faces, one is NaN or infinite.
    #[error("point {point} has a coordinate that is not finite")]
    NonFinitePoint {
        /// The first such point.
        point: u32,
    },
    /// Of points without faces, one is too far out.
    #[error("point {point} has a coordinate of {coordinate:e}, beyond {largest:e}")]
    FarPoint {
        /// The first such point.
        point: u32,
        /// Its coordinate.
        coordinate: f64,
        /// The largest magnitude allowed.
        largest: f64,
    },
    /// Points without faces are too few for a surface.
    #[error("{points} points without faces are at {distinct} different positions; a surface needs 4")]
    FewPoints {
        /// Points in the input.
        points: usize,
        /// Of different positions.
        distinct: usize,
    },
    /// Points without faces have no triangles.
    #[error(
        "the {points} points have no faces, and no triangles can be made of them: they lie on a line, or next to one"
    )]
    PointsOnLine {
        /// Points in the input.
        points: usize,
    },
    /// Of points without faces, some had no triangle however often those were left out.
    #[error(
        "the {points} points have no faces, and no surface settles on them: {rounds} times some at which no triangle can be made were left out, and {left} are left"
    )]
    UnsettledPoints {
        /// Points in the input.
        points: usize,
        /// How often points were left out.
        rounds: usize,
        /// Points that are left.
        left: usize,
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
            Self::TetrahedronOutOfRange { .. } => "index-out-of-range",
            Self::TetrahedronFar { .. } => "coordinate-out-of-range",
            Self::NoVolume { .. } => "no-volume",
            Self::NoArea { .. } => "no-area",
            Self::SubdividedSolid { .. } => "subdivided-solid",
            Self::SubdividedPoints { .. } => "subdivided-points",
            Self::NonFinitePoint { .. } => "non-finite-coordinate",
            Self::FarPoint { .. } => "coordinate-out-of-range",
            Self::FewPoints { .. } => "too-few-points",
            Self::PointsOnLine { .. } => "no-area",
            Self::UnsettledPoints { .. } => "unsettled-points",
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
    /// Where the vertices and faces of the input went.
    pub numbering: Numbering,
    /// Texture coordinates, normals and names, of the repaired mesh.
    pub attributes: Option<Attributes>,
}

/// Checks a mesh and repairs what can be repaired without loss.
///
/// Done are, in this order: merging vertices at equal positions (see [`Merge`]), dropping faces that repeat a vertex, dropping
/// faces equal to an earlier one, turning faces over so that neighbours agree, dropping vertices that no face uses; then every face is divided as often
/// as [`CheckOptions::subdivisions`] says. Linear in the size of the mesh up to sorting; runs on the current rayon pool.
///
/// # Errors
/// [`MeshError`] names the first element that makes the mesh unusable.
pub fn check(raw: RawMesh, options: &CheckOptions) -> Result<CheckedMesh, MeshError> {
    let Examined { mesh, report, numbering, attributes, error } = examine(raw, options);
    match error {
        Some(error) => Err(error),
        None => Ok(CheckedMesh { mesh, report, numbering, attributes }),
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
    numbering: Numbering,
    attributes: Option<Attributes>,
    /// The first reason to refuse the mesh; the mesh is then not to be used, but the report still tells what it can.
    error: Option<MeshError>,
}

fn examine(raw: RawMesh, options: &CheckOptions) -> Examined {
    let RawMesh {
        mut positions,
        faces,
        polygons,
        tetrahedra,
        polygons_triangulated,
        short_faces_dropped,
        splits_vertices,
        attributes,
    } = raw;
    let given = [positions.len(), faces.len()];
    let mut report = MeshReport { vertices: given[0], faces: given[1], ..MeshReport::default() };
    for (elements, count, most) in [("vertices", given[0], DROPPED as usize - 1), ("faces", given[1], MOST_FACES)] {
        if count > most {
            let error = Some(MeshError::TooLarge { elements, count, most });
            let (mesh, numbering) = (TriangleMesh::default(), Numbering::default());
            return Examined { mesh, report, numbering, attributes: None, error };
        }
    }
    let mut found = Found::default();
    found.repair(RepairKind::TriangulatedPolygons, polygons_triangulated);
    found.repair(RepairKind::DroppedShortFaces, short_faces_dropped);
    // Corners are found again by their vertices.
    let with_corners = attributes.map(|own| (own, faces.clone()));
    let mut faces = Faces::new(faces);

    let stray = faces.select(|face| face.iter().any(|&v| v as usize >= given[0]));
    if let Some(&face) = stray.first() {
        let vertex = faces.corners[face as usize].into_iter().find(|&v| v as usize >= given[0]).unwrap_or_default();
        found.refuse(MeshError::IndexOutOfRange { face: u64::from(face), vertex, vertices: given[0] });
        found.defects.extend(tally(&stray).into_defect(DefectKind::IndexOutOfRange, |f| f));
        faces.drop_faces(&stray);
    }

    refuse_bad_coordinates(&positions, &faces, options, &mut found);

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
    let mut non_manifold_as_given = None;
    if !duplicates.is_empty() {
        found.defects.extend(tally(&duplicates).into_defect(DefectKind::DuplicateFace, |f| faces.origin(f)));
        found.repair(RepairKind::DroppedDuplicateFaces, duplicates.len());
        non_manifold_as_given =
            Some(table.non_manifold_edges().into_defect(DefectKind::NonManifoldEdge, |f| faces.origin(f)));
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
    let all_used = unreferenced.count == 0 && (!merges || equal.is_empty());
    let gone = |v: &usize| topology.valences[*v] == 0;
    let unused: Vec<[f64; 3]> = match unreferenced.count {
        0 => Vec::new(),
        _ => (0..given[0]).filter(gone).map(|v| positions[v]).collect(),
    };
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
    report.area = total_area(&positions, &faces.corners).min(f64::MAX);
    report.bounding_box = bounding_box(&positions);
    report.euler_characteristic = report.vertices as i64 - report.edges as i64 + report.faces as i64;
    report.components = topology.components;
    report.boundary_edges = topology.boundary_edges;
    report.boundary_loops = topology.boundary_loops;
    report.closed = report.faces > 0 && report.boundary_edges == 0;
    report.manifold = topology.non_manifold_edges.count == 0 && topology.non_manifold_vertices.count == 0;
    report.orientable = orientable;
    report.genus = (report.manifold && orientable && report.faces > 0)
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

    found.defects.extend(
        non_manifold_as_given.unwrap_or_else(|| {
            topology.non_manifold_edges.into_defect(DefectKind::NonManifoldEdge, |f| faces.origin(f))
        }),
    );
    for (kind, tally) in [
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
    let nearest = match &vertex_map {
        Some(map) if found.error.is_none() && !unused.is_empty() => {
            // Merged vertices without faces are dropped only where the one that they merged with is.
            let left = (0..given[0]).filter(gone).zip(nearest_vertices(&positions, &unused));
            left.filter(|(v, _)| map[*v] == DROPPED).map(|(_, near)| near).collect()
        }
        _ => Vec::new(),
    };
    let mut attributes = with_corners.map(|(own, given_faces)| {
        report.attributes = Some(own.attributes.report(own.missing));
        let origin = |face: u32| faces.origin(u64::from(face)) as u32;
        own.attributes.repaired(&given_faces, vertex_map.as_deref(), &faces.corners, origin)
    });
    let numbered = numbering::Found {
        file: [given[0], polygons.as_ref().map_or(given[1], |polygons| polygons.count)],
        vertices: vertex_map,
        faces: face_origins(&faces, polygons),
        nearest,
        inner: 0,
    };
    let mut mesh = TriangleMesh { positions, faces: faces.corners, ..Default::default() };
    let mut numbering = Numbering::found(numbered, [mesh.positions.len(), mesh.faces.len()]);
    if found.error.is_none() {
        found.error = subdivide(&mut mesh, &mut report, options).err();
        if found.error.is_none() {
            numbering = numbering.divided(&mesh, options.subdivisions);
            for _ in 0..options.subdivisions {
                attributes = attributes.map(Attributes::divided);
            }
        }
    }
    report.file = FileSize::of(&numbering);
    mesh.polygons = super::polygons::Polygons::of(&numbering).map(Arc::new);
    report.polygons = mesh.polygons.as_ref().map_or(0, |polygons| polygons.loops(&mesh.faces).len());
    let attributes = attributes.filter(|attributes| !attributes.is_empty());
    Examined { mesh, report, numbering, attributes, error: found.error }
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

/// Divides every face into four, as often as asked, and brings the counts up to date. What defects name keeps its number in the input.
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

/// Counts vertices that are not finite or out of range, and refuses the mesh if a face uses one.
fn refuse_bad_coordinates(positions: &[[f64; 3]], faces: &Faces, options: &CheckOptions, found: &mut Found) {
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

fn tally(indices: &[u32]) -> Tally {
    let mut tally = Tally::default();
    indices.iter().for_each(|&index| tally.add(u64::from(index)));
    tally
}

mod extent;
pub mod points;

#[cfg(test)]
mod naive;
#[cfg(test)]
mod real_meshes;
#[cfg(test)]
mod tests;
