//! Whether a mesh can be used, what is wrong with it, and the repairs that lose nothing.
//!
//! A mesh that is not manifold is usable: the cotangent stiffness adds up face by face. It is reported, and so is
//! everything else that a client may want to mend. What cannot be used is refused with a [`MeshError`].

use self::examine::{Examined, examine};
use super::TriangleMesh;
use super::attributes::Attributes;
use super::numbering::Numbering;
use super::read::{RawMesh, ReadLimits};
pub use super::repair::DROPPED;
pub use super::report::{Defect, DefectKind, EXAMPLES, Element, FileSize, MeshReport, Repair, RepairKind, SurfaceOf};
pub use super::subdivide::MOST_SUBDIVISIONS;
use serde::{Deserialize, Serialize};

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
    /// How often every face is divided into four, after the repairs. Eigenvalues of the finer mesh are nearer to those
    /// of the surface: what piecewise linear functions lose falls to a quarter each time.
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
    #[error("the {points} points have no faces, and no triangles can be made of them: they are (nearly) collinear")]
    PointsOnLine {
        /// Points in the input.
        points: usize,
    },
    /// Of points without faces, some had no triangle however often those were left out.
    #[error(
        "the {points} points have no faces, and no consistent surface was found in {rounds} rounds of dropping points without triangles ({left} are left)"
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
/// Every index is in range, every coordinate finite and in range, no face repeats a vertex or another face, every
/// vertex has a face, the total area is positive, and faces agree in orientation wherever that is possible.
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
/// Done are, in this order: merging vertices at equal positions (see [`Merge`]), dropping faces that repeat a vertex,
/// dropping faces equal to an earlier one, turning faces over so that neighbours agree, dropping vertices that no face
/// uses; then every face is divided as often as [`CheckOptions::subdivisions`] says. Linear in the size of the mesh up
/// to sorting; runs on the current rayon pool.
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

mod examine;
mod extent;
pub mod points;

#[cfg(test)]
mod naive;
#[cfg(test)]
mod real_meshes;
#[cfg(test)]
mod tests;
