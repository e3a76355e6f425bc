//! What is read off a front once its columns were eliminated: growth, inertia, and how large rounding errors of its rows may be.

use pulp::Simd;

use super::super::factor::Node;

/// The larger of two; what is not a number is larger than all.
pub fn larger(most: f64, other: f64) -> f64 {
    if other <= most || most.is_nan() { most } else { other }
}

/// The largest `l²|d|` in the columns of a front, and how many pivots are negative.
pub fn growth(values: &[f64], rows: usize) -> (f64, usize) {
    let (mut growth, mut below) = (0f64, 0);
    for (column, values) in values.chunks_exact(rows).enumerate() {
        let most = pulp::Arch::new().dispatch(Largest(&values[column + 1..])).max(1.0);
        growth = growth.max(most * most * values[column].abs());
        below += usize::from(values[column] < 0.0);
    }
    (growth, below)
}

struct Largest<'a>(&'a [f64]);

impl pulp::WithSimd for Largest<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (vectors, last) = S::as_simd_f64s(self.0);
        let mut most = [simd.splat_f64s(0.0); 4];
        let (fours, ones) = vectors.as_chunks::<4>();
        for four in fours {
            for k in 0..4 {
                most[k] = simd.max_f64s(simd.abs_f64s(four[k]), most[k]);
            }
        }
        for one in ones {
            most[0] = simd.max_f64s(simd.abs_f64s(*one), most[0]);
        }
        most[0] = simd.max_f64s(simd.abs_f64s(simd.partial_load_f64s(last)), most[0]);
        let most = simd.max_f64s(simd.max_f64s(most[0], most[1]), simd.max_f64s(most[2], most[3]));
        simd.reduce_max_f64s(most)
    }
}

struct Magnitude<'a>(&'a [f64]);

impl pulp::WithSimd for Magnitude<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (vectors, last) = S::as_simd_f64s(self.0);
        let mut sums = [simd.splat_f64s(0.0); 4];
        let (fours, ones) = vectors.as_chunks::<4>();
        for four in fours {
            for k in 0..4 {
                sums[k] = simd.add_f64s(sums[k], simd.abs_f64s(four[k]));
            }
        }
        for one in ones {
            sums[0] = simd.add_f64s(sums[0], simd.abs_f64s(*one));
        }
        sums[1] = simd.add_f64s(sums[1], simd.abs_f64s(simd.partial_load_f64s(last)));
        let sum = simd.add_f64s(simd.add_f64s(sums[0], sums[1]), simd.add_f64s(sums[2], sums[3]));
        simd.reduce_sum_f64s(sum)
    }
}

/// `sums + factor · |l|`.
struct AddMagnitudes<'a> {
    sums: &'a mut [f64],
    l: &'a [f64],
    factor: f64,
}

impl pulp::WithSimd for AddMagnitudes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let factor = simd.splat_f64s(self.factor);
        let (l, last) = S::as_simd_f64s(self.l);
        let (sums, last_sums) = S::as_mut_simd_f64s(self.sums);
        for (sum, l) in sums.iter_mut().zip(l) {
            *sum = simd.mul_add_f64s(factor, simd.abs_f64s(*l), *sum);
        }
        if !last.is_empty() {
            let more = simd.abs_f64s(simd.partial_load_f64s(last));
            let sum = simd.mul_add_f64s(factor, more, simd.partial_load_f64s(last_sums));
            simd.partial_store_f64s(last_sums, sum);
        }
    }
}

/// How large the error of a row may be, from the sum of its row of `|L| |D| |Lᵀ|` and the number of entries of its row of `L`.
pub struct RowErrors<'a> {
    /// Entries of each row of `L`.
    pub terms: &'a [u32],
    /// The error over the mass: `(row, sum, terms)`.
    pub ratio: &'a (dyn Fn(usize, f64, u32) -> f64 + Sync),
}

/// Sums of the rows of a front.
pub struct RowSums<'a> {
    errors: &'a RowErrors<'a>,
    own: Vec<f64>,
    below: &'a mut [f64],
}

impl RowErrors<'_> {
    pub fn start<'s>(&'s self, node: &Node, sums: &'s mut [f64]) -> RowSums<'s> {
        let below = &mut sums[..node.pattern.1];
        below.fill(0.0);
        RowSums { errors: self, own: vec![0.0; node.columns], below }
    }
}

impl RowSums<'_> {
    /// What a child knows of its rows.
    pub fn add(&mut self, places: &[u32], sums: &[f64]) {
        for (&place, sum) in places.iter().zip(sums) {
            match (place as usize).checked_sub(self.own.len()) {
                None => self.own[place as usize] += sum,
                Some(below) => self.below[below] += sum,
            }
        }
    }

    /// The share of the front, and the largest error of its own rows over their mass.
    pub fn finish(self, node: &Node, values: &[f64]) -> f64 {
        let Self { errors, mut own, below } = self;
        let columns = own.len();
        let arch = pulp::Arch::new();
        for (column, values) in values.chunks_exact(columns + below.len()).enumerate() {
            let sum = values[column].abs() * (1.0 + arch.dispatch(Magnitude(&values[column + 1..])));
            own[column] += sum;
            arch.dispatch(AddMagnitudes { sums: &mut own[column + 1..], l: &values[column + 1..columns], factor: sum });
            arch.dispatch(AddMagnitudes { sums: &mut *below, l: &values[columns..], factor: sum });
        }
        let rows = node.start..node.start + columns;
        let ratio = |(row, sum): (usize, &f64)| (errors.ratio)(row, *sum, errors.terms[row]);
        rows.zip(&own).map(ratio).fold(0.0, larger)
    }
}
