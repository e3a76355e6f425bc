//! What rounding leaves of a residual, whoever iterates: a tolerance below it is refused, before and after.

use chladni_algebra::{ColumnSums, PANEL_WIDTH, PanelMatrix, residual_magnitudes, residual_sums};

use super::HsimError;
use super::iterate::{Iteration, Plan};
use super::judge::{AS_GOOD_AS_ZERO, Units};

/// Residuals up to this times what rounding may leave are as small as they get: solves lose digits as well.
const ABOVE_FLOOR: f64 = 100.0;

/// The residual up to which a column of the start stands for an eigenvector here.
const SETTLED: f64 = 0.3;

/// Rounding errors may happen to be this much smaller than expected.
const BY_LUCK: f64 = 0.25;

impl Iteration<'_> {
    /// Refuses a tolerance that double precision does not allow, before anything is iterated: each number of a column
    /// is rounded when it is stored, which alone leaves a residual of about `u ‖(Σ_i S_ij²)^{1/2} x_j‖`. The lowest
    /// columns, of which the start holds good estimates, tell: with their values it is largest.
    ///
    /// # Errors
    /// [`HsimError::Floor`].
    pub fn refuse_below_floor(&self, wanted: usize, tolerance: f64) -> Result<(), HsimError> {
        let (level, count) = (self.level, wanted.min(self.values.len()).min(PANEL_WIDTH));
        let block = self.vectors.select(&(0..count).collect::<Vec<_>>());
        let sums = residual_sums(&level.stiffness, &level.mass, &block, &self.values[..count], self.monitor)?;
        let weight = |row: usize| level.stiffness.row(row).1.iter().map(|value| value * value).sum::<f64>();
        let mut stored = vec![0.0; count];
        if let Some(panel) = block.panels().first() {
            for (row, x) in panel.as_chunks::<PANEL_WIDTH>().0.iter().enumerate() {
                // The matrix is symmetric: its rows are its columns.
                let weight = weight(row);
                stored.iter_mut().zip(x).for_each(|(sum, x)| *sum += weight * x * x);
            }
        }
        let unit = 0.5 * f64::EPSILON;
        // Where something large was taken off, the tolerance is one of the whole, as in `require`.
        let of_the_whole = |k: usize| match self.whole(k) {
            whole if whole == self.values[k] => 1.0,
            whole => (self.values[k] / whole).abs(),
        };
        let least = |k: usize| unit * (stored[k] / sums[k].stiffness).sqrt() * of_the_whole(k);
        let doomed = (0..count).any(|k| {
            // Of a start that is no estimate, or a value that is as good as zero, nothing follows.
            self.values[k] != 0.0
                && self.residual_of(&sums[k]) < SETTLED
                && least(k) < SETTLED
                && tolerance < BY_LUCK * least(k)
        });
        if !doomed {
            return Ok(());
        }
        let floors = self.floors_of(&block, &self.values[..count], &sums, 0.0)?;
        let settled = floors.into_iter().enumerate().filter(|&(_, floor)| floor < AS_GOOD_AS_ZERO);
        let floor = settled.map(|(k, floor)| floor * of_the_whole(k)).fold(0.0, f64::max);
        if floor > tolerance { Err(HsimError::Floor { tolerance, floor }) } else { Ok(()) }
    }

    /// The value of a column with what was taken off, where that is on its side of zero, or farther from there; itself
    /// where there is none.
    fn whole(&self, column: usize) -> f64 {
        let value = self.values[column];
        if self.offset * value > 0.0 || self.offset < 0.0 { value + self.offset } else { value }
    }

    /// Whether the wanted pairs have converged.
    ///
    /// # Errors
    /// [`HsimError::NotConverged`] where they have not, [`HsimError::Floor`] where rounding does not let them.
    pub fn require(&self, plan: &Plan) -> Result<(), HsimError> {
        let failed = self.unconverged(plan);
        let floors = self.floors(&failed)?;
        let as_close_as_it_gets = |floor: f64, column: usize| self.residual(column) <= ABOVE_FLOOR * floor;
        // Of a value that is as good as zero no residual can be asked; and where something large was taken off, the
        // tolerance is one of the whole.
        let of_the_whole = |column: usize| {
            let [value, whole] = [self.values[column], self.whole(column)].map(f64::abs);
            self.offset != 0.0 && self.residual(column) * value <= plan.tolerance * whole
        };
        let passes = |floor: f64, column: usize| {
            as_close_as_it_gets(floor, column) && (floor >= AS_GOOD_AS_ZERO || of_the_whole(column))
        };
        let failed: Vec<(f64, usize)> =
            floors.into_iter().zip(failed).filter(|&(floor, column)| !passes(floor, column)).collect();
        if failed.is_empty() {
            return Ok(());
        }
        let (tolerance, iterations) = (plan.tolerance, self.passes);
        // Where rounding allows no less than what is left of a pair, no iteration helps.
        if failed.iter().any(|&(floor, column)| floor > tolerance && as_close_as_it_gets(floor, column)) {
            return Err(HsimError::Floor { tolerance, floor: failed.iter().map(|pair| pair.0).fold(0.0, f64::max) });
        }
        let worst = failed.iter().map(|pair| self.residual(pair.1)).fold(0.0, f64::max);
        Err(HsimError::NotConverged { count: failed.len(), tolerance, iterations, worst })
    }

    /// The residual (4.6) that rounding may leave to some columns.
    fn floors(&self, columns: &[usize]) -> Result<Vec<f64>, HsimError> {
        let values: Vec<f64> = columns.iter().map(|&column| self.values[column]).collect();
        let sums: Vec<ColumnSums> = columns.iter().map(|&column| self.sums[column]).collect();
        self.floors_of(&self.vectors.select(columns), &values, &sums, self.offset)
    }

    /// The same of a block with its values and what it sums up to, where an offset was taken off the matrix.
    fn floors_of(
        &self,
        block: &PanelMatrix,
        values: &[f64],
        sums: &[ColumnSums],
        offset: f64,
    ) -> Result<Vec<f64>, HsimError> {
        let level = self.level;
        let magnitudes = residual_magnitudes(&level.stiffness, &level.mass, block, values, offset, self.monitor)?;
        let unit = Units::new(level).row;
        Ok(magnitudes.iter().zip(sums).map(|(size, sums)| unit * (size.square / sums.stiffness).sqrt()).collect())
    }
}
