//! `y = A⁻¹ r` by a factor, where cycles leave too much.
//!
//! Where triangles differ in size by many orders of magnitude, what four cycles leave of `r − Ay` is divided by masses next to nothing, and the bound says
//! no more than that something is there. A factor of `A` closes it; the enclosure holds for any `y`, so that nothing rests on the factor.

use rayon::prelude::*;

use super::super::approximate::ApproximationError;
use super::super::shifted::ShiftedPencil;
use super::rows::Enclosure;
use super::{CLOSE, Energy, HALVES, Measure, SHIFT, Wanted, Workspace};
use chladni_algebra::{CYCLE_WIDTH, Factor, LIFT_WIDTH, PANEL_WIDTH, RowLifter};
use chladni_base::{Cancelled, Monitor};

/// A panel with a bound above this share of its value is measured anew.
const WIDE: f64 = 0.1;
const _: () = assert!(WIDE > CLOSE, "what is close enough is never measured anew");

/// Problems of more unknowns stay as they are measured by cycles: a factor would take longer than everything else, and more memory.
pub const MOST_FACTORED: usize = 250_000;

const _: () = assert!(PANEL_WIDTH == LIFT_WIDTH, "a panel that is lifted is solved at once");

/// A factor of `S + (c + σ) M` whose rows are in another order than the patches.
struct Solver<'a> {
    factor: Factor<'a>,
    /// For each row of the factor its place among the patches.
    places: Vec<u32>,
    sigma: f64,
}

impl Energy<'_> {
    /// Measures those panels anew, with the solution itself instead of cycles, where some bound is wide. Where there is no factor, nothing changes.
    pub(super) fn narrow(
        &self,
        lifter: &RowLifter<'_>,
        ritz: &[f64],
        measures: &mut [Measure],
        wanted: Wanted,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let is_wide = |panel: usize| {
            let pairs = panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH);
            pairs.into_iter().any(|k| {
                let value = ritz[k] + self.floor;
                value > wanted.kernel && measures[k].bound > WIDE * value
            })
        };
        let wide: Vec<usize> = (0..ritz.len().div_ceil(LIFT_WIDTH)).filter(|&panel| is_wide(panel)).collect();
        let Some(lowest) = ritz.iter().map(|theta| theta + self.floor).find(|&theta| theta > wanted.kernel) else {
            return Ok(());
        };
        if wide.is_empty() || self.size() > MOST_FACTORED {
            return Ok(());
        }
        let sigma = SHIFT * lowest;
        monitor.checkpoint()?;
        let pencil = match ShiftedPencil::new(self.problem, monitor) {
            Ok(pencil) => pencil,
            Err(ApproximationError::Cancelled(cancelled)) => return Err(cancelled),
            Err(_) => return Ok(()),
        };
        let Ok(factor) = pencil.factor(-(sigma + self.floor)) else { return Ok(()) };
        let mut place_of = vec![0u32; pencil.order.len()];
        self.order.iter().zip(0..).for_each(|(&row, place)| place_of[row as usize] = place);
        let places = pencil.order.iter().map(|&row| place_of[row as usize]).collect();
        let solver = Solver { factor, places, sigma };
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

    /// The measures of a panel with `y` solved for.
    fn solved(&self, solver: &Solver<'_>, lifter: &RowLifter<'_>, panel: usize, ritz: &[f64]) -> Vec<Measure> {
        let n = self.size();
        let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
        let mut workspace = Workspace::new(n, &self.hierarchy);
        let residuals = self.residuals(lifter, panel, theta, &mut workspace);
        let mut solution = vec![0.0; n * PANEL_WIDTH];
        let (rows, _) = solution.as_chunks_mut::<PANEL_WIDTH>();
        for (row, &place) in rows.iter_mut().zip(&solver.places) {
            let (halves, _) = row.as_chunks_mut::<CYCLE_WIDTH>();
            for (half, right) in halves.iter_mut().zip(&workspace.right) {
                *half = right[place as usize].map(f64::from);
            }
        }
        solver.factor.solve_panel(&mut solution);
        let (rows, _) = solution.as_chunks::<PANEL_WIDTH>();
        let mut y: [Vec<[f64; CYCLE_WIDTH]>; HALVES] = std::array::from_fn(|_| vec![[0.0; CYCLE_WIDTH]; n]);
        for (row, &place) in rows.iter().zip(&solver.places) {
            let (halves, _) = row.as_chunks::<CYCLE_WIDTH>();
            y.iter_mut().zip(halves).for_each(|(y, half)| y[place as usize] = *half);
        }
        let mut measures = Vec::with_capacity(theta.len());
        let mut local = Vec::new();
        for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
            let mut enclosed = Enclosure::default();
            for patch in self.hierarchy.patches() {
                local.clear();
                local.extend(patch.vertices(1).iter().map(|&vertex| y[half][vertex as usize]));
                let right = &workspace.right[half][patch.rows()];
                self.enclose(patch, &local, right, solver.sigma, &mut enclosed, &mut []);
            }
            measures.extend(
                (0..theta.len()).map(|k| self.conclude(&residuals[half], &enclosed, k, theta[k], solver.sigma)),
            );
        }
        measures
    }
}
