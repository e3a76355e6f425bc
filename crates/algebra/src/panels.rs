//! Dense matrices with many rows, kept as panels of 32 columns: what block eigensolvers work on.

use chladni_base::parallel::*;

use super::DenseMatrix;

/// Columns of one panel: a row of it is four cache lines, and four rows of accumulators fill the registers of a core.
pub const PANEL_WIDTH: usize = 32;

/// Rows that one task moves.
const ROWS_AT_ONCE: usize = 256;

/// One row of a panel.
pub(super) type PanelRow = [f64; PANEL_WIDTH];

/// A dense `rows × columns` matrix of f64 in panels of [`PANEL_WIDTH`] columns, each stored row after row. Unused
/// columns of the last panel are zero.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PanelMatrix {
    rows: usize,
    columns: usize,
    panels: Vec<Vec<f64>>,
}

impl PanelMatrix {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        let panels = (0..columns.div_ceil(PANEL_WIDTH)).map(|_| vec![0.0; rows * PANEL_WIDTH]).collect();
        Self { rows, columns, panels }
    }

    /// A dense matrix in panels.
    pub fn from_dense(matrix: &DenseMatrix) -> Self {
        let mut panels = Self::zeros(matrix.rows(), matrix.columns());
        for column in 0..matrix.columns() {
            let panel = &mut panels.panels[column / PANEL_WIDTH];
            let entries = panel.iter_mut().skip(column % PANEL_WIDTH).step_by(PANEL_WIDTH);
            entries.zip(matrix.column(column)).for_each(|(entry, &value)| *entry = value);
        }
        panels
    }

    /// The matrix with `rows` rows of which row `places[i]` is row `i` of this one times a factor for each column; the
    /// others are zero. Each panel is given back before the next is taken, so that there is never a second copy of the
    /// whole.
    ///
    /// # Panics
    /// Unless there is a place below `rows` for each row and a factor for each column.
    pub fn spread(self, rows: usize, places: &[u32], factors: &[f64]) -> Self {
        let columns = self.columns;
        assert_eq!(places.len(), self.rows, "so many places for so many rows");
        assert_eq!(factors.len(), columns, "so many factors for so many columns");
        // The memory of each panel serves for the next.
        let mut spare: Vec<f64> = Vec::new();
        let mut panels = Vec::with_capacity(self.panels.len());
        for (k, panel) in self.panels.into_iter().enumerate() {
            let mut scales = [0.0; PANEL_WIDTH];
            scales.iter_mut().zip(factors.iter().skip(k * PANEL_WIDTH)).for_each(|(scale, factor)| *scale = *factor);
            let mut spread = std::mem::take(&mut spare);
            if spread.capacity() < rows * PANEL_WIDTH || rows > self.rows {
                spread = vec![0.0; rows * PANEL_WIDTH];
            } else {
                spread.resize(rows * PANEL_WIDTH, 0.0);
            }
            let to = spread.as_chunks_mut::<PANEL_WIDTH>().0;
            for (row, &place) in panel.as_chunks::<PANEL_WIDTH>().0.iter().zip(places) {
                to[place as usize] = std::array::from_fn(|k| row[k] * scales[k]);
            }
            spare = panel;
            panels.push(spread);
        }
        Self { rows, columns, panels }
    }

    /// The number of rows.
    #[inline]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    #[inline]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The panels: `rows · 32` values each, row after row.
    #[inline]
    pub fn panels(&self) -> &[Vec<f64>] {
        &self.panels
    }

    /// The panels, to write to. Their lengths must stay as they are, and the unused columns of the last must stay zero.
    #[inline]
    pub fn panels_mut(&mut self) -> &mut [Vec<f64>] {
        &mut self.panels
    }

    /// The panels, given away: a caller that converts them one by one needs no second copy of the whole.
    pub fn into_panels(self) -> Vec<Vec<f64>> {
        self.panels
    }

    /// One entry.
    #[inline]
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.panels[column / PANEL_WIDTH][row * PANEL_WIDTH + column % PANEL_WIDTH]
    }

    /// A copy of one column.
    pub fn column(&self, column: usize) -> Vec<f64> {
        let panel = &self.panels[column / PANEL_WIDTH];
        panel.iter().skip(column % PANEL_WIDTH).step_by(PANEL_WIDTH).copied().collect()
    }

    /// Some columns, in the given order, as a matrix of their own.
    pub fn select(&self, columns: &[usize]) -> Self {
        self.select_into(columns, &mut Vec::new())
    }

    /// The same, in memory of panels that are not needed any more where there are such.
    pub fn select_into(&self, columns: &[usize], spare: &mut Vec<Vec<f64>>) -> Self {
        let mut selected = Self::zeros(self.rows, 0);
        selected.widen_into(columns.len(), spare);
        selected.panels.par_iter_mut().zip(columns.par_chunks(PANEL_WIDTH)).for_each(|(panel, columns)| {
            for run in runs(columns) {
                let source = &self.panels[run.panel];
                for (to, from) in panel.chunks_exact_mut(PANEL_WIDTH).zip(source.chunks_exact(PANEL_WIDTH)) {
                    to[run.place..run.place + run.length].copy_from_slice(&from[run.first..run.first + run.length]);
                }
            }
            if columns.len() < PANEL_WIDTH {
                panel.chunks_exact_mut(PANEL_WIDTH).for_each(|row| row[columns.len()..].fill(0.0));
            }
        });
        selected
    }

    /// Puts the columns of `source` into the given columns, one after the other. No column is given twice.
    pub fn assign(&mut self, columns: &[usize], source: &Self) {
        let mut parts: Vec<Vec<(&[f64], Run)>> = self.panels.iter().map(|_| Vec::new()).collect();
        for (panel, columns) in source.panels.iter().zip(columns.chunks(PANEL_WIDTH)) {
            for run in runs(columns) {
                parts[run.panel].push((panel, run));
            }
        }
        self.panels.par_iter_mut().zip(parts).for_each(|(target, parts)| {
            for (source, run) in parts {
                for (to, from) in target.chunks_exact_mut(PANEL_WIDTH).zip(source.chunks_exact(PANEL_WIDTH)) {
                    to[run.first..run.first + run.length].copy_from_slice(&from[run.place..run.place + run.length]);
                }
            }
        });
    }

    /// Adds columns of zeros until there are so many.
    pub fn widen(&mut self, columns: usize) {
        if columns > self.columns {
            let rows = self.rows;
            self.panels.resize_with(columns.div_ceil(PANEL_WIDTH), || vec![0.0; rows * PANEL_WIDTH]);
            self.columns = columns;
        }
    }

    /// Adds columns until there are so many, in memory of panels that are not needed any more: what stands in it stays,
    /// so that every row is to be written.
    pub(super) fn widen_into(&mut self, columns: usize, spare: &mut Vec<Vec<f64>>) {
        let length = self.rows * PANEL_WIDTH;
        while self.panels.len() < columns.div_ceil(PANEL_WIDTH) {
            let panel = spare.pop().filter(|panel| panel.len() == length);
            self.panels.push(panel.unwrap_or_else(|| vec![0.0; length]));
        }
        self.columns = self.columns.max(columns);
    }

    /// Puts the columns of `source` before column `at`, in place.
    ///
    /// # Panics
    /// Where the numbers of rows differ, or there is no such column.
    pub fn insert(&mut self, at: usize, source: &Self) {
        assert!(source.rows == self.rows && at <= self.columns, "columns of {} rows at {at}", source.rows);
        let (before, more) = (self.columns, source.columns);
        self.widen(before + more);
        let mut tasks: Vec<Vec<&mut [f64]>> =
            (0..self.rows.div_ceil(ROWS_AT_ONCE)).map(|_| Vec::with_capacity(self.panels.len())).collect();
        for panel in &mut self.panels {
            let parts = panel.chunks_mut(ROWS_AT_ONCE * PANEL_WIDTH);
            tasks.iter_mut().zip(parts).for_each(|(task, part)| task.push(part));
        }
        let place = |row: usize, column: usize| (column / PANEL_WIDTH, row * PANEL_WIDTH + column % PANEL_WIDTH);
        tasks.into_par_iter().enumerate().for_each_init(Vec::new, |line: &mut Vec<f64>, (task, mut panels)| {
            let rows = panels.first().map_or(0, |part| part.len() / PANEL_WIDTH);
            for row in 0..rows {
                line.clear();
                line.extend((0..more).map(|k| source.get(task * ROWS_AT_ONCE + row, k)));
                line.extend((at..before).map(|column| {
                    let (panel, index) = place(row, column);
                    panels[panel][index]
                }));
                for (column, &value) in (at..).zip(line.iter()) {
                    let (panel, index) = place(row, column);
                    panels[panel][index] = value;
                }
            }
        });
    }

    /// Drops all columns from `columns` on.
    pub fn keep_columns(&mut self, columns: usize) {
        self.split_off(columns);
    }

    /// The same; gives the panels that hold none of the others, as memory for others.
    pub fn split_off(&mut self, columns: usize) -> Vec<Vec<f64>> {
        if columns >= self.columns {
            return Vec::new();
        }
        self.columns = columns;
        let spare = self.panels.split_off(columns.div_ceil(PANEL_WIDTH));
        let used = columns % PANEL_WIDTH;
        if used > 0
            && let Some(last) = self.panels.last_mut()
        {
            last.chunks_exact_mut(PANEL_WIDTH).for_each(|row| row[used..].fill(0.0));
        }
        spare
    }
}

/// Consecutive columns of one panel that go to consecutive places of another.
struct Run {
    panel: usize,
    first: usize,
    place: usize,
    length: usize,
}

fn runs(columns: &[usize]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (place, &column) in columns.iter().enumerate() {
        let (panel, first) = (column / PANEL_WIDTH, column % PANEL_WIDTH);
        match runs.last_mut() {
            Some(run) if run.panel == panel && run.first + run.length == first => run.length += 1,
            _ => runs.push(Run { panel, first, place, length: 1 }),
        }
    }
    runs
}

#[cfg(test)]
#[path = "panel_tests.rs"]
mod tests;
