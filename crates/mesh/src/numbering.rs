//! The numbering of a file beside that of the mesh that was made of it: the one place that converts between them.
//!
//! Repairs drop vertices and faces, merging joins vertices, polygons are cut into triangles, subdivision adds vertices,
//! and the surface of a solid comes first. A [`Numbering`] remembers what became of what; a [`Translation`] is how a
//! request wants it used.

mod bytes;
mod translation;

use std::sync::OnceLock;

use super::nearest::FaceHierarchy;
use super::repair::DROPPED;
use super::{TriangleMesh, subdivide};

pub use translation::{Extension, Missing, NumberingError, Translation};

/// Which vertex and face of a file became which of the kept mesh, and back.
#[derive(Debug, Clone, Default)]
pub struct Numbering {
    /// Vertices and faces of the file. A polygon is one face; an STL has three vertices for each facet.
    file: [usize; 2],
    /// Vertices and faces that were kept; of a solid, the vertices of its inside too.
    kept: [usize; 2],
    /// For each vertex of the file the kept one, or [`DROPPED`]; `None` where they are the same.
    vertices: Option<Vec<u32>>,
    /// For each kept face that of the file; `None` where they are the same.
    faces: Option<Vec<u32>>,
    /// For each dropped vertex, ascending, the kept one nearest to it, or [`DROPPED`] where it stood nowhere.
    nearest: Vec<u32>,
    /// The ends of the edge that each vertex made by subdivision halves; these are the last vertices of the kept mesh,
    /// ends come before middles.
    midpoints: Vec<[u32; 2]>,
    subdivisions: u8,
    /// How many of the kept vertices, the last ones, lie inside a solid and not on its surface.
    inner: usize,
    /// Whether this is not known but assumed: of meshes that were stored before numberings were.
    assumed: bool,
    inverse: OnceLock<Inverse>,
}

/// The way back, made when it is first needed.
#[derive(Debug, Clone, Default)]
struct Inverse {
    /// For each kept vertex the lowest of the file that became it; for one made by subdivision the lower end of its
    /// edge.
    vertices: Vec<u32>,
    /// For each face of the file the first kept one, or [`DROPPED`].
    faces: Vec<u32>,
    /// Vertices of the file that were dropped, ascending.
    dropped: Vec<u32>,
}

impl PartialEq for Numbering {
    fn eq(&self, other: &Self) -> bool {
        (self.file, self.kept, self.subdivisions, self.inner, self.assumed)
            == (other.file, other.kept, other.subdivisions, other.inner, other.assumed)
            && self.vertices == other.vertices
            && self.faces == other.faces
            && self.nearest == other.nearest
            && self.midpoints == other.midpoints
    }
}

/// What became of a file, as it was found while the mesh was repaired.
#[derive(Debug, Default)]
pub(crate) struct MeshNumbering {
    pub file: [usize; 2],
    pub vertices: Option<Vec<u32>>,
    pub faces: Option<Vec<u32>>,
    pub nearest: Vec<u32>,
    pub inner: usize,
}

impl Numbering {
    /// The numbering of a mesh whose file has the same vertices and faces.
    pub fn identity(vertices: usize, faces: usize) -> Self {
        Self { file: [vertices, faces], kept: [vertices, faces], ..Self::default() }
    }

    /// The same, of a mesh of which nobody knows what its file had.
    pub fn assumed(vertices: usize, faces: usize) -> Self {
        Self { assumed: true, ..Self::identity(vertices, faces) }
    }

    /// The numbering that two maps tell, as files of products carry them: for each vertex of the file the kept one, of
    /// so many, or −1; for each kept face that of the file. What the maps do not tell is not known: which vertex is
    /// nearest to a dropped one, which vertices a subdivision made, and how many faces of the file come after the last
    /// that was kept. `None` where a number is out of range, or a vertex that was kept is no vertex of the file.
    pub fn from_maps(vertices: &[i32], faces: &[i32], kept: usize) -> Option<Self> {
        let vertex = |&number: &i32| match number {
            -1 => Some(DROPPED),
            kept_one => u32::try_from(kept_one).ok().filter(|&own| (own as usize) < kept),
        };
        let map: Vec<u32> = vertices.iter().map(vertex).collect::<Option<_>>()?;
        let face_map: Vec<u32> = faces.iter().map(|&face| u32::try_from(face).ok()).collect::<Option<_>>()?;
        let mut met = vec![false; kept];
        map.iter().filter(|&&own| own != DROPPED).for_each(|&own| met[own as usize] = true);
        if !met.into_iter().all(|met| met) {
            return None;
        }
        let file_faces = face_map.iter().max().map_or(0, |&last| last as usize + 1);
        let nearest = vec![DROPPED; map.iter().filter(|&&own| own == DROPPED).count()];
        let is_same =
            |map: &[u32], count: usize| map.len() == count && map.iter().enumerate().all(|(k, &own)| own as usize == k);
        Some(Self {
            file: [map.len(), file_faces],
            kept: [kept, face_map.len()],
            vertices: (!is_same(&map, kept)).then_some(map),
            faces: (!is_same(&face_map, file_faces)).then_some(face_map),
            nearest,
            ..Self::default()
        })
    }

    /// The numbering of a mesh of so many vertices and faces as the check found it, before the faces were divided.
    pub(crate) fn found(found: MeshNumbering, kept: [usize; 2]) -> Self {
        let MeshNumbering { file, vertices, faces, nearest, inner } = found;
        Self { file, kept, vertices, faces, nearest, inner, ..Self::default() }
    }

    /// The numbering after every face was divided into four so many times.
    pub(crate) fn divided(mut self, mesh: &TriangleMesh, times: u8) -> Self {
        if times == 0 {
            return self;
        }
        let factor = 4usize.pow(u32::from(times));
        let origin = |coarse: usize| self.faces.as_ref().map_or(coarse as u32, |faces| faces[coarse]);
        self.faces = Some((0..mesh.faces.len()).map(|face| origin(face / factor)).collect());
        self.midpoints = subdivide::midpoints(&mesh.faces, times);
        self.kept = [mesh.positions.len(), mesh.faces.len()];
        self.subdivisions = times;
        self
    }

    /// Vertices of the file.
    pub fn file_vertices(&self) -> usize {
        self.file[0]
    }

    /// Faces of the file.
    pub fn file_faces(&self) -> usize {
        self.file[1]
    }

    /// Vertices that were kept; of a solid, with those inside.
    pub fn kept_vertices(&self) -> usize {
        self.kept[0]
    }

    /// Faces that were kept.
    pub fn kept_faces(&self) -> usize {
        self.kept[1]
    }

    /// Whether the numbering of the file is not known, so that the kept one stands for it.
    pub fn is_assumed(&self) -> bool {
        self.assumed
    }

    /// Whether file and kept surface have the same vertices.
    pub fn same_vertices(&self) -> bool {
        self.vertices.is_none() && self.file[0] == self.kept[0] && self.inner == 0
    }

    /// Whether file and kept mesh have the same faces.
    pub fn same_faces(&self) -> bool {
        self.faces.is_none() && self.file[1] == self.kept[1]
    }

    /// Whether nothing has to be converted.
    pub fn is_identity(&self) -> bool {
        self.same_vertices() && self.same_faces()
    }

    /// Vertices of the file that were dropped.
    pub fn dropped_vertices(&self) -> usize {
        self.nearest.len()
    }

    /// Vertices of the file that share a kept vertex with an earlier one.
    pub fn merged_vertices(&self) -> usize {
        self.file[0] - self.nearest.len() - (self.kept[0] - self.midpoints.len()).min(self.file[0] - self.nearest.len())
    }

    /// For each vertex of the file the kept one, or `None` where it was dropped.
    pub fn vertex_map(&self) -> impl Iterator<Item = Option<u32>> + '_ {
        (0..self.file[0]).map(|vertex| self.kept_vertex(vertex))
    }

    /// For each kept face that of the file.
    pub fn face_map(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.kept[1]).map(|face| self.faces.as_ref().map_or(face as u32, |faces| faces[face]))
    }

    /// For each kept vertex the lowest of the file that became it, or `None` where subdivision made it.
    pub fn file_vertex_map(&self) -> impl Iterator<Item = Option<u32>> + '_ {
        (0..self.kept[0] as u32).map(|kept| (!self.is_midpoint(kept)).then(|| self.file_vertex(kept)))
    }

    /// For each face of the file the first kept one that it is or that is a part of it, or `None` where it was dropped.
    pub fn kept_face_map(&self) -> impl Iterator<Item = Option<u32>> + '_ {
        (0..self.file[1]).map(|face| self.kept_face(face))
    }

    fn kept_vertex(&self, vertex: usize) -> Option<u32> {
        match &self.vertices {
            None => Some(vertex as u32),
            Some(map) => map.get(vertex).copied().filter(|&kept| kept != DROPPED),
        }
    }

    /// The kept vertex nearest to a dropped one.
    fn nearest(&self, vertex: usize) -> Option<u32> {
        let place = self.inverse().dropped.binary_search(&(vertex as u32)).ok()?;
        self.nearest.get(place).copied().filter(|&kept| kept != DROPPED)
    }

    /// The lowest vertex of the file that became a kept one; for a vertex made by subdivision, that of the lower end of
    /// its edge.
    pub fn file_vertex(&self, kept: u32) -> u32 {
        if self.vertices.is_none() && self.midpoints.is_empty() {
            return kept;
        }
        self.inverse().vertices.get(kept as usize).copied().unwrap_or(DROPPED)
    }

    /// Whether a kept vertex was made by subdivision.
    pub fn is_midpoint(&self, kept: u32) -> bool {
        kept as usize >= self.kept[0] - self.midpoints.len()
    }

    /// The face of the file that a kept face is, or is a part of.
    pub fn file_face(&self, kept: u32) -> u32 {
        self.faces.as_ref().map_or(kept, |faces| faces.get(kept as usize).copied().unwrap_or(DROPPED))
    }

    /// How often every face was divided into four.
    pub fn subdivisions(&self) -> u8 {
        self.subdivisions
    }

    /// A numbering that tells nothing but which polygon each triangle of a mesh is a part of.
    pub fn of_polygons(vertices: usize, of_face: &[u32]) -> Self {
        let file = of_face.iter().max().map_or(0, |&last| last as usize + 1);
        let faces = Some(of_face.to_vec());
        Self { file: [vertices, file], kept: [vertices, of_face.len()], faces, ..Self::default() }
    }

    /// Whether a face of the file is several kept ones.
    pub fn divides_faces(&self) -> bool {
        self.faces.as_ref().is_some_and(|faces| faces.windows(2).any(|pair| pair[0] == pair[1]))
    }

    fn inverse(&self) -> &Inverse {
        self.inverse.get_or_init(|| {
            let mut vertices = vec![DROPPED; self.kept[0]];
            for (file, kept) in self.vertex_map().enumerate() {
                if let Some(slot) = kept.and_then(|kept| vertices.get_mut(kept as usize)) {
                    *slot = (*slot).min(file as u32);
                }
            }
            let first = self.kept[0] - self.midpoints.len();
            for (middle, &[a, b]) in self.midpoints.iter().enumerate() {
                vertices[first + middle] = vertices[a.min(b) as usize];
            }
            let mut faces = vec![DROPPED; self.file[1]];
            for (kept, file) in self.face_map().enumerate() {
                if let Some(slot) = faces.get_mut(file as usize) {
                    *slot = (*slot).min(kept as u32);
                }
            }
            let dropped = self.vertex_map().enumerate().filter(|(_, kept)| kept.is_none());
            Inverse { vertices, faces, dropped: dropped.map(|(file, _)| file as u32).collect() }
        })
    }

    /// The first kept face of a face of the file.
    fn kept_face(&self, face: usize) -> Option<u32> {
        if self.faces.is_none() {
            return (face < self.kept[1]).then_some(face as u32);
        }
        self.inverse().faces.get(face).copied().filter(|&kept| kept != DROPPED)
    }

    /// About the bytes that it takes in memory.
    pub fn bytes(&self) -> u64 {
        let maps = [&self.vertices, &self.faces].into_iter().flatten().map(Vec::len).sum::<usize>();
        let inverse = if self.is_identity() { 0 } else { self.kept[0] + self.file[1] };
        4 * (maps + inverse + self.nearest.len() + 2 * self.midpoints.len()) as u64
    }
}

/// For each position the nearest vertex of a mesh, or [`DROPPED`] where the position is not finite.
pub(crate) fn nearest_vertices(mesh: &[[f64; 3]], positions: &[[f64; 3]]) -> Vec<u32> {
    if positions.is_empty() {
        return Vec::new();
    }
    // A vertex is a triangle without extent.
    let points = TriangleMesh {
        positions: mesh.to_vec(),
        faces: (0..mesh.len() as u32).map(|vertex| [vertex; 3]).collect(),
        ..Default::default()
    };
    let tree = FaceHierarchy::new(&points);
    use chladni_base::parallel::*;
    positions.par_iter().map(|&point| tree.nearest(&points, point).map_or(DROPPED, |(vertex, _)| vertex)).collect()
}

#[cfg(test)]
mod tests;
