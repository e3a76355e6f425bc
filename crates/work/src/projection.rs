//! Functions on the vertices, what is filtered of them, and their coefficients in a basis.

use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::Translation;
use chladni_spectral::analysis::filter::Transfer;
use chladni_spectral::analysis::projection::Projection;
use chladni_spectral::basis::{Basis, BasisError};
use serde::{Deserialize, Serialize};

use crate::numbered::{FunctionError, push};
use crate::table::Table;

/// Functions on the vertices.
#[derive(Debug)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", serde(untagged))]
pub enum Functions {
    /// `coordinates`: x, y and z of the vertices.
    Named(Named),
    /// One row for each vertex.
    Values(Table),
}

crate::word_or!(
    Functions,
    "the word \"coordinates\" or a table {\"columns\": k, \"values\": […]}",
    Named(Named),
    object Values
);

impl Functions {
    /// x, y and z of the vertices.
    pub fn coordinates() -> Self {
        Self::Named(Named::Coordinates)
    }

    /// The functions on the kept vertices, whose positions these are, or on whatever else a basis of so many `rows` is
    /// of: tables are in the numbering of `to`.
    ///
    /// # Errors
    /// [`FunctionError`] where a table does not fit the rows.
    pub fn on(&self, positions: &[[f64; 3]], rows: usize, to: &Translation) -> Result<DenseMatrix, FunctionError> {
        match self {
            Self::Named(Named::Coordinates) => Ok(coordinates(positions)),
            Self::Values(table) => table.functions(rows, to),
        }
    }
}

/// Functions that the server knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Named {
    /// x, y and z of the vertices.
    Coordinates,
}

/// x, y and z of positions: three columns.
pub fn coordinates(positions: &[[f64; 3]]) -> DenseMatrix {
    let mut matrix = DenseMatrix::zeros(positions.len(), 3);
    for axis in 0..3 {
        matrix.column_mut(axis).iter_mut().zip(positions).for_each(|(x, position)| *x = position[axis]);
    }
    matrix
}

/// What to filter, and how.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"functions": "coordinates", "transfer": {"kind": "low_pass", "cutoff": 250.0}})))]
pub struct FilterRequest {
    /// `coordinates`, or a table with a row for each vertex.
    pub functions: Functions,
    /// By what each part is multiplied, as a function of its eigenvalue λ (1/length² of the mesh).
    pub transfer: Transfer,
}

/// What to project.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"functions": {"columns": 1, "values": [0.5, 0.25, 0.125]}, "reconstruct": false})))]
pub struct ProjectRequest {
    /// `coordinates`, or a table with a row for each vertex.
    pub functions: Functions,
    /// Whether to give the projected functions beside the coefficients.
    #[serde(default)]
    pub reconstruct: bool,
    /// Onto how many modes, the lowest; all by default.
    pub pairs: Option<usize>,
}

/// Projected functions.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"coefficients": {"columns": 1, "values": [0.49, 0.01, -0.02]}, "relative_errors": [0.08], "reconstruction": null})))]
pub struct ProjectAnswer {
    /// A row for each eigenfunction.
    pub coefficients: Table,
    /// For each function the M-norm of what the basis does not hold, relative to the whole.
    pub relative_errors: Vec<f64>,
    /// A row for each vertex, where it was asked for.
    pub reconstruction: Option<Table>,
}

impl ProjectAnswer {
    /// Of functions that were projected, with these in the numbering of `to` where they are wanted.
    pub fn new(projection: Projection, reconstruct: bool, to: &Translation) -> Self {
        Self {
            coefficients: Table::from(&projection.coefficients),
            relative_errors: projection.relative_errors,
            reconstruction: reconstruct.then(|| Table::from(&push(to, projection.reconstruction))),
        }
    }
}

/// Combinations of eigenfunctions, `Φ c`, from a row of coefficients for each of them: a row for each vertex in the
/// numbering of `to`; of eigenfields one for each number of a face.
///
/// # Errors
/// [`BasisError`] where there is not a row for each eigenfunction, or they cannot be read.
pub fn reconstruct(basis: &Basis, coefficients: &DenseMatrix, to: &Translation) -> Result<DenseMatrix, BasisError> {
    Ok(push(to, basis.evaluate(coefficients)?))
}
