//! Repairs that lose nothing: merging equal positions, dropping faces and vertices that carry no surface.

use chladni_base::parallel::*;

/// Faces under repair, with the way back to their numbers in the input.
pub(super) struct Faces {
    pub(super) corners: Vec<[u32; 3]>,
    /// The number in the input of each face; `None` as long as none was dropped.
    origins: Option<Vec<u32>>,
}

impl Faces {
    pub(super) fn new(corners: Vec<[u32; 3]>) -> Self {
        Self { corners, origins: None }
    }

    /// The number in the input of a face.
    pub(super) fn origin(&self, face: u64) -> u64 {
        self.origins.as_ref().map_or(face, |origins| u64::from(origins[face as usize]))
    }

    /// The number in the input of every face, where some were dropped.
    pub(super) fn origins(&self) -> Option<&[u32]> {
        self.origins.as_deref()
    }

    /// Drops faces, given ascending.
    pub(super) fn drop_faces(&mut self, faces: &[u32]) {
        if faces.is_empty() {
            return;
        }
        let origins = self.origins.get_or_insert_with(|| (0..self.corners.len() as u32).collect());
        let (mut kept, mut next) = (0, faces.iter().peekable());
        for f in 0..self.corners.len() {
            if next.next_if(|&&drop| drop as usize == f).is_some() {
                continue;
            }
            self.corners[kept] = self.corners[f];
            origins[kept] = origins[f];
            kept += 1;
        }
        self.corners.truncate(kept);
        origins.truncate(kept);
    }

    /// The faces that satisfy a predicate, ascending.
    pub(super) fn select(&self, predicate: impl Fn(&[u32; 3]) -> bool + Sync) -> Vec<u32> {
        let hits = self.corners.par_chunks(1 << 16).enumerate().map(|(chunk, faces)| {
            let hits = faces.iter().enumerate().filter(|(_, face)| predicate(face));
            hits.map(|(f, _)| ((chunk << 16) + f) as u32).collect::<Vec<u32>>()
        });
        hits.collect::<Vec<_>>().concat()
    }
}

/// For each vertex the first one at exactly its position (`-0` equals `0`), where that is another; ascending pairs
/// `(vertex, first)`. Vertices that are not finite equal nothing.
pub(super) fn equal_positions(positions: &[[f64; 3]]) -> Vec<(u32, u32)> {
    // Adding zero turns -0 into 0, so that bits decide.
    let bits = |v: u32| positions[v as usize].map(|x| (x + 0.0).to_bits());
    let mut keys: Vec<u64> = (0..positions.len() as u32)
        .into_par_iter()
        .filter(|&v| positions[v as usize].iter().all(|x| x.is_finite()))
        .map(|v| (hash(bits(v)) & !u64::from(u32::MAX)) | u64::from(v))
        .collect();
    keys.par_sort_unstable();
    let mut pairs = Vec::new();
    let mut same = Vec::new();
    for run in keys.chunk_by(|a, b| a >> 32 == b >> 32).filter(|run| run.len() > 1) {
        same.clear();
        same.extend(run.iter().map(|&key| (bits(key as u32), key as u32)));
        same.sort_unstable();
        for equal in same.chunk_by(|a, b| a.0 == b.0) {
            pairs.extend(equal[1..].iter().map(|&(_, v)| (v, equal[0].1)));
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Mixes three words; the upper half of the result is what matters.
fn hash(words: [u64; 3]) -> u64 {
    words.into_iter().fold(0, |h: u64, word| {
        let mixed = (h ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) ^ (mixed >> 32)
    })
}

/// Marks a vertex of the input that has no counterpart in the repaired mesh.
pub const DROPPED: u32 = u32::MAX;

/// Renumbers the vertices that `used` marks from 0 in order, in place, and gives the new number of each old one
/// ([`DROPPED`] for the others).
pub(super) fn compact(positions: &mut Vec<[f64; 3]>, faces: &mut [[u32; 3]], used: impl Fn(usize) -> bool) -> Vec<u32> {
    let mut numbers = vec![DROPPED; positions.len()];
    let mut kept = 0;
    for v in 0..positions.len() {
        if used(v) {
            numbers[v] = kept as u32;
            positions[kept] = positions[v];
            kept += 1;
        }
    }
    positions.truncate(kept);
    faces.par_iter_mut().for_each(|face| *face = face.map(|v| numbers[v as usize]));
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_name_the_first_and_ignore_the_sign_of_zero() {
        let nan = f64::NAN;
        let positions =
            [[0.0, 1.0, 2.0], [nan; 3], [-0.0, 1.0, 2.0], [nan; 3], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [1.0, 0.0, 2.0]];
        assert_eq!(equal_positions(&positions), [(2, 0), (5, 0), (6, 4)]);
    }

    #[test]
    fn dropping_keeps_the_way_back() {
        let mut faces = Faces::new((0..6).map(|i| [i, i + 1, i + 2]).collect());
        faces.drop_faces(&[1, 4]);
        faces.drop_faces(&[0, 3]);
        assert_eq!(faces.corners, [[2, 3, 4], [3, 4, 5]]);
        assert_eq!((faces.origin(0), faces.origin(1)), (2, 3));
    }
}
