//! Intrinsic triangulations: triangles known by the lengths of their edges alone, so that edges may be flipped across
//! the surface without moving it (Sharp and Crane 2020).

mod delaunay;
mod triangle;
mod tufted;

pub use delaunay::Flips;
pub use triangle::TriangleShape;

use super::TriangleMesh;

/// A triangulation of a closed surface by lengths. Half-edge `3f + c` of triangle `f` runs from its corner `c` to the
/// next one.
///
/// Triangles may meet a vertex more than once, and two triangles may share several edges; vertices are labels.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicTriangulation {
    /// The corners of each triangle.
    faces: Vec<[u32; 3]>,
    /// The length of the edge from each corner to the next.
    lengths: Vec<[f64; 3]>,
    /// The other side of each half-edge.
    twins: Vec<u32>,
    /// The shape of each triangle; kept up to date by flips.
    shapes: Vec<TriangleShape>,
    /// Half-edges that must not be flipped; empty where all may be.
    fixed: Vec<bool>,
    sheets: usize,
    mollification: f64,
}

impl IntrinsicTriangulation {
    /// The corners of each triangle.
    #[inline]
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The shape of each triangle.
    #[inline]
    pub fn shapes(&self) -> &[TriangleShape] {
        &self.shapes
    }

    /// The other side of half-edge `3f + c`, which runs the other way.
    ///
    /// # Panics
    /// There is no such half-edge.
    #[inline]
    pub fn twin(&self, half_edge: u32) -> u32 {
        self.twins[half_edge as usize]
    }

    /// How often the triangles cover the surface: twice, or once where it is closed, manifold and consistently
    /// oriented.
    pub fn sheets(&self) -> usize {
        self.sheets
    }

    /// What was added to the length of every edge, as a share of their mean.
    pub fn mollification(&self) -> f64 {
        self.mollification
    }

    fn half_edge_length(&self, h: u32) -> f64 {
        self.lengths[h as usize / 3][h as usize % 3]
    }
}

/// The next half-edge of the same triangle.
fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// What may be fixed of a triangulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rim {
    /// Boundary edges may be flipped across both sheets.
    #[default]
    Free,
    /// Boundary edges stay: functions that vanish at their ends vanish along them.
    Fixed,
}

/// Why there is no intrinsic triangulation of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CoverError {
    /// Half-edges are counted in 32 bits.
    #[error("{faces} faces are more than a tufted cover can count")]
    TooManyFaces {
        /// The number of faces.
        faces: usize,
    },
    /// No face has three different vertices, or all edges are without length.
    #[error("the mesh has no area")]
    Empty,
}

/// The triangles of a mesh that name three different vertices.
fn proper_faces(mesh: &TriangleMesh) -> Vec<[u32; 3]> {
    mesh.faces.iter().copied().filter(|&[a, b, c]| a != b && b != c && c != a).collect()
}
