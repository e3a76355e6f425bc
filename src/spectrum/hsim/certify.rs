//! Proof that nothing is missing: eigenvalues counted by inertia, and the search for what a count says is not there.

use super::HsimError;
use super::iterate::{Iteration, Plan, factor_near};
use crate::algebra::{PANEL_WIDTH, PanelMatrix, Weight, inner_products, restrict, rotate, subtract_combinations};
use crate::mesh::random::SplitMix64;

use super::ritz::ritz;

/// Searches for missing pairs that may find none before the others are given up.
const VAIN_ROUNDS: u64 = 4;

/// Which pairs have to be there.
#[derive(Debug, Clone, Copy)]
pub(super) enum Goal {
    /// The lowest so many beside the kernel; more are computed where the last lies in a cluster.
    Count(usize),
    /// All below a bound, which are so many with the kernel.
    Below(f64, usize),
}

/// Iterates until the goal is reached and proven; gives the shift below which all pairs were counted and their number beside the kernel.
pub(super) fn complete(
    iteration: &mut Iteration<'_>,
    goal: Goal,
    plan: &Plan,
    seed: u64,
) -> Result<(f64, usize), HsimError> {
    let mut plan = *plan;
    let (mut round, mut vain, mut least) = (0, 0, usize::MAX);
    loop {
        converge(iteration, &plan)?;
        let order = iteration.order();
        let values: Vec<f64> = order.iter().map(|&column| iteration.values[column]).collect();
        let kernel = iteration.kernel.dimension();
        let size = iteration.level.size() - kernel;
        let (shift, found) = match goal {
            Goal::Below(bound, _) => (bound, values.partition_point(|&value| value < bound)),
            Goal::Count(count) => gap_above(&values, count, size),
        };
        if found > plan.wanted && found <= values.len() {
            // The last wanted pair belongs to a cluster: what is counted with it has to converge with it.
            plan.wanted = found;
            if !iteration.unconverged(&plan).is_empty() {
                continue;
            }
        }
        iteration.monitor.stage("certify");
        iteration.monitor.checkpoint()?;
        let below = match goal {
            Goal::Below(bound, counted) => counted - kernel.min(counted) * usize::from(bound > 0.0),
            Goal::Count(_) if found == size => size,
            Goal::Count(_) => {
                let storage = iteration.storage();
                let below = factor_near(iteration.level, iteration.symbolic, shift, storage)?.eigenvalues_below();
                iteration.inertia.push((shift, below));
                // Negative eigenvalues lie below the kernel.
                below.saturating_sub(if shift > 0.0 { kernel } else { 0 })
            }
        };
        if below == found {
            return Ok((shift, found));
        }
        let missing = below.abs_diff(found);
        vain += u64::from(missing >= least);
        least = least.min(missing);
        if below < found || vain == VAIN_ROUNDS {
            return Err(HsimError::Incomplete { missing, shift });
        }
        iteration.monitor.stage("repair");
        search(iteration, shift, seed.wrapping_add(round))?;
        if matches!(goal, Goal::Below(..)) {
            plan.wanted = below;
        }
        plan.most_passes += iteration.passes;
        round += 1;
    }
}

fn converge(iteration: &mut Iteration<'_>, plan: &Plan) -> Result<(), HsimError> {
    // First everything to a loose tolerance, which finds what the start did not contain; then the wanted one.
    if plan.tolerance < LOOSE {
        iteration.run(&Plan { tolerance: LOOSE, solves: 1, ..*plan })?;
    }
    iteration.run(plan)?;
    iteration.take_quotients()?;
    iteration.run(plan)?;
    iteration.require(plan)
}

/// A tolerance at which everything is found before the wanted one is approached.
const LOOSE: f64 = 1e-2;

/// A shift in the widest gap shortly above the lowest `count` values, nearer to its lower end since values that are still being iterated on are
/// too large; and how many values lie below it.
fn gap_above(values: &[f64], count: usize, size: usize) -> (f64, usize) {
    let last = values.len();
    if last >= size || last < 2 {
        // All pairs there are.
        let most = values.last().copied().unwrap_or(0.0);
        return (most + 0.01 * most.abs() + 1.0, last);
    }
    // Guards are less exact the higher they are.
    let reach = last.saturating_sub(count).div_ceil(2).max(1);
    let relative = |at: usize| (values[at] - values[at - 1]) / (1.0 + values[at - 1].abs());
    let places = count..(count + reach).min(last);
    let wide = 0.2 / count.max(20) as f64;
    let first_wide = places.clone().find(|&at| relative(at) > wide);
    let at = first_wide.or_else(|| places.max_by(|&a, &b| relative(a).total_cmp(&relative(b))));
    let at = at.unwrap_or(last - 1).max(1);
    if relative(at) < NO_GAP {
        // All of them belong to one cluster, which a count above it tells the size of.
        let most = values[last - 1];
        return (most + ABOVE * (1.0 + most.abs()), last);
    }
    (values[at - 1] + 0.4 * (values[at] - values[at - 1]), at)
}

/// A relative gap that rounding could have made.
const NO_GAP: f64 = 1e-7;

/// How far above a cluster its members are counted, relative to it.
const ABOVE: f64 = 1e-3;

/// Looks for eigenvectors below `shift` that the columns do not contain, starting from random vectors where counts and values first disagree.
fn search(iteration: &mut Iteration<'_>, shift: f64, seed: u64) -> Result<(), HsimError> {
    let (level, monitor) = (iteration.level, iteration.monitor);
    let mut counts: Vec<(f64, usize)> = iteration.inertia.iter().copied().filter(|count| count.0 <= shift).collect();
    counts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut values = iteration.values.clone();
    values.sort_by(f64::total_cmp);
    let kernel = iteration.kernel.dimension();
    let found = |at: f64| values.partition_point(|&value| value < at);
    let deficient = counts.iter().position(|&(at, below)| below > found(at) + if at > 0.0 { kernel } else { 0 });
    let high = deficient.map_or(shift, |k| counts[k].0);
    let low = deficient.and_then(|k| counts[..k].last()).map_or(values[0], |count| count.0);
    // The widest gap inside the interval, but not its ends, where a search has already been.
    let middle = 0.5 * (low + high);
    let gap = values[found(low)..found(high)].windows(2).max_by(|a, b| {
        let inside =
            |pair: &[f64]| (pair[1] - pair[0]) / (1.0 + (0.5 * (pair[0] + pair[1]) - middle).abs() / (high - low));
        inside(a).total_cmp(&inside(b))
    });
    let at = gap.map_or(middle, |pair| pair[0] + 0.382 * (pair[1] - pair[0]));
    let storage = iteration.storage();
    let factor = factor_near(level, iteration.symbolic, at, storage)?;
    iteration.inertia.push((at, factor.eigenvalues_below()));
    let mut random = SplitMix64::new(seed ^ 0x6d15_5126);
    let mut columns =
        PanelMatrix::zeros(level.size(), PANEL_WIDTH.min(level.size() - iteration.values.len().min(level.size() - 1)));
    let width = columns.columns();
    for row in columns.panels_mut()[0].as_chunks_mut::<PANEL_WIDTH>().0 {
        row[..width].iter_mut().for_each(|x| *x = random.signed_unit());
    }
    for _ in 0..SEARCH_SOLVES {
        monitor.checkpoint()?;
        let mut products = vec![0.0; columns.panels()[0].len()];
        crate::algebra::mass_times_panel(&level.mass, &columns.panels()[0], &mut products);
        factor.solve_panel(&mut products);
        iteration.kernel.remove_from_panel(&mut products);
        columns.panels_mut()[0] = products;
        super::iterate::normalise(&mut columns);
        for _ in 0..2 {
            let products = inner_products(&iteration.vectors, Weight::Mass(&level.mass), &columns, monitor)?;
            subtract_combinations(&mut columns, &iteration.vectors, &products, monitor)?;
        }
    }
    let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &columns, monitor)?;
    let (ritz_values, rotation) = ritz(stiffness, gram, width, monitor)?;
    let top = values.last().copied().unwrap_or(0.0).max(shift);
    let new = ritz_values.partition_point(|&value| value < top).max(1).min(ritz_values.len());
    rotate(&mut columns, &rotation.slice_columns(0..new), monitor)?;
    iteration.append(&columns, &ritz_values[..new])
}

/// Solves with random vectors before a Rayleigh–Ritz.
const SEARCH_SOLVES: usize = 3;
