//! `y = A⁻¹ r` by a factor, where cycles leave too much.
//!
//! Where triangles differ in size by many orders of magnitude, what four cycles leave of `r − Ay` is divided by masses
//! next to nothing, and the bound says no more than that something is there. A factor of `A` closes it; the enclosure
//! holds for any `y`, so that nothing rests on the factor.

use chladni_base::parallel::*;

use super::super::error::ApproximationError;
use super::super::shifted::ShiftedPencil;
use super::rows::{Enclosed, Enclosure, Trees};
use super::{CLOSE, Energy, HALVES, KernelAndGoal, Measure, SHIFT, Workspace};
use chladni_algebra::{CYCLE_WIDTH, CycleRow, Factor, LIFT_WIDTH, PANEL_WIDTH, RowLifter};
use chladni_base::{Cancelled, Monitor, Share};

/// A panel with a bound above this share of its value is measured anew.
const WIDE: f64 = 0.1;
const _: () = assert!(WIDE > CLOSE, "what is close enough is never measured anew");

/// Problems of more unknowns stay as they are measured by cycles: a factor would take longer than everything else, and
/// more memory.
pub const MOST_FACTORED: usize = 250_000;

/// Matrices of more entries a row than this are of solids: a factor fills in as n^(4/3), and fewer rows are worth one.
const ENTRIES_OF_SURFACES: usize = 10;
const MOST_FACTORED_OF_SOLIDS: usize = 20_000;

/// Bytes of such a factor for each unknown. On surfaces of so many unknowns at most it takes 850; one that fills in
/// further, as triangles at random do, is not worth its memory, since memory for the whole was promised by the size of
/// the mesh.
pub const FACTOR_BYTES: u64 = 1_200;

const _: () = assert!(PANEL_WIDTH == LIFT_WIDTH, "a panel that is lifted is solved at once");

/// A factor of `S + (c + σ) M` whose rows are in another order than the patches.
pub(in crate::spectrum) struct Solver<'a> {
    factor: Factor<'a>,
    /// For each row of the factor its place among the patches.
    places: Vec<u32>,
    pub(super) sigma: f64,
}

impl Solver<'_> {
    /// `A⁻¹ r` of both halves of a panel, in the order of the patches.
    pub(super) fn solve(&self, right: &[Vec<CycleRow>; HALVES]) -> [Vec<[f64; CYCLE_WIDTH]>; HALVES] {
        let n = self.places.len();
        let mut solution = vec![0.0; n * PANEL_WIDTH];
        let (rows, _) = solution.as_chunks_mut::<PANEL_WIDTH>();
        for (row, &place) in rows.iter_mut().zip(&self.places) {
            let (halves, _) = row.as_chunks_mut::<CYCLE_WIDTH>();
            for (half, right) in halves.iter_mut().zip(right) {
                *half = right[place as usize].map(f64::from);
            }
        }
        self.factor.solve_panel(&mut solution);
        let (rows, _) = solution.as_chunks::<PANEL_WIDTH>();
        let mut y: [Vec<[f64; CYCLE_WIDTH]>; HALVES] = std::array::from_fn(|_| vec![[0.0; CYCLE_WIDTH]; n]);
        for (row, &place) in rows.iter().zip(&self.places) {
            let (halves, _) = row.as_chunks::<CYCLE_WIDTH>();
            y.iter_mut().zip(halves).for_each(|(y, half)| y[place as usize] = *half);
        }
        y
    }
}

impl Energy<'_> {
    /// Measures those panels anew, with the solution itself instead of cycles, where some bound is wide. Where there is
    /// no factor, nothing changes.
    pub(super) fn narrow(
        &self,
        lifter: &RowLifter<'_>,
        ritz: &[f64],
        measures: &mut [Measure],
        limits: KernelAndGoal,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let is_wide = |panel: usize| {
            let pairs = panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH);
            pairs.into_iter().any(|k| {
                let value = ritz[k] + self.floor;
                value > limits.kernel && measures[k].bound > WIDE * value
            })
        };
        let wide: Vec<usize> = (0..ritz.len().div_ceil(LIFT_WIDTH)).filter(|&panel| is_wide(panel)).collect();
        let Some(lowest) = ritz.iter().map(|theta| theta + self.floor).find(|&theta| theta > limits.kernel) else {
            return Ok(());
        };
        let of_solid = self.problem.stiffness.entries() > ENTRIES_OF_SURFACES * self.size();
        let most = if of_solid { MOST_FACTORED_OF_SOLIDS } else { MOST_FACTORED };
        if wide.is_empty() || self.size() > most {
            return Ok(());
        }
        let sigma = SHIFT * lowest;
        monitor.checkpoint()?;
        let share = Share { whole: monitor, bytes: FACTOR_BYTES * self.size() as u64 };
        let pencil = match ShiftedPencil::new(self.problem, &share) {
            Ok(pencil) => pencil,
            Err(ApproximationError::Cancelled(cancelled)) => return Err(cancelled),
            Err(_) => return Ok(()),
        };
        let Ok(solver) = self.solver(&pencil, sigma) else { return Ok(()) };
        let found: Vec<(usize, Vec<Measure>)> = wide
            .into_par_iter()
            .map(|panel| {
                monitor.checkpoint()?;
                Ok((panel, self.solved(&solver, lifter, panel, ritz)))
            })
            .collect::<Result<_, Cancelled>>()?;
        for (panel, found) in found {
            for (measure, found) in measures[panel * LIFT_WIDTH..].iter_mut().zip(found) {
                if found.bound < measure.bound {
                    *measure = found;
                }
            }
        }
        Ok(())
    }

    /// What solves with `A = S + (c + σ) M`.
    ///
    /// # Errors
    /// As [`ShiftedPencil::factor`].
    ///
    /// # Panics
    /// Where the pencil is of another problem.
    pub(in crate::spectrum) fn solver<'p>(
        &self,
        pencil: &'p ShiftedPencil,
        sigma: f64,
    ) -> Result<Solver<'p>, ApproximationError> {
        assert_eq!(pencil.order.len(), self.size(), "the pencil of the same problem");
        let factor = pencil.factor(-(sigma + self.floor))?;
        let mut place_of = vec![0u32; self.size()];
        self.order.iter().zip(0..).for_each(|(&row, place)| place_of[row as usize] = place);
        let places = pencil.order.iter().map(|&row| place_of[row as usize]).collect();
        Ok(Solver { factor, places, sigma })
    }

    /// The measures of a panel with `y` solved for.
    fn solved(&self, solver: &Solver<'_>, lifter: &RowLifter<'_>, panel: usize, ritz: &[f64]) -> Vec<Measure> {
        let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
        let mut workspace = Workspace::new(self.size(), &self.hierarchy);
        let residuals = self.residuals(lifter, panel, theta, &mut workspace);
        let y = solver.solve(&workspace.right);
        let mut measures = Vec::with_capacity(theta.len());
        for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
            let enclosed = self.enclose_all(&y[half], &workspace.right[half], solver.sigma);
            measures.extend(
                (0..theta.len())
                    .map(|k| self.conclude(&residuals[half].pairs[k], &enclosed.of(k), theta[k], solver.sigma)),
            );
        }
        measures
    }

    /// The terms of the enclosure for sixteen columns `y` in double precision.
    pub(super) fn enclose_all(&self, y: &[[f64; CYCLE_WIDTH]], right: &[CycleRow], sigma: f64) -> Enclosure {
        let mut enclosed = Enclosure::default();
        let (mut local, mut trees) = (Vec::new(), Trees::default());
        for patch in self.hierarchy.patches() {
            local.clear();
            local.extend(patch.vertices(1).iter().map(|&vertex| y[vertex as usize]));
            // A solution leaves next to nothing.
            let of = Enclosed { patch, right: &right[patch.rows()], sigma, forest: None };
            self.enclose(of, &local, &mut enclosed, &mut [], &mut trees);
        }
        enclosed
    }
}
