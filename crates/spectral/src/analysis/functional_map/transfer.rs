//! Functions that a map carries from the source to the target.

use chladni_algebra::DenseMatrix;

use super::FunctionalMap;
use crate::analysis::error::{self, AnalysisError};
use crate::basis::{Basis, BasisError};

/// How functions are carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transfer {
    /// Each vertex of the target gets the value of the vertex that it is matched with: nothing is smoothed, and no
    /// value appears that was not there. For colours, labels and texture coordinates.
    #[default]
    Points,
    /// By `C`, coefficient by coefficient: smooth, and limited to what the modes hold.
    Modes,
}

impl FunctionalMap {
    /// Carries functions on the source, `n_source × c`, to the target, `n_target × c`.
    ///
    /// `C` is a map at unit area, where a function has the coefficients `ΦᵀM f / √A`: in those of the bases as they are
    /// stored it is `√(A_target / A_source) C`.
    ///
    /// # Errors
    /// [`AnalysisError::Basis`] unless there is a row for each vertex of the source; [`AnalysisError::Count`] where not
    /// every vertex of the target was matched and points are to carry.
    pub fn transfer(
        &self,
        source: &Basis,
        target: &Basis,
        functions: &DenseMatrix,
        how: Transfer,
    ) -> Result<DenseMatrix, AnalysisError> {
        let expected = source.vertices();
        if functions.rows() != expected {
            return Err(BasisError::Rows { found: functions.rows(), expected }.into());
        }
        match how {
            Transfer::Points => self.by_points(target, functions),
            Transfer::Modes => self.by_modes(source, target, functions),
        }
    }

    fn by_points(&self, target: &Basis, functions: &DenseMatrix) -> Result<DenseMatrix, AnalysisError> {
        let n = target.vertices();
        error::count("matched points", self.to_source.points.len(), n, n)?;
        let mut carried = DenseMatrix::zeros(n, functions.columns());
        for column in 0..functions.columns() {
            let values = functions.column(column);
            let slots = carried.column_mut(column).iter_mut().zip(&self.to_source.points);
            slots.for_each(|(slot, &point)| *slot = values[point as usize]);
        }
        Ok(carried)
    }

    fn by_modes(&self, source: &Basis, target: &Basis, functions: &DenseMatrix) -> Result<DenseMatrix, AnalysisError> {
        let area = |basis: &Basis| basis.mass.lumped().iter().sum::<f64>();
        let factor = (area(target) / area(source)).sqrt();
        let known = source.project(functions)?;
        let k = self.matrix.columns();
        let mut carried = DenseMatrix::zeros(target.count(), functions.columns());
        for column in 0..functions.columns() {
            let slots = &mut carried.column_mut(column)[..k];
            for (mode, &value) in known.column(column)[..k].iter().enumerate() {
                slots
                    .iter_mut()
                    .zip(self.matrix.column(mode))
                    .for_each(|(slot, entry)| *slot += factor * value * entry);
            }
        }
        Ok(target.evaluate(&carried)?)
    }
}
