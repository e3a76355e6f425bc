//! The corners that lie on each vertex.

use super::OperatorError;

/// For each vertex the corners `3·face + k` that lie on it, ascending.
pub(super) struct Corners {
    offsets: Vec<u32>,
    corners: Vec<u32>,
}

impl Corners {
    /// Sorts the corners of `faces` by their vertices, of which there are `n`.
    ///
    /// # Errors
    /// [`OperatorError`] names a corner out of range, or says that there are too many.
    pub fn new(n: usize, faces: &[[u32; 3]]) -> Result<Self, OperatorError> {
        if u32::try_from(faces.len().saturating_mul(3)).is_err() {
            return Err(OperatorError::TooManyFaces { faces: faces.len() });
        }
        // Counts are kept one place late, so that the running positions below end as the offsets.
        let mut offsets = vec![0u32; n + 2];
        for (face, corners) in faces.iter().enumerate() {
            for &vertex in corners {
                if vertex as usize >= n {
                    return Err(OperatorError::VertexOutOfRange { face, vertex, vertices: n });
                }
                offsets[vertex as usize + 2] += 1;
            }
        }
        for v in 2..n + 2 {
            offsets[v] += offsets[v - 1];
        }
        let mut corners = vec![0u32; 3 * faces.len()];
        for (corner, &vertex) in faces.as_flattened().iter().enumerate() {
            let next = &mut offsets[vertex as usize + 1];
            corners[*next as usize] = corner as u32;
            *next += 1;
        }
        offsets.pop();
        Ok(Self { offsets, corners })
    }

    /// The corners on a vertex, ascending.
    #[inline]
    pub fn on(&self, vertex: usize) -> &[u32] {
        &self.corners[self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize]
    }

    /// The number of corners on a run of vertices.
    pub fn count(&self, vertices: &std::ops::Range<usize>) -> usize {
        (self.offsets[vertices.end] - self.offsets[vertices.start]) as usize
    }
}
