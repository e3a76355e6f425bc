//! Nearest neighbours among points of many dimensions.
//!
//! Spectral embeddings of surfaces have tens to hundreds of dimensions, and every one of them holds as much as any
//! other: a box that is cut along a few axes rules out next to nothing, nor does a ball around a few points, unless
//! they are close together for the modes there are. But a part of the dimensions tells: a sum of squares only grows,
//! and two points that are not neighbours have exceeded the distance of neighbours after some of them. So points that
//! are close together stand side by side, 32 of them, a dimension after the other, and are given up together; groups of
//! some 200 of them that are small, as on large meshes, are ruled out at once. Libraries that were looked at fix the
//! dimension when they are compiled, or take no guess (`docs/decisions/0017-analysis.md`,
//! `0097-neighbours-in-many-dimensions.md`).

use std::ops::Range;

use chladni_algebra::{DenseMatrix, vectorized};
use chladni_base::parallel::*;

/// Points that stand side by side.
const LANES: usize = 32;

/// Dimensions after which a sum that is too large already is given up. Points are filled up with zeros to a multiple of
/// so many.
const STEP: usize = 8;

/// Points of a group, at most.
const GROUP: usize = 8 * LANES;

/// What distances in single precision are taken to be wrong by, as a share.
const SLACK: f32 = 1e-5;

/// Queries that one task handles, one after the other.
const QUERIES: usize = 1024;

/// Points of which one in so many tells along which axis many of them spread.
const TELLING: usize = 64;

/// Points, row after row, in single precision.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    dimensions: usize,
    /// Numbers from one row to the next.
    stride: usize,
    values: Vec<f32>,
}

impl Rows {
    /// The rows of the first `k` columns of a matrix.
    pub fn of(matrix: &DenseMatrix, k: usize) -> Self {
        let mut rows = Self::with_capacity(matrix.rows(), k);
        rows.extend(matrix);
        rows
    }

    /// No rows yet, of `k` numbers each.
    pub fn with_capacity(rows: usize, k: usize) -> Self {
        let stride = k.next_multiple_of(STEP);
        Self { dimensions: k, stride, values: Vec::with_capacity(rows * stride) }
    }

    /// Adds the rows of a matrix, as many columns of it as there is room for.
    pub fn extend(&mut self, matrix: &DenseMatrix) {
        let from = self.values.len();
        self.values.resize(from + matrix.rows() * self.stride, 0.0);
        let new = &mut self.values[from..];
        for column in 0..matrix.columns().min(self.dimensions) {
            let slots = new.iter_mut().skip(column).step_by(self.stride);
            slots.zip(matrix.column(column)).for_each(|(slot, &value)| *slot = value as f32);
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.values.len() / self.stride.max(1)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.stride..][..self.stride]
    }
}

/// A neighbour that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Which of the points.
    pub point: u32,
    /// Its squared distance.
    pub square: f32,
    /// Its squared distance as a share of the squares of both, `‖x − y‖² / (‖x‖² + ‖y‖²)`; 0 where both are zero.
    pub share: f32,
}

/// Points, arranged for the search of nearest neighbours.
#[derive(Debug, Clone)]
pub struct Neighbours {
    dimensions: usize,
    points: Blocks,
    /// The number of the point at each place, and the place of each number. Nobody asks for those of places that are
    /// not taken.
    items: Vec<u32>,
    places: Vec<u32>,
    /// `‖x‖²` at each place.
    squares: Vec<f32>,
    centres: Blocks,
    /// How far from its centre a group reaches, and where its blocks end.
    radii: Vec<f32>,
    ends: Vec<u32>,
}

/// Points in blocks of [`LANES`], in each of them a dimension after the other; infinite where there is none.
#[derive(Debug, Clone)]
struct Blocks {
    stride: usize,
    values: Vec<f32>,
}

impl Blocks {
    fn new(stride: usize, blocks: usize) -> Self {
        Self { stride, values: vec![f32::INFINITY; blocks * stride * LANES] }
    }

    fn put(&mut self, place: usize, point: &[f32]) {
        let block = &mut self.values[place / LANES * self.stride * LANES..];
        block.iter_mut().skip(place % LANES).step_by(LANES).zip(point).for_each(|(slot, &value)| *slot = value);
    }

    /// The squared distances of a query to the points of a block; `None` where all of them are `most` or more.
    #[inline(always)]
    fn squares(&self, block: usize, query: &[f32], most: f32) -> Option<[f32; LANES]> {
        let own = &self.values[block * self.stride * LANES..][..self.stride * LANES];
        let mut sums = [0.0f32; LANES];
        let steps = own.as_chunks::<LANES>().0.as_chunks::<STEP>().0;
        for (rows, parts) in steps.iter().zip(query.as_chunks::<STEP>().0) {
            for (row, part) in rows.iter().zip(parts) {
                for k in 0..LANES {
                    let gap = row[k] - part;
                    sums[k] += gap * gap;
                }
            }
            if least(&sums) >= most {
                return None;
            }
        }
        Some(sums)
    }
}

#[inline(always)]
fn least(sums: &[f32; LANES]) -> f32 {
    let mut least = *sums;
    let mut half = LANES / 2;
    while half > 0 {
        for k in 0..half {
            least[k] = if least[k + half] < least[k] { least[k + half] } else { least[k] };
        }
        half /= 2;
    }
    least[0]
}

#[cfg(test)]
thread_local! {
    /// Queries times points of all searches that this thread began.
    pub(in crate::analysis) static COMPARED: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

impl Neighbours {
    /// Arranges points. `None` where there are none, or they have no dimension.
    pub fn new(rows: &Rows) -> Option<Self> {
        if rows.stride == 0 || rows.is_empty() {
            return None;
        }
        let mut order: Vec<u32> = (0..rows.len() as u32).collect();
        let mut groups = Vec::new();
        split(rows, &mut order, &mut groups);
        groups.par_iter_mut().for_each(|group| side_by_side(rows, group));
        let mut ends = Vec::with_capacity(groups.len());
        let mut blocks = 0;
        for group in &groups {
            blocks += group.len().div_ceil(LANES);
            ends.push(blocks as u32);
        }
        let mut points = Blocks::new(rows.stride, blocks);
        let mut centres = Blocks::new(rows.stride, groups.len().div_ceil(LANES));
        let (mut items, mut squares) = (vec![0; blocks * LANES], vec![0.0; blocks * LANES]);
        let (mut places, mut radii) = (vec![0; rows.len()], Vec::with_capacity(groups.len()));
        let mut from = 0;
        let nothing = vec![0.0; rows.stride];
        for (number, (group, &end)) in groups.iter().zip(&ends).enumerate() {
            let mut centre = nothing.clone();
            for (place, &item) in (from..).zip(group.iter()) {
                let row = rows.row(item as usize);
                points.put(place, row);
                (items[place], places[item as usize]) = (item, place as u32);
                centre.iter_mut().zip(row).for_each(|(sum, value)| *sum += value / group.len() as f32);
            }
            let (away, lengths) = (distances(rows, &centre, group), distances(rows, &nothing, group));
            radii.push(away.into_iter().fold(0.0, f32::max).sqrt() * (1.0 + SLACK));
            squares[from..from + group.len()].copy_from_slice(&lengths);
            centres.put(number, &centre);
            from = end as usize * LANES;
        }
        Some(Self { dimensions: rows.dimensions, points, items, places, squares, centres, radii, ends })
    }

    /// For each query the nearest point; of several that are equally near, one of them. `before`: for the first
    /// queries, points that may be near. Queries that follow each other are taken to be near each other.
    ///
    /// # Panics
    /// Where queries have other dimensions than the points.
    pub fn nearest(&self, queries: &Rows, before: &[u32]) -> Vec<Neighbour> {
        assert_eq!(queries.dimensions, self.dimensions, "dimensions of the queries, dimensions of the points");
        #[cfg(test)]
        COMPARED.set(COMPARED.get() + (queries.values.len() / queries.stride * self.places.len()) as u64);
        let task = |(task, queries): (usize, &[f32])| {
            let before = before.get(task * QUERIES..).unwrap_or_default();
            vectorized(
                (queries, before),
                #[inline(always)]
                |(queries, before)| self.nearest_of_few(queries, before),
            )
        };
        queries.values.par_chunks(QUERIES * queries.stride).enumerate().flat_map_iter(task).collect()
    }

    #[inline(always)]
    fn nearest_of_few(&self, queries: &[f32], before: &[u32]) -> Vec<Neighbour> {
        let stride = self.points.stride;
        let mut away = vec![0.0; self.radii.len().next_multiple_of(LANES)];
        let mut last: Option<u32> = None;
        let mut found = Vec::with_capacity(queries.len() / stride);
        for (row, query) in queries.chunks_exact(stride).enumerate() {
            let mut best = Best { place: 0, square: f32::INFINITY, distance: f32::INFINITY };
            let before = before.get(row).and_then(|&item| self.places.get(item as usize)).copied();
            for place in [last, before].into_iter().flatten() {
                self.search(place as usize / LANES, query, &mut best);
            }
            for (block, away) in away.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                let squares = self.centres.squares(block, query, f32::INFINITY);
                *away = squares.map_or([f32::INFINITY; LANES], |squares| squares.map(f32::sqrt));
            }
            if best.square == f32::INFINITY {
                // What is found in the nearest group rules out most of the others.
                let nearest = (0..self.radii.len()).min_by(|&a, &b| away[a].total_cmp(&away[b])).unwrap_or(0);
                for block in self.range(nearest) {
                    self.search(block, query, &mut best);
                }
            }
            for (group, (away, &radius)) in away.iter().zip(&self.radii).enumerate() {
                if away * (1.0 - SLACK) - radius < best.distance {
                    for block in self.range(group) {
                        self.search(block, query, &mut best);
                    }
                }
            }
            let length: f32 = query.iter().map(|x| x * x).sum();
            let whole = length + self.squares[best.place as usize];
            let share = if whole > 0.0 { best.square / whole } else { 0.0 };
            found.push(Neighbour { point: self.items[best.place as usize], square: best.square, share });
            last = Some(best.place);
        }
        found
    }

    /// The blocks of a group.
    #[inline(always)]
    fn range(&self, group: usize) -> Range<usize> {
        let from = if group == 0 { 0 } else { self.ends[group - 1] as usize };
        from..self.ends[group] as usize
    }

    #[inline(always)]
    fn search(&self, block: usize, query: &[f32], best: &mut Best) {
        let Some(squares) = self.points.squares(block, query, best.square) else { return };
        for (lane, &square) in squares.iter().enumerate() {
            if square < best.square {
                *best = Best { place: (block * LANES + lane) as u32, square, distance: square.sqrt() };
            }
        }
    }
}

/// The nearest point so far.
struct Best {
    place: u32,
    square: f32,
    distance: f32,
}

/// Splits points at the median of their widest axis until they are few enough for a group.
fn split<'a>(rows: &Rows, items: &'a mut [u32], groups: &mut Vec<&'a mut [u32]>) {
    if items.len() <= GROUP {
        groups.push(items);
        return;
    }
    let axis = widest_axis(rows, items);
    let keys = items.iter().map(|&item| (rows.row(item as usize)[axis], item)).collect();
    let (low, high) = halved(items, keys);
    split(rows, low, groups);
    split(rows, high, groups);
}

/// The half of the items that have the lesser keys, and the other.
fn halved(items: &mut [u32], mut keys: Vec<(f32, u32)>) -> (&mut [u32], &mut [u32]) {
    let half = items.len() / 2;
    keys.select_nth_unstable_by(half, |a, b| a.0.total_cmp(&b.0));
    items.iter_mut().zip(keys).for_each(|(item, key)| *item = key.1);
    items.split_at_mut(half)
}

/// The axis along which points spread most. Of many points, some tell.
fn widest_axis(rows: &Rows, items: &[u32]) -> usize {
    let (mut low, mut high) = (vec![f32::INFINITY; rows.stride], vec![f32::NEG_INFINITY; rows.stride]);
    for &item in items.iter().step_by(items.len().div_ceil(TELLING)) {
        for ((low, high), &value) in low.iter_mut().zip(&mut high).zip(rows.row(item as usize)) {
            *low = low.min(value);
            *high = high.max(value);
        }
    }
    let spread = |axis: usize| high[axis] - low[axis];
    (0..rows.stride).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0)
}

/// Orders the points of a group such that those of a block are close together: by halves, across the line through two
/// points that are far from each other.
fn side_by_side(rows: &Rows, items: &mut [u32]) {
    if items.len() <= LANES {
        return;
    }
    let farthest = |squares: &[f32], items: &[u32]| {
        let place = (0..squares.len()).max_by(|&a, &b| squares[a].total_cmp(&squares[b])).unwrap_or(0);
        rows.row(items[place] as usize)
    };
    let first = distances(rows, rows.row(items[0] as usize), items);
    let one = distances(rows, farthest(&first, items), items);
    let other = distances(rows, farthest(&one, items), items);
    // Which side a point lies on follows from its distances to both ends.
    let keys = items.iter().zip(one.iter().zip(&other)).map(|(&item, (a, b))| (a - b, item)).collect();
    let (low, high) = halved(items, keys);
    side_by_side(rows, low);
    side_by_side(rows, high);
}

/// Squared distances of some rows to a point.
fn distances(rows: &Rows, point: &[f32], items: &[u32]) -> Vec<f32> {
    let square = |item: u32| {
        let mut sums = [0.0f32; STEP];
        for (a, b) in point.as_chunks::<STEP>().0.iter().zip(rows.row(item as usize).as_chunks::<STEP>().0) {
            for k in 0..STEP {
                let gap = a[k] - b[k];
                sums[k] += gap * gap;
            }
        }
        sums.iter().sum()
    };
    items.iter().map(|&item| square(item)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: usize, dimensions: usize, seed: f64) -> DenseMatrix {
        let value = |i: usize| ((i as f64 + seed) * 12.9898).sin() * 43758.547 % 1.0;
        DenseMatrix::from_columns(count, dimensions, (0..count * dimensions).map(value).collect())
    }

    /// Points of a wrinkled surface, as embeddings have them.
    fn wrinkled(count: usize, dimensions: usize, seed: f64) -> DenseMatrix {
        let plane = points(count, 2, seed);
        let mut all = DenseMatrix::zeros(count, dimensions);
        for column in 0..dimensions {
            let (a, b) = ((column % 7) as f64, (column / 7) as f64);
            for row in 0..count {
                let [x, y] = [0, 1].map(|axis| plane.column(axis)[row]);
                all.column_mut(column)[row] = (a * x).cos() * (b * y + x).cos();
            }
        }
        all
    }

    #[test]
    fn what_is_found_is_what_looking_at_all_points_finds() {
        let square = |a: &DenseMatrix, row: usize, b: &DenseMatrix, other: usize| {
            (0..a.columns()).map(|k| (a.column(k)[row] - b.column(k)[other]).powi(2)).sum::<f64>()
        };
        for (count, dimensions) in [(1, 3), (17, 1), (500, 2), (700, 40), (64, 9), (3000, 60), (2049, 16)] {
            for make in [points, wrinkled] {
                let (all, queries) = (make(count, dimensions, 0.0), make(50, dimensions, 0.37));
                let tree = Neighbours::new(&Rows::of(&all, dimensions)).unwrap();
                let guesses: Vec<u32> = (0..40).map(|row| (row * 31 % count) as u32).collect();
                for before in [&[][..], &guesses] {
                    let found = tree.nearest(&Rows::of(&queries, dimensions), before);
                    assert_eq!(found.len(), 50);
                    for (row, one) in found.iter().enumerate() {
                        let least =
                            (0..count).map(|item| square(&queries, row, &all, item)).fold(f64::INFINITY, f64::min);
                        let own = square(&queries, row, &all, one.point as usize);
                        // Coordinates were rounded to single precision.
                        let rounding = 1e-5 * least + 2e-6 * least.sqrt() + 1e-12;
                        assert!((own - least).abs() <= rounding, "{count} {dimensions} {row}: {own} {least}");
                        assert!((f64::from(one.square) - least).abs() <= rounding);
                        let both = |m: &DenseMatrix, row: usize| {
                            (0..dimensions).map(|k| m.column(k)[row].powi(2)).sum::<f64>()
                        };
                        let whole = both(&queries, row) + both(&all, one.point as usize);
                        assert!((f64::from(one.share) - least / whole).abs() < 1e-5);
                    }
                }
            }
        }
    }

    #[test]
    fn points_that_are_all_one_are_found_and_nothing_is_found_in_nothing() {
        let same = DenseMatrix::from_columns(900, 2, vec![0.5; 1800]);
        let tree = Neighbours::new(&Rows::of(&same, 2)).unwrap();
        let query = |x: f64, y: f64| tree.nearest(&Rows::of(&DenseMatrix::from_columns(1, 2, vec![x, y]), 2), &[]);
        assert_eq!(query(0.5, 0.5)[0].square, 0.0);
        assert_eq!(query(1.5, 0.5)[0].square, 1.0);
        assert!(Neighbours::new(&Rows::of(&same, 0)).is_none());
        assert!(Neighbours::new(&Rows::of(&DenseMatrix::zeros(0, 2), 2)).is_none());
    }

    #[test]
    #[should_panic = "dimensions of the queries"]
    fn queries_of_other_dimensions_are_a_mistake_of_the_caller() {
        let tree = Neighbours::new(&Rows::of(&DenseMatrix::zeros(9, 2), 2)).unwrap();
        tree.nearest(&Rows::of(&DenseMatrix::zeros(3, 40), 40), &[]);
    }
}
