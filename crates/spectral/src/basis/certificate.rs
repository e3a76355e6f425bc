//! What is proven about a basis.

use serde::{Deserialize, Serialize};

/// What is proven about a basis.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Certificate {
    /// Per pair `‖S x − θ M x‖ / ‖S x‖` (thesis, eq. 4.6), of the columns as they are stored; for the kernel
    /// `‖S x‖ / (‖S‖ ‖x‖)`.
    pub residuals: Vec<f64>,
    /// Per pair an a-posteriori bound, in 1/length² of the input. Where `complete` is true, the exact eigenvalue of the
    /// same index lies within `[θ − bound, θ + bound]`, rounding errors included; otherwise some exact eigenvalue does.
    pub bounds: Vec<f64>,
    /// Per pair an estimate of the error of the eigenvalue, in 1/length² of the input; empty where there is none.
    #[serde(default)]
    pub estimates: Vec<f64>,
    /// How near an approximation came to what was asked for; `None` for methods with a tolerance.
    #[serde(default)]
    pub accuracy: Option<AccuracyReport>,
    /// The largest entry of `|ΦᵀMΦ − I|`.
    pub orthonormality_defect: f64,
    /// Whether inertia counts prove that no eigenvalue below the last was skipped; `None`: not counted.
    #[serde(default)]
    pub complete: Option<bool>,
    /// The inertia counts, by ascending shift.
    #[serde(default)]
    pub inertia: Vec<InertiaCount>,
    /// The index of the first pair among all eigenvalues of the problem: zero but where the pairs of an interval were
    /// asked for.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub first: usize,
    /// The bounds that the pairs were asked for by, if they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<Interval>,
    /// The number that the pairs are the nearest to, if they were asked for by one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub around: Option<Around>,
    /// The cluster that the number of pairs cuts, if it is known to cut one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<CutCluster>,
    /// The largest residual that a pair was allowed, where the method has one.
    #[serde(default)]
    pub tolerance: Option<f64>,
    /// What each level of the hierarchy took, coarsest first; empty where there is no hierarchy.
    #[serde(default)]
    pub levels: Vec<LevelReport>,
    /// Per pair `‖x − x̃‖_M / ‖x‖_M`, where the eigenfunctions `x` were projected to `x̃ = U c` to store them
    /// compactly; else empty.
    #[serde(default)]
    pub projection_errors: Vec<f64>,
    /// The largest of them.
    #[serde(default)]
    pub largest_projection_error: Option<f64>,
}

/// What is known of the lowest approximate eigenfields of a field basis. Lengths are those of the input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FieldCertificate {
    /// For each of the lowest eigenfields, as many as were judged, about how far its eigenvalue lies above the exact
    /// one of the same index, in 1/length².
    pub estimates: Vec<f64>,
    /// For each of them: some exact eigenvalue lies within this of its eigenvalue, in 1/length², up to rounding; null
    /// where no such bound is known.
    pub bounds: Vec<Option<f64>>,
    /// How near they come to what is usual.
    pub accuracy: FieldAccuracyReport,
}

/// How near the lowest approximate eigenfields come to what is usual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FieldAccuracyReport {
    /// The largest relative error of an eigenvalue that is usual on fair triangles.
    pub goal: f64,
    /// The largest estimated error, as a share of the exact eigenvalue, fields without energy apart.
    pub largest_estimate: f64,
    /// Whether that is at most the goal. Where it is false, such fields are eigenfields of the space and not of the
    /// surface.
    pub reached: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// How near an approximation came to what was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AccuracyReport {
    /// The largest relative error of an eigenvalue that is good enough.
    pub goal: f64,
    /// The largest estimated relative error, the kernel apart.
    pub largest_estimate: f64,
    /// Whether that is at most the goal.
    pub reached: bool,
    /// How often the space was made finer: by columns that diffuse for longer, by more of them, or by single vertices
    /// where residuals sat.
    pub rounds: usize,
    /// The dimension of the space in the end.
    pub dimension: usize,
    /// How many of its columns are hat functions of single vertices.
    pub hats: usize,
    /// The implicit heat steps that smoothed the columns in the end, more than usual where columns have few vertices.
    /// Absent for other constructions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat_steps: Option<usize>,
}

/// An inertia count (Sylvester): how many eigenvalues lie below a shift.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct InertiaCount {
    /// The shift, in 1/length² of the input.
    pub shift: f64,
    /// Eigenvalues below it, with multiplicity.
    pub below: usize,
}

/// Bounds on the eigenvalues that were asked for, in 1/length² of the input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Interval {
    /// The lower bound, which belongs to the interval; absent where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<f64>,
    /// The upper bound, which does not.
    pub to: f64,
    /// Pairs of which rounding does not let one tell on which side of a bound they lie, delivered or not.
    pub on_bounds: Vec<OnBound>,
}

/// A pair whose enclosure reaches a bound that was asked for: it is for its value that it counts as below the bound or
/// not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct OnBound {
    /// Its index among all eigenvalues, from 0.
    pub index: usize,
    /// Its value, in 1/length² of the input.
    pub value: f64,
    /// The exact eigenvalue lies within this of the value.
    pub within: f64,
    /// The bound that lies there too.
    pub bound: f64,
    /// Whether it counts as below.
    pub below: bool,
}

/// The number that pairs were asked for by, as the nearest to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Around {
    /// The number.
    pub shift: f64,
    /// Pairs of which enclosures do not let one tell which are nearer, delivered or not; empty where these pairs are
    /// proven to be the nearest.
    pub ties: Vec<NearPair>,
}

/// A pair as near to a number as another, as far as one can tell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NearPair {
    /// Its index among all eigenvalues, from 0.
    pub index: usize,
    /// Its value.
    pub value: f64,
    /// The exact eigenvalue lies within this of the value.
    pub within: f64,
    /// Whether it is delivered.
    pub delivered: bool,
}

/// Eigenvalues that lie so close together that they count as one, of which not all are delivered: any functions of the
/// cluster's eigenspace could stand for those that are, and another computation may give others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CutCluster {
    /// The index of its first eigenvalue among all, from 0.
    pub first: usize,
    /// One more than the index of its last, or of the last that may belong to it.
    pub end: usize,
}

/// What one level of the hierarchy took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LevelReport {
    /// The size of the level's eigenproblem.
    pub dimension: usize,
    /// Iterations, each with one Rayleigh–Ritz; 0 for a level that is solved directly.
    pub iterations: usize,
    /// Shifts that were factored.
    pub shifts: usize,
}

/// What inertia counts prove about ascending eigenvalues that a solver found: `None` where there are no counts;
/// `Some(true)` where every count at a shift among the values equals the values below it, and a further count lies
/// above the last value.
///
/// A count above the last value may be larger than the values: a solver that computed a whole cluster delivers as many
/// of it as were asked for. Where the pairs begin at another index than the `first` of all, counts below the first
/// value are at most that, and those among the values equal it and the values below.
pub fn completeness(first: usize, values: &[f64], inertia: &[InertiaCount]) -> Option<bool> {
    if inertia.is_empty() {
        return None;
    }
    let last = values.last().copied().unwrap_or(f64::NEG_INFINITY);
    let mut closed = false;
    for count in inertia {
        let among = values.iter().filter(|&&value| value < count.shift).count();
        if values.is_empty() {
            // Only a count of what was left out says that nothing lies there; others are below the interval, or beyond
            // it.
            closed |= count.below == first;
            continue;
        }
        let above = count.shift > last;
        let found = first + among;
        closed |= above;
        let fits = match (above, among) {
            (true, _) => count.below >= found,
            (false, 0) => count.below <= first && (first > 0 || count.below == 0),
            (false, _) => count.below == found,
        };
        if !fits {
            return Some(false);
        }
    }
    Some(closed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_counts_that_agree_and_reach_above_the_last_pair_prove_completeness() {
        let values = [0.0, 1.0, 1.0, 2.0];
        let count = |shift, below| InertiaCount { shift, below };
        assert_eq!(completeness(0, &values, &[]), None);
        assert_eq!(completeness(0, &values, &[count(2.5, 4)]), Some(true));
        assert_eq!(completeness(0, &values, &[count(0.5, 1), count(2.5, 6)]), Some(true));
        assert_eq!(completeness(0, &values, &[count(1.5, 3)]), Some(false), "nothing is said of the last pair");
        assert_eq!(completeness(0, &values, &[count(1.5, 4), count(2.5, 4)]), Some(false), "one is missing below 1.5");
        let empty = |counts: &[InertiaCount]| completeness(7, &[], counts);
        assert_eq!(empty(&[count(0.5, 3), count(2.5, 7), count(3.0, 9)]), Some(true));
        assert_eq!(empty(&[count(0.5, 3)]), Some(false));
        assert_eq!(empty(&[count(3.0, 9)]), Some(false), "two may lie in the interval");
        let shifted = |counts: &[InertiaCount]| completeness(7, &values, counts);
        assert_eq!(shifted(&[count(-1.0, 7), count(2.5, 11)]), Some(true));
        assert_eq!(shifted(&[count(-5.0, 3), count(0.5, 8), count(2.5, 12)]), Some(true));
        assert_eq!(shifted(&[count(-1.0, 8), count(2.5, 11)]), Some(false), "more lie below than are left out");
        assert_eq!(shifted(&[count(-1.0, 7), count(0.5, 7), count(2.5, 11)]), Some(false));
        assert_eq!(shifted(&[count(-1.0, 7), count(2.5, 10)]), Some(false));
        assert_eq!(completeness(0, &values, &[count(2.5, 3)]), Some(false), "one is there that cannot be");
    }

    #[test]
    fn certificates_of_an_earlier_version_are_read() {
        let old = r#"{"residuals": [0.5], "bounds": [1.0], "orthonormality_defect": 0.25}"#;
        let certificate: Certificate = serde_json::from_str(old).unwrap();
        assert_eq!((certificate.complete, certificate.levels.len()), (None, 0));
    }
}
