//! Dense matrices with many rows, kept as panels of 32 columns: what block eigensolvers work on.

/// Columns of one panel: a row of it is four cache lines, and four rows of accumulators fill the registers of a core.
pub const PANEL_WIDTH: usize = 32;

/// A dense `rows × columns` matrix of f64 in panels of [`PANEL_WIDTH`] columns, each stored row after row. Unused columns of
/// the last panel are zero.
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

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The panels: `rows · 32` values each, row after row.
    pub fn panels(&self) -> &[Vec<f64>] {
        &self.panels
    }

    /// The panels, to write to. Their lengths must stay as they are, and the unused columns of the last must stay zero.
    pub fn panels_mut(&mut self) -> &mut [Vec<f64>] {
        &mut self.panels
    }

    /// The panels, given away: a caller that converts them one by one needs no second copy of the whole.
    pub fn into_panels(self) -> Vec<Vec<f64>> {
        self.panels
    }

    /// One entry.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.panels[column / PANEL_WIDTH][row * PANEL_WIDTH + column % PANEL_WIDTH]
    }

    /// A copy of one column.
    pub fn column(&self, column: usize) -> Vec<f64> {
        let panel = &self.panels[column / PANEL_WIDTH];
        panel.iter().skip(column % PANEL_WIDTH).step_by(PANEL_WIDTH).copied().collect()
    }

    /// Drops all columns from `columns` on.
    pub fn keep_columns(&mut self, columns: usize) {
        if columns >= self.columns {
            return;
        }
        self.columns = columns;
        self.panels.truncate(columns.div_ceil(PANEL_WIDTH));
        let used = columns % PANEL_WIDTH;
        if used > 0
            && let Some(last) = self.panels.last_mut()
        {
            last.chunks_exact_mut(PANEL_WIDTH).for_each(|row| row[used..].fill(0.0));
        }
    }
}
