//! Products as files: NPZ, which the store keeps, safetensors and Matrix Market; eigenbases for MATLAB, viewers and
//! tables.

pub mod matlab;
pub mod matrix;
pub mod matrix_market;
pub mod npz;
mod product;
pub mod safetensors;
pub mod surface;

pub use npz::{DenseLayout, FormatError};
