//! Between NumPy's arrays and ours. The package hands over C-contiguous arrays of the right type; what it gets back is
//! not copied.

use std::ffi::CString;

use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::errors::Failure;

/// A contiguous array's numbers.
///
/// # Errors
/// [`Failure`] where it is not contiguous: the package makes it so.
pub fn numbers<'a, T: numpy::Element>(array: &'a PyReadonlyArray1<'_, T>) -> Result<&'a [T], Failure> {
    array.as_slice().map_err(|_| Failure::parameter("an array is not contiguous"))
}

/// Rows of a C-contiguous array, `n × W`.
///
/// # Errors
/// [`Failure`] where it has another number of columns.
pub fn rows<'a, T: numpy::Element, const W: usize>(
    array: &'a PyReadonlyArray2<'_, T>,
    what: &str,
) -> Result<&'a [[T; W]], Failure> {
    let [n, columns] = [array.shape()[0], array.shape()[1]];
    if columns != W {
        return Err(Failure::parameter(format!("{what} must have shape (n, {W}), got ({n}, {columns})")));
    }
    let values = array.as_slice().map_err(|_| Failure::parameter(format!("{what} are not contiguous")))?;
    Ok(values.as_chunks::<W>().0)
}

/// Functions, `n × k`, from an array in Fortran order.
///
/// # Errors
/// [`Failure`] where it is not in that order: the package makes it so.
pub fn functions(array: &PyReadonlyArray2<'_, f64>) -> Result<DenseMatrix, Failure> {
    let [rows, columns] = [array.shape()[0], array.shape()[1]];
    let transposed = array.transpose().map_err(Failure::from)?.readonly();
    let values = transposed.as_slice().map_err(|_| Failure::parameter("functions are not in Fortran order"))?;
    Ok(DenseMatrix::from_columns(rows, columns, values.to_vec()))
}

/// Columns of `rows` values as an array in Fortran order, `rows × k`, without a copy.
///
/// # Errors
/// [`PyErr`] where the values are no whole columns.
pub fn columns<T: numpy::Element>(py: Python<'_>, values: Vec<T>, rows: usize) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = values.len().checked_div(rows).unwrap_or(0);
    values.into_pyarray(py).reshape([count, rows])?.transpose()
}

/// A table of ours as an array, `n × k`.
///
/// # Errors
/// As [`columns`].
pub fn table(py: Python<'_>, table: DenseMatrix) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let rows = table.rows();
    if rows == 0 {
        return Ok(PyArray2::zeros(py, [0, table.columns()], true));
    }
    columns(py, table.into_values(), rows)
}

/// Errors of the slope of distances from here on are warned of: a share of the distances.
const STEEP: f64 = 0.1;

/// Distances as a table; a warning where those by heat may be far off.
///
/// # Errors
/// As [`columns`]; where warnings are errors, the warning.
pub fn distances(
    py: Python<'_>,
    (found, slope_error): (DenseMatrix, Option<f64>),
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    if let Some(error) = slope_error.filter(|error| *error > STEEP) {
        let category = py.get_type::<PyRuntimeWarning>();
        let text = format!(
            "distances by heat may be {:.0} % off on this mesh; method=\"exact\" has no such error",
            100.0 * error
        );
        PyErr::warn(py, &category, &CString::new(text)?, 2)?;
    }
    table(py, found)
}

/// A sparse matrix as `(data, indices, indptr)` of SciPy's CSR.
///
/// # Errors
/// [`PyErr`] where Python has no memory left.
pub fn csr(py: Python<'_>, matrix: &SparseMatrix) -> PyResult<Py<PyTuple>> {
    let indices: Vec<i32> = matrix.indices().iter().map(|&index| index as i32).collect();
    // SciPy wants both of one type; what has more than 2³¹ entries has them in 64 bits.
    let parts = match i32::try_from(matrix.entries()) {
        Ok(_) => {
            let offsets: Vec<i32> = matrix.offsets().iter().map(|&offset| offset as i32).collect();
            (
                matrix.values().to_vec().into_pyarray(py),
                indices.into_pyarray(py).into_any(),
                offsets.into_pyarray(py).into_any(),
            )
        }
        Err(_) => {
            let offsets: Vec<i64> = matrix.offsets().iter().map(|&offset| offset as i64).collect();
            let indices: Vec<i64> = matrix.indices().iter().map(|&index| i64::from(index)).collect();
            (
                matrix.values().to_vec().into_pyarray(py),
                indices.into_pyarray(py).into_any(),
                offsets.into_pyarray(py).into_any(),
            )
        }
    };
    Ok(parts.into_pyobject(py)?.unbind())
}

/// A mass matrix: its diagonal, or the parts of a CSR matrix.
///
/// # Errors
/// As [`csr`].
pub fn mass(py: Python<'_>, mass: &MassMatrix) -> PyResult<Py<PyAny>> {
    match mass {
        MassMatrix::Diagonal(diagonal) => Ok(diagonal.clone().into_pyarray(py).into_any().unbind()),
        MassMatrix::Sparse(matrix) => Ok(csr(py, matrix)?.into_any()),
        MassMatrix::Weighted(mass) => Ok(csr(py, &mass.matrix)?.into_any()),
    }
}

/// Numbers as an array.
pub fn vector<T: numpy::Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    values.into_pyarray(py)
}
