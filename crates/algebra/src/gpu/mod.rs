//! Dense linear algebra on a graphics card, through Vulkan, Metal or Direct3D 12: docs/gpu.md. The only folder that
//! names wgpu.
//!
//! [`Accelerator`] is all that others see. It solves dense symmetric-definite eigenproblems like
//! [`CpuSolver`](super::CpuSolver), on the device where that is there and faster, on the CPU otherwise and whenever the
//! device fails.

mod accelerator;
mod choice;
mod error;
mod pair_sums;
mod products;

#[cfg(feature = "gpu")]
mod cycle;
#[cfg(feature = "gpu")]
mod device;
#[cfg(feature = "gpu")]
mod engine;
#[cfg(feature = "gpu")]
#[cfg(test)]
mod faults;
#[cfg(feature = "gpu")]
mod kernel;
#[cfg(feature = "gpu")]
mod matrix;
#[cfg(feature = "gpu")]
mod measure;
#[cfg(feature = "gpu")]
mod measure_check;
#[cfg(feature = "gpu")]
mod multiply;
#[cfg(feature = "gpu")]
mod numbers;
#[cfg(feature = "gpu")]
mod real;
#[cfg(feature = "gpu")]
mod recorder;
#[cfg(feature = "gpu")]
mod refine;
#[cfg(feature = "gpu")]
mod resident;
#[cfg(feature = "gpu")]
mod self_test;
#[cfg(feature = "gpu")]
mod solver;
#[cfg(feature = "gpu")]
mod sparse;
#[cfg(feature = "gpu")]
mod speeds;
#[cfg(feature = "gpu")]
mod trees;
#[cfg(feature = "gpu")]
mod triangle;
#[cfg(feature = "gpu")]
mod tridiagonal;
#[cfg(feature = "gpu")]
mod twin;

#[cfg(not(feature = "gpu"))]
#[path = "no_engine.rs"]
mod engine;

#[cfg(feature = "gpu")]
#[cfg(test)]
mod measure_tests;
#[cfg(feature = "gpu")]
#[cfg(test)]
mod tests;

pub use accelerator::{Accelerator, accelerator, choose};
pub use choice::GpuChoice;
pub use engine::{Adapter, adapters};
pub use error::GpuError;
pub use pair_sums::{
    EnclosureSums, Judge, MeasuredPairs, MeasuredPencil, MeasuredTrees, PairSums, ResidualSums, TreeNode,
};
pub use products::Resident;
