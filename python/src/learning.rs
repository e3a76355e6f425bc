//! Frames and gradients at vertices, as networks on surfaces take them.

use chladni_spectral::operator::vertex_gradients::VertexGradients;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::errors::Failure;
use super::mesh::faces_of;
use super::{arrays, watch};

/// Frames (n, 3, 3) and both gradients in CSR: `(frames, indptr, indices, data_x, data_y)`.
#[pyfunction]
pub fn gradients<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    epsilon: f64,
) -> PyResult<Bound<'py, PyTuple>> {
    let positions = arrays::rows::<f64, 3>(&vertices, "vertices")?;
    let n = positions.len();
    let faces = faces_of(arrays::rows::<i64, 3>(&faces, "faces")?, n)?;
    let made = watch::run(py, None, |_| {
        VertexGradients::new(positions, &faces, epsilon).map_err(|error| Failure::parameter(error.to_string()))
    })?;
    let VertexGradients { frames, offsets, indices, values } = made;
    let frames: Vec<f64> = frames.as_flattened().as_flattened().to_vec();
    let frames: Bound<'py, PyArray3<f64>> = frames.into_pyarray(py).reshape([n, 3, 3])?;
    let offsets: Vec<i32> = offsets.into_iter().map(|offset| offset as i32).collect();
    let indices: Vec<i32> = indices.into_iter().map(|index| index as i32).collect();
    let values: Bound<'py, PyArray2<f64>> = {
        let count = values.len();
        values.as_flattened().to_vec().into_pyarray(py).reshape([count, 2])?
    };
    (frames, offsets.into_pyarray(py), indices.into_pyarray(py), values).into_pyobject(py)
}
