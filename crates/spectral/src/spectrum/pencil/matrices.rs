//! The two matrices of a pencil as they are kept: checked, and in one form whatever they were sent as.

use chladni_algebra::{MassMatrix, SparseMatrix, SymbolicFactor, fill_reducing_order};
use chladni_base::Monitor;

use super::{Mass, Pencil, PencilError, check, mass};
use crate::operator::{EigenProblem, MeshOperator, OperatorReport};
use crate::spectrum::hsim::{self, HsimError};

/// Matrices that were checked: `S` is symmetric to the last bit, without stored zeros; so is a mass that is no
/// diagonal. Equal matrices are equal here, whatever format they came in: entries of one place are added up, a mass
/// that is a diagonal is kept as one, and ones on it as the identity.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrices {
    stiffness: SparseMatrix,
    mass: Mass,
}

impl Matrices {
    /// Checks two matrices, but for whether a mass that is no diagonal is positive definite: [`Self::prove`] does that.
    ///
    /// # Errors
    /// [`PencilError`] names the first entry or row that does not fit.
    pub fn new(stiffness: SparseMatrix, mass: Mass) -> Result<Self, PencilError> {
        let stiffness = check::symmetric("S", stiffness)?;
        if stiffness.rows() == 0 {
            return Err(PencilError::Empty);
        }
        let mass = match mass::symmetric(mass, stiffness.rows())? {
            (None, Some(diagonal)) if diagonal.iter().all(|&entry| entry == 1.0) => Mass::Identity,
            (None, Some(diagonal)) => Mass::Diagonal(diagonal),
            (Some(matrix), _) => Mass::Sparse(matrix),
            (None, None) => Mass::Identity,
        };
        Ok(Self { stiffness, mass })
    }

    /// The same of matrices that were read from where [`parts`](Self::parts) put them.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_parts(
        stiffness: SparseMatrix,
        diagonal: Option<Vec<f64>>,
        matrix: Option<SparseMatrix>,
    ) -> Result<Self, PencilError> {
        let mass = match (diagonal, matrix) {
            (Some(diagonal), _) => Mass::Diagonal(diagonal),
            (None, Some(matrix)) => Mass::Sparse(matrix),
            (None, None) => Mass::Identity,
        };
        Self::new(stiffness, mass)
    }

    /// `S`, and the mass where it is a diagonal, or where it is a matrix; neither where it is the identity.
    pub fn parts(&self) -> (&SparseMatrix, Option<&[f64]>, Option<&SparseMatrix>) {
        match &self.mass {
            Mass::Identity => (&self.stiffness, None, None),
            Mass::Diagonal(diagonal) => (&self.stiffness, Some(diagonal), None),
            Mass::Sparse(matrix) => (&self.stiffness, None, Some(matrix)),
        }
    }

    /// `(S + cM, M)` without the rows and columns of `fixed`, as an operator that pairs can be
    /// [verified](crate::verify) by: rows stand for vertices.
    ///
    /// # Errors
    /// [`PencilError`]: rows that are not there, a mass that is not definite, cancellation.
    pub fn moved(&self, by: f64, fixed: &[u32], monitor: &dyn Monitor) -> Result<MeshOperator, PencilError> {
        let rows = self.rows();
        if let Some(&row) = fixed.iter().find(|&&row| row as usize >= rows) {
            return Err(PencilError::Fixed { row, rows });
        }
        let mass = mass::checked(self.mass.clone(), rows, monitor)?;
        let stiffness = hsim::plus_mass(&check::with_pattern_of(&self.stiffness, &mass), &mass, by);
        let whole = EigenProblem { stiffness, mass, area: 1.0, unknowns: None };
        MeshOperator::of_problem(whole, Some(fixed), OperatorReport::default(), None).map_err(|_| PencilError::Empty)
    }

    /// Rows.
    pub fn rows(&self) -> usize {
        self.stiffness.rows()
    }

    /// `S`.
    pub fn stiffness(&self) -> &SparseMatrix {
        &self.stiffness
    }

    /// `M`.
    pub fn mass(&self) -> &Mass {
        &self.mass
    }

    /// The entries of the mass that are stored; none of the identity.
    pub fn mass_entries(&self) -> usize {
        match &self.mass {
            Mass::Identity => 0,
            Mass::Diagonal(diagonal) => diagonal.len(),
            Mass::Sparse(matrix) => matrix.entries(),
        }
    }

    /// The bytes that both take in memory.
    pub fn bytes(&self) -> u64 {
        let sparse = |matrix: &SparseMatrix| 12 * matrix.entries() + 8 * (matrix.rows() + 1);
        let mass = match &self.mass {
            Mass::Identity => 0,
            Mass::Diagonal(diagonal) => 8 * diagonal.len(),
            Mass::Sparse(matrix) => sparse(matrix),
        };
        (sparse(&self.stiffness) + mass) as u64
    }

    /// How many entries a factor of `S − μM` has, by its symbolic analysis: what the memory of a solve is told from.
    ///
    /// # Errors
    /// [`PencilError`]: a matrix that cannot be ordered, or cancellation.
    pub fn factor_entries(&self, monitor: &dyn Monitor) -> Result<usize, PencilError> {
        let weights = match &self.mass {
            Mass::Sparse(matrix) => MassMatrix::Sparse(matrix.clone()),
            _ => MassMatrix::Diagonal(vec![1.0; self.rows()]),
        };
        let pattern = check::with_pattern_of(&self.stiffness, &weights);
        let symbolic = || -> Result<usize, HsimError> {
            let order = fill_reducing_order(&pattern, hsim::bare_ordering(&pattern, TYPICAL_COLUMNS))?;
            monitor.checkpoint()?;
            Ok(SymbolicFactor::new(&pattern.reordered(&order), &weights.reordered(&order))?.entries())
        };
        Ok(symbolic()?)
    }

    /// Proves that the mass is positive definite, which the pencil of every solve does as well: worth while where a
    /// factor of it fits into what `monitor` promises.
    ///
    /// # Errors
    /// [`PencilError::NotDefinite`], [`PencilError::NearlySingular`], [`PencilError::Solve`] where the factor does not
    /// fit, cancellation.
    pub fn prove(&self, monitor: &dyn Monitor) -> Result<(), PencilError> {
        mass::checked(self.mass.clone(), self.rows(), monitor).map(|_| ())
    }

    /// The pencil, without the rows and columns of `fixed`.
    ///
    /// # Errors
    /// As [`Pencil::new`].
    pub fn pencil(&self, fixed: &[u32], monitor: &dyn Monitor) -> Result<Pencil, PencilError> {
        Pencil::new(self.stiffness.clone(), self.mass.clone(), fixed, monitor)
    }
}

/// Columns of a typical solve: the order of a factor may depend on how many there are.
const TYPICAL_COLUMNS: usize = 128;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_matrices_are_equal_whatever_they_were_sent_as() {
        let path = |offsets: Vec<usize>, indices: Vec<u32>, values: Vec<f64>| {
            SparseMatrix::new(3, 3, offsets, indices, values).unwrap()
        };
        let values = vec![1.0, -1.0, -1.0, 2.0, -1.0, -1.0, 1.0];
        let stiffness = || path(vec![0, 2, 5, 7], vec![0, 1, 0, 1, 2, 1, 2], values.clone());
        let identity = Matrices::new(stiffness(), Mass::Identity).unwrap();
        assert_eq!(Matrices::new(stiffness(), Mass::Diagonal(vec![1.0; 3])).unwrap(), identity);
        let eye = path(vec![0, 1, 2, 3], vec![0, 1, 2], vec![1.0; 3]);
        assert_eq!(Matrices::new(stiffness(), Mass::Sparse(eye)).unwrap(), identity);
        // Stored zeros are none.
        let full = vec![1.0, -1.0, 0.0, -1.0, 2.0, -1.0, -0.0, -1.0, 1.0];
        let full = path(vec![0, 3, 6, 9], (0..9).map(|k| k % 3).collect(), full);
        assert_eq!(Matrices::new(full, Mass::Identity).unwrap(), identity);
        let (stiffness, diagonal, mass) = identity.parts();
        let again = Matrices::of_parts(stiffness.clone(), diagonal.map(<[f64]>::to_vec), mass.cloned()).unwrap();
        assert_eq!(again, identity);
    }
}
