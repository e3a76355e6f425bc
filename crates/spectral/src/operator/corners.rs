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

    /// The corners of `faces` that lie on some vertices alone, of which there are `count`: `place` tells which of them
    /// a vertex is. There are fewer faces than [`new`](Self::new) takes, and their corners are in range.
    pub fn on_some(place: impl Fn(u32) -> Option<u32>, count: usize, faces: &[[u32; 3]]) -> Self {
        let mut offsets = vec![0u32; count + 2];
        let placed = || faces.as_flattened().iter().zip(0u32..).filter_map(|(&v, corner)| Some((place(v)?, corner)));
        placed().for_each(|(place, _)| offsets[place as usize + 2] += 1);
        for at in 2..count + 2 {
            offsets[at] += offsets[at - 1];
        }
        let mut corners = vec![0u32; offsets.last().map_or(0, |&end| end as usize)];
        for (place, corner) in placed() {
            let next = &mut offsets[place as usize + 1];
            corners[*next as usize] = corner;
            *next += 1;
        }
        offsets.pop();
        Self { offsets, corners }
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
