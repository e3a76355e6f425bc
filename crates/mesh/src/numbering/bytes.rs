//! A numbering as bytes, to be stored behind the mesh that it belongs to.

use super::Numbering;
use crate::repair::DROPPED;
use crate::subdivide;

/// The head: five counts as u64, then which maps follow and how often faces were divided, in eight bytes.
const HEAD: usize = 48;

impl Numbering {
    /// The numbering as bytes, little-endian: counts of file and kept mesh, the maps that differ from the identity, and
    /// the nearest vertices of dropped ones.
    pub fn to_bytes(&self) -> Vec<u8> {
        let maps = [&self.vertices, &self.faces];
        let mut out = Vec::with_capacity(HEAD + self.bytes() as usize);
        for count in self.file.into_iter().chain(self.kept).chain([self.inner]) {
            out.extend((count as u64).to_le_bytes());
        }
        out.extend([
            maps[0].is_some().into(),
            maps[1].is_some().into(),
            self.subdivisions,
            self.assumed.into(),
            0,
            0,
            0,
            0,
        ]);
        for number in maps.into_iter().flatten().flatten().chain(&self.nearest) {
            out.extend(number.to_le_bytes());
        }
        out
    }

    /// Reads what [`to_bytes`](Self::to_bytes) made for a mesh with these faces; `None` where it does not fit.
    pub fn from_bytes(bytes: &[u8], faces: &[[u32; 3]]) -> Option<Self> {
        let (head, body) = bytes.split_at_checked(HEAD)?;
        let (words, _) = head.as_chunks::<8>();
        let count = |k: usize| usize::try_from(u64::from_le_bytes(words[k])).ok();
        let (file, kept, inner) = ([count(0)?, count(1)?], [count(2)?, count(3)?], count(4)?);
        let [has_vertices, has_faces, subdivisions, assumed, ..] = words[5];
        if kept[1] != faces.len() || body.len() % 4 != 0 || subdivisions > subdivide::MOST_SUBDIVISIONS {
            return None;
        }
        let mut numbers = body.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word));
        let mut left = numbers.len();
        let mut map = |wanted: bool, length: usize, below: usize, dropped: bool| -> Option<Option<Vec<u32>>> {
            if !wanted {
                return Some(None);
            }
            left = left.checked_sub(length)?;
            let map: Vec<u32> = numbers.by_ref().take(length).collect();
            let fits = |&number: &u32| (number as usize) < below || (dropped && number == DROPPED);
            map.iter().all(fits).then_some(Some(map))
        };
        let vertices = map(has_vertices != 0, file[0], kept[0], true)?;
        let own_faces = map(has_faces != 0, kept[1], file[1], false)?;
        let dropped = vertices.iter().flatten().filter(|&&kept| kept == DROPPED).count();
        let nearest = map(true, dropped, kept[0], true)?.unwrap_or_default();
        if left != 0 || (vertices.is_none() && file[0] > kept[0]) || (own_faces.is_none() && file[1] < kept[1]) {
            return None;
        }
        let midpoints = subdivide::midpoints(faces, subdivisions);
        if midpoints.len() > kept[0]
            || midpoints.iter().flatten().any(|&end| end as usize >= kept[0])
            || inner > kept[0]
        {
            return None;
        }
        Some(Self {
            file,
            kept,
            vertices,
            faces: own_faces,
            nearest,
            midpoints,
            subdivisions,
            inner,
            assumed: assumed != 0,
            ..Self::default()
        })
    }
}
