//! The viewer of the service's page, for notebooks.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The script of the viewer, or `None` where the package was built without Node.
#[pyfunction]
pub fn viewer(py: Python<'_>) -> Option<Bound<'_, PyBytes>> {
    chladni_page::VIEWER.map(|script| PyBytes::new(py, script))
}
