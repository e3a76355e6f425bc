//! The nearest points: a tree of halves.

use chladni_base::Vector3;
use chladni_base::parallel::*;

/// Points of a leaf, at most.
const LEAF: usize = 16;

#[derive(Debug, Clone, Copy)]
struct Entry {
    at: [f64; 3],
    point: u32,
}

#[derive(Debug, Clone, Copy)]
struct Split {
    axis: u8,
    at: f64,
}

/// A balanced k-d tree (Bentley 1975): each node halves its points along the longest side of their box. Takes about 36
/// bytes a point.
#[derive(Debug, Clone)]
pub struct PointTree {
    /// The points, leaf by leaf.
    entries: Vec<Entry>,
    /// For each level the splits of its nodes; the halves of node `k` are `2k` and `2k + 1` of the next.
    levels: Vec<Vec<Split>>,
}

/// Points within a bound, for each that is wanted, up to which all of them are gathered.
const GATHERED: usize = 8;

/// A bound is taken so much larger, as a share, that rounding does not leave out what lies on it.
const BEYOND: f64 = 1e-9;

/// A node that is left to look through.
#[derive(Debug, Clone, Copy)]
struct Open {
    level: usize,
    node: usize,
    start: usize,
    end: usize,
    /// How far its box is away along each axis.
    beyond: [f64; 3],
}

/// The nearest points so far.
#[derive(Debug, Clone, Default)]
pub struct Nearest {
    most: usize,
    found: Vec<(f64, u32)>,
    /// Where they were looked for.
    place: [f64; 3],
    /// Nodes that are left to look through.
    open: Vec<Open>,
    /// Nodes that were looked through.
    #[cfg(test)]
    visited: usize,
}

impl Nearest {
    /// Squared distances and points, nearest first; of equally distant ones the lowest first. Where more points than
    /// are wanted stand on the place itself, they are any of those, always the same ones.
    pub fn found(&self) -> &[(f64, u32)] {
        &self.found
    }

    /// Whether nothing nearer can be found.
    fn is_settled(&self) -> bool {
        self.found.len() == self.most && self.farthest() == 0.0
    }

    /// What is farther than this does not count.
    fn farthest(&self) -> f64 {
        if self.found.len() < self.most { f64::INFINITY } else { self.found.last().map_or(0.0, |last| last.0) }
    }

    fn offer(&mut self, square: f64, point: u32) {
        if self.found.len() == self.most {
            match self.found.last() {
                Some(&last) if (square, point) < last => self.found.pop(),
                _ => return,
            };
        }
        self.found.push((square, point));
        let mut k = self.found.len() - 1;
        while k > 0 && self.found[k] < self.found[k - 1] {
            self.found.swap(k, k - 1);
            k -= 1;
        }
    }
}

impl PointTree {
    /// Builds the tree in `O(n log n)`. Coordinates must be finite.
    pub fn new(positions: &[[f64; 3]]) -> Self {
        let mut entries: Vec<Entry> =
            positions.iter().enumerate().map(|(point, &at)| Entry { at, point: point as u32 }).collect();
        let mut levels = Vec::new();
        let mut ranges: Vec<std::ops::Range<usize>> = std::iter::once(0..entries.len()).collect();
        while ranges.iter().any(|range| range.len() > LEAF) {
            let mut parts = Vec::with_capacity(ranges.len());
            let mut rest = &mut entries[..];
            for range in &ranges {
                let (part, later) = rest.split_at_mut(range.len());
                parts.push(part);
                rest = later;
            }
            levels.push(parts.into_par_iter().map(halve).collect());
            ranges = ranges.into_iter().flat_map(|range| halves(range.start, range.end)).collect();
        }
        Self { entries, levels }
    }

    /// The `most` points nearest to a place, without `except`.
    pub fn nearest(&self, place: [f64; 3], except: Option<u32>, most: usize, nearest: &mut Nearest) {
        nearest.most = most;
        nearest.place = place;
        nearest.found.clear();
        #[cfg(test)]
        {
            nearest.visited = 0;
        }
        if most > 0 {
            self.descend((0, 0), (0, self.entries.len()), place, except, [0.0; 3], nearest);
        }
    }

    /// The same where `nearest` still has those of another place, not far away: none of the wanted ones is farther than
    /// the farthest of these and the way there. Known beforehand, that saves keeping the nearest so far in order.
    pub fn nearest_after(&self, place: [f64; 3], except: Option<u32>, most: usize, nearest: &mut Nearest) {
        let (farthest, way) = (nearest.farthest().sqrt(), (Vector3(place) - Vector3(nearest.place)).norm());
        let bound = (farthest + way).powi(2) * (1.0 + BEYOND);
        // Of those there this place itself may be one, and that place may be one of those here.
        let known = nearest.most == most && nearest.found.len() == most && way <= farthest && bound > 0.0;
        if known && self.gather(place, except, bound, nearest) {
            let found = &mut nearest.found;
            let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            if found.len() > most {
                found.select_nth_unstable_by(most, order);
                found.truncate(most);
            }
            found.sort_unstable_by(order);
            nearest.place = place;
            return;
        }
        self.nearest(place, except, most, nearest);
    }

    /// Gathers all points within the root of a bound; whether they are as many as are wanted, and not far more.
    fn gather(&self, place: [f64; 3], except: Option<u32>, bound: f64, nearest: &mut Nearest) -> bool {
        let Nearest { most, found, open, .. } = nearest;
        found.clear();
        open.clear();
        open.push(Open { level: 0, node: 0, start: 0, end: self.entries.len(), beyond: [0.0; 3] });
        while let Some(Open { level, node, start, end, beyond }) = open.pop() {
            let Some(splits) = self.levels.get(level) else {
                for entry in &self.entries[start..end] {
                    let square = (Vector3(entry.at) - Vector3(place)).norm_squared();
                    if square <= bound && Some(entry.point) != except {
                        found.push((square, entry.point));
                    }
                }
                if found.len() > GATHERED * *most {
                    return false;
                }
                continue;
            };
            let Split { axis, at } = splits[node];
            let axis = usize::from(axis);
            let away = place[axis] - at;
            let mut farther = beyond;
            farther[axis] = away;
            let reached = farther.iter().map(|d| d * d).sum::<f64>() <= bound;
            for (half, range) in halves(start, end).into_iter().enumerate() {
                let near = (half == 0) == (away < 0.0);
                if near || reached {
                    let beyond = if near { beyond } else { farther };
                    open.push(Open {
                        level: level + 1,
                        node: 2 * node + half,
                        start: range.start,
                        end: range.end,
                        beyond,
                    });
                }
            }
        }
        found.len() >= *most
    }

    /// Looks through a node whose box is `beyond` away from the place along each axis.
    fn descend(
        &self,
        (level, node): (usize, usize),
        (start, end): (usize, usize),
        place: [f64; 3],
        except: Option<u32>,
        beyond: [f64; 3],
        nearest: &mut Nearest,
    ) {
        // Among many copies of a point nothing would end the search, as no part of the tree is farther away than those
        // found.
        if nearest.is_settled() {
            return;
        }
        #[cfg(test)]
        {
            nearest.visited += 1;
        }
        let Some(splits) = self.levels.get(level) else {
            for entry in &self.entries[start..end] {
                let square = (Vector3(entry.at) - Vector3(place)).norm_squared();
                if square <= nearest.farthest() && Some(entry.point) != except {
                    nearest.offer(square, entry.point);
                }
            }
            return;
        };
        let Split { axis, at } = splits[node];
        let axis = usize::from(axis);
        let [low, high] = halves(start, end);
        let below = place[axis] < at;
        let (near, far) = if below { (low, high) } else { (high, low) };
        let (near_node, far_node) = if below { (2 * node, 2 * node + 1) } else { (2 * node + 1, 2 * node) };
        self.descend((level + 1, near_node), (near.start, near.end), place, except, beyond, nearest);
        let mut beyond = beyond;
        beyond[axis] = place[axis] - at;
        // Equally distant ones of lower numbers may be there.
        if beyond.iter().map(|d| d * d).sum::<f64>() <= nearest.farthest() {
            self.descend((level + 1, far_node), (far.start, far.end), place, except, beyond, nearest);
        }
    }
}

fn halves(start: usize, end: usize) -> [std::ops::Range<usize>; 2] {
    let middle = start + (end - start) / 2;
    [start..middle, middle..end]
}

/// Puts the lower half along the longest side of the box before the upper one.
fn halve(entries: &mut [Entry]) -> Split {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for entry in entries.iter() {
        for i in 0..3 {
            low[i] = low[i].min(entry.at[i]);
            high[i] = high[i].max(entry.at[i]);
        }
    }
    let side = |i: &usize| high[*i] - low[*i];
    let axis = (0..3).max_by(|a, b| side(a).total_cmp(&side(b))).unwrap_or(0);
    let middle = entries.len() / 2;
    let key = |entry: &Entry| (entry.at[axis], entry.point);
    let (_, median, _) = entries.select_nth_unstable_by(middle, |a, b| {
        let ((p, i), (q, j)) = (key(a), key(b));
        p.total_cmp(&q).then(i.cmp(&j))
    });
    Split { axis: axis as u8, at: median.at[axis] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    #[test]
    fn among_many_copies_of_a_point_the_search_ends_with_the_first_ones() {
        // Equal points, and points whose distances vanish in double precision.
        for step in [0.0, 1e-200] {
            let positions: Vec<[f64; 3]> = (0..100_000).map(|k| [step * f64::from(k), 2.0 * step, 0.0]).collect();
            let tree = PointTree::new(&positions);
            let mut nearest = Nearest::default();
            for point in (0..100_000u32).step_by(997) {
                // With what is known of the one before, too.
                match point % 2 {
                    0 => tree.nearest(positions[point as usize], Some(point), 30, &mut nearest),
                    _ => tree.nearest_after(positions[point as usize], Some(point), 30, &mut nearest),
                }
                assert_eq!(nearest.found().len(), 30);
                assert!(nearest.found().iter().all(|&(square, other)| square == 0.0 && other != point));
                assert!(nearest.visited < 100, "{}", nearest.visited);
            }
        }
    }

    #[test]
    fn the_nearest_are_those_of_an_exhaustive_search_ties_included() {
        let mut random = SplitMix64::new(8);
        for n in [0, 1, 5, 17, 100, 1000] {
            // On a coarse grid, so that many distances are equal and some points stand on each other.
            let positions: Vec<[f64; 3]> =
                (0..n).map(|_| std::array::from_fn(|_| (random.unit() * 7.0).floor())).collect();
            let tree = PointTree::new(&positions);
            let (mut nearest, mut after) = (Nearest::default(), Nearest::default());
            for point in 0..n as u32 {
                tree.nearest(positions[point as usize], Some(point), 12, &mut nearest);
                tree.nearest_after(positions[point as usize], Some(point), 12, &mut after);
                assert_eq!(after.found(), nearest.found());
                let mut all: Vec<(f64, u32)> = (0..n as u32)
                    .filter(|&other| other != point)
                    .map(|other| {
                        let (p, q) = (positions[point as usize], positions[other as usize]);
                        ((Vector3(p) - Vector3(q)).norm_squared(), other)
                    })
                    .collect();
                all.sort_by(|a, b| a.partial_cmp(b).unwrap());
                all.truncate(12);
                assert_eq!(nearest.found(), all);
            }
        }
    }
}
