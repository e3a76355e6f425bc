//! Lengths of columns, and how far they are from orthonormal.

use chladni_algebra::{
    DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, Weight, inner_products, mass_times_panel, subtract_combinations,
};
use chladni_base::Monitor;
use chladni_base::SplitMix64;
use chladni_base::parallel::*;

use super::HsimError;

/// An estimate of `‖XᵀMX − I‖` in the Frobenius norm, from the images of random vectors.
pub(super) fn defect(vectors: &PanelMatrix, mass: &MassMatrix, monitor: &dyn Monitor) -> Result<f64, HsimError> {
    let q = vectors.columns();
    let mut random = SplitMix64::new(0x5eed);
    let mut weights = DenseMatrix::zeros(q, PROBES);
    weights.values_mut().iter_mut().for_each(|w| *w = random.signed_unit() * 3f64.sqrt());
    let mut images = PanelMatrix::zeros(vectors.rows(), PROBES);
    subtract_combinations(&mut images, vectors, &weights, monitor)?;
    let back = inner_products(vectors, Weight::Mass(mass), &images, monitor)?;
    let square: f64 = back.values().iter().zip(weights.values()).map(|(b, w)| (b + w).powi(2)).sum();
    Ok((square / PROBES as f64).sqrt())
}

/// `‖x‖_M` of every column.
pub(super) fn lengths(mass: &MassMatrix, columns: &PanelMatrix) -> Vec<f64> {
    let panels = columns.panels().par_iter().map(|panel| {
        let mut products = vec![0.0; panel.len()];
        mass_times_panel(mass, panel, &mut products);
        let mut sums = [0f64; PANEL_WIDTH];
        for (x, mx) in panel.as_chunks::<PANEL_WIDTH>().0.iter().zip(products.as_chunks::<PANEL_WIDTH>().0) {
            for k in 0..PANEL_WIDTH {
                sums[k] += x[k] * mx[k];
            }
        }
        sums.map(|sum| sum.max(0.0).sqrt())
    });
    let mut lengths: Vec<f64> = panels.collect::<Vec<_>>().into_iter().flatten().collect();
    lengths.truncate(columns.columns());
    lengths
}

/// Random vectors for an estimate.
const PROBES: usize = 8;

/// Brings every column to a largest entry of about one.
pub(super) fn normalise(columns: &mut PanelMatrix) {
    columns.panels_mut().par_iter_mut().for_each(|panel| {
        let mut largest = [0f64; PANEL_WIDTH];
        for row in panel.as_chunks::<PANEL_WIDTH>().0 {
            for k in 0..PANEL_WIDTH {
                largest[k] = largest[k].max(row[k].abs());
            }
        }
        let scales = largest.map(|most| if most > 0.0 { most.recip() } else { 0.0 });
        for row in panel.as_chunks_mut::<PANEL_WIDTH>().0 {
            for k in 0..PANEL_WIDTH {
                row[k] *= scales[k];
            }
        }
    });
}
