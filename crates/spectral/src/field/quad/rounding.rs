//! Whole numbers for some unknowns: one after the other the one that is nearest to a whole number, with all others following (Bommes, Zimmer and
//! Kobbelt 2009).
//!
//! How unknowns follow is known from the compliance `C = Eᵀ A⁻¹ E` of those that are to be whole, a dense matrix: fixing one is an update of rank
//! one, and not a solve.

use chladni_base::Monitor;

use super::super::poisson::Factor;
use super::QuadError;

/// Columns of one solve.
const AT_ONCE: usize = 32;

/// An unknown whose compliance falls below this share follows from those that are fixed.
const FOLLOWS: f64 = 1e-8;

/// What is nearer to a whole number than this is made that number, so that closures hold exactly.
const WHOLE: f64 = 1e-3;

/// Rounds unknowns of a solution, the `leading` ones of them before the others. How far the worst of them is from a whole number after it: a half
/// where whole numbers of the others force it.
///
/// # Errors
/// Cancellation.
pub(super) fn round(
    factor: &Factor,
    solution: &mut [f64],
    (unknowns, leading): (&[u32], usize),
    monitor: &dyn Monitor,
) -> Result<f64, QuadError> {
    let k = unknowns.len();
    // Row `j` is how all of them follow a pull at the `j`-th.
    let mut compliance: Vec<Vec<f64>> = Vec::with_capacity(k);
    for some in unknowns.chunks(AT_ONCE) {
        monitor.checkpoint()?;
        let mut columns: [Vec<f64>; AT_ONCE] = std::array::from_fn(|at| {
            let mut unit = vec![0.0; solution.len()];
            if let Some(&unknown) = some.get(at) {
                unit[unknown as usize] = 1.0;
            }
            unit
        });
        factor.solve(&mut columns);
        let own = columns.iter().take(some.len());
        compliance
            .extend(own.map(|column| unknowns.iter().map(|&unknown| column[unknown as usize]).collect::<Vec<f64>>()));
    }
    let first: Vec<f64> = (0..k).map(|j| compliance[j][j]).collect();
    let mut values: Vec<f64> = unknowns.iter().map(|&unknown| solution[unknown as usize]).collect();
    // Pulls that give the columns of the compliance as it is now, and those that are in force.
    let mut pulls: Vec<Vec<f64>> = (0..k).map(|j| (0..k).map(|i| f64::from(u8::from(i == j))).collect()).collect();
    let mut force = vec![0.0; k];
    let mut open: Vec<usize> = (0..k).collect();
    loop {
        monitor.checkpoint()?;
        open.retain(|&j| compliance[j][j] > FOLLOWS * first[j]);
        let distance = |j: usize| (values[j] - values[j].round()).abs();
        let rank = |j: usize| (j >= leading, distance(j));
        let before = |a: &usize, b: &usize| rank(*a).0.cmp(&rank(*b).0).then(rank(*a).1.total_cmp(&rank(*b).1));
        let Some(next) = open.iter().copied().min_by(before) else { break };
        let step = (values[next].round() - values[next]) / compliance[next][next];
        let (column, pull) = (compliance[next].clone(), pulls[next].clone());
        values.iter_mut().zip(&column).for_each(|(value, c)| *value += step * c);
        force.iter_mut().zip(&pull).for_each(|(force, p)| *force += step * p);
        for &j in &open {
            let share = column[j] / column[next];
            compliance[j].iter_mut().zip(&column).for_each(|(x, c)| *x -= share * c);
            pulls[j].iter_mut().zip(&pull).for_each(|(x, p)| *x -= share * p);
        }
        open.retain(|&j| j != next);
    }
    let mut columns = [vec![0.0; solution.len()]];
    unknowns.iter().zip(&force).for_each(|(&unknown, force)| columns[0][unknown as usize] += force);
    factor.solve(&mut columns);
    solution.iter_mut().zip(&columns[0]).for_each(|(x, step)| *x += step);
    let off = |x: f64| (x - x.round()).abs();
    let misfit = unknowns.iter().map(|&u| off(solution[u as usize])).fold(0.0, f64::max);
    unknowns.iter().map(|&u| u as usize).for_each(|u| {
        // Halves are as exact as whole numbers.
        let twice = 2.0 * solution[u];
        if off(twice) < WHOLE {
            solution[u] = twice.round() / 2.0;
        }
    });
    Ok(misfit)
}
