//! The two precisions of the kernels.

use std::ops::{Add, Div, Mul, Sub};

/// How a product is cut into tiles: a work group computes `rows × columns` of the result, each of its threads
/// `own_rows × own_columns` of them, and `depth` terms at a time pass through the memory that the group shares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Tile {
    /// Rows of the result per group.
    pub rows: u32,
    /// Columns of the result per group.
    pub columns: u32,
    /// Terms held at a time.
    pub depth: u32,
    /// Rows per thread.
    pub own_rows: u32,
    /// Columns per thread.
    pub own_columns: u32,
}

/// f32 or f64.
pub trait Real:
    bytemuck::Pod
    + Copy
    + Send
    + Sync
    + PartialOrd
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// Its name in WGSL.
    const NAME: &'static str;
    /// Whether this is f64.
    const IS_F64: bool;
    /// The unit of rounding.
    const ROUNDING: f64;
    /// A square below which a norm counts as zero, where the matrix has a norm of at least about one; as WGSL has it.
    const TINY: (f64, &'static str);
    /// The tiles of products.
    const TILE: Tile;

    /// The nearest number of this precision.
    fn of(value: f64) -> Self;
    /// Its value.
    fn value(self) -> f64;
}

impl Real for f32 {
    const NAME: &'static str = "f32";
    const IS_F64: bool = false;
    const ROUNDING: f64 = f32::EPSILON as f64;
    const TINY: (f64, &'static str) = (1e-35, "1e-35f");
    const TILE: Tile = Tile { rows: 64, columns: 64, depth: 16, own_rows: 4, own_columns: 4 };

    fn of(value: f64) -> Self {
        value as f32
    }
    fn value(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    const NAME: &'static str = "f64";
    const IS_F64: bool = true;
    const ROUNDING: f64 = f64::EPSILON;
    const TINY: (f64, &'static str) = (1e-290, "1e-290lf");
    const TILE: Tile = Tile { rows: 64, columns: 64, depth: 8, own_rows: 4, own_columns: 4 };

    fn of(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
}
