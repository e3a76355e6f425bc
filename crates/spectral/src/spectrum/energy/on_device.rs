//! The same measures from a graphics card, where that is faster: it sums up, what follows from the sums is decided
//! here.

use super::rows::PairResidual;
use super::{Density, Energy, KernelAndGoal, MOST_STEPS, Measure};
use chladni_algebra::gpu::{
    Accelerator, EnclosureSums, Judge, MeasuredPairs, MeasuredPencil, MeasuredTrees, PairSums, ResidualSums,
};
use chladni_algebra::{CYCLE_WIDTH, DenseMatrix, SparseMatrix};
use chladni_base::{Cancelled, Monitor, made_once};

/// Decides how closely the pairs are to be enclosed.
struct Closeness<'a> {
    energy: &'a Energy<'a>,
    ritz: &'a [f64],
    sigmas: &'a [f64],
    limits: KernelAndGoal,
}

impl Closeness<'_> {
    /// What is known of the pair `at`.
    fn measure_of(&self, at: usize, residual: &ResidualSums, enclosure: &EnclosureSums) -> Measure {
        let residual = PairResidual::new(residual, self.ritz[at]);
        self.energy.measure_of(&residual, enclosure, self.ritz[at], self.sigmas[at])
    }
}

impl Judge for Closeness<'_> {
    fn is_close(&self, first: usize, residuals: &[ResidualSums], enclosures: &[EnclosureSums]) -> bool {
        residuals.iter().zip(enclosures).zip(first..).all(|((residual, enclosure), at)| {
            let residual = PairResidual::new(residual, self.ritz[at]);
            self.energy.is_close(&residual, enclosure, self.ritz[at], self.sigmas[at])
        })
    }

    fn weights(&self, first: usize, residuals: &[ResidualSums], enclosures: &[EnclosureSums]) -> Option<Vec<f64>> {
        let weight = |((residual, enclosure), at)| {
            self.energy.weight(&self.measure_of(at, residual, enclosure), self.ritz[at], self.limits)
        };
        let weights: Vec<f64> = residuals.iter().zip(enclosures).zip(first..).map(weight).collect();
        weights.iter().any(|&weight| weight > 0.0).then_some(weights)
    }

    fn most_cycles(&self) -> usize {
        MOST_STEPS
    }
}

impl Energy<'_> {
    /// What [`measure`](Self::measure) says, but for pairs whose bounds want a factor; nothing where the CPU is to do
    /// it. The rows of `space` are in the order of the patches.
    pub(in crate::spectrum) fn measure_on_device(
        &self,
        accelerator: &Accelerator,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        ritz: &[f64],
        limits: KernelAndGoal,
        monitor: &dyn Monitor,
    ) -> Result<Option<(Vec<Measure>, Density)>, Cancelled> {
        if !accelerator.would_measure(space.rows(), space.entries(), ritz.len()) {
            return Ok(None);
        }
        let stiffness = made_once(&self.ordered, || self.problem.stiffness.reordered(&self.order));
        let patches = self.hierarchy.patches();
        let starts: Vec<u32> =
            patches.iter().map(|patch| patch.rows().start as u32).chain([self.size() as u32]).collect();
        let trees = self.forest.as_ref().map(|forest| MeasuredTrees { nodes: forest.nodes(), patches: &starts });
        let pencil = MeasuredPencil {
            stiffness,
            mass: &self.mass,
            lumped: &self.lumped,
            rounding: &self.rounding,
            floor: self.floor,
            hierarchy: &self.hierarchy,
            trees,
        };
        let shifted = |ritz: &[f64]| std::iter::repeat_n(self.sigma(ritz, limits), ritz.len());
        let sigmas: Vec<f64> = ritz.chunks(CYCLE_WIDTH).flat_map(shifted).collect();
        let pairs = MeasuredPairs { space, coefficients, values: ritz, sigmas: &sigmas };
        let judge = Closeness { energy: self, ritz, sigmas: &sigmas, limits };
        let Some(PairSums { residuals, enclosures, density }) =
            accelerator.measure(&pencil, &pairs, &judge, monitor)?
        else {
            return Ok(None);
        };
        let sums = residuals.iter().zip(&enclosures).enumerate();
        let measures = sums.map(|(at, (residual, enclosure))| judge.measure_of(at, residual, enclosure)).collect();
        let on_rows = |density: Vec<f64>| {
            let mut rows = vec![0.0; density.len()];
            self.order.iter().zip(density).for_each(|(&row, value)| rows[row as usize] = value);
            rows
        };
        Ok(Some((measures, density.map(on_rows))))
    }
}
