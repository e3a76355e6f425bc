//! What is left of residuals when vectors are stored in single precision.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix, residual_sums};
use chladni_base::Monitor;

use super::{Pairs, Pencil, PencilError};
use crate::spectrum::hsim::{HsimError, plus_mass};

/// The residuals of vectors that are rounded to single precision, relative to `‖(S + cM) x‖`; those of a kernel remain
/// what they are in double precision.
pub(super) fn residuals(pairs: &Pairs, pencil: &Pencil, monitor: &dyn Monitor) -> Result<Vec<f64>, PencilError> {
    let (unit, entry) = pencil.factors;
    let problem = &pencil.problem;
    let moved = pairs.moved / unit;
    let shifted = (moved != 0.0).then(|| plus_mass(&problem.stiffness, &problem.mass, moved));
    let stiffness = shifted.as_ref().unwrap_or(&problem.stiffness);
    let values: Vec<f64> = pairs.values.iter().map(|value| value / unit + moved).collect();
    let mut residuals = pairs.certificate.residuals.clone();
    for start in (0..values.len()).step_by(PANEL_WIDTH) {
        let width = PANEL_WIDTH.min(values.len() - start);
        let mut block = PanelMatrix::zeros(problem.size(), width);
        if let Some(panel) = block.panels_mut().first_mut() {
            for column in 0..width {
                let from = pairs.vectors.column(start + column);
                for (row, to) in panel.iter_mut().skip(column).step_by(PANEL_WIDTH).enumerate() {
                    let row = pencil.places.as_ref().map_or(row, |places| places[row] as usize);
                    *to = f64::from(from[row] as f32) / entry;
                }
            }
        }
        let values = &values[start..start + width];
        let sums = residual_sums(stiffness, &problem.mass, &block, values, monitor).map_err(HsimError::from)?;
        for ((residual, sums), &value) in residuals[start..].iter_mut().zip(&sums).zip(values) {
            if value != 0.0 && sums.residual > 0.0 && sums.stiffness > 0.0 {
                *residual = (sums.residual / sums.stiffness).sqrt();
            }
        }
    }
    Ok(residuals)
}
