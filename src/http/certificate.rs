//! The certificate of a basis as the OpenAPI document describes it; what is sent is what was stored.

use utoipa::ToSchema;

/// What is proven about a basis.
#[derive(ToSchema)]
#[schema(as = Certificate)]
#[allow(dead_code)]
pub struct CertificateSchema {
    /// Per pair ‖Sx − θMx‖ / ‖Sx‖; for the kernel ‖Sx‖ / (‖S‖ ‖x‖).
    residuals: Vec<f64>,
    /// Per pair: some exact eigenvalue lies within this of the eigenvalue.
    bounds: Vec<f64>,
    /// Per pair an estimate of the error of the eigenvalue, in 1/length² of the mesh; empty for methods with a tolerance.
    estimates: Vec<f64>,
    /// How near an approximation came to its goal; null for methods with a tolerance.
    accuracy: Option<AccuracySchema>,
    /// The largest entry of |ΦᵀMΦ − I|.
    orthonormality_defect: f64,
    /// Whether inertia counts prove that no eigenvalue below the last was skipped; null: not counted.
    complete: Option<bool>,
    /// The counts, by ascending shift.
    inertia: Vec<InertiaSchema>,
    /// The index of the first pair among all eigenvalues of the problem, where the pairs of an interval were asked for; absent where it is zero.
    #[schema(required = false)]
    first: u64,
    /// The bounds that the pairs were asked for by; absent where a number was asked for.
    #[schema(required = false)]
    interval: IntervalSchema,
    /// The cluster of eigenvalues that the number of pairs cuts; absent where it is known to cut none.
    #[schema(required = false)]
    cut: CutClusterSchema,
    /// The largest residual that a pair was allowed; null where the method has none.
    tolerance: Option<f64>,
    /// What each level of the hierarchy took, coarsest first.
    levels: Vec<LevelSchema>,
    /// Per pair ‖x − x̃‖ / ‖x‖ in the mass norm, where an exact eigenfunction x was projected to x̃ for compact storage; residuals and
    /// bounds are those of x.
    projection_errors: Vec<f64>,
    /// The largest of them.
    largest_projection_error: Option<f64>,
}

/// How near an approximation came to what was asked for.
#[derive(ToSchema)]
#[schema(as = AccuracyReport)]
#[allow(dead_code)]
pub struct AccuracySchema {
    /// The largest relative error of an eigenvalue that is good enough.
    goal: f64,
    /// The largest estimated relative error, the kernel apart.
    largest_estimate: f64,
    /// Whether that is at most the goal.
    reached: bool,
    /// How often columns were added where residuals sat.
    rounds: u64,
    /// The dimension of the space in the end.
    dimension: u64,
    /// How many of its columns are hat functions of single vertices.
    hats: u64,
}

/// Bounds on the eigenvalues that were asked for, in 1/length² of the mesh.
#[derive(ToSchema)]
#[schema(as = Interval)]
#[allow(dead_code)]
pub struct IntervalSchema {
    /// The lower bound, which belongs to the interval; absent where there is none.
    #[schema(required = false)]
    from: f64,
    /// The upper bound, which does not.
    to: f64,
    /// Pairs of which rounding does not let one tell on which side of a bound they lie, delivered or not.
    on_bounds: Vec<OnBoundSchema>,
}

/// A pair whose enclosure reaches a bound that was asked for: it is for its value that it counts as below the bound or not.
#[derive(ToSchema)]
#[schema(as = OnBound)]
#[allow(dead_code)]
pub struct OnBoundSchema {
    /// Its index among all eigenvalues, from 0.
    index: u64,
    /// Its value, in 1/length² of the mesh.
    value: f64,
    /// The exact eigenvalue lies within this of the value.
    within: f64,
    /// The bound that lies there too.
    bound: f64,
    /// Whether it counts as below.
    below: bool,
}

/// Eigenvalues that lie so close together that they count as one, of which not all are delivered: any functions of the cluster's eigenspace could stand
/// for those that are.
#[derive(ToSchema)]
#[schema(as = CutCluster)]
#[allow(dead_code)]
pub struct CutClusterSchema {
    /// The index of its first eigenvalue among all, from 0.
    first: u64,
    /// One more than the index of its last, or of the last that may belong to it.
    end: u64,
}

/// How many eigenvalues lie below a shift.
#[derive(ToSchema)]
#[schema(as = InertiaCount)]
#[allow(dead_code)]
pub struct InertiaSchema {
    /// The shift, in 1/length² of the mesh.
    shift: f64,
    /// Eigenvalues below it, with multiplicity.
    below: u64,
}

/// What one level of the hierarchy took.
#[derive(ToSchema)]
#[schema(as = LevelReport)]
#[allow(dead_code)]
pub struct LevelSchema {
    /// The size of its eigenproblem.
    dimension: u64,
    /// Iterations; 0 where it was solved directly.
    iterations: u64,
    /// Shifts that were factored.
    shifts: u64,
}
