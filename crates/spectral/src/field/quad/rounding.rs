//! Whole numbers for some unknowns: one after the other the one that is nearest to a whole number, with all others
//! following (Bommes, Zimmer and Kobbelt 2009).
//!
//! Where one that is fixed decides others with it, these have to come out whole as well: of four edges of one length
//! the sum is whole for quarters of edges too. So of all that are decided together the one that moves least comes
//! first, and takes the nearest whole number that makes the others whole.
//!
//! How unknowns follow is known from the compliance `C = Eᵀ A⁻¹ E` of those that are to be whole, a dense matrix:
//! fixing one is an update of rank one, and not a solve.

use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;

use super::super::poisson::Factor;
use super::QuadError;

/// Columns of one solve.
const AT_ONCE: usize = 32;

/// An unknown whose compliance falls below this share follows from those that are fixed.
const FOLLOWS: f64 = 1e-8;

/// One whose compliance falls below this share follows but for the give of creases, which are stiff and not rigid: that
/// is not used up to make it whole.
const STIFF: f64 = 1e-5;

/// What follows is whole if it comes so near to a whole number.
const NEAR: f64 = 0.02;

/// Whole numbers that are tried for an unknown on each side of the nearest.
const TRIED: i32 = 12;

/// What is nearer to a whole number than this is made that number, so that closures hold exactly.
const WHOLE: f64 = 1e-3;

/// Rounds unknowns of a solution of a matrix, the `leading` ones of them before the others. How far the worst of them
/// is from a whole number after it: a half where whole numbers of the others force it. Groups of unknowns that have
/// nothing to do with each other (see [`apart`]) are rounded each by itself, and one solve tells how the unknowns of
/// all of them follow.
///
/// # Errors
/// Cancellation.
pub(super) fn round(
    factor: &Factor,
    solution: &mut [f64],
    (unknowns, leading): (&[u32], usize),
    groups: &[Vec<usize>],
    monitor: &dyn Monitor,
) -> Result<f64, QuadError> {
    let most = groups.iter().map(Vec::len).max().unwrap_or(0);
    // Of each group row `j` is how all of them follow a pull at the `j`-th.
    let mut compliances: Vec<Vec<Vec<f64>>> = vec![Vec::new(); groups.len()];
    for first in (0..most).step_by(AT_ONCE) {
        monitor.checkpoint()?;
        let mut columns: [Vec<f64>; AT_ONCE] = std::array::from_fn(|at| {
            let mut unit = vec![0.0; solution.len()];
            let pulled = groups.iter().filter_map(|group| group.get(first + at));
            pulled.for_each(|&k| unit[unknowns[k] as usize] = 1.0);
            unit
        });
        factor.solve(&mut columns);
        for (group, compliance) in groups.iter().zip(&mut compliances) {
            let own = columns.iter().take(group.len().saturating_sub(first));
            compliance.extend(own.map(|x| group.iter().map(|&k| x[unknowns[k] as usize]).collect::<Vec<f64>>()));
        }
    }
    let mut columns = [vec![0.0; solution.len()]];
    for (group, compliance) in groups.iter().zip(compliances) {
        let leading = group.partition_point(|&k| k < leading);
        let values = group.iter().map(|&k| solution[unknowns[k] as usize]).collect();
        let force = settled(compliance, values, leading, monitor)?;
        group.iter().zip(&force).for_each(|(&k, force)| columns[0][unknowns[k] as usize] += force);
    }
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

/// The unknowns by their positions in the list, ascending, in groups that nothing in the matrix connects: those of the
/// components of a surface.
pub(super) fn apart(matrix: &SparseMatrix, unknowns: &[u32]) -> Vec<Vec<usize>> {
    const NONE: u32 = u32::MAX;
    let mut part = vec![NONE; matrix.rows()];
    let (mut groups, mut open): (Vec<Vec<usize>>, Vec<u32>) = (Vec::new(), Vec::new());
    for (k, &unknown) in unknowns.iter().enumerate() {
        if part[unknown as usize] == NONE {
            let own = groups.len() as u32;
            groups.push(Vec::new());
            part[unknown as usize] = own;
            open.push(unknown);
            while let Some(row) = open.pop() {
                for &column in matrix.row(row as usize).0 {
                    if std::mem::replace(&mut part[column as usize], own) == NONE {
                        open.push(column);
                    }
                }
            }
        }
        groups[part[unknown as usize] as usize].push(k);
    }
    groups
}

/// The pulls that make values whole, the `leading` ones before the others.
fn settled(
    mut compliance: Vec<Vec<f64>>,
    mut values: Vec<f64>,
    leading: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, QuadError> {
    let k = values.len();
    let first: Vec<f64> = (0..k).map(|j| compliance[j][j]).collect();
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
        if compliance[next][next] <= STIFF * first[next] && distance(next) > NEAR {
            // Whole numbers of the others force it; nothing but a crease that gives way would make it whole.
            open.retain(|&j| j != next);
            continue;
        }
        let (next, whole) = decided(&compliance, &values, &first, &open, next);
        let step = (whole - values[next]) / compliance[next][next];
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
    Ok(force)
}

/// Which of the unknowns that are decided together with `next` is fixed, and the whole number that it takes.
fn decided(compliance: &[Vec<f64>], values: &[f64], first: &[f64], open: &[usize], next: usize) -> (usize, f64) {
    let left = |j: usize| compliance[j][j] - compliance[next][j].powi(2) / compliance[next][next];
    let together = |&j: &usize| compliance[j][j] > STIFF * first[j] && left(j) <= STIFF * first[j];
    let mut others: Vec<usize> = open.iter().copied().filter(|&j| j != next).filter(together).collect();
    let share = |j: usize| (compliance[next][j] / compliance[next][next]).abs();
    // Those that move alike are as good as each other.
    let least =
        others.iter().copied().min_by(|&a, &b| share(a).total_cmp(&share(b))).filter(|&j| share(j) < 1.0 - NEAR);
    let chosen = least.unwrap_or(next);
    if chosen != next {
        others.retain(|&j| j != chosen);
        others.push(next);
    }
    let (value, own) = (values[chosen], compliance[chosen][chosen]);
    let nearest = value.round();
    let follows = |&whole: &f64| {
        let place = |j: usize| values[j] + (whole - value) * compliance[chosen][j] / own;
        others.iter().all(|&j| (place(j) - place(j).round()).abs() < NEAR)
    };
    let mut tried: Vec<f64> = (-TRIED..=TRIED).map(|step| nearest + f64::from(step)).collect();
    tried.sort_by(|a, b| (a - value).abs().total_cmp(&(b - value).abs()));
    (chosen, tried.into_iter().find(follows).unwrap_or(nearest))
}
