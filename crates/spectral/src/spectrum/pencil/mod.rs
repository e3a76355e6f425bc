//! Any sparse symmetric pencil: `S x = λ M x`, without a mesh, positions, or anything else that is known of it.
//!
//! ```
//! use chladni_spectral::spectrum::pencil::{Mass, Parameters, Pencil, PencilSelection, csr, solve};
//! use chladni_spectral::Unwatched;
//!
//! // A path of four vertices: 2 − 2 cos(πk/4).
//! let (offsets, columns) = ([0, 2, 5, 8, 10], [0, 1, 0, 1, 2, 1, 2, 3, 2, 3]);
//! let entries = [1.0, -1.0, -1.0, 2.0, -1.0, -1.0, 2.0, -1.0, -1.0, 1.0];
//! let pencil = Pencil::new(csr(4, 4, &offsets, &columns, &entries)?, Mass::Identity, &[], &Unwatched)?;
//! let parameters = Parameters { selection: PencilSelection::Count(2), ..Parameters::default() };
//! let pairs = solve(&pencil, &parameters, &Unwatched)?;
//!
//! assert!(pairs.values[0].abs() < 1e-12 && (pairs.values[1] - (2.0 - 2f64.sqrt())).abs() < 1e-12);
//! assert_eq!(pairs.certificate.complete, Some(true));
//! # Ok::<(), chladni_spectral::spectrum::pencil::PencilError>(())
//! ```

mod check;
mod mass;
mod matrices;
mod nearest;
mod single;

use chladni_algebra::{DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseError, SparseMatrix};
use chladni_base::{Cancelled, Monitor, stopped};

use super::hsim::{self, Eigenpairs, HsimError, HsimParameters};
use crate::basis::{Basis, Certificate, DenseFunctions, Functions, Precision};
use crate::operator::EigenProblem;

pub use check::csr;
pub use matrices::Matrices;

/// Which eigenpairs are wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PencilSelection {
    /// The lowest so many.
    Count(usize),
    /// All whose eigenvalue lies below this.
    Below {
        /// The bound on the eigenvalues.
        bound: f64,
        /// The most pairs that may be delivered; more are an error.
        most: usize,
    },
    /// All whose eigenvalue is at least `from` and below `to`. All below `to` are computed.
    Between {
        /// The lower end, which belongs to the interval.
        from: f64,
        /// The upper end, which does not.
        to: f64,
        /// The most pairs below the upper end.
        most: usize,
    },
    /// The `count` whose eigenvalues are nearest to `shift`, which may lie anywhere. All below the shift are computed,
    /// and `count` above it.
    Around {
        /// The number that eigenvalues are to be near to.
        shift: f64,
        /// How many.
        count: usize,
        /// The most pairs that may be computed: those below the shift, and `count`.
        most: usize,
    },
}

/// The inner product that eigenvectors are orthonormal in.
#[derive(Debug, Clone, PartialEq)]
pub enum Mass {
    /// The identity.
    Identity,
    /// A diagonal of `n` positive numbers.
    Diagonal(Vec<f64>),
    /// An `n × n` symmetric positive definite matrix, both triangles stored.
    Sparse(SparseMatrix),
}

/// A pencil that was checked: symmetric, finite, with a positive definite mass.
#[derive(Debug, Clone, PartialEq)]
pub struct Pencil {
    /// In units in which no square overflows, without the fixed rows: all of its rows are unknowns.
    problem: EigenProblem,
    /// The row of each unknown, where some rows are fixed.
    places: Option<Vec<u32>>,
    /// An eigenvalue of the pencil over that of `problem`, and an entry of a vector likewise.
    factors: (f64, f64),
    /// Rows, the fixed ones included.
    rows: usize,
    /// As it was given.
    mass: MassMatrix,
}

/// What is to be computed, and how well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Which pairs.
    pub selection: PencilSelection,
    /// Largest residual `‖S x − λ M x‖ / ‖(S + cM) x‖` of a pair, 1e-10 to 0.5; `c` is [`Pairs::moved`]. Eigenvalues
    /// are as exact as its square.
    pub tolerance: f64,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { selection: PencilSelection::Count(6), tolerance: 1e-8, seed: 0 }
    }
}

/// Eigenpairs, proven complete.
#[derive(Debug, Clone, PartialEq)]
pub struct Pairs {
    /// `m` eigenvalues, ascending.
    pub values: Vec<f64>,
    /// `n × m`, a column for each value, orthonormal for the mass; rows that were fixed are zero. In each column the
    /// entry of largest magnitude is positive.
    pub vectors: DenseMatrix,
    /// Residuals, enclosures and inertia counts, in the units of the pencil.
    pub certificate: Certificate,
    /// The multiple `c` of the mass that residuals are relative to. Zero where no eigenvalue but that of a kernel of
    /// constants is near zero.
    pub moved: f64,
}

/// Why there are no pairs.
#[derive(Debug, thiserror::Error)]
pub enum PencilError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Arrays that do not make a sparse matrix.
    #[error(transparent)]
    Structure(#[from] SparseError),
    /// The sizes of the matrices do not fit.
    #[error("{matrix} must be {expected}, got {rows} × {columns}")]
    Shape {
        /// `S` or `M`.
        matrix: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// What it has to be.
        expected: String,
    },
    /// An entry is infinite or not a number.
    #[error("{matrix}[{row}, {column}] is {value}")]
    NotFinite {
        /// `S` or `M`.
        matrix: &'static str,
        /// The row, from 0.
        row: usize,
        /// The column, from 0.
        column: usize,
        /// What it is.
        value: f64,
    },
    /// A matrix is not symmetric.
    #[error("{matrix} is not symmetric: {matrix}[{row}, {column}] is {value}, {matrix}[{column}, {row}] is {mirrored}")]
    NotSymmetric {
        /// `S` or `M`.
        matrix: &'static str,
        /// The row of the first such entry, from 0.
        row: usize,
        /// Its column, from 0.
        column: usize,
        /// The entry.
        value: f64,
        /// The entry on the other side of the diagonal.
        mirrored: f64,
    },
    /// The mass has no positive number on its diagonal.
    #[error("M is not positive definite: M[{row}, {row}] is {value}")]
    NotPositive {
        /// The first such row, from 0.
        row: usize,
        /// What it is.
        value: f64,
    },
    /// No pivot of the mass is negative, but one may be.
    #[error("M is so close to singular that rounding hides whether it is positive definite")]
    NearlySingular,
    /// The mass is not positive definite.
    #[error("M is not positive definite: elimination of row {row} gave a nonpositive pivot")]
    NotDefinite {
        /// The first row whose pivot is not positive, from 0.
        row: usize,
    },
    /// The entries of a matrix are so small that they have few digits.
    #[error("the entries of {matrix} are too small to be precise ({largest:e} at most); multiply it by a power of ten")]
    TooSmall {
        /// `S` or `M`.
        matrix: &'static str,
        /// The largest magnitude.
        largest: f64,
    },
    /// A row that is to be fixed is not there.
    #[error("fixed row {row} is out of range (the matrix has {rows} rows)")]
    Fixed {
        /// The row.
        row: u32,
        /// How many there are.
        rows: usize,
    },
    /// All rows are fixed, or there is none.
    #[error("all rows are fixed, or there are none")]
    Empty,
    /// The pairs were not found, or not proven.
    #[error(transparent)]
    Solve(HsimError),
}

stopped!(PencilError: HsimError => Self::Solve);

impl PencilError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Solve(error) => error.kind(),
            _ => "invalid-pencil",
        }
    }
}

impl Pencil {
    /// Checks a pencil of an `n × n` matrix with both triangles stored and a mass. The rows and columns of `fixed` are
    /// taken out, in any order: vectors are zero there (Dirichlet). Entries on either side of the diagonal may differ
    /// by rounding, 1e-12 of the largest in their rows; their mean is taken.
    ///
    /// # Errors
    /// [`PencilError`] names the first entry or row that does not fit.
    pub fn new(stiffness: SparseMatrix, mass: Mass, fixed: &[u32], monitor: &dyn Monitor) -> Result<Self, PencilError> {
        let stiffness = check::symmetric("S", stiffness)?;
        monitor.checkpoint()?;
        let rows = stiffness.rows();
        if rows == 0 {
            return Err(PencilError::Empty);
        }
        check::large_enough("S", stiffness.values())?;
        let mass = mass::checked(mass, rows, monitor)?;
        match &mass {
            MassMatrix::Diagonal(mass) => check::large_enough("M", mass)?,
            mass => mass.sparse().map_or(Ok(()), |mass| check::large_enough("M", mass.values()))?,
        }
        let given = mass.clone();
        let stiffness = check::with_pattern_of(&stiffness, &mass);
        let mut problem = EigenProblem { stiffness, mass, area: 1.0, unknowns: None };
        if let Some(&row) = fixed.iter().find(|&&row| row as usize >= rows) {
            return Err(PencilError::Fixed { row, rows });
        }
        if !fixed.is_empty() {
            problem = crate::operator::boundary::without(&problem, fixed).map_err(|_| PencilError::Empty)?;
        }
        let factors = scale(&mut problem);
        let places = problem.unknowns.take();
        Ok(Self { problem, places, factors, rows, mass: given })
    }

    /// Rows, the fixed ones included.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Rows that are not fixed: as many pairs there are.
    pub fn unknowns(&self) -> usize {
        self.problem.size()
    }

    /// The mass as it was given.
    pub fn mass(&self) -> &MassMatrix {
        &self.mass
    }
}

/// Brings the entries of a pencil to where no square overflows, by powers of two; gives what eigenvalues and entries of
/// vectors have to be multiplied by.
fn scale(problem: &mut EigenProblem) -> (f64, f64) {
    let diagonal = |matrix: &SparseMatrix, row: usize| {
        let (columns, values) = matrix.row(row);
        columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at])
    };
    let n = problem.size();
    // Their mean, which no sum makes infinite.
    let mean: f64 = match &problem.mass {
        MassMatrix::Diagonal(mass) => mass.iter().map(|m| m / n as f64).sum(),
        mass => mass.sparse().map_or(1.0, |mass| (0..n).map(|row| diagonal(mass, row) / n as f64).sum()),
    };
    let mass = power(1.0 / mean / n as f64, 2);
    problem.mass = problem.mass.scaled(mass);
    let largest = problem.stiffness.values().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let stiffness = power(1.0 / largest, 1);
    problem.stiffness = problem.stiffness.scaled(stiffness);
    (mass / stiffness, mass.sqrt())
}

/// A number as a power of two with an exponent that `step` divides; 1 for what has none.
fn power(number: f64, step: i32) -> f64 {
    if !(number > 0.0 && number.is_finite()) {
        return 1.0;
    }
    let exponent = (number.log2() / f64::from(step)).round() as i32 * step;
    f64::from(exponent.clamp(-1000, 1000)).exp2()
}

/// Computes eigenpairs of a pencil and proves by inertia that none is missing. Stages: `hierarchy`, `iterate`,
/// `certify`, and `repair` where something was missing; before them `count`, where pairs around a shift are wanted.
///
/// # Errors
/// [`PencilError`]: more pairs than there are, pairs that do not converge, stay missing or cannot be proven,
/// cancellation.
pub fn solve(pencil: &Pencil, parameters: &Parameters, monitor: &dyn Monitor) -> Result<Pairs, PencilError> {
    let selection = match parameters.selection {
        PencilSelection::Around { shift, count, most } => {
            return nearest::solve(pencil, parameters, (shift, count, most), monitor);
        }
        PencilSelection::Count(count) => hsim::Selection::Count(count),
        PencilSelection::Below { bound, most } => hsim::Selection::Below { bound, most },
        // Told here in the numbers of whoever asked: the solver has its own scale.
        PencilSelection::Between { from, to, .. } if !(from < to) => {
            return Err(HsimError::empty_interval(from, to).into());
        }
        PencilSelection::Between { from, to, most } => hsim::Selection::Between { from, to, most },
    };
    lowest(pencil, selection, parameters, monitor)
}

/// The lowest pairs, in whatever way they are told.
fn lowest(
    pencil: &Pencil,
    selection: hsim::Selection,
    parameters: &Parameters,
    monitor: &dyn Monitor,
) -> Result<Pairs, PencilError> {
    let (value, _) = pencil.factors;
    let inner = match selection {
        hsim::Selection::Count(count) => hsim::Selection::Count(count),
        hsim::Selection::Below { bound, most } => hsim::Selection::Below { bound: bound / value, most },
        hsim::Selection::Between { from, to, most } => {
            hsim::Selection::Between { from: from / value, to: to / value, most }
        }
    };
    let inner = HsimParameters {
        selection: inner,
        tolerance: parameters.tolerance,
        seed: parameters.seed,
        ..HsimParameters::default()
    };
    let bare = hsim::solve_bare(&pencil.problem, &inner, monitor).map_err(|error| in_units(error, value))?;
    Ok(pencil.delivered(bare.pairs, bare.moved, selection, parameters.tolerance)?)
}

fn in_units(error: HsimError, value: f64) -> HsimError {
    match error {
        HsimError::Incomplete { missing, shift } => HsimError::Incomplete { missing, shift: shift * value },
        other => other,
    }
}

impl Pencil {
    fn delivered(
        &self,
        mut pairs: Eigenpairs,
        moved: f64,
        selection: hsim::Selection,
        tolerance: f64,
    ) -> Result<Pairs, HsimError> {
        let (value, entry) = self.factors;
        pairs.values.iter_mut().for_each(|x| *x *= value);
        pairs.bounds.iter_mut().for_each(|x| *x *= value);
        pairs.inertia.iter_mut().for_each(|count| count.shift *= value);
        for pair in &mut pairs.on_bounds {
            (pair.value, pair.within, pair.bound) = (pair.value * value, pair.within * value, pair.bound * value);
        }
        let certificate = pairs.take_certificate(selection, tolerance)?;
        let vectors = columns(pairs.vectors, self.rows, self.places.as_deref(), entry);
        Ok(Pairs { values: pairs.values, vectors, certificate, moved: moved * value })
    }
}

impl Pairs {
    /// As a basis, which can be written and evaluated like that of a mesh: a row of the pencil stands for a vertex.
    /// `about` becomes its metadata, with [`moved`](Self::moved). In single precision residuals are those of what is
    /// stored.
    ///
    /// # Errors
    /// [`PencilError::Cancelled`].
    pub fn into_basis(
        mut self,
        pencil: &Pencil,
        precision: Precision,
        mut about: serde_json::Map<String, serde_json::Value>,
        monitor: &dyn Monitor,
    ) -> Result<Basis, PencilError> {
        if precision == Precision::F32 {
            self.certificate.residuals = single::residuals(&self, pencil, monitor)?;
        }
        about.insert("moved".to_owned(), self.moved.into());
        about.insert("fixed_rows".to_owned(), (pencil.rows() - pencil.unknowns()).into());
        Ok(Basis {
            functions: Functions::Dense(DenseFunctions::from_columns(&self.vectors, precision)),
            eigenvalues: self.values,
            // Read from a file it has no weights either.
            mass: match pencil.mass.clone() {
                MassMatrix::Weighted(mass) => MassMatrix::Sparse(mass.matrix),
                mass => mass,
            },
            certificate: self.certificate,
            metadata: about.into(),
        })
    }
}

/// Panels as columns one after the other, their entries times a number, at some of `rows` rows. Panels are given back
/// as they are copied.
fn columns(vectors: PanelMatrix, rows: usize, places: Option<&[u32]>, factor: f64) -> DenseMatrix {
    let count = vectors.columns();
    let mut dense = DenseMatrix::zeros(rows, count);
    for (k, panel) in vectors.into_panels().into_iter().enumerate() {
        let first = k * PANEL_WIDTH;
        for column in 0..PANEL_WIDTH.min(count - first) {
            let to = dense.column_mut(first + column);
            let from = panel.iter().skip(column).step_by(PANEL_WIDTH).map(|x| x * factor);
            match places {
                None => to.iter_mut().zip(from).for_each(|(to, x)| *to = x),
                Some(places) => places.iter().zip(from).for_each(|(&place, x)| to[place as usize] = x),
            }
        }
    }
    dense
}
