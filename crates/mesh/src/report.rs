//! What a check found and what it repaired, in words and in numbers.

use serde::{Deserialize, Serialize};
use std::fmt;

/// How many offenders of each kind a report names.
pub const EXAMPLES: usize = 5;

/// What is known about a triangle mesh after it was checked and repaired.
///
/// Counts and topology describe the mesh as it will be used, after the repairs. Defects describe the mesh as it was
/// given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct MeshReport {
    /// Vertices, `n`.
    pub vertices: usize,
    /// Faces, `f`.
    pub faces: usize,
    /// Edges: pairs of vertices that some face joins.
    pub edges: usize,
    /// Total area, in squared units of the input.
    pub area: f64,
    /// The least and the greatest coordinates, in units of the input; zeros where no vertex is finite.
    #[cfg_attr(feature = "schema", schema(min_items = 2, max_items = 2))]
    pub bounding_box: [[f64; 3]; 2],
    /// `χ = n − edges + f`.
    pub euler_characteristic: i64,
    /// Connected components, joined through vertices: the dimension of the kernel of the stiffness matrix, as long as
    /// no part hangs on by zero-area faces alone.
    pub components: usize,
    /// Edges with one face.
    pub boundary_edges: usize,
    /// Closed chains of boundary edges, followed around one fan of faces at a time. A chain that ends at a non-manifold
    /// edge counts as one.
    pub boundary_loops: usize,
    /// The genus of each component, summed: `components − (χ + boundary_loops) / 2`. `None` unless the mesh is manifold
    /// and orientable.
    pub genus: Option<i64>,
    /// Whether there are faces and every edge has at least two.
    pub closed: bool,
    /// Whether every edge has at most two faces and the faces around every vertex form one fan.
    pub manifold: bool,
    /// Whether the faces can be turned so that the two faces of every manifold edge run along it in opposite
    /// directions.
    pub orientable: bool,
    /// Whether the file has points without faces. Area and components are then those of the triangles that are made
    /// around each point.
    #[serde(default, skip_serializing_if = "is_false")]
    pub points: bool,
    /// Polygons of more than three corners that keep their shape: the Laplacian is made of them, not of the triangles
    /// that they were cut into.
    #[serde(default, skip_serializing_if = "is_none_of_them")]
    pub polygons: usize,
    /// What is inside, where the mesh is the surface of a solid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solid: Option<super::solid::SolidReport>,
    /// How often every face was divided into four.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub subdivisions: u8,
    /// Which surface this is, where the file has tetrahedra.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<super::check::SurfaceOf>,
    /// Vertices and faces of the file, where it numbers them in another way than the mesh that was made of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<FileSize>,
    /// Texture coordinates, normals and names that are kept, where the file has any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attributes: Option<super::attributes::AttributeReport>,
    /// What is wrong with the mesh as given, by kind; kinds that do not occur are left out.
    pub defects: Vec<Defect>,
    /// What was done about it; none of it loses anything, but for [`RepairKind::LeftOutTetrahedra`], which is done on
    /// request alone.
    pub repairs: Vec<Repair>,
}

fn is_zero(count: &u8) -> bool {
    *count == 0
}

fn is_none_of_them(count: &usize) -> bool {
    *count == 0
}

fn is_false(flag: &bool) -> bool {
    !flag
}

/// What a file has, and what became of its vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FileSize {
    /// Vertices of the file.
    pub vertices: usize,
    /// Faces of the file, a polygon counted once.
    pub faces: usize,
    /// Vertices of the file that have no counterpart in the mesh.
    pub dropped: usize,
    /// Vertices of the file that became one with an earlier one.
    pub merged: usize,
}

impl FileSize {
    /// What there is to say of a numbering; `None` where it is that of the mesh.
    pub(super) fn of(numbering: &super::numbering::Numbering) -> Option<Self> {
        (!numbering.is_identity()).then(|| Self {
            vertices: numbering.file_vertices(),
            faces: numbering.file_faces(),
            dropped: numbering.dropped_vertices(),
            merged: numbering.merged_vertices(),
        })
    }
}

impl MeshReport {
    /// How many defects of one kind were found.
    pub fn count(&self, kind: DefectKind) -> usize {
        self.defects.iter().find(|d| d.kind == kind).map_or(0, |d| d.count)
    }

    /// How many elements one kind of repair touched.
    pub fn repaired(&self, kind: RepairKind) -> usize {
        self.repairs.iter().find(|r| r.kind == kind).map_or(0, |r| r.count)
    }
}

/// One kind of defect, how often it occurs, and the first offenders.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Defect {
    /// What is wrong.
    pub kind: DefectKind,
    /// How often.
    pub count: usize,
    /// What the examples number.
    pub element: Element,
    /// The first offenders (at most [`EXAMPLES`]), numbered from 0 as in the input. An edge is named by a face beside
    /// it.
    pub examples: Vec<u64>,
}

/// What an index in a report counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Element {
    /// Vertices of the input.
    Vertex,
    /// Faces of the input.
    Face,
    /// Tetrahedra of the input.
    Tetrahedron,
}

/// The kinds of defect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum DefectKind {
    /// A face refers to a vertex that does not exist. Such a mesh is refused.
    IndexOutOfRange,
    /// A coordinate is NaN or infinite. A mesh whose faces use such a vertex is refused.
    NonFinite,
    /// A coordinate is so large that areas lose their meaning. A mesh whose faces use such a vertex is refused.
    OutOfRange,
    /// A face names a vertex twice.
    RepeatedVertex,
    /// A face has three vertices and no area. It is kept, since dropping it would open a hole, and contributes nothing.
    ZeroArea,
    /// A face names the same vertices in the same direction as an earlier one.
    DuplicateFace,
    /// No face uses this vertex.
    UnreferencedVertex,
    /// A vertex stands exactly where an earlier one does, and was not merged with it.
    EqualPosition,
    /// An edge has three or more faces.
    NonManifoldEdge,
    /// The faces around a vertex form more than one fan, though none of its edges is non-manifold.
    NonManifoldVertex,
    /// Both faces of an edge run along it in the same direction.
    InconsistentOrientation,
    /// The file has tetrahedra, and this triangle of it is not on their boundary.
    TriangleOffBoundary,
    /// The file has triangles and tetrahedra, and a side of this tetrahedron that has no neighbour is not among the
    /// triangles.
    BoundaryNotGiven,
    /// Of points without faces: the nearest neighbours of this one fill space, and lie on no surface, or on one that is
    /// folded within their distance.
    OffSurface,
    /// Of points without faces: this one has a triangle around it that another of the triangle's corners does not have.
    /// Reported where more than 1 % of all triangles are disputed, as on limbs that are as thin as the spacing of the
    /// points: eigenvalues may then be off by several per cent.
    DisputedTriangle,
}

impl DefectKind {
    /// What the examples of this kind number.
    pub fn element(self) -> Element {
        match self {
            Self::NonFinite
            | Self::OutOfRange
            | Self::UnreferencedVertex
            | Self::EqualPosition
            | Self::OffSurface
            | Self::DisputedTriangle
            | Self::NonManifoldVertex => Element::Vertex,
            Self::IndexOutOfRange
            | Self::RepeatedVertex
            | Self::ZeroArea
            | Self::DuplicateFace
            | Self::NonManifoldEdge
            | Self::InconsistentOrientation
            | Self::TriangleOffBoundary => Element::Face,
            Self::BoundaryNotGiven => Element::Tetrahedron,
        }
    }
}

impl fmt::Display for DefectKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::IndexOutOfRange => "faces that refer to missing vertices",
            Self::NonFinite => "vertices that are not finite",
            Self::OutOfRange => "vertices out of range",
            Self::RepeatedVertex => "faces that repeat a vertex",
            Self::ZeroArea => "faces without area",
            Self::DuplicateFace => "duplicate faces",
            Self::UnreferencedVertex => "unreferenced vertices",
            Self::EqualPosition => "vertices at equal positions",
            Self::NonManifoldEdge => "non-manifold edges",
            Self::NonManifoldVertex => "non-manifold vertices",
            Self::InconsistentOrientation => "edges between faces of opposite orientation",
            Self::TriangleOffBoundary => "triangles that are not on the boundary of the tetrahedra",
            Self::BoundaryNotGiven => "boundary triangles of tetrahedra that the file does not give",
            Self::OffSurface => "points whose neighbours lie on no surface",
            Self::DisputedTriangle => {
                "points whose triangles their neighbours dispute: eigenvalues may be off by several per cent"
            }
        })
    }
}

/// One kind of repair and how many elements it touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Repair {
    /// What was done.
    pub kind: RepairKind,
    /// To how many elements.
    pub count: usize,
}

/// The kinds of repair, in the order in which they are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum RepairKind {
    /// Polygons of more than three corners were cut into triangles.
    TriangulatedPolygons,
    /// Faces of fewer than three corners were dropped.
    DroppedShortFaces,
    /// Vertices were merged with an earlier one at the same position.
    MergedVertices,
    /// Faces that repeat a vertex were dropped.
    DroppedRepeatedVertexFaces,
    /// Faces equal to an earlier one were dropped.
    DroppedDuplicateFaces,
    /// Faces were turned over so that neighbours agree.
    FlippedFaces,
    /// Vertices that no face uses were dropped.
    DroppedUnreferencedVertices,
    /// Tetrahedra were left out, since the triangles of the file were asked for.
    LeftOutTetrahedra,
}

impl fmt::Display for RepairKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TriangulatedPolygons => "polygons triangulated",
            Self::DroppedShortFaces => "faces of fewer than three corners dropped",
            Self::MergedVertices => "vertices merged with others at the same position",
            Self::DroppedRepeatedVertexFaces => "faces that repeat a vertex dropped",
            Self::DroppedDuplicateFaces => "duplicate faces dropped",
            Self::FlippedFaces => "faces turned over",
            Self::DroppedUnreferencedVertices => "unreferenced vertices dropped",
            Self::LeftOutTetrahedra => "tetrahedra left out",
        })
    }
}

/// Counts offenders and keeps the first few.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    pub(super) count: usize,
    pub(super) examples: Vec<u64>,
}

impl Tally {
    pub(super) fn add(&mut self, index: u64) {
        self.count += 1;
        if self.examples.len() < EXAMPLES {
            self.examples.push(index);
        }
    }

    /// Appends a tally of later elements.
    pub(super) fn append(mut self, later: Self) -> Self {
        self.count += later.count;
        let room = EXAMPLES - self.examples.len();
        self.examples.extend(later.examples.into_iter().take(room));
        self
    }

    /// The defect this tally amounts to, if any. `origin` turns indices into those of the input.
    pub(super) fn into_defect(self, kind: DefectKind, origin: impl Fn(u64) -> u64) -> Option<Defect> {
        let Self { count, examples } = self;
        (count > 0).then(|| Defect {
            kind,
            count,
            element: kind.element(),
            examples: examples.into_iter().map(origin).collect(),
        })
    }
}
