//! The lowest fields of a space of fields, as they are or corrected among all fields of the surface.

use std::ops::Range;

use chladni_base::Monitor;
use chladni_spectral::field::{EigenfieldGoal, FullSpace, LowestFields, RefineError};

use super::{DesignFault, Setting};

/// The most fields that are refined at once, those below the first included.
pub const MOST_REFINED: usize = 256;

/// Why there are no eigenfields.
#[derive(Debug, thiserror::Error)]
pub enum EigenfieldFault {
    /// There are not so many.
    #[error("fields {from}..{to} were requested, but the basis has {count}")]
    Range {
        /// The first.
        from: usize,
        /// One past the last.
        to: usize,
        /// How many the basis has.
        count: usize,
    },
    /// So many are not refined.
    #[error("fields up to {to} were requested; the lowest {MOST_REFINED} can be refined")]
    Refined {
        /// One past the last.
        to: usize,
        /// How many the basis has.
        count: usize,
    },
    /// The space, the tolerance or the surface does not fit, or the work was cancelled.
    #[error(transparent)]
    Design(#[from] DesignFault),
}

impl From<RefineError> for EigenfieldFault {
    fn from(error: RefineError) -> Self {
        Self::Design(error.into())
    }
}

/// Which of the lowest fields are wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Eigenfields {
    range: Range<usize>,
    count: usize,
}

/// One field.
#[derive(Debug, Clone, PartialEq)]
pub struct Eigenfield {
    /// As it is stored: the block of each face in its frame.
    pub field: Vec<f32>,
    /// Its eigenvalue on unit area.
    pub value: f64,
    /// About how far that lies above the exact one, where the field was corrected.
    pub above: Option<f64>,
}

impl Eigenfields {
    /// Fields `from..to`, counted from 0, of a space of `count` dimensions; without `to`, the one at `from`.
    ///
    /// # Errors
    /// [`EigenfieldFault::Range`].
    pub fn new(from: usize, to: Option<usize>, count: usize) -> Result<Self, EigenfieldFault> {
        let to = to.unwrap_or(from.saturating_add(1));
        match from < to && to <= count {
            true => Ok(Self { range: from..to, count }),
            false => Err(EigenfieldFault::Range { from, to, count }),
        }
    }

    /// How many fields.
    pub fn count(&self) -> usize {
        self.range.len()
    }

    /// Which they are, counted from 0.
    pub fn range(&self) -> Range<usize> {
        self.range.clone()
    }

    /// Checks that these can be refined to a tolerance.
    ///
    /// # Errors
    /// [`EigenfieldFault::Refined`], and a tolerance that is out of its range.
    pub fn check_refined(&self, tolerance: f64) -> Result<(), EigenfieldFault> {
        FullSpace::check_tolerance(tolerance)?;
        match self.range.end > MOST_REFINED {
            true => Err(EigenfieldFault::Refined { to: self.range.end, count: self.count }),
            false => Ok(()),
        }
    }

    /// How many fields are corrected together.
    pub fn block_size(&self) -> usize {
        LowestFields::block_size(self.range.end, self.count)
    }

    /// Gives each field to `take`, by ascending eigenvalue: as the space has it, or corrected among all fields of the
    /// surface to a tolerance.
    ///
    /// # Errors
    /// [`DesignFault::Refine`] where the tolerance is not reached; cancellation.
    pub fn each(
        &self,
        setting: &Setting,
        full: Option<(&FullSpace, f64)>,
        monitor: &dyn Monitor,
        mut take: impl FnMut(Eigenfield),
    ) -> Result<(), DesignFault> {
        let model = setting.model();
        let Some((full, tolerance)) = full else {
            for k in self.range.clone() {
                monitor.checkpoint()?;
                take(Eigenfield { field: setting.lift(&model.eigenfield(k))?, value: model.values()[k], above: None });
            }
            return Ok(());
        };
        let lifted = |k: usize| Ok(setting.lift(&model.eigenfield(k))?.into_iter().map(f64::from).collect());
        let start = (0..self.block_size()).map(lifted).collect::<Result<Vec<Vec<f64>>, DesignFault>>()?;
        let found = full.eigenfields(start, self.range.end, EigenfieldGoal::Tolerance(tolerance), monitor)?;
        if !found.reached {
            return Err(RefineError::NotConverged { tolerance }.into());
        }
        for own in found.fields.into_iter().take(self.range.end).skip(self.range.start) {
            let field = own.field.into_iter().map(|x| x as f32).collect();
            take(Eigenfield { field, value: own.value, above: Some(own.left) });
        }
        Ok(())
    }
}
