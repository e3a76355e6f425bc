//! Lifting: rows of `U φ̄`, without ever forming all of it.

use super::{DenseMatrix, SparseMatrix, vectorized};

/// Columns that are lifted at once: as many accumulators as keep the units of a core busy and still fit its registers.
pub const LIFT_WIDTH: usize = 32;

/// Lifts rows of `U φ̄` for a sparse `U`, `n × d`, and a dense `φ̄`, `d × m`.
pub struct RowLifter<'a> {
    space: &'a SparseMatrix<f32>,
    /// `φ̄` in panels of [`LIFT_WIDTH`] columns, each row after row; the last is padded with zeros. Whole rows one
    /// after the other would lie a multiple of 4 KiB apart where `m` is near one of 512, and evict each other from the
    /// cache.
    panels: Vec<Vec<[f64; LIFT_WIDTH]>>,
}

impl<'a> RowLifter<'a> {
    /// Keeps a copy of `coefficients` in the order that lifting reads it in.
    ///
    /// # Panics
    /// Unless it has as many rows as `space` columns.
    pub fn new(space: &'a SparseMatrix<f32>, coefficients: &DenseMatrix) -> Self {
        assert_eq!(coefficients.rows(), space.columns(), "rows of the coefficients, columns of the space");
        let mut panels = Vec::new();
        for from in (0..coefficients.columns()).step_by(LIFT_WIDTH) {
            let mut panel = vec![[0.0; LIFT_WIDTH]; coefficients.rows()];
            for column in from..coefficients.columns().min(from + LIFT_WIDTH) {
                let values = coefficients.column(column);
                panel.iter_mut().zip(values).for_each(|(row, &value)| row[column - from] = value);
            }
            panels.push(panel);
        }
        Self { space, panels }
    }

    /// Entries of the columns of panel `p`, `32 p..32 (p + 1)`, in the given rows; zeros for columns that there are
    /// not.
    pub fn lift(&self, rows: &[u32], panel: usize, out: &mut [[f64; LIFT_WIDTH]]) {
        let panel = self.panels.get(panel).map_or(&[][..], |panel| &panel[..]);
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (&row, out) in rows.iter().zip(out) {
                    let (columns, values) = self.space.row(row as usize);
                    let mut acc = [0.0; LIFT_WIDTH];
                    for (&column, &value) in columns.iter().zip(values) {
                        let value = f64::from(value);
                        if let Some(x) = panel.get(column as usize) {
                            for k in 0..LIFT_WIDTH {
                                acc[k] += value * x[k];
                            }
                        }
                    }
                    *out = acc;
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lifted_rows_are_those_of_the_product() {
        let space = SparseMatrix::new(3, 2, vec![0, 1, 1, 3], vec![1, 0, 1], vec![0.5f32, 2.0, -1.0]).unwrap();
        let values: Vec<f64> = (0..80).map(|k| (f64::from(k) * 0.7).sin()).collect();
        let dense = DenseMatrix::from_columns(2, 40, values);
        let lifter = RowLifter::new(&space, &dense);
        let mut out = vec![[9.0; LIFT_WIDTH]; 3];
        for panel in [0, 1] {
            lifter.lift(&[2, 0, 1], panel, &mut out);
            let from = panel * LIFT_WIDTH;
            for k in 0..LIFT_WIDTH {
                let column = if from + k < 40 { dense.column(from + k) } else { &[0.0, 0.0] };
                assert_eq!([out[0][k], out[1][k], out[2][k]], [2.0 * column[0] - column[1], 0.5 * column[1], 0.0]);
            }
        }
        let mut none = [[1.0; LIFT_WIDTH]; 1];
        RowLifter::new(&space, &DenseMatrix::zeros(2, 0)).lift(&[2], 0, &mut none);
        assert_eq!(none[0], [0.0; LIFT_WIDTH]);
    }
}
