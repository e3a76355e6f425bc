//! How far the lowest approximate eigenfields of a basis are off.

use std::ops::Range;

use chladni_base::Monitor;
use chladni_spectral::basis::{FieldBasis, FieldCertificate};
use chladni_spectral::field::{
    DesignError, DesignModel, EigenfieldGoal, FieldSurface, FullSpace, LowestFields, USUAL_ROOM,
};
use chladni_spectral::operator::hodge::FieldBoundary;

use crate::JobError;

/// The most eigenfields that are judged.
pub const MOST: usize = 256;

/// Those of a job that does not say how many.
const USUAL: usize = 8;

/// Bytes that these may take: on large surfaces they are fewer.
const USUAL_BYTES: u64 = 240 << 20;

/// Surfaces of up to so many faces are judged by factors, larger ones by cycles, which take less memory than a job
/// promises.
const FACTORED: usize = 100_000;

/// So many fields without energy are judged beside the others.
const FEW_IDLE: usize = 32;

/// How many eigenfields are judged, of so many numbers each, besides those without energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Judging {
    wanted: usize,
    together: usize,
    numbers: usize,
}

impl Judging {
    /// For what a job says, on so many faces of `block` numbers, in a space of a dimension.
    pub fn new(said: Option<usize>, block: usize, faces: usize, dimension: usize) -> Self {
        let numbers = block * faces;
        let of = |wanted: usize| Self { wanted, together: LowestFields::block_size(wanted, dimension), numbers };
        let usual = || (1..=USUAL).rev().find(|&wanted| of(wanted).bytes() <= USUAL_BYTES).unwrap_or(1);
        match said.unwrap_or_else(usual).min(dimension) {
            0 => Self { wanted: 0, together: 0, numbers },
            wanted => of(wanted),
        }
    }

    /// About the bytes that they take, with some fields without energy.
    pub fn bytes(self) -> u64 {
        LowestFields::bytes(self.together, self.numbers) + if self.wanted > 0 { 128 * self.numbers as u64 } else { 0 }
    }
}

/// What is known of the lowest eigenfields of a basis; `None` where none are to be judged.
///
/// # Errors
/// [`JobError`]: an eigenproblem of a few rows that is not solved, cancellation.
pub fn judged(
    surface: &FieldSurface,
    basis: &FieldBasis,
    model: &DesignModel,
    boundary: FieldBoundary,
    judging: Judging,
    monitor: &dyn Monitor,
) -> Result<Option<FieldCertificate>, JobError> {
    if judging.wanted == 0 {
        return Ok(None);
    }
    let room = if surface.faces() <= FACTORED { USUAL_ROOM } else { 0 };
    let full = FullSpace::within(surface, basis.kind, boundary, room, monitor)?;
    monitor.stage("errors");
    let idle = LowestFields::idle(model.values());
    let [wanted, together] = [judging.wanted, judging.together].map(|own| (idle + own).min(model.dimension()));
    let lifted = |range: Range<usize>| -> Result<Vec<Vec<f64>>, DesignError> {
        let one = |k: usize| Ok(basis.space.lift(&model.eigenfield(k))?.into_iter().map(f64::from).collect());
        range.map(one).collect()
    };
    let goal = EigenfieldGoal::Estimate;
    if idle > FEW_IDLE && full.count_idle(monitor)? == Some(idle) {
        // Surfaces of many components have that many. Their own are found by component, and what the values of the
        // basis lie above is zero.
        let above = full.eigenfields_above_idle(lifted(idle..together)?, wanted - idle, goal, monitor)?;
        return Ok(Some(above.certificate_above(model.values(), idle, basis.area)));
    }
    let found = full.eigenfields(lifted(0..together)?, wanted, goal, monitor)?;
    Ok(Some(found.certificate(model.values(), basis.area)))
}
