//! Reading meshes from untrusted bytes: one file per format.

/// What a reader found, before anything is checked: indices are in range, nothing else is promised.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawMesh {
    /// Vertex positions as written; they may be non-finite.
    pub positions: Vec<[f64; 3]>,
    /// Triangles; polygons and strips have been triangulated. A face may repeat a vertex.
    pub faces: Vec<[u32; 3]>,
    /// Tetrahedra, for the formats that have them.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Polygons of more than three corners that were triangulated.
    pub polygons_triangulated: usize,
    /// Whether the format repeats positions by design (STL), so that equal positions have to be merged.
    pub splits_vertices: bool,
}
