//! `chladni._native`: what the Python package in `chladni/` stands on. Arrays and JSON go in, arrays and JSON come out;
//! names, defaults and docstrings are the package's own, and the numerics are those of the library crates.
//!
//! Every call that may take long gives up the interpreter's lock; solves, pencils, fields and distances report their
//! progress, and end soon after Ctrl-C: see `watch`.

mod arrays;
mod basis;
mod errors;
mod fields;
mod learning;
mod maps;
mod mesh;
mod pencil;
mod threads;
mod vibration;
mod view;
mod watch;

use pyo3::prelude::*;

// Solvers take and give back large pieces of memory, each page of which the system's allocator has the kernel clear
// again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::basis::NativeBasis;
    #[pymodule_export]
    use super::fields::{NativeFields, design_space};
    #[pymodule_export]
    use super::learning::gradients;
    #[pymodule_export]
    use super::maps::{functional_map, map_collection};
    #[pymodule_export]
    use super::mesh::{NativeMesh, sample};
    #[pymodule_export]
    use super::pencil::pencil;
    #[pymodule_export]
    use super::threads::{get_threads, set_threads};
    #[pymodule_export]
    use super::vibration::{NativeVibration, vibration};
    #[pymodule_export]
    use super::view::viewer;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("SOLVER_VERSION", chladni_work::SOLVER_VERSION)
    }
}
