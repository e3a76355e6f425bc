//! Nested dissection of the vertices of a large surface by planes (after Heath and Raghavan 1995): parts are halved
//! across their longest direction, and what lies beside the cut on one side comes last.
//!
//! On surfaces planes separate about as well as what graph partitioning finds, and are found in a tenth of the time, on
//! all threads.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// Parts of so many vertices are not divided.
const LEAF: usize = 24;

/// Parts of so many are divided on one thread.
const ALONE: usize = 1 << 12;

/// What separates the halves of a part is at most so many times the root of its vertices: on surfaces that lie in many
/// layers planes cut all of them.
const WIDEST: f64 = 6.0;

/// The label of what is placed.
const PLACED: u32 = 0;

/// The neighbours of all vertices, those of `v` from `offsets[v]` on.
pub(super) struct Neighbours<'a> {
    pub offsets: &'a [usize],
    pub indices: &'a [u32],
}

struct Dissection<'a> {
    positions: &'a [[f64; 3]],
    neighbours: &'a Neighbours<'a>,
    /// The part that a vertex belongs to. Each is written by the one task that has its part; what others read of it is
    /// never the label that they look for.
    labels: Vec<AtomicU32>,
    /// Whether some large part is cut by too wide a row of vertices.
    wide: AtomicBool,
}

/// An order in which the vertices of a surface are eliminated; `None` where planes do not separate it well.
pub(super) fn dissected(positions: &[[f64; 3]], neighbours: &Neighbours) -> Option<Vec<u32>> {
    let labels = positions.iter().map(|_| AtomicU32::new(1)).collect();
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    let dissection = Dissection { positions, neighbours, labels, wide: AtomicBool::new(false) };
    dissection.divide(&mut order, 1);
    (!dissection.wide.into_inner()).then_some(order)
}

impl Dissection<'_> {
    /// Brings a part, whose label is `part`, into its order.
    fn divide(&self, vertices: &mut [u32], part: u32) {
        // Parts are halved: their labels end long before the numbers do.
        if vertices.len() <= LEAF || part > u32::MAX / 4 {
            return;
        }
        let along = self.longest(vertices);
        let place = |v: u32| {
            let p = self.positions[v as usize];
            along[0] * p[0] + along[1] * p[1] + along[2] * p[2]
        };
        let mut keyed: Vec<(f64, u32)> = vertices.iter().map(|&v| (place(v), v)).collect();
        let half = keyed.len() / 2;
        keyed.select_nth_unstable_by(half, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        vertices.iter_mut().zip(&keyed).for_each(|(to, from)| *to = from.1);
        drop(keyed);
        let (left, right) = (2 * part, 2 * part + 1);
        for (at, &v) in vertices.iter().enumerate() {
            self.labels[v as usize].store(if at < half { left } else { right }, Relaxed);
        }
        let beside = |v: u32, label: u32| {
            let own = self.neighbours.offsets[v as usize]..self.neighbours.offsets[v as usize + 1];
            self.neighbours.indices[own].iter().any(|&w| self.labels[w as usize].load(Relaxed) == label)
        };
        // Of the two rows of vertices along the cut the shorter one separates.
        let rows = [
            vertices[..half].iter().copied().filter(|&v| beside(v, right)).collect::<Vec<u32>>(),
            vertices[half..].iter().copied().filter(|&v| beside(v, left)).collect::<Vec<u32>>(),
        ];
        let [first, second] = rows;
        let separator = if second.len() < first.len() { second } else { first };
        if vertices.len() > ALONE {
            self.wide.fetch_or(separator.len() as f64 > WIDEST * (vertices.len() as f64).sqrt(), Relaxed);
        }
        separator.iter().for_each(|&v| self.labels[v as usize].store(PLACED, Relaxed));
        let of = |label: u32| {
            let own = vertices.iter().copied().filter(|&v| self.labels[v as usize].load(Relaxed) == label);
            own.collect::<Vec<u32>>()
        };
        let (mut a, mut b) = (of(left), of(right));
        if vertices.len() > ALONE {
            rayon::join(|| self.divide(&mut a, left), || self.divide(&mut b, right));
        } else {
            self.divide(&mut a, left);
            self.divide(&mut b, right);
        }
        let ordered = a.into_iter().chain(b).chain(separator);
        vertices.iter_mut().zip(ordered).for_each(|(to, from)| *to = from);
    }

    /// The direction in which a part is longest: the first eigenvector of its covariance, by a few steps of the power
    /// method.
    fn longest(&self, vertices: &[u32]) -> [f64; 3] {
        // A few hundred of them know it.
        let step = vertices.len().div_ceil(512);
        let sample = || vertices.iter().step_by(step).map(|&v| self.positions[v as usize]);
        let count = sample().count() as f64;
        let mut mean = [0.0; 3];
        sample().for_each(|p| (0..3).for_each(|i| mean[i] += p[i] / count));
        let mut covariance = [[0.0; 3]; 3];
        for p in sample() {
            let d = [0, 1, 2].map(|i| p[i] - mean[i]);
            (0..3).for_each(|i| (0..3).for_each(|k| covariance[i][k] += d[i] * d[k]));
        }
        let widest = (0..3).max_by(|&a, &b| covariance[a][a].total_cmp(&covariance[b][b])).unwrap_or(0);
        let mut along = covariance[widest];
        for _ in 0..12 {
            let next: [f64; 3] = [0, 1, 2].map(|i| (0..3).map(|k| covariance[i][k] * along[k]).sum());
            let length = next.iter().map(|x| x * x).sum::<f64>().sqrt();
            if !(length > 0.0 && length.is_finite()) {
                return [1.0, 0.0, 0.0];
            }
            along = next.map(|x| x / length);
        }
        along
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: usize) -> (Vec<[f64; 3]>, Vec<usize>, Vec<u32>) {
        let positions = (0..side * side).map(|v| [(v % side) as f64, (v / side) as f64, 0.0]).collect();
        let (mut offsets, mut indices) = (vec![0], Vec::new());
        for v in 0..side * side {
            let (x, y) = (v % side, v / side);
            if x > 0 {
                indices.push(v as u32 - 1);
            }
            if x + 1 < side {
                indices.push(v as u32 + 1);
            }
            if y > 0 {
                indices.push((v - side) as u32);
            }
            if y + 1 < side {
                indices.push((v + side) as u32);
            }
            offsets.push(indices.len());
        }
        (positions, offsets, indices)
    }

    #[test]
    fn every_vertex_comes_once_and_what_comes_last_separates_the_halves() {
        let side = 40;
        let (positions, offsets, indices) = grid(side);
        let neighbours = Neighbours { offsets: &offsets, indices: &indices };
        let order = dissected(&positions, &neighbours).unwrap();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..(side * side) as u32));
        // Without the last row no walk leads from one half to the other.
        let last: Vec<u32> = order[order.len() - side..].to_vec();
        let mut seen: Vec<bool> = (0..side * side).map(|v| last.contains(&(v as u32))).collect();
        let mut stack = vec![order[0]];
        seen[order[0] as usize] = true;
        let mut reached = 0;
        while let Some(v) = stack.pop() {
            reached += 1;
            for &w in &indices[offsets[v as usize]..offsets[v as usize + 1]] {
                if !std::mem::replace(&mut seen[w as usize], true) {
                    stack.push(w);
                }
            }
        }
        assert!(reached <= side * side / 2 && reached >= side * side / 2 - 2 * side, "{reached}");
    }

    #[test]
    fn what_planes_do_not_separate_is_left_to_other_orders() {
        // A strip that is folded to and fro 25 times; the longest direction is that of the folds.
        let (width, length) = (8, 3000);
        let (mut positions, mut offsets, mut indices) = (Vec::new(), vec![0], Vec::new());
        for i in 0..length {
            for k in 0..width {
                let (layer, at) = (i / 120, i % 120);
                let along = if layer % 2 == 0 { at } else { 119 - at };
                positions.push([along as f64, 0.01 * k as f64, 0.01 * layer as f64]);
                for (di, dk) in [(0, 1), (0, -1), (1, 0), (-1, 0)] {
                    let (j, l) = (i + di, k + dk);
                    if (0..length).contains(&j) && (0..width).contains(&l) {
                        indices.push((j * width + l) as u32);
                    }
                }
                offsets.push(indices.len());
            }
        }
        // 25 layers of eight are far more than the eight that separate the strip, and fewer than what is left alone.
        let neighbours = Neighbours { offsets: &offsets, indices: &indices };
        assert!(dissected(&positions, &neighbours).is_some());
        // Of all neighbours at random no plane separates anything.
        let n = positions.len();
        let mut random = chladni_base::SplitMix64::new(9);
        let mut pairs: Vec<[u32; 2]> = (0..4 * n).map(|_| [random.below(n) as u32, random.below(n) as u32]).collect();
        pairs.extend(pairs.clone().iter().map(|[a, b]| [*b, *a]));
        pairs.sort_unstable();
        let mut offsets = vec![0; n + 1];
        pairs.iter().for_each(|[a, _]| offsets[*a as usize + 1] += 1);
        (0..n).for_each(|v| offsets[v + 1] += offsets[v]);
        let indices: Vec<u32> = pairs.iter().map(|[_, b]| *b).collect();
        assert!(dissected(&positions, &Neighbours { offsets: &offsets, indices: &indices }).is_none());
    }

    #[test]
    fn points_at_one_place_are_divided_as_well() {
        let (_, offsets, indices) = grid(20);
        let neighbours = Neighbours { offsets: &offsets, indices: &indices };
        for place in [[0.0; 3], [f64::MAX; 3]] {
            let mut order = dissected(&vec![place; 400], &neighbours).unwrap();
            order.sort_unstable();
            assert!(order.into_iter().eq(0..400));
        }
    }
}
