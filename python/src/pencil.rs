//! Any sparse symmetric pencil: `S x = λ M x`.

use chladni_spectral::spectrum::pencil::{Mass, Pairs, Parameters, Pencil, PencilError, PencilSelection, csr, solve};
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde::Deserialize;

use super::errors::{Failure, Kind};
use super::mesh::{json, parsed};
use super::{arrays, watch};

impl From<PencilError> for Failure {
    fn from(error: PencilError) -> Self {
        let kind = match error.kind() {
            "cancelled" => Kind::Cancelled,
            "invalid-pencil" | "invalid-parameters" => Kind::Parameter,
            "not-converged" | "incomplete" | "unproven" | "tolerance-below-rounding" => Kind::Unproven,
            _ => Kind::Solve,
        };
        Self::new(kind, error.kind(), error.to_string())
    }
}

/// What is wanted.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    count: Option<usize>,
    below: Option<f64>,
    between: Option<[f64; 2]>,
    around: Option<f64>,
    most: usize,
    tolerance: f64,
    seed: u64,
}

impl Request {
    fn parameters(&self) -> Parameters {
        let (most, count) = (self.most, self.count.unwrap_or(6));
        let selection = match (self.below, self.between, self.around) {
            (_, Some([from, to]), _) => PencilSelection::Between { from, to, most },
            (Some(bound), None, _) => PencilSelection::Below { bound, most },
            (None, None, Some(shift)) => PencilSelection::Around { shift, count, most },
            (None, None, None) => PencilSelection::Count(count),
        };
        Parameters { selection, tolerance: self.tolerance, seed: self.seed }
    }
}

/// The arrays of SciPy's CSR matrix: `indptr`, `indices`, `data`.
type Csr<'py> = (PyReadonlyArray1<'py, u64>, PyReadonlyArray1<'py, u32>, PyReadonlyArray1<'py, f64>);

/// Solves a pencil of `n × n` matrices: `(values, vectors, certificate)`, the last as JSON. Without a mass it is the
/// identity; rows of `fixed` are zero.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the package names them")]
pub fn pencil<'py>(
    py: Python<'py>,
    n: usize,
    stiffness: Csr<'py>,
    diagonal: Option<PyReadonlyArray1<'py, f64>>,
    mass: Option<Csr<'py>>,
    fixed: Vec<u32>,
    request: &str,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let request: Request = parsed("eigsh", request)?;
    let stiffness = parts(&stiffness)?;
    let mass = mass.as_ref().map(parts).transpose()?;
    let diagonal = diagonal.as_ref().map(arrays::numbers).transpose()?;
    let Pairs { values, vectors, certificate, moved } = watch::run(py, progress, |monitor| {
        let matrix = |(offsets, columns, entries): &Parts<'_>| csr(n, n, offsets, columns, entries);
        let weights = match (&mass, diagonal) {
            (Some(parts), _) => Mass::Sparse(matrix(parts)?),
            (None, Some(diagonal)) => Mass::Diagonal(diagonal.to_vec()),
            (None, None) => Mass::Identity,
        };
        let pencil = Pencil::new(matrix(&stiffness)?, weights, &fixed, monitor)?;
        Ok(solve(&pencil, &request.parameters(), monitor)?)
    })?;
    (values.into_pyarray(py), arrays::table(py, vectors)?, json(&certificate)?, moved).into_pyobject(py)
}

type Parts<'a> = (Vec<usize>, &'a [u32], &'a [f64]);

fn parts<'a>((offsets, columns, entries): &'a Csr<'_>) -> Result<Parts<'a>, Failure> {
    let offsets = arrays::numbers(offsets)?.iter().map(|&offset| offset as usize).collect();
    Ok((offsets, arrays::numbers(columns)?, arrays::numbers(entries)?))
}
