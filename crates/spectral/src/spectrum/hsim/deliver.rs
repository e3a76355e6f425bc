//! From columns that were iterated on to pairs of the mesh, once they are judged.

use chladni_algebra::PanelMatrix;
use chladni_base::Monitor;
use chladni_base::notes::FALLBACKS;
use chladni_mesh::TriangleMesh;

use super::certify::{Goal, Proof};
use super::iterate::Iteration;
use super::judge::{Candidates, Count, Verdict, certify};
use super::judge_slices::certify_segments;
use super::{CutCluster, Eigenpairs, HsimError, InertiaCount, LevelReport, OnBound};
use crate::operator::EigenProblem;

/// What is delivered of the pairs found, and in which form.
pub(super) struct Delivery<'a> {
    pub mesh: &'a TriangleMesh,
    pub problem: &'a EigenProblem,
    /// The vertex of each row.
    pub vertices: &'a [u32],
    pub goal: Goal,
    /// The largest residual (4.6).
    pub tolerance: f64,
    /// What was taken off the eigenvalues.
    pub offset: f64,
    /// Pairs below this are not delivered, on unit area.
    pub from: Option<f64>,
    /// Whether pairs of which it is not certain on which side of the bound they lie may be told apart by their values.
    pub decide: bool,
}

/// The answer where no eigenvalue lies below the bound.
pub(super) fn nothing(mesh: &TriangleMesh, problem: &EigenProblem, n: usize, count: Count, offset: f64) -> Eigenpairs {
    Eigenpairs {
        values: Vec::new(),
        vectors: PanelMatrix::zeros(mesh.positions.len(), 0),
        residuals: Vec::new(),
        bounds: Vec::new(),
        orthonormality_defect: 0.0,
        inertia: vec![InertiaCount { shift: (count.shift + offset) / problem.area, below: count.below }],
        first: 0,
        on_bounds: Vec::new(),
        cut: None,
        levels: vec![LevelReport { dimension: n, iterations: 0, shifts: 1 }],
        space: None,
    }
}

/// Orders and judges what was found below the shift of a count, or of a cut cluster as many as are wanted, and scales
/// it. Where the judgement is against them, the iteration is left with its columns below the shift; so it is where it
/// has to go on to tell on which side of the bound a pair lies, which `None` says.
///
/// # Errors
/// Those of the judgement: see [`certify`].
pub(super) fn finish(
    iteration: &mut Iteration<'_>,
    proof: Proof,
    delivery: &Delivery<'_>,
    monitor: &dyn Monitor,
) -> Result<Option<Eigenpairs>, HsimError> {
    let known = iteration.kernel_below(proof.above.shift);
    keep_counted(iteration, proof, delivery, known)?;
    let Some((verdict, wanted)) = judged(iteration, proof, delivery, known, monitor)? else { return Ok(None) };
    delivered(iteration, proof, delivery, verdict, wanted).map(Some)
}

/// Keeps the columns that were counted, those of the kernel left out, as orthonormal Ritz vectors. `known` is the part
/// of the kernel below the shift.
fn keep_counted(
    iteration: &mut Iteration<'_>,
    proof: Proof,
    delivery: &Delivery<'_>,
    known: usize,
) -> Result<(), HsimError> {
    let pairs = match (delivery.goal, proof.below_cluster) {
        (Goal::Count(wanted), Some(_)) => wanted,
        _ => proof.above.below,
    };
    let mut order = iteration.order();
    order.truncate(pairs.saturating_sub(known));
    iteration.keep(order);
    iteration.remove_kernel();
    if !iteration.ritz {
        iteration.orthonormalise()?;
    }
    polish_wanted(iteration, delivery, known)
}

/// Polishes what is delivered beside the kernel.
fn polish_wanted(iteration: &mut Iteration<'_>, delivery: &Delivery<'_>, known: usize) -> Result<(), HsimError> {
    let open = match delivery.goal {
        Goal::Count(wanted) => wanted.saturating_sub(known),
        Goal::Below(_) => iteration.values.len(),
    };
    iteration.polish(open, delivery.tolerance)
}

/// What is proven of the columns, the kernel among them, and how many of them are wanted; nothing where it is open on
/// which side of the bound a pair lies. Columns that are refused for what they are get one more Rayleigh–Ritz.
fn judged(
    iteration: &mut Iteration<'_>,
    proof: Proof,
    delivery: &Delivery<'_>,
    known: usize,
    monitor: &dyn Monitor,
) -> Result<Option<(Verdict, usize)>, HsimError> {
    let mut again = true;
    loop {
        let kernel = iteration.insert_kernel(known)?;
        let wanted = match delivery.goal {
            Goal::Count(wanted) => wanted,
            Goal::Below(bound) => iteration.values.partition_point(|&value| value < bound),
        };
        let found = Candidates {
            level: iteration.level,
            vectors: &iteration.vectors,
            values: &iteration.values,
            kernel: &kernel,
            count: proof.above,
            floor: None,
            below_cluster: proof.below_cluster,
            wanted,
            tolerance: delivery.tolerance,
            offset: delivery.offset,
        };
        let verdict = match &iteration.cuts {
            None => certify(&found, monitor),
            Some(cuts) => certify_segments(&found, cuts, monitor),
        };
        let error = match verdict {
            Ok(verdict) if delivery.decide || !is_open(delivery.goal, &iteration.values, &verdict) => {
                return Ok(Some((verdict, wanted)));
            }
            Ok(_) => None,
            Err(error) => Some(error),
        };
        let columns = iteration.values.len();
        iteration.keep((0..kernel.start).chain(kernel.end..columns).collect());
        let Some(error) = error else { return Ok(None) };
        // Columns that were added one after the other may be less orthonormal than has to be.
        if !(std::mem::take(&mut again) && matches!(error, HsimError::Unproven { .. })) {
            return Err(error);
        }
        if iteration.cuts.is_some() {
            monitor.note(FALLBACKS, &format!("proof by segments: {error}"));
        }
        iteration.orthonormalise()?;
        polish_wanted(iteration, delivery, known)?;
    }
}

/// The pairs in the units of the problem, on the vertices of the mesh. Takes the columns.
fn delivered(
    iteration: &mut Iteration<'_>,
    proof: Proof,
    delivery: &Delivery<'_>,
    verdict: Verdict,
    wanted: usize,
) -> Result<Eigenpairs, HsimError> {
    let count = proof.above;
    let first = delivery.from.map_or(0, |from| iteration.values[..wanted].partition_point(|&value| value < from));
    count_below(iteration, first)?;
    let mut counts = iteration.counts(count);
    // Without it the count above the cluster would say nothing.
    counts.extend(proof.below_cluster.filter(|low| !counts.contains(low)));
    counts.sort_by(|a, b| a.shift.total_cmp(&b.shift));
    let Verdict { residuals, bounds, defect, sums, .. } = verdict;
    let (area, offset) = (delivery.problem.area, delivery.offset);
    let on_bounds = on_bounds(&iteration.values, &bounds, delivery);
    let cut = match (delivery.goal, proof.below_cluster) {
        (Goal::Below(_), _) => None,
        (Goal::Count(_), Some(below)) => Some(CutCluster { first: below.below, end: count.below }),
        (Goal::Count(_), None) => cut(&iteration.values, &bounds, wanted),
    };
    let range = first..wanted;
    let signs = sums.iter().map(|sums| if sums.lowest < -sums.highest { -1.0 } else { 1.0 });
    let factors: Vec<f64> = signs.map(|sign| sign / area.sqrt()).take(wanted).skip(first).collect();
    let mut vectors = std::mem::take(&mut iteration.vectors);
    if first == 0 {
        vectors.keep_columns(wanted);
    } else {
        vectors = vectors.select(&range.clone().collect::<Vec<_>>());
    }
    Ok(Eigenpairs {
        values: iteration.values[range.clone()].iter().map(|value| (value + offset) / area).collect(),
        vectors: vectors.spread(delivery.mesh.positions.len(), delivery.vertices, &factors),
        residuals: residuals[range.clone()].to_vec(),
        bounds: bounds[range].iter().map(|bound| bound / area).collect(),
        orthonormality_defect: defect,
        inertia: counts
            .into_iter()
            .map(|count| InertiaCount { shift: (count.shift + offset) / area, below: count.below })
            .collect(),
        first,
        on_bounds,
        cut,
        levels: Vec::new(),
        space: None,
    })
}

/// Counts the eigenvalues below the first delivered pair, where there is a gap to count in: with the count above the
/// last one, two that say how many there are between. Each pair is enclosed with its index whether or not there is.
fn count_below(iteration: &mut Iteration<'_>, first: usize) -> Result<(), HsimError> {
    let values = &iteration.values;
    if let (Some(&low), Some(&high)) = (first.checked_sub(1).and_then(|k| values.get(k)), values.get(first))
        && high - low > GAP * high.abs().max(low.abs())
    {
        iteration.count(0.5 * (low + high))?;
    }
    Ok(())
}

/// A relative gap that a count is made in.
const GAP: f64 = 1e-7;

/// The pairs whose enclosures reach a bound that was asked for.
fn on_bounds(values: &[f64], enclosures: &[f64], delivery: &Delivery<'_>) -> Vec<OnBound> {
    let upper = match delivery.goal {
        Goal::Below(bound) => Some(bound),
        Goal::Count(_) => None,
    };
    let in_units = |value: f64| (value + delivery.offset) / delivery.problem.area;
    let mut found = Vec::new();
    for bound in delivery.from.into_iter().chain(upper) {
        for (index, (&value, &within)) in values.iter().zip(enclosures).enumerate() {
            if (value - bound).abs() <= within {
                found.push(OnBound {
                    index,
                    value: in_units(value),
                    within: within / delivery.problem.area,
                    bound: in_units(bound),
                    below: value < bound,
                });
            }
        }
    }
    found
}

/// The cluster that ends neither with the last of `wanted` pairs nor before it: neighbours whose enclosures touch.
fn cut(values: &[f64], enclosures: &[f64], wanted: usize) -> Option<CutCluster> {
    let joined = |k: usize| {
        let apart = values[k] - values[k - 1];
        apart <= (enclosures[k] + enclosures[k - 1]).min(CLUSTER * values[k].abs()) || apart == 0.0
    };
    if wanted == 0 || wanted >= values.len() || !joined(wanted) {
        return None;
    }
    let first = (1..wanted).rev().take_while(|&k| joined(k)).last().map_or(wanted - 1, |k| k - 1);
    let end = (wanted..values.len()).take_while(|&k| joined(k)).last().map_or(wanted, |k| k + 1);
    Some(CutCluster { first, end })
}

/// Neighbours that are farther apart, relative to their values, are no cluster however wide their enclosures are.
const CLUSTER: f64 = 1e-3;

/// Whether some pair above the bound may belong below it, and would tell if it were iterated on. Those whose values lie
/// below it do so: Ritz values are no less than eigenvalues.
fn is_open(goal: Goal, values: &[f64], verdict: &Verdict) -> bool {
    let Goal::Below(bound) = goal else { return false };
    let pairs = values.iter().zip(&verdict.bounds).zip(&verdict.errors);
    pairs
        .filter(|&((&value, _), _)| value >= bound)
        .any(|((value, reach), error)| value - reach < bound && *reach > DECIDED * error)
}

/// Bounds up to this times their share of rounding errors are as close as they get.
const DECIDED: f64 = 4.0;
