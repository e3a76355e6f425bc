//! How far a count is uncertain where a few stiff rows make it seem so.
//!
//! The rounding errors `E` of a factor have `|xᵀE x| ≤ Σ_i ρ_i m_i x_i²`, and by the largest `ρ_i` no eigenvalue moves
//! farther than that. On a needle, a triangle of next to no width, stiffness over mass may be a million times that of
//! other rows, and its errors with it. But no vector that matters is large there: with `H = S + μM`, which is positive
//! definite, `x_i² ≤ (H⁻¹)_ii xᵀH x`. For a set of stiff rows, and `ρ` the most of all others,
//!
//! `|xᵀE x| ≤ ρ xᵀM x + κ xᵀH x`, `κ = Σ_stiff ρ_i m_i (H⁻¹)_ii`,
//!
//! so that an eigenvalue at the shift `μ` of the one pencil is within `(ρ + 2 μ κ) / (1 − κ)` of `μ` in the other. The
//! diagonal of the inverse takes one more factor, at `−μ`, and a solve for each stiff row. That factor has errors as
//! well; they are bounded by themselves in the same way.

use chladni_algebra::{FactorError, PANEL_WIDTH, SymbolicFactor};
use chladni_base::Monitor;

use super::HsimError;
use super::level::Level;

/// Rows are stiff whose errors alone make eigenvalues uncertain by more than this share of what would do.
const STIFF: f64 = 0.125;

/// The most stiff rows: solves for so many take about as long as a factor.
const MOST: usize = 8 * PANEL_WIDTH;

/// The most that the errors of the factor at `−μ` may be, relative to `H`; and the most that those of stiff rows may.
const SMALL: f64 = 0.125;

/// How many times the diagonal of the inverse is taken, for the errors of its factor and of the solves.
const SAFETY: f64 = 2.0;

/// What is known of a count that is not certain enough.
pub(super) struct Uncertain<'a> {
    /// Above zero.
    pub shift: f64,
    /// Of each row, over its lumped mass.
    pub errors: &'a [f64],
    /// How far the next eigenvalue lies.
    pub reach: f64,
}

impl Uncertain<'_> {
    /// The radius of the count at the shift, and storage that is given back; nothing where errors do not stem from a
    /// few rows. No eigenvalue of the level may lie below zero.
    pub fn radius(
        &self,
        level: &Level,
        symbolic: &SymbolicFactor,
        storage: Vec<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(Option<f64>, Vec<f64>), HsimError> {
        let (n, lumped, ratio) = (level.size(), level.mass.lumped(), level.mass.lumped_ratio());
        let is_stiff = |row: usize| !(ratio * self.errors[row] <= STIFF * self.reach);
        let stiff: Vec<usize> = (0..n).filter(|&row| is_stiff(row)).take(MOST + 1).collect();
        let finite = stiff.iter().all(|&row| self.errors[row].is_finite());
        if stiff.is_empty() || stiff.len() > MOST || !finite || !(self.shift > 0.0) {
            return Ok((None, storage));
        }
        monitor.checkpoint()?;
        let factor = match symbolic.factor_watched(&level.stiffness, &level.mass, -self.shift, storage, monitor) {
            Err(FactorError::Singular { .. }) => return Ok((None, Vec::new())),
            factor => factor?,
        };
        let definite = factor.eigenvalues_below() == 0;
        let own = factor.row_errors(&level.stiffness, &level.mass, -self.shift);
        let (mut sum, mut own_sum) = (0.0, 0.0);
        for rows in stiff.chunks(PANEL_WIDTH).take_while(|_| definite) {
            monitor.checkpoint()?;
            let mut panel = vec![0.0; n * PANEL_WIDTH];
            rows.iter().enumerate().for_each(|(column, &row)| panel[row * PANEL_WIDTH + column] = 1.0);
            factor.solve_panel(&mut panel);
            for (column, &row) in rows.iter().enumerate() {
                let inverse = lumped[row] * panel[row * PANEL_WIDTH + column];
                sum += SAFETY * inverse * self.errors[row];
                own_sum += inverse * own[row];
            }
        }
        let most = |errors: &[f64]| {
            let others = errors.iter().enumerate().filter(|(row, _)| stiff.binary_search(row).is_err());
            ratio * others.map(|(_, error)| *error).fold(0.0, f64::max)
        };
        let small = sum <= SMALL && own_sum <= SMALL && most(&own) <= SMALL * self.shift;
        let radius = (definite && small).then(|| (most(self.errors) + 2.0 * self.shift * sum) / (1.0 - sum));
        Ok((radius, factor.into_storage()))
    }
}

#[cfg(test)]
mod tests {
    use chladni_algebra::{CpuSolver, MassMatrix, SparseMatrix, SymmetricDefiniteSolver};
    use chladni_base::Unwatched;

    use super::super::dense_pairs::dense;
    use super::super::judge::Count;
    use super::super::level::NO_KERNEL;
    use super::*;

    /// Springs of stiffness 1 between masses of 1 in a row; `stiff` ones begin at masses of 1e-6.
    fn springs(n: usize, stiff: &[usize], stiffness: f64) -> Level {
        let spring = |k: usize| if stiff.contains(&k) { stiffness } else { 1.0 };
        let mut rows: Vec<(Vec<u32>, Vec<f64>)> = Vec::new();
        for row in 0..n {
            let (left, right) =
                (if row > 0 { spring(row - 1) } else { 0.0 }, if row + 1 < n { spring(row) } else { 0.0 });
            let entries = [(row.wrapping_sub(1), -left), (row, left + right), (row + 1, -right)];
            rows.push(entries.into_iter().filter(|entry| entry.0 < n).map(|(at, value)| (at as u32, value)).unzip());
        }
        let mut offsets = vec![0];
        rows.iter().for_each(|row| offsets.push(offsets[offsets.len() - 1] + row.0.len()));
        let (indices, values) = rows.into_iter().fold((Vec::new(), Vec::new()), |(mut i, mut v), row| {
            i.extend(row.0);
            v.extend(row.1);
            (i, v)
        });
        let masses = (0..n).map(|row| if stiff.contains(&row) { 1e-6 } else { 1.0 }).collect();
        Level {
            stiffness: SparseMatrix::from_sorted_parts(n, n, offsets, indices, values),
            mass: MassMatrix::Diagonal(masses),
            positions: vec![[0.0; 3]; n],
            component: vec![NO_KERNEL; n],
        }
    }

    fn judged(level: &Level, shift: f64, reach: f64) -> (Count, Option<f64>) {
        let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass).unwrap();
        let factor = symbolic.pivoted_factor(&level.stiffness, &level.mass, shift, Vec::new()).unwrap();
        let (count, errors) =
            (Count::of(level, shift, &factor), factor.row_errors(&level.stiffness, &level.mass, shift));
        let uncertain = Uncertain { shift, errors: &errors, reach };
        let (radius, _) = uncertain.radius(level, &symbolic, factor.into_storage(), &Unwatched).unwrap();
        (count, radius)
    }

    #[test]
    fn stiff_springs_make_a_count_no_more_uncertain_than_the_others_do() {
        let n = 120;
        let stiff = [40, 41, 80];
        // As good as rigid: the springs with their ends are one mass each.
        let (level, softer) = (springs(n, &stiff, 1e9), springs(n, &stiff, 1e4));
        let (stiffness, mass) = dense(&softer);
        let values = CpuSolver.lowest(stiffness, mass, 30, &Unwatched).unwrap().values;
        let (below, above) = (values[19], values[20]);
        let (shift, reach) = (0.5 * (below + above), 0.5 * (above - below));
        let (count, radius) = judged(&level, shift, reach);
        assert_eq!(count.below, 20);
        assert!(count.radius > reach, "{count:?}, {reach}");
        let radius = radius.unwrap();
        assert!(radius < 1e-2 * reach && radius > 0.0, "{radius:e}, {reach:e}");
        // Without stiff springs, or with too many of them, there is nothing to tell apart.
        assert_eq!(judged(&softer, shift, reach).1, None);
        let all: Vec<usize> = (0..700).collect();
        assert_eq!(judged(&springs(700, &all, 1e9), 0.1, 1e-6).1, None);
    }

    #[test]
    fn what_is_bounded_holds_against_errors_of_the_size_that_is_allowed_for() {
        let n = 60;
        let stiff = [20, 21];
        let level = springs(n, &stiff, 1e7);
        let (stiffness, mass) = dense(&level);
        let values = CpuSolver.lowest(stiffness.clone(), mass.clone(), 30, &Unwatched).unwrap().values;
        let shift = 0.5 * (values[9] + values[10]);
        // Errors as large as a thousandth of the mass in most rows, and as a hundred times the mass in stiff ones.
        let lumped = level.mass.lumped();
        let is_stiff = |row: usize| (20..=22).contains(&row);
        let errors: Vec<f64> = (0..n).map(|row| if is_stiff(row) { 100.0 } else { 1e-3 }).collect();
        let symbolic = SymbolicFactor::new(&level.stiffness, &level.mass).unwrap();
        let uncertain = Uncertain { shift, errors: &errors, reach: 1.0 };
        let radius = uncertain.radius(&level, &symbolic, Vec::new(), &Unwatched).unwrap().0;
        // A hundred times a mass of 1 that moves freely is no small error: nothing is said.
        assert_eq!(radius, None);
        let errors: Vec<f64> = (0..n).map(|row| if is_stiff(row) { 0.03 } else { 1e-3 }).collect();
        let uncertain = Uncertain { shift, errors: &errors, reach: 0.2 };
        let radius = uncertain.radius(&level, &symbolic, Vec::new(), &Unwatched).unwrap().0.unwrap();
        for sign in [-1.0, 1.0] {
            let mut moved = stiffness.clone();
            (0..n).for_each(|row| moved.column_mut(row)[row] += sign * errors[row] * lumped[row]);
            let moved = CpuSolver.lowest(moved, mass.clone(), 30, &Unwatched).unwrap().values;
            for k in [9, 10] {
                assert!((moved[k] - values[k]).abs() <= radius, "{k}: {} {} {radius}", moved[k], values[k]);
            }
        }
    }
}
