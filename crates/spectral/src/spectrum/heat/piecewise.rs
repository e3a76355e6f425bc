//! Columns that have diffused on a coarse level, and come back to the mesh a piece at a time.
//!
//! All columns of a surface of millions of vertices are more than all else. The last step back to the mesh smooths
//! blocks of vertices by themselves, so that whoever needs some rows has them made, and gets those that he would have
//! of all, to the last bit.

use super::coarsen::Coarsening;
use super::level::HeatLevel;
use super::polish::{self, Smoother, Thinning};
use super::shrink;
use chladni_algebra::SparseMatrix;
use chladni_base::{Cancelled, Monitor};

/// What columns are made of.
pub(in crate::spectrum) struct Diffused {
    way: Way,
    /// The number of columns.
    d: usize,
    /// The largest entry of each column before it diffused, and its vertex.
    peaks: Vec<u32>,
    heights: Vec<f32>,
}

/// What is left to do.
enum Way {
    /// Nothing: the mesh is as coarse as the level that columns diffuse on.
    Done(SparseMatrix<f32>),
    /// The last step back.
    Step(Box<Step>),
}

struct Step {
    fine: HeatLevel,
    coarsening: Coarsening,
    /// Columns on the coarse level.
    columns: SparseMatrix<f32>,
    smoother: Smoother,
    thinning: Thinning,
    /// Groups of vertices that are smoothed by themselves, and the factor of each row.
    blocks: Vec<Vec<u32>>,
    scales: Vec<f32>,
}

impl Diffused {
    /// Columns that need nothing more.
    pub(super) fn done(columns: SparseMatrix<f32>) -> Self {
        Self { d: columns.columns(), way: Way::Done(columns), peaks: Vec::new(), heights: Vec::new() }
    }

    /// Columns on the coarse level of `coarsening`, and the peaks that they had.
    pub(super) fn on_level(
        (mut fine, mut coarsening): (HeatLevel, Coarsening),
        columns: SparseMatrix<f32>,
        smoother: Smoother,
        thinning: Thinning,
        (peaks, heights): (Vec<u32>, Vec<f32>),
    ) -> Self {
        let (blocks, scales) = polish::prepared(&fine, &coarsening, &smoother);
        // What the step itself does not ask for: of millions of vertices it is a sixth of all.
        (fine.lengths, fine.mass) = (Vec::new(), Vec::new());
        coarsening.forget_all_but_corners();
        let d = columns.columns();
        let step = Step { fine, coarsening, columns, smoother, thinning, blocks, scales };
        Self { way: Way::Step(Box::new(step)), d, peaks, heights }
    }

    /// The number of columns.
    pub(in crate::spectrum) fn columns(&self) -> usize {
        self.d
    }

    /// All rows.
    pub(in crate::spectrum) fn all(self, monitor: &dyn Monitor) -> Result<SparseMatrix<f32>, Cancelled> {
        let Self { way, d, peaks, heights } = self;
        match way {
            Way::Done(columns) => Ok(columns),
            Way::Step(step) => {
                let mut rows = step.rows(None, monitor)?;
                drop(step);
                shrink::refill_from(&mut rows, d, |column| (heights[column], peaks[column] as usize));
                Ok(rows)
            }
        }
    }

    /// The rows that are wanted; the others are empty. Columns in `bare` have their peaks put back, as those have that
    /// are left with nothing in all rows.
    pub(in crate::spectrum) fn rows(
        &self,
        wanted: &[bool],
        bare: &[u32],
        monitor: &dyn Monitor,
    ) -> Result<SparseMatrix<f32>, Cancelled> {
        let mut rows = match &self.way {
            Way::Done(columns) => {
                let own: Vec<u32> = (0..wanted.len() as u32).filter(|&row| wanted[row as usize]).collect();
                return Ok(crate::operator::spread_rows(columns.select_rows(&own), &own, wanted.len()));
            }
            Way::Step(step) => step.rows(Some(wanted), monitor)?,
        };
        let peaks = bare
            .iter()
            .map(|&column| (column as usize, (self.heights[column as usize], self.peaks[column as usize] as usize)));
        let here: Vec<_> = peaks.filter(|(_, (_, row))| wanted[*row]).collect();
        if !here.is_empty() {
            shrink::refill(&mut rows, self.d, here);
        }
        Ok(rows)
    }
}

impl Step {
    fn rows(&self, wanted: Option<&[bool]>, monitor: &dyn Monitor) -> Result<SparseMatrix<f32>, Cancelled> {
        let of = (&self.fine, &self.coarsening, &self.columns);
        polish::rows(of, (&self.blocks, &self.scales), wanted, (&self.smoother, &self.thinning), monitor)
    }
}
