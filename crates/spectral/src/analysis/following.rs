//! Modes followed from one basis to another, as from one frame of an animation to the next: where eigenvalues cross,
//! mode 7 of one is mode 8 of the other, with either sign; where they coincide, functions are turned within their
//! space.
//!
//! With the coefficients `C = ΦᵀMΨ` and the norms of the functions `Ψ` of the other basis in the mass `M` of the
//! reference, overlaps are `O_ij = C_ij / ‖ψ_j‖`. Each function of the reference is given one of the other basis: by
//! the assignment `σ`, one to one, of greatest `Σ O²_iσ(i)` (Kuhn 1955). A function of a cluster of eigenvalues means
//! nothing by itself, but its space does. So functions are taken together whose eigenvalues, or those of the functions
//! that they are given, lie close together: modes `I` with followers `J = σ(I)`. The orthogonal matrix with the least
//! `‖Φ_I − Ψ_J R‖` is `R = V Uᵀ` of `C_IJ = U Σ Vᵀ` (Schönemann 1966), for a single mode the sign of its overlap. What
//! follows the functions of the reference is `Ψ R`, the same whichever functions stand for the eigenvalues of `J`.

use chladni_algebra::{DenseMatrix, nearest_orthogonal};
use chladni_base::Monitor;

use super::error::{self, AnalysisError};
use super::subspace::{MOST_PAIRS, check_gap, clusters};

/// The least overlap of what follows.
pub const LEAST_OVERLAP: f64 = 0.5;

/// The least square of the overlap of what follows for sure. No more than a fifth of the square of the follower's norm
/// is left for all other functions of the reference (Bessel), so that none has more than half of this overlap.
pub const SURE_SQUARE: f64 = 0.8;

/// How much of the square of a function at least lies in the cluster that it is given a function of, or of that
/// function in its own, if the two clusters belong together. Below that nothing follows.
const TIED_SQUARE: f64 = LEAST_OVERLAP * LEAST_OVERLAP;

/// What follows a mode of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowedMode {
    /// The mode of the other basis; none where the overlap is less than [`LEAST_OVERLAP`].
    pub follower: Option<usize>,
    /// The sign of the overlap with that single function, 1 or −1; within a cluster its rotation counts instead.
    pub sign: f64,
    /// The cosine of the angle between the function and what follows it: the single one with its sign, within a cluster
    /// the one that its rotation makes. Where nothing follows, that of what would.
    pub overlap: f64,
    /// Whether it follows for sure: the square of the overlap is at least [`SURE_SQUARE`], and no other function of the
    /// other basis, nor what a cluster of others has of the mode, has more than half of the overlap.
    pub sure: bool,
}

/// Functions that are followed together, since the eigenvalues of one or the other basis lie close together.
#[derive(Debug, Clone, PartialEq)]
pub struct FollowedCluster {
    /// At least two modes of the reference, ascending, which need not stand side by side.
    pub modes: Vec<usize>,
    /// The modes of the other basis, in the order of those that they are given to.
    pub followers: Vec<usize>,
    /// The orthogonal matrix that turns the functions of the followers to those of the modes: a row for each follower,
    /// a column for each mode.
    pub rotation: DenseMatrix,
}

/// Modes of one basis followed to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Following {
    /// What follows each mode of the reference.
    pub modes: Vec<FollowedMode>,
    /// Modes that are followed together, by the first of them.
    pub clusters: Vec<FollowedCluster>,
}

impl Following {
    /// The matrix `R` of all, `pairs × pairs`: column `i` of `Ψ R` follows mode `i` of the reference, and is zero where
    /// nothing does. From frame to frame these matrices multiply.
    pub fn rotation(&self) -> DenseMatrix {
        let pairs = self.modes.len();
        let mut whole = DenseMatrix::zeros(pairs, pairs);
        for (mode, followed) in self.modes.iter().enumerate() {
            if let Some(follower) = followed.follower {
                whole.column_mut(mode)[follower] = followed.sign;
            }
        }
        for FollowedCluster { modes, followers, rotation } in &self.clusters {
            for (column, &mode) in modes.iter().enumerate().filter(|&(_, &mode)| self.modes[mode].follower.is_some()) {
                let entries = followers.iter().zip(rotation.column(column));
                entries.for_each(|(&follower, &entry)| whole.column_mut(mode)[follower] = entry);
            }
        }
        whole
    }
}

/// Which functions of another basis follow those of the reference: by the coefficients `ΦᵀMΨ`, a row for each function
/// of the reference and a column for each of the other, and by `ΨᵀMΨ`, as [`compare`] finds them; `values` are the
/// eigenvalues of the reference and of the other basis, ascending. Eigenvalues of either that follow on each other with
/// a relative gap of at most `gap` are one cluster. Numbers that are not finite count as 0.
///
/// # Errors
/// [`AnalysisError`]: more pairs than [`MOST_PAIRS`] or than there are eigenvalues, a gap that is no number from 0 on,
/// cancellation.
///
/// # Panics
/// Unless both matrices are square and of one size.
///
/// [`compare`]: super::subspace::compare
pub fn follow(
    coefficients: &DenseMatrix,
    gram: &DenseMatrix,
    values: [&[f64]; 2],
    gap: f64,
    monitor: &dyn Monitor,
) -> Result<Following, AnalysisError> {
    let pairs = coefficients.columns();
    let sizes = [coefficients.rows(), gram.rows(), gram.columns()];
    assert_eq!(sizes, [pairs; 3], "rows and columns of coefficients and inner products");
    error::count("pairs", pairs, 0, values[0].len().min(values[1].len()).min(MOST_PAIRS))?;
    check_gap(gap)?;
    let squares = squares(coefficients, gram);
    let assigned = assignment(&squares, monitor)?;
    let groups = groups(&squares, &assigned, values.map(|values| places(&clusters(&values[..pairs], gap))));
    let mut group_of = vec![0; pairs];
    for (place, modes) in groups.iter().enumerate() {
        modes.iter().for_each(|&mode| group_of[assigned[mode]] = place);
    }
    let mut modes = vec![FollowedMode { follower: None, sign: 1.0, overlap: 0.0, sure: false }; pairs];
    let mut together = Vec::new();
    for (group, members) in groups.iter().enumerate() {
        monitor.checkpoint()?;
        let followers: Vec<usize> = members.iter().map(|&mode| assigned[mode]).collect();
        let turned = Turned::new((coefficients, gram), members, &followers)?;
        for (&mode, overlap) in members.iter().zip(turned.overlaps) {
            let follower = assigned[mode];
            let mut of_groups = vec![0.0; groups.len()];
            (0..pairs).for_each(|other| of_groups[group_of[other]] += squares.column(other)[mode]);
            let beside = of_groups.iter().enumerate().filter(|&(other, _)| other != group);
            let second = beside.fold(0.0, |most: f64, (_, &square)| most.max(square));
            modes[mode] = FollowedMode {
                follower: (overlap >= LEAST_OVERLAP).then_some(follower),
                sign: sign(coefficients.column(follower)[mode]),
                overlap,
                sure: overlap * overlap >= SURE_SQUARE && 4.0 * second <= overlap * overlap,
            };
        }
        if members.len() > 1 {
            together.push(FollowedCluster { modes: members.clone(), followers, rotation: turned.rotation });
        }
    }
    Ok(Following { modes, clusters: together })
}

/// Functions of the other basis turned to those of the reference.
struct Turned {
    rotation: DenseMatrix,
    /// Per function of the reference.
    overlaps: Vec<f64>,
}

impl Turned {
    fn new(
        (coefficients, gram): (&DenseMatrix, &DenseMatrix),
        modes: &[usize],
        followers: &[usize],
    ) -> Result<Self, AnalysisError> {
        let k = modes.len();
        let products = block(coefficients, modes, followers);
        let rotation = match products.values() {
            [value] => DenseMatrix::from_columns(1, 1, vec![sign(*value)]),
            _ => nearest_orthogonal(&products)?.transpose(),
        };
        let (turned, gram) = (products.times(&rotation), block(gram, followers, followers).times(&rotation));
        let overlap = |i: usize| {
            let square: f64 = rotation.column(i).iter().zip(gram.column(i)).map(|(x, y)| x * y).sum();
            if square > 0.0 { finite(turned.column(i)[i] / square.sqrt()) } else { 0.0 }
        };
        Ok(Self { overlaps: (0..k).map(overlap).collect(), rotation })
    }
}

/// Some entries of a matrix; those that are not finite are 0.
fn block(matrix: &DenseMatrix, rows: &[usize], columns: &[usize]) -> DenseMatrix {
    let entries = columns.iter().flat_map(|&column| rows.iter().map(move |&row| finite(matrix.column(column)[row])));
    DenseMatrix::from_columns(rows.len(), columns.len(), entries.collect())
}

fn sign(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// The number itself, or 0 where its square is none.
fn finite(value: f64) -> f64 {
    if (value * value).is_finite() { value } else { 0.0 }
}

/// The squares of all overlaps.
fn squares(coefficients: &DenseMatrix, gram: &DenseMatrix) -> DenseMatrix {
    let mut squares = coefficients.clone();
    for column in 0..squares.columns() {
        let norm = gram.column(column)[column].sqrt();
        let square = |x: &mut f64| *x = if norm > 0.0 { finite(*x / norm).powi(2) } else { 0.0 };
        squares.column_mut(column).iter_mut().for_each(square);
    }
    squares
}

/// For each mode the number of its cluster.
fn places(clusters: &[std::ops::Range<usize>]) -> Vec<usize> {
    clusters.iter().enumerate().flat_map(|(place, modes)| modes.clone().map(move |_| place)).collect()
}

/// The modes of the reference that are followed together, ascending, by the first of them. Modes are tied to one
/// cluster of each basis: their own, and that of the function that they are given.
fn groups(squares: &DenseMatrix, assigned: &[usize], [own, other]: [Vec<usize>; 2]) -> Vec<Vec<usize>> {
    let pairs = assigned.len();
    let tied = |mode: usize| {
        let follower = assigned[mode];
        let of_mode = (0..pairs).filter(|&j| other[j] == other[follower]).map(|j| squares.column(j)[mode]);
        let of_follower = (0..pairs).filter(|&i| own[i] == own[mode]).map(|i| squares.column(follower)[i]);
        of_mode.sum::<f64>().max(of_follower.sum()) >= TIED_SQUARE
    };
    // The first mode of what each was found to belong to, by way of others.
    let mut first: Vec<usize> = (0..pairs).collect();
    let root = |first: &[usize], mut mode: usize| {
        while first[mode] != mode {
            mode = first[mode];
        }
        mode
    };
    let (mut of_own, mut of_other) = (vec![None; pairs], vec![None; pairs]);
    for mode in (0..pairs).filter(|&mode| tied(mode)) {
        for known in [&mut of_own[own[mode]], &mut of_other[other[assigned[mode]]]] {
            let (a, b) = (root(&first, *known.get_or_insert(mode)), root(&first, mode));
            first[a.max(b)] = a.min(b);
        }
    }
    let mut groups = vec![Vec::new(); pairs];
    (0..pairs).for_each(|mode| groups[root(&first, mode)].push(mode));
    groups.retain(|modes| !modes.is_empty());
    groups
}

/// The row that each row is given a column of, one to one, so that the sum of the weights is greatest: shortest
/// augmenting paths, which a price for each row and column keeps without negative steps (Edmonds and Karp 1972),
/// `O(m³)` and, where each row has one large weight, hardly more than `O(m²)`. Weights are finite.
fn assignment(weights: &DenseMatrix, monitor: &dyn Monitor) -> Result<Vec<usize>, AnalysisError> {
    let pairs = weights.columns();
    let (mut of_rows, mut of_columns) = (vec![0.0; pairs], vec![0.0; pairs]);
    let mut assigned: Vec<Option<usize>> = vec![None; pairs];
    for start in 0..pairs {
        monitor.checkpoint()?;
        let (mut lengths, mut done) = (vec![f64::INFINITY; pairs], vec![false; pairs]);
        // The row before each on its path, none where the path begins; and where it has come to.
        let mut before: Vec<Option<usize>> = vec![None; pairs];
        let (mut column, mut from, mut length) = (start, None, 0.0);
        let end = loop {
            let mut nearest = usize::MAX;
            for (row, &weight) in weights.column(column).iter().enumerate().filter(|&(row, _)| !done[row]) {
                let reached = length - weight - of_columns[column] - of_rows[row];
                if reached < lengths[row] {
                    (lengths[row], before[row]) = (reached, from);
                }
                if nearest == usize::MAX || lengths[row] < lengths[nearest] {
                    nearest = row;
                }
            }
            // As many rows are free as columns are to come.
            (done[nearest], length) = (true, lengths[nearest]);
            match assigned[nearest] {
                Some(next) => (column, from) = (next, Some(nearest)),
                None => break nearest,
            }
        };
        of_columns[start] += length;
        for row in (0..pairs).filter(|&row| done[row]) {
            if let Some(column) = assigned[row] {
                of_columns[column] += length - lengths[row];
            }
            of_rows[row] -= length - lengths[row];
        }
        let mut row = end;
        while let Some(earlier) = before[row] {
            assigned[row] = assigned[earlier];
            row = earlier;
        }
        assigned[row] = Some(start);
    }
    Ok(assigned.into_iter().flatten().collect())
}

#[cfg(test)]
#[path = "following_tests.rs"]
mod tests;
