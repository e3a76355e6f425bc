//! Equations with `S − λM` on what is orthogonal to the eigenfunctions of a basis.

use chladni_algebra::{
    DenseMatrix, Factor, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, Weight, inner_products, mass_times_panel,
    residual_panel, subtract_combinations,
};
use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::error::AnalysisError;

/// Eigenvalues that differ by less than this share of them are taken for one.
pub(super) const COINCIDE: f64 = 1e-6;

/// By how much the residual has to fall, in the norm of the preconditioner.
const FALL: f64 = 1e-11;

/// Steps after which a solution that is still not there is given up.
const MOST_STEPS: usize = 500;

type Row = [f64; PANEL_WIDTH];

/// A problem, and its lowest eigenfunctions `X`, orthonormal for the mass.
pub(super) struct Complement<'a> {
    pub stiffness: &'a SparseMatrix,
    pub mass: &'a MassMatrix,
    /// Of `S + σM`.
    pub factor: &'a Factor<'a>,
    pub functions: &'a PanelMatrix,
}

/// The sums of the columns of a panel.
fn dots(a: &[f64], b: &[f64]) -> Row {
    let mut sums = [0.0; PANEL_WIDTH];
    for (a, b) in a.as_chunks::<PANEL_WIDTH>().0.iter().zip(b.as_chunks::<PANEL_WIDTH>().0) {
        for k in 0..PANEL_WIDTH {
            sums[k] += a[k] * b[k];
        }
    }
    sums
}

/// `y ← s y + t x`, each column with its own factors.
fn combine(y: &mut [f64], s: &Row, t: &Row, x: &[f64]) {
    for (y, x) in y.as_chunks_mut::<PANEL_WIDTH>().0.iter_mut().zip(x.as_chunks::<PANEL_WIDTH>().0) {
        for k in 0..PANEL_WIDTH {
            y[k] = s[k] * y[k] + t[k] * x[k];
        }
    }
}

/// The state of one panel of conjugate gradients.
struct Panel {
    index: usize,
    values: Row,
    solution: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    /// `rᵀ B r` now, and in the beginning.
    size: Row,
    first: Row,
}

impl Panel {
    fn is_open(&self, k: usize) -> bool {
        self.size[k] > FALL * FALL * self.first[k]
    }
}

impl Complement<'_> {
    /// `g ← g − M X (Xᵀ g)`; `products` are `Xᵀ g`.
    pub fn project_dual(
        &self,
        derivatives: &mut PanelMatrix,
        products: &DenseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<(), AnalysisError> {
        let mut held = PanelMatrix::zeros(derivatives.rows(), derivatives.columns());
        subtract_combinations(&mut held, self.functions, products, monitor)?;
        for (panel, held) in derivatives.panels_mut().iter_mut().zip(held.panels()) {
            let mut image = vec![0.0; held.len()];
            mass_times_panel(self.mass, held, &mut image);
            panel.iter_mut().zip(&image).for_each(|(g, image)| *g += image);
        }
        Ok(())
    }

    /// `z ← z − X (Xᵀ M z)`.
    fn project(&self, functions: &mut PanelMatrix, monitor: &dyn Monitor) -> Result<(), AnalysisError> {
        let products = inner_products(self.functions, Weight::Mass(self.mass), functions, monitor)?;
        Ok(subtract_combinations(functions, self.functions, &products, monitor)?)
    }

    /// `z_k` with `(S − λ_k M) z_k = r_k`, both orthogonal to `X`, for the eigenvalues `λ_k` of the first columns of
    /// `X`.
    pub fn solve(
        &self,
        right: &PanelMatrix,
        values: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<PanelMatrix, AnalysisError> {
        let columns = right.columns();
        let mut preconditioned = right.clone();
        preconditioned.panels_mut().par_iter_mut().for_each(|panel| self.factor.solve_panel(panel));
        self.project(&mut preconditioned, monitor)?;
        let begin = |(index, right): (usize, &Vec<f64>)| {
            let mut own = [0.0; PANEL_WIDTH];
            own.iter_mut().zip(values.iter().skip(index * PANEL_WIDTH)).for_each(|(own, value)| *own = *value);
            let size = dots(right, &preconditioned.panels()[index]);
            let direction = preconditioned.panels()[index].clone();
            let nothing = || vec![0.0; right.len()];
            let (solution, image, residual) = (nothing(), nothing(), right.clone());
            Panel { index, values: own, solution, residual, direction, image, size, first: size }
        };
        let mut panels: Vec<Panel> = right.panels().iter().enumerate().map(begin).collect();
        let open = |panels: &[Panel]| {
            let mut all = panels.iter().flat_map(|panel| (0..PANEL_WIDTH).map(move |k| (panel, k)));
            all.find(|(panel, k)| panel.is_open(*k)).map(|(panel, k)| panel.index * PANEL_WIDTH + k)
        };
        for step in 0.. {
            let Some(index) = open(&panels) else { break };
            if step == MOST_STEPS {
                return Err(AnalysisError::Unsolved { index, steps: step });
            }
            panels.par_iter_mut().zip(preconditioned.panels_mut()).try_for_each(|(panel, preconditioned)| {
                monitor.checkpoint()?;
                self.step(panel, preconditioned)
            })?;
            self.project(&mut preconditioned, monitor)?;
            panels.par_iter_mut().zip(preconditioned.panels()).for_each(|(panel, preconditioned)| {
                let size = dots(&panel.residual, preconditioned);
                let turned: Row = std::array::from_fn(|k| if panel.is_open(k) { size[k] / panel.size[k] } else { 0.0 });
                panel.size = std::array::from_fn(|k| if panel.is_open(k) { size[k] } else { panel.size[k] });
                combine(&mut panel.direction, &turned, &[1.0; PANEL_WIDTH], preconditioned);
            });
        }
        let mut solutions = PanelMatrix::zeros(right.rows(), columns);
        for ((panel, right), solution) in panels.into_iter().zip(right.panels()).zip(solutions.panels_mut()) {
            self.check(&panel, right)?;
            *solution = panel.solution;
        }
        Ok(solutions)
    }

    /// One step along the directions; `preconditioned` becomes what the preconditioner makes of the residual.
    fn step(&self, panel: &mut Panel, preconditioned: &mut [f64]) -> Result<(), AnalysisError> {
        residual_panel(self.stiffness, self.mass, &panel.direction, &panel.values, &mut panel.image);
        let curvature = dots(&panel.direction, &panel.image);
        let mut length = [0.0; PANEL_WIDTH];
        for k in (0..PANEL_WIDTH).filter(|&k| panel.is_open(k)) {
            // What is left of the spectrum begins above: else something of it was left out.
            if !(curvature[k] > 0.0) {
                return Err(AnalysisError::Cut { index: panel.index * PANEL_WIDTH + k });
            }
            length[k] = panel.size[k] / curvature[k];
        }
        combine(&mut panel.solution, &[1.0; PANEL_WIDTH], &length, &panel.direction);
        combine(&mut panel.residual, &[1.0; PANEL_WIDTH], &length.map(|length| -length), &panel.image);
        preconditioned.copy_from_slice(&panel.residual);
        self.factor.solve_panel(preconditioned);
        Ok(())
    }

    /// A solution that is all but an eigenfunction of the same value belongs to a cluster that the basis cuts.
    fn check(&self, panel: &Panel, right: &[f64]) -> Result<(), AnalysisError> {
        let mut image = vec![0.0; panel.solution.len()];
        mass_times_panel(self.mass, &panel.solution, &mut image);
        let (forms, masses) = (dots(&panel.solution, right), dots(&panel.solution, &image));
        let cut =
            (0..PANEL_WIDTH).find(|&k| masses[k] > 0.0 && forms[k] < COINCIDE * panel.values[k].abs() * masses[k]);
        match cut {
            Some(k) => Err(AnalysisError::Cut { index: panel.index * PANEL_WIDTH + k }),
            None => Ok(()),
        }
    }
}
