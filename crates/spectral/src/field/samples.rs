//! Samples of lines on a surface, found again by where they lie.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A point of a line, with what it takes to compare it with others.
pub(super) struct Sample {
    /// In units of the square root of the area.
    pub point: [f64; 3],
    /// The unit normal of the surface there.
    pub normal: [f64; 3],
    /// The unit direction of the line.
    pub direction: [f64; 3],
    /// The number of its line.
    pub line: u32,
    /// Arc length along its line.
    pub along: f64,
}

/// Samples in cubic cells.
pub(super) struct Samples {
    size: f64,
    cells: HashMap<u64, Vec<Sample>, BuildHasherDefault<Spread>>,
}

/// Spreads numbers of cells: they are nobody's choice, and are looked up a hundred times for every sample.
#[derive(Default)]
struct Spread(u64);

impl Hasher for Spread {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(self.0.rotate_left(8) ^ u64::from(byte)));
    }
    fn write_u64(&mut self, number: u64) {
        let product = u128::from(number) * 0x9e37_79b9_7f4a_7c15;
        self.0 = (product >> 64) as u64 ^ product as u64;
    }
}

/// The number of a cell. Those that are two million cells apart share theirs, which costs time where both are full, and
/// nothing else.
fn number(cell: [i64; 3]) -> u64 {
    cell.iter().fold(0, |number, &x| number << 21 | (x as u64 & 0x1f_ffff))
}

impl Samples {
    /// No samples, in cells of an edge length.
    pub fn new(size: f64) -> Self {
        Self { size, cells: HashMap::default() }
    }

    /// The same samples in cells of another size.
    pub fn resized(self, size: f64) -> Self {
        let mut resized = Self::new(size);
        self.cells.into_values().flatten().for_each(|sample| resized.insert(sample));
        resized
    }

    fn cell(&self, point: [f64; 3]) -> [i64; 3] {
        point.map(|x| (x / self.size).floor() as i64)
    }

    /// Adds a sample.
    pub fn insert(&mut self, sample: Sample) {
        self.cells.entry(number(self.cell(sample.point))).or_default().push(sample);
    }

    /// Adds all samples of another collection with cells of the same size.
    pub fn absorb(&mut self, other: Self) {
        for (cell, samples) in other.cells {
            self.cells.entry(cell).or_default().extend(samples);
        }
    }

    /// Whether one of the samples that are closer to a point than a distance, at most the size of a cell, counts.
    pub fn any(&self, point: [f64; 3], distance: f64, counts: impl Fn(&Sample) -> bool) -> bool {
        let low = self.cell(point.map(|x| x - distance));
        let high = self.cell(point.map(|x| x + distance));
        let near = |s: &Sample| (0..3).map(|i| (s.point[i] - point[i]).powi(2)).sum::<f64>() < distance * distance;
        (low[0]..=high[0]).any(|i| {
            (low[1]..=high[1]).any(|j| {
                (low[2]..=high[2]).any(|k| {
                    let samples = self.cells.get(&number([i, j, k]));
                    samples.is_some_and(|samples| samples.iter().any(|s| near(s) && counts(s)))
                })
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    fn at(point: [f64; 3], line: u32) -> Sample {
        Sample { point, normal: [0.0; 3], direction: [0.0; 3], line, along: 0.0 }
    }

    #[test]
    fn samples_are_found_wherever_they_lie_within_the_distance_and_only_there() {
        let mut random = SplitMix64::new(3);
        let points: Vec<[f64; 3]> = (0..2000).map(|_| [0; 3].map(|_| 3.0 * random.signed_unit())).collect();
        let mut samples = Samples::new(0.7);
        points.iter().zip(0..).for_each(|(&point, line)| samples.insert(at(point, line)));
        let mut resized = Samples::new(0.3);
        resized.absorb(samples.resized(0.3));
        for (p, &point) in points.iter().enumerate() {
            let nearest = |q: usize| (0..3).map(|i| (points[q][i] - point[i]).powi(2)).sum::<f64>().sqrt();
            let expected = (0..points.len()).any(|q| q != p && nearest(q) < 0.2);
            assert_eq!(resized.any(point, 0.2, |s| s.line != p as u32), expected, "{p}");
        }
        assert!(!resized.any([1e300, f64::NAN, 0.0], 0.2, |_| true));
    }
}
