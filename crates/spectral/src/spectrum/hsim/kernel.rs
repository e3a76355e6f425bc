//! The kernel of an operator whose rows sum to zero: the functions that are constant on each component. It is known
//! exactly, so it takes no part in the iteration, where its values would be rounding errors.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix, residual_sums};
use chladni_base::parallel::*;

use super::HsimError;
use super::columns::lengths;
use super::iterate::Iteration;
use super::level::{Level, NO_KERNEL};

/// A function whose value is above this share of the highest one is no function of the kernel.
const AS_GOOD_AS_KERNEL: f64 = 1e-9;

/// The components on which the operator has constants in its kernel.
#[derive(Debug, Clone)]
pub(super) struct Kernel<'a> {
    component: &'a [u32],
    /// Row sums of the mass.
    weights: Vec<f64>,
    /// The mass of each component.
    masses: Vec<f64>,
}

impl<'a> Kernel<'a> {
    pub fn new(level: &'a Level) -> Self {
        let weights = level.mass.lumped();
        let mut masses: Vec<f64> = Vec::new();
        for (&component, weight) in level.component.iter().zip(&weights) {
            if component != NO_KERNEL {
                let component = component as usize;
                if component >= masses.len() {
                    masses.resize(component + 1, 0.0);
                }
                masses[component] += weight;
            }
        }
        Self { component: &level.component, weights, masses }
    }

    /// The dimension of the kernel.
    pub fn dimension(&self) -> usize {
        self.masses.len()
    }

    /// Makes columns `M`-orthogonal to the kernel.
    pub fn remove(&self, columns: &mut PanelMatrix) {
        if self.masses.is_empty() {
            return;
        }
        columns.panels_mut().par_iter_mut().for_each(|panel| self.remove_from_panel(panel));
    }

    /// The same for one panel of 32 columns.
    pub fn remove_from_panel(&self, panel: &mut [f64]) {
        self.remove_from_rows(panel.as_chunks_mut::<PANEL_WIDTH>().0);
    }

    /// The same for rows of any number of columns.
    pub fn remove_from_rows<const W: usize>(&self, rows: &mut [[f64; W]]) {
        if self.masses.is_empty() {
            return;
        }
        let mut means = vec![[0.0; W]; self.masses.len()];
        for ((row, &component), &weight) in rows.iter().zip(self.component).zip(&self.weights) {
            if let Some(mean) = means.get_mut(component as usize) {
                for k in 0..W {
                    mean[k] += weight * row[k];
                }
            }
        }
        for (mean, mass) in means.iter_mut().zip(&self.masses) {
            mean.iter_mut().for_each(|mean| *mean /= mass);
        }
        for (row, &component) in rows.iter_mut().zip(self.component) {
            if let Some(mean) = means.get(component as usize) {
                for k in 0..W {
                    row[k] -= mean[k];
                }
            }
        }
    }

    /// The first `count` functions of an orthonormal basis of the kernel: one for each component.
    pub fn basis(&self, count: usize) -> PanelMatrix {
        let mut basis = PanelMatrix::zeros(self.component.len(), count);
        for (k, panel) in basis.panels_mut().iter_mut().enumerate() {
            let rows = panel.as_chunks_mut::<PANEL_WIDTH>().0;
            for (row, &component) in rows.iter_mut().zip(self.component) {
                let component = component as usize;
                if component < count && component / PANEL_WIDTH == k {
                    row[component % PANEL_WIDTH] = self.masses[component].sqrt().recip();
                }
            }
        }
        basis
    }
}

/// The kernel beside the columns of an iteration, which does without it.
impl Iteration<'_> {
    /// How many of the values below a shift are those of the kernel.
    pub fn kernel_below(&self, shift: f64) -> usize {
        if shift > 0.0 { self.kernel.dimension() } else { 0 }
    }

    /// Which columns are not for the most part functions of the kernel, which rounding makes of directions of which
    /// next to nothing is left. Those have values next to zero beside the highest one, `top`.
    pub fn not_of_the_kernel(&self, columns: &PanelMatrix, values: &[f64], top: f64) -> Vec<usize> {
        let mut clear: Vec<usize> = (0..values.len()).collect();
        let suspects: Vec<usize> =
            clear.iter().copied().filter(|&k| values[k].abs() <= AS_GOOD_AS_KERNEL * top.abs()).collect();
        if suspects.is_empty() || self.kernel.dimension() == 0 {
            return clear;
        }
        let mut rest = columns.select(&suspects);
        let before = lengths(&self.level.mass, &rest);
        self.kernel.remove(&mut rest);
        let after = lengths(&self.level.mass, &rest);
        clear
            .retain(|k| suspects.iter().position(|suspect| suspect == k).is_none_or(|at| after[at] > 0.5 * before[at]));
        clear
    }

    /// Takes off the columns what rounding left of the kernel in them.
    pub fn remove_kernel(&mut self) {
        self.kernel.remove(&mut self.vectors);
    }

    /// Puts the kernel, or `known` functions of it, among the columns, which ascend by value; gives where. Negative
    /// eigenvalues, which a potential can have, come before it.
    pub fn insert_kernel(&mut self, known: usize) -> Result<std::ops::Range<usize>, HsimError> {
        let negative = self.values.partition_point(|&value| value < 0.0);
        if known > 0 {
            let basis = self.kernel.basis(known);
            let zeros = vec![0.0; known];
            let sums = residual_sums(&self.level.stiffness, &self.level.mass, &basis, &zeros, self.monitor)?;
            self.vectors.insert(negative, &basis);
            self.values.splice(negative..negative, zeros);
            self.sums.splice(negative..negative, sums);
        }
        Ok(negative..negative + known)
    }
}
