//! Poisson problems on the vertices of a surface, by a sparse factor.

use chladni_algebra::{
    ColumnTree, FactorError, FactorNumbers, MassMatrix, Ordering, PANEL_WIDTH, PanelMatrix, SparseMatrix,
    SymbolicFactor, fill_reducing_order,
};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, stopped};
use chladni_mesh::dual::OneSided;

use super::pencil::within_surfaces;
use super::surface::FieldSurface;

/// From so many unknowns on, an order by nested dissection saves more than it costs.
const LARGE: usize = 60_000;

/// Why a Poisson problem was not solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoissonError {
    /// The surface has one side, or its faces do not agree about two.
    #[error("gradients and co-gradients can be told apart only on oriented surfaces: {0}")]
    OneSided(#[from] OneSided),
    /// The matrix was not factored.
    #[error("a Poisson problem on the vertices could not be solved: {0}")]
    Factor(FactorError),
    /// The matrix is singular for faces without area.
    #[error(
        "the Laplacian of this surface cannot be factored: {faces} of its faces have no area, the first of which is face {face}"
    )]
    Flat {
        /// The first of them.
        face: u32,
        /// How many there are.
        faces: usize,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(PoissonError: FactorError => Self::Factor);

/// Makes a Laplacian definite: a vertex of each component is tied to zero where none is fixed, as are vertices without
/// a face.
pub(super) fn ground(surface: &FieldSurface, fixed: impl Fn(u32) -> bool, entries: &mut Vec<(u32, u32, f64)>) {
    let mesh = surface.mesh();
    let (components, count) = surface.dual().components();
    let (mut seen, mut tied, mut held) = (vec![false; mesh.positions.len()], vec![None; count], vec![false; count]);
    for (face, corners) in mesh.faces.iter().enumerate() {
        let component = components[face] as usize;
        tied[component].get_or_insert(corners[0]);
        held[component] |= corners.iter().any(|&v| fixed(v));
        corners.iter().for_each(|&v| seen[v as usize] = true);
    }
    let lone = (0..mesh.positions.len() as u32).filter(|&v| !seen[v as usize]);
    let tied = tied.into_iter().zip(held).filter_map(|(vertex, held)| vertex.filter(|_| !held));
    entries.extend(tied.chain(lone).map(|v| (v, v, 1.0)));
}

/// The order to factor so many unknowns in.
fn ordering(unknowns: usize) -> Ordering {
    if unknowns > LARGE { Ordering::NestedDissection } else { Ordering::Amd }
}

/// `X ← A⁻¹ X` for a symmetric positive definite matrix: what is singular has to be grounded before.
pub(super) fn solve(matrix: &SparseMatrix, x: &mut PanelMatrix, monitor: &dyn Monitor) -> Result<(), PoissonError> {
    let factor = Factor::admitted(matrix, |symbolic| symbolic.within(1, monitor), monitor)?;
    x.panels_mut().par_iter_mut().try_for_each(|panel| {
        monitor.checkpoint()?;
        factor.solve_panel(panel);
        Ok(())
    })
}

fn numbers(symbolic: &SymbolicFactor, matrix: &SparseMatrix, none: &MassMatrix) -> Result<FactorNumbers, FactorError> {
    Ok(symbolic.factor(matrix, none, 0.0)?.into_numbers())
}

/// A symmetric positive definite matrix, factored to be kept.
pub(super) struct Factor {
    order: Vec<u32>,
    symbolic: SymbolicFactor,
    numbers: FactorNumbers,
    /// How a single right-hand side is shared out among threads.
    tree: ColumnTree,
}

impl Factor {
    /// Factors a matrix on a surface; its numbers are not computed where it fills in more than those do.
    ///
    /// # Errors
    /// [`PoissonError`].
    pub fn new(matrix: &SparseMatrix, monitor: &dyn Monitor) -> Result<Self, PoissonError> {
        let admit = |symbolic: SymbolicFactor| {
            within_surfaces(symbolic.entries(), matrix.entries(), matrix.rows())?;
            Ok(symbolic)
        };
        Self::admitted(matrix, admit, monitor)
    }

    /// The same where `admit` lets the pattern of the factor pass.
    fn admitted(
        matrix: &SparseMatrix,
        admit: impl FnOnce(SymbolicFactor) -> Result<SymbolicFactor, FactorError>,
        monitor: &dyn Monitor,
    ) -> Result<Self, PoissonError> {
        let order = fill_reducing_order(matrix, ordering(matrix.rows()))?;
        Self::in_order(matrix, order, admit, monitor)
    }

    /// Factors a matrix on a surface in a given order.
    ///
    /// # Errors
    /// [`PoissonError`].
    pub fn ordered(matrix: &SparseMatrix, order: Vec<u32>, monitor: &dyn Monitor) -> Result<Self, PoissonError> {
        let admit = |symbolic: SymbolicFactor| {
            within_surfaces(symbolic.entries(), matrix.entries(), matrix.rows())?;
            Ok(symbolic)
        };
        Self::in_order(matrix, order, admit, monitor)
    }

    /// Factors another matrix of the same pattern in its place.
    ///
    /// # Errors
    /// [`FactorError`].
    pub fn refactor(&mut self, matrix: &SparseMatrix) -> Result<(), FactorError> {
        let none = MassMatrix::Diagonal(vec![0.0; matrix.rows()]);
        let sorted = matrix.reordered(&self.order);
        self.numbers = numbers(&self.symbolic, &sorted, &none)?;
        Ok(())
    }

    fn in_order(
        matrix: &SparseMatrix,
        order: Vec<u32>,
        admit: impl FnOnce(SymbolicFactor) -> Result<SymbolicFactor, FactorError>,
        monitor: &dyn Monitor,
    ) -> Result<Self, PoissonError> {
        let n = matrix.rows();
        monitor.checkpoint()?;
        let sorted = matrix.reordered(&order);
        let none = MassMatrix::Diagonal(vec![0.0; n]);
        let symbolic = admit(SymbolicFactor::new(&sorted, &none)?)?;
        monitor.checkpoint()?;
        let numbers = numbers(&symbolic, &sorted, &none)?;
        let tree = ColumnTree::new(&symbolic);
        Ok(Self { order, symbolic, numbers, tree })
    }

    /// The unknowns.
    pub fn size(&self) -> usize {
        self.order.len()
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        (4 * self.order.len() + 10 * self.symbolic.entries()) as u64
    }

    /// `x ← A⁻¹ x`, of at most [`PANEL_WIDTH`] vectors.
    pub fn solve<const K: usize>(&self, columns: &mut [Vec<f64>; K]) {
        if let [column] = columns.as_mut_slice() {
            let mut sorted: Vec<f64> = self.order.iter().map(|&at| column[at as usize]).collect();
            self.tree.solve(&self.symbolic, &self.numbers, &mut sorted);
            sorted.iter().zip(&self.order).for_each(|(from, &at)| column[at as usize] = *from);
            return;
        }
        let mut panel = vec![0.0; self.size() * PANEL_WIDTH];
        for (row, &at) in panel.chunks_exact_mut(PANEL_WIDTH).zip(&self.order) {
            row.iter_mut().zip(columns.iter()).for_each(|(to, column)| *to = column[at as usize]);
        }
        self.symbolic.solve_panel(&self.numbers, &mut panel);
        for (row, &at) in panel.chunks_exact(PANEL_WIDTH).zip(&self.order) {
            row.iter().zip(columns.iter_mut()).for_each(|(from, column)| column[at as usize] = *from);
        }
    }

    /// `X ← A⁻¹ X` for a panel of [`PANEL_WIDTH`] columns, row after row.
    fn solve_panel(&self, panel: &mut [f64]) {
        let rows =
            |panel: &[f64], row: usize| -> [f64; PANEL_WIDTH] { std::array::from_fn(|k| panel[row * PANEL_WIDTH + k]) };
        let mut sorted: Vec<f64> = self.order.iter().flat_map(|&row| rows(panel, row as usize)).collect();
        self.symbolic.solve_panel(&self.numbers, &mut sorted);
        for (row, &to) in sorted.chunks_exact(PANEL_WIDTH).zip(&self.order) {
            panel[to as usize * PANEL_WIDTH..(to as usize + 1) * PANEL_WIDTH].copy_from_slice(row);
        }
    }
}
