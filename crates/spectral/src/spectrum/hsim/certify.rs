//! Proof that nothing is missing: eigenvalues counted by inertia, and the search for what a count says is not there.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix, restrict, rotate};
use chladni_base::SplitMix64;

use super::HsimError;
use super::iterate::{Iteration, Plan};
use super::judge::Count;
use super::ritz::ritz;
use super::shifts::{factor_near, unit};
use super::tuning::TUNING;

/// Which pairs have to be there, the kernel included.
#[derive(Debug, Clone, Copy)]
pub(super) enum Goal {
    /// The lowest so many; more are computed where the last lies in a cluster.
    Count(usize),
    /// All below a bound; more are computed where some lie so close above it that no count could tell.
    Below(f64),
}

/// What proves that nothing is missing among the pairs that were found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Proof {
    /// Counted above the last of them.
    pub above: Count,
    /// Counted below the cluster that the last wanted pair belongs to, where not all of that was found.
    pub below_cluster: Option<Count>,
}

/// What one attempt at a count says.
enum Outcome {
    Proven(Count),
    /// More pairs have to converge first: so many beside the kernel.
    MorePairs(usize),
    /// A count is larger than the number of values below it, which is this.
    Missing(Count, usize),
    /// No count could be trusted.
    Doubtful(String),
}

/// Iterates until the goal is reached and proven.
pub(super) fn complete(iteration: &mut Iteration<'_>, goal: Goal, plan: &Plan, seed: u64) -> Result<Proof, HsimError> {
    let (asked, mut plan) = (plan.wanted, *plan);
    let (mut round, mut vain, mut least) = (0, 0, usize::MAX);
    // So many columns were iterated on beside what is wanted, and whether to a sharper tolerance.
    let (mut guards, mut sharp) = (0, false);
    loop {
        match converge(iteration, &plan) {
            // What belongs to the cluster of the last wanted pair does not converge, or not as far as the columns
            // reach.
            Err(error @ HsimError::NotConverged { .. }) if plan.wanted > asked && matches!(goal, Goal::Count(_)) => {
                plan = Plan { wanted: asked, most_passes: iteration.passes + TUNING.iteration.most_passes, ..plan };
                converge(iteration, &plan)?;
                return match below_cluster(iteration, goal, &plan)? {
                    Some(below) => Ok(Proof { above: count_above(iteration)?, below_cluster: Some(below) }),
                    None => Err(error),
                };
            }
            converged => converged?,
        }
        match attempt(iteration, goal, &plan)? {
            Outcome::Proven(above) => return Ok(Proof { above, below_cluster: None }),
            Outcome::MorePairs(wanted) => plan.wanted = wanted,
            Outcome::Doubtful(reason) => return Err(HsimError::Unproven { reason }),
            Outcome::Missing(count, found) => {
                let (missing, shift) = (count.below - found, count.shift);
                let counted = count.below - iteration.kernel_below(shift);
                let sharper = counted <= guards;
                if (!sharper || !sharp) && counted <= iteration.values.len() {
                    // As many columns are there. Those that nobody waited for may be what is missing; then, those whose
                    // values are too large still.
                    (guards, sharp) = (counted.max(guards), sharper);
                    let tolerance = if sharper { TUNING.proof.sharp.min(plan.tolerance) } else { plan.tolerance };
                    let most_passes = iteration.passes + TUNING.proof.guard_passes;
                    iteration.run(&Plan { wanted: counted, tolerance, most_passes, ..plan })?;
                    iteration.take_quotients()?;
                    plan.most_passes = iteration.passes + TUNING.iteration.most_passes;
                    continue;
                }
                vain += u64::from(missing >= least);
                least = least.min(missing);
                // What one search may find is worth one: a whole cluster tells more than a part of it.
                if (missing > PANEL_WIDTH || vain >= TUNING.proof.vain_rounds)
                    && let Some(below) = below_cluster(iteration, goal, &plan)?
                {
                    return Ok(Proof { above: count, below_cluster: Some(below) });
                }
                if vain >= TUNING.proof.vain_rounds {
                    return Err(HsimError::Incomplete { missing, shift });
                }
                iteration.monitor.stage("repair");
                match search(iteration, shift, seed.wrapping_add(round))? {
                    0 => vain += 1,
                    // What was found has to be iterated on as well.
                    _ => (guards, sharp) = (0, false),
                }
                if matches!(goal, Goal::Below(_)) {
                    plan.wanted = (plan.wanted + missing).min(iteration.values.len());
                }
                round += 1;
            }
        }
        plan.most_passes = iteration.passes + TUNING.iteration.most_passes;
    }
}

/// Counts in one gap after the other until a count can be trusted.
fn attempt(iteration: &mut Iteration<'_>, goal: Goal, plan: &Plan) -> Result<Outcome, HsimError> {
    let values = iteration.all_values();
    let (place, floor) = match goal {
        Goal::Count(count) => (count.min(values.len()), f64::NEG_INFINITY),
        Goal::Below(bound) => (values.partition_point(|&value| value < bound), bound),
    };
    let mut doubt = "there is no gap to count in".to_owned();
    let mut least_radius = f64::INFINITY;
    for (shift, found) in places(&values, place, floor, iteration.level.size(), iteration.spread) {
        // Nearer to a value than any count is certain to.
        let at_best = Count { shift, below: found, radius: least_radius };
        if least_radius.is_finite() && !at_best.is_clear_of(&values) {
            continue;
        }
        let columns = found - iteration.kernel_below(shift);
        if columns > plan.wanted {
            // The last wanted pair belongs to a cluster: what is counted with it has to converge with it.
            let all = Plan { wanted: columns, ..*plan };
            if !iteration.unconverged(&all).is_empty() {
                return Ok(Outcome::MorePairs(columns));
            }
        }
        iteration.monitor.stage("certify");
        iteration.monitor.checkpoint()?;
        let mut count = iteration.count(shift)?;
        let reach = values.iter().map(|value| (value - count.shift).abs()).fold(f64::INFINITY, f64::min);
        let negative = values.first().is_some_and(|&lowest| lowest < 0.0);
        if !count.is_clear_of(&values)
            && let Some(closer) = iteration.count_closely(count.shift, reach, negative)?
            && closer.radius < count.radius
        {
            count = closer;
        }
        if !count.is_clear_of(&values) {
            least_radius = least_radius.min(count.radius);
            doubt = format!("the count at {shift} is uncertain by {:e}", count.radius);
        } else if count.below == found {
            return Ok(Outcome::Proven(count));
        } else if count.below > found {
            return Ok(Outcome::Missing(count, found));
        } else {
            doubt = format!("{found} pairs were found below {shift}, and {} counted", count.below);
        }
        iteration.monitor.detail(&doubt);
    }
    Ok(Outcome::Doubtful(doubt))
}

fn converge(iteration: &mut Iteration<'_>, plan: &Plan) -> Result<(), HsimError> {
    // First everything to a loose tolerance, which finds what the start did not contain; then the wanted one.
    if plan.tolerance < TUNING.proof.loose {
        iteration.run(&Plan { tolerance: TUNING.proof.loose, solves: 1, ..*plan })?;
    }
    iteration.run(plan)?;
    iteration.take_quotients()?;
    iteration.run(plan)?;
    iteration.polish(plan.wanted, plan.tolerance)?;
    iteration.require(plan)
}

/// Counts below the cluster of the last wanted pair: with as many eigenvalues there as values were found, whatever is
/// missing below a shift above the cluster belongs to it, and may be as good as endless, as on a star. `None` where
/// more lie below, or the last pair belongs to no cluster so narrow that it could be taken for one value.
fn below_cluster(iteration: &mut Iteration<'_>, goal: Goal, plan: &Plan) -> Result<Option<Count>, HsimError> {
    let Goal::Count(wanted) = goal else { return Ok(None) };
    // Values that are still too large lie inside the cluster, or above it.
    let most_passes = iteration.passes + TUNING.proof.guard_passes;
    iteration.run(&Plan { tolerance: plan.tolerance.min(TUNING.proof.sharp), most_passes, ..*plan })?;
    iteration.take_quotients()?;
    let values = iteration.all_values();
    let Some(&last) = wanted.checked_sub(1).and_then(|last| values.get(last)) else { return Ok(None) };
    for width in WIDTHS {
        let reach = width * last.abs() + 1e-12 * iteration.spread;
        let first = values.partition_point(|&value| value < last - reach);
        let middle = first.checked_sub(1).map_or(f64::NEG_INFINITY, |before| 0.5 * (values[before] + values[first]));
        let count = iteration.count((values[first] - reach).max(middle))?;
        if count.is_clear_of(&values) && count.below == first {
            return Ok(Some(count));
        }
    }
    Ok(None)
}

/// Counts above all columns.
fn count_above(iteration: &mut Iteration<'_>) -> Result<Count, HsimError> {
    let top = iteration.all_values().last().copied().unwrap_or(0.0);
    iteration.count(top + ABOVE * top.abs() + 1e-9 * iteration.spread)
}

/// What belongs to a cluster lies this far apart at most, relative to its value; the narrower, the better its members
/// are enclosed.
const WIDTHS: [f64; 2] = [1e-6, 1e-4];

/// Shifts above the lowest `least` values and above `floor`, each with the number of values below it, the best first:
/// in wide gaps, nearer to their lower ends since values that are still being iterated on are too large. `size` is the
/// number of all pairs there are, `spread` at least about the largest eigenvalue.
pub(super) fn places(values: &[f64], least: usize, floor: f64, size: usize, spread: f64) -> Vec<(f64, usize)> {
    let last = values.len();
    let low = |at: usize| if at == 0 { floor } else { values[at - 1].max(floor) };
    // Beside a large constant, as outliers need one, all gaps are nothing beside the values.
    let top = values.last().copied().unwrap_or(floor);
    let from = values[least.saturating_sub(BEFORE).min(last.saturating_sub(1))..].first().copied().unwrap_or(top);
    let relative = |at: usize| {
        let (low, high) = (low(at), values[at]);
        if low == f64::NEG_INFINITY { f64::INFINITY } else { (high - low) / unit(high.abs().max(low.abs()), from, top) }
    };
    // Guards are less exact the higher they are.
    let reach = last.saturating_sub(least).div_ceil(2).max(1);
    let mut gaps: Vec<usize> = (least..(least + reach).min(last)).filter(|&at| relative(at) > NO_GAP).collect();
    let wide = 0.2 / least.max(20) as f64;
    let first = gaps.iter().copied().find(|&at| relative(at) > wide);
    gaps.sort_by(|&a, &b| (Some(b) == first).cmp(&(Some(a) == first)).then(relative(b).total_cmp(&relative(a))));
    gaps.truncate(GAPS);
    let mut places = Vec::new();
    // Nearer to the lower end; then anywhere, since what a factor is uncertain by changes from shift to shift by far
    // more than its least.
    for share in [0.4, 0.15, 0.7, 0.55, 0.3] {
        places.extend(gaps.iter().map(|&at| match low(at) {
            f64::NEG_INFINITY => (values[at] - values[at].abs().max(1e-9 * spread), at),
            low => (low + share * (values[at] - low), at),
        }));
    }
    // All of them belong to one cluster, which a count above it tells the size of; or these are all pairs there are.
    let top = values.last().copied().unwrap_or(floor).max(floor);
    let above = if last >= size { 0.01 * top.abs() + 0.01 * spread } else { ABOVE * top.abs() + 1e-9 * spread };
    if last >= size && least >= last {
        places.clear();
    }
    places.push((top + above, last));
    places
}

/// Where values lie next to the end of the columns is told by those from so many before the least place on.
const BEFORE: usize = 4;

/// Gaps that are tried.
const GAPS: usize = 3;

/// A relative gap that rounding could have made.
const NO_GAP: f64 = 1e-7;

/// How far above a cluster its members are counted, relative to it.
const ABOVE: f64 = 1e-3;

/// Looks for eigenvectors below `shift` that the columns do not contain, starting from random vectors where counts and
/// values first disagree. Gives how many columns that added.
fn search(iteration: &mut Iteration<'_>, shift: f64, seed: u64) -> Result<usize, HsimError> {
    let (level, monitor) = (iteration.level, iteration.monitor);
    let room = level.size().saturating_sub(iteration.kernel.dimension() + iteration.values.len());
    if room == 0 {
        return Ok(0);
    }
    let mut counts: Vec<Count> = iteration.inertia.iter().copied().filter(|count| count.shift <= shift).collect();
    counts.sort_by(|a, b| a.shift.total_cmp(&b.shift));
    let values = iteration.all_values();
    let found = |at: f64| values.partition_point(|&value| value < at);
    let deficient = counts.iter().position(|count| count.below > found(count.shift));
    let high = deficient.map_or(shift, |k| counts[k].shift);
    let least = values.first().copied().unwrap_or(shift);
    let low = deficient.and_then(|k| counts[..k].last()).map_or(least, |count| count.shift).min(high);
    // The widest gap inside the interval, but not its ends, where a search has already been.
    let middle = 0.5 * (low + high);
    let width = (high - low).max(f64::MIN_POSITIVE);
    let gap = values[found(low)..found(high)].windows(2).max_by(|a, b| {
        let inside = |pair: &[f64]| (pair[1] - pair[0]) / (1.0 + (0.5 * (pair[0] + pair[1]) - middle).abs() / width);
        inside(a).total_cmp(&inside(b))
    });
    let at = gap.map_or(middle, |pair| pair[0] + 0.382 * (pair[1] - pair[0]));
    let storage = iteration.storage();
    let (at, factor) = factor_near(level, iteration.symbolic, at, iteration.spread, storage, monitor)?;
    iteration.inertia.push(Count::of(level, at, &factor));
    let mut random = SplitMix64::new(seed ^ 0x6d15_5126);
    let width = PANEL_WIDTH.min(room);
    let mut columns = PanelMatrix::zeros(level.size(), width);
    for row in columns.panels_mut()[0].as_chunks_mut::<PANEL_WIDTH>().0 {
        row[..width].iter_mut().for_each(|x| *x = random.signed_unit());
    }
    for _ in 0..TUNING.proof.search_solves {
        monitor.checkpoint()?;
        let mut products = vec![0.0; columns.panels()[0].len()];
        chladni_algebra::mass_times_panel(&level.mass, &columns.panels()[0], &mut products);
        factor.solve_panel(&mut products);
        columns.panels_mut()[0] = products;
        super::columns::normalise(&mut columns);
        iteration.project(&mut columns)?;
        if columns.columns() == 0 {
            return Ok(0);
        }
    }
    let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &columns, monitor)?;
    let (ritz_values, rotation) = ritz(stiffness, gram, columns.columns(), monitor)?;
    let top = values.last().copied().unwrap_or(f64::NEG_INFINITY).max(shift);
    let new = ritz_values.partition_point(|&value| value < top).max(1).min(ritz_values.len());
    rotate(&mut columns, &rotation.slice_columns(0..new), monitor)?;
    iteration.append(&columns, &ritz_values[..new])?;
    Ok(new)
}
