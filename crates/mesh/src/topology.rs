//! How the faces of a mesh hang together: edges, fans around vertices, boundary loops, components, orientation.
//!
//! Half-edge `3f + c` of face `f` runs from its corner `c` to the next one. Nothing here looks at positions.

use super::connected::Components;
use super::report::Tally;
use chladni_base::parallel::*;

/// The twin of a half-edge whose edge has no other face.
pub(super) const BOUNDARY: u32 = u32::MAX;
/// The twin of a half-edge whose edge has three or more faces.
pub(super) const NON_MANIFOLD: u32 = u32::MAX - 1;
/// The most faces that the packed records can number.
pub(super) const MOST_FACES: usize = (u32::MAX / 6) as usize;

const VERTICES_PER_CHUNK: usize = 1 << 14;

/// All half-edges, grouped by edge: those of the edges at their lower vertex `v` lie in `offsets[v]..offsets[v + 1]`,
/// sorted.
///
/// A record holds the higher vertex (32 bits), the half-edge (31 bits), and whether it runs from the higher to the
/// lower vertex.
pub(super) struct EdgeTable {
    offsets: Vec<u32>,
    records: Vec<u64>,
}

/// The half-edge of a record.
pub(super) fn half_edge(record: u64) -> u32 {
    (record as u32) >> 1
}

/// Whether the half-edge of a record runs from the higher to the lower vertex.
pub(super) fn runs_down(record: u64) -> bool {
    record & 1 == 1
}

/// The vertex that half-edge `h` starts at.
fn tail(faces: &[[u32; 3]], h: u32) -> u32 {
    faces[h as usize / 3][h as usize % 3]
}

/// The vertex of the face of `h` that is not on `h`.
pub(super) fn apex(faces: &[[u32; 3]], h: u32) -> u32 {
    faces[h as usize / 3][(h as usize % 3 + 2) % 3]
}

impl EdgeTable {
    /// Groups the half-edges of at most [`MOST_FACES`] faces over `vertices` vertices; no face may repeat a vertex.
    pub(super) fn new(vertices: usize, faces: &[[u32; 3]]) -> Self {
        // A counting sort by the lower vertex, then many short sorts: on real meshes this beats one long sort, since
        // faces that are close in the file are close in the table.
        let mut offsets = vec![0u32; vertices + 2];
        for &[a, b, c] in faces {
            offsets[a.min(b) as usize + 2] += 1;
            offsets[b.min(c) as usize + 2] += 1;
            offsets[c.min(a) as usize + 2] += 1;
        }
        for v in 2..offsets.len() {
            offsets[v] += offsets[v - 1];
        }
        let mut records = vec![0u64; 3 * faces.len()];
        for (f, face) in faces.iter().enumerate() {
            for c in 0..3 {
                let (from, to) = (face[c], face[if c == 2 { 0 } else { c + 1 }]);
                let (low, high) = (from.min(to), from.max(to));
                let slot = &mut offsets[low as usize + 1];
                records[*slot as usize] =
                    u64::from(high) << 32 | u64::from((3 * f + c) as u32) << 1 | u64::from(from > to);
                *slot += 1;
            }
        }
        offsets.pop();

        let mut chunks = Vec::with_capacity(vertices / VERTICES_PER_CHUNK + 1);
        let mut rest = records.as_mut_slice();
        for first in (0..vertices).step_by(VERTICES_PER_CHUNK) {
            let own = &offsets[first..=(first + VERTICES_PER_CHUNK).min(vertices)];
            let (chunk, later) = rest.split_at_mut((own[own.len() - 1] - own[0]) as usize);
            chunks.push((own, chunk));
            rest = later;
        }
        chunks.into_par_iter().for_each(|(own, chunk)| {
            for pair in own.windows(2) {
                chunk[(pair[0] - own[0]) as usize..(pair[1] - own[0]) as usize].sort_unstable();
            }
        });
        Self { offsets, records }
    }

    /// Calls `visit(low, high, records)` for each edge, ascending by `(low, high)`.
    pub(super) fn for_each_edge(&self, mut visit: impl FnMut(u32, u32, &[u64])) {
        for (low, range) in self.offsets.windows(2).enumerate() {
            let mut rest = &self.records[range[0] as usize..range[1] as usize];
            while let Some(&first) = rest.first() {
                let same = rest.iter().take_while(|&&r| r >> 32 == first >> 32).count();
                visit(low as u32, (first >> 32) as u32, &rest[..same]);
                rest = &rest[same..];
            }
        }
    }

    /// The faces that name the same vertices in the same direction as an earlier one, ascending.
    pub(super) fn duplicate_faces(&self, faces: &[[u32; 3]]) -> Vec<u32> {
        let mut duplicates = Vec::new();
        let mut beside = Vec::new();
        self.for_each_edge(|_, _, records| {
            // Duplicates run along their edges in the same direction, which on a clean mesh no two faces do.
            if records.len() < 2 || (records.len() == 2 && runs_down(records[0]) != runs_down(records[1])) {
                return;
            }
            beside.clear();
            beside.extend(records.iter().map(|&r| (runs_down(r), apex(faces, half_edge(r)), half_edge(r) / 3)));
            beside.sort_unstable();
            duplicates.extend(beside.windows(2).filter(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1)).map(|w| w[1].2));
        });
        duplicates.sort_unstable();
        duplicates.dedup();
        duplicates
    }
}

/// How the faces hang together.
pub(super) struct Topology {
    /// The other half-edge of each half-edge's edge, or [`BOUNDARY`] or [`NON_MANIFOLD`].
    twins: Vec<u32>,
    /// The number of faces at each vertex.
    pub(super) valences: Vec<u32>,
    /// The number of edges.
    pub(super) edges: usize,
    /// The number of edges with one face.
    pub(super) boundary_edges: usize,
    /// The number of closed chains of boundary edges.
    pub(super) boundary_loops: usize,
    /// The number of components, joined through vertices.
    pub(super) components: usize,
    /// Edges with three or more faces, by their first face.
    pub(super) non_manifold_edges: Tally,
    /// Vertices whose faces form several fans, while none of their edges is non-manifold.
    pub(super) non_manifold_vertices: Tally,
    /// Edges whose two faces run along them in the same direction, by their first face.
    pub(super) inconsistent_edges: Tally,
}

impl Topology {
    /// Reads everything off a table of the edges of these `faces`.
    pub(super) fn new(table: &EdgeTable, faces: &[[u32; 3]]) -> Self {
        let vertices = table.offsets.len() - 1;
        let mut twins = vec![BOUNDARY; 3 * faces.len()];
        let mut components = Components::new(vertices);
        let mut on_non_manifold_edge = Vec::new();
        let (mut edges, mut boundary_edges) = (0, 0);
        let (mut non_manifold, mut inconsistent) = (Vec::new(), Vec::new());
        table.for_each_edge(|low, high, records| {
            edges += 1;
            components.join(low, high);
            match *records {
                [_] => boundary_edges += 1,
                [one, other] => {
                    let (g, h) = (half_edge(one), half_edge(other));
                    twins[g as usize] = h;
                    twins[h as usize] = g;
                    if runs_down(one) == runs_down(other) {
                        inconsistent.push(g.min(h) / 3);
                    }
                }
                _ => {
                    on_non_manifold_edge.resize(vertices, false);
                    on_non_manifold_edge[low as usize] = true;
                    on_non_manifold_edge[high as usize] = true;
                    for &record in records {
                        twins[half_edge(record) as usize] = NON_MANIFOLD;
                    }
                    non_manifold.extend(records.iter().map(|&r| half_edge(r) / 3).min());
                }
            }
        });
        non_manifold.sort_unstable();
        inconsistent.sort_unstable();

        let mut valences = vec![0u32; vertices];
        let mut corners = vec![0u32; vertices];
        for (f, face) in faces.iter().enumerate() {
            for (c, &v) in face.iter().enumerate() {
                valences[v as usize] += 1;
                corners[v as usize] = (3 * f + c) as u32;
            }
        }
        let non_manifold_vertices = (0..vertices)
            .into_par_iter()
            .with_min_len(VERTICES_PER_CHUNK)
            .fold(Tally::default, |mut tally, v| {
                if valences[v] > 0
                    && !on_non_manifold_edge.get(v).is_some_and(|&on| on)
                    && fan_length(faces, &twins, corners[v]) < valences[v]
                {
                    tally.add(v as u64);
                }
                tally
            })
            .reduce(Tally::default, Tally::append);

        Self {
            edges,
            boundary_edges,
            boundary_loops: boundary_loops(faces, &twins, boundary_edges),
            // Those that hold a vertex with faces.
            components: components.roots().filter(|&v| valences[v] > 0).count(),
            non_manifold_edges: tally(&non_manifold),
            non_manifold_vertices,
            inconsistent_edges: tally(&inconsistent),
            twins,
            valences,
        }
    }

    /// Turns faces over so that neighbours across manifold edges agree, in each part where that can be done; of two
    /// ways the one that turns fewer faces. Gives the number turned, and whether every part could be oriented.
    pub(super) fn orient(&self, faces: &mut [[u32; 3]]) -> (usize, bool) {
        if self.inconsistent_edges.count == 0 {
            return (0, true);
        }
        const UNSEEN: u8 = 2;
        let mut turned = vec![UNSEEN; faces.len()];
        let mut part = Vec::new();
        let (mut flips, mut orientable) = (0, true);
        for seed in 0..faces.len() {
            if turned[seed] != UNSEEN {
                continue;
            }
            part.clear();
            part.push(seed as u32);
            turned[seed] = 0;
            let (mut done, mut consistent) = (0, true);
            while let Some(&f) = part.get(done) {
                done += 1;
                for h in 3 * f..3 * f + 3 {
                    let twin = self.twins[h as usize];
                    if twin == BOUNDARY || twin == NON_MANIFOLD {
                        continue;
                    }
                    let same_way = u8::from(tail(faces, h) == tail(faces, twin));
                    let wanted = turned[f as usize] ^ same_way;
                    let neighbour = &mut turned[twin as usize / 3];
                    if *neighbour == UNSEEN {
                        *neighbour = wanted;
                        part.push(twin / 3);
                    } else {
                        consistent &= *neighbour == wanted;
                    }
                }
            }
            orientable &= consistent;
            let odd = part.iter().filter(|&&f| turned[f as usize] == 1).count();
            let turn = u8::from(2 * odd <= part.len());
            for &f in &part {
                let flip = consistent && turned[f as usize] == turn;
                flips += usize::from(flip);
                turned[f as usize] = u8::from(flip);
            }
        }
        for (face, &turn) in faces.iter_mut().zip(&turned) {
            if turn == 1 {
                face.swap(1, 2);
            }
        }
        (flips, orientable)
    }
}

fn tally(faces: &[u32]) -> Tally {
    let mut tally = Tally::default();
    faces.iter().for_each(|&f| tally.add(u64::from(f)));
    tally
}

/// Crosses the edge of `h` around `vertex`: the half-edge by which the next face's corner at `vertex` is left again.
/// `None` where the edge has no one other face.
fn cross(faces: &[[u32; 3]], twins: &[u32], vertex: u32, h: u32) -> Option<u32> {
    let twin = twins[h as usize];
    if twin >= NON_MANIFOLD {
        return None;
    }
    let (face, corner) = (twin / 3, twin % 3);
    Some(if tail(faces, twin) == vertex { 3 * face + (corner + 2) % 3 } else { 3 * face + (corner + 1) % 3 })
}

/// The number of faces in the fan that holds a corner, given as the half-edge that starts there.
fn fan_length(faces: &[[u32; 3]], twins: &[u32], corner: u32) -> u32 {
    let vertex = tail(faces, corner);
    let first = corner / 3;
    let mut length = 1;
    // The corners at a vertex form paths and cycles, so a walk either ends or comes back to the face it left.
    let mut h = corner;
    while let Some(next) = cross(faces, twins, vertex, h) {
        if next / 3 == first {
            return length;
        }
        length += 1;
        h = next;
    }
    h = 3 * first + (corner + 2) % 3;
    while let Some(next) = cross(faces, twins, vertex, h) {
        length += 1;
        h = next;
    }
    length
}

/// The number of chains of boundary edges, each followed through the fans at its ends.
fn boundary_loops(faces: &[[u32; 3]], twins: &[u32], boundary_edges: usize) -> usize {
    let mut borders = Vec::with_capacity(boundary_edges);
    borders.extend((0..twins.len() as u32).filter(|&h| twins[h as usize] == BOUNDARY));
    let mut chains = Components::new(borders.len());
    for (i, &border) in borders.iter().enumerate() {
        let (face, corner) = (border / 3, border % 3);
        let ends = [
            (tail(faces, border), 3 * face + (corner + 2) % 3),
            (faces[face as usize][(corner as usize + 1) % 3], 3 * face + (corner + 1) % 3),
        ];
        for (vertex, mut h) in ends {
            while let Some(next) = cross(faces, twins, vertex, h) {
                h = next;
            }
            if let Ok(j) = borders.binary_search(&h) {
                chains.join(i as u32, j as u32);
            }
        }
    }
    chains.roots().count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topology(vertices: usize, faces: &[[u32; 3]]) -> Topology {
        Topology::new(&EdgeTable::new(vertices, faces), faces)
    }

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    #[test]
    fn a_tetrahedron_is_closed_and_consistent() {
        let t = topology(4, &TETRAHEDRON);
        assert_eq!((t.edges, t.boundary_edges, t.boundary_loops, t.components), (6, 0, 0, 1));
        assert_eq!((t.non_manifold_edges.count, t.non_manifold_vertices.count, t.inconsistent_edges.count), (0, 0, 0));
        assert_eq!(t.valences, [3; 4]);
    }

    #[test]
    fn a_pillow_of_two_faces_is_closed_and_has_no_duplicate() {
        let faces = [[0, 1, 2], [0, 2, 1]];
        let t = topology(3, &faces);
        assert_eq!((t.edges, t.boundary_edges, t.non_manifold_vertices.count), (3, 0, 0));
        assert!(EdgeTable::new(3, &faces).duplicate_faces(&faces).is_empty());
    }

    #[test]
    fn duplicates_are_found_whatever_corner_they_begin_with() {
        let faces = [[0, 1, 2], [5, 3, 4], [1, 2, 0], [3, 4, 5], [2, 1, 0], [4, 5, 3]];
        assert_eq!(EdgeTable::new(6, &faces).duplicate_faces(&faces), [2, 3, 5]);
    }

    #[test]
    fn fans_that_meet_in_a_vertex_only_make_it_non_manifold() {
        let t = topology(5, &[[0, 1, 2], [0, 3, 4]]);
        assert_eq!((t.non_manifold_vertices.count, t.non_manifold_vertices.examples.as_slice()), (1, &[0u64][..]));
        assert_eq!((t.components, t.boundary_edges), (1, 6));
        // Separated at the vertex, these are two triangles, each with its own boundary.
        assert_eq!(t.boundary_loops, 2);
    }

    #[test]
    fn a_page_with_three_faces_is_a_non_manifold_edge_and_nothing_else() {
        let t = topology(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert_eq!((t.non_manifold_edges.count, t.non_manifold_vertices.count, t.inconsistent_edges.count), (1, 0, 0));
        assert_eq!(t.edges, 7);
    }

    #[test]
    fn orientation_is_repaired_by_turning_the_minority() {
        let mut faces = TETRAHEDRON;
        faces[2].swap(0, 1);
        let t = topology(4, &faces);
        assert_eq!(t.inconsistent_edges.count, 3);
        assert_eq!(t.orient(&mut faces), (1, true));
        assert_eq!(topology(4, &faces).inconsistent_edges.count, 0);
        assert_eq!((faces[0], faces[1], faces[3]), (TETRAHEDRON[0], TETRAHEDRON[1], TETRAHEDRON[3]));
    }

    #[test]
    fn a_moebius_strip_is_left_as_it_is() {
        let n = 9u32;
        let mut faces: Vec<[u32; 3]> = (0..n).map(|i| [i, (i + 1) % n, (i + 2) % n]).collect();
        faces.iter_mut().skip(1).step_by(2).for_each(|f| f.swap(0, 1));
        let before = faces.clone();
        let t = topology(n as usize, &faces);
        assert_eq!((t.boundary_edges, t.boundary_loops, t.non_manifold_vertices.count), (9, 1, 0));
        assert_eq!(t.orient(&mut faces), (0, false));
        assert_eq!(faces, before);
    }
}
