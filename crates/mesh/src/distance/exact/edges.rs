//! Half-edges with their lengths, the shapes of faces above them, and who lies beside whom.

use std::collections::HashMap;
use std::f64::consts::TAU;

use chladni_base::Vector3;

use crate::TriangleMesh;

/// Angles that exceed 2π by less do so by rounding.
const FLAT: f64 = 1e-10;

/// Half-edge `3f + i` runs along face `f` from its corner `i` to the next.
#[derive(Debug)]
pub(super) struct Edges {
    faces: Vec<[u32; 3]>,
    /// The unit of all lengths, a power of two near the longest edge.
    unit: f64,
    lengths: Vec<f64>,
    /// The third corner over each half-edge: along it, and above.
    apexes: Vec<(f64, f64)>,
    /// The half-edges of each edge, one after the other; where those of a half-edge begin and end.
    by_edge: Vec<u32>,
    ranges: Vec<[u32; 2]>,
    /// The half-edges opposite to each vertex.
    opposite: Vec<u32>,
    offsets: Vec<u32>,
    /// Whether shortest paths may turn at a vertex.
    turns: Vec<bool>,
}

impl Edges {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let (n, faces) = (mesh.positions.len(), mesh.faces.clone());
        let unit = unit(mesh);
        let at = |v: u32| mesh.point(v) / unit;
        let distance = |a: u32, b: u32| (at(a) - at(b)).norm();
        // The same whichever way an edge is followed.
        let side = |face: &[u32; 3], i: usize| (face[i].min(face[(i + 1) % 3]), face[i].max(face[(i + 1) % 3]));
        let lengths: Vec<f64> =
            faces.iter().flat_map(|face| (0..3).map(move |i| side(face, i))).map(|(a, b)| distance(a, b)).collect();
        let mut apexes = Vec::with_capacity(lengths.len());
        let mut angles = vec![0.0; n];
        let mut turns = vec![false; n];
        for (face, own) in faces.iter().zip(lengths.as_chunks::<3>().0) {
            let doubled = doubled_area(face.map(at));
            for i in 0..3 {
                let (base, left) = (own[i], own[(i + 2) % 3]);
                // Lengths of sides that are long beside the base would lose it.
                let along = if base > 0.0 { along(face.map(at), i) / base } else { 0.0 };
                let above = if base > 0.0 { doubled / base } else { left };
                apexes.push((along, above));
                angles[face[i] as usize] += above.atan2(along);
                // Nothing is known of angles where there is no area.
                turns[face[i] as usize] |= !(doubled > 0.0);
            }
        }
        let (by_edge, ranges) = by_edge(&faces);
        for (half, range) in ranges.iter().enumerate() {
            // A boundary, or faces that meet in a book.
            if range[1] - range[0] != 2 {
                let (face, i) = (faces[half / 3], half % 3);
                turns[face[i] as usize] = true;
                turns[face[(i + 1) % 3] as usize] = true;
            }
        }
        turns.iter_mut().zip(&angles).for_each(|(turns, &angle)| *turns |= angle > TAU + FLAT);
        let (opposite, offsets) = opposite(n, &faces);
        Self { faces, unit, lengths, apexes, by_edge, ranges, opposite, offsets, turns }
    }

    pub fn vertices(&self) -> usize {
        self.turns.len()
    }

    /// How many half-edges there are.
    pub fn halves(&self) -> usize {
        self.lengths.len()
    }

    /// The unit of all lengths.
    pub fn unit(&self) -> f64 {
        self.unit
    }

    pub fn origin(&self, half: u32) -> u32 {
        self.faces[half as usize / 3][half as usize % 3]
    }

    pub fn end(&self, half: u32) -> u32 {
        self.faces[half as usize / 3][(half as usize + 1) % 3]
    }

    /// The corner that does not lie on it.
    pub fn third(&self, half: u32) -> u32 {
        self.faces[half as usize / 3][(half as usize + 2) % 3]
    }

    pub fn length(&self, half: u32) -> f64 {
        self.lengths[half as usize]
    }

    pub fn apex(&self, half: u32) -> (f64, f64) {
        self.apexes[half as usize]
    }

    /// The next two half-edges of the face.
    pub fn sides(&self, half: u32) -> [u32; 2] {
        let first = half - half % 3;
        [first + (half + 1) % 3, first + (half + 2) % 3]
    }

    /// All half-edges of the same edge, itself among them.
    pub fn same_edge(&self, half: u32) -> &[u32] {
        let [from, to] = self.ranges[half as usize];
        &self.by_edge[from as usize..to as usize]
    }

    /// The half-edges opposite to a vertex, one for each of its faces.
    pub fn opposite(&self, vertex: u32) -> &[u32] {
        &self.opposite[self.offsets[vertex as usize] as usize..self.offsets[vertex as usize + 1] as usize]
    }

    /// Whether shortest paths may turn here: on a boundary, and where angles sum to more than 2π.
    pub fn turns(&self, vertex: u32) -> bool {
        self.turns[vertex as usize]
    }
}

/// A power of two near the longest edge; 1 where there is none to speak of.
fn unit(mesh: &TriangleMesh) -> f64 {
    let sides = mesh.faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let difference = |[a, b]: [u32; 2]| {
        let (p, q) = (mesh.positions[a as usize], mesh.positions[b as usize]);
        (0..3).map(|k| (p[k] - q[k]).abs()).fold(0.0, f64::max)
    };
    let longest = sides.map(difference).fold(0.0, f64::max);
    if longest > 1e-300 && longest < 1e300 { longest.log2().round().exp2() } else { 1.0 }
}

/// The product of side `i` and of the way from where it begins to the corner that does not lie on it.
fn along(corners: [Vector3; 3], i: usize) -> f64 {
    let [p, q, r] = std::array::from_fn(|k| corners[(i + k) % 3]);
    (q - p).dot(r - p)
}

fn doubled_area(corners: [Vector3; 3]) -> f64 {
    // From the two shorter sides: two long ones are nearly parallel where the third is short, and their product is what
    // rounding leaves.
    let opposite: [f64; 3] = std::array::from_fn(|i| (corners[(i + 1) % 3] - corners[(i + 2) % 3]).norm_squared());
    let at = (0..3).fold(0, |best, i| if opposite[i] > opposite[best] { i } else { best });
    let [p, q, r] = std::array::from_fn(|k| corners[(at + k) % 3]);
    (q - p).cross(r - p).norm()
}

/// The half-edges of each edge side by side, and for each half-edge where those of its edge lie.
fn by_edge(faces: &[[u32; 3]]) -> (Vec<u32>, Vec<[u32; 2]>) {
    let key = |half: usize| {
        let (face, i) = (faces[half / 3], half % 3);
        let [a, b] = [face[i], face[(i + 1) % 3]];
        (a.min(b), a.max(b))
    };
    let mut halves: HashMap<(u32, u32), Vec<u32>> = HashMap::with_capacity(2 * faces.len());
    (0..3 * faces.len()).for_each(|half| halves.entry(key(half)).or_default().push(half as u32));
    let (mut by_edge, mut ranges) = (Vec::with_capacity(3 * faces.len()), vec![[0; 2]; 3 * faces.len()]);
    for half in 0..3 * faces.len() {
        // At the first of an edge all of them are written.
        if let Some(own) = halves.remove(&key(half)) {
            let range = [by_edge.len() as u32, (by_edge.len() + own.len()) as u32];
            own.iter().for_each(|&half| ranges[half as usize] = range);
            by_edge.extend(own);
        }
    }
    (by_edge, ranges)
}

/// The half-edges opposite to each vertex, vertex after vertex, and where those of each begin.
fn opposite(n: usize, faces: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; n + 1];
    faces.iter().flatten().for_each(|&v| offsets[v as usize + 1] += 1);
    (0..n).for_each(|v| offsets[v + 1] += offsets[v]);
    let (mut places, mut opposite) = (offsets.clone(), vec![0; 3 * faces.len()]);
    for (f, face) in faces.iter().enumerate() {
        for (i, &v) in face.iter().enumerate() {
            opposite[places[v as usize] as usize] = (3 * f + (i + 1) % 3) as u32;
            places[v as usize] += 1;
        }
    }
    (opposite, offsets)
}
