//! Surfaces and solids: reading, writing, checking and repairing, connectivity, distances, sampling, generated shapes.

pub mod attributes;
pub mod check;
pub mod connected;
pub mod connectivity;
pub mod distance;
pub mod dual;
pub mod fixtures;
pub mod intrinsic;
pub mod measure;
pub mod nearest;
pub mod npy;
pub mod numbering;
pub mod points;
pub mod polygons;
pub mod read;
mod repair;
mod report;
pub mod sample;
pub mod shape;
pub mod solid;
pub mod subdivide;
mod topology;
pub mod write;

use chladni_base::Vector3;

/// A triangle mesh: positions in the units of the input, faces as counter-clockwise triples of vertex indices.
///
/// Meshes that come out of [`check`](self) satisfy: every index is in range, every coordinate is finite, no face
/// repeats a vertex.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// `n` vertex positions.
    pub positions: Vec<[f64; 3]>,
    /// `f` faces.
    pub faces: Vec<[u32; 3]>,
    /// The polygons that faces are parts of, where the file has any of more than three corners.
    pub polygons: Option<std::sync::Arc<polygons::Polygons>>,
    /// Of points without faces, the triangles that a check has made around each.
    pub local: points::KnownTriangles,
}

impl TriangleMesh {
    /// The positions as vectors to compute with, where they lie.
    #[inline]
    pub fn points(&self) -> &[Vector3] {
        Vector3::slice(&self.positions)
    }

    /// The position of a vertex as a vector.
    ///
    /// # Panics
    /// Where there is no such vertex.
    #[inline]
    pub fn point(&self, vertex: u32) -> Vector3 {
        Vector3(self.positions[vertex as usize])
    }

    /// Where the corners of a face lie.
    ///
    /// # Panics
    /// Where a corner is no vertex.
    #[inline]
    pub fn corners(&self, face: &[u32; 3]) -> [Vector3; 3] {
        face.map(|vertex| self.point(vertex))
    }

    /// The mean of the corners of a face.
    ///
    /// # Panics
    /// Where a corner is no vertex.
    #[inline]
    pub fn barycentre(&self, face: &[u32; 3]) -> Vector3 {
        let [p, q, r] = self.corners(face);
        (p + q + r) / 3.0
    }
}

/// A tetrahedral mesh; tetrahedra are positively oriented quadruples of vertex indices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetMesh {
    /// `n` vertex positions.
    pub positions: Vec<[f64; 3]>,
    /// `t` tetrahedra.
    pub tetrahedra: Vec<[u32; 4]>,
}
