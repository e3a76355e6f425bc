//! Coarse levels of a field operator: aggregates of faces with transported frames, one smoothing step on the
//! interpolation, Galerkin products (smoothed aggregation, Vaněk et al. 1996).

use chladni_algebra::{Block, BlockMatrix, BlockPlaces, add_product};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::dual::{DualGraph, NO_FACE};

use crate::operator::frames::{FaceFrames, Turn};
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::{FieldKind, transport_block, turn};

/// Weight of the smoothing step on the interpolation, where the spectrum ends at 2.
const INTERPOLATION_WEIGHT: f64 = 0.75;

/// What rows that are coupled to nothing share in the interpolation: not quite nothing, so that levels stay definite
/// where all of an aggregate are such rows.
const UNCOUPLED: f64 = 0.03;

/// A neighbour, and the turn that carries its numbers here.
type Link = (u32, Turn);

/// Neighbours of the nodes of a level.
pub(super) struct Graph {
    offsets: Vec<u32>,
    links: Vec<Link>,
}

impl Graph {
    /// The dual graph with the turns of a kind of field.
    pub fn of_faces(kind: FieldKind, dual: &DualGraph, frames: &FaceFrames) -> Self {
        let mut offsets = Vec::with_capacity(dual.faces() + 1);
        offsets.push(0);
        let turns: Vec<[Option<Turn>; 3]> = (0..dual.faces())
            .into_par_iter()
            .with_min_len(1 << 12)
            .map(|f| [0, 1, 2].map(|k| turn(kind, dual, frames, f, k)))
            .collect();
        let mut links = Vec::with_capacity(3 * dual.faces());
        for (f, turns) in turns.iter().enumerate() {
            for (k, neighbour) in dual.neighbours(f).into_iter().enumerate() {
                if let (true, Some(turn)) = (neighbour != NO_FACE, turns[k]) {
                    links.push((neighbour, turn));
                }
            }
            offsets.push(links.len() as u32);
        }
        Self { offsets, links }
    }

    pub fn links(&self, node: usize) -> &[Link] {
        &self.links[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }
}

/// One level: the operator on its nodes, and for coarse levels the way back to the finer one.
pub(super) struct FieldLevel<const B: usize> {
    pub stiffness: BlockMatrix<B>,
    pub mass: BlockMatrix<B>,
    /// For each node the face at its root, in whose frame its numbers are.
    pub roots: Vec<u32>,
    /// For coarse levels: interpolation to the finer level.
    pub interpolation: Option<Interpolation<B>>,
}

pub(super) struct Interpolation<const B: usize> {
    /// Rows: nodes of the finer level.
    pub matrix: BlockMatrix<B>,
    /// The aggregate of each node of the finer level.
    aggregates: Vec<u32>,
}

impl<const B: usize> Interpolation<B> {
    /// The node of this level that a node of the finer one is part of.
    pub fn node_of(&self, fine: u32) -> u32 {
        self.aggregates[fine as usize]
    }
}

/// The levels of an operator, finest first: as many as it takes to bring the number of nodes down to `enough`.
pub(super) fn hierarchy<const B: usize>(
    operator: &FieldOperator<B>,
    dual: &DualGraph,
    frames: &FaceFrames,
    enough: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<FieldLevel<B>>, Cancelled> {
    let faces = dual.faces();
    let mass = BlockMatrix::from_rows(faces, faces, |f, entries| {
        entries.push((f as u32, scaled_identity(operator.mass[f])));
    });
    let finest = FieldLevel {
        stiffness: operator.stiffness.clone(),
        mass,
        roots: (0..faces as u32).collect(),
        interpolation: None,
    };
    let mut levels = vec![finest];
    let mut graph: Option<Graph> = None;
    while let Some(fine) = levels.last()
        && fine.roots.len() > enough
    {
        monitor.checkpoint()?;
        let own = graph.take().unwrap_or_else(|| Graph::of_faces(operator.kind, dual, frames));
        // Two rings of three neighbours make ten faces; one ring of a coarse node about seven nodes.
        let aggregates = Aggregates::new(&own, if levels.len() == 1 { 2 } else { 1 });
        if aggregates.count * 2 > fine.roots.len() {
            break;
        }
        let coarse = coarsen(operator.kind, fine, &aggregates, monitor)?;
        graph = Some(aggregates.graph(&own));
        levels.push(coarse);
    }
    Ok(levels)
}

/// A multiple of the identity.
pub(super) fn scaled_identity<const B: usize>(value: f64) -> Block<B> {
    let mut block = [[0.0; B]; B];
    for i in 0..B {
        block[i][i] = value;
    }
    block
}

/// A bound of the 2-norm of a block: exact for 2 × 2 blocks, at most √3 times too large for others.
pub(super) fn norm<const B: usize>(block: &Block<B>) -> f64 {
    let frobenius: f64 = block.as_flattened().iter().map(|x| x * x).sum();
    if B == 2 {
        let determinant = block[0][0] * block[1][1] - block[0][1] * block[1][0];
        return (0.5 * (frobenius + (frobenius * frobenius - 4.0 * determinant * determinant).max(0.0).sqrt())).sqrt();
    }
    let mut rows = 0.0f64;
    let mut columns = 0.0f64;
    for i in 0..B {
        rows = rows.max((0..B).map(|j| block[i][j].abs()).sum());
        columns = columns.max((0..B).map(|j| block[j][i].abs()).sum());
    }
    frobenius.sqrt().min((rows * columns).sqrt())
}

/// For each row a number by which it is to be divided so that the spectrum of the result ends at 2.
pub(super) fn row_scales<const B: usize>(matrix: &BlockMatrix<B>) -> Vec<f64> {
    (0..matrix.rows())
        .into_par_iter()
        .with_min_len(1 << 11)
        .map(|r| 0.5 * matrix.row(r).1.iter().map(norm).sum::<f64>())
        .collect()
}

struct Aggregates {
    /// The aggregate of each node, and what carries the numbers of its root to the node.
    of: Vec<u32>,
    carried: Vec<Turn>,
    roots: Vec<u32>,
    count: usize,
}

impl Aggregates {
    /// Greedy: a node all of whose `rings` rings are free becomes a root and takes them; what is left joins a
    /// neighbour.
    fn new(graph: &Graph, rings: usize) -> Self {
        let n = graph.offsets.len() - 1;
        let mut made = Self { of: vec![u32::MAX; n], carried: vec![Turn::NONE; n], roots: Vec::new(), count: 0 };
        let mut patch: Vec<(u32, Turn)> = Vec::new();
        let mut seen = vec![u32::MAX; n];
        for node in 0..n {
            if made.of[node] != u32::MAX {
                continue;
            }
            patch.clear();
            patch.push((node as u32, Turn::NONE));
            seen[node] = node as u32;
            let (mut begin, mut free) = (0, true);
            'rings: for _ in 0..rings {
                let end = patch.len();
                for at in begin..end {
                    let (i, carried) = patch[at];
                    for &(j, turn) in graph.links(i as usize) {
                        if seen[j as usize] != node as u32 {
                            if made.of[j as usize] != u32::MAX {
                                free = false;
                                break 'rings;
                            }
                            seen[j as usize] = node as u32;
                            patch.push((j, turn.inverse().after(carried)));
                        }
                    }
                }
                begin = end;
            }
            if free {
                made.take(&patch);
            }
        }
        // Orphans join the aggregate of a neighbour, in rounds, so that aggregates grow by one ring at most.
        let mut orphans: Vec<u32> = (0..n as u32).filter(|&i| made.of[i as usize] == u32::MAX).collect();
        while !orphans.is_empty() {
            let joined: Vec<(u32, u32, Turn)> = orphans
                .iter()
                .filter_map(|&i| {
                    let mut links = graph.links(i as usize).iter();
                    let &(j, turn) = links.find(|l| made.of[l.0 as usize] != u32::MAX)?;
                    Some((i, made.of[j as usize], turn.after(made.carried[j as usize])))
                })
                .collect();
            if joined.is_empty() {
                // A component too small for a patch: its first node becomes a root.
                made.take(&[(orphans[0], Turn::NONE)]);
            }
            for (i, aggregate, carried) in joined {
                made.of[i as usize] = aggregate;
                made.carried[i as usize] = carried;
            }
            orphans.retain(|&i| made.of[i as usize] == u32::MAX);
        }
        made
    }

    fn take(&mut self, patch: &[(u32, Turn)]) {
        for &(i, carried) in patch {
            self.of[i as usize] = self.count as u32;
            self.carried[i as usize] = carried;
        }
        self.roots.push(patch[0].0);
        self.count += 1;
    }

    /// The graph of the aggregates: turns are averaged over the links between two of them.
    fn graph(&self, fine: &Graph) -> Graph {
        let mut links: Vec<(u32, u32, Turn)> = Vec::new();
        for i in 0..self.of.len() {
            for &(j, turn) in fine.links(i) {
                let (a, b) = (self.of[i], self.of[j as usize]);
                if a != b {
                    let carried = turn.after(self.carried[j as usize]);
                    links.push((a, b, self.carried[i].inverse().after(carried)));
                }
            }
        }
        links.sort_by_key(|l| (l.0, l.1));
        let mut graph = Graph { offsets: vec![0; self.count + 1], links: Vec::new() };
        for same in links.chunk_by(|l, r| (l.0, l.1) == (r.0, r.1)) {
            graph.links.push((same[0].1, Turn::mean(same.iter().map(|link| (1.0, link.2)))));
            graph.offsets[same[0].0 as usize + 1] += 1;
        }
        for a in 0..self.count {
            graph.offsets[a + 1] += graph.offsets[a];
        }
        graph
    }
}

fn coarsen<const B: usize>(
    kind: FieldKind,
    fine: &FieldLevel<B>,
    aggregates: &Aggregates,
    monitor: &dyn Monitor,
) -> Result<FieldLevel<B>, Cancelled> {
    let n = fine.roots.len();
    let scales = row_scales(&fine.stiffness);
    let tentative: Vec<Block<B>> =
        aggregates.carried.par_iter().with_min_len(1 << 12).map(|&c| transport_block(kind, c)).collect();
    let matrix = BlockMatrix::try_from_rows(n, aggregates.count, |i, entries| {
        let (columns, blocks) = fine.stiffness.row(i);
        // A row of a vertex with very many triangles is long.
        if i % 64 == 0 || columns.len() > 1000 {
            monitor.checkpoint()?;
        }
        if columns == [i as u32] && scales[i] > 0.0 {
            // Coupled to nothing and not free: no coarser level has to correct it, and it is to hold none.
            entries.push((aggregates.of[i], tentative[i].map(|row| row.map(|x| UNCOUPLED * x))));
            return Ok(());
        }
        entries.push((aggregates.of[i], tentative[i]));
        let weight = if scales[i] > 0.0 { -INTERPOLATION_WEIGHT / scales[i] } else { 0.0 };
        let mut places = BlockPlaces::default();
        for (&j, block) in columns.iter().zip(blocks) {
            let entry = places.block(entries, aggregates.of[j as usize]);
            add_product(entry, &block.map(|row| row.map(|x| weight * x)), &tentative[j as usize]);
        }
        Ok::<_, Cancelled>(())
    })?;
    monitor.checkpoint()?;
    let back = matrix.transpose();
    let times = |a: &BlockMatrix<B>, b: &BlockMatrix<B>| a.try_times(b, || monitor.checkpoint());
    let product = |operator: &BlockMatrix<B>| times(&back, &times(operator, &matrix)?);
    let stiffness = product(&fine.stiffness)?;
    let mass = product(&fine.mass)?;
    let roots = aggregates.roots.iter().map(|&r| fine.roots[r as usize]).collect();
    Ok(FieldLevel {
        stiffness,
        mass,
        roots,
        interpolation: Some(Interpolation { matrix, aggregates: aggregates.of.clone() }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::FieldSurface;
    use crate::operator::frames::parts;
    use crate::operator::hodge::FieldBoundary;
    use chladni_base::Unwatched;
    use chladni_base::Vector3;
    use chladni_mesh::shape::{Shape, generate};

    fn levels<const B: usize>(kind: FieldKind, mesh: chladni_mesh::TriangleMesh) -> Vec<FieldLevel<B>> {
        let s = FieldSurface::new(mesh).unwrap();
        let operator =
            FieldOperator::<B>::assemble(kind, s.mesh(), s.dual(), s.frames(), FieldBoundary::Tangential).unwrap();
        hierarchy(&operator, s.dual(), s.frames(), 60, &Unwatched).unwrap()
    }

    #[test]
    fn levels_shrink_by_a_factor_and_cover_every_face_once() {
        let levels = levels::<2>(FieldKind::NVector { n: 4 }, generate(Shape::Sphere, 2000).unwrap());
        assert!(levels.len() >= 3);
        for pair in levels.windows(2) {
            let (fine, coarse) = (pair[0].roots.len(), pair[1].roots.len());
            assert!(fine > 4 * coarse, "{fine} {coarse}");
            let interpolation = pair[1].interpolation.as_ref().unwrap();
            let mut met = vec![0; coarse];
            (0..fine as u32).for_each(|i| met[interpolation.node_of(i) as usize] += 1);
            assert!(met.iter().all(|&m| m > 0) && pair[1].roots.iter().all(|r| pair[0].roots.contains(r)));
        }
    }

    #[test]
    fn parallel_fields_on_a_plane_stay_parallel_from_level_to_level() {
        let s = FieldSurface::new(generate(Shape::Rectangle, 900).unwrap()).unwrap();
        let kind = FieldKind::NVector { n: 1 };
        let operator =
            FieldOperator::<2>::assemble(kind, s.mesh(), s.dual(), s.frames(), FieldBoundary::Tangential).unwrap();
        let levels = hierarchy(&operator, s.dual(), s.frames(), 60, &Unwatched).unwrap();
        let parallel = |level: &FieldLevel<2>| -> Vec<f64> {
            level
                .roots
                .iter()
                .flat_map(|&f| parts(s.frames().from_world(f as usize, Vector3::new(0.6, 0.8, 0.0))))
                .collect()
        };
        assert!(levels.len() >= 3);
        for pair in levels.windows(2) {
            let matrix = &pair[1].interpolation.as_ref().unwrap().matrix;
            let interpolated = matrix.multiply(&parallel(&pair[1]));
            let worst = interpolated.iter().zip(parallel(&pair[0])).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-12, "{worst}");
            let energy = pair[1].stiffness.multiply(&parallel(&pair[1]));
            assert!(energy.iter().all(|e| e.abs() < 1e-10));
        }
    }

    #[test]
    fn scaled_rows_bound_the_spectrum() {
        for level in levels::<3>(FieldKind::Tensor {}, generate(Shape::Torus, 800).unwrap()) {
            let scales = row_scales(&level.stiffness);
            let mut x: Vec<f64> = (0..3 * scales.len()).map(|i| ((i * 7919) as f64).sin()).collect();
            let mut value = 0.0;
            for _ in 0..60 {
                let y = level.stiffness.multiply(&x);
                let largest = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                x = y.iter().enumerate().map(|(i, v)| v / scales[i / 3] / largest).collect();
                value = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            }
            assert!(value < 2.0 + 1e-9 && value > 0.5, "{value}");
        }
    }
}
