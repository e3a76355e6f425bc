//! Indices and functions between the numbering of a request and that of the kept mesh.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Numbering;
use crate::repair::DROPPED;

/// What functions are at vertices of the file that were dropped, and what such a vertex stands for where it is named.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extension {
    /// Not a number, which JSON writes as `null`; to name such a vertex is an error.
    #[default]
    None,
    /// What the nearest kept vertex has; such a vertex stands for that one.
    Nearest,
}

/// Why something given in the numbering of a file has no counterpart in the kept mesh. Vertices and faces are numbered
/// as in the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NumberingError {
    /// There is no such vertex.
    #[error("there is no vertex {vertex}; the file has {vertices}")]
    NoVertex {
        /// The vertex.
        vertex: u64,
        /// How many there are.
        vertices: usize,
    },
    /// The vertex was dropped.
    #[error("vertex {vertex} of the file was dropped, since no face uses it")]
    DroppedVertex {
        /// The vertex.
        vertex: u64,
    },
    /// The vertex is inside a solid, and this is about its surface.
    #[error("vertex {vertex} of the file lies inside the solid, not on its surface")]
    InnerVertex {
        /// The vertex.
        vertex: u64,
    },
    /// There is no such face.
    #[error("there is no face {face}; the file has {faces}")]
    NoFace {
        /// The face.
        face: u64,
        /// How many there are.
        faces: usize,
    },
    /// The face was dropped.
    #[error("face {face} of the file was dropped")]
    DroppedFace {
        /// The face.
        face: u64,
    },
    /// A function has too many values, or too few.
    #[error("{found} values are given; the file has {needed} {elements}")]
    Length {
        /// `vertices` or `faces`.
        elements: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// A function has no number where one is needed.
    #[error("the value of {element} {number} is not finite")]
    NotFinite {
        /// `vertex` or `face`.
        element: &'static str,
        /// Its number in the file.
        number: u64,
    },
    /// Numbers in frames are given, and a face of the file is several triangles, each with a frame of its own.
    #[error(
        "numbers in the frames of faces need the numbering \"kept\" on this mesh, since a face of the file is several of its triangles"
    )]
    Frames,
    /// Numbers in frames are given, and the check turned faces over, whose frames are then others than in the file.
    #[error(
        "numbers in the frames of faces need the numbering \"kept\" on this mesh, whose check turned faces over ({faces} in all)"
    )]
    Turned {
        /// How many faces.
        faces: usize,
    },
    /// A function has two values at vertices that are one.
    #[error(
        "vertices {first} and {second} of the file are one vertex of the mesh, but have the values {one} and {other}"
    )]
    Disagreement {
        /// The first vertex.
        first: u64,
        /// A later one.
        second: u64,
        /// The value of the first.
        one: f64,
        /// The value of the other.
        other: f64,
    },
}

/// The share of the largest value of a function by which its values at merged vertices may differ: what single
/// precision does to equal numbers.
const AGREEMENT: f64 = 1e-6;

/// A type with a value that stands for none.
pub trait Missing: Copy {
    /// That value.
    const MISSING: Self;
}

impl Missing for f32 {
    const MISSING: Self = f32::NAN;
}

impl Missing for f64 {
    const MISSING: Self = f64::NAN;
}

impl<T: Copy> Missing for Option<T> {
    const MISSING: Self = None;
}

/// How a request numbers vertices and faces: as its file, or as the kept mesh. The default changes nothing.
#[derive(Debug, Clone, Default)]
pub struct Translation {
    numbering: Option<Arc<Numbering>>,
    extend: Extension,
    /// Where functions are so many numbers in the frame of each face instead of one at each vertex.
    in_frames: Option<usize>,
    /// Of the numbering of the file: how many faces of the kept mesh run the other way round.
    turned: Option<usize>,
}

impl Translation {
    /// From the numbering of the file. Where that is the kept one, nothing is converted, and nothing is paid.
    pub fn of_file(numbering: Arc<Numbering>, extend: Extension) -> Self {
        let numbering = Some(numbering).filter(|numbering| !numbering.is_identity());
        Self { numbering, extend, in_frames: None, turned: Some(0) }
    }

    /// The same where the check turned so many faces over. In the numbering of the kept mesh that makes no difference.
    pub fn turning(self, faces: usize) -> Self {
        Self { turned: self.turned.map(|_| faces), ..self }
    }

    /// How many faces the check turned over, as [`turning`](Self::turning) was told: their frames are others than in
    /// the file, though no number changes.
    pub fn turned_faces(&self) -> usize {
        self.turned.unwrap_or(0)
    }

    /// The same for functions that are `width` numbers in the frame of each face, not one at each vertex.
    pub fn in_frames(self, width: usize) -> Self {
        Self { in_frames: Some(width), ..self }
    }

    /// Whether nothing is converted.
    pub fn is_identity(&self) -> bool {
        self.numbering.is_none()
    }

    fn of_vertices(&self) -> Option<&Numbering> {
        self.numbering.as_deref().filter(|numbering| !numbering.same_vertices())
    }

    fn of_faces(&self) -> Option<&Numbering> {
        self.numbering.as_deref().filter(|numbering| !numbering.same_faces())
    }

    /// How many values a function on `rows` kept vertices has.
    pub fn rows(&self, rows: usize) -> usize {
        match (self.in_frames, self.of_faces()) {
            (None, _) => self.of_vertices().map_or(rows, Numbering::file_vertices),
            (Some(width), Some(numbering)) => width * numbering.file_faces(),
            (Some(_), None) => rows,
        }
    }

    /// How many values a function on `faces` kept faces has.
    pub fn faces(&self, faces: usize) -> usize {
        self.of_faces().map_or(faces, Numbering::file_faces)
    }

    /// Whether a face that is named stands for several kept ones.
    pub fn divides_faces(&self) -> bool {
        self.of_faces().is_some_and(Numbering::divides_faces)
    }

    /// Why numbers in the frames of faces cannot be taken in this numbering; nothing where they can.
    pub fn refuses_frames(&self) -> Option<NumberingError> {
        match self.turned_faces() {
            _ if self.divides_faces() => Some(NumberingError::Frames),
            0 => None,
            faces => Some(NumberingError::Turned { faces }),
        }
    }

    /// The kept vertex that is meant, of the first `rows`. Where nothing is converted, an index out of range is left to
    /// who uses it.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex.
    pub fn vertex(&self, vertex: u64, rows: usize) -> Result<u32, NumberingError> {
        let Some(numbering) = self.of_vertices() else { return Ok(u32::try_from(vertex).unwrap_or(DROPPED)) };
        let vertices = numbering.file_vertices();
        let Some(at) = usize::try_from(vertex).ok().filter(|&at| at < vertices) else {
            return Err(NumberingError::NoVertex { vertex, vertices });
        };
        let near = || (self.extend == Extension::Nearest).then(|| numbering.nearest(at)).flatten();
        match numbering.kept_vertex(at).or_else(near) {
            Some(kept) if (kept as usize) < rows => Ok(kept),
            Some(_) => Err(NumberingError::InnerVertex { vertex }),
            None => Err(NumberingError::DroppedVertex { vertex }),
        }
    }

    /// The kept vertices that are meant, in place.
    ///
    /// # Errors
    /// As [`vertex`](Self::vertex).
    pub fn vertices(&self, vertices: &mut [u32], rows: usize) -> Result<(), NumberingError> {
        if self.of_vertices().is_some() {
            for vertex in vertices {
                *vertex = self.vertex(u64::from(*vertex), rows)?;
            }
        }
        Ok(())
    }

    /// The kept face that is meant: the first where there are several.
    ///
    /// # Errors
    /// [`NumberingError`] names the face.
    pub fn face(&self, face: u32) -> Result<u32, NumberingError> {
        let Some(numbering) = self.of_faces() else { return Ok(face) };
        let (faces, face) = (numbering.file_faces(), u64::from(face));
        if face >= faces as u64 {
            return Err(NumberingError::NoFace { face, faces });
        }
        numbering.kept_face(face as usize).ok_or(NumberingError::DroppedFace { face })
    }

    /// A kept vertex as the answer names it; for one made by subdivision, the lower end of its edge.
    pub fn file_vertex(&self, kept: u32) -> u32 {
        self.of_vertices().map_or(kept, |numbering| numbering.file_vertex(kept))
    }

    /// Whether the answer can name a kept vertex: those made by subdivision are none of the file.
    pub fn is_of_file(&self, kept: u32) -> bool {
        self.of_vertices().is_none_or(|numbering| !numbering.is_midpoint(kept))
    }

    /// A kept face as the answer names it.
    pub fn file_face(&self, kept: u32) -> u32 {
        self.of_faces().map_or(kept, |numbering| numbering.file_face(kept))
    }

    /// A function on the vertices of the file as one on the first `rows` kept ones. Values at dropped vertices are left
    /// out, those at merged ones must be equal; a vertex made by subdivision takes the mean of its ends, as the
    /// function is linear on the faces of the file.
    ///
    /// Where nothing is converted, this is a copy: length and values are left to who uses them.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex that has no number, or the two that disagree.
    pub fn pull(&self, values: &[f64], rows: usize) -> Result<Vec<f64>, NumberingError> {
        if let Some(width) = self.in_frames {
            return match self.divides_faces() {
                true => Err(NumberingError::Frames),
                false => self.pull_faces(values, width),
            };
        }
        let Some(numbering) = self.of_vertices() else { return Ok(values.to_vec()) };
        let needed = numbering.file_vertices();
        if values.len() != needed {
            return Err(NumberingError::Length { elements: "vertices", found: values.len(), needed });
        }
        let largest = values.iter().filter(|x| x.is_finite()).fold(0f64, |largest, x| largest.max(x.abs()));
        let mut pulled = vec![f64::NAN; rows];
        let mut met = vec![0u32; rows];
        for (file, kept) in numbering.vertex_map().enumerate() {
            let Some(kept) = kept.map(|kept| kept as usize).filter(|&kept| kept < rows) else { continue };
            let value = values[file];
            if !value.is_finite() {
                return Err(NumberingError::NotFinite { element: "vertex", number: file as u64 });
            }
            if met[kept] == 0 {
                pulled[kept] = value;
            } else {
                // The mean of all so far.
                let mean = pulled[kept];
                if (value - mean).abs() > AGREEMENT * largest {
                    let first = u64::from(numbering.file_vertex(kept as u32));
                    let (second, one) = (file as u64, values[first as usize]);
                    return Err(NumberingError::Disagreement { first, second, one, other: value });
                }
                pulled[kept] = mean + (value - mean) / f64::from(met[kept] + 1);
            }
            met[kept] += 1;
        }
        let first = numbering.kept[0] - numbering.midpoints.len();
        for (middle, ends) in numbering.midpoints.iter().enumerate() {
            if let Some(&slot) = [first + middle].iter().find(|&&slot| slot < rows) {
                pulled[slot] = 0.5 * (pulled[ends[0] as usize] + pulled[ends[1] as usize]);
            }
        }
        Ok(pulled)
    }

    /// The adjoint of [`pull`](Self::pull): what a linear function of the numbers at kept vertices, `width` of each, is
    /// of those at the vertices of the file. Merged vertices have equal shares of what the kept one has, dropped ones
    /// nothing, and the ends of an edge half each of what the vertex has that subdivision made of it. So a gradient by
    /// kept positions becomes one by those of the file.
    pub fn pull_adjoint(&self, values: &[f64], width: usize) -> Vec<f64> {
        let Some(numbering) = self.of_vertices() else { return values.to_vec() };
        let mut kept = values.to_vec();
        let first = numbering.kept[0] - numbering.midpoints.len();
        for (middle, ends) in numbering.midpoints.iter().enumerate().rev() {
            for k in 0..width {
                let half = 0.5 * kept[(first + middle) * width + k];
                ends.iter().for_each(|&end| kept[end as usize * width + k] += half);
            }
        }
        let mut copies = vec![0u32; kept.len().checked_div(width).unwrap_or(0)];
        for at in numbering.vertex_map().flatten() {
            if let Some(copies) = copies.get_mut(at as usize) {
                *copies += 1;
            }
        }
        let share = |at: u32, k: usize| match copies.get(at as usize) {
            Some(&copies) => kept[at as usize * width + k] / f64::from(copies),
            // A vertex inside a solid is none of the surface.
            None => 0.0,
        };
        numbering
            .vertex_map()
            .flat_map(|at| (0..width).map(move |k| (at, k)))
            .map(|(at, k)| at.map_or(0.0, |at| share(at, k)))
            .collect()
    }

    /// The adjoint of [`push`](Self::push): what a linear function of the values at the vertices of the file is of
    /// those at the first `rows` kept ones. What merged vertices count is added up; what dropped ones count is left
    /// out.
    ///
    /// # Errors
    /// [`NumberingError::Length`].
    pub fn push_adjoint(&self, values: &[f64], rows: usize) -> Result<Vec<f64>, NumberingError> {
        let Some(numbering) = self.of_vertices() else { return Ok(values.to_vec()) };
        let needed = numbering.file_vertices();
        if values.len() != needed {
            return Err(NumberingError::Length { elements: "vertices", found: values.len(), needed });
        }
        let mut sums = vec![0.0; rows];
        for (kept, value) in numbering.vertex_map().zip(values) {
            if let Some(sum) = kept.and_then(|kept| sums.get_mut(kept as usize)) {
                *sum += value;
            }
        }
        Ok(sums)
    }

    /// A function on kept vertices, `width` numbers each, as one on the vertices of the file: merged ones have their
    /// common value, dropped ones what [`Extension`] says.
    pub fn push<T: Missing>(&self, values: &[T], width: usize) -> Vec<T> {
        if let Some(width) = self.in_frames {
            return self.push_faces(values, width);
        }
        let Some(numbering) = self.of_vertices() else { return values.to_vec() };
        let mut pushed = vec![T::MISSING; width * numbering.file_vertices()];
        let mut dropped = numbering.nearest.iter();
        for (kept, slot) in numbering.vertex_map().zip(pushed.chunks_exact_mut(width)) {
            let near = if kept.is_none() { dropped.next() } else { None };
            let near = near.copied().filter(|&near| self.extend == Extension::Nearest && near != DROPPED);
            // A vertex inside a solid has no value of a function on the surface.
            if let Some(own) =
                kept.or(near).and_then(|kept| values.get(kept as usize * width..(kept as usize + 1) * width))
            {
                slot.copy_from_slice(own);
            }
        }
        pushed
    }

    /// A function on the faces of the file, `width` numbers each, as one on `faces` kept ones: all parts of a face take
    /// its value.
    ///
    /// Where nothing is converted, this is a copy.
    ///
    /// # Errors
    /// [`NumberingError`] where the length does not fit, or a face that was kept has no number.
    pub fn pull_faces(&self, values: &[f64], width: usize) -> Result<Vec<f64>, NumberingError> {
        let Some(numbering) = self.of_faces() else { return Ok(values.to_vec()) };
        let needed = numbering.file_faces();
        if width.checked_mul(needed) != Some(values.len()) {
            return Err(NumberingError::Length { elements: "faces", found: values.len() / width.max(1), needed });
        }
        let mut pulled = Vec::with_capacity(width * numbering.kept_faces());
        for file in numbering.face_map().map(|face| face as usize) {
            let own = &values[width * file..width * (file + 1)];
            if !own.iter().all(|x| x.is_finite()) {
                return Err(NumberingError::NotFinite { element: "face", number: file as u64 });
            }
            pulled.extend_from_slice(own);
        }
        Ok(pulled)
    }

    /// A function on kept faces, `width` numbers each, as one on the faces of the file: a face of several parts has the
    /// value of the first, dropped ones have none.
    pub fn push_faces<T: Missing>(&self, values: &[T], width: usize) -> Vec<T> {
        let Some(numbering) = self.of_faces() else { return values.to_vec() };
        let mut pushed = vec![T::MISSING; width * numbering.file_faces()];
        for (face, slot) in pushed.chunks_exact_mut(width.max(1)).enumerate() {
            if let Some(kept) = numbering.kept_face(face).map(|kept| kept as usize) {
                slot.copy_from_slice(&values[width * kept..width * (kept + 1)]);
            }
        }
        pushed
    }
}
