//! What an OBJ says beside positions and faces. None of it is needed to solve anything, so nothing here refuses a file:
//! a texture coordinate that is no number, or a corner that names none of the file's, is left out and counted.

use std::collections::HashMap;

use super::text::Text;
use super::{RawAttributes, RawMesh, ReadLimits};
use crate::attributes::{Attributes, Labels, Layer, NONE};

/// A reference to a line that is not there; no layer has so many values.
const MISSING: u32 = NONE - 1;

/// The values of `vt` or `vn` lines and, corner after corner, which of them are named.
struct Named<const N: usize> {
    /// The first lines, as many as there may be vertices: corners that name a later one name what is not there.
    values: Vec<[f64; N]>,
    most: usize,
    /// All lines, those that are not kept among them.
    lines: usize,
    /// Corners after the last one that names a value are not there.
    corners: Vec<u32>,
}

impl<const N: usize> Named<N> {
    fn new(most: usize) -> Self {
        Self { values: Vec::new(), most, lines: 0, corners: Vec::new() }
    }

    fn value(&mut self, text: &mut Text) {
        self.lines += 1;
        if self.lines > self.most {
            return;
        }
        let mut value = [0.0; N];
        for (k, slot) in value.iter_mut().enumerate() {
            // `vt u` alone is a texture of one dimension.
            *slot = match text.on_line() {
                true => text.float("a number").unwrap_or(f64::NAN),
                false if k == 1 && N == 2 => 0.0,
                false => f64::NAN,
            };
        }
        self.values.push(value);
    }

    fn corner(&mut self, corner: usize, word: &[u8]) {
        if word.is_empty() {
            return;
        }
        let index = std::str::from_utf8(word).ok().and_then(|word| word.parse::<i64>().ok());
        let index = match index {
            Some(index) if index > 0 => u32::try_from(index - 1).unwrap_or(MISSING).min(MISSING),
            Some(index) if index < 0 => {
                let back = usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX);
                self.lines.checked_sub(back).map_or(MISSING, |index| u32::try_from(index).unwrap_or(MISSING))
            }
            _ => MISSING,
        };
        self.corners.resize(corner, NONE);
        self.corners.push(index);
    }

    /// The layer of these triangles, whose corners are told by their numbers in the file; and how many corners name
    /// what is not there.
    fn layer(self, triangles: &[[u32; 3]]) -> (Option<Layer<N>>, usize) {
        let Self { values, mut corners, .. } = self;
        let mut missing = 0;
        for index in corners.iter_mut().filter(|index| **index != NONE) {
            let there = values.get(*index as usize).is_some_and(|value| value.iter().all(|x| x.is_finite()));
            if !there {
                (*index, missing) = (NONE, missing + 1);
            }
        }
        let at = |corner: u32| corners.get(corner as usize).copied().unwrap_or(NONE);
        let corners: Vec<[u32; 3]> = triangles.iter().map(|triangle| triangle.map(at)).collect();
        let is_used = corners.iter().flatten().any(|&index| index != NONE);
        (is_used.then_some(Layer { values, corners }), missing)
    }
}

/// Names, and from which polygon on each of them holds.
struct Names {
    /// Different ones, so many at most; a further one counts as none.
    names: Vec<Vec<u8>>,
    most: usize,
    numbers: HashMap<Vec<u8>, u32>,
    from: Vec<[u32; 2]>,
}

impl Names {
    fn new(most: usize) -> Self {
        Self { names: Vec::new(), most, numbers: HashMap::new(), from: Vec::new() }
    }

    fn begin(&mut self, polygon: usize, name: Vec<u8>) {
        let number = match name.is_empty() || (self.names.len() >= self.most && !self.numbers.contains_key(&name)) {
            true => NONE,
            false => *self.numbers.entry(name).or_insert_with_key(|name| {
                self.names.push(name.clone());
                self.names.len() as u32 - 1
            }),
        };
        self.from.push([polygon as u32, number]);
    }

    fn labels(self, mesh: &RawMesh) -> Labels {
        let mut labels = Labels::default();
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        for (k, &[polygon, name]) in self.from.iter().enumerate() {
            let first = |polygon: u32| match &mesh.polygons {
                None => polygon,
                Some(polygons) => polygons.of_triangle.partition_point(|&own| own < polygon) as u32,
            };
            let (face, end) = (first(polygon), self.from.get(k + 1).map_or(u32::MAX, |next| first(next[0])));
            // Names of no triangle are left out.
            if face == end || face as usize >= mesh.faces.len() {
                continue;
            }
            let name = if name == NONE {
                NONE
            } else {
                *numbers.entry(name).or_insert_with(|| {
                    labels.names.push(self.names[name as usize].clone());
                    labels.names.len() as u32 - 1
                })
            };
            labels.begin(face, name);
        }
        labels
    }
}

/// What was read so far.
pub(super) struct ReadAttributes {
    texture: Named<2>,
    normals: Named<3>,
    groups: Names,
    objects: Names,
    materials: Names,
    libraries: Vec<Vec<u8>>,
    corners: usize,
}

impl ReadAttributes {
    pub fn new(limits: &ReadLimits) -> Self {
        Self {
            texture: Named::new(limits.vertices),
            normals: Named::new(limits.vertices),
            groups: Names::new(limits.groups),
            objects: Names::new(limits.groups),
            materials: Names::new(limits.groups),
            libraries: Vec::new(),
            corners: 0,
        }
    }

    /// A statement that is neither a vertex nor a face; `polygons` have been read.
    pub fn statement(&mut self, word: &[u8], text: &mut Text, polygons: usize) {
        match word {
            b"vt" => self.texture.value(text),
            b"vn" => self.normals.value(text),
            b"g" => self.groups.begin(polygons, words(text)),
            b"o" => self.objects.begin(polygons, words(text)),
            b"usemtl" => self.materials.begin(polygons, words(text)),
            b"mtllib" => {
                let name = words(text);
                if !name.is_empty() && !self.libraries.contains(&name) && self.libraries.len() < MOST_LIBRARIES {
                    self.libraries.push(name);
                }
            }
            _ => {}
        }
    }

    /// The next corner of a face, as far as it stands behind the first slash: `vt`, `vt/vn` or `/vn`.
    pub fn corner(&mut self, word: &[u8]) {
        if !word.is_empty() {
            let mut parts = word.splitn(2, |&byte| byte == b'/');
            self.texture.corner(self.corners, parts.next().unwrap_or_default());
            self.normals.corner(self.corners, parts.next().unwrap_or_default());
        }
        self.corners += 1;
    }

    /// Whether corners name anything.
    pub fn has_layers(&self) -> bool {
        self.corners <= MISSING as usize && !(self.texture.corners.is_empty() && self.normals.corners.is_empty())
    }

    /// All that is of use. `triangles` are those of the mesh, by the numbers of their corners in the file; empty where
    /// corners name nothing.
    pub fn finish(self, mesh: &RawMesh, triangles: &[[u32; 3]]) -> Option<Box<RawAttributes>> {
        let (texture, missing) = self.texture.layer(triangles);
        let (normals, more) = self.normals.layer(triangles);
        let [groups, objects, materials] = [self.groups, self.objects, self.materials].map(|names| names.labels(mesh));
        // A library without a material in use says nothing.
        let libraries = if materials.is_empty() { Vec::new() } else { self.libraries };
        let attributes = Attributes { texture, normals, groups, objects, materials, libraries };
        let missing = missing + more;
        (missing > 0 || !attributes.is_empty()).then(|| Box::new(RawAttributes { attributes, missing }))
    }
}

/// Further libraries are left out: they are compared one by one.
const MOST_LIBRARIES: usize = 64;

/// The words to the end of the line, a blank between them.
fn words(text: &mut Text) -> Vec<u8> {
    let mut words: Vec<u8> = Vec::new();
    while text.on_line() {
        if !words.is_empty() {
            words.push(b' ');
        }
        words.extend_from_slice(text.token());
    }
    words
}
