//! What a file says beside positions and faces: texture coordinates, normals, and the names of groups, objects and
//! materials.
//!
//! Vertices of a mesh stay those of the file's positions. Texture coordinates and normals have indices of their own,
//! one for each corner of each face, so that a seam splits no vertex. Nothing is computed from them: they are kept for
//! what goes out again.

mod bytes;
mod moved;

use std::collections::HashMap;

use chladni_base::Vector3;
use serde::{Deserialize, Serialize};

use crate::repair::DROPPED;

/// The index of a corner without a texture coordinate or normal, and of a face without a name.
pub const NONE: u32 = u32::MAX;

/// Texture coordinates, normals and names of a mesh of `f` faces.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attributes {
    /// Texture coordinates `(u, v)`; `v` goes up, as in OBJ.
    pub texture: Option<Layer<2>>,
    /// Normals, as the file has them: of any length, on either side.
    pub normals: Option<Layer<3>>,
    /// Names of groups: the words after `g`, blanks between them.
    pub groups: Labels,
    /// Names of objects: `o`.
    pub objects: Labels,
    /// Names of materials: `usemtl`.
    pub materials: Labels,
    /// Names of files with materials: `mtllib`. They are passed on and never opened.
    pub libraries: Vec<Vec<u8>>,
}

/// Values, and which of them each corner of each face has.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layer<const N: usize> {
    /// The values, in the order of the file.
    pub values: Vec<[f64; N]>,
    /// For each face the value at each of its corners, or [`NONE`]; `f` of them.
    pub corners: Vec<[u32; 3]>,
}

/// Names of faces. Faces of one name mostly follow each other, so that runs of them are kept.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Labels {
    /// The names, each once. They may be of any encoding.
    pub names: Vec<Vec<u8>>,
    /// The first face of each run, ascending, and its name, or [`NONE`]. Faces before the first run have no name.
    pub runs: Vec<[u32; 2]>,
}

/// How much a file says beside positions and faces.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AttributeReport {
    /// Texture coordinates of the file.
    pub texture_coordinates: usize,
    /// Normals of the file.
    pub normals: usize,
    /// Names of groups.
    pub groups: usize,
    /// Names of objects.
    pub objects: usize,
    /// Names of materials.
    pub materials: usize,
    /// Corners of faces that name a texture coordinate or a normal which the file does not have, or which is not
    /// finite; they have none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub missing: usize,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Attributes {
    /// Whether there is nothing to keep.
    pub fn is_empty(&self) -> bool {
        self.texture.is_none()
            && self.normals.is_none()
            && self.libraries.is_empty()
            && self.labels().iter().all(|labels| labels.is_empty())
    }

    /// Whether these are attributes of so many faces.
    pub fn fits(&self, faces: usize) -> bool {
        let same = |corners: &Vec<[u32; 3]>| corners.len() == faces;
        self.texture.as_ref().is_none_or(|layer| same(&layer.corners))
            && self.normals.as_ref().is_none_or(|layer| same(&layer.corners))
            && self.labels().iter().all(|labels| labels.runs.last().is_none_or(|run| (run[0] as usize) < faces))
    }

    fn labels(&self) -> [&Labels; 3] {
        [&self.groups, &self.objects, &self.materials]
    }

    /// The counts, with those corners that name what is missing.
    pub fn report(&self, missing: usize) -> AttributeReport {
        AttributeReport {
            texture_coordinates: self.texture.as_ref().map_or(0, |layer| layer.values.len()),
            normals: self.normals.as_ref().map_or(0, |layer| layer.values.len()),
            groups: self.groups.names.len(),
            objects: self.objects.names.len(),
            materials: self.materials.names.len(),
            missing,
        }
    }

    /// About the bytes that they take in memory.
    pub fn bytes(&self) -> u64 {
        let layers = self.texture.as_ref().map_or(0, Layer::bytes) + self.normals.as_ref().map_or(0, Layer::bytes);
        layers + self.labels().iter().map(|labels| labels.bytes()).sum::<u64>()
    }

    /// What is left after repairs: `given` are the faces as these attributes have them, `vertices` tells for each of
    /// their vertices the kept one, `kept` are the faces that were kept, and `origin` tells which of the given ones
    /// each of them was. Corners that were turned keep what they had.
    pub(crate) fn repaired(
        self,
        given: &[[u32; 3]],
        vertices: Option<&[u32]>,
        kept: &[[u32; 3]],
        origin: impl Fn(u32) -> u32,
    ) -> Self {
        let number = |v: u32| vertices.map_or(v, |map| map.get(v as usize).copied().unwrap_or(DROPPED));
        // Of each kept corner, which corner of the given face it was: a face that was kept repeats no vertex.
        let turns: Vec<[u8; 3]> = kept
            .iter()
            .enumerate()
            .map(|(k, face)| {
                let before = given[origin(k as u32) as usize].map(number);
                face.map(|v| before.iter().position(|&w| w == v).unwrap_or(0) as u8)
            })
            .collect();
        let corners = |old: Vec<[u32; 3]>| -> Vec<[u32; 3]> {
            let turned = |(k, turn): (usize, &[u8; 3])| turn.map(|i| old[origin(k as u32) as usize][i as usize]);
            turns.iter().enumerate().map(turned).collect()
        };
        let names = |labels: Labels| labels.renumbered((0..kept.len() as u32).map(&origin));
        Self {
            texture: self.texture.map(|layer| Layer { corners: corners(layer.corners), ..layer }),
            normals: self.normals.map(|layer| Layer { corners: corners(layer.corners), ..layer }),
            groups: names(self.groups),
            objects: names(self.objects),
            materials: names(self.materials),
            libraries: self.libraries,
        }
    }

    /// The attributes of a mesh of which every face was divided into four
    /// ([`subdivided`](crate::subdivide::subdivided)): texture coordinates at midpoints are means, normals means of
    /// length one.
    pub(crate) fn divided(self) -> Self {
        let unit = |sum: [f64; 3]| {
            let length = Vector3(sum).norm();
            if length > 0.0 { sum.map(|x| x / length) } else { sum }
        };
        Self {
            texture: self.texture.map(|layer| layer.divided(|mean| mean)),
            normals: self.normals.map(|layer| layer.divided(unit)),
            groups: self.groups.divided(),
            objects: self.objects.divided(),
            materials: self.materials.divided(),
            libraries: self.libraries,
        }
    }
}

impl<const N: usize> Layer<N> {
    fn bytes(&self) -> u64 {
        (8 * N * self.values.len() + 12 * self.corners.len()) as u64
    }

    fn divided(mut self, made: impl Fn([f64; N]) -> [f64; N]) -> Self {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut corners = Vec::with_capacity(4 * self.corners.len());
        for &[a, b, c] in &self.corners {
            let mut middle = |p: u32, q: u32| {
                if p == q || p == NONE || q == NONE {
                    return if p == q { p } else { NONE };
                }
                *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                    let (from, to) = (self.values[p as usize], self.values[q as usize]);
                    self.values.push(made(std::array::from_fn(|k| 0.5 * (from[k] + to[k]))));
                    self.values.len() as u32 - 1
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            corners.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        Self { corners, ..self }
    }
}

impl Labels {
    /// Whether no face has a name.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    fn bytes(&self) -> u64 {
        (self.names.iter().map(|name| 24 + name.len()).sum::<usize>() + 8 * self.runs.len()) as u64
    }

    /// The names of `faces` faces, run by run: the faces of the run, and its name.
    pub fn runs(&self, faces: usize) -> impl Iterator<Item = (std::ops::Range<usize>, Option<&[u8]>)> {
        let first = self.runs.first().map_or(faces, |run| run[0] as usize).min(faces);
        let unnamed = (first > 0).then_some((0..first, None));
        unnamed.into_iter().chain(self.runs.iter().enumerate().map(move |(k, &[from, name])| {
            let to = self.runs.get(k + 1).map_or(faces, |next| next[0] as usize);
            (from as usize..to, self.names.get(name as usize).map(Vec::as_slice))
        }))
    }

    /// The first face of each run, and the number of its name, or −1.
    pub(crate) fn numbers(&self, faces: usize) -> impl Iterator<Item = (usize, i32)> {
        let runs = self.runs.iter().filter(move |run| (run[0] as usize) < faces);
        runs.map(|&[from, name]| (from as usize, if name == NONE { -1 } else { name as i32 }))
    }

    /// Begins a run at a face that is none of an earlier run's.
    pub(crate) fn begin(&mut self, face: u32, name: u32) {
        if self.runs.last().is_some_and(|last| last[0] == face) {
            self.runs.pop();
        }
        if self.runs.last().map_or(NONE, |last| last[1]) != name {
            self.runs.push([face, name]);
        }
    }

    /// The same names for other faces: of each of these the old one, mostly ascending.
    fn renumbered(self, origins: impl Iterator<Item = u32>) -> Self {
        let mut own = Self { names: self.names, runs: Vec::new() };
        if own.names.is_empty() {
            return own;
        }
        let mut current = NONE;
        for (face, origin) in origins.enumerate() {
            let after = self.runs.partition_point(|run| run[0] <= origin);
            let name = after.checked_sub(1).map_or(NONE, |run| self.runs[run][1]);
            if name != current {
                own.runs.push([face as u32, name]);
                current = name;
            }
        }
        own
    }

    fn divided(mut self) -> Self {
        self.runs.iter_mut().for_each(|run| run[0] *= 4);
        self
    }
}

#[cfg(test)]
mod tests;
