//! Collects vertices and polygons under the limits; every reader ends here.

use super::error::{Place, ReadError};
use super::polygon::{self, Fan};
use super::{MeshFormat, Polygons, RawMesh, ReadLimits};

pub(super) struct Builder<'l> {
    pub mesh: RawMesh,
    limits: &'l ReadLimits,
    fans: Vec<Fan>,
    /// For each face that was left out, how many triangles came before it.
    left_out: Vec<u32>,
    /// How many corners each of them had.
    short: Vec<u8>,
    /// Polygons begun so far, the current one excluded.
    pub polygons: usize,
    first: u32,
    previous: u32,
    corners: usize,
    /// The largest index so far that referred to a vertex that had not been read.
    forward: Option<Forward>,
}

#[derive(Debug, Clone, Copy)]
struct Forward {
    index: u32,
    element: &'static str,
    number: usize,
    place: Place,
}

impl<'l> Builder<'l> {
    pub fn new(limits: &'l ReadLimits) -> Self {
        Self {
            mesh: RawMesh::default(),
            limits,
            fans: Vec::new(),
            left_out: Vec::new(),
            short: Vec::new(),
            polygons: 0,
            first: 0,
            previous: 0,
            corners: 0,
            forward: None,
        }
    }

    /// Refuses an announced number of vertices beyond the limit, and makes room for as many as the file can hold.
    pub fn expect_vertices(&mut self, declared: u64, possible: u64) -> Result<(), ReadError> {
        let limit = self.limits.vertices.min(u32::MAX as usize);
        if declared > possible {
            return Err(ReadError::CountExceedsFile { element: "vertex", declared, possible });
        }
        if declared > limit as u64 {
            return Err(ReadError::TooManyVertices { limit });
        }
        self.mesh.positions.reserve_exact(declared as usize);
        Ok(())
    }

    /// The same for faces. `possible` bounds faces of any kind, `triangles` those that need room.
    pub fn expect_faces(&mut self, declared: u64, possible: u64, triangles: u64) -> Result<(), ReadError> {
        let limit = self.limits.faces.min(u32::MAX as usize);
        if declared > possible {
            return Err(ReadError::CountExceedsFile { element: "face", declared, possible });
        }
        if declared > limit as u64 {
            return Err(ReadError::TooManyFaces { limit });
        }
        self.mesh.faces.reserve(declared.min(triangles) as usize);
        Ok(())
    }

    /// The same for tetrahedra.
    pub fn expect_tetrahedra(&mut self, declared: u64, possible: u64) -> Result<(), ReadError> {
        if declared > possible {
            return Err(ReadError::CountExceedsFile { element: "tetrahedron", declared, possible });
        }
        if declared > self.limits.tetrahedra as u64 {
            return Err(ReadError::TooManyTetrahedra { limit: self.limits.tetrahedra });
        }
        self.mesh.tetrahedra.reserve_exact(declared as usize);
        Ok(())
    }

    pub fn vertex(&mut self, position: [f64; 3]) -> Result<(), ReadError> {
        let limit = self.limits.vertices.min(u32::MAX as usize);
        if self.mesh.positions.len() >= limit {
            return Err(ReadError::TooManyVertices { limit });
        }
        self.mesh.positions.push(position);
        Ok(())
    }

    /// Adds a corner to the current polygon.
    #[inline]
    pub fn corner(&mut self, vertex: u32, place: Place) -> Result<(), ReadError> {
        if self.corners >= self.limits.corners_per_polygon {
            let limit = self.limits.corners_per_polygon;
            return Err(ReadError::PolygonTooLarge { number: self.polygons, place, limit });
        }
        match self.corners {
            0 => self.first = vertex,
            1 => {}
            _ => self.triangle([self.first, self.previous, vertex])?,
        }
        self.previous = vertex;
        self.corners += 1;
        Ok(())
    }

    /// Ends the current polygon.
    #[inline]
    pub fn end_polygon(&mut self) {
        match self.corners {
            corners @ 0..=2 => {
                self.mesh.short_faces_dropped += 1;
                self.left_out.push(self.mesh.faces.len() as u32);
                self.short.push(corners as u8);
            }
            3 => {}
            // The limit on faces keeps both below `u32::MAX`.
            corners => self
                .fans
                .push(Fan { first_face: (self.mesh.faces.len() + 2 - corners) as u32, corners: corners as u32 }),
        }
        self.corners = 0;
        self.polygons += 1;
    }

    /// Adds a triangle that belongs to no polygon, or is part of a fan.
    #[inline]
    pub fn triangle(&mut self, face: [u32; 3]) -> Result<(), ReadError> {
        let limit = self.limits.faces.min(u32::MAX as usize);
        if self.mesh.faces.len() >= limit {
            return Err(ReadError::TooManyFaces { limit });
        }
        self.mesh.faces.push(face);
        Ok(())
    }

    pub fn tetrahedron(&mut self, corners: [u32; 4]) -> Result<(), ReadError> {
        if self.mesh.tetrahedra.len() >= self.limits.tetrahedra {
            return Err(ReadError::TooManyTetrahedra { limit: self.limits.tetrahedra });
        }
        self.mesh.tetrahedra.push(corners);
        Ok(())
    }

    /// An index of a format that counts from one. Vertices may follow later; [`finish`](Self::finish) checks that they
    /// did.
    pub fn one_based_index(
        &mut self,
        index: i64,
        format: MeshFormat,
        element: &'static str,
        number: usize,
        place: Place,
    ) -> Result<u32, ReadError> {
        if index == 0 {
            return Err(ReadError::IndexZero { format, element, number, place });
        }
        let vertices = self.mesh.positions.len();
        let zero_based = u32::try_from(index - 1).map_err(|_| ReadError::IndexOutOfRange {
            element,
            number,
            place,
            index,
            vertices,
        })?;
        if zero_based as usize >= vertices && self.forward.is_none_or(|forward| zero_based > forward.index) {
            self.forward = Some(Forward { index: zero_based, element, number, place });
        }
        Ok(zero_based)
    }

    /// Checks what could not be checked before all vertices were known, and triangulates polygons.
    pub fn finish(self) -> Result<RawMesh, ReadError> {
        self.finish_with(None)
    }

    /// The same; for each corner of each triangle its number among the corners of all polygons in the order of the
    /// file, those that were left out included. There are fewer than 2³² of them, and no triangles but those of
    /// polygons.
    pub fn finish_cornered(self) -> Result<(RawMesh, Vec<[u32; 3]>), ReadError> {
        let mut corners = corners(self.mesh.faces.len(), &self.fans, &self.left_out, &self.short);
        let mesh = self.finish_with(Some(&mut corners))?;
        Ok((mesh, corners))
    }

    fn finish_with(mut self, corners: Option<&mut [[u32; 3]]>) -> Result<RawMesh, ReadError> {
        let vertices = self.mesh.positions.len();
        if let Some(Forward { index, element, number, place }) = self.forward
            && index as usize >= vertices
        {
            return Err(ReadError::IndexOutOfRange { element, number, place, index: i64::from(index) + 1, vertices });
        }
        polygon::triangulate(&self.mesh.positions, &mut self.mesh.faces, &self.fans, corners);
        self.mesh.polygons_triangulated = self.fans.len();
        self.mesh.polygons = polygons(self.mesh.faces.len(), &self.fans, &self.left_out);
        Ok(self.mesh)
    }
}

/// Which face of the file each triangle belongs to, where that is not its own number.
fn polygons(triangles: usize, fans: &[Fan], left_out: &[u32]) -> Option<Polygons> {
    if fans.is_empty() && left_out.is_empty() {
        return None;
    }
    let (mut fans, mut left_out) = (fans.iter().peekable(), left_out.iter().peekable());
    let (mut of_triangle, mut face) = (Vec::with_capacity(triangles), 0u32);
    while of_triangle.len() < triangles {
        let at = of_triangle.len() as u32;
        while left_out.next_if_eq(&&at).is_some() {
            face += 1;
        }
        let parts = fans.next_if(|fan| fan.first_face == at).map_or(1, |fan| fan.corners as usize - 2);
        of_triangle.extend(std::iter::repeat_n(face, parts));
        face += 1;
    }
    Some(Polygons { of_triangle, count: face as usize + left_out.count() })
}

/// The corners of triangles as polygons were entered, fans for those of more than three corners.
fn corners(triangles: usize, fans: &[Fan], left_out: &[u32], short: &[u8]) -> Vec<[u32; 3]> {
    let (mut fans, mut left_out) = (fans.iter().peekable(), left_out.iter().zip(short).peekable());
    let (mut corners, mut next) = (Vec::with_capacity(triangles), 0u32);
    while corners.len() < triangles {
        let at = corners.len() as u32;
        while let Some((_, &few)) = left_out.next_if(|(before, _)| **before == at) {
            next += u32::from(few);
        }
        let count = fans.next_if(|fan| fan.first_face == at).map_or(3, |fan| fan.corners);
        corners.extend((1..count - 1).map(|k| [next, next + k, next + k + 1]));
        next += count;
    }
    corners
}

/// An index of a format that counts from zero and announces its vertices.
pub(super) fn zero_based_index(
    index: i64,
    vertices: usize,
    element: &'static str,
    number: usize,
    place: Place,
) -> Result<u32, ReadError> {
    match u32::try_from(index) {
        Ok(vertex) if (vertex as usize) < vertices => Ok(vertex),
        _ => Err(ReadError::IndexOutOfRange { element, number, place, index, vertices }),
    }
}
