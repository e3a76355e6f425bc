//! Products as files: NPZ, which the store keeps, safetensors and Matrix Market.

pub mod matrix_market;
pub mod npz;
mod product;
pub mod safetensors;

pub use npz::{DenseLayout, FormatError};
