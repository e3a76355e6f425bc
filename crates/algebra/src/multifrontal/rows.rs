//! What is read off a front once its columns were eliminated: growth, inertia, and how large rounding errors of its
//! rows may be.

use chladni_base::parallel::*;
use pulp::Simd;

use super::super::factor::{Node, SymbolicFactor};
use super::Plan;

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

/// The sums of the rows of `|L| |D| |Lᵀ|` of a factor without exchanged rows, piece by piece.
pub fn magnitudes(symbolic: &SymbolicFactor, plan: &Plan, values: &[f64]) -> Vec<f64> {
    let pattern = |node: &Node| &symbolic.patterns[node.pattern.0..node.pattern.0 + node.pattern.1];
    // What a piece adds to its own rows, and to those above it: they are the pattern of its last supernode.
    let parts = plan.pieces.par_iter().map(|piece| {
        let nodes = &symbolic.nodes[piece.clone()];
        let (first, top) = (&nodes[0], &nodes[nodes.len() - 1]);
        let (start, end, above) = (first.start, top.start + top.columns, pattern(top));
        let (mut own, mut over, mut sums) = (vec![0.0; end - start], vec![0.0; above.len()], Vec::new());
        for node in nodes {
            let rows = node.columns + node.pattern.1;
            sums.clear();
            sums.resize(rows, 0.0);
            for (column, values) in values[node.values..][..rows * node.columns].chunks_exact(rows).enumerate() {
                add_column(&mut sums, column, values);
            }
            let places = own[node.start - start..].iter_mut().zip(&sums[..node.columns]);
            places.for_each(|(own, sum)| *own += sum);
            let mut at = 0;
            for (&row, sum) in pattern(node).iter().zip(&sums[node.columns..]) {
                if (row as usize) < end {
                    own[row as usize - start] += sum;
                } else {
                    at += above[at..].partition_point(|&other| other < row);
                    over[at] += sum;
                }
            }
        }
        (start, own, above, over)
    });
    let mut all = vec![0.0; symbolic.size()];
    for (start, own, above, over) in parts.collect::<Vec<_>>() {
        all[start..].iter_mut().zip(own).for_each(|(all, own)| *all += own);
        above.iter().zip(over).for_each(|(&row, over)| all[row as usize] += over);
    }
    all
}

/// What a column of `L` and its pivot add to the sums of the rows of a front.
fn add_column(sums: &mut [f64], column: usize, values: &[f64]) {
    let arch = pulp::Arch::new();
    let sum = values[column].abs() * (1.0 + arch.dispatch(Magnitude(&values[column + 1..])));
    sums[column] += sum;
    arch.dispatch(AddMagnitudes { sums: &mut sums[column + 1..], l: &values[column + 1..], factor: sum });
}

/// How large the error of a row may be, from the sum of its row of `|L| |D| |Lᵀ|` and the number of entries of its row
/// of `L`.
pub struct RowErrors<'a> {
    /// Entries of each row of `L`.
    pub terms: &'a [u32],
    /// The error over the mass: `(row, sum, terms)`.
    pub ratio: &'a (dyn Fn(usize, f64, u32) -> f64 + Sync),
}

/// Sums of the rows of a front.
pub struct RowSums<'a> {
    errors: &'a RowErrors<'a>,
    /// Those of its own rows and of the ones below.
    sums: Vec<f64>,
    below: &'a mut [f64],
}

impl RowErrors<'_> {
    /// Those of the rows below are to be left in `sums`.
    pub fn start<'s>(&'s self, node: &Node, sums: &'s mut [f64]) -> RowSums<'s> {
        let below = &mut sums[..node.pattern.1];
        RowSums { errors: self, sums: vec![0.0; node.columns + below.len()], below }
    }
}

impl RowSums<'_> {
    /// What a child knows of its rows.
    pub fn add(&mut self, places: &[u32], sums: &[f64]) {
        places.iter().zip(sums).for_each(|(&place, sum)| self.sums[place as usize] += sum);
    }

    /// The share of the front, and the largest error of its own rows over their mass.
    pub fn finish(self, node: &Node, values: &[f64]) -> f64 {
        let Self { errors, mut sums, below } = self;
        for (column, values) in values.chunks_exact(sums.len()).enumerate() {
            add_column(&mut sums, column, values);
        }
        below.copy_from_slice(&sums[node.columns..]);
        let rows = node.start..node.start + node.columns;
        let ratio = |(row, sum): (usize, &f64)| (errors.ratio)(row, *sum, errors.terms[row]);
        rows.zip(&sums).map(ratio).fold(0.0, larger)
    }
}
