//! Nearest neighbours among points of many dimensions.
//!
//! Spectral embeddings of surfaces have tens to hundreds of dimensions, but the points lie on a surface in them, and neighbours that are asked for
//! one after the other lie close together. So a k-d tree still rules out most points, above all when a search begins with a good guess. Libraries
//! that were looked at fix the dimension when they are compiled, or take no guess (`docs/decisions/0017-analysis.md`).

use rayon::prelude::*;

/// Halves of fewer items are split by one thread.
const ALONE: usize = 4096;

/// Points of a leaf.
const LEAF: usize = 16;

/// Numbers after which a sum that is too large already is given up.
const STRIDE: usize = 8;

/// Points, arranged for the search of nearest neighbours.
#[derive(Debug, Clone)]
pub struct KdTree {
    dimensions: usize,
    /// Points leaf after leaf, each with its numbers one after the other.
    points: Vec<f32>,
    /// The number of each of them.
    items: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Debug, Clone, Copy)]
enum Node {
    /// The left half follows; the right one begins so many nodes further on.
    Split {
        axis: u32,
        at: f32,
        right: u32,
    },
    Leaf {
        from: u32,
        to: u32,
    },
}

/// A search under way.
struct Search<'a> {
    tree: &'a KdTree,
    query: &'a [f32],
    /// How far the query is, along each axis, from the box of the node that is looked at.
    offsets: Vec<f32>,
    best: (u32, f32),
}

impl KdTree {
    /// Arranges points of so many dimensions, given one after the other. `None` unless there is at least one, of at least one dimension, and all
    /// have theirs.
    pub fn new(dimensions: usize, points: &[f32]) -> Option<Self> {
        if dimensions == 0 || points.is_empty() || !points.len().is_multiple_of(dimensions) {
            return None;
        }
        let mut items: Vec<u32> = (0..(points.len() / dimensions) as u32).collect();
        let nodes = split(dimensions, points, &mut items, 0);
        let mut ordered = vec![0.0; points.len()];
        ordered.par_chunks_exact_mut(dimensions).with_min_len(1024).zip(&items).for_each(|(to, &item)| {
            to.copy_from_slice(&points[item as usize * dimensions..][..dimensions]);
        });
        Some(Self { dimensions, points: ordered, items, nodes })
    }

    /// The nearest point to a query and its squared distance; of several that are equally near, one of them. `guess`: a point that may be near, and its
    /// squared distance.
    pub fn nearest(&self, query: &[f32], guess: Option<(u32, f32)>) -> (u32, f32) {
        let best = guess.unwrap_or((0, f32::INFINITY));
        let mut search = Search { tree: self, query, offsets: vec![0.0; self.dimensions], best };
        search.visit(0, 0.0);
        search.best
    }
}

impl Search<'_> {
    /// Looks into a node whose box is at the squared distance `away`.
    fn visit(&mut self, node: usize, away: f32) {
        match self.tree.nodes[node] {
            Node::Leaf { from, to } => {
                let dimensions = self.tree.dimensions;
                for place in from as usize..to as usize {
                    let point = &self.tree.points[place * dimensions..][..dimensions];
                    let mut sum = 0.0;
                    for (a, b) in point.chunks(STRIDE).zip(self.query.chunks(STRIDE)) {
                        sum += a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
                        if sum >= self.best.1 {
                            break;
                        }
                    }
                    if sum < self.best.1 {
                        self.best = (self.tree.items[place], sum);
                    }
                }
            }
            Node::Split { axis, at, right } => {
                let axis = axis as usize;
                let gap = self.query[axis] - at;
                let (near, far) =
                    if gap < 0.0 { (node + 1, node + right as usize) } else { (node + right as usize, node + 1) };
                self.visit(near, away);
                let old = std::mem::replace(&mut self.offsets[axis], gap);
                let away = away - old * old + gap * gap;
                if away < self.best.1 {
                    self.visit(far, away);
                }
                self.offsets[axis] = old;
            }
        }
    }
}

/// Splits items at the median of their widest axis, until they fit a leaf; the nodes of the tree over them, the root first. `first` is the place of
/// the first item among all.
fn split(dimensions: usize, points: &[f32], items: &mut [u32], first: usize) -> Vec<Node> {
    let widest = if items.len() > LEAF { widest_axis(dimensions, points, items) } else { None };
    let Some(axis) = widest else {
        return vec![Node::Leaf { from: first as u32, to: (first + items.len()) as u32 }];
    };
    let half = items.len() / 2;
    // Points are far apart in memory: each is looked at once.
    let mut keys: Vec<(f32, u32)> =
        items.iter().map(|&item| (points[item as usize * dimensions + axis], item)).collect();
    keys.select_nth_unstable_by(half, |a, b| a.0.total_cmp(&b.0));
    let at = keys[half].0;
    items.iter_mut().zip(keys).for_each(|(item, key)| *item = key.1);
    let (low, high) = items.split_at_mut(half);
    let (left, right) = if half < ALONE {
        (split(dimensions, points, low, first), split(dimensions, points, high, first + half))
    } else {
        rayon::join(|| split(dimensions, points, low, first), || split(dimensions, points, high, first + half))
    };
    let mut nodes = Vec::with_capacity(1 + left.len() + right.len());
    nodes.push(Node::Split { axis: axis as u32, at, right: 1 + left.len() as u32 });
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

/// The axis along which items spread most; `None` where they are all one point. Of many items, some tell.
fn widest_axis(dimensions: usize, points: &[f32], items: &[u32]) -> Option<usize> {
    let step = items.len().div_ceil(64);
    let (mut low, mut high) = (vec![f32::INFINITY; dimensions], vec![f32::NEG_INFINITY; dimensions]);
    for &item in items.iter().step_by(step) {
        let point = &points[item as usize * dimensions..][..dimensions];
        for ((low, high), &value) in low.iter_mut().zip(&mut high).zip(point) {
            *low = low.min(value);
            *high = high.max(value);
        }
    }
    let spread = |axis: &usize| high[*axis] - low[*axis];
    (0..dimensions).max_by(|a, b| spread(a).total_cmp(&spread(b))).filter(|axis| spread(axis) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: usize, dimensions: usize, seed: f32) -> Vec<f32> {
        (0..count * dimensions).map(|i| ((i as f32 + seed) * 12.9898).sin() * 43758.547 % 1.0).collect()
    }

    #[test]
    fn the_tree_finds_what_looking_at_all_points_finds() {
        for (count, dimensions) in [(1, 3), (17, 1), (500, 2), (700, 40), (64, 9)] {
            let all = points(count, dimensions, 0.0);
            let tree = KdTree::new(dimensions, &all).unwrap();
            let square = |item: usize, query: &[f32]| {
                let point = &all[item * dimensions..][..dimensions];
                point.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
            };
            for query in points(50, dimensions, 0.37).chunks(dimensions) {
                let least = (0..count).map(|item| square(item, query)).fold(f32::INFINITY, f32::min);
                for guess in [None, Some((0, square(0, query)))] {
                    let (found, distance) = tree.nearest(query, guess);
                    assert!((square(found as usize, query) - least).abs() <= 1e-5 * least, "{count} {dimensions}");
                    assert!((distance - least).abs() <= 1e-5 * least);
                }
            }
        }
    }

    #[test]
    fn equal_points_do_not_split_for_ever() {
        let tree = KdTree::new(2, &[0.5; 400]).unwrap();
        assert_eq!(tree.nearest(&[0.5, 0.5], None).1, 0.0);
        assert_eq!(tree.nearest(&[1.5, 0.5], None).1, 1.0);
        assert!(
            KdTree::new(0, &[1.0]).is_none() && KdTree::new(2, &[]).is_none() && KdTree::new(2, &[1.0; 3]).is_none()
        );
    }
}
