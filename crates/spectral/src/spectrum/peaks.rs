//! Where the columns of a space are largest.

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;

/// The row of a column without an entry above zero.
pub(super) const NO_PEAK: u32 = u32::MAX;

/// Rows that one task looks through.
const ROWS: usize = 1 << 16;

/// The largest entry of every column, the first of equals.
pub(super) struct Peaks {
    /// The row that it is in; [`NO_PEAK`] where none is above zero.
    pub rows: Vec<u32>,
    /// The entry; zero where there is none.
    pub heights: Vec<f32>,
}

impl Peaks {
    /// Those of a space.
    pub fn of(space: &SparseMatrix<f32>) -> Self {
        let (n, d) = (space.rows(), space.columns());
        let none = || Self { rows: vec![NO_PEAK; d], heights: vec![0f32; d] };
        let part = |task: usize| {
            let mut peaks = none();
            for row in task * ROWS..n.min((task + 1) * ROWS) {
                let (columns, values) = space.row(row);
                columns
                    .iter()
                    .zip(values)
                    .for_each(|(&column, &value)| peaks.raise(column as usize, row as u32, value));
            }
            peaks
        };
        let parts: Vec<Self> = (0..n.div_ceil(ROWS)).into_par_iter().map(part).collect();
        let mut peaks = none();
        for part in parts {
            (0..d).for_each(|column| peaks.raise(column, part.rows[column], part.heights[column]));
        }
        peaks
    }

    fn raise(&mut self, column: usize, row: u32, height: f32) {
        if height > self.heights[column] {
            (self.heights[column], self.rows[column]) = (height, row);
        }
    }
}
